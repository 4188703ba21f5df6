//! `lambda --feedback`: the same object with currents of their own at every point.

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::lambda_file::{
    FeedbackFile, FeedbackPlace, FeedbackRendering, FeedbackShell, StaticRendering,
};
use crate::lambda::feedback::{
    Decided, FeedbackError, NoLambda, Rendered, Span, dip_between, reachable, render,
};
use crate::lambda::{ForceProblem, OperatingPoint, Wiring};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::passive;
use crate::scene::steel::Solved;

use super::points::WantedPoints;

/// Layers of a shell lie no further apart, m.
const SPACING_M: f64 = 2e-3;
/// Layers above the surface, at most: a shell is no search of all space.
const MOST_LAYERS: f64 = 500.0;

/// What is asked.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedbackOptions {
    /// How far above and below the surface the same demand is to be met, m (> 0).
    pub shell_m: Option<f64>,
}

impl FeedbackOptions {
    /// The lowest place looked at over a surface whose lowest point is given, m: not below the
    /// workspace, but for points that are.
    pub(super) fn lowest_m(self, scene: &Scene, lowest_m: f64) -> f64 {
        let floor_m = floor_m(scene, lowest_m);
        (lowest_m - self.shell_m.unwrap_or(0.0)).max(floor_m)
    }
}

fn floor_m(scene: &Scene, lowest_m: f64) -> f64 {
    scene.design.workspace.z_m.from.min(lowest_m)
}

/// A solved object, to be rendered with feedback.
pub(super) struct Rendering<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) solved: &'a Solved,
    pub(super) points: &'a WantedPoints,
    /// The problem with every coil by itself.
    pub(super) given: &'a ForceProblem<'a>,
    /// The same as wired.
    pub(super) problem: &'a ForceProblem<'a>,
    pub(super) wiring: &'a Wiring,
    /// The static currents, one a coil of the array.
    pub(super) chosen: Option<&'a OperatingPoint>,
}

/// What there is to say.
pub(super) struct Told {
    pub(super) file: FeedbackFile,
    /// With a shell: what is not known between its layers.
    pub(super) between_layers: Option<StageAccuracy>,
    /// Force at each point at the chosen lambda, N; empty without one.
    pub(super) forces_n: Vec<f64>,
}

impl Rendering<'_> {
    /// Everything told of feedback.
    ///
    /// # Errors
    /// Places that cannot be computed; interruption.
    pub(super) fn told(
        &self,
        asked: &FeedbackOptions,
        progress: &dyn Progress,
    ) -> Result<Told, RunError> {
        let mut span = Span::default();
        span.add(self.problem.height_m, &reachable(self.problem)?);
        let largest = span.largest();
        let at = |lambda| render(self.problem, lambda).map_err(of_render);
        let chosen = self.chosen.map(|chosen| at(chosen.lambda_n_per_m));
        let mut chosen = chosen.transpose()?;
        let forces_n = chosen.as_mut().map(|r| std::mem::take(&mut r.forces_n));
        let own = largest.ok().map(|found| at(found.lambda_n_per_m));
        let shell = asked.shell_m.map(|reach| self.shell(reach, progress));
        let (shell, stage) = shell.transpose()?.unzip();
        let (lambda_n_per_m, reason) = in_words(largest);
        let file = FeedbackFile {
            lambda_n_per_m,
            reason,
            smallest_lambda_n_per_m: span.smallest_n_per_m(),
            decided_at: largest.ok().map(|found| FeedbackPlace {
                point: found.point,
                position_m: self.points.positions_m[found.point],
            }),
            without: self.chosen.map(|chosen| self.fixed(chosen)),
            at_chosen: chosen.map(|r| self.rendering(r)),
            at_largest: own.transpose()?.map(|r| self.rendering(r)),
            shell,
        };
        Ok(Told {
            file,
            between_layers: stage.flatten(),
            forces_n: forces_n.unwrap_or_default(),
        })
    }

    fn fixed(&self, chosen: &OperatingPoint) -> StaticRendering {
        let currents = &chosen.currents_a;
        let ohm = self.scene.resistances_ohm();
        StaticRendering {
            lambda_n_per_m: chosen.lambda_n_per_m,
            rms_error_n: chosen.rms_error_n,
            worst_error_n: chosen.worst_error_n,
            largest_current_a: currents.iter().fold(0.0, |most, i| most.max(i.abs())),
            power_w: currents.iter().zip(&ohm).map(|(i, ohm)| i * i * ohm).sum(),
        }
    }

    fn rendering(&self, mut found: Rendered) -> FeedbackRendering {
        let lists = [
            &mut found.current_max_a,
            &mut found.current_rms_a,
            &mut found.active_share,
        ];
        lists.into_iter().for_each(|list| self.wiring.spread(list));
        FeedbackRendering {
            lambda_n_per_m: found.lambda_n_per_m,
            rms_error_n: found.rms_error_n,
            worst_error_n: found.worst_error_n,
            points_unreached: found.unreached,
            mean_power_w: found.mean_power_w,
            max_power_w: found.max_power_w,
            largest_current_a: found.current_max_a.iter().copied().fold(0.0, f64::max),
            current_max_a: found.current_max_a,
            current_rms_a: found.current_rms_a,
            active_share: found.active_share,
            active_mean: found.active_mean,
            active_min: found.active_min,
            active_max: found.active_max,
        }
    }

    /// The force constant that can be given within `reach_m` above and below the surface.
    fn shell(
        &self,
        reach_m: f64,
        progress: &dyn Progress,
    ) -> Result<(FeedbackShell, Option<StageAccuracy>), RunError> {
        // Two steps at a time up and down, so that every second layer holds both ends too.
        let pairs = (reach_m / (2.0 * SPACING_M) * (1.0 - 1e-12)).ceil();
        if pairs > 0.5 * MOST_LAYERS {
            return Err(RunError::Input(format!(
                "--shell {} mm is more than {} mm: no finger leaves a surface so far",
                reach_m * 1e3,
                MOST_LAYERS * SPACING_M * 1e3
            )));
        }
        let steps = 2 * pairs.max(1.0) as usize;
        let floor_m = floor_m(self.scene, self.points.lowest_m());
        let height_m = self.problem.height_m;
        let layer = |k: usize| -> Vec<[f64; 3]> {
            let lift_m = reach_m * (k as f64 / steps as f64 - 1.0);
            let lifted = |p: &[f64; 3]| [p[0], p[1], (p[2] + lift_m).max(floor_m)];
            self.points.positions_m.iter().map(lifted).collect()
        };
        let below = |k: usize| {
            let lift_m = reach_m * (k as f64 / steps as f64 - 1.0);
            let heights = self.points.height_m.iter();
            heights.filter(|h| **h + lift_m < floor_m).count()
        };
        let layers = 2 * steps + 1;
        let pull = if self.problem.offset_n.is_some() {
            let ends = [layer(0), layer(layers - 1)].concat();
            passive::pull(self.scene, &ends, false)?
        } else {
            None
        };
        let (mut all, mut every_second) = (Span::default(), Span::default());
        let mut limits = Vec::with_capacity(layers);
        for k in 0..layers {
            let places = layer(k);
            let forces = self.scene.forces_n_per_a(self.solved, &places, progress)?;
            let offset_n = pull.as_ref().map(|pull| pull.forces_z_n(&places));
            let given = ForceProblem {
                forces_n_per_a: &forces,
                offset_n: offset_n.as_deref(),
                ..*self.given
            };
            let rewired = self.wiring.apply(&given);
            let reach = reachable(&rewired.problem(&given))?;
            all.add(height_m, &reach);
            if k % 2 == 0 {
                every_second.add(height_m, &reach);
            }
            let of_height = |(most, h): (&f64, &f64)| most / h;
            let felt = reach.most_n.iter().zip(height_m).filter(|(_, h)| **h > 0.0);
            limits.push(felt.map(of_height).collect());
        }
        let largest = all.largest();
        let (lambda_n_per_m, reason) = in_words(largest);
        let coarse = every_second
            .largest()
            .ok()
            .map(|found| found.lambda_n_per_m);
        let stage = lambda_n_per_m.map(|lambda| {
            let missed = coarse.map_or(0.0, |coarse| coarse - lambda);
            StageAccuracy {
                estimate: missed.max(dip_between(&limits)) / lambda,
                relative_to: "lambda of the shell".to_owned(),
                method: "an estimate: what every second layer misses, or parabolas through \
                         three neighbours fall below the layers, whichever is more"
                    .to_owned(),
            }
        });
        let shell = FeedbackShell {
            reach_m,
            layers,
            spacing_m: reach_m / steps as f64,
            floor_m,
            clipped: (0..layers).map(below).sum(),
            places: layers * height_m.len(),
            lambda_n_per_m,
            reason,
            smallest_lambda_n_per_m: all.smallest_n_per_m(),
            every_second_lambda_n_per_m: coarse,
            decided_at: largest.ok().map(|found| FeedbackPlace {
                point: found.point,
                position_m: layer(found.layer)[found.point],
            }),
        };
        Ok((shell, stage))
    }
}

fn in_words(largest: Result<Decided, NoLambda>) -> (Option<f64>, Option<String>) {
    match largest {
        Ok(found) => (Some(found.lambda_n_per_m), None),
        Err(why) => (None, Some(why.to_string())),
    }
}

fn of_render(error: FeedbackError) -> RunError {
    match error {
        FeedbackError::Problem(problem) => problem.into(),
        FeedbackError::Allocator(limits) => RunError::Input(limits.to_string()),
    }
}
