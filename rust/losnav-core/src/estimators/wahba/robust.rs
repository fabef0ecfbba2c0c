//! Attitude from directions of which many are wrong: random pairs, a truncated cost, local optimisation.
//!
//! The cost and the promises are those of the robust pose ([`robust`](crate::estimators::robust)): `Σ min(s, g²)` with the whitened
//! squared residual `s`, chi-square of two degrees of freedom for a right direction, and the gate `g`.
//!
//! 1. draw two directions (every pair in turn when there are few); their separation must agree in both frames within
//!    three times the gate, which throws out most wrong pairs before anything is computed;
//! 2. the attitude of the pair from its half-way and difference vectors;
//! 3. score with three times the gate, leaving off as soon as the cost exceeds the best sample's;
//! 4. a new best sample is optimised over all directions: Geman-McClure at three times the gate, then the gate itself;
//! 5. stop when a better set of inliers would have been sampled with the asked confidence;
//! 6. solve Wahba's problem of the inliers until they no longer change.
use num_traits::Float;

use crate::estimators::draws::{Draws, pair_after, samples_needed};
use crate::math::rotation::quaternion_from_dcm;
use crate::math::so3::{Quaternion, dcm_from_quaternion, step};
use crate::math::sym3::Sym3;
use crate::math::vec3::{Mat3, Vec3, add, cross, dot, mul, rotate, scale, sub, transpose};

use super::careful::{self, Solution};
use super::{Method, Residual, norm2};

/// Widening of the gate while a sample's own noise is still in the attitude.
const WIDE: f64 = 3.0;
/// Iterations of a local optimisation.
const LOCAL_ITERATIONS: usize = 12;
/// Fewest inliers of a success: two fit whenever their separations agree.
const INLIERS_MIN: usize = 3;
/// Part of the right directions that noise may put outside the gate, beside one, without taking the promise back.
const GATED: f64 = 0.02;
/// Squared length below which a pair gives no plane.
const PARALLEL2: f64 = 1e-20;

/// What is asked of the robust solution.
#[derive(Clone, Copy, Debug)]
pub struct RobustOptions {
    /// Residual beyond which a direction is wrong, in standard deviations.
    pub gate: f64,
    /// Greatest ratio of wrong directions that is promised to be survived, in `[0, 1)`.
    pub max_outlier_ratio: f64,
    /// Probability that a sample without wrong ones was drawn before the search stops.
    pub confidence: f64,
    /// Seed of the draws.
    pub seed: u64,
}

/// An attitude, and what agrees with it.
#[derive(Clone, Copy, Debug)]
pub struct RobustOutcome {
    /// Of the inliers alone; `converged` also asks for enough of them.
    pub solution: Solution,
    /// Number of inliers.
    pub inliers: usize,
    /// Samples drawn.
    pub samples: u32,
}

/// Directions of which some are wrong: finite weights, one for each or one for all.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Body axes.
    pub body: &'a [Vec3<f64>],
    /// Reference axes.
    pub reference: &'a [Vec3<f64>],
    /// `1/σ²`.
    pub weights: &'a [f64],
}

/// The attitude that most directions agree with; their weights stay in `kept`, which has room for all, those of the others
/// become zero. `None` when no two directions agree.
#[must_use]
pub fn solve(problem: &Problem<'_>, options: &RobustOptions, kept: &mut [f64]) -> Option<RobustOutcome> {
    let n = problem.body.len().min(problem.reference.len()).min(kept.len());
    let mut search = Search { problem, n, gate: options.gate, sample_cost: f64::INFINITY, best: None };
    let samples = search.run(options);
    let (quaternion, _) = search.best?;
    let (mut solution, inliers) = search.finish(quaternion, kept);
    let promised = (1.0 - options.max_outlier_ratio) * n as f64;
    let enough = inliers >= INLIERS_MIN && inliers as f64 >= promised - 1.0 - GATED * promised;
    solution.converged &= enough;
    Some(RobustOutcome { solution, inliers, samples })
}

struct Search<'a> {
    problem: &'a Problem<'a>,
    n: usize,
    gate: f64,
    /// Cost of the best sample before its optimisation.
    sample_cost: f64,
    /// Best optimised attitude and its cost.
    best: Option<(Quaternion<f64>, f64)>,
}

impl Search<'_> {
    fn weight(&self, i: usize) -> f64 {
        let weights = self.problem.weights;
        weights.get(i.min(weights.len().wrapping_sub(1))).copied().unwrap_or(1.0)
    }

    fn pair(&self, i: usize) -> Option<(Vec3<f64>, Vec3<f64>)> {
        Some((*self.problem.body.get(i)?, *self.problem.reference.get(i)?))
    }

    /// Whitened squared residual of direction `i`; infinite on the other side of the sky.
    fn residual(&self, i: usize, dcm: &Mat3<f64>) -> f64 {
        let Some((b, r)) = self.pair(i) else { return f64::INFINITY };
        let h = rotate(dcm, r);
        // Sine instead of chord, which is equal far beyond any gate; from the difference, which has its digits.
        let s = self.weight(i) * norm2(cross(sub(b, h), h));
        if dot(b, h) > 0.0 { s } else { f64::INFINITY }
    }

    /// Truncated cost, or infinity as soon as it exceeds `bound`.
    fn score(&self, q: Quaternion<f64>, gate: f64, bound: f64) -> f64 {
        let (dcm, limit) = (dcm_from_quaternion(q), gate * gate);
        let mut cost = 0.0;
        for i in 0..self.n {
            cost += self.residual(i, &dcm).min(limit);
            if cost >= bound {
                return f64::INFINITY;
            }
        }
        cost
    }

    fn inliers(&self, q: Quaternion<f64>) -> usize {
        let (dcm, limit) = (dcm_from_quaternion(q), self.gate * self.gate);
        (0..self.n).filter(|i| self.residual(*i, &dcm) <= limit).count()
    }

    /// Steps 1 to 5; returns the number of samples.
    fn run(&mut self, options: &RobustOptions) -> u32 {
        if self.n < 2 {
            return 0;
        }
        let n = self.n as f64;
        let worst = (1.0 - options.max_outlier_ratio.clamp(0.0, 1.0)) * n;
        let mut needed = samples_needed(worst, n, 2, options.confidence);
        let pairs = 0.5 * n * (n - 1.0);
        let every = pairs <= needed;
        if every {
            needed = pairs;
        }
        let (mut draws, mut next) = (Draws::new(options.seed), [0, 1]);
        let mut samples = 0;
        while f64::from(samples) < needed {
            let pair = if every { next } else { draws.pair(self.n) };
            next = pair_after(next, self.n);
            samples += 1;
            if self.try_pair(pair) && !every {
                let inliers = self.best.map_or(0, |(q, _)| self.inliers(q));
                needed = needed.min(samples_needed(inliers as f64, n, 2, options.confidence));
            }
        }
        samples
    }

    /// Steps 1 to 4 for one pair; `true` when the best attitude changed.
    fn try_pair(&mut self, [i, j]: [usize; 2]) -> bool {
        let Some(q) = self.attitude_of_pair(i, j) else { return false };
        let cost = self.score(q, WIDE * self.gate, self.sample_cost);
        if cost >= self.sample_cost {
            return false;
        }
        self.sample_cost = cost;
        let (q, cost) = self.optimise(q);
        let better = self.best.is_none_or(|(_, best)| cost < best);
        if better {
            self.best = Some((q, cost));
        }
        better
    }

    /// Steps 1 and 2.
    fn attitude_of_pair(&self, i: usize, j: usize) -> Option<Quaternion<f64>> {
        let ((b1, r1), (b2, r2)) = (self.pair(i)?, self.pair(j)?);
        let (body, reference) = ([add(b1, b2), sub(b1, b2)], [add(r1, r2), sub(r1, r2)]);
        // Chords of the angle and of its supplement: the shorter one is the sensitive one.
        let variance = 1.0 / self.weight(i) + 1.0 / self.weight(j);
        let margin = WIDE * self.gate * Float::sqrt(variance);
        for k in 0..2 {
            let off = Float::sqrt(norm2(body[k])) - Float::sqrt(norm2(reference[k]));
            if Float::abs(off) > margin {
                return None;
            }
        }
        let (body, reference) = (triad(body)?, triad(reference)?);
        Some(quaternion_from_dcm(&mul(&transpose(&body), &reference)))
    }

    /// Step 4: the better of the attitude and what it becomes.
    fn optimise(&self, start: Quaternion<f64>) -> (Quaternion<f64>, f64) {
        let wide = 1.0 / (WIDE * WIDE * self.gate * self.gate);
        let mut q = self.descend(start, |s| 1.0 / ((1.0 + wide * s) * (1.0 + wide * s)));
        let limit = self.gate * self.gate;
        q = self.descend(q, |s| if s <= limit { 1.0 } else { 0.0 });
        let cost = self.score(q, self.gate, f64::INFINITY);
        let before = self.score(start, self.gate, f64::INFINITY);
        if cost <= before { (q, cost) } else { (start, before) }
    }

    /// Reweighted Gauss–Newton.
    fn descend(&self, start: Quaternion<f64>, trust: impl Fn(f64) -> f64) -> Quaternion<f64> {
        let mut q = start;
        for _ in 0..LOCAL_ITERATIONS {
            let dcm = dcm_from_quaternion(q);
            let (mut sum, mut outer, mut total) = (Residual::zero(), Sym3::zero(), 0.0);
            for i in 0..self.n {
                let s = self.residual(i, &dcm);
                let Some((b, r)) = self.pair(i).filter(|_| s.is_finite()) else { continue };
                let w = self.weight(i) * trust(s);
                sum = sum.with(b, r, w, &dcm);
                outer = outer.plus_outer(w, rotate(&dcm, r));
                total += w;
            }
            let ldl = outer.complement(total).ldl();
            if !ldl.positive() {
                break;
            }
            let delta = ldl.solve(sum.gradient);
            q = step(q, delta);
            // A thousandth of a standard deviation in any direction: the set of inliers is what it will be.
            if dot(delta, sum.gradient) < 1e-6 {
                break;
            }
        }
        q
    }

    /// Step 6: the solution of the inliers and their number.
    fn finish(&self, start: Quaternion<f64>, kept: &mut [f64]) -> (Solution, usize) {
        let limit = self.gate * self.gate;
        let mut q = start;
        let mut before = usize::MAX;
        let mut solution = Solution::invalid();
        for _ in 0..LOCAL_ITERATIONS {
            let dcm = dcm_from_quaternion(q);
            let (mut count, mut changed) = (0, false);
            for (i, weight) in kept.iter_mut().enumerate() {
                let inside = i < self.n && self.residual(i, &dcm) <= limit;
                let now = if inside { self.weight(i) } else { 0.0 };
                changed |= (now > 0.0) != (*weight > 0.0);
                *weight = now;
                count += usize::from(inside);
            }
            if !changed && before == count {
                break;
            }
            before = count;
            let Problem { body, reference, .. } = *self.problem;
            let method = Method::Quest;
            solution =
                careful::solve(&careful::Problem { body, reference, weights: kept, method, polish: true });
            if !solution.quaternion.iter().all(|x| x.is_finite()) {
                break;
            }
            q = solution.quaternion;
        }
        (solution, if before == usize::MAX { 0 } else { before })
    }
}

/// Orthonormal rows from the sum and the difference of two unit vectors, which are at right angles.
fn triad([sum, difference]: [Vec3<f64>; 2]) -> Option<Mat3<f64>> {
    let (s2, d2) = (norm2(sum), norm2(difference));
    if s2.min(d2) < PARALLEL2 {
        return None;
    }
    let u = scale(1.0 / Float::sqrt(s2), sum);
    let v = scale(1.0 / Float::sqrt(d2), difference);
    // At right angles to rounding of the shorter; once more, to rounding of one.
    let v = if s2 > d2 { sub(v, scale(dot(u, v), u)) } else { v };
    let u = if s2 > d2 { u } else { sub(u, scale(dot(u, v), v)) };
    Some([u, v, cross(u, v)])
}
