//! Attitude from directions: five solvers and one minimum, at every angle, in both precisions, and with nonsense.
mod scenes;
use losnav_core::estimators::wahba::careful::{self, Problem, Solution};
use losnav_core::estimators::wahba::polish::{polish, solve};
use losnav_core::estimators::wahba::robust::{self, RobustOptions};
use losnav_core::estimators::wahba::{Directions, Method, Vectors, full, quest};
use losnav_core::math::real::Real;
use losnav_core::math::rotation::{exp, rotation_error};
use losnav_core::math::so3::{Quaternion, dcm_from_quaternion, quaternion_product};
use losnav_core::math::sym3::Sym3;
use losnav_core::math::vec3::{Vec3, dot, rotate, scale};
use scenes::Rng;

const METHODS: [Method; 5] = [Method::Quest, Method::QMethod, Method::Svd, Method::Foam, Method::Esoq2];
/// Noise-free directions over the sphere: a chain of some dozen roundings.
const EXACT_RAD: f64 = 1e-14;

fn unit(rng: &mut Rng) -> Vec3<f64> {
    rng.vector().normalize().into()
}

/// Half turns about the axes, small turns, and anything.
fn attitudes(rng: &mut Rng) -> Vec<Quaternion<f64>> {
    let half = core::f64::consts::PI;
    let mut all = vec![[0.0, 0.0, 0.0, 1.0]];
    for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.6, -0.8, 0.0], unit(rng)] {
        for angle in [1e-9, 1e-3, 2.0, half - 1e-9, half, half + 1e-9] {
            all.push(exp(scale(angle, axis)));
        }
    }
    all
}

fn turned(reference: &[Vec3<f64>], q: Quaternion<f64>) -> Vec<Vec3<f64>> {
    let dcm = dcm_from_quaternion(q);
    reference.iter().map(|r| rotate(&dcm, *r)).collect()
}

fn angle(a: Quaternion<f64>, b: Quaternion<f64>) -> f64 {
    let d = rotation_error(&dcm_from_quaternion(a), &dcm_from_quaternion(b));
    dot(d, d).sqrt()
}

fn problem<'a>(body: &'a [Vec3<f64>], reference: &'a [Vec3<f64>], weights: &'a [f64]) -> Problem<'a> {
    Problem { body, reference, weights, method: Method::Quest, polish: true }
}

#[test]
fn every_solver_finds_every_attitude() {
    let mut rng = Rng(1);
    for n in [2, 3, 8] {
        let mut reference: Vec<_> = (0..n).map(|_| unit(&mut rng)).collect();
        reference[0] = [1.0, 0.0, 0.0];
        reference[1] = [0.0, 1.0, 0.0];
        for q in attitudes(&mut rng) {
            let body = turned(&reference, q);
            let directions = Vectors { body: &body, reference: &reference, weights: &[1.0] };
            let profile = directions.profile();
            for method in METHODS {
                let start = method.start(&profile);
                assert!(angle(q, start) < 10.0 * EXACT_RAD, "{method:?} {q:?} {:e}", angle(q, start));
                let end = polish(&directions, &profile, start);
                assert!(end.sound);
                assert!(angle(q, end.quaternion) < EXACT_RAD, "{method:?} {q:?}");
                assert!(end.loss < 1e-28);
            }
        }
    }
}

#[test]
fn careful_and_fast_agree_and_the_careful_one_goes_on_where_the_other_stops() {
    let mut rng = Rng(2);
    for width in [1.0, 1e-2, 1e-4, 1e-6] {
        let (a, b) = (unit(&mut rng), unit(&mut rng));
        let reference: Vec<Vec3<f64>> = [0.0, 1.0]
            .map(|k| {
                let v = [a[0] + k * width * b[0], a[1] + k * width * b[1], a[2] + k * width * b[2]];
                scale(1.0 / dot(v, v).sqrt(), v)
            })
            .to_vec();
        for q in attitudes(&mut rng) {
            let body = turned(&reference, q);
            let found = careful::solve(&problem(&body, &reference, &[1.0]));
            assert!(found.converged && found.rank == 3, "{width} {found:?}");
            // ε/θ with room for the angle between the two random directions.
            assert!(angle(q, found.quaternion) < 1e-14 / width, "{width} {:e}", angle(q, found.quaternion));
            let fast = solve(&Vectors { body: &body, reference: &reference, weights: &[1.0] });
            assert!(!fast.sound || angle(fast.quaternion, found.quaternion) < 1e-14 / width);
            assert!(fast.sound || width < 1e-2);
        }
    }
}

#[test]
fn near_the_limit_of_rank_it_is_either_found_or_free() {
    let mut rng = Rng(6);
    let (mut found_all, mut free_all) = (0, 0);
    for k in 0..2000 {
        let width = 1e-8 * 1.003_f64.powi(k);
        let (a, b) = (unit(&mut rng), unit(&mut rng));
        let along = dot(a, b);
        let side = [b[0] - along * a[0], b[1] - along * a[1], b[2] - along * a[2]];
        let side = scale(width / dot(side, side).sqrt(), side);
        let near = [a[0] + side[0], a[1] + side[1], a[2] + side[2]];
        let reference = [a, scale(1.0 / dot(near, near).sqrt(), near)];
        let q = exp([2.0 * rng.between(-1.0, 1.0), rng.between(-1.0, 1.0), rng.between(-1.0, 1.0)]);
        let body = turned(&reference, q);
        for method in METHODS {
            let found = careful::solve(&Problem { method, ..problem(&body, &reference, &[1.0]) });
            assert_eq!(found.converged, found.rank == 3, "{width:e} {found:?}");
            // Two directions: the Hessian's least eigenvalue over the sum of weights is θ²/4.
            if !(1.9e-7..2.1e-7).contains(&width) {
                assert_eq!(found.rank == 3, width > 2e-7, "{width:e}");
            }
            if found.converged {
                found_all += 1;
                assert!(angle(q, found.quaternion) < 1e-15 / width, "{width:e}");
            } else {
                free_all += 1;
            }
        }
    }
    assert!(found_all > 1000 && free_all > 1000);
}

#[test]
fn single_precision_is_as_good_as_its_digits() {
    let mut rng = Rng(3);
    for q in attitudes(&mut rng) {
        let reference: Vec<_> = (0..8).map(|_| unit(&mut rng)).collect();
        let short = |v: &Vec<Vec3<f64>>| v.iter().map(|x| x.map(|c| c as f32)).collect::<Vec<_>>();
        let (body, reference) = (short(&turned(&reference, q)), short(&reference));
        let directions = Vectors { body: &body, reference: &reference, weights: &[1.0] };
        let start = quest::quaternion(&directions.profile());
        let end = solve(&directions);
        assert!(end.sound);
        for found in [start, end.quaternion] {
            let found = found.map(f64::from);
            assert!(angle(q, found) < 20.0 * <f32 as Real>::EPSILON, "{q:?} {:e}", angle(q, found));
        }
    }
}

#[test]
fn a_free_turn_is_named_and_none_is_invented() {
    let mut rng = Rng(4);
    for n in 1..5 {
        let r = unit(&mut rng);
        let reference: Vec<_> = (0..n).map(|k| if k % 2 == 0 { r } else { scale(-1.0, r) }).collect();
        for q in attitudes(&mut rng) {
            let body = turned(&reference, q);
            for method in METHODS {
                let found = careful::solve(&Problem { method, ..problem(&body, &reference, &[4.0]) });
                assert!(!found.converged && found.rank == 2, "{found:?}");
                assert!(found.covariance().is_none());
                assert!(dot(found.axis, body[0]) > 1.0 - 1e-14);
                assert!(found.loss < 1e-28);
                // Nearest to the identity: the scalar part is that of half the angle between the directions.
                let half = (0.5 * (1.0 + dot(body[0], r))).max(0.0).sqrt();
                assert!((found.quaternion[3].abs() - half).abs() < 1e-7, "{found:?}");
            }
        }
    }
}

#[test]
fn nonsense_is_answered_without_a_panic_and_without_a_claim() {
    let zero = [0.0; 3];
    let nan = [f64::NAN, 0.0, 1.0];
    let (x, y, far) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e300, 0.0, 0.0]);
    let sets: [&[Vec3<f64>]; 8] =
        [&[], &[zero], &[zero, zero], &[nan, x], &[x, nan, y], &[far, far], &[x, zero], &[zero, zero, zero]];
    let weights: [&[f64]; 6] = [&[], &[0.0], &[f64::NAN], &[f64::INFINITY], &[1e308, 1e308], &[0.0, 1.0]];
    for body in sets {
        for reference in sets {
            for weights in weights {
                for method in METHODS {
                    for polish in [true, false] {
                        let posed = Problem { body, reference, weights, method, polish };
                        let found = careful::solve(&posed);
                        assert!(!found.converged, "{posed:?} {found:?}");
                    }
                }
                let mut kept = [0.0; 3];
                let options = RobustOptions { gate: 3.7, max_outlier_ratio: 0.5, confidence: 0.999, seed: 1 };
                let found = robust::solve(&robust::Problem { body, reference, weights }, &options, &mut kept);
                assert!(found.is_none_or(|found| !found.solution.converged));
                let estimate = solve(&Vectors { body, reference, weights });
                assert!(!estimate.sound);
            }
        }
    }
}

#[test]
fn a_covariance_of_equal_axes_changes_nothing() {
    let mut rng = Rng(5);
    let reference: Vec<_> = (0..6).map(|_| unit(&mut rng)).collect();
    let q = exp([0.3, -1.0, 0.5]);
    let body: Vec<Vec3<f64>> = turned(&reference, q)
        .iter()
        .map(|b| {
            let v: Vec3<f64> = [0, 1, 2].map(|k| b[k] + 1e-3 * rng.between(-1.0, 1.0));
            scale(1.0 / dot(v, v).sqrt(), v)
        })
        .collect();
    let sigma = 1e-3;
    let root = [0, 1, 2].map(|i| [0, 1, 2].map(|j| if i == j { 1.0 / sigma } else { 0.0 }));
    let posed = problem(&body, &reference, &[1e6]);
    let (one, other) = (careful::solve(&posed), full::solve(&posed, &[root; 6]));
    assert!(other.converged);
    assert!(angle(one.quaternion, other.quaternion) < EXACT_RAD);
    assert!((one.loss - other.loss).abs() < 1e-12 * one.loss);
    for (a, b) in one.covariance().unwrap().0.iter().zip(other.covariance().unwrap().0) {
        assert!((a - b).abs() < 1e-12 * sigma * sigma);
    }
}

#[test]
fn the_rank_of_an_information_is_its_own() {
    let q = quaternion_product(exp([0.1, 0.2, 0.3]), exp([1.0, 0.0, 0.0]));
    let known = |diagonal: [f64; 3]| {
        Solution::known(q, Sym3([diagonal[0], 0.0, 0.0, diagonal[1], 0.0, diagonal[2]]), 1.0)
    };
    assert!(known([1.0, 2.0, 3.0]).converged);
    let free = known([1.0, 0.0, 3.0]);
    assert!(!free.converged && free.rank == 2 && free.axis[1].abs() == 1.0);
    assert_eq!(known([0.0, 0.0, 3.0]).rank, 1);
    assert_eq!(known([0.0; 3]).rank, 0);
    assert!(!known([f64::NAN; 3]).converged);
    let p = known([1.0, 2.0, 4.0]).covariance().unwrap();
    for (got, want) in p.0.iter().zip([1.0, 0.0, 0.0, 0.5, 0.0, 0.25]) {
        assert!((got - want).abs() < 1e-15);
    }
}
