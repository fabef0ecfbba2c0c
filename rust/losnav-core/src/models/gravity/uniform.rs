//! The same acceleration everywhere: `U = g·r`, `Γ = 0`. A laboratory on the Earth: 3e-7 of g is lost per metre of height.
use super::Gravity;
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, dot, splat};

/// A constant field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uniform {
    /// `g`, m/s².
    pub acceleration: [f64; 3],
}

impl Gravity for Uniform {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        dot(splat(self.acceleration), r)
    }

    #[inline(always)]
    fn acceleration<T: Real>(&self, _r: Vec3<T>) -> Vec3<T> {
        splat(self.acceleration)
    }

    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, _r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        (splat(self.acceleration), [[T::zero(); 3]; 3])
    }
}
