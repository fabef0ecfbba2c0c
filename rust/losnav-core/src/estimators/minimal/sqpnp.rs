//! Object-space cost of a pose and its minima over the rotations: a global start for N >= 4 lines of sight.
//!
//! `f = sum w |(I - b b')(R M + t)|^2` is quadratic in `t`, which is eliminated, and in the nine entries of `R` (Terzakis & Lourakis, "A
//! Consistently Fast and Globally Optimal Solution to the Perspective-n-Point Problem", ECCV 2020, eqs. 4 to 9), with a weight per line of
//! sight and lines of sight on the whole sphere. There the minima are sought by sequential quadratic programming from the eigenvectors of the
//! 9x9 matrix; with a null space of more than one dimension (N < 6, coplanar, far) these start from arbitrary members of it, so here a damped
//! Newton method on the rotations descends from a grid of rotations about the mean line of sight instead, which needs no eigenvectors.
//!
//! The cost does not tell a landmark in front from one behind: mirrored starts are turned half a turn about the mean line of sight.

use nalgebra::{Matrix3, Vector3};

use super::sqrt;

const DESCENT_STEPS: usize = 10;
/// Relative fall of the cost below which a descent is close enough to its minimum to be handed to the optimiser.
const FALL: f64 = 1e-3;

/// The object-space cost as a quadratic form in the columns of the attitude.
#[derive(Clone, Debug)]
pub struct ObjectSpace {
    /// Blocks 00 11 22 01 02 12 of the quadratic form; block kl multiplies columns k and l.
    blocks: [Matrix3<f64>; 6],
    /// `t = -sum shift_k column_k`.
    shift: [Matrix3<f64>; 3],
    /// Weighted mean line of sight (not unit).
    mean: Vector3<f64>,
}

/// A symmetric 3x3 accumulator: xx yy zz yz xz xy.
type Packed = [f64; 6];

fn unpack(p: &Packed) -> Matrix3<f64> {
    Matrix3::new(p[0], p[5], p[4], p[5], p[1], p[3], p[4], p[3], p[2])
}

#[inline]
fn accumulate(sum: &mut Packed, factor: f64, q: &Packed) {
    for k in 0..6 {
        sum[k] += factor * q[k];
    }
}

impl ObjectSpace {
    /// Accumulates landmarks (local frame), lines of sight and weights; `None` when all lines of sight are parallel.
    pub fn new(observations: impl Iterator<Item = (Vector3<f64>, Vector3<f64>, f64)>) -> Option<Self> {
        let mut total = [0.0; 6];
        let mut first = [[0.0; 6]; 3];
        let mut second = [[0.0; 6]; 6];
        let mut mean = Vector3::zeros();
        for (m, b, w) in observations {
            let q = [
                w * (1.0 - b[0] * b[0]),
                w * (1.0 - b[1] * b[1]),
                w * (1.0 - b[2] * b[2]),
                -w * b[1] * b[2],
                -w * b[0] * b[2],
                -w * b[0] * b[1],
            ];
            accumulate(&mut total, 1.0, &q);
            let squares = [m[0] * m[0], m[1] * m[1], m[2] * m[2], m[0] * m[1], m[0] * m[2], m[1] * m[2]];
            for k in 0..3 {
                accumulate(&mut first[k], m[k], &q);
            }
            for k in 0..6 {
                accumulate(&mut second[k], squares[k], &q);
            }
            mean += b * w;
        }
        let inverse = unpack(&total).try_inverse()?;
        let s = first.map(|p| unpack(&p));
        let shift = s.map(|s| inverse * s);
        let block = |k: usize, i: usize, j: usize| unpack(&second[k]) - s[i] * shift[j];
        Some(Self {
            blocks: [
                block(0, 0, 0),
                block(1, 1, 1),
                block(2, 2, 2),
                block(3, 0, 1),
                block(4, 0, 2),
                block(5, 1, 2),
            ],
            shift,
            mean,
        })
    }

    /// The best local origin seen from the observer, body axes, for an attitude (or any linear map) of the local frame.
    #[inline]
    pub fn translation(&self, r: &Matrix3<f64>) -> Vector3<f64> {
        -(self.shift[0] * r.column(0) + self.shift[1] * r.column(1) + self.shift[2] * r.column(2))
    }

    /// Blocks of the in-plane columns, for homographies.
    pub(super) fn in_plane(&self) -> (Matrix3<f64>, Matrix3<f64>, Matrix3<f64>) {
        (self.blocks[0], self.blocks[3], self.blocks[1])
    }

    /// Weighted mean line of sight, unit length where it has one.
    pub fn axis(&self) -> Vector3<f64> {
        let n = self.mean.norm();
        if n > 1e-12 { self.mean / n } else { Vector3::z() }
    }

    /// Half the derivative of the cost with respect to the columns.
    #[inline]
    fn gradient(&self, r: &Matrix3<f64>) -> [Vector3<f64>; 3] {
        let [b00, b11, b22, b01, b02, b12] = &self.blocks;
        let (x, y, z) = (r.column(0), r.column(1), r.column(2));
        [
            b00 * x + b01 * y + b02 * z,
            b01.tr_mul(&x) + b11 * y + b12 * z,
            b02.tr_mul(&x) + b12.tr_mul(&y) + b22 * z,
        ]
    }

    /// The cost of an attitude of the local frame, with the best translation.
    #[inline]
    pub fn cost(&self, r: &Matrix3<f64>) -> f64 {
        let g = self.gradient(r);
        r.column(0).dot(&g[0]) + r.column(1).dot(&g[1]) + r.column(2).dot(&g[2])
    }

    /// The attitude, turned half a turn about the mean line of sight if it puts the landmarks behind the observer.
    pub fn in_front(&self, r: &Matrix3<f64>) -> Matrix3<f64> {
        if self.translation(r).dot(&self.mean) >= 0.0 {
            return *r;
        }
        half_turn(&self.axis()) * r
    }

    /// Damped Newton on the rotations from `start`; returns the attitude reached and its cost.
    pub fn descend(&self, start: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
        let mut r = *start;
        let mut g = self.gradient(&r);
        let mut cost = inner(&r, &g);
        let mut damping = 0.0;
        for _ in 0..DESCENT_STEPS {
            let (gradient, hessian) = self.newton(&r, &g);
            let scale = hessian.trace().abs() * (1.0 / 3.0);
            let Some(step) = solve_damped(&hessian, &gradient, damping * scale) else {
                damping = (4.0 * damping).max(0.1);
                continue;
            };
            let next = turn(&step) * r;
            let next_g = self.gradient(&next);
            let next_cost = inner(&next, &next_g);
            if next_cost < cost {
                let fall = cost - next_cost;
                (r, g, cost) = (next, next_g, next_cost);
                damping = if damping > 0.02 { 0.25 * damping } else { 0.0 };
                if fall <= FALL * cost {
                    break;
                }
            } else {
                if step.norm_squared() < 1e-12 {
                    break;
                }
                damping = (4.0 * damping).max(0.1);
            }
        }
        (r, cost)
    }

    /// Gradient and Hessian of half the cost with respect to a small rotation on the body side.
    #[inline]
    fn newton(&self, r: &Matrix3<f64>, g: &[Vector3<f64>; 3]) -> (Vector3<f64>, Matrix3<f64>) {
        let c = [r.column(0).into_owned(), r.column(1).into_owned(), r.column(2).into_owned()];
        let mut gradient = Vector3::zeros();
        let mut h = Matrix3::zeros();
        for k in 0..3 {
            gradient += c[k].cross(&g[k]);
            // Curvature of the rotation group.
            let outer = g[k] * c[k].transpose();
            h += (outer + outer.transpose()) * 0.5;
            let dot = g[k].dot(&c[k]);
            h -= Matrix3::from_diagonal_element(dot);
        }
        let x = c.map(|c| c.cross_matrix());
        let [b00, b11, b22, b01, b02, b12] = &self.blocks;
        let twice = -(x[0] * (b01 * x[1]) + x[0] * (b02 * x[2]) + x[1] * (b12 * x[2]));
        h += twice + twice.transpose();
        h -= x[0] * (b00 * x[0]) + x[1] * (b11 * x[1]) + x[2] * (b22 * x[2]);
        (gradient, h)
    }
}

#[inline]
fn inner(r: &Matrix3<f64>, g: &[Vector3<f64>; 3]) -> f64 {
    r.column(0).dot(&g[0]) + r.column(1).dot(&g[1]) + r.column(2).dot(&g[2])
}

/// Rotation by half a turn about the unit vector `axis`.
#[inline]
pub fn half_turn(axis: &Vector3<f64>) -> Matrix3<f64> {
    axis * axis.transpose() * 2.0 - Matrix3::identity()
}

/// Rotation by the Cayley map of `step`: the exponential to second order, without trigonometry.
#[inline]
pub fn turn(step: &Vector3<f64>) -> Matrix3<f64> {
    let v = step * 0.5;
    let n = v.norm_squared();
    let f = 2.0 / (1.0 + n);
    let x = v.cross_matrix();
    Matrix3::identity() + (x + x * x) * f
}

/// `-(H + damping I)^-1 g` by Cholesky; `None` unless positive definite.
#[inline]
fn solve_damped(h: &Matrix3<f64>, g: &Vector3<f64>, damping: f64) -> Option<Vector3<f64>> {
    let floor = 1e-12 * h.trace().abs();
    let d0 = h[(0, 0)] + damping;
    if !(d0 > floor) {
        return None;
    }
    let (l10, l20) = (h[(1, 0)] / d0, h[(2, 0)] / d0);
    let d1 = h[(1, 1)] + damping - l10 * h[(1, 0)];
    if !(d1 > floor) {
        return None;
    }
    let m21 = h[(2, 1)] - l20 * h[(1, 0)];
    let l21 = m21 / d1;
    let d2 = h[(2, 2)] + damping - l20 * h[(2, 0)] - l21 * m21;
    if !(d2 > floor) {
        return None;
    }
    let y0 = -g[0];
    let y1 = -g[1] - l10 * y0;
    let y2 = -g[2] - l20 * y0 - l21 * y1;
    let z2 = y2 / d2;
    let z1 = y1 / d1 - l21 * z2;
    let z0 = y0 / d0 - l10 * z1 - l20 * z2;
    Some(Vector3::new(z0, z1, z2))
}

/// A right-handed frame whose third axis is the unit vector `axis`, as columns.
#[inline]
pub fn frame_about(axis: &Vector3<f64>) -> Matrix3<f64> {
    let [x, y, z] = [axis[0].abs(), axis[1].abs(), axis[2].abs()];
    let e = if x <= y && x <= z {
        Vector3::x()
    } else if y <= z {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let x = axis.cross(&e);
    let x = x / sqrt(x.norm_squared());
    Matrix3::from_columns(&[x, axis.cross(&x), *axis])
}
