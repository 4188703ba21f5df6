//! Cores in a uniform field: closed forms for weak, long and flat bodies.

use std::f64::consts::PI;

use fluxform_field::steel::CoreShape;
use fluxform_field::steel::double_layer::operators;
use fluxform_field::steel::generatrix::{Generatrix, Resolution};
use fluxform_field::steel::response::{mean, system};
use nalgebra::DVector;

/// Axial and transverse moment per volume of a core in a unit field, per unit field.
struct Uniform {
    outline: Generatrix,
    resolution: Resolution,
}

impl Uniform {
    fn new(radius_m: f64, length_m: f64, tolerance: f64) -> Self {
        let shape = CoreShape {
            radius_m,
            bottom_m: -0.5 * length_m,
            top_m: 0.5 * length_m,
        };
        let resolution = Resolution::for_tolerance(tolerance);
        Self {
            outline: Generatrix::new(shape, &[], &resolution),
            resolution,
        }
    }

    /// Potential of the unit field on the nodes: -z, or -r of cos(theta).
    fn potential(&self, mode: usize) -> DVector<f64> {
        let nodes = self.outline.nodes.iter();
        DVector::from_iterator(
            self.outline.nodes.len(),
            nodes.map(|n| if mode == 0 { -n.z_m } else { -n.r_m }),
        )
    }

    /// -(1/V) oint v n dS along the field.
    fn per_volume(&self, mode: usize, layer: &DVector<f64>) -> f64 {
        let sum: f64 = self
            .outline
            .nodes
            .iter()
            .zip(self.outline.areas_m2())
            .zip(layer.iter())
            .map(|((node, area), v)| {
                let along = if mode == 0 {
                    node.normal[1]
                } else {
                    0.5 * node.normal[0]
                };
                area * along * v
            })
            .sum();
        -sum / self.outline.shape.volume_m3()
    }

    /// Demagnetising factor of a uniform magnetisation, averaged over the volume.
    fn factor(&self, mode: usize) -> f64 {
        let w = operators(&self.outline, mode + 1, self.resolution.quadrature).remove(mode);
        self.per_volume(mode, &(w * self.potential(mode)))
    }

    /// Moment per volume and field of a core of susceptibility `mu_r` - 1.
    fn susceptibility(&self, mode: usize, mu_r: f64) -> f64 {
        let w = operators(&self.outline, mode + 1, self.resolution.quadrature).remove(mode);
        let share = (mu_r - 1.0) / mu_r;
        let layer = system(&self.outline, w, mu_r, mode)
            .lu()
            .solve(&(self.potential(mode) * share))
            .expect("regular");
        let shift = if mode == 0 {
            mean(&self.outline, layer.iter())
        } else {
            0.0
        };
        self.per_volume(mode, &layer.add_scalar(-shift))
    }
}

/// Nagaoka's coefficient by Lorenz's formula: the inductance of a current sheet over mu_0 n^2 V.
fn nagaoka(diameter_over_length: f64) -> f64 {
    let u = diameter_over_length;
    let k2 = u * u / (1.0 + u * u);
    // K and E by the arithmetic-geometric mean.
    let (mut a, mut b, mut sum, mut power) = (1.0_f64, (1.0 - k2).sqrt(), 0.5 * k2, 1.0);
    while (a - b).abs() > 1e-15 * a {
        let c = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        sum += power * c * c;
        power *= 2.0;
    }
    let (k, e) = (0.5 * PI / a, 0.5 * PI / a * (1.0 - sum));
    let kp2 = 1.0 - k2;
    4.0 / (3.0 * PI * kp2.sqrt()) * (kp2 / k2 * k - (1.0 - 2.0 * k2) / k2 * e - k2.sqrt())
}

/// A uniformly magnetised cylinder is a current sheet, so N_z = 1 - Nagaoka's coefficient; the
/// trace of the factors is one (Brown and Morrish).
#[test]
fn weak_steel_has_nagaokas_demagnetising_factor_and_unit_trace() {
    for length_over_diameter in [0.013, 0.31, 1.0, 2.7, 37.0] {
        let radius_m = 0.0117;
        let body = Uniform::new(radius_m, 2.0 * radius_m * length_over_diameter, 1e-9);
        let (axial, transverse) = (body.factor(0), body.factor(1));
        let exact = 1.0 - nagaoka(1.0 / length_over_diameter);
        assert!(
            (axial - exact).abs() < 3e-9,
            "l/d {length_over_diameter}: N_z {axial} instead of {exact}"
        );
        let trace = axial + 2.0 * transverse;
        assert!(
            (trace - 1.0).abs() < 3e-9,
            "l/d {length_over_diameter}: trace {trace}"
        );
    }
}

/// The cube-shaped cylinder of length equal to its diameter, N_z = 0.3116 (Chen, Brug and
/// Goldfarb, IEEE Trans. Magn. 27, 3601, 1991).
#[test]
fn nagaokas_formula_gives_the_published_factor() {
    assert!((1.0 - nagaoka(1.0) - 0.3116).abs() < 5e-5);
}

#[test]
fn long_cores_follow_the_infinite_cylinder_and_flat_ones_the_plate() {
    // Across a long core M = chi H / (1 + chi/2); through a plate M = chi H / (1 + chi).
    // The ends, or the rim, take a share of the order of the aspect.
    for chi in [0.7, 13.0, 4999.0] {
        let wire = Uniform::new(0.0007, 0.7, 1e-6).susceptibility(1, 1.0 + chi);
        let limit = chi / (1.0 + 0.5 * chi);
        assert!(
            (wire / limit - 1.0).abs() < 4e-3,
            "chi {chi}: {wire} {limit}"
        );
    }
    for chi in [0.7, 13.0] {
        let plate = Uniform::new(0.7, 0.0007, 1e-6).susceptibility(0, 1.0 + chi);
        let limit = chi / (1.0 + chi);
        assert!(
            (plate / limit - 1.0).abs() < 0.02,
            "chi {chi}: {plate} {limit}"
        );
    }
}

/// The moment grows with mu_r to a limit, first by chi (1 - N chi), at last by 1/mu_r.
#[test]
fn the_moment_goes_from_its_first_order_to_its_limit() {
    let body = Uniform::new(0.0117, 0.0313, 1e-8);
    for mode in [0, 1] {
        let chi = 1e-6;
        let weak = body.susceptibility(mode, 1.0 + chi) / chi;
        let factor = body.factor(mode);
        assert!(
            (weak - (1.0 - factor * chi)).abs() < 1e-9,
            "mode {mode}: {weak}"
        );
        let at = |mu_r: f64| body.susceptibility(mode, mu_r);
        let (limit, strong, stronger) = (at(1e12), at(1e4), at(2e4));
        let ratio = (limit - strong) / (limit - stronger);
        assert!((ratio - 2.0).abs() < 2e-3, "mode {mode}: {ratio}");
        // A body that no field enters, mu_r = 0, repels: more than -1 per unit volume.
        let repelled = at(1e-9);
        assert!(
            repelled < -1.0 && repelled > -3.0,
            "mode {mode}: {repelled}"
        );
    }
}
