//! The loop itself: what it promises of a step, and that it runs in single precision.
use core::cell::RefCell;

use losnav_core::estimators::least_squares::{
    Method, Options, Parametrization, PoseObjective, PoseState, Termination, solve,
};
use losnav_core::estimators::loss::Squared;
use losnav_core::estimators::normal_equations::NormalEquations;
use losnav_core::estimators::pose::LosObjective;
use losnav_core::math::real::Real;
use losnav_core::math::sym6::{Sym6, index};
use losnav_core::math::vec3::{Vec3, splat};
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::Weight;
use losnav_core::models::sensors::LineOfSight;
use losnav_core::models::sensors::line_of_sight::predict;
use nalgebra::{Matrix3, Vector3};

use crate::assert_close;

fn options(parametrization: Parametrization, damping: f64, max_iterations: u32) -> Options {
    Options {
        method: Method::LevenbergMarquardt,
        parametrization,
        damping,
        max_iterations,
        cost_tolerance: 1e-12,
        step_tolerance: 1e-12,
    }
}

/// The same equations everywhere, at costs read from a script: lies about the cost, and writes down the trials.
struct Scripted {
    gradient: Vector3<f64>,
    hessian: Matrix3<f64>,
    costs: RefCell<Vec<f64>>,
    trials: RefCell<Vec<Vec3<f64>>>,
}

impl PoseObjective<f64> for Scripted {
    fn linearize(&self, pose: &PoseState<f64>) -> NormalEquations<f64> {
        self.trials.borrow_mut().push(pose.position);
        let mut hessian = Sym6::zero();
        for i in 0..3 {
            hessian.0[index(i + 3, i + 3)] = 1.0;
            for j in i..3 {
                hessian.0[index(i, j)] = self.hessian[(i, j)];
            }
        }
        let g = self.gradient;
        let cost = self.costs.borrow_mut().pop().unwrap();
        NormalEquations { cost, gradient: [g[0], g[1], g[2], 0.0, 0.0, 0.0], hessian }
    }
    fn linearize_twice(&self, pose: &PoseState<f64>) -> (NormalEquations<f64>, Sym6<f64>) {
        self.costs.borrow_mut().push(0.0);
        let equations = self.linearize(pose);
        (equations, equations.hessian)
    }
    fn anchor(&self) -> Vec3<f64> {
        [0.0; 3]
    }
    fn total_weight(&self) -> f64 {
        1.0
    }
}

/// Damping after a first step whose true decrease is `gain` times what the quadratic model promises of it.
fn damping_after(gain: f64, damping: f64) -> f64 {
    let hessian = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
    let gradient = Vector3::new(1.0, -2.0, 0.5);
    let scaled = Matrix3::from_diagonal(&hessian.diagonal());
    let step = |lambda: f64| (hessian + lambda * scaled).cholesky().unwrap().solve(&gradient);
    // m(0) − m(δ), the definition; the kernel uses ½ δᵀ(g + λ D δ).
    let first = step(damping);
    let promised = gradient.dot(&first) - 0.5 * first.dot(&(hessian * first));
    let costs = RefCell::new(vec![0.0, 100.0 - gain * promised, 100.0]);
    let objective = Scripted { gradient, hessian, costs, trials: RefCell::default() };
    let start = PoseState { position: [0.0; 3], attitude: [0.0, 0.0, 0.0, 1.0] };
    solve(&objective, &start, &options(Parametrization::Rotation, damping, 2));
    let trials = objective.trials.borrow();
    assert_eq!(trials.len(), 4, "start, two trials, the end");
    for i in 0..3 {
        assert_close(trials[1][i], first[i], 1.0, 1e-14);
    }
    let from = if gain > 1e-4 { Vector3::from(trials[1]) } else { Vector3::zeros() };
    let second = Vector3::from(trials[2]) - from;
    // δᵀ(H + λD)δ = gᵀδ gives λ back.
    (gradient.dot(&second) - second.dot(&(hessian * second))) / second.dot(&(scaled * second))
}

/// The thresholds of the gain ratio are met to a thousandth, so the prediction is right to a thousandth, whatever
/// the damping; a formula with `−λ` or without `λ` fails at once.
#[test]
fn prediction_is_the_models_decrease() {
    for damping in [0.1, 1.0, 10.0] {
        assert_close(damping_after(0.749, damping), damping, damping, 1e-9);
        assert_close(damping_after(0.751, damping), 0.1 * damping, damping, 1e-9);
        assert_close(damping_after(0.251, damping), damping, damping, 1e-9);
        assert_close(damping_after(0.249, damping), 10.0 * damping, damping, 1e-9);
        assert_close(damping_after(-0.5, damping), 10.0 * damping, damping, 1e-9);
    }
}

/// Noise-free directions from a pose, solved from a start 10 m and 5° off.
fn solved<T: Real<Mask = bool>>(parametrization: Parametrization) -> (bool, Termination, Vec3<f64>) {
    let landmarks =
        [[32.5, 0.0, 0.0], [0.0, 30.0, 0.0], [-31.5, 0.0, 0.0], [0.0, -30.5, 0.0], [9.0, 7.0, 12.0]];
    let x = PoseState::from_mrp([-10.0, 20.0, 90.0], [0.09, -0.04, 0.03]);
    let observer = Kinematics::at_rest(x.position, x.attitude);
    let los = landmarks.map(|l| splat::<T>(predict(&observer, l).0));
    let landmarks = landmarks.map(splat::<T>);
    let sensor = LineOfSight { landmarks: &landmarks, los: &los, weights: &[Weight::Scalar(T::splat(1e6))] };
    let guess = PoseState::from_mrp(splat([-4.0, 14.0, 95.0]), splat([0.08, -0.03, 0.05]));
    let objective = LosObjective { sensor, loss: Squared };
    let outcome = solve(&objective, &guess, &options(parametrization, 1e-3, 50));
    let p = outcome.pose.position;
    let error = [p[0].lane(0) + 10.0, p[1].lane(0) - 20.0, p[2].lane(0) - 90.0];
    (outcome.converged, Termination::from_code(outcome.termination.lane(0)), error)
}

#[test]
fn the_kernel_runs_in_both_precisions() {
    for parametrization in [Parametrization::Rotation, Parametrization::Mrp] {
        for (bound, (converged, termination, error)) in
            // A unit in the last place of a direction is 1e-5 m here; the weak direction holds ten times less.
            [(1e-10, solved::<f64>(parametrization)), (1e-3, solved::<f32>(parametrization))]
        {
            assert!(converged, "{termination:?}");
            assert!(matches!(termination, Termination::Gradient | Termination::Step | Termination::Cost));
            assert!(crate::largest(error) < bound, "{error:?}");
        }
    }
}
