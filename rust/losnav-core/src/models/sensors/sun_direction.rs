//! Unit vector from the observer to the Sun at the origin of a heliocentric state: `b = dcm (−r/|r|) + v`.
//!
//! Size of the effect: at 2e8 km a shift of 1e4 km across the line of sight turns it by 5e-5 rad. The distance shows only
//! through the motion (rank 6 from the third derivative on). With `aberration` the direction is the one a moving observer
//! sees, turned by `v_⊥/c`, 1e-4 rad: see [`apparent`](crate::models::apparent), also for what is left out. The Sun stands
//! still in the frame of the state, so its light time is no matter.
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::Real;
use crate::math::vec3::{Vec3, dot, rotate, scale, splat};
use crate::models::apparent::{Body, Corrections, hand_over, hand_over_alone, seen};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::Sink;

/// One measured direction to the Sun.
#[derive(Clone, Copy, Debug)]
pub struct SunDirection<T> {
    /// Measured unit vector, body axes.
    pub los: Vec3<T>,
    /// 1-sigma noise, rad per axis.
    pub sigma: T,
    /// Does the observer's velocity turn the measured direction?
    pub aberration: bool,
}

impl<T: Real> SunDirection<T> {
    const fn corrections(&self) -> Corrections {
        Corrections { light_time: false, aberration: self.aberration }
    }
}

impl<T: Real> SensorModel<T> for SunDirection<T> {
    const NAME: &'static str = "SunDirection";

    #[inline(always)]
    fn rows(&self) -> usize {
        3
    }

    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        if !sink.wants_derivatives() && !self.aberration {
            let line = scale(-T::one(), x.position);
            let range = dot(line, line).sqrt();
            let predicted = rotate(&x.dcm, scale(range.recip(), line));
            return hand_over_alone(predicted, range, self.los, sink);
        }
        let seen = seen(x.position, x.velocity, &Body::origin(), self.corrections());
        hand_over(&seen, &x.dcm, self.los, self.sigma, sink)
    }
}

impl<T: Real> Specimen<T> for SunDirection<T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        for aberration in [false, true] {
            let [x, y, z] = truth.position;
            let range = num_traits::Float::sqrt(x * x + y * y + z * z);
            let los = splat([0.01 - x / range, -0.02 - y / range, 0.015 - z / range]);
            law.examine(&SunDirection { los, sigma: T::splat(0.01), aberration });
        }
    }
}
