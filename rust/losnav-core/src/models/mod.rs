//! Physical models: what is measured, how the state moves, and the one linearisation they share.
pub mod apparent;
pub mod dynamics;
pub mod ephemeris;
pub mod gravity;
pub mod kinematics;
pub mod linearization;
pub mod nav_state;
pub mod sensors;
pub mod state;
