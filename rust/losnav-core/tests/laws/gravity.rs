//! Laws of every field of gravity: the acceleration is the gradient of the potential, the gradient that of the acceleration,
//! symmetric, and free space holds no mass.
use losnav_core::math::real::Real;
use losnav_core::models::gravity::harmonics::{coefficients_of, normalization, terms_of};
use losnav_core::models::gravity::polyhedron::{Edge, Face};
use losnav_core::models::gravity::{Gravity, Harmonics, PointMass, Polyhedron, Scaled, Uniform};

use crate::dual::First;
use crate::{SAME_FORMULA, assert_close, largest};

/// Asserts them at one place; `filled` is `∇²U` there.
pub fn obeys_within(tolerance: f64, field: &impl Gravity, r: [f64; 3], filled: f64) {
    let (g, gradient) = field.acceleration_and_gradient(r);
    let alone = field.acceleration(r);
    let (pull, bend) = (largest(g), largest(gradient.into_iter().flatten()));
    for axis in 0..3 {
        let mut seeded = r.map(|x| First::along(x, 0.0));
        seeded[axis].slope = 1.0;
        assert_close(alone[axis], g[axis], pull, tolerance);
        assert_close(field.potential(seeded).slope, g[axis], pull, tolerance);
        let slope = field.acceleration(seeded);
        for row in 0..3 {
            assert_close(slope[row].slope, gradient[row][axis], bend, tolerance);
            assert_close(gradient[axis][row], gradient[row][axis], bend, tolerance);
        }
    }
    assert_close(gradient[0][0] + gradient[1][1] + gradient[2][2], filled, bend, tolerance);
}

/// Asserts them at one place outside the body.
fn obeys(field: &impl Gravity, r: [f64; 3]) {
    obeys_within(SAME_FORMULA, field, r, 0.0);
}

/// Some places around a body of radius one, in this unit.
pub fn places(unit: f64) -> [[f64; 3]; 4] {
    [[1.3, -0.4, 0.8], [-0.2, 2.5, -3.1], [0.0, 0.0, 1.7], [40.0, -70.0, 10.0]].map(|r| r.map(|x| x * unit))
}

#[test]
fn point_mass_and_uniform() {
    for r in places(16_000.0) {
        obeys(&PointMass { mu: 4.46e5 }, r);
        obeys(&Uniform { acceleration: [0.1, -0.2, -9.8] }, r);
        obeys(&Scaled { field: &PointMass { mu: 4.46e5 }, factor: -0.3 }, r);
    }
}

#[test]
fn single_precision_is_the_same_field() {
    let field = PointMass { mu: 4.46e5 };
    for r in places(16_000.0) {
        let (wide, narrow) = (field.acceleration(r), field.acceleration(r.map(|x| x as f32)));
        for axis in 0..3 {
            assert_close(f64::from(narrow[axis]), wide[axis], largest(wide), 4.0 * f32::EPSILON as f64);
        }
    }
    assert_eq!(field.acceleration([2.0_f64, 0.0, 0.0].map(f64::splat))[0], -4.46e5 / 4.0);
}

/// `μ` and radius of Eros, as PDS NEAR15A has them.
const EROS: (f64, f64) = (4.462_754_720_04e5, 16_000.0);

/// A field with every coefficient up to a degree.
fn harmonics(degree: usize) -> Harmonics<Vec<losnav_core::models::gravity::harmonics::Term>> {
    let mut coefficients = vec![[0.0; 2]; coefficients_of(degree)];
    let mut k = 0;
    for n in 0..=degree {
        for m in 0..=n {
            let angle = (7 * n + 3 * m + 1) as f64;
            let size = 0.1 / (1 + n * n) as f64;
            coefficients[k] = [size * angle.sin(), if m > 0 { size * angle.cos() } else { 0.0 }];
            k += 1;
        }
    }
    coefficients[0] = [1.0, 0.0];
    Harmonics::try_new(EROS.0, EROS.1, &coefficients, vec![Default::default(); terms_of(degree)]).unwrap()
}

#[test]
fn harmonics_of_every_degree() {
    for degree in [0, 1, 2, 4, 9, 40] {
        for r in places(EROS.1) {
            obeys(&harmonics(degree), r);
        }
    }
}

#[test]
fn degree_zero_is_a_point_mass() {
    let (field, point) = (harmonics(0), PointMass { mu: EROS.0 });
    for r in places(EROS.1) {
        let ((g, bend), (h, curve)) =
            (field.acceleration_and_gradient(r), point.acceleration_and_gradient(r));
        for i in 0..3 {
            assert_close(g[i], h[i], largest(h), SAME_FORMULA);
            for j in 0..3 {
                assert_close(bend[i][j], curve[i][j], largest(curve[i]), SAME_FORMULA);
            }
        }
        assert_close(field.potential(r), point.potential(r), point.potential(r), SAME_FORMULA);
    }
}

/// The five terms of the landing problem as polynomials: `f_nm = μ C_nm aⁿ r⁻⁽²ⁿ⁺¹⁾`.
#[test]
fn harmonics_are_the_polynomials() {
    let unnormalised = [(2, 0, -0.1173), (2, 2, 0.0562), (4, 0, 0.0388), (4, 2, -0.00403), (4, 4, 0.00041)];
    let mut coefficients = vec![[0.0; 2]; coefficients_of(4)];
    coefficients[0][0] = 1.0;
    for (n, m, c) in unnormalised {
        coefficients[n * (n + 1) / 2 + m][0] = c / normalization(n, m);
    }
    let field = Harmonics::try_new(EROS.0, EROS.1, &coefficients, vec![Default::default(); terms_of(4)]);
    let field = field.unwrap();
    for r in places(EROS.1) {
        let [x, y, z] = r;
        let s = x * x + y * y;
        let solid = [
            (2.0 * z * z - s) / 2.0,
            3.0 * (x * x - y * y),
            (8.0 * z.powi(4) - 24.0 * z * z * s + 3.0 * s * s) / 8.0,
            7.5 * (6.0 * z * z - s) * (x * x - y * y),
            105.0 * (x.powi(4) - 6.0 * x * x * y * y + y.powi(4)),
        ];
        let distance = (s + z * z).sqrt();
        let mut potential = EROS.0 / distance;
        for ((n, _, c), polynomial) in unnormalised.into_iter().zip(solid) {
            let n = n as i32;
            potential += EROS.0 * c * EROS.1.powi(n) * distance.powi(-2 * n - 1) * polynomial;
        }
        assert_close(field.potential(r), potential, potential, SAME_FORMULA);
    }
}

#[test]
fn tables_of_wrong_size_are_refused() {
    let room = || vec![Default::default(); terms_of(1)];
    assert!(Harmonics::try_new(1.0, 1.0, &[[1.0, 0.0]; 3], room()).is_some());
    assert!(Harmonics::try_new(1.0, 1.0, &[[1.0, 0.0]; 4], room()).is_none());
    assert!(Harmonics::try_new(1.0, 1.0, &[[1.0, 0.0]; 1], room()).is_none());
}

/// A pyramid with its faces and edges; `Gσ = 1`.
fn pyramid() -> Polyhedron<Vec<Edge>, Vec<Face>> {
    let corners = [[1.0, 0.1, -0.3], [-0.7, 0.8, -0.4], [-0.6, -0.9, -0.2], [0.1, 0.2, 0.9]];
    let triangles = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let faces: Vec<Face> = triangles.iter().map(|t| Face::new(t.map(|i| corners[i]))).collect();
    let mut edges = vec![];
    for (f, one) in triangles.iter().enumerate() {
        for (g, two) in triangles.iter().enumerate() {
            for i in 0..3 {
                for j in 0..3 {
                    let (from, to) = (one[i], one[(i + 1) % 3]);
                    if from < to && two[j] == to && two[(j + 1) % 3] == from {
                        edges.push(Edge::new(corners[from], corners[to], [&faces[f], &faces[g]]));
                    }
                }
            }
        }
    }
    assert_eq!(edges.len(), 6);
    Polyhedron { density: 1.0, edges, faces }
}

#[test]
fn polyhedron_outside_and_inside() {
    use core::f64::consts::PI;
    let body = pyramid();
    for r in places(1.0).into_iter().take(3) {
        obeys_within(1e-11, &body, r, 0.0);
        assert_close(body.laplacian(r), 0.0, 1.0, 1e-11);
    }
    for r in [[0.0, 0.0, 0.0], [0.1, 0.1, 0.5], [-0.3, 0.2, -0.1]] {
        obeys_within(1e-12, &body, r, -4.0 * PI);
        assert_close(body.laplacian(r), -4.0 * PI, 1.0, 1e-12);
    }
}

/// Far away the shape is lost: a point mass at its centre, and in digits what the cancellation leaves.
#[test]
fn polyhedron_from_afar() {
    let body = pyramid();
    let point = PointMass { mu: body.volume() };
    let direction = [0.6, -0.64, 0.48];
    for (distance, tolerance) in [(1e3, 1e-3), (1e4, 2e-4)] {
        let r = direction.map(|x| x * distance);
        let (g, wanted) = (body.acceleration(r), point.acceleration(r));
        for i in 0..3 {
            assert_close(g[i], wanted[i], largest(wanted), tolerance);
        }
    }
}

/// On a face, an edge and a corner potential and acceleration are those of the places around.
#[test]
fn polyhedron_at_its_surface() {
    let body = pyramid();
    let [a, b, c] = [[1.0, 0.1, -0.3], [-0.7, 0.8, -0.4], [0.1, 0.2, 0.9]];
    let between = |u: f64, v: f64| -> [f64; 3] {
        core::array::from_fn(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]))
    };
    for r in [a, between(0.5, 0.0), between(0.3, 0.7), between(0.2, 0.3)] {
        let (g, potential) = (body.acceleration(r), body.potential(r));
        for side in [1e-9, -1e-9] {
            let near = [r[0] + side, r[1] - 0.3 * side, r[2] + 0.2 * side];
            let beside = body.acceleration(near);
            assert_close(potential, body.potential(near), potential, 1e-8);
            for i in 0..3 {
                assert_close(g[i], beside[i], largest(g), 1e-6);
            }
        }
    }
}

#[test]
fn logarithm_of_quotients() {
    use losnav_core::math::logarithm::log_ratio;
    let mut d = 1.0;
    for _ in 0..300 {
        d *= 0.9;
        // `ln((1 + d)/(1 − d)) = 2 atanh d`.
        assert_close(log_ratio(1.0, d), 2.0 * d.atanh(), 2.0 * d.atanh(), 2e-15);
        let slope = log_ratio(First::along(1.0, 0.0), First::along(d, 1.0)).slope;
        assert_close(slope, 2.0 / (1.0 - d * d), slope, 1e-14);
    }
    for gap in [1e-3, 1e-8, 1e-15] {
        let (p, q): (f64, f64) = (2.0 - gap, 1.0 - (1.0 - gap));
        assert_close(log_ratio(1.0, 1.0 - gap), (p / q).ln(), (p / q).ln(), 2e-15);
    }
    assert!(log_ratio(1.0_f64, 1.0).is_finite());
    assert_eq!(log_ratio(1.0_f64, 0.0), 0.0);
}

#[test]
#[ignore = "a timing, not a law"]
fn time_of_degree_four() {
    let field = harmonics(4);
    let start = std::time::Instant::now();
    let mut sum = 0.0;
    let count = 1_000_000;
    for k in 0..count {
        let r = [16_000.0 + k as f64 * 1e-3, 3_000.0 - sum * 1e-9, 5_000.0];
        let (g, gradient) = field.acceleration_and_gradient(r);
        sum += g[0] + gradient[1][2];
    }
    println!("{} ns, {sum}", start.elapsed().as_secs_f64() / f64::from(count) * 1e9);
}
