//! Error against run time of the user's own scene: what each knob buys, and the cheapest settings.
//!
//! Every combination of the settings is a run: its stages (steel, points, force constant, map) are
//! measured once each and shared by the runs that have them in common, so a hundred runs cost a few
//! dozen computations. From the one result, [`crate::bundle::bench::BenchFile`], follow JSON,
//! table, pictures, page and what the screen shows.

pub mod clock;
pub(crate) mod command;
mod ladder;
mod output;
pub mod page;
mod places;
mod reference;
mod stages;

use std::collections::BTreeMap;
use std::path::PathBuf;

use self::clock::Effort;
use self::ladder::Ladders;
use self::reference::{Places, refine};
use self::stages::Bench;
use super::discretize::with_surface;
use super::lambda::LambdaOptions;
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION, UNITS};
use crate::bundle::bench::{BenchFile, Cheapest, ConstantError, LeftOutKnob, Run, ShapeBench};
use crate::bundle::lambda_file::LambdaFile;
use crate::design::{Design, MagnetModel};
use crate::lambda::{Criterion, Solution};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::coupled;
use crate::scene::maps::SceneMap;
use crate::scene::sources::{ShapeSource, check_names};

/// The errors for which the cheapest settings are named.
pub const TARGETS: [f64; 3] = [0.1, 0.01, 0.001];

/// How these errors and those that `calibrate` states differ.
const MEASURED: &str = "measured against the refined run; `calibrate` has none and states bounds, which are larger, most of \
                        all at loose tolerances";

/// Measurement, method and destination.
#[derive(Debug, Clone)]
pub struct BenchRequest<'a> {
    /// The design.
    pub design: &'a Design,
    /// Its entry among the inputs, and its curve's.
    pub inputs: Vec<Input>,
    /// The objects.
    pub shapes: &'a [ShapeSource],
    /// Criterion, and the tolerance that is requested now.
    pub lambda: LambdaOptions,
    /// Sweep a graded deviation from this one, m, instead of the grid of points.
    pub max_deviation_m: Option<f64>,
    /// Shorter ladders, a coarser reference, fewer repeats.
    pub quick: bool,
    /// Folder of the files.
    pub out: PathBuf,
    /// Replace what is there, whatever it is.
    pub force: bool,
}

/// How long it will take, said before it begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Processor time, s.
    pub cpu_s: f64,
    /// Time to which ladders are shortened where possible, s.
    pub bound_s: f64,
    /// Combinations of settings.
    pub runs: usize,
    /// Computations that they share.
    pub computations: usize,
}

/// Measures every object and writes the files.
///
/// # Errors
/// Files that must not be replaced; a scene that cannot be computed, that renders nothing, or whose
/// points lie outside the workspace; interruption.
pub fn run(
    request: &BenchRequest,
    announce: &dyn Fn(Estimate),
    progress: &dyn Progress,
) -> Result<BenchFile, RunError> {
    check_names(request.shapes)?;
    let inputs = inputs(request);
    output::check(&inputs, request)?;
    let mut file = measure(request, inputs, announce, progress)?;
    output::write(&mut file, request)?;
    Ok(file)
}

fn inputs(request: &BenchRequest) -> Vec<Input> {
    let mut all = request.inputs.clone();
    for shape in request.shapes {
        let own: Vec<Input> = shape.input.iter().cloned().collect();
        for input in with_surface(&shape.document, own) {
            if !all.contains(&input) {
                all.push(input);
            }
        }
    }
    all
}

/// Measures every object and writes nothing.
fn measure(
    request: &BenchRequest,
    inputs: Vec<Input>,
    announce: &dyn Fn(Estimate),
    progress: &dyn Progress,
) -> Result<BenchFile, RunError> {
    let scene = Scene::with_tolerance(request.design, request.lambda.tolerance)?;
    let effort = if request.quick {
        Effort::GLANCE
    } else {
        Effort::QUICK
    };
    let bench = Bench::new(&scene, request, effort, progress);
    let mut planned = Vec::new();
    progress.begin("present settings", 4 * request.shapes.len() as u64);
    let points = request
        .shapes
        .iter()
        .map(|shape| bench.present_points(shape));
    let points: Vec<_> = points.collect::<Result<_, _>>()?;
    for (shape, points) in request.shapes.iter().zip(points) {
        let present = bench.present(points)?;
        planned.push(Ladders::new(request, scene.tolerances.map, shape, present));
    }
    progress.end();
    let bound_s = Ladders::bound_s(request.quick);
    let share_s = bound_s / planned.len().max(1) as f64;
    let total = planned.iter_mut().fold(
        Estimate {
            cpu_s: 0.0,
            bound_s,
            runs: 0,
            computations: 0,
        },
        |total, ladders| {
            let one = ladders.shorten(share_s, &effort);
            Estimate {
                cpu_s: total.cpu_s + one.cpu_s,
                runs: total.runs + one.runs,
                computations: total.computations + one.computations,
                ..total
            }
        },
    );
    announce(total);
    progress.begin("bench", total.computations as u64);
    let shapes = request.shapes.iter().zip(&mut planned);
    let shapes: Vec<ShapeBench> = shapes
        .map(|(shape, ladders)| measure_shape(&bench, shape, ladders))
        .collect::<Result<_, _>>()?;
    progress.end();
    Ok(BenchFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: request.design.name.clone(),
        inputs,
        made_with: output::made_with(request),
        units: UNITS.to_owned(),
        criterion: request.lambda.settings.criterion,
        quick: request.quick,
        error_of: format!(
            "lambda: relative to the refined run's. Felt force: what the currents give by the \
                   interpolated map against what they give directly in the refined field, relative \
                   to the force to be felt there, and what that field may be off by; the largest of places of \
                   the surface all over the maps' cells and up to its rim, times 1.25 for what lies between \
                   them; {MEASURED}"
        ),
        timed:
            "processor time of all threads: steel, points, forces with all force constants, and \
                the part of the map that the object needs; the median where short enough to repeat"
                .to_owned(),
        left_out: left_out(&scene, request),
        accuracy: accuracy(&shapes),
        shapes,
        files: Vec::new(),
    })
}

/// Every combination of the settings of one object.
fn measure_shape(
    bench: &Bench,
    shape: &ShapeSource,
    ladders: &mut Ladders,
) -> Result<ShapeBench, RunError> {
    let refined = refine(bench, shape, ladders)?;
    let points = bench.all_points(shape, ladders)?;
    let mut runs = Vec::new();
    let mut present = None;
    for (t, tolerance) in ladders.tolerance.iter().enumerate() {
        let (solved, steel_s) = bench.steel(tolerance.asked)?;
        let lambdas = points
            .iter()
            .map(|(points, _)| bench.lambda(&solved, points));
        let lambdas: Vec<(LambdaFile, f64)> = lambdas.collect::<Result<_, _>>()?;
        for (n, nodes) in ladders.nodes.iter().enumerate() {
            let (map, map_s) = bench.map(&solved, &ladders.points_present, nodes.samples)?;
            for (p, ((points, points_s), (lambda, lambda_s))) in
                points.iter().zip(&lambdas).enumerate()
            {
                let settings = vec![t as u64, p as u64, n as u64];
                let felt_error = felt_error(&refined.places, &map, lambda)?;
                let constant = lambda.lambda_n_per_m.filter(|lambda| *lambda > 0.0);
                runs.push(Run {
                    settings,
                    cpu_s: steel_s + points_s + lambda_s + map_s,
                    steel_s,
                    points_s: *points_s,
                    lambda_s: *lambda_s,
                    map_s,
                    points: points.height_m.len() as u64,
                    lambda_n_per_m: lambda.lambda_n_per_m,
                    lambda_error: constant.map(|c| off(c, refined.lambda_n_per_m)),
                    felt_error,
                });
                if tolerance.present && ladders.points[p].present {
                    present.get_or_insert_with(|| lambda.clone());
                }
            }
        }
    }
    let knobs = ladders.knobs(shape, bench.scene.design);
    let cheapest = TARGETS
        .map(|target| cheapest(target, refined.own_error, &runs, &knobs))
        .to_vec();
    let constants = present.map_or_else(Vec::new, |file| constants(&file, &refined.solution));
    Ok(ShapeBench {
        shape: shape.document.name.clone(),
        reference: refined.summary(),
        knobs,
        runs,
        cheapest,
        constants,
    })
}

/// Relative difference.
fn off(found: f64, reference: f64) -> f64 {
    (found / reference - 1.0).abs()
}

/// The largest error of the force that the run's currents give by its map.
fn felt_error(
    places: &Places,
    map: &SceneMap,
    lambda: &LambdaFile,
) -> Result<Option<f64>, RunError> {
    let Some((constant, currents)) = lambda.lambda_n_per_m.zip(lambda.currents_a.as_deref()) else {
        return Ok(None);
    };
    if constant <= 0.0 {
        return Ok(None);
    }
    places.felt_error(map, constant, currents).map(Some)
}

/// The cheapest of `runs` whose error, with that of the reference, is within `target`.
fn cheapest(
    target: f64,
    own_error: f64,
    runs: &[Run],
    knobs: &[crate::bundle::bench::Knob],
) -> Cheapest {
    let by = |value: fn(&Run) -> f64| {
        move |a: &(usize, &Run), b: &(usize, &Run)| value(a.1).total_cmp(&value(b.1))
    };
    let good = runs
        .iter()
        .enumerate()
        .filter(|(_, run)| run.error() + own_error <= target);
    let found = good.min_by(by(|run| run.cpu_s));
    let met = found.is_some();
    let chosen = found.or_else(|| runs.iter().enumerate().min_by(by(Run::error)));
    let (at, paste) = chosen.map_or((0, Vec::new()), |(at, run)| {
        let settings = knobs.iter().zip(&run.settings);
        let paste = settings.flat_map(|(knob, at)| knob.settings[*at as usize].paste.clone());
        (at, paste.collect())
    });
    Cheapest {
        target,
        met,
        run: at as u64,
        paste,
    }
}

/// Every force constant of one path against the refined one.
fn constants(file: &LambdaFile, refined: &Solution) -> Vec<ConstantError> {
    let row = |criterion: &Criterion| {
        let lambda_n_per_m = file.constants.of(*criterion);
        let reference_n_per_m = refined.constants.of(*criterion);
        let both = lambda_n_per_m.zip(reference_n_per_m);
        ConstantError {
            criterion: *criterion,
            lambda_n_per_m,
            reference_n_per_m,
            error: both.filter(|(_, r)| *r != 0.0).map(|(l, r)| off(l, r)),
        }
    };
    Criterion::ALL.iter().map(row).collect()
}

/// Knobs that change nothing here, and why.
fn left_out(scene: &Scene, request: &BenchRequest) -> Vec<LeftOutKnob> {
    let one = |knob: &str, why: &str| LeftOutKnob {
        knob: knob.to_owned(),
        why: why.to_owned(),
    };
    let mut all = vec![one(
        "criterion",
        "no knob of error against time: all force constants are read off one path and take the same \
         time; their errors at the present settings are listed by force constant",
    )];
    let steel = if !scene.design.has_steel() {
        "the design has no steel: the tolerance is that of the windings' field alone"
    } else if coupled(scene.design) {
        "not a knob of its own: panels and the exchange between the cores follow from --tolerance"
    } else {
        "not a knob of its own: the panels follow from --tolerance"
    };
    all.push(one("steel resolution", steel));
    all.push(match scene.design.magnet.model {
        MagnetModel::Dipole => one("dipoles of the magnet", "the magnet is one dipole"),
        MagnetModel::Cylinder => one(
            "dipoles of the magnet",
            "not a knob of its own: how many stand for the cylinder follows from --tolerance",
        ),
    });
    all.push(if request.max_deviation_m.is_some() {
        one(
            "grid of points",
            "--max-deviation grades the points instead",
        )
    } else {
        one(
            "max-deviation",
            "the points are those of a grid; with --max-deviation points graded to it are swept",
        )
    });
    let is_vector = |shape: &ShapeSource| shape.document.force.direction.is_vector();
    if request.shapes.iter().any(is_vector) {
        all.push(one(
            "sideways force",
            "the upward force of the static currents is compared, and its map timed; of a shape that requests a \
             force vector a bundle maps all three components",
        ));
    }
    all
}

/// The errors at the present settings.
fn accuracy(shapes: &[ShapeBench]) -> BTreeMap<String, StageAccuracy> {
    let largest = |error: fn(&Run) -> Option<f64>| {
        let present = shapes.iter().filter_map(ShapeBench::present);
        present.filter_map(error).fold(0.0, f64::max)
    };
    let stage = |estimate: f64, relative_to: &str| StageAccuracy {
        estimate,
        relative_to: relative_to.to_owned(),
        method: "measured at the present settings against a run refined in every knob".to_owned(),
    };
    BTreeMap::from([
        (
            "lambda".to_owned(),
            stage(largest(|run| run.lambda_error), "lambda"),
        ),
        (
            "felt_force".to_owned(),
            stage(largest(|run| run.felt_error), "the force to be felt"),
        ),
    ])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::reference::refined_tolerance;
    use super::*;
    use crate::design::Need;

    /// A plate without cores was taken for air: its field was refined to 1e-12, which panels do not reach.
    #[test]
    fn a_plate_without_cores_is_steel() {
        let plate = "[plate]\nx_mm = 60.0\ny_mm = 50.0\nthickness_mm = 5.0\ngap_mm = 3.0\n";
        for (steel, said) in [("", "no steel"), (plate, "follow from --tolerance")] {
            let text = format!(
                "name = \"one\"\n[coil]\ninner_diameter_mm = 7.0\nouter_diameter_mm = 13.0\nlength_mm = 17.0\n\
                 [wire]\ndiameter_mm = 0.7\n[supply]\ncurrent_max_a = 2.0\n{steel}"
            );
            let (design, _) =
                Design::from_toml(&text, Path::new("one.toml"), Need::EVALUATE).unwrap();
            let scene = Scene::new(&design).unwrap();
            let request = BenchRequest {
                design: &design,
                inputs: Vec::new(),
                shapes: &[],
                lambda: LambdaOptions::default(),
                max_deviation_m: None,
                quick: true,
                out: PathBuf::new(),
                force: false,
            };
            let left_out = left_out(&scene, &request);
            let of_steel = left_out.iter().find(|knob| knob.knob == "steel resolution");
            let why = &of_steel.unwrap().why;
            assert!(why.contains(said), "{why}");
            let tolerance = refined_tolerance(!design.has_steel(), scene.tolerances.map);
            let reached = if steel.is_empty() { 1e-12 } else { 1e-3 };
            assert!((tolerance / reached - 1.0).abs() < 1e-9, "{tolerance:e}");
        }
    }
}
