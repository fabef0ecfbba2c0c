//! Attitude from directions: one Wahba problem, five classical solvers, one polish, one verdict.
//!
//! ```text
//! J(A) = ½ Σ w |b − A r|² = Σ w − tr(A Bᵀ),   B = Σ w b rᵀ,   w = 1/σ²                       (A1), (A2)
//! ```
//!
//! Every solver sees only the attitude profile matrix `B` (Wahba 1965; Shuster & Oh 1981; Markley & Mortari 2000). What `B`
//! holds of a narrow field or of a faint direction beside a bright one is lost in its last digits, so the answer of
//! any of them is a start: [`polish`] goes on with Newton steps on the residuals themselves, which have those
//! digits. At its end the exact Hessian is positive definite, and that is a proof: of the stationary attitudes only
//! the best one has such a Hessian, for they are the eigenvectors of Davenport's `K` and the Hessian holds the gaps from
//! that eigenvalue to the three others.
//!
//! 1. sums over the directions: [`Profile`];
//! 2. a solver: [`quest`] over any [`Real`], lanes included; [`q_method`], [`svd`], [`foam`], [`esoq2`] in `f64`;
//! 3. [`polish`];
//! 4. where that does not end well, or a direction is exact (`σ = 0`): [`careful`], which also says what is free.
pub mod careful;
pub mod characteristic;
pub mod esoq2;
pub mod exact;
pub mod foam;
pub mod full;
pub mod polish;
pub mod q_method;
pub mod quest;
pub mod robust;
pub mod sequential;
pub mod svd;

use crate::math::real::Real;
use crate::math::so3::Quaternion;
use crate::math::sym3::Sym3;
use crate::math::vec3::{Mat3, Vec3, add, cross, dot, mul, rotate, scale, scale_add, sub, transpose};

/// Which solver gives the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Shuster & Oh 1981.
    Quest,
    /// Davenport 1968.
    QMethod,
    /// Markley 1988.
    Svd,
    /// Markley 1993.
    Foam,
    /// Mortari 1997.
    Esoq2,
}

impl Method {
    /// The solver's own answer.
    #[must_use]
    pub fn start(self, profile: &Profile<f64>) -> Quaternion<f64> {
        match self {
            Self::Quest => quest::quaternion(profile),
            Self::QMethod => q_method::quaternion(profile),
            Self::Svd => svd::quaternion(profile),
            Self::Foam => foam::quaternion(profile),
            Self::Esoq2 => esoq2::quaternion(profile),
        }
    }
}

/// Sums over the directions: all that the classical solvers see.
#[derive(Clone, Copy, Debug)]
pub struct Profile<T> {
    /// Attitude profile matrix `B = Σ w b rᵀ`.
    pub b: Mat3<T>,
    /// `Σ w r rᵀ`.
    pub spread: Sym3<T>,
    /// `Σ w`.
    pub weight: T,
}

/// What the directions say about an attitude.
#[derive(Clone, Copy, Debug)]
pub struct Residual<T> {
    /// `Σ w e × h`, minus the gradient of the loss over `δα`.
    pub gradient: Vec3<T>,
    /// `½ Σ w |e|²`.
    pub loss: T,
}

impl<T: Real> Profile<T> {
    /// No directions.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { b: [[T::zero(); 3]; 3], spread: Sym3::zero(), weight: T::zero() }
    }

    /// One direction more. By value: sums behind a reference would live in memory.
    #[inline(always)]
    #[must_use]
    pub fn with(self, body: Vec3<T>, reference: Vec3<T>, weight: T) -> Self {
        let r = scale(weight, reference);
        Self {
            b: [
                scale_add(body[0], r, self.b[0]),
                scale_add(body[1], r, self.b[1]),
                scale_add(body[2], r, self.b[2]),
            ],
            spread: self.spread.plus_outer(weight, reference),
            weight: self.weight + weight,
        }
    }

    /// The sum over the lanes, in every lane of `S`.
    #[inline(always)]
    pub fn sum_lanes<S: Real>(&self) -> Profile<S> {
        let mut b = [[S::zero(); 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                b[i][j] = S::splat(self.b[i][j].sum_lanes());
            }
        }
        Profile { b, spread: self.spread.sum_lanes(), weight: S::splat(self.weight.sum_lanes()) }
    }

    /// `B` of weights that sum to one.
    #[inline(always)]
    pub fn normalized(&self) -> Mat3<T> {
        let k = self.weight.recip();
        [scale(k, self.b[0]), scale(k, self.b[1]), scale(k, self.b[2])]
    }

    /// Information about `δα`, `Σ w (I − h hᵀ)` with `h = A r` (A4).
    #[inline(always)]
    pub fn information(&self, dcm: &Mat3<T>) -> Sym3<T> {
        self.spread.turned(dcm).complement(self.weight)
    }

    /// Exact Hessian of the loss over `δα` (A5): `tr(M) I − sym M`, `M = B Aᵀ = Σ w b hᵀ`.
    #[inline(always)]
    pub fn hessian(&self, dcm: &Mat3<T>) -> Sym3<T> {
        let part = Sym3::part(&mul(&self.b, &transpose(dcm)));
        part.complement(part.trace())
    }
}

impl<T: Real> Residual<T> {
    /// Perfect agreement.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { gradient: [T::zero(); 3], loss: T::zero() }
    }

    /// The sum over the lanes, in every lane of `S`.
    #[inline(always)]
    pub fn sum_lanes<S: Real>(&self) -> Residual<S> {
        let [x, y, z] = self.gradient;
        Residual {
            gradient: [S::splat(x.sum_lanes()), S::splat(y.sum_lanes()), S::splat(z.sum_lanes())],
            loss: S::splat(self.loss.sum_lanes()),
        }
    }

    /// One direction more. The residual is a difference, so that its digits are those of the measurement.
    #[inline(always)]
    #[must_use]
    pub fn with(self, body: Vec3<T>, reference: Vec3<T>, weight: T, dcm: &Mat3<T>) -> Self {
        let h = rotate(dcm, reference);
        let e = sub(body, h);
        let weighted = scale(weight, e);
        Self {
            gradient: add(self.gradient, cross(weighted, h)),
            loss: T::splat(0.5).mul_add(dot(weighted, e), self.loss),
        }
    }
}

/// A Wahba problem over one scalar type.
pub trait Directions<T: Real> {
    /// Sums over all directions.
    fn profile(&self) -> Profile<T>;
    /// Gradient and loss at an attitude.
    fn residual(&self, dcm: &Mat3<T>) -> Residual<T>;
}

/// Unit vectors in body and in reference axes with their weights; `T` may be lanes, one problem each. The last weight
/// serves all further directions.
#[derive(Clone, Copy, Debug)]
pub struct Vectors<'a, T> {
    /// Body axes.
    pub body: &'a [Vec3<T>],
    /// Reference axes.
    pub reference: &'a [Vec3<T>],
    /// `1/σ²`, rad⁻².
    pub weights: &'a [T],
}

// Plain loops: a closure left standing inside a function compiled for a wider instruction set would lose that set.
impl<T: Real> Directions<T> for Vectors<'_, T> {
    #[inline(always)]
    fn profile(&self) -> Profile<T> {
        let mut sum = Profile::zero();
        let mut weights = self.weights;
        let mut weight = T::one();
        for (b, r) in self.body.iter().zip(self.reference) {
            if let [first, rest @ ..] = weights {
                weight = *first;
                weights = rest;
            }
            sum = sum.with(*b, *r, weight);
        }
        sum
    }

    #[inline(always)]
    fn residual(&self, dcm: &Mat3<T>) -> Residual<T> {
        let mut sum = Residual::zero();
        let mut weights = self.weights;
        let mut weight = T::one();
        for (b, r) in self.body.iter().zip(self.reference) {
            if let [first, rest @ ..] = weights {
                weight = *first;
                weights = rest;
            }
            sum = sum.with(*b, *r, weight, dcm);
        }
        sum
    }
}

/// Davenport's matrix `K = [[S − s I, z], [zᵀ, s]]`, `S = B + Bᵀ`, `s = tr B`.
#[must_use]
pub fn davenport_matrix(b: &Mat3<f64>) -> [[f64; 4]; 4] {
    let s = b[0][0] + b[1][1] + b[2][2];
    let z = antisymmetric(b);
    let mut k = [[0.0; 4]; 4];
    for i in 0..3 {
        for j in 0..3 {
            k[i][j] = b[i][j] + b[j][i];
        }
        k[i][i] -= s;
        k[i][3] = z[i];
        k[3][i] = z[i];
    }
    k[3][3] = s;
    k
}

/// `z = [B₂₃ − B₃₂, B₃₁ − B₁₃, B₁₂ − B₂₁]`.
#[inline(always)]
pub fn antisymmetric<T: Real>(b: &Mat3<T>) -> Vec3<T> {
    [b[1][2] - b[2][1], b[2][0] - b[0][2], b[0][1] - b[1][0]]
}

/// Squared length.
#[inline(always)]
pub(crate) fn norm2<T: Real>(v: Vec3<T>) -> T {
    dot(v, v)
}
