//! `Q` of white acceleration along a path: `Q = q ∫ Φ(T, t) G Gᵀ Φ(T, t)ᵀ dt`, `G = [0 I]ᵀ`, by Gauss's formula.
//!
//! The sum is carried along: at each node it gains `w q G Gᵀ`, between nodes it becomes `Φ Q Φᵀ`, so it is symmetric and positive
//! by construction, and composes, `Q(s + t) = Φ(t) Q(s) Φ(t)ᵀ + Q(t)`. Five nodes over a fifth of a radian leave less than 1e-14.
use num_traits::Float;

use crate::math::matrix::congruence;
use crate::math::real::{Real, Work};

/// Nodes and weights of Gauss's formula of five points over `(0, 1)`.
pub const NODES: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_55),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_43),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_55),
];
/// Panels before giving up: what is beyond is NaN.
const MAX_PANELS: usize = 100_000;

/// A path of `[r v]` and the transitions along it.
pub trait Path<T: Real> {
    /// The state after `dt` from `state` at `time`, and `Φ`.
    fn advance(&self, time: f64, dt: f64, state: &[T; 6]) -> ([T; 6], [[T; 6]; 6]);
    /// A time in which the motion turns by about a radian.
    fn pace(&self, state: &[T; 6]) -> f64;
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
            let panels = Float::ceil(left / (0.2 * path.pace(&x)));
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

/// `B` of a control held over the step, `∫ Φ(T, t) G dt`, the same way.
pub fn respond(path: &impl Path<f64>, span: f64) -> [[f64; 3]; 6] {
    let mut sum = [[0.0; 3]; 6];
    let panels = Float::ceil(Float::abs(span) / (0.2 * path.pace(&[0.0; 6])));
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
