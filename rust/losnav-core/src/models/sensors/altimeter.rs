//! Height above the plane `z = 0` of the reference frame, for a landing the horizon of the site: along the vertical,
//! `h = r_z + n`, or, of a beam `b` fixed to the body, along it, `ρ = −r_z/d_z + n` with `d = dcmᵀ b`.
//!
//! Size of the effect: one to one with the height; a beam 3° off the vertical reads 0.14 % more. Left out: relief, and
//! the curvature of the body, `s²/2R` at the distance `s` from the site. Undefined for a beam: below the plane, and where it
//! does not point down.
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::{Vec3, cross, dot, scale, splat};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, RootWeight, Sink};

/// One measured height.
#[derive(Clone, Copy, Debug)]
pub struct Altimeter<T> {
    /// Height, or distance along the beam, m.
    pub measurement: [T; 1],
    /// 1-sigma noise, m.
    pub sigma: T,
    /// Unit vector of the beam, body axes; none measures along the vertical.
    pub boresight: Option<Vec3<T>>,
}

impl<T: Real> SensorModel<T> for Altimeter<T> {
    const NAME: &'static str = "Altimeter";

    #[inline(always)]
    fn rows(&self) -> usize {
        1
    }

    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        let (o, height) = (T::zero(), x.position[2]);
        let sqrt_information = RootWeight::Diagonal([self.sigma.recip()]);
        let Some(boresight) = &self.boresight else {
            sink.add(&Linearization {
                innovation: [self.measurement[0] - height],
                d_position: [[o, o, T::one()]],
                d_velocity: None,
                d_attitude: None,
                sqrt_information,
            });
            return Ok(());
        };
        // The vertical in body axes, so that d_z = b · up.
        let up = [x.dcm[0][2], x.dcm[1][2], x.dcm[2][2]];
        let down = -dot(*boresight, up);
        let meets = o.lt(down).and(o.le(height));
        if !meets.any() {
            return Err(ModelError::BeamMissesGround);
        }
        let per_height = T::select(meets, down.recip(), T::splat(f64::NAN));
        let range = height * per_height;
        sink.add(&Linearization {
            innovation: [self.measurement[0] - range],
            d_position: [[o, o, per_height]],
            d_velocity: None,
            // ∂d_z/∂α = b × up.
            d_attitude: Some([scale(range * per_height, cross(*boresight, up))]),
            sqrt_information,
        });
        Ok(())
    }
}

impl<T: Real> Specimen<T> for Altimeter<T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let height = truth.position[2];
        law.examine(&Altimeter {
            measurement: [T::splat(height + 0.3)],
            sigma: T::splat(0.2),
            boresight: None,
        });
        // Down if the observer is above the plane; the law's observer is near the truth.
        let down: Vec3<f64> = core::array::from_fn(|i| -truth.dcm[i][2]);
        law.examine(&Altimeter {
            measurement: [T::splat(height + 0.3)],
            sigma: T::splat(0.2),
            boresight: Some(splat(down)),
        });
    }
}
