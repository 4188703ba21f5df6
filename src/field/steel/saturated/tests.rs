//! Linear limit, energy against flux, saturation, convergence for any curve and current.

use super::*;
use crate::steel::CoreShape;
use crate::steel::bh_curve::BhCurve;
use crate::steel::cored_coil::{CoredCoil, Excitation};
use crate::steel::generatrix::Resolution;
use crate::steel::magnetized::MagnetizedCore;
use crate::steel::permeability::{Constant, Froehlich, Response};
use crate::winding::Winding;

const WINDING: Winding = Winding {
    inner_radius_m: 0.013,
    outer_radius_m: 0.021,
    length_m: 0.07,
    turns: 930.0,
};
const SHAPE: CoreShape = CoreShape {
    radius_m: 0.012,
    bottom_m: -0.082,
    top_m: 0.004,
};
/// Heights above the coil at which fields are compared, m.
const HEIGHTS_M: [f64; 2] = [0.013, 0.037];

struct Case {
    outline: Generatrix,
    core: SaturatedCore,
    phi: DVector<f64>,
    normal_field_t: Vec<f64>,
}

fn case(tolerance: f64) -> Case {
    let resolution = Resolution::for_tolerance(tolerance);
    let outline = Generatrix::of_coil(&WINDING, SHAPE, &resolution);
    let core = SaturatedCore::new(&outline, resolution.quadrature).expect("a good outline");
    let excitation = Excitation::new(&WINDING, &outline, 1e-12).expect("no node on an edge");
    Case {
        outline,
        core,
        phi: excitation.potential,
        normal_field_t: excitation.normal_field_t_per_a,
    }
}

impl Case {
    /// dB_z/dz that the steel adds on the axis at [`HEIGHTS_M`], T/m.
    fn gradients(&self, solution: &Solution) -> [f64; 2] {
        let layer = MagnetizedCore::new(self.outline.clone(), solution.v_a.as_slice().to_vec());
        HEIGHTS_M.map(|z_m| layer.field(0.0, z_m).dbz_dz)
    }
}

/// A steel with a sharp knee, from a coarse table: its slope has kinks.
fn steel() -> BhCurve {
    let b_t = [0.0, 0.31, 0.9, 1.35, 1.5, 1.72, 1.95, 2.2];
    let h = [0.0, 90.0, 370.0, 800.0, 1500.0, 6300.0, 21e3, 95e3];
    BhCurve::new(&b_t, &h).expect("a good curve")
}

#[test]
fn constant_permeability_is_the_linear_equation() {
    let tolerance = 1e-5;
    let case = case(tolerance);
    for relative in [1.7, 40.0, 1300.0] {
        let found = case.core.solve(&case.phi, &Constant { relative }, None);
        assert_eq!(found.status, Convergence::Converged);
        assert!(found.steps.len() <= 2, "{:?}", found.steps);
        let resolution = Resolution::for_tolerance(tolerance);
        let linear = CoredCoil::at_resolution(&WINDING, SHAPE, relative, &resolution)
            .expect("no node on an edge");
        for (ours, z_m) in case.gradients(&found).iter().zip(HEIGHTS_M) {
            let theirs = linear.core.field(0.0, z_m).dbz_dz;
            assert!((ours / theirs - 1.0).abs() < 2e-5, "{relative} {z_m}");
        }
        let added = case.core.flux_linkage_wb(&found, &case.phi);
        assert!(
            (added / linear.added_inductance_h - 1.0).abs() < 2e-5,
            "{relative}"
        );
    }
    // mu = 1 is no core.
    let none = case
        .core
        .solve(&case.phi, &Constant { relative: 1.0 }, None);
    assert!(none.v_a.add_scalar(-none.v_a[0]).amax() < 1e-9 * case.phi.amax());
    // |B| is a derivative of the elements' polynomials, which overshoot between their nodes: its
    // peak needs a finer outline than the flux.
    let case = self::case(1e-7);
    let none = case
        .core
        .solve(&case.phi, &Constant { relative: 1.0 }, None);
    let field = case.core.field(&none, &Constant { relative: 1.0 });
    // The coil's own field, at the place found and as a mean along the axis.
    let at = field.peak_at_m;
    let own = WINDING.field(at.0, at.1).expect("not on an edge");
    let off = (field.peak_b_t / own.b_r.hypot(own.b_z) - 1.0).abs();
    assert!(off < 1e-4, "{off:e} at {at:?}");
    assert!((at.0 - 0.011).abs() < 1e-12, "{at:?}");
    assert!(field.mean_b_t < field.peak_b_t && field.mean_b_t > 0.5 * field.peak_b_t);
}

#[test]
fn flux_linkage_by_volume_and_by_surface() {
    let case = case(1e-6);
    let current_a = 4.3;
    let found = case.core.solve(&(&case.phi * current_a), &steel(), None);
    assert_eq!(found.status, Convergence::Converged);
    let by_volume = case.core.flux_linkage_wb(&found, &case.phi);
    let by_surface: f64 = case
        .outline
        .areas_m2()
        .zip(&found.v_a)
        .zip(&case.normal_field_t)
        .map(|((area, v), b)| -area * v * b)
        .sum();
    assert!(
        (by_surface / by_volume - 1.0).abs() < 3e-6,
        "{by_surface} {by_volume}"
    );
}

/// The derivative of the coenergy by the current is the flux linkage. With w(h) = int B dH inside
/// and the source's part outside,
/// W = int w dV + mu_0 / 2 v'W'S(1 - W)v - mu_0 phi'S u + mu_0 / 2 phi'S phi.
#[test]
fn coenergy_and_flux_linkage_agree() {
    let case = case(1e-5);
    let law = Froehlich {
        m: 1.4e6,
        h0: 900.0,
    };
    let density = |h: f64| 0.5 * h * h + law.m * (h - law.h0 * (h / law.h0).ln_1p());
    let core = &case.core;
    let boundary_phi = core.trace.to_boundary(&case.phi);
    let schur = core.interior.laplace_schur_m();
    let coenergy = |current_a: f64| {
        let found = core.solve(&(&case.phi * current_a), &law, None);
        assert_eq!(found.status, Convergence::Converged);
        let phi = &boundary_phi * current_a;
        let v = &found.v_boundary_a;
        let u = &phi - &core.w * v;
        let inside = core
            .interior
            .integral(&found.u_a, |at| density(at.h_a_per_m()));
        let outside = 0.5 * (&core.w * v).dot(&(&core.outer_m * v));
        let source = phi.dot(&(schur * (0.5 * &phi - u)));
        let linkage = core.flux_linkage_wb(&found, &case.phi);
        (MU_0_T_M_PER_A * (inside + outside + source), linkage)
    };
    for current_a in [0.3, 5.1, 40.0] {
        let step = 0.05 * current_a;
        let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|k| coenergy(current_a + k * step).0);
        let derivative = (a - 8.0 * b + 8.0 * c - d) / (12.0 * step);
        let linkage = coenergy(current_a).1;
        assert!(
            (derivative / linkage - 1.0).abs() < 2e-5,
            "{current_a}: {derivative} {linkage}"
        );
    }
}

#[test]
fn results_settle_with_the_resolution() {
    let (coarse, fine, finest) = (case(1e-3), case(1e-5), case(1e-7));
    for current_a in [0.8, 6.1, 17.0] {
        let solve = |case: &Case| {
            let found = case.core.solve(&(&case.phi * current_a), &steel(), None);
            assert_eq!(found.status, Convergence::Converged, "{:?}", found.steps);
            let linkage = case.core.flux_linkage_wb(&found, &case.phi);
            let field = case.core.field(&found, &steel());
            (case.gradients(&found), linkage, field)
        };
        let (coarse, fine, finest) = (solve(&coarse), solve(&fine), solve(&finest));
        let error = |a: &([f64; 2], f64, CoreField)| {
            let gradients = (0..2).map(|k| (a.0[k] / finest.0[k] - 1.0).abs());
            gradients.fold((a.1 / finest.1 - 1.0).abs(), f64::max)
        };
        assert!(error(&coarse) < 1e-3, "{current_a}: {}", error(&coarse));
        // The table's kinks, where the whole core is in its knee, are what converges slowly.
        assert!(error(&fine) < 4e-4, "{current_a}: {}", error(&fine));
        assert!((fine.2.peak_b_t / finest.2.peak_b_t - 1.0).abs() < 2e-3);
        assert!((fine.2.mean_b_t / finest.2.mean_b_t - 1.0).abs() < 3e-4);
        assert!(fine.2.resolution < 0.8 * coarse.2.resolution, "{current_a}");
    }
}

#[test]
fn far_in_saturation_the_core_is_a_permanent_magnet() {
    let case = case(1e-5);
    let law = Froehlich {
        m: 1.4e6,
        h0: 900.0,
    };
    // A uniform source far above saturation: M = m along -z everywhere, v = m z.
    let h = 3e9;
    let phi = DVector::from_iterator(case.phi.len(), case.outline.nodes.iter().map(|n| h * n.z_m));
    let found = case.core.solve(&phi, &law, None);
    assert_eq!(found.status, Convergence::Converged);
    let mid = found.v_a[found.v_a.len() / 2];
    let mid_z = case.outline.nodes[found.v_a.len() / 2].z_m;
    for (v, node) in found.v_a.iter().zip(&case.outline.nodes) {
        assert!((v - mid - law.m * (node.z_m - mid_z)).abs() < 1e-5 * law.m * 0.086);
    }
    let field = case.core.field(&found, &law);
    assert!((field.mean_b_t / (MU_0_T_M_PER_A * (h + law.m)) - 1.0).abs() < 1e-4);
}

#[test]
fn a_start_nearby_saves_steps_and_changes_nothing() {
    let case = case(1e-4);
    let first = case.core.solve(&(&case.phi * 5.0), &steel(), None);
    let afresh = case.core.solve(&(&case.phi * 5.1), &steel(), None);
    let onwards = case
        .core
        .solve(&(&case.phi * 5.1), &steel(), Some(&first.v_a));
    assert!(onwards.status == Convergence::Converged && afresh.status == Convergence::Converged);
    let (a, b) = (case.gradients(&afresh), case.gradients(&onwards));
    assert!((a[0] / b[0] - 1.0).abs() < 1e-9 && (a[1] / b[1] - 1.0).abs() < 1e-9);
    // Reversed current, reversed layer.
    let reversed = case.core.solve(&(&case.phi * -5.1), &steel(), None);
    let c = case.gradients(&reversed);
    assert!((a[0] / c[0] + 1.0).abs() < 1e-9, "{a:?} {c:?}");
}

#[test]
fn any_current_converges() {
    let case = case(1e-3);
    for exponent in -9..=7 {
        let current_a = 1.3 * 10.0_f64.powi(exponent);
        let found = case.core.solve(&(&case.phi * current_a), &steel(), None);
        assert_eq!(
            found.status,
            Convergence::Converged,
            "{current_a}: {:?}",
            found.steps
        );
        let field = case.core.field(&found, &steel());
        assert!(field.peak_b_t > 0.0 && field.mean_b_t <= 1.2 * field.peak_b_t);
    }
    let none = case.core.solve(&(&case.phi * 0.0), &steel(), None);
    assert!(none.status == Convergence::Converged && none.v_a.amax() == 0.0);
    assert!(case.core.field(&none, &steel()).peak_b_t < 1e-15);
}

/// B that falls beyond a field: no material.
#[derive(Debug)]
struct Falling;

impl Permeability for Falling {
    fn response(&self, h: f64) -> Response {
        Response {
            relative: 1000.0 * (-h / 50.0).exp(),
            differential: 1000.0 * (-h / 50.0).exp() * (1.0 - h / 50.0),
        }
    }
}

#[test]
fn what_has_no_solution_ends_as_stalled() {
    let case = case(1e-3);
    let found = case.core.solve(&(&case.phi * 300.0), &Falling, None);
    assert_eq!(found.status, Convergence::Stalled);
    let mut phi = case.phi.clone();
    phi[7] = f64::NAN;
    assert_eq!(
        case.core.solve(&phi, &steel(), None).status,
        Convergence::Stalled
    );
}

/// The core's part of the inductance is that of an infinite permeability less a part of 1 / mu.
/// At 1e8 rounding once took 8e-5 of it.
#[test]
fn any_constant_permeability() {
    let case = case(1e-5);
    let added_h = |relative: f64| {
        let found = case.core.solve(&case.phi, &Constant { relative }, None);
        assert_eq!(found.status, Convergence::Converged, "{relative:e}");
        case.core.flux_linkage_wb(&found, &case.phi)
    };
    let most_h = added_h(1.3e11);
    let lost_h = |relative: f64| (most_h - added_h(relative)) / (1.0 / relative - 1.0 / 1.3e11);
    let expected = lost_h(1.7e6);
    for (relative, allowed) in [(1.7e5, 1e-4), (1.7e7, 1e-4), (1.7e8, 1e-3), (1.7e9, 0.02)] {
        let off = lost_h(relative) / expected - 1.0;
        assert!(off.abs() < allowed, "{relative:e}: {off:e}");
    }
}

/// Its permeability grows without bound towards no current: u is then far below phi, and its
/// rounding is above the tolerance.
#[test]
fn a_curve_that_starts_level() {
    let case = case(1e-5);
    let law = BhCurve::new(&[0.0, 0.9, 1.1, 1.9], &[0.0, 130.0, 700.0, 90e3]).expect("a curve");
    let added_h: Vec<f64> = (-10..=1)
        .map(|exponent| {
            let current_a = 1.3 * 10f64.powi(exponent);
            let found = case.core.solve(&(&case.phi * current_a), &law, None);
            assert_eq!(found.status, Convergence::Converged, "{current_a} A");
            case.core.flux_linkage_wb(&found, &case.phi) / current_a
        })
        .collect();
    assert!(
        added_h.windows(2).all(|h| h[1] < h[0] * (1.0 + 1e-9)),
        "{added_h:?}"
    );
    assert!(added_h[0] - added_h[5] < 1e-6 * added_h[0], "{added_h:?}");
    assert!(added_h[0] - added_h[11] > 0.01 * added_h[0], "{added_h:?}");
}

/// A soft alloy whose permeability falls from a hundred thousand to one within a tenth of a tesla.
fn soft_alloy() -> BhCurve {
    let b_t = [0.0, 0.02, 0.2, 0.8, 1.3, 1.45, 1.52, 1.56, 1.58, 1.6];
    let h = [0.0, 1.0, 3.0, 5.0, 8.0, 20.0, 100.0, 1e3, 5e3, 15e3];
    BhCurve::new(&b_t, &h).expect("a good curve")
}

#[test]
fn the_sharpest_knees_converge_at_every_current() {
    let case = case(1e-4);
    let law = soft_alloy();
    for current_a in [0.5, 2.0, 6.0, 8.0, 12.0, 20.0, 40.0, 100.0, 1e3] {
        let found = case.core.solve(&(&case.phi * current_a), &law, None);
        assert_eq!(found.status, Convergence::Converged, "{current_a} A");
        assert!(found.steps.len() <= 60, "{current_a} A: {:?}", found.steps);
    }
}
