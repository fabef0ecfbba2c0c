//! What sensors of one target share: where it is, and derivatives carried from body axes to the state's.
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, cross, rotate_transposed, scale, sub};
use crate::models::kinematics::Kinematics;

/// `t − p`, reference axes.
#[inline(always)]
pub fn offset<T: Real>(x: &Kinematics<T>, target: Vec3<T>) -> Vec3<T> {
    sub(target, x.position)
}

/// `∂h/∂p` and `∂h/∂α` of a scalar with `g = ∂h/∂L`, `L = dcm (t − p)`: `−dcmᵀ g`, and `g × L` for `∂L/∂α = [L×]`.
#[inline(always)]
pub fn pull_back<T: Real>(gradient: Vec3<T>, body: Vec3<T>, dcm: &Mat3<T>) -> (Vec3<T>, Vec3<T>) {
    (scale(-T::one(), rotate_transposed(dcm, gradient)), cross(gradient, body))
}
