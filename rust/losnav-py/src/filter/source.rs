//! Where measurements come from: a listed sensor, read once from its Python object and then made afresh, in any
//! lanes, around every measurement.
use losnav_core::models::sensors::{Law, LineOfSight, Range, RangeBearing, RangeRate, SensorModel};
use pyo3::prelude::*;

use crate::convert::Floats;
use crate::dispatch::Lanes;
use crate::errors::shape_error;
use crate::measured::Measured;

/// A listed sensor without a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Source {
    name: &'static str,
    /// Place in the list of sensors.
    place: usize,
    fields: Vec<Vec<f64>>,
    /// Numbers in a measurement.
    pub rows: usize,
    /// How many of them are independent.
    pub dof: usize,
    /// Does the measurement depend on the attitude?
    pub needs_attitude: bool,
}

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
        Ok(Self { name, place, fields, rows, dof, needs_attitude: M::NEEDS_ATTITUDE })
    }

    /// The same sensor with other landmarks.
    pub fn with_landmarks(&self, landmarks: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = Floats::new(landmarks, "landmarks")?;
        let common = self.fields.get(1).is_some_and(|sigma| sigma.len() == 1);
        let mut other = self.clone();
        match (self.name, array.shape(), other.fields.first_mut()) {
            ("LineOfSight", &[n, 3], Some(field)) if common || field.len() == 3 * n => {
                *field = array.data().to_vec();
                (other.rows, other.dof) = (3 * n, 2 * n);
                Ok(other)
            }
            ("LineOfSight", shape, _) => Err(shape_error("landmarks", "(N, 3), one for each sigma", shape)),
            // One point: where the target is.
            (_, &[3] | &[1, 3], _) => {
                if let Some(field) = other.fields.last_mut() {
                    *field = array.data().to_vec();
                }
                Ok(other)
            }
            (_, shape, _) => Err(shape_error("landmarks", "(3,), the target", shape)),
        }
    }

    /// Shows the sensor that measured `z`.
    #[inline(always)]
    pub fn show<V: Lanes>(&self, z: &[V], law: &mut impl Law<V>) {
        macro_rules! choose {
            ($($listed:ident),* $(,)?) => {{
                let mut place = 0;
                $(
                    if self.place == place {
                        return <$listed<f64> as Measured>::show(&self.fields, z, law);
                    }
                    place += 1;
                )*
                let _ = place;
            }};
        }
        losnav_core::sensors! { choose }
    }
}
