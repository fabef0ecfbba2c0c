//! Laws of every sensor in the list.
use losnav_core::error::ModelError;
use losnav_core::estimators::loss::{Loss, Robust, RobustKind, Squared};
use losnav_core::estimators::normal_equations::{NormalEquations, NormalEquationsSink};
use losnav_core::math::real::Real;
use losnav_core::models::kinematics::Kinematics;
use losnav_core::models::linearization::{
    Both, Innovations, Linearization, Recorder, RootWeight, Row, Sink, Weight,
};
use losnav_core::models::sensors::landmark_camera::{MapError, Optics};
use losnav_core::models::sensors::{
    Altimeter, BodyDirection, LandmarkCamera, Law, LineOfSight, Range, RangeBearing, RangeRate, SensorModel,
    Specimen, SunDirection, Velocimeter,
};

use crate::dual::First;
use crate::scene::{moved, observer, truth};
use crate::{SAME_FORMULA, assert_close, largest};

/// Writes down the rows at one state.
struct Record<T> {
    x: Kinematics<T>,
    rows: Vec<Row<T>>,
}

impl<T: Real> Law<T> for Record<T> {
    fn examine(&mut self, sensor: &impl SensorModel<T>) {
        let mut rows = vec![Row::zero(); sensor.rows()];
        let mut recorder = Recorder::new(&mut rows);
        sensor.linearize(&self.x, &mut recorder).unwrap();
        assert_eq!(recorder.offered(), sensor.rows(), "rows() says what linearize() does");
        self.rows.extend(rows);
    }
}

fn recorded<T: Real, S: Specimen<T>>(x: Kinematics<T>) -> Vec<Row<T>> {
    let mut record = Record { x, rows: Vec::new() };
    S::show(&truth(), &mut record);
    assert!(!record.rows.is_empty());
    record.rows
}

/// The Jacobian is the derivative of the prediction: `∂y/∂x = −H`, through the same source, by dual numbers.
fn jacobian<F: Specimen<f64>, D: Specimen<First>>() {
    let x = observer();
    let rows = recorded::<f64, F>(x);
    for column in 0..9 {
        let mut delta = [First::splat(0.0); 9];
        delta[column].slope = 1.0;
        let slopes = recorded::<First, D>(moved(&x, delta));
        let entry = |row: &Row<f64>| [row.d_position, row.d_velocity, row.d_attitude].concat()[column];
        let scale = largest(rows.iter().map(entry));
        for (row, slope) in rows.iter().zip(&slopes) {
            assert_close(row.innovation, slope.innovation.value, 1.0, SAME_FORMULA);
            assert_close(entry(row), -slope.innovation.slope, scale, SAME_FORMULA);
        }
    }
}

/// Forgets the structure of what it is given.
struct Plain<'a, L>(NormalEquationsSink<'a, f64, L>);

impl<L: Loss> Sink<f64> for Plain<'_, L> {
    fn add<const M: usize>(&mut self, rows: &Linearization<f64, M>) {
        self.0.add(rows);
    }
}

/// Accumulates with and without the structure, and as the definition says.
struct Accumulate<L> {
    loss: L,
    x: Kinematics<f64>,
    sums: Option<[NormalEquations<f64>; 2]>,
}

impl<L: Loss> Law<f64> for Accumulate<L> {
    fn examine(&mut self, sensor: &impl SensorModel<f64>) {
        let mut structured = NormalEquationsSink::new(&self.x.dcm, self.loss);
        let mut plain = Plain(structured);
        sensor.linearize(&self.x, &mut structured).unwrap();
        sensor.linearize(&self.x, &mut plain).unwrap();
        self.sums = Some([structured.finish(), plain.0.finish()]);
    }
}

/// A block accumulated from its structure is the block accumulated from its expanded rows.
fn structure<S: Specimen<f64>>(loss: impl Loss) {
    let mut law = Accumulate { loss, x: observer(), sums: None };
    S::show(&truth(), &mut law);
    let [a, b] = law.sums.unwrap();
    assert_close(a.cost, b.cost, a.cost, SAME_FORMULA);
    for i in 0..6 {
        assert_close(a.gradient[i], b.gradient[i], largest(a.gradient), SAME_FORMULA);
        for j in i..6 {
            let scale = (a.hessian.at(i, i) * a.hessian.at(j, j)).sqrt();
            assert_close(a.hessian.at(i, j), b.hessian.at(i, j), scale, SAME_FORMULA);
        }
    }
}

macro_rules! every_sensor {
    ($($sensor:ident),* $(,)?) => {
        #[test]
        fn jacobians_are_derivatives() {
            $(jacobian::<$sensor<f64>, $sensor<First>>();)*
        }

        #[test]
        fn structure_changes_nothing() {
            $(
                structure::<$sensor<f64>>(Squared);
                for kind in [RobustKind::Huber, RobustKind::Cauchy, RobustKind::Tukey, RobustKind::GemanMcClure] {
                    structure::<$sensor<f64>>(Robust { kind, scale: 3.0 });
                }
            )*
        }

        #[test]
        fn names_are_those_of_the_list() {
            $(assert_eq!(<$sensor<f64> as SensorModel<f64>>::NAME, stringify!($sensor));)*
        }
    };
}

losnav_core::sensors! { every_sensor }

#[test]
fn an_observer_on_a_landmark_is_an_error() {
    let landmarks = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
    let sensor = LineOfSight { landmarks: &landmarks, los: &[[0.0; 3]; 2], weights: &[Weight::Scalar(1.0)] };
    let x = Kinematics { position: landmarks[1], ..observer() };
    let mut rows = [Row::zero(); 6];
    assert_eq!(sensor.linearize(&x, &mut Recorder::new(&mut rows)), Err(ModelError::ZeroRange { index: 1 }));
}

#[test]
fn a_landmark_beyond_numbers_is_an_error() {
    let landmarks = [[1.0, 0.0, 0.0], [1e200, 0.0, 0.0]];
    let sensor = LineOfSight { landmarks: &landmarks, los: &[[0.0; 3]; 2], weights: &[Weight::Scalar(1.0)] };
    let mut rows = [Row::zero(); 6];
    let outcome = sensor.linearize(&observer(), &mut Recorder::new(&mut rows));
    assert_eq!(outcome, Err(ModelError::RangeOverflow { index: 1 }));
}

#[test]
fn a_recorder_without_room_counts_and_drops() {
    let landmarks = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
    let sensor = LineOfSight { landmarks: &landmarks, los: &[[0.0; 3]; 2], weights: &[Weight::Scalar(1.0)] };
    let mut rows = [Row::zero(); 4];
    let mut recorder = Recorder::new(&mut rows);
    sensor.linearize(&observer(), &mut recorder).unwrap();
    assert_eq!(recorder.offered(), 6);
    assert_ne!(rows[3], Row::zero());
}

#[test]
fn a_target_straight_ahead_has_no_bearing() {
    // Attitude of the identity: body axes are those of the reference.
    let dcm = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let outcome = |position: [f64; 3]| {
        let x = Kinematics { position, velocity: [1.0, 0.0, 0.0], dcm };
        let (target, mut rows) = ([1.0, 2.0, 3.0], [Row::zero(); 3]);
        let camera = RangeBearing { measurement: [0.0; 3], sigma_range: 1.0, sigma_angle: 1.0, target };
        let mut recorder = Recorder::new(&mut rows);
        [
            camera.linearize(&x, &mut recorder),
            Range { measurement: [0.0], sigma: 1.0, target }.linearize(&x, &mut recorder),
            RangeRate { measurement: [0.0], sigma: 1.0, target }.linearize(&x, &mut recorder),
        ]
    };
    assert_eq!(outcome([1.0, 2.0, 3.0]), [Err(ModelError::AtTarget); 3]);
    assert_eq!(outcome([1e200, 2.0, 1.0]), [Err(ModelError::TargetTooFar); 3]);
    assert_eq!(outcome([1.0, 2.0, -50.0]), [Err(ModelError::PolarAxis), Ok(()), Ok(())]);
}

#[test]
fn bearings_are_compared_the_short_way_round() {
    let dcm = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    // The target is behind: azimuth −3.0 rad.
    let x = Kinematics { position: [10.0, 10.0 * 0.142_546_543_074_277_8, 0.0], velocity: [0.0; 3], dcm };
    let sensor =
        RangeBearing { measurement: [10.0, 3.1, 0.2], sigma_range: 1.0, sigma_angle: 1.0, target: [0.0; 3] };
    let mut rows = [Row::zero(); 3];
    sensor.linearize(&x, &mut Recorder::new(&mut rows)).unwrap();
    assert_close(rows[1].innovation, 6.1 - 2.0 * core::f64::consts::PI, 1.0, SAME_FORMULA);
    assert_close(rows[2].innovation, 0.2, 1.0, SAME_FORMULA);
}

#[test]
fn the_innovation_of_a_landmark_stands_in_its_place() {
    let seen = |innovation: [f64; 2]| Linearization {
        innovation,
        d_position: [[0.0; 3]; 2],
        d_velocity: None,
        d_attitude: None,
        sqrt_information: RootWeight::Diagonal([1.0; 2]),
    };
    let (mut out, mut rows) = ([0.0; 8], [Row::zero(); 4]);
    let (mut heard, mut recorder) = (Innovations::new(&mut out), Recorder::new(&mut rows));
    let mut both = Both(&mut heard, &mut recorder);
    both.add_landmark(0, &seen([1.0, 2.0]));
    both.add_landmark(2, &seen([3.0, 4.0]));
    // A second pass finds no room.
    both.add_landmark(0, &seen([5.0, 6.0]));
    assert_eq!(recorder.offered(), 6);
    assert_eq!([out[0], out[1], out[4], out[5]], [1.0, 2.0, 3.0, 4.0]);
    assert!([out[2], out[3], out[6], out[7]].iter().all(|v| v.is_nan()));
}

/// Looks along +z of the reference frame: camera, body and reference axes are the same.
fn camera<'a>(
    landmarks: &'a [[f64; 3]],
    pixels: &'a [[f64; 2]],
    map: &'a [MapError<f64>],
) -> LandmarkCamera<'a, f64> {
    let optics = Optics {
        focal_length: [500.0; 2],
        principal_point: [0.0; 2],
        camera_from_body: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm: [0.0; 3],
    };
    LandmarkCamera { landmarks, pixels, sigmas: &[2.0], map, optics }
}

const AT_REST: Kinematics<f64> = Kinematics {
    position: [0.0; 3],
    velocity: [0.0; 3],
    dcm: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
};

#[test]
fn a_landmark_not_seen_hands_over_nothing() {
    let landmarks = [[1.0, 2.0, 10.0], [3.0, 0.0, -10.0], [0.0, 4.0, 20.0]];
    let pixels = [[51.0, 99.0], [f64::NAN; 2], [1.0, f64::NAN]];
    let (mut rows, mut out) = ([Row::zero(); 6], [0.0; 6]);
    let (mut recorder, mut heard) = (Recorder::new(&mut rows), Innovations::new(&mut out));
    let sensor = camera(&landmarks, &pixels, &[]);
    sensor.linearize(&AT_REST, &mut Both(&mut recorder, &mut heard)).unwrap();
    assert_eq!(recorder.offered(), 2);
    assert_eq!(out[..2], [1.0, -1.0]);
    assert!(out[2..].iter().all(|v| v.is_nan()));
}

#[test]
fn a_landmark_behind_the_camera_is_an_error_and_no_mirrored_pixel() {
    for depth in [-10.0, -1e-300, 0.0] {
        let landmarks = [[1.0, 2.0, 10.0], [1.0, 2.0, depth]];
        let sensor = camera(&landmarks, &[[0.0; 2]; 2], &[]);
        let mut rows = [Row::zero(); 4];
        let outcome = sensor.linearize(&AT_REST, &mut Recorder::new(&mut rows));
        assert_eq!(outcome, Err(ModelError::BehindCamera { index: 1 }));
    }
}

/// Whitening with the error of the map is whitening with `σ² I + H_L Σ H_Lᵀ`, however that is said.
#[test]
fn errors_of_the_map_are_noise_of_the_pixels() {
    let covariance = [[0.04, 0.01, 0.0], [0.01, 0.09, -0.02], [0.0, -0.02, 0.05]];
    let isotropic = [[0.04, 0.0, 0.0], [0.0, 0.04, 0.0], [0.0, 0.0, 0.04]];
    let landmark = [[1.0, 2.0, 10.0]];
    // ∂[u v]/∂L by hand: f/z [1 0 −x/z; 0 1 −y/z].
    let slope = [[50.0, 0.0, -5.0], [0.0, 50.0, -10.0]];
    for (map, sigma) in [
        (MapError::Scalar(0.04), isotropic),
        (MapError::Full(isotropic), isotropic),
        (MapError::Full(covariance), covariance),
    ] {
        let map = [map];
        let rows = camera(&landmark, &[[0.0; 2]], &map).linearize_landmark(&AT_REST, 0, [0.0; 2]).unwrap();
        let RootWeight::Full(s) = rows.sqrt_information else { panic!("expected correlated pixels") };
        for i in 0..2 {
            for j in 0..2 {
                // S R Sᵀ = I.
                let mut sum = 0.0;
                for a in 0..2 {
                    for b in 0..2 {
                        let mut noise = if a == b { 4.0 } else { 0.0 };
                        for k in 0..3 {
                            for l in 0..3 {
                                noise += slope[a][k] * sigma[k][l] * slope[b][l];
                            }
                        }
                        sum += s[i][a] * noise * s[j][b];
                    }
                }
                assert_close(sum, f64::from(u8::from(i == j)), 1.0, SAME_FORMULA);
            }
        }
    }
}

#[test]
fn a_beam_that_misses_the_ground_is_an_error() {
    let outcome = |position: [f64; 3], boresight: Option<[f64; 3]>| {
        let x = Kinematics { position, ..AT_REST };
        let mut rows = [Row::zero()];
        let sensor = Altimeter { measurement: [7.0], sigma: 1.0, boresight };
        sensor.linearize(&x, &mut Recorder::new(&mut rows)).map(|()| rows[0].innovation)
    };
    assert_eq!(outcome([1.0, 2.0, 5.0], None), Ok(2.0));
    assert_eq!(outcome([1.0, 2.0, -5.0], None), Ok(12.0));
    assert_eq!(outcome([1.0, 2.0, 5.0], Some([0.0, 0.0, -1.0])), Ok(2.0));
    assert_eq!(outcome([1.0, 2.0, 3.2], Some([0.6, 0.0, -0.8])), Ok(3.0));
    let misses = Err(ModelError::BeamMissesGround);
    assert_eq!(outcome([1.0, 2.0, 5.0], Some([0.6, 0.0, 0.8])), misses);
    assert_eq!(outcome([1.0, 2.0, 5.0], Some([1.0, 0.0, 0.0])), misses);
    assert_eq!(outcome([1.0, 2.0, -5.0], Some([0.0, 0.0, -1.0])), misses);
}
