//! Places of a surface at which the felt force is compared: spread over the cells of the coarsest map, and
//! between them, where the surface is steep or ends, over the cells of the finest from one height to the next.

use super::ladder::{Ladders, NodesRung};
use super::stages::Bench;
use crate::RunError;
use crate::commands::calibrate::DEFAULT_REACH_M;
use crate::numerics::axis::Axis;
use crate::numerics::spread::part;
use crate::progress::Silent;
use crate::scene::sources::ShapeSource;
use crate::shape::Surface;
use crate::shape::scattered::Probe;

/// Places per cell of the coarsest map along an axis. Sixths and thirds stay thirds as cells are halved, where a
/// cubic's error is 88 % of that in the middle: no finer map has a node there.
const PER_CELL: usize = 6;
/// Places per cell of the finest map from one height to the next, at least: one lies within a sixth of its middle.
const PER_HEIGHT: f64 = 3.0;
/// Of the places between others not more than about this; more of a surface that is steep everywhere say no more.
const MOST_BETWEEN: usize = 20_000;
/// Of a map of many cells not more places along an axis than about this, farther apart.
const MOST: f64 = 64.0;
/// Of a plan with fewer places along an axis than this, as many more.
const FEWEST: usize = 5;
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

/// Places of the surface over the plan of its present points, the ends included, as far as the maps reach.
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
    let cell_m = |nodes: &NodesRung, k: usize| {
        let samples = nodes.samples[k];
        Axis { samples, ..axes[k] }.step()
    };
    let [coarsest, finest] = [&ladders.nodes[0], &ladders.nodes[ladders.nodes.len() - 1]];
    let x_m = spread(points.grid.x_m, axes[0].from, cell_m(coarsest, 0));
    let y_m = spread(points.grid.y_m, axes[1].from, cell_m(coarsest, 1));
    let step_m = cell_m(finest, 2) / PER_HEIGHT;
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

/// Both ends of the plan, and places between by equal parts of cells that begin at `from`.
fn spread(plan: Axis, from: f64, cell_m: f64) -> Vec<f64> {
    let width_m = plan.to - plan.from;
    if plan.samples < 2 || width_m <= 0.0 {
        return vec![plan.from];
    }
    let sixths = if cell_m > 0.0 { width_m / cell_m } else { 1.0 } * PER_CELL as f64;
    // Multiples of three would fall on nodes of a finer map, and on nothing else.
    let stride = (1..).find(|n| n % 3 != 0 && sixths <= MOST * f64::from(*n));
    let step_m = width_m / sixths * f64::from(stride.unwrap_or(1));
    let first = ((plan.from - from) / step_m).floor() as i64 + 1;
    let inner = (first..)
        .map(|n| from + n as f64 * step_m)
        .take_while(|place| *place < plan.to);
    let mut all: Vec<f64> = std::iter::once(plan.from).chain(inner).collect();
    all.push(plan.to);
    if all.len() < FEWEST {
        // Of so narrow a plan all of these may be nodes.
        all.extend((1..=FEWEST).map(|n| plan.from + part(n) * width_m));
        all.sort_by(f64::total_cmp);
    }
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

    /// A plan of two cells had its ends and its middle, nodes of a finer map: a felt error of 1e-14 was stated.
    #[test]
    fn a_plan_of_two_cells_has_places_between_nodes() {
        let half_m = 0.1 / 60.0;
        let plan = Axis {
            from: -half_m,
            to: half_m,
            samples: 5,
        };
        for cells in [8, 15, 30, 60] {
            let all = spread(plan, -0.05, 0.1 / f64::from(cells));
            assert!(all.windows(2).all(|pair| pair[0] <= pair[1]));
            let middle = |place: &&f64| {
                let cells = (**place + 0.05) / half_m;
                (cells - cells.round()).abs() > 0.15
            };
            assert!(all.iter().filter(middle).count() >= 2, "{cells} {all:?}");
        }
    }

    /// Places on nodes alone would find maps without error.
    #[test]
    fn places_have_both_ends_and_miss_the_nodes_of_every_finer_map() {
        for cells in [8, 15, 61, 211] {
            let plan = Axis {
                from: -0.047,
                to: 0.031,
                samples: 33,
            };
            let (from, width_m) = (-0.05, 0.1);
            let cell_m = width_m / f64::from(cells);
            let all = spread(plan, from, cell_m);
            assert_eq!((all[0], all[all.len() - 1]), (plan.from, plan.to));
            assert!(all.len() < 70 && all.windows(2).all(|pair| pair[0] < pair[1]));
            for halvings in 0..5 {
                let node = |place: &&f64| {
                    let cells = (**place - from) / cell_m * f64::from(1 << halvings);
                    (cells - cells.round()).abs() < 0.3
                };
                let between = all.len() - all.iter().filter(node).count();
                assert!(3 * between > all.len(), "{cells} {halvings} {between}");
            }
        }
    }
}
