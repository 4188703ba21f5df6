//! The pull of the unpowered steel over a map's grid.
//!
//! One value costs half a millisecond and a grid has a hundred thousand nodes, so it is interpolated
//! from a table (`passive_table`), and the error of that is measured at places off the table's nodes.

use std::f64::consts::PI;

use super::Scene;
use super::passive::{self, Pull};
use super::passive_table::{
    ATTEMPTS, Layout, TABLE_SHARE, Table, axial_m, symmetries_of, tabulated,
};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::map::error_scale;
use crate::map::tabulate::Grid;
use crate::numerics::lagrange;

/// Places off the nodes at which the table is compared with the pull itself.
const HELD_OUT: usize = 48;
/// Places find the largest error but for this factor: over one cored coil a finer map differs somewhere by three
/// times what the places of both showed.
const MISSED: f64 = 4.0;
/// See `map::interpolation`: samples find the largest error but for this factor.
const SAFETY: f64 = 1.25;

/// The pull on a grid, and what is known of it.
#[derive(Debug, Clone)]
pub struct PassiveMap {
    /// Vertical force, N, [z, y, x].
    pub force_z_n: Vec<f64>,
    /// Largest pull on the lowest plane, N.
    pub largest_n: f64,
    /// Estimated error of the nodes.
    pub accuracy: StageAccuracy,
    /// A sentence on a tolerance that is not reached.
    pub warning: Option<String>,
    /// Error of interpolating between nodes, relative to the largest pull at the height, or on the nodes around it
    /// where that is smaller.
    pub between: f64,
    /// Places at which `between` was looked for.
    pub samples: usize,
    /// Evaluations of the pull that it took.
    pub evaluations: usize,
    /// Its grid, and the table that it was read from.
    grid: Grid,
    table: Table,
}

impl PassiveMap {
    /// The pull on the magnet with its centre on the nodes of `grid`, to about `tolerance`;
    /// `None` without steel.
    ///
    /// # Errors
    /// A magnet that touches the steel.
    pub fn new(scene: &Scene, grid: &Grid, tolerance: f64) -> Result<Option<Self>, RunError> {
        let Some((top_m, _)) = scene.steel_extent_m() else {
            return Ok(None);
        };
        let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
        let ranges = [ends(&grid.x_m), ends(&grid.y_m), ends(&grid.z_m)];
        let corners = [0, 1].map(|end| ranges.map(|range| range[end]));
        let Some(pull) = passive::pull_to(scene, &corners, false, tolerance)? else {
            return Ok(None);
        };
        let tolerance = passive::tolerance_of(scene, tolerance);
        let below_m = [top_m, axial_m(scene)];
        let turns = symmetries_of(scene, ranges);
        let [mut aim, allowed] = tabulated(tolerance, pull.relative_error());
        let mut evaluations = 0;
        let mut best: Option<(f64, Table, Vec<f64>)> = None;
        for _ in 0..ATTEMPTS {
            let layout = Layout::new(ranges, below_m, &turns, aim);
            evaluations += layout.evaluations();
            let table = layout.filled(|places_m| pull.forces_z_n(places_m));
            let values = table.on(grid);
            let error = held_out_error(&pull, &table, grid, &values, scene);
            if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                best = Some((error, table, values));
            }
            if error <= allowed {
                break;
            }
            aim *= 0.1;
        }
        let Some((error, table, force_z_n)) = best else {
            return Ok(None);
        };
        let (between, samples) = between(&table, grid, &force_z_n);
        let plane = grid.x_m.len() * grid.y_m.len();
        let largest_n = largest(&force_z_n[..plane]);
        let accuracy = StageAccuracy {
            estimate: MISSED * (pull.relative_error() + error),
            relative_to: "the largest pull at the node's height".to_owned(),
            method: format!(
                "{MISSED} times the sum of the pull's own error by finer solutions at places \
                 spread over the grid, {:.1e}, and that of tabulating it by comparison at {HELD_OUT} places off the \
                 table's nodes, {error:.1e}",
                pull.relative_error()
            ),
        };
        // What the tables may add counts as within the tolerance.
        let is_missed = pull.relative_error() + error > (1.0 + 2.0 * TABLE_SHARE) * tolerance;
        let warning = passive::warning(&accuracy, tolerance, largest_n).filter(|_| is_missed);
        Ok(Some(Self {
            largest_n,
            force_z_n,
            accuracy,
            warning,
            between,
            samples,
            evaluations,
            grid: grid.clone(),
            table,
        }))
    }

    /// By how much interpolation between the nodes is off, N, at those of `places_m` that lie inside the grid.
    pub fn off_between_n(&self, places_m: &[[f64; 3]]) -> impl Iterator<Item = ([f64; 3], f64)> {
        let Grid { x_m, y_m, z_m } = &self.grid;
        places_m.iter().filter_map(|at| {
            let cell = lagrange::locate([x_m, y_m, z_m], *at)?;
            Some((
                *at,
                (cell.value(&self.force_z_n) - self.table.at(*at)).abs(),
            ))
        })
    }

    /// The sentence on [`PassiveMap::between`].
    #[must_use]
    pub fn definition(&self) -> String {
        format!(
            "of the pull, relative to the largest pull at that height (on the nodes around it, where that is \
             smaller): {SAFETY} times the largest difference from its table at {} places in the middles of cells, \
             faces and edges",
            self.samples
        )
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0_f64, |most, v| most.max(v.abs()))
}

/// Largest difference of the table from the pull, relative to the largest at that height of the
/// grid: beside the first axes at the lowest height, and spread over the region, most of them low.
fn held_out_error(pull: &Pull, table: &Table, grid: &Grid, values: &[f64], scene: &Scene) -> f64 {
    let plane = grid.x_m.len() * grid.y_m.len();
    let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
    let (x, y) = (ends(&grid.x_m), ends(&grid.y_m));
    let axes = &scene.design.array.positions_m;
    let radius_m =
        (scene.core.as_ref()).map_or(scene.winding.outer_radius_m, |core| core.shape.radius_m);
    let places: Vec<(usize, [f64; 3])> = (0..HELD_OUT)
        .map(|k| {
            let part = |step: f64| (0.5 + step * k as f64).fract();
            let at = |[from, to]: [f64; 2], part: f64| from + part * (to - from);
            let (u, v, w) = (
                part(0.671_043_607),
                part(0.549_700_478),
                part(0.819_172_513),
            );
            if k % 3 == 0 {
                let [cx, cy] = axes[(k / 3) % axes.len()];
                let r_m = 1.5 * radius_m * w;
                let (s, c) = (2.0 * PI * u).sin_cos();
                let beside = [cx + r_m * c, cy + r_m * s];
                let within = [beside[0].clamp(x[0], x[1]), beside[1].clamp(y[0], y[1])];
                (0, [within[0], within[1], grid.z_m[0]])
            } else {
                let level = (w * w * grid.z_m.len() as f64) as usize;
                (level, [at(x, u), at(y, v), grid.z_m[level]])
            }
        })
        .collect();
    let points: Vec<[f64; 3]> = places.iter().map(|(_, at)| *at).collect();
    places
        .iter()
        .zip(pull.forces_z_n(&points))
        .map(|((level, [x, y, z]), sure)| {
            let found = table.at([*x, *y, *z]);
            let size = largest(&values[level * plane..(level + 1) * plane]);
            (found - sure).abs() / size.max(f64::MIN_POSITIVE)
        })
        .fold(0.0, f64::max)
}

/// Error of the tricubic interpolation against the table, and at how many places.
fn between(table: &Table, grid: &Grid, values: &[f64]) -> (f64, usize) {
    let middles = |nodes: &[f64]| -> Vec<f64> {
        match nodes {
            [single] => vec![*single],
            _ => nodes
                .windows(2)
                .map(|pair| 0.5 * (pair[0] + pair[1]))
                .collect(),
        }
    };
    let [x, y, z] = [&grid.x_m, &grid.y_m, &grid.z_m];
    let levels: Vec<f64> = values.chunks(x.len() * y.len()).map(largest).collect();
    let (mut worst, mut samples) = (0.0_f64, 0);
    for (x_m, y_m, z_m) in [
        (middles(x), middles(y), middles(z)),
        (middles(x), y.clone(), z.clone()),
        (x.clone(), middles(y), z.clone()),
        (x.clone(), y.clone(), middles(z)),
    ] {
        let places = Grid { x_m, y_m, z_m };
        let exact = table.on(&places);
        let plane = places.x_m.len() * places.y_m.len();
        for (z_m, exact) in places.z_m.iter().zip(exact.chunks(plane)) {
            let mut error = 0.0_f64;
            for (i, exact) in exact.iter().enumerate() {
                let at = [
                    places.x_m[i % places.x_m.len()],
                    places.y_m[i / places.x_m.len()],
                    *z_m,
                ];
                if let Some(cell) = lagrange::locate([x, y, z], at) {
                    error = error.max((cell.value(values) - exact).abs());
                }
            }
            samples += plane;
            let size = error_scale(largest(exact), (z, &levels), *z_m);
            if size > 0.0 {
                worst = worst.max(SAFETY * error / size);
            }
        }
    }
    (worst, samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Need};

    /// `evaluate` warned of such a pull, `map` did not.
    #[test]
    fn a_tolerance_that_is_not_reached_is_named() {
        let text = "name = 'one'\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\nlength_mm = 20.0\n\
                    [wire]\ndiameter_mm = 0.7\n[core]\nrelative_permeability = 1000.0\n\
                    [magnet]\npassive_force = true\n[supply]\ncurrent_max_a = 2.0\n";
        let path = std::path::Path::new("one.toml");
        let (design, _) = Design::from_toml(text, path, Need::CALIBRATE).unwrap();
        let scene = Scene::new(&design).unwrap();
        let grid = Grid {
            x_m: vec![-0.01, 0.0, 0.01],
            y_m: vec![-0.01, 0.01],
            z_m: vec![0.02, 0.03],
        };
        let warned = |tolerance: f64| {
            let map = PassiveMap::new(&scene, &grid, tolerance).unwrap().unwrap();
            map.warning.unwrap_or_default()
        };
        assert_eq!(warned(1e-2), "");
        let text = warned(1e-13);
        assert!(text.contains("above its tolerance 1.0e-13"), "{text}");
    }
}
