//! A triangle soup in metres and the facts about it.

pub(super) use fluxform_numerics::vec3::{cross, dot, minus};

use crate::error::ShapeError;
use crate::placement::Transform;
use crate::step::NamedBody;

/// Three vertices, x, y, z each.
pub type Triangle = [[f64; 3]; 3];

/// Coordinates beyond this are no length of a haptic surface, m; below it no predicate overflows.
const FARTHEST_M: f64 = 1e9;

/// Triangles as a file gives them, in the file's own unit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FileMesh {
    /// Every triangle of the file, finite coordinates, in file order.
    pub triangles: Vec<Triangle>,
    /// How far a coordinate may lie from what was meant, because of the file's number format.
    pub coordinate_rounding: f64,
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

/// Contents of a mesh file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshFacts {
    /// Triangles in the file.
    pub triangles: usize,
    /// Of these, lines and points: they are left out.
    pub degenerate: usize,
    /// Box of the placed triangles that have an area.
    pub bounds: Bounds,
    /// How far a coordinate may lie from what was meant, because of the file's number format, m.
    pub coordinate_rounding_m: f64,
    /// Estimate of how far the triangles may lie from the body they stand for, m; 0 where the
    /// file states none.
    pub deviation_m: f64,
    /// Whether that is known rather than estimated.
    pub deviation_is_known: bool,
}

/// A placed triangle soup, m. No order, orientation or connectivity is assumed.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    triangles: Vec<Triangle>,
    facts: MeshFacts,
    read_by: Option<String>,
}

impl Mesh {
    /// Scales and places a file's triangles; those without area are counted and dropped.
    ///
    /// # Errors
    /// [`ShapeError::NoArea`] when nothing is left, [`ShapeError::TooFar`] beyond 1e9 m.
    pub fn place(file: FileMesh, transform: &Transform) -> Result<Self, ShapeError> {
        let mut triangles = file.triangles;
        let count = triangles.len();
        let mut min_m = [f64::INFINITY; 3];
        let mut max_m = [f64::NEG_INFINITY; 3];
        let mut number = 0;
        let mut too_far = None;
        // Area is judged on the file's own numbers, where equal vertices are equal.
        triangles.retain_mut(|triangle| {
            number += 1;
            if !has_area(triangle) {
                return false;
            }
            for vertex in triangle.iter_mut() {
                *vertex = transform.apply(*vertex);
                for k in 0..3 {
                    min_m[k] = min_m[k].min(vertex[k]);
                    max_m[k] = max_m[k].max(vertex[k]);
                    // `contains` is false for a not-a-number that overflow made.
                    if !(-FARTHEST_M..=FARTHEST_M).contains(&vertex[k]) && too_far.is_none() {
                        too_far = Some((number, vertex[k]));
                    }
                }
            }
            true
        });
        if triangles.is_empty() {
            return Err(ShapeError::NoArea { triangles: count });
        }
        if let Some((triangle, coordinate_m)) = too_far {
            return Err(ShapeError::TooFar {
                triangle,
                coordinate_m,
                limit_m: FARTHEST_M,
            });
        }
        let facts = MeshFacts {
            triangles: count,
            degenerate: count - triangles.len(),
            bounds: Bounds { min_m, max_m },
            coordinate_rounding_m: transform.length_m(file.coordinate_rounding),
            deviation_m: transform.length_m(file.deviation),
            deviation_is_known: file.deviation_is_known,
        };
        Ok(Self {
            triangles,
            facts,
            read_by: file.read_by,
        })
    }

    /// The placed triangles that have an area, m.
    #[must_use]
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Another program that made the triangles of the file, with its version.
    #[must_use]
    pub fn read_by(&self) -> Option<&str> {
        self.read_by.as_deref()
    }

    /// Contents of the file.
    #[must_use]
    pub fn facts(&self) -> &MeshFacts {
        &self.facts
    }
}

fn has_area(&[a, b, c]: &Triangle) -> bool {
    cross(minus(b, a), minus(c, a)) != [0.0; 3]
}
