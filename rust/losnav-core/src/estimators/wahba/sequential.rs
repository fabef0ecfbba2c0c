//! Sequential rotations: the same problem with the reference turned by half a turn about x, y or z.
//!
//! A half turn about axis `k` changes the sign of the two other columns of `B`; the answer is `q = e_k ⊗ q'`. One of the four
//! problems has a rotation angle of at most 120°, and one of at least 120°: whichever end a formula cannot stand, it
//! need not see it (Shuster & Oh 1981).
use crate::math::real::{Mask, Real};
use crate::math::so3::Quaternion;
use crate::math::vec3::Mat3;

/// Which turn: `about[k]` for axis `k`, none of them for no turn.
#[derive(Clone, Copy, Debug)]
pub struct HalfTurn<M> {
    about: [M; 3],
}

impl<M: Mask> HalfTurn<M> {
    /// The turn whose score is largest; scores are of `[x, y, z, none]`.
    #[inline(always)]
    pub fn of_largest<T: Real<Mask = M>>(score: [T; 4]) -> Self {
        let largest = score[0].max(score[1]).max(score[2].max(score[3]));
        let none = largest.le(score[3]);
        let x = largest.le(score[0]).and(none.not());
        let y = largest.le(score[1]).and(none.or(x).not());
        let z = none.or(x).or(y).not();
        Self { about: [x, y, z] }
    }

    /// `B` of the turned problem.
    #[inline(always)]
    pub fn turn<T: Real<Mask = M>>(&self, b: &Mat3<T>) -> Mat3<T> {
        let [x, y, z] = self.about;
        let (one, minus) = (T::one(), -T::one());
        let sign =
            [T::select(y.or(z), minus, one), T::select(x.or(z), minus, one), T::select(x.or(y), minus, one)];
        let mut turned = *b;
        for row in &mut turned {
            for (entry, sign) in row.iter_mut().zip(sign) {
                *entry = *entry * sign;
            }
        }
        turned
    }

    /// The answer of the problem as it was: `e_k ⊗ q'`.
    #[inline(always)]
    pub fn undo<T: Real<Mask = M>>(&self, q: Quaternion<T>) -> Quaternion<T> {
        let [x, y, z] = self.about;
        let pick = |none: T, of_x: T, of_y: T, of_z: T| {
            T::select(x, of_x, T::select(y, of_y, T::select(z, of_z, none)))
        };
        [
            pick(q[0], q[3], q[2], -q[1]),
            pick(q[1], -q[2], q[3], q[0]),
            pick(q[2], q[1], -q[0], q[3]),
            pick(q[3], -q[0], -q[1], -q[2]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::so3::{dcm_from_quaternion, quaternion_product};
    use crate::math::vec3::{mul, transpose};

    #[test]
    fn undo_is_the_product_and_turn_is_the_matrix() {
        let q = [0.5, -0.1, 0.7, 0.5];
        let b = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]];
        for axis in 0..4 {
            let mut score = [0.0, 0.1, 0.2, 0.3];
            score[axis] = 1.0;
            let turn = HalfTurn::of_largest(score);
            let mut e = [0.0; 4];
            e[axis] = 1.0;
            assert_eq!(turn.undo(q), quaternion_product(e, q));
            // A half turn is its own transpose.
            let matrix = transpose(&dcm_from_quaternion(e));
            assert_eq!(turn.turn(&b), mul(&b, &matrix));
        }
    }

    #[test]
    fn ties_choose_one() {
        let turn = HalfTurn::of_largest([1.0, 1.0, 1.0, 0.0]);
        assert_eq!(turn.about, [true, false, false]);
        assert_eq!(HalfTurn::of_largest([1.0; 4]).about, [false; 3]);
    }
}
