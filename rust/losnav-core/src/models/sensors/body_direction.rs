//! Unit vector from the observer to a planet or asteroid whose path is given: `b = dcm u + v`, `u` as it is seen.
//!
//! Size of the effect: a planet at 1 AU shifts by 5e-6 rad for 750 km across. Its light time moves it by as much as 1e-4 rad,
//! aberration by 1e-4 rad more: both belong in the model unless the measurement has been corrected, see
//! [`apparent`](crate::models::apparent), also for what is left out.
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::Real;
use crate::math::vec3::{Vec3, splat};
use crate::models::apparent::{Body, Corrections, hand_over, seen};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::Sink;

/// One measured direction to a body.
#[derive(Clone, Copy, Debug)]
pub struct BodyDirection<T> {
    /// Measured unit vector, body axes.
    pub los: Vec3<T>,
    /// 1-sigma noise, rad per axis.
    pub sigma: T,
    /// The body at the time of the measurement.
    pub body: Body<T>,
    /// What the measured direction contains.
    pub corrections: Corrections,
}

impl<T: Real> SensorModel<T> for BodyDirection<T> {
    const NAME: &'static str = "BodyDirection";

    #[inline(always)]
    fn rows(&self) -> usize {
        3
    }

    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        let seen = seen(x.position, x.velocity, &self.body, self.corrections);
        hand_over(&seen, &x.dcm, self.los, self.sigma, sink)
    }
}

impl<T: Real> Specimen<T> for BodyDirection<T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let body = Body {
            position: [9.0e3, 5.0e3, -4.0e3],
            velocity: [3.0e5, -2.0e5, 1.0e5],
            acceleration: [1.0e6, 2.0e6, 0.0],
        };
        for (light_time, aberration) in [(false, false), (true, false), (true, true)] {
            let corrections = Corrections { light_time, aberration };
            let [x, y, z] = seen(truth.position, truth.velocity, &body, corrections).direction;
            let Body { position, velocity, acceleration } = body;
            law.examine(&BodyDirection {
                los: splat([x + 0.01, y - 0.02, z + 0.015]),
                sigma: T::splat(0.01),
                body: Body {
                    position: splat(position),
                    velocity: splat(velocity),
                    acceleration: splat(acceleration),
                },
                corrections,
            });
        }
    }
}
