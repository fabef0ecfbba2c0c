//! A point mass: `U = μ/r`, `g = −μ r/r³`, `Γ = μ (3 r rᵀ/r⁵ − I/r³)`.
//!
//! What every body is from afar; of a small body a few radii away the shape still counts for percents.
use super::Gravity;
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, dot, scale};

/// All mass in the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMass {
    /// Gravitational parameter `μ`, m³/s².
    pub mu: f64,
}

impl Gravity for PointMass {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        T::splat(self.mu) * dot(r, r).rsqrt()
    }

    #[inline(always)]
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        let inverse = dot(r, r).rsqrt();
        scale(T::splat(-self.mu) * inverse * inverse * inverse, r)
    }

    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        let inverse = dot(r, r).rsqrt();
        let unit = scale(inverse, r);
        let pull = T::splat(-self.mu) * inverse * inverse * inverse;
        let stretch = T::splat(-3.0) * pull;
        let along = scale(stretch, unit);
        let mut gradient = [[T::zero(); 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                gradient[i][j] = unit[i] * along[j];
            }
            gradient[i][i] += pull;
        }
        (scale(pull, r), gradient)
    }
}
