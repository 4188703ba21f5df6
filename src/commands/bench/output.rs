//! The files of a run: table, pictures, page, and the JSON that states all.

use super::BenchRequest;
use super::page::{PAGE, html, picture_names, pictures};
use serde::Serialize;

use crate::RunError;
use crate::bundle::artefact::{FileEntry, Input, Options};
use crate::bundle::atomic::{FileSet, Overwrite};
use crate::bundle::bench::{BenchFile, write_runs};
use crate::bundle::manifest::SurfaceOptions;
use crate::bundle::seal::to_record;
use crate::commands::lambda::LambdaOptions;
use crate::commands::made_with::surface;
use crate::lambda::{Criterion, Settings};
use crate::point_weights::Weights;

/// Name of the JSON file.
const JSON: &str = "bench.json";
/// Name of the table.
const TABLE: &str = "bench.csv";

fn overwrite(inputs: &[Input], request: &BenchRequest) -> Overwrite {
    Overwrite::new(request.force, request.out.join(JSON), inputs).made_with(&made_with(request))
}

/// The options of a run as its record states them.
#[must_use]
pub fn made_with(request: &BenchRequest) -> Options {
    #[derive(Serialize)]
    struct Recorded {
        criterion: Criterion,
        jnd: f64,
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        jnd_by_force: bool,
        tolerance: Option<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        weights: Option<Weights>,
        max_deviation_m: Option<f64>,
        quick: bool,
        surfaces: Vec<Option<SurfaceOptions>>,
    }
    let BenchRequest {
        design: _,
        inputs: _,
        shapes,
        lambda,
        max_deviation_m,
        quick,
        out: _,
        force: _,
    } = request;
    let LambdaOptions {
        settings,
        tolerance,
        weights,
        // Not options of this command.
        error: _,
        sampling: _,
        wiring: _,
        variants: _,
        feedback: _,
        picture: _,
        force: _,
        direction_jnd_deg: _,
        uncertainty: _,
        jnd_by_force,
        // A scene's grids are measured as they are.
        default_error: _,
    } = lambda;
    let Settings {
        criterion,
        jnd_weight,
        at_n_per_m: _,
    } = *settings;
    let surfaces = shapes.iter();
    let surfaces = surfaces.map(|shape| surface(&shape.document, shape.input.as_ref()));
    Options::of(&Recorded {
        criterion,
        jnd: jnd_weight,
        jnd_by_force: *jnd_by_force,
        tolerance: *tolerance,
        weights: *weights,
        max_deviation_m: *max_deviation_m,
        quick: *quick,
        surfaces: surfaces.collect(),
    })
}

/// Refuses before a long run when its files must not replace what is there.
///
/// # Errors
/// An output of something else.
pub fn check(inputs: &[Input], request: &BenchRequest) -> Result<(), RunError> {
    let overwrite = overwrite(inputs, request);
    let shapes = request.shapes.iter();
    let pictures = shapes.flat_map(|shape| picture_names(&shape.document.name));
    let others = [JSON, TABLE, PAGE].map(str::to_owned);
    for name in others.into_iter().chain(pictures) {
        overwrite.check(&request.out.join(name))?;
    }
    Ok(())
}

/// Writes all files; `files` lists them but for the JSON itself.
///
/// # Errors
/// Files that cannot be written or must not be replaced.
pub fn write(file: &mut BenchFile, request: &BenchRequest) -> Result<(), RunError> {
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
    let json = to_record(file).map_err(|fault| RunError::Input(fault.to_string()))?;
    set.write(JSON, |out| out.write_all(&json))?;
    Ok(set.commit()?)
}
