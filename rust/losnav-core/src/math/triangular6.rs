//! Upper-triangular square root `R` of an information matrix, `RᵀR = HᵀWH`, and its singular values.
//!
//! 1. A whitened row joins by six Givens rotations. Nothing is squared, so singular values are good to the rounding
//!    of the largest, where those of `HᵀWH` stop at its square root.
//! 2. Singular values by one-sided Jacobi: turn pairs of columns of `R V` until all are perpendicular; their norms
//!    are the values, `V` holds the vectors. At most `SWEEPS` sweeps; in practice five to eight.
use super::real::Real;

/// Least ratio of the smallest to the largest scaled singular value of a full-rank problem.
///
/// Its square, 1e-14, is what the pivots of the normal equations can resolve in double precision.
pub const RANK_TOLERANCE: f64 = 1e-7;
/// Bound on the sweeps of the Jacobi iteration, which doubles its digits in each sweep near the end.
const SWEEPS: usize = 24;
/// Columns this small beside the largest are rounding: their mutual angle means nothing.
const NEGLIGIBLE: f64 = 4.0 * f64::EPSILON;

/// Rows of the upper triangle; what lies below the diagonal is zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangular6(pub [[f64; 6]; 6]);

/// Singular values, largest first, and the right singular vector of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Singular6 {
    /// Largest first.
    pub values: [f64; 6],
    /// `vectors[k]` is the unit vector belonging to `values[k]`.
    pub vectors: [[f64; 6]; 6],
}

impl Triangular6 {
    /// No information.
    #[must_use]
    pub const fn zero() -> Self {
        Self([[0.0; 6]; 6])
    }

    /// Takes one whitened row.
    pub fn absorb(&mut self, mut row: [f64; 6]) {
        for (k, pivot_row) in self.0.iter_mut().enumerate() {
            if row[k] == 0.0 {
                continue;
            }
            let (c, s) = givens(pivot_row[k], row[k]);
            for j in k..6 {
                let (a, b) = (pivot_row[j], row[j]);
                pivot_row[j] = c * a + s * b;
                row[j] = c * b - s * a;
            }
        }
    }

    /// Every column multiplied by its scale: the root in other units.
    #[must_use]
    pub fn scaled(&self, scale: &[f64; 6]) -> Self {
        let mut out = *self;
        for row in &mut out.0 {
            for (entry, s) in row.iter_mut().zip(scale) {
                *entry *= s;
            }
        }
        out
    }

    /// Singular values and right vectors.
    #[must_use]
    pub fn singular(&self) -> Singular6 {
        let largest = self.0.iter().flatten().fold(0.0_f64, |m, x| Real::max(m, Real::abs(*x)));
        let unit = if largest > 0.0 { largest } else { 1.0 };
        // Columns as rows, so that a rotation works on two contiguous arrays.
        let mut columns = [[0.0; 6]; 6];
        for (i, row) in self.0.iter().enumerate() {
            for (j, x) in row.iter().enumerate() {
                columns[j][i] = x / unit;
            }
        }
        let mut vectors = [[0.0; 6]; 6];
        for (k, v) in vectors.iter_mut().enumerate() {
            v[k] = 1.0;
        }
        for _ in 0..SWEEPS {
            if !sweep(&mut columns, &mut vectors) {
                break;
            }
        }
        let values = columns.map(|c| unit * Real::sqrt(inner(&c, &c)));
        sorted(values, &vectors)
    }
}

impl Singular6 {
    /// How many singular values exceed [`RANK_TOLERANCE`] times the largest.
    #[must_use]
    pub fn rank(&self) -> usize {
        let floor = RANK_TOLERANCE * self.values[0];
        self.values.iter().filter(|v| **v > floor).count()
    }
}

/// `(c, s)` with `−s a + c b = 0`, free of overflow.
fn givens(a: f64, b: f64) -> (f64, f64) {
    if Real::abs(b) > Real::abs(a) {
        let t = a / b;
        let s = 1.0 / Real::sqrt(1.0 + t * t);
        (s * t, s)
    } else {
        let t = b / a;
        let c = 1.0 / Real::sqrt(1.0 + t * t);
        (c, c * t)
    }
}

fn inner(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// One sweep over all pairs; was any pair turned?
fn sweep(columns: &mut [[f64; 6]; 6], vectors: &mut [[f64; 6]; 6]) -> bool {
    let total: f64 = columns.iter().map(|c| inner(c, c)).sum();
    let floor = NEGLIGIBLE * NEGLIGIBLE * total;
    let mut turned = false;
    for p in 0..5 {
        for q in p + 1..6 {
            let (alpha, beta) = (inner(&columns[p], &columns[p]), inner(&columns[q], &columns[q]));
            let gamma = inner(&columns[p], &columns[q]);
            let larger = Real::max(alpha, beta);
            if larger <= floor || Real::abs(gamma) <= f64::EPSILON * larger {
                continue;
            }
            let zeta = (beta - alpha) / (2.0 * gamma);
            let size = 1.0 / (Real::abs(zeta) + Real::sqrt(1.0 + zeta * zeta));
            let t = if zeta < 0.0 { -size } else { size };
            let c = 1.0 / Real::sqrt(1.0 + t * t);
            turn(columns, p, q, c, c * t);
            turn(vectors, p, q, c, c * t);
            turned = true;
        }
    }
    turned
}

fn turn(m: &mut [[f64; 6]; 6], p: usize, q: usize, c: f64, s: f64) {
    for k in 0..6 {
        let (a, b) = (m[p][k], m[q][k]);
        m[p][k] = c * a - s * b;
        m[q][k] = s * a + c * b;
    }
}

/// Largest value first; each vector with its largest component positive, so that the answer is one.
fn sorted(values: [f64; 6], vectors: &[[f64; 6]; 6]) -> Singular6 {
    let mut order = [0, 1, 2, 3, 4, 5];
    for i in 1..6 {
        let mut j = i;
        while j > 0 && values[order[j - 1]] < values[order[j]] {
            order.swap(j - 1, j);
            j -= 1;
        }
    }
    Singular6 { values: order.map(|k| values[k]), vectors: order.map(|k| signed(&vectors[k])) }
}

fn signed(v: &[f64; 6]) -> [f64; 6] {
    let mut lead = 0.0_f64;
    for x in v {
        // Ahead by more than rounding, so that equal components do not make the sign a lottery.
        if Real::abs(*x) > Real::abs(lead) * (1.0 + 1e-6) {
            lead = *x;
        }
    }
    if lead < 0.0 { v.map(|x| -x) } else { *v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn root(rows: &[[f64; 6]]) -> Triangular6 {
        let mut r = Triangular6::zero();
        rows.iter().for_each(|row| r.absorb(*row));
        r
    }

    fn apply(r: &Triangular6, v: &[f64; 6]) -> f64 {
        r.0.iter().map(|row| inner(row, v)).map(|y| y * y).sum::<f64>().sqrt()
    }

    proptest! {
        #[test]
        fn the_root_has_the_information_of_the_rows(rows in prop::collection::vec(prop::array::uniform6(-1.0..1.0), 1..20)) {
            let r = root(&rows);
            for i in 0..6 {
                for j in 0..6 {
                    let want: f64 = rows.iter().map(|row| row[i] * row[j]).sum();
                    let got: f64 = r.0.iter().map(|row| row[i] * row[j]).sum();
                    prop_assert!((want - got).abs() < 1e-13 * rows.len() as f64);
                    prop_assert!(j >= i || r.0[i][j] == 0.0);
                }
            }
        }

        #[test]
        fn vectors_are_orthonormal_and_stretched_by_their_values(
            rows in prop::collection::vec(prop::array::uniform6(-1.0..1.0), 1..12),
            exponent in -150.0..150.0_f64,
        ) {
            let unit = 10.0_f64.powf(exponent);
            let r = root(&rows).scaled(&[unit; 6]);
            let s = r.singular();
            for k in 0..6 {
                prop_assert!((apply(&r, &s.vectors[k]) / unit - s.values[k] / unit).abs() < 1e-13);
                for l in 0..6 {
                    let want = if k == l { 1.0 } else { 0.0 };
                    prop_assert!((inner(&s.vectors[k], &s.vectors[l]) - want).abs() < 1e-14);
                }
                prop_assert!(k == 0 || s.values[k] <= s.values[k - 1]);
            }
            prop_assert!(s.rank() == rows.len().min(6));
        }
    }

    #[test]
    fn a_ratio_of_fifteen_decades_is_resolved() {
        // Two rows differing by 1e-12: their square would be lost in HᵀWH.
        let a = [1.0, 2.0, -1.0, 0.5, 3.0, 1.0];
        let mut b = a;
        b[3] += 1e-12;
        let s = root(&[a, b]).singular();
        let expected = 1e-12 * ((inner(&a, &a) - 0.25) / (2.0 * inner(&a, &a))).sqrt();
        assert!((s.values[1] / expected - 1.0).abs() < 1e-3, "{:?} {expected}", s.values);
        assert_eq!(s.rank(), 1);
    }

    #[test]
    fn nothing_and_nan_end() {
        assert_eq!(Triangular6::zero().singular().rank(), 0);
        let s = root(&[[f64::NAN; 6], [1.0; 6]]).singular();
        assert_eq!(s.rank(), 0);
    }
}
