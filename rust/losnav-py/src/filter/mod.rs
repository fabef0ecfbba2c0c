//! The filter behind `losnav.ExtendedKalmanFilter`: the estimate, what it knows of its sensors, and the doors to step
//! it, run it over arcs, or let models in Python move it.
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyFloat, PyString};

use self::core::{Core, Given};
use crate::attitude::is_rotation;
use crate::convert::{self, Floats};
use crate::dynamics::Parameters;
use crate::errors::{
    DegenerateGeometryError, InvalidInputError, NumericalError, choice_error, option_error, shape_error,
};
use engine::{Engine, Failure, Foreign, Listed, Look};
use family::{Form, JosephForm, UdForm};

mod advance;
mod arcs;
mod backward;
mod core;
mod engine;
mod family;
mod plan;
mod record;
mod source;
mod step;

pub use advance::{Runs, Series};
pub use engine::Settings;
pub use plan::{Axes, agree, steps};
pub use record::ArcRecord;
pub use source::Source;
pub use step::{Parts, Step};

/// Sensors remembered; beyond that the one unused for longest is forgotten.
const SENSORS: usize = 32;

/// What a filter knows of one sensor.
struct Slot {
    sensor: Py<PyAny>,
    /// Nothing if the sensor lives in Python.
    source: Option<Source>,
    /// Bound on the normalised innovation squared, and the degrees of freedom it is for.
    bound: (usize, f64),
    /// Straight rejections.
    rejected: f64,
}

/// See `losnav.ExtendedKalmanFilter`.
#[pyclass(module = "losnav._core")]
pub struct Filter {
    engine: Box<dyn Engine>,
    settings: Settings,
    consider: Vec<usize>,
    /// Called with degrees of freedom, returns the bound; none without a gate.
    gate: Option<Py<PyAny>>,
    relock_after: f64,
    slots: Vec<Slot>,
    size: usize,
    /// Does the engine know the model?
    listed: bool,
    /// Are covariances kept as they are?
    joseph: bool,
    empty: Py<PyDict>,
    /// Time of the estimate, s.
    #[pyo3(get, set)]
    time: f64,
}

fn in_form<F: Form>(name: Option<&str>, parameters: &[f64], n: usize) -> PyResult<Box<dyn Engine>> {
    if let Some(name) = name {
        macro_rules! choose {
            ($($listed:ident: $size:literal),* $(,)?) => {
                $(if name == stringify!($listed) {
                    let model = crate::dynamics::listed::$listed::from_parameters(parameters)
                        .ok_or_else(|| shape_error("parameters", "those of the model", &[parameters.len()]))?;
                    return Ok(Box::new(Listed::<_, F, $size>::new(Core::new($size), model)));
                })*
            };
        }
        family::held! { choose }
        return Err(choice_error("dynamics", "the listed models", name));
    }
    macro_rules! sizes {
        ($($size:literal)*) => {
            $(if n <= $size {
                return Ok(Box::new(Foreign::<F, $size> { core: Core::new(n) }));
            })*
        };
    }
    sizes! { 6 9 15 24 63 }
    Err(InvalidInputError::new_err(format!("state: expected at most 63 components, got {n}")))
}

#[pymethods]
impl Filter {
    #[new]
    #[pyo3(signature = (name, parameters, size, form, iterations, underweighting, consider, gate, relock_after, /))]
    fn new(
        py: Python<'_>,
        name: Option<&str>,
        parameters: &Bound<'_, PyAny>,
        size: usize,
        form: &str,
        iterations: u32,
        underweighting: f64,
        consider: Vec<usize>,
        gate: Option<Py<PyAny>>,
        relock_after: f64,
    ) -> PyResult<Self> {
        let parameters = crate::dynamics::numbers(parameters)?;
        let engine = match form {
            "joseph" => in_form::<JosephForm>(name, &parameters, size)?,
            "ud" => in_form::<UdForm>(name, &parameters, size)?,
            other => return Err(choice_error("form", r#""joseph", "ud""#, other)),
        };
        let flags = (!consider.is_empty()).then(|| (0..size).map(|i| consider.contains(&i)).collect());
        let settings = Settings { iterations, underweighting, consider: flags };
        let (slots, listed, empty) = (Vec::new(), name.is_some(), PyDict::new(py).unbind());
        Ok(Self {
            engine,
            settings,
            consider,
            gate,
            relock_after,
            slots,
            size,
            listed,
            joseph: form == "joseph",
            empty,
            time: 0.0,
        })
    }

    /// States `(count, n)` and covariances, or the numbers they are stored in, `(count, n, n)`.
    fn set(&mut self, states: &Bound<'_, PyAny>, matrices: &Bound<'_, PyAny>, stored: bool) -> PyResult<()> {
        let (states, matrices) = (Floats::new(states, "state")?, Floats::new(matrices, "covariance")?);
        self.engine.set(states.data(), matrices.data(), stored);
        Ok(())
    }

    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::array(py, &[self.engine.count(), self.size], self.engine.states())
    }

    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::array(py, &[self.engine.count(), self.size, self.size], self.engine.covariances())
    }

    fn stored<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        convert::array(py, &[self.engine.count(), self.size, self.size], self.engine.stored())
    }

    /// `(sensor, straight rejections)` of every sensor that has any.
    fn rejections<'py>(&self, py: Python<'py>) -> Vec<(Bound<'py, PyAny>, f64)> {
        let of = |slot: &Slot| (slot.sensor.bind(py).clone(), slot.rejected);
        self.slots.iter().filter(|slot| slot.rejected > 0.0).map(of).collect()
    }

    fn set_rejections(&mut self, py: Python<'_>, counts: Vec<(Bound<'_, PyAny>, f64)>) -> PyResult<()> {
        for (sensor, count) in counts {
            let index = self.slot(py, &sensor)?;
            self.slots[index].rejected = count;
        }
        Ok(())
    }

    /// Predicts with the listed model.
    #[pyo3(signature = (dt, control, /))]
    fn predict(&mut self, dt: &Bound<'_, PyAny>, control: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let (dt, control) = (seconds(dt)?, acceleration(control)?);
        self.one()?;
        self.engine.step(self.time, dt, control, None).map_err(explain)?;
        self.time += dt;
        Ok(())
    }

    /// Predicts (unless `dt` is none) and updates, or nothing if the sensor lives in Python.
    #[pyo3(signature = (dt, sensor, z, control, context, /))]
    fn step(
        &mut self,
        py: Python<'_>,
        dt: Option<&Bound<'_, PyAny>>,
        sensor: &Bound<'_, PyAny>,
        z: &Bound<'_, PyAny>,
        control: Option<&Bound<'_, PyAny>>,
        context: &Bound<'_, PyDict>,
    ) -> PyResult<Option<Step>> {
        let index = self.slot(py, sensor)?;
        if !self.listed || self.slots[index].source.is_none() {
            return Ok(None);
        }
        let (dt, control) = (dt.map_or(Ok(0.0), seconds)?, acceleration(control)?);
        self.one()?;
        let told = Context::new(context)?;
        let other = match &self.slots[index].source {
            Some(source) => source.told(&told)?,
            None => None,
        };
        let dof = other.as_ref().or(self.slots[index].source.as_ref()).map_or(0, |source| source.dof);
        let bound = self.bound(py, index, dof)?;
        let slot = &mut self.slots[index];
        let Some(source) = other.as_ref().or(slot.source.as_ref()) else { return Ok(None) };
        let z = Floats::new(z, "z")?;
        let z = measurement(&z, source.rows)?;
        let dcm = attitude(told.dcm.as_ref(), source)?;
        let seen = source.seen_at(sensor, self.time + dt)?;
        let context = at(context, seen.is_some().then_some(self.time + dt))?;
        let seen = seen.as_ref().map_or(&[][..], |seen| seen.data());
        let look = Look { source, z, seen, dcm, bound, settings: &self.settings };
        let seen = self.engine.step(self.time, dt, control, Some(look));
        let Some(seen) = seen.map_err(explain)? else { return Ok(None) };
        self.time += dt;
        let slot = &mut self.slots[index];
        if seen.accepted {
            slot.rejected = 0.0;
        } else if seen.nis.is_finite() {
            slot.rejected += 1.0;
        }
        let parts = Parts {
            sensor: slot.sensor.clone_ref(py),
            context: if context.is_empty() { self.empty.clone_ref(py) } else { context.unbind() },
            size: self.size,
            numbers: self.size,
            used: vec![seen.accepted; seen.innovation.len()],
            prior: seen.prior,
            innovation: seen.innovation,
            nis: seen.nis,
            dof,
            accepted: seen.accepted,
            underweighting: self.settings.underweighting,
            consider: self.consider.clone(),
        };
        Ok(Some(parts.into()))
    }

    /// Whole arcs, or nothing if something lives in Python.
    #[pyo3(signature = (times, measurements, controls, context, /))]
    fn run(
        &mut self,
        py: Python<'_>,
        times: &Bound<'_, PyAny>,
        measurements: Vec<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
        controls: Option<&Bound<'_, PyAny>>,
        context: &Bound<'_, PyDict>,
    ) -> PyResult<Option<ArcRecord>> {
        plan::run(self, py, times, &measurements, controls, context)
    }

    /// Takes the prediction of a model in Python; true if it is finite.
    fn predict_given(
        &mut self,
        dt: f64,
        state: &Bound<'_, PyAny>,
        transition: &Bound<'_, PyAny>,
        noise: &Bound<'_, PyAny>,
    ) -> PyResult<bool> {
        self.one()?;
        let (state, transition, noise) = (
            Floats::new(state, "state")?,
            Floats::new(transition, "transition")?,
            Floats::new(noise, "noise")?,
        );
        let done = self.engine.predict_given(state.data(), transition.data(), noise.data());
        if done {
            self.time += dt;
        }
        Ok(done)
    }

    /// Tries whitened rows: `(correction, nis)`.
    fn attempt<'py>(
        &mut self,
        py: Python<'py>,
        innovation: &Bound<'py, PyAny>,
        jacobian: &Bound<'py, PyAny>,
        offset: &Bound<'py, PyAny>,
    ) -> PyResult<(Bound<'py, PyAny>, f64)> {
        self.one()?;
        let (innovation, jacobian, offset) = (
            Floats::new(innovation, "innovation")?,
            Floats::new(jacobian, "jacobian")?,
            Floats::new(offset, "offset")?,
        );
        let rows = Given {
            innovation: innovation.data(),
            jacobian: jacobian.data(),
            offset: offset.data(),
            settings: &self.settings,
        };
        let (delta, nis) = self.engine.attempt(&rows);
        Ok((convert::array(py, &[delta.len()], delta)?, nis))
    }

    /// Keeps the last attempt; true if it is finite.
    fn commit(&mut self) -> bool {
        self.engine.commit()
    }

    /// The bound for a sensor in Python, infinite where it has been rejected too often.
    fn bound_for(&mut self, py: Python<'_>, sensor: &Bound<'_, PyAny>, dof: usize) -> PyResult<f64> {
        let index = self.slot(py, sensor)?;
        self.bound(py, index, dof)
    }

    /// Counts what became of a measurement of a sensor in Python.
    fn count(&mut self, py: Python<'_>, sensor: &Bound<'_, PyAny>, accepted: bool) -> PyResult<()> {
        let index = self.slot(py, sensor)?;
        let slot = &mut self.slots[index];
        slot.rejected = if accepted { 0.0 } else { slot.rejected + 1.0 };
        Ok(())
    }
}

impl Filter {
    /// Where the sensor is remembered: the same object, or an equal one.
    fn slot(&mut self, py: Python<'_>, sensor: &Bound<'_, PyAny>) -> PyResult<usize> {
        if let Some(index) = self.slots.iter().position(|slot| slot.sensor.is(sensor)) {
            return Ok(index);
        }
        let source = Source::read(sensor)?;
        for (index, slot) in self.slots.iter_mut().enumerate() {
            let same = match (&slot.source, &source) {
                (Some(a), Some(b)) => a == b,
                (None, None) => slot.sensor.bind(py).eq(sensor).unwrap_or(false),
                _ => false,
            };
            if same {
                slot.sensor = sensor.clone().unbind();
                return Ok(index);
            }
        }
        if self.slots.len() == SENSORS {
            self.slots.remove(0);
        }
        let bound = (usize::MAX, f64::INFINITY);
        self.slots.push(Slot { sensor: sensor.clone().unbind(), source, bound, rejected: 0.0 });
        Ok(self.slots.len() - 1)
    }

    /// Bound of the gate on the normalised innovation squared.
    fn gate_bound(&mut self, py: Python<'_>, index: usize, dof: usize) -> PyResult<f64> {
        let Some(gate) = &self.gate else { return Ok(f64::INFINITY) };
        let slot = &mut self.slots[index];
        if slot.bound.0 != dof {
            slot.bound = (dof, gate.bind(py).call1((dof,))?.extract()?);
        }
        Ok(slot.bound.1)
    }

    /// The bound for the next measurement: none after too many straight rejections.
    fn bound(&mut self, py: Python<'_>, index: usize, dof: usize) -> PyResult<f64> {
        let bound = self.gate_bound(py, index, dof)?;
        Ok(if self.slots[index].rejected >= self.relock_after { f64::INFINITY } else { bound })
    }

    /// Single steps need a single estimate.
    fn one(&self) -> PyResult<()> {
        if self.engine.count() == 1 {
            return Ok(());
        }
        let text =
            "state: this filter holds a batch of states; step them with run(), or give one filter to each";
        Err(InvalidInputError::new_err(text))
    }
}

/// What a sensor is told, the time of the measurement included if it changes with time.
fn at<'py>(context: &Bound<'py, PyDict>, time: Option<f64>) -> PyResult<Bound<'py, PyDict>> {
    let Some(time) = time else { return Ok(context.clone()) };
    let told = context.copy()?;
    told.set_item("time", time)?;
    Ok(told)
}

/// A time step.
pub fn seconds(dt: &Bound<'_, PyAny>) -> PyResult<f64> {
    const EXPECTED: &str = "a finite number, s";
    let value = match dt.cast_exact::<PyFloat>() {
        Ok(number) => number.value(),
        Err(_) => dt.extract().map_err(|_| option_error("dt", EXPECTED, dt))?,
    };
    if value.is_finite() { Ok(value) } else { Err(option_error("dt", EXPECTED, dt)) }
}

fn acceleration(control: Option<&Bound<'_, PyAny>>) -> PyResult<[f64; 3]> {
    let Some(control) = control else { return Ok([0.0; 3]) };
    let array = Floats::new(control, "control")?;
    match (array.shape(), array.data()) {
        ([3], &[x, y, z]) if x.is_finite() && y.is_finite() && z.is_finite() => Ok([x, y, z]),
        ([3], _) => Err(InvalidInputError::new_err("control: expected finite numbers, got NaN or infinity")),
        (shape, _) => Err(shape_error("control", "(3,)", shape)),
    }
}

/// What the caller tells the sensors.
#[derive(Default)]
pub struct Context<'py> {
    /// Attitude.
    dcm: Option<Bound<'py, PyAny>>,
    /// In place of those of the sensors that have landmarks.
    landmarks: Option<Bound<'py, PyAny>>,
    /// In place of that of the sensors that have a target.
    target: Option<Bound<'py, PyAny>>,
}

impl<'py> Context<'py> {
    /// From keyword arguments.
    pub fn new(told: &Bound<'py, PyDict>) -> PyResult<Self> {
        let mut context = Self::default();
        for (key, value) in told {
            let key = key.cast::<PyString>()?;
            let given = (!value.is_none()).then_some(value);
            match key.to_str()? {
                "dcm" => context.dcm = given,
                "landmarks" => context.landmarks = given,
                "target" => context.target = given,
                other => {
                    let known = "the built-in sensors take dcm, landmarks and target";
                    return Err(InvalidInputError::new_err(format!("{other}: unknown context; {known}")));
                }
            }
        }
        Ok(context)
    }
}

fn attitude(dcm: Option<&Bound<'_, PyAny>>, source: &Source) -> PyResult<[[f64; 3]; 3]> {
    let Some(dcm) = dcm else {
        if source.needs_attitude {
            return Err(missing_attitude());
        }
        return Ok([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    };
    let array = Floats::new(dcm, "dcm")?;
    match (array.shape(), array.data().first_chunk::<9>()) {
        ([3, 3], Some(flat)) if is_rotation(flat) => {
            let [a, b, c, d, e, f, g, h, i] = *flat;
            Ok([[a, b, c], [d, e, f], [g, h, i]])
        }
        ([3, 3], _) => Err(InvalidInputError::new_err("dcm: expected a rotation matrix")),
        (shape, _) => Err(shape_error("dcm", "(3, 3)", shape)),
    }
}

fn missing_attitude() -> PyErr {
    InvalidInputError::new_err(
        "dcm: expected the attitude (body from reference), which this state does not hold",
    )
}

/// The numbers of a measurement; NaN is a missing one, infinity is not allowed.
pub fn measurement<'a>(z: &'a Floats<'_>, rows: usize) -> PyResult<&'a [f64]> {
    let data = z.data();
    if data.len() != rows {
        return Err(shape_error("z", &format!("({rows},)"), z.shape()));
    }
    if let Some(index) = data.iter().position(|value| value.is_infinite()) {
        let text =
            format!("z[{index}]: expected a finite number (or NaN: no measurement), got {}", data[index]);
        return Err(InvalidInputError::new_err(text));
    }
    Ok(data)
}

fn explain(failure: Failure) -> PyErr {
    match failure {
        Failure::Undefined(error) => {
            DegenerateGeometryError::new_err(format!("update: {error}; the filter is unchanged"))
        }
        Failure::Prediction => NumericalError::new_err(
            "predict: the predicted state or covariance is not finite; the filter is unchanged",
        ),
        Failure::Update => {
            NumericalError::new_err("update: the innovation is not finite; the filter is unchanged")
        }
        Failure::NotListed => InvalidInputError::new_err("dynamics: expected a listed model"),
    }
}
