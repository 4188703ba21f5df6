//! The allocation of eq. 8 with all three components of the force: at one position, the currents of
//! least power that give a requested force vector.
//!
//! With force per ampere `G_ki` along x, y and z, resistance `R_i` and limits `l_i <= 0 <= u_i`:
//!
//! ```text
//! minimise  sum R_i I_i^2   subject to  G I = f,  l_i <= I_i <= u_i,  sum I_i <= I_t.
//! ```
//!
//! The problem is strictly convex with three or four multipliers, however many coils there are:
//! `I_i = clamp((G_i . mu - nu) / R_i)`. The dual is concave and piecewise quadratic; Newton steps
//! with an exact line search climb it. It is bounded only where `f` is within reach, so what is
//! climbed is the dual of
//!
//! ```text
//! minimise  sum R_i I_i^2 / 2 + |w (G I - f)|^2 / (2 eps),   w = (s, s, 1),
//! ```
//!
//! bounded for every `f` and continuous in it; `eps` is far below what decides which coils are at a
//! limit. With those known, the remaining currents are solved again without `eps`: exactly, or where
//! `f` is out of reach as those of the nearest force in the norm `|w (G I - f)|`. The conditions of
//! optimality are checked; where they fail, `eps` was too large and becomes smaller. Beside directions in which the
//! coils give much, those in which they give little need one below all rounding: if nothing is proven, the same is
//! solved in coordinates in which they give alike in every direction. What is exact in one is so in the other.
//!
//! Nothing is allocated on the heap after [`VectorAllocator::new`].

use super::allocation::{Allocator, AllocatorError, Reach};

/// Out of reach a sideways error counts as this share of a vertical one: vertical first.
pub const SIDEWAYS_WEIGHT: f64 = 0.1;

/// `eps` relative to the sum of `|w G_i|^2 / R_i`, first and smallest, and the factor between.
const EPS_FIRST: f64 = 1e-7;
const EPS_LEAST: f64 = 1e-14;
const EPS_FACTOR: f64 = 1e-3;
/// `eps` of the currents' sum relative to that of the force: the limit comes before the force. Divided by how many
/// times the force is what all limits reach, since the multipliers grow with it.
const EPS_SUM: f64 = 1e-6;
/// Newton steps for one `eps`, at most; each changes which coils are at a limit, so few are needed.
const STEPS: usize = 60;
/// Share of the slope that a full step may leave without a search along it.
const SLOPE_LEFT: f64 = 0.1;
/// Force errors, bounds and multipliers below this share of the terms they are sums of are met.
pub const MET: f64 = 1e-11;
/// Corrections of the multipliers; each takes seven digits off what `eps` changed.
const REFINEMENTS: usize = 3;
/// Pulls below this share of the missing force are none.
const PULL: f64 = 1e-9;
/// Residuals up to this share of the terms they are sums of are rounding.
const ROUNDING: f64 = 1e-14;
/// Pivots below this share of the largest make a system singular.
const PIVOT: f64 = 1e-13;
/// Forces are along an axis of their own from this part of the largest on.
const SPANNED: f64 = 1e-6;

/// Rows of the dual: the force's components, then the sum.
type Rows = [f64; 4];

/// Limits and resistances of an array, and room to work in.
#[derive(Debug, Clone)]
pub struct VectorAllocator {
    limits: Allocator,
    weights: [f64; 3],
    /// 1 / R_i over the largest.
    conductance: Vec<f64>,
    /// Weighted force per ampere over the largest, then 1 for the sum.
    rows: Vec<Rows>,
    currents: Vec<f64>,
    at: Vec<Limit>,
    order: Vec<(f64, f64)>,
}

/// Where a coil's current is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Limit {
    Lower,
    Free,
    Upper,
}

/// The result of one allocation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VectorAllocation {
    /// Whether the requested force was within reach.
    pub reach: Reach,
    /// The force that the currents give, N.
    pub force_n: [f64; 3],
    /// Whether the conditions of optimality were met to 1e-11.
    pub proven: bool,
}

/// Sums at a place of the dual.
struct Place {
    slope: Rows,
    curvature: [Rows; 4],
    changed: bool,
}

impl VectorAllocator {
    /// For coils with these resistances (ohm) and limits (A), and a limit of the currents' sum (A).
    /// Out of reach a sideways error counts as `sideways_weight` (> 0) of the same vertical one.
    ///
    /// # Errors
    /// Domain: as [`Allocator::new`].
    pub fn new(
        resistance_ohm: &[f64],
        lower_a: &[f64],
        upper_a: &[f64],
        total_a: Option<f64>,
        sideways_weight: f64,
    ) -> Result<Self, AllocatorError> {
        let limits = Allocator::new(resistance_ohm, lower_a, upper_a, total_a)?;
        let least = resistance_ohm.iter().copied().fold(f64::INFINITY, f64::min);
        let coils = resistance_ohm.len();
        Ok(Self {
            limits,
            weights: [sideways_weight, sideways_weight, 1.0],
            conductance: resistance_ohm.iter().map(|r| least / r).collect(),
            rows: vec![[0.0; 4]; coils],
            currents: vec![0.0; coils],
            at: vec![Limit::Free; coils],
            order: Vec::with_capacity(2 * coils),
        })
    }

    /// Number of coils.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.rows.len()
    }

    /// Writes the currents (A) of least power that give `requested_n`, or the nearest force within
    /// the limits, for the forces per ampere given, [coil][x, y, z] (N/A, finite). A request that
    /// is not finite is out of reach, and no current flows.
    ///
    /// Error: the force is met and the sum held within 1e-11 of the sums of their terms' sizes.
    ///
    /// # Panics
    /// When a slice is shorter than the array.
    pub fn allocate(
        &mut self,
        force_n_per_a: &[[f64; 3]],
        requested_n: [f64; 3],
        currents_a: &mut [f64],
    ) -> VectorAllocation {
        let coils = self.rows.len();
        let (given, out) = (&force_n_per_a[..coils], &mut currents_a[..coils]);
        let largest = given
            .as_flattened()
            .iter()
            .fold(0.0_f64, |m, g| m.max(g.abs()));
        let inverse = 1.0 / largest;
        let nothing = requested_n == [0.0; 3];
        if nothing || requested_n.iter().any(|f| !f.is_finite()) || !inverse.is_finite() {
            out.fill(0.0);
            let reach = if nothing {
                Reach::Reached
            } else {
                Reach::Saturated
            };
            return VectorAllocation {
                reach,
                force_n: [0.0; 3],
                proven: true,
            };
        }
        let weighted = |v: [f64; 3]| -> Rows {
            let w = &self.weights;
            [
                v[0] * w[0] * inverse,
                v[1] * w[1] * inverse,
                v[2] * w[2] * inverse,
                0.0,
            ]
        };
        for (row, g) in self.rows.iter_mut().zip(given) {
            *row = weighted(*g);
            row[3] = 1.0;
        }
        let mut target = weighted(requested_n);
        target[3] = self.limits.total_a();
        let (mut reach, mut proven) = self.solve(&target);
        out.copy_from_slice(&self.currents);
        if !proven && self.even_out(&mut target) && self.solve(&target) == (Reach::Reached, true) {
            out.copy_from_slice(&self.currents);
            (reach, proven) = (Reach::Reached, true);
        }
        let mut force_n = [0.0; 3];
        for (g, i) in given.iter().zip(&*out) {
            for (sum, part) in force_n.iter_mut().zip(g) {
                *sum += part * i;
            }
        }
        VectorAllocation {
            reach,
            force_n,
            proven,
        }
    }

    /// Changes rows and target to [`EvenAxes`]; whether there are any.
    fn even_out(&mut self, target: &mut Rows) -> bool {
        let coils = self.rows.iter().zip(&self.conductance);
        let Some(axes) = EvenAxes::new(coils.map(|([x, y, z, _], c)| ([*x, *y, *z], *c))) else {
            return false;
        };
        for row in self.rows.iter_mut().chain([target]) {
            let [x, y, z, sum] = *row;
            let [x, y, z] = axes.of([x, y, z]);
            *row = [x, y, z, sum];
        }
        true
    }

    /// Leaves the solution in `self.currents`.
    fn solve(&mut self, target: &Rows) -> (Reach, bool) {
        let size: f64 = self
            .rows
            .iter()
            .zip(&self.conductance)
            .map(|(h, c)| c * dot(h, h, 3))
            .sum();
        let within_reach = (self.most() / dot(target, target, 3).sqrt()).min(1.0);
        let of_sum = EPS_SUM * within_reach * self.conductance.iter().sum::<f64>();
        let mut y = [0.0; 4];
        let mut share = EPS_FIRST;
        loop {
            let eps = [share * size, share * size, share * size, share * of_sum];
            let mut rows = 3;
            y[3] = 0.0;
            self.climb(&mut y, rows, target, &eps);
            if self.currents.iter().sum::<f64>() > target[3] {
                rows = 4;
                self.climb(&mut y, rows, target, &eps);
            }
            if self.finish_exactly(&y, rows, target, &eps) {
                return (Reach::Reached, true);
            }
            if self.finish_nearest(rows, target) {
                return (self.reach(target), true);
            }
            if share * EPS_FACTOR < EPS_LEAST {
                self.fill(&y, rows);
                self.lower_to(target[3]);
                return (self.reach(target), false);
            }
            share *= EPS_FACTOR;
        }
    }

    /// A bound of every force within the limits, in the rows' norm.
    fn most(&self) -> f64 {
        let coils = self.rows.iter().enumerate();
        coils
            .map(|(i, h)| {
                let (lower, upper) = self.limits.limits_a(i);
                dot(h, h, 3).sqrt() * upper.max(-lower)
            })
            .sum()
    }

    /// Brings all currents nearer to their lower limits, by the same share, until their sum is `total_a` at most.
    fn lower_to(&mut self, total_a: f64) {
        let least: f64 = (0..self.coils()).map(|i| self.limits.limits_a(i).0).sum();
        let sum: f64 = self.currents.iter().sum();
        if sum > total_a {
            let share = (total_a - least) / (sum - least);
            for (i, current) in self.currents.iter_mut().enumerate() {
                let (lower, _) = self.limits.limits_a(i);
                *current = lower + share * (*current - lower);
            }
        }
    }

    fn reach(&self, target: &Rows) -> Reach {
        let (left, size) = self.left(target);
        if dot(&left, &left, 3).sqrt() <= MET * size {
            Reach::Reached
        } else {
            Reach::Saturated
        }
    }

    /// Force that is missing, and the size of the terms it is a sum of.
    fn left(&self, target: &Rows) -> (Rows, f64) {
        let (mut left, mut size) = (*target, dot(target, target, 3).sqrt());
        for (h, i) in self.rows.iter().zip(&self.currents) {
            for k in 0..4 {
                left[k] -= h[k] * i;
            }
            size += dot(h, h, 3).sqrt() * i.abs();
        }
        (left, size)
    }

    /// Newton's steps to the top of the dual; leaves currents and limits of that place.
    fn climb(&mut self, y: &mut Rows, rows: usize, target: &Rows, eps: &Rows) {
        // At the start no coil carries current: all of them count as free.
        let start = y[..rows].iter().all(|v| *v == 0.0);
        let mut place = self.place(y, rows, target, eps, start);
        for _ in 0..STEPS {
            let Some(step) = cholesky_solve(&place.curvature, &place.slope, rows, 0.0) else {
                break;
            };
            let uphill = dot(&step, &place.slope, rows);
            if uphill <= 0.0 || !uphill.is_finite() {
                break;
            }
            let moved = |length: f64| -> Rows { std::array::from_fn(|k| y[k] + length * step[k]) };
            let next = moved(1.0);
            let there = self.place(&next, rows, target, eps, false);
            let rest = dot(&step, &there.slope, rows);
            if rest.abs() <= SLOPE_LEFT * uphill {
                *y = next;
                place = there;
                if !place.changed {
                    break;
                }
                continue;
            }
            let length = self.top_along(y, &step, rows, target, eps);
            *y = moved(length);
            place = self.place(y, rows, target, eps, false);
        }
    }

    /// Currents, slope and curvature of the dual at `y`.
    fn place(&mut self, y: &Rows, rows: usize, target: &Rows, eps: &Rows, all_free: bool) -> Place {
        let mut slope: Rows = std::array::from_fn(|k| target[k] - eps[k] * y[k]);
        let mut curvature = [[0.0; 4]; 4];
        for (k, row) in curvature.iter_mut().enumerate() {
            row[k] = eps[k];
        }
        let mut changed = all_free;
        let coils = self.rows.iter().zip(&self.conductance).enumerate();
        for (i, (h, c)) in coils {
            let (lower, upper) = self.limits.limits_a(i);
            let alone = c * dot(h, y, rows);
            let (at, current) = if all_free || (alone > lower && alone < upper) {
                (Limit::Free, alone)
            } else if alone <= lower {
                (Limit::Lower, lower)
            } else {
                (Limit::Upper, upper)
            };
            changed |= at != self.at[i];
            self.at[i] = at;
            self.currents[i] = current;
            for k in 0..rows {
                slope[k] -= h[k] * current;
            }
            if at == Limit::Free {
                for k in 0..rows {
                    for l in 0..=k {
                        curvature[k][l] += c * h[k] * h[l];
                    }
                }
            }
        }
        Place {
            slope,
            curvature,
            changed,
        }
    }

    fn fill(&mut self, y: &Rows, rows: usize) {
        for i in 0..self.rows.len() {
            let (lower, upper) = self.limits.limits_a(i);
            let alone = self.conductance[i] * dot(&self.rows[i], y, rows);
            self.currents[i] = alone.clamp(lower, upper);
        }
    }

    /// Where the dual is highest along `step` from `y`: its slope falls piecewise linearly.
    fn top_along(&mut self, y: &Rows, step: &Rows, rows: usize, target: &Rows, eps: &Rows) -> f64 {
        let (mut slope, mut fall) = (0.0, 0.0);
        for k in 0..rows {
            slope += step[k] * (target[k] - eps[k] * y[k]);
            fall += eps[k] * step[k] * step[k];
        }
        self.order.clear();
        for (i, (h, c)) in self.rows.iter().zip(&self.conductance).enumerate() {
            let (lower, upper) = self.limits.limits_a(i);
            let (alone, per_step) = (c * dot(h, y, rows), dot(h, step, rows));
            slope -= per_step * alone.clamp(lower, upper);
            let speed = c * per_step;
            if speed == 0.0 {
                continue;
            }
            let (near, far) = if speed > 0.0 {
                (lower, upper)
            } else {
                (upper, lower)
            };
            // It moves from where it leaves the near limit to where it meets the far one.
            let (leaves, meets) = ((near - alone) / speed, (far - alone) / speed);
            if meets <= 0.0 {
                continue;
            }
            let bend = speed * per_step;
            if leaves <= 0.0 {
                fall += bend;
            } else {
                self.order.push((leaves, bend));
            }
            self.order.push((meets, -bend));
        }
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut from = 0.0;
        for &(to, bend) in &self.order {
            if slope <= fall * (to - from) {
                break;
            }
            slope -= fall * (to - from);
            fall += bend;
            from = to;
        }
        if fall > 0.0 {
            from + slope / fall
        } else {
            from
        }
    }

    /// Solves the free currents for the requested force without `eps`; whether that is optimal. Where
    /// the free coils span no three directions, the multipliers of the rest stay those of the climb.
    fn finish_exactly(&mut self, climbed: &Rows, rows: usize, target: &Rows, eps: &Rows) -> bool {
        let mut system = [[0.0; 4]; 4];
        let mut right = *target;
        for i in 0..self.rows.len() {
            let h = self.rows[i];
            for k in 0..rows {
                if self.at[i] == Limit::Free {
                    for l in 0..rows {
                        system[k][l] += self.conductance[i] * h[k] * h[l];
                    }
                } else {
                    right[k] -= h[k] * self.currents[i];
                }
            }
        }
        let mut damped = system;
        for k in 0..rows {
            damped[k][k] += eps[k];
        }
        let mut y = *climbed;
        for _ in 0..REFINEMENTS {
            let left = std::array::from_fn(|k| right[k] - dot(&system[k], &y, rows));
            let Some(step) = cholesky_solve(&damped, &left, rows, 0.0) else {
                return false;
            };
            y = std::array::from_fn(|k| y[k] + step[k]);
        }
        if rows == 4 && y[3] > MET * self.pressure_size(&y) {
            return false;
        }
        for i in 0..self.rows.len() {
            let (lower, upper) = self.limits.limits_a(i);
            let alone = self.conductance[i] * dot(&self.rows[i], &y, rows);
            let slack = MET * (self.conductance[i] * self.pressure_size(&y)).max(upper - lower);
            let optimal = match self.at[i] {
                Limit::Lower => alone <= lower + slack,
                Limit::Free => alone >= lower - slack && alone <= upper + slack,
                Limit::Upper => alone >= upper - slack,
            };
            if !optimal {
                return false;
            }
            if self.at[i] == Limit::Free {
                self.currents[i] = alone.clamp(lower, upper);
            }
        }
        let (left, size) = self.left(target);
        let sum: f64 = self.currents.iter().sum();
        let terms: f64 = self.currents.iter().map(|i| i.abs()).sum();
        dot(&left, &left, 3).sqrt() <= MET * size && sum <= target[3] + MET * terms
    }

    fn pressure_size(&self, y: &Rows) -> f64 {
        y.iter().map(|v| v.abs()).sum()
    }

    /// Solves the free currents for the nearest force, of several by the least power; whether no other currents
    /// within the limits come nearer. Where the sum binds they share what the others leave of it, and a coil
    /// counts by how much its force differs from their mean.
    fn finish_nearest(&mut self, rows: usize, target: &Rows) -> bool {
        let mut mean = [0.0; 4];
        for i in 0..self.at.len() {
            if self.at[i] == Limit::Free {
                self.currents[i] = 0.0;
                for (part, h) in mean.iter_mut().zip(&self.rows[i]) {
                    *part += self.conductance[i] * h;
                }
            }
        }
        let (left, _) = self.left(target);
        let shares = rows == 4 && mean[3] > 0.0;
        let (mean, sum_a, conductance) = match shares {
            true => (mean.map(|part| part / mean[3]), left[3], mean[3]),
            false => ([0.0; 4], 0.0, 1.0),
        };
        let more = |i: usize| -> Rows { std::array::from_fn(|k| self.rows[i][k] - mean[k]) };
        let right: Rows = std::array::from_fn(|k| left[k] - mean[k] * sum_a);
        let free = || (0..self.at.len()).filter(|i| self.at[*i] == Limit::Free);
        let by_power = |i: usize, force: Rows| force.map(|part| part * self.conductance[i].sqrt());
        let sizes = free().map(|i| size(&by_power(i, self.rows[i])));
        let least = SPANNED * sizes.fold(0.0, f64::max);
        let axes = spanned(|| free().map(|i| by_power(i, more(i))), least);
        let mut system = [[0.0; 4]; 4];
        let mut projected = [0.0; 4];
        for (a, of_a) in axes.iter().enumerate() {
            projected[a] = dot(of_a, &right, 3);
            for (b, of_b) in axes[..=a].iter().enumerate() {
                let along = |i: usize| dot(of_a, &more(i), 3) * dot(of_b, &more(i), 3);
                system[a][b] = free().map(|i| self.conductance[i] * along(i)).sum();
            }
        }
        let Some(solved) = cholesky_solve(&system, &projected, axes.len(), PIVOT) else {
            return false;
        };
        let y: Rows = std::array::from_fn(|k| {
            axes.iter()
                .zip(&solved)
                .map(|(axis, part)| axis[k] * part)
                .sum()
        });
        for i in 0..self.at.len() {
            if self.at[i] != Limit::Free {
                continue;
            }
            let current = self.conductance[i] * (sum_a / conductance + dot(&more(i), &y, 3));
            let (lower, upper) = self.limits.limits_a(i);
            let slack = MET * (upper - lower);
            if !(current >= lower - slack && current <= upper + slack) {
                return false;
            }
            self.currents[i] = current.clamp(lower, upper);
        }
        self.nearest(rows, target)
    }

    /// Whether no currents within the limits come nearer: what is missing pulls every coil against
    /// the limit it is at, the sum's included.
    fn nearest(&self, rows: usize, target: &Rows) -> bool {
        let (left, size) = self.left(target);
        let missing = dot(&left, &left, 3).sqrt();
        if missing <= MET * size {
            return false;
        }
        let slack = PULL * missing + ROUNDING * size;
        let pull = |i: usize| dot(&self.rows[i], &left, 3);
        let mut threshold = 0.0;
        if rows == 4 {
            let free = (0..self.rows.len()).filter(|i| self.at[*i] == Limit::Free);
            let Some(price) = free.map(pull).reduce(f64::max) else {
                return false;
            };
            if price < -slack {
                return false;
            }
            threshold = price;
        } else if self.currents.iter().sum::<f64>() > target[3] * (1.0 + MET) {
            return false;
        }
        (0..self.rows.len()).all(|i| match self.at[i] {
            Limit::Lower => pull(i) <= threshold + slack,
            Limit::Free => (pull(i) - threshold).abs() <= slack,
            Limit::Upper => pull(i) >= threshold - slack,
        })
    }
}

/// Orthonormal axes of the space that forces span, the longest first; no axis for what is no longer than `least`.
fn spanned<I: Iterator<Item = Rows>>(forces: impl Fn() -> I, least: f64) -> Vec<Rows> {
    let mut axes: Vec<Rows> = Vec::with_capacity(3);
    while axes.len() < 3 {
        let rest = |force: Rows| {
            axes.iter().fold(force, |rest, axis| {
                let along = dot(&rest, axis, 3);
                std::array::from_fn(|k| rest[k] - along * axis[k])
            })
        };
        let rests = forces().map(rest);
        match rests.max_by(|a, b| size(a).total_cmp(&size(b))) {
            Some(longest) if size(&longest) > least => {
                let length = size(&longest);
                axes.push(longest.map(|part| part / length));
            }
            _ => break,
        }
    }
    axes
}

/// Of a force.
fn size(force: &Rows) -> f64 {
    dot(force, force, 3).sqrt()
}

fn dot(a: &Rows, b: &Rows, rows: usize) -> f64 {
    (0..rows).map(|k| a[k] * b[k]).sum()
}

/// Coordinates of forces in which coils without limits give alike in every direction for the same power.
pub(crate) struct EvenAxes(Factor);

impl EvenAxes {
    /// For coils of these forces per ampere and conductances; `None` where they give nothing in a direction, or nearly.
    pub(crate) fn new(coils: impl IntoIterator<Item = ([f64; 3], f64)>) -> Option<Self> {
        let mut product = [[0.0; 4]; 4];
        for (force, conductance) in coils {
            for k in 0..3 {
                for l in 0..=k {
                    product[k][l] += conductance * force[k] * force[l];
                }
            }
        }
        // An axis along which no coil gives anything stays as it is.
        for (k, row) in product.iter_mut().enumerate() {
            if row[k] == 0.0 {
                row[k] = 1.0;
            }
        }
        Factor::new(&product, 3, PIVOT).map(Self)
    }

    /// A force in them.
    pub(crate) fn of(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let [x, y, z, _] = self.0.forward(&[x, y, z, 0.0], 3);
        [x, y, z]
    }
}

/// Solves a symmetric positive definite system of `n` rows whose lower triangle is given; `None`
/// where a pivot is at most `least` of its diagonal entry.
fn cholesky_solve(lower: &[Rows; 4], right: &Rows, n: usize, least: f64) -> Option<Rows> {
    let factor = Factor::new(lower, n, least)?;
    Some(factor.backward(&factor.forward(right, n), n))
}

/// `S L` of a matrix `S L L' S` with the diagonal matrix `S` and the lower triangle `L`.
struct Factor {
    scale: Rows,
    l: [Rows; 4],
}

impl Factor {
    /// Of a matrix of `n` rows whose lower triangle is given; `None` where a pivot is at most `least` of its
    /// diagonal entry.
    fn new(lower: &[Rows; 4], n: usize, least: f64) -> Option<Self> {
        let mut l = *lower;
        let scale: Rows = std::array::from_fn(|k| if k < n { l[k][k].sqrt() } else { 1.0 });
        if scale[..n].iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return None;
        }
        for a in 0..n {
            for b in 0..=a {
                let mut value = l[a][b] / (scale[a] * scale[b]);
                value -= dot(&l[a], &l[b], b);
                if a == b {
                    if value <= least {
                        return None;
                    }
                    l[a][a] = value.sqrt();
                } else {
                    l[a][b] = value / l[b][b];
                }
            }
        }
        Some(Self { scale, l })
    }

    /// `(S L)^-1 right`.
    fn forward(&self, right: &Rows, n: usize) -> Rows {
        let mut x = [0.0; 4];
        for a in 0..n {
            let known: f64 = (0..a).map(|k| self.l[a][k] * x[k]).sum();
            x[a] = (right[a] / self.scale[a] - known) / self.l[a][a];
        }
        x
    }

    /// `(L' S)^-1 right`.
    fn backward(&self, right: &Rows, n: usize) -> Rows {
        let mut x = *right;
        for a in (0..n).rev() {
            let known: f64 = (a + 1..n).map(|k| self.l[k][a] * x[k]).sum();
            x[a] = (x[a] - known) / self.l[a][a];
        }
        for (part, scale) in x.iter_mut().zip(&self.scale).take(n) {
            *part /= scale;
        }
        x
    }
}
