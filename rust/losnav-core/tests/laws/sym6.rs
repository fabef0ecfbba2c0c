//! The packed 6×6 algebra against nalgebra's.
use losnav_core::math::sym6::{Sym6, index};
use nalgebra::{Matrix6, Vector6};
use proptest::prelude::*;

use crate::{SAME_FORMULA, assert_close};

fn packed(m: &Matrix6<f64>) -> Sym6<f64> {
    let mut a = Sym6::zero();
    for i in 0..6 {
        for j in i..6 {
            a.0[index(i, j)] = m[(i, j)];
        }
    }
    a
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn solve_inverse_and_norm(entries in prop::array::uniform32(-1.0..1.0_f64), more in prop::array::uniform10(-1.0..1.0_f64)) {
        let all: Vec<f64> = entries.into_iter().chain(more).collect();
        let root = Matrix6::from_column_slice(&all[..36]);
        let m = root * root.transpose() + Matrix6::identity() * 0.1;
        let b = Vector6::from_column_slice(&all[36..]);
        let ldl = packed(&m).ldl();
        prop_assert!(ldl.positive());
        let reference = m.cholesky().unwrap();
        let expected = reference.solve(&b);
        let got = ldl.solve(&b.into());
        for i in 0..6 {
            assert_close(got[i], expected[i], expected.amax(), SAME_FORMULA);
        }
        assert_close(ldl.inverse_norm2(&b.into()), b.dot(&expected), b.dot(&expected), SAME_FORMULA);
        let inverse = reference.inverse();
        for i in 0..6 {
            for j in 0..6 {
                assert_close(ldl.inverse().at(i, j), inverse[(i, j)], inverse.amax(), SAME_FORMULA);
            }
        }
        let pivots: f64 = ldl.pivots().iter().product();
        assert_close(pivots, m.determinant(), pivots, SAME_FORMULA);
    }

    #[test]
    fn an_indefinite_matrix_is_not_positive(entries in prop::array::uniform32(-1.0..1.0_f64), which in 0..6_usize) {
        let root = Matrix6::from_fn(|i, j| entries[(6 * i + j) % 32]);
        let mut m = root * root.transpose() + Matrix6::identity();
        m[(which, which)] = -0.5;
        prop_assert!(!packed(&m).ldl().positive());
    }
}

#[test]
fn damping_adds_to_the_diagonal() {
    let m = packed(&Matrix6::from_fn(|i, j| (1 + i.min(j)) as f64));
    let damped = m.damped(0.5, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    for i in 0..6 {
        for j in 0..6 {
            let extra = if i == j { 0.5 * (i + 1) as f64 } else { 0.0 };
            assert_eq!(damped.at(i, j), m.at(i, j) + extra);
        }
    }
    assert_eq!(m.diagonal(), core::array::from_fn(|i| m.at(i, i)));
}
