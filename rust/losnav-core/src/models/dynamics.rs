//! The dynamics: one trait, one list. Laws and bindings iterate the list.
//!
//! Adding a model: its file here (struct, equation, the trait, a specimen), its name in [`dynamics!`](crate::dynamics),
//! its parameters in the bindings, its dataclass in Python, its propagation in the oracle of the tests.
use super::state::State;
use crate::math::matrix::{Matrix, congruence};
use crate::math::real::Real;

pub mod clohessy_wiltshire;
pub mod curvilinear;
pub mod disturbance;
pub mod field;
pub mod flow;
mod integrated;
pub mod kepler;
pub mod lvlh;
pub mod perturbed_two_body;
pub mod relative_two_body;
pub mod strapdown;
pub mod two_body;
pub mod yamanaka_ankersen;

pub use clohessy_wiltshire::ClohessyWiltshire;
pub use curvilinear::CurvilinearClohessyWiltshire;
pub use flow::Flow;
pub use perturbed_two_body::PerturbedTwoBody;
pub use relative_two_body::RelativeTwoBody;
pub use strapdown::Strapdown;
pub use two_body::TwoBody;
pub use yamanaka_ankersen::YamanakaAnkersen;

/// How a state with `N` tangent components moves: `(x, u, dt) → (x', Φ, Q)`.
///
/// The scalar is that of the state; time and the model's own constants are plain numbers, common to all lanes.
pub trait DynamicsModel<T: Real, const N: usize> {
    /// The public name.
    const NAME: &'static str;
    /// What moves.
    type State: State<T, N>;
    /// What is commanded or measured over the step: an acceleration, m/s², for orbital models.
    type Control: Copy;
    /// What a step needs whatever the state is: computed once, used by every lane, run and repetition of the step.
    type Step: Copy;

    /// Do steps depend on the time they start at? If not, equal steps are prepared once.
    const TIME_VARYING: bool = false;

    /// Prepares a step of `dt` seconds (negative: back) that starts at `time`, s.
    fn prepare(&self, time: f64, dt: f64) -> Self::Step;
    /// State at the end of the step under a constant control.
    fn propagate(&self, step: &Self::Step, state: &Self::State, control: Self::Control) -> Self::State;
    /// State at the end of the step, and `Φ = ∂x'/∂x`.
    fn transition(
        &self,
        step: &Self::Step,
        state: &Self::State,
        control: Self::Control,
    ) -> (Self::State, [[T; N]; N]);
    /// `Q`, the covariance the disturbance adds over `|dt|`: symmetric, positive semidefinite.
    fn process_noise(&self, step: &Self::Step, state: &Self::State) -> [[T; N]; N];

    /// State at the end of the step, `Φ` and `Q`: what a filter asks for at once. Override it where `Q` depends on the
    /// control, or shares work with `Φ`.
    #[inline(always)]
    fn predict(
        &self,
        step: &Self::Step,
        state: &Self::State,
        control: Self::Control,
    ) -> (Self::State, Matrix<T, N>, Matrix<T, N>) {
        let noise = self.process_noise(step, state);
        let (moved, transition) = self.transition(step, state, control);
        (moved, transition, noise)
    }

    /// `Φ P Φᵀ`, exactly symmetric, of a symmetric `P`; override it to use the zeros of `Φ`.
    #[inline(always)]
    fn carry(&self, _step: &Self::Step, transition: &[[T; N]; N], covariance: &[[T; N]; N]) -> [[T; N]; N] {
        congruence(transition, covariance)
    }
}

/// A model that can produce an example of itself, for the laws every model must obey.
pub trait Specimen<const N: usize>: Sized + DynamicsModel<f64, N> {
    /// The model, a state, a control and a time step.
    fn specimen() -> (Self, Self::State, Self::Control, f64);
}

/// THE list of dynamics: calls `$then!{Name: size, …}`. A name is a type without parameters where the macro is called: who
/// uses the list says how [`RelativeTwoBody`] keeps its fixes and [`PerturbedTwoBody`] its ephemerides by an alias.
#[macro_export]
macro_rules! dynamics {
    ($then:ident) => {
        $then! {
            ClohessyWiltshire: 6,
            CurvilinearClohessyWiltshire: 6,
            YamanakaAnkersen: 6,
            RelativeTwoBody: 6,
            TwoBody: 6,
            PerturbedTwoBody: 6,
        }
    };
}
