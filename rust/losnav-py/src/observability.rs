//! What a set of landmarks can tell about a pose. Arguments come checked from `losnav.observability`.
use losnav_core::analysis::observability::{Geometry, geometry, singular};
use losnav_core::math::triangular6::Singular6;
use losnav_core::math::vec3::Vec3;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::convert::{self, Floats};
use crate::errors::shape_error;
use crate::inputs::{Arguments, Repeats, observer};

/// Geometries one thread takes at a time: each costs some microseconds.
const CHUNK: usize = 32;

/// `(..., 6)` singular values and `(..., 6, 6)` vectors (rows) of the scaled, whitened Jacobian; noise is checked with
/// the predicted directions.
#[pyfunction]
#[pyo3(signature = (landmarks, predicted, sigma, covariance, pose, /))]
pub fn pose_singular<'py>(
    py: Python<'py>,
    landmarks: &Bound<'py, PyAny>,
    predicted: &Bound<'py, PyAny>,
    sigma: &Bound<'py, PyAny>,
    covariance: Option<&Bound<'py, PyAny>>,
    pose: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let arguments = Arguments::new(landmarks, predicted, sigma, covariance, Some(pose))?;
    let problems = arguments.problems(1, Repeats::Refused)?;
    let mut values = Vec::with_capacity(problems.count * 6);
    let mut vectors = Vec::with_capacity(problems.count * 36);
    for found in problems.map(py, |problem| singular(&problem.sensor(), &problem.observer()))? {
        values.extend_from_slice(&found.values);
        vectors.extend_from_slice(found.vectors.as_flattened());
    }
    let (mut one, mut six) = (problems.shape.clone(), problems.shape.clone());
    one.push(6);
    six.extend([6, 6]);
    Ok((convert::array(py, &one, values)?, convert::array(py, &six, vectors)?))
}

/// Rank, diagnosis code, and 14 numbers each: weakest rotation and velocity in reference axes, danger-cylinder
/// distance, two axes and a number of the diagnosis. Flat: `(1 or B, N, 3)`, `(B, 6)`, `(B, 6)`, `(B, 6, 6)`, and
/// `(B, N)` with zeros for landmarks that do not count.
#[pyfunction]
#[pyo3(signature = (landmarks, pose, values, vectors, kept, /))]
pub fn pose_geometry<'py>(
    py: Python<'py>,
    landmarks: &Bound<'py, PyAny>,
    pose: &Bound<'py, PyAny>,
    values: &Bound<'py, PyAny>,
    vectors: &Bound<'py, PyAny>,
    kept: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let (landmarks, pose) = (Floats::new(landmarks, "landmarks")?, Floats::new(pose, "pose")?);
    let (values, vectors) = (Floats::new(values, "values")?, Floats::new(vectors, "vectors")?);
    let kept = kept.map(|value| Floats::new(value, "kept")).transpose()?;
    let kept = kept.as_ref().map(Floats::data);
    let shape = landmarks.shape();
    let &[sets, n, 3] = shape else { return Err(shape_error("landmarks", "(B, N, 3)", shape)) };
    let marks = landmarks.data().as_chunks::<3>().0;
    let poses = pose.data().as_chunks::<6>().0;
    let values = values.data().as_chunks::<6>().0;
    let vectors = vectors.data().as_chunks::<6>().0.as_chunks::<6>().0;
    let one = |scratch: &mut Vec<Vec3<f64>>, k: usize| {
        let from = if sets == 1 { 0 } else { k * n };
        let own = marks.get(from..from + n).unwrap_or(&[]);
        let singular = Singular6 { values: values[k], vectors: vectors[k] };
        let Some(flags) = kept.and_then(|flags| flags.get(k * n..(k + 1) * n)) else {
            return geometry(own, &observer(&poses[k]), &singular);
        };
        scratch.clear();
        scratch.extend(own.iter().zip(flags).filter(|(_, flag)| **flag != 0.0).map(|(l, _)| *l));
        geometry(scratch, &observer(&poses[k]), &singular)
    };
    let count = poses.len().min(values.len()).min(vectors.len());
    let all: Vec<Geometry> =
        py.detach(|| (0..count).into_par_iter().with_min_len(CHUNK).map_init(Vec::new, one).collect());
    let ranks = all.iter().map(|g| g.rank as i64).collect();
    let codes = all.iter().map(|g| i64::from(g.diagnosis.encode().0)).collect();
    let numbers = all.iter().flat_map(numbers_of).collect();
    Ok((
        convert::array(py, &[count], ranks)?,
        convert::array(py, &[count], codes)?,
        convert::array(py, &[count, 14], numbers)?,
    ))
}

fn numbers_of(geometry: &Geometry) -> [f64; 14] {
    let (_, axis, second, number) = geometry.diagnosis.encode();
    let [a, b, c] = geometry.weakest.rotation;
    let [d, e, f] = geometry.weakest.velocity;
    let distance = geometry.danger_cylinder.unwrap_or(f64::NAN);
    [a, b, c, d, e, f, distance, axis[0], axis[1], axis[2], second[0], second[1], second[2], number]
}
