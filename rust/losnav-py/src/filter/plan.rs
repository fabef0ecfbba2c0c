//! `run`: from arrays with or without axes for runs and epochs to a plan, and back to a record.
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::advance::Series;
use super::arcs::{Channel, Layout, Plan};
use super::engine::Passage;
use super::record::ArcRecord;
use super::source::Source;
use super::{Context, Filter, explain, missing_attitude};
use crate::attitude::is_rotation;
use crate::convert::{Buffer, Floats};
use crate::errors::{InvalidInputError, shape_error};

/// An argument with its axes understood.
pub struct Axes {
    runs: Option<usize>,
    run_stride: usize,
    time_stride: usize,
    size: usize,
}

impl Axes {
    /// How many runs it has rows for; none: the same for all.
    pub fn runs(&self) -> Option<usize> {
        self.runs
    }

    /// Leading axes `()`, `(T,)` or `(runs, T)` before rows of `size` numbers in one or two axes.
    pub fn of(shape: &[usize], size: usize, epochs: usize, constant: bool) -> Option<Self> {
        for trailing in [1, 2, 0] {
            let Some(split) = shape.len().checked_sub(trailing) else { continue };
            let (lead, row) = shape.split_at(split);
            if row.iter().product::<usize>() != size {
                continue;
            }
            let (runs, run_stride, time_stride) = match *lead {
                [] if constant => (None, 0, 0),
                [t] if t == epochs => (None, 0, size),
                [runs, t] if t == epochs => (Some(runs), epochs * size, size),
                _ => continue,
            };
            return Some(Self { runs, run_stride, time_stride, size });
        }
        None
    }

    /// The rows themselves.
    pub fn series<'a>(&self, data: &'a [f64]) -> Series<'a> {
        Series { data, size: self.size, run_stride: self.run_stride, time_stride: self.time_stride }
    }
}

/// Time steps, and when they start. Differences of equal steps differ by the rounding of the times themselves: those
/// are one step.
pub fn steps(times: &Floats<'_>, from: f64) -> PyResult<(Vec<f64>, Vec<f64>)> {
    let data = times.data();
    if times.shape().len() != 1 {
        return Err(shape_error("times", "(T,)", times.shape()));
    }
    if let Some(index) = data.iter().position(|time| !time.is_finite()) {
        let text = format!("times[{index}]: expected a finite number, got {}", data[index]);
        return Err(InvalidInputError::new_err(text));
    }
    let (mut steps, mut starts): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut now = from;
    for &time in data {
        let mut step = time - now;
        if let Some(&before) = steps.last()
            && (step - before).abs() <= 4.0 * f64::EPSILON * time.abs().max(now.abs())
        {
            step = before;
        }
        steps.push(step);
        starts.push(now);
        now = time;
    }
    Ok((steps, starts))
}

/// Every count of runs must be the same.
pub fn agree(runs: &mut Option<usize>, argument: &str, other: Option<usize>) -> PyResult<()> {
    match (*runs, other) {
        (Some(a), Some(b)) if a != b => {
            Err(InvalidInputError::new_err(format!("{argument}: expected {a} runs like the others, got {b}")))
        }
        (None, Some(_)) => {
            *runs = other;
            Ok(())
        }
        _ => Ok(()),
    }
}

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

fn attitudes(dcm: Option<&Floats<'_>>, epochs: usize) -> PyResult<Axes> {
    let Some(dcm) = dcm else { return Ok(Axes { runs: None, run_stride: 0, time_stride: 0, size: 9 }) };
    let expected = "(3, 3), (T, 3, 3) or (runs, T, 3, 3)";
    let axes = if dcm.shape().ends_with(&[3, 3]) { Axes::of(dcm.shape(), 9, epochs, true) } else { None };
    let axes = axes.ok_or_else(|| shape_error("dcm", expected, dcm.shape()))?;
    match dcm.data().as_chunks::<9>().0.iter().position(|row| !is_rotation(row)) {
        Some(index) => {
            Err(InvalidInputError::new_err(format!("dcm[{index}]: expected a rotation matrix (flat index)")))
        }
        None => Ok(axes),
    }
}

fn accelerations(controls: &Floats<'_>, epochs: usize) -> PyResult<Axes> {
    let shape = controls.shape();
    let axes = if shape.ends_with(&[3]) { Axes::of(shape, 3, epochs, true) } else { None };
    let axes = axes.ok_or_else(|| shape_error("controls", "(3,), (T, 3) or (runs, T, 3)", shape))?;
    if controls.data().iter().all(|value| value.is_finite()) {
        Ok(axes)
    } else {
        Err(InvalidInputError::new_err("controls: expected finite numbers, got NaN or infinity"))
    }
}

/// Every sensor with its measurements, axes checked.
struct Sensed<'py> {
    index: usize,
    source: Source,
    bound: f64,
    z: Floats<'py>,
    seen: Option<Floats<'py>>,
    axes: Axes,
}

impl Sensed<'_> {
    /// What the sensor looks at, row by row.
    fn seen(&self) -> Series<'_> {
        let Some(seen) = &self.seen else { return Series::constant(&[]) };
        let size = seen.shape().last().copied().unwrap_or(0);
        Series { data: seen.data(), size, run_stride: 0, time_stride: size }
    }
}

fn sense<'py>(
    filter: &mut Filter,
    py: Python<'py>,
    which: usize,
    (sensor, z): &(Bound<'py, PyAny>, Bound<'py, PyAny>),
    told: &Context<'py>,
    times: &Bound<'py, PyAny>,
    epochs: usize,
) -> PyResult<Option<Sensed<'py>>> {
    let index = filter.slot(py, sensor)?;
    let Some(source) = filter.slots[index].source.clone() else { return Ok(None) };
    let source = source.told(told)?.unwrap_or(source);
    // Rejections count along the arc.
    let bound = filter.gate_bound(py, index, source.dof)?;
    let z = Floats::new(z, "z")?;
    let axes = Axes::of(z.shape(), source.rows, epochs, false).ok_or_else(|| {
        let m = source.rows;
        let expected = format!("(T, {m}) or (runs, T, {m}) with T = {epochs}");
        shape_error(&format!("measurements[{which}]"), &expected, z.shape())
    })?;
    if let Some(at) = z.data().iter().position(|value| value.is_infinite()) {
        let text = format!(
            "measurements[{which}]: expected finite numbers (or NaN: no measurement), got infinity at flat index {at}"
        );
        return Err(InvalidInputError::new_err(text));
    }
    let seen = source.seen_at(sensor, times)?;
    Ok(Some(Sensed { index, source, bound, z, seen, axes }))
}

/// See `losnav.ExtendedKalmanFilter.run`.
pub fn run(
    filter: &mut Filter,
    py: Python<'_>,
    times: &Bound<'_, PyAny>,
    measurements: &[(Bound<'_, PyAny>, Bound<'_, PyAny>)],
    controls: Option<&Bound<'_, PyAny>>,
    context: &Bound<'_, PyDict>,
) -> PyResult<Option<ArcRecord>> {
    if !filter.listed {
        return Ok(None);
    }
    let (raw, times) = (times, Floats::new(times, "times")?);
    let (steps, starts) = steps(&times, filter.time)?;
    let epochs = steps.len();
    let told = Context::new(context)?;
    let mut sources = Vec::with_capacity(measurements.len());
    for (which, pair) in measurements.iter().enumerate() {
        let Some(sensed) = sense(filter, py, which, pair, &told, raw, epochs)? else { return Ok(None) };
        sources.push(sensed);
    }
    let dcm = told.dcm.as_ref().map(|dcm| Floats::new(dcm, "dcm")).transpose()?;
    if dcm.is_none() && sources.iter().any(|sensed| sensed.source.needs_attitude) {
        return Err(missing_attitude());
    }
    let axes = attitudes(dcm.as_ref(), epochs)?;
    let held = filter.engine.count();
    let mut runs = (held != 1).then_some(held);
    agree(&mut runs, "dcm", axes.runs)?;
    for (which, sensed) in sources.iter().enumerate() {
        agree(&mut runs, &format!("measurements[{which}]"), sensed.axes.runs)?;
    }
    let controls = controls.map(|value| Floats::new(value, "controls")).transpose()?;
    let control_axes = controls.as_ref().map(|array| accelerations(array, epochs)).transpose()?;
    agree(&mut runs, "controls", control_axes.as_ref().and_then(|axes| axes.runs))?;
    let count = runs.unwrap_or(1);
    let side_by_side = sources.iter().all(|sensed| sensed.source.lanes);
    let lanes = if side_by_side { filter.engine.lanes(count) } else { 1 };
    let layout =
        Layout { size: filter.size, rows: sources.iter().map(|sensed| sensed.source.rows).collect() };
    let channels = sources.iter().map(|sensed| Channel {
        source: &sensed.source,
        measurements: sensed.axes.series(sensed.z.data()),
        seen: sensed.seen(),
        bound: sensed.bound,
        rejected: filter.slots[sensed.index].rejected,
    });
    let series = |axes: &Option<Axes>| {
        axes.as_ref().zip(controls.as_ref()).map(|(axes, array)| axes.series(array.data()))
    };
    let plan = Plan {
        runs: count,
        steps,
        starts,
        controls: series(&control_axes),
        dcm: axes.series(dcm.as_ref().map_or(&IDENTITY, |dcm| dcm.data())),
        channels: channels.collect(),
        relock_after: filter.relock_after,
        settings: &filter.settings,
        lanes,
    };
    // A filter with a state for every run ends where the runs end; one state for many runs stays where it is.
    let keep = count == held;
    let engine = &mut filter.engine;
    let room = count.div_ceil(lanes) * lanes * epochs * layout.entries();
    let mut data = Buffer::zeros(py, room);
    let out = data.data_mut(py);
    let done = if count * epochs < DETACH {
        engine.arcs(&plan, &layout, out, keep)
    } else {
        py.detach(|| engine.arcs(&plan, &layout, out, keep))
    };
    let rejected = done.map_err(explain)?;
    let passage = Passage {
        steps: plan.steps,
        starts: plan.starts,
        controls: plan.controls.map(|c| (c.data.to_vec(), c.run_stride, c.time_stride)),
    };
    if keep {
        filter.time = times.data().last().copied().unwrap_or(filter.time);
        if count == 1 {
            for (sensed, count) in sources.iter().zip(rejected) {
                filter.slots[sensed.index].rejected = count;
            }
        }
    }
    let engine = filter.engine.duplicate();
    let freedom = sources.iter().map(|sensed| sensed.source.dof).collect();
    Ok(Some(ArcRecord {
        freedom,
        plain: filter.joseph,
        data,
        layout,
        runs: count,
        epochs,
        lanes,
        batch: runs.is_some(),
        engine,
        passage,
    }))
}

/// Steps in all below which the GIL is kept: releasing it costs as much as half a step.
const DETACH: usize = 64;
