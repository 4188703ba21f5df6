//! `map`: gradient maps over the workspace, and the map's files.

pub(crate) mod command;
pub(crate) mod fewest_nodes;
pub mod mag_manip;
mod multipoles;
mod picture;
mod text;
mod vector_field;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use self::fewest_nodes::fewest_nodes;
use self::mag_manip::{
    MagManipRequest, MultipolesMade, MultipolesSummary, VectorFieldMade, VectorFieldSummary,
};
pub use self::multipoles::MULTIPOLE_TOLERANCE;
use self::picture::picture;
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed};
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, Options, SCHEMA_VERSION, UNITS};
use crate::bundle::json::displayed;
use crate::bundle::manifest::{
    AxisSummary, Interpolation, MapSidecar, MapSummary, PassiveForce, SidesOfMap, WorkingPointMap,
};
use crate::bundle::npz::{MapArrays, PASSIVE, Runtime, SIDES, WORKING_POINT};
use crate::bundle::write::{Beside, BesideContent, MapFormats, check_map_files, write_map_and};
use crate::design::Design;
use crate::map::coupled_map::TableReport;
use crate::map::tabulate::Grid;
use crate::map::{Components, FieldMap};
use crate::plot::slices::SlicesPlot;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::maps::{MagnetMean, SceneMap};
use crate::scene::passive::PASSIVE_TOLERANCE;
use crate::scene::passive_map::PassiveMap;
use crate::scene::steel::{self, Solved};
use crate::scene::tolerances::ErrorTarget;
use crate::scene::working_point::{WorkingPoint, relative_difference, superposition_ends};

/// The stage of the unpowered steel's pull over a map.
pub const PASSIVE_STAGE: &str = "passive_force_map";

/// The options of `map`.
#[derive(Debug, Clone, PartialEq)]
pub struct MapRequest {
    /// The components of the map.
    pub components: Components,
    /// Tolerance; `None` for the default.
    pub tolerance: Option<f64>,
    /// The largest error of the map, at and between its nodes, which are as few as hold it.
    pub error: Option<ErrorTarget>,
    /// Currents of the working point, A, one per coil; `None` for the rated ones. Without a B-H
    /// curve there is no working point.
    pub currents_a: Option<Vec<f64>>,
    /// Folder of the files.
    pub out: PathBuf,
    /// Formats beside `map.npz`.
    pub formats: MapFormats,
    /// Files for mag_manip.
    pub mag_manip: MagManipRequest,
    /// Replace what is there, whatever it is.
    pub force: bool,
    /// Whether the force is drawn.
    pub picture: bool,
}

impl MapRequest {
    /// As the record states them: what they change in the map's files.
    fn made_with(&self) -> Options {
        #[derive(Serialize)]
        struct Recorded<'a> {
            components: Components,
            tolerance: Option<f64>,
            #[serde(skip_serializing_if = "Option::is_none")]
            error: Option<f64>,
            #[serde(skip_serializing_if = "std::ops::Not::not")]
            refine: bool,
            currents_a: Option<&'a [f64]>,
            vfield_nodes: Option<usize>,
            mpem_tolerance: Option<f64>,
        }
        let MapRequest {
            components,
            tolerance,
            error,
            currents_a,
            out: _,
            formats: _,
            mag_manip,
            force: _,
            picture: _,
        } = self;
        let MagManipRequest {
            vector_field: _,
            nodes,
            multipoles: _,
            tolerance: mpem_tolerance,
        } = mag_manip;
        Options::of(&Recorded {
            components: *components,
            tolerance: *tolerance,
            error: error.map(|target| target.error),
            refine: error.is_some_and(|target| target.refine),
            currents_a: currents_a.as_deref(),
            vfield_nodes: *nodes,
            mpem_tolerance: *mpem_tolerance,
        })
    }
}

/// The maps of a design. Serialised it is the JSON result.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct MapReport {
    /// `map.json` as written.
    #[serde(flatten)]
    pub sidecar: MapSidecar,
    /// The components of the map.
    #[serde(skip)]
    pub components: Components,
    /// Folder of the files.
    #[serde(serialize_with = "displayed")]
    pub folder: PathBuf,
    /// Nodes times coils.
    pub point_coils: usize,
    /// Distinct distances from the coils' axes.
    pub distinct_radii: usize,
    /// Whether radial tables replaced direct sums.
    pub tabulated: bool,
    /// The compact form of a coupled array's steel, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<CompactSteel>,
    /// The outcome of a requested error; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requested: Option<RequestedMap>,
    /// The field on nodes for mag_manip, where requested.
    #[serde(rename = "vfield", skip_serializing_if = "Option::is_none")]
    pub vector_field: Option<VectorFieldSummary>,
    /// The multipole sources for mag_manip, where requested.
    #[serde(rename = "mpem", skip_serializing_if = "Option::is_none")]
    pub multipoles: Option<MultipolesSummary>,
    /// The force that the maps stand for, where it is drawn.
    #[serde(skip)]
    pub picture: Option<SlicesPlot>,
    /// Warnings for the user.
    #[serde(skip)]
    pub warnings: Vec<String>,
    /// The stages that miss the requested tolerance.
    #[serde(skip)]
    pub accuracy_missed: Vec<String>,
}

/// The compact form that stands for the steel of a coupled array.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CompactSteel {
    /// Its size and its error; without a lowest height places are sampled one by one.
    #[serde(flatten)]
    pub report: TableReport,
    /// Memory of its coefficients.
    pub bytes: u64,
}

impl From<TableReport> for CompactSteel {
    fn from(report: TableReport) -> Self {
        let bytes = (report.coefficients * size_of::<f64>()) as u64;
        Self { report, bytes }
    }
}

/// Largest difference of `gz` from the sum of the coils' maps times their currents, relative to
/// the largest value at the same height.
fn deviation(gz: &[f64], map: &FieldMap, currents_a: &[f64]) -> f64 {
    let plane = map.x_m.len() * map.y_m.len();
    let mut sum = vec![0.0; gz.len()];
    for (coil, values) in map
        .coils
        .iter()
        .zip(map.gz_t_per_m_per_a.chunks_exact(gz.len()))
    {
        for (sum, value) in sum.iter_mut().zip(values) {
            *sum += currents_a[*coil] * value;
        }
    }
    gz.chunks_exact(plane)
        .zip(sum.chunks_exact(plane))
        .map(|(values, others)| relative_difference(values, others))
        .fold(0.0, f64::max)
}

/// Tabulates the maps of `design` and writes them.
///
/// # Errors
/// A design that cannot be computed; an output that must not be replaced or cannot be written.
pub fn run(
    design: &Design,
    inputs: Vec<Input>,
    request: &MapRequest,
    progress: &dyn Progress,
) -> Result<MapReport, RunError> {
    let of_error = request.error.filter(|_| design.has_steel());
    let tolerance = request.tolerance.or(of_error.map(ErrorTarget::tolerance));
    let scene = Scene::with_tolerance(design, tolerance)?;
    let mag_manip = &request.mag_manip;
    let files = scene.files.iter();
    let protected: Vec<PathBuf> = files.map(|file| file.file.path.clone()).collect();
    // Refused before anything is computed.
    let made_with = request.made_with();
    let beside = [&mag_manip.vector_field, &mag_manip.multipoles];
    let beside: Vec<&Path> = beside.into_iter().flatten().map(PathBuf::as_path).collect();
    check_map_files(
        &request.out,
        request.force,
        (&inputs, &made_with),
        &protected,
        request.formats,
        &beside,
    )?;
    let made = Made::new(&scene, request, progress)?;
    let mut summary = summary(&made.map, request.components);
    let mut arrays = arrays(&made.map, runtime(&scene, None));
    if let Some(together) = &made.together {
        summary.working_point = Some(together.summary.clone());
        arrays.working_point_gz_t_per_m = Some(Cow::Borrowed(&together.gz_t_per_m));
    }
    let mut accuracy = made.accuracy();
    if let Some(passive) = &made.passive {
        add_pull(passive, &mut summary, &mut accuracy);
        arrays.passive_force_n = Some(Cow::Borrowed(&passive.force_z_n));
    }
    let sidecar = MapSidecar {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: design.name.clone(),
        inputs,
        made_with,
        units: UNITS.to_owned(),
        array: scene.array_geometry(),
        magnet: scene.magnet_summary(),
        map: summary,
        accuracy,
        files: Vec::new(),
    };
    progress.begin("write", 1);
    let nodes = (made.vector_field.as_ref()).map(|v| (&v.path, v.content(&design.name)));
    let sources = (made.multipoles.as_ref()).map(|m| (&m.path, m.content(&design.name)));
    let nodes = nodes.as_ref().map(|(path, content)| Beside {
        path,
        content: BesideContent::VectorField(content),
    });
    let sources = sources.as_ref().map(|(path, content)| Beside {
        path,
        content: BesideContent::Multipoles(content),
    });
    let beside: Vec<Beside> = nodes.into_iter().chain(sources).collect();
    let sidecar = write_map_and(
        &request.out,
        request.force,
        &sidecar,
        &arrays,
        request.formats,
        &beside,
        &protected,
    )?;
    progress.end();
    let picture = (request.picture).then(|| picture(design, &arrays, &scene.rated_currents_a()));
    drop(arrays);
    Ok(made.report(&scene, request, sidecar, picture))
}

/// The unpowered steel's pull on the map's nodes, where the design asks for it.
pub(crate) fn passive_map(
    scene: &Scene,
    map: &FieldMap,
    progress: &dyn Progress,
) -> Result<Option<PassiveMap>, RunError> {
    if !scene.design.magnet.passive_force || scene.steel_extent_m().is_none() {
        return Ok(None);
    }
    progress.begin("passive force", 1);
    let grid = Grid {
        x_m: map.x_m.clone(),
        y_m: map.y_m.clone(),
        z_m: map.z_m.clone(),
    };
    let passive = PassiveMap::new(scene, &grid, PASSIVE_TOLERANCE)?;
    progress.end();
    Ok(passive)
}

/// Adds the pull to a map's description and its stages.
pub(crate) fn add_pull(
    passive: &PassiveMap,
    map: &mut MapSummary,
    accuracy: &mut BTreeMap<String, StageAccuracy>,
) {
    accuracy.insert(PASSIVE_STAGE.to_owned(), passive.accuracy.clone());
    map.passive_force = Some(PassiveForce {
        array: PASSIVE.to_owned(),
        largest_n: passive.largest_n,
        interpolation: Interpolation::tricubic(passive.between, passive.definition()),
    });
}

/// The maps of `design` in memory, nothing written.
///
/// # Errors
/// A design that cannot be computed; interruption.
pub fn tabulated(
    design: &Design,
    components: Components,
    tolerance: Option<f64>,
    progress: &dyn Progress,
) -> Result<SceneMap, RunError> {
    let scene = Scene::with_tolerance(design, tolerance)?;
    let grid = workspace_grid(design);
    let lowest_m = grid.z_m.first().copied().unwrap_or(0.0);
    let solved = solved(&scene, lowest_m, progress)?;
    own_map(&scene, &solved, &grid, components, progress)
}

fn solved(scene: &Scene, lowest_m: f64, progress: &dyn Progress) -> Result<Solved, RunError> {
    progress.begin("steel", 1);
    let solved = steel::solve(scene, scene.tolerances.map, lowest_m)?;
    progress.end();
    Ok(solved)
}

/// The field itself over `grid`, of every coil.
fn own_map(
    scene: &Scene,
    solved: &Solved,
    grid: &Grid,
    components: Components,
    progress: &dyn Progress,
) -> Result<SceneMap, RunError> {
    let (coils, mean) = (&scene.coils, MagnetMean::field());
    SceneMap::new(scene, solved, coils, grid, components, &mean, progress)
}

/// Everything that is computed for the files.
struct Made {
    solved: Solved,
    map: SceneMap,
    passive: Option<PassiveMap>,
    together: Option<Together>,
    vector_field: Option<VectorFieldMade>,
    multipoles: Option<MultipolesMade>,
}

impl Made {
    fn new(scene: &Scene, request: &MapRequest, progress: &dyn Progress) -> Result<Self, RunError> {
        let mag_manip = &request.mag_manip;
        let nodes = (mag_manip.vector_field.as_ref())
            .map(|path| Ok::<_, RunError>((path, vector_field::nodes(scene, mag_manip.nodes)?)))
            .transpose()?;
        // The steel is solved once, for the lowest of the workspace and of mag_manip's nodes.
        let grid = workspace_grid(scene.design);
        let lowest_m = grid.z_m.first().copied().unwrap_or(0.0);
        let lowest_m = (nodes.as_ref()).map_or(lowest_m, |(_, [_, _, z])| lowest_m.min(z.from));
        let solved = solved(scene, lowest_m, progress)?;
        let (grid, map, passive) = match request
            .error
            .filter(|target| target.refine || !scene.design.workspace.is_given)
        {
            None => {
                let map = own_map(scene, &solved, &grid, request.components, progress)?;
                let passive = passive_map(scene, &map.map, progress)?;
                (grid, map, passive)
            }
            Some(target) => map_within(scene, &solved, target, request.components, progress)?,
        };
        let tabulated = (&grid, &map.map, lowest_m);
        let together = Together::new(scene, &solved, tabulated, request, progress)?;
        progress.check()?;
        let vector_field = nodes
            .map(|(path, axes)| vector_field::make(scene, &solved, path.clone(), axes, progress))
            .transpose()?;
        let multipoles = (mag_manip.multipoles.as_ref())
            .map(|path| {
                let tolerance = mag_manip.tolerance.unwrap_or(MULTIPOLE_TOLERANCE);
                let (path, own_error) = (path.clone(), map.accuracy.estimate);
                multipoles::make(scene, &solved, path, tolerance, own_error, progress)
            })
            .transpose()?;
        progress.check()?;
        Ok(Self {
            solved,
            map,
            passive,
            together,
            vector_field,
            multipoles,
        })
    }

    /// Each stage's estimated error.
    fn accuracy(&self) -> BTreeMap<String, StageAccuracy> {
        let mut accuracy = BTreeMap::from([("map".to_owned(), self.map.accuracy.clone())]);
        let together = self.together.as_ref();
        let stage = together.map(|t| ("working_point".to_owned(), t.accuracy.clone()));
        accuracy.extend(stage);
        let of_curve = self.solved.curve_stages();
        accuracy.extend(of_curve.map(|(name, stage)| (name.to_owned(), stage)));
        let vfield = self.vector_field.as_ref().map(|made| &made.accuracy);
        let mpem = self.multipoles.as_ref().map(|made| &made.accuracy);
        for (names, stages) in [
            (["vfield", "vfield_gradient"], vfield),
            (["mpem", "mpem_gradient"], mpem),
        ] {
            let stages = stages.into_iter().flatten().cloned();
            accuracy.extend(names.map(str::to_owned).into_iter().zip(stages));
        }
        accuracy
    }

    fn report(
        self,
        scene: &Scene,
        request: &MapRequest,
        sidecar: MapSidecar,
        picture: Option<SlicesPlot>,
    ) -> MapReport {
        let core = scene.core.as_ref();
        let mut warnings = core.map_or_else(Vec::new, |core| core.warnings.clone());
        warnings.extend(self.solved.above_knee(scene));
        warnings.extend(scene.iron.iter().flat_map(|iron| iron.put_right.clone()));
        warnings.extend(self.together.and_then(|together| together.warning));
        let requested = request
            .error
            .map(|target| RequestedMap::new(&self.map, self.passive.as_ref(), target));
        let over = requested.zip(request.error);
        warnings.extend(over.filter(|(requested, _)| !requested.met).map(|(requested, target)| {
            let advice = if scene.design.workspace.is_given && !target.refine {
                "; the design gives the nodes of [workspace], which are obeyed (--refine chooses them)"
            } else {
                "; no more nodes are tried: a workspace that begins higher above the coils helps"
            };
            target.exceeded("the map is off by up to", requested.largest(), advice)
        }));
        warnings.extend(self.passive.and_then(|passive| passive.warning));
        MapReport {
            accuracy_missed: missed(&sidecar.accuracy, self.solved.tolerance),
            sidecar,
            components: request.components,
            folder: request.out.clone(),
            point_coils: self.map.map.gz_t_per_m_per_a.len(),
            distinct_radii: self.map.map.distinct_radii,
            tabulated: self.map.map.tabulated,
            table: self.map.table.map(CompactSteel::from),
            requested,
            vector_field: self.vector_field.map(|made| made.summary),
            multipoles: self.multipoles.map(|made| made.summary),
            picture,
            warnings,
        }
    }
}

/// The map of all coils together at given currents, their steel along its B-H curve.
struct Together {
    summary: WorkingPointMap,
    gz_t_per_m: Vec<f64>,
    accuracy: StageAccuracy,
    /// Where the sum of the coils' maps is too far off.
    warning: Option<String>,
}

impl Together {
    /// `None` without a B-H curve. The grid comes with its map and the lowest height that the steel
    /// was solved for.
    fn new(
        scene: &Scene,
        solved: &Solved,
        (grid, map, lowest_m): (&Grid, &FieldMap, f64),
        request: &MapRequest,
        progress: &dyn Progress,
    ) -> Result<Option<Self>, RunError> {
        let rated_a = scene.rated_currents_a();
        let currents_a = request.currents_a.as_deref().unwrap_or(&rated_a);
        progress.begin("working point", 1);
        let point = WorkingPoint::new(scene, solved, currents_a, lowest_m)?;
        let Some(point) = point else {
            progress.end();
            return Ok(None);
        };
        let gz_t_per_m = point.gz_t_per_m(scene, grid, progress)?;
        progress.end();
        let deviation_from_linear = deviation(&gz_t_per_m, map, currents_a);
        let peak_field_t = &point.peak_field_t;
        let warning = superposition_ends(scene, deviation_from_linear, peak_field_t, "the maps");
        let accuracy = point.accuracy();
        Ok(Some(Self {
            gz_t_per_m,
            accuracy,
            warning,
            summary: WorkingPointMap {
                array: WORKING_POINT.to_owned(),
                currents_a: currents_a.to_vec(),
                deviation_from_linear,
                peak_field_t: point.peak_field_t,
                mean_field_t: point.mean_field_t,
            },
        }))
    }
}

/// The outcome of a requested error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RequestedMap {
    /// Requested of the map, at and between its nodes, relative to the largest |dB_z/dz| at the height; of dB_x/dz and
    /// dB_y/dz in a map of the force, relative to the largest of each.
    pub error: f64,
    /// Whether it holds, of the pull too.
    pub met: bool,
    /// The error.
    pub of_map: f64,
    /// That of the unpowered steel's pull, relative to the largest one at the height; where the design includes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of_pull: Option<f64>,
}

impl RequestedMap {
    fn new(made: &SceneMap, passive: Option<&PassiveMap>, target: ErrorTarget) -> Self {
        let mut requested = Self {
            error: target.error,
            met: false,
            of_map: made.accuracy.estimate + largest_between(made),
            of_pull: passive.map(|pull| pull.accuracy.estimate + pull.between),
        };
        requested.met = requested.largest() <= target.error;
        requested
    }

    fn largest(&self) -> f64 {
        self.of_map.max(self.of_pull.unwrap_or(0.0))
    }
}

/// Share of the requested error that is left to interpolation at least.
const OF_INTERPOLATION: f64 = 0.1;

/// The map of the fewest nodes that hold a requested error, that of the pull too, or of the last that were tried.
fn map_within(
    scene: &Scene,
    solved: &Solved,
    target: ErrorTarget,
    components: Components,
    progress: &dyn Progress,
) -> Result<(Grid, SceneMap, Option<PassiveMap>), RunError> {
    // More nodes do not help where they are off themselves.
    let over = |between: f64, at_nodes: f64| {
        between / (target.error - at_nodes).max(OF_INTERPOLATION * target.error)
    };
    // Of the field and the whole gradient the vertical component alone is judged.
    let judged = match components {
        Components::Force => Components::Force,
        Components::Gz | Components::Gradient | Components::All => Components::Gz,
    };
    let (grid, (trial, passive)) = fewest_nodes(scene, Grid::clone, |grid| {
        progress.check()?;
        let trial = own_map(scene, solved, grid, judged, progress)?;
        let mut excess = over(largest_between(&trial), trial.accuracy.estimate);
        let mut passive = None;
        // The pull's map costs more: it is made once the field's holds.
        if excess <= 1.0 {
            passive = passive_map(scene, &trial.map, progress)?;
            let of_pull = passive
                .as_ref()
                .map(|pull| over(pull.between, pull.accuracy.estimate));
            excess = excess.max(of_pull.unwrap_or(0.0));
        }
        Ok((excess, (trial, passive)))
    })?;
    let map = if components == judged {
        trial
    } else {
        own_map(scene, solved, &grid, components, progress)?
    };
    let passive = match passive {
        None => passive_map(scene, &map.map, progress)?,
        made => made,
    };
    Ok((grid, map, passive))
}

/// The interpolation error of the vertical component and, where the map holds them alone, of the sideways ones.
fn largest_between(made: &SceneMap) -> f64 {
    let sides = made.sides_between.iter().flatten();
    sides
        .map(|side| side.largest)
        .fold(made.between.largest, f64::max)
}

/// The nodes of the design's workspace.
pub(crate) fn workspace_grid(design: &Design) -> Grid {
    let workspace = &design.workspace;
    Grid {
        x_m: workspace.x_m.nodes(),
        y_m: workspace.y_m.nodes(),
        z_m: workspace.z_m.nodes(),
    }
}

/// The map's grid, coils and interpolation as artefacts state them.
pub(crate) fn summary(made: &SceneMap, components: Components) -> MapSummary {
    let (map, between) = (&made.map, made.between);
    let definition = format!(
        "of dB_z/dz, relative to the largest |dB_z/dz| at that height (of the nodes around it, where that is \
         smaller): 1.25 times the largest difference from direct values at {} places in the middles of cells, faces \
         and edges, in the four lowest layers, the highest and those in which the map changes faster, of the innermost \
         and the outermost coil, of those whose axes are nearest to a node and to the middle of a cell, and of the one \
         whose map changes fastest",
        between.samples
    );
    MapSummary {
        x_m: AxisSummary::of_nodes(&map.x_m),
        y_m: AxisSummary::of_nodes(&map.y_m),
        z_m: AxisSummary::of_nodes(&map.z_m),
        coil: indices(map),
        components: components.name().to_owned(),
        interpolation: Interpolation::tricubic(between.largest, definition),
        sides: made.sides_between.map(|errors| SidesOfMap {
            arrays: SIDES.map(str::to_owned),
            largest_error: errors.map(|error| error.largest),
        }),
        passive_force: None,
        working_point: None,
    }
}

/// The numbers that a runtime needs beside the map.
pub(crate) fn runtime(scene: &Scene, lambda_n_per_m: Option<f64>) -> Runtime {
    Runtime {
        moment_a_m2: scene.moment_a_m2,
        current_min_a: scene.lower_a.clone(),
        current_max_a: scene.upper_a.clone(),
        resistance_ohm: scene.resistances_ohm(),
        total_current_max_a: scene.design.supply.total_current_max_a,
        lambda_n_per_m,
        rendering: None,
    }
}

/// The map as arrays of `map.npz`, borrowed.
pub(crate) fn arrays(made: &SceneMap, runtime: Runtime) -> MapArrays<'_> {
    let map = &made.map;
    let sides = made.sides.as_ref();
    MapArrays {
        x_m: Cow::Borrowed(&map.x_m),
        y_m: Cow::Borrowed(&map.y_m),
        z_m: Cow::Borrowed(&map.z_m),
        coil: Cow::Owned(indices(map)),
        gz_t_per_m_per_a: Cow::Borrowed(&map.gz_t_per_m_per_a),
        sides_t_per_m_per_a: sides.map(|sides| sides.each_ref().map(|side| Cow::Borrowed(&**side))),
        gradient_t_per_m_per_a: map.gradient_t_per_m_per_a.as_deref().map(Cow::Borrowed),
        field_t_per_a: map.field_t_per_a.as_deref().map(Cow::Borrowed),
        passive_force_n: None,
        working_point_gz_t_per_m: None,
        runtime,
    }
}

fn indices(map: &FieldMap) -> Vec<i64> {
    map.coils.iter().map(|coil| *coil as i64).collect()
}
