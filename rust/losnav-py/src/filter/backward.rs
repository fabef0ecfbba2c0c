//! Back over recorded arcs, several in the lanes.
use core::marker::PhantomData;

use losnav_core::estimators::kalman::{Covariance, Smoothed, smooth_back};

use super::advance::{Runs, entries, load, write};
use super::arcs::{Layout, Steps};
use super::engine::Passage;
use super::family::{Form, Widths};
use crate::dispatch::{LaneJob, Lanes};

/// One group of arcs, smoothed in place: the covariances themselves take the place of what they were kept in.
pub struct Backward<'a, D: Widths<N>, F, const N: usize> {
    pub dynamics: &'a D,
    pub steps: &'a Steps<D::Step>,
    pub passage: &'a Passage,
    pub layout: &'a Layout,
    pub runs: Runs,
    /// The group's part of the record.
    pub data: &'a mut [f64],
    pub form: PhantomData<F>,
}

impl<D: Widths<N>, F: Form, const N: usize> LaneJob for Backward<'_, D, F, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let model = self.dynamics.of::<V>();
        let size = self.layout.entries() * V::LANES;
        let epochs = self.passage.steps.len();
        let mut later: Option<Smoothed<V, [V; N], N>> = None;
        for epoch in (0..epochs).rev() {
            let Some(out) = self.data.get_mut(epoch * size..(epoch + 1) * size) else { return };
            let filtered = load::<V, F::Of<V, N>, N>(&out[..entries(N) * V::LANES]);
            let smoothed = match later {
                None => Smoothed { state: filtered.state, covariance: filtered.covariance.matrix() },
                // Two epochs at one time: one knows what the other does.
                Some(later) if self.passage.steps[epoch + 1] == 0.0 => later,
                Some(later) => {
                    let Some(step) = self.steps.to(epoch + 1) else { return };
                    let mut control = [V::zero(); 3];
                    if let Some(controls) = self.passage.controls() {
                        controls.read(self.runs, epoch + 1, &mut control);
                    }
                    smooth_back(model, step, control, &filtered, &later)
                }
            };
            let mut at = N;
            for i in 0..N {
                write(out, i, smoothed.state[i]);
                for j in i..N {
                    write(out, at, smoothed.covariance[i][j]);
                    at += 1;
                }
            }
            later = Some(smoothed);
        }
    }
}
