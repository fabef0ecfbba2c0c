//! The filter: pure functions from an estimate to the next, over any dynamics, sensor, covariance form and scalar.
//!
//! 1. [`predict`]: `x⁻ = f(x, u)`, `P⁻ = Φ P Φᵀ + Q`.
//! 2. [`update`]: linearise `y = z ⊟ h(x)` once (once more for every iteration), take its whitened rows one after
//!    another, decide by the normalised innovation squared, and only then return the corrected estimate.
//!
//! Nothing is changed in place: a caller that does not like an answer keeps what it had. Follows Carpenter & D'Souza,
//! *Navigation Filter Best Practices*, NASA/TP-2018-219822: Joseph or UD form, underweighting, editing of
//! measurements, consider parameters.
use crate::math::matrix::Matrix;
use crate::math::real::Real;
use crate::models::dynamics::DynamicsModel;
use crate::models::state::State;

mod absorb;
mod covariance;
mod joint;
mod joseph;
mod rays;
mod rows;
mod smoother;
mod ud;
mod update;

pub use absorb::{Absorbed, absorb, gate, model_error, underweight};
pub use covariance::{Covariance, Sparse};
pub use joint::{Beside, Joint, JointCovariance, View};
pub use joseph::Joseph;
pub use rays::{BLOCK, Ray, Rays, SEEN, compress};
pub use rows::Rows;
pub use smoother::{Smoothed, smooth_back};
pub use ud::Ud;
pub use update::{Options, Updated, update, with_consider};

/// What is believed: a state and how far off it may be.
#[derive(Clone, Copy, Debug)]
pub struct Estimate<S, P> {
    /// The state.
    pub state: S,
    /// Covariance of its error, true minus estimate.
    pub covariance: P,
}

/// The estimate a step later.
#[inline(always)]
pub fn predict<T, D, P, const N: usize>(
    dynamics: &D,
    step: &D::Step,
    control: D::Control,
    estimate: &Estimate<D::State, P>,
) -> Estimate<D::State, P>
where
    T: Real,
    D: DynamicsModel<T, N>,
    P: Covariance<T, N>,
{
    predict_with_transition(dynamics, step, control, estimate).0
}

/// The estimate a step later, and the `Φ` that led there.
#[inline(always)]
fn predict_with_transition<T, D, P, const N: usize>(
    dynamics: &D,
    step: &D::Step,
    control: D::Control,
    estimate: &Estimate<D::State, P>,
) -> (Estimate<D::State, P>, Matrix<T, N>)
where
    T: Real,
    D: DynamicsModel<T, N>,
    P: Covariance<T, N>,
{
    let (state, transition, noise) = dynamics.predict(step, &estimate.state, control);
    let covariance = estimate.covariance.propagate(dynamics, step, &transition, &noise);
    (Estimate { state, covariance }, transition)
}

/// Lane-wise choice between two estimates.
#[inline(always)]
pub fn select<T, S, P, const N: usize>(
    mask: T::Mask,
    yes: &Estimate<S, P>,
    no: &Estimate<S, P>,
) -> Estimate<S, P>
where
    T: Real,
    S: State<T, N>,
    P: Covariance<T, N>,
{
    Estimate {
        state: S::select(mask, &yes.state, &no.state),
        covariance: P::select(mask, &yes.covariance, &no.covariance),
    }
}
