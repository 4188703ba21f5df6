//! `lambda.json` from a solution.

use std::collections::BTreeMap;

use super::PosedProblem;
use super::accuracy::forces_accuracy;
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::artefact::{FLUXFORM_VERSION, SCHEMA_VERSION};
use crate::bundle::lambda_file::{
    AtLambda, LambdaFile, PathStep, TolerancePoint, WorstPointAt, WorstPointFile, WorstPointStep,
};
use crate::heating::Heating;
use crate::lambda::worst::{WorstPath, WorstSolution, felt};
use crate::lambda::{Breakpoint, Event, GivenForce, OperatingPoint, Solution, Status};
use crate::units::DETECTION_THRESHOLD_N;

impl PosedProblem<'_> {
    /// The result by the mean square error and by the largest one. Both coils of a pair have their
    /// current wherever currents are stated.
    pub(super) fn file(
        &self,
        solution: &Solution,
        worst: &WorstSolution,
    ) -> Result<LambdaFile, RunError> {
        let (points, settings) = (self.points, &self.options.settings);
        let chosen = solution.chosen.as_ref();
        let forces = forces_accuracy(
            self.scene,
            self.solved,
            &points.positions_m,
            self.unwired.forces_n_per_a,
        )?;
        let worst_point = self.worst_point(solution, worst);
        let accuracy = BTreeMap::from([
            ("points".to_owned(), points.accuracy["points"].clone()),
            ("forces".to_owned(), forces),
            ("lambda".to_owned(), solution.accuracy.clone()),
            (
                "worst_point".to_owned(),
                worst_accuracy(worst, &worst_point),
            ),
        ]);
        let mut file = LambdaFile {
            schema_version: SCHEMA_VERSION.to_owned(),
            fluxform_version: FLUXFORM_VERSION.to_owned(),
            design: self.scene.design.name.clone(),
            shape: points.shape.clone(),
            inputs: points.inputs.clone(),
            constants: solution.constants,
            lambda_n_per_m: chosen.map(|point| point.lambda_n_per_m),
            criterion: settings.criterion,
            jnd: settings.jnd_weight,
            currents_a: chosen.map(|point| point.currents_a.clone()),
            rms_error_n: chosen.map(|point| point.rms_error_n),
            worst_error_n: chosen.map(|point| point.worst_error_n),
            relative_rms_error: chosen.and_then(|point| point.relative_rms_error),
            duality_gap_n2: chosen.map(|point| point.duality_gap_n2),
            rank: solution.rank,
            points: points.height_m.len(),
            weights: points.rule,
            path: solution.path.breakpoints().into_iter().map(step).collect(),
            at: solution.at.as_ref().map(|point| self.at(point, worst)),
            worst_point: Some(worst_point),
            sampling: None,
            tolerance: Some(self.perceptual_tolerance()?),
            wiring: (!self.options.wiring.is_plain()).then(|| self.options.wiring.clone()),
            variants: None,
            feedback: None,
            working_point: None,
            given_force: chosen.and_then(|point| self.given(point, solution)),
            sideways: None,
            uncertainty: None,
            hottest_coil: chosen.map(|point| self.hottest(&point.currents_a)),
            headline: None,
            accuracy,
        };
        if let Some(wiring) = &file.wiring {
            for step in &mut file.path {
                wiring.spread(&mut step.currents_a);
            }
            for step in file
                .worst_point
                .iter_mut()
                .flat_map(|worst| &mut worst.path)
            {
                wiring.spread(&mut step.currents_a);
            }
        }
        Ok(file)
    }

    fn hottest(&self, currents_a: &[f64]) -> Heating {
        let largest_a = currents_a.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
        self.scene.heated(largest_a)
    }

    fn given(&self, point: &OperatingPoint, solution: &Solution) -> Option<GivenForce> {
        let saturation = solution.constants.lambda_saturation_n_per_m;
        GivenForce::of(
            &self.unwired,
            point.lambda_n_per_m,
            &point.currents_a,
            saturation,
        )
    }

    fn at(&self, point: &OperatingPoint, worst: &WorstSolution) -> AtLambda {
        let mut least = worst.at(&self.problem, point.lambda_n_per_m);
        self.options.wiring.spread(&mut least.currents_a);
        AtLambda {
            lambda_n_per_m: point.lambda_n_per_m,
            currents_a: point.currents_a.clone(),
            rms_error_n: point.rms_error_n,
            worst_error_n: point.worst_error_n,
            worst_point: Some(WorstPointAt {
                worst_error_n: least.worst_error_n,
                gap_n: Some(least.gap_n),
                currents_a: least.currents_a,
            }),
        }
    }

    /// The largest error's form at the chosen lambda and over all of them.
    fn worst_point(&self, solution: &Solution, worst: &WorstSolution) -> WorstPointFile {
        // Currents that bring no force nearer on average bring none of use at the worst point either.
        let rendered =
            |lambda: Option<f64>| lambda.filter(|_| solution.status != Status::NothingRendered);
        let chosen = solution.chosen.as_ref();
        let point = chosen.map(|chosen| {
            let mut point = worst.at(&self.problem, chosen.lambda_n_per_m);
            self.options.wiring.spread(&mut point.currents_a);
            point
        });
        let point = point.as_ref();
        WorstPointFile {
            lambda_linear_n_per_m: rendered(worst.lambda_linear_n_per_m),
            lambda_jnd_n_per_m: rendered(worst.lambda_jnd_n_per_m),
            relative_floor: worst.floor,
            worst_error_n: point.map(|point| point.worst_error_n),
            relative_worst_error: point.and_then(|point| point.relative_worst_error),
            currents_a: point.map(|point| point.currents_a.clone()),
            gap_n: point.map(|point| point.gap_n),
            active: point.map(|point| point.active.clone()),
            path_left_out: worst.path.is_none(),
            constants_unknown: !worst.complete,
            path: worst
                .path
                .iter()
                .flat_map(WorstPath::turns)
                .map(|turn| WorstPointStep {
                    lambda_n_per_m: turn.lambda_n_per_m,
                    worst_error_n: turn.worst_error_n,
                    currents_a: turn.currents_a.clone(),
                    active_points: turn.active.iter().map(|active| active.point).collect(),
                    event: if turn.events.is_empty() {
                        "other points decide".to_owned()
                    } else {
                        events(&turn.events)
                    },
                })
                .collect(),
        }
    }

    /// The largest force constant whose errors are not felt at any point.
    fn perceptual_tolerance(&self) -> Result<TolerancePoint, RunError> {
        let share = self.options.settings.jnd_weight;
        let mut largest = felt(&self.problem, share, DETECTION_THRESHOLD_N)?;
        if let Some(largest) = &mut largest {
            self.options.wiring.spread(&mut largest.currents_a);
        }
        let largest = largest.as_ref();
        Ok(TolerancePoint {
            lambda_n_per_m: largest.map(|largest| largest.lambda_n_per_m),
            share,
            threshold_n: DETECTION_THRESHOLD_N,
            point: largest.map(|largest| largest.point),
            part: largest.map(|largest| largest.part),
            currents_a: largest.map(|largest| largest.currents_a.clone()),
        })
    }
}

/// The error of the constants for the worst point; where none are known that of the error at the chosen one.
fn worst_accuracy(worst: &WorstSolution, at: &WorstPointFile) -> StageAccuracy {
    if worst.complete {
        return worst.accuracy.clone();
    }
    let share = |gap_n: f64| {
        let [relative, error_n] = [at.relative_worst_error?, at.worst_error_n?];
        Some(if error_n > 0.0 {
            gap_n / error_n * relative
        } else {
            0.0
        })
    };
    StageAccuracy {
        estimate: at.gap_n.and_then(share).unwrap_or(worst.accuracy.estimate),
        method: "gap of the proof of the largest error at the chosen lambda".to_owned(),
        ..worst.accuracy.clone()
    }
}

fn step(point: Breakpoint) -> PathStep {
    PathStep {
        lambda_n_per_m: point.lambda_n_per_m,
        currents_a: point.currents_a,
        event: events(&point.events),
    }
}

fn events(events: &[Event]) -> String {
    let events: Vec<String> = events.iter().map(ToString::to_string).collect();
    events.join("; ")
}
