//! The only file that names `numpy`: arrays in, arrays out.
pub use numpy::Element as Entry;
use numpy::{PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods, ndarray::IxDyn};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyFloat;

/// An argument as float64 in C order.
pub struct Floats<'py>(Bound<'py, PyArrayDyn<f64>>);

impl<'py> Floats<'py> {
    /// Takes the array as it is if it is float64, aligned and in C order, else through `losnav._arrays.as_float64`.
    pub fn new(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        if let Ok(array) = value.cast::<PyArrayDyn<f64>>()
            && array.is_c_contiguous()
            && array.data().is_aligned()
        {
            return Ok(Self(array.clone()));
        }
        Self::coerce(value, name)
    }

    #[cold]
    fn coerce(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        static AS_FLOAT64: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
        let function = AS_FLOAT64.import(value.py(), "losnav._arrays", "as_float64")?;
        let array = function.call1((value, name))?;
        Ok(Self(array.cast_into::<PyArrayDyn<f64>>()?))
    }

    /// Dimensions.
    pub fn shape(&self) -> &[usize] {
        self.0.shape()
    }

    /// The numbers in C order.
    pub fn data(&self) -> &[f64] {
        // SAFETY: the array is contiguous and aligned (checked on entry) and kept alive by `self`. Like every
        // NumPy extension we rely on the caller not writing to an argument from another thread during the call.
        unsafe { self.0.as_slice() }.unwrap_or(&[])
    }
}

/// A scalar or an array.
pub enum ScalarOrArray<'py> {
    /// One number.
    Scalar(f64),
    /// Several.
    Array(Floats<'py>),
}

impl<'py> ScalarOrArray<'py> {
    /// A Python float is read directly; everything else is an array argument.
    pub fn new(value: &Bound<'py, PyAny>, name: &str) -> PyResult<Self> {
        if let Ok(number) = value.cast_exact::<PyFloat>() {
            return Ok(Self::Scalar(number.value()));
        }
        let array = Floats::new(value, name)?;
        if array.shape().is_empty() {
            return Ok(Self::Scalar(array.data().first().copied().unwrap_or(f64::NAN)));
        }
        Ok(Self::Array(array))
    }
}

/// Numbers in NumPy's keeping: it asks for large pages, which a long record fills several times as fast.
pub struct Buffer(Py<PyArray1<f64>>);

impl Buffer {
    /// All zero.
    pub fn zeros(py: Python<'_>, count: usize) -> Self {
        Self(PyArray1::zeros(py, count, false).unbind())
    }

    /// From numbers.
    pub fn new(py: Python<'_>, data: Vec<f64>) -> Self {
        Self(PyArray1::from_vec(py, data).unbind())
    }

    /// To read.
    pub fn data<'a>(&'a self, py: Python<'_>) -> &'a [f64] {
        let array = self.0.bind(py);
        // SAFETY: contiguous, and nobody but this object has the array, which lives as long as it does.
        unsafe { core::slice::from_raw_parts(array.data(), array.len()) }
    }

    /// To fill.
    pub fn data_mut<'a>(&'a mut self, py: Python<'_>) -> &'a mut [f64] {
        let array = self.0.bind(py);
        // SAFETY: as above, and `self` is borrowed mutably.
        unsafe { core::slice::from_raw_parts_mut(array.data(), array.len()) }
    }
}

/// A new array of this shape from numbers in C order.
pub fn array<'py, T: Entry>(py: Python<'py>, shape: &[usize], data: Vec<T>) -> PyResult<Bound<'py, PyAny>> {
    let flat = PyArray::from_vec(py, data);
    Ok(flat.reshape(IxDyn(shape))?.into_any())
}

/// A new array of Python objects.
pub fn objects<'py>(py: Python<'py>, shape: &[usize], data: Vec<Py<PyAny>>) -> PyResult<Bound<'py, PyAny>> {
    array(py, shape, data)
}
