//! The exceptions, which live in Python (`losnav.errors`), and the one sentence each.
use pyo3::prelude::*;

pyo3::import_exception!(losnav.errors, DegenerateGeometryError);
pyo3::import_exception!(losnav.errors, InvalidInputError);
pyo3::import_exception!(losnav.errors, NumericalError);

/// A rule broken by one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BadValue {
    /// NaN or infinite.
    NotFinite { argument: &'static str, row: usize, column: usize, value: f64 },
    /// A coordinate whose powers leave the range of numbers.
    TooLarge { row: usize, column: usize, value: f64 },
    /// A direction whose norm is not one.
    NotUnit { argument: &'static str, row: usize, norm: f64 },
    /// A noise standard deviation that is not positive.
    NotPositive { argument: &'static str, row: usize, value: f64 },
    /// A noise standard deviation below zero.
    Negative { argument: &'static str, row: usize, value: f64 },
    /// Two exact directions: one constraint too many.
    ExactTwice { first: usize, second: usize },
    /// Two landmarks in one place.
    Duplicate { first: usize, second: usize },
    /// A covariance that is not symmetric positive (semi)definite.
    NotCovariance { argument: &'static str, row: usize },
}

impl BadValue {
    /// The exception, `problem` being the index in the batch if there is one.
    pub fn into_py(self, problem: Option<usize>) -> PyErr {
        let at = problem.map_or(String::new(), |k| format!(" (problem {k} of the batch)"));
        let text = match self {
            Self::NotFinite { argument, row, column, value } => {
                format!("{argument}[{row}, {column}]: expected a finite number, got {value}{at}")
            }
            Self::TooLarge { row, column, value } => {
                format!(
                    "landmarks[{row}, {column}]: expected a coordinate within 1e150 of zero, got {value:e}{at}"
                )
            }
            Self::NotUnit { argument, row, norm } => {
                format!("{argument}[{row}]: expected a unit vector (tolerance 0.01), got norm {norm:.6}{at}")
            }
            Self::NotPositive { argument, row, value } => {
                format!("{argument}[{row}]: expected a positive finite number, got {value}{at}")
            }
            Self::Negative { argument, row, value } => {
                format!(
                    "{argument}[{row}]: expected a finite number >= 0, its inverse square too, got {value}{at}"
                )
            }
            Self::ExactTwice { first, second } => format!(
                "sigma[{second}]: expected a positive number, got 0; sigma[{first}] is 0 already, and only one \
                 direction can be exact{at}"
            ),
            Self::Duplicate { first, second } => {
                format!("landmarks[{second}]: duplicate of landmarks[{first}]; keep one of them{at}")
            }
            Self::NotCovariance { argument, row } => format!(
                "{argument}[{row}]: expected a symmetric positive definite matrix \
                 (or rank 2 with its null space along the line of sight){at}"
            ),
        };
        InvalidInputError::new_err(text)
    }
}

/// An argument of the wrong shape.
pub fn shape_error(argument: &str, expected: &str, got: &[usize]) -> PyErr {
    let got: Vec<String> = got.iter().map(ToString::to_string).collect();
    let comma = if got.len() == 1 { "," } else { "" };
    InvalidInputError::new_err(format!(
        "{argument}: expected shape {expected}, got ({}{comma})",
        got.join(", ")
    ))
}

/// An option that is not one of its values.
pub fn choice_error(argument: &str, expected: &str, got: &str) -> PyErr {
    InvalidInputError::new_err(format!("{argument}: expected one of {expected}, got {got:?}"))
}

/// An option of the wrong type or range.
pub fn option_error(argument: &str, expected: &str, got: &Bound<'_, PyAny>) -> PyErr {
    let got = got.repr().map_or_else(|_| String::from("something unprintable"), |text| text.to_string());
    InvalidInputError::new_err(format!("{argument}: expected {expected}, got {got}"))
}
