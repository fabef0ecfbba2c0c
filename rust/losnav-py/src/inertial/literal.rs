//! What the predictive filter was published to expect: the measurement as a power series in time from the epoch before,
//! `h(x) + Σ Tᵏ/k! L_fᵏh`, up to the order at which an acceleration shows: one for what depends on the velocity, two else.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::Ray;
use losnav_core::math::jets::Jet;
use losnav_core::math::real::Real;
use losnav_core::models::dynamics::flow::expand;
use losnav_core::models::dynamics::strapdown::{ImuSample, Strapdown};
use losnav_core::models::nav_state::NavState;
use losnav_core::models::state::State;

use super::belief::NUMBERS;
use super::look::Speak;
use super::wide::WIDE;
use crate::dispatch::Lanes;
use crate::filter::Source;
use crate::gravity::AnyGravity;

/// Value, rate and half the second derivative.
const TERMS: usize = 3;
type Series = Jet<f64, TERMS>;

/// Adds a sample of the unit to the record of an interval: the state it starts from, the sum of its samples, their number.
pub fn note<V: Lanes, const N: usize>(start: &mut Vec<f64>, state: &NavState<V>, sample: &ImuSample<V>) {
    if start.is_empty() {
        start.extend((0..NUMBERS).map(|i| State::<V, N>::number(state, i).lane(0)));
        start.extend([0.0; 7]);
    }
    let six = sample.specific_force.iter().chain(&sample.angular_rate).map(|v| v.lane(0));
    for (sum, value) in start[NUMBERS..].iter_mut().zip(six.chain([1.0])) {
        *sum += value;
    }
}

/// The path from there under the mean of the samples; nothing if none was taken.
pub fn path(model: &Strapdown<AnyGravity>, start: &[f64]) -> Option<NavState<Series>> {
    let (numbers, rest) = start.split_at_checked(NUMBERS)?;
    let &[a, b, c, d, e, f, count] = rest else { return None };
    let mut state = NavState::origin();
    for (i, value) in numbers.iter().enumerate() {
        State::<Series, WIDE>::set_number(&mut state, i, Jet::constant(*value));
    }
    let mean = |v: f64| Jet::constant(v / count);
    let sample =
        ImuSample { specific_force: [mean(a), mean(b), mean(c)], angular_rate: [mean(d), mean(e), mean(f)] };
    let order = TERMS - 1;
    Some(expand::<f64, Strapdown<AnyGravity>, WIDE, TERMS>(model, 0.0, &state, sample, order, true))
}

/// Puts what is measured beyond the series after `dt` in the place of what is measured beyond the prediction.
///
/// # Errors
/// Where the sensor is undefined at the start.
pub fn replace<V: Lanes>(
    source: &Source,
    z: &[V],
    path: &NavState<Series>,
    dt: f64,
    rays: &mut [Ray<V>],
) -> Result<(), ModelError> {
    let z: Vec<Series> = z.iter().map(|value| Jet::constant(value.lane(0))).collect();
    let at = State::<Series, WIDE>::kinematics(path, &[[Jet::constant(0.0); 3]; 3]);
    let mut series = vec![Ray::zero(); source.rows];
    let mut innovation = vec![Jet::constant(0.0); source.rows];
    let count = Series::apart(Speak { source, z: &z, at, rays: &mut series, innovation: &mut innovation })?;
    // Blocks that are no longer there are passed over; both lists are in the order of the measurement.
    let mut from = series.iter().take(count);
    for ray in rays {
        let Some(found) = from.find(|found| found.block == ray.block) else { break };
        let order = if found.velocity().iter().any(|v| v.coefficient(0) != 0.0) { 1 } else { 2 };
        let mut sum = 0.0;
        for k in (0..=order).rev() {
            sum = sum * dt + found.innovation.coefficient(k);
        }
        ray.innovation = V::splat(sum);
    }
    Ok(())
}
