//! Flux density inside linear cores against brute force, limits and symmetries.

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::array::{ArrayResolution, CoupledArray};
use fluxform_field::steel::core_flux_density::{CoreField, Inspection, peak_depth_m};
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::generatrix::Face;
use fluxform_field::winding::{AxialField, Winding};
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;
use std::f64::consts::{PI, TAU};

const WINDING: Winding = Winding {
    inner_radius_m: 0.013,
    outer_radius_m: 0.021,
    length_m: 0.06,
    turns: 1300.0,
};
const SHAPE: CoreShape = CoreShape {
    radius_m: 0.0127,
    bottom_m: -0.071,
    top_m: 0.003,
};

fn coil(shape: CoreShape, relative_permeability: f64, tolerance: f64) -> CoredCoil {
    let lowest_m = shape.top_m.max(0.0) + 0.5 * shape.radius_m;
    CoredCoil::new(&WINDING, shape, relative_permeability, tolerance, lowest_m)
        .expect("no node lies on the winding's edge")
}

fn array(relative_permeability: f64, tolerance: f64, positions_m: &[[f64; 2]]) -> CoupledArray {
    let closest_m = positions_m
        .iter()
        .enumerate()
        .flat_map(|(i, a)| {
            positions_m[..i]
                .iter()
                .map(move |b| (a[0] - b[0]).hypot(a[1] - b[1]))
        })
        .fold(f64::INFINITY, f64::min);
    let resolution = ArrayResolution::for_tolerance(tolerance, SHAPE, closest_m);
    CoupledArray::at_resolution(
        &WINDING,
        SHAPE,
        relative_permeability,
        positions_m,
        &resolution,
    )
    .expect("no node lies on the winding's edge")
}

fn size(field: &AxialField) -> f64 {
    field.b_r.hypot(field.b_z)
}

fn assert_close(found: f64, expected: f64, relative: f64, what: &str) {
    assert!(
        (found - expected).abs() <= relative * expected.abs(),
        "{what}: {found} against {expected}, {:e}",
        found / expected - 1.0
    );
}

/// Mean of |B| per ampere by the surface currents, on panels graded to all edges.
fn mean_by_brute_force(coil: &CoredCoil) -> f64 {
    let shape = coil.core.outline().shape;
    let inside = |z: &f64| *z > shape.bottom_m && *z < shape.top_m;
    let edges = [
        shape.bottom_m,
        shape.top_m,
        0.0,
        -WINDING.length_m,
        0.5 * (shape.bottom_m + shape.top_m),
    ];
    let mut heights: Vec<f64> = edges
        .iter()
        .flat_map(|z| (0..12).map(move |k| (z, k)))
        .map(|(z, k)| {
            z + shape.radius_m * if k % 2 == 0 { 0.9 } else { -0.9 } * 0.3_f64.powi(k / 2)
        })
        .chain(edges)
        .filter(|z| inside(z) || *z == shape.bottom_m || *z == shape.top_m)
        .collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let mut radii: Vec<f64> = (0..6)
        .map(|k| shape.radius_m * (1.0 - 0.3_f64.powi(k)))
        .collect();
    radii.push(shape.radius_m);
    let nodes = |cuts: &[f64]| -> Vec<(f64, f64)> {
        let rule = gauss::rule(5);
        let pairs = cuts
            .windows(2)
            .map(|p| (0.5 * (p[1] - p[0]), 0.5 * (p[1] + p[0])));
        pairs
            .flat_map(|(half, middle)| {
                let on = rule.nodes.iter().zip(&rule.weights);
                on.map(move |(x, w)| (middle + half * x, half * w))
            })
            .collect()
    };
    let mut sum = 0.0;
    for (r_m, across) in nodes(&radii) {
        for (z_m, along) in nodes(&heights) {
            let field = coil.field(r_m, z_m).expect("inside the core");
            sum += r_m * across * along * size(&field);
        }
    }
    sum / (0.5 * shape.radius_m.powi(2) * shape.length_m())
}

/// Largest |B| per ampere at points throughout the core, none closer to its surface than `depth_m`.
fn peak_by_brute_force(coil: &CoredCoil, depth_m: f64) -> f64 {
    let shape = coil.core.outline().shape;
    let count = 120;
    let mut largest = 0.0_f64;
    for i in 0..=count {
        // Denser towards both ends.
        let t = 0.5 * (1.0 - (PI * f64::from(i) / f64::from(count)).cos());
        let z_m = shape.bottom_m + depth_m + t * (shape.length_m() - 2.0 * depth_m);
        for across in [0.0, 0.6, 0.9, 1.0] {
            let r_m = across * (shape.radius_m - depth_m);
            largest = largest.max(size(&coil.field(r_m, z_m).expect("inside the core")));
        }
        let r_m = t * (shape.radius_m - depth_m);
        for z_m in [shape.bottom_m + depth_m, shape.top_m - depth_m] {
            largest = largest.max(size(&coil.field(r_m, z_m).expect("inside the core")));
        }
    }
    largest
}

#[test]
fn one_core_agrees_with_brute_force_within_its_estimate() {
    let low = CoreShape {
        radius_m: 0.011,
        bottom_m: -0.02,
        top_m: -0.006,
    };
    for (shape, relative_permeability) in [(SHAPE, 1000.0), (SHAPE, 1.7), (low, 80.0)] {
        let fine = coil(shape, relative_permeability, 1e-7);
        let depth_m = peak_depth_m(shape);
        let mean = mean_by_brute_force(&fine);
        let peak = peak_by_brute_force(&fine, depth_m);
        for tolerance in [1e-2, 1e-4] {
            let found = coil(shape, relative_permeability, tolerance)
                .core_field(1.3, depth_m)
                .expect("inside the core");
            let what = format!("{relative_permeability} {tolerance} {found:?}");
            // The scan misses the peak by what its steps allow.
            let allowed = found.relative_error() + 1e-4;
            assert_close(found.peak_t, 1.3 * peak, allowed, &what);
            assert_close(found.mean_t, 1.3 * mean, allowed, &what);
            let [r_m, y_m, z_m] = found.peak_at_m;
            assert_eq!(y_m, 0.0);
            let there = 1.3 * size(&fine.field(r_m, z_m).expect("inside the core"));
            assert_close(found.peak_t, there, found.relative_error(), &what);
            if tolerance < 1e-3 {
                assert!(found.relative_error() < 1e-3, "{what}");
            }
        }
    }
}

#[test]
fn the_estimate_falls_with_the_tolerance_and_the_error_with_it() {
    let depth_m = peak_depth_m(SHAPE);
    let at = |tolerance| {
        coil(SHAPE, 300.0, tolerance)
            .core_field(0.7, depth_m)
            .expect("inside")
    };
    let truth = at(1e-8);
    let [rough, fine] = [at(1e-2), at(1e-5)];
    assert!(
        fine.relative_error() < 0.05 * rough.relative_error(),
        "{rough:?} {fine:?}"
    );
    assert_close(fine.peak_t, truth.peak_t, 2e-5, "peak");
    assert_close(fine.mean_t, truth.mean_t, 2e-5, "mean");
}

#[test]
fn without_steel_it_is_the_windings_own_field() {
    let depth_m = peak_depth_m(SHAPE);
    let near = |relative_permeability| {
        coil(SHAPE, relative_permeability, 1e-4)
            .core_field(-0.7, depth_m)
            .expect("inside the core")
    };
    let found = near(1.0);
    let [r_m, _, z_m] = found.peak_at_m;
    let winding = 0.7 * size(&WINDING.field(r_m, z_m).expect("inside the bore"));
    assert_close(found.peak_t, winding, 1e-6, "peak");
    let mean = 0.7 * mean_by_brute_force(&coil(SHAPE, 1.0, 1e-4));
    assert_close(found.mean_t, mean, found.relative_error() + 1e-5, "mean");
    // To first order in chi the mean grows by no more than chi.
    let close = near(1.0 + 1e-7);
    assert_close(close.peak_t, found.peak_t, 2e-7, "close to 1");
    assert!(close.peak_t != found.peak_t);
}

#[test]
fn deeper_is_lower_and_no_depth_is_too_deep() {
    let coil = coil(SHAPE, 500.0, 1e-4);
    let peaks: Vec<f64> = [0.3e-3, 1e-3, 3e-3, 0.3, f64::INFINITY]
        .iter()
        .map(|depth_m| coil.core_field(2.0, *depth_m).expect("inside").peak_t)
        .collect();
    assert!(peaks[0] >= peaks[1] && peaks[1] >= peaks[2], "{peaks:?}");
    assert!(peaks[2] >= peaks[3] && peaks[3] == peaks[4], "{peaks:?}");
    let thin = CoreShape {
        radius_m: 0.012,
        bottom_m: -0.0013,
        top_m: -0.0011,
    };
    assert_close(peak_depth_m(thin), 0.25 * 0.2e-3, 1e-9, "disc");
    assert_close(peak_depth_m(SHAPE), 1e-3, 1e-12, "rod");
    assert_close(
        peak_depth_m(CoreShape {
            radius_m: 0.005,
            ..SHAPE
        }),
        0.5e-3,
        1e-12,
        "thin rod",
    );
}

#[test]
fn no_current_is_no_field() {
    let coil = coil(SHAPE, 500.0, 1e-3);
    let field = coil.core_field(0.0, 1e-3).expect("inside the core");
    assert_eq!((field.peak_t, field.mean_t), (0.0, 0.0));
    assert!(field.relative_error() < 1e-3, "{field:?}");
}

#[test]
fn an_array_of_one_is_the_coil() {
    let single = coil(SHAPE, 700.0, 1e-5)
        .core_field(1.3, 1e-3)
        .expect("inside");
    let of_one = array(700.0, 1e-5, &[[0.2, -0.3]])
        .core_fields(&[1.3], 1e-3)
        .expect("inside");
    assert_eq!(of_one.len(), 1);
    assert_close(of_one[0].peak_t, single.peak_t, 1e-5, "peak");
    assert_close(of_one[0].mean_t, single.mean_t, 1e-5, "mean");
    let [x_m, y_m, z_m] = of_one[0].peak_at_m;
    let r_m = (x_m - 0.2).hypot(y_m + 0.3);
    assert!((r_m - single.peak_at_m[0]).abs() < 1e-9, "{of_one:?}");
    assert!(
        (z_m - single.peak_at_m[2]).abs() < 2e-4,
        "{of_one:?} {single:?}"
    );
}

#[test]
fn coils_far_apart_are_alone() {
    let alone = coil(SHAPE, 700.0, 1e-4)
        .core_field(1.0, 1e-3)
        .expect("inside");
    let both = array(700.0, 1e-4, &[[0.0, 0.0], [1.1, 1.3]])
        .core_fields(&[1.3, -0.7], 1e-3)
        .expect("inside");
    for (found, current_a) in both.iter().zip([1.3, 0.7]) {
        // (R/d)^3 times what a rod gains along its length.
        assert_close(found.peak_t, current_a * alone.peak_t, 2e-3, "peak");
        assert_close(found.mean_t, current_a * alone.mean_t, 2e-3, "mean");
    }
}

#[test]
fn a_square_of_nine_is_symmetric_and_scales() {
    let positions: Vec<[f64; 2]> = (0..9)
        .map(|i| {
            [
                0.05 * (f64::from(i % 3) - 1.0),
                0.05 * (f64::from(i / 3) - 1.0),
            ]
        })
        .collect();
    let array = array(1000.0, 1e-3, &positions);
    let fields = array.core_fields(&[1.3; 9], 1e-3).expect("inside");
    for set in [[0, 2, 6, 8], [1, 3, 5, 7]] {
        for core in set {
            let first: &CoreField = &fields[set[0]];
            assert_close(fields[core].peak_t, first.peak_t, 1e-5, "peak");
            assert_close(fields[core].mean_t, first.mean_t, 1e-5, "mean");
            assert!(fields[core].relative_error() < 3e-3, "{fields:?}");
        }
    }
    // Like poles side by side drive each other's flux back: the centre has least.
    assert!(fields[4].mean_t < fields[1].mean_t && fields[1].mean_t < fields[0].mean_t);
    let more = array.core_fields(&[-2.6; 9], 1e-3).expect("inside");
    for (a, b) in more.iter().zip(&fields) {
        assert_close(a.peak_t, 2.0 * b.peak_t, 1e-12, "peak");
        assert_close(a.mean_t, 2.0 * b.mean_t, 1e-12, "mean");
        assert_close(a.relative_error(), b.relative_error(), 1e-6, "estimate");
    }
}

/// B of windings and double layers at a point, T, by sums over every core's azimuth.
fn field_by_brute_force(array: &CoupledArray, currents_a: &[f64], at_m: [f64; 3]) -> [f64; 3] {
    let outline = &array.response.outline;
    let basis = Basis::new(gauss::rule(outline.order));
    let mut shares = vec![0.0; outline.order];
    let mut sum = [0.0; 3];
    for (core, position_m) in array.positions_m.iter().enumerate() {
        let x = [at_m[0] - position_m[0], at_m[1] - position_m[1], at_m[2]];
        let r_m = x[0].hypot(x[1]);
        let own = array.winding.field(r_m, x[2]).expect("off the edges");
        sum[0] += currents_a[core] * own.b_r * x[0] / r_m;
        sum[1] += currents_a[core] * own.b_r * x[1] / r_m;
        sum[2] += currents_a[core] * own.b_z;
        let layers = currents_a
            .iter()
            .enumerate()
            .map(|(drive, current)| array.layers(drive, core) * *current)
            .reduce(|a, b| a + b)
            .expect("at least one coil");
        let count = 360;
        for (index, panel) in outline.panels.iter().enumerate() {
            // Short pieces, none of them near the point for its length.
            let (lo, hi) = panel.range_m();
            let foot = if panel.face == Face::Side { x[2] } else { r_m };
            gauss::graded(lo - foot, hi - foot, 2e-3, 1e-9, |offset, weight| {
                let coordinate = foot + offset;
                let place = 2.0 * (coordinate - panel.from_m) / (panel.to_m - panel.from_m) - 1.0;
                basis.weights(place, &mut shares);
                let modes: Vec<f64> = layers
                    .column_iter()
                    .map(|c| {
                        (0..outline.order)
                            .map(|i| shares[i] * c[index * outline.order + i])
                            .sum()
                    })
                    .collect();
                let (source_r, source_z, normal) = outline.shape.on(panel.face, coordinate);
                for k in 0..count {
                    let angle = TAU * f64::from(k) / f64::from(count);
                    let (s, c) = angle.sin_cos();
                    let mut density = modes[0];
                    for (mode, pair) in modes[1..].chunks(2).enumerate() {
                        let (s, c) = ((mode + 1) as f64 * angle).sin_cos();
                        density += c * pair[0] + s * pair[1];
                    }
                    let n = [normal[0] * c, normal[0] * s, normal[1]];
                    let d = [x[0] - source_r * c, x[1] - source_r * s, x[2] - source_z];
                    let square: f64 = d.iter().map(|d| d * d).sum();
                    let along: f64 = n.iter().zip(&d).map(|(a, b)| a * b).sum();
                    let area = source_r * weight * TAU / f64::from(count);
                    let strength =
                        MU_0_T_M_PER_A * density * area / (4.0 * PI * square * square.sqrt());
                    for i in 0..3 {
                        sum[i] += strength * (n[i] - 3.0 * along * d[i] / square);
                    }
                }
            });
        }
    }
    sum
}

/// All modes, windings and layers of all cores; at the peak and around it.
#[test]
fn coupled_cores_have_the_field_of_all_layers_and_windings() {
    let positions = [[0.0, 0.0], [0.043, 0.011], [-0.01, 0.047]];
    let currents = [1.3, -0.7, 0.4];
    let depth_m = 2.5e-3;
    for relative_permeability in [900.0, 3.0, 1.0] {
        let array = array(relative_permeability, 1e-4, &positions);
        let fields = array.core_fields(&currents, depth_m).expect("inside");
        let inspection = Inspection::new(&array, depth_m).expect("inside");
        let peaks_t = inspection.peaks_t(&array, &currents).expect("inside");
        for (field, peak_t) in fields.iter().zip(peaks_t) {
            assert_close(peak_t, field.peak_t, 1e-12, "peaks alone");
        }
        for (core, found) in fields.iter().enumerate() {
            let strength = |at_m: [f64; 3]| {
                let [x, y, z] = field_by_brute_force(&array, &currents, at_m);
                x.hypot(y).hypot(z)
            };
            let what = format!("mu_r {relative_permeability}, core {core}: {found:?}");
            assert!(found.relative_error() < 3e-3, "{what}");
            assert_close(found.peak_t, strength(found.peak_at_m), 2e-4, &what);
            let [x_m, y_m, z_m] = found.peak_at_m;
            let (dx, dy) = (x_m - positions[core][0], y_m - positions[core][1]);
            let r_m = dx.hypot(dy);
            assert!(r_m <= SHAPE.radius_m - depth_m + 1e-12, "{what}");
            let angle = dy.atan2(dx);
            for (turn, rise) in [
                (0.4, 0.0),
                (-0.5, 0.0),
                (1.7, 0.0),
                (0.0, 4e-3),
                (0.0, -5e-3),
            ] {
                let (s, c) = (angle + turn).sin_cos();
                let at = [
                    positions[core][0] + r_m * c,
                    positions[core][1] + r_m * s,
                    z_m + rise,
                ];
                assert!(strength(at) <= found.peak_t * (1.0 + 3e-4), "{what} {at:?}");
            }
        }
    }
}
