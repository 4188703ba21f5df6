//! The part of the maps that an object needs.

use crate::RunError;
use crate::bundle::manifest::LeftOut;
use crate::commands::map::workspace_grid;
use crate::design::Design;
use crate::map::Components;
use crate::map::tabulate::{Grid, PlacedCoil};
use crate::progress::Progress;
use crate::scene::cached_field::ShapeField;
use crate::scene::cost::check_map;
use crate::scene::maps::{MagnetMean, SceneMap};
use crate::scene::steel::Solved;
use crate::scene::{MAGNET_SHARE, Scene};
use crate::shape::points::ConstraintPoints;

/// The part of the maps that an object needs, and what was left out of it.
pub(super) struct NeededMap {
    pub(super) made: SceneMap,
    pub(super) components: Components,
    pub(super) left_out: Vec<LeftOut>,
}

impl NeededMap {
    /// With all three components of the force where a `vector` is requested.
    pub(super) fn new(
        scene: &Scene,
        (solved, vector): (&Solved, bool),
        field: ShapeField,
        (design, points, reach_m): (&Design, &ConstraintPoints, f64),
        progress: &dyn Progress,
    ) -> Result<Self, RunError> {
        let mut left_out = Vec::new();
        check(scene, vector, (design, points, reach_m))?;
        let grid = needed_grid(design, points, reach_m, &mut left_out);
        let components = needed_components(scene, vector);
        if !scene.tilted() {
            let (what, why) = if vector {
                (
                    "field and gradient but for its column along z",
                    "the force on an upright magnet needs that column alone (eq. 4)",
                )
            } else {
                (
                    "field and transverse gradient",
                    "an upright dipole's vertical force needs dB_z/dz alone (eq. 5)",
                )
            };
            left_out.push(LeftOut {
                what: what.to_owned(),
                why: why.to_owned(),
                error_cost: Some(0.0),
            });
        }
        let driven = needed_coils(scene);
        if driven.len() < scene.coils.len() {
            left_out.push(LeftOut {
                what: format!("{} coils", scene.coils.len() - driven.len()),
                why: "their current limits are zero".to_owned(),
                error_cost: Some(0.0),
            });
        }
        let felt = MagnetMean::by_magnet(scene, &grid.z_m, MAGNET_SHARE * solved.tolerance)?;
        let mut made = field.map(scene, solved, &driven, &grid, components, &felt, progress)?;
        drop_weak_coils(scene, &mut made, &driven, solved.tolerance, &mut left_out);
        Ok(Self {
            made,
            components,
            left_out,
        })
    }
}

/// Checks the memory of the part of the maps that an object needs.
///
/// # Errors
/// More than granted, and what to do.
pub(super) fn check(
    scene: &Scene,
    vector: bool,
    (design, points, reach_m): (&Design, &ConstraintPoints, f64),
) -> Result<(), RunError> {
    let grid = needed_nodes(design, points, reach_m);
    let samples = [grid.x_m, grid.y_m, grid.z_m].map(|nodes| nodes.len());
    let coils = needed_coils(scene).len();
    check_map(design, samples, coils, needed_components(scene, vector))
}

fn needed_components(scene: &Scene, vector: bool) -> Components {
    match (vector, scene.tilted()) {
        (true, _) => Components::Force,
        (false, true) => Components::Gradient,
        (false, false) => Components::Gz,
    }
}

/// The coils that may carry current.
pub(crate) fn needed_coils(scene: &Scene) -> Vec<PlacedCoil> {
    let coils = scene.coils.iter();
    coils
        .filter(|coil| largest_current_a(scene, coil.number) > 0.0)
        .copied()
        .collect()
}

fn largest_current_a(scene: &Scene, coil: usize) -> f64 {
    scene.upper_a[coil].max(-scene.lower_a[coil])
}

/// Removes coils whose largest force anywhere on the map stays below `tolerance` of the largest
/// that any coil can give.
fn drop_weak_coils(
    scene: &Scene,
    made: &mut SceneMap,
    coils: &[PlacedCoil],
    tolerance: f64,
    left_out: &mut Vec<LeftOut>,
) {
    let map = &mut made.map;
    let nodes = map.x_m.len() * map.y_m.len() * map.z_m.len();
    // Far beside a coil its sideways force is many times its upward one.
    let components: Vec<&[f64]> = (made.sides.iter().flatten())
        .chain([&map.gz_t_per_m_per_a])
        .map(Vec::as_slice)
        .collect();
    let strength: Vec<f64> = (coils.iter().enumerate())
        .map(|(at, coil)| {
            let own = (components.iter()).flat_map(|all| &all[at * nodes..(at + 1) * nodes]);
            let largest = own.fold(0.0_f64, |most, g| most.max(g.abs()));
            largest * largest_current_a(scene, coil.number)
        })
        .collect();
    let strongest = strength.iter().copied().fold(0.0, f64::max);
    let keep: Vec<bool> = strength
        .iter()
        .map(|s| *s > tolerance * strongest)
        .collect();
    if keep.iter().all(|keep| *keep) || strongest == 0.0 {
        return;
    }
    let weak: f64 = strength
        .iter()
        .zip(&keep)
        .filter(|(_, keep)| !**keep)
        .map(|(s, _)| s)
        .sum();
    left_out.push(LeftOut {
        what: format!("{} coils", keep.iter().filter(|keep| !**keep).count()),
        why: "at their largest currents together they change no force on the map by more than \
              this part of the largest that one coil gives"
            .to_owned(),
        error_cost: Some(weak / strongest),
    });
    let retain = |values: &mut Vec<f64>, components: usize| {
        let size = (nodes * components).max(1);
        let kept: Vec<f64> = values
            .chunks_exact(size)
            .zip(&keep)
            .filter(|(_, keep)| **keep)
            .flat_map(|(block, _)| block.iter().copied())
            .collect();
        *values = kept;
    };
    retain(&mut map.gz_t_per_m_per_a, 1);
    for side in made.sides.iter_mut().flatten() {
        retain(side, 1);
    }
    if let Some(gradient) = &mut map.gradient_t_per_m_per_a {
        retain(gradient, 9);
    }
    map.coils = coils
        .iter()
        .zip(&keep)
        .filter(|(_, keep)| **keep)
        .map(|(coil, _)| coil.number)
        .collect();
}

/// The nodes of the workspace within reach of the object's points, one cell beyond.
pub(crate) fn needed_nodes(design: &Design, points: &ConstraintPoints, reach_m: f64) -> Grid {
    let whole = workspace_grid(design);
    let part = |nodes: &[f64], values: &[f64]| -> Vec<f64> {
        let lowest = values.iter().copied().fold(f64::INFINITY, f64::min) - reach_m;
        let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + reach_m;
        // The last node at or below the range, the first at or above it; four nodes at least,
        // so that the interpolation keeps its degree.
        let mut start = nodes
            .partition_point(|node| *node <= lowest)
            .saturating_sub(1);
        let mut end = (nodes.partition_point(|node| *node < highest) + 1).min(nodes.len());
        while end - start < 4.min(nodes.len()) {
            start = start.saturating_sub(1);
            end = (end + 1).min(nodes.len());
        }
        nodes[start..end].to_vec()
    };
    Grid {
        x_m: part(&whole.x_m, &points.x_m),
        y_m: part(&whole.y_m, &points.y_m),
        z_m: part(&whole.z_m, &points.height_m),
    }
}

fn needed_grid(
    design: &Design,
    points: &ConstraintPoints,
    reach_m: f64,
    left_out: &mut Vec<LeftOut>,
) -> Grid {
    let whole = workspace_grid(design);
    let grid = needed_nodes(design, points, reach_m);
    let count = |grid: &Grid| grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
    if count(&grid) < count(&whole) {
        left_out.push(LeftOut {
            what: format!(
                "{} of {} workspace nodes",
                count(&whole) - count(&grid),
                count(&whole)
            ),
            why: format!(
                "farther than {} mm from every point of the object",
                reach_m * 1000.0
            ),
            error_cost: Some(0.0),
        });
    }
    grid
}
