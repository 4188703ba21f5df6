//! `bench.json` and `bench.csv`: error against seconds of every numerical stage.

use std::collections::BTreeMap;
use std::io::{self, Write};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use fluxform::accuracy::StageAccuracy;
use fluxform::bundle::artefact::{FileEntry, Input, Options};
use fluxform::bundle::number::{push_cell, push_number, push_text};

/// `bench.json`. Seconds in it differ from run to run; errors do not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BenchFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that was measured.
    pub fluxform_version: String,
    /// Designs and reference values, all built into the program.
    pub inputs: Vec<Input>,
    /// The options of the run.
    #[serde(default, skip_serializing_if = "Options::is_empty")]
    pub made_with: Options,
    /// The sentence on units.
    pub units: String,
    /// Whether the finest and slowest rows were left out.
    pub quick: bool,
    /// One entry a stage.
    pub stages: Vec<StageCurves>,
    /// Time and memory against size, where requested.
    pub scaling: Vec<Law>,
    /// Why peers that were requested have no curve.
    pub peers_missing: Vec<String>,
    /// The error that every stage states at the default knob.
    pub accuracy: BTreeMap<String, StageAccuracy>,
    /// Table, plots and summary.
    pub files: Vec<FileEntry>,
}

/// One numerical stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageCurves {
    /// Name on the command line.
    pub stage: String,
    /// Work that is timed.
    pub timed: String,
    /// Reference of the error, or its unit.
    pub error_of: String,
    /// Default behaviour and its reason, in words.
    pub default: String,
    /// Curves: of each knob, route or problem, and of peers.
    pub curves: Vec<Curve>,
}

/// Rows along one knob.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Curve {
    /// Method of the computation.
    pub name: String,
    /// `fluxform`, or the peer's name and version.
    pub program: String,
    /// The parameter that is swept, with its unit.
    pub knob: String,
    /// Reference of the error.
    pub reference: String,
    /// The reference's own error, like the rows'.
    pub reference_error: f64,
    /// From coarse to fine.
    pub rows: Vec<Row>,
}

impl Curve {
    /// Whether another program's.
    #[must_use]
    pub fn is_peer(&self) -> bool {
        self.program != "fluxform"
    }
}

/// One setting of a knob.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Row {
    /// The knob.
    pub knob: f64,
    /// Whether it is the program's default.
    pub default: bool,
    /// Points, coils or steps that the seconds are for.
    pub items: u64,
    /// Largest error found.
    pub error: f64,
    /// Error that the stage itself states; `None` where it states none for this row.
    pub stated_error: Option<f64>,
    /// Processor time, the median of the repeats, s.
    pub seconds: f64,
    /// Their lower quartile, s.
    pub seconds_low: f64,
    /// Their upper quartile, s.
    pub seconds_high: f64,
    /// Repeats after a warm-up.
    pub repeats: u64,
}

/// Time and memory of one stage against one size: `seconds = a size^slope`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Law {
    /// The quantity computed.
    pub stage: String,
    /// The size that grows.
    pub axis: String,
    /// Its value on the seed.
    pub seed_size: f64,
    /// From small to large; each in a process of its own.
    pub sizes: Vec<SizeRow>,
    /// Exponent of the processor time, over the larger half of the sizes.
    pub seconds_slope: f64,
    /// Its standard error.
    pub seconds_slope_error: f64,
    /// Exponent of the memory beyond what the program takes without work.
    pub memory_slope: f64,
    /// Its standard error.
    pub memory_slope_error: f64,
    /// At a hundred and ten thousand times the seed's size, by these exponents.
    pub outlook: Vec<Outlook>,
}

/// One size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SizeRow {
    /// The size.
    pub size: f64,
    /// Threads.
    pub threads: u64,
    /// Processor time of all threads, the median of the repeats, s.
    pub seconds: f64,
    /// Lower quartile, s.
    pub seconds_low: f64,
    /// Upper quartile, s.
    pub seconds_high: f64,
    /// Time by the clock, the least, s.
    pub elapsed_s: f64,
    /// Most memory that the process held, bytes; 0 where the system does not report it.
    pub peak_bytes: u64,
}

/// Extrapolation to a size that was not measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Outlook {
    /// Times the seed's size.
    pub factor: f64,
    /// s.
    pub seconds: f64,
    /// Bytes.
    pub bytes: f64,
    /// The limit met first: `time` (an hour), `memory` (24 GiB), or none.
    pub breaks: Option<String>,
}

impl Law {
    /// Whether an outlook lies beyond the sizes that were measured.
    #[must_use]
    pub fn extrapolates(&self, outlook: &Outlook) -> bool {
        let measured = self.sizes.iter().map(|row| row.size);
        outlook.factor * self.seed_size > measured.fold(0.0, f64::max)
    }
}

/// Columns of `bench.csv`.
pub const BENCH_COLUMNS: [&str; 14] = [
    "stage",
    "curve",
    "program",
    "knob_name",
    "knob",
    "default",
    "items",
    "error",
    "stated_error",
    "seconds",
    "seconds_low",
    "seconds_high",
    "repeats",
    "reference",
];

/// Writes every row of every curve; the reference with its own error is in each.
///
/// # Errors
/// The writer's.
pub fn write_rows(out: &mut dyn Write, stages: &[StageCurves]) -> io::Result<()> {
    writeln!(out, "{},reference_error", BENCH_COLUMNS.join(","))?;
    for stage in stages {
        for curve in &stage.curves {
            for row in &curve.rows {
                let mut line = Vec::new();
                for text in [&stage.stage, &curve.name, &curve.program, &curve.knob] {
                    push_text(&mut line, text);
                }
                push_cell(&mut line, row.knob);
                push_text(&mut line, if row.default { "true" } else { "false" });
                push_text(&mut line, &row.items.to_string());
                push_cell(&mut line, row.error);
                match row.stated_error {
                    Some(stated) => push_cell(&mut line, stated),
                    None => line.push(b','),
                }
                for seconds in [row.seconds, row.seconds_low, row.seconds_high] {
                    push_cell(&mut line, seconds);
                }
                push_text(&mut line, &row.repeats.to_string());
                push_text(&mut line, &curve.reference);
                push_number(&mut line, curve.reference_error);
                line.push(b'\n');
                out.write_all(&line)?;
            }
        }
    }
    Ok(())
}

/// Writes every size of every law.
///
/// # Errors
/// The writer's.
pub fn write_laws(out: &mut dyn Write, laws: &[Law]) -> io::Result<()> {
    writeln!(
        out,
        "stage,axis,size,threads,seconds,seconds_low,seconds_high,elapsed_s,peak_bytes"
    )?;
    for law in laws {
        for row in &law.sizes {
            let mut line = Vec::new();
            push_text(&mut line, &law.stage);
            push_text(&mut line, &law.axis);
            push_cell(&mut line, row.size);
            push_text(&mut line, &row.threads.to_string());
            for value in [
                row.seconds,
                row.seconds_low,
                row.seconds_high,
                row.elapsed_s,
            ] {
                push_cell(&mut line, value);
            }
            line.extend_from_slice(row.peak_bytes.to_string().as_bytes());
            line.push(b'\n');
            out.write_all(&line)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_a_cell_for_every_column() {
        let row = Row {
            knob: 1e-6,
            default: true,
            items: 7,
            error: 1.3e-7,
            stated_error: None,
            seconds: 0.7,
            seconds_low: 0.6,
            seconds_high: 1.3,
            repeats: 3,
        };
        let stage = StageCurves {
            stage: "air-field".to_owned(),
            timed: "a point".to_owned(),
            error_of: "|grad B|".to_owned(),
            default: "as it is".to_owned(),
            curves: vec![Curve {
                name: "a, b".to_owned(),
                program: "fluxform".to_owned(),
                knob: "tolerance".to_owned(),
                reference: "40 digits".to_owned(),
                reference_error: 1e-16,
                rows: vec![row],
            }],
        };
        let mut text = Vec::new();
        write_rows(&mut text, &[stage]).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert_eq!(
            text.lines().nth(1).unwrap(),
            "air-field,\"a, b\",fluxform,tolerance,1e-6,true,7,1.3e-7,,0.7,0.6,1.3,3,40 digits,1e-16"
        );
        assert_eq!(
            text.lines().next().unwrap().split(',').count(),
            BENCH_COLUMNS.len() + 1
        );
    }
}
