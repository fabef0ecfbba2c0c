//! Unit directions to known landmarks: `b_i = dcm (L_i − p)/|L_i − p| + v_i`, equations (4), (7).
//!
//! Size of the effect: a lateral shift of 1 m at 500 m turns a direction by 2 mrad. Left out: refraction, aberration,
//! light time, the landmark's own uncertainty (add it to the covariance of the direction).
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::{Vec3, dot, rotate, scale, splat, sub};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Direction, Sink, Weight};

/// Measured directions with their landmarks, in reference axes, and weights.
#[derive(Clone, Copy, Debug)]
pub struct LineOfSight<'a, T> {
    /// Landmarks, reference frame, m.
    pub landmarks: &'a [Vec3<T>],
    /// Measured unit vectors, body axes.
    pub los: &'a [Vec3<T>],
    /// Weights; the last one serves all that follow, so one entry is a common weight.
    pub weights: &'a [Weight<T>],
}

/// Predicted direction in body axes, and one over the range.
#[inline(always)]
pub fn predict<T: Real>(x: &Kinematics<T>, landmark: Vec3<T>) -> (Vec3<T>, T) {
    let d = rotate(&x.dcm, sub(landmark, x.position));
    let inverse_range = dot(d, d).rsqrt();
    (scale(inverse_range, d), inverse_range)
}

/// One direction, linearised at `x`.
#[inline(always)]
pub fn direction<T: Real>(
    x: &Kinematics<T>,
    landmark: Vec3<T>,
    los: Vec3<T>,
    weight: Weight<T>,
) -> Direction<T> {
    let (predicted, inverse_range) = predict(x, landmark);
    Direction { predicted, innovation: sub(los, predicted), inverse_range, weight }
}

impl<T: Real> SensorModel<T> for LineOfSight<'_, T> {
    const NAME: &'static str = "LineOfSight";

    #[inline(always)]
    fn rows(&self) -> usize {
        3 * self.landmarks.len().min(self.los.len())
    }

    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        let mut weight = Weight::Scalar(T::one());
        for (index, (landmark, los)) in self.landmarks.iter().zip(self.los).enumerate() {
            if let Some(w) = self.weights.get(index) {
                weight = *w;
            }
            let block = direction(x, *landmark, *los, weight);
            if !block.inverse_range.is_finite().any() {
                return Err(ModelError::ZeroRange { index });
            }
            if !T::zero().lt(block.inverse_range).any() {
                return Err(ModelError::RangeOverflow { index });
            }
            sink.add_direction(&block, &x.dcm);
        }
        Ok(())
    }
}

impl<T: Real> Specimen<T> for LineOfSight<'_, T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let landmarks = [[30.0, 2.0, -1.0], [-4.0, 25.0, 3.0], [-20.0, -15.0, 8.0]];
        let noise = [[0.01, -0.02, 0.015], [-0.005, 0.01, 0.02], [0.012, 0.003, -0.01]];
        let mut los = [[T::zero(); 3]; 3];
        for i in 0..3 {
            let (h, _) = predict(truth, landmarks[i]);
            los[i] = splat([h[0] + noise[i][0], h[1] + noise[i][1], h[2] + noise[i][2]]);
        }
        let root = [[90.0, 0.0, 0.0], [20.0, 110.0, 0.0], [-30.0, 15.0, 70.0]];
        let weights =
            [Weight::Scalar(T::splat(1e4)), Weight::Full(root.map(splat)), Weight::Scalar(T::splat(5e3))];
        law.examine(&LineOfSight { landmarks: &landmarks.map(splat), los: &los, weights: &weights });
    }
}
