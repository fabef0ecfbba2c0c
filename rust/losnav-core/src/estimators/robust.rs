//! Pose from lines of sight of which many are wrong: random samples, a truncated cost, local optimisation.
//!
//! Cost of a pose: `sum min(s_i, g^2)` with the whitened squared residual `s_i` of each line of sight (chi-square of two degrees of freedom for
//! a right one) and the gate `g` (MSAC: Torr & Zisserman, CVIU 2000). It is the scale-free likelihood of "right with noise, or wrong anywhere":
//! its minimum is the weighted least-squares pose of its own inliers, so no final refit can disagree with the set of inliers.
//!
//! 1. draw three lines of sight (every triple in turn when there are few), solve P3P;
//! 2. score every solution with three times the gate, leaving off as soon as the cost exceeds the best sample's;
//! 3. a new best sample is optimised over all lines of sight: Geman-McClure at three times the gate, which reaches right ones that the noise of the
//!    sample left outside, then the truncated cost itself (LO-RANSAC: Chum, Matas & Kittler, DAGM 2003);
//! 4. stop when a better set of inliers would have been sampled with the asked confidence, at the latest after the number of samples that
//!    the greatest ratio of wrong ones calls for;
//! 5. guess-free starts on the inliers alone find the flipped pose, if it is the better one; the best is optimised to convergence.
//!
//! All draws come from a SplitMix64 generator: the same seed, the same result, on every machine.
use nalgebra::{Matrix3, Vector3};

use super::draws::{Draws, samples_needed, triple_after};
use super::least_squares::{Options, Outcome, PoseState, solve};
use super::loss::{Loss, LossValue, Robust, RobustKind};
use super::minimal::{Pose, candidates, p3p};
use super::pose::LosObjective;
use crate::math::real::Real;
use crate::models::linearization::Weight;
use crate::models::sensors::LineOfSight;

/// Widening of the gate while a sample's own noise is still in the pose: with 1, one of twenty scenes of 4 + 1 lines of sight is lost.
const WIDE: f64 = 3.0;
/// Iterations of a local optimisation.
const LOCAL_ITERATIONS: u32 = 12;
/// Samples this much dearer than the best are optimised too where every triple is tried: few lines of sight make the ranking a lottery.
const EVERY_MARGIN: f64 = 1.2;
/// Distance of attitudes (rad times the root of two) below which a start leads back to the pose it is compared with.
const SAME_BASIN: f64 = 0.02;
/// Fewest inliers of a success: three fit always.
const INLIERS_MIN: usize = 4;
/// Part of the right lines of sight that noise may put outside the gate, beside one, without taking the promise back.
const GATED: f64 = 0.02;

/// `min(s, g^2)`: least squares on the inliers, a constant for the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truncated {
    /// `g`, in standard deviations.
    pub gate: f64,
}

impl Loss for Truncated {
    const CURVED: bool = false;

    #[inline(always)]
    fn at<T: Real>(&self, s: T) -> LossValue<T> {
        let limit = T::splat(self.gate * self.gate);
        let inside = s.le(limit);
        LossValue {
            rho: T::select(inside, s, limit),
            weight: T::select(inside, T::one(), T::zero()),
            curvature: T::zero(),
        }
    }
}

/// What is asked of the robust solution.
#[derive(Clone, Copy, Debug)]
pub struct RobustOptions {
    /// Residual beyond which a line of sight is wrong, in standard deviations: `sqrt(-2 ln(1 - q))` for the quantile `q`.
    pub gate: f64,
    /// Greatest ratio of wrong lines of sight that is promised to be survived, in `[0, 1)`.
    pub max_outlier_ratio: f64,
    /// Probability that a sample without wrong ones was drawn before the search stops.
    pub confidence: f64,
    /// Seed of the draws.
    pub seed: u64,
    /// Settings of the last optimisation.
    pub polish: Options,
}

/// A pose, and what agrees with it.
#[derive(Clone, Copy, Debug)]
pub struct RobustOutcome {
    /// The last optimisation, of the truncated cost: its information is that of the inliers.
    pub solution: Outcome<f64>,
    /// The best other minimum that the starts on the inliers led to: the flipped pose of a flat scene.
    pub alternative: Option<Outcome<f64>>,
    /// Number of inliers.
    pub inliers: usize,
    /// Samples drawn.
    pub samples: u32,
    /// Whether the optimisation converged, on at least four inliers and no fewer than the greatest ratio of wrong ones leaves.
    pub converged: bool,
}

/// The pose that most lines of sight agree with, and a flag for each of them in `inliers`.
///
/// `None` when no three of them give any pose: fewer than three, collinear landmarks, values that are not finite. Entries of `inliers` beyond
/// the number of lines of sight are left alone; missing ones are not reported.
#[inline]
pub fn solve_robust(
    sensor: &LineOfSight<'_, f64>,
    options: &RobustOptions,
    inliers: &mut [bool],
) -> Option<RobustOutcome> {
    let n = sensor.landmarks.len().min(sensor.los.len());
    let problem = Problem { sensor, n, gate: options.gate };
    let mut search = Search { margin: 1.0, sample_cost: f64::INFINITY, best: None };
    let samples = problem.search(&mut search, options);
    let (pose, _) = search.best?;
    let (solution, alternative) = problem.finish(pose, &options.polish);
    let pose = Pose::from(solution.pose);
    let limit = options.gate * options.gate;
    let mut count = 0;
    for i in 0..n {
        let inside = problem.residual(i, &pose) <= limit;
        count += usize::from(inside);
        if let Some(flag) = inliers.get_mut(i) {
            *flag = inside;
        }
    }
    let promised = (1.0 - options.max_outlier_ratio) * n as f64;
    let enough = count >= INLIERS_MIN && count as f64 >= promised - 1.0 - GATED * promised;
    Some(RobustOutcome {
        solution,
        alternative,
        inliers: count,
        samples,
        converged: enough && solution.converged,
    })
}

struct Problem<'a> {
    sensor: &'a LineOfSight<'a, f64>,
    n: usize,
    gate: f64,
}

/// State of the search.
struct Search {
    /// Samples dearer than the best by less than this factor are optimised as well.
    margin: f64,
    /// Cost of the best sample before its optimisation.
    sample_cost: f64,
    /// Best optimised pose and its cost.
    best: Option<(Pose, f64)>,
}

impl Problem<'_> {
    #[inline]
    fn weight(&self, i: usize) -> Weight<f64> {
        let last = self.sensor.weights.len().wrapping_sub(1);
        self.sensor.weights.get(i.min(last)).copied().unwrap_or(Weight::Scalar(1.0))
    }

    /// Whitened squared residual of line of sight `i`; infinite behind and where it is undefined.
    #[inline]
    fn residual(&self, i: usize, pose: &Pose) -> f64 {
        let (Some(l), Some(b)) = (self.sensor.landmarks.get(i), self.sensor.los.get(i)) else {
            return f64::INFINITY;
        };
        let b = Vector3::from(*b);
        let v = pose.dcm * (Vector3::from(*l) - pose.position);
        // Unit first: squares of lengths in an absurd unit leave the range of numbers.
        let v = v / v.norm();
        let s = match self.weight(i) {
            // Sine instead of chord: no root, and equal far beyond any gate.
            Weight::Scalar(w) => w * b.cross(&v).norm_squared(),
            Weight::Full(root) => {
                let e = b - v;
                let whitened = Matrix3::from(root).transpose() * e;
                whitened.norm_squared()
            }
        };
        // Written so that NaN is outside.
        if b.dot(&v) > 0.0 && s < f64::INFINITY { s } else { f64::INFINITY }
    }

    /// Truncated cost, or infinity as soon as it exceeds `bound`.
    #[inline]
    fn score(&self, pose: &Pose, gate: f64, bound: f64) -> f64 {
        if let [Weight::Scalar(w)] = self.sensor.weights {
            return self.score_uniform(pose, gate, bound, *w);
        }
        let limit = gate * gate;
        let mut cost = 0.0;
        for i in 0..self.n {
            cost += self.residual(i, pose).min(limit);
            if cost >= bound {
                return f64::INFINITY;
            }
        }
        cost
    }

    /// The same for one common weight, four at a time.
    #[inline]
    fn score_uniform(&self, pose: &Pose, gate: f64, bound: f64, weight: f64) -> f64 {
        let limit = gate * gate;
        let t = -(pose.dcm * pose.position);
        let sine2 = |l: &[f64; 3], b: &[f64; 3]| {
            let (b, v) = (Vector3::from(*b), pose.dcm * Vector3::from(*l) + t);
            let s = weight * b.cross(&v).norm_squared() / v.norm_squared();
            // Written so that NaN and what is behind count in full.
            if b.dot(&v) > 0.0 && s < limit { s } else { limit }
        };
        let (l, tail_l) = self.sensor.landmarks.as_chunks::<4>();
        let (b, tail_b) = self.sensor.los.as_chunks::<4>();
        let mut cost = 0.0;
        for (l, b) in l.iter().zip(b) {
            cost += (sine2(&l[0], &b[0]) + sine2(&l[1], &b[1])) + (sine2(&l[2], &b[2]) + sine2(&l[3], &b[3]));
            if cost >= bound {
                return f64::INFINITY;
            }
        }
        for (l, b) in tail_l.iter().zip(tail_b) {
            cost += sine2(l, b);
        }
        if cost < bound { cost } else { f64::INFINITY }
    }

    fn inliers(&self, pose: &Pose) -> usize {
        let limit = self.gate * self.gate;
        (0..self.n).filter(|i| self.residual(*i, pose) <= limit).count()
    }

    /// Steps 1 to 4; returns the number of samples.
    #[inline]
    fn search(&self, search: &mut Search, options: &RobustOptions) -> u32 {
        let n = self.n;
        if n < 3 {
            return 0;
        }
        let triples = n as f64 * (n - 1) as f64 * (n - 2) as f64 / 6.0;
        let worst = (1.0 - options.max_outlier_ratio.clamp(0.0, 1.0)) * n as f64;
        let mut needed = samples_needed(worst, n as f64, 3, options.confidence);
        let every = triples <= needed;
        if every {
            needed = triples;
            search.margin = EVERY_MARGIN;
        }
        let mut draws = Draws::new(options.seed);
        let mut next = [0, 1, 2];
        let mut samples = 0;
        while f64::from(samples) < needed {
            let triple = if every { next } else { draws.triple(n) };
            next = triple_after(next, n);
            samples += 1;
            if self.try_sample(search, triple) && !every {
                let inliers = search.best.map_or(0, |b| self.inliers(&b.0));
                needed = needed.min(samples_needed(inliers as f64, n as f64, 3, options.confidence));
            }
        }
        samples
    }

    /// Steps 1 to 3 for one sample; `true` when the best pose changed.
    #[inline]
    fn try_sample(&self, search: &mut Search, triple: [usize; 3]) -> bool {
        let (Some(x), Some(b)) = (gather(self.sensor.landmarks, triple), gather(self.sensor.los, triple))
        else {
            return false;
        };
        let mut changed = false;
        for pose in &p3p(&x, &b) {
            let bound = search.margin * search.sample_cost;
            let cost = self.score(pose, WIDE * self.gate, bound);
            if cost < bound {
                search.sample_cost = search.sample_cost.min(cost);
                let (pose, cost) = self.optimise(pose);
                if search.best.is_none_or(|b| cost < b.1) {
                    search.best = Some((pose, cost));
                    changed = true;
                }
            }
        }
        changed
    }

    /// Step 3: the better of the pose and what it becomes.
    fn optimise(&self, pose: &Pose) -> (Pose, f64) {
        let wide = Robust { kind: RobustKind::GemanMcClure, scale: WIDE * self.gate };
        let first = solve(&self.objective(wide), &PoseState::from(*pose), &local_options());
        let second = solve(&self.objective(Truncated { gate: self.gate }), &first.pose, &local_options());
        let optimised = Pose::from(second.pose);
        let cost = self.score(&optimised, self.gate, f64::INFINITY);
        let before = self.score(pose, self.gate, f64::INFINITY);
        if cost <= before { (optimised, cost) } else { (*pose, before) }
    }

    fn objective<L: Loss>(&self, loss: L) -> LosObjective<'_, f64, L> {
        LosObjective { sensor: *self.sensor, loss }
    }

    /// Step 5.
    #[inline]
    fn finish(&self, pose: Pose, polish: &Options) -> (Outcome<f64>, Option<Outcome<f64>>) {
        let objective = self.objective(Truncated { gate: self.gate });
        let limit = self.gate * self.gate;
        let weight = |i: usize| {
            if self.residual(i, &pose) > limit {
                return 0.0;
            }
            match self.weight(i) {
                Weight::Scalar(w) => w,
                Weight::Full(s) => s.iter().flatten().map(|v| v * v).sum::<f64>() / 2.0,
            }
        };
        let mut best = solve(&objective, &PoseState::from(pose), polish);
        let mut alternative: Option<Outcome<f64>> = None;
        for start in &candidates(self.sensor.landmarks, self.sensor.los, weight) {
            if same_basin(start, &Pose::from(best.pose)) {
                continue;
            }
            let mut other = solve(&objective, &PoseState::from(*start), polish);
            if !other.converged || same_basin(&Pose::from(other.pose), &Pose::from(best.pose)) {
                continue;
            }
            if other.cost < best.cost {
                core::mem::swap(&mut best, &mut other);
            }
            if alternative.is_none_or(|a| other.cost < a.cost) {
                alternative = Some(other);
            }
        }
        (best, alternative)
    }
}

fn same_basin(a: &Pose, b: &Pose) -> bool {
    (a.dcm - b.dcm).norm_squared() < SAME_BASIN * SAME_BASIN
}

fn local_options() -> Options {
    use super::least_squares::{Method, Parametrization};
    Options {
        method: Method::LevenbergMarquardt,
        parametrization: Parametrization::Rotation,
        damping: 1e-3,
        max_iterations: LOCAL_ITERATIONS,
        cost_tolerance: 1e-3,
        step_tolerance: 1e-12,
    }
}

fn gather(list: &[[f64; 3]], i: [usize; 3]) -> Option<[Vector3<f64>; 3]> {
    let at = |k: usize| list.get(k).map(|v| Vector3::from(*v));
    Some([at(i[0])?, at(i[1])?, at(i[2])?])
}
