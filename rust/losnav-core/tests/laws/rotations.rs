//! Laws of rotations: the maps agree, Exp and Log are inverse on both sides of their switches, half turns included.
use core::f64::consts::PI;

use losnav_core::math::real::Real;
use losnav_core::math::rotation::{
    canonical, exp, log, mrp_inside, mrp_shadow, quaternion_from_dcm, rotation_error,
};
use losnav_core::math::so3::{
    dcm_from_quaternion, mrp_from_quaternion, mrp_rate_from_rotation, quaternion_from_mrp,
    quaternion_product, rotation_from_mrp_rate, step,
};
use losnav_core::math::vec3::{Mat3, Vec3, mul, scale, skew, transpose};
use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;

use crate::assert_close;
use crate::dual::First;

/// A product of a few maps, each good to some units in the last place.
const ROUND_TRIP: f64 = 4e-15;

#[track_caller]
fn assert_same<const N: usize>(a: [f64; N], b: [f64; N], tolerance: f64) {
    for i in 0..N {
        assert_close(a[i], b[i], 1.0, tolerance);
    }
}

fn axes() -> [Vec3<f64>; 5] {
    let unit = |v: Vec3<f64>| scale(1.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt(), v);
    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], unit([0.0, 1.0, -1.0]), unit([1.0, -2.0, 3.0]), unit([-0.9, 0.1, 0.2])]
}

/// Angles on both sides of every switch: the series of Exp (1e-2) and of Log (2e-4), and about a half turn.
const ANGLES: [f64; 16] = [
    0.0,
    1e-200,
    1e-12,
    1e-5,
    1.999e-4,
    2.001e-4,
    9.99e-3,
    1.001e-2,
    0.5,
    1.0,
    2.0,
    2.5,
    3.0,
    PI - 1e-6,
    PI - 1e-10,
    PI,
];

#[test]
fn exp_and_log_are_inverse() {
    for axis in axes() {
        for angle in ANGLES {
            let rotation = scale(angle, axis);
            let back = log(exp(rotation));
            // At a half turn both signs are right.
            let sign = if angle > PI - 1e-9
                && back[0] * rotation[0] + back[1] * rotation[1] + back[2] * rotation[2] < 0.0
            {
                -1.0
            } else {
                1.0
            };
            for i in 0..3 {
                assert_close(sign * back[i], rotation[i], angle, ROUND_TRIP);
            }
        }
    }
}

#[test]
fn exp_is_the_rotation_nalgebra_makes() {
    for axis in axes() {
        for angle in ANGLES {
            let expected = Rotation3::new(Vector3::from(axis) * angle).into_inner().transpose();
            let dcm = dcm_from_quaternion(exp(scale(angle, axis)));
            for i in 0..3 {
                for j in 0..3 {
                    assert_close(dcm[i][j], expected[(i, j)], 1.0, ROUND_TRIP);
                }
            }
        }
    }
}

/// `dcm_true = Exp(−[δα×]) dcm_estimate`, tiny errors to full relative accuracy of the matrices' difference.
#[test]
fn rotation_error_is_the_logarithm() {
    let estimate = dcm_from_quaternion(quaternion_from_mrp([0.3, -0.2, 0.4]));
    for axis in axes() {
        for angle in ANGLES {
            let rotation = scale(angle, axis);
            let truth = mul(&dcm_from_quaternion(exp(rotation)), &estimate);
            let error = rotation_error(&truth, &estimate);
            if angle > PI - 1e-3 {
                let along = error[0] * axis[0] + error[1] * axis[1] + error[2] * axis[2];
                assert_close(along.abs(), angle, 1.0, 1e-14);
            } else {
                assert_same(error, rotation, ROUND_TRIP);
            }
        }
    }
    assert_eq!(rotation_error(&estimate, &estimate), [0.0; 3]);
    // About the identity nothing rounds: thirteen digits of an error of 1e-12.
    let tiny = [1e-12, -2e-12, 3e-12];
    let identity = dcm_from_quaternion([0.0, 0.0, 0.0, 1.0]);
    let error = rotation_error(&dcm_from_quaternion(exp(tiny)), &identity);
    assert_same(scale(1e12, error), [1.0, -2.0, 3.0], 1e-13);
}

#[test]
fn half_turns_have_one_sign() {
    for axis in axes() {
        let q = [axis[0], axis[1], axis[2], 0.0];
        let dcm = dcm_from_quaternion(q);
        assert_eq!(canonical(q), canonical(q.map(|c| -c)));
        assert_same(quaternion_from_dcm(&dcm), canonical(q), 1e-15);
    }
}

/// `d dcm/dσ` through the generic map is what the chain factor says: `δα = M dσ`.
#[test]
fn chain_factor_is_the_derivative() {
    for mrp in [[0.0; 3], [0.1, -0.2, 0.3], [0.6, 0.5, -0.6], [2.0, -1.0, 0.5]] {
        let m = rotation_from_mrp_rate(mrp);
        let dcm = dcm_from_quaternion(quaternion_from_mrp(mrp));
        for column in 0..3 {
            let mut seeded = mrp.map(First::splat);
            seeded[column].slope = 1.0;
            let slope = dcm_from_quaternion(quaternion_from_mrp(seeded)).map(|row| row.map(|c| c.slope));
            // d dcm = −[δα×] dcm
            let rate: Mat3<f64> = mul(&slope, &transpose(&dcm));
            let expected = skew([m[0][column], m[1][column], m[2][column]]);
            for i in 0..3 {
                assert_same(rate[i], expected[i].map(|c| -c), 1e-14);
            }
        }
        let product = mul(&m, &mrp_rate_from_rotation(mrp));
        for i in 0..3 {
            for j in 0..3 {
                assert_close(product[i][j], if i == j { 1.0 } else { 0.0 }, 1.0, 1e-14);
            }
        }
    }
}

/// The Cayley step is Exp to third order.
#[test]
fn cayley_step_is_exp_to_third_order() {
    let q = quaternion_from_mrp([0.3, -0.2, 0.4]);
    for size in [1e-1, 1e-2, 1e-3] {
        let delta = scale(size, axes()[3]);
        let (cayley, exact) = (step(q, delta), quaternion_product(q, exp(delta)));
        let off = (0..4).map(|i| (cayley[i] - exact[i]).abs()).fold(0.0, f64::max);
        assert!(off <= size * size * size / 12.0);
        assert!(size < 1e-2 || off >= size * size * size / 100.0, "the bound is no accident");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn maps_agree(entries in prop::array::uniform4(-1.0..1.0_f64), other in prop::array::uniform4(-1.0..1.0_f64)) {
        let norm = |q: [f64; 4]| q.iter().map(|c| c * c).sum::<f64>().sqrt();
        prop_assume!(norm(entries) > 0.1 && norm(other) > 0.1);
        let (p, q) = (entries.map(|c| c / norm(entries)), other.map(|c| c / norm(other)));
        let (a, b) = (dcm_from_quaternion(p), dcm_from_quaternion(q));
        let matrix = Matrix3::from_fn(|i, j| a[i][j]);
        prop_assert!((matrix * matrix.transpose() - Matrix3::identity()).amax() < ROUND_TRIP);
        prop_assert!((matrix.determinant() - 1.0).abs() < ROUND_TRIP);
        // rotation_matrix = dcmᵀ, so the dcm of a product is the product turned round.
        let product = mul(&b, &a);
        let composed = dcm_from_quaternion(quaternion_product(p, q));
        for i in 0..3 {
            assert_same(composed[i], product[i], ROUND_TRIP);
        }
        assert_same(quaternion_from_dcm(&a), canonical(p), ROUND_TRIP);
        let mrp = mrp_from_quaternion(p);
        prop_assert!(mrp.iter().map(|c| c * c).sum::<f64>() <= 1.0 + 1e-15);
        assert_same(canonical(quaternion_from_mrp(mrp)), canonical(p), ROUND_TRIP);
        let shadow = mrp_shadow(mrp);
        assert_same(mrp_inside(shadow), mrp, ROUND_TRIP);
        assert_same(canonical(quaternion_from_mrp(shadow)), canonical(p), ROUND_TRIP);
    }

    #[test]
    fn shadows_survive_every_size(entries in prop::array::uniform3(-1.0..1.0_f64), exponent in -300..300_i32) {
        prop_assume!(entries.iter().any(|c| c.abs() > 0.1));
        let mrp = entries.map(|c| c * 10.0_f64.powi(exponent));
        let back = mrp_shadow(mrp_shadow(mrp));
        let size = mrp.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
        for i in 0..3 {
            assert_close(back[i], mrp[i], size, ROUND_TRIP);
        }
    }
}
