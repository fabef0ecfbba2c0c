use losnav_core::estimators::{least_squares::*, loss::Squared, pose::LosObjective};
use losnav_core::models::{
    kinematics::Kinematics, linearization::Weight, sensors::LineOfSight, sensors::line_of_sight::predict,
};
use std::time::Instant;
fn bench(name: &str, mut f: impl FnMut()) {
    let mut best = f64::MAX;
    for _ in 0..20 {
        let t = Instant::now();
        for _ in 0..20000 {
            f();
        }
        best = best.min(t.elapsed().as_secs_f64() / 20000.0);
    }
    println!("{name} {:.1} ns", best * 1e9);
}
fn main() {
    let landmarks = [[32.5, 0., 0.], [0., 30., 0.], [-31.5, 0., 0.], [0., -30.5, 0.]];
    let truth = PoseState::from_mrp([-50., 50., 500.], [0.09, -0.04, 0.03]);
    let k = Kinematics::at_rest(truth.position, truth.attitude);
    let los: Vec<[f64; 3]> = landmarks.iter().map(|l| predict(&k, *l).0).collect();
    let weights = [Weight::Scalar(1.0 / (2e-5f64 * 2e-5))];
    let obj = LosObjective {
        sensor: LineOfSight { landmarks: &landmarks, los: &los, weights: &weights },
        loss: Squared,
    };
    let guess = PoseState::from_mrp([-80., 80., 530.], [0.11, -0.02, 0.04]);
    bench("linearize", || {
        std::hint::black_box(obj.linearize(std::hint::black_box(&guess)));
    });
    bench("twice", || {
        std::hint::black_box(obj.linearize_twice(std::hint::black_box(&guess)));
    });
    let e = obj.linearize(&guess);
    bench("ldl", || {
        std::hint::black_box(std::hint::black_box(&e).hessian.ldl());
    });
    bench("ldl+solve", || {
        let e = std::hint::black_box(&e);
        std::hint::black_box(e.hessian.ldl().solve(&e.gradient));
    });
}
