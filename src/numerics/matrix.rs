//! Products of small dense matrices, row by row in memory.

use super::dispatch::{self, Kernel, LANES, Lanes};

/// Rows of the product that share the loads of the right factor.
const ROWS: usize = 4;

/// `out` = `a` `b`, where `a` is (rows x inner), `b` (inner x columns); every matrix row-major.
///
/// # Panics
/// When the slices' lengths do not fit together.
pub fn product(a: &[f64], b: &[f64], inner: usize, out: &mut [f64]) {
    out.fill(0.0);
    add_product(a, b, inner, out);
}

/// Adds what [`product`] gives to `out`.
///
/// # Panics
/// As there.
pub fn add_product(a: &[f64], b: &[f64], inner: usize, out: &mut [f64]) {
    if inner == 0 || out.is_empty() {
        return;
    }
    let whole = a.len().is_multiple_of(inner) && b.len().is_multiple_of(inner);
    assert!(whole, "whole rows");
    let (rows, columns) = (a.len() / inner, b.len() / inner);
    assert_eq!(out.len(), rows * columns, "rows by columns");
    dispatch::run(Product {
        a,
        b,
        inner,
        columns,
        out,
    });
}

/// The transpose of `a`, which has rows of `columns`.
#[must_use]
#[inline]
pub fn transpose(a: &[f64], columns: usize) -> Vec<f64> {
    let rows = a.len() / columns.max(1);
    (0..a.len())
        .map(|place| a[place % rows * columns + place / rows])
        .collect()
}

struct Product<'a> {
    a: &'a [f64],
    b: &'a [f64],
    inner: usize,
    columns: usize,
    out: &'a mut [f64],
}

impl Kernel for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Self {
            a,
            b,
            inner,
            columns,
            out,
        } = self;
        for (a, out) in a.chunks(ROWS * inner).zip(out.chunks_mut(ROWS * columns)) {
            if a.len() == ROWS * inner {
                rows::<FMA, ROWS>(a, b, inner, columns, out);
            } else {
                for (a, out) in a.chunks(inner).zip(out.chunks_mut(columns)) {
                    rows::<FMA, 1>(a, b, inner, columns, out);
                }
            }
        }
    }
}

/// `R` rows of the product, a vector of columns at a time.
#[inline(always)]
fn rows<const FMA: bool, const R: usize>(
    a: &[f64],
    b: &[f64],
    inner: usize,
    columns: usize,
    out: &mut [f64],
) {
    for start in (0..columns).step_by(LANES) {
        let end = (start + LANES).min(columns);
        let mut sums: [Lanes; R] = std::array::from_fn(|row| {
            Lanes::load(&out[row * columns + start..row * columns + end])
        });
        for l in 0..inner {
            let right = Lanes::load(&b[l * columns + start..l * columns + end]);
            for (row, sum) in sums.iter_mut().enumerate() {
                *sum = right.mul_add::<FMA>(Lanes::splat(a[row * inner + l]), *sum);
            }
        }
        for (row, sum) in sums.into_iter().enumerate() {
            sum.store(&mut out[row * columns + start..row * columns + end]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_all_shapes_are_the_plain_sums() {
        let value = |i: usize| ((i * 37 + 11) % 101) as f64 * 0.07 - 1.3;
        for (rows, inner, columns) in [(1, 1, 1), (4, 3, 8), (5, 7, 9), (9, 2, 17), (3, 13, 31)] {
            let a: Vec<f64> = (0..rows * inner).map(value).collect();
            let b: Vec<f64> = (0..inner * columns).map(|i| value(i + 5)).collect();
            let mut out = vec![f64::NAN; rows * columns];
            product(&a, &b, inner, &mut out);
            for (place, got) in out.iter().enumerate() {
                let (i, j) = (place / columns, place % columns);
                let plain: f64 = (0..inner)
                    .map(|l| a[i * inner + l] * b[l * columns + j])
                    .sum();
                assert!((got - plain).abs() < 1e-13, "{rows} {inner} {columns}");
            }
            let once = out.clone();
            add_product(&a, &b, inner, &mut out);
            for (twice, once) in out.iter().zip(&once) {
                assert!(
                    (twice - 2.0 * once).abs() < 1e-13,
                    "{rows} {inner} {columns}"
                );
            }
            assert_eq!(transpose(&transpose(&a, inner), rows), a);
        }
    }
}
