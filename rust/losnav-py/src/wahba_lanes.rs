//! Lane jobs: one attitude with its directions in lanes (many of them), several attitudes in lanes (throughput).
use losnav_core::estimators::wahba::polish::solve;
use losnav_core::estimators::wahba::{Directions, Profile, Residual, Vectors};
use losnav_core::math::real::{Mask, Real};
use losnav_core::math::vec3::{Mat3, Vec3, dot, scale, splat};

use crate::attitude_solution::Record;
use crate::dispatch::{Job, Lanes};
use crate::inputs::Rows;
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
            solve::<S>(&SideBySide::<V> { problem: self.problem, lanes: core::marker::PhantomData })
        };
        Record::of_lane(&estimate, 0, n)
    }
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
            sum.add(splat(*b), splat(*r), self.weight(k));
        }
        sum
    }

    #[inline(always)]
    fn residual(&self, dcm: &Mat3<S>) -> Residual<S> {
        let mut sum = Residual::zero();
        for (k, (b, r)) in self.0.body.iter().zip(self.0.reference).enumerate() {
            sum.add(splat(*b), splat(*r), self.weight(k), dcm);
        }
        sum
    }
}

/// The directions in the lanes of `V`, read where they stand; the last chunk is filled up with weight zero.
struct SideBySide<'a, V> {
    problem: &'a Problem<'a>,
    lanes: core::marker::PhantomData<V>,
}

impl<V: Lanes> SideBySide<'_, V> {
    #[inline(always)]
    fn rows(rows: &[Vec3<f64>], first: usize) -> Vec3<V> {
        let last = rows.len() - 1;
        let mut out = [V::zero(); 3];
        for (axis, value) in out.iter_mut().enumerate() {
            *value = V::gather(|lane| rows[(first + lane).min(last)][axis]);
        }
        out
    }

    #[inline(always)]
    fn weight(&self, first: usize) -> V {
        let (weights, n) = (self.problem.weights, self.problem.body.len());
        V::gather(|lane| match first + lane {
            past if past >= n => 0.0,
            _ if weights.len() == 1 => weights[0],
            index => weights[index],
        })
    }
}

impl<S: Real, V: Lanes> Directions<S> for SideBySide<'_, V> {
    #[inline(always)]
    fn profile(&self) -> Profile<S> {
        let Problem { body, reference, .. } = *self.problem;
        let mut sum = Profile::<V>::zero();
        for first in (0..body.len()).step_by(V::LANES) {
            sum.add(Self::rows(body, first), Self::rows(reference, first), self.weight(first));
        }
        sum.sum_lanes()
    }

    #[inline(always)]
    fn residual(&self, dcm: &Mat3<S>) -> Residual<S> {
        let Problem { body, reference, .. } = *self.problem;
        let mut wide = [[V::zero(); 3]; 3];
        for i in 0..3 {
            for j in 0..3 {
                wide[i][j] = V::splat(dcm[i][j].lane(0));
            }
        }
        let mut sum = Residual::<V>::zero();
        for first in (0..body.len()).step_by(V::LANES) {
            sum.add(Self::rows(body, first), Self::rows(reference, first), self.weight(first), &wide);
        }
        sum.sum_lanes()
    }
}

/// Several attitudes side by side, by QUEST.
pub struct ManyAttitudes<'a, F> {
    pub problems: &'a Problems<'a>,
    /// Index of the first.
    pub first: usize,
    /// How many.
    pub count: usize,
    /// Receives one for each.
    pub out: &'a mut Vec<Record>,
    /// Does a problem that breaks a rule or does not end well.
    pub one_by_one: F,
}

impl<F: FnMut(usize) -> Record> Job for ManyAttitudes<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(mut self) {
        let n = self.problems.n;
        let mut columns = Columns::<V>::with_capacity(n);
        let end = self.first + self.count;
        for first in (self.first..end).step_by(V::LANES) {
            let last = (first + V::LANES).min(end) - 1;
            let sound = columns.fill(self.problems, first, last);
            let estimate = solve(&columns.vectors());
            for lane in 0..=last - first {
                let record = if sound.lane(lane) { Record::of_lane(&estimate, lane, n) } else { None };
                self.out.push(match record {
                    Some(record) => record,
                    None => (self.one_by_one)(first + lane),
                });
            }
        }
    }
}

/// Directions and weights in lanes, one problem each, reused from group to group.
struct Columns<V> {
    body: Vec<Vec3<V>>,
    reference: Vec<Vec3<V>>,
    weights: Vec<V>,
}

impl<V: Lanes> Columns<V> {
    #[inline(always)]
    fn with_capacity(n: usize) -> Self {
        Self { body: Vec::with_capacity(n), reference: Vec::with_capacity(n), weights: Vec::with_capacity(n) }
    }

    #[inline(always)]
    fn vectors(&self) -> Vectors<'_, V> {
        Vectors { body: &self.body, reference: &self.reference, weights: &self.weights }
    }

    /// Problems `first..=last`, the last one repeated in the lanes beyond; which of them are beyond doubt?
    #[inline(always)]
    fn fill(&mut self, problems: &Problems<'_>, first: usize, last: usize) -> V::Mask {
        let mut sound = V::Mask::splat(true);
        self.body.clear();
        self.reference.clear();
        self.weights.clear();
        for row in 0..problems.n {
            let (b, good) = gather_unit::<V>(&problems.body, row, first, last);
            let (r, fine) = gather_unit::<V>(&problems.reference, row, first, last);
            sound = sound.and(good).and(fine);
            self.body.push(b);
            self.reference.push(r);
        }
        let width = if let Noise::Sigma(rows) = &problems.noise { rows.width() } else { 1 };
        for row in 0..width {
            let sigma = match &problems.noise {
                Noise::Common(sigma) => V::splat(*sigma),
                Noise::Sigma(rows) => gather_entry(rows, row, first, last),
            };
            let weight = (sigma * sigma).recip();
            sound = sound.and(V::zero().lt(sigma)).and(V::zero().lt(weight)).and(weight.is_finite());
            self.weights.push(weight);
        }
        sound
    }
}

/// One direction of each problem, normalised; is its length within tolerance?
#[inline(always)]
fn gather_unit<V: Lanes>(rows: &Rows<'_>, row: usize, first: usize, last: usize) -> (Vec3<V>, V::Mask) {
    let v = [
        gather_entry::<V>(rows, 3 * row, first, last),
        gather_entry::<V>(rows, 3 * row + 1, first, last),
        gather_entry::<V>(rows, 3 * row + 2, first, last),
    ];
    let norm2 = dot(v, v);
    (scale(norm2.rsqrt(), v), (norm2 - V::one()).abs().le(V::splat(UNIT_TOLERANCE)))
}

#[inline(always)]
fn gather_entry<V: Lanes>(rows: &Rows<'_>, entry: usize, first: usize, last: usize) -> V {
    V::gather(|lane| rows.of((first + lane).min(last)).get(entry).copied().unwrap_or(f64::NAN))
}
