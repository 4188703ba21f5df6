//! Constraint points against the surface between them.

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::test_surface::{HALF_M, grid, known, mesh, shape};
use fluxform::RunError;
use fluxform::numerics::axis::Axis;
use fluxform::progress::{Progress, Silent};
use fluxform::shape::Surface;
use fluxform::shape::deviation::{Faces, Lattice, Looks, vertical};
use fluxform::shape::height::{Grid, heights};
use fluxform::shape::scattered::Probe;
use fluxform::shape::scattered::adaptive::{Grading, adaptive};

/// Points along either axis.
const SAMPLES: [usize; 6] = [16, 31, 61, 121, 241, 481];
const DEFAULT: usize = 61;
/// Distance that the graded points keep, m.
const DEVIATIONS_M: [f64; 7] = [3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6];
/// Squares of the mesh along either axis.
const SIDE: usize = 128;
/// Places along a cell at which the deviation is looked for; generic, so that they hit no edge.
const WITHIN: usize = 7;

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    let mesh = mesh(SIDE)?;
    let surface = Surface::Mesh(mesh);
    Ok(Measured {
        curves: StageCurves {
            stage: "points-against-surface".to_owned(),
            timed: "heights of 32,768 facets and the certificate of what lies between them"
                .to_owned(),
            error_of: "m, vertically".to_owned(),
            default: "61 x 61 points, with their certificate".to_owned(),
            curves: vec![
                on_grid(&surface, pace, progress)?,
                graded(&surface, pace, progress)?,
            ],
        },
        accuracy: stage(
            1e-12,
            "1 m",
            "the deviation reported is an exact supremum plus rounding",
        ),
    })
}

/// The largest difference found by looking at many places within every cell, m.
fn looked_for_m(
    surface: &Surface,
    plan: &Grid,
    heights_m: &[Option<f64>],
) -> Result<f64, RunError> {
    let samples = plan.x_m.samples;
    let step = plan.x_m.step();
    let mut worst = 0.0_f64;
    // One lattice of places a shift, so that memory stays small.
    for shift in 0..WITHIN {
        let part_y = (shift as f64 + 0.37) / WITHIN as f64;
        let fine = Axis {
            from: -HALF_M + 0.41 / WITHIN as f64 * step,
            to: HALF_M - 0.59 / WITHIN as f64 * step,
            samples: WITHIN * (samples - 1),
        };
        let coarse = Axis {
            from: -HALF_M + part_y * step,
            to: HALF_M - (1.0 - part_y) * step,
            samples: samples - 1,
        };
        let places = Grid {
            x_m: fine,
            y_m: coarse,
        };
        let found = surface.heights(&places, &Silent).map_err(shape)?;
        let (x, y) = (fine.nodes(), coarse.nodes());
        let (nodes_x, nodes_y) = (plan.x_m.nodes(), plan.y_m.nodes());
        for (k, sample) in found.iter().enumerate() {
            let (i, j) = (k % fine.samples, k / fine.samples);
            let (ci, cj) = (i / WITHIN, j);
            let at = |di: usize, dj: usize| heights_m[(cj + dj) * samples + ci + di];
            let corners = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
            if let (Some(sample), (Some(a), Some(b), Some(c), Some(d))) = (sample, corners) {
                let u = (x[i] - nodes_x[ci]) / (nodes_x[ci + 1] - nodes_x[ci]);
                let v = (y[j] - nodes_y[cj]) / (nodes_y[cj + 1] - nodes_y[cj]);
                let patch = (1.0 - v) * (a + u * (b - a)) + v * (c + u * (d - c));
                worst = worst.max((sample.height_m - patch).abs());
            }
        }
    }
    Ok(worst)
}

fn on_grid(surface: &Surface, pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let Surface::Mesh(mesh) = surface else {
        return Err(RunError::Input("the wave is a mesh".to_owned()));
    };
    let mut rows = Vec::new();
    for &samples in pace.settings(&SAMPLES, 5) {
        let plan = grid(samples);
        let ((known, bound_m), timing) = pace.time(progress, || {
            let known = known(&heights(mesh, &plan, &Silent)?);
            let faces = Faces::new(mesh, &plan, Looks::endless());
            let lattice = Lattice::new(&faces, &plan, &known);
            let bound_m = vertical(mesh, &plan, &lattice, &Silent)?.bound_m();
            Ok((known, bound_m))
        })?;
        let found = Found {
            knob: samples as f64,
            default: samples == DEFAULT,
            items: plan.len(),
            error: looked_for_m(surface, &plan, &known)?,
            stated: Some(bound_m),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "points on a grid; stated: the certificate",
        "points along x and y",
        "49 places within every cell, of which the largest difference is at most the supremum",
        0.0,
        rows,
    ))
}

fn graded(surface: &Surface, pace: &Pace, progress: &dyn Progress) -> Result<Curve, RunError> {
    let plan = grid(DEFAULT);
    let mut rows = Vec::new();
    for &max_deviation_m in pace.settings(&DEVIATIONS_M, 5) {
        let grading = Grading {
            max_deviation_m,
            widest_m: f64::INFINITY,
        };
        let (made, timing) = pace.time(progress, || {
            adaptive(&Probe::new(surface, &plan), grading, &Silent).map_err(shape)
        })?;
        let found = Found {
            knob: max_deviation_m,
            default: false,
            items: made.points.len(),
            error: made.vertical_m,
            stated: Some(max_deviation_m),
        };
        rows.push(found.timed(&timing));
    }
    Ok(curve(
        "points graded to a deviation; stated: what was asked for",
        "largest deviation, m",
        "the supremum over every patch, in closed form",
        0.0,
        rows,
    ))
}
