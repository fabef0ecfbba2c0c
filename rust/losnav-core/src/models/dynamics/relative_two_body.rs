//! Relative motion as the difference of two orbits, J₂ included, the chaser's known (its own GPS).
//!
//! State `[r v]`, chaser minus target in the target's orbital frame, as for Clohessy–Wiltshire, which is the limit of small
//! separations about a point mass and a circle. Any separation, any orbit:
//!
//! 1. The target is where the relative state puts it: its frame is found by going round, each round gains `|r|/R`.
//! 2. The separation moves by the difference of gravity, `d̈ = g(R) − g(R − d) + u`, formed without cancelling, beside the
//!    chaser's own orbit; the control `u` is held in the target's frame.
//! 3. Back into the frame of the target at the end. `Φ` is the derivative of all of it.
//!
//! Size of the effect: Clohessy–Wiltshire is off by metres and millimetres a second per orbit 500 m apart in low orbit, this
//! by what drag and the other harmonics do differently to the two. The chaser's orbit is taken from the last fix at or before
//! the start of a step; it is not moved by the control or by the estimate, so errors of a fix act only through differences of
//! gravity: 15 m of it are 1e-5 of the relative motion.
use num_traits::Float;

use super::disturbance::{Path, accumulate};
use super::field::Field;
use super::flow::known_orbit;
use super::integrated::{Integrated, Propagate, Transit};
use super::lvlh::Frame;
use super::two_body::{TOLERANCE, TwoBody};
use super::{DynamicsModel, Flow, Specimen};
use crate::math::gradient::Gradient;
use crate::math::integrator::{Rates, integrate};
use crate::math::real::Real;
use crate::math::vec3::{Vec3, add, dot, rotate_transposed, sub};

/// Where the chaser was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fix {
    /// Epoch, s.
    pub time: f64,
    /// `[r v]`, inertial axes, m and m/s.
    pub state: [f64; 6],
}

/// The planet, the chaser's orbit and the disturbance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeTwoBody<S> {
    /// The planet, and the spectral density of the disturbing acceleration on each axis, m²/s³.
    pub planet: TwoBody,
    /// Fixes of the chaser, times increasing.
    pub chaser: S,
}

/// What a step needs: where the chaser is.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    dt: f64,
    chaser: [f64; 6],
}

/// The chaser's orbit and the separation `[R V d ḋ]`, inertial axes.
struct Pair<T> {
    field: Field,
    control: Vec3<T>,
    free: bool,
    pace: f64,
}

#[inline(always)]
fn three<T: Real, const N: usize>(x: &[T; N], from: usize) -> Vec3<T> {
    let at = |i: usize| x.get(from + i).copied().unwrap_or(T::zero());
    [at(0), at(1), at(2)]
}

impl<T: Real> Rates<T, 12> for Pair<T> {
    #[inline(always)]
    fn rates(&self, _time: f64, x: &[T; 12]) -> [T; 12] {
        let (r, v, d, w) = (three(x, 0), three(x, 3), three(x, 6), three(x, 9));
        let pull = self.field.acceleration(r);
        let mut apart = self.field.difference(r, d);
        if !self.free {
            let frame = Frame::new(sub(r, d), sub(v, w), [T::zero(); 3]);
            apart = add(apart, rotate_transposed(&frame.dcm, self.control));
        }
        let ([a, b, c], [e, f, g]) = (pull, apart);
        [v[0], v[1], v[2], a, b, c, w[0], w[1], w[2], e, f, g]
    }

    #[inline(always)]
    fn relative(&self, error: &[T; 12], x: &[T; 12]) -> T {
        let size = |v: Vec3<T>| dot(v, v).sqrt();
        let pace = T::splat(self.pace);
        let together = |x: &[T; 12], k: usize| pace.mul_add(size(three(x, k + 3)), size(three(x, k)));
        let floor = T::splat(f64::MIN_POSITIVE);
        (together(error, 0) / together(x, 0)).max(together(error, 6) / (together(x, 6) + floor))
    }
}

impl<S: AsRef<[Fix]>> RelativeTwoBody<S> {
    /// The chaser at `time`, from the last fix at or before it, or the first of all.
    fn chaser_at(&self, time: f64) -> [f64; 6] {
        let fixes = self.chaser.as_ref();
        let later = fixes.partition_point(|fix| fix.time <= time);
        match fixes.get(later.saturating_sub(1)) {
            Some(fix) => self.planet.propagate(&(time - fix.time), &fix.state, [0.0; 3]),
            None => [f64::NAN; 6],
        }
    }
}

/// Separation and its rate in inertial axes of a relative state in the frame of a target that is itself to be found.
#[inline(always)]
fn separation<T: Real>(field: &Field, chaser: &[T; 6], state: &[T; 6], rounds: usize) -> (Vec3<T>, Vec3<T>) {
    let (r, v) = (three(chaser, 0), three(chaser, 3));
    let (mut d, mut w) = ([T::zero(); 3], [T::zero(); 3]);
    for _ in 0..rounds {
        let (place, motion) = (sub(r, d), sub(v, w));
        (d, w) = Frame::new(place, motion, field.acceleration(place)).apart(state);
    }
    (d, w)
}

/// Rounds until a gain of separation over radius each has left nothing: the same for numbers with and without derivatives.
#[inline(always)]
fn rounds<T: Real>(chaser: &[f64; 6], state: &[T; 6]) -> usize {
    let size = |x: [f64; 3]| Float::sqrt(dot(x, x));
    let mut largest: f64 = 0.0;
    for lane in 0..T::LANES {
        let x = |i: usize| state[i].lane(lane);
        let apart = size([x(0), x(1), x(2)]) / size(three(chaser, 0));
        let moving = size([x(3), x(4), x(5)]) / size(three(chaser, 3));
        largest = Float::max(largest, 2.0 * apart + moving);
    }
    let mut rounds = 2;
    let mut left = largest;
    while left > 1e-18 && rounds < 60 {
        left *= largest;
        rounds += 1;
    }
    rounds
}

impl<S: AsRef<[Fix]>> Integrated for RelativeTwoBody<S> {
    type Step = Step;

    #[inline(always)]
    fn moved<T: Real>(&self, step: &Step, state: &[T; 6], control: Vec3<T>) -> [T; 6] {
        if step.dt == 0.0 {
            return *state;
        }
        let field = self.planet.field();
        let chaser = step.chaser.map(T::splat);
        let (d, w) = separation(&field, &chaser, state, rounds(&step.chaser, state));
        let [x, y, z, u, v, s] = chaser;
        let start = [x, y, z, u, v, s, d[0], d[1], d[2], w[0], w[1], w[2]];
        let pace = field.pace(&step.chaser);
        let pair = Pair { field, control, free: control == [T::zero(); 3], pace };
        let end = integrate(&pair, &start, step.dt, 0.1 * pace, TOLERANCE);
        let (d, w) = (three(&end, 6), three(&end, 9));
        let (place, motion) = (sub(three(&end, 0), d), sub(three(&end, 3), w));
        Frame::new(place, motion, field.acceleration(place)).relative(d, w)
    }
}

impl<T: Real, S: AsRef<[Fix]>> DynamicsModel<T, 6> for RelativeTwoBody<S> {
    const NAME: &'static str = "RelativeTwoBody";
    const TIME_VARYING: bool = true;
    type State = [T; 6];
    type Control = [T; 3];
    type Step = Step;

    fn prepare(&self, time: f64, dt: f64) -> Step {
        Step { dt, chaser: self.chaser_at(time) }
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
        accumulate(&Along { model: self, step }, state, step.dt, self.planet.acceleration_psd)
    }
}

/// A vector that moves.
#[inline(always)]
fn moving<T: Real>(v: Vec3<T>, rate: Vec3<T>) -> Vec3<Gradient<T, 1>> {
    let mut out = v.map(Gradient::constant);
    for i in 0..3 {
        out[i].slope = [rate[i]];
    }
    out
}

impl<T: Real, S: AsRef<[Fix]>> Flow<T, 6> for RelativeTwoBody<S> {
    /// Under a control the target's frame, taken as that of a free orbit, turns a little otherwise than it says.
    const MECHANICAL: bool = false;

    /// The derivative in time of what is seen from the target's frame.
    #[inline(always)]
    fn rates(&self, time: T, state: &[T; 6], control: [T; 3]) -> [T; 6] {
        let field = self.planet.field();
        let chaser = known_orbit(&self.planet, |t| self.chaser_at(t), time);
        // Derivatives of high order lag behind the value by a few rounds.
        let rounds = 2 * rounds(&chaser.map(|x| x.lane(0)), state);
        let (d, w) = separation(&field, &chaser, state, rounds);
        let (place, motion) = (sub(three(&chaser, 0), d), sub(three(&chaser, 3), w));
        let mut apart = field.difference(three(&chaser, 0), d);
        if control != [T::zero(); 3] {
            apart = add(apart, rotate_transposed(&Frame::new(place, motion, [T::zero(); 3]).dcm, control));
        }
        // The chaser's orbit does not feel the control: the other end of the separation does.
        let target = moving(place, motion);
        let turning = sub(field.acceleration(three(&chaser, 0)), apart);
        let frame = Frame::new(target, moving(motion, turning), field.acceleration(target));
        frame.relative(moving(d, w), moving(w, apart)).map(|x| x.slope[0])
    }
}

/// The path of a step.
struct Along<'a, S> {
    model: &'a RelativeTwoBody<S>,
    step: &'a Step,
}

impl<T: Real, S: AsRef<[Fix]>> Path<T> for Along<'_, S> {
    #[inline(always)]
    fn advance(&self, time: f64, dt: f64, state: &[T; 6]) -> ([T; 6], [[T; 6]; 6]) {
        let chaser = self.model.planet.propagate(&time, &self.step.chaser, [0.0; 3]);
        DynamicsModel::<T, 6>::transition(self.model, &Step { dt, chaser }, state, [T::zero(); 3])
    }

    #[inline(always)]
    fn pace(&self, _time: f64, _state: &[T; 6]) -> f64 {
        self.model.planet.field().pace(&self.step.chaser)
    }
}

impl Specimen<6> for RelativeTwoBody<[Fix; 1]> {
    fn specimen() -> (Self, [f64; 6], [f64; 3], f64) {
        let (planet, state, control, dt) = TwoBody::specimen();
        let chaser = [Fix { time: -100.0, state }];
        (Self { planet, chaser }, [-5200.0, 100.0, 200.0, -0.324, -0.2, 0.2], control, dt)
    }
}
