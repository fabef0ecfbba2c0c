//! Eigenvalues of small symmetric matrices by cyclic Jacobi rotations, in double precision.
//!
//! Slow and sure: no iteration of it can fail, and eigenvectors are orthogonal to rounding whatever the gaps.
use num_traits::Float;

/// Bound on the sweeps; six are usual, each doubles the digits near the end.
const SWEEPS: usize = 30;

/// Eigenvalues in falling order, eigenvectors as rows in the same order.
#[derive(Clone, Copy, Debug)]
pub struct Eigen<const N: usize> {
    /// Eigenvalues, largest first.
    pub values: [f64; N],
    /// `vectors[k]` belongs to `values[k]`.
    pub vectors: [[f64; N]; N],
}

/// Eigenvalues and eigenvectors of a symmetric matrix; of its upper triangle, to be exact.
#[must_use]
pub fn eigen<const N: usize>(matrix: &[[f64; N]; N]) -> Eigen<N> {
    let mut a = *matrix;
    // Rows are the eigenvectors: one rotation touches two rows.
    let mut vectors = [[0.0; N]; N];
    for k in 0..N {
        vectors[k][k] = 1.0;
    }
    for _ in 0..SWEEPS {
        let mut quiet = true;
        for p in 0..N {
            for q in p + 1..N {
                // What no longer changes a diagonal entry is gone.
                let off = Float::abs(a[p][q]);
                if off + Float::abs(a[p][p]) == Float::abs(a[p][p])
                    && off + Float::abs(a[q][q]) == Float::abs(a[q][q])
                {
                    a[p][q] = 0.0;
                    continue;
                }
                quiet = false;
                rotate(&mut a, &mut vectors, p, q);
            }
        }
        if quiet {
            break;
        }
    }
    sorted(&a, &vectors)
}

/// One rotation that zeroes entry `(p, q)`.
fn rotate<const N: usize>(a: &mut [[f64; N]; N], vectors: &mut [[f64; N]; N], p: usize, q: usize) {
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let sign = if theta < 0.0 { -1.0 } else { 1.0 };
    let t = sign / (Float::abs(theta) + Float::hypot(theta, 1.0));
    let c = 1.0 / Float::sqrt(t * t + 1.0);
    let s = t * c;
    let shift = t * a[p][q];
    a[p][p] -= shift;
    a[q][q] += shift;
    a[p][q] = 0.0;
    for k in 0..N {
        if k != p && k != q {
            let (ip, iq) = (if k < p { (k, p) } else { (p, k) }, if k < q { (k, q) } else { (q, k) });
            let (x, y) = (a[ip.0][ip.1], a[iq.0][iq.1]);
            a[ip.0][ip.1] = c * x - s * y;
            a[iq.0][iq.1] = s * x + c * y;
        }
        let (x, y) = (vectors[p][k], vectors[q][k]);
        vectors[p][k] = c * x - s * y;
        vectors[q][k] = s * x + c * y;
    }
}

fn sorted<const N: usize>(a: &[[f64; N]; N], vectors: &[[f64; N]; N]) -> Eigen<N> {
    let mut out = Eigen { values: [0.0; N], vectors: *vectors };
    for k in 0..N {
        out.values[k] = a[k][k];
    }
    for end in 1..N {
        let mut at = end;
        while at > 0 && out.values[at - 1] < out.values[at] {
            out.values.swap(at - 1, at);
            out.vectors.swap(at - 1, at);
            at -= 1;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check<const N: usize>(matrix: &[[f64; N]; N]) {
        let found = eigen(matrix);
        for k in 0..N {
            for i in 0..N {
                let image: f64 = (0..N).map(|j| matrix[i][j] * found.vectors[k][j]).sum();
                assert!((image - found.values[k] * found.vectors[k][i]).abs() < 1e-14);
            }
            for l in 0..N {
                let dot: f64 = (0..N).map(|j| found.vectors[k][j] * found.vectors[l][j]).sum();
                assert!((dot - if k == l { 1.0 } else { 0.0 }).abs() < 1e-15 * N as f64);
            }
            assert!(k == 0 || found.values[k - 1] >= found.values[k]);
        }
    }

    #[test]
    fn generic_repeated_and_diagonal() {
        check(&[[2.0, 0.3, -0.1], [0.3, 1.0, 0.2], [-0.1, 0.2, -0.5]]);
        check(&[[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]);
        check(&[[3.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 7.0]]);
        let mut four = [[0.0; 4]; 4];
        for i in 0..4 {
            for j in 0..4 {
                four[i][j] = 1.0 / (1.0 + (i + j) as f64);
            }
        }
        check(&four);
        check(&[[0.0; 4]; 4]);
    }
}
