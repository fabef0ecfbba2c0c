//! One generic observer, and the ways its state can move.
use losnav_core::estimators::least_squares::PoseState;
use losnav_core::math::real::Real;
use losnav_core::math::so3::{dcm_from_quaternion, quaternion_from_mrp, step};
use losnav_core::math::vec3::{Vec3, add, mul, rotate_transposed, skew, splat};
use losnav_core::models::kinematics::Kinematics;

/// Far enough from every landmark, nowhere near an axis.
pub fn truth() -> Kinematics<f64> {
    let dcm = dcm_from_quaternion(quaternion_from_mrp([0.3, -0.2, 0.4]));
    Kinematics { position: [3.0, -4.0, 60.0], velocity: [1.0, 2.0, -3.0], dcm }
}

/// A state some way off the truth, so that residuals are not small.
pub fn estimate() -> PoseState<f64> {
    PoseState::from_mrp([4.0, -2.0, 58.0], [0.31, -0.18, 0.41])
}

/// The same as a sensor sees it.
pub fn observer() -> Kinematics<f64> {
    let pose = estimate();
    let dcm = dcm_from_quaternion(pose.attitude);
    Kinematics { position: pose.position, velocity: [0.9, 2.2, -3.1], dcm }
}

/// `x` moved by `δ = [δp, δv, δα]`, exactly to first order: what the slope of a dual number needs.
pub fn moved<T: Real>(x: &Kinematics<f64>, delta: [T; 9]) -> Kinematics<T> {
    let dcm = x.dcm.map(splat::<T>);
    let turn = mul(&skew([delta[6], delta[7], delta[8]]), &dcm);
    let mut turned = dcm;
    for i in 0..3 {
        for j in 0..3 {
            turned[i][j] = dcm[i][j] - turn[i][j];
        }
    }
    Kinematics {
        position: add(splat(x.position), [delta[0], delta[1], delta[2]]),
        velocity: add(splat(x.velocity), [delta[3], delta[4], delta[5]]),
        dcm: turned,
    }
}

/// A pose moved by `[δp', δα]`, both in body axes, exactly to second order.
pub fn stepped<T: Real>(pose: &PoseState<f64>, delta: [T; 6]) -> PoseState<T> {
    let q = pose.attitude.map(T::splat);
    let shift: Vec3<T> = rotate_transposed(&dcm_from_quaternion(q), [delta[0], delta[1], delta[2]]);
    let attitude = step(q, [delta[3], delta[4], delta[5]]);
    PoseState { position: add(splat(pose.position), shift), attitude }
}
