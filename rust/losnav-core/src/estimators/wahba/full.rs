//! Directions whose noise is not isotropic: a covariance each, `J = ½ Σ eᵀ W e`.
//!
//! No longer Wahba's problem: `K` knows nothing of it, so the minimum is the one that Newton steps reach from Wahba's with the mean
//! weights, and no theorem says that it is the only one.
//!
//! 1. Wahba's problem with the weights `tr W / 3`; what is free there is free here;
//! 2. Newton steps with the exact Hessian `Σ [h×]ᵀ W [h×] + (v·h) I − sym(v hᵀ)`, `v = W e`, or its first term where that one is not
//!    positive definite;
//! 3. information `Σ [h×]ᵀ W [h×]`.
use num_traits::Float;

use crate::math::jacobi::eigen;
use crate::math::so3::{Quaternion, dcm_from_quaternion, step};
use crate::math::sym3::Sym3;
use crate::math::vec3::{
    Mat3, Vec3, add, cross, dot, mul, rotate, rotate_transposed, scale, skew, sub, transpose,
};

use super::careful::{self, Solution};
use super::norm2;

/// Bound on the steps.
const STEPS: usize = 30;
/// Last step of a converged estimate, rad: above the rounding of the weakest turn of rank 3, `ε` over `RANK_TOLERANCE`.
const ARRIVED: f64 = 1e-8;
/// Step below which another one changes nothing, rad.
const STILL: f64 = 1e-14;

/// The sums of one pass over the directions.
struct Sums {
    gradient: Vec3<f64>,
    information: Sym3<f64>,
    second: Sym3<f64>,
    loss: f64,
}

/// Solves one problem; `roots` holds `S` with `SᵀS = W` for each direction. `start` is posed in the mean weights.
#[must_use]
pub fn solve(start: &careful::Problem<'_>, roots: &[Mat3<f64>]) -> Solution {
    let wahba = careful::solve(start);
    let mut q = wahba.quaternion;
    if !q.iter().all(|x| x.is_finite()) {
        return wahba;
    }
    let mut last = f64::INFINITY;
    let steps = if wahba.rank == 3 { STEPS } else { 0 };
    for _ in 0..steps {
        let now = sums(start, roots, q);
        let (exact, first) = (plus(&now.information, &now.second).ldl(), now.information.ldl());
        let delta = if exact.positive() { exact.solve(now.gradient) } else { first.solve(now.gradient) };
        q = step(q, delta);
        last = Float::sqrt(norm2(delta));
        // Written so that NaN stops.
        let moving = last > STILL && last < f64::INFINITY;
        if !moving {
            break;
        }
    }
    let end = sums(start, roots, q);
    let minimum = plus(&end.information, &end.second).ldl().positive();
    let axis = eigen(&end.information.full()).vectors[2];
    let axis = if wahba.rank == 2 { wahba.axis } else { axis };
    let solution = Solution {
        quaternion: q,
        information: end.information,
        loss: end.loss,
        rank: wahba.rank,
        axis,
        weakest: end.information.form(axis),
        exact: false,
        converged: wahba.rank == 3 && last <= ARRIVED && minimum,
    };
    solution.checked()
}

fn sums(problem: &careful::Problem<'_>, roots: &[Mat3<f64>], q: Quaternion<f64>) -> Sums {
    let dcm = dcm_from_quaternion(q);
    let zero = Sym3::zero();
    let mut sum = Sums { gradient: [0.0; 3], information: zero, second: zero, loss: 0.0 };
    for ((b, r), root) in problem.body.iter().zip(problem.reference).zip(roots) {
        let h = rotate(&dcm, *r);
        let whitened = rotate(root, sub(*b, h));
        let v = rotate_transposed(root, whitened);
        sum.gradient = add(sum.gradient, cross(v, h));
        let rows = mul(root, &skew(h));
        sum.information = plus(&sum.information, &Sym3::part(&mul(&transpose(&rows), &rows)));
        let outer = Sym3::part(&[scale(v[0], h), scale(v[1], h), scale(v[2], h)]);
        sum.second = plus(&sum.second, &outer.complement(dot(v, h)));
        sum.loss += 0.5 * norm2(whitened);
    }
    sum
}

fn plus(a: &Sym3<f64>, b: &Sym3<f64>) -> Sym3<f64> {
    Sym3(core::array::from_fn(|k| a.0[k] + b.0[k]))
}
