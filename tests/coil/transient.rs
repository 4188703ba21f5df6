//! Settling after a voltage step: limits, and direct integration of the same equations.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_coil::inductance::self_inductance_h;
use fluxform_coil::transient::{Settling, TransientError, VoltageStep, core_energy_share};
use fluxform_field::winding::Winding;

const SEED: VoltageStep = VoltageStep {
    resistance_ohm: 6.0753,
    air_inductance_h: 0.0145019,
    inductance_h: 0.184092,
    relative_permeability: 1000.0,
    conductivity_s_per_m: 5.8e6,
    core_radius_m: 0.012,
    core_energy_share: 0.6,
    air_share: 0.0548206 / 0.428229,
};

fn of(step: &VoltageStep) -> Settling {
    step.settling().unwrap()
}

fn three_tau(step: &VoltageStep) -> f64 {
    20.0_f64.ln() * (step.inductance_h / step.resistance_ohm)
}

/// The same equations by finite volumes in r and implicit Euler in t: times to 95 % of current
/// and force, s.
fn by_steps(step: &VoltageStep, cells: usize, steps: usize, until_s: f64) -> [f64; 2] {
    let chi = step.relative_permeability - 1.0;
    let (l_air, l_core) = (
        step.air_inductance_h,
        step.inductance_h - step.air_inductance_h,
    );
    let beta = (chi * step.core_energy_share * l_air / l_core - 1.0).clamp(0.0, chi);
    let t_core = MU_0_T_M_PER_A
        * step.relative_permeability
        * step.conductivity_s_per_m
        * step.core_radius_m.powi(2);
    let dt = until_s / steps as f64;
    // Radius over a; faces crowd at the surface, where the field enters.
    let face: Vec<f64> = (0..=cells)
        .map(|i| (std::f64::consts::FRAC_PI_2 * i as f64 / cells as f64).sin())
        .collect();
    let centre: Vec<f64> = face.windows(2).map(|f| 0.5 * (f[0] + f[1])).collect();
    let volume: Vec<f64> = face.windows(2).map(|f| f[1] * f[1] - f[0] * f[0]).collect();
    let flow = |i: usize| {
        let gap = if i == cells {
            1.0 - centre[cells - 1]
        } else {
            centre[i] - centre[i - 1]
        };
        2.0 * face[i] * dt / t_core / gap
    };
    let flows: Vec<f64> = (1..=cells).map(flow).collect();
    // (volume + flows) H - neighbours = right, by elimination.
    let solve = |right: &[f64]| {
        let (mut diagonal, mut value) = (vec![0.0; cells], right.to_vec());
        for i in 0..cells {
            let below = if i == 0 { 0.0 } else { flows[i - 1] };
            diagonal[i] = volume[i] + below + flows[i];
            if i > 0 {
                diagonal[i] -= below * below / diagonal[i - 1];
                value[i] += below * value[i - 1] / diagonal[i - 1];
            }
        }
        value[cells - 1] /= diagonal[cells - 1];
        for i in (0..cells - 1).rev() {
            value[i] = (value[i] + flows[i] * value[i + 1]) / diagonal[i];
        }
        value
    };
    let mean = |h: &[f64]| h.iter().zip(&volume).map(|(h, v)| h * v).sum::<f64>();
    let mut unit = vec![0.0; cells];
    unit[cells - 1] = flows[cells - 1];
    let unit = solve(&unit);
    let of_unit = mean(&unit);
    // H at rest is I / (1 + beta); R = V = 1 in these units.
    let (r, gain) = (step.resistance_ohm, 1.0 + beta);
    let (mut h, mut current, mut m) = (vec![0.0; cells], 0.0, 0.0);
    let mut reached = [f64::NAN; 2];
    let mut before = [0.0; 2];
    for k in 1..=steps {
        let free: Vec<f64> = h.iter().zip(&volume).map(|(h, v)| h * v).collect();
        let free = solve(&free);
        let of_free = mean(&free);
        // mean = of_free + surface of_unit, surface = I - beta mean; V = R I + d/dt (...).
        let (a, b) = (
            of_free / (1.0 + beta * of_unit),
            of_unit / (1.0 + beta * of_unit),
        );
        let right = r + (l_air * current + l_core * m) / dt - l_core * gain * a / dt;
        current = right / (r + l_air / dt + l_core * gain * b / dt);
        let surface = current - beta * (a + b * current);
        h = free
            .iter()
            .zip(&unit)
            .map(|(f, u)| f + surface * u)
            .collect();
        m = gain * (a + b * current);
        let now = [
            current,
            step.air_share * current + (1.0 - step.air_share) * m,
        ];
        for i in 0..2 {
            if reached[i].is_nan() && now[i] >= 0.95 {
                let part = (0.95 - before[i]) / (now[i] - before[i]);
                reached[i] = dt * ((k - 1) as f64 + part);
            }
        }
        before = now;
    }
    reached
}

#[test]
fn agrees_with_direct_integration() {
    let gentle = VoltageStep {
        relative_permeability: 130.0,
        inductance_h: 0.07,
        core_energy_share: 0.37,
        air_share: 0.3,
        ..SEED
    };
    let thick = VoltageStep {
        core_radius_m: 0.031,
        resistance_ohm: 21.0,
        ..SEED
    };
    let free = VoltageStep {
        relative_permeability: 7.0,
        inductance_h: 0.087,
        core_energy_share: 0.9,
        conductivity_s_per_m: 4.1e7,
        ..SEED
    };
    for step in [SEED, gentle, thick, free] {
        let found = of(&step);
        let until = 1.2 * found.force_95_s;
        let (coarse, fine) = (
            by_steps(&step, 300, 1500, until),
            by_steps(&step, 300, 3000, until),
        );
        for (i, found) in [found.current_95_s, found.force_95_s]
            .into_iter()
            .enumerate()
        {
            // Implicit Euler is of first order: one extrapolation.
            let expected = 2.0 * fine[i] - coarse[i];
            assert!(
                (found / expected - 1.0).abs() < 1e-4,
                "{step:?}: {found} {expected}"
            );
        }
    }
}

#[test]
fn agrees_with_the_inverted_laplace_transform() {
    let cases: Vec<serde_json::Value> =
        serde_json::from_str(include_str!("../oracles/transient.json")).unwrap();
    assert_eq!(cases.len(), 7);
    for case in cases {
        let value = |key: &str| case[key].as_f64().unwrap();
        let found = of(&VoltageStep {
            resistance_ohm: value("resistance_ohm"),
            air_inductance_h: value("air_inductance_h"),
            inductance_h: value("inductance_h"),
            relative_permeability: value("relative_permeability"),
            conductivity_s_per_m: value("conductivity_s_per_m"),
            core_radius_m: value("core_radius_m"),
            core_energy_share: value("core_energy_share"),
            air_share: value("air_share"),
        });
        for (found, expected) in [
            (found.current_95_s, value("current_95_s")),
            (found.force_95_s, value("force_95_s")),
        ] {
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "{case}: {found} {expected}: {:e}",
                found / expected - 1.0
            );
        }
    }
}

#[test]
fn the_seed_lags_as_finite_elements_say() {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    let share = core_energy_share(&winding, 0.012, -0.11, 0.0, self_inductance_h(&winding));
    let found = of(&VoltageStep {
        core_energy_share: share,
        ..SEED
    });
    // Transient finite elements: current 94 ms, force 99 ms, to about 1 ms.
    assert!((found.current_95_s - 0.094).abs() < 0.002, "{found:?}");
    assert!(
        (found.force_95_s - 0.099).abs() < 0.099 * found.accuracy.estimate,
        "{found:?}"
    );
    assert!(found.accuracy.estimate < 0.1);
    assert!((found.five_tau_s - 0.15151).abs() < 1e-5);
}

#[test]
fn without_eddy_currents_it_is_three_time_constants() {
    for step in [
        VoltageStep {
            conductivity_s_per_m: 0.0,
            ..SEED
        },
        VoltageStep {
            core_radius_m: 0.0,
            ..SEED
        },
        VoltageStep {
            relative_permeability: 1.0,
            inductance_h: SEED.air_inductance_h,
            air_share: 1.0,
            ..SEED
        },
    ] {
        let found = of(&step);
        assert_eq!(
            (found.current_95_s, found.force_95_s, found.lag_s),
            (three_tau(&step), three_tau(&step), 0.0)
        );
        assert_eq!(found.accuracy.estimate, 0.0);
    }
    // On the way there the lag is all that is left, to first order.
    let mut before = f64::INFINITY;
    for conductivity_s_per_m in [1e5, 1e4, 1e3, 1.0, 1e-3, 1e-9] {
        let step = VoltageStep {
            conductivity_s_per_m,
            ..SEED
        };
        let found = of(&step);
        let beyond = found.force_95_s / three_tau(&step) - 1.0;
        let bound = 3.0 * found.lag_s / three_tau(&step);
        assert!(
            beyond.abs() <= bound + 1e-12 && bound < before,
            "{found:?} {beyond:e} {bound:e}"
        );
        before = bound;
    }
}

#[test]
fn the_force_lags_the_current_and_more_so_in_better_conductors() {
    let mut before = three_tau(&SEED);
    for conductivity_s_per_m in [1e5, 1e6, 5.8e6, 2e7] {
        let found = of(&VoltageStep {
            conductivity_s_per_m,
            ..SEED
        });
        assert!(
            found.force_95_s > found.current_95_s && found.force_95_s > before,
            "{found:?}"
        );
        before = found.force_95_s;
    }
    // All of the force from the winding: no lag of its own.
    let found = of(&VoltageStep {
        air_share: 1.0,
        ..SEED
    });
    assert_eq!(found.force_95_s, found.current_95_s);
}

#[test]
fn time_scales_with_the_core_and_the_circuit() {
    // Twice the diffusion time and half the resistance: everything takes twice as long.
    let slow = VoltageStep {
        resistance_ohm: 0.5 * SEED.resistance_ohm,
        conductivity_s_per_m: 2.0 * SEED.conductivity_s_per_m,
        ..SEED
    };
    let (one, two) = (of(&SEED), of(&slow));
    assert!((two.force_95_s / one.force_95_s - 2.0).abs() < 1e-12);
    assert!((two.current_95_s / one.current_95_s - 2.0).abs() < 1e-12);
    assert!((two.accuracy.estimate - one.accuracy.estimate).abs() < 1e-10);
}

#[test]
fn extremes_stay_between_their_bounds() {
    for relative_permeability in [1.0 + 1e-9, 1.3, 70.0, 1e4, 1e9] {
        for conductivity_s_per_m in [1e-6, 1.0, 1e4, 5.8e6, 6e7] {
            for scale in [1e-3, 1.0, 1e3] {
                let chi = relative_permeability - 1.0;
                let step = VoltageStep {
                    relative_permeability,
                    conductivity_s_per_m,
                    resistance_ohm: SEED.resistance_ohm * scale,
                    inductance_h: SEED.air_inductance_h * (1.0 + 0.6 * chi / (1.0 + 0.05 * chi)),
                    air_share: 1.0 / (1.0 + 0.4 * chi / (1.0 + 0.05 * chi)),
                    ..SEED
                };
                match step.settling() {
                    Ok(found) => {
                        let air = 20.0_f64.ln() * step.air_inductance_h / step.resistance_ohm;
                        assert!(
                            found.current_95_s >= air * (1.0 - 1e-9),
                            "{step:?} {found:?}"
                        );
                        assert!(
                            found.force_95_s >= found.current_95_s * (1.0 - 1e-9),
                            "{step:?} {found:?}"
                        );
                        // No later than the circuit and the bare cylinder one after the other.
                        let slowest = 3.0 * (found.five_tau_s + found.lag_s * 8.0);
                        assert!(
                            found.force_95_s < slowest.max(3.0 * air),
                            "{step:?} {found:?}"
                        );
                    }
                    Err(TransientError::TooSlow { .. }) => {
                        assert!(relative_permeability > 1e8 && scale > 1.0, "{step:?}")
                    }
                    Err(error) => panic!("{step:?}: {error}"),
                }
            }
        }
    }
}

/// p = R / L_air at a zero of J_1: two brackets of the poles meet in one place.
#[test]
fn coincident_brackets_lose_no_mode() {
    let diffusion_s = |step: &VoltageStep| {
        MU_0_T_M_PER_A
            * step.relative_permeability
            * step.conductivity_s_per_m
            * step.core_radius_m.powi(2)
    };
    let zero = 13.323_691_936_314_223_f64;
    let resistance_ohm = zero * zero * SEED.air_inductance_h / diffusion_s(&SEED);
    let at = |by: f64| {
        of(&VoltageStep {
            resistance_ohm: resistance_ohm * by,
            ..SEED
        })
        .force_95_s
    };
    for by in [1.0, 1.0 + 1e-15, 1.0 - 3e-15, 1.0 + 1e-12] {
        let around = 0.5 * (at(1.0 - 1e-4) + at(1.0 + 1e-4));
        assert!(
            (at(by) / around - 1.0).abs() < 1e-7,
            "{by}: {} {around}",
            at(by)
        );
    }
}

#[test]
fn inputs_out_of_their_domain_are_named() {
    let said = |step: VoltageStep| step.settling().unwrap_err().to_string();
    assert_eq!(
        said(VoltageStep {
            resistance_ohm: 0.0,
            ..SEED
        }),
        "resistance_ohm: expected more than 0, found 0.0"
    );
    assert_eq!(
        said(VoltageStep {
            inductance_h: 0.013,
            ..SEED
        }),
        "inductance_h: expected no less than without the core, found 0.013"
    );
    assert_eq!(
        said(VoltageStep {
            air_share: -0.3,
            ..SEED
        }),
        "air_share: expected 0 to 1, found -0.3"
    );
    assert_eq!(
        said(VoltageStep {
            relative_permeability: 0.7,
            ..SEED
        }),
        "relative_permeability: expected at least 1, found 0.7"
    );
    assert_eq!(
        said(VoltageStep {
            core_energy_share: 0.0,
            ..SEED
        }),
        "core_energy_share: expected more than 0, up to 1, found 0.0"
    );
    assert!(
        said(VoltageStep {
            conductivity_s_per_m: f64::INFINITY,
            ..SEED
        })
        .contains("found inf")
    );
    assert!(
        said(VoltageStep {
            air_inductance_h: f64::NAN,
            ..SEED
        })
        .contains("found NaN")
    );
    let slow = VoltageStep {
        relative_permeability: 1e9,
        core_radius_m: 3.0,
        ..SEED
    };
    assert!(
        said(slow).starts_with("the core's diffusion time, 6.560e10 s, exceeds"),
        "{}",
        said(slow)
    );
}

#[test]
fn the_energy_s_share_is_that_of_a_long_solenoid() {
    // A long thin winding: the field is uniform in the bore, and the core holds its part of it.
    let winding = Winding {
        inner_radius_m: 0.01,
        outer_radius_m: 0.0101,
        length_m: 2.0,
        turns: 700.0,
    };
    let air = self_inductance_h(&winding);
    let part = core_energy_share(&winding, 0.007, -1.5, -0.5, air);
    let uniform = 0.5 * 0.49 * (1.0 + 0.0067 / 1.0);
    assert!((part / uniform - 1.0).abs() < 0.01, "{part} {uniform}");
    // The whole of space holds all of it; the bore and beyond less.
    let all = core_energy_share(&winding, 0.01, -3.0, 1.0, air);
    assert!(all < 1.0 && all > 0.97, "{all}");
}
