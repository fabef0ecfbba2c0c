//! Private engine of the Python package `losnav`.
use pyo3::prelude::*;

#[pymodule(gil_used = false)]
mod _core {}
