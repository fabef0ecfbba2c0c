//! How well do these directions determine the pose, and what is weak?
//!
//! 1. Whitened rows of all directions into one square root `R` by Givens rotations.
//! 2. Position columns times the mean range, so that both halves are angles; singular values and vectors of that.
//! 3. Rank by [`RANK_TOLERANCE`](crate::math::triangular6::RANK_TOLERANCE); the weakest direction as a twist; the
//!    geometry by name; the distance from the danger cylinder.
use super::danger_cylinder;
use super::diagnosis::{Diagnosis, Twist, diagnose};
use super::information::{RootInformation, collect};
use crate::math::real::Real;
use crate::math::triangular6::{Singular6, Triangular6};
use crate::math::vec3::{Vec3, dot, rotate_transposed, scale, sub};
use crate::models::kinematics::Kinematics;
use crate::models::sensors::LineOfSight;

/// What the geometry of a pose problem is worth.
#[derive(Clone, Copy, Debug)]
pub struct Geometry {
    /// Components of the pose that can be known.
    pub rank: usize,
    /// Weakest motion: of the camera in m, of the body in rad, one standard deviation long if the weights are real
    /// (unit length, position over mean range, where the rank is lost).
    pub weakest: Twist,
    /// Its name.
    pub diagnosis: Diagnosis,
    /// Distance from the danger cylinder, m.
    pub danger_cylinder: Option<f64>,
}

/// Mean range, m: the unit of position in the scaled Jacobian.
#[must_use]
pub fn mean_range(landmarks: &[Vec3<f64>], position: Vec3<f64>) -> f64 {
    let total: f64 = landmarks
        .iter()
        .map(|l| {
            let d = sub(*l, position);
            Real::sqrt(dot(d, d))
        })
        .sum();
    total / landmarks.len() as f64
}

/// Singular values and vectors of the scaled, whitened Jacobian, columns `[p/mean range, α]`, position in reference
/// axes, attitude in body axes.
#[must_use]
pub fn singular(sensor: &LineOfSight<'_, f64>, x: &Kinematics<f64>) -> Singular6 {
    let mut sink = RootInformation(Triangular6::zero());
    collect(sensor, x, &mut sink);
    let range = mean_range(sensor.landmarks, x.position);
    sink.0.scaled(&[range, range, range, 1.0, 1.0, 1.0]).singular()
}

/// Rank, weakest motion, name and danger of a geometry with these singular values.
#[must_use]
pub fn geometry(landmarks: &[Vec3<f64>], x: &Kinematics<f64>, singular: &Singular6) -> Geometry {
    let rank = singular.rank();
    let [px, py, pz, ax, ay, az] = singular.vectors[5];
    let deviation = if rank < 6 { 1.0 } else { 1.0 / singular.values[5] };
    let range = mean_range(landmarks, x.position);
    let weakest = Twist {
        rotation: scale(deviation, rotate_transposed(&x.dcm, [ax, ay, az])),
        velocity: scale(deviation * range, [px, py, pz]),
    };
    Geometry {
        rank,
        weakest,
        diagnosis: diagnose(landmarks, x.position, rank, &weakest),
        danger_cylinder: danger_cylinder::distance(landmarks, x.position),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::so3::quaternion_from_mrp;
    use crate::math::vec3::{add, cross};
    use crate::models::linearization::Weight;
    use crate::models::sensors::line_of_sight::predict;

    const MRP: Vec3<f64> = [0.1, -0.2, 0.15];
    const RING: [Vec3<f64>; 4] = [[32.5, 0.0, 0.0], [0.0, 30.0, 0.0], [-31.5, 0.0, 0.0], [0.0, -30.5, 0.0]];

    fn look(landmarks: &[Vec3<f64>], position: Vec3<f64>) -> Geometry {
        let x = Kinematics::at_rest(position, quaternion_from_mrp(MRP));
        let mut los = [[0.0; 3]; 16];
        for (b, l) in los.iter_mut().zip(landmarks) {
            *b = predict(&x, *l).0;
        }
        let weights = [Weight::Scalar(1.0)];
        let sensor = LineOfSight { landmarks, los: &los[..landmarks.len()], weights: &weights };
        geometry(landmarks, &x, &singular(&sensor, &x))
    }

    /// Points of the curve `d(μ)` about the camera at `position`.
    fn curve<const N: usize>(position: Vec3<f64>, twist: &Twist, mu: [f64; N]) -> [Vec3<f64>; N] {
        let w = twist.rotation;
        let a = dot(twist.velocity, w);
        let b = sub(twist.velocity, scale(a, w));
        mu.map(|m| {
            let along = scale(a / m, w);
            let round = scale(1.0 / (1.0 + m * m), add(scale(m, b), cross(w, b)));
            add(position, add(along, round))
        })
    }

    #[test]
    fn ranks_by_number() {
        let above = [3.0, -2.0, 40.0];
        for (count, rank) in [(1, 2), (2, 4), (3, 6), (4, 6)] {
            assert_eq!(look(&RING[..count], above).rank, rank);
        }
    }

    #[test]
    fn a_camera_on_the_danger_cylinder_and_off_it() {
        let circle = danger_cylinder::Circle::through(RING[0], RING[1], RING[2]).unwrap();
        let c = circle.centre();
        let on = [c[0] + circle.radius * 0.6, c[1] + circle.radius * 0.8, 40.0];
        let found = look(&RING[..3], on);
        assert_eq!(found.rank, 5);
        assert!(matches!(found.diagnosis, Diagnosis::DangerCylinder { .. }), "{:?}", found.diagnosis);
        assert!(found.danger_cylinder.unwrap() < 1e-12);
        assert_eq!(look(&RING, on).rank, 6);
        let level = look(&RING[..3], [on[0], on[1], 0.0]);
        assert_eq!(level.rank, 5);
        assert!(matches!(level.diagnosis, Diagnosis::ConcyclicCamera { .. }));
    }

    #[test]
    fn curves_by_name() {
        let position = [1.0, 2.0, 3.0];
        let proper = Twist { rotation: [0.0, 0.6, 0.8], velocity: [5.0, 1.0, -2.0] };
        let mu = [-2.0, -1.1, -0.4, 0.3, 0.9, 1.7];
        let found = look(&curve(position, &proper, mu), position);
        assert_eq!(found.rank, 5);
        assert!(matches!(found.diagnosis, Diagnosis::TwistedCubic { .. }), "{:?}", found.diagnosis);
        let found = look(&curve(position, &proper, mu)[..4], position);
        assert!(matches!(found.diagnosis, Diagnosis::DangerCylindersMeet { .. }), "{:?}", found.diagnosis);
        assert!(found.danger_cylinder.unwrap() < 1e-10);
        // No pitch: a circle through the camera, and the line opposite.
        let flat = Twist { rotation: [0.0, 0.0, 1.0], velocity: [5.0, 1.0, 0.0] };
        let circle = curve(position, &flat, mu);
        let found = look(&circle, position);
        assert!(matches!(found.diagnosis, Diagnosis::ConcyclicCamera { .. }), "{:?}", found.diagnosis);
        let opposite = add(position, cross(flat.rotation, flat.velocity));
        let mut mixed = circle;
        for (k, s) in [(0, 1.0), (1, 2.5), (2, -4.0)] {
            mixed[k] = add(opposite, [0.0, 0.0, s]);
        }
        let found = look(&mixed, position);
        assert_eq!(found.rank, 5);
        assert!(
            matches!(found.diagnosis, Diagnosis::LineAndCircle { on_line: 3, .. }),
            "{:?}",
            found.diagnosis
        );
    }

    #[test]
    fn two_landmarks_fix_a_turn_and_a_shift_by_themselves() {
        let (position, x) = ([3.0, -2.0, 40.0], [1.0, 0.5, 0.0]);
        let two = [add(RING[0], x), RING[1]];
        let Diagnosis::TwoLandmarks { centreward, .. } = look(&two, position).diagnosis else { panic!() };
        // The centre is as far from the camera as from both landmarks.
        let circle = danger_cylinder::Circle::through(position, two[0], two[1]).unwrap();
        let toward = sub(circle.centre(), position);
        assert!((dot(toward, centreward) / circle.radius - 1.0).abs() < 1e-12);
    }

    #[test]
    fn lines() {
        let line = [-1.0, 0.3, 2.0, 5.0].map(|s| [4.0 + s, 2.0 * s, 1.0 + 0.5 * s]);
        let beside = look(&line, [3.0, -2.0, 40.0]);
        assert_eq!(beside.rank, 5);
        assert!(matches!(beside.diagnosis, Diagnosis::CollinearLandmarks { .. }));
        let upon = look(&line, [4.0 + 9.0, 18.0, 1.0 + 4.5]);
        assert_eq!(upon.rank, 4);
        assert!(matches!(upon.diagnosis, Diagnosis::CameraOnLandmarkLine { .. }));
        assert!(upon.danger_cylinder.is_none());
    }

    #[test]
    fn far_away_they_are_one_point() {
        // Straight above, the weakest singular value falls with the square of the angle; elsewhere with the angle.
        for position in [[0.0, 0.0, 5e5], [2e8, -1e8, 5e8]] {
            let found = look(&RING, position);
            assert!(found.rank < 6);
            assert!(matches!(found.diagnosis, Diagnosis::DistantLandmarks { .. }));
        }
        assert_eq!(look(&RING, [2e5, -1e5, 5e5]).rank, 6);
    }

    #[test]
    fn the_weakest_motion_moves_no_direction() {
        let circle = danger_cylinder::Circle::through(RING[0], RING[1], RING[2]).unwrap();
        let c = circle.centre();
        let on = [c[0] + circle.radius * 0.6, c[1] + circle.radius * 0.8, 40.0];
        let twist = look(&RING[..3], on).weakest;
        for l in &RING[..3] {
            let d = sub(*l, on);
            let moved = cross(d, add(cross(twist.rotation, d), twist.velocity));
            assert!(dot(moved, moved).sqrt() < 1e-12 * dot(d, d));
        }
    }
}
