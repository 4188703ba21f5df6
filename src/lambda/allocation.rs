//! The allocation of eq. 8: at one position, the currents of least power that give a requested force.
//!
//! With force per ampere `G_i`, resistance `R_i` and limits `l_i <= 0 <= u_i`:
//!
//! ```text
//! minimise  sum R_i I_i^2   subject to  sum G_i I_i = f,  l_i <= I_i <= u_i,  sum I_i <= I_t.
//! ```
//!
//! Without the last limit one multiplier decides, `I_i = clamp(mu G_i / R_i)`: coils leave for their
//! limits in the order of `b_i R_i / G_i`, so sorting gives the solution in closed form. Where the
//! sum binds there is a second multiplier, searched outside the sort: the sum falls with it,
//! piecewise linearly, and a step that lands on the right piece ends the search. A force beyond
//! reach is answered by the nearest one, a fractional knapsack, and among its currents by those of
//! least power.
//!
//! Nothing is allocated on the heap after [`Allocator::new`].

/// Residuals up to this share of the terms they are sums of are rounding.
const ROUNDING: f64 = 1e-14;
/// Forces per ampere that differ by no more than this share of the largest count as equal where
/// only the largest force is requested.
const TIED: f64 = 1e-13;
/// Forces per ampere below this share of the largest are none.
const NOTHING: f64 = 1e-60;
/// An end of a piece that is so many times farther than what is searched takes its digits.
const FAR: f64 = 1e3;
/// Steps of the search for the second multiplier.
const STEPS: usize = 120;

/// Limits and resistances of an array, and room to work in.
#[derive(Debug, Clone)]
pub struct Allocator {
    lower_a: Vec<f64>,
    upper_a: Vec<f64>,
    resistance_ohm: Vec<f64>,
    conductance_s: Vec<f64>,
    /// Infinite where there is no such limit.
    total_a: f64,
    /// Force per ampere, over the largest and turned so that the requested force is upward.
    row: Vec<f64>,
    /// Coefficients of a second row.
    ones: Vec<f64>,
    order: Vec<(f64, usize)>,
    tail: Vec<f64>,
}

/// Whether the requested force was within reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// The currents give it.
    Reached,
    /// The currents give the nearest force that the limits allow.
    Saturated,
}

/// Multipliers that prove an allocation: `I_i = clamp(mu (G_i - center) / R_i + nu / R_i)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocation {
    /// Whether the requested force was within reach.
    pub reach: Reach,
    /// sum G_i I_i, N.
    pub force_n: f64,
    /// Multiplier of the force, ohm A^2/N; infinite at the largest force the limits allow.
    pub mu: f64,
    /// N/A; with `mu` infinite the threshold above which coils carry their most.
    pub center_n_per_a: f64,
    /// V; without a binding sum 0.
    pub nu_v: f64,
}

/// Why an allocator cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AllocatorError {
    /// Lists of different lengths.
    #[error("resistances and both limits must have one entry a coil")]
    Lengths,
    /// A coil's values.
    #[error(
        "coil {coil}: expected a resistance above 0 and limits with lower <= 0 <= upper, all finite"
    )]
    Coil {
        /// Its index.
        coil: usize,
    },
    /// The limit of the sum.
    #[error("the limit of the currents' sum must be 0 or more")]
    Total,
}

impl Allocator {
    /// For coils with these resistances (ohm) and limits (A), and a limit of the currents' sum (A).
    ///
    /// # Errors
    /// Domain: resistances above 0, lower <= 0 <= upper, total >= 0, all finite.
    pub fn new(
        resistance_ohm: &[f64],
        lower_a: &[f64],
        upper_a: &[f64],
        total_a: Option<f64>,
    ) -> Result<Self, AllocatorError> {
        let coils = resistance_ohm.len();
        if lower_a.len() != coils || upper_a.len() != coils {
            return Err(AllocatorError::Lengths);
        }
        for coil in 0..coils {
            let (r, l, u) = (resistance_ohm[coil], lower_a[coil], upper_a[coil]);
            let sound = r > 0.0 && l <= 0.0 && u >= 0.0;
            if !(sound && r.is_finite() && (1.0 / r).is_finite() && (u - l).is_finite()) {
                return Err(AllocatorError::Coil { coil });
            }
        }
        if total_a.is_some_and(|total| !(total >= 0.0 && total.is_finite())) {
            return Err(AllocatorError::Total);
        }
        Ok(Self {
            lower_a: lower_a.to_vec(),
            upper_a: upper_a.to_vec(),
            conductance_s: resistance_ohm.iter().map(|r| 1.0 / r).collect(),
            resistance_ohm: resistance_ohm.to_vec(),
            total_a: total_a.unwrap_or(f64::INFINITY),
            row: vec![0.0; coils],
            ones: vec![0.0; coils],
            order: Vec::with_capacity(2 * coils),
            tail: vec![0.0; coils],
        })
    }

    /// Lower and upper limit of a coil, A.
    pub(super) fn limits_a(&self, coil: usize) -> (f64, f64) {
        (self.lower_a[coil], self.upper_a[coil])
    }

    /// Limit of the currents' sum, A; infinite without one.
    pub(super) fn total_a(&self) -> f64 {
        self.total_a
    }

    /// Number of coils.
    #[must_use]
    pub fn coils(&self) -> usize {
        self.row.len()
    }

    /// Writes the currents (A) of least power whose force is `wanted_n`, or the nearest within the
    /// limits, for the forces per ampere given (N/A, finite). What is not a number is beyond reach, and
    /// no current flows.
    ///
    /// Error: the force is met and the sum kept within 1e-14 of the sums of their terms' sizes;
    /// [`Allocator::certificate`] measures it.
    ///
    /// # Panics
    /// When a slice is shorter than the array.
    pub fn allocate(
        &mut self,
        force_n_per_a: &[f64],
        wanted_n: f64,
        currents_a: &mut [f64],
    ) -> Allocation {
        let coils = self.coils();
        let (given, currents) = (&force_n_per_a[..coils], &mut currents_a[..coils]);
        let largest = given.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        let scale = if wanted_n < 0.0 { -largest } else { largest };
        let inverse = 1.0 / scale;
        if wanted_n == 0.0 || wanted_n.is_nan() || !inverse.is_finite() {
            currents.fill(0.0);
            let reach = if wanted_n == 0.0 {
                Reach::Reached
            } else {
                Reach::Saturated
            };
            return Allocation {
                reach,
                force_n: 0.0,
                mu: 0.0,
                center_n_per_a: 0.0,
                nu_v: 0.0,
            };
        }
        for (row, g) in self.row.iter_mut().zip(given) {
            *row = g * inverse;
            if row.abs() < NOTHING {
                *row = 0.0;
            }
        }
        let found = self.in_row(wanted_n * inverse, currents);
        let force_n = given.iter().zip(&*currents).map(|(g, i)| g * i).sum();
        Allocation {
            reach: found.reach,
            force_n,
            mu: found.mu * inverse,
            center_n_per_a: found.center * scale,
            nu_v: found.nu,
        }
    }

    /// The allocation for `self.row` and a target above 0.
    fn in_row(&mut self, target: f64, currents: &mut [f64]) -> RowSolution {
        if let Some(mu) = self.sorted(Row::Force, target) {
            let sum = self.fill(Multipliers::of_force(mu), currents).sum;
            if sum <= self.total_a {
                return RowSolution::reached(Multipliers::of_force(mu));
            }
        }
        let (most, threshold) = self.most(currents);
        if target >= most * (1.0 - ROUNDING) {
            let beyond = target > most * (1.0 + ROUNDING);
            return RowSolution {
                reach: if beyond {
                    Reach::Saturated
                } else {
                    Reach::Reached
                },
                mu: f64::INFINITY,
                center: threshold,
                nu: 0.0,
            };
        }
        let (found, fault) = self.with_sum(target, currents);
        // Within rounding of the largest force no piece may be found: then that force is nearer.
        if fault > 1.0 - target / most {
            self.most(currents);
            return RowSolution {
                reach: Reach::Reached,
                mu: f64::INFINITY,
                center: threshold,
                nu: 0.0,
            };
        }
        RowSolution::reached(found)
    }

    /// The multiplier at which a row's sum meets `target` > 0; `None` where it cannot.
    ///
    /// All terms of the sums have one sign: nothing cancels.
    fn sorted(&mut self, row: Row, target: f64) -> Option<f64> {
        let coefficients = match row {
            Row::Force => &self.row,
            Row::Ones => &self.ones,
        };
        self.order.clear();
        for (i, &c) in coefficients.iter().enumerate() {
            if c != 0.0 {
                let bound = self.bound_towards(i, c);
                self.order.push((bound * self.resistance_ohm[i] / c, i));
            }
        }
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut free = 0.0;
        for (place, &(_, i)) in self.order.iter().enumerate().rev() {
            free += coefficients[i] * coefficients[i] * self.conductance_s[i];
            self.tail[place] = free;
        }
        let mut held = 0.0;
        for (place, &(leaves, i)) in self.order.iter().enumerate() {
            if held + leaves * self.tail[place] >= target {
                return Some((target - held) / self.tail[place]);
            }
            held += coefficients[i] * self.bound_towards(i, coefficients[i]);
        }
        // A residue of rounding alone is met with every coil at its limit.
        let last = self.order.last()?.0;
        (held >= target).then_some(last)
    }

    /// The limit that a coil approaches as its row's multiplier grows.
    fn bound_towards(&self, i: usize, coefficient: f64) -> f64 {
        if coefficient > 0.0 {
            self.upper_a[i]
        } else {
            self.lower_a[i]
        }
    }

    /// Writes the currents of the multipliers.
    fn fill(&self, at: Multipliers, currents: &mut [f64]) -> Sums {
        let mut sums = Sums::default();
        for (i, current) in currents.iter_mut().enumerate() {
            *current = self.current(i, at);
            sums.add(self.row[i], *current);
        }
        sums
    }

    fn current(&self, i: usize, at: Multipliers) -> f64 {
        let pressure = at.mu * (self.row[i] - at.center) + at.nu;
        (pressure * self.conductance_s[i]).clamp(self.lower_a[i], self.upper_a[i])
    }

    /// Writes the currents of the largest force within all limits, those of least power among
    /// them. Returns that force and the threshold of the knapsack.
    fn most(&mut self, currents: &mut [f64]) -> (f64, f64) {
        let coils = self.coils();
        currents.copy_from_slice(&self.lower_a);
        self.order.clear();
        self.order
            .extend(self.row.iter().enumerate().map(|(i, &g)| (-g, i)));
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        // Sum that the coils from a place on return at their lower limits. All terms of this and of
        // the next sum have one sign: a limit of 1e30 A beside one of 1 A takes no digit of it.
        let mut back = 0.0;
        for (place, &(_, i)) in self.order.iter().enumerate().rev() {
            back -= self.lower_a[i];
            self.tail[place] = back;
        }
        let mut spent = Careful::of(0.0);
        let mut threshold = 0.0;
        let mut start = 0;
        while start < coils {
            let gain = -self.order[start].0;
            if gain < -TIED {
                break;
            }
            let mut end = start;
            let mut upper = Careful::of(0.0);
            while end < coils && -self.order[end].0 >= gain - TIED {
                upper.add(self.upper_a[self.order[end].1]);
                end += 1;
            }
            // Share of the sum for this group, without its own lower limits.
            let mut left = Careful::of(self.total_a);
            left.add(self.tail.get(end).copied().unwrap_or(0.0));
            left.add(-spent.head);
            left.add(-spent.rest);
            if upper.value() <= left.value() && gain > TIED {
                for &(_, i) in &self.order[start..end] {
                    currents[i] = self.upper_a[i];
                }
                spent.add(upper.head);
                spent.add(upper.rest);
                start = end;
                continue;
            }
            self.share(start..end, left.value(), gain <= TIED, currents);
            threshold = gain.max(0.0);
            break;
        }
        let force = self.row.iter().zip(&*currents).map(|(g, i)| g * i).sum();
        (force, threshold)
    }

    /// Shares a sum among equal coils by least power: exactly that sum, or with `at_most` no more
    /// and no current where none is needed.
    fn share(
        &mut self,
        group: std::ops::Range<usize>,
        sum: f64,
        at_most: bool,
        currents: &mut [f64],
    ) {
        self.ones.fill(0.0);
        for &(_, i) in &self.order[group] {
            self.ones[i] = 1.0;
        }
        let sum = if at_most { sum.min(0.0) } else { sum };
        if sum < 0.0 {
            self.ones.iter_mut().for_each(|c| *c = -*c);
        }
        let mu = if sum == 0.0 {
            0.0
        } else {
            // Beyond every limit only by rounding.
            self.sorted(Row::Ones, sum.abs()).unwrap_or(f64::MAX)
        };
        for (i, current) in currents.iter_mut().enumerate() {
            if self.ones[i] != 0.0 {
                let alone = mu * self.ones[i] * self.conductance_s[i];
                *current = alone.clamp(self.lower_a[i], self.upper_a[i]);
            }
        }
    }

    /// The multipliers with both the force and the sum met; the force is within reach and its
    /// currents of least power exceed the sum. Also the larger relative residual.
    fn with_sum(&mut self, target: f64, currents: &mut [f64]) -> (Multipliers, f64) {
        let stiffness: f64 = self.conductance_s.iter().sum();
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut sigma = 0.0;
        let mut best = (f64::INFINITY, Multipliers::of_force(0.0));
        for step in 0..STEPS {
            let piece = self.piece(sigma, target);
            let jump = self.solve_piece(piece, sigma, target);
            let sums = self.fill(jump, currents);
            let fault = sums.fault(target, self.total_a);
            if fault < best.0 && jump.sigma() >= 0.0 {
                best = (fault, jump);
            }
            if best.0 <= ROUNDING {
                break;
            }
            let here = Multipliers {
                mu: piece.mu,
                center: 0.0,
                nu: -sigma,
            };
            let excess = self.fill(here, currents).sum - self.total_a;
            if excess > 0.0 {
                low = sigma;
            } else {
                high = sigma;
            }
            let next = jump.sigma();
            sigma = if low < next && next < high && step % 3 != 2 {
                next
            } else if high.is_infinite() {
                (4.0 * low).max(excess / stiffness)
            } else if low > 0.0 && high > 4.0 * low {
                (low * high).sqrt()
            } else {
                0.5 * (low + high)
            };
            if !(low < sigma && sigma < high) {
                break;
            }
        }
        self.fill(best.1, currents);
        (best.1, best.0)
    }

    /// The piece of the force's multiplier on which the force is met for a given `sigma`.
    fn piece(&mut self, sigma: f64, target: f64) -> Piece {
        self.order.clear();
        for (i, &g) in self.row.iter().enumerate() {
            if g != 0.0 {
                for bound in [self.lower_a[i], self.upper_a[i]] {
                    self.order.push((self.meets(i, bound, sigma), i));
                }
            }
        }
        self.order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let force = |mu: f64| -> f64 {
            let at = Multipliers {
                mu,
                center: 0.0,
                nu: -sigma,
            };
            let terms = self.row.iter().enumerate();
            terms.map(|(i, g)| g * self.current(i, at)).sum()
        };
        let above = self.order.partition_point(|&(mu, _)| force(mu) < target);
        let to = self
            .order
            .get(above)
            .or(self.order.last())
            .map_or(0.0, |p| p.0);
        let from = if above == 0 {
            to
        } else {
            self.order[above - 1].0
        };
        let slope: f64 = (0..self.coils())
            .filter(|&i| self.moves(i, sigma, from, to))
            .map(|i| self.row[i] * self.row[i] * self.conductance_s[i])
            .sum();
        let mu = if slope > 0.0 {
            // A far end would take the digits: then from the piece's point nearest to nothing.
            let near = 0.0_f64.clamp(from, to);
            let far = to.abs() > FAR * sigma.max(near.abs());
            let at = if far { near } else { to };
            (at + (target - force(at)) / slope).clamp(from, to)
        } else {
            to
        };
        Piece { from, to, mu }
    }

    /// The force's multiplier at which a coil with force meets a limit.
    fn meets(&self, i: usize, limit_a: f64, sigma: f64) -> f64 {
        (limit_a * self.resistance_ohm[i] + sigma) / self.row[i]
    }

    /// Whether a coil is between its limits all over a piece.
    fn moves(&self, i: usize, sigma: f64, from: f64, to: f64) -> bool {
        let (low, high) = (
            self.lower_a[i] * self.resistance_ohm[i],
            self.upper_a[i] * self.resistance_ohm[i],
        );
        let pressure = |mu: f64| mu * self.row[i] - sigma;
        let (a, b) = (pressure(from), pressure(to));
        let (least, most) = (a.min(b), a.max(b));
        // The piece ends where a coil meets its limit: up to the rounding at that end, not at the
        // other, which may lie at 1e30.
        let slack = |end: f64| 4.0 * f64::EPSILON * (sigma + end.abs());
        low < high && least >= low - slack(least) && most <= high + slack(most)
    }

    /// The multipliers that meet both rows if the coils that move on `piece` are the ones that do.
    fn solve_piece(&self, piece: Piece, sigma: f64, target: f64) -> Multipliers {
        let middle = Multipliers {
            mu: 0.5 * (piece.from + piece.to),
            center: 0.0,
            nu: -sigma,
        };
        let (mut force, mut sum) = (target, self.total_a);
        let (mut weight, mut moment) = (0.0, 0.0);
        for i in 0..self.coils() {
            if self.moves(i, sigma, piece.from, piece.to) {
                weight += self.conductance_s[i];
                moment += self.conductance_s[i] * self.row[i];
            } else {
                let current = self.current(i, middle);
                force -= self.row[i] * current;
                sum -= current;
            }
        }
        if weight == 0.0 {
            return Multipliers {
                mu: piece.mu,
                ..middle
            };
        }
        // About the mean of the moving coils the two rows are orthogonal; the mean of what
        // rounding left of it is taken out again, for coils that are almost equal.
        let center = moment / weight;
        let (mut rest, mut spread) = (0.0, 0.0);
        for i in self.moving(piece, sigma) {
            rest += self.conductance_s[i] * (self.row[i] - center);
        }
        rest /= weight;
        for i in self.moving(piece, sigma) {
            let away = self.row[i] - center - rest;
            spread += self.conductance_s[i] * away * away;
        }
        let mu = if spread > TIED * TIED * weight {
            (force - (center + rest) * sum) / spread
        } else {
            0.0
        };
        Multipliers {
            mu,
            center,
            nu: sum / weight - mu * rest,
        }
    }

    fn moving(&self, piece: Piece, sigma: f64) -> impl Iterator<Item = usize> + '_ {
        (0..self.coils()).filter(move |&i| self.moves(i, sigma, piece.from, piece.to))
    }

    /// How far `currents_a` are from the optimum that `found` claims, computed from the inputs and
    /// the multipliers alone: the largest of what is missing of the force, what exceeds the sum or
    /// a limit, and the distance from `clamp(...)`, each relative to the sizes of its terms; for a
    /// force beyond reach the duality gap of the largest force instead of the first and the last.
    #[must_use]
    pub fn certificate(
        &self,
        force_n_per_a: &[f64],
        wanted_n: f64,
        currents_a: &[f64],
        found: &Allocation,
    ) -> f64 {
        let (mut force, mut force_size, mut sum, mut sum_size) = (0.0, 0.0, 0.0, 0.0);
        let mut worst = 0.0_f64;
        let (mut reachable, mut reach_size) = (0.0, 0.0);
        let sign = if wanted_n < 0.0 { -1.0 } else { 1.0 };
        for (i, (&g, &current)) in force_n_per_a.iter().zip(currents_a).enumerate() {
            force += g * current;
            force_size += (g * current).abs();
            sum += current;
            sum_size += current.abs() - self.lower_a[i];
            let (lower, upper) = (self.lower_a[i], self.upper_a[i]);
            let range = lower.abs().max(upper);
            let outside = (lower - current).max(current - upper).max(0.0);
            let (mut fault, mut size) = (outside, range);
            if found.mu.is_finite() {
                let pressure = found.mu * (g - found.center_n_per_a) + found.nu_v;
                let requested = (pressure * self.conductance_s[i]).clamp(lower, upper);
                fault = fault.max((current - requested).abs());
                let terms = found.mu.abs() * (g.abs() + found.center_n_per_a.abs());
                size += (terms + found.nu_v.abs()) * self.conductance_s[i];
            }
            if fault > 0.0 {
                worst = worst.max(fault / size.max(f64::MIN_POSITIVE));
            }
            let gain = sign * (g - found.center_n_per_a);
            reachable += (gain * lower).max(gain * upper);
            reach_size += g.abs() * range;
        }
        let excess = (sum - self.total_a).max(0.0);
        if excess > 0.0 {
            worst = worst.max(excess / (sum_size + self.total_a));
        }
        if found.mu.is_finite() {
            let missing = (force - wanted_n).abs();
            if missing > 0.0 && found.reach == Reach::Reached {
                worst = worst.max(missing / (force_size + wanted_n.abs()));
            }
        } else {
            let threshold = sign * found.center_n_per_a;
            if threshold > 0.0 {
                reachable += threshold * self.total_a;
            }
            worst = worst.max((reachable - sign * force).abs() / reach_size);
        }
        worst
    }
}

/// Which row is solved.
#[derive(Debug, Clone, Copy)]
enum Row {
    Force,
    Ones,
}

/// `I_i = clamp((mu (g_i - center) + nu) / R_i)`, g the scaled row.
#[derive(Debug, Clone, Copy)]
struct Multipliers {
    mu: f64,
    center: f64,
    nu: f64,
}

impl Multipliers {
    fn of_force(mu: f64) -> Self {
        Self {
            mu,
            center: 0.0,
            nu: 0.0,
        }
    }

    /// The multiplier of the sum.
    fn sigma(self) -> f64 {
        self.mu * self.center - self.nu
    }
}

/// An interval of the force's multiplier between two breakpoints, and where the force is met.
#[derive(Debug, Clone, Copy)]
struct Piece {
    from: f64,
    to: f64,
    mu: f64,
}

/// A sum with the rounding of its terms kept: limits may differ by decades and cancel.
#[derive(Debug, Clone, Copy)]
struct Careful {
    head: f64,
    rest: f64,
}

impl Careful {
    fn of(head: f64) -> Self {
        Self { head, rest: 0.0 }
    }

    fn add(&mut self, term: f64) {
        let sum = self.head + term;
        if sum.is_finite() {
            let other = sum - self.head;
            self.rest += (self.head - (sum - other)) + (term - other);
        }
        self.head = sum;
    }

    fn value(self) -> f64 {
        self.head + self.rest
    }
}

struct RowSolution {
    reach: Reach,
    mu: f64,
    center: f64,
    nu: f64,
}

impl RowSolution {
    fn reached(at: Multipliers) -> Self {
        Self {
            reach: Reach::Reached,
            mu: at.mu,
            center: at.center,
            nu: at.nu,
        }
    }
}

/// Force and sum of currents, with the sizes of their terms.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    force: f64,
    force_size: f64,
    sum: f64,
    sum_size: f64,
}

impl Sums {
    fn add(&mut self, g: f64, current: f64) {
        self.force += g * current;
        self.force_size += (g * current).abs();
        self.sum += current;
        self.sum_size += current.abs();
    }

    /// The larger relative residual of the two rows.
    fn fault(&self, target: f64, total: f64) -> f64 {
        let force = (self.force - target).abs() / (self.force_size + target);
        let sum = (self.sum - total).abs() / (self.sum_size + total).max(f64::MIN_POSITIVE);
        force.max(sum)
    }
}
