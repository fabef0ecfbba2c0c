//! Pose from three lines of sight (P3P), up to four solutions.
//!
//! The law of cosines for the ranges `s` along the lines of sight, `|s_i b_i - s_j b_j|^2 = |L_i - L_j|^2`, written with chords
//! `c_ij = |b_i - b_j|^2` as `(s_i - s_j)^2 + c_ij s_i s_j = a_ij`, which loses no digits in narrow cones. Two homogeneous combinations are
//! conics; their pencil holds a degenerate conic, a pair of lines, each of which meets the conics in two of the four solutions
//! (Persson & Nordberg, "Lambda Twist", ECCV 2018; the pair of lines is split as in Ding et al., "Revisiting the P3P problem", CVPR 2023).
//!
//! 1. order the triple so that the longest side faces the first point;
//! 2. conics in `u = (s_0 - s_2, s_1 - s_2, k s_2)`, `k^2` the largest chord: all coefficients of order one at any depth;
//! 3. best isolated real root of the cubic `det(D1 + g D2) = 0`;
//! 4. split `D1 + g D2` into two lines, intersect each with a conic;
//! 5. positive ranges, scaled by the sides, polished by Newton on the three range equations;
//! 6. attitude from the two triads, position from the mean.
//!
//! Left out: collinear landmarks (a circle of solutions) give none. On the danger cylinder two solutions merge and one is returned.

use nalgebra::{Matrix3, Vector3};

use super::conic::{adjugate, combine, contract, determinant, intersect, isolated_root, normalized, split};
use super::{Pose, Poses, sqrt};

/// Largest residual of a range equation, relative to the longest side squared, of a true solution: well above the rounding of a polished root
/// (1e-13 at depth 1000) and well below any false one.
const EXACT: f64 = 1e-10;
/// The same for the nearest real approach of a complex pair, which noise near the danger cylinder makes of a double root.
const NEAR: f64 = 0.2;
/// Twice the area over the longest side squared below which a triple counts as collinear.
const COLLINEAR: f64 = 1e-9;
/// Relative distance of two range triples below which they are one solution: the accuracy of a double root in f64.
const SAME: f64 = 1e-7;
const POLISH_STEPS: usize = 6;

/// Solves three landmarks and their unit lines of sight for every pose that reproduces them.
///
/// `landmarks` in the reference frame, `los` in body components, one column per landmark in the same order.
pub fn p3p(landmarks: &[Vector3<f64>; 3], los: &[Vector3<f64>; 3]) -> Poses<4> {
    solve(landmarks, los, EXACT)
}

/// As [`p3p`], and also the nearest real approach of complex pairs: starting points for an optimiser.
pub(super) fn p3p_near(landmarks: &[Vector3<f64>; 3], los: &[Vector3<f64>; 3]) -> Poses<4> {
    solve(landmarks, los, NEAR)
}

fn solve(landmarks: &[Vector3<f64>; 3], los: &[Vector3<f64>; 3], tolerance: f64) -> Poses<4> {
    let mut poses = Poses::new();
    let Some(triangle) = Triangle::new(landmarks, los) else {
        return poses;
    };
    let mut ranges = Ranges::new(tolerance);
    triangle.ranges(&mut ranges);
    let x = &triangle.landmarks;
    let reference = triad(&(x[2] - x[1]), &(x[0] - x[1]));
    let centre = (x[0] + x[1] + x[2]) * (1.0 / 3.0);
    for k in 0..ranges.len.min(4) {
        if let Some(pose) = triangle.pose(&ranges.items[k], &reference, &centre) {
            poses.push(pose);
        }
    }
    poses
}

/// Up to four distinct range triples.
struct Ranges {
    items: [Vector3<f64>; 4],
    len: usize,
    tolerance: f64,
}

impl Ranges {
    fn new(tolerance: f64) -> Self {
        Self { items: [Vector3::zeros(); 4], len: 0, tolerance }
    }

    #[inline]
    fn push(&mut self, s: Vector3<f64>) {
        let limit = SAME * SAME * s.norm_squared();
        for k in 0..self.len.min(4) {
            if (self.items[k] - s).norm_squared() <= limit {
                return;
            }
        }
        if self.len < 4 {
            self.items[self.len] = s;
            self.len += 1;
        }
    }
}

/// The ordered problem in units of its longest side, which joins points 1 and 2.
struct Triangle {
    landmarks: [Vector3<f64>; 3],
    los: [Vector3<f64>; 3],
    scale: f64,
    /// Squared sides `a_01`, `a_02` (`a_12` is one).
    a01: f64,
    a02: f64,
    /// Squared chords of the lines of sight.
    c01: f64,
    c02: f64,
    c12: f64,
}

impl Triangle {
    #[inline]
    fn new(x: &[Vector3<f64>; 3], b: &[Vector3<f64>; 3]) -> Option<Self> {
        let sides =
            [(x[1] - x[2]).norm_squared(), (x[0] - x[2]).norm_squared(), (x[0] - x[1]).norm_squared()];
        let (x, b, longest) = if sides[0] >= sides[1] && sides[0] >= sides[2] {
            (*x, *b, sides[0])
        } else if sides[1] >= sides[2] {
            ([x[1], x[2], x[0]], [b[1], b[2], b[0]], sides[1])
        } else {
            ([x[2], x[0], x[1]], [b[2], b[0], b[1]], sides[2])
        };
        let (e1, e2) = (x[1] - x[0], x[2] - x[0]);
        let rounding = 8.0 * f64::EPSILON * (x[0].amax() + x[1].amax() + x[2].amax());
        let scale = sqrt(longest);
        let area = e1.cross(&e2).norm();
        // Written so that NaN fails.
        if !(area > COLLINEAR * longest + rounding * scale && area < f64::INFINITY) {
            return None;
        }
        let chords =
            [(b[0] - b[1]).norm_squared(), (b[0] - b[2]).norm_squared(), (b[1] - b[2]).norm_squared()];
        if !(chords[0] + chords[1] + chords[2] > 1e-24) {
            return None;
        }
        Some(Self {
            landmarks: x,
            los: b,
            scale,
            a01: e1.norm_squared() / longest,
            a02: e2.norm_squared() / longest,
            c01: chords[0],
            c02: chords[1],
            c12: chords[2],
        })
    }

    /// Steps 2 to 5.
    #[inline]
    fn ranges(&self, out: &mut Ranges) {
        let k = sqrt(self.c01.max(self.c02).max(self.c12));
        let side = |c: f64| (0.5 * c / k, c / (k * k));
        let (l02, q02) = side(self.c02);
        let (l12, q12) = side(self.c12);
        let (l01, q01) = side(self.c01);
        let m02 = [1.0, 0.0, q02, 0.0, l02, 0.0];
        let m12 = [0.0, 1.0, q12, l12, 0.0, 0.0];
        let m01 = [1.0, 1.0, q01, l01, l01, 0.5 * self.c01 - 1.0];
        let mut d1 = normalized(&combine(&m01, -self.a01, &m12));
        let mut d2 = normalized(&combine(&m02, -self.a02, &m12));
        if determinant(&d1).abs() > determinant(&d2).abs() {
            core::mem::swap(&mut d1, &mut d2);
        }
        let (adj1, adj2) = (adjugate(&d1), adjugate(&d2));
        let (c0, c3) = (contract(&adj1, &d1) / 3.0, contract(&adj2, &d2) / 3.0);
        let (c1, c2) = (contract(&adj1, &d2), contract(&adj2, &d1));
        let g = if c3.abs() > 1e-14 { isolated_root(c2 / c3, c1 / c3, c0 / c3) } else { 0.0 };
        let degenerate = combine(&d1, g, &d2);
        let conic = if g.abs() > 1.0 { &d1 } else { &d2 };
        let (l, m, vertex) = split(&degenerate);
        for line in [l, m] {
            for u in intersect(&line, conic) {
                self.accept(u, k, out);
            }
        }
        // A complex pair of lines has one real point.
        if let Some(u) = vertex {
            self.accept(u, k, out);
        }
    }

    /// Step 5 for one homogeneous solution `u`.
    #[inline]
    fn accept(&self, u: Vector3<f64>, k: f64, out: &mut Ranges) {
        let s2 = u[2] / k;
        let mut s = Vector3::new(u[0] + s2, u[1] + s2, s2);
        if s.sum() < 0.0 {
            s = -s;
        }
        let total = self.equations(&s).sum() + self.a01 + self.a02 + 1.0;
        let s = s * sqrt((self.a01 + self.a02 + 1.0) / total);
        let margin = -1e-3 * s.amax();
        if !(s.min() > margin && s.amax() < f64::INFINITY) {
            return;
        }
        let (s, residual) = self.polish(s);
        if residual <= out.tolerance && s.min() > 0.0 {
            out.push(s);
        }
    }

    /// Residuals of the range equations, order 01, 02, 12.
    #[inline]
    fn equations(&self, s: &Vector3<f64>) -> Vector3<f64> {
        let f = |i: f64, j: f64, c: f64| (i - j) * (i - j) + c * i * j;
        Vector3::new(
            f(s[0], s[1], self.c01) - self.a01,
            f(s[0], s[2], self.c02) - self.a02,
            f(s[1], s[2], self.c12) - 1.0,
        )
    }

    /// Newton while it improves; returns the best ranges and their largest residual.
    #[inline]
    fn polish(&self, mut s: Vector3<f64>) -> (Vector3<f64>, f64) {
        let mut f = self.equations(&s);
        let mut worst = f.amax();
        for _ in 0..POLISH_STEPS {
            if worst <= 16.0 * f64::EPSILON {
                break;
            }
            let (d01, d02, d12) = (2.0 * (s[0] - s[1]), 2.0 * (s[0] - s[2]), 2.0 * (s[1] - s[2]));
            // Rows of the Jacobian: (p, q, 0), (r, 0, t), (0, v, w).
            let (p, q) = (d01 + self.c01 * s[1], self.c01 * s[0] - d01);
            let (r, t) = (d02 + self.c02 * s[2], self.c02 * s[0] - d02);
            let (v, w) = (d12 + self.c12 * s[2], self.c12 * s[1] - d12);
            let det = -p * t * v - q * r * w;
            let step = Vector3::new(
                -t * v * f[0] - q * w * f[1] + q * t * f[2],
                -r * w * f[0] + p * w * f[1] - p * t * f[2],
                r * v * f[0] - p * v * f[1] - q * r * f[2],
            ) * (1.0 / det);
            let next = s - step;
            let g = self.equations(&next);
            let residual = g.amax();
            // Written so that NaN stops.
            if !(residual < worst) {
                break;
            }
            (s, f, worst) = (next, g, residual);
        }
        (s, worst)
    }

    /// Step 6: attitude from the triads of the two triangles.
    #[inline]
    fn pose(&self, s: &Vector3<f64>, reference: &Matrix3<f64>, centre: &Vector3<f64>) -> Option<Pose> {
        let y = [self.los[0] * s[0], self.los[1] * s[1], self.los[2] * s[2]];
        let body = triad(&(y[2] - y[1]), &(y[0] - y[1]));
        let dcm = body * reference.transpose();
        let mean = (y[0] + y[1] + y[2]) * (self.scale / 3.0);
        let position = centre - dcm.tr_mul(&mean);
        let sum = position.sum() + dcm.sum();
        sum.is_finite().then_some(Pose { position, dcm })
    }
}

#[inline]
fn triad(along: &Vector3<f64>, other: &Vector3<f64>) -> Matrix3<f64> {
    let x = along * (1.0 / along.norm());
    let normal = along.cross(other);
    let z = normal * (1.0 / normal.norm());
    Matrix3::from_columns(&[x, z.cross(&x), z])
}
