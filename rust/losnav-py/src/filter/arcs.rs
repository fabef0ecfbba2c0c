//! Whole arcs, one or many: several arcs in the lanes, chunks of them over the cores.
use core::marker::PhantomData;

use losnav_core::models::dynamics::DynamicsModel;

use super::advance::{Answers, Observe, Predict, Runs, Series, entries};
use super::engine::Settings;
use super::family::{Form, Widths};
use super::source::Source;
use crate::dispatch::{self, LaneJob};

/// One sensor's measurements along the arc.
pub struct Channel<'a> {
    pub source: &'a Source,
    pub measurements: Series<'a>,
    /// What it looks at, if that changes with time.
    pub seen: Series<'a>,
    /// Bound on the normalised innovation squared.
    pub bound: f64,
    /// Straight rejections so far.
    pub rejected: f64,
}

/// What is asked for.
pub struct Plan<'a> {
    pub runs: usize,
    /// Time step before each epoch, s; zero: none.
    pub steps: Vec<f64>,
    /// When each of them starts, s.
    pub starts: Vec<f64>,
    pub controls: Option<Series<'a>>,
    pub dcm: Series<'a>,
    pub channels: Vec<Channel<'a>>,
    /// Straight rejections after which the next measurement is taken regardless; infinite: never.
    pub relock_after: f64,
    pub settings: &'a Settings,
    /// Arcs side by side in the record.
    pub lanes: usize,
}

/// Where things stand in a record: `[group of runs][epoch][entry][lane]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub size: usize,
    /// Numbers in the measurement of each sensor.
    pub rows: Vec<usize>,
}

impl Layout {
    /// The state comes first, then the upper triangle that the covariance is kept in.
    pub fn covariance(&self) -> usize {
        self.size
    }
    pub fn nis(&self) -> usize {
        entries(self.size)
    }
    pub fn accepted(&self) -> usize {
        self.nis() + self.rows.len()
    }
    pub fn innovation(&self) -> usize {
        self.accepted() + self.rows.len()
    }
    /// Entries of an epoch.
    pub fn entries(&self) -> usize {
        self.innovation() + self.rows.iter().sum::<usize>()
    }
}

/// Every different step once, and which of them leads to each epoch.
pub struct Steps<S> {
    prepared: Vec<S>,
    which: Vec<usize>,
}

impl<S> Steps<S> {
    /// Prepares the steps of a plan.
    pub fn new<D: Widths<N, Step = S>, const N: usize>(dynamics: &D, steps: &[f64], starts: &[f64]) -> Self {
        let varying = <D::Of<f64> as DynamicsModel<f64, N>>::TIME_VARYING;
        let (mut prepared, mut which, mut before) = (Vec::new(), Vec::with_capacity(steps.len()), f64::NAN);
        for (dt, start) in steps.iter().zip(starts) {
            if *dt != 0.0 && (varying || *dt != before) {
                prepared.push(dynamics.of::<f64>().prepare(*start, *dt));
                before = *dt;
            }
            which.push(prepared.len().saturating_sub(1));
        }
        Self { prepared, which }
    }

    /// The step that leads to an epoch.
    pub fn to(&self, epoch: usize) -> Option<&S> {
        self.prepared.get(*self.which.get(epoch)?)
    }
}

/// Some groups of arcs of the plan.
pub struct Arcs<'a, D: Widths<N>, const N: usize> {
    pub dynamics: &'a D,
    pub steps: &'a Steps<D::Step>,
    pub plan: &'a Plan<'a>,
    pub layout: &'a Layout,
    pub first: usize,
    /// The groups' estimates: where they start, then where they end.
    pub estimates: &'a mut [f64],
    /// The groups' part of the record.
    pub out: &'a mut [f64],
}

impl<D: Widths<N>, const N: usize> Arcs<'_, D, N> {
    /// Travels them; the straight rejections at the end, `[sensor][run]`.
    pub fn travel<F: Form>(self) -> Vec<Vec<f64>> {
        let (plan, layout, lanes) = (self.plan, self.layout, self.plan.lanes);
        let size = entries(N) * lanes;
        let groups = self.estimates.len() / size;
        let mut rejected: Vec<Vec<f64>> =
            plan.channels.iter().map(|c| vec![c.rejected; groups * lanes]).collect();
        let options = plan.settings.options::<N>();
        let runs = Runs { first: self.first, last: plan.runs - 1 };
        let (block, epochs) = (layout.entries() * lanes, plan.steps.len());
        for epoch in 0..epochs {
            if plan.steps[epoch] != 0.0
                && let Some(step) = self.steps.to(epoch)
            {
                let (dynamics, controls, form) = (self.dynamics, plan.controls, PhantomData::<F>);
                let estimates = &mut *self.estimates;
                in_lanes::<_, D, F, N>(
                    lanes,
                    Predict { dynamics, step, controls, epoch, runs, estimates, form },
                );
            }
            // The answers of group g stand `stride` after those of the group before.
            let out = &mut self.out[epoch * block..];
            let mut innovation = layout.innovation();
            for (index, channel) in plan.channels.iter().enumerate() {
                let answers = Answers {
                    stride: epochs * block,
                    nis: layout.nis() + index,
                    accepted: layout.accepted() + index,
                    innovation,
                };
                // Undefined in every lane is logged as no measurement.
                let _ = in_lanes::<_, D, F, N>(
                    lanes,
                    Observe {
                        source: channel.source,
                        z: channel.measurements,
                        seen: channel.seen,
                        dcm: plan.dcm,
                        bound: channel.bound,
                        relock_after: plan.relock_after,
                        options: &options,
                        epoch,
                        runs,
                        estimates: &mut *self.estimates,
                        rejected: &mut rejected[index],
                        answers,
                        out: &mut *out,
                        form: PhantomData::<F>,
                    },
                );
                innovation += layout.rows[index];
            }
            for (group, out) in self.estimates.chunks_exact(size).zip(out.chunks_mut(epochs * block)) {
                out[..size].copy_from_slice(group);
            }
        }
        rejected
    }
}

/// Side by side, or one after another.
#[inline(always)]
pub fn in_lanes<J: LaneJob, D: Widths<N>, F: Form, const N: usize>(lanes: usize, job: J) -> J::Output {
    if D::LANES && F::LANES && lanes > 1 { dispatch::many(job) } else { alone::<J, F>(job) }
}

/// One estimate. Factors are for hard problems, not for speed: one instruction set is enough for them.
#[inline(always)]
pub fn alone<J: LaneJob, F: Form>(job: J) -> J::Output {
    if F::PLAIN { dispatch::one(job) } else { dispatch::baseline(job) }
}
