//! Dual numbers over any scalar: exact first derivatives through a generic kernel, second ones when nested.
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use losnav_core::math::real::Real;

/// `value + ε slope`, `ε² = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dual<T> {
    pub value: T,
    pub slope: T,
}

/// First derivatives.
pub type First = Dual<f64>;
/// Second derivatives: the inner ε in direction one, the outer in direction two.
pub type Second = Dual<Dual<f64>>;

impl First {
    /// `value` with its derivative.
    pub fn along(value: f64, slope: f64) -> Self {
        Self { value, slope }
    }
}

impl Second {
    /// `value + one ε₁ + two ε₂`.
    pub fn along(value: f64, one: f64, two: f64) -> Self {
        Self { value: First::along(value, one), slope: First::along(two, 0.0) }
    }
}

impl<T: Real> Add for Dual<T> {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { value: self.value + o.value, slope: self.slope + o.slope }
    }
}
impl<T: Real> Sub for Dual<T> {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { value: self.value - o.value, slope: self.slope - o.slope }
    }
}
impl<T: Real> Mul for Dual<T> {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self { value: self.value * o.value, slope: self.slope * o.value + self.value * o.slope }
    }
}
impl<T: Real> Div for Dual<T> {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let value = self.value / o.value;
        Self { value, slope: (self.slope - value * o.slope) / o.value }
    }
}
impl<T: Real> Neg for Dual<T> {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}
impl<T: Real> AddAssign for Dual<T> {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<T: Real> SubAssign for Dual<T> {
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<T: Real> Real for Dual<T> {
    type Mask = T::Mask;
    const LANES: usize = T::LANES;
    const EPSILON: f64 = T::EPSILON;

    fn splat(value: f64) -> Self {
        Self { value: T::splat(value), slope: T::zero() }
    }
    fn lane(self, index: usize) -> f64 {
        self.value.lane(index)
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        self * a + b
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self { value: root, slope: self.slope / (root + root) }
    }
    fn ln(self) -> Self {
        Self { value: self.value.ln(), slope: self.slope / self.value }
    }
    fn abs(self) -> Self {
        Self::select(self.lt(Self::zero()), -self, self)
    }
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    fn round(self) -> Self {
        Self { value: self.value.round(), slope: T::zero() }
    }
    fn lt(self, other: Self) -> T::Mask {
        self.value.lt(other.value)
    }
    fn le(self, other: Self) -> T::Mask {
        self.value.le(other.value)
    }
    fn select(mask: T::Mask, yes: Self, no: Self) -> Self {
        Self { value: T::select(mask, yes.value, no.value), slope: T::select(mask, yes.slope, no.slope) }
    }
    fn sum_lanes(self) -> f64 {
        self.value.sum_lanes()
    }
}

#[test]
fn the_dual_numbers_differentiate() {
    // f = ln(√x · y) − x/y + |−x| at (4, 3): f_x = 1/2x − 1/y + 1, f_xy = 1/y², f_xx = −1/2x².
    let f = |x: Second, y: Second| (x.sqrt() * y).ln() - x / y + (-x).abs();
    let mixed = f(Second::along(4.0, 1.0, 0.0), Second::along(3.0, 0.0, 1.0));
    let twice = f(Second::along(4.0, 1.0, 1.0), Second::splat(3.0));
    crate::assert_close(mixed.value.slope, 0.125 - 1.0 / 3.0 + 1.0, 1.0, 1e-15);
    crate::assert_close(mixed.slope.slope, 1.0 / 9.0, 1.0, 1e-15);
    crate::assert_close(twice.slope.slope, -0.03125, 1.0, 1e-15);
}
