//! One winding with its linear steel core.

use serde::Deserialize;

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::{CORES, SEED};
use fluxform::RunError;
use fluxform::coil::inductance::self_inductance_h;
use fluxform::design::Need;
use fluxform::field::steel::CoreShape;
use fluxform::field::steel::cored_coil::CoredCoil;
use fluxform::field::steel::generatrix::Resolution;
use fluxform::field::winding::Winding;
use fluxform::progress::Progress;
use fluxform::scene::Scene;
use fluxform::scene::tolerances::CORED_TOLERANCE;

const TOLERANCES: [f64; 9] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9];
/// Lowest height of the seed's maps, m.
const LOWEST_M: f64 = 0.010;
/// The reference's resolution, and the one that gives its error.
const FINEST: [f64; 2] = [1e-11, 1e-10];
/// Where the seed's coil is compared: radius, height, m.
const PLACES: [[f64; 2]; 6] = [
    [0.0, 0.010],
    [0.0131, 0.010],
    [0.0217, 0.013],
    [0.0, 0.030],
    [0.0507, 0.030],
    [0.0707, 0.077],
];

#[derive(Deserialize)]
struct Oracle {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    inner_radius_m: f64,
    outer_radius_m: f64,
    length_m: f64,
    turns: f64,
    core_radius_m: f64,
    core_bottom_m: f64,
    core_top_m: f64,
    mu_r: f64,
    error: f64,
    added_inductance_h: f64,
    points: Vec<Point>,
}

#[derive(Deserialize)]
struct Point {
    r_m: f64,
    z_m: f64,
    b_z: f64,
    dbz_dz: f64,
}

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    Ok(Measured {
        curves: StageCurves {
            stage: "cored-coil".to_owned(),
            timed: "one coil with its core, solved from nothing, error estimate included"
                .to_owned(),
            error_of: "largest |grad B| at the height; the added inductance".to_owned(),
            default: format!("tolerance {CORED_TOLERANCE:e}"),
            curves: vec![seed(pace, progress)?, generic(pace, progress)?],
        },
        accuracy: stage(
            CORED_TOLERANCE,
            "the largest |grad B| at each height",
            "difference of two resolutions",
        ),
    })
}

/// The seed's coil, against itself much finer.
fn seed(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let design = SEED.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let core = scene.core.as_ref().ok_or_else(super::no_core)?;
    let (winding, shape, mu_r) = (&scene.winding, core.shape, core.relative_permeability());
    let finest = FINEST.map(|tolerance| {
        let resolution = Resolution::for_tolerance(tolerance);
        CoredCoil::at_resolution(winding, shape, mu_r, &resolution)
    });
    let [finest, second] = finest;
    let (finest, second) = (finest?, second?);
    let mut rows = Vec::new();
    for &tolerance in pace.settings(&TOLERANCES, TOLERANCES.len()) {
        let (coil, timing) = pace.time(progress, || {
            Ok(CoredCoil::new(winding, shape, mu_r, tolerance, LOWEST_M)?)
        })?;
        let found = Found {
            knob: tolerance,
            default: tolerance == CORED_TOLERANCE,
            items: 1,
            error: apart(&coil, &finest)?,
            stated: Some(coil.relative_error),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "the seed's coil",
        "tolerance",
        "the same equation at resolution 1e-11; its own error: the difference from 1e-10",
        apart(&second, &finest)?,
        rows,
    ))
}

/// The seed's coil for other programs: gradients on its axis relative to |grad B| there, and the
/// inductance.
pub(super) fn problem() -> Result<serde_json::Value, RunError> {
    let design = SEED.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let core = scene.core.as_ref().ok_or_else(super::no_core)?;
    let resolution = Resolution::for_tolerance(FINEST[0]);
    let mu_r = core.relative_permeability();
    let coil = CoredCoil::at_resolution(&scene.winding, core.shape, mu_r, &resolution)?;
    let mut on_axis = Vec::new();
    for [_, z_m] in PLACES.iter().filter(|[r, _]| *r == 0.0) {
        let field = coil.field(0.0, *z_m)?;
        on_axis.push(serde_json::json!({
            "z_m": z_m,
            "dbz_dz_t_per_m_per_a": field.dbz_dz,
            "gradient_norm_t_per_m_per_a": field.gradient_norm(),
        }));
    }
    Ok(serde_json::json!({
        "winding": super::section(&scene.winding),
        "core": {
            "radius_m": core.shape.radius_m,
            "bottom_m": core.shape.bottom_m,
            "top_m": core.shape.top_m,
            "relative_permeability": mu_r,
        },
        "on_axis": on_axis,
        "inductance_h": self_inductance_h(&scene.winding) + coil.added_inductance_h,
    }))
}

/// Largest difference of two solutions.
fn apart(a: &CoredCoil, b: &CoredCoil) -> Result<f64, RunError> {
    let mut most = (a.added_inductance_h / b.added_inductance_h - 1.0).abs();
    for [r_m, z_m] in PLACES {
        // Over the winding |grad B| is as large as anywhere at that height, nearly.
        let mut size = 0.0_f64;
        for part in [0.0, 0.8, 1.0] {
            let field = b.field(part * b.winding.outer_radius_m, z_m)?;
            size = size.max(field.gradient_norm());
        }
        let (a, b) = (a.field(r_m, z_m)?, b.field(r_m, z_m)?);
        let off = (a.dbz_dz - b.dbz_dz).abs().max((a.dbr_dz - b.dbr_dz).abs());
        most = most.max(off / size);
    }
    Ok(most)
}

/// Seven generic coils, against another equation.
fn generic(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let oracle: Oracle = CORES.values()?;
    let coil = |case: &Case, tolerance: f64| {
        let winding = Winding {
            inner_radius_m: case.inner_radius_m,
            outer_radius_m: case.outer_radius_m,
            length_m: case.length_m,
            turns: case.turns,
        };
        let shape = CoreShape {
            radius_m: case.core_radius_m,
            bottom_m: case.core_bottom_m,
            top_m: case.core_top_m,
        };
        let lowest_m = case.points.iter().fold(f64::INFINITY, |m, p| m.min(p.z_m));
        Ok(CoredCoil::new(
            &winding, shape, case.mu_r, tolerance, lowest_m,
        )?)
    };
    let mut rows = Vec::new();
    for &tolerance in pace.settings(&TOLERANCES, TOLERANCES.len()) {
        let (coils, timing) = pace.time(progress, || {
            let coils = oracle.cases.iter().map(|case| coil(case, tolerance));
            coils.collect::<Result<Vec<CoredCoil>, RunError>>()
        })?;
        let mut error = 0.0_f64;
        for (coil, case) in coils.iter().zip(&oracle.cases) {
            error = error.max((coil.added_inductance_h / case.added_inductance_h - 1.0).abs());
            for point in &case.points {
                let steel = coil.core.field(point.r_m, point.z_m);
                let whole = coil.field(point.r_m, point.z_m)?;
                error = error
                    .max((steel.dbz_dz - point.dbz_dz).abs() / whole.gradient_norm())
                    .max((steel.b_z - point.b_z).abs() / whole.b_z.hypot(whole.b_r));
            }
        }
        let stated = coils.iter().fold(0.0_f64, |m, c| m.max(c.relative_error));
        let found = Found {
            knob: tolerance,
            default: tolerance == CORED_TOLERANCE,
            items: coils.len(),
            error,
            stated: Some(stated),
        };
        rows.push(found.timed(&timing));
    }
    let own = oracle
        .cases
        .iter()
        .fold(0.0_f64, |most, c| most.max(c.error));
    Ok(curve(
        "seven generic coils, mu_r 0.31 to 5300",
        "tolerance",
        "the core's surface charge, graded Nystrom, steel.py",
        own,
        rows,
    ))
}
