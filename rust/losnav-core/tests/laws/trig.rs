//! Laws of angles: against the standard library, and their derivatives.
use core::f64::consts::{FRAC_PI_2, PI};
use losnav_core::math::trig::{atan2, sin_cos, wrap_angle};
use proptest::prelude::*;

use crate::assert_close;
use crate::dual::{First, Second};

/// Two units in the last place.
const ULPS: f64 = 2.0 * f64::EPSILON;
/// The derivative of an approximation good to 2e-17 over an interval of length one.
const SLOPE: f64 = 1e-13;

#[track_caller]
fn assert_atan2(y: f64, x: f64) {
    let expected = y.atan2(x);
    assert_close(atan2(y, x), expected, expected.abs().max(f64::MIN_POSITIVE), ULPS);
}

#[test]
fn angles_of_vectors_in_every_octant() {
    for step in 0..200_000 {
        let angle = f64::from(step - 100_000) * 1e-5 * PI;
        for size in [1.0, 3e-150, 7e120] {
            assert_atan2(size * angle.sin(), size * angle.cos());
        }
    }
}

#[test]
fn angles_on_axes_diagonals_and_next_to_them() {
    let values = [1.0, 1e-300, 0.414_213_562_373_095, 0.414_213_562_373_096, 1.0 - f64::EPSILON, 1e17];
    for a in values {
        for b in values {
            for (y, x) in [(a, b), (-a, b), (a, -b), (-a, -b)] {
                assert_atan2(y, x);
            }
        }
        assert_eq!([atan2(0.0, a), atan2(a, 0.0), atan2(0.0, -a)], [0.0, FRAC_PI_2, PI]);
        // No branch cut between the two zeros: the interval is open at −π.
        assert_eq!([atan2(-0.0, -a), atan2(-a, 0.0)], [PI, -FRAC_PI_2]);
    }
    assert!(atan2(0.0, 0.0_f64).is_nan() && atan2(f64::NAN, 1.0).is_nan() && atan2(1.0, f64::NAN).is_nan());
}

#[test]
fn single_precision_has_its_own_digits() {
    for step in 0..1000 {
        let angle = (f64::from(step) - 500.0) * 2e-3 * PI;
        let (y, x) = (angle.sin() as f32, angle.cos() as f32);
        assert!((atan2(y, x) - y.atan2(x)).abs() <= 4.0 * f32::EPSILON);
        let (s, c) = sin_cos(angle as f32);
        assert!((s - (angle as f32).sin()).abs() + (c - (angle as f32).cos()).abs() <= 4.0 * f32::EPSILON);
    }
}

#[test]
fn wrapped_angles_are_unchanged_inside_and_differ_by_turns() {
    for inside in [0.0, 1e-300, -3.0, PI, -PI.next_down(), 3.0] {
        assert_eq!(wrap_angle(inside), inside);
    }
    assert_eq!(wrap_angle(-PI), PI);
    for turns in [-1e6, -7.0, -1.0, 1.0, 2.0, 12_345.0] {
        for angle in [-3.1, -1.0, 0.1, 2.0, 3.1] {
            // The sum is rounded: half a unit in the last place of the turned angle.
            let turned = angle + turns * 2.0 * PI;
            assert_close(wrap_angle(turned), angle, turned.abs(), 2.0 * f64::EPSILON);
        }
    }
    assert!(wrap_angle(f64::NAN).is_nan());
}

#[test]
fn sine_and_cosine_over_many_turns() {
    for step in -40_000..40_000 {
        let x = f64::from(step) * 1.234_567e-3;
        for x in [x, 1e-9 * x, 1e4 * x] {
            let (s, c) = sin_cos(x);
            assert_close(s, x.sin(), 1.0, f64::EPSILON);
            assert_close(c, x.cos(), 1.0, f64::EPSILON);
        }
        // Small sines keep their relative accuracy.
        assert_close(sin_cos(1e-9 * x).0, (1e-9 * x).sin(), (1e-9 * x).abs(), ULPS);
    }
    assert_eq!(sin_cos(0.0), (0.0, 1.0));
}

proptest! {
    #[test]
    fn angles_of_any_vector(y in -1e3..1e3, x in -1e3..1e3, tilt in -12..12_i32) {
        let y: f64 = y * 10_f64.powi(tilt);
        assert_atan2(y, x);
    }

    #[test]
    fn slopes_are_those_of_the_functions(y in -10.0..10.0, x in -10.0..10.0, dy in -1.0..1.0, dx in -1.0..1.0) {
        let (square, y, x): (f64, f64, f64) = (y * y + x * x, y, x);
        prop_assume!(square > 1e-2);
        let slope = (x * dy - y * dx) / square;
        let scale: f64 = (dx * dx + dy * dy) / square;
        assert_close(atan2(First::along(y, dy), First::along(x, dx)).slope, slope, scale.sqrt(), SLOPE);
        assert_eq!(wrap_angle(First::along(x, dx)).slope, dx);
        let (s, c) = sin_cos(First::along(x, dx));
        assert_close(s.slope, x.cos() * dx, 1.0, SLOPE);
        assert_close(c.slope, -x.sin() * dx, 1.0, SLOPE);
    }

    #[test]
    fn second_slopes_too(y in 0.1..10.0, x in -10.0..10.0) {
        let (y, x): (f64, f64) = (y, x);
        let second = atan2(Second::along(y, 1.0, 0.0), Second::along(x, 0.0, 1.0)).slope.slope;
        let square = y * y + x * x;
        assert_close(second, (y * y - x * x) / (square * square), 1.0 / square, 100.0 * SLOPE);
    }
}
