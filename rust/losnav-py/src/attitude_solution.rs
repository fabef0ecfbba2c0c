//! `AttitudeSolution`: what an attitude determination returns, one problem or a batch, fields made when asked for.
use losnav_core::estimators::wahba::careful::Solution;
use losnav_core::math::rotation::canonical;
use losnav_core::math::so3::{dcm_from_quaternion, mrp_from_quaternion};
use losnav_core::math::sym3::Sym3;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};

use crate::convert::{self, Entry, Floats};

/// The answer to one problem.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    /// Body in reference, scalar last, w ≥ 0.
    pub quaternion: [f64; 4],
    /// Information about `δα`, body axes, of all directions but an exact one.
    pub information: Sym3<f64>,
    /// `½ Σ w |e|²`.
    pub loss: f64,
    /// Body axis of a free rotation, of the exact direction or of what is known least; NaN where nothing stands out.
    pub axis: [f64; 3],
    /// Information about the rotation about `axis`.
    pub weakest: f64,
    /// Degrees of freedom of `χ²`.
    pub dof: i32,
    /// Determined rotations.
    pub rank: u8,
    /// Is one direction exact?
    pub exact: bool,
    /// The only minimum?
    pub converged: bool,
}

/// Numbers in a pickled [`Record`].
const PACKED: usize = 19;

impl Record {
    /// What stands in for a problem that could not be posed.
    #[inline]
    pub fn invalid() -> Self {
        Self {
            quaternion: [f64::NAN; 4],
            information: Sym3([f64::NAN; 6]),
            loss: f64::NAN,
            axis: [f64::NAN; 3],
            weakest: f64::NAN,
            dof: 0,
            rank: 0,
            exact: false,
            converged: false,
        }
    }

    /// From a solution and the number of its directions.
    pub fn new(solution: &Solution, n: usize) -> Self {
        Self {
            quaternion: canonical(solution.quaternion),
            information: solution.information,
            loss: solution.loss,
            axis: solution.axis,
            weakest: solution.weakest,
            dof: 2 * n as i32 - i32::from(solution.rank),
            rank: solution.rank,
            exact: solution.exact,
            converged: solution.converged,
        }
    }

    /// Completes an invalid record whose numbers have become those of a minimum, proven with digits to spare.
    #[inline(always)]
    pub fn found(&mut self, n: usize) {
        if self.quaternion[3] == 0.0 {
            self.quaternion = canonical(self.quaternion);
        }
        self.dof = 2 * n as i32 - 3;
        self.rank = 3;
        self.converged = true;
    }

    /// Covariance of `δα`; NaN where a rotation is free.
    fn covariance(&self) -> [f64; 9] {
        let covariance = if self.weakest.is_nan() {
            let ldl = self.information.ldl();
            ldl.positive().then(|| ldl.inverse())
        } else {
            self.solution().covariance()
        };
        let full = covariance.unwrap_or(Sym3([f64::NAN; 6])).full();
        core::array::from_fn(|k| full[k / 3][k % 3])
    }

    fn solution(&self) -> Solution {
        let Self { quaternion, information, loss, rank, axis, weakest, exact, converged, .. } = *self;
        Solution { quaternion, information, loss, rank, axis, weakest, exact, converged }
    }

    fn free_axis(&self) -> [f64; 3] {
        if self.rank == 2 { self.axis } else { [f64::NAN; 3] }
    }

    fn pack(&self) -> [f64; PACKED] {
        let mut out = [0.0; PACKED];
        out[..4].copy_from_slice(&self.quaternion);
        out[4..10].copy_from_slice(&self.information.0);
        out[10..13].copy_from_slice(&self.axis);
        let flag = |b: bool| f64::from(u8::from(b));
        out[13..].copy_from_slice(&[
            self.weakest,
            self.loss,
            f64::from(self.dof),
            f64::from(self.rank),
            flag(self.exact),
            flag(self.converged),
        ]);
        out
    }

    fn unpack(packed: &[f64; PACKED]) -> Self {
        let take = |i: usize| packed[i];
        Self {
            quaternion: core::array::from_fn(take),
            information: Sym3(core::array::from_fn(|i| take(4 + i))),
            axis: core::array::from_fn(|i| take(10 + i)),
            weakest: packed[13],
            loss: packed[14],
            dof: packed[15] as i32,
            rank: packed[16] as u8,
            exact: packed[17] != 0.0,
            converged: packed[18] != 0.0,
        }
    }
}

/// Solutions made of attitudes known otherwise: `(..., 4)` unit quaternions, `(..., 3, 3)` information about `δα` in
/// body axes, `(...)` `χ²` and its degrees of freedom, all of one batch shape and checked by the caller.
#[pyfunction]
#[pyo3(signature = (quaternion, information, chi2, dof, /))]
pub fn attitude_solution(
    quaternion: &Bound<'_, PyAny>,
    information: &Bound<'_, PyAny>,
    chi2: &Bound<'_, PyAny>,
    dof: &Bound<'_, PyAny>,
) -> PyResult<AttitudeSolution> {
    let (quaternion, information) =
        (Floats::new(quaternion, "quaternion")?, Floats::new(information, "information")?);
    let (chi2, dof) = (Floats::new(chi2, "chi2")?, Floats::new(dof, "dof")?);
    let attitudes = quaternion.data().as_chunks::<4>().0.iter().zip(information.data().as_chunks::<9>().0);
    let fits = chi2.data().iter().zip(dof.data());
    let records: Vec<Record> = attitudes
        .zip(fits)
        .map(|((q, m), (chi2, dof))| {
            let information = Sym3([m[0], m[1], m[2], m[4], m[5], m[8]]);
            Record { dof: *dof as i32, ..Record::new(&Solution::known(*q, information, 0.5 * chi2), 0) }
        })
        .collect();
    let shape = chi2.shape();
    match records.as_slice() {
        [only] if shape.is_empty() => Ok(AttitudeSolution::one(*only, None)),
        _ => Ok(AttitudeSolution::many(shape.to_vec(), vec![records], None)),
    }
}

/// One problem, or a batch of this shape in the chunks that the threads wrote.
// One record stands inline: boxing it would cost the single solve an allocation.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug)]
enum Records {
    One([Record; 1]),
    Many(Vec<usize>, Vec<Vec<Record>>),
}

/// Attitude from vectors, how well it is known, and what is not known.
///
/// Every field has the batch shape ``(...)`` of the problem; arrays are made when asked for. Angles are in radians,
/// ``dcm`` is [BN] (reference to body components), errors ``dalpha`` are in body axes, true minus estimate.
#[pyclass(frozen, module = "losnav")]
pub struct AttitudeSolution {
    records: Records,
    /// Inlier flags of a robust solve, `(..., N)`.
    inliers: Option<Vec<bool>>,
}

impl AttitudeSolution {
    /// One problem.
    pub fn one(record: Record, inliers: Option<Vec<bool>>) -> Self {
        Self { records: Records::One([record]), inliers }
    }

    /// A batch.
    pub fn many(shape: Vec<usize>, chunks: Vec<Vec<Record>>, inliers: Option<Vec<bool>>) -> Self {
        Self { records: Records::Many(shape, chunks), inliers }
    }

    fn shape(&self) -> &[usize] {
        match &self.records {
            Records::One(_) => &[],
            Records::Many(shape, _) => shape,
        }
    }

    fn count(&self) -> usize {
        self.shape().iter().product()
    }

    fn each(&self) -> impl Iterator<Item = &Record> {
        let (one, many): (&[Record], &[Vec<Record>]) = match &self.records {
            Records::One(record) => (record, &[]),
            Records::Many(_, chunks) => (&[], chunks),
        };
        one.iter().chain(many.iter().flatten())
    }

    fn array<'py, const M: usize>(
        &self,
        py: Python<'py>,
        tail: &[usize],
        field: impl Fn(&Record) -> [f64; M],
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut shape = self.shape().to_vec();
        shape.extend_from_slice(tail);
        let mut data = Vec::with_capacity(self.count() * M);
        for record in self.each() {
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
            Records::One([record]) => field(record).into_bound_py_any(py),
            Records::Many(shape, _) => convert::array(py, shape, self.each().map(field).collect()),
        }
    }
}

#[pymethods]
impl AttitudeSolution {
    /// [BN]: reference components to body components, ``(..., 3, 3)``.
    #[getter]
    fn dcm<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3, 3], |r| {
            let m = dcm_from_quaternion(r.quaternion);
            core::array::from_fn::<f64, 9, _>(|k| m[k / 3][k % 3])
        })
    }

    /// Quaternion ``[x, y, z, w]`` of the body in the reference frame, ``w >= 0``, ``(..., 4)``.
    #[getter]
    fn quaternion<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[4], |r| r.quaternion)
    }

    /// Modified Rodrigues parameters of the body in the reference frame, inside the unit ball, ``(..., 3)``.
    #[getter]
    fn mrp<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3], |r| mrp_from_quaternion(r.quaternion))
    }

    /// Covariance of ``dalpha``, body axes, rad^2, ``(..., 3, 3)`` (equation A4); NaN where a rotation is free.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3, 3], Record::covariance)
    }

    /// Information about ``dalpha``, body axes, rad^-2, ``(..., 3, 3)``, singular where a rotation is free; without
    /// the infinite one of an exact direction.
    #[getter]
    fn information<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3, 3], |r| {
            let full = r.information.full();
            core::array::from_fn::<f64, 9, _>(|k| full[k / 3][k % 3])
        })
    }

    /// Wahba's loss, half the sum of the squared residuals in standard deviations.
    #[getter]
    fn loss<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.loss)
    }

    /// Sum of the squared residuals in standard deviations, twice the loss (over the inliers of a robust solve).
    #[getter]
    fn chi2<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| 2.0 * r.loss)
    }

    /// Degrees of freedom of ``chi2``: two for each direction less the rank, so 2 N - 3 for a full one.
    #[getter]
    fn dof<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| i64::from(r.dof))
    }

    /// How many rotations the directions determine, 0 to 3.
    #[getter]
    fn rank<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| i64::from(r.rank))
    }

    /// Body axis about which the rotation is free, ``(..., 3)``, where ``rank`` is 2; NaN elsewhere.
    #[getter]
    fn free_axis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[3], Record::free_axis)
    }

    /// True only at the proven and only minimum of a problem of full rank.
    #[getter]
    fn converged<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.number(py, |r| r.converged)
    }

    /// Which directions a robust solve kept, ``(..., N)``; ``None`` after ``solve_attitude``.
    #[getter]
    fn inliers<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(flags) = &self.inliers else { return Ok(None) };
        let mut shape = self.shape().to_vec();
        shape.push(flags.len().checked_div(self.count()).unwrap_or(0));
        convert::array(py, &shape, flags.clone()).map(Some)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        static DESCRIBE: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        DESCRIBE.import(slf.py(), "losnav.attitude_determination", "describe")?.call1((slf,))?.extract()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, this) = (slf.py(), slf.get());
        let restore = slf.get_type().getattr("_restore")?;
        let packed: Vec<f64> = this.each().flat_map(Record::pack).collect();
        let state = PyTuple::new(
            py,
            [
                PyList::new(py, this.shape())?.into_any(),
                matches!(this.records, Records::One(_)).into_pyobject(py)?.to_owned().into_any(),
                convert::array(py, &[packed.len()], packed)?,
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
        inliers: Option<Vec<bool>>,
    ) -> PyResult<Self> {
        let floats = Floats::new(records, "state")?;
        let records: Vec<Record> = floats.data().as_chunks().0.iter().map(Record::unpack).collect();
        if !single {
            return Ok(Self::many(shape, vec![records], inliers));
        }
        let first = records.first().ok_or_else(|| PyValueError::new_err("empty state"))?;
        Ok(Self::one(*first, inliers))
    }
}
