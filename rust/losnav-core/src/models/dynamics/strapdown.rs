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
use crate::math::matrix::{Matrix, mirrored, put_block};
use crate::math::real::{Real, Work};
use crate::math::so3::{Quaternion, dcm_from_quaternion, exp, normalized, quaternion_product};
use crate::math::vec3::{
    Mat3, Vec3, add, cross, mul, plus_diagonal, rotate, rotate_transposed, scale, scale_add, scaled, skew,
    splat, sub, sum, transpose,
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

    /// `Φ = I + A + A²/2 + A³/6`, `A = F dt` at the middle of the step, block by block: `Φ = I + A M` with
    /// `M = I + A/2 + A²/6`. Diagonal blocks that have a closed form have it.
    #[inline(always)]
    fn linearized<T: Real, const N: usize>(
        &self,
        step: &StrapdownStep,
        middle: &Middle<T>,
        forcing: &Mat3<T>,
    ) -> Matrix<T, N> {
        let dt = step.dt;
        let (h, half, sixth) = (T::splat(dt), T::splat(0.5), T::splat(1.0 / 6.0));
        // The blocks of A in the row of velocity, and that of attitude.
        let g = scaled(h, &middle.gradient);
        let w: Mat3<T> = skew(splat(self.site.angular_velocity.map(|c| -2.0 * dt * c)));
        let b = scaled(h, forcing);
        let turn = skew(scale(-h, middle.rate));
        let mut phi = [[T::zero(); N]; N];
        for i in 0..N {
            phi[i][i] = T::one();
        }
        // M by its rows; of the row of position only what differs from the row of velocity of A.
        let m_rr = plus_diagonal(T::one(), &scaled(h * sixth, &g));
        let m_rv = plus_diagonal(half * h, &scaled(h * sixth, &w));
        let m_ra = scaled(h * sixth, &b);
        let m_vr = sum(&scaled(half, &g), &scaled(sixth, &mul(&w, &g)));
        let square = sum(&scaled(h, &g), &mul(&w, &w));
        let m_vv = plus_diagonal(T::one(), &sum(&scaled(half, &w), &scaled(sixth, &square)));
        let m_va = sum(&scaled(half, &b), &scaled(sixth, &sum(&mul(&w, &b), &mul(&b, &turn))));
        let m_aa = plus_diagonal(T::one(), &sum(&scaled(half, &turn), &scaled(sixth, &mul(&turn, &turn))));
        put_block(&mut phi, 0, 0, &plus_diagonal(T::one(), &scaled(h, &m_vr)));
        put_block(&mut phi, 0, 3, &scaled(h, &m_vv));
        put_block(&mut phi, 0, 6, &scaled(h, &m_va));
        put_block(&mut phi, 3, 0, &sum(&mul(&g, &m_rr), &mul(&w, &m_vr)));
        put_block(&mut phi, 3, 3, &plus_diagonal(T::one(), &sum(&mul(&g, &m_rv), &mul(&w, &m_vv))));
        put_block(&mut phi, 3, 6, &sum(&sum(&mul(&g, &m_ra), &mul(&w, &m_va)), &mul(&b, &m_aa)));
        put_block(&mut phi, 6, 6, &middle.turn);
        if let Some(k) = biases(N) {
            let c = scaled(-h, &middle.body);
            let m_rb = scaled(h * sixth, &c);
            let m_vb = sum(&scaled(half, &c), &scaled(sixth, &mul(&w, &c)));
            let m_vg = scaled(-(h * sixth), &b);
            let m_ag = plus_diagonal(-(half * h), &scaled(-(h * sixth), &turn));
            put_block(&mut phi, 0, k, &scaled(h, &m_vb));
            put_block(&mut phi, 3, k, &sum(&sum(&mul(&g, &m_rb), &mul(&w, &m_vb)), &c));
            put_block(&mut phi, 0, k + 3, &scaled(h, &m_vg));
            put_block(&mut phi, 3, k + 3, &sum(&mul(&w, &m_vg), &mul(&b, &m_ag)));
            put_block(&mut phi, 6, k + 3, &scaled(-h, &m_aa));
        }
        if let Some(k) = acceleration(N) {
            // A decays by a of its own: blocks are h, and h a.
            let a = -dt / self.noise.time_constant;
            let m_rd = T::splat(dt * dt / 6.0);
            let m_vd = plus_diagonal(T::splat(dt * (0.5 + a / 6.0)), &scaled(h * sixth, &w));
            let m_dd = T::splat(dt * (1.0 + a / 2.0 + a * a / 6.0));
            put_block(&mut phi, 0, k, &scaled(h, &m_vd));
            put_block(&mut phi, 3, k, &plus_diagonal(m_dd, &sum(&scaled(m_rd, &g), &mul(&w, &m_vd))));
            for i in 0..3 {
                phi[k + i][k + i] = T::splat(step.decay[1]);
            }
        }
        phi
    }

    /// `Q`: each source of noise through the chain of integrals it drives, `∫ sⁱ/i! sʲ/j! ds` of every pair of its links. A
    /// sum of Gram matrices, so positive semidefinite. With `B` the forcing and `C` the axes of the body the chains are
    ///
    /// 1. acceleration: `v: 1, r: s`;  2. rate: `α: 1, v: B s, r: B s²/2`;  3. `b_a: 1, v: −C s, r: −C s²/2`;
    /// 4. `b_g: 1, α: −s, v: −B s²/2, r: −B s³/6`;  5. `d: 1, v: s, r: s²/2`.
    #[inline(always)]
    fn noise<T: Real, const N: usize>(&self, dt: f64, body: &Mat3<T>, forcing: &Mat3<T>) -> Matrix<T, N> {
        let Noise { acceleration: q, angular_rate: w, accelerometer_bias: a, gyroscope_bias: g, .. } =
            self.noise;
        let has_biases = if biases(N).is_some() { 1.0 } else { 0.0 };
        let (a, g) = (has_biases * a, has_biases * g);
        let d = if acceleration(N).is_some() {
            2.0 * self.noise.deviation * self.noise.deviation / self.noise.time_constant
        } else {
            0.0
        };
        // Powers of |dt|; backwards the odd ones of a link change sign.
        let (t, s) = (dt.abs(), if dt < 0.0 { -1.0 } else { 1.0 });
        let (t2, t3) = (t * t, t * t * t);
        let (t4, t5) = (t2 * t2, t2 * t3);
        let driven = mul(forcing, &transpose(forcing));
        let block = |one: f64, other: f64| plus_diagonal(T::splat(one), &scaled(T::splat(other), &driven));
        let mut out = [[T::zero(); N]; N];
        put_block(
            &mut out,
            0,
            0,
            &block(q * t3 / 3.0 + (a + d) * t5 / 20.0, w * t5 / 20.0 + g * t5 * t2 / 252.0),
        );
        put_block(
            &mut out,
            0,
            3,
            &block(s * (q * t2 / 2.0 + (a + d) * t4 / 8.0), s * (w * t4 / 8.0 + g * t3 * t3 / 72.0)),
        );
        put_block(&mut out, 3, 3, &block(q * t + (a + d) * t3 / 3.0, w * t3 / 3.0 + g * t5 / 20.0));
        put_block(&mut out, 0, 6, &scaled(T::splat(w * t3 / 6.0 + g * t5 / 30.0), forcing));
        put_block(&mut out, 3, 6, &scaled(T::splat(s * (w * t2 / 2.0 + g * t4 / 8.0)), forcing));
        for i in 0..3 {
            out[6 + i][6 + i] = T::splat(w * t + g * t3 / 3.0);
        }
        if let Some(k) = biases(N) {
            put_block(&mut out, 0, k, &scaled(T::splat(-a * t3 / 6.0), body));
            put_block(&mut out, 3, k, &scaled(T::splat(-s * a * t2 / 2.0), body));
            put_block(&mut out, 0, k + 3, &scaled(T::splat(-s * g * t4 / 24.0), forcing));
            put_block(&mut out, 3, k + 3, &scaled(T::splat(-g * t3 / 6.0), forcing));
            for i in 0..3 {
                out[6 + i][k + 3 + i] = T::splat(-s * g * t2 / 2.0);
                out[k + i][k + i] = T::splat(a * t);
                out[k + 3 + i][k + 3 + i] = T::splat(g * t);
            }
        }
        if let Some(k) = acceleration(N) {
            for i in 0..3 {
                out[i][k + i] = T::splat(d * t3 / 6.0);
                out[3 + i][k + i] = T::splat(s * d * t2 / 2.0);
                out[k + i][k + i] = T::splat(d * t);
            }
        }
        mirrored(&out)
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

/// `C [f×]`, negated: how a turn of the body moves what its accelerometers show.
#[inline(always)]
fn forcing<T: Real>(middle: &Middle<T>) -> Mat3<T> {
    let product = mul(&middle.body, &skew(middle.force));
    [scale(-T::one(), product[0]), scale(-T::one(), product[1]), scale(-T::one(), product[2])]
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
        // Rows of Φ P; of what only decays, its own row.
        let mut half = *p;
        for i in 0..6 {
            half[i] = [T::zero(); N];
            for k in 0..N {
                for j in 0..N {
                    half[i][j] = phi[i][k].mul_add(p[k][j], half[i][j]);
                }
            }
        }
        for i in 6..9 {
            half[i] = [T::zero(); N];
            for k in 6..9 {
                for j in 0..N {
                    half[i][j] = phi[i][k].mul_add(p[k][j], half[i][j]);
                }
            }
            if let Some(b) = biases(N) {
                for k in b + 3..b + 6 {
                    for j in 0..N {
                        half[i][j] = phi[i][k].mul_add(p[k][j], half[i][j]);
                    }
                }
            }
        }
        if let Some(d) = acceleration(N) {
            for i in d..d + 3 {
                for j in 0..N {
                    half[i][j] = phi[i][i] * half[i][j];
                }
            }
        }
        // The same from the right. Columns of position and velocity are needed where rows are, those of attitude above it.
        let mut out = half;
        let mut dense = [[T::zero(); 6]; N];
        for k in 0..N {
            for j in 0..6 {
                dense[k][j] = phi[j][k];
            }
        }
        for i in 0..6 {
            for j in 0..6 {
                out[i][j] = T::zero();
            }
            for k in 0..N {
                for j in 0..6 {
                    out[i][j] = half[i][k].mul_add(dense[k][j], out[i][j]);
                }
            }
        }
        for i in 0..9 {
            for j in 6..9 {
                let mut total = T::zero();
                for k in 6..9 {
                    total = half[i][k].mul_add(phi[j][k], total);
                }
                if let Some(b) = biases(N) {
                    for k in b + 3..b + 6 {
                        total = half[i][k].mul_add(phi[j][k], total);
                    }
                }
                out[i][j] = total;
            }
        }
        if let Some(d) = acceleration(N) {
            for i in 0..N {
                for j in d..d + 3 {
                    out[i][j] = half[i][j] * phi[j][j];
                }
            }
        }
        mirrored(&out)
    }
}
