//! Self inductance with its derivatives by the winding's dimensions, fast.
//!
//! The loops' mutual inductance is integrated along both axes in closed form under the integral
//! over the azimuth. With a, b = s +- t/2 the radii, tau = tan(theta/2) and
//! h^2 = (t^2 + 4 s^2 tau^2) / (1 + tau^2),
//!
//! ```text
//! int_0^l 2 (l - u) M du = 2 mu_0 (a b)^2 l^2 int 8 tau^2 / (1 + tau^2)^3 dtau / (h^2 (sqrt(h^2 + l^2) + h)).
//! ```
//!
//! Every term is positive. Over y = ln tau the integrand is analytic in the strip |Im y| < pi/2
//! and decays exponentially on both sides, so the trapezoidal rule on one grid of y, made once,
//! converges like exp(-pi^2 / step). What is left is smooth but for t^2 ln t at t = 0.

use std::sync::OnceLock;

use fluxform_numerics::gauss;

/// How exact the integrals must be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Accuracy {
    /// Relative error of every integral; held by the tests against `coil::inductance`.
    pub relative_error: f64,
    tolerance: f64,
    /// Step of the azimuth's grid in ln tau.
    step: f64,
    /// ln of what the azimuth's tails may leave out.
    tail: f64,
    /// Nodes of the first panel, on which t = t0 eta^3.
    order: usize,
    grid: &'static OnceLock<Vec<Azimuth>>,
}

/// To nine digits or more.
pub static FINE: Accuracy = Accuracy {
    relative_error: 1e-9,
    tolerance: 1e-11,
    step: 0.35,
    tail: -25.4,
    order: 14,
    grid: &FINE_GRID,
};
/// To seven digits, in a fifth of the time.
pub static ROUGH: Accuracy = Accuracy {
    relative_error: 1e-7,
    tolerance: 1e-8,
    step: 0.5,
    tail: -17.0,
    order: 8,
    grid: &ROUGH_GRID,
};
static FINE_GRID: OnceLock<Vec<Azimuth>> = OnceLock::new();
static ROUGH_GRID: OnceLock<Vec<Azimuth>> = OnceLock::new();
/// ln of the shortest winding, over its radius, for which the error is kept.
const SHORTEST_LN: f64 = -20.0;
/// Share of the depth that is not worth a panel of its own.
const ROUNDING: f64 = 1e-12;
/// Radii closer to the axis than this share of the largest carry nothing.
const AXIS: f64 = 0.1;

/// Self inductance over mu_0 J^2 at turns per area J held, and its derivatives. All four grow
/// with inner radius, depth and length, because two loops' mutual inductance grows with their
/// mean radius when their offsets are held.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SectionIntegrals {
    /// L / (mu_0 J^2), m^5.
    pub value: f64,
    /// Derivative by the depth, inner radius held, m^4.
    pub by_depth: f64,
    /// Loss as the inner face moves outwards, m^4: the derivative by the inner radius,
    /// depth held, is `by_depth - inner`.
    pub inner: f64,
    /// Derivative by the length, m^4.
    pub by_length: f64,
}

/// One node of the azimuth's grid.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Azimuth {
    /// 8 tau^3 / (1 + tau^2)^2 times the step.
    weight: f64,
    /// 4 tau^2.
    four_tau2: f64,
    /// 1 / (1 + tau^2).
    share: f64,
}

/// The grid of ln tau.
fn grid(accuracy: &'static Accuracy) -> &'static [Azimuth] {
    accuracy.grid.get_or_init(|| {
        let lowest = ((accuracy.tail + SHORTEST_LN) / accuracy.step) as i32;
        let highest = (-accuracy.tail / 3.0 / accuracy.step).ceil() as i32;
        (lowest..=highest)
            .map(|k| {
                let tau = (f64::from(k) * accuracy.step).exp();
                let share = 1.0 / (1.0 + tau * tau);
                Azimuth {
                    weight: accuracy.step * 8.0 * (tau * share) * (tau * share) * tau,
                    four_tau2: 4.0 * tau * tau,
                    share,
                }
            })
            .collect()
    })
}

/// The integrals of a section; radii and lengths in any one unit.
///
/// Domain: `inner` >= 0, `depth` > 0, `length` > 0.
#[must_use]
pub fn section_integrals(
    inner: f64,
    depth: f64,
    length: f64,
    accuracy: &'static Accuracy,
) -> SectionIntegrals {
    fluxform_base::progress::poll();
    let tolerance = accuracy.tolerance;
    let outer = inner + depth;
    let mut total = SectionIntegrals::default();
    let mut add = |t: f64, weight: f64| {
        let (lo, hi) = (inner + 0.5 * t, outer - 0.5 * t);
        let (mut sum, mut slope) = (0.0, 0.0);
        gauss::graded(lo, hi, (0.5 * t).max(AXIS * hi), tolerance, |s, weight| {
            let (value, by_length) = aligned(s, t, length, accuracy);
            sum += weight * value;
            slope += weight * by_length;
        });
        // Over the depth as rounded against the radius, for thin sheets.
        let stretch = (depth - t) / (hi - lo);
        total.value += weight * stretch * sum;
        total.by_length += weight * stretch * slope;
        total.by_depth += weight * aligned(hi, t, length, accuracy).0;
        total.inner += weight * aligned(lo, t, length, accuracy).0;
    };
    // Beyond the length, and beyond the loops' own size, the integrand has another shape.
    let first = depth.min(length).min(0.5 * (inner + outer));
    let rule = gauss::rule(accuracy.order);
    for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
        let eta = 0.5 * (1.0 + x);
        add(first * eta * eta * eta, 1.5 * weight * first * eta * eta);
    }
    // A residue of rounding is nothing, and has no loops between its two faces.
    if depth - first > ROUNDING * depth {
        gauss::graded(first, depth, first, tolerance, add);
    }
    total
}

/// Twice the mutual inductance of two aligned sheets of radii s +- t/2, times their length
/// squared, over mu_0, and its derivative by the length.
fn aligned(s: f64, t: f64, length: f64, accuracy: &'static Accuracy) -> (f64, f64) {
    let product = s * s - 0.25 * t * t;
    let grid = grid(accuracy);
    let (t2, s2, l2) = (t * t, s * s, length * length);
    // Below: tau^3 where tau < t / 2 s, tau above; at the other end tau^-3.
    // Short sheets: nearly constant from tau = length / 2 s on.
    let near = (0.5 * t / s).ln();
    let short = (0.5 * length / s).ln().min(0.0);
    let lower = ((accuracy.tail + 2.0 * near + short) / 3.0).max(accuracy.tail + short);
    let upper = -accuracy.tail / 3.0;
    let last = (grid.len() - 1) as f64;
    let middle = last - ((upper / accuracy.step).ceil());
    let from = (middle + lower / accuracy.step).max(0.0) as usize;
    let (mut sum, mut slope) = ([0.0; 4], [0.0; 4]);
    let nodes = &grid[from.min(grid.len() - 1)..];
    let (fours, rest) = nodes.as_chunks::<4>();
    let term = |node: &Azimuth| {
        let g = t2 + s2 * node.four_tau2;
        let h2 = g * node.share;
        let (h, r) = (h2.sqrt(), (h2 + l2).sqrt());
        let common = node.weight / (g * r * (r + h));
        (common * r, common * (r + h))
    };
    for four in fours {
        for k in 0..4 {
            let (value, by_length) = term(&four[k]);
            sum[k] += value;
            slope[k] += by_length;
        }
    }
    for node in rest {
        let (value, by_length) = term(node);
        sum[0] += value;
        slope[0] += by_length;
    }
    let scale = 4.0 * product * product;
    let add = |v: [f64; 4]| (v[0] + v[1]) + (v[2] + v[3]);
    (scale * l2 * add(sum), scale * length * add(slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inductance::self_inductance_h;
    use fluxform_base::units::MU_0_T_M_PER_A;
    use fluxform_field::ring::Potentials;
    use fluxform_field::winding::Winding;

    const SHAPES: [[f64; 3]; 10] = [
        [0.012, 0.007, 0.1],
        [0.7, 0.9, 0.05],
        [0.0, 1.3, 0.7],
        [1.3, 0.01, 7.0],
        [0.1, 3.0, 0.02],
        [0.0, 1.0, 30.0],
        [0.0, 1.0, 0.003],
        [1.0, 1e-4, 1e-4],
        [1.0, 1e-4, 0.7],
        [0.001, 1.3, 1.1],
    ];

    #[test]
    fn a_square_section_may_be_rounded_either_way() {
        let (wire, ulp) = (0.7e-3, 1.1e-19);
        for step in 0..200 {
            let inner = 0.013 + 1.3e-6 * f64::from(step);
            for ulps in -5..=5 {
                let depth = wire + f64::from(ulps) * ulp;
                let square = section_integrals(inner, wire, wire, &FINE).value;
                let value = section_integrals(inner, depth, wire, &FINE).value;
                assert!((value / square - 1.0).abs() < 1e-12, "{inner} {ulps}");
            }
        }
    }

    /// Radii and lengths may be in any unit: a power of two changes no digit.
    #[test]
    fn a_change_of_unit_is_a_power() {
        for [a, w, l] in SHAPES {
            let base = section_integrals(a, w, l, &ROUGH);
            for unit in [2.0_f64.powi(-40), 2.0_f64.powi(40)] {
                let other = section_integrals(a * unit, w * unit, l * unit, &ROUGH);
                for (x, y, power) in [
                    (base.value, other.value, 5),
                    (base.by_depth, other.by_depth, 4),
                    (base.inner, other.inner, 4),
                    (base.by_length, other.by_length, 4),
                ] {
                    let requested = x * unit.powi(power);
                    assert!(
                        (y - requested).abs() <= 1e-13 * requested,
                        "{a} {w} {l}: {y} {requested}"
                    );
                }
            }
        }
    }

    #[test]
    fn agrees_with_the_exact_integral() {
        for [a, w, l] in SHAPES {
            let exact = self_inductance_h(&Winding {
                inner_radius_m: a,
                outer_radius_m: a + w,
                length_m: l,
                turns: w * l,
            });
            let value = MU_0_T_M_PER_A * section_integrals(a, w, l, &FINE).value;
            let error = value / exact - 1.0;
            // The outer radius is rounded against the inner one.
            let rounding = 4.0 * f64::EPSILON * a / w;
            assert!(
                error.abs() < FINE.relative_error + rounding,
                "{a} {w} {l}: {error:e}"
            );
        }
    }

    #[test]
    fn rough_integrals_keep_their_bound() {
        for [a, w, l] in SHAPES {
            let fine = section_integrals(a, w, l, &FINE);
            let rough = section_integrals(a, w, l, &ROUGH);
            for (x, y, size) in [
                (fine.value, rough.value, fine.value),
                (fine.by_depth, rough.by_depth, fine.by_depth),
                (fine.inner, rough.inner, fine.by_depth),
                (fine.by_length, rough.by_length, fine.by_length),
            ] {
                assert!(
                    (x - y).abs() < ROUGH.relative_error * size,
                    "{a} {w} {l}: {:e}",
                    (x - y) / size
                );
            }
        }
    }

    #[test]
    fn sheets_side_by_side_are_loops_far_apart() {
        // Two short sheets of radii 1.3 and 0.2: length squared times the loops' inductance.
        let (value, _) = aligned(0.75, 1.1, 1e-4, &FINE);
        let mut loops = Potentials::default();
        loops.add_mutual([1.3, 0.2], [1.1, 0.0], 2.0 * 1e-8);
        assert!((value / loops.sum() - 1.0).abs() < 1e-7);
    }

    #[test]
    fn slopes_are_those_of_the_value() {
        for [a, w, l] in SHAPES {
            let base = section_integrals(a, w, l, &FINE);
            let slope = [base.by_depth - base.inner, base.by_depth, base.by_length];
            // Homogeneous of degree five.
            let sum = a * slope[0] + w * slope[1] + l * slope[2];
            let size = a * base.by_depth + w * slope[1] + l * slope[2];
            assert!(
                (sum - 5.0 * base.value).abs() < FINE.relative_error * size,
                "{a} {w} {l}: {:e}",
                (sum - 5.0 * base.value) / size
            );
            let remainder = |i: usize, h: f64| {
                let mut x = [a, w, l];
                let step = h * w.min(l);
                x[i] += step;
                let moved = section_integrals(x[0], x[1], x[2], &FINE).value;
                ((moved - base.value - step * slope[i]) / base.value).abs()
            };
            for i in 0..3 {
                let (coarse, fine) = (remainder(i, 2e-2), remainder(i, 2e-3));
                assert!(
                    fine < 0.02 * coarse || coarse < 1e-6,
                    "{a} {w} {l} {i}: {coarse:e} {fine:e}"
                );
            }
        }
    }
}
