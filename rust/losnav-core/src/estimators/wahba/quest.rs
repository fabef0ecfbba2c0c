//! QUEST (Shuster & Oh, J. Guidance and Control 4(1), 1981), branch-free over any [`Real`].
//!
//! 1. `λ`: largest root of the characteristic polynomial ([`characteristic`](super::characteristic));
//! 2. the sequential rotation with the largest `γ`, which is proportional to the scalar part of its quaternion, so at
//!    least half of it: a half turn about any axis is no special case. The four `γ` are the principal 3×3 minors of
//!    `λI − K`;
//! 3. `X = (α I + β S + S²) z`, `γ = (λ + s) α − Δ` with `α = λ² − s² + κ`, `β = λ − s`; `q = [X, γ]/norm`.
use crate::math::real::Real;
use crate::math::so3::{Quaternion, normalized};
use crate::math::sym3::Sym3;
use crate::math::vec3::{Mat3, Vec3, scale_add};

use super::Profile;
use super::characteristic::{Invariants, largest_root};
use super::sequential::HalfTurn;

/// Orientation of least loss; not finite where `B` determines none.
#[inline(always)]
pub fn quaternion<T: Real>(profile: &Profile<T>) -> Quaternion<T> {
    let b = profile.normalized();
    let invariants = Invariants::new(&b);
    let root = largest_root(invariants.coefficients());
    let turn = HalfTurn::of_largest(gammas(&invariants, root));
    turn.undo(gibbs(&turn.turn(&b), root))
}

/// `γ` after a half turn about x, y, z, and without one.
#[inline(always)]
fn gammas<T: Real>(i: &Invariants<T>, root: T) -> [T; 4] {
    // P = λI − K; each minor leaves out one row and column.
    let [a, d, e, b, f, c] = i.symmetric.complement(root + i.trace).0;
    let [x, y, z] = i.z;
    let last = root - i.trace;
    let minor = |m: [T; 6]| Sym3(m).determinant();
    [
        minor([b, f, -y, c, -z, last]),
        minor([a, e, -x, c, -z, last]),
        minor([a, d, -x, b, -y, last]),
        minor([a, d, e, b, f, c]),
    ]
}

/// Step 3.
#[inline(always)]
fn gibbs<T: Real>(b: &Mat3<T>, root: T) -> Quaternion<T> {
    let Invariants { symmetric, z, trace, kappa, delta } = Invariants::new(b);
    let alpha = root.mul_add(root, kappa - trace * trace);
    let beta = root - trace;
    let gamma = (root + trace).mul_add(alpha, -delta);
    let inner = scale_add(beta, z, symmetric.apply(z));
    let x: Vec3<T> = scale_add(alpha, z, symmetric.apply(inner));
    normalized([x[0], x[1], x[2], gamma])
}
