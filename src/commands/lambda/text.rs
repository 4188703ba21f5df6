//! The result of `lambda` for people.

use super::LambdaReport;
use crate::bundle::headline::FeltForce;
use crate::bundle::lambda_file::{
    AtLambda, FeedbackFile, FeedbackShell, LambdaFile, LambdaVariant, LargestGiven, TolerancePoint,
    TwoFingers, VectorCurrents, VectorFeedbackFile, VectorStatic, WorkingPointForces,
    WorstPointFile,
};
use crate::cli::describe;
use crate::cli::layout::{Sheet, headed_table};
use crate::cli::quantity::{count, degrees, force, mm, number, number_to, percent};
use crate::commands::discretize::PointsReport;
use crate::design::Design;
use crate::lambda::feedback::Rendered;
use crate::lambda::vector_feedback::VectorRendering;
use crate::lambda::{Criterion, Precision, Wiring};

/// Share of the least largest error from which on what is not proven of it is stated.
const UNPROVEN: f64 = 1e-3;

/// The result for people.
pub(super) fn summary(design: &Design, points: &PointsReport, report: &LambdaReport) -> String {
    let file = &report.file;
    let mut sheet = Sheet::new(&format!(
        "{} on {}: lambda {}",
        file.shape,
        file.design,
        match &file.headline {
            Some(headline) => headline.lambda.clone(),
            None => describe::force_constant(file.lambda_n_per_m),
        }
    ));
    let felt = headline_lines(&mut sheet, file);
    let constants = file.constants.named().into_iter().map(|one| {
        let lambda = one.lambda_n_per_m.map_or_else(|| "none".to_owned(), number);
        format!("{} {lambda}", one.name)
    });
    let constants: Vec<String> = constants.collect();
    sheet.line("lambda", &format!("{} N/m", constants.join(", ")));
    sheet.line("chosen by", &describe::chosen_by(file));
    operating_point(&mut sheet, points, file);
    if let Some(worst) = &file.worst_point {
        sheet.line("worst point", &worst_point(worst));
    }
    if let Some(wiring) = &file.wiring {
        sheet.line("wiring", &wired(wiring));
    }
    if let Some(tolerance) = &file.tolerance {
        sheet.line("not felt", &not_felt(tolerance));
    }
    if let Some(point) = &file.working_point {
        sheet.line("steel", &along_the_curve(point));
    }
    if let Some(of) = &file.sideways {
        sheet.line("sideways", &describe::sideways(of));
    }
    if let Some(of) = &file.uncertainty {
        sheet.line("uncertain", &describe::uncertainty(of));
    }
    if let Some(with_feedback) = &file.feedback {
        feedback_lines(&mut sheet, design, with_feedback, file.points);
    }
    if let Some(currents) = &file.currents_a {
        sheet.line("currents", &describe::currents(design, currents));
    }
    if let Some(heat) = &file.hottest_coil {
        sheet.line(
            "heat",
            &format!("of the hottest coil {}", describe::heating(heat)),
        );
    }
    if let Some(at) = &file.at {
        at_lines(&mut sheet, design, at);
    }
    sheet.line(
        "path",
        &format!(
            "{}; rank {} of {}{}",
            count(file.path.len(), "breakpoint"),
            file.rank,
            count(design.array.positions_m.len(), "coil"),
            match report.precision {
                Precision::Double => "",
                Precision::DoubleDouble => "; in 31 digits, for nearly dependent coils",
            }
        ),
    );
    sheet.line("points", &points_line(points, file));
    let stages = file.accuracy.iter();
    let stages = stages.map(|(name, stage)| (name.as_str(), stage));
    sheet.line("accuracy", &describe::accuracy(stages));
    if let Some(felt) = felt {
        sheet.line("left out", &felt.not_modelled.join("\n"));
    }
    if let Some(variants) = &file.variants {
        sheet.gap();
        sheet.raw(&table_of(variants));
    }
    sheet.finish()
}

/// The force at the finger, and the outcome of a requested error.
fn headline_lines<'a>(sheet: &mut Sheet, file: &'a LambdaFile) -> Option<&'a FeltForce> {
    let headline = file.headline.as_ref()?;
    if let Some(requested) = describe::requested_error(headline) {
        sheet.line("error", &requested);
    }
    let felt = headline.felt.as_ref()?;
    let (all, parts) = (describe::felt(felt), describe::felt_parts(felt));
    sheet.line("finger", &format!("{all}\n{parts}"));
    Some(felt)
}

/// Currents and errors at the lambda of `--at`.
fn at_lines(sheet: &mut Sheet, design: &Design, at: &AtLambda) {
    let least = at.worst_point.as_ref().map_or_else(String::new, |worst| {
        format!(", {}", least_error(worst.worst_error_n, worst.gap_n))
    });
    let text = format!(
        "{} N/m: error rms {}, worst {}{least}",
        number(at.lambda_n_per_m),
        force(at.rms_error_n),
        force(at.worst_error_n),
    );
    sheet.line("at", &text);
    sheet.line("", &describe::currents(design, &at.currents_a));
}

/// The result with currents of their own at every point, beside the static ones.
fn feedback_lines(sheet: &mut Sheet, design: &Design, file: &FeedbackFile, points: usize) {
    let points = &format!("all {}", count(points, "point"));
    let constant = largest(&file.largest, points);
    let mut lines = vec![format!("lambda {constant}")];
    lines.extend(file.at_chosen.iter().map(rendering));
    lines.extend(file.without.iter().map(|fixed| {
        format!(
            "without, at {} N/m: error rms {}, worst {}\n  currents up to {} A; {} W",
            number(fixed.lambda_n_per_m),
            force(fixed.rms_error_n),
            force(fixed.worst_error_n),
            number_to(fixed.largest_current_a, 4),
            number_to(fixed.power_w, 4)
        )
    }));
    lines.extend(file.at_largest.iter().map(rendering));
    sheet.line("feedback", &lines.join("\n"));
    if let Some(rendered) = file.at_chosen.as_ref().or(file.at_largest.as_ref()) {
        let shares: Vec<f64> = rendered.active_share.iter().map(|s| s * 100.0).collect();
        let unit = format!(
            "% of the points, at {} N/m",
            number(rendered.lambda_n_per_m)
        );
        sheet.line("active", &describe::per_coil(design, &unit, &shares, 1));
    }
    if let Some(vector) = &file.vector {
        vector_lines(sheet, vector, points, file.at_chosen.as_ref());
    }
    if let Some(of) = &file.two_fingers {
        sheet.line("two fingers", &two_fingers(of));
    }
    if let Some(shell) = &file.shell {
        sheet.line("shell", &shell_of(shell));
    }
}

/// The requested vector with feedback, and what other currents make of it.
fn vector_lines(
    sheet: &mut Sheet,
    file: &VectorFeedbackFile,
    points: &str,
    at_chosen: Option<&Rendered>,
) {
    let constant = largest(&file.largest, points);
    let size = file.normal_force.map_or_else(String::new, |size| {
        format!(", lambda times the height its {} part", size.name())
    });
    let size = size.replace("magnitude part", "magnitude");
    let mut lines = vec![format!(
        "{}{size}: lambda {constant}",
        file.direction.name()
    )];
    let at = at_chosen.map_or_else(String::new, |at| {
        format!(" at {} N/m", number(at.lambda_n_per_m))
    });
    let one = |name: &str, of: &VectorRendering| {
        format!(
            "{name}: off by a median of {} degrees, 95 % within {}; error {} of the request, sideways {}\n  \
             given at {} of the points; {} W",
            degrees(of.direction_median_deg),
            degrees(of.direction_95_deg),
            percent(of.error_share),
            percent(of.sideways_share),
            percent(of.reached),
            number_to(of.mean_power_w, 4)
        )
    };
    if let Some(of) = &file.static_vector {
        lines.extend(static_vector(of));
    }
    let of_all = [
        ("static currents", &file.fixed),
        ("feedback of the upward part", &file.upward),
        ("feedback of the vector", &file.vector),
    ];
    for (name, of) in of_all {
        lines.extend(of.iter().map(|of| one(&format!("{name}{at}"), of)));
    }
    sheet.line("vector", &lines.join("\n"));
}

/// Pairs of points under two fingers.
fn two_fingers(of: &TwoFingers) -> String {
    let [from, to] = of.apart_m.map(mm);
    if of.pairs == 0 {
        return format!(
            "the object has no two points {from} to {to} apart at which two magnets do not overlap"
        );
    }
    format!(
        "of {} {from} to {to} apart, at {} N/m: both get their upward force at {}, for {} W; their vector at {}, \
         for {} W\nthe magnets push each other by {} at most, {} of the larger request",
        count(of.pairs, "random pair"),
        number(of.lambda_n_per_m),
        percent(of.upward_share),
        number_to(of.upward_power_w, 3),
        percent(of.vector_share),
        number_to(of.vector_power_w, 3),
        force(of.magnets_force_n),
        percent(of.magnets_force_share)
    )
}

/// Static currents chosen for all three components.
fn static_vector(file: &VectorStatic) -> Vec<String> {
    let one = |of: &VectorCurrents| {
        format!(
            "static currents for the vector at {} N/m: off by a median of {} degrees; error {} of the request, \
             sideways {}\n  weighted error rms {}, worst {}, no less than {}; {} W",
            number(of.lambda_n_per_m),
            degrees(of.rendering.direction_median_deg),
            percent(of.rendering.error_share),
            percent(of.rendering.sideways_share),
            force(of.weighted_rms_error_n),
            force(of.worst.worst_error_n),
            force(of.worst.at_least_n),
            number_to(of.rendering.mean_power_w, 4)
        )
    };
    let constants = file.constants.named().into_iter().filter_map(|constant| {
        let lambda = constant.lambda_n_per_m?;
        Some(format!("{} {}", constant.name, number(lambda)))
    });
    let constants: Vec<String> = constants.collect();
    let first = format!(
        "static currents for the vector, sideways errors counting {}: {} N/m",
        percent(file.sideways_weight),
        constants.join(", ")
    );
    let points = file.own.iter().chain(&file.at_chosen);
    std::iter::once(first).chain(points.map(one)).collect()
}

/// The largest constant of all `places`: others between them are not looked at.
fn largest(given: &LargestGiven, places: &str) -> String {
    let (Some(lambda), Some(place)) = (given.lambda_n_per_m, given.decided_at) else {
        let reason = given.reason.as_deref();
        return format!("none: {}", reason.unwrap_or("no force is requested"));
    };
    let [x, y, z] = place.position_m.map(|v| number(v * 1e3));
    format!(
        "up to {} N/m at {places}; point {} decides, at x {x}, y {y}, z {z} mm",
        number(lambda),
        place.point
    )
}

fn rendering(rendered: &Rendered) -> String {
    let unreached = match rendered.points_unreached {
        0 => String::new(),
        some => format!(" ({} out of reach)", count(some, "point")),
    };
    format!(
        "at {} N/m: error rms {}, worst {}{unreached}\n  currents up to {} A; {} W on average, \
         up to {} W; {} coils active on average, {} to {}",
        number(rendered.lambda_n_per_m),
        force(rendered.rms_error_n),
        force(rendered.worst_error_n),
        number_to(rendered.largest_current_a, 4),
        number_to(rendered.mean_power_w, 4),
        number_to(rendered.max_power_w, 4),
        number_to(rendered.active_mean, 3),
        rendered.active_min,
        rendered.active_max
    )
}

/// The demand above and below the surface.
fn shell_of(shell: &FeedbackShell) -> String {
    let clipped = match shell.clipped {
        0 => String::new(),
        some => format!(
            "; {} of {} places below {} looked at there",
            some,
            shell.places,
            mm(shell.floor_m)
        ),
    };
    let between = match shell.places_between {
        0 => String::new(),
        some => format!(" and {} between them", count(some, "place")),
    };
    let all = format!("all {} places", shell.places + shell.places_between);
    format!(
        "within {} of the surface, {}{between}: lambda {}{clipped}",
        mm(shell.reach_m),
        count(shell.layers, "layer"),
        largest(&shell.largest, &all)
    )
}

fn wired(wiring: &Wiring) -> String {
    let broken = wiring.broken.iter().map(|coil| format!("{coil} broken"));
    let series = wiring.series.iter();
    let series = series.map(|[a, b]| format!("{a}+{b} in series"));
    broken.chain(series).collect::<Vec<_>>().join(", ")
}

/// Up to where errors stay below what is felt.
fn not_felt(tolerance: &TolerancePoint) -> String {
    let limit = format!(
        "the larger of {} of its force and {}",
        percent(tolerance.share),
        force(tolerance.threshold_n)
    );
    match (tolerance.lambda_n_per_m, tolerance.point) {
        (Some(lambda), Some(point)) => format!(
            "up to {} N/m currents keep every error within {limit}; point {point} decides",
            number(lambda)
        ),
        _ => format!("no largest lambda keeps every error within {limit}"),
    }
}

/// How lambda changes. With a coil broken a larger lambda is no improvement: fewer coils give less of the
/// force before the criterion ends it.
fn change(variant: &LambdaVariant) -> String {
    match variant.relative_change {
        None => "none".to_owned(),
        Some(change) if change > 0.0 && !variant.wiring.broken.is_empty() => {
            format!("({}, fault)", percent(change))
        }
        Some(change) => percent(change),
    }
}

/// One row per variant.
fn table_of(variants: &[LambdaVariant]) -> String {
    let or_none =
        |value: Option<f64>, show: fn(f64) -> String| value.map_or_else(|| "none".to_owned(), show);
    let lambda = |value| or_none(value, |v| number_to(v, 4));
    let row = |v: &LambdaVariant| {
        let constants = Criterion::ALL
            .iter()
            .map(|&criterion| (criterion.name(), lambda(v.constants.of(criterion))));
        let mut row = vec![
            ("N/m, W", v.name.clone()),
            ("lambda", lambda(v.lambda_n_per_m)),
            ("change", change(v)),
        ];
        row.extend(constants);
        row.extend([
            ("worst-point jnd", lambda(v.worst_point_lambda_jnd_n_per_m)),
            ("rms error", or_none(v.relative_rms_error, percent)),
            ("worst error", or_none(v.worst_error_n, force)),
            ("power", lambda(v.power_w)),
        ]);
        row
    };
    headed_table(variants.iter().map(row))
}

/// The least largest error, as far as it is proven.
fn least_error(worst_error_n: f64, gap_n: Option<f64>) -> String {
    let gap_n = gap_n.unwrap_or(0.0);
    if gap_n > UNPROVEN * worst_error_n {
        let (least, given) = (force(worst_error_n - gap_n), force(worst_error_n));
        format!("at least {least}, {given} with the best currents found")
    } else {
        format!("at least {}", force(worst_error_n))
    }
}

/// The result of currents for the worst point.
fn worst_point(worst: &WorstPointFile) -> String {
    let missing = if worst.constants_unknown {
        "not known"
    } else {
        "none"
    };
    let constant = |lambda: Option<f64>| {
        lambda.map_or_else(
            || missing.to_owned(),
            |lambda| format!("{} N/m", number(lambda)),
        )
    };
    let linear = match (worst.lambda_linear_n_per_m, worst.lambda_jnd_n_per_m) {
        (None, Some(_)) => "hidden by the error of the worst point".to_owned(),
        (linear, _) => constant(linear),
    };
    let least = worst.worst_error_n.map_or_else(String::new, |least| {
        let relative = worst.relative_worst_error.map_or_else(String::new, |part| {
            format!(" ({} of the largest force)", percent(part))
        });
        format!("error {}{relative}; ", least_error(least, worst.gap_n))
    });
    format!(
        "{least}lambda by the worst point: linear {linear}, jnd {}",
        constant(worst.lambda_jnd_n_per_m)
    )
}

/// The steel at the chosen currents, along its curve.
fn along_the_curve(point: &WorkingPointForces) -> String {
    let peak_t = point.peak_field_t.iter().copied().fold(0.0, f64::max);
    format!(
        "along its B-H curve forces {} off those added up: error rms {}, worst {}; \
         |B| up to {} T",
        percent(point.deviation_from_linear),
        force(point.rms_error_n),
        force(point.worst_error_n),
        number_to(peak_t, 4)
    )
}

fn operating_point(sheet: &mut Sheet, points: &PointsReport, file: &LambdaFile) {
    let heights = &points.discretized.points.height_m;
    let mean_m = heights.iter().sum::<f64>() / heights.len() as f64;
    if let Some(lambda) = file.lambda_n_per_m {
        sheet.line(
            "force",
            &format!(
                "{} requested at the mean height, {}",
                force(lambda * mean_m),
                mm(mean_m)
            ),
        );
    }
    if let Some(headline) = &file.headline {
        sheet.line("given", &describe::given_force(headline));
        sheet.line("computed", &describe::force_error(headline));
    }
    if let (Some(rms), Some(worst)) = (file.rms_error_n, file.worst_error_n) {
        let relative = file.relative_rms_error.map_or_else(String::new, |part| {
            format!(" ({} of the rms force)", percent(part))
        });
        sheet.line(
            "error",
            &format!("rms {}{relative}, worst {}", force(rms), force(worst)),
        );
    }
}

/// How many points there are, how high, and what was left out.
fn points_line(points: &PointsReport, file: &LambdaFile) -> String {
    let points = &points.summary;
    if let Some(sampled) = &file.sampling {
        let change = sampled.relative_change.map_or_else(String::new, |change| {
            let sign = if change < 0.0 { "-" } else { "+" };
            format!("; lambda {sign}{} against those", percent(change.abs()))
        });
        return format!(
            "{} {}, weighted by area, instead of the grid's {}{change}",
            file.points, sampled.sampling, sampled.grid_points
        );
    }
    let outside = if points.outside > 0 {
        let outside = count(points.outside, "grid point");
        format!("; {outside} without surface left out")
    } else {
        String::new()
    };
    format!(
        "{}, {} high{outside}",
        points.points,
        describe::heights(points.min_height_m, points.max_height_m)
    )
}

#[cfg(test)]
mod tests {
    use super::{WorstPointFile, worst_point};

    #[test]
    fn constants_that_are_not_known_differ_from_limits_that_never_bind() {
        let line = |unknown: bool| {
            let file = serde_json::json!({ "path": [], "constants_unknown": unknown });
            worst_point(&serde_json::from_value::<WorstPointFile>(file).unwrap())
        };
        assert!(line(true).ends_with("linear not known, jnd not known"));
        assert!(line(false).ends_with("linear none, jnd none"));
    }
}
