//! A surface in metres, whether it is a mesh or a formula.

use std::io;
use std::path::Path;

use rayon::prelude::*;

use crate::document::{Placement, ShapeDocument, SurfaceFormat, SurfaceSource, unit_name};
use crate::error::ShapeError;
use crate::height::{self, Grid, Sample};
use crate::mesh::{Bounds, FileMesh, Mesh, MeshFacts};
use crate::placement::Transform;
use crate::primitive::PlacedPrimitive;
use crate::step::{self, BodyOptions};
use crate::stl::{self, StlError};
use fluxform_base::progress::Progress;
use fluxform_design::named_file::{self, NamedFileError, ZeroGuard};

/// Larger files fit no computer's memory together with what is made of them, bytes (8 GiB).
const LARGEST_FILE: u64 = 8 << 30;

/// A placed surface, m.
#[derive(Debug, Clone, PartialEq)]
pub enum Surface {
    /// Triangles.
    Mesh(Mesh),
    /// One of the seed's shapes.
    Primitive(PlacedPrimitive),
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
        check_placement(&document.placement)?;
        let (path, unit_m) = match &document.source {
            SurfaceSource::Primitive(primitive) => {
                let placed = PlacedPrimitive::new(*primitive, &document.placement)?;
                return Ok((Self::Primitive(placed), Vec::new()));
            }
            SurfaceSource::File { path, unit_m } => (path, unit_m),
        };
        let (mut file, unit_m) = read(path, *unit_m, &document.bodies, progress)?;
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

    /// The box around the surface, m.
    #[must_use]
    pub fn extent(&self) -> Bounds {
        match self {
            Self::Mesh(mesh) => mesh.facts().bounds,
            Self::Primitive(primitive) => primitive.bounds(),
        }
    }

    /// How far a coordinate of the surface may lie from what was meant, by its number format, m.
    #[must_use]
    pub fn coordinate_rounding_m(&self) -> f64 {
        match self {
            Self::Mesh(mesh) => mesh.facts().coordinate_rounding_m,
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
    let format = SurfaceFormat::of(path).ok_or_else(|| ShapeError::Format { path: path.into() })?;
    if stated_m.is_none() && !format.carries_unit() {
        return Err(ShapeError::UnitMissing {
            path: path.into(),
            format: format.name(),
        });
    }
    if let Some(unit_m) = stated_m
        && !(unit_m > 0.0 && unit_m.is_finite())
    {
        return Err(ShapeError::Document(format!(
            "the unit is {unit_m} m; it must be positive"
        )));
    }
    let file = read_mesh(format, path, bodies, progress)?;
    match (file.unit_m, stated_m) {
        (Some(own), Some(stated)) if own != stated => Err(ShapeError::UnitDiffers {
            path: path.into(),
            file: unit_name(own),
            stated: unit_name(stated),
        }),
        (own, stated) => {
            // The reader of a format that carries its unit gives it.
            let unit_m = own.or(stated).unwrap_or(1.0);
            Ok((file, unit_m))
        }
    }
}

/// The triangles of the file at `path`; of a binary STL the bytes are not held beside them.
pub(super) fn read_mesh(
    format: SurfaceFormat,
    path: &Path,
    bodies: &BodyOptions,
    progress: &dyn Progress,
) -> Result<FileMesh, ShapeError> {
    if format == SurfaceFormat::Step {
        let read = step::read(&read_file(path)?, bodies, progress);
        return read.map_err(|source| ShapeError::Content {
            path: path.into(),
            source,
        });
    }
    if !bodies.is_default() {
        return Err(ShapeError::Document(format!(
            "{}: a chord and a body can be chosen of STEP files alone",
            path.display()
        )));
    }
    if format == SurfaceFormat::Stl
        && let Some(result) = streamed(path)
    {
        return result.map_err(|source| ShapeError::Stl {
            path: path.into(),
            source,
        });
    }
    format.read(path, &read_file(path)?)
}

/// `None` for what is no whole binary STL file, and where the file system fails: reading it
/// otherwise tells why.
fn streamed(path: &Path) -> Option<Result<FileMesh, StlError>> {
    let (file, length) = named_file::open(path, LARGEST_FILE).ok()?;
    stl::stream(ZeroGuard::new(file), length).ok()?
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

/// A regular file's bytes.
pub fn read_file(path: &Path) -> Result<Vec<u8>, ShapeError> {
    let what = |error: NamedFileError| match error {
        NamedFileError::Unreadable(error) => match error.kind() {
            io::ErrorKind::NotFound => {
                "no such file; check the path (in a shape file it counts from that file's folder)"
                    .into()
            }
            io::ErrorKind::PermissionDenied => "it may not be read (permission denied)".into(),
            _ => format!("it cannot be read: {error}"),
        },
        NamedFileError::Folder => "this is a folder; name the surface file in it".into(),
        NamedFileError::NotRegular => {
            "this is no regular file (a device, a pipe or a socket)".into()
        }
        NamedFileError::TooLarge(_) => {
            format!("the file is larger than {LARGEST_FILE} bytes; export it coarser")
        }
        NamedFileError::NoLength => {
            "the file is empty (0 bytes): the export or the download failed".into()
        }
        NamedFileError::Zeros => error.to_string(),
        NamedFileError::OtherLength => format!("expected a surface, {error}"),
    };
    named_file::read(path, LARGEST_FILE).map_err(|error| ShapeError::Unreadable {
        path: path.into(),
        what: what(error),
    })
}
