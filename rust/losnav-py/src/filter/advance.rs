//! The two things that happen to estimates, in any lanes: a prediction, and a measurement.
//!
//! Estimates stand in groups of as many as there are lanes, `[group][entry][lane]`: the state, then the upper triangle
//! of the numbers the covariance is kept in. Single filters are groups of one. The two jobs are apart so that the
//! kernel of every model and that of every sensor are compiled once for each width, not once for each pair.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::{Covariance, Estimate, Options, Updated, predict, update};
use losnav_core::math::real::{Mask, Real};
use losnav_core::math::vec3::Mat3;
use losnav_core::models::sensors::{Law, SensorModel};

use super::family::{Form, Widths};
use super::source::Source;
use crate::dispatch::{LaneJob, Lanes};

/// Numbers of an estimate of `n` components.
pub const fn entries(n: usize) -> usize {
    n + n * (n + 1) / 2
}

/// The estimates of one group.
#[inline(always)]
pub fn load<V: Lanes, P: Covariance<V, N>, const N: usize>(data: &[f64]) -> Estimate<[V; N], P> {
    let (mut state, mut stored) = ([V::zero(); N], [[V::zero(); N]; N]);
    if data.len() >= entries(N) * V::LANES {
        for i in 0..N {
            state[i] = V::read(&data[i * V::LANES..]);
        }
        let mut at = N;
        for i in 0..N {
            for j in 0..N {
                if j >= i {
                    stored[i][j] = V::read(&data[at * V::LANES..]);
                    at += 1;
                }
            }
        }
    }
    Estimate { state, covariance: P::from_stored(stored) }
}

/// Puts them back.
#[inline(always)]
pub fn store<V: Lanes, P: Covariance<V, N>, const N: usize>(
    estimate: &Estimate<[V; N], P>,
    data: &mut [f64],
) {
    let stored = estimate.covariance.stored();
    if data.len() >= entries(N) * V::LANES {
        for i in 0..N {
            estimate.state[i].write(&mut data[i * V::LANES..(i + 1) * V::LANES]);
        }
        let mut at = N;
        for i in 0..N {
            for j in 0..N {
                if j >= i {
                    stored[i][j].write(&mut data[at * V::LANES..(at + 1) * V::LANES]);
                    at += 1;
                }
            }
        }
    }
}

/// Rows of numbers for every run and epoch; a stride of zero repeats them.
#[derive(Clone, Copy)]
pub struct Series<'a> {
    pub data: &'a [f64],
    pub size: usize,
    pub run_stride: usize,
    pub time_stride: usize,
}

impl<'a> Series<'a> {
    /// The same row always.
    pub fn constant(data: &'a [f64]) -> Self {
        Self { data, size: data.len(), run_stride: 0, time_stride: 0 }
    }

    #[inline(always)]
    fn row(&self, run: usize, epoch: usize) -> &'a [f64] {
        let from = run * self.run_stride + epoch * self.time_stride;
        self.data.get(from..from + self.size).unwrap_or(&[])
    }

    /// Row `epoch` of the runs in the lanes; the last run is repeated beyond it.
    #[inline(always)]
    pub fn read<V: Lanes>(&self, runs: Runs, epoch: usize, out: &mut [V]) {
        if V::LANES == 1 || self.run_stride == 0 {
            let row = self.row(runs.first, epoch);
            for (value, number) in out.iter_mut().zip(row) {
                *value = V::splat(*number);
            }
            return;
        }
        for (i, value) in out.iter_mut().enumerate() {
            *value = V::gather(|lane| {
                let row = self.row((runs.first + lane).min(runs.last), epoch);
                row.get(i).copied().unwrap_or(f64::NAN)
            });
        }
    }
}

/// The run in the first lane, and the last there is.
#[derive(Clone, Copy)]
pub struct Runs {
    pub first: usize,
    pub last: usize,
}

/// Predicts groups of estimates.
pub struct Predict<'a, D: Widths<N>, F: Form, const N: usize> {
    pub dynamics: &'a D,
    pub step: &'a D::Step,
    pub controls: Option<Series<'a>>,
    pub epoch: usize,
    pub runs: Runs,
    pub estimates: &'a mut [f64],
    pub form: core::marker::PhantomData<F>,
}

impl<D: Widths<N>, F: Form, const N: usize> LaneJob for Predict<'_, D, F, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let model = self.dynamics.of::<V>();
        let mut runs = self.runs;
        for group in self.estimates.chunks_exact_mut(entries(N) * V::LANES) {
            let mut control = [V::zero(); 3];
            if let Some(controls) = &self.controls {
                controls.read(runs, self.epoch, &mut control);
            }
            let estimate = load::<V, F::Of<V, N>, N>(group);
            store(&predict(model, self.step, control, &estimate), group);
            runs.first += V::LANES;
        }
    }
}

/// Where a group's answers go: entries of its own stretch of the record.
#[derive(Clone, Copy)]
pub struct Answers {
    /// From one group to the next.
    pub stride: usize,
    pub nis: usize,
    pub accepted: usize,
    pub innovation: usize,
}

/// Takes one sensor's measurements of groups of estimates.
pub struct Observe<'a, F: Form, const N: usize> {
    pub source: &'a Source,
    pub z: Series<'a>,
    /// What a sensor that changes with time looks at.
    pub seen: Series<'a>,
    pub dcm: Series<'a>,
    pub bound: f64,
    /// Straight rejections after which a measurement is taken regardless.
    pub relock_after: f64,
    pub options: &'a Options<N>,
    pub epoch: usize,
    pub runs: Runs,
    pub estimates: &'a mut [f64],
    /// Straight rejections so far, `[group][lane]`.
    pub rejected: &'a mut [f64],
    pub answers: Answers,
    pub out: &'a mut [f64],
    pub form: core::marker::PhantomData<F>,
}

/// Numbers in a measurement that need no heap.
const FEW: usize = 8;

impl<F: Form, const N: usize> LaneJob for Observe<'_, F, N> {
    /// An error says that the measurement was undefined in every lane of some group: there nothing was measured.
    type Output = Result<(), ModelError>;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Self::Output {
        let rows = self.source.rows;
        let (mut few, mut many) = ([V::zero(); 2 * FEW], Vec::new());
        if rows > FEW {
            many.resize(2 * rows, V::zero());
        }
        let (z, innovation) = if rows > FEW { many.split_at_mut(rows) } else { few.split_at_mut(FEW) };
        let (z, innovation) = (&mut z[..rows], &mut innovation[..rows]);
        let mut outcome = Ok(());
        let mut runs = self.runs;
        let groups = self.estimates.chunks_exact_mut(entries(N) * V::LANES);
        let counts = self.rejected.chunks_exact_mut(V::LANES);
        let outs = self.out.chunks_mut(self.answers.stride.max(1));
        for ((group, count), out) in groups.zip(counts).zip(outs) {
            let mut dcm = [[V::zero(); 3]; 3];
            self.dcm.read(runs, self.epoch, dcm.as_flattened_mut());
            self.z.read(runs, self.epoch, z);
            let estimate = load::<V, F::Of<V, N>, N>(group);
            let rejected = V::read(count);
            let lost = V::splat(self.relock_after).le(rejected);
            let bound = V::select(lost, V::splat(f64::INFINITY), V::splat(self.bound));
            let updated = Err(ModelError::ZeroRange { index: 0 });
            let (prior, options) = (&estimate, self.options);
            let mut take = Take { prior, dcm: &dcm, options, bound, innovation, updated };
            self.source.show(self.seen.row(0, self.epoch), z, &mut take);
            let (mut nis, mut accepted) = (V::splat(f64::NAN), V::zero());
            match take.updated {
                Ok(updated) => {
                    store(&updated.estimate, group);
                    let refused = updated.nis.is_finite().and(updated.accepted.not());
                    let more = V::select(refused, rejected + V::one(), rejected);
                    V::select(updated.accepted, V::zero(), more).write(count);
                    nis = updated.nis;
                    accepted = V::select(updated.accepted, V::one(), V::zero());
                }
                Err(error) => {
                    innovation.fill(V::splat(f64::NAN));
                    outcome = Err(error);
                }
            }
            write(out, self.answers.nis, nis);
            write(out, self.answers.accepted, accepted);
            for (row, value) in innovation.iter().enumerate() {
                write(out, self.answers.innovation + row, *value);
            }
            runs.first += V::LANES;
        }
        outcome
    }
}

/// The lanes of one entry.
#[inline(always)]
pub fn write<V: Lanes>(out: &mut [f64], entry: usize, value: V) {
    if let Some(out) = out.get_mut(entry * V::LANES..(entry + 1) * V::LANES) {
        value.write(out);
    }
}

/// Updates an estimate with whatever sensor it is shown.
struct Take<'a, T: Real, P, const N: usize> {
    prior: &'a Estimate<[T; N], P>,
    dcm: &'a Mat3<T>,
    options: &'a Options<N>,
    bound: T,
    /// Receives `z ⊟ h(x)` at the prior.
    innovation: &'a mut [T],
    updated: Result<Updated<T, [T; N], P>, ModelError>,
}

impl<T: Real, P: Covariance<T, N>, const N: usize> Law<T> for Take<'_, T, P, N> {
    #[inline(always)]
    fn examine(&mut self, sensor: &impl SensorModel<T>) {
        self.updated = update(self.prior, sensor, self.dcm, self.options, self.bound, self.innovation);
    }
}
