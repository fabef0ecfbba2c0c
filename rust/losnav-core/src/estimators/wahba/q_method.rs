//! Davenport's q-method (1968): the eigenvector of the largest eigenvalue of `K`, by Jacobi rotations.
use crate::math::jacobi::eigen;
use crate::math::so3::Quaternion;

use super::{Profile, davenport_matrix};

/// Orientation of least loss; one of them where several are.
#[must_use]
pub fn quaternion(profile: &Profile<f64>) -> Quaternion<f64> {
    eigen(&davenport_matrix(&profile.normalized())).vectors[0]
}
