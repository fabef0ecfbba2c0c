//! What can be known, without estimating it.
pub mod danger_cylinder;
pub mod diagnosis;
pub mod fisher;
pub mod information;
pub mod lie;
pub mod observability;
