//! The two forms a covariance is kept in, where constants may stand beside the state.
use losnav_core::estimators::kalman::{Covariance, Joint, JointCovariance, Joseph, Ud};
use losnav_core::math::matrix::Matrix;
use losnav_core::models::dynamics::DynamicsModel;

use crate::dispatch::Lanes;

/// A covariance form.
pub trait InertialForm: Send + Sync + 'static {
    /// What of the state is kept.
    type Core<V: Lanes, const N: usize>: Copy;
    /// All of it, opened for a measurement.
    type Open<'a, V: Lanes, const N: usize>: JointCovariance<V, N>;

    /// From the covariance of the state, or the numbers it was stored in.
    fn read<V: Lanes, const N: usize>(matrix: &Matrix<V, N>, stored: bool) -> Self::Core<V, N>;
    /// The numbers to store.
    fn stored<V: Lanes, const N: usize>(core: &Self::Core<V, N>) -> Matrix<V, N>;
    /// The covariance of the state.
    fn matrix<V: Lanes, const N: usize>(core: &Self::Core<V, N>) -> Matrix<V, N>;
    /// Opens it.
    fn open<'a, V: Lanes, const N: usize>(
        core: &'a mut Self::Core<V, N>,
        cross: &'a mut [[V; N]],
        constants: &'a mut [V],
    ) -> Self::Open<'a, V, N>;
    /// A step in time.
    fn propagate<V: Lanes, D: DynamicsModel<V, N>, const N: usize>(
        core: &mut Self::Core<V, N>,
        cross: &mut [[V; N]],
        dynamics: &D,
        step: &D::Step,
        transition: &Matrix<V, N>,
        noise: &Matrix<V, N>,
    );
    /// The block of the considered components as it was before.
    fn put_back<V: Lanes, const N: usize>(
        core: &mut Self::Core<V, N>,
        before: &Self::Core<V, N>,
        considered: &[bool; N],
    );
    /// Is every variance finite?
    fn is_finite<V: Lanes, const N: usize>(core: &Self::Core<V, N>) -> V::Mask;
}

/// [`Joseph`].
pub struct JosephInertial;
/// [`Ud`].
pub struct UdInertial;

impl InertialForm for JosephInertial {
    type Core<V: Lanes, const N: usize> = Matrix<V, N>;
    type Open<'a, V: Lanes, const N: usize> = Joint<'a, V, N>;

    #[inline(always)]
    fn read<V: Lanes, const N: usize>(matrix: &Matrix<V, N>, _stored: bool) -> Matrix<V, N> {
        *matrix
    }

    #[inline(always)]
    fn stored<V: Lanes, const N: usize>(core: &Matrix<V, N>) -> Matrix<V, N> {
        *core
    }

    #[inline(always)]
    fn matrix<V: Lanes, const N: usize>(core: &Matrix<V, N>) -> Matrix<V, N> {
        *core
    }

    #[inline(always)]
    fn open<'a, V: Lanes, const N: usize>(
        core: &'a mut Matrix<V, N>,
        cross: &'a mut [[V; N]],
        constants: &'a mut [V],
    ) -> Joint<'a, V, N> {
        Joint { state: core, cross, constants }
    }

    #[inline(always)]
    fn propagate<V: Lanes, D: DynamicsModel<V, N>, const N: usize>(
        core: &mut Matrix<V, N>,
        cross: &mut [[V; N]],
        dynamics: &D,
        step: &D::Step,
        transition: &Matrix<V, N>,
        noise: &Matrix<V, N>,
    ) {
        Joint { state: core, cross, constants: &mut [] }.propagate(dynamics, step, transition, noise);
    }

    #[inline(always)]
    fn put_back<V: Lanes, const N: usize>(
        core: &mut Matrix<V, N>,
        before: &Matrix<V, N>,
        considered: &[bool; N],
    ) {
        for i in 0..N {
            for j in 0..N {
                if considered[i] && considered[j] {
                    core[i][j] = before[i][j];
                }
            }
        }
    }

    #[inline(always)]
    fn is_finite<V: Lanes, const N: usize>(core: &Matrix<V, N>) -> V::Mask {
        Joseph::<V, N>::from_stored(*core).is_finite()
    }
}

impl InertialForm for UdInertial {
    type Core<V: Lanes, const N: usize> = Ud<V, N>;
    type Open<'a, V: Lanes, const N: usize> = &'a mut Ud<V, N>;

    #[inline(always)]
    fn read<V: Lanes, const N: usize>(matrix: &Matrix<V, N>, stored: bool) -> Ud<V, N> {
        if stored { Ud::from_stored(*matrix) } else { Ud::new(matrix) }
    }

    #[inline(always)]
    fn stored<V: Lanes, const N: usize>(core: &Ud<V, N>) -> Matrix<V, N> {
        *Covariance::stored(core)
    }

    #[inline(always)]
    fn matrix<V: Lanes, const N: usize>(core: &Ud<V, N>) -> Matrix<V, N> {
        Covariance::matrix(core)
    }

    #[inline(always)]
    fn open<'a, V: Lanes, const N: usize>(
        core: &'a mut Ud<V, N>,
        _cross: &'a mut [[V; N]],
        _constants: &'a mut [V],
    ) -> &'a mut Ud<V, N> {
        core
    }

    #[inline(always)]
    fn propagate<V: Lanes, D: DynamicsModel<V, N>, const N: usize>(
        core: &mut Ud<V, N>,
        _cross: &mut [[V; N]],
        dynamics: &D,
        step: &D::Step,
        transition: &Matrix<V, N>,
        noise: &Matrix<V, N>,
    ) {
        *core = Covariance::propagate(core, dynamics, step, transition, noise);
    }

    #[inline(always)]
    fn put_back<V: Lanes, const N: usize>(core: &mut Ud<V, N>, before: &Ud<V, N>, considered: &[bool; N]) {
        *core = core.with_block_of(before, considered);
    }

    #[inline(always)]
    fn is_finite<V: Lanes, const N: usize>(core: &Ud<V, N>) -> V::Mask {
        Covariance::is_finite(core)
    }
}
