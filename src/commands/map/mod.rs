//! `map`: gradient maps over the workspace, and the map's files.

pub(crate) mod command;
pub mod mag_manip;
mod multipoles;
mod vector_field;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use self::mag_manip::{MULTIPOLE_TOLERANCE, MagManipRequest, MultipolesMade, VectorFieldMade};
use crate::RunError;
use crate::accuracy::missed;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, Options, SCHEMA_VERSION, UNITS};
use crate::bundle::manifest::{
    AxisSummary, Interpolation, MapSidecar, MapSummary, WorkingPointMap,
};
use crate::bundle::npz::{MapArrays, Runtime, WORKING_POINT};
use crate::bundle::write::{Beside, BesideContent, MapFormats, check_map_files, write_map_and};
use crate::design::Design;
use crate::map::coupled_map::TableReport;
use crate::map::tabulate::Grid;
use crate::map::{Components, FieldMap, InterpolationError};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::maps::{MagnetMean, SceneMap};
use crate::scene::steel;
use crate::scene::working_point::{WorkingPoint, relative_difference, superposition_ends};

/// What is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct MapRequest {
    /// What the map holds.
    pub components: Components,
    /// Tolerance; `None` for the default.
    pub tolerance: Option<f64>,
    /// Currents of the working point, A, one a coil; `None` for the rated ones. Without a B-H
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
}

impl MapRequest {
    /// As the record states them: what they change in the map's files.
    fn made_with(&self) -> Options {
        #[derive(Serialize)]
        struct Asked<'a> {
            components: &'static str,
            tolerance: Option<f64>,
            currents_a: Option<&'a [f64]>,
            vfield_nodes: Option<usize>,
            mpem_tolerance: Option<f64>,
        }
        let MapRequest {
            components,
            tolerance,
            currents_a,
            out: _,
            formats: _,
            mag_manip,
            force: _,
        } = self;
        let MagManipRequest {
            vector_field: _,
            nodes,
            multipoles: _,
            tolerance: mpem_tolerance,
        } = mag_manip;
        Options::of(&Asked {
            components: components_name(*components),
            tolerance: *tolerance,
            currents_a: currents_a.as_deref(),
            vfield_nodes: *nodes,
            mpem_tolerance: *mpem_tolerance,
        })
    }
}

/// What was made.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct MapReport {
    /// `map.json` as written.
    pub sidecar: MapSidecar,
    /// Folder of the files.
    pub folder: PathBuf,
    /// Nodes times coils.
    pub point_coils: usize,
    /// Distinct distances from the coils' axes.
    pub distinct_radii: usize,
    /// Whether radial tables replaced direct sums.
    pub tabulated: bool,
    /// The compact form of a coupled array's steel, where there is one.
    pub table: Option<TableReport>,
    /// The field on nodes for mag_manip, where asked for.
    pub vector_field: Option<VectorFieldMade>,
    /// The multipole sources for mag_manip, where asked for.
    pub multipoles: Option<MultipolesMade>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
    /// Whether the tolerance asked for was reached.
    pub accuracy_reached: bool,
    /// What misses it.
    pub accuracy_missed: Vec<String>,
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
    let scene = Scene::with_tolerance(design, request.tolerance)?;
    let asked = &request.mag_manip;
    let besides = [&asked.vector_field, &asked.multipoles];
    let besides: Vec<&Path> = besides
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let protected: Vec<PathBuf> = design
        .curve_file()
        .map(Path::to_path_buf)
        .into_iter()
        .collect();
    let made_with = request.made_with();
    check_map_files(
        &request.out,
        request.force,
        (&inputs, &made_with),
        &protected,
        request.formats,
        &besides,
    )?;
    let nodes = (asked.vector_field.as_ref())
        .map(|path| Ok::<_, RunError>((path, vector_field::nodes(&scene, asked.nodes)?)))
        .transpose()?;
    let grid = workspace_grid(design);
    let lowest_m = grid.z_m.first().copied().unwrap_or(0.0);
    let lowest_m = (nodes.as_ref()).map_or(lowest_m, |(_, [_, _, z])| lowest_m.min(z.from));
    progress.begin("steel", 1);
    let solved = steel::solve(&scene, scene.tolerances.map, lowest_m)?;
    progress.end();
    let made = SceneMap::new(
        &scene,
        &solved,
        &scene.coils,
        &grid,
        request.components,
        &MagnetMean::field(),
        progress,
    )?;
    let map = &made.map;
    let mut summary = summary(map, request.components, made.between);
    let mut accuracy = BTreeMap::from([("map".to_owned(), made.accuracy.clone())]);
    let currents_a = request.currents_a.as_deref().unwrap_or(&scene.upper_a);
    progress.begin("working point", 1);
    let point = WorkingPoint::new(&scene, &solved, currents_a, lowest_m)?;
    let mut whole = None;
    let mut warnings = scene
        .core
        .as_ref()
        .map_or_else(Vec::new, |core| core.warnings.clone());
    if let Some(point) = &point {
        let gz = point.gz_t_per_m(&scene, &grid, progress)?;
        let deviation_from_linear = deviation(&gz, map, currents_a);
        accuracy.insert("working_point".to_owned(), point.accuracy());
        warnings.extend(superposition_ends(
            &scene,
            deviation_from_linear,
            &point.peak_field_t,
            "the maps",
        ));
        summary.working_point = Some(WorkingPointMap {
            array: WORKING_POINT.to_owned(),
            currents_a: currents_a.to_vec(),
            deviation_from_linear,
            peak_field_t: point.peak_field_t.clone(),
            mean_field_t: point.mean_field_t.clone(),
        });
        whole = Some(gz);
    }
    progress.end();
    progress.check()?;
    let vector_field = nodes
        .map(|(path, axes)| vector_field::make(&scene, &solved, path.clone(), axes, progress))
        .transpose()?;
    let multipoles = (asked.multipoles.as_ref())
        .map(|path| {
            let tolerance = asked.tolerance.unwrap_or(MULTIPOLE_TOLERANCE);
            let own_error = made.accuracy.estimate;
            multipoles::make(
                &scene,
                &solved,
                path.clone(),
                tolerance,
                own_error,
                progress,
            )
        })
        .transpose()?;
    let stages = [
        (
            ["vfield", "vfield_gradient"],
            vector_field.as_ref().map(|v| &v.accuracy),
        ),
        (
            ["mpem", "mpem_gradient"],
            multipoles.as_ref().map(|m| &m.accuracy),
        ),
    ];
    for (names, stages) in stages {
        for (name, stage) in names.iter().zip(stages.into_iter().flatten()) {
            accuracy.insert((*name).to_owned(), stage.clone());
        }
    }
    progress.check()?;
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
    let runtime = runtime(&scene, None);
    let mut arrays = arrays(map, runtime);
    arrays.working_point_gz_t_per_m = whole.map(Cow::Owned);
    progress.begin("write", 1);
    let nodes = vector_field
        .as_ref()
        .map(|v| (&v.path, v.content(&design.name)));
    let sources = multipoles
        .as_ref()
        .map(|m| (&m.path, m.content(&design.name)));
    let mut besides = Vec::new();
    besides.extend(nodes.as_ref().map(|(path, content)| Beside {
        path,
        content: BesideContent::VectorField(content),
    }));
    besides.extend(sources.as_ref().map(|(path, content)| Beside {
        path,
        content: BesideContent::Multipoles(content),
    }));
    let sidecar = write_map_and(
        &request.out,
        request.force,
        &sidecar,
        &arrays,
        request.formats,
        &besides,
        &protected,
    )?;
    progress.end();
    let accuracy_missed = missed(&sidecar.accuracy, solved.tolerance);
    Ok(MapReport {
        sidecar,
        folder: request.out.clone(),
        point_coils: map.gz_t_per_m_per_a.len(),
        distinct_radii: map.distinct_radii,
        tabulated: map.tabulated,
        table: made.table,
        vector_field,
        multipoles,
        warnings,
        accuracy_reached: accuracy_missed.is_empty(),
        accuracy_missed,
    })
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

/// How artefacts and the command line call the components.
pub(crate) fn components_name(components: Components) -> &'static str {
    match components {
        Components::Gz => "gz",
        Components::Gradient => "gradient",
        Components::All => "all",
    }
}

/// The map's grid, coils and interpolation as artefacts tell them.
pub(crate) fn summary(
    map: &FieldMap,
    components: Components,
    between: InterpolationError,
) -> MapSummary {
    let definition = format!(
        "of dB_z/dz, relative to the largest |dB_z/dz| at that height: 1.25 times the largest \
         difference from direct values at {} places in the middles of cells, faces and edges, in the four \
         lowest layers and the highest, where it is largest, of the innermost and the outermost coil",
        between.samples
    );
    MapSummary {
        x_m: AxisSummary::of_nodes(&map.x_m),
        y_m: AxisSummary::of_nodes(&map.y_m),
        z_m: AxisSummary::of_nodes(&map.z_m),
        coil: indices(map),
        components: components_name(components).to_owned(),
        interpolation: Interpolation::tricubic(between.largest, definition),
        passive_force: None,
        working_point: None,
    }
}

/// What a runtime needs besides the map.
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
pub(crate) fn arrays(map: &FieldMap, runtime: Runtime) -> MapArrays<'_> {
    MapArrays {
        x_m: Cow::Borrowed(&map.x_m),
        y_m: Cow::Borrowed(&map.y_m),
        z_m: Cow::Borrowed(&map.z_m),
        coil: Cow::Owned(indices(map)),
        gz_t_per_m_per_a: Cow::Borrowed(&map.gz_t_per_m_per_a),
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
