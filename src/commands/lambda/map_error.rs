//! The runtime's error of the force beside lambda's own: heights between the points, nodes of
//! the map, and interpolation between them.

use crate::RunError;
use crate::bundle::headline::{BudgetName, BudgetPart};
use crate::map::tabulate::Grid;
use crate::numerics::lagrange::stencil;
use crate::numerics::spread::spread;
use crate::numerics::vec3::{minus, norm};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::maps::SceneMap;
use crate::scene::passive;
use crate::scene::passive_map::PassiveMap;
use crate::scene::steel::Solved;
use crate::shape::points::ConstraintPoints;
use fluxform_base::least_request::lowest_requested_m;

/// Places at which the map is compared with the field, at most.
const MOST_PLACES: usize = 600;
/// So many of the lowest places are given half of them, the more the lower.
const LOWEST: usize = 4000;
/// Those at which a map's nodes are chosen: few, because each needs the field at 64 nodes.
const CHOOSING_PLACES: usize = 32;
/// The largest difference found, times this, stands for the largest anywhere.
const MARGIN: f64 = 1.5;

/// Up to `most` of the points and of the middles of cells whose four corners are points, with the mean of their
/// heights, or of a line's intervals.
///
/// Interpolation is worst where the magnet is lowest, and a rim is lower than any middle.
fn places_on(points: &ConstraintPoints, most: usize) -> Vec<[f64; 3]> {
    let Some(lowest_m) = lowest_requested_m(points.height_m.iter().copied()) else {
        return Vec::new();
    };
    let rows = points.row_of_grid_point();
    let [columns, lines] = points.grid.samples();
    let [right, above] = [columns, lines].map(|samples| usize::from(samples > 1));
    let middles = (0..rows.len())
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
            Some(middle)
        });
    let each = (0..points.height_m.len())
        .map(|row| [points.x_m[row], points.y_m[row], points.height_m[row]]);
    let all = middles.chain(each).filter(|[_, _, z_m]| *z_m >= lowest_m);
    let mut all: Vec<[f64; 3]> = all.collect();
    let by_height = |a: &[f64; 3], b: &[f64; 3]| a[2].total_cmp(&b[2]);
    let low = all.len().min(LOWEST);
    if low < all.len() {
        all.select_nth_unstable_by(low, by_height);
    }
    let (lowest, others) = all.split_at_mut(low);
    lowest.sort_by(by_height);
    let of_others = spread(others.len(), most / 2);
    let of_lowest = (most - of_others.len()).min(low);
    let mut chosen: Vec<usize> = (0..of_lowest)
        .map(|n| ((n as f64 / of_lowest as f64).powi(2) * low as f64) as usize)
        .collect();
    chosen.dedup();
    let chosen = chosen.into_iter().map(|place| lowest[place]);
    chosen
        .chain(of_others.into_iter().map(|place| others[place]))
        .collect()
}

/// A map against the field itself, over the surface between its points.
pub(crate) struct MapEffect<'a> {
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) solved: &'a Solved,
    pub(crate) field: ShapeField<'a>,
    pub(crate) points: &'a ConstraintPoints,
    pub(crate) lambda_n_per_m: f64,
    pub(crate) currents_a: &'a [f64],
    /// Whether all three components of the force are requested.
    pub(crate) vector: bool,
}

impl MapEffect<'_> {
    /// Places at which a map's nodes are chosen.
    pub(crate) fn choosing_places(&self) -> Vec<[f64; 3]> {
        places_on(self.points, CHOOSING_PLACES)
    }

    /// The part of interpolation on a `grid` as few `places` show it, at which only the nodes that take part are
    /// computed; with that of the unpowered steel's pull, where that counts.
    ///
    /// # Errors
    /// Forces that cannot be computed; interruption.
    pub(crate) fn interpolation_at(
        &self,
        places: &[[f64; 3]],
        grid: &Grid,
        progress: &dyn Progress,
    ) -> Result<f64, RunError> {
        let nodes = [&grid.x_m, &grid.y_m, &grid.z_m];
        let mut positions = Vec::new();
        let mut weights: Vec<Option<Vec<f64>>> = Vec::new();
        for place in places {
            let along = [0, 1, 2].map(|axis| stencil(nodes[axis], place[axis]));
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
        let totals = self.forces_n(ShapeField::default(), &positions, progress)?;
        // A runtime interpolates the pull in a map of its own, whose error adds up with that of the currents' force.
        let pull = passive::counted(self.scene, &positions)?;
        let upward = |force_z_n: Vec<f64>| -> Vec<[f64; 3]> {
            force_z_n.into_iter().map(|z_n| [0.0, 0.0, z_n]).collect()
        };
        let pulls_n = pull.map(|pull| upward(pull.forces_z_n(&positions)));
        let largest_off = |forces_n: &[[f64; 3]]| {
            let (mut largest, mut first) = (0.0_f64, 0);
            for (place, own) in places.iter().zip(&weights) {
                let Some(own) = own else { continue };
                let along = |axis: usize| {
                    let nodes = own.iter().zip(&forces_n[first..]);
                    nodes.map(|(w, force)| w * force[axis]).sum::<f64>()
                };
                let interpolated = [0, 1, 2].map(along);
                largest = largest.max(self.off(interpolated, forces_n[first + own.len()], *place));
                first += own.len() + 1;
            }
            largest
        };
        let of_pull = pulls_n.map_or(0.0, |pulls_n| largest_off(&pulls_n));
        Ok(MARGIN * (largest_off(&totals) + of_pull))
    }

    /// The force of the currents at `positions`, N; along z alone where that alone is requested.
    fn forces_n(
        &self,
        field: ShapeField,
        positions: &[[f64; 3]],
        progress: &dyn Progress,
    ) -> Result<Vec<[f64; 3]>, RunError> {
        let (scene, solved) = (self.scene, self.solved);
        let coils = scene.coils.len();
        if self.vector {
            let forces =
                field.force_vectors_n_per_a("middles", scene, solved, positions, progress)?;
            let total = |row: &[[f64; 3]]| {
                [0, 1, 2].map(|axis| {
                    let each = row.iter().zip(self.currents_a);
                    each.map(|(force, i)| force[axis] * i).sum()
                })
            };
            return Ok(forces.chunks_exact(coils).map(total).collect());
        }
        let forces = field.forces_n_per_a("middles", scene, solved, positions, progress)?;
        let total = |row: &[f64]| row.iter().zip(self.currents_a).map(|(f, i)| f * i).sum();
        let upward = forces.chunks_exact(coils).map(total);
        Ok(upward.map(|z_n| [0.0, 0.0, z_n]).collect())
    }

    /// Size of the difference of two forces at `place`, N, over lambda times its height.
    fn off(&self, a: [f64; 3], b: [f64; 3], place: [f64; 3]) -> f64 {
        norm(minus(a, b)) / (self.lambda_n_per_m * place[2])
    }

    /// The part of interpolation; `None` where nothing is requested within the map.
    ///
    /// # Errors
    /// Forces that cannot be computed; interruption.
    pub(crate) fn interpolation(
        &self,
        map: &SceneMap,
        progress: &dyn Progress,
    ) -> Result<Option<BudgetPart>, RunError> {
        let places = places_on(self.points, MOST_PLACES);
        let direct = self.forces_n(self.field, &places, progress)?;
        let off = places.iter().zip(direct).filter_map(|(place, direct)| {
            let by_map = map.force_n(self.scene.moment_a_m2, self.currents_a, *place)?;
            Some(self.off(by_map, direct, *place))
        });
        Ok(off.reduce(f64::max).map(|largest| BudgetPart {
            part: BudgetName::Interpolation,
            error: MARGIN * largest,
            how: format!(
                "an estimate: {MARGIN} times the largest difference between map and field at up to \
                 {MOST_PLACES} places of the surface, at its points and between them, most of them low"
            ),
        }))
    }

    /// The part of the pull's map, whose nodes are known to `at_nodes` of the requested force; `None` as of
    /// [`Self::interpolation`].
    pub(crate) fn of_pull(&self, passive: &PassiveMap, at_nodes: f64) -> Option<BudgetPart> {
        let places = places_on(self.points, MOST_PLACES);
        let off = passive.off_between_n(&places);
        let relative = off.map(|([_, _, z_m], off_n)| off_n / (self.lambda_n_per_m * z_m));
        relative.reduce(f64::max).map(|largest| BudgetPart {
            part: BudgetName::PullMap,
            error: at_nodes + MARGIN * largest,
            how: format!(
                "the stated error of the pull at the map's nodes, times its largest share of the requested force; and an \
                 estimate of interpolation: {MARGIN} times its largest difference at the same places"
            ),
        })
    }
}
