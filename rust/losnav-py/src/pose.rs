//! `solve_pose`: one problem straight through, a batch over the cores with the GIL released.
use losnav_core::estimators::least_squares::{Method, Options, Outcome, Parametrization, PoseState, solve};
use losnav_core::estimators::loss::{Loss, Robust, RobustKind, Squared};
use losnav_core::estimators::pose::LosObjective;
use losnav_core::models::sensors::LineOfSight;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::errors::{BadValue, InvalidInputError, choice_error};
use crate::inputs::{Arguments, Problem, Problems, Scratch};
use crate::solution::{Landmarks, PoseSolution, Record};

/// Problems solved by one thread before it asks for more.
const CHUNK: usize = 64;

/// Settings of a solve beyond the arrays.
#[derive(Clone, Copy)]
pub struct Settings {
    options: Options,
    loss: Option<Robust>,
    raise: bool,
}

/// Best minimum first.
struct Solved {
    best: Record,
    others: Vec<Record>,
}

/// See `losnav.solve_pose`.
#[pyfunction]
#[pyo3(signature = (landmarks, los, sigma, covariance, guess, method, parametrization, loss, loss_scale, damping,
    max_iterations, cost_tolerance, step_tolerance, on_error, /))]
pub fn solve_pose(
    py: Python<'_>,
    landmarks: &Bound<'_, PyAny>,
    los: &Bound<'_, PyAny>,
    sigma: &Bound<'_, PyAny>,
    covariance: Option<&Bound<'_, PyAny>>,
    guess: Option<&Bound<'_, PyAny>>,
    method: &str,
    parametrization: &str,
    loss: &str,
    loss_scale: Option<f64>,
    damping: f64,
    max_iterations: u32,
    cost_tolerance: f64,
    step_tolerance: f64,
    on_error: &str,
) -> PyResult<PoseSolution> {
    let settings = Settings {
        options: Options {
            method: parse_method(method)?,
            parametrization: parse_parametrization(parametrization)?,
            damping: non_negative("damping", damping)?,
            max_iterations,
            cost_tolerance: non_negative("cost_tolerance", cost_tolerance)?,
            step_tolerance: non_negative("step_tolerance", step_tolerance)?,
        },
        loss: parse_loss(loss, loss_scale)?,
        raise: parse_on_error(on_error)?,
    };
    let arguments = Arguments::new(landmarks, los, sigma, covariance, guess)?;
    let problems = arguments.problems(3)?;
    if problems.single {
        let mut scratch = Scratch::default();
        let solved = match problems.get(0, &mut scratch) {
            Ok(problem) => solve_one(&problem, &settings),
            Err(bad) if settings.raise => return Err(bad.into_py(None)),
            Err(_) => Solved { best: Record::invalid(), others: Vec::new() },
        };
        return Ok(PoseSolution::one(solved.best, kept_landmarks(&problems), solved.others, None));
    }
    let solved = py.detach(|| solve_batch(&problems, &settings));
    let solved = solved.map_err(|(problem, bad)| bad.into_py(Some(problem)))?;
    let mut others = Vec::new();
    let mut records = Vec::with_capacity(solved.len());
    for (problem, one) in solved.into_iter().enumerate() {
        records.push(one.best);
        others.extend(one.others.into_iter().map(|record| (problem, record)));
    }
    Ok(PoseSolution::many(problems.shape.clone(), records, kept_landmarks(&problems), others, None))
}

fn kept_landmarks(problems: &Problems<'_>) -> Landmarks {
    Landmarks { data: problems.landmark_data().to_vec(), shape: problems.landmark_shape.to_vec() }
}

fn solve_batch(problems: &Problems<'_>, settings: &Settings) -> Result<Vec<Solved>, (usize, BadValue)> {
    let one = |scratch: &mut Scratch, k: usize| match problems.get(k, scratch) {
        Ok(problem) => Ok(solve_one(&problem, settings)),
        Err(bad) if settings.raise => Err((k, bad)),
        Err(_) => Ok(Solved { best: Record::invalid(), others: Vec::new() }),
    };
    (0..problems.count).into_par_iter().with_min_len(CHUNK).map_init(Scratch::default, one).collect()
}

fn solve_one(problem: &Problem<'_>, settings: &Settings) -> Solved {
    let sensor = LineOfSight { landmarks: problem.landmarks, los: problem.los, weights: problem.weights };
    match settings.loss {
        None => solve_with(&LosObjective { sensor, loss: Squared }, problem, settings),
        Some(loss) => solve_with(&LosObjective { sensor, loss }, problem, settings),
    }
}

fn solve_with<L: Loss>(
    objective: &LosObjective<'_, f64, L>,
    problem: &Problem<'_>,
    settings: &Settings,
) -> Solved {
    let [x, y, z, a, b, c] = problem.guess.unwrap_or_default();
    let outcome = solve(objective, &PoseState::from_mrp([x, y, z], [a, b, c]), &settings.options);
    Solved { best: record(objective, &outcome), others: Vec::new() }
}

fn record<L: Loss>(objective: &LosObjective<'_, f64, L>, outcome: &Outcome<f64>) -> Record {
    let chi2 = if L::CURVED { objective.chi2(&outcome.pose) } else { 2.0 * outcome.cost };
    let dof = 2.0 * objective.sensor.los.len() as f64 - 6.0;
    Record::new(outcome, chi2, dof)
}

fn parse_method(text: &str) -> PyResult<Method> {
    match text {
        "lm" => Ok(Method::LevenbergMarquardt),
        "gauss-newton" => Ok(Method::GaussNewton),
        other => Err(choice_error("method", r#""lm", "gauss-newton""#, other)),
    }
}

fn parse_parametrization(text: &str) -> PyResult<Parametrization> {
    match text {
        "rotation" => Ok(Parametrization::Rotation),
        "mrp" => Ok(Parametrization::Mrp),
        other => Err(choice_error("parametrization", r#""rotation", "mrp""#, other)),
    }
}

/// The default scales give 95 % efficiency on Gaussian residuals of two components (Holland & Welsch 1977 for the
/// scalar constants).
fn parse_loss(text: &str, scale: Option<f64>) -> PyResult<Option<Robust>> {
    let (kind, default) = match text {
        "squared" => return Ok(None),
        "huber" => (RobustKind::Huber, 1.345),
        "cauchy" => (RobustKind::Cauchy, 2.385),
        "tukey" => (RobustKind::Tukey, 4.685),
        "geman-mcclure" => (RobustKind::GemanMcClure, 3.0),
        other => {
            return Err(choice_error(
                "loss",
                r#""squared", "huber", "cauchy", "tukey", "geman-mcclure""#,
                other,
            ));
        }
    };
    let scale = scale.unwrap_or(default);
    if scale > 0.0 && scale.is_finite() {
        Ok(Some(Robust { kind, scale }))
    } else {
        Err(InvalidInputError::new_err(format!("loss_scale: expected a positive finite number, got {scale}")))
    }
}

/// `"raise"` is true.
pub fn parse_on_error(text: &str) -> PyResult<bool> {
    match text {
        "raise" => Ok(true),
        "nan" => Ok(false),
        other => Err(choice_error("on_error", r#""raise", "nan""#, other)),
    }
}

/// A tolerance or a damping.
pub fn non_negative(argument: &str, value: f64) -> PyResult<f64> {
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(InvalidInputError::new_err(format!("{argument}: expected a finite number >= 0, got {value}")))
    }
}
