use losnav_core::estimators::{least_squares::*, loss::Squared, pose::LosObjective};
use losnav_core::models::{
    kinematics::Kinematics, linearization::Weight, sensors::LineOfSight, sensors::line_of_sight::predict,
};
use std::time::Instant;
fn main() {
    let n: usize = std::env::args().nth(1).map(|s| s.parse().unwrap()).unwrap_or(4);
    let mut landmarks = vec![[32.5, 0., 0.], [0., 30., 0.], [-31.5, 0., 0.], [0., -30.5, 0.]];
    for i in 4..n {
        let a = i as f64;
        landmarks.push([30.0 * (a * 1.7).sin(), 30.0 * (a * 2.3).cos(), 2.0 * (a * 0.7).sin()]);
    }
    let landmarks = &landmarks[..n];
    let truth = PoseState::from_mrp([-50., 50., 500.], [0.09, -0.04, 0.03]);
    let k = Kinematics::at_rest(truth.position, truth.attitude);
    let los: Vec<[f64; 3]> = landmarks
        .iter()
        .enumerate()
        .map(|(i, l)| {
            let h = predict(&k, *l).0;
            let e = 3e-5 * ((i * i * 7 + 3) as f64).sin();
            let v = [h[0] + e, h[1] + 3e-5 * ((i * i * 3 + 1) as f64).cos(), h[2]];
            let m = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
            [v[0] / m, v[1] / m, v[2] / m]
        })
        .collect();
    let weights = [Weight::Scalar(1.0 / (2e-5f64 * 2e-5))];
    let obj = LosObjective { sensor: LineOfSight { landmarks, los: &los, weights: &weights }, loss: Squared };
    let guess = PoseState::from_mrp([-80., 80., 530.], [0.11, -0.02, 0.04]);
    for method in [Method::LevenbergMarquardt, Method::GaussNewton] {
        let o = Options {
            method,
            parametrization: Parametrization::Rotation,
            damping: 1e-3,
            max_iterations: 50,
            cost_tolerance: 1e-12,
            step_tolerance: 1e-12,
        };
        let r = solve(&obj, &guess, &o);
        println!(
            "{:?} cost {} it {} term {:?} conv {}",
            r.pose,
            r.cost,
            r.iterations,
            Termination::from_code(r.termination),
            r.converged
        );
        let mut best = f64::MAX;
        for _ in 0..20 {
            let t = Instant::now();
            let reps = 20000;
            for _ in 0..reps {
                std::hint::black_box(solve(&obj, std::hint::black_box(&guess), &o));
            }
            best = best.min(t.elapsed().as_secs_f64() / reps as f64);
        }
        println!("{:.1} ns", best * 1e9);
    }
}
