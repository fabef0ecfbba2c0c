//! Gauss–Newton (GLSDC) and Levenberg–Marquardt: two step rules of one loop.
//!
//! 1. Solve `(H + λ D) δ = g`, `D = diag H` (`λ = 0` for Gauss–Newton).
//! 2. Predicted decrease `½ δᵀ(g + λ D δ)`. Below `cost_tolerance · cost` (the scale-free gradient test), below
//!    rounding, or with a step below `step_tolerance`, take the step and stop: the cost itself is rounding there.
//! 3. Linearise at the trial pose. LM accepts it if the true cost fell; the gain ratio steers `λ`. Gauss–Newton
//!    always accepts. A rejected trial counts as an iteration.
//! 4. Stop if the accepted decrease is at most `cost_tolerance · cost`, equation (24) multiplied out.
//! 5. At the end: `converged` only if the Newton decrement is negligible, the Gauss–Newton matrix has full rank
//!    and the true Hessian is positive definite, that is, only at a minimum of a full-rank problem.
//!
//! Everything is a lane-wise choice, so the loop runs on one problem or on several side by side.
use crate::estimators::normal_equations::NormalEquations;
use crate::math::real::{Mask, Real};
use crate::math::so3::{
    Quaternion, dcm_from_quaternion, mrp_from_quaternion, normalized, quaternion_from_mrp,
    rotation_from_mrp_rate, step,
};
use crate::math::sym6::{Ldl6, Sym6};
use crate::math::vec3::{Mat3, Vec3, add, cross, dot, rotate, rotate_transposed, sub};

/// A minimum is reached if the predicted further decrease is below this part of the cost: 1e-3 standard deviations
/// of the estimate for a residual of the size of the noise.
const CONVERGED_DECREASE: f64 = 1e-6;
/// Least pivot of a full-rank problem relative to the trace of its block. Problems of rank 5 leave pivots of up to
/// 2e-14 by rounding; four landmarks seen from ten thousand times their extent still have 1e-9.
const PIVOT_TOLERANCE: f64 = 1e-12;
/// LM gives up when the damping has grown this far.
const DAMPING_MAX: f64 = 1e12;
/// Damping below this is rounding.
const DAMPING_MIN: f64 = 1e-15;
/// Damping a rejected trial jumps to at least: smaller values change the step of hardly any scene.
const DAMPING_FELT: f64 = 1e-5;
/// A trial is accepted if at least this part of the predicted decrease is real.
const GAIN_ACCEPT: f64 = 1e-4;

/// How the attitude is stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parametrization {
    /// On the manifold: a small rotation in body axes.
    Rotation,
    /// The same steps, damped in the shift of the scene's middle and the rotation about it: slower where a good guess
    /// leaves little to damp, far faster along the valleys of far and noisy scenes.
    Orbit,
    /// Additive MRP step with shadow switch, position in reference axes, as the paper.
    Mrp,
}

/// Step rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Levenberg–Marquardt with gain ratio.
    LevenbergMarquardt,
    /// Gauss–Newton (the paper's GLSDC).
    GaussNewton,
}

/// Why the iteration stopped. The numbers are those of the public enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Termination {
    /// The gradient vanishes to rounding.
    Gradient = 0,
    /// The step is below its tolerance.
    Step = 1,
    /// The decrease of the cost is below its tolerance.
    Cost = 2,
    /// The iterations are used up.
    MaxIterations = 3,
    /// No damping makes the cost fall.
    DampingExhausted = 4,
    /// The normal equations are singular.
    Singular = 5,
    /// A number is infinite or NaN.
    NonFinite = 6,
}

impl Termination {
    /// From the lane code of [`Outcome::termination`].
    #[must_use]
    pub fn from_code(code: f64) -> Self {
        const ALL: [Termination; 7] = [
            Termination::Gradient,
            Termination::Step,
            Termination::Cost,
            Termination::MaxIterations,
            Termination::DampingExhausted,
            Termination::Singular,
            Termination::NonFinite,
        ];
        ALL.get(code as usize).copied().unwrap_or(Termination::NonFinite)
    }

    #[inline(always)]
    fn code<T: Real>(self) -> T {
        T::splat(f64::from(self as u8))
    }
}

/// The iteration's settings, common to all lanes.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Step rule.
    pub method: Method,
    /// How the attitude is stepped.
    pub parametrization: Parametrization,
    /// First `λ` of LM.
    pub damping: f64,
    /// Bound on the iterations.
    pub max_iterations: u32,
    /// Relative decrease of the cost at which to stop.
    pub cost_tolerance: f64,
    /// Step at which to stop, rad (position in units of the range).
    pub step_tolerance: f64,
}

/// Position and attitude.
#[derive(Clone, Copy, Debug)]
pub struct PoseState<T> {
    /// Reference frame, m.
    pub position: Vec3<T>,
    /// Body in reference, scalar last, unit.
    pub attitude: Quaternion<T>,
}

impl<T: Real> PoseState<T> {
    /// From position and MRP.
    #[inline(always)]
    pub fn from_mrp(position: Vec3<T>, mrp: Vec3<T>) -> Self {
        Self { position, attitude: quaternion_from_mrp(mrp) }
    }

    /// The first lane's pose in every lane of `V`.
    #[inline(always)]
    pub fn splat<V: Real>(&self) -> PoseState<V> {
        let (p, q) = (&self.position, &self.attitude);
        PoseState {
            position: [V::splat(p[0].lane(0)), V::splat(p[1].lane(0)), V::splat(p[2].lane(0))],
            attitude: [
                V::splat(q[0].lane(0)),
                V::splat(q[1].lane(0)),
                V::splat(q[2].lane(0)),
                V::splat(q[3].lane(0)),
            ],
        }
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let mut picked = *no;
        for i in 0..3 {
            picked.position[i] = T::select(mask, yes.position[i], no.position[i]);
        }
        for i in 0..4 {
            picked.attitude[i] = T::select(mask, yes.attitude[i], no.attitude[i]);
        }
        picked
    }
}

/// A least-squares problem in a pose.
pub trait PoseObjective<T: Real> {
    /// Cost, gradient and Gauss–Newton matrix at a pose.
    fn linearize(&self, pose: &PoseState<T>) -> NormalEquations<T>;
    /// The same, and the true Hessian beside Gauss–Newton's.
    fn linearize_twice(&self, pose: &PoseState<T>) -> (NormalEquations<T>, Sym6<T>);
    /// The middle of the scene, reference frame.
    fn anchor(&self) -> Vec3<T>;
    /// Sum of the weights: the unit in which a cost is negligible.
    fn total_weight(&self) -> T;
}

/// Where the iteration ended.
#[derive(Clone, Copy, Debug)]
pub struct Outcome<T: Real> {
    /// Final pose.
    pub pose: PoseState<T>,
    /// `½ Σ ρ`.
    pub cost: T,
    /// Gauss–Newton matrix there: the information about `[δp', δα]` in body axes.
    pub information: Sym6<T>,
    /// Trial steps taken, rejected ones included.
    pub iterations: T,
    /// Code of [`Termination`].
    pub termination: T,
    /// Is it a minimum of a full-rank problem?
    pub converged: T::Mask,
}

impl Outcome<f64> {
    /// No outcome yet.
    #[must_use]
    pub fn undefined() -> Self {
        Self {
            pose: PoseState { position: [f64::NAN; 3], attitude: [f64::NAN; 4] },
            cost: f64::NAN,
            information: Sym6([f64::NAN; 21]),
            iterations: 0.0,
            termination: Termination::NonFinite.code(),
            converged: false,
        }
    }
}

/// A step and what the model promises of it.
struct Step<T: Real> {
    trial: PoseState<T>,
    predicted: T,
    /// Squared size, rad².
    size2: T,
    solvable: T::Mask,
}

/// Minimises the objective from `guess`.
#[inline(always)]
pub fn solve<T: Real, O: PoseObjective<T>>(
    objective: &O,
    guess: &PoseState<T>,
    options: &Options,
) -> Outcome<T> {
    let lm = options.method == Method::LevenbergMarquardt;
    let mut iterate = Iterate::start(objective, guess, options);
    let floor = rounding_floor(objective.total_weight());
    let anchor = objective.anchor();
    for _ in 0..options.max_iterations {
        if !iterate.active.any() {
            break;
        }
        iterate.count();
        let step =
            propose(&iterate.pose, &iterate.equations, iterate.damping, anchor, options.parametrization);
        iterate.settle(&step, floor, options);
        if !iterate.active.any() {
            break;
        }
        let trial = objective.linearize(&step.trial);
        if lm {
            iterate.judge_by_gain(&step, &trial, options.cost_tolerance);
        } else {
            iterate.accept_always(&step, &trial, options.cost_tolerance);
        }
    }
    let (equations, exact) = objective.linearize_twice(&iterate.pose);
    Outcome {
        pose: iterate.pose,
        cost: equations.cost,
        information: equations.hessian,
        iterations: iterate.iterations,
        termination: iterate.termination,
        converged: is_minimum(&equations, &exact, floor),
    }
}

/// The loop's state, one value per lane.
struct Iterate<T: Real> {
    pose: PoseState<T>,
    equations: NormalEquations<T>,
    damping: T,
    iterations: T,
    termination: T,
    active: T::Mask,
}

impl<T: Real> Iterate<T> {
    #[inline(always)]
    fn start<O: PoseObjective<T>>(objective: &O, guess: &PoseState<T>, options: &Options) -> Self {
        let equations = objective.linearize(guess);
        let active = equations.cost.is_finite();
        let lm = options.method == Method::LevenbergMarquardt;
        Self {
            pose: *guess,
            equations,
            damping: T::splat(if lm { options.damping } else { 0.0 }),
            iterations: T::zero(),
            termination: T::select(active, Termination::MaxIterations.code(), Termination::NonFinite.code()),
            active,
        }
    }

    #[inline(always)]
    fn count(&mut self) {
        self.iterations += T::select(self.active, T::one(), T::zero());
    }

    #[inline(always)]
    fn stop(&mut self, mask: T::Mask, reason: T) {
        let stopped = self.active.and(mask);
        self.termination = T::select(stopped, reason, self.termination);
        self.active = self.active.and(stopped.not());
    }

    /// Step 2: a step this small is taken without a second look, and is the last.
    #[inline(always)]
    fn settle(&mut self, step: &Step<T>, floor: T, options: &Options) {
        let tolerance = T::splat(options.cost_tolerance.min(CONVERGED_DECREASE));
        let by_gradient = step.solvable.and(step.predicted.le(floor));
        let by_step =
            step.solvable.and(step.size2.le(T::splat(options.step_tolerance * options.step_tolerance)));
        let by_cost = step.solvable.and(step.predicted.le(tolerance * self.equations.cost));
        let last = self.active.and(by_gradient.or(by_step).or(by_cost));
        self.pose = PoseState::select(last, &step.trial, &self.pose);
        self.stop(by_gradient, Termination::Gradient.code());
        self.stop(by_step, Termination::Step.code());
        self.stop(by_cost, Termination::Cost.code());
    }

    /// Step 3 for Levenberg–Marquardt.
    #[inline(always)]
    fn judge_by_gain(&mut self, step: &Step<T>, trial: &NormalEquations<T>, cost_tolerance: f64) {
        let decrease = self.equations.cost - trial.cost;
        let gain = decrease / step.predicted;
        let usable = step.solvable.and(trial.cost.is_finite());
        let accepted = self.active.and(usable).and(T::splat(GAIN_ACCEPT).lt(gain));
        // Nearly as good as promised: less damping; poor or worse than before: more; unusable: much more at once.
        let more = T::splat(10.0) * self.damping;
        // Nearly exact prediction: the damping only delays, so it falls with the square of the surprise.
        let surprise = (T::one() - gain).abs();
        let trust = (T::splat(4.0) * surprise * surprise).max(T::splat(1e-4));
        let factor = T::select(trust.lt(T::splat(0.1)), trust, T::splat(0.1));
        let less = (factor * self.damping).max(T::splat(DAMPING_MIN));
        let fair = T::select(T::splat(0.25).lt(gain), self.damping, more);
        let accepted_damping = T::select(T::splat(0.75).lt(gain), less, fair);
        let much_more = (T::splat(100.0) * self.damping).max(T::splat(DAMPING_FELT));
        let rejected_damping = T::select(usable, more.max(T::splat(DAMPING_FELT)), much_more);
        let next = T::select(accepted, accepted_damping, rejected_damping);
        self.damping = T::select(self.active, next, self.damping);
        self.take(accepted, step, trial, cost_tolerance, decrease);
        self.stop(T::splat(DAMPING_MAX).lt(self.damping), Termination::DampingExhausted.code());
    }

    /// Step 3 for Gauss–Newton.
    #[inline(always)]
    fn accept_always(&mut self, step: &Step<T>, trial: &NormalEquations<T>, cost_tolerance: f64) {
        let decrease = self.equations.cost - trial.cost;
        self.stop(step.solvable.not(), Termination::Singular.code());
        self.stop(trial.cost.is_finite().not(), Termination::NonFinite.code());
        self.take(self.active, step, trial, cost_tolerance, decrease);
    }

    /// Moves, then step 4: equation (24), `|J_k − J_{k−1}| ≤ λ J_k`.
    #[inline(always)]
    fn take(
        &mut self,
        accepted: T::Mask,
        step: &Step<T>,
        trial: &NormalEquations<T>,
        cost_tolerance: f64,
        decrease: T,
    ) {
        self.pose = PoseState::select(accepted, &step.trial, &self.pose);
        self.equations = select_equations(accepted, trial, &self.equations);
        let flat = decrease.abs().le(T::splat(cost_tolerance) * trial.cost);
        self.stop(accepted.and(flat), Termination::Cost.code());
    }
}

/// Cost below which only rounding is left: a few units in the last place of every direction.
#[inline(always)]
pub(crate) fn rounding_floor<T: Real>(total_weight: T) -> T {
    T::splat(64.0 * T::EPSILON * T::EPSILON) * total_weight
}

/// Step 1 and 2: solve the damped system, move, predict.
#[inline(always)]
fn propose<T: Real>(
    pose: &PoseState<T>,
    equations: &NormalEquations<T>,
    damping: T,
    anchor: Vec3<T>,
    parametrization: Parametrization,
) -> Step<T> {
    let dcm = dcm_from_quaternion(pose.attitude);
    match parametrization {
        Parametrization::Rotation => {
            let (delta, predicted, solvable) = damped_solve(equations, damping);
            let trial = orbit(pose, &dcm, anchor, &delta);
            Step { trial, predicted, size2: step_size2(&equations.hessian, &delta), solvable }
        }
        Parametrization::Orbit => {
            let t = rotate(&dcm, sub(anchor, pose.position));
            let (pivoted, predicted, solvable) = damped_solve(&equations.about(t), damping);
            let [x, y, z, a, b, c] = pivoted;
            let shift = add([x, y, z], cross(t, [a, b, c]));
            let delta = [shift[0], shift[1], shift[2], a, b, c];
            let trial = orbit(pose, &dcm, anchor, &delta);
            Step { trial, predicted, size2: step_size2(&equations.hessian, &delta), solvable }
        }
        Parametrization::Mrp => {
            let mrp = mrp_from_quaternion(pose.attitude);
            let factor = rotation_from_mrp_rate(mrp);
            let system = equations.change_of_variables(&dcm, &factor);
            let (delta, predicted, solvable) = damped_solve(&system, damping);
            let moved = add(mrp, [delta[3], delta[4], delta[5]]);
            let trial = PoseState {
                position: add(pose.position, [delta[0], delta[1], delta[2]]),
                attitude: normalized(quaternion_from_mrp(moved)),
            };
            Step { trial, predicted, size2: mrp_step_size2(equations, &factor, &delta), solvable }
        }
    }
}

/// Takes the step `[δp', δα]` along the curve that keeps the scene in view: the rotation turns the observer about
/// the anchor `c`, the middle of the landmarks. With `t = dcm (c − p)`, the anchor in body axes, the step is
/// `δt = −δp' − δα × t` and the new position `p = c − dcm'ᵀ (t + δt)`. To first order that is `p + dcmᵀ δp'`; but a
/// tilt of a distant scene is known far worse than its direction, and the valley this makes is bent like the orbit.
#[inline(always)]
fn orbit<T: Real>(pose: &PoseState<T>, dcm: &Mat3<T>, anchor: Vec3<T>, delta: &[T; 6]) -> PoseState<T> {
    let rotation = [delta[3], delta[4], delta[5]];
    let t = rotate(dcm, sub(anchor, pose.position));
    let moved = sub(sub(t, [delta[0], delta[1], delta[2]]), cross(rotation, t));
    let attitude = step(pose.attitude, rotation);
    PoseState { position: sub(anchor, rotate_transposed(&dcm_from_quaternion(attitude), moved)), attitude }
}

/// `(δ, predicted decrease, is the system positive definite)`.
#[inline(always)]
fn damped_solve<T: Real>(equations: &NormalEquations<T>, damping: T) -> ([T; 6], T, T::Mask) {
    let diagonal = equations.hessian.diagonal();
    let ldl = equations.hessian.damped(damping, &diagonal).ldl();
    let delta = ldl.solve(&equations.gradient);
    let mut twice = T::zero();
    for i in 0..6 {
        let slope = (damping * diagonal[i]).mul_add(delta[i], equations.gradient[i]);
        twice = delta[i].mul_add(slope, twice);
    }
    (delta, T::splat(0.5) * twice, ldl.positive())
}

/// Squared weighted mean of `1/ρ`: turns a shift into the angle it subtends.
#[inline(always)]
fn inverse_range2<T: Real>(h: &Sym6<T>) -> T {
    let d = h.diagonal();
    (d[0] + d[1] + d[2]) / (d[3] + d[4] + d[5])
}

#[inline(always)]
fn step_size2<T: Real>(h: &Sym6<T>, delta: &[T; 6]) -> T {
    let (p, a) = ([delta[0], delta[1], delta[2]], [delta[3], delta[4], delta[5]]);
    inverse_range2(h).mul_add(dot(p, p), dot(a, a))
}

#[inline(always)]
fn mrp_step_size2<T: Real>(equations: &NormalEquations<T>, factor: &Mat3<T>, delta: &[T; 6]) -> T {
    let a = rotate(factor, [delta[3], delta[4], delta[5]]);
    step_size2(&equations.hessian, &[delta[0], delta[1], delta[2], a[0], a[1], a[2]])
}

/// Step 5: stationary, full rank, and the true Hessian positive definite.
#[inline(always)]
fn is_minimum<T: Real>(equations: &NormalEquations<T>, exact: &Sym6<T>, floor: T) -> T::Mask {
    let curvature = exact.ldl();
    let decrement = T::splat(0.5) * curvature.inverse_norm2(&equations.gradient);
    let negligible = T::splat(CONVERGED_DECREASE).mul_add(equations.cost, T::splat(1e3) * floor);
    let ldl = equations.hessian.ldl();
    decrement.le(negligible).and(full_rank(&equations.hessian, &ldl)).and(curvature.positive())
}

/// Are all pivots above `PIVOT_TOLERANCE` of the trace of their block?
#[inline(always)]
pub fn full_rank<T: Real>(h: &Sym6<T>, ldl: &Ldl6<T>) -> T::Mask {
    let d = h.diagonal();
    let position = (d[0] + d[1] + d[2]) * T::splat(PIVOT_TOLERANCE);
    let attitude = (d[3] + d[4] + d[5]) * T::splat(PIVOT_TOLERANCE);
    let p = ldl.pivots();
    let first = position.lt(p[0]).and(position.lt(p[1])).and(position.lt(p[2]));
    let last = attitude.lt(p[3]).and(attitude.lt(p[4])).and(attitude.lt(p[5]));
    first.and(last).and(p[5].is_finite())
}

#[inline(always)]
fn select_equations<T: Real>(
    mask: T::Mask,
    yes: &NormalEquations<T>,
    no: &NormalEquations<T>,
) -> NormalEquations<T> {
    let mut out = *no;
    out.cost = T::select(mask, yes.cost, no.cost);
    for i in 0..6 {
        out.gradient[i] = T::select(mask, yes.gradient[i], no.gradient[i]);
    }
    for i in 0..21 {
        out.hessian.0[i] = T::select(mask, yes.hessian.0[i], no.hessian.0[i]);
    }
    out
}
