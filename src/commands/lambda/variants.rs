//! The effect of an offset, currents of both signs, pairs in series and broken coils on lambda.

use rayon::prelude::*;

use std::slice::from_ref;

use super::PosedProblem;
use crate::RunError;
use crate::bundle::lambda_file::LambdaVariant;
use crate::lambda::worst::worst_point;
use crate::lambda::{self, ForceProblem, Settings, Status, Wiring};

/// Two coils opposite each other within this part of their distance are a pair.
const OPPOSITE: f64 = 1e-6;

/// Smaller relative changes are rounding.
const NO_CHANGE: f64 = 1e-11;

/// One change of the object.
struct Change {
    name: String,
    wiring: Wiring,
    /// The force without currents counts.
    offset: bool,
    /// Coils push and pull alike.
    pulls: bool,
}

impl Change {
    /// The same under another name.
    fn renamed(&self, name: String) -> Self {
        Self {
            name,
            wiring: self.wiring.clone(),
            ..*self
        }
    }
}

/// Pairs of coils opposite each other through the array's centre.
fn opposite_pairs(positions_m: &[[f64; 2]]) -> Vec<[usize; 2]> {
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

/// The problem as given, then with one change at a time. `passive_n` is the force without
/// currents, whether or not the problem has it.
pub(super) fn all(
    posed: &PosedProblem,
    passive_n: Option<&[f64]>,
) -> Result<Vec<LambdaVariant>, RunError> {
    let unwired = &posed.unwired;
    let (settings, wiring) = (&posed.options.settings, &posed.options.wiring);
    let voltage_v = posed.scene.design.supply.voltage_v;
    let limits_a = unwired.lower_a.iter().zip(unwired.upper_a);
    let both_a: Vec<f64> = limits_a.map(|(lower, upper)| upper.max(-lower)).collect();
    let reversed_a: Vec<f64> = both_a.iter().map(|most| -most).collect();
    let solve = |change: &Change, base: Option<f64>| {
        let problem = ForceProblem {
            offset_n: passive_n.filter(|_| change.offset),
            lower_a: if change.pulls {
                &reversed_a
            } else {
                unwired.lower_a
            },
            upper_a: if change.pulls {
                &both_a
            } else {
                unwired.upper_a
            },
            ..*unwired
        };
        solved(&problem, (settings, voltage_v), change, base)
    };
    let as_given = Change {
        name: "as given".to_owned(),
        wiring: wiring.clone(),
        offset: unwired.offset_n.is_some(),
        pulls: false,
    };
    let first = solve(&as_given, None)?;
    let base = first.lambda_n_per_m;
    let mut variants = vec![LambdaVariant {
        relative_change: base.filter(|&l| l > 0.0).map(|_| 0.0),
        ..first
    }];
    let mut changes = supply_and_series(posed, passive_n.is_some(), &as_given);
    let broken = |coils: &[usize], name: String| {
        let mut change = as_given.renamed(name);
        change.wiring.broken.extend_from_slice(coils);
        change
    };
    let whole = (0..unwired.coils()).filter(|&coil| !is_wired(wiring, coil));
    let whole: Vec<usize> = whole.collect();
    changes.extend(
        whole
            .iter()
            .map(|&coil| broken(&[coil], format!("{coil} broken"))),
    );
    // As many as coils and pairs of them: each runs on a thread of its own.
    let solved: Result<Vec<_>, RunError> = changes
        .par_iter()
        .map(|change| solve(change, base))
        .collect();
    variants.extend(solved?);
    let of_broken = &variants[variants.len() - whole.len()..];
    let hurt = of_broken.iter().zip(&whole);
    let mut hurt: Vec<(f64, usize)> = hurt
        .map(|(variant, &coil)| (variant.lambda_n_per_m.unwrap_or(0.0), coil))
        .collect();
    // The order of equally bad ones is that of the coils.
    hurt.sort_by(|a, b| a.0.total_cmp(&b.0));
    if let [(_, a), (_, b), _, ..] = hurt[..] {
        let (a, b) = (a.min(b), a.max(b));
        let worst_two = broken(&[a, b], format!("{a} and {b} broken"));
        variants.push(solve(&worst_two, base)?);
    }
    Ok(variants)
}

/// Whether a coil is broken or in a pair already.
fn is_wired(wiring: &Wiring, coil: usize) -> bool {
    wiring.broken.contains(&coil) || wiring.series.as_flattened().contains(&coil)
}

/// The changes of offset, currents and pairs in series. `steel_pulls`: there is a force without
/// currents.
fn supply_and_series(posed: &PosedProblem, steel_pulls: bool, as_given: &Change) -> Vec<Change> {
    let unwired = &posed.unwired;
    let mut changes = Vec::new();
    if steel_pulls {
        let offset = !as_given.offset;
        let name = if offset { "with" } else { "without" };
        changes.push(Change {
            offset,
            ..as_given.renamed(format!("{name} passive force"))
        });
    }
    let mut limits = unwired.lower_a.iter().zip(unwired.upper_a);
    if limits.any(|(&l, &u)| l != -u) {
        changes.push(Change {
            pulls: true,
            ..as_given.renamed("push and pull".to_owned())
        });
    }
    let free = |coil| !is_wired(&as_given.wiring, coil);
    let pairs: Vec<[usize; 2]> = opposite_pairs(&posed.scene.design.array.positions_m)
        .into_iter()
        .filter(|&[a, b]| free(a) && free(b))
        .collect();
    let in_series = |pairs: &[[usize; 2]], name: String| {
        let mut change = as_given.renamed(name);
        change.wiring.series.extend_from_slice(pairs);
        change
    };
    for pair in &pairs {
        let name = format!("{}+{} in series", pair[0], pair[1]);
        changes.push(in_series(from_ref(pair), name));
    }
    if pairs.len() > 1 {
        changes.push(in_series(&pairs, "all pairs in series".to_owned()));
    }
    changes
}

fn solved(
    problem: &ForceProblem,
    (settings, voltage_v): (&Settings, Option<f64>),
    change: &Change,
    base: Option<f64>,
) -> Result<LambdaVariant, RunError> {
    let rewired = change.wiring.apply(problem, voltage_v);
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
        wiring: change.wiring.clone(),
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
