//! Where the forces of a bundle's object point: what its page draws.

use super::Calibration;
use crate::RunError;
use crate::commands::lambda::LambdaReport;
use crate::lambda::{Allocator, SIDEWAYS_WEIGHT, VectorAllocator};
use crate::numerics::axis::Axis;
use crate::progress::Progress;
use crate::report::data::{DirectionCell, DirectionField};
use crate::scene::{Scene, passive};
use crate::shape::points::ConstraintPoints;

/// Points along either side of the drawing, at most.
const MOST: usize = 31;

impl Calibration<'_> {
    /// The force vectors at some of the grid's points; `None` where the upward force alone is requested or
    /// there is no force constant.
    ///
    /// # Errors
    /// Points that cannot be computed; interruption.
    pub(super) fn directions(
        &self,
        points: &ConstraintPoints,
        lambda: &LambdaReport,
        progress: &dyn Progress,
    ) -> Result<Option<DirectionField>, RunError> {
        if !self.force().direction.is_vector() {
            return Ok(None);
        }
        let (x, y) = (&points.grid.x_m, &points.grid.y_m);
        let steps = [x.samples, y.samples].map(|samples| samples.div_ceil(MOST).max(1));
        let chosen: Vec<usize> = (0..points.len())
            .filter(|row| {
                let node = points.grid_index[*row];
                (node % x.samples).is_multiple_of(steps[0])
                    && (node / x.samples).is_multiple_of(steps[1])
            })
            .collect();
        let Some(all) = self.force_cells(points, &chosen, lambda, progress)? else {
            return Ok(None);
        };
        let columns = x.samples.div_ceil(steps[0]);
        let mut cells = vec![None; columns * y.samples.div_ceil(steps[1])];
        for (row, cell) in chosen.iter().zip(all) {
            let node = points.grid_index[*row];
            let (column, line) = (node % x.samples / steps[0], node / x.samples / steps[1]);
            cells[line * columns + column] = Some(cell);
        }
        Ok(Some(DirectionField {
            x_m: ends(x, steps[0]),
            y_m: ends(y, steps[1]),
            columns,
            cells,
        }))
    }

    /// The force vectors at the points of these rows; `None` without a force constant. Where the upward
    /// component alone is requested, feedback gives that one, and what comes with it sideways.
    ///
    /// # Errors
    /// As [`Calibration::directions`].
    pub(super) fn force_cells(
        &self,
        points: &ConstraintPoints,
        rows: &[usize],
        lambda: &LambdaReport,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<DirectionCell>>, RunError> {
        let (force, scene) = (self.force(), self.scene);
        let file = &lambda.file;
        let (Some(currents_a), Some(lambda)) = (&file.currents_a, file.lambda_n_per_m) else {
            return Ok(None);
        };
        let place = |row: &usize| [points.x_m[*row], points.y_m[*row], points.height_m[*row]];
        let positions_m: Vec<_> = rows.iter().map(place).collect();
        let coils = scene.coils.len();
        let vectors = scene.force_vectors_n_per_a(&self.solved.forces, &positions_m, progress)?;
        let pull = passive::counted(scene, &positions_m)?;
        let offset_n = pull.map(|pull| pull.forces_z_n(&positions_m));
        let mut feedback = Feedback::new(scene, force.direction.is_vector())?;
        let mut currents = vec![0.0; coils];
        let cell = |(k, row): (usize, &usize)| {
            let per_ampere = &vectors[k * coils..(k + 1) * coils];
            let pull_n = offset_n.as_ref().map_or(0.0, |all| all[k]);
            let size = lambda * points.height_m[*row];
            let requested_n = force
                .vector(points.normal[*row], points.marks[*row].crease)
                .map(|part| size * part);
            let [wanted_x, wanted_y, wanted_z] = requested_n;
            let given = |currents: &[f64]| given_n(per_ampere, pull_n, currents);
            feedback.allocate(
                per_ampere,
                [wanted_x, wanted_y, wanted_z - pull_n],
                &mut currents,
            );
            DirectionCell {
                position_m: positions_m[k],
                requested_n,
                static_n: given(currents_a),
                feedback_n: given(&currents),
            }
        };
        Ok(Some(rows.iter().enumerate().map(cell).collect()))
    }
}

/// The currents of least power that a runtime with feedback commands.
enum Feedback {
    Upward(Allocator, Vec<f64>),
    Vector(VectorAllocator),
}

impl Feedback {
    fn new(scene: &Scene, vector: bool) -> Result<Self, RunError> {
        let (resistance, total) = (
            scene.resistances_ohm(),
            scene.design.supply.total_current_max_a,
        );
        let (lower, upper) = (&scene.lower_a, &scene.upper_a);
        let made = if vector {
            VectorAllocator::new(&resistance, lower, upper, total, SIDEWAYS_WEIGHT)
                .map(Self::Vector)
        } else {
            let upward = vec![0.0; scene.coils.len()];
            Allocator::new(&resistance, lower, upper, total).map(|made| Self::Upward(made, upward))
        };
        made.map_err(|limits| RunError::Input(limits.to_string()))
    }

    fn allocate(&mut self, per_ampere: &[[f64; 3]], wanted_n: [f64; 3], currents_a: &mut [f64]) {
        match self {
            Self::Upward(allocator, upward) => {
                for (upward, vector) in upward.iter_mut().zip(per_ampere) {
                    *upward = vector[2];
                }
                allocator.allocate(upward, wanted_n[2], currents_a);
            }
            Self::Vector(allocator) => {
                allocator.allocate(per_ampere, wanted_n, currents_a);
            }
        }
    }
}

/// The force of given currents, N.
fn given_n(per_ampere: &[[f64; 3]], pull_n: f64, currents_a: &[f64]) -> [f64; 3] {
    let mut sum = [0.0, 0.0, pull_n];
    for (force, current) in per_ampere.iter().zip(currents_a) {
        for (sum, part) in sum.iter_mut().zip(force) {
            *sum += part * current;
        }
    }
    sum
}

/// The first node of an axis and the last of every `step`-th.
fn ends(axis: &Axis, step: usize) -> [f64; 2] {
    let last = axis.samples.saturating_sub(1) / step * step;
    [axis.from, axis.node(last)]
}
