//! The covariance itself, updated in Joseph's form, row by row.
//!
//! `P⁺ = (I − k hᵀ) P (I − k hᵀ)ᵀ + k kᵀ` for a row of unit noise: the sum of two positive matrices whatever the
//! rounding of the gain `k`, where `P − k hᵀ P` is a difference. Nobody else writes `I − k hᵀ`.
use super::covariance::{Covariance, Matrix, finite_diagonal, mirrored, select};
use crate::math::real::Real;
use crate::models::dynamics::DynamicsModel;

/// Upper triangle of `P`; what is below it is never read.
#[derive(Clone, Copy, Debug)]
pub struct Joseph<T, const N: usize>(Matrix<T, N>);

impl<T: Real, const N: usize> Joseph<T, N> {
    #[inline(always)]
    fn at(&self, i: usize, j: usize) -> T {
        if i <= j { self.0[i][j] } else { self.0[j][i] }
    }
}

impl<T: Real, const N: usize> Covariance<T, N> for Joseph<T, N> {
    #[inline(always)]
    fn new(covariance: &Matrix<T, N>) -> Self {
        Self(*covariance)
    }

    #[inline(always)]
    fn from_stored(stored: Matrix<T, N>) -> Self {
        Self(stored)
    }

    #[inline(always)]
    fn stored(&self) -> &Matrix<T, N> {
        &self.0
    }

    #[inline(always)]
    fn matrix(&self) -> Matrix<T, N> {
        mirrored(&self.0)
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
            for j in i..N {
                moved[i][j] += noise[i][j];
            }
        }
        Self(moved)
    }

    #[inline(always)]
    fn times(&self, h: &[T; N], used: &[bool; N]) -> [T; N] {
        let mut f = [T::zero(); N];
        for i in 0..N {
            for j in 0..N {
                if used[j] {
                    f[i] = self.at(i, j).mul_add(h[j], f[i]);
                }
            }
        }
        f
    }

    #[inline(always)]
    fn absorb(&mut self, h: &[T; N], used: &[bool; N]) -> (T, [T; N]) {
        let f = self.times(h, used);
        let mut variance = T::one();
        for j in 0..N {
            if used[j] {
                variance = h[j].mul_add(f[j], variance);
            }
        }
        let scale = variance.recip();
        let mut gain = f;
        for i in 0..N {
            gain[i] = scale * f[i];
        }
        // A = P − k fᵀ, and P⁺ = A − (A h) kᵀ + k kᵀ.
        let mut out = self.0;
        for i in 0..N {
            let mut rest = gain[i];
            for j in 0..N {
                if used[j] {
                    let a = (-gain[i]).mul_add(f[j], self.at(i, j));
                    rest = (-a).mul_add(h[j], rest);
                }
            }
            for j in i..N {
                out[i][j] = rest.mul_add(gain[j], (-gain[i]).mul_add(f[j], self.0[i][j]));
            }
        }
        self.0 = out;
        (variance, gain)
    }

    #[inline(always)]
    fn with_block_of(&self, before: &Self, considered: &[bool; N]) -> Self {
        let mut kept = *self;
        for i in 0..N {
            for j in i..N {
                if considered[i] && considered[j] {
                    kept.0[i][j] = before.0[i][j];
                }
            }
        }
        kept
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        Self(select(mask, &yes.0, &no.0))
    }

    #[inline(always)]
    fn is_finite(&self) -> T::Mask {
        finite_diagonal(&self.0)
    }
}
