//! Laws of every dynamics in the list.
use losnav_core::math::matrix::{congruence, mirrored};
use losnav_core::models::dynamics::disturbance::NODES;
use losnav_core::models::dynamics::perturbed_two_body::Stretch;
use losnav_core::models::dynamics::relative_two_body::Fix;
use losnav_core::models::dynamics::{
    ClohessyWiltshire, CurvilinearClohessyWiltshire, DynamicsModel, Specimen, TwoBody, YamanakaAnkersen,
};
use nalgebra::{SMatrix, SVector};

use crate::dual::First;
use crate::{SAME_FORMULA, assert_close, largest};

/// Two bodies.
type PerturbedTwoBody = losnav_core::models::dynamics::PerturbedTwoBody<[Stretch; 3]>;
/// With one fix: more are jumps of the path, which do not compose.
type RelativeTwoBody = losnav_core::models::dynamics::RelativeTwoBody<[Fix; 1]>;

/// A model whose state is an array and whose control is an acceleration.
trait Vector<const N: usize>: Specimen<N> + DynamicsModel<f64, N, State = [f64; N], Control = [f64; 3]> {}

impl<M, const N: usize> Vector<N> for M where
    M: Specimen<N> + DynamicsModel<f64, N, State = [f64; N], Control = [f64; 3]>
{
}

/// A model with a state, a control and a time step.
type Case<M, const N: usize> = (M, [f64; N], [f64; 3], f64);

/// Units that make positions and velocities alike: of time, the step.
fn units<const N: usize>(dt: f64) -> [f64; N] {
    core::array::from_fn(|i| if i < 3 { dt.abs() } else { 1.0 })
}

/// Entries of a matrix in these units.
fn in_units<const N: usize>(rows: &[[f64; N]; N], dt: f64) -> SMatrix<f64, N, N> {
    let units = units::<N>(dt);
    SMatrix::from_fn(|i, j| rows[i][j] * units[j] / units[i])
}

/// Asserts that two states agree, positions beside the largest position, velocities beside the largest velocity.
#[track_caller]
fn assert_same_state<const N: usize>(a: &[f64; N], b: &[f64; N], tolerance: f64) {
    for part in [0..3, 3..N] {
        let scale = largest(a[part.clone()].iter().copied());
        for i in part {
            assert_close(a[i], b[i], scale, tolerance);
        }
    }
}

/// `Φ` is the derivative of the propagation, through the same source, by dual numbers.
fn transition<M, const N: usize>((model, x, u, dt): Case<M, N>)
where
    M: Vector<N> + DynamicsModel<First, N, State = [First; N], Control = [First; 3]>,
{
    for dt in [dt, -dt, 1e-3 * dt, 100.0 * dt] {
        let step = DynamicsModel::<f64, N>::prepare(&model, 0.0, dt);
        let (end, phi) = DynamicsModel::<f64, N>::transition(&model, &step, &x, u);
        assert_eq!(end, DynamicsModel::<f64, N>::propagate(&model, &step, &x, u));
        let mut slopes = [[0.0; N]; N];
        for column in 0..N {
            let mut seeded = x.map(|v| First::along(v, 0.0));
            seeded[column].slope = 1.0;
            let step = DynamicsModel::<First, N>::prepare(&model, 0.0, dt);
            let control = u.map(|v| First::along(v, 0.0));
            let moved = DynamicsModel::<First, N>::propagate(&model, &step, &seeded, control);
            for row in 0..N {
                slopes[row][column] = moved[row].slope;
            }
        }
        let (phi, slopes) = (in_units(&phi, dt), in_units(&slopes, dt));
        assert!((phi - slopes).amax() <= SAME_FORMULA * phi.amax(), "{phi} {slopes}");
    }
}

/// Two steps are one: `x(s + t) = x(t) ∘ x(s)`, `Φ(s + t) = Φ(t) Φ(s)`; nothing happens in no time; back is back.
fn semigroup<M, const N: usize>((model, x, u, dt): Case<M, N>)
where
    M: Vector<N>,
{
    let propagate = |x: &[f64; N], time: f64, dt: f64| model.propagate(&model.prepare(time, dt), x, u);
    let transition = |x: &[f64; N], time: f64, dt: f64| model.transition(&model.prepare(time, dt), x, u).1;
    assert_eq!(propagate(&x, 0.0, 0.0), x);
    for (s, t) in [(dt, 0.5 * dt), (10.0 * dt, dt), (dt, -dt), (37.0 * dt, 61.0 * dt)] {
        let between = propagate(&x, 0.0, s);
        assert_same_state(&propagate(&between, s, t), &propagate(&x, 0.0, s + t), 30.0 * SAME_FORMULA);
        let unit = s.abs().max(t.abs());
        let (first, second) =
            (in_units(&transition(&x, 0.0, s), unit), in_units(&transition(&between, s, t), unit));
        let whole = in_units(&transition(&x, 0.0, s + t), unit);
        let scale = first.amax() * second.amax();
        assert!((second * first - whole).amax() <= 10.0 * SAME_FORMULA * scale, "{whole}");
    }
}

/// `Q` is symmetric, positive definite, and adds up: `Q(s + t) = Φ(t) Q(s) Φ(t)ᵀ + Q(t)` along the path without control.
fn process_noise<M, const N: usize>((model, x, _, dt): Case<M, N>)
where
    M: Vector<N>,
{
    let noise = |x: &[f64; N], time: f64, dt: f64| model.process_noise(&model.prepare(time, dt), x);
    let matrix = |rows: [[f64; N]; N]| SMatrix::<f64, N, N>::from_fn(|i, j| rows[i][j]);
    for (s, t) in [(dt, dt), (1e-3 * dt, 2e-3 * dt), (5.0 * dt, 30.0 * dt), (-dt, -2.0 * dt)] {
        let between = model.propagate(&model.prepare(0.0, s), &x, [0.0; 3]);
        let whole = matrix(noise(&x, 0.0, s + t));
        assert_eq!(whole, whole.transpose());
        let scale = SVector::<f64, N>::from_fn(|i, _| 1.0 / whole[(i, i)].sqrt());
        let correlation = SMatrix::from_diagonal(&scale) * whole * SMatrix::from_diagonal(&scale);
        assert!(correlation.cholesky().is_some());
        let phi = matrix(model.transition(&model.prepare(s, t), &between, [0.0; 3]).1);
        let sum = phi * matrix(noise(&x, 0.0, s)) * phi.transpose() + matrix(noise(&between, s, t));
        let difference = SMatrix::from_diagonal(&scale) * (sum - whole) * SMatrix::from_diagonal(&scale);
        assert!(difference.amax() <= SAME_FORMULA, "{difference}");
    }
}

macro_rules! every_dynamics {
    ($($model:ident: $n:literal),* $(,)?) => {
        #[test]
        fn transitions_are_derivatives() {
            $(transition::<$model, $n>(<$model as Specimen<$n>>::specimen());)*
        }

        #[test]
        fn steps_compose() {
            $(semigroup::<$model, $n>(<$model as Specimen<$n>>::specimen());)*
        }

        #[test]
        fn noise_accumulates() {
            $(process_noise::<$model, $n>(<$model as Specimen<$n>>::specimen());)*
        }

        #[test]
        fn zeros_are_zeros() {
            $(carry::<$model, $n>();)*
        }

        #[test]
        fn names_are_those_of_the_list() {
            $(assert_eq!(<$model as DynamicsModel<f64, $n>>::NAME, stringify!($model));)*
        }
    };
}

losnav_core::dynamics! { every_dynamics }

/// The equations of motion, by central differences of the propagated velocity.
#[test]
fn clohessy_wiltshire_solves_its_equations() {
    let (model, x, u, _) = ClohessyWiltshire::specimen();
    let w = model.mean_motion;
    for start in [0.0, 400.0, 2500.0] {
        let at = |t: f64| {
            DynamicsModel::<f64, 6>::propagate(
                &model,
                &DynamicsModel::<f64, 6>::prepare(&model, 0.0, t),
                &x,
                u,
            )
        };
        let h = 0.03;
        let (before, now, after) = (at(start - h), at(start), at(start + h));
        let rate = |i: usize| (after[i] - before[i]) / (2.0 * h);
        // What the difference leaves: h²/6 times a jerk of 2 w u, 1e-6 m/s³.
        let expected =
            [u[0] + 2.0 * w * now[5], u[1] - w * w * now[1], u[2] - 2.0 * w * now[3] + 3.0 * w * w * now[2]];
        for i in 0..3 {
            assert_close(rate(i), now[3 + i], 1.0, 1e-9);
            assert_close(rate(3 + i), expected[i], 1e-3, 1e-9);
        }
    }
}

/// Free space is the limit of a slow orbit.
#[test]
fn no_orbit_is_a_double_integrator() {
    let model = ClohessyWiltshire { mean_motion: 0.0, acceleration_psd: 2.0 };
    let x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
    let step = DynamicsModel::<f64, 6>::prepare(&model, 0.0, 3.0);
    assert_eq!(model.propagate(&step, &x, [2.0, 0.0, -2.0]), [22.0, 17.0, 12.0, 10.0, 5.0, 0.0]);
    let q = DynamicsModel::<f64, 6>::process_noise(&model, &step, &x);
    assert_eq!([q[0][0], q[0][3], q[3][3], q[0][2]], [18.0, 9.0, 6.0, 0.0]);
}

/// What a model does with the zeros of `Φ` is what the full product does.
fn carry<M, const N: usize>()
where
    M: Vector<N>,
{
    let (model, x, u, dt) = M::specimen();
    let step = model.prepare(0.0, dt);
    let (_, phi) = model.transition(&step, &x, u);
    let mut covariance = [[0.0; N]; N];
    for (i, row) in covariance.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate().skip(i) {
            *entry = if i == j { 2.0 + i as f64 } else { ((3 * i + 7 * j) as f64).sin() };
        }
    }
    let covariance = mirrored(&covariance);
    let (short, full) = (model.carry(&step, &phi, &covariance), congruence(&phi, &covariance));
    for i in 0..N {
        for j in i..N {
            assert_close(short[i][j], full[i][j], (full[i][i] * full[j][j]).sqrt(), SAME_FORMULA);
        }
    }
}

const MU: f64 = 3.986_004_418e14;
const POINT_MASS: TwoBody = TwoBody { mu: MU, j2: 0.0, radius: 0.0, acceleration_psd: 1e-9 };

/// A state at `distance` with its speed in units of the circular one, `up` of it away from the centre.
fn orbit(distance: f64, speed: f64, up: f64) -> [f64; 6] {
    let (v, level) = (speed * (MU / distance).sqrt(), (1.0 - up * up).sqrt());
    // Two orthonormal directions.
    let (a, b) = ([2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0], [2.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0]);
    core::array::from_fn(|i| if i < 3 { distance * a[i] } else { v * (up * a[i - 3] + level * b[i - 3]) })
}

/// Circle, ellipses, parabola, hyperbolas; at a turning point, rising and falling.
fn conics() -> Vec<Case<TwoBody, 6>> {
    let mut cases = Vec::new();
    for speed in [1.0, 0.6, 1.3, 1.41, core::f64::consts::SQRT_2, 1.4143, 1.6, 5.0] {
        for up in [0.0, 0.5, -0.5] {
            cases.push((POINT_MASS, orbit(8e6, speed, up), [0.0; 3], 60.0));
        }
    }
    cases
}

#[test]
fn every_conic_obeys_the_laws() {
    for case in conics() {
        transition::<TwoBody, 6>(case);
        semigroup::<TwoBody, 6>(case);
        process_noise::<TwoBody, 6>(case);
    }
}

#[test]
fn the_closed_form_is_what_the_integrator_finds() {
    for (model, x, _, dt) in conics() {
        for dt in [dt, -20.0 * dt, 90.0 * dt] {
            let closed = model.propagate(&dt, &x, [0.0; 3]);
            // A push too small to be seen sends it through the integrator.
            let integrated = model.propagate(&dt, &x, [1e-300, 0.0, 0.0]);
            assert_same_state(&closed, &integrated, 10.0 * SAME_FORMULA);
        }
    }
}

/// `Q` from its definition: Gauss's formula over the model's own transitions to the end of the step.
fn defined<M: Vector<6>>(model: &M, x: &[f64; 6], dt: f64, psd: f64) -> SMatrix<f64, 6, 6> {
    let mut sum = SMatrix::<f64, 6, 6>::zeros();
    for (node, weight) in NODES {
        let at = model.propagate(&model.prepare(0.0, node * dt), x, [0.0; 3]);
        let rest = model.prepare(node * dt, (1.0 - node) * dt);
        let phi = model.transition(&rest, &at, [0.0; 3]).1;
        let push = SMatrix::<f64, 6, 3>::from_fn(|i, j| phi[i][j + 3]);
        sum += weight * dt.abs() * psd * push * push.transpose();
    }
    sum
}

/// The series of short steps, up to the longest there are, on circles, at both ends of ellipses and past the planet.
#[test]
fn noise_of_a_short_step_is_its_integral() {
    let one = |model: &dyn Fn(f64) -> [[f64; 6]; 6], reference: SMatrix<f64, 6, 6>, dt: f64| {
        let q = model(dt);
        for i in 0..6 {
            for j in 0..6 {
                assert_eq!(q[i][j], q[j][i]);
                let scale = (reference[(i, i)] * reference[(j, j)]).sqrt();
                assert_close(q[i][j], reference[(i, j)], scale, SAME_FORMULA);
            }
        }
    };
    let flat = TwoBody { j2: 1.082_626_68e-3, radius: 6_378_137.0, ..POINT_MASS };
    for model in [POINT_MASS, flat] {
        for (_, x, ..) in conics() {
            for share in [1e-5, 3e-4, 9.9e-4, 1.1e-3, -9.9e-4] {
                let dt = share * model.field().pace(&x);
                let q = |dt: f64| model.process_noise(&DynamicsModel::<f64, 6>::prepare(&model, 0.0, dt), &x);
                one(&q, defined(&model, &x, dt, 1e-9), dt);
            }
        }
    }
    let (model, x, ..) = PerturbedTwoBody::specimen();
    for share in [3e-4, 9.9e-4, 1.1e-3, -9.9e-4] {
        let dt = share * model.planet.field().pace(&x);
        let q = |dt: f64| model.process_noise(&DynamicsModel::<f64, 6>::prepare(&model, 0.0, dt), &x);
        one(&q, defined(&model, &x, dt, 1e-9), dt);
    }
}

/// Far bodies pull by the plain formula's difference; the centre of a body at rest has a field of its own.
#[test]
fn third_bodies_pull_the_orbit_and_its_centre() {
    let (mut model, x, u, _) = PerturbedTwoBody::specimen();
    model.planet.j2 = 0.0;
    let norm = |v: [f64; 3]| v.iter().map(|a| a * a).sum::<f64>().sqrt();
    let expected = |time: f64, r: [f64; 3]| {
        let mut pull: [f64; 3] = core::array::from_fn(|i| u[i] - MU * r[i] / norm(r).powi(3));
        for stretch in &model.bodies[1..] {
            let b = stretch.piece.position(time);
            let d = core::array::from_fn(|i| r[i] - b[i]);
            for i in 0..3 {
                pull[i] -= stretch.mu * (d[i] / norm(d).powi(3) + b[i] / norm(b).powi(3));
            }
        }
        pull
    };
    let at = |t: f64| model.propagate(&DynamicsModel::<f64, 6>::prepare(&model, 0.0, t), &x, u);
    for time in [600.0, 5000.0] {
        let h = 0.5;
        let (before, now, after) = (at(time - h), at(time), at(time + h));
        let pull = expected(time, [now[0], now[1], now[2]]);
        for i in 0..3 {
            // What the difference leaves: h²/6 times the third derivative of the speed, 1e-8 of the pull.
            assert_close((after[3 + i] - before[3 + i]) / (2.0 * h), pull[i], norm(pull), 1e-6);
        }
    }
    // Nobody knows where the bodies are then: no state, and no transition.
    assert!(at(3.0e4).iter().all(|value| value.is_nan()));
    let step = DynamicsModel::<f64, 6>::prepare(&model, 1.9e4, 2.0e3);
    assert!(model.transition(&step, &x, u).1.as_flattened().iter().all(|value| value.is_nan()));
    // No bodies: the planet alone.
    let alone = losnav_core::models::dynamics::PerturbedTwoBody { planet: model.planet, bodies: [] };
    let step = DynamicsModel::<f64, 6>::prepare(&alone, 0.0, 600.0);
    assert_same_state(&alone.propagate(&step, &x, u), &model.planet.propagate(&600.0, &x, u), SAME_FORMULA);
}
