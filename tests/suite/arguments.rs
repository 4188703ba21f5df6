//! Arguments and summary of the measuring suite.

use std::path::PathBuf;

use clap::Parser;
use clap::builder::PossibleValuesParser;
use fluxform::RunError;
use fluxform::bundle::json::to_json;
use fluxform::cli::shell::{
    Codes, Common, Failure, FileArgument, Printer, Program, Sheet, Stream, Writing, begin, folder,
    page, table,
};
use fluxform::cli::shell::{bytes, count, error, number_to, si};
use fluxform::progress::Progress;

use crate::catalogue::CaseRow;
use crate::effort::Pace;
use crate::extreme::{self, Case};
use crate::file::{BenchFile, Row};
use crate::output::{catalogue_file, catalogue_made_with, check_catalogue, write_catalogue};
use crate::stages::STAGES;
use crate::{BenchRequest, run, scaling};

/// Error against run time of every numerical stage
///
/// Sweeps the knob of every stage from coarse to fine (where a stage is exact: the size or the
/// hardness of its problem) and measures the error against a reference of another kind and the
/// processor time on one thread: a warm-up, repeats, their median and quartiles. Nothing is read:
/// designs and reference values are part of the program. Writes bench.csv, bench.json, a picture
/// a stage, summary.md and report.html, a page to look at. --peers measures other programs on the same problems, run by the Python
/// that FLUXFORM_PYTHON names (several as in PATH), from the repository's root. --scaling measures
/// time and memory against size, and says where a stage would break.
///
/// --extreme runs the stability catalogue instead: named cases at the limits of what may be asked,
/// each with what must come out and a bound; --out writes extreme.csv, extreme.json and
/// report.html. Code 5 if one fails.
#[derive(Debug, Parser)]
#[command(name = "fluxform-bench", version, max_term_width = 100, after_long_help = page(Codes::Measuring, &[
    ("fluxform-bench --quick --stage air-field --out air", "one stage, in a second"),
    ("fluxform-bench --quick --stage air-field --stage inductance --out two --format json",
     "two stages, for a program"),
    ("fluxform-bench --quick --stage inductance --scaling --law inductance:coils --out grown",
     "one stage against one size"),
    ("fluxform-bench --extreme --case wires", "the catalogue's cases about wires"),
]))]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
    /// Leave out the slowest rows: all stages in less than a minute on one core
    #[arg(long)]
    quick: bool,
    /// Measure this stage alone; may be repeated
    #[arg(long, value_name = "NAME", value_parser = stage_names())]
    stage: Vec<String>,
    /// Measure other programs too, where their Python packages are installed
    #[arg(long)]
    peers: bool,
    /// Measure time and memory against numbers of coils, points, triangles, nodes and threads
    #[arg(long)]
    scaling: bool,
    /// Of --scaling measure this law alone; may be repeated. The others, and stages that are not named,
    /// stay as the folder has them
    #[arg(long, value_name = "STAGE:AXIS", requires = "scaling", value_parser = law_name)]
    law: Vec<String>,
    /// Run the stability catalogue; with --quick the part of it that every change runs
    #[arg(long, conflicts_with_all = ["stage", "peers", "scaling"])]
    extreme: bool,
    /// Of the catalogue only cases whose name holds this
    #[arg(long, value_name = "TEXT", requires = "extreme")]
    case: Option<String>,
    /// Folder of the results; without it results/bench for a whole run, results/bench-part for
    /// one with --quick, --stage, --peers or --scaling, and none with --extreme
    #[arg(long, value_name = "DIR")]
    out: Option<FileArgument>,
    #[command(flatten)]
    writing: Writing,
    /// One row of --scaling, as STAGE:AXIS:SETTING:THREADS, in this process
    #[arg(long, hide = true, value_name = "ROW", value_parser = size_row)]
    size_row: Option<SizeRowArgument>,
}

/// Where a whole run goes without `--out`, and any other.
const WHOLE: &str = "results/bench";
const PART: &str = "results/bench-part";

/// Quantities measured by a separate process.
#[derive(Debug, Clone)]
struct SizeRowArgument {
    stage: String,
    axis: String,
    setting: usize,
    threads: usize,
}

fn size_row(text: &str) -> Result<SizeRowArgument, String> {
    let parts: Vec<&str> = text.split(':').collect();
    let whole = |text: &str| {
        text.parse()
            .map_err(|_| format!("{text:?} is no whole number"))
    };
    match parts[..] {
        [stage, axis, setting, threads] => Ok(SizeRowArgument {
            stage: stage.to_owned(),
            axis: axis.to_owned(),
            setting: whole(setting)?,
            threads: whole(threads)?.max(1),
        }),
        _ => Err("expected STAGE:AXIS:SETTING:THREADS".to_owned()),
    }
}

fn stage_names() -> PossibleValuesParser {
    PossibleValuesParser::new(STAGES.map(|stage| stage.name))
}

fn law_name(text: &str) -> Result<String, String> {
    let names: Vec<String> = scaling::LAWS.iter().map(scaling::Spec::name).collect();
    if names.iter().any(|name| name == text) {
        return Ok(text.to_owned());
    }
    Err(format!("expected one of {}", names.join("; ")))
}

impl Program for Arguments {
    fn common(&self) -> &Common {
        &self.common
    }

    fn run(&self, printer: &Printer) -> Result<(), Failure> {
        if let Some(asked) = &self.size_row {
            let row = scaling::size_row(&asked.stage, &asked.axis, asked.setting, asked.threads)?;
            let json = to_json(&row)?;
            return printer.data(|out| out.write_all(&json));
        }
        if self.extreme {
            return self.catalogue(printer);
        }
        let request = BenchRequest {
            pace: if self.quick { Pace::QUICK } else { Pace::FULL },
            stages: self.stage.clone(),
            peers: self.peers,
            scaling: self.scaling,
            laws: self.law.clone(),
            out: self.folder()?,
            force: self.writing.force,
        };
        let bar = begin(printer);
        let file = run(&request, &bar)?;
        drop(bar);
        for missing in &file.peers_missing {
            printer.warning(&format!("peer not measured: {missing}"));
        }
        let folder = request.out.display().to_string();
        printer.summary(Stream::Output, &printer.with_warnings(&file), || {
            summary(&file, &folder)
        })
    }
}

impl Arguments {
    /// Tables of a whole run are kept and compared: what measures less, or more, goes elsewhere
    /// unless `--out` says where.
    fn folder(&self) -> Result<PathBuf, Failure> {
        let whole = !(self.quick || self.peers || self.scaling) && self.stage.is_empty();
        match &self.out {
            Some(out) => folder(out),
            None => Ok(PathBuf::from(if whole { WHOLE } else { PART })),
        }
    }

    fn catalogue(&self, printer: &Printer) -> Result<(), Failure> {
        let named = |name: &str| self.case.as_ref().is_none_or(|text| name.contains(text));
        let cases: Vec<Case> = extreme::cases()
            .into_iter()
            .filter(|case| named(case.name) && (case.in_ci || !self.quick))
            .collect();
        if cases.is_empty() {
            let text = self.case.as_deref().unwrap_or_default();
            return Err(Failure::Usage(format!(
                "no case of the catalogue is called {text:?}; without --case all are run"
            )));
        }
        let out = self.out.as_ref().map(folder).transpose()?;
        let made_with = catalogue_made_with(self.quick, self.case.as_deref());
        if let Some(out) = &out {
            check_catalogue(&made_with, out, self.writing.force)?;
        }
        let bar = begin(printer);
        let rows = extreme::run(&cases, &bar);
        bar.check().map_err(RunError::from)?;
        drop(bar);
        if let Some(out) = &out {
            write_catalogue(&rows, made_with.clone(), out, self.writing.force)?;
        }
        let table = catalogue_file(&rows, made_with);
        printer.summary(Stream::Output, &table, || cases_text(&table.cases))?;
        let failed: Vec<&str> = (table.cases.iter())
            .filter(|row| !row.pass)
            .map(|row| row.name.as_str())
            .collect();
        if failed.is_empty() {
            return Ok(());
        }
        Err(Failure::Verification(format!(
            "{} of {} failed: {}",
            failed.len(),
            count(cases.len(), "case"),
            failed.join(", ")
        )))
    }
}

/// Every case in a line, what was expected and what came out where they differ.
fn cases_text(rows: &[CaseRow]) -> String {
    let passed = rows.iter().filter(|row| row.pass).count();
    let mut sheet = Sheet::new(&format!(
        "the stability catalogue: {passed} of {} as expected",
        count(rows.len(), "case")
    ));
    let mut lines = vec![
        ["verdict", "case", "error", "bound", "s"]
            .map(str::to_owned)
            .to_vec(),
    ];
    lines.extend(rows.iter().map(|row| {
        vec![
            if row.pass { "ok" } else { "FAILED" }.to_owned(),
            row.name.clone(),
            error(row.error),
            error(row.bound),
            number_to(row.seconds, 2),
        ]
    }));
    let sides = "llrrr";
    sheet.raw(&table(sides, &lines));
    for row in rows.iter().filter(|row| !row.pass) {
        sheet.gap();
        sheet.line("failed", &row.name);
        sheet.line("expected", &row.expected);
        sheet.line("got", &row.got);
    }
    sheet.finish()
}

fn summary(file: &BenchFile, folder: &str) -> String {
    let mut sheet = Sheet::new("error against processor time, one thread");
    let mut rows = vec![
        [
            "stage", "curve", "knob", "coarsest", "", "default", "", "finest", "",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    for stage in &file.stages {
        for curve in &stage.curves {
            let default = curve.rows.iter().find(|row| row.default);
            let mut cells = vec![
                stage.stage.clone(),
                format!("{}: {}", curve.program, curve.name),
                curve.knob.clone(),
            ];
            for row in [curve.rows.first(), default, curve.rows.last()] {
                cells.extend(reported(row));
            }
            rows.push(cells);
        }
    }
    let sides = "lllrrrrrr";
    sheet.raw(&table(sides, &rows));
    sheet.gap();
    let files: Vec<String> = file
        .files
        .iter()
        .map(|entry| format!("{} ({})", entry.path, bytes(entry.bytes)))
        .collect();
    sheet.line(
        "written to",
        &format!("{folder}: {}, bench.json", files.join(", ")),
    );
    sheet.finish()
}

/// Error and time of a row.
fn reported(row: Option<&Row>) -> [String; 2] {
    row.map_or_else(<[String; 2]>::default, |row| {
        [number_to(row.error, 2), si(row.seconds, "s")]
    })
}
