//! Nine cored coils whose cores answer to each other.

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::SEED;
use fluxform::RunError;
use fluxform::design::Need;
use fluxform::field::components::Components;
use fluxform::field::steel::array::{ArrayResolution, CoupledArray, closest_m};
use fluxform::field::steel::clearance::Clearance;
use fluxform::field::steel::equivalent_dipoles::ArraySources;
use fluxform::progress::Progress;
use fluxform::scene::Scene;
use fluxform::scene::tolerances::COUPLED_TOLERANCE;

const TOLERANCES: [f64; 6] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
/// Rows of a quick run.
const QUICK: usize = 4;
/// Tolerances of the reference and of the one that gives its error, and the same in a quick run.
const FINEST: [f64; 2] = [1e-7, 1e-6];
const QUICK_FINEST: [f64; 2] = [1e-5, 1e-4];
/// Lowest height, m.
const LOWEST_M: f64 = 0.010;
/// Evaluation of a solution, beside which its own error shows.
const EVALUATION: f64 = 1e-9;
/// Where solutions are compared, m.
const PLACES: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.010],
    [0.0137, 0.0071, 0.010],
    [0.0507, -0.0013, 0.010],
    [-0.0471, 0.0533, 0.013],
    [0.0017, -0.0023, 0.030],
    [0.0251, 0.0247, 0.030],
    [-0.0503, 0.0011, 0.050],
    [0.0333, -0.0411, 0.070],
];

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    Ok(Measured {
        curves: StageCurves {
            stage: "coupled-array".to_owned(),
            timed: "nine coils with coupled cores, every drive, solved from nothing, error \
                    estimate included"
                .to_owned(),
            error_of: "largest component of the gradient at the height; the largest inductance"
                .to_owned(),
            default: format!("tolerance {COUPLED_TOLERANCE:e}"),
            curves: vec![seed(pace, progress)?],
        },
        accuracy: stage(
            COUPLED_TOLERANCE,
            "the largest |grad B| at each height",
            "half the difference of two resolutions",
        ),
    })
}

/// Quantities compared: the gradients of every drive at the places, and the inductances.
struct Values {
    gradients: Vec<f64>,
    added_inductance_h: Vec<f64>,
}

fn values(array: &CoupledArray) -> Values {
    let drives = array.positions_m.len();
    let sources = ArraySources::of_array(array, Clearance::above(LOWEST_M, LOWEST_M), EVALUATION);
    let mut gradients = vec![0.0; drives * Components::Gradient.count() * PLACES.len()];
    sources.sample(&PLACES, Components::Gradient, &mut gradients);
    Values {
        gradients,
        added_inductance_h: array.added_inductance_h.iter().copied().collect(),
    }
}

/// Largest difference; `air` is the windings' own part of the gradient at every place.
fn apart(a: &Values, b: &Values, air: &[f64]) -> f64 {
    let places = PLACES.len();
    let mut worst = 0.0_f64;
    for (height, _) in PLACES.iter().enumerate() {
        let at = |values: &Values| -> Vec<f64> {
            let row = values.gradients.iter().skip(height).step_by(places);
            row.copied().collect()
        };
        let (a, b) = (at(a), at(b));
        let size = b.iter().fold(0.0_f64, |m, v| m.max(v.abs())) + air[height];
        let off = a
            .iter()
            .zip(&b)
            .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        worst = worst.max(off / size);
    }
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let off: Vec<f64> = (a.added_inductance_h.iter().zip(&b.added_inductance_h))
        .map(|(a, b)| a - b)
        .collect();
    worst.max(largest(&off) / largest(&b.added_inductance_h))
}

fn seed(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let design = SEED.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let core = scene.core.as_ref().ok_or_else(super::no_core)?;
    let (winding, shape, mu_r) = (&scene.winding, core.shape, core.relative_permeability());
    let positions_m = &design.array.positions_m;
    let mut air = Vec::new();
    for [.., z] in PLACES {
        air.push(winding.field(0.0, z)?.gradient_norm());
    }
    let settings = pace.settings(&TOLERANCES, QUICK);
    let mut solved = Vec::new();
    let mut rows = Vec::new();
    for &tolerance in settings {
        let (array, timing) = pace.time(progress, || {
            Ok(CoupledArray::new(
                winding,
                shape,
                mu_r,
                positions_m,
                tolerance,
                LOWEST_M,
            )?)
        })?;
        let found = Found {
            knob: tolerance,
            default: tolerance == COUPLED_TOLERANCE,
            items: positions_m.len(),
            error: f64::NAN,
            stated: Some(array.relative_error),
        };
        solved.push(values(&array));
        rows.push(found.timed(&timing));
    }
    progress.check()?;
    let finest = if pace.quick { QUICK_FINEST } else { FINEST };
    let [finest, second] = finest.map(|tolerance| {
        let resolution = ArrayResolution::for_tolerance(tolerance, shape, closest_m(positions_m));
        CoupledArray::at_resolution(winding, shape, mu_r, positions_m, &resolution)
            .map(|array| values(&array))
    });
    let (finest, second) = (finest?, second?);
    for (row, found) in rows.iter_mut().zip(&solved) {
        row.error = apart(found, &finest, &air);
    }
    let [last, before] = if pace.quick { QUICK_FINEST } else { FINEST };
    Ok(curve(
        "the seed's array",
        "tolerance",
        &format!(
            "the same equations at resolution {last:e}; its own error: below the difference from \
             {before:e}; finite elements agree to their 0.1 % (tests/field/steel)"
        ),
        apart(&second, &finest, &air),
        rows,
    ))
}
