//! Back over recorded arcs, several in the lanes.
use losnav_core::estimators::kalman::{Covariance, Estimate, Joseph, Matrix, Smoothed, smooth_back};
use losnav_core::models::dynamics::DynamicsModel;

use super::arcs::{Layout, write};
use super::engine::Passage;
use super::family::Widths;
use crate::dispatch::{Job, Lanes};

/// One group of arcs, smoothed in place.
pub struct Backward<'a, D, const N: usize> {
    pub dynamics: &'a D,
    pub passage: &'a Passage,
    pub layout: &'a Layout,
    pub lanes: usize,
    pub runs: usize,
    /// The first run of the group.
    pub first: usize,
    /// The group's part of the record.
    pub data: &'a mut [f64],
}

impl<D: Widths<N>, const N: usize> Job for Backward<'_, D, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(self) {
        if self.lanes == 1 { self.group::<S>() } else { self.group::<V>() }
    }
}

impl<D: Widths<N>, const N: usize> Backward<'_, D, N> {
    #[inline(always)]
    fn group<V: Lanes>(self) {
        let model = self.dynamics.of::<V>();
        let size = self.layout.entries() * V::LANES;
        let epochs = self.passage.steps.len();
        if epochs == 0 || self.data.len() < epochs * size {
            return;
        }
        let mut prepared: Option<(f64, f64, D::Step)> = None;
        let (state, covariance) = read::<V, N>(&self.data[(epochs - 1) * size..]);
        let mut later = Smoothed { state, covariance: Joseph::from_stored(covariance).matrix() };
        for epoch in (0..epochs - 1).rev() {
            let (start, dt) = (self.passage.starts[epoch + 1], self.passage.steps[epoch + 1]);
            let out = &mut self.data[epoch * size..(epoch + 1) * size];
            if dt != 0.0 {
                let varying = <D::Of<V> as DynamicsModel<V, N>>::TIME_VARYING;
                let step = match prepared {
                    Some((from, length, step)) if length == dt && (!varying || from == start) => step,
                    _ => model.prepare(start, dt),
                };
                prepared = Some((start, dt, step));
                let mut control = [V::zero(); 3];
                if let Some(controls) = self.passage.controls() {
                    controls.read(self.first, self.runs - 1, epoch + 1, &mut control);
                }
                let (state, covariance) = read::<V, N>(out);
                let filtered = Estimate { state, covariance: Joseph::from_stored(covariance) };
                later = smooth_back(model, &step, control, &filtered, &later);
            }
            let mut at = N;
            for i in 0..N {
                write(out, i, later.state[i]);
                for j in i..N {
                    write(out, at, later.covariance[i][j]);
                    at += 1;
                }
            }
        }
    }
}

/// State and upper triangle of the covariance.
#[inline(always)]
fn read<V: Lanes, const N: usize>(data: &[f64]) -> ([V; N], Matrix<V, N>) {
    let entry = |k: usize| V::gather(|lane| data[k * V::LANES + lane]);
    let (mut state, mut covariance, mut at) = ([V::zero(); N], [[V::zero(); N]; N], N);
    for i in 0..N {
        state[i] = entry(i);
        for j in i..N {
            covariance[i][j] = entry(at);
            at += 1;
        }
    }
    (state, covariance)
}
