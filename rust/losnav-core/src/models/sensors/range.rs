//! Distance to a target: `ρ = |t − p| + v`. Independent of the attitude.
//!
//! Size of the effect: one to one along the line of sight, none across it. Left out: light time, the target's extent.
use super::target::offset;
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::{Vec3, dot, scale, splat};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, RootWeight, Sink};

/// One measured distance.
#[derive(Clone, Copy, Debug)]
pub struct Range<T> {
    /// Distance, m.
    pub measurement: [T; 1],
    /// 1-sigma noise, m.
    pub sigma: T,
    /// Where the target is, reference frame, m: the origin if the state is relative to it.
    pub target: Vec3<T>,
}

impl<T: Real> SensorModel<T> for Range<T> {
    const NAME: &'static str = "Range";

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
        sink.add(&Linearization {
            innovation: [self.measurement[0] - range],
            d_position: [scale(-range.recip(), d)],
            d_velocity: None,
            d_attitude: None,
            sqrt_information: RootWeight::Diagonal([self.sigma.recip()]),
        });
        Ok(())
    }
}

impl<T: Real> Specimen<T> for Range<T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let target = [-4.0, 25.0, 3.0];
        let d = offset(truth, target);
        law.examine(&Range {
            measurement: [T::splat(dot(d, d).sqrt() + 0.3)],
            sigma: T::splat(0.2),
            target: splat(target),
        });
    }
}
