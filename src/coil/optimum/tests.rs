//! Air coils: slopes, references, brute force, limits.

use super::air::AirCoil;
use super::problem::{Problem, Regime};
use super::sqp::Smooth;
use super::*;
use crate::array_heat::Drivers;
use crate::circuit::Circuit;
use fluxform_base::progress::Silent;
use fluxform_design::{Limits, Wire};
use fluxform_field::magnet::{Cylinder, MagnetRule, Sources};
use fluxform_numerics::random::Random;

pub(super) const HEIGHT_M: f64 = 0.03;
const MOMENT_A_M2: f64 = 0.909_41;

pub(super) fn wire(diameter_m: f64) -> Wire {
    Wire {
        diameter_m,
        conductor_diameter_m: diameter_m,
        resistivity_ohm_m: 1.68e-8,
        temperature_c: 20.0,
        choices_m: vec![],
    }
}

pub(super) fn air(height_m: f64) -> AirCoil {
    AirCoil::new(height_m, &MagnetRule::dipole([0.0, 0.0, -MOMENT_A_M2])).expect("above")
}

pub(super) fn seed_limits() -> Limits {
    Limits {
        resistance_max_ohm: Some(6.0),
        settling_max_s: Some(0.1),
        outer_diameter_max_m: Some(0.038),
        length_max_m: Some(0.1),
        ..Limits::default()
    }
}

pub(super) fn task(limits: Limits, voltage_v: Option<f64>) -> Task {
    Task {
        limits,
        fixed: Fixed::default(),
        pitch_m: None,
        bobbin: false,
        current_max_a: 2.0,
        voltage_v,
        bandwidth_hz: None,
        drivers: Drivers {
            ends_a: vec![[0.0, 2.0]],
            total_max_a: None,
        },
        strands: Strand::choices(&wire(0.0007)),
    }
}

pub(super) fn quick() -> Settings {
    Settings {
        valley: false,
        ..Settings::default()
    }
}

pub(super) fn solved(task: &Task) -> Outcome {
    optimise(&air(HEIGHT_M), task, &quick(), &Silent).expect("not interrupted")
}

fn is_global(outcome: &Outcome, coil: &BestCoil) {
    assert_eq!(
        outcome.certificate.kind,
        CertificateKind::Global,
        "{outcome:?}"
    );
    let upper_n = outcome.certificate.upper_bound_n.expect("bounded");
    assert!(upper_n >= coil.force_n && upper_n <= coil.force_n * (1.0 + 1e-6));
    for limit in &coil.limits {
        let over = if limit.name.is_lower() {
            limit.limit / limit.value
        } else {
            limit.value / limit.limit
        };
        assert!(over <= 1.0 + 1e-9, "{limit:?}");
    }
}

fn is_lower(limit: &LimitUse, value: f64) -> bool {
    if limit.name.is_lower() {
        value >= limit.limit
    } else {
        value <= limit.limit
    }
}

/// The strongest of many random coils within the limits, in the box given.
fn best_random(task: &Task, count: usize, outer_m: f64, length_m: f64) -> f64 {
    let model = air(HEIGHT_M);
    let mut random = Random::new(7);
    let mut best = 0.0_f64;
    for problem in Problem::of_wire(&model, task, task.strands[0]) {
        for _ in 0..count {
            let outer = outer_m * random.unit().sqrt();
            let inner = outer * random.unit();
            let window = Window {
                inner_radius_m: inner,
                depth_m: outer - inner,
                length_m: length_m * random.unit(),
            };
            // The inductance is computed only for a coil that may be the best.
            let met = |problem: &Problem<'_>| {
                let rated = problem.rate(window)?;
                let met = problem.scaled(&rated).rows.iter().all(|&row| row <= 0.0);
                met.then_some(rated.force_n.value)
            };
            let screened = problem
                .without(&[LimitName::Settling])
                .map_or(Some(f64::MAX), |p| met(&p));
            if screened.is_some_and(|force_n| force_n > best)
                && let Some(force_n) = met(&problem)
            {
                best = best.max(force_n);
            }
        }
    }
    best
}

#[test]
fn the_seed_coil_is_what_the_circuit_says() {
    let task = task(seed_limits(), Some(36.0));
    let model = air(HEIGHT_M);
    let problem = &Problem::of_wire(&model, &task, task.strands[0])[0];
    let window = Window {
        inner_radius_m: 0.012,
        depth_m: 0.007,
        length_m: 0.1,
    };
    let rated = problem.rate(window).expect("in the domain");
    let value = |name| {
        let row = problem
            .bounds
            .iter()
            .position(|b| b.name == name)
            .expect("bounded");
        rated.values[row].value
    };
    // The seed's 1429 turns; 1428.57 fit.
    let more = 1429.0 / problem.strand.turns(&window);
    assert!((value(LimitName::Resistance) * more - 6.0753).abs() < 5e-5);
    let force = MOMENT_A_M2 * 5.482_059_24e-2 * 2.0;
    assert!(
        (rated.force_n.value * more / force - 1.0).abs() < 1e-8,
        "{}",
        rated.force_n.value
    );
    let circuit = Circuit::of_air_coil(&window.coil(problem.strand.turns(&window)), &wire(0.0007));
    assert!((value(LimitName::Settling) / circuit.settling_s() - 1.0).abs() < 1e-9);
    assert!((value(LimitName::Resistance) / circuit.resistance_ohm - 1.0).abs() < 1e-14);
}

#[test]
fn taylor_test_of_force_and_every_limit() {
    let limits = Limits {
        inner_diameter_min_m: Some(0.01),
        power_max_w: Some(20.0),
        mass_max_kg: Some(0.3),
        wire_length_max_m: Some(100.0),
        ..seed_limits()
    };
    let task = task(limits, Some(9.0));
    let model = air(HEIGHT_M);
    for problem in Problem::of_wire(&model, &task, task.strands[0]) {
        let x = Problem::coordinates(&Window {
            inner_radius_m: 0.013,
            depth_m: 0.007,
            length_m: 0.07,
        });
        let base = problem.at(x).expect("in the domain");
        for i in 0..3 {
            let moved = |h: f64| {
                let mut x = x;
                x[i] += h;
                problem.at(x).expect("in the domain")
            };
            let (coarse, fine) = (moved(1e-2), moved(1e-3));
            let second_order = |name: &str, at: f64, far: f64, near: f64, slope: f64| {
                let (far, near) = (
                    (far - at - 1e-2 * slope).abs(),
                    (near - at - 1e-3 * slope).abs(),
                );
                assert!(near < 0.013 * far + 1e-12, "{name} {i}: {far:e} {near:e}");
            };
            second_order(
                "force",
                base.objective,
                coarse.objective,
                fine.objective,
                base.slope[i],
            );
            for (row, bound) in problem.bounds.iter().enumerate() {
                second_order(
                    bound.name.key(),
                    base.rows[row],
                    coarse.rows[row],
                    fine.rows[row],
                    base.normals[row][i],
                );
            }
        }
    }
}

#[test]
fn the_seed_problem_is_solved_and_proven() {
    let task = task(seed_limits(), Some(36.0));
    let outcome = solved(&task);
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    assert!(
        (coil.force_n - 0.137_773_265_65).abs() < 1e-9,
        "{}",
        coil.force_n
    );
    let active: Vec<LimitName> = coil
        .limits
        .iter()
        .filter(|l| l.active)
        .map(|l| l.name)
        .collect();
    assert_eq!(active, [LimitName::OuterDiameter, LimitName::Resistance]);
    let random = best_random(&task, 20_000, 0.019, 0.1);
    assert!(random > 0.95 * coil.force_n && random < coil.force_n);
}

#[test]
fn regression_of_two_limits_that_coincide_one_was_worth_what_both_are() {
    // 24 W at 2 A are 6 ohm.
    let limits = |ohm, power_w| Limits {
        resistance_max_ohm: Some(ohm),
        power_max_w: Some(power_w),
        settling_max_s: None,
        ..seed_limits()
    };
    let best = |limits| solved(&task(limits, Some(36.0))).best.expect("optimal");
    let coincident = best(limits(6.0, 24.0));
    for name in [LimitName::Resistance, LimitName::Power] {
        let used = coincident.limits.iter().find(|used| used.name == name);
        let used = used.expect("bounded");
        assert!(
            used.active && used.sensitivity_n_per_unit == 0.0,
            "{used:?}"
        );
    }
    for wider in [limits(6.01, 24.0), limits(6.0, 24.04)] {
        assert!((best(wider).force_n / coincident.force_n - 1.0).abs() < 1e-9);
    }
    let outer = coincident
        .limits
        .iter()
        .find(|used| used.name == LimitName::OuterDiameter);
    assert!(outer.expect("bounded").sensitivity_n_per_unit > 0.0);
}

#[test]
fn sensitivities_are_what_a_wider_limit_gives() {
    let base = solved(&task(seed_limits(), Some(36.0)))
        .best
        .expect("optimal");
    let of = |coil: &BestCoil, name| {
        let found = coil.limits.iter().find(|l| l.name == name);
        found.expect("bounded").sensitivity_n_per_unit
    };
    let sensitivity = |name| of(&base, name);
    let wider = |limits: Limits| {
        solved(&task(limits, Some(36.0)))
            .best
            .expect("optimal")
            .force_n
    };
    let step = 1e-5;
    let up = wider(Limits {
        outer_diameter_max_m: Some(0.038 + step),
        ..seed_limits()
    });
    let down = wider(Limits {
        outer_diameter_max_m: Some(0.038 - step),
        ..seed_limits()
    });
    let slope = (up - down) / (2.0 * step);
    assert!((sensitivity(LimitName::OuterDiameter) / slope - 1.0).abs() < 1e-5);
    let up = wider(Limits {
        resistance_max_ohm: Some(6.01),
        ..seed_limits()
    });
    let down = wider(Limits {
        resistance_max_ohm: Some(5.99),
        ..seed_limits()
    });
    let slope = (up - down) / 0.02;
    assert!((sensitivity(LimitName::Resistance) / slope - 1.0).abs() < 1e-4);
    assert_eq!(sensitivity(LimitName::Length), 0.0);

    // A lower limit costs force as it rises; so does less mass.
    let other = |inner_m: f64, mass_kg: f64| {
        let limits = Limits {
            inner_diameter_min_m: Some(inner_m),
            mass_max_kg: Some(mass_kg),
            ..seed_limits()
        };
        solved(&task(limits, Some(36.0))).best.expect("optimal")
    };
    let narrower = other(0.02, 0.1);
    let slope = (other(0.02 + step, 0.1).force_n - other(0.02 - step, 0.1).force_n) / (2.0 * step);
    let by_inner = of(&narrower, LimitName::InnerDiameter);
    assert!(slope < 0.0 && (by_inner / slope - 1.0).abs() < 1e-5);
    let slope = (other(0.02, 0.1001).force_n - other(0.02, 0.0999).force_n) / 2e-4;
    assert!((of(&narrower, LimitName::Mass) / slope - 1.0).abs() < 1e-4);
}

#[test]
fn a_binding_settling_time_is_proven_too() {
    let limits = Limits {
        settling_max_s: Some(0.004),
        inner_diameter_min_m: Some(0.02),
        ..seed_limits()
    };
    let task = task(limits, Some(36.0));
    let outcome = solved(&task);
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    let settling = coil
        .limits
        .iter()
        .find(|l| l.name == LimitName::Settling)
        .expect("bounded");
    assert!(settling.active && is_lower(settling, settling.value * (1.0 - 1e-9)));
    assert!(best_random(&task, 1_000, 0.019, 0.1) < coil.force_n);
}

#[test]
fn the_supply_takes_over_where_its_voltage_is_low() {
    // At 4 V a coil of 6 ohm carries 0.67 A: fewer ohms, more force.
    let task = task(seed_limits(), Some(4.0));
    let outcome = solved(&task);
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    let resistance = coil
        .limits
        .iter()
        .find(|l| l.name == LimitName::Resistance)
        .expect("bounded");
    assert!((coil.current_a - (4.0 / resistance.value).min(2.0)).abs() < 1e-9);
    let random = best_random(&task, 20_000, 0.019, 0.1);
    assert!(random < coil.force_n && random > 0.9 * coil.force_n);
}

#[test]
fn heat_at_a_given_voltage_has_two_sides() {
    // V^2/R <= 3 W asks for 5.33 ohm or more, I^2 R <= 3 W for 0.75 ohm or less.
    let limits = Limits {
        power_max_w: Some(3.0),
        ..seed_limits()
    };
    let task = task(limits, Some(4.0));
    let outcome = solved(&task);
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    assert!(best_random(&task, 20_000, 0.019, 0.1) < coil.force_n);
    assert!([Regime::Driver, Regime::Supply].contains(&coil.regime));
}

#[test]
fn without_a_box_the_wire_alone_bounds_the_coil() {
    let limits = Limits {
        resistance_max_ohm: Some(6.0),
        ..Limits::default()
    };
    let outcome = solved(&task(limits, None));
    is_global(&outcome, outcome.best.as_ref().expect("optimal"));
    // Optimal at any scale: with d, z and the coil k times as large, force goes as 1/k^2 and
    // resistance as 1/k.
    let k = 1.7;
    let larger = Task {
        limits: Limits {
            resistance_max_ohm: Some(6.0 / k),
            ..Limits::default()
        },
        strands: Strand::choices(&wire(0.0007 * k)),
        ..task(limits, None)
    };
    let scaled = optimise(&air(HEIGHT_M * k), &larger, &quick(), &Silent).expect("runs");
    let (a, b) = (
        outcome.best.expect("optimal"),
        scaled.best.expect("optimal"),
    );
    assert!((b.force_n * k * k / a.force_n - 1.0).abs() < 1e-9);
    assert!((b.window.length_m / a.window.length_m / k - 1.0).abs() < 1e-6);
}

#[test]
fn extremes_are_solved_or_refused() {
    // Thin wire, far target.
    let far = Task {
        strands: Strand::choices(&wire(0.000_05)),
        ..task(seed_limits(), Some(36.0))
    };
    let outcome = optimise(&air(100.0), &far, &quick(), &Silent).expect("runs");
    is_global(&outcome, outcome.best.as_ref().expect("optimal"));
    // Huge limits and a huge coil.
    let huge = Limits {
        resistance_max_ohm: Some(1e6),
        outer_diameter_max_m: Some(1e3),
        length_max_m: Some(1e3),
        ..Limits::default()
    };
    let outcome = solved(&task(huge, None));
    assert!(outcome.best.is_some_and(|coil| coil.force_n.is_finite()));
    // A limit that no single turn meets.
    let tiny = Limits {
        resistance_max_ohm: Some(1e-6),
        ..seed_limits()
    };
    let OptimumStatus::Infeasible { violations, .. } = solved(&task(tiny, Some(36.0))).status
    else {
        panic!("no coil has a microohm");
    };
    assert_eq!(violations[0].name, LimitName::Resistance);
    // One turn on no bore: rho pi d / (pi d^2 / 4).
    let turn_ohm = 1.68e-8 * 4.0 / 0.0007;
    assert!(
        (violations[0].value / turn_ohm - 1.0).abs() < 1e-6,
        "{violations:?}"
    );
    for limits in [
        Limits {
            length_max_m: Some(1e-6),
            ..seed_limits()
        },
        Limits {
            outer_diameter_max_m: Some(1e-6),
            ..seed_limits()
        },
        Limits {
            inner_diameter_min_m: Some(0.0375),
            ..seed_limits()
        },
    ] {
        let status = solved(&task(limits, Some(36.0))).status;
        assert!(
            matches!(status, OptimumStatus::Contradictory(_)),
            "{status:?}"
        );
    }
}

#[test]
fn a_missing_limit_is_named() {
    let limits = Limits {
        length_max_m: Some(0.1),
        ..Limits::default()
    };
    let status = solved(&task(limits, None)).status;
    assert_eq!(
        status,
        OptimumStatus::Unbounded {
            missing: vec![LimitName::OuterDiameter]
        }
    );
    let status = solved(&task(Limits::default(), None)).status;
    let both = vec![LimitName::OuterDiameter, LimitName::Length];
    assert_eq!(status, OptimumStatus::Unbounded { missing: both });
    // The supply's voltage alone bounds the coil.
    let outcome = solved(&task(Limits::default(), Some(36.0)));
    is_global(&outcome, outcome.best.as_ref().expect("optimal"));
}

/// Regression: a coil of kilometres was the answer, and winding it did not end.
#[test]
fn a_settling_time_that_any_length_meets_leaves_the_length_without_an_end() {
    let of = |settling_max_s: f64, inner_diameter_min_m: Option<f64>| {
        let limits = Limits {
            outer_diameter_max_m: Some(0.0326),
            settling_max_s: Some(settling_max_s),
            inner_diameter_min_m,
            ..Limits::default()
        };
        let settings = Settings {
            starts: 6,
            cells: 0,
            ..quick()
        };
        let outcome = optimise(&air(HEIGHT_M), &task(limits, None), &settings, &Silent);
        outcome.expect("runs")
    };
    // Limit of a solid coil of 32.6 mm: 5 mu_0 a^2 pi / 24 over the resistivity.
    for (inner_m, approached_s) in [(None, 0.013_008), (Some(0.02), 0.010_457)] {
        let status = of(1.02 * approached_s, inner_m).status;
        let missing = vec![LimitName::Length];
        assert_eq!(status, OptimumStatus::Unbounded { missing });
        let best = of(0.9 * approached_s, inner_m).best.expect("an end");
        assert!(best.window.length_m < 1.0, "{best:?}");
    }
}

#[test]
fn given_dimensions_stay_fixed() {
    let fixed = Fixed {
        inner_diameter_m: Some(0.024),
        ..Fixed::default()
    };
    let task = Task {
        fixed,
        ..task(seed_limits(), Some(36.0))
    };
    let outcome = solved(&task);
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    assert_eq!(coil.window.inner_radius_m, 0.012);
    // With the bore and the outer diameter known the resistance sets the length.
    let length_m = 6.0 / 6.0753 * 1429.0 / 1_428.571_428_6 * 0.1;
    assert!((coil.window.length_m - length_m).abs() < 1e-5);
}

#[test]
fn searches_are_counted() {
    let starts = |settling_max_s| {
        let limits = Limits {
            settling_max_s,
            inner_diameter_min_m: Some(0.02),
            ..seed_limits()
        };
        let settings = Settings {
            starts: 5,
            cells: 0,
            ..quick()
        };
        let outcome = optimise(&air(HEIGHT_M), &task(limits, None), &settings, &Silent);
        outcome.expect("runs").starts
    };
    assert_eq!(starts(None), 5);
    // A limit that holds nothing back is left out, and nothing searched again; one that does is
    // also searched with.
    assert_eq!([starts(Some(0.1)), starts(Some(0.004))], [5, 10]);
}

#[test]
fn the_better_wire_is_chosen() {
    let mut wires = wire(0.0007);
    wires.choices_m = vec![0.0009, 0.0005, 0.0007, 0.0005];
    let choose = Task {
        strands: Strand::choices(&wires),
        ..task(seed_limits(), Some(36.0))
    };
    let outcome = solved(&choose);
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    assert_eq!(outcome.wires.len(), 3);
    for wire in &outcome.wires {
        let strands = choose.strands.iter();
        let alone = Task {
            strands: strands
                .filter(|strand| strand.diameter_m == wire.wire_diameter_m)
                .copied()
                .collect(),
            ..choose.clone()
        };
        let force_n = solved(&alone).best.expect("optimal").force_n;
        assert!((wire.force_n.expect("feasible") / force_n - 1.0).abs() < 1e-9);
        assert!(force_n <= coil.force_n);
    }
}

#[test]
fn the_valley_ends_where_the_force_has_fallen() {
    let limits = Limits {
        outer_diameter_max_m: Some(0.05),
        ..seed_limits()
    };
    let seed = task(limits, Some(36.0));
    let settings = Settings::default();
    let outcome = optimise(&air(HEIGHT_M), &seed, &settings, &Silent).expect("runs");
    let [low, high] = outcome.valley.expect("a free bore").inner_diameter_m;
    assert_eq!(low, 0.0);
    let at_end = Task {
        fixed: Fixed {
            inner_diameter_m: Some(high),
            ..Fixed::default()
        },
        ..seed
    };
    let ratio =
        solved(&at_end).best.expect("optimal").force_n / outcome.best.expect("optimal").force_n;
    assert!((ratio - 0.999).abs() < 1e-6, "{ratio}");
}

#[test]
fn winding_equals_brute_force() {
    // A small problem: every whole coil, its bore by a fine scan.
    let limits = Limits {
        resistance_max_ohm: Some(0.2),
        settling_max_s: Some(0.002),
        outer_diameter_max_m: Some(0.02),
        length_max_m: Some(0.012),
        ..Limits::default()
    };
    let task = task(limits, Some(36.0));
    let model = air(HEIGHT_M);
    let outcome = optimise_wound(&model, &task, &quick(), &Silent).expect("runs");
    assert_eq!(outcome.certificate.kind, CertificateKind::Global);
    let best = outcome.best.expect("optimal");
    let problem = &Problem::of_wire(&model, &task, task.strands[0])[0];
    let relaxed = problem
        .without(&[LimitName::Settling])
        .expect("a settling time");
    let d = 0.0007;
    let (mut brute, mut which) = (0.0, (0, 0));
    for n in 1..=14 {
        for m in 1..=17 {
            let widest = 0.01 - f64::from(n) * d;
            for k in 0..=100 {
                let window = Window {
                    inner_radius_m: widest * f64::from(k) / 100.0,
                    depth_m: f64::from(n) * d,
                    length_m: f64::from(m) * d,
                };
                let screened = relaxed.rate(window).filter(|_| widest >= 0.0);
                if screened.is_none_or(|rated| rated.force_n.value <= brute) {
                    continue;
                }
                let Some(rated) = problem.rate(window) else {
                    continue;
                };
                let met = problem.scaled(&rated).rows.iter().all(|&row| row <= 1e-12);
                if met && rated.force_n.value > brute {
                    (brute, which) = (rated.force_n.value, (n, m));
                }
            }
        }
    }
    let whole = best.whole.expect("whole turns");
    assert_eq!(
        (whole.layers, whole.turns_per_layer),
        (which.0 as u64, which.1 as u64)
    );
    assert!(
        best.force_n >= brute && best.force_n < 1.01 * brute,
        "{} {brute}",
        best.force_n
    );
    assert!(
        outcome
            .continuous_force_n
            .is_some_and(|n| n >= best.force_n)
    );
    for other in &outcome.alternatives {
        let shorter = other.size.length_m < best.window.length_m;
        let less = other.wire_mass_kg < best.wire_mass_kg() || other.power_w < best.power_w();
        assert!(other.force_n >= 0.99 * best.force_n && (shorter || less));
    }
}

#[test]
fn the_seed_wound() {
    let outcome = optimise_wound(
        &air(HEIGHT_M),
        &task(seed_limits(), Some(36.0)),
        &quick(),
        &Silent,
    );
    let outcome = outcome.expect("runs");
    let best = outcome.best.expect("optimal");
    assert_eq!(outcome.certificate.kind, CertificateKind::Global);
    let whole = best.whole.expect("whole turns");
    assert_eq!((whole.layers, whole.turns_per_layer), (26, 85));
    assert!(
        (best.force_n - 0.137_743_285).abs() < 1e-8,
        "{}",
        best.force_n
    );
    assert!(
        best.limits.iter().all(|limit| is_lower(limit, limit.value)),
        "{:?}",
        best.limits
    );
}

#[test]
fn threads_change_nothing() {
    let limits = Limits {
        settling_max_s: Some(0.004),
        inner_diameter_min_m: Some(0.02),
        ..seed_limits()
    };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        pool.install(|| {
            let task = task(limits, Some(36.0));
            let wound = optimise_wound(&air(HEIGHT_M), &task, &quick(), &Silent).expect("runs");
            (solved(&task), wound)
        })
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn a_cylinder_on_the_axis_pulls_like_its_dipoles() {
    let size = Cylinder {
        diameter_m: 0.01,
        length_m: 0.01,
    };
    let sources = Sources::Below { height_m: HEIGHT_M };
    let moment = [0.0, 0.0, -MOMENT_A_M2];
    let rule = MagnetRule::cylinder(size, moment, sources, 1e-9).expect("far enough");
    let model = AirCoil::new(HEIGHT_M, &rule).expect("on the axis");
    let outcome =
        optimise(&model, &task(seed_limits(), Some(36.0)), &quick(), &Silent).expect("runs");
    let coil = outcome.best.as_ref().expect("optimal");
    is_global(&outcome, coil);
    let dipole = solved(&task(seed_limits(), Some(36.0)))
        .best
        .expect("optimal");
    let ratio = coil.force_n / dipole.force_n;
    assert!(ratio > 1.0 && ratio < 1.03, "{ratio}");
}
