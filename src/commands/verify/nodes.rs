//! The map, on its nodes and between them.

use super::route::Route;
use super::{BETWEEN_MAX, Bounds, Check, check, ratio};
use crate::RunError;
use crate::bundle::load::Bundle;
use crate::field::winding::KERNEL_ERROR;
use crate::numerics::lagrange;
use crate::numerics::spread::spread;

/// The components that a map holds: the name of each in checks, its place among what
/// [`Route::gradients`] gives, and its values.
type Held<'a> = ([&'static str; 2], usize, &'a [f64]);

fn held(bundle: &Bundle) -> Vec<Held<'_>> {
    let map = &bundle.map;
    let names = [
        ["map nodes of gx", "map between nodes of gx"],
        ["map nodes of gy", "map between nodes of gy"],
    ];
    let sides = map.sides().into_iter().flatten();
    let sides = names.into_iter().zip(sides).enumerate();
    std::iter::once((
        ["map nodes", "map between nodes"],
        2,
        &*map.gz_t_per_m_per_a,
    ))
    .chain(sides.map(|(axis, (names, values))| (names, axis, values)))
    .collect()
}

/// The largest value at a height: on the axis or anywhere of the map's plane.
fn largest_in_plane(bundle: &Bundle, values: &[f64], level: usize) -> f64 {
    let map = &bundle.map;
    let plane = map.x_m.len() * map.y_m.len();
    (0..map.coil.len())
        .flat_map(|coil| {
            let start = (coil * map.z_m.len() + level) * plane;
            &values[start..start + plane]
        })
        .fold(0.0, |most: f64, g| most.max(g.abs()))
}

/// The largest |grad B| at each height of the map, T/m/A, at least: that on a coil's axis, above the edge of its winding
/// or over the map. Without currents at the place the trace of grad B is zero, so that |grad B|^2 is 3/2 (dB_z/dz)^2 at
/// least, and twice the squares of what is beside the diagonal.
fn largest_gradients(bundle: &Bundle, route: &Route) -> Result<Vec<f64>, RunError> {
    let map = &bundle.map;
    let Some(coil) = map.coil.first().map(|coil| *coil as usize) else {
        return Ok(Vec::new());
    };
    let [x, y] = route.scene.coils[coil].axis_m;
    let (top_m, edge_m) = (
        route.scene.sources_top_m(),
        route.scene.winding.outer_radius_m,
    );
    let of_level = |z: &f64| {
        // Beside the sources the edge may lie in a neighbour.
        let aside = if *z > top_m { edge_m } else { 0.0 };
        [(coil, [x, y, *z]), (coil, [x + aside, y, *z])]
    };
    let places: Vec<(usize, [f64; 3])> = map.z_m.iter().flat_map(of_level).collect();
    let found = route.gradients(&places)?;
    let size = |[gx, gy, gz]: &[f64; 3]| (1.5 * gz * gz + 2.0 * (gx * gx + gy * gy)).sqrt();
    Ok(found
        .chunks(2)
        .enumerate()
        .map(|(level, found)| {
            let on_nodes = largest_in_plane(bundle, &map.gz_t_per_m_per_a, level);
            let largest = found.iter().map(size).fold(0.0, f64::max);
            largest.max(1.5_f64.sqrt() * on_nodes)
        })
        .collect())
}

/// |dB_x/dz|, dB_y/dz and dB_z/dz at each height of the map, T/m/A, near where those of a coil are largest: nodes may
/// lie on both sides of its axis and all be smaller.
fn peaks_between(bundle: &Bundle, route: &Route) -> Result<Vec<[f64; 3]>, RunError> {
    /// Above a dipole the sideways components are largest so far beside its axis, over the height above it.
    const ASIDE: f64 = 0.4;
    let map = &bundle.map;
    let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
    let plan = [ends(&map.x_m), ends(&map.y_m)];
    let off_middle_m = |coil: &usize| {
        let axis_m = route.scene.coils[*coil].axis_m;
        let off = |axis: usize| axis_m[axis] - 0.5 * (plan[axis][0] + plan[axis][1]);
        off(0).hypot(off(1))
    };
    let coils = map.coil.iter().map(|coil| *coil as usize);
    let Some(coil) = coils.min_by(|a, b| off_middle_m(a).total_cmp(&off_middle_m(b))) else {
        return Ok(vec![[0.0; 3]; map.z_m.len()]);
    };
    let [x, y] = route.scene.coils[coil].axis_m;
    let within = |at: f64, axis: usize| at.clamp(plan[axis][0], plan[axis][1]);
    let of_level = |z: &f64| {
        let aside = ASIDE * z.abs();
        [(x + aside, y), (x, y + aside), (x, y)]
            .map(|(x, y)| (coil, [within(x, 0), within(y, 1), *z]))
    };
    let places: Vec<(usize, [f64; 3])> = map.z_m.iter().flat_map(of_level).collect();
    let found = route.gradients(&places)?;
    let largest = |of: &[[f64; 3]]| [0, 1, 2].map(|part: usize| of[part][part].abs());
    Ok(found.chunks(3).map(largest).collect())
}

/// Sampled nodes.
pub(super) fn on(bundle: &Bundle, route: &Route, bounds: &Bounds) -> Result<Vec<Check>, RunError> {
    let map = &bundle.map;
    let [coils, nz, ny, nx] = map.shape();
    let places = spread(coils * nz * ny * nx, route.samples());
    let requested: Vec<(usize, [f64; 3])> = places
        .iter()
        .map(|index| {
            let (x, y, z) = (index % nx, index / nx % ny, index / (nx * ny) % nz);
            let coil = map.coil[index / (nx * ny * nz)] as usize;
            (coil, [map.x_m[x], map.y_m[y], map.z_m[z]])
        })
        .collect();
    let exact = route.gradients(&requested)?;
    let sizes = largest_gradients(bundle, route)?;
    let checks = held(bundle).into_iter().map(|([name, _], part, values)| {
        let worst = places
            .iter()
            .zip(&exact)
            .map(|(index, exact)| {
                let error = (values[*index] - exact[part]).abs();
                ratio(error, sizes[index / (nx * ny) % nz])
            })
            .fold(0.0, f64::max);
        let how = format!("{} nodes by an independent route", places.len());
        check(name, worst, bounds.map.max(KERNEL_ERROR), how)
    });
    Ok(checks.collect())
}

/// Sampled places between nodes, interpolated.
pub(super) fn between(
    bundle: &Bundle,
    route: &Route,
    bounds: &Bounds,
) -> Result<Vec<Check>, RunError> {
    let map = &bundle.map;
    let [coils, nz, ny, nx] = map.shape();
    let cells = [nx, ny, nz].map(|n| n.saturating_sub(1).max(1));
    let nodes = nx * ny * nz;
    // A single node has nothing beside it.
    if nodes == 1 {
        return Ok(Vec::new());
    }
    let at = |nodes: &[f64], cell: usize, t: f64| match nodes.get(cell + 1) {
        Some(next) => nodes[cell] + t * (next - nodes[cell]),
        None => nodes[cell],
    };
    // (layer, coil's place in the map, point)
    let places: Vec<(usize, usize, [f64; 3])> =
        spread(coils * cells[0] * cells[1] * cells[2], route.samples())
            .into_iter()
            .map(|index| {
                let (i, rest) = (index % cells[0], index / cells[0]);
                let (j, rest) = (rest % cells[1], rest / cells[1]);
                let (k, place) = (rest % cells[2], rest / cells[2]);
                // Places inside the cells, different from cell to cell.
                let t = |salt: usize| ((index * 7 + salt * 13) % 29) as f64 / 29.0;
                let point = [
                    at(&map.x_m, i, t(1)),
                    at(&map.y_m, j, t(2)),
                    at(&map.z_m, k, t(3)),
                ];
                (k, place, point)
            })
            .collect();
    let requested: Vec<(usize, [f64; 3])> = places
        .iter()
        .map(|(_, place, point)| (map.coil[*place] as usize, *point))
        .collect();
    let exact = route.gradients(&requested)?;
    let peaks = peaks_between(bundle, route)?;
    let checks = held(bundle).into_iter().map(|([_, name], part, values)| {
        let on_nodes = (0..nz).map(|level| largest_in_plane(bundle, values, level));
        let mut sizes: Vec<f64> = on_nodes
            .zip(&peaks)
            .map(|(on_nodes, peak)| on_nodes.max(peak[part]))
            .collect();
        for ((k, _, _), exact) in places.iter().zip(&exact) {
            sizes[*k] = sizes[*k].max(exact[part].abs());
        }
        let worst = places
            .iter()
            .zip(&exact)
            .map(|((k, place, point), exact)| {
                let Some(cell) = lagrange::locate([&map.x_m, &map.y_m, &map.z_m], *point) else {
                    return f64::INFINITY;
                };
                let value = cell.value(&values[place * nodes..(place + 1) * nodes]);
                // The lower of the two planes around the point has the larger values.
                ratio((value - exact[part]).abs(), sizes[*k])
            })
            .fold(0.0, f64::max);
        let how = format!(
            "{} places between nodes, interpolated as the loaders do",
            places.len()
        );
        // An error above 1 states that the nodes resolve nothing, not how far off places between them are.
        let stated = match bounds.between[part] {
            unresolved if unresolved >= 1.0 => unresolved.max(BETWEEN_MAX),
            stated => stated.max(KERNEL_ERROR),
        };
        check(name, worst, stated, how)
    });
    Ok(checks.collect())
}
