//! The filter in single precision, on a small processor's unit: factors live where Joseph's form dies.
//!
//! The reference is the same source in double precision, whose factors agree with 60 digits to 1e-6 on a problem like
//! these (the statistics of the Python tests).
use losnav_core::estimators::kalman::{Covariance, Estimate, Joseph, Options, Ud, predict, update};
use losnav_core::math::real::Real;
use losnav_core::models::dynamics::{ClohessyWiltshire, DynamicsModel};
use losnav_core::models::sensors::RangeBearing;
use nalgebra::SMatrix;

type Matrix = SMatrix<f64, 6, 6>;

/// A prior of 10 km and 100 m/s, a range to a millimetre, angles to 10 microradians: variances 14 decades apart.
const VAGUE: [f64; 2] = [1e4, 1e2];
const SHARP: [f64; 2] = [1e-3, 1e-5];
const TRUTH: [f64; 6] = [-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02];
const LEVEL: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Covariances after each of `count` steps of `dt` seconds, each with a noiseless look.
fn covariances<T, P>(prior_sigma: [f64; 2], sigma: [f64; 2], dt: f64, count: usize) -> Vec<Matrix>
where
    T: Real,
    P: Covariance<T, 6>,
    ClohessyWiltshire: DynamicsModel<T, 6, State = [T; 6], Control = [T; 3]>,
{
    let model = ClohessyWiltshire { mean_motion: 1.04248275e-3, acceleration_psd: 1e-9 };
    let mut prior = [[T::zero(); 6]; 6];
    for i in 0..6 {
        prior[i][i] = T::splat(prior_sigma[i / 3].powi(2));
    }
    let mut truth = TRUTH;
    let mut estimate = Estimate { state: truth.map(T::splat), covariance: P::new(&prior) };
    let step = <ClohessyWiltshire as DynamicsModel<T, 6>>::prepare(&model, 0.0, dt);
    let exact = <ClohessyWiltshire as DynamicsModel<f64, 6>>::prepare(&model, 0.0, dt);
    let mut out = Vec::new();
    for _ in 0..count {
        truth = <ClohessyWiltshire as DynamicsModel<f64, 6>>::propagate(&model, &exact, &truth, [0.0; 3]);
        estimate = predict(&model, &step, [T::zero(); 3], &estimate);
        let seen = RangeBearing::<f64>::predict(
            &losnav_core::models::kinematics::Kinematics {
                position: [truth[0], truth[1], truth[2]],
                velocity: [0.0; 3],
                dcm: LEVEL,
            },
            [0.0; 3],
        );
        let sensor = RangeBearing {
            measurement: seen.map(T::splat),
            sigma_range: T::splat(sigma[0]),
            sigma_angle: T::splat(sigma[1]),
            target: [T::zero(); 3],
        };
        let level = LEVEL.map(|row| row.map(T::splat));
        // The state follows the truth: what is examined is the covariance, along the same linearisations.
        estimate.state = truth.map(T::splat);
        let infinite = T::splat(f64::INFINITY);
        if let Ok(updated) = update(&estimate, &sensor, &level, &Options::PLAIN, infinite, &mut []) {
            estimate.covariance = updated.estimate.covariance;
        }
        let p = estimate.covariance.matrix();
        out.push(Matrix::from_fn(|i, j| p[i][j].lane(0)));
    }
    out
}

/// Smallest eigenvalue of the correlations; negative, or NaN, where the matrix is no covariance.
fn definiteness(p: &Matrix) -> f64 {
    let d = p.diagonal().map(f64::sqrt);
    let unit = Matrix::from_fn(|i, j| p[(i, j)] / (d[i] * d[j]));
    if unit.iter().all(|v| v.is_finite()) { unit.symmetric_eigenvalues().min() } else { f64::NAN }
}

/// Largest difference in standard deviations of `exact`.
fn difference(p: &Matrix, exact: &Matrix) -> f64 {
    let d = exact.diagonal().map(f64::sqrt);
    let scaled = Matrix::from_fn(|i, j| (p[(i, j)] - exact[(i, j)]) / (d[i] * d[j]));
    scaled.abs().max()
}

#[test]
fn factors_live_in_single_precision_where_josephs_form_dies() {
    let exact = covariances::<f64, Ud<f64, 6>>(VAGUE, SHARP, 10.0, 60);
    let factors = covariances::<f32, Ud<f32, 6>>(VAGUE, SHARP, 10.0, 60);
    let joseph = covariances::<f32, Joseph<f32, 6>>(VAGUE, SHARP, 10.0, 60);
    let lost = |p: &Matrix| definiteness(p).is_nan() || definiteness(p) <= 0.0;
    println!(
        "joseph: {} of 60 no covariance, worst {:.3e}; factors: worst {:.3e}",
        joseph.iter().filter(|p| lost(p)).count(),
        joseph.iter().zip(&exact).map(|(p, e)| difference(p, e)).fold(0.0, f64::max),
        factors.iter().zip(&exact).map(|(p, e)| difference(p, e)).fold(0.0, f64::max),
    );
    assert!(joseph.iter().any(lost));
    for (p, exact) in factors.iter().zip(&exact) {
        assert!(!lost(p));
        assert!(difference(p, exact) < 0.05, "{}", difference(p, exact));
    }
}

#[test]
fn forms_agree_in_double_precision() {
    let joseph = covariances::<f64, Joseph<f64, 6>>([10.0, 0.05], [0.2, 6e-4], 60.0, 60);
    let factors = covariances::<f64, Ud<f64, 6>>([10.0, 0.05], [0.2, 6e-4], 60.0, 60);
    for (p, exact) in joseph.iter().zip(&factors) {
        assert!(difference(p, exact) < 1e-9, "{}", difference(p, exact));
    }
}

#[test]
fn a_million_updates_in_single_precision() {
    let factors = covariances::<f32, Ud<f32, 6>>([10.0, 0.05], [0.2, 6e-4], 1.0, 1_000_000);
    let exact = covariances::<f64, Ud<f64, 6>>([10.0, 0.05], [0.2, 6e-4], 1.0, 1_000_000);
    for (p, exact) in factors.iter().zip(&exact).skip(1000).step_by(997) {
        assert!(definiteness(p) > 0.0);
        assert!(difference(p, exact) < 0.05, "{}", difference(p, exact));
    }
}
