//! A bundle against the one that its inputs give.
//!
//! On the same platform with the same program every byte follows from the inputs, and the digests
//! in the manifest stand for the bytes of all files. Elsewhere the last bits of numbers differ:
//! then numbers are compared within what their errors can do to them, and pages and plots, whose
//! every digit follows from those bits, cannot be compared.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::{Check, check};
use crate::bundle::artefact::{FLUXFORM_VERSION, SCHEMA_VERSION, arithmetic, sha256_hex};
use crate::bundle::load::Bundle;
use crate::bundle::seal::to_record;
use crate::bundle::table::PointRow;
use crate::commands::calibrate::again::Expected;
use crate::commands::calibrate::{CURVE_FILE, DESIGN_FILE};

/// Differences that are named.
const NAMED: usize = 6;
/// Numbers that a difference in the last bits moves by at most this, relative to the largest of
/// their list, beyond what the errors of forces and map move them.
const ROUNDING: f64 = 1e-7;
/// How much a result may move with the stated errors of forces and map.
const MOVES: f64 = 10.0;
/// Estimates of errors that are dominated by rounding differ by at most this factor.
const ESTIMATES: f64 = 8.0;
/// Keys of such estimates.
const ESTIMATED: [&str; 5] = [
    "estimate",
    "largest_error",
    "error_cost",
    "duality_gap_n2",
    "gap_n",
];
/// Estimates below this are rounding.
const NOTHING: f64 = 1e-9;

/// The result of the comparison.
pub(super) struct Compared {
    pub(super) check: Check,
    /// Parts that could not be compared.
    pub(super) unchecked: Vec<String>,
    /// Whether every byte was compared.
    pub(super) exact: bool,
}

/// Whether this program writes the same bytes as the one that the bundle names.
pub(super) fn same_program(bundle: &Bundle) -> bool {
    let manifest = &bundle.manifest;
    let made_with = manifest.made_with.as_ref();
    manifest.schema_version == SCHEMA_VERSION
        && manifest.fluxform_version == FLUXFORM_VERSION
        && made_with.is_some_and(|made| made.arithmetic == arithmetic())
}

/// The platform that a bundle names.
pub(super) fn made_on(bundle: &Bundle) -> &str {
    let made_with = bundle.manifest.made_with.as_ref();
    made_with.map_or("a platform that it does not name", |made| &made.arithmetic)
}

/// Compares all that `bundle` holds with `expected`.
pub(super) fn compare(bundle: &Bundle, expected: &Expected) -> Compared {
    let exact = same_program(bundle);
    let mut faults = Vec::new();
    let manifests = [&bundle.manifest, &expected.manifest].map(serde_json::to_value);
    let [Ok(mut stored), Ok(mut again)] = manifests else {
        let how = "manifest.json cannot be written as it is".to_owned();
        return Compared {
            check: check("recomputed", 1.0, 0.0, how),
            unchecked: Vec::new(),
            exact,
        };
    };
    if exact {
        differing_files(bundle, expected, &mut faults);
        for side in [&mut stored, &mut again] {
            side["files"] = Value::Null;
        }
        differing("manifest.json", &stored, &again, None, &mut faults);
        // Two numbers may be equal and not the same: 0.0 and -0.0.
        let bytes = to_record(&expected.manifest).map(|text| sha256_hex(&text));
        if faults.is_empty() && bytes.as_ref() != Ok(&bundle.manifest_sha256) {
            faults.push("manifest.json is not written as this program writes it".to_owned());
        }
        let how = "every byte of every file computed again from the inputs";
        return Compared {
            check: named("recomputed", &faults, how),
            unchecked: Vec::new(),
            exact,
        };
    }
    let tolerance = tolerance(expected);
    let mut unchecked = vec![format!(
        "the last bits of numbers: made by fluxform {} on {}; verify there",
        bundle.manifest.fluxform_version,
        made_on(bundle)
    )];
    kept_and_pages(bundle, expected, &mut faults, &mut unchecked);
    for side in [&mut stored, &mut again] {
        for key in ["files", "schema_version", "fluxform_version"] {
            side[key] = Value::Null;
        }
        if let Some(made_with) = side.get_mut("made_with") {
            // Criterion and difference are compared in `lambda.json`; older bundles have them there alone.
            for key in ["arithmetic", "sha256", "criterion", "jnd", "at_n_per_m"] {
                made_with[key] = Value::Null;
            }
        }
    }
    differing(
        "manifest.json",
        &stored,
        &again,
        Some(tolerance),
        &mut faults,
    );
    let lambdas = [&bundle.lambda, &expected.lambda].map(serde_json::to_value);
    if let [Ok(mut stored), Ok(mut again)] = lambdas {
        for side in [&mut stored, &mut again] {
            for key in ["schema_version", "fluxform_version"] {
                side[key] = Value::Null;
            }
        }
        differing("lambda.json", &stored, &again, Some(tolerance), &mut faults);
    }
    if !same_points(&bundle.points, &expected.points) {
        faults.push("points.csv".to_owned());
    }
    let how = "numbers and words computed again from the inputs; made by another program or on \
               another platform, so not byte for byte";
    Compared {
        check: named("recomputed", &faults, how),
        unchecked,
        exact,
    }
}

fn named(name: &'static str, faults: &[String], how: &str) -> Check {
    let mut stored = how.to_owned();
    if !faults.is_empty() {
        let first: Vec<&str> = faults.iter().take(NAMED).map(String::as_str).collect();
        stored = format!("not what the inputs give: {}", first.join(", "));
        if faults.len() > NAMED {
            stored.push_str(&format!(" and {} more", faults.len() - NAMED));
        }
    }
    check(name, faults.len() as f64, 0.0, stored)
}

/// Listed files with another name, place, size or digest.
fn differing_files(bundle: &Bundle, expected: &Expected, faults: &mut Vec<String>) {
    let (stored, again) = (&bundle.manifest.files, &expected.manifest.files);
    if stored == again {
        return;
    }
    let before = faults.len();
    let by_name = |files: &'_ [crate::bundle::artefact::FileEntry]| -> BTreeMap<String, String> {
        let entries = files.iter();
        entries
            .map(|file| (file.path.clone(), file.sha256.clone()))
            .collect()
    };
    let (stored, again) = (by_name(stored), by_name(again));
    let names: BTreeSet<&String> = stored.keys().chain(again.keys()).collect();
    for name in names {
        match (stored.get(name), again.get(name)) {
            (Some(a), Some(b)) if a == b => {}
            (Some(_), Some(_)) => faults.push(name.clone()),
            (Some(_), None) => faults.push(format!("{name}, which is none of its files")),
            (None, _) => faults.push(format!("{name}, which is not listed")),
        }
    }
    if faults.len() == before {
        faults.push("the order of files".to_owned());
    }
}

/// Of files that are copies the bytes, of pages the names.
fn kept_and_pages(
    bundle: &Bundle,
    expected: &Expected,
    faults: &mut Vec<String>,
    unchecked: &mut Vec<String>,
) {
    let stored: Vec<&str> = bundle
        .manifest
        .files
        .iter()
        .map(|f| f.path.as_str())
        .collect();
    let again = expected.manifest.files.iter();
    let again: Vec<&str> = again.map(|f| f.path.as_str()).collect();
    if stored != again {
        faults.push("the list of files".to_owned());
    }
    for (a, b) in bundle.manifest.files.iter().zip(&expected.manifest.files) {
        let copy = [DESIGN_FILE, CURVE_FILE].contains(&a.path.as_str());
        let page = a.path.ends_with(".html") || a.path.starts_with("plots/");
        if copy && a != b {
            faults.push(a.path.clone());
        } else if page && a != b {
            unchecked.push(format!(
                "{}: made by another program or on another platform",
                a.path
            ));
        }
    }
}

fn same_points(stored: &[PointRow], again: &[PointRow]) -> bool {
    let near = |a: f64, b: f64| (a - b).abs() <= ROUNDING * a.abs().max(b.abs()).max(1e-3);
    stored.len() == again.len()
        && stored.iter().zip(again).all(|(a, b)| {
            let parts = a.normal.iter().zip(&b.normal);
            near(a.x_m, b.x_m)
                && near(a.y_m, b.y_m)
                && near(a.height_m, b.height_m)
                && parts.clone().all(|(a, b)| (a - b).abs() <= ROUNDING)
        })
}

/// How far numbers may be from those computed again, relative; of this program's own bounds.
fn tolerance(expected: &Expected) -> f64 {
    let stage = |name: &str| {
        let stage = expected.manifest.accuracy.get(name);
        stage.map_or(0.0, |stage| stage.estimate)
    };
    let largest = ["forces", "map", "inductances", "passive_force"]
        .map(stage)
        .into_iter()
        .fold(0.0, f64::max);
    (MOVES * largest).max(ROUNDING)
}

/// Names the places at which two documents differ; numbers by no more than `tolerance` of the
/// largest beside them, or not at all.
fn differing(
    at: &str,
    stored: &Value,
    again: &Value,
    tolerance: Option<f64>,
    faults: &mut Vec<String>,
) {
    if stored == again {
        return;
    }
    match (stored, again) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            for (key, value) in a {
                differing(&format!("{at} {key}"), value, &b[key], tolerance, faults);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() && !numbers(a) => {
            for (place, (a, b)) in a.iter().zip(b).enumerate() {
                differing(&format!("{at}[{place}]"), a, b, tolerance, faults);
            }
        }
        _ => {
            let key = at.rsplit(' ').next().unwrap_or(at);
            let estimate = ESTIMATED.contains(&key);
            let close = tolerance.is_some_and(|tolerance| near(stored, again, tolerance, estimate));
            if !close {
                faults.push(at.to_owned());
            }
        }
    }
}

/// Whether a list holds numbers alone.
fn numbers(list: &[Value]) -> bool {
    list.iter().all(Value::is_number)
}

/// Whether two numbers, or two lists of numbers, are the same but for rounding.
fn near(stored: &Value, again: &Value, tolerance: f64, estimate: bool) -> bool {
    let list = |value: &Value| -> Option<Vec<f64>> {
        match value {
            Value::Array(parts) => parts.iter().map(Value::as_f64).collect(),
            Value::Number(number) => Some(vec![number.as_f64()?]),
            Value::Null | Value::Bool(_) | Value::String(_) | Value::Object(_) => None,
        }
    };
    // Counts and indices are the same or not.
    if stored.is_u64() || stored.is_i64() || again.is_u64() || again.is_i64() {
        return false;
    }
    let (Some(a), Some(b)) = (list(stored), list(again)) else {
        return false;
    };
    let largest = b.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    a.len() == b.len()
        && a.iter().zip(&b).all(|(a, b)| {
            let both_small = a.abs().max(b.abs()) <= NOTHING;
            let factor = a.abs() <= ESTIMATES * b.abs() && b.abs() <= ESTIMATES * a.abs();
            let close = (a - b).abs() <= tolerance * largest;
            close || (estimate && (both_small || factor))
        })
}
