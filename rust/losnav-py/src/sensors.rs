//! The listed sensors over whole arrays: `losnav.sensors`. Arguments come checked from there: `(B, 3)` positions and
//! velocities, `(B, 3, 3)` attitudes, and a sensor's own arrays with a leading dimension of `B` or 1.
use losnav_core::error::ModelError;
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::{Recorder, Row};
use losnav_core::models::sensors::{
    Altimeter, BodyDirection, LandmarkCamera, Law, LineOfSight, Range, RangeBearing, RangeRate, SensorModel,
    SunDirection, Velocimeter,
};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rayon::prelude::*;

use crate::attitude::is_rotation;
use crate::convert::{self, Floats};
use crate::errors::{InvalidInputError, choice_error, shape_error};
use crate::measured::Measured;

/// Below this many measurement rows threads cost more than they save.
const SERIAL: usize = 1 << 13;
/// Columns of a row: `[δp, δv, δα]`.
const COLUMNS: usize = 9;

/// One array of a sensor: a row of `size` numbers for each state, or one for all.
struct Parameter<'a> {
    data: &'a [f64],
    size: usize,
}

impl<'a> Parameter<'a> {
    fn of(&self, k: usize) -> &'a [f64] {
        let from = if self.data.len() == self.size { 0 } else { k * self.size };
        self.data.get(from..from + self.size).unwrap_or(&[])
    }
}

/// Shows the sensor of state `k`, which measured zero with unit noise: its innovation is then `−h(x)`. The first
/// parameter is its place, those that follow are its other fields as far as they matter here.
fn show<S: Measured>(parameters: &[Parameter<'_>], k: usize, law: &mut impl Law<f64>) {
    let mut others = parameters.iter().skip(1);
    let place = parameters.first().map_or(&[][..], |p| p.of(k));
    let other = |field| if field == S::PLACE { place } else { others.next().map_or(&[1.0][..], |p| p.of(k)) };
    let fields: Vec<&[f64]> = (0..S::FIELDS.len()).map(other).collect();
    S::show(&fields, &vec![0.0; S::size(&fields).0], law);
}

/// Writes the predicted measurement and its Jacobian of one state.
struct Write<'a> {
    x: Kinematics<f64>,
    rows: Vec<Row<f64>>,
    predicted: &'a mut [f64],
    jacobian: &'a mut [f64],
    outcome: Result<(), ModelError>,
}

impl Law<f64> for Write<'_> {
    fn examine(&mut self, sensor: &impl SensorModel<f64>) {
        self.rows.resize(sensor.rows(), Row::zero());
        self.outcome = sensor.linearize(&self.x, &mut Recorder::new(&mut self.rows));
        let out = self.predicted.iter_mut().zip(self.jacobian.as_chunks_mut::<COLUMNS>().0);
        for (row, (predicted, jacobian)) in self.rows.iter().zip(out) {
            *predicted = 0.0 - row.innovation;
            jacobian[..3].copy_from_slice(&row.d_position);
            jacobian[3..6].copy_from_slice(&row.d_velocity);
            jacobian[6..].copy_from_slice(&row.d_attitude);
        }
    }
}

/// Counts the rows.
struct Count(usize);

impl Law<f64> for Count {
    fn examine(&mut self, sensor: &impl SensorModel<f64>) {
        self.0 = sensor.rows();
    }
}

/// States as sensors see them.
struct Observers<'a> {
    positions: &'a [[f64; 3]],
    velocities: &'a [[f64; 3]],
    attitudes: &'a [[f64; 9]],
}

impl Observers<'_> {
    fn get(&self, k: usize) -> Kinematics<f64> {
        let [a, b, c, d, e, f, g, h, i] = self.attitudes[k];
        let dcm = [[a, b, c], [d, e, f], [g, h, i]];
        Kinematics { position: self.positions[k], velocity: self.velocities[k], dcm }
    }
}

/// What a sensor says of every state.
struct Rows {
    count: usize,
    predicted: Vec<f64>,
    jacobian: Vec<f64>,
}

/// Predictions `(B, M)` and Jacobians `(B, M, 9)` of a sensor, or the first state where it is undefined.
fn linearize<S: Measured>(
    parameters: &[Parameter<'_>],
    observers: &Observers<'_>,
) -> Result<Rows, (usize, ModelError)> {
    let count = observers.positions.len();
    let mut rows = Count(0);
    show::<S>(parameters, 0, &mut rows);
    let Count(rows) = rows;
    let (mut predicted, mut jacobian) = (vec![0.0; count * rows], vec![0.0; count * rows * COLUMNS]);
    let one = |(k, (predicted, jacobian)): (usize, (&mut [f64], &mut [f64]))| {
        let mut write = Write { x: observers.get(k), rows: Vec::new(), predicted, jacobian, outcome: Ok(()) };
        show::<S>(parameters, k, &mut write);
        write.outcome.map_err(|error| (k, error))
    };
    let size = rows.max(1);
    if count * rows < SERIAL {
        let pairs = predicted.chunks_mut(size).zip(jacobian.chunks_mut(size * COLUMNS));
        pairs.enumerate().try_for_each(one)?;
    } else {
        let pairs = predicted.par_chunks_mut(size).zip(jacobian.par_chunks_mut(size * COLUMNS));
        pairs.with_min_len(16).enumerate().try_for_each(one)?;
    }
    Ok(Rows { count: rows, predicted, jacobian })
}

/// `(M,)` prediction and `(M, 9)` Jacobian of one state `[r]` or `[r v]` and its attitude, or nothing if they are not
/// single, finite and a rotation: the caller then checks and broadcasts.
#[pyfunction]
#[pyo3(signature = (name, parameters, state, dcm, /))]
pub fn sensor_single<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyTuple>,
    state: &Bound<'py, PyAny>,
    dcm: &Bound<'py, PyAny>,
) -> PyResult<Option<(Bound<'py, PyAny>, Bound<'py, PyAny>)>> {
    let (state, dcm) = (Floats::new(state, "state")?, Floats::new(dcm, "dcm")?);
    let (position, velocity) = match (state.shape(), state.data()) {
        ([3], &[x, y, z]) => ([x, y, z], [0.0; 3]),
        ([6], &[x, y, z, u, v, w]) => ([x, y, z], [u, v, w]),
        _ => return Ok(None),
    };
    let (true, Some(attitude)) = (dcm.shape() == [3, 3], dcm.data().first_chunk::<9>()) else {
        return Ok(None);
    };
    if !state.data().iter().all(|v| v.is_finite()) || !is_rotation(attitude) {
        return Ok(None);
    }
    let arrays: Vec<Floats<'_>> =
        parameters.iter().map(|p| Floats::new(&p, "parameters")).collect::<PyResult<_>>()?;
    let parameters: Vec<Parameter<'_>> =
        arrays.iter().map(|a| Parameter { data: a.data(), size: a.data().len() }).collect();
    let observers = Observers { positions: &[position], velocities: &[velocity], attitudes: &[*attitude] };
    macro_rules! choose {
        ($($listed:ident),* $(,)?) => {
            $(if name == <$listed<f64> as SensorModel<f64>>::NAME {
                let rows = linearize::<$listed<f64>>(&parameters, &observers);
                let rows = rows.map_err(|(k, error)| undefined(k, 1, error))?;
                if !rows.jacobian.iter().all(|v| v.is_finite()) {
                    return Ok(None);
                }
                let predicted = convert::array(py, &[rows.count], rows.predicted)?;
                return Ok(Some((predicted, convert::array(py, &[rows.count, COLUMNS], rows.jacobian)?)));
            })*
        };
    }
    losnav_core::sensors! { choose }
    Err(choice_error("sensor", "the listed sensors", name))
}

/// `(B, M)` predicted measurements and `(B, M, 9)` Jacobians, columns `[δp, δv, δα]`.
#[pyfunction]
#[pyo3(signature = (name, parameters, position, velocity, dcm, /))]
pub fn sensor_linearize<'py>(
    py: Python<'py>,
    name: &str,
    parameters: &Bound<'py, PyTuple>,
    position: &Bound<'py, PyAny>,
    velocity: &Bound<'py, PyAny>,
    dcm: &Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let arrays: Vec<Floats<'_>> =
        parameters.iter().map(|p| Floats::new(&p, "parameters")).collect::<PyResult<_>>()?;
    let parameters: Vec<Parameter<'_>> = arrays
        .iter()
        .map(|a| Parameter { data: a.data(), size: a.shape().iter().skip(1).product() })
        .collect();
    let (position, velocity, dcm) =
        (Floats::new(position, "position")?, Floats::new(velocity, "velocity")?, Floats::new(dcm, "dcm")?);
    let observers = Observers {
        positions: position.data().as_chunks::<3>().0,
        velocities: velocity.data().as_chunks::<3>().0,
        attitudes: dcm.data().as_chunks::<9>().0,
    };
    let count = observers.positions.len();
    if observers.velocities.len() != count || observers.attitudes.len() != count {
        return Err(shape_error("dcm", "(B, 3, 3) with (B, 3) positions and velocities", dcm.shape()));
    }
    macro_rules! choose {
        ($($listed:ident),* $(,)?) => {
            $(if name == <$listed<f64> as SensorModel<f64>>::NAME {
                let answer = py.detach(|| linearize::<$listed<f64>>(&parameters, &observers));
                let rows = answer.map_err(|(k, error)| undefined(k, count, error))?;
                let predicted = convert::array(py, &[count, rows.count], rows.predicted)?;
                return Ok((predicted, convert::array(py, &[count, rows.count, COLUMNS], rows.jacobian)?));
            })*
        };
    }
    losnav_core::sensors! { choose }
    Err(choice_error("sensor", "the listed sensors", name))
}

fn undefined(k: usize, count: usize, error: ModelError) -> PyErr {
    let at = if count == 1 { String::new() } else { format!(" (state {k} of the batch)") };
    InvalidInputError::new_err(format!("state: {error}{at}"))
}
