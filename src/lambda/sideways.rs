//! The sideways force that static currents and eq. 8 leave, and what three rows of eq. 8 change.

use fluxform_numerics::quantile::quantile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::allocation::{Allocator, Reach};
use super::feedback::FeedbackError;
use super::problem::{ForceProblem, Settings};
use super::vector_allocation::VectorAllocator;

/// The force along x and y at the chosen lambda, by that of the coils; the pull of the unpowered steel
/// counts upward only, and `pull_share` says what that leaves out. Shares are root mean squares over the points, over that of the requested
/// push; angles are between the given force and upward, medians over the points above height 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sideways {
    /// Points looked at, evenly among all; for feedback without any sideways force up to a thousand of them.
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
    /// Share of the unpowered steel's own sideways pull, which neither the shares above nor feedback
    /// count, from a hundred points, to about a tenth of itself; absent where its upward pull is not counted either.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pull_share: Option<f64>,
}

/// Out of reach a sideways error counts as this share of a vertical one: vertical first.
pub const SIDEWAYS_WEIGHT: f64 = 0.1;

/// One point: its forces per ampere along x, y and z, the force without currents, the request and the weight.
struct Point<'a> {
    axes: [&'a [f64]; 3],
    offset_n: f64,
    request_n: f64,
    weight: f64,
}

impl<'a> Point<'a> {
    fn of(
        problem: &ForceProblem<'a>,
        [along_x, along_y]: [&'a [f64]; 2],
        lambda_n_per_m: f64,
        point: usize,
    ) -> Self {
        let at = point * problem.coils()..(point + 1) * problem.coils();
        let axes = [along_x, along_y, problem.forces_n_per_a];
        Self {
            axes: axes.map(|axis| &axis[at.clone()]),
            offset_n: problem.offset_n.map_or(0.0, |offset| offset[point]),
            request_n: lambda_n_per_m * problem.height_m[point],
            weight: problem.weights.map_or(1.0, |all| all[point]),
        }
    }

    fn fill(&self, rows: &mut [[f64; 3]]) {
        for (coil, row) in rows.iter_mut().enumerate() {
            *row = self.axes.map(|axis| axis[coil]);
        }
    }
}

/// One way of choosing currents.
#[derive(Default)]
struct Given {
    square: f64,
    requested_square: f64,
    angles_deg: Vec<f64>,
    weights: f64,
    reached: f64,
    power: f64,
}

impl Given {
    fn add(&mut self, at: &Point, rows: &[[f64; 3]], currents: &[f64]) {
        let mut force_n = [0.0, 0.0, at.offset_n];
        for (row, i) in rows.iter().zip(currents) {
            for (sum, part) in force_n.iter_mut().zip(row) {
                *sum += part * i;
            }
        }
        let sideways = force_n[0].hypot(force_n[1]);
        self.square += at.weight * sideways * sideways;
        self.requested_square += at.weight * at.request_n * at.request_n;
        if at.request_n > 0.0 {
            self.angles_deg
                .push(sideways.atan2(force_n[2]).to_degrees());
        }
    }

    /// Gives the weighted power of the point.
    fn count(&mut self, at: &Point, reach: Reach, (currents, ohm): (&[f64], &[f64])) -> f64 {
        let heat = currents.iter().zip(ohm).map(|(i, ohm)| ohm * i * i);
        let power = at.weight * heat.sum::<f64>();
        self.power += power;
        self.weights += at.weight;
        if reach == Reach::Reached {
            self.reached += at.weight;
        }
        power
    }

    fn share(&self) -> f64 {
        (self.square / self.requested_square).sqrt()
    }

    fn median_deg(&mut self) -> f64 {
        if self.angles_deg.is_empty() {
            return 0.0;
        }
        self.angles_deg.sort_unstable_by(f64::total_cmp);
        quantile(&self.angles_deg, 0.5)
    }
}

/// The sideways force of `problem`, whose forces per ampere along x and y are `side_n_per_a`, each
/// [point, coil], at `lambda_n_per_m` with static currents and with feedback of the upward force, and at the points
/// `followed`, which ascend, with feedback of all three components. `None` where no force is requested.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When `side_n_per_a` or the currents are shorter than the problem, and for a point that it does not have.
pub fn sideways(
    problem: &ForceProblem,
    side_n_per_a: [&[f64]; 2],
    lambda_n_per_m: f64,
    static_currents_a: &[f64],
    followed: &[usize],
) -> Result<Option<Sideways>, FeedbackError> {
    problem.validate(&Settings::default())?;
    let (ohm, lower, upper) = (problem.resistance_ohm, problem.lower_a, problem.upper_a);
    let total = problem.total_max_a;
    let mut upward = Allocator::new(ohm, lower, upper, total)?;
    let mut vector = VectorAllocator::new(ohm, lower, upper, total, SIDEWAYS_WEIGHT)?;
    let coils = problem.coils();
    let mut currents = vec![0.0; coils];
    let mut rows = vec![[0.0; 3]; coils];
    let [mut fixed, mut of_upward, mut of_vector]: [Given; 3] = Default::default();
    let mut followed = followed.iter().peekable();
    // Power is compared at the same points.
    let mut power_of_upward = 0.0;
    for point in 0..problem.points() {
        fluxform_base::progress::poll();
        let at = Point::of(problem, side_n_per_a, lambda_n_per_m, point);
        at.fill(&mut rows);
        fixed.add(&at, &rows, static_currents_a);
        let found = upward.allocate(at.axes[2], at.request_n - at.offset_n, &mut currents);
        of_upward.add(&at, &rows, &currents);
        let power = of_upward.count(&at, found.reach, (&currents, ohm));
        if followed.next_if_eq(&&point).is_none() {
            continue;
        }
        power_of_upward += power;
        let request = [0.0, 0.0, at.request_n - at.offset_n];
        let found = vector.allocate(&rows, request, &mut currents);
        of_vector.count(&at, found.reach, (&currents, ohm));
    }
    if fixed.requested_square <= 0.0 {
        return Ok(None);
    }
    Ok(Some(Sideways {
        points: problem.points(),
        static_share: fixed.share(),
        static_median_deg: fixed.median_deg(),
        feedback_share: of_upward.share(),
        feedback_median_deg: of_upward.median_deg(),
        feedback_reached: of_upward.reached / of_upward.weights,
        vector_reached: of_vector.reached / of_vector.weights,
        vector_power_ratio: of_vector.power / power_of_upward,
        pull_share: None,
    }))
}
