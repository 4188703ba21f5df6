//! The pull of the unpowered steel over a map's grid.
//!
//! One value costs half a millisecond and a grid has a hundred thousand nodes. So the pull is
//! evaluated at few heights, Chebyshev nodes of ln(z - top), and there on Chebyshev nodes of x and
//! y, as many as the height above the steel asks for; of places that a symmetry of array, magnet
//! and region maps to each other, one. What lies between is interpolated, and the error of that is
//! measured at places off the nodes.

use std::f64::consts::PI;

use super::Scene;
use super::passive;
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::design::MagnetModel;
use crate::field::steel::passive::PassivePull;
use crate::map::tabulate::Grid;
use crate::numerics::lagrange;

/// Error of the table beside the pull's own, relative to the largest pull at the height.
const TABLE_SHARE: f64 = 0.3;
/// Attempts at the table, each with ten times less error aimed at.
const ATTEMPTS: usize = 3;
/// Places off the nodes at which the table is compared with the pull itself.
const HELD_OUT: usize = 48;
/// Places find the largest error but for this factor: for a tilted cylinder over a flat object at 50 mm a finer
/// map differs somewhere by one and a half times what the places of both showed.
const MISSED: f64 = 2.0;
/// Most nodes along one axis.
const MOST_NODES: usize = 160;
/// The pull falls about as this power of the height; taken out, so that its size does not decide.
const FALL: i32 = 4;
/// See `map::interpolation`: samples find the largest error but for this factor.
const SAFETY: f64 = 1.25;
/// Layers of cells in which the interpolation's error is looked for.
const LOWEST: usize = 4;

/// The pull on a grid, and what is known of it.
#[derive(Debug, Clone)]
pub struct PassiveMap {
    /// Vertical force, N, [z, y, x].
    pub force_z_n: Vec<f64>,
    /// Largest pull on the lowest plane, N.
    pub largest_n: f64,
    /// Estimated error of the nodes.
    pub accuracy: StageAccuracy,
    /// Error of interpolating between nodes, relative to the largest pull at the height.
    pub between: f64,
    /// Places at which `between` was looked for.
    pub samples: usize,
    /// Evaluations of the pull that it took.
    pub evaluations: usize,
}

impl PassiveMap {
    /// The pull on the magnet with its centre on the nodes of `grid`, to about `tolerance`;
    /// `None` without steel.
    ///
    /// # Errors
    /// A magnet that touches the steel.
    pub fn new(scene: &Scene, grid: &Grid, tolerance: f64) -> Result<Option<Self>, RunError> {
        let Some(core) = &scene.core else {
            return Ok(None);
        };
        let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
        let ranges = [ends(&grid.x_m), ends(&grid.y_m), ends(&grid.z_m)];
        let corners = [0, 1].map(|end| ranges.map(|range| range[end]));
        let Some(pull) = passive::pull_to(scene, &corners, false, tolerance)? else {
            return Ok(None);
        };
        let top_m = core.shape.top_m;
        let axial_m = match scene.design.magnet.model {
            MagnetModel::Dipole => 0.0,
            MagnetModel::Cylinder => 0.5 * scene.design.magnet.length_m,
        };
        let turns = symmetries(&scene.design.array.positions_m, scene.moment_a_m2, ranges);
        let mut aim = TABLE_SHARE * tolerance;
        let mut evaluations = 0;
        let mut best: Option<(f64, Table, Vec<f64>)> = None;
        for _ in 0..ATTEMPTS {
            let table = Table::new(&pull, ranges, [top_m, axial_m], &turns, aim);
            evaluations += table.evaluations;
            let values = table.on(grid);
            let error = held_out_error(&pull, &table, grid, &values, core.shape.radius_m, scene);
            if best.as_ref().is_none_or(|(least, ..)| error < *least) {
                best = Some((error, table, values));
            }
            if error <= TABLE_SHARE * tolerance {
                break;
            }
            aim *= 0.1;
        }
        let Some((error, table, force_z_n)) = best else {
            return Ok(None);
        };
        let (between, samples) = between(&table, grid, &force_z_n);
        let plane = grid.x_m.len() * grid.y_m.len();
        Ok(Some(Self {
            largest_n: largest(&force_z_n[..plane]),
            force_z_n,
            accuracy: StageAccuracy {
                estimate: MISSED * (pull.relative_error + error),
                relative_to: "the largest pull at the node's height".to_owned(),
                method: format!(
                    "{MISSED} times the sum of the pull's own error by finer solutions at places \
                     spread over the grid, {:.1e}, and that of tabulating it by comparison at {HELD_OUT} places off the \
                     table's nodes, {error:.1e}",
                    pull.relative_error
                ),
            },
            between,
            samples,
            evaluations,
        }))
    }

    /// The sentence on [`PassiveMap::between`].
    #[must_use]
    pub fn definition(&self) -> String {
        format!(
            "of the pull, relative to the largest pull at that height: {SAFETY} times the largest \
             difference from its table at {} places in the middles of cells, faces and edges, in the four \
             lowest layers and the highest, where it is largest",
            self.samples
        )
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0_f64, |most, v| most.max(v.abs()))
}

/// A map of the region to itself: x and y exchanged or not, then each mirrored or not.
#[derive(Debug, Clone, Copy)]
struct Turn {
    swap: bool,
    mirror: [bool; 2],
}

impl Turn {
    fn of<T: Copy>(self, [x, y]: [T; 2], mirrored: impl Fn(usize, T) -> T) -> [T; 2] {
        let pair = if self.swap { [y, x] } else { [x, y] };
        std::array::from_fn(|axis| match self.mirror[axis] {
            true => mirrored(axis, pair[axis]),
            false => pair[axis],
        })
    }
}

/// The maps of the region to itself under which the vertical pull stays the same. The pull is
/// quadratic in the moment, an axial vector: a mirror acts on it as on a polar one, up to a sign
/// that does not count.
fn symmetries(axes_m: &[[f64; 2]], moment: [f64; 3], [x, y, _]: [[f64; 2]; 3]) -> Vec<Turn> {
    const SAME: f64 = 1e-9;
    let half = [x, y].map(|[from, to]| 0.5 * (to - from));
    let centre = [x, y].map(|[from, to]| 0.5 * (from + to));
    let scale = axes_m
        .iter()
        .flatten()
        .chain(&half)
        .fold(0.0_f64, |most, v| most.max(v.abs()));
    let near = |a: [f64; 2], b: [f64; 2], size: f64| {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME * size)
    };
    let keeps = |turn: &Turn| {
        let square = !turn.swap || near([half[0]; 2], [half[1]; 2], scale);
        let tilt = [moment[0], moment[1]];
        let total = moment.iter().map(|m| m * m).sum::<f64>().sqrt();
        let upright = near(turn.of(tilt, |_, m| -m), tilt, total);
        let stand = axes_m.iter().all(|axis| {
            let about = [axis[0] - centre[0], axis[1] - centre[1]];
            let image = turn.of(about, |_, v| -v);
            let back = [image[0] + centre[0], image[1] + centre[1]];
            axes_m.iter().any(|other| near(back, *other, scale))
        });
        square && upright && stand
    };
    (0..8)
        .map(|bits| Turn {
            swap: bits & 4 != 0,
            mirror: [bits & 1 != 0, bits & 2 != 0],
        })
        .filter(keeps)
        .collect()
}

/// Chebyshev nodes of an axis.
#[derive(Debug, Clone, Copy)]
struct Nodes {
    middle: f64,
    half: f64,
    count: usize,
}

impl Nodes {
    fn new([from, to]: [f64; 2], count: usize) -> Self {
        let half = 0.5 * (to - from);
        Self {
            middle: 0.5 * (from + to),
            half,
            count: if half > 0.0 { count } else { 1 },
        }
    }

    fn angle(self, k: usize) -> f64 {
        PI * (k as f64 + 0.5) / self.count as f64
    }

    fn at(self, k: usize) -> f64 {
        // Mirrored nodes are mirrored to the last bit.
        let below = 2 * k >= self.count;
        let unit = match below {
            false => self.angle(k).cos(),
            true => -self.angle(self.count - 1 - k).cos(),
        };
        self.middle + self.half * if 2 * k + 1 == self.count { 0.0 } else { unit }
    }

    /// What every node's value counts at `position`: the barycentric formula.
    fn weights(self, position: f64) -> Vec<f64> {
        if self.count == 1 {
            return vec![1.0];
        }
        let mut weights: Vec<f64> = (0..self.count)
            .map(|k| {
                let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
                sign * self.angle(k).sin() / (position - self.at(k))
            })
            .collect();
        if let Some(hit) = weights.iter().position(|w| !w.is_finite()) {
            weights.fill(0.0);
            weights[hit] = 1.0;
            return weights;
        }
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        weights
    }
}

/// Nodes for a function on [-half, half] that is singular `away` beside it.
fn enough(aim: f64, away: f64, half: f64) -> usize {
    if half <= 0.0 {
        return 1;
    }
    let rate = (away / half).asinh();
    ((1.0 / aim).ln() / rate)
        .ceil()
        .clamp(4.0, MOST_NODES as f64) as usize
}

/// One height: the weighted pull [y, x].
#[derive(Debug, Clone)]
struct Level {
    x: Nodes,
    y: Nodes,
    values: Vec<f64>,
}

/// The pull times (z - top)^FALL.
#[derive(Debug, Clone)]
struct Table {
    top_m: f64,
    log_height: Nodes,
    levels: Vec<Level>,
    evaluations: usize,
}

impl Table {
    fn new(
        pull: &PassivePull,
        [x, y, z]: [[f64; 2]; 3],
        [top_m, axial_m]: [f64; 2],
        turns: &[Turn],
        aim: f64,
    ) -> Self {
        let logs = z.map(|z| (z - top_m).ln());
        // ln(z - top) is singular where z - top turns to i times a core's size.
        let log_height = Nodes::new(logs, enough(aim, 0.5 * PI, 0.5 * (logs[1] - logs[0])));
        let mut evaluations = 0;
        let levels = (0..log_height.count)
            .map(|k| {
                let above_m = log_height.at(k).exp();
                let away_m = above_m - axial_m.min(0.5 * above_m);
                let nodes = |range: [f64; 2]| {
                    let half = 0.5 * (range[1] - range[0]);
                    Nodes::new(range, enough(aim, away_m, half))
                };
                let (mut x, mut y) = (nodes(x), nodes(y));
                if turns.iter().any(|turn| turn.swap) {
                    let count = x.count.max(y.count);
                    (x.count, y.count) = (count, count);
                }
                let firsts = firsts([x.count, y.count], turns);
                let own: Vec<usize> = (0..firsts.len()).filter(|i| firsts[*i] == *i).collect();
                let places: Vec<[f64; 3]> = own
                    .iter()
                    .map(|i| [x.at(i % x.count), y.at(i / x.count), top_m + above_m])
                    .collect();
                evaluations += places.len();
                let weight = above_m.powi(FALL);
                let mut values = vec![0.0; firsts.len()];
                for (i, force) in own.iter().zip(pull.forces_z_n(&places)) {
                    values[*i] = weight * force;
                }
                for i in 0..values.len() {
                    values[i] = values[firsts[i]];
                }
                Level { x, y, values }
            })
            .collect();
        Self {
            top_m,
            log_height,
            levels,
            evaluations,
        }
    }

    /// The pull on a grid within the region, N, [z, y, x].
    fn on(&self, grid: &Grid) -> Vec<f64> {
        let plane = grid.x_m.len() * grid.y_m.len();
        let planes: Vec<Vec<f64>> = self.levels.iter().map(|level| level.on(grid)).collect();
        let mut out = Vec::with_capacity(plane * grid.z_m.len());
        for z in &grid.z_m {
            let above_m = z - self.top_m;
            let weights = self.log_height.weights(above_m.ln());
            let scale = above_m.powi(FALL).recip();
            out.extend((0..plane).map(|i| {
                let sum: f64 = weights.iter().zip(&planes).map(|(w, p)| w * p[i]).sum();
                scale * sum
            }));
        }
        out
    }
}

impl Level {
    /// [y, x] on the columns and rows of a grid.
    fn on(&self, grid: &Grid) -> Vec<f64> {
        let along_x: Vec<Vec<f64>> = grid.x_m.iter().map(|x| self.x.weights(*x)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // [own row, grid column]
        let rows: Vec<Vec<f64>> = self
            .values
            .chunks(self.x.count)
            .map(|row| along_x.iter().map(|w| dot(w, row)).collect())
            .collect();
        let mut out = Vec::with_capacity(grid.x_m.len() * grid.y_m.len());
        for y in &grid.y_m {
            let weights = self.y.weights(*y);
            let mut line = vec![0.0; grid.x_m.len()];
            for (weight, row) in weights.iter().zip(&rows) {
                for (value, part) in line.iter_mut().zip(row) {
                    *value += weight * part;
                }
            }
            out.extend(line);
        }
        out
    }
}

/// For every node (index = y * columns + x) the first of those that the symmetries map to it.
fn firsts([columns, rows]: [usize; 2], turns: &[Turn]) -> Vec<usize> {
    let counts = [columns, rows];
    (0..columns * rows)
        .map(|i| {
            let at = [i % columns, i / columns];
            turns
                .iter()
                .map(|turn| {
                    let [x, y] = turn.of(at, |axis, k| counts[axis] - 1 - k);
                    y * columns + x
                })
                .fold(i, usize::min)
        })
        .collect()
}

/// Largest difference of the table from the pull, relative to the largest at that height of the
/// grid: beside the first axes at the lowest height, and spread over the region, most of them low.
fn held_out_error(
    pull: &PassivePull,
    table: &Table,
    grid: &Grid,
    values: &[f64],
    radius_m: f64,
    scene: &Scene,
) -> f64 {
    let plane = grid.x_m.len() * grid.y_m.len();
    let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
    let (x, y) = (ends(&grid.x_m), ends(&grid.y_m));
    let axes = &scene.design.array.positions_m;
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
            let found = table.on(&Grid {
                x_m: vec![*x],
                y_m: vec![*y],
                z_m: vec![*z],
            })[0];
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
    let layers = |heights: Vec<f64>| -> Vec<f64> {
        let last = heights.len().saturating_sub(1);
        let decides = |(k, _): &(usize, f64)| *k < LOWEST || *k == last;
        heights
            .into_iter()
            .enumerate()
            .filter(decides)
            .map(|(_, z)| z)
            .collect()
    };
    let [x, y, z] = [&grid.x_m, &grid.y_m, &grid.z_m];
    let (mut worst, mut samples) = (0.0_f64, 0);
    for (x_m, y_m, z_m) in [
        (middles(x), middles(y), middles(z)),
        (middles(x), y.clone(), z.clone()),
        (x.clone(), middles(y), z.clone()),
        (x.clone(), y.clone(), middles(z)),
    ] {
        let places = Grid {
            x_m,
            y_m,
            z_m: layers(z_m),
        };
        let exact = table.on(&places);
        let plane = places.x_m.len() * places.y_m.len();
        for (z, exact) in places.z_m.iter().zip(exact.chunks(plane)) {
            let mut error = 0.0_f64;
            for (i, exact) in exact.iter().enumerate() {
                let at = [
                    places.x_m[i % places.x_m.len()],
                    places.y_m[i / places.x_m.len()],
                    *z,
                ];
                if let Some(cell) = lagrange::locate([x, y, &grid.z_m], at) {
                    error = error.max((cell.value(values) - exact).abs());
                }
            }
            samples += plane;
            let size = largest(exact);
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

    const SQUARE: [[f64; 2]; 3] = [[-0.05, 0.05], [-0.05, 0.05], [0.01, 0.08]];

    fn grid_of(pitch: [f64; 2]) -> Vec<[f64; 2]> {
        (0..9)
            .map(|i| {
                [
                    pitch[0] * f64::from(i % 3 - 1),
                    pitch[1] * f64::from(i / 3 - 1),
                ]
            })
            .collect()
    }

    #[test]
    fn only_what_keeps_array_magnet_and_region_is_a_symmetry() {
        let upright = [0.0, 0.0, -0.9];
        let count = |axes: &[[f64; 2]], moment, region| symmetries(axes, moment, region).len();
        assert_eq!(count(&grid_of([0.05, 0.05]), upright, SQUARE), 8);
        assert_eq!(count(&grid_of([0.05, 0.04]), upright, SQUARE), 4);
        let lower = [[-0.05, 0.05], [-0.05, 0.03], [0.01, 0.08]];
        assert_eq!(count(&grid_of([0.05, 0.05]), upright, lower), 2);
        assert_eq!(count(&grid_of([0.05, 0.05]), [0.13, 0.0, -0.9], SQUARE), 2);
        assert_eq!(count(&grid_of([0.05, 0.05]), [0.07, 0.07, 0.9], SQUARE), 2);
        assert_eq!(count(&grid_of([0.05, 0.05]), [0.07, 0.05, 0.9], SQUARE), 1);
        assert_eq!(count(&[[0.013, 0.007]], upright, SQUARE), 1);
    }

    #[test]
    fn every_node_has_its_first_in_its_orbit() {
        let turns = symmetries(&grid_of([0.05, 0.05]), [0.0, 0.0, 1.3], SQUARE);
        let firsts = firsts([7, 7], &turns);
        assert!(firsts.iter().all(|first| firsts[*first] == *first));
        let own = (0..49).filter(|i| firsts[*i] == *i).count();
        assert_eq!(own, 10); // 4 * 5 / 2
    }

    #[test]
    fn polynomials_come_back_and_more_nodes_are_better() {
        let of = |nodes: Nodes, f: &dyn Fn(f64) -> f64, at: f64| {
            let weights = nodes.weights(at);
            weights
                .iter()
                .enumerate()
                .map(|(k, w)| w * f(nodes.at(k)))
                .sum::<f64>()
        };
        let cubic = |x: f64| 0.7 - 1.3 * x + 2.1 * x * x - 0.9 * x * x * x;
        let nodes = Nodes::new([-0.3, 1.7], 4);
        for at in [-0.3, 0.11, nodes.at(2), 1.7] {
            assert!((of(nodes, &cubic, at) - cubic(at)).abs() < 1e-14);
        }
        assert_eq!(nodes.at(0) - 0.7, 0.7 - nodes.at(3));
        // Singular `away` beside the axis: the rule's count gives the error aimed at.
        let (away, aim) = (0.013, 1e-5);
        let peak = |x: f64| away * away / (x * x + away * away);
        let count = enough(aim, away, 0.05);
        let nodes = Nodes::new([-0.05, 0.05], count);
        let worst = (0..500)
            .map(|i| -0.05 + 0.1 * f64::from(i) / 499.0)
            .map(|x| (of(nodes, &peak, x) - peak(x)).abs())
            .fold(0.0, f64::max);
        assert!(worst < 5.0 * aim, "{count}: {worst:e}");
        assert!(enough(1e-3, away, 0.05) < count);
    }
}
