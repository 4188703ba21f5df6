//! What gradients of an array that is searched cost, how exact they are, and what a search would save by them.
//!
//! ```text
//! cargo bench --locked --bench array_gradients
//! ```
//!
//! Of designs/seed_search.toml, under the plate and the half-sphere. First the envelope theorem's derivative of lambda
//! along the pitch against differences of lambda. Then the processor time of an array's evaluation as the search
//! computes it, and of its parts. Last a prototype: a descent by trust region whose surrogate knows the gradient of
//! every array it computed (one neighbour per variable, which count for nothing), beside the search without: arrays
//! until a gain was met. A gradient may cost so many arrays that both are equal.

// A measurement: it reads the clock and prints.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use std::error::Error;
use std::path::Path;

use cpu_time::ProcessTime;
use fluxform::coil::array_search::problem::{ArrayProblem, Level, Objective, Room};
use fluxform::coil::array_search::search::{Request, problems};
use fluxform::commands::optimize::array::physics::{Aim, ArrayPhysics};
use fluxform::design::{Design, Need};
use fluxform::lambda::ForceProblem;
use fluxform::lambda::enclosure::jnd_currents;
use fluxform::numerics::mixed_search::descent::Judged;
use fluxform::numerics::mixed_search::{MET, Problem, Search, Settings, Values, Variable};
use fluxform::progress::Silent;
use fluxform::scene::sources::ShapeSource;
use fluxform::scene::{Scene, steel};
use fluxform::shape::document::ShapeDocument;
use fluxform::units::FORCE_JND;

type Failure = Box<dyn Error + Send + Sync>;

const SHAPES: [&str; 2] = ["shapes/flat.toml", "shapes/half_sphere.toml"];
/// Arrays that either search may compute.
const ARRAYS: usize = 160;
const SEEDS: u64 = 5;
/// Gains whose first arrays are compared.
const GAINS: [f64; 4] = [0.9, 0.95, 0.97, 1.0];
/// Distance of the neighbours that stand for a gradient, as a share of the ranges.
const NEIGHBOUR: f64 = 1e-2;
/// Width of the prototype's trust region: first, last, and its factors.
const WIDTHS: [f64; 2] = [0.3, 2e-3];
const FACTORS: [f64; 2] = [0.5, 1.6];

/// The same array with another pitch.
fn at_pitch(design: &Design, pitch_m: f64) -> Design {
    let mut moved = design.clone();
    let given_m = 0.05;
    for place in &mut moved.array.positions_m {
        *place = place.map(|x| x * pitch_m / given_m);
    }
    moved
}

/// lambda_jnd along the pitch: its derivative from the forces' against differences of it.
fn taylor(design: &Design, physics: &ArrayPhysics<'_>) -> Result<(), Failure> {
    let tolerance = Some(1e-5);
    let positions_m = physics.positions_m(0.0, Level::Search);
    let height_m: Vec<f64> = positions_m.iter().map(|p| p[2]).collect();
    let lowest_m = height_m.iter().copied().fold(f64::INFINITY, f64::min);
    let forces = |pitch_m: f64| -> Result<Vec<f64>, Failure> {
        let moved = at_pitch(design, pitch_m);
        let scene = Scene::with_tolerance(&moved, tolerance)?;
        let solved = steel::solve(&scene, scene.tolerances.forces, lowest_m)?;
        Ok(scene.forces_n_per_a(&solved, &positions_m, &Silent)?)
    };
    let scene = Scene::with_tolerance(design, tolerance)?;
    let resistance_ohm = scene.resistances_ohm();
    let (pitch_m, step_m) = (0.0537, 1e-4);
    let (below, above) = (forces(pitch_m - step_m)?, forces(pitch_m + step_m)?);
    let differences = above.iter().zip(&below);
    let change: Vec<f64> = differences.map(|(a, b)| (a - b) / (2.0 * step_m)).collect();
    let at = forces(pitch_m)?;
    let of = |forces: &[f64]| -> Result<_, Failure> {
        let all = ForceProblem {
            forces_n_per_a: forces,
            height_m: &height_m,
            offset_n: None,
            weights: None,
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: design.supply.total_current_max_a,
            resistance_ohm: &resistance_ohm,
        };
        let mut slopes = Vec::new();
        let coils = all.coils();
        let mut first = 0;
        for shape in physics.of_shapes(all, Level::Search) {
            let own = &change[first..first + shape.points() * coils];
            first += shape.points() * coils;
            let currents = jnd_currents(&shape, FORCE_JND)?.ok_or("no lambda_jnd")?;
            let slope = currents.slope_n_per_m(&shape, FORCE_JND, own);
            slopes.push((currents.lambda_n_per_m, slope));
        }
        Ok(slopes)
    };
    let here = of(&at)?;
    println!(
        "shape, lambda in N/m, slope along the pitch in N/m per mm, remainder over steps of 4, 2, 1 mm:"
    );
    let steps_m = [4e-3, 2e-3, 1e-3];
    let mut moved = Vec::new();
    for step_m in steps_m {
        moved.push(of(&forces(pitch_m + step_m)?)?);
    }
    for (shape, (lambda, slope)) in here.iter().enumerate() {
        let left = |k: usize| moved[k][shape].0 - lambda - slope * steps_m[k];
        let lefts = [0, 1, 2].map(left);
        println!(
            "  {}: {lambda:.6}, {:.3e}, {:.2e} {:.2e} {:.2e}, orders {:.2} {:.2}",
            SHAPES[shape],
            slope * 1e-3,
            lefts[0],
            lefts[1],
            lefts[2],
            (lefts[0] / lefts[1]).log2(),
            (lefts[1] / lefts[2]).log2()
        );
    }
    let started = ProcessTime::now();
    of(&at)?;
    let seconds = started.elapsed().as_secs_f64();
    println!(
        "  {:.1} ms for lambda and its slope of both shapes from forces that are known",
        1e3 * seconds
    );
    Ok(())
}

/// Neighbours by which a gradient is known: one along every variable, inwards.
fn neighbours(variables: &[Variable], x: &[f64]) -> Vec<Vec<f64>> {
    let beside = |(index, variable): (usize, &Variable)| {
        let at = x[index];
        let inwards = if 2.0 * at < variable.low + variable.high {
            1.0
        } else {
            -1.0
        };
        let moved = match &variable.values {
            Values::Continuous => at + inwards * NEIGHBOUR * (variable.high - variable.low),
            Values::Whole => at + inwards,
            Values::Listed(list) => {
                let here = list.iter().position(|value| *value >= at).unwrap_or(0);
                list[if inwards > 0.0 { here + 1 } else { here - 1 }]
            }
        };
        let mut neighbour = x.to_vec();
        neighbour[index] = moved;
        neighbour
    };
    variables.iter().enumerate().map(beside).collect()
}

/// The best gain after every array that counts, of a descent that is given every gradient.
fn with_gradients(problem: &ArrayProblem<'_>, given: &[f64]) -> Result<Vec<f64>, Failure> {
    let variables = problem.variables();
    let settings = Settings {
        evaluations: usize::MAX,
        ..Settings::default()
    };
    let mut search = Search::new(problem, settings);
    let mut gains = Vec::new();
    let mut best = 0.0_f64;
    let mut evaluated = |search: &mut Search<'_>, x: Vec<f64>| -> Result<Judged, Failure> {
        search
            .evaluate(vec![x.clone()])
            .map_err(|_| "interrupted")?;
        search
            .evaluate(neighbours(variables, &x))
            .map_err(|_| "interrupted")?;
        let sample = search.samples().iter().find(|sample| sample.x == x);
        let judged = sample
            .and_then(|sample| search.judged(sample))
            .ok_or("no such array")?;
        if judged.excess() <= MET {
            best = best.max(judged.objective().exp());
        }
        gains.push(best);
        Ok(judged)
    };
    let (mut center, _) = search.least_broken(given);
    let mut now = evaluated(&mut search, center.clone())?.merit();
    let mut width = WIDTHS[0];
    for _ in 1..ARRAYS {
        if width < WIDTHS[1] {
            break;
        }
        let surrogate = search.surrogate().ok_or("too few arrays")?;
        let at = search.units(&center);
        let judge = |x: &[f64], outputs: &[f64]| {
            let mut judged = problem.judge(x, outputs);
            let u = search.units(x);
            let far = u.iter().zip(&at).zip(variables).map(|((u, at), variable)| {
                let least = match variable.values {
                    Values::Continuous => width,
                    Values::Whole | Values::Listed(_) => {
                        width.max(1.0 / (variable.high - variable.low))
                    }
                };
                (u - at).abs() / least - 1.0
            });
            judged.limits.extend(far.map(|far| 0.1 * far));
            judged
        };
        let Some((next, ended)) = search.climb_otherwise(&surrogate, &judge, &center, &[]) else {
            width *= FACTORS[0];
            continue;
        };
        let expected = ended.judged.merit() - now;
        if expected <= 1e-6 || next == center {
            width *= FACTORS[0];
            continue;
        }
        let met = evaluated(&mut search, next.clone())?.merit();
        let share = (met - now) / expected;
        if share > 0.0 {
            (center, now) = (next, met);
        }
        if share < 0.25 {
            width *= FACTORS[0];
        } else if share > 0.7 {
            width = (width * FACTORS[1]).min(0.6);
        }
    }
    Ok(gains)
}

/// The same of the search without gradients.
fn without(problem: &ArrayProblem<'_>, given: &[f64], seed: u64) -> Result<Vec<f64>, Failure> {
    let settings = Settings {
        evaluations: ARRAYS,
        seed,
        ..Settings::default()
    };
    let mut search = Search::new(problem, settings);
    search.run(&[given.to_vec()]).map_err(|_| "interrupted")?;
    let mut best = 0.0_f64;
    let gain = |sample| {
        let judged: Option<Judged> = search.judged(sample);
        if let Some(judged) = judged.filter(|judged| judged.excess() <= MET) {
            best = best.max(judged.objective().exp());
        }
        best
    };
    Ok(search.samples().iter().map(gain).collect())
}

fn first(gains: &[f64], gain: f64) -> Option<usize> {
    Some(gains.iter().position(|one| *one >= gain)? + 1)
}

fn main() -> Result<(), Failure> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = root.join("designs/seed_search.toml");
    let text = std::fs::read_to_string(&path)?;
    let text = text.replace(
        "settling_max_ms",
        "array_settling_max_ms = 100.0\nsettling_max_ms",
    );
    let (design, _) =
        Design::from_toml(&text, &path, Need::CALIBRATE).map_err(|e| e.to_string())?;
    let mut shapes = Vec::new();
    for shape in SHAPES {
        let path = root.join(shape);
        let (document, _) = ShapeDocument::read(&path).map_err(|e| e.to_string())?;
        shapes.push(ShapeSource {
            document,
            input: None,
        });
    }
    let physics = ArrayPhysics::new(&shapes, Aim::default(), None, &Silent)?;
    taylor(&design, &physics)?;

    let started = ProcessTime::now();
    let reference = physics
        .rendered(&design, 0.0, Level::Search)?
        .ok_or("nothing is rendered")?;
    let evaluation_s = started.elapsed().as_secs_f64();
    let started = ProcessTime::now();
    let scene = Scene::with_tolerance(&design, physics.tolerance(Level::Search, &design))?;
    steel::solve(&scene, scene.tolerances.forces, 0.03)?;
    let steel_s = started.elapsed().as_secs_f64();
    println!("an array takes {evaluation_s:.3} CPU s, of which its steel {steel_s:.3}");

    let request = Request {
        objective: Objective::Mean(vec![1.0; SHAPES.len()]),
        settings: Settings::default(),
        room: Room {
            ceiling_m: 5e-3,
            height_m: [0.0, 0.0],
        },
        every_count: false,
    };
    let all = problems(&design, &request, &reference.merits, &physics)?.all;
    let given = all[0].space.given(&design);
    let variables = given.len();
    let started = ProcessTime::now();
    let free = with_gradients(&all[0], &given)?;
    println!(
        "prototype: {} arrays that count, {:.0} CPU s with the {variables} neighbours of each; gain {:.4}",
        free.len(),
        started.elapsed().as_secs_f64(),
        free.last().copied().unwrap_or(0.0)
    );
    let mut searches = Vec::new();
    for seed in 1..=SEEDS {
        searches.push(without(&all[0], &given, seed)?);
    }
    println!(
        "| gain | arrays with gradients for nothing | arrays without, median of {SEEDS} seeds | a gradient may cost |\n|---|---|---|---|"
    );
    for gain in GAINS {
        let mut arrays: Vec<usize> = searches
            .iter()
            .map(|gains| first(gains, gain).unwrap_or(usize::MAX))
            .collect();
        arrays.sort_unstable();
        let median = arrays[arrays.len() / 2];
        let shown = |count: Option<usize>| {
            count.map_or_else(|| "not met".to_owned(), |count| count.to_string())
        };
        let with = first(&free, gain);
        let without = Some(median).filter(|count| *count < usize::MAX);
        let price = with
            .zip(without)
            .map(|(with, without)| without as f64 / with as f64 - 1.0);
        let price = price.map_or_else(String::new, |price| format!("{price:.1} arrays"));
        println!(
            "| {gain} | {} | {} | {price} |",
            shown(with),
            shown(without)
        );
    }
    Ok(())
}
