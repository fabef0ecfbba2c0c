//! The fields of `losnav.gravity`: made of the numbers their Python objects hold, kept behind a handle, evaluated over arrays.
use std::sync::Arc;

use losnav_core::math::real::{Real, Work};
use losnav_core::math::vec3::{Mat3, Vec3};
use losnav_core::models::gravity::harmonics::{Term, terms_of};
use losnav_core::models::gravity::polyhedron::{Edge, Face};
use losnav_core::models::gravity::{Gravity, Harmonics, PointMass, Polyhedron, Uniform};
use pyo3::prelude::*;

use crate::convert::{self, Floats};
use crate::dispatch::{LaneJob, Lanes, many, one};
use crate::errors::{InvalidInputError, option_error, shape_error};
use crate::threads::share_out;

/// A field of gravity, whichever it is: cheap to clone.
#[derive(Clone, Debug)]
pub enum AnyGravity {
    PointMass(PointMass),
    Uniform(Uniform),
    Harmonics(Harmonics<Arc<[Term]>>),
    Polyhedron(Polyhedron<Arc<[Edge]>, Arc<[Face]>>),
}

macro_rules! each {
    ($self:ident, $field:ident => $answer:expr) => {
        match $self {
            AnyGravity::PointMass($field) => $answer,
            AnyGravity::Uniform($field) => $answer,
            AnyGravity::Harmonics($field) => $answer,
            AnyGravity::Polyhedron($field) => $answer,
        }
    };
}

impl Gravity for AnyGravity {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        each!(self, field => field.potential(r))
    }
    #[inline(always)]
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        T::apart(Pull { field: self, r })
    }
    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        T::apart(Bend { field: self, r })
    }
}

/// [`Gravity::acceleration`], compiled once for each kind of number, not for every model that flies in it.
struct Pull<'a, T> {
    field: &'a AnyGravity,
    r: Vec3<T>,
}

impl<T: Real> Work for Pull<'_, T> {
    type Output = Vec3<T>;

    #[inline(always)]
    fn run(self) -> Vec3<T> {
        let Self { field, r } = self;
        each!(field, field => field.acceleration(r))
    }
}

/// [`Gravity::acceleration_and_gradient`].
struct Bend<'a, T> {
    field: &'a AnyGravity,
    r: Vec3<T>,
}

impl<T: Real> Work for Bend<'_, T> {
    type Output = (Vec3<T>, Mat3<T>);

    #[inline(always)]
    fn run(self) -> (Vec3<T>, Mat3<T>) {
        let Self { field, r } = self;
        each!(field, field => field.acceleration_and_gradient(r))
    }
}

impl AnyGravity {
    /// The field behind an object of `losnav.gravity`.
    pub fn from_python(gravity: &Bound<'_, PyAny>) -> PyResult<Self> {
        let handle = gravity.getattr("_field").ok();
        match handle.as_ref().and_then(|handle| handle.cast::<GravityField>().ok()) {
            Some(handle) => Ok(handle.get().field.clone()),
            None => Err(option_error("gravity", "a model of losnav.gravity", gravity)),
        }
    }

    /// What one place costs, in nanoseconds or so.
    fn cost(&self) -> usize {
        match self {
            Self::PointMass(_) | Self::Uniform(_) => 4,
            Self::Harmonics(field) => 3 * terms_of(field.degree()),
            Self::Polyhedron(field) => 10 * (field.edges.len() + field.faces.len()),
        }
    }
}

/// What is asked of a field.
#[derive(Clone, Copy)]
enum Question {
    Potential,
    Acceleration,
    Gradient,
    Laplacian,
}

impl Question {
    /// Dimensions and numbers of an answer.
    fn shape(self) -> (&'static [usize], usize) {
        match self {
            Self::Potential | Self::Laplacian => (&[], 1),
            Self::Acceleration => (&[3], 3),
            Self::Gradient => (&[3, 3], 9),
        }
    }
}

/// Places, as many lanes of them at a time as there are.
struct Evaluate<'a> {
    field: &'a AnyGravity,
    question: Question,
    places: &'a [[f64; 3]],
    out: &'a mut [f64],
}

impl LaneJob for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let size = self.question.shape().1;
        for (places, out) in self.places.chunks(V::LANES).zip(self.out.chunks_mut(V::LANES * size)) {
            let last = places.len() - 1;
            let r = [0, 1, 2].map(|axis| V::gather(|lane| places[lane.min(last)][axis]));
            let mut values = [V::zero(); 9];
            match self.question {
                Question::Potential => values[0] = self.field.potential(r),
                Question::Acceleration => values[..3].copy_from_slice(&self.field.acceleration(r)),
                Question::Gradient => {
                    let gradient = self.field.acceleration_and_gradient(r).1;
                    values.copy_from_slice(gradient.as_flattened());
                }
                Question::Laplacian => {
                    if let AnyGravity::Polyhedron(field) = self.field {
                        values[0] = field.laplacian(r);
                    }
                }
            }
            for (lane, out) in out.chunks_mut(size).enumerate() {
                for (value, out) in values.iter().zip(out) {
                    *out = value.lane(lane);
                }
            }
        }
    }
}

/// Nanoseconds of work below which threads cost more than they save (first), and below which the GIL is kept (second).
const SERIAL: usize = 60_000;
const QUICK: usize = 5_000;

fn evaluate(field: &AnyGravity, question: Question, places: &[[f64; 3]], threads: bool) -> Vec<f64> {
    let size = question.shape().1;
    let mut data = vec![0.0; places.len() * size];
    if places.len() == 1 {
        one(Evaluate { field, question, places, out: &mut data });
    } else if !threads {
        many(Evaluate { field, question, places, out: &mut data });
    } else {
        // Whole lanes, and pieces long enough to be worth handing out.
        let piece = 8 * (SERIAL / (64 * field.cost())).max(1);
        let pieces = places.chunks(piece).zip(data.chunks_mut(piece * size));
        share_out(pieces, |(places, out)| many(Evaluate { field, question, places, out }));
    }
    data
}

/// A field of gravity, ready to be evaluated.
#[pyclass(frozen, module = "losnav._core")]
pub struct GravityField {
    field: AnyGravity,
}

impl GravityField {
    fn ask<'py>(
        &self,
        py: Python<'py>,
        question: Question,
        r: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let r = Floats::new(r, "r")?;
        let (Some((3, lead)), (places, [])) = (r.shape().split_last(), r.data().as_chunks::<3>()) else {
            return Err(shape_error("r", "(..., 3)", r.shape()));
        };
        let work = places.len() * self.field.cost();
        let data = if work < QUICK {
            evaluate(&self.field, question, places, false)
        } else {
            py.detach(|| evaluate(&self.field, question, places, work > SERIAL))
        };
        let (tail, size) = question.shape();
        if let Some(k) = data.iter().position(|x| !x.is_finite()) {
            return Err(nowhere(lead, k / size, places[k / size]));
        }
        let shape: Vec<usize> = lead.iter().chain(tail).copied().collect();
        convert::array(py, &shape, data)
    }
}

/// Row `row` of places `(*lead, 3)` has no field.
#[cold]
fn nowhere(lead: &[usize], row: usize, [x, y, z]: [f64; 3]) -> PyErr {
    let (mut index, mut rest) = (Vec::new(), row);
    for n in lead.iter().rev() {
        index.insert(0, (rest % n).to_string());
        rest /= n;
    }
    if let Some((axis, value)) = [x, y, z].iter().enumerate().find(|(_, c)| !c.is_finite()) {
        index.push(axis.to_string());
        let at = index.join(", ");
        return InvalidInputError::new_err(format!("r[{at}]: expected a finite number, got {value}"));
    }
    let at = if index.is_empty() { String::new() } else { format!("[{}]", index.join(", ")) };
    let rule = "expected a place where the field is finite";
    InvalidInputError::new_err(format!("r{at}: {rule}, got [{x}, {y}, {z}]"))
}

#[pymethods]
impl GravityField {
    /// `μ`.
    #[staticmethod]
    #[pyo3(signature = (mu, /))]
    fn point_mass(mu: f64) -> Self {
        Self { field: AnyGravity::PointMass(PointMass { mu }) }
    }

    /// `g`.
    #[staticmethod]
    #[pyo3(signature = (acceleration, /))]
    fn uniform(acceleration: [f64; 3]) -> Self {
        Self { field: AnyGravity::Uniform(Uniform { acceleration }) }
    }

    /// `μ`, radius, and `(K, 2)` coefficients, fully normalised, order by order within each degree.
    #[staticmethod]
    #[pyo3(signature = (mu, radius, coefficients, /))]
    fn harmonics(mu: f64, radius: f64, coefficients: &Bound<'_, PyAny>) -> PyResult<Self> {
        let given = Floats::new(coefficients, "coefficients")?;
        let pairs = given.data().as_chunks::<2>().0;
        // Of a degree n there are (n + 1)(n + 2)/2.
        let degree = (0..=pairs.len()).find(|n| (n + 1) * (n + 2) / 2 >= pairs.len()).unwrap_or(0);
        let room = vec![Term::default(); terms_of(degree)];
        let field = Harmonics::try_new(mu, radius, pairs, room)
            .ok_or_else(|| shape_error("coefficients", "((n + 1)(n + 2)/2, 2)", given.shape()))?;
        Ok(Self { field: AnyGravity::Harmonics(field.keep(Arc::from)) })
    }

    /// `Gσ`, corners of the faces `(F, 3, 3)`, and edges `(E, 4)`: from and to which corner (3 face + corner), as the first
    /// of the two faces that follow goes round.
    #[staticmethod]
    #[pyo3(signature = (density, faces, edges, /))]
    fn polyhedron(density: f64, faces: &Bound<'_, PyAny>, edges: Vec<[usize; 4]>) -> PyResult<Self> {
        let given = Floats::new(faces, "faces")?;
        let corners = given.data().as_chunks::<3>().0;
        let faces: Arc<[Face]> = corners.as_chunks::<3>().0.iter().map(|c| Face::new(*c)).collect();
        let edge = |&[from, to, left, right]: &[usize; 4]| {
            Some(Edge::new(*corners.get(from)?, *corners.get(to)?, [faces.get(left)?, faces.get(right)?]))
        };
        let edges: Option<Arc<[Edge]>> = edges.iter().map(edge).collect();
        let edges =
            edges.ok_or_else(|| shape_error("edges", "indices of faces and corners", given.shape()))?;
        Ok(Self { field: AnyGravity::Polyhedron(Polyhedron { density, edges, faces }) })
    }

    /// `U`, `(...)` of `(..., 3)`.
    #[pyo3(signature = (r, /))]
    fn potential<'py>(&self, py: Python<'py>, r: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.ask(py, Question::Potential, r)
    }

    /// `g`, `(..., 3)` of `(..., 3)`.
    #[pyo3(signature = (r, /))]
    fn acceleration<'py>(&self, py: Python<'py>, r: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.ask(py, Question::Acceleration, r)
    }

    /// `Γ`, `(..., 3, 3)` of `(..., 3)`.
    #[pyo3(signature = (r, /))]
    fn gradient<'py>(&self, py: Python<'py>, r: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.ask(py, Question::Gradient, r)
    }

    /// `∇²U`, `(...)` of `(..., 3)`: of polyhedra; zero of the others.
    #[pyo3(signature = (r, /))]
    fn laplacian<'py>(&self, py: Python<'py>, r: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        self.ask(py, Question::Laplacian, r)
    }

    /// Volume of a polyhedron, m³; negative if its faces are seen from inside.
    fn volume(&self) -> f64 {
        match &self.field {
            AnyGravity::Polyhedron(field) => field.volume(),
            _ => 0.0,
        }
    }
}
