//! The one scalar trait: what a kernel may ask of a number.
//!
//! A kernel written once over [`Real`] serves as `f64` (latency), `f32` (small FPUs) and as lanes of several
//! problems (batch throughput; the lane types live above this crate because they need `unsafe` intrinsics).
//! Branches become masks: a scalar's mask is a `bool`, a lane type's one flag per lane, so the same source is
//! a branch in one and a blend in the other.
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::trig;

/// The answer to a comparison: one flag per lane.
pub trait Mask: Copy + Debug {
    /// The same flag in every lane.
    fn splat(flag: bool) -> Self;
    /// Lane-wise and.
    fn and(self, other: Self) -> Self;
    /// Lane-wise or.
    fn or(self, other: Self) -> Self;
    /// Lane-wise not.
    fn not(self) -> Self;
    /// Is any lane set?
    fn any(self) -> bool;
    /// The flag of one lane (`false` past the last).
    fn lane(self, index: usize) -> bool;
}

impl Mask for bool {
    #[inline(always)]
    fn splat(flag: bool) -> Self {
        flag
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self | other
    }
    #[inline(always)]
    fn not(self) -> Self {
        !self
    }
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
    #[inline(always)]
    fn lane(self, index: usize) -> bool {
        self && index == 0
    }
}

/// Something to do, arguments included. `run` must be `#[inline(always)]`.
pub trait Work {
    /// What comes of it.
    type Output;
    /// Does it.
    fn run(self) -> Self::Output;
}

/// The function of its own that [`Real::apart`] speaks of, for types that need no instruction set.
#[inline(never)]
fn do_apart<W: Work>(work: W) -> W::Output {
    work.run()
}

/// A real number, or several side by side.
///
/// Every method of every implementation must be `#[inline(always)]`: kernels run inside functions compiled for
/// a wider instruction set, and a call left standing would fall back to the baseline.
pub trait Real:
    Copy
    + Debug
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + Sync
    + 'static
{
    /// Result of a comparison.
    type Mask: Mask;
    /// How many numbers stand side by side.
    const LANES: usize;
    /// Rounding unit: the distance from one to the next number.
    const EPSILON: f64;

    /// The same value in every lane.
    fn splat(value: f64) -> Self;
    /// The value of one lane (NaN past the last).
    fn lane(self, index: usize) -> f64;
    /// `self · a + b`, fused where the instruction set does it in one step.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// `1/self`, within a unit in the last place or two.
    #[inline(always)]
    fn recip(self) -> Self {
        Self::one() / self
    }
    /// `1/√self`, within a unit in the last place or two.
    #[inline(always)]
    fn rsqrt(self) -> Self {
        Self::one() / self.sqrt()
    }
    /// Absolute value.
    fn abs(self) -> Self;
    /// `(sin self, cos self)`, by polynomials; what carries derivatives gives theirs instead of a polynomial's.
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        trig::sin_cos_by_polynomials(self)
    }
    /// The angle of the vector `(x, self)`, in the same way.
    #[inline(always)]
    fn arctan2(self, x: Self) -> Self {
        trig::atan2_by_polynomials(self, x)
    }
    /// The larger of two.
    fn max(self, other: Self) -> Self;
    /// The nearest whole number, half to even, of one below `1/4 EPSILON`; a constant: derivatives end here.
    fn round(self) -> Self;
    /// `self < other`, false with NaN.
    fn lt(self, other: Self) -> Self::Mask;
    /// `self <= other`, false with NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// `yes` where the mask is set, `no` elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Sum over the lanes, pairwise.
    fn sum_lanes(self) -> f64;

    /// `self + factor · other` of a plain number.
    #[inline(always)]
    fn plus(self, factor: f64, other: Self) -> Self {
        Self::splat(factor).mul_add(other, self)
    }
    /// Does large work in a function of its own, compiled for the instruction set of this type: one copy of it, however
    /// many kernels call it.
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        do_apart(work)
    }

    /// Neither infinite nor NaN.
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        self.abs().le(Self::splat(f64::MAX))
    }
    /// Zero in every lane.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    /// One in every lane.
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
}

macro_rules! scalar {
    ($t:ident) => {
        impl Real for $t {
            type Mask = bool;
            const LANES: usize = 1;
            const EPSILON: f64 = $t::EPSILON as f64;

            #[inline(always)]
            fn splat(value: f64) -> Self {
                value as $t
            }
            #[inline(always)]
            fn lane(self, index: usize) -> f64 {
                if index == 0 { f64::from(self) } else { f64::NAN }
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // Without a hardware FMA `mul_add` is a library call: ten times a product and a sum.
                self * a + b
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                num_traits::Float::sqrt(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                num_traits::Float::ln(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                num_traits::Float::abs(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if self < other { other } else { self }
            }
            #[inline(always)]
            fn round(self) -> Self {
                // The spacing of numbers is one there; without std and SSE4 rounding is a library call.
                let shift = 1.5 / $t::EPSILON;
                (self + shift) - shift
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn le(self, other: Self) -> bool {
                self <= other
            }
            #[inline(always)]
            fn select(mask: bool, yes: Self, no: Self) -> Self {
                if mask { yes } else { no }
            }
            #[inline(always)]
            fn sum_lanes(self) -> f64 {
                f64::from(self)
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                $t::is_finite(self)
            }
        }
    };
}

scalar!(f64);
scalar!(f32);
