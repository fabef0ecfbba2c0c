//! The state of a filter and what moves it: behind one door for every model, size and covariance form.
use core::marker::PhantomData;

use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::Options;
use losnav_core::models::dynamics::DynamicsModel;

use super::advance::{Answers, Observe, Predict, Runs, Series, entries};
use super::arcs::{Arcs, Layout, Plan, Steps, alone, in_lanes};
use super::backward::Backward;
use super::core::{Core, Given};
use super::family::{Form, Widths};
use super::record::ArcRecord;
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
    /// Components that are uncertain but not corrected.
    pub fn considered(&self) -> Vec<usize> {
        let flags = self.consider.iter().flatten().enumerate();
        flags.filter(|(_, flag)| **flag).map(|(index, _)| index).collect()
    }

    /// The same for a state of `N`.
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
    /// What it looks at, if that changes with time.
    pub seen: &'a [f64],
    pub dcm: [[f64; 3]; 3],
    pub bound: f64,
    pub settings: &'a Settings,
}

/// What became of a measurement.
pub struct Seen {
    /// State and upper triangle of the covariance before, after the prediction.
    pub prior: Vec<f64>,
    pub innovation: Vec<f64>,
    pub nis: f64,
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
    /// The innovation is not finite though the measurement is.
    Update,
    /// The model lives in Python.
    NotListed,
}

/// A filter whose size, form and model are known inside.
pub trait Engine: Send + Sync {
    /// Arcs side by side in a record of that many.
    fn lanes(&self, runs: usize) -> usize;
    /// Estimates: one, or one for each run of a batch.
    fn count(&self) -> usize;
    /// States, `(count, n)`.
    fn states(&self) -> Vec<f64>;
    /// Covariances, `(count, n, n)`.
    fn covariances(&self) -> Vec<f64>;
    /// The numbers the covariances are kept in, `(count, n, n)`.
    fn stored(&self) -> Vec<f64>;
    /// The covariance of one recorded estimate.
    fn matrix(&self, estimate: &[f64]) -> Vec<f64>;
    /// Estimates from those numbers, or from covariances.
    fn set(&mut self, states: &[f64], matrices: &[f64], stored: bool);
    /// Steps and looks with the listed model; `start` is the time, s.
    fn step(
        &mut self,
        start: f64,
        dt: f64,
        control: [f64; 3],
        look: Option<Look<'_>>,
    ) -> Result<Option<Seen>, Failure>;
    /// Whole arcs; what the sensors have rejected at the end of the first. `keep` leaves the filter at the end.
    fn arcs(
        &mut self,
        plan: &Plan<'_>,
        layout: &Layout,
        data: &mut [f64],
        keep: bool,
    ) -> Result<Vec<f64>, Failure>;
    /// The data of a record with states and covariances smoothed; the latter no longer in the form of the filter.
    fn smooth(&self, record: &ArcRecord, data: &[f64]) -> Vec<f64>;
    /// Takes the prediction of a model in Python: `x'`, `Φ`, `Q`.
    fn predict_given(&mut self, state: &[f64], transition: &[f64], noise: &[f64]) -> bool;
    /// Tries rows: the correction and its normalised innovation squared. [`commit`](Self::commit) makes it so.
    fn attempt(&mut self, rows: &Given<'_>) -> (Vec<f64>, f64);
    /// Keeps the last attempt, if it is finite.
    fn commit(&mut self) -> bool;
    /// A copy.
    fn duplicate(&self) -> Box<dyn Engine>;
}

macro_rules! by_core {
    () => {
        fn count(&self) -> usize {
            self.core.count()
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
        fn matrix(&self, estimate: &[f64]) -> Vec<f64> {
            self.core.matrix(estimate)
        }
        fn set(&mut self, states: &[f64], matrices: &[f64], stored: bool) {
            self.core.set(states, matrices, stored);
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

    fn lanes(&self, _runs: usize) -> usize {
        1
    }

    fn step(&mut self, _: f64, _: f64, _: [f64; 3], _: Option<Look<'_>>) -> Result<Option<Seen>, Failure> {
        Err(Failure::NotListed)
    }

    fn arcs(&mut self, _: &Plan<'_>, _: &Layout, _: &mut [f64], _: bool) -> Result<Vec<f64>, Failure> {
        Err(Failure::NotListed)
    }

    fn smooth(&self, _record: &ArcRecord, data: &[f64]) -> Vec<f64> {
        data.to_vec()
    }

    fn duplicate(&self) -> Box<dyn Engine> {
        Box::new(Self { core: self.core.clone() })
    }
}

/// A listed model.
pub struct Listed<D: Widths<N>, F: Form, const N: usize> {
    core: Core<F, N>,
    dynamics: D,
    /// The last step prepared: when it started, how long it was.
    prepared: Option<(f64, f64, D::Step)>,
    /// Room for the estimate under way and its answers, reused from step to step.
    next: Vec<f64>,
    answers: Vec<f64>,
}

impl<D: Widths<N>, F: Form, const N: usize> Listed<D, F, N> {
    /// Without estimates yet.
    pub fn new(core: Core<F, N>, dynamics: D) -> Self {
        Self { core, dynamics, prepared: None, next: Vec::new(), answers: Vec::new() }
    }

    /// The step, prepared unless it is the last one again.
    fn prepare(&mut self, start: f64, dt: f64) -> D::Step {
        let varying = <D::Of<f64> as DynamicsModel<f64, N>>::TIME_VARYING;
        if let Some((from, length, step)) = self.prepared
            && length == dt
            && (!varying || from == start)
        {
            return step;
        }
        let step = self.dynamics.of::<f64>().prepare(start, dt);
        self.prepared = Some((start, dt, step));
        step
    }

    /// Looks with the estimate under way.
    fn look(&mut self, look: &Look<'_>) -> Result<Seen, ModelError> {
        let rows = look.source.rows;
        let prior = self.core.plain(&self.next);
        let mut innovation = vec![0.0; rows];
        self.answers.resize(2 + rows, 0.0);
        let mut rejected = [0.0];
        alone::<_, F>(Observe {
            source: look.source,
            z: Series::constant(look.z),
            seen: Series::constant(look.seen),
            dcm: Series::constant(look.dcm.as_flattened()),
            bound: look.bound,
            relock_after: f64::INFINITY,
            options: &look.settings.options::<N>(),
            epoch: 0,
            runs: Runs { first: 0, last: 0 },
            estimates: &mut self.next,
            rejected: &mut rejected,
            answers: Answers { stride: 2 + rows, nis: 0, accepted: 1, innovation: 2 },
            out: &mut self.answers,
            form: PhantomData::<F>,
        })?;
        innovation.copy_from_slice(&self.answers[2..]);
        Ok(Seen { prior, innovation, nis: self.answers[0], accepted: self.answers[1] != 0.0 })
    }

    /// Does every piece of work, on all cores if there are steps enough to be worth it.
    fn share<W: Send>(steps: usize, work: impl Iterator<Item = W> + Send, each: impl Fn(W) + Sync) {
        if steps < SERIAL {
            work.for_each(each);
        } else {
            share_out(work, each);
        }
    }
}

/// Runs that a thread takes at a time: their estimates stay in the first cache.
const CHUNK: usize = 32;
/// Steps in all below which threads cost more than they save.
const SERIAL: usize = 4000;

impl<D: Widths<N>, F: Form, const N: usize> Engine for Listed<D, F, N> {
    by_core!();

    fn lanes(&self, runs: usize) -> usize {
        if D::LANES && F::LANES && runs > 1 { dispatch::lanes() } else { 1 }
    }

    fn step(
        &mut self,
        start: f64,
        dt: f64,
        control: [f64; 3],
        look: Option<Look<'_>>,
    ) -> Result<Option<Seen>, Failure> {
        self.next.clone_from(&self.core.estimates);
        if dt != 0.0 {
            let step = self.prepare(start, dt);
            alone::<_, F>(Predict {
                dynamics: &self.dynamics,
                step: &step,
                controls: Some(Series::constant(&control)),
                epoch: 0,
                runs: Runs { first: 0, last: 0 },
                estimates: &mut self.next,
                form: PhantomData::<F>,
            });
            if !Core::<F, N>::sound(&self.next) {
                return Err(Failure::Prediction);
            }
        }
        let seen = match look {
            Some(look) => {
                let seen = self.look(&look).map_err(Failure::Undefined)?;
                if !seen.nis.is_finite() && look.z.iter().all(|value| value.is_finite()) {
                    return Err(Failure::Update);
                }
                Some(seen)
            }
            None => None,
        };
        core::mem::swap(&mut self.core.estimates, &mut self.next);
        Ok(seen)
    }

    fn arcs(
        &mut self,
        plan: &Plan<'_>,
        layout: &Layout,
        data: &mut [f64],
        keep: bool,
    ) -> Result<Vec<f64>, Failure> {
        let (lanes, size) = (plan.lanes.max(1), entries(N));
        let groups = plan.runs.div_ceil(lanes);
        let block = layout.entries() * plan.steps.len() * lanes;
        let mut estimates = vec![0.0; groups * size * lanes];
        let held = self.core.count();
        let from = |slot: usize| {
            let run = (slot / (size * lanes) * lanes + slot % lanes).min(plan.runs - 1);
            let entry = slot / lanes % size;
            (if held == 1 { 0 } else { run }) * size + entry
        };
        for (slot, value) in estimates.iter_mut().enumerate() {
            *value = self.core.estimates[from(slot)];
        }
        let steps = Steps::new(&self.dynamics, &plan.steps, &plan.starts);
        let chunk = (CHUNK / lanes).max(1);
        let stretches =
            data.chunks_mut((chunk * block).max(1)).zip(estimates.chunks_mut(chunk * size * lanes));
        let rejected = std::sync::Mutex::new(Vec::new());
        Self::share(plan.runs * plan.steps.len(), stretches.enumerate(), |(index, (out, estimates))| {
            let (dynamics, steps, first) = (&self.dynamics, &steps, index * chunk * lanes);
            let counts = Arcs { dynamics, steps, plan, layout, first, estimates, out }.travel::<F>();
            if index == 0
                && let Ok(mut rejected) = rejected.lock()
            {
                *rejected =
                    counts.iter().map(|of_sensor| of_sensor.first().copied().unwrap_or(0.0)).collect();
            }
        });
        if keep {
            for (slot, value) in estimates.iter().enumerate() {
                self.core.estimates[from(slot)] = *value;
            }
        }
        Ok(rejected.into_inner().unwrap_or_default())
    }

    fn smooth(&self, record: &ArcRecord, data: &[f64]) -> Vec<f64> {
        let mut data = data.to_vec();
        let block = record.layout.entries() * record.epochs * record.lanes;
        let work = data.chunks_mut(block.max(1)).enumerate();
        let steps = &Steps::new(&self.dynamics, &record.passage.steps, &record.passage.starts);
        Self::share(record.runs * record.epochs, work, |(group, data)| {
            let backward = Backward::<'_, D, F, N> {
                dynamics: &self.dynamics,
                steps,
                passage: &record.passage,
                layout: &record.layout,
                runs: Runs { first: group * record.lanes, last: record.runs - 1 },
                data,
                form: PhantomData,
            };
            in_lanes::<_, D, F, N>(record.lanes, backward);
        });
        data
    }

    fn duplicate(&self) -> Box<dyn Engine> {
        let mut copy = Self::new(self.core.clone(), self.dynamics.clone());
        copy.prepared = self.prepared;
        Box::new(copy)
    }
}
