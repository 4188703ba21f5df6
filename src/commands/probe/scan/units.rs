//! Scans in other units, recognised by their size against what the design gives.

use crate::bundle::scan::{Measured, Scan};
use crate::design::Design;

/// Coordinates this many times beyond the array and its workspace are in another unit.
const BEYOND: f64 = 10.0;
/// Decimal logarithms closer than this are of the same unit.
const CLOSE: f64 = 0.35;
/// Least cosine between measured and computed for a ratio to mean a unit.
const ALIKE: f64 = 0.7;

/// Units that coordinates may be in, and what makes metres of them.
const LENGTHS: [(f64, &str); 3] = [
    (1e-3, "divide millimetres by 1000"),
    (1e-2, "divide centimetres by 100"),
    (0.0254, "multiply inches by 0.0254"),
];

/// How far the array and its workspace reach from the origin, m.
pub(super) fn reach_m(design: &Design) -> f64 {
    let axes = &design.array.positions_m;
    let coils = axes
        .iter()
        .flatten()
        .fold(0.0_f64, |most, x| most.max(x.abs()));
    let diameter_m = design.coil.map_or(0.0, |coil| coil.outer_diameter_m);
    let space = &design.workspace;
    let ends = [space.x_m, space.y_m, space.z_m].map(|axis| axis.from.abs().max(axis.to.abs()));
    ends.into_iter().fold(coils + diameter_m, f64::max)
}

/// That the coordinates do not look like metres, and what to do if they are in a unit that would bring them
/// to the array. Which unit it is their size alone does not say: a scan may be far smaller than the array.
pub(in crate::commands::probe) fn coordinates(
    design: &Design,
    positions_m: &[[f64; 3]],
) -> Option<String> {
    let reach_m = reach_m(design);
    let places = positions_m.iter().flatten();
    let most_m = places.fold(0.0_f64, |most, x| most.max(x.abs()));
    if most_m <= BEYOND * reach_m {
        return None;
    }
    let near = LENGTHS
        .iter()
        .filter(|(unit_m, _)| unit_m * most_m <= BEYOND * reach_m);
    let cures: Vec<&str> = near.map(|(_, cure)| *cure).collect();
    let cures = if cures.is_empty() {
        "convert them".to_owned()
    } else {
        cures.join("; ")
    };
    Some(format!(
        "x_m, y_m and z_m reach {most_m:.3} m where the array and its workspace reach {reach_m:.3} m; if they are \
         not in metres: {cures}"
    ))
}

/// Probable unit of the measured numbers, or the currents, if not tesla and ampere; `predicted`
/// is [row, quantity].
pub(super) fn magnitudes(scan: &Scan, predicted: &[f64]) -> Option<String> {
    let field = exponent(scan, predicted, |q| matches!(q, Measured::Field(_)));
    let gradient = exponent(scan, predicted, |q| matches!(q, Measured::Gradient(..)));
    let near = |exponent: Option<f64>, expected: f64| {
        exponent.is_some_and(|found| (found - expected).abs() < CLOSE)
    };
    if near(field.or(gradient), -3.0) {
        return Some(
            "the coils give a thousandth of what current_a asks for, so it looks like \
             milliampere; divide it by 1000"
                .to_owned(),
        );
    }
    let units = [
        (
            field,
            3.0,
            "the field looks like millitesla; divide it by 1000",
        ),
        (field, 4.0, "the field looks like gauss; divide it by 10000"),
        (
            field,
            6.0,
            "the field looks like microtesla; divide it by 1000000",
        ),
        (
            gradient,
            2.0,
            "the gradient looks like gauss per centimetre; divide it by 100",
        ),
        (
            gradient,
            3.0,
            "the gradient looks like millitesla per metre; divide it by 1000",
        ),
        (
            gradient,
            -3.0,
            "the gradient looks like tesla per millimetre; multiply it by 1000",
        ),
    ];
    let found = units
        .into_iter()
        .find(|(found, expected, _)| near(*found, *expected));
    found.map(|(found, _, words)| {
        let ratio = 10f64.powf(found.unwrap_or(0.0));
        format!("measured over computed is {ratio:.3e}: {words}")
    })
}

/// Decimal logarithm of measured over computed, where the two are alike; constants aside.
fn exponent(scan: &Scan, predicted: &[f64], of: impl Fn(&Measured) -> bool) -> Option<f64> {
    let count = scan.quantities.len();
    let (mut mm, mut mp, mut pp) = (0.0, 0.0, 0.0);
    for (k, _) in scan.quantities.iter().enumerate().filter(|(_, q)| of(q)) {
        let at = |values: &[f64]| -> Vec<f64> {
            let column: Vec<f64> = values.iter().skip(k).step_by(count).copied().collect();
            let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
            column.iter().map(|value| value - mean).collect()
        };
        for (m, p) in at(&scan.values).iter().zip(at(predicted)) {
            mm += m * m;
            mp += m * p;
            pp += p * p;
        }
    }
    let alike = mp.abs() > ALIKE * (mm * pp).sqrt() && pp > 0.0;
    alike.then(|| (mp.abs() / pp).log10())
}
