//! One measurement of one sensor.
use super::covariance::Covariance;
use super::rows::Rows;
use super::{Estimate, select};
use crate::error::ModelError;
use crate::math::real::{Mask, Real};
use crate::math::vec3::Mat3;
use crate::models::linearization::{Both, Innovations};
use crate::models::sensors::SensorModel;
use crate::models::state::State;

/// How a measurement is taken.
#[derive(Clone, Copy, Debug)]
pub struct Options<const N: usize> {
    /// Linearisations, at least one: from the second on at the state the one before has led to (iterated filter).
    pub iterations: u32,
    /// Lear's `β ≥ 0`: the measurement errs by `R + β H P Hᵀ`, for a prior so wide that the curvature of `h` counts.
    pub underweighting: f64,
    /// Components that are uncertain but not corrected (Schmidt).
    pub consider: Option<[bool; N]>,
}

impl<const N: usize> Options<N> {
    /// One linearisation, nothing special.
    pub const PLAIN: Self = Self { iterations: 1, underweighting: 0.0, consider: None };
}

/// What a measurement did.
#[derive(Clone, Copy, Debug)]
pub struct Updated<T: Real, S, P> {
    /// The estimate after it; the one before where it was not accepted.
    pub estimate: Estimate<S, P>,
    /// Normalised innovation squared at the prior.
    pub nis: T,
    /// Its degrees of freedom: independent rows of the measurement.
    pub dof: usize,
    /// Was it within the bound, and the result finite?
    pub accepted: T::Mask,
}

/// The estimate after a measurement whose normalised innovation squared must not exceed `bound`; `z ⊟ h(x)` at the
/// prior goes to `innovation`, as far as there is room.
///
/// 1. Linearise at the prior and take all rows: that gives the normalised innovation squared, and, of a plain filter,
///    the answer.
/// 2. Linearise again, always from the same prior: there with its noise increased (underweighting), then where the
///    last pass led to (iteration). One loop, so that the kernel is there once.
/// 3. Give considered components back what they had.
/// 4. Correct the state; keep the result where it was accepted.
///
/// # Errors
/// Where the measurement is undefined at the prior.
#[inline(always)]
pub fn update<T, S, P, Z, const N: usize>(
    prior: &Estimate<S, P>,
    sensor: &Z,
    dcm: &Mat3<T>,
    options: &Options<N>,
    bound: T,
    innovation: &mut [T],
) -> Result<Updated<T, S, P>, ModelError>
where
    T: Real,
    S: State<T, N>,
    P: Covariance<T, N>,
    Z: SensorModel<T>,
{
    let zero = [T::zero(); N];
    let mut rows = Rows::new(S::COLUMNS, zero, 0.0, &prior.covariance);
    let (mut nis, mut dof, mut delta) = (T::zero(), 0, zero);
    let mut heard = Innovations::new(innovation);
    let underweighted = u32::from(options.underweighting > 0.0);
    for pass in 0..options.iterations.max(1) + underweighted {
        let base = if pass <= underweighted { zero } else { where_measured(&delta, nis) };
        if pass > 0 {
            rows = Rows::new(S::COLUMNS, base, options.underweighting, &prior.covariance);
        }
        let at = prior.state.inject(&base).kinematics(dcm);
        // The first pass fills the room, those that follow find none.
        sensor.linearize(&at, &mut Both(&mut rows, &mut heard))?;
        if pass == 0 {
            // No row at all, a camera that saw no landmark, is no measurement.
            nis = if rows.dof == 0 { T::splat(f64::NAN) } else { rows.nis };
            dof = rows.dof;
        }
        delta = corrected(&rows.delta, options);
    }
    let covariance = with_consider(&rows.covariance, &prior.covariance, options);
    let posterior = Estimate { state: prior.state.inject(&delta), covariance };
    let finite = posterior.state.is_finite().and(covariance.is_finite()).and(nis.is_finite());
    let accepted = nis.le(bound).and(finite);
    Ok(Updated { estimate: select(accepted, &posterior, prior), nis, dof, accepted })
}

/// The correction, none where there was no measurement (NaN): the prior is where the sensor stays defined.
#[inline(always)]
fn where_measured<T: Real, const N: usize>(delta: &[T; N], nis: T) -> [T; N] {
    let mut out = *delta;
    for i in 0..N {
        out[i] = T::select(nis.is_finite(), delta[i], T::zero());
    }
    out
}

/// The correction without the components that are only considered.
#[inline(always)]
fn corrected<T: Real, const N: usize>(delta: &[T; N], options: &Options<N>) -> [T; N] {
    let mut out = *delta;
    if let Some(considered) = &options.consider {
        for i in 0..N {
            if considered[i] {
                out[i] = T::zero();
            }
        }
    }
    out
}

/// The optimal update, the block of the considered components as it was: that is Schmidt's filter, since the gain of
/// the others is the optimal one and `P_cc⁻ − P_cc⁺ = K_c S K_cᵀ` is what leaving out theirs costs.
#[inline(always)]
pub fn with_consider<T: Real, P: Covariance<T, N>, const N: usize>(
    optimal: &P,
    prior: &P,
    options: &Options<N>,
) -> P {
    match &options.consider {
        Some(considered) => optimal.with_block_of(prior, considered),
        None => *optimal,
    }
}
