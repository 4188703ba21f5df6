//! A calibrated object as its page shows it: the parts of its bundle and the few facts that no file
//! of it states. SI.

use std::collections::BTreeMap;

use fluxform_bundle::lambda_file::LambdaFile;
use fluxform_bundle::manifest::Manifest;
use fluxform_bundle::npz::MapArrays;
use fluxform_bundle::table::PointRow;
use fluxform_coil::limits::LimitCheck;

use crate::plot::array::ArrayPlot;
use crate::plot::lambda::LambdaPlot;

use super::measured::MeasuredCurve;

/// A calibrated object.
#[derive(Debug, Clone)]
pub struct CalibratedObject<'a> {
    /// `lambda.json`.
    pub lambda: &'a LambdaFile,
    /// `manifest.json`; its list of files is not read.
    pub manifest: &'a Manifest,
    /// `points.csv`.
    pub points: &'a [PointRow],
    /// `map.npz`.
    pub map: &'a MapArrays<'a>,
    /// Error and currents over lambda, and the forces at the chosen one.
    pub curves: &'a LambdaPlot,
    /// Where the forces point; `None` where the upward one alone is requested.
    pub directions: Option<DirectionField>,
    /// The array, to scale.
    pub array: Option<ArrayPlot>,
    /// A coil in plan.
    pub section: CoilPlan,
    /// The design's limits on one coil.
    pub limits: BTreeMap<&'static str, LimitCheck>,
    /// Limits that are not evaluated here.
    pub unchecked: Vec<&'static str>,
    /// Warnings for the user.
    pub warnings: &'a [String],
    /// Error against run time of the program, measured beforehand.
    pub error_time: Option<ErrorTime<'a>>,
}

impl CalibratedObject<'_> {
    /// The coils of the array with their currents, 0 without a force constant.
    #[must_use]
    pub fn coils(&self) -> Vec<DrivenCoil> {
        let limits = &self.manifest.limits;
        let axes = self.manifest.array.positions_m.iter().enumerate();
        axes.map(|(coil, &axis_m)| {
            let current_a = self.lambda.currents_a.as_ref().map_or(0.0, |all| all[coil]);
            DrivenCoil {
                axis_m,
                current_a,
                min_a: limits.current_min_a[coil],
                max_a: limits.current_max_a[coil],
                at_limit: limits.is_reached(coil, current_a),
            }
        })
        .collect()
    }

    /// A constraint point, a row of `points.csv`, m.
    #[must_use]
    pub fn position_m(&self, point: usize) -> [f64; 3] {
        let row = &self.points[point];
        [row.x_m, row.y_m, row.height_m]
    }

    /// The lowest constraint point, m.
    #[must_use]
    pub fn lowest_m(&self) -> f64 {
        let heights = self.points.iter().map(|row| row.height_m);
        heights.fold(f64::INFINITY, f64::min)
    }

    /// The point whose force is most wrong at the chosen lambda, if there is one.
    #[must_use]
    pub fn worst_place(&self) -> Option<WorstPlace> {
        let forces = self.curves.chosen.as_ref()?;
        let error = |at: usize| (forces.static_n[at] - forces.requested_n[at]).abs();
        let points = 0..self.points.len();
        let worst = points.reduce(|a, b| if error(b) > error(a) { b } else { a })?;
        Some(WorstPlace {
            position_m: self.position_m(worst),
            wanted_n: forces.requested_n[worst],
            given_n: forces.static_n[worst],
        })
    }
}

/// Force vectors at points of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionField {
    /// The grid's ends along x, m.
    pub x_m: [f64; 2],
    /// The grid's ends along y, m.
    pub y_m: [f64; 2],
    /// Points along x.
    pub columns: usize,
    /// One a point, x fastest; `None` where there is no surface.
    pub cells: Vec<Option<DirectionCell>>,
}

/// Force vectors at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectionCell {
    /// m.
    pub position_m: [f64; 3],
    /// N.
    pub requested_n: [f64; 3],
    /// With static currents, N.
    pub static_n: [f64; 3],
    /// With feedback of all three components, N.
    pub feedback_n: [f64; 3],
}

/// A coil seen from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoilPlan {
    /// Of the winding, m.
    pub inner_radius_m: f64,
    /// Of the winding, m.
    pub outer_radius_m: f64,
    /// Of the core, m; `None` in air.
    pub core_radius_m: Option<f64>,
}

/// The point whose force is most wrong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorstPlace {
    /// m.
    pub position_m: [f64; 3],
    /// lambda h, N.
    pub wanted_n: f64,
    /// Upward, N.
    pub given_n: f64,
}

/// A coil of the array and its current.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DrivenCoil {
    /// Its axis, m.
    pub axis_m: [f64; 2],
    /// At the chosen lambda, A.
    pub current_a: f64,
    /// A.
    pub min_a: f64,
    /// A.
    pub max_a: f64,
    /// Whether it carries all it may, either way.
    pub at_limit: bool,
}

/// Error against run time, from a table that is shipped.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorTime<'a> {
    /// The curve of the computation that this run's accuracy costs most in; the row at this run's
    /// tolerance is marked.
    pub curve: MeasuredCurve<'a>,
    /// The computation that is timed.
    pub timed: &'a str,
    /// The quantity that the errors are relative to.
    pub error_of: &'a str,
    /// The tolerance of this run.
    pub tolerance: f64,
    /// Program that was measured.
    pub version: &'a str,
    /// The machine on which it was measured.
    pub machine: &'a str,
}
