//! Inertial navigation by a strapped-down measurement unit, in a frame that may turn with a body.
//!
//! Site axes: `ṙ = v`, `v̇ = C f + g(r) − 2 ω×v − ω×(ω×(ρ + r)) + d`, `q̇ = ½ q⊗[ω_b, 0] − ½ [ω, 0]⊗q`, where `f` and `ω_b`
//! are the samples without their biases, `C = dcmᵀ`, `ω` the rate of the frame and `ρ` the way from the centre of mass
//! to its origin. The centrifugal term is about the centre of mass: about the site instead it would be wrong by `ω²ρ`, a
//! third of gravity on a small body.
//!
//! Attitude exactly for a constant rate; position and velocity by Runge and Kutta's rule of order 4 (7e-10 m after 600 s of
//! thrust and turns at 10 Hz). `Φ` and `Q` from the equation of errors at the middle of the step:
//!
//! `δv̇ = (Γ − [ω×]²) δr − 2[ω×] δv − C[f×] δα − C δb_a + δd − C n_a`,  `δα̇ = −[ω_b×] δα − δb_g − n_g`,
//! `δḃ = n_b`,  `δḋ = −δd/τ + n_d`.
//!
//! Left out: scale factors and misalignment of the unit, coning within a sample, motion of the body's pole.
use num_traits::Float;

use super::DynamicsModel;
use crate::math::matrix::{Matrix, mirrored};
use crate::math::real::{Real, Work};
use crate::math::so3::{Quaternion, dcm_from_quaternion, exp, normalized, quaternion_product};
use crate::math::vec3::{
    Mat3, Vec3, add, cross, mul, rotate, rotate_transposed, scale, scale_add, skew, splat, sub, transpose,
};
use crate::models::gravity::Gravity;
use crate::models::nav_state::{NavState, acceleration, biases};

/// Where the frame is and how it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Axes of the body to those of the site.
    pub site_from_fixed: Mat3<f64>,
    /// `ρ`: from the centre of mass to the site, site axes, m.
    pub center: Vec3<f64>,
    /// `ω`: rate of the frame, site axes, rad/s.
    pub angular_velocity: Vec3<f64>,
}

/// Spectral densities of what disturbs the path, on each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Of the accelerometers and of whatever acceleration nobody models, m²/s³.
    pub acceleration: f64,
    /// Of the gyroscopes, rad²/s.
    pub angular_rate: f64,
    /// Of the walk of the accelerometers' bias, m²/s⁵.
    pub accelerometer_bias: f64,
    /// Of the walk of the gyroscopes' bias, rad²/s³.
    pub gyroscope_bias: f64,
    /// Standard deviation of the unmodelled acceleration, m/s².
    pub deviation: f64,
    /// The time `τ` after which it has forgotten itself, s; infinite: never.
    pub time_constant: f64,
}

/// What the measurement unit shows, held over a step; body axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuSample<T> {
    /// Acceleration other than gravity, m/s².
    pub specific_force: Vec3<T>,
    /// Inertial rate, rad/s.
    pub angular_rate: Vec3<T>,
}

/// Inertial navigation over a field of gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strapdown<G> {
    /// The frame.
    pub site: Site,
    /// Gravity, in the axes of the body.
    pub gravity: G,
    /// What disturbs.
    pub noise: Noise,
}

/// A step: its length, and what is left of an acceleration at its middle and end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StrapdownStep {
    /// s.
    pub dt: f64,
    decay: [f64; 2],
}

/// What a step of the state leaves behind for its linearisation.
struct Middle<T> {
    /// Body to site axes.
    body: Mat3<T>,
    /// Turn of the body over the whole step: body axes before to body axes after.
    turn: Mat3<T>,
    /// `Γ − [ω×]²`.
    gradient: Mat3<T>,
    force: Vec3<T>,
    rate: Vec3<T>,
}

impl<G: Gravity> Strapdown<G> {
    /// Everything that accelerates but gravity and `C f`.
    #[inline(always)]
    fn apparent<T: Real>(&self, r: Vec3<T>, v: Vec3<T>) -> Vec3<T> {
        let w = splat(self.site.angular_velocity);
        let arm = add(splat(self.site.center), r);
        // 2 ω×v + ω×(ω×(ρ + r)) = ω×(2 v + ω×(ρ + r))
        scale(-T::one(), cross(w, scale_add(T::splat(2.0), v, cross(w, arm))))
    }

    /// The same position in axes of the body, from its centre.
    #[inline(always)]
    fn fixed<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        let c = self.site.site_from_fixed.map(splat);
        rotate_transposed(&c, add(splat(self.site.center), r))
    }

    /// Gravity at the site, site axes.
    #[inline(always)]
    pub fn gravity<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        let pull = T::apart(Pull { gravity: &self.gravity, at: self.fixed(r) });
        rotate(&self.site.site_from_fixed.map(splat), pull)
    }

    /// `v̇` of the equation above for a given `C f + d`.
    #[inline(always)]
    pub fn acceleration<T: Real>(&self, r: Vec3<T>, v: Vec3<T>, push: Vec3<T>) -> Vec3<T> {
        add(push, add(self.gravity(r), self.apparent(r, v)))
    }

    #[inline(always)]
    fn advance<T: Real>(
        &self,
        step: &StrapdownStep,
        x: &NavState<T>,
        sample: &ImuSample<T>,
    ) -> (NavState<T>, Middle<T>) {
        let (dt, half) = (T::splat(step.dt), T::splat(0.5 * step.dt));
        let force = sub(sample.specific_force, x.accelerometer_bias);
        let rate = sub(sample.angular_rate, x.gyroscope_bias);
        let w: Vec3<T> = splat(self.site.angular_velocity);
        let halfway = turn(x.attitude, scale(-half, w), scale(half, rate));
        let after = turn(x.attitude, scale(-dt, w), scale(dt, rate));
        let body = transpose(&dcm_from_quaternion(halfway));
        let [d_half, d_end] = step.decay.map(|k| scale(T::splat(k), x.acceleration));
        let push = [
            add(rotate_transposed(&dcm_from_quaternion(x.attitude), force), x.acceleration),
            add(rotate(&body, force), d_half),
            add(rotate_transposed(&dcm_from_quaternion(after), force), d_end),
        ];
        let (r, v) = (x.position, x.velocity);
        let a1 = self.acceleration(r, v, push[0]);
        let (r2, v2) = (scale_add(half, v, r), scale_add(half, a1, v));
        let c = self.site.site_from_fixed.map(splat);
        let (g, gradient) = T::apart(PullAndGradient { gravity: &self.gravity, at: self.fixed(r2) });
        let gradient = mul(&mul(&c, &gradient), &transpose(&c));
        let g2 = rotate(&c, g);
        let a2 = add(push[1], add(g2, self.apparent(r2, v2)));
        let (r3, v3) = (scale_add(half, v2, r), scale_add(half, a2, v));
        // Less than a millimetre from where gravity is known already.
        let g3 = add(g2, rotate(&gradient, sub(r3, r2)));
        let a3 = add(push[1], add(g3, self.apparent(r3, v3)));
        let (r4, v4) = (scale_add(dt, v3, r), scale_add(dt, a3, v));
        let a4 = self.acceleration(r4, v4, push[2]);
        let mut moved = *x;
        let (sixth, two) = (T::splat(step.dt / 6.0), T::splat(2.0));
        moved.position = scale_add(sixth, add(scale_add(two, add(v2, v3), v), v4), r);
        moved.velocity = scale_add(sixth, add(scale_add(two, add(a2, a3), a1), a4), v);
        moved.attitude = normalized(after);
        moved.acceleration = d_end;
        let spin = skew(w);
        let spin2 = mul(&spin, &spin);
        let mut stiffness = gradient;
        for i in 0..3 {
            stiffness[i] = sub(gradient[i], spin2[i]);
        }
        let turn = dcm_from_quaternion(exp(scale(dt, rate)));
        (moved, Middle { body, turn, gradient: stiffness, force, rate })
    }

    /// `A = F dt` at the middle of the step.
    #[inline(always)]
    fn rates<T: Real, const N: usize>(&self, dt: f64, middle: &Middle<T>, forcing: &Mat3<T>) -> Matrix<T, N> {
        let mut a = [[T::zero(); N]; N];
        let (h, w) = (T::splat(dt), self.site.angular_velocity);
        let coriolis: Mat3<T> = skew(splat(w.map(|c| -2.0 * dt * c)));
        let spin = skew(scale(-h, middle.rate));
        for i in 0..3 {
            a[i][3 + i] = h;
            for j in 0..3 {
                a[3 + i][j] = h * middle.gradient[i][j];
                a[3 + i][3 + j] = coriolis[i][j];
                a[3 + i][6 + j] = h * forcing[i][j];
                a[6 + i][6 + j] = spin[i][j];
                if let Some(k) = biases(N) {
                    a[3 + i][k + j] = -(h * middle.body[i][j]);
                }
            }
            if let Some(k) = biases(N) {
                a[6 + i][k + 3 + i] = -h;
            }
            if let Some(k) = acceleration(N) {
                a[3 + i][k + i] = h;
                a[k + i][k + i] = T::splat(-dt / self.noise.time_constant);
            }
        }
        a
    }

    /// `Φ = I + A + A²/2 + A³/6`, its diagonal blocks that have a closed form in closed form.
    #[inline(always)]
    fn linearized<T: Real, const N: usize>(
        &self,
        step: &StrapdownStep,
        middle: &Middle<T>,
        forcing: &Mat3<T>,
    ) -> Matrix<T, N> {
        // I + A (I + A/2 (I + A/3)).
        let a: Matrix<T, N> = self.rates(step.dt, middle, forcing);
        let mut phi = a;
        for k in [3.0, 2.0, 1.0] {
            if k < 3.0 {
                phi = applied(&a, &phi);
            }
            for i in 0..N {
                for j in 0..N {
                    phi[i][j] = T::splat(1.0 / k) * phi[i][j];
                }
                phi[i][i] += T::one();
            }
        }
        for i in 0..3 {
            for j in 0..3 {
                phi[6 + i][6 + j] = middle.turn[i][j];
            }
            if let Some(k) = acceleration(N) {
                phi[k + i][k + i] = T::splat(step.decay[1]);
            }
        }
        phi
    }

    /// `Q`: each source of noise through the chain of integrals it drives, `∫ sⁱ/i! sʲ/j! ds` of every pair of its links. A
    /// sum of Gram matrices, so positive semidefinite.
    #[inline(always)]
    fn noise<T: Real, const N: usize>(&self, dt: f64, body: &Mat3<T>, forcing: &Mat3<T>) -> Matrix<T, N> {
        let t = dt.abs();
        let mut q = [[T::zero(); N]; N];
        let mut one = [[T::zero(); 3]; 3];
        for i in 0..3 {
            one[i][i] = T::one();
        }
        let sign = if dt < 0.0 { -1.0 } else { 1.0 };
        let noise = &self.noise;
        // A white acceleration: velocity at once, position by its integral. Backwards the odd powers change sign.
        drive(&mut q, noise.acceleration, t, &[(3, &one, 0, 1.0), (0, &one, 1, sign)]);
        drive(
            &mut q,
            noise.angular_rate,
            t,
            &[(6, &one, 0, 1.0), (3, forcing, 1, sign), (0, forcing, 2, 1.0)],
        );
        if let Some(k) = biases(N) {
            let links = [(k, &one, 0, 1.0), (3, body, 1, -sign), (0, body, 2, -1.0)];
            drive(&mut q, noise.accelerometer_bias, t, &links);
            let links =
                [(k + 3, &one, 0, 1.0), (6, &one, 1, -sign), (3, forcing, 2, -1.0), (0, forcing, 3, -sign)];
            drive(&mut q, noise.gyroscope_bias, t, &links);
        }
        if let Some(k) = acceleration(N) {
            let density = 2.0 * noise.deviation * noise.deviation / noise.time_constant;
            drive(&mut q, density, t, &[(k, &one, 0, 1.0), (3, &one, 1, sign), (0, &one, 2, 1.0)]);
        }
        mirrored(&q)
    }
}

/// Gravity in a function of its own: fields are large, and a step asks three times.
struct Pull<'a, G, T> {
    gravity: &'a G,
    at: Vec3<T>,
}

impl<G: Gravity, T: Real> Work for Pull<'_, G, T> {
    type Output = Vec3<T>;

    #[inline(always)]
    fn run(self) -> Vec3<T> {
        self.gravity.acceleration(self.at)
    }
}

/// The same with its gradient.
struct PullAndGradient<'a, G, T> {
    gravity: &'a G,
    at: Vec3<T>,
}

impl<G: Gravity, T: Real> Work for PullAndGradient<'_, G, T> {
    type Output = (Vec3<T>, Mat3<T>);

    #[inline(always)]
    fn run(self) -> Self::Output {
        self.gravity.acceleration_and_gradient(self.at)
    }
}

/// `Exp(a) ⊗ q ⊗ Exp(b)`.
#[inline(always)]
fn turn<T: Real>(q: Quaternion<T>, a: Vec3<T>, b: Vec3<T>) -> Quaternion<T> {
    quaternion_product(quaternion_product(exp(a), q), exp(b))
}

/// `A M`, by the entries of `A` that may differ from zero.
#[inline(always)]
fn applied<T: Real, const N: usize>(a: &Matrix<T, N>, m: &Matrix<T, N>) -> Matrix<T, N> {
    let mut out = [[T::zero(); N]; N];
    for i in 0..N {
        let (from, to) = match i {
            0..3 => (3 + i, 4 + i),
            3..6 => (0, N),
            6..9 => (6, 9),
            _ => (i, i + 1),
        };
        for k in from..to {
            for j in 0..N {
                out[i][j] = a[i][k].mul_add(m[k][j], out[i][j]);
            }
        }
        if let (6..9, Some(b)) = (i, biases(N)) {
            for j in 0..N {
                out[i][j] = a[i][b + i - 3].mul_add(m[b + i - 3][j], out[i][j]);
            }
        }
    }
    out
}

/// `C [f×]`, negated: how a turn of the body moves what its accelerometers show.
#[inline(always)]
fn forcing<T: Real>(middle: &Middle<T>) -> Mat3<T> {
    let product = mul(&middle.body, &skew(middle.force));
    [scale(-T::one(), product[0]), scale(-T::one(), product[1]), scale(-T::one(), product[2])]
}

/// One link of a chain of integrals: first row, matrix, power of time, sign.
type Link<'a, T> = (usize, &'a Mat3<T>, usize, f64);

/// Adds, to the upper triangle, what a white noise of a density leaves in the links it drives.
#[inline(always)]
fn drive<T: Real, const N: usize>(q: &mut Matrix<T, N>, density: f64, t: f64, links: &[Link<'_, T>]) {
    const FACTORIAL: [f64; 4] = [1.0, 1.0, 2.0, 6.0];
    if density == 0.0 {
        return;
    }
    for &(row, a, i, s) in links {
        for &(column, b, j, u) in links {
            if row > column {
                continue;
            }
            let mut power = t;
            for _ in 0..i + j {
                power *= t;
            }
            let k = T::splat(density * s * u * power / (FACTORIAL[i] * FACTORIAL[j] * (i + j + 1) as f64));
            let product = mul(a, &transpose(b));
            for m in 0..3 {
                for n in 0..3 {
                    if row + m < N && column + n < N {
                        q[row + m][column + n] = k.mul_add(product[m][n], q[row + m][column + n]);
                    }
                }
            }
        }
    }
}

impl<T: Real, G: Gravity, const N: usize> DynamicsModel<T, N> for Strapdown<G> {
    const NAME: &'static str = "Strapdown";
    type State = NavState<T>;
    type Control = ImuSample<T>;
    type Step = StrapdownStep;

    fn prepare(&self, _time: f64, dt: f64) -> StrapdownStep {
        let left = |t: f64| {
            if acceleration(N).is_some() { Float::exp(-t / self.noise.time_constant) } else { 1.0 }
        };
        StrapdownStep { dt, decay: [left(0.5 * dt), left(dt)] }
    }

    #[inline(always)]
    fn propagate(&self, step: &StrapdownStep, state: &NavState<T>, control: ImuSample<T>) -> NavState<T> {
        self.advance(step, state, &control).0
    }

    #[inline(always)]
    fn transition(
        &self,
        step: &StrapdownStep,
        state: &NavState<T>,
        control: ImuSample<T>,
    ) -> (NavState<T>, Matrix<T, N>) {
        let (moved, middle) = self.advance(step, state, &control);
        (moved, self.linearized(step, &middle, &forcing(&middle)))
    }

    /// Without specific force; [`predict`](DynamicsModel::predict) knows it.
    #[inline(always)]
    fn process_noise(&self, step: &StrapdownStep, state: &NavState<T>) -> Matrix<T, N> {
        let body = transpose(&dcm_from_quaternion(state.attitude));
        self.noise(step.dt, &body, &[[T::zero(); 3]; 3])
    }

    #[inline(always)]
    fn predict(
        &self,
        step: &StrapdownStep,
        state: &NavState<T>,
        control: ImuSample<T>,
    ) -> (NavState<T>, Matrix<T, N>, Matrix<T, N>) {
        let (moved, middle) = self.advance(step, state, &control);
        let forcing = forcing(&middle);
        let noise = self.noise(step.dt, &middle.body, &forcing);
        (moved, self.linearized(step, &middle, &forcing), noise)
    }

    /// Rows of attitude see attitude and gyroscopes alone, those of biases and acceleration themselves.
    #[inline(always)]
    fn carry(&self, _step: &StrapdownStep, phi: &Matrix<T, N>, p: &Matrix<T, N>) -> Matrix<T, N> {
        let mut half = [[T::zero(); N]; N];
        for i in 0..N {
            half[i] = carried(phi, i, p);
        }
        // Column j of (Φ P) Φᵀ is row j of Φ times the transposed product.
        let mut out = [[T::zero(); N]; N];
        for i in 0..N {
            for j in 0..N {
                if j >= i {
                    out[i][j] = element(phi, j, &half[i]);
                }
            }
        }
        mirrored(&out)
    }
}

/// Columns of row `i` of `Φ` that may differ from zero, but for its diagonal: from, to.
#[inline(always)]
const fn support(i: usize, n: usize) -> (usize, usize) {
    match i {
        0..6 => (0, n),
        6..9 => (6, 9),
        _ => (i, i + 1),
    }
}

/// Row `i` of `Φ P`.
#[inline(always)]
fn carried<T: Real, const N: usize>(phi: &Matrix<T, N>, i: usize, p: &Matrix<T, N>) -> [T; N] {
    let mut out = [T::zero(); N];
    let (from, to) = support(i, N);
    for k in from..to {
        for j in 0..N {
            out[j] = phi[i][k].mul_add(p[k][j], out[j]);
        }
    }
    if let (6..9, Some(b)) = (i, biases(N)) {
        for k in b + 3..b + 6 {
            for j in 0..N {
                out[j] = phi[i][k].mul_add(p[k][j], out[j]);
            }
        }
    }
    out
}

/// Row `i` of `Φ` times a vector.
#[inline(always)]
fn element<T: Real, const N: usize>(phi: &Matrix<T, N>, i: usize, v: &[T; N]) -> T {
    let mut sum = T::zero();
    let (from, to) = support(i, N);
    for k in from..to {
        sum = phi[i][k].mul_add(v[k], sum);
    }
    if let (6..9, Some(b)) = (i, biases(N)) {
        for k in b + 3..b + 6 {
            sum = phi[i][k].mul_add(v[k], sum);
        }
    }
    sum
}
