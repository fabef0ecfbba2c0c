//! Pose from lines of sight as a least-squares problem: the objective, one landmark at a time or in chunks.
use crate::estimators::least_squares::{PoseObjective, PoseState};
use crate::estimators::loss::Loss;
use crate::estimators::normal_equations::{NormalEquations, NormalEquationsSink};
use crate::math::real::Real;
use crate::math::sym6::Sym6;
use crate::math::vec3::{Mat3, Vec3, add, scale};
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
    /// `Σ eᵀ W e`, whatever the loss.
    #[inline(always)]
    pub fn chi2(&self, pose: &PoseState<T>) -> T {
        let x = Kinematics::at_rest(pose.position, pose.attitude);
        let mut sum = Chi2(T::zero());
        self.each(&x, &mut sum);
        sum.0
    }

    /// Hands the directions at `x` to `take`, one by one. A zero range makes the cost NaN in its lane, which the
    /// solver reports.
    // A plain loop over a trait, not an iterator with closures: a closure left standing inside a function compiled
    // for a wider instruction set loses that set, and with it a factor of ten.
    #[inline(always)]
    fn each(&self, x: &Kinematics<T>, take: &mut impl Take<T>) {
        let mut weights = self.sensor.weights;
        let mut weight = Weight::Scalar(T::one());
        for (landmark, los) in self.sensor.landmarks.iter().zip(self.sensor.los) {
            if let [first, rest @ ..] = weights {
                weight = *first;
                weights = rest;
            }
            take.take(&direction(x, *landmark, *los, weight), &x.dcm);
        }
    }
}

/// Whatever consumes directions here.
trait Take<T: Real> {
    fn take(&mut self, block: &Direction<T>, dcm: &Mat3<T>);
}

impl<T: Real, L: Loss> Take<T> for NormalEquationsSink<'_, T, L> {
    #[inline(always)]
    fn take(&mut self, block: &Direction<T>, dcm: &Mat3<T>) {
        self.add_direction(block, dcm);
    }
}

/// Gauss–Newton's sums and, apart, what the true Hessian has beyond them.
struct Twice<'a, T, L> {
    first: NormalEquationsSink<'a, T, L>,
    second: NormalEquationsSink<'a, T, L>,
}

impl<T: Real, L: Loss> Take<T> for Twice<'_, T, L> {
    #[inline(always)]
    fn take(&mut self, block: &Direction<T>, dcm: &Mat3<T>) {
        self.first.add_direction(block, dcm);
        self.second.add_second_order(block);
    }
}

/// `Σ eᵀ W e`.
struct Chi2<T>(T);

impl<T: Real> Take<T> for Chi2<T> {
    #[inline(always)]
    fn take(&mut self, block: &Direction<T>, _: &Mat3<T>) {
        self.0 += block.squared_residual();
    }
}

impl<T: Real, L: Loss> PoseObjective<T> for LosObjective<'_, T, L> {
    #[inline(always)]
    fn linearize(&self, pose: &PoseState<T>) -> NormalEquations<T> {
        let x = Kinematics::at_rest(pose.position, pose.attitude);
        let mut sink = NormalEquationsSink::new(&x.dcm, self.loss);
        self.each(&x, &mut sink);
        sink.finish()
    }

    #[inline(always)]
    fn linearize_twice(&self, pose: &PoseState<T>) -> (NormalEquations<T>, Sym6<T>) {
        let x = Kinematics::at_rest(pose.position, pose.attitude);
        let empty = NormalEquationsSink::new(&x.dcm, self.loss);
        let mut twice = Twice { first: empty, second: empty };
        self.each(&x, &mut twice);
        let equations = twice.first.finish();
        let exact = equations.hessian.plus(&twice.second.finish().hessian);
        (equations, exact)
    }

    #[inline(always)]
    fn anchor(&self) -> Vec3<T> {
        let mut sum = [T::zero(); 3];
        let mut count = T::zero();
        for landmark in self.sensor.landmarks {
            sum = add(sum, *landmark);
            count += T::one();
        }
        scale(count.recip(), sum)
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

/// One problem whose landmarks stand in the lanes of `V`, the pose in the scalar `S`: for the latency of one solve.
/// Lanes past the last landmark repeat it with weight zero.
#[derive(Clone, Copy, Debug)]
pub struct Chunked<'a, V, L> {
    /// The landmarks, `V::LANES` to an entry.
    pub lanes: LosObjective<'a, V, L>,
}

impl<S: Real, V: Real, L: Loss> PoseObjective<S> for Chunked<'_, V, L> {
    #[inline(always)]
    fn linearize(&self, pose: &PoseState<S>) -> NormalEquations<S> {
        self.lanes.linearize(&pose.splat()).sum_lanes()
    }

    #[inline(always)]
    fn linearize_twice(&self, pose: &PoseState<S>) -> (NormalEquations<S>, Sym6<S>) {
        let (equations, exact) = self.lanes.linearize_twice(&pose.splat());
        (equations.sum_lanes(), exact.sum_lanes())
    }

    #[inline(always)]
    fn anchor(&self) -> Vec3<S> {
        let [x, y, z] = self.lanes.anchor();
        let share = S::splat(1.0 / V::LANES as f64);
        [share * S::splat(x.sum_lanes()), share * S::splat(y.sum_lanes()), share * S::splat(z.sum_lanes())]
    }

    #[inline(always)]
    fn total_weight(&self) -> S {
        S::splat(self.lanes.total_weight().sum_lanes())
    }
}
