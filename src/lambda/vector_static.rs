//! Static currents for a force vector: eq. 9 and 10 with three rows a point, and the least longest error.
//!
//! With `D = diag(s, s, 1)` the weighted mean square error of all components
//!
//! ```text
//! e(I, lambda) = sum_j w_j |D (G_j I + F_p,j - lambda h_j d_j)|^2 / sum_j w_j
//! ```
//!
//! is that of a problem with the rows `s G_x`, `s G_y` and `G_z` and the heights `s h d_x`, `s h d_y` and `h d_z`:
//! its path is exact ([`super::solve`]). `s` makes just-noticeable errors count alike: a share `w` of the force
//! upward, and sideways the tangent of the just-noticeable angle.
//!
//! The least longest error is a second-order cone problem. Lawson's weights solve it: for any weights `m_j` that
//! add up to 1 the least weighted mean square is at most the square of the least longest error, and the currents
//! that reach it have a longest error above it. Weights that grow with the errors close the gap; both ends are
//! certified at every turn, and stated.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use fluxform_base::force_constant::ForceConstants;

use super::feedback::FeedbackError;
use super::problem::{ForceProblem, Settings};
use super::solve::{OperatingPoint, solve};
use super::uncertainty::{ErrorForm, Target};
use super::vector_feedback::{CurrentsOf, VectorProblem, VectorRendering, render_vectors};

/// A gap between the ends of the least longest error below this share is none.
const CLOSED: f64 = 1e-3;
/// Turns at most, and the work that they may take: products of numbers.
const TURNS: usize = 400;
const WORK: usize = 2_000_000_000;
/// Price of power that keeps the least mean square unique, relative to the forces' square over resistance.
const PRICE: f64 = 1e-12;

/// The static currents of a force vector.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VectorStatic {
    /// A sideways error counts as this share of an upward one.
    pub sideways_weight: f64,
    /// Constants by the weighted error of all components; maxmin knows no vector and is null.
    #[serde(flatten)]
    pub constants: ForceConstants,
    /// At the lambda that these constants give by the criterion; null without one.
    pub own: Option<VectorCurrents>,
    /// At the lambda chosen for the upward force; null without one.
    pub at_chosen: Option<VectorCurrents>,
}

/// Static currents at one force constant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VectorCurrents {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// Of the least weighted mean square error, A.
    pub currents_a: Vec<f64>,
    /// The root of that error, N.
    pub weighted_rms_error_n: f64,
    /// Bound on how far its square is above the least, N^2.
    pub duality_gap_n2: f64,
    /// How well they render the points, all components counting alike.
    pub rendering: VectorRendering,
    /// The least longest error.
    pub worst: WorstVector,
}

/// The least longest weighted error at any point, between two certified ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct WorstVector {
    /// No currents within the limits have a smaller one, N.
    pub at_least_n: f64,
    /// That of `currents_a`, N.
    pub worst_error_n: f64,
    /// A.
    pub currents_a: Vec<f64>,
    /// The point where it is longest, a row of `points.csv` from 0.
    pub point: usize,
}

/// The weight of sideways errors for a just-noticeable share of force and angle (degrees, 0 to 90).
#[must_use]
pub fn sideways_weight(jnd: f64, direction_jnd_deg: f64) -> f64 {
    jnd / direction_jnd_deg.to_radians().tan()
}

/// The rows of all points as those of one problem.
struct Stacked {
    forces: Vec<f64>,
    heights: Vec<f64>,
    offset: Option<Vec<f64>>,
    weights: Option<Vec<f64>>,
}

impl Stacked {
    fn new(problem: &VectorProblem, weight: f64) -> Self {
        let upward = &problem.upward;
        let scales = [weight, weight, 1.0];
        let axes = [
            problem.sides_n_per_a[0],
            problem.sides_n_per_a[1],
            upward.forces_n_per_a,
        ];
        let points = upward.height_m.len();
        let zeros = vec![0.0; 2 * points];
        let scaled = |axis: usize| axes[axis].iter().map(move |force| scales[axis] * force);
        let requested = |axis: usize| {
            let pairs = upward.height_m.iter().zip(problem.direction);
            pairs.map(move |(h, d)| scales[axis] * h * d[axis])
        };
        Self {
            forces: (0..3).flat_map(scaled).collect(),
            heights: (0..3).flat_map(requested).collect(),
            offset: upward.offset_n.map(|offset| [&zeros, offset].concat()),
            weights: upward.weights.map(|weights| weights.repeat(3)),
        }
    }

    fn problem<'a>(&'a self, limits: &ForceProblem<'a>) -> ForceProblem<'a> {
        ForceProblem {
            forces_n_per_a: &self.forces,
            height_m: &self.heights,
            offset_n: self.offset.as_deref(),
            weights: self.weights.as_deref(),
            ..*limits
        }
    }
}

/// Solves eq. 9 and 10 for all components, a sideways error counting `weight` (0 to 1) of an upward one;
/// also at `chosen_n_per_m`.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When directions or sideways forces are fewer than the points.
pub fn vector_static(
    problem: &VectorProblem,
    weight: f64,
    settings: &Settings,
    chosen_n_per_m: Option<f64>,
) -> Result<VectorStatic, FeedbackError> {
    let stacked = Stacked::new(problem, weight);
    let rows = stacked.problem(&problem.upward);
    let settings = Settings {
        at_n_per_m: chosen_n_per_m,
        ..*settings
    };
    let solution = solve(&rows, &settings)?;
    let currents = |point: &OperatingPoint| -> Result<VectorCurrents, FeedbackError> {
        let lambda = point.lambda_n_per_m;
        Ok(VectorCurrents {
            lambda_n_per_m: lambda,
            currents_a: point.currents_a.clone(),
            // A third of the rows are points.
            weighted_rms_error_n: 3.0_f64.sqrt() * point.rms_error_n,
            duality_gap_n2: 3.0 * point.duality_gap_n2,
            rendering: render_vectors(problem, lambda, CurrentsOf::Static(&point.currents_a))?,
            worst: worst_vector(&rows, lambda, &point.currents_a),
        })
    };
    let own = solution.chosen.as_ref();
    let own = own.filter(|_| settings.criterion.is_least_mean_square());
    Ok(VectorStatic {
        sideways_weight: weight,
        constants: ForceConstants {
            lambda_maxmin_n_per_m: None,
            ..solution.constants
        },
        own: own.map(&currents).transpose()?,
        at_chosen: solution.at.as_ref().map(&currents).transpose()?,
    })
}

/// Lawson's weights over stacked rows, from the currents given.
fn worst_vector(rows: &ForceProblem, lambda: f64, start_a: &[f64]) -> WorstVector {
    let vectors = Vectors::new(rows, lambda);
    let (points, coils) = (vectors.points, rows.coils());
    let mut currents = start_a.to_vec();
    let mut errors = vectors.errors_n(&currents);
    let (point, worst_error_n) = longest(&errors);
    let mut best = WorstVector {
        at_least_n: 0.0,
        worst_error_n,
        currents_a: currents.clone(),
        point,
    };
    let mut weights = vec![1.0 / points.max(1) as f64; points];
    let turns = (WORK / (3 * points * coils * coils).max(1)).clamp(4, TURNS);
    for _ in 0..turns {
        fluxform_base::progress::poll();
        let total: f64 = weights.iter().zip(&errors).map(|(w, e)| w * e).sum();
        if total <= 0.0 {
            break;
        }
        for (weight, error) in weights.iter_mut().zip(&errors) {
            *weight *= error / total;
        }
        let square = vectors.minimise(&weights, &mut currents);
        best.at_least_n = best.at_least_n.max(square.max(0.0).sqrt());
        errors = vectors.errors_n(&currents);
        let (point, error) = longest(&errors);
        if error < best.worst_error_n {
            best.worst_error_n = error;
            best.currents_a.copy_from_slice(&currents);
            best.point = point;
        }
        if best.worst_error_n - best.at_least_n <= CLOSED * best.worst_error_n {
            break;
        }
    }
    best
}

/// The point of the largest error, and the error.
fn longest(errors_n: &[f64]) -> (usize, f64) {
    let pairs = errors_n.iter().copied().enumerate();
    pairs.fold(
        (0, 0.0),
        |most, one| if one.1 > most.1 { one } else { most },
    )
}

/// Stacked rows as one force vector a point, at one lambda.
struct Vectors<'a> {
    rows: &'a ForceProblem<'a>,
    lambda: f64,
    points: usize,
    /// Of a watt, N^2/W.
    price: f64,
    /// The power of all coils at their limits, W.
    most_w: f64,
}

impl<'a> Vectors<'a> {
    fn new(rows: &'a ForceProblem<'a>, lambda: f64) -> Self {
        let largest = (rows.forces_n_per_a.iter()).fold(0.0_f64, |most, g| most.max(g.abs()));
        let least_ohm = (rows.resistance_ohm.iter().copied()).fold(f64::INFINITY, f64::min);
        let limits = rows.lower_a.iter().zip(rows.upper_a);
        Self {
            rows,
            lambda,
            points: rows.height_m.len() / 3,
            price: (PRICE * largest * largest / least_ohm).max(f64::MIN_POSITIVE),
            most_w: (rows.resistance_ohm.iter().zip(limits))
                .map(|(r, (l, u))| r * (l * l).max(u * u))
                .sum(),
        }
    }

    fn requested_n(&self, row: usize) -> f64 {
        let offset_n = self.rows.offset_n.map_or(0.0, |all| all[row]);
        self.lambda * self.rows.height_m[row] - offset_n
    }

    fn force_n_per_a(&self, row: usize) -> &[f64] {
        let coils = self.rows.coils();
        &self.rows.forces_n_per_a[row * coils..(row + 1) * coils]
    }

    /// Length of the error at every point.
    fn errors_n(&self, currents_a: &[f64]) -> Vec<f64> {
        let square = |row: usize| {
            let pairs = self.force_n_per_a(row).iter().zip(currents_a);
            let given: f64 = pairs.map(|(g, i)| g * i).sum();
            (given - self.requested_n(row)).powi(2)
        };
        let length = |point: usize| {
            let axes = (0..3).map(|axis| square(axis * self.points + point));
            axes.sum::<f64>().sqrt()
        };
        (0..self.points).map(length).collect()
    }

    /// Sets the currents of the least weighted square error; gives a lower bound of the largest square
    /// error of any currents: the least of error and priced power, less what that power could be worth
    /// to others, their limits'.
    fn minimise(&self, weights: &[f64], currents_a: &mut [f64]) -> f64 {
        let mut form = ErrorForm::new(self.rows.coils());
        for row in 0..3 * self.points {
            let weight = weights[row % self.points];
            if weight > 0.0 {
                form.add_square(self.force_n_per_a(row), weight, 0.0);
                let target = Target::exact(self.requested_n(row));
                form.add_target(self.force_n_per_a(row), target, weight);
            }
        }
        form.minimise(self.rows, self.price, currents_a);
        let taken = self.rows.resistance_ohm.iter().zip(&*currents_a);
        let power_w: f64 = taken.map(|(r, i)| r * i * i).sum();
        form.value(currents_a) + self.price * (power_w - self.most_w)
    }
}
