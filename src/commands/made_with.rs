//! Common entries of several commands' options in the record's `made_with`: those that change the
//! files, and nothing else. Where files go and what is drawn beside them is no option of theirs.
//!
//! `sweep merge` has none: its table follows from the plan and the points that there are. What `optimize`
//! writes has no record: it is replaced by the same bytes alone.

use serde::Serialize;

use crate::bundle::artefact::Input;
use crate::bundle::manifest::SurfaceOptions;
use crate::point_weights::Weights;
use crate::shape::document::{AxisRequest, ShapeDocument, SurfaceSource, Up};

/// A surface's options on the command line; `None` where a shape file states them.
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
    let seat = &document.placement.seat;
    Some(SurfaceOptions {
        unit_m: *unit_m,
        scale: document.scale,
        translate_m: document.placement.translate_m,
        rotate_deg: document.placement.rotate_deg,
        samples: [parts(x).0, parts(y).0],
        samples_are_given: document.grid_is_given,
        x_m: parts(x).1,
        y_m: parts(y).1,
        up: (seat.up != Up::default()).then(|| seat.up.name().to_owned()),
        center: seat.center,
        rest_on_m: seat.rest_on_m,
        fit_m: seat.fit.map(|fit| fit.box_m),
        scale_to_fit: seat.fit.is_some_and(|fit| fit.scale),
        chord_m: document.bodies.chord_m,
        body: document.bodies.body.clone(),
    })
}

/// Those of `discretize`.
#[derive(Default, Serialize)]
pub(crate) struct PointsAsked {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub weights: Option<Weights>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub refine: bool,
    pub holes: Option<&'static str>,
    pub certify: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certify_seconds: Option<u64>,
    pub max_deviation_m: Option<f64>,
    pub widest_m: Option<f64>,
    pub spacing_m: Option<f64>,
    pub seed: Option<u64>,
    pub surface: Option<SurfaceOptions>,
}
