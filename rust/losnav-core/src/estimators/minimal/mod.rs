//! Guess-free poses from lines of sight: minimal and closed-form solvers.
//!
//! Model: `b = dcm (L - p) / |L - p|` with the unit line of sight `b` anywhere on the sphere (no pinhole, so no `z > 0`), the landmark `L`
//! and the position `p` in the reference frame and `dcm` = \[BN\], body from reference. A pose with `dcm (L - p)` antiparallel to some `b`
//! is the mirrored camera and never leaves this module.
//!
//! Everything here is translated and scaled inside, so kilometres, millimetres and far origins give the same answer.

// `!(x > limit)` is how NaN is refused throughout this module.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

use nalgebra::{Matrix3, Vector3};

pub mod candidates;
mod conic;
pub mod p3p;
pub mod planar;
pub mod scatter;
pub mod sqpnp;

pub use candidates::candidates;
pub use p3p::p3p;

/// Position and attitude of the observer in the reference frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position of the observer, reference frame, in the unit of the landmarks.
    pub position: Vector3<f64>,
    /// \[BN\]: takes reference-frame components to body components.
    pub dcm: Matrix3<f64>,
}

impl Pose {
    const ORIGIN: Self = Self {
        position: Vector3::new(0.0, 0.0, 0.0),
        dcm: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    };

    /// Unit line of sight from the observer to `landmark`, body components; NaN when the two coincide.
    #[inline]
    pub fn los(&self, landmark: &Vector3<f64>) -> Vector3<f64> {
        let d = self.dcm * (landmark - self.position);
        d / d.norm()
    }
}

/// At most `MAX` poses, kept on the stack.
#[derive(Clone, Copy, Debug)]
pub struct Poses<const MAX: usize> {
    items: [Pose; MAX],
    len: usize,
}

impl<const MAX: usize> Default for Poses<MAX> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const MAX: usize> Poses<MAX> {
    /// The empty list.
    #[inline]
    pub const fn new() -> Self {
        Self { items: [Pose::ORIGIN; MAX], len: 0 }
    }

    /// Appends `pose`; `false` when the list is full and the pose was dropped.
    #[inline]
    pub fn push(&mut self, pose: Pose) -> bool {
        match self.items.get_mut(self.len) {
            Some(slot) => {
                *slot = pose;
                self.len += 1;
                true
            }
            None => false,
        }
    }

    /// Number of poses held.
    #[inline]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether the list holds nothing.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The poses in the order they were pushed.
    #[inline]
    pub fn as_slice(&self) -> &[Pose] {
        self.items.get(..self.len).unwrap_or(&[])
    }

    /// Iterates over the poses in the order they were pushed.
    #[inline]
    pub fn iter(&self) -> core::slice::Iter<'_, Pose> {
        self.as_slice().iter()
    }
}

impl<'a, const MAX: usize> IntoIterator for &'a Poses<MAX> {
    type Item = &'a Pose;
    type IntoIter = core::slice::Iter<'a, Pose>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

/// Square root that is the same call with and without std.
#[inline]
fn sqrt(x: f64) -> f64 {
    num_traits::Float::sqrt(x)
}

#[cfg(test)]
mod tests;
