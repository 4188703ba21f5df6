//! The summary of `optimize`.

use super::{AlternativeFacts, BestFacts, GivenFacts, LimitFacts, ObjectiveFacts, Optimization};
use crate::accuracy::CertificateKind;
use crate::cli::describe;
use crate::cli::layout::{Sheet, Side, table};
use crate::cli::limits::{label, limit_row, limit_value};
use crate::cli::quantity::{count, error, force, mass, mm, number, number_to, percent, si};
use crate::cli::values::FileArgument;
use crate::coil::limits::by_key;

/// Most alternatives on screen; JSON has more.
const SHOWN: usize = 6;

pub fn summary(result: &Optimization, out: Option<&FileArgument>) -> String {
    let kind = if result.wound {
        "the best coil that can be wound"
    } else {
        "the best coil"
    };
    let mut sheet = Sheet::new(&format!("{}: {kind}", result.design));
    match (&result.coil, &result.objective) {
        (Some(coil), Some(objective)) => found(&mut sheet, result, coil, objective),
        _ => none(&mut sheet, result),
    }
    if let (Some(FileArgument::Path(path)), true) = (out, result.design_text.is_some()) {
        sheet.line("written to", &path.display().to_string());
    }
    if let (Some(coil), Some(objective)) = (&result.coil, &result.objective) {
        sheet.gap();
        sheet.raw(&beside(coil, objective, result.given.as_ref()));
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
    if let Some(none) = &result.no_coil
        && let Some(least) = &none.least
    {
        sheet.line(
            "nearest",
            &format!(
                "{} to {} diameter, {} long breaks the limits least",
                mm(least.inner_diameter_m),
                mm(least.outer_diameter_m),
                mm(least.length_m)
            ),
        );
    }
    sheet.line("searched", &searched(result));
}

fn found(sheet: &mut Sheet, result: &Optimization, coil: &BestFacts, objective: &ObjectiveFacts) {
    let turns = match (coil.layers, coil.turns_per_layer) {
        (Some(layers), Some(turns)) => format!(
            "{} of {turns} turns, {} turns in all",
            count(layers as usize, "layer"),
            number(coil.turns)
        ),
        _ => format!(
            "{} {}",
            number(coil.turns),
            if coil.turns == 1.0 { "turn" } else { "turns" }
        ),
    };
    sheet.line(
        "coil",
        &format!(
            "{} to {} diameter, {} long; {turns} of {} wire",
            mm(coil.size.inner_diameter_m),
            mm(coil.size.outer_diameter_m),
            mm(coil.size.length_m),
            mm(coil.wire_diameter_m)
        ),
    );
    let way = if objective.force_n < 0.0 {
        "down"
    } else {
        "up"
    };
    sheet.line(
        "force",
        &format!(
            "{} {way} on the magnet, {} above the coil at {}, the {} limit{}{}",
            force(objective.force_n.abs()),
            mm(objective.height_m),
            si(objective.current_a, "A"),
            if objective.current_set_by == "supply" {
                "supply's"
            } else {
                "driver's"
            },
            objective.alone_force_n.map_or_else(String::new, |alone| {
                format!(
                    "\namong its neighbours' cores; {} alone, as in the table below",
                    force(alone.abs())
                )
            }),
            objective.passive_force_n.map_or_else(String::new, |pull| {
                format!("\nbesides, the unpowered steel pulls with {}", force(pull))
            })
        ),
    );
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
    let held: Vec<String> = result
        .limits
        .iter()
        .chain(&result.bounds)
        .filter(|(_, used)| used.active && used.sensitivity_n_per_unit != 0.0)
        .map(|(name, used)| sensitivity(name, used))
        .collect();
    if !held.is_empty() {
        sheet.line("worth", &held.join("\n"));
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
        let told: Vec<String> = result
            .wires
            .iter()
            .map(|wire| {
                let best = wire.force_n.map_or_else(|| "no coil".to_owned(), force);
                format!("{}: {best}", mm(wire.wire_diameter_m))
            })
            .collect();
        sheet.line("wires", &told.join("\n"));
    }
    sheet.line("searched", &searched(result));
    let stages = result.accuracy.iter().map(|(name, stage)| (*name, stage));
    sheet.line("accuracy", &describe::accuracy(stages));
}

fn searched(result: &Optimization) -> String {
    format!(
        "{} local searches with seed {}, {} coils evaluated, {} ranges of coils bounded",
        result.starts, result.seed, result.evaluations, result.certificate.cells
    )
}

fn certificate(result: &Optimization, objective: &ObjectiveFacts) -> String {
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
                "{}{separator} no coil within the limits gives more than {}, {gap} above",
                kind.scope(),
                above(bound)
            )
        }
        None => format!("{}; {}", kind.scope(), kind.open_question()),
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

/// What the design's own coil misses.
fn misses(given: &GivenFacts) -> Option<String> {
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

/// `1 ohm more gives 12 mN`.
fn sensitivity(name: &str, used: &LimitFacts) -> String {
    let (unit, per_si) = by_key(name).map_or(("mm", 1e3), |limit| limit.step);
    let size = 1.0 / per_si;
    // A unit that is not small against the limit is no slope.
    let scale = if size > 0.3 * used.limit { 1e-3 } else { 1.0 };
    let gain = used.sensitivity_n_per_unit * size * scale;
    let way = if gain < 0.0 { "less" } else { "more" };
    format!(
        "{} {unit} {way} {} gives {}",
        number(scale),
        match name {
            "wire_length_m" => "allowed".to_owned(),
            name => format!("of {}", label(name)),
        },
        force(gain.abs())
    )
}

fn beside(coil: &BestFacts, objective: &ObjectiveFacts, given: Option<&GivenFacts>) -> String {
    let ours = &coil.circuit;
    let mut rows = vec![vec![String::new(), "best".to_owned()]];
    let lines = [
        (
            "force",
            force(objective.alone_force_n.unwrap_or(objective.force_n)),
        ),
        ("inner diameter", mm(coil.size.inner_diameter_m)),
        ("outer diameter", mm(coil.size.outer_diameter_m)),
        ("length", mm(coil.size.length_m)),
        ("turns", number(coil.turns)),
        ("resistance", si(ours.resistance_ohm, "ohm")),
        ("inductance", si(ours.inductance_h, "H")),
        ("settling", si(ours.settling_s, "s")),
        ("wire", si(ours.wire_length_m, "m")),
        ("mass", mass(ours.mass_kg)),
        ("heat", si(ours.power_w, "W")),
    ];
    for (name, value) in lines {
        rows.push(vec![name.to_owned(), value]);
    }
    if let Some(given) = given {
        let theirs = &given.circuit;
        let values = [
            "as given".to_owned(),
            force(given.force_n),
            mm(given.size.inner_diameter_m),
            mm(given.size.outer_diameter_m),
            mm(given.size.length_m),
            number(given.turns),
            si(theirs.resistance_ohm, "ohm"),
            si(theirs.inductance_h, "H"),
            si(theirs.settling_s, "s"),
            si(theirs.wire_length_m, "m"),
            mass(theirs.mass_kg),
            si(theirs.power_w, "W"),
        ];
        for (row, value) in rows.iter_mut().zip(values) {
            row.push(value);
        }
    }
    table(&[Side::Left, Side::Right, Side::Right], &rows)
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
    table(&[Side::Left, Side::Right, Side::Right, Side::Left], &rows)
}

fn alternatives(list: &[AlternativeFacts]) -> String {
    let head = [
        "instead",
        "force",
        "bore",
        "outer",
        "length",
        "turns",
        "wire mass",
        "heat",
        "",
    ]
    .map(str::to_owned);
    let mut rows = vec![head.to_vec()];
    for other in shown(list) {
        let turns = match (other.layers, other.turns_per_layer) {
            (Some(layers), Some(turns)) => format!("{layers} x {turns}"),
            _ => number(other.turns),
        };
        rows.push(vec![
            mm(other.wire_diameter_m),
            force(other.force_n),
            mm(other.size.inner_diameter_m),
            mm(other.size.outer_diameter_m),
            mm(other.size.length_m),
            turns,
            mass(other.wire_mass_kg),
            si(other.power_w, "W"),
            other.better.join(", "),
        ]);
    }
    let mut sides = [Side::Right; 9];
    sides[0] = Side::Left;
    sides[8] = Side::Left;
    table(&sides, &rows)
}

/// The first, the last, and those evenly between.
fn shown(list: &[AlternativeFacts]) -> impl Iterator<Item = &AlternativeFacts> {
    let told = list.len().min(SHOWN);
    (0..told).map(move |k| &list[k * (list.len() - 1) / (told - 1).max(1)])
}
