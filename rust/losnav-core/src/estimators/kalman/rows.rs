//! The sink of the filter: takes the whitened rows of one sensor's measurement, one after another.
use super::covariance::Covariance;
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, across, cross, dot, rotate_transposed, scale};
use crate::models::linearization::{Direction, Linearization, Sink, Weight};
use crate::models::state::Columns;

/// An update under way: the covariance and the correction after the rows so far.
#[derive(Clone, Copy, Debug)]
pub struct Rows<T, P, const N: usize> {
    columns: Columns,
    /// The point of linearisation, as a correction of the prior.
    base: [T; N],
    /// Lear's factor `β`: blocks err by `R + β H P Hᵀ`.
    underweighting: f64,
    /// `P` after the rows so far.
    pub covariance: P,
    /// Correction of the prior by the rows so far.
    pub delta: [T; N],
    /// Normalised innovation squared, `Σ ν²/s`: that of the whole measurement, since each `ν` is what the rows before
    /// leave unexplained.
    pub nis: T,
    /// How many independent rows that was.
    pub dof: usize,
}

impl<T: Real, P: Covariance<T, N>, const N: usize> Rows<T, P, N> {
    /// Nothing taken yet.
    #[inline(always)]
    pub fn new(columns: Columns, base: [T; N], underweighting: f64, covariance: P) -> Self {
        let zero = T::zero();
        Self { columns, base, underweighting, covariance, delta: [zero; N], nis: zero, dof: 0 }
    }

    /// Takes one row of unit noise: `innovation ≈ h δ`.
    #[inline(always)]
    pub fn absorb(&mut self, innovation: T, h: &[T; N], used: &[bool; N]) {
        let mut unexplained = innovation;
        for j in 0..N {
            if used[j] {
                unexplained = h[j].mul_add(self.base[j] - self.delta[j], unexplained);
            }
        }
        let (variance, gain) = self.covariance.absorb(h, used);
        for i in 0..N {
            self.delta[i] = gain[i].mul_add(unexplained, self.delta[i]);
        }
        self.nis = unexplained.mul_add(unexplained * variance.recip(), self.nis);
        self.dof += 1;
    }

    /// Takes the rows of a block, which may err together by `β H P Hᵀ` on top of their unit noise.
    #[inline(always)]
    fn absorb_block<const M: usize>(
        &mut self,
        mut innovation: [T; M],
        mut rows: [[T; N]; M],
        used: &[bool; N],
    ) {
        if self.underweighting > 0.0 {
            self.underweight(&mut innovation, &mut rows, used);
        }
        for m in 0..M {
            self.absorb(innovation[m], &rows[m], used);
        }
    }

    /// Whitens rows again, by the Cholesky factor of `I + β H P Hᵀ`.
    #[inline(always)]
    fn underweight<const M: usize>(&self, innovation: &mut [T; M], rows: &mut [[T; N]; M], used: &[bool; N]) {
        let beta = T::splat(self.underweighting);
        let mut noise = [[T::zero(); M]; M];
        for m in 0..M {
            let spread = self.covariance.times(&rows[m], used);
            for k in 0..M {
                let mut product = T::zero();
                for j in 0..N {
                    product = rows[k][j].mul_add(spread[j], product);
                }
                noise[m][k] = beta * product;
            }
            noise[m][m] += T::one();
        }
        for m in 0..M {
            for k in 0..=m {
                let mut sum = noise[m][k];
                for l in 0..k {
                    sum = (-noise[m][l]).mul_add(noise[k][l], sum);
                }
                noise[m][k] = if k == m { sum.sqrt() } else { sum / noise[k][k] };
            }
            for k in 0..m {
                innovation[m] = (-noise[m][k]).mul_add(innovation[k], innovation[m]);
                for j in 0..N {
                    rows[m][j] = (-noise[m][k]).mul_add(rows[k][j], rows[m][j]);
                }
            }
            let scale = noise[m][m].recip();
            innovation[m] = scale * innovation[m];
            for j in 0..N {
                rows[m][j] = scale * rows[m][j];
            }
        }
    }

    /// Where a block depending on these parts has entries that are not zero by nature.
    #[inline(always)]
    fn used(&self, velocity: bool, attitude: bool) -> [bool; N] {
        let mut used = [false; N];
        let parts = [
            Some(self.columns.position),
            if velocity { self.columns.velocity } else { None },
            if attitude { self.columns.attitude } else { None },
        ];
        for part in parts.into_iter().flatten() {
            for entry in used.iter_mut().skip(part).take(3) {
                *entry = true;
            }
        }
        used
    }
}

#[inline(always)]
fn place<T: Real, const N: usize>(row: &mut [T; N], column: Option<usize>, part: Vec3<T>) {
    if let Some(first) = column {
        for i in 0..3 {
            if let Some(entry) = row.get_mut(first + i) {
                *entry = part[i];
            }
        }
    }
}

impl<T: Real, P: Covariance<T, N>, const N: usize> Sink<T> for Rows<T, P, N> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        let used = self.used(rows.d_velocity.is_some(), rows.d_attitude.is_some());
        let (mut innovation, mut h) = ([T::zero(); M], [[T::zero(); N]; M]);
        for m in 0..M {
            let row = rows.whitened(m);
            innovation[m] = row.innovation;
            place(&mut h[m], Some(self.columns.position), row.d_position);
            if rows.d_velocity.is_some() {
                place(&mut h[m], self.columns.velocity, row.d_velocity);
            }
            if rows.d_attitude.is_some() {
                place(&mut h[m], self.columns.attitude, row.d_attitude);
            }
        }
        self.absorb_block(innovation, h, &used);
    }

    /// Two rows across the direction: along it a unit vector measures nothing.
    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, dcm: &Mat3<T>) {
        let Weight::Scalar(weight) = direction.weight else {
            return self.add(&direction.expand(dcm));
        };
        let root = weight.sqrt();
        let (h, k) = (direction.predicted, root * direction.inverse_range);
        let across = across(h);
        let (mut innovation, mut rows) = ([T::zero(); 2], [[T::zero(); N]; 2]);
        for m in 0..2 {
            innovation[m] = root * dot(across[m], direction.innovation);
            // ∂h/∂p = −(I − hhᵀ) dcm/ρ and ∂h/∂α = [h×], seen along a unit vector across h.
            place(&mut rows[m], Some(self.columns.position), scale(-k, rotate_transposed(dcm, across[m])));
            place(&mut rows[m], self.columns.attitude, scale(root, cross(across[m], h)));
        }
        let used = self.used(false, true);
        self.absorb_block(innovation, rows, &used);
    }
}
