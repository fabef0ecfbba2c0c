//! The kernels to measure, each a closure over its fixtures: shared by the times (criterion) and the instruction counts.
use std::hint::black_box;

use losnav_core::estimators::kalman::{Covariance, Estimate, Joseph, Options as Taking, Ud, predict, update};
use losnav_core::estimators::least_squares::{
    Method, Options, Outcome, Parametrization, PoseObjective, PoseState, solve,
};
use losnav_core::estimators::loss::Squared;
use losnav_core::estimators::minimal::{candidates, p3p};
use losnav_core::estimators::normal_equations::NormalEquations;
use losnav_core::estimators::pose::LosObjective;
use losnav_core::estimators::robust::{RobustOptions, solve_robust};
use losnav_core::estimators::wahba::{Directions, Method as Solver, Vectors, polish};
use losnav_core::math::so3::{dcm_from_quaternion, step};
use losnav_core::math::trig::atan2;
use losnav_core::math::vec3::{rotate, sub};
use losnav_core::models::dynamics::relative_two_body::Fix;
use losnav_core::models::dynamics::strapdown::{ImuSample, Noise, Site, Strapdown};
use losnav_core::models::dynamics::{
    CurvilinearClohessyWiltshire, DynamicsModel, RelativeTwoBody, Specimen, TwoBody, YamanakaAnkersen,
};
use losnav_core::models::gravity::PointMass;
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::Weight;
use losnav_core::models::nav_state::NavState;
use losnav_core::models::sensors::landmark_camera::Optics;
use losnav_core::models::sensors::line_of_sight::direction;
use losnav_core::models::sensors::{LandmarkCamera, LineOfSight};
use nalgebra::Vector3;

/// 1-sigma noise of a direction, rad.
const SIGMA: f64 = 2e-5;
const OPTIONS: Options = Options {
    method: Method::LevenbergMarquardt,
    parametrization: Parametrization::Rotation,
    damping: 1e-3,
    max_iterations: 50,
    cost_tolerance: 1e-12,
    step_tolerance: 1e-12,
};

/// A lander 500 m above `n` landmarks 30 m around, guess 50 m and 5 degrees off.
struct Scene {
    landmarks: Vec<[f64; 3]>,
    los: Vec<[f64; 3]>,
    guess: PoseState<f64>,
}

/// SplitMix64: the same scenes on every machine.
struct Random(u64);

impl Random {
    /// Uniform in (-1, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

impl Scene {
    fn new(n: usize, outliers: usize) -> Self {
        let mut random = Random(n as u64);
        let mut landmarks = vec![[32.5, 0.0, 0.0], [0.0, 30.0, 0.0], [-31.5, 0.0, 0.0], [0.0, -30.5, 0.0]];
        while landmarks.len() < n {
            landmarks.push([32.0 * random.next(), 32.0 * random.next(), 3.0 * random.next()]);
        }
        landmarks.truncate(n);
        let truth = PoseState::from_mrp([-50.0, 50.0, 500.0], [0.98, 0.02, -0.07]);
        let dcm = dcm_from_quaternion(truth.attitude);
        let mut los = Vec::new();
        for (k, landmark) in landmarks.iter().enumerate() {
            let mut b = rotate(&dcm, sub(*landmark, truth.position));
            if k % 5 < 2 && k / 5 < outliers.div_ceil(2) {
                b = [b[0] + 40.0 * random.next(), b[1] + 40.0 * random.next(), b[2]];
            }
            let length = (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]).sqrt();
            let noisy = b.map(|c| c / length + 2.0 * SIGMA * random.next());
            let length = noisy.iter().map(|c| c * c).sum::<f64>().sqrt();
            los.push(noisy.map(|c| c / length));
        }
        let guess =
            PoseState { position: [-20.0, 20.0, 525.0], attitude: step(truth.attitude, [0.05, -0.05, 0.05]) };
        Self { landmarks, los, guess }
    }

    fn objective<'a>(&'a self, weights: &'a [Weight<f64>]) -> LosObjective<'a, f64, Squared> {
        let sensor = LineOfSight { landmarks: &self.landmarks, los: &self.los, weights };
        LosObjective { sensor, loss: Squared }
    }
}

/// Receives the kernels one by one.
pub trait Measure {
    /// Measures `call`.
    fn measure(&mut self, name: &str, call: &mut dyn FnMut());
}

/// Hands every kernel to `measure`. The fixtures are made here, outside what is measured.
pub fn visit(measure: &mut impl Measure) {
    let weights = [Weight::Scalar(1.0 / (SIGMA * SIGMA))];
    linear_algebra(measure, &weights);
    for n in [4, 8, 50] {
        let scene = Scene::new(n, 0);
        let objective = scene.objective(&weights);
        measure.measure(&format!("normal equations, N={n}"), &mut || {
            black_box(objective.linearize(black_box(&scene.guess)));
        });
        measure.measure(&format!("exact Hessian pass, N={n}"), &mut || {
            black_box(objective.linearize_twice(black_box(&scene.guess)));
        });
        measure.measure(&format!("LM solve, N={n}"), &mut || {
            let outcome: Outcome<f64> = solve(&objective, black_box(&scene.guess), &OPTIONS);
            black_box(outcome);
        });
    }
    minimal(measure);
    robust(measure, &weights);
    attitude(measure);
    motion(measure);
    landing::<Joseph<f64, 15>>("Joseph", measure);
    landing::<Ud<f64, 15>>("UD", measure);
}

/// Fifteen errors over a turning body: a sample of the unit, an image of ten landmarks.
fn landing<P: Covariance<f64, 15>>(form: &str, measure: &mut impl Measure) {
    const LEVEL: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let site = Site { site_from_fixed: LEVEL, center: [0.0, 0.0, 15e3], angular_velocity: [0.0, 3e-4, 1e-5] };
    let noise = Noise {
        acceleration: 1e-8,
        angular_rate: 1e-11,
        accelerometer_bias: 1e-14,
        gyroscope_bias: 1e-17,
        deviation: 0.0,
        time_constant: f64::INFINITY,
    };
    let model = Strapdown { site, gravity: PointMass { mu: 4.4e5 }, noise };
    let step = DynamicsModel::<f64, 15>::prepare(&model, 0.0, 0.1);
    let mut prior = [[0.0; 15]; 15];
    for i in 0..15 {
        prior[i][i] = [100.0, 0.01, 1e-4, 1e-6, 1e-10][i / 3];
    }
    let mut state = NavState::origin();
    state.position = [4.0, -3.0, 1000.0];
    state.attitude = [1.0, 0.0, 0.0, 0.0];
    let estimate = Estimate { state, covariance: P::new(&prior) };
    let sample = ImuSample { specific_force: [1e-3, 2e-3, -2e-3], angular_rate: [1e-3, -2e-3, 3e-3] };
    measure.measure(&format!("{form}, 15 states: predict"), &mut || {
        black_box(predict(&model, &step, black_box(sample), black_box(&estimate)));
    });
    let mut random = Random(15);
    let landmarks: [_; 10] = core::array::from_fn(|_| [100.0 * random.next(), 100.0 * random.next(), 0.0]);
    let optics = Optics {
        focal_length: [500.0; 2],
        principal_point: [0.0; 2],
        camera_from_body: LEVEL,
        lever_arm: [0.0; 3],
    };
    let pixels = landmarks.map(|l| [0.5 * (l[0] - 4.0), -0.5 * (l[1] + 3.0)]);
    let camera = LandmarkCamera { landmarks: &landmarks, pixels: &pixels, sigmas: &[1.0], map: &[], optics };
    measure.measure(&format!("{form}, 15 states: update, 10 landmarks"), &mut || {
        let taken = update(black_box(&estimate), &camera, &LEVEL, &Taking::PLAIN, f64::INFINITY, &mut []);
        black_box(taken).ok();
    });
}

/// Models of motion over a minute in low orbit.
fn motion(measure: &mut impl Measure) {
    fn of<M: Specimen<6, State = [f64; 6], Control = [f64; 3]>>(measure: &mut impl Measure) {
        let (model, state, u, dt) = M::specimen();
        let step = model.prepare(0.0, dt);
        measure.measure(&format!("{}: transition", M::NAME), &mut || {
            black_box(model.transition(&step, black_box(&state), u));
        });
        measure.measure(&format!("{}: process noise", M::NAME), &mut || {
            black_box(model.process_noise(&step, black_box(&state)));
        });
    }
    of::<TwoBody>(measure);
    of::<RelativeTwoBody<[Fix; 1]>>(measure);
    of::<CurvilinearClohessyWiltshire>(measure);
    let (_, state, _, dt) = TwoBody::specimen();
    let point = TwoBody { j2: 0.0, ..TwoBody::specimen().0 };
    measure.measure("Kepler: transition", &mut || {
        black_box(point.transition(&dt, black_box(&state), [0.0; 3]));
    });
    let (eccentric, _, _, dt) = YamanakaAnkersen::specimen();
    measure.measure("YamanakaAnkersen: prepare", &mut || {
        black_box(DynamicsModel::<f64, 6>::prepare(&eccentric, black_box(0.0), dt));
    });
    measure.measure("atan2", &mut || {
        black_box(atan2(black_box(0.3), black_box(-0.4)));
    });
}

fn linear_algebra(measure: &mut impl Measure, weights: &[Weight<f64>; 1]) {
    let scene = Scene::new(4, 0);
    let x = Kinematics::at_rest(scene.guess.position, scene.guess.attitude);
    measure.measure("line of sight, linearised", &mut || {
        black_box(direction(black_box(&x), scene.landmarks[0], scene.los[0], weights[0]));
    });
    let equations: NormalEquations<f64> = scene.objective(weights).linearize(&scene.guess);
    measure.measure("LDL of 6x6 and solve", &mut || {
        black_box(black_box(&equations.hessian).ldl().solve(&equations.gradient));
    });
}

fn minimal(measure: &mut impl Measure) {
    let scene = Scene::new(3, 0);
    let triple = |rows: &[[f64; 3]]| [rows[0], rows[1], rows[2]].map(Vector3::from);
    let (landmarks, los) = (triple(&scene.landmarks), triple(&scene.los));
    measure.measure("P3P", &mut || {
        black_box(p3p(black_box(&landmarks), &los));
    });
    for n in [4, 8, 50] {
        let scene = Scene::new(n, 0);
        measure.measure(&format!("candidates, N={n}"), &mut || {
            black_box(candidates(black_box(&scene.landmarks), &scene.los, |_| 1.0 / (SIGMA * SIGMA)));
        });
    }
}

fn robust(measure: &mut impl Measure, weights: &[Weight<f64>; 1]) {
    // The gate of 99.9 % of the right directions.
    let gate = (-2.0 * 0.001_f64.ln()).sqrt();
    let options =
        RobustOptions { gate, max_outlier_ratio: 0.6, confidence: 0.9999, seed: 0, polish: OPTIONS };
    let scene = Scene::new(50, 20);
    let sensor = LineOfSight { landmarks: &scene.landmarks, los: &scene.los, weights };
    let mut inliers = [false; 50];
    measure.measure("robust, N=50, 40 % wrong", &mut || {
        black_box(solve_robust(black_box(&sensor), &options, &mut inliers));
    });
}

fn attitude(measure: &mut impl Measure) {
    let weights = [1.0 / (SIGMA * SIGMA)];
    let solvers = [
        ("QUEST", Solver::Quest),
        ("q-method", Solver::QMethod),
        ("SVD", Solver::Svd),
        ("FOAM", Solver::Foam),
        ("ESOQ2", Solver::Esoq2),
    ];
    for n in [2, 5, 8, 50] {
        let scene = Scene::new(n, 0);
        // Directions to the landmarks as the guess sees them: any two sets that nearly agree will do.
        let reference: Vec<_> =
            scene.los.iter().map(|b| rotate(&dcm_from_quaternion(scene.guess.attitude), *b)).collect();
        let vectors = Vectors { body: &scene.los, reference: &reference, weights: &weights };
        measure.measure(&format!("attitude, N={n}"), &mut || {
            black_box(polish::solve::<f64>(black_box(&vectors)));
        });
        let profile = vectors.profile();
        for (name, solver) in solvers.into_iter().filter(|_| n == 8) {
            measure.measure(&format!("{name} of a profile matrix"), &mut || {
                black_box(solver.start(black_box(&profile)));
            });
        }
    }
}
