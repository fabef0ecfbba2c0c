//! Clohessy–Wiltshire along the orbit's circle instead of its tangent, for separations of many kilometres.
//!
//! The state stays `[r v]` in the target's orbital frame, so every sensor reads it; a step goes over to spherical coordinates
//! about the planet, `R atan2(x, R − z)`, `R atan2(y, s)`, `s = √(x² + (R − z)²)`, and depth `R − √(s² + y²)`, moves there
//! by the linear equations, and comes back. In these coordinates a displacement along the track, however long, is no change of the
//! orbit's shape; what the linear equations leave out is of second order in depth and rates.
//!
//! The control acts along the coordinate lines: the axes of the chaser's own orbital frame. `Q` is that of the linear model,
//! carried back. Size of the effect: 160 km along the track the tangent is 1.8 km off the orbit, and the linear model there
//! drifts by tens of kilometres an orbit. Left out: eccentricity, J₂.
use super::clohessy_wiltshire::{self, ClohessyWiltshire};
use super::{DynamicsModel, Flow, Specimen};
use crate::math::gradient::Gradient;
use crate::math::matrix::congruence;
use crate::math::real::{Real, Work};
use crate::math::trig::{atan2, sin_cos};

/// The target's circular orbit and the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvilinearClohessyWiltshire {
    /// The linear model.
    pub linear: ClohessyWiltshire,
    /// Radius of the orbit, m.
    pub radius: f64,
}

/// The step of the linear model.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    linear: clohessy_wiltshire::Step,
    still: bool,
}

/// Curvilinear coordinates and their rates.
#[inline(always)]
pub fn curvilinear<T: Real>(radius: f64, state: &[T; 6]) -> [T; 6] {
    let [x, y, z, vx, vy, vz] = *state;
    let around = T::splat(radius);
    let height = around - z;
    let flat2 = x.mul_add(x, height * height);
    let flat = flat2.sqrt();
    let distance2 = y.mul_add(y, flat2);
    let distance = distance2.sqrt();
    let v_flat = (x * vx - height * vz) / flat;
    let v_distance = (flat * v_flat + y * vy) / distance;
    // R − distance without the difference of two large numbers.
    let depth = ((around + around - z) * z - (x * x + y * y)) / (around + distance);
    [
        around * atan2(x, height),
        around * atan2(y, flat),
        depth,
        around * (height * vx + x * vz) / flat2,
        around * (flat * vy - y * v_flat) / distance2,
        -v_distance,
    ]
}

/// The inverse of [`curvilinear`].
#[inline(always)]
pub fn cartesian<T: Real>(radius: f64, coordinates: &[T; 6]) -> [T; 6] {
    let [along, across, depth, v_along, v_across, v_depth] = *coordinates;
    let around = T::splat(radius);
    let inverse = T::splat(1.0 / radius);
    let (theta, phi) = (along * inverse, across * inverse);
    let (turn, lift) = (v_along * inverse, v_across * inverse);
    let half = T::splat(0.5);
    let two = T::splat(2.0);
    let ((s, c), (sp, cp)) = (sin_cos(theta), sin_cos(phi));
    let (half_s, half_sp) = (sin_cos(half * theta).0, sin_cos(half * phi).0);
    let distance = around - depth;
    let flat = distance * cp;
    let v_flat = -(v_depth * cp) - distance * sp * lift;
    let below = depth * cp + two * around * half_sp * half_sp;
    [
        flat * s,
        distance * sp,
        below + two * flat * half_s * half_s,
        v_flat * s + flat * c * turn,
        distance * cp * lift - v_depth * sp,
        flat * s * turn - v_flat * c,
    ]
}

impl CurvilinearClohessyWiltshire {
    #[inline(always)]
    fn moved<T: Real>(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        if step.still {
            return *state;
        }
        let moved = self.linear.propagate(&step.linear, &curvilinear(self.radius, state), control);
        cartesian(self.radius, &moved)
    }
}

impl<T: Real> DynamicsModel<T, 6> for CurvilinearClohessyWiltshire {
    const NAME: &'static str = "CurvilinearClohessyWiltshire";
    type State = [T; 6];
    type Control = [T; 3];
    type Step = Step;

    fn prepare(&self, time: f64, dt: f64) -> Step {
        Step { linear: DynamicsModel::<f64, 6>::prepare(&self.linear, time, dt), still: dt == 0.0 }
    }

    #[inline(always)]
    fn propagate(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        self.moved(step, state, control)
    }

    #[inline(always)]
    fn transition(&self, step: &Step, state: &[T; 6], control: [T; 3]) -> ([T; 6], [[T; 6]; 6]) {
        T::apart(Transit { model: self, step, state, control })
    }

    #[inline(always)]
    fn process_noise(&self, step: &Step, state: &[T; 6]) -> [[T; 6]; 6] {
        T::apart(Noise { model: self, step, state })
    }
}

/// [`DynamicsModel::transition`].
struct Transit<'a, T> {
    model: &'a CurvilinearClohessyWiltshire,
    step: &'a Step,
    state: &'a [T; 6],
    control: [T; 3],
}

impl<T: Real> Work for Transit<'_, T> {
    type Output = ([T; 6], [[T; 6]; 6]);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let [x, y, z] = self.control;
        let control = [x, y, z].map(Gradient::constant);
        Gradient::split(&self.model.moved(self.step, &Gradient::variables(self.state), control))
    }
}

/// [`DynamicsModel::process_noise`].
struct Noise<'a, T> {
    model: &'a CurvilinearClohessyWiltshire,
    step: &'a Step,
    state: &'a [T; 6],
}

impl<T: Real> Work for Noise<'_, T> {
    type Output = [[T; 6]; 6];

    #[inline(always)]
    fn run(self) -> [[T; 6]; 6] {
        let Self { model, step, state } = self;
        let start = curvilinear(model.radius, state);
        let end = model.linear.propagate(&step.linear, &start, [T::zero(); 3]);
        let (_, back) = Gradient::split(&cartesian(model.radius, &Gradient::variables(&end)));
        congruence(&back, &model.linear.process_noise(&step.linear, &start))
    }
}

impl<T: Real> Flow<T, 6> for CurvilinearClohessyWiltshire {
    /// The linear equations along the coordinates, and the way back of what moves there: `∂x/∂ξ ξ'`.
    #[inline(always)]
    fn rates(&self, time: T, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let coordinates = curvilinear(self.radius, state);
        let rates = self.linear.rates(time, &coordinates, control);
        let mut moving = [Gradient::constant(T::zero()); 6];
        for i in 0..6 {
            moving[i] = Gradient { value: coordinates[i], slope: [rates[i]] };
        }
        cartesian(self.radius, &moving).map(|x: Gradient<T, 1>| x.slope[0])
    }
}

impl Specimen<6> for CurvilinearClohessyWiltshire {
    fn specimen() -> (Self, [f64; 6], [f64; 3], f64) {
        let (linear, _, control, dt) = ClohessyWiltshire::specimen();
        let model = Self { linear, radius: 7_158_137.0 };
        (model, [-159e3, 3e3, 2e3, 3.0, -0.2, 0.2], control, dt)
    }
}
