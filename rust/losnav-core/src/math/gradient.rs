//! Numbers that carry their derivatives with respect to `N` variables through a kernel: forward differentiation, exact
//! to rounding.
//!
//! The values are computed by the very operations the scalar would do, so a kernel run on gradients returns the same
//! value as without, bit for bit, and takes the same steps where it chooses them.
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::real::{Real, Work};

/// A value and its gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gradient<T, const N: usize> {
    /// The number.
    pub value: T,
    /// Its derivatives.
    pub slope: [T; N],
}

impl<T: Real, const N: usize> Gradient<T, N> {
    /// A number that depends on nothing.
    #[inline(always)]
    pub fn constant(value: T) -> Self {
        Self { value, slope: [T::zero(); N] }
    }

    /// The variables themselves.
    #[inline(always)]
    pub fn variables(values: &[T; N]) -> [Self; N] {
        let mut all = [Self::constant(T::zero()); N];
        for i in 0..N {
            all[i].value = values[i];
            all[i].slope[i] = T::one();
        }
        all
    }

    /// Values and Jacobian of a vector.
    #[inline(always)]
    pub fn split<const M: usize>(vector: &[Self; M]) -> ([T; M], [[T; N]; M]) {
        let (mut values, mut jacobian) = ([T::zero(); M], [[T::zero(); N]; M]);
        for i in 0..M {
            values[i] = vector[i].value;
            jacobian[i] = vector[i].slope;
        }
        (values, jacobian)
    }

    /// `f(self)` of value and derivative there.
    #[inline(always)]
    fn chain(self, value: T, derivative: T) -> Self {
        let mut slope = self.slope;
        for s in &mut slope {
            *s = derivative * *s;
        }
        Self { value, slope }
    }
}

impl<T: Real, const N: usize> Add for Gradient<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(mut self, o: Self) -> Self {
        self += o;
        self
    }
}
impl<T: Real, const N: usize> Sub for Gradient<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(mut self, o: Self) -> Self {
        self -= o;
        self
    }
}
impl<T: Real, const N: usize> Mul for Gradient<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        let mut slope = self.slope;
        for i in 0..N {
            slope[i] = slope[i].mul_add(o.value, self.value * o.slope[i]);
        }
        Self { value: self.value * o.value, slope }
    }
}
impl<T: Real, const N: usize> Div for Gradient<T, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let (value, inverse) = (self.value / o.value, T::one() / o.value);
        let mut slope = self.slope;
        for i in 0..N {
            slope[i] = (slope[i] - value * o.slope[i]) * inverse;
        }
        Self { value, slope }
    }
}
impl<T: Real, const N: usize> Neg for Gradient<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        self.value = -self.value;
        for s in &mut self.slope {
            *s = -*s;
        }
        self
    }
}
impl<T: Real, const N: usize> AddAssign for Gradient<T, N> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        self.value += o.value;
        for i in 0..N {
            self.slope[i] += o.slope[i];
        }
    }
}
impl<T: Real, const N: usize> SubAssign for Gradient<T, N> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        self.value -= o.value;
        for i in 0..N {
            self.slope[i] -= o.slope[i];
        }
    }
}

impl<T: Real, const N: usize> Real for Gradient<T, N> {
    type Mask = T::Mask;
    const LANES: usize = T::LANES;
    const EPSILON: f64 = T::EPSILON;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::constant(T::splat(value))
    }
    #[inline(always)]
    fn lane(self, index: usize) -> f64 {
        self.value.lane(index)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        let mut slope = b.slope;
        for i in 0..N {
            slope[i] = self.slope[i].mul_add(a.value, self.value.mul_add(a.slope[i], slope[i]));
        }
        Self { value: self.value.mul_add(a.value, b.value), slope }
    }
    #[inline(always)]
    fn plus(self, factor: f64, other: Self) -> Self {
        let mut slope = self.slope;
        for i in 0..N {
            slope[i] = slope[i].plus(factor, other.slope[i]);
        }
        Self { value: self.value.plus(factor, other.value), slope }
    }
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        T::apart(work)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, T::splat(0.5) / root)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), T::one() / self.value)
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let inverse = self.value.recip();
        self.chain(inverse, -(inverse * inverse))
    }
    #[inline(always)]
    fn rsqrt(self) -> Self {
        let inverse = self.value.rsqrt();
        self.chain(inverse, T::splat(-0.5) * inverse * inverse * inverse)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.lt(Self::zero()), -self, self)
    }
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        let (sin, cos) = self.value.sine_cosine();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline(always)]
    fn arctan2(self, x: Self) -> Self {
        let inverse = x.value.mul_add(x.value, self.value * self.value).recip();
        let (by_y, by_x) = (x.value * inverse, -(self.value * inverse));
        let mut slope = self.slope;
        for i in 0..N {
            slope[i] = by_y.mul_add(slope[i], by_x * x.slope[i]);
        }
        Self { value: self.value.arctan2(x.value), slope }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self::constant(self.value.round())
    }
    #[inline(always)]
    fn lt(self, other: Self) -> T::Mask {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn le(self, other: Self) -> T::Mask {
        self.value.le(other.value)
    }
    #[inline(always)]
    fn select(mask: T::Mask, yes: Self, no: Self) -> Self {
        let mut slope = no.slope;
        for i in 0..N {
            slope[i] = T::select(mask, yes.slope[i], no.slope[i]);
        }
        Self { value: T::select(mask, yes.value, no.value), slope }
    }
    #[inline(always)]
    fn sum_lanes(self) -> f64 {
        self.value.sum_lanes()
    }
}
