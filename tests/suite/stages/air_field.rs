//! Field and gradient of one winding without steel.
//!
//! The kernel has no knob: it is exact wherever a point lies. What can be chosen is the vectorised
//! rule for many points above the winding, whose tolerance is swept.

use serde::Deserialize;

use super::curve;
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::{AIR_COIL, SEED};
use crate::reference::{AXIAL_ERROR, axial_gradient};
use crate::stages::Measured;
use fluxform::RunError;
use fluxform::design::Need;
use fluxform::field::components::Components;
use fluxform::field::winding::KERNEL_ERROR;
use fluxform::field::winding::{AxialField, Winding};
use fluxform::numerics::random::Random;
use fluxform::progress::Progress;
use fluxform::scene::Scene;

/// Points above the winding.
const POINTS: usize = 1024;
/// Their lowest height, m.
const LOWEST_M: f64 = 0.010;
/// The map's default.
const DEFAULT: f64 = 1e-9;
const TOLERANCES: [f64; 12] = [
    1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13,
];

#[derive(Deserialize)]
struct Oracle {
    windings: std::collections::BTreeMap<String, Section>,
    points: Vec<Point>,
}

#[derive(Deserialize)]
pub(super) struct Section {
    inner_radius_m: String,
    outer_radius_m: String,
    length_m: String,
    turns: String,
}

#[derive(Deserialize)]
struct Point {
    winding: String,
    r_m: String,
    z_m: String,
    b_r: String,
    b_z: String,
    dbr_dr: String,
    dbr_dz: String,
    dbz_dr: String,
    dbz_dz: String,
    br_over_r: String,
}

pub(super) fn number(text: &str) -> Result<f64, RunError> {
    text.parse()
        .map_err(|_| RunError::Input(format!("{}: {text:?} is not a number", AIR_COIL.path)))
}

impl Section {
    pub(super) fn winding(&self) -> Result<Winding, RunError> {
        Ok(Winding {
            inner_radius_m: number(&self.inner_radius_m)?,
            outer_radius_m: number(&self.outer_radius_m)?,
            length_m: number(&self.length_m)?,
            turns: number(&self.turns)?,
        })
    }
}

/// Every point of the oracle, with its winding and the field there.
fn exact_points() -> Result<Vec<(Winding, [f64; 2], AxialField)>, RunError> {
    let oracle: Oracle = AIR_COIL.values()?;
    let unknown = |name: &str| RunError::Input(format!("{}: no winding {name}", AIR_COIL.path));
    let one = |point: &Point| {
        let section = oracle.windings.get(&point.winding);
        let winding = section.ok_or_else(|| unknown(&point.winding))?.winding()?;
        let field = AxialField {
            b_r: number(&point.b_r)?,
            b_z: number(&point.b_z)?,
            dbr_dr: number(&point.dbr_dr)?,
            dbr_dz: number(&point.dbr_dz)?,
            dbr_dz_over_r: 0.0,
            dbz_dr: number(&point.dbz_dr)?,
            dbz_dz: number(&point.dbz_dz)?,
            br_over_r: number(&point.br_over_r)?,
        };
        Ok((winding, [number(&point.r_m)?, number(&point.z_m)?], field))
    };
    oracle.points.iter().map(one).collect()
}

/// Largest difference of a gradient component, relative to |grad B|.
fn gradient_error(found: &AxialField, exact: &AxialField) -> f64 {
    let parts = |f: &AxialField| [f.dbr_dr, f.dbr_dz, f.dbz_dr, f.dbz_dz, f.br_over_r];
    let pairs = parts(found).into_iter().zip(parts(exact));
    let most = pairs.fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
    most / exact.gradient_norm()
}

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    let design = SEED.design(Need::CALIBRATE)?;
    let winding = Scene::new(&design)?.winding;
    Ok(Measured {
        curves: StageCurves {
            stage: "air-field".to_owned(),
            timed: "all gradient components of one winding at the points".to_owned(),
            error_of: "largest |grad B| at the point's height (kernel: |grad B| at the point)"
                .to_owned(),
            default:
                "maps: the vectorised rule at 1e-9; probe and evaluate: the kernel, which has \
                      no knob"
                    .to_owned(),
            curves: vec![batch(&winding, pace, progress)?, kernel(pace, progress)?],
        },
        accuracy: super::stage(
            DEFAULT,
            "the largest |grad B| at each height",
            "a-priori bound of the quadrature",
        ),
    })
}

/// The vectorised rule.
fn batch(winding: &Winding, pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let mut numbers = Random::new(7);
    let mut places: Vec<[f64; 2]> = (0..POINTS)
        .map(|_| [numbers.between(0.0, 0.14), numbers.between(LOWEST_M, 0.08)])
        .collect();
    // Neighbours share a rule.
    places.sort_unstable_by(|a, b| a[1].total_cmp(&b[1]));
    let (r_m, z_m): (Vec<f64>, Vec<f64>) = places.iter().map(|[r, z]| (*r, *z)).unzip();
    let mut exact = Vec::with_capacity(POINTS);
    let mut sizes = Vec::with_capacity(POINTS);
    // Every eighth is compared: the reference is slow.
    for (r, z) in r_m.iter().zip(&z_m).step_by(8) {
        exact.push(axial_gradient(winding, *r, *z));
        // At one height |grad B| is largest over the winding.
        let above =
            [0.0, 0.5, 0.9, 1.2].map(|part| winding.field(part * winding.outer_radius_m, *z));
        let mut size = 0.0_f64;
        for field in above {
            size = size.max(field?.gradient_norm());
        }
        sizes.push(size);
    }
    let mut rows = Vec::new();
    for &tolerance in pace.settings(&TOLERANCES, TOLERANCES.len()) {
        let (found, timing) = pace.time(progress, || {
            Ok(winding.gradients(&r_m, &z_m, tolerance, Components::Gradient)?)
        })?;
        let error = (0..exact.len()).fold(0.0_f64, |most, k| {
            let at = 8 * k;
            let zz = (found.dbz_dz[at] - exact[k][0]).abs();
            let rz = (found.dbr_dz_over_r[at] * r_m[at] - exact[k][1]).abs();
            most.max(zz.max(rz) / sizes[k])
        });
        rows.push(
            Found {
                knob: tolerance,
                default: tolerance == DEFAULT,
                items: POINTS,
                error,
                stated: Some(tolerance),
            }
            .timed(&timing),
        );
    }
    Ok(curve(
        "vectorised rule, the seed's winding",
        "tolerance",
        "Biot-Savart around every loop, trapezoidal rule, double-double",
        AXIAL_ERROR,
        rows,
    ))
}

/// The kernel at the oracle's points: near, far, inside, on singular lines.
fn kernel(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let points = exact_points()?;
    // Inside thin discs the gradient's digits are lost to their size.
    let reported = |winding: &Winding| {
        winding.length_m > 0.01 * (winding.outer_radius_m - winding.inner_radius_m)
    };
    let points: Vec<_> = points.into_iter().filter(|(w, ..)| reported(w)).collect();
    let (found, timing) = pace.time(progress, || {
        let fields = points.iter().map(|(w, [r, z], _)| Ok(w.field(*r, *z)?));
        fields.collect::<Result<Vec<AxialField>, RunError>>()
    })?;
    let error = found
        .iter()
        .zip(&points)
        .fold(0.0_f64, |most, (found, (.., exact))| {
            most.max(gradient_error(found, exact))
        });
    let row = Found {
        knob: KERNEL_ERROR,
        default: true,
        items: points.len(),
        error,
        stated: Some(KERNEL_ERROR),
    };
    Ok(curve(
        "kernel at points from 1 pm to 10 m, inside too",
        "stated error (no knob)",
        "40-digit quadrature of the loops' fields, air_coil.py",
        1e-20,
        vec![row.timed(&timing)],
    ))
}
