//! Runs a kernel compiled for the vector instructions this machine has.
//!
//! The only place in the crate with `unsafe`: a function compiled for AVX2 may
//! be called only where AVX2 was found, which is checked right before the call.

/// A computation whose `run` is `#[inline(always)]`, so that it is compiled for its caller's
/// instruction set.
pub trait Kernel {
    /// Result.
    type Output;
    /// The computation. `FMA`: whether fused multiply-add is an instruction here; without
    /// it `f64::mul_add` is a slow library call.
    fn run<const FMA: bool>(self) -> Self::Output;
}

/// Runs `kernel` with AVX2 and FMA where the processor has them.
#[inline]
pub fn run<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    if has_avx2() {
        // SAFETY: both features were found on this processor.
        #[allow(unsafe_code)]
        return unsafe { run_avx2(kernel) };
    }
    kernel.run::<false>()
}

#[cfg(target_arch = "x86_64")]
#[inline]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// Which instructions kernels and products of matrices run on here: with others the last bits of their
/// results differ.
#[must_use]
#[inline]
pub fn instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    if has_avx2() {
        // Products of matrices choose their own.
        if is_x86_feature_detected!("avx512f") {
            return "avx2 fma avx512f";
        }
        return "avx2 fma";
    }
    "baseline"
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
#[inline]
fn run_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run::<true>()
}

/// `a * b + c`, fused where that is an instruction.
#[inline(always)]
#[must_use]
pub fn mul_add<const FMA: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// Number of lanes in [`Lanes`]: two AVX2 registers, whose latencies overlap.
pub const LANES: usize = 8;

/// A few numbers treated alike; the compiler turns the lane loops into vector instructions.
#[derive(Debug, Clone, Copy)]
pub struct Lanes(pub [f64; LANES]);

macro_rules! lane_operator {
    ($trait:ident, $method:ident, $op:tt) => {
        impl std::ops::$trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op other.0[i]))
            }
        }
        impl std::ops::$trait<f64> for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                Self(std::array::from_fn(|i| self.0[i] $op other))
            }
        }
    };
}

lane_operator!(Add, add, +);
lane_operator!(Sub, sub, -);
lane_operator!(Mul, mul, *);
lane_operator!(Div, div, /);

impl Lanes {
    /// The same value in every lane.
    #[inline(always)]
    #[must_use]
    pub fn splat(value: f64) -> Self {
        Self([value; LANES])
    }

    /// Loads `LANES` values; missing ones repeat the last.
    ///
    /// # Panics
    /// When `values` is empty.
    #[inline(always)]
    #[must_use]
    pub fn load(values: &[f64]) -> Self {
        match values.first_chunk::<LANES>() {
            Some(full) => Self(*full),
            None => Self(std::array::from_fn(|i| values[i.min(values.len() - 1)])),
        }
    }

    /// Stores as many lanes as `out` holds.
    #[inline(always)]
    pub fn store(self, out: &mut [f64]) {
        let count = out.len().min(LANES);
        out[..count].copy_from_slice(&self.0[..count]);
    }

    /// Square root of every lane.
    #[inline(always)]
    #[must_use]
    pub fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    /// `self * b + c`, fused where that is an instruction.
    #[inline(always)]
    #[must_use]
    pub fn mul_add<const FMA: bool>(self, b: Self, c: Self) -> Self {
        Self(std::array::from_fn(|i| {
            mul_add::<FMA>(self.0[i], b.0[i], c.0[i])
        }))
    }
}
