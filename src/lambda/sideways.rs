//! The sideways force that static currents and eq. 8 leave, and what three rows of eq. 8 change.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::allocation::{Allocator, Reach};
use super::feedback::FeedbackError;
use super::problem::{ForceProblem, Settings};
use super::vector_allocation::VectorAllocator;

/// The force along x and y at the chosen lambda, by that of the coils; the pull of unpowered steel
/// counts upward only. Shares are root mean squares over the points, over that of the requested
/// push; angles are between the given force and upward, medians over the points above height 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sideways {
    /// Points looked at, evenly among all.
    pub points: usize,
    /// Share with the static currents.
    pub static_share: f64,
    /// Angle with the static currents, degrees.
    pub static_median_deg: f64,
    /// Share with position feedback of the upward force (eq. 8).
    pub feedback_share: f64,
    /// Angle with position feedback of the upward force, degrees.
    pub feedback_median_deg: f64,
    /// Share of the points at which position feedback gives the requested upward force.
    pub feedback_reached: f64,
    /// Share of the points at which position feedback gives it without any sideways force.
    pub vector_reached: f64,
    /// Mean power of that over the power of feedback of the upward force alone; where it is out of
    /// reach both give the nearest force.
    pub vector_power_ratio: f64,
}

/// Out of reach a sideways error counts as this share of a vertical one: vertical first.
pub const SIDEWAYS_WEIGHT: f64 = 0.1;

/// One way of choosing currents.
#[derive(Default)]
struct Given {
    square: f64,
    angles_deg: Vec<f64>,
    reached: f64,
    power: f64,
}

impl Given {
    fn add(&mut self, force_n: [f64; 3], requested_n: f64, weight: f64) {
        let sideways = force_n[0].hypot(force_n[1]);
        self.square += weight * sideways * sideways;
        if requested_n > 0.0 {
            self.angles_deg
                .push(sideways.atan2(force_n[2]).to_degrees());
        }
    }

    fn median_deg(&mut self) -> f64 {
        let middle = self.angles_deg.len() / 2;
        if self.angles_deg.is_empty() {
            return 0.0;
        }
        *self
            .angles_deg
            .select_nth_unstable_by(middle, f64::total_cmp)
            .1
    }
}

/// The sideways force of `problem`, whose forces per ampere along x and y are `side_n_per_a`, each
/// [point, coil], at `lambda_n_per_m` with static currents and with feedback. `None` where no force is
/// requested.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When `side_n_per_a` or the currents are shorter than the problem.
pub fn sideways(
    problem: &ForceProblem,
    side_n_per_a: [&[f64]; 2],
    lambda_n_per_m: f64,
    static_currents_a: &[f64],
) -> Result<Option<Sideways>, FeedbackError> {
    problem.validate(&Settings::default())?;
    let (ohm, lower, upper) = (problem.resistance_ohm, problem.lower_a, problem.upper_a);
    let total = problem.total_max_a;
    let mut upward = Allocator::new(ohm, lower, upper, total)?;
    let mut vector = VectorAllocator::new(ohm, lower, upper, total, SIDEWAYS_WEIGHT)?;
    let coils = problem.coils();
    let heaviest = problem.heaviest();
    let mut currents = vec![0.0; coils];
    let mut rows = vec![[0.0; 3]; coils];
    let [mut fixed, mut of_upward, mut of_vector]: [Given; 3] = Default::default();
    let (mut weights, mut requested_square) = (0.0, 0.0);
    for (point, height) in problem.height_m.iter().enumerate() {
        let at = point * coils..(point + 1) * coils;
        let of_z = &problem.forces_n_per_a[at.clone()];
        for (i, row) in rows.iter_mut().enumerate() {
            *row = [
                side_n_per_a[0][at.start + i],
                side_n_per_a[1][at.start + i],
                of_z[i],
            ];
        }
        let offset = problem.offset_n.map_or(0.0, |offset| offset[point]);
        let weight = problem.weights.map_or(1.0, |all| all[point] / heaviest);
        let requested = lambda_n_per_m * height;
        weights += weight;
        requested_square += weight * requested * requested;
        let force = |currents: &[f64]| {
            let mut force = [0.0, 0.0, offset];
            for (row, i) in rows.iter().zip(currents) {
                for (sum, part) in force.iter_mut().zip(row) {
                    *sum += part * i;
                }
            }
            force
        };
        let power = |currents: &[f64]| -> f64 {
            let heat = currents.iter().zip(ohm).map(|(i, ohm)| ohm * i * i);
            weight * heat.sum::<f64>()
        };
        let share = |reach| if reach == Reach::Reached { weight } else { 0.0 };
        fixed.add(force(static_currents_a), requested, weight);
        let found = upward.allocate(of_z, requested - offset, &mut currents);
        of_upward.add(force(&currents), requested, weight);
        of_upward.reached += share(found.reach);
        of_upward.power += power(&currents);
        let found = vector.allocate(&rows, [0.0, 0.0, requested - offset], &mut currents);
        of_vector.reached += share(found.reach);
        of_vector.power += power(&currents);
    }
    if requested_square <= 0.0 {
        return Ok(None);
    }
    let share = |given: &Given| (given.square / requested_square).sqrt();
    Ok(Some(Sideways {
        points: problem.height_m.len(),
        static_share: share(&fixed),
        static_median_deg: fixed.median_deg(),
        feedback_share: share(&of_upward),
        feedback_median_deg: of_upward.median_deg(),
        feedback_reached: of_upward.reached / weights,
        vector_reached: of_vector.reached / weights,
        vector_power_ratio: of_vector.power / of_upward.power,
    }))
}
