//! Faults between a shape document and its points, and advice on them.

use std::path::PathBuf;

use crate::format::SurfaceFormat;
use crate::read_error::ReadError;
use fluxform_base::progress::Interrupted;

/// A shape that gives no constraint points. Lengths are metres inside, millimetres in messages.
#[derive(Debug, thiserror::Error)]
pub enum ShapeError {
    /// The surface's path cannot be read as a file.
    #[error("{}: {what}", path.display())]
    Unreadable {
        /// Path as given.
        path: PathBuf,
        /// Result and advice.
        what: String,
    },
    /// The name's ending belongs to no surface format.
    #[error(
        "{}: not a surface that is read: expected a shape file (.toml) or {}{}",
        path.display(),
        SurfaceFormat::endings(),
        SurfaceFormat::advice(path).map_or_else(String::new, |advice| format!("; {advice}"))
    )]
    Format {
        /// Path as given.
        path: PathBuf,
    },
    /// The format carries no unit and none was given.
    #[error(
        "{}: {format} files carry no unit; state it (`unit = \"mm\"` in the shape file or [[iron]], \
         `--unit mm` on the command line)",
        path.display()
    )]
    UnitMissing {
        /// Path as given.
        path: PathBuf,
        /// The format's name.
        format: &'static str,
    },
    /// The file states another unit than the user.
    #[error(
        "{}: the file is in {file}, as it says or its format has it, but `unit` says {stated}; leave the unit out, or \
         correct the export",
        path.display()
    )]
    UnitDiffers {
        /// Path as given.
        path: PathBuf,
        /// The file's unit.
        file: String,
        /// The user's.
        stated: String,
    },
    /// The file is damaged, of another format, or holds no surface.
    #[error("{}: {source}", path.display())]
    Content {
        /// Path as given.
        path: PathBuf,
        /// The fault, with its place.
        source: ReadError,
    },
    /// Every triangle is a line or a point.
    #[error(
        "the surface's {triangles} triangles all have zero area: there is no surface; \
         export the body again"
    )]
    NoArea {
        /// Triangles in the file.
        triangles: usize,
    },
    /// A coordinate that is no plausible length.
    #[error(
        "triangle {triangle} of the surface reaches {coordinate_m:e} m from the origin (limit \
         {limit_m:e} m): the file is damaged or its unit is wrong"
    )]
    TooFar {
        /// Number of the triangle, from 1.
        triangle: usize,
        /// The coordinate, m.
        coordinate_m: f64,
        /// The limit, m.
        limit_m: f64,
    },
    /// A number of the document is not usable here.
    #[error("{0}")]
    Document(String),
    /// Surface and grid do not overlap.
    #[error(
        "the surface lies wholly outside the grid: the surface covers {}, the grid {}; \
         --center (center = true) moves its middle to x = y = 0; or change the translation, the \
         unit or the grid",
        extent_mm(surface),
        extent_mm(grid)
    )]
    OutsideGrid {
        /// x and y range of the surface, m.
        surface: [[f64; 2]; 2],
        /// x and y range of the grid, m.
        grid: [[f64; 2]; 2],
    },
    /// They overlap, but no grid point has surface above or below it.
    #[error(
        "none of the {grid_points} grid points lies on the surface, which covers {} of the grid \
         {}; take more samples or a smaller grid",
        extent_mm(surface),
        extent_mm(grid)
    )]
    NoPoint {
        /// Points of the grid.
        grid_points: usize,
        /// x and y range of the surface, m.
        surface: [[f64; 2]; 2],
        /// x and y range of the grid, m.
        grid: [[f64; 2]; 2],
    },
    /// Heights are measured upwards from the windings' top face.
    #[error(
        "{below} of {points} points lie below z = 0, the windings' top face (lowest {:.6} mm); \
         a translation of z by at least {:.6} mm more lifts them, or --rest-on 20mm \
         (rest_on_mm = 20) puts the whole surface above",
        lowest_m * 1000.0,
        -lowest_m * 1000.0
    )]
    BelowZero {
        /// Points with a negative height.
        below: usize,
        /// All points.
        points: usize,
        /// The lowest height, m.
        lowest_m: f64,
    },
    /// The user asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// `x -50 to 50 mm, y 0 to 20 mm`.
fn extent_mm(extent: &[[f64; 2]; 2]) -> String {
    let [x, y] = extent.map(|[from, to]| format!("{} to {} mm", mm(from), mm(to)));
    format!("x {x}, y {y}")
}

/// Millimetres to at most six decimals, for messages.
fn mm(length_m: f64) -> f64 {
    let length_mm = length_m * 1000.0;
    let rounded = (length_mm * 1e6).round() / 1e6;
    if rounded.is_finite() {
        rounded
    } else {
        length_mm
    }
}
