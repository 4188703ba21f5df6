//! Heights between the points of a grid: how far interpolation is off.

use super::PointsReport;
use crate::bundle::headline::{BudgetName, BudgetPart};
use crate::shape::points::ConstraintPoints;
use fluxform_base::least_request::lowest_requested_m;

/// A change of slope beyond this from one node to the next is a jump: no grid of this spacing follows
/// it.
const JUMP_SLOPE: f64 = 1.0;

/// The part of heights between the points, and the share of places where the surface jumps.
///
/// A runtime interpolates heights between points, and requests lambda times that. The certificate bounds how far
/// that is off, of each cell relative to the lowest of its points; where the surface jumps it is off by as much as it
/// jumps, whatever the grid. A node is at a jump where the slope changes by more than 1 (45 degrees) from one of its
/// sides to the other: there heights beyond a quarter of the spacing off are left out, and the share of such nodes is
/// stated. The rest is estimated from the second differences: of a bend anywhere in a cell interpolation is off by
/// half of them at most.
pub(crate) fn between_points(points: &PointsReport) -> (Option<BudgetPart>, Option<f64>) {
    let found = &points.discretized.points;
    let Some(lowest_m) = lowest_requested_m(found.height_m.iter().copied()) else {
        return (None, None);
    };
    let (bends, jumps) = second_differences(found, lowest_m);
    let certificate = points.discretized.certificate.as_ref();
    let certified = certificate.and_then(|certificate| certificate.vertical.relative);
    let part = |error: f64, how: &str| BudgetPart {
        part: BudgetName::BetweenPoints,
        error,
        how: how.to_owned(),
    };
    match certified {
        Some(relative) if jumps == 0 => (
            Some(part(
                relative,
                "the certified deviation of the interpolated heights, of each cell over its lowest requested one",
            )),
            None,
        ),
        _ => (
            Some(part(
                bends,
                "an estimate from the second differences of the heights, jumps left out",
            )),
            (jumps > 0).then(|| jumps as f64 / found.len() as f64),
        ),
    }
}

/// The largest half of the second differences at any node, at jumps a quarter of the spacing, relative
/// to its height, and the number of jumps.
fn second_differences(points: &ConstraintPoints, lowest_m: f64) -> (f64, usize) {
    let rows = points.row_of_grid_point();
    let columns = points.grid.x_m.samples;
    let steps = [points.grid.x_m, points.grid.y_m].map(|axis| match axis.samples {
        1 => f64::INFINITY,
        more => (axis.to - axis.from) / (more - 1) as f64,
    });
    let (mut largest, mut jumps) = (0.0_f64, 0);
    for (row, &place) in points.grid_index.iter().enumerate() {
        let height_m = points.height_m[row];
        let (i, last) = (place % columns, rows.len());
        let beside = [
            (i > 0 && i + 1 < columns).then(|| [place - 1, place + 1]),
            (place >= columns && place + columns < last)
                .then(|| [place - columns, place + columns]),
        ];
        let mut off_m = 0.0;
        let mut jump = false;
        for (beside, step_m) in beside.into_iter().zip(steps) {
            let [Some(a), Some(b)] = beside.map_or([None; 2], |both| both.map(|at| rows[at]))
            else {
                continue;
            };
            let bend_m = (height_m - 0.5 * (points.height_m[a] + points.height_m[b])).abs();
            let most_m = 0.5 * JUMP_SLOPE * step_m;
            jump |= bend_m > most_m;
            off_m += 0.5 * bend_m.min(most_m);
        }
        jumps += usize::from(jump);
        if height_m >= lowest_m {
            largest = largest.max(off_m / height_m);
        }
    }
    (largest, jumps)
}
