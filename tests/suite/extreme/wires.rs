//! Wires of 0.02 mm to 5 mm: resistance, fill, turns.

use std::f64::consts::PI;
use std::path::Path;

use super::check::{Outcome, close, holds, measured, off, refused, reported, worst};
use super::{Case, case};
use fluxform::coil::array_heat::Drivers;
use fluxform::coil::circuit::{Circuit, turns_that_fit};
use fluxform::coil::optimum::air::AirCoil;
use fluxform::coil::optimum::{Fixed, Settings, Strand, Task, optimise_wound};
use fluxform::commands::evaluate::{Evaluation, evaluate};
use fluxform::design::gauge::awg_mm;
use fluxform::design::{Coil, Design, Limits, Need, Wire};
use fluxform::field::magnet::MagnetRule;
use fluxform::progress::Silent;

pub fn cases() -> Vec<Case> {
    [circuits(), windings(), wound()].concat()
}

const COIL: Coil = Coil {
    inner_diameter_m: 0.024,
    outer_diameter_m: 0.038,
    length_m: 0.1,
    turns: None,
};

fn wire(diameter_m: f64) -> Wire {
    Wire {
        diameter_m,
        conductor_diameter_m: diameter_m,
        resistivity_ohm_m: 1.68e-8,
        temperature_c: 20.0,
        choices_m: vec![],
    }
}

/// R = 4 rho depth L (a1 + a2) / d^4 with as many turns as fit, and the wire's length and mass.
fn resistance(d: f64) -> Outcome {
    let circuit = Circuit::of_air_coil(&COIL, &wire(d));
    let turns = 0.007 * 0.1 / (d * d);
    let length = turns * PI * 0.031;
    worst(
        [
            off(circuit.turns, turns),
            off(
                circuit.resistance_ohm,
                4.0 * 1.68e-8 * 0.007 * 0.1 * 0.031 / d.powi(4),
            ),
            off(circuit.wire_length_m, length),
            off(circuit.wire_mass_kg, 8890.0 * 0.25 * PI * d * d * length),
        ],
        &format!(
            "{:.6e} turns, {:.6e} ohm, {:.6e} m",
            turns, circuit.resistance_ohm, length
        ),
    )
}

fn circuits() -> Vec<Case> {
    let words = "depth L / d^2 turns, 4 rho depth L (a1 + a2) / d^4 ohm, length and mass";
    vec![
        case("wires: 0.02 mm", words, 1e-13, || resistance(2e-5)),
        case("wires: 0.1 mm", words, 1e-13, || resistance(1e-4)),
        case("wires: 0.7 mm", words, 1e-13, || resistance(7e-4)),
        case("wires: 2 mm", words, 1e-13, || resistance(2e-3)),
        case("wires: 5 mm", words, 1e-13, || resistance(5e-3)),
        case(
            "wires: L / R from 0.02 mm to 5 mm",
            "the same time constant whatever the wire, s",
            1e-12,
            || {
                let tau = |d: f64| Circuit::of_air_coil(&COIL, &wire(d)).time_constant_s();
                let expected = tau(7e-4);
                worst(
                    [2e-5, 1e-4, 2e-3, 5e-3].map(|d| off(tau(d), expected)),
                    "time constants",
                )
            },
        ),
        case(
            "wires: heat at equal ampere-turns from 0.02 mm to 5 mm",
            "the same heat whatever the wire, W",
            1e-12,
            || {
                let heat = |d: f64| {
                    let circuit = Circuit::of_air_coil(&COIL, &wire(d));
                    circuit.power_w(2858.0 / circuit.turns)
                };
                let expected = heat(7e-4);
                worst(
                    [2e-5, 1e-4, 2e-3, 5e-3].map(|d| off(heat(d), expected)),
                    "heats",
                )
            },
        ),
        case(
            "wires: a conductor of a thousandth of the insulation",
            "a million times the resistance, the same inductance",
            1e-13,
            || {
                let thin = Wire {
                    conductor_diameter_m: 7e-7,
                    ..wire(7e-4)
                };
                let (a, b) = (
                    Circuit::of_air_coil(&COIL, &thin),
                    Circuit::of_air_coil(&COIL, &wire(7e-4)),
                );
                worst(
                    [
                        off(a.resistance_ohm / b.resistance_ohm, 1e6),
                        off(a.inductance_h, b.inductance_h),
                    ],
                    &format!("{:.6e} ohm", a.resistance_ohm),
                )
            },
        ),
        case(
            "wires: AWG 4/0 and AWG 36",
            "0.46 inch and 0.005 inch, by definition",
            1e-14,
            || {
                let of = |name: &str| awg_mm(name).ok_or("no gauge");
                worst(
                    [off(of("AWG 36")?, 0.127), off(of("AWG 4/0")?, 11.684)],
                    "the scale's two fixed points",
                )
            },
        ),
        case(
            "wires: AWG 57",
            "no gauge: the scale ends at 56",
            0.0,
            || holds(awg_mm("AWG 57").is_none(), "none"),
        ),
    ]
}

/// A design of the seed's winding with other lines for wire and turns.
fn design(wire: &str, turns: &str) -> Result<Design, String> {
    let text = format!(
        "name = \"wire\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\n\
         length_mm = 100.0\n{turns}\n[wire]\n{wire}\n[magnet]\ndiameter_mm = 10.0\n\
         length_mm = 10.0\nmagnetization_a_per_m = 1.1579e6\n[supply]\ncurrent_max_a = 2.0\n\
         [target]\nheight_mm = 30.0\n"
    );
    Design::from_toml(&text, Path::new("wire.toml"), Need::EVALUATE)
        .map(|(design, _)| design)
        .map_err(|invalid| invalid.faults.plain())
}

fn evaluated(wire: &str, turns: &str) -> Result<Evaluation, String> {
    evaluate(&design(wire, turns)?, vec![], None).map_err(reported)
}

fn windings() -> Vec<Case> {
    vec![
        case(
            "wires: thicker than the winding",
            "refused: thicker than the radial build",
            0.0,
            || {
                refused(
                    design("diameter_mm = 7.000001", ""),
                    &["thicker than the winding's radial build"],
                )
            },
        ),
        case(
            "wires: as thick as the winding",
            "one layer of L / d turns, 14.2857",
            1e-12,
            || {
                close(
                    evaluated("diameter_mm = 7.0", "")?.coil.turns,
                    100.0 / 7.0,
                    "turns",
                )
            },
        ),
        case(
            "wires: 0.02 mm in the seed's winding, evaluated",
            "a voltage would be absurd, R is not: 4 rho depth L (a1 + a2) / d^4 ohm",
            1e-12,
            || {
                let found = evaluated("diameter_mm = 0.02", "")?
                    .coil
                    .circuit
                    .resistance_ohm;
                close(
                    found,
                    4.0 * 1.68e-8 * 0.007 * 0.1 * 0.031 / 2e-5_f64.powi(4),
                    "ohm",
                )
            },
        ),
        case(
            "wires: ten times the turns that fit",
            "reported, not refused: winding_fill 10 of 1, not met",
            1e-12,
            || {
                let found = evaluated("diameter_mm = 0.7", "turns = 14285.714285714286")?;
                let fill = found.limits.get("winding_fill").ok_or("no winding_fill")?;
                if fill.met {
                    return Err("met".to_owned());
                }
                close(fill.value, 10.0, "of 1")
            },
        ),
        case(
            "wires: a conductor thicker than its insulation",
            "refused: which is thicker is reported",
            0.0,
            || {
                refused(
                    design("diameter_mm = 0.7\nconductor_diameter_mm = 0.8", ""),
                    &["conductor", "thicker than the insulated wire"],
                )
            },
        ),
        case(
            "wires: at absolute zero",
            "refused: the linear law gives no positive resistivity",
            0.0,
            || {
                refused(
                    design("diameter_mm = 0.7\ntemperature_c = -273.15", ""),
                    &["at least -234.4 C"],
                )
            },
        ),
        case(
            "wires: just above the coldest the law allows",
            "R = rho (1 + alpha (T - 20)): 1e-3 of that at 20 C, ohm",
            // T is stated to 1e-16 of 254 K, the factor is 1e-3.
            1e-11,
            || {
                let t = 20.0 - (1.0 - 1e-3) / 3.93e-3;
                let cold = evaluated(&format!("diameter_mm = 0.7\ntemperature_c = {t:?}"), "")?;
                let warm = evaluated("diameter_mm = 0.7", "")?;
                close(
                    cold.coil.circuit.resistance_ohm,
                    1e-3 * warm.coil.circuit.resistance_ohm,
                    "ohm",
                )
            },
        ),
        case("wires: no diameter", "refused: above 0", 0.0, || {
            refused(design("diameter_mm = 0.0", ""), &["wire.diameter_mm"])
        }),
        case(
            "wires: an infinite diameter",
            "refused: finite",
            0.0,
            || refused(design("diameter_mm = inf", ""), &["wire.diameter_mm"]),
        ),
        case(
            "wires: a millionth of a turn",
            "everything in proportion, R in ohm",
            1e-13,
            || {
                let few = evaluated("diameter_mm = 0.7", "turns = 1e-6")?;
                let one = evaluated("diameter_mm = 0.7", "turns = 1")?;
                worst(
                    [
                        off(
                            few.coil.circuit.resistance_ohm,
                            1e-6 * one.coil.circuit.resistance_ohm,
                        ),
                        off(
                            few.coil.circuit.inductance_h,
                            1e-12 * one.coil.circuit.inductance_h,
                        ),
                        off(
                            few.target.gradient_t_per_m_per_a,
                            1e-6 * one.target.gradient_t_per_m_per_a,
                        ),
                    ],
                    "R, L and gradient",
                )
            },
        ),
    ]
}

/// The best coil of whole layers and turns: whole, within its limits, below the continuous one's
/// force, and no worse than the coil that rounding that one down gives.
fn whole(d: f64) -> Outcome {
    let model = AirCoil::new(0.03, &MagnetRule::dipole([0.0, 0.0, -0.909_41])).map_err(reported)?;
    let task = Task {
        limits: Limits {
            outer_diameter_max_m: Some(0.038),
            inner_diameter_min_m: Some(0.010),
            length_max_m: Some(0.1),
            ..Limits::default()
        },
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
        strands: Strand::choices(&wire(d)),
    };
    let outcome = optimise_wound(&model, &task, &Settings::default(), &Silent).map_err(reported)?;
    let best = outcome
        .best
        .ok_or_else(|| format!("{:?}", outcome.status))?;
    let continuous = outcome.continuous_force_n.ok_or("no continuous coil")?;
    // Without limits on resistance or heat the fullest winding is the strongest.
    let (layers, turns) = ((0.014 / d + 1e-9).floor(), (0.1 / d + 1e-9).floor());
    let whole = best.whole.ok_or("turns that are not whole")?;
    if (whole.layers as f64, whole.turns_per_layer as f64) != (layers, turns) {
        return Err(format!(
            "{} layers of {} turns",
            whole.layers, whole.turns_per_layer
        ));
    }
    if best.force_n > continuous * (1.0 + 1e-9) {
        return Err(format!(
            "{} N above the continuous {continuous} N",
            best.force_n
        ));
    }
    measured(
        off(best.window.depth_m, layers * d).max(off(best.window.length_m, turns * d)),
        format!("{layers} layers of {turns} turns, {:.6} N", best.force_n),
    )
}

fn wound() -> Vec<Case> {
    let words = "the window filled: whole layers and turns, no stronger than the continuous coil";
    vec![
        case("wires: wound of 5 mm", words, 1e-9, || whole(5e-3)),
        case("wires: wound of 0.7 mm", words, 1e-9, || whole(7e-4)),
        case("wires: wound of 0.02 mm", words, 1e-9, || whole(2e-5)).within(120.0),
        case(
            "wires: turns that fit, 1e-6 of the window",
            "depth L / d^2",
            1e-13,
            || {
                close(
                    turns_that_fit(&COIL, &wire(7e-9)),
                    0.007 * 0.1 / 49e-18,
                    "turns",
                )
            },
        ),
    ]
}
