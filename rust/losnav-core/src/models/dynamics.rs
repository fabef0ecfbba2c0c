//! The dynamics: one trait, one list.

/// How a state of `N` tangent components moves: `(x, u, dt) → (x', Φ, Q)`.
pub trait DynamicsModel<const N: usize> {
    /// The public name.
    const NAME: &'static str;

    /// State after `dt` seconds under a constant control acceleration.
    fn propagate(&self, state: &[f64; N], control: [f64; 3], dt: f64) -> [f64; N];
    /// `Φ = ∂x'/∂x`.
    fn transition(&self, state: &[f64; N], control: [f64; 3], dt: f64) -> [[f64; N]; N];
    /// `Q` accumulated over `|dt|`.
    fn process_noise(&self, state: &[f64; N], dt: f64) -> [[f64; N]; N];
}

/// THE list of dynamics: calls `$then!{Name, …}`.
#[macro_export]
macro_rules! dynamics {
    ($then:ident) => {
        $then! { ClohessyWiltshire }
    };
}
