//! Laws of inertial navigation: its errors move as `Φ` says, its noise as `Q` says, and free flight keeps its energy.
use losnav_core::math::matrix::{Matrix, congruence, mirrored};
use losnav_core::math::so3::{dcm_from_quaternion, normalized};
use losnav_core::math::vec3::{add, cross, dot, rotate_transposed};
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::dynamics::strapdown::{ImuSample, Noise, Site, Strapdown};
use losnav_core::models::gravity::{Gravity, PointMass};
use losnav_core::models::nav_state::NavState;
use losnav_core::models::state::State;

use crate::dual::First;
use crate::{SAME_FORMULA, assert_close};

/// Above a place on a body of the size of Eros that turns a hundred times as fast, so that nothing is small.
pub fn model() -> Strapdown<PointMass> {
    Strapdown {
        site: Site {
            site_from_fixed: [[0.0, 1.0, 0.0], [-0.6, 0.0, 0.8], [0.8, 0.0, 0.6]],
            center: [0.0, 0.0, 15_116.0],
            angular_velocity: [0.0, 0.0264, 0.0198],
        },
        gravity: PointMass { mu: 4.462_754_720_04e5 },
        noise: Noise {
            acceleration: 1e-8,
            angular_rate: 8e-12,
            accelerometer_bias: 1e-12,
            gyroscope_bias: 1e-16,
            deviation: 4e-3,
            time_constant: 300.0,
        },
    }
}

pub fn state() -> NavState<f64> {
    NavState {
        position: [400.0, -300.0, 2000.0],
        velocity: [-1.0, 0.7, -5.0],
        attitude: normalized([0.3, -0.2, 0.5, 0.7]),
        accelerometer_bias: [1e-3, -2e-3, 5e-4],
        gyroscope_bias: [1e-4, 2e-4, -1e-4],
        acceleration: [1e-3, 2e-3, -1e-3],
    }
}

pub const SAMPLE: ImuSample<f64> =
    ImuSample { specific_force: [0.3, -0.5, 9.0], angular_rate: [0.2, -0.1, 0.3] };

/// Numbers along which derivatives are taken.
fn seeded(x: &NavState<f64>) -> NavState<First> {
    let mut out = NavState::<First>::origin();
    for i in 0..19 {
        let value = State::<f64, 18>::number(x, i);
        State::<First, 18>::set_number(&mut out, i, First::along(value, 0.0));
    }
    out
}

/// The derivative of the step with respect to the error of its start.
fn derivative<const N: usize>(dt: f64) -> Matrix<f64, N> {
    let (model, x) = (model(), seeded(&state()));
    let constant = |v: [f64; 3]| v.map(|c| First::along(c, 0.0));
    let sample = ImuSample {
        specific_force: constant(SAMPLE.specific_force),
        angular_rate: constant(SAMPLE.angular_rate),
    };
    let step = DynamicsModel::<First, N>::prepare(&model, 0.0, dt);
    let end = DynamicsModel::<First, N>::propagate(&model, &step, &x, sample);
    let mut phi = [[0.0; N]; N];
    for column in 0..N {
        let mut delta = [First::along(0.0, 0.0); N];
        delta[column].slope = 1.0;
        let moved = DynamicsModel::<First, N>::propagate(&model, &step, &x.inject(&delta), sample);
        let error: [First; N] = moved.minus(&end);
        for row in 0..N {
            phi[row][column] = error[row].slope;
        }
    }
    phi
}

fn transition<const N: usize>() {
    let model = model();
    // An error of third order in the step: f |ω_b|² dt³/12 and the like. A thousandth of it for a tenth of the step.
    for (dt, tolerance) in [(0.1, 3e-4), (0.01, 3e-7), (-0.01, 3e-7)] {
        let step = DynamicsModel::<f64, N>::prepare(&model, 0.0, dt);
        let (end, phi): (_, Matrix<f64, N>) = model.transition(&step, &state(), SAMPLE);
        assert_eq!(end, DynamicsModel::<f64, N>::propagate(&model, &step, &state(), SAMPLE));
        let exact = derivative::<N>(dt);
        for i in 0..N {
            for j in 0..N {
                assert_close(phi[i][j], exact[i][j], 1.0, tolerance);
            }
        }
        let (other, same, _): (_, Matrix<f64, N>, _) = model.predict(&step, &state(), SAMPLE);
        assert_eq!((other, same), (end, phi));
    }
}

#[test]
fn errors_move_by_the_transition() {
    transition::<9>();
    transition::<12>();
    transition::<15>();
    transition::<18>();
}

fn zeros<const N: usize>() {
    let model = model();
    let step = DynamicsModel::<f64, N>::prepare(&model, 0.0, 0.1);
    let (_, phi, _): (_, Matrix<f64, N>, _) = model.predict(&step, &state(), SAMPLE);
    let mut p = [[0.0; N]; N];
    for i in 0..N {
        for j in i..N {
            p[i][j] = if i == j { 2.0 + i as f64 } else { ((3 * i + 7 * j) as f64).sin() };
        }
    }
    let p = mirrored(&p);
    let short = DynamicsModel::<f64, N>::carry(&model, &step, &phi, &p);
    let full = congruence(&phi, &p);
    for i in 0..N {
        for j in 0..N {
            assert_close(short[i][j], full[i][j], (full[i][i] * full[j][j]).sqrt(), SAME_FORMULA);
        }
    }
}

#[test]
fn zeros_of_the_transition_are_zeros() {
    zeros::<9>();
    zeros::<12>();
    zeros::<15>();
    zeros::<18>();
}

/// Two half steps leave the noise of one: `Q(2h) = Φ Q(h) Φᵀ + Q(h)`, but for the next order in `h`.
fn accumulation<const N: usize>() {
    let model = model();
    for (h, tolerance) in [(0.05, 2e-2), (0.005, 2e-3)] {
        let at = |x: &NavState<f64>, dt: f64| -> (NavState<f64>, Matrix<f64, N>, Matrix<f64, N>) {
            model.predict(&DynamicsModel::<f64, N>::prepare(&model, 0.0, dt), x, SAMPLE)
        };
        let (_, _, whole) = at(&state(), 2.0 * h);
        let (between, _, first) = at(&state(), h);
        let (_, phi, second) = at(&between, h);
        let carried = congruence(&phi, &first);
        for i in 0..N {
            for j in 0..N {
                let scale = (whole[i][i] * whole[j][j]).sqrt();
                assert_close(carried[i][j] + second[i][j], whole[i][j], scale, tolerance);
                assert_eq!(whole[i][j], whole[j][i]);
            }
        }
    }
}

#[test]
fn noise_accumulates() {
    accumulation::<9>();
    accumulation::<12>();
    accumulation::<15>();
    accumulation::<18>();
}

/// `½v² − U − ½|ω×(ρ + r)|²` of free flight.
#[test]
fn free_flight_keeps_the_integral_of_jacobi() {
    let mut model = model();
    model.site.angular_velocity = [0.0, 2.64e-4, 1.98e-4];
    let x = NavState { accelerometer_bias: [0.0; 3], acceleration: [0.0; 3], ..state() };
    let energy = |x: &NavState<f64>| {
        let arm = add(model.site.center, x.position);
        let swing = cross(model.site.angular_velocity, arm);
        let fixed = rotate_transposed(&model.site.site_from_fixed, arm);
        0.5 * dot(x.velocity, x.velocity) - model.gravity.potential::<f64>(fixed) - 0.5 * dot(swing, swing)
    };
    let step = DynamicsModel::<f64, 9>::prepare(&model, 0.0, 0.1);
    let free = ImuSample { specific_force: [0.0; 3], ..SAMPLE };
    let mut now = x;
    for _ in 0..20_000 {
        now = DynamicsModel::<f64, 9>::propagate(&model, &step, &now, free);
    }
    assert_close(energy(&now), energy(&x), energy(&x).abs(), 1e-12);
}

/// The state on the ground and in space, in the same place, sees the same stars.
#[test]
fn attitude_is_exact_for_constant_rates() {
    let model = model();
    let at = |dt: f64, x: &NavState<f64>| {
        let step = DynamicsModel::<f64, 9>::prepare(&model, 0.0, dt);
        DynamicsModel::<f64, 9>::propagate(&model, &step, x, SAMPLE)
    };
    let mut stepped = state();
    for _ in 0..50 {
        stepped = at(0.1, &stepped);
    }
    let (a, b) = (dcm_from_quaternion(stepped.attitude), dcm_from_quaternion(at(5.0, &state()).attitude));
    for i in 0..3 {
        for j in 0..3 {
            assert_close(a[i][j], b[i][j], 1.0, 20.0 * SAME_FORMULA);
        }
    }
}
