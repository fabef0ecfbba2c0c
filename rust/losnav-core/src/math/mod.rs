//! Mathematics true of all rotations, directions and symmetric matrices.
pub mod gradient;
pub mod integrator;
pub mod jacobi;
pub mod jets;
pub mod logarithm;
pub mod matrix;
pub mod real;
pub mod rotation;
pub mod so3;
pub mod svd3;
pub mod sym3;
pub mod sym6;
pub mod triangular6;
pub mod trig;
pub mod vec3;
