//! The options of a command as its record states them in `made_with`. What they change in its files,
//! and nothing else: where the files go and what is drawn beside them is no option of theirs.
//!
//! `sweep merge` has none: its table follows from the plan and the points that there are. What `optimize`
//! writes has no record: it is replaced by the same bytes alone.
//!
//! Every option is named here: a new one does not compile before it is recorded or left out on purpose.

use serde::Serialize;

use super::calibrate::{CalibrateOptions, ShapeSource};
use super::discretize::PointsOptions;
use super::discretize::scattered::Sampling;
use super::lambda::LambdaOptions;
use super::map::mag_manip::MagManipRequest;
use super::map::{MapRequest, components_name};
use super::replay::synthesize::Synthesis;
use crate::bundle::artefact::{Input, Options, arithmetic};
use crate::bundle::manifest::{MadeWith, SurfaceOptions};
use crate::lambda::Settings;
use crate::shape::certificate::Certify;
use crate::shape::document::{AxisRequest, ShapeDocument, SurfaceSource};
use crate::shape::holes::Holes;

/// Those of `calibrate`: what `verify` needs beside the inputs to compute the same bundle again.
pub(super) fn calibrate(options: &CalibrateOptions, shape: &ShapeSource) -> MadeWith {
    let CalibrateOptions {
        out: _,
        force: _,
        lambda,
        reach_m,
        keep: _,
        page,
    } = options;
    let LambdaOptions {
        settings,
        tolerance,
        // Of `lambda` alone.
        sampling: _,
        wiring: _,
        variants: _,
        feedback: _,
        picture: _,
    } = lambda;
    let Settings {
        criterion,
        jnd_weight,
        at_n_per_m,
    } = *settings;
    let mut made_with = MadeWith {
        criterion: Some(criterion),
        jnd: Some(jnd_weight),
        at_n_per_m,
        tolerance: *tolerance,
        reach_m: *reach_m,
        report: *page,
        arithmetic: arithmetic(),
        surface: surface(&shape.document, shape.input.as_ref()),
        sha256: String::new(),
    };
    made_with.sha256 = made_with.digest();
    made_with
}

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

/// Those of `map`.
pub(super) fn map(request: &MapRequest) -> Options {
    #[derive(Serialize)]
    struct Asked<'a> {
        components: &'static str,
        tolerance: Option<f64>,
        currents_a: Option<&'a [f64]>,
        vfield_nodes: Option<usize>,
        mpem_tolerance: Option<f64>,
    }
    let MapRequest {
        components,
        tolerance,
        currents_a,
        out: _,
        formats: _,
        mag_manip,
        force: _,
    } = request;
    let MagManipRequest {
        vector_field: _,
        nodes,
        multipoles: _,
        tolerance: mpem_tolerance,
    } = mag_manip;
    Options::of(&Asked {
        components: components_name(*components),
        tolerance: *tolerance,
        currents_a: currents_a.as_deref(),
        vfield_nodes: *nodes,
        mpem_tolerance: *mpem_tolerance,
    })
}

/// Those of `discretize`.
#[derive(Serialize)]
struct PointsAsked {
    holes: Option<&'static str>,
    certify: Option<&'static str>,
    max_deviation_m: Option<f64>,
    widest_m: Option<f64>,
    spacing_m: Option<f64>,
    seed: Option<u64>,
    surface: Option<SurfaceOptions>,
}

/// Those of `discretize` on a grid; `file` is the shape file's entry among the inputs.
pub(super) fn points(
    options: &PointsOptions,
    document: &ShapeDocument,
    file: Option<&Input>,
) -> Options {
    let PointsOptions {
        holes,
        certify,
        picture: _,
    } = *options;
    let holes = match holes {
        Holes::Skip => "skip",
        Holes::Fill => "fill",
        Holes::Error => "error",
    };
    let certify = match certify {
        Certify::No => "no",
        Certify::Vertical => "vertical",
        Certify::Distance => "distance",
    };
    Options::of(&PointsAsked {
        holes: Some(holes),
        certify: Some(certify),
        max_deviation_m: None,
        widest_m: None,
        spacing_m: None,
        seed: None,
        surface: surface(document, file),
    })
}

/// Those of `discretize` on no grid; `file` as above.
pub(super) fn scattered(
    sampling: Sampling,
    document: &ShapeDocument,
    file: Option<&Input>,
) -> Options {
    let (adaptive, poisson) = match sampling {
        Sampling::Adaptive {
            max_deviation_m,
            widest_m,
        } => (Some((max_deviation_m, widest_m)), None),
        Sampling::Poisson { spacing_m, seed } => (None, Some((spacing_m, seed))),
    };
    Options::of(&PointsAsked {
        holes: None,
        certify: None,
        max_deviation_m: adaptive.map(|(deviation_m, _)| deviation_m),
        widest_m: adaptive.and_then(|(_, widest_m)| widest_m),
        spacing_m: poisson.map(|(spacing_m, _)| spacing_m),
        seed: poisson.map(|(_, seed)| seed),
        surface: surface(document, file),
    })
}

/// Those of `replay`.
#[must_use]
pub fn replay(synthesis: Option<&Synthesis>, dynamics: bool) -> Options {
    #[derive(Serialize)]
    struct Asked {
        dynamics: bool,
        synthesize: Option<&'static str>,
        seed: Option<u64>,
        duration_s: Option<f64>,
        rate_hz: Option<f64>,
    }
    let made_up = synthesis.map(|synthesis| {
        let Synthesis {
            kind,
            seed,
            duration_s,
            rate_hz,
        } = *synthesis;
        (kind.name(), seed, duration_s, rate_hz)
    });
    Options::of(&Asked {
        dynamics,
        synthesize: made_up.map(|(kind, ..)| kind),
        seed: made_up.map(|(_, seed, ..)| seed),
        duration_s: made_up.map(|(_, _, duration_s, _)| duration_s),
        rate_hz: made_up.map(|(.., rate_hz)| rate_hz),
    })
}
