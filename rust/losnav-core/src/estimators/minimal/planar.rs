//! Poses from coplanar landmarks: the homography and the two poses of its local affine part.
//!
//! In the frame of [`Scatter`] coplanar landmarks are `M = (u, v, 0)` and `b ~ h_1 u + h_2 v + t` with
//! `[h_1 h_2] = s [r_1 r_2]`.
//!
//! 1. `[h_1 h_2]` minimises the object-space quadratic form over transverse parts of unit length: the null vector for exact lines of sight
//!    (the DLT with projectors `I - b b'`, so there is no division by a depth and the whole sphere is allowed), by inverse iteration;
//! 2. sign: the landmarks lie in front;
//! 3. nearest pair of orthonormal columns, and the third by their cross product;
//! 4. at the centroid, seen along `c`, only `(I - c c')[r_1 r_2] / depth` enters; it leaves the components `q` of `r_1, r_2` along `c` to
//!    `J'J = s^2 (I - q q')`: two poses `+q` and `-q` (Collins & Bartoli, "Infinitesimal Plane-based Pose Estimation", IJCV 2014), mirror
//!    images of each other about the line of sight of the centroid, which far and noisy scenes cannot tell apart.

use nalgebra::{Matrix2, Matrix3, Matrix4, Matrix4x2, Vector3, Vector4};

use super::scatter::Scatter;
use super::sqpnp::{ObjectSpace, frame_about, half_turn};
use super::{Pose, sqrt};

const INVERSE_ITERATIONS: usize = 4;
/// Thickness over width up to which landmarks count as a plane that can be turned over: a few degrees of relief still leave two minima.
const FLAT: f64 = 0.05;

/// Attitudes of the local frame: the homography's, and the two of its affine part at the centroid.
pub fn planar(cost: &ObjectSpace) -> Option<[Matrix3<f64>; 3]> {
    let mut columns = homography(cost)?;
    let mut t = cost.translation(&columns);
    if t.dot(&cost.axis()) < 0.0 {
        columns = -columns;
        t = -t;
    }
    let pair = affine_pair(&columns, &t)?;
    Some([orthonormal(&columns)?, pair[0], pair[1]])
}

/// The pose turned over: plane normal mirrored about the line of sight `axis`, transverse picture unchanged.
#[inline]
pub fn flipped(dcm: &Matrix3<f64>, normal: &Vector3<f64>, axis: &Vector3<f64>) -> Matrix3<f64> {
    half_turn(axis) * dcm * half_turn(normal)
}

/// The other pose that nearly explains what `pose` explains, if the landmarks are coplanar: turned over about the line of sight of
/// their centroid, which stays where it is seen (Schweighofer & Pinz, "Robust pose estimation from a planar target", PAMI 2006).
pub fn turned_over(landmarks: &[[f64; 3]], pose: &Pose) -> Option<Pose> {
    let scatter = Scatter::new(landmarks.iter())?;
    if landmarks.len() < 4 || scatter.is_collinear() || scatter.flatness() > FLAT {
        return None;
    }
    let normal = scatter.axes.column(2).into_owned();
    let t = pose.dcm * (scatter.centroid - pose.position);
    let range = t.norm();
    if !(range > 0.0) {
        return None;
    }
    let dcm = flipped(&pose.dcm, &normal, &(t / range));
    Some(Pose { position: scatter.centroid - dcm.transpose() * t, dcm })
}

/// Columns `h_1, h_2` that minimise the in-plane form over transverse parts of unit length.
///
/// The parts along the mean line of sight hardly cost anything far away, so a unit norm over all six would be spent on them.
fn homography(cost: &ObjectSpace) -> Option<Matrix3<f64>> {
    let frame = frame_about(&cost.axis());
    let (a, b, d) = cost.in_plane();
    let turned = |m: Matrix3<f64>| frame.tr_mul(&(m * frame));
    let (a, b, d) = (turned(a), turned(b), turned(d));
    let transverse = Matrix4::from_fn(|i, j| pick(&a, &b, &d, (i / 2, i % 2), (j / 2, j % 2)));
    let along = Matrix4x2::from_fn(|i, j| pick(&a, &b, &d, (i / 2, i % 2), (j, 2)));
    let depth = Matrix2::new(a[(2, 2)], b[(2, 2)], b[(2, 2)], d[(2, 2)]);
    let depth = depth.try_inverse()?;
    let mut form = transverse - along * depth * along.transpose();
    let shift = 1e-13 * transverse.trace();
    for k in 0..4 {
        form[(k, k)] += shift;
    }
    let factor = form.cholesky()?;
    let mut h = Vector4::new(0.6, 0.3, -0.4, 0.7);
    for _ in 0..INVERSE_ITERATIONS {
        h = factor.solve(&h);
        let n = h.norm();
        if !(n > 0.0 && n < f64::INFINITY) {
            return None;
        }
        h /= n;
    }
    let z = -(depth * along.tr_mul(&h));
    let x = frame * Vector3::new(h[0], h[1], z[0]);
    let y = frame * Vector3::new(h[2], h[3], z[1]);
    Some(Matrix3::from_columns(&[x, y, Vector3::zeros()]))
}

/// Entry of the symmetric form `[a b; b' d]` at (column, component) twice.
#[inline]
fn pick(a: &Matrix3<f64>, b: &Matrix3<f64>, d: &Matrix3<f64>, i: (usize, usize), j: (usize, usize)) -> f64 {
    match (i.0, j.0) {
        (0, 0) => a[(i.1, j.1)],
        (0, _) => b[(i.1, j.1)],
        (_, 0) => b[(j.1, i.1)],
        _ => d[(i.1, j.1)],
    }
}

/// Rotation whose first two columns are nearest to those of `h` (up to a common scale).
fn orthonormal(h: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (x, y) = (h.column(0).into_owned(), h.column(1).into_owned());
    let z = x.cross(&y);
    let area = z.norm();
    let sum = x.norm_squared() + y.norm_squared();
    // Written so that NaN fails.
    if !(area > 1e-12 * sum) {
        return None;
    }
    let n = z / area;
    // In the plane the polar factor of a 2x2 matrix with positive determinant: a + adj(a)', scaled.
    let (u, v) = (x + y.cross(&n), y + n.cross(&x));
    Some(Matrix3::from_columns(&[u / u.norm(), v / v.norm(), n]))
}

/// Step 4.
fn affine_pair(h: &Matrix3<f64>, t: &Vector3<f64>) -> Option<[Matrix3<f64>; 2]> {
    let distance = t.norm();
    if !(distance > 1e-12) {
        return None;
    }
    let c = t / distance;
    let (x, y) = (h.column(0).into_owned(), h.column(1).into_owned());
    let (jx, jy) = (x - c * c.dot(&x), y - c * c.dot(&y));
    let (a, b, d) = (jx.norm_squared(), jx.dot(&jy), jy.norm_squared());
    let half = 0.5 * (a - d);
    let root = sqrt(half * half + b * b);
    let largest = 0.5 * (a + d) + root;
    if !(largest > 0.0) {
        return None;
    }
    // q q' = I - J'J / largest
    let (qxx, qyy, qxy) = ((1.0 - a / largest).max(0.0), (1.0 - d / largest).max(0.0), -b / largest);
    let s = 1.0 / sqrt(largest);
    let (qx, qy) = (sqrt(qxx), sqrt(qyy).copysign(qxy));
    let build = |sign: f64| {
        let columns =
            Matrix3::from_columns(&[jx * s + c * (sign * qx), jy * s + c * (sign * qy), Vector3::zeros()]);
        orthonormal(&columns)
    };
    Some([build(1.0)?, build(-1.0)?])
}
