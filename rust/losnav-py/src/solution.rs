//! `PoseSolution`: what a pose solve returns, one problem or a batch, fields made when asked for.
use losnav_core::estimators::least_squares::{Outcome, Termination};
use losnav_core::math::so3::{dcm_from_quaternion, mrp_from_quaternion};
use losnav_core::math::sym6::Sym6;
use losnav_core::math::vec3::{mul, transpose};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};

use crate::convert::{self, Entry, Floats};

/// The answer to one problem.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Reference frame, m.
    pub position: [f64; 3],
    /// Body in reference, scalar last, w ≥ 0.
    pub quaternion: [f64; 4],
    /// Information about `[δp', δα]`, both in body axes.
    pub information: Sym6<f64>,
    /// `½ Σ ρ`.
    pub cost: f64,
    /// `Σ eᵀ W e`.
    pub chi2: f64,
    /// Degrees of freedom of `chi2`.
    pub dof: f64,
    /// Trial steps.
    pub iterations: f64,
    /// Code of `Termination`.
    pub termination: f64,
    /// Minimum of a full-rank problem?
    pub converged: bool,
}

/// Numbers in a pickled [`Record`].
const PACKED: usize = 34;

impl Record {
    /// From an outcome of the solver.
    pub fn new(outcome: &Outcome<f64>, chi2: f64, dof: f64) -> Self {
        let mut quaternion = outcome.pose.attitude;
        if quaternion[3] < 0.0 {
            quaternion = quaternion.map(|c| -c);
        }
        Self {
            position: outcome.pose.position,
            quaternion,
            information: outcome.information,
            cost: outcome.cost,
            chi2,
            dof,
            iterations: outcome.iterations,
            termination: outcome.termination,
            converged: outcome.converged,
        }
    }

    /// What stands in for a problem that could not be posed.
    pub fn invalid() -> Self {
        Self {
            position: [f64::NAN; 3],
            quaternion: [f64::NAN; 4],
            information: Sym6([f64::NAN; 21]),
            cost: f64::NAN,
            chi2: f64::NAN,
            dof: 0.0,
            iterations: 0.0,
            termination: f64::from(Termination::NonFinite as u8),
            converged: false,
        }
    }

    /// What stands for a pose no start could be found for: the landmarks do not determine one.
    pub fn undetermined(n: usize) -> Self {
        let dof = 2.0 * n as f64 - 6.0;
        Self { dof, termination: f64::from(Termination::Singular as u8), ..Self::invalid() }
    }

    /// The same pose with lengths that were counted in `unit` counted in metres.
    pub fn in_unit(mut self, unit: f64) -> Self {
        self.position = self.position.map(|c| c * unit);
        for i in 0..3 {
            for j in i..6 {
                let lengths = if j < 3 { unit * unit } else { unit };
                self.information.0[losnav_core::math::sym6::index(i, j)] /= lengths;
            }
        }
        // What cannot be written down in metres is not known in metres.
        self.converged &= self.information.0.iter().all(|entry| entry.is_finite());
        self
    }

    /// Covariance of `[δp, δα]`, position in reference axes, row by row; NaN where the information is singular.
    fn covariance(&self) -> [f64; 36] {
        let mut out = [f64::NAN; 36];
        let Some(body) = scaled_inverse(&self.information) else { return out };
        let dcm = dcm_from_quaternion(self.quaternion);
        let block = |r: usize, c: usize| {
            let mut m = [[0.0; 3]; 3];
            for i in 0..3 {
                for j in 0..3 {
                    m[i][j] = body.at(r + i, c + j);
                }
            }
            m
        };
        let back = transpose(&dcm);
        let pp = mul(&mul(&back, &block(0, 0)), &dcm);
        let pa = mul(&back, &block(0, 3));
        let aa = block(3, 3);
        for i in 0..3 {
            for j in 0..3 {
                out[6 * i + j] = 0.5 * (pp[i][j] + pp[j][i]);
                out[6 * i + 3 + j] = pa[i][j];
                out[6 * (3 + j) + i] = pa[i][j];
                out[6 * (3 + i) + 3 + j] = aa[i][j];
            }
        }
        out
    }

    fn pack(&self) -> [f64; PACKED] {
        let mut out = [0.0; PACKED];
        out[..3].copy_from_slice(&self.position);
        out[3..7].copy_from_slice(&self.quaternion);
        out[7..28].copy_from_slice(&self.information.0);
        out[28..].copy_from_slice(&[
            self.cost,
            self.chi2,
            self.dof,
            self.iterations,
            self.termination,
            f64::from(u8::from(self.converged)),
        ]);
        out
    }

    fn unpack(packed: &[f64; PACKED]) -> Self {
        let take = |i: usize| packed[i];
        Self {
            position: core::array::from_fn(take),
            quaternion: core::array::from_fn(|i| take(3 + i)),
            information: Sym6(core::array::from_fn(|i| take(7 + i))),
            cost: packed[28],
            chi2: packed[29],
            dof: packed[30],
            iterations: packed[31],
            termination: packed[32],
            converged: packed[33] != 0.0,
        }
    }
}

/// Inverse with the units taken out first: metres and radians may be many decades apart.
fn scaled_inverse(information: &Sym6<f64>) -> Option<Sym6<f64>> {
    let scale = information.diagonal().map(|d| 1.0 / d.sqrt());
    let apply = |m: &Sym6<f64>| {
        let mut out = *m;
        for i in 0..6 {
            for j in i..6 {
                out.0[losnav_core::math::sym6::index(i, j)] *= scale[i] * scale[j];
            }
        }
        out
    };
    let ldl = apply(information).ldl();
    ldl.positive().then(|| apply(&ldl.inverse()))
}

/// One problem, or a batch of this shape.
// One record stands inline: boxing it would cost the single solve an allocation.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
enum Records {
    One(Record),
    Many(Vec<usize>, Vec<Record>),
}

/// Landmarks of the problems: `(N, 3)` shared, or one set each.
#[derive(Clone, Debug)]
pub struct Landmarks {
    /// Numbers in C order.
    pub data: Vec<f64>,
    /// `(..., N, 3)`.
    pub shape: Vec<usize>,
}

/// Pose from lines of sight, how well it is known, and how it was found.
///
/// Every field has the batch shape ``(...)`` of the problem; arrays are made when asked for. Positions are in the
/// reference frame in metres, angles in radians, ``dcm`` is [BN] (reference to body components).
///
/// ``alternatives`` holds the other local minima of comparable cost that a guess-free solve found: a tuple of
/// ``PoseSolution`` for one problem, an object array of such tuples for a batch.
#[pyclass(frozen, module = "losnav")]
pub struct PoseSolution {
    records: Records,
    landmarks: Landmarks,
    /// `(problem, minimum)`, in order of cost within a problem.
    others: Vec<(usize, Record)>,
    /// Inlier flags of a robust solve, `(..., N)`.
    inliers: Option<Vec<bool>>,
}

impl PoseSolution {
    /// One problem.
    pub fn one(
        record: Record,
        landmarks: Landmarks,
        others: Vec<Record>,
        inliers: Option<Vec<bool>>,
    ) -> Self {
        let others = others.into_iter().map(|r| (0, r)).collect();
        Self { records: Records::One(record), landmarks, others, inliers }
    }

    /// A batch.
    pub fn many(
        shape: Vec<usize>,
        records: Vec<Record>,
        landmarks: Landmarks,
        others: Vec<(usize, Record)>,
        inliers: Option<Vec<bool>>,
    ) -> Self {
        Self { records: Records::Many(shape, records), landmarks, others, inliers }
    }

    fn shape(&self) -> &[usize] {
        match &self.records {
            Records::One(_) => &[],
            Records::Many(shape, _) => shape,
        }
    }

    fn slice(&self) -> &[Record] {
        match &self.records {
            Records::One(record) => std::slice::from_ref(record),
            Records::Many(_, records) => records,
        }
    }

    fn landmark_count(&self) -> usize {
        self.landmarks.shape.get(self.landmarks.shape.len().wrapping_sub(2)).copied().unwrap_or(0)
    }

    fn array<'py, const M: usize>(
        &self,
        py: Python<'py>,
        tail: &[usize],
        field: impl Fn(&Record) -> [f64; M],
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut shape = self.shape().to_vec();
        shape.extend_from_slice(tail);
        let mut data = Vec::with_capacity(self.slice().len() * M);
        for record in self.slice() {
            data.extend_from_slice(&field(record));
        }
        convert::array(py, &shape, data)
    }

    /// A Python number for one problem, an array for a batch.
    fn number<'py, T>(&self, py: Python<'py>, field: impl Fn(&Record) -> T) -> PyResult<Bound<'py, PyAny>>
    where
        T: Entry + IntoPyObjectExt<'py>,
    {
        match &self.records {
            Records::One(record) => field(record).into_bound_py_any(py),
            Records::Many(shape, records) => convert::array(py, shape, records.iter().map(field).collect()),
        }
    }
}

#[pymethods]
impl PoseSolution {
    /// Observer in the reference frame, m, ``(..., 3)``.
    #[getter]
    fn position<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3], |r| r.position)
    }

    /// Modified Rodrigues parameters of the body in the reference frame, inside the unit ball, ``(..., 3)``.
    #[getter]
    fn mrp<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3], |r| mrp_from_quaternion(r.quaternion))
    }

    /// Quaternion ``[x, y, z, w]`` of the body in the reference frame, ``w >= 0``, ``(..., 4)``.
    #[getter]
    fn quaternion<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[4], |r| r.quaternion)
    }

    /// [BN]: reference components to body components, ``(..., 3, 3)``.
    #[getter]
    fn dcm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3, 3], |r| {
            let m = dcm_from_quaternion(r.quaternion);
            core::array::from_fn::<f64, 9, _>(|k| m[k / 3][k % 3])
        })
    }

    /// Covariance of ``[dp, dalpha]``: position error in the reference frame (m), attitude error in body axes (rad),
    /// ``(..., 6, 6)``; NaN where the problem has no full rank.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[6, 6], Record::covariance)
    }

    /// Final cost, half the sum of the losses of the squared residuals in standard deviations.
    #[getter]
    fn cost<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.cost)
    }

    /// Sum of the squared residuals in standard deviations (over the inliers of a robust solve).
    #[getter]
    fn chi2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.chi2)
    }

    /// Degrees of freedom of ``chi2``: 2 N - 6, two for each direction.
    #[getter]
    fn dof<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.dof as i64)
    }

    /// Trial steps taken, rejected ones included.
    #[getter]
    fn iterations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.iterations as i64)
    }

    /// Why the iteration stopped: ``Termination`` for one problem, an object array of them for a batch.
    #[getter]
    fn termination<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        static TERMINATIONS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let all = TERMINATIONS.import(py, "losnav.pose", "TERMINATIONS")?;
        let name = |r: &Record| all.get_item(r.termination as usize);
        match &self.records {
            Records::One(record) => name(record),
            Records::Many(shape, records) => {
                let names =
                    records.iter().map(|r| name(r).map(Bound::unbind)).collect::<PyResult<Vec<_>>>()?;
                convert::objects(py, shape, names)
            }
        }
    }

    /// True only at a minimum of a full-rank problem: stationary, and the true Hessian positive definite.
    #[getter]
    fn converged<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.converged)
    }

    /// Other local minima of comparable cost found by a guess-free solve, best first.
    #[getter]
    fn alternatives<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let of = |problem: usize| {
            let solutions = self.others.iter().filter(|(k, _)| *k == problem).map(|(_, record)| {
                let landmarks = self.landmarks_of(problem);
                Py::new(py, Self::one(*record, landmarks, Vec::new(), None))
            });
            PyTuple::new(py, solutions.collect::<PyResult<Vec<_>>>()?)
        };
        match &self.records {
            Records::One(_) => Ok(of(0)?.into_any()),
            Records::Many(shape, records) => {
                let all = (0..records.len()).map(|k| Ok(of(k)?.into_any().unbind()));
                convert::objects(py, shape, all.collect::<PyResult<Vec<_>>>()?)
            }
        }
    }

    /// Which lines of sight a robust solve kept, ``(..., N)``; ``None`` after ``solve_pose``.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(flags) = &self.inliers else { return Ok(None) };
        let mut shape = self.shape().to_vec();
        shape.push(self.landmark_count());
        convert::array(py, &shape, flags.clone()).map(Some)
    }

    /// How well the geometry determines the pose: rank, singular values, weakest direction in words.
    #[getter]
    fn observability<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        static OF_SOLUTION: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        OF_SOLUTION.import(slf.py(), "losnav.observability", "of_pose_solution")?.call1((slf,))
    }

    /// Information about ``[dp', dalpha]``, both in body axes, ``(..., 6, 6)``.
    #[getter]
    fn _body_information<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[6, 6], |r| core::array::from_fn::<f64, 36, _>(|k| r.information.at(k / 6, k % 6)))
    }

    /// Landmarks of the problem, ``(..., N, 3)``.
    #[getter]
    fn _landmarks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::array(py, &self.landmarks.shape, self.landmarks.data.clone())
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        static DESCRIBE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        DESCRIBE.import(slf.py(), "losnav.pose", "describe")?.call1((slf,))?.extract()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, this) = (slf.py(), slf.get());
        let restore = slf.get_type().getattr("_restore")?;
        let pack =
            |records: &mut dyn Iterator<Item = &Record>| records.flat_map(Record::pack).collect::<Vec<_>>();
        let state = PyTuple::new(
            py,
            [
                PyList::new(py, this.shape())?.into_any(),
                matches!(this.records, Records::One(_)).into_pyobject(py)?.to_owned().into_any(),
                convert::array(py, &[this.slice().len() * PACKED], pack(&mut this.slice().iter()))?,
                PyList::new(py, &this.landmarks.shape)?.into_any(),
                convert::array(py, &[this.landmarks.data.len()], this.landmarks.data.clone())?,
                PyList::new(py, this.others.iter().map(|(k, _)| *k))?.into_any(),
                convert::array(
                    py,
                    &[this.others.len() * PACKED],
                    pack(&mut this.others.iter().map(|(_, r)| r)),
                )?,
                this.inliers.clone().into_pyobject(py)?.into_any(),
            ],
        )?;
        Ok((restore, state))
    }

    #[staticmethod]
    fn _restore(
        shape: Vec<usize>,
        single: bool,
        records: &Bound<'_, PyAny>,
        landmark_shape: Vec<usize>,
        landmarks: &Bound<'_, PyAny>,
        owners: Vec<usize>,
        others: &Bound<'_, PyAny>,
        inliers: Option<Vec<bool>>,
    ) -> PyResult<Self> {
        let unpack = |value| -> PyResult<Vec<Record>> {
            let floats = Floats::new(value, "state")?;
            Ok(floats.data().as_chunks::<PACKED>().0.iter().map(Record::unpack).collect())
        };
        let mut records = unpack(records)?;
        let others = owners.into_iter().zip(unpack(others)?).collect();
        let landmarks =
            Landmarks { data: Floats::new(landmarks, "state")?.data().to_vec(), shape: landmark_shape };
        let records = if single {
            Records::One(records.pop().ok_or_else(|| PyValueError::new_err("empty state"))?)
        } else {
            Records::Many(shape, records)
        };
        Ok(Self { records, landmarks, others, inliers })
    }
}

impl PoseSolution {
    fn landmarks_of(&self, problem: usize) -> Landmarks {
        let size = self.landmark_count() * 3;
        let shared = self.landmarks.data.len() <= size;
        let from = if shared { 0 } else { problem * size };
        Landmarks {
            data: self.landmarks.data.get(from..from + size).unwrap_or(&[]).to_vec(),
            shape: vec![self.landmark_count(), 3],
        }
    }
}
