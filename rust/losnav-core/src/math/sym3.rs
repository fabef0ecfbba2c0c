//! Symmetric 3×3 matrices, packed, and their straight-line LDLᵀ.
//!
//! The upper triangle row by row: `[00 01 02 11 12 22]`.
use super::real::{Mask, Real};
use super::vec3::{Mat3, Vec3, dot, mul, rotate, transpose};

/// Packed upper triangle of a symmetric 3×3 matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sym3<T>(pub [T; 6]);

/// `A = L D Lᵀ` with `L` unit lower triangular.
#[derive(Clone, Copy, Debug)]
pub struct Ldl3<T> {
    /// Strict lower triangle: `[10 20 21]`.
    lower: [T; 3],
    /// Pivots `d`.
    pivots: [T; 3],
    /// Their reciprocals.
    inverse_pivots: [T; 3],
}

impl<T: Real> Sym3<T> {
    /// All entries zero.
    #[inline(always)]
    pub fn zero() -> Self {
        Self([T::zero(); 6])
    }

    /// `½ (m + mᵀ)`.
    #[inline(always)]
    pub fn part(m: &Mat3<T>) -> Self {
        let half = T::splat(0.5);
        let mean = |a: T, b: T| half * (a + b);
        Self([
            m[0][0],
            mean(m[0][1], m[1][0]),
            mean(m[0][2], m[2][0]),
            m[1][1],
            mean(m[1][2], m[2][1]),
            m[2][2],
        ])
    }

    /// `m + w v vᵀ`.
    #[inline(always)]
    #[must_use]
    pub fn plus_outer(&self, w: T, v: Vec3<T>) -> Self {
        let (a, u) = (&self.0, [w * v[0], w * v[1], w * v[2]]);
        Self([
            u[0].mul_add(v[0], a[0]),
            u[0].mul_add(v[1], a[1]),
            u[0].mul_add(v[2], a[2]),
            u[1].mul_add(v[1], a[3]),
            u[1].mul_add(v[2], a[4]),
            u[2].mul_add(v[2], a[5]),
        ])
    }

    /// `m + w (u vᵀ + v uᵀ)`.
    #[inline(always)]
    #[must_use]
    pub fn plus_pair(&self, w: T, u: Vec3<T>, v: Vec3<T>) -> Self {
        let (a, two) = (&self.0, w + w);
        Self([
            (two * u[0]).mul_add(v[0], a[0]),
            w.mul_add(u[0].mul_add(v[1], u[1] * v[0]), a[1]),
            w.mul_add(u[0].mul_add(v[2], u[2] * v[0]), a[2]),
            (two * u[1]).mul_add(v[1], a[3]),
            w.mul_add(u[1].mul_add(v[2], u[2] * v[1]), a[4]),
            (two * u[2]).mul_add(v[2], a[5]),
        ])
    }

    /// Sum of the diagonal.
    #[inline(always)]
    pub fn trace(&self) -> T {
        self.0[0] + self.0[3] + self.0[5]
    }

    /// The full matrix.
    #[inline(always)]
    pub fn full(&self) -> Mat3<T> {
        let [a, d, e, b, f, c] = self.0;
        [[a, d, e], [d, b, f], [e, f, c]]
    }

    /// `m v`.
    #[inline(always)]
    pub fn apply(&self, v: Vec3<T>) -> Vec3<T> {
        rotate(&self.full(), v)
    }

    /// `vᵀ m v`.
    #[inline(always)]
    pub fn form(&self, v: Vec3<T>) -> T {
        dot(v, self.apply(v))
    }

    /// `a m aᵀ`: the same matrix in the axes that `a` leads to.
    #[inline(always)]
    #[must_use]
    pub fn turned(&self, a: &Mat3<T>) -> Self {
        Self::part(&mul(&mul(a, &self.full()), &transpose(a)))
    }

    /// `k I − m`.
    #[inline(always)]
    #[must_use]
    pub fn complement(&self, k: T) -> Self {
        let [a, d, e, b, f, c] = self.0;
        Self([k - a, -d, -e, k - b, -f, k - c])
    }

    /// Entry by entry multiple.
    #[inline(always)]
    #[must_use]
    pub fn scaled(&self, k: T) -> Self {
        let [a, d, e, b, f, c] = self.0;
        Self([k * a, k * d, k * e, k * b, k * f, k * c])
    }

    /// Trace of the adjugate: the sum of the principal 2×2 minors.
    #[inline(always)]
    pub fn second_invariant(&self) -> T {
        let [a, d, e, b, f, c] = self.0;
        let x = b.mul_add(c, -(f * f));
        let y = a.mul_add(c, -(e * e));
        let z = a.mul_add(b, -(d * d));
        x + y + z
    }

    /// Determinant.
    #[inline(always)]
    pub fn determinant(&self) -> T {
        let [a, d, e, b, f, c] = self.0;
        let x = b.mul_add(c, -(f * f));
        let y = d.mul_add(c, -(e * f));
        let z = d.mul_add(f, -(e * b));
        a.mul_add(x, e.mul_add(z, -(d * y)))
    }

    /// The sum over the lanes, in every lane of `S`.
    #[inline(always)]
    pub fn sum_lanes<S: Real>(&self) -> Sym3<S> {
        let mut sum = Sym3::zero();
        for i in 0..6 {
            sum.0[i] = S::splat(self.0[i].sum_lanes());
        }
        sum
    }

    /// Factors the matrix; [`Ldl3::positive`] tells whether it is positive definite.
    #[inline(always)]
    pub fn ldl(&self) -> Ldl3<T> {
        let [a, d, e, b, f, c] = self.0;
        let r0 = a.recip();
        let (l10, l20) = (d * r0, e * r0);
        let d1 = (-l10).mul_add(d, b);
        let r1 = d1.recip();
        let u21 = (-l20).mul_add(d, f);
        let l21 = u21 * r1;
        let d2 = (-l21).mul_add(u21, (-l20).mul_add(e, c));
        Ldl3 { lower: [l10, l20, l21], pivots: [a, d1, d2], inverse_pivots: [r0, r1, d2.recip()] }
    }
}

impl<T: Real> Ldl3<T> {
    /// Are all pivots positive (and finite)?
    #[inline(always)]
    pub fn positive(&self) -> T::Mask {
        let (o, d) = (T::zero(), &self.pivots);
        o.lt(d[0]).and(o.lt(d[1])).and(o.lt(d[2])).and(d[2].is_finite())
    }

    /// Product of the pivots.
    #[inline(always)]
    pub fn determinant(&self) -> T {
        self.pivots[0] * self.pivots[1] * self.pivots[2]
    }

    /// Solves `A x = b`.
    #[inline(always)]
    pub fn solve(&self, b: Vec3<T>) -> Vec3<T> {
        let (l, r) = (&self.lower, &self.inverse_pivots);
        let y1 = (-l[0]).mul_add(b[0], b[1]);
        let y2 = (-l[2]).mul_add(y1, (-l[1]).mul_add(b[0], b[2]));
        let x2 = y2 * r[2];
        let x1 = (-l[2]).mul_add(x2, y1 * r[1]);
        let x0 = (-l[0]).mul_add(x1, (-l[1]).mul_add(x2, b[0] * r[0]));
        [x0, x1, x2]
    }

    /// `A⁻¹`.
    #[inline(always)]
    pub fn inverse(&self) -> Sym3<T> {
        let (o, i) = (T::zero(), T::one());
        let [x, y, z] = [self.solve([i, o, o]), self.solve([o, i, o]), self.solve([o, o, i])];
        Sym3([x[0], y[0], z[0], y[1], z[1], z[2]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const A: Sym3<f64> = Sym3([4.0, 1.0, -0.5, 3.0, 0.25, 2.0]);

    #[test]
    fn factors_solve_and_invert() {
        let ldl = A.ldl();
        assert!(ldl.positive());
        let x = ldl.solve([1.0, -2.0, 0.5]);
        let back = A.apply(x);
        for (got, want) in back.iter().zip([1.0, -2.0, 0.5]) {
            assert!((got - want).abs() < 1e-15);
        }
        let identity = mul(&ldl.inverse().full(), &A.full());
        for i in 0..3 {
            for j in 0..3 {
                let want = if i == j { 1.0 } else { 0.0 };
                assert!((identity[i][j] - want).abs() < 1e-15);
            }
        }
    }

    #[test]
    fn invariants() {
        assert!((A.determinant() - A.ldl().determinant()).abs() < 1e-14);
        // Principal minors by hand: 4·3 − 1, 4·2 − 0.25, 3·2 − 0.0625.
        assert!((A.second_invariant() - (11.0 + 7.75 + 5.9375)).abs() < 1e-14);
        assert!(!Sym3::<f64>([1.0, 0.0, 0.0, -1.0, 0.0, 1.0]).ldl().positive());
        assert!(!Sym3([f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0]).ldl().positive());
    }
}
