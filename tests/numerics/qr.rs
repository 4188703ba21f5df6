//! The triangular factor: the Gram matrix of the rows, the same bits on any number of threads.

use fluxform_numerics::double_double::DoubleDouble;
use fluxform_numerics::qr::{Triangle, triangular_factor};
use fluxform_numerics::real::Real;

/// A full, badly balanced matrix whose entries are exact in both precisions.
fn entry(i: usize, j: usize) -> f64 {
    ((i * 31 + j * 17) % 101) as f64 / 64.0 - 0.7 + if i == j { 3.0 } else { 0.0 }
}

fn factor<T: Real>(rows: usize, columns: usize) -> Triangle<T> {
    triangular_factor(rows, columns, |range, block, stride| {
        for j in 0..columns {
            for (k, i) in range.clone().enumerate() {
                block[j * stride + k] = T::of(entry(i, j));
            }
        }
    })
}

/// Largest |R'R - A'A|, relative to the columns' norms.
fn gram_error<T: Real>(rows: usize, columns: usize) -> f64 {
    let r = factor::<T>(rows, columns);
    let gram = |j: usize, k: usize| {
        (0..rows).fold(T::ZERO, |s, i| s + T::of(entry(i, j)) * T::of(entry(i, k)))
    };
    let mut worst = 0.0_f64;
    for j in 0..columns {
        for k in 0..columns {
            let error = (T::dot(r.column(j), r.column(k)) - gram(j, k)).abs();
            worst = worst.max((error / (gram(j, j) * gram(k, k)).sqrt()).to_f64());
        }
    }
    worst
}

#[test]
fn r_has_the_gram_matrix_of_the_rows_in_both_precisions() {
    for (rows, columns) in [(1, 3), (2, 2), (7, 4), (256, 5), (300, 3), (40_000, 4)] {
        let (plain, double) = (
            gram_error::<f64>(rows, columns),
            gram_error::<DoubleDouble>(rows, columns),
        );
        assert!(
            plain < 1e-14 * (1.0 + rows as f64 / 1e3),
            "{rows} x {columns}: {plain:e}"
        );
        assert!(
            double < 1e-30 * (1.0 + rows as f64 / 1e3),
            "{rows} x {columns}: {double:e}"
        );
    }
}

/// Of more columns than rows, what was left of the last ones underflowed to NaN.
#[test]
fn many_columns_of_few_rows_have_the_gram_matrix_too() {
    for (rows, columns) in [(9, 50), (9, 400), (3, 30), (1, 200)] {
        let plain = gram_error::<f64>(rows, columns);
        let double = gram_error::<DoubleDouble>(rows, columns);
        assert!(plain < 1e-13, "{rows} x {columns}: {plain:e}");
        assert!(double < 1e-29, "{rows} x {columns}: {double:e}");
    }
}

#[test]
fn one_thread_and_three_give_the_same_bits() {
    let pool = |n| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n)
            .build()
            .expect("a small pool")
    };
    let one = pool(1).install(|| factor::<f64>(50_001, 4));
    let three = pool(3).install(|| factor::<f64>(50_001, 4));
    for j in 0..4 {
        assert_eq!(one.column(j), three.column(j));
    }
}

#[test]
fn entries_below_the_diagonal_are_zero() {
    let r = factor::<f64>(513, 5);
    for j in 0..5 {
        assert!(r.column(j)[j + 1..].iter().all(|&x| x == 0.0));
        assert!(r.column(j)[j] != 0.0);
    }
}
