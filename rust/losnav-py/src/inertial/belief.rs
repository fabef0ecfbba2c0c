//! What a filter on inertial navigation believes, at rest (plain numbers) and at work (numbers of an instruction set).
use losnav_core::math::so3::{exp, normalized, quaternion_product};
use losnav_core::math::vec3::add;
use losnav_core::models::nav_state::NavState;
use losnav_core::models::state::State;

use super::form::InertialForm;
use crate::dispatch::Lanes;

/// Numbers of a navigation state.
pub const NUMBERS: usize = 19;
/// Constants of a remembered pose, and of a landmark.
pub const POSE: usize = 6;
pub const LANDMARK: usize = 3;

/// A pose remembered for a measurement that comes later.
#[derive(Clone, Debug, PartialEq)]
pub struct Clone6 {
    pub key: u64,
    /// Its first constant.
    pub at: usize,
    /// Position and quaternion.
    pub pose: [f64; 7],
}

/// A landmark whose error is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapped {
    /// Which sensor's map, and where in it.
    pub slot: usize,
    pub landmark: usize,
    pub at: usize,
    /// Corrected, or only considered?
    pub estimated: bool,
    pub correction: [f64; 3],
}

/// Plain numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Belief {
    pub state: Vec<f64>,
    /// `(n, n)` in the form it is kept in.
    pub stored: Vec<f64>,
    /// `(a, n)` and `(a, a)`.
    pub cross: Vec<f64>,
    pub constants: Vec<f64>,
    pub poses: Vec<Clone6>,
    pub map: Vec<Mapped>,
    /// Since the model's error was last estimated, s; that error, m/s².
    pub since: f64,
    pub model_error: [f64; 3],
    /// The interval since then, see [`literal`](super::literal): empty unless it is needed.
    pub start: Vec<f64>,
    /// What the spectral density of the acceleration is multiplied by, and the mean of NIS over degrees of freedom.
    pub adapted: [f64; 2],
}

impl Belief {
    /// Of a state and a covariance, nothing beside.
    pub fn new(state: &[f64], stored: Vec<f64>) -> Self {
        Self { state: state.to_vec(), stored, adapted: [1.0, 1.0], ..Self::default() }
    }
}

/// At work.
pub struct Craft<V: Lanes, F: InertialForm, const N: usize> {
    pub state: NavState<V>,
    pub core: F::Core<V, N>,
    pub cross: Vec<[V; N]>,
    pub constants: Vec<V>,
    pub poses: Vec<Clone6>,
    pub map: Vec<Mapped>,
    pub since: f64,
    pub model_error: [f64; 3],
    pub start: Vec<f64>,
    pub adapted: [f64; 2],
}

/// The matrix behind plain numbers.
#[inline(always)]
fn matrix<V: Lanes, const N: usize>(data: &[f64]) -> [[V; N]; N] {
    let mut out = [[V::zero(); N]; N];
    for (value, number) in out.as_flattened_mut().iter_mut().zip(data) {
        *value = V::splat(*number);
    }
    out
}

impl<V: Lanes, F: InertialForm, const N: usize> Craft<V, F, N> {
    /// Takes up the work.
    #[inline(always)]
    pub fn load(belief: &Belief) -> Self {
        let mut state = NavState::origin();
        for (i, number) in belief.state.iter().enumerate() {
            State::<V, N>::set_number(&mut state, i, V::splat(*number));
        }
        let mut cross = vec![[V::zero(); N]; belief.cross.len() / N];
        for (value, number) in cross.as_flattened_mut().iter_mut().zip(&belief.cross) {
            *value = V::splat(*number);
        }
        let mut constants = Vec::with_capacity(belief.constants.len());
        for number in &belief.constants {
            constants.push(V::splat(*number));
        }
        Self {
            state,
            core: F::read(&matrix(&belief.stored), true),
            cross,
            constants,
            poses: belief.poses.clone(),
            map: belief.map.clone(),
            since: belief.since,
            model_error: belief.model_error,
            start: belief.start.clone(),
            adapted: belief.adapted,
        }
    }

    /// Lays it down.
    #[inline(always)]
    pub fn store(self, belief: &mut Belief) {
        belief.state.resize(NUMBERS, 0.0);
        self.write_state(&mut belief.state);
        belief.stored.resize(N * N, 0.0);
        write_matrix(&F::stored(&self.core), &mut belief.stored);
        belief.cross.clear();
        for value in self.cross.as_flattened() {
            belief.cross.push(value.lane(0));
        }
        belief.constants.clear();
        for value in &self.constants {
            belief.constants.push(value.lane(0));
        }
        belief.poses = self.poses;
        belief.map = self.map;
        belief.since = self.since;
        belief.model_error = self.model_error;
        belief.start = self.start;
        belief.adapted = self.adapted;
    }

    /// The numbers of the state.
    #[inline(always)]
    pub fn write_state(&self, out: &mut [f64]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = State::<V, N>::number(&self.state, i).lane(0);
        }
    }

    /// The covariance of the state.
    #[inline(always)]
    pub fn write_covariance(&self, out: &mut [f64]) {
        write_matrix(&F::matrix(&self.core), out);
    }

    /// Appends the numbers of the state and the upper triangle of its covariance.
    #[inline(always)]
    pub fn write_prior(&self, out: &mut Vec<f64>) {
        let from = out.len();
        out.resize(from + NUMBERS, 0.0);
        self.write_state(&mut out[from..]);
        let matrix = F::matrix(&self.core);
        for (i, row) in matrix.iter().enumerate() {
            for value in row.iter().skip(i) {
                out.push(value.lane(0));
            }
        }
    }

    /// Adds constants: copies of columns of the state, or new ones with a covariance of their own.
    pub fn append<const M: usize>(&mut self, columns: Option<[usize; M]>, own: &[[f64; M]; M]) -> usize {
        let (before, after) = (self.cross.len(), self.cross.len() + M);
        let core = F::matrix(&self.core);
        let mut constants = vec![V::zero(); after * after];
        for i in 0..before {
            for j in 0..before {
                constants[i * after + j] = self.constants[i * before + j];
            }
        }
        for m in 0..M {
            let at = before + m;
            let mut with_state = [V::zero(); N];
            if let Some(columns) = columns {
                with_state = core[columns[m]];
                for i in 0..before {
                    constants[i * after + at] = self.cross[i][columns[m]];
                    constants[at * after + i] = self.cross[i][columns[m]];
                }
            }
            for k in 0..M {
                constants[at * after + before + k] = match columns {
                    Some(columns) => core[columns[m]][columns[k]],
                    None => V::splat(own[m][k]),
                };
            }
            self.cross.push(with_state);
        }
        self.constants = constants;
        before
    }

    /// Forgets constants.
    pub fn remove(&mut self, at: usize, count: usize) {
        let size = self.cross.len();
        let gone = |i: usize| (at..at + count).contains(&i);
        let mut constants = Vec::with_capacity((size - count) * (size - count));
        for i in 0..size {
            for j in 0..size {
                if !gone(i) && !gone(j) {
                    constants.push(self.constants[i * size + j]);
                }
            }
        }
        self.constants = constants;
        self.cross.drain(at..at + count);
        for pose in &mut self.poses {
            if pose.at > at {
                pose.at -= count;
            }
        }
        for landmark in &mut self.map {
            if landmark.at > at {
                landmark.at -= count;
            }
        }
    }

    /// Remembers the pose under a key.
    pub fn remember(&mut self, key: u64) {
        let at = self.append(Some([0, 1, 2, 6, 7, 8]), &[[0.0; POSE]; POSE]);
        let (r, q) = (self.state.position, self.state.attitude);
        let pose = [r[0], r[1], r[2], q[0], q[1], q[2], q[3]].map(|v| v.lane(0));
        self.poses.push(Clone6 { key, at, pose });
    }

    /// Forgets the pose of a key; false if there is none.
    pub fn forget(&mut self, key: u64) -> bool {
        let Some(index) = self.poses.iter().position(|pose| pose.key == key) else { return false };
        let pose = self.poses.remove(index);
        self.remove(pose.at, POSE);
        true
    }

    /// Moves everything by a correction.
    #[inline(always)]
    pub fn inject(&mut self, delta: &[V; N], constants: &[V]) {
        self.state = self.state.inject(delta);
        let value = |i: usize| constants.get(i).map_or(0.0, |v| v.lane(0));
        for pose in &mut self.poses {
            let [x, y, z, a, b, c, w] = pose.pose;
            let k = pose.at;
            let r = add([x, y, z], [value(k), value(k + 1), value(k + 2)]);
            let turn = exp([value(k + 3), value(k + 4), value(k + 5)]);
            let q = normalized(quaternion_product([a, b, c, w], turn));
            pose.pose = [r[0], r[1], r[2], q[0], q[1], q[2], q[3]];
        }
        for landmark in self.map.iter_mut().filter(|landmark| landmark.estimated) {
            let k = landmark.at;
            landmark.correction = add(landmark.correction, [value(k), value(k + 1), value(k + 2)]);
        }
    }
}

#[inline(always)]
fn write_matrix<V: Lanes, const N: usize>(matrix: &[[V; N]; N], out: &mut [f64]) {
    for (out, value) in out.iter_mut().zip(matrix.as_flattened()) {
        *out = value.lane(0);
    }
}
