//! What can be known, without estimating it.
pub mod fisher;
