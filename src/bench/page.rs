//! The pages of a run: its numbers as `report` is told them.

use super::summary::ratios;
use super::written::unit_of;
use crate::bundle::artefact::FLUXFORM_VERSION;
use crate::bundle::bench::{BenchFile, Curve, Law, StageCurves};
use crate::bundle::catalogue::CaseRow;
use crate::report::bench::{BenchFacts, LawFacts, StageFacts, page};
use crate::report::catalogue::{self, CaseFacts};
use crate::report::measured::{MeasuredCurve, MeasuredRow};

/// Name of a page.
pub const PAGE: &str = "report.html";

/// The page of `file`.
#[must_use]
pub fn html(file: &BenchFile) -> String {
    page(&BenchFacts {
        version: &file.fluxform_version,
        quick: file.quick,
        inputs: (file.inputs.iter())
            .map(|input| (input.path.as_str(), input.sha256.as_str()))
            .collect(),
        stages: file.stages.iter().map(stage).collect(),
        laws: file.scaling.iter().map(law).collect(),
        missing: &file.peers_missing,
    })
}

/// The page of the stability catalogue.
#[must_use]
pub fn catalogue(rows: &[CaseRow]) -> String {
    let cases: Vec<CaseFacts> = rows
        .iter()
        .map(|row| CaseFacts {
            name: &row.name,
            expected: &row.expected,
            got: &row.got,
            error: row.error,
            bound: row.bound,
            seconds: row.seconds,
            pass: row.pass,
        })
        .collect();
    catalogue::page(FLUXFORM_VERSION, &cases)
}

fn stage(stage: &StageCurves) -> StageFacts<'_> {
    StageFacts {
        name: &stage.stage,
        timed: &stage.timed,
        error_of: &stage.error_of,
        // What it is relative to stands below the drawing.
        label: if unit_of(&stage.error_of).starts_with("error / m") {
            "error / m"
        } else {
            "relative error"
        },
        default: &stage.default,
        curves: stage.curves.iter().map(curve).collect(),
        ratios: ratios(stage),
    }
}

fn curve(curve: &Curve) -> (MeasuredCurve<'_>, &str, f64) {
    let peer = curve.program != "fluxform";
    let rows = curve.rows.iter().map(|row| MeasuredRow {
        knob: row.knob,
        marked: row.default,
        error: row.error,
        stated: row.stated_error,
        seconds: row.seconds,
        quartiles_s: [row.seconds_low, row.seconds_high],
    });
    let measured = MeasuredCurve {
        name: if peer {
            format!("{}: {}", curve.program, curve.name)
        } else {
            curve.name.clone()
        },
        knob: &curve.knob,
        peer,
        rows: rows.collect(),
    };
    (measured, &curve.reference, curve.reference_error)
}

fn law(law: &Law) -> LawFacts<'_> {
    let size = |row: &crate::bundle::bench::SizeRow| {
        (row.size, row.threads, row.seconds, row.peak_bytes as f64)
    };
    LawFacts {
        stage: &law.stage,
        axis: &law.axis,
        time: [law.seconds_slope, law.seconds_slope_error],
        memory: [law.memory_slope, law.memory_slope_error],
        seed: law.seed_size,
        sizes: law.sizes.iter().map(size).collect(),
        outlook: (law.outlook.iter())
            .map(|at| (at.factor, at.seconds, at.bytes, at.breaks.as_deref()))
            .collect(),
    }
}
