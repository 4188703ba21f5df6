//! The result of `replay` for people.

use super::ReplayReport;
use super::felt::FeltErrors;
use super::summary::{ErrorSummary, ForceSummary, ReplaySummary, VectorErrors};
use crate::cli::layout::Sheet;
use crate::cli::quantity::{count, degrees, error, force, number, number_to, percent, si};
use crate::force_direction::ForceDirection;

/// Forces below this are rounding, N.
const NOTHING_N: f64 = 1e-12;

/// The result for people; `written` names the files.
pub(super) fn summary(report: &ReplayReport, written: Option<&str>) -> String {
    let summary = &report.summary;
    let trajectory = &summary.trajectory;
    let mut sheet = Sheet::new(&format!(
        "{} on {}: {} in {} s ({})",
        summary.shape,
        summary.design,
        count(trajectory.positions, "position"),
        number(trajectory.duration_s),
        trajectory.source
    ));
    sheet.line(
        "requested",
        &format!(
            "{} N/m times the height, {}, at most {} upward",
            number(summary.lambda_n_per_m),
            direction(summary.force.vector.as_ref()),
            force(summary.wanted_max_n())
        ),
    );
    forces(&mut sheet, "feedback", &summary.force);
    if let Some(two) = &summary.two_fingers {
        forces(&mut sheet, "second", &two.second);
        sheet.line(
            "two fingers",
            &format!(
                "both get their force {} of the time; their magnets push each other by up to {}",
                percent(two.both_given_time_fraction),
                newton(two.magnets_force_n)
            ),
        );
    }
    if let Some(felt) = &summary.force.felt {
        let of = |errors: &FeltErrors| {
            format!(
                "{} promised, {} of {}, {} W",
                percent(errors.promised),
                percent(errors.realised),
                count(felt.draws, "random display"),
                number_to(errors.mean_power_w, 3)
            )
        };
        sheet.line(
            "felt error",
            &format!(
                "chosen for the uncertainties {}\nof least power {}",
                of(&felt.robust),
                of(&felt.feedback)
            ),
        );
    }
    let fixed = summary.fingers().into_iter().map(|(finger, force)| {
        let of = finger.map_or_else(String::new, |finger| format!("{finger}: "));
        format!(
            "{of}{} (the bundle's static currents)",
            errors(&force.fixed)
        )
    });
    sheet.line("fixed", &fixed.collect::<Vec<_>>().join("\n"));
    sheet.line("currents", &currents(summary));
    let power = &summary.power;
    sheet.line(
        "heat",
        &format!(
            "{} on the average, at most {}; fixed currents {}",
            si(power.mean_w, "W"),
            si(power.max_w, "W"),
            si(power.static_w, "W")
        ),
    );
    limits(&mut sheet, summary);
    if let Some(written) = written {
        sheet.line("written to", written);
    }
    if let Some(step_s) = report.step_s {
        sheet.line("step", &format!("{} each on this machine", si(step_s, "s")));
    }
    sheet.finish()
}

/// The forces on a finger with feedback.
fn forces(sheet: &mut Sheet, title: &str, force: &ForceSummary) {
    let mut line = errors(&force.feedback);
    if let Some(vector) = &force.vector {
        line += &format!(
            "\ndirection off by a median of {} degrees, 95 % within {}; error of the vector rms {}, worst {}",
            degrees(vector.direction_median_deg),
            degrees(vector.direction_95_deg),
            newton(vector.rms_error_n),
            newton(vector.worst_error_n)
        );
    }
    sheet.line(title, &line);
}

/// The limits, the lag of the currents and the accuracy.
fn limits(sheet: &mut Sheet, summary: &ReplaySummary) {
    sheet.line(
        "limits",
        &format!(
            "allow only the nearest force {} of the time; outside the map {}",
            percent(summary.saturated_time_fraction),
            percent(summary.outside_time_fraction)
        ),
    );
    if let Some(dynamics) = &summary.dynamics {
        let voltage = dynamics
            .voltage_v
            .map_or_else(String::new, |v| format!(", voltages up to {} V", number(v)));
        sheet.line(
            "lag",
            &format!(
                "time constants from {} to {}{voltage}",
                si(dynamics.time_constant_min_s, "s"),
                si(dynamics.time_constant_max_s, "s")
            ),
        );
    }
    let error_n = summary.force_error_n();
    if error_n > 0.0 {
        let optimality = summary
            .accuracy
            .get("allocation")
            .map(|stage| format!("; optimality of the currents {}", error(stage.estimate)));
        sheet.line(
            "accuracy",
            &format!(
                "forces to {} N by the map's stated errors{}",
                error(error_n),
                optimality.unwrap_or_default()
            ),
        );
    }
}

/// Which force is requested.
fn direction(vector: Option<&VectorErrors>) -> &'static str {
    match vector.map_or(ForceDirection::Vertical, |vector| vector.direction) {
        ForceDirection::Vertical => "upward (sideways not controlled)",
        ForceDirection::VerticalOnly => "upward and none sideways",
        ForceDirection::Normal => "along the surface's normal",
    }
}

fn newton(force_n: f64) -> String {
    if force_n < NOTHING_N {
        "none".to_owned()
    } else {
        force(force_n)
    }
}

fn errors(errors: &ErrorSummary) -> String {
    if errors.worst_error_n < NOTHING_N {
        return "no error".to_owned();
    }
    let relative = errors
        .relative_rms_error
        .map_or_else(String::new, |part| format!(" ({})", percent(part)));
    let place = errors.worst_at.map_or_else(String::new, |place| {
        let at = [place.x_m, place.y_m, place.z_m].map(|c| number(c * 1e3));
        format!(" at {} s, ({}) mm", number(place.t_s), at.join(", "))
    });
    format!(
        "error rms {}{relative}, worst {}{place}",
        newton(errors.rms_error_n),
        newton(errors.worst_error_n)
    )
}

fn currents(summary: &ReplaySummary) -> String {
    let currents = &summary.currents;
    let most = currents.max_a.iter().copied().fold(0.0, f64::max);
    let rms = currents.rms_a.iter().copied().fold(0.0, f64::max);
    let farthest = if currents.max_sum_a < 0.0 {
        ", the farthest from zero"
    } else {
        ""
    };
    format!(
        "at most {} a coil and {} in all{farthest}; rms at most {} a coil",
        si(most, "A"),
        si(currents.max_sum_a, "A"),
        si(rms, "A")
    )
}
