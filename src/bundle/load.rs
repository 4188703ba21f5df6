//! Reading a bundle back: the library's own loader.
//!
//! A bundle is untrusted. The manifest is read first; every file it lists must be a plain file
//! inside the folder, reached without links, with the listed size and digest. All sizes are checked
//! before any file is read; a file that is parsed is read once, so what is parsed is what was
//! hashed, and the others are hashed block by block. Memory is bounded by the size that the parsed
//! files take on the disk and by `FILE_MAX_BYTES` each.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::artefact::{FileEntry, check_version, sha256_hex};
use super::atomic::check_name;
use super::cross_check;
use super::json::fault;
use super::lambda_file::LambdaFile;
use super::manifest::Manifest;
use super::npz::{MapArrays, from_npz};
use super::read_bounded::{FILE_MAX_BYTES, check_plain, digest_plain, read_plain};
use super::read_table::{read_currents, read_rows};
use super::seal::{SEAL, is_sealed};
use super::table::{CurrentRow, PointRow};
use fluxform_numerics::lagrange::{Cell, locate};

/// The file of the map, by far the largest.
const MAP: &str = "map.npz";
const POINTS: &str = "points.csv";
/// Manifests larger than this are refused unread.
const MANIFEST_MAX_BYTES: u64 = 64 << 20;

/// Longer names are none of a bundle's files; of them so much is shown.
const NAME_BYTES: usize = 1024;
const NAME_SHOWN: usize = 100;

/// Why a bundle cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum BundleError {
    /// There is no manifest: not a bundle.
    #[error("{path} is not a bundle: it has no manifest.json")]
    NoBundle {
        /// The folder.
        path: PathBuf,
    },
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Written by a program with another layout.
    #[error("{path}: schema_version {message}")]
    Schema {
        /// The manifest.
        path: PathBuf,
        /// Result and expectation.
        message: String,
    },
    /// The manifest lists a file that it must not.
    #[error("{path} lists {name:?}, which {message}")]
    Listed {
        /// The manifest.
        path: PathBuf,
        /// The listed name.
        name: String,
        /// Why it is refused.
        message: String,
    },
    /// A file is not the one that was written.
    #[error("{path} was changed or damaged: {message}; make the bundle again")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// How it differs.
        message: String,
    },
    /// A file's content is not as it must be.
    #[error("{path}: {message}")]
    Content {
        /// The file.
        path: PathBuf,
        /// Expectation and result.
        message: String,
    },
}

/// A bundle in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Bundle {
    /// Where it was read from.
    pub folder: PathBuf,
    /// `manifest.json`.
    pub manifest: Manifest,
    /// `map.npz`.
    pub map: MapArrays<'static>,
    /// `points.csv`.
    pub points: Vec<PointRow>,
    /// `currents.csv`.
    pub currents: Vec<CurrentRow>,
    /// `lambda.json`.
    pub lambda: LambdaFile,
    /// Digest of `manifest.json`, which holds those of all other files.
    pub manifest_sha256: String,
}

/// The folder of the bundle that `path` names, or whose manifest it names.
fn folder_of(path: &Path) -> &Path {
    match path.file_name() {
        Some(name) if name == "manifest.json" => path.parent().unwrap_or(Path::new("")),
        _ => path,
    }
}

impl Bundle {
    /// The sizes of map and points of the bundle at `path`, which is not opened, in bytes; `None` where there is none.
    #[must_use]
    pub fn stored_bytes(path: &Path) -> Option<[u64; 2]> {
        let size = |name: &str| Some(folder_of(path).join(name).metadata().ok()?.len());
        Some([size(MAP)?, size(POINTS)?])
    }

    /// Reads and checks the bundle in a folder (or the one whose `manifest.json` is given).
    ///
    /// # Errors
    /// [`BundleError`] for the first thing that is not as it must be.
    pub fn open(path: &Path) -> Result<Self, BundleError> {
        let folder = folder_of(path);
        let manifest_path = folder.join("manifest.json");
        let (manifest, text) = read_manifest(folder, &manifest_path)?;
        let manifest_sha256 = sha256_hex(&text);
        drop(text);
        let listed = Listed {
            folder,
            manifest: &manifest_path,
            root: folder.canonicalize().map_err(|source| BundleError::Read {
                path: folder.to_path_buf(),
                source,
            })?,
        };
        // All places and sizes before any content.
        let mut names = BTreeSet::new();
        let mut paths = Vec::new();
        for entry in &manifest.files {
            paths.push(listed.checked(entry)?);
            if !names.insert(entry.path.as_str()) {
                return Err(listed.refused(entry, "is there twice"));
            }
        }
        let mut files = Vec::new();
        for (entry, path) in manifest.files.iter().zip(&paths) {
            if REQUIRED.contains(&entry.path.as_str()) {
                files.push((entry.path.clone(), listed.read(entry, path)?));
            } else {
                listed.digested(entry, path)?;
            }
        }
        let part = |name: &str| {
            let found = files.iter().find(|(listed, _)| listed == name);
            found
                .map(|(_, bytes)| bytes.as_slice())
                .ok_or_else(|| BundleError::Content {
                    path: manifest_path.clone(),
                    message: format!("files does not list {name}, which every bundle has"),
                })
        };
        let content = |name: &str, message: String| BundleError::Content {
            path: folder.join(name),
            message,
        };
        let [map, points, currents, lambda] = REQUIRED;
        let bundle = Self {
            folder: folder.to_path_buf(),
            map: from_npz(part(map)?).map_err(|error| content(map, error.to_string()))?,
            points: read_rows(points, part(points)?, PointRow::COLUMNS)
                .map_err(|error| content(points, error.to_string()))?,
            currents: read_currents(currents, part(currents)?)
                .map_err(|error| content(currents, error.to_string()))?,
            lambda: serde_json::from_slice(part(lambda)?)
                .map_err(|error| content(lambda, fault(&error)))?,
            manifest,
            manifest_sha256,
        };
        cross_check::check(
            &bundle.manifest,
            &bundle.map,
            &bundle.points,
            &bundle.currents,
            &bundle.lambda,
        )
        .map_err(|message| content("manifest.json", message))?;
        Ok(bundle)
    }

    /// Number of coils of the array, those left out of the map included.
    #[must_use]
    pub fn coil_count(&self) -> usize {
        self.map.runtime.current_max_a.len()
    }

    /// dB_z/dz per ampere of every coil of the array at (x, y, z) m, T/m/A, interpolated; zero for
    /// coils left out of the map. Outside the map: all zero, and false.
    ///
    /// # Panics
    /// When `gz_t_per_m_per_a` is shorter than the array.
    pub(crate) fn gz_per_ampere(&self, position_m: [f64; 3], gz_t_per_m_per_a: &mut [f64]) -> bool {
        let nodes = self.nodes();
        let gz = &self.map.gz_t_per_m_per_a;
        self.each_coil(position_m, gz_t_per_m_per_a, |cell, place| {
            cell.value(&gz[place * nodes..(place + 1) * nodes])
        })
    }

    /// Upward force per ampere of every coil of the array on the magnet's centre at (x, y, z) m,
    /// N/A: sum over i of m_i dB_i/dz, interpolated. Outside the map: all zero, and false.
    ///
    /// # Panics
    /// When `force_n_per_a` is shorter than the array.
    pub fn force_per_ampere(&self, position_m: [f64; 3], force_n_per_a: &mut [f64]) -> bool {
        let [m_x, m_y, m_z] = self.map.runtime.moment_a_m2;
        let nodes = self.nodes();
        match &self.map.gradient_t_per_m_per_a {
            Some(gradient) if m_x != 0.0 || m_y != 0.0 => {
                self.each_coil(position_m, force_n_per_a, |cell, place| {
                    let block = &gradient[9 * place * nodes..9 * (place + 1) * nodes];
                    m_x * cell.component(block, 9, 2)
                        + m_y * cell.component(block, 9, 5)
                        + m_z * cell.component(block, 9, 8)
                })
            }
            _ => {
                let inside = self.gz_per_ampere(position_m, force_n_per_a);
                force_n_per_a.iter_mut().for_each(|force| *force *= m_z);
                inside
            }
        }
    }

    /// Force per ampere of every coil of the array on the magnet's centre at (x, y, z) m along x, y and z, N/A:
    /// F = grad(m.B), interpolated. `None` for bundles that hold the upward component alone; outside the map:
    /// all zero, and false.
    ///
    /// # Panics
    /// When `force_n_per_a` is shorter than the array.
    pub fn force_vector_per_ampere(
        &self,
        position_m: [f64; 3],
        force_n_per_a: &mut [[f64; 3]],
    ) -> Option<bool> {
        let map = &self.map;
        let sides = map.sides()?;
        let [m_x, m_y, m_z] = map.runtime.moment_a_m2;
        let nodes = self.nodes();
        let tensors = map.gradient_t_per_m_per_a.as_deref();
        Some(match tensors.filter(|_| m_x != 0.0 || m_y != 0.0) {
            Some(gradient) => self.each_coil(position_m, force_n_per_a, |cell, place| {
                let block = &gradient[9 * place * nodes..9 * (place + 1) * nodes];
                std::array::from_fn(|axis| {
                    m_x * cell.component(block, 9, axis)
                        + m_y * cell.component(block, 9, 3 + axis)
                        + m_z * cell.component(block, 9, 6 + axis)
                })
            }),
            None => self.each_coil(position_m, force_n_per_a, |cell, place| {
                let [gx, gy] = sides;
                [gx, gy, &map.gz_t_per_m_per_a]
                    .map(|all| m_z * cell.value(&all[place * nodes..(place + 1) * nodes]))
            }),
        })
    }

    /// Force of the unpowered steel on the magnet's centre at (x, y, z) m, N,
    /// positive upwards, interpolated: zero for bundles without it. `None` outside the map.
    #[must_use]
    pub fn passive_force_n(&self, position_m: [f64; 3]) -> Option<f64> {
        let cell = locate([&self.map.x_m, &self.map.y_m, &self.map.z_m], position_m)?;
        let pull = self.map.passive_force_n.as_ref();
        Some(pull.map_or(0.0, |pull| cell.value(pull)))
    }

    fn nodes(&self) -> usize {
        self.map.x_m.len() * self.map.y_m.len() * self.map.z_m.len()
    }

    fn each_coil<T: Copy + Default>(
        &self,
        position_m: [f64; 3],
        values: &mut [T],
        value: impl Fn(&Cell, usize) -> T,
    ) -> bool {
        let values = &mut values[..self.coil_count()];
        values.fill(T::default());
        let Some(cell) = locate([&self.map.x_m, &self.map.y_m, &self.map.z_m], position_m) else {
            return false;
        };
        for (place, &coil) in self.map.coil.iter().enumerate() {
            values[coil as usize] = value(&cell, place);
        }
        true
    }
}

/// Folders between the one of all results and a bundle: a design's, and the bundle.
const BUNDLES_DEPTH: usize = 2;

/// The bundles below `folder`, in the order of their names.
#[must_use]
pub fn bundles_below(folder: &Path) -> Vec<PathBuf> {
    fn add(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) {
        let Ok(entries) = std::fs::read_dir(folder) else {
            return;
        };
        let folders = entries.filter_map(|entry| Some(entry.ok()?.path()));
        let mut folders: Vec<PathBuf> = folders.filter(|path| path.is_dir()).collect();
        folders.sort();
        for path in folders {
            if path.join("manifest.json").is_file() {
                found.push(path);
            } else if depth > 1 {
                add(&path, depth - 1, found);
            }
        }
    }
    let mut found = Vec::new();
    add(folder, BUNDLES_DEPTH, &mut found);
    found
}

/// Parts of every bundle.
const REQUIRED: [&str; 4] = [MAP, POINTS, "currents.csv", "lambda.json"];

fn read_manifest(folder: &Path, path: &Path) -> Result<(Manifest, Vec<u8>), BundleError> {
    /// Of a newer manifest only this is understood.
    #[derive(Deserialize)]
    struct Version {
        schema_version: String,
        /// Absent from manifests of schema 1.3 and before.
        record_sha256: Option<serde::de::IgnoredAny>,
    }
    let text = match read_plain(path, MANIFEST_MAX_BYTES) {
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
            ) =>
        {
            return Err(BundleError::NoBundle {
                path: folder.to_path_buf(),
            });
        }
        Err(source) => {
            return Err(BundleError::Read {
                path: path.to_path_buf(),
                source,
            });
        }
        Ok(text) => text,
    };
    let content = |error: serde_json::Error| BundleError::Content {
        path: path.to_path_buf(),
        message: fault(&error),
    };
    let version: Version = serde_json::from_slice(&text).map_err(content)?;
    check_version(&version.schema_version).map_err(|message| BundleError::Schema {
        path: path.to_path_buf(),
        message,
    })?;
    if version.record_sha256.is_some() && !is_sealed(&text) {
        return Err(BundleError::Damaged {
            path: path.to_path_buf(),
            message: format!("its {SEAL} is not that of its text"),
        });
    }
    let manifest: Manifest = serde_json::from_slice(&text).map_err(content)?;
    Ok((manifest, text))
}

/// The files that a manifest lists.
struct Listed<'a> {
    folder: &'a Path,
    manifest: &'a Path,
    /// The folder, links followed.
    root: PathBuf,
}

impl Listed<'_> {
    fn refused(&self, entry: &FileEntry, message: &str) -> BundleError {
        BundleError::Listed {
            path: self.manifest.to_path_buf(),
            name: entry.path.chars().take(NAME_SHOWN).collect(),
            message: message.to_owned(),
        }
    }

    fn damaged(&self, entry: &FileEntry, message: String) -> BundleError {
        BundleError::Damaged {
            path: self.folder.join(&entry.path),
            message,
        }
    }

    fn failed(&self, entry: &FileEntry, source: io::Error) -> BundleError {
        match source.kind() {
            io::ErrorKind::InvalidData => self.damaged(entry, source.to_string()),
            _ => BundleError::Read {
                path: self.folder.join(&entry.path),
                source,
            },
        }
    }

    /// The path of a listed file, after checking name, place, kind and size; nothing is read.
    fn checked(&self, entry: &FileEntry) -> Result<PathBuf, BundleError> {
        let named = entry.path.len() <= NAME_BYTES && check_name(&entry.path).is_ok();
        if !named || entry.path == "manifest.json" {
            return Err(self.refused(entry, "is not the name of a file inside the bundle"));
        }
        let real = match self.folder.join(&entry.path).canonicalize() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(self.damaged(entry, "it is missing".to_owned()));
            }
            other => other.map_err(|error| self.failed(entry, error))?,
        };
        if !real.starts_with(&self.root) {
            return Err(self.refused(entry, "leads out of the bundle"));
        }
        if real != self.root.join(&entry.path) {
            let message = "is a link; a bundle holds its files themselves";
            return Err(self.refused(entry, message));
        }
        let metadata = real.metadata().map_err(|error| self.failed(entry, error))?;
        if !metadata.is_file() {
            return Err(self.refused(entry, "is not a plain file"));
        }
        self.same_size(entry, metadata.len())?;
        check_plain(&metadata, FILE_MAX_BYTES).map_err(|error| self.failed(entry, error))?;
        Ok(real)
    }

    fn same_size(&self, entry: &FileEntry, found: u64) -> Result<(), BundleError> {
        if found == entry.bytes {
            return Ok(());
        }
        let message = format!("{found} bytes, the manifest says {}", entry.bytes);
        Err(self.damaged(entry, message))
    }

    fn same_digest(&self, entry: &FileEntry, found: &str) -> Result<(), BundleError> {
        if found == entry.sha256 {
            return Ok(());
        }
        let message = format!("its SHA-256 is {found}, the manifest says {}", entry.sha256);
        Err(self.damaged(entry, message))
    }

    /// The bytes of a file whose content is needed.
    fn read(&self, entry: &FileEntry, path: &Path) -> Result<Vec<u8>, BundleError> {
        let content = read_plain(path, entry.bytes).map_err(|error| self.failed(entry, error))?;
        self.same_size(entry, content.len() as u64)?;
        self.same_digest(entry, &sha256_hex(&content))?;
        Ok(content)
    }

    /// Checks the digest of a file whose content is not needed, in bounded memory.
    fn digested(&self, entry: &FileEntry, path: &Path) -> Result<(), BundleError> {
        let (bytes, found) =
            digest_plain(path, entry.bytes).map_err(|error| self.failed(entry, error))?;
        self.same_size(entry, bytes)?;
        self.same_digest(entry, &found)
    }
}
