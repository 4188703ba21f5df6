//! The summary of `optimize --for`.

use super::physics::{Constant, OtherAim};
use super::{ArrayEnding, ArrayOptimization};
use crate::accuracy::CertificateKind;
use crate::cli::layout::{Sheet, table};
use crate::cli::limits::limit_row;
use crate::cli::quantity::{count, number, percent, si};
use crate::coil::array_search::study::Study;
use crate::coil::array_search::worth::LimitWorth;
use crate::coil::limits::by_key;

pub fn summary(result: &ArrayOptimization, seconds: &[(String, f64)]) -> String {
    let mut sheet = Sheet::new(&format!(
        "{}: the array that renders the shapes best",
        result.design
    ));
    let given = match &*result.shapes {
        [_] => "that of the given design".to_owned(),
        _ => format!("the given design's {}", result.objective),
    };
    sheet.line("gain", &format!("{} times {given}", number(result.gain)));
    sheet.line("ended", &ended(result));
    let took: f64 = seconds.iter().map(|(_, seconds)| seconds).sum();
    sheet.line("took", &si(took, "s"));
    if let Some(search) = result.levels.iter().find(|level| level.level == "search") {
        let error = format!(
            "while searching force constants were {} off at most, their ratios {}",
            percent(search.lambda_error),
            percent(search.gain_error)
        );
        sheet.line("accuracy", &error);
    }
    if let Some(study) = &result.study {
        worth(&mut sheet, study);
    }
    sheet.gap();
    sheet.raw(&shapes(result));
    sheet.gap();
    sheet.raw(&variables(result));
    if !result.limits.is_empty() {
        sheet.gap();
        sheet.raw(&limits(result));
    }
    if let Some(study) = result
        .study
        .as_ref()
        .filter(|study| !study.neighbours.is_empty())
    {
        sheet.gap();
        sheet.raw(&neighbours(result, study));
    }
    sheet.finish()
}

/// How it ended, and how sure it is.
pub fn ended(result: &ArrayOptimization) -> String {
    let certificate = &result.certificate;
    let known = match certificate.gap {
        Some(gap) => format!("proven: no pitch gains {} more", percent(gap.max(0.0))),
        None if certificate.kind == CertificateKind::Exhaustive => {
            "every one of the search is among them".to_owned()
        }
        None => certificate.kind.open_question().to_owned(),
    };
    let descents = match certificate.starts {
        0 => String::new(),
        starts => format!("{} over ", count(starts, "descent")),
    };
    let searched = format!(
        "best of {descents}{} that were computed; {known}",
        count(result.evaluations, "array")
    );
    match result.status {
        ArrayEnding::Done => searched,
        ArrayEnding::Infeasible => format!("{searched}; none meets every limit"),
        ArrayEnding::Interrupted => {
            format!("interrupted: {searched}, at the accuracy of the search")
        }
    }
}

/// The gain from a step more of each limit that binds.
pub fn worths(study: &Study) -> Vec<String> {
    let active = study.limits.iter().filter(|limit| limit.active);
    active.map(one_more).collect()
}

fn worth(sheet: &mut Sheet, study: &Study) {
    let said = worths(study);
    if !said.is_empty() {
        sheet.line("worth", &said.join("\n"));
    }
}

/// The gain from a step more of a limit.
pub fn one_more(limit: &LimitWorth) -> String {
    let (unit, per_si) = match limit.name {
        Some(name) => name.limit().step,
        None if limit.key.ends_with("_m") => ("mm", 1e3),
        None => ("mm", 1.0),
    };
    let label = crate::report::limits::label(limit.key);
    let given = percent(limit.gain_per_unit.abs() / per_si);
    let way = if limit.gain_per_unit < 0.0 {
        "less"
    } else {
        "more"
    };
    format!("1 {unit} {way} of {label} would give {given}")
}

fn shapes(result: &ArrayOptimization) -> String {
    let what = match result.constant {
        Constant::ERROR => "error",
        Constant::Static(_) | Constant::Other(OtherAim::Feedback | OtherAim::Vector) => "lambda",
    };
    let head = ["shape", "before", what, "gain"]
        .map(str::to_owned)
        .to_vec();
    let row = |shape: &super::ShapeGain| {
        let [before, now] = shape.written(number, percent);
        vec![shape.shape.clone(), before, now, number(shape.gain)]
    };
    let rows: Vec<_> = std::iter::once(head)
        .chain(result.shapes.iter().map(row))
        .collect();
    table("lrrr", &rows)
}

fn variables(result: &ArrayOptimization) -> String {
    let Some(study) = &result.study else {
        let rows: Vec<_> = result
            .values
            .iter()
            .map(|(key, value)| vec![key.clone(), number(*value)])
            .collect();
        return table("lr", &rows);
    };
    let head = ["variable", "given", "best", "within 1 %", "bought"]
        .map(str::to_owned)
        .to_vec();
    let rows = study.variables.iter().map(|one| {
        let bought = one.objective_without.map_or_else(
            || "needed".to_owned(),
            |without| percent((result.gain / without - 1.0).max(0.0)),
        );
        let [low, high] = one.range.map(number);
        vec![
            one.key.clone(),
            number(one.given),
            number(one.value),
            format!("{low} to {high}"),
            bought,
        ]
    });
    let rows: Vec<_> = std::iter::once(head).chain(rows).collect();
    table("lrrrr", &rows)
}

fn limits(result: &ArrayOptimization) -> String {
    let rows = result.limits.iter().map(|(key, check)| {
        let state = if check.met { "met" } else { "missed" };
        let before = result.limits_given.get(key).filter(|check| !check.met);
        let state = before.map_or_else(|| state.to_owned(), |_| format!("{state}, missed before"));
        let mut row = limit_row(key, check.value, check.limit, &state);
        // The lower end of a range: those that are missed alone are listed.
        if by_key(key).is_none() && !check.met && check.value < check.limit {
            row[2] = row[2].replace("<=", ">=");
        }
        row
    });
    table("lrrl", &rows.collect::<Vec<_>>())
}

fn neighbours(result: &ArrayOptimization, study: &Study) -> String {
    let rows = study.neighbours.iter().map(|near| {
        let lost = percent((1.0 - near.objective / result.gain).max(0.0));
        let values: Vec<String> = near
            .values
            .iter()
            .map(|(key, value)| format!("{key} = {}", number(*value)))
            .collect();
        vec![
            near.what.clone(),
            format!("loses {lost}"),
            values.join(", "),
        ]
    });
    table("lll", &rows.collect::<Vec<_>>())
}
