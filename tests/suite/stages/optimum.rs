//! The best coil within its limits: how many starts, and what a proof costs.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::{AIR_ALL_LIMITS, BuiltIn, NLOPT, OPTIMUM_AIR, OPTIMUM_CORED};
use fluxform::RunError;
use fluxform::coil::optimum::branch_and_bound::GAP;
use fluxform::coil::optimum::task;
use fluxform::coil::optimum::{CoilModel, Fixed, Outcome, Settings, Task, optimise};
use fluxform::design::Need;
use fluxform::field::magnet::MagnetRule;
use fluxform::progress::{Progress, Silent};

const STARTS: [usize; 6] = [1, 2, 4, 8, 24, 72];
/// Boxes of coils that a proof may take.
const CELLS: [usize; 6] = [10, 100, 1_000, 10_000, 100_000, 4_000_000];

#[derive(Deserialize)]
struct Reference {
    problems: BTreeMap<String, Problem>,
}

#[derive(Deserialize)]
struct Problem {
    best: Option<Best>,
    objective_tolerance: Option<f64>,
}

#[derive(Deserialize)]
struct Best {
    force_n: f64,
}

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    Ok(Measured {
        curves: StageCurves {
            stage: "coil-optimum".to_owned(),
            timed: "equation 11 from a design's limits: search, and certificate where reported"
                .to_owned(),
            error_of: "the best force (certificate: how far above it the proven bound lies)"
                .to_owned(),
            default: "24 starts; a certificate of at most 4e6 boxes, which ends at a gap of 1e-6"
                .to_owned(),
            curves: vec![
                starts("seed_air", &OPTIMUM_AIR, 24, pace, progress)?,
                starts("air_all_limits", &AIR_ALL_LIMITS, 24, pace, progress)?,
                starts("seed_cored", &OPTIMUM_CORED, 24, pace, progress)?,
                certificate(pace, progress)?,
            ],
        },
        accuracy: stage(GAP, "the force", "branch and bound over boxes of coils"),
    })
}

/// NLopt's best force for a problem, N, and what it is uncertain by.
fn nlopt(name: &str) -> Result<[f64; 2], RunError> {
    let reference: Reference = NLOPT.values()?;
    let found = reference.problems.get(name).and_then(|problem| {
        let best = problem.best.as_ref()?;
        Some([best.force_n, problem.objective_tolerance?])
    });
    found.ok_or_else(|| RunError::Input(format!("{}: no best coil of {name}", NLOPT.path)))
}

/// A design as a task for the optimiser, the magnet a dipole.
pub fn posed(design: &BuiltIn) -> Result<(Task, Box<dyn CoilModel>), RunError> {
    let design = design.design(Need::OPTIMIZE)?;
    let refused = |error: task::NoTask| RunError::Input(error.to_string());
    let magnet = MagnetRule::dipole(fluxform::scene::moment_a_m2(&design));
    let model = task::coil_model(&design, &magnet).map_err(refused)?;
    let task = task::of_design(&design, Fixed::default()).map_err(refused)?;
    Ok((task, model))
}

fn force_n(outcome: &Outcome) -> f64 {
    outcome.best.as_ref().map_or(0.0, |best| best.force_n.abs())
}

/// Local searches alone.
fn starts(
    name: &str,
    design: &BuiltIn,
    default: usize,
    pace: &Pace,
    progress: &dyn Progress,
) -> Result<Curve, RunError> {
    let [best_n, uncertain] = nlopt(name)?;
    let cored = name.contains("cored");
    let (task, _) = posed(design)?;
    let mut rows = Vec::new();
    for &starts in pace.settings(&STARTS, if cored { 4 } else { 5 }) {
        let settings = Settings {
            starts,
            cells: 0,
            valley: false,
            ..Settings::default()
        };
        let (found, timing) = pace.time(progress, || {
            // Tables about the optimum are part of the work: a model of its own.
            let (_, model) = posed(design)?;
            Ok(optimise(&*model, &task, &settings, &Silent)?)
        })?;
        let row = Found {
            knob: starts as f64,
            default: starts == default,
            items: 1,
            error: (force_n(&found) / best_n - 1.0).abs(),
            stated: None,
        };
        rows.push(row.timed(&timing));
    }
    Ok(curve(
        &format!("{name}: local searches"),
        "starts",
        "the best of three solvers of NLopt with another model of the coil",
        uncertain,
        rows,
    ))
}

/// The proof for the coil in air.
fn certificate(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let (task, model) = posed(&OPTIMUM_AIR)?;
    let mut rows = Vec::new();
    for &cells in pace.settings(&CELLS, CELLS.len()) {
        let settings = Settings {
            cells,
            valley: false,
            ..Settings::default()
        };
        let (found, timing) = pace.time(progress, || {
            Ok(optimise(&*model, &task, &settings, &Silent)?)
        })?;
        let upper_n = found.certificate.upper_bound_n.unwrap_or(f64::INFINITY);
        let row = Found {
            knob: cells as f64,
            default: cells == Settings::default().cells,
            items: found.certificate.cells,
            error: upper_n / force_n(&found) - 1.0,
            stated: found.certificate.gap,
        };
        rows.push(row.timed(&timing));
    }
    Ok(curve(
        "seed_air: what is proven",
        "boxes of coils",
        "the force found, than which none is better: the gap is the error",
        0.0,
        rows,
    ))
}
