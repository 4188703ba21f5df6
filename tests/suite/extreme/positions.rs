//! The worst-point form, currents at one position, and problems that are none.

use super::check::{close, holds, measured, off, refused, reported, worst};
use super::lambda::{Problem, generic, square};
use super::{Case, case};
use fluxform::lambda::worst::{maxmin, worst_point};
use fluxform::lambda::{Allocator, Reach, Settings};

pub fn cases() -> Vec<Case> {
    [worst_points(), one_position(), malformed()].concat()
}

fn worst_points() -> Vec<Case> {
    vec![
        case(
            "lambda: worst point, one coil over two points",
            "t* / lambda = |h0 G1 - h1 G0| / (G0 + G1) until the coil gives its most",
            1e-13,
            || {
                let p = Problem::new(vec![0.7, 0.3], vec![0.05, 0.08], vec![1.3]);
                let w = worst_point(&p.problem(), &Settings::default()).map_err(reported)?;
                let wanted = (0.05_f64 * 0.3 - 0.08 * 0.7).abs() / (0.7 + 0.3);
                let path = w.path.ok_or("the path was left out")?;
                let found = path.worst_error_n(0.1) / 0.1;
                close(found, wanted, "m")
            },
        ),
        case(
            "lambda: worst point with ties everywhere",
            "no error until all coils give their most, N/m",
            1e-13,
            || {
                let p = square();
                let w = worst_point(&p.problem(), &Settings::default()).map_err(reported)?;
                let wanted = 1.3 * 0.47 / 0.05;
                close(w.lambda_linear_n_per_m.ok_or("no limit")?, wanted, "N/m")
            },
        ),
        case(
            "lambda: worst point, every point twice",
            "nothing changes",
            1e-12,
            || {
                let p = generic(23, 4, 9);
                let mut twice = p.clone();
                twice.forces.extend_from_slice(&p.forces);
                twice.heights.extend_from_slice(&p.heights);
                let of =
                    |p: &Problem| worst_point(&p.problem(), &Settings::default()).map_err(reported);
                let path = |p: &Problem| {
                    of(p)?
                        .path
                        .ok_or_else(|| "the path was left out".to_owned())
                };
                let (a, b) = (path(&p)?, path(&twice)?);
                worst(
                    [0.3, 1.7, 20.0].map(|l| off(b.worst_error_n(l), a.worst_error_n(l))),
                    "t* at three force constants",
                )
            },
        ),
        case(
            "lambda: worst point, h = 0 everywhere",
            "no error at any force constant, N",
            0.0,
            || {
                let mut p = generic(17, 4, 5);
                p.heights = vec![0.0; 17];
                let w = worst_point(&p.problem(), &Settings::default()).map_err(reported)?;
                let path = w.path.ok_or("the path was left out")?;
                measured(path.worst_error_n(7.0), "N at 7 N/m")
            },
        ),
        case(
            "lambda: no point too weak, one strong and one weak point",
            "the smaller of u G / h over the points, N/m",
            1e-13,
            || {
                let p = Problem::new(vec![0.7, 3e-7], vec![0.05, 0.08], vec![1.3]);
                let found = maxmin(&p.problem()).map_err(reported)?.ok_or("none")?;
                close(found.lambda_n_per_m, 1.3 * 3e-7 / 0.08, "N/m")
            },
        ),
        case(
            "lambda: no point too weak where one point feels nothing",
            "0 N/m, or none",
            0.0,
            || {
                let p = Problem::new(vec![0.7, 0.0], vec![0.05, 0.08], vec![1.3]);
                let found = maxmin(&p.problem()).map_err(reported)?;
                measured(
                    found.map_or(0.0, |m| m.lambda_n_per_m),
                    "at the point without force",
                )
            },
        ),
    ]
}

fn one_position() -> Vec<Case> {
    vec![
        case(
            "lambda: one position, resistances six decades apart",
            "currents in proportion to force over resistance, A",
            1e-13,
            || {
                let ohm = [1e-3, 1.0, 1e3];
                let forces = [0.3, 0.2, 0.7];
                let mut a = Allocator::new(&ohm, &[-1e9; 3], &[1e9; 3], None).map_err(reported)?;
                let mut found = [0.0; 3];
                let reported = a.allocate(&forces, 0.4, &mut found);
                let scale: f64 = (0..3).map(|i| forces[i] * forces[i] / ohm[i]).sum();
                let wanted = |i: usize| 0.4 * forces[i] / ohm[i] / scale;
                if reported.reach != Reach::Reached {
                    return Err("not reached".to_owned());
                }
                worst(
                    (0..3).map(|i| off(found[i], wanted(i))),
                    &format!("{found:?} A"),
                )
            },
        ),
        case(
            "lambda: one position, a force beyond reach",
            "all coils give their most in the right direction, N",
            1e-14,
            || {
                let mut a = Allocator::new(&[6.0; 3], &[-0.5; 3], &[2.0, 1.0, 0.3], None)
                    .map_err(reported)?;
                let mut found = [0.0; 3];
                let reported = a.allocate(&[0.3, -0.2, 0.7], 1e9, &mut found);
                close(reported.force_n, 0.3 * 2.0 + 0.2 * 0.5 + 0.7 * 0.3, "N")
            },
        ),
        case(
            "lambda: one position without any force",
            "no current, saturated",
            0.0,
            || {
                let mut a =
                    Allocator::new(&[6.0; 3], &[0.0; 3], &[2.0; 3], None).map_err(reported)?;
                let mut found = [9.0; 3];
                let reported = a.allocate(&[0.0; 3], 0.1, &mut found);
                holds(
                    found == [0.0; 3] && reported.reach == Reach::Saturated,
                    format!("{found:?} A, {:?}", reported.reach),
                )
            },
        ),
        case(
            "lambda: one position, a requested force that is not a number",
            "no current, saturated",
            0.0,
            || {
                let mut a =
                    Allocator::new(&[6.0; 3], &[0.0; 3], &[2.0; 3], None).map_err(reported)?;
                let mut found = [9.0; 3];
                let reported = a.allocate(&[0.3, 0.2, 0.7], f64::NAN, &mut found);
                holds(
                    found == [0.0; 3] && reported.reach == Reach::Saturated,
                    format!("{found:?} A, {:?}", reported.reach),
                )
            },
        ),
        case(
            "lambda: one position, 100 coils of equal force under a binding sum",
            "equal currents of force / (n G), A",
            1e-13,
            || {
                let mut a = Allocator::new(&[6.0; 100], &[0.0; 100], &[2.0; 100], Some(7.0))
                    .map_err(reported)?;
                let mut found = [0.0; 100];
                a.allocate(&[0.3; 100], 0.3 * 7.0 * (1.0 - 1e-12), &mut found);
                worst(
                    found.iter().map(|x| off(*x, 0.07)),
                    "currents against 0.07 A, up to 1e-12",
                )
                .map(|got| super::Got {
                    error: (got.error - 1.1e-12).max(0.0),
                    ..got
                })
            },
        ),
    ]
}

fn malformed() -> Vec<Case> {
    let of = "refused with the entry at fault";
    vec![
        case("lambda: no points", of, 0.0, || {
            refused(
                Problem::new(vec![], vec![], vec![1.0]).solve(),
                &["no constraint points"],
            )
        }),
        case("lambda: a force that is not a number", of, 0.0, || {
            let p = Problem::new(vec![0.3, f64::NAN], vec![0.05; 2], vec![1.0]);
            refused(p.solve(), &["forces_n_per_a[1]", "NaN"])
        }),
        case("lambda: an infinite height", of, 0.0, || {
            let p = Problem::new(vec![0.3, 0.2], vec![0.05, f64::INFINITY], vec![1.0]);
            refused(p.solve(), &["height_m[1]", "inf"])
        }),
        case("lambda: a negative upper limit", of, 0.0, || {
            let p = Problem::new(vec![0.3, 0.2], vec![0.05; 2], vec![-1e-300]);
            refused(p.solve(), &["upper_a[0]", "zero or above"])
        }),
    ]
}
