//! Two fingers on one array: at a pair of points the currents of least power that give both their forces.
//!
//! Two magnets push each other too: for dipoles at a distance `r` along the unit vector `n`
//!
//! ```text
//! F = 3 mu_0 / (4 pi r^4) ((m_1.n) m_2 + (m_2.n) m_1 + (m_1.m_2) n - 5 (m_1.n)(m_2.n) n)
//! ```
//!
//! on the second one, whatever the currents, which must give what that leaves of both requests. Whether they
//! can is a least squares problem within the limits: two rows for the upward forces, six for the vectors.

use std::f64::consts::PI;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::random::Random;
use fluxform_numerics::vec3::{cross, dot, minus, norm};

use super::feedback::FeedbackError;
use super::problem::{ForceProblem, Settings};
use super::uncertainty::{ErrorForm, Target};
use super::vector_feedback::VectorProblem;

/// Pairs looked at, at most.
const PAIRS: usize = 1000;
/// Pairs tried for each that is looked at, where few points have a partner.
const TRIALS: usize = 200;
/// A force counts as given within this share of the larger request.
pub const GIVEN: f64 = 1e-3;
/// Price of power, relative to the forces' square over resistance: below what `GIVEN` sees.
const PRICE: f64 = 1e-9;
/// The axis of magnets without a moment.
const UPRIGHT: [f64; 3] = [0.0, 0.0, 1.0];
/// The pairs are the same in every run.
const SEED: u64 = 0x2f19;

/// Pairs of points under two fingers with feedback.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TwoFingers {
    /// The force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Distances of the two fingers, m.
    pub apart_m: [f64; 2],
    /// Random pairs of points so far apart, the magnets beside each other; 0 where the object has none.
    pub pairs: usize,
    /// Share of them at which both get their upward force.
    pub upward_share: f64,
    /// Share of them at which both get their force vector.
    pub vector_share: f64,
    /// Mean power where both get their upward force, W.
    pub upward_power_w: f64,
    /// Mean power where both get their force vector, W.
    pub vector_power_w: f64,
    /// The largest force of one magnet on the other at any pair, N.
    pub magnets_force_n: f64,
    /// The same over the larger of the two requests there.
    pub magnets_force_share: f64,
}

/// Force of a dipole on another one of the same moment (A m^2), `from_first_m` away, N.
#[must_use]
pub fn between_magnets_n(moment_a_m2: [f64; 3], from_first_m: [f64; 3]) -> [f64; 3] {
    let distance = dot(from_first_m, from_first_m).sqrt();
    let n = from_first_m.map(|part| part / distance);
    let (along, square) = (dot(moment_a_m2, n), dot(moment_a_m2, moment_a_m2));
    let scale = 3.0 * MU_0_T_M_PER_A / (4.0 * PI * distance.powi(4));
    std::array::from_fn(|k| {
        scale * (2.0 * along * moment_a_m2[k] + (square - 5.0 * along * along) * n[k])
    })
}

/// The magnets of both fingers, alike and parallel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FingerMagnet {
    /// Moment, A m^2.
    pub moment_a_m2: [f64; 3],
    /// Diameter, m.
    pub diameter_m: f64,
    /// Length, m.
    pub length_m: f64,
}

/// Rings of equal area on the end of a magnet, and charges on each: to a percent of the difference where two are apart by
/// their own size.
const RINGS: usize = 4;
const AROUND: usize = 12;

impl FingerMagnet {
    /// How far the force of two whole cylinders of a uniform magnetisation is from that of dipoles on the second one, `apart_m`
    /// from centre to centre and not touching, N: by the charges `m / L` on their ends.
    #[must_use]
    pub fn off_dipoles_n(&self, apart_m: [f64; 3]) -> [f64; 3] {
        let size_a_m2 = norm(self.moment_a_m2);
        if size_a_m2 == 0.0 || self.length_m <= 0.0 {
            return [0.0; 3];
        }
        let axis = self.moment_a_m2.map(|part| part / size_a_m2);
        let least = (0..3).min_by(|a, b| axis[*a].abs().total_cmp(&axis[*b].abs()));
        let mut across = [0.0; 3];
        across[least.unwrap_or(0)] = 1.0;
        let first = cross(axis, across);
        let first = first.map(|part| part / norm(first));
        let second = cross(axis, first);
        let place = |k: usize| {
            let (ring, turn) = (k / AROUND, (k % AROUND) as f64 + 0.5 * (k / AROUND) as f64);
            let r_m = 0.5 * self.diameter_m * ((ring as f64 + 0.5) / RINGS as f64).sqrt();
            let (sin, cos) = (2.0 * PI * turn / AROUND as f64).sin_cos();
            std::array::from_fn(|i| r_m * (cos * first[i] + sin * second[i]))
        };
        let places: Vec<[f64; 3]> = (0..RINGS * AROUND).map(place).collect();
        let charge_a_m = size_a_m2 / self.length_m / places.len() as f64;
        let mut force_n = [0.0; 3];
        // Ends of the one lie over ends of the other by none, one and minus one length.
        for (lengths, sign) in [(0.0, 2.0), (1.0, -1.0), (-1.0, -1.0)] {
            let ends_m: [f64; 3] =
                std::array::from_fn(|i| apart_m[i] + lengths * self.length_m * axis[i]);
            for from in &places {
                for to in &places {
                    let r: [f64; 3] = std::array::from_fn(|i| ends_m[i] + to[i] - from[i]);
                    let scale = sign * MU_0_T_M_PER_A / (4.0 * PI) * charge_a_m.powi(2)
                        / dot(r, r).powf(1.5);
                    for (sum, part) in force_n.iter_mut().zip(r) {
                        *sum += scale * part;
                    }
                }
            }
        }
        minus(force_n, between_magnets_n(self.moment_a_m2, apart_m))
    }

    /// Distances of two of them, `apart_m` from centre to centre, along their axis and across it, m.
    #[must_use]
    pub fn along_and_across_m(&self, apart_m: [f64; 3]) -> [f64; 2] {
        let size_a_m2 = norm(self.moment_a_m2);
        let axis = match size_a_m2 > 0.0 {
            true => self.moment_a_m2.map(|part| part / size_a_m2),
            false => UPRIGHT,
        };
        let along_m = dot(axis, apart_m);
        let across_m = minus(apart_m, axis.map(|part| along_m * part));
        [along_m.abs(), norm(across_m)]
    }

    /// Whether two of them, `apart_m` from centre to centre, would lie in each other.
    #[must_use]
    pub fn overlaps(&self, apart_m: [f64; 3]) -> bool {
        let [along_m, across_m] = self.along_and_across_m(apart_m);
        across_m < self.diameter_m && along_m < self.length_m
    }

    /// Below this distance they always do, m.
    #[must_use]
    pub fn closest_m(&self) -> f64 {
        self.diameter_m.min(self.length_m)
    }
}

/// The result of one pair.
struct Pair {
    given: [bool; 2],
    power_w: [f64; 2],
    magnets_n: f64,
    magnets_share: f64,
}

/// Random pairs of the points at `positions_m`, `apart_m` apart, at which the magnets do not overlap.
///
/// # Errors
/// Where the problem is malformed.
///
/// # Panics
/// When positions, directions or sideways forces are fewer than the points.
pub fn two_fingers(
    problem: &VectorProblem,
    positions_m: &[[f64; 3]],
    magnet: FingerMagnet,
    lambda_n_per_m: f64,
    apart_m: [f64; 2],
) -> Result<TwoFingers, FeedbackError> {
    problem.upward.validate(&Settings::default())?;
    let pairs = random_pairs(positions_m, &magnet, apart_m);
    let moment_a_m2 = magnet.moment_a_m2;
    let done: Vec<Pair> = pairs
        .par_iter()
        .map(|pair| {
            fluxform_base::progress::poll();
            one_pair(problem, positions_m, moment_a_m2, lambda_n_per_m, *pair)
        })
        .collect();
    let share = |kind: usize| {
        let given = done.iter().filter(|pair| pair.given[kind]).count();
        given as f64 / done.len().max(1) as f64
    };
    let power = |kind: usize| {
        let given = done.iter().filter(|pair| pair.given[kind]);
        let (sum, count) = given.fold((0.0, 0_usize), |(sum, count), pair| {
            (sum + pair.power_w[kind], count + 1)
        });
        sum / count.max(1) as f64
    };
    let most = |of: fn(&Pair) -> f64| done.iter().map(of).fold(0.0, f64::max);
    Ok(TwoFingers {
        lambda_n_per_m,
        apart_m,
        pairs: done.len(),
        upward_share: share(0),
        vector_share: share(1),
        upward_power_w: power(0),
        vector_power_w: power(1),
        magnets_force_n: most(|pair| pair.magnets_n),
        magnets_force_share: most(|pair| pair.magnets_share),
    })
}

/// Leaves in `currents_a`, whose currents must be within the limits, those of least power that give every
/// force: each a row of forces per ampere (N/A), the force requested (N), and the share of its error that counts (above
/// 0); where the limits forbid that, those of the least sum of such errors' squares. That sum's root, N.
pub fn allocate(limits: &ForceProblem, rows: &[(&[f64], f64, f64)], currents_a: &mut [f64]) -> f64 {
    let mut form = ErrorForm::new(currents_a.len());
    let mut strongest = 0.0_f64;
    for &(row, requested_n, share) in rows {
        strongest = row.iter().fold(strongest, |most, g| most.max(g.abs()));
        form.add_square(row, share * share, 0.0);
        form.add_target(row, Target::exact(requested_n), share * share);
    }
    let ohm = limits.resistance_ohm.iter().copied();
    let least_ohm = ohm.fold(f64::INFINITY, f64::min);
    let price = (PRICE * strongest * strongest / least_ohm).max(f64::MIN_POSITIVE);
    form.minimise(limits, price, currents_a);
    form.value(currents_a).sqrt()
}

fn random_pairs(
    positions_m: &[[f64; 3]],
    magnet: &FingerMagnet,
    [least_m, most_m]: [f64; 2],
) -> Vec<[usize; 2]> {
    let mut random = Random::new(SEED);
    let points = positions_m.len();
    let mut pairs = Vec::new();
    for _ in 0..PAIRS * TRIALS {
        if pairs.len() == PAIRS || points < 2 {
            break;
        }
        let pair = [random.below(points), random.below(points)];
        let between = between(positions_m, pair);
        let distance = dot(between, between).sqrt();
        if (least_m..=most_m).contains(&distance) && !magnet.overlaps(between) {
            pairs.push(pair);
        }
    }
    pairs
}

fn between(positions_m: &[[f64; 3]], [a, b]: [usize; 2]) -> [f64; 3] {
    std::array::from_fn(|k| positions_m[b][k] - positions_m[a][k])
}

fn one_pair(
    problem: &VectorProblem,
    positions_m: &[[f64; 3]],
    moment_a_m2: [f64; 3],
    lambda: f64,
    pair: [usize; 2],
) -> Pair {
    let upward = &problem.upward;
    let coils = upward.coils();
    let on_second = between_magnets_n(moment_a_m2, between(positions_m, pair));
    let of_magnets = [on_second.map(|part| -part), on_second];
    let axes = [
        problem.sides_n_per_a[0],
        problem.sides_n_per_a[1],
        upward.forces_n_per_a,
    ];
    let row =
        |finger: usize, axis: usize| &axes[axis][pair[finger] * coils..(pair[finger] + 1) * coils];
    let request = |finger: usize, axis: usize| {
        let point = pair[finger];
        lambda * upward.height_m[point] * problem.direction[point][axis]
    };
    let requested = |finger: usize, axis: usize| {
        let pull = upward.offset_n.map_or(0.0, |all| all[pair[finger]]);
        request(finger, axis) - of_magnets[finger][axis] - if axis == 2 { pull } else { 0.0 }
    };
    let length =
        |of: &dyn Fn(usize) -> f64| (0..3).map(|axis| of(axis).powi(2)).sum::<f64>().sqrt();
    let largest = length(&|axis| request(0, axis)).max(length(&|axis| request(1, axis)));
    let solved = |first_axis: usize| -> (bool, f64) {
        let fingers = (0..2).flat_map(|finger| (first_axis..3).map(move |axis| (finger, axis)));
        let rows: Vec<_> = fingers
            .map(|(finger, axis)| (row(finger, axis), requested(finger, axis), 1.0))
            .collect();
        let mut currents = vec![0.0; coils];
        let error_n = allocate(upward, &rows, &mut currents);
        let ohm = upward.resistance_ohm;
        let power = ohm.iter().zip(&currents).map(|(ohm, i)| ohm * i * i).sum();
        (error_n <= GIVEN * largest, power)
    };
    let [(upward_given, upward_w), (vector_given, vector_w)] = [2, 0].map(solved);
    let magnets_n = length(&|axis| on_second[axis]);
    Pair {
        given: [upward_given, vector_given],
        power_w: [upward_w, vector_w],
        magnets_n,
        magnets_share: if largest > 0.0 {
            magnets_n / largest
        } else {
            0.0
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAGNET: FingerMagnet = FingerMagnet {
        moment_a_m2: [0.0, 0.0, 1.1579e6 * PI * 25e-6 * 10e-3],
        diameter_m: 10e-3,
        length_m: 10e-3,
    };

    /// Against an integration over both pairs of ends: 0.85667 N upward beside the dipoles' 0.88766 N.
    #[test]
    fn cylinders_push_each_other_otherwise_than_dipoles() {
        let apart_m = [20e-3, 0.0, 10e-3];
        let dipoles_n = between_magnets_n(MAGNET.moment_a_m2, apart_m);
        assert!((dipoles_n[2] - 0.88766).abs() < 1e-4, "{dipoles_n:?}");
        let off_n = MAGNET.off_dipoles_n(apart_m);
        assert!((off_n[2] + 0.03099).abs() < 1e-4, "{off_n:?}");
        // From far away there is no difference, however the magnets stand.
        let turned = FingerMagnet {
            moment_a_m2: [0.3, 0.0, 0.8],
            ..MAGNET
        };
        for magnet in [MAGNET, turned] {
            let far = [0.3, -0.2, 0.4];
            let dipoles_n = between_magnets_n(magnet.moment_a_m2, far);
            let share = norm(magnet.off_dipoles_n(far)) / norm(dipoles_n);
            assert!(share < 1e-3, "{share}");
        }
    }
}
