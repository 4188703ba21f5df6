//! Force problems over a square plan.

use super::inputs::BuiltIn;
use super::test_surface::HALF_M;
use fluxform::RunError;
use fluxform::design::{Design, Need};
use fluxform::lambda::ForceProblem;
use fluxform::numerics::axis::Axis;
use fluxform::progress::Silent;
use fluxform::scene::Scene;
use fluxform::scene::steel;

/// Distance of the axes of two neighbours, m.
const PITCH_M: f64 = 0.05;

/// A force problem that owns its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Forces {
    /// N/A, a row a point.
    pub forces_n_per_a: Vec<f64>,
    /// m.
    pub height_m: Vec<f64>,
    lower_a: Vec<f64>,
    /// A.
    pub upper_a: Vec<f64>,
    /// A.
    pub total_max_a: Option<f64>,
    resistance_ohm: Vec<f64>,
}

impl Forces {
    /// Borrowed.
    #[must_use]
    pub fn problem(&self) -> ForceProblem<'_> {
        ForceProblem {
            forces_n_per_a: &self.forces_n_per_a,
            height_m: &self.height_m,
            offset_n: None,
            weights: None,
            lower_a: &self.lower_a,
            upper_a: &self.upper_a,
            total_max_a: self.total_max_a,
            resistance_ohm: &self.resistance_ohm,
        }
    }
}

/// `design` with `side` coils along either axis, at its own pitch.
///
/// # Errors
/// A built-in design that cannot be read.
pub fn with_coils(design: &BuiltIn, side: usize) -> Result<Design, RunError> {
    let mut design = design.design(Need::CALIBRATE)?;
    let middle = 0.5 * (side.max(1) - 1) as f64;
    let coils = side * side;
    design.array.positions_m = (0..coils)
        .map(|k| [(k % side) as f64, (k / side) as f64].map(|i| (i - middle) * PITCH_M))
        .collect();
    design.array.grid = None;
    design.array.gain = vec![1.0; coils];
    design.supply.current_max_a = vec![2.0; coils];
    design.supply.current_min_a = vec![0.0; coils];
    design.supply.total_current_max_a = Some(2.0 * coils as f64);
    Ok(design)
}

/// Forces of `side` by `side` coils of an air design at `samples` by `samples` points of a surface.
///
/// # Errors
/// A built-in design that cannot be read.
pub fn forces(
    design: &BuiltIn,
    side: usize,
    samples: usize,
    height_m: fn(f64, f64) -> f64,
) -> Result<Forces, RunError> {
    forces_over(&with_coils(design, side)?, HALF_M, samples, height_m)
}

/// The same of coils at half their pitch, whose fields overlap.
///
/// # Errors
/// As [`forces`].
pub fn forces_overlapping(
    design: &BuiltIn,
    side: usize,
    samples: usize,
    height_m: fn(f64, f64) -> f64,
) -> Result<Forces, RunError> {
    let mut design = with_coils(design, side)?;
    for position_m in design.array.positions_m.iter_mut().flatten() {
        *position_m *= 0.5;
    }
    forces_over(&design, HALF_M, samples, height_m)
}

/// The same of a surface as wide as the array, from its outermost axes on: three by three coils are as
/// wide as the surface of [`forces`], and of more it is stretched along x and y.
///
/// # Errors
/// As [`forces`].
pub fn forces_over_all(
    design: &BuiltIn,
    side: usize,
    samples: usize,
    height_m: fn(f64, f64) -> f64,
) -> Result<Forces, RunError> {
    let half_m = 0.5 * (side.max(2) - 1) as f64 * PITCH_M;
    let stretch = HALF_M / half_m;
    let design = with_coils(design, side)?;
    forces_over(&design, half_m, samples, |x, y| {
        height_m(stretch * x, stretch * y)
    })
}

fn forces_over(
    design: &Design,
    half_m: f64,
    samples: usize,
    height_m: impl Fn(f64, f64) -> f64,
) -> Result<Forces, RunError> {
    let scene = Scene::new(design)?;
    let solved = steel::solve(&scene, scene.tolerances.field, 0.03)?;
    let line = Axis {
        from: -half_m,
        to: half_m,
        samples,
    }
    .nodes();
    let height_m = &height_m;
    let points: Vec<[f64; 3]> = line
        .iter()
        .flat_map(|&y| line.iter().map(move |&x| [x, y, height_m(x, y)]))
        .collect();
    Ok(Forces {
        forces_n_per_a: scene.forces_n_per_a(&solved, &points, &Silent)?,
        height_m: points.iter().map(|p| p[2]).collect(),
        lower_a: scene.lower_a.clone(),
        upper_a: scene.upper_a.clone(),
        total_max_a: design.supply.total_current_max_a,
        resistance_ohm: scene.resistances_ohm(),
    })
}
