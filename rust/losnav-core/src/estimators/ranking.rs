//! The minima a guess-free solve reports: polished starts, ranked by cost, one of each.
//!
//! 1. Drop what is not finite.
//! 2. Sort by cost; between equal costs a converged minimum comes first.
//! 3. Merge poses closer than `SAME`.
//! 4. Keep the best, and of the rest the converged ones whose cost is comparable.
use crate::estimators::least_squares::{Outcome, rounding_floor};
use crate::math::vec3::{dot, sub};

/// Poses closer than this are one: rad, position in units of the range.
const SAME: f64 = 1e-5;
/// A minimum is comparable if its `χ²` exceeds the best one's by less than this: 7 standard deviations.
const COMPARABLE: f64 = 50.0;
/// A reduced `χ²` below this says that the noise given is not the noise there is (an honest one this small has
/// probability 1e-6 at two degrees of freedom); comparison is then with the residuals themselves.
const UNSCALED: f64 = 1e-6;
/// In which case costs within this factor of the best are comparable.
const COMPARABLE_FACTOR: f64 = 1e3;

/// Reorders `outcomes` so that the reported ones stand first, best first, and returns how many they are.
pub fn rank(outcomes: &mut [Outcome<f64>], total_weight: f64, degrees_of_freedom: f64) -> usize {
    let floor = 1e3 * rounding_floor(total_weight);
    sort(outcomes, floor);
    let Some(best) = outcomes.first().copied().filter(|best| best.cost.is_finite()) else { return 0 };
    let limit = comparable_cost(best.cost, floor, degrees_of_freedom);
    let mut kept = 1;
    for index in 1..outcomes.len() {
        let Some(&outcome) = outcomes.get(index) else { break };
        let reported = outcomes.get(..kept).unwrap_or(&[]);
        let comparable = outcome.converged && outcome.cost <= limit;
        if comparable && !reported.iter().any(|other| same(other, &outcome)) {
            outcomes.swap(kept, index);
            kept += 1;
        }
    }
    kept
}

fn comparable_cost(best: f64, floor: f64, degrees_of_freedom: f64) -> f64 {
    let reduced = 2.0 * best / degrees_of_freedom.max(1.0);
    let chance = if reduced < UNSCALED && best > floor { COMPARABLE_FACTOR * best } else { 0.5 * COMPARABLE };
    best + chance.max(floor)
}

/// Insertion sort: there are a few dozen at most.
fn sort(outcomes: &mut [Outcome<f64>], floor: f64) {
    for end in 1..outcomes.len() {
        let mut at = end;
        while at > 0 && precedes(outcomes.get(at), outcomes.get(at - 1), floor) {
            outcomes.swap(at, at - 1);
            at -= 1;
        }
    }
}

fn precedes(a: Option<&Outcome<f64>>, b: Option<&Outcome<f64>>, floor: f64) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return false };
    if !a.cost.is_finite() || !b.cost.is_finite() {
        return a.cost.is_finite() && !b.cost.is_finite();
    }
    let tie = 1e-9 * a.cost.min(b.cost) + floor;
    if (a.cost - b.cost).abs() <= tie { a.converged && !b.converged } else { a.cost < b.cost }
}

fn same(a: &Outcome<f64>, b: &Outcome<f64>) -> bool {
    let (p, q) = (a.pose.attitude, b.pose.attitude);
    let cosine = p.iter().zip(&q).map(|(x, y)| x * y).sum::<f64>().abs();
    let d = sub(a.pose.position, b.pose.position);
    // 1 − |cos(θ/2)| = θ²/8.
    let angle2 = 8.0 * (1.0 - cosine).max(0.0);
    let diagonal = a.information.diagonal();
    let inverse_range2 =
        (diagonal[0] + diagonal[1] + diagonal[2]) / (diagonal[3] + diagonal[4] + diagonal[5]);
    angle2 + dot(d, d) * inverse_range2 < SAME * SAME
}
