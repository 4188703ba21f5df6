//! Nodes on the magnet's axis: the cylinder as a few point dipoles.
//!
//! On a ball free of sources a harmonic function averaged around the axis is
//! sum_l c_l r^l P_l(cos theta), with c_l its Taylor coefficients along the axis. Its mean over the
//! cylinder is sum_l c_l mu_l with the cylinder's multipoles
//!
//! ```text
//! mu_l = R^l 2 P'_(l+2)(c) / (c (l+1)(l+2)(l+3)),  c = h / (2 R),  l even;  mu_l = 0, l odd
//! ```
//!
//! (mu_0 = 1, mu_2 = h^2/12 - a^2/4), R the radius of the ball around the cylinder: integrate
//! r^l P_l over the volume by d/dz of r^(l+1) P_(l+1) = (l+1) r^l P_l and Laplace's equation.
//! Nodes s_k = -s_(N+1-k) on the axis with factors w_k are exact for the degrees whose moments
//! sum w_k s_k^l they match: up to N for odd N, N - 1 for even.

use super::{MagnetRule, Node, Placed};
use fluxform_numerics::gauss;

/// Sources closer than R / 0.8 are left to the volume rule.
const LARGEST_RATIO: f64 = 0.8;
/// Most nodes worth trying.
const MOST_NODES: usize = 27;
/// Part of the tolerance that rounding, amplified by the factors, may take.
const ROUNDING_SHARE: f64 = 0.1;
/// Largest sum of |w_k|: factors grow where nodes crowd at the centre.
const LARGEST_AMPLIFICATION: f64 = 1e4;
/// Spreads of the nodes that are tried, as parts of R.
const SPREADS: usize = 40;
/// The bound's series ends where its terms are below this.
const SERIES_END: f64 = 1e-20;

/// A rule in units of R: distances from the centre (each but zero stands for a pair), factors.
struct Candidate {
    count: usize,
    distances: Vec<f64>,
    /// A pair's factors together.
    factors: Vec<f64>,
    bound: f64,
    amplification: f64,
}

/// The rule that keeps `tolerance` with the least work: nodes times the digits that the caller
/// must give each of them, tolerance over amplification.
pub(super) fn rule(magnet: &Placed, distance_m: f64, tolerance: f64) -> Option<MagnetRule> {
    let ratio = magnet.size.reach_m() / distance_m;
    if ratio > LARGEST_RATIO {
        return None;
    }
    let moments = moments(magnet, ratio);
    let rounding = |c: &Candidate| c.amplification * f64::EPSILON;
    let candidate = (1..=MOST_NODES)
        .flat_map(|count| spreads().map(move |spread| (count, spread)))
        .filter_map(|(count, spread)| candidate(count, spread, &moments, ratio))
        .filter(|c| c.bound <= tolerance && rounding(c) <= ROUNDING_SHARE * tolerance)
        .min_by(|a, b| a.work(tolerance).total_cmp(&b.work(tolerance)))?;
    Some(candidate.placed(magnet, &moments))
}

fn spreads() -> impl Iterator<Item = f64> {
    (SPREADS / 5..=SPREADS).map(|k| k as f64 / SPREADS as f64)
}

/// mu_0, mu_2, mu_4 ... over R^l, as many as the bound's series needs.
fn moments(magnet: &Placed, ratio: f64) -> Vec<f64> {
    let cosine = 0.5 * magnet.size.length_m / magnet.size.reach_m();
    let mut moments = Vec::new();
    // P_n and P'_n from n = 1 on; the derivatives by P'_(n+1) = P'_(n-1) + (2n+1) P_n.
    let (mut before, mut value) = (1.0, cosine);
    let (mut slope_before, mut slope) = (0.0, 1.0);
    let mut n = 1.0;
    loop {
        let next = ((2.0 * n + 1.0) * cosine * value - n * before) / (n + 1.0);
        let slope_next = slope_before + (2.0 * n + 1.0) * value;
        (before, value) = (value, next);
        (slope_before, slope) = (slope, slope_next);
        n += 1.0;
        // l + 2 = n; every other is a moment.
        let l = n - 2.0;
        if l % 2.0 == 0.0 {
            moments.push(2.0 * slope / (cosine * (l + 1.0) * (l + 2.0) * (l + 3.0)));
            if moments.len() > MOST_NODES && growth(l) * ratio.powf(l) < SERIES_END {
                return moments;
            }
        }
    }
}

/// Taylor coefficient l of a point charge's gradient at unit distance, relative to coefficient 0.
fn growth(l: f64) -> f64 {
    0.5 * (l + 1.0) * (l + 2.0)
}

/// `count` nodes at the Gauss-Legendre points of `[-spread, spread]`, with matched moments;
/// `None` where the factors grow too large.
fn candidate(count: usize, spread: f64, moments: &[f64], ratio: f64) -> Option<Candidate> {
    let distances: Vec<f64> = gauss::rule(count).nodes[count / 2..]
        .iter()
        .map(|x| spread * x)
        .collect();
    let factors = matched(&distances, moments);
    let amplification: f64 = factors.iter().map(|w| w.abs()).sum();
    if amplification > LARGEST_AMPLIFICATION {
        return None;
    }
    // |c_l| <= growth(l) / distance^l times the size of the field; rounding of the factors is seen
    // by the terms that they should match.
    let mut powers = factors.clone();
    let mut bound = 0.0;
    for (k, moment) in moments.iter().enumerate() {
        let l = 2.0 * k as f64;
        let miss = powers.iter().sum::<f64>() - moment;
        bound += miss.abs() * growth(l) * ratio.powf(l);
        for (power, s) in powers.iter_mut().zip(&distances) {
            *power *= s * s;
        }
    }
    Some(Candidate {
        count,
        distances,
        factors,
        bound,
        amplification,
    })
}

/// Factors with sum_k w_k s_k^(2 j) = mu_(2 j), j below their number: Bjorck and Pereyra's
/// elimination (Math. Comp. 24, 893, 1970), accurate in spite of the system's condition.
fn matched(distances: &[f64], moments: &[f64]) -> Vec<f64> {
    let squares: Vec<f64> = distances.iter().map(|s| s * s).collect();
    let last = squares.len() - 1;
    let mut w = moments[..=last].to_vec();
    for (k, square) in squares[..last].iter().enumerate() {
        for i in (k + 1..=last).rev() {
            w[i] -= square * w[i - 1];
        }
    }
    for k in (0..last).rev() {
        for i in k + 1..=last {
            w[i] /= squares[i] - squares[i - k - 1];
        }
        for i in k..last {
            w[i] -= w[i + 1];
        }
    }
    w
}

impl Candidate {
    fn work(&self, tolerance: f64) -> f64 {
        self.count as f64 * (self.amplification / tolerance).max(1.0).ln()
    }

    fn placed(self, magnet: &Placed, moments: &[f64]) -> MagnetRule {
        // The lower rule goes without the innermost node or pair.
        let lower = (self.distances.len() > 1).then(|| {
            let mut factors = vec![0.0];
            factors.extend(matched(&self.distances[1..], moments));
            mirrored(&self.distances, &factors)
                .map(|(_, w)| w)
                .collect()
        });
        let reach_m = magnet.size.reach_m();
        let nodes = mirrored(&self.distances, &self.factors)
            .map(|(s, w)| Node {
                offset_m: magnet.axis.map(|n| n * s * reach_m),
                moment_a_m2: magnet.moment_a_m2.map(|m| m * w),
            })
            .collect();
        MagnetRule {
            nodes,
            lower,
            moment_a_m2: magnet.moment_a_m2,
            bound: self.bound,
            amplification: self.amplification,
        }
    }
}

/// Positions and factors of single nodes, from the lowest to the highest.
fn mirrored<'a>(distances: &'a [f64], factors: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    let pairs = distances.iter().zip(factors);
    let below = pairs.clone().rev().filter(|(s, _)| **s > 0.0);
    below.map(|(s, w)| (-s, 0.5 * w)).chain(pairs.map(|(s, w)| {
        let share = if *s > 0.0 { 0.5 } else { 1.0 };
        (*s, share * w)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::magnet::Cylinder;

    fn magnet(diameter_m: f64, length_m: f64) -> Placed {
        Placed {
            size: Cylinder {
                diameter_m,
                length_m,
            },
            axis: [0.0, 0.0, 1.0],
            moment_a_m2: [0.0, 0.0, -0.7],
        }
    }

    #[test]
    fn the_multipoles_are_means_of_harmonic_polynomials() {
        for (a, h) in [(0.7, 1.3), (1.3, 0.01), (0.01, 1.7)] {
            let magnet = magnet(2.0 * a, h);
            let reach = magnet.size.reach_m();
            let moments = moments(&magnet, 0.3);
            // Means of z^2 - r^2/2 and z^4 - 3 z^2 r^2 + 3 r^4 / 8.
            let second = h * h / 12.0 - a * a / 4.0;
            let fourth = h.powi(4) / 80.0 - h * h * a * a / 8.0 + a.powi(4) / 8.0;
            assert!((moments[0] - 1.0).abs() < 1e-15);
            assert!(
                (moments[1] - second / reach.powi(2)).abs() < 2e-16,
                "{a} {h}"
            );
            assert!(
                (moments[2] - fourth / reach.powi(4)).abs() < 5e-16,
                "{a} {h}"
            );
        }
    }

    #[test]
    fn a_rule_is_exact_up_to_its_degree_and_no_further() {
        let moments = moments(&magnet(1.4, 1.3), 0.3);
        for count in 1..=11 {
            let rule = candidate(count, 0.97, &moments, 0.3).expect("moderate factors");
            let miss = |k: usize| {
                let sum: f64 = mirrored(&rule.distances, &rule.factors)
                    .map(|(s, w)| w * s.powi(2 * k as i32))
                    .sum();
                (sum - moments[k]).abs()
            };
            let exact = count.div_ceil(2);
            assert!((0..exact).all(|k| miss(k) < 1e-15 * rule.amplification.max(4.0)));
            assert!(miss(exact) > 1e-6, "{count}: {:e}", miss(exact));
        }
    }
}
