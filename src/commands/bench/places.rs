//! Places of a surface at which the felt force is compared: within the cells of every map of the sweep, in whose
//! middle a cubic errs most, and between them, where the surface is steep or ends, over the cells of the finest from
//! one height to the next.

use super::ladder::{Ladders, NodesRung, PLACES_OF_MAP};
use super::stages::Bench;
use crate::RunError;
use crate::commands::calibrate::DEFAULT_REACH_M;
use crate::numerics::axis::Axis;
use crate::progress::Silent;
use crate::scene::sources::ShapeSource;
use crate::shape::Surface;
use crate::shape::scattered::Probe;

/// Parts of a cell that have a place each, at most.
const MOST_PARTS: usize = 9;
/// Places per cell of the finest map from one height to the next, at least: one lies within a sixth of its middle.
const PER_HEIGHT: f64 = 3.0;
/// Of the places between others not more than about this; more of a surface that is steep everywhere say no more.
const MOST_BETWEEN: usize = 20_000;
/// Halvings between two places towards a rim or a jump: of a millimetre to two micrometres.
const HALVINGS: u32 = 9;

/// A place of the plan, m, and the surface's height there, m, if there is any.
type Node = ([f64; 2], Option<f64>);

/// Places of a surface.
pub(super) struct Chosen {
    /// The places, m.
    pub(super) position_m: Vec<[f64; 3]>,
    /// How many others no map of a bundle reaches.
    pub(super) out_of_reach: usize,
}

/// Places of the surface over the part of the plan of its present points where it is, the ends included, as far as
/// the maps reach.
///
/// # Errors
/// A surface that cannot be read or that has none of these places; interruption.
pub(super) fn choose(
    shape: &ShapeSource,
    ladders: &Ladders,
    bench: &Bench,
) -> Result<Chosen, RunError> {
    let name = &shape.document.name;
    let (surface, _) =
        Surface::open(&shape.document, &Silent).map_err(|source| RunError::Shape {
            name: name.clone(),
            source,
        })?;
    let points = &ladders.points_present;
    let probe = Probe::new(&surface, &points.grid);
    let workspace = &bench.request.design.workspace;
    let axes = [workspace.x_m, workspace.y_m, workspace.z_m];
    let extent = surface.extent();
    let along = |plan: Axis, k: usize| {
        let ends = [extent.min_m[k].max(plan.from), extent.max_m[k].min(plan.to)];
        let cell_m = |nodes: &NodesRung| {
            let samples = nodes.samples[k];
            Axis { samples, ..axes[k] }.step()
        };
        spread(ends, axes[k].from, ladders.nodes.iter().map(cell_m))
    };
    let (x_m, y_m) = (along(points.grid.x_m, 0), along(points.grid.y_m, 1));
    let samples = ladders.nodes[ladders.nodes.len() - 1].samples[2];
    let step_m = Axis { samples, ..axes[2] }.step() / PER_HEIGHT;
    let (mut nodes, mut more): (Vec<Node>, Vec<Node>) = Default::default();
    let mut below: Option<Vec<Node>> = None;
    for y in y_m {
        bench.check()?;
        let row: Vec<Node> = x_m.iter().map(|x| look(&probe, [*x, y])).collect();
        let along = row.windows(2).map(|pair| [pair[0], pair[1]]);
        let across = below.iter().flatten().zip(&row).map(|(a, b)| [*a, *b]);
        for pair in along.chain(across) {
            between(&probe, pair, step_m, HALVINGS, &mut more);
        }
        nodes.extend(&row);
        below = Some(row);
    }
    let every = more.len().div_ceil(MOST_BETWEEN).max(1);
    nodes.extend(more.into_iter().step_by(every));
    let columns = [&points.x_m, &points.y_m, &points.height_m];
    let reached: [[f64; 2]; 3] = std::array::from_fn(|k| reach(axes[k], columns[k]));
    let all: Vec<[f64; 3]> = (nodes.into_iter())
        .filter_map(|([x, y], height)| height.filter(|z| *z > 0.0).map(|z| [x, y, z]))
        .collect();
    let inside = |place: &&[f64; 3]| {
        let mut within = place.iter().zip(&reached);
        within.all(|(v, [from, to])| from <= v && v <= to)
    };
    let position_m: Vec<[f64; 3]> = all.iter().filter(inside).copied().collect();
    if position_m.is_empty() {
        return Err(RunError::Input(format!(
            "shape {name:?} has no surface at any place between its points; make it wider"
        )));
    }
    Ok(Chosen {
        out_of_reach: all.len() - position_m.len(),
        position_m,
    })
}

/// Both ends, and between them the middles of odd parts of the cells of every map, none of which is a node of it, or
/// of many cells the middles of some. Cells begin at `node`.
fn spread([from, to]: [f64; 2], node: f64, cells_m: impl Iterator<Item = f64>) -> Vec<f64> {
    if from >= to {
        return vec![from];
    }
    let mut all = vec![from, to];
    for cell_m in cells_m {
        let cell_m = if cell_m > 0.0 { cell_m } else { to - from };
        let cells = (to - from) / cell_m;
        let parts = (1..=MOST_PARTS).rev().step_by(2);
        let parts = parts
            .filter(|parts| *parts as f64 * cells <= PLACES_OF_MAP as f64)
            .max();
        let (first_m, step_m) = match parts {
            Some(parts) => (0.5 * cell_m / parts as f64, cell_m / parts as f64),
            None => (0.5 * cell_m, (cells / PLACES_OF_MAP as f64).ceil() * cell_m),
        };
        let place = |number: i64| node + first_m + number as f64 * step_m;
        let number = ((from - node - first_m) / step_m).ceil() as i64;
        all.extend((number..).map(place).take_while(|place| *place < to));
    }
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

fn look(probe: &Probe, place: [f64; 2]) -> Node {
    (place, probe.sample(place).map(|sample| sample.height_m))
}

/// Adds places between two others where the surface ends or rises by more than `step_m`, nearer to its rim or
/// its jump with every halving.
fn between(probe: &Probe, [a, b]: [Node; 2], step_m: f64, halvings: u32, nodes: &mut Vec<Node>) {
    let near = match (a.1, b.1) {
        (Some(a), Some(b)) => (a - b).abs() <= step_m,
        (None, None) => true,
        (Some(_), None) | (None, Some(_)) => false,
    };
    if near || halvings == 0 {
        return;
    }
    let middle = look(probe, [0, 1].map(|k| 0.5 * (a.0[k] + b.0[k])));
    nodes.push(middle);
    for pair in [[a, middle], [middle, b]] {
        between(probe, pair, step_m, halvings - 1, nodes);
    }
}

/// Part of the workspace to which every map of the points reaches, m.
fn reach(axis: Axis, points_m: &[f64]) -> [f64; 2] {
    let lowest = points_m.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = points_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [
        axis.from.max(lowest - DEFAULT_REACH_M),
        axis.to.min(highest + DEFAULT_REACH_M),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::interpolation::SAFETY;

    /// A map's cells were looked at in sixths of the coarsest one's, which met the middle of a finer one every 17 mm: a
    /// felt error of 12 % was stated as 9 %. A plan of two cells had its ends and its middle, nodes of a finer map.
    #[test]
    fn regression_places_missed_the_middle_of_cells() {
        let maps = [8, 15, 30, 60, 211].map(|cells| 0.1 / f64::from(cells));
        let (node, scale_m) = (-0.05, 0.012);
        for ends in [[-0.02, 0.02], [-0.047, 0.031], [-0.1 / 60.0, 0.1 / 60.0]] {
            let all = spread(ends, node, maps.into_iter());
            assert_eq!([all[0], all[all.len() - 1]], ends);
            assert!(all.windows(2).all(|pair| pair[0] < pair[1]));
            assert!(all.len() <= PLACES_OF_MAP * maps.len() + 2, "{}", all.len());
            for cell_m in maps {
                let cells = (0.1 / cell_m).round() as usize;
                let middles = (0..cells).map(|n| node + (n as f64 + 0.5) * cell_m);
                for middle in middles.filter(|place| (ends[0]..=ends[1]).contains(place)) {
                    // The error of a cubic in its cell, largest about this middle.
                    let error = |place: &f64| {
                        let t = ((place - node) / cell_m).rem_euclid(1.0);
                        let of_cell = t * (1.0 - t) * (1.0 + t) * (2.0 - t) / 0.5625;
                        of_cell / (1.0 + ((place - middle) / scale_m).powi(2))
                    };
                    let found = all.iter().map(error).fold(0.0, f64::max);
                    // Along both axes no less than the factor for what lies between places covers.
                    assert!(found * found * SAFETY > 1.0, "{ends:?} {cell_m} {found}");
                }
            }
        }
        assert_eq!(spread([0.03, 0.03], node, maps.into_iter()), [0.03]);
        assert_eq!(spread([0.0, 0.01], node, [0.0].into_iter()).len(), 11);
    }
}
