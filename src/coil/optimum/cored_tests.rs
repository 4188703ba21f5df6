//! Cored coils: slopes, references, brute force, limits.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use super::cored::{CoreRule, CoredModel, NoCoredCoil};
use super::problem::Problem;
use super::sqp::Smooth;
use super::*;
use crate::inductance::self_inductance_h;
use fluxform_base::progress::Silent;
use fluxform_design::{Design, Limits, Need};
use fluxform_field::magnet::MagnetRule;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::winding::Winding;

const HEIGHT_M: f64 = 0.03;
const NOTHING: Need = Need {
    coil: false,
    array: false,
    target: false,
    workspace: false,
};

fn magnet() -> MagnetRule {
    MagnetRule::dipole([0.0, 0.0, -1.1579e6 * 0.25 * PI * 1e-6])
}

fn rule() -> CoreRule {
    CoreRule {
        clearance_m: 0.0,
        above_m: 0.0,
        below_m: 0.01,
        relative_permeability: 1000.0,
    }
}

fn model(rule: CoreRule, with_peak: bool) -> CoredModel {
    CoredModel::new(HEIGHT_M, &magnet(), rule, with_peak).expect("above the core")
}

fn in_repository(path: &str) -> PathBuf {
    let member = Path::new(env!("CARGO_MANIFEST_DIR"));
    member.join("../..").join(path)
}

fn seed() -> Design {
    Design::read(&in_repository("designs/seed.toml"), NOTHING)
        .expect("a good design")
        .0
}

fn task_of(limits: Limits) -> Task {
    let task = task::of_design(&seed(), Fixed::default()).expect("a task");
    Task { limits, ..task }
}

fn quick() -> Settings {
    Settings {
        valley: false,
        starts: 8,
        ..Settings::default()
    }
}

/// Force at 1 A and inductance of a window wound with 0.7 mm wire, solved for itself.
fn direct(window: &Window, rule: &CoreRule) -> (f64, f64) {
    let winding = Winding {
        inner_radius_m: window.inner_radius_m,
        outer_radius_m: window.outer_radius_m(),
        length_m: window.length_m,
        turns: window.depth_m * window.length_m / 0.49e-6,
    };
    let shape = CoreShape {
        radius_m: window.inner_radius_m - rule.clearance_m,
        bottom_m: -(window.length_m + rule.below_m),
        top_m: rule.above_m,
    };
    let coil = CoredCoil::new(&winding, shape, rule.relative_permeability, 1e-6, HEIGHT_M)
        .expect("no node on an edge");
    let gradient = coil.field(0.0, HEIGHT_M).expect("off the edges").dbz_dz;
    let moment = 1.1579e6 * 0.25 * PI * 1e-6;
    let inductance_h = self_inductance_h(&winding) + coil.added_inductance_h;
    (moment * gradient.abs(), inductance_h)
}

#[test]
fn both_tables_are_the_solver_s() {
    let odd = CoreRule {
        clearance_m: 0.0007,
        above_m: 0.003,
        below_m: 0.0013,
        relative_permeability: 170.0,
    };
    for rule in [rule(), odd] {
        let coarse = model(rule, false);
        let middle = Window {
            inner_radius_m: 0.0083,
            depth_m: 0.0107,
            length_m: 0.057,
        };
        let sharp = coarse.sharpened(&middle).expect("a core fits");
        assert!(sharp.relative_error() < 1e-5);
        let moved = Window {
            inner_radius_m: 0.0090,
            depth_m: 0.0099,
            length_m: 0.049,
        };
        let models: [(&dyn CoilModel, f64); 2] = [(&coarse, 2e-3), (&*sharp, 5e-6)];
        for window in [middle, moved] {
            let (force_n, inductance_h) = direct(&window, &rule);
            for (model, tolerance) in models {
                let response = model
                    .response(&window, 1.0 / 0.49e-6, 1.0, true)
                    .expect("in the domain");
                let force = response.force_n.value / force_n - 1.0;
                let inductance = response.inductance_h.value / inductance_h - 1.0;
                assert!(force.abs() < tolerance, "{window:?}: {force:e}");
                assert!(inductance.abs() < tolerance, "{window:?}: {inductance:e}");
            }
        }
    }
}

#[test]
fn taylor_test_of_force_and_every_limit() {
    let limits = Limits {
        power_max_w: Some(20.0),
        mass_max_kg: Some(0.3),
        core_field_max_t: Some(0.9),
        ..seed().limits
    };
    let task = task_of(limits);
    let rule = CoreRule {
        clearance_m: 0.0007,
        ..rule()
    };
    let model = model(rule, true);
    for problem in Problem::of_wire(&model, &task, task.strands[0]) {
        let x = Problem::coordinates(&Window {
            inner_radius_m: 0.0093,
            depth_m: 0.0107,
            length_m: 0.064,
        });
        let base = problem.at(x).expect("in the domain");
        for i in 0..3 {
            let moved = |h: f64| {
                let mut x = x;
                x[i] += h;
                problem.at(x).expect("in the domain")
            };
            let (coarse, fine) = (moved(1e-2), moved(1e-3));
            let second_order = |at: f64, far: f64, near: f64, slope: f64| {
                let far = (far - at - 1e-2 * slope).abs();
                let near = (near - at - 1e-3 * slope).abs();
                assert!(near < 0.013 * far + 1e-12, "{i}: {far:e} {near:e}");
            };
            let (at, far, near) = (base.objective, coarse.objective, fine.objective);
            second_order(at, far, near, base.slope[i]);
            for row in 0..base.rows.len() {
                let (at, far, near) = (base.rows[row], coarse.rows[row], fine.rows[row]);
                second_order(at, far, near, base.normals[row][i]);
            }
        }
    }
}

/// References of three kinds of active limits, by NLopt on another model.
#[test]
fn meets_the_reference_optima() {
    let folder = in_repository("tests/oracles/nlopt");
    let text = include_str!("../../../tests/oracles/nlopt/reference.json");
    let reference: serde_json::Value = serde_json::from_str(text).expect("JSON");
    for name in ["seed_cored", "cored_mass", "cored_wire_choices"] {
        let expected = &reference["problems"][name];
        let path = folder.join(format!("designs/{name}.toml"));
        let (design, _) = Design::read(&path, NOTHING).expect("a good design");
        let task = task::of_design(&design, Fixed::default()).expect("a task");
        let model = task::coil_model(&design, &magnet()).expect("a model");
        let outcome = optimise(&*model, &task, &quick(), &Silent).expect("not interrupted");
        let best = outcome.best.expect("an optimum");
        let force_n = expected["best"]["force_n"].as_f64().expect("a number");
        let tolerance = expected["objective_tolerance"].as_f64().expect("a number");
        let over = best.force_n / force_n - 1.0;
        assert!(over.abs() < tolerance, "{name}: {over:e}");
        for limit in &best.limits {
            let worse = if limit.name.is_lower() {
                limit.limit / limit.value
            } else {
                limit.value / limit.limit
            };
            assert!(worse <= 1.0 + 1e-9, "{name}: {limit:?}");
            let key = limit.name.key();
            let reported = &expected["active"][key]["sensitivity_n_per_unit"];
            if let (true, Some(reported)) = (limit.active, reported.as_f64()) {
                let ratio = limit.sensitivity_n_per_unit / reported;
                assert!((ratio - 1.0).abs() < 2e-3, "{name} {key}: {ratio}");
            }
        }
    }
}

#[test]
fn a_limit_moved_moves_the_force_by_its_sensitivity() {
    let limits = seed().limits;
    let model = model(rule(), false);
    let best = |settling_s: f64| {
        let limits = Limits {
            settling_max_s: Some(settling_s),
            ..limits
        };
        let outcome = optimise(&model, &task_of(limits), &quick(), &Silent);
        outcome.expect("not interrupted").best.expect("an optimum")
    };
    let (less, more) = (best(0.0995), best(0.1005));
    let slope = (more.force_n - less.force_n) / 0.001;
    let at = best(0.1);
    let reported = at
        .limits
        .iter()
        .find(|limit| limit.name == LimitName::Settling)
        .expect("limited");
    assert!(reported.active);
    let ratio = slope / reported.sensitivity_n_per_unit;
    assert!((ratio - 1.0).abs() < 2e-3, "{ratio}");
}

/// Few layers and turns, so that every bore of every coil can be tried.
#[test]
fn wound_is_what_brute_force_finds_and_no_better_than_continuous() {
    let limits = Limits {
        outer_diameter_max_m: Some(0.014),
        length_max_m: Some(0.007),
        resistance_max_ohm: Some(0.15),
        settling_max_s: Some(0.012),
        ..Limits::default()
    };
    let task = task_of(limits);
    let model = model(rule(), false);
    let outcome = optimise_wound(&model, &task, &quick(), &Silent).expect("not interrupted");
    let best = outcome.best.expect("a coil");
    assert_eq!(outcome.certificate.kind, CertificateKind::Exhaustive);
    assert_eq!(outcome.certificate.cells, 100);
    assert!(best.force_n <= outcome.continuous_force_n.expect("an optimum") * (1.0 + 1e-9));
    let mut brute = (0.0, 0, 0);
    for problem in Problem::of_wire(&model, &task, task.strands[0]) {
        let wire_m = problem.strand.diameter_m;
        for layers in 1..=10_u32 {
            for turns in 1..=10_u32 {
                for step in 1..=100 {
                    let depth_m = f64::from(layers) * wire_m;
                    let window = Window {
                        inner_radius_m: (0.007 - depth_m) * f64::from(step) / 100.0,
                        depth_m,
                        length_m: f64::from(turns) * wire_m,
                    };
                    let Some(rated) = problem.rate(window) else {
                        continue;
                    };
                    let met = problem.scaled(&rated).rows.iter().all(|&row| row <= 1e-10);
                    if met && rated.force_n.value > brute.0 {
                        brute = (rated.force_n.value, layers, turns);
                    }
                }
            }
        }
    }
    let ratio = brute.0 / best.force_n;
    assert!(ratio <= 1.0 + 1e-3 && ratio > 0.99, "{brute:?} {best:?}");
    let bounds = [limits.resistance_max_ohm, limits.settling_max_s];
    for limit in &best.limits {
        assert!(
            limit.value <= limit.limit * (1.0 + 1e-9),
            "{limit:?} {bounds:?}"
        );
    }
}

#[test]
fn a_limit_on_the_core_s_field_is_met_and_costs_force() {
    let free = Limits {
        settling_max_s: None,
        ..seed().limits
    };
    let limited = Limits {
        core_field_max_t: Some(0.5),
        ..free
    };
    let model = model(rule(), true);
    let best = |limits| {
        let outcome = optimise(&model, &task_of(limits), &quick(), &Silent);
        let outcome = outcome.expect("not interrupted");
        outcome.best.expect("an optimum")
    };
    let (free, limited) = (best(free), best(limited));
    assert!(limited.force_n < free.force_n);
    let field = limited
        .limits
        .iter()
        .find(|limit| limit.name == LimitName::CoreField)
        .expect("limited");
    assert!(
        field.active && field.value <= 0.5 * (1.0 + 1e-9),
        "{field:?}"
    );
    // Result of the solver itself for that coil.
    let window = limited.window;
    let winding = Winding {
        inner_radius_m: window.inner_radius_m,
        outer_radius_m: window.outer_radius_m(),
        length_m: window.length_m,
        turns: limited.turns,
    };
    let shape = rule()
        .shape(window.inner_radius_m, window.length_m)
        .expect("fits");
    let coil = CoredCoil::new(&winding, shape, 1000.0, 1e-5, HEIGHT_M).expect("off the edges");
    let depth_m = fluxform_field::steel::core_flux_density::peak_depth_m(shape);
    let peak_t = coil
        .core_field(limited.current_a, depth_m)
        .expect("inside")
        .peak_t;
    assert!((peak_t / 0.5 - 1.0).abs() < 1e-3, "{peak_t}");
}

#[test]
fn neighbours_are_taken_into_account() {
    let design = seed();
    let task = task::of_design(&design, Fixed::default()).expect("a task");
    let best = |surroundings| {
        let model = task::coil_model_in(&design, &magnet(), surroundings).expect("a model");
        let outcome = optimise(&*model, &task, &quick(), &Silent);
        outcome.expect("not interrupted").best.expect("an optimum")
    };
    let alone = best(task::Surroundings::Alone);
    let among = best(task::Surroundings::Neighbours);
    // They return flux, the more the closer the cores: wider ones are better than alone.
    assert!(among.window.inner_radius_m > alone.window.inner_radius_m);
    let neighbours = neighbours::Neighbours::new(&design.array.positions_m).expect("nine");
    let window = among.window;
    let shape = rule()
        .shape(window.inner_radius_m, window.length_m)
        .expect("fits");
    let winding = Winding {
        inner_radius_m: window.inner_radius_m,
        outer_radius_m: window.outer_radius_m(),
        length_m: window.length_m,
        turns: among.turns,
    };
    let coil = CoredCoil::new(&winding, shape, 1000.0, 1e-6, HEIGHT_M).expect("off the edges");
    let air_h = self_inductance_h(&winding);
    let dipoles = [(HEIGHT_M, 1.0)];
    let factors = neighbours.factors(&coil, 1000.0, &dipoles, air_h);
    let factors = factors.expect("cores apart");
    let (force_n, inductance_h) = direct(&window, &rule());
    let force = 2.0 * factors[0] * force_n / among.force_n - 1.0;
    assert!(force.abs() < 1e-4, "{force:e}");
    let value = |name| {
        let limit = among.limits.iter().find(|limit| limit.name == name);
        limit.expect("limited").value
    };
    let settling_s =
        5.0 * factors[1] * inductance_h / value(LimitName::Resistance) / value(LimitName::Settling);
    assert!((settling_s - 1.0).abs() < 1e-4, "{settling_s}");
}

#[test]
fn impossible_requests_are_reported() {
    let model = model(rule(), false);
    let impossible = Limits {
        settling_max_s: Some(1e-5),
        ..seed().limits
    };
    let outcome = optimise(&model, &task_of(impossible), &quick(), &Silent);
    let OptimumStatus::Infeasible { violations, .. } = outcome.expect("not interrupted").status
    else {
        panic!("no coil settles so fast");
    };
    assert_eq!(violations[0].name, LimitName::Settling);
    let high = CoreRule {
        above_m: 0.031,
        ..rule()
    };
    let refused = CoredModel::new(HEIGHT_M, &magnet(), high, false).err();
    assert_eq!(refused, Some(NoCoredCoil::BelowTop));
}

/// A cell as wide as for thick windings would reach windings without depth, and its slopes there
/// would be those of nonsense that no value at its middle shows.
#[test]
fn slopes_of_a_thin_winding_around_a_thick_core() {
    let thin = Window {
        inner_radius_m: 0.0135,
        depth_m: 0.0035,
        length_m: 0.1,
    };
    let rule = rule();
    let sharp = model(rule, false).sharpened(&thin).expect("a core fits");
    let by_depth = sharp
        .response(&thin, 1.0 / 0.49e-6, 1.0, false)
        .expect("in the domain")
        .force_n
        .slope[1];
    let force_n = |depth_m: f64| direct(&Window { depth_m, ..thin }, &rule).0;
    let step_m = 2e-5;
    let difference =
        (force_n(thin.depth_m + step_m) - force_n(thin.depth_m - step_m)) / (2.0 * step_m);
    assert!(
        (by_depth / difference - 1.0).abs() < 1e-3,
        "{by_depth} {difference}"
    );
}

/// Regression: moved to a thick winding, the table's cells reached depths below zero, and a thin
/// winding's force was half of what it is; wound coils half as strong as the best were the answer.
#[test]
fn a_table_moved_to_a_thick_winding_serves_thin_ones() {
    let coarse = model(rule(), true);
    coarse.focus(&Window {
        inner_radius_m: 0.008,
        depth_m: 0.0026,
        length_m: 0.029,
    });
    for depth_m in [0.0004, 0.0012, 0.006] {
        let window = Window {
            inner_radius_m: 0.0086,
            depth_m,
            length_m: 0.029,
        };
        let response = coarse
            .response(&window, 1.0 / 0.49e-6, 1.0, true)
            .expect("in the domain");
        let (force_n, inductance_h) = direct(&window, &rule());
        let force = response.force_n.value / force_n - 1.0;
        let inductance = response.inductance_h.value / inductance_h - 1.0;
        assert!(
            force.abs() < 3e-3 && inductance.abs() < 3e-3,
            "{depth_m}: {force:e} {inductance:e}"
        );
    }
}

/// Rules and windows of a fixed sequence, of every kind that a design may ask for.
fn drawn(count: usize) -> Vec<(CoreRule, Window)> {
    let mut random = fluxform_numerics::random::Random::new(7);
    let mut log = |lo, hi| random.decades(lo, hi);
    (0..count)
        .map(|_| {
            let rule = CoreRule {
                clearance_m: log(0.02, 1.0) * 1e-3,
                above_m: (log(1.0, 3.0) - 2.0) * 0.004,
                below_m: (log(1.0, 3.0) - 1.0) * 0.005,
                relative_permeability: log(20.0, 4000.0),
            };
            let window = Window {
                inner_radius_m: rule.clearance_m + log(0.001, 0.012),
                depth_m: log(0.0006, 0.02),
                length_m: log(0.008, 0.09),
            };
            (rule, window)
        })
        .collect()
}

/// The search drops only those coils of the draft that its measured error rules out.
#[test]
fn the_draft_is_as_good_as_it_measures() {
    let mut widest = 0.0_f64;
    for (rule, window) in drawn(24) {
        let draft = model(rule, false).draft().expect("a rough table");
        let response = draft
            .response(&window, 1.0 / 0.49e-6, 1.0, false)
            .expect("in the domain");
        let (force_n, _) = direct(&window, &rule);
        let wrong = (response.force_n.value / force_n).ln();
        let doubt = draft.doubts(&window).force_ln;
        assert!(
            wrong.abs() <= doubt,
            "{wrong:e} {doubt:e} {rule:?} {window:?}"
        );
        widest = widest.max(doubt);
    }
    assert!(widest < 0.3, "{widest}");
}

#[test]
fn the_limited_flux_density_is_what_an_evaluation_prints() {
    for (rule, window) in drawn(3) {
        let sharp = model(rule, true).sharpened(&window).expect("a core fits");
        let response = sharp
            .response(&window, 1.0 / 0.49e-6, 1.3, false)
            .expect("in the domain");
        let winding = Winding {
            inner_radius_m: window.inner_radius_m,
            outer_radius_m: window.outer_radius_m(),
            length_m: window.length_m,
            turns: window.depth_m * window.length_m / 0.49e-6,
        };
        let shape = rule
            .shape(window.inner_radius_m, window.length_m)
            .expect("a core fits");
        let coil = CoredCoil::new(&winding, shape, rule.relative_permeability, 1e-6, HEIGHT_M)
            .expect("off the edges");
        let depth_m = fluxform_field::steel::core_flux_density::peak_depth_m(shape);
        let told_t = coil.core_field(1.3, depth_m).expect("inside").peak_t;
        let wrong = response.core_field_t.value / told_t - 1.0;
        // A written design gives way by ten times that.
        assert!(wrong.abs() < 1e-6, "{wrong:e} {rule:?} {window:?}");
    }
}

/// Regression: with no limit on the outer diameter and a thin winding as the optimum, the answer was a
/// coil of six tenths of its force; and a coil may have been named that breaks a limit.
#[test]
fn a_wound_coil_beside_a_thin_continuous_optimum_is_nearly_as_strong() {
    let limits = Limits {
        length_max_m: Some(0.058),
        inner_diameter_min_m: Some(0.0064),
        core_field_max_t: Some(0.174),
        ..Limits::default()
    };
    let task = Task {
        current_max_a: 3.93,
        voltage_v: Some(11.4),
        strands: Strand::choices(&tests::wire(0.000_26)),
        ..task_of(limits)
    };
    let rule = CoreRule {
        below_m: 0.0,
        ..rule()
    };
    let outcome = optimise_wound(&model(rule, true), &task, &quick(), &Silent);
    let outcome = outcome.expect("not interrupted");
    let (best, continuous_n) = (outcome.best.expect("a coil"), outcome.continuous_force_n);
    let share = best.force_n / continuous_n.expect("an optimum");
    assert!(share > 0.95 && share < 1.0 + 1e-6, "{share} {best:?}");
    for limit in &best.limits {
        let over = if limit.name.is_lower() {
            limit.limit / limit.value
        } else {
            limit.value / limit.limit
        };
        assert!(over <= 1.0 + 1e-9, "{limit:?}");
    }
}
