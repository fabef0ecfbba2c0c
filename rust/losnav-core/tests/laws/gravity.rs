//! Laws of every field of gravity: the acceleration is the gradient of the potential, the gradient that of the acceleration,
//! symmetric, and free space holds no mass.
use losnav_core::math::real::Real;
use losnav_core::models::gravity::{Gravity, PointMass, Scaled, Uniform};

use crate::dual::First;
use crate::{SAME_FORMULA, assert_close, largest};

/// Asserts them at one place outside the body.
pub fn obeys(field: &impl Gravity, r: [f64; 3]) {
    let (g, gradient) = field.acceleration_and_gradient(r);
    let alone = field.acceleration(r);
    let (pull, bend) = (largest(g), largest(gradient.into_iter().flatten()));
    for axis in 0..3 {
        let mut seeded = r.map(|x| First::along(x, 0.0));
        seeded[axis].slope = 1.0;
        assert_close(alone[axis], g[axis], pull, SAME_FORMULA);
        assert_close(field.potential(seeded).slope, g[axis], pull, SAME_FORMULA);
        let slope = field.acceleration(seeded);
        for row in 0..3 {
            assert_close(slope[row].slope, gradient[row][axis], bend, SAME_FORMULA);
            assert_close(gradient[axis][row], gradient[row][axis], bend, SAME_FORMULA);
        }
    }
    assert_close(gradient[0][0] + gradient[1][1] + gradient[2][2], 0.0, bend, SAME_FORMULA);
}

/// Some places around a body of radius one, in this unit.
pub fn places(unit: f64) -> [[f64; 3]; 4] {
    [[1.3, -0.4, 0.8], [-0.2, 2.5, -3.1], [0.0, 0.0, 1.7], [40.0, -70.0, 10.0]].map(|r| r.map(|x| x * unit))
}

#[test]
fn point_mass_and_uniform() {
    for r in places(16_000.0) {
        obeys(&PointMass { mu: 4.46e5 }, r);
        obeys(&Uniform { acceleration: [0.1, -0.2, -9.8] }, r);
        obeys(&Scaled { field: &PointMass { mu: 4.46e5 }, factor: -0.3 }, r);
    }
}

#[test]
fn single_precision_is_the_same_field() {
    let field = PointMass { mu: 4.46e5 };
    for r in places(16_000.0) {
        let (wide, narrow) = (field.acceleration(r), field.acceleration(r.map(|x| x as f32)));
        for axis in 0..3 {
            assert_close(f64::from(narrow[axis]), wide[axis], largest(wide), 4.0 * f32::EPSILON as f64);
        }
    }
    assert_eq!(field.acceleration([2.0_f64, 0.0, 0.0].map(f64::splat))[0], -4.46e5 / 4.0);
}
