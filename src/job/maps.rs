//! Maps of a scene over a grid, whatever its sources, and their interpolation's error.

use super::JobError;
use super::scene::Scene;
use super::steel::{Solved, Steel};
use crate::accuracy::StageAccuracy;
use crate::field::magnet::MagnetRule;
use crate::field::steel::source::CoredSource;
use crate::field::steel::sources::{ArraySources, Parts};
use crate::map::sampled::{SampledField, TableReport};
use crate::map::sampler::Sampler;
use crate::map::tabulate::{Grid, MapError, PlacedCoil};
use crate::map::{
    Components, FieldMap, InterpolationError, interpolation_error, interpolation_error_by, tabulate,
};
use crate::progress::{Progress, Silent};

/// A map and what is known of it.
#[derive(Debug, Clone)]
pub struct SceneMap {
    /// The map.
    pub map: FieldMap,
    /// Error of interpolating it between its nodes.
    pub between: InterpolationError,
    /// The steel's compact form, where there was one.
    pub table: Option<TableReport>,
    /// Estimated error of its nodes.
    pub accuracy: StageAccuracy,
}

/// Share of the tolerance given to the maps' own rules beside the steel's solution.
const MAP_SHARE: f64 = 0.3;

impl SceneMap {
    /// Maps of `coils` of `scene` over `grid`. With `rule` every value is the mean that the
    /// magnet feels, F_z / m_z being what the map gives; without, the field itself.
    ///
    /// # Errors
    /// A node on a winding's edge or on the steel; interruption.
    pub fn new(
        scene: &Scene,
        solved: &Solved,
        coils: &[PlacedCoil],
        grid: &Grid,
        components: Components,
        rule: Option<&MagnetRule>,
        progress: &dyn Progress,
    ) -> Result<Self, JobError> {
        let dipole = MagnetRule::dipole(scene.moment_a_m2);
        let rule = rule.unwrap_or(&dipole);
        let shares = shares(rule);
        // A grid through every place that a node of the magnet can take.
        let widest = widest(grid, &shares);
        let lowest = lowest_plane(grid);
        let (table, map, between) = match &solved.steel {
            Steel::None => {
                let tolerance = solved.tolerance / rule.amplification();
                let one = |coils: &[PlacedCoil], grid: &Grid, components, p: &dyn Progress| {
                    tabulate(&scene.winding, coils, grid, components, tolerance, p)
                };
                let map = mean(&one, &shares, coils, grid, components, progress)?;
                progress.begin("interpolation error", 1);
                let between = if shares.len() == 1 {
                    let gz = &map.gz_t_per_m_per_a;
                    interpolation_error(&scene.winding, coils, grid, gz, tolerance)?
                } else {
                    between(&one, &shares, coils, grid, &map)?
                };
                (None, map, between)
            }
            Steel::Alone(_) => {
                let tolerance = MAP_SHARE * solved.tolerance / rule.amplification();
                // The nearest core decides how fine the rings are; seen from its own axis.
                let steel = solved
                    .sources(scene, &lowest, rule.reach_m())?
                    .ok_or_else(no_steel)?;
                let source = CoredSource {
                    winding: scene.winding,
                    steel,
                };
                let one = |coils: &[PlacedCoil], grid: &Grid, components, p: &dyn Progress| {
                    tabulate(&source, coils, grid, components, tolerance, p)
                };
                let map = mean(&one, &shares, coils, grid, components, progress)?;
                progress.begin("interpolation error", 1);
                let between = between(&one, &shares, coils, grid, &map)?;
                (None, map, between)
            }
            Steel::Coupled(_) => {
                let tolerance = MAP_SHARE * solved.tolerance / rule.amplification();
                let steel = solved
                    .sources(scene, &lowest, rule.reach_m())?
                    .ok_or_else(no_steel)?;
                let sampled = SampledField::new(&steel, &widest, components, tolerance, progress)?;
                let one = |coils: &[PlacedCoil], grid: &Grid, components, p: &dyn Progress| {
                    let mut map =
                        tabulate(&scene.winding, coils, grid, components, tolerance, &Silent)?;
                    add(&mut map, &sampled.map(coils, grid, p)?, 1.0);
                    Ok(map)
                };
                let map = mean(&one, &shares, coils, grid, components, progress)?;
                progress.begin("interpolation error", 1);
                let between = between(&one, &shares, coils, grid, &map)?;
                (Some(sampled.report), map, between)
            }
        };
        progress.end();
        let accuracy = accuracy(&map, solved, rule.bound());
        Ok(Self {
            map,
            between,
            table,
            accuracy,
        })
    }
}

fn no_steel() -> JobError {
    JobError::Input("the design has steel, but its solution holds none".to_owned())
}

type Maker<'a> = dyn Fn(&[PlacedCoil], &Grid, Components, &dyn Progress) -> Result<FieldMap, MapError>
    + Sync
    + 'a;

/// Offsets of the magnet's dipoles and their parts of its moment.
fn shares(rule: &MagnetRule) -> Vec<([f64; 3], f64)> {
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
    shares: &[([f64; 3], f64)],
    coils: &[PlacedCoil],
    grid: &Grid,
    components: Components,
    progress: &dyn Progress,
) -> Result<FieldMap, MapError> {
    let mut whole: Option<FieldMap> = None;
    for (offset_m, share) in shares {
        let mut part = one(coils, &shifted(grid, *offset_m), components, progress)?;
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
        None => one(coils, grid, components, progress)?,
    };
    (map.x_m, map.y_m, map.z_m) = (grid.x_m.clone(), grid.y_m.clone(), grid.z_m.clone());
    Ok(map)
}

fn between(
    one: &Maker,
    shares: &[([f64; 3], f64)],
    coils: &[PlacedCoil],
    grid: &Grid,
    map: &FieldMap,
) -> Result<InterpolationError, MapError> {
    let direct = |coils: &[PlacedCoil], places: &Grid| {
        mean(one, shares, coils, places, Components::Gz, &Silent)
    };
    interpolation_error_by(&direct, coils, grid, &map.gz_t_per_m_per_a)
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

/// The grid whose box holds every place of the magnet's dipoles: the nodes of all shifted grids.
fn widest(grid: &Grid, shares: &[([f64; 3], f64)]) -> Grid {
    let all = |nodes: &[f64], axis: usize| {
        let mut out: Vec<f64> = shares
            .iter()
            .flat_map(|(offset, _)| nodes.iter().map(move |x| x + offset[axis]))
            .collect();
        out.sort_by(f64::total_cmp);
        out.dedup();
        out
    };
    Grid {
        x_m: all(&grid.x_m, 0),
        y_m: all(&grid.y_m, 1),
        z_m: all(&grid.z_m, 2),
    }
}

/// Nodes of a grid's lowest plane: where it comes closest to the coils.
pub(super) fn lowest_plane(grid: &Grid) -> Vec<[f64; 3]> {
    let z_m = grid.z_m.first().copied().unwrap_or(0.0);
    grid.y_m
        .iter()
        .flat_map(|y| grid.x_m.iter().map(move |x| [*x, *y, z_m]))
        .collect()
}

/// The map's own error at its nodes.
fn accuracy(map: &FieldMap, solved: &Solved, magnet: f64) -> StageAccuracy {
    let rules = match solved.steel {
        Steel::None => map.relative_error.max(super::KERNEL_ERROR),
        Steel::Alone(_) | Steel::Coupled(_) => MAP_SHARE * solved.tolerance,
    };
    let winding = if map.tabulated {
        "a-priori bounds of the radial quadrature and of the tables"
    } else {
        "a-priori bound of the radial quadrature"
    };
    let method = match solved.steel {
        Steel::None => winding.to_owned(),
        Steel::Alone(_) => format!("steel by two resolutions; {winding}"),
        Steel::Coupled(_) => format!(
            "coupled steel by two resolutions, its table by comparison with direct values; {winding}"
        ),
    };
    StageAccuracy {
        estimate: rules + solved.steel_error + magnet,
        relative_to: "the largest |grad B| at the node's height".to_owned(),
        method,
    }
}

/// What is sampled for a map's components.
pub(super) fn parts_of(components: Components) -> Parts {
    match components {
        Components::Gz => Parts::Gz,
        Components::Gradient => Parts::Gradient,
        Components::All => Parts::All,
    }
}

impl Sampler for ArraySources {
    fn drives(&self) -> usize {
        Self::drives(self)
    }

    fn top_m(&self) -> f64 {
        Self::top_m(self)
    }

    fn sample(
        &self,
        points_m: &[[f64; 3]],
        components: Components,
        out: &mut [f64],
    ) -> Result<(), MapError> {
        Self::sample(self, points_m, parts_of(components), out);
        Ok(())
    }
}
