//! `lambda --feedback`: the same object with currents of their own at every point.

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::lambda_file::{
    FeedbackFile, FeedbackPlace, LargestGiven, StaticRendering, VectorFeedbackFile,
};
use crate::lambda::feedback::{
    Decided, FeedbackError, NoLambda, Rendered, Span, reachable, render,
};
use crate::lambda::two_fingers::{TwoFingers, two_fingers};
use crate::lambda::vector_feedback::{
    CurrentsOf, VectorProblem, reachable_vectors, render_vectors,
};
use crate::lambda::vector_static::{VectorStatic, sideways_weight, vector_static};
use crate::lambda::{ForceProblem, OperatingPoint, Rewired};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::finger_magnet;
use crate::units::DIRECTION_JND_DEG;

use super::PosedProblem;

/// The options of `--feedback`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedbackOptions {
    /// How far above and below the surface the same demand is to be met, m (> 0).
    pub shell_m: Option<f64>,
    /// Distances of two fingers whose pairs of points are looked at, m (>= 0, ascending).
    pub two_fingers_m: Option<[f64; 2]>,
}

impl FeedbackOptions {
    /// The lowest place looked at over a surface whose lowest point is given, m: not below the
    /// workspace, but for points that are.
    pub(super) fn lowest_m(self, scene: &Scene, lowest_m: f64) -> f64 {
        let floor_m = floor_m(scene, lowest_m);
        (lowest_m - self.shell_m.unwrap_or(0.0)).max(floor_m)
    }
}

pub(super) fn floor_m(scene: &Scene, lowest_m: f64) -> f64 {
    scene.design.workspace.z_m.from.min(lowest_m)
}

/// The result of rendering with feedback.
pub(super) struct WithFeedback {
    pub(super) file: FeedbackFile,
    /// With a shell: the error between its layers.
    pub(super) between_layers: Option<StageAccuracy>,
    /// Force at each point at the chosen lambda, N; empty without one.
    pub(super) forces_n: Vec<f64>,
}

impl PosedProblem<'_> {
    /// The object with currents of their own at every point. `chosen` holds the static currents,
    /// one per coil of the array.
    ///
    /// # Errors
    /// Places that cannot be computed; interruption.
    pub(super) fn feedback(
        &self,
        options: &FeedbackOptions,
        chosen: Option<&OperatingPoint>,
        progress: &dyn Progress,
    ) -> Result<WithFeedback, RunError> {
        let mut span = Span::default();
        let reach = reachable(&self.problem)?;
        span.add(self.problem.height_m, &reach);
        let largest = span.largest();
        let rendered = |lambda| {
            let mut rendered = render(&self.problem, lambda).map_err(render_error)?;
            rendered.spread(&self.options.wiring);
            Ok::<Rendered, RunError>(rendered)
        };
        let at_chosen = chosen.map(|chosen| rendered(chosen.lambda_n_per_m));
        let mut at_chosen = at_chosen.transpose()?;
        let forces_n = at_chosen.as_mut().map(|r| std::mem::take(&mut r.forces_n));
        let at_largest = largest.ok().map(|largest| rendered(largest.lambda_n_per_m));
        let shell = options.shell_m.map(|reach| self.shell(reach, progress));
        let (shell, between_layers) = shell.transpose()?.unzip();
        let file = FeedbackFile {
            largest: largest_given(largest, |at| self.points.positions_m[at.place]),
            smallest_lambda_n_per_m: span.smallest_n_per_m(),
            without: chosen.map(|chosen| self.fixed(chosen)),
            at_chosen,
            at_largest: at_largest.transpose()?,
            shell,
            two_fingers: self.two_fingers(options.two_fingers_m.zip(chosen), progress)?,
            vector: self.vector_feedback(chosen, progress)?,
        };
        Ok(WithFeedback {
            file,
            between_layers: between_layers.flatten(),
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
}

/// The three components of an array's forces as wired, each [point, coil], and the force requested.
struct WiredVectors {
    axes: [Rewired; 3],
    direction: Vec<[f64; 3]>,
}

impl WiredVectors {
    /// # Errors
    /// Places that cannot be computed; interruption.
    fn new(posed: &PosedProblem, progress: &dyn Progress) -> Result<Self, RunError> {
        let positions = &posed.points.positions_m;
        let vectors = (posed.scene).force_vectors_n_per_a(posed.solved, positions, progress)?;
        let axes = [0, 1, 2].map(|axis| {
            let along: Vec<f64> = vectors.iter().map(|force| force[axis]).collect();
            let unwired = ForceProblem {
                forces_n_per_a: &along,
                ..posed.unwired
            };
            (posed.options.wiring).apply(&unwired, posed.scene.design.supply.voltage_v)
        });
        let direction = posed.points.directions(posed.force);
        Ok(Self { axes, direction })
    }

    fn problem<'a>(&'a self, posed: &PosedProblem<'a>) -> VectorProblem<'a> {
        let [of_x, of_y, of_z] = &self.axes;
        VectorProblem {
            upward: of_z.problem(&posed.unwired),
            sides_n_per_a: [of_x, of_y].map(|side| side.problem(&posed.unwired).forces_n_per_a),
            direction: &self.direction,
        }
    }
}

impl PosedProblem<'_> {
    /// The requested force vector with position feedback; `None` where the upward force alone is requested.
    ///
    /// # Errors
    /// Places that cannot be computed; interruption.
    fn vector_feedback(
        &self,
        chosen: Option<&OperatingPoint>,
        progress: &dyn Progress,
    ) -> Result<Option<VectorFeedbackFile>, RunError> {
        let force = self.force;
        if !force.direction.is_vector() {
            return Ok(None);
        }
        let positions = &self.points.positions_m;
        let wired = WiredVectors::new(self, progress)?;
        let problem = wired.problem(self);
        let mut span = Span::default();
        let reach = reachable_vectors(&problem).map_err(render_error)?;
        span.add(problem.upward.height_m, &reach);
        let largest = span.largest();
        let rendered = |lambda: f64, of: CurrentsOf| {
            render_vectors(&problem, lambda, of).map_err(render_error)
        };
        let own = chosen.map(|chosen| self.options.wiring.own(&chosen.currents_a));
        let at_chosen = |of: CurrentsOf| {
            let rendered = chosen.map(|chosen| rendered(chosen.lambda_n_per_m, of));
            rendered.transpose()
        };
        let at_largest = largest
            .ok()
            .map(|l| rendered(l.lambda_n_per_m, CurrentsOf::Vector));
        Ok(Some(VectorFeedbackFile {
            direction: force.direction,
            normal_force: force.along_normal(),
            largest: largest_given(largest, |at| positions[at.place]),
            fixed: at_chosen(CurrentsOf::Static(own.as_deref().unwrap_or_default()))?,
            static_vector: Some(self.static_vector(&problem, chosen)?),
            upward: at_chosen(CurrentsOf::Upward)?,
            vector: at_chosen(CurrentsOf::Vector)?,
            at_largest: at_largest.transpose()?,
        }))
    }
}

impl PosedProblem<'_> {
    /// Pairs of points under two fingers, where they are requested and there is a force constant.
    ///
    /// # Errors
    /// Distances at which the magnets overlap; places that cannot be computed; interruption.
    fn two_fingers(
        &self,
        requested: Option<([f64; 2], &OperatingPoint)>,
        progress: &dyn Progress,
    ) -> Result<Option<TwoFingers>, RunError> {
        let Some((apart_m, chosen)) = requested else {
            return Ok(None);
        };
        let magnet = finger_magnet(self.scene.design);
        if apart_m[1] < magnet.closest_m() {
            let [most, wide, long] =
                [apart_m[1], magnet.diameter_m, magnet.length_m].map(|length_m| length_m * 1e3);
            return Err(RunError::Input(format!(
                "--two-fingers: at most {most} mm apart, magnets {wide} mm wide and {long} mm long overlap"
            )));
        }
        let wired = WiredVectors::new(self, progress)?;
        let found = two_fingers(
            &wired.problem(self),
            &self.points.positions_m,
            magnet,
            chosen.lambda_n_per_m,
            apart_m,
        );
        found.map(Some).map_err(render_error)
    }

    /// Static currents for all three components.
    fn static_vector(
        &self,
        problem: &VectorProblem,
        chosen: Option<&OperatingPoint>,
    ) -> Result<VectorStatic, RunError> {
        let (options, settings) = (self.options, &self.options.settings);
        let noticed_deg = options.direction_jnd_deg.unwrap_or(DIRECTION_JND_DEG);
        let weight = sideways_weight(settings.jnd_weight, noticed_deg);
        let lambda = chosen.map(|chosen| chosen.lambda_n_per_m);
        let mut found = vector_static(problem, weight, settings, lambda).map_err(render_error)?;
        for of in found.own.iter_mut().chain(&mut found.at_chosen) {
            options.wiring.spread(&mut of.currents_a);
            options.wiring.spread(&mut of.worst.currents_a);
        }
        Ok(found)
    }
}

pub(super) fn largest_given(
    largest: Result<Decided, NoLambda>,
    position_m: impl Fn(Decided) -> [f64; 3],
) -> LargestGiven {
    let found = largest.ok();
    LargestGiven {
        lambda_n_per_m: found.map(|found| found.lambda_n_per_m),
        reason: largest.err().map(|why| why.to_string()),
        decided_at: found.map(|found| FeedbackPlace {
            point: found.point,
            position_m: position_m(found),
        }),
    }
}

pub(super) fn render_error(error: FeedbackError) -> RunError {
    match error {
        FeedbackError::Problem(problem) => problem.into(),
        FeedbackError::Allocator(limits) => RunError::Input(limits.to_string()),
    }
}
