//! The same supremum for the four formulas, by branch and bound.
//!
//! Each of them is a concave function. Along either axis the bilinear interpolant is linear, so
//! interpolant minus surface is convex along each axis and largest at the corners, where it
//! vanishes: the surface never lies below. How far it lies above is bounded on a rectangle by the
//! tangent plane at its centre, whose difference from the interpolant is largest at a corner.

use rayon::prelude::*;

use super::piece::{Extreme, Patch, Point, Rect};
use super::{Cells, Requested, Vertical};
use crate::height::{Grid, Sample};
use crate::primitive::PlacedPrimitive;
use fluxform_numerics::axis::Axis;

/// Relative width at which the search ends.
const NARROW: f64 = 1e-6;
/// Rectangles looked at, at most, beyond one per cell.
const MOST: usize = 200_000;

/// [`primitive`] of every cell by itself, x fastest, m; `None` where a corner has no surface.
#[must_use]
pub fn primitive_by_cell(
    shape: &PlacedPrimitive,
    grid: &Grid,
    heights: &[Option<f64>],
) -> Vec<Option<f64>> {
    let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
    let columns = x.len().saturating_sub(1);
    let axis = |nodes: &[f64], at: usize| Axis {
        from: nodes[at],
        to: nodes[at + 1],
        samples: 2,
    };
    let cells = columns * y.len().saturating_sub(1);
    (0..cells)
        .into_par_iter()
        .with_min_len(fluxform_base::progress::items_a_task(cells))
        .map(|cell| {
            let (column, row) = (cell % columns, cell / columns);
            let node = row * x.len() + column;
            let corners = [0, 1, x.len(), x.len() + 1].map(|k| heights[node + k]);
            let cell = Grid {
                x_m: axis(&x, column),
                y_m: axis(&y, row),
            };
            corners
                .iter()
                .all(Option::is_some)
                .then(|| primitive(shape, &cell, &corners).bound_m())
        })
        .collect()
}

/// The supremum of the vertical difference over all cells of four points.
///
/// Error: `slack_m`, 1e-6 of the supremum unless the rectangles run out.
#[must_use]
pub fn primitive(shape: &PlacedPrimitive, grid: &Grid, heights: &[Option<f64>]) -> Vertical {
    let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
    let mut open: Vec<(f64, Rect, Patch)> = Vec::new();
    let mut best = Extreme::NONE;
    let requested = Requested::of(heights);
    let over =
        |patch: &Patch| requested.map_or(f64::INFINITY, |requested| requested.height_m(patch));
    let mut relative = 0.0_f64;
    let mut cells = Cells::default();
    let mut largest_m = 0.0_f64;
    for row in 0..y.len().saturating_sub(1) {
        for column in 0..x.len().saturating_sub(1) {
            let node = row * x.len() + column;
            let corners = [0, 1, x.len(), x.len() + 1].map(|k| heights[node + k]);
            let [Some(a), Some(b), Some(c), Some(d)] = corners else {
                cells.silhouette += usize::from(corners.iter().any(Option::is_some));
                continue;
            };
            cells.inner += 1;
            let rect = Rect {
                low_m: [x[column], y[row]],
                high_m: [x[column + 1], y[row + 1]],
            };
            let corners_m = [a, b, c, d];
            largest_m = corners_m.iter().fold(largest_m, |m, h| m.max(h.abs()));
            let patch = Patch { rect, corners_m };
            best = best.or(Extreme {
                value_m: 0.0,
                at_m: rect.low_m,
            });
            let (at, bound) = look(shape, &rect, &patch);
            best = best.or(at);
            relative = relative.max(at.value_m / over(&patch));
            open.push((bound, rect, patch));
        }
    }
    let rounding_m = 16.0 * f64::EPSILON * largest_m;
    let mut looked = 0;
    let (mut bound, mut relative_bound) = (best.value_m, relative);
    while !open.is_empty() {
        let enough = best.value_m * (1.0 + NARROW) + rounding_m;
        let relative_enough = |patch: &Patch| relative * (1.0 + NARROW) + rounding_m / over(patch);
        open.retain(|(bound, _, patch)| {
            *bound > enough || *bound / over(patch) > relative_enough(patch)
        });
        looked += 4 * open.len();
        bound = open.iter().fold(enough, |m, (bound, _, _)| m.max(*bound));
        relative_bound = (open.iter()).fold(relative * (1.0 + NARROW), |m, (bound, _, patch)| {
            m.max(*bound / over(patch))
        });
        if looked > MOST {
            break;
        }
        let mut next = Vec::with_capacity(4 * open.len());
        for (_, rect, patch) in &open {
            for quarter in rect.quarters() {
                let (at, bound) = look(shape, &quarter, patch);
                best = best.or(at);
                relative = relative.max(at.value_m / over(patch));
                next.push((bound, quarter, *patch));
            }
        }
        open = next;
    }
    Vertical {
        above: best,
        below: Extreme {
            value_m: 0.0,
            at_m: best.at_m,
        },
        rounding_m,
        slack_m: (bound - best.value_m).max(0.0),
        relative: requested
            .filter(|_| cells.inner > 0)
            .map(|requested| relative_bound + rounding_m / requested.lowest_m),
        cells,
    }
}

/// Surface minus patch at the centre of the rectangle, and a bound of it over all of that.
fn look(shape: &PlacedPrimitive, rect: &Rect, patch: &Patch) -> (Extreme, f64) {
    let centre = rect.centre();
    let Some(Sample { height_m, normal }) = shape.sample(centre[0], centre[1]) else {
        return (Extreme::NONE, 0.0);
    };
    let at = Extreme {
        value_m: height_m - patch.height_m(centre),
        at_m: centre,
    };
    let tangent = |p: Point| {
        let rise = normal[0] * (p[0] - centre[0]) + normal[1] * (p[1] - centre[1]);
        height_m - rise / normal[2]
    };
    let bound = rect.corners().iter().fold(f64::NEG_INFINITY, |most, p| {
        most.max(tangent(*p) - patch.height_m(*p))
    });
    (at, bound)
}
