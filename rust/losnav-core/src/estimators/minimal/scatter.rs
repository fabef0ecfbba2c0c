//! Centroid, size and principal axes of a cloud of landmarks: the frame in which the minimal solvers work.
//!
//! 1. centroid and scatter matrix of the landmarks;
//! 2. its eigenvectors by cyclic Jacobi rotations (at most `SWEEPS` sweeps);
//! 3. extents recomputed along the axes, which resolves thin clouds to rounding instead of to its square root.

use nalgebra::{Matrix3, Vector3};

use super::{Pose, sqrt};

const SWEEPS: usize = 8;

/// Centred, scaled, axis-aligned frame of a cloud of landmarks.
#[derive(Clone, Copy, Debug)]
pub struct Scatter {
    /// Number of landmarks.
    pub count: usize,
    /// Mean of the landmarks.
    pub centroid: Vector3<f64>,
    /// Right-handed principal axes as columns, by falling extent: the third is the normal of a flat cloud.
    pub axes: Matrix3<f64>,
    /// Root-mean-square extent along each axis, in the unit of the landmarks.
    pub extents: Vector3<f64>,
    /// Rounding of the landmarks' coordinates, in the unit of the landmarks.
    pub rounding: f64,
}

impl Scatter {
    /// Scatter of the landmarks; `None` when there are none or one of them is not finite.
    pub fn new<'a>(landmarks: impl Iterator<Item = &'a [f64; 3]> + Clone) -> Option<Self> {
        let mut count = 0;
        let mut sum = Vector3::zeros();
        let mut largest: f64 = 0.0;
        for l in landmarks.clone() {
            let l = Vector3::from(*l);
            count += 1;
            sum += l;
            largest = largest.max(l.amax());
        }
        let n = count as f64;
        let centroid = sum / n;
        let mut s = Matrix3::zeros();
        for l in landmarks.clone() {
            let d = Vector3::from(*l) - centroid;
            s += d * d.transpose();
        }
        if !(s.sum() + largest).is_finite() {
            return None;
        }
        let axes = principal_axes(&s);
        let mut squares = Vector3::zeros();
        for l in landmarks {
            let m = axes.tr_mul(&(Vector3::from(*l) - centroid));
            squares += m.component_mul(&m);
        }
        Some(Self {
            count,
            centroid,
            axes,
            extents: squares.map(|v| sqrt(v / n)),
            rounding: 4.0 * f64::EPSILON * largest,
        })
    }

    /// Whether all landmarks lie on a line, to rounding: no pose is observable.
    pub fn is_collinear(&self) -> bool {
        // Written so that NaN counts as collinear.
        !(self.extents[1] > 1e-9 * self.extents[0] + self.rounding)
    }

    /// Thickness over width: zero for coplanar landmarks.
    pub fn flatness(&self) -> f64 {
        self.extents[2] / self.extents[0]
    }

    /// The landmark in this frame, in units of the largest extent.
    #[inline]
    pub fn to_local(&self, landmark: &[f64; 3]) -> Vector3<f64> {
        self.axes.tr_mul(&(Vector3::from(*landmark) - self.centroid)) / self.extents[0]
    }

    /// The pose in the reference frame for the local attitude and the local origin `t` seen from the observer, body axes.
    #[inline]
    pub fn to_reference(&self, dcm: &Matrix3<f64>, t: &Vector3<f64>) -> Pose {
        let dcm = dcm * self.axes.transpose();
        Pose { position: self.centroid - dcm.tr_mul(t) * self.extents[0], dcm }
    }
}

/// Eigenvectors of a symmetric matrix as a rotation, by falling eigenvalue.
pub fn principal_axes(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    let mut a = *matrix;
    let mut v = Matrix3::identity();
    for _ in 0..SWEEPS {
        let off = a[(0, 1)].abs() + a[(0, 2)].abs() + a[(1, 2)].abs();
        let diagonal = a[(0, 0)].abs() + a[(1, 1)].abs() + a[(2, 2)].abs();
        // Written so that NaN stops.
        if !(off > 1e-17 * diagonal) {
            break;
        }
        rotate::<0, 1>(&mut a, &mut v);
        rotate::<0, 2>(&mut a, &mut v);
        rotate::<1, 2>(&mut a, &mut v);
    }
    let pairs = [
        (a[(0, 0)], v.column(0).into_owned()),
        (a[(1, 1)], v.column(1).into_owned()),
        (a[(2, 2)], v.column(2).into_owned()),
    ];
    let [p, q, r] = pairs;
    let (p, q) = if p.0 >= q.0 { (p, q) } else { (q, p) };
    let (first, second) = if r.0 > p.0 {
        (r, p)
    } else if r.0 > q.0 {
        (p, r)
    } else {
        (p, q)
    };
    Matrix3::from_columns(&[first.1, second.1, first.1.cross(&second.1)])
}

/// One Jacobi rotation that zeroes entry (P, Q).
#[inline]
fn rotate<const P: usize, const Q: usize>(a: &mut Matrix3<f64>, v: &mut Matrix3<f64>) {
    let off = a[(P, Q)];
    if off == 0.0 {
        return;
    }
    let theta = (a[(Q, Q)] - a[(P, P)]) / (2.0 * off);
    let t = 1.0f64.copysign(theta) / (theta.abs() + sqrt(theta * theta + 1.0));
    let c = 1.0 / sqrt(t * t + 1.0);
    let s = t * c;
    for k in 0..3 {
        let (kp, kq) = (a[(k, P)], a[(k, Q)]);
        a[(k, P)] = c * kp - s * kq;
        a[(k, Q)] = s * kp + c * kq;
    }
    for k in 0..3 {
        let (pk, qk) = (a[(P, k)], a[(Q, k)]);
        a[(P, k)] = c * pk - s * qk;
        a[(Q, k)] = s * pk + c * qk;
    }
    for k in 0..3 {
        let (kp, kq) = (v[(k, P)], v[(k, Q)]);
        v[(k, P)] = c * kp - s * kq;
        v[(k, Q)] = s * kp + c * kq;
    }
}
