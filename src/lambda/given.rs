//! How much of the requested force static currents give.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use fluxform_base::least_request::LEAST_REQUEST;

use super::feedback::{Reachable, reachable};
use super::problem::{ForceProblem, ProblemError};

/// The upward force over the requested one: `lambda h`, times the upward part of the direction where the request leans.
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

/// Sums of forces and their ratios over the points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ratios {
    /// Ratios to requests that are no larger do not count, N.
    least_request_n: f64,
    given: f64,
    requested: f64,
    least: f64,
    most: f64,
}

impl Default for Ratios {
    fn default() -> Self {
        Self {
            least_request_n: 0.0,
            given: 0.0,
            requested: 0.0,
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        }
    }
}

impl Ratios {
    /// Of points at which at most `highest_n` is requested.
    pub(super) fn new(highest_n: f64) -> Self {
        Self {
            least_request_n: LEAST_REQUEST * highest_n,
            ..Self::default()
        }
    }

    pub(super) fn add(&mut self, weight: f64, force_n: f64, request_n: f64) {
        self.given += weight * force_n;
        self.requested += weight * request_n;
        if request_n > self.least_request_n {
            self.least = self.least.min(force_n / request_n);
            self.most = self.most.max(force_n / request_n);
        }
    }

    /// Points that come after these.
    pub(super) fn join(&mut self, next: &Self) {
        self.given += next.given;
        self.requested += next.requested;
        self.least = self.least.min(next.least);
        self.most = self.most.max(next.most);
    }

    pub(super) fn of_force(&self, above_saturation: bool) -> Option<GivenForce> {
        (self.requested > 0.0 && self.least.is_finite()).then(|| GivenForce {
            mean: self.given / self.requested,
            least: self.least,
            most: self.most,
            above_saturation,
        })
    }
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
        let mut ratios = Self::ratios(problem, lambda_n_per_m);
        let rows = problem.forces_n_per_a.chunks_exact(problem.coils());
        for (point, (row, height_m)) in rows.zip(problem.height_m).enumerate() {
            let offset_n = problem.offset_n.map_or(0.0, |offset| offset[point]);
            let coils_n: f64 = row.iter().zip(currents_a).map(|(f, i)| f * i).sum();
            let request_n = lambda_n_per_m * height_m;
            ratios.add(problem.weight(point), coils_n + offset_n, request_n);
        }
        let above = |saturation: f64| lambda_n_per_m > saturation * (1.0 + 1e-12);
        ratios.of_force(lambda_saturation_n_per_m.is_some_and(above))
    }

    /// With currents of their own at every point: the requested force, or the nearest within reach. `None` where no
    /// force is requested.
    ///
    /// # Errors
    /// Where the problem is malformed.
    pub fn with_feedback(
        problem: &ForceProblem,
        lambda_n_per_m: f64,
    ) -> Result<Option<Self>, ProblemError> {
        let Reachable { least_n, most_n } = reachable(problem)?;
        let mut ratios = Self::ratios(problem, lambda_n_per_m);
        for (point, height_m) in problem.height_m.iter().enumerate() {
            let request_n = lambda_n_per_m * height_m;
            let force_n = request_n.max(least_n[point]).min(most_n[point]);
            ratios.add(problem.weight(point), force_n, request_n);
        }
        Ok(ratios.of_force(false))
    }

    fn ratios(problem: &ForceProblem, lambda_n_per_m: f64) -> Ratios {
        let highest_m = problem.height_m.iter().copied().fold(0.0, f64::max);
        Ratios::new(lambda_n_per_m * highest_m)
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
            weights: Some(&[1.0, 3.0, 1e-18]),
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
        // Both coils of their own at every point: within reach everywhere.
        let followed = GivenForce::with_feedback(&problem, 1.3).unwrap().unwrap();
        for ratio in [followed.mean, followed.least, followed.most] {
            assert!((ratio - 1.0).abs() < 1e-12, "{followed:?}");
        }
        // The most that they give is less than 40 N/m asks for at the first point.
        let beyond = GivenForce::with_feedback(&problem, 40.0).unwrap().unwrap();
        assert!(
            (beyond.least - (0.6 + 0.01) / 2.0).abs() < 1e-12,
            "{beyond:?}"
        );
    }
}
