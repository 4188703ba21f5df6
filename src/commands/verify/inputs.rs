//! The inputs of a bundle: the documents that it names, read again.

use std::io;
use std::path::{Path, PathBuf};

use super::RunError;
use crate::bundle::artefact::Input;
use crate::bundle::load::{Bundle, BundleError};
use crate::bundle::manifest::SurfaceOptions;
use crate::bundle::read_bounded::digest_plain;
use crate::commands::calibrate::CalibrateOptions;
use crate::commands::calibrate::DESIGN_FILE;
use crate::commands::calibrate::PAGE_FILE;
use crate::commands::lambda::LambdaOptions;
use crate::commands::lambda::error_target::ErrorTarget;
use crate::design::{Design, Need, source};
use crate::force_direction::ForceOverride;
use crate::lambda::Settings;
use crate::scene::Scene;
use crate::scene::sources::ShapeSource;
use crate::shape::bodies::BodyOptions;
use crate::shape::document::{Fit, Placement, RawSurface, Seat, ShapeDocument, SurfaceSource};
use crate::units::FORCE_JND;

/// Inputs beside those that the bundle keeps, which are read again: it names them, and is not trusted with any
/// number or size.
const INPUTS_MAX: usize = 16;
/// The largest of them.
const INPUT_MAX_BYTES: u64 = 1 << 30;
/// Standard input among the inputs.
const STANDARD: &str = "-";
/// Tolerances that a run may have had.
const TOLERANCES: std::ops::RangeInclusive<f64> = 1e-15..=1e-1;

/// Design and shape of a bundle, and how they differ from what it says.
pub(super) struct Sources {
    /// Of the copy that the bundle keeps; the files that it names are read from their copies too.
    pub(super) design: Design,
    /// Its text.
    pub(super) text: String,
    /// Where the files that it names were when the bundle was made.
    pub(super) named: Vec<PathBuf>,
    /// `None` where its file is not here.
    pub(super) shape: Option<ShapeSource>,
    /// Contradictions: the bundle is not of these inputs.
    pub(super) faults: Vec<String>,
    /// Files that are not here, their content known all the same.
    pub(super) notes: Vec<String>,
    /// Files of the shape that are not here.
    pub(super) missing: Vec<String>,
}

impl Sources {
    /// The sources of `bundle`, paths relative to the working directory.
    ///
    /// # Errors
    /// A bundle without its design; documents that cannot be read.
    pub(super) fn of(bundle: &Bundle) -> Result<Self, RunError> {
        let inputs = &bundle.manifest.inputs;
        let (mut faults, mut notes) = (Vec::new(), Vec::new());
        let design = kept_text(bundle, DESIGN_FILE)?;
        let given = inputs.first().map_or(STANDARD, |input| &input.path);
        let read = Design::from_toml(&design, Path::new(given), Need::CALIBRATE);
        let (mut parsed, _) = read.map_err(|invalid| {
            let message = format!("as {given}: {}", invalid.to_string().trim());
            content(bundle, DESIGN_FILE, message)
        })?;
        let mut kept = vec![(DESIGN_FILE.to_owned(), digest(design.as_bytes()))];
        let named = parsed.named_files().into_iter();
        let copies: Vec<String> = named.map(|file| file.kept_name()).collect();
        for (name, (_, path)) in copies.into_iter().zip(parsed.named_files_mut()) {
            kept.push((name.clone(), kept_digest(bundle, &name)?));
            *path = bundle.folder.join(name);
        }
        for (place, (name, own)) in kept.iter().enumerate() {
            match inputs.get(place) {
                Some(input) if input.sha256 == *own => {}
                Some(input) => faults.push(format!(
                    "inputs name {} with another digest than that of {name}",
                    input.path
                )),
                None => faults.push(format!("inputs do not name the file of {name}")),
            }
        }
        let most = kept.len() + INPUTS_MAX;
        if inputs.len() > most {
            faults.push(format!("{} inputs, expected at most {most}", inputs.len()));
        }
        let mut missing = Vec::new();
        for (place, input) in inputs.iter().take(most).enumerate() {
            match state_of(input) {
                InputState::Same => {}
                InputState::Changed => faults.push(format!(
                    "{} has changed since the bundle was made",
                    input.path
                )),
                InputState::Missing if place < kept.len() => {
                    if input.path != STANDARD {
                        let (name, path) = (&kept[place].0, &input.path);
                        notes.push(format!(
                            "{path} is not here; {name} of the bundle stands for it"
                        ));
                    }
                }
                InputState::Missing => missing.push(input.path.clone()),
            }
        }
        let shape = match inputs.get(kept.len()..) {
            Some(rest) if missing.is_empty() && faults.is_empty() => shape(bundle, rest)?,
            _ => None,
        };
        let named = inputs.iter().take(kept.len()).skip(1);
        Ok(Self {
            design: parsed,
            named: named.map(|input| PathBuf::from(&input.path)).collect(),
            text: design,
            shape,
            faults,
            notes,
            missing,
        })
    }

    /// The scene of the design, its files named as the bundle's inputs name them.
    ///
    /// # Errors
    /// A design that cannot be computed; a file that changed since its digest was checked.
    pub(super) fn scene(&self, bundle: &Bundle) -> Result<Scene<'_>, RunError> {
        let mut scene = Scene::new(&self.design)?;
        for (content, path) in scene.files.iter_mut().zip(&self.named) {
            if digest(&content.bytes) != kept_digest(bundle, &content.kept_name)? {
                return Err(changed(bundle, &content.kept_name));
            }
            content.file.path.clone_from(path);
        }
        Ok(scene)
    }

    /// Why the shape cannot be read again, and what helps.
    pub(super) fn without_shape(&self) -> String {
        let named: Vec<&str> = self.missing.iter().map(String::as_str).collect();
        match named[..] {
            [] => "the manifest does not name the shape's files, or not how its surface was placed"
                .to_owned(),
            [STANDARD] => "calibrate read the shape from standard input".to_owned(),
            _ => format!(
                "{} not found; verify in the folder where calibrate ran",
                named.join(", ")
            ),
        }
    }
}

/// The options of the run that made the bundle; faults where they are none.
pub(super) fn options(bundle: &Bundle) -> Result<CalibrateOptions, String> {
    let stored = &bundle.lambda;
    let made_with = bundle.manifest.made_with.as_ref();
    let jnd_by_force = made_with.is_some_and(|made| made.jnd_by_force);
    let settings = Settings {
        criterion: stored.criterion,
        jnd_weight: if jnd_by_force { FORCE_JND } else { stored.jnd },
        at_n_per_m: stored.at.as_ref().map(|at| at.lambda_n_per_m),
    };
    let mut options = CalibrateOptions::new("");
    options.lambda = LambdaOptions {
        settings,
        jnd_by_force,
        tolerance: made_with.and_then(|made| made.tolerance),
        weights: made_with.and_then(|made| made.weights),
        error: made_with.and_then(|made| {
            let refine = made.refine;
            made.error.map(|error| ErrorTarget {
                error,
                refine,
                by_default: false,
            })
        }),
        default_error: made_with.and_then(|made| made.default_error),
        ..LambdaOptions::default()
    };
    match made_with {
        Some(made) => {
            options.reach_m = made.reach_m;
            options.page = made.report;
            options.vtk = made.vtk;
            options.lambda.force = ForceOverride {
                direction: made.force_direction,
                normal_force: made.normal_force,
            };
            options.lambda.uncertainty = made.uncertainty;
        }
        // Older bundles do not name their options; what they hold states one of them.
        None => {
            let files = &bundle.manifest.files;
            options.page = files.iter().any(|file| file.path == PAGE_FILE);
        }
    }
    let sound = options.reach_m >= 0.0
        && options.reach_m.is_finite()
        && stored.jnd > 0.0
        && stored.jnd.is_finite()
        && settings
            .at_n_per_m
            .is_none_or(|at| at >= 0.0 && at.is_finite())
        && options
            .lambda
            .error
            .map(|target| target.error)
            .or(options.lambda.default_error)
            .is_none_or(|error| ErrorTarget::RANGE.contains(&error))
        && options
            .lambda
            .tolerance
            .is_none_or(|t| TOLERANCES.contains(&t))
        && options.lambda.uncertainty.is_sound();
    sound
        .then_some(options)
        .ok_or_else(|| "the options that the bundle names are none that a run may have".to_owned())
}

/// The design's text as the bundle keeps it; its digest was checked with the others'.
fn kept_text(bundle: &Bundle, name: &str) -> Result<String, RunError> {
    let listed = kept_digest(bundle, name)?;
    let text = source::text_of(&bundle.folder.join(name))
        .map_err(|invalid| RunError::Input(invalid.to_string()))?;
    if listed != digest(text.as_bytes()) {
        return Err(changed(bundle, name));
    }
    Ok(text)
}

fn changed(bundle: &Bundle, name: &str) -> RunError {
    content(bundle, name, "changed while it was read".to_owned())
}

fn content(bundle: &Bundle, name: &str, message: String) -> RunError {
    let path = bundle.folder.join(name);
    BundleError::Content { path, message }.into()
}

/// The digest of a file that the bundle keeps, as it is listed.
fn kept_digest(bundle: &Bundle, name: &str) -> Result<String, RunError> {
    let listed = bundle.manifest.files.iter().find(|file| file.path == name);
    listed.map(|file| file.sha256.clone()).ok_or_else(|| {
        let message = "is not listed in manifest.json: there is nothing to verify against; \
                       calibrate again"
            .to_owned();
        let path = bundle.folder.join(name);
        BundleError::Content { path, message }.into()
    })
}

fn digest(bytes: &[u8]) -> String {
    Input::of_bytes("", bytes).sha256
}

enum InputState {
    Same,
    Changed,
    Missing,
}

/// Whether the input's file is still what it was.
fn state_of(input: &Input) -> InputState {
    if input.path == STANDARD {
        return InputState::Missing;
    }
    match digest_plain(Path::new(&input.path), INPUT_MAX_BYTES) {
        Ok((_, digest)) if digest == input.sha256 => InputState::Same,
        Err(error)
            if matches!(
                error.kind(),
                io::ErrorKind::NotFound | io::ErrorKind::NotADirectory
            ) =>
        {
            InputState::Missing
        }
        Ok(_) | Err(_) => InputState::Changed,
    }
}

/// The shape of the inputs that follow the design's; `None` where they are none that a run has.
fn shape(bundle: &Bundle, inputs: &[Input]) -> Result<Option<ShapeSource>, RunError> {
    let Some(first) = inputs.first() else {
        return Ok(None);
    };
    let path = Path::new(&first.path);
    let made_with = bundle.manifest.made_with.as_ref();
    if let Some(surface) = made_with.and_then(|made| made.surface.as_ref()) {
        let document = ShapeDocument::raw(&raw(path, surface));
        let document = document.map_err(|wrong| RunError::Input(wrong.to_string()))?;
        return Ok((inputs.len() == 1).then_some(ShapeSource {
            document,
            input: None,
        }));
    }
    // An older bundle does not state with which flags a surface was given.
    if made_with.is_none() && path.extension().is_none_or(|ending| ending != "toml") {
        return Ok(None);
    }
    let refuse = |invalid: crate::design::InvalidDocument| RunError::Input(invalid.to_string());
    let text = source::text_of(path).map_err(refuse)?;
    let (document, _) = ShapeDocument::from_toml(&text, path).map_err(refuse)?;
    // A surface that the inputs do not name was not part of the run.
    let named = match &document.source {
        SurfaceSource::File { path, .. } => {
            let path = path.display().to_string();
            inputs.len() <= 2 && inputs.iter().any(|input| input.path == path)
        }
        SurfaceSource::Primitive(_) => inputs.len() == 1,
    };
    let input = Some(Input::of_bytes(first.path.clone(), text.as_bytes()));
    Ok(named.then_some(ShapeSource { document, input }))
}

fn raw(path: &Path, surface: &SurfaceOptions) -> RawSurface {
    RawSurface {
        path: path.to_path_buf(),
        unit_m: surface.unit_m,
        scale: surface.scale,
        placement: Placement {
            translate_m: surface.translate_m,
            rotate_deg: surface.rotate_deg,
            seat: Seat {
                up: surface
                    .up
                    .as_deref()
                    .and_then(|up| up.parse().ok())
                    .unwrap_or_default(),
                center: surface.center,
                rest_on_m: surface.rest_on_m,
                fit: surface.fit_m.map(|box_m| Fit {
                    box_m,
                    scale: surface.scale_to_fit,
                }),
            },
        },
        bodies: BodyOptions {
            chord_m: surface.chord_m,
            body: surface.body.clone(),
        },
        samples: surface.samples,
        samples_are_given: surface.samples_are_given,
        x_m: surface.x_m,
        y_m: surface.y_m,
    }
}
