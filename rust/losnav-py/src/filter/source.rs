//! Where measurements come from: a listed sensor, read once from its Python object and then made afresh, in any
//! lanes, around every measurement.
use losnav_core::math::real::Real;
use losnav_core::models::sensors::{
    Altimeter, BodyDirection, LandmarkCamera, Law, LineOfSight, Range, RangeBearing, RangeRate, SensorModel,
    SunDirection, Velocimeter,
};
use pyo3::prelude::*;

use super::Context;
use crate::convert::Floats;
use crate::errors::{InvalidInputError, shape_error};
use crate::measured::Measured;

/// A listed sensor without a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    name: &'static str,
    /// Place in the list of sensors.
    place: usize,
    /// Which field the caller may tell anew.
    place_field: usize,
    fields: Vec<Vec<f64>>,
    /// Numbers in a measurement.
    pub rows: usize,
    /// How many of them are independent.
    pub dof: usize,
    /// Does the measurement depend on the attitude?
    pub needs_attitude: bool,
    /// Is it told anew at every epoch what it looks at?
    pub time_varying: bool,
    /// Is it there for several states side by side?
    pub lanes: bool,
}

/// Fields of a sensor at most.
const FIELDS: usize = 8;

impl Source {
    /// The sensor behind a Python object; nothing if that is not exactly one of the listed classes.
    pub fn read(sensor: &Bound<'_, PyAny>) -> PyResult<Option<Self>> {
        let class = sensor.get_type();
        if !class.module()?.to_cow()?.starts_with("losnav.sensors") {
            return Ok(None);
        }
        let class = class.name()?;
        let class = class.to_cow()?;
        macro_rules! choose {
            ($($listed:ident),* $(,)?) => {{
                let mut place = 0;
                $(
                    let name = <$listed<f64> as SensorModel<f64>>::NAME;
                    if class == name {
                        return Self::of::<$listed<f64>>(name, place, sensor).map(Some);
                    }
                    place += 1;
                )*
                let _ = place;
            }};
        }
        losnav_core::sensors! { choose }
        Ok(None)
    }

    fn of<M: Measured>(name: &'static str, place: usize, sensor: &Bound<'_, PyAny>) -> PyResult<Self> {
        let field =
            |attribute: &&str| Ok(Floats::new(&sensor.getattr(*attribute)?, attribute)?.data().to_vec());
        let fields = M::FIELDS.iter().map(field).collect::<PyResult<Vec<_>>>()?;
        let (rows, dof) = M::size(&fields);
        Ok(Self {
            name,
            place,
            place_field: M::PLACE,
            rows,
            dof,
            needs_attitude: M::needs_attitude(&fields),
            time_varying: M::TIME_VARYING,
            lanes: M::LANES,
            fields,
        })
    }

    /// The same sensor with the landmarks, or the target, that the caller tells; nothing if it is told neither.
    pub fn told(&self, context: &Context<'_>) -> PyResult<Option<Self>> {
        let (argument, given) = match self.name {
            "LineOfSight" | "LandmarkCamera" => ("landmarks", &context.landmarks),
            "RangeBearing" | "Range" | "RangeRate" => ("target", &context.target),
            _ => return Ok(None),
        };
        let Some(given) = given else { return Ok(None) };
        let array = Floats::new(given, argument)?;
        if !array.data().iter().all(|value| value.is_finite()) {
            let text = format!("{argument}: expected finite numbers, got NaN or infinity");
            return Err(InvalidInputError::new_err(text));
        }
        // Fields with one number for each landmark, or one for all.
        let (each, rows) = if self.name == "LandmarkCamera" { (2..4, 2) } else { (1..2, 3) };
        let common = self.fields.get(each).is_some_and(|fields| fields.iter().all(|field| field.len() <= 1));
        let mut other = self.clone();
        match (argument, array.shape()) {
            ("landmarks", &[n, 3]) if n > 0 && (common || rows * n == self.rows) => {
                (other.rows, other.dof) = (rows * n, 2 * n);
            }
            ("landmarks", shape) => return Err(shape_error(argument, "(N, 3), one for each sigma", shape)),
            (_, &[3]) => {}
            (_, shape) => return Err(shape_error(argument, "(3,)", shape)),
        }
        if let Some(field) = other.fields.get_mut(self.place_field) {
            *field = array.data().to_vec();
        }
        Ok(Some(other))
    }

    /// Numbers of the measurement that are judged together: those of one direction, one landmark, or all.
    pub fn block(&self) -> usize {
        match self.name {
            "LineOfSight" => 3,
            "LandmarkCamera" => 2,
            _ => self.rows.max(1),
        }
    }

    /// Moves a landmark.
    pub fn shift(&mut self, landmark: usize, by: [f64; 3]) {
        let Some(field) = self.fields.get_mut(self.place_field) else { return };
        for (value, by) in field.iter_mut().skip(3 * landmark).zip(by) {
            *value += by;
        }
    }

    /// What a sensor that changes with time looks at, `(…, numbers)`; nothing of the others.
    pub fn seen_at<'py, A>(&self, sensor: &Bound<'py, PyAny>, times: A) -> PyResult<Option<Floats<'py>>>
    where
        A: IntoPyObject<'py>,
    {
        if !self.time_varying {
            return Ok(None);
        }
        Floats::new(&sensor.call_method1("_seen_at", (times,))?, "_seen_at").map(Some)
    }

    /// Shows the sensor that measured `z`, while it looked at `seen` if it changes with time.
    #[inline(always)]
    pub fn show<V: Real>(&self, seen: &[f64], z: &[V], law: &mut impl Law<V>) {
        let mut fields: [&[f64]; FIELDS] = [&[]; FIELDS];
        let count = self.fields.len().min(FIELDS);
        for (field, own) in fields.iter_mut().zip(&self.fields) {
            *field = own;
        }
        if self.time_varying {
            fields[self.place_field] = seen;
        }
        let fields = &fields[..count];
        macro_rules! choose {
            ($($listed:ident),* $(,)?) => {{
                let mut place = 0;
                $(
                    if self.place == place {
                        if V::LANES == 1 || <$listed<f64> as Measured>::LANES {
                            <$listed<f64> as Measured>::show(fields, z, law);
                        }
                        return;
                    }
                    place += 1;
                )*
                let _ = place;
            }};
        }
        losnav_core::sensors! { choose }
    }
}
