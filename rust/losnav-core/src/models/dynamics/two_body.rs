//! Orbit about a planet in inertial axes: `r̈ = −μ r/r³ + a_J₂ + u`, state `[r v]`, the planet's pole along z if it is flattened.
//!
//! A point mass without control is propagated in closed form ([`kepler`]), everything else by an integrator of order 8
//! (a step's error below 1e-13 of the state); `Φ` is the derivative of that very propagation, carried through it.
//! `Q` is that of white acceleration along the path without control. See [`field`](super::field) for sizes and what is left
//! out.
use super::disturbance::{Path, accumulate};
use super::field::Field;
use super::{DynamicsModel, Flow, Specimen, kepler};
use crate::math::gradient::Gradient;
use crate::math::integrator::{Rates, integrate};
use crate::math::real::{Real, Work};
use crate::math::vec3::{Vec3, dot};

/// Error of a step of the integrator, relative to position and velocity.
pub const TOLERANCE: f64 = 1e-13;

/// The planet and the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoBody {
    /// Gravitational parameter, m³/s².
    pub mu: f64,
    /// `J₂`; zero for a point mass.
    pub j2: f64,
    /// Equatorial radius `J₂` goes with, m.
    pub radius: f64,
    /// Spectral density `q` of the disturbing acceleration on each axis, m²/s³.
    pub acceleration_psd: f64,
}

/// The equation of motion under a constant control.
struct Orbit<T> {
    field: Field,
    control: Vec3<T>,
}

impl<T: Real> Rates<T, 6> for Orbit<T> {
    #[inline(always)]
    fn rates(&self, _time: f64, x: &[T; 6]) -> [T; 6] {
        let [a, b, c] = self.field.acceleration([x[0], x[1], x[2]]);
        [x[3], x[4], x[5], a + self.control[0], b + self.control[1], c + self.control[2]]
    }

    #[inline(always)]
    fn relative(&self, error: &[T; 6], x: &[T; 6]) -> T {
        relative(error, x)
    }
}

/// The larger of the errors of position and velocity beside their sizes.
#[inline(always)]
pub fn relative<T: Real>(error: &[T; 6], x: &[T; 6]) -> T {
    let square = |v: &[T; 6], k: usize| dot([v[k], v[k + 1], v[k + 2]], [v[k], v[k + 1], v[k + 2]]);
    (square(error, 0) / square(x, 0)).max(square(error, 3) / square(x, 3)).sqrt()
}

impl TwoBody {
    /// The planet's gravity.
    #[inline(always)]
    pub fn field(&self) -> Field {
        Field { mu: self.mu, flattening: self.j2 * self.radius * self.radius }
    }

    /// In closed form?
    #[inline(always)]
    fn kepler<T: Real>(&self, control: Vec3<T>) -> bool {
        self.j2 == 0.0 && control == [T::zero(); 3]
    }

    #[inline(always)]
    fn integrated<T: Real>(&self, dt: f64, state: &[T; 6], control: Vec3<T>) -> [T; 6] {
        let field = self.field();
        let first = 0.1 * field.pace(state);
        integrate(&Orbit { field, control }, state, dt, first, TOLERANCE)
    }
}

impl<T: Real> DynamicsModel<T, 6> for TwoBody {
    const NAME: &'static str = "TwoBody";
    type State = [T; 6];
    type Control = [T; 3];
    type Step = f64;

    fn prepare(&self, _time: f64, dt: f64) -> f64 {
        dt
    }

    #[inline(always)]
    fn propagate(&self, dt: &f64, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        T::apart(Propagate { model: self, dt: *dt, state, control })
    }

    #[inline(always)]
    fn transition(&self, dt: &f64, state: &[T; 6], control: [T; 3]) -> ([T; 6], [[T; 6]; 6]) {
        T::apart(Transit { model: self, dt: *dt, state, control })
    }

    #[inline(always)]
    fn process_noise(&self, dt: &f64, state: &[T; 6]) -> [[T; 6]; 6] {
        accumulate(self, state, *dt, self.acceleration_psd)
    }
}

/// [`DynamicsModel::propagate`].
struct Propagate<'a, T> {
    model: &'a TwoBody,
    dt: f64,
    state: &'a [T; 6],
    control: Vec3<T>,
}

impl<T: Real> Work for Propagate<'_, T> {
    type Output = [T; 6];

    #[inline(always)]
    fn run(self) -> [T; 6] {
        let Self { model, dt, state, control } = self;
        if model.kepler(control) {
            kepler::propagate(model.mu, dt, state, kepler::anomaly(model.mu, dt, state))
        } else {
            model.integrated(dt, state, control)
        }
    }
}

/// [`DynamicsModel::transition`].
struct Transit<'a, T> {
    model: &'a TwoBody,
    dt: f64,
    state: &'a [T; 6],
    control: Vec3<T>,
}

impl<T: Real> Work for Transit<'_, T> {
    type Output = ([T; 6], [[T; 6]; 6]);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Self { model, dt, state, control } = self;
        let variables = Gradient::variables(state);
        let moved = if model.kepler(control) {
            let anomaly = Gradient::constant(kepler::anomaly(model.mu, dt, state));
            kepler::propagate(model.mu, dt, &variables, anomaly)
        } else {
            let control = [control[0], control[1], control[2]].map(Gradient::constant);
            model.integrated(dt, &variables, control)
        };
        Gradient::split(&moved)
    }
}

impl<T: Real> Path<T> for TwoBody {
    #[inline(always)]
    fn advance(&self, _time: f64, dt: f64, state: &[T; 6]) -> ([T; 6], [[T; 6]; 6]) {
        DynamicsModel::<T, 6>::transition(self, &dt, state, [T::zero(); 3])
    }

    #[inline(always)]
    fn pace(&self, _time: f64, state: &[T; 6]) -> f64 {
        self.field().pace(state)
    }

    #[inline(always)]
    fn gravity(&self, _time: f64, r: Vec3<Gradient<T, 3>>) -> Option<Vec3<Gradient<T, 3>>> {
        Some(self.field().acceleration(r))
    }
}

impl<T: Real> Flow<T, 6> for TwoBody {
    #[inline(always)]
    fn rates(&self, _time: T, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let [x, y, z, u, v, w] = *state;
        let [a, b, c] = self.field().acceleration([x, y, z]);
        [u, v, w, a + control[0], b + control[1], c + control[2]]
    }
}

impl Specimen<6> for TwoBody {
    fn specimen() -> (Self, [f64; 6], [f64; 3], f64) {
        // The Earth (EGM96, WGS 84 radius) and a low orbit, inclined and a little eccentric.
        let model =
            Self { mu: 3.986_004_418e14, j2: 1.082_626_68e-3, radius: 6_378_137.0, acceleration_psd: 1e-9 };
        let state = [4.1e6, -3.2e6, 4.9e6, 4.9e3, 5.6e3, -0.4e3];
        (model, state, [1e-3, -2e-3, 5e-4], 60.0)
    }
}
