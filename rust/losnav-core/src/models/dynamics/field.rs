//! Gravity of a planet: a point mass, and the flattening of its poles.
//!
//! `a = −μ r/r³ − (3/2) J₂ μ R²/r⁵ [x (1 − 5 z²/r²), y (1 − 5 z²/r²), z (3 − 5 z²/r²)]`, the pole along z. Size of the second
//! term for the Earth: 1e-3 of the first, 11 mm/s² in low orbit; it turns the plane of the orbit by degrees a day.
//! Left out: every other harmonic (1e-6), tides, other bodies.
use num_traits::Float;

use crate::math::real::Real;
use crate::math::vec3::{Vec3, add, dot, scale, scale_add, sub};

/// A planet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Gravitational parameter `μ`, m³/s².
    pub mu: f64,
    /// `J₂ R²`, m².
    pub flattening: f64,
}

impl Field {
    /// Gravitational acceleration, m/s².
    #[inline(always)]
    pub fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        let inverse = dot(r, r).recip();
        let pull = T::splat(-self.mu) * inverse * inverse.sqrt();
        if self.flattening == 0.0 {
            return scale(pull, r);
        }
        let lift = T::splat(1.5 * self.flattening) * inverse;
        let tilt = T::splat(5.0) * r[2] * r[2] * inverse;
        let across = pull * lift.mul_add(T::one() - tilt, T::one());
        let along = pull * lift.mul_add(T::splat(3.0) - tilt, T::one());
        [across * r[0], across * r[1], along * r[2]]
    }

    /// The part of the flattening of [`acceleration`](Self::acceleration).
    #[inline(always)]
    fn lift<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        let inverse = dot(r, r).recip();
        let pull = T::splat(-1.5 * self.mu * self.flattening) * inverse * inverse * inverse.sqrt();
        let tilt = T::splat(5.0) * r[2] * r[2] * inverse;
        let across = pull * (T::one() - tilt);
        [across * r[0], across * r[1], pull * (T::splat(3.0) - tilt) * r[2]]
    }

    /// `g(r) − g(r − d)`, digits kept however small `d`.
    ///
    /// Of the point mass `−μ/r³ (d + (r − d)(1 − (1 + q)^{−3/2}))` with `|r − d|² = r² (1 + q)` (Battin); the flattening is a
    /// thousand times smaller, and a plain difference.
    #[inline(always)]
    pub fn difference<T: Real>(&self, r: Vec3<T>, d: Vec3<T>) -> Vec3<T> {
        let inverse = dot(r, r).recip();
        let there = sub(r, d);
        let two = T::splat(2.0);
        let q = dot(d, sub(d, scale(two, r))) * inverse;
        let one = T::one();
        let cube = (one + q) * (one + q).sqrt();
        let three = T::splat(3.0);
        let less = q * (q + three).mul_add(q, three) / ((cube + one) * cube);
        let pull = T::splat(-self.mu) * inverse * inverse.sqrt();
        let point = scale(pull, scale_add(less, there, d));
        if self.flattening == 0.0 {
            return point;
        }
        add(point, sub(self.lift(r), self.lift(there)))
    }

    /// A time in which the motion turns by about a radian or the distance changes by its size, s: the shorter of `√(r³/μ)`
    /// and `r/v`, over the lanes that are numbers.
    #[inline(always)]
    pub fn pace<T: Real>(&self, state: &[T; 6]) -> f64 {
        let [x, y, z, u, v, w] = *state;
        let (square, speed) = (dot([x, y, z], [x, y, z]), dot([u, v, w], [u, v, w]));
        let mut fastest = 0.0;
        for lane in 0..T::LANES {
            let (square, speed) = (square.lane(lane), speed.lane(lane));
            // 1/s².
            let rate = Float::max(self.mu / Float::sqrt(square), speed) / square;
            fastest = Float::max(fastest, rate);
        }
        1.0 / Float::sqrt(fastest)
    }
}
