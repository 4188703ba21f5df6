//! The error budget of a bundle: what is chosen for a requested error, and what a runtime adds to
//! lambda's own.

use super::Calibration;
use super::needed_map::{NeededMap, needed_nodes};
use crate::RunError;
use crate::bundle::headline::BudgetName;
use crate::bundle::lambda_file::LambdaFile;
use crate::commands::discretize::between_points::between_points;
use crate::commands::discretize::fewest_points::fewest_divisions;
use crate::commands::discretize::{OpenedSurface, PointsOptions, PointsReport};
use crate::commands::lambda::LambdaReport;
use crate::commands::lambda::error_target::{ChosenGrid, ErrorTarget, Trial};
use crate::commands::lambda::map_error::MapEffect;
use crate::commands::map::fewest_nodes::fewest_nodes;
use crate::design::Design;
use crate::map::tabulate::Grid;
use crate::progress::Progress;
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

    /// The part of the maps that the object needs, and the design with its nodes: as few as hold the requested error
    /// where they are chosen for it, the design's own otherwise.
    pub(super) fn map(
        &self,
        search: Option<&(ErrorTarget, ChosenGrid)>,
        lambda: &LambdaReport,
        points: &ConstraintPoints,
        progress: &dyn Progress,
    ) -> Result<(Design, NeededMap), RunError> {
        let scene = self.scene;
        let made = |design: &Design| {
            let solved = (&self.solved.map, self.force().direction.is_vector());
            let grid = (design, points, self.options.reach_m);
            NeededMap::new(scene, solved, self.field, grid, progress)
        };
        let chooses = |target: &ErrorTarget| target.refine || !scene.design.workspace.is_given;
        let target = search.map(|(target, _)| *target).filter(chooses);
        let headline = lambda.file.headline.as_ref();
        let solution = headline.zip(lambda.file.currents_a.as_deref());
        let Some((target, (headline, currents_a))) = target.zip(solution) else {
            return Ok((scene.design.clone(), made(scene.design)?));
        };
        let effect = self.map_effect(points, headline.lambda_n_per_m, currents_a);
        let places = effect.choosing_places();
        let over = |error: f64| error / target.of_interpolation();
        let with = |grid: &Grid| {
            let samples = [&grid.x_m, &grid.y_m, &grid.z_m].map(Vec::len);
            scene.design.with_nodes(samples)
        };
        let tabulated = |grid: &Grid| needed_nodes(&with(grid), points, self.options.reach_m);
        let (grid, needed) = fewest_nodes(scene, tabulated, |grid| {
            progress.check()?;
            let of_few = over(effect.interpolation_at(&places, grid, progress)?);
            if of_few > 1.0 {
                return Ok((of_few, None));
            }
            // Few places miss the largest error: the map itself decides.
            let needed = made(&with(grid))?;
            let of_map = effect.interpolation(&needed.made, progress)?;
            let of_map = of_map.map_or(0.0, |part| over(part.error));
            Ok((of_map, Some(needed)))
        })?;
        let design = with(&grid);
        let needed = needed.map_or_else(|| made(&design), Ok)?;
        Ok((design, needed))
    }

    /// The map of a solution against the field, on the surface of `points`.
    fn map_effect<'a>(
        &'a self,
        points: &'a ConstraintPoints,
        lambda_n_per_m: f64,
        currents_a: &'a [f64],
    ) -> MapEffect<'a> {
        MapEffect {
            scene: self.scene,
            solved: &self.solved.forces,
            field: self.field,
            points,
            lambda_n_per_m,
            currents_a,
            vector: self.force().direction.is_vector(),
        }
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
        let points = &heights.discretized.points;
        let effect = self.map_effect(points, headline.lambda_n_per_m, currents_a);
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
