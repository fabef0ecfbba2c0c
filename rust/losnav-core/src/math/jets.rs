//! Numbers that carry their Taylor coefficients in time through a kernel: `x(t + τ) = Σ x_k τᵏ`, exact to rounding up to
//! the order that is known.
//!
//! Coefficient `k` of a result needs coefficients up to `k` of its arguments, so a kernel run on series known to order
//! `k` gives a result to order `k`: that is how [`lie`](crate::analysis::lie) climbs from one order to the next.
//!
//! 1. A product is a convolution; quotients, roots, logarithms and angles solve the equation they are defined by, order after
//!    order (`w = a^p`: `k a₀ w_k = Σ_{j=1}^{k} (p j − (k − j)) a_j w_{k−j}`; `s' = c a'`, `c' = −s a'`).
//! 2. A number that does not move, a constant of the model, is known to every order and costs one product per coefficient.
//! 3. The leading coefficient is computed by the very operations the scalar would do, and decides every comparison.
//!
//! Each operation is a loop, compiled once for each kind of number ([`Real::apart`]): a kernel calls them.
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::real::{Real, Work};

/// The order of what is known to every order.
const EVERY: usize = usize::MAX;

/// Up to `C` Taylor coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet<T, const C: usize> {
    coefficients: [T; C],
    /// Coefficients that may differ from zero, at least one.
    len: usize,
    /// Up to here coefficients are known; beyond `len` they are zero.
    order: usize,
}

impl<T: Real, const C: usize> Jet<T, C> {
    /// A number that does not move.
    #[inline(always)]
    pub fn constant(value: T) -> Self {
        let mut coefficients = [T::zero(); C];
        coefficients[0] = value;
        Self { coefficients, len: 1, order: EVERY }
    }

    /// `start + τ`: time itself.
    #[inline(always)]
    pub fn time(start: T) -> Self {
        let mut now = Self::constant(start);
        if C > 1 {
            now.coefficients[1] = T::one();
            now.len = 2;
        }
        now
    }

    /// A number of which only the value is known yet.
    #[inline(always)]
    pub fn start(value: T) -> Self {
        Self { order: 0, ..Self::constant(value) }
    }

    /// The first `len` of these coefficients, all that is known.
    #[inline(always)]
    pub fn known(coefficients: [T; C], len: usize) -> Self {
        let len = len.clamp(1, C);
        let mut jet = Self { coefficients, len, order: len - 1 };
        for k in 0..C {
            if k >= len {
                jet.coefficients[k] = T::zero();
            }
        }
        jet
    }

    /// The number itself.
    #[inline(always)]
    pub fn value(&self) -> T {
        self.coefficients[0]
    }

    /// Coefficient of `τᵏ`; zero beyond what is known.
    #[inline(always)]
    pub fn coefficient(&self, k: usize) -> T {
        if k < C { self.coefficients[k] } else { T::zero() }
    }

    /// Order up to which it is known, at most `C − 1`.
    #[inline(always)]
    pub fn order(&self) -> usize {
        self.order.min(C - 1)
    }

    /// The same, known to a lower order only.
    #[inline(always)]
    #[must_use]
    pub fn truncated(mut self, order: usize) -> Self {
        self.order = self.order.min(order);
        if self.order < self.len - 1 {
            for k in 1..C {
                if k > self.order {
                    self.coefficients[k] = T::zero();
                }
            }
            self.len = self.order + 1;
        }
        self
    }

    /// `start + ∫ self dτ`, known to one order more.
    #[inline(always)]
    #[must_use]
    pub fn integral(&self, start: T) -> Self {
        let mut sum = Self { order: self.order.saturating_add(1), ..Self::constant(start) };
        for k in 1..C {
            if k <= self.len {
                sum.coefficients[k] = self.coefficients[k - 1] * T::splat(1.0 / k as f64);
                sum.len = k + 1;
            }
        }
        // A polynomial may have outgrown the room there is.
        if self.len == C { sum.truncated(C - 1) } else { sum }
    }

    /// A series with the first of its coefficients still alone, to be completed by [`each`](Self::each).
    #[inline(always)]
    fn function(&self, value: T) -> Self {
        let constant = self.len == 1;
        let order = if constant { self.order } else { self.order.min(C - 1) };
        let len = if constant { 1 } else { (order + 1).min(C) };
        Self { len, order, ..Self::constant(value) }
    }

    /// `d/dτ`, known to one order less; of what is known to order 0 nothing is left but a zero.
    #[inline(always)]
    fn rate(&self) -> Self {
        let order = if self.order == EVERY { EVERY } else { self.order.saturating_sub(1) };
        let mut rate = Self { order, ..Self::constant(T::zero()) };
        for k in 1..C {
            if k < self.len {
                rate.coefficients[k - 1] = self.coefficients[k] * T::splat(k as f64);
                rate.len = k;
            }
        }
        rate
    }

    /// Length and order of a product.
    #[inline(always)]
    fn span(&self, o: &Self) -> (usize, usize) {
        let (all, mut order) = (self.len + o.len - 1, self.order.min(o.order));
        if all > C {
            order = order.min(C - 1);
        }
        (all.min(order.saturating_add(1)).min(C), order)
    }
}

/// An operation in a function of its own.
macro_rules! operation {
    ($name:ident($($argument:ident),+) -> $output:ty $body:block) => {
        struct $name<'a, T, const C: usize> { $($argument: &'a Jet<T, C>),+ }

        impl<T: Real, const C: usize> Work for $name<'_, T, C> {
            type Output = $output;
            #[inline(always)]
            fn run(self) -> $output {
                let Self { $($argument),+ } = self;
                $body
            }
        }
    };
}

operation!(Sum(a, b) -> Jet<T, C> {
    let (order, mut sum) = (a.order.min(b.order), *a);
    sum.len = a.len.max(b.len);
    for k in 0..b.len.min(C) {
        sum.coefficients[k] += b.coefficients[k];
    }
    sum.truncated(order)
});

operation!(Difference(a, b) -> Jet<T, C> {
    let (order, mut sum) = (a.order.min(b.order), *a);
    sum.len = a.len.max(b.len);
    for k in 0..b.len.min(C) {
        sum.coefficients[k] -= b.coefficients[k];
    }
    sum.truncated(order)
});

// Below, inner loops run over all terms up to the order, those beyond the length being zero: bounds known to the compiler
// make them straight lines of code.

operation!(Product(a, b) -> Jet<T, C> {
    let (len, order) = a.span(b);
    let mut product = Jet { len, order, ..Jet::constant(a.coefficients[0] * b.coefficients[0]) };
    if a.len == 1 || b.len == 1 {
        let (factor, other) = if a.len == 1 { (a.coefficients[0], b) } else { (b.coefficients[0], a) };
        for k in 1..len.min(C) {
            product.coefficients[k] = factor * other.coefficients[k];
        }
        return product;
    }
    for k in 1..C {
        if k >= len {
            break;
        }
        // The first term without adding it to zero.
        let mut sum = a.coefficients[0] * b.coefficients[k];
        for j in 1..=k {
            sum = a.coefficients[j].mul_add(b.coefficients[k - j], sum);
        }
        product.coefficients[k] = sum;
    }
    product
});

operation!(ProductSum(a, b, c) -> Jet<T, C> {
    let (len, order) = a.span(b);
    let order = order.min(c.order);
    let mut sum = Jet { len: len.max(c.len), ..*c };
    if a.len == 1 || b.len == 1 {
        let (factor, other) = if a.len == 1 { (a.coefficients[0], b) } else { (b.coefficients[0], a) };
        for k in 0..len.min(C) {
            sum.coefficients[k] = other.coefficients[k].mul_add(factor, sum.coefficients[k]);
        }
        return sum.truncated(order);
    }
    for k in 0..C {
        if k >= len {
            break;
        }
        let mut term = c.coefficients[k];
        for j in 0..=k {
            term = a.coefficients[j].mul_add(b.coefficients[k - j], term);
        }
        sum.coefficients[k] = term;
    }
    sum.truncated(order)
});

operation!(Quotient(a, b) -> Jet<T, C> {
    let value = a.coefficients[0] / b.coefficients[0];
    let (mut len, mut order) = a.span(b);
    if b.len > 1 {
        order = order.min(C - 1);
        len = (order + 1).min(C);
    }
    let mut quotient = Jet { len, order, ..Jet::constant(value) };
    let inverse = if len > 1 { b.coefficients[0].recip() } else { value };
    for k in 1..C {
        if k >= len {
            break;
        }
        let mut sum = a.coefficients[k];
        for j in 1..=k {
            sum -= b.coefficients[j] * quotient.coefficients[k - j];
        }
        quotient.coefficients[k] = sum * inverse;
    }
    quotient
});

operation!(SquareRoot(a) -> Jet<T, C> {
    let mut root = a.function(a.coefficients[0].sqrt());
    let inverse = if root.len > 1 { (root.value() + root.value()).recip() } else { root.value() };
    for k in 1..C {
        if k >= root.len {
            break;
        }
        let mut sum = a.coefficients[k];
        for j in 1..k {
            sum -= root.coefficients[j] * root.coefficients[k - j];
        }
        root.coefficients[k] = sum * inverse;
    }
    root
});

operation!(InverseRoot(a) -> Jet<T, C> {
    let mut w = a.function(a.coefficients[0].rsqrt());
    let inverse = if w.len > 1 { a.coefficients[0].recip() } else { w.value() };
    for k in 1..C {
        if k >= w.len {
            break;
        }
        let mut sum = T::zero();
        for j in 1..=k {
            let weight = T::splat((0.5 * j as f64 - k as f64) / k as f64);
            sum = (weight * a.coefficients[j]).mul_add(w.coefficients[k - j], sum);
        }
        w.coefficients[k] = sum * inverse;
    }
    w
});

operation!(Inverse(a) -> Jet<T, C> {
    let mut inverse = a.function(a.coefficients[0].recip());
    for k in 1..C {
        if k >= inverse.len {
            break;
        }
        let mut sum = T::zero();
        for j in 1..=k {
            sum = a.coefficients[j].mul_add(inverse.coefficients[k - j], sum);
        }
        inverse.coefficients[k] = -(sum * inverse.coefficients[0]);
    }
    inverse
});

operation!(Logarithm(a) -> Jet<T, C> {
    let mut log = a.function(a.coefficients[0].ln());
    let inverse = if log.len > 1 { a.coefficients[0].recip() } else { log.value() };
    for k in 1..C {
        if k >= log.len {
            break;
        }
        let mut sum = a.coefficients[k];
        for j in 1..k {
            let weight = T::splat(j as f64 / k as f64);
            sum -= weight * log.coefficients[j] * a.coefficients[k - j];
        }
        log.coefficients[k] = sum * inverse;
    }
    log
});

operation!(SineCosine(a) -> (Jet<T, C>, Jet<T, C>) {
    let (s, c) = a.value().sine_cosine();
    let (mut sin, mut cos) = (a.function(s), a.function(c));
    for k in 1..C {
        if k >= sin.len {
            break;
        }
        let (mut s, mut c) = (T::zero(), T::zero());
        for j in 1..=k {
            let turn = T::splat(j as f64 / k as f64) * a.coefficients[j];
            s = turn.mul_add(cos.coefficients[k - j], s);
            c = turn.mul_add(sin.coefficients[k - j], c);
        }
        sin.coefficients[k] = s;
        cos.coefficients[k] = -c;
    }
    (sin, cos)
});

operation!(Angle(y, x) -> Jet<T, C> {
    let angle = y.value().arctan2(x.value());
    if y.order.min(x.order) == 0 {
        return Jet::start(angle);
    }
    // θ' = (x y' − y x')/(x² + y²).
    let (dx, dy) = (x.rate(), y.rate());
    let swept = *x * dy - *y * dx;
    (swept / x.mul_add(*x, *y * *y)).integral(angle)
});

impl<T: Real, const C: usize> Add for Jet<T, C> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        T::apart(Sum { a: &self, b: &o })
    }
}
impl<T: Real, const C: usize> Sub for Jet<T, C> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        T::apart(Difference { a: &self, b: &o })
    }
}
impl<T: Real, const C: usize> Mul for Jet<T, C> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        T::apart(Product { a: &self, b: &o })
    }
}
impl<T: Real, const C: usize> Div for Jet<T, C> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        T::apart(Quotient { a: &self, b: &o })
    }
}
impl<T: Real, const C: usize> Neg for Jet<T, C> {
    type Output = Self;
    #[inline(always)]
    fn neg(mut self) -> Self {
        for k in 0..C {
            if k < self.len {
                self.coefficients[k] = -self.coefficients[k];
            }
        }
        self
    }
}
impl<T: Real, const C: usize> AddAssign for Jet<T, C> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}
impl<T: Real, const C: usize> SubAssign for Jet<T, C> {
    #[inline(always)]
    fn sub_assign(&mut self, o: Self) {
        *self = *self - o;
    }
}

impl<T: Real, const C: usize> Real for Jet<T, C> {
    type Mask = T::Mask;
    const LANES: usize = T::LANES;
    const EPSILON: f64 = T::EPSILON;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self::constant(T::splat(value))
    }
    #[inline(always)]
    fn lane(self, index: usize) -> f64 {
        self.value().lane(index)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        T::apart(ProductSum { a: &self, b: &a, c: &b })
    }
    #[inline(always)]
    fn plus(self, factor: f64, other: Self) -> Self {
        let order = self.order.min(other.order);
        let mut sum = self;
        sum.len = self.len.max(other.len);
        for k in 0..C {
            if k < other.len {
                sum.coefficients[k] = self.coefficients[k].plus(factor, other.coefficients[k]);
            }
        }
        sum.truncated(order)
    }
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        T::apart(work)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        T::apart(SquareRoot { a: &self })
    }
    #[inline(always)]
    fn ln(self) -> Self {
        T::apart(Logarithm { a: &self })
    }
    #[inline(always)]
    fn recip(self) -> Self {
        T::apart(Inverse { a: &self })
    }
    #[inline(always)]
    fn rsqrt(self) -> Self {
        T::apart(InverseRoot { a: &self })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self::select(self.lt(Self::zero()), -self, self)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self::select(self.lt(other), other, self)
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self::constant(self.value().round())
    }
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        T::apart(SineCosine { a: &self })
    }
    #[inline(always)]
    fn arctan2(self, x: Self) -> Self {
        T::apart(Angle { y: &self, x: &x })
    }
    #[inline(always)]
    fn lt(self, other: Self) -> T::Mask {
        self.value().lt(other.value())
    }
    #[inline(always)]
    fn le(self, other: Self) -> T::Mask {
        self.value().le(other.value())
    }
    #[inline(always)]
    fn select(mask: T::Mask, yes: Self, no: Self) -> Self {
        let (order, len) = (yes.order.min(no.order), yes.len.max(no.len));
        let mut chosen = Self { len, order, ..no };
        for k in 0..C {
            if k < len {
                chosen.coefficients[k] = T::select(mask, yes.coefficients[k], no.coefficients[k]);
            }
        }
        chosen.truncated(order)
    }
    #[inline(always)]
    fn sum_lanes(self) -> f64 {
        self.value().sum_lanes()
    }
}
