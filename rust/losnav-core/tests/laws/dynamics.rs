//! Laws of every dynamics in the list.
use losnav_core::models::dynamics::{ClohessyWiltshire, DynamicsModel, Specimen, congruence};
use nalgebra::{SMatrix, SVector};

use crate::dual::First;
use crate::{SAME_FORMULA, assert_close};

/// A model whose state is an array and whose control is an acceleration.
trait Vector<const N: usize>: Specimen<N> + DynamicsModel<f64, N, State = [f64; N], Control = [f64; 3]> {}

impl<M, const N: usize> Vector<N> for M where
    M: Specimen<N> + DynamicsModel<f64, N, State = [f64; N], Control = [f64; 3]>
{
}

/// Size of each component, so that metres stand beside metres per second.
fn scales<const N: usize>(a: &[f64; N], dt: f64) -> [f64; N] {
    let all = a.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    core::array::from_fn(|i| if i < N / 2 { all } else { all / dt.abs().max(1.0) })
}

/// `Φ` is the derivative of the propagation, through the same source, by dual numbers.
fn transition<M, const N: usize>()
where
    M: Vector<N> + DynamicsModel<First, N, State = [First; N], Control = [First; 3]>,
{
    let (model, x, u, dt) = M::specimen();
    for dt in [dt, -dt, 1e-3 * dt, 100.0 * dt] {
        let step = DynamicsModel::<f64, N>::prepare(&model, 0.0, dt);
        let (end, phi) = DynamicsModel::<f64, N>::transition(&model, &step, &x, u);
        assert_eq!(end, DynamicsModel::<f64, N>::propagate(&model, &step, &x, u));
        for column in 0..N {
            let mut seeded = x.map(|v| First::along(v, 0.0));
            seeded[column].slope = 1.0;
            let step = DynamicsModel::<First, N>::prepare(&model, 0.0, dt);
            let control = u.map(|v| First::along(v, 0.0));
            let moved = DynamicsModel::<First, N>::propagate(&model, &step, &seeded, control);
            for row in 0..N {
                assert_close(
                    phi[row][column],
                    moved[row].slope,
                    phi[row][column].abs().max(1.0),
                    SAME_FORMULA,
                );
            }
        }
    }
}

/// Two steps are one: `x(s + t) = x(t) ∘ x(s)`, `Φ(s + t) = Φ(t) Φ(s)`; nothing happens in no time; back is back.
fn semigroup<M, const N: usize>()
where
    M: Vector<N>,
{
    let (model, x, u, dt) = M::specimen();
    let propagate = |x: &[f64; N], time: f64, dt: f64| model.propagate(&model.prepare(time, dt), x, u);
    let transition = |x: &[f64; N], time: f64, dt: f64| model.transition(&model.prepare(time, dt), x, u).1;
    assert_eq!(propagate(&x, 0.0, 0.0), x);
    for (s, t) in [(dt, 0.5 * dt), (10.0 * dt, dt), (dt, -dt), (37.0 * dt, 61.0 * dt)] {
        let between = propagate(&x, 0.0, s);
        let (twice, once) = (propagate(&between, s, t), propagate(&x, 0.0, s + t));
        let size = scales(&between, s);
        for i in 0..N {
            assert_close(twice[i], once[i], size[i].max(1.0), 100.0 * SAME_FORMULA);
        }
        let matrix = |rows: [[f64; N]; N]| SMatrix::<f64, N, N>::from_fn(|i, j| rows[i][j]);
        let product = matrix(transition(&between, s, t)) * matrix(transition(&x, 0.0, s));
        let whole = matrix(transition(&x, 0.0, s + t));
        assert!(
            (product - whole).amax() <= 100.0 * SAME_FORMULA * whole.amax().max(product.amax()).max(s.abs())
        );
    }
}

/// `Q` is symmetric, positive definite, and adds up: `Q(s + t) = Φ(t) Q(s) Φ(t)ᵀ + Q(t)`.
fn process_noise<M, const N: usize>()
where
    M: Vector<N>,
{
    let (model, x, u, dt) = M::specimen();
    let noise = |time: f64, dt: f64| model.process_noise(&model.prepare(time, dt), &x);
    let matrix = |rows: [[f64; N]; N]| SMatrix::<f64, N, N>::from_fn(|i, j| rows[i][j]);
    for (s, t) in [(dt, dt), (1e-3 * dt, 2e-3 * dt), (5.0 * dt, 30.0 * dt), (-dt, -2.0 * dt)] {
        let whole = matrix(noise(0.0, s + t));
        assert_eq!(whole, whole.transpose());
        let scale = SVector::<f64, N>::from_fn(|i, _| 1.0 / whole[(i, i)].sqrt());
        let correlation = SMatrix::from_diagonal(&scale) * whole * SMatrix::from_diagonal(&scale);
        assert!(correlation.cholesky().is_some());
        let phi = matrix(model.transition(&model.prepare(s, t), &x, u).1);
        let sum = phi * matrix(noise(0.0, s)) * phi.transpose() + matrix(noise(s, t));
        let difference = SMatrix::from_diagonal(&scale) * (sum - whole) * SMatrix::from_diagonal(&scale);
        assert!(difference.amax() <= SAME_FORMULA, "{difference}");
    }
}

macro_rules! every_dynamics {
    ($($model:ident: $n:literal),* $(,)?) => {
        #[test]
        fn transitions_are_derivatives() {
            $(transition::<$model, $n>();)*
        }

        #[test]
        fn steps_compose() {
            $(semigroup::<$model, $n>();)*
        }

        #[test]
        fn noise_accumulates() {
            $(process_noise::<$model, $n>();)*
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
    let (short, full) = (model.carry(&step, &phi, &covariance), congruence(&phi, &covariance));
    for i in 0..N {
        for j in i..N {
            assert_close(short[i][j], full[i][j], (full[i][i] * full[j][j]).sqrt(), SAME_FORMULA);
        }
    }
}
