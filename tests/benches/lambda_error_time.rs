//! Error against run time of the force constant: `cargo bench --locked --bench lambda_error_time`.
//!
//! Six fixed arrays under a surface, among them those on which general solvers fail. For one lambda
//! and for 41 along the curve: how far the currents' error is above the least one, and the seconds.
//! At the one lambda the least mean square error is that of an exhaustive search over all sets of
//! coils at their limits, in double-double, for the problems with few points; elsewhere and along the
//! curve the printed value is the duality gap, a bound. The least worst error is bounded from below by the multipliers' proof.
//! `-- --json` prints the problems with both instead, for `scripts/peers/compare_lambda.py`, which
//! gives them to other solvers. One thread.

// A measurement: it prints.
#![allow(clippy::print_stdout, dead_code)]

use std::error::Error;
use std::path::Path;

use fluxform::commands::bench::clock::{Effort, measure as repeated};
use fluxform::design::{Design, Need};
use fluxform::lambda::worst::worst_point;
use fluxform::lambda::{self, Settings};
use fluxform::numerics::axis::Axis;
use fluxform::progress::Silent;
use fluxform::scene::Scene;
use fluxform::scene::steel;
use fluxform_testing::force_problems::{Case, D, d};
use fluxform_testing::least_error::Search;
use serde_json::{Value, json};

type Failure = Box<dyn Error + Send + Sync>;

/// Force constants along the curve, up to twice lambda_jnd.
const CURVE: usize = 41;
/// Which of them is the one: a little beyond lambda_jnd, where limits bind.
const ONE: usize = 22;
/// After two seconds a run is not repeated.
const EFFORT: Effort = Effort {
    sample_s: 0.0,
    enough_s: 2.0,
    samples: 7,
};
/// Points up to which every set of coils is tried.
const MOST_SEARCHED: usize = 1000;
/// Shifts two coils by these, m.
const FAR: [(&str, f64); 2] = [("coils 0.6 m away", 0.6), ("coils 1.5 m away", 1.5)];

/// Height of a smooth surface without any symmetry, m.
fn dome_m(x: f64, y: f64) -> f64 {
    0.03 + 0.03 * (-((x - 0.007) / 0.04).powi(2) - ((y + 0.003) / 0.05).powi(2)).exp()
}

/// Forces of a design's array over a square of nodes.
fn forces(design: &Design, nodes: usize, height_m: fn(f64, f64) -> f64) -> Result<Case, Failure> {
    let scene = Scene::new(design)?;
    let solved = steel::solve(&scene, scene.tolerances.field, 0.03)?;
    let side_m = Axis {
        from: -0.05,
        to: 0.05,
        samples: nodes,
    }
    .nodes();
    let points: Vec<[f64; 3]> = side_m
        .iter()
        .flat_map(|&y| side_m.iter().map(move |&x| [x, y, height_m(x, y)]))
        .collect();
    Ok(Case {
        forces: scene.forces_n_per_a(&solved, &points, &Silent)?,
        heights: points.iter().map(|p| p[2]).collect(),
        offset: None,
        lower: scene.lower_a.clone(),
        upper: scene.upper_a.clone(),
        total: design.supply.total_current_max_a,
        ohm: scene.resistances_ohm(),
    })
}

/// The fixed problems.
fn cases() -> Result<Vec<(&'static str, Case)>, Failure> {
    let read = |path: &str| Design::read(Path::new(path), Need::CALIBRATE);
    let (air, _) = read("designs/seed_air.toml")?;
    let mut generic = forces(&air, 21, dome_m)?;
    generic.total = Some(7.3);
    let mut all = vec![("generic", generic)];
    for (name, far_m) in FAR {
        let mut design = air.clone();
        design.array.positions_m[0][0] -= far_m;
        design.array.positions_m[7][1] += far_m;
        design.array.grid = None;
        all.push((name, forces(&design, 21, dome_m)?));
    }
    let mut decades = forces(&air, 21, dome_m)?;
    for (i, upper) in decades.upper.iter_mut().enumerate() {
        *upper = 2.0 * 10.0_f64.powf(-0.75 * i as f64);
    }
    decades.total = Some(0.9);
    all.push(("limits over six decades", decades));
    let mut twins = air.clone();
    twins.array.positions_m[5] = twins.array.positions_m[2];
    twins.array.positions_m[8] = twins.array.positions_m[2];
    twins.array.grid = None;
    all.push(("three coincident coils", forces(&twins, 21, dome_m)?));
    let (seed, _) = read("designs/seed.toml")?;
    all.push(("seed, flat", forces(&seed, 61, |_, _| 0.05)?));
    Ok(all)
}

/// The result, and the median of the processor seconds of a few runs.
fn time<T>(work: impl FnMut() -> Result<T, Failure>) -> Result<(T, f64), Failure> {
    let (last, timing) = repeated(&EFFORT, work)?;
    Ok((last, timing.seconds))
}

/// Largest relative excess over `least`, at one place of the curve and along all of it.
fn excess(found: &[f64], least: &[f64]) -> [f64; 2] {
    let part: Vec<f64> = found
        .iter()
        .zip(least)
        .map(|(f, l)| (f - l).abs() / l)
        .collect();
    [part[ONE], part.iter().copied().fold(0.0, f64::max)]
}

fn measure(name: &str, case: &Case) -> Result<Value, Failure> {
    let problem = case.problem();
    let settings = Settings::default();
    let jnd = lambda::solve(&problem, &settings)?
        .constants
        .lambda_jnd_n_per_m
        .ok_or("no lambda_jnd")?;
    let curve: Vec<f64> = (1..=CURVE)
        .map(|k| 2.0 * jnd * k as f64 / CURVE as f64)
        .collect();
    let at_one = Settings {
        at_n_per_m: Some(curve[ONE]),
        ..settings
    };
    let (_, mean_one_s) = time(|| Ok(lambda::solve(&problem, &at_one)?))?;
    let (currents, mean_curve_s) = time(|| {
        let solution = lambda::solve(&problem, &settings)?;
        let currents = curve.iter().map(|&at| solution.path.currents_a(at));
        Ok(currents.collect::<Vec<_>>())
    })?;
    let (_, worst_one_s) = time(|| {
        let worst = worst_point(&problem, &settings)?;
        Ok(worst.path.ok_or("no path")?.currents_a(curve[ONE]))
    })?;
    let (_, worst_curve_s) = time(|| {
        let worst = worst_point(&problem, &settings)?;
        let path = worst.path.ok_or("no path")?;
        let currents = curve.iter().map(|&at| path.currents_a(at));
        Ok(currents.collect::<Vec<_>>())
    })?;
    let mut least = Vec::with_capacity(CURVE);
    let mut gaps = Vec::with_capacity(CURVE);
    for &at in &curve {
        let settings = Settings {
            at_n_per_m: Some(at),
            ..settings
        };
        let solution = lambda::solve(&problem, &settings)?;
        let point = solution.at.ok_or("no point at the requested lambda")?;
        least.push(solution.path.error_n2(at));
        gaps.push(point.duality_gap_n2 / solution.path.error_n2(at));
    }
    let mut mean = [gaps[ONE], gaps.into_iter().fold(0.0, f64::max)];
    if case.heights.len() <= MOST_SEARCHED {
        let currents: Vec<D> = currents[ONE].iter().map(|&i| d(i)).collect();
        let found = case.error(d(curve[ONE]), &currents).nearest();
        least[ONE] = Search::new(case).least_error(curve[ONE], true);
        mean[0] = (found - least[ONE]).abs() / least[ONE];
    }
    let worst = worst_point(&problem, &settings)?;
    let points: Vec<_> = curve.iter().map(|&at| worst.at(&problem, at)).collect();
    let upper: Vec<f64> = points.iter().map(|p| p.worst_error_n).collect();
    let lower: Vec<f64> = points.iter().map(|p| p.worst_error_n - p.gap_n).collect();
    let proved = excess(&upper, &lower);
    let row = |error: [f64; 2], seconds: [f64; 2]| {
        json!({"one_error": error[0], "curve_error": error[1],
               "one_s": seconds[0], "curve_s": seconds[1]})
    };
    Ok(json!({
        "name": name,
        "coils": case.coils(),
        "forces_n_per_a": case.forces,
        "height_m": case.heights,
        "upper_a": case.upper,
        "total_max_a": case.total,
        "lambda_n_per_m": curve,
        "one": ONE,
        "least_mean_square_n2": least,
        "least_worst_n": lower,
        "ours": {"mean": row(mean, [mean_one_s, mean_curve_s]),
                 "worst": row(proved, [worst_one_s, worst_curve_s])},
    }))
}

fn main() -> Result<(), Failure> {
    let as_json = std::env::args().any(|argument| argument == "--json");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        let mut reported = Vec::new();
        if !as_json {
            println!("| problem | points | form | error, one | ms | error, {CURVE} | ms |");
            println!("|---|---|---|---|---|---|---|");
        }
        for (name, case) in cases()? {
            let result = measure(name, &case)?;
            if as_json {
                reported.push(result);
                continue;
            }
            for form in ["mean", "worst"] {
                let ours = &result["ours"][form];
                let of = |key: &str| ours[key].as_f64().unwrap_or(f64::NAN);
                println!(
                    "| {name} | {} | {form} | {:.0e} | {:.3} | {:.0e} | {:.3} |",
                    case.heights.len(),
                    of("one_error"),
                    of("one_s") * 1e3,
                    of("curve_error"),
                    of("curve_s") * 1e3
                );
            }
        }
        if as_json {
            println!("{}", json!({"problems": reported}));
        }
        Ok(())
    })
}
