//! Estimates of one size and form, and what models in Python may do to them.
use core::marker::PhantomData;

use losnav_core::estimators::kalman::{Covariance, Estimate, Joseph, Rows, Sparse, with_consider};
use losnav_core::models::dynamics::DynamicsModel;
use losnav_core::models::state::State;

use super::advance::{entries, load, store};
use super::engine::Settings;
use super::family::Form;

/// Whitened rows of a sensor in Python: `innovation ≈ H δ` with unit noise, linearised at `prior + offset`.
pub struct Given<'a> {
    pub innovation: &'a [f64],
    /// `(M, n)`.
    pub jacobian: &'a [f64],
    pub offset: &'a [f64],
    pub settings: &'a Settings,
}

type Belief<F, const N: usize> = Estimate<[f64; N], <F as Form>::Of<f64, N>>;

/// Estimates in a size `N ≥ n`; components beyond `n` are independent of everything.
#[derive(Clone)]
pub struct Core<F: Form, const N: usize> {
    n: usize,
    /// Groups of one, see [`advance`](super::advance).
    pub estimates: Vec<f64>,
    attempt: Vec<f64>,
    form: PhantomData<F>,
}

impl<F: Form, const N: usize> Core<F, N> {
    /// Room for states of `n`.
    pub fn new(n: usize) -> Self {
        Self { n, estimates: Vec::new(), attempt: Vec::new(), form: PhantomData }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.estimates.len() / entries(N)
    }

    fn all(&self) -> impl Iterator<Item = Belief<F, N>> {
        self.estimates.chunks_exact(entries(N)).map(load)
    }

    /// An `n × n` matrix in the corner of a matrix with `rest` on the diagonal beyond.
    fn padded(&self, matrix: &[f64], rest: f64) -> [[f64; N]; N] {
        let mut out = [[0.0; N]; N];
        for i in 0..N {
            out[i][i] = rest;
            for j in 0..N {
                if i < self.n && j < self.n {
                    out[i][j] = matrix.get(i * self.n + j).copied().unwrap_or(f64::NAN);
                }
            }
        }
        out
    }

    fn vector(&self, values: &[f64]) -> [f64; N] {
        core::array::from_fn(|i| if i < self.n { values.get(i).copied().unwrap_or(f64::NAN) } else { 0.0 })
    }

    fn corner(&self, matrix: &[[f64; N]; N]) -> Vec<f64> {
        matrix.iter().take(self.n).flat_map(|row| row.iter().take(self.n).copied()).collect()
    }

    /// `(count, n)`.
    pub fn states(&self) -> Vec<f64> {
        self.all().flat_map(|e| e.state.into_iter().take(self.n)).collect()
    }

    /// `(count, n, n)`.
    pub fn covariances(&self) -> Vec<f64> {
        self.all().flat_map(|e| self.corner(&e.covariance.matrix())).collect()
    }

    /// `(count, n, n)`.
    pub fn stored(&self) -> Vec<f64> {
        self.all().flat_map(|e| self.corner(e.covariance.stored())).collect()
    }

    /// Estimates from `(count, n)` and `(count, n, n)`.
    pub fn set(&mut self, states: &[f64], matrices: &[f64], stored: bool) {
        let size = self.n.max(1);
        self.estimates.clear();
        for (state, matrix) in states.chunks(size).zip(matrices.chunks(size * size)) {
            let matrix = self.padded(matrix, 1.0);
            let covariance =
                if stored { F::Of::<f64, N>::from_stored(matrix) } else { F::Of::<f64, N>::new(&matrix) };
            let from = self.estimates.len();
            self.estimates.resize(from + entries(N), 0.0);
            store(&Estimate { state: self.vector(state), covariance }, &mut self.estimates[from..]);
        }
    }

    /// The covariance of numbers stored in this form, row by row; `N` is the size.
    pub fn matrix(&self, estimate: &[f64]) -> Vec<f64> {
        let estimate: Belief<F, N> = load(estimate);
        estimate.covariance.matrix().into_iter().flatten().collect()
    }

    /// State and upper triangle of the covariance itself.
    pub fn plain(&self, estimate: &[f64]) -> Vec<f64> {
        if F::PLAIN {
            return estimate.to_vec();
        }
        let Estimate { state, covariance }: Belief<F, N> = load(estimate);
        let mut out = vec![0.0; entries(N)];
        store(&Estimate { state, covariance: Joseph::new(&covariance.matrix()) }, &mut out);
        out
    }

    /// Are all numbers of the first estimate finite, its variances positive?
    pub fn sound(estimate: &[f64]) -> bool {
        let estimate: Belief<F, N> = load(estimate);
        State::<f64, N>::is_finite(&estimate.state) && estimate.covariance.is_finite()
    }

    /// Takes the prediction of a model in Python.
    pub fn predict_given(&mut self, state: &[f64], transition: &[f64], noise: &[f64]) -> bool {
        let moved = Moved {
            state: self.vector(state),
            transition: self.padded(transition, 1.0),
            noise: self.padded(noise, 0.0),
        };
        let Some(before) = self.all().next() else { return false };
        let covariance = before.covariance.propagate(&moved, &(), &moved.transition, &moved.noise);
        let sound = State::<f64, N>::is_finite(&moved.state) && covariance.is_finite();
        if sound {
            store(&Estimate { state: moved.state, covariance }, &mut self.estimates);
        }
        sound
    }

    /// Tries rows of a sensor in Python.
    pub fn attempt(&mut self, given: &Given<'_>) -> (Vec<f64>, f64) {
        let Some(prior) = self.all().next() else { return (Vec::new(), f64::NAN) };
        let options = given.settings.options::<N>();
        let columns = <[f64; N] as State<f64, N>>::COLUMNS;
        let mut rows = Rows::new(columns, self.vector(given.offset), 0.0, &prior.covariance);
        for (innovation, row) in given.innovation.iter().zip(given.jacobian.chunks(self.n.max(1))) {
            rows.absorb(*innovation, &blocks::<N>(&self.vector(row)));
        }
        let mut delta = rows.delta;
        if let Some(considered) = &options.consider {
            for i in 0..N {
                if considered[i] {
                    delta[i] = 0.0;
                }
            }
        }
        let covariance = with_consider(&rows.covariance, &prior.covariance, &options);
        self.attempt.resize(entries(N), 0.0);
        store(&Estimate { state: prior.state.inject(&delta), covariance }, &mut self.attempt);
        (delta.into_iter().take(self.n).collect(), rows.nis)
    }

    /// Makes the last attempt the estimate, if it is sound.
    pub fn commit(&mut self) -> bool {
        let attempt = core::mem::take(&mut self.attempt);
        let sound = !attempt.is_empty() && Self::sound(&attempt);
        if sound {
            self.estimates = attempt;
        }
        sound
    }
}

/// Blocks of three enough for the largest size.
const BLOCKS: usize = 21;

/// A row without zeros.
fn blocks<const N: usize>(row: &[f64; N]) -> Sparse<f64, BLOCKS> {
    let at = |j: usize| row.get(j).copied().unwrap_or(0.0);
    let part = core::array::from_fn(|k| [at(3 * k), at(3 * k + 1), at(3 * k + 2)]);
    Sparse { first: core::array::from_fn(|k| 3 * k), part }
}

/// A step whose outcome is known.
struct Moved<const N: usize> {
    state: [f64; N],
    transition: [[f64; N]; N],
    noise: [[f64; N]; N],
}

impl<const N: usize> DynamicsModel<f64, N> for Moved<N> {
    const NAME: &'static str = "given";
    type State = [f64; N];
    type Control = ();
    type Step = ();

    fn prepare(&self, _time: f64, _dt: f64) {}

    fn propagate(&self, _step: &(), _state: &[f64; N], _control: ()) -> [f64; N] {
        self.state
    }

    fn transition(&self, _step: &(), _state: &[f64; N], _control: ()) -> ([f64; N], [[f64; N]; N]) {
        (self.state, self.transition)
    }

    fn process_noise(&self, _step: &(), _state: &[f64; N]) -> [[f64; N]; N] {
        self.noise
    }
}
