//! Numbers of about 31 decimal digits: the unevaluated sum of two doubles.
//!
//! Error-free sums after Knuth, error-free products after Dekker (by splitting, so that
//! no fused multiply-add is needed: without the hardware flag that is a function call).
//! Relative errors: sum 3 x 2^-106, product 8 x 2^-106, quotient and root 16 x 2^-106,
//! for magnitudes between 1e-140 and 1e140; outside it low parts may be lost.

use crate::dispatch::{self, Kernel};
use std::cmp::Ordering;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// `hi + lo` with `|lo| <= ulp(hi) / 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoubleDouble {
    hi: f64,
    lo: f64,
}

/// `a + b = s + e` exactly.
#[inline(always)]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let part = s - a;
    (s, (a - (s - part)) + (b - part))
}

/// The same where `|a| >= |b|`.
#[inline(always)]
fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// `a` as a sum of two numbers of 26 bits.
#[inline(always)]
fn split(a: f64) -> (f64, f64) {
    let t = 134_217_729.0 * a;
    let high = t - (t - a);
    (high, a - high)
}

/// `a b = p + e` exactly.
#[inline(always)]
pub(crate) fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let ((ah, al), (bh, bl)) = (split(a), split(b));
    (p, ((ah * bh - p) + ah * bl + al * bh) + al * bl)
}

impl DoubleDouble {
    /// The double `value`.
    #[must_use]
    #[inline]
    pub const fn exactly(value: f64) -> Self {
        Self { hi: value, lo: 0.0 }
    }

    /// The nearest double.
    #[must_use]
    #[inline]
    pub fn nearest(self) -> f64 {
        self.hi
    }

    /// Residue of the nearest double.
    #[must_use]
    #[inline]
    pub fn remainder(self) -> f64 {
        self.lo
    }

    /// Square root; 0 for 0, NaN below.
    #[must_use]
    #[inline]
    pub fn square_root(self) -> Self {
        if self.hi == 0.0 {
            return Self::exactly(0.0);
        }
        // One Newton step doubles the double root's digits.
        let root = Self::exactly(self.hi.sqrt());
        (root + self / root) * Self::exactly(0.5)
    }
}

/// `a b`; a fused product gives the residue that splitting gives, exactly, in one operation.
#[inline(always)]
fn product<const FMA: bool>(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble {
    if !FMA {
        return a * b;
    }
    let p = a.hi * b.hi;
    let e = a.hi.mul_add(b.hi, -p);
    let (hi, lo) = fast_two_sum(p, e + (a.hi * b.lo + a.lo * b.hi));
    DoubleDouble { hi, lo }
}

/// A sum of products in four running sums, whose parts the compiler keeps in vector registers.
struct Dot<'a>(&'a [DoubleDouble], &'a [DoubleDouble]);

impl Kernel for Dot<'_> {
    type Output = DoubleDouble;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> DoubleDouble {
        let (a4, a_rest) = self.0.as_chunks::<4>();
        let (b4, b_rest) = self.1.as_chunks::<4>();
        let (mut high, mut low) = ([0.0; 4], [0.0; 4]);
        for (x, y) in a4.iter().zip(b4) {
            let (x_high, x_low) = (x.map(|v| v.hi), x.map(|v| v.lo));
            let (y_high, y_low) = (y.map(|v| v.hi), y.map(|v| v.lo));
            let (mut next_high, mut next_low) = ([0.0; 4], [0.0; 4]);
            for k in 0..4 {
                let at = |hi: &[f64; 4], lo: &[f64; 4]| DoubleDouble {
                    hi: hi[k],
                    lo: lo[k],
                };
                let sum =
                    at(&high, &low) + product::<FMA>(at(&x_high, &x_low), at(&y_high, &y_low));
                (next_high[k], next_low[k]) = (sum.hi, sum.lo);
            }
            (high, low) = (next_high, next_low);
        }
        let rest = a_rest
            .iter()
            .zip(b_rest)
            .fold(DoubleDouble::exactly(0.0), |sum, (&x, &y)| {
                sum + product::<FMA>(x, y)
            });
        let sum = |k: usize| DoubleDouble {
            hi: high[k],
            lo: low[k],
        };
        (sum(0) + sum(1)) + (sum(2) + sum(3)) + rest
    }
}

/// Numbers of one vector loop.
const BLOCK: usize = 32;

/// `y += factor x`.
struct AddMultiple<'a>(&'a mut [DoubleDouble], DoubleDouble, &'a [DoubleDouble]);

impl Kernel for AddMultiple<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Self(y, factor, x) = self;
        let (y_blocks, y_rest) = y.as_chunks_mut::<BLOCK>();
        let (x_blocks, x_rest) = x.as_chunks::<BLOCK>();
        for (y, x) in y_blocks.iter_mut().zip(x_blocks) {
            for k in 0..BLOCK {
                y[k] += product::<FMA>(factor, x[k]);
            }
        }
        for (y, &x) in y_rest.iter_mut().zip(x_rest) {
            *y += product::<FMA>(factor, x);
        }
    }
}

/// Turns entries k and k + 1 of some columns by rotation k, one after another.
struct Rotate<'a, const COLUMNS: usize>(&'a [[DoubleDouble; 2]], [&'a mut [DoubleDouble]; COLUMNS]);

impl<const COLUMNS: usize> Kernel for Rotate<'_, COLUMNS> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let Self(rotations, columns) = self;
        let Some(last) = rotations.len().checked_sub(1) else {
            return;
        };
        let columns = columns.map(|column| &mut column[..last + 2]);
        let (mut high, mut low) = ([0.0; COLUMNS], [0.0; COLUMNS]);
        for c in 0..COLUMNS {
            (high[c], low[c]) = (columns[c][0].hi, columns[c][0].lo);
        }
        for (k, &[cos, sin]) in rotations.iter().enumerate() {
            let (mut b_high, mut b_low) = ([0.0; COLUMNS], [0.0; COLUMNS]);
            for c in 0..COLUMNS {
                (b_high[c], b_low[c]) = (columns[c][k + 1].hi, columns[c][k + 1].lo);
            }
            let (mut out_high, mut out_low) = ([0.0; COLUMNS], [0.0; COLUMNS]);
            for c in 0..COLUMNS {
                let at = |hi: &[f64; COLUMNS], lo: &[f64; COLUMNS]| DoubleDouble {
                    hi: hi[c],
                    lo: lo[c],
                };
                let (a, b) = (at(&high, &low), at(&b_high, &b_low));
                let first = product::<FMA>(cos, a) + product::<FMA>(sin, b);
                let second = product::<FMA>(cos, b) - product::<FMA>(sin, a);
                (out_high[c], out_low[c]) = (first.hi, first.lo);
                (high[c], low[c]) = (second.hi, second.lo);
            }
            for c in 0..COLUMNS {
                columns[c][k] = DoubleDouble {
                    hi: out_high[c],
                    lo: out_low[c],
                };
            }
        }
        for c in 0..COLUMNS {
            columns[c][last + 1] = DoubleDouble {
                hi: high[c],
                lo: low[c],
            };
        }
    }
}

impl DoubleDouble {
    /// Turns the first two entries of each column by the first rotation `[cos, sin]`, then the second and the third by the
    /// next, and so on; the same bits on every machine and beside any other columns.
    ///
    /// # Panics
    /// Where a column has fewer entries than there are rotations and one more.
    pub fn rotate<const COLUMNS: usize>(rotations: &[[Self; 2]], columns: [&mut [Self]; COLUMNS]) {
        dispatch::run(Rotate(rotations, columns));
    }

    /// Sum of products over the shorter length; the same bits on every machine.
    #[must_use]
    pub fn sum_of_products(a: &[Self], b: &[Self]) -> Self {
        let count = a.len().min(b.len());
        dispatch::run(Dot(&a[..count], &b[..count]))
    }

    /// `y += factor x` over the shorter length; the same bits on every machine.
    pub fn add_multiple(y: &mut [Self], factor: Self, x: &[Self]) {
        let count = y.len().min(x.len());
        dispatch::run(AddMultiple(&mut y[..count], factor, &x[..count]));
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    #[inline(always)]
    fn add(self, rhs: Self) -> Self {
        let (s, e) = two_sum(self.hi, rhs.hi);
        let (t, f) = two_sum(self.lo, rhs.lo);
        let (s, e) = fast_two_sum(s, e + t);
        let (hi, lo) = fast_two_sum(s, e + f);
        Self { hi, lo }
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self {
            hi: -self.hi,
            lo: -self.lo,
        }
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    #[inline]
    fn sub(self, rhs: Self) -> Self {
        self + -rhs
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    #[inline]
    fn mul(self, rhs: Self) -> Self {
        let (p, e) = two_product(self.hi, rhs.hi);
        let (hi, lo) = fast_two_sum(p, e + (self.hi * rhs.lo + self.lo * rhs.hi));
        Self { hi, lo }
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    /// Long division: two quotient digits of 53 bits.
    #[inline]
    fn div(self, rhs: Self) -> Self {
        let first = self.hi / rhs.hi;
        let rest = self - rhs * Self::exactly(first);
        let (hi, lo) = fast_two_sum(first, rest.hi / rhs.hi);
        Self { hi, lo }
    }
}

impl AddAssign for DoubleDouble {
    #[inline]
    fn add_assign(&mut self, rhs: Self) {
        *self = *self + rhs;
    }
}

impl SubAssign for DoubleDouble {
    #[inline]
    fn sub_assign(&mut self, rhs: Self) {
        *self = *self - rhs;
    }
}

impl PartialOrd for DoubleDouble {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        match self.hi.partial_cmp(&other.hi) {
            Some(Ordering::Equal) => self.lo.partial_cmp(&other.lo),
            order => order,
        }
    }
}
