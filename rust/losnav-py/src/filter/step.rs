//! `Step`: what an update did. The innovation covariance and the gain are worked out when asked for.
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple};

use crate::convert::{self, Floats};

/// See `losnav.filters.Step`.
#[pyclass(frozen, module = "losnav._core")]
pub struct Step {
    sensor: Py<PyAny>,
    context: Py<PyDict>,
    size: usize,
    /// How many numbers the state is kept in.
    numbers: usize,
    /// State and upper triangle of the covariance before the measurement.
    prior: Vec<f64>,
    innovation: Vec<f64>,
    nis: f64,
    dof: usize,
    accepted: bool,
    used: Vec<bool>,
    underweighting: f64,
    consider: Vec<usize>,
    linear: PyOnceLock<(Py<PyAny>, Py<PyAny>)>,
}

/// What the lazy fields are made of.
pub struct Parts {
    pub sensor: Py<PyAny>,
    pub context: Py<PyDict>,
    pub size: usize,
    pub numbers: usize,
    pub prior: Vec<f64>,
    pub innovation: Vec<f64>,
    pub nis: f64,
    pub dof: usize,
    pub accepted: bool,
    pub used: Vec<bool>,
    pub underweighting: f64,
    pub consider: Vec<usize>,
}

impl From<Parts> for Step {
    fn from(p: Parts) -> Self {
        Self {
            sensor: p.sensor,
            context: p.context,
            size: p.size,
            numbers: p.numbers,
            prior: p.prior,
            innovation: p.innovation,
            nis: p.nis,
            dof: p.dof,
            accepted: p.accepted,
            used: p.used,
            underweighting: p.underweighting,
            consider: p.consider,
            linear: PyOnceLock::new(),
        }
    }
}

impl Step {
    fn array<'py>(&self, py: Python<'py>, shape: &[usize], data: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        convert::array(py, shape, data.to_vec())
    }

    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let state = self.array(py, &[self.numbers], &self.prior[..self.numbers])?;
        if self.numbers == self.size {
            return Ok(state);
        }
        py.import("losnav.navigation_state")?.getattr("NavState")?.call_method1("_of", (state,))
    }

    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (n, mut at) = (self.size, self.numbers);
        let mut whole = vec![0.0; n * n];
        for i in 0..n {
            for j in i..n {
                whole[i * n + j] = self.prior[at];
                whole[j * n + i] = self.prior[at];
                at += 1;
            }
        }
        convert::array(py, &[n, n], whole)
    }

    /// `(S, K)` of the linear update at the prior, by `losnav.filters.step.linear_update`.
    fn linear(&self, py: Python<'_>) -> PyResult<&(Py<PyAny>, Py<PyAny>)> {
        self.linear.get_or_try_init(py, || {
            let function = py.import("losnav.filters.step")?.getattr("linear_update")?;
            let arguments = (
                self.sensor.bind(py),
                self.context.bind(py),
                self.state(py)?,
                self.covariance(py)?,
                self.underweighting,
                self.consider.clone(),
            );
            function.call1(arguments)?.extract()
        })
    }
}

#[pymethods]
impl Step {
    #[new]
    #[pyo3(signature = (sensor, context, state, covariance, innovation, nis, dof, accepted, underweighting, consider, used=None, /))]
    fn new(
        sensor: Py<PyAny>,
        context: Py<PyDict>,
        state: &Bound<'_, PyAny>,
        covariance: &Bound<'_, PyAny>,
        innovation: &Bound<'_, PyAny>,
        nis: f64,
        dof: usize,
        accepted: bool,
        underweighting: f64,
        consider: Vec<usize>,
        used: Option<Vec<bool>>,
    ) -> PyResult<Self> {
        let numbers = |value, name| Ok::<_, PyErr>(Floats::new(value, name)?.data().to_vec());
        let state = match state.call_method0("_numbers") {
            Ok(kept) => kept,
            Err(_) => state.clone(),
        };
        let (mut prior, matrix) = (numbers(&state, "state")?, numbers(covariance, "covariance")?);
        let size = matrix.len().isqrt();
        let kept = prior.len();
        for i in 0..size {
            prior.extend(matrix.iter().skip(i * size + i).take(size - i));
        }
        Ok(Parts {
            sensor,
            context,
            size,
            numbers: kept,
            prior,
            innovation: numbers(innovation, "innovation")?,
            nis,
            dof,
            accepted,
            used: used.unwrap_or_default(),
            underweighting,
            consider,
        }
        .into())
    }

    /// `(M,)`.
    #[getter]
    fn innovation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.array(py, &[self.innovation.len()], &self.innovation)
    }

    /// `(M, M)`.
    #[getter]
    fn innovation_covariance(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.linear(py)?.0.clone_ref(py))
    }

    /// `(N, M)`.
    #[getter]
    fn gain(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        Ok(self.linear(py)?.1.clone_ref(py))
    }

    /// Normalised innovation squared.
    #[getter]
    fn nis(&self) -> f64 {
        self.nis
    }

    /// Degrees of freedom of `nis`.
    #[getter]
    fn dof(&self) -> usize {
        self.dof
    }

    /// Was the measurement used?
    #[getter]
    fn accepted(&self) -> bool {
        self.accepted
    }

    /// Which of the numbers were used, `(M,)`.
    #[getter]
    fn used<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let used =
            if self.used.is_empty() { vec![self.accepted; self.innovation.len()] } else { self.used.clone() };
        convert::array(py, &[used.len()], used)
    }

    /// State before the measurement, `(N,)`.
    #[getter]
    fn prior_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.state(py)
    }

    /// Covariance before the measurement, `(N, N)`.
    #[getter]
    fn prior_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.covariance(py)
    }

    fn __repr__(&self) -> String {
        let (nis, dof) = (self.nis, self.dof);
        let verdict = if self.accepted {
            "accepted"
        } else if nis.is_nan() {
            "no measurement"
        } else {
            "rejected"
        };
        format!("Step({verdict}, nis={nis:.4} with {dof} degrees of freedom)")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let arguments = (
            self.sensor.bind(py),
            self.context.bind(py),
            self.state(py)?,
            self.covariance(py)?,
            self.array(py, &[self.innovation.len()], &self.innovation)?,
            self.nis,
            self.dof,
            self.accepted,
            self.underweighting,
            self.consider.clone(),
            Some(self.used.clone()),
        );
        Ok((py.get_type::<Self>().into_any(), arguments.into_pyobject(py)?))
    }
}
