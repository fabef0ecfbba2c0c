//! Two sinks for what measurements tell about `[δp, δα]`: the information matrix, and its square root.
use crate::math::sym6::{Sym6, index};
use crate::math::triangular6::Triangular6;
use crate::models::kinematics::Kinematics;
use crate::models::linearization::{Linearization, Sink, Weight};
use crate::models::sensors::LineOfSight;
use crate::models::sensors::line_of_sight::direction;

/// `HᵀWH`, position in reference axes, attitude in body axes.
#[derive(Clone, Copy, Debug)]
pub struct Information(pub Sym6<f64>);

/// `R` with `RᵀR = HᵀWH`: half the digits are not lost where rank is the question.
#[derive(Clone, Copy, Debug)]
pub struct RootInformation(pub Triangular6);

/// Row `m` of `S H`, columns `[p, α]`.
fn whitened<const M: usize>(rows: &Linearization<f64, M>, m: usize) -> [f64; 6] {
    let row = rows.whitened(m);
    let ([a, b, c], [d, e, f]) = (row.d_position, row.d_attitude);
    [a, b, c, d, e, f]
}

impl Sink<f64> for Information {
    fn add<const M: usize>(&mut self, rows: &Linearization<f64, M>) {
        for m in 0..M {
            let row = whitened(rows, m);
            for i in 0..6 {
                for j in i..6 {
                    self.0.0[index(i, j)] += row[i] * row[j];
                }
            }
        }
    }
}

impl Sink<f64> for RootInformation {
    fn add<const M: usize>(&mut self, rows: &Linearization<f64, M>) {
        for m in 0..M {
            self.0.absorb(whitened(rows, m));
        }
    }
}

/// Hands every direction to the sink. A zero range makes the information NaN: the caller has refused it before.
pub fn collect(sensor: &LineOfSight<'_, f64>, x: &Kinematics<f64>, sink: &mut impl Sink<f64>) {
    let mut weight = Weight::Scalar(1.0);
    for (k, (landmark, los)) in sensor.landmarks.iter().zip(sensor.los).enumerate() {
        weight = sensor.weights.get(k).copied().unwrap_or(weight);
        sink.add_direction(&direction(x, *landmark, *los, weight), &x.dcm);
    }
}
