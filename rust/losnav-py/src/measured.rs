//! The listed sensors as Python knows them: what of a dataclass makes the engine's struct, whatever is asked of it.
use losnav_core::math::real::Real;
use losnav_core::models::apparent::{Body, Corrections};
use losnav_core::models::linearization::Weight;
use losnav_core::models::sensors::landmark_camera::{MapError, Optics};
use losnav_core::models::sensors::{
    Altimeter, BodyDirection, LandmarkCamera, Law, LineOfSight, Range, RangeBearing, RangeRate, SunDirection,
    Velocimeter,
};

/// How a listed sensor is made of the arrays its Python object holds and a measurement.
pub trait Measured {
    /// Attributes of the Python object.
    const FIELDS: &'static [&'static str];
    /// Which of them a prediction needs, and may be told anew; the others are noise.
    const PLACE: usize;
    /// Does the measurement depend on the attitude?
    const NEEDS_ATTITUDE: bool;
    /// Does it, as the fields have it?
    fn needs_attitude<A: AsRef<[f64]>>(_fields: &[A]) -> bool {
        Self::NEEDS_ATTITUDE
    }
    /// Does that field change with time?  The Python object tells it for every epoch, by `_seen_at(times)`.
    const TIME_VARYING: bool = false;
    /// Are several states side by side worth their code?  Of a sensor whose batches are small they are not.
    const LANES: bool = true;
    /// Numbers in a measurement, and how many of them are independent.
    fn size<A: AsRef<[f64]>>(fields: &[A]) -> (usize, usize);
    /// Shows the sensor that measured `z`.
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>);
}

#[inline(always)]
fn scalar<V: Real, A: AsRef<[f64]>>(fields: &[A], field: usize) -> V {
    V::splat(fields.get(field).and_then(|f| f.as_ref().first()).copied().unwrap_or(f64::NAN))
}

/// Number `index` of a field as a switch.
#[inline(always)]
fn flag<A: AsRef<[f64]>>(fields: &[A], field: usize, index: usize) -> bool {
    fields.get(field).and_then(|f| f.as_ref().get(index)).is_some_and(|value| *value != 0.0)
}

#[inline(always)]
fn triple<V: Real, A: AsRef<[f64]>>(fields: &[A], field: usize) -> [V; 3] {
    match fields.get(field).map(AsRef::as_ref) {
        Some(&[x, y, z]) => [V::splat(x), V::splat(y), V::splat(z)],
        _ => [V::splat(f64::NAN); 3],
    }
}

/// A field of vectors, one after another.
#[inline(always)]
fn triples<V: Real>(field: &[f64]) -> Vec<[V; 3]> {
    let mut out = Vec::with_capacity(field.len() / 3);
    for p in field.as_chunks::<3>().0 {
        out.push([V::splat(p[0]), V::splat(p[1]), V::splat(p[2])]);
    }
    out
}

#[inline(always)]
fn numbers<V: Real>(field: &[f64]) -> Vec<V> {
    let mut out = Vec::with_capacity(field.len());
    for value in field {
        out.push(V::splat(*value));
    }
    out
}

#[inline(always)]
fn first<V: Real, const M: usize>(z: &[V]) -> [V; M] {
    z.first_chunk::<M>().copied().unwrap_or([V::splat(f64::NAN); M])
}

impl Measured for LineOfSight<'_, f64> {
    const FIELDS: &'static [&'static str] = &["landmarks", "sigma"];
    const PLACE: usize = 0;
    const NEEDS_ATTITUDE: bool = true;

    fn size<A: AsRef<[f64]>>(fields: &[A]) -> (usize, usize) {
        let n = fields.first().map_or(0, |landmarks| landmarks.as_ref().len() / 3);
        (3 * n, 2 * n)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        let [points, sigmas] = fields else { return };
        let (points, sigmas) = (points.as_ref(), sigmas.as_ref());
        let landmarks = triples(points);
        let mut weights = Vec::with_capacity(sigmas.len());
        for sigma in sigmas {
            weights.push(Weight::Scalar(V::splat(1.0 / (sigma * sigma))));
        }
        law.examine(&LineOfSight { landmarks: &landmarks, los: z.as_chunks::<3>().0, weights: &weights });
    }
}

impl Measured for RangeBearing<f64> {
    const FIELDS: &'static [&'static str] = &["sigma_range", "sigma_angle", "target"];
    const PLACE: usize = 2;
    const NEEDS_ATTITUDE: bool = true;

    fn size<A: AsRef<[f64]>>(_fields: &[A]) -> (usize, usize) {
        (3, 3)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
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
    const PLACE: usize = 1;
    const NEEDS_ATTITUDE: bool = false;

    fn size<A: AsRef<[f64]>>(_fields: &[A]) -> (usize, usize) {
        (1, 1)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        law.examine(&Range { measurement: first(z), sigma: scalar(fields, 0), target: triple(fields, 1) });
    }
}

impl Measured for RangeRate<f64> {
    const FIELDS: &'static [&'static str] = &["sigma", "target"];
    const PLACE: usize = 1;
    const NEEDS_ATTITUDE: bool = false;

    fn size<A: AsRef<[f64]>>(_fields: &[A]) -> (usize, usize) {
        (1, 1)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        law.examine(&RangeRate {
            measurement: first(z),
            sigma: scalar(fields, 0),
            target: triple(fields, 1),
        });
    }
}

impl Measured for SunDirection<f64> {
    const FIELDS: &'static [&'static str] = &["sigma", "_seen"];
    const PLACE: usize = 1;
    const NEEDS_ATTITUDE: bool = false;

    fn size<A: AsRef<[f64]>>(_fields: &[A]) -> (usize, usize) {
        (3, 2)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        law.examine(&SunDirection {
            los: first(z),
            sigma: scalar(fields, 0),
            aberration: flag(fields, 1, 0),
        });
    }
}

/// Numbers of the field that describes a camera.
const OPTICS: usize = 16;

#[inline(always)]
fn optics<V: Real>(field: &[f64]) -> Optics<V> {
    let mut n = [V::splat(f64::NAN); OPTICS];
    for (value, number) in n.iter_mut().zip(field) {
        *value = V::splat(*number);
    }
    Optics {
        focal_length: [n[0], n[1]],
        principal_point: [n[2], n[3]],
        camera_from_body: [[n[4], n[5], n[6]], [n[7], n[8], n[9]], [n[10], n[11], n[12]]],
        lever_arm: [n[13], n[14], n[15]],
    }
}

/// Errors of `n` landmarks: a variance for all, one for each, or covariances.
#[inline(always)]
fn map_errors<V: Real>(field: &[f64], n: usize) -> Vec<MapError<V>> {
    if field.len() == 9 * n {
        let mut out = Vec::with_capacity(n);
        for m in field.as_chunks::<3>().0.as_chunks::<3>().0 {
            out.push(MapError::Full(m.map(|row| row.map(V::splat))));
        }
        return out;
    }
    let mut out = Vec::with_capacity(field.len());
    for variance in field {
        out.push(MapError::Scalar(V::splat(*variance)));
    }
    out
}

impl Measured for LandmarkCamera<'_, f64> {
    const FIELDS: &'static [&'static str] = &["landmarks", "_optics", "sigma_px", "_white"];
    const PLACE: usize = 0;
    const NEEDS_ATTITUDE: bool = true;
    const LANES: bool = false;

    fn size<A: AsRef<[f64]>>(fields: &[A]) -> (usize, usize) {
        let n = fields.first().map_or(0, |landmarks| landmarks.as_ref().len() / 3);
        (2 * n, 2 * n)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        let [points, camera, sigmas, white] = fields else { return };
        let landmarks = triples(points.as_ref());
        law.examine(&LandmarkCamera {
            landmarks: &landmarks,
            pixels: z.as_chunks::<2>().0,
            sigmas: &numbers(sigmas.as_ref()),
            map: &map_errors(white.as_ref(), landmarks.len()),
            optics: optics(camera.as_ref()),
        });
    }
}

impl Measured for Velocimeter<'_, f64> {
    const FIELDS: &'static [&'static str] = &["beams", "sigma"];
    const PLACE: usize = 0;
    const NEEDS_ATTITUDE: bool = true;
    const LANES: bool = false;

    fn size<A: AsRef<[f64]>>(fields: &[A]) -> (usize, usize) {
        let n = fields.first().map_or(0, |beams| beams.as_ref().len() / 3);
        (n, n)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        let [beams, sigmas] = fields else { return };
        let (beams, sigmas) = (triples(beams.as_ref()), numbers(sigmas.as_ref()));
        law.examine(&Velocimeter { beams: &beams, measurement: z, sigmas: &sigmas });
    }
}

/// Does an altimeter measure along a beam?
#[inline(always)]
fn slanted<A: AsRef<[f64]>>(fields: &[A]) -> bool {
    fields.first().is_some_and(|beam| !beam.as_ref().is_empty())
}

impl Measured for Altimeter<f64> {
    const FIELDS: &'static [&'static str] = &["_beam", "sigma"];
    const PLACE: usize = 0;
    const NEEDS_ATTITUDE: bool = true;
    const LANES: bool = false;

    fn needs_attitude<A: AsRef<[f64]>>(fields: &[A]) -> bool {
        slanted(fields)
    }

    fn size<A: AsRef<[f64]>>(_fields: &[A]) -> (usize, usize) {
        (1, 1)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        law.examine(&Altimeter {
            measurement: first(z),
            sigma: scalar(fields, 1),
            boresight: slanted(fields).then(|| triple(fields, 0)),
        });
    }
}

impl Measured for BodyDirection<f64> {
    const FIELDS: &'static [&'static str] = &["sigma", "_seen"];
    const PLACE: usize = 1;
    const NEEDS_ATTITUDE: bool = false;
    const LANES: bool = false;
    const TIME_VARYING: bool = true;

    fn size<A: AsRef<[f64]>>(_fields: &[A]) -> (usize, usize) {
        (3, 2)
    }

    #[inline(always)]
    fn show<V: Real, A: AsRef<[f64]>>(fields: &[A], z: &[V], law: &mut impl Law<V>) {
        let corrections = Corrections { light_time: flag(fields, 1, 0), aberration: flag(fields, 1, 1) };
        let number = |index: usize| {
            V::splat(fields.get(1).and_then(|f| f.as_ref().get(index)).copied().unwrap_or(f64::NAN))
        };
        let body = Body {
            position: [number(2), number(3), number(4)],
            velocity: [number(5), number(6), number(7)],
            acceleration: [number(8), number(9), number(10)],
        };
        law.examine(&BodyDirection { los: first(z), sigma: scalar(fields, 0), body, corrections });
    }
}
