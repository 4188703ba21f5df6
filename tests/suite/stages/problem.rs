//! The stages' problems as numbers for other programs, with the values to compare with.

use serde_json::{Value, json};

use super::{cored_coil, height_map, inductance as own_inductance, map_table as maps, section};
use crate::force::{Forces, forces};
use crate::inputs::SEED_AIR;
use crate::test_surface::dome_m;
use fluxform::RunError;
use fluxform::lambda::worst::worst_point as solve_worst;
use fluxform::lambda::{self, Settings};

/// Points along either axis of the problems for general solvers.
const SAMPLES: usize = 61;
const WORST_SAMPLES: usize = 21;

/// The seed's winding and its inductance: longer windings are beyond the peer's series.
///
/// # Errors
/// Built-in values that cannot be read.
pub fn inductance() -> Result<Value, RunError> {
    let cases = own_inductance::seed()?;
    let cases = cases.iter().map(|(winding, inductance_h)| {
        json!({"winding": section(winding), "inductance_h": inductance_h})
    });
    Ok(json!({"cases": cases.collect::<Vec<Value>>()}))
}

/// The seed's coil, gradients on its axis, inductance.
///
/// # Errors
/// As [`inductance`].
pub fn cored_coil() -> Result<Value, RunError> {
    cored_coil::problem()
}

/// The seed's array in air, nodes of its grid and the values there.
///
/// # Errors
/// As [`inductance`].
pub fn map_table() -> Result<Value, RunError> {
    maps::problem()
}

/// The wave's lattice, and exact heights.
///
/// # Errors
/// As [`inductance`].
pub fn height_map() -> Result<Value, RunError> {
    height_map::problem()
}

fn general(given: &Forces, form: &str, lambda_n_per_m: f64, least: f64) -> Value {
    json!({
        "form": form,
        "coils": given.upper_a.len(),
        "forces_n_per_a": given.forces_n_per_a,
        "height_m": given.height_m,
        "upper_a": given.upper_a,
        "total_max_a": given.total_max_a,
        "lambda_n_per_m": [lambda_n_per_m],
        "one": 0,
        "least_mean_square_n2": [least],
        "least_worst_n": [least],
    })
}

/// Forces, heights, limits, and the least mean square error at lambda_jnd.
///
/// # Errors
/// As [`inductance`].
pub fn lambda_path() -> Result<Value, RunError> {
    let given = forces(&SEED_AIR, 3, SAMPLES, dome_m)?;
    let solution = lambda::solve(&given.problem(), &Settings::default())?;
    let jnd = solution.constants.lambda_jnd_n_per_m.unwrap_or(1.0);
    Ok(general(&given, "mean", jnd, solution.path.error_n2(jnd)))
}

/// The same with the least worst error.
///
/// # Errors
/// As [`inductance`].
pub fn worst_point() -> Result<Value, RunError> {
    let given = forces(&SEED_AIR, 3, WORST_SAMPLES, dome_m)?;
    let problem = given.problem();
    let solution = solve_worst(&problem, &Settings::default())?;
    let jnd = solution.lambda_jnd_n_per_m.unwrap_or(1.0);
    let point = solution.at(&problem, jnd);
    Ok(general(
        &given,
        "worst",
        jnd,
        point.worst_error_n - point.gap_n,
    ))
}
