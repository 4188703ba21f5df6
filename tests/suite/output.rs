//! The files of a run: table, plots, summary, and the JSON that describes all.

use std::path::Path;

use serde::Serialize;

use crate::BenchRequest;
use crate::catalogue::{CaseRow, CatalogueFile, write_cases};
use crate::file::{BenchFile, write_laws, write_rows};
use fluxform::RunError;
use fluxform::bundle::artefact::{
    FLUXFORM_VERSION, FileEntry, Input, Options, SCHEMA_VERSION, UNITS,
};
use fluxform::bundle::atomic::{FileSet, Overwrite};
use fluxform::bundle::read_bounded::read_plain;
use fluxform::bundle::seal::to_record;

use crate::catalogue_page;
use crate::page::{self, PAGE};
use crate::picture::picture;
use crate::summary::markdown;

/// Name of the JSON file.
pub const JSON: &str = "bench.json";
/// A larger one is none of ours.
const JSON_MAX_BYTES: u64 = 64 << 20;

/// The options of a run as its record states them, or those of an `earlier` one some of whose rows are
/// measured again.
#[must_use]
pub fn made_with(request: &BenchRequest, earlier: Option<&BenchFile>) -> Options {
    let again = earlier.filter(|file| {
        let known = |name: &String| file.stages.iter().any(|stage| stage.stage == *name);
        file.quick == request.pace.quick && request.stages.iter().all(known)
    });
    if let Some(file) = again {
        return file.made_with.clone();
    }
    #[derive(Serialize)]
    struct Asked<'a> {
        quick: bool,
        stages: &'a [String],
        peers: bool,
        scaling: bool,
    }
    let BenchRequest {
        pace,
        stages,
        peers,
        scaling,
        // Which are measured again: the file holds the others too.
        laws: _,
        out: _,
        force: _,
    } = request;
    Options::of(&Asked {
        quick: pace.quick,
        stages,
        peers: *peers,
        scaling: *scaling,
    })
}

/// As [`made_with`], of the catalogue: the part of it and the text in the cases' names.
#[must_use]
pub fn catalogue_made_with(quick: bool, case: Option<&str>) -> Options {
    #[derive(Serialize)]
    struct Asked<'a> {
        quick: bool,
        case: Option<&'a str>,
    }
    Options::of(&Asked { quick, case })
}

/// When files of an earlier run may be replaced.
fn overwrite(
    (inputs, made_with): (&[Input], &Options),
    folder: &Path,
    record: &str,
    force: bool,
) -> Overwrite {
    Overwrite::new(force, folder.join(record), inputs).made_with(made_with)
}

/// Refuses before a long run when its files must not replace those in `folder`.
///
/// # Errors
/// An output of something else.
pub fn check(of: (&[Input], &Options), folder: &Path, force: bool) -> Result<(), RunError> {
    Ok(overwrite(of, folder, JSON, force).check(&folder.join(JSON))?)
}

/// An earlier run in the folder, where not all laws are measured again.
///
/// # Errors
/// A file of something else.
pub fn earlier(request: &BenchRequest) -> Result<Option<BenchFile>, RunError> {
    let path = request.out.join(JSON);
    if request.laws.is_empty() || !path.exists() {
        return Ok(None);
    }
    let refused =
        |fault: &dyn std::fmt::Display| RunError::Input(format!("{}: {fault}", path.display()));
    let bytes = read_plain(&path, JSON_MAX_BYTES).map_err(|fault| refused(&fault))?;
    serde_json::from_slice(&bytes).map_err(|fault| refused(&fault))
}

/// Writes all files; `files` lists them but for the JSON itself.
///
/// # Errors
/// Files that cannot be written or must not be replaced.
pub fn write(file: &mut BenchFile, folder: &Path, force: bool) -> Result<(), RunError> {
    let overwrite = overwrite((&file.inputs, &file.made_with), folder, JSON, force);
    let mut set = FileSet::begin(folder, overwrite);
    let mut entries = Vec::new();
    let table = set.write("bench.csv", |out| write_rows(out, &file.stages))?;
    entries.push(FileEntry::new("bench.csv", table));
    if !file.scaling.is_empty() {
        let table = set.write("scaling.csv", |out| write_laws(out, &file.scaling))?;
        entries.push(FileEntry::new("scaling.csv", table));
    }
    for stage in &file.stages {
        let name = format!("{}.svg", stage.stage);
        let svg = picture(stage).drawing().svg();
        let drawn = set.write(&name, |out| out.write_all(svg.as_bytes()))?;
        entries.push(FileEntry::new(name, drawn));
    }
    let text = markdown(file);
    let reported = set.write("summary.md", |out| out.write_all(text.as_bytes()))?;
    entries.push(FileEntry::new("summary.md", reported));
    let html = page::html(file);
    let shown = set.write(PAGE, |out| out.write_all(html.as_bytes()))?;
    entries.push(FileEntry::new(PAGE, shown));
    file.files = entries;
    let json = to_record(file).map_err(|fault| RunError::Input(fault.to_string()))?;
    set.write(JSON, |out| out.write_all(&json))?;
    Ok(set.commit()?)
}

/// Name of the catalogue's JSON file.
pub const CATALOGUE: &str = "extreme.json";

/// Writes the stability catalogue: its JSON, its table and its page.
///
/// # Errors
/// Files that cannot be written or must not be replaced.
pub fn write_catalogue(
    cases: &[CaseRow],
    made_with: Options,
    folder: &Path,
    force: bool,
) -> Result<(), RunError> {
    let overwrite = overwrite((&[], &made_with), folder, CATALOGUE, force);
    let mut set = FileSet::begin(folder, overwrite);
    let mut file = catalogue_file(cases, made_with);
    let table = set.write("extreme.csv", |out| write_cases(out, cases))?;
    let html = catalogue_page::html(cases);
    let shown = set.write(PAGE, |out| out.write_all(html.as_bytes()))?;
    file.files = vec![
        FileEntry::new("extreme.csv", table),
        FileEntry::new(PAGE, shown),
    ];
    let json = to_record(&file).map_err(|fault| RunError::Input(fault.to_string()))?;
    set.write(CATALOGUE, |out| out.write_all(&json))?;
    Ok(set.commit()?)
}

/// The catalogue as `extreme.json` and standard output give it.
#[must_use]
pub fn catalogue_file(cases: &[CaseRow], made_with: Options) -> CatalogueFile {
    CatalogueFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        inputs: Vec::new(),
        made_with,
        units: UNITS.to_owned(),
        cases: cases.to_vec(),
        files: Vec::new(),
    }
}

/// Refuses as [`check`] does, for the catalogue.
///
/// # Errors
/// An output of something else.
pub fn check_catalogue(made_with: &Options, folder: &Path, force: bool) -> Result<(), RunError> {
    let overwrite = overwrite((&[], made_with), folder, CATALOGUE, force);
    Ok(overwrite.check(&folder.join(CATALOGUE))?)
}
