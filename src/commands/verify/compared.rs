//! A bundle against the one that its inputs give.
//!
//! On the same platform with the same program every byte follows from the inputs, and the digests
//! in the manifest stand for the bytes of all files. Elsewhere the last bits of numbers differ:
//! then numbers are compared within what their errors can do to them, and pages and plots, whose
//! every digit follows from those bits, cannot be compared. Another program, which an older schema
//! betrays, words its texts differently, lacks entries, and finds other pieces of a path where
//! forces differ within their errors: what both have is compared, the rest is named as not checked,
//! and a bundle with such parts passes only where the user accepts that.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use super::{Check, check};
use crate::bundle::artefact::{
    FLUXFORM_VERSION, FileEntry, SCHEMA_VERSION, arithmetic, sha256_hex,
};
use crate::bundle::load::Bundle;
use crate::bundle::npz::{Array, PASSIVE};
use crate::bundle::rendering::ROBUST;
use crate::bundle::seal::to_record;
use crate::bundle::table::PointRow;
use crate::commands::calibrate::again::Expected;
use crate::commands::map::PASSIVE_STAGE;

/// Differences that are named.
const NAMED: usize = 6;
/// Numbers that a difference in the last bits moves by at most this, relative to the largest of
/// their list, beyond what the errors of forces and map move them.
const ROUNDING: f64 = 1e-7;
/// How much a result may move with the stated errors of forces and map.
const MOVES: f64 = 10.0;
/// The stages that results follow from.
const RESULTS: [&str; 4] = ["forces", "map", "inductances", "passive_force"];
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

/// Statement of a bundle on the program that made it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum MadeBy {
    /// This program, with this platform's arithmetic: it writes the same bytes.
    Same,
    /// This program elsewhere: it gives the same numbers but for the last bits.
    Elsewhere,
    /// One of another version or schema.
    Another,
}

impl MadeBy {
    fn of(bundle: &Bundle) -> Self {
        let manifest = &bundle.manifest;
        let versions = (
            manifest.schema_version.as_str(),
            manifest.fluxform_version.as_str(),
        );
        match &manifest.made_with {
            Some(made) if versions == (SCHEMA_VERSION, FLUXFORM_VERSION) => {
                if made.arithmetic == arithmetic() {
                    Self::Same
                } else {
                    Self::Elsewhere
                }
            }
            Some(_) | None => Self::Another,
        }
    }
}

/// Keys of sentences, which every program words as it likes.
const WORDED: [&str; 5] = ["method", "relative_to", "what", "why", "definition"];
/// Lists in which every program states its own reasons.
const LISTED: [&str; 2] = ["left_out", "warnings"];
/// Places in a list that equal errors decide.
const CHOSEN: [&str; 1] = ["point"];

/// The platform that a bundle names.
pub(super) fn made_on(bundle: &Bundle) -> &str {
    let made_with = bundle.manifest.made_with.as_ref();
    made_with.map_or("a platform that it does not name", |made| &made.arithmetic)
}

/// Compares all that `bundle` holds with `expected`.
pub(super) fn compare(bundle: &Bundle, expected: &Expected) -> Compared {
    let made_by = MadeBy::of(bundle);
    let manifests = [&bundle.manifest, &expected.manifest].map(serde_json::to_value);
    let [Ok(mut stored), Ok(mut again)] = manifests else {
        let how = "manifest.json cannot be written as it is".to_owned();
        return Compared {
            check: check("recomputed", 1.0, 0.0, how),
            unchecked: Vec::new(),
            exact: made_by == MadeBy::Same,
        };
    };
    if made_by == MadeBy::Same {
        return exactly(bundle, expected, [stored, again]);
    }
    let mut faults = Vec::new();
    let tolerance = tolerance(expected, &RESULTS);
    let mut unchecked = vec![format!(
        "the last bits of numbers: made by fluxform {} on {}; verify there",
        bundle.manifest.fluxform_version,
        made_on(bundle)
    )];
    let same_list = made_by != MadeBy::Another;
    kept_and_pages(bundle, expected, same_list, &mut faults, &mut unchecked);
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
    let mut differences = Differences::new(made_by, Some(tolerance));
    differences.add("manifest.json", &stored, &again);
    let lambdas = [&bundle.lambda, &expected.lambda].map(serde_json::to_value);
    if let [Ok(mut stored), Ok(mut again)] = lambdas {
        for side in [&mut stored, &mut again] {
            for key in ["schema_version", "fluxform_version"] {
                side[key] = Value::Null;
            }
        }
        differences.add("lambda.json", &stored, &again);
    }
    differences.add_map(&bundle.map.arrays(), expected);
    faults.extend(differences.faults);
    if !differences.unchecked.is_empty() {
        let named = differences.unchecked.join(", ");
        unchecked.push(format!(
            "entries that another program words or has otherwise: {named}"
        ));
    }
    if !same_points(&bundle.points, &expected.points) {
        faults.push("points.csv".to_owned());
    }
    let how = "numbers and words computed again from the inputs; made by another program or on \
               another platform, so not byte for byte";
    Compared {
        check: named("recomputed", &faults, how),
        unchecked,
        exact: false,
    }
}

/// Every byte; `manifests` are the bundle's and the expected one.
fn exactly(bundle: &Bundle, expected: &Expected, manifests: [Value; 2]) -> Compared {
    let mut faults = Vec::new();
    differing_files(bundle, expected, &mut faults);
    let [stored, again] = manifests.map(|mut side| {
        side["files"] = Value::Null;
        side
    });
    let mut differences = Differences::new(MadeBy::Same, None);
    differences.add("manifest.json", &stored, &again);
    faults.extend(differences.faults);
    // Two numbers may be equal and not the same: 0.0 and -0.0.
    let bytes = to_record(&expected.manifest).map(|text| sha256_hex(&text));
    if faults.is_empty() && bytes.as_ref() != Ok(&bundle.manifest_sha256) {
        faults.push("manifest.json is not written as this program writes it".to_owned());
    }
    let how = "every byte of every file computed again from the inputs";
    Compared {
        check: named("recomputed", &faults, how),
        unchecked: Vec::new(),
        exact: true,
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
    let by_name = |files: &'_ [FileEntry]| -> BTreeMap<String, String> {
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

/// Of files that are copies the bytes, of pages the names. Where not the `same_list` is expected,
/// files that one side has alone are not checked.
fn kept_and_pages(
    bundle: &Bundle,
    expected: &Expected,
    same_list: bool,
    faults: &mut Vec<String>,
    unchecked: &mut Vec<String>,
) {
    let (stored, again) = (&bundle.manifest.files, &expected.manifest.files);
    let names = |files: &[FileEntry]| -> Vec<String> {
        files.iter().map(|file| file.path.clone()).collect()
    };
    if same_list && names(stored) != names(again) {
        faults.push("the list of files".to_owned());
    }
    let mut pages = Vec::new();
    for file in stored {
        let copy = expected.copies.contains(&file.path);
        let page = file.path.ends_with(".html")
            || ["plots/", "vtk/"]
                .iter()
                .any(|folder| file.path.starts_with(folder));
        let other = again.iter().find(|other| other.path == file.path);
        if copy && other != Some(file) {
            faults.push(file.path.clone());
        } else if (page || other.is_none()) && other != Some(file) {
            pages.push(file.path.as_str());
        }
    }
    if !pages.is_empty() {
        unchecked.push(format!(
            "{}: made by another program or on another platform",
            pages.join(", ")
        ));
    }
}

/// The stages that an array of `map.npz` follows from: fields by coil and height, the pull by height, what else a
/// runtime needs.
fn stages(array: &Array) -> &'static [&'static str] {
    if array.name == PASSIVE {
        &[PASSIVE_STAGE]
    } else if array.shape.len() >= 4 {
        &["map"]
    } else {
        &RESULTS
    }
}

/// Whether no number differs by more than `tolerance` times the largest beside it: of fields at the same height, of
/// settings alone, else of the array.
fn same_array(stored: &Array, again: &Array, tolerance: f64) -> bool {
    let (block, levels) = match again.shape[..] {
        [_, nz, ..] if again.shape.len() >= 4 => (again.shape[2..].iter().product(), nz),
        _ if again.name == ROBUST => (1, again.values.len()),
        _ => (again.values.len(), 1),
    };
    let block = block.max(1);
    let mut largest = vec![0.0_f64; levels];
    for (at, values) in again.values.chunks(block).enumerate() {
        let most = &mut largest[at % levels];
        *most = values.iter().fold(*most, |most, b| most.max(b.abs()));
    }
    let blocks = stored.values.chunks(block).zip(again.values.chunks(block));
    stored.shape == again.shape
        && blocks.enumerate().all(|(at, (stored, again))| {
            let most = tolerance * largest[at % levels];
            stored.iter().zip(again).all(|(a, b)| (a - b).abs() <= most)
        })
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

/// How far numbers that follow from these stages may be from those computed again, relative; of this program's own
/// bounds.
fn tolerance(expected: &Expected, stages: &[&str]) -> f64 {
    let stated = stages
        .iter()
        .filter_map(|name| expected.manifest.accuracy.get(*name));
    let largest = stated.fold(0.0_f64, |most, stage| most.max(stage.estimate));
    (MOVES * largest).max(ROUNDING)
}

/// The places at which two documents differ.
struct Differences {
    made_by: MadeBy,
    /// Numbers may differ by it, relative to the largest beside them; `None`: not at all.
    tolerance: Option<f64>,
    faults: Vec<String>,
    /// Entries that cannot be compared with those of another program.
    unchecked: Vec<String>,
}

impl Differences {
    fn new(made_by: MadeBy, tolerance: Option<f64>) -> Self {
        Self {
            made_by,
            tolerance,
            faults: Vec::new(),
            unchecked: Vec::new(),
        }
    }

    /// The arrays of `map.npz`.
    fn add_map(&mut self, stored: &[Array], expected: &Expected) {
        let again = &expected.map[..];
        let names = stored.iter().chain(again).map(|array| array.name);
        for name in names.collect::<BTreeSet<&str>>() {
            let at = format!("map.npz {name}");
            let sides = [stored, again].map(|side| side.iter().find(|array| array.name == name));
            match sides {
                [Some(a), Some(b)] if same_array(a, b, tolerance(expected, stages(b))) => {}
                [Some(_), Some(_)] => self.faults.push(at),
                _ if self.made_by == MadeBy::Another => self.unchecked.push(at),
                _ => self.faults.push(at),
            }
        }
    }

    fn add(&mut self, at: &str, stored: &Value, again: &Value) {
        if stored == again {
            return;
        }
        let key = at.rsplit(' ').next().unwrap_or(at);
        let key = key.split('[').next().unwrap_or(key);
        let another = self.made_by == MadeBy::Another;
        if another && [&WORDED[..], &LISTED, &CHOSEN].concat().contains(&key) {
            self.unchecked.push(at.to_owned());
            return;
        }
        match (stored, again) {
            (Value::Object(a), Value::Object(b)) if another || a.keys().eq(b.keys()) => {
                let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
                for key in keys {
                    let at = format!("{at} {key}");
                    match (a.get(key), b.get(key)) {
                        (Some(a), Some(b)) => self.add(&at, a, b),
                        _ => self.unchecked.push(at),
                    }
                }
            }
            (Value::Array(a), Value::Array(b)) if a.len() == b.len() && !numbers(a) => {
                for (place, (a, b)) in a.iter().zip(b).enumerate() {
                    self.add(&format!("{at}[{place}]"), a, b);
                }
            }
            // Pieces of a path: errors of the forces decide which of two limits binds first.
            (Value::Array(a), Value::Array(b)) if another && objects(a) && objects(b) => {
                self.unchecked.push(at.to_owned());
            }
            _ => {
                let estimate = ESTIMATED.contains(&key);
                let near = |tolerance| near(stored, again, tolerance, estimate);
                if self.tolerance.is_some_and(near) {
                    return;
                }
                // Another program estimates its errors in its own way.
                let claimed = another && estimate;
                let named = if claimed {
                    &mut self.unchecked
                } else {
                    &mut self.faults
                };
                named.push(at.to_owned());
            }
        }
    }
}

/// Whether a list holds objects alone.
fn objects(list: &[Value]) -> bool {
    list.iter().all(Value::is_object)
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
