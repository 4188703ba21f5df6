//! The curves as Markdown: a line a stage, then a table a stage, then the defaults.

use std::fmt::Write;

use crate::file::{BenchFile, Curve, Law, Row, StageCurves};
use crate::scaling::THREADS;

/// Above this ratio of the time by the clock to processor time of one thread a machine had other work.
const BUSY: f64 = 1.1;

/// `summary.md`.
#[must_use]
pub fn markdown(file: &BenchFile) -> String {
    let mut text = String::from(
        "# Error against processor time\n\nMedian of the repeats and their quartiles, one thread; \
         made by `fluxform-bench`",
    );
    text += if file.quick { " `--quick`" } else { "" };
    text += ". Errors: see each stage. A knob marked * is the default.\n\n";
    text += &overview(file);
    for stage in &file.stages {
        text += &stage_table(stage);
    }
    text += "\n## The defaults on these curves\n\n";
    text += &defaults(file);
    if !file.peers_missing.is_empty() {
        text += "\n## Peers that were not measured\n\n";
        for missing in &file.peers_missing {
            let _ = writeln!(text, "- {missing}");
        }
    }
    if !file.scaling.is_empty() {
        text += "\n## Time and memory against size\n\n";
        text += &laws(&file.scaling);
    }
    text
}

/// A line a curve: from the coarsest row to the finest, and the default.
fn overview(file: &BenchFile) -> String {
    let mut text = String::from(
        "| stage | curve | knob | coarsest: error, s | default: error, s | finest: error, s |\n\
         |---|---|---|---|---|---|\n",
    );
    for (stage, curve) in curves(file) {
        let cell = |row: Option<&Row>| {
            row.map_or_else(String::new, |row| {
                format!(
                    "{}: {}, {}",
                    knob(row),
                    error(row.error),
                    seconds(row.seconds)
                )
            })
        };
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} |",
            stage.stage,
            title(curve),
            curve.knob,
            cell(curve.rows.first()),
            cell(curve.rows.iter().find(|row| row.default)),
            cell(curve.rows.last()),
        );
    }
    text
}

fn curves(file: &BenchFile) -> impl Iterator<Item = (&StageCurves, &Curve)> {
    let stages = file.stages.iter();
    stages.flat_map(|stage| stage.curves.iter().map(move |curve| (stage, curve)))
}

fn title(curve: &Curve) -> String {
    if !curve.is_peer() {
        curve.name.clone()
    } else {
        format!("**{}**: {}", curve.program, curve.name)
    }
}

fn stage_table(stage: &StageCurves) -> String {
    let mut text = format!(
        "\n## {}\n\nTimed: {}. Error of: {}. Default: {}.\n",
        stage.stage, stage.timed, stage.error_of, stage.default
    );
    for curve in &stage.curves {
        let own = if curve.reference_error > 0.0 {
            format!(" (its own error {})", error(curve.reference_error))
        } else {
            String::new()
        };
        let order = order(curve).map_or_else(String::new, |order| {
            format!(" Observed: error ~ knob^{order:.2}.")
        });
        let _ = write!(
            text,
            "\n{}. Reference: {}{own}.{order}\n\n| {} | items | error | stated | s | quartiles | \
             repeats |\n|---|---|---|---|---|---|---|\n",
            title(curve),
            curve.reference,
            curve.knob
        );
        for row in &curve.rows {
            let stated = row.stated_error.map_or_else(String::new, error);
            let _ = writeln!(
                text,
                "| {} | {} | {} | {stated} | {} | {} to {} | {} |",
                knob(row),
                row.items,
                error(row.error),
                seconds(row.seconds),
                seconds(row.seconds_low),
                seconds(row.seconds_high),
                row.repeats
            );
        }
    }
    for ratio in ratios(stage) {
        let _ = writeln!(text, "\n{ratio}");
    }
    text
}

/// Each peer's time over this program's, both where they are first as exact as the peer at its best
/// or, where that is coarser, as the reference; a sentence a peer.
#[must_use]
pub fn ratios(stage: &StageCurves) -> Vec<String> {
    let mut reported = Vec::new();
    for curve in stage.curves.iter().filter(|c| c.is_peer()) {
        let least = curve.rows.iter().map(|row| row.error);
        let least = least.fold(f64::INFINITY, f64::min);
        let enough = least.max(curve.reference_error).max(1e-15);
        let first = |curve: &Curve, items: Option<u64>| {
            let exact = curve
                .rows
                .iter()
                .filter(|row| row.error <= enough && items.is_none_or(|items| row.items == items));
            exact
                .min_by(|a, b| a.seconds.total_cmp(&b.seconds))
                .cloned()
        };
        let Some(theirs) = first(curve, None) else {
            continue;
        };
        // Of the curve of the same name: problem and amount of work are the same.
        let same = |c: &&Curve| !c.is_peer() && c.name == curve.name;
        let ours = stage.curves.iter().find(same);
        if let Some(ours) = ours.and_then(|ours| first(ours, Some(theirs.items))) {
            reported.push(format!(
                "{}, {} {}: error {} in {}; fluxform: error {} in {}. Ratio of times {} ({} to {} \
                 by the quartiles).",
                curve.program,
                curve.knob,
                knob(&theirs),
                error(theirs.error),
                seconds(theirs.seconds),
                error(ours.error),
                seconds(ours.seconds),
                factor(theirs.seconds / ours.seconds),
                factor(theirs.seconds_low / ours.seconds_high),
                factor(theirs.seconds_high / ours.seconds_low),
            ));
        }
    }
    reported
}

/// The exponent of the error against the knob over the rows that are above the reference's own
/// error and above rounding, where there are three or more.
#[must_use]
pub fn order(curve: &Curve) -> Option<f64> {
    let floor = (10.0 * curve.reference_error).max(1e-13);
    let points: Vec<(f64, f64)> = curve
        .rows
        .iter()
        .filter(|row| row.error > floor && row.error.is_finite() && row.knob > 0.0)
        .map(|row| (row.knob.ln(), row.error.ln()))
        .collect();
    (points.len() >= 3).then(|| super::scaling::line(&points).slope)
}

/// Which row of which curve the default is: the table of the design page.
#[must_use]
pub fn defaults(file: &BenchFile) -> String {
    let mut text = String::from(
        "| stage | knob | default | error there | stated | s | one step coarser | one step finer \
         |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (stage, curve) in curves(file) {
        let Some(at) = curve.rows.iter().position(|row| row.default) else {
            continue;
        };
        let row = &curve.rows[at];
        let beside = |other: Option<&Row>| {
            other.map_or_else(String::new, |other| {
                format!(
                    "error x {}, time x {}",
                    factor(other.error / row.error),
                    factor(other.seconds / row.seconds)
                )
            })
        };
        let _ = writeln!(
            text,
            "| {}: {} | {} | {} | {} | {} | {} | {} | {} |",
            stage.stage,
            curve.name,
            curve.knob,
            knob(row).trim_end_matches('*'),
            error(row.error),
            row.stated_error.map_or_else(String::new, error),
            seconds(row.seconds),
            beside(at.checked_sub(1).map(|k| &curve.rows[k])),
            beside(curve.rows.get(at + 1)),
        );
    }
    text
}

fn laws(laws: &[Law]) -> String {
    let mut text = String::from(
        "Processor time ~ size^slope over the larger half of the sizes, with the slope's standard \
         error; memory is the process's peak beyond an idle one's. The budget is an hour and \
         24 GiB.\n\n| stage | against | sizes | time slope | memory slope | seed's size | at 100 x | \
         at 10,000 x |\n|---|---|---|---|---|---|---|---|\n",
    );
    for law in laws {
        let sizes: Vec<String> = law.sizes.iter().map(|row| plain(row.size)).collect();
        let mut outlook = law.outlook.iter().map(|at| {
            let what = match at.breaks.as_deref() {
                Some(breaks) => format!("breaks: {breaks}"),
                None => "holds".to_owned(),
            };
            let extrapolated = if law.extrapolates(at) {
                ", extrapolated"
            } else {
                ""
            };
            format!(
                "{what} ({}, {}{extrapolated})",
                seconds(at.seconds),
                bytes(at.bytes)
            )
        });
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.2} +- {:.2} | {} | {} | {} |",
            law.stage,
            law.axis,
            sizes.join(", "),
            growth(law),
            law.memory_slope,
            law.memory_slope_error,
            plain(law.seed_size),
            outlook.next().unwrap_or_default(),
            outlook.next().unwrap_or_default(),
        );
    }
    text
}

/// The exponent of the time; of threads how many times faster the most are than one by the clock, where the
/// machine had time for one.
fn growth(law: &Law) -> String {
    let one = law.sizes.iter().find(|row| row.threads == 1);
    match (law.axis.as_str(), one, law.sizes.last()) {
        (THREADS, Some(one), _) if one.elapsed_s > BUSY * one.seconds => {
            "(machine busy)".to_owned()
        }
        (THREADS, Some(one), Some(most)) => format!(
            "{} threads {} times as fast",
            most.threads,
            three(one.elapsed_s / most.elapsed_s)
        ),
        _ => format!("{:.2} +- {:.2}", law.seconds_slope, law.seconds_slope_error),
    }
}

fn knob(row: &Row) -> String {
    let mark = if row.default { "*" } else { "" };
    format!("{}{mark}", plain(row.knob))
}

fn plain(value: f64) -> String {
    if (1e-2..1e7).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

fn error(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else {
        format!("{value:.1e}")
    }
}

/// With the unit that suits.
pub(super) fn seconds(value: f64) -> String {
    let (factor, unit) = match value {
        v if v >= 1.0 || v.is_nan() => (1.0, "s"),
        v if v >= 1e-3 => (1e3, "ms"),
        _ => (1e6, "us"),
    };
    if value * factor >= 1e5 {
        return format!("{value:.1e} s");
    }
    format!("{} {unit}", three(value * factor))
}

fn factor(value: f64) -> String {
    if value.is_finite() && !(1e-3..1e4).contains(&value) {
        format!("{value:.0e}")
    } else {
        three(value)
    }
}

fn bytes(value: f64) -> String {
    let units = [(1e12, "TB"), (1e9, "GB"), (1e6, "MB")];
    let found = units.into_iter().find(|(unit, _)| value >= *unit);
    let (unit, name) = found.unwrap_or((1e3, "kB"));
    if value / unit >= 1e5 {
        return format!("{value:.0e} B");
    }
    format!("{} {name}", three(value / unit))
}

/// Three digits that count.
fn three(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_a_unit() {
        assert_eq!(seconds(0.012345), "12.3 ms");
        assert_eq!(seconds(3.2e-6), "3.20 us");
        assert_eq!(seconds(7.0), "7.00 s");
        assert_eq!(seconds(3.6e9), "3.6e9 s");
        assert_eq!(bytes(13.4e6), "13.4 MB");
        assert_eq!(factor(2.345e7), "2e7");
        assert_eq!(plain(61.0), "61");
        assert_eq!(plain(1e-9), "1e-9");
    }
}
