//! Directions as seen: derivatives at any speed, aberration undone, light time that fits the range.
use losnav_core::math::real::Real;
use losnav_core::math::vec3::{Vec3, dot, scale, splat, sub};
use losnav_core::models::apparent::{Body, Corrections, SPEED_OF_LIGHT, Seen, aberrate, seen};

use crate::dual::First;
use crate::{SAME_FORMULA, assert_close, largest};

const POSITION: [f64; 3] = [1.2e11, -0.4e11, 0.3e11];
/// Half the speed of light: all terms count.
const FAST: [f64; 3] = [1.0e8, -0.8e8, 0.7e8];

fn body() -> Body<f64> {
    Body {
        position: [-0.9e11, 0.5e11, 1.1e11],
        velocity: [-2.0e5, 1.5e5, 0.9e5],
        acceleration: [-30.0, 20.0, 15.0],
    }
}

fn told<T: Real>(position: Vec3<T>, velocity: Vec3<T>, corrections: Corrections) -> Seen<T> {
    let Body { position: p, velocity: v, acceleration: a } = body();
    seen(
        position,
        velocity,
        &Body { position: splat(p), velocity: splat(v), acceleration: splat(a) },
        corrections,
    )
}

#[test]
fn derivatives_are_those_of_the_direction() {
    for (light_time, aberration) in [(false, false), (true, false), (false, true), (true, true)] {
        let corrections = Corrections { light_time, aberration };
        let plain = told(POSITION, FAST, corrections);
        for column in 0..6 {
            let (mut p, mut v) = (splat::<First>(POSITION), splat::<First>(FAST));
            if column < 3 {
                p[column].slope = 1.0;
            } else {
                v[column - 3].slope = 1.0;
            }
            let slopes = told(p, v, corrections).direction;
            let zero = [[0.0; 3]; 3];
            let columns = if column < 3 { plain.d_position } else { plain.d_velocity.unwrap_or(zero) };
            let size = largest(slopes.iter().map(|s| s.slope)).max(1e-30);
            for row in 0..3 {
                assert_close(columns[row][column % 3], slopes[row].slope, size, SAME_FORMULA);
            }
        }
    }
}

#[test]
fn a_moving_observer_sees_unit_vectors_turned_towards_its_velocity() {
    let u = scale(1.0 / 3.0, [1.0, 2.0, -2.0]);
    let (there, _, _) = aberrate(u, FAST);
    assert_close(dot(there, there), 1.0, 1.0, SAME_FORMULA);
    assert!(dot(there, FAST) > dot(u, FAST));
    // Who moves the other way in that frame sees it where it was.
    let (back, _, _) = aberrate(there, scale(-1.0, FAST));
    for i in 0..3 {
        assert_close(back[i], u[i], 1.0, SAME_FORMULA);
    }
    // To first order by v across the line of sight over c.
    let slow = [1.0e4, -2.0e4, 2.5e4];
    let (shifted, _, _) = aberrate(u, slow);
    let across = sub(slow, scale(dot(slow, u), u));
    for i in 0..3 {
        assert_close(shifted[i] - u[i], across[i] / SPEED_OF_LIGHT, 1.0, 2e-8);
    }
}

#[test]
fn light_arrives_from_where_the_body_was() {
    let light = told(POSITION, FAST, Corrections { light_time: true, aberration: false });
    let delay = light.range / SPEED_OF_LIGHT;
    let Body { position, velocity, acceleration } = body();
    for i in 0..3 {
        let was = position[i] - delay * velocity[i] + 0.5 * delay * delay * acceleration[i];
        assert_close(POSITION[i] + light.range * light.direction[i], was, 1e11, SAME_FORMULA);
    }
}
