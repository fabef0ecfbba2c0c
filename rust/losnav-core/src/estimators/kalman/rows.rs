//! The sink of the filter: takes the whitened rows of one sensor's measurement, one after another.
use super::covariance::{Covariance, Sparse};
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, across, cross, dot, rotate_transposed, scale, scale_add};
use crate::models::linearization::{Direction, Linearization, Row, Sink, Weight};
use crate::models::state::Columns;

/// An update under way: the covariance and the correction after the rows so far.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a, T, P, const N: usize> {
    columns: Columns,
    /// The point of linearisation, as a correction of the prior.
    base: [T; N],
    /// Lear's factor `β`: blocks err by `R + β H P⁻ Hᵀ`.
    underweighting: f64,
    /// `P⁻`, before any row: what is added to the noise of a block must not depend on the blocks taken before it.
    prior: &'a P,
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

impl<'a, T: Real, P: Covariance<T, N>, const N: usize> Rows<'a, T, P, N> {
    /// Nothing taken yet.
    #[inline(always)]
    pub fn new(columns: Columns, base: [T; N], underweighting: f64, prior: &'a P) -> Self {
        let zero = T::zero();
        Self { columns, base, underweighting, prior, covariance: *prior, delta: [zero; N], nis: zero, dof: 0 }
    }

    /// Takes one row of unit noise: `innovation ≈ h δ`.
    #[inline(always)]
    pub fn absorb<const K: usize>(&mut self, innovation: T, h: &Sparse<T, K>) {
        let unexplained = innovation + h.dot(&self.base) - h.dot(&self.delta);
        let (variance, gain) = self.covariance.absorb(h);
        for i in 0..N {
            self.delta[i] = gain[i].mul_add(unexplained, self.delta[i]);
        }
        self.nis = unexplained.mul_add(unexplained * variance.recip(), self.nis);
        self.dof += 1;
    }

    /// Takes the rows of a block, which may err together by `β H P⁻ Hᵀ` on top of their unit noise.
    #[inline(always)]
    fn absorb_block<const M: usize, const K: usize>(
        &mut self,
        mut innovation: [T; M],
        mut rows: [Sparse<T, K>; M],
    ) {
        if self.underweighting > 0.0 {
            self.underweight(&mut innovation, &mut rows);
        }
        for m in 0..M {
            self.absorb(innovation[m], &rows[m]);
        }
    }

    /// Whitens rows again, by the Cholesky factor of `I + β H P⁻ Hᵀ`.
    #[inline(always)]
    fn underweight<const M: usize, const K: usize>(
        &self,
        innovation: &mut [T; M],
        rows: &mut [Sparse<T, K>; M],
    ) {
        let beta = T::splat(self.underweighting);
        let mut noise = [[T::zero(); M]; M];
        for m in 0..M {
            let spread = self.prior.times(&rows[m]);
            for k in 0..M {
                noise[m][k] = beta * rows[k].dot(&spread);
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
                for b in 0..K {
                    rows[m].part[b] = scale_add(-noise[m][k], rows[k].part[b], rows[m].part[b]);
                }
            }
            let factor = noise[m][m].recip();
            innovation[m] = factor * innovation[m];
            for b in 0..K {
                rows[m].part[b] = scale(factor, rows[m].part[b]);
            }
        }
    }

    /// Takes whitened rows, of which only some blocks are there.
    #[inline(always)]
    fn take<const M: usize>(&mut self, rows: &[Row<T>; M], velocity: Option<usize>, attitude: Option<usize>) {
        let mut innovation = [T::zero(); M];
        for m in 0..M {
            innovation[m] = rows[m].innovation;
        }
        let p = self.columns.position;
        match (velocity, attitude) {
            (None, None) => {
                let mut sparse = [Sparse { first: [p], part: [[T::zero(); 3]] }; M];
                for m in 0..M {
                    sparse[m].part = [rows[m].d_position];
                }
                self.absorb_block(innovation, sparse);
            }
            (Some(v), None) => {
                let mut sparse = [Sparse { first: [p, v], part: [[T::zero(); 3]; 2] }; M];
                for m in 0..M {
                    sparse[m].part = [rows[m].d_position, rows[m].d_velocity];
                }
                self.absorb_block(innovation, sparse);
            }
            (None, Some(a)) => {
                let mut sparse = [Sparse { first: [p, a], part: [[T::zero(); 3]; 2] }; M];
                for m in 0..M {
                    sparse[m].part = [rows[m].d_position, rows[m].d_attitude];
                }
                self.absorb_block(innovation, sparse);
            }
            (Some(v), Some(a)) => {
                let mut sparse = [Sparse { first: [p, v, a], part: [[T::zero(); 3]; 3] }; M];
                for m in 0..M {
                    sparse[m].part = [rows[m].d_position, rows[m].d_velocity, rows[m].d_attitude];
                }
                self.absorb_block(innovation, sparse);
            }
        }
    }
}

impl<T: Real, P: Covariance<T, N>, const N: usize> Sink<T> for Rows<'_, T, P, N> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        let mut whitened = [Row::zero(); M];
        for m in 0..M {
            whitened[m] = rows.whitened(m);
        }
        let velocity = if rows.d_velocity.is_some() { self.columns.velocity } else { None };
        let attitude = if rows.d_attitude.is_some() { self.columns.attitude } else { None };
        self.take(&whitened, velocity, attitude);
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
        let mut rows = [Row::zero(); 2];
        for m in 0..2 {
            rows[m].innovation = root * dot(across[m], direction.innovation);
            // ∂h/∂p = −(I − hhᵀ) dcm/ρ and ∂h/∂α = [h×], seen along a unit vector across h.
            rows[m].d_position = scale(-k, rotate_transposed(dcm, across[m]));
            rows[m].d_attitude = scale(root, cross(across[m], h));
        }
        self.take(&rows, None, self.columns.attitude);
    }

    /// The same of a direction whose structure is another.
    #[inline(always)]
    fn add_unit_vector(&mut self, rows: &Linearization<T, 3>, direction: Vec3<T>) {
        let whitened = [rows.whitened(0), rows.whitened(1), rows.whitened(2)];
        let [a, b] = across(direction);
        let seen = [Row::sum(a, &whitened), Row::sum(b, &whitened)];
        let velocity = if rows.d_velocity.is_some() { self.columns.velocity } else { None };
        let attitude = if rows.d_attitude.is_some() { self.columns.attitude } else { None };
        self.take(&seen, velocity, attitude);
    }
}
