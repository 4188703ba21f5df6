//! Pieces of summaries that several commands print alike.

use super::quantity::{
    count, error, length_error, mm, number, number_to, percent, share, share_with_error, si,
};
use crate::accuracy::StageAccuracy;
use crate::bundle::headline::{BudgetPart, FeltForce, FeltPart, Headline};
use crate::bundle::lambda_file::{LambdaFile, Sideways};
use crate::bundle::manifest::{AxisSummary, LeftOut};
use crate::cli::layout::grid;
use crate::design::Design;
use crate::digits::duration;
use crate::heating::Heating;
use crate::lambda::uncertainty::{CurrentsError, Study};
use crate::lambda::{Criterion, GivenForce, Jnd};
use crate::uncertainty::Cause;
use crate::units::{FAINT_FORCE_JND, FAINT_FORCE_N, FORCE_JND};

/// Coils beyond this many are summed up, not listed.
const COILS_SHOWN: usize = 100;
/// Columns of coils that are not on a grid.
const COLUMNS: usize = 8;
/// Most columns that fit a screen.
const COLUMNS_MAX: usize = 12;

/// Each stage's estimated error, one line a stage.
pub fn accuracy<'a>(stages: impl IntoIterator<Item = (&'a str, &'a StageAccuracy)>) -> String {
    let lines: Vec<String> = stages
        .into_iter()
        .map(|(name, stage)| {
            let (name, to) = (name.replace('_', " "), &stage.relative_to);
            if to == "1 m" {
                return format!("{name} {}", length_error(stage.estimate));
            }
            format!("{name} {} of {to}", error(stage.estimate))
        })
        .collect();
    lines.join("\n")
}

/// The array in a few words.
pub fn array(design: &Design) -> String {
    let coils = count(design.array.positions_m.len(), "coil");
    match design.array.grid {
        Some(array) if array.rows * array.columns > 1 => format!(
            "{coils}, {} x {} at a pitch of {} mm",
            array.rows,
            array.columns,
            number(array.pitch_m * 1000.0)
        ),
        _ => coils,
    }
}

/// Currents as the coils are placed, seen from above: y grows upwards, x to the right.
pub fn currents(design: &Design, currents_a: &[f64]) -> String {
    per_coil(design, "A", currents_a, 4)
}

/// One value per coil, with so many decimals, as the coils are placed.
pub fn per_coil(design: &Design, unit: &str, values: &[f64], decimals: usize) -> String {
    let cells: Vec<String> = values.iter().map(|v| format!("{v:.decimals$}")).collect();
    if cells.len() == 1 {
        return format!("{} {unit}", cells[0]);
    }
    if cells.len() <= COILS_SHOWN
        && let Some(array) = design.array.grid.filter(|a| a.columns <= COLUMNS_MAX)
        && array.rows * array.columns == cells.len()
    {
        let from_top: Vec<String> = cells
            .chunks(array.columns)
            .rev()
            .flatten()
            .cloned()
            .collect();
        return format!(
            "{unit}, seen from above (x to the right, y up)\n{}",
            grid(&from_top, array.columns)
        );
    }
    if cells.len() <= COILS_SHOWN {
        return format!("{unit}, coil 0 first\n{}", grid(&cells, COLUMNS));
    }
    let fold = |start, pick: fn(f64, f64) -> f64| values.iter().copied().fold(start, pick);
    format!(
        "{}, from {} to {} {unit}; all of them with --format json",
        count(cells.len(), "coil"),
        number(fold(f64::INFINITY, f64::min)),
        number(fold(f64::NEG_INFINITY, f64::max))
    )
}

/// An axis in millimetres.
pub fn axis(name: &str, axis: &AxisSummary) -> String {
    let mm = |length_m: f64| number(length_m * 1000.0);
    format!(
        "{name} {} to {} mm in {}",
        mm(axis.from_m),
        mm(axis.to_m),
        count(axis.samples, "sample")
    )
}

/// The heights that points have.
pub fn heights(min_m: f64, max_m: f64) -> String {
    if min_m == max_m {
        mm(min_m)
    } else {
        format!("{} to {}", mm(min_m), mm(max_m))
    }
}

/// How warm a coil becomes while its current flows.
pub fn heating(of: &Heating) -> String {
    let celsius = |c: f64| format!("{} C", number_to(c, 3));
    let melted = || "beyond any winding".to_owned();
    let after = of.after_c.map_or_else(melted, celsius);
    let steady = of.steady_c.map_or_else(melted, celsius);
    let limit = of.winding_max_s.map_or_else(String::new, |time_s| {
        let limit = celsius(of.winding_max_c);
        format!(
            "; {limit} after {}: not for continuous operation",
            duration(time_s)
        )
    });
    format!(
        "{} W at {} and {}: {after} after {}, {steady} in the long run{limit}",
        number_to(of.power_w, 3),
        si(of.current_a, "A"),
        celsius(of.ambient_c),
        duration(of.heating_s),
    )
}

/// The criterion, and where its just-noticeable difference is that of larger forces.
pub fn chosen_by(file: &LambdaFile) -> String {
    let by = file.criterion.described(&percent(file.jnd));
    let [least, most] = FAINT_FORCE_JND;
    // The requested force's root mean square.
    let force_n =
        (file.rms_error_n.zip(file.relative_rms_error)).map(|(error, share)| error / share);
    let faint = force_n.is_some_and(|force_n| force_n < FAINT_FORCE_N);
    if file.criterion != Criterion::Jnd || !faint {
        by
    } else if (file.jnd - FORCE_JND).abs() < 1e-12 {
        format!(
            "{by}, measured at 2.5 to 10 N; below {} N {} to {} were measured",
            number(FAINT_FORCE_N),
            number(least * 100.0),
            percent(most)
        )
    } else if file.jnd == Jnd::FAINT {
        format!("{by}, found below {} N", number(FAINT_FORCE_N))
    } else {
        by
    }
}

/// Each thing that was left out with its cost, one line each.
pub fn left_out(parts: &[LeftOut]) -> String {
    let lines: Vec<String> = parts
        .iter()
        .map(|part| {
            let cost = match part.error_cost {
                Some(0.0) => "costs no accuracy".to_owned(),
                Some(cost) => format!("costs {}", error(cost)),
                None => "its cost is not known".to_owned(),
            };
            format!("{}: {}; {cost}", part.what, part.why)
        })
        .collect();
    if lines.is_empty() {
        "nothing".to_owned()
    } else {
        lines.join("\n")
    }
}

/// A force constant, or that there is none.
pub fn force_constant(lambda_n_per_m: Option<f64>) -> String {
    lambda_n_per_m.map_or_else(
        || "none".to_owned(),
        |lambda| format!("{} N/m", number(lambda)),
    )
}

/// How much of the requested force is given, on average and over the points.
fn given_range(given: &GivenForce) -> String {
    format!(
        "{} of the requested force on average, {} to {} over the points",
        percent(given.mean),
        number_to(given.least * 100.0, 3),
        percent(given.most)
    )
}

/// How much of the requested force static currents give, and currents with feedback.
pub fn given_force(headline: &Headline) -> String {
    let mut lines = Vec::new();
    if let Some(given) = &headline.static_currents {
        let above = if given.above_saturation {
            "; lambda is above saturation: all currents are at their limits"
        } else {
            ""
        };
        lines.push(format!("{}{above}", given_range(given)));
    }
    let feedback = headline.feedback.as_ref();
    lines.extend(feedback.map(|given| format!("with feedback {}", given_range(given))));
    lines.join("\n")
}

/// The error that the computation adds to the force, its parts, and how to halve it.
pub fn force_error(headline: &Headline) -> String {
    // Parts below a hundredth of the whole are left out.
    let counts = |part: &&BudgetPart| part.error > 0.01 * headline.force_error;
    let parts: Vec<String> = headline
        .budget
        .iter()
        .filter(counts)
        .map(|part| format!("{} {}", part.part.words(), share(part.error)))
        .collect();
    let mut lines = vec![format!(
        "the computation adds up to {} of the requested force: {}",
        share(headline.force_error),
        parts.join(", ")
    )];
    lines.extend(
        headline
            .to_halve
            .iter()
            .map(|what| format!("to halve the largest part: {what}")),
    );
    lines.extend(headline.jumps.map(|jumps| {
        format!(
            "left out: {} of the points, where the surface jumps; there the force goes from one side's \
             to the other's within a cell",
            percent(jumps)
        )
    }));
    lines.join("\n")
}

/// The felt error of the force vector with each kind of currents.
pub fn felt(felt: &FeltForce) -> String {
    let (of, off) = (felt.total, felt.sampling.unwrap_or_default());
    let fixed = share_with_error(of.fixed, off.fixed);
    let feedback = share_with_error(of.feedback, off.feedback);
    let robust = of.robust.map_or_else(String::new, |of| {
        let share = share_with_error(of, off.robust.unwrap_or(0.0));
        format!(", {share} with currents chosen for the uncertainties")
    });
    format!("force vector off by {fixed} with static currents, {feedback} with feedback{robust}")
}

/// The same split by cause, in the same order.
pub fn felt_parts(felt: &FeltForce) -> String {
    let one = |part: &FeltPart| {
        let of = part.error;
        let shares = [Some(of.fixed), Some(of.feedback), of.robust];
        let shares: Vec<String> = shares.into_iter().flatten().map(share).collect();
        format!("{} {}", part.cause.words(), shares.join(", "))
    };
    let parts: Vec<String> = felt.parts.iter().map(one).collect();
    parts.join("; ")
}

/// The cost of the uncertainties, the one to halve first, and the setting chosen for them.
pub fn uncertainty(of: &Study) -> String {
    let one = |name: &str, error: &CurrentsError| {
        let (promised, realised) = (&error.promised, &error.realised);
        format!(
            "{name}: upward {}, sideways {}, worst {}; {} W; of {} random displays {} and {}",
            share(promised.vertical),
            share(promised.sideways),
            share(promised.worst),
            number_to(promised.mean_power_w, 3),
            of.draws,
            share(realised.vertical),
            share(realised.sideways),
        )
    };
    let mut lines = vec![
        one("static currents", &of.fixed),
        one("static, chosen for them", &of.robust_static.error),
        one("feedback", &of.feedback),
        one("feedback, chosen for them", &of.robust.error),
    ];
    lines.extend(of.causes.iter().map(|cost| {
        format!(
            "{} {}: half of it takes {} off feedback, {} off currents chosen for it",
            cost.cause.words(),
            bound(cost.cause, cost.bound),
            share(cost.halving_gains.feedback),
            share(cost.halving_gains.robust),
        )
    }));
    lines.join("\n")
}

/// The bound of an uncertainty in its unit.
fn bound(cause: Cause, value: f64) -> String {
    match cause {
        Cause::Sensor => mm(value),
        Cause::Tilt => format!("{} degrees", number(value)),
        Cause::Heat => format!("{} C", number(value)),
        Cause::Driver => percent(value),
    }
}

/// The outcome of a requested error; `None` where none was requested.
pub fn requested_error(headline: &Headline) -> Option<String> {
    let requested = headline.requested.as_ref()?;
    let grid = |points: &[usize]| {
        let samples: Vec<String> = points.iter().map(usize::to_string).collect();
        samples.join(" x ")
    };
    let chosen = |points: [usize; 2], nodes: Option<[usize; 3]>| {
        let nodes = nodes.map_or_else(String::new, |nodes| format!(", {} nodes", grid(&nodes)));
        format!("{} points{nodes}", grid(&points))
    };
    let holds = if requested.met { "holds" } else { "exceeds" };
    let kind = if requested.by_default {
        "default"
    } else {
        "requested"
    };
    let apart = requested
        .heights
        .filter(|heights| *heights != requested.points);
    let heights = apart.map_or_else(String::new, |heights| {
        format!(", {} heights", grid(&heights))
    });
    let mut lines = vec![format!(
        "{} {holds} the {kind} {}: {}{heights}, tolerance {}",
        share(headline.force_error),
        share(requested.error),
        chosen(requested.points, requested.nodes),
        error(requested.tolerance)
    )];
    lines.extend(requested.fixed.iter().cloned());
    lines.extend(requested.elsewhere.iter().map(|run| {
        format!(
            "at {} about {} times the work: {} (an estimate)",
            share(run.error),
            number_to(run.work, 2),
            chosen(run.points, run.nodes)
        )
    }));
    Some(lines.join("\n"))
}

/// The sideways force that the chosen currents and feedback leave.
pub fn sideways(of: &Sideways) -> String {
    let off = |share: f64, degrees: f64| format!("{}, {degrees:.0} degrees off", percent(share));
    // The power is a mean over all points, not over those that are reached.
    let points = if of.vector_reached == 1.0 {
        "at every point, for".to_owned()
    } else {
        let reached = percent(of.vector_reached);
        format!("at {reached} of the points; over all of them")
    };
    format!(
        "{} of the push with these currents\n{} with feedback of the upward force\n\
         none with feedback of all components {points} {} times the power",
        off(of.static_share, of.static_median_deg),
        off(of.feedback_share, of.feedback_median_deg),
        number_to(of.vector_power_ratio, 3)
    )
}
