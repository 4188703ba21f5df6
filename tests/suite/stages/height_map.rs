//! Heights of a mesh over a grid.
//!
//! They are the exact heights of the triangles, without a knob: what the triangles are off from
//! the surface meant is the file's, and its price is their number.

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::test_surface::{grid, height_m, mesh};
use fluxform::RunError;
use fluxform::numerics::double_double::DoubleDouble as Num;
use fluxform::numerics::random::Random;
use fluxform::progress::{Progress, Silent};
use fluxform::shape::file_mesh::Triangle;
use fluxform::shape::height::heights;
use fluxform::shape::mesh::Mesh;

/// Squares along either axis; twice their square are triangles.
const SIDES: [usize; 8] = [8, 16, 32, 64, 128, 256, 512, 1024];
/// Points along either axis.
const SAMPLES: [usize; 6] = [16, 31, 61, 121, 241, 481];
const DEFAULT: usize = 61;
/// Squares of the mesh whose heights are computed again.
const SIDE: usize = 32;
/// Points at which they are.
const COMPARED: usize = 600;
/// A double's rounding of a height of this surface, m.
const ROUNDING_M: f64 = 1e-17;

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    Ok(Measured {
        curves: StageCurves {
            stage: "height-map".to_owned(),
            timed: "heights of a wavy surface over a square grid, the mesh in memory".to_owned(),
            error_of: "m".to_owned(),
            default: "no knob: exact for the triangles given; 61 x 61 points".to_owned(),
            curves: vec![facets(pace, progress)?, exactness(pace, progress)?],
        },
        accuracy: stage(
            ROUNDING_M,
            "1 m",
            "exact predicates; rounding of the plane's height",
        ),
    })
}

/// Against the surface that the triangles stand for.
fn facets(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let plan = grid(DEFAULT);
    let (x, y) = (plan.x_m.nodes(), plan.y_m.nodes());
    let mut rows = Vec::new();
    for &side in pace.settings(&SIDES, 6) {
        let mesh = mesh(side)?;
        let (found, timing) = pace.time(progress, || Ok(heights(&mesh, &plan, &Silent)?))?;
        let error = found.iter().enumerate().fold(0.0_f64, |most, (k, sample)| {
            let exact = height_m(x[k % x.len()], y[k / x.len()]);
            most.max(sample.map_or(f64::INFINITY, |s| (s.height_m - exact).abs()))
        });
        let found = Found {
            knob: mesh.triangles().len() as f64,
            default: false,
            items: plan.len(),
            error,
            stated: None,
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "61 x 61 points over ever more facets, against the surface meant",
        "triangles",
        "the surface's formula",
        ROUNDING_M,
        rows,
    ))
}

/// Against every triangle tried, in double-double.
fn exactness(pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let mesh = mesh(SIDE)?;
    let mut rows = Vec::new();
    for &samples in pace.settings(&SAMPLES, 5) {
        let plan = grid(samples);
        let (x, y) = (plan.x_m.nodes(), plan.y_m.nodes());
        let (found, timing) = pace.time(progress, || Ok(heights(&mesh, &plan, &Silent)?))?;
        let mut numbers = Random::new(17);
        let mut error = 0.0_f64;
        for _ in 0..COMPARED.min(found.len()) {
            let k = ((numbers.unit() * found.len() as f64) as usize).min(found.len() - 1);
            let exact = highest_m(&mesh, [x[k % samples], y[k / samples]]);
            error = error.max(match (found[k], exact) {
                (Some(sample), Some(exact)) => {
                    (Num::exactly(sample.height_m) - exact).nearest().abs()
                }
                (None, None) => 0.0,
                _ => f64::INFINITY,
            });
        }
        let found = Found {
            knob: samples as f64,
            default: samples == DEFAULT,
            items: plan.len(),
            error,
            stated: None,
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "2048 facets under ever more points, against the facets themselves",
        "points along x and y",
        "every triangle tried at 600 points, double-double",
        1e-30,
        rows,
    ))
}

/// The facets for other programs, and their heights at the points of the default grid.
pub(super) fn problem() -> Result<serde_json::Value, RunError> {
    let mesh = mesh(SIDE)?;
    let plan = grid(DEFAULT);
    let (x, y) = (plan.x_m.nodes(), plan.y_m.nodes());
    let mut numbers = Random::new(17);
    let at = |unit: f64| ((unit * plan.len() as f64) as usize).min(plan.len() - 1);
    let looked: Vec<usize> = (0..COMPARED).map(|_| at(numbers.unit())).collect();
    let exact = looked.iter().map(|k| {
        let found = highest_m(&mesh, [x[k % DEFAULT], y[k / DEFAULT]]);
        found.map_or(f64::NAN, Num::nearest)
    });
    Ok(serde_json::json!({
        "triangles_m": mesh.triangles(),
        "x_m": x,
        "y_m": y,
        "looked_at": looked,
        "height_m": exact.collect::<Vec<f64>>(),
    }))
}

/// The highest intersection of a vertical line with any triangle, borders inclusive.
fn highest_m(mesh: &Mesh, at: [f64; 2]) -> Option<Num> {
    let heights = mesh.triangles().iter().filter_map(|t| over(t, at));
    heights.reduce(|a, b| if b > a { b } else { a })
}

/// Height of a triangle over a point by barycentric coordinates.
fn over(triangle: &Triangle, at: [f64; 2]) -> Option<Num> {
    let n = Num::exactly;
    let area = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (n(q[0]) - n(p[0])) * (n(r[1]) - n(p[1])) - (n(q[1]) - n(p[1])) * (n(r[0]) - n(p[0]))
    };
    let [a, b, c] = triangle.map(|[x, y, _]| [x, y]);
    let whole = area(a, b, c);
    let parts = [area(at, b, c), area(a, at, c), area(a, b, at)].map(|part| part / whole);
    if parts.iter().any(|part| *part < n(0.0)) {
        return None;
    }
    let [za, zb, zc] = triangle.map(|[.., z]| n(z));
    Some(parts[0] * za + parts[1] * zb + parts[2] * zc)
}
