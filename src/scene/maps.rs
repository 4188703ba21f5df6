//! Maps of a scene over a grid, whatever its sources, and their interpolation's error.

use serde::{Deserialize, Serialize};

use super::evaluation_sample::{Evaluation, Sample, compared, sharper};
use super::steel::{EVALUATION_SHARE, Solved, clearance};
use super::{AIR_SHARE, Scene, coupled};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::field::magnet::MagnetRule;
use crate::field::source::AxialSource;
use crate::field::steel::array_steel::SteelField;
use crate::field::winding::KERNEL_ERROR;
use crate::map::coupled_map::{SampledField, TableReport};
use crate::map::mean::MeanField;

use crate::map::tabulate::{Grid, MapError, PlacedCoil};
use crate::map::{
    Components, FieldMap, InterpolationError, interpolation_error, interpolation_errors_by,
    tabulate,
};
use crate::numerics::lagrange::locate;
use crate::progress::{Progress, Silent};

/// A map and what is known of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SceneMap {
    /// The map.
    pub map: FieldMap,
    /// dB_x/dz and dB_y/dz, `[coil, z, y, x]`, T/m/A: of [`Components::Force`] alone.
    pub sides: Option<[Vec<f64>; 2]>,
    /// Error of interpolating it between its nodes.
    pub between: InterpolationError,
    /// The same of `sides`.
    pub sides_between: Option<[InterpolationError; 2]>,
    /// The steel's compact form, where there was one.
    pub table: Option<TableReport>,
    /// Estimated error of its nodes.
    pub accuracy: StageAccuracy,
}

/// Share of the tolerance given to the maps' own rules beside the steel's solution.
const MAP_SHARE: f64 = 0.08;

impl SceneMap {
    /// The force of `currents_a`, one per coil of the array, on a magnet of this moment at `place_m`, N, along x, y
    /// and z, as a runtime interpolates it; none sideways where the map holds the upward component alone, and `None`
    /// outside the map.
    #[must_use]
    pub fn force_n(
        &self,
        moment_a_m2: [f64; 3],
        currents_a: &[f64],
        place_m: [f64; 3],
    ) -> Option<[f64; 3]> {
        let map = &self.map;
        let nodes = map.x_m.len() * map.y_m.len() * map.z_m.len();
        let cell = locate([&map.x_m, &map.y_m, &map.z_m], place_m)?;
        let [m_x, m_y, m_z] = moment_a_m2;
        let tensors = map.gradient_t_per_m_per_a.as_deref();
        let mut force_n = [0.0; 3];
        for (at, coil) in map.coils.iter().enumerate() {
            let own = at * nodes..(at + 1) * nodes;
            let tensor = tensors.map(|all| &all[9 * own.start..9 * own.end]);
            for (axis, total) in force_n.iter_mut().enumerate() {
                let along_z = match (axis, &self.sides) {
                    (2, _) => cell.value(&map.gz_t_per_m_per_a[own.clone()]),
                    (_, Some(sides)) => cell.value(&sides[axis][own.clone()]),
                    (_, None) => continue,
                };
                let mut force = m_z * along_z;
                if let Some(tensor) = tensor {
                    force += m_x * cell.component(tensor, 9, axis);
                    force += m_y * cell.component(tensor, 9, 3 + axis);
                }
                *total += currents_a[*coil] * force;
            }
        }
        Some(force_n)
    }

    /// Maps of `coils` of `scene` over `grid`: of the field itself, or of the mean that a magnet
    /// feels, F_z / m_z being what the map gives.
    ///
    /// # Errors
    /// A node on a winding's edge or on the steel; interruption.
    pub fn new(
        scene: &Scene,
        solved: &Solved,
        coils: &[PlacedCoil],
        grid: &Grid,
        components: Components,
        magnet: &MagnetMean,
        progress: &dyn Progress,
    ) -> Result<Self, RunError> {
        let task = MapTask {
            scene,
            solved,
            coils,
            grid,
            magnet,
        };
        let share = if !solved.has_steel() && magnet.is_field() {
            1.0
        } else if solved.has_steel() {
            MAP_SHARE
        } else {
            AIR_SHARE
        };
        let tolerance = share * solved.tolerance / magnet.amplification;
        let own = EVALUATION_SHARE * tolerance;
        let (table, mut map, errors) = match solved.steel().axial_source(scene.winding, own) {
            Some(source) => task.axial(&*source, share, tolerance, components, progress)?,
            None => task.coupled(tolerance, components, progress)?,
        };
        progress.end();
        let sides = transverse(&map, components);
        if sides.is_some() && !scene.tilted() {
            map.gradient_t_per_m_per_a = None;
        }
        let sides_between = match errors[1..] {
            [x, y] => Some([x, y]),
            _ => None,
        };
        let mut evaluation = evaluation(&map, solved);
        if magnet.is_field() {
            evaluation = sharper(
                scene,
                solved,
                samples(scene, solved, &map, coils),
                evaluation,
            );
        }
        let accuracy = accuracy(evaluation, solved, magnet.bound);
        Ok(Self {
            map,
            sides,
            between: errors[0],
            sides_between,
            table,
            accuracy,
        })
    }
}

/// A map to be made: source, coils, grid and magnet.
struct MapTask<'a> {
    scene: &'a Scene<'a>,
    solved: &'a Solved,
    coils: &'a [PlacedCoil],
    grid: &'a Grid,
    magnet: &'a MagnetMean,
}

/// A map with what is known of it before its accuracy.
type Mapped = (Option<TableReport>, FieldMap, Vec<InterpolationError>);

impl MapTask<'_> {
    /// Coils each of which is a `source` about its own axis: a map over the distance from it.
    fn axial(
        &self,
        source: &dyn AxialSource,
        share: f64,
        tolerance: f64,
        components: Components,
        progress: &dyn Progress,
    ) -> Result<Mapped, RunError> {
        let Self {
            scene,
            solved,
            coils,
            grid,
            magnet,
        } = *self;
        check_nodes(scene, grid, magnet)?;
        let one = |coils: &[PlacedCoil], grid: &Grid, components, p: &dyn Progress| {
            tabulate(source, coils, grid, components, tolerance, p)
        };
        let means = MeanField::new(
            source,
            coils,
            grid,
            components,
            MEAN_SHARE * share * solved.tolerance,
            SOURCE_SHARE * tolerance,
        );
        let one = Maker {
            one: &one,
            means: means.as_ref(),
        };
        let kernels = of_kernels(scene, components);
        let map = mean(&one, magnet, coils, grid, kernels, progress)?;
        progress.begin("interpolation error", 1);
        // In air the field between the nodes is had as finely as the map itself, at once.
        let of_air = magnet.is_field() && !solved.has_steel();
        let between = if of_air && components != Components::Force {
            let gz = &map.gz_t_per_m_per_a;
            vec![interpolation_error(source, coils, grid, gz, tolerance)?]
        } else {
            between(&one, magnet, coils, (grid, &map), components)?
        };
        Ok((None, map, between))
    }

    /// Coils whose cores all answer to every winding: the windings by distance, the steel from a
    /// table of its harmonic field.
    fn coupled(
        &self,
        tolerance: f64,
        components: Components,
        progress: &dyn Progress,
    ) -> Result<Mapped, RunError> {
        let Self {
            scene,
            solved,
            coils,
            grid,
            magnet,
        } = *self;
        let nearest = nearest_to_steel(scene, grid);
        let steel = solved.sources(scene, &nearest, magnet.reach_m, magnet.amplification)?;
        let steel = steel.as_deref().and_then(SteelField::coupled);
        let steel = steel.ok_or_else(no_steel)?;
        // A grid through every place that a node of the magnet can take.
        let widest = widest(grid, magnet);
        let visits = magnet.visits();
        let kernels = of_kernels(scene, components);
        let sampled = SampledField::new(steel, &widest, kernels, tolerance, visits, progress)?;
        let one = |coils: &[PlacedCoil], grid: &Grid, components, p: &dyn Progress| {
            let mut map = tabulate(&scene.winding, coils, grid, components, tolerance, &Silent)?;
            add(&mut map, &sampled.map(coils, grid, p)?, 1.0);
            Ok(map)
        };
        let one = Maker {
            one: &one,
            means: None,
        };
        let map = mean(&one, magnet, coils, grid, kernels, progress)?;
        progress.begin("interpolation error", 1);
        let between = between(&one, magnet, coils, (grid, &map), components)?;
        Ok((Some(sampled.report), map, between))
    }
}

/// Components that kernels compute for a map: the force on a tilted magnet needs the whole gradient.
fn of_kernels(scene: &Scene, components: Components) -> Components {
    match components {
        Components::Force if scene.tilted() => Components::Gradient,
        Components::Force | Components::Gz | Components::Gradient | Components::All => components,
    }
}

fn no_steel() -> RunError {
    RunError::Input("the design has steel, but its solution holds none".to_owned())
}

/// Shares of a map's tolerance given to the series of means and to the field that they are of.
const MEAN_SHARE: f64 = 0.5;
const SOURCE_SHARE: f64 = 0.4;

/// Maps the field of one source.
type MapOne<'a> =
    &'a dyn Fn(&[PlacedCoil], &Grid, Components, &dyn Progress) -> Result<FieldMap, MapError>;

/// Makes maps of the field of one source.
struct Maker<'a> {
    one: MapOne<'a>,
    /// Means of it, where coils are alike.
    means: Option<&'a MeanField<'a>>,
}

/// Offsets of a magnet's dipoles from its centre, m, and their parts of its moment.
type Shares = Vec<([f64; 3], f64)>;

/// The mean that a map's values are: offsets of the magnet's dipoles and their parts of its
/// moment, fewer from greater heights up.
#[derive(Debug, Clone)]
pub struct MagnetMean {
    /// Height from which the offsets (m) and parts hold, ascending.
    layers: Vec<(f64, Shares)>,
    /// Largest sum of the parts' magnitudes.
    amplification: f64,
    /// A-priori error of the means, relative to the gradient at the place.
    bound: f64,
    reach_m: f64,
}

/// A rule whose parts cancel more than this is not worth its few dipoles.
const MOST_AMPLIFICATION: f64 = 3.0;
/// The same where a table gives the field, whose cost hardly grows with its digits.
const MOST_AMPLIFICATION_OF_TABLES: f64 = 100.0;
/// Growth of the distance from the sources at which a rule of fewer dipoles is sought.
const FARTHER: f64 = 1.25;

impl MagnetMean {
    /// The field itself.
    #[must_use]
    pub fn field() -> Self {
        Self {
            layers: vec![(f64::NEG_INFINITY, vec![([0.0; 3], 1.0)])],
            amplification: 1.0,
            bound: 0.0,
            reach_m: 0.0,
        }
    }

    /// The mean over the magnet of `scene` at the heights `z_m`, ascending, to `tolerance`.
    ///
    /// # Errors
    /// A magnet that touches what it is attracted by.
    pub fn by_magnet(scene: &Scene, z_m: &[f64], tolerance: f64) -> Result<Self, RunError> {
        let top_m = scene.sources_top_m();
        let mut magnet = Self {
            layers: Vec::new(),
            ..Self::field()
        };
        let alone = scene.iron.is_none() && !coupled(scene.design);
        let most = if scene.core.is_some() && alone {
            MOST_AMPLIFICATION_OF_TABLES
        } else {
            MOST_AMPLIFICATION
        };
        let mut sought_m = f64::NEG_INFINITY;
        for z in z_m {
            if z - top_m < FARTHER * (sought_m - top_m) {
                continue;
            }
            sought_m = *z;
            let rule = scene.magnet_rule(*z, tolerance)?;
            let fewer = magnet
                .layers
                .last()
                .is_none_or(|(_, shares)| rule.nodes().len() < shares.len());
            if fewer && (magnet.layers.is_empty() || rule.amplification() <= most) {
                magnet.amplification = magnet.amplification.max(rule.amplification());
                magnet.bound = magnet.bound.max(rule.bound());
                magnet.reach_m = magnet.reach_m.max(rule.reach_m());
                magnet.layers.push((*z, shares(&rule)));
            }
        }
        Ok(magnet)
    }

    /// Whether it is the field itself.
    fn is_field(&self) -> bool {
        self.layers.iter().all(|(_, shares)| shares.len() == 1)
    }

    /// Most places that a value is the mean of.
    fn visits(&self) -> usize {
        let counts = self.layers.iter().map(|(_, shares)| shares.len());
        counts.max().unwrap_or(1)
    }

    /// The offsets and parts at height `z_m`.
    fn at(&self, z_m: f64) -> &[([f64; 3], f64)] {
        let above = self.layers.partition_point(|(from, _)| *from <= z_m);
        &self.layers[above.saturating_sub(1)].1
    }

    /// Pieces of `z_m` with the same offsets.
    fn pieces<'a>(&self, z_m: &'a [f64]) -> Vec<&'a [f64]> {
        z_m.chunk_by(|a, b| std::ptr::eq(self.at(*a), self.at(*b)))
            .collect()
    }
}

/// Offsets of the magnet's dipoles and their parts of its moment.
fn shares(rule: &MagnetRule) -> Shares {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let moment = rule.nodes().iter().fold([0.0; 3], |sum, node| {
        std::array::from_fn(|i| sum[i] + node.moment_a_m2[i])
    });
    let square = dot(moment, moment);
    rule.nodes()
        .iter()
        .map(|node| (node.offset_m, dot(node.moment_a_m2, moment) / square))
        .collect()
}

fn shifted(grid: &Grid, offset_m: [f64; 3]) -> Grid {
    let move_by = |nodes: &[f64], by: f64| nodes.iter().map(|x| x + by).collect();
    Grid {
        x_m: move_by(&grid.x_m, offset_m[0]),
        y_m: move_by(&grid.y_m, offset_m[1]),
        z_m: move_by(&grid.z_m, offset_m[2]),
    }
}

fn mean(
    one: &Maker,
    magnet: &MagnetMean,
    coils: &[PlacedCoil],
    grid: &Grid,
    components: Components,
    progress: &dyn Progress,
) -> Result<FieldMap, MapError> {
    let mut pieces = Vec::new();
    for z_m in magnet.pieces(&grid.z_m) {
        let grid = Grid {
            z_m: z_m.to_vec(),
            ..grid.clone()
        };
        let shares = magnet.at(z_m[0]);
        pieces.push(mean_of(one, shares, coils, &grid, components, progress)?);
    }
    if pieces.is_empty() {
        return (one.one)(coils, grid, components, progress);
    }
    Ok(stacked(pieces, coils.len()))
}

/// Maps over pieces of the z axis as one.
fn stacked(mut pieces: Vec<FieldMap>, coils: usize) -> FieldMap {
    if pieces.len() == 1 {
        return pieces.swap_remove(0);
    }
    let stack = |pick: &dyn Fn(&FieldMap) -> Option<&Vec<f64>>| -> Option<Vec<f64>> {
        let parts: Vec<&Vec<f64>> = pieces.iter().filter_map(pick).collect();
        let mut out = Vec::with_capacity(parts.iter().map(|p| p.len()).sum());
        for coil in 0..coils {
            for part in &parts {
                let size = part.len() / coils;
                out.extend_from_slice(&part[coil * size..(coil + 1) * size]);
            }
        }
        (!parts.is_empty()).then_some(out)
    };
    let gz = stack(&|m| Some(&m.gz_t_per_m_per_a)).unwrap_or_default();
    let gradient = stack(&|m| m.gradient_t_per_m_per_a.as_ref());
    let field = stack(&|m| m.field_t_per_a.as_ref());
    let z_m = pieces.iter().flat_map(|m| m.z_m.iter().copied()).collect();
    let tabulated = pieces.iter().any(|m| m.tabulated);
    let distinct_radii = pieces.iter().map(|m| m.distinct_radii).max().unwrap_or(0);
    let relative_error = pieces.iter().fold(0.0_f64, |e, m| e.max(m.relative_error));
    FieldMap {
        z_m,
        gz_t_per_m_per_a: gz,
        gradient_t_per_m_per_a: gradient,
        field_t_per_a: field,
        tabulated,
        distinct_radii,
        relative_error,
        ..pieces.swap_remove(0)
    }
}

fn mean_of(
    one: &Maker,
    shares: &[([f64; 3], f64)],
    coils: &[PlacedCoil],
    grid: &Grid,
    components: Components,
    progress: &dyn Progress,
) -> Result<FieldMap, MapError> {
    if let (Some(means), [_, _, ..]) = (one.means, shares)
        && let Some(map) = means.map(shares, coils, grid, components, progress)?
    {
        return Ok(map);
    }
    let mut whole: Option<FieldMap> = None;
    for (offset_m, share) in shares {
        let mut part = (one.one)(coils, &shifted(grid, *offset_m), components, progress)?;
        match &mut whole {
            None => {
                if *share != 1.0 {
                    scale(&mut part, *share);
                }
                whole = Some(part);
            }
            Some(whole) => add(whole, &part, *share),
        }
    }
    let mut map = match whole {
        Some(map) => map,
        None => (one.one)(coils, grid, components, progress)?,
    };
    (map.x_m, map.y_m, map.z_m) = (grid.x_m.clone(), grid.y_m.clone(), grid.z_m.clone());
    Ok(map)
}

fn between(
    one: &Maker,
    magnet: &MagnetMean,
    coils: &[PlacedCoil],
    (grid, map): (&Grid, &FieldMap),
    components: Components,
) -> Result<Vec<InterpolationError>, MapError> {
    let sides = transverse(map, components);
    let parts = if sides.is_some() {
        Components::Force
    } else {
        Components::Gz
    };
    let direct = |coils: &[PlacedCoil], places: &Grid| {
        let map = mean(one, magnet, coils, places, parts, &Silent)?;
        let sides = transverse(&map, parts);
        let gz = map.gz_t_per_m_per_a;
        Ok(std::iter::once(gz)
            .chain(sides.into_iter().flatten())
            .collect())
    };
    let mut maps = vec![&*map.gz_t_per_m_per_a];
    maps.extend(sides.iter().flatten().map(|side| &**side));
    interpolation_errors_by(&direct, coils, grid, &maps)
}

/// dB_x/dz and dB_y/dz of a map with the gradient's tensor, for [`Components::Force`].
fn transverse(map: &FieldMap, components: Components) -> Option<[Vec<f64>; 2]> {
    let tensors = map.gradient_t_per_m_per_a.as_ref()?;
    let along_z = |row: usize| -> Vec<f64> {
        let of_row = tensors.chunks_exact(9).map(|tensor| tensor[3 * row + 2]);
        of_row.collect()
    };
    (components == Components::Force).then(|| [along_z(0), along_z(1)])
}

fn each(map: &mut FieldMap) -> impl Iterator<Item = &mut Vec<f64>> {
    [
        Some(&mut map.gz_t_per_m_per_a),
        map.gradient_t_per_m_per_a.as_mut(),
        map.field_t_per_a.as_mut(),
    ]
    .into_iter()
    .flatten()
}

fn scale(map: &mut FieldMap, factor: f64) {
    for values in each(map) {
        values.iter_mut().for_each(|value| *value *= factor);
    }
}

fn add(map: &mut FieldMap, other: &FieldMap, factor: f64) {
    let others = [
        Some(&other.gz_t_per_m_per_a),
        other.gradient_t_per_m_per_a.as_ref(),
        other.field_t_per_a.as_ref(),
    ];
    for (values, others) in each(map).zip(others.into_iter().flatten()) {
        for (value, other) in values.iter_mut().zip(others) {
            *value += factor * other;
        }
    }
    map.tabulated |= other.tabulated;
}

/// The grid whose box holds every place of the magnet's dipoles: its ends moved outwards.
fn widest(grid: &Grid, magnet: &MagnetMean) -> Grid {
    let moved = |nodes: &[f64], axis: usize| {
        let mut out = nodes.to_vec();
        for (_, shares) in &magnet.layers {
            for (offset, _) in shares {
                out.extend(nodes.first().map(|x| x + offset[axis]));
                out.extend(nodes.last().map(|x| x + offset[axis]));
            }
        }
        out.sort_by(f64::total_cmp);
        out.dedup();
        let (first, last) = (out.first().copied(), out.last().copied());
        out.retain(|x| nodes.contains(x) || Some(*x) == first || Some(*x) == last);
        out
    };
    Grid {
        x_m: moved(&grid.x_m, 0),
        y_m: moved(&grid.y_m, 1),
        z_m: moved(&grid.z_m, 2),
    }
}

/// Nodes of a grid's lowest plane: where it comes closest to the coils.
fn lowest_plane(grid: &Grid) -> Vec<[f64; 3]> {
    let z_m = grid.z_m.first().copied().unwrap_or(0.0);
    grid.y_m
        .iter()
        .flat_map(|y| grid.x_m.iter().map(move |x| [*x, *y, z_m]))
        .collect()
}

/// Refuses nodes of `grid` where a dipole of `magnet` would be too close to steel, before any is solved.
///
/// # Errors
/// The first such node.
pub(crate) fn check_nodes(scene: &Scene, grid: &Grid, magnet: &MagnetMean) -> Result<(), RunError> {
    clearance(scene, &nearest_to_steel(scene, grid), magnet.reach_m).map(|_| ())
}

/// The nodes that may be the nearest to steel, and those that bound the heights of nodes beside it.
pub(crate) fn nearest_to_steel(scene: &Scene, grid: &Grid) -> Vec<[f64; 3]> {
    let top_m = scene.core.as_ref().map_or(0.0, |core| core.shape.top_m);
    let beside = grid.z_m.first().is_some_and(|z_m| *z_m < top_m);
    // Iron may be beside or above any node.
    if scene.iron.is_some() || beside {
        every_node(grid)
    } else {
        lowest_plane(grid)
    }
}

fn every_node(grid: &Grid) -> Vec<[f64; 3]> {
    let plane = lowest_plane(grid);
    let lifted = |z: &f64| {
        plane
            .iter()
            .map(|[x, y, _]| [*x, *y, *z])
            .collect::<Vec<_>>()
    };
    grid.z_m.iter().flat_map(lifted).collect()
}

/// Nodes of a map to be compared.
fn samples(scene: &Scene, solved: &Solved, map: &FieldMap, coils: &[PlacedCoil]) -> Vec<Sample> {
    let (nx, ny, nz) = (map.x_m.len(), map.y_m.len(), map.z_m.len());
    let of = |index: usize| &coils[index / (nx * ny * nz)];
    let r_m = |index: usize| {
        let [x_m, y_m] = of(index).axis_m;
        (map.x_m[index % nx] - x_m).hypot(map.y_m[index / nx % ny] - y_m)
    };
    compared(scene, solved, map.gz_t_per_m_per_a.len(), r_m)
        .into_iter()
        .filter_map(|index| {
            let gain = of(index).gain;
            (gain != 0.0).then(|| Sample {
                r_m: r_m(index),
                z_m: map.z_m[index / (nx * ny) % nz],
                gz: map.gz_t_per_m_per_a[index] / gain,
            })
        })
        .collect()
}

/// The proven bound of the map's error at its nodes, the steel's solution and the magnet left out.
fn evaluation(map: &FieldMap, solved: &Solved) -> Evaluation {
    let estimate = if solved.has_steel() {
        // The winding's rule, the steel's evaluation and its table.
        (2.0 * MAP_SHARE + EVALUATION_SHARE) * solved.tolerance
    } else {
        map.relative_error.max(KERNEL_ERROR)
    };
    let method = if map.tabulated {
        "a-priori bounds of the radial quadrature and of the tables"
    } else {
        "a-priori bound of the radial quadrature"
    };
    Evaluation {
        estimate,
        method: method.to_owned(),
    }
}

/// The map's own error at its nodes.
fn accuracy(evaluation: Evaluation, solved: &Solved, magnet: f64) -> StageAccuracy {
    let Evaluation { estimate, method } = evaluation;
    let table = if solved.steel().couples() {
        ", its table by comparison with direct values"
    } else {
        ""
    };
    StageAccuracy {
        estimate: estimate + solved.steel_error + magnet,
        relative_to: "the largest |grad B| at the node's height".to_owned(),
        method: match solved.steel_method() {
            None => method,
            Some(steel) => format!("{steel}{table}; {method}"),
        },
    }
}
