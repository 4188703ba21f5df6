//! The field of one circular loop, by a single arithmetic-geometric mean.
//!
//! Loop radius a, field point at radius r and axial distance u from the loop's plane. With
//! d^2 = (a - r)^2 + u^2, p = 2 a r, s^2 = d^2 + 2 p, q = d^2 + p, m the AGM of (s, d),
//! gamma_1 = 1 / (s + d), gamma_(n+1) = p gamma_n^2 / (4 a_(n+1)) and
//! tau = sum 2^(n-1) gamma_n^2, every quantity below is free of cancellation on the axis:
//! p^2 tau is the T of the classical form, whose division by r^2 is thus carried out on paper.

use std::f64::consts::TAU;

use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::dual::Number;

/// Geometry of a loop and a field point. `offset` is a - r, passed beside both radii because
/// near the wire their difference must not be formed from rounded values.
#[derive(Debug, Clone, Copy)]
pub struct RingPoint<T> {
    /// Loop radius a, m.
    pub radius_m: f64,
    /// Field point's radius r, m.
    pub r_m: f64,
    /// a - r, m.
    pub offset_m: f64,
    /// Axial distance u of the field point above the loop's plane, m.
    pub u_m: T,
}

/// A loop's field per ampere over mu_0, and its vector potential.
#[derive(Debug, Clone, Copy)]
pub struct RingField<T> {
    /// B_z / (mu_0 I), 1/m.
    pub b_z: T,
    /// B_r / (r mu_0 I), 1/m^2.
    pub b_r_over_r: T,
    /// A_phi / (r mu_0 I), 1/m.
    pub a_phi_over_r: T,
}

/// Relative size of the AGM's last correction at which the iteration stops: the next one is
/// its square.
const AGM_STOP: f64 = 1e-9;

/// Field of a loop at any distance from the wire, to a few units of the last digit of |B|.
///
/// Domain: a >= 0, r >= 0, d > 0.
#[must_use]
pub fn ring_field<T: Number>(at: RingPoint<T>) -> RingField<T> {
    let (a, r) = (at.radius_m, at.r_m);
    let p = 2.0 * a * r;
    let u2 = at.u_m * at.u_m;
    let d2 = u2 + at.offset_m * at.offset_m;
    let s2 = d2 + 2.0 * p;
    let q = d2 + p;
    let (s, d) = (s2.sqrt(), d2.sqrt());
    let (mean, tau) = agm(s, d, p);

    let shape = T::constant(1.0) - q * tau;
    let denominator = mean * s2 * d2;
    let b_r_over_r = at.u_m * shape * (a * a) / denominator;
    let a_phi_over_r = tau * (a * a) / mean;
    // Two forms of the same numerator: the second keeps its digits close to the wire, where
    // B_z changes sign; the first keeps them far away.
    let remainder = q - tau * (p * p);
    let numerator = if d2.value() < 0.02 * s2.value() {
        s2 * d2 + (T::constant(at.offset_m * (a + r)) - u2) * remainder
    } else {
        remainder * (2.0 * a * a) - shape * (p * p)
    };
    let b_z = numerator / (denominator * 4.0);
    RingField {
        b_z,
        b_r_over_r,
        a_phi_over_r,
    }
}

/// AGM of (s, d) and the scaled sum tau.
fn agm<T: Number>(s: T, d: T, p: f64) -> (T, T) {
    let (mut mean, mut geometric) = ((s + d) * 0.5, (s * d).sqrt());
    let mut gamma = T::constant(0.5) / mean;
    let mut tau = gamma * gamma;
    let mut weight = 1.0;
    while p * gamma.value() > AGM_STOP * mean.value() {
        let next = (mean + geometric) * 0.5;
        geometric = (mean * geometric).sqrt();
        mean = next;
        gamma = gamma * gamma * (0.25 * p) / mean;
        weight *= 2.0;
        tau = tau + gamma * gamma * weight;
    }
    // One more mean: the loop stops when the next correction is below 1e-18.
    ((mean + geometric) * 0.5, tau)
}

/// Vector potentials of loops, to be summed with weights: eight at a time.
#[derive(Debug, Default)]
pub struct Potentials {
    p_m2: Vec<f64>,
    distance2_m2: Vec<f64>,
    weights: Vec<f64>,
}

impl Potentials {
    /// Adds A_phi / (r mu_0 I), 1/m, of a loop ([`RingField::a_phi_over_r`]).
    pub fn add(&mut self, at: RingPoint<f64>, weight: f64) {
        let a2 = at.radius_m * at.radius_m;
        self.add_pair([at.radius_m, at.r_m], [at.offset_m, at.u_m], weight * a2);
    }

    /// Adds the mutual inductance of two coaxial loops over mu_0, m: 2 pi r A_phi at the second loop. Positive, without
    /// cancellation for any radii and distance; `offset_m` is the difference of the radii.
    pub fn add_mutual(&mut self, [a_m, b_m]: [f64; 2], [offset_m, u_m]: [f64; 2], weight: f64) {
        let product = a_m * b_m;
        let weight = weight * TAU * product * product;
        self.add_pair([a_m, b_m], [offset_m, u_m], weight);
    }

    fn add_pair(&mut self, [a_m, b_m]: [f64; 2], [offset_m, u_m]: [f64; 2], weight: f64) {
        self.p_m2.push(2.0 * a_m * b_m);
        self.distance2_m2.push(offset_m * offset_m + u_m * u_m);
        self.weights.push(weight);
    }

    /// The sum of what was added since the last one.
    pub fn sum(&mut self) -> f64 {
        let sum = dispatch::run(Sum(self));
        self.p_m2.clear();
        self.distance2_m2.clear();
        self.weights.clear();
        sum
    }
}

struct Sum<'a>(&'a Potentials);

impl Kernel for Sum<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> f64 {
        let nodes = self
            .0
            .p_m2
            .chunks(LANES)
            .zip(self.0.distance2_m2.chunks(LANES));
        let mut sum = 0.0;
        for ((p, d2), weights) in nodes.zip(self.0.weights.chunks(LANES)) {
            let (p, d2) = (Lanes::load(p), Lanes::load(d2));
            let (mean, tau) = agm_of_lanes::<FMA>((p * 2.0 + d2).sqrt(), d2.sqrt(), p);
            let terms = tau / mean;
            sum += weights
                .iter()
                .zip(terms.0)
                .map(|(weight, term)| weight * term)
                .sum::<f64>();
        }
        sum
    }
}

/// As [`agm`], until the last of the lanes has converged.
#[inline(always)]
fn agm_of_lanes<const FMA: bool>(s: Lanes, d: Lanes, p: Lanes) -> (Lanes, Lanes) {
    let (mut mean, mut geometric) = ((s + d) * 0.5, (s * d).sqrt());
    let mut gamma = Lanes::splat(0.5) / mean;
    let mut tau = gamma * gamma;
    let mut weight = 1.0;
    let quarter_p = p * 0.25;
    let goes_on = |gamma: Lanes, mean: Lanes| {
        let left = p * gamma - mean * AGM_STOP;
        left.0.iter().fold(0.0_f64, |most, left| most.max(*left)) > 0.0
    };
    while goes_on(gamma, mean) {
        let next = (mean + geometric) * 0.5;
        geometric = (mean * geometric).sqrt();
        mean = next;
        gamma = gamma * gamma * quarter_p / mean;
        weight *= 2.0;
        tau = (gamma * weight).mul_add::<FMA>(gamma, tau);
    }
    ((mean + geometric) * 0.5, tau)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::dual::Dual;

    /// Biot-Savart by the trapezoidal rule in azimuth: converges geometrically off the wire.
    fn by_azimuth(a: f64, r: f64, u: f64) -> (f64, f64, f64) {
        let n = 4000;
        let (mut b_z, mut b_r, mut a_phi) = (0.0, 0.0, 0.0);
        for k in 0..n {
            let angle = TAU * (k as f64 + 0.5) / n as f64;
            let c = angle.cos();
            let half = (0.5 * angle).sin();
            let dist2 = (a - r) * (a - r) + u * u + 4.0 * a * r * half * half;
            let cube = dist2 * dist2.sqrt();
            b_z += a * (a - r * c) / cube;
            b_r += a * u * c / cube;
            a_phi += a * c / dist2.sqrt();
        }
        let scale = 0.5 / n as f64;
        (b_z * scale, b_r * scale / r, a_phi * scale / r)
    }

    #[test]
    fn agrees_with_biot_savart() {
        for (a, r, u) in [
            (0.7, 0.4, 0.3),
            (0.7, 1.3, -0.2),
            (1.3, 1.25, 0.02),
            (0.4, 0.9, 7.0),
        ] {
            let ring = ring_field(RingPoint {
                radius_m: a,
                r_m: r,
                offset_m: a - r,
                u_m: u,
            });
            let (b_z, b_r, a_phi) = by_azimuth(a, r, u);
            let size = b_z.hypot(b_r * r);
            assert!(
                (ring.b_z - b_z).abs() < 2e-14 * size,
                "{a} {r} {u}: {} {b_z}",
                ring.b_z
            );
            assert!((ring.b_r_over_r - b_r).abs() * r < 2e-14 * size);
            assert!((ring.a_phi_over_r - a_phi).abs() < 1e-13 * a_phi.abs());
        }
    }

    #[test]
    fn on_the_axis_it_is_the_textbook_formula() {
        let (a, u) = (0.7_f64, 1.3_f64);
        let ring = ring_field(RingPoint {
            radius_m: a,
            r_m: 0.0,
            offset_m: a,
            u_m: u,
        });
        let q = a * a + u * u;
        assert!((ring.b_z * 2.0 * q.powf(1.5) / (a * a) - 1.0).abs() < 1e-15);
        assert!((ring.b_r_over_r * 4.0 * q.powf(2.5) / (3.0 * a * a * u) - 1.0).abs() < 2e-15);
    }

    #[test]
    fn taylor_test_of_the_axial_derivative() {
        let (a, r, u) = (0.7, 0.55, 0.13);
        let at = |u| RingPoint {
            radius_m: a,
            r_m: r,
            offset_m: a - r,
            u_m: u,
        };
        let dual = ring_field(at(0.0).with_u(Dual::variable(u)));
        let remainder = |h: f64| {
            let step = ring_field(at(u + h));
            let base = ring_field(at(u));
            (
                (step.b_z - base.b_z - h * dual.b_z.du).abs(),
                (step.b_r_over_r - base.b_r_over_r - h * dual.b_r_over_r.du).abs(),
            )
        };
        let (coarse, fine) = (remainder(1e-3), remainder(1e-4));
        assert!((coarse.0 / fine.0).log10() > 1.9 && (coarse.1 / fine.1).log10() > 1.9);
    }

    impl RingPoint<f64> {
        fn with_u<T>(self, u_m: T) -> RingPoint<T> {
            RingPoint {
                radius_m: self.radius_m,
                r_m: self.r_m,
                offset_m: self.offset_m,
                u_m,
            }
        }
    }

    #[test]
    fn close_to_the_wire_it_is_a_straight_wire() {
        // At distance d << a the leading term is the straight wire's 1 / (2 pi d).
        let a = 0.7_f64;
        for d in [1e-6_f64, 1e-9] {
            let ring = ring_field(RingPoint {
                radius_m: a,
                r_m: a - d,
                offset_m: d,
                u_m: 0.0,
            });
            let wire = 1.0 / (TAU * d);
            let curvature = ((8.0 * a / d).ln()) / (4.0 * std::f64::consts::PI * a);
            assert!(
                (ring.b_z - wire - curvature).abs() < 2.0 * wire * d / a,
                "{d}"
            );
        }
    }

    #[test]
    fn sums_of_potentials_are_those_of_single_loops() {
        let mut potentials = Potentials::default();
        let (mut expected, mut most) = (0.0, 0.0_f64);
        for k in 0..21 {
            // From close to the wire to far away, in the same lanes.
            let at = RingPoint {
                radius_m: 0.7,
                r_m: 0.7 + 0.3 * 10.0_f64.powi(3 - k % 12),
                offset_m: -0.3 * 10.0_f64.powi(3 - k % 12),
                u_m: 0.01 * f64::from(k % 5),
            };
            let weight = 1.0 + 0.1 * f64::from(k);
            potentials.add(at, weight);
            let term = weight * ring_field(at).a_phi_over_r;
            expected += term;
            most = most.max(term);
        }
        assert!((potentials.sum() - expected).abs() < 1e-14 * most);
        assert_eq!(potentials.sum(), 0.0);
    }

    #[test]
    fn mutual_inductance_is_reciprocal() {
        let mutual = |radii_m, offset_m| {
            let mut potentials = Potentials::default();
            potentials.add_mutual(radii_m, [offset_m, 0.4], 1.0);
            potentials.sum()
        };
        let (m, n) = (mutual([0.7, 1.3], -0.6), mutual([1.3, 0.7], 0.6));
        assert!((m - n).abs() < 1e-15 * m);
        let (_, _, a_phi) = by_azimuth(0.7, 1.3, 0.4);
        assert!((m - TAU * 1.3 * 1.3 * a_phi).abs() < 1e-14 * m);
    }
}
