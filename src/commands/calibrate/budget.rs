//! The error budget of a bundle: what is chosen for a requested error, and what a runtime adds to
//! lambda's own.

use super::Calibration;
use super::needed_map::NeededMap;
use crate::RunError;
use crate::bundle::headline::BudgetName;
use crate::bundle::lambda_file::LambdaFile;
use crate::commands::discretize::between_points::between_points;
use crate::commands::discretize::fewest_points::fewest_divisions;
use crate::commands::discretize::{OpenedSurface, PointsOptions, PointsReport};
use crate::commands::lambda::LambdaReport;
use crate::commands::lambda::error_target::{ChosenGrid, ErrorTarget, Trial};
use crate::commands::lambda::map_error::MapEffect;
use crate::progress::Progress;
use crate::scene::cached_field::ShapeField;
use crate::scene::passive_map::PassiveMap;
use crate::shape::certificate::Certify;
use crate::shape::points::ConstraintPoints;

impl Calibration<'_> {
    /// The grid for the requested error, where there is one.
    pub(super) fn search(
        &self,
        opened: &OpenedSurface,
        progress: &dyn Progress,
    ) -> Result<Option<(ErrorTarget, ChosenGrid)>, RunError> {
        let Some(target) = self.options.lambda.error else {
            return Ok(None);
        };
        let trial = Trial {
            scene: self.scene,
            solved: &self.solved.forces,
            field: self.field,
            options: &self.options.lambda,
            for_runtime: true,
        };
        let chosen = trial.grid(&self.shape.document, opened, target, progress)?;
        Ok(Some((target, chosen)))
    }

    /// The heights between which a runtime interpolates, where its share of the requested error needs more of them
    /// than lambda needs points: every interval of the points' grid is divided.
    pub(super) fn heights(
        &self,
        opened: &OpenedSurface,
        search: Option<&(ErrorTarget, ChosenGrid)>,
        progress: &dyn Progress,
    ) -> Result<Option<PointsReport>, RunError> {
        let Some((target, chosen)) = search.filter(|(_, chosen)| !chosen.fixed) else {
            return Ok(None);
        };
        let cached = (self.field).search("heights", &chosen.document, opened.inputs(), target);
        let samples = cached.remember(|| {
            fewest_divisions(&chosen.document, progress, |tried| {
                let between = opened.between_points(tried, &PointsOptions::default(), progress)?;
                Ok(between.map(|error| error / target.between_points()))
            })
        })?;
        let divided = chosen.document.with_samples(samples);
        if divided.grid == chosen.document.grid {
            return Ok(None);
        }
        // Creases decide in which direction a force along the normal points there.
        let marks = self.force().along_normal().is_some();
        let heights_alone = PointsOptions {
            marks,
            certify: Certify::No,
            ..PointsOptions::default()
        };
        let uncertified = opened.discretize(&divided, &heights_alone, None, progress)?;
        // Where the surface jumps no certificate decides how far heights are off.
        if between_points(&uncertified).1.is_some() {
            return Ok(Some(uncertified));
        }
        opened
            .discretize_cached(("heights", &divided, marks), self.field, progress)
            .map(Some)
    }

    /// The workspace's samples for the requested error; `None`: the design's own.
    pub(super) fn nodes(
        &self,
        search: Option<&(ErrorTarget, ChosenGrid)>,
        lambda: &LambdaReport,
        points: &ConstraintPoints,
        progress: &dyn Progress,
    ) -> Result<Option<[usize; 3]>, RunError> {
        let design = self.scene.design;
        let (Some((target, _)), Some(currents_a)) = (search, &lambda.file.currents_a) else {
            return Ok(None);
        };
        let Some(headline) = &lambda.file.headline else {
            return Ok(None);
        };
        if design.workspace.is_given && !target.refine {
            return Ok(None);
        }
        let effect = MapEffect {
            scene: self.scene,
            solved: &self.solved.forces,
            field: ShapeField::default(),
            points,
            lambda_n_per_m: headline.lambda_n_per_m,
            currents_a,
            vector: self.force().direction.is_vector(),
        };
        effect.nodes(target.of_interpolation(), progress).map(Some)
    }

    /// Adds the runtime's part of the error: heights and forces between points and nodes.
    pub(super) fn add_to_headline(
        &self,
        lambda: &mut LambdaReport,
        heights: &PointsReport,
        needed: &NeededMap,
        passive: Option<&PassiveMap>,
        progress: &dyn Progress,
    ) -> Result<(), RunError> {
        let of_pull = passive_estimate(&lambda.file);
        let currents_a = lambda.file.currents_a.as_deref();
        let (Some(currents_a), Some(amplification)) = (currents_a, lambda.amplification) else {
            return Ok(());
        };
        let Some(headline) = &mut lambda.file.headline else {
            return Ok(());
        };
        let effect = MapEffect {
            scene: self.scene,
            solved: &self.solved.forces,
            field: self.field,
            points: &heights.discretized.points,
            lambda_n_per_m: headline.lambda_n_per_m,
            currents_a,
            vector: self.force().direction.is_vector(),
        };
        let (between, jumps) = between_points(heights);
        let made = &needed.made;
        let nodes = amplification.part(BudgetName::MapNodes, made.accuracy.estimate);
        let interpolation = effect.interpolation(made, progress)?;
        // The stated error at the nodes is of the largest pull, which is relative to the same force.
        let share = headline.error_of(BudgetName::Pull) / of_pull;
        let pull = passive.filter(|_| share.is_finite());
        let pull =
            pull.and_then(|passive| effect.of_pull(passive, share * passive.accuracy.estimate));
        headline.jumps = jumps;
        headline.add(
            [between, Some(nodes), interpolation, pull]
                .into_iter()
                .flatten(),
        );
        Ok(())
    }
}

/// The stated error of the pull at the points.
fn passive_estimate(file: &LambdaFile) -> f64 {
    let stage = file.accuracy.get("passive_force");
    stage.map_or(0.0, |stage| stage.estimate)
}
