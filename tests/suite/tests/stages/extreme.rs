//! The stability catalogue: large enough, able to fail, and its fast part passes.

use std::collections::BTreeSet;

use fluxform::progress::Silent;
use fluxform_bench::extreme::{Case, Got, cases, run};
use fluxform_bench::output::catalogue_file;
use fluxform_bench::schema::SCHEMAS;

#[test]
fn there_are_many_cases_with_names_of_their_own() {
    let cases = cases();
    assert!(cases.len() >= 150, "{} cases", cases.len());
    let names: BTreeSet<&str> = cases.iter().map(|case| case.name).collect();
    assert_eq!(names.len(), cases.len(), "a name is there twice");
    for case in &cases {
        assert!(case.bound >= 0.0 && case.bound <= 1.0, "{}", case.name);
        assert!(case.expected.len() > 10, "{}", case.name);
    }
    for family in [
        "geometry",
        "materials",
        "arrays",
        "wires",
        "limits",
        "stiffness",
        "shapes",
        "lambda",
        "units",
    ] {
        let prefix = format!("{family}: ");
        let count = cases.iter().filter(|c| c.name.starts_with(&prefix)).count();
        assert!(count >= 8, "{family}: {count}");
    }
}

/// The slow ones run with `fluxform-bench --extreme` alone.
#[test]
fn every_fast_case_passes() {
    let mut fast = cases();
    fast.retain(|case| case.in_ci);
    let rows = run(&fast, &Silent);
    assert_eq!(rows.len(), fast.len());
    let failed: Vec<String> = rows
        .iter()
        .filter(|row| !row.pass)
        .map(|row| {
            format!(
                "{}: expected {}, got {}; error {:e} of {:e}, {:.1} s",
                row.name, row.expected, row.got, row.error, row.bound, row.seconds
            )
        })
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// `cargo test -p fluxform-bench --test stages extreme -- --ignored --nocapture` prints the whole table.
#[test]
#[ignore = "minutes: the whole catalogue, as `fluxform-bench --extreme` runs it"]
fn the_whole_table() {
    let only = std::env::var("ONLY").unwrap_or_default();
    let mut all = cases();
    all.retain(|case| case.name.contains(&only));
    let rows = run(&all, &Silent);
    for row in &rows {
        println!(
            "{} {:6.2} s {:.1e}/{:.1e} {} | {}",
            if row.pass { "ok  " } else { "FAIL" },
            row.seconds,
            row.error,
            row.bound,
            row.name,
            row.got
        );
    }
    assert!(rows.iter().all(|row| row.pass));
}

fn mutated(change: impl FnOnce(&mut Case)) -> Case {
    let mut case = cases().swap_remove(0);
    change(&mut case);
    case
}

#[test]
fn the_catalogue_can_fail() {
    let rows = run(
        &[
            mutated(|_| ()),
            // The result is off by a rounding at least.
            mutated(|case| case.bound = -1.0),
            mutated(|case| case.seconds = 0.0),
            mutated(|case| {
                case.run = || {
                    Ok(Got {
                        value: "not what was meant".to_owned(),
                        error: 0.1,
                    })
                };
            }),
            mutated(|case| {
                case.run = || {
                    Ok(Got {
                        value: "not a number".to_owned(),
                        error: f64::NAN,
                    })
                };
            }),
            mutated(|case| case.run = || Err("no result".to_owned())),
            mutated(|case| case.run = || panic!("broken {}", 7)),
        ],
        &Silent,
    );
    let passed: Vec<bool> = rows.iter().map(|row| row.pass).collect();
    assert_eq!(passed, [true, false, false, false, false, false, false]);
    assert_eq!(rows[5].got, "no result");
    assert_eq!(rows[6].got, "panic: broken 7");
}

#[test]
fn the_table_has_the_keys_it_must_have() {
    let rows = run(
        &[
            mutated(|_| ()),
            mutated(|case| case.run = || Err("no result".to_owned())),
        ],
        &Silent,
    );
    let json = serde_json::to_value(catalogue_file(&rows, Default::default())).unwrap();
    let keys = |row: usize| -> Vec<&str> {
        let row = json["cases"][row].as_object().unwrap();
        row.keys().map(String::as_str).collect()
    };
    let mut target = [
        "name", "expected", "got", "error", "bound", "seconds", "pass",
    ];
    target.sort_unstable();
    let mut found = keys(0);
    found.sort_unstable();
    assert_eq!(found, target);
    let schema = SCHEMAS
        .iter()
        .find(|(name, _)| *name == "extreme.schema.json");
    let schema = serde_json::from_str(schema.unwrap().1).unwrap();
    let validator = jsonschema::validator_for(&schema).unwrap();
    let faults: Vec<_> = validator.iter_errors(&json).collect();
    assert!(faults.is_empty(), "{faults:?}");
    assert!(json["cases"][0]["error"].is_number());
    assert!(json["cases"][1]["error"].is_null());
}
