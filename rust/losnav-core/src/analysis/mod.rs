//! What can be known, without estimating it.
