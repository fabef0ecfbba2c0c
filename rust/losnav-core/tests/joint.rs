//! The covariance with constants beside the state, against linear algebra on the whole matrix.
use losnav_core::estimators::kalman::{
    Absorbed, BLOCK, Joint, Ray, SEEN, View, absorb, compress, gate, model_error, underweight,
};
use losnav_core::models::dynamics::DynamicsModel;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

const N: usize = 15;
/// A remembered pose and two landmarks.
const A: usize = 12;
const LANDMARKS: [usize; 3] = [6, usize::MAX, 9];

/// Numbers that look random and are the same everywhere.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

fn covariance(noise: &mut Noise) -> DMatrix<f64> {
    let root = DMatrix::from_fn(N + A, N + A, |_, _| noise.next());
    &root * root.transpose()
}

fn rays(noise: &mut Noise, count: usize, landmarks: bool) -> Vec<Ray<f64>> {
    (0..count)
        .map(|k| {
            let mut ray = Ray::zero();
            ray.innovation = 2.0 * noise.next();
            ray.row = core::array::from_fn(|j| if (3..6).contains(&j) { 0.0 } else { noise.next() });
            (ray.block, ray.landmark) = (k / 2, landmarks.then_some(k / 2));
            ray
        })
        .collect()
}

/// The row of the whole state that a view makes of a ray.
fn whole_row(ray: &Ray<f64>, view: &View<'_>) -> DVector<f64> {
    let mut row = DVector::zeros(N + A);
    for j in 0..SEEN {
        match view.pose {
            None => row[j] = ray.row[j],
            Some(pose) if j < 3 => row[N + pose + j] = ray.row[j],
            Some(pose) if j >= 6 => row[N + pose + j - 3] = ray.row[j],
            Some(_) => {}
        }
    }
    if let Some(&first) = ray.landmark.and_then(|index| view.landmarks.get(index))
        && first != usize::MAX
    {
        for j in 0..3 {
            row[N + first + j] = -ray.row[j];
        }
    }
    row
}

struct Split {
    state: [[f64; N]; N],
    cross: Vec<[f64; N]>,
    constants: Vec<f64>,
}

impl Split {
    fn new(p: &DMatrix<f64>) -> Self {
        Self {
            state: core::array::from_fn(|i| core::array::from_fn(|j| p[(i, j)])),
            cross: (0..A).map(|k| core::array::from_fn(|j| p[(N + k, j)])).collect(),
            constants: (0..A * A).map(|k| p[(N + k / A, N + k % A)]).collect(),
        }
    }

    fn joint(&mut self) -> Joint<'_, f64, N> {
        Joint { state: &mut self.state, cross: &mut self.cross, constants: &mut self.constants }
    }

    fn whole(&self) -> DMatrix<f64> {
        DMatrix::from_fn(N + A, N + A, |i, j| match (i < N, j < N) {
            (true, true) => self.state[i][j],
            (false, true) => self.cross[i - N][j],
            (true, false) => self.cross[j - N][i],
            (false, false) => self.constants[(i - N) * A + j - N],
        })
    }
}

fn views() -> [View<'static>; 4] {
    [
        View { pose: None, landmarks: &[] },
        View { pose: None, landmarks: &LANDMARKS },
        View { pose: Some(0), landmarks: &[] },
        View { pose: Some(0), landmarks: &LANDMARKS },
    ]
}

#[test]
fn rows_are_absorbed_as_one_measurement() {
    let mut noise = Noise(1);
    for view in views() {
        let p = covariance(&mut noise);
        let rays = rays(&mut noise, 6, true);
        let mut split = Split::new(&p);
        let (mut gain, mut constants) = ([0.0; A], [0.0; A]);
        let mut out = Absorbed { delta: [0.0; N], constants: &mut constants, nis: 0.0, dof: 0 };
        absorb(&mut split.joint(), &rays, &view, (&[0.0; N], &[0.0; A]), &mut gain, &mut out);
        let h = DMatrix::from_rows(&rays.iter().map(|r| whole_row(r, &view).transpose()).collect::<Vec<_>>());
        let y = DVector::from_iterator(rays.len(), rays.iter().map(|r| r.innovation));
        let s = &h * &p * h.transpose() + DMatrix::identity(6, 6);
        let inverse = s.try_inverse().unwrap();
        let k = &p * h.transpose() * &inverse;
        let expected = &p - &k * &h * &p;
        let delta = &k * &y;
        assert!((split.whole() - expected).amax() < 1e-12 * p.amax());
        for i in 0..N {
            assert!((out.delta[i] - delta[i]).abs() < 1e-12 * delta.amax());
        }
        for i in 0..A {
            assert!((out.constants[i] - delta[N + i]).abs() < 1e-12 * delta.amax());
        }
        let nis = (y.transpose() * inverse * &y)[0];
        assert!((out.nis - nis).abs() < 1e-12 * nis);
        assert_eq!(out.dof, 6);
        assert_eq!(split.whole(), split.whole().transpose());
    }
}

#[test]
fn compressed_rows_say_the_same() {
    let mut noise = Noise(2);
    let view = View { pose: None, landmarks: &[] };
    for count in [7, 8, 20] {
        let p = covariance(&mut noise);
        let mut rays = rays(&mut noise, count, false);
        if count == 8 {
            // Nobody sees the last angle: five rows are enough.
            rays.iter_mut().for_each(|ray| ray.row[8] = 0.0);
        }
        let take = |rays: &[Ray<f64>]| {
            let mut split = Split::new(&p);
            let (mut gain, mut constants) = ([0.0; A], [0.0; A]);
            let mut out = Absorbed { delta: [0.0; N], constants: &mut constants, nis: 0.0, dof: 0 };
            absorb(&mut split.joint(), rays, &view, (&[0.0; N], &[0.0; A]), &mut gain, &mut out);
            (out.delta, out.nis, split.whole())
        };
        let (delta, nis, whole) = take(&rays);
        let (few, unexplained) = compress(&mut rays);
        assert!(few <= 6);
        let (short, short_nis, short_whole) = take(&rays[..few]);
        assert!((whole - short_whole).amax() < 1e-11 * p.amax());
        assert!((nis - short_nis - unexplained).abs() < 1e-11 * nis);
        for i in 0..N {
            assert!((delta[i] - short[i]).abs() < 1e-11);
        }
    }
}

#[test]
fn blocks_are_judged_at_the_prior() {
    let mut noise = Noise(3);
    for view in views() {
        let p = covariance(&mut noise);
        let mut rays = rays(&mut noise, 6, true);
        let all = rays.clone();
        let mut split = Split::new(&p);
        let nis = |pair: &[Ray<f64>]| {
            let h = DMatrix::from_rows(&[
                whole_row(&pair[0], &view).transpose(),
                whole_row(&pair[1], &view).transpose(),
            ]);
            let y = DVector::from_vec(vec![pair[0].innovation, pair[1].innovation]);
            let s = &h * &p * h.transpose() + DMatrix::identity(2, 2);
            (y.transpose() * s.try_inverse().unwrap() * y)[0]
        };
        let every: Vec<f64> = all.chunks(2).map(nis).collect();
        let bound = every.iter().sum::<f64>() / 3.0;
        let mut rest = [0.0; A];
        let (kept, total) = gate(&split.joint(), &mut rays, &view, &[bound; BLOCK], &mut rest);
        assert!((total - every.iter().sum::<f64>()).abs() < 1e-12 * total);
        let good = all.chunks(2).zip(&every).filter(|(_, nis)| **nis <= bound).flat_map(|(pair, _)| pair);
        assert!(rays[..kept].iter().eq(good));
    }
}

#[test]
fn underweighted_blocks_err_by_more() {
    let mut noise = Noise(4);
    let view = View { pose: None, landmarks: &LANDMARKS };
    let p = covariance(&mut noise);
    let mut rays = rays(&mut noise, 6, true);
    let before = rays.clone();
    let mut split = Split::new(&p);
    underweight(&split.joint(), &mut rays, &view, 0.2, &mut [0.0; A]);
    for (old, new) in before.chunks(2).zip(rays.chunks(2)) {
        let h = DMatrix::from_rows(&[
            whole_row(&old[0], &view).transpose(),
            whole_row(&old[1], &view).transpose(),
        ]);
        let g = DMatrix::from_rows(&[
            whole_row(&new[0], &view).transpose(),
            whole_row(&new[1], &view).transpose(),
        ]);
        // The information of the block: Hᵀ (I + β H P Hᵀ)⁻¹ H.
        let s = DMatrix::identity(2, 2) + 0.2 * &h * &p * h.transpose();
        let expected = h.transpose() * s.try_inverse().unwrap() * &h;
        assert!((g.transpose() * g - &expected).amax() < 1e-12 * expected.amax().max(1.0));
    }
}

#[test]
fn the_error_of_the_model_is_the_least_squares_one() {
    let mut noise = Noise(5);
    let mut rays = rays(&mut noise, 9, false);
    rays.iter_mut().for_each(|ray| ray.row = core::array::from_fn(|_| noise.next()));
    let (dt, weight) = (1.3, 0.7);
    let (d, covariance) = model_error(&rays, dt, weight);
    let (mut normal, mut right) = (Matrix3::identity() * weight, Vector3::zeros());
    for ray in &rays {
        let s = Vector3::from(ray.position()) * (0.5 * dt * dt) + Vector3::from(ray.velocity()) * dt;
        normal += s * s.transpose();
        right += s * ray.innovation;
    }
    let inverse = normal.try_inverse().unwrap();
    assert!((Vector3::from(d) - inverse * right).amax() < 1e-13);
    assert!((covariance.0[0] - inverse[(0, 0)]).abs() < 1e-13);
    assert!((covariance.0[4] - inverse[(1, 2)]).abs() < 1e-13);
}

/// A step whose outcome is known.
struct Given;

impl DynamicsModel<f64, N> for Given {
    const NAME: &'static str = "given";
    type State = [f64; N];
    type Control = ();
    type Step = ();

    fn prepare(&self, _time: f64, _dt: f64) {}

    fn propagate(&self, _step: &(), state: &[f64; N], _control: ()) -> [f64; N] {
        *state
    }

    fn transition(&self, _step: &(), state: &[f64; N], _control: ()) -> ([f64; N], [[f64; N]; N]) {
        (*state, [[0.0; N]; N])
    }

    fn process_noise(&self, _step: &(), _state: &[f64; N]) -> [[f64; N]; N] {
        [[0.0; N]; N]
    }
}

/// A measurement of the past, taken late through the pose it remembers, leaves what it would have left in time.
#[test]
fn late_is_in_sequence() {
    let mut noise = Noise(6);
    let all = covariance(&mut noise);
    let prior: [[f64; N]; N] = core::array::from_fn(|i| core::array::from_fn(|j| all[(i, j)]));
    let phi: [[f64; N]; N] =
        core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.3 * noise.next() }));
    let root = DMatrix::from_fn(N, N, |_, _| noise.next());
    let q = &root * root.transpose();
    let q: [[f64; N]; N] = core::array::from_fn(|i| core::array::from_fn(|j| q[(i, j)]));
    let late = rays(&mut noise, 4, false);
    let between = rays(&mut noise, 2, false);
    let none: ([f64; N], [f64; 6]) = ([0.0; N], [0.0; 6]);

    // In sequence: the first measurement, a step, the second.
    let mut state = prior;
    let mut joint = Joint { state: &mut state, cross: &mut [], constants: &mut [] };
    let view = View { pose: None, landmarks: &[] };
    let mut first = Absorbed { delta: [0.0; N], constants: &mut [], nis: 0.0, dof: 0 };
    absorb(&mut joint, &late, &view, (&none.0, &[]), &mut [], &mut first);
    joint.propagate(&Given, &(), &phi, &q);
    let mut moved = [0.0; N];
    for i in 0..N {
        moved[i] = (0..N).map(|j| phi[i][j] * first.delta[j]).sum();
    }
    let mut second = Absorbed { delta: moved, constants: &mut [], nis: 0.0, dof: 0 };
    absorb(&mut joint, &between, &view, (&none.0, &[]), &mut [], &mut second);
    let expected = (second.delta, state);

    // Late: a remembered pose, the step, the second measurement, then the first at that pose.
    const POSE: [usize; 6] = [0, 1, 2, 6, 7, 8];
    let mut state = prior;
    let mut cross: Vec<[f64; N]> = POSE.iter().map(|k| prior[*k]).collect();
    let mut constants: Vec<f64> = POSE.iter().flat_map(|i| POSE.map(|j| prior[*i][j])).collect();
    let mut joint = Joint { state: &mut state, cross: &mut cross, constants: &mut constants };
    joint.propagate(&Given, &(), &phi, &q);
    let mut room = [0.0; 6];
    let mut past = [0.0; 6];
    let mut out = Absorbed { delta: [0.0; N], constants: &mut past, nis: 0.0, dof: 0 };
    absorb(&mut joint, &between, &view, (&none.0, &none.1), &mut room, &mut out);
    let there = View { pose: Some(0), landmarks: &[] };
    absorb(&mut joint, &late, &there, (&none.0, &none.1), &mut room, &mut out);
    for i in 0..N {
        assert!((out.delta[i] - expected.0[i]).abs() < 1e-12 * largest(&expected.0));
        for j in 0..N {
            assert!((state[i][j] - expected.1[i][j]).abs() < 1e-12 * all.amax());
        }
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}
