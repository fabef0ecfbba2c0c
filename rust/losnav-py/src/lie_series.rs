//! One half of a Lie matrix where the other is a model or a sensor in Python: series of a listed model, and what a listed
//! sensor sees of any series. A series is `(B, K + 1, 1 + N, numbers)`: values first, then derivatives along `N` directions.
use losnav_core::analysis::lie::{Series, still};
use losnav_core::error::ModelError;
use losnav_core::math::gradient::Gradient;
use losnav_core::math::jets::Jet;
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::flow::MAX_ORDER;
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::state::State;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{self, Floats};
use crate::dispatch::{LaneJob, Lanes, baseline};
use crate::dynamics::Parameters;
use crate::dynamics::listed::{
    ClohessyWiltshire, CurvilinearClohessyWiltshire, PerturbedTwoBody, RelativeTwoBody, TwoBody,
    YamanakaAnkersen,
};
use crate::errors::{choice_error, shape_error};
use crate::filter::{Context, Source};
use crate::lie::{Flowing, LONG, Look, Place, Table, UPRIGHT, attitude, directions, undefined};

/// Coefficients: one length for both, neither is called often.
const C: usize = LONG;

/// The series of the numbers of a state.
struct Paths<'a, M, const N: usize> {
    model: &'a M,
    place: Place<'a>,
    order: usize,
    out: &'a mut [f64],
}

impl<M: Flowing<N>, const N: usize> LaneJob for Paths<'_, M, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let numbers = <M::Path<f64> as State<f64, N>>::NUMBERS;
        let mut lanes = [0.0; 8];
        for column in (0..N).step_by(V::LANES) {
            let path = self.model.path::<V, C>(&self.place, &directions(column), self.order, true);
            for k in 0..=self.order {
                for i in 0..numbers {
                    let coefficient = path.number(i).coefficient(k);
                    coefficient.slope[0].write(&mut lanes[..V::LANES]);
                    for (lane, slope) in lanes.iter().enumerate().take(V::LANES.min(N - column)) {
                        if let Some(out) = self.out.get_mut((k * (1 + N) + 1 + column + lane) * numbers + i) {
                            *out = *slope;
                        }
                    }
                    if let Some(out) = self.out.get_mut(k * (1 + N) * numbers + i) {
                        *out = coefficient.value.lane(0);
                    }
                }
            }
        }
    }
}

/// `(B, K + 1, 1 + N, numbers)`: series of a listed model.
#[pyfunction]
#[pyo3(signature = (name, parameters, state, control, time, order, /))]
pub fn lie_path<'py>(
    py: Python<'py>,
    name: &str,
    parameters: Vec<f64>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
    order: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let (state, control, time) =
        (Floats::new(state, "state")?, Floats::new(control, "control")?, Floats::new(time, "time")?);
    let order = order.min(MAX_ORDER);
    macro_rules! choose {
        ($($listed:ident: $n:literal),* $(,)?) => {
            $(if name == <$listed as DynamicsModel<f64, $n>>::NAME {
                let model = $listed::from_parameters(&parameters)
                    .ok_or_else(|| shape_error("parameters", "those of the model", &[parameters.len()]))?;
                let numbers = <<$listed as Flowing<$n>>::Path<f64> as State<f64, $n>>::NUMBERS;
                let count = state.data().len() / numbers;
                let size = (order + 1) * (1 + $n) * numbers;
                let mut data = vec![0.0; count * size];
                for (k, out) in data.chunks_mut(size).enumerate() {
                    let row = |array: &Floats<'py>, width| Table { data: array.data(), width }.row(k).to_vec();
                    let (x, u, t) = (row(&state, numbers), row(&control, 3), row(&time, 1));
                    let place = Place { time: t.first().copied().unwrap_or(0.0), state: &x, control: &u };
                    baseline(Paths::<$listed, $n> { model: &model, place, order, out });
                }
                return convert::array(py, &[count, order + 1, 1 + $n, numbers], data);
            })*
        };
    }
    losnav_core::dynamics! { choose }
    Err(choice_error("dynamics", "the listed models", name))
}

/// What a sensor sees of a series.
struct Views<'a> {
    source: &'a Source,
    /// `(K + 1, 1 + N, numbers)`.
    series: &'a [f64],
    directions: usize,
    numbers: usize,
    order: usize,
    dcm: &'a [f64],
    /// `(K + 1, M, 1 + N)`.
    out: &'a mut [f64],
}

impl Views<'_> {
    /// Number `i` of the state with its derivatives along directions from `column` on.
    #[inline(always)]
    fn number<V: Lanes>(&self, i: usize, column: usize) -> Series<V, C> {
        if i >= self.numbers {
            return still(0.0);
        }
        let at = |k: usize, row: usize| {
            let inside = k <= self.order && row <= self.directions;
            let entry = self.series.get((k * (1 + self.directions) + row) * self.numbers + i);
            if inside { entry.copied().unwrap_or(0.0) } else { 0.0 }
        };
        let mut coefficients = [Gradient::constant(V::zero()); C];
        for (k, c) in coefficients.iter_mut().enumerate() {
            *c = Gradient { value: V::splat(at(k, 0)), slope: [V::gather(|lane| at(k, 1 + column + lane))] };
        }
        Jet::known(coefficients, self.order + 1)
    }
}

impl LaneJob for Views<'_> {
    type Output = Result<(), ModelError>;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Self::Output {
        let zeros = vec![still::<V, C>(0.0); self.source.rows];
        let mut rows = zeros.clone();
        let mut lanes = [0.0; 8];
        for column in (0..self.directions).step_by(V::LANES) {
            let triple = |from: usize| [0, 1, 2].map(|i| self.number::<V>(from + i, column));
            let x = Kinematics { position: triple(0), velocity: triple(3), dcm: attitude(self.dcm) };
            let sources = core::slice::from_ref(self.source);
            V::apart(Look { sources, x: &x, zeros: &zeros, rows: &mut rows })?;
            for k in 0..=self.order {
                for (m, row) in rows.iter().enumerate() {
                    let from = (k * self.source.rows + m) * (1 + self.directions);
                    let coefficient = row.coefficient(k);
                    coefficient.slope[0].write(&mut lanes[..V::LANES]);
                    let room = V::LANES.min(self.directions - column);
                    if let Some(out) = self.out.get_mut(from + 1 + column..from + 1 + column + room) {
                        out.copy_from_slice(&lanes[..room]);
                    }
                    if let Some(out) = self.out.get_mut(from) {
                        *out = coefficient.value.lane(0);
                    }
                }
            }
        }
        Ok(())
    }
}

/// `(K + 1, M, 1 + N)`: what a listed sensor sees of the series `(K + 1, 1 + N, numbers)` of a state `[r v ...]`; nothing if
/// the sensor is not a listed one.
#[pyfunction]
#[pyo3(signature = (sensor, series, dcm, context, /))]
pub fn lie_view<'py>(
    py: Python<'py>,
    sensor: &Bound<'py, PyAny>,
    series: &Bound<'py, PyAny>,
    dcm: Option<&Bound<'py, PyAny>>,
    context: &Bound<'py, PyDict>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(source) = Source::read(sensor)? else { return Ok(None) };
    let source = source.told(&Context::new(context)?)?.unwrap_or(source);
    let (series, dcm) =
        (Floats::new(series, "series")?, dcm.map(|array| Floats::new(array, "dcm")).transpose()?);
    let &[orders, rows, numbers] = series.shape() else {
        return Err(shape_error("series", "(K + 1, 1 + N, numbers)", series.shape()));
    };
    let (directions, order) = (rows.saturating_sub(1), orders.saturating_sub(1).min(MAX_ORDER));
    let mut data = vec![0.0; orders * source.rows * rows];
    let views = Views {
        source: &source,
        series: series.data(),
        directions,
        numbers,
        order,
        dcm: dcm.as_ref().map_or(&UPRIGHT[..], Floats::data),
        out: &mut data,
    };
    baseline(views).map_err(|error| undefined(0, 1, error))?;
    convert::array(py, &[orders, source.rows, rows], data).map(Some)
}
