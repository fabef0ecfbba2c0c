//! The state of a filter and what moves it: behind one door for every model, size and covariance form.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::{Covariance, Estimate, Options, Rows, with_consider};
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::state::State;

use super::arcs::{Arcs, End, Layout, Plan, Series};
use super::backward::Backward;
use super::family::{Form, Widths};
use super::record::ArcRecord;
use super::single::Single;
use super::source::Source;
use crate::dispatch;
use crate::threads::share_out;

/// Settings of an update.
#[derive(Clone, Debug)]
pub struct Settings {
    pub iterations: u32,
    pub underweighting: f64,
    pub consider: Option<Vec<bool>>,
}

impl Settings {
    pub fn options<const N: usize>(&self) -> Options<N> {
        let flag = |flags: &Vec<bool>| core::array::from_fn(|i| flags.get(i).copied().unwrap_or(false));
        Options {
            iterations: self.iterations,
            underweighting: self.underweighting,
            consider: self.consider.as_ref().map(flag),
        }
    }
}

/// A measurement of a listed sensor.
pub struct Look<'a> {
    pub source: &'a Source,
    pub z: &'a [f64],
    pub dcm: [[f64; 3]; 3],
    pub bound: f64,
    pub settings: &'a Settings,
}

/// Whitened rows of any other sensor: `innovation ≈ H δ` with unit noise, linearised at `prior + offset`.
pub struct Given<'a> {
    pub innovation: &'a [f64],
    /// `(M, n)`.
    pub jacobian: &'a [f64],
    pub offset: &'a [f64],
    pub settings: &'a Settings,
}

/// What became of a measurement.
pub struct Seen {
    /// State and covariance before, after the prediction.
    pub prior: (Vec<f64>, Vec<f64>),
    pub innovation: Vec<f64>,
    pub nis: f64,
    pub dof: usize,
    pub accepted: bool,
}

/// How an arc was travelled, kept for the way back.
#[derive(Clone, Debug)]
pub struct Passage {
    pub steps: Vec<f64>,
    pub starts: Vec<f64>,
    /// Controls and their strides for runs and epochs.
    pub controls: Option<(Vec<f64>, usize, usize)>,
}

impl Passage {
    pub fn controls(&self) -> Option<Series<'_>> {
        let (data, run_stride, time_stride) = self.controls.as_ref()?;
        Some(Series { data, size: 3, run_stride: *run_stride, time_stride: *time_stride })
    }
}

/// Why a step was not taken; nothing has changed.
#[derive(Clone, Copy, Debug)]
pub enum Failure {
    /// The measurement is undefined at the predicted state.
    Undefined(ModelError),
    /// The prediction is not finite.
    Prediction,
    /// The model lives in Python.
    NotListed,
}

/// A filter whose size, form and model are known inside.
pub trait Engine: Send + Sync {
    /// Estimates: one, or one for each run of a batch.
    fn count(&self) -> usize;
    /// States, `(count, n)`.
    fn states(&self) -> Vec<f64>;
    /// Covariances, `(count, n, n)`.
    fn covariances(&self) -> Vec<f64>;
    /// The numbers the covariances are kept in, `(count, n, n)`.
    fn stored(&self) -> Vec<f64>;
    /// The first estimate from those numbers, or from a covariance.
    fn set(&mut self, state: &[f64], matrices: &[f64], stored: bool);
    /// Steps and looks with the listed model; `start` is the time, s.
    fn step(
        &mut self,
        start: f64,
        dt: f64,
        control: [f64; 3],
        look: Option<Look<'_>>,
    ) -> Result<Option<Seen>, Failure>;
    /// Whole arcs; what the sensors have rejected at the end, run by run. `keep` leaves the filter at the end.
    fn arcs(&mut self, plan: &Plan<'_>, layout: &Layout, keep: bool)
    -> Result<(Vec<f64>, Vec<f64>), Failure>;
    /// The data of a record with states and covariances smoothed.
    fn smooth(&self, record: &ArcRecord) -> Vec<f64>;
    /// Takes the prediction of a model in Python: `x'`, `Φ`, `Q`.
    fn predict_given(&mut self, state: &[f64], transition: &[f64], noise: &[f64]) -> bool;
    /// Tries rows: the correction and its normalised innovation squared. [`commit`](Self::commit) makes it so.
    fn attempt(&mut self, rows: &Given<'_>) -> (Vec<f64>, f64);
    /// Keeps the last attempt, if it is finite.
    fn commit(&mut self) -> bool;
    /// A copy.
    fn duplicate(&self) -> Box<dyn Engine>;
}

/// Estimates in some size `N ≥ n`; components beyond `n` are independent of everything.
pub struct Core<F: Form, const N: usize> {
    n: usize,
    estimates: Vec<Estimate<[f64; N], F::Of<f64, N>>>,
    attempt: Option<Estimate<[f64; N], F::Of<f64, N>>>,
}

impl<F: Form, const N: usize> Core<F, N> {
    /// Room for states of `n`.
    pub fn new(n: usize) -> Self {
        Self { n, estimates: Vec::new(), attempt: None }
    }

    /// An `n × n` matrix in the corner of the unit matrix.
    fn padded(&self, matrix: &[f64]) -> [[f64; N]; N] {
        let mut out = [[0.0; N]; N];
        for i in 0..N {
            for j in 0..N {
                out[i][j] = if i < self.n && j < self.n {
                    matrix.get(i * self.n + j).copied().unwrap_or(f64::NAN)
                } else {
                    f64::from(u8::from(i == j))
                };
            }
        }
        out
    }

    fn vector(&self, values: &[f64]) -> [f64; N] {
        core::array::from_fn(|i| if i < self.n { values.get(i).copied().unwrap_or(f64::NAN) } else { 0.0 })
    }

    fn corner(&self, matrix: &[[f64; N]; N]) -> Vec<f64> {
        matrix.iter().take(self.n).flat_map(|row| row.iter().take(self.n).copied()).collect()
    }

    fn states(&self) -> Vec<f64> {
        self.estimates.iter().flat_map(|e| e.state.iter().take(self.n).copied()).collect()
    }

    fn covariances(&self) -> Vec<f64> {
        self.estimates.iter().flat_map(|e| self.corner(&e.covariance.matrix())).collect()
    }

    fn stored(&self) -> Vec<f64> {
        self.estimates.iter().flat_map(|e| self.corner(e.covariance.stored())).collect()
    }

    fn set(&mut self, states: &[f64], matrices: &[f64], stored: bool) {
        let one = |(state, matrix): (&[f64], &[f64])| {
            let matrix = self.padded(matrix);
            let covariance =
                if stored { F::Of::<f64, N>::from_stored(matrix) } else { F::Of::<f64, N>::new(&matrix) };
            Estimate { state: self.vector(state), covariance }
        };
        let size = self.n.max(1);
        self.estimates = states.chunks(size).zip(matrices.chunks(size * size)).map(one).collect();
    }

    fn predict_given(&mut self, state: &[f64], transition: &[f64], noise: &[f64]) -> bool {
        let mut noise = self.padded(noise);
        for i in self.n..N {
            noise[i][i] = 0.0;
        }
        let moved = Moved { state: self.vector(state), transition: self.padded(transition), noise };
        let Some(estimate) = self.estimates.first_mut() else { return false };
        let covariance = estimate.covariance.propagate(&moved, &(), &moved.transition, &moved.noise);
        let finite = State::<f64, N>::is_finite(&moved.state) && covariance.is_finite();
        if finite {
            *estimate = Estimate { state: moved.state, covariance };
        }
        finite
    }

    fn attempt(&mut self, given: &Given<'_>) -> (Vec<f64>, f64) {
        let Some(prior) = self.estimates.first() else { return (Vec::new(), f64::NAN) };
        let options = given.settings.options::<N>();
        let columns = <[f64; N] as State<f64, N>>::COLUMNS;
        let mut rows = Rows::new(columns, self.vector(given.offset), 0.0, prior.covariance);
        let used = core::array::from_fn(|i| i < self.n);
        for (innovation, row) in given.innovation.iter().zip(given.jacobian.chunks(self.n.max(1))) {
            rows.absorb(*innovation, &self.vector(row), &used);
        }
        let mut delta = rows.delta;
        if let Some(considered) = &options.consider {
            for i in 0..N {
                if considered[i] {
                    delta[i] = 0.0;
                }
            }
        }
        let covariance = with_consider(&rows.covariance, &prior.covariance, &options);
        self.attempt = Some(Estimate { state: prior.state.inject(&delta), covariance });
        (delta.iter().take(self.n).copied().collect(), rows.nis)
    }

    fn commit(&mut self) -> bool {
        let (Some(attempt), Some(estimate)) = (self.attempt.take(), self.estimates.first_mut()) else {
            return false;
        };
        let finite = State::<f64, N>::is_finite(&attempt.state) && attempt.covariance.is_finite();
        if finite {
            *estimate = attempt;
        }
        finite
    }

    fn duplicate(&self) -> Self {
        Self { n: self.n, estimates: self.estimates.clone(), attempt: None }
    }
}

/// A step whose outcome is known.
struct Moved<const N: usize> {
    state: [f64; N],
    transition: [[f64; N]; N],
    noise: [[f64; N]; N],
}

impl<const N: usize> DynamicsModel<f64, N> for Moved<N> {
    const NAME: &'static str = "given";
    type State = [f64; N];
    type Control = ();
    type Step = ();

    fn prepare(&self, _time: f64, _dt: f64) {}

    fn propagate(&self, _step: &(), _state: &[f64; N], _control: ()) -> [f64; N] {
        self.state
    }

    fn transition(&self, _step: &(), _state: &[f64; N], _control: ()) -> ([f64; N], [[f64; N]; N]) {
        (self.state, self.transition)
    }

    fn process_noise(&self, _step: &(), _state: &[f64; N]) -> [[f64; N]; N] {
        self.noise
    }
}

macro_rules! by_core {
    () => {
        fn count(&self) -> usize {
            self.core.estimates.len()
        }
        fn states(&self) -> Vec<f64> {
            self.core.states()
        }
        fn covariances(&self) -> Vec<f64> {
            self.core.covariances()
        }
        fn stored(&self) -> Vec<f64> {
            self.core.stored()
        }
        fn set(&mut self, state: &[f64], matrices: &[f64], stored: bool) {
            self.core.set(state, matrices, stored);
        }
        fn predict_given(&mut self, state: &[f64], transition: &[f64], noise: &[f64]) -> bool {
            self.core.predict_given(state, transition, noise)
        }
        fn attempt(&mut self, rows: &Given<'_>) -> (Vec<f64>, f64) {
            self.core.attempt(rows)
        }
        fn commit(&mut self) -> bool {
            self.core.commit()
        }
    };
}

/// A model that lives in Python: only what it says of each step arrives here.
pub struct Foreign<F: Form, const N: usize> {
    pub core: Core<F, N>,
}

impl<F: Form, const N: usize> Engine for Foreign<F, N> {
    by_core!();

    fn step(&mut self, _: f64, _: f64, _: [f64; 3], _: Option<Look<'_>>) -> Result<Option<Seen>, Failure> {
        Err(Failure::NotListed)
    }

    fn arcs(&mut self, _: &Plan<'_>, _: &Layout, _: bool) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        Err(Failure::NotListed)
    }

    fn smooth(&self, record: &ArcRecord) -> Vec<f64> {
        record.data.clone()
    }

    fn duplicate(&self) -> Box<dyn Engine> {
        Box::new(Self { core: self.core.duplicate() })
    }
}

/// A listed model.
pub struct Listed<D: Widths<N>, F: Form, const N: usize> {
    pub core: Core<F, N>,
    pub dynamics: D,
    /// The last step prepared: when it started, how long it was.
    prepared: Option<(f64, f64, D::Step)>,
}

impl<D: Widths<N>, F: Form, const N: usize> Listed<D, F, N> {
    pub fn new(core: Core<F, N>, dynamics: D) -> Self {
        Self { core, dynamics, prepared: None }
    }

    /// The step, prepared unless it is the last one again.
    fn prepare(&mut self, start: f64, dt: f64) -> D::Step {
        let model = self.dynamics.of::<f64>();
        let varying = <D::Of<f64> as DynamicsModel<f64, N>>::TIME_VARYING;
        if let Some((from, length, step)) = self.prepared
            && length == dt
            && (!varying || from == start)
        {
            return step;
        }
        let step = model.prepare(start, dt);
        self.prepared = Some((start, dt, step));
        step
    }
}

impl<D: Widths<N>, F: Form, const N: usize> Engine for Listed<D, F, N> {
    by_core!();

    fn step(
        &mut self,
        start: f64,
        dt: f64,
        control: [f64; 3],
        look: Option<Look<'_>>,
    ) -> Result<Option<Seen>, Failure> {
        let step = (dt != 0.0).then(|| self.prepare(start, dt));
        let Some(prior) = self.core.estimates.first() else { return Ok(None) };
        let mut innovation = vec![0.0; look.as_ref().map_or(0, |look| look.source.rows)];
        let single = Single::<'_, D, F, N> {
            dynamics: &self.dynamics,
            step: step.as_ref(),
            control,
            prior,
            look: look.as_ref(),
            innovation: &mut innovation,
        };
        let (predicted, taken) = dispatch::narrow(single);
        if !(State::<f64, N>::is_finite(&predicted.state) && predicted.covariance.is_finite()) {
            return Err(Failure::Prediction);
        }
        let Some(taken) = taken else {
            self.core.estimates[0] = predicted;
            return Ok(None);
        };
        let taken = taken.map_err(Failure::Undefined)?;
        let prior = (predicted.state.to_vec(), predicted.covariance.matrix().as_flattened().to_vec());
        self.core.estimates[0] = taken.estimate;
        let (nis, dof, accepted) = (taken.nis, taken.dof, taken.accepted);
        Ok(Some(Seen { prior, innovation, nis, dof, accepted }))
    }

    fn arcs(
        &mut self,
        plan: &Plan<'_>,
        layout: &Layout,
        keep: bool,
    ) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let groups = plan.runs.div_ceil(plan.lanes.max(1));
        let block = layout.entries() * plan.steps.len() * plan.lanes;
        let mut data = vec![0.0; groups * block];
        let start = |run: usize| self.core.estimates[if self.core.estimates.len() == 1 { 0 } else { run }];
        let first = if keep { plan.runs } else { 0 };
        let mut ends: Vec<End<F, N>> =
            (0..first).map(|run| End { estimate: start(run), rejected: Vec::new() }).collect();
        // Chunks of whole groups; a group is enough work for a thread unless the arc is short.
        let size = (CHUNK / plan.lanes.max(1)).max(1);
        let ends_of = if keep { size * plan.lanes } else { 1 };
        let mut end_chunks = ends.chunks_mut(ends_of);
        let work = data.chunks_mut((size * block).max(1)).enumerate().map(|(k, out)| {
            let ends = end_chunks.next().unwrap_or_default();
            (k * size * plan.lanes, out, ends)
        });
        let starts = &self.core.estimates;
        let each = |(first, out, ends): (usize, &mut [f64], &mut [End<F, N>])| {
            let dynamics = &self.dynamics;
            dispatch::wide(Arcs::<'_, D, F, N> { dynamics, plan, layout, starts, first, out, ends });
        };
        if plan.runs * plan.steps.len() < SERIAL {
            work.for_each(each);
        } else {
            share_out(work, each);
        }
        let rejected = ends.iter().flat_map(|end| end.rejected.iter().copied()).collect();
        if keep {
            self.core.estimates = ends.into_iter().map(|end| end.estimate).collect();
        }
        Ok((data, rejected))
    }

    fn smooth(&self, record: &ArcRecord) -> Vec<f64> {
        let mut data = record.data.clone();
        let block = record.layout.entries() * record.epochs * record.lanes;
        let work = data.chunks_mut(block.max(1)).enumerate();
        let each = |(group, data): (usize, &mut [f64])| {
            dispatch::wide(Backward::<'_, D, N> {
                dynamics: &self.dynamics,
                passage: &record.passage,
                layout: &record.layout,
                lanes: record.lanes,
                runs: record.runs,
                first: group * record.lanes,
                data,
            });
        };
        if record.runs * record.epochs < SERIAL {
            work.for_each(each);
        } else {
            share_out(work, each);
        }
        data
    }

    fn duplicate(&self) -> Box<dyn Engine> {
        let (core, dynamics) = (self.core.duplicate(), self.dynamics.clone());
        Box::new(Self { core, dynamics, prepared: self.prepared })
    }
}

/// Runs that a thread takes at a time.
const CHUNK: usize = 64;
/// Steps in all below which threads cost more than they save.
const SERIAL: usize = 4000;
