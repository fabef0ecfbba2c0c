//! Markley's SVD method (J. Astronautical Sciences 36(3), 1988): `B = U Σ Vᵀ`, `A = U diag(1, 1, det U det V) Vᵀ`.
use crate::math::rotation::quaternion_from_dcm;
use crate::math::so3::Quaternion;
use crate::math::svd3::svd;
use crate::math::vec3::{Mat3, cross, dot, mul, transpose};

use super::Profile;

/// Orientation of least loss; one of them where several are.
#[must_use]
pub fn quaternion(profile: &Profile<f64>) -> Quaternion<f64> {
    let found = svd(&profile.normalized());
    let sign = determinant(&found.u) * determinant(&found.v);
    let u = found.u.map(|[x, y, z]| [x, y, sign * z]);
    quaternion_from_dcm(&mul(&u, &transpose(&found.v)))
}

/// Plus or minus one for an orthogonal matrix.
fn determinant(m: &Mat3<f64>) -> f64 {
    if dot(m[0], cross(m[1], m[2])) < 0.0 { -1.0 } else { 1.0 }
}
