//! Which parameter would explain what a scan and a design differ by.
//!
//! Each is changed a little, alone, and the share of the residuals' squares that its direction takes
//! away is told, linearised at the design as it stands. Parameters whose directions are parallel
//! cannot be told apart by this scan and are named together.

use super::fit::{Fitted, parameters};
use super::model::{Model, Pose};
use super::{Weighted, fit};
use crate::bundle::scan::{Explanation, Scan};
use crate::design::{Design, Steel};
use crate::job::scene::Scene;
use crate::job::{JobError, KERNEL_ERROR, steel};
use crate::numerics::least_squares::{self, norm};
use crate::progress::Progress;

/// Relative steps of the design's lengths: in air, and with steel, whose solution is rougher.
const STEP: f64 = 1e-3;
const STEP_STEEL: f64 = 1e-2;
/// Directions with a larger cosine cannot be told apart.
const PARALLEL: f64 = 0.99;
/// An explanation must take this many times more, a parameter, than noise would.
const WORTH: f64 = 12.0;
/// And at least this share.
const WORTH_SHARE: f64 = 0.02;

/// A candidate with the weighted direction of each of its free numbers.
struct Candidate {
    name: &'static str,
    columns: Vec<Vec<f64>>,
    /// The key's change for one step of the column, where one number is free.
    unit: Option<f64>,
}

/// Everything that is tried, the most telling first, and the best for its number of parameters.
///
/// # Errors
/// Interruption; a scan on a winding's edge or the steel.
pub(super) fn explain(
    design: &Design,
    model: &Model,
    scan: &Scan,
    residuals: &Weighted,
    tolerance: Option<f64>,
    progress: &dyn Progress,
) -> Result<(Vec<Explanation>, Option<String>), JobError> {
    let candidates = candidates(design, model, scan, residuals, tolerance, progress)?;
    let total: f64 = residuals.values.iter().map(|r| r * r).sum();
    let parallel = |a: &Candidate, b: &Candidate| {
        let ([a], [b]) = (&a.columns[..], &b.columns[..]) else {
            return false;
        };
        let dot: f64 = a.iter().zip(b).map(|(a, b)| a * b).sum();
        dot.abs() > PARALLEL * norm(a) * norm(b) && dot != 0.0
    };
    let mut list = Vec::new();
    for candidate in &candidates {
        let solution = least_squares::solve(&candidate.columns, &residuals.values);
        if solution.rank == 0 {
            continue;
        }
        let share = if total > 0.0 {
            (solution.removed / total).min(1.0)
        } else {
            0.0
        };
        let freedom = residuals.values.len().saturating_sub(solution.rank).max(1);
        let noise = (total * (1.0 - share) / freedom as f64).sqrt();
        let alike = candidates
            .iter()
            .filter(|other| other.name != candidate.name && parallel(candidate, other));
        list.push(Explanation {
            parameter: candidate.name.to_owned(),
            share,
            parameters: solution.rank,
            change: candidate.unit.map(|unit| unit * solution.values[0]),
            standard_error: candidate.unit.and_then(|unit| {
                let error = solution.unit_errors[0]?;
                Some(unit.abs() * error * noise)
            }),
            alike: alike.map(|other| other.name.to_owned()).collect(),
        });
    }
    let count = residuals.values.len() as f64;
    // Bayes' criterion: more numbers must explain more. Of equals the first.
    let cost = |e: &Explanation| {
        let left = (1.0 - e.share).max(1e-12);
        count * left.ln() + e.parameters as f64 * count.ln()
    };
    let worth = |e: &&Explanation| {
        let (free, left) = (e.parameters as f64, (1.0 - e.share).max(1e-12));
        let ratio = e.share / free / (left / (count - free).max(1.0));
        ratio > WORTH && e.share > WORTH_SHARE
    };
    let best = list
        .iter()
        .filter(worth)
        .fold(None::<&Explanation>, |best, e| match best {
            Some(b) if cost(b) <= cost(e) + 1e-3 * count => Some(b),
            _ => Some(e),
        });
    let best = best.map(|e| e.parameter.clone());
    list.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok((list, best))
}

fn candidates(
    design: &Design,
    model: &Model,
    scan: &Scan,
    residuals: &Weighted,
    tolerance: Option<f64>,
    progress: &dyn Progress,
) -> Result<Vec<Candidate>, JobError> {
    let weighted = |values: Vec<f64>| residuals.weighted(values);
    let computed = &residuals.predicted;
    let mut list = vec![Candidate {
        name: "scale",
        columns: vec![weighted(computed.clone())],
        unit: Some(1.0),
    }];
    let coils = design.array.positions_m.len();
    let all = Fitted {
        scale: true,
        background: true,
        position: true,
        rotation: true,
    };
    let parameters = parameters(all, scan, coils);
    let steps = vec![1.0; parameters.len()];
    let columns = fit::columns(
        model,
        scan,
        &parameters,
        &steps,
        &residuals.weights,
        progress,
    )?;
    let of = |wanted: &dyn Fn(&fit::Parameter) -> bool| -> Vec<Vec<f64>> {
        let pairs = parameters.iter().zip(&columns);
        let chosen = pairs.filter(|(parameter, _)| wanted(parameter));
        chosen.map(|(_, column)| column.clone()).collect()
    };
    let scales = of(&|p| matches!(p, fit::Parameter::Scale(_)));
    if scales.len() > 1 {
        list.push(group("scale of each coil", scales));
    }
    let background = of(&|p| matches!(p, fit::Parameter::Background(_)));
    if !background.is_empty() {
        list.push(group("background", background));
    }
    list.push(Candidate {
        name: "height",
        columns: of(&|p| *p == fit::Parameter::Shift(2)),
        unit: Some(1.0),
    });
    list.push(group(
        "position",
        of(&|p| matches!(p, fit::Parameter::Shift(_))),
    ));
    list.push(group(
        "rotation",
        of(&|p| matches!(p, fit::Parameter::Angle(_))),
    ));
    // The field is proportional to the turns, with linear steel too.
    let turns = Scene::new(design)?.circuit.turns;
    list.push(Candidate {
        name: "coil.turns",
        columns: vec![weighted(computed.clone())],
        unit: Some(turns),
    });
    for (name, size, changed) in changes(design, turns) {
        let step = if design.core.is_some() {
            STEP_STEEL
        } else {
            STEP
        };
        let sides = [1.0 + step, 1.0 - step]
            .map(|factor| computed_for(&changed(factor), scan, tolerance, progress));
        match sides {
            [Ok(up), Ok(down)] => {
                let slope = up.iter().zip(&down).map(|(u, d)| (u - d) / (2.0 * step));
                list.push(Candidate {
                    name,
                    columns: vec![weighted(slope.collect())],
                    unit: Some(size),
                });
            }
            [Err(JobError::Interrupted(stop)), _] | [_, Err(JobError::Interrupted(stop))] => {
                return Err(stop.into());
            }
            // A changed coil may not be possible: then it is no explanation.
            _ => {}
        }
    }
    Ok(list)
}

fn group(name: &'static str, columns: Vec<Vec<f64>>) -> Candidate {
    Candidate {
        name,
        columns,
        unit: None,
    }
}

type Change<'a> = Box<dyn Fn(f64) -> Design + 'a>;

/// The design's numbers that are tried: the key, its value in the key's unit, and the design with
/// the value multiplied.
fn changes(design: &Design, turns: f64) -> Vec<(&'static str, f64, Change<'_>)> {
    let Some(coil) = design.coil else {
        return Vec::new();
    };
    // More space does not mean more turns here.
    let with = move |change: &dyn Fn(&mut crate::design::Coil)| {
        let mut changed = design.clone();
        if let Some(coil) = &mut changed.coil {
            coil.turns = Some(turns);
            change(coil);
        }
        changed
    };
    let mut list: Vec<(&'static str, f64, Change<'_>)> = vec![
        (
            "coil.inner_diameter_mm",
            coil.inner_diameter_m * 1e3,
            Box::new(move |factor| with(&|coil| coil.inner_diameter_m *= factor)),
        ),
        (
            "coil.outer_diameter_mm",
            coil.outer_diameter_m * 1e3,
            Box::new(move |factor| with(&|coil| coil.outer_diameter_m *= factor)),
        ),
        (
            "coil.length_mm",
            coil.length_m * 1e3,
            Box::new(move |factor| with(&|coil| coil.length_m *= factor)),
        ),
    ];
    if let Some(mu_r) = design.core.as_ref().and_then(|core| match core.steel {
        Steel::Linear(mu_r) => Some(mu_r),
        Steel::Curve(_) => None,
    }) {
        let changed = move |factor| {
            let mut changed = design.clone();
            if let Some(core) = &mut changed.core {
                core.steel = Steel::Linear(mu_r * factor);
            }
            changed
        };
        list.push(("core.relative_permeability", mu_r, Box::new(changed)));
    }
    if let Some(grid) = design
        .array
        .grid
        .filter(|grid| grid.rows * grid.columns > 1)
    {
        let changed = move |factor: f64| {
            let mut changed = design.clone();
            let positions = changed.array.positions_m.iter_mut().flatten();
            positions.for_each(|x| *x *= factor);
            changed
        };
        list.push(("array.pitch_mm", grid.pitch_m * 1e3, Box::new(changed)));
    }
    list
}

/// What another design gives for the scan, [row, quantity].
fn computed_for(
    design: &Design,
    scan: &Scan,
    tolerance: Option<f64>,
    progress: &dyn Progress,
) -> Result<Vec<f64>, JobError> {
    let scene = Scene::new(design)?;
    let lowest_m = super::lowest_m(scan);
    let solved = steel::solve(&scene, tolerance, KERNEL_ERROR, lowest_m)?;
    let model = Model::new(&scene, &solved, scan);
    let places = model.places(Pose::default())?;
    let contributions = model.contributions(&places, Pose::default(), progress)?;
    Ok(model.sum(&contributions, |_| 1.0))
}
