//! How good the points of a grid are: every part of the error, bounded or estimated.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use strum::{EnumMessage, EnumString, IntoStaticStr, VariantArray};

use crate::deviation::{
    Faces, Interval, Lattice, Looks, Vertical, hausdorff, primitive, primitive_by_cell, vertical,
    vertical_by_cell,
};
use crate::error::ShapeError;
use crate::height::{Grid, Sample};
use crate::mesh::{Mesh, MeshFacts};
use crate::surface::Surface;
use crate::tessellation::estimated_deviation_m;
use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::progress::{Interrupted, Progress};

/// How much is looked into.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, EnumMessage, EnumString, IntoStaticStr, VariantArray,
)]
#[strum(serialize_all = "lowercase")]
pub enum Certify {
    /// Heights alone
    #[default]
    No,
    /// The vertical difference and the tessellation
    Vertical,
    /// Also the Hausdorff distance
    Distance,
}

fluxform_base::choices!(Certify);

/// How the facets' deviation from the surface meant is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Tessellation {
    /// There are no facets.
    None,
    /// A body was cut into facets here, to hold it.
    Known,
    /// A program's own facets for the display, from the angles within each face.
    Display,
    /// Estimated from the angles between the facets.
    Angles,
}

impl Tessellation {
    fn of(mesh: &Mesh) -> (Self, f64) {
        Self::stated(mesh.facts()).unwrap_or_else(|| (Self::Angles, estimated_deviation_m(mesh)))
    }

    /// Deviation that the file itself states.
    fn stated(facts: &MeshFacts) -> Option<(Self, f64)> {
        let from = if facts.deviation_is_known {
            Self::Known
        } else {
            Self::Display
        };
        (facts.deviation_m > 0.0).then_some((from, facts.deviation_m))
    }

    fn stage(self, estimate_m: f64) -> StageAccuracy {
        StageAccuracy {
            estimate: estimate_m,
            relative_to: "1 m".into(),
            method: self.method().into(),
        }
    }

    fn method(self) -> &'static str {
        match self {
            Self::None => "exact: the surface is a formula",
            Self::Known => {
                "measured: the farthest that a facet lies from the exact face it stands for"
            }
            Self::Display => {
                "an estimate: the sagitta of display facets within each face, from their angles"
            }
            Self::Angles => {
                "an estimate: the sagitta of facets that turn smoothly, from their angles"
            }
        }
    }
}

/// The deviation of the facets that a file itself states, where points are not compared.
#[must_use]
pub fn stated_tessellation(facts: &MeshFacts) -> Option<StageAccuracy> {
    Tessellation::stated(facts).map(|(from, deviation_m)| from.stage(deviation_m))
}

/// How far the interpolated points may lie from the surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// The vertical difference over the cells of four points.
    pub vertical: Vertical,
    /// The Hausdorff distance over the same cells; `None` where it was not requested, for a
    /// formula, and without a cell.
    pub hausdorff: Option<Interval>,
    /// The facets' deviation from the surface meant, m; 0 for a formula.
    pub tessellation_m: f64,
    /// Where that comes from.
    pub tessellation: Tessellation,
    /// Rounding error of the file's number format, m.
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

    /// The parts of the budget, as artefacts state them.
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
            ("tessellation", self.tessellation.stage(self.tessellation_m)),
        ])
    }
}

/// Compares the points with the surface they were taken from; `None` where that was not requested,
/// or what one core looks at in `seconds` is spent.
///
/// # Errors
/// [`ShapeError::Interrupted`] when the user asked to stop.
pub fn certify(
    surface: &Surface,
    grid: &Grid,
    samples: &[Option<Sample>],
    how: Certify,
    seconds: u64,
    progress: &dyn Progress,
) -> Result<Option<Certificate>, ShapeError> {
    if how == Certify::No {
        return Ok(None);
    }
    let heights: Vec<Option<f64>> = samples
        .iter()
        .map(|sample| sample.map(|sample| sample.height_m))
        .collect();
    let (found, apart, (tessellation, tessellation_m)) = match surface {
        Surface::Primitive(shape) => (
            primitive(shape, grid, &heights),
            None,
            (Tessellation::None, 0.0),
        ),
        Surface::Mesh(mesh) => {
            let effort = Looks::of_seconds(seconds);
            let faces = Faces::new(mesh, grid, Arc::clone(&effort));
            let lattice = Lattice::new(&faces, grid, &heights);
            let found = vertical(mesh, grid, &lattice, progress)?;
            let apart = if how == Certify::Distance {
                hausdorff(mesh, &lattice, &found, progress)?
            } else {
                None
            };
            if effort.is_spent() {
                return Ok(None);
            }
            (found, apart, Tessellation::of(mesh))
        }
    };
    Ok(Some(Certificate {
        vertical: found,
        hausdorff: apart,
        tessellation_m,
        tessellation,
        rounding_m: surface.height_rounding_m(),
        silhouette_m: grid.x_m.step().hypot(grid.y_m.step()),
    }))
}

/// For every cell of the grid, x fastest, a bound of the vertical difference, m; `None` for cells
/// of which a corner has no surface. No result where what one core looks at in `seconds` is spent.
///
/// # Errors
/// [`Interrupted`] when the user asked to stop.
pub fn by_cell(
    surface: &Surface,
    grid: &Grid,
    samples: &[Option<Sample>],
    seconds: u64,
    progress: &dyn Progress,
) -> Result<Option<Vec<Option<f64>>>, Interrupted> {
    let heights: Vec<Option<f64>> = samples
        .iter()
        .map(|sample| sample.map(|sample| sample.height_m))
        .collect();
    match surface {
        Surface::Primitive(shape) => {
            progress.check()?;
            Ok(Some(primitive_by_cell(shape, grid, &heights)))
        }
        Surface::Mesh(mesh) => {
            let effort = Looks::of_seconds(seconds);
            let faces = Faces::new(mesh, grid, Arc::clone(&effort));
            let cells = vertical_by_cell(&Lattice::new(&faces, grid, &heights), progress)?;
            Ok((!effort.is_spent()).then_some(cells))
        }
    }
}
