//! One step of one filter.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::{Covariance, Estimate, predict};
use losnav_core::math::real::Mask;
use losnav_core::math::vec3::splat;

use super::advance::Take;
use super::arcs::in_lane;
use super::engine::Look;
use super::family::{Form, Widths, convert};
use crate::dispatch::{Job, Lanes};

/// One estimate, one step, at most one measurement.
pub struct Single<'a, D: Widths<N>, F: Form, const N: usize> {
    pub dynamics: &'a D,
    pub step: Option<&'a D::Step>,
    pub control: [f64; 3],
    pub prior: &'a Estimate<[f64; N], F::Of<f64, N>>,
    pub look: Option<&'a Look<'a>>,
    pub innovation: &'a mut [f64],
}

/// An estimate after a measurement, as plain numbers.
pub struct Taken<F: Form, const N: usize> {
    pub estimate: Estimate<[f64; N], F::Of<f64, N>>,
    pub nis: f64,
    pub dof: usize,
    pub accepted: bool,
}

pub type Answer<F, const N: usize> =
    (Estimate<[f64; N], <F as Form>::Of<f64, N>>, Option<Result<Taken<F, N>, ModelError>>);

impl<D: Widths<N>, F: Form, const N: usize> Job for Single<'_, D, F, N> {
    type Output = Answer<F, N>;

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(self) -> Self::Output {
        let stored = convert(self.prior.covariance.stored(), S::splat);
        let mut estimate = Estimate {
            state: self.prior.state.map(S::splat),
            covariance: F::Of::<S, N>::from_stored(stored),
        };
        if let Some(step) = self.step {
            let model = self.dynamics.of::<S>();
            estimate = predict(model, step, splat(self.control), &estimate);
        }
        let predicted = in_lane(&estimate, 0);
        let Some(look) = self.look else { return (predicted, None) };
        let (mut z, mut innovation) = ([S::zero(); FEW], [S::zero(); FEW]);
        let (mut many_z, mut many) = (Vec::new(), Vec::new());
        let (z, innovation): (&mut [S], &mut [S]) = if look.z.len() <= FEW {
            (&mut z[..look.z.len()], &mut innovation[..look.z.len()])
        } else {
            many_z.resize(look.z.len(), S::zero());
            many.resize(look.z.len(), S::zero());
            (&mut many_z, &mut many)
        };
        for (out, value) in z.iter_mut().zip(look.z) {
            *out = S::splat(*value);
        }
        let dcm = look.dcm.map(splat);
        let options = look.settings.options::<N>();
        let bound = S::splat(look.bound);
        let updated = Err(ModelError::ZeroRange { index: 0 });
        let mut take = Take { prior: &estimate, dcm: &dcm, options: &options, bound, innovation, updated };
        look.source.show(z, &mut take);
        let taken = take.updated.map(|updated| Taken {
            estimate: in_lane(&updated.estimate, 0),
            nis: updated.nis.lane(0),
            dof: updated.dof,
            accepted: updated.accepted.lane(0),
        });
        for (out, value) in self.innovation.iter_mut().zip(innovation) {
            *out = value.lane(0);
        }
        (predicted, Some(taken))
    }
}

/// Numbers in a measurement that need no heap.
const FEW: usize = 8;
