//! What several commands' options have in common in the record's `made_with`: what they change in the
//! files, and nothing else. Where files go and what is drawn beside them is no option of theirs.
//!
//! `sweep merge` has none: its table follows from the plan and the points that there are. What `optimize`
//! writes has no record: it is replaced by the same bytes alone.

use serde::Serialize;

use crate::bundle::artefact::Input;
use crate::bundle::manifest::SurfaceOptions;
use crate::shape::document::{AxisRequest, ShapeDocument, SurfaceSource};

/// What the command line says of a surface; `None` where a shape file says it.
#[must_use]
pub fn surface(document: &ShapeDocument, file: Option<&Input>) -> Option<SurfaceOptions> {
    let (None, SurfaceSource::File { unit_m, .. }) = (file, &document.source) else {
        return None;
    };
    let (x, y) = (document.grid.x, document.grid.y);
    let parts = |axis: AxisRequest| match axis {
        AxisRequest::Given(axis) => (axis.samples, Some([axis.from, axis.to])),
        AxisRequest::Extent(samples) => (samples, None),
    };
    Some(SurfaceOptions {
        unit_m: *unit_m,
        scale: document.scale,
        translate_m: document.placement.translate_m,
        rotate_deg: document.placement.rotate_deg,
        samples: [parts(x).0, parts(y).0],
        x_m: parts(x).1,
        y_m: parts(y).1,
    })
}

/// Those of `discretize`.
#[derive(Serialize)]
pub(crate) struct PointsAsked {
    pub holes: Option<&'static str>,
    pub certify: Option<&'static str>,
    pub max_deviation_m: Option<f64>,
    pub widest_m: Option<f64>,
    pub spacing_m: Option<f64>,
    pub seed: Option<u64>,
    pub surface: Option<SurfaceOptions>,
}
