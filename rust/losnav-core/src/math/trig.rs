//! Angles over any [`Real`]: `atan2`, wrapping, sine and cosine without a branch or a call to a library.
//!
//! Each is within two units in the last place of the exact value. The approximations are polynomials and quotients of
//! polynomials; numbers that carry derivatives take the value from them and the derivatives from the equations that sine,
//! cosine and angle obey, so that no order of derivatives is that of a polynomial.
use super::real::{Mask, Real};

/// `π/4`.
const QUARTER_PI: f64 = core::f64::consts::FRAC_PI_4;
/// `tan π/8`: beyond it `atan t = π/4 + atan((t − 1)/(t + 1))`.
const FOLD: f64 = 0.414_213_562_373_095_05;
/// `π/2` in three parts of which the first two have so few digits that a million of them is exact.
const HALF_PI: [f64; 3] = [1.570_796_325_802_803, 9.920_935_791_635_221e-10, 5.170_182_981_794_105e-19];
/// What the nearest double to `π/2` leaves out.
const HALF_PI_REST: f64 = 6.123_233_995_736_766e-17;

/// `atan t`, `|t| ≤ tan π/8`: `t + t z P(z)/Q(z)`, `z = t²`, the quotient of Moshier's Cephes library (error below
/// 2e-17 there).
#[inline(always)]
fn small_atan<T: Real>(t: T) -> T {
    const P: [f64; 5] = [
        -8.750_608_600_031_904e-1,
        -1.615_753_718_733_365e1,
        -7.500_855_792_314_705e1,
        -1.228_866_684_490_136_1e2,
        -6.485_021_904_942_025e1,
    ];
    const Q: [f64; 5] = [
        2.485_846_490_142_306_2e1,
        1.650_270_098_316_988_6e2,
        4.328_810_604_912_902_7e2,
        4.853_903_996_359_137e2,
        1.945_506_571_482_614e2,
    ];
    let z = t * t;
    let (mut p, mut q) = (T::splat(P[0]), z + T::splat(Q[0]));
    for k in 1..5 {
        p = p.mul_add(z, T::splat(P[k]));
        q = q.mul_add(z, T::splat(Q[k]));
    }
    t.mul_add(z * p / q, t)
}

/// The angle of the vector `(x, y)`, in `(−π, π]`; NaN for the zero vector. The sign of a zero is ignored.
///
/// Exact to two units in the last place where neither number is beyond 1e300 and the larger is above 1e-290.
#[inline(always)]
pub fn atan2<T: Real>(y: T, x: T) -> T {
    y.arctan2(x)
}

/// [`atan2`] of numbers without derivatives.
#[inline(always)]
pub fn atan2_by_polynomials<T: Real>(y: T, x: T) -> T {
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ax.lt(ay);
    let (large, small) = (T::select(steep, ay, ax), T::select(steep, ax, ay));
    let fold = (T::splat(FOLD) * large).lt(small);
    // (t − 1)/(t + 1) of t = small/large; the difference is exact where it cancels.
    let quotient = T::select(fold, small - large, small) / T::select(fold, small + large, large);
    let mut angle = small_atan(quotient);
    angle = T::select(fold, T::splat(QUARTER_PI) + (angle + T::splat(0.5 * HALF_PI_REST)), angle);
    let (half, rest) = (T::splat(2.0 * QUARTER_PI), T::splat(HALF_PI_REST));
    angle = T::select(steep, half - (angle - rest), angle);
    angle = T::select(x.lt(T::zero()), (half + half) - (angle - (rest + rest)), angle);
    T::select(y.lt(T::zero()), -angle, angle)
}

/// The same angle in `(−π, π]`, unchanged if it is there; exact for a million turns.
#[inline(always)]
pub fn wrap_angle<T: Real>(angle: T) -> T {
    let turn = T::splat(8.0 * QUARTER_PI);
    let turns = (angle / turn).round();
    let quarters = T::splat(4.0) * turns;
    let mut wrapped = angle;
    for part in HALF_PI {
        wrapped = (-quarters).mul_add(T::splat(part), wrapped);
    }
    let pi = T::splat(4.0 * QUARTER_PI);
    // What rounds to π from beyond, and −π itself.
    wrapped = T::select(wrapped.le(-pi), wrapped + turn, wrapped);
    T::select(pi.lt(wrapped), wrapped - turn, wrapped)
}

/// `(sin x, cos x)`; two units in the last place of one for a million turns.
#[inline(always)]
pub fn sin_cos<T: Real>(x: T) -> (T, T) {
    x.sine_cosine()
}

/// [`sin_cos`] of numbers without derivatives: the remainder of a quarter turn goes through the polynomials of fdlibm (error
/// below 2⁻⁵⁸).
#[inline(always)]
pub fn sin_cos_by_polynomials<T: Real>(x: T) -> (T, T) {
    const S: [f64; 6] = [
        1.589_690_995_211_55e-10,
        -2.505_076_025_340_686_3e-8,
        2.755_731_370_707_006_8e-6,
        -1.984_126_982_985_795e-4,
        8.333_333_333_322_49e-3,
        -1.666_666_666_666_663_2e-1,
    ];
    const C: [f64; 6] = [
        -1.135_964_755_778_819_5e-11,
        2.087_572_321_298_175e-9,
        -2.755_731_435_139_066_3e-7,
        2.480_158_728_947_673e-5,
        -1.388_888_888_887_411e-3,
        4.166_666_666_666_66e-2,
    ];
    let quarters = (x * T::splat(0.5 / QUARTER_PI)).round();
    let mut r = x;
    for part in HALF_PI {
        r = (-quarters).mul_add(T::splat(part), r);
    }
    let z = r * r;
    let (mut s, mut c) = (T::splat(S[0]), T::splat(C[0]));
    for k in 1..6 {
        s = s.mul_add(z, T::splat(S[k]));
        c = c.mul_add(z, T::splat(C[k]));
    }
    let (sin, cos) = ((r * z).mul_add(s, r), (z * z).mul_add(c, T::one() - T::splat(0.5) * z));
    // Which quarter, −2 to 2.
    let four = T::splat(4.0);
    let quarter = quarters - four * (quarters / four).round();
    let (half, three_halves) = (T::splat(0.5), T::splat(1.5));
    let odd = half.lt(quarter.abs()).and(quarter.abs().lt(three_halves));
    let opposite = three_halves.lt(quarter.abs());
    let (a, b) = (T::select(odd, cos, sin), T::select(odd, sin, cos));
    let negative_sin = opposite.or(odd.and(quarter.lt(T::zero())));
    let negative_cos = opposite.or(odd.and(T::zero().lt(quarter)));
    (T::select(negative_sin, -a, a), T::select(negative_cos, -b, b))
}
