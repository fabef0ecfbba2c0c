//! `solve_pose`: one problem straight through, a batch over the cores with the GIL released.
use std::sync::Mutex;

use losnav_core::estimators::least_squares::{
    Method, Options, Outcome, Parametrization, PoseState, Termination,
};
use losnav_core::estimators::loss::{Loss, Robust, RobustKind, Squared};
use losnav_core::estimators::minimal::planar::turned_over;
use losnav_core::estimators::minimal::{Pose, candidates};
use losnav_core::estimators::pose::LosObjective;
use losnav_core::estimators::ranking::rank;
use losnav_core::math::rotation::quaternion_from_dcm;
use losnav_core::math::so3::dcm_from_quaternion;
use nalgebra::{Matrix3, Vector3};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::batch::{ManyPoses, ManyStarts, OnePose};
use crate::dispatch;
use crate::errors::{BadValue, InvalidInputError, choice_error, option_error};
use crate::inputs::{Arguments, Problem, Problems, Repeats, Scratch};
use crate::solution::{Landmarks, PoseSolution, Record};
use crate::threads::share_out;

/// Problems a thread takes at a time: a multiple of the lanes.
const CHUNK: usize = 256;
/// The same for guess-free problems, some tens of microseconds each.
const SERIAL_GUESS_FREE: usize = 8;
/// Landmarks in all below which threads cost more than they save (about 0.1 ms of work).
const SERIAL_LANDMARKS: usize = 4000;
/// Times `max_iterations` that a start of a guess-free solve may go on after its first round.
const VALLEY_ROUNDS: u32 = 40;
/// From here on eight landmarks at a time are faster than four.
const WIDE_LANDMARKS: usize = 64;
/// With more landmarks than this in each problem, they fill the lanes better than problems do.
const LANE_LANDMARKS: usize = 16;

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
    loss_scale: Option<&Bound<'_, PyAny>>,
    damping: &Bound<'_, PyAny>,
    max_iterations: &Bound<'_, PyAny>,
    cost_tolerance: &Bound<'_, PyAny>,
    step_tolerance: &Bound<'_, PyAny>,
    on_error: &str,
) -> PyResult<PoseSolution> {
    let settings = Settings {
        options: Options {
            method: parse_method(method)?,
            parametrization: parse_parametrization(parametrization)?,
            damping: non_negative("damping", damping)?,
            max_iterations: whole("max_iterations", max_iterations)?,
            cost_tolerance: non_negative("cost_tolerance", cost_tolerance)?,
            step_tolerance: non_negative("step_tolerance", step_tolerance)?,
        },
        loss: parse_loss(loss, loss_scale)?,
        raise: parse_on_error(on_error)?,
    };
    let arguments = Arguments::new(landmarks, los, sigma, covariance, guess)?;
    let problems = arguments.problems(3, Repeats::Refused)?;
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
    let (records, others) = solved.map_err(|(problem, bad)| bad.into_py(Some(problem)))?;
    Ok(PoseSolution::many(problems.shape.clone(), records, kept_landmarks(&problems), others, None))
}

/// What the solution keeps of the landmarks.
pub fn kept_landmarks(problems: &Problems<'_>) -> Landmarks {
    let (data, lead) = problems.landmarks.distinct_rows(problems.count);
    let mut shape = if lead { problems.shape.clone() } else { Vec::new() };
    shape.extend([problems.n, 3]);
    Landmarks { data, shape }
}

type Failure = (usize, BadValue);
type Batch = (Vec<Record>, Vec<(usize, Record)>);

fn solve_batch(problems: &Problems<'_>, settings: &Settings) -> Result<Batch, Failure> {
    if problems.guess.is_some() && problems.n <= LANE_LANDMARKS {
        let records = match settings.loss {
            None => solve_lanes(Squared, problems, settings),
            Some(loss) => solve_lanes(loss, problems, settings),
        };
        return Ok((records?, Vec::new()));
    }
    let one = |scratch: &mut Scratch, k: usize| solve_checked(problems, k, settings, scratch);
    let solved: Result<Vec<Solved>, Failure> = (0..problems.count)
        .into_par_iter()
        .with_min_len(SERIAL_GUESS_FREE)
        .map_init(Scratch::default, one)
        .collect();
    let mut batch = (Vec::with_capacity(problems.count), Vec::new());
    for (problem, solved) in solved?.into_iter().enumerate() {
        batch.0.push(solved.best);
        batch.1.extend(solved.others.into_iter().map(|record| (problem, record)));
    }
    Ok(batch)
}

/// A batch with guesses: several problems in the lanes, chunks of them over the cores.
fn solve_lanes<L: Loss>(
    loss: L,
    problems: &Problems<'_>,
    settings: &Settings,
) -> Result<Vec<Record>, Failure> {
    let mut records = vec![Record::invalid(); problems.count];
    let chunk = |(index, out): (usize, &mut [Record])| {
        let mut failure = Ok(());
        dispatch::wide(ManyPoses {
            problems,
            first: index * CHUNK,
            loss,
            options: &settings.options,
            out,
            one_by_one: |first: usize, slots: &mut [Record]| {
                let mut scratch = Scratch::default();
                for (k, slot) in slots.iter_mut().enumerate() {
                    match solve_checked(problems, first + k, settings, &mut scratch) {
                        Ok(solved) => *slot = solved.best,
                        Err(bad) if failure.is_ok() => failure = Err(bad),
                        Err(_) => {}
                    }
                }
            },
        });
        failure
    };
    if problems.count * problems.n < SERIAL_LANDMARKS {
        records.chunks_mut(CHUNK).enumerate().try_for_each(chunk)?;
    } else {
        let failures = Mutex::new(Vec::new());
        share_out(records.chunks_mut(CHUNK).enumerate(), |work| {
            if let (Err(failure), Ok(mut failures)) = (chunk(work), failures.lock()) {
                failures.push(failure);
            }
        });
        let failures = failures.into_inner().unwrap_or_default();
        if let Some(first) = failures.into_iter().min_by_key(|(problem, _)| *problem) {
            return Err(first);
        }
    }
    Ok(records)
}

fn solve_checked(
    problems: &Problems<'_>,
    k: usize,
    settings: &Settings,
    scratch: &mut Scratch,
) -> Result<Solved, Failure> {
    match problems.get(k, scratch) {
        Ok(problem) => Ok(solve_one(&problem, settings)),
        Err(bad) if settings.raise => Err((k, bad)),
        Err(_) => Ok(Solved { best: Record::invalid(), others: Vec::new() }),
    }
}

fn solve_one(problem: &Problem<'_>, settings: &Settings) -> Solved {
    match settings.loss {
        None => solve_with(Squared, problem, settings),
        Some(loss) => solve_with(loss, problem, settings),
    }
}

fn solve_with<L: Loss>(loss: L, problem: &Problem<'_>, settings: &Settings) -> Solved {
    let Some([x, y, z, a, b, c]) = problem.guess else { return solve_guess_free(loss, problem, settings) };
    let starts = [PoseState::from_mrp([x, y, z], [a, b, c])];
    let mut best = Record::invalid();
    let take = |outcome: Outcome<f64>| best = record(loss, problem, &outcome);
    let job = OnePose { problem, loss, options: &settings.options, starts: &starts, take };
    if problem.los.len() < WIDE_LANDMARKS {
        dispatch::narrow(job)
    } else {
        dispatch::wide(job)
    };
    Solved { best, others: Vec::new() }
}

/// Polishes every candidate of the minimal solvers, then what a planar scene turned over makes of the minima found,
/// and reports those of comparable cost.
fn solve_guess_free<L: Loss>(loss: L, problem: &Problem<'_>, settings: &Settings) -> Solved {
    let weight = |index: usize| problem.scalar_weight(index);
    let dof = degrees_of_freedom(problem.los.len());
    let total = (0..problem.los.len()).map(weight).sum();
    let options = &guess_free_options(&settings.options);
    let found = candidates(problem.landmarks, problem.los, weight);
    let starts: Vec<PoseState<f64>> = found.iter().map(start_from).collect();
    let mut outcomes = polish(loss, problem, options, &starts);
    let kept = rank(&mut outcomes, total, dof);
    outcomes.truncate(kept.max(1));
    let turned = outcomes.iter().filter_map(|outcome| turned_over(problem.landmarks, &pose_of(outcome)));
    let starts: Vec<PoseState<f64>> = turned.map(|pose| start_from(&pose)).collect();
    outcomes.extend(polish(loss, problem, options, &starts));
    let kept = rank(&mut outcomes, total, dof);
    let mut records = outcomes.iter().take(kept.max(1)).map(|outcome| record(loss, problem, outcome));
    let best = records.next().unwrap_or_else(|| Record::undetermined(problem.los.len()));
    Solved { best, others: records.collect() }
}

/// From a start that may be far off, steps damped about the middle of the scene arrive where others creep.
fn guess_free_options(options: &Options) -> Options {
    let parametrization = match options.parametrization {
        Parametrization::Rotation => Parametrization::Orbit,
        other => other,
    };
    Options { parametrization, ..*options }
}

fn polish<L: Loss>(
    loss: L,
    problem: &Problem<'_>,
    options: &Options,
    starts: &[PoseState<f64>],
) -> Vec<Outcome<f64>> {
    let mut outcomes = vec![Outcome::undefined(); starts.len()];
    if starts.is_empty() {
        return outcomes;
    }
    if problem.los.len() <= LANE_LANDMARKS {
        dispatch::wide(ManyStarts { problem, loss, options, starts, out: &mut outcomes });
    } else {
        let mut slots = outcomes.iter_mut();
        let take = |outcome| {
            if let Some(slot) = slots.next() {
                *slot = outcome;
            }
        };
        dispatch::wide(OnePose { problem, loss, options, starts, take });
    }
    // A start in a long bent valley may need more: it goes on from where it stopped, the others are done.
    for outcome in &mut outcomes {
        if Termination::from_code(outcome.termination) == Termination::MaxIterations {
            *outcome = go_on(loss, problem, options, outcome);
        }
    }
    outcomes
}

fn go_on<L: Loss>(loss: L, problem: &Problem<'_>, options: &Options, stopped: &Outcome<f64>) -> Outcome<f64> {
    let options =
        Options { max_iterations: options.max_iterations.saturating_mul(VALLEY_ROUNDS), ..*options };
    let mut end = Outcome::undefined();
    let take = |outcome| end = outcome;
    let starts = [stopped.pose];
    dispatch::narrow(OnePose { problem, loss, options: &options, starts: &starts, take });
    end.iterations += stopped.iterations;
    end
}

fn pose_of(outcome: &Outcome<f64>) -> Pose {
    let m = dcm_from_quaternion(outcome.pose.attitude);
    Pose { position: Vector3::from(outcome.pose.position), dcm: Matrix3::from_fn(|i, j| m[i][j]) }
}

fn start_from(pose: &Pose) -> PoseState<f64> {
    let (p, m) = (&pose.position, &pose.dcm);
    let dcm = [0, 1, 2].map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)]]);
    PoseState { position: [p.x, p.y, p.z], attitude: quaternion_from_dcm(&dcm) }
}

fn record<L: Loss>(loss: L, problem: &Problem<'_>, outcome: &Outcome<f64>) -> Record {
    let chi2 = if L::CURVED {
        let sensor = problem.sensor();
        LosObjective { sensor, loss }.chi2(&outcome.pose)
    } else {
        2.0 * outcome.cost
    };
    Record::new(outcome, chi2, degrees_of_freedom(problem.los.len()))
}

fn degrees_of_freedom(n: usize) -> f64 {
    2.0 * n as f64 - 6.0
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
fn parse_loss(text: &str, scale: Option<&Bound<'_, PyAny>>) -> PyResult<Option<Robust>> {
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
    let scale = scale.map_or(Ok(default), |value| number("loss_scale", "a positive finite number", value))?;
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
fn non_negative(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    const EXPECTED: &str = "a finite number >= 0";
    let number = number(argument, EXPECTED, value)?;
    if number >= 0.0 && number.is_finite() {
        Ok(number)
    } else {
        Err(option_error(argument, EXPECTED, value))
    }
}

/// A real number of an option.
pub fn number(argument: &str, expected: &str, value: &Bound<'_, PyAny>) -> PyResult<f64> {
    value.extract().map_err(|_| option_error(argument, expected, value))
}

/// A count or a seed.
pub fn whole<'py, T: FromPyObjectOwned<'py>>(argument: &str, value: &Bound<'py, PyAny>) -> PyResult<T> {
    value.extract().map_err(|_| option_error(argument, "an integer >= 0", value))
}
