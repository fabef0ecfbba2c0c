//! Lie derivatives along inertial navigation. One size serves all: a state holds everything, so the columns of a smaller
//! tangent are among those of the largest, `[δr δv δα δb_a δb_g δd]`.
use losnav_core::analysis::lie::{Series, seeded, still};
use losnav_core::math::real::{Real, Work};
use losnav_core::models::dynamics::flow::expand;
use losnav_core::models::dynamics::strapdown::{ImuSample, Strapdown};
use losnav_core::models::nav_state::NavState;
use losnav_core::models::state::State;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::dispatch::Lanes;
use crate::gravity::AnyGravity;
use crate::lie::{Arguments, Flowing, Place, sources};
use crate::strapdown::StrapdownModel;

/// Numbers of a state, of a sample of the unit, and components of the largest tangent.
const NUMBERS: usize = 19;
const SAMPLE: usize = 6;
const TANGENT: usize = 18;

/// [`expand`] in a function of its own.
struct Expansion<'a, V: Lanes, const C: usize> {
    model: &'a Strapdown<AnyGravity>,
    time: f64,
    state: NavState<Series<V, C>>,
    sample: ImuSample<Series<V, C>>,
    order: usize,
    all: bool,
}

impl<V: Lanes, const C: usize> Work for Expansion<'_, V, C> {
    type Output = NavState<Series<V, C>>;

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, time, state, sample, order, all } = self;
        expand::<_, Strapdown<AnyGravity>, TANGENT, C>(model, time, &state, sample, order, all)
    }
}

impl Flowing<TANGENT> for Strapdown<AnyGravity> {
    const LANES: bool = false;
    type Path<T: Real> = NavState<T>;

    #[inline(always)]
    fn path<V: Lanes, const C: usize>(
        &self,
        place: &Place<'_>,
        direction: &[V; TANGENT],
        order: usize,
        all: bool,
    ) -> NavState<Series<V, C>> {
        let mut state = NavState::origin();
        for (i, value) in place.state.iter().enumerate() {
            State::<Series<V, C>, TANGENT>::set_number(&mut state, i, still(*value));
        }
        let number = |i: usize| still(place.control.get(i).copied().unwrap_or(f64::NAN));
        let sample = ImuSample {
            specific_force: [number(0), number(1), number(2)],
            angular_rate: [number(3), number(4), number(5)],
        };
        let state = seeded(&state, direction);
        V::apart(Expansion { model: self, time: place.time, state, sample, order, all })
    }
}

/// `(B, M (K + 1), 18)`: as `lie_matrix`, of `(B, 19)` states and `(B, 6)` samples.
#[pyfunction]
#[pyo3(signature = (model, sensors, state, control, time, order, scale, pace, context, /))]
pub fn lie_inertial<'py>(
    py: Python<'py>,
    model: &StrapdownModel,
    sensors: &Bound<'py, PyTuple>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
    order: usize,
    scale: &Bound<'py, PyAny>,
    pace: &Bound<'py, PyAny>,
    context: &Bound<'py, PyDict>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Some(sources) = sources(sensors, context)? else { return Ok(None) };
    let arguments = Arguments::new([Some(state), Some(control), None, Some(time), Some(scale), Some(pace)])?;
    arguments.answer::<_, TANGENT>(py, model.model(), &sources, [NUMBERS, SAMPLE], order).map(Some)
}
