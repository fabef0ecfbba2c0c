//! The listed dynamics over whole arrays: `losnav.dynamics`. Arguments come checked from there: `(B, N)` states,
//! `(B, 3)` controls, `(B,)` time steps.
use std::sync::Arc;

use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::perturbed_two_body::Stretch;
use losnav_core::models::dynamics::relative_two_body::Fix;
use losnav_core::models::ephemeris::Piece;
use pyo3::prelude::*;
use pyo3::types::PyList;
use rayon::prelude::*;

use crate::convert::{self, Floats, ScalarOrArray};
use crate::errors::{choice_error, shape_error};
use listed::{
    ClohessyWiltshire, CurvilinearClohessyWiltshire, PerturbedTwoBody, RelativeTwoBody, TwoBody,
    YamanakaAnkersen,
};

/// The names of `losnav_core::dynamics!`, each a type without parameters: import them where the list is used.
pub mod listed {
    pub use losnav_core::models::dynamics::{
        ClohessyWiltshire, CurvilinearClohessyWiltshire, TwoBody, YamanakaAnkersen,
    };

    /// With its fixes behind a shared pointer.
    pub type RelativeTwoBody = losnav_core::models::dynamics::RelativeTwoBody<super::Arc<[super::Fix]>>;

    /// With its ephemerides behind a shared pointer.
    pub type PerturbedTwoBody = losnav_core::models::dynamics::PerturbedTwoBody<super::Arc<[super::Stretch]>>;
}

/// Below this many numbers in the result threads cost more than they save.
const SERIAL: usize = 1 << 16;

/// How a listed model is made of the numbers its dataclass holds.
pub trait Parameters: Sized {
    /// The model, or nothing if the numbers are not as many as it has.
    fn from_parameters(parameters: &[f64]) -> Option<Self>;
}

impl Parameters for ClohessyWiltshire {
    fn from_parameters(parameters: &[f64]) -> Option<Self> {
        let &[mean_motion, acceleration_psd] = parameters else { return None };
        Some(Self { mean_motion, acceleration_psd })
    }
}

impl Parameters for CurvilinearClohessyWiltshire {
    fn from_parameters(parameters: &[f64]) -> Option<Self> {
        let &[mean_motion, radius, acceleration_psd] = parameters else { return None };
        Some(Self { linear: ClohessyWiltshire { mean_motion, acceleration_psd }, radius })
    }
}

impl Parameters for YamanakaAnkersen {
    fn from_parameters(parameters: &[f64]) -> Option<Self> {
        let &[mu, semi_major_axis, eccentricity, true_anomaly, acceleration_psd] = parameters else {
            return None;
        };
        Some(Self { mu, semi_major_axis, eccentricity, true_anomaly, acceleration_psd })
    }
}

impl Parameters for TwoBody {
    fn from_parameters(parameters: &[f64]) -> Option<Self> {
        let &[mu, j2, radius, acceleration_psd] = parameters else { return None };
        Some(Self { mu, j2, radius, acceleration_psd })
    }
}

impl Parameters for RelativeTwoBody {
    fn from_parameters(parameters: &[f64]) -> Option<Self> {
        let (planet, fixes) = parameters.split_first_chunk::<4>()?;
        let (fixes, rest) = fixes.as_chunks::<7>();
        let fix = |&[time, x, y, z, u, v, w]: &[f64; 7]| Fix { time, state: [x, y, z, u, v, w] };
        let chaser = fixes.iter().map(fix).collect();
        let complete = rest.is_empty() && !fixes.is_empty();
        complete.then_some(Self { planet: TwoBody::from_parameters(planet)?, chaser })
    }
}

/// Numbers of a stretch: those of the body and of time, then the polynomials.
const STRETCH: usize = 28;

impl Parameters for PerturbedTwoBody {
    fn from_parameters(parameters: &[f64]) -> Option<Self> {
        let (planet, stretches) = parameters.split_first_chunk::<4>()?;
        let (stretches, rest) = stretches.as_chunks::<STRETCH>();
        let stretch = |numbers: &[f64; STRETCH]| {
            let [mu, left, start, length, ..] = *numbers;
            let mut coefficients = [[0.0; 8]; 3];
            coefficients.as_flattened_mut().copy_from_slice(&numbers[4..]);
            Stretch { mu, left: left as usize, piece: Piece { start, length, coefficients } }
        };
        let bodies = stretches.iter().map(stretch).collect();
        rest.is_empty().then_some(Self { planet: TwoBody::from_parameters(planet)?, bodies })
    }
}

/// A model whose state is an array and whose control is an acceleration.
trait VectorModel<const N: usize>: DynamicsModel<f64, N, State = [f64; N], Control = [f64; 3]> + Sync {}

impl<M, const N: usize> VectorModel<N> for M where
    M: DynamicsModel<f64, N, State = [f64; N], Control = [f64; 3]> + Sync
{
}

/// What is asked of a model.
#[derive(Clone, Copy)]
enum Question {
    /// `x'`, `(B, N)`.
    State,
    /// `Φ`, `(B, N, N)`.
    Transition,
    /// `Q`, `(B, N, N)`.
    Noise,
}

/// The rows of the arguments.
struct Batch<'a> {
    states: &'a [f64],
    controls: &'a [[f64; 3]],
    steps: &'a [f64],
    /// When the steps start; of a trajectory only the first.
    times: &'a [f64],
}

impl Batch<'_> {
    fn states<const N: usize>(&self) -> PyResult<&[[f64; N]]> {
        let (rows, rest) = self.states.as_chunks::<N>();
        let fits = [self.steps.len(), self.controls.len(), self.times.len()].iter().all(|n| *n == rows.len());
        if fits && rest.is_empty() {
            Ok(rows)
        } else {
            Err(shape_error("state", "(B, N)", &[self.states.len()]))
        }
    }

    fn answer<M, const N: usize>(&self, model: &M, question: Question) -> PyResult<(Vec<f64>, Vec<usize>)>
    where
        M: VectorModel<N>,
    {
        let states = self.states::<N>()?;
        let (size, shape) = match question {
            Question::State => (N, vec![states.len(), N]),
            Question::Transition | Question::Noise => (N * N, vec![states.len(), N, N]),
        };
        let mut data = vec![0.0; states.len() * size];
        let one = |(k, out): (usize, &mut [f64])| {
            let (x, u, step) = (&states[k], self.controls[k], model.prepare(self.times[k], self.steps[k]));
            match question {
                Question::State => out.copy_from_slice(&model.propagate(&step, x, u)),
                Question::Transition => out.copy_from_slice(model.transition(&step, x, u).1.as_flattened()),
                Question::Noise => out.copy_from_slice(model.process_noise(&step, x).as_flattened()),
            }
        };
        if data.len() < SERIAL {
            data.chunks_mut(size).enumerate().for_each(one);
        } else {
            data.par_chunks_mut(size).with_min_len(64).enumerate().for_each(one);
        }
        Ok((data, shape))
    }

    /// States at the ends of all steps, the start included: `(B, T + 1, N)` from `(B, N)`, `(B, T, 3)`, `(T,)`.
    fn trajectory<M, const N: usize>(&self, model: &M) -> PyResult<(Vec<f64>, Vec<usize>)>
    where
        M: VectorModel<N>,
    {
        let states = self.states.as_chunks::<N>().0;
        let steps = self.steps.len();
        if self.controls.len() != states.len() * steps {
            return Err(shape_error("control", "(B, T, 3)", &[self.controls.len(), 3]));
        }
        let mut data = vec![0.0; states.len() * (steps + 1) * N];
        let one = |(k, out): (usize, &mut [f64])| {
            let (mut x, mut time) = (states[k], self.times.first().copied().unwrap_or(0.0));
            for (step, row) in out.as_chunks_mut::<N>().0.iter_mut().enumerate() {
                if let Some(before) = step.checked_sub(1) {
                    let step = model.prepare(time, self.steps[before]);
                    time += self.steps[before];
                    x = model.propagate(&step, &x, self.controls[k * steps + before]);
                }
                *row = x;
            }
        };
        let size = (steps + 1) * N;
        if data.len() < SERIAL {
            data.chunks_mut(size).enumerate().for_each(one);
        } else {
            data.par_chunks_mut(size).enumerate().for_each(one);
        }
        Ok((data, vec![states.len(), steps + 1, N]))
    }
}

/// Something to do with a model, whichever it is.
trait Task {
    fn run<M, const N: usize>(&self, model: &M) -> PyResult<(Vec<f64>, Vec<usize>)>
    where
        M: VectorModel<N>;
}

struct Ask<'a>(Batch<'a>, Question);

impl Task for Ask<'_> {
    fn run<M, const N: usize>(&self, model: &M) -> PyResult<(Vec<f64>, Vec<usize>)>
    where
        M: VectorModel<N>,
    {
        self.0.answer(model, self.1)
    }
}

struct Trace<'a>(Batch<'a>);

impl Task for Trace<'_> {
    fn run<M, const N: usize>(&self, model: &M) -> PyResult<(Vec<f64>, Vec<usize>)>
    where
        M: VectorModel<N>,
    {
        self.0.trajectory(model)
    }
}

/// What a model's dataclass holds: a list of a few numbers, or an array of many.
pub fn numbers(parameters: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    match parameters.cast_exact::<PyList>() {
        Ok(list) => list.extract(),
        Err(_) => Ok(Floats::new(parameters, "parameters")?.data().to_vec()),
    }
}

/// Runs the task on the listed model of that name, without the GIL.
fn with_model<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &[f64],
    task: &(impl Task + Sync),
) -> PyResult<Bound<'py, PyAny>> {
    macro_rules! choose {
        ($($listed:ident: $n:literal),* $(,)?) => {
            $(if name == <$listed as DynamicsModel<f64, $n>>::NAME {
                let model = $listed::from_parameters(parameters)
                    .ok_or_else(|| shape_error("parameters", "those of the model", &[parameters.len()]))?;
                let (data, shape) = py.detach(|| task.run::<$listed, $n>(&model))?;
                return convert::array(py, &shape, data);
            })*
        };
    }
    losnav_core::dynamics! { choose }
    Err(choice_error("dynamics", "the listed models", name))
}

fn ask<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &[f64],
    arguments: [&Bound<'py, PyAny>; 4],
    question: Option<Question>,
) -> PyResult<Bound<'py, PyAny>> {
    let [state, control, dt, time] = arguments;
    let (state, control) = (Floats::new(state, "state")?, Floats::new(control, "control")?);
    let (dt, time) = (Floats::new(dt, "dt")?, Floats::new(time, "time")?);
    let controls = control.data().as_chunks::<3>().0;
    let batch = Batch { states: state.data(), controls, steps: dt.data(), times: time.data() };
    match question {
        Some(question) => with_model(py, name, parameters, &Ask(batch, question)),
        None => with_model(py, name, parameters, &Trace(batch)),
    }
}

/// `x'` (question 0), `Φ` (1) or `Q` (2) of one state, or nothing if an argument is not a single finite one: the
/// caller then checks and broadcasts.
#[pyfunction]
#[pyo3(signature = (name, parameters, question, state, control, dt, time, /))]
#[expect(clippy::too_many_arguments, reason = "what the Python method takes")]
pub fn dynamics_single<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyAny>,
    question: u8,
    state: &Bound<'py, PyAny>,
    control: Option<&Bound<'py, PyAny>>,
    dt: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyAny>>> {
    let parameters = numbers(parameters)?;
    let state = Floats::new(state, "state")?;
    let control = control.map(|value| Floats::new(value, "control")).transpose()?;
    let ScalarOrArray::Scalar(dt) = ScalarOrArray::new(dt, "dt")? else { return Ok(None) };
    let ScalarOrArray::Scalar(time) = ScalarOrArray::new(time, "time")? else { return Ok(None) };
    let control = match &control {
        None => [0.0; 3],
        Some(array) => match (array.shape(), array.data()) {
            ([3], &[x, y, z]) => [x, y, z],
            _ => return Ok(None),
        },
    };
    let question = [Question::State, Question::Transition, Question::Noise][usize::from(question.min(2))];
    macro_rules! choose {
        ($($listed:ident: $n:literal),* $(,)?) => {
            $(if name == <$listed as DynamicsModel<f64, $n>>::NAME {
                let model = $listed::from_parameters(&parameters);
                let (Some(model), true, Some(x)) = (model, state.shape() == [$n], state.data().first_chunk::<$n>())
                else {
                    return Ok(None);
                };
                let batch = Batch { states: x, controls: &[control], steps: &[dt], times: &[time] };
                let (data, shape) = batch.answer::<$listed, $n>(&model, question)?;
                let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
                if !(finite(x) && finite(&control) && dt.is_finite() && time.is_finite() && finite(&data)) {
                    return Ok(None);
                }
                return convert::array(py, &shape[1..], data).map(Some);
            })*
        };
    }
    losnav_core::dynamics! { choose }
    Err(choice_error("dynamics", "the listed models", name))
}

/// `(B, N)` states after the steps.
#[pyfunction]
#[pyo3(signature = (name, parameters, state, control, dt, time, /))]
pub fn dynamics_propagate<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    dt: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    ask(py, name, &numbers(parameters)?, [state, control, dt, time], Some(Question::State))
}

/// `(B, N, N)` transition matrices.
#[pyfunction]
#[pyo3(signature = (name, parameters, state, control, dt, time, /))]
pub fn dynamics_transition<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    dt: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    ask(py, name, &numbers(parameters)?, [state, control, dt, time], Some(Question::Transition))
}

/// `(B, N, N)` process noise.
#[pyfunction]
#[pyo3(signature = (name, parameters, state, control, dt, time, /))]
pub fn dynamics_process_noise<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    dt: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    ask(py, name, &numbers(parameters)?, [state, control, dt, time], Some(Question::Noise))
}

/// `(B, T + 1, N)` states from `(B, N)`, `(B, T, 3)` controls and `(T,)` steps, the first at `time`.
#[pyfunction]
#[pyo3(signature = (name, parameters, state, control, dt, time, /))]
pub fn dynamics_trajectory<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    control: &Bound<'py, PyAny>,
    dt: &Bound<'py, PyAny>,
    time: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    ask(py, name, &numbers(parameters)?, [state, control, dt, time], None)
}
