//! Limits of a coil: over six decades, of zero, parallel, contradicting, all at once.

use std::path::Path;

use super::check::{Outcome, close, holds, measured, off, refused, reported, worst};
use super::{Case, case};
use fluxform::coil::array_heat::Drivers;
use fluxform::coil::optimum::air::AirCoil;
use fluxform::coil::optimum::{
    BestCoil, CertificateKind, Fixed, LimitName, OptimumStatus, Outcome as Optimum, Settings,
    Strand, Task, optimise,
};
use fluxform::design::{Design, Limits, Need, Wire};
use fluxform::field::magnet::MagnetRule;
use fluxform::progress::Silent;

/// The certificate's gap.
const GAP: f64 = 1e-6;

pub fn cases() -> Vec<Case> {
    [decades(), scaled(), parallel(), impossible(), as_designs()].concat()
}

/// The seed's limits.
fn seed() -> Limits {
    Limits {
        resistance_max_ohm: Some(6.0),
        settling_max_s: Some(0.1),
        outer_diameter_max_m: Some(0.038),
        length_max_m: Some(0.1),
        ..Limits::default()
    }
}

/// The optimum under `limits` with the target `height_m` up and wire of `wire_m`.
fn found(limits: Limits, height_m: f64, wire_m: f64) -> Result<Optimum, String> {
    let model =
        AirCoil::new(height_m, &MagnetRule::dipole([0.0, 0.0, -0.909_41])).map_err(reported)?;
    let wire = Wire {
        diameter_m: wire_m,
        conductor_diameter_m: wire_m,
        resistivity_ohm_m: 1.68e-8,
        temperature_c: 20.0,
        choices_m: vec![],
    };
    let task = Task {
        limits,
        fixed: Fixed::default(),
        pitch_m: None,
        bobbin: false,
        current_max_a: 2.0,
        voltage_v: None,
        bandwidth_hz: None,
        drivers: Drivers {
            ends_a: vec![[0.0, 2.0]],
            total_max_a: None,
        },
        strands: Strand::choices(&wire),
    };
    let settings = Settings {
        valley: false,
        ..Settings::default()
    };
    optimise(&model, &task, &settings, &Silent).map_err(reported)
}

fn best(limits: Limits) -> Result<BestCoil, String> {
    let outcome = found(limits, 0.03, 7e-4)?;
    outcome.best.ok_or_else(|| format!("{:?}", outcome.status))
}

/// Proven to the certificate's gap, every limit kept to 1e-9.
fn proven(limits: Limits, height_m: f64) -> Outcome {
    let outcome = found(limits, height_m, 7e-4)?;
    let coil = outcome
        .best
        .ok_or_else(|| format!("{:?}", outcome.status))?;
    if outcome.certificate.kind != CertificateKind::Global {
        return Err(format!("{:?}", outcome.certificate));
    }
    for limit in &coil.limits {
        let over = if limit.name.is_lower() {
            limit.limit / limit.value
        } else {
            limit.value / limit.limit
        };
        if over > 1.0 + 1e-9 {
            return Err(format!("{limit:?}"));
        }
    }
    let upper = outcome.certificate.upper_bound_n.ok_or("no bound")?;
    measured(
        upper / coil.force_n - 1.0,
        format!("{:.9e} N of at most {upper:.9e} N", coil.force_n),
    )
}

fn resistance(ohm: f64) -> Outcome {
    proven(
        Limits {
            resistance_max_ohm: Some(ohm),
            ..seed()
        },
        0.03,
    )
}

fn decades() -> Vec<Case> {
    let words = "the best coil, proven to 1e-6, every limit kept";
    vec![
        case("limits: 6 mohm", words, GAP, || resistance(0.006)),
        case("limits: 0.6 ohm", words, GAP, || resistance(0.6)),
        case("limits: 6 ohm", words, GAP, || resistance(6.0)),
        case("limits: 6 kohm", words, GAP, || resistance(6e3)),
        case("limits: settling in 1 ms", words, GAP, || {
            proven(
                Limits {
                    settling_max_s: Some(1e-3),
                    ..seed()
                },
                0.03,
            )
        }),
        case("limits: settling in 1000 s", words, GAP, || {
            proven(
                Limits {
                    settling_max_s: Some(1e3),
                    ..seed()
                },
                0.03,
            )
        }),
        case("limits: target 1 mm up", words, GAP, || {
            proven(seed(), 0.001)
        }),
        case("limits: target 1 m up", words, GAP, || proven(seed(), 1.0)),
        case(
            "limits: more resistance allowed, six decades",
            "the force never falls",
            0.0,
            || {
                let forces: Result<Vec<f64>, String> = [0.006, 0.06, 0.6, 6.0, 60.0, 600.0, 6e3]
                    .iter()
                    .map(|&ohm| {
                        Ok(best(Limits {
                            resistance_max_ohm: Some(ohm),
                            ..seed()
                        })?
                        .force_n)
                    })
                    .collect();
                let forces = forces?;
                holds(
                    forces.windows(2).all(|f| f[1] >= f[0] * (1.0 - 1e-9)),
                    format!("{forces:.6?} N"),
                )
            },
        ),
        case(
            "limits: those that cannot bind",
            "nothing changes, N",
            1e-9,
            || {
                let loose = Limits {
                    power_max_w: Some(1e9),
                    mass_max_kg: Some(1e9),
                    wire_length_max_m: Some(1e9),
                    inner_diameter_min_m: Some(1e-12),
                    ..seed()
                };
                close(best(loose)?.force_n, best(seed())?.force_n, "N")
            },
        ),
    ]
}

/// All lengths times k at the same current: turns stay, R goes like 1 / k, L like k, the gradient
/// like 1 / k^2.
fn of_size(k: f64) -> Outcome {
    let limits = Limits {
        resistance_max_ohm: Some(6.0 / k),
        settling_max_s: Some(0.1 * k * k),
        outer_diameter_max_m: Some(0.038 * k),
        length_max_m: Some(0.1 * k),
        ..seed()
    };
    let outcome = found(limits, 0.03 * k, 7e-4 * k)?;
    let coil = outcome
        .best
        .ok_or_else(|| format!("{:?}", outcome.status))?;
    close(coil.force_n * k * k, best(seed())?.force_n, "N")
}

fn scaled() -> Vec<Case> {
    let words = "the seed's best force over the scale's square, N, to the proof's 1e-6";
    vec![
        case("limits: a coil a thousand times larger", words, GAP, || {
            of_size(1e3)
        }),
        case(
            "limits: a coil a thousand times smaller",
            words,
            GAP,
            || of_size(1e-3),
        ),
    ]
}

fn parallel() -> Vec<Case> {
    // Mass over length of the wire.
    const PER_M: f64 = 8890.0 * 0.25 * std::f64::consts::PI * 49e-8;
    let words = "the force of either limit alone, N";
    vec![
        case(
            "limits: mass and wire length that say the same",
            words,
            1e-8,
            || {
                let one = Limits {
                    resistance_max_ohm: None,
                    wire_length_max_m: Some(90.0),
                    ..seed()
                };
                let both = Limits {
                    mass_max_kg: Some(90.0 * PER_M),
                    ..one
                };
                close(best(both)?.force_n, best(one)?.force_n, "N")
            },
        ),
        case(
            "limits: mass and wire length that differ by 1e-9",
            words,
            1e-8,
            || {
                let one = Limits {
                    resistance_max_ohm: None,
                    wire_length_max_m: Some(90.0),
                    ..seed()
                };
                let both = Limits {
                    mass_max_kg: Some(90.0 * PER_M * (1.0 - 1e-9)),
                    ..one
                };
                close(best(both)?.force_n, best(one)?.force_n, "N")
            },
        ),
        case(
            "limits: heat and resistance that say the same",
            words,
            1e-8,
            || {
                let both = Limits {
                    power_max_w: Some(24.0),
                    ..seed()
                };
                close(best(both)?.force_n, best(seed())?.force_n, "N")
            },
        ),
        case(
            "limits: heat, resistance, mass and length within 1e-10",
            words,
            1e-8,
            || {
                let metres = 6.0 * 0.25 * std::f64::consts::PI * 49e-8 / 1.68e-8;
                let all = Limits {
                    power_max_w: Some(24.0 * (1.0 + 1e-10)),
                    wire_length_max_m: Some(metres * (1.0 - 1e-10)),
                    mass_max_kg: Some(metres * PER_M * (1.0 + 2e-10)),
                    ..seed()
                };
                close(best(all)?.force_n, best(seed())?.force_n, "N")
            },
        ),
        case(
            "limits: every limit meets in one coil",
            "that coil, N, to the proof's 1e-6",
            GAP,
            || {
                let coil = best(seed())?;
                let value =
                    |name: LimitName| coil.limits.iter().find(|l| l.name == name).map(|l| l.value);
                let tight = Limits {
                    resistance_max_ohm: value(LimitName::Resistance),
                    settling_max_s: value(LimitName::Settling),
                    outer_diameter_max_m: value(LimitName::OuterDiameter),
                    length_max_m: value(LimitName::Length),
                    inner_diameter_min_m: Some(2.0 * coil.window.inner_radius_m),
                    ..seed()
                };
                close(best(tight)?.force_n, coil.force_n, "N")
            },
        ),
    ]
}

fn impossible() -> Vec<Case> {
    vec![
        case(
            "limits: a bore wider than the coil",
            "a contradiction of the two diameters is named",
            0.0,
            || {
                let outcome = found(
                    Limits {
                        inner_diameter_min_m: Some(0.039),
                        ..seed()
                    },
                    0.03,
                    7e-4,
                )?;
                match outcome.status {
                    OptimumStatus::Contradictory(c) => {
                        let named = c.between.contains(&LimitName::InnerDiameter)
                            && c.between.contains(&LimitName::OuterDiameter);
                        holds(named, c.message)
                    }
                    other => Err(format!("{other:?}")),
                }
            },
        ),
        case(
            "limits: none at all",
            "the force has no maximum, and what is missing is named",
            0.0,
            || {
                let outcome = found(Limits::default(), 0.03, 7e-4)?;
                match outcome.status {
                    OptimumStatus::Unbounded { missing } => {
                        holds(!missing.is_empty(), format!("{missing:?}"))
                    }
                    other => Err(format!("{other:?}")),
                }
            },
        ),
        case(
            "limits: a billionth of an ohm",
            "a coil within its limits, proven; or it is said that there is none",
            0.0,
            || {
                let limits = Limits {
                    resistance_max_ohm: Some(1e-9),
                    ..seed()
                };
                let outcome = found(limits, 0.03, 7e-4)?;
                match (&outcome.status, &outcome.best) {
                    (OptimumStatus::Optimal, Some(coil)) => holds(
                        coil.limits
                            .iter()
                            .all(|l| l.name.is_lower() || l.value <= l.limit * (1.0 + 1e-9)),
                        format!("{:.3e} N", coil.force_n),
                    ),
                    (OptimumStatus::Infeasible { .. } | OptimumStatus::Contradictory(_), None) => {
                        holds(true, format!("{:?}", outcome.status))
                    }
                    _ => Err(format!("{outcome:?}")),
                }
            },
        ),
        case(
            "limits: a bore as wide as the coil",
            "no winding is left: a contradiction, or no force",
            0.0,
            || {
                let outcome = found(
                    Limits {
                        inner_diameter_min_m: Some(0.038),
                        ..seed()
                    },
                    0.03,
                    7e-4,
                )?;
                let nothing = outcome.best.as_ref().is_none_or(|b| b.force_n < 1e-9);
                holds(
                    nothing && outcome.status != OptimumStatus::Optimal,
                    format!("{:?}", outcome.status),
                )
            },
        ),
        case(
            "limits: a bore a micrometre narrower than the coil",
            "no room for one layer of wire: a contradiction of the two diameters is named",
            0.0,
            || {
                let limits = Limits {
                    inner_diameter_min_m: Some(0.037_999),
                    ..seed()
                };
                match found(limits, 0.03, 7e-4)?.status {
                    OptimumStatus::Contradictory(c) => {
                        holds(c.message.contains("one layer of 0.7 mm wire"), c.message)
                    }
                    other => Err(format!("{other:?}")),
                }
            },
        ),
    ]
}

fn design(limits: &str) -> Result<Design, String> {
    let text = format!(
        "name = \"limits\"\n[wire]\ndiameter_mm = 0.7\n[magnet]\ndiameter_mm = 10.0\n\
         length_mm = 10.0\nmagnetization_a_per_m = 1.1579e6\n[supply]\ncurrent_max_a = 2.0\n\
         [target]\nheight_mm = 30.0\n[limits]\n{limits}\n"
    );
    Design::from_toml(&text, Path::new("limits.toml"), Need::OPTIMIZE)
        .map(|(design, _)| design)
        .map_err(|invalid| invalid.faults.plain())
}

fn as_designs() -> Vec<Case> {
    let refusal = "refused with the key";
    vec![
        case("limits: a limit of zero", refusal, 0.0, || {
            refused(
                design("resistance_max_ohm = 0.0"),
                &["limits.resistance_max_ohm"],
            )
        }),
        case("limits: a negative limit", refusal, 0.0, || {
            refused(design("mass_max_kg = -1.0"), &["limits.mass_max_kg"])
        }),
        case("limits: a limit that is not a number", refusal, 0.0, || {
            refused(design("settling_max_ms = nan"), &["limits.settling_max_ms"])
        }),
        case("limits: an infinite limit", refusal, 0.0, || {
            refused(design("length_max_mm = inf"), &["limits.length_max_mm"])
        }),
        case(
            "limits: three faults at once",
            "all three are reported",
            0.0,
            || {
                refused(
                    design("resistance_max_ohm = 0.0\nmass_max_kg = -1.0\nlength_max_mm = nan"),
                    &[
                        "limits.resistance_max_ohm",
                        "limits.mass_max_kg",
                        "limits.length_max_mm",
                    ],
                )
            },
        ),
        case(
            "limits: of 1e-300 and 1e300",
            "accepted as they stand",
            0.0,
            || {
                let d = design("resistance_max_ohm = 1e300\npower_max_w = 1e-300")?;
                worst(
                    [
                        off(d.limits.resistance_max_ohm.unwrap_or(0.0), 1e300),
                        off(d.limits.power_max_w.unwrap_or(0.0), 1e-300),
                    ],
                    "both limits",
                )
            },
        ),
    ]
}
