//! How good the points of a grid are: every part of the error, bounded or estimated.

use std::collections::BTreeMap;

use crate::accuracy::StageAccuracy;
use crate::progress::Progress;
use crate::shape::deviation::{Faces, Interval, Lattice, Vertical, hausdorff, primitive, vertical};
use crate::shape::error::ShapeError;
use crate::shape::height::{Grid, Sample};
use crate::shape::surface::Surface;
use crate::shape::tessellation::estimated_deviation_m;

/// How much is looked into.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Certify {
    /// Heights alone.
    #[default]
    No,
    /// The vertical difference and the tessellation.
    Vertical,
    /// The Hausdorff distance besides.
    Distance,
}

/// How far the interpolated points may lie from the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    /// The vertical difference over the cells of four points.
    pub vertical: Vertical,
    /// The Hausdorff distance over the same cells; `None` where it was not asked for, for a
    /// formula, and without a cell.
    pub hausdorff: Option<Interval>,
    /// The facets' estimated deviation from the surface meant, m; 0 for a formula.
    pub tessellation_m: f64,
    /// What the file's number format rounds away, m.
    pub rounding_m: f64,
    /// Diagonal of a cell: so far in plan the silhouette is uncertain, m.
    pub silhouette_m: f64,
}

impl Certificate {
    /// The whole error budget of the heights: grid, tessellation and rounding, m.
    #[must_use]
    pub fn budget_m(&self) -> f64 {
        self.vertical.bound_m() + self.tessellation_m + self.rounding_m
    }

    /// The parts of the budget, as artefacts tell them.
    #[must_use]
    pub fn stages(&self) -> BTreeMap<&'static str, StageAccuracy> {
        let stage = |estimate: f64, method: &str| StageAccuracy {
            estimate,
            relative_to: "1 m".into(),
            method: method.into(),
        };
        let grid = if self.vertical.slack_m > 0.0 {
            "certified: the largest vertical difference between surface and bilinear interpolation, \
             over the cells of four points, by branch and bound"
        } else {
            "certified: the exact supremum of the vertical difference between surface and bilinear \
             interpolation, over the cells of four points"
        };
        BTreeMap::from([
            ("grid", stage(self.vertical.bound_m(), grid)),
            (
                "tessellation",
                stage(
                    self.tessellation_m,
                    "an estimate: the sagitta of facets that turn smoothly, from their angles",
                ),
            ),
        ])
    }
}

/// Compares the points with the surface they were taken from.
///
/// # Errors
/// [`ShapeError::Interrupted`] when the user asked to stop.
pub fn certify(
    surface: &Surface,
    grid: &Grid,
    samples: &[Option<Sample>],
    how: Certify,
    progress: &dyn Progress,
) -> Result<Option<Certificate>, ShapeError> {
    if how == Certify::No {
        return Ok(None);
    }
    let heights: Vec<Option<f64>> = samples
        .iter()
        .map(|sample| sample.map(|sample| sample.height_m))
        .collect();
    let (found, apart, tessellation_m) = match surface {
        Surface::Primitive(shape) => (primitive(shape, grid, &heights), None, 0.0),
        Surface::Mesh(mesh) => {
            let faces = Faces::new(mesh, grid);
            let lattice = Lattice::new(&faces, grid, &heights);
            let found = vertical(mesh, grid, &lattice, progress)?;
            let apart = if how == Certify::Distance {
                hausdorff(mesh, &lattice, &found, progress)?
            } else {
                None
            };
            (found, apart, estimated_deviation_m(mesh))
        }
    };
    Ok(Some(Certificate {
        vertical: found,
        hausdorff: apart,
        tessellation_m,
        rounding_m: surface.coordinate_rounding_m(),
        silhouette_m: grid.x_m.step().hypot(grid.y_m.step()),
    }))
}
