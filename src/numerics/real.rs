//! The scalar of the small dense algebra: `f64`, or double-double where 53 bits are not enough.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::double_double::DoubleDouble;

/// A real number of fixed precision.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Relative error of one operation, rounded up.
    const EPSILON: f64;

    /// The number `value`, exactly.
    fn of(value: f64) -> Self;
    /// The nearest double.
    fn to_f64(self) -> f64;
    /// The same number in double-double.
    fn widened(self) -> DoubleDouble;
    /// Square root of a number that is not negative.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;

    /// Sum of products over the shorter length.
    #[inline]
    fn dot(a: &[Self], b: &[Self]) -> Self {
        a.iter()
            .zip(b)
            .fold(Self::ZERO, |sum, (&x, &y)| sum + x * y)
    }

    /// `y += factor x` over the shorter length.
    #[inline]
    fn add_scaled(y: &mut [Self], factor: Self, x: &[Self]) {
        for (y, &x) in y.iter_mut().zip(x) {
            *y += factor * x;
        }
    }

    /// The larger of two numbers.
    #[inline]
    fn larger(self, other: Self) -> Self {
        if other > self { other } else { self }
    }

    /// The smaller of two numbers.
    #[inline]
    fn smaller(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const EPSILON: f64 = f64::EPSILON;

    #[inline]
    fn of(value: f64) -> Self {
        value
    }

    #[inline]
    fn to_f64(self) -> f64 {
        self
    }

    #[inline]
    fn widened(self) -> DoubleDouble {
        DoubleDouble::exactly(self)
    }

    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }

    /// Eight running sums: the compiler may keep them in vector registers, and their order is fixed.
    fn dot(a: &[Self], b: &[Self]) -> Self {
        let count = a.len().min(b.len());
        let (a8, a_rest) = a[..count].as_chunks::<8>();
        let (b8, b_rest) = b[..count].as_chunks::<8>();
        let mut lanes = [0.0; 8];
        for (x, y) in a8.iter().zip(b8) {
            for k in 0..8 {
                lanes[k] += x[k] * y[k];
            }
        }
        let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
        let pairs = [
            lanes[0] + lanes[4],
            lanes[1] + lanes[5],
            lanes[2] + lanes[6],
            lanes[3] + lanes[7],
        ];
        (pairs[0] + pairs[2]) + (pairs[1] + pairs[3]) + rest
    }
}

impl Real for DoubleDouble {
    const ZERO: Self = DoubleDouble::exactly(0.0);
    const ONE: Self = DoubleDouble::exactly(1.0);
    /// 2^-102: the worst of the operations stays below it.
    const EPSILON: f64 = 1.0 / (1_u128 << 102) as f64;

    #[inline]
    fn of(value: f64) -> Self {
        DoubleDouble::exactly(value)
    }

    #[inline]
    fn to_f64(self) -> f64 {
        self.nearest()
    }

    #[inline]
    fn widened(self) -> DoubleDouble {
        self
    }

    #[inline]
    fn sqrt(self) -> Self {
        self.square_root()
    }

    #[inline]
    fn abs(self) -> Self {
        if self < Self::ZERO { -self } else { self }
    }

    #[inline]
    fn dot(a: &[Self], b: &[Self]) -> Self {
        DoubleDouble::sum_of_products(a, b)
    }

    #[inline]
    fn add_scaled(y: &mut [Self], factor: Self, x: &[Self]) {
        DoubleDouble::add_multiple(y, factor, x);
    }
}
