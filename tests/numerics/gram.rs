//! The factor from products of columns, against the one by reflections.

use fluxform_numerics::double_double::DoubleDouble;
use fluxform_numerics::gram::triangular_factor_by_products;
use fluxform_numerics::qr::{Triangle, triangular_factor};
use fluxform_numerics::random::Random;
use fluxform_numerics::real::Real;

/// `rows` by `columns` random entries, each column a share of the one before and a part of its own.
fn matrix(rows: usize, columns: usize, own: f64) -> Vec<Vec<f64>> {
    let mut random = Random::new(7);
    let mut all: Vec<Vec<f64>> = Vec::new();
    for j in 0..columns {
        let column = (0..rows).map(|i| {
            let before = if j > 0 { all[j - 1][i] } else { 0.0 };
            0.7 * before + own * random.between(-1.0, 1.0)
        });
        let column = column.collect();
        all.push(column);
    }
    all
}

fn weight(i: usize) -> f64 {
    0.3 + (i % 7) as f64 / 7.0
}

fn both(
    rows: usize,
    columns: usize,
    own: f64,
) -> (Triangle<DoubleDouble>, Option<Triangle<DoubleDouble>>) {
    let all = matrix(rows, columns, own);
    let reflected = triangular_factor(rows, columns, |range, block, stride| {
        for (j, column) in all.iter().enumerate() {
            for (k, i) in range.clone().enumerate() {
                block[j * stride + k] =
                    DoubleDouble::of(column[i]) * DoubleDouble::of(weight(i)).sqrt();
            }
        }
    });
    let by_products = triangular_factor_by_products(
        rows,
        columns,
        |range, block, stride| {
            for (j, column) in all.iter().enumerate() {
                block[j * stride..][..range.len()].copy_from_slice(&column[range.clone()]);
            }
        },
        |range, weights| {
            for (i, entry) in range.zip(weights) {
                *entry = weight(i);
            }
        },
    );
    (reflected, by_products)
}

#[test]
fn the_factor_is_that_of_reflections_to_thirty_digits() {
    let sizes = [(1, 1), (7, 4), (256, 9), (300, 3), (1500, 17), (20_000, 5)];
    for (own, (rows, columns)) in [0.7, 1e-4]
        .iter()
        .flat_map(|own| sizes.map(|size| (*own, size)))
    {
        let (reflected, by_products) = both(rows, columns, own);
        let by_products = by_products.unwrap();
        for j in 0..columns {
            let length = DoubleDouble::dot(reflected.column(j), reflected.column(j)).sqrt();
            for i in 0..columns {
                // Their diagonals may differ in sign.
                let (a, b) = (reflected.column(j)[i], by_products.column(j)[i]);
                let off = ((a.abs() - b.abs()).abs() / length).to_f64();
                let most = 1e-28 * (0.7_f64 / own).powi(2);
                assert!(off < most, "{own} of {rows} x {columns}, {i} {j}: {off:e}");
            }
        }
    }
}

#[test]
fn a_column_that_nearly_depends_on_others_is_refused() {
    let dependent = |own: f64| {
        let column = |j: usize, i: usize| match j {
            0 => 0.7 + (i % 3) as f64,
            _ => 1.4 + 2.0 * (i % 3) as f64 + own * (i % 5) as f64,
        };
        triangular_factor_by_products(
            40,
            2,
            |range, block, stride| {
                for j in 0..2 {
                    for (k, i) in range.clone().enumerate() {
                        block[j * stride + k] = column(j, i);
                    }
                }
            },
            |_, weights| weights.fill(1.0),
        )
    };
    assert!(dependent(1e-10).is_some());
    assert!(dependent(1e-12).is_none());
}

#[test]
fn one_thread_and_three_give_the_same_bits() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap().install(|| both(9_001, 4, 0.7).1.unwrap())
    };
    let (one, three) = (with(1), with(3));
    for j in 0..4 {
        assert_eq!(one.column(j), three.column(j));
    }
}
