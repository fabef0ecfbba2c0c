//! P3P over random triples: the true pose is found, nothing false, nothing twice.
mod scenes;
use losnav_core::estimators::minimal::{Pose, p3p};
use nalgebra::Vector3;
use scenes::Rng;

struct Tally {
    triples: usize,
    missed: usize,
    worst_los: f64,
    twice: usize,
    solutions: usize,
    errors: Vec<f64>,
}

fn run(seed: u64, triples: usize, mut make: impl FnMut(&mut Rng) -> ([Vector3<f64>; 3], Pose)) -> Tally {
    let mut rng = Rng(seed);
    let mut t = Tally { triples, missed: 0, worst_los: 0.0, twice: 0, solutions: 0, errors: vec![] };
    for _ in 0..triples {
        let (x, truth) = make(&mut rng);
        let los = x.map(|l| truth.los(&l));
        let poses = p3p(&x, &los);
        let depth = (x[0] - truth.position).norm();
        let mut best = f64::INFINITY;
        for (k, pose) in poses.iter().enumerate() {
            assert!(pose.position.iter().chain(pose.dcm.iter()).all(|v| v.is_finite()));
            assert!((pose.dcm.determinant() - 1.0).abs() < 1e-12);
            for (l, b) in x.iter().zip(&los) {
                t.worst_los = t.worst_los.max((pose.los(l) - b).norm());
            }
            let error = ((pose.position - truth.position).norm() / depth).max((pose.dcm - truth.dcm).norm());
            best = best.min(error);
            for other in poses.as_slice().iter().skip(k + 1) {
                if (pose.position - other.position).norm() < 1e-9 * depth {
                    t.twice += 1;
                }
            }
        }
        t.solutions += poses.len();
        t.errors.push(best);
        if best.is_nan() || best >= 1e-6 {
            t.missed += 1;
        }
    }
    t.errors.sort_by(f64::total_cmp);
    t
}

fn report(name: &str, t: &Tally) {
    println!(
        "{name}: missed {} of {}, solutions {:.3}, error median {:.1e} 99.9% {:.1e} 99.99% {:.1e} max {:.1e}, worst LOS {:.1e}, twice {}",
        t.missed,
        t.triples,
        t.solutions as f64 / t.triples as f64,
        t.errors[t.triples / 2],
        t.errors[t.triples * 999 / 1000],
        t.errors[t.triples * 9999 / 10000],
        t.errors[t.triples - 1],
        t.worst_los,
        t.twice
    );
    assert!(t.missed * 10_000 <= t.triples, "{name}");
    assert!(t.worst_los < 1e-7, "{name}");
    assert_eq!(t.twice, 0, "{name}");
}

#[test]
#[cfg_attr(debug_assertions, ignore = "long: cargo test --release")]
fn whole_sphere() {
    // Observer among the landmarks: lines of sight in all directions.
    let t = run(1, 100_000, |rng| {
        let x = [rng.vector(), rng.vector(), rng.vector()];
        (x, Pose { position: rng.vector(), dcm: rng.rotation() })
    });
    report("whole sphere", &t);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "long: cargo test --release")]
fn narrow_cones() {
    let t = run(2, 100_000, |rng| {
        let x = [rng.vector(), rng.vector(), rng.vector()];
        let depth = 50f64.powf(rng.uniform());
        (x, Pose { position: rng.vector().normalize() * depth, dcm: rng.rotation() })
    });
    report("depth 1 to 50", &t);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "long: cargo test --release")]
fn far_origin_and_units() {
    let t = run(3, 20_000, |rng| {
        let scale = 10f64.powf(rng.between(-6.0, 6.0));
        let x = [rng.vector() * scale, rng.vector() * scale, rng.vector() * scale];
        let depth = 50f64.powf(rng.uniform()) * scale;
        (x, Pose { position: rng.vector().normalize() * depth, dcm: rng.rotation() })
    });
    report("any unit", &t);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "long: cargo test --release")]
fn speed() {
    let mut rng = Rng(4);
    let problems: Vec<_> = (0..1000)
        .map(|_| {
            let x = [rng.vector(), rng.vector(), rng.vector()];
            let truth =
                Pose { position: rng.vector().normalize() * rng.between(2.0, 20.0), dcm: rng.rotation() };
            (x, x.map(|l| truth.los(&l)))
        })
        .collect();
    let mut best = f64::INFINITY;
    for _ in 0..20 {
        let start = std::time::Instant::now();
        let mut n = 0;
        for (x, b) in &problems {
            n += std::hint::black_box(p3p(std::hint::black_box(x), b)).len();
        }
        assert!(n >= 1000);
        best = best.min(start.elapsed().as_secs_f64() / 1000.0);
    }
    println!("p3p {:.0} ns", best * 1e9);
}
