//! The plan of `calibrate`: the terms it computes, those it leaves out, and what leaving out costs.
//!
//! Costs are found by computing forces at points of every shape both ways, of the array's middle
//! coils alone: the array itself is never solved here. Of many points they are the largest at some.

use serde::Serialize;

use super::CalibrateOptions;
use super::field_store;
use super::needed_coils;
use super::needed_nodes;
use crate::RunError;
use crate::commands::discretize::{PointsOptions, run_with};
use crate::commands::map::workspace_grid;
use crate::design::{Coupling, Design, MagnetModel};
use crate::field::winding::KERNEL_ERROR;
use crate::numerics::spread::spread;
use crate::progress::{Progress, Silent};
use crate::scene::Scene;
use crate::scene::core_material::Material;
use crate::scene::coupled;
use crate::scene::passive;
use crate::scene::sources::DesignSource;
use crate::scene::sources::ShapeSource;
use crate::scene::steel;
use crate::shape::certificate::Certify;
use crate::shape::points::ConstraintPoints;

/// Most coils of which costs are computed.
const MIDDLE_COILS: usize = 9;
/// Most points of all shapes at which costs are computed, but for those at coils' axes: a plan is to be had
/// at once.
const COST_POINTS: usize = 256;

/// The computation for a design's shapes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// Tolerance of forces and maps, relative to the largest |grad B| at a height.
    pub tolerance: f64,
    /// Coils of the design.
    pub coils: usize,
    /// Coils of which the costs of terms are computed: those closest to the array's middle.
    pub cost_coils: usize,
    /// Points of all shapes at which they are computed; a cost is the largest there, which others may exceed.
    pub cost_points: usize,
    /// The physics, term by term.
    pub terms: Vec<Term>,
    /// The shapes.
    pub shapes: Vec<ShapePlan>,
}

/// One term of the physics.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Term {
    /// Its name.
    pub what: &'static str,
    /// Whether it is computed.
    pub done: Done,
    /// Why.
    pub why: String,
    /// The cost of leaving it out, if that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
}

/// Whether a term is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Done {
    /// It is.
    Computed,
    /// It was in an earlier run, and is read.
    Kept,
    /// It is not.
    LeftOut,
}

impl Done {
    fn computed(is: bool) -> Self {
        if is { Self::Computed } else { Self::LeftOut }
    }
}

/// The cost of leaving a term out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cost {
    /// Largest change of a coil's force, relative to the largest force of any coil at the point.
    OfTheForce(f64),
    /// Force, N.
    ForceN(f64),
}

/// One shape.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ShapePlan {
    /// Its name.
    pub shape: String,
    /// Constraint points.
    pub points: usize,
    /// Nodes of its map along x, y, z.
    pub nodes: [usize; 3],
    /// Nodes of the whole workspace along x, y, z.
    pub workspace_nodes: [usize; 3],
    /// Lowest and highest node, m.
    pub z_m: [f64; 2],
}

/// Plans what [`super::run`] will do with the same arguments.
///
/// # Errors
/// As [`super::run`], but for what concerns the output.
pub fn plan(
    source: DesignSource,
    shapes: &[ShapeSource],
    options: &CalibrateOptions,
    progress: &dyn Progress,
) -> Result<Plan, RunError> {
    let tolerance = options.lambda.tolerance_for(source.design);
    let scene = Scene::with_tolerance(source.design, tolerance)?;
    let field = field_store(&scene, options);
    let cached = field.holds_steel();
    let whole = workspace_grid(source.design);
    let size = |grid: &crate::map::tabulate::Grid| [grid.x_m.len(), grid.y_m.len(), grid.z_m.len()];
    let heights = PointsOptions {
        certify: Certify::No,
        ..PointsOptions::default()
    };
    let middle = middle_coils(source.design);
    let most = COST_POINTS.div_ceil(shapes.len().max(1));
    let mut places = Vec::new();
    let mut planned = Vec::new();
    for shape in shapes {
        let report = run_with(&shape.document, Vec::new(), &heights, progress)?;
        let points = &report.discretized.points;
        let grid = needed_nodes(source.design, points, options.reach_m);
        places.extend(cost_places(points, &middle, most));
        planned.push(ShapePlan {
            shape: shape.document.name.clone(),
            points: points.len(),
            nodes: size(&grid),
            workspace_nodes: size(&whole),
            z_m: [grid.z_m[0], grid.z_m[grid.z_m.len() - 1]],
        });
    }
    let coils = source.design.array.positions_m.len();
    let vector = options.requests_vector(shapes);
    Ok(Plan {
        coils,
        cost_coils: coils.min(MIDDLE_COILS),
        cost_points: places.len(),
        tolerance: scene.tolerances.map.max(KERNEL_ERROR),
        terms: terms(
            &scene,
            &middle,
            vector,
            (cached, tolerance),
            &places,
            progress,
        )?,
        shapes: planned,
    })
}

/// Points of a shape at which costs are computed: all where they are no more than `most`, else so many, spread
/// over all, and those where costs are largest: the lowest and the highest, and the nearest to the axis of each
/// of the `middle` coils.
fn cost_places(points: &ConstraintPoints, middle: &Design, most: usize) -> Vec<[f64; 3]> {
    let mut chosen = spread(points.len(), most);
    if chosen.len() < points.len() {
        let least =
            |of: &dyn Fn(usize) -> f64| (0..points.len()).min_by(|a, b| of(*a).total_cmp(&of(*b)));
        chosen.extend(least(&|i| points.height_m[i]));
        chosen.extend(least(&|i| -points.height_m[i]));
        for axis in &middle.array.positions_m {
            let distance = |i: usize| (points.x_m[i] - axis[0]).hypot(points.y_m[i] - axis[1]);
            chosen.extend(least(&distance));
        }
        chosen.sort_unstable();
        chosen.dedup();
    }
    let place = |i: usize| [points.x_m[i], points.y_m[i], points.height_m[i]];
    chosen.into_iter().map(place).collect()
}

fn terms(
    scene: &Scene,
    middle: &Design,
    vector: bool,
    (cached, tolerance): (bool, Option<f64>),
    places: &[[f64; 3]],
    progress: &dyn Progress,
) -> Result<Vec<Term>, RunError> {
    progress.begin("costs", 3);
    let places = &near(middle, places);
    let driven = needed_coils(scene).len();
    let coils = scene.coils.len();
    let mut terms = vec![
        Term {
            what: "coils",
            done: Done::computed(driven > 0),
            why: if driven == coils {
                format!("all {coils} may carry current")
            } else {
                format!(
                    "{driven} of {coils}: the others' current limits are zero; those whose force \
                     stays below the tolerance everywhere are left out of the map"
                )
            },
            cost: (driven < coils).then_some(Cost::OfTheForce(0.0)),
        },
        if vector {
            Term {
                what: "transverse gradient",
                done: Done::Computed,
                why: "a force vector is requested (eq. 4)".to_owned(),
                cost: None,
            }
        } else if scene.tilted() {
            Term {
                what: "transverse gradient",
                done: Done::Computed,
                why: "a tilted magnet feels all of it (eq. 4)".to_owned(),
                cost: None,
            }
        } else {
            Term {
                what: "field and transverse gradient",
                done: Done::LeftOut,
                why: "an upright magnet's vertical force needs dB_z/dz alone (eq. 5)".to_owned(),
                cost: Some(Cost::OfTheForce(0.0)),
            }
        },
        finite_magnet(middle, tolerance, places),
    ];
    progress.advance(1);
    let Some(core) = &scene.core else {
        terms.push(Term {
            what: "steel",
            done: Done::LeftOut,
            why: "the design has no core".to_owned(),
            cost: Some(Cost::OfTheForce(0.0)),
        });
        progress.end();
        return Ok(terms);
    };
    terms.extend(steel_terms(&core.material, cached));
    terms.extend(coupling(middle, tolerance, places));
    progress.advance(1);
    terms.push(passive_force(&Scene::new(middle)?, places)?);
    progress.end();
    Ok(terms)
}

/// The steel and its saturation.
fn steel_terms(material: &Material, cached: bool) -> [Term; 2] {
    let steel = Term {
        what: "steel",
        done: if cached { Done::Kept } else { Done::Computed },
        why: if cached {
            "solved in an earlier run and kept: coils, core, array and magnet are the same"
        } else {
            "the cores multiply the coils' field"
        }
        .to_owned(),
        cost: None,
    };
    let saturation = match material {
        Material::Curve(_) => Term {
            what: "saturation",
            done: Done::Computed,
            why: "the steel follows its B-H curve at the chosen currents".to_owned(),
            cost: None,
        },
        Material::Linear(mu_r) => Term {
            what: "saturation",
            done: Done::LeftOut,
            why: format!(
                "mu_r = {mu_r} whatever the field; |B| at the chosen currents is compared with the \
                 knee where the design gives one"
            ),
            cost: None,
        },
    };
    [steel, saturation]
}

/// The design with no more than nine coils, those closest to the array's middle.
fn middle_coils(design: &Design) -> Design {
    let all = &design.array.positions_m;
    if all.len() <= MIDDLE_COILS {
        return design.clone();
    }
    let mean = |axis: usize| all.iter().map(|p| p[axis]).sum::<f64>() / all.len() as f64;
    let centre = [mean(0), mean(1)];
    let distance = |coil: usize| (all[coil][0] - centre[0]).hypot(all[coil][1] - centre[1]);
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
    let mut kept = order[..MIDDLE_COILS].to_vec();
    kept.sort_unstable();
    let of = |values: &[f64]| kept.iter().map(|coil| values[*coil]).collect::<Vec<f64>>();
    let mut middle = design.clone();
    middle.array.grid = None;
    middle.array.positions_m = kept.iter().map(|coil| all[*coil]).collect();
    middle.array.gain = of(&design.array.gain);
    middle.supply.current_max_a = of(&design.supply.current_max_a);
    middle.supply.current_min_a = of(&design.supply.current_min_a);
    middle
}

/// `places` moved over the nearest coil of `design`, where they lie beside all of them.
fn near(design: &Design, places: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let axes = &design.array.positions_m;
    let Some(coil) = design.coil else {
        return places.to_vec();
    };
    let mut near = places.to_vec();
    for [x, y, _] in &mut near {
        let distance = |p: &[f64; 2]| (p[0] - *x).hypot(p[1] - *y);
        let nearest = axes
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        if let Some(axis) = nearest.filter(|axis| distance(axis) > 5.0 * coil.outer_diameter_m) {
            [*x, *y] = *axis;
        }
    }
    near
}

/// Forces per ampere at `places` with another design; `None` where it cannot be computed.
fn forces(design: &Design, tolerance: Option<f64>, places: &[[f64; 3]]) -> Option<Vec<f64>> {
    let scene = Scene::with_tolerance(design, tolerance).ok()?;
    let lowest_m = design.workspace.z_m.from;
    let solved = steel::solve(&scene, scene.tolerances.field, lowest_m).ok()?;
    scene.forces_n_per_a(&solved, places, &Silent).ok()
}

/// Largest change from `of` to `other` at any place, relative to the largest force there.
fn change(of: &[f64], other: &[f64], coils: usize) -> f64 {
    let rows = of.chunks_exact(coils).zip(other.chunks_exact(coils));
    rows.map(|(of, other)| {
        let largest = other.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
        let moved = of.iter().zip(other);
        let moved = moved.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        if moved == 0.0 { 0.0 } else { moved / largest }
    })
    .fold(0.0, f64::max)
}

/// The change of the forces at `places` from one edit of the design to another.
fn cost_of(
    design: &Design,
    tolerance: Option<f64>,
    places: &[[f64; 3]],
    simple: impl FnOnce(&mut Design),
    whole: impl FnOnce(&mut Design),
) -> Option<Cost> {
    let (mut without, mut with) = (design.clone(), design.clone());
    simple(&mut without);
    whole(&mut with);
    let coils = design.array.positions_m.len();
    let [without, with] = [&without, &with].map(|design| forces(design, tolerance, places));
    Some(Cost::OfTheForce(change(&without?, &with?, coils)))
}

fn finite_magnet(design: &Design, tolerance: Option<f64>, places: &[[f64; 3]]) -> Term {
    let cost = cost_of(
        design,
        tolerance,
        places,
        |design| design.magnet.model = MagnetModel::Dipole,
        |design| design.magnet.model = MagnetModel::Cylinder,
    );
    let computed = design.magnet.model == MagnetModel::Cylinder;
    Term {
        what: "finite magnet",
        done: Done::computed(computed),
        why: if computed {
            "the design has the magnet as a cylinder"
        } else {
            "the design has the magnet as a dipole; model = \"cylinder\" under [magnet] computes it"
        }
        .to_owned(),
        cost,
    }
}

fn coupling(design: &Design, tolerance: Option<f64>, places: &[[f64; 3]]) -> Option<Term> {
    if design.array.positions_m.len() < 2 || design.has_iron() {
        return None;
    }
    let computed = coupled(design);
    let cost = cost_of(
        design,
        tolerance,
        places,
        |design| design.array.coupling = Coupling::None,
        |design| design.array.coupling = Coupling::Full,
    );
    Some(Term {
        what: "coupling between the cores",
        done: Done::computed(computed),
        why: if computed {
            "the design has coupling = \"full\", the default with cores"
        } else {
            "the design has coupling = \"none\": single coils are added up"
        }
        .to_owned(),
        cost,
    })
}

fn passive_force(scene: &Scene, places: &[[f64; 3]]) -> Result<Term, RunError> {
    let computed = scene.design.magnet.passive_force;
    let pull = passive::pull(scene, places, false)?;
    let pull = pull.map(|pull| pull.forces_z_n(places));
    let largest_n = pull.map(|forces| forces.iter().fold(0.0_f64, |most, f| most.max(f.abs())));
    Ok(Term {
        what: "pull of the unpowered steel",
        done: Done::computed(computed),
        why: if computed {
            "the design has passive_force = true"
        } else {
            "the design has passive_force = false; a finger feels 0.8 mN"
        }
        .to_owned(),
        cost: largest_n.map(Cost::ForceN),
    })
}
