//! Whether an object lies where the array can render it, and what would bring it there.

use super::{ForcePoints, LambdaReport};
use crate::design::Design;
use crate::numerics::axis::Axis;
use crate::numerics::lagrange;
use crate::shape::document::{ShapeDocument, SurfaceSource, parse_unit, unit_name, unit_names};
use crate::units::DETECTION_THRESHOLD_N;

/// An object with a larger part of its points outside the workspace is not what was meant: there a
/// runtime gives no force.
pub const OUTSIDE_MAX: f64 = 2.0 / 3.0;

/// An object this many times larger or smaller than the workspace is in another unit.
const OUT_OF_PROPORTION: f64 = 8.0;

/// Rounding of tenths of a millimetre, in these.
const ROUNDING: f64 = 1e-6;

/// An object, its points and the design that is to render them.
#[derive(Clone, Copy)]
pub(crate) struct Placed<'a> {
    pub(crate) design: &'a Design,
    pub(crate) document: &'a ShapeDocument,
    pub(crate) points: &'a ForcePoints,
}

/// Report on the points outside the workspace.
enum Outside {
    /// Nothing: there are none.
    None,
    /// Some: a warning.
    Some(String),
    /// More than [`OUTSIDE_MAX`] of them.
    Most(String),
}

impl Placed<'_> {
    /// Warns of points outside the workspace, and states why the object cannot be rendered where it is.
    pub(crate) fn judge(&self, report: &mut LambdaReport) {
        report.misplaced = match self.outside() {
            Outside::Most(message) => Some(message),
            Outside::Some(warning) => {
                report.warnings.push(warning);
                self.unfelt(report.file.lambda_n_per_m)
            }
            Outside::None => self.unfelt(report.file.lambda_n_per_m),
        };
        report.warnings.extend(report.misplaced.clone());
    }

    /// Why a runtime could render nearly nothing of the object; `None` where it could.
    pub(crate) fn refused(&self) -> Option<String> {
        match self.outside() {
            Outside::Most(message) => Some(message),
            Outside::None | Outside::Some(_) => None,
        }
    }

    /// The points outside the design's workspace, where a runtime gives no force.
    fn outside(&self) -> Outside {
        let nodes = self.axes().map(|axis| axis.nodes());
        let inside = |point: &[f64; 3]| (0..3).all(|k| lagrange::holds(&nodes[k], point[k]));
        let all = self.points.positions_m.len();
        let outside = self
            .points
            .positions_m
            .iter()
            .filter(|point| !inside(point))
            .count();
        if outside == 0 {
            return Outside::None;
        }
        let which = if outside == all {
            "the object lies wholly outside the design's workspace".to_owned()
        } else {
            format!("{outside} of {all} points lie outside the design's workspace")
        };
        if outside as f64 <= OUTSIDE_MAX * all as f64 {
            return Outside::Some(format!(
                "{which}: lambda counts them, but a runtime has no map there and gives no force; \
                 enlarge [workspace]"
            ));
        }
        Outside::Most(format!(
            "{which}, where a runtime gives no force: {}",
            self.cure()
        ))
    }

    /// Why a finger feels nothing of the object at `lambda_n_per_m`; `None` where it does.
    pub(crate) fn unfelt(&self, lambda_n_per_m: Option<f64>) -> Option<String> {
        let lambda = lambda_n_per_m.filter(|lambda| *lambda > 0.0)?;
        let highest_m = self.points.height_m.iter().copied().fold(0.0, f64::max);
        let most_n = lambda * highest_m;
        (most_n < DETECTION_THRESHOLD_N).then(|| {
            format!(
                "nothing of the object is felt: its largest force is {:.2e} mN, and a finger feels {} mN: {}",
                most_n * 1e3,
                DETECTION_THRESHOLD_N * 1e3,
                self.cure()
            )
        })
    }

    fn axes(&self) -> [Axis; 3] {
        let space = &self.design.workspace;
        [space.x_m, space.y_m, space.z_m]
    }

    /// What helps, in words: the shift that brings the object into the workspace, or that none is needed.
    fn cure(&self) -> String {
        let axes = self.axes();
        let ends = [0, 1, 2].map(|k| {
            let along = self.points.positions_m.iter().map(|point| point[k]);
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| {
                [a.min(v), b.max(v)]
            })
        });
        let size_m = ends[..2]
            .iter()
            .map(|[from, to]| to - from)
            .fold(0.0, f64::max);
        let size_m = size_m.max(ends[2][1]);
        let space_m = axes
            .iter()
            .map(|axis| axis.to - axis.from)
            .fold(0.0, f64::max);
        if let Some(cure) = self.other_unit(size_m, space_m) {
            return cure;
        }
        let fits = (0..3).all(|k| ends[k][1] - ends[k][0] <= axes[k].to - axes[k].from);
        if !fits {
            return self.fitted(size_m);
        }
        let by_m = [0, 1, 2].map(|k| {
            let ([from, to], axis) = (ends[k], axes[k]);
            (axis.from - from).max(0.0) + (axis.to - to).min(0.0)
        });
        if by_m == [0.0; 3] {
            return "it lies within the workspace, where the coils' forces are too weak: allow more current, wind more \
                    turns, take a larger magnet, or bring object and workspace nearer to the coils"
                .to_owned();
        }
        let given_m = self.document.placement.translate_m;
        let moved = [0, 1, 2].map(|k| {
            // Tenths of a millimetre, rounded inwards.
            let tenths = (given_m[k] + by_m[k]) * 1e4;
            let rounded = match by_m[k] {
                up if up > 0.0 => (tenths - ROUNDING).ceil(),
                0.0 => tenths.round(),
                _ => (tenths + ROUNDING).floor(),
            };
            format!("{}", rounded / 10.0)
        });
        let seat = &self.document.placement.seat;
        if seat.fit.is_some() || seat.center || seat.rest_on_m.is_some() {
            return self.fitted(size_m);
        }
        let moved = moved.join(", ");
        format!(
            "--translate {} (translate_mm = [{moved}] in a shape file) moves it in",
            moved.replace(' ', "")
        )
    }

    /// The surface in a unit that makes it as large as the workspace.
    fn other_unit(&self, size_m: f64, space_m: f64) -> Option<String> {
        let SurfaceSource::File {
            unit_m: Some(unit_m),
            ..
        } = self.document.source
        else {
            return None;
        };
        let ratio = |unit: f64| size_m * unit / unit_m / space_m;
        let alike = |ratio: f64| (1.0 / OUT_OF_PROPORTION..=OUT_OF_PROPORTION).contains(&ratio);
        if alike(ratio(unit_m)) {
            return None;
        }
        let units = unit_names()
            .into_iter()
            .filter_map(|name| Some((name, parse_unit(name)?)));
        let nearest = units
            .filter(|(_, unit)| alike(ratio(*unit)))
            .min_by(|(_, a), (_, b)| ratio(*a).ln().abs().total_cmp(&ratio(*b).ln().abs()))?;
        Some(format!(
            "the part is {} long in the unit {}: --unit {} (unit = \"{}\" in a shape file)?",
            length(size_m),
            unit_name(unit_m),
            nearest.0,
            nearest.0
        ))
    }

    /// By its box.
    fn fitted(&self, size_m: f64) -> String {
        let ends = self
            .axes()
            .map(|axis| [axis.from, axis.to].map(|end| format!("{}", (end * 1e6).round() / 1e3)));
        let ends = ends.as_flattened().join(", ");
        match self.document.source {
            SurfaceSource::Primitive(_) => format!(
                "it is {} large; give it sizes inside x, y, z = [{ends}] mm, or enlarge [workspace]",
                length(size_m)
            ),
            SurfaceSource::File { .. } => format!(
                "it is {} large; --fit DESIGN --scale-to-fit (fit_mm = [{ends}] and scale_to_fit = \
                 true in a shape file) puts it in, or enlarge [workspace]",
                length(size_m)
            ),
        }
    }
}

/// A length for a message: metres from 1 m on, else millimetres.
fn length(length_m: f64) -> String {
    let digits = |value: f64| {
        format!("{:.3}", value)
            .trim_end_matches('0')
            .trim_end_matches('.')
            .to_owned()
    };
    if length_m >= 1.0 {
        format!("{} m", digits(length_m))
    } else {
        format!("{} mm", digits(length_m * 1e3))
    }
}
