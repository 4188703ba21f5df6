//! Arrays whose steel saturates: limits, symmetries and energy.

// Some tests print the tables that the documentation quotes.
#![allow(clippy::print_stdout)]

use fluxform::field::steel::CoreShape;
use fluxform::field::steel::array::{ArrayResolution, CoupledArray};
use fluxform::field::steel::bh_curve::BhCurve;
use fluxform::field::steel::cored_coil::Excitation;
use fluxform::field::steel::generatrix::Generatrix;
use fluxform::field::steel::permeability::{Constant, Permeability};
use fluxform::field::steel::saturated::{SaturatedCore, Status};
use fluxform::field::steel::saturated_array::{SaturatedArray, SaturatedArrayError};
use fluxform::field::steel::sources::{ArraySources, Parts};
use fluxform::field::winding::Winding;

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

/// The committed table of a low-carbon steel.
fn steel() -> BhCurve {
    let text = include_str!("../designs/steel_1010.csv");
    let (b_t, h): (Vec<f64>, Vec<f64>) = text
        .lines()
        .skip(1)
        .map(|line| {
            let (b, h) = line.split_once(',').expect("two columns");
            (
                b.trim().parse::<f64>().expect("a number"),
                h.trim().parse::<f64>().expect("a number"),
            )
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

fn resolution(tolerance: f64) -> ArrayResolution {
    ArrayResolution::for_tolerance(tolerance, SHAPE, PITCH_M)
}

fn solve(
    law: &(impl Permeability + Sync),
    positions_m: &[[f64; 2]],
    currents_a: &[f64],
    reference: f64,
    tolerance: f64,
) -> SaturatedArray {
    let resolution = resolution(tolerance);
    let found = SaturatedArray::at_resolution(
        &WINDING,
        SHAPE,
        law,
        positions_m,
        currents_a,
        reference,
        &resolution,
    )
    .expect("a good design");
    assert_eq!(found.status, Status::Converged, "{:?}", found.steps);
    found
}

/// dB_z/dz of the steel at points, T/m.
fn slopes(sources: &ArraySources, points: &[[f64; 3]], currents_a: &[f64]) -> Vec<f64> {
    let mut values = vec![0.0; sources.drives() * points.len()];
    sources.sample(points, Parts::Gz, &mut values);
    (0..points.len())
        .map(|p| {
            (0..sources.drives())
                .map(|d| values[d * points.len() + p] * currents_a[d])
                .sum()
        })
        .collect()
}

fn of_saturated(array: &SaturatedArray, points: &[[f64; 3]]) -> Vec<f64> {
    let sources = ArraySources::of_saturated(array, LOWEST_M, LOWEST_M, 1e-6);
    slopes(&sources, points, &[1.0])
}

fn of_linear(array: &CoupledArray, points: &[[f64; 3]], currents_a: &[f64]) -> Vec<f64> {
    let sources = ArraySources::of_array(array, LOWEST_M, LOWEST_M, 1e-6);
    slopes(&sources, points, currents_a)
}

/// The windings' own part, T/m.
fn of_windings(positions_m: &[[f64; 2]], currents_a: &[f64], point: [f64; 3]) -> f64 {
    positions_m
        .iter()
        .zip(currents_a)
        .map(|([x, y], current_a)| {
            let r_m = (point[0] - x).hypot(point[1] - y);
            let field = WINDING.field(r_m, point[2]).expect("above");
            current_a * field.dbz_dz
        })
        .sum()
}

#[test]
#[ignore = "prints"]
fn seed() {
    let (law, positions) = (steel(), grid(3, 3));
    let initial = law.response(0.0).relative;
    let started = std::time::Instant::now();
    let linear =
        CoupledArray::new(&WINDING, SHAPE, initial, &positions, 1e-4, LOWEST_M).expect("good");
    println!(
        "linear mu {initial:.0}: {:.2?} estimate {:.1e}",
        started.elapsed(),
        linear.relative_error
    );
    for current_a in [0.5, 2.0, 6.0] {
        for tolerance in [1e-3, 1e-4] {
            let currents = [current_a; 9];
            let started = std::time::Instant::now();
            let array = SaturatedArray::new(
                &WINDING, SHAPE, &law, &positions, &currents, tolerance, LOWEST_M,
            )
            .expect("good");
            println!(
                "{current_a} A to {tolerance:e}: {:?} {:.2?}, mu {:.0}, estimate {:.1e} (modes {:.1e}), {} nodes, steps {:?}",
                array.status,
                started.elapsed(),
                array.reference_permeability,
                array.relative_error,
                array.modes_error,
                array.outline().nodes.len(),
                array.steps
            );
            for core in [0, 1, 4] {
                println!(
                    "  core {core}: mean {:.4} T peak {:.4} T",
                    array.fields[core].mean_b_t, array.fields[core].peak_b_t
                );
            }
            let mut points = vec![[0.0, 0.0, 0.03], [0.0, 0.0, 0.05]];
            for i in 0..21 * 21 {
                points.push([
                    0.005 * (i % 21) as f64 - 0.05,
                    0.005 * (i / 21) as f64 - 0.05,
                    0.05,
                ]);
            }
            let air: Vec<f64> = points
                .iter()
                .map(|p| of_windings(&positions, &currents, *p))
                .collect();
            let saturated: Vec<f64> = of_saturated(&array, &points)
                .iter()
                .zip(&air)
                .map(|(a, b)| a + b)
                .collect();
            let straight: Vec<f64> = of_linear(&linear, &points, &currents)
                .iter()
                .zip(&air)
                .map(|(a, b)| a + b)
                .collect();
            let mean = |v: &[f64]| v[2..].iter().sum::<f64>() / (v.len() - 2) as f64;
            println!(
                "  Gz {:.6} {:.6} mean {:.6} T/m; against linear {:+.5} {:+.5} mean {:+.5}; air share {:.3}",
                saturated[0],
                saturated[1],
                mean(&saturated),
                saturated[0] / straight[0] - 1.0,
                saturated[1] / straight[1] - 1.0,
                mean(&saturated) / mean(&straight) - 1.0,
                air[0] / saturated[0]
            );
        }
    }
}
