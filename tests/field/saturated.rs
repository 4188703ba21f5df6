//! Coils and arrays whose steel saturates: limits, symmetries, energy, finite elements.

// Some tests print the figures that the documentation quotes.
#![allow(clippy::print_stdout)]

use fluxform_coil::inductance::self_inductance_h;
use fluxform_field::components::Components;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::array::{ArrayResolution, CoupledArray, closest_m};
use fluxform_field::steel::bh_curve::BhCurve;
use fluxform_field::steel::clearance::Clearance;
use fluxform_field::steel::cored_coil::Excitation;
use fluxform_field::steel::equivalent_dipoles::ArraySources;
use fluxform_field::steel::generatrix::{Generatrix, Resolution};
use fluxform_field::steel::magnetized::MagnetizedCore;
use fluxform_field::steel::permeability::{Constant, Permeability};
use fluxform_field::steel::saturated::{Convergence, CoreField, SaturatedCore};
use fluxform_field::steel::saturated_array::{SaturatedArray, SaturatedArrayError};
use fluxform_field::winding::Winding;
use nalgebra::DMatrix;

const WINDING: Winding = Winding {
    inner_radius_m: 0.012,
    outer_radius_m: 0.019,
    length_m: 0.1,
    turns: 1429.0,
};
const SHAPE: CoreShape = CoreShape {
    radius_m: 0.012,
    bottom_m: -0.11,
    top_m: 0.0,
};
const PITCH_M: f64 = 0.05;
const LOWEST_M: f64 = 0.03;
/// Three coils without symmetry.
const SCATTER: [[f64; 2]; 3] = [[0.0, 0.0], [0.043, 0.007], [-0.021, 0.047]];
/// Currents that saturate two cores of three, with both signs.
const MIXED_A: [f64; 3] = [7.3, -8.9, 2.1];

/// The committed table of a low-carbon steel.
fn steel() -> BhCurve {
    let text = include_str!("../../designs/steel_1010.csv");
    let (b_t, h): (Vec<f64>, Vec<f64>) = text
        .lines()
        .skip(1)
        .map(|line| {
            let (b, h) = line.split_once(',').expect("two columns");
            let number = |text: &str| text.trim().parse::<f64>().expect("a number");
            (number(b), number(h))
        })
        .unzip();
    BhCurve::new(&b_t, &h).expect("a good curve")
}

fn grid(columns: usize, rows: usize) -> Vec<[f64; 2]> {
    (0..columns * rows)
        .map(|i| {
            let (x, y) = (i % columns, i / columns);
            [
                PITCH_M * (x as f64 - 0.5 * (columns - 1) as f64),
                PITCH_M * (y as f64 - 0.5 * (rows - 1) as f64),
            ]
        })
        .collect()
}

fn resolution(tolerance: f64, positions_m: &[[f64; 2]]) -> ArrayResolution {
    ArrayResolution::for_tolerance(tolerance, SHAPE, closest_m(positions_m))
}

fn solve_at(
    law: &dyn Permeability,
    positions_m: &[[f64; 2]],
    currents_a: &[f64],
    resolution: &ArrayResolution,
) -> SaturatedArray {
    let reference = law.response(0.0).relative;
    let found = SaturatedArray::at_resolution(
        &WINDING,
        SHAPE,
        law,
        positions_m,
        currents_a,
        reference,
        resolution,
    )
    .expect("a good design");
    assert_eq!(found.status, Convergence::Converged, "{:?}", found.steps);
    found
}

fn solve(
    law: &dyn Permeability,
    positions_m: &[[f64; 2]],
    currents_a: &[f64],
    tolerance: f64,
) -> SaturatedArray {
    let resolution = resolution(tolerance, positions_m);
    solve_at(law, positions_m, currents_a, &resolution)
}

/// dB_z/dz of the steel at points, T/m.
fn slopes(sources: &ArraySources, points: &[[f64; 3]], currents_a: &[f64]) -> Vec<f64> {
    let mut values = vec![0.0; sources.drives() * points.len()];
    sources.sample(points, Components::Gz, &mut values);
    (0..points.len())
        .map(|p| {
            (0..sources.drives())
                .map(|d| values[d * points.len() + p] * currents_a[d])
                .sum()
        })
        .collect()
}

fn of_saturated(array: &SaturatedArray, points: &[[f64; 3]]) -> Vec<f64> {
    let sources = ArraySources::of_saturated(array, Clearance::above(LOWEST_M, LOWEST_M), 1e-7);
    slopes(&sources, points, &[1.0])
}

/// Points above and between the coils.
fn points(positions_m: &[[f64; 2]]) -> Vec<[f64; 3]> {
    positions_m
        .iter()
        .flat_map(|[x, y]| {
            [[0.0, 0.0, 0.03], [0.011, -0.017, 0.04], [-0.03, 0.02, 0.07]]
                .map(|[dx, dy, z]| [x + dx, y + dy, z])
        })
        .collect()
}

/// Largest difference relative to the largest value.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let size = b.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let worst = a
        .iter()
        .zip(b)
        .fold(0.0_f64, |m, (a, b)| f64::max(m, (a - b).abs()));
    worst / size
}

/// One coil by the solver of one core: steel's slopes at points of an axis at the origin, flux of
/// the steel, |B|.
fn single(current_a: f64, points: &[[f64; 3]], outline: &Resolution) -> (Vec<f64>, f64, CoreField) {
    let law = steel();
    let generatrix = Generatrix::of_coil(&WINDING, SHAPE, outline);
    let excitation =
        Excitation::new(&WINDING, &generatrix, outline.quadrature).expect("off the edges");
    let core = SaturatedCore::new(&generatrix, outline.quadrature).expect("a good outline");
    let found = core.solve(&(&excitation.potential * current_a), &law, None);
    assert_eq!(found.status, Convergence::Converged);
    let flux_wb = core.flux_linkage_wb(&found, &excitation.potential);
    let layer = MagnetizedCore::new(generatrix, found.v_a.as_slice().to_vec());
    let slopes = points
        .iter()
        .map(|[x, y, z]| layer.field(x.hypot(*y), *z).dbz_dz)
        .collect();
    (slopes, flux_wb, core.field(&found, &law))
}

/// A law that is none: the linear array's solution, by the elements inside and not by the
/// boundary equation.
#[test]
fn a_constant_law_is_the_linear_array() {
    for (relative, tolerance) in [(730.0, 1e-3), (730.0, 1e-5), (3.7, 1e-4)] {
        let law = Constant { relative };
        let resolution = resolution(tolerance, &SCATTER);
        let ours = solve_at(&law, &SCATTER, &MIXED_A, &resolution);
        let linear = CoupledArray::at_resolution(&WINDING, SHAPE, relative, &SCATTER, &resolution)
            .expect("a good design");
        let points = points(&SCATTER);
        let sources = ArraySources::of_array(&linear, Clearance::above(LOWEST_M, LOWEST_M), 1e-7);
        let gradient = off(
            &of_saturated(&ours, &points),
            &slopes(&sources, &points, &MIXED_A),
        );
        let theirs = &linear.added_inductance_h * nalgebra::DVector::from_row_slice(&MIXED_A);
        let flux = off(&ours.flux_linkage_wb, theirs.as_slice());
        println!(
            "mu_r {relative} at {tolerance:e}: gradient off by {gradient:.1e}, flux by {flux:.1e}, {} steps",
            ours.steps.len()
        );
        assert!(gradient < tolerance && flux < tolerance);
        assert!(ours.steps.len() <= 4, "{:?}", ours.steps);
    }
}

#[test]
fn one_coil_is_the_single_coil() {
    let tolerance = 1e-4;
    let currents = [6.3];
    let positions = [[0.017, -0.023]];
    let array = solve(&steel(), &positions, &currents, tolerance);
    let resolution = resolution(tolerance, &positions);
    let here = [[0.0, 0.0, 0.03], [0.011, -0.017, 0.04], [-0.03, 0.02, 0.07]];
    let there = here.map(|[x, y, z]| [x + positions[0][0], y + positions[0][1], z]);
    let (slopes, flux_wb, field) = single(currents[0], &here, &resolution.outline);
    let gradient = off(&of_saturated(&array, &there), &slopes);
    let flux = (array.flux_linkage_wb[0] / flux_wb - 1.0).abs();
    println!("one coil: gradient off by {gradient:.1e}, flux by {flux:.1e}");
    // The two integrals of the flux differ by the discretisation.
    assert!(gradient < 1e-6 && flux < 0.3 * tolerance);
    assert!((array.fields[0].peak_b_t / field.peak_b_t - 1.0).abs() < 1e-9);
}

/// The field of one core at another falls like the inverse cube of the distance.
#[test]
fn coils_far_apart_are_single_coils() {
    let current_a = 6.3;
    let flux_wb = |positions: &[[f64; 2]]| {
        let resolution = resolution(1e-5, positions);
        solve_at(
            &steel(),
            positions,
            &vec![current_a; positions.len()],
            &resolution,
        )
        .flux_linkage_wb[0]
    };
    let alone = flux_wb(&[[0.0, 0.0]]);
    let gain = |distance_m: f64| flux_wb(&[[0.0, 0.0], [0.0, distance_m]]) / alone - 1.0;
    let (near, far) = (gain(0.7), gain(1.4));
    println!("flux of one of two coils against one alone: {near:.3e} at 0.7 m, {far:.3e} at 1.4 m");
    assert!(near < 0.0 && near > -3e-3);
    assert!((near / far / 8.0 - 1.0).abs() < 0.1, "{near:e} {far:e}");
}

#[test]
fn an_array_has_the_symmetry_of_its_currents() {
    let positions = grid(3, 3);
    let even = vec![6.0; 9];
    // Currents that differ in the last digits: no core is taken from another by symmetry.
    let uneven: Vec<f64> = (0..9).map(|i| 6.0 * (1.0 + 1e-12 * i as f64)).collect();
    let first = solve(&steel(), &positions, &even, 1e-3);
    let second = solve(&steel(), &positions, &uneven, 1e-3);
    let by_symmetry = off(&first.flux_linkage_wb, &second.flux_linkage_wb);
    println!("3 x 3 with and without symmetry: flux off by {by_symmetry:.1e}");
    assert!(by_symmetry < 1e-6);
    for solved in [&first, &second] {
        let flux = &solved.flux_linkage_wb;
        for class in [[0, 2, 6, 8], [1, 3, 5, 7]] {
            for coil in class {
                assert!((flux[coil] / flux[class[0]] - 1.0).abs() < 1e-6);
                let peak = solved.fields[coil].peak_b_t / solved.fields[class[0]].peak_b_t;
                assert!((peak - 1.0).abs() < 1e-6);
            }
        }
    }
    let (x, y, z) = (0.013, 0.041, 0.037);
    let images = [
        [x, y, z],
        [-x, y, z],
        [x, -y, z],
        [y, x, z],
        [-y, x, z],
        [-y, -x, z],
    ];
    let values = of_saturated(&second, &images);
    for value in &values {
        assert!((value / values[0] - 1.0).abs() < 1e-5, "{values:?}");
    }
}

#[test]
fn turned_and_negated_arrays_are_the_same() {
    let tolerance = 1e-3;
    let first = solve(&steel(), &SCATTER, &MIXED_A, tolerance);
    let places = points(&SCATTER);
    let values = of_saturated(&first, &places);

    let negated = solve(&steel(), &SCATTER, &MIXED_A.map(|i| -i), tolerance);
    let flux: Vec<f64> = negated.flux_linkage_wb.iter().map(|f| -f).collect();
    let field: Vec<f64> = of_saturated(&negated, &places).iter().map(|g| -g).collect();
    assert!(off(&flux, &first.flux_linkage_wb) < 1e-12);
    assert!(off(&field, &values) < 1e-12);

    // By an angle that the azimuthal grid does not have, and elsewhere.
    let (s, c) = 0.7_f64.sin_cos();
    let turn = |x: f64, y: f64| [0.3 + c * x - s * y, -0.2 + s * x + c * y];
    let turned = solve(
        &steel(),
        &SCATTER.map(|[x, y]| turn(x, y)),
        &MIXED_A,
        tolerance,
    );
    let moved: Vec<[f64; 3]> = places
        .iter()
        .map(|[x, y, z]| {
            let [x, y] = turn(*x, *y);
            [x, y, *z]
        })
        .collect();
    let flux = off(&turned.flux_linkage_wb, &first.flux_linkage_wb);
    let field = off(&of_saturated(&turned, &moved), &values);
    println!("turned array: flux off by {flux:.1e}, gradient by {field:.1e}");
    assert!(flux < 0.3 * tolerance && field < tolerance);
}

#[test]
fn no_current_no_field() {
    let positions = grid(2, 1);
    let array = SaturatedArray::new(
        &WINDING,
        SHAPE,
        &steel(),
        &positions,
        &[0.0; 2],
        1e-3,
        LOWEST_M,
    )
    .expect("a good design");
    assert_eq!(array.status, Convergence::Converged);
    assert!(array.relative_error < 1e-3);
    assert!(array.flux_linkage_wb.iter().all(|flux| *flux == 0.0));
    assert!(
        of_saturated(&array, &points(&positions))
            .iter()
            .all(|g| *g == 0.0)
    );
    assert!(array.fields.iter().all(|field| field.peak_b_t == 0.0));
    // A core that no current drives, beside one that is driven, is magnetised all the same.
    let one = solve(&steel(), &positions, &[6.3, 0.0], 1e-3);
    assert!(one.fields[1].peak_b_t > 0.03 * one.fields[0].peak_b_t);
    assert!(one.flux_linkage_wb[1] < 0.0);
}

/// The table's permeability falls from the start: so must the flux per ampere, while the flux
/// grows; and at the end only the windings' part grows.
#[test]
fn flux_grows_less_than_the_current() {
    let positions = grid(2, 2);
    let mut before = (0.0, f64::INFINITY);
    let mut reference = 0.0;
    for current_a in [0.3, 1.0, 3.0, 6.0, 9.0, 13.0, 30.0, 300.0] {
        let array = solve(&steel(), &positions, &[current_a; 4], 1e-3);
        let flux_wb = array.flux_linkage_wb[0];
        let inductance_h = flux_wb / current_a;
        if reference == 0.0 {
            reference = inductance_h;
        }
        println!(
            "{current_a} A: {inductance_h:.6} H of steel, mean |B| {:.3} T, {} steps",
            array.fields[0].mean_b_t,
            array.steps.len()
        );
        assert!(flux_wb > before.0 && inductance_h < before.1);
        before = (flux_wb, inductance_h);
    }
    assert!(before.1 < 0.05 * reference);
}

/// Lossless steel has an energy, the fluxes are its coenergy's derivatives by the currents, and
/// so the matrix of their derivatives is symmetric, however unlike the cores' states are.
#[test]
fn incremental_inductances_are_symmetric() {
    let resolution = ArrayResolution {
        residual: 1e-9,
        ..resolution(1e-3, &SCATTER)
    };
    let step_a = 0.02;
    let count = SCATTER.len();
    let derivatives = |currents: [f64; 3]| {
        let mut matrix = DMatrix::zeros(count, count);
        for drive in 0..count {
            let flux_wb = |change_a: f64| {
                let mut currents = currents;
                currents[drive] += change_a;
                solve_at(&steel(), &SCATTER, &currents, &resolution).flux_linkage_wb
            };
            let (above, below) = (flux_wb(step_a), flux_wb(-step_a));
            for coil in 0..count {
                matrix[(coil, drive)] = (above[coil] - below[coil]) / (2.0 * step_a);
            }
        }
        matrix
    };
    let saturated = derivatives(MIXED_A);
    let weak = derivatives([0.03, -0.02, 0.05]);
    let mut size = 0.0_f64;
    let (mut worst, mut change) = (0.0_f64, 0.0_f64);
    for i in 0..count {
        for j in 0..i {
            size = size.max(saturated[(i, j)].abs());
            worst = worst.max((saturated[(i, j)] - saturated[(j, i)]).abs());
            change = change.max((saturated[(i, j)] / weak[(i, j)] - 1.0).abs());
        }
    }
    println!(
        "at {MIXED_A:?} A, H: {saturated:.6}at rest: {weak:.6}asymmetry {:.1e}",
        worst / size
    );
    assert!(worst < 1e-4 * size, "{worst:e} of {size:e}");
    // The cores do saturate.
    assert!(change > 0.2, "{change}");
}

/// Without the part of the modes, against a finer resolution with the same permeability of the
/// modes; with it, against one whose modes have the initial permeability.
#[test]
fn the_stated_error_bounds_the_difference_from_a_finer_solution() {
    let nine = grid(3, 3);
    let mixed = [6.0, 1.3, 8.0, -2.0, 4.4, 0.0, 7.7, -5.1, 3.0];
    type Case<'a> = (&'a [[f64; 2]], &'a [f64], f64);
    let cases: [Case; 5] = [
        (&nine, &[2.0; 9], 1e-2),
        (&nine, &mixed, 1e-2),
        (&SCATTER, &MIXED_A, 1e-2),
        (&SCATTER, &[13.0, 12.0, -14.0], 3e-3),
        (&SCATTER[..1], &[9.1], 1e-4),
    ];
    let law = steel();
    let mut ratios = Vec::new();
    for (positions, currents, tolerance) in cases {
        let array = SaturatedArray::new(
            &WINDING, SHAPE, &law, positions, currents, tolerance, LOWEST_M,
        )
        .expect("a good design");
        assert_eq!(array.status, Convergence::Converged);
        // Shorter panels: the curve's kinks cross the elements.
        let outline = Resolution {
            ratio: 0.5,
            ..Resolution::for_tolerance(0.03 * tolerance)
        };
        let resolution = ArrayResolution {
            outline,
            ..resolution(0.1 * tolerance, positions)
        };
        let [same, initial] =
            [array.reference_permeability, law.response(0.0).relative].map(|reference| {
                let finer = SaturatedArray::at_resolution(
                    &WINDING,
                    SHAPE,
                    &law,
                    positions,
                    currents,
                    reference,
                    &resolution,
                )
                .expect("a good design");
                assert_eq!(finer.status, Convergence::Converged);
                difference(&array, &finer)
            });
        let outline_error = array.relative_error - array.modes_error;
        let ratio = outline_error / same;
        println!(
            "{} coils to {tolerance:e}: outline {outline_error:.1e}, true {same:.1e}, ratio {ratio:.1}; \
             modes {:.1e} (mu_r {:.0}), all {:.1e}, true {initial:.1e}",
            positions.len(),
            array.modes_error,
            array.reference_permeability,
            array.relative_error,
        );
        assert!(outline_error <= tolerance);
        assert!(ratio > 1.0 && array.relative_error > initial);
        ratios.push(ratio);
    }
    ratios.sort_by(f64::total_cmp);
    println!(
        "median ratio of stated to true error {:.1}",
        ratios[ratios.len() / 2]
    );
}

/// Of the total gradients, relative to the largest, and of the flux; the larger.
fn difference(a: &SaturatedArray, b: &SaturatedArray) -> f64 {
    let places = points(&a.positions_m);
    let total = |array: &SaturatedArray| -> Vec<f64> {
        let air = |p: &[f64; 3]| -> f64 {
            let of_coil = |([x, y], current_a): (&[f64; 2], &f64)| {
                let field = WINDING.field((p[0] - x).hypot(p[1] - y), p[2]);
                current_a * field.expect("above").dbz_dz
            };
            array
                .positions_m
                .iter()
                .zip(&array.currents_a)
                .map(of_coil)
                .sum()
        };
        let steel = of_saturated(array, &places);
        places.iter().zip(steel).map(|(p, s)| s + air(p)).collect()
    };
    off(&total(a), &total(b)).max(off(&a.flux_linkage_wb, &b.flux_linkage_wb))
}

#[test]
fn hopeless_cases_have_a_status() {
    let positions = grid(2, 1);
    let within = |tolerance: f64, law: &BhCurve, currents: &[f64]| {
        SaturatedArray::new(
            &WINDING, SHAPE, law, &positions, currents, tolerance, LOWEST_M,
        )
    };
    let new = |law: &BhCurve, currents: &[f64]| within(1e-3, law, currents);
    let said = |name: &str, found: &SaturatedArray| {
        println!(
            "{name}: {:?}, error {:.1e} (modes {:.1e}), {} steps, flux {:.3e} Wb",
            found.status,
            found.relative_error,
            found.modes_error,
            found.steps.len(),
            found.flux_linkage_wb[0]
        );
        match found.status {
            Convergence::Converged => {
                assert!(found.relative_error.is_finite(), "{name}");
                assert!(
                    found.flux_linkage_wb.iter().all(|f| f.is_finite()),
                    "{name}"
                );
            }
            Convergence::Stalled => assert_eq!(found.relative_error, f64::INFINITY, "{name}"),
        }
    };
    let weak = new(&steel(), &[1e-9, 2e-9]).expect("a good design");
    said("1e-9 A", &weak);
    assert_eq!(weak.status, Convergence::Converged);
    let usual = new(&steel(), &[1e-3, 2e-3]).expect("a good design");
    let inductance = |array: &SaturatedArray| array.flux_linkage_wb[0] / array.currents_a[0];
    assert!((inductance(&weak) / inductance(&usual) - 1.0).abs() < 1e-3);
    said(
        "1e4 A",
        &new(&steel(), &[1e4, -1e4]).expect("a good design"),
    );
    said(
        "1e-300 A",
        &new(&steel(), &[1e-300, 0.0]).expect("a good design"),
    );
    said(
        "1e300 A",
        &new(&steel(), &[1e300, 0.0]).expect("a good design"),
    );
    said(
        "unlike",
        &new(&steel(), &[1e4, 1e-9]).expect("a good design"),
    );
    let nan = new(&steel(), &[f64::NAN, 1.0]).expect("a good design");
    said("no number", &nan);
    assert_eq!(nan.status, Convergence::Stalled);

    let table = |b: &[f64], h: &[f64]| BhCurve::new(b, h).expect("a good curve");
    // All but air; all but infinite, then saturated at once; a knee at nothing.
    let air = table(&[0.0, 1.0, 2.0], &[0.0, 7.95e5, 1.59e6]);
    said(
        "mu_r 1.001",
        &new(&air, &[6.0, 3.0]).expect("a good design"),
    );
    let sharp = table(&[0.0, 1.5, 1.6], &[0.0, 0.3, 5e4]);
    said(
        "mu_r 4e6",
        &within(0.1, &sharp, &[6.0, 3.0]).expect("a good design"),
    );
    let faint = table(&[0.0, 1e-6, 2e-6], &[0.0, 1e-3, 0.5]);
    said("2e-6 T", &new(&faint, &[6.0, 3.0]).expect("a good design"));

    let wrong = new(&steel(), &[1.0]);
    assert_eq!(
        wrong.expect_err("one current for two coils"),
        SaturatedArrayError::Currents {
            currents: 1,
            coils: 2
        }
    );
}

/// Thin windings: 1 mm of air between the cores.
#[test]
fn a_gap_of_one_millimetre_is_solved_to_a_stated_error() {
    let winding = Winding {
        inner_radius_m: 0.005,
        outer_radius_m: 0.0055,
        length_m: 0.02,
        turns: 200.0,
    };
    let shape = CoreShape {
        radius_m: 0.005,
        bottom_m: -0.02,
        top_m: 0.0,
    };
    let law = steel();
    let new = |positions: &[[f64; 2]], currents: &[f64]| {
        let lowest_m = 0.01;
        let array = SaturatedArray::new(&winding, shape, &law, positions, currents, 1e-2, lowest_m)
            .expect("a good design");
        println!(
            "gap 1 mm: {:?}, error {:.1e} (modes {:.1e}), mean |B| {:.2} T, steps {:?}",
            array.status,
            array.relative_error,
            array.modes_error,
            array.fields[0].mean_b_t,
            array.steps,
        );
        assert_eq!(array.status, Convergence::Converged);
        assert!(array.relative_error < 0.2);
        array
    };
    // Of opposite signs the two close each other's circuit.
    let positions = [[0.0, 0.0], [0.011, 0.0]];
    let flux_wb = new(&positions, &[9.0, -9.0]).flux_linkage_wb[0];
    let alone_wb = new(&positions[..1], &[9.0]).flux_linkage_wb[0];
    assert!(flux_wb > 1.1 * alone_wb, "{flux_wb:e} {alone_wb:e}");
}

/// Gradient on the axis, flux linkage and |B| in the core, to the errors that the finite
/// elements state and those of an outline for 1e-6.
#[test]
fn finite_elements_agree_on_one_saturating_coil() {
    let text = include_str!("../oracles/steel/nonlinear_coil.json");
    let oracle: serde_json::Value = serde_json::from_str(text).expect("JSON");
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        let of = |v: &serde_json::Value| v.as_f64().expect("a number");
        value
            .as_array()
            .map_or_else(|| vec![of(value)], |all| all.iter().map(of).collect())
    };
    let heights: Vec<[f64; 3]> = numbers(&oracle["heights_mm"])
        .iter()
        .map(|z| [0.0, 0.0, 1e-3 * z])
        .collect();
    let cases = oracle["cases"].as_array().expect("cases");
    assert_eq!(cases.len(), 3);
    for case in cases {
        let current_a = numbers(&case["current_a"])[0];
        let (steel, flux_wb, field) = single(current_a, &heights, &Resolution::for_tolerance(1e-6));
        let air = |p: &[f64; 3]| current_a * WINDING.field(0.0, p[2]).expect("above").dbz_dz;
        let slopes: Vec<f64> = heights
            .iter()
            .zip(&steel)
            .map(|(p, s)| s + air(p))
            .collect();
        // Above the knee the elements inside converge slower.
        let knee = if current_a > 5.0 { 40.0 } else { 1.0 };
        let flux_wb = flux_wb + current_a * self_inductance_h(&WINDING);
        for (key, ours, allowed) in [
            ("dbz_dz_t_per_m", slopes, 2e-6 * knee),
            ("flux_linkage_wb", vec![flux_wb], 1e-6 * knee),
            ("core_mean_b_t", vec![field.mean_b_t], 1e-6 * knee),
            // The oracle looks for it on a grid, the solver at its own nodes.
            ("core_peak_b_t", vec![field.peak_b_t], 3e-4),
        ] {
            let uncertain = numbers(&case["relative_error"][key])[0];
            assert!(
                uncertain < allowed,
                "the oracle itself is uncertain: {key} {uncertain:e}"
            );
            let worst = ours
                .iter()
                .zip(numbers(&case[key]))
                .fold(0.0_f64, |m, (a, b)| m.max((a / b - 1.0).abs()));
            println!("{current_a} A: {key} off by {worst:.1e}, oracle within {uncertain:.1e}");
            assert!(worst < allowed, "{current_a} A: {key} is off by {worst:e}");
        }
    }
}
