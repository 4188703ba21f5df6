//! The field of one circular loop, by a single arithmetic-geometric mean.
//!
//! Loop radius a, field point at radius r and axial distance u from the loop's plane. With
//! d^2 = (a - r)^2 + u^2, p = 2 a r, s^2 = d^2 + 2 p, q = d^2 + p, m the AGM of (s, d),
//! gamma_1 = 1 / (s + d), gamma_(n+1) = p gamma_n^2 / (4 a_(n+1)) and
//! tau = sum 2^(n-1) gamma_n^2, every quantity below is free of cancellation on the axis:
//! p^2 tau is the T of the classical form, whose division by r^2 is thus carried out on paper.

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

/// Mutual inductance of two coaxial loops over mu_0, m: 2 pi r A_phi at the second loop.
///
/// Positive, without cancellation for any radii and distance. `offset` is a - b.
#[must_use]
pub fn mutual_over_mu_0(a_m: f64, b_m: f64, offset_m: f64, u_m: f64) -> f64 {
    let p = 2.0 * a_m * b_m;
    let d2 = offset_m * offset_m + u_m * u_m;
    let (mean, tau) = agm((d2 + 2.0 * p).sqrt(), d2.sqrt(), p);
    std::f64::consts::TAU * (a_m * b_m) * (a_m * b_m) * tau / mean
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
            let angle = std::f64::consts::TAU * (k as f64 + 0.5) / n as f64;
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
            let wire = 1.0 / (std::f64::consts::TAU * d);
            let curvature = ((8.0 * a / d).ln()) / (4.0 * std::f64::consts::PI * a);
            assert!(
                (ring.b_z - wire - curvature).abs() < 2.0 * wire * d / a,
                "{d}"
            );
        }
    }

    #[test]
    fn mutual_inductance_is_reciprocal() {
        let m = mutual_over_mu_0(0.7, 1.3, -0.6, 0.4);
        let n = mutual_over_mu_0(1.3, 0.7, 0.6, 0.4);
        assert!((m - n).abs() < 1e-15 * m);
        let (_, _, a_phi) = by_azimuth(0.7, 1.3, 0.4);
        assert!((m - std::f64::consts::TAU * 1.3 * 1.3 * a_phi).abs() < 1e-14 * m);
    }
}
