//! Points for a requested error: as few as hold it.

pub use crate::scene::tolerances::ErrorTarget;

use super::LambdaOptions;
use super::LambdaReport;
use super::points::{ForcePoints, ForcesAt};
use crate::RunError;
use crate::bundle::headline::{RequestedError, RunAtError};
use crate::commands::discretize::fewest_points::{SMOOTH, fewest_points};
use crate::commands::discretize::{OpenedSurface, PointsOptions};
use crate::design::Workspace;
use crate::lambda::{ForceProblem, constant};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cached_field::ShapeField;
use crate::scene::passive;
use crate::scene::steel::Solved;
use crate::shape::certificate::Certify;
use crate::shape::document::{AxisRequest, ShapeDocument};

/// Other errors for which a run is estimated, against this one's.
const ELSEWHERE: [f64; 2] = [0.1, 10.0];
/// The order with which the map's interpolation falls.
const MAP_ORDER: f64 = 4.0;

/// The grid that was chosen.
#[derive(Debug, Clone)]
pub(crate) struct ChosenGrid {
    /// The shape with that grid.
    pub(crate) document: ShapeDocument,
    /// Whether documents or flags gave it.
    pub(crate) fixed: bool,
    /// With which power of the spacing the error fell.
    order: f64,
}

/// The problem on which numbers of points are tried.
#[derive(Clone, Copy)]
pub(crate) struct Trial<'a> {
    pub(crate) scene: &'a Scene<'a>,
    pub(crate) solved: &'a Solved,
    pub(crate) field: ShapeField<'a>,
    pub(crate) options: &'a LambdaOptions,
    /// Whether a runtime takes parts of the budget.
    pub(crate) for_runtime: bool,
}

impl Trial<'_> {
    /// The grid of `document` for the requested error: its own where it gives one.
    ///
    /// # Errors
    /// Points or forces that cannot be computed; interruption.
    pub(crate) fn grid(
        &self,
        document: &ShapeDocument,
        opened: &OpenedSurface,
        target: ErrorTarget,
        progress: &dyn Progress,
    ) -> Result<ChosenGrid, RunError> {
        let mut chosen = ChosenGrid {
            document: document.clone(),
            fixed: document.grid_is_given && !target.refine,
            order: SMOOTH,
        };
        if chosen.fixed {
            return Ok(chosen);
        }
        let free = ShapeDocument {
            grid_is_given: false,
            ..document.clone()
        };
        let asked = (self.options, target, self.for_runtime);
        let cached = (self.field).search(
            "points",
            &free,
            opened.inputs(),
            &(self.scene.design, asked),
        );
        let (samples, order) = cached.remember(|| {
            fewest_points(&free, target, progress, |document| {
                self.excess(opened, document, target, progress)
            })
        })?;
        (chosen.document, chosen.order) = (free.with_samples(samples), order);
        Ok(chosen)
    }

    /// How many times the points of `document` exceed what they may add; `None` where nothing is
    /// rendered.
    fn excess(
        &self,
        opened: &OpenedSurface,
        document: &ShapeDocument,
        target: ErrorTarget,
        progress: &dyn Progress,
    ) -> Result<Option<f64>, RunError> {
        let (scene, options) = (self.scene, self.options);
        // Heights between the points are held to a share of their own.
        let heights_alone = PointsOptions {
            certify: Certify::No,
            ..PointsOptions::default()
        };
        let report = opened.discretize(document, &heights_alone, None, progress)?;
        let points = ForcePoints::of_object(
            &report,
            options.weights_of(&report),
            &scene.design.workspace,
        );
        let positions = &points.positions_m;
        let forces_n_per_a =
            (self.field).tried_forces_n_per_a(scene, self.solved, positions, progress)?;
        let pull = passive::counted(scene, positions)?;
        let offset_n = pull.map(|pull| pull.forces_z_n(positions));
        let resistance_ohm = scene.resistances_ohm();
        let unwired = ForceProblem {
            forces_n_per_a: &forces_n_per_a,
            height_m: &points.height_m,
            offset_n: offset_n.as_deref(),
            weights: points.weights(),
            lower_a: &scene.lower_a,
            upper_a: &scene.upper_a,
            total_max_a: scene.design.supply.total_current_max_a,
            resistance_ohm: &resistance_ohm,
        };
        let rewired = (options.wiring).apply(&unwired, scene.design.supply.voltage_v);
        let problem = rewired.problem(&unwired);
        let lambda = constant(&problem, &options.settings)?;
        let Some(lambda) = lambda.filter(|lambda| *lambda > 0.0) else {
            return Ok(None);
        };
        // Too few points to say.
        let with = (&options.wiring, &options.settings);
        let at = ForcesAt {
            scene,
            solved: self.solved,
            // Later runs have no use for the field of a trial.
            field: ShapeField::default(),
            progress,
        };
        let of_points = points
            .error_against_limit(lambda, (&problem, &unwired), with, at)?
            .unwrap_or(1.0);
        Ok(Some(of_points / target.of_points(self.for_runtime)))
    }
}

impl LambdaReport {
    /// Warns where the computation may add more than the `default` that a shape is held to which leaves its
    /// points to the program, as this one does not.
    fn warn_beyond_default(&mut self, default: Option<f64>) {
        let (Some(error), Some(headline)) = (default, &self.file.headline) else {
            return;
        };
        if headline.force_error <= error {
            return;
        }
        let target = ErrorTarget {
            error,
            refine: false,
            by_default: true,
        };
        let cause = headline
            .budget
            .first()
            .map_or("nothing", |part| part.part.words());
        let advice = format!(
            ", most of it from {cause}; the shape gives its points, which are obeyed (--error 1% --refine chooses them)"
        );
        let warning = target.exceeded("the computation may add", headline.force_error, &advice);
        self.warnings.push(warning);
    }

    /// States what became of the error that a grid was chosen for, with a warning where it is exceeded; of a grid
    /// that was not chosen a warning where it costs more than the `default`. `runtime` is the map's workspace and
    /// the nodes of the heights, where there are any.
    pub(crate) fn requested(
        &mut self,
        search: Option<&(ErrorTarget, ChosenGrid)>,
        default: Option<f64>,
        runtime: Option<(&Workspace, [usize; 2])>,
        tolerance: f64,
    ) {
        let Some((target, chosen)) = search else {
            return self.warn_beyond_default(default);
        };
        let Some(headline) = &mut self.file.headline else {
            return;
        };
        let samples = [chosen.document.grid.x, chosen.document.grid.y].map(AxisRequest::samples);
        let (workspace, heights) = runtime.unzip();
        let nodes = workspace.map(|w| [w.x_m, w.y_m, w.z_m].map(|axis| axis.samples));
        let nodes_fixed = workspace.is_some_and(|w| w.is_given && !target.refine);
        let mut fixed = Vec::new();
        if chosen.fixed {
            fixed.push(
                "the shape gives its points, which are obeyed (--refine chooses them)".to_owned(),
            );
        }
        if nodes_fixed {
            fixed.push(
                "the design gives the nodes of [workspace], which are obeyed (--refine chooses them)"
                    .to_owned(),
            );
        }
        let met = headline.force_error <= target.error;
        let all_fixed = chosen.fixed && (nodes_fixed || nodes.is_none());
        let others = ELSEWHERE
            .into_iter()
            .filter(|share| !all_fixed && ErrorTarget::RANGE.contains(&(share * target.error)));
        let elsewhere = others.map(|share| {
            let scaled = |samples: usize, order: f64, fixed: bool| match samples {
                1 => 1,
                same if fixed => same,
                more => (((more - 1) as f64 * share.powf(-1.0 / order)).ceil() as usize + 1).max(5),
            };
            let points = samples.map(|n| scaled(n, chosen.order, chosen.fixed));
            let other = nodes.map(|nodes| nodes.map(|n| scaled(n, MAP_ORDER, nodes_fixed)));
            let count = |points: [usize; 2], nodes: Option<[usize; 3]>| {
                let product =
                    |samples: &[usize]| samples.iter().map(|n| *n as f64).product::<f64>();
                product(&points) + nodes.map_or(0.0, |nodes| product(&nodes))
            };
            RunAtError {
                error: share * target.error,
                points,
                nodes: other,
                work: count(points, other) / count(samples, nodes),
            }
        });
        let over = (!met).then(|| {
            let cause = headline
                .budget
                .first()
                .map_or("nothing", |part| part.part.words());
            let cause = std::iter::once(format!(", most of it from {cause}"));
            let advice: Vec<String> = cause.chain(fixed.iter().cloned()).collect();
            target.exceeded(
                "the computation may add",
                headline.force_error,
                &advice.join("; "),
            )
        });
        headline.requested = Some(RequestedError {
            by_default: target.by_default,
            error: target.error,
            met,
            fixed,
            points: samples,
            heights,
            nodes,
            tolerance,
            elsewhere: elsewhere.collect(),
        });
        self.warnings.extend(over);
    }
}
