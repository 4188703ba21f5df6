//! A surface in metres, whether it is a mesh or a formula.

use std::io::{self, Read};
use std::path::Path;

use rayon::prelude::*;

use crate::bodies::BodyOptions;
use crate::document::{Placement, ShapeDocument, SurfaceFormat, SurfaceSource, unit_name};
use crate::error::ShapeError;
use crate::file_mesh::{Bounds, FileMesh};
use crate::height::{self, Grid, Sample};
use crate::memory;
use crate::mesh::{Mesh, MeshFacts};
use crate::placement::Transform;
use crate::primitive::PlacedPrimitive;
use crate::read_error::ReadError;
use crate::step;
use crate::stl;
use crate::vertical_hit::WALL_NORMAL_Z;
use crate::zeros::Zeros;
use fluxform_base::progress::Progress;
use fluxform_design::named_file::{self, NamedFileError};

/// Larger files fit no computer's memory together with what is made of them, bytes (8 GiB).
pub const LARGEST_FILE: u64 = 8 << 30;

/// A placed surface, m.
#[derive(Debug, Clone, PartialEq)]
pub enum Surface {
    /// Triangles.
    Mesh(Mesh),
    /// One of the seed's shapes.
    Primitive(PlacedPrimitive),
}

/// Sees the bytes of a surface file as they are parsed, so that a digest is of those bytes.
pub trait ByteObserver {
    /// The file is read from its beginning: earlier bytes do not count.
    fn restart(&mut self);
    /// The next bytes.
    fn observe(&mut self, bytes: &[u8]);
}

impl ByteObserver for () {
    fn restart(&mut self) {}
    fn observe(&mut self, _: &[u8]) {}
}

/// A source whose bytes are observed as they are read.
struct Observed<'a, R> {
    source: R,
    observer: &'a mut dyn ByteObserver,
}

impl<R: Read> Read for Observed<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(buffer)?;
        self.observer.observe(&buffer[..count]);
        Ok(count)
    }
}

impl Surface {
    /// Opens, reads and places what a document names; the second value holds warnings.
    ///
    /// # Errors
    /// [`ShapeError`] with the path and the place.
    pub fn open(
        document: &ShapeDocument,
        progress: &dyn Progress,
    ) -> Result<(Self, Vec<String>), ShapeError> {
        Self::open_observed(document, &mut (), progress)
    }

    /// As [`Surface::open`]; `observer` sees the bytes of the surface's file, if it has one.
    ///
    /// # Errors
    /// As [`Surface::open`].
    pub fn open_observed(
        document: &ShapeDocument,
        observer: &mut dyn ByteObserver,
        progress: &dyn Progress,
    ) -> Result<(Self, Vec<String>), ShapeError> {
        check_placement(&document.placement)?;
        let (path, unit_m) = match &document.source {
            SurfaceSource::Primitive(primitive) => {
                let placed = PlacedPrimitive::new(*primitive, &document.placement)?;
                return Ok((Self::Primitive(placed), Vec::new()));
            }
            SurfaceSource::File { path, unit_m } => (path, unit_m),
        };
        let (mut file, unit_m) =
            read_observed(path, *unit_m, &document.bodies, observer, progress)?;
        let mut warnings = std::mem::take(&mut file.warnings);
        let (transform, overhang) = Transform::new(unit_m, &document.placement)
            .scaled(document.scale)
            .seated(&document.placement, &file.triangles);
        warnings.extend(overhang);
        let mesh = Mesh::place(file, &transform)?;
        let MeshFacts {
            triangles,
            degenerate,
            ..
        } = *mesh.facts();
        if degenerate > 0 {
            warnings.push(format!(
                "{degenerate} of {triangles} triangles have no area and are left out"
            ));
        }
        Ok((Self::Mesh(mesh), warnings))
    }

    /// Memory that the surface takes with its index and the certificate of its points, bytes.
    pub(crate) fn held_bytes(&self) -> f64 {
        match self {
            Self::Mesh(mesh) => memory::bytes_of(mesh.triangles().len() as u64) as f64,
            Self::Primitive(_) => 0.0,
        }
    }

    /// The box around the surface, m.
    #[must_use]
    pub fn extent(&self) -> Bounds {
        match self {
            Self::Mesh(mesh) => mesh.facts().bounds,
            Self::Primitive(primitive) => primitive.bounds(),
        }
    }

    /// How far heights with these unit normals may lie from what was meant, by the file's number format, m: a
    /// slope turns the rounding in plan into one of height.
    #[must_use]
    pub fn heights_rounding_m(&self, normals: &[[f64; 3]]) -> f64 {
        let plan_m = match self {
            Self::Mesh(mesh) => mesh.facts().plan_rounding_m,
            Self::Primitive(_) => 0.0,
        };
        let slopes = normals
            .iter()
            .filter(|[_, _, z]| *z > WALL_NORMAL_Z)
            .map(|[x, y, z]| (x.abs() + y.abs()) / z);
        self.height_rounding_m() + plan_m * slopes.fold(0.0, f64::max)
    }

    /// How far a height on a level face may lie from what was meant, by the number format, m.
    #[must_use]
    pub fn height_rounding_m(&self) -> f64 {
        match self {
            Self::Mesh(mesh) => mesh.facts().height_rounding_m,
            Self::Primitive(primitive) => {
                let Bounds { min_m, max_m } = primitive.bounds();
                let largest = min_m
                    .iter()
                    .chain(&max_m)
                    .fold(0.0, |m: f64, c| m.max(c.abs()));
                largest * f64::EPSILON
            }
        }
    }

    /// The surface over every point of an ascending grid, x fastest; `None` where there is none.
    ///
    /// # Errors
    /// [`ShapeError::Interrupted`] when the user asked to stop.
    pub fn heights(
        &self,
        grid: &Grid,
        progress: &dyn Progress,
    ) -> Result<Vec<Option<Sample>>, ShapeError> {
        match self {
            Self::Mesh(mesh) => Ok(height::heights(mesh, grid, progress)?),
            Self::Primitive(primitive) => {
                let (x, y) = (grid.x_m.nodes(), grid.y_m.nodes());
                let points = (0..grid.len()).into_par_iter();
                Ok(points
                    .with_min_len(fluxform_base::progress::items_a_task(grid.len()))
                    .map(|k| primitive.sample(x[k % x.len()], y[k / x.len()]))
                    .collect())
            }
        }
    }
}

/// A surface file's triangles, and the metres of their unit: the file's own, or as stated.
///
/// # Errors
/// [`ShapeError`]: no or another unit, a file that cannot be read.
pub fn read(
    path: &Path,
    stated_m: Option<f64>,
    bodies: &BodyOptions,
    progress: &dyn Progress,
) -> Result<(FileMesh, f64), ShapeError> {
    read_observed(path, stated_m, bodies, &mut (), progress)
}

fn read_observed(
    path: &Path,
    stated_m: Option<f64>,
    bodies: &BodyOptions,
    observer: &mut dyn ByteObserver,
    progress: &dyn Progress,
) -> Result<(FileMesh, f64), ShapeError> {
    let by_name = SurfaceFormat::of(path);
    if let (Some(format), None) = (by_name, stated_m)
        && !format.carries_unit()
    {
        return Err(unit_missing(path, format));
    }
    if let Some(unit_m) = stated_m
        && !(unit_m > 0.0 && unit_m.is_finite())
    {
        return Err(ShapeError::Document(format!(
            "the unit is {unit_m} m; it must be positive"
        )));
    }
    let (format, file) = read_mesh(path, bodies, observer, progress)?;
    let unit_m = unit_of(path, format, file.unit_m, stated_m)?;
    Ok((file, unit_m))
}

/// The unit of a file's coordinates, m: the file's own, or as stated.
pub(super) fn unit_of(
    path: &Path,
    format: SurfaceFormat,
    own_m: Option<f64>,
    stated_m: Option<f64>,
) -> Result<f64, ShapeError> {
    match (own_m, stated_m) {
        (Some(own), Some(stated)) if own != stated => Err(ShapeError::UnitDiffers {
            path: path.into(),
            file: unit_name(own),
            stated: unit_name(stated),
        }),
        (Some(unit_m), _) | (None, Some(unit_m)) => Ok(unit_m),
        (None, None) => Err(unit_missing(path, format)),
    }
}

fn unit_missing(path: &Path, format: SurfaceFormat) -> ShapeError {
    ShapeError::UnitMissing {
        path: path.into(),
        format: format.name(),
    }
}

/// The triangles of the file at `path`, and its format: by the name's ending, or by the content
/// where the name has none. Of a binary STL the bytes are not held beside the triangles.
pub(super) fn read_mesh(
    path: &Path,
    bodies: &BodyOptions,
    observer: &mut dyn ByteObserver,
    progress: &dyn Progress,
) -> Result<(SurfaceFormat, FileMesh), ShapeError> {
    let by_name = SurfaceFormat::of(path);
    if by_name.is_none() && path.extension().is_some() {
        return Err(ShapeError::Format { path: path.into() });
    }
    if bodies.is_default()
        && by_name.is_none_or(|format| format == SurfaceFormat::Stl)
        && let Some(result) = streamed(path, observer)
    {
        let file = result.map_err(|source| ShapeError::Content {
            path: path.into(),
            source,
        });
        return Ok((SurfaceFormat::Stl, file?));
    }
    let bytes = read_file(path, LARGEST_FILE)?;
    observer.restart();
    observer.observe(&bytes);
    let format = by_name.or_else(|| SurfaceFormat::of_content(&bytes));
    let format = format.ok_or_else(|| ShapeError::Format { path: path.into() })?;
    if format == SurfaceFormat::Step {
        let read = step::read(&bytes, bodies, progress);
        let file = read.map_err(|source| ShapeError::Content {
            path: path.into(),
            source,
        })?;
        return Ok((format, file));
    }
    if !bodies.is_default() {
        return Err(ShapeError::Document(format!(
            "{}: a chord and a body can be chosen of STEP files alone",
            path.display()
        )));
    }
    let file = format.read(path, &bytes)?;
    // Where the format states no count, it is known only now: what is made of them takes more.
    memory::check(file.triangles.len() as u64).map_err(|what| ShapeError::Content {
        path: path.into(),
        source: ReadError::file(what),
    })?;
    Ok((format, file))
}

/// `None` for what is no whole binary STL file, and where the file system fails: reading it
/// otherwise reports why.
fn streamed(path: &Path, observer: &mut dyn ByteObserver) -> Option<Result<FileMesh, ReadError>> {
    let (source, length) = named_file::open(path, LARGEST_FILE).ok()?;
    observer.restart();
    stl::stream(Observed { source, observer }, length).ok()?
}

fn check_placement(placement: &Placement) -> Result<(), ShapeError> {
    let seat = &placement.seat;
    let fit = seat.fit.map_or([[0.0, 1.0]; 3], |fit| fit.box_m);
    if fit.iter().any(|[from, to]| from >= to) {
        return Err(ShapeError::Document(
            "the box to fit must have its smaller ends first".into(),
        ));
    }
    let rest_on_m = [seat.rest_on_m.unwrap_or(0.0)];
    let keys = [
        ("translate_mm", &placement.translate_m[..]),
        ("rotate_deg", &placement.rotate_deg),
        ("rest_on_mm", &rest_on_m),
        ("fit_mm", fit.as_flattened()),
    ];
    for (key, values) in keys {
        if values.iter().any(|v| !v.is_finite()) {
            return Err(ShapeError::Document(format!(
                "{key} holds a number that is not finite"
            )));
        }
    }
    Ok(())
}

/// A regular file's bytes, at most `max_bytes`.
pub fn read_file(path: &Path, max_bytes: u64) -> Result<Vec<u8>, ShapeError> {
    let what = |error: NamedFileError| {
        match error {
        NamedFileError::Unreadable(error) => match error.kind() {
            io::ErrorKind::NotFound => {
                "no such file; check the path (in a design or a shape file it counts from that file's folder)"
                    .into()
            }
            io::ErrorKind::PermissionDenied => "it may not be read (permission denied)".into(),
            _ => format!("it cannot be read: {error}"),
        },
        NamedFileError::Folder => "this is a folder; name the surface file in it".into(),
        NamedFileError::NotRegular => {
            "this is not a regular file (a device, a pipe or a socket)".into()
        }
        NamedFileError::TooLarge(_) => {
            format!("the file is larger than {max_bytes} bytes; export it coarser")
        }
        NamedFileError::NoLength => {
            "the file is empty (0 bytes): the export or the download failed".into()
        }
        NamedFileError::OtherLength => format!("expected a surface, {error}"),
    }
    };
    let unreadable = |what: String| ShapeError::Unreadable {
        path: path.into(),
        what,
    };
    let mut zeros = Zeros::default();
    let read = named_file::read_watched(path, max_bytes, &mut |piece| {
        fluxform_base::progress::poll();
        zeros.see(piece)
    });
    match read.map_err(|error| unreadable(what(error)))? {
        Some(bytes) => Ok(bytes),
        None => Err(unreadable(zeros.what())),
    }
}
