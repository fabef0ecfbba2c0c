//! The sensors: one trait, one list. Tests, benches and bindings iterate the list.
use super::kinematics::Kinematics;
use super::linearization::Sink;
use crate::error::ModelError;
use crate::math::real::Real;

pub mod line_of_sight;

pub use line_of_sight::LineOfSight;

/// A measurement and its model: linearises `z ⊟ h(x)` at a state.
pub trait SensorModel<T: Real> {
    /// The public name.
    const NAME: &'static str;

    /// Hands the linearisation at `x` to `sink`.
    ///
    /// # Errors
    /// Where the measurement is undefined at `x`.
    fn linearize(&self, x: &Kinematics<T>, sink: &mut impl Sink<T>) -> Result<(), ModelError>;
}

/// A sensor that can produce an example of itself, for the laws every sensor must obey.
#[cfg(test)]
pub trait Specimen<T: Real>: SensorModel<T> + Sized {
    /// Hands an example whose measurement is what it predicts at `truth` to `check`.
    fn with_specimen(truth: &Kinematics<T>, check: impl FnOnce(&Self));
}

/// THE list of sensors: calls `$then!{Name, Name, …}`.
#[macro_export]
macro_rules! sensors {
    ($then:ident) => {
        $then! { LineOfSight }
    };
}
