//! A triangle soup in metres and the facts about it.

use crate::error::ShapeError;
use crate::file_mesh::{Bounds, FileMesh, Triangle, has_area};
use crate::placement::Transform;

/// Coordinates beyond this are no length of a haptic surface, m; below it no predicate overflows.
const FARTHEST_M: f64 = 1e9;

/// Contents of a mesh file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshFacts {
    /// Triangles in the file.
    pub triangles: usize,
    /// Of these, lines and points: they are left out.
    pub degenerate: usize,
    /// Box of the placed triangles that have an area.
    pub bounds: Bounds,
    /// How far x and y may lie from what was meant, because of the file's number format, m.
    pub plan_rounding_m: f64,
    /// The same of z, m.
    pub height_rounding_m: f64,
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
        let own = file.coordinate_rounding;
        let [x_m, y_m, z_m] = transform.roundings_m([own, own, own.max(file.level_rounding)]);
        let facts = MeshFacts {
            triangles: count,
            degenerate: count - triangles.len(),
            bounds: Bounds { min_m, max_m },
            plan_rounding_m: x_m.max(y_m),
            height_rounding_m: z_m,
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
