//! What a runtime adds to the force beside lambda's own error: heights between the points, nodes of
//! the map, and interpolation between them.

use crate::RunError;
use crate::bundle::headline::{BudgetName, BudgetPart};
use crate::commands::discretize::PointsReport;
use crate::lambda::lowest_requested_m;
use crate::map::FieldMap;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::felt_force::by_map;
use crate::scene::steel::Solved;
use crate::shape::points::ConstraintPoints;

/// Cells in whose middle the map is compared with the field, at most.
const MOST_PLACES: usize = 600;
/// The largest difference found, times this, stands for the largest anywhere.
const MARGIN: f64 = 1.5;
/// A change of slope beyond this from one node to the next is a jump: no grid of this spacing follows
/// it.
const JUMP_SLOPE: f64 = 1.0;

/// The part of heights between the points, and the share of places where the surface jumps.
///
/// A runtime interpolates heights between points, and requests lambda times that. The certificate
/// bounds how far that is off; where the surface jumps it is off by as much as it jumps, whatever the
/// grid. A place is a jump where the slope changes by more than 1 (45 degrees) from one side of a node
/// to the other; those are left out, their share is stated, and the rest is estimated from the second
/// differences: of a bend anywhere in a cell interpolation is off by half of them at most.
pub(super) fn between_points(points: &PointsReport) -> (Option<BudgetPart>, Option<f64>) {
    let found = &points.discretized.points;
    let Some(lowest_m) = lowest_requested_m(&found.height_m) else {
        return (None, None);
    };
    let (bends, jumps) = second_differences(found, lowest_m);
    let certified = points
        .summary
        .deviation
        .map(|deviation| deviation.above_m.max(deviation.below_m));
    let part = |error: f64, how: &str| BudgetPart {
        part: BudgetName::BetweenPoints,
        error,
        how: how.to_owned(),
    };
    match certified {
        Some(deviation_m) if jumps == 0 => (
            Some(part(
                deviation_m / lowest_m,
                "the certified deviation of the interpolated heights over the lowest requested one",
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

/// The largest half of the second differences at any node but jumps, relative to its height, and the
/// number of jumps.
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
            jump |= bend_m > 0.5 * JUMP_SLOPE * step_m;
            off_m += 0.5 * bend_m;
        }
        if jump {
            jumps += 1;
        } else if height_m >= lowest_m {
            largest = largest.max(off_m / height_m);
        }
    }
    (largest, jumps)
}

/// Middles of cells whose four corners are points, with the mean of their heights.
fn middles(points: &ConstraintPoints) -> Vec<[f64; 3]> {
    let Some(lowest_m) = lowest_requested_m(&points.height_m) else {
        return Vec::new();
    };
    let rows = points.row_of_grid_point();
    let columns = points.grid.x_m.samples;
    let all: Vec<[f64; 3]> = (0..rows.len().saturating_sub(columns + 1))
        .filter(|place| place % columns + 1 < columns)
        .filter_map(|place| {
            let corners = [place, place + 1, place + columns, place + columns + 1];
            let mut middle = [0.0; 3];
            for corner in corners {
                let row = rows[corner]?;
                let at = [points.x_m[row], points.y_m[row], points.height_m[row]];
                middle
                    .iter_mut()
                    .zip(at)
                    .for_each(|(sum, v)| *sum += 0.25 * v);
            }
            (middle[2] >= lowest_m).then_some(middle)
        })
        .collect();
    let every = all.len().div_ceil(MOST_PLACES).max(1);
    all.into_iter().step_by(every).collect()
}

/// A map against the field itself, over the surface between its points.
pub(super) struct MapEffect<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) solved: &'a Solved,
    pub(super) field: ShapeField<'a>,
    pub(super) points: &'a ConstraintPoints,
    pub(super) lambda_n_per_m: f64,
    pub(super) currents_a: &'a [f64],
}

impl MapEffect<'_> {
    /// The part of interpolation; `None` without a cell of four points within the map.
    ///
    /// # Errors
    /// Forces that cannot be computed; interruption.
    pub(super) fn interpolation(
        &self,
        map: &FieldMap,
        progress: &dyn Progress,
    ) -> Result<Option<BudgetPart>, RunError> {
        let places = middles(self.points);
        let (scene, solved) = (self.scene, self.solved);
        let forces = (self.field).forces_n_per_a("middles", scene, solved, &places, progress)?;
        let direct = forces.chunks_exact(scene.coils.len());
        let off = places.iter().zip(direct).filter_map(|(place, row)| {
            let by_map = by_map(map, scene.moment_a_m2, self.currents_a, *place)?;
            let direct: f64 = row.iter().zip(self.currents_a).map(|(f, i)| f * i).sum();
            Some((by_map - direct).abs() / (self.lambda_n_per_m * place[2]))
        });
        Ok(off.reduce(f64::max).map(|largest| BudgetPart {
            part: BudgetName::Interpolation,
            error: MARGIN * largest,
            how: format!(
                "an estimate: {MARGIN} times the largest difference between map and field at up to \
                 {MOST_PLACES} places of the surface between its points"
            ),
        }))
    }
}
