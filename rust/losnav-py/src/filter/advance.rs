//! A step of the filter in lanes: what single steps and whole arcs have in common.
use losnav_core::error::ModelError;
use losnav_core::estimators::kalman::{Covariance, Estimate, Options, Updated, update};
use losnav_core::math::real::Real;
use losnav_core::math::vec3::Mat3;
use losnav_core::models::linearization::{Direction, Linearization, Sink};
use losnav_core::models::sensors::{Law, SensorModel};
use losnav_core::models::state::State;

/// Updates an estimate with whatever sensor it is shown.
pub struct Take<'a, T: Real, P, const N: usize> {
    /// Before.
    pub prior: &'a Estimate<[T; N], P>,
    /// Given attitude.
    pub dcm: &'a Mat3<T>,
    /// Settings.
    pub options: &'a Options<N>,
    /// Bound on the normalised innovation squared.
    pub bound: T,
    /// Receives `z ⊟ h(x)` at the prior.
    pub innovation: &'a mut [T],
    /// Receives the answer.
    pub updated: Result<Updated<T, [T; N], P>, ModelError>,
}

impl<T: Real, P: Covariance<T, N>, const N: usize> Law<T> for Take<'_, T, P, N> {
    #[inline(always)]
    fn examine(&mut self, sensor: &impl SensorModel<T>) {
        let mut innovation = Innovation { out: self.innovation, at: 0 };
        let seen = sensor.linearize(&self.prior.state.kinematics(self.dcm), &mut innovation);
        self.updated = match seen {
            Ok(()) => update(self.prior, sensor, self.dcm, self.options, self.bound),
            Err(error) => Err(error),
        };
    }
}

/// Writes down innovations; of the linearisation nothing else is computed.
struct Innovation<'a, T> {
    out: &'a mut [T],
    at: usize,
}

impl<T: Real> Innovation<'_, T> {
    #[inline(always)]
    fn write<const M: usize>(&mut self, rows: &[T; M]) {
        if let Some(out) = self.out.get_mut(self.at..self.at + M) {
            out.copy_from_slice(rows);
        }
        self.at += M;
    }
}

impl<T: Real> Sink<T> for Innovation<'_, T> {
    #[inline(always)]
    fn add<const M: usize>(&mut self, rows: &Linearization<T, M>) {
        self.write(&rows.innovation);
    }

    #[inline(always)]
    fn add_direction(&mut self, direction: &Direction<T>, _dcm: &Mat3<T>) {
        self.write(&direction.innovation);
    }
}
