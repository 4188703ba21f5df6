//! Eddy diffusion against L/R, limits that are nearly parallel, errors weighed like penalties.

use super::check::{
    Outcome, apart, holds, measured, number, off, oracle, refused, reported, worst,
};
use super::{Case, case};
use fluxform::coil::transient::VoltageStep;
use fluxform::lambda::{ForceProblem, Settings, solve};
use fluxform::numerics::random::Random;
use fluxform::numerics::small_quadratic::{Row, minimise};

pub fn cases() -> Vec<Case> {
    [diffusion(), parallel(), penalties()].concat()
}

const STEP: VoltageStep = VoltageStep {
    resistance_ohm: 6.0753,
    air_inductance_h: 0.014_501_9,
    inductance_h: 0.184_092,
    relative_permeability: 1000.0,
    conductivity_s_per_m: 5.8e6,
    core_radius_m: 0.012,
    core_energy_share: 0.6,
    air_share: 0.128,
};

fn times(step: &VoltageStep) -> Result<[f64; 2], String> {
    let settling = step.settling().map_err(reported)?;
    Ok([settling.current_95_s, settling.force_95_s])
}

fn inverted(index: usize) -> Outcome {
    let table = oracle(include_str!("../../oracles/transient.json"))?;
    let row = &table[index];
    let of = |key: &str| number(&row[key]);
    let found = times(&VoltageStep {
        resistance_ohm: of("resistance_ohm")?,
        air_inductance_h: of("air_inductance_h")?,
        inductance_h: of("inductance_h")?,
        relative_permeability: of("relative_permeability")?,
        conductivity_s_per_m: of("conductivity_s_per_m")?,
        core_radius_m: of("core_radius_m")?,
        core_energy_share: of("core_energy_share")?,
        air_share: of("air_share")?,
    })?;
    worst(
        [
            off(found[0], of("current_95_s")?),
            off(found[1], of("force_95_s")?),
        ],
        &format!("current {:.9e} s, force {:.9e} s", found[0], found[1]),
    )
}

fn diffusion() -> Vec<Case> {
    let words = "times to 95 % of the inverted Laplace transform, s";
    let simple = 20.0_f64.ln() * STEP.inductance_h / STEP.resistance_ohm;
    vec![
        case("stiffness: eddies in the seed's core", words, 1e-11, || {
            inverted(0)
        }),
        case(
            "stiffness: eddies slower than the circuit",
            words,
            1e-11,
            || inverted(1),
        ),
        case(
            "stiffness: eddies, the table's third case",
            words,
            1e-11,
            || inverted(2),
        ),
        case(
            "stiffness: eddies, the table's fourth case",
            words,
            1e-11,
            || inverted(3),
        ),
        case(
            "stiffness: eddies, the table's fifth case",
            words,
            1e-11,
            || inverted(4),
        ),
        case(
            "stiffness: eddies, the table's sixth case",
            words,
            1e-11,
            || inverted(5),
        ),
        case(
            "stiffness: eddies, the table's seventh case",
            words,
            1e-11,
            || inverted(6),
        ),
        case(
            "stiffness: a core of glass",
            format!("ln 20 L / R = {simple:.9} s for both"),
            1e-14,
            || {
                let found = times(&VoltageStep {
                    conductivity_s_per_m: 0.0,
                    ..STEP
                })?;
                let wanted = 20.0_f64.ln() * STEP.inductance_h / STEP.resistance_ohm;
                worst(found.map(|t| off(t, wanted)), "both times")
            },
        ),
        case(
            "stiffness: diffusion a million times faster than L / R",
            "ln 20 L / R, but for the share of the diffusion time",
            1e-5,
            || {
                let found = times(&VoltageStep {
                    conductivity_s_per_m: 1.0,
                    ..STEP
                })?;
                let wanted = 20.0_f64.ln() * STEP.inductance_h / STEP.resistance_ohm;
                worst(found.map(|t| off(t, wanted)), "both times")
            },
        ),
        case(
            "stiffness: diffusion from 1e-9 to 1e6 of L / R",
            "the force is never faster than the current, and times are finite",
            0.0,
            || {
                let mut good = true;
                for exponent in -4..12 {
                    let conductivity_s_per_m = 10.0_f64.powi(exponent);
                    let [current, force] = times(&VoltageStep {
                        conductivity_s_per_m,
                        ..STEP
                    })?;
                    good &=
                        current.is_finite() && current > 0.0 && force >= current * (1.0 - 1e-12);
                }
                holds(good, "sixteen decades of conductivity")
            },
        ),
        case(
            "stiffness: ohms and siemens scaled by a million",
            "all times scale by a million",
            1e-10,
            || {
                let base = times(&STEP)?;
                let slow = times(&VoltageStep {
                    resistance_ohm: STEP.resistance_ohm * 1e-6,
                    conductivity_s_per_m: STEP.conductivity_s_per_m * 1e6,
                    ..STEP
                })?;
                worst([0, 1].map(|k| off(slow[k] * 1e-6, base[k])), "both times")
            },
        ),
        case(
            "stiffness: diffusion that would take geological times",
            "refused: the diffusion time exceeds the winding's too far",
            0.0,
            || {
                refused(
                    VoltageStep {
                        conductivity_s_per_m: 1e20,
                        ..STEP
                    }
                    .settling(),
                    &["diffusion time", "exceeds"],
                )
            },
        ),
    ]
}

/// The minimum of |x - target|^2 under rows `normal . x <= limit`.
fn nearest(target: [f64; 3], rows: &[([f64; 3], f64)]) -> Result<[f64; 3], String> {
    let mut identity = [[0.0; 3]; 3];
    for (i, row) in identity.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let rows: Vec<Row> = rows
        .iter()
        .map(|&(normal, limit)| Row {
            normal,
            limit,
            equality: false,
        })
        .collect();
    let minimum = minimise(identity, target.map(|t| -t), &rows).ok_or("no minimum")?;
    Ok(minimum.step)
}

/// How far the point of two half spaces nearest to `target` is from `expected`.
fn projected(target: [f64; 3], rows: [([f64; 3], f64); 2], expected: [f64; 3]) -> Outcome {
    let found = nearest(target, &rows)?;
    measured(apart(&found, &expected), format!("{found:?}"))
}

fn parallel() -> Vec<Case> {
    vec![
        case(
            "stiffness: two limits parallel but for 1e-9, one binds",
            "the projection onto the nearer of the two planes",
            1e-8,
            || {
                projected(
                    [2.0, 0.0, 0.0],
                    [([1.0, 0.0, 0.0], 1.0), ([1.0, 1e-9, 0.0], 1.0 + 1e-6)],
                    [1.0, 0.0, 0.0],
                )
            },
        ),
        case(
            "stiffness: two limits exactly parallel, one 1e-8 tighter",
            "the projection onto the tighter one",
            1e-12,
            || {
                projected(
                    [2.0, 0.3, 0.0],
                    [([1.0, 0.0, 0.0], 1.0), ([1.0, 0.0, 0.0], 1.0 - 1e-8)],
                    [1.0 - 1e-8, 0.3, 0.0],
                )
            },
        ),
        // 1e-10 (1 + |x| + limit) is what a limit may be exceeded by.
        case(
            "stiffness: two limits exactly parallel, one a hair tighter",
            "the projection onto the tighter one, to the solver's slack of 3e-10",
            3.1e-10,
            || {
                projected(
                    [2.0, 0.3, 0.0],
                    [([1.0, 0.0, 0.0], 1.0), ([1.0, 0.0, 0.0], 1.0 - 1e-10)],
                    [1.0 - 1e-10, 0.3, 0.0],
                )
            },
        ),
        case(
            "stiffness: the same limit twice",
            "the projection onto it",
            1e-14,
            || {
                projected(
                    [2.0, 0.3, -0.7],
                    [([1.0, 0.0, 0.0], 1.0); 2],
                    [1.0, 0.3, -0.7],
                )
            },
        ),
        case(
            "stiffness: a wedge of two limits 1e-6 apart",
            "the wedge's edge: x = 1, y = 0, to rounding over the angle",
            1e-9,
            || {
                projected(
                    // Beyond both, between their normals' cone and the edge.
                    [2.0, 1.0, 0.4],
                    // x <= 1 and (1 - 1e-6) x >= 1 - 1e-6 + 1e-6 y: with x = 1 that is y <= 0.
                    [
                        ([1.0, 0.0, 0.0], 1.0),
                        ([-1.0 + 1e-6, 1e-6, 0.0], -1.0 + 1e-6),
                    ],
                    [1.0, 0.0, 0.4],
                )
            },
        ),
        case(
            "stiffness: the sum's limit parallel to the coils' own",
            "equal coils: whichever of u and I_t / n is smaller decides, to 1e-12",
            1e-12,
            || {
                let mut errors = Vec::new();
                for total in [4.0 * (1.0 - 1e-12), 4.0, 4.0 * (1.0 + 1e-12)] {
                    let forces = vec![0.13; 4 * 7];
                    let solution = solve(
                        &ForceProblem {
                            forces_n_per_a: &forces,
                            height_m: &[0.05; 7],
                            offset_n: None,
                            weights: None,
                            lower_a: &[0.0; 4],
                            upper_a: &[1.0; 4],
                            total_max_a: Some(total),
                            resistance_ohm: &[6.0; 4],
                        },
                        &Settings::default(),
                    )
                    .map_err(reported)?;
                    let found = solution
                        .constants
                        .lambda_linear_n_per_m
                        .ok_or("no limit binds")?;
                    errors.push(off(found, 0.13 * total.min(4.0) / 0.05));
                }
                worst(errors, "lambda_linear against n u G / h")
            },
        ),
    ]
}

/// One point weighs `weight` times the others: its error against that of plain weights.
fn heavy(weight: f64) -> Outcome {
    let mut n = Random::new(17);
    let forces: Vec<f64> = (0..30 * 4).map(|_| n.between(0.02, 0.3)).collect();
    let heights: Vec<f64> = (0..30).map(|_| n.between(0.03, 0.08)).collect();
    let mut weights = vec![1.0; 30];
    weights[11] = weight;
    let (lower, upper, ohm) = ([-50.0; 4], [50.0; 4], [6.0; 4]);
    let error_of = |weights: &[f64]| -> Result<f64, String> {
        let solution = solve(
            &ForceProblem {
                forces_n_per_a: &forces,
                height_m: &heights,
                offset_n: None,
                weights: Some(weights),
                lower_a: &lower,
                upper_a: &upper,
                total_max_a: None,
                resistance_ohm: &ohm,
            },
            &Settings::default(),
        )
        .map_err(reported)?;
        let currents = solution.path.currents_a(2.0);
        let force: f64 = (0..4).map(|i| forces[11 * 4 + i] * currents[i]).sum();
        Ok((2.0 * heights[11] - force).abs())
    };
    let (plain, penalised) = (error_of(&[1.0; 30])?, error_of(&weights)?);
    // The multiplier of the equality is finite: the error falls like its weight.
    measured(
        penalised * weight / plain,
        format!("{penalised:.3e} N left of {plain:.3e} N"),
    )
}

fn penalties() -> Vec<Case> {
    let words = "the error there falls like 1 / weight, at most 1e3 times that over the plain one";
    vec![
        case(
            "stiffness: a point weighs 1e4 times the others",
            words,
            1.0,
            || scaled(heavy(1e4)?),
        ),
        case(
            "stiffness: a point weighs 1e8 times the others",
            words,
            1.0,
            || scaled(heavy(1e8)?),
        ),
        case(
            "stiffness: a point weighs 1e12 times the others",
            words,
            1.0,
            || scaled(heavy(1e12)?),
        ),
    ]
}

fn scaled(got: super::Got) -> Outcome {
    measured(got.error / 1e3, got.value)
}
