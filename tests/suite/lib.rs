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
    /// Which of those laws, by [`scaling::Spec::name`]; none: all. The others, and stages that are not named, stay
    /// as the folder has them.
    pub laws: Vec<String>,
    /// Folder of the files.
    pub out: PathBuf,
    /// Replace what is there, whatever it is.
    pub force: bool,
}

/// The stages that are measured: those named, or all unless chosen laws are measured again.
fn chosen(request: &BenchRequest) -> impl Iterator<Item = &'static Stage> {
    let all = request.stages.is_empty() && request.laws.is_empty();
    STAGES
        .iter()
        .filter(move |stage| all || request.stages.iter().any(|named| named == stage.name))
}

/// The inputs of an `earlier` run whose rows stay and of the stages that are measured, each once.
fn inputs(request: &BenchRequest, earlier: Option<&BenchFile>) -> Vec<Input> {
    let mut all = earlier.map_or(Vec::new(), |file| file.inputs.clone());
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
    let earlier = output::earlier(request)?;
    let made_with = output::made_with(request, earlier.as_ref());
    let of = (&*inputs(request, earlier.as_ref()), &made_with);
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
    let earlier = output::earlier(request)?;
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
        let known = earlier.as_ref().map_or(&[][..], |file| &file.scaling);
        scaling::laws(request, known, progress)?
    } else {
        Vec::new()
    };
    let inputs = inputs(request, earlier.as_ref());
    let made_with = output::made_with(request, earlier.as_ref());
    // Rows that are not measured again stay.
    let (mut stages, mut accuracy) = earlier.map_or_else(
        || (Vec::new(), BTreeMap::new()),
        |file| (file.stages, file.accuracy),
    );
    for stage in measured {
        accuracy.insert(stage.curves.stage.clone(), stage.accuracy);
        stages.retain(|known| known.stage != stage.curves.stage);
        stages.push(stage.curves);
    }
    stages.sort_by_key(|stage| STAGES.iter().position(|known| known.name == stage.stage));
    Ok(BenchFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        inputs,
        made_with,
        units: UNITS.to_owned(),
        quick: request.pace.quick,
        stages,
        scaling,
        peers_missing,
        accuracy,
        files: Vec::new(),
    })
}
