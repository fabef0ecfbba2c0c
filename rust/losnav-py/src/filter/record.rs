//! `ArcRecord`: what whole arcs left behind, kept as the lanes wrote it and put in order when asked for.
use pyo3::prelude::*;
use rayon::prelude::*;

use super::arcs::Layout;
use super::engine::{Engine, Passage};
use crate::convert::{self, Buffer};

/// See `losnav.filters.FilterLog`.
#[pyclass(frozen, module = "losnav._core")]
pub struct ArcRecord {
    pub data: Buffer,
    pub layout: Layout,
    pub runs: usize,
    pub epochs: usize,
    pub lanes: usize,
    /// Degrees of freedom of each sensor.
    pub freedom: Vec<usize>,
    /// Do covariances stand in it as they are, not in the form of the filter?
    pub plain: bool,
    /// Is there an axis for the runs?
    pub batch: bool,
    /// What it takes to go back over the arcs.
    pub engine: Box<dyn Engine>,
    pub passage: Passage,
}

/// Numbers in a result below which threads cost more than they save.
const SERIAL: usize = 1 << 16;

impl ArcRecord {
    fn at(&self, data: &[f64], run: usize, epoch: usize, entry: usize) -> f64 {
        let (group, lane) = (run / self.lanes, run % self.lanes);
        let index = ((group * self.epochs + epoch) * self.layout.entries() + entry) * self.lanes + lane;
        data.get(index).copied().unwrap_or(f64::NAN)
    }

    /// `(runs, T, …)` with the entries that `entry` names.
    fn collect<T: Copy + Default + Send>(
        &self,
        size: usize,
        each: impl Fn(usize, usize, usize) -> T + Sync,
    ) -> Vec<T> {
        self.rows_of(size, |run, epoch, values| {
            for (k, value) in values.iter_mut().enumerate() {
                *value = each(run, epoch, k);
            }
        })
    }

    /// `(runs, T, …)`, row by row.
    fn rows_of<T: Copy + Default + Send>(
        &self,
        size: usize,
        each: impl Fn(usize, usize, &mut [T]) + Sync,
    ) -> Vec<T> {
        let mut out = vec![T::default(); self.runs * self.epochs * size];
        let fill = |(row, values): (usize, &mut [T])| each(row / self.epochs, row % self.epochs, values);
        if out.len() < SERIAL {
            out.chunks_mut(size.max(1)).enumerate().for_each(fill);
        } else {
            out.par_chunks_mut(size.max(1)).with_min_len(64).enumerate().for_each(fill);
        }
        out
    }

    fn shape(&self, inner: &[usize]) -> Vec<usize> {
        let mut shape = if self.batch { vec![self.runs] } else { Vec::new() };
        shape.push(self.epochs);
        shape.extend(inner);
        shape
    }
}

#[pymethods]
impl ArcRecord {
    /// Numbers in the measurement of each sensor.
    #[getter]
    fn rows(&self) -> Vec<usize> {
        self.layout.rows.clone()
    }

    /// Degrees of freedom of each sensor's measurement.
    #[getter]
    fn dof(&self) -> Vec<usize> {
        self.freedom.clone()
    }

    /// `(..., T, N)`.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (n, data) = (self.layout.size, self.data.data(py));
        let data = py.detach(|| self.collect(n, |run, epoch, k| self.at(data, run, epoch, k)));
        convert::array(py, &self.shape(&[n]), data)
    }

    /// `(..., T, N, N)`.
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (n, data) = (self.layout.size, self.data.data(py));
        let whole = |run: usize, epoch: usize, out: &mut [f64]| {
            if self.plain {
                for i in 0..n {
                    for j in i..n {
                        let at = self.layout.covariance() + i * n - i * (i + 1) / 2 + j;
                        out[i * n + j] = self.at(data, run, epoch, at);
                        out[j * n + i] = out[i * n + j];
                    }
                }
            } else {
                let stored: Vec<f64> = (0..self.layout.nis()).map(|k| self.at(data, run, epoch, k)).collect();
                out.copy_from_slice(&self.engine.matrix(&stored));
            }
        };
        let data = py.detach(|| self.rows_of(n * n, whole));
        convert::array(py, &self.shape(&[n, n]), data)
    }

    /// `(..., T, sensors)`.
    fn nis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (from, sensors) = (self.layout.nis(), self.layout.rows.len());
        let data = self.data.data(py);
        let data = py.detach(|| self.collect(sensors, |run, epoch, k| self.at(data, run, epoch, from + k)));
        convert::array(py, &self.shape(&[sensors]), data)
    }

    /// `(..., T, sensors)`.
    fn accepted<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (from, sensors) = (self.layout.accepted(), self.layout.rows.len());
        let data = self.data.data(py);
        let data =
            py.detach(|| self.collect(sensors, |run, epoch, k| self.at(data, run, epoch, from + k) != 0.0));
        convert::array(py, &self.shape(&[sensors]), data)
    }

    /// `(..., T, M)`, the sensors one after another.
    fn innovation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let (from, rows) = (self.layout.innovation(), self.layout.rows.iter().sum());
        let data = self.data.data(py);
        let data = py.detach(|| self.collect(rows, |run, epoch, k| self.at(data, run, epoch, from + k)));
        convert::array(py, &self.shape(&[rows]), data)
    }

    /// The record after Rauch, Tung & Striebel: states and covariances smoothed, the rest as it was.
    fn smooth(&self, py: Python<'_>) -> Self {
        let before = self.data.data(py);
        let data = py.detach(|| self.engine.smooth(self, before));
        Self {
            data: Buffer::new(py, data),
            layout: self.layout.clone(),
            runs: self.runs,
            epochs: self.epochs,
            lanes: self.lanes,
            freedom: self.freedom.clone(),
            plain: true,
            batch: self.batch,
            engine: self.engine.duplicate(),
            passage: self.passage.clone(),
        }
    }
}
