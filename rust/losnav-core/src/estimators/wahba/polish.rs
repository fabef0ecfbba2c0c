//! Newton steps on the residuals, from the answer of any solver: what `B` lost comes back.
//!
//! 1. gradient `Σ w e × h` from the residuals `e = b − h`, differences of close numbers and therefore exact;
//! 2. exact Hessian `tr(M) I − sym M`, `M = B Aᵀ`: its errors only slow the steps down;
//! 3. step, until it is below [`ARRIVED`]; convergence is cubic in the generic direction, so one step is usual.
//!
//! A field of width `θ` leaves `ε/θ²` of error in `B` and `ε/θ` in the residuals. Sound is an estimate whose last step was
//! small and whose Hessian is positive definite by a margin; all others are for [`careful`](super::careful).
use crate::math::real::{Mask, Real};
use crate::math::so3::{Quaternion, dcm_from_quaternion, step};
use crate::math::sym3::Sym3;
use crate::math::vec3::dot;

use super::{Directions, Profile, quest};

/// Size of a last step, rad: what comes after it is its square at most.
pub const ARRIVED: f64 = 1e-10;
/// Bound on the steps.
const STEPS: usize = 4;
/// Least `4 det H / tr³ H`, which is half the ratio of the smallest to the largest eigenvalue where that is small.
const MARGIN: f64 = 1e-6;

/// An attitude and what the directions say about it; `T` may be lanes.
#[derive(Clone, Copy, Debug)]
pub struct Estimate<T: Real> {
    /// Orientation, scalar last, either sign.
    pub quaternion: Quaternion<T>,
    /// Information about `δα`, body axes (A4).
    pub information: Sym3<T>,
    /// Wahba's loss.
    pub loss: T,
    /// A proven minimum, with digits to spare?
    pub sound: T::Mask,
}

/// QUEST and the polish: the fast way.
#[inline(always)]
pub fn solve<T: Real>(directions: &impl Directions<T>) -> Estimate<T> {
    let profile = directions.profile();
    let start = quest::quaternion(&profile);
    polish(directions, &profile, start)
}

/// Steps from `start` to the minimum.
#[inline(always)]
pub fn polish<T: Real>(
    directions: &impl Directions<T>,
    profile: &Profile<T>,
    start: Quaternion<T>,
) -> Estimate<T> {
    let limit = T::splat(ARRIVED.max(T::EPSILON * 16.0) * ARRIVED.max(T::EPSILON * 16.0));
    let mut estimate = Estimate {
        quaternion: start,
        information: Sym3::zero(),
        loss: T::zero(),
        sound: T::Mask::splat(false),
    };
    for _ in 0..STEPS {
        let dcm = dcm_from_quaternion(estimate.quaternion);
        let residual = directions.residual(&dcm);
        let hessian = profile.hessian(&dcm);
        let ldl = hessian.ldl();
        let delta = ldl.solve(residual.gradient);
        estimate.quaternion = step(estimate.quaternion, delta);
        estimate.information = profile.information(&dcm);
        let gain = T::splat(0.5) * dot(delta, residual.gradient);
        estimate.loss = (residual.loss - gain).max(T::zero());
        let length2 = dot(delta, delta);
        let trace = hessian.trace();
        let margin = (T::splat(MARGIN / 4.0) * trace * trace * trace).lt(ldl.determinant());
        let arrived = length2.le(limit);
        estimate.sound = arrived.and(margin).and(ldl.positive()).and(estimate.loss.is_finite());
        if !limit.lt(length2).any() {
            break;
        }
    }
    estimate
}
