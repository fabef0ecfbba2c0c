//! The values of the arguments: finite, in range, unit, positive, definite, distinct.
use losnav_core::models::linearization::Weight;
use nalgebra::{Cholesky, Matrix3, Vector3};

use crate::errors::BadValue;

/// A direction may carry unnormalised isotropic noise; see `losnav._arrays.UNIT_TOLERANCE`.
pub const UNIT_TOLERANCE: f64 = 1e-2;
/// Within this the direction is used as it is.
const UNIT_EXACT: f64 = 1e-15;
/// Largest coordinate of a landmark.
const LARGEST: f64 = 1e150;

/// Finite, and small enough to be squared.
pub fn check_coordinates(landmarks: &[[f64; 3]]) -> Result<(), BadValue> {
    // Written so that NaN is outside.
    let sound = |l: &[f64; 3]| (l[0].abs() <= LARGEST) & (l[1].abs() <= LARGEST) & (l[2].abs() <= LARGEST);
    if landmarks.iter().fold(true, |all, landmark| all & sound(landmark)) {
        return Ok(());
    }
    for (row, values) in landmarks.iter().enumerate() {
        check_finite("landmarks", row, values)?;
        for (column, &value) in values.iter().enumerate() {
            if value.abs() > LARGEST {
                return Err(BadValue::TooLarge { row, column, value });
            }
        }
    }
    Ok(())
}

pub fn check_finite(argument: &'static str, row: usize, values: &[f64; 3]) -> Result<(), BadValue> {
    for (column, &value) in values.iter().enumerate() {
        if !value.is_finite() {
            return Err(BadValue::NotFinite { argument, row, column, value });
        }
    }
    Ok(())
}

/// Unit vectors: the caller's memory if they are exact, a normalised copy otherwise.
pub fn check_unit<'s>(
    argument: &'static str,
    directions: &'s [[f64; 3]],
    copy: &'s mut Vec<[f64; 3]>,
) -> Result<&'s [[f64; 3]], BadValue> {
    // Written so that NaN is not exact.
    let exact = |[x, y, z]: &[f64; 3]| (x * x + y * y + z * z - 1.0).abs() <= UNIT_EXACT;
    if directions.iter().fold(true, |all, direction| all & exact(direction)) {
        return Ok(directions);
    }
    copy.clear();
    for (row, b) in directions.iter().enumerate() {
        let [x, y, z] = *b;
        let norm = (x * x + y * y + z * z).sqrt();
        let off = (norm - 1.0).abs();
        if off.is_nan() || off > UNIT_TOLERANCE {
            check_finite(argument, row, b)?;
            return Err(BadValue::NotUnit { argument, row, norm });
        }
        copy.push([x / norm, y / norm, z / norm]);
    }
    Ok(copy)
}

pub fn check_guess(values: &[f64]) -> Result<[f64; 6], BadValue> {
    let mut guess = [0.0; 6];
    for (column, (out, &value)) in guess.iter_mut().zip(values).enumerate() {
        if !value.is_finite() {
            return Err(BadValue::NotFinite { argument: "guess", row: 0, column, value });
        }
        *out = value;
    }
    Ok(guess)
}

/// `1/σ²`.
pub fn scalar_weight(sigma: f64, row: usize) -> Result<Weight<f64>, BadValue> {
    let weight = 1.0 / (sigma * sigma);
    if sigma > 0.0 && weight.is_finite() && weight > 0.0 {
        Ok(Weight::Scalar(weight))
    } else {
        Err(BadValue::NotPositive { argument: "sigma", row, value: sigma })
    }
}

/// `S` with `SᵀS = R⁻¹`. A covariance of rank 2 with its null space along the direction (tangent-plane noise) gets
/// `½ tr R` there: to first order that component of the residual is zero, so any weight serves.
pub fn full_weight(entries: &[f64; 9], los: &[f64; 3], row: usize) -> Result<Weight<f64>, BadValue> {
    let error = BadValue::NotCovariance { argument: "covariance", row };
    let given = Matrix3::from_row_slice(entries);
    let trace = given.trace();
    if !(trace.is_finite() && trace > 0.0) || (given - given.transpose()).amax() > 1e-9 * trace {
        return Err(error);
    }
    let scaled = given.symmetric_part() / trace;
    let b = Vector3::from(*los);
    let along = (scaled * b).norm();
    // A null space along the measured direction: what b'R b is for a direction a few sigma off still counts as zero.
    let regular =
        if along < 1e-2 && b.dot(&(scaled * b)) < 1e-3 { scaled + 0.5 * b * b.transpose() } else { scaled };
    let factor = Cholesky::new(regular).ok_or(error)?;
    let lower = factor.l();
    if lower.diagonal().min() < 1e-7 {
        return Err(error);
    }
    let inverse = lower.try_inverse().ok_or(error)? / trace.sqrt();
    let rows = [0, 1, 2].map(|i| [inverse[(i, 0)], inverse[(i, 1)], inverse[(i, 2)]]);
    Ok(Weight::Full(rows))
}

/// No two landmarks in one place: pairwise for a few, through a hash table for many.
pub fn check_distinct(landmarks: &[[f64; 3]], seen: &mut Vec<u32>) -> Result<(), BadValue> {
    if landmarks.len() <= 16 {
        for (second, b) in landmarks.iter().enumerate() {
            for (first, a) in landmarks[..second].iter().enumerate() {
                if a == b {
                    return Err(BadValue::Duplicate { first, second });
                }
            }
        }
        return Ok(());
    }
    let size = (4 * landmarks.len()).next_power_of_two();
    seen.clear();
    seen.resize(size, u32::MAX);
    for (second, b) in landmarks.iter().enumerate() {
        // Adding zero makes −0 and 0 the same bits, as they are the same place.
        let bits = b.map(|c| (c + 0.0).to_bits());
        let mixed = (bits[0].wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ bits[1].rotate_left(29))
            .wrapping_mul(0xBF58_476D_1CE4_E5B9)
            ^ bits[2].wrapping_mul(0x94D0_49BB_1331_11EB);
        let mut slot = (mixed >> 20) as usize & (size - 1);
        while let Some(&first) = seen.get(slot) {
            if first == u32::MAX {
                break;
            }
            if landmarks.get(first as usize) == Some(b) {
                return Err(BadValue::Duplicate { first: first as usize, second });
            }
            slot = (slot + 1) & (size - 1);
        }
        seen[slot] = second as u32;
    }
    Ok(())
}
