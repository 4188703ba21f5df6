//! The least largest error at one force constant by a primal-dual interior-point method.
//!
//! Mehrotra's predictor and corrector (SIAM Journal on Optimization 2, 1992) on
//! `min t, -t <= lambda h - offset - G x <= t, x within its limits`: some twenty steps whatever coils and points
//! there are, where vertices of coils whose forces are nearly those of their neighbours are many, and nearly singular.
//!
//! The equations of a step square a condition. Where many limits bind, the currents themselves are good unknowns: those
//! at their limits are each an entry of the diagonal. Where few do, or there are none, `v = R x` is better, R the
//! triangular factor of G above a small multiple of the unit.

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, DVectorView};
use rayon::prelude::*;

use super::path::ActivePoint;
use super::points::Probe;
use super::pool::Pool;
use super::proof::{lower_bound_n, worst_error_n};
use super::scaled::{Form, Scaled};
use crate::problem::ForceProblem;
use crate::qr_reduction::times_power;
use fluxform_numerics::qr::triangular_factor;

/// Multiples of the unit below G, for currents with limits and without: what forces less is nothing.
const UNIT: [f64; 2] = [1e-6, 1e-13];
/// Share of the largest force per unit of `v` below which one has none: without limits it would go anywhere.
const NO_FORCE: f64 = 1e-12;
/// Share of the largest force that ends the search.
const CLOSE: f64 = 1e-14;
/// Share of the largest force up to which a bound is not sought with other unknowns.
const GOOD: f64 = 1e-11;
/// Room that limits have at least where a search starts, as a share of the largest error there.
const LEAST_ROOM: f64 = 1e-3;
/// Steps of one search.
const STEPS: usize = 60;
/// Steps without a better bound that end it.
const IDLE_STEPS: usize = 10;
/// Part of the way to a limit that a step takes.
const PART: f64 = 0.995;
/// Added to the scaled equations' diagonal of ones.
const REGULAR: f64 = 4e-15;
/// The same where rounding has made the equations indefinite.
const MORE_REGULAR: f64 = 1e-12;
/// Shares of the proof below this are left out.
const NO_SHARE: f64 = 1e-12;
/// Constraints of one parallel task: fixed, so that results do not depend on the number of threads.
const TASK: usize = 512;

/// The optimum at one force constant, in scaled units.
pub(super) struct Centre {
    /// Currents within their limits, A.
    pub currents_a: Vec<f64>,
    /// The largest error.
    pub worst: f64,
    /// How that changes with lambda.
    pub slope: f64,
    /// How far below `worst` the least one may be.
    pub gap: f64,
    /// The largest force.
    pub size: f64,
    /// The points that decide.
    pub active: Vec<ActivePoint>,
    /// The live coils whose currents no limit holds.
    free: Vec<usize>,
}

/// A problem's points and limits, to be solved at one force constant after another.
pub(super) struct Interior<'s, 'a> {
    scaled: &'s Scaled<'a>,
    pool: Pool<'a>,
    /// Units of the currents in scaled ones: what they range over.
    units: Vec<f64>,
    limits: Vec<Limit>,
    /// Whether every current has a limit.
    limited: bool,
    currents: Unknowns,
    turned: Option<Turned>,
}

/// A limit of one current, or of their sum.
struct Limit {
    /// What its row is at least.
    least: f64,
    /// How far above that a search starts.
    room: f64,
    current: Option<usize>,
}

/// The scaled currents, or what is solved for in their place.
struct Unknowns {
    /// Values that a search starts from.
    start: DVector<f64>,
    /// Limits' and points' rows, one after another.
    rows: Vec<f64>,
}

/// Unknowns that make the forces of some currents independent of each other.
struct Turned {
    free: Vec<usize>,
    /// The scaled currents of each, column by column.
    currents: DMatrix<f64>,
    unknowns: Unknowns,
}

impl Turned {
    /// Takes in what rows of currents are for these.
    fn push(&mut self, rows: &[f64]) {
        let n = self.currents.ncols();
        let rows = DMatrixView::from_slice(rows, n, rows.len() / n.max(1));
        let turned = self.currents.tr_mul(&rows);
        self.unknowns.rows.extend_from_slice(turned.as_slice());
    }
}

impl<'s, 'a> Interior<'s, 'a> {
    pub fn new(scaled: &'s Scaled<'a>) -> Self {
        let pool = Pool::new(scaled);
        let units = scaled.ranges();
        let mut start = DVector::from_vec(scaled.middle());
        for (x, unit) in start.iter_mut().zip(&units) {
            *x /= unit;
        }
        let mut has_limit = vec![false; start.len()];
        let mut rows = Vec::new();
        let mut limits = Vec::new();
        for (mut row, mut least) in scaled.limits() {
            for (entry, unit) in row.iter_mut().zip(&units) {
                *entry *= unit;
            }
            let largest = row
                .iter()
                .fold(0.0_f64, |most, entry| most.max(entry.abs()));
            row.iter_mut().for_each(|entry| *entry /= largest);
            least /= largest;
            let mut entries = (0..row.len()).filter(|&k| row[k] != 0.0);
            let current = entries.next().filter(|_| entries.next().is_none());
            if let Some(current) = current {
                has_limit[current] = true;
            }
            let at: f64 = row.iter().zip(&start).map(|(a, x)| a * x).sum();
            limits.push(Limit {
                least,
                room: at - least,
                current,
            });
            rows.extend(row);
        }
        let mut interior = Self {
            scaled,
            pool,
            units,
            limits,
            limited: has_limit.iter().all(|&has| has),
            currents: Unknowns { start, rows },
            turned: None,
        };
        interior.push_points(0);
        interior
    }

    /// Adds the rows of the pool's points from this place on.
    fn push_points(&mut self, first: usize) {
        let mut rows = Vec::new();
        for place in first..self.pool.count() {
            let point = self.pool.point(place);
            let coils = 0..self.scaled.live.len();
            rows.extend(coils.map(|k| self.units[k] * self.scaled.force(point, k)));
        }
        if let Some(turned) = &mut self.turned {
            turned.push(&rows);
        }
        self.currents.rows.extend(rows);
    }

    /// Takes `v = R x` of these currents, which no limit holds, as unknowns.
    fn turn(&mut self, free: Vec<usize>) {
        if self
            .turned
            .as_ref()
            .is_some_and(|turned| turned.free == free)
        {
            return;
        }
        let n = self.currents.start.len();
        let unit = if self.limited { UNIT[0] } else { UNIT[1] };
        let rows = &self.currents.rows[self.limits.len() * n..];
        let points = self.pool.count();
        let factor =
            triangular_factor::<f64>(points + free.len(), free.len(), |range, block, stride| {
                for (at, row) in range.enumerate() {
                    for (column, &k) in free.iter().enumerate() {
                        block[column * stride + at] = match row.checked_sub(points) {
                            None => rows[row * n + k],
                            Some(below) if below == column => unit,
                            Some(_) => 0.0,
                        };
                    }
                }
            });
        let factor = DMatrix::from_column_slice(free.len(), free.len(), &factor.into_columns());
        let mut inverse = DMatrix::identity(free.len(), free.len());
        factor.solve_upper_triangular_mut(&mut inverse);
        let largest = factor.diagonal().amax();
        for (k, mut column) in inverse.column_iter_mut().enumerate() {
            if factor[(k, k)].abs() < NO_FORCE * largest {
                column.fill(0.0);
            }
        }
        let start_of_free = DVector::from_fn(free.len(), |at, _| self.currents.start[free[at]]);
        let start_of_free = factor * start_of_free;
        let mut start = self.currents.start.clone();
        let mut currents = DMatrix::identity(n, n);
        for (column, &k) in free.iter().enumerate() {
            start[k] = start_of_free[column];
            for (row, &i) in free.iter().enumerate() {
                currents[(i, k)] = inverse[(row, column)];
            }
        }
        let mut turned = Turned {
            free,
            currents,
            unknowns: Unknowns {
                start,
                rows: Vec::new(),
            },
        };
        turned.push(&self.currents.rows);
        self.turned = Some(turned);
    }

    /// The optimum at `lambda` over the points of the pool.
    fn of_pool(&mut self, lambda: f64) -> Centre {
        let plainly = |interior: &Self| Search::new(interior, None, lambda).centre();
        let mut best = self.limited.then(|| plainly(self));
        let good = |centre: &Centre| centre.gap <= GOOD * centre.size;
        if !best.as_ref().is_some_and(good) {
            let all = || (0..self.scaled.live.len()).collect();
            let free = best.as_ref().map_or_else(all, |best| best.free.clone());
            self.turn(free);
            let other = Search::new(self, self.turned.as_ref(), lambda).centre();
            if best.as_ref().is_none_or(|best| other.gap < best.gap) {
                best = Some(other);
            }
        }
        best.unwrap_or_else(|| plainly(self))
    }

    /// The optimum at `lambda` over all points, as closely as doubles have it.
    pub fn at(&mut self, lambda: f64) -> Centre {
        loop {
            let centre = self.of_pool(lambda);
            let slack = centre.gap.max(f64::EPSILON * centre.worst);
            let probe = Probe {
                lambda_n_per_m: times_power(lambda, self.scaled.lambda_unit()),
                offset_share: 1.0,
                currents_a: centre.currents_a.clone(),
                limit_n: times_power(centre.worst + slack, self.scaled.force_unit()),
            };
            let known = self.pool.count();
            if self.pool.take_missed(self.scaled, &[probe], Form::Worst) == 0 {
                return centre;
            }
            self.push_points(known);
        }
    }
}

/// One search. Constraints are the limits, the points' forces that are too weak, and those too strong.
struct Search<'i, 's, 'a> {
    interior: &'i Interior<'s, 'a>,
    /// Solved for in place of the currents.
    turned: Option<&'i Turned>,
    lambda: f64,
    /// What each constraint's left side is at least.
    least: Vec<f64>,
    /// The largest force.
    size: f64,
    v: DVector<f64>,
    t: f64,
    slack: Vec<f64>,
    multiplier: Vec<f64>,
}

/// A change of the unknowns.
struct Step {
    v: DVector<f64>,
    t: f64,
    slack: Vec<f64>,
    multiplier: Vec<f64>,
}

impl<'i, 's, 'a> Search<'i, 's, 'a> {
    fn new(interior: &'i Interior<'s, 'a>, turned: Option<&'i Turned>, lambda: f64) -> Self {
        let scaled = interior.scaled;
        let points = interior.pool.count();
        let wanted: Vec<f64> = (0..points)
            .map(|place| scaled.wanted(interior.pool.point(place), lambda))
            .collect();
        let mut least: Vec<f64> = interior.limits.iter().map(|limit| limit.least).collect();
        least.extend_from_slice(&wanted);
        least.extend(wanted.iter().map(|wanted| -wanted));
        let size = wanted.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
        let mut search = Self {
            interior,
            turned,
            lambda,
            size: if size > 0.0 { size } else { 1.0 },
            v: turned
                .map_or(&interior.currents, |turned| &turned.unknowns)
                .start
                .clone(),
            t: 0.0,
            slack: Vec::new(),
            multiplier: Vec::new(),
            least,
        };
        let missing = search.missing(&search.v, 0.0);
        let [limits, _] = search.counts();
        let largest = missing[limits..]
            .iter()
            .fold(0.0_f64, |most, m| most.max(*m));
        search.t = 1.2 * largest + LEAST_ROOM * search.size;
        let even = 0.5 / points as f64;
        let slack = search.missing(&search.v, search.t).into_iter();
        search.slack = slack.map(|m| (-m).max(LEAST_ROOM * search.t)).collect();
        search.multiplier = search
            .slack
            .iter()
            .map(|slack| even * search.t / slack)
            .collect();
        search.multiplier[limits..].fill(even);
        search
    }

    fn unknowns(&self) -> &'i Unknowns {
        self.turned
            .map_or(&self.interior.currents, |turned| &turned.unknowns)
    }

    fn rows(&self) -> DMatrixView<'_, f64> {
        let n = self.v.len();
        let rows = &self.unknowns().rows;
        DMatrixView::from_slice(rows, n, rows.len() / n.max(1))
    }

    /// Limits, and points.
    fn counts(&self) -> [usize; 2] {
        [self.interior.limits.len(), self.interior.pool.count()]
    }

    /// Left sides of the constraints.
    fn left(&self, v: &DVector<f64>, t: f64) -> Vec<f64> {
        let [limits, _] = self.counts();
        let mut left: Vec<f64> = self.rows().tr_mul(v).as_slice().to_vec();
        let strong: Vec<f64> = left[limits..].iter().map(|q| t - q).collect();
        for q in &mut left[limits..] {
            *q += t;
        }
        left.extend(strong);
        left
    }

    /// How far left sides are below what they are at least.
    fn missing(&self, v: &DVector<f64>, t: f64) -> Vec<f64> {
        let left = self.left(v, t);
        self.least
            .iter()
            .zip(left)
            .map(|(least, left)| least - left)
            .collect()
    }

    /// Sums of the constraints' coefficients times `weights`: of the variables, and of t.
    fn sums(&self, weights: &[f64]) -> (DVector<f64>, f64) {
        let [limits, points] = self.counts();
        let (rows, strong) = weights.split_at(limits + points);
        let mut by_row = rows.to_vec();
        for (row, strong) in by_row[limits..].iter_mut().zip(strong) {
            *row -= strong;
        }
        let of_t = weights[limits..].iter().sum();
        let by_row = DVectorView::from_slice(&by_row, by_row.len());
        (self.rows() * by_row, of_t)
    }

    /// The equations of a step with these weights of the constraints, t last.
    fn equations(&self, weights: &[f64]) -> DMatrix<f64> {
        let n = self.v.len();
        let [limits, points] = self.counts();
        let (by_row, strong) = weights.split_at(limits + points);
        let mut by_row = by_row.to_vec();
        let mut mixed = vec![0.0; limits + points];
        for k in 0..points {
            mixed[limits + k] = by_row[limits + k] - strong[k];
            by_row[limits + k] += strong[k];
        }
        let parts: Vec<DMatrix<f64>> = by_row
            .par_chunks(TASK)
            .zip(self.unknowns().rows.par_chunks(TASK * n.max(1)))
            .map(|(weights, rows)| {
                fluxform_base::progress::poll();
                let rows = DMatrixView::from_slice(rows, n, weights.len());
                let mut weighted = rows.into_owned();
                for (mut column, &weight) in weighted.column_iter_mut().zip(weights) {
                    column *= weight;
                }
                weighted * rows.transpose()
            })
            .collect();
        let mut all = DMatrix::zeros(n + 1, n + 1);
        for part in parts {
            let mut corner = all.view_mut((0, 0), (n, n));
            corner += part;
        }
        let edge = self.rows() * DVectorView::from_slice(&mixed, mixed.len());
        all.view_mut((0, n), (n, 1)).copy_from(&edge);
        all.view_mut((n, 0), (1, n)).tr_copy_from(&edge);
        all[(n, n)] = weights[limits..].iter().sum();
        all
    }

    /// Steps until the bound is close, or comes no closer.
    fn centre(mut self) -> Centre {
        let mut best = self.here();
        let mut idle = 0;
        for _ in 0..STEPS {
            fluxform_base::progress::poll();
            if best.gap <= CLOSE * self.size || idle >= IDLE_STEPS || !self.advance() {
                break;
            }
            let here = self.here();
            idle += 1;
            if here.gap < best.gap {
                idle = 0;
                best = here;
            }
        }
        best
    }

    /// One step; false where rounding leaves none.
    fn advance(&mut self) -> bool {
        let n = self.v.len();
        let pairs = || self.slack.iter().zip(&self.multiplier);
        let weights: Vec<f64> = pairs()
            .map(|(slack, multiplier)| multiplier / slack)
            .collect();
        let Some(equations) = Equations::new(self.equations(&weights)) else {
            return false;
        };
        let missing = self.missing(&self.v, self.t);
        let (rest, rest_of_t) = self.sums(&self.multiplier);
        let solve = |product: &[f64]| -> Step {
            // slack = left - least after the whole step.
            let right: Vec<f64> = (0..product.len())
                .map(|k| {
                    let short = self.slack[k] + missing[k];
                    (product[k] + self.multiplier[k] * short) / self.slack[k]
                })
                .collect();
            let (v, t) = self.sums(&right);
            let mut right = (v + &rest).push(t - (1.0 - rest_of_t));
            equations.solve(&mut right);
            let (v, t) = (right.rows(0, n).into_owned(), right[n]);
            let left = self.left(&v, t);
            let slack: Vec<f64> = (0..product.len())
                .map(|k| left[k] - (self.slack[k] + missing[k]))
                .collect();
            let multiplier = (0..product.len())
                .map(|k| (product[k] - self.multiplier[k] * slack[k]) / self.slack[k])
                .collect();
            Step {
                v,
                t,
                slack,
                multiplier,
            }
        };
        let products: Vec<f64> = pairs()
            .map(|(slack, multiplier)| -slack * multiplier)
            .collect();
        let count = products.len() as f64;
        let mean = -products.iter().sum::<f64>() / count;
        let straight = solve(&products);
        let [far, far_of_multipliers] = self.reach(&straight).map(|far| far.min(1.0));
        let after = pairs()
            .zip(straight.slack.iter().zip(&straight.multiplier))
            .map(|((s, z), (ds, dz))| (s + far * ds) * (z + far_of_multipliers * dz))
            .sum::<f64>()
            / count;
        let central = (after / mean).powi(3) * mean;
        let curved: Vec<f64> = products
            .iter()
            .zip(straight.slack.iter().zip(&straight.multiplier))
            .map(|(product, (ds, dz))| central + product - ds * dz)
            .collect();
        let step = solve(&curved);
        let [far, far_of_multipliers] = self.reach(&step).map(|far| (PART * far).min(1.0));
        self.v.axpy(far, &step.v, 1.0);
        self.t += far * step.t;
        for (slack, more) in self.slack.iter_mut().zip(step.slack) {
            *slack += far * more;
        }
        for (multiplier, more) in self.multiplier.iter_mut().zip(step.multiplier) {
            *multiplier += far_of_multipliers * more;
        }
        self.slack
            .iter()
            .chain(&self.multiplier)
            .all(|&value| value > 0.0 && value.is_finite())
    }

    /// The part of a step up to which no slack, and no multiplier, is negative.
    fn reach(&self, step: &Step) -> [f64; 2] {
        let far = |values: &[f64], steps: &[f64]| {
            let pairs = values.iter().zip(steps).filter(|(_, step)| **step < 0.0);
            pairs.fold(1.0 / PART, |far: f64, (value, step)| far.min(-value / step))
        };
        [
            far(&self.slack, &step.slack),
            far(&self.multiplier, &step.multiplier),
        ]
    }

    /// Currents at this step, and how good they are.
    fn here(&self) -> Centre {
        let interior = self.interior;
        let scaled = interior.scaled;
        let [limits, points] = self.counts();
        let mut x = match self.turned {
            None => self.v.clone(),
            Some(turned) => &turned.currents * &self.v,
        };
        for (x, unit) in x.iter_mut().zip(&interior.units) {
            *x *= unit;
        }
        let currents_a = scaled.nearest_a(x.as_slice());
        let points_of_pool = interior.pool.points();
        let problem = ForceProblem {
            forces_n_per_a: points_of_pool.forces_n_per_a,
            height_m: points_of_pool.height_m,
            offset_n: points_of_pool.offset_n,
            weights: None,
            ..*scaled.problem
        };
        let lambda_n_per_m = times_power(self.lambda, scaled.lambda_unit());
        let worst_n = worst_error_n(&problem, lambda_n_per_m, &currents_a);
        let worst = times_power(worst_n, -scaled.force_unit());
        let share: f64 = self.multiplier[limits..].iter().sum();
        let (weak, strong) = self.multiplier[limits..].split_at(points);
        let active: Vec<ActivePoint> = weak
            .iter()
            .zip(strong)
            .enumerate()
            .map(|(place, (weak, strong))| ActivePoint {
                point: interior.pool.point(place),
                multiplier: (weak - strong) / share,
            })
            .filter(|active| active.multiplier.abs() > NO_SHARE)
            .collect();
        let bound_n = lower_bound_n(
            &scaled.near(&currents_a).problem(scaled.problem),
            lambda_n_per_m,
            &active,
        );
        // As the bound does, so that both are of one line.
        let shares: f64 = active.iter().map(|active| active.multiplier.abs()).sum();
        let heights = active.iter();
        let slope: f64 = heights
            .map(|a| a.multiplier / shares * scaled.height_of(a.point))
            .sum();
        Centre {
            currents_a,
            worst,
            size: self.size,
            slope,
            gap: (worst - times_power(bound_n, -scaled.force_unit())).max(0.0),
            active,
            free: self.free(),
        }
    }

    /// The live coils that no limit holds: their slack is a larger part of their room than the force that their
    /// multiplier times that room is of the largest.
    fn free(&self) -> Vec<usize> {
        let mut free = vec![true; self.interior.scaled.live.len()];
        for (k, limit) in self.interior.limits.iter().enumerate() {
            if let Some(current) = limit.current {
                let held = self.multiplier[k] * limit.room.powi(2) > self.slack[k] * self.size;
                free[current] &= !held;
            }
        }
        (0..free.len()).filter(|&k| free[k]).collect()
    }
}

/// Factored equations of a step.
struct Equations {
    matrix: DMatrix<f64>,
    scale: Vec<f64>,
    factor: Cholesky<f64, nalgebra::Dyn>,
}

impl Equations {
    /// `None` where they are not finite, or rounding has made them too indefinite.
    fn new(matrix: DMatrix<f64>) -> Option<Self> {
        let scale: Vec<f64> = matrix
            .diagonal()
            .iter()
            .map(|d| if *d > 0.0 { 1.0 / d.sqrt() } else { 1.0 })
            .collect();
        let factor = [REGULAR, MORE_REGULAR].into_iter().find_map(|more| {
            let mut scaled = matrix.clone();
            for (j, mut column) in scaled.column_iter_mut().enumerate() {
                for (entry, scale_i) in column.iter_mut().zip(&scale) {
                    *entry *= scale_i * scale[j];
                }
                column[j] += more;
            }
            Cholesky::new(scaled)
        })?;
        Some(Self {
            matrix,
            scale,
            factor,
        })
    }

    fn rough(&self, right: &DVector<f64>) -> DVector<f64> {
        let mut scaled = right.clone();
        for (value, scale) in scaled.iter_mut().zip(&self.scale) {
            *value *= scale;
        }
        self.factor.solve_mut(&mut scaled);
        for (value, scale) in scaled.iter_mut().zip(&self.scale) {
            *value *= scale;
        }
        scaled
    }

    /// Replaces the right side by the solution, corrected once.
    fn solve(&self, right: &mut DVector<f64>) {
        let first = self.rough(right);
        let mut rest = right.clone();
        rest.gemv(-1.0, &self.matrix, &first, 1.0);
        *right = first + self.rough(&rest);
    }
}
