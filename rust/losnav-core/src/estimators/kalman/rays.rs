//! Whitened rows written down: the sensor speaks once, and who gates, guesses the model's error or updates reads it.
use crate::math::real::Real;
use crate::math::vec3::{Mat3, Vec3, across, cross, dot, rotate_transposed, scale};
use crate::models::linearization::{Direction, Linearization, Row, Sink, Weight};

/// Columns a sensor can see: `[δr δv δα]`.
pub const SEEN: usize = 9;
/// Rows of the largest block that is judged as one.
pub const BLOCK: usize = 8;

/// One row of unit noise: `innovation ≈ h · [δr δv δα]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<T> {
    /// `y = z ⊟ h(x)`, over its deviation.
    pub innovation: T,
    /// `h`.
    pub row: [T; SEEN],
    /// Rows of a block are accepted or rejected together; they stand side by side.
    pub block: usize,
    /// The landmark seen: its error acts as minus that of the position.
    pub landmark: Option<usize>,
}

impl<T: Real> Ray<T> {
    /// All zero.
    #[inline(always)]
    #[must_use]
    pub fn zero() -> Self {
        Self { innovation: T::zero(), row: [T::zero(); SEEN], block: 0, landmark: None }
    }

    /// `∂h/∂r`.
    #[inline(always)]
    pub fn position(&self) -> Vec3<T> {
        [self.row[0], self.row[1], self.row[2]]
    }

    /// `∂h/∂v`.
    #[inline(always)]
    pub fn velocity(&self) -> Vec3<T> {
        [self.row[3], self.row[4], self.row[5]]
    }

    /// `∂h/∂α`.
    #[inline(always)]
    pub fn attitude(&self) -> Vec3<T> {
        [self.row[6], self.row[7], self.row[8]]
    }

    /// This row plus `factor` times another of its block.
    #[inline(always)]
    pub fn add(&mut self, factor: T, other: &Self) {
        self.innovation = factor.mul_add(other.innovation, self.innovation);
        for i in 0..SEEN {
            self.row[i] = factor.mul_add(other.row[i], self.row[i]);
        }
    }

    /// This row times a factor.
    #[inline(always)]
    pub fn scale(&mut self, factor: T) {
        self.innovation = factor * self.innovation;
        for i in 0..SEEN {
            self.row[i] = factor * self.row[i];
        }
    }
}

/// The sink that writes them down, as far as there is room.
#[derive(Debug)]
pub struct Rays<'a, T> {
    out: &'a mut [Ray<T>],
    count: usize,
    blocks: usize,
}

impl<'a, T: Real> Rays<'a, T> {
    /// Writes to `out` from the front.
    #[inline(always)]
    #[must_use]
    pub fn new(out: &'a mut [Ray<T>]) -> Self {
        Self { out, count: 0, blocks: 0 }
    }

    /// Rows written.
    #[inline(always)]
    #[must_use]
    pub fn count(&self) -> usize {
        self.count.min(self.out.len())
    }

    #[inline(always)]
    fn write(&mut self, row: &Row<T>, block: usize, landmark: Option<usize>) {
        if let Some(ray) = self.out.get_mut(self.count) {
            ray.innovation = row.innovation;
            for i in 0..3 {
                ray.row[i] = row.d_position[i];
                ray.row[i + 3] = row.d_velocity[i];
                ray.row[i + 6] = row.d_attitude[i];
            }
            (ray.block, ray.landmark) = (block, landmark);
        }
        self.count += 1;
    }
}

impl<T: Real> Sink<T> for Rays<'_, T> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        for m in 0..M {
            self.write(&rows.whitened(m), self.blocks, None);
        }
        self.blocks += 1;
    }

    /// Two rows across the direction: along it a unit vector measures nothing.
    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, dcm: &Mat3<T>) {
        let Weight::Scalar(weight) = direction.weight else {
            return self.add(&direction.expand(dcm));
        };
        let root = weight.sqrt();
        let (h, k) = (direction.predicted, root * direction.inverse_range);
        for t in across(h) {
            let mut row = Row::zero();
            row.innovation = root * dot(t, direction.innovation);
            row.d_position = scale(-k, rotate_transposed(dcm, t));
            row.d_attitude = scale(root, cross(t, h));
            self.write(&row, self.blocks, None);
        }
        self.blocks += 1;
    }

    /// The block of a landmark is the landmark.
    #[inline(always)]
    fn add_landmark<const M: usize>(&mut self, index: usize, rows: &Linearization<T, M>) {
        for m in 0..M {
            self.write(&rows.whitened(m), index, Some(index));
        }
        self.blocks = index + 1;
    }
}

/// Rows of many landmarks as at most six that say the same: with `A = Σ hᵀh = L D Lᵀ` and `b = Σ hᵀy` the rows `√D Lᵀ` and
/// innovations `(L⁻¹ b)/√D`. What no state can explain, `Σ y² −` theirs, is returned beside their number.
///
/// Only for rows without velocity, that see nothing but the state; the block of the first is that of all.
#[inline(always)]
pub fn compress<T: Real>(rays: &mut [Ray<T>]) -> (usize, T) {
    // Position and attitude stand side by side here.
    const PICK: [usize; 6] = [0, 1, 2, 6, 7, 8];
    let (mut a, mut b, mut square) = ([[T::zero(); 6]; 6], [T::zero(); 6], T::zero());
    for ray in rays.iter() {
        square = ray.innovation.mul_add(ray.innovation, square);
        for i in 0..6 {
            let h = ray.row[PICK[i]];
            b[i] = h.mul_add(ray.innovation, b[i]);
            for j in 0..6 {
                // Not `i..6`: loops of one length are unrolled.
                a[i][j] = h.mul_add(ray.row[PICK[j]], a[i][j]);
            }
        }
    }
    let (mut count, mut explained, whole) = (0, T::zero(), a);
    for k in 0..6 {
        let pivot = a[k][k];
        let scale = pivot.rsqrt();
        // Of a column that the ones before explain rounding leaves some units in the last place: it holds nothing.
        let sound = (T::splat(FLAT) * whole[k][k]).lt(pivot);
        let mut ray = Ray::zero();
        ray.innovation = T::select(sound, scale * b[k], T::zero());
        for j in 0..6 {
            if j >= k {
                ray.row[PICK[j]] = T::select(sound, scale * a[k][j], T::zero());
            }
        }
        explained = ray.innovation.mul_add(ray.innovation, explained);
        for i in 0..6 {
            if i > k {
                let factor = ray.row[PICK[i]];
                b[i] = (-factor).mul_add(ray.innovation, b[i]);
                for j in 0..6 {
                    a[i][j] = (-factor).mul_add(ray.row[PICK[j]], a[i][j]);
                }
            }
        }
        if let Some(out) = rays.get_mut(count) {
            (ray.block, ray.landmark) = (out.block, None);
            *out = ray;
            count += 1;
        }
    }
    (count, square - explained)
}

/// What rounding may leave of a pivot.
const FLAT: f64 = 1e-13;
