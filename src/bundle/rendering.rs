//! Data for rendering with position feedback in addition to the map, as arrays of `map.npz`: the
//! heights on their grid, the static currents, and the coils' circuit.
//!
//! `height_x_m`, `height_y_m`, `height_m` `[y, x]` and `has_height` `[y, x]` (1 where there is a
//! surface, 0 where not, and there the height is 0), `static_current_a` (one per coil),
//! `inductance_h` `[coil, coil]`, and `voltage_v` (no dimension) where the supply's is known. All
//! are f64, the flags too, so that loaders of older bundles pass over them. New in schema 1.2.
//!
//! Bundles that request all three components of the force hold `requested_direction` `[y, x, 3]` too, the
//! requested force over lambda times the height, and `sideways_weight` (no dimension): out of reach
//! the nearest force is given, a sideways error counting as that share of an upward one. Such
//! bundles hold the maps of all three components.
//!
//! Bundles made with uncertainties hold `robust_setting` (5): price of power (N^2/W), how far the magnet may be
//! from where it is measured (m), mean square and mean of its strength over the stated one, mean square of a
//! driver's relative error.

use super::array_check::{Array, NpzError, bad, check_nodes};
use super::manifest::PointsGrid;
use super::table::PointRow;
use fluxform_lambda::uncertainty::RobustRuntime;
use fluxform_numerics::lagrange::AT_NODE;

pub(super) const HEIGHT_X: &str = "height_x_m";
pub(super) const HEIGHT_Y: &str = "height_y_m";
pub(super) const HEIGHT: &str = "height_m";
pub(super) const HAS_HEIGHT: &str = "has_height";
pub(super) const STATIC_CURRENT: &str = "static_current_a";
pub(super) const INDUCTANCE: &str = "inductance_h";
pub(super) const VOLTAGE: &str = "voltage_v";
pub(super) const DIRECTION: &str = "requested_direction";
pub(super) const SIDEWAYS_WEIGHT: &str = "sideways_weight";
/// The setting for uncertainties: five numbers, each of its own kind.
pub const ROBUST: &str = "robust_setting";

/// A smaller sideways weight could not be distinguished from rounding.
const LEAST_WEIGHT: f64 = 1e-6;

/// Heights, static currents and circuit.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendering {
    /// The object's surface.
    pub heights: HeightGrid,
    /// The bundle's fixed currents, A, one per coil of the array.
    pub static_current_a: Vec<f64>,
    /// `[i][j]`: flux through coil i for one ampere in coil j, H, row by row.
    pub inductance_h: Vec<f64>,
    /// The supply's, V.
    pub voltage_v: Option<f64>,
    /// The requested force vector; `None` where the upward component alone is requested.
    pub requested: Option<Requested>,
    /// The setting of currents chosen for the uncertainties; `None` where none were given.
    pub robust: Option<RobustRuntime>,
}

/// The force vector that is requested over a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Requested {
    /// `[y, x, 3]` on the nodes of the heights: the force over lambda times the height; (0, 0, 1) where
    /// there is no surface.
    pub direction: Vec<f64>,
    /// Out of reach a sideways error counts as this share of an upward one; above 0, at most 1.
    pub sideways_weight: f64,
}

impl Rendering {
    /// Its arrays in `map.npz`, for an array of `coils`.
    pub(super) fn arrays(&self, coils: usize) -> Vec<Array<'_>> {
        let heights = &self.heights;
        let (nx, ny) = (heights.x_m.len(), heights.y_m.len());
        let mut arrays = vec![
            Array::new(HEIGHT_X, &[nx], &heights.x_m),
            Array::new(HEIGHT_Y, &[ny], &heights.y_m),
            Array::new(HEIGHT, &[ny, nx], &heights.height_m),
            Array::new(HAS_HEIGHT, &[ny, nx], &heights.has_height),
            Array::new(STATIC_CURRENT, &[coils], &self.static_current_a),
            Array::new(INDUCTANCE, &[coils, coils], &self.inductance_h),
        ];
        if let Some(voltage) = &self.voltage_v {
            arrays.push(Array::new(VOLTAGE, &[], std::slice::from_ref(voltage)));
        }
        if let Some(robust) = &self.robust {
            arrays.push(Array::new(ROBUST, &[5], robust_numbers(robust).to_vec()));
        }
        if let Some(requested) = &self.requested {
            let weight = std::slice::from_ref(&requested.sideways_weight);
            arrays.push(Array::new(DIRECTION, &[ny, nx, 3], &requested.direction));
            arrays.push(Array::new(SIDEWAYS_WEIGHT, &[], weight));
        }
        arrays
    }

    /// Order and ranges of what its arrays hold.
    pub(super) fn validate(&self) -> Result<(), NpzError> {
        let heights = &self.heights;
        for (name, nodes) in [(HEIGHT_X, &heights.x_m), (HEIGHT_Y, &heights.y_m)] {
            if nodes.is_empty() || !nodes.is_sorted_by(|a, b| a < b) {
                return Err(bad(name, "must increase from node to node"));
            }
        }
        check_nodes(HEIGHT_X, &heights.x_m)?;
        check_nodes(HEIGHT_Y, &heights.y_m)?;
        if !heights
            .has_height
            .iter()
            .all(|&has| has == 0.0 || has == 1.0)
        {
            return Err(bad(HAS_HEIGHT, "must hold 0 or 1"));
        }
        let weight = self.requested.as_ref().map(|it| it.sideways_weight);
        if weight.is_some_and(|weight| !(LEAST_WEIGHT..=1.0).contains(&weight)) {
            return Err(bad(SIDEWAYS_WEIGHT, "must lie between 1e-6 and 1"));
        }
        let robust = self.robust.as_ref().map(robust_numbers);
        if robust.is_some_and(|numbers| numbers[0] == 0.0 || numbers.iter().any(|it| *it < 0.0)) {
            return Err(bad(ROBUST, "must hold a price above 0 and nothing below 0"));
        }
        Ok(())
    }
}

/// The numbers of `robust_setting`, in its order.
pub(super) fn robust_numbers(of: &RobustRuntime) -> [f64; 5] {
    let RobustRuntime {
        price_n2_per_w,
        sensor_m,
        square,
        mean,
        driver_square,
    } = *of;
    [price_n2_per_w, sensor_m, square, mean, driver_square]
}

/// A surface's heights on a grid; not everywhere is a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightGrid {
    /// Nodes along x, m, strictly increasing.
    pub x_m: Vec<f64>,
    /// Nodes along y, m, strictly increasing.
    pub y_m: Vec<f64>,
    /// `[y, x]`, m; 0 where there is no surface.
    pub height_m: Vec<f64>,
    /// `[y, x]`: 1 where there is a surface, else 0.
    pub has_height: Vec<f64>,
}

impl HeightGrid {
    /// The heights of a bundle's points, in the order of their grid's flags; `None` where the two
    /// do not fit each other.
    #[must_use]
    pub fn of_points(grid: &PointsGrid, points: &[PointRow]) -> Option<Self> {
        let flags = grid.flags()?;
        let mut rows = points.iter();
        let mut height_m = vec![0.0; flags.len()];
        for (height, _) in height_m.iter_mut().zip(&flags).filter(|(_, flag)| **flag) {
            *height = rows.next()?.height_m;
        }
        Some(Self {
            x_m: grid.x_m.axis().nodes(),
            y_m: grid.y_m.axis().nodes(),
            height_m,
            has_height: flags
                .iter()
                .map(|flag| f64::from(u8::from(*flag)))
                .collect(),
        })
    }

    /// These heights with those of `points` at its nodes; `None` where its grid is not one of every so many nodes of
    /// this one.
    #[must_use]
    pub fn through(mut self, points: &Self) -> Option<Self> {
        let columns = Every::of(&self.x_m, &points.x_m)?;
        let rows = Every::of(&self.y_m, &points.y_m)?;
        columns.copy(&points.x_m, &mut self.x_m);
        rows.copy(&points.y_m, &mut self.y_m);
        let (wide, narrow) = (self.x_m.len(), points.x_m.len());
        for row in 0..points.y_m.len() {
            for column in 0..narrow {
                let to = rows.at(row) * wide + columns.at(column);
                let from = row * narrow + column;
                self.height_m[to] = points.height_m[from];
                self.has_height[to] = points.has_height[from];
            }
        }
        Some(self)
    }

    /// Whether these are the heights of `points` at its nodes, every so many of its own.
    pub(super) fn goes_through(&self, points: &Self) -> bool {
        self.clone().through(points).as_ref() == Some(self)
    }

    /// The height at (x, y), m, bilinear between the four nodes around it; `None` off the grid and
    /// where a node that takes part has no surface. An axis of one node has a value on it alone.
    #[must_use]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let cell = self.cell(x_m, y_m)?;
        Some(cell.value(|node| self.height_m[node]))
    }

    /// The height there and the direction of the force requested, bilinear between the nodes of `[y, x, 3]`
    /// `direction`.
    ///
    /// # Panics
    /// When `direction` is shorter than that.
    #[must_use]
    pub fn height_and_direction(
        &self,
        x_m: f64,
        y_m: f64,
        direction: &[f64],
    ) -> Option<(f64, [f64; 3])> {
        let cell = self.cell(x_m, y_m)?;
        let height = cell.value(|node| self.height_m[node]);
        Some((
            height,
            std::array::from_fn(|k| cell.value(|node| direction[3 * node + k])),
        ))
    }

    fn cell(&self, x_m: f64, y_m: f64) -> Option<SurfaceCell> {
        let (column, s) = between(&self.x_m, x_m)?;
        let (row, t) = between(&self.y_m, y_m)?;
        let stride = self.x_m.len();
        let at = row * stride + column;
        // A node of no weight is not asked: it may lie beyond the grid.
        let right = usize::from(s > 0.0);
        let above = if t > 0.0 { stride } else { 0 };
        let nodes = [at, at + right, at + above, at + above + right];
        let weights = [1.0 - s, s, 1.0 - t, t];
        for (k, &node) in nodes.iter().enumerate() {
            let weight = weights[k & 1] * weights[2 + (k >> 1)];
            if weight > 0.0 && self.has_height[node] == 0.0 {
                return None;
            }
        }
        Some(SurfaceCell {
            nodes,
            share: [s, t],
        })
    }
}

/// Every so many nodes of an axis.
struct Every(usize);

impl Every {
    /// Those that another axis of the same ends may be; `None` where its nodes do not divide it.
    fn of(fine: &[f64], coarse: &[f64]) -> Option<Self> {
        let intervals = |nodes: &[f64]| nodes.len().checked_sub(1);
        match (intervals(fine)?, intervals(coarse)?) {
            (0, 0) => Some(Self(1)),
            (fine, coarse) => (coarse > 0 && fine % coarse == 0).then(|| Self(fine / coarse)),
        }
    }

    fn at(&self, index: usize) -> usize {
        index * self.0
    }

    /// The coarse axis's own last bits.
    fn copy(&self, coarse: &[f64], fine: &mut [f64]) {
        for (index, node) in coarse.iter().enumerate() {
            fine[self.at(index)] = *node;
        }
    }
}

/// Four nodes with surface around a position, and its shares of the cell's width along x and y.
struct SurfaceCell {
    nodes: [usize; 4],
    share: [f64; 2],
}

impl SurfaceCell {
    fn value(&self, at: impl Fn(usize) -> f64) -> f64 {
        let ([s, t], h) = (self.share, self.nodes.map(at));
        let low = (1.0 - s) * h[0] + s * h[1];
        let high = (1.0 - s) * h[2] + s * h[3];
        (1.0 - t) * low + t * high
    }
}

/// The cell that holds a position, and the position's share of its width, 0 at a node; `None` outside.
fn between(nodes: &[f64], position: f64) -> Option<(usize, f64)> {
    let last = nodes.len().checked_sub(1)?;
    if last == 0 {
        return (position == nodes[0]).then_some((0, 0.0));
    }
    let above = nodes.partition_point(|&node| node <= position);
    let cell = above.saturating_sub(1).min(last - 1);
    let (from, to) = (nodes[cell], nodes[cell + 1]);
    let share = (position - from) / (to - from);
    for node in [0, 1] {
        if (share - node as f64).abs() <= AT_NODE {
            return Some((cell + node, 0.0));
        }
    }
    (share > 0.0 && share < 1.0).then_some((cell, share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fluxform_numerics::axis::Axis;

    /// A saddle on uneven nodes: bilinear in every cell.
    fn grid() -> HeightGrid {
        let (x_m, y_m) = (vec![-0.03, 0.01, 0.02, 0.07], vec![0.1, 0.14, 0.21]);
        let saddle = |x: f64, y: f64| 0.05 + 0.3 * x - 0.7 * y + 1.3 * x * y;
        let heights = y_m
            .iter()
            .flat_map(|&y| x_m.iter().map(move |&x| saddle(x, y)));
        HeightGrid {
            height_m: heights.collect(),
            has_height: vec![1.0; 12],
            x_m,
            y_m,
        }
    }

    #[test]
    fn a_saddle_is_met_everywhere_and_nothing_beyond() {
        let grid = grid();
        for step in 0..=70 {
            let x = (-0.03 + 0.1 * f64::from(step) / 70.0).min(0.07);
            let y = (0.1 + 0.11 * f64::from((step * 13) % 71) / 70.0).min(0.21);
            let want = 0.05 + 0.3 * x - 0.7 * y + 1.3 * x * y;
            assert!(
                (grid.height_m(x, y).unwrap() - want).abs() < 1e-15,
                "{x} {y}"
            );
        }
        for (x, y) in [
            (-0.0301, 0.12),
            (0.0, 0.2101),
            (f64::NAN, 0.12),
            (0.0, 0.09),
        ] {
            assert_eq!(grid.height_m(x, y), None);
        }
    }

    #[test]
    fn there_is_no_surface_in_a_cell_with_a_missing_corner_but_on_its_other_sides() {
        let mut grid = grid();
        grid.has_height[5] = 0.0; // (0.01, 0.14)
        grid.height_m[5] = 0.0;
        assert_eq!(grid.height_m(0.0, 0.13), None);
        assert_eq!(grid.height_m(0.01, 0.14), None);
        assert_eq!(grid.height_m(0.015, 0.2), None);
        assert!(grid.height_m(0.0, 0.1).is_some(), "the lower side");
        assert!(grid.height_m(0.02, 0.14).is_some(), "a corner with surface");
        assert!(grid.height_m(0.03, 0.2).is_some(), "another cell");
        // Rounding asks no node of no weight, and leaves none behind.
        for off in [-1e-16, 0.0, 1e-16] {
            assert!(grid.height_m(0.02 + off, 0.14 + off).is_some(), "{off}");
            assert!(grid.height_m(-0.03 + off, 0.1 - off).is_some(), "{off}");
            assert!(grid.height_m(0.07 - off, 0.21 + off).is_some(), "{off}");
            assert_eq!(grid.height_m(0.01 + off, 0.14 - off), None, "{off}");
        }
    }

    #[test]
    fn single_nodes_and_flags_are_read_in_their_order() {
        let axis = |from, to, samples| Axis { from, to, samples };
        let grid = PointsGrid::new(axis(0.0, 0.2, 3), axis(0.7, 0.7, 1), &[true, false, true]);
        let point = |x_m, height_m| PointRow {
            x_m,
            y_m: 0.7,
            height_m,
            normal: [0.0, 0.0, 1.0],
        };
        let points = [point(0.0, 0.03), point(0.2, 0.05)];
        let heights = HeightGrid::of_points(&grid, &points).unwrap();
        assert_eq!(heights.height_m(0.2, 0.7), Some(0.05));
        assert_eq!(heights.height_m(0.2, 0.700_001), None);
        assert_eq!(heights.height_m(0.05, 0.7), None);
        assert_eq!(HeightGrid::of_points(&grid, &points[..1]), None);
    }

    #[test]
    fn finer_heights_go_through_the_points_and_no_others_do() {
        let axis = |samples| Axis {
            from: -0.7,
            to: 1.3,
            samples,
        };
        let grid = |samples: usize, flags: &[bool], height_m: fn(f64) -> f64| {
            let axis = axis(samples);
            let points: Vec<PointRow> = (0..samples * samples)
                .filter(|k| flags[*k])
                .map(|k| PointRow {
                    x_m: axis.node(k % samples),
                    y_m: axis.node(k / samples),
                    height_m: height_m(axis.node(k % samples)),
                    normal: [0.0, 0.0, 1.0],
                })
                .collect();
            HeightGrid::of_points(&PointsGrid::new(axis, axis, flags), &points).unwrap()
        };
        let mut flags = [true; 9];
        flags[2] = false;
        let points = grid(3, &flags, |x| 0.3 + 0.1 * x);
        let fine = grid(7, &[true; 49], |x| 0.3 + 0.1 * x + 1e-17);
        let through = fine.clone().through(&points).unwrap();
        assert!(through.goes_through(&points) && points.goes_through(&points));
        assert_eq!(through.height_m[3 * 7 + 3], points.height_m[4]);
        assert_eq!(through.has_height[6], 0.0);
        assert!(
            !fine.goes_through(&points),
            "a node without surface has none"
        );
        let mut other = through.clone();
        other.height_m[3 * 7 + 3] += 1e-9;
        assert!(!other.goes_through(&points));
        other.height_m[3 * 7 + 3] -= 1e-9;
        other.x_m[3] += 1e-9;
        assert!(!other.goes_through(&points));
        // Nodes of six intervals are not among those of four.
        assert_eq!(
            grid(5, &[true; 25], |x| 0.3 + x).through(&grid(4, &[true; 16], |x| 0.3 + x)),
            None
        );
    }
}
