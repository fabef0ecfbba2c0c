//! Range, azimuth and elevation of a target, a camera with a laser: with `L = dcm (t − p)`, the target in body axes,
//!
//! `ρ = |L|`, `azimuth = atan2(L₂, L₁)`, `elevation = atan2(L₃, √(L₁² + L₂²))`
//!
//! (Li, Yang & Li 2008, equation 8, with `atan2` for the printed arctangent). The boresight is the body's x axis.
//! A small error `θ` of the attitude reads as azimuth `−θ_z`, elevation `+θ_y`.
//!
//! Size of the effect: 1 m across at 500 m is 2 mrad. Left out: light time, the extent of the target, the camera's
//! own errors. Undefined: at the target, and the azimuth straight along the body's z axis.
use super::target::{offset, pull_back};
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::trig::{atan2, wrap_angle};
use crate::math::vec3::{Mat3, Vec3, dot, rotate, splat};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, RootWeight, Sink};

/// One measured range, azimuth and elevation.
#[derive(Clone, Copy, Debug)]
pub struct RangeBearing<T> {
    /// Range, m, azimuth and elevation, rad.
    pub measurement: [T; 3],
    /// 1-sigma noise of the range, m.
    pub sigma_range: T,
    /// 1-sigma noise of either angle, rad.
    pub sigma_angle: T,
    /// Where the target is, reference frame, m: the origin if the state is relative to it.
    pub target: Vec3<T>,
}

/// The target in body axes, seen as range, azimuth and elevation.
struct Seen<T> {
    body: Vec3<T>,
    /// `L₁² + L₂²` and its root.
    flat2: T,
    flat: T,
    range: T,
}

impl<T: Real> Seen<T> {
    #[inline(always)]
    fn new(body: Vec3<T>) -> Self {
        let flat2 = body[0].mul_add(body[0], body[1] * body[1]);
        Self { body, flat2, flat: flat2.sqrt(), range: dot(body, body).sqrt() }
    }

    #[inline(always)]
    fn measurement(&self) -> [T; 3] {
        let [x, y, z] = self.body;
        [self.range, atan2(y, x), atan2(z, self.flat)]
    }

    /// `∂(ρ, azimuth, elevation)/∂L`.
    #[inline(always)]
    fn gradient(&self) -> Mat3<T> {
        let [x, y, z] = self.body;
        let (by_range, by_flat2) = (self.range.recip(), self.flat2.recip());
        let lift = by_range * by_range;
        let tilt = z * lift * self.flat * by_flat2;
        [
            [x * by_range, y * by_range, z * by_range],
            [-y * by_flat2, x * by_flat2, T::zero()],
            [-x * tilt, -y * tilt, self.flat * lift],
        ]
    }
}

impl<T: Real> RangeBearing<T> {
    /// Range, azimuth and elevation expected at `x`.
    #[inline(always)]
    pub fn predict(x: &Kinematics<T>, target: Vec3<T>) -> [T; 3] {
        Seen::new(rotate(&x.dcm, offset(x, target))).measurement()
    }
}

impl<T: Real> SensorModel<T> for RangeBearing<T> {
    const NAME: &'static str = "RangeBearing";

    #[inline(always)]
    fn rows(&self) -> usize {
        3
    }

    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        let seen = Seen::new(rotate(&x.dcm, offset(x, self.target)));
        if !T::zero().lt(seen.range).any() {
            return Err(ModelError::AtTarget);
        }
        if !T::zero().lt(seen.flat2).any() {
            return Err(ModelError::PolarAxis);
        }
        if !seen.range.is_finite().any() {
            return Err(ModelError::TargetTooFar);
        }
        let (predicted, gradient) = (seen.measurement(), seen.gradient());
        let mut innovation = [T::zero(); 3];
        for i in 0..3 {
            innovation[i] = self.measurement[i] - predicted[i];
        }
        innovation[1] = wrap_angle(innovation[1]);
        innovation[2] = wrap_angle(innovation[2]);
        let (mut d_position, mut d_attitude) = ([[T::zero(); 3]; 3], [[T::zero(); 3]; 3]);
        for i in 0..3 {
            (d_position[i], d_attitude[i]) = pull_back(gradient[i], seen.body, &x.dcm);
        }
        let (range, angle) = (self.sigma_range.recip(), self.sigma_angle.recip());
        sink.add(&Linearization {
            innovation,
            d_position,
            d_velocity: None,
            d_attitude: Some(d_attitude),
            sqrt_information: RootWeight::Diagonal([range, angle, angle]),
        });
        Ok(())
    }
}

impl<T: Real> Specimen<T> for RangeBearing<T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let target = [-4.0, 25.0, 3.0];
        let [range, azimuth, elevation] = RangeBearing::<f64>::predict(truth, target);
        law.examine(&RangeBearing {
            measurement: splat([range + 0.3, azimuth - 0.004, elevation + 0.007]),
            sigma_range: T::splat(0.2),
            sigma_angle: T::splat(5e-3),
            target: splat(target),
        });
    }
}
