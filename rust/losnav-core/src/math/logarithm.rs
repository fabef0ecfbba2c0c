//! The logarithm of a quotient over any [`Real`], without a call to a library, accurate where the quotient is near one.
use super::real::{Mask, Real};

/// `√2`, and `ln 2` in two parts of which the first has so few digits that its multiples are exact (fdlibm).
const ROOT_TWO: f64 = core::f64::consts::SQRT_2;
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

/// `ln(p/q)` of `p = s + d`, `q = s − d`, `0 ≤ d ≤ s`, `0 < s`: relative accuracy of some units in the last place however small
/// `d`; a quotient beyond 2⁶³ counts as that.
///
/// `p/q = 2ᵏ (1 + z)/(1 − z)`, `|z| < 0.172`; then `2 atanh z` by the polynomial of fdlibm (error below 2⁻⁵⁸).
#[inline(always)]
pub fn log_ratio<T: Real>(s: T, d: T) -> T {
    const P: [f64; 7] = [
        1.479_819_860_511_658_6e-1,
        1.531_383_769_920_937_3e-1,
        1.818_357_216_161_805e-1,
        2.222_219_843_214_978_4e-1,
        2.857_142_874_366_239e-1,
        3.999_999_999_940_942e-1,
        6.666_666_666_666_735e-1,
    ];
    let (p, mut q) = (s + d, s - d);
    let reach = T::splat(ROOT_TWO) * p;
    let mut doublings = T::zero();
    let two = T::splat(2.0);
    let (mut small, mut large) = (d, s);
    // Far from an edge nothing is to be doubled: the usual case, and the same branch again and again.
    if (two * q).le(reach).any() {
        for k in [32_u8, 16, 8, 4, 2, 1] {
            let scaled = T::splat((1_u64 << k) as f64) * q;
            let take = scaled.le(reach);
            q = T::select(take, scaled, q);
            doublings = T::select(take, doublings + T::splat(f64::from(k)), doublings);
        }
        let reduced = T::zero().lt(doublings);
        small = T::select(reduced, p - q, d);
        large = T::select(reduced, p + q, s);
    }
    let z = small / large;
    let z2 = z * z;
    let mut polynomial = T::splat(P[0]);
    for k in 1..7 {
        polynomial = polynomial.mul_add(z2, T::splat(P[k]));
    }
    let rest = z.mul_add(z2 * polynomial, doublings * T::splat(LN_2[1]));
    doublings.mul_add(T::splat(LN_2[0]), two.mul_add(z, rest))
}
