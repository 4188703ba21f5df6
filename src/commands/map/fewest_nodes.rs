//! The fewest nodes of a workspace with which a map holds a requested error.

use std::ops::RangeInclusive;

use crate::RunError;
use crate::map::tabulate::Grid;
use crate::scene::Scene;

/// Share of the design's samples that is tried first.
const FIRST: f64 = 0.2;
/// Attempts at most.
const ATTEMPTS: usize = 8;
/// The interpolation's order.
const ORDER: f64 = 4.0;
/// A little more than the law says, so that the next attempt holds.
const SPARE: f64 = 1.05;
/// How much finer the nodes become from one attempt to the next.
const FINER: RangeInclusive<f64> = 1.1..=2.0;
/// Fewest nodes along an axis: those of a cubic.
const FEWEST: usize = 4;
/// Most values of all coils' maps that are tried.
const MOST_VALUES: f64 = 2e7;

/// The fewest nodes of the workspace of `scene` on which the error is not above the requested one, or the last that
/// were tried, with what `trial` made of them; it returns the error over the requested one, too. Of a grid what is
/// `tabulated` counts in the memory that is taken at most.
///
/// # Errors
/// Those of `trial`.
pub(crate) fn fewest_nodes<T>(
    scene: &Scene,
    tabulated: impl Fn(&Grid) -> Grid,
    mut trial: impl FnMut(&Grid) -> Result<(f64, T), RunError>,
) -> Result<(Grid, T), RunError> {
    let workspace = &scene.design.workspace;
    let sampled = |factor: f64| {
        let [x_m, y_m, z_m] = [workspace.x_m, workspace.y_m, workspace.z_m].map(|mut axis| {
            if axis.samples > 1 {
                let intervals = ((axis.samples - 1) as f64 * factor).round();
                axis.samples = (intervals as usize + 1).max(FEWEST);
            }
            axis.nodes()
        });
        Grid { x_m, y_m, z_m }
    };
    let values = |grid: &Grid| {
        let Grid { x_m, y_m, z_m } = tabulated(grid);
        let samples = [x_m, y_m, z_m].map(|nodes| nodes.len() as f64);
        samples.iter().product::<f64>() * scene.coils.len() as f64
    };
    let (mut factor, mut attempt, mut grid) = (FIRST, 1, sampled(FIRST));
    loop {
        let (excess, made) = trial(&grid)?;
        factor *= (SPARE * excess.powf(1.0 / ORDER)).clamp(*FINER.start(), *FINER.end());
        let finer = sampled(factor);
        if excess <= 1.0 || attempt == ATTEMPTS || values(&finer) > MOST_VALUES {
            return Ok((grid, made));
        }
        (attempt, grid) = (attempt + 1, finer);
    }
}
