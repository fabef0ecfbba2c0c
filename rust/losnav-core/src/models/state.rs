//! What is estimated: a point, and the small corrections that move it.
use super::kinematics::Kinematics;
use crate::math::real::Real;
use crate::math::vec3::Mat3;

/// First tangent column of each part that a sensor can see; `None` where the state does not have it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Columns {
    /// `δr`, reference axes.
    pub position: usize,
    /// `δv`, reference axes.
    pub velocity: Option<usize>,
    /// `δα`, body axes.
    pub attitude: Option<usize>,
}

/// A state whose errors, true minus estimate, are `N` numbers.
pub trait State<T: Real, const N: usize>: Copy {
    /// Where the parts stand in the error.
    const COLUMNS: Columns;
    /// How many numbers the state itself is kept in: more than `N` where it holds a quaternion.
    const NUMBERS: usize;

    /// What a sensor sees; `dcm` is the given attitude, used where the state has none.
    fn kinematics(&self, dcm: &Mat3<T>) -> Kinematics<T>;
    /// The state corrected by `δ`.
    #[must_use]
    fn inject(&self, delta: &[T; N]) -> Self;
    /// The `δ` that leads from `other` to this.
    fn minus(&self, other: &Self) -> [T; N];
    /// Lane-wise choice.
    #[must_use]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self;
    /// Is every number finite?
    fn is_finite(&self) -> T::Mask;
    /// Number `i` of those it is kept in; zero past the last.
    fn number(&self, i: usize) -> T;
    /// Sets number `i`; nothing past the last.
    fn set_number(&mut self, i: usize, value: T);
}

/// `[r v …]`: six numbers, or more that sensors do not see.
impl<T: Real, const N: usize> State<T, N> for [T; N] {
    const COLUMNS: Columns = Columns { position: 0, velocity: Some(3), attitude: None };
    const NUMBERS: usize = N;

    #[inline(always)]
    fn kinematics(&self, dcm: &Mat3<T>) -> Kinematics<T> {
        let (mut position, mut velocity) = ([T::zero(); 3], [T::zero(); 3]);
        for i in 0..3 {
            if i < N {
                position[i] = self[i];
            }
            if i + 3 < N {
                velocity[i] = self[i + 3];
            }
        }
        Kinematics { position, velocity, dcm: *dcm }
    }

    #[inline(always)]
    fn inject(&self, delta: &[T; N]) -> Self {
        let mut moved = *self;
        for i in 0..N {
            moved[i] += delta[i];
        }
        moved
    }

    #[inline(always)]
    fn minus(&self, other: &Self) -> [T; N] {
        let mut delta = *self;
        for i in 0..N {
            delta[i] -= other[i];
        }
        delta
    }

    #[inline(always)]
    fn select(mask: T::Mask, yes: &Self, no: &Self) -> Self {
        let mut chosen = *no;
        for i in 0..N {
            chosen[i] = T::select(mask, yes[i], no[i]);
        }
        chosen
    }

    #[inline(always)]
    fn is_finite(&self) -> T::Mask {
        let mut sum = T::zero();
        for i in 0..N {
            // Zero, or NaN where the number is infinite or NaN: one comparison for all.
            sum += self[i] * T::zero();
        }
        sum.is_finite()
    }

    #[inline(always)]
    fn number(&self, i: usize) -> T {
        if i < N { self[i] } else { T::zero() }
    }

    #[inline(always)]
    fn set_number(&mut self, i: usize, value: T) {
        if i < N {
            self[i] = value;
        }
    }
}
