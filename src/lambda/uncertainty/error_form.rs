//! A mean square error as a quadratic of the currents, and the currents that make it least.
//!
//! ```text
//! minimise  I'HI - 2 b'I + c + price sum R_i I_i^2   over   l_i <= I_i <= u_i,  sum I_i <= I_t.
//! ```
//!
//! Strictly convex for a price above zero. Over the box the primal active-set method ends on the exact
//! solution; the multiplier of the sum, where it binds, is the root of a sum that falls with it.

use fluxform_base::uncertainty::PullMoments;

use crate::problem::ForceProblem;

/// Rounds of the search for the multiplier of the sum.
const ROUNDS: usize = 80;
/// A sum within this share of its limit meets it.
const SUM_MET: f64 = 1e-12;
/// Pulls below this share of the terms they are sums of are rounding.
const ROUNDING: f64 = 1e-13;

/// What currents are to give: the request less the steel's pull, which goes with the square of the moment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Target {
    /// Mean of it times the magnet's strength and the share of the moment along its own axis, N.
    mean_n: f64,
    /// Mean of its square, N^2.
    square_n2: f64,
}

impl Target {
    /// Of a moment and a force that are certain.
    pub(crate) fn exact(wanted_n: f64) -> Self {
        Self {
            mean_n: wanted_n,
            square_n2: wanted_n * wanted_n,
        }
    }

    /// Where the strength's mean is `gain`, the share's `along`, and the magnet as stated is pulled by `pull_n`.
    pub(crate) fn new(
        request_n: f64,
        pull_n: f64,
        (gain, along): (f64, f64),
        pull: PullMoments,
    ) -> Self {
        Self {
            mean_n: request_n * gain * along - pull_n * pull.times_moment,
            square_n2: request_n * (request_n - 2.0 * pull_n * pull.mean)
                + pull_n * pull_n * pull.square,
        }
    }
}

/// A mean square error, N^2.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorForm {
    coils: usize,
    /// Lower triangle of H, row by row, `[i][j <= i]`.
    hessian: Vec<f64>,
    linear: Vec<f64>,
    constant: f64,
}

impl ErrorForm {
    pub(crate) fn new(coils: usize) -> Self {
        Self {
            coils,
            hessian: vec![0.0; coils * (coils + 1) / 2],
            linear: vec![0.0; coils],
            constant: 0.0,
        }
    }

    /// No error at all.
    pub(crate) fn clear(&mut self) {
        self.hessian.fill(0.0);
        self.linear.fill(0.0);
        self.constant = 0.0;
    }

    /// Adds `square` times the mean square of `row . I`, each current being off by a share of which
    /// `driver_square` is the mean square.
    pub(crate) fn add_square(&mut self, row: &[f64], square: f64, driver_square: f64) {
        let mut at = 0;
        for (i, a) in row.iter().enumerate() {
            for (sum, b) in self.hessian[at..=at + i].iter_mut().zip(row) {
                *sum += square * a * b;
            }
            self.hessian[at + i] += square * driver_square * a * a;
            at += i + 1;
        }
    }

    /// Adds `weight` times the cross term of `row . I` and a force, given its mean with what scales the row, and that
    /// force's mean square.
    pub(crate) fn add_target(&mut self, row: &[f64], of: Target, weight: f64) {
        for (sum, a) in self.linear.iter_mut().zip(row) {
            *sum += weight * of.mean_n * a;
        }
        self.constant += weight * of.square_n2;
    }

    /// Adds `share` times another.
    pub(crate) fn add(&mut self, other: &Self, share: f64) {
        let pairs = self.hessian.iter_mut().zip(&other.hessian);
        let pairs = pairs.chain(self.linear.iter_mut().zip(&other.linear));
        for (sum, value) in pairs {
            *sum += share * value;
        }
        self.constant += share * other.constant;
    }

    /// The mean square error of currents, N^2.
    pub(crate) fn value(&self, currents_a: &[f64]) -> f64 {
        let mut sum = self.constant;
        for (i, current) in currents_a.iter().enumerate() {
            let row = &self.hessian[i * (i + 1) / 2..];
            let off: f64 = (0..i).map(|j| row[j] * currents_a[j]).sum();
            sum += current * (2.0 * off + row[i] * current - 2.0 * self.linear[i]);
        }
        // A difference of squares: rounding may leave less than nothing.
        sum.max(0.0)
    }

    /// Leaves in `currents_a` those of the least sum of error and `price_n2_per_w` (> 0) times power, from
    /// those within the limits that are there.
    pub(crate) fn minimise(
        &self,
        limits: &ForceProblem,
        price_n2_per_w: f64,
        currents_a: &mut [f64],
    ) {
        let mut matrix = vec![0.0; self.coils * self.coils];
        for i in 0..self.coils {
            for j in 0..=i {
                let value = self.hessian[i * (i + 1) / 2 + j];
                matrix[i * self.coils + j] = value;
                matrix[j * self.coils + i] = value;
            }
            matrix[i * self.coils + i] += price_n2_per_w * limits.resistance_ohm[i];
        }
        let search = Search {
            coils: self.coils,
            matrix: &matrix,
            linear: &self.linear,
            limits,
        };
        search.within_box(0.0, currents_a);
        let Some(total) = limits.total_max_a else {
            return;
        };
        let sum = |currents: &[f64]| currents.iter().sum::<f64>();
        if sum(currents_a) <= total * (1.0 + SUM_MET) {
            return;
        }
        // Where coils push against each other the multiplier may have to outweigh more than their pulls; the sum
        // falls with it, at last to that of the lower limits, which is within.
        let pulls = self.linear.iter().map(|b| b.abs());
        let (mut low, mut high) = (0.0, pulls.fold(f64::MIN_POSITIVE, f64::max));
        let mut within = vec![0.0; self.coils];
        search.within_box(high, &mut within);
        while sum(&within) > total {
            low = high;
            high *= 2.0;
            search.within_box(high, &mut within);
        }
        for _ in 0..ROUNDS {
            let middle = 0.5 * (low + high);
            search.within_box(middle, currents_a);
            if sum(currents_a) > total {
                low = middle;
            } else {
                high = middle;
                within.copy_from_slice(currents_a);
                if sum(currents_a) >= total * (1.0 - SUM_MET) {
                    break;
                }
            }
        }
        currents_a.copy_from_slice(&within);
    }
}

struct Search<'a> {
    coils: usize,
    matrix: &'a [f64],
    linear: &'a [f64],
    limits: &'a ForceProblem<'a>,
}

impl Search<'_> {
    /// Half the slope along coil `i`, and the size of its terms.
    fn slope(&self, i: usize, price: f64, currents: &[f64]) -> (f64, f64) {
        let row = &self.matrix[i * self.coils..(i + 1) * self.coils];
        let (mut slope, mut size) = (price - self.linear[i], self.linear[i].abs() + price);
        for (a, current) in row.iter().zip(currents) {
            slope += a * current;
            size += (a * current).abs();
        }
        (slope, size)
    }

    /// The least value over the box of `I'AI - 2 (b - price)'I`.
    fn within_box(&self, price: f64, currents: &mut [f64]) {
        let (lower, upper) = (self.limits.lower_a, self.limits.upper_a);
        let mut free: Vec<usize> = (0..self.coils)
            .filter(|&i| currents[i] > lower[i] && currents[i] < upper[i])
            .collect();
        // Each turn fixes a coil or frees one; the value falls, so no set comes twice.
        for _ in 0..20 * self.coils + 20 {
            let aim = self.least_of(&free, price, currents);
            let mut share = 1.0;
            let mut meets = None;
            for (slot, (&i, aim)) in free.iter().zip(&aim).enumerate() {
                let bound = if *aim > currents[i] {
                    upper[i]
                } else {
                    lower[i]
                };
                let beyond = (aim > &upper[i]) || (aim < &lower[i]);
                let part = (bound - currents[i]) / (aim - currents[i]);
                if beyond && part < share {
                    share = part;
                    meets = Some((slot, bound));
                }
            }
            for (&i, aim) in free.iter().zip(&aim) {
                currents[i] = (currents[i] + share * (aim - currents[i])).clamp(lower[i], upper[i]);
            }
            if let Some((slot, bound)) = meets {
                currents[free.remove(slot)] = bound;
                continue;
            }
            let mut worst = None;
            let mut most = 0.0;
            for i in (0..self.coils).filter(|i| !free.contains(i)) {
                let (slope, size) = self.slope(i, price, currents);
                let pull = if slope < 0.0 && currents[i] < upper[i] {
                    -slope
                } else if slope > 0.0 && currents[i] > lower[i] {
                    slope
                } else {
                    0.0
                };
                if pull > ROUNDING * size && pull > most {
                    most = pull;
                    worst = Some(i);
                }
            }
            match worst {
                None => return,
                Some(i) => free.push(i),
            }
        }
    }

    /// The free currents of the least value, the others as they are.
    fn least_of(&self, free: &[usize], price: f64, currents: &[f64]) -> Vec<f64> {
        let n = free.len();
        let mut others = currents.to_vec();
        for &i in free {
            others[i] = 0.0;
        }
        let right_of = |&i: &usize| -> f64 {
            let row = &self.matrix[i * self.coils..(i + 1) * self.coils];
            let fixed: f64 = row.iter().zip(&others).map(|(a, c)| a * c).sum();
            self.linear[i] - price - fixed
        };
        let mut right: Vec<f64> = free.iter().map(right_of).collect();
        let mut l = vec![0.0; n * n];
        for a in 0..n {
            for b in 0..=a {
                let mut value = self.matrix[free[a] * self.coils + free[b]];
                for k in 0..b {
                    value -= l[a * n + k] * l[b * n + k];
                }
                l[a * n + b] = if a == b {
                    value.max(f64::MIN_POSITIVE).sqrt()
                } else {
                    value / l[b * n + b]
                };
            }
        }
        for a in 0..n {
            for k in 0..a {
                right[a] -= l[a * n + k] * right[k];
            }
            right[a] /= l[a * n + a];
        }
        for a in (0..n).rev() {
            for k in a + 1..n {
                right[a] -= l[k * n + a] * right[k];
            }
            right[a] /= l[a * n + a];
        }
        right
    }
}
