//! Laws of series: what flows and what sensors see is what the propagated state is and shows.
use losnav_core::analysis::lie::{Series, factorial, see, seeded};
use losnav_core::math::gradient::Gradient;
use losnav_core::math::jets::Jet;
use losnav_core::math::real::Real;
use losnav_core::math::vec3::dot;
use losnav_core::models::dynamics::flow::{Flow, MAX_ORDER, expand};
use losnav_core::models::dynamics::perturbed_two_body::Stretch;
use losnav_core::models::dynamics::relative_two_body::Fix;
use losnav_core::models::dynamics::strapdown::{ImuSample, Strapdown};
use losnav_core::models::dynamics::{
    ClohessyWiltshire, CurvilinearClohessyWiltshire, DynamicsModel, Specimen as DynamicsSpecimen, TwoBody,
    YamanakaAnkersen,
};
use losnav_core::models::gravity::PointMass;
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::{Recorder, Row};
use losnav_core::models::nav_state::NavState;
use losnav_core::models::sensors::*;
use losnav_core::models::state::State;

use crate::scene::observer;
use crate::strapdown;
use crate::{SAME_FORMULA, assert_close, largest};

/// With one fix: more are jumps of the path, which are no series.
type RelativeTwoBody = losnav_core::models::dynamics::RelativeTwoBody<[Fix; 1]>;
type PerturbedTwoBody = losnav_core::models::dynamics::PerturbedTwoBody<[Stretch; 3]>;

const C: usize = MAX_ORDER + 1;
/// A series of plain numbers, and one with a derivative.
type Plain = Jet<f64, C>;
type Seeded = Series<f64, C>;

/// `Σ x_k τᵏ`.
fn at(series: &Plain, tau: f64) -> f64 {
    (0..C).rev().fold(0.0, |sum, k| sum * tau + series.coefficient(k))
}

/// The derivative of the same.
fn slope_at(series: &Seeded, tau: f64) -> f64 {
    (0..C).rev().fold(0.0, |sum, k| sum * tau + series.coefficient(k).slope[0])
}

/// Functions of a series are the series of functions: their values a step later.
#[test]
fn series_of_functions() {
    let mut coefficients = [0.0; C];
    for (k, c) in coefficients.iter_mut().enumerate() {
        *c = (1.3 + 0.4 * k as f64).sin() / (1 << k) as f64;
    }
    let (a, tau) = (Plain::known(coefficients, C), 0.02);
    let b = Plain::time(0.7) * a + Plain::splat(2.0);
    let (x, y) = (at(&a, tau), at(&b, tau));
    let checks: [(Plain, f64); 14] = [
        (a + b, x + y),
        (a - b, x - y),
        (a * b, x * y),
        (a / b, x / y),
        (-a, -x),
        (a.sqrt(), x.sqrt()),
        (a.recip(), 1.0 / x),
        (b.rsqrt(), 1.0 / y.sqrt()),
        (b.ln(), y.ln()),
        ((-a).abs(), x),
        (a.max(b), y),
        (a.mul_add(b, a), x * y + x),
        (a.plus(3.0, b), x + 3.0 * y),
        ((a * b).sine_cosine().0, (x * y).sin()),
    ];
    for (series, value) in checks {
        assert_eq!(series.order(), MAX_ORDER);
        assert_close(at(&series, tau), value, value.abs(), 1e-14);
    }
    for (u, v, p, q) in [(a, b, x, y), (a, -b, x, -y), (-b, a, -y, x), (-b, -a, -y, -x)] {
        assert_close(at(&u.arctan2(v), tau), p.atan2(q), 1.0, 1e-14);
        assert_close(at(&(u * v).sine_cosine().1, tau), (p * q).cos(), 1.0, 1e-14);
    }
}

/// What is known of a result is what follows from what is known of its arguments, and no more.
#[test]
fn orders_are_those_of_what_is_known() {
    let (constant, time) = (Plain::splat(3.0), Plain::time(2.0));
    let known = |order: usize| Plain::known([1.5; C], order + 1);
    for order in [0, 1, 4, MAX_ORDER] {
        let x = known(order);
        let all = [
            x + constant,
            x * time,
            time * x,
            x / time,
            time / x,
            constant * x,
            x.sqrt(),
            x.ln(),
            x.recip(),
            x.rsqrt(),
            x.sine_cosine().0,
            x.arctan2(time),
            time.arctan2(x),
            x.mul_add(time, constant),
            constant.mul_add(time, x),
            x * known(MAX_ORDER),
            x - known(MAX_ORDER),
            x.abs(),
            x.max(constant),
        ];
        for (i, result) in all.iter().enumerate() {
            assert_eq!(result.order(), order, "{i}");
            for k in order + 1..C {
                assert_eq!(result.coefficient(k), 0.0);
            }
        }
        assert_eq!(x.integral(0.0).order(), (order + 1).min(MAX_ORDER));
    }
    // What does not move is known for ever, and so is a polynomial of time while there is room for it.
    assert_eq!((constant * constant).sqrt(), constant);
    let mut power = time;
    for _ in 2..C {
        power = power * time;
        assert_eq!(power + known(MAX_ORDER), known(MAX_ORDER) + power);
    }
    assert_eq!(at(&power, 0.5), 2.5_f64.powi(MAX_ORDER as i32));
}

/// A formula beside coordinates about a planet a hundred times farther than what is seen.
const CONDITIONED: f64 = 100.0 * SAME_FORMULA;
/// What a step of order 4 leaves over five milliseconds, and what `Φ` from the middle of that step does.
const RUNGE_KUTTA: f64 = 1e-12;
const TRANSITION: f64 = 1e-7;
/// A time after which fifteen orders leave nothing, and every order has said something.
const SHARE: f64 = 0.02;

/// A model whose state is an array and whose control is an acceleration, through every number needed here.
trait Flowing:
    DynamicsSpecimen<6>
    + DynamicsModel<f64, 6, State = [f64; 6], Control = [f64; 3]>
    + Flow<Plain, 6, State = [Plain; 6], Control = [Plain; 3]>
    + Flow<Seeded, 6, State = [Seeded; 6], Control = [Seeded; 3]>
{
}

impl<M> Flowing for M where
    M: DynamicsSpecimen<6>
        + DynamicsModel<f64, 6, State = [f64; 6], Control = [f64; 3]>
        + Flow<Plain, 6, State = [Plain; 6], Control = [Plain; 3]>
        + Flow<Seeded, 6, State = [Seeded; 6], Control = [Seeded; 3]>
{
}

/// An example of a model, at a time that is not zero, with and without control, and how long its series serve.
fn examples<M: Flowing>() -> [(M, [f64; 6], [f64; 3], f64); 2] {
    let pair = |control: bool| {
        let (model, x, u, dt) = M::specimen();
        (model, x, if control { u } else { [0.0; 3] }, dt)
    };
    [pair(true), pair(false)]
}

/// The series is the propagated state, `Φ` its derivative.
fn flow<M: Flowing>() {
    for (model, x, u, dt) in examples::<M>() {
        // No piece of an ephemeris ends within the step.
        let time = 100.0;
        for tau in [dt, -dt] {
            let step = DynamicsModel::<f64, 6>::prepare(&model, time, tau);
            let (end, phi) = DynamicsModel::<f64, 6>::transition(&model, &step, &x, u);
            let start = x.map(|v| Seeded::constant(Gradient::constant(v)));
            let control = u.map(|v| Seeded::constant(Gradient::constant(v)));
            for column in 0..6 {
                let mut direction = [0.0; 6];
                direction[column] = 1.0;
                let start = seeded(&start, &direction);
                let path: [Seeded; 6] =
                    expand::<Gradient<f64, 1>, M, 6, C>(&model, time, &start, control, MAX_ORDER, true);
                for (row, part) in [(0, 0..3), (1, 0..3), (2, 0..3), (3, 3..6), (4, 3..6), (5, 3..6)] {
                    assert_eq!(path[row].order(), MAX_ORDER);
                    let value = (0..C).rev().fold(0.0, |sum, k| sum * tau + path[row].coefficient(k).value);
                    assert_close(value, end[row], largest(part.clone().map(|i| end[i])), SAME_FORMULA);
                    let scale = largest(part.map(|i| phi[i][column]));
                    assert_close(slope_at(&path[row], tau), phi[row][column], scale, 10.0 * SAME_FORMULA);
                }
            }
        }
    }
}

/// What a sensor says at a state: nothing where its measurement is undefined.
struct Rows(Kinematics<f64>, Vec<Row<f64>>);

impl Law<f64> for Rows {
    fn examine(&mut self, sensor: &impl SensorModel<f64>) {
        self.1 = vec![Row::zero(); sensor.rows()];
        if sensor.linearize(&self.0, &mut Recorder::new(&mut self.1)).is_err() {
            self.1.clear();
        }
    }
}

/// What a sensor says of a series.
struct Seen(Kinematics<Seeded>, Vec<Seeded>, usize);

impl Law<Seeded> for Seen {
    fn examine(&mut self, sensor: &impl SensorModel<Seeded>) {
        self.1 = vec![Seeded::zero(); sensor.rows()];
        self.2 = see(sensor, &self.0, &mut self.1).unwrap();
    }
}

/// A path as series, one for each direction of the start, and where it leads.
struct Path {
    series: Vec<Kinematics<Seeded>>,
    start: Kinematics<f64>,
    end: Kinematics<f64>,
    phi: [[f64; 6]; 6],
    tau: f64,
}

fn path<M: Flowing>() -> Path {
    path_of(M::specimen())
}

/// Where every sensor sees something.
fn in_view() -> Path {
    let (model, _, u, dt) = ClohessyWiltshire::specimen();
    let Kinematics { position: [x, y, z], velocity: [v, w, s], .. } = observer();
    // A few metres from the nearest landmark.
    path_of((model, [x, y, z, v, w, s], u, 0.1 * dt))
}

fn path_of<M: Flowing>((model, x, u, dt): (M, [f64; 6], [f64; 3], f64)) -> Path {
    let (time, attitude, tau) = (-25.0, observer().dcm, SHARE * dt);
    let step = DynamicsModel::<f64, 6>::prepare(&model, time, tau);
    let (end, phi) = DynamicsModel::<f64, 6>::transition(&model, &step, &x, u);
    let seen = |x: &[f64; 6]| State::<f64, 6>::kinematics(x, &attitude);
    let dcm = attitude.map(|row| row.map(Seeded::splat));
    let series = (0..6).map(|column| {
        let mut direction = [0.0; 6];
        direction[column] = 1.0;
        let start = seeded(&x.map(Seeded::splat), &direction);
        let control = u.map(Seeded::splat);
        expand::<Gradient<f64, 1>, M, 6, C>(&model, time, &start, control, MAX_ORDER, true).kinematics(&dcm)
    });
    Path { series: series.collect(), start: seen(&x), end: seen(&end), phi, tau }
}

/// The rows are those of the propagated state, `d(k! h_k)/dx` summing up to `H Φ`.
fn measured<F: Specimen<f64>, S: Specimen<Seeded>>(paths: &[Path]) {
    let mut seen_from = 0;
    for path in paths {
        let mut there = Rows(path.end, Vec::new());
        F::show(&path.start, &mut there);
        if there.1.is_empty() {
            continue;
        }
        seen_from += 1;
        for (column, x) in path.series.iter().enumerate() {
            let mut seen = Seen(*x, Vec::new(), 0);
            S::show(&path.start, &mut seen);
            assert_eq!((seen.1.len(), seen.2), (there.1.len(), MAX_ORDER));
            let terms = |row: &Row<f64>| -> [f64; 6] {
                core::array::from_fn(|i| [row.d_position, row.d_velocity][i / 3][i % 3] * path.phi[i][column])
            };
            // The sum may be much smaller than what it is made of, and an entry of Φ than its column.
            let column_of = |i: usize| largest((0..3).map(|k| path.phi[3 * (i / 3) + k][column]));
            let weight =
                |row: &Row<f64>, i: usize| [row.d_position, row.d_velocity][i / 3][i % 3] * column_of(i);
            let scale = largest(there.1.iter().flat_map(|row| (0..6).map(|i| weight(row, i))));
            for (series, row) in seen.1.iter().zip(&there.1) {
                let expected = terms(row).iter().sum();
                assert_close(slope_at(series, path.tau), expected, scale, CONDITIONED);
                let value = (0..C).rev().fold(0.0, |sum, k| sum * path.tau + series.coefficient(k).value);
                // What a difference of ranges is made of.
                let size = 1.0 + dot(row.d_position, there.0.position).abs();
                assert_close(value, -row.innovation, size, CONDITIONED);
            }
        }
    }
    assert!(seen_from > 0);
}

macro_rules! every_dynamics {
    ($($model:ident: $n:literal),* $(,)?) => {
        #[test]
        fn series_are_what_is_propagated() {
            $(flow::<$model>();)*
        }

        fn paths() -> Vec<Path> {
            vec![in_view(), $(path::<$model>()),*]
        }
    };
}

losnav_core::dynamics! { every_dynamics }

macro_rules! every_sensor {
    ($($sensor:ident),* $(,)?) => {
        #[test]
        fn lie_derivatives_are_derivatives_in_time() {
            let paths = paths();
            $(measured::<$sensor<f64>, $sensor<Seeded>>(&paths);)*
        }
    };
}

losnav_core::sensors! { every_sensor }

/// Inertial navigation: the series of an attitude, of biases and of an acceleration that decays.
#[test]
fn series_of_inertial_navigation() {
    let (model, x, sample) = (strapdown::model(), strapdown::state(), strapdown::SAMPLE);
    let plain = |v: [f64; 3]| v.map(Seeded::splat);
    let mut start = NavState::origin();
    for i in 0..19 {
        let value = State::<f64, 18>::number(&x, i);
        State::<Seeded, 18>::set_number(&mut start, i, Seeded::splat(value));
    }
    let sample_of =
        ImuSample { specific_force: plain(sample.specific_force), angular_rate: plain(sample.angular_rate) };
    let tau = 0.005;
    let step = DynamicsModel::<f64, 18>::prepare(&model, 0.0, tau);
    let (end, phi): (NavState<f64>, [[f64; 18]; 18]) = model.transition(&step, &x, sample);
    for column in 0..18 {
        let mut direction = [0.0; 18];
        direction[column] = 1.0;
        let seeded: NavState<Seeded> = seeded(&start, &direction);
        let path: NavState<Seeded> = expand::<Gradient<f64, 1>, Strapdown<PointMass>, 18, C>(
            &model, 0.0, &seeded, sample_of, MAX_ORDER, true,
        );
        let (mut ahead, mut behind) = (end, end);
        for i in 0..19 {
            let series = State::<Seeded, 18>::number(&path, i);
            let value = (0..C).rev().fold(0.0, |sum, k| sum * tau + series.coefficient(k).value);
            let expected = State::<f64, 18>::number(&end, i);
            assert_close(value, expected, 1.0 + expected.abs(), RUNGE_KUTTA);
            // The tangent of the end, by a small step along the derivative.
            let slope = 1e-4 * slope_at(&series, tau);
            State::<f64, 18>::set_number(&mut ahead, i, expected + slope);
            State::<f64, 18>::set_number(&mut behind, i, expected - slope);
        }
        let moved = State::<f64, 18>::minus(&ahead, &behind);
        for row in 0..18 {
            assert_close(moved[row] / 2e-4, phi[row][column], 1.0, TRANSITION);
        }
    }
}

#[test]
fn factorials() {
    assert_eq!([0, 1, 2, 5, 15].map(factorial), [1.0, 1.0, 2.0, 120.0, 1_307_674_368_000.0]);
}
