//! `Q` of white acceleration along a path: `Q = q ∫ Φ(T, t) G Gᵀ Φ(T, t)ᵀ dt`, `G = [0 I]ᵀ`, by Gauss's formula.
//!
//! The sum is carried along: at each node it gains `w q G Gᵀ`, between nodes it becomes `Φ Q Φᵀ`, so it is symmetric and positive
//! by construction, and composes, `Q(s + t) = Φ(t) Q(s) Φ(t)ᵀ + Q(t)`. Five nodes over a fifth of a radian leave less than 1e-14.
//!
//! Steps below a thousandth of a radian take no transition at all: with the gradient of gravity `G` at the end of the step, and
//! its rate `D` along it, `Φ_rv = s + G s³/6 − D s⁴/12`, `Φ_vv = 1 + G s²/2 − D s³/6` for what happened `s` before the end, so
//!
//! `Q_rr = T³/3 + G T⁵/15 − D T⁶/36`, `Q_rv = T²/2 + G T⁴/6 − D T⁵/20`, `Q_vv = T + G T³/3 − D T⁴/12`
//!
//! times `q`. What is left out is the fourth power of the angle, 1e-12.
use num_traits::Float;

use crate::math::gradient::Gradient;
use crate::math::matrix::congruence;
use crate::math::real::{Real, Work};
use crate::math::vec3::{Mat3, Vec3};

/// Nodes and weights of Gauss's formula of five points over `(0, 1)`.
pub const NODES: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_55),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_43),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_55),
];
/// The largest step of the series, radians.
const SHORT: f64 = 1e-3;
/// Panels before giving up: what is beyond is NaN.
const MAX_PANELS: usize = 100_000;

/// A path of `[r v]` and the transitions along it.
pub trait Path<T: Real> {
    /// The state after `dt` from `state` at `time`, and `Φ`.
    fn advance(&self, time: f64, dt: f64, state: &[T; 6]) -> ([T; 6], [[T; 6]; 6]);
    /// A time in which the motion that passes a state at `time` turns by about a radian.
    fn pace(&self, time: f64, state: &[T; 6]) -> f64;
    /// The acceleration at a place that is variable, if the path is that of inertial axes.
    #[inline(always)]
    fn gravity(&self, _time: f64, _position: Vec3<Gradient<T, 3>>) -> Option<Vec3<Gradient<T, 3>>> {
        None
    }
}

/// `Q` over `|span|` of a path that starts at `state`, at time 0.
#[inline(always)]
pub fn accumulate<T: Real>(path: &impl Path<T>, state: &[T; 6], span: f64, psd: f64) -> [[T; 6]; 6] {
    if psd == 0.0 || span == 0.0 {
        return [[T::zero(); 6]; 6];
    }
    T::apart(Sum { path, state, span, psd })
}

struct Sum<'a, P, T> {
    path: &'a P,
    state: &'a [T; 6],
    span: f64,
    psd: f64,
}

impl<T: Real, P: Path<T>> Work for Sum<'_, P, T> {
    type Output = [[T; 6]; 6];

    #[inline(always)]
    fn run(self) -> [[T; 6]; 6] {
        let Self { path, state, span, psd } = self;
        let (mut x, mut sum, mut time) = (*state, [[T::zero(); 6]; 6], 0.0);
        let direction = if span < 0.0 { -1.0 } else { 1.0 };
        for _ in 0..MAX_PANELS {
            let left = Float::abs(span - time);
            let pace = path.pace(time, &x);
            if time == 0.0
                && left <= SHORT * pace
                && let Some(sum) = short(path, state, span, psd)
            {
                return sum;
            }
            let panels = Float::ceil(left / (0.2 * pace));
            let last = panels.is_nan() || panels <= 1.0;
            if panels > MAX_PANELS as f64 {
                break;
            }
            let size = if last { left } else { left / panels };
            let mut at = 0.0;
            // From node to node, and from the last one to the end.
            for (node, weight) in NODES.into_iter().chain([(1.0, 0.0)]) {
                let (moved, phi) =
                    path.advance(time + direction * at * size, direction * (node - at) * size, &x);
                (x, sum) = (moved, congruence(&phi, &sum));
                let gain = T::splat(weight * size * psd);
                for i in 3..6 {
                    sum[i][i] += gain;
                }
                at = node;
            }
            time += direction * size;
            if last {
                return sum;
            }
        }
        [[T::splat(f64::NAN); 6]; 6]
    }
}

/// Gravity and its gradient.
#[inline(always)]
fn bent<T: Real>(path: &impl Path<T>, time: f64, position: Vec3<T>) -> Option<(Vec3<T>, Mat3<T>)> {
    Some(Gradient::split(&path.gravity(time, Gradient::variables(&position))?))
}

/// `Q` of a short step, by its series.
#[inline(always)]
fn short<T: Real>(path: &impl Path<T>, state: &[T; 6], span: f64, psd: f64) -> Option<[[T; 6]; 6]> {
    let [x, y, z, u, v, w] = *state;
    let (pull, before) = bent(path, 0.0, [x, y, z])?;
    let mut there = [x, y, z];
    for (i, speed) in [u, v, w].into_iter().enumerate() {
        there[i] = there[i].plus(span, speed).plus(0.5 * span * span, pull[i]);
    }
    let (_, after) = bent(path, span, there)?;
    // Of a step back: what came after is negative, and so are odd powers; the noise itself is positive.
    let (one, gain) = (span, if span < 0.0 { -psd } else { psd });
    let (two, three) = (one * one, one * one * one);
    let mut sum = [[T::zero(); 6]; 6];
    for i in 0..3 {
        for j in 0..3 {
            // Symmetric to the last digit.
            let (g, d) = if i <= j { (after[i][j], before[i][j]) } else { (after[j][i], before[j][i]) };
            let d = g - d;
            let plain = |value: f64| if i == j { T::splat(gain * value) } else { T::zero() };
            let bend = |a: f64, b: f64| g.plus(-b / a, d) * T::splat(gain * a);
            sum[i][j] = plain(three / 3.0) + bend(two * three / 15.0, two * three / 36.0);
            sum[i][j + 3] = plain(two / 2.0) + bend(two * two / 6.0, two * two / 20.0);
            sum[i + 3][j] = sum[i][j + 3];
            sum[i + 3][j + 3] = plain(one) + bend(three / 3.0, three / 12.0);
        }
    }
    Some(sum)
}

/// `B` of a control held over the step, `∫ Φ(T, t) G dt`, the same way.
pub fn respond(path: &impl Path<f64>, span: f64) -> [[f64; 3]; 6] {
    let mut sum = [[0.0; 3]; 6];
    let panels = Float::ceil(Float::abs(span) / (0.2 * path.pace(0.0, &[0.0; 6])));
    if panels.is_nan() || panels > MAX_PANELS as f64 {
        return [[f64::NAN; 3]; 6];
    }
    let size = span / Float::max(panels, 1.0);
    for panel in 0..panels as usize {
        let (start, mut at) = (panel as f64 * size, 0.0);
        for (node, weight) in NODES.into_iter().chain([(1.0, 0.0)]) {
            let (_, phi) = path.advance(start + at * size, (node - at) * size, &[0.0; 6]);
            let before = sum;
            sum = [[0.0; 3]; 6];
            for i in 0..6 {
                for j in 0..3 {
                    for k in 0..6 {
                        sum[i][j] += phi[i][k] * before[k][j];
                    }
                }
            }
            for i in 0..3 {
                sum[3 + i][i] += weight * size;
            }
            at = node;
        }
    }
    sum
}
