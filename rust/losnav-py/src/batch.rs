//! Lane jobs: one pose with its landmarks in lanes (latency), several poses in lanes (throughput).
use losnav_core::estimators::least_squares::{Options, Outcome, PoseState, solve};
use losnav_core::estimators::loss::Loss;
use losnav_core::estimators::pose::{Chunked, LosObjective};
use losnav_core::math::real::{Mask, Real};
use losnav_core::math::sym6::Sym6;
use losnav_core::math::vec3::{Vec3, dot, scale, splat, sub};
use losnav_core::models::linearization::Weight;
use losnav_core::models::sensors::LineOfSight;

use crate::dispatch::{Job, Lanes};
use crate::inputs::{Noise, Problem, Problems};
use crate::solution::Record;
use crate::values::{UNIT_TOLERANCE, scalar_weight};

/// Landmarks, directions and weights in lanes, reused from call to call.
struct Columns<V> {
    landmarks: Vec<Vec3<V>>,
    los: Vec<Vec3<V>>,
    weights: Vec<Weight<V>>,
}

impl<V: Lanes> Columns<V> {
    #[inline(always)]
    fn with_capacity(n: usize) -> Self {
        Self { landmarks: Vec::with_capacity(n), los: Vec::with_capacity(n), weights: Vec::with_capacity(n) }
    }

    /// Any number of chunks.
    #[inline(always)]
    fn fill(&mut self, chunks: Chunks<'_>) -> LineOfSight<'_, V> {
        self.landmarks.reserve_exact(chunks.count);
        self.los.reserve_exact(chunks.count);
        self.weights.reserve_exact(chunks.weights);
        for k in 0..chunks.count {
            self.landmarks.push(gather_rows(chunks.rows::<V, _>(k, chunks.problem.landmarks)));
            self.los.push(gather_rows(chunks.rows::<V, _>(k, chunks.problem.los)));
        }
        for k in 0..chunks.weights {
            self.weights.push(chunks.weight(k));
        }
        self.sensor()
    }

    #[inline(always)]
    fn sensor(&self) -> LineOfSight<'_, V> {
        LineOfSight { landmarks: &self.landmarks, los: &self.los, weights: &self.weights }
    }
}

/// One pose, its landmarks in lanes, from several starts.
pub struct OnePose<'a, L, F> {
    pub problem: &'a Problem<'a>,
    pub loss: L,
    pub options: &'a Options,
    pub starts: &'a [PoseState<f64>],
    /// Receives the outcome from each start.
    pub take: F,
}

impl<L: Loss, F: FnMut(Outcome<f64>)> Job for OnePose<'_, L, F> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(mut self) {
        let chunks = Chunks::new::<V>(self.problem);
        let (mut few, mut many) = (Few::<V>::new(), Columns::<V>::with_capacity(0));
        let sensor = if chunks.count <= FEW { few.fill(chunks) } else { many.fill(chunks) };
        let objective = Chunked { lanes: LosObjective { sensor, loss: self.loss } };
        for start in self.starts {
            let outcome = solve(&objective, &start.splat::<S>(), self.options);
            (self.take)(lane_outcome(&outcome, 0));
        }
    }
}

/// One pose from many starts, the starts in lanes: for problems of few landmarks.
pub struct ManyStarts<'a, L> {
    pub problem: &'a Problem<'a>,
    pub loss: L,
    pub options: &'a Options,
    pub starts: &'a [PoseState<f64>],
    /// The outcome from each start.
    pub out: &'a mut [Outcome<f64>],
}

impl<L: Loss> Job for ManyStarts<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(self) {
        let n = self.problem.los.len();
        let mut columns = Columns::<V>::with_capacity(n);
        for row in 0..n {
            columns.landmarks.push(splat(self.problem.landmarks[row]));
            columns.los.push(splat(self.problem.los[row]));
        }
        for weight in self.problem.weights {
            columns.weights.push(splat_weight(weight));
        }
        let objective = LosObjective { sensor: columns.sensor(), loss: self.loss };
        for (starts, out) in self.starts.chunks(V::LANES).zip(self.out.chunks_mut(V::LANES)) {
            let last = starts.len() - 1;
            let mut start = starts[0].splat::<V>();
            for axis in 0..3 {
                start.position[axis] = V::gather(|lane| starts[lane.min(last)].position[axis]);
            }
            for axis in 0..4 {
                start.attitude[axis] = V::gather(|lane| starts[lane.min(last)].attitude[axis]);
            }
            let outcome = solve(&objective, &start, self.options);
            for (lane, slot) in out.iter_mut().enumerate() {
                *slot = lane_outcome(&outcome, lane);
            }
        }
    }
}

#[inline(always)]
fn splat_weight<V: Real>(weight: &Weight<f64>) -> Weight<V> {
    match weight {
        Weight::Scalar(w) => Weight::Scalar(V::splat(*w)),
        Weight::Full(s) => Weight::Full([splat(s[0]), splat(s[1]), splat(s[2])]),
    }
}

/// Chunks of landmarks that need no heap: the time of an aligned allocation is felt in a solve of a microsecond.
const FEW: usize = 4;

/// The landmarks of one problem in a few chunks.
struct Few<V> {
    landmarks: [Vec3<V>; FEW],
    los: [Vec3<V>; FEW],
    weights: [Weight<V>; FEW],
}

impl<V: Lanes> Few<V> {
    #[inline(always)]
    fn new() -> Self {
        let (zero, none) = ([V::zero(); 3], Weight::Scalar(V::zero()));
        Self { landmarks: [zero; FEW], los: [zero; FEW], weights: [none; FEW] }
    }

    /// Up to [`FEW`] chunks.
    #[inline(always)]
    fn fill(&mut self, chunks: Chunks<'_>) -> LineOfSight<'_, V> {
        for k in 0..chunks.count.min(FEW) {
            self.landmarks[k] = gather_rows(chunks.rows::<V, _>(k, chunks.problem.landmarks));
            self.los[k] = gather_rows(chunks.rows::<V, _>(k, chunks.problem.los));
        }
        for k in 0..chunks.weights.min(FEW) {
            self.weights[k] = chunks.weight(k);
        }
        let (count, weights) = (chunks.count.min(FEW), chunks.weights.min(FEW));
        LineOfSight {
            landmarks: &self.landmarks[..count],
            los: &self.los[..count],
            weights: &self.weights[..weights],
        }
    }
}

/// The landmarks of a problem, `V::LANES` to a chunk. The first chunk takes the odd number and repeats its last
/// landmark with weight zero: so one weight for all needs two entries, and the rest of the chunks share the second.
#[derive(Clone, Copy)]
struct Chunks<'a> {
    problem: &'a Problem<'a>,
    /// Landmarks in the first chunk.
    first: usize,
    count: usize,
    /// Entries that the weights need.
    weights: usize,
}

impl<'a> Chunks<'a> {
    #[inline(always)]
    fn new<V: Lanes>(problem: &'a Problem<'a>) -> Self {
        let n = problem.los.len();
        let count = n.div_ceil(V::LANES);
        let weights = if problem.weights.len() == 1 { count.min(2) } else { count };
        Self { problem, first: n - (count - 1) * V::LANES, count, weights }
    }

    #[inline(always)]
    fn rows<V: Lanes, T>(&self, chunk: usize, rows: &'a [T]) -> &'a [T] {
        let end = self.first + chunk * V::LANES;
        if chunk == 0 { &rows[..end] } else { &rows[end - V::LANES..end] }
    }

    #[inline(always)]
    fn weight<V: Lanes>(&self, chunk: usize) -> Weight<V> {
        let count = if chunk == 0 { self.first } else { V::LANES };
        match self.problem.weights {
            [one] => gather_weights(core::slice::from_ref(one), count),
            all => gather_weights(self.rows::<V, _>(chunk, all), count),
        }
    }
}

/// The last of the rows is repeated in the lanes beyond.
#[inline(always)]
fn gather_rows<V: Lanes>(rows: &[Vec3<f64>]) -> Vec3<V> {
    if rows.len() == V::LANES {
        return [V::gather(|k| rows[k][0]), V::gather(|k| rows[k][1]), V::gather(|k| rows[k][2])];
    }
    let last = rows.len() - 1;
    [
        V::gather(|k| rows[k.min(last)][0]),
        V::gather(|k| rows[k.min(last)][1]),
        V::gather(|k| rows[k.min(last)][2]),
    ]
}

/// Zero in the lanes from `count` on.
#[inline(always)]
fn gather_weights<V: Lanes>(weights: &[Weight<f64>], count: usize) -> Weight<V> {
    let last = weights.len() - 1;
    let at = |lane: usize| weights[lane.min(last)];
    if let Weight::Scalar(_) = weights[0] {
        return Weight::Scalar(V::gather(|lane| match at(lane) {
            Weight::Scalar(w) if lane < count => w,
            _ => 0.0,
        }));
    }
    let mut full = [[V::zero(); 3]; 3];
    for (i, row) in full.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            *entry = V::gather(|lane| match at(lane) {
                Weight::Full(s) if lane < count => s[i][j],
                _ => 0.0,
            });
        }
    }
    Weight::Full(full)
}

/// Several poses side by side, from a guess each. Scalar weights only.
pub struct ManyPoses<'a, L, F> {
    pub problems: &'a Problems<'a>,
    /// Index of the first.
    pub first: usize,
    pub loss: L,
    pub options: &'a Options,
    /// One for each problem.
    pub out: &'a mut [Record],
    /// Does the problems of a group in which some value breaks a rule, one by one.
    pub one_by_one: F,
}

impl<L: Loss, F: FnMut(usize, &mut [Record])> Job for ManyPoses<'_, L, F> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes, S: Lanes>(mut self) {
        let dof = 2.0 * self.problems.n as f64 - 6.0;
        let mut columns = Columns::<V>::with_capacity(self.problems.n);
        let mut first = self.first;
        for out in self.out.chunks_mut(V::LANES) {
            let last = first + out.len() - 1;
            let start = gather_guess::<V>(self.problems, first, last);
            let sound = problem_columns(self.problems, first, last, &mut columns);
            match start {
                Some(start) if sound => {
                    let objective = LosObjective { sensor: columns.sensor(), loss: self.loss };
                    let outcome = solve(&objective, &start, self.options);
                    let chi2 =
                        if L::CURVED { objective.chi2(&outcome.pose) } else { outcome.cost + outcome.cost };
                    for (lane, slot) in out.iter_mut().enumerate() {
                        *slot = Record::new(&lane_outcome(&outcome, lane), chi2.lane(lane), dof);
                    }
                }
                _ => (self.one_by_one)(first, out),
            }
            first = last + 1;
        }
    }
}

/// Fills the columns with problems `first..=last` (the last one repeated) and checks their values in the lanes.
#[inline(always)]
fn problem_columns<V: Lanes>(
    problems: &Problems<'_>,
    first: usize,
    last: usize,
    columns: &mut Columns<V>,
) -> bool {
    let n = problems.n;
    let mut sound = V::Mask::splat(true);
    // Shared landmarks stand in the columns from the group before. Pairs too close to tell apart in squares are no
    // error yet: the one-by-one path decides.
    if !(problems.landmarks.shared() && columns.landmarks.len() == n) {
        columns.landmarks.clear();
        for row in 0..n {
            let landmark = gather_entry::<V>(problems, Which::Landmarks, row, first, last);
            sound = sound.and(dot(landmark, landmark).is_finite());
            for other in &columns.landmarks {
                let d = sub(landmark, *other);
                sound = sound.and(V::zero().lt(dot(d, d)));
            }
            columns.landmarks.push(landmark);
        }
    }
    columns.los.clear();
    for row in 0..n {
        let b = gather_entry::<V>(problems, Which::Los, row, first, last);
        let norm2 = dot(b, b);
        sound = sound.and((norm2 - V::one()).abs().le(V::splat(UNIT_TOLERANCE)));
        columns.los.push(scale(norm2.rsqrt(), b));
    }
    columns.weights.clear();
    match &problems.noise {
        Noise::Common(sigma) => match scalar_weight(*sigma, 0) {
            Ok(Weight::Scalar(w)) => columns.weights.push(Weight::Scalar(V::splat(w))),
            _ => return false,
        },
        Noise::Sigma(rows) => {
            for row in 0..rows.width() {
                let sigma =
                    V::gather(|lane| rows.of((first + lane).min(last)).get(row).copied().unwrap_or(0.0));
                let weight = (sigma * sigma).recip();
                sound = sound.and(V::zero().lt(sigma)).and(V::zero().lt(weight)).and(weight.is_finite());
                columns.weights.push(Weight::Scalar(weight));
            }
        }
        Noise::Covariance(_) => return false,
    }
    !sound.not().any()
}

enum Which {
    Landmarks,
    Los,
}

#[inline(always)]
fn gather_entry<V: Lanes>(
    problems: &Problems<'_>,
    which: Which,
    row: usize,
    first: usize,
    last: usize,
) -> Vec3<V> {
    let rows = match which {
        Which::Landmarks => &problems.landmarks,
        Which::Los => &problems.los,
    };
    let mut entry = [V::zero(); 3];
    for (axis, value) in entry.iter_mut().enumerate() {
        *value = V::gather(|lane| {
            rows.of((first + lane).min(last)).get(3 * row + axis).copied().unwrap_or(f64::NAN)
        });
    }
    entry
}

#[inline(always)]
fn gather_guess<V: Lanes>(problems: &Problems<'_>, first: usize, last: usize) -> Option<PoseState<V>> {
    let rows = problems.guess.as_ref()?;
    let mut guess = [V::zero(); 6];
    let mut sound = V::Mask::splat(true);
    for (column, value) in guess.iter_mut().enumerate() {
        *value = V::gather(|lane| rows.of((first + lane).min(last)).get(column).copied().unwrap_or(f64::NAN));
        sound = sound.and(value.is_finite());
    }
    let [x, y, z, a, b, c] = guess;
    (!sound.not().any()).then(|| PoseState::from_mrp([x, y, z], [a, b, c]))
}

/// One lane of an outcome.
#[inline(always)]
fn lane_outcome<V: Real>(outcome: &Outcome<V>, lane: usize) -> Outcome<f64> {
    let (p, q) = (&outcome.pose.position, &outcome.pose.attitude);
    let mut information = Sym6([0.0; 21]);
    for (to, from) in information.0.iter_mut().zip(&outcome.information.0) {
        *to = from.lane(lane);
    }
    Outcome {
        pose: PoseState {
            position: [p[0].lane(lane), p[1].lane(lane), p[2].lane(lane)],
            attitude: [q[0].lane(lane), q[1].lane(lane), q[2].lane(lane), q[3].lane(lane)],
        },
        cost: outcome.cost.lane(lane),
        information,
        iterations: outcome.iterations.lane(lane),
        termination: outcome.termination.lane(lane),
        converged: outcome.converged.lane(lane),
    }
}
