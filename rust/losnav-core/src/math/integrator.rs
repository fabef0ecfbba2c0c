//! Ordinary differential equations by an explicit Runge–Kutta method of order 8 with its own step (DOP853).
//!
//! 1. Take a step; estimate its error relative to the state, the largest over all lanes.
//! 2. Above one tolerance: take it again, shorter. Otherwise keep it.
//! 3. The next step is the one whose error would be the tolerance, with a margin: `h (0.9 / error^{1/8})`.
//!
//! All lanes take the same steps, chosen by the worst of them. The work is bounded; what would need more is NaN.
use num_traits::Float;

use super::real::Real;

mod tableau;

use tableau::{A, B, C, E3, E5, STAGES};

/// Steps taken or tried before giving up.
pub const MAX_STEPS: usize = 100_000;

/// `x' = f(t, x)`, with `t` counted from the start of the integration.
pub trait Rates<T: Real, const N: usize> {
    /// `f`.
    fn rates(&self, time: f64, x: &[T; N]) -> [T; N];
    /// How large an error is beside the state: one is all of it.
    fn relative(&self, error: &[T; N], x: &[T; N]) -> T;
}

/// The state after `span` (negative: back), errors of each step below `tolerance`; `first` is a guess of the first step.
#[inline(always)]
pub fn integrate<T: Real, const N: usize>(
    equation: &impl Rates<T, N>,
    start: &[T; N],
    span: f64,
    first: f64,
    tolerance: f64,
) -> [T; N] {
    let (mut x, mut done) = (*start, 0.0);
    let mut size = Float::abs(first);
    let direction = if span < 0.0 { -1.0 } else { 1.0 };
    if span == 0.0 {
        return x;
    }
    for _ in 0..MAX_STEPS {
        let left = Float::abs(span) - done;
        // A last sliver would waste a step: two halves instead.
        let last = size >= left;
        let h = if last { left } else { Float::min(size, 0.5 * left) };
        let (end, error) = step(equation, &x, direction * done, direction * h);
        let error = error / tolerance;
        let factor = 0.9 * Float::powf(Float::max(error, 1e-10), -0.125);
        if error <= 1.0 {
            x = end;
            done += h;
            if last {
                return x;
            }
            size = h * Float::min(factor, 5.0);
        } else {
            size = h * if error.is_nan() { 0.2 } else { Float::max(factor, 0.2) };
        }
        if size.is_nan() || size <= 1e-14 * Float::abs(span) {
            break;
        }
    }
    // A product, so that derivatives are NaN too.
    for value in &mut x {
        *value = *value * T::splat(f64::NAN);
    }
    x
}

/// One step, and the largest error over the lanes.
#[inline(always)]
fn step<T: Real, const N: usize>(
    equation: &impl Rates<T, N>,
    x: &[T; N],
    time: f64,
    h: f64,
) -> ([T; N], f64) {
    let mut slopes = [[T::zero(); N]; STAGES];
    for stage in 0..STAGES {
        let at = weighted(x, &slopes, &A[stage], h);
        slopes[stage] = equation.rates(time + C[stage] * h, &at);
    }
    let end = weighted(x, &slopes, &B, h);
    let zero = [T::zero(); N];
    let (five, three) = (weighted(&zero, &slopes, &E5, h), weighted(&zero, &slopes, &E3, h));
    let (five, three) = (equation.relative(&five, &end), equation.relative(&three, &end));
    // A lane that is NaN does not stop the others; all of them do.
    let mut worst = f64::NAN;
    for lane in 0..T::LANES {
        let (five, three) = (five.lane(lane), three.lane(lane));
        let whole = Float::sqrt(five * five + 0.01 * three * three);
        worst = Float::max(worst, if whole == 0.0 { 0.0 } else { five * five / whole });
    }
    (end, worst)
}

/// `x + h Σ w k`.
#[inline(always)]
fn weighted<T: Real, const N: usize>(
    x: &[T; N],
    slopes: &[[T; N]; STAGES],
    weights: &[f64; STAGES],
    h: f64,
) -> [T; N] {
    let mut sum = *x;
    for stage in 0..STAGES {
        if weights[stage] != 0.0 {
            for i in 0..N {
                sum[i] = sum[i].plus(h * weights[stage], slopes[stage][i]);
            }
        }
    }
    sum
}
