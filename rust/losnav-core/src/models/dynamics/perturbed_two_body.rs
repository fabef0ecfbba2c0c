//! Orbit about the Sun or a planet under the pull of further bodies whose paths are given (third bodies):
//!
//! `r̈ = g(r) − Σ μ_b [(r − b)/|r − b|³ + b/|b|³] + u`,
//!
//! `b(t)` from the centre of `g`, [`TwoBody`]'s field. The second term in the brackets is what the body does to the centre. Far
//! from the body both nearly cancel: their difference is formed without cancelling (Battin, *An Introduction to the
//! Mathematics and Methods of Astrodynamics*, 1999, section 8.4), see [`Field::difference`].
//!
//! Size of the effect: Jupiter pulls Mars off a two-body orbit by 1e-7 m/s² at most, tens of thousands of kilometres in half a
//! year. Left out: what the spacecraft does to the bodies, their flattening, relativity (1e-8 of the Sun's pull), sunlight.
//! Integrated by a method of order 8, each step to 1e-13 of the state; `Φ` is the derivative of it. Outside the ephemerides
//! everything is NaN.
use num_traits::Float;

use super::disturbance::{Path, accumulate};
use super::field::Field;
use super::integrated::{Integrated, Propagate, Transit};
use super::two_body::{TOLERANCE, TwoBody, relative};
use super::{DynamicsModel, Flow, Specimen};
use crate::math::gradient::Gradient;
use crate::math::integrator::{Rates, integrate};
use crate::math::real::Real;
use crate::math::vec3::{Vec3, add, dot, splat, sub};
use crate::models::ephemeris::Piece;

/// A piece of the path of one body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Gravitational parameter of the body, m³/s².
    pub mu: f64,
    /// Pieces of the same body from here on, this one included: they follow each other in time.
    pub left: usize,
    /// Its path.
    pub piece: Piece,
}

/// The centre, and the bodies around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerturbedTwoBody<S> {
    /// The body orbited, and the spectral density of the disturbing acceleration on each axis, m²/s³.
    pub planet: TwoBody,
    /// One body's pieces after another's.
    pub bodies: S,
}

/// What a step needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// When it starts, s.
    time: f64,
    dt: f64,
}

/// Where a body is at a time that is the same in all lanes; NaN where nobody knows.
#[inline(always)]
fn place<T: Real>(pieces: &[Stretch], time: T) -> Vec3<T> {
    let now = time.lane(0);
    let later = pieces.partition_point(|stretch| stretch.piece.start <= now);
    match pieces.get(later.saturating_sub(1)) {
        Some(stretch) if stretch.piece.covers(now) => stretch.piece.position(time),
        _ => [T::splat(f64::NAN); 3],
    }
}

impl<S: AsRef<[Stretch]>> PerturbedTwoBody<S> {
    /// Gravity of all at `time`, m/s².
    #[inline(always)]
    fn gravity<T: Real>(&self, time: f64, r: Vec3<T>) -> Vec3<T> {
        self.gravity_about(r, |pieces| splat(place(pieces, time)))
    }

    /// The same, whoever says where the bodies are.
    #[inline(always)]
    fn gravity_about<T: Real>(&self, r: Vec3<T>, body: impl Fn(&[Stretch]) -> Vec3<T>) -> Vec3<T> {
        let mut pull = self.planet.field().acceleration(r);
        let mut all = self.bodies.as_ref();
        while let Some(first) = all.first() {
            let (own, others) = all.split_at(first.left.clamp(1, all.len()));
            let from_body = sub(r, body(own));
            let field = Field { mu: first.mu, flattening: 0.0 };
            pull = add(pull, field.difference(from_body, r));
            all = others;
        }
        pull
    }

    /// A time in which the motion turns by about a radian, about the centre or the body that is closest in this sense, s.
    #[inline(always)]
    fn pace<T: Real>(&self, time: f64, state: &[T; 6]) -> f64 {
        let mut pace = self.planet.field().pace(state);
        let mut all = self.bodies.as_ref();
        while let Some(first) = all.first() {
            let (own, others) = all.split_at(first.left.clamp(1, all.len()));
            let [x, y, z] = splat(place(own, time));
            let d = [state[0] - x, state[1] - y, state[2] - z];
            let square = dot(d, d);
            for lane in 0..T::LANES {
                let square = square.lane(lane);
                pace = Float::min(pace, Float::sqrt(square * Float::sqrt(square) / first.mu));
            }
            all = others;
        }
        pace
    }
}

impl<S: AsRef<[Stretch]>> Integrated for PerturbedTwoBody<S> {
    type Step = Step;

    #[inline(always)]
    fn moved<T: Real>(&self, step: &Step, state: &[T; 6], control: Vec3<T>) -> [T; 6] {
        let first = 0.1 * self.pace(step.time, state);
        integrate(&Motion { model: self, start: step.time, control }, state, step.dt, first, TOLERANCE)
    }
}

/// The equation of motion under a constant control.
struct Motion<'a, T, S> {
    model: &'a PerturbedTwoBody<S>,
    start: f64,
    control: Vec3<T>,
}

impl<T: Real, S: AsRef<[Stretch]>> Rates<T, 6> for Motion<'_, T, S> {
    #[inline(always)]
    fn rates(&self, time: f64, x: &[T; 6]) -> [T; 6] {
        let [a, b, c] = add(self.model.gravity(self.start + time, [x[0], x[1], x[2]]), self.control);
        [x[3], x[4], x[5], a, b, c]
    }

    #[inline(always)]
    fn relative(&self, error: &[T; 6], x: &[T; 6]) -> T {
        relative(error, x)
    }
}

impl<T: Real, S: AsRef<[Stretch]>> DynamicsModel<T, 6> for PerturbedTwoBody<S> {
    const NAME: &'static str = "PerturbedTwoBody";
    const TIME_VARYING: bool = true;
    type State = [T; 6];
    type Control = [T; 3];
    type Step = Step;

    fn prepare(&self, time: f64, dt: f64) -> Step {
        Step { time, dt }
    }

    #[inline(always)]
    fn propagate(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        T::apart(Propagate { model: self, step, state, control })
    }

    #[inline(always)]
    fn transition(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> ([T; 6], [[T; 6]; 6]) {
        T::apart(Transit { model: self, step, state, control })
    }

    #[inline(always)]
    fn process_noise(&self, step: &Step, state: &[T; 6]) -> [[T; 6]; 6] {
        accumulate(&Along { model: self, start: step.time }, state, step.dt, self.planet.acceleration_psd)
    }
}

impl<T: Real, S: AsRef<[Stretch]>> Flow<T, 6> for PerturbedTwoBody<S> {
    #[inline(always)]
    fn rates(&self, time: T, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let [x, y, z, u, v, w] = *state;
        let [a, b, c] = add(self.gravity_about([x, y, z], |pieces| place(pieces, time)), control);
        [u, v, w, a, b, c]
    }
}

/// The path of a step.
struct Along<'a, S> {
    model: &'a PerturbedTwoBody<S>,
    start: f64,
}

impl<T: Real, S: AsRef<[Stretch]>> Path<T> for Along<'_, S> {
    #[inline(always)]
    fn advance(&self, time: f64, dt: f64, state: &[T; 6]) -> ([T; 6], [[T; 6]; 6]) {
        let step = Step { time: self.start + time, dt };
        DynamicsModel::<T, 6>::transition(self.model, &step, state, [T::zero(); 3])
    }

    #[inline(always)]
    fn pace(&self, time: f64, state: &[T; 6]) -> f64 {
        self.model.pace(self.start + time, state)
    }

    #[inline(always)]
    fn gravity(&self, time: f64, r: Vec3<Gradient<T, 3>>) -> Option<Vec3<Gradient<T, 3>>> {
        Some(self.model.gravity(self.start + time, r))
    }
}

impl Specimen<6> for PerturbedTwoBody<[Stretch; 3]> {
    fn specimen() -> (Self, [f64; 6], [f64; 3], f64) {
        // A low orbit about the Earth, and two bodies too near and too heavy to be true: one on two pieces, curved.
        let (planet, state, control, dt) = TwoBody::specimen();
        let path = |start: f64, length: f64, [x, y, z]: [f64; 3], bend: f64| {
            let axis = |x: f64, v: f64| [x, v * length, bend * length * length, 0.0, 0.0, 0.0, 0.0, 0.0];
            Piece { start, length, coefficients: [axis(x, 9.0e2), axis(y, -3.0e2), axis(z, 5.0e2)] }
        };
        let (first, second, far) = ([2.01e7, 0.9e7, -1.4e7], [2.91e7, 0.6e7, -0.9e7], [-3.0e7, 4.0e7, 1.0e7]);
        let bodies = [
            Stretch { mu: 2.0e13, left: 2, piece: path(-1.0e4, 1.0e4, first, 0.0) },
            Stretch { mu: 2.0e13, left: 1, piece: path(0.0, 2.0e4, second, 1e-2) },
            Stretch { mu: 5.0e13, left: 1, piece: path(-2.0e4, 4.0e4, far, -1e-2) },
        ];
        (Self { planet, bodies }, state, control, dt)
    }
}
