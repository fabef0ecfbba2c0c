//! The way for everything the fast one leaves: narrow fields, faint directions beside bright ones, exact directions, and
//! problems that do not determine an attitude. One problem, `f64`, no hurry.
//!
//! 1. an exact direction: [`exact`](super::exact);
//! 2. weights relative to the largest, so that none of them leaves the range of numbers;
//! 3. the asked solver's start, and the q-method's, which cannot fail, if that one does not end in a minimum;
//! 4. about the weakest axis in closed form, then Newton steps in the eigenvectors of the Hessian;
//! 5. rank: eigenvalues of the Hessian, `Σ w (u×b)·(u×h)` for each eigenvector `u`, above `RANK_TOLERANCE²` of the sum of
//!    weights, which is the largest they can be. In that form an eigenvalue has its digits at any size. It is the
//!    rank of the whitened Jacobian that observability asks for, and less where the directions contradict each other;
//! 6. of the attitudes that fit equally well the one nearest to the identity.
use num_traits::Float;

use crate::math::jacobi::{Eigen, eigen};
use crate::math::so3::{Quaternion, dcm_from_quaternion, normalized, step};
use crate::math::svd3::perpendicular;
use crate::math::sym3::Sym3;
use crate::math::triangular6::RANK_TOLERANCE;
use crate::math::vec3::{Mat3, Vec3, add, cross, dot, rotate, rotate_transposed, scale};

use super::exact::{lever, shortest, turn};
use super::{Directions, Method, Profile, Residual, davenport_matrix, norm2};

/// Bound on the steps; a weak axis gains two digits a step at worst.
const STEPS: usize = 30;
/// Eigenvalues of the Hessian this far apart: the weak axis is turned about in closed form first.
const WEAK: f64 = 1e-3;
/// Last step of a converged estimate, rad: above the rounding of the weakest turn of rank 3, `ε` over `RANK_TOLERANCE`.
const ARRIVED: f64 = 1e-8;
/// Distance from the minimum of a classical solver's answer that counts as converged, rad.
const CLASSICAL: f64 = 1e-7;
/// Step below which another one changes nothing, rad.
const STILL: f64 = 1e-15;
/// An eigenvalue of `K` this close to the largest, in units of the sum of weights, belongs to it.
const SAME_EIGENVALUE: f64 = 1e-13;

/// An attitude, what is known about it and what is not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Orientation, scalar last, either sign.
    pub quaternion: Quaternion<f64>,
    /// Information about `δα` from the directions that are not exact, body axes, rad⁻².
    pub information: Sym3<f64>,
    /// Wahba's loss, over the directions that are not exact.
    pub loss: f64,
    /// Rotations that the directions determine, 0 to 3.
    pub rank: u8,
    /// Body axis of the exact direction, of the free rotation, or of the rotation that is known least.
    pub axis: Vec3<f64>,
    /// Information about the rotation about `axis`, with its own digits: `Σ w |u × h|²`.
    pub weakest: f64,
    /// Is one direction exact?
    pub exact: bool,
    /// The proven and only minimum?
    pub converged: bool,
}

impl Solution {
    /// What stands for a problem that could not be posed.
    #[must_use]
    pub fn invalid() -> Self {
        Self {
            quaternion: [f64::NAN; 4],
            information: Sym3([f64::NAN; 6]),
            loss: f64::NAN,
            rank: 0,
            axis: [f64::NAN; 3],
            weakest: f64::NAN,
            exact: false,
            converged: false,
        }
    }

    /// Covariance of `δα`; `None` where a rotation is free. About `axis` the information of its own serves: in the matrix
    /// it may stand in the last digits of the others.
    #[must_use]
    pub fn covariance(&self) -> Option<Sym3<f64>> {
        if self.rank < 3 {
            return None;
        }
        let u = self.axis;
        let mut covariance = Sym3::zero().plus_outer(1.0 / self.weakest, u);
        if !self.exact {
            let e = perpendicular(u);
            let f = cross(u, e);
            let (fe, ff) = (self.information.apply(e), self.information.apply(f));
            let (a, b, c) = (dot(e, fe), dot(e, ff), dot(f, ff));
            // Block by block: a product of weights may leave the range of numbers.
            let (ratio, rest) = (b / c, 1.0 / (a - b * (b / c)));
            covariance = covariance
                .plus_outer(rest, e)
                .plus_outer(1.0 / c + ratio * ratio * rest, f)
                .plus_pair(-ratio * rest, e, f);
        }
        Some(covariance)
    }

    /// What cannot be written down is not known.
    #[must_use]
    pub fn checked(mut self) -> Self {
        self.converged &= self.loss.is_finite()
            && self.information.0.iter().all(|x| x.is_finite())
            && self.covariance().is_some_and(|p| p.0.iter().all(|x| x.is_finite()));
        self
    }

    /// An attitude known otherwise: rank and free axis are those of its information.
    #[must_use]
    pub fn known(quaternion: Quaternion<f64>, information: Sym3<f64>, loss: f64) -> Self {
        let Eigen { values, vectors } = eigen(&information.full());
        // The sum of the weights is half the trace.
        let floor = RANK_TOLERANCE * RANK_TOLERANCE * 0.5 * information.trace();
        let rank = values.iter().filter(|value| **value > floor).count() as u8;
        let finite = quaternion.iter().chain(&information.0).all(|x| x.is_finite()) && loss.is_finite();
        Self {
            quaternion,
            information,
            loss,
            rank,
            axis: vectors[2],
            weakest: values[2],
            exact: false,
            converged: rank == 3 && finite,
        }
    }
}

/// Unit vectors and weights, one for each or one for all; an infinite weight is an exact direction.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// Body axes.
    pub body: &'a [Vec3<f64>],
    /// Reference axes.
    pub reference: &'a [Vec3<f64>],
    /// `1/σ²`.
    pub weights: &'a [f64],
    /// Solver of the start.
    pub method: Method,
    /// Newton steps after it? Without them the answer is the classical solver's own, converged if one such step would be
    /// shorter than `CLASSICAL`.
    pub polish: bool,
}

/// Solves one problem.
#[must_use]
pub fn solve(problem: &Problem<'_>) -> Solution {
    let n = problem.body.len().min(problem.reference.len());
    let mut largest: f64 = 0.0;
    let mut exact = None;
    for index in 0..n {
        let weight = problem.weight(index);
        if weight == f64::INFINITY {
            exact = Some(index);
        } else {
            largest = largest.max(weight);
        }
    }
    let scaled = Scaled { problem, largest: if largest > 0.0 { largest } else { 1.0 }, exact };
    let mut solution = match exact {
        Some(index) => scaled.constrained(index),
        None => scaled.free(),
    };
    // Back to the weights as given.
    solution.loss *= scaled.largest;
    solution.information = solution.information.scaled(scaled.largest);
    solution.weakest *= scaled.largest;
    solution.checked()
}

impl Problem<'_> {
    fn weight(&self, index: usize) -> f64 {
        let last = self.weights.len().wrapping_sub(1);
        self.weights.get(index.min(last)).copied().unwrap_or(1.0)
    }
}

/// A problem in relative weights, exact directions left out of every sum.
struct Scaled<'a> {
    problem: &'a Problem<'a>,
    largest: f64,
    exact: Option<usize>,
}

/// Eigenvalues of the Hessian, each with its digits, and its eigenvectors.
struct Curvature {
    values: Vec3<f64>,
    axes: Mat3<f64>,
}

impl Directions<f64> for Scaled<'_> {
    fn profile(&self) -> Profile<f64> {
        let mut sum = Profile::zero();
        self.each(|b, r, w| sum = sum.with(b, r, w));
        sum
    }

    fn residual(&self, dcm: &Mat3<f64>) -> Residual<f64> {
        let mut sum = Residual::zero();
        self.each(|b, r, w| sum = sum.with(b, r, w, dcm));
        sum
    }
}

impl Scaled<'_> {
    fn each(&self, mut take: impl FnMut(Vec3<f64>, Vec3<f64>, f64)) {
        let pairs = self.problem.body.iter().zip(self.problem.reference).enumerate();
        for (index, (b, r)) in pairs.filter(|(index, _)| Some(*index) != self.exact) {
            take(*b, *r, self.problem.weight(index) / self.largest);
        }
    }

    /// `[C, S]` about the body axis `u`, of all directions.
    fn levers(&self, u: Vec3<f64>, dcm: &Mat3<f64>) -> [f64; 2] {
        let mut sum = [0.0; 2];
        self.each(|b, r, w| {
            let [c, s] = lever(u, b, rotate(dcm, r));
            sum = [sum[0] + w * c, sum[1] + w * s];
        });
        sum
    }

    fn curvature(&self, profile: &Profile<f64>, dcm: &Mat3<f64>) -> Curvature {
        let Eigen { vectors, .. } = eigen(&profile.hessian(dcm).full());
        let mut values = [0.0; 3];
        for (value, axis) in values.iter_mut().zip(&vectors) {
            *value = self.levers(*axis, dcm)[0];
        }
        Curvature { values, axes: vectors }
    }

    /// Step 1.
    fn constrained(&self, index: usize) -> Solution {
        let (body, reference) = (self.problem.body, self.problem.reference);
        let (Some(u), Some(r)) = (body.get(index), reference.get(index)) else { return Solution::invalid() };
        let mut q = shortest(*u, *r);
        let profile = self.profile();
        let [c, s] = self.levers(*u, &dcm_from_quaternion(q));
        let determined = Float::hypot(c, s) > RANK_TOLERANCE * RANK_TOLERANCE * profile.weight;
        if determined {
            q = turn(q, *u, Float::atan2(s, c));
            // Rounding of the first angle, which may be large.
            let [c, s] = self.levers(*u, &dcm_from_quaternion(q));
            q = turn(q, *u, Float::atan2(s, c));
        }
        let rank = if determined { 3 } else { 2 };
        self.at(&profile, q, rank, Some(*u), determined)
    }

    /// The solution at an attitude; without an axis the one that is known least.
    fn at(
        &self,
        profile: &Profile<f64>,
        quaternion: Quaternion<f64>,
        rank: u8,
        axis: Option<Vec3<f64>>,
        converged: bool,
    ) -> Solution {
        let dcm = dcm_from_quaternion(quaternion);
        let information = profile.information(&dcm);
        let axis = axis.unwrap_or_else(|| eigen(&information.full()).vectors[2]);
        let mut weakest = 0.0;
        self.each(|_, r, w| weakest += w * norm2(cross(axis, rotate(&dcm, r))));
        let loss = self.residual(&dcm).loss;
        Solution {
            quaternion,
            information,
            loss,
            rank,
            axis,
            weakest,
            exact: self.exact.is_some(),
            converged,
        }
    }

    /// Steps 3 to 6.
    fn free(&self) -> Solution {
        let profile = self.profile();
        let start = self.problem.method.start(&profile);
        if !self.problem.polish {
            return self.classical(&profile, start);
        }
        let mut found = self.descend(&profile, start);
        if !(found.rank == 3 && found.converged) {
            let sure = Method::QMethod.start(&profile);
            found = self.descend(&profile, sure);
        }
        if found.rank < 3 {
            found = self.undetermined(&profile, found);
        }
        found
    }

    /// The start as it is.
    fn classical(&self, profile: &Profile<f64>, start: Quaternion<f64>) -> Solution {
        if !start.iter().all(|x| x.is_finite()) {
            return Solution::invalid();
        }
        let dcm = dcm_from_quaternion(start);
        let curvature = self.curvature(profile, &dcm);
        let floor = RANK_TOLERANCE * RANK_TOLERANCE * profile.weight;
        let (delta, rank) = curvature.newton(self.residual(&dcm).gradient, floor);
        let free = (rank == 2).then_some(curvature.axes[2]);
        let near = norm2(delta) <= CLASSICAL * CLASSICAL;
        self.at(profile, start, rank, free, rank == 3 && near)
    }

    /// Steps 4 and 5.
    fn descend(&self, profile: &Profile<f64>, start: Quaternion<f64>) -> Solution {
        if !start.iter().all(|x| x.is_finite()) {
            return Solution::invalid();
        }
        let mut q = normalized(start);
        let mut last = f64::INFINITY;
        let mut rank = 0;
        let mut axis = [f64::NAN; 3];
        let floor = RANK_TOLERANCE * RANK_TOLERANCE * profile.weight;
        for _ in 0..STEPS {
            let mut curvature = self.curvature(profile, &dcm_from_quaternion(q));
            if curvature.values[2] < WEAK * curvature.values[0] {
                let u = curvature.axes[2];
                let [c, s] = self.levers(u, &dcm_from_quaternion(q));
                if Float::hypot(c, s) > floor {
                    q = turn(q, u, Float::atan2(s, c));
                    curvature = self.curvature(profile, &dcm_from_quaternion(q));
                }
            }
            let residual = self.residual(&dcm_from_quaternion(q));
            let delta;
            (delta, rank) = curvature.newton(residual.gradient, floor);
            axis = curvature.axes[2];
            q = step(q, delta);
            let length = Float::sqrt(norm2(delta));
            // Written so that NaN stops.
            if !(length > STILL && (length > ARRIVED || length < 0.5 * last)) {
                last = length;
                break;
            }
            last = length;
        }
        let free = (rank == 2).then_some(axis);
        self.at(profile, q, rank, free, rank == 3 && last <= ARRIVED)
    }

    /// Step 6.
    fn undetermined(&self, profile: &Profile<f64>, found: Solution) -> Solution {
        if found.rank != 2 {
            return self.at(profile, in_best_eigenspace(profile), found.rank, None, false);
        }
        let (body, reference) = (self.problem.body, self.problem.reference);
        let (u, r) = match (body, reference) {
            ([b], [r, ..]) => (*b, *r),
            ([b, ..], _) if dot(found.axis, *b) < 0.0 => {
                self.family(found.quaternion, scale(-1.0, found.axis))
            }
            _ => self.family(found.quaternion, found.axis),
        };
        self.at(profile, shortest(u, r), 2, Some(u), false)
    }

    /// A body axis about which all turns fit equally well, and where it stands in the reference frame.
    fn family(&self, q: Quaternion<f64>, u: Vec3<f64>) -> (Vec3<f64>, Vec3<f64>) {
        (u, rotate_transposed(&dcm_from_quaternion(q), u))
    }
}

impl Curvature {
    /// Newton's step along the axes in which the loss curves, and how many they are.
    fn newton(&self, gradient: Vec3<f64>, floor: f64) -> (Vec3<f64>, u8) {
        let mut delta = [0.0; 3];
        let mut rank = 0;
        for (value, axis) in self.values.iter().zip(&self.axes) {
            if *value > floor {
                delta = add(delta, scale(dot(gradient, *axis) / value, *axis));
                rank += 1;
            }
        }
        (delta, rank)
    }
}

/// The quaternion nearest to the identity among those of the largest eigenvalue of `K`, of three or four dimensions.
fn in_best_eigenspace(profile: &Profile<f64>) -> Quaternion<f64> {
    let Eigen { values, vectors } = eigen(&davenport_matrix(&profile.normalized()));
    let mut sum = [0.0; 4];
    for (value, v) in values.iter().zip(&vectors) {
        if values[0] - value <= SAME_EIGENVALUE {
            for (total, component) in sum.iter_mut().zip(v) {
                *total += v[3] * component;
            }
        }
    }
    let q = normalized(sum);
    if q.iter().all(|x| x.is_finite()) { q } else { vectors[0] }
}
