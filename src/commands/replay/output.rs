//! The files of a replay: its table, the facts beside it, the seconds, the picture.

use std::io;
use std::path::{Path, PathBuf};

use super::ReplayReport;
use crate::RunError;
use crate::bundle::artefact::FileEntry;
use crate::bundle::atomic::{self, FileSet, Overwrite};
use crate::bundle::json::to_json;
use crate::bundle::replay::{Answer, FingerRows};
use crate::bundle::seal::to_record;
use crate::bundle::timing::{ReplayTiming, StageSeconds};
use crate::bundle::trajectory::Trajectory;
use crate::plot::drawing::Drawing;
use crate::plot::replay::{FingerCurves, ReplayPlot};

/// Names of the files that go with a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplayFiles {
    folder: PathBuf,
    table: String,
    facts: String,
    timing: String,
}

impl ReplayFiles {
    /// Those of the table at `path`: `replay.csv`, `replay.json` and `timing_replay.json`.
    ///
    /// # Errors
    /// An invalid name, or one that ends as the facts' file does.
    pub fn new(path: &Path) -> Result<Self, String> {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        let stem = path
            .file_stem()
            .map(|stem| stem.to_string_lossy().into_owned());
        let (Some(table), Some(stem)) = (name, stem) else {
            return Err(format!(
                "--out {}: name a file to write the table to",
                path.display()
            ));
        };
        let facts = format!("{stem}.json");
        if facts == table {
            return Err(format!(
                "--out {}: the facts beside the table take the ending .json; name it otherwise",
                path.display()
            ));
        }
        let folder = match path.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        Ok(Self {
            folder: folder.to_path_buf(),
            table,
            facts,
            timing: format!("timing_{stem}.json"),
        })
    }

    /// The file that records the inputs and options of the others.
    #[must_use]
    pub fn record(&self) -> PathBuf {
        self.folder.join(&self.facts)
    }

    /// The names of the files, for people.
    #[must_use]
    pub fn names(&self) -> [&str; 3] {
        [&self.table, &self.facts, &self.timing]
    }

    /// Their folder.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Their paths.
    #[must_use]
    pub fn paths(&self) -> [PathBuf; 3] {
        self.names().map(|name| self.folder.join(name))
    }
}

impl ReplayReport {
    /// Adds table, facts and seconds to `set`, which begins in the files' folder.
    ///
    /// # Errors
    /// [`RunError::Write`].
    pub fn stage(&mut self, files: &ReplayFiles, set: &mut FileSet) -> Result<(), RunError> {
        let timing = ReplayTiming {
            positions: self.rows.len(),
            seconds_per_step: self.step_s,
            stages: self
                .seconds
                .iter()
                .map(|(stage, seconds)| StageSeconds {
                    stage: stage.clone(),
                    seconds: *seconds,
                })
                .collect(),
        };
        let table = set.write(&files.table, |out| self.rows.write(out))?;
        self.summary.files = vec![FileEntry::new(&files.table, table)];
        set.write(&files.timing, |out| {
            out.write_all(&to_json(&timing).map_err(io::Error::other)?)
        })?;
        set.write(&files.facts, |out| {
            out.write_all(&to_record(&self.summary).map_err(io::Error::other)?)
        })?;
        Ok(())
    }

    /// The picture.
    #[must_use]
    pub fn drawing(&self) -> Drawing {
        self.plot().drawing()
    }

    fn plot(&self) -> ReplayPlot<'_> {
        let rows = &self.rows;
        let summary = &self.summary;
        let curves = |finger| {
            let finger: &FingerRows = finger;
            FingerCurves {
                position_m: &finger.position_m,
                surface_m: &finger.height_m,
                inside: (finger.answer.iter())
                    .map(|answer| *answer != Answer::Outside)
                    .collect(),
                requested_n: &finger.wanted_force_n,
                given_n: &finger.force_n,
                static_n: &finger.static_force_n,
            }
        };
        ReplayPlot {
            title: format!("{} on {}", summary.shape, summary.design),
            t_s: &rows.t_s,
            fingers: rows.fingers().map(curves).collect(),
            coils: rows.coils,
            current_a: &rows.current_a,
        }
    }
}

/// Writes a trajectory.
///
/// # Errors
/// [`RunError::Write`].
pub fn write_trajectory(
    trajectory: &Trajectory,
    path: &Path,
    overwrite: &Overwrite,
) -> Result<(), RunError> {
    atomic::write(path, overwrite, |out| trajectory.write(out))?;
    Ok(())
}
