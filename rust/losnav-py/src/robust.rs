//! `solve_pose_robust`: the pose most lines of sight agree with.
use losnav_core::estimators::least_squares::{Method, Options, Parametrization};
use losnav_core::estimators::loss::Squared;
use losnav_core::estimators::pose::LosObjective;
use losnav_core::estimators::robust::{RobustOptions, RobustOutcome, solve_robust};
use losnav_core::models::sensors::LineOfSight;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::errors::{BadValue, option_error};
use crate::inputs::{Arguments, Problem, Problems, Repeats, Scratch};
use crate::pose::{kept_landmarks, number, parse_on_error, whole};
use crate::solution::{PoseSolution, Record};

/// Spreads the seeds of a batch: 2⁶⁴ over the golden ratio.
pub const SEED_STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// Largest coordinate whose powers the search can form without a second thought.
const PLAIN: f64 = 1e30;

/// See `losnav.solve_pose_robust`.
#[pyfunction]
#[pyo3(signature = (landmarks, los, sigma, covariance, max_outlier_ratio, confidence, inlier_probability, seed,
    max_iterations, on_error, /))]
pub fn solve_pose_robust(
    py: Python<'_>,
    landmarks: &Bound<'_, PyAny>,
    los: &Bound<'_, PyAny>,
    sigma: &Bound<'_, PyAny>,
    covariance: Option<&Bound<'_, PyAny>>,
    max_outlier_ratio: &Bound<'_, PyAny>,
    confidence: &Bound<'_, PyAny>,
    inlier_probability: &Bound<'_, PyAny>,
    seed: &Bound<'_, PyAny>,
    max_iterations: &Bound<'_, PyAny>,
    on_error: &str,
) -> PyResult<PoseSolution> {
    let polish = Options {
        method: Method::LevenbergMarquardt,
        parametrization: Parametrization::Rotation,
        damping: 1e-3,
        max_iterations: whole("max_iterations", max_iterations)?,
        cost_tolerance: 1e-12,
        step_tolerance: 1e-12,
    };
    let options = RobustOptions {
        gate: (-2.0 * (-ratio("inlier_probability", inlier_probability, false)?).ln_1p()).sqrt(),
        max_outlier_ratio: ratio("max_outlier_ratio", max_outlier_ratio, true)?,
        confidence: ratio("confidence", confidence, false)?,
        seed: whole("seed", seed)?,
        polish,
    };
    let raise = parse_on_error(on_error)?;
    let arguments = Arguments::new(landmarks, los, sigma, covariance, None)?;
    let problems = arguments.problems(3, Repeats::Allowed)?;
    let solved = py.detach(|| solve_all(&problems, &options, raise));
    let solved = solved.map_err(|(k, bad)| bad.into_py((!problems.single).then_some(k)))?;
    let mut inliers = Vec::with_capacity(problems.count * problems.n);
    let mut records = Vec::with_capacity(problems.count);
    let mut others = Vec::new();
    for (k, one) in solved.into_iter().enumerate() {
        inliers.extend(one.inliers);
        records.push(one.best);
        others.extend(one.other.map(|record| (k, record)));
    }
    let landmarks = kept_landmarks(&problems);
    match records.as_slice() {
        [only] if problems.single => {
            let others = others.into_iter().map(|(_, record)| record).collect();
            Ok(PoseSolution::one(*only, landmarks, others, Some(inliers)))
        }
        _ => Ok(PoseSolution::many(problems.shape.clone(), records, landmarks, others, Some(inliers))),
    }
}

struct Robust {
    best: Record,
    other: Option<Record>,
    inliers: Vec<bool>,
}

fn solve_all(
    problems: &Problems<'_>,
    options: &RobustOptions,
    raise: bool,
) -> Result<Vec<Robust>, (usize, BadValue)> {
    let one = |scratch: &mut Scratch, k: usize| match problems.get(k, scratch) {
        Ok(problem) => {
            let seed = options.seed.wrapping_add((k as u64).wrapping_mul(SEED_STEP));
            Ok(solve_one(&problem, &RobustOptions { seed, ..*options }))
        }
        Err(bad) if raise => Err((k, bad)),
        Err(_) => Ok(Robust { best: Record::invalid(), other: None, inliers: vec![false; problems.n] }),
    };
    (0..problems.count).into_par_iter().map_init(Scratch::default, one).collect()
}

fn solve_one(problem: &Problem<'_>, options: &RobustOptions) -> Robust {
    let largest = problem.landmarks.iter().flatten().fold(0.0_f64, |m, c| m.max(c.abs()));
    if largest == 0.0 || (1.0 / PLAIN..PLAIN).contains(&largest) {
        return solve_plain(problem, options);
    }
    // A unit of length in which squares or cubes leave the range of numbers: solve in a better one.
    let landmarks: Vec<[f64; 3]> = problem.landmarks.iter().map(|l| l.map(|c| c / largest)).collect();
    let scaled = Problem { landmarks: &landmarks, ..*problem };
    let Robust { best, other, inliers } = solve_plain(&scaled, options);
    let back = |record: Record| record.in_unit(largest);
    Robust { best: back(best), other: other.map(back), inliers }
}

fn solve_plain(problem: &Problem<'_>, options: &RobustOptions) -> Robust {
    let sensor = problem.sensor();
    let mut inliers = vec![false; problem.los.len()];
    let Some(found) = solve_robust(&sensor, options, &mut inliers) else {
        return Robust { best: Record::undetermined(problem.los.len()), other: None, inliers };
    };
    let best = record(problem, &found, &inliers);
    let other = found.alternative.map(|outcome| {
        let as_best = RobustOutcome { solution: outcome, converged: outcome.converged, ..found };
        record(problem, &as_best, &inliers)
    });
    Robust { best, other, inliers }
}

/// `χ²` and its degrees of freedom are those of the inliers.
fn record(problem: &Problem<'_>, found: &RobustOutcome, inliers: &[bool]) -> Record {
    let pose = &found.solution.pose;
    let (mut chi2, mut count) = (0.0, 0.0);
    for (index, _) in inliers.iter().enumerate().filter(|(_, inside)| **inside) {
        let weight = index.min(problem.weights.len().saturating_sub(1));
        let one = LineOfSight {
            landmarks: problem.landmarks.get(index..=index).unwrap_or(&[]),
            los: problem.los.get(index..=index).unwrap_or(&[]),
            weights: problem.weights.get(weight..=weight).unwrap_or(&[]),
        };
        chi2 += LosObjective { sensor: one, loss: Squared }.chi2(pose);
        count += 1.0;
    }
    let dof = f64::max(2.0 * count - 6.0, 0.0);
    Record { converged: found.converged, ..Record::new(&found.solution, chi2, dof) }
}

/// A number in (0, 1), or [0, 1) where zero has a meaning.
pub fn ratio(argument: &str, value: &Bound<'_, PyAny>, zero: bool) -> PyResult<f64> {
    let expected = if zero { "0 <= x < 1" } else { "0 < x < 1" };
    let number = number(argument, expected, value)?;
    if number < 1.0 && (number > 0.0 || zero && number == 0.0) {
        Ok(number)
    } else {
        Err(option_error(argument, expected, value))
    }
}
