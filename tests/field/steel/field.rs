//! The field of coil and core against Maxwell's equations, and the flux through the winding.

use std::f64::consts::PI;

use fluxform_field::steel::CoreShape;
use fluxform_field::winding::AxialField;
use fluxform_numerics::gauss;

use super::support::{Design, SEED_COIL, designs};

/// The smooth part of the derivative: central differences of fourth order.
fn derivative(f: impl Fn(f64) -> f64, h: f64) -> f64 {
    (8.0 * (f(h) - f(-h)) - (f(2.0 * h) - f(-2.0 * h))) / (12.0 * h)
}

#[test]
fn the_gradient_is_the_fields_derivative_outside_and_inside() {
    for design in designs(4) {
        let core = design.solve(1e-6).core;
        let shape = design.core;
        let radius = shape.radius_m;
        let middle = 0.5 * (shape.top_m + shape.bottom_m);
        for (r_m, z_m) in [
            (0.37 * radius, shape.top_m + 0.43 * radius),
            (1.7 * radius, shape.top_m + 0.21 * radius),
            (1.31 * radius, middle),
            (0.6 * radius, shape.bottom_m - 0.7 * radius),
            (0.41 * radius, middle),
            (5.1 * radius, shape.top_m + 7.3 * radius),
        ] {
            let at = core.field(r_m, z_m);
            let h = 2e-3 * radius.min(0.5 * shape.length_m());
            let along_r =
                |pick: fn(&AxialField) -> f64| derivative(|d| pick(&core.field(r_m + d, z_m)), h);
            let along_z =
                |pick: fn(&AxialField) -> f64| derivative(|d| pick(&core.field(r_m, z_m + d)), h);
            let size = at.gradient_norm();
            // Deep in a long core the gradient is small against the field, whose last digits the
            // difference magnifies.
            let limit = 2e-8 + 2e-13 * at.b_r.hypot(at.b_z) / (h * size);
            for (name, value, expected) in [
                ("dBr/dr", at.dbr_dr, along_r(|f| f.b_r)),
                ("dBr/dz", at.dbr_dz, along_z(|f| f.b_r)),
                ("dBz/dr", at.dbz_dr, along_r(|f| f.b_z)),
                ("dBz/dz", at.dbz_dz, along_z(|f| f.b_z)),
                ("Br/r", at.br_over_r, at.b_r / r_m),
                ("div B", at.dbr_dr + at.br_over_r + at.dbz_dz, 0.0),
                ("curl B", at.dbr_dz - at.dbz_dr, 0.0),
            ] {
                let off = (value - expected).abs() / size;
                assert!(
                    off < limit,
                    "{design:?} at {r_m} {z_m}: {name} is off by {off:e}"
                );
            }
        }
    }
}

/// Through the steel's surface normal B is continuous, and so is tangential H = B / (mu_0 mu_r)
/// inside, B / mu_0 outside: the conditions that the solution is made of, on points that are no
/// nodes.
#[test]
fn normal_b_and_tangential_h_pass_through_the_surface() {
    for mu_r in [7.3, 1000.0] {
        let design = Design {
            winding: SEED_COIL,
            core: CoreShape {
                radius_m: 0.0113,
                bottom_m: -0.093,
                top_m: 0.0071,
            },
            mu_r,
        };
        let coil = design.solve(1e-9);
        let shape = design.core;
        let step = 1e-6 * shape.radius_m;
        let places = [
            (shape.radius_m, -0.0123, [1.0, 0.0]),
            (shape.radius_m, -0.0501, [1.0, 0.0]),
            (shape.radius_m, -0.0777, [1.0, 0.0]),
            (shape.radius_m, 0.0032, [1.0, 0.0]),
            (0.31 * shape.radius_m, shape.top_m, [0.0, 1.0]),
            (0.83 * shape.radius_m, shape.top_m, [0.0, 1.0]),
            (0.53 * shape.radius_m, shape.bottom_m, [0.0, -1.0]),
        ];
        let mut worst = 0.0_f64;
        for (r_m, z_m, n) in places {
            // The field on either side of the surface, carried there by its own gradient.
            let side = |sign: f64| {
                let d = sign * step;
                let f = coil
                    .field(r_m + d * n[0], z_m + d * n[1])
                    .expect("off the winding");
                let (n_r, n_z): (f64, f64) = (n[0], n[1]);
                let b_r = f.b_r - d * (n_r * f.dbr_dr + n_z * f.dbr_dz);
                let b_z = f.b_z - d * (n_r * f.dbz_dr + n_z * f.dbz_dz);
                (n_r * b_r + n_z * b_z, n_r * b_z - n_z * b_r)
            };
            let ((normal_in, along_in), (normal_out, along_out)) = (side(-1.0), side(1.0));
            let size = normal_out.hypot(along_out);
            let off_normal = (normal_in - normal_out).abs() / size;
            let off_along = (along_in / mu_r - along_out).abs() / size;
            worst = worst.max(off_normal).max(off_along);
            assert!(
                off_normal < 1e-5,
                "mu_r {mu_r} at {r_m} {z_m}: normal B jumps by {off_normal:e}"
            );
            assert!(
                off_along < 1e-5,
                "mu_r {mu_r} at {r_m} {z_m}: tangential H jumps by {off_along:e}"
            );
        }
        println!("mu_r {mu_r}: conditions met to {worst:.1e}");
    }
}

/// The inductance found by reciprocity is the flux of the steel's field through the turns.
#[test]
fn the_flux_through_the_winding_is_the_added_inductance() {
    let mut checked = 0;
    for mut design in designs(40) {
        // A gap that plain quadrature resolves.
        if design.core.radius_m > 0.8 * design.winding.inner_radius_m {
            continue;
        }
        design.mu_r = design.mu_r.min(2000.0);
        let coil = design.solve(1e-8);
        let Design { winding, core, .. } = design;
        let (a1, a2, length) = (
            winding.inner_radius_m,
            winding.outer_radius_m,
            winding.length_m,
        );
        let start = core.top_m.max(0.0) + core.radius_m;
        // The flux function falls by 2 pi r B_r along z: from a plane above down to every turn.
        let mut linked = 0.0;
        gauss_on(a1, a2, 2, &mut |a, weight_a| {
            let mut flux = 0.0;
            gauss_on(0.0, a, 6, &mut |r, weight| {
                flux += weight * 2.0 * PI * r * coil.core.field(r, start).b_z;
            });
            let mut turns = flux * length;
            for (lo, hi) in [(-length, 0.0), (0.0, start)] {
                let pieces = (4.0 * (hi - lo) / (a1 - core.radius_m)).ceil() as usize;
                gauss_on(lo, hi, pieces.min(60), &mut |z, weight| {
                    let below = (z + length).min(length);
                    turns += weight * below * 2.0 * PI * a * coil.core.field(a, z).b_r;
                });
            }
            linked += weight_a * turns;
        });
        let flux = linked * winding.turns / ((a2 - a1) * length);
        let off = flux / coil.added_inductance_h - 1.0;
        assert!(
            off.abs() < 1e-6,
            "{design:?}: {flux:e} and {:e} H, off by {off:e}",
            coil.added_inductance_h
        );
        checked += 1;
        if checked == 4 {
            return;
        }
    }
    panic!("too few designs with a gap");
}

fn gauss_on(lo: f64, hi: f64, pieces: usize, visit: &mut dyn FnMut(f64, f64)) {
    let rule = gauss::rule(12);
    let half = 0.5 * (hi - lo) / pieces as f64;
    for piece in 0..pieces {
        let middle = lo + half * (2 * piece + 1) as f64;
        for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
            visit(middle + half * x, half * weight);
        }
    }
}
