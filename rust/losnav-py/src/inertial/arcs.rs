//! `run`: from arrays with or without axes for runs and epochs to a flight plan, and back to a record.
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::InertialFilter;
use super::belief::{Belief, NUMBERS};
use super::travel::{Channel, Flightplan, Tape};
use crate::convert::{self, Floats};
use crate::errors::{InvalidInputError, shape_error};
use crate::filter::{Axes, Context, Series, agree, steps};

/// Everything runs leave behind.
pub struct Record {
    runs: usize,
    epochs: usize,
    size: usize,
    /// Numbers in the measurement of each sensor.
    pub rows: Vec<usize>,
    pub state: Vec<f64>,
    pub covariance: Vec<f64>,
    pub model_error: Vec<f64>,
    pub nis: Vec<f64>,
    pub dof: Vec<f64>,
    pub accepted: Vec<bool>,
    pub innovation: Vec<f64>,
    pub used: Vec<bool>,
    /// State and covariance that each measurement met, of a single step.
    pub prior: Option<Vec<f64>>,
}

impl Record {
    /// Room for the runs of a plan.
    pub fn new(plan: &Flightplan<'_>, size: usize, runs: usize) -> Self {
        let rows: Vec<usize> = plan.channels.iter().map(|channel| channel.source.rows).collect();
        let (epochs, sensors, numbers) = (plan.steps.len(), rows.len(), rows.iter().sum::<usize>());
        let count = runs * epochs;
        // A single step leaves the estimate itself.
        let kept = if plan.strict { 0 } else { count };
        Self {
            runs,
            epochs,
            size,
            state: vec![0.0; kept * NUMBERS],
            covariance: vec![0.0; kept * size * size],
            model_error: vec![0.0; kept * 3],
            nis: vec![f64::NAN; count * sensors],
            dof: vec![0.0; count * sensors],
            accepted: vec![false; count * sensors],
            innovation: vec![f64::NAN; count * numbers],
            used: vec![false; count * numbers],
            rows,
            prior: None,
        }
    }

    /// One for each run.
    pub fn tapes(&mut self) -> impl Iterator<Item = Tape<'_>> + Send {
        let (epochs, sensors, numbers) = (self.epochs, self.rows.len(), self.rows.iter().sum::<usize>());
        let square = self.size * self.size;
        let kept = if self.state.is_empty() { 0 } else { epochs };
        // A run without epochs, or epochs without sensors, still has its empty tape.
        let mut state = self.state.as_mut_slice();
        let mut covariance = self.covariance.as_mut_slice();
        let mut model_error = self.model_error.as_mut_slice();
        let (mut nis, mut dof) = (self.nis.as_mut_slice(), self.dof.as_mut_slice());
        let mut accepted = self.accepted.as_mut_slice();
        let (mut innovation, mut used) = (self.innovation.as_mut_slice(), self.used.as_mut_slice());
        let mut prior = self.prior.as_mut();
        (0..self.runs).map(move |_| Tape {
            state: split(&mut state, kept * NUMBERS),
            covariance: split(&mut covariance, kept * square),
            model_error: split(&mut model_error, kept * 3),
            nis: split(&mut nis, epochs * sensors),
            dof: split(&mut dof, epochs * sensors),
            accepted: split(&mut accepted, epochs * sensors),
            innovation: split(&mut innovation, epochs * numbers),
            used: split(&mut used, epochs * numbers),
            prior: prior.take(),
        })
    }

    fn into_dict<'py>(self, py: Python<'py>, batch: bool) -> PyResult<Bound<'py, PyDict>> {
        let (n, sensors, numbers) = (self.size, self.rows.len(), self.rows.iter().sum::<usize>());
        let shape = |tail: &[usize]| {
            let lead: &[usize] = if batch { &[self.runs, self.epochs] } else { &[self.epochs] };
            [lead, tail].concat()
        };
        let dict = PyDict::new(py);
        dict.set_item("state", convert::array(py, &shape(&[NUMBERS]), self.state)?)?;
        dict.set_item("covariance", convert::array(py, &shape(&[n, n]), self.covariance)?)?;
        dict.set_item("model_error", convert::array(py, &shape(&[3]), self.model_error)?)?;
        dict.set_item("nis", convert::array(py, &shape(&[sensors]), self.nis)?)?;
        dict.set_item("dof", convert::array(py, &shape(&[sensors]), self.dof)?)?;
        dict.set_item("accepted", convert::array(py, &shape(&[sensors]), self.accepted)?)?;
        dict.set_item("innovation", convert::array(py, &shape(&[numbers]), self.innovation)?)?;
        dict.set_item("used", convert::array(py, &shape(&[numbers]), self.used)?)?;
        dict.set_item("rows", self.rows)?;
        Ok(dict)
    }
}

/// The front of what is left.
fn split<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (front, back) = core::mem::take(rest).split_at_mut(count);
    *rest = back;
    front
}

/// The epoch at which each exposure is known: the first that is `delay` or more after it.
fn known_at(times: &[f64], delay: f64) -> Vec<Option<usize>> {
    let slack = |t: f64| 4.0 * f64::EPSILON * t.abs().max(delay.abs());
    let later = |(k, exposed): (usize, &f64)| {
        let after = times[k..].iter().position(|t| *t >= exposed + delay - slack(*t));
        after.map(|steps| k + steps)
    };
    times.iter().enumerate().map(later).collect()
}

/// See `losnav.ExtendedKalmanFilter.run`.
pub fn run<'py>(
    filter: &mut InertialFilter,
    py: Python<'py>,
    times: &Bound<'py, PyAny>,
    measurements: &[(Bound<'py, PyAny>, Bound<'py, PyAny>, f64)],
    (controls, substeps): (Option<&Bound<'py, PyAny>>, usize),
    context: &Bound<'py, PyDict>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let times = Floats::new(times, "times")?;
    let (lengths, _) = steps(&times, filter.time)?;
    let epochs = lengths.len();
    let told = Context::new(context)?;
    let held = filter.beliefs.len();
    let mut runs = (held != 1).then_some(held);
    let mut sensed = Vec::with_capacity(measurements.len());
    for (which, (sensor, z, delay)) in measurements.iter().enumerate() {
        let index = filter.slot(py, sensor)?;
        let Some(source) = filter.slots[index].source.clone() else { return Ok(None) };
        let source = source.told(&told)?.unwrap_or(source);
        let z = Floats::new(z, "z")?;
        let axes = Axes::of(z.shape(), source.rows, epochs, false).ok_or_else(|| {
            let expected = format!("(T, {m}) or (runs, T, {m}) with T = {epochs}", m = source.rows);
            shape_error(&format!("measurements[{which}]"), &expected, z.shape())
        })?;
        if z.data().iter().any(|value| value.is_infinite()) {
            let text = format!("measurements[{which}]: expected finite numbers (or NaN: no measurement)");
            return Err(InvalidInputError::new_err(text));
        }
        agree(&mut runs, &format!("measurements[{which}]"), axes.runs())?;
        if *delay != 0.0 {
            filter.room_for("measurements: delayed ones")?;
        }
        let known = (*delay != 0.0).then(|| known_at(times.data(), *delay));
        sensed.push((index, source, z, axes, known));
    }
    let none = [0.0; 6];
    let controls = controls.map(|value| Floats::new(value, "controls")).transpose()?;
    let control_axes = controls.as_ref().map(|array| samples(array, epochs * substeps)).transpose()?;
    agree(&mut runs, "controls", control_axes.as_ref().and_then(Axes::runs))?;
    let count = runs.unwrap_or(1);
    let series = match (&control_axes, &controls) {
        (Some(axes), Some(array)) => axes.series(array.data()),
        _ => Series::constant(&none),
    };
    let channels = sensed.iter().map(|(index, source, z, axes, known)| Channel {
        source,
        slot: *index,
        map: filter.slots[*index].map.as_ref(),
        measurements: axes.series(z.data()),
        bounds: filter.bounds,
        rejected: filter.slots[*index].rejected,
        known: known.clone(),
        key: None,
    });
    let channels = channels.collect();
    let mut plan = filter.plan(lengths, channels, &none);
    (plan.substeps, plan.controls, plan.strict) = (substeps, series, false);
    let mut record = Record::new(&plan, filter.size, count);
    let start = |run: usize| filter.beliefs[if held == 1 { 0 } else { run }].clone();
    let mut beliefs: Vec<Belief> = (0..count).map(start).collect();
    let (engine, model) = (filter.engine, &filter.model);
    let rejected = py.detach(|| engine.fly(model, &plan, &mut beliefs, &mut record));
    // A filter with a state for every run ends where the runs end; one state for many runs stays where it is.
    if count == held {
        filter.beliefs = beliefs;
        filter.time = times.data().last().copied().unwrap_or(filter.time);
        if count == 1 {
            for ((index, ..), count) in sensed.iter().zip(rejected) {
                filter.slots[*index].rejected = count;
            }
        }
    }
    record.into_dict(py, runs.is_some()).map(Some)
}

/// Samples of the measurement unit: one for all substeps, or one for each.
fn samples(controls: &Floats<'_>, count: usize) -> PyResult<Axes> {
    let shape = controls.shape();
    let axes = if shape.ends_with(&[6]) { Axes::of(shape, 6, count, true) } else { None };
    let expected = format!("(6,), ({count}, 6) or (runs, {count}, 6): one for every step of the unit");
    let axes = axes.ok_or_else(|| shape_error("controls", &expected, shape))?;
    if controls.data().iter().all(|value| value.is_finite()) {
        Ok(axes)
    } else {
        Err(InvalidInputError::new_err("controls: expected finite numbers, got NaN or infinity"))
    }
}
