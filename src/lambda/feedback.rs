//! A force constant rendered with position feedback: currents of their own at every point (eq. 8).
//!
//! Static currents serve all points at once; with feedback each point is solved alone. The forces
//! within reach of the limits at a point are an interval, both ends of which are fractional
//! knapsacks over box and sum:
//!
//! ```text
//! [min, max] of sum G_ji I_i + F_p,j   over   l_i <= I_i <= u_i,  sum I_i <= I_t.
//! ```
//!
//! lambda h_j lies in it for every point from a smallest lambda (0 unless a force without currents
//! is too strong somewhere) to a largest one, `min_j (max + F_p,j) / h_j` for heights above zero.

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::allocation::{Allocator, AllocatorError};
use super::certificate::best_within_limits;
use super::problem::{ForceProblem, ProblemError, Settings};
use super::wiring::Wiring;

/// Points handled together: fixed, so that sums do not depend on the number of threads.
const CHUNK_POINTS: usize = 4096;
/// A coil is active above this share of its limit.
pub(crate) const ACTIVE: f64 = 1e-6;
/// Force errors below this share of the terms they are sums of are rounding.
const ROUNDING: f64 = 1e-12;

/// The forces within reach at points, the one without currents included.
#[derive(Debug, Clone, PartialEq)]
pub struct Reachable {
    /// The smallest at each point, N.
    pub least_n: Vec<f64>,
    /// The largest at each point, N.
    pub most_n: Vec<f64>,
}

/// Why a problem cannot be rendered with feedback.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FeedbackError {
    /// Not a force problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// Limits or resistances beyond what can be allocated.
    #[error(transparent)]
    Allocator(#[from] AllocatorError),
}

/// The forces within reach at every point.
///
/// Error: a few roundings of the sum of `|G_ji I_i|`.
///
/// # Errors
/// Where the problem is malformed.
pub fn reachable(problem: &ForceProblem) -> Result<Reachable, ProblemError> {
    problem.validate(&Settings::default())?;
    let coils = problem.coils();
    let ends: Vec<(f64, f64)> = problem
        .forces_n_per_a
        .par_chunks(coils)
        .with_min_len(CHUNK_POINTS)
        .enumerate()
        .map(|(point, row)| {
            let offset = problem.offset_n.map_or(0.0, |offset| offset[point]);
            let down: Vec<f64> = row.iter().map(|force| -force).collect();
            let force = |row: &[f64]| -> f64 {
                let best = best_within_limits(problem, row);
                row.iter().zip(&best).map(|(force, i)| force * i).sum()
            };
            (offset - force(&down), offset + force(row))
        })
        .collect();
    let (least_n, most_n) = ends.into_iter().unzip();
    Ok(Reachable { least_n, most_n })
}

/// A force constant and the place that decides it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decided {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// Its point.
    pub point: usize,
    /// The layer in which it lies, in the order in which they were added.
    pub layer: usize,
    /// Its place among those of the layer.
    pub place: usize,
}

/// Why no force constant above zero can be given to every point.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoLambda {
    /// All heights are zero.
    #[error("no force is requested at any point")]
    NothingWanted,
    /// No force of the requested sign.
    #[error("no force in the requested direction is within reach at point {0}")]
    TooWeak(usize),
    /// The least force exceeds what is requested there at every lambda that another point allows.
    #[error(
        "point {strong} feels no less than lambda {least} N/m asks for, \
         and point {weak} no more than {most} N/m does"
    )]
    TooStrong {
        /// Where the force is too strong.
        strong: usize,
        /// The smallest lambda there, N/m.
        least: f64,
        /// Where it is too weak.
        weak: usize,
        /// The largest lambda there, N/m.
        most: f64,
    },
    /// A point of height zero that feels a force whatever the currents.
    #[error("point {0} is to feel nothing, and no currents take away what it feels without them")]
    Unwanted(usize),
}

/// The force constants that every point of one or more layers can be given. The same heights
/// count in every layer: what a place above or below the surface is to feel is lambda times the
/// surface's height.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Span {
    lowest: Option<Decided>,
    highest: Option<Decided>,
    unwanted: Option<usize>,
    layers: usize,
}

impl Span {
    /// Adds a layer of places over the points whose heights are given.
    pub fn add(&mut self, height_m: &[f64], layer: &Reachable) {
        self.add_over(height_m, layer, |place| place);
    }

    /// Adds a layer of places over some points: `point` gives that of a place.
    pub fn add_over(
        &mut self,
        height_m: &[f64],
        layer: &Reachable,
        point: impl Fn(usize) -> usize,
    ) {
        let ends = layer.least_n.iter().zip(&layer.most_n);
        for (place, (&height, (&least, &most))) in height_m.iter().zip(ends).enumerate() {
            let point = point(place);
            if height == 0.0 {
                if !(least <= 0.0 && most >= 0.0) {
                    self.unwanted.get_or_insert(point);
                }
                continue;
            }
            let (low, high) = if height > 0.0 {
                (least / height, most / height)
            } else {
                (most / height, least / height)
            };
            let at = |lambda_n_per_m| Decided {
                lambda_n_per_m,
                point,
                layer: self.layers,
                place,
            };
            if self.highest.is_none_or(|h| high < h.lambda_n_per_m) {
                self.highest = Some(at(high));
            }
            if self.lowest.is_none_or(|l| low > l.lambda_n_per_m) {
                self.lowest = Some(at(low));
            }
        }
        self.layers += 1;
    }

    /// The smallest, N/m: above zero only where a force without currents is too strong.
    #[must_use]
    pub fn smallest_n_per_m(&self) -> f64 {
        self.lowest.map_or(0.0, |low| low.lambda_n_per_m.max(0.0))
    }

    /// The largest.
    ///
    /// # Errors
    /// Why there is none above zero.
    pub fn largest(&self) -> Result<Decided, NoLambda> {
        let (Some(low), Some(high)) = (self.lowest, self.highest) else {
            return Err(self
                .unwanted
                .map_or(NoLambda::NothingWanted, NoLambda::Unwanted));
        };
        if let Some(point) = self.unwanted {
            return Err(NoLambda::Unwanted(point));
        }
        if high.lambda_n_per_m <= 0.0 {
            return Err(NoLambda::TooWeak(high.point));
        }
        if low.lambda_n_per_m > high.lambda_n_per_m {
            return Err(NoLambda::TooStrong {
                strong: low.point,
                least: low.lambda_n_per_m,
                weak: high.point,
                most: high.lambda_n_per_m,
            });
        }
        Ok(high)
    }
}

/// A surface with the currents of least power at every point; means by the points' weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Rendered {
    /// N/m.
    pub lambda_n_per_m: f64,
    /// N; 0 where every force is within reach.
    pub rms_error_n: f64,
    /// N.
    pub worst_error_n: f64,
    /// Points whose force is beyond reach.
    pub points_unreached: usize,
    /// Mean power in the coils, W.
    pub mean_power_w: f64,
    /// Largest power at any point, W.
    pub max_power_w: f64,
    /// Largest |current| of any coil, A.
    pub largest_current_a: f64,
    /// Largest |current| of each coil, A.
    pub current_max_a: Vec<f64>,
    /// Root mean square current of each coil, A.
    pub current_rms_a: Vec<f64>,
    /// Share of the points at which each coil carries more than 1e-6 of its limit.
    pub active_share: Vec<f64>,
    /// Mean number of such coils.
    pub active_mean: f64,
    /// Fewest at any point.
    pub active_min: usize,
    /// Most at any point.
    pub active_max: usize,
    /// Force at each point, the one without currents included, N.
    #[serde(skip)]
    pub forces_n: Vec<f64>,
}

impl Rendered {
    /// Gives both coils of a pair their common current and share.
    pub fn spread(&mut self, wiring: &Wiring) {
        wiring.spread(&mut self.current_max_a);
        wiring.spread(&mut self.current_rms_a);
        wiring.spread(&mut self.active_share);
    }
}

/// Renders every point by itself: eq. 8 with the currents of least power.
///
/// # Errors
/// Where the problem is malformed.
pub fn render(problem: &ForceProblem, lambda_n_per_m: f64) -> Result<Rendered, FeedbackError> {
    let settings = Settings {
        at_n_per_m: Some(lambda_n_per_m),
        ..Settings::default()
    };
    problem.validate(&settings)?;
    let allocator = Allocator::new(
        problem.resistance_ohm,
        problem.lower_a,
        problem.upper_a,
        problem.total_max_a,
    )?;
    let heaviest = problem.heaviest();
    let parts: Vec<Sums> = problem
        .height_m
        .par_chunks(CHUNK_POINTS)
        .enumerate()
        .map(|(chunk, heights)| {
            let mut sums = Sums::new(problem.coils());
            let mut allocator = allocator.clone();
            let first = chunk * CHUNK_POINTS;
            for point in first..first + heights.len() {
                fluxform_base::progress::poll();
                let weight = problem.weight(point) / heaviest;
                sums.add(problem, &mut allocator, point, weight, lambda_n_per_m);
            }
            sums
        })
        .collect();
    let mut all = Sums::new(problem.coils());
    for part in parts {
        all.join(part);
    }
    Ok(all.rendered(lambda_n_per_m))
}

/// Sums and extremes over points.
struct Sums {
    weight: f64,
    square: f64,
    worst: f64,
    unreached: usize,
    power: f64,
    most_power: f64,
    largest: Vec<f64>,
    squares: Vec<f64>,
    active: Vec<f64>,
    fewest: usize,
    most: usize,
    forces: Vec<f64>,
    currents: Vec<f64>,
}

impl Sums {
    fn new(coils: usize) -> Self {
        Self {
            weight: 0.0,
            square: 0.0,
            worst: 0.0,
            unreached: 0,
            power: 0.0,
            most_power: 0.0,
            largest: vec![0.0; coils],
            squares: vec![0.0; coils],
            active: vec![0.0; coils],
            fewest: usize::MAX,
            most: 0,
            forces: Vec::new(),
            currents: vec![0.0; coils],
        }
    }

    fn add(
        &mut self,
        problem: &ForceProblem,
        allocator: &mut Allocator,
        point: usize,
        weight: f64,
        lambda: f64,
    ) {
        let coils = problem.coils();
        let row = &problem.forces_n_per_a[point * coils..(point + 1) * coils];
        let offset = problem.offset_n.map_or(0.0, |offset| offset[point]);
        let requested = lambda * problem.height_m[point];
        let found = allocator.allocate(row, requested - offset, &mut self.currents);
        let force = found.force_n + offset;
        let terms = row.iter().zip(&self.currents).map(|(g, i)| (g * i).abs());
        let size = terms.sum::<f64>() + offset.abs() + requested.abs();
        let error = (force - requested).abs();
        if error > ROUNDING * size {
            self.square += weight * error * error;
            self.worst = self.worst.max(error);
            self.unreached += 1;
        }
        let (mut power, mut count) = (0.0, 0);
        for (coil, &current) in self.currents.iter().enumerate() {
            let heat = problem.resistance_ohm[coil] * current * current;
            power += heat;
            self.squares[coil] += weight * current * current;
            self.largest[coil] = self.largest[coil].max(current.abs());
            let limit = if current > 0.0 {
                problem.upper_a[coil]
            } else {
                -problem.lower_a[coil]
            };
            if current.abs() > ACTIVE * limit {
                self.active[coil] += weight;
                count += 1;
            }
        }
        self.weight += weight;
        self.power += weight * power;
        self.most_power = self.most_power.max(power);
        self.fewest = self.fewest.min(count);
        self.most = self.most.max(count);
        self.forces.push(force);
    }

    /// Points that come after these.
    fn join(&mut self, next: Self) {
        self.weight += next.weight;
        self.square += next.square;
        self.worst = self.worst.max(next.worst);
        self.unreached += next.unreached;
        self.power += next.power;
        self.most_power = self.most_power.max(next.most_power);
        for coil in 0..self.largest.len() {
            self.largest[coil] = self.largest[coil].max(next.largest[coil]);
            self.squares[coil] += next.squares[coil];
            self.active[coil] += next.active[coil];
        }
        self.fewest = self.fewest.min(next.fewest);
        self.most = self.most.max(next.most);
        self.forces.extend(next.forces);
    }

    fn rendered(self, lambda_n_per_m: f64) -> Rendered {
        let mean = |sum: f64| sum / self.weight;
        Rendered {
            lambda_n_per_m,
            rms_error_n: mean(self.square).sqrt(),
            worst_error_n: self.worst,
            points_unreached: self.unreached,
            mean_power_w: mean(self.power),
            max_power_w: self.most_power,
            largest_current_a: self.largest.iter().copied().fold(0.0, f64::max),
            current_rms_a: self.squares.iter().map(|sum| mean(*sum).sqrt()).collect(),
            active_mean: mean(self.active.iter().sum()),
            active_share: self.active.iter().map(|sum| mean(*sum)).collect(),
            active_min: self.fewest,
            active_max: self.most,
            current_max_a: self.largest,
            forces_n: self.forces,
        }
    }
}
