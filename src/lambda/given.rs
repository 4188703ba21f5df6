//! How much of the requested force static currents give.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::problem::ForceProblem;

/// Ratios are looked at where at least this share of the largest force is requested: towards none
/// they say nothing.
const LEAST_REQUEST: f64 = 0.05;

/// The upward force with the static currents over the requested one, `lambda h`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct GivenForce {
    /// Of the means over the points.
    pub mean: f64,
    /// The smallest at any point where at least a twentieth of the largest force is requested.
    pub least: f64,
    /// The largest there.
    pub most: f64,
    /// Whether lambda exceeds `lambda_saturation`, above which the currents grow no more.
    pub above_saturation: bool,
}

impl GivenForce {
    /// Of `currents_a` at `lambda_n_per_m`; `None` where no force is requested.
    #[must_use]
    pub fn of(
        problem: &ForceProblem,
        lambda_n_per_m: f64,
        currents_a: &[f64],
        lambda_saturation_n_per_m: Option<f64>,
    ) -> Option<Self> {
        let highest_m = problem.height_m.iter().copied().fold(0.0, f64::max);
        let (mut given, mut requested) = (0.0, 0.0);
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        let rows = problem.forces_n_per_a.chunks_exact(problem.coils());
        for (point, (row, height_m)) in rows.zip(problem.height_m).enumerate() {
            let weight = problem.weights.map_or(1.0, |all| all[point]);
            let offset_n = problem.offset_n.map_or(0.0, |offset| offset[point]);
            let coils_n: f64 = row.iter().zip(currents_a).map(|(f, i)| f * i).sum();
            let (force_n, request_n) = (coils_n + offset_n, lambda_n_per_m * height_m);
            given += weight * force_n;
            requested += weight * request_n;
            if *height_m > LEAST_REQUEST * highest_m {
                least = least.min(force_n / request_n);
                most = most.max(force_n / request_n);
            }
        }
        (requested > 0.0 && least.is_finite()).then(|| Self {
            mean: given / requested,
            least,
            most,
            above_saturation: lambda_saturation_n_per_m
                .is_some_and(|saturation| lambda_n_per_m > saturation * (1.0 + 1e-12)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_of_the_requested_force() {
        let problem = ForceProblem {
            forces_n_per_a: &[0.1, 0.2, 0.3, 0.1, 0.7, 0.7],
            height_m: &[0.05, 0.02, 0.001],
            offset_n: Some(&[0.01, -0.02, 0.0]),
            weights: Some(&[1.0, 3.0, 0.0]),
            lower_a: &[0.0; 2],
            upper_a: &[2.0; 2],
            total_max_a: None,
            resistance_ohm: &[6.0; 2],
        };
        let currents = [0.5, 1.3];
        let given = GivenForce::of(&problem, 7.0, &currents, Some(6.5)).unwrap();
        let forces = [0.05 + 0.26 + 0.01, 0.15 + 0.13 - 0.02];
        let ratios = [forces[0] / 0.35, forces[1] / 0.14];
        assert!((given.least - ratios[0]).abs() < 1e-14, "{given:?}");
        assert!((given.most - ratios[1]).abs() < 1e-14, "{given:?}");
        let mean = (forces[0] + 3.0 * forces[1]) / (0.35 + 3.0 * 0.14);
        assert!((given.mean - mean).abs() < 1e-14, "{given:?}");
        assert!(given.above_saturation);
        let below = GivenForce::of(&problem, 6.5, &currents, Some(6.5)).unwrap();
        assert!(!below.above_saturation);
        assert_eq!(GivenForce::of(&problem, 0.0, &currents, None), None);
    }
}
