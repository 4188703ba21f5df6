//! Mutual inductance of two equal air coils with parallel axes and level faces.
//!
//! The flux of the first through the second's turns, with the loops' exact vector potential:
//! with D the axes' distance, a' and theta a point of the second winding and
//! rho^2 = D^2 + a'^2 + 2 D a' cos theta its distance from the first axis,
//!
//! ```text
//! M = mu_0 J^2 int da' int dtheta a' (a' + D cos theta) int da int_0^l 2 (l - u) [A/r](a; rho, u) du.
//! ```

use std::f64::consts::PI;

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::ring::{Potentials, RingPoint};
use fluxform_field::winding::Winding;
use fluxform_numerics::bounded_eigen::largest_eigenvalue;
use fluxform_numerics::gauss;
use nalgebra::DMatrix;

/// Relative error of [`mutual_inductance_h`] for gaps of at least a tenth of the outer radius.
pub const RELATIVE_ERROR: f64 = 1e-6;

/// How finely the integral is taken.
#[derive(Debug, Clone, Copy)]
struct Rule {
    tolerance: f64,
    /// Singularities closer than this multiple of the outer radius are treated as being there:
    /// what they leave of the integral is a logarithm of small weight.
    nearest: f64,
    /// Most radial nodes.
    most_nodes: usize,
}

/// From the rule of [`mutual_inductance_h`] on, each finer than the one before.
const RULES: [Rule; 5] = [
    Rule {
        tolerance: 1e-7,
        nearest: 0.05,
        most_nodes: 10,
    },
    Rule {
        tolerance: 1e-9,
        nearest: 0.03,
        most_nodes: 14,
    },
    Rule {
        tolerance: 1e-10,
        nearest: 0.02,
        most_nodes: 18,
    },
    Rule {
        tolerance: 1e-11,
        nearest: 0.012,
        most_nodes: 22,
    },
    Rule {
        tolerance: 1e-15,
        nearest: 0.01,
        most_nodes: 26,
    },
];
/// The difference of two rules, times this, is claimed of the coarser one.
const CHANCE: f64 = 2.0;
/// Rounding of a sum over all nodes, relative.
const ROUNDING: f64 = 1e-14;
/// Rules that agree as nearly as this, relative, have the same nodes.
const SAME_NODES: f64 = 1e-15;

/// Mutual inductance of two equal windings whose axes are `distance_m` apart, H; negative, as
/// the flux returns outside. Domain: the windings do not overlap.
#[must_use]
pub fn mutual_inductance_h(winding: &Winding, distance_m: f64) -> f64 {
    by_rule(winding, distance_m, RULES[0])
}

/// As [`mutual_inductance_h`], with the estimate of its relative error: at most `tolerance`, or as
/// far as the finest rule carries.
#[must_use]
pub(crate) fn estimated_mutual_inductance_h(
    winding: &Winding,
    distance_m: f64,
    tolerance: f64,
) -> (f64, f64) {
    let mut value = by_rule(winding, distance_m, RULES[0]);
    let mut error = f64::INFINITY;
    for rule in &RULES[1..] {
        let finer = by_rule(winding, distance_m, *rule);
        let apart = (value - finer).abs() / finer.abs();
        error = CHANCE * apart + ROUNDING;
        // Far apart rules take the same nodes, and their difference is no error.
        if error <= tolerance && apart > SAME_NODES {
            break;
        }
        // The difference of two rules is the coarser one's error: the finer is at least as good.
        value = finer;
    }
    (value, error)
}

fn by_rule(winding: &Winding, distance_m: f64, rule: Rule) -> f64 {
    let Rule {
        tolerance,
        nearest: nearest_share,
        most_nodes,
    } = rule;
    fluxform_base::progress::poll();
    let (a1, a2) = (winding.inner_radius_m, winding.outer_radius_m);
    let length = winding.length_m;
    let floor = nearest_share * a2;
    let (centre, half) = (0.5 * (a1 + a2), 0.5 * (a2 - a1));
    let mut loops = Potentials::default();
    let add_along_axis = |loops: &mut Potentials, a: f64, rho: f64, share: f64| {
        gauss::graded(0.0, length, (rho - a).max(floor), tolerance, |u, weight| {
            let at = RingPoint {
                radius_m: a,
                r_m: rho,
                offset_m: a - rho,
                u_m: u,
            };
            loops.add(at, share * weight * 2.0 * (length - u));
        });
    };
    // Either radius is singular where the other winding's nearest filament would be met.
    let nearest = (distance_m - a2).max(a2 + floor);
    let radius = gauss::bernstein_radius(a1, a2, nearest, 0.0);
    let order = gauss::order_for(radius, 4.0 * PI, tolerance).unwrap_or(most_nodes);
    let rule = gauss::rule((order + 1).min(most_nodes));
    let mut total = 0.0;
    for (x, weight_b) in rule.nodes.iter().zip(&rule.weights) {
        let b = centre + half * x;
        let gap2 = ((distance_m - b).powi(2) - a2 * a2).max(0.0);
        let near = (gap2 / (distance_m * b)).sqrt().max(nearest_share);
        // phi = pi - theta is zero at the closest approach, and the filaments meet at an imaginary phi: over a period
        // the midpoint rule converges like exp(-n |phi|), exactly for the harmonics that cancel far away.
        let meeting = 2.0 * (0.5 * near).asinh();
        let steps = ((distance_m / (b * tolerance)).ln() / (2.0 * meeting)).ceil() + 2.0;
        for step in 0..steps as usize {
            let phi = PI * (step as f64 + 0.5) / steps;
            let sine = (0.5 * phi).sin();
            let rho = ((distance_m - b).powi(2) + 4.0 * distance_m * b * sine * sine).sqrt();
            let projection = 2.0 * b * (b - distance_m * phi.cos());
            for (x, weight_a) in rule.nodes.iter().zip(&rule.weights) {
                let weight = weight_b * weight_a * half * half * projection * PI / steps;
                add_along_axis(&mut loops, centre + half * x, rho, weight);
            }
            total += loops.sum();
        }
    }
    let density = winding.current_density_per_m2();
    MU_0_T_M_PER_A * density * density * total
}

/// The inductance matrix of equal windings at `axes_m`, H, row by row; equal distances are
/// computed once.
#[must_use]
pub fn inductance_matrix_h(winding: &Winding, self_h: f64, axes_m: &[[f64; 2]]) -> Vec<Vec<f64>> {
    matrix_of(self_h, axes_m, |distance_m| {
        mutual_inductance_h(winding, distance_m)
    })
}

/// As [`inductance_matrix_h`], with the largest estimate of a mutual inductance's relative error:
/// at most `tolerance`, or as far as the finest rule carries.
#[must_use]
pub fn estimated_matrix_h(
    winding: &Winding,
    self_h: f64,
    axes_m: &[[f64; 2]],
    tolerance: f64,
) -> (Vec<Vec<f64>>, f64) {
    let mut worst = 0.0_f64;
    let matrix = matrix_of(self_h, axes_m, |distance_m| {
        let (value, error) = estimated_mutual_inductance_h(winding, distance_m, tolerance);
        worst = worst.max(error);
        value
    });
    (matrix, worst)
}

/// The inductance of the slowest pattern of currents, H: the largest eigenvalue of an inductance
/// matrix. Over R it is the longest time constant of equal coils, which that of none alone is. NaN where the
/// matrix holds such a number, or none.
#[must_use]
pub fn slowest_inductance_h(matrix_h: &[Vec<f64>]) -> f64 {
    let entry = |i: usize, j: usize| 0.5 * (matrix_h[i][j] + matrix_h[j][i]);
    let matrix = DMatrix::from_fn(matrix_h.len(), matrix_h.len(), entry);
    largest_eigenvalue(matrix).unwrap_or(f64::NAN)
}

/// The largest inductance of a coil among the others, H: the largest entry of the diagonal.
#[must_use]
pub fn largest_self_inductance_h(matrix_h: &[Vec<f64>]) -> f64 {
    let own = matrix_h.iter().enumerate().map(|(i, row)| row[i]);
    own.fold(0.0, f64::max)
}

fn matrix_of(
    self_h: f64,
    axes_m: &[[f64; 2]],
    mut mutual_h: impl FnMut(f64) -> f64,
) -> Vec<Vec<f64>> {
    // Distances that differ by rounding only share a key.
    const SAME: f64 = 1e-9;
    let mut known: Vec<(f64, f64)> = Vec::new();
    let mut between = |distance: f64| {
        let same = |d: f64| (d - distance).abs() <= SAME * distance;
        if let Some((_, value)) = known.iter().find(|(d, _)| same(*d)) {
            return *value;
        }
        let value = mutual_h(distance);
        known.push((distance, value));
        value
    };
    let mut matrix = vec![vec![self_h; axes_m.len()]; axes_m.len()];
    for (i, [xi, yi]) in axes_m.iter().enumerate() {
        for (j, [xj, yj]) in axes_m.iter().enumerate().skip(i + 1) {
            let value = between((xi - xj).hypot(yi - yj));
            matrix[i][j] = value;
            matrix[j][i] = value;
        }
    }
    matrix
}

#[cfg(test)]
// Studies print their tables.
#[allow(clippy::print_stdout)]
mod tests {
    use super::*;
    use fluxform_numerics::random::Random;

    #[test]
    fn regression_a_pattern_of_currents_is_slower_than_any_coil() {
        // Equal and opposite currents of two coils, and all three alike of a triangle.
        assert!((slowest_inductance_h(&[vec![3.0, -0.7], vec![-0.7, 3.0]]) - 3.7).abs() < 1e-12);
        let triangle = [[2.0, 0.3, 0.3], [0.3, 2.0, 0.3], [0.3, 0.3, 2.0]].map(Vec::from);
        assert!((slowest_inductance_h(&triangle) - 2.6).abs() < 1e-12);
        assert!((slowest_inductance_h(&[vec![1.7]]) - 1.7).abs() < 1e-15);
        assert!(slowest_inductance_h(&[vec![1.7, f64::NAN], vec![0.3, 1.3]]).is_nan());
        assert!(slowest_inductance_h(&[]).is_nan());
    }

    /// Stated was rounding alone, where two rules have the same nodes.
    #[test]
    fn regression_the_error_of_distant_coils_was_stated_as_rounding() {
        let winding = Winding {
            inner_radius_m: 0.015,
            outer_radius_m: 0.016,
            length_m: 0.001,
            turns: 10.0,
        };
        let finest = Rule {
            tolerance: 1e-18,
            ..RULES[4]
        };
        for distance_m in [0.033, 0.1, 0.3, 1.0, 3.0, 10.0] {
            let (value, error) = estimated_mutual_inductance_h(&winding, distance_m, 1e-4);
            let off = (value / by_rule(&winding, distance_m, finest) - 1.0).abs();
            assert!(off <= error, "{distance_m}: {off:e} of {error:e}");
        }
    }

    #[test]
    fn far_apart_the_coils_are_dipoles() {
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.1,
            turns: 1429.0,
        };
        // Mean turn area of a uniform current density; two vertical dipoles side by side.
        let area = PI * (0.012_f64.powi(2) + 0.012 * 0.019 + 0.019_f64.powi(2)) / 3.0;
        let dipole = |d: f64| -MU_0_T_M_PER_A * (1429.0 * area).powi(2) / (4.0 * PI * d.powi(3));
        for distance in [3.1, 6.2] {
            let ratio = mutual_inductance_h(&winding, distance) / dipole(distance);
            // The next multipoles enter with (size / distance)^2.
            assert!(
                (ratio - 1.0).abs() < 2.0 * (0.1_f64 / distance).powi(2),
                "{ratio}"
            );
        }
    }

    #[test]
    fn a_direct_sum_agrees() {
        // Flux of the first coil's B_z through the second's turns, by midpoints.
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.1,
            turns: 1429.0,
        };
        let distance = 0.05;
        // The first coil's B_z, summed over discs bounded by the second's turns.
        let (turns, radial, axial) = (gauss::rule(3), gauss::rule(6), gauss::rule(16));
        let steps = 24;
        let mut flux = 0.0;
        for (xb, wb) in turns.nodes.iter().zip(&turns.weights) {
            let b = 0.0155 + 0.0035 * xb;
            for (xr, wr) in radial.nodes.iter().zip(&radial.weights) {
                let rho = 0.5 * b * (1.0 + xr);
                for step in 0..steps {
                    let angle = 2.0 * PI * (f64::from(step) + 0.5) / f64::from(steps);
                    let r = (distance * distance + rho * rho + 2.0 * distance * rho * angle.cos())
                        .sqrt();
                    for (xz, wz) in axial.nodes.iter().zip(&axial.weights) {
                        let b_z = winding.field(r, -0.05 + 0.05 * xz).expect("outside").b_z;
                        let area = 0.5 * b * wr * rho * 2.0 * PI / f64::from(steps);
                        flux += b_z * area * 0.5 * wz * 0.5 * wb;
                    }
                }
            }
        }
        let direct = 1429.0 * flux;
        let value = mutual_inductance_h(&winding, distance);
        assert!((value / direct - 1.0).abs() < 1e-5, "{value:e} {direct:e}");
    }

    #[test]
    fn estimates_cover_finer_rules_and_are_of_their_size() {
        for (outer_radius_m, length_m) in [(0.019, 0.1), (0.031, 0.013)] {
            let winding = Winding {
                inner_radius_m: 0.012,
                outer_radius_m,
                length_m,
                turns: 700.0,
            };
            for gap in [0.02, 0.1, 0.4, 3.0] {
                let distance = (2.0 + gap) * outer_radius_m;
                let finest = by_rule(&winding, distance, RULES[3]);
                let (value, error) = estimated_mutual_inductance_h(&winding, distance, 1e-5);
                let off = (value / finest - 1.0).abs();
                assert!(off <= error && error < 1e-4, "{gap}: {off:e} {error:e}");
            }
        }
    }

    /// Claimed and true relative errors of random pairs, from touching to far apart.
    fn claims(count: usize, seed: u64) -> Vec<(f64, f64)> {
        let mut random = Random::new(seed);
        let mut between = |lo, hi| random.between(lo, hi);
        (0..count)
            .map(|pair| {
                let inner_radius_m = between(0.003, 0.03);
                let winding = Winding {
                    inner_radius_m,
                    outer_radius_m: inner_radius_m * between(1.1, 2.5),
                    length_m: inner_radius_m * between(0.3, 8.0),
                    turns: 700.0,
                };
                let gap = 10.0_f64.powf(between(-3.0, 0.0));
                let distance_m = (2.0 + gap) * winding.outer_radius_m;
                let tolerance = [1e-4, 1e-6][pair % 2];
                let (value, claim) = estimated_mutual_inductance_h(&winding, distance_m, tolerance);
                let finest = by_rule(&winding, distance_m, RULES[3]);
                (claim, (value / finest - 1.0).abs().max(ROUNDING))
            })
            .collect()
    }

    fn covered_and_tight(errors: &[(f64, f64)]) {
        let mut ratios: Vec<f64> = errors.iter().map(|(claim, off)| claim / off).collect();
        ratios.sort_by(f64::total_cmp);
        let (least, median, most) = (
            ratios[0],
            ratios[ratios.len() / 2],
            ratios[ratios.len() - 1],
        );
        println!(
            "{} pairs: claim over true error least {least:.2}, median {median:.2}, most {most:.1}",
            ratios.len()
        );
        assert!(least >= 1.0 && median < 30.0 && most < 300.0);
    }

    /// The small version of the study below.
    #[test]
    fn claims_of_random_pairs_cover_and_are_tight() {
        covered_and_tight(&claims(4, 20_261_122));
    }

    /// `cargo test -p fluxform-coil --lib mutual -- --ignored --nocapture` prints the table; with
    /// `FLUXFORM_SEED=<number>` of other pairs.
    #[test]
    #[ignore = "minutes of CPU: 60 pairs of coils"]
    fn claims_of_random_pairs_cover_and_are_tight_in_full() {
        let seed =
            std::env::var("FLUXFORM_SEED").map_or(20_261_122, |s| s.parse().expect("a seed"));
        covered_and_tight(&claims(60, seed));
    }

    #[test]
    fn touching_coils_are_finite_and_the_matrix_is_symmetric() {
        let winding = Winding {
            inner_radius_m: 0.012,
            outer_radius_m: 0.019,
            length_m: 0.1,
            turns: 1429.0,
        };
        let touching = mutual_inductance_h(&winding, 0.038);
        let apart = mutual_inductance_h(&winding, 0.0385);
        assert!(
            touching < apart && apart < 0.0 && touching > 1.1 * apart,
            "{touching} {apart}"
        );
        let axes = [[-0.05, 0.0], [0.0, 0.0], [0.05, 0.0]];
        let matrix = inductance_matrix_h(&winding, 0.0145, &axes);
        assert_eq!(matrix[0][1], matrix[2][1]);
        assert_eq!(matrix[1][1], 0.0145);
        assert!(matrix[0][2] > matrix[0][1]);
    }
}
