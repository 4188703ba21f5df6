//! Whether the parts of a design fit together; lengths in millimetres, as the user wrote them.
//!
//! Touching is allowed everywhere. A number that was already refused is NaN and passes.

use std::ops::Range;

use super::array::{TOUCHING, overlaps};
use super::diagnostics::Fault;
use super::draft::{Draft, Need};
use super::limits::Prices;
use super::message_text::{number, twelve_digits};
use super::reader::{Located, Sink};
use super::sections::{CoilDraft, CoreDraft, Layout, WireDraft};
use super::values::OneOrMany;
use fluxform_numerics::axis::Axis;

/// Most map values, coils times workspace nodes: 8 GB of doubles.
pub(crate) const MAP_VALUES_MAX: f64 = 1e9;

/// A core longer than this many times the coil's larger size is no plausible one.
const CORE_LENGTH_PLAUSIBLE: f64 = 20.0;

/// Adds every physical fault of `draft` to `sink`.
pub(super) fn check(draft: &Draft, need: Need, sink: &Sink) {
    wire(&draft.wire, sink);
    if let Some(coil) = &draft.coil {
        winding(coil, &draft.wire, sink);
    }
    if let Some(core) = &draft.core {
        core_fits(core, draft.coil.as_ref(), sink);
    }
    prices(draft, sink);
    array_overlap(draft, need, sink);
    lists(draft, sink);
    target(draft, need, sink);
    workspace(draft, need, sink);
}

/// A limit on a cost that nothing adds to would always be met.
fn prices(draft: &Draft, sink: &Sink) {
    if draft.limits.array_cost_max.is_some() && draft.prices == Prices::default() {
        let fault = Fault::error("limits.array_cost_max", "there are no prices to add up");
        sink.add(fault.help("add [cost] with per_coil, wire_per_kg or steel_per_kg"));
    }
}

/// `a > b` by more than rounding.
fn exceeds(a: f64, b: f64) -> bool {
    a - b > TOUCHING * a.abs().max(b.abs())
}

fn mm(value: f64) -> String {
    format!("{} mm", number(twelve_digits(value)))
}

fn error(sink: &Sink, key: &str, span: &Range<usize>, message: String, help: impl Into<String>) {
    sink.add(Fault::error(key, message).at(span).help(help));
}

/// An error where the command places the thing, a warning elsewhere.
fn placed(sink: &Sink, place: bool, key: &str, span: &Range<usize>, message: String, help: String) {
    let fault = if place {
        Fault::error(key, message)
    } else {
        Fault::warning(key, message)
    };
    sink.add(fault.at(span).help(help));
}

fn wire(wire: &WireDraft, sink: &Sink) {
    if exceeds(wire.conductor.value, wire.diameter.value) {
        let message = format!(
            "the conductor, {}, is thicker than the insulated wire, {}",
            mm(wire.conductor.value),
            mm(wire.diameter.value)
        );
        let help = "diameter_mm is measured over the insulation";
        error(
            sink,
            "wire.conductor_diameter_mm",
            &wire.conductor.span,
            message,
            help,
        );
    }
}

fn winding(coil: &CoilDraft, wire: &WireDraft, sink: &Sink) {
    let (inner, outer, length) = (coil.inner.value, coil.outer.value, coil.length.value);
    let (diameter, thickness) = (wire.diameter.value, (outer - inner) / 2.0);
    if inner >= outer {
        let message = format!(
            "the outer diameter, {}, must exceed the inner one, {}",
            mm(outer),
            mm(inner)
        );
        error(
            sink,
            "coil.outer_diameter_mm",
            &coil.outer.span,
            message,
            "are the two swapped?",
        );
        return;
    }
    let too_thick = |room: f64, name: &str, from: String| {
        if exceeds(diameter, room) {
            let message = format!(
                "the wire, {}, is thicker than the winding's {name}, {}",
                mm(diameter),
                mm(room)
            );
            let help = format!("{from}; take a thinner wire or a larger winding");
            error(sink, "wire.diameter_mm", &wire.diameter.span, message, help);
        }
    };
    too_thick(
        thickness,
        "radial build",
        format!("({} - {}) / 2", number(outer), number(inner)),
    );
    too_thick(length, "length", "coil.length_mm".to_owned());
    let fit = thickness / diameter * (length / diameter);
    if let Some(turns) = &coil.turns
        && turns.value > (fit * (1.0 - TOUCHING)).ceil()
        && !exceeds(diameter, thickness.min(length))
    {
        // The seed rounds 1428.57 up to 1429: a whole number next to what fits is no surprise.
        let message = format!(
            "{} turns are more than the {fit:.2} that fit",
            number(turns.value)
        );
        let help = "evaluate reports limits.winding_fill; leave turns out for as many as fit";
        sink.add(
            Fault::warning("coil.turns", message)
                .at(&turns.span)
                .help(help),
        );
    }
}

fn core_fits(core: &CoreDraft, coil: Option<&CoilDraft>, sink: &Sink) {
    let clearance = core.clearance.value;
    let bore = coil.map(|coil| coil.inner.value);
    if clearance < 0.0 {
        let message = match bore {
            Some(bore) => format!(
                "the core, {} in diameter, is thicker than the bore, {}",
                mm(bore - 2.0 * clearance),
                mm(bore)
            ),
            None => format!(
                "the core is thicker than the bore by {}",
                mm(-2.0 * clearance)
            ),
        };
        error(
            sink,
            "core.clearance_mm",
            &core.clearance.span,
            message,
            "the clearance is 0 or more",
        );
    }
    let Some(coil) = coil else { return };
    let radius = coil.inner.value / 2.0;
    if clearance >= radius {
        let message = format!(
            "a clearance of {} leaves no core in a bore of radius {}",
            mm(clearance),
            mm(radius)
        );
        let help = "lower it, or leave [core] out for an air coil";
        error(
            sink,
            "core.clearance_mm",
            &core.clearance.span,
            message,
            help,
        );
    }
    let length = coil.length.value + core.above.value + core.below.value;
    if length <= 0.0 {
        let message = format!(
            "the core has no length: {} + {} + {} = {}",
            number(coil.length.value),
            number(core.above.value),
            number(core.below.value),
            mm(length)
        );
        let help = "the core spans the winding's length plus above_mm plus below_mm";
        error(sink, "core.below_mm", &core.below.span, message, help);
    }
    let long = CORE_LENGTH_PLAUSIBLE * coil.length.value.max(coil.outer.value);
    if length > long {
        let (key, end) = if core.above.value > core.below.value {
            ("core.above_mm", &core.above)
        } else {
            ("core.below_mm", &core.below)
        };
        let message = format!(
            "the core is {} long, {:.0} times the winding's length",
            mm(length),
            length / coil.length.value
        );
        let help = "above_mm and below_mm are the core's overhang, in millimetres";
        sink.add(Fault::warning(key, message).at(&end.span).help(help));
    }
}

fn array_overlap(draft: &Draft, need: Need, sink: &Sink) {
    let Some(outer) = draft.coil.as_ref().map(|coil| coil.outer.value) else {
        return;
    };
    let report = |key: &str, span: &Range<usize>, [a, b]: [usize; 2], distance: f64| {
        let message = format!(
            "coils {a} and {b} overlap: their axes are {} apart, the outer diameter is {}",
            mm(distance),
            mm(outer)
        );
        let help = "move them apart, or make coil.outer_diameter_mm smaller".to_owned();
        placed(sink, need.array, key, span, message, help);
    };
    match &draft.array.layout {
        // The next coil is in the next column, or in the next row of a single column.
        Layout::Grid(grid, pitch)
            if grid.rows * grid.columns > 1 && exceeds(outer, pitch.value) =>
        {
            report("array.pitch_mm", &pitch.span, [0, 1], pitch.value);
        }
        Layout::Listed(list) if outer.is_finite() => {
            let positions: Vec<[f64; 2]> = list.iter().map(|place| place.value).collect();
            for o in overlaps(&positions, outer) {
                let key = format!("array.positions_mm[{}]", o.second);
                report(&key, &list[o.second].span, [o.first, o.second], o.distance);
            }
        }
        _ => {}
    }
}

/// Lists with one entry a coil.
fn lists(draft: &Draft, sink: &Sink) {
    let coils = match &draft.array.layout {
        Layout::Single => 1,
        Layout::Grid(grid, _) => grid.rows * grid.columns,
        Layout::Listed(list) => list.len(),
        Layout::Unknown => return,
    };
    let count = |key: &str, span: &Range<usize>, found: usize, other: &str| {
        if found != 0 && found != coils {
            let plural = if coils == 1 { "" } else { "s" };
            let message = format!("expected one entry a coil, {coils} coil{plural}, found {found}");
            error(sink, key, span, message, other);
        }
    };
    let currents = |key: &str, current: &Located<OneOrMany>| {
        if let OneOrMany::Many(list) = &current.value {
            count(
                key,
                &current.span,
                list.len(),
                "one number stands for all coils",
            );
        }
    };
    currents("supply.current_max_a", &draft.supply.current_max_a);
    currents("supply.current_min_a", &draft.supply.current_min_a);
    if let Some(gain) = &draft.array.gain {
        count(
            "array.gain",
            &gain.span,
            gain.value.len(),
            "leave it out for a gain of 1 everywhere",
        );
    }
}

/// The magnet on the axis at the target height, upright, against winding and core.
///
/// A magnet that fits in the bore of an air coil overlaps nothing; where the coil is not the
/// final one (`optimize`), the bore counts as closed.
fn target(draft: &Draft, need: Need, sink: &Sink) {
    let height = &draft.target_height;
    let half = draft.magnet.length / 2.0;
    let (bottom, top) = (height.value - half, height.value + half);
    let coil = draft.coil.as_ref().filter(|_| need.coil);
    // Spans from `to` down to `below` under the winding, or without end.
    let meets = |below: f64, to: f64| {
        let from = coil.map(|coil| -coil.length.value - below);
        exceeds(to, bottom) && from.is_none_or(|from| exceeds(top, from))
    };
    let in_core = draft
        .core
        .as_ref()
        .filter(|core| meets(core.below.value, core.above.value));
    let in_winding = meets(0.0, 0.0);
    let fits_bore = coil.is_some_and(|coil| !exceeds(draft.magnet.diameter, coil.inner.value));
    let (name, face) = match in_core {
        Some(core) => ("core", core.above.value),
        None if in_winding && !fits_bore => ("winding", 0.0),
        None if in_winding => {
            let message = format!(
                "the magnet's lower end, at z = {}, lies in the bore",
                mm(bottom)
            );
            let help = "height_mm counts from the winding's top face to the magnet's centre";
            sink.add(
                Fault::warning("target.height_mm", message)
                    .at(&height.span)
                    .help(help),
            );
            return;
        }
        None => return,
    };
    let message = format!(
        "the magnet spans z = {} to {} and overlaps the {name}, whose top is at z = {}",
        mm(bottom),
        mm(top),
        mm(face)
    );
    let help = format!(
        "its centre must be at {} or higher",
        mm(face.max(0.0) + half)
    );
    placed(
        sink,
        need.target,
        "target.height_mm",
        &height.span,
        message,
        help,
    );
}

fn workspace(draft: &Draft, need: Need, sink: &Sink) {
    let (Some(x), Some(y), Some(z)) = (&draft.workspace.x, &draft.workspace.y, &draft.workspace.z)
    else {
        return;
    };
    let lowest = z.value.from;
    if lowest < 0.0 {
        let message = format!(
            "the workspace begins at z = {}, below the coils' top face at z = 0",
            mm(lowest)
        );
        placed(
            sink,
            need.workspace,
            "workspace.z_mm",
            &z.span,
            message,
            "begin at 0 or higher".to_owned(),
        );
    } else if let Some(face) = core_top_inside(draft, [&x.value, &y.value], lowest, 0.0) {
        let message = format!(
            "the workspace begins at z = {} and reaches into a core, whose top is at z = {}",
            mm(lowest),
            mm(face)
        );
        placed(
            sink,
            need.workspace,
            "workspace.z_mm",
            &z.span,
            message,
            format!("begin at {} or higher", number(face)),
        );
    } else {
        magnet_in_core(draft, [&x.value, &y.value], z, sink);
    }
    let coils = draft.array.layout.positions_m().len();
    let samples = [x, y, z].map(|axis| axis.value.samples as f64);
    let values = coils as f64 * samples.iter().product::<f64>();
    if values > MAP_VALUES_MAX {
        let message = format!(
            "{coils} coils x {} x {} x {} nodes are {values:.3e} map values, more than {MAP_VALUES_MAX:e}",
            samples[0], samples[1], samples[2]
        );
        placed(
            sink,
            need.workspace,
            "workspace.x_mm",
            &x.span,
            message,
            "ask for fewer samples".to_owned(),
        );
    }
}

/// A map holds at points where no magnet can be; that is worth a word, no more.
fn magnet_in_core(draft: &Draft, footprint: [&Axis; 2], z: &Located<Axis>, sink: &Sink) {
    let half = draft.magnet.length / 2.0;
    let bottom = z.value.from - half;
    let margin = draft.magnet.diameter / 2.0;
    if let Some(face) = core_top_inside(draft, footprint, bottom, margin) {
        let message = format!(
            "a magnet centred at the workspace's lower end, z = {}, spans z = {} to {} and overlaps the core, whose top is at z = {}",
            mm(z.value.from),
            mm(bottom),
            mm(z.value.from + half),
            mm(face)
        );
        let help = format!("from z = {} on there is room for it", mm(face + half));
        sink.add(
            Fault::warning("workspace.z_mm", message)
                .at(&z.span)
                .help(help),
        );
    }
}

/// The cores' top, where it is above `lowest` within `margin` of the workspace's footprint.
fn core_top_inside(draft: &Draft, [x, y]: [&Axis; 2], lowest: f64, margin: f64) -> Option<f64> {
    let core = draft.core.as_ref()?;
    let radius = draft.coil.as_ref()?.inner.value / 2.0 - core.clearance.value;
    if !exceeds(core.above.value, lowest) {
        return None;
    }
    let beyond = |axis: &Axis, place_m: f64| {
        let place = 1000.0 * place_m;
        (axis.from - place).max(place - axis.to).max(0.0)
    };
    let positions = draft.array.layout.positions_m();
    let meets = |p: &[f64; 2]| exceeds(radius + margin, beyond(x, p[0]).hypot(beyond(y, p[1])));
    positions.iter().any(meets).then_some(core.above.value)
}
