//! The covariance itself, updated in Joseph's form, row by row.
//!
//! `P⁺ = (I − k hᵀ) P (I − k hᵀ)ᵀ + k kᵀ` for a row of unit noise: the sum of two positive matrices whatever the
//! rounding of the gain `k`, where `P − k hᵀ P` is a difference. Nobody else writes `I − k hᵀ`.
use super::covariance::{Covariance, Sparse, finite_diagonal, select};
use crate::math::matrix::{Matrix, mirrored};
use crate::math::real::Real;
use crate::models::dynamics::DynamicsModel;

/// The whole of `P`, the lower triangle always a copy of the upper: choosing between `P_ij` and `P_ji` at every entry
/// costs more than the copies.
#[derive(Clone, Copy, Debug)]
pub struct Joseph<T, const N: usize>(Matrix<T, N>);

impl<T: Real, const N: usize> Covariance<T, N> for Joseph<T, N> {
    #[inline(always)]
    fn new(covariance: &Matrix<T, N>) -> Self {
        Self(mirrored(covariance))
    }

    #[inline(always)]
    fn from_stored(stored: Matrix<T, N>) -> Self {
        Self(mirrored(&stored))
    }

    #[inline(always)]
    fn stored(&self) -> &Matrix<T, N> {
        &self.0
    }

    #[inline(always)]
    fn matrix(&self) -> Matrix<T, N> {
        self.0
    }

    #[inline(always)]
    fn propagate<D: DynamicsModel<T, N>>(
        &self,
        dynamics: &D,
        step: &D::Step,
        transition: &Matrix<T, N>,
        noise: &Matrix<T, N>,
    ) -> Self {
        let mut moved = dynamics.carry(step, transition, &self.0);
        for i in 0..N {
            for j in 0..N {
                moved[i][j] += noise[i][j];
            }
        }
        Self(moved)
    }

    #[inline(always)]
    fn times<const K: usize>(&self, h: &Sparse<T, K>) -> [T; N] {
        let mut f = [T::zero(); N];
        for i in 0..N {
            for k in 0..K {
                for c in 0..3 {
                    let j = h.first[k] + c;
                    if j < N {
                        f[i] = self.0[i][j].mul_add(h.part[k][c], f[i]);
                    }
                }
            }
        }
        f
    }

    #[inline(always)]
    fn absorb<const K: usize>(&mut self, h: &Sparse<T, K>) -> (T, [T; N]) {
        let f = self.times(h);
        let variance = T::one() + h.dot(&f);
        let scale = variance.recip();
        let mut gain = f;
        for i in 0..N {
            gain[i] = scale * f[i];
        }
        // A = P − k fᵀ, and P⁺ = A − (A h) kᵀ + k kᵀ.
        let mut out = self.0;
        for i in 0..N {
            let mut rest = gain[i];
            for k in 0..K {
                for c in 0..3 {
                    let j = h.first[k] + c;
                    if j < N {
                        let a = (-gain[i]).mul_add(f[j], self.0[i][j]);
                        rest = (-a).mul_add(h.part[k][c], rest);
                    }
                }
            }
            for j in 0..N {
                // Not `i..N`: loops of one length are unrolled.
                if j >= i {
                    out[i][j] = rest.mul_add(gain[j], (-gain[i]).mul_add(f[j], self.0[i][j]));
                }
            }
        }
        self.0 = mirrored(&out);
        (variance, gain)
    }

    #[inline(always)]
    fn with_block_of(&self, before: &Self, considered: &[bool; N]) -> Self {
        let mut kept = *self;
        for i in 0..N {
            for j in i..N {
                if considered[i] && considered[j] {
                    kept.0[i][j] = before.0[i][j];
                    kept.0[j][i] = before.0[i][j];
                }
            }
        }
        kept
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        Self(mirrored(&select(mask, &yes.0, &no.0)))
    }

    #[inline(always)]
    fn is_finite(&self) -> T::Mask {
        finite_diagonal(&self.0)
    }
}
