//! The filter on inertial navigation behind `losnav.ExtendedKalmanFilter` and `losnav.PredictiveFilter`: the estimate, what
//! it knows of its sensors, and the doors to step it or fly it over arcs.
use losnav_core::estimators::kalman::BLOCK;
use losnav_core::models::dynamics::strapdown::{Noise, Site, Strapdown};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{self, Floats};
use crate::errors::{
    DegenerateGeometryError, InvalidInputError, NumericalError, choice_error, option_error, shape_error,
};
use crate::filter::{Context, Parts, Settings, Source, Step, measurement, seconds};
use crate::gravity::AnyGravity;
use belief::{Belief, Clone6, Mapped, NUMBERS};
use engine::Engine;
use look::MapPrior;
use travel::{Adaptive, Channel, Flightplan, Mishap, Predictive};

mod arcs;
mod belief;
mod engine;
mod form;
mod literal;
mod look;
mod travel;
mod wide;

/// What a filter knows of one sensor.
struct Slot {
    sensor: Py<PyAny>,
    /// Nothing if the sensor lives in Python.
    source: Option<Source>,
    map: Option<MapPrior>,
    rejected: f64,
}

/// See `losnav.ExtendedKalmanFilter`.
#[pyclass(module = "losnav._core")]
pub struct InertialFilter {
    model: Strapdown<AnyGravity>,
    engine: Engine,
    size: usize,
    settings: Settings,
    bounds: Option<[f64; BLOCK]>,
    relock_after: f64,
    predictive: Option<Predictive>,
    adaptive: Option<Adaptive>,
    slots: Vec<Slot>,
    beliefs: Vec<Belief>,
    next_key: u64,
    empty: Py<PyDict>,
    /// Time of the estimate, s.
    #[pyo3(get, set)]
    time: f64,
}

/// Numbers of constants beside a state, to be stored: `cross, constants, poses, map, since, model error, start, adapted`.
type Beside = (
    Vec<f64>,
    Vec<f64>,
    Vec<(u64, usize, [f64; 7])>,
    Vec<(usize, usize, usize, bool, [f64; 3])>,
    f64,
    [f64; 3],
    Vec<f64>,
    [f64; 2],
);

/// The model of the numbers that `losnav.dynamics.Strapdown` has for it.
pub fn model_of(site: &[f64], gravity: &Bound<'_, PyAny>, noise: &[f64]) -> PyResult<Strapdown<AnyGravity>> {
    let (&[a, b, c, d, e, f, g, h, i, x, y, z, u, v, w], &[q_a, q_w, q_ba, q_bg, deviation, time_constant]) =
        (site, noise)
    else {
        return Err(shape_error("site", "(15,) with a noise of (6,)", &[site.len(), noise.len()]));
    };
    Ok(Strapdown {
        site: Site {
            site_from_fixed: [[a, b, c], [d, e, f], [g, h, i]],
            center: [x, y, z],
            angular_velocity: [u, v, w],
        },
        gravity: AnyGravity::from_python(gravity)?,
        noise: Noise {
            acceleration: q_a,
            angular_rate: q_w,
            accelerometer_bias: q_ba,
            gyroscope_bias: q_bg,
            deviation,
            time_constant,
        },
    })
}

#[pymethods]
impl InertialFilter {
    #[new]
    #[pyo3(signature = (site, gravity, noise, size, form, iterations, underweighting, consider, bounds, relock_after, predictive, adaptive, /))]
    #[expect(clippy::too_many_arguments, reason = "what the Python classes take")]
    fn new(
        py: Python<'_>,
        site: Vec<f64>,
        gravity: &Bound<'_, PyAny>,
        noise: Vec<f64>,
        size: usize,
        form: &str,
        iterations: u32,
        underweighting: f64,
        consider: Vec<usize>,
        bounds: Option<[f64; BLOCK]>,
        relock_after: f64,
        predictive: Option<(f64, bool, bool)>,
        adaptive: Option<(f64, f64, f64)>,
    ) -> PyResult<Self> {
        let flags = (!consider.is_empty()).then(|| (0..size).map(|i| consider.contains(&i)).collect());
        Ok(Self {
            model: model_of(&site, gravity, &noise)?,
            engine: Engine::new(form, size).ok_or_else(|| choice_error("form", r#""joseph", "ud""#, form))?,
            size,
            settings: Settings { iterations, underweighting, consider: flags },
            bounds,
            relock_after,
            predictive: predictive.map(|(weight, accounted, literal)| Predictive {
                weight,
                accounted,
                literal,
            }),
            adaptive: adaptive.map(|(least, most, memory)| Adaptive { least, most, memory }),
            slots: Vec::new(),
            beliefs: Vec::new(),
            next_key: 1,
            empty: PyDict::new(py).unbind(),
            time: 0.0,
        })
    }

    /// States `(count, 19)` and covariances, or the numbers they are stored in, `(count, n, n)`.
    fn set(&mut self, states: &Bound<'_, PyAny>, matrices: &Bound<'_, PyAny>, stored: bool) -> PyResult<()> {
        let (states, matrices) = (Floats::new(states, "state")?, Floats::new(matrices, "covariance")?);
        let pairs = states.data().chunks(NUMBERS).zip(matrices.data().chunks(self.size * self.size));
        let kept = |matrix: &[f64]| if stored { matrix.to_vec() } else { self.engine.stored(matrix) };
        self.beliefs = pairs.map(|(state, matrix)| Belief::new(state, kept(matrix))).collect();
        Ok(())
    }

    /// `(count, 19)`.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let data = self.beliefs.iter().flat_map(|belief| belief.state.iter().copied()).collect();
        convert::array(py, &[self.beliefs.len(), NUMBERS], data)
    }

    /// `(count, n, n)`.
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let data = self.beliefs.iter().flat_map(|belief| self.engine.matrix(&belief.stored)).collect();
        convert::array(py, &[self.beliefs.len(), self.size, self.size], data)
    }

    /// `(count, n, n)`.
    fn stored<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let data = self.beliefs.iter().flat_map(|belief| belief.stored.iter().copied()).collect();
        convert::array(py, &[self.beliefs.len(), self.size, self.size], data)
    }

    /// Of the state and the constants beside it, `(n + a, n + a)`.
    fn joint_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let belief = self.single()?;
        let (n, a) = (self.size, belief.cross.len() / self.size);
        let state = self.engine.matrix(&belief.stored);
        let entry = |i: usize, j: usize| match (i < n, j < n) {
            (true, true) => state[i * n + j],
            (false, true) => belief.cross[(i - n) * n + j],
            (true, false) => belief.cross[(j - n) * n + i],
            (false, false) => belief.constants[(i - n) * a + j - n],
        };
        let data = (0..(n + a) * (n + a)).map(|k| entry(k / (n + a), k % (n + a))).collect();
        convert::array(py, &[n + a, n + a], data)
    }

    /// Constants of one estimate.
    fn beside(&self, index: usize) -> Option<Beside> {
        let b = self.beliefs.get(index)?;
        let poses = b.poses.iter().map(|p| (p.key, p.at, p.pose)).collect();
        let map = b.map.iter().map(|m| (m.slot, m.landmark, m.at, m.estimated, m.correction)).collect();
        Some((
            b.cross.clone(),
            b.constants.clone(),
            poses,
            map,
            b.since,
            b.model_error,
            b.start.clone(),
            b.adapted,
        ))
    }

    fn set_beside(&mut self, index: usize, beside: Beside) {
        let (cross, constants, poses, map, since, model_error, start, adapted) = beside;
        if let Some(belief) = self.beliefs.get_mut(index) {
            belief.poses = poses.into_iter().map(|(key, at, pose)| Clone6 { key, at, pose }).collect();
            let mapped = |(slot, landmark, at, estimated, correction)| Mapped {
                slot,
                landmark,
                at,
                estimated,
                correction,
            };
            belief.map = map.into_iter().map(mapped).collect();
            (belief.cross, belief.constants) = (cross, constants);
            (belief.since, belief.model_error, belief.adapted) = (since, model_error, adapted);
            belief.start = start;
            self.next_key = belief.poses.iter().map(|pose| pose.key + 1).fold(self.next_key, u64::max);
        }
    }

    /// `(sensor, straight rejections)` of every sensor.
    fn rejections<'py>(&self, py: Python<'py>) -> Vec<(Bound<'py, PyAny>, f64)> {
        self.slots.iter().map(|slot| (slot.sensor.bind(py).clone(), slot.rejected)).collect()
    }

    fn set_rejections(&mut self, py: Python<'_>, counts: Vec<(Bound<'_, PyAny>, f64)>) -> PyResult<()> {
        for (sensor, count) in counts {
            let index = self.slot(py, &sensor)?;
            self.slots[index].rejected = count;
        }
        Ok(())
    }

    /// Remembers the pose; the key to it.
    fn remember(&mut self) -> PyResult<u64> {
        let key = self.next_key;
        self.room_for("clone: remembered poses")?;
        self.beliefs[0] = self.engine.remember(self.single()?, key);
        self.next_key += 1;
        Ok(key)
    }

    /// Forgets a pose; false if there is none of that key.
    fn forget(&mut self, key: u64) -> PyResult<bool> {
        let Some(belief) = self.engine.forget(self.single()?, key) else { return Ok(false) };
        self.beliefs[0] = belief;
        Ok(true)
    }

    /// Keys of the remembered poses, and position and quaternion of each.
    fn poses(&self) -> PyResult<Vec<(u64, [f64; 7])>> {
        Ok(self.single()?.poses.iter().map(|pose| (pose.key, pose.pose)).collect())
    }

    /// Index and correction of the landmarks of a sensor that are estimated.
    fn landmarks(&mut self, py: Python<'_>, sensor: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, [f64; 3])>> {
        let slot = self.slot(py, sensor)?;
        let known = self.single()?.map.iter().filter(|m| m.estimated && m.slot == slot);
        Ok(known.map(|m| (m.landmark, m.correction)).collect())
    }

    /// The model's error as last estimated, `(count, 3)`, m/s².
    fn model_error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let data = self.beliefs.iter().flat_map(|belief| belief.model_error).collect();
        convert::array(py, &[self.beliefs.len(), 3], data)
    }

    /// Predicts (unless `dt` is none) and updates with sensors of one epoch, or nothing if one of them lives in Python.
    #[pyo3(signature = (dt, measurements, control, context, key, /))]
    fn step(
        &mut self,
        py: Python<'_>,
        dt: Option<&Bound<'_, PyAny>>,
        measurements: Vec<(Bound<'_, PyAny>, Bound<'_, PyAny>)>,
        control: Option<&Bound<'_, PyAny>>,
        context: &Bound<'_, PyDict>,
        key: Option<u64>,
    ) -> PyResult<Option<Vec<Step>>> {
        self.single()?;
        let dt = dt.map_or(Ok(0.0), seconds)?;
        let control = sample(control)?;
        let told = Context::new(context)?;
        let mut indices = Vec::with_capacity(measurements.len());
        let mut arrays = Vec::with_capacity(measurements.len());
        let mut others = Vec::with_capacity(measurements.len());
        for (sensor, z) in &measurements {
            let index = self.slot(py, sensor)?;
            let Some(source) = &self.slots[index].source else { return Ok(None) };
            others.push(source.told(&told)?);
            indices.push(index);
            arrays.push(Floats::new(z, "z")?);
        }
        if let Some(key) = key
            && !self.single()?.poses.iter().any(|pose| pose.key == key)
        {
            return Err(InvalidInputError::new_err(format!("clone: no pose is remembered under {key}")));
        }
        let mut channels = Vec::with_capacity(indices.len());
        for ((&index, z), other) in indices.iter().zip(&arrays).zip(&others) {
            let slot = &self.slots[index];
            let Some(source) = other.as_ref().or(slot.source.as_ref()) else { return Ok(None) };
            let z = measurement(z, source.rows)?;
            channels.push(Channel {
                source,
                slot: index,
                map: slot.map.as_ref(),
                measurements: crate::filter::Series::constant(z),
                bounds: self.bounds,
                rejected: slot.rejected,
                known: None,
                key,
            });
        }
        let mut belief = core::mem::take(&mut self.beliefs[0]);
        let plan = self.plan(vec![dt], channels, &control);
        let mut record = arcs::Record::new(&plan, self.size, 1);
        record.prior = Some(Vec::new());
        // Taken out while sensors and settings are borrowed; where the step fails it comes back as it was.
        let rejected = self.engine.fly_one(&self.model, &plan, &mut belief, &mut record);
        drop(plan);
        self.beliefs[0] = belief;
        let rejected = rejected.map_err(explain)?;
        self.time += dt;
        for (&index, count) in indices.iter().zip(rejected) {
            self.slots[index].rejected = count;
        }
        let prior = record.prior.take().unwrap_or_default();
        let (mut from, met) = (0, prior.len() / indices.len().max(1));
        let mut steps = Vec::with_capacity(indices.len());
        for (k, &index) in indices.iter().enumerate() {
            let rows = record.rows[k];
            steps.push(
                Parts {
                    sensor: self.slots[index].sensor.clone_ref(py),
                    context: if context.is_empty() {
                        self.empty.clone_ref(py)
                    } else {
                        context.clone().unbind()
                    },
                    size: self.size,
                    numbers: NUMBERS,
                    prior: prior[k * met..(k + 1) * met].to_vec(),
                    innovation: record.innovation[from..from + rows].to_vec(),
                    nis: record.nis[k],
                    dof: record.dof[k] as usize,
                    accepted: record.accepted[k],
                    used: record.used[from..from + rows].to_vec(),
                    underweighting: self.settings.underweighting,
                    consider: self.settings.considered(),
                }
                .into(),
            );
            from += rows;
        }
        Ok(Some(steps))
    }

    /// Tries rows of unit noise of a sensor in Python, `(M,)` and `(M, n)`: NIS, and whether they were taken.
    fn take(
        &mut self,
        innovation: &Bound<'_, PyAny>,
        jacobian: &Bound<'_, PyAny>,
        bound: f64,
    ) -> PyResult<(f64, bool)> {
        let (y, h) = (Floats::new(innovation, "innovation")?, Floats::new(jacobian, "jacobian")?);
        let options = &self.settings;
        let (belief, nis, accepted) = self.engine.take(self.single()?, y.data(), h.data(), bound, options);
        if accepted {
            self.beliefs[0] = belief;
        }
        Ok((nis, accepted))
    }

    /// The number of straight rejections of a sensor in Python.
    fn rejected(&mut self, py: Python<'_>, sensor: &Bound<'_, PyAny>) -> PyResult<f64> {
        let index = self.slot(py, sensor)?;
        Ok(self.slots[index].rejected)
    }

    /// Whole arcs, or nothing if a sensor lives in Python.
    #[pyo3(signature = (times, measurements, controls, substeps, context, /))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        times: &Bound<'py, PyAny>,
        measurements: Vec<(Bound<'py, PyAny>, Bound<'py, PyAny>, f64)>,
        controls: Option<&Bound<'py, PyAny>>,
        substeps: usize,
        context: &Bound<'py, PyDict>,
    ) -> PyResult<Option<Bound<'py, PyDict>>> {
        arcs::run(self, py, times, &measurements, (controls, substeps), context)
    }
}

impl InertialFilter {
    /// Where the sensor is remembered: the same object, or an equal one.
    fn slot(&mut self, py: Python<'_>, sensor: &Bound<'_, PyAny>) -> PyResult<usize> {
        if let Some(index) = self.slots.iter().position(|slot| slot.sensor.is(sensor)) {
            return Ok(index);
        }
        // What changes with time is told by Python.
        let source = Source::read(sensor)?.filter(|source| !source.time_varying);
        let map = map_of(sensor)?;
        if map.is_some() {
            self.room_for(r#"map_errors: "consider" and "estimate""#)?;
        }
        for (index, slot) in self.slots.iter().enumerate() {
            let same = match (&slot.source, &source) {
                (Some(a), Some(b)) => a == b && slot.map == map,
                (None, None) => slot.sensor.bind(py).eq(sensor).unwrap_or(false),
                _ => false,
            };
            if same {
                return Ok(index);
            }
        }
        self.slots.push(Slot { sensor: sensor.clone().unbind(), source, map, rejected: 0.0 });
        Ok(self.slots.len() - 1)
    }

    /// Constants need a covariance that has room for them.
    pub fn room_for(&self, what: &str) -> PyResult<()> {
        if self.engine.holds_constants() {
            return Ok(());
        }
        Err(InvalidInputError::new_err(format!(r#"{what} need form="joseph", got "ud""#)))
    }

    /// The one estimate.
    fn single(&self) -> PyResult<&Belief> {
        match self.beliefs.as_slice() {
            [belief] => Ok(belief),
            _ => Err(InvalidInputError::new_err(
                "state: this filter holds a batch of states; step them with run(), or give one filter to each",
            )),
        }
    }

    /// What is asked for with the settings of this filter.
    fn plan<'a>(
        &'a self,
        steps: Vec<f64>,
        channels: Vec<Channel<'a>>,
        control: &'a [f64; 6],
    ) -> Flightplan<'a> {
        Flightplan {
            steps,
            substeps: 1,
            controls: crate::filter::Series::constant(control),
            channels,
            relock_after: self.relock_after,
            settings: &self.settings,
            predictive: self.predictive,
            adaptive: self.adaptive,
            strict: true,
        }
    }
}

/// How the errors of a camera's map are accounted for beside the state; nothing if they are not.
fn map_of(sensor: &Bound<'_, PyAny>) -> PyResult<Option<MapPrior>> {
    let Ok(kind) = sensor.getattr("map_errors") else { return Ok(None) };
    let kind: String = kind.extract()?;
    if kind != "consider" && kind != "estimate" {
        return Ok(None);
    }
    let count = sensor.getattr("landmarks")?.len()?;
    let covariances = sensor.call_method1("_map_covariance", (count,))?;
    let covariances = Floats::new(&covariances, "landmark_sigma")?.data().to_vec();
    Ok(Some(MapPrior { estimated: kind == "estimate", covariances }))
}

/// Specific force and rate as six numbers.
fn sample(control: Option<&Bound<'_, PyAny>>) -> PyResult<[f64; 6]> {
    let Some(control) = control else { return Ok([0.0; 6]) };
    if let Ok((force, rate)) = control.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>() {
        let (force, rate) = (Floats::new(&force, "specific_force")?, Floats::new(&rate, "angular_rate")?);
        return match (force.shape(), rate.shape(), force.data(), rate.data()) {
            ([3], [3], &[a, b, c], &[d, e, f]) if [a, b, c, d, e, f].iter().all(|v| v.is_finite()) => {
                Ok([a, b, c, d, e, f])
            }
            ([3], [3], _, _) => Err(option_error("control", "finite numbers", control)),
            ([3], shape, ..) => Err(shape_error("control", "an angular_rate of (3,)", shape)),
            (shape, ..) => Err(shape_error("control", "a specific_force of (3,)", shape)),
        };
    }
    let array = Floats::new(control, "control")?;
    match (array.shape(), array.data().first_chunk::<6>()) {
        ([6], Some(six)) if six.iter().all(|v| v.is_finite()) => Ok(*six),
        ([6], _) => Err(option_error("control", "finite numbers", control)),
        (shape, _) => Err(shape_error("control", "(specific_force, angular_rate), or (6,)", shape)),
    }
}

fn explain(mishap: Mishap) -> PyErr {
    match mishap {
        Mishap::Undefined(error) => {
            DegenerateGeometryError::new_err(format!("update: {error}; the filter is unchanged"))
        }
        Mishap::Prediction => NumericalError::new_err(
            "predict: the predicted state or covariance is not finite; the filter is unchanged",
        ),
        Mishap::Update => {
            NumericalError::new_err("update: the innovation is not finite; the filter is unchanged")
        }
    }
}
