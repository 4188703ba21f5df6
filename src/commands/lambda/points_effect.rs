//! The effect of the constraint points on the force constant: of their number, and of the error of
//! their heights.
//!
//! Their number: lambda against the limit of ever more points (`lambda::limit`). Their heights: the
//! error of the surface itself (tessellation, rounding) moves surface and magnet together. Points are
//! lifted and the problem is solved again with the forces there: a first-order estimate, because the
//! errors of single points need not agree.

use super::points::ForcesAt;
use super::{ForcePoints, LambdaOptions, PosedProblem};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::force_direction::RequestedForce;
use crate::lambda::{self, Criterion, ForceProblem};
use crate::numerics::spread::spread;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::steel::Solved;

/// Points are lifted by this share of the lowest height: small enough for first order, and large
/// beside what forces are rounded to.
const LIFTED_BY: f64 = 1e-3;
/// Of more points than this many, and than the coils, so many are taken: some of them, lifted and not, show a shift of
/// all as well.
const ENOUGH_POINTS: usize = 600;

impl PosedProblem<'_> {
    /// What the points may add to the error of the chosen `lambda_n_per_m`, by the names of the stages.
    ///
    /// # Errors
    /// A problem that cannot be solved; interruption.
    pub(super) fn effects_of_points(
        &self,
        lambda_n_per_m: Option<f64>,
        progress: &dyn Progress,
    ) -> Result<Vec<(String, StageAccuracy)>, RunError> {
        let number = self.effect_of_number(lambda_n_per_m, progress)?;
        let heights = self.effect_of_heights(progress)?;
        let effects = [("lambda_of_points", number), ("lambda_of_heights", heights)];
        let known = effects.into_iter();
        Ok(known
            .filter_map(|(name, stage)| Some((name.to_owned(), stage?)))
            .collect())
    }

    /// How far lambda is from the limit of ever more points; `None` without a lambda, for graded
    /// points, whose patches are compared with wider ones instead, and for too few points.
    fn effect_of_number(
        &self,
        lambda_n_per_m: Option<f64>,
        progress: &dyn Progress,
    ) -> Result<Option<StageAccuracy>, RunError> {
        let Some(lambda) = lambda_n_per_m.filter(|lambda| *lambda > 0.0) else {
            return Ok(None);
        };
        let with = (&self.options.wiring, &self.options.settings);
        let problems = (&self.problem, &self.unwired);
        let at = ForcesAt {
            scene: self.scene,
            solved: self.solved,
            field: self.field,
            progress,
        };
        let found = (self.points).error_against_limit(lambda, problems, with, at)?;
        let compared = match self.options.settings.criterion {
            Criterion::Maxmin => {
                "the force between the points with the currents that hold it there"
            }
            Criterion::Linear | Criterion::Jnd | Criterion::Saturation => {
                "every second point in four ways"
            }
        };
        Ok(found.map(|estimate| StageAccuracy {
            estimate,
            relative_to: "lambda".to_owned(),
            method: format!(
                "an estimate against the limit of ever more points: what {compared} and finer samples of broken cells \
                 change{}{}",
                if self.problem.weights.is_some() {
                    ""
                } else {
                    ", and what weights by area would"
                },
                if self.points.raised().is_empty() {
                    ""
                } else {
                    ", and the heights of samples that are lower than every point, taken as the lowest"
                }
            ),
        }))
    }

    /// How far lambda moves with the error of the heights at the points; `None` without a lambda.
    fn effect_of_heights(
        &self,
        progress: &dyn Progress,
    ) -> Result<Option<StageAccuracy>, RunError> {
        let error_m = self.points.heights_error_m();
        let step_m = LIFTED_BY * self.points.lowest_m();
        if step_m.is_nan() || step_m <= 0.0 || error_m <= 0.0 {
            return Ok(None);
        }
        let unwired = &self.unwired;
        let number = unwired.height_m.len();
        let chosen = spread(number, ENOUGH_POINTS.max(unwired.coils()));
        let of = |values: &[f64]| rows_of(values, 1, &chosen);
        let here = rows_of(unwired.forces_n_per_a, unwired.coils(), &chosen);
        let mut lifted_m = rows_of(&self.points.positions_m, 1, &chosen);
        // Lifted only: the steel's solution was made for the points and above.
        lifted_m.iter_mut().for_each(|at| at[2] += step_m);
        let there =
            self.field
                .forces_n_per_a("lifted", self.scene, self.solved, &lifted_m, progress)?;
        let height_m = of(unwired.height_m);
        let lifted_height_m: Vec<f64> = lifted_m.iter().map(|at| at[2]).collect();
        let offset_n = unwired.offset_n.map(of);
        let weights = unwired.weights.map(of);
        let lambda = |forces_n_per_a: &[f64], height_m: &[f64]| {
            let problem = ForceProblem {
                forces_n_per_a,
                height_m,
                offset_n: offset_n.as_deref(),
                weights: weights.as_deref(),
                ..*unwired
            };
            let voltage_v = self.scene.design.supply.voltage_v;
            let rewired = self.options.wiring.apply(&problem, voltage_v);
            lambda::constant(&rewired.problem(&problem), &self.options.settings)
        };
        let (here, there) = rayon::join(
            || lambda(&here, &height_m),
            || lambda(&there, &lifted_height_m),
        );
        let (Some(here), Some(there)) = (here?, there?) else {
            return Ok(None);
        };
        if here <= 0.0 {
            return Ok(None);
        }
        let all = if chosen.len() == number {
            "all points".to_owned()
        } else {
            format!("{} of the points", chosen.len())
        };
        Ok(Some(StageAccuracy {
            estimate: (there / here - 1.0).abs() * (error_m / step_m),
            relative_to: "lambda".to_owned(),
            method: format!(
                "an estimate: {all} lifted, forces and lambda computed again, to first order in the \
                 heights' error (tessellation, rounding)"
            ),
        }))
    }
}

/// What the number of the points and the errors of their heights may add to the error of
/// `lambda_n_per_m`, which solves `problem` at all of them, every coil by itself; relative.
///
/// # Errors
/// A problem that cannot be solved; interruption.
pub(crate) fn error_of_points(
    (scene, solved): (&Scene, &Solved),
    (points, problem): (&ForcePoints, ForceProblem),
    options: &LambdaOptions,
    lambda_n_per_m: f64,
    progress: &dyn Progress,
) -> Result<f64, RunError> {
    let posed = PosedProblem {
        scene,
        solved,
        field: ShapeField::default(),
        points,
        options,
        unwired: problem,
        problem,
        force: RequestedForce::default(),
    };
    let effects = posed.effects_of_points(Some(lambda_n_per_m), progress)?;
    Ok(effects.iter().map(|(_, stage)| stage.estimate).sum())
}

/// The `chosen` rows of `width` values each.
fn rows_of<T: Copy>(values: &[T], width: usize, chosen: &[usize]) -> Vec<T> {
    let rows = chosen
        .iter()
        .map(|row| &values[row * width..(row + 1) * width]);
    rows.flatten().copied().collect()
}
