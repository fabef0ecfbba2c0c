//! What a filter asks of a covariance, whichever form it is kept in.
use crate::math::matrix::Matrix;
use crate::math::real::Real;
use crate::models::dynamics::DynamicsModel;

/// A row that is zero outside `K` blocks of three columns. That the blocks are known when the kernel is compiled is what
/// saves the products with zero.
#[derive(Clone, Copy, Debug)]
pub struct Sparse<T, const K: usize> {
    /// First column of each block.
    pub first: [usize; K],
    /// The blocks; columns beyond the state are not looked at.
    pub part: [[T; 3]; K],
}

impl<T: Real, const K: usize> Sparse<T, K> {
    /// `h · v`.
    #[inline(always)]
    pub fn dot<const N: usize>(&self, v: &[T; N]) -> T {
        let mut sum = T::zero();
        for k in 0..K {
            for c in 0..3 {
                if self.first[k] + c < N {
                    sum = self.part[k][c].mul_add(v[self.first[k] + c], sum);
                }
            }
        }
        sum
    }
}

/// The covariance of an estimate.
pub trait Covariance<T: Real, const N: usize>: Copy + Send + Sync {
    /// From the upper triangle of a symmetric positive definite matrix.
    fn new(covariance: &Matrix<T, N>) -> Self;
    /// From [`stored`](Self::stored) numbers.
    fn from_stored(stored: Matrix<T, N>) -> Self;
    /// The numbers it is kept in: those on and above the diagonal count.
    fn stored(&self) -> &Matrix<T, N>;
    /// The whole symmetric matrix.
    fn matrix(&self) -> Matrix<T, N>;
    /// `Φ P Φᵀ + Q`.
    #[must_use]
    fn propagate<D: DynamicsModel<T, N>>(
        &self,
        dynamics: &D,
        step: &D::Step,
        transition: &Matrix<T, N>,
        noise: &Matrix<T, N>,
    ) -> Self;
    /// `P h`.
    fn times<const K: usize>(&self, h: &Sparse<T, K>) -> [T; N];
    /// Takes a measurement row `h` of unit noise: the variance of its innovation `hᵀ P h + 1` and the gain.
    fn absorb<const K: usize>(&mut self, h: &Sparse<T, K>) -> (T, [T; N]);
    /// `P` with the block of the `considered` components as it is in `before`.
    #[must_use]
    fn with_block_of(&self, before: &Self, considered: &[bool; N]) -> Self;
    /// Lane-wise choice.
    #[must_use]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self;
    /// Is every variance finite?
    fn is_finite(&self) -> T::Mask;
}

/// Entries of a matrix chosen lane by lane.
#[inline(always)]
pub fn select<T: Real, const N: usize>(mask: T::Mask, yes: &Matrix<T, N>, no: &Matrix<T, N>) -> Matrix<T, N> {
    let mut chosen = *no;
    for i in 0..N {
        for j in 0..N {
            if j >= i {
                chosen[i][j] = T::select(mask, yes[i][j], no[i][j]);
            }
        }
    }
    chosen
}

/// Is the diagonal finite?
#[inline(always)]
pub fn finite_diagonal<T: Real, const N: usize>(m: &Matrix<T, N>) -> T::Mask {
    let mut sum = T::zero();
    for i in 0..N {
        // Zero, or NaN where the entry is infinite or NaN: one comparison for all.
        sum += m[i][i] * T::zero();
    }
    sum.is_finite()
}
