//! Pose from lines of sight as a least-squares problem: the objective, one landmark at a time or in chunks.
use crate::estimators::least_squares::{PoseObjective, PoseState};
use crate::estimators::loss::Loss;
use crate::estimators::normal_equations::{NormalEquations, NormalEquationsSink};
use crate::math::real::Real;
use crate::math::sym6::Sym6;
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Direction, Sink, Weight};
use crate::models::sensors::LineOfSight;
use crate::models::sensors::line_of_sight::direction;

/// `½ Σ ρ(eᵀWe)` over the lines of sight; `T` may be lanes, one problem each.
#[derive(Clone, Copy, Debug)]
pub struct LosObjective<'a, T, L> {
    /// The measurements.
    pub sensor: LineOfSight<'a, T>,
    /// Loss of one line of sight.
    pub loss: L,
}

impl<T: Real, L: Loss> LosObjective<'_, T, L> {
    /// The directions, linearised one by one. A zero range makes the cost NaN in its lane, which the loop reports.
    #[inline(always)]
    fn directions<'s>(&'s self, x: &'s Kinematics<T>) -> impl Iterator<Item = Direction<T>> + 's {
        let last = self.sensor.weights.len().wrapping_sub(1);
        self.sensor.landmarks.iter().zip(self.sensor.los).enumerate().map(move |(index, (landmark, los))| {
            let weight =
                self.sensor.weights.get(index.min(last)).copied().unwrap_or(Weight::Scalar(T::one()));
            direction(x, *landmark, *los, weight)
        })
    }
}

impl<T: Real, L: Loss> PoseObjective<T> for LosObjective<'_, T, L> {
    #[inline(always)]
    fn linearize(&self, pose: &PoseState<T>) -> NormalEquations<T> {
        let x = Kinematics::at_rest(pose.position, pose.attitude);
        let mut sink = NormalEquationsSink::new(&x.dcm, self.loss);
        for block in self.directions(&x) {
            sink.add_direction(&block, &x.dcm);
        }
        sink.finish()
    }

    #[inline(always)]
    fn linearize_twice(&self, pose: &PoseState<T>) -> (NormalEquations<T>, Sym6<T>) {
        let x = Kinematics::at_rest(pose.position, pose.attitude);
        let mut sink = NormalEquationsSink::new(&x.dcm, self.loss);
        let mut second_order = sink;
        for block in self.directions(&x) {
            sink.add_direction(&block, &x.dcm);
            second_order.add_second_order(&block);
        }
        let equations = sink.finish();
        let exact = equations.hessian.plus(&second_order.finish().hessian);
        (equations, exact)
    }

    #[inline(always)]
    fn total_weight(&self) -> T {
        let mut weight = T::one();
        let mut total = T::zero();
        for index in 0..self.sensor.los.len() {
            match self.sensor.weights.get(index) {
                Some(Weight::Scalar(w)) => weight = *w,
                Some(Weight::Full(s)) => {
                    weight = T::zero();
                    for row in s {
                        for entry in row {
                            weight = entry.mul_add(*entry, weight);
                        }
                    }
                }
                None => {}
            }
            total += weight;
        }
        total
    }
}

impl<L: Loss> LosObjective<'_, f64, L> {
    /// `Σ eᵀ W e`, whatever the loss.
    #[must_use]
    pub fn chi2(&self, pose: &PoseState<f64>) -> f64 {
        let x = Kinematics::at_rest(pose.position, pose.attitude);
        self.directions(&x).map(|block| block.squared_residual()).sum()
    }
}
