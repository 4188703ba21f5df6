//! The runtime's error of the force beside lambda's own: heights between the points, nodes of
//! the map, and interpolation between them.

use crate::RunError;
use crate::bundle::headline::{BudgetName, BudgetPart};
use crate::map::FieldMap;
use crate::numerics::lagrange::stencil;
use crate::numerics::spread::spread;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::felt_force::by_map;
use crate::scene::passive;
use crate::scene::passive_map::PassiveMap;
use crate::scene::steel::Solved;
use crate::shape::points::ConstraintPoints;
use fluxform_base::least_request::lowest_requested_m;

/// Cells in whose middle the map is compared with the field, at most.
const MOST_PLACES: usize = 600;
/// The largest difference found, times this, stands for the largest anywhere.
const MARGIN: f64 = 1.5;

/// Middles of cells whose four corners are points, with the mean of their heights, or of a line's intervals; the
/// points themselves where no cell is whole.
fn middles(points: &ConstraintPoints) -> Vec<[f64; 3]> {
    let Some(lowest_m) = lowest_requested_m(points.height_m.iter().copied()) else {
        return Vec::new();
    };
    let rows = points.row_of_grid_point();
    let [columns, lines] = points.grid.samples();
    let [right, above] = [columns, lines].map(|samples| usize::from(samples > 1));
    let mut all: Vec<[f64; 3]> = (0..rows.len())
        .filter(|place| place % columns + right < columns && place / columns + above < lines)
        .filter_map(|place| {
            let next = place + above * columns;
            let corners = [place, place + right, next, next + right];
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
    if all.is_empty() {
        let rows = 0..points.height_m.len();
        let each = rows.map(|row| [points.x_m[row], points.y_m[row], points.height_m[row]]);
        all = each.filter(|[_, _, z_m]| *z_m >= lowest_m).collect();
    }
    some_of(&all, MOST_PLACES)
}

fn some_of(places: &[[f64; 3]], most: usize) -> Vec<[f64; 3]> {
    let some = spread(places.len(), most).into_iter();
    some.map(|place| places[place]).collect()
}

/// A map against the field itself, over the surface between its points.
pub(crate) struct MapEffect<'a> {
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) solved: &'a Solved,
    pub(crate) field: ShapeField<'a>,
    pub(crate) points: &'a ConstraintPoints,
    pub(crate) lambda_n_per_m: f64,
    pub(crate) currents_a: &'a [f64],
}

/// Places at which a map's samples are chosen: few, because each needs the field at 64 nodes.
const CHOOSING_PLACES: usize = 32;
/// Share of the design's samples that is tried first.
const FIRST: f64 = 0.3;
/// Attempts at most.
const ATTEMPTS: usize = 6;
/// The interpolation's order.
const ORDER: f64 = 4.0;
/// A little more than the law says, so that the next attempt holds.
const SPARE: f64 = 1.08;
/// Samples along an axis at most.
const MOST_NODES: usize = 385;

impl MapEffect<'_> {
    /// The workspace's samples with which interpolation stays below `error`, as few as do.
    ///
    /// # Errors
    /// Forces that cannot be computed; interruption.
    pub(crate) fn nodes(
        &self,
        error: f64,
        progress: &dyn Progress,
    ) -> Result<[usize; 3], RunError> {
        let workspace = &self.scene.design.workspace;
        let axes = [workspace.x_m, workspace.y_m, workspace.z_m];
        let places = some_of(&middles(self.points), CHOOSING_PLACES);
        let mut factor = FIRST;
        let mut samples = axes.map(|axis| axis.samples);
        for _ in 0..ATTEMPTS {
            progress.check()?;
            samples = axes.map(|axis| match axis.samples {
                1 => 1,
                more => (((more - 1) as f64 * factor).round() as usize + 1).clamp(4, MOST_NODES),
            });
            let off = MARGIN * self.interpolated_off(samples, &places, progress)?;
            if off <= error || samples.iter().all(|n| *n >= MOST_NODES) {
                break;
            }
            factor *= (SPARE * (off / error).powf(1.0 / ORDER)).clamp(1.1, 2.0);
        }
        Ok(samples)
    }

    /// The largest relative difference between the force at `places` and its interpolation from a grid
    /// of so many samples, of which only the nodes that take part are computed; with that of the unpowered steel's pull,
    /// where that counts.
    fn interpolated_off(
        &self,
        samples: [usize; 3],
        places: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<f64, RunError> {
        let workspace = &self.scene.design.workspace;
        let [mut x, mut y, mut z] = [workspace.x_m, workspace.y_m, workspace.z_m];
        (x.samples, y.samples, z.samples) = (samples[0], samples[1], samples[2]);
        let nodes = [x.nodes(), y.nodes(), z.nodes()];
        let mut positions = Vec::new();
        let mut weights: Vec<Option<Vec<f64>>> = Vec::new();
        for place in places {
            let along = [0, 1, 2].map(|axis| stencil(&nodes[axis], place[axis]));
            let [Some(x), Some(y), Some(z)] = along else {
                weights.push(None);
                continue;
            };
            let mut own = Vec::new();
            for k in 0..z.count {
                for j in 0..y.count {
                    for i in 0..x.count {
                        own.push(x.weights[i] * y.weights[j] * z.weights[k]);
                        let at = [x.start + i, y.start + j, z.start + k];
                        positions.push([0, 1, 2].map(|axis| nodes[axis][at[axis]]));
                    }
                }
            }
            positions.push(*place);
            weights.push(Some(own));
        }
        let forces = (self.scene).forces_n_per_a(self.solved, &positions, progress)?;
        let rows = forces.chunks_exact(self.scene.coils.len());
        let total = rows.map(|row| {
            row.iter()
                .zip(self.currents_a)
                .map(|(f, i)| f * i)
                .sum::<f64>()
        });
        let totals: Vec<f64> = total.collect();
        // A runtime interpolates the pull in a map of its own, whose error adds up with that of the currents' force.
        let pull = passive::counted(self.scene, &positions)?;
        let pulls_n = pull.map(|pull| pull.forces_z_n(&positions));
        let largest_off = |forces_n: &[f64]| {
            let (mut largest, mut first) = (0.0_f64, 0);
            for (place, own) in places.iter().zip(&weights) {
                let Some(own) = own else { continue };
                let interpolated: f64 =
                    own.iter().zip(&forces_n[first..]).map(|(w, f)| w * f).sum();
                let direct = forces_n[first + own.len()];
                let off = (interpolated - direct).abs() / (self.lambda_n_per_m * place[2]);
                largest = largest.max(off);
                first += own.len() + 1;
            }
            largest
        };
        Ok(largest_off(&totals) + pulls_n.map_or(0.0, |pulls_n| largest_off(&pulls_n)))
    }

    /// The part of interpolation; `None` where nothing is requested within the map.
    ///
    /// # Errors
    /// Forces that cannot be computed; interruption.
    pub(crate) fn interpolation(
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

    /// The part of the pull's map, whose nodes are known to `at_nodes` of the requested force; `None` as of
    /// [`Self::interpolation`].
    pub(crate) fn of_pull(&self, passive: &PassiveMap, at_nodes: f64) -> Option<BudgetPart> {
        let places = middles(self.points);
        let off = passive.off_between_n(&places);
        let relative = off.map(|([_, _, z_m], off_n)| off_n / (self.lambda_n_per_m * z_m));
        relative.reduce(f64::max).map(|largest| BudgetPart {
            part: BudgetName::PullMap,
            error: at_nodes + MARGIN * largest,
            how: format!(
                "the stated error of the pull at the map's nodes, times its largest share of the requested force; and an \
                 estimate of interpolation: {MARGIN} times its largest difference at up to {MOST_PLACES} places of the \
                 surface between its points"
            ),
        })
    }
}
