//! `P = U D Uᵀ`, `U` unit upper triangular: half the digits suffice, and `P` cannot lose its sign.
//!
//! Measurement rows by Bierman (1977), steps in time by Thornton's weighted Gram–Schmidt (1976).
use super::covariance::{Covariance, Sparse, finite_diagonal, select};
use crate::math::matrix::{Matrix, mirrored};
use crate::math::real::{Mask, Real};
use crate::models::dynamics::DynamicsModel;

/// `D` on the diagonal, `U` above it; what is below is never read.
#[derive(Clone, Copy, Debug)]
pub struct Ud<T, const N: usize>(Matrix<T, N>);

/// `a/b`, zero where `b` is not positive: a component without uncertainty takes part in nothing.
#[inline(always)]
fn ratio<T: Real>(a: T, b: T) -> T {
    let positive = T::zero().lt(b);
    T::select(positive, a / T::select(positive, b, T::one()), T::zero())
}

/// Factors of a symmetric positive semidefinite matrix, of its upper triangle. Variances that rounding has made
/// negative count as zero; NaN stays NaN.
#[inline(always)]
fn factors<T: Real, const N: usize>(symmetric: &Matrix<T, N>) -> Matrix<T, N> {
    let mut m = *symmetric;
    for j in (0..N).rev() {
        let d = m[j][j];
        let mut u = [T::zero(); N];
        for i in 0..j {
            u[i] = ratio(m[i][j], d);
        }
        for i in 0..j {
            for k in 0..=i {
                m[k][i] = (-u[i]).mul_add(m[k][j], m[k][i]);
            }
        }
        for i in 0..j {
            m[i][j] = u[i];
        }
        m[j][j] = T::select(d.lt(T::zero()), T::zero(), d);
    }
    m
}

/// `U D Uᵀ` of the rows `W` with weights `d`: `W diag(d) Wᵀ = U D Uᵀ` (Thornton).
#[inline(always)]
fn gram_schmidt<T: Real, const N: usize>(
    mut left: Matrix<T, N>,
    left_weights: &[T; N],
    mut right: Matrix<T, N>,
    right_weights: &[T; N],
) -> Matrix<T, N> {
    let mut out = [[T::zero(); N]; N];
    for j in (0..N).rev() {
        let (mut a, mut b) = ([T::zero(); N], [T::zero(); N]);
        let mut d = T::zero();
        for k in 0..N {
            a[k] = left_weights[k] * left[j][k];
            b[k] = right_weights[k] * right[j][k];
            d = a[k].mul_add(left[j][k], b[k].mul_add(right[j][k], d));
        }
        out[j][j] = d;
        for i in 0..j {
            let mut sum = T::zero();
            for k in 0..N {
                sum = a[k].mul_add(left[i][k], b[k].mul_add(right[i][k], sum));
            }
            let u = ratio(sum, d);
            for k in 0..N {
                left[i][k] = (-u).mul_add(left[j][k], left[i][k]);
                right[i][k] = (-u).mul_add(right[j][k], right[i][k]);
            }
            out[i][j] = u;
        }
    }
    out
}

/// The diagonal, and the unit upper triangular matrix above it.
#[inline(always)]
fn split<T: Real, const N: usize>(m: &Matrix<T, N>) -> ([T; N], Matrix<T, N>) {
    let (mut d, mut u) = ([T::zero(); N], [[T::zero(); N]; N]);
    for i in 0..N {
        d[i] = m[i][i];
        u[i][i] = T::one();
        for j in i + 1..N {
            u[i][j] = m[i][j];
        }
    }
    (d, u)
}

/// All entries of a row.
#[inline(always)]
fn dense<T: Real, const N: usize, const K: usize>(h: &Sparse<T, K>) -> [T; N] {
    let mut row = [T::zero(); N];
    for k in 0..K {
        for c in 0..3 {
            if h.first[k] + c < N {
                row[h.first[k] + c] = h.part[k][c];
            }
        }
    }
    row
}

impl<T: Real, const N: usize> Covariance<T, N> for Ud<T, N> {
    #[inline(always)]
    fn new(covariance: &Matrix<T, N>) -> Self {
        Self(factors(covariance))
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
        let (d, u) = split(&self.0);
        let mut out = [[T::zero(); N]; N];
        for i in 0..N {
            for j in i..N {
                for k in j..N {
                    // Not fused: the same bits in every instruction set.
                    out[i][j] += u[i][k] * d[k] * u[j][k];
                }
            }
        }
        mirrored(&out)
    }

    #[inline(always)]
    fn propagate<D: DynamicsModel<T, N>>(
        &self,
        _dynamics: &D,
        _step: &D::Step,
        transition: &Matrix<T, N>,
        noise: &Matrix<T, N>,
    ) -> Self {
        let (d, u) = split(&self.0);
        let mut moved = [[T::zero(); N]; N];
        for i in 0..N {
            for j in 0..N {
                for k in 0..=j {
                    moved[i][j] = transition[i][k].mul_add(u[k][j], moved[i][j]);
                }
            }
        }
        let (q, v) = split(&factors(noise));
        Self(gram_schmidt(moved, &d, v, &q))
    }

    #[inline(always)]
    fn times<const K: usize>(&self, h: &Sparse<T, K>) -> [T; N] {
        let (h, (d, u)) = (dense::<T, N, K>(h), split(&self.0));
        let mut out = [T::zero(); N];
        for k in 0..N {
            let mut f = T::zero();
            for j in 0..=k {
                f = u[j][k].mul_add(h[j], f);
            }
            f = f * d[k];
            for i in 0..=k {
                out[i] = u[i][k].mul_add(f, out[i]);
            }
        }
        out
    }

    #[inline(always)]
    fn absorb<const K: usize>(&mut self, h: &Sparse<T, K>) -> (T, [T; N]) {
        let h = dense::<T, N, K>(h);
        let (mut variance, mut gain) = (T::one(), [T::zero(); N]);
        for j in 0..N {
            // f = (Uᵀ h)_j, with column j as it was.
            let mut f = h[j];
            for i in 0..j {
                f = self.0[i][j].mul_add(h[i], f);
            }
            let v = self.0[j][j] * f;
            let before = variance;
            variance = f.mul_add(v, before);
            self.0[j][j] = self.0[j][j] * (before / variance);
            let lambda = -f / before;
            for i in 0..j {
                let u = self.0[i][j];
                self.0[i][j] = gain[i].mul_add(lambda, u);
                gain[i] = u.mul_add(v, gain[i]);
            }
            gain[j] = v;
        }
        let scale = variance.recip();
        for i in 0..N {
            gain[i] = scale * gain[i];
        }
        (variance, gain)
    }

    #[inline(always)]
    fn with_block_of(&self, before: &Self, considered: &[bool; N]) -> Self {
        // What the update took from the block is put back: a positive semidefinite matrix is added.
        let (old, new) = (before.matrix(), self.matrix());
        let mut taken = [[T::zero(); N]; N];
        for i in 0..N {
            for j in i..N {
                if considered[i] && considered[j] {
                    taken[i][j] = old[i][j] - new[i][j];
                }
            }
        }
        let ((d, u), (e, v)) = (split(&self.0), split(&factors(&taken)));
        Self(gram_schmidt(u, &d, v, &e))
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        Self(select(mask, &yes.0, &no.0))
    }

    #[inline(always)]
    fn is_finite(&self) -> T::Mask {
        let mut ok = finite_diagonal(&self.0);
        for i in 0..N {
            ok = ok.and(T::zero().le(self.0[i][i]));
        }
        ok
    }
}
