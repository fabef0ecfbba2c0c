//! Inertial navigation over whole arrays: `losnav.dynamics.Strapdown`. Arguments come checked from there: `(B, 19)` states,
//! `(B, 6)` samples `[f w]`, `(B,)` time steps.
use losnav_core::math::real::Real;
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::strapdown::{ImuSample, Strapdown};
use losnav_core::models::nav_state::NavState;
use losnav_core::models::state::State;
use pyo3::prelude::*;

use crate::convert::{self, Floats};
use crate::dispatch::{LaneJob, Lanes, many, one};
use crate::errors::shape_error;
use crate::gravity::AnyGravity;
use crate::inertial::model_of;
use crate::threads::share_out;

/// Numbers of a state and of a sample.
const NUMBERS: usize = 19;
const SAMPLE: usize = 6;

/// A state from lane `i`'s numbers.
#[inline(always)]
pub fn gather_state<V: Lanes>(number: impl Fn(usize, usize) -> f64) -> NavState<V> {
    let mut state = NavState::origin();
    for i in 0..NUMBERS {
        State::<V, 9>::set_number(&mut state, i, V::gather(|lane| number(lane, i)));
    }
    state
}

/// A sample from lane `i`'s numbers.
#[inline(always)]
pub fn gather_sample<V: Lanes>(number: impl Fn(usize, usize) -> f64) -> ImuSample<V> {
    let three = |from: usize| [0, 1, 2].map(|k| V::gather(|lane| number(lane, from + k)));
    ImuSample { specific_force: three(0), angular_rate: three(3) }
}

/// Numbers of one lane of a state.
#[inline(always)]
fn write_state<T: Real>(state: &NavState<T>, lane: usize, out: &mut [f64]) {
    for (i, out) in out.iter_mut().enumerate() {
        *out = State::<T, 9>::number(state, i).lane(lane);
    }
}

/// States of several runs through the same steps, `(B, T + 1, 19)`; the first are the given ones.
struct Trace<'a> {
    model: &'a Strapdown<AnyGravity>,
    states: &'a [[f64; NUMBERS]],
    /// `(B, T, 6)`.
    samples: &'a [[f64; SAMPLE]],
    /// Length of each step and into how many equal parts it is cut.
    steps: &'a [(f64, usize)],
    out: &'a mut [f64],
}

impl LaneJob for Trace<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let steps = self.steps.len();
        let size = (steps + 1) * NUMBERS;
        for (group, out) in self.out.chunks_mut(V::LANES * size).enumerate() {
            let first = group * V::LANES;
            let last = self.states.len() - 1;
            let run = |lane: usize| (first + lane).min(last);
            let mut state: NavState<V> = gather_state(|lane, i| self.states[run(lane)][i]);
            for step in 0..=steps {
                if let Some(before) = step.checked_sub(1) {
                    let (dt, parts) = self.steps[before];
                    let sample = gather_sample(|lane, i| self.samples[run(lane) * steps + before][i]);
                    let part = DynamicsModel::<V, 18>::prepare(self.model, 0.0, dt / parts as f64);
                    for _ in 0..parts {
                        state = DynamicsModel::<V, 18>::propagate(self.model, &part, &state, sample);
                    }
                }
                for (lane, out) in out.chunks_mut(size).enumerate() {
                    write_state(&state, lane, &mut out[step * NUMBERS..(step + 1) * NUMBERS]);
                }
            }
        }
    }
}

/// States after one step each, `(B, 19)`.
struct Move<'a> {
    model: &'a Strapdown<AnyGravity>,
    states: &'a [[f64; NUMBERS]],
    samples: &'a [[f64; SAMPLE]],
    steps: &'a [f64],
    out: &'a mut [f64],
}

impl LaneJob for Move<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for (k, out) in self.out.chunks_mut(NUMBERS).enumerate() {
            let state: NavState<V> = gather_state(|_, i| self.states[k][i]);
            let sample = gather_sample(|_, i| self.samples[k][i]);
            let step = DynamicsModel::<V, 18>::prepare(self.model, 0.0, self.steps[k]);
            write_state(&DynamicsModel::<V, 18>::propagate(self.model, &step, &state, sample), 0, out);
        }
    }
}

/// `Φ`, or `Q`, of one step each, `(B, N, N)`.
struct Linearize<'a, const N: usize> {
    model: &'a Strapdown<AnyGravity>,
    states: &'a [[f64; NUMBERS]],
    samples: &'a [[f64; SAMPLE]],
    steps: &'a [f64],
    noise: bool,
    out: &'a mut [f64],
}

impl<const N: usize> LaneJob for Linearize<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for (k, out) in self.out.chunks_mut(N * N).enumerate() {
            let state: NavState<V> = gather_state(|_, i| self.states[k][i]);
            let sample = gather_sample(|_, i| self.samples[k][i]);
            let step = DynamicsModel::<V, N>::prepare(self.model, 0.0, self.steps[k]);
            let (_, phi, q): (_, [[V; N]; N], _) = self.model.predict(&step, &state, sample);
            let matrix = if self.noise { q } else { phi };
            for (out, value) in out.iter_mut().zip(matrix.as_flattened()) {
                *out = value.lane(0);
            }
        }
    }
}

/// Rows of a batch, and how they are shared out.
struct Rows<'a> {
    states: &'a [[f64; NUMBERS]],
    samples: &'a [[f64; SAMPLE]],
    steps: &'a [f64],
}

/// Below this many steps threads cost more than they save.
const SERIAL: usize = 256;

impl Rows<'_> {
    /// Calls `each(states, samples, steps, out)` of pieces of the rows, `size` numbers of result for each.
    fn spread(
        &self,
        size: usize,
        each: impl Fn(&[[f64; NUMBERS]], &[[f64; SAMPLE]], &[f64], &mut [f64]) + Sync,
    ) -> Vec<f64> {
        let mut data = vec![0.0; self.states.len() * size];
        if self.states.len() < SERIAL {
            each(self.states, self.samples, self.steps, &mut data);
        } else {
            let piece = 64;
            let inputs =
                self.states.chunks(piece).zip(self.samples.chunks(piece)).zip(self.steps.chunks(piece));
            share_out(inputs.zip(data.chunks_mut(piece * size)), |(((states, samples), steps), out)| {
                each(states, samples, steps, out);
            });
        }
        data
    }
}

/// A model of inertial navigation, ready to run.
#[pyclass(frozen, module = "losnav._core")]
pub struct StrapdownModel {
    model: Strapdown<AnyGravity>,
}

impl StrapdownModel {
    /// The model.
    pub fn model(&self) -> &Strapdown<AnyGravity> {
        &self.model
    }
}

#[pymethods]
impl StrapdownModel {
    /// Of `site_from_fixed` (9), `center` (3), `angular_velocity` (3); the gravity; and the six numbers of
    /// [`Noise`] in order.
    /// Of `site_from_fixed` (9), `center` (3), `angular_velocity` (3); the gravity; and the six numbers of the noise.
    #[new]
    #[pyo3(signature = (site, gravity, noise, /))]
    fn new(site: Vec<f64>, gravity: &Bound<'_, PyAny>, noise: Vec<f64>) -> PyResult<Self> {
        Ok(Self { model: model_of(&site, gravity, &noise)? })
    }

    /// `(B, 19)` states after the steps.
    #[pyo3(signature = (state, control, dt, /))]
    fn propagate<'py>(
        &self,
        py: Python<'py>,
        state: &Bound<'py, PyAny>,
        control: &Bound<'py, PyAny>,
        dt: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let arrays = Arrays::new(state, control, dt)?;
        let rows = arrays.rows()?;
        let model = &self.model;
        let data = py.detach(|| {
            rows.spread(NUMBERS, |states, samples, steps, out| {
                one(Move { model, states, samples, steps, out });
            })
        });
        convert::array(py, &[rows.states.len(), NUMBERS], data)
    }

    /// `(B, n, n)`: `Φ`, or `Q` if `noise`, of `n` error states (9, 12, 15 or 18).
    #[pyo3(signature = (n, noise, state, control, dt, /))]
    fn linearize<'py>(
        &self,
        py: Python<'py>,
        n: usize,
        noise: bool,
        state: &Bound<'py, PyAny>,
        control: &Bound<'py, PyAny>,
        dt: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let arrays = Arrays::new(state, control, dt)?;
        let rows = arrays.rows()?;
        let model = &self.model;
        macro_rules! choose {
            ($($size:literal),*) => {
                match n {
                    $($size => py.detach(|| rows.spread($size * $size, |states, samples, steps, out| {
                        one(Linearize::<$size> { model, states, samples, steps, noise, out });
                    })),)*
                    _ => return Err(shape_error("n", "9, 12, 15 or 18", &[n])),
                }
            };
        }
        let data = choose!(9, 12, 15, 18);
        convert::array(py, &[rows.states.len(), n, n], data)
    }

    /// `(B, T + 1, 19)` states from `(B, 19)`, `(B, T, 6)` samples and `(T,)` steps, each cut into equal parts no longer
    /// than `longest`.
    #[pyo3(signature = (state, control, dt, longest, /))]
    fn trajectory<'py>(
        &self,
        py: Python<'py>,
        state: &Bound<'py, PyAny>,
        control: &Bound<'py, PyAny>,
        dt: &Bound<'py, PyAny>,
        longest: f64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let arrays = Arrays::new(state, control, dt)?;
        let (states, samples, lengths) = arrays.parts();
        if samples.len() != states.len() * lengths.len() {
            return Err(shape_error("control", "(B, T, 6)", &[samples.len(), SAMPLE]));
        }
        // Rounding must not cut a step of exactly the longest in two.
        let parts = |dt: f64| (dt.abs() / longest * (1.0 - 1e-12)).ceil().max(1.0) as usize;
        let steps: Vec<(f64, usize)> = lengths.iter().map(|dt| (*dt, parts(*dt))).collect();
        let (model, steps, count) = (&self.model, steps.as_slice(), steps.len());
        let size = (count + 1) * NUMBERS;
        let mut data = vec![0.0; states.len() * size];
        py.detach(|| {
            if states.len() == 1 {
                one(Trace { model, states, samples, steps, out: &mut data });
                return;
            }
            let lanes = crate::dispatch::lanes();
            // A step without samples still belongs to its run.
            let pieces = states.chunks(lanes).zip(data.chunks_mut(lanes * size)).enumerate();
            share_out(pieces, |(k, (states, out))| {
                let from = k * lanes * count;
                let samples = &samples[from..from + states.len() * count];
                many(Trace { model, states, samples, steps, out });
            });
        });
        convert::array(py, &[states.len(), count + 1, NUMBERS], data)
    }
}

/// The arrays of a call.
struct Arrays<'py> {
    state: Floats<'py>,
    control: Floats<'py>,
    dt: Floats<'py>,
}

impl<'py> Arrays<'py> {
    fn new(state: &Bound<'py, PyAny>, control: &Bound<'py, PyAny>, dt: &Bound<'py, PyAny>) -> PyResult<Self> {
        Ok(Self {
            state: Floats::new(state, "state")?,
            control: Floats::new(control, "control")?,
            dt: Floats::new(dt, "dt")?,
        })
    }

    fn parts(&self) -> (&[[f64; NUMBERS]], &[[f64; SAMPLE]], &[f64]) {
        (self.state.data().as_chunks().0, self.control.data().as_chunks().0, self.dt.data())
    }

    /// As many samples and steps as states.
    fn rows(&self) -> PyResult<Rows<'_>> {
        let (states, samples, steps) = self.parts();
        if samples.len() != states.len() || steps.len() != states.len() {
            return Err(shape_error("state", "as many rows as control and dt", self.state.shape()));
        }
        Ok(Rows { states, samples, steps })
    }
}
