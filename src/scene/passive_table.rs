//! A table of the unpowered steel's vertical pull over a box.
//!
//! One value costs half a millisecond. So the pull is evaluated at few heights, Chebyshev nodes of
//! ln(z - top), and there on Chebyshev nodes of x and y, as many as the height above the steel asks
//! for; of places that a symmetry of array, magnet and region maps to each other, one. What lies
//! between is interpolated; whoever uses it compares it with the pull at places off the nodes.

use std::cmp::Ordering;
use std::f64::consts::PI;

use rayon::prelude::*;

use super::Scene;
use crate::design::MagnetModel;
use crate::map::tabulate::Grid;

/// Places at which a table for scattered places is compared with the pull itself.
const COMPARED: usize = 24;
/// Share of the tolerance at which the nodes aim: the pull is a square of fields, with strong
/// singularities.
const NODES_AIM: f64 = 0.1;
/// A table that is to be right to an aim may miss it by this factor where nothing else hangs on it.
const MISSES: f64 = 3.0;
/// Most nodes along one axis.
const MOST_NODES: usize = 160;
/// Part of the tolerance that a table may add.
pub(super) const TABLE_SHARE: f64 = 0.3;
/// The most that a table aims at first, and that does, however far off the pull itself is said to be: such estimates, as
/// of cores on a plate, are far above the error.
const MOST_ADDED: [f64; 2] = [0.015, 0.05];
/// Attempts at a table, each with ten times less error aimed at.
pub(super) const ATTEMPTS: usize = 3;
/// The pull falls about as this power of the height; taken out, so that its size does not decide.
const FALL: i32 = 4;

/// The error that a table of a pull that is itself off by `own` aims at first, and the one that does: a finer table only
/// costs time.
pub(super) fn tabulated(tolerance: f64, own: f64) -> [f64; 2] {
    MOST_ADDED.map(|most| (TABLE_SHARE * own).min(most).max(TABLE_SHARE * tolerance))
}

/// A map of the region to itself: x and y exchanged or not, then each mirrored or not.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    pub swap: bool,
    mirror: [bool; 2],
}

impl Turn {
    pub fn of<T: Copy>(self, [x, y]: [T; 2], mirrored: impl Fn(usize, T) -> T) -> [T; 2] {
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
pub(super) fn symmetries(
    axes_m: &[[f64; 2]],
    moment: [f64; 3],
    [x, y, _]: [[f64; 2]; 3],
) -> Vec<Turn> {
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

/// [`symmetries`] of a scene's steel.
pub(super) fn symmetries_of(scene: &Scene, region_m: [[f64; 2]; 3]) -> Vec<Turn> {
    let axes_m = &scene.design.array.positions_m;
    let mut turns = symmetries(axes_m, scene.moment_a_m2, region_m);
    if let Some(iron) = &scene.iron {
        turns.retain(|turn| iron.is_kept_by(*turn));
    }
    turns
}

/// Chebyshev nodes of an axis.
#[derive(Debug, Clone)]
struct Nodes {
    at: Vec<f64>,
    /// Barycentric weights.
    shares: Vec<f64>,
}

impl Nodes {
    fn new([from, to]: [f64; 2], count: usize) -> Self {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let count = if half > 0.0 { count } else { 1 };
        let angle = |k: usize| PI * (k as f64 + 0.5) / count as f64;
        // Mirrored nodes are mirrored to the last bit.
        let unit = |k: usize| match (2 * k + 1).cmp(&count) {
            Ordering::Less => angle(k).cos(),
            Ordering::Equal => 0.0,
            Ordering::Greater => -angle(count - 1 - k).cos(),
        };
        let share = |k: usize| if k.is_multiple_of(2) { 1.0 } else { -1.0 } * angle(k).sin();
        Self {
            at: (0..count).map(|k| middle + half * unit(k)).collect(),
            shares: (0..count).map(share).collect(),
        }
    }

    fn count(&self) -> usize {
        self.at.len()
    }

    /// Weight of every node's value at `position`: the barycentric formula.
    fn weights(&self, position: f64) -> Vec<f64> {
        if let [_] = self.at[..] {
            return vec![1.0];
        }
        let nodes = self.at.iter().zip(&self.shares);
        let mut weights: Vec<f64> = nodes.map(|(at, share)| share / (position - at)).collect();
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

/// One height of a table, and which of its nodes are evaluated.
#[derive(Debug, Clone)]
struct LevelLayout {
    x: Nodes,
    y: Nodes,
    above_m: f64,
    /// Of every node the first that a symmetry maps to it.
    firsts: Vec<usize>,
    /// Those that are their own first.
    own: Vec<usize>,
}

/// The pull times (z - top)^FALL.
#[derive(Debug, Clone)]
pub(super) struct Table {
    top_m: f64,
    log_height: Nodes,
    levels: Vec<Level>,
}

/// A table's nodes, before the pull is evaluated on them.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    top_m: f64,
    log_height: Nodes,
    levels: Vec<LevelLayout>,
}

impl Layout {
    /// For the region `x`, `y`, `z` above steel that ends at `top_m`, a magnet that reaches down by
    /// `axial_m`, and an error of `aim` relative to the largest pull at a height.
    pub fn new(
        [x, y, z]: [[f64; 2]; 3],
        [top_m, axial_m]: [f64; 2],
        turns: &[Turn],
        aim: f64,
    ) -> Self {
        let logs = z.map(|z| (z - top_m).ln());
        // ln(z - top) is singular where z - top turns to i times a core's size.
        let log_height = Nodes::new(logs, enough(aim, 0.5 * PI, 0.5 * (logs[1] - logs[0])));
        let swaps = turns.iter().any(|turn| turn.swap);
        let levels = (log_height.at.iter())
            .map(|log_height| {
                let above_m = log_height.exp();
                let away_m = above_m - axial_m.min(0.5 * above_m);
                let counts = [x, y].map(|[from, to]| enough(aim, away_m, 0.5 * (to - from)));
                let both = counts[0].max(counts[1]);
                let [across, along] = if swaps { [both; 2] } else { counts };
                let (x, y) = (Nodes::new(x, across), Nodes::new(y, along));
                let firsts = firsts([x.count(), y.count()], turns);
                let own = (0..firsts.len()).filter(|i| firsts[*i] == *i).collect();
                LevelLayout {
                    x,
                    y,
                    above_m,
                    firsts,
                    own,
                }
            })
            .collect();
        Self {
            top_m,
            log_height,
            levels,
        }
    }

    /// How often the pull must be evaluated.
    pub fn evaluations(&self) -> usize {
        self.levels.iter().map(|level| level.own.len()).sum()
    }

    /// `pull`: the vertical pull at places, N.
    pub fn filled(&self, pull: impl Fn(&[[f64; 3]]) -> Vec<f64>) -> Table {
        let levels = self.levels.iter().map(|level| {
            let LevelLayout {
                x,
                y,
                above_m,
                firsts,
                own,
            } = level;
            let places: Vec<[f64; 3]> = own
                .iter()
                .map(|i| {
                    let (column, row) = (i % x.count(), i / x.count());
                    [x.at[column], y.at[row], self.top_m + above_m]
                })
                .collect();
            let weight = above_m.powi(FALL);
            let mut values = vec![0.0; firsts.len()];
            for (i, force) in own.iter().zip(pull(&places)) {
                values[*i] = weight * force;
            }
            for i in 0..values.len() {
                values[i] = values[firsts[i]];
            }
            Level {
                x: x.clone(),
                y: y.clone(),
                values,
            }
        });
        Table {
            top_m: self.top_m,
            log_height: self.log_height.clone(),
            levels: levels.collect(),
        }
    }
}

impl Table {
    /// The pull at one place of the region, N.
    pub fn at(&self, [x, y, z]: [f64; 3]) -> f64 {
        let above_m = z - self.top_m;
        let weights = self.log_height.weights(above_m.ln());
        let levels = weights.iter().zip(&self.levels);
        let sum: f64 = levels.map(|(w, level)| w * level.at([x, y])).sum();
        sum * above_m.powi(FALL).recip()
    }

    /// The pull on a grid within the region, N, [z, y, x].
    pub fn on(&self, grid: &Grid) -> Vec<f64> {
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
    fn at(&self, [x, y]: [f64; 2]) -> f64 {
        let (along_x, along_y) = (self.x.weights(x), self.y.weights(y));
        let rows = self.values.chunks(self.x.count()).zip(&along_y);
        let of_row = |row: &[f64]| -> f64 { row.iter().zip(&along_x).map(|(v, w)| v * w).sum() };
        rows.map(|(row, weight)| weight * of_row(row)).sum()
    }

    /// [y, x] on the columns and rows of a grid.
    fn on(&self, grid: &Grid) -> Vec<f64> {
        let along_x: Vec<Vec<f64>> = grid.x_m.iter().map(|x| self.x.weights(*x)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // [own row, grid column]
        let rows: Vec<Vec<f64>> = self
            .values
            .chunks(self.x.count())
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

/// The vertical pull at `places_m`, N, to about `aim` of the largest at each height, from a table
/// where that takes fewer evaluations; those that it is compared with decide whether it holds.
pub(super) fn scattered_z_n(
    scene: &Scene,
    pull: impl Fn(&[[f64; 3]]) -> Vec<f64>,
    places_m: &[[f64; 3]],
    aim: f64,
) -> Vec<f64> {
    tabulated_z_n(scene, &pull, places_m, aim).unwrap_or_else(|| pull(places_m))
}

fn tabulated_z_n(
    scene: &Scene,
    pull: impl Fn(&[[f64; 3]]) -> Vec<f64>,
    places_m: &[[f64; 3]],
    aim: f64,
) -> Option<Vec<f64>> {
    let ranges = region(places_m);
    let below_m = [scene.steel_extent_m()?.0, axial_m(scene)];
    let turns = symmetries_of(scene, ranges);
    let layout = Layout::new(ranges, below_m, &turns, NODES_AIM * aim);
    if layout.evaluations() + 3 * COMPARED > places_m.len() / 2 {
        return None;
    }
    let table = layout.filled(&pull);
    let mut forces_n: Vec<f64> = places_m.par_iter().map(|at| table.at(*at)).collect();
    let compared = (0..COMPARED).map(|k| (2 * k + 1) * places_m.len() / (2 * COMPARED));
    let (reported, places): (Vec<f64>, Vec<_>) =
        compared.map(|i| (forces_n[i], places_m[i])).unzip();
    // Forces fall with the height: beside each the largest of those that are no higher counts.
    let sure = pull(&places);
    let holds = (0..COMPARED).all(|k| {
        let at_height = (0..COMPARED).filter(|other| places[*other][2] >= places[k][2]);
        let size = at_height.fold(0.0_f64, |most, other| most.max(sure[other].abs()));
        (reported[k] - sure[k]).abs() <= MISSES * aim * size
    });
    if !holds {
        return None;
    }
    // The report is of the pull itself: the largest, and the largest beside the height, which is
    // what a force constant multiplies.
    let of_height = |i: usize| forces_n[i].abs() / places_m[i][2];
    let mut decide = strongest(places_m.len(), |i| forces_n[i].abs());
    decide.extend(strongest(places_m.len(), of_height));
    let places: Vec<[f64; 3]> = decide.iter().map(|i| places_m[*i]).collect();
    for (i, sure) in decide.iter().zip(pull(&places)) {
        forces_n[*i] = sure;
    }
    Some(forces_n)
}

/// Indices of the [`COMPARED`] places of the largest `size`.
fn strongest(count: usize, size: impl Fn(usize) -> f64) -> Vec<usize> {
    let mut indices: Vec<usize> = (0..count).collect();
    indices.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    indices.truncate(COMPARED);
    indices
}

/// The box of `places_m`, from and to along every axis.
pub(super) fn region(places_m: &[[f64; 3]]) -> [[f64; 2]; 3] {
    std::array::from_fn(|axis| {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        places_m.iter().fold(none, |[lo, hi], place| {
            [lo.min(place[axis]), hi.max(place[axis])]
        })
    })
}

/// How far the magnet reaches below its centre where it is upright, m.
pub(super) fn axial_m(scene: &Scene) -> f64 {
    match scene.design.magnet.model {
        MagnetModel::Dipole => 0.0,
        MagnetModel::Cylinder => 0.5 * scene.design.magnet.length_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, Need};
    use crate::scene::passive::pull_to;

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

    /// Of nine cores on a plate the estimate is 0.4 where the pull is right to a hundredth: a table was as coarse as that.
    #[test]
    fn regression_a_table_was_as_coarse_as_an_estimate_far_above_the_error() {
        assert_eq!(tabulated(1e-3, 0.43), [0.015, 0.05]);
        assert_eq!(tabulated(1e-3, 0.01), [0.3 * 0.01; 2]);
        assert_eq!(tabulated(0.5, 0.43), [0.3 * 0.5; 2]);
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
        let of = |nodes: &Nodes, f: &dyn Fn(f64) -> f64, at: f64| {
            let weights = nodes.weights(at);
            weights
                .iter()
                .enumerate()
                .map(|(k, w)| w * f(nodes.at[k]))
                .sum::<f64>()
        };
        let cubic = |x: f64| 0.7 - 1.3 * x + 2.1 * x * x - 0.9 * x * x * x;
        let nodes = Nodes::new([-0.3, 1.7], 4);
        for at in [-0.3, 0.11, nodes.at[2], 1.7] {
            assert!((of(&nodes, &cubic, at) - cubic(at)).abs() < 1e-14);
        }
        assert_eq!(nodes.at[0] - 0.7, 0.7 - nodes.at[3]);
        // Singular `away` beside the axis: the rule's count gives the error aimed at.
        let (away, aim) = (0.013, 1e-5);
        let peak = |x: f64| away * away / (x * x + away * away);
        let count = enough(aim, away, 0.05);
        let nodes = Nodes::new([-0.05, 0.05], count);
        let worst = (0..500)
            .map(|i| -0.05 + 0.1 * f64::from(i) / 499.0)
            .map(|x| (of(&nodes, &peak, x) - peak(x)).abs())
            .fold(0.0, f64::max);
        assert!(worst < 5.0 * aim, "{count}: {worst:e}");
        assert!(enough(1e-3, away, 0.05) < count);
    }
    /// Each of thousands of points once cost a whole sum over the cores' coupling.
    #[test]
    fn the_pull_at_an_objects_points_takes_few_evaluations() {
        let text = std::fs::read_to_string("designs/seed.toml").unwrap();
        let path = std::path::Path::new("seed.toml");
        let (design, _) = Design::from_toml(&text, path, Need::CALIBRATE).unwrap();
        let scene = Scene::new(&design).unwrap();
        let places: Vec<[f64; 3]> = (0..4000)
            .map(|k| {
                let part = |step: f64| (0.5 + step * f64::from(k)).fract();
                let (u, v) = (part(0.754_877_666), part(0.569_840_291));
                let (x, y) = (0.1 * u - 0.053, 0.1 * v - 0.049);
                [x, y, 0.031 + 0.02 * u * v]
            })
            .collect();
        let solved = pull_to(&scene, &places, false, 1e-2).unwrap().unwrap();
        let pull = |at_m: &[[f64; 3]]| solved.forces_z_n(at_m);
        let aim = 1e-3;
        let reported = tabulated_z_n(&scene, pull, &places, aim).expect("a table that holds");
        let some: Vec<usize> = (0..places.len()).step_by(97).collect();
        let sure = pull(&some.iter().map(|i| places[*i]).collect::<Vec<_>>());
        for (i, sure) in some.iter().zip(sure) {
            assert!(
                (reported[*i] / sure - 1.0).abs() < 5e-3,
                "{i}: {} {sure}",
                reported[*i]
            );
        }
        // Close to the steel it varies too fast for a table to pay.
        let low: Vec<[f64; 3]> = places.iter().map(|[x, y, _]| [*x, *y, 0.0021]).collect();
        assert!(tabulated_z_n(&scene, pull, &low, aim).is_none());
    }
}
