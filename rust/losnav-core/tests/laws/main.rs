//! Laws that kernels, sensors and dynamics obey, checked through the very generic code that runs.
//!
//! A law iterates the lists of sensors and dynamics, so a new model signs all of them by joining its list.
mod apparent;
mod dual;
mod dynamics;
mod gravity;
mod least_squares;
mod lie;
mod normal_equations;
mod rotations;
mod scene;
mod sensors;
mod strapdown;
mod sym6;
mod trig;

/// A chain of some hundred double-precision operations, relative to the largest number in it.
pub const SAME_FORMULA: f64 = 1e-12;

/// Asserts `|a − b| ≤ tolerance · scale`; false for NaN.
#[track_caller]
pub fn assert_close(a: f64, b: f64, scale: f64, tolerance: f64) {
    assert!(
        (a - b).abs() <= tolerance * scale,
        "{a} differs from {b} by {:e} of {scale}",
        (a - b).abs() / scale
    );
}

/// Largest absolute value.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |m: f64, v| m.max(v.abs()))
}
