//! Whole arcs, one or many: several arcs in the lanes, chunks of them over the cores.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::{Covariance, Estimate, Matrix, Options, predict};
use losnav_core::math::real::{Mask, Real};
use losnav_core::math::vec3::Mat3;
use losnav_core::models::dynamics::DynamicsModel;

use super::advance::Take;
use super::family::{Form, Widths, convert};
use super::source::Source;
use crate::dispatch::{Job, Lanes};

/// Rows of numbers for every run and epoch; a stride of zero repeats them.
#[derive(Clone, Copy)]
pub struct Series<'a> {
    pub data: &'a [f64],
    pub size: usize,
    pub run_stride: usize,
    pub time_stride: usize,
}

impl<'a> Series<'a> {
    #[inline(always)]
    pub fn row(&self, run: usize, epoch: usize) -> &'a [f64] {
        let from = run * self.run_stride + epoch * self.time_stride;
        self.data.get(from..from + self.size).unwrap_or(&[])
    }

    /// Row `epoch` of the runs in the lanes.
    #[inline(always)]
    pub fn read<V: Lanes>(&self, run: usize, last: usize, epoch: usize, out: &mut [V]) {
        for (i, value) in out.iter_mut().enumerate() {
            *value = if self.run_stride == 0 {
                V::splat(self.row(0, epoch).get(i).copied().unwrap_or(f64::NAN))
            } else {
                V::gather(|lane| self.row((run + lane).min(last), epoch).get(i).copied().unwrap_or(f64::NAN))
            };
        }
    }
}

/// One sensor's measurements along the arc.
pub struct Channel<'a> {
    pub source: &'a Source,
    pub measurements: Series<'a>,
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
    pub iterations: u32,
    pub underweighting: f64,
    pub consider: Option<Vec<bool>>,
    /// Arcs side by side in the record.
    pub lanes: usize,
}

/// Where things stand in a record: `[epoch][entry][lane]` for each group of runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    pub size: usize,
    /// Numbers in the measurement of each sensor.
    pub rows: Vec<usize>,
}

impl Layout {
    pub fn covariance(&self) -> usize {
        self.size
    }
    pub fn nis(&self) -> usize {
        self.size + self.size * (self.size + 1) / 2
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

/// Arcs `first..` of the plan into their part of the record.
pub struct Arcs<'a, D, F: Form, const N: usize> {
    pub dynamics: &'a D,
    pub plan: &'a Plan<'a>,
    pub layout: &'a Layout,
    /// Where every run starts: one for all, or one for each.
    pub starts: &'a [Estimate<[f64; N], F::Of<f64, N>>],
    pub first: usize,
    pub out: &'a mut [f64],
    /// Where the runs end and the straight rejections of each sensor there, run by run.
    pub ends: &'a mut [End<F, N>],
}

/// The end of an arc.
pub struct End<F: Form, const N: usize> {
    pub estimate: Estimate<[f64; N], F::Of<f64, N>>,
    pub rejected: Vec<f64>,
}

impl<D: Widths<N>, F: Form, const N: usize> Job for Arcs<'_, D, F, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(self) {
        if self.plan.lanes == 1 { self.all::<S>() } else { self.all::<V>() }
    }
}

impl<D: Widths<N>, F: Form, const N: usize> Arcs<'_, D, F, N> {
    #[inline(always)]
    fn all<V: Lanes>(mut self) {
        let model = self.dynamics.of::<V>();
        let (mut prepared, mut which) = (Vec::new(), Vec::with_capacity(self.plan.steps.len()));
        prepare::<V, D, N>(model, self.plan, &mut prepared, &mut which);
        let block = self.layout.entries() * self.plan.steps.len() * V::LANES;
        let out = core::mem::take(&mut self.out);
        for (index, block) in out.chunks_exact_mut(block.max(1)).enumerate() {
            self.block::<V>(index * V::LANES, &prepared, &which, block);
        }
    }

    /// `V::LANES` arcs from `offset` on.
    #[inline(always)]
    fn block<V: Lanes>(&mut self, offset: usize, steps: &[D::Step], which: &[usize], out: &mut [f64]) {
        let (plan, layout) = (self.plan, self.layout);
        let model = self.dynamics.of::<V>();
        let (run, last) = (self.first + offset, plan.runs - 1);
        let options = options::<N>(plan);
        let mut estimate = self.start::<V>(run, last);
        let mut rejected: Vec<V> = plan.channels.iter().map(|c| V::splat(c.rejected)).collect();
        let rows = layout.rows.iter().copied().max().unwrap_or(0);
        let (mut z, mut innovation) = (vec![V::zero(); rows], vec![V::zero(); rows]);
        for (epoch, out) in out.chunks_exact_mut(layout.entries() * V::LANES).enumerate() {
            if plan.steps[epoch] != 0.0 {
                let mut control = [V::zero(); 3];
                if let Some(controls) = &plan.controls {
                    controls.read(run, last, epoch, &mut control);
                }
                estimate = predict(model, &steps[which[epoch]], control, &estimate);
            }
            let mut dcm = [[V::zero(); 3]; 3];
            plan.dcm.read(run, last, epoch, dcm.as_flattened_mut());
            let mut at = layout.innovation();
            for (index, channel) in plan.channels.iter().enumerate() {
                let rows = layout.rows[index];
                let (z, innovation) = (&mut z[..rows], &mut innovation[..rows]);
                channel.measurements.read(run, last, epoch, z);
                let seen = observe::<V, F, N>(
                    &mut estimate,
                    plan,
                    channel,
                    &dcm,
                    &options,
                    &mut rejected[index],
                    z,
                    innovation,
                );
                write(out, layout.nis() + index, seen.0);
                write(out, layout.accepted() + index, seen.1);
                for value in innovation {
                    write(out, at, *value);
                    at += 1;
                }
            }
            write_estimate(out, &estimate);
        }
        for lane in 0..V::LANES.min(self.ends.len().saturating_sub(offset)) {
            let end = &mut self.ends[offset + lane];
            end.estimate = in_lane(&estimate, lane);
            end.rejected = rejected.iter().map(|count| count.lane(lane)).collect();
        }
    }

    #[inline(always)]
    fn start<V: Lanes>(&self, run: usize, last: usize) -> Estimate<[V; N], F::Of<V, N>> {
        let starts = self.starts;
        if let [one] = starts {
            let stored = convert(one.covariance.stored(), V::splat);
            return Estimate { state: one.state.map(V::splat), covariance: Covariance::from_stored(stored) };
        }
        let (mut state, mut stored) = ([V::zero(); N], [[V::zero(); N]; N]);
        for i in 0..N {
            state[i] = V::gather(|lane| starts[(run + lane).min(last)].state[i]);
            for j in i..N {
                stored[i][j] = V::gather(|lane| starts[(run + lane).min(last)].covariance.stored()[i][j]);
            }
        }
        Estimate { state, covariance: Covariance::from_stored(stored) }
    }
}

/// The settings, for a state of `N`.
pub fn options<const N: usize>(plan: &Plan<'_>) -> Options<N> {
    let consider = plan.consider.as_ref().map(|flags| {
        let mut out = [false; N];
        for (out, flag) in out.iter_mut().zip(flags) {
            *out = *flag;
        }
        out
    });
    Options { iterations: plan.iterations, underweighting: plan.underweighting, consider }
}

/// Every different step once.
#[inline(always)]
fn prepare<V: Lanes, D: Widths<N>, const N: usize>(
    model: &D::Of<V>,
    plan: &Plan<'_>,
    prepared: &mut Vec<D::Step>,
    which: &mut Vec<usize>,
) {
    let varying = <D::Of<V> as DynamicsModel<V, N>>::TIME_VARYING;
    let mut before = f64::NAN;
    for (dt, start) in plan.steps.iter().zip(&plan.starts) {
        if *dt != 0.0 && (varying || *dt != before) {
            prepared.push(model.prepare(*start, *dt));
            before = *dt;
        }
        which.push(prepared.len().saturating_sub(1));
    }
}

/// One measurement: its normalised innovation squared, and one where it was accepted.
#[inline(always)]
fn observe<V: Lanes, F: Form, const N: usize>(
    estimate: &mut Estimate<[V; N], F::Of<V, N>>,
    plan: &Plan<'_>,
    channel: &Channel<'_>,
    dcm: &Mat3<V>,
    options: &Options<N>,
    rejected: &mut V,
    z: &[V],
    innovation: &mut [V],
) -> (V, V) {
    let lost = V::splat(plan.relock_after).le(*rejected);
    let bound = V::select(lost, V::splat(f64::INFINITY), V::splat(channel.bound));
    let updated = Err(ModelError::ZeroRange { index: 0 });
    let mut take = Take { prior: estimate, dcm, options, bound, innovation, updated };
    channel.source.show(z, &mut take);
    let Ok(updated) = take.updated else {
        // Undefined in every lane: nothing was measured.
        for value in innovation {
            *value = V::splat(f64::NAN);
        }
        return (V::splat(f64::NAN), V::zero());
    };
    *estimate = updated.estimate;
    let refused = updated.nis.is_finite().and(updated.accepted.not());
    let count = V::select(refused, *rejected + V::one(), *rejected);
    *rejected = V::select(updated.accepted, V::zero(), count);
    (updated.nis, V::select(updated.accepted, V::one(), V::zero()))
}

/// The lanes of one entry.
#[inline(always)]
pub fn write<V: Lanes>(out: &mut [f64], entry: usize, value: V) {
    if let Some(out) = out.get_mut(entry * V::LANES..(entry + 1) * V::LANES) {
        value.write(out);
    }
}

/// State and upper triangle of the covariance.
#[inline(always)]
fn write_estimate<V: Lanes, P: Covariance<V, N>, const N: usize>(
    out: &mut [f64],
    estimate: &Estimate<[V; N], P>,
) {
    for i in 0..N {
        write(out, i, estimate.state[i]);
    }
    let (covariance, mut at) = (estimate.covariance.matrix(), N);
    for i in 0..N {
        for j in i..N {
            write(out, at, covariance[i][j]);
            at += 1;
        }
    }
}

/// The estimate of one lane.
pub fn in_lane<V: Real, P, Q, const N: usize>(
    estimate: &Estimate<[V; N], P>,
    lane: usize,
) -> Estimate<[f64; N], Q>
where
    P: Covariance<V, N>,
    Q: Covariance<f64, N>,
{
    let stored: Matrix<f64, N> = convert(estimate.covariance.stored(), |value| value.lane(lane));
    Estimate { state: estimate.state.map(|value| value.lane(lane)), covariance: Q::from_stored(stored) }
}
