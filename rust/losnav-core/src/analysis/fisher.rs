//! Fisher information of a pose, equations (38) and (40), in the order `[δp, δα]`.
use super::information::{Information, collect};
use crate::math::sym6::Sym6;
use crate::models::kinematics::Kinematics;
use crate::models::sensors::LineOfSight;

/// `Hᵀ R⁻¹ H` about `[δp, δα]`, position in reference axes, attitude in body axes.
#[must_use]
pub fn information(sensor: &LineOfSight<'_, f64>, x: &Kinematics<f64>) -> Sym6<f64> {
    let mut sink = Information(Sym6::zero());
    collect(sensor, x, &mut sink);
    sink.0
}
