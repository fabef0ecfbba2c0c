//! Motion about a point mass, in closed form: universal variables, every conic, both ways, any number of revolutions.
//!
//! With lengths in units of `|r|` and times of `√(|r|³/μ)`, `α = 2 − v²` and `σ = r·v`, the universal anomaly `χ` solves
//!
//! `τ = U₁ + σ U₂ + U₃`,  `U_k = χᵏ c_k(α χ²)` (Stumpff),
//!
//! and `r' = F r + G v`, `v' = F_t r + G_t v` with `F = 1 − U₂`, `G = U₁ + σ U₂`, `F_t = −U₁/ρ`, `G_t = 1 − U₂/ρ`,
//! `ρ = U₀ + σ U₁ + U₂`. Battin, *An Introduction to the Mathematics and Methods of Astrodynamics*, 1999, section 4.5.
//!
//! 1. On an ellipse leave out whole revolutions.
//! 2. Solve for `χ` by Laguerre's method (Conway 1986) inside a bracket that only shrinks.
//! 3. Two steps of Newton's method: to rounding, and so that numbers that carry derivatives carry those of the root.
use core::f64::consts::TAU;

use crate::math::real::{Mask, Real};
use crate::math::vec3::{Vec3, dot};

/// Steps of Laguerre's method: a handful is enough from anywhere met, the bracket guards the rest.
const MAX_ITERATIONS: usize = 60;
/// Relative change of `χ` below which two steps of Newton's method end at rounding.
const CLOSE: f64 = 1e-7;
/// Largest `χ √−α`: a hyperbola there is at 1e173 times its start.
const FARTHEST: f64 = 400.0;

/// The orbit in its own units.
#[derive(Clone, Copy)]
struct Orbit<T> {
    /// `2 − v²`: positive on an ellipse.
    alpha: T,
    /// `r·v`, of the time-reversed orbit if the step goes back.
    sigma: T,
    /// The step, not negative.
    span: T,
    /// `1` forward, `−1` back.
    sign: T,
    /// Unit of time, s.
    time: T,
}

/// `U₀ … U₃`.
type Universal<T> = [T; 4];

impl<T: Real> Orbit<T> {
    #[inline(always)]
    fn new(mu: f64, dt: f64, r: Vec3<T>, v: Vec3<T>) -> Self {
        let radius = dot(r, r).sqrt();
        let speed = (T::splat(mu) / radius).sqrt();
        let time = radius / speed;
        let alpha = T::splat(2.0) - dot(v, v) / (speed * speed);
        let span = T::splat(dt) / time;
        // Whole revolutions: of none where the period is beyond reckoning.
        let round = T::splat(1e-6).lt(alpha);
        let tame = T::select(round, alpha, T::one());
        let period = T::splat(TAU) / (tame * tame.sqrt());
        let span = T::select(round, span - (span / period).round() * period, span);
        let sign = T::select(span.lt(T::zero()), -T::one(), T::one());
        Self { alpha, sigma: sign * dot(r, v) / (radius * speed), span: sign * span, sign, time }
    }

    /// The functions of `χ` everything is made of.
    #[inline(always)]
    fn universal(&self, chi: T) -> Universal<T> {
        let psi = self.alpha * chi * chi;
        let [c0, c1, c2, c3] = stumpff(psi);
        [c0, chi * c1, chi * chi * c2, chi * chi * chi * c3]
    }

    /// What Kepler's equation leaves at `χ`, and its two derivatives, the radius first.
    #[inline(always)]
    fn residual(&self, chi: T) -> [T; 3] {
        let [u0, u1, u2, u3] = self.universal(chi);
        let left = u1 + (self.sigma.mul_add(u2, u3) - self.span);
        let radius = u0 + self.sigma.mul_add(u1, u2);
        [left, radius, self.sigma.mul_add(u0, (T::one() - self.alpha) * u1)]
    }

    /// `χ` to [`CLOSE`].
    #[inline(always)]
    fn solve(&self) -> T {
        let one = T::one();
        // Mean motion on an ellipse; elsewhere between linear for short spans and the root of long ones.
        let ellipse = T::splat(0.1).lt(self.alpha);
        let mut chi =
            T::select(ellipse, self.alpha * self.span, self.span / (one + (self.span + self.span).sqrt()));
        let hyperbola = self.alpha.lt(T::splat(-1e-6));
        let root = T::select(hyperbola, -self.alpha, one).sqrt();
        let far = T::select(hyperbola, T::splat(FARTHEST) / root, T::splat(1e150));
        let turn = T::splat(TAU) / T::select(ellipse, self.alpha, one).sqrt();
        let (mut low, mut high) = (T::zero(), T::select(ellipse, turn, far));
        for _ in 0..MAX_ITERATIONS {
            let [left, first, second] = self.residual(chi);
            let below = left.lt(T::zero());
            (low, high) = (T::select(below, chi, low), T::select(below, high, chi));
            // Laguerre's step for a polynomial of degree five; the radius is positive, so the root has its sign.
            let inside = T::splat(16.0) * first * first - T::splat(20.0) * left * second;
            let mut next = chi - T::splat(5.0) * left / (first + inside.abs().sqrt());
            let outside = next.lt(low).or(high.lt(next));
            // Half way; in the open, twice as far.
            let half = T::splat(0.5) * (low + high);
            let open = T::splat(4.0) * (low + one);
            next = T::select(outside, T::select(open.lt(half), open, half), next);
            let moved = (T::splat(CLOSE) * next.abs()).lt((next - chi).abs());
            chi = next;
            if !moved.any() {
                break;
            }
        }
        chi
    }

    /// One step of Newton's method.
    #[inline(always)]
    fn polish(&self, chi: T) -> T {
        let [left, radius, _] = self.residual(chi);
        chi - left / radius
    }
}

/// `[c₀ c₁ c₂ c₃]`, `c_k(ψ) = Σ (−ψ)ʲ/(2j + k)!`: quarters of `ψ` until the largest lane is below one, the series there (the
/// first term left out below 5e-18), and the formulas of the double argument back.
#[inline(always)]
fn stumpff<T: Real>(psi: T) -> [T; 4] {
    let mut small = psi;
    let mut doublings = 0;
    for _ in 0..12 {
        if !T::one().lt(small.abs()).any() {
            break;
        }
        small = T::splat(0.25) * small;
        doublings += 1;
    }
    // 1/2!, −1/4!, … and 1/3!, −1/5!, …, from the last term back.
    let (mut c2, mut c3) = (T::one(), T::one());
    for j in (1..9).rev() {
        let k = f64::from(2 * j);
        c2 = (small * c2).mul_add(T::splat(-1.0 / ((k + 1.0) * (k + 2.0))), T::one());
        c3 = (small * c3).mul_add(T::splat(-1.0 / ((k + 2.0) * (k + 3.0))), T::one());
    }
    (c2, c3) = (T::splat(0.5) * c2, T::splat(1.0 / 6.0) * c3);
    for _ in 0..doublings {
        let (c0, c1) = (T::one() - small * c2, T::one() - small * c3);
        (c2, c3) = (T::splat(0.5) * c1 * c1, T::splat(0.25) * c0.mul_add(c3, c2));
        small = T::splat(4.0) * small;
    }
    [T::one() - psi * c2, T::one() - psi * c3, c2, c3]
}

/// The universal anomaly after `dt`, in units of `√|r|`: a start for [`propagate`].
#[inline(always)]
pub fn anomaly<T: Real>(mu: f64, dt: f64, state: &[T; 6]) -> T {
    let [x, y, z, u, v, w] = *state;
    Orbit::new(mu, dt, [x, y, z], [u, v, w]).solve()
}

/// `[r v]` after `dt`, `anomaly` being that of [`anomaly`].
#[inline(always)]
pub fn propagate<T: Real>(mu: f64, dt: f64, state: &[T; 6], anomaly: T) -> [T; 6] {
    let [x, y, z, u, v, w] = *state;
    let orbit = Orbit::new(mu, dt, [x, y, z], [u, v, w]);
    let chi = orbit.polish(orbit.polish(anomaly));
    let [u0, u1, u2, _] = orbit.universal(chi);
    let radius = u0 + orbit.sigma.mul_add(u1, u2);
    let inverse = radius.recip();
    let f = T::one() - u2;
    let g = orbit.sign * orbit.time * orbit.sigma.mul_add(u2, u1);
    let f_rate = -(orbit.sign * u1 * inverse) / orbit.time;
    let g_rate = T::one() - u2 * inverse;
    let mut moved = *state;
    for i in 0..3 {
        moved[i] = f.mul_add(state[i], g * state[3 + i]);
        moved[3 + i] = f_rate.mul_add(state[i], g_rate * state[3 + i]);
    }
    moved
}
