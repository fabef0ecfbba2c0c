//! Rate of the distance to a target at rest in the state's frame, Doppler: `ρ̇ = u · v + noise`, `u = (p − t)/ρ` from the
//! target to the observer. Positive when they part; independent of the attitude, and of the rotation of the frame.
//!
//! Size of the effect: one to one with the velocity along the line of sight; an error `δ` of position across it adds
//! `v_⊥ δ/ρ`. Left out: light time, relativity, the clock.
use super::target::offset;
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::{Vec3, dot, scale, scale_add, splat};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, RootWeight, Sink};

/// One measured range rate.
#[derive(Clone, Copy, Debug)]
pub struct RangeRate<T> {
    /// Rate of the distance, m/s.
    pub measurement: [T; 1],
    /// 1-sigma noise, m/s.
    pub sigma: T,
    /// Where the target is, reference frame, m: the origin if the state is relative to it.
    pub target: Vec3<T>,
}

impl<T: Real> SensorModel<T> for RangeRate<T> {
    const NAME: &'static str = "RangeRate";

    #[inline(always)]
    fn rows(&self) -> usize {
        1
    }

    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        let d = offset(x, self.target);
        let range = dot(d, d).sqrt();
        if !T::zero().lt(range).any() {
            return Err(ModelError::AtTarget);
        }
        if !range.is_finite().any() {
            return Err(ModelError::TargetTooFar);
        }
        let inverse = range.recip();
        let away = scale(-inverse, d);
        let rate = dot(away, x.velocity);
        sink.add(&Linearization {
            innovation: [self.measurement[0] - rate],
            // (v − ρ̇ u)/ρ: the velocity across the line of sight.
            d_position: [scale(inverse, scale_add(-rate, away, x.velocity))],
            d_velocity: Some([away]),
            d_attitude: None,
            sqrt_information: RootWeight::Diagonal([self.sigma.recip()]),
        });
        Ok(())
    }
}

impl<T: Real> Specimen<T> for RangeRate<T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let target = [-4.0, 25.0, 3.0];
        let d = offset(truth, target);
        let rate = -dot(d, truth.velocity) / dot(d, d).sqrt();
        law.examine(&RangeRate {
            measurement: [T::splat(rate + 0.02)],
            sigma: T::splat(0.05),
            target: splat(target),
        });
    }
}
