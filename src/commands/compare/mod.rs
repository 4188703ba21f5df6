//! `compare`: how differently the rendered forces of several objects feel.
//!
//! Two objects are compared where a finger would touch either of them: at the points of both
//! surfaces. Both are rendered there, with the static currents of each, which give a force anywhere
//! above the coils, and with position feedback, lambda h(x, y) by the currents of least power as in
//! `replay`, zero beside the object, the nearest force where the limits bind.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::Serialize;

use super::calibrate::requested_force::on_grid;
use super::discretize::{PointsReport, point_rows, points_grid};
use super::lambda::error_target::ErrorTarget;
use super::lambda::{ForcePoints, LambdaOptions, error_of_points, object_points, proven_accuracy};
use crate::RunError;
use crate::accuracy::{StageAccuracy, missed};
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::bundle::rendering::HeightGrid;
use crate::design::Design;
use crate::force_direction::RequestedForce;
use crate::lambda::{
    self, Allocator, Criterion, ForceProblem, Reach, SIDEWAYS_WEIGHT, Settings, Solution, Status,
    VectorAllocator,
};
use crate::plot::slices::Slice;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::core_material::Material;
use crate::scene::cost::{Cost, of_comparison};
use crate::scene::passive::{self, Pull};
use crate::scene::sources::{ShapeSource, check_names};
use crate::scene::steel;
use crate::scene::steel::Solved;
use crate::units::DETECTION_THRESHOLD_N;

pub(crate) mod command;
pub mod difference;
mod pictures;
mod text;

use difference::{Difference, Felt, Sides, difference};

/// Places handed to one thread at a time; fixed, so that bytes do not depend on threads.
const PORTION: usize = 4096;

/// The options of `compare`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompareOptions {
    /// One force constant for all objects, N/m; `None`: each at its own `lambda_jnd`.
    pub lambda_n_per_m: Option<f64>,
    /// The just-noticeable relative difference of force, > 0.
    pub jnd: f64,
    /// Tolerance of the forces; `None` for the default.
    pub tolerance: Option<f64>,
    /// Keep where the objects differ, for [`CompareReport::map`].
    pub maps: bool,
}

/// The comparison, SI. Serialised it is the JSON result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CompareReport {
    /// Layout of the artefact.
    pub schema_version: &'static str,
    /// Program that wrote it.
    pub fluxform_version: &'static str,
    /// Name of the design.
    pub design: String,
    /// Input files, paths as given on the command line.
    pub inputs: Vec<Input>,
    /// Forces that differ by this part are just distinguished.
    pub jnd: f64,
    /// Forces that differ by less are not distinguished, whatever their size, N.
    pub threshold_n: f64,
    /// How each lambda was chosen: `jnd`, or `given`.
    pub criterion: &'static str,
    /// The objects, in the order given.
    pub shapes: Vec<ComparedShape>,
    /// Every two of them.
    pub pairs: Vec<Pair>,
    /// Errors of the forces and of the differences.
    pub accuracy: BTreeMap<&'static str, StageAccuracy>,
    /// Where every two differ, if that was requested.
    #[serde(skip)]
    pub maps: Vec<Slice>,
    /// Warnings for the user.
    #[serde(skip)]
    pub warnings: Vec<String>,
    /// The stages that miss the requested tolerance.
    #[serde(skip)]
    pub accuracy_missed: Vec<String>,
}

/// One object as rendered.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedShape {
    /// Its name.
    pub shape: String,
    /// Number of its points.
    pub points: usize,
    /// Its force constant, N/m; null where nothing can be rendered or no limit binds.
    pub lambda_n_per_m: Option<f64>,
    /// Estimated relative error of that by the number of points and their heights; null where it was given.
    pub lambda_error: Option<f64>,
    /// Its static currents, A.
    pub currents_a: Option<Vec<f64>>,
    /// Share of its points at which the limits bind with position feedback.
    pub saturated_share: Option<f64>,
}

/// Two objects. The differences are null where either has no force constant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pair {
    /// Name of the first.
    pub a: String,
    /// Name of the second.
    pub b: String,
    /// Largest difference with static currents, in just-noticeable differences.
    pub static_jnd: Option<f64>,
    /// Largest difference with position feedback, in just-noticeable differences; at most 2/jnd.
    pub feedback_jnd: Option<f64>,
    /// Root mean square of the differences with static currents, each surface counting half.
    pub static_rms_jnd: Option<f64>,
    /// The same with position feedback.
    pub feedback_rms_jnd: Option<f64>,
    /// Share of the places where static currents differ by more than one.
    pub static_felt_share: Option<f64>,
    /// The same with position feedback.
    pub feedback_felt_share: Option<f64>,
    /// Largest difference of all components with static currents, in just-noticeable differences.
    pub static_vector_jnd: Option<f64>,
    /// The same with position feedback.
    pub feedback_vector_jnd: Option<f64>,
    /// Root mean square of the differences of all components with static currents.
    pub static_vector_rms_jnd: Option<f64>,
    /// The same with position feedback.
    pub feedback_vector_rms_jnd: Option<f64>,
    /// Where static currents differ most.
    pub static_at: Option<Place>,
    /// Where it is with position feedback.
    pub feedback_at: Option<Place>,
}

/// A place and the forces there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// The object on whose surface it lies.
    pub on: String,
    /// m.
    pub x_m: f64,
    /// m.
    pub y_m: f64,
    /// m.
    pub z_m: f64,
    /// Upward force of the first object, N.
    pub a_force_n: f64,
    /// Upward force of the second, N.
    pub b_force_n: f64,
    /// Force of the first along x, y and z, N.
    pub a_vector_n: [f64; 3],
    /// Force of the second.
    pub b_vector_n: [f64; 3],
}

/// An object made ready.
struct Object {
    points: PointsReport,
    positions_m: Vec<[f64; 3]>,
    heights: HeightGrid,
    /// N/A, [point, coil].
    forces_n_per_a: Vec<[f64; 3]>,
    /// The force vector requested, on the nodes of `heights`; `None`: upward.
    direction: Option<Vec<f64>>,
    /// The force without currents, N.
    passive_n: Option<Vec<[f64; 3]>>,
    rendered: Option<Rendered>,
}

/// Of the upward force, and of all components.
#[derive(Clone)]
struct Allocators {
    upward: Allocator,
    vector: VectorAllocator,
}

/// Force constant and static currents of an object.
struct Rendered {
    lambda_n_per_m: f64,
    /// Relative; `None` of a constant that was given.
    error: Option<f64>,
    currents_a: Vec<f64>,
}

/// The memory that the comparison of `shapes` takes.
#[must_use]
pub fn cost(design: &Design, shapes: &[ShapeSource]) -> Cost {
    let documents: Vec<_> = shapes.iter().map(|shape| &shape.document).collect();
    let coils = design.array.positions_m.len();
    of_comparison(&documents, coils, 2 * size_of::<Felt>())
}

/// Forces of one object at the places of another.
#[derive(Debug, Clone, Default)]
struct RenderedForces {
    fixed: Vec<Felt>,
    feedback: Vec<Felt>,
    saturated: usize,
}

impl CompareOptions {
    /// The options by which `lambda` chooses points and force constant alike.
    fn of_lambda(&self) -> LambdaOptions {
        LambdaOptions {
            settings: Settings {
                criterion: Criterion::Jnd,
                jnd_weight: self.jnd,
                at_n_per_m: self.lambda_n_per_m,
            },
            tolerance: self.tolerance,
            default_error: Some(ErrorTarget::DEFAULT),
            ..LambdaOptions::default()
        }
    }
}

/// Compares every two of `shapes` on `design`.
///
/// # Errors
/// Two shapes of one name; a design or shape that cannot be computed; interruption.
pub fn run(
    design: &Design,
    shapes: &[ShapeSource],
    design_input: &Input,
    options: &CompareOptions,
    progress: &dyn Progress,
) -> Result<CompareReport, RunError> {
    check_names(shapes)?;
    let scene = Scene::with_tolerance(design, options.tolerance)?;
    let of_shapes = shapes.iter().filter_map(|shape| shape.input.clone());
    let inputs: Vec<Input> = std::iter::once(design_input.clone())
        .chain(of_shapes)
        .collect();
    let of_lambda = options.of_lambda();
    let points = shapes
        .iter()
        .map(|shape| {
            let of_shape = of_lambda.for_document(&shape.document);
            let inputs = inputs.clone();
            object_points(&scene, &shape.document, inputs, &of_shape, progress)
        })
        .collect::<Result<Vec<_>, RunError>>()?;
    let lowest_m = points.iter().fold(f64::INFINITY, |z, (_, points, _)| {
        z.min(points.lowest_place_m(&design.workspace))
    });
    progress.begin("steel", 1);
    let solved = steel::solve(&scene, scene.tolerances.forces, lowest_m)?;
    progress.end();
    let mut warnings = Vec::new();
    let objects = points
        .into_iter()
        .zip(shapes)
        .map(|((points, of_lambda_points, _), shape)| {
            let force = shape.document.force;
            Object::new(
                &scene,
                &solved,
                (points, of_lambda_points, force),
                &of_lambda.for_document(&shape.document),
                progress,
                &mut warnings,
            )
        })
        .collect::<Result<Vec<Object>, RunError>>()?;
    warnings.extend(of_steel(&scene));
    warnings.extend(solved.above_knee(&scene));
    let fields = fields(&scene, &objects, progress)?;
    let stage = proven_accuracy(&scene, &solved);
    let (pairs, error) = pairs(&objects, &fields, options.jnd, stage.estimate);
    let mut accuracy = BTreeMap::from([("forces", stage), ("difference", of_difference(error))]);
    accuracy.extend(solved.curve_stages());
    Ok(CompareReport {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: design.name.clone(),
        inputs,
        jnd: options.jnd,
        threshold_n: DETECTION_THRESHOLD_N,
        criterion: match options.lambda_n_per_m {
            Some(_) => "given",
            None => Criterion::Jnd.name(),
        },
        shapes: (objects.iter().zip(&fields).enumerate())
            .map(|(k, (object, fields))| object.compared(&fields[k]))
            .collect(),
        pairs,
        maps: match options.maps {
            true => pictures::maps(&objects, &fields, options.jnd),
            false => Vec::new(),
        },
        accuracy_missed: missed(&accuracy, solved.tolerance),
        accuracy,
        warnings,
    })
}

/// The largest error of the differences.
fn of_difference(estimate: f64) -> StageAccuracy {
    StageAccuracy {
        estimate,
        relative_to: "1 just-noticeable difference".to_owned(),
        method: "first order: the errors of every coil's force and of the force constants, at the points of both \
                 surfaces alone"
            .to_owned(),
    }
}

/// Remarks on the steel.
fn of_steel(scene: &Scene) -> Vec<String> {
    let Some(core) = &scene.core else {
        return Vec::new();
    };
    let mut warnings = core.warnings.clone();
    if matches!(core.material, Material::Curve(_)) {
        warnings.push(
            "the forces of several currents are added up, which holds as long as the steel is \
             linear; `lambda` states the change by the B-H curve at its currents"
                .to_owned(),
        );
    }
    warnings
}

impl Object {
    fn new(
        scene: &Scene,
        solved: &Solved,
        (points, of_lambda, force): (PointsReport, ForcePoints, RequestedForce),
        options: &LambdaOptions,
        progress: &dyn Progress,
        warnings: &mut Vec<String>,
    ) -> Result<Self, RunError> {
        let settings = &options.settings;
        let found = &points.discretized.points;
        let heights = HeightGrid::of_points(&points_grid(found), &point_rows(found));
        let heights = heights.ok_or_else(|| {
            RunError::Input("the shape's points do not fit their grid".to_owned())
        })?;
        let mut positions_m = of_lambda.positions_m.clone();
        let mut forces = scene.force_vectors_n_per_a(solved, &positions_m, progress)?;
        let upward: Vec<f64> = forces.iter().map(|force| force[2]).collect();
        let pull = passive::counted(scene, &positions_m)?;
        let of_pull = |pull: Pull| -> Vec<[f64; 3]> {
            positions_m
                .par_iter()
                .map(|at_m| pull.force_n(*at_m))
                .collect()
        };
        let mut passive_n = pull.map(of_pull);
        let upward_n = |passive: &Vec<[f64; 3]>| passive.iter().map(|force_n| force_n[2]).collect();
        let offset_n: Option<Vec<f64>> = passive_n.as_ref().map(upward_n);
        progress.begin("lambda", 1);
        let problem = ForceProblem {
            forces_n_per_a: &upward,
            height_m: &of_lambda.height_m,
            offset_n: offset_n.as_deref(),
            weights: of_lambda.weights(),
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: scene.design.supply.total_current_max_a,
            resistance_ohm: &scene.resistances_ohm(),
        };
        let solution = lambda::solve(&problem, settings)?;
        progress.end();
        let unusual = unusual(solution.status);
        let mut rendered = Rendered::of(solution, settings);
        if let (Some(rendered), None) = (&mut rendered, settings.at_n_per_m) {
            let (of, lambda) = ((scene, solved), rendered.lambda_n_per_m);
            let error = error_of_points(of, (&of_lambda, problem), options, lambda, progress)?;
            rendered.error = Some(error);
        }
        let none = rendered.is_none() && unusual.is_none();
        let none = none.then_some(
            "no force constant by the criterion jnd (`lambda` states why); give one with --lambda",
        );
        let name = &points.summary.shape;
        let own = points.summary.warnings.iter().map(String::as_str);
        let all = own.chain(unusual).chain(none);
        warnings.extend(all.map(|warning| format!("{name}: {warning}")));
        // Objects are compared at the points of their grids alone.
        let on_grid_points = found.height_m.len();
        positions_m.truncate(on_grid_points);
        forces.truncate(on_grid_points * scene.coils.len());
        if let Some(passive_n) = &mut passive_n {
            passive_n.truncate(on_grid_points);
        }
        Ok(Self {
            direction: on_grid(force, found).map(|requested| requested.direction),
            rendered,
            positions_m,
            heights,
            passive_n,
            points,
            forces_n_per_a: forces,
        })
    }

    fn name(&self) -> &str {
        &self.points.summary.shape
    }

    /// The object as rendered, with its own field at its points.
    fn compared(&self, own: &RenderedForces) -> ComparedShape {
        let (rendered, points) = (self.rendered.as_ref(), self.positions_m.len());
        ComparedShape {
            shape: self.name().to_owned(),
            points,
            lambda_n_per_m: rendered.map(|r| r.lambda_n_per_m),
            lambda_error: rendered.and_then(|r| r.error),
            currents_a: rendered.map(|r| r.currents_a.clone()),
            saturated_share: rendered.map(|_| own.saturated as f64 / points as f64),
        }
    }

    /// The force requested at a place over lambda, m; none beside the object.
    fn requested(&self, place: &[f64; 3]) -> [f64; 3] {
        let [x, y, _] = *place;
        match &self.direction {
            None => [0.0, 0.0, self.heights.height_m(x, y).unwrap_or(0.0)],
            Some(direction) => {
                let found = self.heights.height_and_direction(x, y, direction);
                let (height, direction) = found.unwrap_or((0.0, [0.0; 3]));
                direction.map(|part| height * part)
            }
        }
    }

    /// The field of `other` at this object's places.
    fn feels(&self, other: &Self, allocators: &Allocators) -> RenderedForces {
        let Some(rendered) = &other.rendered else {
            return RenderedForces::default();
        };
        let coils = allocators.upward.coils();
        let portions: Vec<RenderedForces> = self
            .positions_m
            .par_chunks(PORTION)
            .zip(self.forces_n_per_a.par_chunks(PORTION * coils))
            .enumerate()
            .map(|(portion, (places, rows))| {
                let mut allocators = allocators.clone();
                let mut currents = vec![0.0; coils];
                let mut upward = vec![0.0; coils];
                let mut field = RenderedForces::default();
                for (k, (place, row)) in places.iter().zip(rows.chunks_exact(coils)).enumerate() {
                    let passive = self.passive_n.as_ref();
                    let passive_n = passive.map_or([0.0; 3], |all| all[portion * PORTION + k]);
                    field
                        .fixed
                        .push(Felt::of(row, &rendered.currents_a, passive_n));
                    let [x, y, wanted_n] = other
                        .requested(place)
                        .map(|part| rendered.lambda_n_per_m * part);
                    // A runtime knows the upward pull alone.
                    let wanted_n = wanted_n - passive_n[2];
                    let reach = if other.direction.is_some() {
                        let target = [x, y, wanted_n];
                        allocators.vector.allocate(row, target, &mut currents).reach
                    } else {
                        for (upward, force) in upward.iter_mut().zip(row) {
                            *upward = force[2];
                        }
                        allocators
                            .upward
                            .allocate(&upward, wanted_n, &mut currents)
                            .reach
                    };
                    field.saturated += usize::from(reach == Reach::Saturated);
                    field.feedback.push(Felt::of(row, &currents, passive_n));
                }
                field
            })
            .collect();
        portions
            .into_iter()
            .fold(RenderedForces::default(), RenderedForces::joined)
    }
}

impl RenderedForces {
    fn joined(mut self, more: Self) -> Self {
        self.fixed.extend(more.fixed);
        self.feedback.extend(more.feedback);
        self.saturated += more.saturated;
        self
    }
}

impl Rendered {
    /// `None` also where a limit binds before any force is rendered.
    fn of(solution: Solution, settings: &Settings) -> Option<Self> {
        // A constant that was given is rendered as well as can be.
        let point = match settings.at_n_per_m {
            Some(_) => solution.at,
            None => solution.chosen,
        };
        let able = matches!(solution.status, Status::Solved | Status::Stalled);
        let point = point.filter(|point| able && point.lambda_n_per_m > 0.0);
        point.map(|point| Self {
            lambda_n_per_m: point.lambda_n_per_m,
            error: None,
            currents_a: point.currents_a,
        })
    }
}

fn unusual(status: Status) -> Option<&'static str> {
    match status {
        Status::Solved => None,
        Status::NothingWanted => {
            Some("every height is zero: no force is requested, lambda is null")
        }
        Status::NothingRendered => Some(
            "no currents within the limits, alike at all its points, push the magnet up on average: lambda is null",
        ),
        Status::Stalled => Some(
            "the path over lambda could not be followed to its end: its numbers are not the \
             minimum; please report this design and shape",
        ),
    }
}

/// `[surface][object]`.
fn fields(
    scene: &Scene,
    objects: &[Object],
    progress: &dyn Progress,
) -> Result<Vec<Vec<RenderedForces>>, RunError> {
    let total_a = scene.design.supply.total_current_max_a;
    let ohm = scene.resistances_ohm();
    let (lower_a, upper_a) = (&scene.lower_a, &scene.upper_a);
    let both = Allocator::new(&ohm, lower_a, upper_a, total_a).and_then(|upward| {
        let vector = VectorAllocator::new(&ohm, lower_a, upper_a, total_a, SIDEWAYS_WEIGHT)?;
        Ok(Allocators { upward, vector })
    });
    let allocators = both.map_err(|fault| RunError::Input(fault.to_string()))?;
    progress.begin("rendering", (objects.len() * objects.len()) as u64);
    let mut fields = Vec::with_capacity(objects.len());
    for surface in objects {
        let mut row = Vec::with_capacity(objects.len());
        for object in objects {
            progress.check()?;
            row.push(surface.feels(object, &allocators));
            progress.advance(1);
        }
        fields.push(row);
    }
    progress.end();
    Ok(fields)
}

/// Every two objects, and the largest error of their differences.
fn pairs(
    objects: &[Object],
    fields: &[Vec<RenderedForces>],
    jnd: f64,
    part: f64,
) -> (Vec<Pair>, f64) {
    let mut pairs = Vec::new();
    let mut error = 0.0_f64;
    for (i, a) in objects.iter().enumerate() {
        for (j, b) in objects.iter().enumerate().skip(i + 1) {
            let able = a.rendered.is_some() && b.rendered.is_some();
            let constants = [a, b].map(|object| {
                let rendered = object.rendered.as_ref();
                rendered.and_then(|r| r.error).unwrap_or(0.0)
            });
            let both = |pick: fn(&RenderedForces) -> &[Felt], whole: bool| {
                let of = |surface: usize, object: usize| -> Vec<Felt> {
                    let felt = pick(&fields[surface][object]).iter().copied();
                    felt.map(|one| if whole { one } else { one.upward() })
                        .collect()
                };
                able.then(|| {
                    let [ii, ij, ji, jj] = [of(i, i), of(i, j), of(j, i), of(j, j)];
                    difference([Sides { a: &ii, b: &ij }, Sides { a: &ji, b: &jj }], jnd)
                })
            };
            let fixed = both(|field| &field.fixed, false);
            let feedback = both(|field| &field.feedback, false);
            let fixed_vector = both(|field| &field.fixed, true);
            let feedback_vector = both(|field| &field.feedback, true);
            let place = |(found, fields_of): (&Difference, fn(&RenderedForces) -> &[Felt])| {
                let (surface, row) = found.at;
                let object = [a, b][surface];
                let [x_m, y_m, z_m] = object.positions_m[row];
                let whole = |of: usize| fields_of(&fields[[i, j][surface]][of])[row].force_n;
                Place {
                    on: object.name().to_owned(),
                    x_m,
                    y_m,
                    z_m,
                    a_force_n: found.a.force_n[2],
                    b_force_n: found.b.force_n[2],
                    a_vector_n: whole(i),
                    b_vector_n: whole(j),
                }
            };
            for found in [&fixed, &feedback, &fixed_vector, &feedback_vector]
                .into_iter()
                .flatten()
            {
                error = error.max(found.error(part, constants, jnd));
            }
            let of =
                |found: &Option<Difference>, pick: fn(&Difference) -> f64| found.as_ref().map(pick);
            pairs.push(Pair {
                a: a.name().to_owned(),
                b: b.name().to_owned(),
                static_jnd: of(&fixed, |d| d.largest),
                feedback_jnd: of(&feedback, |d| d.largest),
                static_rms_jnd: of(&fixed, |d| d.rms),
                feedback_rms_jnd: of(&feedback, |d| d.rms),
                static_felt_share: of(&fixed, |d| d.felt_share),
                feedback_felt_share: of(&feedback, |d| d.felt_share),
                static_vector_jnd: of(&fixed_vector, |d| d.largest),
                feedback_vector_jnd: of(&feedback_vector, |d| d.largest),
                static_vector_rms_jnd: of(&fixed_vector, |d| d.rms),
                feedback_vector_rms_jnd: of(&feedback_vector, |d| d.rms),
                static_at: fixed
                    .as_ref()
                    .map(|found| place((found, |field| &field.fixed))),
                feedback_at: feedback
                    .as_ref()
                    .map(|found| place((found, |field| &field.feedback))),
            });
        }
    }
    (pairs, error)
}

impl CompareReport {
    /// Objects without a force constant.
    #[must_use]
    pub fn without_constant(&self) -> Vec<&str> {
        let none = self.shapes.iter().filter(|s| s.lambda_n_per_m.is_none());
        none.map(|shape| shape.shape.as_str()).collect()
    }
}
