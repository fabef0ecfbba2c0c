//! The state of inertial navigation: position, velocity, attitude, and what corrupts them.
//!
//! Tangent `[δr δv δα]`, then of a size of 15 or 18 `[δb_a δb_g]`, of 12 or 18 `[δd]` at the end: sizes choose what is
//! estimated, the rest stays at its value.
use super::kinematics::Kinematics;
use super::state::{Columns, State};
use crate::math::real::Real;
use crate::math::so3::{
    Quaternion, conjugate, dcm_from_quaternion, exp, log, normalized, quaternion_product,
};
use crate::math::vec3::{Mat3, Vec3, add, dot, select, sub};

/// Where an inertial measurement unit is, how it is oriented, and how it errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NavState<T> {
    /// Reference frame, m.
    pub position: Vec3<T>,
    /// Reference frame, m/s.
    pub velocity: Vec3<T>,
    /// Orientation of the body in the reference frame, scalar last.
    pub attitude: Quaternion<T>,
    /// What the accelerometers show too much, body axes, m/s².
    pub accelerometer_bias: Vec3<T>,
    /// What the gyroscopes show too much, body axes, rad/s.
    pub gyroscope_bias: Vec3<T>,
    /// Acceleration that the model of gravity lacks, reference axes, m/s².
    pub acceleration: Vec3<T>,
}

/// First column of `[δb_a δb_g]` in a tangent of `n`.
#[must_use]
pub const fn biases(n: usize) -> Option<usize> {
    if n == 15 || n == 18 { Some(9) } else { None }
}

/// First column of `[δd]` in a tangent of `n`.
#[must_use]
pub const fn acceleration(n: usize) -> Option<usize> {
    match n {
        12 => Some(9),
        18 => Some(15),
        _ => None,
    }
}

impl<T: Real> NavState<T> {
    /// At the origin, at rest, body axes along those of the reference.
    #[inline(always)]
    #[must_use]
    pub fn origin() -> Self {
        let o = [T::zero(); 3];
        let attitude = [T::zero(), T::zero(), T::zero(), T::one()];
        Self { position: o, velocity: o, attitude, accelerometer_bias: o, gyroscope_bias: o, acceleration: o }
    }

    /// Everything that is a vector.
    #[inline(always)]
    fn vectors(&self) -> [&Vec3<T>; 5] {
        [&self.position, &self.velocity, &self.accelerometer_bias, &self.gyroscope_bias, &self.acceleration]
    }

    /// Vector and component behind number `i`; the quaternion stands third.
    #[inline(always)]
    fn place(i: usize) -> (usize, usize) {
        if i < 6 { (i / 3, i % 3) } else { ((i - 4) / 3, (i - 4) % 3) }
    }
}

/// Three components from column `from` on.
#[inline(always)]
fn part<T: Real, const N: usize>(delta: &[T; N], from: usize) -> Vec3<T> {
    let mut out = [T::zero(); 3];
    for i in 0..3 {
        if from + i < N {
            out[i] = delta[from + i];
        }
    }
    out
}

impl<T: Real, const N: usize> State<T, N> for NavState<T> {
    const COLUMNS: Columns = Columns { position: 0, velocity: Some(3), attitude: Some(6) };
    const NUMBERS: usize = 19;

    /// The state has an attitude of its own.
    #[inline(always)]
    fn kinematics(&self, _dcm: &Mat3<T>) -> Kinematics<T> {
        let dcm = dcm_from_quaternion(self.attitude);
        Kinematics { position: self.position, velocity: self.velocity, dcm }
    }

    #[inline(always)]
    fn inject(&self, delta: &[T; N]) -> Self {
        let mut moved = *self;
        moved.position = add(self.position, part(delta, 0));
        moved.velocity = add(self.velocity, part(delta, 3));
        moved.attitude = normalized(quaternion_product(self.attitude, exp(part(delta, 6))));
        if let Some(k) = biases(N) {
            moved.accelerometer_bias = add(self.accelerometer_bias, part(delta, k));
            moved.gyroscope_bias = add(self.gyroscope_bias, part(delta, k + 3));
        }
        if let Some(k) = acceleration(N) {
            moved.acceleration = add(self.acceleration, part(delta, k));
        }
        moved
    }

    #[inline(always)]
    fn minus(&self, other: &Self) -> [T; N] {
        let turn = log(quaternion_product(conjugate(other.attitude), self.attitude));
        let parts = [
            (0, sub(self.position, other.position)),
            (3, sub(self.velocity, other.velocity)),
            (6, turn),
            (biases(N).unwrap_or(N), sub(self.accelerometer_bias, other.accelerometer_bias)),
            (biases(N).map_or(N, |k| k + 3), sub(self.gyroscope_bias, other.gyroscope_bias)),
            (acceleration(N).unwrap_or(N), sub(self.acceleration, other.acceleration)),
        ];
        let mut delta = [T::zero(); N];
        for (from, vector) in parts {
            for i in 0..3 {
                if from + i < N {
                    delta[from + i] = vector[i];
                }
            }
        }
        delta
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let mut attitude = no.attitude;
        for i in 0..4 {
            attitude[i] = T::select(mask, yes.attitude[i], no.attitude[i]);
        }
        Self {
            position: select(mask, yes.position, no.position),
            velocity: select(mask, yes.velocity, no.velocity),
            attitude,
            accelerometer_bias: select(mask, yes.accelerometer_bias, no.accelerometer_bias),
            gyroscope_bias: select(mask, yes.gyroscope_bias, no.gyroscope_bias),
            acceleration: select(mask, yes.acceleration, no.acceleration),
        }
    }

    #[inline(always)]
    fn is_finite(&self) -> T::Mask {
        // Zero, or NaN where a number is infinite or NaN: one comparison for all.
        let zero = [T::zero(); 3];
        let q = self.attitude;
        let mut sum = (q[0] + q[1] + q[2] + q[3]) * T::zero();
        for vector in self.vectors() {
            sum += dot(*vector, zero);
        }
        sum.is_finite()
    }

    #[inline(always)]
    fn number(&self, i: usize) -> T {
        if (6..10).contains(&i) {
            return self.attitude[i - 6];
        }
        let (vector, component) = Self::place(i);
        if i < 19 { self.vectors()[vector][component] } else { T::zero() }
    }

    #[inline(always)]
    fn set_number(&mut self, i: usize, value: T) {
        if (6..10).contains(&i) {
            self.attitude[i - 6] = value;
            return;
        }
        let (vector, component) = Self::place(i);
        let vectors = [
            &mut self.position,
            &mut self.velocity,
            &mut self.accelerometer_bias,
            &mut self.gyroscope_bias,
            &mut self.acceleration,
        ];
        if let Some(vector) = vectors.into_iter().nth(vector) {
            vector[component] = value;
        }
    }
}
