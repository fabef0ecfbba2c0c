//! `solve_attitude_robust`: the attitude most directions agree with.
use losnav_core::estimators::wahba::careful::Solution;
use losnav_core::estimators::wahba::robust::{self, RobustOptions};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::attitude_solution::{AttitudeSolution, Record};
use crate::errors::BadValue;
use crate::pose::{parse_on_error, whole};
use crate::robust::{SEED_STEP, ratio};
use crate::wahba_inputs::{Arguments, Exact, Problem, Problems, Scratch};

/// See `losnav.solve_attitude_robust`.
#[pyfunction]
#[pyo3(signature = (body, reference, sigma, max_outlier_ratio, confidence, inlier_probability, seed, on_error, /))]
pub fn solve_attitude_robust(
    py: Python<'_>,
    body: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    sigma: &Bound<'_, PyAny>,
    max_outlier_ratio: &Bound<'_, PyAny>,
    confidence: &Bound<'_, PyAny>,
    inlier_probability: &Bound<'_, PyAny>,
    seed: &Bound<'_, PyAny>,
    on_error: &str,
) -> PyResult<AttitudeSolution> {
    let options = RobustOptions {
        gate: (-2.0 * (-ratio("inlier_probability", inlier_probability, false)?).ln_1p()).sqrt(),
        max_outlier_ratio: ratio("max_outlier_ratio", max_outlier_ratio, true)?,
        confidence: ratio("confidence", confidence, false)?,
        seed: whole("seed", seed)?,
    };
    let raise = parse_on_error(on_error)?;
    let arguments = Arguments::new(body, reference, sigma, None)?;
    let problems = arguments.problems(2, Exact::Refused)?;
    let solved = py.detach(|| solve_all(&problems, &options, raise));
    let solved = solved.map_err(|(k, bad)| bad.into_py((!problems.single).then_some(k)))?;
    let mut inliers = Vec::with_capacity(problems.count * problems.n);
    let mut records = Vec::with_capacity(problems.count);
    for (record, kept) in solved {
        inliers.extend(kept.iter().map(|weight| *weight > 0.0));
        records.push(record);
    }
    match records.as_slice() {
        [only] if problems.single => Ok(AttitudeSolution::one(*only, Some(inliers))),
        _ => Ok(AttitudeSolution::many(problems.shape, vec![records], Some(inliers))),
    }
}

/// One solution, and the weights of the directions it kept.
type Kept = (Record, Vec<f64>);

fn solve_all(
    problems: &Problems<'_>,
    options: &RobustOptions,
    raise: bool,
) -> Result<Vec<Kept>, (usize, BadValue)> {
    let one = |scratch: &mut Scratch, k: usize| match problems.get(k, scratch) {
        Ok(problem) => {
            let seed = options.seed.wrapping_add((k as u64).wrapping_mul(SEED_STEP));
            Ok(solve_one(&problem, &RobustOptions { seed, ..*options }))
        }
        Err(bad) if raise => Err((k, bad)),
        Err(_) => Ok((Record::invalid(), vec![0.0; problems.n])),
    };
    (0..problems.count).into_par_iter().map_init(Scratch::default, one).collect()
}

fn solve_one(problem: &Problem<'_>, options: &RobustOptions) -> Kept {
    let Problem { body, reference, weights, .. } = *problem;
    let mut kept = vec![0.0; body.len()];
    let found = robust::solve(&robust::Problem { body, reference, weights }, options, &mut kept);
    let (solution, inliers) = match found {
        Some(found) => (found.solution, found.inliers),
        None => (Solution::invalid(), 0),
    };
    (Record::new(&solution, inliers), kept)
}
