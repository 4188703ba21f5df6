//! `lambda`: the force constant of one object, from forces computed at its points.

mod accuracy;
pub(crate) mod command;
pub mod error_target;
pub mod feedback;
mod headline;
pub(crate) mod map_error;
mod picture;
pub(crate) mod placement;
mod points;
mod points_effect;
mod result_file;
mod shell;
pub(crate) mod sideways;
mod text;
pub(crate) mod uncertain;
mod variants;
mod warnings;
mod working_point;

use std::borrow::Cow;

use serde::Serialize;

pub(crate) use self::accuracy::proven_accuracy;
use self::error_target::{ChosenGrid, ErrorTarget, Trial};
use self::feedback::FeedbackOptions;
use self::headline::Amplification;
use self::placement::Placed;
pub(crate) use self::points::{ForcePoints, ForcesAt};
pub(crate) use self::points_effect::error_of_points;
use super::discretize::scattered::{self, ScatteredSummary};
use super::discretize::{OpenedSurface, PointsOptions, PointsReport};
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed};
use crate::bundle::artefact::Input;
use crate::bundle::headline::{BudgetName, BudgetPart};
use crate::bundle::lambda_file::{LambdaFile, SampledPoints};
use crate::design::Design;
use crate::field::steel::core_flux_density::peak_depth_m;
use crate::force_direction::{ForceOverride, RequestedForce};
use crate::lambda::worst::worst_point;
use crate::lambda::{self, ForceProblem, Jnd, Precision, Settings, Solution, Status, Wiring};
use crate::plot::lambda::LambdaPlot;
use crate::point_weights::Weights;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::core_material::{Material, SceneCore};
use crate::scene::knee::{FOR_CORES, above_knee};
use crate::scene::passive;
use crate::scene::sources::Sampling;
use crate::scene::steel;
use crate::scene::steel::Solved;
use crate::shape::document::ShapeDocument;
use crate::uncertainty::UncertaintyOverride;
use crate::units::FAINT_FORCE_N;

/// Forces change over about the height above the coils: so many patches resolve them.
const PATCHES_A_HEIGHT: f64 = 16.0;

/// The options of `lambda`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LambdaOptions {
    /// Criterion, its weight, and a force constant of interest.
    pub settings: Settings,
    /// Whether the just-noticeable difference is [`Jnd::FAINT`] where the requested force is that small.
    pub jnd_by_force: bool,
    /// Tolerance of the forces; `None` for the default.
    pub tolerance: Option<f64>,
    /// How the points of a grid count; `None`: as their shape's document says.
    pub weights: Option<Weights>,
    /// The largest error that the computation may add.
    pub error: Option<ErrorTarget>,
    /// The same for a shape that leaves its points to the program, where none is requested.
    pub default_error: Option<f64>,
    /// Points on no grid, weighted by area, instead of the grid's; of [`run`] alone.
    pub sampling: Option<Sampling>,
    /// Coils broken or in series.
    pub wiring: Wiring,
    /// Whether single changes are solved too.
    pub variants: bool,
    /// Currents of their own at every point too, if requested.
    pub feedback: Option<FeedbackOptions>,
    /// Whether the data of a picture are computed.
    pub picture: bool,
    /// Overrides of the requested force that the shape states.
    pub force: ForceOverride,
    /// Override of the just-noticeable angle that the shape states, degrees.
    pub direction_jnd_deg: Option<f64>,
    /// Overrides of the design's uncertainties.
    pub uncertainty: UncertaintyOverride,
}

/// The force constant of one object. Serialised it is the JSON result.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct LambdaReport {
    /// The JSON result.
    #[serde(flatten)]
    pub file: LambdaFile,
    /// How errors relative to the largest gradient count in the force.
    #[serde(skip)]
    pub(crate) amplification: Option<Amplification>,
    /// The drawing, if one was requested.
    #[serde(skip)]
    pub picture: Option<LambdaPlot>,
    /// How far the solution goes.
    #[serde(skip)]
    pub status: Status,
    /// The arithmetic that was needed.
    #[serde(skip)]
    pub precision: Precision,
    /// Warnings for the user.
    #[serde(skip)]
    pub warnings: Vec<String>,
    /// The stages that miss the requested tolerance.
    #[serde(skip)]
    pub accuracy_missed: Vec<String>,
    /// Why the array cannot render the object where it is, and what would bring it there.
    #[serde(skip)]
    pub misplaced: Option<String>,
}

impl LambdaOptions {
    /// These options with the just-noticeable difference of the force that `problem` requests: the rms force of the
    /// chosen constant. Where it is faint at one and not at the other, the one of larger forces holds.
    pub(crate) fn with_jnd_of(&self, problem: &ForceProblem) -> Result<Cow<'_, Self>, RunError> {
        if !self.jnd_by_force {
            return Ok(Cow::Borrowed(self));
        }
        let faint = Settings {
            jnd_weight: Jnd::FAINT,
            ..self.settings
        };
        let constant = lambda::constant(problem, &faint)?;
        if constant.is_none_or(|n_per_m| n_per_m * problem.rms_height_m() >= FAINT_FORCE_N) {
            return Ok(Cow::Borrowed(self));
        }
        Ok(Cow::Owned(Self {
            settings: faint,
            ..self.clone()
        }))
    }

    /// These options with the error that holds for `document`.
    #[must_use]
    pub fn for_document(&self, document: &ShapeDocument) -> Self {
        let free = !document.grid_is_given && self.sampling.is_none();
        let default = self.default_error.filter(|_| free);
        let default = default.map(|error| ErrorTarget {
            error,
            refine: false,
            by_default: true,
        });
        Self {
            error: self.error.or(default),
            ..self.clone()
        }
    }

    /// # Errors
    /// A size along the normal where no object's force points along it; an angle that is noticed where sideways
    /// forces are left open.
    pub(crate) fn check_force<'a>(
        &self,
        documents: impl Iterator<Item = &'a ShapeDocument>,
    ) -> Result<(), RunError> {
        let forces = documents.map(|document| self.force.over(document.force));
        let forces: Vec<RequestedForce> = forces.collect();
        let mistake = if self.force.normal_force.is_some()
            && !forces.iter().any(|force| force.along_normal().is_some())
        {
            "--normal-force: no object's force points along its normal; add --force-direction normal"
        } else if self.direction_jnd_deg.is_some()
            && !forces.iter().any(|force| force.direction.is_vector())
        {
            "--direction-jnd: a vertical force leaves sideways errors open; add --force-direction vertical-only or \
             normal"
        } else {
            return Ok(());
        };
        Err(RunError::Input(mistake.to_owned()))
    }

    /// These options, the force being the document's where they request none.
    fn over(&self, document: &ShapeDocument) -> Self {
        Self {
            force: self.force.over(document.force).into(),
            direction_jnd_deg: self.direction_jnd_deg.or(Some(document.direction_jnd_deg)),
            ..self.clone()
        }
    }

    /// How the points of a grid count: as requested, else as the document says, else equally, or by
    /// area where an error is requested, since lambda of the object is meant then.
    pub(crate) fn weights_of(&self, points: &PointsReport) -> Weights {
        let default = match self.error {
            None => Weights::Equal,
            Some(_) => Weights::Area,
        };
        self.weights.or(points.weights).unwrap_or(default)
    }

    /// The tolerance of the field: as requested, else what a requested error leaves to steel. Air has
    /// its default, which costs nothing.
    pub(crate) fn tolerance_for(&self, design: &Design) -> Option<f64> {
        let of_error = self
            .error
            .filter(|target| design.has_steel() && !target.by_default);
        self.tolerance.or(of_error.map(ErrorTarget::tolerance))
    }
}

impl LambdaReport {
    /// States how far lambda of points on no grid is off.
    fn add_quadrature(&mut self, stage: Option<StageAccuracy>) {
        let Some(stage) = stage else {
            return;
        };
        if let Some(headline) = &mut self.file.headline {
            headline.add([BudgetPart {
                part: BudgetName::Points,
                error: stage.estimate,
                how: stage.method.clone(),
            }]);
        }
        for name in ["quadrature", "lambda_of_points"] {
            (self.file.accuracy).insert(name.to_owned(), stage.clone());
        }
    }

    /// Whether a force can be rendered: a force constant above zero, to the requested tolerance.
    #[must_use]
    pub fn meets_request(&self) -> bool {
        let rendered = self.file.lambda_n_per_m.is_some_and(|lambda| lambda > 0.0);
        rendered && self.accuracy_missed.is_empty() && self.misplaced.is_none()
    }
}

/// Solves eq. 9 and 10 for `document` on `design`. The points are those of the grid, whether they
/// were used or others.
///
/// # Errors
/// A design or shape that cannot be computed; interruption.
pub fn run(
    design: &Design,
    document: &ShapeDocument,
    inputs: Vec<Input>,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<(PointsReport, LambdaReport), RunError> {
    let options = &options.for_document(document);
    uncertain::check(options, design)?;
    let scene = Scene::with_tolerance(design, options.tolerance_for(design))?;
    let (points, of_grid, search) =
        object_points(&scene, document, inputs.clone(), options, progress)?;
    let document = search
        .as_ref()
        .map_or(document, |(_, chosen)| &chosen.document);
    let options = &options.over(document);
    let sampling = options
        .sampling
        .map(|how| resolving(how, of_grid.lowest_m()));
    let sample = |how| scattered::run(document, inputs.clone(), how, progress);
    let sampled = sampling.map(sample).transpose()?;
    let chosen = (sampled.as_ref().map(ForcePoints::of_scattered)).transpose()?;
    let by_area = || ForcePoints::of_object(&points, Weights::Area, &design.workspace);
    let others = match sampling.zip(chosen.as_ref()) {
        Some((how, chosen)) => {
            let sample = |how| ForcePoints::of_scattered(&sample(how)?);
            other_points(how, chosen, sample, by_area)?
        }
        None => OtherPoints::default(),
    };
    let of_all = [&of_grid].into_iter().chain(&chosen).chain(&others.points);
    let lowest_m = lowest_place_m(&scene, of_all, options);
    progress.begin("steel", 1);
    let solved = steel::solve(&scene, scene.tolerances.forces, lowest_m)?;
    progress.end();
    let none = ShapeField::default();
    let solve_with = |points: &ForcePoints, options: &LambdaOptions| {
        solve_at(&scene, &solved, none, points, options, progress)
    };
    let whole = |points: &ForcePoints| -> Result<LambdaReport, RunError> {
        let mut report = solve_with(points, options)?;
        sideways::add(
            &mut report.file,
            &scene,
            &solved,
            none,
            points,
            (options, options.force.over(RequestedForce::default())),
            progress,
        )?;
        let placed = Placed {
            design,
            document,
            points,
        };
        report.misplaced = placed.unfelt(report.file.lambda_n_per_m);
        Ok(report)
    };
    let (Some(chosen), Some(sampled)) = (chosen, sampled) else {
        let mut report = whole(&of_grid)?;
        let tolerance = scene.tolerances.forces;
        report.requested(search.as_ref(), options.default_error, None, tolerance);
        return Ok((points, report));
    };
    // Feedback and picture are of the chosen points alone.
    let plain = LambdaOptions {
        feedback: None,
        picture: false,
        ..options.clone()
    };
    let grid = solve_with(&of_grid, &plain)?.file;
    let mut report = whole(&chosen)?;
    let quadrature = others.quadrature(&report.file, |points| solve_with(points, &plain))?;
    report.add_quadrature(quadrature);
    report.file.sampling = Some(against_grid(&sampled.summary, &report.file, &grid));
    Ok((points, report))
}

/// The lowest of all places: the steel is solved once, for it.
fn lowest_place_m<'a>(
    scene: &Scene,
    of_all: impl Iterator<Item = &'a ForcePoints>,
    options: &LambdaOptions,
) -> f64 {
    let lowest = of_all.map(|points| points.lowest_place_m(&scene.design.workspace));
    let lowest_m = lowest.fold(f64::INFINITY, f64::min);
    let feedback = options.feedback;
    feedback.map_or(lowest_m, |feedback| feedback.lowest_m(scene, lowest_m))
}

/// The grid that was chosen for a requested error.
type Search = Option<(ErrorTarget, ChosenGrid)>;

/// The points of an object and those of lambda, on a grid that is chosen for the error of `options` where one is
/// requested; they are [`LambdaOptions::for_document`].
///
/// # Errors
/// A shape that cannot be computed; interruption.
pub(crate) fn object_points(
    scene: &Scene,
    document: &ShapeDocument,
    inputs: Vec<Input>,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<(PointsReport, ForcePoints, Search), RunError> {
    let opened = OpenedSurface::new(document, inputs, progress)?;
    let search = search(scene, (document, &opened), options, progress)?;
    let document = search
        .as_ref()
        .map_or(document, |(_, chosen)| &chosen.document);
    let points = opened.discretize(document, &PointsOptions::default(), None, progress)?;
    let rule = options.weights_of(&points);
    let of_grid = ForcePoints::of_object(&points, rule, &scene.design.workspace);
    Ok((points, of_grid, search))
}

/// The grid for the requested error, where one is requested and the points are those of a grid.
fn search(
    scene: &Scene,
    (document, opened): (&ShapeDocument, &OpenedSurface),
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<Search, RunError> {
    let Some(target) = options.error.filter(|_| options.sampling.is_none()) else {
        return Ok(None);
    };
    let lowest_m = scene.design.workspace.z_m.from;
    progress.begin("steel", 1);
    let solved = steel::solve(scene, scene.tolerances.forces, lowest_m)?;
    progress.end();
    let trial = Trial {
        scene,
        solved: &solved,
        field: ShapeField::default(),
        options,
        for_runtime: false,
    };
    let chosen = trial.grid(document, opened, target, progress)?;
    Ok(Some((target, chosen)))
}

/// Patches of the points over which forces change little, where no width is requested.
pub(crate) fn resolving(how: Sampling, lowest_m: f64) -> Sampling {
    match how {
        Sampling::Adaptive {
            max_deviation_m,
            widest_m: None,
        } if lowest_m > 0.0 => Sampling::Adaptive {
            max_deviation_m,
            widest_m: Some(lowest_m / PATCHES_A_HEIGHT),
        },
        Sampling::Adaptive { .. } | Sampling::Poisson { .. } => how,
    }
}

/// Points that those on no grid are compared with.
#[derive(Default)]
struct OtherPoints {
    points: Vec<ForcePoints>,
    /// Their changes count so many times.
    times: f64,
    /// How the comparison is stated.
    method: &'static str,
}

/// Points of patches twice as wide where the deviation decides, and where the width does: errors of both may have
/// opposite signs. Where the width decides of few patches, which may be whole faces already, of half that width. None
/// that are the same as the `chosen`. Where there are none, and of random points, those of the grid by area.
fn other_points(
    how: Sampling,
    chosen: &ForcePoints,
    points_of: impl Fn(Sampling) -> Result<ForcePoints, RunError>,
    by_area: impl FnOnce() -> ForcePoints,
) -> Result<OtherPoints, RunError> {
    let mut others = Vec::new();
    if let Sampling::Adaptive {
        max_deviation_m,
        widest_m: Some(widest_m),
    } = how
    {
        let points = |deviations: f64, widths: f64| {
            points_of(Sampling::Adaptive {
                max_deviation_m: deviations * max_deviation_m,
                widest_m: Some(widths * widest_m),
            })
        };
        let mut by_width = points(1.0, 2.0)?;
        if 2 * by_width.positions_m.len() > chosen.positions_m.len() {
            by_width = points(1.0, 0.5)?;
        }
        others = vec![points(4.0, 1.0)?, by_width];
        others.retain(|other| other.positions_m != chosen.positions_m);
    }
    if others.is_empty() {
        return Ok(OtherPoints {
            points: vec![by_area()],
            times: 1.0,
            method: "an estimate: the change from the grid's points by area, and what these are off by",
        });
    }
    Ok(OtherPoints {
        points: others,
        times: 1.5,
        method: "an estimate: one and a half times the changes from patches of other widths, where the deviation \
                 decides and where the width does",
    })
}

impl OtherPoints {
    /// How far lambda of `file` is off because forces between the points do not enter it; `solve` gives that of others.
    fn quadrature(
        &self,
        file: &LambdaFile,
        solve: impl Fn(&ForcePoints) -> Result<LambdaReport, RunError>,
    ) -> Result<Option<StageAccuracy>, RunError> {
        let Some(here) = file.lambda_n_per_m.filter(|lambda| *lambda > 0.0) else {
            return Ok(None);
        };
        let mut changes = 0.0;
        for points in &self.points {
            let other = solve(points)?.file;
            let there = other.lambda_n_per_m.unwrap_or(0.0) / here;
            let of_other = other.accuracy.get("lambda_of_points");
            changes += (there - 1.0).abs() + of_other.map_or(0.0, |stage| stage.estimate * there);
        }
        Ok(Some(StageAccuracy {
            estimate: self.times * changes,
            relative_to: "lambda".to_owned(),
            method: self.method.to_owned(),
        }))
    }
}

/// The change from the grid's points to other points.
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

/// An object over a scene, the coils' forces at its points, and the problem that they pose.
#[derive(Clone, Copy)]
struct PosedProblem<'a> {
    scene: &'a Scene<'a>,
    solved: &'a Solved,
    field: ShapeField<'a>,
    points: &'a ForcePoints,
    options: &'a LambdaOptions,
    /// Every coil by itself.
    unwired: ForceProblem<'a>,
    /// The same as wired.
    problem: ForceProblem<'a>,
    /// The requested force.
    force: RequestedForce,
}

/// The force constant for points that are known.
///
/// # Errors
/// A problem that cannot be solved; interruption.
pub(crate) fn solve_at(
    scene: &Scene,
    solved: &Solved,
    field: ShapeField,
    points: &ForcePoints,
    options: &LambdaOptions,
    progress: &dyn Progress,
) -> Result<LambdaReport, RunError> {
    options
        .wiring
        .validate(scene.coils.len())
        .map_err(|wrong| RunError::Input(wrong.to_string()))?;
    let positions = &points.positions_m;
    let forces_n_per_a = field.forces_n_per_a("forces", scene, solved, positions, progress)?;
    let counts = scene.design.magnet.passive_force;
    let wanted = (counts || options.variants).then(|| passive::pull(scene, positions, false));
    // A variant alone can do without it.
    let (pull, unknown) = match wanted.transpose() {
        Err(RunError::Input(why)) if !counts => (None, Some(why)),
        pull => (pull?.flatten(), None),
    };
    let passive_n = pull.as_ref().map(|pull| pull.forces_z_n(positions));
    progress.begin("lambda", 1);
    let resistance_ohm = scene.resistances_ohm();
    let unwired = ForceProblem {
        forces_n_per_a: &forces_n_per_a,
        height_m: &points.height_m,
        offset_n: passive_n.as_deref().filter(|_| counts),
        weights: points.weights(),
        lower_a: &scene.lower_a,
        upper_a: &scene.upper_a,
        total_max_a: scene.design.supply.total_current_max_a,
        resistance_ohm: &resistance_ohm,
    };
    let voltage_v = scene.design.supply.voltage_v;
    let rewired = (!options.wiring.is_plain()).then(|| options.wiring.apply(&unwired, voltage_v));
    let problem = rewired
        .as_ref()
        .map_or(unwired, |rewired| rewired.problem(&unwired));
    let options = options.with_jnd_of(&problem)?;
    let posed = PosedProblem {
        scene,
        solved,
        field,
        points,
        options: options.as_ref(),
        unwired,
        force: options.force.over(RequestedForce::default()),
        problem,
    };
    let pull = pull.filter(|_| counts).map(|pull| passive::accuracy(&pull));
    let mut report = posed.report(passive_n.as_deref(), pull, progress)?;
    report.accuracy_missed = missed(&report.file.accuracy, solved.tolerance);
    let unknown = unknown.map(|why| format!("no variant with the steel's pull: {why}"));
    report.warnings.extend(unknown);
    Ok(report)
}

impl PosedProblem<'_> {
    /// Solves the problem and all that is requested with it; `progress` is within the stage
    /// `lambda`. `passive_n` is the force without currents, whether or not the problem counts it;
    /// `pull` what is known of its error, where it does.
    fn report(
        &self,
        passive_n: Option<&[f64]>,
        pull: Option<StageAccuracy>,
        progress: &dyn Progress,
    ) -> Result<LambdaReport, RunError> {
        let (options, problem) = (self.options, &self.problem);
        let (solution, worst) = rayon::join(
            || lambda::solve(problem, &options.settings),
            || worst_point(problem, &options.settings),
        );
        let (mut solution, worst) = (solution?, worst?);
        for point in solution.chosen.iter_mut().chain(&mut solution.at) {
            options.wiring.spread(&mut point.currents_a);
        }
        progress.end();
        let mut warnings = warnings::all(self, &solution, &worst);
        warnings.extend(self.core_warnings(&solution)?);
        let mut file = self.file(&solution, &worst)?;
        let pull = pull.map(|stage| ("passive_force".to_owned(), stage));
        file.accuracy.extend(pull);
        if options.variants {
            file.variants = Some(variants::all(self, passive_n)?);
        }
        let chosen = solution.chosen.as_ref();
        let mut feedback_n = Vec::new();
        if let Some(feedback) = &options.feedback {
            let rendered = self.feedback(feedback, chosen, progress)?;
            file.feedback = Some(rendered.file);
            let stage = rendered.between_layers;
            let stage = stage.map(|stage| ("feedback_shell".to_owned(), stage));
            file.accuracy.extend(stage);
            feedback_n = rendered.forces_n;
        }
        let picture = options
            .picture
            .then(|| self.picture(&file, &solution, feedback_n));
        // Forces of several currents do not add up along a B-H curve: the chosen currents' own.
        let along_curve = chosen.map(|chosen| self.along_curve(chosen, progress));
        if let Some(along_curve) = along_curve.transpose()?.flatten() {
            let (name, stage) = ("working_point".to_owned(), along_curve.accuracy);
            file.accuracy.insert(name, stage);
            file.working_point = Some(along_curve.forces);
            warnings.extend(along_curve.warning);
        }
        if let Some(at) = &solution.at {
            let along_curve = self.along_curve(at, progress)?;
            let warning = along_curve.and_then(|along_curve| along_curve.warning);
            warnings.extend(warning.map(|warning| format!("--at: {warning}")));
        }
        file.accuracy.extend(self.points.stages());
        let of_curve = self.solved.curve_stages();
        file.accuracy
            .extend(of_curve.map(|(name, stage)| (name.to_owned(), stage)));
        let effects = self.effects_of_points(file.lambda_n_per_m, progress)?;
        file.accuracy.extend(effects);
        let headline = self.headline(&file, progress)?;
        let amplification = headline.as_ref().map(|(_, amplification)| *amplification);
        file.headline = headline.map(|(headline, _)| headline);
        Ok(LambdaReport {
            file,
            amplification,
            picture,
            status: solution.status,
            precision: solution.precision,
            warnings,
            accuracy_missed: Vec::new(),
            misplaced: None,
        })
    }

    /// Warnings about the cores, at the chosen currents if there are any.
    fn core_warnings(&self, solution: &Solution) -> Result<Vec<String>, RunError> {
        if let (Some(iron), Some(chosen)) = (&self.scene.iron, &solution.chosen) {
            let mut warnings = iron.put_right.clone();
            if let Some(search) = self.solved.iron_search(self.scene) {
                let peaks = search.peaks(&chosen.currents_a)?;
                let above = iron.above_knee(self.scene, &peaks, "the chosen currents");
                warnings.extend(above.into_iter().flatten());
            }
            return Ok(warnings);
        }
        let Some(core) = &self.scene.core else {
            return Ok(Vec::new());
        };
        let mut warnings = core.warnings.clone();
        warnings.extend(self.solved.above_knee(self.scene));
        if let (Some(chosen), Material::Linear(_)) = (&solution.chosen, &core.material) {
            let (peak_t, error) = self.core_peak_t(core, &chosen.currents_a)?;
            warnings.extend(above_knee(
                [(peak_t, error * peak_t)],
                core.knee_t,
                "a core of the array at the chosen currents",
                FOR_CORES,
            ));
        }
        Ok(warnings)
    }

    /// The largest |B| in a core at these currents, T, and its estimated error, relative.
    fn core_peak_t(&self, core: &SceneCore, currents_a: &[f64]) -> Result<(f64, f64), RunError> {
        let steel = self.solved.steel();
        if let Some(array) = steel.coupled() {
            return Ok((self.field.peak_t(array, currents_a)?, array.relative_error));
        }
        let Some(alone) = steel.alone() else {
            return Ok((0.0, 0.0));
        };
        let most_a = currents_a.iter().fold(0.0_f64, |most, i| most.max(i.abs()));
        let (winding, depth_m) = (&self.scene.winding, peak_depth_m(core.shape));
        let inside = alone.layer.core_field(winding, most_a, depth_m)?;
        Ok((
            inside.peak_t,
            inside.peak_error.max(self.solved.steel_error),
        ))
    }
}
