//! One direction known exactly (`σ = 0`): a constraint, and the others decide the turn about it.
//!
//! 1. the shortest rotation that takes `r₀` to `b₀`;
//! 2. the best turn about `b₀`, in closed form: with `u = b₀`, `h = A r` of the first step,
//!    `C = Σ w (u×b)·(u×h)`, `S = Σ w u·(b×h)`, angle `atan2(S, C)`.
//!
//! SciPy's `Rotation.align_vectors` with one infinite weight does the same.
use num_traits::Float;

use crate::math::rotation::exp;
use crate::math::so3::{Quaternion, dcm_from_quaternion, normalized, quaternion_product, step};
use crate::math::svd3::perpendicular;
use crate::math::vec3::{Vec3, add, cross, dot, rotate, scale, sub};

use super::norm2;

/// `|b + r|` below which the two are opposite and every axis at right angles is as good.
const OPPOSITE: f64 = 1e-12;

/// The shortest rotation with `A r = b`. Opposite directions: half a turn about the cross product of `b` and the
/// coordinate axis it is farthest from.
#[must_use]
pub fn shortest(body: Vec3<f64>, reference: Vec3<f64>) -> Quaternion<f64> {
    let sum = add(body, reference);
    let length = Float::sqrt(norm2(sum));
    let mut q = if length < OPPOSITE {
        let [x, y, z] = perpendicular(body);
        [x, y, z, 0.0]
    } else {
        let middle = scale(1.0 / length, sum);
        let [x, y, z] = cross(body, middle);
        normalized([x, y, z, dot(body, middle)])
    };
    // Far from the identity `middle` is rough: close what is left, once for the size and once for rounding.
    for _ in 0..2 {
        q = align(q, body, reference);
    }
    q
}

/// The small shortest rotation that closes `A r = b`, applied.
#[must_use]
pub fn align(q: Quaternion<f64>, body: Vec3<f64>, reference: Vec3<f64>) -> Quaternion<f64> {
    let h = rotate(&dcm_from_quaternion(q), reference);
    step(q, cross(sub(body, h), h))
}

/// `[C, S]` of step 2 for one direction.
#[must_use]
pub fn lever(u: Vec3<f64>, body: Vec3<f64>, h: Vec3<f64>) -> [f64; 2] {
    [dot(cross(u, body), cross(u, h)), dot(u, cross(sub(body, h), h))]
}

/// The attitude turned by `angle` about the body axis `u`.
#[must_use]
pub fn turn(q: Quaternion<f64>, u: Vec3<f64>, angle: f64) -> Quaternion<f64> {
    normalized(quaternion_product(q, exp(scale(angle, u))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortest_rotations() {
        let r: Vec3<f64> = [0.6, 0.0, 0.8];
        for b in
            [[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.6, 0.0, -0.8], [-0.6, 1e-7, -0.8], [-0.6, 1e-13, -0.8]]
        {
            let b = scale(1.0 / norm2(b).sqrt(), b);
            let q = shortest(b, r);
            let left = sub(rotate(&dcm_from_quaternion(q), r), b);
            assert!(norm2(left).sqrt() < 1e-15, "{b:?}");
            // w = cos(half the angle between them).
            let half = 0.5 * (norm2(add(b, r)).sqrt());
            assert!((q[3].abs() - half).abs() < 1e-12, "{b:?} {q:?}");
        }
    }

    #[test]
    fn no_other_turn_is_nearer_to_the_identity() {
        let (b, r) = ([0.48, 0.6, 0.64], [-0.64, 0.48, 0.6]);
        let q = shortest(b, r);
        for k in 0..100 {
            assert!(q[3] >= turn(q, b, 0.0628 * f64::from(k))[3].abs() - 1e-15);
        }
    }
}
