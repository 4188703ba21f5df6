//! Force constants from degenerate problems: rank 1, no height, ties everywhere, twin points,
//! condition numbers up to 1e9, numbers at both ends of the doubles.

use serde_json::Value;

use super::check::{
    Outcome, close, holds, measured, number, numbers, off, oracle, reported, worst,
};
use super::{Case, case};
use fluxform::lambda::{ForceProblem, Settings, Solution, Status, solve};
use fluxform::numerics::random::Random;

pub fn cases() -> Vec<Case> {
    [
        against_rationals(),
        closed_forms(),
        ties_and_twins(),
        scales(),
    ]
    .concat()
}

/// A problem that owns its lists.
#[derive(Clone)]
pub struct Problem {
    pub forces: Vec<f64>,
    pub heights: Vec<f64>,
    pub upper: Vec<f64>,
    pub lower: Vec<f64>,
    pub ohm: Vec<f64>,
    pub total: Option<f64>,
}

impl Problem {
    /// Coils of `upper` A at most, currents from 0, 6 ohm each.
    pub fn new(forces: Vec<f64>, heights: Vec<f64>, upper: Vec<f64>) -> Self {
        Self {
            lower: vec![0.0; upper.len()],
            ohm: vec![6.0; upper.len()],
            total: None,
            forces,
            heights,
            upper,
        }
    }

    pub fn problem(&self) -> ForceProblem<'_> {
        ForceProblem {
            forces_n_per_a: &self.forces,
            height_m: &self.heights,
            offset_n: None,
            weights: None,
            lower_a: &self.lower,
            upper_a: &self.upper,
            total_max_a: self.total,
            resistance_ohm: &self.ohm,
        }
    }

    pub fn solve(&self) -> Result<Solution, String> {
        solve(&self.problem(), &Settings::default()).map_err(reported)
    }

    fn mean_square(&self) -> f64 {
        self.heights.iter().map(|h| h * h).sum::<f64>() / self.heights.len() as f64
    }
}

/// A generic problem.
pub fn generic(points: usize, coils: usize, seed: u64) -> Problem {
    let mut n = Random::new(seed);
    Problem::new(
        (0..points * coils).map(|_| n.between(-0.05, 0.3)).collect(),
        (0..points).map(|_| n.between(0.03, 0.08)).collect(),
        (0..coils).map(|_| n.between(0.4, 2.0)).collect(),
    )
}

fn linear_of(solution: &Solution) -> Result<f64, String> {
    solution
        .constants
        .lambda_linear_n_per_m
        .ok_or_else(|| "no limit binds".to_owned())
}

fn jnd_of(solution: &Solution) -> Result<f64, String> {
    solution
        .constants
        .lambda_jnd_n_per_m
        .ok_or_else(|| "no limit binds".to_owned())
}

/// One of the committed exact rational solutions.
fn rational(name: &str) -> Outcome {
    let table = oracle(include_str!("../../oracles/lambda.json"))?;
    let list = table["cases"].as_array().ok_or("no cases")?;
    let exact = list
        .iter()
        .find(|c| c["name"] == name)
        .ok_or("no such case")?;
    let mut problem = Problem::new(
        numbers(&exact["forces_n_per_a"])?,
        numbers(&exact["height_m"])?,
        numbers(&exact["upper_a"])?,
    );
    problem.lower = numbers(&exact["lower_a"])?;
    problem.total = exact["total_max_a"].as_f64();
    let solution = problem.solve()?;
    let mut errors = Vec::new();
    for point in exact["points"].as_array().ok_or("no points")? {
        let lambda = number(&point["lambda_n_per_m"])?;
        let found = solution.path.error_n2(lambda) / (lambda * lambda * problem.mean_square());
        errors.push((found - number(&point["relative_error"])?).abs());
    }
    // Force constants are printed to 1e-11, errors to 1e-13.
    for (found, key) in [
        (
            solution.constants.lambda_linear_n_per_m,
            "lambda_linear_n_per_m",
        ),
        (solution.constants.lambda_jnd_n_per_m, "lambda_jnd_n_per_m"),
    ] {
        if exact[key] != Value::Null {
            errors.push(1e-2 * off(found.ok_or("no limit binds")?, number(&exact[key])?));
        }
    }
    worst(
        errors,
        &format!("lambda_jnd {:?} N/m", solution.constants.lambda_jnd_n_per_m),
    )
}

fn against_rationals() -> Vec<Case> {
    let words = "the exact rational solution: e* to 1e-13 of lambda^2 mean h^2, lambdas to 1e-11";
    // A closure per name: `run` is a plain function.
    macro_rules! named {
        ($($name:literal $of:literal),* $(,)?) => {
            vec![$(case(concat!("lambda: nine coils, ", $name), words, 1e-13, || rational($of))),*]
        };
    }
    named![
        "condition 1" "spread 1e0",
        "condition 1e3" "spread 1e3",
        "condition 1e5" "spread 1e5",
        "condition 1e7" "spread 1e7",
        "condition 1e9" "spread 1e9",
        "twins that differ by 1e-1" "twin 1e1",
        "twins that differ by 1e-3" "twin 1e3",
        "twins that differ by 1e-5" "twin 1e5",
        "twins that differ by 1e-7" "twin 1e7",
        "twins that differ by 1e-9" "twin 1e9",
    ]
}

fn closed_forms() -> Vec<Case> {
    vec![
        case(
            "lambda: one point, one coil",
            "u G / h and the same over 1 - w, N/m",
            1e-14,
            || {
                let s = Problem::new(vec![0.7], vec![0.05], vec![1.3]).solve()?;
                let most = 0.7 * 1.3 / 0.05;
                worst(
                    [off(linear_of(&s)?, most), off(jnd_of(&s)?, most / 0.93)],
                    &format!("{:?} N/m", s.constants.lambda_linear_n_per_m),
                )
            },
        ),
        case(
            "lambda: rank 1, nine coils of one pattern",
            "rank 1; the limit where the currents of least power, all in proportion, reach it",
            1e-12,
            || {
                let mut n = Random::new(3);
                let rows: Vec<f64> = (0..40).map(|_| n.between(0.3, 1.0)).collect();
                let strength: Vec<f64> = (0..9).map(|_| n.between(0.1, 0.4)).collect();
                let forces = rows
                    .iter()
                    .flat_map(|r| strength.iter().map(move |s| r * s))
                    .collect();
                let p = Problem::new(
                    forces,
                    rows.iter().map(|r| 0.05 * r).collect(),
                    vec![1.0; 9],
                );
                let s = p.solve()?;
                if s.rank != 1 {
                    return Err(format!("rank {}", s.rank));
                }
                // Heights in proportion to the pattern: the error is 0 until all coils give their most.
                let most: f64 = strength.iter().sum::<f64>() / 0.05;
                close(linear_of(&s)?, most, "N/m")
            },
        ),
        case(
            "lambda: rank 1, least power at lambda = 1",
            "currents in proportion to force over resistance, A",
            1e-12,
            || {
                let mut p = Problem::new(vec![0.7, 0.4, 0.1], vec![0.05], vec![1.3; 3]);
                p.ohm = vec![6.0, 0.001, 3e6];
                let s = p.solve()?;
                let found = s.path.currents_a(1.0);
                let shares = [0.7 / 6.0, 0.4 / 0.001, 0.1 / 3e6];
                let force: f64 = [0.7, 0.4, 0.1].iter().zip(shares).map(|(g, x)| g * x).sum();
                worst(
                    (0..3).map(|i| off(found[i], shares[i] * 0.05 / force)),
                    &format!("{found:?} A"),
                )
            },
        ),
        case(
            "lambda: h = 0 everywhere",
            "nothing wanted: no force constant, no error",
            0.0,
            || {
                let mut p = generic(17, 4, 5);
                p.heights = vec![0.0; 17];
                let s = p.solve()?;
                let none = s.constants.lambda_jnd_n_per_m.is_none()
                    && s.constants.lambda_linear_n_per_m.is_none();
                holds(
                    s.status == Status::NothingWanted && none && s.path.error_n2(7.0) == 0.0,
                    format!("{:?}", s.status),
                )
            },
        ),
        case(
            "lambda: h = 0 but for one point of 1 nm",
            "u G / h of that point alone where the other rows are 0, N/m",
            1e-13,
            || {
                let mut forces = vec![0.0; 9];
                forces[4] = 0.3;
                let mut heights = vec![0.0; 9];
                heights[4] = 1e-9;
                let s = Problem::new(forces, heights, vec![2.0]).solve()?;
                close(linear_of(&s)?, 0.6 / 1e-9, "N/m")
            },
        ),
        case(
            "lambda: coils that only pull",
            "nothing rendered: no force constant",
            0.0,
            || {
                let mut p = generic(17, 4, 5);
                p.forces.iter_mut().for_each(|f| *f = -f.abs());
                let s = p.solve()?;
                holds(
                    s.status == Status::NothingRendered && s.chosen.is_none(),
                    format!("{:?}", s.status),
                )
            },
        ),
        case(
            "lambda: coils without any force",
            "nothing rendered: no force constant",
            0.0,
            || {
                let mut p = generic(17, 4, 5);
                p.forces = vec![0.0; 17 * 4];
                let s = p.solve()?;
                holds(
                    s.status == Status::NothingRendered && s.rank == 0,
                    format!("{:?}, rank {}", s.status, s.rank),
                )
            },
        ),
        case(
            "lambda: all limits 0",
            "all force constants 0, no currents",
            0.0,
            || {
                let mut p = generic(17, 4, 5);
                p.upper = vec![0.0; 4];
                let s = p.solve()?;
                measured(linear_of(&s)?.max(jnd_of(&s)?), format!("{:?}", s.status))
            },
        ),
        case(
            "lambda: the sum's limit 0",
            "all force constants 0, no currents",
            0.0,
            || {
                let mut p = generic(17, 4, 5);
                p.total = Some(0.0);
                let s = p.solve()?;
                measured(linear_of(&s)?.max(jnd_of(&s)?), format!("{:?}", s.status))
            },
        ),
        case(
            "lambda: limits six decades apart, coils that do not overlap",
            "each coil its own point: the weakest binds at u G / h, N/m",
            1e-13,
            || {
                let upper: Vec<f64> = (0..7).map(|i| 2.0 * 10.0_f64.powi(-i)).collect();
                let mut forces = vec![0.0; 49];
                (0..7).for_each(|i| forces[8 * i] = 0.3);
                let s = Problem::new(forces, vec![0.05; 7], upper).solve()?;
                close(linear_of(&s)?, 2e-6 * 0.3 / 0.05, "N/m")
            },
        ),
        case(
            "lambda: the same, where the last coil saturates",
            "the strongest binds at u G / h, N/m",
            1e-13,
            || {
                let upper: Vec<f64> = (0..7).map(|i| 2.0 * 10.0_f64.powi(-i)).collect();
                let mut forces = vec![0.0; 49];
                (0..7).for_each(|i| forces[8 * i] = 0.3);
                let s = Problem::new(forces, vec![0.05; 7], upper).solve()?;
                let found = s
                    .constants
                    .lambda_saturation_n_per_m
                    .ok_or("nothing saturates")?;
                close(found, 2.0 * 0.3 / 0.05, "N/m")
            },
        ),
    ]
}

/// Four coils on a square, seen from points that turn with it.
pub fn square() -> Problem {
    let base = [0.31, 0.07, 0.02, 0.07];
    let forces = (0..16).map(|k| base[(k / 4 + k % 4) % 4]).collect();
    Problem::new(forces, vec![0.05; 4], vec![1.3; 4])
}

/// Differences of the force constants and of e* at a few of them.
fn same(a: &Problem, b: &Problem) -> Outcome {
    let (s, t) = (a.solve()?, b.solve()?);
    let mut errors = vec![
        off(linear_of(&s)?, linear_of(&t)?),
        off(jnd_of(&s)?, jnd_of(&t)?),
    ];
    for lambda in [0.3, 1.7, 20.0] {
        let scale = lambda * lambda * a.mean_square();
        errors.push((s.path.error_n2(lambda) - t.path.error_n2(lambda)).abs() / scale);
    }
    worst(errors, &format!("lambda_jnd {:.12} N/m", jnd_of(&s)?))
}

fn ties_and_twins() -> Vec<Case> {
    vec![
        case(
            "lambda: ties everywhere, four coils bind at once",
            "u times the sum of a row over h, N/m; nothing follows beyond",
            1e-14,
            || {
                let s = square().solve()?;
                let wanted = 1.3 * (0.31 + 0.07 + 0.02 + 0.07) / 0.05;
                let last = s
                    .constants
                    .lambda_saturation_n_per_m
                    .ok_or("nothing saturates")?;
                worst(
                    [off(linear_of(&s)?, wanted), off(last, wanted)],
                    &format!("{last:.12} N/m"),
                )
            },
        ),
        case(
            "lambda: ties broken by 1e-15 of a limit",
            "as with the tie, N/m",
            1e-13,
            || {
                let mut p = square();
                p.upper = [0.0, 1e-15, -1e-15, 2e-15]
                    .map(|d| 1.3 * (1.0 + d))
                    .to_vec();
                same(&p, &square())
            },
        ),
        case(
            "lambda: ties in 64 coils",
            "u times the sum of a row over h, N/m",
            1e-13,
            || {
                let base: Vec<f64> = (0..64)
                    .map(|k| 0.3 / (1.0 + f64::from(k.min(64 - k))))
                    .collect();
                let forces = (0..64 * 64).map(|k| base[(k / 64 + k % 64) % 64]).collect();
                let s = Problem::new(forces, vec![0.05; 64], vec![1.3; 64]).solve()?;
                close(linear_of(&s)?, 1.3 * base.iter().sum::<f64>() / 0.05, "N/m")
            },
        ),
        case(
            "lambda: every point twice",
            "nothing changes",
            1e-13,
            || {
                let p = generic(23, 4, 9);
                let mut twice = p.clone();
                twice.forces.extend_from_slice(&p.forces);
                twice.heights.extend_from_slice(&p.heights);
                same(&twice, &p)
            },
        ),
        case(
            "lambda: every point a thousand times",
            "nothing changes",
            1e-12,
            || {
                let p = generic(23, 4, 9);
                let mut many = p.clone();
                many.forces = p.forces.repeat(1000);
                many.heights = p.heights.repeat(1000);
                same(&many, &p)
            },
        ),
        case(
            "lambda: points in reverse order",
            "nothing changes",
            1e-13,
            || {
                let p = generic(23, 4, 9);
                let mut back = p.clone();
                back.heights.reverse();
                back.forces = p.forces.chunks(4).rev().flatten().copied().collect();
                same(&back, &p)
            },
        ),
        case(
            "lambda: a coil twice, half the limit each",
            "the same e* and the same force constants as one coil",
            1e-12,
            || {
                let p = generic(23, 3, 9);
                let mut twin = p.clone();
                twin.forces = p
                    .forces
                    .chunks(3)
                    .flat_map(|r| [r[0], r[1], r[2], r[2]])
                    .collect();
                twin.upper = vec![p.upper[0], p.upper[1], 0.5 * p.upper[2], 0.5 * p.upper[2]];
                twin.lower = vec![0.0; 4];
                twin.ohm = vec![6.0; 4];
                same(&twin, &p)
            },
        ),
        case(
            "lambda: a coil that no point feels",
            "nothing changes",
            1e-13,
            || {
                let p = generic(23, 3, 9);
                let mut more = p.clone();
                more.forces = p
                    .forces
                    .chunks(3)
                    .flat_map(|r| [r[0], 0.0, r[1], r[2]])
                    .collect();
                more.upper = vec![p.upper[0], 0.7, p.upper[1], p.upper[2]];
                more.lower = vec![0.0; 4];
                more.ohm = vec![6.0; 4];
                same(&more, &p)
            },
        ),
        case(
            "lambda: 100 coils under 300 points",
            "the duality gap proves the currents, to 1e-12 of lambda^2 mean h^2",
            1e-12,
            || {
                let p = generic(300, 100, 21);
                let s = p.solve()?;
                let chosen = s.chosen.as_ref().ok_or("nothing chosen")?;
                let scale = chosen.lambda_n_per_m.powi(2) * p.mean_square();
                measured(
                    chosen.duality_gap_n2.abs() / scale,
                    format!("lambda {:.9} N/m, rank {}", chosen.lambda_n_per_m, s.rank),
                )
            },
        ),
        case(
            "lambda: 100 coils under 20 points",
            "rank 20; the duality gap proves the currents, to 1e-12 of lambda^2 mean h^2",
            1e-12,
            || {
                let p = generic(20, 100, 22);
                let s = p.solve()?;
                let chosen = s.chosen.as_ref().ok_or("nothing chosen")?;
                let scale = chosen.lambda_n_per_m.powi(2) * p.mean_square();
                if s.rank != 20 {
                    return Err(format!("rank {}", s.rank));
                }
                measured(
                    chosen.duality_gap_n2.abs() / scale,
                    format!("{:?}", s.status),
                )
            },
        ),
    ]
}

/// The same problem in other units: force, height, current.
fn in_units(force: f64, height: f64, current: f64) -> Outcome {
    let p = generic(23, 4, 9);
    let mut q = p.clone();
    q.forces.iter_mut().for_each(|f| *f *= force / current);
    q.heights.iter_mut().for_each(|h| *h *= height);
    q.upper.iter_mut().for_each(|u| *u *= current);
    let (s, t) = (p.solve()?, q.solve()?);
    let back = height / force;
    worst(
        [
            off(linear_of(&t)? * back, linear_of(&s)?),
            off(jnd_of(&t)? * back, jnd_of(&s)?),
        ],
        &format!("lambda_jnd {:.9e} N/m", jnd_of(&t)?),
    )
}

fn scales() -> Vec<Case> {
    let words = "the same force constants in other units";
    vec![
        case("lambda: forces of 1e-12 N/A", words, 1e-12, || {
            in_units(1e-12, 1.0, 1.0)
        }),
        case("lambda: forces of 1e12 N/A", words, 1e-12, || {
            in_units(1e12, 1.0, 1.0)
        }),
        case("lambda: forces of 1e-120 N/A", words, 1e-12, || {
            in_units(1e-120, 1.0, 1.0)
        }),
        case("lambda: heights of 1 nm", words, 1e-12, || {
            in_units(1.0, 2e-8, 1.0)
        }),
        case("lambda: heights of 1e6 km", words, 1e-12, || {
            in_units(1.0, 2e10, 1.0)
        }),
        case("lambda: limits of 1 nA", words, 1e-12, || {
            in_units(1.0, 1.0, 1e-9)
        }),
        case("lambda: limits of 1 GA", words, 1e-12, || {
            in_units(1.0, 1.0, 1e9)
        }),
        case("lambda: all three at once", words, 1e-12, || {
            in_units(3e-17, 2e11, 7e13)
        }),
    ]
}
