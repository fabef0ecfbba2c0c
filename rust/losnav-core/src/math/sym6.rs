//! Symmetric 6×6 matrices, packed, and their straight-line LDLᵀ.
//!
//! The upper triangle row by row: `[00 01 02 03 04 05 11 12 … 55]`, 21 numbers. The factorisation is written out
//! entry by entry: with triangular loops the compiler sometimes keeps the loops, at four times the instructions.
use super::real::{Mask, Real};

/// Packed upper triangle of a symmetric 6×6 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sym6<T>(pub [T; 21]);

/// Where the diagonal entries stand in the packed triangle.
pub const DIAGONAL: [usize; 6] = [0, 6, 11, 15, 18, 20];

/// Position of entry `(i, j)`, `i ≤ j < 6`, in the packed triangle.
#[must_use]
pub const fn index(i: usize, j: usize) -> usize {
    i * (11 - i) / 2 + j
}

/// `A = L D Lᵀ` with `L` unit lower triangular.
#[derive(Clone, Copy, Debug)]
pub struct Ldl6<T> {
    /// Strict lower triangle, row by row: `[10 20 21 30 …54]`.
    lower: [T; 15],
    /// Pivots `d`.
    pivots: [T; 6],
    /// Their reciprocals.
    inverse_pivots: [T; 6],
}

impl<T: Real> Sym6<T> {
    /// All entries zero.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([T::zero(); 21])
    }

    /// Entry `(i, j)` in any order.
    #[inline(always)]
    pub fn at(&self, i: usize, j: usize) -> T {
        if i <= j { self.0[index(i, j)] } else { self.0[index(j, i)] }
    }

    /// Diagonal entries.
    #[inline(always)]
    pub fn diagonal(&self) -> [T; 6] {
        let a = &self.0;
        [a[0], a[6], a[11], a[15], a[18], a[20]]
    }

    /// The matrix with `damping × scale` added to its diagonal.
    #[inline(always)]
    #[must_use]
    pub fn damped(&self, damping: T, scale: &[T; 6]) -> Self {
        let mut a = *self;
        a.0[0] = damping.mul_add(scale[0], a.0[0]);
        a.0[6] = damping.mul_add(scale[1], a.0[6]);
        a.0[11] = damping.mul_add(scale[2], a.0[11]);
        a.0[15] = damping.mul_add(scale[3], a.0[15]);
        a.0[18] = damping.mul_add(scale[4], a.0[18]);
        a.0[20] = damping.mul_add(scale[5], a.0[20]);
        a
    }

    /// The sum over the lanes, in every lane of `S`.
    #[inline(always)]
    pub fn sum_lanes<S: Real>(&self) -> Sym6<S> {
        let mut sum = Sym6::zero();
        for i in 0..21 {
            sum.0[i] = S::splat(self.0[i].sum_lanes());
        }
        sum
    }

    /// Entry by entry sum.
    #[inline(always)]
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let mut sum = *self;
        for i in 0..21 {
            sum.0[i] += other.0[i];
        }
        sum
    }

    /// Factors the matrix; [`Ldl6::positive`] tells whether it is positive definite.
    #[inline(always)]
    pub fn ldl(&self) -> Ldl6<T> {
        let a = &self.0;
        let d0 = a[0];
        let r0 = d0.recip();
        let u10 = a[1];
        let l10 = u10 * r0;
        let u20 = a[2];
        let l20 = u20 * r0;
        let u30 = a[3];
        let l30 = u30 * r0;
        let u40 = a[4];
        let l40 = u40 * r0;
        let u50 = a[5];
        let l50 = u50 * r0;
        let d1 = (-l10).mul_add(u10, a[6]);
        let r1 = d1.recip();
        let u21 = (-l20).mul_add(u10, a[7]);
        let l21 = u21 * r1;
        let u31 = (-l30).mul_add(u10, a[8]);
        let l31 = u31 * r1;
        let u41 = (-l40).mul_add(u10, a[9]);
        let l41 = u41 * r1;
        let u51 = (-l50).mul_add(u10, a[10]);
        let l51 = u51 * r1;
        let d2 = (-l21).mul_add(u21, (-l20).mul_add(u20, a[11]));
        let r2 = d2.recip();
        let u32 = (-l31).mul_add(u21, (-l30).mul_add(u20, a[12]));
        let l32 = u32 * r2;
        let u42 = (-l41).mul_add(u21, (-l40).mul_add(u20, a[13]));
        let l42 = u42 * r2;
        let u52 = (-l51).mul_add(u21, (-l50).mul_add(u20, a[14]));
        let l52 = u52 * r2;
        let d3 = (-l32).mul_add(u32, (-l31).mul_add(u31, (-l30).mul_add(u30, a[15])));
        let r3 = d3.recip();
        let u43 = (-l42).mul_add(u32, (-l41).mul_add(u31, (-l40).mul_add(u30, a[16])));
        let l43 = u43 * r3;
        let u53 = (-l52).mul_add(u32, (-l51).mul_add(u31, (-l50).mul_add(u30, a[17])));
        let l53 = u53 * r3;
        let d4 = (-l43).mul_add(u43, (-l42).mul_add(u42, (-l41).mul_add(u41, (-l40).mul_add(u40, a[18]))));
        let r4 = d4.recip();
        let u54 = (-l53).mul_add(u43, (-l52).mul_add(u42, (-l51).mul_add(u41, (-l50).mul_add(u40, a[19]))));
        let l54 = u54 * r4;
        let d5 = (-l54).mul_add(
            u54,
            (-l53).mul_add(u53, (-l52).mul_add(u52, (-l51).mul_add(u51, (-l50).mul_add(u50, a[20])))),
        );
        let r5 = d5.recip();
        Ldl6 {
            lower: [l10, l20, l21, l30, l31, l32, l40, l41, l42, l43, l50, l51, l52, l53, l54],
            pivots: [d0, d1, d2, d3, d4, d5],
            inverse_pivots: [r0, r1, r2, r3, r4, r5],
        }
    }
}

impl<T: Real> Ldl6<T> {
    /// The pivots `d`.
    #[inline(always)]
    pub fn pivots(&self) -> &[T; 6] {
        &self.pivots
    }

    /// Are all pivots positive (and finite)?
    #[inline(always)]
    pub fn positive(&self) -> T::Mask {
        let (o, d) = (T::zero(), &self.pivots);
        let lower = o.lt(d[0]).and(o.lt(d[1])).and(o.lt(d[2]));
        let upper = o.lt(d[3]).and(o.lt(d[4])).and(o.lt(d[5]));
        lower.and(upper).and(d[5].is_finite())
    }

    /// `bᵀ A⁻¹ b`.
    #[inline(always)]
    pub fn inverse_norm2(&self, b: &[T; 6]) -> T {
        let (l, r) = (&self.lower, &self.inverse_pivots);
        let y0 = b[0];
        let y1 = (-l[0]).mul_add(y0, b[1]);
        let y2 = (-l[2]).mul_add(y1, (-l[1]).mul_add(y0, b[2]));
        let y3 = (-l[5]).mul_add(y2, (-l[4]).mul_add(y1, (-l[3]).mul_add(y0, b[3])));
        let y4 = (-l[9]).mul_add(y3, (-l[8]).mul_add(y2, (-l[7]).mul_add(y1, (-l[6]).mul_add(y0, b[4]))));
        let y5 = (-l[14]).mul_add(
            y4,
            (-l[13]).mul_add(y3, (-l[12]).mul_add(y2, (-l[11]).mul_add(y1, (-l[10]).mul_add(y0, b[5])))),
        );
        let first = (y0 * y0 * r[0]) + (y1 * y1 * r[1]) + (y2 * y2 * r[2]);
        first + (y3 * y3 * r[3]) + (y4 * y4 * r[4]) + (y5 * y5 * r[5])
    }

    /// Solves `A x = b`.
    #[inline(always)]
    pub fn solve(&self, b: &[T; 6]) -> [T; 6] {
        let (l, r) = (&self.lower, &self.inverse_pivots);
        let y0 = b[0];
        let y1 = (-l[0]).mul_add(y0, b[1]);
        let y2 = (-l[2]).mul_add(y1, (-l[1]).mul_add(y0, b[2]));
        let y3 = (-l[5]).mul_add(y2, (-l[4]).mul_add(y1, (-l[3]).mul_add(y0, b[3])));
        let y4 = (-l[9]).mul_add(y3, (-l[8]).mul_add(y2, (-l[7]).mul_add(y1, (-l[6]).mul_add(y0, b[4]))));
        let y5 = (-l[14]).mul_add(
            y4,
            (-l[13]).mul_add(y3, (-l[12]).mul_add(y2, (-l[11]).mul_add(y1, (-l[10]).mul_add(y0, b[5])))),
        );
        let x5 = y5 * r[5];
        let x4 = (-l[14]).mul_add(x5, y4 * r[4]);
        let x3 = (-l[9]).mul_add(x4, (-l[13]).mul_add(x5, y3 * r[3]));
        let x2 = (-l[5]).mul_add(x3, (-l[8]).mul_add(x4, (-l[12]).mul_add(x5, y2 * r[2])));
        let x1 =
            (-l[2]).mul_add(x2, (-l[4]).mul_add(x3, (-l[7]).mul_add(x4, (-l[11]).mul_add(x5, y1 * r[1]))));
        let x0 = (-l[0]).mul_add(
            x1,
            (-l[1]).mul_add(x2, (-l[3]).mul_add(x3, (-l[6]).mul_add(x4, (-l[10]).mul_add(x5, y0 * r[0])))),
        );
        [x0, x1, x2, x3, x4, x5]
    }

    /// `A⁻¹`, column by column.
    #[inline(always)]
    pub fn inverse(&self) -> Sym6<T> {
        let mut packed = [T::zero(); 21];
        for j in 0..6 {
            let mut unit = [T::zero(); 6];
            unit[j] = T::one();
            let column = self.solve(&unit);
            for i in 0..=j {
                packed[index(i, j)] = column[i];
            }
        }
        Sym6(packed)
    }
}
