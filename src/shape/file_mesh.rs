//! Triangles as a reader of files gives them, and the box around points.

use crate::bodies::NamedBody;
use fluxform_numerics::vec3::{cross, minus};

/// Three vertices, x, y, z each.
pub type Triangle = [[f64; 3]; 3];

/// Whether a triangle has an area, by its own numbers: lines and points have none.
pub(crate) fn has_area(&[a, b, c]: &Triangle) -> bool {
    cross(minus(b, a), minus(c, a)) != [0.0; 3]
}

/// Triangles as a file gives them, in the file's own unit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FileMesh {
    /// Every triangle of the file, finite coordinates, in file order.
    pub triangles: Vec<Triangle>,
    /// How far a coordinate may lie from what was meant, because of the file's number format.
    pub coordinate_rounding: f64,
    /// The same of z where that is more: half a grey level of a height image; 0 elsewhere.
    pub level_rounding: f64,
    /// Metres per unit of the coordinates, where the file itself says so.
    pub unit_m: Option<f64>,
    /// Estimate of how far the triangles may lie from the body they stand for, in the file's
    /// unit; 0 where the file states none.
    pub deviation: f64,
    /// Whether the deviation is known, because the triangles were made here to hold it.
    pub deviation_is_known: bool,
    /// Warnings.
    pub warnings: Vec<String>,
    /// The bodies that the file names, in its order; empty where the format names none.
    pub bodies: Vec<NamedBody>,
    /// Another program that made the triangles of the file, with its version.
    pub read_by: Option<String>,
}

/// Axis-aligned box, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Smallest x, y, z.
    pub min_m: [f64; 3],
    /// Largest x, y, z.
    pub max_m: [f64; 3],
}

impl Bounds {
    /// The box around points; from infinity to minus infinity without any.
    #[must_use]
    pub fn of(points: impl Iterator<Item = [f64; 3]>) -> Self {
        let none = Self {
            min_m: [f64::INFINITY; 3],
            max_m: [f64::NEG_INFINITY; 3],
        };
        points.fold(none, |mut bounds, point| {
            for (k, value) in point.into_iter().enumerate() {
                bounds.min_m[k] = bounds.min_m[k].min(value);
                bounds.max_m[k] = bounds.max_m[k].max(value);
            }
            bounds
        })
    }

    /// Range of x and of y.
    #[must_use]
    pub fn plan(&self) -> [[f64; 2]; 2] {
        [0, 1].map(|k| [self.min_m[k], self.max_m[k]])
    }
}
