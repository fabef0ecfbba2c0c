//! Fisher information of a pose, equations (38) and (40), in the order `[δp, δα]`.
use crate::estimators::loss::Squared;
use crate::estimators::normal_equations::NormalEquationsSink;
use crate::math::sym6::Sym6;
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Sink, Weight};
use crate::models::sensors::LineOfSight;
use crate::models::sensors::line_of_sight::direction;

/// `Hᵀ R⁻¹ H` about `[δp, δα]`, position in reference axes, attitude in body axes.
#[must_use]
pub fn information(sensor: &LineOfSight<'_, f64>, x: &Kinematics<f64>) -> Sym6<f64> {
    let mut sink = NormalEquationsSink::new(&x.dcm, Squared);
    let mut weight = Weight::Scalar(1.0);
    for (index, (landmark, los)) in sensor.landmarks.iter().zip(sensor.los).enumerate() {
        weight = sensor.weights.get(index).copied().unwrap_or(weight);
        sink.add_direction(&direction(x, *landmark, *los, weight), &x.dcm);
    }
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    sink.finish().change_of_variables(&x.dcm, &identity).hessian
}
