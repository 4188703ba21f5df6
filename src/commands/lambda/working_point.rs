//! Forces along the B-H curve at the chosen currents.

use super::PosedProblem;
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::lambda_file::WorkingPointForces;
use crate::lambda::OperatingPoint;
use crate::progress::Progress;
use crate::scene::working_point::{WorkingPoint, relative_difference, superposition_ends};

/// The forces along the B-H curve at the chosen currents.
pub(super) struct AlongCurve {
    pub(super) forces: WorkingPointForces,
    pub(super) accuracy: StageAccuracy,
    /// Where the sum of the coils' forces is too far off.
    pub(super) warning: Option<String>,
}

impl PosedProblem<'_> {
    /// Forces along the B-H curve at the chosen currents; `None` without a curve.
    pub(super) fn along_curve(
        &self,
        chosen: &OperatingPoint,
        progress: &dyn Progress,
    ) -> Result<Option<AlongCurve>, RunError> {
        let (scene, points) = (self.scene, self.points);
        let currents_a = &chosen.currents_a;
        progress.begin("working point", 1);
        let point = WorkingPoint::new(scene, self.solved, currents_a, points.lowest_m())?;
        let Some(point) = point else {
            progress.end();
            return Ok(None);
        };
        let forces_n = point.forces_n(scene, &points.positions_m, progress)?;
        progress.end();
        let rows = self.unwired.forces_n_per_a.chunks_exact(currents_a.len());
        let linear_n: Vec<f64> = rows
            .map(|row| row.iter().zip(currents_a).map(|(f, i)| f * i).sum())
            .collect();
        let (mut squares, mut worst_n) = (0.0, 0.0_f64);
        for (row, force) in forces_n.iter().enumerate() {
            let offset = self.unwired.offset_n.map_or(0.0, |offset| offset[row]);
            let error = force + offset - chosen.lambda_n_per_m * points.height_m[row];
            squares += error * error;
            worst_n = worst_n.max(error.abs());
        }
        let accuracy = point.accuracy();
        let forces = WorkingPointForces {
            deviation_from_linear: relative_difference(&forces_n, &linear_n),
            rms_error_n: (squares / forces_n.len() as f64).sqrt(),
            worst_error_n: worst_n,
            peak_field_t: point.peak_field_t,
            mean_field_t: point.mean_field_t,
        };
        Ok(Some(AlongCurve {
            warning: superposition_ends(
                scene,
                forces.deviation_from_linear,
                &forces.peak_field_t,
                "the forces that lambda was solved with",
            ),
            forces,
            accuracy,
        }))
    }
}
