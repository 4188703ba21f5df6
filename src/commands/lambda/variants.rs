//! What an offset, currents of both signs, pairs in series and broken coils do to lambda.

use std::slice::from_ref;

use crate::RunError;
use crate::bundle::lambda_file::{LambdaFile, LambdaVariant, TolerancePoint, WiringFile};
use crate::lambda::worst::{felt, worst_point};
use crate::lambda::{self, ForceProblem, Settings, Status, Wiring};
use crate::units::DETECTION_THRESHOLD_N;

/// Two coils opposite each other within this part of their distance are a pair.
const OPPOSITE: f64 = 1e-6;

/// Smaller relative changes are rounding.
const NO_CHANGE: f64 = 1e-11;

/// One change to be tried.
struct Change {
    name: String,
    wiring: Wiring,
    /// The force without currents counts.
    offset: bool,
    /// Coils push and pull alike.
    pulls: bool,
}

/// Pairs of coils opposite each other through the array's centre.
pub(super) fn opposite_pairs(positions_m: &[[f64; 2]]) -> Vec<[usize; 2]> {
    let count = positions_m.len() as f64;
    let centre = [0, 1].map(|k| positions_m.iter().map(|p| p[k]).sum::<f64>() / count);
    let mut pairs = Vec::new();
    for (a, p) in positions_m.iter().enumerate() {
        for (b, q) in positions_m.iter().enumerate().skip(a + 1) {
            let apart = (p[0] - q[0]).hypot(p[1] - q[1]);
            let off = (p[0] + q[0] - 2.0 * centre[0]).hypot(p[1] + q[1] - 2.0 * centre[1]);
            if apart > 0.0 && off <= OPPOSITE * apart {
                pairs.push([a, b]);
            }
        }
    }
    pairs
}

/// Solves the problem as given, then with one change at a time. `offset_n` is the force without
/// currents, whether or not `given` has it; `pairs` are those to be wired in series.
pub(super) fn all(
    given: &ForceProblem,
    offset_n: Option<&[f64]>,
    settings: &Settings,
    wiring: &Wiring,
    pairs: &[[usize; 2]],
) -> Result<Vec<LambdaVariant>, RunError> {
    let plain = |name: String, wiring: Wiring| Change {
        name,
        wiring,
        offset: given.offset_n.is_some(),
        pulls: false,
    };
    let tried = |change: &Change, base: Option<f64>| {
        let lower_a: Vec<f64> = given.upper_a.iter().map(|u| -u).collect();
        let problem = ForceProblem {
            offset_n: offset_n.filter(|_| change.offset),
            lower_a: if change.pulls {
                &lower_a
            } else {
                given.lower_a
            },
            ..*given
        };
        solved(&problem, settings, change, base)
    };
    let given_so = tried(&plain("as given".to_owned(), wiring.clone()), None)?;
    let base = given_so.lambda_n_per_m;
    let mut variants = vec![LambdaVariant {
        relative_change: base.filter(|&l| l > 0.0).map(|_| 0.0),
        ..given_so
    }];
    let mut changes = Vec::new();
    if offset_n.is_some() {
        let offset = given.offset_n.is_none();
        let name = if offset { "with" } else { "without" };
        changes.push(Change {
            offset,
            ..plain(format!("{name} passive force"), wiring.clone())
        });
    }
    if given
        .lower_a
        .iter()
        .zip(given.upper_a)
        .any(|(&l, &u)| l != -u)
    {
        changes.push(Change {
            pulls: true,
            ..plain("push and pull".to_owned(), wiring.clone())
        });
    }
    let busy =
        |coil: usize| wiring.broken.contains(&coil) || wiring.series.as_flattened().contains(&coil);
    let free: Vec<[usize; 2]> = pairs
        .iter()
        .copied()
        .filter(|&[a, b]| !busy(a) && !busy(b))
        .collect();
    let in_series = |more: &[[usize; 2]]| {
        let mut changed = wiring.clone();
        changed.series.extend_from_slice(more);
        changed
    };
    for pair in &free {
        let name = format!("{}+{} in series", pair[0], pair[1]);
        changes.push(plain(name, in_series(from_ref(pair))));
    }
    if free.len() > 1 {
        changes.push(plain("all pairs in series".to_owned(), in_series(&free)));
    }
    for change in &changes {
        variants.push(tried(change, base)?);
    }
    let without = |coils: &[usize]| {
        let mut changed = wiring.clone();
        changed.broken.extend_from_slice(coils);
        changed
    };
    let mut hurt: Vec<(f64, usize)> = Vec::new();
    for coil in (0..given.coils()).filter(|&coil| !busy(coil)) {
        let name = format!("{coil} broken");
        let variant = tried(&plain(name, without(&[coil])), base)?;
        hurt.push((variant.lambda_n_per_m.unwrap_or(0.0), coil));
        variants.push(variant);
    }
    // The order of equally bad ones is that of the coils.
    hurt.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let [(_, a), (_, b), _, ..] = hurt[..] {
        let (a, b) = (a.min(b), a.max(b));
        let name = format!("{a} and {b} broken");
        variants.push(tried(&plain(name, without(&[a, b])), base)?);
    }
    Ok(variants)
}

fn solved(
    problem: &ForceProblem,
    settings: &Settings,
    change: &Change,
    base: Option<f64>,
) -> Result<LambdaVariant, RunError> {
    let rewired = change.wiring.apply(problem);
    let wired = rewired.problem(problem);
    let solution = lambda::solve(&wired, settings)?;
    let worst = worst_point(&wired, settings)?;
    let chosen = solution.chosen.as_ref();
    let currents_a = chosen.map(|chosen| {
        let mut currents = chosen.currents_a.clone();
        change.wiring.spread(&mut currents);
        currents
    });
    let power = |currents: &Vec<f64>| -> f64 {
        let pairs = currents.iter().zip(problem.resistance_ohm);
        pairs.map(|(i, ohm)| i * i * ohm).sum()
    };
    let lambda = chosen.map(|chosen| chosen.lambda_n_per_m);
    Ok(LambdaVariant {
        name: change.name.clone(),
        broken: change.wiring.broken.clone(),
        series: change.wiring.series.clone(),
        passive_force: change.offset,
        pulls: wired.lower_a.iter().any(|&lower| lower < 0.0),
        constants: solution.constants,
        worst_point_lambda_jnd_n_per_m: worst
            .lambda_jnd_n_per_m
            .filter(|_| worst.complete && solution.status != Status::NothingRendered),
        lambda_n_per_m: lambda,
        relative_change: lambda
            .zip(base)
            .filter(|&(_, base)| base > 0.0)
            .map(|(lambda, base)| lambda / base - 1.0)
            .map(|change| {
                if change.abs() < NO_CHANGE {
                    0.0
                } else {
                    change
                }
            }),
        rms_error_n: chosen.map(|chosen| chosen.rms_error_n),
        relative_rms_error: chosen.and_then(|chosen| chosen.relative_rms_error),
        worst_error_n: chosen.map(|chosen| chosen.worst_error_n),
        power_w: currents_a.as_ref().map(power),
        currents_a,
    })
}

/// The largest force constant whose errors are not felt at any point.
pub(super) fn tolerance(
    problem: &ForceProblem,
    share: f64,
    wiring: &Wiring,
) -> Result<TolerancePoint, RunError> {
    let found = felt(problem, share, DETECTION_THRESHOLD_N)?;
    let found = found.map(|mut found| {
        wiring.spread(&mut found.currents_a);
        found
    });
    let found = found.as_ref();
    Ok(TolerancePoint {
        lambda_n_per_m: found.map(|found| found.lambda_n_per_m),
        share,
        threshold_n: DETECTION_THRESHOLD_N,
        point: found.map(|found| found.point),
        part: found.map(|found| found.part),
        currents_a: found.map(|found| found.currents_a.clone()),
    })
}

/// Tells the wiring, and gives both coils of a pair their current wherever currents are told.
pub(super) fn tell_wiring(file: &mut LambdaFile, wiring: &Wiring) {
    if wiring.is_plain() {
        return;
    }
    let spread = |currents: &mut Vec<f64>| wiring.spread(currents);
    file.currents_a.iter_mut().for_each(spread);
    for step in &mut file.path {
        wiring.spread(&mut step.currents_a);
    }
    if let Some(at) = &mut file.at {
        wiring.spread(&mut at.currents_a);
        if let Some(worst) = &mut at.worst_point {
            wiring.spread(&mut worst.currents_a);
        }
    }
    if let Some(worst) = &mut file.worst_point {
        worst.currents_a.iter_mut().for_each(spread);
        for step in &mut worst.path {
            wiring.spread(&mut step.currents_a);
        }
    }
    file.wiring = Some(WiringFile {
        broken: wiring.broken.clone(),
        series: wiring.series.clone(),
    });
}
