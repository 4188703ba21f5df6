//! The headline of lambda: its error, from the errors that the stages state.

use super::PosedProblem;
use crate::RunError;
use crate::bundle::headline::{BudgetName, BudgetPart, Headline};
use crate::bundle::lambda_file::LambdaFile;
use crate::lambda::GivenForce;
use crate::progress::Progress;
use fluxform_base::least_request::lowest_requested_m;

/// Coils above whose axes the largest force is looked for.
const MOST_COILS: usize = 9;

/// How errors that are relative to the largest gradient at a height count in the requested force: the
/// currents may all be off to the same side.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Amplification {
    /// Sum of the coils' largest forces at the lowest requested height, over the force requested there.
    pub(crate) factor: f64,
}

impl Amplification {
    /// A part of the budget, whose stage states `error` relative to the largest gradient.
    pub(crate) fn part(self, part: BudgetName, error: f64) -> BudgetPart {
        BudgetPart {
            part,
            error: error * self.factor,
            how: format!(
                "the stated error times {:.1}, the largest forces of all coils at the lowest height over \
                 the force requested there",
                self.factor
            ),
        }
    }
}

impl PosedProblem<'_> {
    /// The headline of the result in `file`, as far as it does not depend on a map; `None` without a
    /// lambda above zero. Of errors relative to the largest gradient, also how they count.
    ///
    /// # Errors
    /// Forces that cannot be computed; interruption.
    pub(super) fn headline(
        &self,
        file: &LambdaFile,
        progress: &dyn Progress,
    ) -> Result<Option<(Headline, Amplification)>, RunError> {
        let lambda = file.lambda_n_per_m.filter(|lambda| *lambda > 0.0);
        let (Some(lambda), Some(currents_a)) = (lambda, &file.currents_a) else {
            return Ok(None);
        };
        let Some(lowest_m) = lowest_requested_m(self.unwired.height_m.iter().copied()) else {
            return Ok(None);
        };
        let amplification = Amplification {
            factor: self.largest_n(currents_a, lowest_m, progress)? / (lambda * lowest_m),
        };
        let stage = |name: &str| file.accuracy.get(name);
        let as_stated = |part, name: &str| {
            stage(name).map(|stage| BudgetPart {
                part,
                error: stage.estimate,
                how: stage.method.clone(),
            })
        };
        let mut budget: Vec<BudgetPart> = [
            as_stated(BudgetName::Points, "lambda_of_points"),
            as_stated(BudgetName::Heights, "lambda_of_heights"),
            as_stated(BudgetName::Solution, "lambda"),
        ]
        .into_iter()
        .flatten()
        .collect();
        budget.extend(file.working_point.as_ref().map(|point| BudgetPart {
            part: BudgetName::Saturation,
            error: point.deviation_from_linear,
            how: "largest difference of the forces along the B-H curve at the chosen currents from those that \
                  lambda was solved with, relative to the largest"
                .to_owned(),
        }));
        let forces = stage("forces").map_or(0.0, |stage| stage.estimate);
        budget.push(amplification.part(BudgetName::Forces, forces));
        if let (Some(pull), Some(offset_n)) = (stage("passive_force"), self.unwired.offset_n) {
            let heights = self.unwired.height_m.iter();
            let shares = offset_n
                .iter()
                .zip(heights)
                .filter(|(_, h)| **h >= lowest_m);
            let share = shares.map(|(pull_n, h)| pull_n.abs() / (lambda * h));
            budget.push(BudgetPart {
                part: BudgetName::Pull,
                error: pull.estimate * share.fold(0.0, f64::max),
                how: "the pull's stated error, times its largest share of the requested force"
                    .to_owned(),
            });
        }
        let feedback = GivenForce::with_feedback(&self.problem, lambda)?;
        let headline = Headline::new(lambda, file.given_force, feedback, budget);
        Ok(Some((headline, amplification)))
    }

    /// The sum of the coils' largest forces at the height `z_m`, each with its current, N.
    fn largest_n(
        &self,
        currents_a: &[f64],
        z_m: f64,
        progress: &dyn Progress,
    ) -> Result<f64, RunError> {
        let coils = self.scene.coils.len();
        let every = coils.div_ceil(MOST_COILS).max(1);
        let axes = self.scene.coils.iter().step_by(every);
        let places: Vec<[f64; 3]> = axes
            .map(|coil| [coil.axis_m[0], coil.axis_m[1], z_m])
            .collect();
        let forces =
            self.field
                .forces_n_per_a("axes", self.scene, self.solved, &places, progress)?;
        let largest = |coil: usize| {
            let rows = forces.chunks_exact(coils).map(|row| row[coil].abs());
            rows.fold(0.0, f64::max)
        };
        // A coil whose axis is not among them is as strong as those that are.
        let strongest = (0..coils).map(largest).fold(0.0, f64::max);
        Ok(currents_a
            .iter()
            .enumerate()
            .map(|(coil, current)| {
                let most = if coil % every == 0 {
                    largest(coil)
                } else {
                    strongest
                };
                current.abs() * most
            })
            .sum())
    }
}
