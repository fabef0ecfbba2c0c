//! The dynamics: one trait, one list. Laws and bindings iterate the list.
use crate::math::real::Real;

pub mod clohessy_wiltshire;

pub use clohessy_wiltshire::ClohessyWiltshire;

/// How a state of `N` tangent components moves: `(x, u, dt) → (x', Φ, Q)`.
///
/// The scalar is that of the state; time and the model's own constants are plain numbers, common to all lanes.
pub trait DynamicsModel<T: Real, const N: usize> {
    /// The public name.
    const NAME: &'static str;

    /// State after `dt` seconds (negative: before) under a constant control acceleration, m/s².
    fn propagate(&self, state: &[T; N], control: [T; 3], dt: f64) -> [T; N];
    /// `Φ = ∂x'/∂x`.
    fn transition(&self, state: &[T; N], control: [T; 3], dt: f64) -> [[T; N]; N];
    /// `Q`, the covariance the disturbance adds over `|dt|`.
    fn process_noise(&self, state: &[T; N], dt: f64) -> [[T; N]; N];
}

/// A model that can produce an example of itself, for the laws every model must obey.
pub trait Specimen<const N: usize>: Sized {
    /// The model, a state, a control and a time step.
    fn specimen() -> (Self, [f64; N], [f64; 3], f64);
}

/// THE list of dynamics: calls `$then!{Name: size, …}`.
#[macro_export]
macro_rules! dynamics {
    ($then:ident) => {
        $then! { ClohessyWiltshire: 6 }
    };
}
