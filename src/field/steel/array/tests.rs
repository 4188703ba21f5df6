//! Panels between cores, whole grids against few dipoles and patterns.

use super::*;
use crate::components::Components;
use crate::steel::array_request::{ArrayRequest, NoCache};
use crate::steel::magnetized::MagnetizedCore;

/// The seed's winding and core.
fn seed() -> (Winding, CoreShape) {
    let winding = Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    };
    let shape = CoreShape {
        radius_m: 0.012,
        bottom_m: -0.11,
        top_m: 0.0,
    };
    (winding, shape)
}

/// A kernel is singular a gap away from a panel of one and a half gaps: half-axes 4/3 and 5/3
/// of its Bernstein ellipse in units of half the panel, hence an error of 3^(-2 n).
#[test]
fn exchange_panels_resolve_the_gap_between_cores() {
    let shape = CoreShape {
        radius_m: 0.007,
        bottom_m: -0.05,
        top_m: 0.0,
    };
    for digits in 1..=9 {
        let tolerance = 10_f64.powi(-digits);
        let resolution = ArrayResolution::for_tolerance(tolerance, shape, 0.02);
        assert!((resolution.panel_m - 1.5 * (0.02 - 0.014)).abs() < 1e-12);
        let error = 3_f64.powi(-2 * i32::try_from(resolution.order).unwrap());
        assert!(error < 0.1 * tolerance, "{tolerance:e}: {error:e}");
    }
}

/// Lattices, whole and with holes, and scattered cores: solved by what passes between them they are
/// what whole grids give.
#[test]
fn what_passes_between_cores_gives_what_whole_grids_give() {
    let winding = Winding {
        inner_radius_m: 0.013,
        outer_radius_m: 0.019,
        length_m: 0.07,
        turns: 700.0,
    };
    let shape = CoreShape {
        radius_m: 0.011,
        bottom_m: -0.083,
        top_m: 0.003,
    };
    let rows = |columns: usize, [dx, dy]: [f64; 2], shift: f64| -> Vec<[f64; 2]> {
        (0..3 * columns)
            .map(|i| {
                let (row, column) = ((i / columns) as f64, (i % columns) as f64);
                [0.007 + dx * (column + shift * (row % 2.0)), dy * row]
            })
            .collect()
    };
    let mut holed = rows(4, [0.043, 0.043], 0.0);
    holed.swap_remove(5);
    let scattered = vec![
        [0.0, 0.0],
        [0.053, 0.007],
        [-0.031, 0.049],
        [0.022, -0.061],
        [0.21, 0.1],
    ];
    for positions_m in [
        rows(3, [0.047, 0.051], 0.0),
        rows(2, [0.044, 0.044 * 0.75_f64.sqrt()], 0.5),
        rows(4, [0.043, 0.043], 0.0),
        holed,
        scattered,
    ] {
        for tolerance in [1e-3, 1e-5] {
            assert_whole_and_reduced_agree(&winding, shape, &positions_m, tolerance);
        }
    }
}

/// The same of 36 and 64 cores at the seed's pitch.
#[test]
#[ignore = "a minute of the dense solution"]
fn many_cores_are_what_whole_grids_give() {
    let (winding, shape) = seed();
    for side in [6, 8] {
        let at = |i: usize| 0.05 * i as f64;
        let positions_m: Vec<[f64; 2]> = (0..side * side)
            .map(|i| [at(i % side), at(i / side)])
            .collect();
        assert_whole_and_reduced_agree(&winding, shape, &positions_m, 1e-3);
    }
}

fn assert_whole_and_reduced_agree(
    winding: &Winding,
    shape: CoreShape,
    positions_m: &[[f64; 2]],
    tolerance: f64,
) {
    let resolution = ArrayResolution::for_tolerance(tolerance, shape, closest_m(positions_m));
    let uncoupled = CoupledArray::uncoupled(winding, shape, 470.0, positions_m, &resolution);
    let (array, excitation) = uncoupled.unwrap();
    let (mut whole, mut reduced) = (array.clone(), array);
    whole.couple(&excitation, &resolution);
    reduced.couple_reduced(&excitation, &resolution);
    let [a, b] = [&whole, &reduced].map(|array| &array.added_inductance_h);
    let inductance = (a - b).amax() / a.amax();
    let cores = positions_m.len();
    let (mut layer, mut size) = (0.0_f64, 0.0_f64);
    for (drive, core) in (0..cores * cores).map(|i| (i / cores, i % cores)) {
        let [a, b] = [&whole, &reduced].map(|array| array.layers(drive, core));
        layer = layer.max((&a - b).amax());
        size = size.max(a.amax());
    }
    assert!(
        inductance < 0.1 * tolerance,
        "{cores} {tolerance:e}: {inductance:e}"
    );
    assert!(
        layer < 0.1 * tolerance * size,
        "{cores} {tolerance:e}: {layer:e} {size:e}"
    );
}

/// A priori rules gave thousands of dipoles a core, ten thousand times as exact as requested.
#[test]
fn few_dipoles_stand_for_cores_at_many_points() {
    let winding = Winding {
        inner_radius_m: 0.013,
        outer_radius_m: 0.019,
        length_m: 0.07,
        turns: 700.0,
    };
    let shape = CoreShape {
        radius_m: 0.011,
        bottom_m: -0.083,
        top_m: 0.003,
    };
    let positions_m = [[0.0, 0.0], [0.051, 0.004], [-0.013, 0.047]];
    let array = CoupledArray::new(&winding, shape, 470.0, &positions_m, 1e-3, 0.013).unwrap();
    for (lowest_m, tolerance) in [(0.013, 1e-4), (0.029, 1e-5), (0.061, 1e-3)] {
        let distance_m = lowest_m - shape.top_m;
        let every =
            ArraySources::of_array(&array, Clearance::above(lowest_m, distance_m), tolerance);
        let few = ArraySources::for_many_points(
            &array,
            Clearance::above(lowest_m, distance_m),
            tolerance,
        );
        assert!(
            10 * few.count() < 7 * every.count(),
            "{} of {}",
            few.count(),
            every.count()
        );
        let points: Vec<[f64; 3]> = (0..300)
            .map(|k| {
                let part = |step: f64| (0.5 + step * f64::from(k)).fract();
                let (x, y) = (part(0.754_877_666), part(0.569_840_291));
                [
                    0.12 * x - 0.04,
                    0.11 * y - 0.03,
                    lowest_m * f64::from(1 + k % 3),
                ]
            })
            .collect();
        let of = |sources: &ArraySources| {
            let parts = Components::Gradient;
            let mut out = vec![0.0; positions_m.len() * parts.count() * points.len()];
            sources.sample(&points, parts, &mut out);
            out
        };
        let pairs: Vec<(f64, f64)> = of(&few).into_iter().zip(of(&every)).collect();
        for (k, at) in points.iter().enumerate() {
            let size = winding
                .field(winding.outer_radius_m, at[2])
                .unwrap()
                .gradient_norm();
            let values = pairs.iter().skip(k).step_by(points.len());
            let worst = values.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(
                worst < tolerance * size,
                "{at:?} {tolerance:e}: {:e}",
                worst / size
            );
        }
    }
}

/// Every drive had dipoles of its own about every core: 225 coils took gigabytes, and minutes for a
/// map.
#[test]
fn few_patterns_and_fewer_far_dipoles_stand_for_many_cores() {
    let winding = Winding {
        inner_radius_m: 0.0026,
        outer_radius_m: 0.0045,
        length_m: 0.04,
        turns: 800.0,
    };
    let shape = CoreShape {
        radius_m: 0.0025,
        bottom_m: -0.045,
        top_m: 0.0,
    };
    let positions_m: Vec<[f64; 2]> = (0..42)
        .map(|i| [0.0097 * f64::from(i % 7), 0.0103 * f64::from(i / 7)])
        .collect();
    let (lowest_m, tolerance) = (0.0083, 1e-3);
    let array = CoupledArray::new(&winding, shape, 470.0, &positions_m, 1e-3, lowest_m).unwrap();
    let every: Vec<usize> = (0..positions_m.len()).collect();
    let few =
        ArraySources::for_many_points(&array, Clearance::above(lowest_m, lowest_m), tolerance);
    // Dipoles of their own had 1300 numbers for a core and drive.
    assert!(
        few.size() < 100 * positions_m.len().pow(2),
        "{}",
        few.size()
    );
    let points: Vec<[f64; 3]> = (0..70)
        .map(|k| {
            let part = |step: f64| (0.5 + step * f64::from(k)).fract();
            let (x, y) = (part(0.754_877_666), part(0.569_840_291));
            let z_m = lowest_m * [1.0, 1.0, 1.7, 4.1][k as usize % 4];
            [0.08 * x - 0.01, 0.07 * y - 0.01, z_m]
        })
        .collect();
    let parts = Components::All;
    let mut values = vec![0.0; every.len() * parts.count() * points.len()];
    few.sample_all(&points, parts, &mut values);
    let drives = [0, 24, 38];
    // Three drives have dipoles of their own, and one core's do for all places.
    let near = (Clearance::above(lowest_m, lowest_m), 1e-6);
    let mut sure = vec![0.0; drives.len() * parts.count() * points.len()];
    ArraySources::of_drives(&array, &drives, near, false).sample(&points, parts, &mut sure);
    let block = parts.count() * points.len();
    for (drive, sure) in drives.iter().zip(sure.chunks_exact(block)) {
        let values = &values[drive * block..(drive + 1) * block];
        for (k, at) in points.iter().enumerate() {
            let field = winding.field(winding.outer_radius_m, at[2]).unwrap();
            for part in 0..parts.count() {
                let size = if part < 5 {
                    field.gradient_norm()
                } else {
                    field.b_r.hypot(field.b_z)
                };
                let off = (values[part * points.len() + k] - sure[part * points.len() + k]).abs();
                assert!(
                    off < tolerance * size,
                    "{drive} {at:?} {part}: {:e}",
                    off / size
                );
            }
        }
    }
    // The field at a place does not depend on the other places.
    let mut alone = vec![0.0; every.len() * parts.count()];
    few.sample_all(&points[7..8], parts, &mut alone);
    for (column, alone) in alone.iter().enumerate() {
        assert_eq!(alone.to_bits(), values[column * points.len() + 7].to_bits());
    }
    // Together at currents.
    let currents_a: Vec<f64> = every.iter().map(|i| (1.3 * *i as f64).sin()).collect();
    let mut together = vec![0.0; block];
    few.at_currents(&currents_a)
        .sample(&points, parts, &mut together);
    for (row, together) in together.iter().enumerate() {
        let sum: f64 = (values.chunks_exact(block).zip(&currents_a))
            .map(|(values, current)| current * values[row])
            .sum();
        let size = values.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!((together - sum).abs() < 1e-10 * size, "{together} {sum}");
    }
}

/// Where rings are closer together than the outline's nodes, those between two nodes had no part of the tolerance to hold,
/// and a handful of dipoles each: thousands of T/m/A within a millimetre of the seed's cores.
#[test]
fn regression_dipoles_between_the_nodes_of_an_outline_were_too_few() {
    let (winding, shape) = seed();
    // So far apart that each answers to its own winding alone.
    let positions_m = [[0.0, 0.0], [3.0, 0.0]];
    let tolerance = 1e-4;
    let array = CoupledArray::new(&winding, shape, 1000.0, &positions_m, tolerance, 3e-4).unwrap();
    let layer = array.layers(0, 0).column(0).iter().copied().collect();
    let alone = MagnetizedCore::new(array.response.outline.clone(), layer);
    for distance_m in [3e-4, 9e-4] {
        let sources = [
            ArraySources::of_array(&array, Clearance::above(distance_m, distance_m), tolerance),
            ArraySources::for_many_points(
                &array,
                Clearance::above(distance_m, distance_m),
                tolerance,
            ),
        ];
        let size = winding.field(winding.outer_radius_m, distance_m).unwrap();
        for k in 0..24 {
            let (r_m, (s, c)) = (5e-4 * f64::from(k), (2.399_963 * f64::from(k)).sin_cos());
            let known = alone.field(r_m, distance_m);
            for sources in &sources {
                let mut out = vec![0.0; 2 * Components::All.count()];
                let point_m = [r_m * c, r_m * s, distance_m];
                sources.sample(&[point_m], Components::All, &mut out);
                let [gradient, field] = [out[4] - known.dbz_dz, out[7] - known.b_z];
                let gradient = gradient.abs() / size.gradient_norm();
                let off = gradient.max(field.abs() / size.b_r.hypot(size.b_z));
                assert!(
                    off < tolerance,
                    "{distance_m} {r_m}: {off:e} {known:?} {out:?}"
                );
            }
        }
    }
}

/// A core that stands out of its winding, and one beside it.
fn raised() -> (Winding, CoreShape, [[f64; 2]; 2]) {
    let winding = Winding {
        inner_radius_m: 0.0063,
        outer_radius_m: 0.011,
        length_m: 0.017,
        turns: 310.0,
    };
    let shape = CoreShape {
        radius_m: 0.0058,
        bottom_m: -0.019,
        top_m: 0.0071,
    };
    (winding, shape, [[0.0, 0.0], [0.026, 0.0]])
}

/// Gradients of both drives at some places beside the first core at a height, [place, drive and component].
fn beside(sources: &ArraySources, radius_m: f64, z_m: f64) -> Vec<f64> {
    let points: Vec<[f64; 3]> = (0..9)
        .map(|k| {
            let (s, c) = (0.7 * f64::from(k)).sin_cos();
            [radius_m * c, radius_m * s, z_m]
        })
        .collect();
    let mut out = vec![0.0; 2 * Components::Gradient.count() * points.len()];
    sources.sample(&points, Components::Gradient, &mut out);
    out
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, value| most.max(value.abs()))
}

#[test]
fn dipoles_for_a_range_of_heights_give_there_what_those_for_all_heights_do() {
    let (winding, shape, positions_m) = raised();
    let array = CoupledArray::new(&winding, shape, 700.0, &positions_m, 1e-3, 0.009).unwrap();
    let tolerance = 1e-5;
    for (z_m, distance_m) in [(0.0037, 3e-4), (0.0002, 2e-3), (-0.0103, 4e-4)] {
        let all = Clearance::above(f64::NEG_INFINITY, distance_m);
        let some = Clearance {
            lowest_m: z_m - 5e-4,
            highest_m: z_m + 5e-4,
            distance_m,
        };
        let radius_m = shape.radius_m + 1.001 * distance_m;
        let of = |sources: &ArraySources| beside(sources, radius_m, z_m);
        let known = of(&ArraySources::of_array(&array, all, 0.01 * tolerance));
        let size = largest(known.iter().copied());
        for sources in [
            ArraySources::of_array(&array, some, tolerance),
            ArraySources::for_many_points(&array, some, tolerance),
        ] {
            let off = largest(of(&sources).iter().zip(&known).map(|(a, b)| a - b)) / size;
            assert!(off < tolerance, "{z_m} {distance_m}: {off:e}");
        }
    }
}

/// Above the cores alone two resolutions agreed while the waves about the shafts were too few.
#[test]
fn regression_no_error_was_estimated_beside_the_shafts_of_coupled_cores() {
    let (winding, shape, positions_m) = raised();
    let (lowest_m, distance_m) = (0.0031, 0.03 * shape.radius_m);
    let solved = |tolerance: f64| {
        CoupledArray::new(&winding, shape, 700.0, &positions_m, tolerance, lowest_m).unwrap()
    };
    let clearance = Clearance {
        lowest_m,
        highest_m: lowest_m,
        distance_m,
    };
    let of = |array: &CoupledArray| {
        let sources = ArraySources::of_array(array, clearance, 1e-7);
        beside(&sources, shape.radius_m + distance_m, lowest_m)
    };
    let (array, truth) = (solved(1e-3), of(&solved(1e-5)));
    let off = |array: &CoupledArray| {
        let off = largest(of(array).iter().zip(&truth).map(|(a, b)| a - b));
        off / largest(truth.iter().copied())
    };
    let stated = array.relative_error;
    let found = off(&array);
    assert!(
        found < stated && stated < 1e-3,
        "{found:e}, {stated:e} stated"
    );
    // A solution that depends on no places states by itself what it is above the array.
    let anywhere = ArrayRequest {
        winding: &winding,
        shape,
        relative_permeability: 700.0,
        positions_m: &positions_m,
        tolerance: 1e-3,
        lowest_m: f64::NEG_INFINITY,
    };
    let array = anywhere.solve(&NoCache).unwrap();
    let stated = anywhere.error_at(&array, &[clearance]).unwrap();
    let found = off(&array);
    assert!(
        array.relative_error < found && found < stated,
        "{found:e}, {stated:e} stated"
    );
    let above = Clearance::above(0.01, 0.003);
    let far = anywhere.error_at(&array, &[above]).unwrap();
    assert_eq!(far.to_bits(), array.relative_error.to_bits());
}

/// Over cores that end below the windings' tops two resolutions were compared above the windings alone.
#[test]
fn regression_no_error_was_estimated_in_the_bores_over_low_cores() {
    let (winding, raised, positions_m) = raised();
    let shape = CoreShape {
        top_m: -0.0075,
        ..raised
    };
    let distance_m = 0.07 * shape.radius_m;
    let z_m = shape.top_m + distance_m;
    let clearance = Clearance {
        lowest_m: z_m,
        highest_m: z_m,
        distance_m,
    };
    let request = |tolerance: f64| ArrayRequest {
        winding: &winding,
        shape,
        relative_permeability: 120.0,
        positions_m: &positions_m,
        tolerance,
        lowest_m: f64::NEG_INFINITY,
    };
    let of = |array: &CoupledArray| {
        let sources = ArraySources::of_array(array, clearance, 1e-8);
        beside(&sources, 0.77 * shape.radius_m, z_m)
    };
    let truth = of(&request(1e-6).solve(&NoCache).unwrap());
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let array = request(tolerance).solve(&NoCache).unwrap();
        let stated = request(tolerance).error_at(&array, &[clearance]).unwrap();
        let off = largest(of(&array).iter().zip(&truth).map(|(a, b)| a - b));
        let found = off / largest(truth.iter().copied());
        assert!(found < stated, "{tolerance}: {found:e}, {stated:e} stated");
        assert!(stated < 2.0 * tolerance, "{tolerance}: {stated:e}");
    }
}
