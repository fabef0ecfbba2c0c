//! The arguments of an attitude determination: shapes, broadcasting, problems one by one.
use pyo3::prelude::*;

use crate::convert::{Floats, ScalarOrArray};
use crate::errors::{BadValue, InvalidInputError};
use crate::inputs::{Part, Rows, broadcast_into, triples};
use crate::values::check_unit;

/// The arguments, arrays kept alive.
pub struct Arguments<'py> {
    body: Floats<'py>,
    reference: Floats<'py>,
    sigma: ScalarOrArray<'py>,
}

impl<'py> Arguments<'py> {
    /// Reads the arrays.
    pub fn new(
        body: &Bound<'py, PyAny>,
        reference: &Bound<'py, PyAny>,
        sigma: &Bound<'py, PyAny>,
    ) -> PyResult<Self> {
        Ok(Self {
            body: Floats::new(body, "body")?,
            reference: Floats::new(reference, "reference")?,
            sigma: ScalarOrArray::new(sigma, "sigma")?,
        })
    }

    /// Checks the shapes and lays the problems out.
    pub fn problems(&self, minimum: usize) -> PyResult<Problems<'_>> {
        let body = Part::new("body", "(..., N, 3)", &self.body, &[None, Some(3)])?;
        let reference = Part::new("reference", "(N, 3) or (..., N, 3)", &self.reference, &[None, Some(3)])?;
        let n = body.core[0];
        if reference.core[0] != n {
            return Err(InvalidInputError::new_err(format!(
                "reference: expected one direction for each of the {n} of body, got {}",
                reference.core[0]
            )));
        }
        if n < minimum {
            return Err(InvalidInputError::new_err(format!(
                "body: expected at least {minimum} direction{}, got {n}",
                if minimum == 1 { "" } else { "s" }
            )));
        }
        let sigma = match &self.sigma {
            ScalarOrArray::Scalar(_) => None,
            ScalarOrArray::Array(a) => {
                // One number for each problem is as good as one for each direction.
                let width = if a.shape().last() == Some(&1) { 1 } else { n };
                Some(Part::new(
                    "sigma",
                    &format!("scalar, ({n},), (..., {n}) or (..., 1)"),
                    a,
                    &[Some(width)],
                )?)
            }
        };
        let mut shape = Vec::new();
        for part in [Some(&body), Some(&reference), sigma.as_ref()].into_iter().flatten() {
            broadcast_into(&mut shape, part.lead, part.name)?;
        }
        let noise = match (sigma, &self.sigma) {
            (Some(part), _) => Noise::Sigma(part.rows(&shape)),
            (None, ScalarOrArray::Scalar(sigma)) => Noise::Common(*sigma),
            (None, ScalarOrArray::Array(_)) => Noise::Common(f64::NAN),
        };
        Ok(Problems {
            n,
            count: shape.iter().product(),
            single: shape.is_empty(),
            body: body.rows(&shape),
            reference: reference.rows(&shape),
            noise,
            shape,
        })
    }
}

/// Noise of the directions.
pub enum Noise<'a> {
    /// One standard deviation for all.
    Common(f64),
    /// One for each direction, or for each problem.
    Sigma(Rows<'a>),
}

/// Every problem of a call.
pub struct Problems<'a> {
    /// Directions in each.
    pub n: usize,
    /// How many problems.
    pub count: usize,
    /// No leading dimension at all.
    pub single: bool,
    /// Leading dimensions.
    pub shape: Vec<usize>,
    /// `(N, 3)` each.
    pub body: Rows<'a>,
    /// `(N, 3)` each.
    pub reference: Rows<'a>,
    /// Noise.
    pub noise: Noise<'a>,
}

/// One problem, values checked, directions normalised.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// `(N, 3)`, unit.
    pub body: &'a [[f64; 3]],
    /// `(N, 3)`, unit.
    pub reference: &'a [[f64; 3]],
    /// `1/σ²`, one for each direction or one for all; infinite for an exact direction.
    pub weights: &'a [f64],
}

/// Room for what a problem needs beyond the arguments' memory; reused from one problem to the next.
#[derive(Default)]
pub struct Scratch {
    body: Vec<[f64; 3]>,
    reference: Vec<[f64; 3]>,
    weights: Vec<f64>,
    /// One weight for all directions: no heap for the commonest case.
    common: [f64; 1],
}

impl Problems<'_> {
    /// Checks problem `k` and gives it in the solver's form.
    pub fn get<'s>(&'s self, k: usize, scratch: &'s mut Scratch) -> Result<Problem<'s>, BadValue> {
        let Scratch { body, reference, weights, common } = scratch;
        let body = check_unit("body", triples(self.body.of(k)), body)?;
        let reference = check_unit("reference", triples(self.reference.of(k)), reference)?;
        let weights = match &self.noise {
            Noise::Common(sigma) => {
                *common = [weight(*sigma, 0)?];
                if common[0] == f64::INFINITY && self.n > 1 {
                    return Err(BadValue::ExactTwice { first: 0, second: 1 });
                }
                &common[..]
            }
            Noise::Sigma(rows) => {
                weights.clear();
                let mut exact = None;
                for (row, sigma) in rows.of(k).iter().enumerate() {
                    let one = weight(*sigma, row)?;
                    if one == f64::INFINITY {
                        if let Some(first) = exact {
                            return Err(BadValue::ExactTwice { first, second: row });
                        }
                        exact = Some(row);
                    }
                    weights.push(one);
                }
                if exact.is_some() && weights.len() < self.n {
                    return Err(BadValue::ExactTwice { first: 0, second: 1 });
                }
                &weights[..]
            }
        };
        Ok(Problem { body, reference, weights })
    }
}

/// `1/σ²`, infinite for zero.
fn weight(sigma: f64, row: usize) -> Result<f64, BadValue> {
    let weight = 1.0 / (sigma * sigma);
    let plain = sigma > 0.0 && weight.is_finite() && weight > 0.0;
    if plain || sigma == 0.0 {
        Ok(weight)
    } else {
        Err(BadValue::Negative { argument: "sigma", row, value: sigma })
    }
}
