//! Random samples for the robust solvers: how many, and which.
use num_traits::Float;

/// Samples drawn beyond the textbook number, which takes every all-right sample for a success: noise spoils some.
const SPARE_SAMPLES: f64 = 1.5;
/// Bound on the samples whatever is asked.
const SAMPLES_MAX: f64 = 20_000.0;

/// Samples of `size` after which one without wrong observations was drawn with the given confidence.
pub(super) fn samples_needed(inliers: f64, n: f64, size: u32, confidence: f64) -> f64 {
    let mut good = 1.0;
    for k in 0..size {
        let drawn = f64::from(k);
        good *= (inliers - drawn).max(0.0) / (n - drawn);
    }
    if good >= 1.0 {
        return 1.0;
    }
    if good.is_nan() || good <= 1e-12 {
        return SAMPLES_MAX;
    }
    let needed = SPARE_SAMPLES * Float::ln(1.0 - confidence) / Float::ln(1.0 - good);
    if needed < SAMPLES_MAX { needed.max(1.0) } else { SAMPLES_MAX }
}

/// SplitMix64 (Steele, Lea & Flood, OOPSLA 2014): the same seed, the same draws, on every machine.
pub(super) struct Draws {
    state: u64,
}

impl Draws {
    pub(super) fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    #[inline]
    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    #[inline]
    fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Two different indices below `n`, each pair as likely: draw from the ranks that are left.
    #[inline]
    pub(super) fn pair(&mut self, n: usize) -> [usize; 2] {
        let i = self.below(n);
        let j = self.below(n - 1);
        [i, j + usize::from(j >= i)]
    }

    /// Three different indices below `n`, each triple as likely.
    #[inline]
    pub(super) fn triple(&mut self, n: usize) -> [usize; 3] {
        let [i, j] = self.pair(n);
        let (low, high) = (i.min(j), i.max(j));
        let mut k = self.below(n - 2);
        k += usize::from(k >= low);
        k += usize::from(k >= high);
        [i, j, k]
    }
}

/// The triples `i < j < k < n` in turn.
#[inline]
pub(super) fn triple_after([i, j, k]: [usize; 3], n: usize) -> [usize; 3] {
    if k + 1 < n {
        [i, j, k + 1]
    } else if j + 2 < n {
        [i, j + 1, j + 2]
    } else {
        [i + 1, i + 2, i + 3]
    }
}

/// The pairs `i < j < n` in turn.
#[inline]
pub(super) fn pair_after([i, j]: [usize; 2], n: usize) -> [usize; 2] {
    if j + 1 < n { [i, j + 1] } else { [i + 1, i + 2] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_different_and_all_come() {
        let mut seen = [[0; 5]; 5];
        let mut draws = Draws::new(1);
        for _ in 0..20_000 {
            let [i, j] = draws.pair(5);
            seen[i][j] += 1;
        }
        for (i, row) in seen.iter().enumerate() {
            for (j, count) in row.iter().enumerate() {
                // 1000 each; 5 standard deviations.
                assert_eq!(*count > 0, i != j);
                assert!(i == j || (840..1160).contains(count), "{count}");
            }
        }
    }

    #[test]
    fn in_turn_all_come_once() {
        let (mut pair, mut triple, mut count) = ([0, 1], [0, 1, 2], 0);
        for i in 0..6 {
            for j in i + 1..6 {
                assert_eq!(pair, [i, j]);
                pair = pair_after(pair, 6);
                for k in j + 1..6 {
                    assert_eq!(triple, [i, j, k]);
                    triple = triple_after(triple, 6);
                    count += 1;
                }
            }
        }
        assert_eq!(count, 20);
    }

    #[test]
    fn samples() {
        // Half of very many wrong: pairs are right once in four, ln 1e-4 / ln 0.75 = 32.
        assert!((samples_needed(5e8, 1e9, 2, 0.9999) - 1.5 * 32.0157).abs() < 1e-3);
        assert!((samples_needed(4.0, 4.0, 3, 0.9999) - 1.0).abs() < 1e-15);
        assert!((samples_needed(1.0, 9.0, 2, 0.9999) - SAMPLES_MAX).abs() < 1e-15);
    }
}
