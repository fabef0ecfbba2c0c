//! The characteristic polynomial of Davenport's `K` and its largest root by Newton's method.
//!
//! ```text
//! ψ(λ) = λ⁴ − (α₀ + b₀) λ² − c₀ λ + (α₀ b₀ + c₀ s − d₀)
//! α₀ = s² − κ,  b₀ = s² + zᵀz,  c₀ = Δ + zᵀSz,  d₀ = zᵀS²z,   κ = tr adj S,  Δ = det S
//! ```
//!
//! (Shuster & Oh 1981.) With weights that sum to one the largest root is `1 − J`, so Newton starts at one and comes down
//! monotonically. What it cannot give: `ψ` is known to `ε`, so the root to `ε/ψ'` and no better, and `ψ'` falls with the
//! gap to the next root. A field of width `θ` has the gap `θ²`: at 1e-4 rad the root is worth nothing as a start of
//! an eigenvector. That is the known loss of QUEST, FOAM and ESOQ2 beside the q-method and the SVD.
use crate::math::real::{Mask, Real};
use crate::math::sym3::Sym3;
use crate::math::vec3::{Mat3, Vec3, dot};

use super::antisymmetric;

/// Bound on the Newton steps: from above each takes at least a quarter of the way, near a double root half of it.
const STEPS: usize = 40;
/// Newton has arrived when it no longer comes down by more than this, in units of rounding.
const ARRIVED: f64 = 2.0;

/// `S`, `z`, `s` and their invariants.
#[derive(Clone, Copy, Debug)]
pub struct Invariants<T> {
    /// `S = B + Bᵀ`.
    pub symmetric: Sym3<T>,
    /// `z`.
    pub z: Vec3<T>,
    /// `s = tr B`.
    pub trace: T,
    /// `κ = tr adj S`.
    pub kappa: T,
    /// `Δ = det S`.
    pub delta: T,
}

impl<T: Real> Invariants<T> {
    /// Of an attitude profile matrix.
    #[inline(always)]
    pub fn new(b: &Mat3<T>) -> Self {
        let symmetric = Sym3::part(b).scaled(T::splat(2.0));
        Self {
            z: antisymmetric(b),
            trace: b[0][0] + b[1][1] + b[2][2],
            kappa: symmetric.second_invariant(),
            delta: symmetric.determinant(),
            symmetric,
        }
    }

    /// Coefficients of `ψ`: `λ⁴ − c₂ λ² − c₁ λ + c₀`, as `[c₂, c₁, c₀]`.
    #[inline(always)]
    pub fn coefficients(&self) -> [T; 3] {
        let s2 = self.trace * self.trace;
        let alpha0 = s2 - self.kappa;
        let b0 = s2 + dot(self.z, self.z);
        let sz = self.symmetric.apply(self.z);
        let c0 = self.delta + dot(self.z, sz);
        let d0 = dot(sz, sz);
        [alpha0 + b0, c0, alpha0.mul_add(b0, c0.mul_add(self.trace, -d0))]
    }
}

/// Largest root of `λ⁴ − c₂ λ² − c₁ λ + c₀` from above, starting at one.
#[inline(always)]
pub fn largest_root<T: Real>([c2, c1, c0]: [T; 3]) -> T {
    let arrived = T::splat(ARRIVED * T::EPSILON);
    let (two, four) = (T::splat(2.0), T::splat(4.0));
    let mut root = T::one();
    for _ in 0..STEPS {
        let square = root * root;
        let value = (square - c2).mul_add(square, c0 - c1 * root);
        let slope = (four * square - two * c2).mul_add(root, -c1);
        let down = value * slope.recip();
        // At the end rounding may point up or to nowhere: such a lane stays where it is.
        let go = arrived.lt(down);
        root = T::select(go, root - down, root);
        if !go.any() {
            break;
        }
    }
    root
}
