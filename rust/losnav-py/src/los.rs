//! Predicted directions, their Jacobian and the Fisher information. Arguments come checked from `losnav.pose`:
//! `(B, N, 3)` or `(1, N, 3)` landmarks, `(B, 3)` positions and MRPs.
use losnav_core::analysis::fisher;
use losnav_core::math::rotation::mrp_inside;
use losnav_core::math::so3::quaternion_from_mrp;
use losnav_core::math::so3::rotation_from_mrp_rate;
use losnav_core::math::vec3::rotate_transposed;
use losnav_core::math::vec3::{Vec3, dot, mul, skew};
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::{Direction, Weight};
use losnav_core::models::sensors::line_of_sight::{direction, predict};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::convert::{self, Floats};
use crate::errors::shape_error;
use crate::inputs::{Arguments, Repeats};

/// `σ²` beyond which the attitude no longer moves with its MRP: `4/σ²` is 4e-150.
const MRP_FLAT: f64 = 1e150;
/// Below this many landmarks in all, threads cost more than they save.
const SERIAL: usize = 4096;

/// Poses and landmarks of a batch, flat.
struct Batch<'a> {
    landmarks: &'a [Vec3<f64>],
    n: usize,
    positions: &'a [Vec3<f64>],
    mrps: &'a [Vec3<f64>],
}

impl<'a> Batch<'a> {
    fn new(landmarks: &'a Floats<'_>, position: &'a Floats<'_>, mrp: &'a Floats<'_>) -> PyResult<Self> {
        let shape = landmarks.shape();
        let [_, n, 3] = shape else { return Err(shape_error("landmarks", "(B, N, 3)", shape)) };
        Ok(Self {
            landmarks: landmarks.data().as_chunks::<3>().0,
            n: *n,
            positions: position.data().as_chunks::<3>().0,
            mrps: mrp.data().as_chunks::<3>().0,
        })
    }

    fn landmarks(&self, k: usize) -> &'a [Vec3<f64>] {
        let from = if self.landmarks.len() == self.n { 0 } else { k * self.n };
        self.landmarks.get(from..from + self.n).unwrap_or(&[])
    }

    fn observer(&self, k: usize) -> Kinematics<f64> {
        Kinematics::at_rest(self.positions[k], quaternion_from_mrp(mrp_inside(self.mrps[k])))
    }

    /// Fills `M` numbers for each landmark of each pose.
    fn fill<const M: usize>(
        &self,
        each: impl Fn(&Kinematics<f64>, usize, Vec3<f64>) -> [f64; M] + Sync,
    ) -> Vec<f64> {
        let count = self.positions.len();
        let mut out = vec![0.0; count * self.n * M];
        let one = |(k, chunk): (usize, &mut [f64])| {
            let x = self.observer(k);
            for (landmark, row) in self.landmarks(k).iter().zip(chunk.as_chunks_mut::<M>().0) {
                *row = each(&x, k, *landmark);
            }
        };
        let size = (self.n * M).max(1);
        if count * self.n < SERIAL {
            out.chunks_mut(size).enumerate().for_each(one);
        } else {
            out.par_chunks_mut(size).enumerate().for_each(one);
        }
        out
    }
}

/// An array `(B, N, *tail)` of `M` numbers for each landmark of each pose.
fn each_landmark<'py, const M: usize>(
    arguments: [&Bound<'py, PyAny>; 3],
    tail: &[usize],
    each: impl Fn(&Kinematics<f64>, Vec3<f64>, Vec3<f64>) -> [f64; M] + Sync,
) -> PyResult<Bound<'py, PyAny>> {
    let [landmarks, position, mrp] = arguments;
    let py = landmarks.py();
    let (landmarks, position, mrp) =
        (Floats::new(landmarks, "landmarks")?, Floats::new(position, "position")?, Floats::new(mrp, "mrp")?);
    let batch = Batch::new(&landmarks, &position, &mrp)?;
    let data = py.detach(|| batch.fill(|x, k, landmark| each(x, batch.mrps[k], landmark)));
    let shape = [&[batch.positions.len(), batch.n], tail].concat();
    convert::array(py, &shape, data)
}

/// `(B, N, 3)` unit vectors.
#[pyfunction]
#[pyo3(signature = (landmarks, position, mrp, /))]
pub fn predict_los<'py>(
    landmarks: &Bound<'py, PyAny>,
    position: &Bound<'py, PyAny>,
    mrp: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    each_landmark([landmarks, position, mrp], &[3], |x, _, landmark| predict(x, landmark).0)
}

/// `(B, N, 3, 6)`, columns `[p, mrp]`, equation (6).
#[pyfunction]
#[pyo3(signature = (landmarks, position, mrp, /))]
pub fn los_jacobian<'py>(
    landmarks: &Bound<'py, PyAny>,
    position: &Bound<'py, PyAny>,
    mrp: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    each_landmark([landmarks, position, mrp], &[3, 6], jacobian_rows)
}

fn jacobian_rows(x: &Kinematics<f64>, mrp: Vec3<f64>, landmark: Vec3<f64>) -> [f64; 18] {
    let block: Direction<f64> = direction(x, landmark, [0.0; 3], Weight::Scalar(1.0));
    let body = block.d_body_position();
    // Its entries fall like 4/σ²: below the smallest number long before σ⁴ overflows.
    let factor = if dot(mrp, mrp) < MRP_FLAT { rotation_from_mrp_rate(mrp) } else { [[0.0; 3]; 3] };
    let attitude = mul(&skew(block.predicted), &factor);
    let mut out = [0.0; 18];
    for i in 0..3 {
        let position = rotate_transposed(&x.dcm, body[i]);
        out[6 * i..6 * i + 3].copy_from_slice(&position);
        out[6 * i + 3..6 * i + 6].copy_from_slice(&attitude[i]);
    }
    out
}

/// `(B, 6, 6)` information about `[δp, δα]`; noise is checked with the predicted directions, `(B, N, 3)`.
#[pyfunction]
#[pyo3(signature = (landmarks, predicted, sigma, covariance, pose, /))]
pub fn fisher_information<'py>(
    py: Python<'py>,
    landmarks: &Bound<'py, PyAny>,
    predicted: &Bound<'py, PyAny>,
    sigma: &Bound<'py, PyAny>,
    covariance: Option<&Bound<'py, PyAny>>,
    pose: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let arguments = Arguments::new(landmarks, predicted, sigma, covariance, Some(pose))?;
    let problems = arguments.problems(1, Repeats::Refused)?;
    let found = problems.map(py, |problem| {
        let information = fisher::information(&problem.sensor(), &problem.observer());
        core::array::from_fn::<f64, 36, _>(|e| information.at(e / 6, e % 6))
    })?;
    let mut shape = problems.shape.clone();
    shape.extend([6, 6]);
    convert::array(py, &shape, found.into_flattened())
}
