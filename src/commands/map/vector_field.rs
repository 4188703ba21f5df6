//! The field on equally spaced nodes, as mag_manip reads it, and the error of its interpolation.

use std::path::PathBuf;

use super::mag_manip::{SAFETY, VectorFieldMade, VectorFieldSummary, direct, largest, stages};
use crate::RunError;
use crate::map::Components;
use crate::map::catmull_rom::{AxisPosition, Nodes, Stencil, stencil};
use crate::map::multipole::{PARTS, magnitudes};
use crate::map::multipole_fit::Samples;
use crate::map::tabulate::Grid;
use crate::numerics::axis::Axis;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::maps::{MagnetMean, SceneMap};
use crate::scene::steel::Solved;

/// Fewest nodes along each axis.
pub const FEWEST_NODES: usize = 6;
/// Most nodes along each axis by default: mag_manip takes minutes and gigabytes to
/// read millions of vectors.
pub const MOST_DEFAULT_NODES: usize = 31;

/// Cells looked at along x and along y.
const CELLS: usize = 16;
/// How far into its cell, along x, y and z, a place lies: on a node, where the gradient is off most; where the cubic's
/// error is largest; in the middle; there on the layer of nodes, where along z no error makes up for those across.
const PARTS_OF_CELL: [[f64; 3]; 5] = [
    [0.0; 3],
    [0.25; 3],
    [0.5; 3],
    [0.5, 0.5, 0.0],
    [0.75, 0.5, 0.0],
];

/// The nodes: they span the workspace and one step more on every side, so that no place in it
/// meets the one-sided slopes at the nodes' ends. Downwards they stay clear of `top_m`.
///
/// # Errors
/// A workspace without extent along an axis.
pub(super) fn nodes(scene: &Scene, requested: Option<usize>) -> Result<[Axis; 3], RunError> {
    let workspace = &scene.design.workspace;
    let axes = [workspace.x_m, workspace.y_m, workspace.z_m];
    let top_m = scene.sources_top_m();
    let most = axes.iter().map(|axis| axis.samples).max().unwrap_or(0);
    let count = requested.unwrap_or(most.clamp(FEWEST_NODES, MOST_DEFAULT_NODES));
    for (name, axis) in ["x", "y", "z"].iter().zip(&axes) {
        if axis.to <= axis.from {
            return Err(RunError::Input(format!(
                "--vfield needs a box, but [workspace] {name}_mm has no extent: give it two ends"
            )));
        }
    }
    let mut out = axes.map(|axis| {
        let step = (axis.to - axis.from) / (count - 3) as f64;
        Axis {
            from: axis.from - step,
            to: axis.to + step,
            samples: count,
        }
    });
    let z = axes[2];
    if out[2].from - top_m < 0.25 * (z.from - top_m) {
        out[2].from = z.from;
        out[2].to = z.to + (z.to - z.from) / (count - 2) as f64;
    }
    Ok(out)
}

/// Tabulates the field and compares what mag_manip's interpolation makes of it.
///
/// # Errors
/// A node on a winding's edge or on the steel; interruption.
pub(super) fn make(
    scene: &Scene,
    solved: &Solved,
    path: PathBuf,
    axes: [Axis; 3],
    progress: &dyn Progress,
) -> Result<VectorFieldMade, RunError> {
    let [x, y, z] = axes;
    let count = x.samples;
    let grid = Grid {
        x_m: x.nodes(),
        y_m: y.nodes(),
        z_m: z.nodes(),
    };
    let felt = MagnetMean::field();
    let all = Components::All;
    let made = SceneMap::new(scene, solved, &scene.coils, &grid, all, &felt, progress)?;
    let field_t_per_a = made.map.field_t_per_a.unwrap_or_default();
    let workspace = &scene.design.workspace;
    let within = [workspace.x_m, workspace.y_m, workspace.z_m];
    let places = places(axes, within, &PARTS_OF_CELL);
    let samples = direct(scene, solved, points_m(axes, &places), progress)?;
    let errors = interpolation_errors(&field_t_per_a, axes, &places, &samples);
    let method = format!(
        "{SAFETY} times the largest difference of mag_manip's default interpolation (cubic, \
         central slopes) from direct values at {} places on nodes, in the middles of cells and of \
         their faces and between, of every coil; and the nodes' own \
         error",
        samples.points_m.len()
    );
    let accuracy = stages(errors, made.accuracy.estimate, &method);
    let [field_error, gradient_error] = [0, 1].map(|k: usize| accuracy[k].estimate);
    Ok(VectorFieldMade {
        summary: VectorFieldSummary {
            file: path.display().to_string(),
            nodes: count,
            step_m: axes.map(|axis| axis.step()),
            checks: samples.points_m.len(),
            field_error,
            gradient_error,
        },
        path,
        ends_m: axes.map(|axis| [axis.from, axis.to]),
        field_t_per_a,
        accuracy,
    })
}

/// Largest errors of field and gradient that mag_manip's interpolation makes of the nodes, relative
/// to the largest at the height.
fn interpolation_errors(
    field_t_per_a: &[f64],
    axes: [Axis; 3],
    places: &[[AxisPosition; 3]],
    samples: &Samples,
) -> [f64; 2] {
    let heights = largest(samples);
    let count = axes[0].samples;
    let mut errors = [0.0_f64; 2];
    let whole = 3 * count * count * count;
    for (values, parts) in field_t_per_a.chunks_exact(whole).zip(&samples.parts) {
        let nodes = Nodes {
            count,
            steps_m: axes.map(|axis| axis.step()),
            values,
        };
        for ((place, at), direct) in places.iter().zip(&samples.points_m).zip(parts) {
            let stencils: [Stencil; 3] = place.map(|place| stencil(count, place));
            let [value, dx, dy, dz] = nodes.at([&stencils[0], &stencils[1], &stencils[2]]);
            let [bx, by, bz] = value;
            let read = [bx, by, bz, dx[0], dy[0], dz[0], dy[1], dz[1]];
            let off: [f64; PARTS] = std::array::from_fn(|k| read[k] - direct[k]);
            let height = heights.partition_point(|(z, _)| *z < at[2]);
            let (found, sizes) = (magnitudes(&off), heights[height].1);
            for k in 0..2 {
                if sizes[k] > 0.0 {
                    errors[k] = errors[k].max(found[k] / sizes[k]);
                }
            }
        }
    }
    errors
}

/// Cells that are looked at along an axis of the nodes: those within the workspace, at most so
/// many, evenly spread, both ends among them.
fn spread(axis: Axis, within: Axis, most: usize) -> Vec<usize> {
    let middle = |cell: usize| axis.node(cell) + 0.5 * axis.step();
    let cells: Vec<usize> = (0..axis.samples - 1)
        .filter(|cell| (within.from..=within.to).contains(&middle(*cell)))
        .collect();
    let taken = most.min(cells.len());
    (0..taken)
        .map(|k| cells[k * (cells.len() - 1) / (taken - 1).max(1)])
        .collect()
}

fn points_m(axes: [Axis; 3], places: &[[AxisPosition; 3]]) -> Vec<[f64; 3]> {
    let at = |place: &[AxisPosition; 3]| {
        std::array::from_fn(|k| axes[k].node(place[k].cell) + place[k].part * axes[k].step())
    };
    places.iter().map(at).collect()
}

/// The places in the cells that are looked at, as far into each of them as `parts_of_cell` has it.
fn places(
    axes: [Axis; 3],
    within: [Axis; 3],
    parts_of_cell: &[[f64; 3]],
) -> Vec<[AxisPosition; 3]> {
    let x = spread(axes[0], within[0], CELLS);
    let y = spread(axes[1], within[1], CELLS);
    let layers = spread(axes[2], within[2], axes[2].samples);
    let mut out = Vec::new();
    for z in &layers {
        for parts in parts_of_cell {
            let place = |axis: usize, cell: &usize| AxisPosition {
                cell: *cell,
                part: parts[axis],
            };
            for y in &y {
                out.extend(x.iter().map(|x| [place(0, x), place(1, y), place(2, z)]));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Need};
    use crate::progress::Silent;
    use crate::scene::steel;
    use std::path::Path;

    /// Places equally far into their cells along all axes missed the worst, in the middle across and on a layer of nodes.
    #[test]
    fn the_error_of_few_nodes_covers_every_place_in_a_cell() {
        let text = "name = \"one\"\n[coil]\ninner_diameter_mm = 20\nouter_diameter_mm = 32\nlength_mm = 50\n\
                    [wire]\ndiameter_mm = 0.5\n[workspace]\nx_mm = [-40, 45, 11]\ny_mm = [-35, 40, 11]\n\
                    z_mm = [12, 60, 11]\n";
        let (design, _) =
            Design::from_toml(text, Path::new("one.toml"), Need::EVALUATE).expect("reads");
        let scene = Scene::new(&design).expect("a scene");
        let solved = steel::solve(&scene, scene.tolerances.field, 0.0).expect("air");
        let within = [
            design.workspace.x_m,
            design.workspace.y_m,
            design.workspace.z_m,
        ];
        let eighth = |k: usize| 0.125 * (k % 8) as f64;
        let dense: Vec<[f64; 3]> = (0..512)
            .map(|k| [eighth(k), eighth(k / 8), eighth(k / 64)])
            .collect();
        for count in [6, 7, 8] {
            let axes = nodes(&scene, Some(count)).expect("a box");
            let made = make(&scene, &solved, "v.yaml".into(), axes, &Silent).expect("a map");
            let all = places(axes, within, &dense);
            let samples =
                direct(&scene, &solved, points_m(axes, &all), &Silent).expect("off the windings");
            let worst = interpolation_errors(&made.field_t_per_a, axes, &all, &samples);
            let stated = [made.summary.field_error, made.summary.gradient_error];
            for k in 0..2 {
                assert!(worst[k] <= stated[k], "{count}: {worst:?} {stated:?}");
            }
        }
    }

    #[test]
    fn cells_in_the_workspace_are_looked_at() {
        let within = Axis {
            from: 0.0,
            to: 1.0,
            samples: 2,
        };
        let step = 1.0 / 28.0;
        let axis = Axis {
            from: -step,
            to: 1.0 + step,
            samples: 31,
        };
        assert_eq!(spread(axis, within, 3), [1, 14, 28]);
        assert_eq!(spread(axis, within, 40).len(), 28);
        assert_eq!(spread(axis, within, 1), [1]);
    }
}
