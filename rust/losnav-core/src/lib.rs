//! Kernels of losnav: line-of-sight navigation without std, heap, unsafe code or panics.
//!
//! Layers, each using only those before it: [`error`] ← [`math`] ← [`models`] ← {[`estimators`], [`analysis`]}.
//! A sensor turns a state into one linearisation `(innovation, Jacobian, weight)`; least squares, filters, Fisher
//! information and the Jacobian tests are sinks of it. Frames, signs and units: see `docs/conventions.md`.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod analysis;
pub mod error;
pub mod estimators;
pub mod math;
pub mod models;
