//! Lie derivatives of what sensors see along the flow of a model: `L_f⁰h = h`, `L_fᵏh = ∂(L_fᵏ⁻¹h)/∂x f`, the `k`-th
//! derivative of the measurement in time (Hermann & Krener 1977), and their gradients, exact to rounding.
//!
//! 1. The state, [`seeded`] with a direction, is expanded in a power series along the flow
//!    ([`expand`](crate::models::dynamics::flow::expand)); derivatives with respect to the start go through the same recursion.
//! 2. A sensor [`see`]s the series and answers with one: `L_fᵏh = k! h_k`, its gradient along the direction what `h_k` carries.
//! 3. A sensor that looks at more than the position answers to a lower order than asked for; it is shown the series again,
//!    every part of it known to the full order.
//!
//! The attitude of a state that has none is a constant: body axes do not turn.
use crate::error::ModelError;
use crate::math::gradient::Gradient;
use crate::math::jets::Jet;
use crate::math::real::Real;
use crate::models::kinematics::Kinematics;
use crate::models::linearization::Innovations;
use crate::models::sensors::SensorModel;
use crate::models::state::State;

/// A series in time whose coefficients carry the derivative along one direction (each lane its own).
pub type Series<T, const C: usize> = Jet<Gradient<T, 1>, C>;

/// A number that neither moves nor depends on anything.
#[inline(always)]
#[must_use]
pub fn still<T: Real, const C: usize>(value: f64) -> Series<T, C> {
    Jet::constant(Gradient::constant(T::splat(value)))
}

/// The state moved along `direction` of its tangent by a number whose value is zero and whose derivative is one.
#[inline(always)]
pub fn seeded<T, S, const N: usize, const C: usize>(state: &S, direction: &[T; N]) -> S
where
    T: Real,
    S: State<Series<T, C>, N>,
{
    let mut delta = [Jet::constant(Gradient::constant(T::zero())); N];
    for i in 0..N {
        delta[i] = Jet::constant(Gradient { value: T::zero(), slope: [direction[i]] });
    }
    state.inject(&delta)
}

/// Writes what a sensor that measured zeros sees as series to `out`, and returns their least order.
///
/// # Errors
/// Where the measurement is undefined.
#[inline(always)]
pub fn see<T: Real, const C: usize>(
    sensor: &impl SensorModel<Jet<T, C>>,
    x: &Kinematics<Jet<T, C>>,
    out: &mut [Jet<T, C>],
) -> Result<usize, ModelError> {
    sensor.linearize(x, &mut Innovations::new(out))?;
    let mut least = C - 1;
    for row in out {
        least = least.min(row.order());
        *row = -*row;
    }
    Ok(least)
}

/// `k!`.
#[must_use]
pub fn factorial(k: usize) -> f64 {
    let mut product = 1.0;
    for j in 2..=k {
        product *= j as f64;
    }
    product
}
