//! The solvers' view of a material: an isotropic, single-valued B(H).

use std::fmt::Debug;

use super::bh_curve::BhCurve;
use fluxform_base::units::MU_0_T_M_PER_A;

/// A material's answer at one field strength, over mu_0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// B / (mu_0 H); at H = 0 its limit.
    pub relative: f64,
    /// dB/dH / mu_0.
    pub differential: f64,
}

/// Over shorter parts of the field the mean slope of B is that in the middle.
const SHORT: f64 = 1e-3;

/// An isotropic material without memory. B must grow with H and be at least mu_0 H.
pub trait Permeability: Debug + Sync {
    /// The material's relative and differential permeability at `h_a_per_m` >= 0.
    fn response(&self, h_a_per_m: f64) -> Response;

    /// The mean of dB/dH over mu_0 from `reach_a_per_m` below `h_a_per_m` to as far above it.
    fn mean_differential(&self, h_a_per_m: f64, reach_a_per_m: f64) -> f64 {
        if reach_a_per_m <= SHORT * h_a_per_m {
            return self.response(h_a_per_m).differential;
        }
        // B is odd in H.
        let b = |h: f64| h * self.response(h.abs()).relative;
        let (below, above) = (h_a_per_m - reach_a_per_m, h_a_per_m + reach_a_per_m);
        (b(above) - b(below)) / (above - below)
    }
}

/// A material whose permeability does not depend on the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constant {
    /// Relative permeability, >= 1.
    pub relative: f64,
}

impl Permeability for Constant {
    fn response(&self, _h_a_per_m: f64) -> Response {
        Response {
            relative: self.relative,
            differential: self.relative,
        }
    }
}

/// Below this field a curve counts as a straight line: far below any table's first point, and it
/// keeps the permeability of a curve that begins with no slope finite.
const WEAKEST_H_A_PER_M: f64 = 1e-6;

impl Permeability for BhCurve {
    fn response(&self, h_a_per_m: f64) -> Response {
        let h = h_a_per_m.max(WEAKEST_H_A_PER_M);
        let b_t = self.b_t(h);
        let relative = b_t / (MU_0_T_M_PER_A * h);
        let differential = if h_a_per_m > WEAKEST_H_A_PER_M {
            1.0 / (MU_0_T_M_PER_A * self.dh_db(b_t))
        } else {
            relative
        };
        Response {
            relative,
            differential,
        }
    }
}

/// Steel-like, in closed form: mu = 1 + m / (h0 + h), saturating at M = m.
#[cfg(test)]
#[derive(Debug, Clone, Copy)]
pub(super) struct Froehlich {
    /// Saturation magnetisation, A/m.
    pub(super) m: f64,
    /// Field at half of it, A/m.
    pub(super) h0: f64,
}

#[cfg(test)]
impl Permeability for Froehlich {
    fn response(&self, h: f64) -> Response {
        Response {
            relative: 1.0 + self.m / (self.h0 + h),
            differential: 1.0 + self.m * self.h0 / (self.h0 + h).powi(2),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_slope_is_that_of_the_chord() {
        let law = Froehlich {
            m: 1.3e6,
            h0: 700.0,
        };
        let b = |h: f64| h * law.response(h).relative;
        let chord = (b(900.0) - b(300.0)) / 600.0;
        assert!((law.mean_differential(600.0, 300.0) / chord - 1.0).abs() < 1e-13);
        // B is odd: from -200 to 600.
        let through_zero = (b(600.0) + b(200.0)) / 800.0;
        assert!((law.mean_differential(200.0, 400.0) / through_zero - 1.0).abs() < 1e-13);
        let tangent = law.response(600.0).differential;
        assert!((law.mean_differential(600.0, 1.0) / tangent - 1.0).abs() < 1e-5);
        assert_eq!(law.mean_differential(600.0, 0.0), tangent);
    }

    #[test]
    fn a_curves_response_is_its_own() {
        let b_t = [0.0, 0.4, 0.7, 1.3, 1.6, 1.9];
        let curve =
            BhCurve::new(&b_t, &[0.0, 70.0, 130.0, 700.0, 5100.0, 31e3]).expect("a good curve");
        for h in [3.0, 99.0, 420.0, 4e3, 28e3, 9e5] {
            let response = curve.response(h);
            let b = MU_0_T_M_PER_A * response.relative * h;
            assert!((curve.h_a_per_m(b) / h - 1.0).abs() < 1e-13);
            let step = 1e-5 * h;
            let slope = (curve.b_t(h + step) - curve.b_t(h - step)) / (2.0 * step);
            let differential = MU_0_T_M_PER_A * response.differential;
            assert!((slope / differential - 1.0).abs() < 1e-4, "{h}");
        }
        let (zero, weak) = (curve.response(0.0), curve.response(1e-3));
        assert!((zero.relative / weak.relative - 1.0).abs() < 1e-4);
        assert_eq!(zero.relative, zero.differential);
        // A table that turns upwards at once begins with no slope: mu has no limit there.
        let steep = BhCurve::new(&[0.0, 0.7, 1.3], &[0.0, 130.0, 1700.0]).expect("a good curve");
        assert_eq!(steep.dh_db(0.0), 0.0);
        assert!(steep.response(0.0).relative > 1e5 && steep.response(0.0).relative.is_finite());
    }
}
