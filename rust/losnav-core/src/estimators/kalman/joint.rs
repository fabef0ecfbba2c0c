//! The covariance of a state and of constants beside it: poses remembered from the past, landmarks of an uncertain map.
//!
//! Constants neither move nor are driven, so a step costs them one product each with `Φ`; a measurement may see some of
//! them besides the state, or instead of it. Storage is the caller's: how many there are is not known when the kernel is
//! compiled.
use super::covariance::{Covariance, Sparse};
use super::rays::{Ray, SEEN};
use super::ud::Ud;
use crate::math::matrix::{Matrix, mirrored};
use crate::math::real::Real;
use crate::math::vec3::{Vec3, scale};
use crate::models::dynamics::DynamicsModel;

/// What a row sees of the constants: up to three blocks of three, of which `count` count.
#[derive(Clone, Copy, Debug)]
pub struct Beside<T> {
    first: [usize; 3],
    part: [Vec3<T>; 3],
    count: usize,
}

impl<T: Real> Beside<T> {
    /// Nothing.
    #[inline(always)]
    #[must_use]
    pub fn nothing() -> Self {
        Self { first: [0; 3], part: [[T::zero(); 3]; 3], count: 0 }
    }

    #[inline(always)]
    fn see(&mut self, first: usize, part: Vec3<T>) {
        if self.count < 3 {
            (self.first[self.count], self.part[self.count]) = (first, part);
            self.count += 1;
        }
    }

    /// `h · v`.
    #[inline(always)]
    pub fn dot(&self, v: &[T]) -> T {
        let mut sum = T::zero();
        for b in 0..self.count {
            for c in 0..3 {
                if let Some(v) = v.get(self.first[b] + c) {
                    sum = self.part[b][c].mul_add(*v, sum);
                }
            }
        }
        sum
    }
}

/// Where rows were measured, and which constants they see.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// First constant of the remembered pose `[δr δα]` that measured; none: the state now.
    pub pose: Option<usize>,
    /// First constant of each landmark; [`usize::MAX`], or beyond the end: its error is not kept.
    pub landmarks: &'a [usize],
}

impl View<'_> {
    /// What a ray sees of the state, and of the constants.
    #[inline(always)]
    pub fn of<T: Real>(&self, ray: &Ray<T>) -> ([T; SEEN], Beside<T>) {
        let (mut row, mut beside) = (ray.row, Beside::nothing());
        if let Some(pose) = self.pose {
            beside.see(pose, ray.position());
            beside.see(pose + 3, ray.attitude());
            row = [T::zero(); SEEN];
        }
        if let Some(&first) = ray.landmark.and_then(|index| self.landmarks.get(index))
            && first != usize::MAX
        {
            beside.see(first, scale(-T::one(), ray.position()));
        }
        (row, beside)
    }
}

/// A covariance that may hold constants.
pub trait JointCovariance<T: Real, const N: usize> {
    /// `P h`: what of it concerns the state, and the constants.
    fn times<const K: usize>(&self, row: &[T; K], beside: &Beside<T>, rest: &mut [T]) -> [T; N];
    /// Takes a row of unit noise: the variance of its innovation and the gain, that of the constants in `rest`.
    fn absorb<const K: usize>(&mut self, row: &[T; K], beside: &Beside<T>, rest: &mut [T]) -> (T, [T; N]);
}

impl<T: Real, C: JointCovariance<T, N>, const N: usize> JointCovariance<T, N> for &mut C {
    #[inline(always)]
    fn times<const K: usize>(&self, row: &[T; K], beside: &Beside<T>, rest: &mut [T]) -> [T; N] {
        (**self).times(row, beside, rest)
    }

    #[inline(always)]
    fn absorb<const K: usize>(&mut self, row: &[T; K], beside: &Beside<T>, rest: &mut [T]) -> (T, [T; N]) {
        (**self).absorb(row, beside, rest)
    }
}

/// In Joseph's form, as [`Joseph`](super::Joseph): the whole of every symmetric block.
#[derive(Debug)]
pub struct Joint<'a, T, const N: usize> {
    /// Of the state.
    pub state: &'a mut Matrix<T, N>,
    /// Of each constant with the state.
    pub cross: &'a mut [[T; N]],
    /// Of the constants, row by row.
    pub constants: &'a mut [T],
}

impl<T: Real, const N: usize> Joint<'_, T, N> {
    /// A step in time.
    #[inline(always)]
    pub fn propagate<D: DynamicsModel<T, N>>(
        &mut self,
        dynamics: &D,
        step: &D::Step,
        transition: &Matrix<T, N>,
        noise: &Matrix<T, N>,
    ) {
        *self.state = dynamics.carry(step, transition, self.state);
        for i in 0..N {
            for j in 0..N {
                self.state[i][j] += noise[i][j];
            }
        }
        for row in self.cross.iter_mut() {
            let mut moved = [T::zero(); N];
            for i in 0..N {
                for k in 0..N {
                    moved[i] = transition[i][k].mul_add(row[k], moved[i]);
                }
            }
            *row = moved;
        }
    }
}

impl<T: Real, const N: usize> JointCovariance<T, N> for Joint<'_, T, N> {
    #[inline(always)]
    fn times<const K: usize>(&self, row: &[T; K], beside: &Beside<T>, rest: &mut [T]) -> [T; N] {
        let mut f = [T::zero(); N];
        // Column by column, which by symmetry are rows: what lies side by side is multiplied side by side.
        for j in 0..K {
            if j < N {
                for i in 0..N {
                    f[i] = self.state[j][i].mul_add(row[j], f[i]);
                }
            }
        }
        for b in 0..beside.count {
            for c in 0..3 {
                if let Some(cross) = self.cross.get(beside.first[b] + c) {
                    for i in 0..N {
                        f[i] = beside.part[b][c].mul_add(cross[i], f[i]);
                    }
                }
            }
        }
        let size = self.cross.len();
        for (k, cross) in self.cross.iter().enumerate() {
            let mut sum = T::zero();
            for j in 0..K {
                if j < N {
                    sum = cross[j].mul_add(row[j], sum);
                }
            }
            let own = self.constants.get(k * size..(k + 1) * size).unwrap_or(&[]);
            if let Some(out) = rest.get_mut(k) {
                *out = sum + beside.dot(own);
            }
        }
        f
    }

    #[inline(always)]
    fn absorb<const K: usize>(&mut self, row: &[T; K], beside: &Beside<T>, rest: &mut [T]) -> (T, [T; N]) {
        let f = self.times(row, beside, rest);
        let mut variance = T::one() + beside.dot(rest);
        for j in 0..K {
            if j < N {
                variance = row[j].mul_add(f[j], variance);
            }
        }
        let inverse = variance.recip();
        let mut gain = f;
        for i in 0..N {
            gain[i] = inverse * f[i];
        }
        self.settle(row, beside, &f, rest, &gain, inverse);
        for value in rest.iter_mut() {
            *value = inverse * *value;
        }
        (variance, gain)
    }
}

impl<T: Real, const N: usize> Joint<'_, T, N> {
    /// `A = P − k fᵀ`, and `P⁺ = A − (A h) kᵀ + k kᵀ`: Joseph's form, a sum of positive matrices whatever the rounding of
    /// the gain `k`. `f` of the constants is in `rest`, their gain is `inverse` times it.
    #[inline(always)]
    fn settle<const K: usize>(
        &mut self,
        row: &[T; K],
        beside: &Beside<T>,
        f: &[T; N],
        rest: &[T],
        gain: &[T; N],
        inverse: T,
    ) {
        // k − A h, column by column as above.
        let mut left = *gain;
        for j in 0..K {
            if j < N {
                for i in 0..N {
                    let a = (-gain[i]).mul_add(f[j], self.state[j][i]);
                    left[i] = (-a).mul_add(row[j], left[i]);
                }
            }
        }
        for b in 0..beside.count {
            for c in 0..3 {
                let column = beside.first[b] + c;
                if let (Some(cross), Some(f_l)) = (self.cross.get(column), rest.get(column)) {
                    for i in 0..N {
                        let a = (-gain[i]).mul_add(*f_l, cross[i]);
                        left[i] = (-a).mul_add(beside.part[b][c], left[i]);
                    }
                }
            }
        }
        let mut out = *self.state;
        for i in 0..N {
            for j in 0..N {
                out[i][j] = left[i].mul_add(gain[j], (-gain[i]).mul_add(f[j], out[i][j]));
            }
        }
        self.settle_constants(row, beside, f, rest, gain, inverse);
        // Rounding differs between the triangles: the upper one counts.
        *self.state = mirrored(&out);
    }

    /// The same for the rows of the constants. Their lower triangle stays as it was until all are done.
    #[inline(always)]
    fn settle_constants<const K: usize>(
        &mut self,
        row: &[T; K],
        beside: &Beside<T>,
        f: &[T; N],
        rest: &[T],
        gain: &[T; N],
        inverse: T,
    ) {
        let size = self.cross.len();
        if size == 0 {
            return;
        }
        for (k, (cross, own)) in self.cross.iter_mut().zip(self.constants.chunks_exact_mut(size)).enumerate()
        {
            let f_k = rest.get(k).copied().unwrap_or(T::zero());
            let gain_k = inverse * f_k;
            let mut left = gain_k;
            for j in 0..K {
                if j < N {
                    let a = (-gain_k).mul_add(f[j], cross[j]);
                    left = (-a).mul_add(row[j], left);
                }
            }
            for b in 0..beside.count {
                for c in 0..3 {
                    let column = beside.first[b] + c;
                    if let (Some(p), Some(f_l)) = (own.get(column), rest.get(column)) {
                        let a = (-gain_k).mul_add(*f_l, *p);
                        left = (-a).mul_add(beside.part[b][c], left);
                    }
                }
            }
            for i in 0..N {
                cross[i] = left.mul_add(gain[i], (-f_k).mul_add(gain[i], cross[i]));
            }
            for (p, f_l) in own.iter_mut().zip(rest).skip(k) {
                *p = left.mul_add(inverse * *f_l, (-gain_k).mul_add(*f_l, *p));
            }
        }
        for k in 1..size {
            let (above, below) = self.constants.split_at_mut(k * size);
            for (l, p) in below.iter_mut().take(k).enumerate() {
                *p = above.get(l * size + k).copied().unwrap_or(*p);
            }
        }
    }
}

/// Factors of the state alone: constants have no place in them.
impl<T: Real, const N: usize> JointCovariance<T, N> for Ud<T, N> {
    #[inline(always)]
    fn times<const K: usize>(&self, row: &[T; K], _beside: &Beside<T>, _rest: &mut [T]) -> [T; N] {
        Covariance::<T, N>::times(self, &blocks(row))
    }

    #[inline(always)]
    fn absorb<const K: usize>(&mut self, row: &[T; K], _beside: &Beside<T>, _rest: &mut [T]) -> (T, [T; N]) {
        Covariance::<T, N>::absorb(self, &blocks(row))
    }
}

/// A row from the front as blocks of three columns; those beyond it are empty.
#[inline(always)]
fn blocks<T: Real, const K: usize>(row: &[T; K]) -> Sparse<T, BLOCKS> {
    let mut sparse = Sparse { first: [0; BLOCKS], part: [[T::zero(); 3]; BLOCKS] };
    for b in 0..BLOCKS {
        sparse.first[b] = 3 * b;
        for c in 0..3 {
            if 3 * b + c < K {
                sparse.part[b][c] = row[3 * b + c];
            }
        }
    }
    sparse
}

/// Blocks of three columns in the largest state.
const BLOCKS: usize = 6;
