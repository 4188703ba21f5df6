//! A force vector rendered with position feedback: eq. 8 with three rows at every point, and the same
//! requests under static currents and under eq. 8 of the upward force alone.
//!
//! A request is `lambda h_j d_j` with a direction `d_j`. The lambdas that a point can be given are an
//! interval, because the forces within the limits are a convex body `B`. Its upper end is found from above:
//! where `F = lambda h d` lies outside `B`, the nearest force `N` of `B` gives a plane that holds all of `B` on one
//! side, and the ray meets it at
//!
//! ```text
//! lambda' h = n . N / n . d,   n = w^2 (F - N),
//! ```
//!
//! below lambda and not below the end. `B` has finitely many faces, so that ends; each turn is Newton's step on the
//! distance, which is convex. The lower end, above zero only where a force without currents is too strong, is
//! found likewise from below.

use fluxform_numerics::quantile::weighted_quantile;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::allocation::{Allocator, Reach};
use super::certificate::best_within_limits;
use super::feedback::{FeedbackError, Reachable};
use super::given::{GivenForce, Ratios};
use super::problem::{ForceProblem, Settings};
use super::sampling::{QUARTERS, Squares};
use super::vector_allocation::{EvenAxes, SIDEWAYS_WEIGHT, VectorAllocator};

/// Points handled together: fixed, so that sums do not depend on the number of threads.
const CHUNK_POINTS: usize = 1024;
/// Turns to an end of the lambdas, at most.
const TURNS: usize = 100;
/// Steps below this share are none.
const STILL: f64 = 1e-12;
/// Steps the other way up to this share are rounding.
const ASTRAY: f64 = 1e-10;

/// Ends below this share of what the force along the request allows are none.
const NOTHING: f64 = 1e-9;

/// Points whose requested force is a vector.
#[derive(Debug, Clone, Copy)]
pub struct VectorProblem<'a> {
    /// The upward force, the heights and the limits.
    pub upward: ForceProblem<'a>,
    /// Forces per ampere along x and y, each [point, coil], N/A.
    pub sides_n_per_a: [&'a [f64]; 2],
    /// The requested force over lambda times the height, at every point.
    pub direction: &'a [[f64; 3]],
}

/// Whose currents render the points.
#[derive(Debug, Clone, Copy)]
pub enum CurrentsOf<'a> {
    /// The same at every point, A.
    Static(&'a [f64]),
    /// Of least power for the upward part of the request (eq. 8).
    Upward,
    /// Of least power for all three components.
    Vector,
}

/// How far the forces of currents are off at the points of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QuarterErrors {
    /// By quarters, N^2.
    pub squares: [Squares; QUARTERS],
    /// The longest difference from a requested vector, N.
    pub worst_n: f64,
    /// Mean power in the coils, W.
    pub mean_power_w: f64,
    /// The upward force over the upward part of the request; `None` where none is requested.
    pub given: Option<GivenForce>,
}

/// How well given currents render requested vectors; means by the points' weights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VectorRendering {
    /// Length of the difference from the requested vector, root mean square, N.
    pub rms_error_n: f64,
    /// The longest, N.
    pub worst_error_n: f64,
    /// Root mean square of the difference over that of the requested vector.
    pub error_share: f64,
    /// The same of its horizontal part alone.
    pub sideways_share: f64,
    /// Angle between the given force and the requested one, median over the points above height 0 by their weights,
    /// degrees.
    pub direction_median_deg: f64,
    /// 95 % of the angles are no larger, degrees.
    pub direction_95_deg: f64,
    /// Share of the points at which the currents give all that was requested of them.
    pub reached: f64,
    /// Mean power in the coils, W.
    pub mean_power_w: f64,
    /// Largest |current| of any coil, A.
    pub largest_current_a: f64,
}

impl VectorProblem<'_> {
    fn point(&self, point: usize) -> Rows<'_> {
        let coils = self.upward.coils();
        let of = |all| -> &[f64] {
            let all: &[f64] = all;
            &all[point * coils..(point + 1) * coils]
        };
        let [x, y] = self.sides_n_per_a;
        Rows {
            axes: [of(x), of(y), of(self.upward.forces_n_per_a)],
            offset_n: self.upward.offset_n.map_or(0.0, |all| all[point]),
            request: self.direction[point].map(|part| part * self.upward.height_m[point]),
        }
    }

    /// # Errors
    /// Where the problem is malformed.
    fn allocator(&self, sideways_weight: f64) -> Result<VectorAllocator, FeedbackError> {
        let problem = &self.upward;
        problem.validate(&Settings::default())?;
        Ok(VectorAllocator::new(
            problem.resistance_ohm,
            problem.lower_a,
            problem.upper_a,
            problem.total_max_a,
            sideways_weight,
        )?)
    }
}

/// One point: forces per ampere, the force without currents, and the request over lambda.
struct Rows<'a> {
    axes: [&'a [f64]; 3],
    offset_n: f64,
    request: [f64; 3],
}

impl Rows<'_> {
    fn fill(&self, rows: &mut [[f64; 3]]) {
        for (coil, row) in rows.iter_mut().enumerate() {
            *row = std::array::from_fn(|axis| self.axes[axis][coil]);
        }
    }

    /// The force that currents must give at `lambda`, N.
    fn of_currents(&self, lambda: f64) -> [f64; 3] {
        let [x, y, z] = self.request.map(|part| lambda * part);
        [x, y, z - self.offset_n]
    }

    fn given(&self, currents: &[f64]) -> [f64; 3] {
        let sum = |axis: usize| -> f64 {
            let terms = self.axes[axis].iter().zip(currents);
            terms.map(|(force, current)| force * current).sum()
        };
        [sum(0), sum(1), sum(2) + self.offset_n]
    }
}

/// The lambdas that every point can be given, times its height: the two ends as [`super::feedback::reachable`] has
/// them of upward forces, so that [`super::feedback::Span`] serves both.
///
/// Error: ends to 1e-10, where a force counts as given within 1e-11 of its terms.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When directions or sideways forces are fewer than the points.
pub fn reachable_vectors(problem: &VectorProblem) -> Result<Reachable, FeedbackError> {
    let allocator = problem.allocator(1.0)?;
    let points: Vec<usize> = (0..problem.upward.height_m.len()).collect();
    let ends: Vec<(f64, f64)> = points
        .par_chunks(CHUNK_POINTS)
        .flat_map_iter(|points| {
            let mut search = Search::new(problem, allocator.clone());
            let ends: Vec<_> = points.iter().map(|point| search.ends(*point)).collect();
            ends
        })
        .collect();
    let (least_n, most_n) = ends.into_iter().unzip();
    Ok(Reachable { least_n, most_n })
}

struct Search<'a> {
    problem: &'a VectorProblem<'a>,
    allocator: VectorAllocator,
    rows: Vec<[f64; 3]>,
    currents: Vec<f64>,
}

/// The forces that are requested over lambda, and the force without currents, in any coordinates.
struct Ray {
    request: [f64; 3],
    offset_n: [f64; 3],
}

/// The result of asking for a lambda at a point.
enum Asked {
    Given,
    /// The lambda at which the ray meets the plane before the nearest force, if it does.
    Crosses(Option<f64>),
}

impl<'a> Search<'a> {
    fn new(problem: &'a VectorProblem<'a>, allocator: VectorAllocator) -> Self {
        let coils = problem.upward.coils();
        Self {
            problem,
            allocator,
            rows: vec![[0.0; 3]; coils],
            currents: vec![0.0; coils],
        }
    }

    /// Both ends of the lambdas of a point, times its height.
    fn ends(&mut self, point: usize) -> (f64, f64) {
        fluxform_base::progress::poll();
        let rows = self.problem.point(point);
        rows.fill(&mut self.rows);
        let ray = self.even_ray(&rows);
        let height = self.problem.upward.height_m[point];
        if height == 0.0 {
            // Nothing is requested: that must be possible.
            return match self.asked(&ray, 0.0) {
                Asked::Given => (0.0, 0.0),
                Asked::Crosses(_) => (1.0, 1.0),
            };
        }
        let bound = self.bound(&ray);
        let Some(most) = self.end(&ray, [bound, 0.0], |next, now| next < now) else {
            return (0.0, -height);
        };
        // Beside the cone of all forces the cuts come ever nearer to no force at all.
        if most <= NOTHING * bound {
            return (0.0, 0.0);
        }
        let least = if most > 0.0 {
            self.end(&ray, [0.0, most], |next, now| next > now)
        } else {
            Some(0.0)
        };
        (least.unwrap_or(most) * height, most * height)
    }

    /// Changes `self.rows`, those of the point, to axes along which the coils give alike, and gives the ray of the
    /// requested forces in them.
    fn even_ray(&mut self, rows: &Rows) -> Ray {
        let offset_n = [0.0, 0.0, rows.offset_n];
        let coils = self.rows.iter().zip(self.problem.upward.resistance_ohm);
        match EvenAxes::new(coils.map(|(row, ohm)| (*row, 1.0 / ohm))) {
            Some(axes) => {
                for row in &mut self.rows {
                    *row = axes.of(*row);
                }
                Ray {
                    request: axes.of(rows.request),
                    offset_n: axes.of(offset_n),
                }
            }
            None => Ray {
                request: rows.request,
                offset_n,
            },
        }
    }

    /// No lambda beyond it can be given: the force along the request is largest there.
    fn bound(&self, ray: &Ray) -> f64 {
        (self.most_along(ray.request) + dot(ray.request, ray.offset_n))
            / dot(ray.request, ray.request)
    }

    /// The largest product of a direction and a force within the limits.
    fn most_along(&self, [x, y, z]: [f64; 3]) -> f64 {
        let along: Vec<f64> = (self.rows.iter())
            .map(|row| x * row[0] + y * row[1] + z * row[2])
            .collect();
        let best = best_within_limits(&self.problem.upward, &along);
        along.iter().zip(&best).map(|(force, i)| force * i).sum()
    }

    /// The end of the lambdas that is met on the `way` between two, of which the second is given if any is; `None` where
    /// none is.
    fn end(&mut self, ray: &Ray, [from, to]: [f64; 2], way: fn(f64, f64) -> bool) -> Option<f64> {
        let mut lambda = from;
        for _ in 0..TURNS {
            let next = match self.asked(ray, lambda) {
                Asked::Given => break,
                Asked::Crosses(next) => next?,
            };
            let step = (next - lambda).abs() / lambda.abs().max(next.abs());
            match way(next, lambda) {
                true if step > STILL => lambda = next,
                // No lambda is given, or this one is the end and its nearest force too near to point anywhere.
                false if step > ASTRAY => {
                    let within = if way(0.0, 1.0) {
                        1.0 - ASTRAY
                    } else {
                        1.0 + ASTRAY
                    };
                    return match self.asked(ray, within * lambda) {
                        Asked::Given => Some(within * lambda),
                        // A plane through a force that is not the nearest cuts off too little.
                        Asked::Crosses(_) => self.halved(ray, to, lambda),
                    };
                }
                _ => break,
            }
        }
        Some(lambda)
    }

    /// The end between a lambda that is given, if any is, and one that is not.
    fn halved(&mut self, ray: &Ray, mut given: f64, mut beyond: f64) -> Option<f64> {
        let mut is_given = |lambda| matches!(self.asked(ray, lambda), Asked::Given);
        if !is_given(given) {
            return None;
        }
        for _ in 0..TURNS {
            let middle = 0.5 * (given + beyond);
            if (beyond - given).abs() <= ASTRAY * middle.abs() {
                break;
            }
            *if is_given(middle) {
                &mut given
            } else {
                &mut beyond
            } = middle;
        }
        Some(given)
    }

    fn asked(&mut self, ray: &Ray, lambda: f64) -> Asked {
        let target: [f64; 3] = std::array::from_fn(|k| lambda * ray.request[k] - ray.offset_n[k]);
        let found = self
            .allocator
            .allocate(&self.rows, target, &mut self.currents);
        if found.reach == Reach::Reached {
            return Asked::Given;
        }
        let normal: [f64; 3] = std::array::from_fn(|k| target[k] - found.force_n[k]);
        // The nearest force is in the plane. Where another may be nearer, the plane goes through the farthest.
        let most = match found.proven {
            true => dot(normal, found.force_n),
            false => self.most_along(normal),
        };
        let crossing = (most + dot(normal, ray.offset_n)) / dot(normal, ray.request);
        Asked::Crosses(Some(crossing).filter(|crossing| crossing.is_finite()))
    }
}

fn dot([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> f64 {
    a * x + b * y + c * z
}

/// Renders every point at `lambda_n_per_m`.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When directions, sideways forces or currents are fewer than the problem's.
pub fn render_vectors(
    problem: &VectorProblem,
    lambda_n_per_m: f64,
    currents_of: CurrentsOf,
) -> Result<VectorRendering, FeedbackError> {
    let all: Vec<usize> = (0..problem.upward.height_m.len()).collect();
    Ok(sums_at(problem, &all, lambda_n_per_m, currents_of)?.rendering())
}

/// The errors of the rendered points, whose `quarters` are given.
pub(crate) fn quarter_errors(
    problem: &VectorProblem,
    quarters: &[usize],
    lambda_n_per_m: f64,
    currents_of: CurrentsOf,
) -> Result<QuarterErrors, FeedbackError> {
    let mut squares = [Squares::default(); QUARTERS];
    let mut all = Sums::default();
    for (quarter, squares) in squares.iter_mut().enumerate() {
        let mine = |point: &usize| quarters[*point] == quarter;
        let points: Vec<usize> = (0..quarters.len()).filter(mine).collect();
        let sums = sums_at(problem, &points, lambda_n_per_m, currents_of)?;
        *squares = Squares {
            upward: sums.upward,
            sideways: sums.sideways,
            requested: sums.requested,
        };
        all.join(sums);
    }
    Ok(QuarterErrors {
        squares,
        worst_n: all.worst,
        mean_power_w: all.power / all.weight,
        given: all.given.of_force(false),
    })
}

/// The sums of some points.
pub(super) fn sums_at(
    problem: &VectorProblem,
    points: &[usize],
    lambda_n_per_m: f64,
    currents_of: CurrentsOf,
) -> Result<Sums, FeedbackError> {
    let vector = problem.allocator(SIDEWAYS_WEIGHT)?;
    let limits = &problem.upward;
    let heaviest = limits.heaviest();
    let heights = limits.height_m.iter().zip(problem.direction);
    let highest_m = heights.map(|(height_m, [_, _, up])| height_m * up);
    let given = Ratios::new(lambda_n_per_m * highest_m.fold(0.0, f64::max));
    let upward = Allocator::new(
        limits.resistance_ohm,
        limits.lower_a,
        limits.upper_a,
        limits.total_max_a,
    )?;
    let parts: Vec<Sums> = points
        .par_chunks(CHUNK_POINTS)
        .map(|points| {
            let mut chosen = GivenCurrents {
                currents_of,
                upward: upward.clone(),
                vector: vector.clone(),
                rows: vec![[0.0; 3]; limits.coils()],
                currents: vec![0.0; limits.coils()],
            };
            let mut sums = Sums {
                heaviest,
                given,
                ..Sums::default()
            };
            for &point in points {
                fluxform_base::progress::poll();
                sums.add(problem, &mut chosen, point, lambda_n_per_m);
            }
            sums
        })
        .collect();
    let mut all = Sums::default();
    for part in parts {
        all.join(part);
    }
    Ok(all)
}

/// Chooses the currents of a point.
struct GivenCurrents<'a> {
    currents_of: CurrentsOf<'a>,
    upward: Allocator,
    vector: VectorAllocator,
    rows: Vec<[f64; 3]>,
    currents: Vec<f64>,
}

impl GivenCurrents<'_> {
    fn at(&mut self, rows: &Rows, lambda: f64) -> Reach {
        let target = rows.of_currents(lambda);
        match self.currents_of {
            CurrentsOf::Static(currents) => {
                self.currents.copy_from_slice(currents);
                Reach::Saturated
            }
            CurrentsOf::Upward => {
                let found = self
                    .upward
                    .allocate(rows.axes[2], target[2], &mut self.currents);
                found.reach
            }
            CurrentsOf::Vector => {
                rows.fill(&mut self.rows);
                let found = self.vector.allocate(&self.rows, target, &mut self.currents);
                found.reach
            }
        }
    }
}

/// Sums over points.
#[derive(Default)]
pub(super) struct Sums {
    /// The largest weight of all points, over which theirs are taken.
    heaviest: f64,
    weight: f64,
    pub(super) requested: f64,
    upward: f64,
    sideways: f64,
    worst: f64,
    reached: f64,
    power: f64,
    largest: f64,
    /// Of the upward force.
    given: Ratios,
    /// With their weights.
    angles_deg: Vec<(f64, f64)>,
}

impl Sums {
    fn add(
        &mut self,
        problem: &VectorProblem,
        chosen: &mut GivenCurrents,
        point: usize,
        lambda: f64,
    ) {
        let rows = problem.point(point);
        let limits = &problem.upward;
        let weight = limits.weight(point) / self.heaviest;
        let reach = chosen.at(&rows, lambda);
        let force = rows.given(&chosen.currents);
        let request = rows.request.map(|part| lambda * part);
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| force[k] - request[k]);
        let sideways = x * x + y * y;
        self.weight += weight;
        self.requested += weight * request.iter().map(|part| part * part).sum::<f64>();
        self.upward += weight * z * z;
        self.sideways += weight * sideways;
        self.worst = self.worst.max((sideways + z * z).sqrt());
        self.reached += if reach == Reach::Reached { weight } else { 0.0 };
        for (current, ohm) in chosen.currents.iter().zip(limits.resistance_ohm) {
            self.power += weight * ohm * current * current;
            self.largest = self.largest.max(current.abs());
        }
        self.given.add(weight, force[2], request[2]);
        if request != [0.0; 3] && weight > 0.0 {
            self.angles_deg.push((angle_deg(request, force), weight));
        }
    }

    /// Points that come after these.
    fn join(&mut self, next: Self) {
        self.weight += next.weight;
        self.requested += next.requested;
        self.upward += next.upward;
        self.sideways += next.sideways;
        self.worst = self.worst.max(next.worst);
        self.reached += next.reached;
        self.power += next.power;
        self.largest = self.largest.max(next.largest);
        self.given.join(&next.given);
        self.angles_deg.extend(next.angles_deg);
    }

    pub(super) fn rendering(mut self) -> VectorRendering {
        self.angles_deg.sort_by(|a, b| a.0.total_cmp(&b.0));
        let angle_deg = |part: f64| match &self.angles_deg[..] {
            [] => 0.0,
            angles_deg => weighted_quantile(angles_deg, part),
        };
        // Nothing requested: no share of it.
        let share = |square: f64| {
            if self.requested > 0.0 {
                (square / self.requested).sqrt()
            } else {
                0.0
            }
        };
        let error = self.upward + self.sideways;
        VectorRendering {
            rms_error_n: (error / self.weight).sqrt(),
            worst_error_n: self.worst,
            error_share: share(error),
            sideways_share: share(self.sideways),
            direction_median_deg: angle_deg(0.5),
            direction_95_deg: angle_deg(0.95),
            reached: self.reached / self.weight,
            mean_power_w: self.power / self.weight,
            largest_current_a: self.largest,
        }
    }
}

/// Angle between a requested force and the `given` one, degrees; 0 where none is requested, 180 where none is
/// given.
#[must_use]
pub fn angle_deg(requested: [f64; 3], given: [f64; 3]) -> f64 {
    let [[a, b, c], [x, y, z]] = [requested, given];
    if requested == [0.0; 3] {
        return 0.0;
    }
    if given == [0.0; 3] {
        return 180.0;
    }
    let across = (b * z - c * y).hypot((c * x - a * z).hypot(a * y - b * x));
    across.atan2(a * x + b * y + c * z).to_degrees()
}
