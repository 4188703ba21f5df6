//! The force that a map stands for, as a drawing: slices with all coils driven, and over height.

use crate::bundle::force_map::ForceMap;
use crate::bundle::npz::MapArrays;
use crate::design::Design;
use crate::plot::slices::{HeightCurve, Shades, Slice, SlicesPlot};

/// Curves that differ by no more than this part of the largest value are one line in a drawing.
const ALIKE: f64 = 2e-3;
/// Names of coils in a legend, at most; of more the number alone.
const MOST_NAMED: usize = 4;

/// Slices of the force on the magnet with every coil at its rated current, across at the target's
/// height and upright through the middle coil; and the upward force of one ampere above each coil that
/// has no equal. The upward force alone where the map holds no other.
pub(super) fn picture(design: &Design, map: &MapArrays, rated_a: &[f64]) -> SlicesPlot {
    let force = ForceMap::of_map(map);
    let [x, y, z] = [&*map.x_m, &*map.y_m, &*map.z_m];
    let axes_m = &design.array.positions_m;
    let distance = |axis: &&[f64; 2]| axis[0].hypot(axis[1]);
    let middle = axes_m
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let height_m = nearest(z, design.target_height_m);
    let section_m = nearest(y, middle.map_or(0.0, |axis| axis[1]));
    let across = y.iter().flat_map(|y| x.iter().map(|x| [*x, *y, height_m]));
    let upright = z.iter().flat_map(|z| x.iter().map(|x| [*x, section_m, *z]));
    let [across, upright] = [across.collect::<Vec<_>>(), upright.collect()]
        .map(|places| forces_n(&force, &places, rated_a));
    let ends = |nodes: &[f64]| [nodes[0], nodes[nodes.len() - 1]];
    let planes = [
        (
            &across,
            format!("at z = {} mm", millimetres(height_m)),
            ["x", "y"],
            [ends(x), ends(y)],
        ),
        (
            &upright,
            format!("at y = {} mm", millimetres(section_m)),
            ["x", "z"],
            [ends(x), ends(z)],
        ),
    ];
    let shown = if force.has_vectors() {
        &[2, 0, 1][..]
    } else {
        &[2]
    };
    let slices = planes.iter().flat_map(|(forces, place, axes, ends_m)| {
        // Through the middle of a symmetric array nothing pushes along y.
        let shown = shown.iter().filter(|part| axes[1] == "y" || **part != 1);
        shown.map(|part| Slice {
            title: [format!("F_{}", ["x", "y", "z"][*part]), place.clone()],
            axes: *axes,
            ends_m: *ends_m,
            unit: "N",
            columns: x.len(),
            values: forces.iter().map(|force| Some(force[*part])).collect(),
            shades: Shades::Signed,
            lines: Vec::new(),
        })
    });
    SlicesPlot {
        title: format!(
            "{}: force on the magnet with every coil at its rated current",
            design.name
        ),
        slices: slices.collect(),
        columns: 3,
        curves_title: "F_z of one ampere above its coil".to_owned(),
        curves: curves(&force, axes_m, z),
    }
}

/// Without the last digits, which are rounding.
fn millimetres(metres: f64) -> f64 {
    (1e7 * metres).round() / 1e4
}

/// The node nearest to a place.
fn nearest(nodes: &[f64], place: f64) -> f64 {
    let off = |node: &&f64| (**node - place).abs();
    let found = nodes.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    found.copied().unwrap_or(place)
}

/// The force of these currents and of the unpowered steel, as far as the map counts it, at every place, N; along x and y
/// zero where the map does not hold them.
fn forces_n(map: &ForceMap, places_m: &[[f64; 3]], currents_a: &[f64]) -> Vec<[f64; 3]> {
    let mut vectors = vec![[0.0; 3]; map.coils()];
    let mut upward = vec![0.0; map.coils()];
    let force = |place: &[f64; 3]| {
        let pull_n = map.vectors_at(*place, &mut vectors).or_else(|| {
            let pull_n = map.at(*place, &mut upward)?;
            for (vector, upward) in vectors.iter_mut().zip(&upward) {
                vector[2] = *upward;
            }
            Some(pull_n)
        });
        let mut sum = [0.0, 0.0, pull_n.unwrap_or(0.0)];
        for (vector, current) in vectors.iter().zip(currents_a) {
            for (sum, part) in sum.iter_mut().zip(vector) {
                *sum += current * part;
            }
        }
        sum
    };
    places_m.iter().map(force).collect()
}

/// The upward force of one ampere on the axis of each coil, those that are alike once.
fn curves(map: &ForceMap, axes_m: &[[f64; 2]], z_m: &[f64]) -> Vec<HeightCurve> {
    let mut per_ampere = vec![0.0; map.coils()];
    let mut kinds: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
    let mut largest = 0.0_f64;
    for (coil, [x, y]) in axes_m.iter().enumerate() {
        let at = |z: &f64| {
            map.at([*x, *y, *z], &mut per_ampere)
                .map(|_| per_ampere[coil])
        };
        let Some(curve) = z_m.iter().map(at).collect::<Option<Vec<f64>>>() else {
            continue;
        };
        largest = curve
            .iter()
            .fold(largest, |most, force| most.max(force.abs()));
        let alike = |(_, other): &&mut (Vec<usize>, Vec<f64>)| {
            let mut pairs = other.iter().zip(&curve);
            pairs.all(|(a, b)| (a - b).abs() <= ALIKE * largest)
        };
        match kinds.iter_mut().find(alike) {
            Some((coils, _)) => coils.push(coil),
            None => kinds.push((vec![coil], curve)),
        }
    }
    let curve = |(coils, curve): (Vec<usize>, Vec<f64>)| HeightCurve {
        name: name(&coils),
        points: z_m.iter().copied().zip(curve).collect(),
    };
    kinds.into_iter().map(curve).collect()
}

fn name(coils: &[usize]) -> String {
    match coils {
        [one] => format!("coil {one}"),
        few if few.len() <= MOST_NAMED => {
            let names: Vec<String> = few.iter().map(usize::to_string).collect();
            format!("coils {}", names.join(", "))
        }
        many => format!("coil {} and {} others alike", many[0], many.len() - 1),
    }
}
