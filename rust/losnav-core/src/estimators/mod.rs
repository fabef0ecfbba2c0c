//! Estimators: everything that turns linearisations into an estimate.
mod draws;
pub mod kalman;
pub mod least_squares;
pub mod loss;
pub mod minimal;
pub mod normal_equations;
pub mod pose;
pub mod ranking;
pub mod robust;
pub mod wahba;
