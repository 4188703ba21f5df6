//! What people look at in a bundle: its page and its plots, from the numbers that it holds.

use std::io;

use super::{NeededMap, recorded};
use crate::bundle::lambda_file::LambdaFile;
use crate::bundle::manifest::Manifest;
use crate::bundle::table::{Column, write_columns};
use crate::coil::limits::{self, Evaluated};
use crate::commands::lambda::LambdaReport;
use crate::lambda::NamedConstant;
use crate::map::FieldMap;
use crate::plot::lambda::LambdaPlot;
use crate::plot::plane::{Cells, Panel, PlanePlot, Together};
use crate::report::bundle::page;
use crate::report::data::{
    Breakpoint, BudgetPart, BundleFacts, Chosen, CoilFacts, Deciding, LimitRow, StageFacts,
    WorstPlace,
};
use crate::report::field::{Field, Layer};
use crate::report::surface::Surface;
use crate::scene::Scene;
use crate::shape::points::ConstraintPoints;
use crate::units::STEEL_DENSITY_KG_PER_M3;

/// The page's name in a bundle.
pub const PAGE_FILE: &str = "report.html";

/// Heights of the maps that a page shows of all coils together, at most.
const HEIGHTS: usize = 12;
/// Nodes along either side of those.
const SIDE: usize = 61;
/// Heights that it shows of each coil.
const COIL_HEIGHTS: usize = 5;
/// Nodes of all coils' maps together, and along either side of each.
const COIL_NODES: usize = 45_000;
const COIL_SIDE: usize = 31;
/// Of more coils none is shown alone.
const COILS: usize = 64;
/// Heights and nodes along a side of the plotted maps.
const PLOTTED: usize = 3;
const PLOTTED_SIDE: usize = 41;

/// What a page is made of.
pub(super) struct Seen<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) lambda: &'a LambdaReport,
    pub(super) picture: &'a LambdaPlot,
    pub(super) needed: &'a NeededMap,
    pub(super) manifest: &'a Manifest,
    /// That of the field.
    pub(super) tolerance: f64,
}

/// Names and contents of the page and the plots, in the order of the manifest.
///
/// # Errors
/// Numbers that are not finite.
pub(super) fn files(seen: &Seen, others: &[&str]) -> io::Result<Vec<(&'static str, Vec<u8>)>> {
    let mut files = vec![
        ("plots/lambda.svg", seen.picture.svg().into_bytes()),
        ("plots/lambda.csv", lambda_table(seen.picture)?),
    ];
    if let Some(table) = errors_table(seen)? {
        files.push(("plots/errors.csv", table));
    }
    let (svg, table) = field_plot(seen)?;
    files.push(("plots/field.svg", svg.into_bytes()));
    files.push(("plots/field.csv", table));
    let names = ["map.npz", "points.csv", "currents.csv", "lambda.json"];
    let names = names.iter().chain(others).copied();
    let names = names.chain(files.iter().map(|(name, _)| *name)).collect();
    files.insert(0, (PAGE_FILE, page(&facts(seen, names)).into_bytes()));
    Ok(files)
}

fn facts<'a>(seen: &'a Seen, files: Vec<&'a str>) -> BundleFacts<'a> {
    let (scene, manifest) = (seen.scene, seen.manifest);
    let file = &seen.lambda.file;
    let points = &seen.lambda.points.discretized.points;
    let (limits, unchecked) = limit_facts(seen);
    BundleFacts {
        design: &file.design,
        shape: &file.shape,
        version: &file.fluxform_version,
        inputs: file
            .inputs
            .iter()
            .map(|input| (input.path.as_str(), input.sha256.as_str()))
            .collect(),
        criterion: file.criterion,
        jnd: file.jnd,
        chosen: chosen(seen),
        rank: file.rank,
        points: file.points,
        constants: constants(file),
        coils: coils(scene, file),
        total_max_a: scene.design.supply.total_current_max_a,
        limits,
        unchecked,
        deciding: deciding(file, points),
        accuracy: manifest
            .accuracy
            .iter()
            .map(|(name, stage)| StageFacts {
                name,
                estimate: stage.estimate,
                relative_to: &stage.relative_to,
                method: &stage.method,
            })
            .collect(),
        budget: budget(seen),
        left_out: manifest
            .left_out
            .iter()
            .map(|left| (left.what.as_str(), left.why.as_str(), left.error_cost))
            .collect(),
        breakpoints: file
            .path
            .iter()
            .map(|step| Breakpoint {
                lambda_n_per_m: step.lambda_n_per_m,
                event: &step.event,
            })
            .collect(),
        curves: seen.picture,
        worst_turns: file.worst_point.as_ref().map_or_else(Vec::new, |worst| {
            let turns = worst.path.iter();
            turns
                .map(|turn| (turn.lambda_n_per_m, turn.worst_error_n))
                .collect()
        }),
        surface: surface(points, seen.picture),
        field: field(seen),
        warnings: &seen.lambda.warnings,
        files,
        error_time: recorded::curve(scene, seen.tolerance),
    }
}

fn place_m(points: &ConstraintPoints, at: usize) -> [f64; 3] {
    [points.x_m[at], points.y_m[at], points.height_m[at]]
}

fn chosen(seen: &Seen) -> Option<Chosen> {
    let file = &seen.lambda.file;
    let points = &seen.lambda.points.discretized.points;
    let worst_at = seen.picture.chosen.as_ref().and_then(|forces| {
        let error = |at: usize| (forces.static_n[at] - forces.wanted_n[at]).abs();
        let worst = (0..points.len()).reduce(|a, b| if error(b) > error(a) { b } else { a })?;
        Some(WorstPlace {
            position_m: place_m(points, worst),
            wanted_n: forces.wanted_n[worst],
            given_n: forces.static_n[worst],
        })
    });
    Some(Chosen {
        lambda_n_per_m: file.lambda_n_per_m?,
        rms_error_n: file.rms_error_n?,
        worst_error_n: file.worst_error_n?,
        relative_rms_error: file.relative_rms_error,
        duality_gap_n2: file.duality_gap_n2?,
        worst_at,
    })
}

fn constants(file: &LambdaFile) -> Vec<NamedConstant> {
    let worst = file.worst_point.as_ref();
    let more = [
        (
            "tolerance",
            "The largest whose errors are not felt at any point",
            file.tolerance.as_ref().and_then(|t| t.lambda_n_per_m),
        ),
        (
            "linear, worst point",
            "Where the first limit binds if the largest error is to be least",
            worst.and_then(|worst| worst.lambda_linear_n_per_m),
        ),
        (
            "jnd, worst point",
            "The same as jnd if the largest error is to be least",
            worst.and_then(|worst| worst.lambda_jnd_n_per_m),
        ),
    ];
    let more = more.map(|(name, meaning, lambda_n_per_m)| NamedConstant {
        name,
        meaning,
        lambda_n_per_m,
    });
    file.constants.named().into_iter().chain(more).collect()
}

fn coils(scene: &Scene, file: &LambdaFile) -> Vec<CoilFacts> {
    let current = |coil: usize| file.currents_a.as_ref().map_or(0.0, |all| all[coil]);
    scene
        .coils
        .iter()
        .map(|coil| CoilFacts {
            axis_m: coil.axis_m,
            radius_m: 0.5 * scene.coil.outer_diameter_m,
            current_a: current(coil.number),
            min_a: scene.lower_a[coil.number],
            max_a: scene.upper_a[coil.number],
        })
        .collect()
}

/// The design's limits on one coil, and those whose value is not known here.
fn limit_facts(seen: &Seen) -> (Vec<LimitRow>, Vec<&'static str>) {
    let (scene, file) = (seen.scene, &seen.lambda.file);
    let mut circuit = scene.circuit;
    if let Some(told) = &seen.manifest.circuit {
        let own = told.inductance_h.iter().enumerate().map(|(i, row)| row[i]);
        circuit.inductance_h = own.fold(0.0, f64::max);
    }
    let steel_kg = scene
        .core
        .as_ref()
        .map_or(0.0, |core| core.shape.volume_m3() * STEEL_DENSITY_KG_PER_M3);
    let peak = file.working_point.as_ref();
    let peak = peak.map(|at| at.peak_field_t.iter().copied().fold(0.0, f64::max));
    let checks = limits::check(&Evaluated {
        design: scene.design,
        circuit: &circuit,
        power_w: circuit.power_w(scene.rated_current_a()),
        mass_kg: circuit.wire_mass_kg + steel_kg,
        core_field_t: peak,
    });
    let facts = checks.iter().map(|(name, check)| LimitRow {
        name,
        value: check.value,
        limit: check.limit,
        met: check.met,
    });
    let asked = scene.design.limits.core_field_max_t.is_some() && scene.core.is_some();
    let unchecked = (asked && peak.is_none()).then_some("core field");
    (facts.collect(), unchecked.into_iter().collect())
}

fn deciding(file: &LambdaFile, points: &ConstraintPoints) -> Vec<Deciding> {
    let active = file.worst_point.as_ref().and_then(|w| w.active.as_ref());
    let one = |share: &crate::bundle::lambda_file::ActivePointShare| Deciding {
        position_m: place_m(points, share.point),
        share: share.multiplier,
    };
    active.map_or_else(Vec::new, |all| all.iter().map(one).collect())
}

/// The errors from the file to the finger, relative to the force.
fn budget(seen: &Seen) -> Vec<BudgetPart> {
    let (manifest, file) = (seen.manifest, &seen.lambda.file);
    let estimate = |stage: &str| manifest.accuracy.get(stage).map_or(0.0, |s| s.estimate);
    let heights = ["points_tessellation", "points_grid", "points"].map(estimate);
    let all: f64 = heights.iter().sum();
    let (per_m, basis) = match manifest.accuracy.get("lambda_of_points") {
        Some(moved) if all > 0.0 => (
            moved.estimate / all,
            "height error, times what heights change in lambda",
        ),
        _ => {
            let points = &seen.lambda.points.discretized.points;
            let lowest = points
                .height_m
                .iter()
                .copied()
                .fold(f64::INFINITY, f64::min);
            let part = if lowest > 0.0 { 1.0 / lowest } else { 0.0 };
            (part, "height error over the lowest height")
        }
    };
    let part = |name, part: f64, basis| BudgetPart { name, part, basis };
    let mut parts = vec![
        part("tessellation", heights[0] * per_m, basis),
        part("grid of points", heights[1] * per_m, basis),
        part("rounding in the file", heights[2] * per_m, basis),
        part(
            "field",
            estimate("forces"),
            "of the largest gradient at the point's height",
        ),
        part(
            "map nodes",
            estimate("map"),
            "of the largest gradient at the node's height",
        ),
        part(
            "map interpolation",
            manifest.map.interpolation.largest_error,
            "largest between nodes, of the largest gradient at the height",
        ),
    ];
    if let (Some(rms_n), Some(relative), Some(gap_n2)) = (
        file.rms_error_n,
        file.relative_rms_error,
        file.duality_gap_n2,
    ) && relative > 0.0
    {
        // sqrt(e^2 + gap) - e, at most either of these.
        let more_n = (gap_n2 / (2.0 * rms_n)).min(gap_n2.sqrt());
        parts.push(part(
            "lambda's optimality",
            more_n * relative / rms_n,
            "what the duality gap leaves open of the rms error, over the rms force",
        ));
    }
    parts
}

fn surface(points: &ConstraintPoints, picture: &LambdaPlot) -> Surface {
    let grid = &points.grid;
    let [x_m, y_m] = grid.plan();
    let mut surface = Surface {
        x_m,
        y_m,
        columns: grid.x_m.samples,
        height_m: vec![None; grid.len()],
        error_n: Vec::new(),
    };
    for (at, height) in points.grid_index.iter().zip(&points.height_m) {
        surface.height_m[*at] = Some(*height);
    }
    if let Some(forces) = &picture.chosen {
        surface.error_n = vec![None; grid.len()];
        let errors = forces.static_n.iter().zip(&forces.wanted_n);
        for (at, (given, wanted)) in points.grid_index.iter().zip(errors) {
            surface.error_n[*at] = Some(given - wanted);
        }
    }
    surface
}

/// About `count` of `all` places, both ends among them.
fn some(all: usize, count: usize) -> Vec<usize> {
    if all <= count || count < 2 {
        return (0..all.min(count.max(1)).max(usize::from(all > 0)))
            .map(|at| at.min(all - 1))
            .collect();
    }
    let place = |at: usize| (at * (all - 1) + (count - 1) / 2) / (count - 1);
    (0..count).map(place).collect()
}

/// Part of the nodes of a plane: places along x and y.
struct Plan {
    x: Vec<usize>,
    y: Vec<usize>,
}

impl Plan {
    fn new(map: &FieldMap, side: usize) -> Self {
        Self {
            x: some(map.x_m.len(), side),
            y: some(map.y_m.len(), side),
        }
    }

    /// Adds `factor` times a coil's values on a plane.
    fn add(&self, map: &FieldMap, coil: usize, plane: usize, factor: f64, sum: &mut [f64]) {
        let (columns, rows) = (map.x_m.len(), map.y_m.len());
        let from = (coil * map.z_m.len() + plane) * rows * columns;
        let values = &map.gz_t_per_m_per_a[from..from + rows * columns];
        let nodes = self
            .y
            .iter()
            .flat_map(|y| self.x.iter().map(move |x| y * columns + x));
        for (sum, node) in sum.iter_mut().zip(nodes) {
            *sum += factor * values[node];
        }
    }

    fn len(&self) -> usize {
        self.x.len() * self.y.len()
    }
}

/// dB_z/dz of all coils at the chosen currents, T/m, on some planes.
fn together(seen: &Seen, planes: &[usize], plan: &Plan) -> Vec<f64> {
    let map = &seen.needed.made.map;
    let currents = seen.lambda.file.currents_a.as_deref().unwrap_or(&[]);
    let mut values = vec![0.0; planes.len() * plan.len()];
    for (plane, sum) in planes.iter().zip(values.chunks_exact_mut(plan.len())) {
        for (at, coil) in map.coils.iter().enumerate() {
            let current = currents.get(*coil).copied().unwrap_or(0.0);
            plan.add(map, at, *plane, current, sum);
        }
    }
    values
}

fn field(seen: &Seen) -> Field {
    let map = &seen.needed.made.map;
    let heights = |planes: &[usize]| planes.iter().map(|at| map.z_m[*at]).collect::<Vec<_>>();
    let mut layers = Vec::new();
    if seen.lambda.file.currents_a.is_some() {
        let (planes, plan) = (some(map.z_m.len(), HEIGHTS), Plan::new(map, SIDE));
        layers.push(Layer {
            name: "all coils at their currents".to_owned(),
            unit: "T/m",
            columns: plan.x.len(),
            height_m: heights(&planes),
            values: together(seen, &planes, &plan),
        });
    }
    if map.coils.len() <= COILS {
        let planes = some(map.z_m.len(), COIL_HEIGHTS);
        let share = COIL_NODES / (map.coils.len() * planes.len()).max(1);
        let plan = Plan::new(map, COIL_SIDE.min(share.isqrt()).max(2));
        layers.extend(map.coils.iter().enumerate().map(|(at, coil)| {
            let mut values = vec![0.0; planes.len() * plan.len()];
            for (plane, sum) in planes.iter().zip(values.chunks_exact_mut(plan.len())) {
                plan.add(map, at, *plane, 1e3, sum);
            }
            Layer {
                name: format!("coil {coil} alone, per ampere"),
                unit: "mT/m/A",
                columns: plan.x.len(),
                height_m: heights(&planes),
                values,
            }
        }));
    }
    let ends = |nodes: &[f64]| {
        let from = nodes.first().copied().unwrap_or(0.0);
        [from, nodes.last().copied().unwrap_or(from)]
    };
    let points = &seen.lambda.points.discretized.points;
    let lowest = points
        .height_m
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    Field {
        x_m: ends(&map.x_m),
        y_m: ends(&map.y_m),
        layers,
        first_m: lowest,
        force_a_m2: (!seen.scene.tilted()).then_some(seen.scene.moment_a_m2[2]),
    }
}

/// Error and currents over lambda as a table.
fn lambda_table(picture: &LambdaPlot) -> io::Result<Vec<u8>> {
    let coils = picture.currents_a.first().map_or(0, Vec::len);
    let names: Vec<String> = (0..coils).map(|coil| format!("current_{coil}_a")).collect();
    let currents: Vec<Vec<f64>> = (0..coils)
        .map(|coil| picture.currents_a.iter().map(|all| all[coil]).collect())
        .collect();
    let turns: Vec<i64> = picture.breakpoint.iter().map(|b| i64::from(*b)).collect();
    let mut columns = vec![
        ("lambda_n_per_m", Column::Number(&picture.lambda_n_per_m)),
        ("rms_error_n", Column::Number(&picture.rms_error_n)),
        ("breakpoint", Column::Index(&turns)),
    ];
    let values = currents.iter().map(|values| Column::Number(values));
    columns.extend(names.iter().map(String::as_str).zip(values));
    let mut out = Vec::new();
    write_columns(&mut out, &columns)?;
    Ok(out)
}

/// Forces at the points as a table; `None` without a force constant.
fn errors_table(seen: &Seen) -> io::Result<Option<Vec<u8>>> {
    let points = &seen.lambda.points.discretized.points;
    let Some(forces) = &seen.picture.chosen else {
        return Ok(None);
    };
    let mut out = Vec::new();
    write_columns(
        &mut out,
        &[
            ("x_m", Column::Number(&points.x_m)),
            ("y_m", Column::Number(&points.y_m)),
            ("wanted_n", Column::Number(&forces.wanted_n)),
            ("given_n", Column::Number(&forces.static_n)),
        ],
    )?;
    Ok(Some(out))
}

/// dB_z/dz at three heights as a drawing and as a table of the same numbers.
fn field_plot(seen: &Seen) -> io::Result<(String, Vec<u8>)> {
    let map = &seen.needed.made.map;
    let (planes, plan) = (some(map.z_m.len(), PLOTTED), Plan::new(map, PLOTTED_SIDE));
    let values = together(seen, &planes, &plan);
    let ends = |nodes: &[f64]| [nodes[0] * 1e3, nodes[nodes.len() - 1] * 1e3];
    let panel = |(plane, values): (&usize, &[f64])| Panel {
        title: format!("dBz/dz / T/m at {:.4} mm", map.z_m[*plane] * 1e3),
        cells: Some(Cells {
            columns: plan.x.len(),
            values: values.iter().copied().map(Some).collect(),
            together: Together::First,
        }),
        marks: Vec::new(),
    };
    let panels = planes.iter().zip(values.chunks_exact(plan.len()));
    let plot = PlanePlot {
        title: format!(
            "{} on {}: all coils at their currents",
            seen.lambda.file.shape, seen.lambda.file.design
        ),
        unit: "mm".to_owned(),
        x: ends(&map.x_m),
        y: ends(&map.y_m),
        panels: panels.map(panel).collect(),
    };
    let nodes = || {
        let plan = &plan;
        planes.iter().flat_map(move |z| {
            let rows = plan.y.iter();
            rows.flat_map(move |y| plan.x.iter().map(move |x| (*x, *y, *z)))
        })
    };
    let x: Vec<f64> = nodes().map(|node| map.x_m[node.0]).collect();
    let y: Vec<f64> = nodes().map(|node| map.y_m[node.1]).collect();
    let z: Vec<f64> = nodes().map(|node| map.z_m[node.2]).collect();
    let mut out = Vec::new();
    write_columns(
        &mut out,
        &[
            ("x_m", Column::Number(&x)),
            ("y_m", Column::Number(&y)),
            ("z_m", Column::Number(&z)),
            ("dbz_dz_t_per_m", Column::Number(&values)),
        ],
    )?;
    Ok((plot.svg(), out))
}

#[cfg(test)]
mod tests {
    use super::some;

    #[test]
    fn some_places_keep_both_ends() {
        assert_eq!(some(5, 9), [0, 1, 2, 3, 4]);
        assert_eq!(some(61, 3), [0, 30, 60]);
        assert_eq!(some(7, 4), [0, 2, 4, 6]);
        assert_eq!(some(1, 12), [0]);
        assert!(some(0, 3).is_empty());
        assert_eq!(some(9, 1).len(), 1);
    }
}
