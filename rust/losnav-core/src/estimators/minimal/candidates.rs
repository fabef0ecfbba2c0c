//! Starting poses for N lines of sight without a guess: every minimum of the cost has one of them in its basin.
//!
//! 1. centre, scale and turn the landmarks to their principal axes; collinear or fewer than three: none;
//! 2. P3P on the four triples of four landmarks that are extreme in turn (the one triple of N = 3);
//! 3. N >= 4, flat clouds: homography and the planar pair;
//! 4. N >= 4: object-space minima from the cheapest of a grid of rotations about the mean line of sight, each also turned over ("flipped"):
//!    far away the two differ by their perspective only, which noise may hide (Schweighofer & Pinz, PAMI 2006);
//! 5. mirrored ones rejected, near-duplicates merged, hopeless ones dropped, the rest by rising cost `sum w |b - h|^2`.

use nalgebra::{Matrix3, Vector3};

use super::p3p::p3p_near;
use super::planar::{flipped, planar};
use super::scatter::Scatter;
use super::sqpnp::{ObjectSpace, frame_about};
use super::{Pose, Poses};

/// Most poses [`candidates`] returns.
pub const MAX_CANDIDATES: usize = 32;
/// Thickness over width below which the planar solver is asked too.
const FLAT: f64 = 0.1;
/// Angle (rad) and distance over range below which two starts share a basin.
const SAME: f64 = 0.1;
/// The same for two exact poses, which are minima both: all of N = 3, a few scenes of N = 4.
const SAME_EXACT: f64 = 1e-6;
/// Starts dearer than this many times the cheapest cannot win: in 10^5 random scenes no winner was dearer than 10 times.
const PRUNE: f64 = 100.0;
/// Starts below this `chi^2` stay too: polished they may come within noise of the best, and are its alternatives.
const COMPARABLE: f64 = 200.0;
/// Mean `w |b - h|^2` below which the weights are not inverse variances.
const UNSCALED: f64 = 1e-6;
/// Angle (rad) below which a start counts as exact, whatever the cheapest costs: the accuracy of a nearly double root of P3P.
const EXACT: f64 = 1e-6;
/// Starts of the object-space search, cheapest of the grid: 2 are enough in 10^5 random scenes.
const DESCENTS: usize = 4;

/// Starting poses for the landmarks (reference frame) and unit lines of sight (body components), cheapest first.
///
/// `weight(i)` is the weight of observation `i` in the cost (one over its variance); those without a positive weight and those beyond the
/// shorter of the two lists are ignored. Empty for fewer than three or collinear landmarks and for values that are not finite.
///
/// Every pose has every landmark on the side its line of sight points to. Only where a wrong line of sight leaves no such pose, those are
/// returned that have most of them there.
pub fn candidates(
    landmarks: &[[f64; 3]],
    los: &[[f64; 3]],
    weight: impl Fn(usize) -> f64,
) -> Poses<MAX_CANDIDATES> {
    let n = landmarks.len().min(los.len());
    let (landmarks, los) = (landmarks.get(..n).unwrap_or(&[]), los.get(..n).unwrap_or(&[]));
    let used = landmarks.iter().enumerate().filter(|(i, _)| weight(*i) > 0.0).map(|(_, l)| l);
    let Some(scatter) = Scatter::new(used) else {
        return Poses::new();
    };
    if scatter.count < 3 || scatter.is_collinear() {
        return Poses::new();
    }
    let problem = Problem { landmarks, los, weight, scatter };
    let total: f64 = problem.observations().map(|o| o.2).sum();
    let mut found = Ranked::new(EXACT * EXACT * total, scatter.count);
    problem.try_triples(&mut found);
    if scatter.count > 3 {
        problem.try_object_space(&mut found);
    }
    found.poses()
}

struct Problem<'a, W> {
    landmarks: &'a [[f64; 3]],
    los: &'a [[f64; 3]],
    weight: W,
    scatter: Scatter,
}

impl<W: Fn(usize) -> f64> Problem<'_, W> {
    /// Landmark, line of sight and weight of each observation that counts.
    fn observations(&self) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>, f64)> {
        self.indexed().map(|(_, l, b, w)| (Vector3::from(*l), Vector3::from(*b), w))
    }

    fn indexed(&self) -> impl Iterator<Item = (usize, &[f64; 3], &[f64; 3], f64)> {
        self.landmarks
            .iter()
            .zip(self.los)
            .enumerate()
            .map(|(i, (l, b))| (i, l, b, (self.weight)(i)))
            .filter(|o| o.3 > 0.0)
    }

    /// `sum w |b - h|^2` and how many landmarks lie opposite to their line of sight.
    fn cost(&self, pose: &Pose) -> (f64, usize) {
        let (mut cost, mut behind) = (0.0, 0);
        for (l, b, w) in self.observations() {
            let h = pose.los(&l);
            // Written so that NaN counts as behind.
            if !(h.dot(&b) > 0.0) {
                behind += 1;
            }
            cost += w * (h - b).norm_squared();
        }
        (cost, behind)
    }

    fn offer(&self, found: &mut Ranked, pose: Pose) {
        let (cost, behind) = self.cost(&pose);
        if 2 * behind < self.scatter.count && cost.is_finite() {
            let range = (pose.position - self.scatter.centroid).norm() + self.scatter.extents[0];
            found.insert(Start { cost, mirrored: behind > 0, pose }, range);
        }
    }

    fn triple(&self, i: [usize; 3]) -> Option<[[Vector3<f64>; 3]; 2]> {
        let l = |k: usize| self.landmarks.get(k).map(|v| Vector3::from(*v));
        let b = |k: usize| self.los.get(k).map(|v| Vector3::from(*v));
        Some([[l(i[0])?, l(i[1])?, l(i[2])?], [b(i[0])?, b(i[1])?, b(i[2])?]])
    }

    fn try_triples(&self, found: &mut Ranked) {
        let count = if self.scatter.count == 3 { 1 } else { 4 };
        for t in self.spread_triples().iter().take(count) {
            if let Some([x, b]) = self.triple(*t) {
                for pose in &p3p_near(&x, &b) {
                    self.offer(found, *pose);
                }
            }
        }
    }

    /// Four triples out of the four landmarks that are extreme in turn: farthest from the centroid, from it, from their line, from their plane.
    fn spread_triples(&self) -> [[usize; 3]; 4] {
        let at = |k: usize| self.landmarks.get(k).map_or(Vector3::zeros(), |l| self.scatter.to_local(l));
        let farthest = |measure: &dyn Fn(&Vector3<f64>) -> f64| {
            let mut best = (0, -1.0);
            for (k, l, _, _) in self.indexed() {
                let value = measure(&self.scatter.to_local(l));
                if value > best.1 {
                    best = (k, value);
                }
            }
            best.0
        };
        let i = farthest(&|m| m.norm_squared());
        let a = at(i);
        let j = farthest(&|m| (m - a).norm_squared());
        let b = at(j) - a;
        let k = farthest(&|m| (m - a).cross(&b).norm_squared());
        let c = b.cross(&(at(k) - a));
        let (b, d) = (at(j), at(k));
        let l = farthest(&|m| {
            let plane = (m - a).dot(&c).abs();
            let apart = (m - a).norm().min((m - b).norm()).min((m - d).norm());
            plane + 0.1 * apart
        });
        [[i, j, k], [i, j, l], [i, k, l], [j, k, l]]
    }

    fn try_object_space(&self, found: &mut Ranked) {
        let local = self.indexed().map(|(_, l, b, w)| (self.scatter.to_local(l), Vector3::from(*b), w));
        let Some(space) = ObjectSpace::new(local) else {
            return;
        };
        let local = |r: &Matrix3<f64>| self.scatter.to_reference(r, &space.translation(r));
        if self.scatter.flatness() < FLAT {
            for r in planar(&space).iter().flatten() {
                self.offer(found, local(r));
            }
        }
        self.try_grid(found, &space);
    }

    /// Descends from the cheapest rotations of the grid.
    fn try_grid(&self, found: &mut Ranked, space: &ObjectSpace) {
        let axis = space.axis();
        let frame = frame_about(&axis);
        let mut starts = [(f64::INFINITY, Matrix3::identity()); DESCENTS];
        for g in &GRID {
            let start = frame * Matrix3::from_row_slice(g);
            if space.translation(&start).dot(&axis) < 0.0 {
                continue;
            }
            let mut new = (space.cost(&start), start);
            for slot in &mut starts {
                if new.0 < slot.0 {
                    core::mem::swap(&mut new, slot);
                }
            }
        }
        let mut minima = [Matrix3::zeros(); DESCENTS];
        for (k, start) in starts.iter().enumerate() {
            if start.0 == f64::INFINITY {
                break;
            }
            let (r, _) = space.descend(&start.1);
            if minima.iter().take(k).any(|m| (m - r).norm_squared() < SAME * SAME) {
                continue;
            }
            if let Some(slot) = minima.get_mut(k) {
                *slot = r;
            }
            let t = space.translation(&r);
            self.offer(found, self.scatter.to_reference(&r, &t));
            let f = flipped(&r, &Vector3::z(), &(t / t.norm()));
            self.offer(found, self.scatter.to_reference(&f, &space.translation(&f)));
        }
    }
}

#[derive(Clone, Copy)]
struct Start {
    cost: f64,
    /// Whether some landmark lies opposite to its line of sight.
    mirrored: bool,
    pose: Pose,
}

/// Starts by rising cost, one per neighbourhood.
struct Ranked {
    items: [Start; MAX_CANDIDATES],
    len: usize,
    /// Cost below which a pose counts as exact.
    exact: f64,
    /// Number of observations.
    count: f64,
}

impl Ranked {
    fn new(exact: f64, count: usize) -> Self {
        let none = Start { cost: f64::INFINITY, mirrored: true, pose: Pose::ORIGIN };
        Self { items: [none; MAX_CANDIDATES], len: 0, exact, count: count as f64 }
    }

    fn insert(&mut self, new: Start, range: f64) {
        let exact = self.exact;
        let near = |old: &Start| {
            let both = old.cost <= exact && new.cost <= exact;
            let same = if both { SAME_EXACT } else { SAME };
            (old.pose.dcm - new.pose.dcm).norm_squared() < 2.0 * same * same
                && (old.pose.position - new.pose.position).norm() < same * range
        };
        let mut kept = 0;
        for k in 0..self.len {
            let Some(old) = self.items.get(k).copied() else { break };
            if near(&old) {
                if old.cost <= new.cost {
                    return;
                }
            } else {
                self.put(kept, old);
                kept += 1;
            }
        }
        self.len = kept;
        self.insert_sorted(new);
    }

    fn put(&mut self, k: usize, start: Start) {
        if let Some(slot) = self.items.get_mut(k) {
            *slot = start;
        }
    }

    /// From the back; the dearest falls out of a full list.
    fn insert_sorted(&mut self, new: Start) {
        let mut k = self.len;
        while let Some(before) = k.checked_sub(1).and_then(|k| self.items.get(k)).copied() {
            if before.cost <= new.cost {
                break;
            }
            self.put(k, before);
            k -= 1;
        }
        self.put(k, new);
        self.len = (self.len + 1).min(MAX_CANDIDATES);
    }

    /// The poses worth polishing.
    fn poses(&self) -> Poses<MAX_CANDIDATES> {
        let held = self.items.iter().take(self.len);
        let all_mirrored = held.clone().all(|s| s.mirrored);
        let eligible = held.filter(|s| s.mirrored == all_mirrored);
        let cheapest = eligible.clone().map(|s| s.cost).fold(f64::INFINITY, f64::min);
        // An exact fit says nothing about the noise; one far below it says that the weights are not its inverse variances.
        let scaled = cheapest <= self.exact || cheapest > UNSCALED * self.count;
        let comparable = if scaled { COMPARABLE } else { 0.0 };
        let worth = (PRUNE * cheapest).max(self.exact).max(comparable);
        let mut out = Poses::new();
        for start in eligible.filter(|s| s.cost <= worth) {
            out.push(start.pose);
        }
        out
    }
}

/// The 24 rotations of the cube, rows first.
const GRID: [[f64; 9]; 24] = cube_rotations();

const fn cube_rotations() -> [[f64; 9]; 24] {
    let permutations = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];
    let mut out = [[0.0; 9]; 24];
    let mut n = 0;
    let mut p = 0;
    while p < 6 {
        let mut s = 0;
        while s < 4 {
            let x = if s & 1 == 0 { 1.0 } else { -1.0 };
            let y = if s & 2 == 0 { 1.0 } else { -1.0 };
            // Odd permutations need an odd number of signs for determinant +1.
            let z = if p < 3 { x * y } else { -x * y };
            out[n][permutations[p][0]] = x;
            out[n][3 + permutations[p][1]] = y;
            out[n][6 + permutations[p][2]] = z;
            n += 1;
            s += 1;
        }
        p += 1;
    }
    out
}
