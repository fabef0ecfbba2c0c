//! Spherical harmonics of any degree: `U = Re (μ/a) Σ c̄_nm Z̄_nm`, `c̄ = C̄ − iS̄`, `Z̄_nm = N_nm (a/r)ⁿ⁺¹ P_nm(sin φ) e^{imλ}`.
//!
//! Fully normalised throughout, so that no degree overflows. Derivatives act on the coefficients (Cunningham 1970): `a ∂_z`,
//! `a ∂_x`, `a ∂_y` turn those of degree `n` into others of degree `n + 1`, once for `g`, twice for `Γ`. That is done when the
//! table is made; a field costs one pass over the solid harmonics of two degrees more, without a singular pole:
//!
//! 1. Down the sectorial ones, `Z̄_mm = k_m (x + iy) a/r² Z̄_{m−1,m−1}`;
//! 2. up each order, `Z̄_nm = α z a/r² Z̄_{n−1,m} − β a²/r² Z̄_{n−2,m}`;
//! 3. each times its row of coefficients, summed.
//!
//! The series converges outside the sphere around the body (Brillouin's) and need not inside: 20 m above Eros the field of
//! degree 4 is wrong by 23 % to 150 times itself, and a higher degree makes it worse.
use num_traits::Float;

use super::Gravity;
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, dot, scale};

/// Factors of a real and of an imaginary part.
type Pair = [f64; 2];

/// Where `U` stands in a [`Term`], after `g` (x, y, z) and `Γ` (xx, xy, xz, yz, zz; yy is what Laplace's equation leaves).
const POTENTIAL: usize = 8;

/// What belongs to one degree and order. The fields stand side by side, so that they are summed side by side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Term {
    /// `α` and `β`; of a sectorial one `k_m` and nothing.
    climb: Pair,
    /// Factors of the real parts.
    real: [f64; 9],
    /// Factors of the imaginary parts.
    imaginary: [f64; 9],
}

impl Term {
    fn get(&self, field: usize) -> Pair {
        [self.real[field], self.imaginary[field]]
    }

    fn add(&mut self, field: usize, [c, s]: Pair) {
        self.real[field] += c;
        self.imaginary[field] += s;
    }
}

/// A field of harmonics; `S` keeps the terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonics<S> {
    radius: f64,
    /// The highest degree of `U`.
    degree: usize,
    terms: S,
}

/// Terms of a field up to that degree: those of its second derivatives.
#[must_use]
pub const fn terms_of(degree: usize) -> usize {
    (degree + 3) * (degree + 4) / 2
}

/// Coefficients of a field up to that degree, order by order within each degree.
#[must_use]
pub const fn coefficients_of(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// Where a degree and order stand in a table up to `top`: order by order, degrees rising.
const fn place(top: usize, n: usize, m: usize) -> usize {
    m * (2 * top + 3 - m) / 2 + (n - m)
}

/// `i c`, for `c` kept as `[Re c, −Im c]`.
fn times_i([c, s]: Pair) -> Pair {
    [s, -c]
}

/// `√((2 − δ_0m)(2n + 1)(n − m)!/(n + m)!)`: `C = N C̄`, so that each harmonic is 1 in the mean square over the sphere.
#[must_use]
pub fn normalization(n: usize, m: usize) -> f64 {
    let mut square = (2 * n + 1) as f64 * if m == 0 { 1.0 } else { 2.0 };
    for k in n + 1 - m.min(n)..=n + m {
        square /= k as f64;
    }
    Float::sqrt(square)
}

/// The three derivatives of a term: calls `put(axis, n', m', coefficient)`.
fn derive(n: usize, m: usize, c: Pair, mut put: impl FnMut(usize, usize, usize, Pair)) {
    let (nf, mf) = (n as f64, m as f64);
    let ratio = (2.0 * nf + 1.0) / (2.0 * nf + 3.0);
    let times = |k: f64| [k * c[0], k * c[1]];
    let along = -Float::sqrt(ratio * (nf + mf + 1.0) * (nf - mf + 1.0));
    put(2, n + 1, m, times(along));
    if m == 0 {
        // Only the real part of a zonal one counts.
        let out = -Float::sqrt(0.5 * ratio * (nf + 1.0) * (nf + 2.0)) * c[0];
        put(0, n + 1, 1, [out, 0.0]);
        put(1, n + 1, 1, times_i([-out, 0.0]));
        return;
    }
    let out = times(0.5 * Float::sqrt(ratio * (nf + mf + 1.0) * (nf + mf + 2.0)));
    put(0, n + 1, m + 1, [-out[0], -out[1]]);
    put(1, n + 1, m + 1, times_i(out));
    let zonal = if m == 1 { 2.0 } else { 1.0 };
    let back = times(0.5 * Float::sqrt(ratio * zonal * (nf - mf + 1.0) * (nf - mf + 2.0)));
    put(0, n + 1, m - 1, back);
    put(1, n + 1, m - 1, times_i(back));
}

impl<S: AsRef<[Term]> + AsMut<[Term]>> Harmonics<S> {
    /// Field of `mu` (m³/s²), the radius of reference (m), and coefficients `[C̄, S̄]`, fully normalised, of degrees 0, 1, …
    /// ([`coefficients_of`] of them, orders 0 to n within each degree); `terms` is room for [`terms_of`] the degree.
    ///
    /// Nothing, if the numbers of coefficients or terms are not those of a degree.
    pub fn try_new(mu: f64, radius: f64, coefficients: &[[f64; 2]], mut terms: S) -> Option<Self> {
        let degree = (0..).find(|n| coefficients_of(*n) >= coefficients.len())?;
        let table = terms.as_mut();
        if coefficients_of(degree) != coefficients.len() || terms_of(degree) != table.len() {
            return None;
        }
        let top = degree + 2;
        table.fill(Term::default());
        let mut given = coefficients.iter();
        for n in 0..=top {
            for m in 0..=n {
                let here = table.get_mut(place(top, n, m))?;
                here.climb = climb(n, m);
                if n <= degree {
                    here.add(POTENTIAL, given.next()?.map(|c| mu / radius * c));
                }
            }
        }
        // From one field three others; yx, zx and zy would be twice the same.
        let chains = [(POTENTIAL, [0, 1, 2]), (0, [3, 4, 5]), (1, [9, 9, 6]), (2, [9, 9, 7])];
        for (first, derivatives) in chains {
            for n in 0..top {
                for m in 0..=n {
                    let c = table.get(place(top, n, m))?.get(first).map(|c| c / radius);
                    derive(n, m, c, |axis, n, m, c| {
                        let field = derivatives[axis];
                        if let (Some(term), 0..9) = (table.get_mut(place(top, n, m)), field) {
                            term.add(field, c);
                        }
                    });
                }
            }
        }
        Some(Self { radius, degree, terms })
    }
}

/// [`Term::climb`].
fn climb(n: usize, m: usize) -> Pair {
    let (nf, mf) = (n as f64, m as f64);
    if n == m {
        return [if m == 1 { Float::sqrt(3.0) } else { Float::sqrt(1.0 + 0.5 / mf.max(0.5)) }, 0.0];
    }
    let across = (nf - mf) * (nf + mf);
    let alpha = Float::sqrt((2.0 * nf - 1.0) * (2.0 * nf + 1.0) / across);
    let beta = if n == m + 1 {
        0.0
    } else {
        Float::sqrt((2.0 * nf + 1.0) * (nf + mf - 1.0) * (nf - mf - 1.0) / (across * (2.0 * nf - 3.0)))
    };
    [alpha, beta]
}

impl<S> Harmonics<S> {
    /// The same field with its terms kept another way.
    pub fn keep<K>(self, keep: impl FnOnce(S) -> K) -> Harmonics<K> {
        Harmonics { radius: self.radius, degree: self.degree, terms: keep(self.terms) }
    }
}

impl<S: AsRef<[Term]>> Harmonics<S> {
    /// The highest degree.
    #[must_use]
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// The first `K` fields from the `FROM`th on, summed over the solid harmonics up to `extra` degrees more than that of `U`.
    #[inline(always)]
    fn sum<T: Real, const FROM: usize, const K: usize>(&self, r: Vec3<T>, extra: usize) -> [T; K] {
        let inverse = T::splat(self.radius) * dot(r, r).recip();
        let [x, y, z] = scale(inverse, r);
        let square = T::splat(self.radius) * inverse;
        let mut sums = [T::zero(); K];
        // Z̄_00 = a/r.
        let mut sectorial = [square.sqrt(), T::zero()];
        let mut rest = self.terms.as_ref();
        let top = self.degree + 2;
        for m in 0..=self.degree + extra {
            let Some((column, others)) = rest.split_at_checked(top + 1 - m) else { return sums };
            rest = others;
            let Some((first, higher)) = column.split_first() else { return sums };
            if m > 0 {
                let k = T::splat(first.climb[0]);
                let [u, v] = sectorial;
                sectorial = [k * (x.mul_add(u, -(y * v))), k * (x.mul_add(v, y * u))];
            }
            let (mut below, mut here) = ([T::zero(); 2], sectorial);
            accumulate::<T, FROM, K>(&mut sums, here, first);
            for term in higher.iter().take(self.degree + extra - m) {
                let (alpha, beta) = (z * T::splat(term.climb[0]), -(square * T::splat(term.climb[1])));
                let next = [alpha.mul_add(here[0], beta * below[0]), alpha.mul_add(here[1], beta * below[1])];
                (below, here) = (here, next);
                accumulate::<T, FROM, K>(&mut sums, here, term);
            }
        }
        sums
    }
}

/// One term of each sum.
#[inline(always)]
fn accumulate<T: Real, const FROM: usize, const K: usize>(sums: &mut [T; K], z: [T; 2], term: &Term) {
    for k in 0..K {
        let (c, s) = (T::splat(term.real[FROM + k]), T::splat(term.imaginary[FROM + k]));
        sums[k] = z[0].mul_add(c, z[1].mul_add(s, sums[k]));
    }
}

impl<S: AsRef<[Term]>> Gravity for Harmonics<S> {
    #[inline(always)]
    fn potential<T: Real>(&self, r: Vec3<T>) -> T {
        self.sum::<T, POTENTIAL, 1>(r, 0)[0]
    }

    #[inline(always)]
    fn acceleration<T: Real>(&self, r: Vec3<T>) -> Vec3<T> {
        self.sum::<T, 0, 3>(r, 1)
    }

    #[inline(always)]
    fn acceleration_and_gradient<T: Real>(&self, r: Vec3<T>) -> (Vec3<T>, Mat3<T>) {
        let [gx, gy, gz, xx, xy, xz, yz, zz] = self.sum::<T, 0, 8>(r, 2);
        ([gx, gy, gz], [[xx, xy, xz], [xy, -(xx + zz), yz], [xz, yz, zz]])
    }
}
