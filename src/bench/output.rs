//! The files of a run: table, pictures, page, and the JSON that states all.

use super::BenchRequest;
use super::page::{PAGE, html, pictures};
use crate::bundle::artefact::{FileEntry, Input};
use crate::bundle::atomic::{FileSet, Overwrite};
use crate::bundle::bench::{BenchFile, write_runs};
use crate::bundle::json::to_json;
use crate::job::JobError;

/// Name of the JSON file.
const JSON: &str = "bench.json";
/// Name of the table.
const TABLE: &str = "bench.csv";

fn overwrite(inputs: &[Input], request: &BenchRequest) -> Overwrite {
    Overwrite::new(request.force, request.out.join(JSON), inputs)
}

/// Refuses before a long run when its files must not replace what is there.
///
/// # Errors
/// An output of something else.
pub fn check(inputs: &[Input], request: &BenchRequest) -> Result<(), JobError> {
    Ok(overwrite(inputs, request).check(&request.out.join(JSON))?)
}

/// Writes all files; `files` lists them but for the JSON itself.
///
/// # Errors
/// Files that cannot be written or must not be replaced.
pub fn write(file: &mut BenchFile, request: &BenchRequest) -> Result<(), JobError> {
    let mut set = FileSet::begin(&request.out, overwrite(&file.inputs, request));
    let mut entries = Vec::new();
    let table = set.write(TABLE, |out| write_runs(out, &file.shapes))?;
    entries.push(FileEntry::new(TABLE, table));
    let mut texts = pictures(file);
    texts.push((PAGE.to_owned(), html(file)));
    for (name, text) in texts {
        let written = set.write(&name, |out| out.write_all(text.as_bytes()))?;
        entries.push(FileEntry::new(name, written));
    }
    file.files = entries;
    let json = to_json(file).map_err(|fault| JobError::Input(fault.to_string()))?;
    set.write(JSON, |out| out.write_all(&json))?;
    Ok(set.commit()?)
}
