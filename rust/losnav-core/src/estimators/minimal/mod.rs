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

use crate::estimators::least_squares::PoseState;
use crate::math::so3::{dcm_from_quaternion, normalized};

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

impl From<Pose> for PoseState<f64> {
    fn from(pose: Pose) -> Self {
        Self { position: pose.position.into(), attitude: quaternion_from_dcm(&pose.dcm) }
    }
}

impl From<PoseState<f64>> for Pose {
    fn from(state: PoseState<f64>) -> Self {
        let [x, y, z] = dcm_from_quaternion(state.attitude);
        Self {
            position: state.position.into(),
            dcm: Matrix3::new(x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]),
        }
    }
}

/// Unit quaternion, scalar last, of a rotation matrix \[BN\], from its largest component (Shepperd 1978).
fn quaternion_from_dcm(c: &Matrix3<f64>) -> [f64; 4] {
    let (x, y, z) = (c[(0, 0)], c[(1, 1)], c[(2, 2)]);
    let (xy, xz, yz) = (c[(0, 1)] + c[(1, 0)], c[(0, 2)] + c[(2, 0)], c[(1, 2)] + c[(2, 1)]);
    let (wx, wy, wz) = (c[(1, 2)] - c[(2, 1)], c[(2, 0)] - c[(0, 2)], c[(0, 1)] - c[(1, 0)]);
    let trace = x + y + z;
    let q = if trace >= x.max(y).max(z) {
        [wx, wy, wz, 1.0 + trace]
    } else if x >= y && x >= z {
        [1.0 + x - y - z, xy, xz, wx]
    } else if y >= z {
        [xy, 1.0 + y - x - z, yz, wy]
    } else {
        [xz, yz, 1.0 + z - x - y, wz]
    };
    let q = if q[3] < 0.0 { q.map(|v| -v) } else { q };
    normalized(q)
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
