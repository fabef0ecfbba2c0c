//! Motion relative to a target on a circular orbit (Clohessy & Wiltshire 1960), in its orbital frame.
//!
//! `ẍ − 2ωż = a_x`, `ÿ + ω²y = a_y`, `z̈ + 2ωẋ − 3ω²z = a_z`, with x along track, y along the negative orbit
//! normal, z to nadir; state `[r v]`, chaser minus target, velocity in the rotating frame. The solution is exact for
//! an acceleration constant over the step; `Q` is exact for white acceleration of spectral density `q`:
//! `Q = q ∫ Φ(t) G Gᵀ Φ(t)ᵀ dt`, `G = [0 I]ᵀ`, coupling of x and z included.
//!
//! Size of the effect: 8 km of drift in an orbit for 1 m/s. Left out: eccentricity, the curvature of the orbit
//! (`r²/2R`, 0.1 m at 1.2 km), J2 (a few metres an orbit for neighbours a few hundred metres apart).
use num_traits::Float;

use super::{DynamicsModel, Flow, Specimen};
use crate::math::matrix::mirrored;
use crate::math::real::Real;

/// The target's orbit and the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClohessyWiltshire {
    /// `ω = √(μ/a³)`, rad/s, not negative; zero is free space.
    pub mean_motion: f64,
    /// Spectral density `q` of the disturbing acceleration on each axis, m²/s³.
    pub acceleration_psd: f64,
}

/// The functions of `τ = ω t` everything else is made of. None loses digits for small `τ`.
struct Phase {
    /// `t`, s.
    time: f64,
    /// `τ`.
    angle: f64,
    /// `sin τ`.
    sin: f64,
    /// `cos τ`.
    cos: f64,
    /// `sin τ/τ`.
    sinc: f64,
    /// `(1 − cos τ)/τ²`.
    versed: f64,
    /// `(τ − sin τ)/τ³`.
    lag: f64,
}

impl Phase {
    fn new(mean_motion: f64, time: f64) -> Self {
        let angle = mean_motion * time;
        let half = sinc(0.5 * angle);
        Self {
            time,
            angle,
            sin: Float::sin(angle),
            cos: Float::cos(angle),
            sinc: sinc(angle),
            versed: 0.5 * half * half,
            lag: lag(angle),
        }
    }
}

/// `sin x/x`; below 1e-4 the series `1 − x²/6`, the first term left out below 1e-18.
fn sinc(x: f64) -> f64 {
    if Float::abs(x) < 1e-4 { 1.0 - x * x / 6.0 } else { Float::sin(x) / x }
}

/// `(x − sin x)/x³`; below ½, where the difference loses digits, `Σ (−x²)ᵏ/(2k+3)!`, the first term left out below 1e-21.
fn lag(x: f64) -> f64 {
    if Float::abs(x) >= 0.5 {
        return (x - Float::sin(x)) / (x * x * x);
    }
    let (mut sum, mut term, mut k) = (0.0, 1.0 / 6.0, 3.0);
    for _ in 0..8 {
        sum += term;
        term *= -x * x / ((k + 1.0) * (k + 2.0));
        k += 2.0;
    }
    sum
}

impl ClohessyWiltshire {
    /// `Φ`. The sign of entry (1, 6) follows from the equations of motion (some printed tables have it negative).
    fn phi(&self, dt: f64) -> [[f64; 6]; 6] {
        let p = Phase::new(self.mean_motion, dt);
        let (w, t, s, c) = (self.mean_motion, p.time, p.sin, p.cos);
        let versed = p.angle * p.angle * p.versed;
        let cross = 2.0 * t * p.angle * p.versed;
        #[rustfmt::skip]
        let rows = [
            [1.0, 0.0, 6.0 * p.angle * p.angle * p.angle * p.lag, t * (4.0 * p.sinc - 3.0), 0.0, cross],
            [0.0, c, 0.0, 0.0, t * p.sinc, 0.0],
            [0.0, 0.0, 1.0 + 3.0 * versed, -cross, 0.0, t * p.sinc],
            [0.0, 0.0, 6.0 * w * versed, 4.0 * c - 3.0, 0.0, 2.0 * s],
            [0.0, -w * s, 0.0, 0.0, c, 0.0],
            [0.0, 0.0, 3.0 * w * s, -2.0 * s, 0.0, c],
        ];
        rows
    }

    /// `Q`.
    fn noise(&self, dt: f64) -> [[f64; 6]; 6] {
        let mut q = [[0.0; 6]; 6];
        let sign = if dt < 0.0 { -1.0 } else { 1.0 };
        for &Entry(i, j, positions, ref f) in &INTEGRANDS {
            let value = sign * self.acceleration_psd * integral(f, positions, self.mean_motion, dt);
            q[i][j] = value;
            q[j][i] = value;
        }
        q
    }

    /// Response to a constant acceleration.
    fn response(&self, dt: f64) -> [[f64; 3]; 6] {
        let p = Phase::new(self.mean_motion, dt);
        let t = p.time;
        let t2 = t * t;
        let lag = 2.0 * t2 * p.angle * p.lag;
        let cross = 2.0 * t * p.angle * p.versed;
        [
            [t2 * (4.0 * p.versed - 1.5), 0.0, lag],
            [0.0, t2 * p.versed, 0.0],
            [-lag, 0.0, t2 * p.versed],
            [t * (4.0 * p.sinc - 3.0), 0.0, cross],
            [0.0, t * p.sinc, 0.0],
            [-cross, 0.0, t * p.sinc],
        ]
    }
}

/// An entry of `Q`: rows, columns, how many of the two are positions, and its integrand over `θ = ω t` as
/// coefficients of `1, θ, θ², cos θ, sin θ, θ cos θ, θ sin θ, cos 2θ, sin 2θ`.
struct Entry(usize, usize, i32, [f64; 9]);

/// The products of the columns of `Φ G`, `[4s − 3θ, −2(1 − c), 4c − 3, −2s]` for a_x, `[2(1 − c), s, 2s, c]` for
/// a_z in `[ωx, ωz, v_x, v_z]`, and `[s, c]` for a_y in `[ωy, v_y]`, reduced to single terms.
#[rustfmt::skip]
const INTEGRANDS: [Entry; 13] = [
    Entry(0, 0, 2, [14.0, 0.0, 9.0,  -8.0,  0.0,   0.0, -24.0, -6.0,  0.0]),
    Entry(0, 2, 2, [ 0.0, 6.0, 0.0,   0.0, -6.0,  -6.0,   0.0,  0.0,  3.0]),
    Entry(2, 2, 2, [ 6.5, 0.0, 0.0,  -8.0,  0.0,   0.0,   0.0,  1.5,  0.0]),
    Entry(0, 3, 1, [ 0.0, 9.0, 0.0,   0.0, -8.0, -12.0,   0.0,  0.0,  6.0]),
    Entry(0, 5, 1, [-5.0, 0.0, 0.0,   2.0,  0.0,   0.0,   6.0,  3.0,  0.0]),
    Entry(2, 3, 1, [11.0, 0.0, 0.0, -14.0,  0.0,   0.0,   0.0,  3.0,  0.0]),
    Entry(2, 5, 1, [ 0.0, 0.0, 0.0,   0.0,  4.0,   0.0,   0.0,  0.0, -1.5]),
    Entry(3, 3, 0, [19.0, 0.0, 0.0, -24.0,  0.0,   0.0,   0.0,  6.0,  0.0]),
    Entry(3, 5, 0, [ 0.0, 0.0, 0.0,   0.0,  6.0,   0.0,   0.0,  0.0, -3.0]),
    Entry(5, 5, 0, [ 2.5, 0.0, 0.0,   0.0,  0.0,   0.0,   0.0, -1.5,  0.0]),
    Entry(1, 1, 2, [ 0.5, 0.0, 0.0,   0.0,  0.0,   0.0,   0.0, -0.5,  0.0]),
    Entry(1, 4, 1, [ 0.0, 0.0, 0.0,   0.0,  0.0,   0.0,   0.0,  0.0,  0.5]),
    Entry(4, 4, 0, [ 0.5, 0.0, 0.0,   0.0,  0.0,   0.0,   0.0,  0.5,  0.0]),
];

/// Where the antiderivative takes over from its series. At one radian it has lost a digit or two to cancellation.
const SERIES: f64 = 1.0;
/// Terms of the series: at [`SERIES`] the next one is below `12·2³⁰/30!`, 5e-23.
const TERMS: u32 = 30;

/// `∫₀ᵗ f dt/ω^positions` with `f` over `θ = ω t`.
fn integral(f: &[f64; 9], positions: i32, mean_motion: f64, time: f64) -> f64 {
    let angle = mean_motion * time;
    if Float::abs(angle) < SERIES {
        return series(f, positions, angle, time);
    }
    let (s, c) = (Float::sin(angle), Float::cos(angle));
    let antiderivative = [
        angle,
        0.5 * angle * angle,
        angle * angle * angle / 3.0,
        s,
        1.0 - c,
        angle * s + c - 1.0,
        s - angle * c,
        s * c,
        s * s,
    ];
    let sum: f64 = f.iter().zip(antiderivative).map(|(a, b)| a * b).sum();
    sum / Float::powi(mean_motion, positions + 1)
}

/// The same as a power series: the `k`-th derivative of `f` at zero is a whole or half number, summed without rounding,
/// so the leading terms cancel exactly and the result keeps its relative accuracy down to `θ = 0`.
fn series(f: &[f64; 9], positions: i32, angle: f64, time: f64) -> f64 {
    // angle^(k − positions) / k!, from k = positions on; before that every derivative vanishes.
    let mut power = Float::powi(time, positions + 1) / if positions == 2 { 2.0 } else { 1.0 };
    let (mut sum, mut doubled) = (0.0, Float::powi(2.0, positions));
    for k in positions..TERMS as i32 {
        let n = f64::from(k);
        // Derivatives at zero: of cos, sin in the order 1, 0, −1, 0; of θ g the k-th is k g^(k−1).
        let cos = |k: i32| match k & 3 {
            0 => 1.0,
            2 => -1.0,
            _ => 0.0,
        };
        let sin = |k: i32| cos(k - 1);
        let polynomial = match k {
            0 => f[0],
            1 => f[1],
            2 => 2.0 * f[2],
            _ => 0.0,
        };
        let derivative = polynomial
            + (f[3] * cos(k) + f[4] * sin(k))
            + n * (f[5] * cos(k - 1) + f[6] * sin(k - 1))
            + doubled * (f[7] * cos(k) + f[8] * sin(k));
        sum += derivative * power / (n + 1.0);
        power *= angle / (n + 1.0);
        doubled *= 2.0;
    }
    sum
}

/// `Φ`, `B` and `Q` of one time step: the same for every state.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    phi: [[f64; 6]; 6],
    response: [[f64; 3]; 6],
    noise: [[f64; 6]; 6],
}

/// Columns that move together: the orbital plane, and across it.
const PLANE: [usize; 4] = [0, 2, 3, 5];
const ACROSS: [usize; 2] = [1, 4];

impl<T: Real> DynamicsModel<T, 6> for ClohessyWiltshire {
    const NAME: &'static str = "ClohessyWiltshire";
    type State = [T; 6];
    type Control = [T; 3];
    type Step = Step;

    fn prepare(&self, _time: f64, dt: f64) -> Step {
        Step { phi: self.phi(dt), response: self.response(dt), noise: self.noise(dt) }
    }

    #[inline(always)]
    fn propagate(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let mut moved = [T::zero(); 6];
        for i in 0..6 {
            for j in 0..6 {
                moved[i] = T::splat(step.phi[i][j]).mul_add(state[j], moved[i]);
            }
            for j in 0..3 {
                moved[i] = T::splat(step.response[i][j]).mul_add(control[j], moved[i]);
            }
        }
        moved
    }

    #[inline(always)]
    fn transition(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> ([T; 6], [[T; 6]; 6]) {
        let mut phi = [[T::zero(); 6]; 6];
        for i in 0..6 {
            for j in 0..6 {
                phi[i][j] = T::splat(step.phi[i][j]);
            }
        }
        (self.propagate(step, state, control), phi)
    }

    #[inline(always)]
    fn process_noise(&self, step: &Step, _state: &[T; 6]) -> [[T; 6]; 6] {
        let mut noise = [[T::zero(); 6]; 6];
        for i in 0..6 {
            for j in 0..6 {
                noise[i][j] = T::splat(step.noise[i][j]);
            }
        }
        noise
    }

    /// A third of the products: `Φ` is a block of four and a block of two.
    #[inline(always)]
    fn carry(&self, step: &Step, _transition: &[[T; 6]; 6], covariance: &[[T; 6]; 6]) -> [[T; 6]; 6] {
        // Φ P, then (Φ P) Φᵀ, by blocks.
        let mut half = [[T::zero(); 6]; 6];
        for j in 0..6 {
            for i in PLANE {
                for k in PLANE {
                    half[i][j] = T::splat(step.phi[i][k]).mul_add(covariance[k][j], half[i][j]);
                }
            }
            for i in ACROSS {
                for k in ACROSS {
                    half[i][j] = T::splat(step.phi[i][k]).mul_add(covariance[k][j], half[i][j]);
                }
            }
        }
        let mut out = [[T::zero(); 6]; 6];
        for i in 0..6 {
            for j in PLANE {
                if j >= i {
                    for k in PLANE {
                        out[i][j] = half[i][k].mul_add(T::splat(step.phi[j][k]), out[i][j]);
                    }
                }
            }
            for j in ACROSS {
                if j >= i {
                    for k in ACROSS {
                        out[i][j] = half[i][k].mul_add(T::splat(step.phi[j][k]), out[i][j]);
                    }
                }
            }
        }
        mirrored(&out)
    }
}

impl<T: Real> Flow<T, 6> for ClohessyWiltshire {
    #[inline(always)]
    fn rates(&self, _time: T, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let (turn, pull) = (T::splat(2.0 * self.mean_motion), T::splat(self.mean_motion * self.mean_motion));
        let [_, y, z, vx, vy, vz] = *state;
        let [ax, ay, az] = control;
        [
            vx,
            vy,
            vz,
            turn.mul_add(vz, ax),
            (-pull).mul_add(y, ay),
            (-turn).mul_add(vx, (T::splat(3.0) * pull).mul_add(z, az)),
        ]
    }
}

impl Specimen<6> for ClohessyWiltshire {
    fn specimen() -> (Self, [f64; 6], [f64; 3], f64) {
        let model = Self { mean_motion: 1.04248275e-3, acceleration_psd: 1e-9 };
        (model, [-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02], [1e-3, -2e-3, 5e-4], 60.0)
    }
}
