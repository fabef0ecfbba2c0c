//! What a sensor sees of a state, whatever else the state holds.
use crate::math::so3::{Quaternion, dcm_from_quaternion};
use crate::math::vec3::{Mat3, Vec3};

use crate::math::real::Real;

/// Position, velocity and attitude of the observer, estimated or given.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<T> {
    /// Reference frame, m.
    pub position: Vec3<T>,
    /// Reference frame, m/s.
    pub velocity: Vec3<T>,
    /// `[BN]`: reference components to body components.
    pub dcm: Mat3<T>,
}

impl<T: Real> Kinematics<T> {
    /// An observer at rest.
    #[inline(always)]
    pub fn at_rest(position: Vec3<T>, attitude: Quaternion<T>) -> Self {
        Self { position, velocity: [T::zero(); 3], dcm: dcm_from_quaternion(attitude) }
    }
}
