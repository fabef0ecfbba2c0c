//! Motion relative to a target on an eccentric orbit, linear in the separation (Yamanaka & Ankersen 2002).
//!
//! Two close orbits about a point mass part as `δ(t) = Ψ(t, t₀) δ(t₀)` in inertial axes, `Ψ` the transition of the target's own
//! Kepler orbit; seen from the target's rotating frame, `Φ = M(t) Ψ M(t₀)⁻¹`. That is the map Yamanaka and Ankersen give in closed
//! form over the true anomaly (*JGCD* 25(1), 60–66; the oracle of the tests has it so); formed this way it keeps its
//! digits for short steps, for a circle, where it is that of Clohessy and Wiltshire, and towards the parabola. `B`, of a
//! control held in the frame, and `Q` are integrals of `Φ` by Gauss's formula.
//!
//! Size of the effect: at eccentricity 0.1 Clohessy–Wiltshire is wrong by a fifth of the motion within an orbit. Left out: the
//! curvature of separations (`r²/2R`), J₂.
use num_traits::Float;

use super::disturbance::{Path, accumulate, respond};
use super::flow::known_orbit;
use super::lvlh::Frame;
use super::two_body::TwoBody;
use super::{DynamicsModel, Flow, Specimen, kepler};
use crate::math::real::Real;
use crate::math::vec3::dot;

/// The target's orbit and the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YamanakaAnkersen {
    /// Gravitational parameter, m³/s².
    pub mu: f64,
    /// Semi-major axis of the target, m.
    pub semi_major_axis: f64,
    /// Eccentricity, in `[0, 1)`.
    pub eccentricity: f64,
    /// True anomaly at time 0, rad.
    pub true_anomaly: f64,
    /// Spectral density `q` of the disturbing acceleration on each axis, m²/s³.
    pub acceleration_psd: f64,
}

/// `Φ`, `B` and `Q` of one time step: the same for every state.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    phi: [[f64; 6]; 6],
    response: [[f64; 3]; 6],
    noise: [[f64; 6]; 6],
}

impl YamanakaAnkersen {
    /// `[r v]` of the target, periapsis along x, momentum along z.
    fn target(&self, time: f64) -> [f64; 6] {
        let (e, anomaly) = (self.eccentricity, self.true_anomaly);
        let parameter = self.semi_major_axis * (1.0 - e * e);
        let (s, c) = (Float::sin(anomaly), Float::cos(anomaly));
        let (radius, speed) = (parameter / (1.0 + e * c), Float::sqrt(self.mu / parameter));
        let start = [radius * c, radius * s, 0.0, -speed * s, speed * (e + c), 0.0];
        kepler::propagate(self.mu, time, &start, kepler::anomaly(self.mu, time, &start))
    }

    /// What the target goes round.
    fn planet(&self) -> TwoBody {
        TwoBody { mu: self.mu, j2: 0.0, radius: 0.0, acceleration_psd: 0.0 }
    }

    /// `Φ` from `time` on.
    fn phi(&self, time: f64, dt: f64) -> [[f64; 6]; 6] {
        let start = self.target(time);
        let (end, psi) = DynamicsModel::<f64, 6>::transition(&self.planet(), &dt, &start, [0.0; 3]);
        let frame = |[x, y, z, u, v, w]: [f64; 6]| Frame::new([x, y, z], [u, v, w], [0.0; 3]);
        let (before, after) = (frame(start), frame(end));
        let mut phi = [[0.0; 6]; 6];
        for j in 0..6 {
            let mut unit = [0.0; 6];
            unit[j] = 1.0;
            let ([x, y, z], [u, v, w]) = before.apart(&unit);
            let apart = [x, y, z, u, v, w];
            let mut moved = [0.0; 6];
            for i in 0..6 {
                for k in 0..6 {
                    moved[i] += psi[i][k] * apart[k];
                }
            }
            let [x, y, z, u, v, w] = moved;
            let column = after.relative([x, y, z], [u, v, w]);
            for i in 0..6 {
                phi[i][j] = column[i];
            }
        }
        phi
    }
}

/// The transitions from `start` on.
struct Along<'a> {
    model: &'a YamanakaAnkersen,
    start: f64,
}

impl Path<f64> for Along<'_> {
    fn advance(&self, time: f64, dt: f64, state: &[f64; 6]) -> ([f64; 6], [[f64; 6]; 6]) {
        (*state, self.model.phi(self.start + time, dt))
    }

    /// At the periapsis.
    fn pace(&self, _time: f64, _state: &[f64; 6]) -> f64 {
        let nearest = self.model.semi_major_axis * (1.0 - self.model.eccentricity);
        nearest * Float::sqrt(nearest / (self.model.mu * (1.0 + self.model.eccentricity)))
    }
}

impl<T: Real> DynamicsModel<T, 6> for YamanakaAnkersen {
    const NAME: &'static str = "YamanakaAnkersen";
    const TIME_VARYING: bool = true;
    type State = [T; 6];
    type Control = [T; 3];
    type Step = Step;

    fn prepare(&self, time: f64, dt: f64) -> Step {
        let path = Along { model: self, start: time };
        Step {
            phi: if dt == 0.0 { identity() } else { self.phi(time, dt) },
            response: respond(&path, dt),
            noise: accumulate(&path, &[0.0; 6], dt, self.acceleration_psd),
        }
    }

    #[inline(always)]
    fn propagate(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let mut moved = [T::zero(); 6];
        for i in 0..6 {
            for j in 0..6 {
                moved[i] = moved[i].plus(step.phi[i][j], state[j]);
            }
            for j in 0..3 {
                moved[i] = moved[i].plus(step.response[i][j], control[j]);
            }
        }
        moved
    }

    #[inline(always)]
    fn transition(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> ([T; 6], [[T; 6]; 6]) {
        (self.propagate(step, state, control), splat(&step.phi))
    }

    #[inline(always)]
    fn process_noise(&self, step: &Step, _state: &[T; 6]) -> [[T; 6]; 6] {
        splat(&step.noise)
    }
}

impl<T: Real> Flow<T, 6> for YamanakaAnkersen {
    /// `ẍ = (Ω² − n²) x + 2Ωż + Ω'z`, `ÿ = −n² y`, `z̈ = (Ω² + 2n²) z − 2Ωẋ − Ω'x`, with `n² = μ/R³`, `Ω = h/R²` of the target,
    /// and the control.
    #[inline(always)]
    fn rates(&self, time: T, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let [px, py, _, vx, vy, _] = known_orbit(&self.planet(), |t| self.target(t), time);
        let inverse = px.mul_add(px, py * py).recip();
        let pull = T::splat(self.mu) * inverse * inverse.sqrt();
        let turn = px.mul_add(vy, -(py * vx)) * inverse;
        let slower = T::splat(-2.0) * turn * px.mul_add(vx, py * vy) * inverse;
        let [x, y, z, u, v, w] = *state;
        let (square, twice) = (turn * turn, turn + turn);
        [
            u,
            v,
            w,
            dot([square - pull, twice, slower], [x, w, z]) + control[0],
            control[1] - pull * y,
            dot([square + pull + pull, -twice, -slower], [z, u, x]) + control[2],
        ]
    }
}

fn identity() -> [[f64; 6]; 6] {
    let mut one = [[0.0; 6]; 6];
    for i in 0..6 {
        one[i][i] = 1.0;
    }
    one
}

/// The same matrix in every lane.
#[inline(always)]
pub fn splat<T: Real>(matrix: &[[f64; 6]; 6]) -> [[T; 6]; 6] {
    let mut out = [[T::zero(); 6]; 6];
    for i in 0..6 {
        for j in 0..6 {
            out[i][j] = T::splat(matrix[i][j]);
        }
    }
    out
}

impl Specimen<6> for YamanakaAnkersen {
    fn specimen() -> (Self, [f64; 6], [f64; 3], f64) {
        let model = Self {
            mu: 3.986_004_418e14,
            semi_major_axis: 9e6,
            eccentricity: 0.2,
            true_anomaly: 0.7,
            acceleration_psd: 1e-9,
        };
        (model, [-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02], [1e-3, -2e-3, 5e-4], 60.0)
    }
}
