//! Every value that the two records of a bundle hold, changed one after another with the checksums
//! made again: `verify` notices each, so that a key added to a record cannot escape it. The bundle
//! claims another platform: on its own, `verify` compares every byte.

use std::fs;
use std::path::Path;

use fluxform::bundle::artefact::sha256_hex;
use fluxform::bundle::json::to_json;
use fluxform::bundle::manifest::Manifest;
use fluxform::bundle::seal::sealed;
use fluxform::commands::verify::Verifier;
use fluxform_testing::needs::Trial;
use fluxform_testing::trials;
use serde_json::{Map, Value, json};

use crate::forgeries::{calibrated, passes};

/// What fills every part of the records: vectors, uncertainties, heat, a coupled array.
const DESIGN: &str = "name = \"small\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\n\
    length_mm = 70\n[wire]\ndiameter_mm = 0.7\n[core]\nrelative_permeability = 1000\n\
    [array]\nrows = 1\ncolumns = 2\npitch_mm = 50\n[supply]\ncurrent_max_a = 2\n\
    current_min_a = -2\ntotal_current_max_a = 3\nvoltage_v = 36\n[uncertainty]\nsensor_mm = 2\n\
    tilt_deg = 5\nheat_c = 10\ndriver_percent = 1\n[cooling]\nambient_c = 25\nheating_s = 45\n\
    [workspace]\nx_mm = [-40, 40, 6]\ny_mm = [-30, 30, 5]\nz_mm = [20, 60, 9]\n";
const SHAPE: &str = "name = \"slope\"\nprimitive = \"wedge\"\nlow_mm = 31\nhigh_mm = 43\n\
    force = \"normal\"\n[points]\nx_mm = [-30, 30, 4]\ny_mm = [-20, 20, 3]\n";

pub fn trials() -> Vec<Trial> {
    trials! { None => [every_value_of_the_records_is_checked] }
}

/// A value that is not `value`, of the same kind.
fn other(value: &Value) -> Value {
    match value {
        Value::Null => json!(1.5),
        Value::Bool(given) => json!(!given),
        Value::Number(number) => number.as_u64().map_or_else(
            || json!(number.as_f64().unwrap_or(0.0) * 1000.0 + 0.7),
            |n| json!(n + 1),
        ),
        Value::String(text) => json!(format!("{text}, almost")),
        Value::Array(_) => json!([]),
        Value::Object(_) => json!({}),
    }
}

/// The changes of `value`, each with its place and the whole changed value. Of a list the first and
/// the last entry are changed, and the last is removed.
fn changes(value: &Value, place: &str) -> Vec<(String, Value)> {
    let mut all = Vec::new();
    match value {
        Value::Object(of) => {
            for (key, part) in of {
                let inside = changes(part, &format!("{place}/{key}"));
                all.extend(inside.into_iter().map(|(at, changed)| {
                    let mut whole: Map<String, Value> = of.clone();
                    whole.insert(key.clone(), changed);
                    (at, Value::Object(whole))
                }));
                let mut less = of.clone();
                less.remove(key);
                all.push((format!("{place}/{key} removed"), Value::Object(less)));
            }
        }
        Value::Array(of) if !of.is_empty() => {
            let mut chosen = vec![0, of.len() - 1];
            chosen.dedup();
            for at in chosen {
                let inside = changes(&of[at], &format!("{place}/{at}"));
                all.extend(inside.into_iter().map(|(at_place, changed)| {
                    let mut whole = of.clone();
                    whole[at] = changed;
                    (at_place, Value::Array(whole))
                }));
            }
            let shorter = of[..of.len() - 1].to_vec();
            all.push((format!("{place} shortened"), Value::Array(shorter)));
        }
        _ => all.push((place.to_owned(), other(value))),
    }
    all
}

/// Writes `lambda.json` and `manifest.json` with fitting sizes, digests and seal.
fn write(folder: &Path, lambda: &Value, mut manifest: Value) {
    let bytes = to_json(lambda).unwrap();
    let files = manifest["files"].as_array_mut();
    for file in files.into_iter().flatten() {
        if file["path"] == "lambda.json" {
            file["bytes"] = json!(bytes.len());
            file["sha256"] = json!(sha256_hex(&bytes));
        }
    }
    fs::write(folder.join("lambda.json"), bytes).unwrap();
    // The digest of the run's options is made again too, where they can still be read.
    if let Ok(typed) = serde_json::from_value::<Manifest>(manifest.clone())
        && let Some(made_with) = typed.made_with
    {
        manifest["made_with"]["sha256"] = json!(made_with.digest());
    }
    if let Some(of) = manifest.as_object_mut() {
        of.remove("record_sha256");
    }
    fs::write(
        folder.join("manifest.json"),
        sealed(to_json(&manifest).unwrap()),
    )
    .unwrap();
}

fn every_value_of_the_records_is_checked() {
    let folder = tempfile::tempdir().unwrap();
    let bundle = calibrated(folder.path(), DESIGN, SHAPE, false);
    let record = |name: &str| -> Value {
        serde_json::from_slice(&fs::read(bundle.join(name)).unwrap()).unwrap()
    };
    let (lambda, mut manifest) = (record("lambda.json"), record("manifest.json"));
    manifest["made_with"]["arithmetic"] = json!("pdp-11 unix, baseline");
    let mut verifier = Verifier::default();
    write(&bundle, &lambda, manifest.clone());
    assert!(passes(&mut verifier, &bundle).0, "nothing is changed");
    let (mut edits, mut passed) = (0, Vec::new());
    let mut attempt = |place: &str, lambda: &Value, manifest: &Value| {
        write(&bundle, lambda, manifest.clone());
        edits += 1;
        if passes(&mut verifier, &bundle).0 {
            passed.push(place.to_owned());
        }
    };
    for (place, changed) in changes(&lambda, "lambda.json") {
        attempt(&place, &changed, &manifest);
    }
    for (place, changed) in changes(&manifest, "manifest.json") {
        // The seal is made again.
        if !place.contains("record_sha256") {
            attempt(&place, &lambda, &changed);
        }
    }
    // Options that no run can have are stated as unchecked; removed ones have a default.
    passed.retain(|place| !place.starts_with("manifest.json/made_with"));
    eprintln!("{edits} changed values, {} missed", passed.len());
    assert!(passed.is_empty(), "{passed:#?}");
}
