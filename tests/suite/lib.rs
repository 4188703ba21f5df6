//! Error against time of every numerical stage, and time and memory against size.
//!
//! Designs and reference values are built into the program, so a measurement needs no file. One
//! thread, unless threads are what is measured.

pub mod arguments;
pub mod catalogue;
pub mod effort;
pub mod extreme;
pub mod file;
pub mod memory;
pub mod output;
pub mod page;
pub mod peers;
pub mod picture;
pub mod scaling;
pub mod schema;
pub mod stages;
pub mod summary;

mod catalogue_page;
mod force;
mod inputs;
mod reference;
mod test_surface;

use std::collections::BTreeMap;
use std::path::PathBuf;

use self::effort::Pace;
use self::stages::{Measured, STAGES, Stage};
use crate::file::BenchFile;
use fluxform::RunError;
use fluxform::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION, UNITS};
use fluxform::progress::Progress;

/// The request.
#[derive(Debug, Clone, PartialEq)]
pub struct BenchRequest {
    /// How much of every curve.
    pub pace: Pace,
    /// Names of stages; none: all.
    pub stages: Vec<String>,
    /// Whether peers are measured too.
    pub peers: bool,
    /// Whether time and memory are measured against size.
    pub scaling: bool,
    /// Which of those laws, by [`scaling::Spec::name`]; none: all. The others stay as the folder has them.
    pub laws: Vec<String>,
    /// Folder of the files.
    pub out: PathBuf,
    /// Replace what is there, whatever it is.
    pub force: bool,
}

/// The stages that are measured.
fn chosen(request: &BenchRequest) -> impl Iterator<Item = &'static Stage> {
    STAGES.iter().filter(|stage| {
        request.stages.is_empty() || request.stages.iter().any(|expected| expected == stage.name)
    })
}

/// Their inputs, each once.
fn inputs(request: &BenchRequest) -> Vec<Input> {
    let mut all: Vec<Input> = Vec::new();
    for input in chosen(request).flat_map(Stage::inputs) {
        if !all.contains(&input) {
            all.push(input);
        }
    }
    all
}

/// Measures, and writes the files.
///
/// # Errors
/// Files that must not be replaced; a stage that fails; interruption.
pub fn run(request: &BenchRequest, progress: &dyn Progress) -> Result<BenchFile, RunError> {
    let of = (&*inputs(request), &output::made_with(request));
    output::check(of, &request.out, request.force)?;
    let mut file = measure(request, progress)?;
    output::write(&mut file, &request.out, request.force)?;
    Ok(file)
}

/// Measures, and writes nothing.
///
/// # Errors
/// As [`run`].
pub fn measure(request: &BenchRequest, progress: &dyn Progress) -> Result<BenchFile, RunError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .map_err(|error| RunError::Unmet(format!("no thread to measure on: {error}")))?;
    let mut measured: Vec<Measured> = Vec::new();
    for stage in chosen(request) {
        progress.begin(stage.name, 1);
        measured.push(pool.install(|| stage.run(&request.pace, progress))?);
        progress.end();
    }
    let peers_missing = if request.peers {
        pool.install(|| peers::add(&mut measured, request.pace.quick, progress))?
    } else {
        Vec::new()
    };
    let scaling = if request.scaling {
        scaling::laws(request, output::earlier_laws(request)?, progress)?
    } else {
        Vec::new()
    };
    let mut accuracy = BTreeMap::new();
    let mut stages = Vec::new();
    for stage in measured {
        accuracy.insert(stage.curves.stage.clone(), stage.accuracy);
        stages.push(stage.curves);
    }
    Ok(BenchFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        inputs: inputs(request),
        made_with: output::made_with(request),
        units: UNITS.to_owned(),
        quick: request.pace.quick,
        stages,
        scaling,
        peers_missing,
        accuracy,
        files: Vec::new(),
    })
}
