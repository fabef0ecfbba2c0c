//! Times of the kernels in plain `f64`: `cargo bench -p losnav-core --bench kernels`.
use std::time::Duration;

use criterion::Criterion;

mod workload;

struct Timed<'a>(&'a mut Criterion);

impl workload::Measure for Timed<'_> {
    fn measure(&mut self, name: &str, call: &mut dyn FnMut()) {
        self.0.bench_function(name, |bencher| bencher.iter(&mut *call));
    }
}

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .sample_size(50)
        .configure_from_args();
    workload::visit(&mut Timed(&mut criterion));
    criterion.final_summary();
}
