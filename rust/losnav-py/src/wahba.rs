//! `solve_attitude`: one problem straight through, a batch over the cores with the GIL released.
use std::sync::Mutex;

use losnav_core::estimators::wahba::careful::{self, Problem as CarefulProblem};
use losnav_core::estimators::wahba::polish::polish;
use losnav_core::estimators::wahba::{Directions, Method, Vectors, full};
use pyo3::prelude::*;

use crate::attitude_solution::{AttitudeSolution, Record};
use crate::dispatch;
use crate::errors::{BadValue, choice_error, option_error};
use crate::pose::parse_on_error;
use crate::threads::share_out;
use crate::wahba_inputs::{Arguments, Exact, Noise, Problem, Problems, Scratch};
use crate::wahba_lanes::{ManyAttitudes, OneAttitude, first_lane};

/// Problems a thread takes at a time: a multiple of the lanes.
const CHUNK: usize = 256;
/// Directions in all below which threads cost more than they save (about 0.1 ms of work).
const SERIAL_DIRECTIONS: usize = 16_000;

/// A classical solver, and whether Newton steps follow it.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Solver {
    method: Method,
    polish: bool,
}

/// The one that runs in lanes.
const FAST: Solver = Solver { method: Method::Quest, polish: true };

/// See `losnav.solve_attitude`.
#[pyfunction]
#[pyo3(signature = (body, reference, sigma, covariance, method, polish, on_error, /))]
pub fn solve_attitude(
    py: Python<'_>,
    body: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    sigma: &Bound<'_, PyAny>,
    covariance: Option<&Bound<'_, PyAny>>,
    method: &str,
    polish: &Bound<'_, PyAny>,
    on_error: &str,
) -> PyResult<AttitudeSolution> {
    let solver = Solver { method: parse_method(method)?, polish: flag("polish", polish)? };
    let raise = parse_on_error(on_error)?;
    let arguments = Arguments::new(body, reference, sigma, covariance)?;
    let problems = arguments.problems(1, Exact::Allowed)?;
    if problems.single {
        let mut scratch = Scratch::default();
        let record = match problems.get(0, &mut scratch) {
            Ok(problem) => solve_one(&problem, solver),
            Err(bad) if raise => return Err(bad.into_py(None)),
            Err(_) => Record::invalid(),
        };
        return Ok(AttitudeSolution::one(record, None));
    }
    let solved = py.detach(|| solve_batch(&problems, solver, raise));
    let chunks = solved.map_err(|(problem, bad)| bad.into_py(Some(problem)))?;
    Ok(AttitudeSolution::many(problems.shape, chunks, None))
}

type Failure = (usize, BadValue);

/// Chunks of problems, each into memory that its own thread allocates.
fn solve_batch(problems: &Problems<'_>, solver: Solver, raise: bool) -> Result<Vec<Vec<Record>>, Failure> {
    let mut chunks = vec![Vec::new(); problems.count.div_ceil(CHUNK)];
    let failures = Mutex::new(Vec::new());
    let chunk = |(index, out): (usize, &mut Vec<Record>)| {
        if let (Err(failure), Ok(mut failures)) =
            (solve_chunk(problems, index * CHUNK, solver, raise, out), failures.lock())
        {
            failures.push(failure);
        }
    };
    if problems.count * problems.n < SERIAL_DIRECTIONS {
        chunks.iter_mut().enumerate().for_each(chunk);
    } else {
        share_out(chunks.iter_mut().enumerate(), chunk);
    }
    let failures = failures.into_inner().unwrap_or_default();
    match failures.into_iter().min_by_key(|(problem, _)| *problem) {
        Some(first) => Err(first),
        None => Ok(chunks),
    }
}

fn solve_chunk(
    problems: &Problems<'_>,
    first: usize,
    solver: Solver,
    raise: bool,
    out: &mut Vec<Record>,
) -> Result<(), Failure> {
    let count = CHUNK.min(problems.count - first);
    out.resize(count, Record::invalid());
    let mut scratch = Scratch::default();
    let mut failure = Ok(());
    let mut one = |k: usize| match problems.get(k, &mut scratch) {
        Ok(problem) => solve_one(&problem, solver),
        Err(bad) => {
            if raise && failure.is_ok() {
                failure = Err((k, bad));
            }
            Record::invalid()
        }
    };
    if solver == FAST && !matches!(problems.noise, Noise::Covariance(_)) {
        dispatch::wide(ManyAttitudes { problems, first, out, one_by_one: one });
    } else {
        out.iter_mut().zip(first..).for_each(|(slot, k)| *slot = one(k));
    }
    failure
}

fn solve_one(problem: &Problem<'_>, solver: Solver) -> Record {
    let fast = if !(solver.polish && problem.roots.is_empty()) {
        None
    } else if solver == FAST {
        dispatch::narrow(OneAttitude { problem })
    } else {
        let directions =
            Vectors { body: problem.body, reference: problem.reference, weights: problem.weights };
        let profile = directions.profile();
        first_lane(&polish(&directions, &profile, solver.method.start(&profile)), problem.body.len())
    };
    fast.unwrap_or_else(|| solve_carefully(problem, solver))
}

#[cold]
fn solve_carefully(problem: &Problem<'_>, solver: Solver) -> Record {
    let Problem { body, reference, weights, roots } = *problem;
    let Solver { method, polish } = solver;
    let careful = CarefulProblem { body, reference, weights, method, polish };
    let solution = if roots.is_empty() { careful::solve(&careful) } else { full::solve(&careful, roots) };
    Record::new(&solution, body.len())
}

fn flag(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<bool> {
    value.extract().map_err(|_| option_error(argument, "True or False", value))
}

fn parse_method(text: &str) -> PyResult<Method> {
    match text {
        "quest" => Ok(Method::Quest),
        "q-method" => Ok(Method::QMethod),
        "svd" => Ok(Method::Svd),
        "foam" => Ok(Method::Foam),
        "esoq2" => Ok(Method::Esoq2),
        other => Err(choice_error("method", r#""quest", "q-method", "svd", "foam", "esoq2""#, other)),
    }
}
