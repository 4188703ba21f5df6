//! `lambda`: the force constant of one object, from forces computed at its points.

pub(crate) mod command;
pub mod feedback;
mod variants;

use std::collections::BTreeMap;

use self::feedback::{FeedbackOptions, Rendering};
use self::picture::Seen;
pub(crate) use self::points::WantedPoints;
use self::points_effect::Moved;
use super::discretize::scattered;
use super::discretize::scattered::ScatteredSummary;
use super::discretize::{self, PointsReport};
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed};
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::bundle::lambda_file::{
    ActivePointShare, AtLambda, LambdaFile, PathStep, SampledPoints, WorkingPointForces,
    WorstPointAt, WorstPointFile, WorstPointStep,
};
use crate::design::{Design, MagnetModel};
use crate::field::winding::KERNEL_ERROR;
use crate::lambda::worst::{WorstSolution, worst_point};
use crate::lambda::{self, ForceProblem, Precision, Settings, Solution, Status, Wiring};
use crate::plot::lambda::LambdaPlot;
use crate::progress::Progress;
use crate::scene::cached_field::ShapeField;
use crate::scene::evaluation_sample::{Evaluation, PLACES, Sample, sharper, spread};
use crate::scene::passive;
use crate::scene::single::above_knee;
use crate::scene::sources::Sampling;
use crate::scene::steel;
use crate::scene::steel::{EVALUATION_SHARE, Material, Solved, Steel};
use crate::scene::working_point::{WorkingPoint, relative_difference, superposition_ends};
use crate::scene::{AIR_SHARE, MAGNET_FINEST, MAGNET_SHARE, Scene};
use crate::shape::document::ShapeDocument;

mod picture;
mod points;
mod points_effect;
mod sideways;
mod warnings;

/// Forces change over about the height above the coils: so many patches resolve them.
const PATCHES_A_HEIGHT: f64 = 16.0;

/// What is asked.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LambdaOptions {
    /// Criterion, its weight, and a force constant of interest.
    pub settings: Settings,
    /// Tolerance of the forces; `None` for the default.
    pub tolerance: Option<f64>,
    /// Points on no grid, weighted by area, instead of the grid's; of [`run`] alone.
    pub sampling: Option<Sampling>,
    /// Coils broken or in series.
    pub wiring: Wiring,
    /// Whether single changes are tried besides.
    pub variants: bool,
    /// Whether every point is given currents of its own besides, and what of that.
    pub feedback: Option<FeedbackOptions>,
    /// Whether a picture is wanted.
    pub picture: bool,
}

impl LambdaReport {
    /// Whether a force can be rendered: a force constant above zero, to the tolerance asked for.
    #[must_use]
    pub fn meets_request(&self) -> bool {
        self.file.lambda_n_per_m.is_some_and(|lambda| lambda > 0.0) && self.accuracy_reached
    }
}

/// The force constant and everything told with it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct LambdaReport {
    /// The points of the grid, whether they were used or others.
    pub points: PointsReport,
    /// The JSON result.
    pub file: LambdaFile,
    /// The drawing, if one was asked for.
    pub picture: Option<LambdaPlot>,
    /// How far the solution goes.
    pub status: Status,
    /// The arithmetic that was needed.
    pub precision: Precision,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
    /// What misses it.
    pub accuracy_missed: Vec<String>,
}

/// Solves eq. 9 and 10 for `document` on `design`.
///
/// # Errors
/// A design or shape that cannot be computed; interruption.
pub fn run(
    design: &Design,
    document: &ShapeDocument,
    inputs: Vec<Input>,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<LambdaReport, RunError> {
    let scene = Scene::new(design)?;
    let points = discretize::run(document, inputs.clone(), progress)?;
    let of_grid = WantedPoints::of_grid(&points);
    let sampling = options
        .sampling
        .map(|how| resolving(how, of_grid.lowest_m()));
    let sample = |how| scattered::run(document, inputs.clone(), how, progress);
    let sampled = sampling.map(sample).transpose()?;
    let chosen = sampled.as_ref().map(WantedPoints::of_scattered);
    let coarser = sampling.and_then(coarser).map(sample).transpose()?;
    let coarser = coarser.as_ref().map(WantedPoints::of_scattered);
    let of_all = [Some(&of_grid), chosen.as_ref(), coarser.as_ref()];
    let lowest = of_all.into_iter().flatten().map(WantedPoints::lowest_m);
    let lowest_m = lowest.fold(f64::INFINITY, f64::min);
    let lowest_m = options
        .feedback
        .map_or(lowest_m, |asked| asked.lowest_m(&scene, lowest_m));
    progress.begin("steel", 1);
    let solved = steel::solve(&scene, options.tolerance, scene.force_tolerance(), lowest_m)?;
    progress.end();
    let Some(chosen) = chosen else {
        let field = ShapeField::default();
        return solve(&scene, &solved, field, points, options, progress);
    };
    // What is asked besides is asked of the chosen points alone.
    let plain = LambdaOptions {
        feedback: None,
        picture: false,
        ..options.clone()
    };
    let none = ShapeField::default();
    let grid = solve_at(&scene, &solved, none, &of_grid, &plain, progress)?.file;
    let mut found = solve_at(&scene, &solved, none, &chosen, options, progress)?;
    sideways::add(
        &mut found.file,
        &scene,
        &solved,
        &chosen,
        &options.wiring,
        progress,
    )?;
    let mut report = found.with(points);
    if let Some(coarser) = coarser {
        let other = solve_at(&scene, &solved, none, &coarser, &plain, progress)?.file;
        let stage = quadrature(&report.file, &other);
        let stage = stage.map(|stage| ("quadrature".to_owned(), stage));
        report.file.accuracy.extend(stage);
    }
    report.file.sampling =
        sampled.map(|sampled| against_grid(&sampled.summary, &report.file, &grid));
    Ok(report)
}

/// Patches of the points over which forces change little, where no width is asked for.
pub(crate) fn resolving(how: Sampling, lowest_m: f64) -> Sampling {
    match how {
        Sampling::Adaptive {
            max_deviation_m,
            widest_m: None,
        } if lowest_m > 0.0 => Sampling::Adaptive {
            max_deviation_m,
            widest_m: Some(lowest_m / PATCHES_A_HEIGHT),
        },
        asked => asked,
    }
}

/// Patches twice as wide, on curved surfaces too; `None` for random points.
fn coarser(how: Sampling) -> Option<Sampling> {
    match how {
        Sampling::Adaptive {
            max_deviation_m,
            widest_m: Some(widest_m),
        } => Some(Sampling::Adaptive {
            max_deviation_m: 4.0 * max_deviation_m,
            widest_m: Some(2.0 * widest_m),
        }),
        _ => None,
    }
}

/// How far lambda is off because forces between the points are not looked at.
fn quadrature(file: &LambdaFile, coarser: &LambdaFile) -> Option<StageAccuracy> {
    let (fine, coarse) = file.lambda_n_per_m.zip(coarser.lambda_n_per_m)?;
    (fine > 0.0).then(|| StageAccuracy {
        estimate: 1.5 * (coarse / fine - 1.0).abs(),
        relative_to: "lambda".to_owned(),
        method: "an estimate: one and a half times the change from patches twice as wide"
            .to_owned(),
    })
}

/// What other points than the grid's change.
fn against_grid(sampled: &ScatteredSummary, file: &LambdaFile, grid: &LambdaFile) -> SampledPoints {
    let change = file
        .lambda_n_per_m
        .zip(grid.lambda_n_per_m.filter(|lambda| *lambda != 0.0))
        .map(|(here, there)| here / there - 1.0);
    SampledPoints {
        sampling: sampled.sampling.to_owned(),
        area_m2: sampled.area_m2,
        grid_points: grid.points,
        grid_lambda_linear_n_per_m: grid.constants.lambda_linear_n_per_m,
        grid_lambda_jnd_n_per_m: grid.constants.lambda_jnd_n_per_m,
        grid_lambda_saturation_n_per_m: grid.constants.lambda_saturation_n_per_m,
        grid_lambda_n_per_m: grid.lambda_n_per_m,
        relative_change: change,
    }
}

/// The force constant for the points of a grid.
pub(crate) fn solve(
    scene: &Scene,
    solved: &Solved,
    field: ShapeField,
    points: PointsReport,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<LambdaReport, RunError> {
    let of_grid = WantedPoints::of_grid(&points);
    let mut found = solve_at(scene, solved, field, &of_grid, options, progress)?;
    sideways::add(
        &mut found.file,
        scene,
        solved,
        &of_grid,
        &options.wiring,
        progress,
    )?;
    Ok(found.with(points))
}

/// The result for points of any kind, as `lambda` computes it.
pub(crate) fn solve_points(
    scene: &Scene,
    solved: &Solved,
    points: &WantedPoints,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<LambdaFile, RunError> {
    let found = solve_at(
        scene,
        solved,
        ShapeField::default(),
        points,
        options,
        progress,
    )?;
    Ok(found.file)
}

/// A report, but for the grid.
struct Found {
    file: LambdaFile,
    picture: Option<LambdaPlot>,
    status: Status,
    precision: Precision,
    warnings: Vec<String>,
    accuracy_reached: bool,
    accuracy_missed: Vec<String>,
}

impl Found {
    fn with(self, points: PointsReport) -> LambdaReport {
        LambdaReport {
            points,
            file: self.file,
            picture: self.picture,
            status: self.status,
            precision: self.precision,
            warnings: self.warnings,
            accuracy_reached: self.accuracy_reached,
            accuracy_missed: self.accuracy_missed,
        }
    }
}

/// The force constant for points that are known.
fn solve_at(
    scene: &Scene,
    solved: &Solved,
    field: ShapeField,
    points: &WantedPoints,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<Found, RunError> {
    let positions = &points.positions_m;
    let forces = field.forces_n_per_a("forces", scene, solved, positions, progress)?;
    let counts = scene.design.magnet.passive_force;
    let pull = if counts || options.variants {
        passive::pull(scene, positions, false)?
    } else {
        None
    };
    let passive_n = pull.as_ref().map(|pull| pull.forces_z_n(positions));
    let (pull, offset_n) = (
        pull.filter(|_| counts),
        passive_n.clone().filter(|_| counts),
    );
    progress.begin("lambda", 1);
    let resistance_ohm = scene.resistances_ohm();
    options
        .wiring
        .validate(scene.coils.len())
        .map_err(|wrong| RunError::Input(wrong.to_string()))?;
    let given = ForceProblem {
        forces_n_per_a: &forces,
        height_m: &points.height_m,
        offset_n: offset_n.as_deref(),
        weights: points.weights.as_deref(),
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let rewired = (!options.wiring.is_plain()).then(|| options.wiring.apply(&given));
    let problem = rewired.as_ref().map_or(given, |r| r.problem(&given));
    let mut solution = lambda::solve(&problem, &options.settings)?;
    let worst = worst_point(&problem, &options.settings)?;
    for point in solution.chosen.iter_mut().chain(&mut solution.at) {
        options.wiring.spread(&mut point.currents_a);
    }
    progress.end();
    let mut warnings = warnings::all(points, &problem, &solution, options);
    if !worst.complete {
        warnings.push(
            "the worst-point path could not be followed to its end: its numbers are not the \
             minimum; please report this design and shape"
                .to_owned(),
        );
    }
    if let Some(core) = &scene.core {
        warnings.extend(core.warnings.iter().cloned());
    }
    if let (Some(chosen), Steel::Coupled(array), Some(core)) =
        (&solution.chosen, &solved.steel, &scene.core)
        && matches!(core.material, Material::Linear(_))
    {
        let peak_t = field.peak_t(array, &chosen.currents_a)?;
        warnings.extend(above_knee(
            peak_t,
            core.knee_t,
            "a core of the array at the chosen currents",
        ));
    }
    let mut file = file(scene, solved, points, &solution, options, &forces);
    add_worst_point(&mut file, &problem, &solution, &worst);
    let (settings, wiring) = (&options.settings, &options.wiring);
    file.tolerance = Some(variants::tolerance(&problem, settings.jnd_weight, wiring)?);
    variants::tell_wiring(&mut file, wiring);
    if options.variants {
        let pairs = variants::opposite_pairs(&scene.design.array.positions_m);
        let passive_n = passive_n.as_deref();
        file.variants = Some(variants::all(&given, passive_n, settings, wiring, &pairs)?);
    }
    let mut feedback_n = Vec::new();
    if let Some(asked) = &options.feedback {
        let rendered = Rendering {
            scene,
            solved,
            points,
            given: &given,
            problem: &problem,
            wiring,
            chosen: solution.chosen.as_ref(),
        };
        let told = rendered.told(asked, progress)?;
        file.feedback = Some(told.file);
        let stage = told.between_layers;
        file.accuracy
            .extend(stage.map(|stage| ("feedback_shell".to_owned(), stage)));
        feedback_n = told.forces_n;
    }
    let picture = options.picture.then(|| {
        picture::picture(Seen {
            file: &file,
            points,
            problem: &problem,
            solution: &solution,
            feedback_n,
            spread: &|currents| wiring.spread(currents),
        })
    });
    if let Some(chosen) = &solution.chosen {
        let asked = Asked {
            currents_a: &chosen.currents_a,
            lambda_n_per_m: chosen.lambda_n_per_m,
            heights_m: &points.height_m,
            positions_m: positions,
            forces_n_per_a: &forces,
            offset_n: offset_n.as_deref(),
        };
        if let Some((facts, accuracy)) =
            at_working_point(scene, solved, &asked, options.tolerance, progress)?
        {
            warnings.extend(superposition_ends(
                scene,
                facts.deviation_from_linear,
                &facts.peak_field_t,
                "the forces that lambda was solved with",
            ));
            file.accuracy.insert("working_point".to_owned(), accuracy);
            file.working_point = Some(facts);
        }
    }
    file.accuracy.extend(points.stages());
    if let Some(moved) = points_effect::of_points(
        &Moved {
            scene,
            solved,
            field,
            points,
            given: &given,
            wiring: &options.wiring,
        },
        &options.settings,
        progress,
    )? {
        file.accuracy.insert("lambda_of_points".to_owned(), moved);
    }
    if let Some(pull) = &pull {
        file.accuracy
            .insert("passive_force".to_owned(), passive::accuracy(pull));
    }
    let accuracy_missed = missed(&file.accuracy, solved.tolerance);
    Ok(Found {
        file,
        picture,
        status: solution.status,
        precision: solution.precision,
        warnings,
        accuracy_reached: accuracy_missed.is_empty(),
        accuracy_missed,
    })
}

/// What was chosen, and from what.
struct Asked<'a> {
    currents_a: &'a [f64],
    lambda_n_per_m: f64,
    heights_m: &'a [f64],
    positions_m: &'a [[f64; 3]],
    forces_n_per_a: &'a [f64],
    offset_n: Option<&'a [f64]>,
}

/// Forces along the B-H curve at the chosen currents; `None` without a curve.
fn at_working_point(
    scene: &Scene,
    solved: &Solved,
    asked: &Asked,
    tolerance: Option<f64>,
    progress: &dyn Progress,
) -> Result<Option<(WorkingPointForces, StageAccuracy)>, RunError> {
    let lowest_m = asked
        .heights_m
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    progress.begin("working point", 1);
    let Some(point) = WorkingPoint::new(scene, solved, asked.currents_a, tolerance, lowest_m)?
    else {
        progress.end();
        return Ok(None);
    };
    let forces_n = point.forces_n(scene, asked.positions_m, progress)?;
    progress.end();
    let linear_n: Vec<f64> = asked
        .forces_n_per_a
        .chunks_exact(asked.currents_a.len())
        .map(|row| row.iter().zip(asked.currents_a).map(|(f, i)| f * i).sum())
        .collect();
    let (mut squares, mut worst_n) = (0.0, 0.0_f64);
    for (row, force) in forces_n.iter().enumerate() {
        let offset = asked.offset_n.map_or(0.0, |offset| offset[row]);
        let error = force + offset - asked.lambda_n_per_m * asked.heights_m[row];
        squares += error * error;
        worst_n = worst_n.max(error.abs());
    }
    let facts = WorkingPointForces {
        deviation_from_linear: relative_difference(&forces_n, &linear_n),
        rms_error_n: (squares / forces_n.len() as f64).sqrt(),
        worst_error_n: worst_n,
        peak_field_t: point.peak_field_t.clone(),
        mean_field_t: point.mean_field_t.clone(),
    };
    Ok(Some((facts, point.accuracy())))
}

fn file(
    scene: &Scene,
    solved: &Solved,
    points: &WantedPoints,
    solution: &Solution,
    options: &LambdaOptions,
    forces_n_per_a: &[f64],
) -> LambdaFile {
    let chosen = solution.chosen.as_ref();
    let forces = forces_accuracy(scene, solved, &points.positions_m, forces_n_per_a);
    let accuracy = BTreeMap::from([
        ("points".to_owned(), points.accuracy["points"].clone()),
        ("forces".to_owned(), forces),
        ("lambda".to_owned(), solution.accuracy.clone()),
    ]);
    LambdaFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: scene.design.name.clone(),
        shape: points.shape.clone(),
        inputs: points.inputs.clone(),
        constants: solution.constants,
        lambda_n_per_m: chosen.map(|point| point.lambda_n_per_m),
        criterion: options.settings.criterion,
        jnd: options.settings.jnd_weight,
        currents_a: chosen.map(|point| point.currents_a.clone()),
        rms_error_n: chosen.map(|point| point.rms_error_n),
        worst_error_n: chosen.map(|point| point.worst_error_n),
        relative_rms_error: chosen.and_then(|point| point.relative_rms_error),
        duality_gap_n2: chosen.map(|point| point.duality_gap_n2),
        rank: solution.rank,
        points: points.height_m.len(),
        path: solution
            .path
            .breakpoints()
            .into_iter()
            .map(|point| PathStep {
                lambda_n_per_m: point.lambda_n_per_m,
                currents_a: point.currents_a,
                event: events(&point.events),
            })
            .collect(),
        at: solution.at.as_ref().map(|point| AtLambda {
            lambda_n_per_m: point.lambda_n_per_m,
            currents_a: point.currents_a.clone(),
            rms_error_n: point.rms_error_n,
            worst_error_n: point.worst_error_n,
            worst_point: None,
        }),
        worst_point: None,
        sampling: None,
        tolerance: None,
        wiring: None,
        variants: None,
        feedback: None,
        working_point: None,
        sideways: None,
        accuracy,
    }
}

/// The worst-point form beside the mean square.
fn add_worst_point(
    file: &mut LambdaFile,
    problem: &ForceProblem,
    solution: &Solution,
    worst: &WorstSolution,
) {
    // Currents that bring no force nearer on average bring none of use at the worst point either.
    let rendered =
        |lambda: Option<f64>| lambda.filter(|_| solution.status != Status::NothingRendered);
    let chosen = solution.chosen.as_ref();
    let point = chosen.map(|chosen| worst.at(problem, chosen.lambda_n_per_m));
    let point = point.as_ref();
    file.worst_point = Some(WorstPointFile {
        lambda_linear_n_per_m: rendered(worst.lambda_linear_n_per_m),
        lambda_jnd_n_per_m: rendered(worst.lambda_jnd_n_per_m),
        relative_floor: worst.floor,
        worst_error_n: point.map(|point| point.worst_error_n),
        relative_worst_error: point.and_then(|point| point.relative_worst_error),
        currents_a: point.map(|point| point.currents_a.clone()),
        gap_n: point.map(|point| point.gap_n),
        active: point.map(|point| {
            let shares = point.active.iter().map(|active| ActivePointShare {
                point: active.point,
                multiplier: active.multiplier,
            });
            shares.collect()
        }),
        path: worst
            .path
            .turns()
            .iter()
            .map(|turn| WorstPointStep {
                lambda_n_per_m: turn.lambda_n_per_m,
                worst_error_n: turn.worst_error_n,
                currents_a: turn.currents_a.clone(),
                active_points: turn.active.iter().map(|active| active.point).collect(),
                event: if turn.events.is_empty() {
                    "other points decide".to_owned()
                } else {
                    events(&turn.events)
                },
            })
            .collect(),
    });
    if let Some(at) = &mut file.at {
        let point = worst.at(problem, at.lambda_n_per_m);
        at.worst_point = Some(WorstPointAt {
            worst_error_n: point.worst_error_n,
            currents_a: point.currents_a,
        });
    }
    file.accuracy
        .insert("worst_point".to_owned(), worst.accuracy.clone());
}

/// What is known of the error of forces at some points.
fn forces_accuracy(
    scene: &Scene,
    solved: &Solved,
    points_m: &[[f64; 3]],
    forces_n_per_a: &[f64],
) -> StageAccuracy {
    let proven = evaluation(scene, solved);
    let [m_x, m_y, m_z] = scene.moment_a_m2;
    let dipole = scene.design.magnet.model == MagnetModel::Dipole;
    if !dipole || m_x != 0.0 || m_y != 0.0 || m_z == 0.0 {
        return accuracy_of(scene, solved, proven);
    }
    let coils = scene.coils.len();
    let samples = spread(forces_n_per_a.len(), PLACES)
        .into_iter()
        .filter_map(|index| {
            let (coil, [x_m, y_m, z_m]) = (&scene.coils[index % coils], points_m[index / coils]);
            (coil.gain != 0.0).then(|| Sample {
                r_m: (x_m - coil.axis_m[0]).hypot(y_m - coil.axis_m[1]),
                z_m,
                gz: forces_n_per_a[index] / (coil.gain * m_z),
            })
        });
    accuracy_of(scene, solved, sharper(scene, solved, samples, proven))
}

/// What is proven of the forces' error, and estimated of the steel.
pub(crate) fn proven_accuracy(scene: &Scene, solved: &Solved) -> StageAccuracy {
    accuracy_of(scene, solved, evaluation(scene, solved))
}

/// What is proven of evaluating the forces, the steel's solution left out.
fn evaluation(scene: &Scene, solved: &Solved) -> Evaluation {
    let rules = solved.tolerance.max(KERNEL_ERROR);
    let cylinder = scene.design.magnet.model == MagnetModel::Cylinder;
    let field = match solved.steel {
        Steel::None if !cylinder => rules,
        Steel::None => (AIR_SHARE * rules).max(KERNEL_ERROR),
        // The winding's rule and the steel's.
        Steel::Alone(_) | Steel::Coupled(_) => 2.0 * EVALUATION_SHARE * rules,
    };
    let magnet = if cylinder {
        MAGNET_SHARE * rules.max(MAGNET_FINEST)
    } else {
        0.0
    };
    Evaluation {
        estimate: field + magnet,
        method: "a-priori quadrature bound, evaluated at the points directly".to_owned(),
    }
}

fn accuracy_of(scene: &Scene, solved: &Solved, evaluation: Evaluation) -> StageAccuracy {
    let Evaluation { estimate, method } = evaluation;
    StageAccuracy {
        estimate: estimate + solved.steel_error,
        relative_to: match (&solved.steel, scene.design.magnet.model) {
            (Steel::Alone(_) | Steel::Coupled(_), MagnetModel::Cylinder) => {
                "the largest |grad B| at each height of the magnet, averaged over it"
            }
            (Steel::None, _) | (_, MagnetModel::Dipole) => {
                "the largest |grad B| at the point's height"
            }
        }
        .to_owned(),
        method: match solved.steel_method() {
            None => method,
            Some(steel) => format!("{steel}; {method}"),
        },
    }
}

fn events(events: &[lambda::Event]) -> String {
    let told: Vec<String> = events.iter().map(ToString::to_string).collect();
    told.join("; ")
}
