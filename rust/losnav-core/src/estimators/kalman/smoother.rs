//! Rauch, Tung & Striebel (1965): what a later estimate tells about an earlier one.
use super::covariance::Covariance;
use super::{Estimate, predict_with_transition};
use crate::math::matrix::{Matrix, congruence};
use crate::math::real::{Mask, Real};
use crate::models::dynamics::DynamicsModel;
use crate::models::state::State;

/// A smoothed estimate; the covariance whole.
#[derive(Clone, Copy, Debug)]
pub struct Smoothed<T, S, const N: usize> {
    /// The state.
    pub state: S,
    /// Covariance of its error.
    pub covariance: Matrix<T, N>,
}

/// One step back.
///
/// 1. Predict again: `x⁻`, `P⁻`, `Φ`.
/// 2. `G = P Φᵀ P⁻⁻¹`, by Cholesky of `P⁻`; a `P⁻` that is not positive definite in a lane changes nothing there.
/// 3. `x + G (x_s ⊟ x⁻)`, `P + G (P_s − P⁻) Gᵀ`.
#[inline(always)]
pub fn smooth_back<T, D, P, const N: usize>(
    dynamics: &D,
    step: &D::Step,
    control: D::Control,
    filtered: &Estimate<D::State, P>,
    later: &Smoothed<T, D::State, N>,
) -> Smoothed<T, D::State, N>
where
    T: Real,
    D: DynamicsModel<T, N>,
    P: Covariance<T, N>,
{
    let (predicted, transition) = predict_with_transition(dynamics, step, control, filtered);
    let (p, before) = (filtered.covariance.matrix(), predicted.covariance.matrix());
    let (factor, definite) = cholesky(&before);
    // Row i of G solves P⁻ g = (Φ P)_i-th column.
    let mut gain = [[T::zero(); N]; N];
    for i in 0..N {
        let mut right = [T::zero(); N];
        for j in 0..N {
            for k in 0..N {
                right[j] = transition[j][k].mul_add(p[k][i], right[j]);
            }
        }
        gain[i] = solve(&factor, &right);
    }
    let ahead = later.state.minus(&predicted.state);
    let (mut delta, mut surplus) = ([T::zero(); N], [[T::zero(); N]; N]);
    for i in 0..N {
        for j in 0..N {
            delta[i] = gain[i][j].mul_add(ahead[j], delta[i]);
            surplus[i][j] = later.covariance[i][j] - before[i][j];
        }
    }
    let change = congruence(&gain, &surplus);
    let mut covariance = p;
    for i in 0..N {
        delta[i] = T::select(definite, delta[i], T::zero());
        for j in i..N {
            covariance[i][j] += T::select(definite, change[i][j], T::zero());
            covariance[j][i] = covariance[i][j];
        }
    }
    Smoothed { state: filtered.state.inject(&delta), covariance }
}

/// Lower Cholesky factor, its diagonal inverted; and where the matrix was positive definite.
#[inline(always)]
fn cholesky<T: Real, const N: usize>(m: &Matrix<T, N>) -> (Matrix<T, N>, T::Mask) {
    let mut l = [[T::zero(); N]; N];
    let mut definite = T::Mask::splat(true);
    for i in 0..N {
        for j in 0..=i {
            let mut sum = m[i][j];
            for k in 0..j {
                sum = (-l[i][k]).mul_add(l[j][k], sum);
            }
            if i == j {
                let positive = T::zero().lt(sum).and(sum.is_finite());
                definite = definite.and(positive);
                l[i][i] = T::select(positive, sum, T::one()).rsqrt();
            } else {
                l[i][j] = sum * l[j][j];
            }
        }
    }
    (l, definite)
}

/// `(L Lᵀ)⁻¹ b`.
#[inline(always)]
fn solve<T: Real, const N: usize>(l: &Matrix<T, N>, b: &[T; N]) -> [T; N] {
    let mut x = *b;
    for i in 0..N {
        for k in 0..i {
            x[i] = (-l[i][k]).mul_add(x[k], x[i]);
        }
        x[i] = x[i] * l[i][i];
    }
    for i in (0..N).rev() {
        for k in i + 1..N {
            x[i] = (-l[k][i]).mul_add(x[k], x[i]);
        }
        x[i] = x[i] * l[i][i];
    }
    x
}
