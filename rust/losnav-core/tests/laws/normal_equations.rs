//! Gradient and Hessian of the pose cost are its derivatives, by nested dual numbers through the same kernel.
use losnav_core::estimators::least_squares::{PoseObjective, PoseState};
use losnav_core::estimators::loss::{Loss, Robust, RobustKind, Squared};
use losnav_core::estimators::pose::LosObjective;
use losnav_core::math::real::Real;
use losnav_core::math::so3::{dcm_from_quaternion, mrp_from_quaternion, rotation_from_mrp_rate};
use losnav_core::math::vec3::{Mat3, splat};
use losnav_core::models::linearization::Weight;
use losnav_core::models::sensors::LineOfSight;
use losnav_core::models::sensors::line_of_sight::predict;

use crate::dual::{First, Second};
use crate::scene::{estimate, stepped, truth};
use crate::{SAME_FORMULA, assert_close, largest};

const LANDMARKS: [[f64; 3]; 4] =
    [[30.0, 2.0, -1.0], [-4.0, 25.0, 3.0], [-20.0, -15.0, 8.0], [5.0, -30.0, -6.0]];
/// Square root of a full information matrix.
const ROOT: Mat3<f64> = [[9.0, 0.0, 0.0], [2.0, 11.0, 0.0], [-3.0, 1.5, 7.0]];

/// Cost, gradient and so on of four noisy directions, one of them with a full weight, over any scalar.
fn at<T: Real, R>(loss: impl Loss, pose: &PoseState<T>, ask: impl Fn(&dyn Ask<T>, &PoseState<T>) -> R) -> R {
    let x = truth();
    let los = LANDMARKS.map(|l| {
        let (h, _) = predict(&x, l);
        splat([h[0] + 0.03, h[1] - 0.02, h[2] + 0.01])
    });
    let scalar = |w: f64| Weight::Scalar(T::splat(w));
    let weights = [scalar(100.0), Weight::Full(ROOT.map(splat)), scalar(50.0), scalar(80.0)];
    let landmarks = LANDMARKS.map(splat);
    let sensor = LineOfSight { landmarks: &landmarks, los: &los, weights: &weights };
    ask(&LosObjective { sensor, loss }, pose)
}

/// An objective whatever its loss.
trait Ask<T: Real> {
    fn cost(&self, pose: &PoseState<T>) -> T;
    fn gradient_and_hessian(&self, pose: &PoseState<T>) -> ([T; 6], [[T; 6]; 6]);
    fn mrp_gradient(&self, pose: &PoseState<T>) -> [T; 6];
}

impl<T: Real, L: Loss> Ask<T> for LosObjective<'_, T, L> {
    fn cost(&self, pose: &PoseState<T>) -> T {
        self.linearize(pose).cost
    }
    fn gradient_and_hessian(&self, pose: &PoseState<T>) -> ([T; 6], [[T; 6]; 6]) {
        let (equations, exact) = self.linearize_twice(pose);
        (equations.gradient, core::array::from_fn(|i| core::array::from_fn(|j| exact.at(i, j))))
    }
    fn mrp_gradient(&self, pose: &PoseState<T>) -> [T; 6] {
        let factor = rotation_from_mrp_rate(mrp_from_quaternion(pose.attitude));
        self.linearize(pose).change_of_variables(&dcm_from_quaternion(pose.attitude), &factor).gradient
    }
}

fn losses() -> Vec<Option<Robust>> {
    let kinds = [RobustKind::Huber, RobustKind::Cauchy, RobustKind::Tukey, RobustKind::GemanMcClure];
    // At one sigma half of the residuals are forgiven, at five all of Tukey's are still inside.
    let robust = kinds.into_iter().flat_map(|kind| [1.0, 5.0].map(|scale| Some(Robust { kind, scale })));
    core::iter::once(None).chain(robust).collect()
}

/// `f` with whichever loss.
macro_rules! with_loss {
    ($loss:expr, $pose:expr, $ask:expr) => {
        match $loss {
            None => at(Squared, $pose, $ask),
            Some(robust) => at(robust, $pose, $ask),
        }
    };
}

#[test]
fn gradient_and_hessian_are_derivatives_of_the_cost() {
    for loss in losses() {
        let pose = estimate();
        let (gradient, hessian) = with_loss!(loss, &pose, |o, p| o.gradient_and_hessian(p));
        assert!(largest(gradient) > 0.0);
        for i in 0..6 {
            for j in 0..6 {
                let mut delta = [Second::splat(0.0); 6];
                delta[i].value.slope = 1.0;
                delta[j].slope.value = 1.0;
                let cost = with_loss!(loss, &stepped(&pose, delta), |o, p| o.cost(p));
                assert_close(-gradient[i], cost.value.slope, largest(gradient), SAME_FORMULA);
                let scale = (hessian[i][i] * hessian[j][j]).abs().sqrt().max(hessian[i][j].abs());
                assert_close(hessian[i][j], cost.slope.slope, scale, 100.0 * SAME_FORMULA);
            }
        }
    }
}

#[test]
fn gradient_in_mrp_is_the_derivative_of_the_cost() {
    let pose = estimate();
    let mrp = mrp_from_quaternion(pose.attitude);
    for loss in losses() {
        let gradient = with_loss!(loss, &pose, |o, p| o.mrp_gradient(p));
        for i in 0..6 {
            let (mut p, mut s) = (pose.position.map(First::splat), mrp.map(First::splat));
            if i < 3 {
                p[i].slope = 1.0;
            } else {
                s[i - 3].slope = 1.0;
            }
            let cost = with_loss!(loss, &PoseState::from_mrp(p, s), |o, p| o.cost(p));
            assert_close(-gradient[i], cost.slope, largest(gradient), SAME_FORMULA);
        }
    }
}

/// `ρ'` and `ρ''` are the derivatives of `ρ`, and a small residual costs its square.
#[test]
fn losses_are_consistent() {
    for robust in losses().into_iter().flatten() {
        let k2 = robust.scale * robust.scale;
        for s in [0.0, 0.3 * k2, 0.99 * k2, 1.01 * k2, 30.0 * k2] {
            let twice = robust.at(Second::along(s, 1.0, 1.0));
            let value = robust.at(s);
            assert_close(twice.rho.value.slope, value.weight, 1.0, 1e-14);
            assert_close(twice.rho.slope.slope, value.curvature, 1.0 / k2, 1e-14);
        }
        assert_close(robust.at(1e-9 * k2).rho, 1e-9 * k2, 1e-9 * k2, 1e-6);
    }
}
