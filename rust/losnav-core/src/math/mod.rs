//! Mathematics true of all rotations, directions and symmetric matrices.
pub mod real;
