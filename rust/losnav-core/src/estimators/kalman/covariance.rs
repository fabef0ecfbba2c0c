//! What a filter asks of a covariance, whichever form it is kept in.
use crate::math::real::Real;
use crate::models::dynamics::DynamicsModel;

/// Rows of a square matrix.
pub type Matrix<T, const N: usize> = [[T; N]; N];

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
    /// `P h`. Entries of `h` outside `used` are zero and not looked at.
    fn times(&self, h: &[T; N], used: &[bool; N]) -> [T; N];
    /// Takes a measurement row `h` of unit noise: the variance of its innovation `hᵀ P h + 1` and the gain.
    fn absorb(&mut self, h: &[T; N], used: &[bool; N]) -> (T, [T; N]);
    /// `P` with the block of the `considered` components as it is in `before`.
    #[must_use]
    fn with_block_of(&self, before: &Self, considered: &[bool; N]) -> Self;
    /// Lane-wise choice.
    #[must_use]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self;
    /// Is every variance finite?
    fn is_finite(&self) -> T::Mask;
}

/// A symmetric matrix from its upper triangle.
#[inline(always)]
#[must_use]
pub fn mirrored<T: Real, const N: usize>(upper: &Matrix<T, N>) -> Matrix<T, N> {
    let mut whole = *upper;
    for i in 0..N {
        for j in 0..i {
            whole[i][j] = upper[j][i];
        }
    }
    whole
}

/// Entries of a matrix chosen lane by lane.
#[inline(always)]
pub fn select<T: Real, const N: usize>(mask: T::Mask, yes: &Matrix<T, N>, no: &Matrix<T, N>) -> Matrix<T, N> {
    let mut chosen = *no;
    for i in 0..N {
        for j in i..N {
            chosen[i][j] = T::select(mask, yes[i][j], no[i][j]);
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
