//! The unpowered steel's pull.

use std::ops::Range;

use super::route::FINER;
use super::{Bounds, Check, check, ratio};
use crate::RunError;
use crate::bundle::load::Bundle;
use crate::map::tabulate::Grid;
use crate::numerics::spread::spread;
use crate::scene::Scene;
use crate::scene::passive::{self, PASSIVE_TOLERANCE};
use crate::scene::passive_map::PassiveMap;

/// The unpowered steel's pull at the points, finer than the bundle's; `None` where the design does
/// not ask for it.
pub(super) fn offset_n(
    scene: &Scene,
    positions: &[[f64; 3]],
) -> Result<Option<Vec<f64>>, RunError> {
    if !scene.design.magnet.passive_force {
        return Ok(None);
    }
    let pull = passive::pull_to(scene, positions, false, FINER * PASSIVE_TOLERANCE)?;
    Ok(pull.map(|pull| pull.forces_z_n(positions)))
}

/// Places at which the pull is computed by another route: on nodes, and as many between them.
const PULL_SAMPLES: usize = 40;

/// The map of the unpowered steel's pull: every node against a finer map, some of them and places
/// between them against another route.
pub(super) fn checks(
    bundle: &Bundle,
    scene: &Scene,
    bounds: &Bounds,
) -> Result<Vec<Check>, RunError> {
    const NODES: &str = "passive force nodes";
    let map = &bundle.map;
    let counts = scene.design.magnet.passive_force && scene.steel_extent_m().is_some();
    let Some(values) = &map.passive_force_n else {
        let how = "the design has passive_force, the bundle holds none: calibrate again".to_owned();
        return Ok(counts
            .then(|| check(NODES, f64::MAX, 0.0, how))
            .into_iter()
            .collect());
    };
    if !counts {
        let how = "the bundle holds a passive force, the design has none".to_owned();
        return Ok(vec![check(NODES, f64::MAX, 0.0, how)]);
    }
    let stated = bounds.pull_map;
    let tolerance = FINER * PASSIVE_TOLERANCE;
    let grid = Grid {
        x_m: map.x_m.to_vec(),
        y_m: map.y_m.to_vec(),
        z_m: map.z_m.to_vec(),
    };
    let Some(finer) = PassiveMap::new(scene, &grid, tolerance)? else {
        return Ok(Vec::new());
    };
    let [_, nz, ny, nx] = map.shape();
    let largest = |plane: &[f64]| plane.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let planes = finer.force_z_n.chunks_exact(nx * ny);
    let mut sizes: Vec<f64> = planes.map(largest).collect();
    let worst = values
        .iter()
        .zip(&finer.force_z_n)
        .enumerate()
        .map(|(i, (stored, finer))| ratio((stored - finer).abs(), sizes[i / (nx * ny)]))
        .fold(0.0, f64::max);
    let allowed = stated + finer.accuracy.estimate;
    let mut checks = vec![check(
        NODES,
        worst,
        allowed,
        "every node against a finer map of the pull".to_owned(),
    )];

    let places = places(&grid);
    let points: Vec<[f64; 3]> = places.iter().map(|(at, _)| *at).collect();
    let Some(sure) = passive::direct_z_n(scene, &points, tolerance)? else {
        return Ok(checks);
    };
    // Where nodes miss the peak, the places show it.
    for ((_, around), sure) in places.iter().zip(&sure) {
        sizes[around.start] = sizes[around.start].max(sure.abs());
    }
    let errors: Vec<f64> = places
        .iter()
        .zip(&sure)
        .map(|((at, around), sure)| {
            let stored = bundle.passive_force_n(*at).unwrap_or(f64::INFINITY);
            ratio((stored - sure).abs(), largest(&sizes[around.clone()]))
        })
        .collect();
    let (on, between) = errors.split_at(PULL_SAMPLES.min(nx * ny * nz));
    let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    let how = format!("{} nodes by the field that the steel sends back", on.len());
    checks.push(check("passive force", worst(on), stated + tolerance, how));
    checks.push(check(
        "passive force between nodes",
        worst(between),
        bounds.pull_between + stated + tolerance,
        format!(
            "{} places between nodes, interpolated as the loaders do",
            between.len()
        ),
    ));
    Ok(checks)
}

/// Places on nodes, then as many between them, each with the levels of nodes around it.
fn places(grid: &Grid) -> Vec<([f64; 3], Range<usize>)> {
    let [nx, ny, nz] = [grid.x_m.len(), grid.y_m.len(), grid.z_m.len()];
    let cells = [nx, ny, nz].map(|n| n.saturating_sub(1).max(1));
    let on_nodes = spread(nx * ny * nz, PULL_SAMPLES)
        .into_iter()
        .map(|i| ([i % nx, i / nx % ny, i / (nx * ny)], 0.0));
    let between = spread(cells.iter().product(), PULL_SAMPLES)
        .into_iter()
        .map(|i| {
            let k = i / (cells[0] * cells[1]);
            ([i % cells[0], i / cells[0] % cells[1], k], 0.43)
        });
    on_nodes
        .chain(between)
        .map(|([x, y, z], t)| {
            let at = |nodes: &[f64], i: usize| match nodes.get(i + 1) {
                Some(next) => nodes[i] + t * (next - nodes[i]),
                None => nodes[i],
            };
            let at_m = [at(&grid.x_m, x), at(&grid.y_m, y), at(&grid.z_m, z)];
            let last = if t > 0.0 { z + 2 } else { z + 1 };
            (at_m, z..last.min(nz))
        })
        .collect()
}
