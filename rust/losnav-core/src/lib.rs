//! Kernels of losnav: no std, no heap, no unsafe, no panic path.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(feature = "std")]
extern crate std;

pub mod math;
