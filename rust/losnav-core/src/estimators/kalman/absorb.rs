//! What is done with written-down rows: judged block by block, made less certain, taken, or asked for the model's error.
use super::joint::{JointCovariance, View};
use super::rays::{BLOCK, Ray};
use crate::math::matrix::Matrix;
use crate::math::real::Real;
use crate::math::sym3::Sym3;
use crate::math::vec3::{Vec3, scale, scale_add};

/// A correction, and what was learnt on the way to it.
#[derive(Debug)]
pub struct Absorbed<'a, T, const N: usize> {
    /// Of the state.
    pub delta: [T; N],
    /// Of the constants.
    pub constants: &'a mut [T],
    /// Normalised innovation squared of the rows so far.
    pub nis: T,
    /// How many they are.
    pub dof: usize,
}

/// `h P hᵀ` of the rows of one block, and room for `P h` of the constants.
#[inline(always)]
fn spread<T: Real, C: JointCovariance<T, N>, const N: usize>(
    covariance: &C,
    rays: &[Ray<T>],
    view: &View<'_>,
    rest: &mut [T],
) -> Matrix<T, BLOCK> {
    let mut out = [[T::zero(); BLOCK]; BLOCK];
    for (m, ray) in rays.iter().enumerate().take(BLOCK) {
        let (row, beside) = view.of(ray);
        let state = covariance.times(&row, &beside, rest);
        for (k, other) in rays.iter().enumerate().take(m + 1) {
            let (row, beside) = view.of(other);
            let mut sum = beside.dot(rest);
            for j in 0..row.len() {
                if j < N {
                    sum = row[j].mul_add(state[j], sum);
                }
            }
            out[m][k] = sum;
        }
    }
    out
}

/// Rows made independent: multiplied by the inverse of the lower Cholesky factor of `I + β H P Hᵀ`.
#[inline(always)]
fn whiten<T: Real>(rays: &mut [Ray<T>], mut noise: Matrix<T, BLOCK>, beta: T) {
    for m in 0..rays.len().min(BLOCK) {
        for k in 0..=m {
            let mut sum = beta * noise[m][k];
            if k == m {
                sum += T::one();
            }
            for l in 0..k {
                sum = (-noise[m][l]).mul_add(noise[k][l], sum);
            }
            noise[m][k] = if k == m { sum.sqrt() } else { sum / noise[k][k] };
        }
        let (before, own) = rays.split_at_mut(m);
        if let Some(ray) = own.first_mut() {
            for (k, other) in before.iter().enumerate() {
                ray.add(-noise[m][k], other);
            }
            ray.scale(noise[m][m].recip());
        }
    }
}

/// The rows of the next block, from `from` on.
#[inline(always)]
fn block_end<T>(rays: &[Ray<T>], from: usize) -> usize {
    let Some(first) = rays.get(from) else { return from };
    let own = rays.iter().skip(from).take_while(|ray| ray.block == first.block).count();
    from + own.min(BLOCK)
}

/// Throws out blocks whose normalised innovation squared at the prior is beyond the bound for their number of rows, or is
/// not a number; how many rows are left, and the sum of all. Blocks that stay move to the front, in their order.
#[inline(always)]
pub fn gate<T: Real, C: JointCovariance<T, N>, const N: usize>(
    covariance: &C,
    rays: &mut [Ray<T>],
    view: &View<'_>,
    bounds: &[f64; BLOCK],
    rest: &mut [T],
) -> (usize, T) {
    let (mut from, mut kept, mut total) = (0, 0, T::zero());
    while from < rays.len() {
        let end = block_end(rays, from).max(from + 1);
        let mut block = [Ray::zero(); BLOCK];
        let size = end - from;
        block[..size].copy_from_slice(&rays[from..end]);
        let noise = spread(covariance, &block[..size], view, rest);
        whiten(&mut block[..size], noise, T::one());
        let mut nis = T::zero();
        for ray in &block[..size] {
            nis = ray.innovation.mul_add(ray.innovation, nis);
        }
        let good = nis.lane(0) <= bounds[size - 1];
        total += nis;
        if good {
            rays.copy_within(from..end, kept);
            kept += size;
        }
        from = end;
    }
    (kept, total)
}

/// Lear's underweighting: every block errs by `I + β H P⁻ Hᵀ`.
#[inline(always)]
pub fn underweight<T: Real, C: JointCovariance<T, N>, const N: usize>(
    covariance: &C,
    rays: &mut [Ray<T>],
    view: &View<'_>,
    beta: f64,
    rest: &mut [T],
) {
    let mut from = 0;
    while from < rays.len() {
        let end = block_end(rays, from).max(from + 1);
        let noise = spread(covariance, &rays[from..end], view, rest);
        whiten(&mut rays[from..end], noise, T::splat(beta));
        from = end;
    }
}

/// Takes rows linearised at the prior corrected by `base`, one after another. `gain` is room for that of the constants.
#[inline(always)]
pub fn absorb<T: Real, C: JointCovariance<T, N>, const N: usize>(
    covariance: &mut C,
    rays: &[Ray<T>],
    view: &View<'_>,
    base: (&[T; N], &[T]),
    gain: &mut [T],
    out: &mut Absorbed<'_, T, N>,
) {
    for ray in rays {
        let (row, beside) = view.of(ray);
        let mut unexplained = ray.innovation + beside.dot(base.1) - beside.dot(out.constants);
        for j in 0..row.len() {
            if j < N {
                unexplained = row[j].mul_add(base.0[j] - out.delta[j], unexplained);
            }
        }
        let (variance, state) = covariance.absorb(&row, &beside, gain);
        for i in 0..N {
            out.delta[i] = state[i].mul_add(unexplained, out.delta[i]);
        }
        for (delta, gain) in out.constants.iter_mut().zip(gain.iter()) {
            *delta = gain.mul_add(unexplained, *delta);
        }
        out.nis = unexplained.mul_add(unexplained * variance.recip(), out.nis);
        out.dof += 1;
    }
}

/// The acceleration that, had it acted over the last `dt`, would explain the rows best (Lu 1994; Crassidis & Markley 1997):
/// `d = (Sᵀ S + W I)⁻¹ Sᵀ y` with `S = H_r T²/2 + H_v T`, and its covariance `(Sᵀ S + W I)⁻¹`. It takes the state to be
/// exact: what it is is a white acceleration of variance `1/W` estimated without knowing `P`.
#[inline(always)]
pub fn model_error<T: Real>(rays: &[Ray<T>], dt: f64, weight: f64) -> (Vec3<T>, Sym3<T>) {
    let (mut normal, mut right) = (Sym3::zero(), [T::zero(); 3]);
    let (square, dt) = (T::splat(0.5 * dt * dt), T::splat(dt));
    for ray in rays {
        let s = scale_add(square, ray.position(), scale(dt, ray.velocity()));
        right = scale_add(ray.innovation, s, right);
        normal = normal.plus_outer(T::one(), s);
    }
    for diagonal in [0, 3, 5] {
        normal.0[diagonal] += T::splat(weight);
    }
    let factors = normal.ldl();
    (factors.solve(right), factors.inverse())
}
