//! The summary of `optimize`.

use super::compared::{ComparedCoil, PROPERTIES, beside_the_force, name};
use super::{BestCoilSummary, GivenCoil, Objective, Optimization};
use crate::accuracy::CertificateKind;
use crate::cli::describe;
use crate::cli::layout::{Sheet, table};
use crate::cli::limits::{limit_row, limit_value};
use crate::cli::quantity::{count, error, force, mass, mm, number, number_to, percent, si, si_to};
use crate::coil::limits::{LimitName, MANDREL_M, WIRES_A_MANDREL};
use crate::coil::optimum::outcome::Alternative;
use crate::coil::optimum::problem::Regime;
use crate::coil::optimum::{LimitUse, WholeTurns};
use crate::report::limits::label;

/// Most alternatives on screen; JSON has more.
const SHOWN: usize = 6;

pub fn summary(result: &Optimization) -> String {
    let kind = if result.wound {
        "the best coil that can be wound"
    } else {
        "the best coil"
    };
    let mut sheet = Sheet::new(&format!("{}: {kind}", result.design));
    match (&result.coil, &result.objective) {
        (Some(coil), Some(objective)) => best(&mut sheet, result, coil, objective),
        _ => none(&mut sheet, result),
    }
    if let Some((best, given)) = result.compared() {
        sheet.gap();
        sheet.raw(&beside(&best, given.as_ref()));
        if !result.limits.is_empty() {
            sheet.gap();
            sheet.raw(&limits(result));
        }
        if !result.alternatives.is_empty() {
            sheet.gap();
            sheet.raw(&alternatives(&result.alternatives));
        }
    }
    sheet.finish()
}

fn none(sheet: &mut Sheet, result: &Optimization) {
    sheet.line("result", "there is no such coil");
    if let Some(nearest) = nearest(result) {
        sheet.line("nearest", &nearest);
    }
    sheet.line("searched", &searched(result));
}

/// The coil that misses the limits least, where there is none within them.
pub(super) fn nearest(result: &Optimization) -> Option<String> {
    let least = result.no_coil.as_ref()?.least.as_ref()?;
    let of = match result.continuous_force_n {
        Some(_) => " of the whole coils next to the best one of any turns",
        None => "",
    };
    Some(format!(
        "{} to {} diameter, {} long breaks the limits least{of}",
        mm(least.inner_diameter_m),
        mm(least.outer_diameter_m),
        mm(least.length_m)
    ))
}

fn best(sheet: &mut Sheet, result: &Optimization, coil: &BestCoilSummary, objective: &Objective) {
    sheet.line("coil", &dimensions(coil));
    sheet.line("force", &force_at_target(objective));
    if let Some(misses) = result.given.as_ref().and_then(misses) {
        sheet.line("as given", &misses);
    }
    sheet.line("certificate", &certificate(result, objective));
    if let Some(continuous) = result.continuous_force_n {
        let lost = 1.0 - objective.force_n.abs() / continuous;
        sheet.line(
            "whole turns",
            &format!("cost {} of the force", percent(lost.max(0.0))),
        );
    }
    // A dimension that is given cannot move to its limit.
    let movable = result.limits.iter().chain(&result.bounds);
    let (worth, shared): (Vec<&LimitUse>, Vec<&LimitUse>) = movable
        .filter(|(key, used)| used.holds_back() && !result.fixed.contains_key(*key))
        .map(|(_, used)| used)
        .filter(|used| !used.name.is_least_size())
        .partition(|used| used.sensitivity_n_per_unit != 0.0);
    let mut held: Vec<String> = worth.into_iter().map(sensitivity).collect();
    if shared.len() > 1 {
        let labels: Vec<&str> = shared.iter().map(|used| used.name.limit().label).collect();
        held.push(format!(
            "{}: one alone gives nothing more",
            labels.join(", ")
        ));
    }
    if !held.is_empty() {
        held.extend(before_whole(result));
        sheet.line("worth", &held.join("\n"));
    }
    if let Some(bore_m) = result.bobbin_bore_m {
        sheet.line(
            "bobbin",
            &format!(
                "a coil that is wound has a bore of {} at least: {WIRES_A_MANDREL} diameters of its wire, \
                 and no mandrel under {}; limits.inner_diameter_min_mm sets another",
                mm(bore_m),
                mm(MANDREL_M)
            ),
        );
    }
    if let Some(valley) = &result.valley {
        let [low, high] = valley.inner_diameter_m;
        sheet.line(
            "free",
            &format!(
                "the bore, between {} and {}, within {} of the force",
                mm(low),
                mm(high),
                percent(valley.force_share)
            ),
        );
    }
    if result.wires.len() > 1 {
        let wires: Vec<String> = result
            .wires
            .iter()
            .map(|wire| {
                // Of wires that were not chosen no more than three digits are computed.
                let best = wire.force_n.map(|force_n| si_to(force_n, "N", 3));
                let best = best.unwrap_or_else(|| "no coil".to_owned());
                format!("{}: {best}", mm(wire.wire_diameter_m))
            })
            .collect();
        sheet.line("wires", &wires.join("\n"));
    }
    sheet.line("searched", &searched(result));
    let stages = result.accuracy.iter().map(|(name, stage)| (*name, stage));
    sheet.line("accuracy", &describe::accuracy(stages));
}

/// Dimensions, turns and wire.
fn dimensions(coil: &BestCoilSummary) -> String {
    let turns = match coil.whole {
        Some(WholeTurns {
            layers,
            turns_per_layer,
        }) => format!(
            "{} of {turns_per_layer} turns, {} turns in all",
            count(layers as usize, "layer"),
            number(coil.turns)
        ),
        None => {
            let (size, wire_m) = (&coil.size, coil.wire_diameter_m);
            let depth_m = 0.5 * (size.outer_diameter_m - size.inner_diameter_m);
            format!(
                "{} in {} (--wound for whole ones)",
                count(number(coil.turns), "turn"),
                count(number_to(depth_m / wire_m, 3), "layer")
            )
        }
    };
    format!(
        "{} to {} diameter, {} long; {turns} of {} wire",
        mm(coil.size.inner_diameter_m),
        mm(coil.size.outer_diameter_m),
        mm(coil.size.length_m),
        mm(coil.wire_diameter_m)
    )
}

/// The force, and whose current it is.
fn force_at_target(objective: &Objective) -> String {
    let way = if objective.force_n < 0.0 {
        "down"
    } else {
        "up"
    };
    format!(
        "{} {way} on the magnet, {} above the coil at {}, the {} limit{}",
        force(objective.force_n.abs()),
        mm(objective.height_m),
        si(objective.current_a, "A"),
        match objective.current_set_by {
            Regime::Supply => "supply's",
            Regime::Driver => "driver's",
        },
        (beside_the_force(objective).iter()).fold(String::new(), |all, one| all + "\n" + one)
    )
}

fn searched(result: &Optimization) -> String {
    format!(
        "{} local searches with seed {}, {} coils evaluated, {} ranges of coils bounded",
        result.starts, result.seed, result.evaluations, result.certificate.cells
    )
}

fn certificate(result: &Optimization, objective: &Objective) -> String {
    let certificate = &result.certificate;
    let bound = certificate
        .upper_bound_n
        .map(|bound| (bound, bound / objective.force_n.abs() - 1.0));
    let kind = certificate.kind;
    match bound {
        Some((bound, gap)) => {
            let (separator, gap) = match kind {
                CertificateKind::Global => (":", error(gap)),
                CertificateKind::Local
                | CertificateKind::Multistart
                | CertificateKind::Exhaustive => (";", percent(gap)),
            };
            format!(
                "{}{separator} no coil {} gives more than {}, {gap} above",
                kind.scope(),
                result.within(),
                above(bound)
            )
        }
        None => {
            let scope = match result.limits_left_out.as_slice() {
                [] => kind.scope().to_owned(),
                _ => format!("{} {}", kind.scope(), result.within()),
            };
            format!("{scope}; {}", kind.open_question())
        }
    }
}

/// A bound, its last digit rounded up.
fn above(bound_n: f64) -> String {
    let exponent = bound_n.log10().floor();
    let unit = 10f64.powf(exponent - 5.0);
    let up = (bound_n / unit * (1.0 - 1e-12)).ceil() * unit;
    if up < 1.0 {
        format!("{} mN", number_to(up * 1e3, 6))
    } else {
        format!("{} N", number_to(up, 6))
    }
}

/// The limits that the design's own coil misses.
pub(super) fn misses(given: &GivenCoil) -> Option<String> {
    let unmet: Vec<String> = given
        .limits
        .iter()
        .filter(|(_, check)| !check.met)
        .map(|(name, check)| {
            format!(
                "{} {}, allowed {}",
                label(name),
                limit_value(name, check.value),
                limit_value(name, check.limit)
            )
        })
        .collect();
    (!unmet.is_empty()).then(|| format!("the design's own coil misses {}", unmet.join("; ")))
}

/// Whose limits are worth what is stated, where turns are whole: the best coil's without that, perhaps of another wire.
pub(super) fn before_whole(result: &Optimization) -> Option<String> {
    let (before_m, coil) = (result.continuous_wire_diameter_m?, result.coil.as_ref()?);
    let wire = match before_m == coil.wire_diameter_m {
        true => String::new(),
        false => format!(", of {} wire", mm(before_m)),
    };
    Some(format!(
        "of a coil whose turns need not be whole{wire}: whole ones take it in steps"
    ))
}

/// `1 ohm more gives 12 mN`.
fn sensitivity(used: &LimitUse) -> String {
    let row = used.name.limit();
    let (unit, per_si) = row.step;
    let size = 1.0 / per_si;
    // A unit that is not small against the limit is no slope.
    let scale = if size > 0.3 * used.limit { 1e-3 } else { 1.0 };
    let gain = used.sensitivity_n_per_unit * size * scale;
    let way = if gain < 0.0 { "less" } else { "more" };
    format!(
        "{} {unit} {way} {} gives {}",
        number(scale),
        if used.name == LimitName::WireLength {
            "allowed".to_owned()
        } else {
            format!("of {}", row.label)
        },
        force(gain.abs())
    )
}

fn beside(best: &ComparedCoil, given: Option<&ComparedCoil>) -> String {
    let mut rows = vec![vec![String::new(), "best".to_owned()]];
    rows[0].extend(given.map(|_| "as given".to_owned()));
    rows.extend(PROPERTIES.map(|property| {
        let (key, value) = property;
        let cell = |coil| limit_value(key, value(coil));
        let cells = [best].into_iter().chain(given).map(cell);
        std::iter::once(name(property)).chain(cells).collect()
    }));
    table("lrr", &rows)
}

fn limits(result: &Optimization) -> String {
    let head = ["limit", "value", "allowed", ""].map(str::to_owned);
    let mut rows = vec![head.to_vec()];
    for (name, used) in &result.limits {
        let state = match (used.met, used.active) {
            (false, _) => "NOT met",
            (true, true) => "active",
            (true, false) => "met",
        };
        rows.push(limit_row(name, used.value, used.limit, state));
    }
    table("lrrl", &rows)
}

fn alternatives(list: &[Alternative]) -> String {
    let head = [
        "instead", "force", "bore", "outer", "length", "turns", "mass", "heat", "",
    ]
    .map(str::to_owned);
    let mut rows = vec![head.to_vec()];
    for other in shown(list) {
        let turns = match other.whole {
            Some(whole) => format!("{} x {}", whole.layers, whole.turns_per_layer),
            None => number(other.turns),
        };
        rows.push(vec![
            mm(other.wire_diameter_m),
            force(other.force_n),
            mm(other.size.inner_diameter_m),
            mm(other.size.outer_diameter_m),
            mm(other.size.length_m),
            turns,
            mass(other.mass_kg),
            si(other.power_w, "W"),
            better(other),
        ]);
    }
    table("lrrrrrrrl", &rows)
}

/// The first, the last, and those evenly between.
fn shown(list: &[Alternative]) -> impl Iterator<Item = &Alternative> {
    let count = list.len().min(SHOWN);
    (0..count).map(move |k| &list[k * (list.len() - 1) / (count - 1).max(1)])
}

/// In what a coil is better.
pub(super) fn better(other: &Alternative) -> String {
    let words: Vec<&str> = other.better.iter().map(|better| better.name()).collect();
    words.join(", ")
}
