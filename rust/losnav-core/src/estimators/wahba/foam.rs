//! FOAM, the fast optimal attitude matrix (Markley, J. Astronautical Sciences 41(2), 1993).
//!
//! ```text
//! ψ(λ) = (λ² − |B|²)² − 8 λ det B − 4 |adj B|²
//! A = ((κ + |B|²) B + λ adj(B)ᵀ − B Bᵀ B) / ζ,   κ = ½ (λ² − |B|²),  ζ = κ λ − det B
//! ```
use crate::math::rotation::quaternion_from_dcm;
use crate::math::so3::Quaternion;
use crate::math::vec3::{Mat3, cross, dot, mul, transpose};

use super::characteristic::largest_root;
use super::{Profile, norm2};

/// Orientation of least loss.
#[must_use]
pub fn quaternion(profile: &Profile<f64>) -> Quaternion<f64> {
    let b = profile.normalized();
    // Rows of the cofactor matrix, adj(B)ᵀ.
    let cofactors = [cross(b[1], b[2]), cross(b[2], b[0]), cross(b[0], b[1])];
    let determinant = dot(b[0], cofactors[0]);
    let square = frobenius2(&b);
    let root =
        largest_root([2.0 * square, 8.0 * determinant, square * square - 4.0 * frobenius2(&cofactors)]);
    let kappa = 0.5 * (root * root - square);
    let zeta = kappa * root - determinant;
    let cubic = mul(&mul(&b, &transpose(&b)), &b);
    let mut dcm = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            dcm[i][j] = ((kappa + square) * b[i][j] + root * cofactors[i][j] - cubic[i][j]) / zeta;
        }
    }
    quaternion_from_dcm(&dcm)
}

fn frobenius2(m: &Mat3<f64>) -> f64 {
    norm2(m[0]) + norm2(m[1]) + norm2(m[2])
}
