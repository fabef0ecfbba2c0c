//! Lie derivatives of listed sensors along listed dynamics. Arguments come checked from `losnav.observability`: `(B, N)`
//! states, and of everything else a row for each state or one for all.
//!
//! Lanes are directions of the state: the values of a series are the same in all, its derivatives are those along one
//! direction each, so that one state is as wide as the instruction set, and many are shared out to the cores.
use losnav_core::analysis::lie::{Series, factorial, see, seeded, still};
use losnav_core::error::ModelError;
use losnav_core::math::real::{Real, Work};
use losnav_core::math::vec3::Mat3;
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::flow::{MAX_ORDER, expand};
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::sensors::{Law, SensorModel};
use losnav_core::models::state::State;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::convert::{self, Floats};
use crate::dispatch::{LaneJob, Lanes, baseline, many};
use crate::dynamics::Parameters;
use crate::dynamics::listed::{
    ClohessyWiltshire, CurvilinearClohessyWiltshire, PerturbedTwoBody, RelativeTwoBody, TwoBody,
    YamanakaAnkersen,
};
use crate::errors::{InvalidInputError, choice_error, shape_error};
use crate::filter::{Context, Source};
use crate::threads::share_out;

/// Coefficients of a short series: order 5, that of most studies, without the memory of the longest; in as many lanes as
/// there are.
const SHORT: usize = 6;
/// Coefficients of a long one, for which a lane has to do: less code.
pub const LONG: usize = MAX_ORDER + 1;
/// States one thread takes at a time.
const CHUNK: usize = 64;
/// Directions the widest lanes hold.
const WIDEST: usize = 8;

/// A model through which series flow.
pub trait Flowing<const N: usize>: Sync {
    /// Is a short series worth the code of as many lanes as there are?  Of models that are studied over many states.
    const LANES: bool;
    /// What flows.
    type Path<T: Real>: State<T, N>;
    /// The path from a state moved along a direction, each lane its own.
    fn path<V: Lanes, const C: usize>(
        &self,
        place: &Place<'_>,
        direction: &[V; N],
        order: usize,
        all: bool,
    ) -> Self::Path<Series<V, C>>;
}

/// Where a series starts.
#[derive(Clone, Copy)]
pub struct Place<'a> {
    /// s.
    pub time: f64,
    /// The numbers of the state.
    pub state: &'a [f64],
    /// Held along the way.
    pub control: &'a [f64],
}

/// [`expand`] in a function of its own: one for each model and kind of number.
struct Expansion<'a, M, S, U> {
    model: &'a M,
    time: f64,
    state: S,
    control: U,
    order: usize,
    all: bool,
}

macro_rules! every_flow {
    ($($listed:ident: $n:literal),* $(,)?) => {
        $(impl Flowing<$n> for $listed {
            const LANES: bool =
                matches!(stringify!($listed).as_bytes(), b"TwoBody" | b"ClohessyWiltshire");
            type Path<T: Real> = [T; $n];
            #[inline(always)]
            fn path<V: Lanes, const C: usize>(
                &self,
                place: &Place<'_>,
                direction: &[V; $n],
                order: usize,
                all: bool,
            ) -> [Series<V, C>; $n] {
                let number = |from: &[f64], i: usize| still(from.get(i).copied().unwrap_or(f64::NAN));
                let mut state = [still(0.0); $n];
                for (i, entry) in state.iter_mut().enumerate() {
                    *entry = number(place.state, i);
                }
                let control = [0, 1, 2].map(|i| number(place.control, i));
                let state = seeded(&state, direction);
                let expansion = Expansion { model: self, time: place.time, state, control, order, all };
                V::apart::<Expansion<'_, Self, _, _>>(expansion)
            }
        })*
        $(impl<V: Lanes, const C: usize> Work
            for Expansion<'_, $listed, [Series<V, C>; $n], [Series<V, C>; 3]>
        {
            type Output = [Series<V, C>; $n];
            #[inline(always)]
            fn run(self) -> Self::Output {
                let Self { model, time, state, control, order, all } = self;
                expand::<_, $listed, $n, C>(model, time, &state, control, order, all)
            }
        })*
    };
}
losnav_core::dynamics! { every_flow }

/// The states of a call and what they are asked.
pub struct Question<'a> {
    sources: &'a [Source],
    states: Table<'a>,
    controls: Table<'a>,
    attitudes: Table<'a>,
    times: Table<'a>,
    /// Size of one unit of each component.
    scales: Table<'a>,
    /// Unit of time.
    paces: Table<'a>,
    order: usize,
}

/// A row of numbers for each state, or one for all.
#[derive(Clone, Copy)]
pub struct Table<'a> {
    /// All rows.
    pub data: &'a [f64],
    /// Numbers in one.
    pub width: usize,
}

impl<'a> Table<'a> {
    /// That of state `k`.
    pub fn row(&self, k: usize) -> &'a [f64] {
        let from = if self.data.len() == self.width { 0 } else { k * self.width };
        self.data.get(from..from + self.width).unwrap_or(&[])
    }

    fn number(&self, k: usize) -> f64 {
        self.row(k).first().copied().unwrap_or(f64::NAN)
    }
}

impl Question<'_> {
    fn count(&self) -> usize {
        self.states.data.len() / self.states.width.max(1)
    }

    fn rows(&self) -> usize {
        self.sources.iter().map(|source| source.rows).sum()
    }
}

/// Nine numbers as a matrix.
#[inline(always)]
pub fn attitude<T: Real>(row: &[f64]) -> Mat3<T> {
    [0, 3, 6].map(|i| [0, 1, 2].map(|j| T::splat(row.get(i + j).copied().unwrap_or(f64::NAN))))
}

/// Directions from `column` on, one for each lane.
#[inline(always)]
pub fn directions<V: Lanes, const N: usize>(column: usize) -> [V; N] {
    let mut direction = [V::zero(); N];
    for (i, entry) in direction.iter_mut().enumerate() {
        *entry = V::gather(|lane| if column + lane == i { 1.0 } else { 0.0 });
    }
    direction
}

/// What all sensors see of a path, one after another, and the least order of it: in a function of its own, whatever the model.
pub struct Look<'a, V: Lanes, const C: usize> {
    /// The sensors.
    pub sources: &'a [Source],
    /// What they are shown.
    pub x: &'a Kinematics<Series<V, C>>,
    /// What they measured: as many zeros as the largest of them has rows.
    pub zeros: &'a [Series<V, C>],
    /// What they say.
    pub rows: &'a mut [Series<V, C>],
}

/// One sensor.
struct Seen<'a, V: Lanes, const C: usize> {
    x: &'a Kinematics<Series<V, C>>,
    rows: &'a mut [Series<V, C>],
    outcome: Result<usize, ModelError>,
}

impl<V: Lanes, const C: usize> Law<Series<V, C>> for Seen<'_, V, C> {
    #[inline(always)]
    fn examine(&mut self, sensor: &impl SensorModel<Series<V, C>>) {
        self.outcome = see(sensor, self.x, self.rows);
    }
}

impl<V: Lanes, const C: usize> Work for Look<'_, V, C> {
    type Output = Result<usize, ModelError>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let (mut least, mut from) = (C - 1, 0);
        for source in self.sources {
            let Some(rows) = self.rows.get_mut(from..from + source.rows) else { break };
            let mut law = Seen { x: self.x, rows, outcome: Ok(0) };
            source.show(&[], self.zeros.get(..source.rows).unwrap_or(&[]), &mut law);
            least = least.min(law.outcome?);
            from += source.rows;
        }
        Ok(least)
    }
}

/// The matrices of some states.
struct Matrices<'a, M, const N: usize, const C: usize> {
    model: &'a M,
    question: &'a Question<'a>,
    first: usize,
    out: &'a mut [f64],
}

impl<M: Flowing<N>, const N: usize, const C: usize> LaneJob for Matrices<'_, M, N, C> {
    type Output = Result<(), (usize, ModelError)>;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Self::Output {
        let Self { model, question, first, out } = self;
        let (count, order) = (question.rows(), question.order);
        let zeros = vec![still::<V, C>(0.0); count];
        let mut rows = zeros.clone();
        let size = count * (order + 1) * N;
        for (offset, matrix) in out.chunks_mut(size.max(1)).enumerate() {
            let k = first + offset;
            let place = Place {
                time: question.times.number(k),
                state: question.states.row(k),
                control: question.controls.row(k),
            };
            let dcm = attitude::<Series<V, C>>(question.attitudes.row(k));
            for column in (0..N).step_by(V::LANES) {
                let direction = directions::<V, N>(column);
                for all in [false, true] {
                    let path = model.path::<V, C>(&place, &direction, order, all);
                    let (sources, x) = (question.sources, &path.kinematics(&dcm));
                    let known = V::apart(Look { sources, x, zeros: &zeros, rows: &mut rows });
                    if known.map_err(|error| (k, error))? >= order {
                        break;
                    }
                }
                write::<V, N, C>(&rows, question, k, column, matrix);
            }
        }
        Ok(())
    }
}

/// Puts the derivatives of the rows along the directions from `column` on in their place.
#[inline(always)]
fn write<V: Lanes, const N: usize, const C: usize>(
    rows: &[Series<V, C>],
    question: &Question<'_>,
    k: usize,
    column: usize,
    matrix: &mut [f64],
) {
    let (scale, pace) = (question.scales.row(k), question.paces.number(k));
    let mut unit = 1.0;
    for order in 0..=question.order {
        for (m, series) in rows.iter().enumerate() {
            let mut lanes = [0.0; WIDEST];
            let slope = V::splat(unit * factorial(order)) * series.coefficient(order).slope[0];
            slope.write(&mut lanes[..V::LANES]);
            let from = (order * rows.len() + m) * N + column;
            let room = matrix.get_mut(from..from + V::LANES.min(N - column)).unwrap_or(&mut []);
            for ((out, lane), scale) in room.iter_mut().zip(lanes).zip(scale.iter().skip(column)) {
                *out = lane * scale;
            }
        }
        unit *= pace;
    }
}

/// All matrices, `(B, (K + 1) M, N)`, or the first state where a measurement is undefined.
fn matrices<M: Flowing<N>, const N: usize>(
    model: &M,
    question: &Question<'_>,
) -> Result<Vec<f64>, (usize, ModelError)> {
    let count = question.count();
    let size = question.rows() * (question.order + 1) * N;
    let mut data = vec![0.0; count * size];
    let work = |(chunk, out): (usize, &mut [f64])| {
        let first = chunk * CHUNK;
        if M::LANES && question.order < SHORT && question.sources.iter().all(|source| source.lanes) {
            many(Matrices::<M, N, SHORT> { model, question, first, out })
        } else {
            baseline(Matrices::<M, N, LONG> { model, question, first, out })
        }
    };
    if count <= 1 {
        work((0, &mut data))?;
        return Ok(data);
    }
    let worst = std::sync::Mutex::new(Ok(()));
    share_out(data.chunks_mut((CHUNK * size).max(1)).enumerate(), |piece| {
        if let (Err(error), Ok(mut worst)) = (work(piece), worst.lock()) {
            let earlier = worst.as_ref().err().is_some_and(|known: &(usize, ModelError)| known.0 < error.0);
            if !earlier {
                *worst = Err(error);
            }
        }
    });
    worst.into_inner().unwrap_or(Ok(())).map(|()| data)
}

/// Sensors as the caller tells them; nothing if one of them is not a listed one.
pub fn sources(sensors: &Bound<'_, PyTuple>, told: &Bound<'_, PyDict>) -> PyResult<Option<Vec<Source>>> {
    let context = Context::new(told)?;
    let mut sources = Vec::with_capacity(sensors.len());
    for sensor in sensors {
        let Some(source) = Source::read(&sensor)? else { return Ok(None) };
        if source.time_varying {
            let text =
                "sensor: looks at something that moves by itself; its derivatives in time are not known";
            return Err(InvalidInputError::new_err(text));
        }
        sources.push(source.told(&context)?.unwrap_or(source));
    }
    Ok(Some(sources))
}

/// Arrays of a call: state, control, attitude, time, sizes of the components, unit of time.
pub struct Arguments<'py> {
    arrays: [Option<Floats<'py>>; 6],
}

impl<'py> Arguments<'py> {
    /// Reads them.
    pub fn new(given: [Option<&Bound<'py, PyAny>>; 6]) -> PyResult<Self> {
        let mut arrays = [const { None }; 6];
        for (array, value) in arrays.iter_mut().zip(given) {
            *array = value.map(|value| Floats::new(value, "argument")).transpose()?;
        }
        Ok(Self { arrays })
    }

    fn table(&self, i: usize, width: usize) -> Table<'_> {
        let array = self.arrays.get(i).and_then(Option::as_ref);
        Table { data: array.map_or(&UPRIGHT[..], Floats::data), width }
    }

    /// `(B, M (K + 1), N)`: the matrices of a model.
    pub fn answer<M: Flowing<N>, const N: usize>(
        &self,
        py: Python<'py>,
        model: &M,
        sources: &[Source],
        widths: [usize; 2],
        order: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        let question = Question {
            sources,
            states: self.table(0, widths[0]),
            controls: self.table(1, widths[1]),
            attitudes: self.table(2, 9),
            times: self.table(3, 1),
            scales: self.table(4, N),
            paces: self.table(5, 1),
            order: order.min(MAX_ORDER),
        };
        let count = question.count();
        let answer = if count > 1 {
            py.detach(|| matrices::<M, N>(model, &question))
        } else {
            matrices::<M, N>(model, &question)
        };
        let data = answer.map_err(|(k, error)| undefined(k, count, error))?;
        convert::array(py, &[count, question.rows() * (question.order + 1), N], data)
    }
}

/// `(B, M (K + 1), N)` gradients of Lie derivatives, rows of order `k` times `pace^k`, columns times `scale`; or nothing
/// if a sensor is not a listed one.
#[pyfunction]
#[pyo3(signature = (name, parameters, sensors, state, control, dcm, time, order, scale, pace, context, /))]
pub fn lie_matrix<'py>(
    py: Python<'py>,
    name: &str,
    parameters: Vec<f64>,
    sensors: &Bound<'py, PyTuple>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    dcm: Option<&Bound<'py, PyAny>>,
    time: &Bound<'py, PyAny>,
    order: usize,
    scale: &Bound<'py, PyAny>,
    pace: &Bound<'py, PyAny>,
    context: &Bound<'py, PyDict>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(sources) = sources(sensors, context)? else { return Ok(None) };
    if dcm.is_none() && sources.iter().any(|source| source.needs_attitude) {
        let text = "dcm: expected the attitude (body from reference), which this state does not hold";
        return Err(InvalidInputError::new_err(text));
    }
    let arguments = Arguments::new([Some(state), Some(control), dcm, Some(time), Some(scale), Some(pace)])?;
    macro_rules! choose {
        ($($listed:ident: $n:literal),* $(,)?) => {
            $(if name == <$listed as DynamicsModel<f64, $n>>::NAME {
                let model = $listed::from_parameters(&parameters)
                    .ok_or_else(|| shape_error("parameters", "those of the model", &[parameters.len()]))?;
                return arguments.answer::<$listed, $n>(py, &model, &sources, [$n, 3], order).map(Some);
            })*
        };
    }
    losnav_core::dynamics! { choose }
    Err(choice_error("dynamics", "the listed models", name))
}

/// A listed model, a listed sensor and fixed units, read once: for who asks again and again at single states.
#[pyclass(frozen, module = "losnav._core")]
pub struct LieStudy {
    name: String,
    parameters: Vec<f64>,
    sources: Vec<Source>,
    scale: Vec<f64>,
    pace: f64,
}

#[pymethods]
impl LieStudy {
    /// Nothing if the sensor is not a listed one, or needs more than the state.
    #[staticmethod]
    #[pyo3(signature = (name, parameters, sensor, scale, pace, /))]
    fn of(
        name: String,
        parameters: Vec<f64>,
        sensor: &Bound<'_, PyAny>,
        scale: Vec<f64>,
        pace: f64,
    ) -> PyResult<Option<Self>> {
        let source = Source::read(sensor)?.filter(|source| !source.time_varying && !source.needs_attitude);
        let Some(source) = source else { return Ok(None) };
        Ok(Some(Self { name, parameters, sources: vec![source], scale, pace }))
    }

    /// `(M (K + 1), N)`; nothing if that cannot be, and the caller says why.
    #[pyo3(signature = (state, order, /))]
    fn matrix<'py>(
        &self,
        py: Python<'py>,
        state: &Bound<'py, PyAny>,
        order: usize,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let state = Floats::new(state, "state")?;
        macro_rules! choose {
            ($($listed:ident: $n:literal),* $(,)?) => {
                $(if self.name == <$listed as DynamicsModel<f64, $n>>::NAME {
                    let model = $listed::from_parameters(&self.parameters);
                    let (Some(model), true, true) = (model, state.shape() == [$n], order <= MAX_ORDER) else {
                        return Ok(None);
                    };
                    let table = |data, width| Table { data, width };
                    let question = Question {
                        sources: &self.sources,
                        states: table(state.data(), $n),
                        controls: table(&[0.0; 3], 3),
                        attitudes: table(&UPRIGHT, 9),
                        times: table(&[0.0], 1),
                        scales: table(&self.scale, $n),
                        paces: table(core::slice::from_ref(&self.pace), 1),
                        order,
                    };
                    let found = matrices::<$listed, $n>(&model, &question).ok();
                    let sound = found.filter(|data| data.iter().all(|value| value.is_finite()));
                    let shape = [question.rows() * (order + 1), $n];
                    return sound.map(|data| convert::array(py, &shape, data)).transpose();
                })*
            };
        }
        losnav_core::dynamics! { choose }
        Ok(None)
    }
}

/// The attitude of who needs none.
pub const UPRIGHT: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// The exception of a measurement that is undefined at a state.
pub fn undefined(k: usize, count: usize, error: ModelError) -> PyErr {
    let at = if count == 1 { String::new() } else { format!(" (state {k} of the batch)") };
    InvalidInputError::new_err(format!("state: {error}{at}"))
}
