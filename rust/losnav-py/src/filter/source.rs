//! Where measurements come from: a listed sensor, read once from its Python object and then made afresh, in any
//! lanes, around every measurement.
use losnav_core::models::linearization::Weight;
use losnav_core::models::sensors::{Law, LineOfSight, Range, RangeBearing, RangeRate, SensorModel};
use pyo3::prelude::*;

use crate::convert::Floats;
use crate::dispatch::Lanes;
use crate::errors::shape_error;

/// How a listed sensor is made of the arrays its Python object holds and a measurement.
trait Measured {
    /// Attributes of the Python object.
    const FIELDS: &'static [&'static str];
    /// Does the measurement depend on the attitude?
    const NEEDS_ATTITUDE: bool;
    /// Numbers in a measurement, and how many of them are independent.
    fn size(fields: &[Vec<f64>]) -> (usize, usize);
    /// Shows the sensor that measured `z`.
    fn show<V: Lanes>(fields: &[Vec<f64>], z: &[V], law: &mut impl Law<V>);
}

#[inline(always)]
fn scalar<V: Lanes>(fields: &[Vec<f64>], field: usize) -> V {
    V::splat(fields.get(field).and_then(|f| f.first()).copied().unwrap_or(f64::NAN))
}

#[inline(always)]
fn triple<V: Lanes>(fields: &[Vec<f64>], field: usize) -> [V; 3] {
    match fields.get(field).map(Vec::as_slice) {
        Some(&[x, y, z]) => [V::splat(x), V::splat(y), V::splat(z)],
        _ => [V::splat(f64::NAN); 3],
    }
}

#[inline(always)]
fn first<V: Lanes, const M: usize>(z: &[V]) -> [V; M] {
    z.first_chunk::<M>().copied().unwrap_or([V::splat(f64::NAN); M])
}

impl Measured for LineOfSight<'_, f64> {
    const FIELDS: &'static [&'static str] = &["landmarks", "sigma"];
    const NEEDS_ATTITUDE: bool = true;

    fn size(fields: &[Vec<f64>]) -> (usize, usize) {
        let n = fields.first().map_or(0, |landmarks| landmarks.len() / 3);
        (3 * n, 2 * n)
    }

    #[inline(always)]
    fn show<V: Lanes>(fields: &[Vec<f64>], z: &[V], law: &mut impl Law<V>) {
        let [points, sigmas] = fields else { return };
        let mut landmarks = Vec::with_capacity(points.len() / 3);
        for p in points.as_chunks::<3>().0 {
            landmarks.push([V::splat(p[0]), V::splat(p[1]), V::splat(p[2])]);
        }
        let mut weights = Vec::with_capacity(sigmas.len());
        for sigma in sigmas {
            weights.push(Weight::Scalar(V::splat(1.0 / (sigma * sigma))));
        }
        law.examine(&LineOfSight { landmarks: &landmarks, los: z.as_chunks::<3>().0, weights: &weights });
    }
}

impl Measured for RangeBearing<f64> {
    const FIELDS: &'static [&'static str] = &["sigma_range", "sigma_angle", "target"];
    const NEEDS_ATTITUDE: bool = true;

    fn size(_fields: &[Vec<f64>]) -> (usize, usize) {
        (3, 3)
    }

    #[inline(always)]
    fn show<V: Lanes>(fields: &[Vec<f64>], z: &[V], law: &mut impl Law<V>) {
        law.examine(&RangeBearing {
            measurement: first(z),
            sigma_range: scalar(fields, 0),
            sigma_angle: scalar(fields, 1),
            target: triple(fields, 2),
        });
    }
}

impl Measured for Range<f64> {
    const FIELDS: &'static [&'static str] = &["sigma", "target"];
    const NEEDS_ATTITUDE: bool = false;

    fn size(_fields: &[Vec<f64>]) -> (usize, usize) {
        (1, 1)
    }

    #[inline(always)]
    fn show<V: Lanes>(fields: &[Vec<f64>], z: &[V], law: &mut impl Law<V>) {
        law.examine(&Range { measurement: first(z), sigma: scalar(fields, 0), target: triple(fields, 1) });
    }
}

impl Measured for RangeRate<f64> {
    const FIELDS: &'static [&'static str] = &["sigma", "target"];
    const NEEDS_ATTITUDE: bool = false;

    fn size(_fields: &[Vec<f64>]) -> (usize, usize) {
        (1, 1)
    }

    #[inline(always)]
    fn show<V: Lanes>(fields: &[Vec<f64>], z: &[V], law: &mut impl Law<V>) {
        law.examine(&RangeRate {
            measurement: first(z),
            sigma: scalar(fields, 0),
            target: triple(fields, 1),
        });
    }
}

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
