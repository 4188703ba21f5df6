//! The magnet's rules against Ampere's picture: the cylinder as a sheet of current on its side.

// Two tests print tables; see the doc comment of `field::magnet`.
#![allow(clippy::print_stdout)]

use std::f64::consts::TAU;

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::dipole::{cylinder_moment_a_m2, tilted_moment_a_m2};
use fluxform_field::frame::{CartesianField, to_cartesian};
use fluxform_field::magnet::{Cylinder, MagnetRule, NoRule, Sources};
use fluxform_field::ring::Potentials;
use fluxform_field::winding::Winding;
use fluxform_numerics::gauss;
use fluxform_numerics::vec3::{cross, minus, norm, plus};

type Vector = [f64; 3];

const MAGNETIZATION_A_PER_M: f64 = 1.1579e6;
const SEED_MAGNET: Cylinder = Cylinder {
    diameter_m: 0.01,
    length_m: 0.01,
};
const SEED_COIL: Winding = Winding {
    inner_radius_m: 0.012,
    outer_radius_m: 0.019,
    length_m: 0.1,
    turns: 1429.0,
};
/// Turned about no symmetric angle.
const TILT_DEG: [f64; 2] = [23.0, -41.0];

fn moment(size: Cylinder, tilt_deg: [f64; 2]) -> Vector {
    let m = cylinder_moment_a_m2(size.diameter_m, size.length_m, MAGNETIZATION_A_PER_M);
    tilted_moment_a_m2(-m, tilt_deg)
}

fn at(p: Vector) -> CartesianField {
    let axial = SEED_COIL
        .field(p[0].hypot(p[1]), p[2])
        .expect("not on an edge");
    to_cartesian(&axial, p[0], p[1])
}

fn distance(a: Vector, b: Vector) -> f64 {
    norm(minus(a, b))
}

/// Force and torque by a rule in the seed coil's field, per ampere.
fn by_rule(rule: &MagnetRule, centre: Vector) -> (Vector, Vector) {
    by_rule_in(rule, centre, &at)
}

fn by_rule_in(
    rule: &MagnetRule,
    centre: Vector,
    at: &dyn Fn(Vector) -> CartesianField,
) -> (Vector, Vector) {
    let fields: Vec<_> = rule
        .nodes()
        .iter()
        .map(|node| at(plus(centre, node.offset_m)))
        .collect();
    let b: Vec<_> = fields.iter().map(|f| f.field_t_per_a).collect();
    let g: Vec<_> = fields.iter().map(|f| f.gradient_t_per_m_per_a).collect();
    (rule.force_n(&g), rule.torque_n_m(&b, &g))
}

/// Force and torque on a sheet of current M on the cylinder's side, per ampere of the coil:
/// sums over azimuth and length that are converged to rounding.
fn by_current_sheet(size: Cylinder, tilt_deg: [f64; 2], centre: Vector) -> (Vector, Vector) {
    by_current_sheet_in(size, tilt_deg, centre, &at)
}

fn by_current_sheet_in(
    size: Cylinder,
    tilt_deg: [f64; 2],
    centre: Vector,
    at: &dyn Fn(Vector) -> CartesianField,
) -> (Vector, Vector) {
    let m = tilted_moment_a_m2(-1.0, tilt_deg);
    let e1 = {
        let v = cross([0.3, 0.9, 0.1], m);
        v.map(|x| x / norm(v))
    };
    let e2 = cross(m, e1);
    let (rule, steps) = (gauss::rule(48), 200);
    let (mut force, mut torque) = ([0.0; 3], [0.0; 3]);
    let radius = 0.5 * size.diameter_m;
    for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
        for step in 0..steps {
            let (sine, cosine) = (TAU * f64::from(step) / f64::from(steps)).sin_cos();
            let outward: Vector = std::array::from_fn(|i| cosine * e1[i] + sine * e2[i]);
            let r = std::array::from_fn(|i| radius * outward[i] + 0.5 * size.length_m * x * m[i]);
            let area = 0.5 * size.length_m * weight * TAU * radius / f64::from(steps);
            let current = cross(m, outward).map(|v| v * MAGNETIZATION_A_PER_M * area);
            let f = cross(current, at(plus(centre, r)).field_t_per_a);
            force = plus(force, f);
            torque = plus(torque, cross(r, f));
        }
    }
    (force, torque)
}

/// Sizes against which errors of force and torque are relative: those of a dipole.
fn sizes(m: Vector, centre: Vector) -> (f64, f64) {
    let field = at(centre);
    let gradient = field
        .gradient_t_per_m_per_a
        .iter()
        .flatten()
        .map(|g| g * g)
        .sum::<f64>()
        .sqrt();
    (norm(m) * gradient, norm(m) * norm(field.field_t_per_a))
}

/// Run with `cargo test --test field magnet -- --nocapture table` to see it.
#[test]
fn the_table_of_nodes_against_accuracy() {
    println!("seed magnet over the seed's winding: nodes and error of the force, upright; tilted");
    println!("height  bound 1e-3           1e-6                  1e-9                  1e-12");
    for height in [0.01, 0.02, 0.03, 0.05] {
        let mut line = format!("{:>3} mm", height * 1e3);
        for tolerance in [1e-3, 1e-6, 1e-9, 1e-12] {
            let sources = Sources::Below { height_m: height };
            for tilt in [[0.0; 2], TILT_DEG] {
                let m = moment(SEED_MAGNET, tilt);
                let Ok(rule) = MagnetRule::cylinder(SEED_MAGNET, m, sources, tolerance) else {
                    line += "  too close ";
                    continue;
                };
                assert!(rule.bound() <= tolerance);
                let centre = [0.004, -0.007, height];
                let (force, torque) = by_rule(&rule, centre);
                let (exact_force, exact_torque) = by_current_sheet(SEED_MAGNET, tilt, centre);
                let (force_size, torque_size) = sizes(m, centre);
                let error = distance(force, exact_force) / force_size;
                let limit = tolerance + 3e-13;
                assert!(error < limit, "{height} {tolerance}: {error:e}");
                assert!(
                    distance(torque, exact_torque)
                        < limit * torque_size.max(force_size * SEED_MAGNET.reach_m())
                );
                line += &format!("  {:>4} {error:.0e}", rule.nodes().len());
            }
            line += " ;";
        }
        println!("{line}");
    }
}

/// Field of a unit charge at the origin, in units in which its gradient at distance 1 is 2.
fn charge(p: Vector) -> CartesianField {
    let r = norm(p);
    CartesianField {
        field_t_per_a: p.map(|x| x / r.powi(3)),
        gradient_t_per_m_per_a: std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let delta = if i == j { 1.0 } else { 0.0 };
                delta / r.powi(3) - 3.0 * p[i] * p[j] / r.powi(5)
            })
        }),
    }
}

#[test]
fn the_bound_holds_for_a_charge_at_the_nearest_place() {
    // The worst that the rule promises to stand; relative to the charge's gradient 2 / distance^3.
    println!(
        "height (tolerance): nodes, factor, charges, errors of both with a charge under axis, rim and aside"
    );
    for height in [0.006, 0.007, 0.0085, 0.01, 0.013, 0.02, 0.03] {
        for tolerance in [1e-3, 1e-6, 1e-9] {
            for tilt in [[0.0; 2], TILT_DEG] {
                let m = moment(SEED_MAGNET, tilt);
                let sources = Sources::Below { height_m: height };
                let rule = match MagnetRule::cylinder(SEED_MAGNET, m, sources, tolerance) {
                    Ok(rule) => rule,
                    // Tilted, its corner is 7.07 mm below its centre.
                    Err(NoRule::Touches { .. }) if tilt != [0.0; 2] && height < 0.00708 => continue,
                    Err(NoRule::TooClose { .. }) if height <= 0.01 && tilt != [0.0; 2] => continue,
                    Err(NoRule::TooClose { .. }) if height < 0.0065 && tolerance < 1e-5 => continue,
                    Err(error) => panic!("{height} {tolerance:e} {tilt:?}: {error}"),
                };
                let charges = SEED_MAGNET.charges(m, sources, tolerance).unwrap();
                let size = norm(m) * 2.0 / height.powi(3);
                let mut line = String::new();
                for aside in [0.0, 0.2, 0.4, 0.5, -0.5, 0.6, 0.9] {
                    let centre = [aside * height, 0.1 * height, height];
                    let (force, torque) = by_rule_in(&rule, centre, &charge);
                    let (exact_force, exact_torque) =
                        by_current_sheet_in(SEED_MAGNET, tilt, centre, &charge);
                    let of_charges = charges.iter().fold([0.0; 3], |sum, end| {
                        let field = charge(plus(centre, end.offset_m)).field_t_per_a;
                        plus(sum, field.map(|b| end.charge_a_m * b))
                    });
                    for (force, from) in [(force, "dipoles"), (of_charges, "charges")] {
                        let error = distance(force, exact_force) / size;
                        line += &format!(" {error:.0e}");
                        assert!(
                            error < tolerance,
                            "{height} {tolerance:e} {tilt:?}, {from}: {error:e}"
                        );
                    }
                    // The field of the charge is height / 2 times its gradient.
                    let turn = distance(torque, exact_torque) / (0.5 * size * height);
                    assert!(
                        turn < 3.0 * tolerance,
                        "{height} {tolerance:e} {tilt:?}: {turn:e}"
                    );
                }
                let (nodes, factor) = (rule.nodes().len(), rule.amplification());
                let ends = charges.len();
                println!("{height} ({tolerance:e}): {nodes:>4} {factor:.0} {ends:>4}{line}");
            }
        }
    }
}

#[test]
fn the_seeds_height_needs_few_nodes() {
    let sources = Sources::Below { height_m: 0.03 };
    let m = moment(SEED_MAGNET, [0.0; 2]);
    let rule = MagnetRule::cylinder(SEED_MAGNET, m, sources, 1e-9).expect("far enough");
    assert!(rule.nodes().len() <= 13, "{}", rule.nodes().len());
    // On the axis: the force between coaxial currents is the gradient of their mutual inductance,
    // here the difference of the flux through the magnet's two ends.
    let flux = |z: f64| {
        let radius = 0.5 * SEED_MAGNET.diameter_m;
        let (radial, axial) = (gauss::rule(24), gauss::rule(48));
        let mut loops = Potentials::default();
        for (x, wx) in radial.nodes.iter().zip(&radial.weights) {
            let a = 0.0155 + 0.0035 * x;
            for (y, wy) in axial.nodes.iter().zip(&axial.weights) {
                let u = z + 0.05 + 0.05 * y;
                loops.add_mutual([a, radius], [a - radius, u], 0.25 * wx * wy);
            }
        }
        MU_0_T_M_PER_A * SEED_COIL.turns * loops.sum()
    };
    let expected = -MAGNETIZATION_A_PER_M * (flux(0.035) - flux(0.025));
    let gz: Vec<_> = rule
        .nodes()
        .iter()
        .map(|node| at(plus([0.0, 0.0, 0.03], node.offset_m)).gradient_t_per_m_per_a[2][2])
        .collect();
    let force = rule.vertical_force_n(&gz);
    assert!((force / expected - 1.0).abs() < 1e-10, "{force} {expected}");
}

#[test]
fn all_proportions_agree_with_the_current_sheet() {
    for (diameter_m, length_m) in [(0.013, 0.0007), (0.007, 0.011), (0.0013, 0.021)] {
        let size = Cylinder {
            diameter_m,
            length_m,
        };
        for (sources, centre) in [
            (Sources::Below { height_m: 0.0127 }, [0.0, 0.0, 0.0127]),
            (Sources::Below { height_m: 0.023 }, [0.017, 0.006, 0.023]),
            (Sources::Beyond { distance_m: 0.016 }, [0.036, 0.0, -0.05]),
        ] {
            for tilt in [[0.0; 2], TILT_DEG] {
                let m = moment(size, tilt);
                let rule = MagnetRule::cylinder(size, m, sources, 1e-7).expect("a gap");
                let (force, torque) = by_rule(&rule, centre);
                let (exact_force, exact_torque) = by_current_sheet(size, tilt, centre);
                let (force_size, torque_size) = sizes(m, centre);
                let error = distance(force, exact_force) / force_size;
                assert!(error < 1e-7, "{size:?} {sources:?} {tilt:?}: {error:e}");
                let torque_size = torque_size.max(force_size * size.reach_m());
                assert!(distance(torque, exact_torque) < 1e-7 * torque_size);
            }
        }
    }
}

#[test]
fn far_away_the_first_correction_is_the_cylinders_quadrupole() {
    // F / F_dipole = 1 + (h^2/24 - a^2/8) g''/g: the ratio of the corrections tends to one like
    // (size / distance)^2.
    let size = Cylinder {
        diameter_m: 0.007,
        length_m: 0.013,
    };
    let m = moment(size, [0.0; 2]);
    let g = |z: f64| at([0.0, 0.0, z]).gradient_t_per_m_per_a[2][2];
    let excess = |z: f64| {
        let rule =
            MagnetRule::cylinder(size, m, Sources::Below { height_m: z }, 1e-13).expect("far");
        let gz: Vec<_> = rule.nodes().iter().map(|n| g(z + n.offset_m[2])).collect();
        let step = 0.02 * z;
        let second = (-g(z - 2.0 * step) + 16.0 * g(z - step) - 30.0 * g(z) + 16.0 * g(z + step)
            - g(z + 2.0 * step))
            / (12.0 * step * step);
        let predicted = (0.013_f64.powi(2) / 24.0 - 0.0035_f64.powi(2) / 8.0) * second;
        (rule.vertical_force_n(&gz) / m[2] - g(z)) / predicted - 1.0
    };
    let (near, far) = (excess(0.1), excess(0.3));
    assert!(near.abs() < 1e-2 && far.abs() < 1.5e-3, "{near:e} {far:e}");
}

#[test]
fn the_torque_is_the_energys_slope_under_a_turn() {
    // Energy of a moment turned about y by t: U = -integral M . B; tau_y = -dU/dt. The energy is
    // integrated over the volume.
    let centre = [0.006, 0.011, 0.017];
    let size = SEED_MAGNET;
    let energy = |t_deg: f64| {
        let n = tilted_moment_a_m2(1.0, [0.0, t_deg]);
        let e1 = {
            let v = cross([0.0, 1.0, 0.0], n);
            v.map(|x| x / norm(v))
        };
        let e2 = cross(n, e1);
        let rule = gauss::rule(14);
        let steps = 32;
        let mut sum = 0.0;
        for (x, wx) in rule.nodes.iter().zip(&rule.weights) {
            for (t, wt) in rule.nodes.iter().zip(&rule.weights) {
                let rho = 0.005 * (0.5 * (1.0 + t)).sqrt();
                for step in 0..steps {
                    let (s, c) = (TAU * f64::from(step) / f64::from(steps)).sin_cos();
                    let p = std::array::from_fn(|i| {
                        centre[i] + 0.005 * x * n[i] + rho * (c * e1[i] + s * e2[i])
                    });
                    let b = at(p).field_t_per_a;
                    let along: f64 = (0..3).map(|i| n[i] * b[i]).sum();
                    sum += 0.25 * wx * wt / f64::from(steps) * along;
                }
            }
        }
        norm(moment(size, [0.0; 2])) * sum
    };
    let sources = Sources::Below { height_m: 0.017 };
    let m = tilted_moment_a_m2(-moment(size, [0.0; 2])[2], [0.0, 31.0]);
    let rule = MagnetRule::cylinder(size, m, sources, 1e-11).expect("a gap");
    let slope = by_rule(&rule, centre).1[1];
    // U = -energy for the moment along +n, so tau_y = d(energy)/dt.
    let remainder = |step: f64| {
        let turned = energy(31.0 + step.to_degrees()) - energy(31.0);
        (turned - step * slope).abs()
    };
    let order = (remainder(1e-2) / remainder(1e-3)).log10();
    assert!((order - 2.0).abs() < 0.05, "{order}");
}

#[test]
fn a_magnet_of_a_micrometre_is_a_dipole() {
    let size = Cylinder {
        diameter_m: 1e-6,
        length_m: 1.3e-6,
    };
    let centre = [0.011, -0.003, 0.021];
    let m = moment(size, TILT_DEG);
    let rule =
        MagnetRule::cylinder(size, m, Sources::Below { height_m: 0.021 }, 1e-12).expect("far");
    let (force, torque) = by_rule(&rule, centre);
    let (dipole_force, dipole_torque) = by_rule(&MagnetRule::dipole(m), centre);
    assert!(distance(force, dipole_force) < 1e-8 * norm(dipole_force));
    assert!(distance(torque, dipole_torque) < 1e-8 * norm(dipole_torque));
    // Two micrometres above the plane, where its size matters, it scales like a large one.
    let near = Sources::Below { height_m: 2e-6 };
    let large = Cylinder {
        diameter_m: 0.01,
        length_m: 0.013,
    };
    let small_rule = MagnetRule::cylinder(size, m, near, 1e-6).expect("a gap");
    let large_rule =
        MagnetRule::cylinder(large, m, Sources::Below { height_m: 0.02 }, 1e-6).expect("a gap");
    for (s, l) in small_rule.nodes().iter().zip(large_rule.nodes()) {
        let scaled = s.offset_m.map(|v| v * 1e4);
        assert!(distance(scaled, l.offset_m) < 1e-13 * large.reach_m());
    }
}

#[test]
fn tilted_magnets_need_the_row_of_b_z() {
    let centre = [0.013, 0.004, 0.026];
    let sources = Sources::Below { height_m: 0.026 };
    let m = moment(SEED_MAGNET, TILT_DEG);
    let rule = MagnetRule::cylinder(SEED_MAGNET, m, sources, 1e-8).expect("a gap");
    assert!(!rule.is_upright());
    let rows: Vec<_> = rule
        .nodes()
        .iter()
        .map(|node| at(plus(centre, node.offset_m)).gradient_t_per_m_per_a[2])
        .collect();
    let vertical = rule.vertical_force_of_rows_n(&rows);
    let force = by_rule(&rule, centre).0;
    assert!((vertical - force[2]).abs() < 1e-13 * norm(force));
}

#[test]
fn the_two_orders_bracket_the_error() {
    let centre = [0.004, -0.007, 0.03];
    let m = moment(SEED_MAGNET, [0.0; 2]);
    let exact = by_current_sheet(SEED_MAGNET, [0.0; 2], centre).0;
    for tolerance in [1e-4, 1e-6, 1e-8] {
        let sources = Sources::Below { height_m: 0.03 };
        let rule = MagnetRule::cylinder(SEED_MAGNET, m, sources, tolerance).expect("far");
        let gradients: Vec<_> = rule
            .nodes()
            .iter()
            .map(|n| at(plus(centre, n.offset_m)).gradient_t_per_m_per_a)
            .collect();
        let estimate = rule
            .force_of_orders_differs_n(&gradients)
            .expect("more than one node");
        let error = distance(rule.force_n(&gradients), exact);
        let size = sizes(m, centre).0;
        assert!(
            error < estimate && estimate < 300.0 * tolerance * size,
            "{error:e} {estimate:e}"
        );
    }
}

#[test]
fn what_cannot_be_done_is_refused() {
    let m = moment(SEED_MAGNET, [0.0; 2]);
    let rule = |height_m, tolerance| {
        MagnetRule::cylinder(SEED_MAGNET, m, Sources::Below { height_m }, tolerance)
    };
    assert!(matches!(rule(0.005, 1e-6), Err(NoRule::Touches { .. })));
    assert!(matches!(rule(-0.1, 1e-6), Err(NoRule::Touches { .. })));
    assert!(matches!(
        rule(0.005 + 1e-7, 1e-6),
        Err(NoRule::TooClose { .. })
    ));
    assert!(matches!(rule(0.03, 0.0), Err(NoRule::NotANumber)));
    assert!(matches!(rule(f64::NAN, 1e-6), Err(NoRule::NotANumber)));
    let flat = Cylinder {
        diameter_m: 0.01,
        length_m: 0.0,
    };
    let sources = Sources::Beyond { distance_m: 0.1 };
    assert_eq!(
        MagnetRule::cylinder(flat, m, sources, 1e-6),
        Err(NoRule::NotANumber)
    );
}

#[test]
fn on_the_axis_an_upright_magnet_feels_no_side_force_and_no_torque() {
    let m = moment(SEED_MAGNET, [0.0; 2]);
    for (height, tolerance) in [(0.03, 1e-9), (0.009, 1e-6)] {
        let sources = Sources::Below { height_m: height };
        let rule = MagnetRule::cylinder(SEED_MAGNET, m, sources, tolerance).expect("a gap");
        let centre = [0.0, 0.0, height];
        let (force, torque) = by_rule(&rule, centre);
        let (force_size, torque_size) = sizes(m, centre);
        assert!(force[0].hypot(force[1]) < 1e-14 * force_size, "{force:?}");
        assert!(norm(torque) < 1e-14 * torque_size, "{torque:?}");
        // Turned over, it is pushed the other way.
        let over = MagnetRule::cylinder(SEED_MAGNET, m.map(|v| -v), sources, tolerance);
        let pushed = by_rule(&over.expect("a gap"), centre).0;
        assert!((pushed[2] + force[2]).abs() < 1e-14 * force_size);
    }
}
