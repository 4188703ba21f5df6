//! The files of a run: table, plots, summary, and the JSON that tells of all.

use std::path::Path;

use crate::catalogue::{CaseRow, CatalogueFile, write_cases};
use crate::file::{BenchFile, write_laws, write_rows};
use fluxform::bundle::artefact::{FLUXFORM_VERSION, FileEntry, Input, SCHEMA_VERSION, UNITS};
use fluxform::bundle::atomic::{FileSet, Overwrite};
use fluxform::bundle::json::to_json;
use fluxform::job::JobError;

use crate::catalogue_page;
use crate::page::{self, PAGE};
use crate::picture::picture;
use crate::summary::markdown;

/// Name of the JSON file.
pub const JSON: &str = "bench.json";

/// When files of an earlier run may be replaced.
fn overwrite(inputs: &[Input], folder: &Path, record: &str, force: bool) -> Overwrite {
    Overwrite::new(force, folder.join(record), inputs)
}

/// Refuses before a long run when its files must not replace those in `folder`.
///
/// # Errors
/// An output of something else.
pub fn check(inputs: &[Input], folder: &Path, force: bool) -> Result<(), JobError> {
    Ok(overwrite(inputs, folder, JSON, force).check(&folder.join(JSON))?)
}

/// Writes all files; `files` lists them but for the JSON itself.
///
/// # Errors
/// Files that cannot be written or must not be replaced.
pub fn write(file: &mut BenchFile, folder: &Path, force: bool) -> Result<(), JobError> {
    let overwrite = overwrite(&file.inputs, folder, JSON, force);
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
        let svg = picture(stage).svg();
        let drawn = set.write(&name, |out| out.write_all(svg.as_bytes()))?;
        entries.push(FileEntry::new(name, drawn));
    }
    let text = markdown(file);
    let told = set.write("summary.md", |out| out.write_all(text.as_bytes()))?;
    entries.push(FileEntry::new("summary.md", told));
    let html = page::html(file);
    let shown = set.write(PAGE, |out| out.write_all(html.as_bytes()))?;
    entries.push(FileEntry::new(PAGE, shown));
    file.files = entries;
    let json = to_json(file).map_err(|fault| JobError::Input(fault.to_string()))?;
    set.write(JSON, |out| out.write_all(&json))?;
    Ok(set.commit()?)
}

/// Name of the catalogue's JSON file.
pub const CATALOGUE: &str = "extreme.json";

/// Writes the stability catalogue: its JSON, its table and its page.
///
/// # Errors
/// Files that cannot be written or must not be replaced.
pub fn write_catalogue(cases: &[CaseRow], folder: &Path, force: bool) -> Result<(), JobError> {
    let mut set = FileSet::begin(folder, overwrite(&[], folder, CATALOGUE, force));
    let mut file = catalogue_file(cases);
    let table = set.write("extreme.csv", |out| write_cases(out, cases))?;
    let html = catalogue_page::html(cases);
    let shown = set.write(PAGE, |out| out.write_all(html.as_bytes()))?;
    file.files = vec![
        FileEntry::new("extreme.csv", table),
        FileEntry::new(PAGE, shown),
    ];
    let json = to_json(&file).map_err(|fault| JobError::Input(fault.to_string()))?;
    set.write(CATALOGUE, |out| out.write_all(&json))?;
    Ok(set.commit()?)
}

/// The catalogue as `extreme.json` and standard output tell it.
#[must_use]
pub fn catalogue_file(cases: &[CaseRow]) -> CatalogueFile {
    CatalogueFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        inputs: Vec::new(),
        units: UNITS.to_owned(),
        cases: cases.to_vec(),
        files: Vec::new(),
    }
}

/// Refuses as [`check`] does, for the catalogue.
///
/// # Errors
/// An output of something else.
pub fn check_catalogue(folder: &Path, force: bool) -> Result<(), JobError> {
    Ok(overwrite(&[], folder, CATALOGUE, force).check(&folder.join(CATALOGUE))?)
}
