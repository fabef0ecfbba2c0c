//! Paths that are known beforehand: a body's positions as polynomials of degree 7 in time, piece after piece.
//!
//! Who makes the pieces goes through samples of position and velocity; between samples a hundredth of the period apart that
//! leaves millimetres for a planet. Time is a plain number, or a series in time.
use crate::math::real::Real;
use crate::math::vec3::Vec3;

/// Numbers of a polynomial.
pub const TERMS: usize = 8;

/// One polynomial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Epoch it begins, s.
    pub start: f64,
    /// How long it lasts, s.
    pub length: f64,
    /// Of each axis, in the share of the piece that has passed, constant first, m.
    pub coefficients: [[f64; TERMS]; 3],
}

impl Piece {
    /// Position at `time`, m.
    #[must_use]
    pub fn position<T: Real>(&self, time: T) -> Vec3<T> {
        let share = (time - T::splat(self.start)) / T::splat(self.length);
        let mut place = [T::zero(); 3];
        for i in 0..3 {
            for k in (0..TERMS).rev() {
                place[i] = place[i] * share + T::splat(self.coefficients[i][k]);
            }
        }
        place
    }

    /// Does it speak of `time`?
    #[must_use]
    pub fn covers(&self, time: f64) -> bool {
        self.start <= time && time <= self.start + self.length
    }
}
