//! `calibrate`: map, points and lambda for each shape, one bundle each.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::discretize::{self, OpenedSurface, PointsReport, point_rows, points_grid};
use super::lambda::error_target::{ChosenGrid, ErrorTarget};
use super::lambda::placement::Placed;
use super::lambda::{ForcePoints, LambdaOptions, LambdaReport, sideways, solve_at, uncertain};
use super::made_with::surface;
use super::map::{add_pull, arrays, passive_map, runtime, summary};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION, UNITS, arithmetic};
use crate::bundle::atomic::WriteError;
use crate::bundle::cache::Store;
use crate::bundle::json::displayed;
use crate::bundle::manifest::{CircuitSummary, LambdaSummary, MadeWith, Manifest};
use crate::bundle::npz::Runtime;
use crate::bundle::rendering::{HeightGrid, Rendering};
use crate::bundle::table::CurrentRow;
use crate::bundle::timing::StageSeconds;
use crate::bundle::write::{BundleContent, check_bundle_target, write_bundle};
use crate::design::Design;
use crate::force_direction::RequestedForce;
use crate::lambda::Settings;
use crate::lambda::uncertainty::RobustRuntime;
use crate::progress::Progress;
use crate::report::bundle_files;
use crate::scene::Scene;
use crate::scene::cached_field::{FieldStore, STORE_FOLDER, ShapeField, SteelPart};
use crate::scene::named_files::NamedContent;
use crate::scene::neighbours;
use crate::scene::passive_map::PassiveMap;
use crate::scene::shard::Shard;
use crate::scene::sources::{DesignSource, ShapeSource, check_names};
use crate::scene::steel::Solved;
use crate::shape::points::ConstraintPoints;

pub(crate) mod again;
mod budget;
pub(crate) mod command;
mod directions;
mod ignored_pull;
mod needed_map;
mod page;
pub mod plan;
mod recorded;
pub(crate) mod requested_force;
mod text;
mod vtk;

pub use crate::report::bundle_files::PAGE_FILE;
pub(crate) use ignored_pull::{IgnoredPull, sideways_left_out};
use needed_map::NeededMap;
pub(crate) use needed_map::{needed_coils, needed_nodes};
use plan::Plan;

/// The name under which a bundle keeps the design it was made from.
pub const DESIGN_FILE: &str = "design.toml";

/// How far from the object's points the map still reaches by default, m: the seed's largest
/// deviation between finger and surface is 14 mm.
pub const DEFAULT_REACH_M: f64 = 0.020;

/// The options of `calibrate`.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrateOptions {
    /// Folder under which `<design>/<shape>/` is written.
    pub out: PathBuf,
    /// Replace what is there, whatever it is.
    pub force: bool,
    /// The force constant's criterion; its `tolerance` is that of the forces.
    pub lambda: LambdaOptions,
    /// The map reaches this far from the object's points, within the workspace, m.
    pub reach_m: f64,
    /// Keep the design's field for the next run, and use what an earlier one kept.
    pub keep: bool,
    /// Whether a page and plots for people are written too.
    pub page: bool,
    /// Whether files for ParaView are written too.
    pub vtk: bool,
}

impl CalibrateOptions {
    /// The command's defaults, under the folder `out`.
    pub fn new(out: impl Into<PathBuf>) -> Self {
        Self {
            out: out.into(),
            force: false,
            lambda: LambdaOptions::default(),
            reach_m: DEFAULT_REACH_M,
            keep: true,
            page: true,
            vtk: false,
        }
    }

    /// Whether any of `shapes` requests a force vector.
    pub(crate) fn requests_vector(&self, shapes: &[ShapeSource]) -> bool {
        let force = |shape: &ShapeSource| self.lambda.force.over(shape.document.force);
        shapes
            .iter()
            .any(|shape| force(shape).direction.is_vector())
    }

    /// These options with the error that holds for `shape`.
    pub(crate) fn for_shape(&self, shape: &ShapeSource) -> Self {
        Self {
            lambda: self.lambda.for_document(&shape.document),
            ..self.clone()
        }
    }

    /// The options that `verify` needs beside the inputs to compute the same bundle again. A new option does not
    /// compile before it is recorded or left out on purpose.
    pub(crate) fn made_with(&self, shape: &ShapeSource) -> MadeWith {
        let CalibrateOptions {
            out: _,
            force: _,
            lambda,
            reach_m,
            keep: _,
            page,
            vtk,
        } = self;
        let LambdaOptions {
            settings,
            jnd_by_force,
            tolerance,
            weights,
            error,
            default_error,
            // Of `lambda` alone.
            sampling: _,
            wiring: _,
            variants: _,
            feedback: _,
            picture: _,
            force,
            // Of `lambda --feedback` alone.
            direction_jnd_deg: _,
            uncertainty,
        } = lambda;
        let Settings {
            criterion,
            jnd_weight,
            at_n_per_m,
        } = *settings;
        let requested = error.filter(|target| !target.by_default);
        let mut made_with = MadeWith {
            criterion: Some(criterion),
            jnd: Some(jnd_weight).filter(|_| !jnd_by_force),
            jnd_by_force: *jnd_by_force,
            at_n_per_m,
            tolerance: *tolerance,
            force_direction: force.direction,
            normal_force: force.normal_force,
            weights: *weights,
            uncertainty: *uncertainty,
            error: requested.map(|target| target.error),
            refine: requested.is_some_and(|target| target.refine),
            default_error: default_error.filter(|_| requested.is_none()),
            reach_m: *reach_m,
            report: *page,
            vtk: *vtk,
            arithmetic: arithmetic(),
            surface: surface(&shape.document, shape.input.as_ref()),
            sha256: String::new(),
        };
        made_with.sha256 = made_with.digest();
        made_with
    }
}

/// The bundles of one design. Serialised it is the JSON result.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct CalibrateReport {
    /// Layout of the artefacts.
    pub schema_version: &'static str,
    /// Program that wrote them.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// The plan, where `--explain` requested it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan: Option<Plan>,
    /// One entry a shape, in the order given.
    pub bundles: Vec<BundleReport>,
}

/// One bundle: what `lambda` reports of its shape, and its manifest.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct BundleReport {
    /// Its folder.
    #[serde(serialize_with = "displayed")]
    pub folder: PathBuf,
    /// Grid points without surface, left out.
    pub outside: usize,
    /// The force constant.
    #[serde(flatten)]
    pub lambda: LambdaReport,
    /// `manifest.json` as written.
    pub manifest: Manifest,
}

impl CalibrateReport {
    /// Whether every shape has a force constant and every tolerance was reached.
    #[must_use]
    pub fn meets_request(&self) -> bool {
        self.bundles
            .iter()
            .all(|bundle| bundle.lambda.meets_request())
    }
}

/// Calibrates `source` for every shape; each bundle is whole before the next begins.
///
/// # Errors
/// Two shapes of one name; a design or shape that cannot be computed; an output that must not
/// be replaced or cannot be written; interruption. Finished bundles are kept.
pub fn run(
    source: DesignSource,
    shapes: &[ShapeSource],
    options: &CalibrateOptions,
    progress: &dyn Progress,
) -> Result<CalibrateReport, RunError> {
    check_names(shapes)?;
    check_reach(source.design, options)?;
    uncertain::check(&options.lambda, source.design)?;
    let tolerance = options.lambda.tolerance_for(source.design);
    let scene = Scene::with_tolerance(source.design, tolerance)?;
    // Before anything is computed, cleared or kept: a run that is refused changes nothing.
    let check = |shape: &ShapeSource| -> Result<Vec<Input>, RunError> {
        let inputs = inputs(source, &scene, shape);
        let inputs = discretize::with_surface(&shape.document, inputs);
        let made_with = options.made_with(shape);
        let folder = folder_of(&scene, shape, options);
        check_bundle_target(&folder, options.force, &inputs, Some(&made_with))?;
        Ok(inputs)
    };
    let checked = shapes.iter().map(check).collect::<Result<Vec<_>, _>>()?;
    if !options.keep {
        store_of(&scene, options).clear();
    }
    let field = field_store(&scene, options);
    let solved = BothSolved::new(&scene, &field, progress)?;
    let circuit = Inductances::new(&scene, &solved.map, progress);
    let bundles = shapes
        .iter()
        .zip(&checked)
        .map(|(shape, checked)| {
            let options = &options.for_shape(shape);
            Calibration {
                scene: &scene,
                solved: &solved,
                source,
                circuit: &circuit,
                field: field.of_shape(&shape.document.name),
                shape,
                checked,
                options,
            }
            .write(progress)
        })
        .collect::<Result<_, _>>()?;
    Ok(CalibrateReport {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: source.design.name.clone(),
        plan: None,
        bundles,
    })
}

/// Solves the part that `shard` chooses of the drives of the coupled cores of `source` into its cache, where
/// [`run`] with the same options finds it, and writes nothing else.
///
/// # Errors
/// As [`FieldStore::steel_part`]; interruption.
pub fn run_shard(
    source: DesignSource,
    shard: Shard,
    options: &CalibrateOptions,
    progress: &dyn Progress,
) -> Result<SteelPart, RunError> {
    let tolerance = options.lambda.tolerance_for(source.design);
    let scene = Scene::with_tolerance(source.design, tolerance)?;
    progress.begin("steel", 1);
    let part = field_store(&scene, options).steel_part(&scene, shard)?;
    progress.end();
    Ok(part)
}

/// # Errors
/// A position that may be farther off than the map reaches.
fn check_reach(design: &Design, options: &CalibrateOptions) -> Result<(), RunError> {
    let sensor_m = options.lambda.uncertainty.over(design.uncertainty).sensor_m;
    if sensor_m <= options.reach_m {
        return Ok(());
    }
    Err(RunError::Input(format!(
        "a sensor error of {} mm is larger than the map's reach of {} mm: give --reach {}mm or more, or lower \
         --sensor-error (sensor_mm in [uncertainty])",
        1e3 * sensor_m,
        1e3 * options.reach_m,
        1e3 * sensor_m
    )))
}

/// The field that earlier runs cached, unless the options are against that.
pub(crate) fn field_store(scene: &Scene, options: &CalibrateOptions) -> FieldStore {
    let store = if options.keep {
        store_of(scene, options)
    } else {
        Store::none()
    };
    FieldStore::new(scene, store)
}

/// Beside the design's bundles.
fn store_of(scene: &Scene, options: &CalibrateOptions) -> Store {
    Store::in_folder(options.out.join(&scene.design.name), STORE_FOLDER)
}

/// Finest tolerance of inductances in air: they decide how currents lag, and nothing else.
const INDUCTANCE_TOLERANCE: f64 = 1e-6;

/// How the coils' currents follow their voltages; the same for every shape.
struct Inductances {
    circuit: CircuitSummary,
    accuracy: StageAccuracy,
}

impl Inductances {
    fn new(scene: &Scene, solved: &Solved, progress: &dyn Progress) -> Self {
        progress.begin("inductances", 1);
        let tolerance = solved.tolerance.max(INDUCTANCE_TOLERANCE);
        let in_air = neighbours::in_air(scene, tolerance);
        let (inductance_h, accuracy) = neighbours::inductances(solved, in_air);
        progress.end();
        Self {
            circuit: CircuitSummary {
                inductance_h,
                voltage_v: scene.design.supply.voltage_v,
            },
            accuracy,
        }
    }
}

/// The sources to the tolerance of forces and to that of maps: of steel one solution serves both.
struct BothSolved {
    forces: Solved,
    map: Solved,
}

impl BothSolved {
    fn new(scene: &Scene, field: &FieldStore, progress: &dyn Progress) -> Result<Self, RunError> {
        let lowest_m = scene.design.workspace.z_m.from;
        progress.begin("steel", 1);
        let map = field.steel(scene)?;
        let forces = map.for_forces(scene, lowest_m)?;
        progress.end();
        Ok(Self { forces, map })
    }
}

/// Where the bundle of `shape` goes.
fn folder_of(scene: &Scene, shape: &ShapeSource, options: &CalibrateOptions) -> PathBuf {
    let design = options.out.join(&scene.design.name);
    design.join(&shape.document.name)
}

/// The inputs of a bundle, but for the surface that the shape's document names.
fn inputs(source: DesignSource, scene: &Scene, shape: &ShapeSource) -> Vec<Input> {
    let mut all = vec![source.input.clone()];
    all.extend(scene.files.iter().map(NamedContent::input));
    all.extend(shape.input.clone());
    all
}

/// An object's points.
struct ObjectPoints {
    /// Those of lambda.
    found: PointsReport,
    /// Those between which a runtime interpolates; `None`: the same.
    heights: Option<PointsReport>,
    /// The requested error, and the grid that was chosen for it.
    search: Option<(ErrorTarget, ChosenGrid)>,
}

impl ObjectPoints {
    /// The points that the force constant of `of` is solved for.
    fn force_points(&self, of: &Calibration) -> ForcePoints {
        let rule = of.options.lambda.weights_of(&self.found);
        ForcePoints::of_object(&self.found, rule, &of.scene.design.workspace)
    }
}

/// One shape on a design whose sources are solved.
#[derive(Clone, Copy)]
struct Calibration<'a> {
    scene: &'a Scene<'a>,
    solved: &'a BothSolved,
    source: DesignSource<'a>,
    circuit: &'a Inductances,
    field: ShapeField<'a>,
    shape: &'a ShapeSource,
    /// The inputs with which the bundle was found to be replaceable.
    checked: &'a [Input],
    options: &'a CalibrateOptions,
}

impl Calibration<'_> {
    /// Computes the bundle and writes it.
    fn write(&self, progress: &dyn Progress) -> Result<BundleReport, RunError> {
        progress.take_seconds();
        let (options, folder) = (
            self.options,
            folder_of(self.scene, self.shape, self.options),
        );
        let points = self.points(progress)?;
        // Checked again where the surface that was parsed is not the one that was looked at first.
        let made_with = options.made_with(self.shape);
        let inputs = &points.found.summary.inputs;
        if inputs != self.checked {
            check_bundle_target(&folder, options.force, inputs, Some(&made_with))?;
        }
        let write = |content: &BundleContent, lambda: &LambdaReport| {
            if let Some(message) = lambda.misplaced.as_ref().filter(|_| !options.force) {
                let shape = &self.shape.document.name;
                return Err(RunError::Misplaced(format!(
                    "{shape}: {message}; no bundle was written, --force writes it all the same"
                )));
            }
            let seconds = progress.take_seconds().into_iter();
            let timing: Vec<StageSeconds> = seconds
                .map(|(stage, seconds)| StageSeconds { stage, seconds })
                .collect();
            progress.check()?;
            progress.begin("write", 1);
            let manifest = write_bundle(&folder, options.force, content, &timing)?;
            progress.end();
            Ok(manifest)
        };
        let (manifest, lambda) = self.compute(&points, progress, write)?;
        Ok(BundleReport {
            folder,
            outside: points.found.summary.outside,
            lambda,
            manifest,
        })
    }

    /// The object's points and heights; their inputs are those of the whole bundle.
    fn points(&self, progress: &dyn Progress) -> Result<ObjectPoints, RunError> {
        let inputs = inputs(self.source, self.scene, self.shape);
        let opened = OpenedSurface::new(&self.shape.document, inputs, progress)?;
        let search = self.search(&opened, progress)?;
        let document = search
            .as_ref()
            .map_or(&self.shape.document, |(_, chosen)| &chosen.document);
        let object = ObjectPoints {
            found: opened.discretize_cached(("points", document, true), self.field, progress)?,
            heights: self.heights(&opened, search.as_ref(), progress)?,
            search,
        };
        if object.search.is_none() {
            // The map's nodes are known before anything is solved.
            let heights = object.heights.as_ref().unwrap_or(&object.found);
            let points = &heights.discretized.points;
            let about = (self.scene.design, points, self.options.reach_m);
            needed_map::check(self.scene, self.force().direction.is_vector(), about)?;
        }
        Ok(object)
    }

    /// Computes everything that a bundle holds and hands it to `take`, which returns the manifest
    /// with its list of files.
    fn compute<T>(
        &self,
        object: &ObjectPoints,
        progress: &dyn Progress,
        take: impl FnOnce(&BundleContent, &LambdaReport) -> Result<T, RunError>,
    ) -> Result<(T, LambdaReport), RunError> {
        let (scene, solved, field) = (self.scene, self.solved, self.field);
        let search = object.search.as_ref();
        let heights = object.heights.as_ref().unwrap_or(&object.found);
        let fine_points = &heights.discretized.points;
        let options = LambdaOptions {
            picture: self.options.page,
            ..self.options.lambda.clone()
        };
        let of_grid = object.force_points(self);
        let mut lambda = solve_at(scene, &solved.forces, field, &of_grid, &options, progress)?;
        sideways::add(
            &mut lambda.file,
            scene,
            &solved.forces,
            field,
            &of_grid,
            (&options, self.force()),
            progress,
        )?;
        let grid_points = &object.found.discretized.points;
        let (design, mut needed) = self.map(search, &lambda, fine_points, progress)?;
        let passive = passive_map(scene, &needed.made.map, progress)?;
        progress.begin("passive force", 1);
        let ignored = IgnoredPull::new(scene, &lambda, &of_grid, field)?;
        progress.end();
        if let Some(ignored) = ignored {
            lambda.warnings.extend(ignored.warning(lambda.file.jnd));
            needed.left_out.push(ignored.left_out());
        }
        needed.left_out.extend(sideways_left_out(&lambda.file));
        self.add_to_headline(&mut lambda, heights, &needed, passive.as_ref(), progress)?;
        let default = self.options.lambda.default_error;
        let runtime = Some((&design.workspace, fine_points.grid.samples()));
        lambda.requested(search, default, runtime, solved.forces.tolerance);
        let mut manifest = self.manifest(&lambda, grid_points, &needed, passive.as_ref());
        manifest.points.graded = of_grid.positions_m.len() - grid_points.len();
        let placed = Placed {
            design: scene.design,
            document: &self.shape.document,
            points: &of_grid,
        };
        placed.judge(&mut lambda);
        let rows = of_grid.rows();
        let currents = current_rows(scene, &lambda);
        let runtime = self.runtime(&lambda, (grid_points, fine_points), &currents);
        let mut map = arrays(&needed.made, runtime);
        map.passive_force_n = passive.as_ref().map(|p| Cow::Borrowed(&*p.force_z_n));
        let mut extra = vec![(DESIGN_FILE, self.source.text.as_bytes())];
        let files = self.scene.files.iter();
        extra.extend(files.map(|file| (file.kept_name.as_str(), &file.bytes[..])));
        let vtk = self.vtk(grid_points, &lambda, &currents, progress)?;
        extra.extend(vtk.iter().map(|(name, bytes)| (*name, &bytes[..])));
        let mut content = BundleContent {
            manifest,
            map: &map,
            points: &rows,
            currents: &currents,
            lambda: &lambda.file,
            extra: &extra,
        };
        let pages = self.pages(&content, &lambda, grid_points, progress)?;
        let pages = pages.iter().map(|(name, bytes)| (*name, &bytes[..]));
        let extra: Vec<(&str, &[u8])> = extra.iter().copied().chain(pages).collect();
        content.extra = &extra;
        let manifest = take(&content, &lambda)?;
        Ok((manifest, lambda))
    }

    /// The page and the plots beside `content`, if they are requested.
    fn pages(
        &self,
        content: &BundleContent,
        lambda: &LambdaReport,
        points: &ConstraintPoints,
        progress: &dyn Progress,
    ) -> Result<Vec<(&'static str, Vec<u8>)>, RunError> {
        let Some(picture) = &lambda.picture else {
            return Ok(Vec::new());
        };
        let directions = self.directions(points, lambda, progress)?;
        progress.begin("report", 1);
        let tolerance = self.solved.map.tolerance;
        let warnings = &lambda.warnings;
        let object = page::object(
            self.scene, content, picture, directions, warnings, tolerance,
        );
        let others: Vec<&str> = content.extra.iter().map(|(name, _)| *name).collect();
        let files = bundle_files::files(&object, &others)
            .map_err(|error| WriteError::from_io("write", Path::new(PAGE_FILE), error))?;
        progress.end();
        Ok(files)
    }

    /// The force that is requested over the shape.
    fn force(&self) -> RequestedForce {
        (self.options.lambda.force).over(self.shape.document.force)
    }

    /// The numbers that a runtime needs beside the map.
    fn runtime(
        &self,
        lambda: &LambdaReport,
        (points, heights): (&ConstraintPoints, &ConstraintPoints),
        currents: &[CurrentRow],
    ) -> Runtime {
        let circuit = &self.circuit.circuit;
        let grid = |of: &ConstraintPoints| HeightGrid::of_points(&points_grid(of), &point_rows(of));
        let heights_m = grid(points).and_then(|coarse| grid(heights)?.through(&coarse));
        let rendering = heights_m.map(|heights_m| Rendering {
            heights: heights_m,
            static_current_a: currents.iter().map(|row| row.current_a).collect(),
            inductance_h: circuit.inductance_h.concat(),
            voltage_v: circuit.voltage_v,
            requested: requested_force::on_grid(self.force(), heights),
            robust: lambda
                .file
                .uncertainty
                .as_ref()
                .map(|study| RobustRuntime::new(&study.given, study.robust.price_n2_per_w)),
        });
        Runtime {
            rendering,
            ..runtime(self.scene, lambda.file.lambda_n_per_m)
        }
    }

    /// `manifest.json`, but for its list of files.
    fn manifest(
        &self,
        lambda: &LambdaReport,
        points: &ConstraintPoints,
        needed: &NeededMap,
        passive: Option<&PassiveMap>,
    ) -> Manifest {
        let (scene, file) = (self.scene, &lambda.file);
        let mut accuracy = file.accuracy.clone();
        accuracy.insert("map".to_owned(), needed.made.accuracy.clone());
        accuracy.insert("inductances".to_owned(), self.circuit.accuracy.clone());
        let mut map = summary(&needed.made, needed.components);
        if let Some(passive) = passive {
            add_pull(passive, &mut map, &mut accuracy);
        }
        Manifest {
            schema_version: SCHEMA_VERSION.to_owned(),
            fluxform_version: FLUXFORM_VERSION.to_owned(),
            design: file.design.clone(),
            shape: file.shape.clone(),
            inputs: file.inputs.clone(),
            made_with: Some(self.options.made_with(self.shape)),
            units: UNITS.to_owned(),
            array: scene.array_geometry(),
            limits: scene.current_limits(),
            resistance_ohm: scene.resistances_ohm(),
            circuit: Some(self.circuit.circuit.clone()),
            magnet: scene.magnet_summary(),
            lambda: LambdaSummary {
                lambda_n_per_m: file.lambda_n_per_m,
                criterion: file.criterion,
            },
            force: requested_force::summary(self.force(), points),
            points: points_grid(points),
            map,
            left_out: needed.left_out.clone(),
            accuracy,
            files: Vec::new(),
        }
    }
}

/// Static currents, zero where there is no force constant.
fn current_rows(scene: &Scene, lambda: &LambdaReport) -> Vec<CurrentRow> {
    let currents = lambda.file.currents_a.as_deref();
    scene
        .coils
        .iter()
        .map(|coil| CurrentRow {
            coil: coil.number,
            x_m: coil.axis_m[0],
            y_m: coil.axis_m[1],
            current_a: currents.map_or(0.0, |currents| currents[coil.number]),
        })
        .collect()
}
