//! Every size as part of the largest: what is not estimated has no variance and takes part in nothing.
//!
//! Where speed does not count one compiled size is enough.
use losnav_core::models::dynamics::strapdown::Strapdown;
use losnav_core::models::nav_state::{acceleration, biases};

use super::belief::{Belief, NUMBERS};
use crate::filter::Settings;
use crate::gravity::AnyGravity;

/// Components of the largest error: `[δr δv δα δb_a δb_g δd]`.
pub const WIDE: usize = 18;

/// Where the components of an error of `n` stand in the largest.
pub fn columns(n: usize) -> Vec<usize> {
    let mut columns: Vec<usize> = (0..9).collect();
    if biases(n).is_some() {
        columns.extend(9..15);
    }
    if acceleration(n).is_some() {
        columns.extend(15..WIDE);
    }
    columns
}

/// A matrix `(m, n)` with its columns at their places.
pub fn spread(rows: &[f64], n: usize) -> Vec<f64> {
    let columns = columns(n);
    let mut out = Vec::with_capacity(rows.len() / n * WIDE);
    for row in rows.chunks_exact(n) {
        let mut wide = [0.0; WIDE];
        for (value, at) in row.iter().zip(&columns) {
            wide[*at] = *value;
        }
        out.extend(wide);
    }
    out
}

/// A matrix `(n, n)` with its rows and columns at their places.
pub fn spread_square(matrix: &[f64], n: usize) -> Vec<f64> {
    let mut out = vec![0.0; WIDE * WIDE];
    for (row, at) in spread(matrix, n).chunks_exact(WIDE).zip(columns(n)) {
        out[at * WIDE..(at + 1) * WIDE].copy_from_slice(row);
    }
    out
}

/// The columns of an error of `n` of `(m, 18)`.
pub fn pick(rows: &[f64], n: usize) -> Vec<f64> {
    let columns = columns(n);
    rows.chunks_exact(WIDE).flat_map(|row| columns.iter().map(|at| row[*at]).collect::<Vec<_>>()).collect()
}

/// Rows and columns of an error of `n` of `(18, 18)`.
pub fn pick_square(matrix: &[f64], n: usize) -> Vec<f64> {
    let rows: Vec<f64> =
        columns(n).iter().flat_map(|at| matrix[at * WIDE..(at + 1) * WIDE].iter().copied()).collect();
    pick(&rows, n)
}

/// What [`Craft::write_prior`](super::belief::Craft::write_prior) wrote, of an error of `n`.
pub fn pick_prior(prior: &[f64], n: usize) -> Vec<f64> {
    let columns = columns(n);
    let mut out = Vec::new();
    for one in prior.chunks_exact(NUMBERS + WIDE * (WIDE + 1) / 2) {
        let (state, triangle) = one.split_at(NUMBERS);
        out.extend(state);
        for (k, i) in columns.iter().enumerate() {
            // Row i of the triangle starts after i rows of 18, 17, … entries.
            let start = i * WIDE - i * i.saturating_sub(1) / 2;
            out.extend(columns.iter().skip(k).map(|j| triangle[start + j - i]));
        }
    }
    out
}

/// An estimate of `n` as one of all.
pub fn widened(belief: &Belief, n: usize) -> Belief {
    let mut wide = belief.clone();
    wide.stored = spread_square(&belief.stored, n);
    wide.cross = spread(&belief.cross, n);
    wide
}

/// And back.
pub fn narrowed(wide: Belief, n: usize) -> Belief {
    let (stored, cross) = (pick_square(&wide.stored, n), pick(&wide.cross, n));
    Belief { stored, cross, ..wide }
}

/// Considered components at their places.
pub fn settings(settings: &Settings, n: usize) -> Settings {
    let mut wide = settings.clone();
    wide.consider = settings.consider.as_ref().map(|flags| {
        let mut all = vec![false; WIDE];
        for (flag, at) in flags.iter().zip(columns(n)) {
            all[at] = *flag;
        }
        all
    });
    wide
}

/// A model that disturbs only what an error of `n` has.
pub fn model(model: &Strapdown<AnyGravity>, n: usize) -> Strapdown<AnyGravity> {
    let mut wide = model.clone();
    if biases(n).is_none() {
        (wide.noise.accelerometer_bias, wide.noise.gyroscope_bias) = (0.0, 0.0);
    }
    if acceleration(n).is_none() {
        (wide.noise.deviation, wide.noise.time_constant) = (0.0, f64::INFINITY);
    }
    wide
}
