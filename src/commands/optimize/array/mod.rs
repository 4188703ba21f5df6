//! `optimize --for`: the array that renders given shapes best.

pub(crate) mod command;
mod journal;
mod page;
pub mod physics;
mod pitch_bound;
mod result;
pub(crate) mod tables;
mod text;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

pub use result::*;

use self::physics::{Aim, ArrayPhysics, Constant, OtherAim};
use self::pitch_bound::{PitchBound, pitch_bound};
use super::Document;
use crate::RunError;
use crate::accuracy::CertificateKind;
use crate::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION};
use crate::coil::array_search::problem::{ArrayProblem, Level, Objective, Physical, Physics, Room};
use crate::coil::array_search::search::{
    Candidate, Found, Problems, Refused, Request, problems, run,
};
use crate::coil::array_search::study::{Study, study};
use crate::coil::limits::{self, LimitCheck};
use crate::commands::bench::clock::Watch;
use crate::commands::evaluate::evaluate;
use crate::design::message_text::{number, twelve_digits};
use crate::design::search::SearchKey;
use crate::design::template::Template;
use crate::design::values::derived_name;
use crate::design::{Design, InvalidDocument, Need};
use crate::lambda::Criterion;
use crate::lambda::feedback::NoLambda;
use crate::numerics::mixed_search::{MET, Settings};
use crate::progress::{Interrupted, Progress, Silent, interruptible, to_its_end};
use crate::scene::Scene;
use crate::scene::drawing::drawing;
use crate::scene::rated::Rated;
use crate::scene::sources::ShapeSource;

/// The options of [`optimize_array`].
#[derive(Debug, Clone, PartialEq)]
pub struct ArrayRequest {
    /// Weights of the shapes in the geometric mean; `None`: the smallest counts.
    pub shares: Option<Vec<f64>>,
    /// Evaluations, starts, seed.
    pub settings: Settings,
    /// Allowed error of the final evaluation.
    pub tolerance: Option<f64>,
    /// Whether every number of coils is searched to its end.
    pub every_count: bool,
}

/// Relative error at which more of the force is missing than is there.
const MOSTLY_MISSING: f64 = 0.5;

/// The merit of every shape with the given design, at both levels.
struct Before {
    search: Physical,
    /// Processor time that it took at the accuracy of the search, s.
    search_cpu_s: f64,
    full: Physical,
}

/// A design and its text with the limit on a coil's settling as one on the array's too, unless it has its
/// own or no array that is searched could meet it: the coil misses it and nothing changes the coil.
///
/// # Errors
/// A design that cannot be computed.
pub(crate) fn settling_in_array(
    design: Design,
    text: String,
    path: &Path,
    tolerance: Option<f64>,
) -> Result<(Design, String), RunError> {
    let key = "limits.array_settling_max_ms";
    let refused = |wrong: InvalidDocument| RunError::Input(wrong.to_string());
    let template = Template::new(&text, path).map_err(refused)?;
    let of_coil = template.get("limits.settling_max_ms").cloned();
    let (Some(settling), None) = (of_coil, template.get(key)) else {
        return Ok((design, text));
    };
    if !design.search.changes_coil() {
        let alone = Rated::new(&Scene::with_tolerance(&design, tolerance)?)?;
        let missed = alone
            .limits
            .get("settling_s")
            .is_some_and(|check| !check.met);
        if missed {
            return Ok((design, text));
        }
    }
    let text = template.with([(key, settling)]).map_err(RunError::Input)?;
    let (design, _) = Design::from_toml(&text, path, Need::CALIBRATE).map_err(refused)?;
    Ok((design, text))
}

/// The best array for `shapes` within the limits and the `[search]` of a design. `announce` is given the processor time
/// that the given design took at the accuracy of the search, s, before others are computed.
///
/// # Errors
/// A design that cannot be searched, with the reason; interruption before anything is known.
pub fn optimize_array(
    document: &Document<'_>,
    shapes: &[ShapeSource],
    inputs: Vec<Input>,
    request: &ArrayRequest,
    physics: &ArrayPhysics<'_>,
    announce: &dyn Fn(f64),
    progress: &dyn Progress,
) -> Result<ArrayOptimization, RunError> {
    let design = document.design;
    let search = Request {
        objective: match &request.shares {
            Some(shares) => Objective::Mean(shares.clone()),
            None => Objective::Smallest,
        },
        settings: request.settings,
        room: room(design, physics),
        every_count: request.every_count,
    };
    // Contradictions are reported before anything is computed.
    let refused = |refused: Refused| RunError::Input(refused.to_string());
    problems(design, &search, &vec![1.0; shapes.len()], physics).map_err(refused)?;
    if design.search.values(SearchKey::Height).is_none()
        && let Some(why) = physics.misplaced(design, shapes)
    {
        return Err(RunError::Misplaced(why));
    }
    progress.begin("given design", 2);
    let before = before(design, shapes, physics, progress)?;
    progress.end();
    announce(before.search_cpu_s);
    let Problems {
        all,
        refused: impossible,
    } = problems(design, &search, &before.full.merits, physics).map_err(refused)?;
    for problem in &all {
        problem.begin_with(&before.search, &before.full);
    }
    progress.begin("arrays", request.settings.evaluations as u64);
    let found = run(&all, design, &search)?;
    let Some(mut found) = found else {
        return Err(RunError::Interrupted(Interrupted));
    };
    let around = match found.interrupted {
        false => interruptible(|| study(&mut found, design))
            .and_then(|studied| studied)
            .ok(),
        true => None,
    };
    progress.end();
    let bound = match found.interrupted {
        false => interruptible(|| bound(&found, request, physics, &before, progress))
            .ok()
            .flatten(),
        true => None,
    };
    // Nothing more is computed after the user's stop.
    found.interrupted |= progress.interrupted();
    let answer = |found: &Found<'_>, around: Option<Study>| {
        let inputs = inputs.clone();
        let mut answered = result(
            document,
            (shapes, inputs),
            request,
            physics,
            (&before, found, around, bound),
        )?;
        answered.warnings.extend(impossible.iter().cloned());
        Ok(answered)
    };
    if !found.interrupted
        && let Ok(answered) = interruptible(|| answer(&found, around.clone()))
    {
        return answered;
    }
    found.interrupted = true;
    to_its_end(|| answer(&found, around))
}

/// The bound of the gain that `found` was searched for, where there is one.
fn bound(
    found: &Found<'_>,
    request: &ArrayRequest,
    physics: &ArrayPhysics<'_>,
    before: &Before,
    progress: &dyn Progress,
) -> Option<PitchBound> {
    let ([_], Level::Full) = (&found.choices[..], found.best.level) else {
        return None;
    };
    let shares = request.shares.as_deref();
    let known = together(&ratios(&found.best.physical, &before.full), shares);
    pitch_bound(
        found.problem,
        physics,
        (&before.full.merits, shares),
        known,
        progress,
    )
    .ok()
    .flatten()
}

/// Merits relative to others.
fn ratios(now: &Physical, before: &Physical) -> Vec<f64> {
    let pairs = now.merits.iter().zip(&before.merits);
    pairs.map(|(now, before)| now / before).collect()
}

/// Where cores and shapes may reach. A core: the workspace's lowest height, the target's and the shapes' lowest
/// point, less what the magnet takes. Shapes: the heights of the workspace, or farther where they are given there.
fn room(design: &Design, physics: &ArrayPhysics) -> Room {
    let [lowest_m, highest_m] = physics.heights_m();
    let space = design.workspace.z_m;
    let lowest_used_m = lowest_m.min(space.from).min(design.target_height_m);
    let depth_m = Scene::new(design).map_or(0.0, |scene| scene.magnet_depth_m());
    Room {
        ceiling_m: lowest_used_m - depth_m,
        height_m: [
            (space.from - lowest_m).min(0.0),
            (space.to - highest_m).max(0.0),
        ],
    }
}

fn before(
    design: &Design,
    shapes: &[ShapeSource],
    physics: &ArrayPhysics,
    progress: &dyn Progress,
) -> Result<Before, RunError> {
    let rendered = |level| -> Result<Physical, RunError> {
        let physical = physics.rendered_or_why(design, 0.0, level)?;
        progress.advance(1);
        match physical {
            Ok(physical) => Ok(physical),
            Err(nothing) => {
                let shape = &shapes[nothing.shape];
                let other = other_constant(design, shape, physics)?;
                let name = &shape.document.name;
                let why = nothing_rendered(name, physics.aim().constant, nothing.why, other);
                Err(RunError::Input(why))
            }
        }
    };
    // Full accuracy first: points are named by their number in the shape.
    let full = rendered(Level::Full)?;
    let watch = Watch::start();
    let search = rendered(Level::Search)?;
    Ok(Before {
        search,
        search_cpu_s: watch.processor_s(),
        full,
    })
}

/// Another force constant that `design` has for `shape`, and its value, N/m.
fn other_constant(
    design: &Design,
    shape: &ShapeSource,
    physics: &ArrayPhysics,
) -> Result<Option<(Criterion, f64)>, RunError> {
    let known = physics.aim().constant;
    let others = [Criterion::Jnd, Criterion::Saturation].into_iter();
    for criterion in others.filter(|other| known != Constant::Static(*other)) {
        let aim = Aim {
            constant: criterion.into(),
            at_n_per_m: None,
            ..physics.aim()
        };
        let alone = std::slice::from_ref(shape);
        let tolerance = physics.tolerance(Level::Full, design);
        let all = ArrayPhysics::new(alone, aim, tolerance, &Silent)?;
        if let Some(rendered) = all.rendered(design, 0.0, Level::Full)? {
            return Ok(Some((criterion, rendered.merits[0])));
        }
    }
    Ok(None)
}

/// Why a search cannot begin at a design that has no such constant for a shape, or only an `other` one.
fn nothing_rendered(
    shape: &str,
    constant: Constant,
    why: Option<NoLambda>,
    other: Option<(Criterion, f64)>,
) -> String {
    let because = why.map_or_else(String::new, |why| format!(" ({why})"));
    match (constant, other) {
        (Constant::Other(OtherAim::Vector), _) if why.is_some() => format!(
            "the given design cannot render the force vector of {shape}{because}, so there is nothing to \
             compare with: let currents flow both ways (supply.current_min_a below 0), or add coils"
        ),
        (
            Constant::Static(_) | Constant::Other(OtherAim::Feedback),
            Some((other, lambda_n_per_m)),
        ) => format!(
            "lambda_{} of the given design is 0 for {shape}{because}, so there is nothing to compare with, though its \
             lambda_{} is {lambda_n_per_m:.3} N/m: choose another --constant, like {1}, or begin at an array whose \
             lambda_{0} is above 0",
            constant.name(),
            other.name()
        ),
        (Constant::Static(_) | Constant::Other(_), _) => {
            Refused::NothingRendered(shape.to_owned()).to_string()
        }
    }
}

/// The limits of the best array and of the given one, and whether the best one meets its own.
struct Checked {
    limits: BTreeMap<&'static str, LimitCheck>,
    given: BTreeMap<&'static str, LimitCheck>,
    met: bool,
}

/// Checks what `best` and the given design are limited to, and which ranges of the search the best one misses. What
/// both miss alike, because nothing that is searched changes it, is a warning.
fn checked(
    [best, given]: [&Design; 2],
    (problem, found, properties_given): (&ArrayProblem, &Candidate, &Physical),
    tolerance: Option<f64>,
    warnings: &mut Vec<String>,
) -> Result<Checked, RunError> {
    let evaluation = evaluate(best, Vec::new(), tolerance)?;
    warnings.extend(evaluation.warnings);
    let mut limits = evaluation.limits;
    let of_shapes = checks_of_shapes(best, &found.physical);
    let known = problem.bounds(&found.x, None);
    let searched: BTreeSet<&str> = (known.iter().map(|bound| bound.key))
        .chain(of_shapes.iter().map(|(key, _)| *key))
        .collect();
    limits.extend(of_shapes);
    limits.extend(missed_ranges(found));
    let mut limits_given = evaluate(given, Vec::new(), tolerance)?.limits;
    limits_given.extend(checks_of_shapes(given, properties_given));
    let missed = limits.iter().filter(|(_, check)| !check.met);
    let (unchanged, broken): (Vec<_>, Vec<_>) = missed.partition(|(key, check)| {
        let given = limits_given.get(*key);
        !searched.contains(*key) && given.is_some_and(|given| given.value == check.value)
    });
    let met = broken.is_empty();
    let keys: Vec<&str> = unchanged.iter().map(|(key, _)| key.as_ref()).collect();
    if !keys.is_empty() {
        warnings.push(format!(
            "{}: missed by the given design, and nothing that is searched changes it",
            keys.join(", ")
        ));
    }
    Ok(Checked {
        limits,
        given: limits_given,
        met,
    })
}

/// How sure it is that no array is better.
fn certificate(found: &Found<'_>, bound: Option<PitchBound>, gain: f64) -> ArrayCertificate {
    let search = &found.search;
    let objective = |x: &Vec<f64>| {
        let sample = search.samples().iter().find(|sample| sample.x == *x)?;
        let judged = found.problem.judged_sample(sample)?;
        (judged.excess() <= MET).then(|| judged.objective().exp())
    };
    ArrayCertificate {
        kind: match bound {
            Some(_) => CertificateKind::Global,
            None if found.choices.iter().all(|choice| choice.complete) => {
                CertificateKind::Exhaustive
            }
            None => CertificateKind::of_searches(search.ends().len().max(1)),
        },
        starts: search.ends().len(),
        ends: search.ends().iter().filter_map(objective).collect(),
        upper_bound: bound.map(|bound| bound.gain),
        gap: bound.map(|bound| bound.gain / gain - 1.0),
        cells: bound.map_or(0, |bound| bound.pitches),
    }
}

/// The result, as it is reported.
fn result(
    document: &Document<'_>,
    (shapes, inputs): (&[ShapeSource], Vec<Input>),
    request: &ArrayRequest,
    physics: &ArrayPhysics,
    (before, found, around, bound): (&Before, &Found<'_>, Option<Study>, Option<PitchBound>),
) -> Result<ArrayOptimization, RunError> {
    let Candidate {
        x,
        physical,
        bounds,
        ..
    } = &found.best;
    // What the search estimates is corrected to full accuracy too.
    let given = &before.full;
    let ratios = ratios(physical, given);
    let gain = together(&ratios, request.shares.as_deref());
    let constant = physics.aim().constant;
    let (design_text, best) = written(document, found)?;
    let raised_mm = 1e3 * found.problem.space.raised_m(x);
    let mut warnings: Vec<String> = moved_shapes(raised_mm).into_iter().collect();
    // After an interruption nothing more is computed.
    let checked = if found.interrupted {
        Checked {
            limits: BTreeMap::new(),
            given: BTreeMap::new(),
            met: bounds.iter().all(|bound| bound.is_met()),
        }
    } else {
        let designs = [&best, document.design];
        if constant == Constant::Static(Criterion::Saturation) {
            warnings.extend(past_rendering(found, shapes, physics)?);
        }
        let of = (found.problem, &found.best, given);
        checked(designs, of, request.tolerance, &mut warnings)?
    };
    let status = match (found.interrupted, checked.met) {
        (true, _) => ArrayEnding::Interrupted,
        (false, true) => ArrayEnding::Done,
        (false, false) => ArrayEnding::Infeasible,
    };
    Ok(ArrayOptimization {
        schema_version: SCHEMA_VERSION,
        fluxform_version: FLUXFORM_VERSION,
        design: document.design.name.clone(),
        inputs,
        status,
        constant,
        at_n_per_m: physics.aim().at_n_per_m,
        objective: if request.shares.is_some() {
            "mean"
        } else {
            "smallest"
        },
        gain,
        shapes: shape_gains(shapes, constant, [&given.merits, &physical.merits], &ratios),
        values: found.problem.space.named(x),
        limits: checked.limits,
        limits_given: checked.given,
        limits_met: checked.met,
        study: around,
        certificate: certificate(found, bound, gain),
        levels: levels(physics, document.design, (before, found))?,
        evaluations: found.evaluations,
        history: history(found),
        choices: found.choices.clone(),
        seed: request.settings.seed,
        drawn: [document.design, &best].map(|design| drawing(design, [])),
        design_text,
        warnings,
    })
}

/// What is left to do where the shapes were moved: they are no part of the design.
fn moved_shapes(raised_mm: f64) -> Option<String> {
    let way = if raised_mm < 0.0 { "lower" } else { "higher" };
    (raised_mm != 0.0).then(|| {
        format!(
            "the force constants are those of the shapes {} mm {way} than given: move them by translate_mm or by their \
             heights before the design is used with them",
            number(twelve_digits(raised_mm.abs()))
        )
    })
}

/// What every shape gains, from its merits before and now and their ratio.
fn shape_gains(
    shapes: &[ShapeSource],
    constant: Constant,
    [before, now]: [&[f64]; 2],
    gains: &[f64],
) -> Vec<ShapeGain> {
    let of_constant = |merit: f64| (constant != Constant::ERROR).then_some(merit);
    let of_error = |merit: f64| (constant == Constant::ERROR).then(|| merit.recip());
    let shape = |(index, source): (usize, &ShapeSource)| ShapeGain {
        shape: source.document.name.clone(),
        lambda_before_n_per_m: of_constant(before[index]),
        lambda_n_per_m: of_constant(now[index]),
        relative_error_before: of_error(before[index]),
        relative_error: of_error(now[index]),
        gain: gains[index],
    };
    shapes.iter().enumerate().map(shape).collect()
}

/// The limits that `evaluate`, which knows no shapes, leaves out.
fn checks_of_shapes(design: &Design, physical: &Physical) -> Vec<(&'static str, LimitCheck)> {
    let checks = ArrayProblem::evaluated(design, Some(physical), limits::check).unwrap_or_default();
    let of_shapes = limits::of_shapes(&design.limits);
    of_shapes
        .filter_map(|row| Some((row.key, *checks.get(row.key)?)))
        .collect()
}

/// The ends of the search's ranges that `best` misses.
fn missed_ranges(best: &Candidate) -> impl Iterator<Item = (&'static str, LimitCheck)> {
    let bounds = best.bounds.iter();
    let missed = bounds.filter(|bound| bound.ends_range() && !bound.is_met());
    missed.map(|bound| {
        let check = LimitCheck {
            value: bound.value,
            limit: bound.limit,
            met: false,
        };
        (bound.key, check)
    })
}

/// The gains that were larger than all before them, of arrays that meet every limit.
fn history(found: &Found<'_>) -> Vec<Improvement> {
    let mut grown: Vec<Improvement> = Vec::new();
    for (index, sample) in found.search.samples().iter().enumerate() {
        let judged = found.problem.judged_sample(sample);
        let Some(judged) = judged.filter(|judged| judged.excess() <= MET) else {
            continue;
        };
        let gain = judged.objective().exp();
        if grown.last().is_none_or(|last| gain > last.gain) {
            let evaluations = index + 1;
            grown.push(Improvement { evaluations, gain });
        }
    }
    grown
}

/// Warns where lambda_saturation of the best design is far past what it renders: it is the last breakpoint, which lies as
/// far as one likes where coils nearly tie.
fn past_rendering(
    found: &Found<'_>,
    shapes: &[ShapeSource],
    physics: &ArrayPhysics<'_>,
) -> Result<Vec<String>, RunError> {
    let space = &found.problem.space;
    let (design, raised_m) = (space.design(&found.best.x), space.raised_m(&found.best.x));
    let mut warnings = Vec::new();
    for (shape, lambda_n_per_m) in shapes.iter().zip(&found.best.physical.merits) {
        let aim = Aim {
            constant: Constant::ERROR,
            at_n_per_m: Some(*lambda_n_per_m),
            ..physics.aim()
        };
        let alone = std::slice::from_ref(shape);
        let errors =
            ArrayPhysics::new(alone, aim, physics.tolerance(Level::Full, &design), &Silent)?;
        let Some(rendered) = errors.rendered(&design, raised_m, Level::Full)? else {
            continue;
        };
        let error = rendered.merits[0].recip();
        if error > MOSTLY_MISSING {
            warnings.push(format!(
                "lambda_saturation of {} is {lambda_n_per_m:.3e} N/m, where the force is {:.0} % off what is \
                 requested: it is the last force constant at which a current changes, however little of the force is \
                 left; --constant jnd makes large what is rendered",
                shape.document.name,
                100.0 * error
            ));
        }
    }
    Ok(warnings)
}

/// One number of the shapes' ratios.
fn together(ratios: &[f64], shares: Option<&[f64]>) -> f64 {
    match shares {
        None => ratios.iter().copied().fold(f64::INFINITY, f64::min),
        Some(shares) => {
            let sum: f64 = ratios.iter().zip(shares).map(|(r, s)| s * r.ln()).sum();
            (sum / shares.iter().sum::<f64>()).exp()
        }
    }
}

/// How far force constants at the level of the search are from full accuracy, and their ratios.
fn levels(
    physics: &ArrayPhysics,
    design: &Design,
    (before, found): (&Before, &Found<'_>),
) -> Result<Vec<LevelSummary>, RunError> {
    let best = &found.best;
    let tolerance = |level| -> Result<f64, RunError> {
        let requested = physics.tolerance(level, design);
        Ok(Scene::with_tolerance(design, requested)?.tolerances.forces)
    };
    let mut levels = vec![LevelSummary {
        level: "full",
        tolerance: tolerance(Level::Full)?,
        points: physics.count(Level::Full),
        lambda_error: 0.0,
        gain_error: 0.0,
    }];
    let made = &found.problem.space;
    let coarse = match best.level {
        // After an interruption nothing more is computed.
        Level::Full if !found.interrupted => {
            physics.compute(&made.design(&best.x), made.raised_m(&best.x), Level::Search)?
        }
        Level::Full | Level::Search => None,
    };
    if let Some(coarse) = coarse {
        let (given, now) = (
            ratios(&before.search, &before.full),
            ratios(&coarse, &best.physical),
        );
        let most = |values: Vec<f64>| {
            values
                .iter()
                .fold(0.0_f64, |most, r| most.max((r - 1.0).abs()))
        };
        levels.insert(
            0,
            LevelSummary {
                level: "search",
                tolerance: tolerance(Level::Search)?,
                points: physics.count(Level::Search),
                gain_error: most(now.iter().zip(&given).map(|(a, b)| a / b).collect()),
                lambda_error: most(now.into_iter().chain(given).collect()),
            },
        );
    }
    Ok(levels)
}

/// The best array as a document, and what is read of it.
fn written(document: &Document<'_>, found: &Found<'_>) -> Result<(String, Design), RunError> {
    let (set, remove) = found.problem.space.settings(&found.best.x);
    let mut template = Template::new(document.text, document.path)
        .map_err(|error| RunError::Input(error.to_string()))?;
    remove.into_iter().for_each(|key| template.remove(key));
    let name = toml::Value::String(derived_name(&document.design.name, "_array"));
    let settings = std::iter::once(("name", name)).chain(set);
    let text = template.with(settings).map_err(RunError::Input)?;
    let (design, _) =
        Design::from_toml(&text, document.path, Need::EVALUATE).map_err(|refused| {
            RunError::Input(format!(
                "the best array makes no design of its own: {refused}"
            ))
        })?;
    Ok((text, design))
}
