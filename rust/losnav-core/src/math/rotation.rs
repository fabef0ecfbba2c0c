//! Exp, Log and the maps of rotations that branch or need trigonometry, in double precision.
//!
//! Conventions as in [`so3`](super::so3), whose branch-free kernels run over any [`Real`](super::real::Real).
use num_traits::Float;

use super::so3::{Quaternion, normalized};
use super::vec3::{Mat3, Vec3, dot, mul, sub, transpose};

/// The other MRP of the same attitude, `−σ/σ²`; infinite for the zero rotation.
#[must_use]
pub fn mrp_shadow(mrp: Vec3<f64>) -> Vec3<f64> {
    // Scaling first: the square of a component may overflow or underflow where the answer does not.
    let largest = mrp.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let unit = mrp.map(|c| c / largest);
    let k = -1.0 / dot(unit, unit);
    unit.map(|c| k * c / largest)
}

/// The MRP itself if it lies inside or on the unit ball, else its shadow.
#[must_use]
pub fn mrp_inside(mrp: Vec3<f64>) -> Vec3<f64> {
    if dot(mrp, mrp) > 1.0 { mrp_shadow(mrp) } else { mrp }
}

/// Of `q` and `−q` the one with `w > 0`; at `w = 0`, a half turn, the one whose first non-zero component is positive.
#[must_use]
pub fn canonical(q: Quaternion<f64>) -> Quaternion<f64> {
    let decisive = [q[3], q[0], q[1], q[2]].into_iter().find(|c| *c != 0.0);
    // Adding zero turns −0 into 0.
    if decisive.is_some_and(|c| c < 0.0) { q.map(|c| 0.0 - c) } else { q.map(|c| c + 0.0) }
}

/// Canonical unit quaternion of a direction cosine matrix.
///
/// Shepperd's choice (1978): divide by the largest of the four components, which is at least ½, so no angle loses
/// digits, 180° included. A matrix orthonormal to `ε` gives a unit quaternion of an attitude within about `ε`.
#[must_use]
pub fn quaternion_from_dcm(dcm: &Mat3<f64>) -> Quaternion<f64> {
    let [[a, b, c], [d, e, f], [g, h, i]] = *dcm;
    let trace = a + e + i;
    let (xy, xz, yz) = (b + d, c + g, f + h);
    let (wx, wy, wz) = (f - h, g - c, b - d);
    let largest = trace.max(a).max(e).max(i);
    // Each row is the quaternion times four of its components.
    let scaled = if trace >= largest {
        [wx, wy, wz, 1.0 + trace]
    } else if a >= largest {
        [1.0 + a - e - i, xy, xz, wx]
    } else if e >= largest {
        [xy, 1.0 - a + e - i, yz, wy]
    } else {
        [xz, yz, 1.0 - a - e + i, wz]
    };
    canonical(normalized(scaled))
}

/// `Exp`: the orientation after the rotation vector `φ`, `q = [sin(|φ|/2) φ/|φ|, cos(|φ|/2)]`.
///
/// For `|φ|² < 1e-4` the series `½ − |φ|²/48 + |φ|⁴/3840`; the first term left out is below 2e-18.
#[must_use]
pub fn exp(rotation: Vec3<f64>) -> Quaternion<f64> {
    let theta2 = dot(rotation, rotation);
    let half = 0.5 * Float::sqrt(theta2);
    let k = if theta2 < 1e-4 {
        0.5 + theta2 * (theta2 / 3840.0 - 1.0 / 48.0)
    } else {
        0.5 * Float::sin(half) / half
    };
    [k * rotation[0], k * rotation[1], k * rotation[2], Float::cos(half)]
}

/// `Log`: the rotation vector of a unit quaternion, `|φ| ≤ π`: `φ = 2 atan2(|v|, w) v/|v|`.
///
/// For `|v|² < 1e-8 w²` the series `2/w (1 − |v|²/3w²)`; the first term left out is below 2e-17 relative.
#[must_use]
pub fn log(q: Quaternion<f64>) -> Vec3<f64> {
    let [x, y, z, w] = canonical(q);
    let v2 = dot([x, y, z], [x, y, z]);
    let k = if v2 < 1e-8 * w * w {
        2.0 / w * (1.0 - v2 / (3.0 * w * w))
    } else {
        let v = Float::sqrt(v2);
        2.0 * Float::atan2(v, w) / v
    };
    [k * x, k * y, k * z]
}

/// `δα` in body axes, true minus estimate: `dcm_true = Exp(−[δα×]) dcm_estimate`, equation (37), `|δα| ≤ π`.
///
/// The relative rotation is built as `I + (dcm_true − dcm_estimate) dcm_estimateᵀ`: the difference of close numbers
/// is exact, so a small error keeps every digit the two matrices hold.
#[must_use]
pub fn rotation_error(dcm_true: &Mat3<f64>, dcm_estimate: &Mat3<f64>) -> Vec3<f64> {
    let mut difference = [[0.0; 3]; 3];
    for i in 0..3 {
        difference[i] = sub(dcm_true[i], dcm_estimate[i]);
    }
    let mut relative = mul(&difference, &transpose(dcm_estimate));
    for i in 0..3 {
        relative[i][i] += 1.0;
    }
    log(quaternion_from_dcm(&relative))
}
