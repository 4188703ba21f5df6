//! The folder of a sweep: `plan.json`, and `points/000/000123.json`, a thousand to a folder.
//!
//! A point's file is renamed into place but not forced to the disk: when the system is lost the
//! last seconds' points may be empty or cut short, which their checksum shows, and they are
//! computed again. Forcing each one would take longer than computing it.

use std::io;
use std::path::{Path, PathBuf};

use super::plan::PLAN_MAX_BYTES;
use super::{PlanFile, PointFile};
use crate::artefact::FLUXFORM_VERSION;
use crate::atomic::{Dir, Kind, Overwrite, SharedFolders, WriteError, put};
use crate::json::JsonError;
use crate::read_bounded::read_plain;
use crate::write::write_json;

/// The folder of the points' folders.
const POINTS: &str = "points";
/// The plan of a folder.
const PLAN: &str = "plan.json";
/// Points in one folder.
const FOLDER: u64 = 1000;
/// Larger files are no point of a sweep.
const POINT_MAX_BYTES: u64 = 1 << 20;

/// How often other runs may take a folder away before a point is in it.
const FOLDER_ATTEMPTS: usize = 100;

/// A sweep's folder.
#[derive(Debug, Clone)]
pub struct PointStore {
    folder: PathBuf,
}

/// State of a point's file.
#[derive(Debug, Clone, PartialEq)]
pub enum StoredPoint {
    /// The point, by this version of the program.
    Point(Box<PointFile>),
    /// Nothing, a torn file, or the point by another version.
    Nothing,
    /// Something else: not ours, or of another plan. The text says which.
    Foreign(String),
}

impl PointStore {
    /// The store in `folder`, which may not exist yet.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_path_buf(),
        }
    }

    /// The file of point `index`.
    #[must_use]
    pub fn path(&self, index: u64) -> PathBuf {
        self.subfolder(index).join(name(index))
    }

    fn subfolder(&self, index: u64) -> PathBuf {
        self.folder.join(POINTS).join(subfolder(index))
    }

    /// The folder of point `index`; below the store's own no link is followed.
    fn open(&self, index: u64) -> io::Result<Dir> {
        Dir::open(&self.folder)?
            .child(POINTS)?
            .child(subfolder(index))
    }

    /// Makes the folder this plan's: writes `plan.json` into it, makes the folders of the points
    /// `indices` and removes what killed runs left there. Folders into which no point came go when
    /// what is returned does.
    ///
    /// # Errors
    /// [`WriteError`]; also when the folder belongs to another plan and `force` is not given.
    pub fn claim(
        &self,
        plan: &PlanFile,
        force: bool,
        indices: std::ops::Range<u64>,
    ) -> Result<SharedFolders, WriteError> {
        let path = self.folder.join(PLAN);
        let ours = belongs_to(&path, plan, force)?;
        let mut folders = SharedFolders::default();
        if !indices.is_empty() {
            for folder in indices.start / FOLDER..=(indices.end - 1) / FOLDER {
                folders.make(&self.folder, &[POINTS, &subfolder(folder * FOLDER)])?;
            }
        }
        if !ours {
            match write_json(&path, &Overwrite::same_bytes(force, &plan.inputs), plan) {
                // Another run was faster: whose is the folder now?
                Err(WriteError::OutputExists { .. }) if belongs_to(&path, plan, force)? => {}
                outcome => drop(outcome?),
            }
        }
        Ok(folders)
    }

    /// Refuses a folder that holds another plan than this.
    ///
    /// # Errors
    /// That; a plan that cannot be read.
    pub fn check_plan(&self, plan: &PlanFile) -> Result<(), WriteError> {
        belongs_to(&self.folder.join(PLAN), plan, false).map(drop)
    }

    /// State of the file of point `index` of the plan with this digest.
    ///
    /// # Errors
    /// A file that is there and cannot be read.
    pub fn find(&self, plan_sha256: &str, index: u64) -> Result<StoredPoint, WriteError> {
        let path = self.path(index);
        let bytes = match read_plain(&path, POINT_MAX_BYTES) {
            Ok(_) if path.is_symlink() => {
                return Ok(StoredPoint::Foreign("and is a link".to_owned()));
            }
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Ok(StoredPoint::Nothing);
            }
            Err(error) => return Err(WriteError::from_io("read", &path, error)),
        };
        Ok(match PointFile::parse(&bytes) {
            Some(point) if point.plan_sha256 != plan_sha256 => {
                StoredPoint::Foreign("and belongs to another plan".to_owned())
            }
            Some(point) if point.index != index => {
                StoredPoint::Foreign(format!("and is point {} of the plan", point.index))
            }
            Some(point) if point.fluxform_version != FLUXFORM_VERSION => StoredPoint::Nothing,
            Some(point) => StoredPoint::Point(Box::new(point)),
            None if PointFile::is_torn(&bytes) => StoredPoint::Nothing,
            None => StoredPoint::Foreign("and is not a point of a sweep".to_owned()),
        })
    }

    /// Writes a point. A point of the same plan that is there is replaced, and with `force` any regular
    /// file.
    ///
    /// # Errors
    /// [`WriteError`]; a number that is none is [`WriteError::Content`].
    pub fn write(&self, point: &PointFile, force: bool) -> Result<(), WriteError> {
        let path = self.path(point.index);
        let bytes = point
            .to_bytes()
            .map_err(|error: JsonError| WriteError::Content {
                path: path.clone(),
                message: error.to_string(),
            })?;
        let mut folders = SharedFolders::default();
        for _ in 0..FOLDER_ATTEMPTS {
            match self.place(point, &bytes, force) {
                // Another run that stopped took the empty folder away.
                Err(WriteError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
                    folders.make(&self.folder, &[POINTS, &subfolder(point.index)])?;
                }
                outcome => return outcome,
            }
        }
        self.place(point, &bytes, force)
    }

    /// Writes the point's `bytes` into its folder, which must be there.
    fn place(&self, point: &PointFile, bytes: &[u8], force: bool) -> Result<(), WriteError> {
        let path = self.path(point.index);
        let fail = |error| WriteError::from_io("write", &path, error);
        let (dir, name) = (self.open(point.index).map_err(fail)?, name(point.index));
        match dir.status(&name).map_err(fail)?.map(|there| there.kind) {
            None => {}
            Some(Kind::File) if force => {}
            Some(Kind::File) => {
                if let StoredPoint::Foreign(reason) = self.find(&point.plan_sha256, point.index)? {
                    return Err(WriteError::OutputExists { path, reason });
                }
            }
            Some(Kind::Folder | Kind::Link | Kind::Special) => {
                let reason = "is not a regular file".to_owned();
                return Err(WriteError::Protected { path, reason });
            }
        }
        put(&dir, &name, false, |out| out.write_all(bytes)).map_err(fail)
    }
}

/// Whether the plan at `path` is this one; false where there is none, and where `force` replaces it.
fn belongs_to(path: &Path, plan: &PlanFile, force: bool) -> Result<bool, WriteError> {
    let bytes = match read_plain(path, PLAN_MAX_BYTES) {
        Ok(bytes) => bytes,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
        Err(error) => return Err(WriteError::from_io("read", path, error)),
    };
    match PlanFile::parse("", &bytes) {
        Ok(found) if found.plan_sha256 == plan.plan_sha256 => Ok(true),
        _ if force => Ok(false),
        _ => Err(WriteError::OutputExists {
            path: path.to_path_buf(),
            reason: "and is another plan: the folder holds another sweep".to_owned(),
        }),
    }
}

fn subfolder(index: u64) -> String {
    format!("{:03}", index / FOLDER)
}

fn name(index: u64) -> String {
    format!("{index:06}.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_another_run_took_away_is_made_again() {
        let place = tempfile::tempdir().unwrap();
        let store = PointStore::new(place.path());
        let point = PointFile::new("00", 7, Err("too small".to_owned()));
        store.write(&point, false).unwrap();
        assert!(store.path(7).is_file());
    }

    #[test]
    fn a_thousand_points_to_a_folder() {
        let store = PointStore::new(Path::new("out"));
        let path = |index| store.path(index).display().to_string();
        assert_eq!(path(0), "out/points/000/000000.json");
        assert_eq!(path(123_456), "out/points/123/123456.json");
        assert_eq!(path(9_999_999), "out/points/9999/9999999.json");
    }
}
