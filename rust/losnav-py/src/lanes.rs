//! Several numbers side by side: the lane types behind the kernels' one [`Real`] trait.
//!
//! `F64x4` needs AVX2 and FMA, `F64x8` AVX-512F; `Fused` is one number with fused multiply–add. They are explicit
//! vector types because `[f64; N]` vectorises only when the compiler happens to see it (docs/adr/0001).
//!
//! The intrinsics are `unsafe` because they must only run where the CPU has them. Every value of a lane type is made
//! and used inside a kernel entered through `crate::dispatch`, which asks the CPU first; nothing else may name
//! these types. All methods are `#[inline(always)]`, so that they become single instructions there.
#![allow(unsafe_code)]
use core::arch::x86_64::*;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use losnav_core::math::real::{Mask, Real, Work};

use crate::dispatch::Lanes;

macro_rules! operators {
    ($t:ident, $add:ident, $sub:ident, $mul:ident, $div:ident) => {
        impl Add for $t {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                // SAFETY: see the head of this file; so in every method below.
                Self(unsafe { $add(self.0, other.0) })
            }
        }
        impl Sub for $t {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self(unsafe { $sub(self.0, other.0) })
            }
        }
        impl Mul for $t {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self(unsafe { $mul(self.0, other.0) })
            }
        }
        impl Div for $t {
            type Output = Self;
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                Self(unsafe { $div(self.0, other.0) })
            }
        }
        assignments!($t);
    };
}

macro_rules! assignments {
    ($t:ident) => {
        impl AddAssign for $t {
            #[inline(always)]
            fn add_assign(&mut self, other: Self) {
                *self = *self + other;
            }
        }
        impl SubAssign for $t {
            #[inline(always)]
            fn sub_assign(&mut self, other: Self) {
                *self = *self - other;
            }
        }
    };
}

/// Four numbers (AVX2 and FMA).
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct F64x4(__m256d);

/// Four flags, each all ones or all zeros.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Mask4(__m256d);

operators!(F64x4, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd);

impl F64x4 {
    #[inline(always)]
    fn array(self) -> [f64; 4] {
        // SAFETY: four f64 in either form.
        unsafe { core::mem::transmute(self.0) }
    }
}

impl PartialEq for F64x4 {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.array() == other.array()
    }
}

impl Neg for F64x4 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(unsafe { _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)) })
    }
}

impl Mask for Mask4 {
    #[inline(always)]
    fn splat(flag: bool) -> Self {
        Self(unsafe { _mm256_castsi256_pd(_mm256_set1_epi64x(if flag { -1 } else { 0 })) })
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(unsafe { _mm256_and_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(unsafe { _mm256_or_pd(self.0, other.0) })
    }
    #[inline(always)]
    fn not(self) -> Self {
        Self(unsafe { _mm256_xor_pd(self.0, Self::splat(true).0) })
    }
    #[inline(always)]
    fn any(self) -> bool {
        unsafe { _mm256_movemask_pd(self.0) != 0 }
    }
    #[inline(always)]
    fn lane(self, index: usize) -> bool {
        unsafe { (_mm256_movemask_pd(self.0) >> index) & 1 != 0 }
    }
}

impl Real for F64x4 {
    type Mask = Mask4;
    const LANES: usize = 4;
    const EPSILON: f64 = f64::EPSILON;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(unsafe { _mm256_set1_pd(value) })
    }
    #[inline(always)]
    fn lane(self, index: usize) -> f64 {
        self.array().get(index).copied().unwrap_or(f64::NAN)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(unsafe { _mm256_fmadd_pd(self.0, a.0, b.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn ln(self) -> Self {
        let [a, b, c, d] = self.array();
        Self(unsafe { _mm256_set_pd(d.ln(), c.ln(), b.ln(), a.ln()) })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // The second operand wins on NaN, as `if self < other { other } else { self }` does.
        Self(unsafe { _mm256_max_pd(other.0, self.0) })
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self(unsafe { _mm256_round_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0) })
    }
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        unsafe { apart4(work) }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Mask4 {
        Mask4(unsafe { _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn le(self, other: Self) -> Mask4 {
        Mask4(unsafe { _mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: Mask4, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm256_blendv_pd(no.0, yes.0, mask.0) })
    }
    #[inline(always)]
    fn sum_lanes(self) -> f64 {
        unsafe {
            let pair = _mm_add_pd(_mm256_castpd256_pd128(self.0), _mm256_extractf128_pd::<1>(self.0));
            _mm_cvtsd_f64(_mm_add_sd(pair, _mm_unpackhi_pd(pair, pair)))
        }
    }
}

impl Lanes for F64x4 {
    #[inline(always)]
    fn gather(pick: impl Fn(usize) -> f64) -> Self {
        // Set from registers: lanes written one by one through memory would stall the load.
        Self(unsafe { _mm256_set_pd(pick(3), pick(2), pick(1), pick(0)) })
    }
    #[inline(always)]
    fn read(data: &[f64]) -> Self {
        let values = data.first_chunk::<4>().unwrap_or(&[f64::NAN; 4]);
        // SAFETY: as many f64 in either form.
        Self(unsafe { core::mem::transmute::<[f64; 4], __m256d>(*values) })
    }
    #[inline(always)]
    fn write(self, out: &mut [f64]) {
        if let Some(out) = out.first_chunk_mut::<4>() {
            *out = self.array();
        }
    }
}

/// Eight numbers (AVX-512F).
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct F64x8(__m512d);

/// Eight flags.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Mask8(__mmask8);

operators!(F64x8, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd);

impl F64x8 {
    #[inline(always)]
    fn array(self) -> [f64; 8] {
        // SAFETY: eight f64 in either form.
        unsafe { core::mem::transmute(self.0) }
    }
}

impl PartialEq for F64x8 {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        self.array() == other.array()
    }
}

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(unsafe {
            _mm512_castsi512_pd(_mm512_xor_si512(_mm512_castpd_si512(self.0), _mm512_set1_epi64(i64::MIN)))
        })
    }
}

impl Mask for Mask8 {
    #[inline(always)]
    fn splat(flag: bool) -> Self {
        Self(if flag { 0xff } else { 0 })
    }
    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.0 != 0
    }
    #[inline(always)]
    fn lane(self, index: usize) -> bool {
        (self.0 >> index) & 1 != 0
    }
}

impl Real for F64x8 {
    type Mask = Mask8;
    const LANES: usize = 8;
    const EPSILON: f64 = f64::EPSILON;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(unsafe { _mm512_set1_pd(value) })
    }
    #[inline(always)]
    fn lane(self, index: usize) -> f64 {
        self.array().get(index).copied().unwrap_or(f64::NAN)
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(unsafe { _mm512_fmadd_pd(self.0, a.0, b.0) })
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }
    #[inline(always)]
    fn recip(self) -> Self {
        // 14 bits, then two Newton steps: a division takes the time of twenty products.
        let (two, mut y) = (Self::splat(2.0), Self(unsafe { _mm512_rcp14_pd(self.0) }));
        y = y * (-self).mul_add(y, two);
        y * (-self).mul_add(y, two)
    }
    #[inline(always)]
    fn rsqrt(self) -> Self {
        let (half, three_halves) = (Self::splat(-0.5) * self, Self::splat(1.5));
        let mut y = Self(unsafe { _mm512_rsqrt14_pd(self.0) });
        y = y * (half * y).mul_add(y, three_halves);
        y * (half * y).mul_add(y, three_halves)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        let v = self.array().map(f64::ln);
        Self::gather(|i| v[i])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(unsafe { _mm512_abs_pd(self.0) })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(unsafe { _mm512_max_pd(other.0, self.0) })
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self(unsafe { _mm512_roundscale_pd::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(self.0) })
    }
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        unsafe { apart8(work) }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> Mask8 {
        Mask8(unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn le(self, other: Self) -> Mask8 {
        Mask8(unsafe { _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn select(mask: Mask8, yes: Self, no: Self) -> Self {
        Self(unsafe { _mm512_mask_blend_pd(mask.0, no.0, yes.0) })
    }
    #[inline(always)]
    fn sum_lanes(self) -> f64 {
        unsafe {
            F64x4(_mm256_add_pd(_mm512_castpd512_pd256(self.0), _mm512_extractf64x4_pd::<1>(self.0)))
                .sum_lanes()
        }
    }
}

impl Lanes for F64x8 {
    #[inline(always)]
    fn gather(pick: impl Fn(usize) -> f64) -> Self {
        Self(unsafe { _mm512_set_pd(pick(7), pick(6), pick(5), pick(4), pick(3), pick(2), pick(1), pick(0)) })
    }
    #[inline(always)]
    fn read(data: &[f64]) -> Self {
        let values = data.first_chunk::<8>().unwrap_or(&[f64::NAN; 8]);
        // SAFETY: as many f64 in either form.
        Self(unsafe { core::mem::transmute::<[f64; 8], __m512d>(*values) })
    }
    #[inline(always)]
    fn write(self, out: &mut [f64]) {
        if let Some(out) = out.first_chunk_mut::<8>() {
            *out = self.array();
        }
    }
}

/// One number whose `mul_add` is one instruction (FMA).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Fused(pub f64);

macro_rules! scalar_operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Fused {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0 $op other.0)
            }
        }
    };
}
scalar_operator!(Add, add, +);
scalar_operator!(Sub, sub, -);
scalar_operator!(Mul, mul, *);
scalar_operator!(Div, div, /);
assignments!(Fused);

impl Neg for Fused {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Real for Fused {
    type Mask = bool;
    const LANES: usize = 1;
    const EPSILON: f64 = f64::EPSILON;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(value)
    }
    #[inline(always)]
    fn lane(self, index: usize) -> f64 {
        if index == 0 { self.0 } else { f64::NAN }
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self(self.0.mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self(self.0.ln())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self.0 < other.0 { other } else { self }
    }
    #[inline(always)]
    fn round(self) -> Self {
        Self(Real::round(self.0))
    }
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        unsafe { apart4(work) }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self.0 < other.0
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self.0 <= other.0
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn sum_lanes(self) -> f64 {
        self.0
    }
}

impl Lanes for Fused {
    #[inline(always)]
    fn gather(pick: impl Fn(usize) -> f64) -> Self {
        Self(pick(0))
    }
    #[inline(always)]
    fn read(data: &[f64]) -> Self {
        Self(data.first().copied().unwrap_or(f64::NAN))
    }
    #[inline(always)]
    fn write(self, out: &mut [f64]) {
        if let [out] = out {
            *out = self.0;
        }
    }
}

/// [`Real::apart`] of the types that need AVX2 and FMA.
#[inline(never)]
#[target_feature(enable = "avx2,fma")]
fn apart4<W: Work>(work: W) -> W::Output {
    work.run()
}

/// [`Real::apart`] of the type that needs AVX-512.
#[inline(never)]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn apart8<W: Work>(work: W) -> W::Output {
    work.run()
}
