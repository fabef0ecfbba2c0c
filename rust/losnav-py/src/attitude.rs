//! Attitude conversions over whole arrays: `losnav.attitude`. Values are checked in the same pass.
use losnav_core::math::rotation as rotations;
use losnav_core::math::so3::{self, Quaternion};
use losnav_core::math::vec3::{Mat3, Vec3, dot};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use rayon::prelude::*;

use crate::convert::{self, Floats};
use crate::errors::{InvalidInputError, shape_error};

/// A quaternion this far from unit norm is a mistake; see `losnav._arrays.UNIT_TOLERANCE`.
const UNIT_TOLERANCE: f64 = 1e-2;
/// Orthonormality of a matrix; see `losnav._arrays.ROTATION_TOLERANCE`.
const ROTATION_TOLERANCE: f64 = 1e-5;
/// Below this many attitudes threads cost more than they save (some 10 ns each).
const SERIAL: usize = 8192;

/// The rule an attitude breaks.
enum Broken {
    NotFinite { entry: usize, value: f64 },
    NotUnit(f64),
    NotRotation(f64),
    Reflection,
    NoShadow,
}

type Checked<T> = Result<T, Broken>;

fn finite<const N: usize>(row: &[f64; N]) -> Checked<()> {
    match row.iter().position(|c| !c.is_finite()) {
        None => Ok(()),
        Some(entry) => Err(Broken::NotFinite { entry, value: row[entry] }),
    }
}

fn mrp(row: &[f64; 3]) -> Checked<Vec3<f64>> {
    finite(row)?;
    Ok(rotations::mrp_inside(*row))
}

fn quaternion(row: &[f64; 4]) -> Checked<Quaternion<f64>> {
    finite(row)?;
    let norm = row.iter().map(|c| c * c).sum::<f64>().sqrt();
    if (norm - 1.0).abs() <= UNIT_TOLERANCE {
        Ok(rotations::canonical(so3::normalized(*row)))
    } else {
        Err(Broken::NotUnit(norm))
    }
}

fn rotation(row: &[f64; 9]) -> Checked<Mat3<f64>> {
    finite(row)?;
    let [a, b, c, d, e, f, g, h, i] = *row;
    let m = [[a, b, c], [d, e, f], [g, h, i]];
    let mut worst = 0.0_f64;
    for j in 0..3 {
        for k in 0..=j {
            let identity = if j == k { 1.0 } else { 0.0 };
            let off = (dot(m[j], m[k]) - identity).abs();
            // `max` drops NaN (an overflow), this keeps it.
            worst = if off <= worst { worst } else { off };
        }
    }
    let determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    match worst {
        small if small <= ROTATION_TOLERANCE => {}
        large_or_nan => return Err(Broken::NotRotation(large_or_nan)),
    }
    if determinant > 0.0 { Ok(m) } else { Err(Broken::Reflection) }
}

/// Is it finite, orthonormal within tolerance, and no reflection?
pub fn is_rotation(row: &[f64; 9]) -> bool {
    rotation(row).is_ok()
}

fn flat(m: &Mat3<f64>) -> [f64; 9] {
    let [[a, b, c], [d, e, f], [g, h, i]] = *m;
    [a, b, c, d, e, f, g, h, i]
}

/// Trailing dimensions of an attitude of `I` numbers.
fn core<const I: usize>() -> &'static [usize] {
    const { if I == 9 { &[3, 3] } else { &[I] } }
}

/// An argument of attitudes: leading dimensions, and `I` numbers for each.
struct Attitudes<'py, const I: usize> {
    array: Floats<'py>,
    name: &'static str,
    lead: usize,
}

impl<'py, const I: usize> Attitudes<'py, I> {
    /// Checks the trailing dimensions.
    fn new(value: &Bound<'py, PyAny>, name: &'static str) -> PyResult<Self> {
        let array = Floats::new(value, name)?;
        let core = core::<I>();
        let shape = array.shape();
        if !shape.ends_with(core) {
            let expected = if I == 9 { "(..., 3, 3)".to_owned() } else { format!("(..., {I})") };
            return Err(shape_error(name, &expected, shape));
        }
        let lead = shape.len() - core.len();
        Ok(Self { array, name, lead })
    }

    fn shape(&self) -> &[usize] {
        self.array.shape().get(..self.lead).unwrap_or(&[])
    }

    fn rows(&self) -> &[[f64; I]] {
        self.array.data().as_chunks::<I>().0
    }

    /// Applies `each` to every attitude; many of them in parallel, without the GIL.
    fn map<'p, const O: usize>(
        &self,
        py: Python<'p>,
        core: &[usize],
        each: impl Fn(&[f64; I]) -> Checked<[f64; O]> + Sync,
    ) -> PyResult<Bound<'p, PyAny>> {
        let rows = self.rows();
        let data = fill(py, rows.len(), |k| each(&rows[k]));
        let data = data.map_err(|(k, broken)| self.error(k, &broken))?;
        convert::array(py, &[self.shape(), core].concat(), data)
    }

    /// The exception for row `k`, its place as the caller would index it.
    fn error(&self, k: usize, broken: &Broken) -> PyErr {
        let mut extents = self.shape().to_vec();
        let mut rest = k;
        if let Broken::NotFinite { entry, .. } = broken {
            extents.extend_from_slice(core::<I>());
            rest = k * I + entry;
        }
        let mut index = Vec::new();
        for extent in extents.iter().rev() {
            index.insert(0, (rest % extent.max(&1)).to_string());
            rest /= extent.max(&1);
        }
        let at = if index.is_empty() { String::new() } else { format!("[{}]", index.join(", ")) };
        let name = self.name;
        let rule = match broken {
            Broken::NotFinite { value, .. } => format!("expected a finite number, got {value}"),
            Broken::NotUnit(norm) => {
                format!("expected a unit quaternion (tolerance {UNIT_TOLERANCE}), got norm {norm:.6}")
            }
            Broken::NotRotation(error) => format!(
                "expected a rotation matrix (orthonormal within {ROTATION_TOLERANCE:e}, determinant +1), \
                 got max|R Rᵀ - I| = {error:.3e}"
            ),
            Broken::Reflection => "expected a rotation matrix (determinant +1), got a reflection".to_owned(),
            Broken::NoShadow => "the shadow of the zero rotation is at infinity".to_owned(),
        };
        InvalidInputError::new_err(format!("{name}{at}: {rule}"))
    }
}

/// `O` numbers for each of `count` attitudes, or the first that breaks a rule.
fn fill<const O: usize>(
    py: Python<'_>,
    count: usize,
    each: impl Fn(usize) -> Checked<[f64; O]> + Sync,
) -> Result<Vec<f64>, (usize, Broken)> {
    let mut data = vec![0.0; count * O];
    let out = data.as_chunks_mut::<O>().0;
    let one = |(k, row): (usize, &mut [f64; O])| {
        *row = each(k).map_err(|broken| (k, broken))?;
        Ok(())
    };
    if count < SERIAL {
        out.iter_mut().enumerate().try_for_each(one)?;
        return Ok(data);
    }
    let parallel = py.detach(|| out.par_iter_mut().with_min_len(1024).enumerate().try_for_each(one));
    match parallel {
        Ok(()) => Ok(data),
        // Whichever thread failed first: find the first row instead.
        Err(found) => Err((0..count).find_map(|k| each(k).err().map(|b| (k, b))).unwrap_or(found)),
    }
}

/// See `losnav.attitude.dcm_from_mrp`.
#[pyfunction]
#[pyo3(signature = (mrp, /))]
pub fn dcm_from_mrp<'py>(py: Python<'py>, mrp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(mrp, "mrp")?.map(py, &[3, 3], |row| {
        Ok(flat(&so3::dcm_from_quaternion(so3::quaternion_from_mrp(self::mrp(row)?))))
    })
}

/// See `losnav.attitude.mrp_from_dcm`.
#[pyfunction]
#[pyo3(signature = (dcm, /))]
pub fn mrp_from_dcm<'py>(py: Python<'py>, dcm: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(dcm, "dcm")?
        .map(py, &[3], |row| Ok(so3::mrp_from_quaternion(rotations::quaternion_from_dcm(&rotation(row)?))))
}

/// See `losnav.attitude.dcm_from_quaternion`.
#[pyfunction]
#[pyo3(signature = (q, /))]
pub fn dcm_from_quaternion<'py>(py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(q, "q")?.map(py, &[3, 3], |row| Ok(flat(&so3::dcm_from_quaternion(quaternion(row)?))))
}

/// See `losnav.attitude.quaternion_from_dcm`.
#[pyfunction]
#[pyo3(signature = (dcm, /))]
pub fn quaternion_from_dcm<'py>(py: Python<'py>, dcm: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(dcm, "dcm")?.map(py, &[4], |row| Ok(rotations::quaternion_from_dcm(&rotation(row)?)))
}

/// See `losnav.attitude.mrp_from_quaternion`.
#[pyfunction]
#[pyo3(signature = (q, /))]
pub fn mrp_from_quaternion<'py>(py: Python<'py>, q: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(q, "q")?.map(py, &[3], |row| Ok(so3::mrp_from_quaternion(quaternion(row)?)))
}

/// See `losnav.attitude.quaternion_from_mrp`.
#[pyfunction]
#[pyo3(signature = (mrp, /))]
pub fn quaternion_from_mrp<'py>(py: Python<'py>, mrp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(mrp, "mrp")?
        .map(py, &[4], |row| Ok(rotations::canonical(so3::quaternion_from_mrp(self::mrp(row)?))))
}

/// See `losnav.attitude.mrp_shadow`.
#[pyfunction]
#[pyo3(signature = (mrp, /))]
pub fn mrp_shadow<'py>(py: Python<'py>, mrp: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    Attitudes::new(mrp, "mrp")?.map(py, &[3], |row: &[f64; 3]| {
        finite(row)?;
        let shadow = rotations::mrp_shadow(*row);
        finite(&shadow).map_err(|_| Broken::NoShadow)?;
        Ok(shadow)
    })
}

/// See `losnav.attitude.rotation_error`.
#[pyfunction]
#[pyo3(signature = (dcm_true, dcm_estimate, /))]
pub fn rotation_error<'py>(
    py: Python<'py>,
    dcm_true: &Bound<'py, PyAny>,
    dcm_estimate: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let truth = Attitudes::<9>::new(dcm_true, "dcm_true")?;
    let estimate = Attitudes::<9>::new(dcm_estimate, "dcm_estimate")?;
    let (one_truth, one_estimate) = (truth.lead == 0, estimate.lead == 0);
    if !(one_truth || one_estimate || truth.shape() == estimate.shape()) {
        static TOGETHER: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let together = TOGETHER.import(py, "losnav._arrays", "together")?;
        let pair = together.call1((("dcm_true", dcm_true, 2), ("dcm_estimate", dcm_estimate, 2)))?;
        return rotation_error(py, &pair.get_item(0)?, &pair.get_item(1)?);
    }
    let (t, e) = (truth.rows(), estimate.rows());
    let (shape, count) = if one_truth { (estimate.shape(), e.len()) } else { (truth.shape(), t.len()) };
    let row = |rows: &'_ [[f64; 9]], one: bool, k: usize| rotation(&rows[if one { 0 } else { k }]);
    let data =
        fill(py, count, |k| Ok(rotations::rotation_error(&row(t, one_truth, k)?, &row(e, one_estimate, k)?)));
    let data = data.map_err(|(k, broken)| match row(t, one_truth, k) {
        Err(_) => truth.error(if one_truth { 0 } else { k }, &broken),
        Ok(_) => estimate.error(if one_estimate { 0 } else { k }, &broken),
    })?;
    convert::array(py, &[shape, &[3]].concat(), data)
}
