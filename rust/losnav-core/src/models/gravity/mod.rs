//! Gravity of one body in axes fixed to it: `g = +∇U`, `Γ = ∂g/∂r = ∇∇U`.
//!
//! `U > 0`. Whoever flies in a rotating frame adds Coriolis and centrifugal accelerations; here is mass attraction only.
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, scale};

pub mod harmonics;
pub mod point_mass;
pub mod polyhedron;
pub mod uniform;

pub use harmonics::Harmonics;
pub use point_mass::PointMass;
pub use polyhedron::Polyhedron;
pub use uniform::Uniform;

/// A field of gravity. Implementations are `#[inline(always)]` for the reason given at [`Real`].
pub trait Gravity {
    /// `U`, m²/s².
    fn potential<T: Real>(&self, r: Vec3<T>) -> T;
    /// `g = ∇U`, m/s².
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T>;
    /// `g` and `Γ = ∂g/∂r`, 1/s², symmetric.
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>);
}

impl<G: Gravity> Gravity for &G {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        (**self).potential(r)
    }
    #[inline(always)]
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        (**self).acceleration(r)
    }
    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        (**self).acceleration_and_gradient(r)
    }
}

/// A field times a number: gravity known to within so much of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled<G> {
    /// The field.
    pub field: G,
    /// What it is multiplied by.
    pub factor: f64,
}

impl<G: Gravity> Gravity for Scaled<G> {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        T::splat(self.factor) * self.field.potential(r)
    }
    #[inline(always)]
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        scale(T::splat(self.factor), self.field.acceleration(r))
    }
    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        let (g, gradient) = self.field.acceleration_and_gradient(r);
        let k = T::splat(self.factor);
        (scale(k, g), gradient.map(|row| scale(k, row)))
    }
}
