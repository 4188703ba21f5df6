//! Forward differentiation in one variable.

use std::ops::{Add, Div, Mul, Sub};

/// Operations of a number in the generic kernels.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Mul<f64, Output = Self>
    + Add<f64, Output = Self>
{
    /// Square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The value without derivatives.
    fn value(self) -> f64;
    /// A constant.
    fn constant(value: f64) -> Self;
}

impl Number for f64 {
    #[inline]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline]
    fn value(self) -> f64 {
        self
    }
    #[inline]
    fn constant(value: f64) -> Self {
        value
    }
}

/// A value and its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dual {
    /// Value.
    pub re: f64,
    /// Derivative.
    pub du: f64,
}

impl Dual {
    /// The independent variable.
    #[must_use]
    #[inline]
    pub fn variable(value: f64) -> Self {
        Self { re: value, du: 1.0 }
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self {
            re: self.re + other.re,
            du: self.du + other.du,
        }
    }
}

impl Sub for Dual {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self {
            re: self.re - other.re,
            du: self.du - other.du,
        }
    }
}

impl Mul for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self {
            re: self.re * other.re,
            du: self.du * other.re + self.re * other.du,
        }
    }
}

impl Div for Dual {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let re = self.re / other.re;
        Self {
            re,
            du: (self.du - re * other.du) / other.re,
        }
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self {
            re: self.re * factor,
            du: self.du * factor,
        }
    }
}

impl Add<f64> for Dual {
    type Output = Self;
    #[inline]
    fn add(self, term: f64) -> Self {
        Self {
            re: self.re + term,
            du: self.du,
        }
    }
}

impl Number for Dual {
    #[inline]
    fn sqrt(self) -> Self {
        let re = self.re.sqrt();
        Self {
            re,
            du: 0.5 * self.du / re,
        }
    }
    #[inline]
    fn value(self) -> f64 {
        self.re
    }
    #[inline]
    fn constant(value: f64) -> Self {
        Self { re: value, du: 0.0 }
    }
}
