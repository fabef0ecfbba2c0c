//! Square matrices of any size as plain arrays, for kernels over any [`Real`].
use super::real::Real;
use super::vec3::Mat3;

/// Rows of a square matrix.
pub type Matrix<T, const N: usize> = [[T; N]; N];

/// A symmetric matrix from its upper triangle.
#[inline(always)]
#[must_use]
pub fn mirrored<T: Real, const N: usize>(upper: &Matrix<T, N>) -> Matrix<T, N> {
    let mut whole = *upper;
    for i in 0..N {
        // Not `0..i`: loops of one length are unrolled.
        for j in 0..N {
            if j < i {
                whole[i][j] = upper[j][i];
            }
        }
    }
    whole
}

/// `A S Aᵀ`, exactly symmetric, of a symmetric `S`.
#[inline(always)]
#[must_use]
pub fn congruence<T: Real, const N: usize>(a: &Matrix<T, N>, s: &Matrix<T, N>) -> Matrix<T, N> {
    let mut out = [[T::zero(); N]; N];
    for i in 0..N {
        // Row i of A S.
        let mut row = [T::zero(); N];
        for k in 0..N {
            for j in 0..N {
                row[j] = a[i][k].mul_add(s[k][j], row[j]);
            }
        }
        for j in 0..N {
            if j >= i {
                for k in 0..N {
                    out[i][j] = row[k].mul_add(a[j][k], out[i][j]);
                }
            }
        }
    }
    mirrored(&out)
}

/// Puts a block in its place.
#[inline(always)]
pub fn put_block<T: Real, const N: usize>(
    out: &mut Matrix<T, N>,
    row: usize,
    column: usize,
    block: &Mat3<T>,
) {
    for i in 0..3 {
        for j in 0..3 {
            out[row + i][column + j] = block[i][j];
        }
    }
}
