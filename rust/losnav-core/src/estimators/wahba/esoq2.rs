//! ESOQ2, the second estimator of the optimal quaternion (Mortari, J. Astronautical Sciences 45(2), 1997).
//!
//! With rotation axis `e` and angle `φ`, `K q = λ q` says
//!
//! ```text
//! M e = 0,  M = (λ − s) ((λ + s) I − S) − z zᵀ,     q = [(λ − s) e, zᵀe] / norm
//! ```
//!
//! `e` is the cross product of two rows of `M`, of the three the longest. At `φ = 0` the axis is undefined, so the problem
//! is first turned ([`sequential`](super::sequential)) until the trace `s` is smallest, which makes `φ` largest.
use crate::math::so3::{Quaternion, normalized};
use crate::math::vec3::{cross, dot};

use super::characteristic::{Invariants, largest_root};
use super::sequential::HalfTurn;
use super::{Profile, norm2};

/// Orientation of least loss; not finite where `B` determines none.
#[must_use]
pub fn quaternion(profile: &Profile<f64>) -> Quaternion<f64> {
    let b = profile.normalized();
    let root = largest_root(Invariants::new(&b).coefficients());
    let trace = b[0][0] + b[1][1] + b[2][2];
    let after = |k: usize| trace - 2.0 * b[k][k];
    let turn = HalfTurn::of_largest([after(0), after(1), after(2), -trace]);
    let Invariants { symmetric, z, trace, .. } = Invariants::new(&turn.turn(&b));
    let m = symmetric.complement(root + trace).scaled(root - trace).plus_outer(-1.0, z);
    let [x, y, w] = m.full();
    let axes = [cross(y, w), cross(w, x), cross(x, y)];
    let longest = axes.into_iter().fold([0.0; 3], |a, b| if norm2(b) > norm2(a) { b } else { a });
    let k = 1.0 / norm2(longest).max(f64::MIN_POSITIVE);
    // Unit length first: the components may be small enough for their squares to vanish.
    let e = longest.map(|c| c * num_traits::Float::sqrt(k));
    let scalar = dot(z, e);
    turn.undo(normalized([(root - trace) * e[0], (root - trace) * e[1], (root - trace) * e[2], scalar]))
}
