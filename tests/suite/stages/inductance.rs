//! Self inductance of a winding, and the mutual inductance of two.
//!
//! Neither has a knob; the optimiser has two routes to the self inductance that are faster and
//! less exact. Their order is the curve.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::air_field::{Section, number};
use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::{AIR_COIL, SEED};
use fluxform::RunError;
use fluxform::coil::inductance::{RELATIVE_ERROR, self_inductance_h};
use fluxform::coil::mutual::{self, mutual_inductance_h};
use fluxform::coil::section_integrals::{FINE, ROUGH, section_integrals};
use fluxform::design::Need;
use fluxform::field::winding::Winding;
use fluxform::numerics::gauss;
use fluxform::progress::Progress;
use fluxform::scene::Scene;
use fluxform::units::MU_0_T_M_PER_A;

/// From a winding to its inductance, H.
type Route<'a> = &'a dyn Fn(&Winding) -> f64;

#[derive(Deserialize)]
struct Oracle {
    windings: BTreeMap<String, Section>,
    inductances: Vec<Inductance>,
}

#[derive(Deserialize)]
struct Inductance {
    winding: String,
    inductance_h: String,
}

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    Ok(Measured {
        curves: StageCurves {
            stage: "inductance".to_owned(),
            timed: "the inductance of each winding; mutual: of two windings".to_owned(),
            error_of: "the inductance".to_owned(),
            default:
                "evaluate: Neumann's integral, to 1e-12; optimize: FINE for the result, ROUGH \
                      on the way"
                    .to_owned(),
            curves: vec![
                own(
                    "six windings from a thin disc to a long tube",
                    &cases()?,
                    pace,
                    progress,
                )?,
                own("the seed's winding", &seed()?, pace, progress)?,
                between(pace, progress)?,
            ],
        },
        accuracy: stage(
            RELATIVE_ERROR,
            "the inductance",
            "held by tests against 20-digit values",
        ),
    })
}

/// Windings with their inductances, H.
pub(super) fn cases() -> Result<Vec<(Winding, f64)>, RunError> {
    let oracle: Oracle = AIR_COIL.values()?;
    let mut cases = Vec::new();
    for exact in &oracle.inductances {
        if let Some(section) = oracle.windings.get(&exact.winding) {
            cases.push((section.winding()?, number(&exact.inductance_h)?));
        }
    }
    Ok(cases)
}

/// The seed's alone.
pub(super) fn seed() -> Result<Vec<(Winding, f64)>, RunError> {
    let design = SEED.design(Need::CALIBRATE)?;
    let winding = Scene::new(&design)?.winding;
    let all = cases()?.into_iter();
    Ok(all.filter(|(other, _)| *other == winding).collect())
}

/// Self inductances by section integrals, rough and fine, and by Neumann's integral.
fn own(
    name: &str,
    cases: &[(Winding, f64)],
    pace: &Pace,
    progress: &dyn Progress,
) -> Result<Curve, RunError> {
    let fast = |accuracy| {
        move |w: &Winding| {
            let depth = w.outer_radius_m - w.inner_radius_m;
            let integrals = section_integrals(w.inner_radius_m, depth, w.length_m, accuracy);
            MU_0_T_M_PER_A * w.current_density_per_m2().powi(2) * integrals.value
        }
    };
    let routes: [(f64, Route); 3] = [
        (ROUGH.relative_error, &fast(&ROUGH)),
        (FINE.relative_error, &fast(&FINE)),
        (RELATIVE_ERROR, &self_inductance_h),
    ];
    let mut rows = Vec::new();
    for (stated, route) in pace.settings(&routes, routes.len()) {
        let (found, timing) = pace.time(progress, || {
            Ok(cases.iter().map(|(w, _)| route(w)).collect::<Vec<f64>>())
        })?;
        let error = found
            .iter()
            .zip(cases)
            .fold(0.0_f64, |most, (found, (_, exact))| {
                most.max((found / exact - 1.0).abs())
            });
        let found = Found {
            knob: *stated,
            default: *stated == RELATIVE_ERROR,
            items: cases.len(),
            error,
            stated: Some(*stated),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        name,
        "stated error of the route: section integrals, rough and fine; Neumann's integral",
        "40-digit Neumann integral over azimuth and radii, air_coil.py",
        1e-18,
        rows,
    ))
}

fn between(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let design = SEED.design(Need::CALIBRATE)?;
    let winding = Scene::new(&design)?.winding;
    let distance_m = 0.05;
    let exact = flux_h(&winding, distance_m, 16)?;
    let coarser = flux_h(&winding, distance_m, 12)?;
    let (found, timing) = pace.time(progress, || {
        Ok(mutual_inductance_h(
            &winding,
            std::hint::black_box(distance_m),
        ))
    })?;
    let found = Found {
        knob: mutual::RELATIVE_ERROR,
        default: true,
        items: 1,
        error: (found / exact - 1.0).abs(),
        stated: Some(mutual::RELATIVE_ERROR),
    };
    Ok(curve(
        "mutual inductance of two of the seed's windings, 50 mm apart",
        "stated error (no knob)",
        "flux of the one's field through the other's turns, Gauss-Legendre",
        (exact / coarser - 1.0).abs().max(1e-12),
        vec![found.timed(&timing)],
    ))
}

/// Flux of a winding's B_z through the turns of an equal one, per ampere: midpoints around the
/// circle, Gauss-Legendre over turns, discs and length.
fn flux_h(winding: &Winding, distance_m: f64, order: usize) -> Result<f64, RunError> {
    let (turns, radial, axial) = (
        gauss::rule(order / 2),
        gauss::rule(order / 2),
        gauss::rule(2 * order),
    );
    let steps = 3 * order;
    let centre = 0.5 * (winding.inner_radius_m + winding.outer_radius_m);
    let half = 0.5 * (winding.outer_radius_m - winding.inner_radius_m);
    let half_length = 0.5 * winding.length_m;
    let mut flux = 0.0;
    for (xb, wb) in turns.nodes.iter().zip(&turns.weights) {
        let b = centre + half * xb;
        for (xr, wr) in radial.nodes.iter().zip(&radial.weights) {
            let rho = 0.5 * b * (1.0 + xr);
            for step in 0..steps {
                let angle = std::f64::consts::TAU * (step as f64 + 0.5) / steps as f64;
                let r =
                    (distance_m * distance_m + rho * rho + 2.0 * distance_m * rho * angle.cos())
                        .sqrt();
                let area = 0.5 * b * wr * rho * std::f64::consts::TAU / steps as f64;
                for (xz, wz) in axial.nodes.iter().zip(&axial.weights) {
                    let z = half_length * (xz - 1.0);
                    flux += winding.field(r, z)?.b_z * area * 0.5 * wz * 0.5 * wb;
                }
            }
        }
    }
    Ok(winding.turns * flux)
}
