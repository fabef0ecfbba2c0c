//! Lane jobs: one attitude with its directions in lanes (many of them), several attitudes in lanes (throughput).
use std::marker::PhantomData;

use losnav_core::estimators::wahba::polish::{Estimate, solve};
use losnav_core::estimators::wahba::{Directions, Profile, Residual, Vectors};
use losnav_core::math::real::{Mask, Real};
use losnav_core::math::so3::Quaternion;
use losnav_core::math::vec3::{Mat3, Vec3, dot, scale, splat};

use crate::attitude_solution::Record;
use crate::dispatch::{Job, Lanes};
use crate::inputs::{Rows, triples};
use crate::values::UNIT_TOLERANCE;
use crate::wahba_inputs::{Noise, Problem, Problems};

/// From here on lanes over the directions are faster than one after the other.
const LANE_DIRECTIONS: usize = 16;

/// One attitude by QUEST; `None` where the fast way does not end well.
pub struct OneAttitude<'a> {
    pub problem: &'a Problem<'a>,
}

impl Job for OneAttitude<'_> {
    type Output = Option<Record>;

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(self) -> Option<Record> {
        let n = self.problem.body.len();
        let estimate = if n < LANE_DIRECTIONS {
            solve::<S>(&InTurn(self.problem))
        } else {
            solve::<S>(&SideBySide::<V> { problem: self.problem, lanes: PhantomData })
        };
        first_lane(&estimate, n)
    }
}

/// The only problem there is; `None` if its estimate is not sound.
#[inline(always)]
pub fn first_lane<S: Real>(estimate: &Estimate<S>, n: usize) -> Option<Record> {
    if !estimate.sound.lane(0) {
        return None;
    }
    let mut record = Record::invalid();
    let quaternion = upper(estimate.quaternion);
    for k in 0..4 {
        record.quaternion[k] = quaternion[k].lane(0);
    }
    for k in 0..6 {
        record.information.0[k] = estimate.information.0[k].lane(0);
    }
    record.loss = estimate.loss.lane(0);
    record.found(n);
    Some(record)
}

/// The sign with `w ≥ 0`, and no negative zero.
#[inline(always)]
fn upper<V: Real>(q: Quaternion<V>) -> Quaternion<V> {
    let sign = V::select(q[3].lt(V::zero()), -V::one(), V::one());
    [
        q[0].mul_add(sign, V::zero()),
        q[1].mul_add(sign, V::zero()),
        q[2].mul_add(sign, V::zero()),
        q[3].mul_add(sign, V::zero()),
    ]
}

/// The directions one after the other, read where they stand.
struct InTurn<'a>(&'a Problem<'a>);

impl InTurn<'_> {
    #[inline(always)]
    fn weight<S: Real>(&self, index: usize) -> S {
        let weights = self.0.weights;
        S::splat(if weights.len() == 1 { weights[0] } else { weights[index] })
    }
}

impl<S: Real> Directions<S> for InTurn<'_> {
    #[inline(always)]
    fn profile(&self) -> Profile<S> {
        let mut sum = Profile::zero();
        for (k, (b, r)) in self.0.body.iter().zip(self.0.reference).enumerate() {
            sum = sum.with(splat(*b), splat(*r), self.weight(k));
        }
        sum
    }

    #[inline(always)]
    fn residual(&self, dcm: &Mat3<S>) -> Residual<S> {
        let mut sum = Residual::zero();
        for (k, (b, r)) in self.0.body.iter().zip(self.0.reference).enumerate() {
            sum = sum.with(splat(*b), splat(*r), self.weight(k), dcm);
        }
        sum
    }
}

/// The directions in the lanes of `V`, read where they stand; the last chunk is filled up with weight zero.
struct SideBySide<'a, V> {
    problem: &'a Problem<'a>,
    lanes: PhantomData<V>,
}

/// `V::LANES` directions and their weights.
struct Chunk<V> {
    body: Vec3<V>,
    reference: Vec3<V>,
    weight: V,
}

impl<V: Lanes> SideBySide<'_, V> {
    #[inline(always)]
    fn chunk(&self, first: usize) -> Chunk<V> {
        let Problem { body, reference, weights, .. } = *self.problem;
        let end = (first + V::LANES).min(body.len());
        let count = end - first;
        let weight = match weights {
            [one] if count == V::LANES => V::splat(*one),
            [one] => V::gather(|lane| if lane < count { *one } else { 0.0 }),
            all => gather_padded(&all[first..end], |w| *w, 0.0),
        };
        Chunk { body: gather_rows(&body[first..end]), reference: gather_rows(&reference[first..end]), weight }
    }
}

/// Rows in lanes; zero beyond the last.
#[inline(always)]
fn gather_rows<V: Lanes>(rows: &[Vec3<f64>]) -> Vec3<V> {
    [
        gather_padded(rows, |v| v[0], 0.0),
        gather_padded(rows, |v| v[1], 0.0),
        gather_padded(rows, |v| v[2], 0.0),
    ]
}

#[inline(always)]
fn gather_padded<V: Lanes, T>(rows: &[T], pick: impl Fn(&T) -> f64, beyond: f64) -> V {
    if rows.len() == V::LANES {
        return V::gather(|lane| pick(&rows[lane]));
    }
    V::gather(|lane| rows.get(lane).map_or(beyond, &pick))
}

impl<S: Real, V: Lanes> Directions<S> for SideBySide<'_, V> {
    #[inline(always)]
    fn profile(&self) -> Profile<S> {
        let mut sum = Profile::<V>::zero();
        for first in (0..self.problem.body.len()).step_by(V::LANES) {
            let Chunk { body, reference, weight } = self.chunk(first);
            sum = sum.with(body, reference, weight);
        }
        sum.sum_lanes()
    }

    #[inline(always)]
    fn residual(&self, dcm: &Mat3<S>) -> Residual<S> {
        let mut wide = [[V::zero(); 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                wide[i][j] = V::splat(dcm[i][j].lane(0));
            }
        }
        let mut sum = Residual::<V>::zero();
        for first in (0..self.problem.body.len()).step_by(V::LANES) {
            let Chunk { body, reference, weight } = self.chunk(first);
            sum = sum.with(body, reference, weight, &wide);
        }
        sum.sum_lanes()
    }
}

/// Several attitudes side by side, by QUEST.
pub struct ManyAttitudes<'a, F> {
    pub problems: &'a Problems<'a>,
    /// Index of the first.
    pub first: usize,
    /// One for each problem, to be overwritten.
    pub out: &'a mut [Record],
    /// Does a problem that breaks a rule or does not end well.
    pub one_by_one: F,
}

impl<F: FnMut(usize) -> Record> Job for ManyAttitudes<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(mut self) {
        let n = self.problems.n;
        let mut columns = Columns::<V>::with_capacity(n);
        let end = self.first + self.out.len();
        for first in (self.first..end).step_by(V::LANES) {
            let last = (first + V::LANES).min(end) - 1;
            let sound = columns.fill(self.problems, first, last);
            let estimate = solve(&columns.vectors());
            let spilled = Spilled::new(&estimate);
            for lane in 0..=last - first {
                let slot = &mut self.out[first - self.first + lane];
                if sound.lane(lane) && spilled.sound[lane] {
                    spilled.write(lane, n, slot);
                } else {
                    *slot = (self.one_by_one)(first + lane);
                }
            }
        }
    }
}

/// The most lanes there are.
const LANES_MAX: usize = 8;

/// An estimate as plain numbers, written to memory once: each vector register is stored whole, then read lane by lane.
struct Spilled {
    quaternion: [[f64; LANES_MAX]; 4],
    information: [[f64; LANES_MAX]; 6],
    loss: [f64; LANES_MAX],
    sound: [bool; LANES_MAX],
}

impl Spilled {
    #[inline(always)]
    fn new<V: Real>(estimate: &Estimate<V>) -> Self {
        let mut spilled = Self {
            quaternion: [[0.0; LANES_MAX]; 4],
            information: [[0.0; LANES_MAX]; 6],
            loss: [0.0; LANES_MAX],
            sound: [false; LANES_MAX],
        };
        let quaternion = upper(estimate.quaternion);
        for lane in 0..V::LANES.min(LANES_MAX) {
            for k in 0..4 {
                spilled.quaternion[k][lane] = quaternion[k].lane(lane);
            }
            for k in 0..6 {
                spilled.information[k][lane] = estimate.information.0[k].lane(lane);
            }
            spilled.loss[lane] = estimate.loss.lane(lane);
            spilled.sound[lane] = estimate.sound.lane(lane);
        }
        spilled
    }

    /// One lane into a record that holds nothing yet: field by field, for a record put together on the stack and then
    /// copied in wide pieces stalls the stores it waits for.
    #[inline(always)]
    fn write(&self, lane: usize, n: usize, record: &mut Record) {
        for k in 0..4 {
            record.quaternion[k] = self.quaternion[k][lane];
        }
        for k in 0..6 {
            record.information.0[k] = self.information[k][lane];
        }
        record.loss = self.loss[lane];
        record.found(n);
    }
}

/// Directions and weights in lanes, one problem each, reused from group to group.
struct Columns<V: Lanes> {
    body: Vec<Vec3<V>>,
    reference: Vec<Vec3<V>>,
    weights: Vec<V>,
    /// Which lanes' references are of unit length.
    reference_sound: V::Mask,
}

impl<V: Lanes> Columns<V> {
    #[inline(always)]
    fn with_capacity(n: usize) -> Self {
        Self {
            body: Vec::with_capacity(n),
            reference: Vec::with_capacity(n),
            weights: Vec::with_capacity(n),
            reference_sound: V::Mask::splat(false),
        }
    }

    #[inline(always)]
    fn vectors(&self) -> Vectors<'_, V> {
        Vectors { body: &self.body, reference: &self.reference, weights: &self.weights }
    }

    /// Problems `first..=last`, the last one repeated in the lanes beyond; which of them are beyond doubt?
    #[inline(always)]
    fn fill(&mut self, problems: &Problems<'_>, first: usize, last: usize) -> V::Mask {
        let n = problems.n;
        let mut sound = gather_units(&problems.body, n, first, last, &mut self.body);
        // A shared reference stands in the columns from the group before.
        if !(problems.reference.shared() && self.reference.len() == n) {
            self.reference_sound = gather_units(&problems.reference, n, first, last, &mut self.reference);
        }
        sound = sound.and(self.reference_sound);
        match &problems.noise {
            Noise::Common(sigma) => {
                if self.weights.is_empty() {
                    self.weights.push(V::splat(1.0 / (sigma * sigma)));
                }
                sound = sound.and(V::zero().lt(V::splat(*sigma)));
            }
            // Those go one by one.
            Noise::Covariance(_) => return V::Mask::splat(false),
            Noise::Sigma(rows) => {
                self.weights.clear();
                for row in 0..rows.width() {
                    let sigma = V::gather(|lane| {
                        rows.of((first + lane).min(last)).get(row).copied().unwrap_or(f64::NAN)
                    });
                    sound = sound.and(V::zero().lt(sigma));
                    self.weights.push((sigma * sigma).recip());
                }
            }
        }
        for weight in &self.weights {
            sound = sound.and(V::zero().lt(*weight)).and(weight.is_finite());
        }
        sound
    }
}

/// The directions of a group of problems, normalised; which lanes' lengths are within tolerance?
#[inline(always)]
fn gather_units<V: Lanes>(
    rows: &Rows<'_>,
    n: usize,
    first: usize,
    last: usize,
    out: &mut Vec<Vec3<V>>,
) -> V::Mask {
    let mut own: [&[Vec3<f64>]; LANES_MAX] = [&[]; LANES_MAX];
    for (lane, own) in own.iter_mut().enumerate().take(V::LANES) {
        *own = triples(rows.of((first + lane).min(last)));
    }
    out.clear();
    let mut sound = V::Mask::splat(true);
    if own.iter().take(V::LANES).any(|rows| rows.len() != n) {
        return V::Mask::splat(false);
    }
    for row in 0..n {
        let v = [
            V::gather(|lane| own[lane][row][0]),
            V::gather(|lane| own[lane][row][1]),
            V::gather(|lane| own[lane][row][2]),
        ];
        let norm2 = dot(v, v);
        sound = sound.and((norm2 - V::one()).abs().le(V::splat(UNIT_TOLERANCE)));
        out.push(scale(norm2.rsqrt(), v));
    }
    sound
}
