//! `verify`: whether a bundle is what its inputs give.
//!
//! Everything in a bundle follows from its inputs and options. They are looked up again, the whole
//! bundle is computed from them in memory and compared byte for byte. Beside that its numbers are
//! compared with those of an independent route, because a fault of the program would give the same
//! bytes twice: the maps and forces were made by telescoped end-face integrals with shared
//! distances and tables; here every sampled value is the loops' derivative integrated over the
//! section, directly at the point. The optimality of the currents is judged by the duality gap,
//! which does not trust the solver. All bounds are those that are computed again; none is read from
//! the bundle.

pub(crate) mod command;
mod compared;
mod constant;
mod inputs;
mod nodes;
mod passive;
mod route;
mod worst;

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use self::inputs::Sources;
use self::route::{FINER, Route};
use super::calibrate::CalibrateOptions;
use super::calibrate::again::{Expected, expected};
use super::lambda::error_target::ErrorTarget;
use super::map::PASSIVE_STAGE;
use crate::RunError;
use crate::bundle::artefact::{Input, UNITS};
use crate::bundle::load::Bundle;
use crate::bundle::manifest::Manifest;
use crate::map::Components;
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::cost::{self, COPIES_VERIFIED, Cost};
use crate::scene::passive::PASSIVE_TOLERANCE;
use crate::scene::sources::DesignSource;
use crate::scene::tolerances::Tolerances;
use crate::shape::document::ShapeDocument;

/// Errors that a bundle claims are believed up to this where they cannot be computed again.
const CLAIMED_MAX: f64 = 1e-3;
/// And errors between nodes up to this: nodes too few to resolve anything are a result too.
const BETWEEN_MAX: f64 = 10.0;

/// The checks of a bundle: the JSON result.
#[derive(Debug, Clone, Serialize)]
pub struct VerifyReport {
    /// Name of the design.
    pub design: String,
    /// Name of the shape.
    pub shape: String,
    /// Every check.
    pub checks: Vec<Check>,
    /// Remarks that are no fault of the bundle.
    pub notes: Vec<String>,
    /// Parts that could not be checked, and why.
    pub unchecked: Vec<String>,
    /// Whether all checks passed, and nothing was left unchecked without permission.
    pub passed: bool,
}

/// One check.
#[derive(Debug, Clone, Serialize)]
pub struct Check {
    /// Its name.
    pub name: &'static str,
    /// The measured difference.
    pub measured: f64,
    /// The most it may be.
    pub allowed: f64,
    /// Whether it passed.
    pub passed: bool,
    /// How.
    pub how: String,
}

/// The options of `verify`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct VerifyOptions {
    /// A bundle passes although something could not be checked.
    pub accept_unchecked: bool,
}

/// Verifies the bundle at `path`; the files that it names as inputs are looked up relative to the
/// working directory.
///
/// # Errors
/// A bundle that is damaged or inconsistent; interruption. Numbers that do not agree are no
/// error: see [`VerifyReport::passed`].
pub fn run(path: &Path, progress: &dyn Progress) -> Result<VerifyReport, RunError> {
    Verifier::default().verify(path, VerifyOptions::default(), progress)
}

/// Is given what a bundle takes to verify before anything is solved; a message refuses it.
#[derive(Clone, Copy)]
struct Limit<'a>(&'a dyn Fn(&[Cost]) -> Result<(), String>);

impl fmt::Debug for Limit<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Limit")
    }
}

/// Verifies one bundle after another. A bundle is computed from its inputs once for all in a row
/// that name the same inputs and options.
#[derive(Debug, Default)]
pub struct Verifier<'a> {
    last: Option<(Recipe, Arc<Expected>)>,
    /// Refuses what takes more than allowed.
    limit: Option<Limit<'a>>,
}

/// All that decides the content of a bundle.
#[derive(Debug, Clone, PartialEq)]
struct Recipe {
    inputs: Vec<Input>,
    shape: ShapeDocument,
    options: CalibrateOptions,
}

/// A verification under way.
struct Judgement {
    bundle: Bundle,
    checks: Vec<Check>,
    notes: Vec<String>,
    unchecked: Vec<String>,
}

impl Judgement {
    fn report(self, options: VerifyOptions) -> VerifyReport {
        let passed = self.checks.iter().all(|check| check.passed);
        VerifyReport {
            design: self.bundle.manifest.design,
            shape: self.bundle.manifest.shape,
            passed: passed && (self.unchecked.is_empty() || options.accept_unchecked),
            checks: self.checks,
            notes: self.notes,
            unchecked: self.unchecked,
        }
    }

    /// Adds checks; whether all of them passed.
    fn add(&mut self, checks: impl IntoIterator<Item = Check>) -> bool {
        let before = self.checks.len();
        self.checks.extend(checks);
        self.checks[before..].iter().all(|check| check.passed)
    }
}

impl<'a> Verifier<'a> {
    /// One that gives `limit` the costs of a bundle before it computes; a message refuses them.
    #[must_use]
    pub fn limited(limit: &'a dyn Fn(&[Cost]) -> Result<(), String>) -> Self {
        Self {
            last: None,
            limit: Some(Limit(limit)),
        }
    }

    fn allow(&self, costs: &[Cost]) -> Result<(), RunError> {
        match self.limit {
            Some(Limit(limit)) => limit(costs).map_err(RunError::Input),
            None => Ok(()),
        }
    }

    fn check_costs(&self, sources: &Sources, bundle: &Bundle) -> Result<(), RunError> {
        if self.limit.is_none() {
            return Ok(());
        }
        let design = &sources.design;
        let made_with = bundle.manifest.made_with.as_ref();
        let of_error = made_with.and_then(|made| made.error).map(|error| {
            ErrorTarget {
                error,
                refine: false,
                by_default: false,
            }
            .tolerance()
        });
        let tolerance = made_with.and_then(|made| made.tolerance).or(of_error);
        // Solved again as the bundle was made, and to judge that a finer time.
        let finer = Tolerances::of_inductances(tolerance).min(CLAIMED_MAX) * FINER;
        let steel = [tolerance, Some(finer)].map(|tolerance| cost::of_steel(design, tolerance));
        let pull = cost::of_pull(design, FINER * PASSIVE_TOLERANCE);
        let mut costs: Vec<Cost> = steel.into_iter().flatten().chain(pull).collect();
        for cost in &mut costs {
            // What the bundle claims is judged, not what was requested.
            cost.misses = None;
        }
        if let Some(shape) = &sources.shape {
            // With the bundle, and by the independent route.
            let again = || cost::of_force_constants(design, &shape.document, tolerance);
            costs.extend(again().into_iter().chain(again()));
            let coils = design.array.positions_m.len();
            let points = cost::of_points(&shape.document, coils);
            // Beside the map.
            let map = cost::of_stored_map(&bundle.folder, COPIES_VERIFIED);
            costs.push(Cost {
                bytes: points.bytes + map.map_or(0.0, |map| map.bytes),
                ..points
            });
            // Of its nodes the bundle holds those that the object needs.
            costs.push(Cost {
                bytes: 0.0,
                ..cost::of_map(design, Components::Gz)
            });
        }
        self.allow(&costs)
    }

    /// As [`run`].
    ///
    /// # Errors
    /// As [`run`].
    pub fn verify(
        &mut self,
        path: &Path,
        options: VerifyOptions,
        progress: &dyn Progress,
    ) -> Result<VerifyReport, RunError> {
        progress.begin("verify", 5);
        self.allow(cost::of_bundle(path, COPIES_VERIFIED).as_slice())?;
        let bundle = Bundle::open(path)?;
        progress.advance(1);
        let sources = Sources::of(&bundle)?;
        let scene = sources.scene(&bundle)?;
        let mut all = Judgement {
            bundle,
            checks: Vec::new(),
            notes: sources.notes.clone(),
            unchecked: Vec::new(),
        };
        // The cheap ones first: where they fail nothing is solved.
        let how = "sizes, digests and schema of every listed file".to_owned();
        let cheap = [
            check("files", 0.0, 0.0, how),
            inputs_agree(&all.bundle, &sources),
            scene_agrees(&all.bundle, &scene),
        ];
        if !all.add(cheap) {
            progress.end();
            return Ok(all.report(options));
        }
        self.check_costs(&sources, &all.bundle)?;
        let expected = self.expected(&mut all, &scene, &sources, progress)?;
        progress.advance(1);
        progress.check()?;
        if all.checks.iter().any(|check| !check.passed) {
            progress.end();
            return Ok(all.report(options));
        }
        let bounds = match &expected {
            Some(expected) => Bounds::of(&expected.manifest),
            None => Bounds::claimed(&all.bundle.manifest),
        };
        let route = Route::new(&scene, &all.bundle, &bounds)?;
        let nodes = nodes::on(&all.bundle, &route, &bounds)?;
        let between = nodes::between(&all.bundle, &route, &bounds)?;
        all.add(nodes.into_iter().chain(between));
        progress.advance(1);
        progress.check()?;
        let weights = expected.as_ref().and_then(|e| e.weights.as_deref());
        if weights.is_some() || all.bundle.lambda.weights.is_equal() {
            let constant = constant::checks(&all.bundle, &route, &bounds, weights, progress)?;
            all.add(constant);
        } else {
            let what = "the force constant: its points count by areas that follow from the shape";
            all.unchecked.push(what.to_owned());
        }
        progress.advance(1);
        progress.check()?;
        let pull = passive::checks(&all.bundle, &scene, &bounds)?;
        all.add(pull);
        progress.advance(1);
        progress.end();
        Ok(all.report(options))
    }

    /// The bundle that the inputs give, compared with this one; `None` where an input is missing.
    fn expected(
        &mut self,
        all: &mut Judgement,
        scene: &Scene,
        sources: &Sources,
        progress: &dyn Progress,
    ) -> Result<Option<Arc<Expected>>, RunError> {
        let Some(shape) = &sources.shape else {
            all.unchecked.push(format!(
                "points, requested directions, lambda's path and what follows from lambda, the setting for \
                 uncertainties, tensors and fields of the map, pages, plots, files for ParaView, texts and stated errors: {}",
                sources.without_shape()
            ));
            return Ok(None);
        };
        let wrong = |message: String| check("recomputed", 1.0, 0.0, message);
        let options = match inputs::options(&all.bundle) {
            Ok(options) => options,
            Err(message) => {
                all.add([wrong(message)]);
                return Ok(None);
            }
        };
        if all.bundle.manifest.made_with.is_none() {
            all.unchecked.push(format!(
                "the run's options: bundles of schema {} do not name them, so its tolerance and reach \
                 are taken to be the defaults",
                all.bundle.manifest.schema_version
            ));
        }
        let recipe = Recipe {
            inputs: all.bundle.manifest.inputs.clone(),
            shape: shape.document.clone(),
            options,
        };
        let known = self.last.as_ref().filter(|(known, _)| *known == recipe);
        let computed = match known {
            Some((_, known)) => Arc::clone(known),
            None => {
                let input = &all.bundle.manifest.inputs[0];
                let source = DesignSource {
                    design: &sources.design,
                    text: &sources.text,
                    input,
                };
                let quiet = Quiet(progress);
                match expected(scene, source, shape, &recipe.options, &quiet) {
                    Ok(computed) => Arc::new(computed),
                    Err(error @ RunError::Interrupted(_)) => return Err(error),
                    Err(error) => {
                        all.add([wrong(format!("the inputs give no bundle: {error}"))]);
                        return Ok(None);
                    }
                }
            }
        };
        self.last = Some((recipe, Arc::clone(&computed)));
        let compared = compared::compare(&all.bundle, &computed);
        all.add([compared.check]);
        all.unchecked.extend(compared.unchecked);
        if !compared.exact {
            all.notes.push(format!(
                "made by fluxform {} on {}: numbers are compared within the bounds computed here, \
                 not byte for byte",
                all.bundle.manifest.fluxform_version,
                compared::made_on(&all.bundle)
            ));
        }
        Ok(Some(computed))
    }
}

/// Stages of a computation within a stage are not reported; interruption is.
struct Quiet<'a>(&'a dyn Progress);

impl Progress for Quiet<'_> {
    fn interrupted(&self) -> bool {
        self.0.interrupted()
    }
}

fn check(name: &'static str, measured: f64, allowed: f64, how: String) -> Check {
    // A measurement that is not a number fails, and stays out of the report.
    let passed = measured <= allowed;
    let measured = if measured.is_finite() {
        measured
    } else {
        f64::MAX
    };
    Check {
        name,
        measured,
        allowed,
        passed,
        how,
    }
}

/// An error relative to a size; nothing is no error of nothing.
fn ratio(error: f64, size: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / size }
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    a.iter()
        .zip(b)
        .map(|(a, b)| {
            if a == b {
                0.0
            } else {
                (a - b).abs() / a.abs().max(b.abs())
            }
        })
        .fold(0.0, f64::max)
}

/// Errors that numbers may have, relative as the manifest states them.
struct Bounds {
    forces: f64,
    map: f64,
    /// Of the maps along x, y and z.
    between: [f64; 3],
    pull: f64,
    pull_map: f64,
    pull_between: f64,
}

impl Bounds {
    /// Those of a manifest that was computed here.
    fn of(manifest: &Manifest) -> Self {
        let stage = |name: &str| {
            let stage = manifest.accuracy.get(name);
            stage.map_or(0.0, |stage| stage.estimate)
        };
        let pull = manifest.map.passive_force.as_ref();
        let [x, y] = (manifest.map.sides.as_ref()).map_or([0.0; 2], |sides| sides.largest_error);
        Self {
            forces: stage("forces"),
            map: stage("map"),
            between: [x, y, manifest.map.interpolation.largest_error],
            pull: stage("passive_force"),
            pull_map: stage(PASSIVE_STAGE),
            pull_between: pull.map_or(0.0, |pull| pull.interpolation.largest_error),
        }
    }

    /// Those that a bundle claims, as far as they can be believed.
    fn claimed(manifest: &Manifest) -> Self {
        let claimed = Self::of(manifest);
        Self {
            forces: claimed.forces.min(CLAIMED_MAX),
            map: claimed.map.min(CLAIMED_MAX),
            // Nodes that are right leave little to claim between them.
            between: claimed.between.map(|error| error.min(BETWEEN_MAX)),
            pull: claimed.pull.min(CLAIMED_MAX),
            pull_map: claimed.pull_map.min(CLAIMED_MAX),
            pull_between: claimed.pull_between.min(1.0),
        }
    }
}

/// The named inputs against the files at their paths and the copies in the bundle; both JSON
/// documents must name the same.
fn inputs_agree(bundle: &Bundle, sources: &Sources) -> Check {
    let (manifest, lambda) = (&bundle.manifest, &bundle.lambda);
    let mut faults = sources.faults.clone();
    for (what, same) in [
        ("inputs", manifest.inputs == lambda.inputs),
        ("design", manifest.design == lambda.design),
        ("shape", manifest.shape == lambda.shape),
        ("criterion", manifest.lambda.criterion == lambda.criterion),
        (
            "schema_version",
            manifest.schema_version == lambda.schema_version,
        ),
        (
            "fluxform_version",
            manifest.fluxform_version == lambda.fluxform_version,
        ),
    ] {
        if !same {
            faults.push(format!("manifest.json and lambda.json differ in {what}"));
        }
    }
    let made_with = manifest.made_with.as_ref();
    if made_with.is_some_and(|made| made.sha256 != made.digest()) {
        faults.push("the options in made_with do not have their digest".to_owned());
    }
    let how = if faults.is_empty() {
        "the files that the bundle names as inputs, and the copies it keeps".to_owned()
    } else {
        faults.join("; ")
    };
    check("inputs", faults.len() as f64, 0.0, how)
}

/// Coils, positions, gains, limits, magnet, names and units against the design.
fn scene_agrees(bundle: &Bundle, scene: &Scene) -> Check {
    let manifest = &bundle.manifest;
    let (array, limits) = (scene.array_geometry(), scene.current_limits());
    let magnet = scene.magnet_summary();
    let voltage = manifest.circuit.as_ref().and_then(|c| c.voltage_v);
    let words = [
        (manifest.design.as_str(), scene.design.name.as_str()),
        (&manifest.units, UNITS),
        (&manifest.array.coupling, &array.coupling),
        (&manifest.magnet.model, &magnet.model),
        (&manifest.magnet.polarity, &magnet.polarity),
    ];
    let lists: [(&[f64], &[f64]); 9] = [
        (
            manifest.array.positions_m.as_flattened(),
            array.positions_m.as_flattened(),
        ),
        (&manifest.array.gain, &array.gain),
        (&manifest.limits.current_max_a, &limits.current_max_a),
        (&manifest.limits.current_min_a, &limits.current_min_a),
        (
            manifest.limits.total_current_max_a.as_slice(),
            limits.total_current_max_a.as_slice(),
        ),
        (&manifest.magnet.moment_a_m2, &scene.moment_a_m2),
        (
            &[manifest.magnet.diameter_m, manifest.magnet.length_m],
            &[magnet.diameter_m, magnet.length_m],
        ),
        (&manifest.resistance_ohm, &scene.resistances_ohm()),
        (
            voltage.as_slice(),
            match manifest.circuit {
                Some(_) => scene.design.supply.voltage_v.as_slice(),
                None => &[],
            },
        ),
    ];
    let other_words = words.iter().any(|(stored, expected)| stored != expected);
    let worst = lists
        .into_iter()
        .map(|(stored, expected)| difference(stored, expected))
        .fold(if other_words { f64::INFINITY } else { 0.0 }, f64::max);
    let how = "names, units, positions, gains, limits, resistance, voltage and magnet against \
               design.toml";
    check("scene", worst, 1e-14, how.to_owned())
}
