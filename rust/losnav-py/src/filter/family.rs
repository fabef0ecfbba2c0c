//! What of the core comes in every width: a covariance form and a dynamics model, for any lanes.
use losnav_core::estimators::kalman::{Covariance, Joseph, Matrix, Ud};
use losnav_core::math::real::Real;
use losnav_core::models::dynamics::{ClohessyWiltshire, DynamicsModel, TwoBody};

/// A covariance form, for any scalar and size.
pub trait Form: Send + Sync + 'static {
    /// The form of that scalar and size.
    type Of<T: Real, const N: usize>: Covariance<T, N>;
}

/// [`Joseph`].
pub struct JosephForm;
/// [`Ud`].
pub struct UdForm;

impl Form for JosephForm {
    type Of<T: Real, const N: usize> = Joseph<T, N>;
}
impl Form for UdForm {
    type Of<T: Real, const N: usize> = Ud<T, N>;
}

/// A model of an array-valued state under an acceleration, for any scalar.
pub trait Widths<const N: usize>: Clone + Send + Sync + 'static {
    /// What a step needs whatever the state.
    type Step: Copy + Send + Sync;
    /// The model of that scalar.
    type Of<T: Real>: DynamicsModel<T, N, State = [T; N], Control = [T; 3], Step = Self::Step>;
    /// It is the same object.
    fn of<T: Real>(&self) -> &Self::Of<T>;
}

macro_rules! every_width {
    ($($listed:ident: $n:literal),* $(,)?) => {
        $(impl Widths<$n> for $listed {
            type Step = <$listed as DynamicsModel<f64, $n>>::Step;
            type Of<T: Real> = Self;
            #[inline(always)]
            fn of<T: Real>(&self) -> &Self {
                self
            }
        })*
    };
}
losnav_core::dynamics! { every_width }

/// The numbers a form is kept in, in other lanes.
#[inline(always)]
pub fn convert<A: Real, B: Real, const N: usize>(
    stored: &Matrix<A, N>,
    each: impl Fn(A) -> B,
) -> Matrix<B, N> {
    let mut out = [[B::zero(); N]; N];
    for i in 0..N {
        for j in i..N {
            out[i][j] = each(stored[i][j]);
        }
    }
    out
}
