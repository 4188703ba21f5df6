//! Whole artefacts: a bundle, a map with its sidecar, a JSON result.

use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::artefact::{FileEntry, Input, Options, sha256_hex};
use super::atomic::{
    FileSet, FolderDraft, Overwrite, WriteError, Written, check_distinct, listed_files, write,
};
use super::cross_check;
use super::json::to_json;
use super::lambda_file::LambdaFile;
use super::mag_manip::{HEAD, Multipoles, VectorField, write_multipoles, write_vector_field};
use super::manifest::{MadeWith, Manifest, MapSidecar};
use super::map_table::write_map;
use super::npz::{MapArrays, to_npz};
use super::seal::to_record;
use super::table::{CurrentRow, PointRow, write_rows};
use super::timing::StageSeconds;
use super::vtk::write_map_image;

/// Everything a bundle holds but its timing.
#[derive(Debug, Clone)]
pub struct BundleContent<'a> {
    /// Its `files` are filled in while writing.
    pub manifest: Manifest,
    /// `map.npz`.
    pub map: &'a MapArrays<'a>,
    /// `points.csv`.
    pub points: &'a [PointRow],
    /// `currents.csv`, one row a coil of the array.
    pub currents: &'a [CurrentRow],
    /// `lambda.json`.
    pub lambda: &'a LambdaFile,
    /// Files kept beside them as they are: name and content.
    pub extra: &'a [(&'a str, &'a [u8])],
}

/// Refuses early, before a long computation, when the bundle at `target` must not be replaced. Nothing
/// on the disk is changed.
///
/// # Errors
/// [`WriteError`].
pub fn check_bundle_target(
    target: &Path,
    force: bool,
    inputs: &[Input],
    made_with: Option<&MadeWith>,
) -> Result<(), WriteError> {
    let overwrite = overwrite_bundle(target, force, inputs, made_with);
    FolderDraft::check(target, &overwrite, &BUNDLE_FILES)
}

/// The files that every bundle has.
const BUNDLE_FILES: [&str; 6] = [
    "map.npz",
    "points.csv",
    "currents.csv",
    "lambda.json",
    "timing.json",
    "manifest.json",
];

/// Writes a bundle whole or not at all; `timing` becomes `timing.json`, which no manifest lists.
/// Returns the manifest as written.
///
/// # Errors
/// [`WriteError`]; also when the parts contradict each other.
pub fn write_bundle(
    target: &Path,
    force: bool,
    content: &BundleContent,
    timing: &[StageSeconds],
) -> Result<Manifest, WriteError> {
    let mut manifest = content.manifest.clone();
    check_content(content, target)?;
    let (inputs, made_with) = (&manifest.inputs, manifest.made_with.as_ref());
    let overwrite = overwrite_bundle(target, force, inputs, made_with);
    let mut draft = FolderDraft::begin(target, overwrite)?;
    manifest.files = put_files(content, &mut |name, fill| draft.write(name, fill))?;
    draft.write("timing.json", |out| {
        out.write_all(&to_json(timing).map_err(invalid)?)
    })?;
    draft.write("manifest.json", |out| {
        out.write_all(&to_record(&manifest).map_err(invalid)?)
    })?;
    draft.commit()?;
    Ok(manifest)
}

/// The manifest that [`write_bundle`] would write with `content`, sizes and digests of all files
/// included; nothing is written.
///
/// # Errors
/// [`WriteError::Content`] when the parts contradict each other.
pub fn sealed_manifest(content: &BundleContent) -> Result<Manifest, WriteError> {
    check_content(content, Path::new("manifest.json"))?;
    let files = put_files(content, &mut |name, fill| {
        let mut bytes = Vec::new();
        fill(&mut bytes).map_err(|error| WriteError::from_io("write", Path::new(name), error))?;
        Ok(FileEntry {
            path: name.to_owned(),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(&bytes),
        })
    })?;
    Ok(Manifest {
        files,
        ..content.manifest.clone()
    })
}

fn check_content(content: &BundleContent, target: &Path) -> Result<(), WriteError> {
    cross_check::check(
        &content.manifest,
        content.map,
        content.points,
        content.currents,
        content.lambda,
    )
    .map_err(|message| WriteError::Content {
        path: target.to_path_buf(),
        message,
    })
}

/// Fills a file.
type Fill<'a> = &'a dyn Fn(&mut dyn io::Write) -> io::Result<()>;

/// Hands every listed file of a bundle to `put`, in the manifest's order.
fn put_files(
    content: &BundleContent,
    put: &mut dyn FnMut(&str, Fill) -> Result<FileEntry, WriteError>,
) -> Result<Vec<FileEntry>, WriteError> {
    let mut files = vec![
        put("map.npz", &|out| {
            out.write_all(&to_npz(content.map).map_err(invalid)?)
        })?,
        put("points.csv", &|out| {
            write_rows(out, PointRow::COLUMNS, content.points.iter().copied())
        })?,
        put("currents.csv", &|out| {
            write_rows(out, CurrentRow::COLUMNS, content.currents.iter().copied())
        })?,
        put("lambda.json", &|out| {
            out.write_all(&to_json(content.lambda).map_err(invalid)?)
        })?,
    ];
    for (name, bytes) in content.extra {
        files.push(put(name, &|out| out.write_all(bytes))?);
    }
    Ok(files)
}

fn overwrite_bundle(
    target: &Path,
    force: bool,
    inputs: &[Input],
    made_with: Option<&MadeWith>,
) -> Overwrite {
    let options = made_with.map(Options::of).unwrap_or_default();
    Overwrite::new(force, target.join("manifest.json"), inputs).made_with(&options)
}

/// Which formats of a map are requested beside `map.npz`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MapFormats {
    /// `map.csv`.
    pub csv: bool,
    /// `map.vti`.
    pub vtk: bool,
}

/// Every file that a map may have in its folder.
pub const MAP_FILES: [&str; 4] = ["map.npz", "map.json", "map.csv", "map.vti"];

/// A file for another program that is written together with a map.
#[derive(Debug, Clone, Copy)]
pub struct Beside<'a> {
    /// Where; outside the map's folder too.
    pub path: &'a Path,
    /// What.
    pub content: BesideContent<'a>,
}

/// Contents of such a file.
#[derive(Debug, Clone, Copy)]
pub enum BesideContent<'a> {
    /// The field on nodes.
    VectorField(&'a VectorField<'a>),
    /// Multipole sources.
    Multipoles(&'a Multipoles<'a>),
}

/// Refuses early when the files of a map, or those for other programs beside it, must not be replaced.
/// `protected` are files that the run reads and that are not among the inputs.
///
/// # Errors
/// [`WriteError`].
pub fn check_map_files(
    folder: &Path,
    force: bool,
    (inputs, made_with): (&[Input], &Options),
    protected: &[PathBuf],
    formats: MapFormats,
    beside_paths: &[&Path],
) -> Result<(), WriteError> {
    let overwrite = overwrite_map(folder, force, (inputs, made_with), protected);
    let csv = formats.csv.then_some("map.csv");
    let vti = formats.vtk.then_some("map.vti");
    for name in ["map.npz", "map.json"].into_iter().chain(csv).chain(vti) {
        overwrite.check(&folder.join(name))?;
    }
    check_distinct(beside_paths)?;
    for path in beside_paths {
        check_beside(path, folder)?;
        overwrite_beside(path, folder, overwrite.clone()).check(path)?;
    }
    Ok(())
}

fn overwrite_map(
    folder: &Path,
    force: bool,
    (inputs, made_with): (&[Input], &Options),
    protected: &[PathBuf],
) -> Overwrite {
    Overwrite::new(force, folder.join("map.json"), inputs)
        .made_with(made_with)
        .protecting(protected)
}

/// Files in the map's folder are listed by its sidecar; others are replaced by the same bytes alone.
fn overwrite_beside(path: &Path, folder: &Path, of_map: Overwrite) -> Overwrite {
    if name_in(folder, path).is_some() {
        of_map
    } else {
        of_map.now_beginning(HEAD)
    }
}

fn check_beside(path: &Path, folder: &Path) -> Result<(), WriteError> {
    match name_in(folder, path) {
        Some(name) if MAP_FILES.contains(&name.as_str()) => Err(WriteError::Content {
            path: path.to_path_buf(),
            message: "the map itself has a file of that name; choose another".to_owned(),
        }),
        _ => Ok(()),
    }
}

/// The plain name of `path` where it lies in `folder`.
fn name_in(folder: &Path, path: &Path) -> Option<String> {
    let parent = match path.parent()? {
        bare if bare.as_os_str().is_empty() => Path::new("."),
        parent => parent,
    };
    let same = parent == folder
        || match (parent.canonicalize(), folder.canonicalize()) {
            (Ok(parent), Ok(folder)) => parent == folder,
            _ => false,
        };
    same.then(|| path.file_name())
        .flatten()
        .map(|name| name.to_string_lossy().into_owned())
}

/// Writes `map.npz`, the other requested formats, and `map.json` into `folder`. Returns the sidecar as
/// written, its `files` filled in.
///
/// # Errors
/// [`WriteError`].
pub fn write_map_files(
    folder: &Path,
    force: bool,
    sidecar: &MapSidecar,
    map: &MapArrays,
    formats: MapFormats,
) -> Result<MapSidecar, WriteError> {
    write_map_and(folder, force, sidecar, map, formats, &[], &[])
}

/// [`write_map_files`] and files for other programs; `files` lists those that lie in `folder`.
/// `protected` as for [`check_map_files`].
///
/// # Errors
/// [`WriteError`].
pub fn write_map_and(
    folder: &Path,
    force: bool,
    sidecar: &MapSidecar,
    map: &MapArrays,
    formats: MapFormats,
    beside_paths: &[Beside],
    protected: &[PathBuf],
) -> Result<MapSidecar, WriteError> {
    let mut sidecar = sidecar.clone();
    let earlier = listed_files(&folder.join("map.json"));
    let of = (&*sidecar.inputs, &sidecar.made_with);
    let overwrite = overwrite_map(folder, force, of, protected);
    let mut set = FileSet::begin(folder, overwrite.clone());
    let mut put =
        |set: &mut FileSet, name: &str, content: &dyn Fn(&mut dyn io::Write) -> io::Result<()>| {
            set.write(name, content)
                .map(|written| sidecar.files.push(FileEntry::new(name, written)))
        };
    put(&mut set, "map.npz", &|out| {
        out.write_all(&to_npz(map).map_err(invalid)?)
    })?;
    if formats.csv {
        put(&mut set, "map.csv", &|out| write_map(out, map))?;
    }
    if formats.vtk {
        put(&mut set, "map.vti", &|out| write_map_image(out, map))?;
    }
    for beside in beside_paths {
        check_beside(beside.path, folder)?;
        let overwrite = overwrite_beside(beside.path, folder, overwrite.clone());
        let written = set.write_under(
            beside.path,
            overwrite,
            Box::new(|out| match beside.content {
                BesideContent::VectorField(field) => write_vector_field(out, field),
                BesideContent::Multipoles(model) => write_multipoles(out, model),
            }),
        )?;
        if let Some(name) = name_in(folder, beside.path) {
            sidecar.files.push(FileEntry::new(name, written));
        }
    }
    // Of an earlier map no other format may stay beside this one.
    for name in MAP_FILES {
        let made = name == "map.json" || sidecar.files.iter().any(|file| file.path == name);
        if !made && earlier.iter().any(|file| file == name) {
            set.outdate(name)?;
        }
    }
    set.write("map.json", |out| {
        out.write_all(&to_record(&sidecar).map_err(invalid)?)
    })?;
    set.commit()?;
    Ok(sidecar)
}

/// Writes a JSON result that states its own `inputs`.
///
/// # Errors
/// [`WriteError`].
pub fn write_json<T: Serialize + ?Sized>(
    path: &Path,
    overwrite: &Overwrite,
    value: &T,
) -> Result<Written, WriteError> {
    write(path, overwrite, |out| {
        out.write_all(&to_json(value).map_err(invalid)?)
    })
}

fn invalid(error: impl std::error::Error + Send + Sync + 'static) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, error)
}
