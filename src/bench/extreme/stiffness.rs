//! Time constants six decades apart, steps far longer than any, diffusion against L/R, limits
//! that are nearly parallel, errors weighed like penalties.

use nalgebra::DMatrix;

use super::check::{
    Numbers, Outcome, SEED, close, holds, measured, number, off, oracle, refused, told, worst,
};
use super::{Case, case};
use crate::coil::drive::Drive;
use crate::coil::inductance::self_inductance_h;
use crate::coil::mutual::inductance_matrix_h;
use crate::coil::transient::VoltageStep;
use crate::lambda::{ForceProblem, Settings, solve};
use crate::numerics::small_quadratic::{Row, minimise};

pub fn cases() -> Vec<Case> {
    [circuits(), refusals(), diffusion(), parallel(), penalties()].concat()
}

/// Three coupled coils whose time constants lie six decades apart.
const STIFF_H: [f64; 9] = [
    1.3, -0.4e-3, -0.2e-6, //
    -0.4e-3, 0.9e-3, -0.1e-6, //
    -0.2e-6, -0.1e-6, 0.7e-6,
];
const STIFF_OHM: [f64; 3] = [1.1, 0.7, 0.9];
const COMMAND_A: [f64; 3] = [1.7, -0.6, 0.3];

/// Currents after holding `COMMAND_A` for `steps` times `step_s`.
fn held(inductance_h: &[f64], ohm: &[f64], step_s: f64, steps: usize) -> Result<Vec<f64>, String> {
    let mut drive = Drive::new(inductance_h, ohm, None).map_err(told)?;
    for _ in 0..steps {
        drive.hold(&COMMAND_A[..ohm.len()], step_s);
    }
    let mut currents = vec![0.0; ohm.len()];
    drive.currents(&mut currents);
    Ok(currents)
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// The same by implicit Euler in `steps` steps.
fn euler(until_s: f64, steps: usize) -> Result<Vec<f64>, String> {
    let dt = until_s / steps as f64;
    let l = DMatrix::from_row_slice(3, 3, &STIFF_H);
    let r = DMatrix::from_fn(3, 3, |i, j| if i == j { STIFF_OHM[i] } else { 0.0 });
    let lu = (&l / dt + &r).lu();
    let mut x = DMatrix::zeros(3, 1);
    let v = DMatrix::from_fn(3, 1, |i, _| STIFF_OHM[i] * COMMAND_A[i]);
    for _ in 0..steps {
        x = lu.solve(&(&l * &x / dt + &v)).ok_or("singular")?;
    }
    Ok(x.as_slice().to_vec())
}

/// Two equal coils of 1 H and 1 ohm, coupled by k: modes of (1 +- k) s.
fn pair(k: f64, at_s: f64, bound_of: impl Fn(f64) -> f64) -> Outcome {
    let mut drive = Drive::new(&[1.0, k, k, 1.0], &[1.0, 1.0], None).map_err(told)?;
    drive.hold(&[1.0, 0.0], at_s);
    let mut found = [0.0; 2];
    drive.currents(&mut found);
    let (sum, difference) = (-(-at_s / (1.0 + k)).exp_m1(), -(-at_s / (1.0 - k)).exp_m1());
    let wanted = [0.5 * (sum + difference), 0.5 * (sum - difference)];
    worst(
        [0, 1].map(|i| bound_of((found[i] - wanted[i]).abs())),
        &format!("{:.12} and {:.12} A", found[0], found[1]),
    )
}

fn circuits() -> Vec<Case> {
    let independent = "the same currents with one step as with many";
    vec![
        case(
            "stiffness: two coils, L/R of 1 s and 1 us, after 1 us",
            "1 - exp(-t R / L) each, A",
            1e-14,
            || {
                let found = held(&[1.0, 0.0, 0.0, 1e-6], &[1.0, 1.0], 1e-6, 1)?;
                let wanted = [-1.7 * (-1e-6_f64).exp_m1(), 0.6 * (-1.0_f64).exp_m1()];
                worst(
                    [off(found[0], wanted[0]), off(found[1], wanted[1])],
                    &format!("{:.9e} and {:.9e} A", found[0], found[1]),
                )
            },
        ),
        case(
            "stiffness: L/R of 1 s and 1 ns in one array, steps of 1 s",
            "1 - exp(-t R / L) each, A; the fast one is settled",
            1e-14,
            || {
                let found = held(&[1.0, 0.0, 0.0, 1e-9], &[1.0, 1.0], 1.0, 3)?;
                worst(
                    [
                        off(found[0], -1.7 * (-3.0_f64).exp_m1()),
                        off(found[1], -0.6),
                    ],
                    &format!("{:.12} and {:.12} A", found[0], found[1]),
                )
            },
        ),
        case(
            "stiffness: three coupled coils, one step of 1 us or 1000 of 1 ns",
            independent,
            1e-12,
            || {
                let (one, many) = (
                    held(&STIFF_H, &STIFF_OHM, 1e-6, 1)?,
                    held(&STIFF_H, &STIFF_OHM, 1e-9, 1000)?,
                );
                measured(apart(&one, &many), format!("{one:?} A"))
            },
        ),
        case(
            "stiffness: three coupled coils, one step of 1 s or a million of 1 us",
            independent,
            1e-9,
            || {
                let (one, many) = (
                    held(&STIFF_H, &STIFF_OHM, 1.0, 1)?,
                    held(&STIFF_H, &STIFF_OHM, 1e-6, 1_000_000)?,
                );
                measured(apart(&one, &many), format!("{one:?} A"))
            },
        ),
        case(
            "stiffness: a step a million times longer than the longest tau",
            "the commanded currents, A",
            1e-14,
            || {
                let found = held(&STIFF_H, &STIFF_OHM, 1e6, 1)?;
                measured(apart(&found, &COMMAND_A), format!("{found:?} A"))
            },
        ),
        case(
            "stiffness: a step of no length",
            "nothing changes: 0 A",
            0.0,
            || {
                let found = held(&STIFF_H, &STIFF_OHM, 0.0, 3)?;
                measured(apart(&found, &[0.0; 3]), format!("{found:?} A"))
            },
        ),
        case(
            "stiffness: a step of infinite length",
            "the commanded currents, A",
            1e-14,
            || {
                let found = held(&STIFF_H, &STIFF_OHM, f64::INFINITY, 1)?;
                measured(apart(&found, &COMMAND_A), format!("{found:?} A"))
            },
        ),
        case(
            "stiffness: implicit Euler approaches the exact step at first order",
            "errors of n, 2 n, 4 n steps halve: orders 1 (their next term is 1/n = 2.5e-3 of it)",
            0.02,
            || {
                let until_s = 1.3e-3;
                let exact = held(&STIFF_H, &STIFF_OHM, until_s, 1)?;
                let errors: Result<Vec<f64>, String> = [400, 800, 1600]
                    .into_iter()
                    .map(|n| Ok(apart(&euler(until_s, n)?, &exact)))
                    .collect();
                let errors = errors?;
                let orders = [
                    (errors[0] / errors[1]).log2(),
                    (errors[1] / errors[2]).log2(),
                ];
                worst(
                    orders.map(|o| (o - 1.0).abs()),
                    &format!("orders {orders:.4?}"),
                )
            },
        ),
        case(
            "stiffness: two coils coupled by 0.9",
            "modes of (1 +- k) L / R, A",
            1e-14,
            || pair(0.9, 0.7, |e| e),
        ),
        case(
            "stiffness: two coils coupled but for 1e-9",
            "modes of (1 +- k) L / R, A; the short one to the matrix' rounding, eps / 1e-9",
            1e-6,
            || pair(1.0 - 1e-9, 1.3e-9, |e| e),
        ),
        case(
            "stiffness: two coils coupled but for 1e-12, after 1 s",
            "modes of (1 +- k) L / R, A; the short one is over",
            1e-13,
            || pair(1.0 - 1e-12, 1.0, |e| e),
        ),
        case(
            "stiffness: nine touching air coils, energy",
            "the current's energy only falls once the voltages are off, and is 0 in the end",
            0.0,
            || {
                let axes: Vec<[f64; 2]> = (0..9)
                    .map(|i| [0.038 * f64::from(i % 3), 0.038 * f64::from(i / 3)])
                    .collect();
                let matrix = inductance_matrix_h(&SEED, self_inductance_h(&SEED), &axes).concat();
                let mut drive = Drive::new(&matrix, &[6.0753; 9], Some(36.0)).map_err(told)?;
                drive.settle(&[2.0, 0.0, 1.3, 0.7, 2.0, 0.0, 0.4, 1.9, 0.1]);
                let mut currents = [0.0; 9];
                let mut before = f64::INFINITY;
                let mut fell = true;
                for step_s in [1e-9, 1e-6, 1e-4, 1e-3, 1e-2, 0.1, 1.0] {
                    drive.hold(&[0.0; 9], step_s);
                    drive.currents(&mut currents);
                    let energy: f64 = (0..81)
                        .map(|k| 0.5 * matrix[k] * currents[k / 9] * currents[k % 9])
                        .sum();
                    fell &= energy <= before && energy >= 0.0;
                    before = energy;
                }
                holds(fell && before < 1e-30, format!("{before:.1e} J in the end"))
            },
        ),
        case(
            "stiffness: time constants of three coupled coils",
            "their sum is the trace of L / R, s",
            1e-14,
            || {
                let drive = Drive::new(&STIFF_H, &STIFF_OHM, None).map_err(told)?;
                let [short, long] = drive.time_constants_s().ok_or("none")?;
                let trace: f64 = (0..3).map(|i| STIFF_H[4 * i] / STIFF_OHM[i]).sum();
                // The middle one from the determinant.
                let t = DMatrix::from_fn(3, 3, |i, j| {
                    STIFF_H[3 * i + j] / (STIFF_OHM[i] * STIFF_OHM[j]).sqrt()
                });
                let middle = t.determinant() / (short * long);
                worst(
                    [off(short + middle + long, trace)],
                    &format!("{short:.3e} to {long:.3e} s"),
                )
            },
        ),
        case(
            "stiffness: the shortest of three time constants",
            "the last pivot of L / R by elimination, s, to (1e-3)^2 of the coupling's share",
            1e-9,
            || {
                let drive = Drive::new(&STIFF_H, &STIFF_OHM, None).map_err(told)?;
                let [short, _] = drive.time_constants_s().ok_or("none")?;
                // A mode a thousand times faster than the others sees them as held: the Schur
                // complement, corrected by its own share of their inverse squared.
                let t =
                    |i: usize, j: usize| STIFF_H[3 * i + j] / (STIFF_OHM[i] * STIFF_OHM[j]).sqrt();
                let det = t(0, 0) * t(1, 1) - t(0, 1) * t(0, 1);
                let x = [
                    (t(1, 1) * t(0, 2) - t(0, 1) * t(1, 2)) / det,
                    (t(0, 0) * t(1, 2) - t(0, 1) * t(0, 2)) / det,
                ];
                let schur = t(2, 2) - x[0] * t(0, 2) - x[1] * t(1, 2);
                close(short, schur / (1.0 + x[0] * x[0] + x[1] * x[1]), "s")
            },
        ),
    ]
}

fn refusals() -> Vec<Case> {
    let coils = "refused: not the inductance matrix of coils";
    vec![
        case("stiffness: two coils coupled perfectly", coils, 0.0, || {
            refused(
                Drive::new(&[1.0, 1.0, 1.0, 1.0], &[1.0, 1.0], None),
                &["inductance matrix"],
            )
        }),
        case(
            "stiffness: two coils coupled beyond measure",
            coils,
            0.0,
            || {
                refused(
                    Drive::new(&[1.0, 1.3, 1.3, 1.0], &[1.0, 1.0], None),
                    &["inductance matrix"],
                )
            },
        ),
        case(
            "stiffness: an inductance that is no number",
            coils,
            0.0,
            || {
                refused(
                    Drive::new(&[f64::NAN], &[1.0], None),
                    &["inductance matrix"],
                )
            },
        ),
        case(
            "stiffness: one coil sees the other but not back",
            coils,
            0.0,
            || {
                refused(
                    Drive::new(&[1.0, 0.4, 0.0, 1.0], &[1.0, 1.0], None),
                    &["symmetric"],
                )
            },
        ),
        case(
            "stiffness: a coil without resistance",
            "refused: a resistance above 0",
            0.0,
            || {
                refused(
                    Drive::new(&[1.0], &[0.0], None),
                    &["coil 0", "resistance above 0"],
                )
            },
        ),
        case(
            "stiffness: an array without coils",
            "no currents, no time constants",
            0.0,
            || {
                let mut drive = Drive::new(&[], &[], None).map_err(told)?;
                drive.hold(&[], 1.0);
                holds(drive.time_constants_s().is_none(), "nothing to follow")
            },
        ),
    ]
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
    let settling = step.settling().map_err(told)?;
    Ok([settling.current_95_s, settling.force_95_s])
}

fn inverted(index: usize) -> Outcome {
    let table = oracle(include_str!("../../../tests/oracles/transient.json"))?;
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

fn parallel() -> Vec<Case> {
    vec![
        case(
            "stiffness: two limits parallel but for 1e-9, one binds",
            "the projection onto the nearer of the two planes",
            1e-8,
            || {
                let found = nearest(
                    [2.0, 0.0, 0.0],
                    &[([1.0, 0.0, 0.0], 1.0), ([1.0, 1e-9, 0.0], 1.0 + 1e-6)],
                )?;
                measured(apart(&found, &[1.0, 0.0, 0.0]), format!("{found:?}"))
            },
        ),
        case(
            "stiffness: two limits exactly parallel, one a hair tighter",
            "the projection onto the tighter one",
            1e-12,
            || {
                let tight = 1.0 - 1e-10;
                let found = nearest(
                    [2.0, 0.3, 0.0],
                    &[([1.0, 0.0, 0.0], 1.0), ([1.0, 0.0, 0.0], tight)],
                )?;
                measured(apart(&found, &[tight, 0.3, 0.0]), format!("{found:?}"))
            },
        ),
        case(
            "stiffness: the same limit twice",
            "the projection onto it",
            1e-14,
            || {
                let found = nearest(
                    [2.0, 0.3, -0.7],
                    &[([1.0, 0.0, 0.0], 1.0), ([1.0, 0.0, 0.0], 1.0)],
                )?;
                measured(apart(&found, &[1.0, 0.3, -0.7]), format!("{found:?}"))
            },
        ),
        case(
            "stiffness: a wedge of two limits 1e-6 apart",
            "the wedge's edge: x = 1, y = 0, to rounding over the angle",
            1e-9,
            || {
                let found = nearest(
                    [2.0, 1.0, 0.4],
                    // The target lies beyond both, between their normals' cone and the edge.
                    &[
                        ([1.0, 0.0, 0.0], 1.0),
                        ([-1.0 + 1e-6, 1e-6, 0.0], -1.0 + 1e-6),
                    ],
                )?;
                // x <= 1 and (1 - 1e-6) x >= 1 - 1e-6 + 1e-6 y: with x = 1 that is y <= 0.
                measured(apart(&found, &[1.0, 0.0, 0.4]), format!("{found:?}"))
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
                    .map_err(told)?;
                    let found = solution.lambda_linear_n_per_m.ok_or("no limit binds")?;
                    errors.push(off(found, 0.13 * total.min(4.0) / 0.05));
                }
                worst(errors, "lambda_linear against n u G / h")
            },
        ),
    ]
}

/// One point weighs `weight` times the others: its error against that of plain weights.
fn heavy(weight: f64) -> Outcome {
    let mut n = Numbers(17);
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
        .map_err(told)?;
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
