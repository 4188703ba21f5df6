//! Closed intervals with outward rounding: what is computed contains what is exact.
//!
//! Each operation's result in double precision is within half a unit of the last digit of the
//! exact one (IEEE 754), so one step outwards on either side encloses it.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// All numbers from `lo` to `hi`, both included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// Lower end.
    pub lo: f64,
    /// Upper end.
    pub hi: f64,
}

impl Interval {
    /// From `lo` to `hi`; the caller sees to lo <= hi.
    #[must_use]
    #[inline]
    pub const fn new(lo: f64, hi: f64) -> Self {
        Self { lo, hi }
    }

    /// One number.
    #[must_use]
    #[inline]
    pub const fn point(value: f64) -> Self {
        Self::new(value, value)
    }

    /// One step outwards.
    #[inline]
    fn outward(lo: f64, hi: f64) -> Self {
        Self::new(lo.next_down(), hi.next_up())
    }

    /// Every square.
    #[must_use]
    #[inline]
    pub fn square(self) -> Self {
        let (a, b) = (self.lo * self.lo, self.hi * self.hi);
        let least = if self.lo <= 0.0 && self.hi >= 0.0 {
            0.0
        } else {
            a.min(b).next_down().max(0.0)
        };
        Self::new(least, a.max(b).next_up())
    }

    /// Every square root of what is not negative.
    #[must_use]
    #[inline]
    pub fn sqrt(self) -> Self {
        let lo = self.lo.max(0.0).sqrt().next_down().max(0.0);
        Self::new(lo, self.hi.max(0.0).sqrt().next_up())
    }

    /// Intersection; `self` where they are disjoint, which two enclosures of one number
    /// never are.
    #[must_use]
    #[inline]
    pub fn and(self, other: Self) -> Self {
        let (lo, hi) = (self.lo.max(other.lo), self.hi.min(other.hi));
        if lo <= hi { Self::new(lo, hi) } else { self }
    }

    /// Widened by `relative` times the larger end's size on either side.
    #[must_use]
    #[inline]
    pub fn widened(self, relative: f64) -> Self {
        let by = relative * self.lo.abs().max(self.hi.abs());
        Self::outward(self.lo - by, self.hi + by)
    }
}

impl Add for Interval {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::outward(self.lo + other.lo, self.hi + other.hi)
    }
}

impl Sub for Interval {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::outward(self.lo - other.hi, self.hi - other.lo)
    }
}

impl Neg for Interval {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.hi, -self.lo)
    }
}

impl Mul for Interval {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let ends = [
            self.lo * other.lo,
            self.lo * other.hi,
            self.hi * other.lo,
            self.hi * other.hi,
        ];
        // 0 times infinity: an unbounded factor times zero is zero here.
        let end = |v: f64| if v.is_nan() { 0.0 } else { v };
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in ends.map(end) {
            lo = lo.min(value);
            hi = hi.max(value);
        }
        Self::outward(lo, hi)
    }
}

impl Mul<f64> for Interval {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        self * Self::point(factor)
    }
}

impl Div for Interval {
    type Output = Self;
    /// Everything where the divisor may be zero.
    #[inline]
    fn div(self, other: Self) -> Self {
        if other.lo <= 0.0 && other.hi >= 0.0 {
            return Self::new(f64::NEG_INFINITY, f64::INFINITY);
        }
        self * Self::outward(1.0 / other.hi, 1.0 / other.lo)
    }
}
