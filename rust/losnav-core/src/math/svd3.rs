//! Singular value decomposition of a 3×3 matrix by one-sided Jacobi rotations (Hestenes 1958), in double precision.
//!
//! 1. rotate pairs of columns until all are orthogonal: `M V = U Σ`;
//! 2. sort by falling length;
//! 3. complete `U` where a column is too short to have a direction.
//!
//! Small singular values keep their relative accuracy, which methods that form `MᵀM` lose.
use num_traits::Float;

use super::vec3::{Mat3, Vec3, cross, dot, scale, sub, transpose};

/// Bound on the sweeps; five are usual.
const SWEEPS: usize = 30;
/// Columns this small beside the largest have no direction.
const NEGLIGIBLE: f64 = 4.0 * f64::EPSILON;

/// `M = U diag(s) Vᵀ` with `s` falling and not negative; `U` and `V` orthogonal, of either determinant.
#[derive(Clone, Copy, Debug)]
pub struct Svd3 {
    /// `U`.
    pub u: Mat3<f64>,
    /// Singular values.
    pub s: Vec3<f64>,
    /// `V`.
    pub v: Mat3<f64>,
}

/// The decomposition; NaN in, NaN out.
#[must_use]
pub fn svd(matrix: &Mat3<f64>) -> Svd3 {
    let mut columns = transpose(matrix);
    let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..SWEEPS {
        let mut quiet = true;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            quiet &= !orthogonalise(&mut columns, &mut v, p, q);
        }
        if quiet {
            break;
        }
    }
    let mut s = columns.map(|c| Float::sqrt(dot(c, c)));
    for (a, b) in [(0, 1), (1, 2), (0, 1)] {
        if s[a] < s[b] {
            s.swap(a, b);
            columns.swap(a, b);
            v.swap(a, b);
        }
    }
    Svd3 { u: transpose(&directions(&columns, &s)), s, v: transpose(&v) }
}

/// Step 1 for one pair; `false` when they are orthogonal already.
fn orthogonalise(columns: &mut Mat3<f64>, v: &mut Mat3<f64>, p: usize, q: usize) -> bool {
    let (a, b) = (columns[p], columns[q]);
    let (aa, bb, ab) = (dot(a, a), dot(b, b), dot(a, b));
    // Written so that NaN is orthogonal.
    let oblique = Float::abs(ab) > f64::EPSILON * Float::sqrt(aa) * Float::sqrt(bb);
    if !oblique {
        return false;
    }
    let theta = (bb - aa) / (2.0 * ab);
    let sign = if theta < 0.0 { -1.0 } else { 1.0 };
    let t = sign / (Float::abs(theta) + Float::hypot(theta, 1.0));
    let c = 1.0 / Float::sqrt(t * t + 1.0);
    let turn = |x: Vec3<f64>, y: Vec3<f64>| {
        let (cx, sy) = (scale(c, x), scale(c * t, y));
        let (sx, cy) = (scale(c * t, x), scale(c, y));
        (sub(cx, sy), [sx[0] + cy[0], sx[1] + cy[1], sx[2] + cy[2]])
    };
    (columns[p], columns[q]) = turn(a, b);
    (v[p], v[q]) = turn(v[p], v[q]);
    true
}

/// Step 3: unit columns, orthogonal to each other.
fn directions(columns: &Mat3<f64>, s: &Vec3<f64>) -> Mat3<f64> {
    let floor = NEGLIGIBLE * s[0];
    let first = if s[0] > 0.0 { scale(1.0 / s[0], columns[0]) } else { [1.0, 0.0, 0.0] };
    let second = if s[1] > floor { scale(1.0 / s[1], columns[1]) } else { perpendicular(first) };
    let third = cross(first, second);
    let third = if s[2] > floor && dot(third, columns[2]) < 0.0 { scale(-1.0, third) } else { third };
    [first, second, third]
}

/// A unit vector at right angles to a unit vector: the cross product with the axis it is farthest from.
#[must_use]
pub fn perpendicular(v: Vec3<f64>) -> Vec3<f64> {
    let [x, y, z] = v.map(Float::abs);
    let axis = if x <= y && x <= z {
        [1.0, 0.0, 0.0]
    } else if y <= z {
        [0.0, 1.0, 0.0]
    } else {
        [0.0, 0.0, 1.0]
    };
    let w = cross(axis, v);
    scale(1.0 / Float::sqrt(dot(w, w)), w)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3::mul;

    fn check(m: &Mat3<f64>) {
        let Svd3 { u, s, v } = svd(m);
        let us = [0, 1, 2].map(|i| [u[i][0] * s[0], u[i][1] * s[1], u[i][2] * s[2]]);
        let back = mul(&us, &transpose(&v));
        let (uu, vv) = (mul(&u, &transpose(&u)), mul(&v, &transpose(&v)));
        for i in 0..3 {
            for j in 0..3 {
                let one = if i == j { 1.0 } else { 0.0 };
                assert!((back[i][j] - m[i][j]).abs() < 2e-15 * s[0].max(1.0), "{m:?}");
                assert!((uu[i][j] - one).abs() < 4e-15, "{m:?} {uu:?}");
                assert!((vv[i][j] - one).abs() < 4e-15, "{m:?}");
            }
        }
        assert!(s[0] >= s[1] && s[1] >= s[2] && s[2] >= 0.0);
    }

    #[test]
    fn of_every_rank() {
        check(&[[2.0, 0.3, -0.1], [0.5, 1.0, 0.2], [-0.4, 0.2, -0.5]]);
        check(&[[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]);
        check(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [-1.0, -2.0, -3.0]]);
        check(&[[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 0.0, 0.0]]);
        check(&[[0.0; 3]; 3]);
        check(&[[1.0, 1e-9, 0.0], [0.0, 1e-9, 1e-9], [1e-9, 0.0, 1e-9]]);
    }
}
