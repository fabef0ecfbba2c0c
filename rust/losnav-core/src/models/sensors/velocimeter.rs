//! Velocity along beams fixed to the body, a Doppler lidar or radar: `y_i = b_i · dcm v + n`; along the body's own axes it
//! is the velocity in body axes.
//!
//! Size of the effect: one to one with the velocity; a small turn `α` adds `b_i · (dcm v × α)`, 9 mm/s for a milliradian at
//! 9 m/s. Left out: the lever arm (`ω × l` for a sensor off the origin), scale factor and misalignment of the beams.
use super::{Law, SensorModel, Specimen};
use crate::error::ModelError;
use crate::math::real::Real;
use crate::math::vec3::{Vec3, cross, dot, rotate, rotate_transposed, splat};
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, RootWeight, Sink};

/// Measured velocities along beams.
#[derive(Clone, Copy, Debug)]
pub struct Velocimeter<'a, T> {
    /// Unit vectors, body axes.
    pub beams: &'a [Vec3<T>],
    /// Velocity along each, m/s.
    pub measurement: &'a [T],
    /// 1-sigma noise, m/s; the last one serves all that follow.
    pub sigmas: &'a [T],
}

impl<T: Real> Velocimeter<'_, T> {
    /// `M` beams from `first` on, as one block.
    #[inline(always)]
    fn block<const M: usize>(&self, x: &Kinematics<T>, first: usize) -> Linearization<T, M> {
        let body = rotate(&x.dcm, x.velocity);
        let (zero, unit) = ([T::zero(); M], T::one());
        let (mut innovation, mut weights) = (zero, zero);
        let (mut d_velocity, mut d_attitude) = ([[T::zero(); 3]; M], [[T::zero(); 3]; M]);
        for m in 0..M {
            let (beam, z) = (self.beams[first + m], self.measurement[first + m]);
            innovation[m] = z - dot(beam, body);
            d_velocity[m] = rotate_transposed(&x.dcm, beam);
            d_attitude[m] = cross(beam, body);
            weights[m] = self.sigmas.get(first + m).or(self.sigmas.last()).map_or(unit, |s| s.recip());
        }
        Linearization {
            innovation,
            d_position: [[T::zero(); 3]; M],
            d_velocity: Some(d_velocity),
            d_attitude: Some(d_attitude),
            sqrt_information: RootWeight::Diagonal(weights),
        }
    }
}

impl<T: Real> SensorModel<T> for Velocimeter<'_, T> {
    const NAME: &'static str = "Velocimeter";

    #[inline(always)]
    fn rows(&self) -> usize {
        self.beams.len().min(self.measurement.len())
    }

    /// Three beams are one block, any other number one by one.
    #[inline(always)]
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError> {
        let rows = self.rows();
        if rows == 3 {
            sink.add(&self.block::<3>(x, 0));
            return Ok(());
        }
        for first in 0..rows {
            sink.add(&self.block::<1>(x, first));
        }
        Ok(())
    }
}

impl<T: Real> Specimen<T> for Velocimeter<'_, T> {
    fn show(truth: &Kinematics<f64>, law: &mut impl Law<T>) {
        let beams = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.0, -0.28, 0.96]];
        let body = rotate(&truth.dcm, truth.velocity);
        let noise = [0.01, -0.02, 0.005, 0.015, -0.01];
        let mut measurement = [T::zero(); 5];
        for i in 0..5 {
            measurement[i] = T::splat(dot(beams[i], body) + noise[i]);
        }
        let (beams, sigmas) = (beams.map(splat), [T::splat(0.01), T::splat(0.02)]);
        // Three as one block, and five of them.
        law.examine(&Velocimeter {
            beams: &beams[..3],
            measurement: &measurement[..3],
            sigmas: &sigmas[..1],
        });
        law.examine(&Velocimeter { beams: &beams, measurement: &measurement, sigmas: &sigmas });
    }
}
