//! Products of small dense matrices, row by row in memory.

use super::dispatch::{self, Kernel, LANES, Lanes, mul_add};

/// Most rows of the product that share the loads of the right factor: their sums fill the registers.
const ROWS: usize = 6;

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
        let all = out.len() / columns;
        if all == 1 {
            for (left, row) in a.iter().zip(b.chunks_exact(columns)) {
                for (sum, right) in out.iter_mut().zip(row) {
                    *sum = mul_add::<FMA>(*right, *left, *sum);
                }
            }
            return;
        }
        // As many groups as are needed, of about as many rows each.
        let most = all.div_ceil(all.div_ceil(ROWS));
        let mut strip = vec![Lanes::splat(0.0); inner];
        let mut sums = vec![Lanes::splat(0.0); all];
        for start in (0..columns).step_by(LANES) {
            let end = (start + LANES).min(columns);
            for (strip, row) in strip.iter_mut().zip(b.chunks_exact(columns)) {
                *strip = Lanes::load(&row[start..end]);
            }
            for (sum, row) in sums.iter_mut().zip(out.chunks_exact(columns)) {
                *sum = Lanes::load(&row[start..end]);
            }
            for (a, sums) in a.chunks(most * inner).zip(sums.chunks_mut(most)) {
                match sums.len() {
                    1 => rows::<FMA, 1>(a, &strip, sums),
                    2 => rows::<FMA, 2>(a, &strip, sums),
                    3 => rows::<FMA, 3>(a, &strip, sums),
                    4 => rows::<FMA, 4>(a, &strip, sums),
                    5 => rows::<FMA, 5>(a, &strip, sums),
                    _ => rows::<FMA, ROWS>(a, &strip, sums),
                }
            }
            for (sum, row) in sums.iter().zip(out.chunks_exact_mut(columns)) {
                sum.store(&mut row[start..end]);
            }
        }
    }
}

/// Adds `R` rows of the product: of `a`'s, each as long as the strip of `b`'s columns.
#[inline(always)]
fn rows<const FMA: bool, const R: usize>(a: &[f64], strip: &[Lanes], sums: &mut [Lanes]) {
    let a: [&[f64]; R] = std::array::from_fn(|row| &a[row * strip.len()..][..strip.len()]);
    let mut own: [Lanes; R] = std::array::from_fn(|row| sums[row]);
    for (l, right) in strip.iter().enumerate() {
        for (a, sum) in a.iter().zip(&mut own) {
            *sum = right.mul_add::<FMA>(Lanes::splat(a[l]), *sum);
        }
    }
    sums.copy_from_slice(&own);
}
