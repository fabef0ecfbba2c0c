//! What of the core comes in every width: a covariance form and a dynamics model, for any lanes.
use losnav_core::estimators::kalman::{Covariance, Joseph, Ud};
use losnav_core::math::real::Real;
use losnav_core::models::dynamics::DynamicsModel;

use crate::dynamics::listed::{ClohessyWiltshire, PerturbedTwoBody, TwoBody};

/// A covariance form, for any scalar and size.
pub trait Form: Clone + Send + Sync + 'static {
    /// Are the numbers it is kept in the covariance itself?
    const PLAIN: bool;
    /// Are arcs side by side worth their code?
    const LANES: bool;
    /// The form of that scalar and size.
    type Of<T: Real, const N: usize>: Covariance<T, N>;
}

/// [`Joseph`].
#[derive(Clone)]
pub struct JosephForm;
/// [`Ud`].
#[derive(Clone)]
pub struct UdForm;

impl Form for JosephForm {
    const PLAIN: bool = true;
    const LANES: bool = true;
    type Of<T: Real, const N: usize> = Joseph<T, N>;
}
impl Form for UdForm {
    const PLAIN: bool = false;
    const LANES: bool = false;
    type Of<T: Real, const N: usize> = Ud<T, N>;
}

/// A model of an array-valued state under an acceleration, for any scalar.
pub trait Widths<const N: usize>: Clone + Send + Sync + 'static {
    /// Are arcs side by side worth their code?  Not if their steps are chosen along the way.
    const LANES: bool;
    /// What a step needs whatever the state.
    type Step: Copy + Send + Sync;
    /// The model of that scalar.
    type Of<T: Real>: DynamicsModel<T, N, State = [T; N], Control = [T; 3], Step = Self::Step>;
    /// It is the same object.
    fn of<T: Real>(&self) -> &Self::Of<T>;
}

/// The models the filter holds itself: calls `$then!{Name: size, …}`. Each is compiled with every form, so those of the list
/// that are not here run through Python, like a user's own.
macro_rules! held {
    ($then:ident) => {
        $then! { ClohessyWiltshire: 6, TwoBody: 6, PerturbedTwoBody: 6 }
    };
}
pub(crate) use held;

macro_rules! every_width {
    ($($listed:ident: $n:literal),* $(,)?) => {
        $(impl Widths<$n> for $listed {
            const LANES: bool = matches!(stringify!($listed).as_bytes(), b"ClohessyWiltshire");
            type Step = <$listed as DynamicsModel<f64, $n>>::Step;
            type Of<T: Real> = Self;
            #[inline(always)]
            fn of<T: Real>(&self) -> &Self {
                self
            }
        })*
    };
}
held! { every_width }
