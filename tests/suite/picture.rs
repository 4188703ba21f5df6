//! One stage's curves as a picture.

use fluxform::plot::curves::{CurvesPlot, Line};

use crate::file::{Curve, StageCurves};

/// One stage's curves in one plane.
#[must_use]
pub fn picture(stage: &StageCurves) -> CurvesPlot {
    let line = |curve: &Curve| Line {
        name: format!("{}: {} ({})", curve.program, curve.name, curve.knob),
        points: curve
            .rows
            .iter()
            .map(|row| (row.seconds, row.error))
            .collect(),
        marked: (0..curve.rows.len())
            .filter(|k| curve.rows[*k].default)
            .collect(),
    };
    CurvesPlot {
        mark: "default",
        title: format!("{}: error against processor time", stage.stage),
        across: "processor time / s".to_owned(),
        up: unit_of(&stage.error_of),
        lines: stage.curves.iter().map(line).collect(),
    }
}

/// The label of the errors' axis.
#[must_use]
pub fn unit_of(error_of: &str) -> String {
    let absolute = error_of
        .strip_prefix('m')
        .filter(|rest| rest.is_empty() || rest.starts_with(','));
    match absolute {
        Some(rest) => format!("error / m{rest}"),
        None => {
            let first = error_of.split(" (").next().unwrap_or(error_of);
            let first = first.split(';').next().unwrap_or(first);
            format!("error, relative to {first}")
        }
    }
}
