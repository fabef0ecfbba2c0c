//! The arguments of an attitude determination: shapes, broadcasting, problems one by one.
use losnav_core::math::vec3::Mat3;
use losnav_core::models::linearization::Weight;
use pyo3::prelude::*;

use crate::convert::{Floats, ScalarOrArray};
use crate::errors::{BadValue, InvalidInputError};
use crate::inputs::{NoiseArgument, Part, Rows, broadcast_into, noise_part, triples};
use crate::values::{check_unit, full_weight};

/// The arguments, arrays kept alive.
pub struct Arguments<'py> {
    body: Floats<'py>,
    reference: Floats<'py>,
    noise: NoiseArgument<'py>,
}

impl<'py> Arguments<'py> {
    /// Reads the arrays.
    pub fn new(
        body: &Bound<'py, PyAny>,
        reference: &Bound<'py, PyAny>,
        sigma: &Bound<'py, PyAny>,
        covariance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let noise = match covariance {
            Some(value) => NoiseArgument::Covariance(Floats::new(value, "covariance")?),
            None => NoiseArgument::Sigma(ScalarOrArray::new(sigma, "sigma")?),
        };
        Ok(Self { body: Floats::new(body, "body")?, reference: Floats::new(reference, "reference")?, noise })
    }

    /// Checks the shapes and lays the problems out.
    pub fn problems(&self, minimum: usize, exact: Exact) -> PyResult<Problems<'_>> {
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
        let noise = noise_part(&self.noise, n)?;
        let mut shape = Vec::new();
        for part in [Some(&body), Some(&reference), noise.as_ref().ok()].into_iter().flatten() {
            broadcast_into(&mut shape, part.lead, part.name)?;
        }
        let full = matches!(self.noise, NoiseArgument::Covariance(_));
        let noise = match noise {
            Err(sigma) => Noise::Common(sigma),
            Ok(part) if full => Noise::Covariance(part.rows(&shape)),
            Ok(part) => Noise::Sigma(part.rows(&shape)),
        };
        Ok(Problems {
            n,
            count: shape.iter().product(),
            single: shape.is_empty(),
            body: body.rows(&shape),
            reference: reference.rows(&shape),
            noise,
            exact,
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
    /// A 3×3 covariance for each direction.
    Covariance(Rows<'a>),
}

/// May one direction have no noise at all?
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exact {
    /// Yes: a constraint.
    Allowed,
    /// No: whether it is wrong could not be asked.
    Refused,
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
    /// May one direction be exact?
    exact: Exact,
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
    /// `S` with `SᵀS = R⁻¹` for each direction, if they were given covariances; the weights are the means of `R⁻¹` then.
    pub roots: &'a [Mat3<f64>],
}

/// Room for what a problem needs beyond the arguments' memory; reused from one problem to the next.
#[derive(Default)]
pub struct Scratch {
    body: Vec<[f64; 3]>,
    reference: Vec<[f64; 3]>,
    weights: Vec<f64>,
    roots: Vec<Mat3<f64>>,
    /// One weight for all directions: no heap for the commonest case.
    common: [f64; 1],
}

impl Problems<'_> {
    /// Checks problem `k` and gives it in the solver's form.
    pub fn get<'s>(&'s self, k: usize, scratch: &'s mut Scratch) -> Result<Problem<'s>, BadValue> {
        let Scratch { body, reference, weights, roots, common } = scratch;
        let body = check_unit("body", triples(self.body.of(k)), body)?;
        let reference = check_unit("reference", triples(self.reference.of(k)), reference)?;
        roots.clear();
        weights.clear();
        match &self.noise {
            Noise::Common(sigma) => {
                *common = [self.weight(*sigma, 0)?];
                self.check_exact(common)?;
                return Ok(Problem { body, reference, weights: &common[..], roots: &roots[..] });
            }
            Noise::Sigma(rows) => {
                for (row, sigma) in rows.of(k).iter().enumerate() {
                    weights.push(self.weight(*sigma, row)?);
                }
                self.check_exact(weights)?;
            }
            Noise::Covariance(rows) => {
                for (row, (entries, b)) in rows.of(k).as_chunks::<9>().0.iter().zip(body).enumerate() {
                    if let Weight::Full(root) = full_weight(entries, b, row)? {
                        weights.push(root.iter().flatten().map(|x| x * x).sum::<f64>() / 3.0);
                        roots.push(root);
                    }
                }
            }
        }
        Ok(Problem { body, reference, weights: &weights[..], roots: &roots[..] })
    }

    /// `1/σ²`, infinite for zero.
    fn weight(&self, sigma: f64, row: usize) -> Result<f64, BadValue> {
        let weight = 1.0 / (sigma * sigma);
        if sigma > 0.0 && weight.is_finite() && weight > 0.0 {
            return Ok(weight);
        }
        match self.exact {
            Exact::Allowed if sigma == 0.0 => Ok(f64::INFINITY),
            Exact::Allowed => Err(BadValue::Negative { argument: "sigma", row, value: sigma }),
            Exact::Refused => Err(BadValue::NotPositive { argument: "sigma", row, value: sigma }),
        }
    }

    /// One exact direction at most; a weight that serves all of several is none.
    fn check_exact(&self, weights: &[f64]) -> Result<(), BadValue> {
        let mut exact = weights.iter().enumerate().filter(|(_, w)| **w == f64::INFINITY).map(|(row, _)| row);
        match (exact.next(), exact.next()) {
            (Some(first), Some(second)) => Err(BadValue::ExactTwice { first, second }),
            (Some(_), None) if weights.len() < self.n => Err(BadValue::ExactTwice { first: 0, second: 1 }),
            _ => Ok(()),
        }
    }
}
