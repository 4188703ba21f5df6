//! Imports run one way.

use std::collections::BTreeSet;

use crate::source::{Source, sources};

/// Every room with the rooms it may import; each imports only rooms listed before it.
const ROOMS: &[(&str, &[&str])] = &[
    ("units", &[]),
    ("progress", &[]),
    ("accuracy", &[]),
    ("numerics", &["units", "progress", "accuracy"]),
    ("design", &["units", "numerics"]),
    ("field", &["units", "progress", "numerics"]),
    (
        "coil",
        &[
            "units", "progress", "accuracy", "numerics", "design", "field",
        ],
    ),
    (
        "map",
        &["units", "progress", "accuracy", "numerics", "field"],
    ),
    (
        "shape",
        &["units", "progress", "accuracy", "numerics", "design"],
    ),
    ("lambda", &["units", "progress", "accuracy", "numerics"]),
    ("bundle", &["units", "progress", "accuracy", "numerics"]),
    ("plot", &["progress"]),
    ("report", &["units", "progress", "plot"]),
    (
        "job",
        &[
            "units", "progress", "accuracy", "numerics", "design", "field", "coil", "map", "shape",
            "lambda", "bundle", "plot", "report",
        ],
    ),
    (
        "bench",
        &[
            "units", "progress", "accuracy", "numerics", "design", "field", "coil", "map", "shape",
            "lambda", "bundle", "plot", "report", "job",
        ],
    ),
    (
        "cli",
        &[
            "units", "progress", "accuracy", "numerics", "design", "shape", "bundle", "job",
            "bench",
        ],
    ),
    ("main", &["cli"]),
    ("lib", &[]),
];

/// Imports against the table that are not mended yet: (file under `src`, room). The list may
/// only shrink.
const EXCEPTIONS: &[(&str, &str)] = &[
    // Types of requests and results that `job` does not name itself.
    ("cli/commands/evaluate.rs", "coil"),
    ("cli/commands/lambda.rs", "lambda"),
    ("cli/commands/map.rs", "map"),
];

fn allowed(room: &str) -> &'static [&'static str] {
    let entry = ROOMS.iter().find(|(name, _)| *name == room);
    entry
        .unwrap_or_else(|| panic!("src/{room} is in no row of ROOMS"))
        .1
}

/// The rooms a file imports; the binary sees the library as `fluxform`.
fn imported(source: &Source) -> BTreeSet<String> {
    let mut rooms: BTreeSet<String> = source
        .crate_paths()
        .into_iter()
        .map(|path| path.into_iter().next().unwrap())
        .collect();
    for window in source.tokens.windows(3) {
        if window[0] == "fluxform" && window[1] == "::" {
            rooms.insert(window[2].clone());
        }
    }
    rooms.remove(source.room());
    rooms
}

#[test]
fn the_table_runs_one_way_and_names_every_room() {
    for (at, (room, allowed)) in ROOMS.iter().enumerate() {
        for other in *allowed {
            assert!(
                ROOMS[..at].iter().any(|(name, _)| name == other),
                "{room} may not import {other}: it stands above it"
            );
        }
    }
    let rooms: BTreeSet<String> = sources().iter().map(|s| s.room().to_owned()).collect();
    let named: BTreeSet<String> = ROOMS.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(rooms, named, "rooms under src and rooms in the table");
}

#[test]
fn imports_run_one_way() {
    let mut faults = Vec::new();
    for source in sources() {
        let may = allowed(source.room());
        for room in imported(&source) {
            let excepted = EXCEPTIONS.contains(&(source.path.as_str(), room.as_str()));
            if !may.contains(&room.as_str()) && !excepted {
                faults.push(format!("src/{} imports {room}", source.path));
            }
        }
    }
    assert!(
        faults.is_empty(),
        "against the table in {}; move what is needed into a lower room:\n{}",
        file!(),
        faults.join("\n")
    );
}

#[test]
fn every_exception_is_still_needed() {
    let sources = sources();
    for (path, room) in EXCEPTIONS {
        let used = sources
            .iter()
            .any(|s| s.path == *path && imported(s).contains(*room));
        let needed = used && !allowed(path.split('/').next().unwrap()).contains(room);
        assert!(
            needed,
            "({path:?}, {room:?}) is no longer needed: delete it"
        );
    }
}

#[test]
fn an_import_against_the_table_is_seen() {
    let upward = Source::new(
        "field/ring.rs",
        "fn f() -> f64 { crate::coil::circuit::g() }",
    );
    assert_eq!(imported(&upward), BTreeSet::from(["coil".to_owned()]));
    assert!(!allowed("field").contains(&"coil"));
    let glob = Source::new("shape/stl/mod.rs", "use super::super::map::*;");
    assert_eq!(imported(&glob), BTreeSet::from(["map".to_owned()]));
    let binary = Source::new("main.rs", "fn main() { fluxform::job::run() }");
    assert_eq!(imported(&binary), BTreeSet::from(["job".to_owned()]));
}
