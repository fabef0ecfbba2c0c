//! Conics in the plane as symmetric 3x3 matrices: pencils, degenerate members, points on a line.

use nalgebra::Vector3;

use super::sqrt;

const CUBIC_STEPS: usize = 24;

/// Symmetric 3x3 matrix, entries `xx yy zz yz xz xy`.
pub(super) type Conic = [f64; 6];

/// `a + g b`.
#[inline]
pub(super) fn combine(a: &Conic, g: f64, b: &Conic) -> Conic {
    core::array::from_fn(|k| a[k] + g * b[k])
}

/// `a` at unit Frobenius norm.
#[inline]
pub(super) fn normalized(a: &Conic) -> Conic {
    let norm = sqrt(contract(a, a));
    if norm > 0.0 { a.map(|v| v / norm) } else { *a }
}

/// Trace of the product of two symmetric matrices.
#[inline]
pub(super) fn contract(a: &Conic, b: &Conic) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

/// Matrix of cofactors, symmetric too.
#[inline]
pub(super) fn adjugate(a: &Conic) -> Conic {
    let [xx, yy, zz, yz, xz, xy] = *a;
    [
        yy * zz - yz * yz,
        xx * zz - xz * xz,
        xx * yy - xy * xy,
        xy * xz - xx * yz,
        xy * yz - yy * xz,
        xz * yz - zz * xy,
    ]
}

/// Determinant.
#[inline]
pub(super) fn determinant(a: &Conic) -> f64 {
    contract(&adjugate(a), a) / 3.0
}

/// The real root of `x^3 + b x^2 + c x + d` farthest from the other two: Newton from outside, which approaches it from one side.
#[inline]
pub(super) fn isolated_root(b: f64, c: f64, d: f64) -> f64 {
    let centre = -b / 3.0;
    let p = c - b * b / 3.0;
    let q = ((centre + b) * centre + c) * centre + d;
    // Depressed: z^3 + p z + q.
    let far = if p < 0.0 { 2.0 * sqrt(-p / 3.0) } else { num_traits::Float::cbrt(q.abs()) };
    let mut z = if q > 0.0 { -far } else { far };
    for _ in 0..CUBIC_STEPS {
        let slope = 3.0 * z * z + p;
        let value = (z * z + p) * z + q;
        if slope == 0.0 {
            break;
        }
        let step = value / slope;
        z -= step;
        if step.abs() <= 1e-15 * z.abs() {
            break;
        }
    }
    // One step on the undepressed cubic takes out the rounding of the shift.
    let x = centre + z;
    let slope = (3.0 * x + 2.0 * b) * x + c;
    let step = (((x + b) * x + c) * x + d) / slope;
    if step.abs() < 1e-6 * (x.abs() + far) { x - step } else { x }
}

/// Splits a degenerate conic into its two lines; when they are complex, also their real common point.
#[inline]
pub(super) fn split(a: &Conic) -> (Vector3<f64>, Vector3<f64>, Option<Vector3<f64>>) {
    let adj = adjugate(a);
    // adj = -p p' for real lines meeting in p: the column with the largest diagonal.
    let (diagonal, column) = if adj[0].abs() >= adj[1].abs() && adj[0].abs() >= adj[2].abs() {
        (adj[0], Vector3::new(adj[0], adj[5], adj[4]))
    } else if adj[1].abs() >= adj[2].abs() {
        (adj[1], Vector3::new(adj[5], adj[1], adj[3]))
    } else {
        (adj[2], Vector3::new(adj[4], adj[3], adj[2]))
    };
    let (p, vertex) = if diagonal < 0.0 {
        (column / sqrt(-diagonal), None)
    } else {
        (Vector3::zeros(), (diagonal > 0.0).then_some(column))
    };
    let [xx, yy, zz, yz, xz, xy] = *a;
    // a + [p x] = 2 l m': any non-zero row is m, any non-zero column l.
    let rows = [
        Vector3::new(xx, xy - p[2], xz + p[1]),
        Vector3::new(xy + p[2], yy, yz - p[0]),
        Vector3::new(xz - p[1], yz + p[0], zz),
    ];
    let columns = [
        Vector3::new(xx, xy + p[2], xz - p[1]),
        Vector3::new(xy - p[2], yy, yz + p[0]),
        Vector3::new(xz + p[1], yz - p[0], zz),
    ];
    (longest(&rows), longest(&columns), vertex)
}

#[inline]
fn longest(v: &[Vector3<f64>; 3]) -> Vector3<f64> {
    let n = [v[0].norm_squared(), v[1].norm_squared(), v[2].norm_squared()];
    if n[0] >= n[1] && n[0] >= n[2] {
        v[0]
    } else if n[1] >= n[2] {
        v[1]
    } else {
        v[2]
    }
}

/// The two points of `line` on `conic`, homogeneous; a complex pair is replaced by its real part.
#[inline]
pub(super) fn intersect(line: &Vector3<f64>, conic: &Conic) -> [Vector3<f64>; 2] {
    let [x, y, z] = [line[0], line[1], line[2]];
    // Two points spanning the line, divided by its largest component.
    let (u, v) = if x.abs() >= y.abs() && x.abs() >= z.abs() {
        (Vector3::new(-y / x, 1.0, 0.0), Vector3::new(-z / x, 0.0, 1.0))
    } else if y.abs() >= z.abs() {
        (Vector3::new(1.0, -x / y, 0.0), Vector3::new(0.0, -z / y, 1.0))
    } else {
        (Vector3::new(1.0, 0.0, -x / z), Vector3::new(0.0, 1.0, -y / z))
    };
    let [xx, yy, zz, yz, xz, xy] = *conic;
    let cv = Vector3::new(
        xx * v[0] + xy * v[1] + xz * v[2],
        xy * v[0] + yy * v[1] + yz * v[2],
        xz * v[0] + yz * v[1] + zz * v[2],
    );
    let cu = Vector3::new(
        xx * u[0] + xy * u[1] + xz * u[2],
        xy * u[0] + yy * u[1] + yz * u[2],
        xz * u[0] + yz * u[1] + zz * u[2],
    );
    // alpha s^2 + 2 beta s t + gamma t^2 = 0
    let (alpha, beta, gamma) = (u.dot(&cu), u.dot(&cv), v.dot(&cv));
    let root = sqrt((beta * beta - alpha * gamma).max(0.0));
    let q = if beta > 0.0 { -beta - root } else { root - beta };
    [u * q + v * alpha, u * gamma + v * q]
}
