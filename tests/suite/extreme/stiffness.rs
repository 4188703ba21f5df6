//! Circuits whose time constants lie six decades apart, and steps far longer than any.

use nalgebra::DMatrix;

use super::check::{Outcome, SEED, apart, close, holds, measured, off, refused, reported, worst};
use super::{Case, case};
use fluxform::coil::drive::Drive;
use fluxform::coil::inductance::self_inductance_h;
use fluxform::coil::mutual::inductance_matrix_h;

pub fn cases() -> Vec<Case> {
    [circuits(), refusals()].concat()
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
    let mut drive = Drive::new(inductance_h, ohm, None).map_err(reported)?;
    for _ in 0..steps {
        drive.hold(&COMMAND_A[..ohm.len()], step_s);
    }
    let mut currents = vec![0.0; ohm.len()];
    drive.currents(&mut currents);
    Ok(currents)
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
    let mut drive = Drive::new(&[1.0, k, k, 1.0], &[1.0, 1.0], None).map_err(reported)?;
    drive.hold(&[1.0, 0.0], at_s);
    let mut found = [0.0; 2];
    drive.currents(&mut found);
    let (sum, difference) = (-(-at_s / (1.0 + k)).exp_m1(), -(-at_s / (1.0 - k)).exp_m1());
    let expected = [0.5 * (sum + difference), 0.5 * (sum - difference)];
    worst(
        [0, 1].map(|i| bound_of((found[i] - expected[i]).abs())),
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
                let expected = [-1.7 * (-1e-6_f64).exp_m1(), 0.6 * (-1.0_f64).exp_m1()];
                worst(
                    [off(found[0], expected[0]), off(found[1], expected[1])],
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
                let mut drive = Drive::new(&matrix, &[6.0753; 9], Some(36.0)).map_err(reported)?;
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
                let drive = Drive::new(&STIFF_H, &STIFF_OHM, None).map_err(reported)?;
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
                let drive = Drive::new(&STIFF_H, &STIFF_OHM, None).map_err(reported)?;
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
            "stiffness: an inductance that is not a number",
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
                let mut drive = Drive::new(&[], &[], None).map_err(reported)?;
                drive.hold(&[], 1.0);
                holds(drive.time_constants_s().is_none(), "nothing to follow")
            },
        ),
    ]
}
