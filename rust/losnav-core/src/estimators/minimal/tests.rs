//! Degenerate and hostile input of the minimal solvers; the statistics are in `tests/p3p.rs` and `tests/candidates.rs`.
extern crate std;
use std::vec::Vec;

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::scatter::{Scatter, principal_axes};
use super::sqpnp::{half_turn, turn};
use super::{Pose, candidates, p3p};
use crate::estimators::least_squares::PoseState;

fn attitude() -> Matrix3<f64> {
    Rotation3::new(Vector3::new(0.4, -1.9, 0.7)).into_inner()
}

fn see(landmarks: &[[f64; 3]], pose: &Pose) -> Vec<[f64; 3]> {
    landmarks.iter().map(|l| pose.los(&Vector3::from(*l)).into()).collect()
}

fn found(landmarks: &[[f64; 3]], truth: &Pose, tolerance: f64) -> bool {
    let range = truth.position.norm();
    candidates(landmarks, &see(landmarks, truth), |_| 1.0).iter().any(|p| {
        (p.position - truth.position).norm() < tolerance * range && (p.dcm - truth.dcm).norm() < tolerance
    })
}

const RING: [[f64; 3]; 4] = [[32.5, 0.0, 0.0], [0.0, 30.0, 0.0], [-31.5, 0.0, 0.0], [0.0, -30.5, 0.0]];

#[test]
fn collinear_and_too_few_give_none() {
    let truth = Pose { position: Vector3::new(-50.0, 50.0, 500.0), dcm: attitude() };
    let line: Vec<[f64; 3]> =
        (0..6).map(|k| [1e6 + 0.3 * k as f64, 2.0 + 0.1 * k as f64, -0.7 * k as f64]).collect();
    assert!(candidates(&line, &see(&line, &truth), |_| 1.0).is_empty());
    let x = [Vector3::from(line[0]), Vector3::from(line[1]), Vector3::from(line[4])];
    assert!(p3p(&x, &x.map(|l| truth.los(&l))).is_empty());
    assert!(candidates(&RING[..2], &see(&RING[..2], &truth), |_| 1.0).is_empty());
    assert!(candidates(&[], &[], |_| 1.0).is_empty());
    let same = [[1.0, 2.0, 3.0]; 5];
    assert!(candidates(&same, &see(&same, &truth), |_| 1.0).is_empty());
    // All lines of sight parallel: the observer is infinitely far.
    let none = candidates(&RING, &[[0.0, 0.0, 1.0]; 4], |_| 1.0);
    assert!(none.iter().all(|p| p.position.iter().all(|v| v.is_finite())));
}

#[test]
fn not_finite_gives_no_nan() {
    let truth = Pose { position: Vector3::new(-50.0, 50.0, 500.0), dcm: attitude() };
    for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, 1e-310] {
        for k in 0..24 {
            let mut landmarks = RING;
            let mut los = see(&RING, &truth);
            if k < 12 {
                landmarks[k / 3][k % 3] = bad;
            } else {
                los[(k - 12) / 3][k % 3] = bad;
            }
            for pose in &candidates(&landmarks, &los, |_| 1.0) {
                assert!(pose.position.iter().chain(pose.dcm.iter()).all(|v| v.is_finite()));
            }
        }
    }
}

#[test]
fn units_and_origin_do_not_matter() {
    for unit in [1e-6, 1e-3, 1.0, 1e3, 1e9] {
        for offset in [0.0, 1e6] {
            let landmarks = RING.map(|l| l.map(|v| unit * (v + offset)));
            let shift = Vector3::repeat(offset);
            let truth = Pose { position: (Vector3::new(-50.0, 50.0, 500.0) + shift) * unit, dcm: attitude() };
            // Rounding of the coordinates at the offset, 2e-10 m, against a scene of 60 m seen from 500 m.
            assert!(found(&landmarks, &truth, if offset == 0.0 { 1e-9 } else { 1e-6 }), "{unit} {offset}");
        }
    }
}

#[test]
fn mirrored_camera_is_never_returned() {
    let truth = Pose { position: Vector3::new(-50.0, 50.0, 500.0), dcm: attitude() };
    let los = see(&RING, &truth);
    let away: Vec<[f64; 3]> = los.iter().map(|b| b.map(|v| -v)).collect();
    for pose in &candidates(&RING, &away, |_| 1.0) {
        for (l, b) in RING.iter().zip(&away) {
            assert!(pose.los(&Vector3::from(*l)).dot(&Vector3::from(*b)) > 0.0);
        }
    }
    // The camera on the other side of the plane sees exactly the opposite lines of sight.
    let mirror = Pose {
        position: Vector3::new(-50.0, 50.0, -500.0),
        dcm: truth.dcm * Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0)),
    };
    assert!(candidates(&RING, &away, |_| 1.0).iter().any(|p| (p.position - mirror.position).norm() < 1e-6));
}

#[test]
fn danger_cylinder_gives_the_double_root() {
    // Unit circle, observer above it: the Jacobian of P3P is singular, the root double.
    let x = [0.1f64, 2.2, 4.0].map(|a| Vector3::new(a.cos(), a.sin(), 0.0));
    for height in [0.5, 2.0, 10.0] {
        let truth = Pose { position: Vector3::new(0.6, 0.8, height), dcm: attitude() };
        let los = x.map(|l| truth.los(&l));
        let near =
            p3p(&x, &los).iter().map(|p| (p.position - truth.position).norm()).fold(f64::INFINITY, f64::min);
        assert!(near < 1e-5 * height.max(1.0), "{height}: {near:e}");
    }
}

#[test]
fn two_exact_poses_of_four_landmarks_are_both_found() {
    // The second solution of a triple, and a fourth landmark where the rays of one more line of sight from both poses cross.
    let x = [Vector3::new(1.0, 0.0, 0.2), Vector3::new(-0.7, 0.9, -0.1), Vector3::new(-0.4, -1.1, 0.4)];
    let mut pairs = 0;
    for k in 0..40 {
        let a = Pose { position: Vector3::new((k as f64).sin(), (k as f64).cos(), 2.5), dcm: attitude() };
        let los = x.map(|l| a.los(&l));
        for b in p3p(&x, &los).iter().filter(|b| (b.position - a.position).norm() > 0.05) {
            for l4 in crossings(&a, b) {
                let landmarks = [x[0].into(), x[1].into(), x[2].into(), l4.into()];
                assert!(found(&landmarks, &a, 1e-6));
                let seen = see(&landmarks, &a);
                let list = candidates(&landmarks, &seen, |_| 1.0);
                assert!(list.iter().any(|p| (p.position - b.position).norm() < 1e-5), "{k}");
                pairs += 1;
            }
        }
    }
    assert!(pairs > 20, "{pairs}");
}

/// Points that `a` and `b` see along the same body direction, found by bisection over great circles.
fn crossings(a: &Pose, b: &Pose) -> Vec<Vector3<f64>> {
    let apart = b.position - a.position;
    let mut out = Vec::new();
    for turn in 0..6 {
        let frame = Rotation3::new(Vector3::new(0.5 * turn as f64, 0.3, 0.1)).into_inner();
        let direction = |s: f64| frame * Vector3::new(s.cos(), s.sin(), 0.0);
        let gap = |s: f64| {
            let d = direction(s);
            apart.dot(&a.dcm.tr_mul(&d).cross(&b.dcm.tr_mul(&d)))
        };
        for i in 0..64 {
            let (mut low, mut high) = (0.1 * i as f64, 0.1 * (i + 1) as f64);
            if gap(low) * gap(high) > 0.0 {
                continue;
            }
            for _ in 0..60 {
                let mid = 0.5 * (low + high);
                if gap(low) * gap(mid) <= 0.0 { high = mid } else { low = mid }
            }
            let (u, v) = (a.dcm.tr_mul(&direction(low)), b.dcm.tr_mul(&direction(low)));
            let n = u.cross(&v);
            let (s, t) =
                (apart.cross(&v).dot(&n) / n.norm_squared(), apart.cross(&u).dot(&n) / n.norm_squared());
            if s > 0.2 && t > 0.2 && s < 10.0 && n.norm() > 0.05 {
                out.push(a.position + u * s);
            }
        }
    }
    out
}

#[test]
fn weights_decide_the_order() {
    // One wrong line of sight with a negligible weight does not spoil the first candidate.
    let landmarks = [
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.3],
        [-1.0, 0.2, 0.0],
        [0.1, -1.0, 0.5],
        [0.3, 0.3, 1.0],
        [-0.6, -0.5, 0.8],
    ];
    let truth = Pose { position: Vector3::new(2.0, -3.0, 4.0), dcm: attitude() };
    let mut los = see(&landmarks, &truth);
    los[4] = [1.0, 0.0, 0.0];
    let list = candidates(&landmarks, &los, |i| if i == 4 { 1e-12 } else { 1.0 });
    let best = list.iter().next().expect("a candidate");
    assert!((best.position - truth.position).norm() < 1e-3, "{}", best.position);
}

#[test]
fn no_weight_means_not_there() {
    let truth = Pose { position: Vector3::new(-50.0, 50.0, 500.0), dcm: attitude() };
    let mut landmarks = std::vec![[f64::NAN; 3]];
    landmarks.extend(RING);
    let mut los = std::vec![[0.0, 0.0, 1.0]];
    los.extend(see(&RING, &truth));
    let list = candidates(&landmarks, &los, |i| if i == 0 { 0.0 } else { 1.0 });
    assert!(list.iter().any(|p| (p.position - truth.position).norm() < 1e-6));
    assert!(candidates(&landmarks, &los, |_| 0.0).is_empty());
}

#[test]
fn an_opposite_line_of_sight_leaves_the_others_a_pose() {
    let truth = Pose { position: Vector3::new(20.0, 50.0, 100.0), dcm: attitude() };
    let mut landmarks = RING.to_vec();
    landmarks.extend([[3.0, 4.0, 20.0], [-10.0, 8.0, -15.0]]);
    let mut los = see(&landmarks, &truth);
    los[5] = los[5].map(|v| -v);
    assert!(!candidates(&landmarks, &los, |_| 1.0).is_empty());
}

#[test]
fn principal_axes_diagonalise() {
    for k in 0..50 {
        let r = Rotation3::new(Vector3::new(0.1 * k as f64, 1.3, -0.7)).into_inner();
        let d = Vector3::new(1.0, 10f64.powi(-(k % 12)), if k % 3 == 0 { 0.0 } else { 1.0 });
        let m = r * Matrix3::from_diagonal(&d) * r.transpose();
        let v = principal_axes(&m);
        let diagonal = v.transpose() * m * v;
        assert!(
            (v.determinant() - 1.0).abs() < 1e-14 && (v.transpose() * v - Matrix3::identity()).norm() < 1e-14
        );
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            assert!(diagonal[(i, j)].abs() < 1e-15 * 4.0);
            assert!(diagonal[(i, i)] >= diagonal[(j, j)] - 1e-15);
        }
    }
    let flat = Scatter::new(RING.iter()).expect("finite");
    assert!(flat.flatness() < 1e-15 && !flat.is_collinear());
}

#[test]
fn a_pose_survives_the_quaternion() {
    for k in 0..200 {
        let angle = 0.0315 * k as f64;
        let axis = Vector3::new((k as f64).sin(), (2.0 * k as f64).cos(), (0.7 * k as f64).sin()).normalize();
        let pose = Pose { position: axis * 3.0, dcm: Rotation3::new(axis * angle).into_inner() };
        let state = PoseState::from(pose);
        assert!(state.attitude[3] >= 0.0);
        assert!((Pose::from(state).dcm - pose.dcm).norm() < 1e-15 * 8.0, "{k}");
    }
}

#[test]
fn rotations_are_rotations() {
    let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
    let h = half_turn(&axis);
    assert!((h - Rotation3::new(axis * core::f64::consts::PI).into_inner()).norm() < 1e-14);
    let step = Vector3::new(1e-3, -2e-3, 5e-4);
    // Cayley and exponential differ in the third order, |step|^3 / 12.
    assert!((turn(&step) - Rotation3::new(step).into_inner()).norm() < 1e-8);
    let t = turn(&(step * 1e3));
    assert!((t.transpose() * t - Matrix3::identity()).norm() < 1e-14);
}
