//! Imports run one way: among members Cargo holds it, inside the root package this table; and no
//! module of a room imports back to one that imports it.

use std::collections::{BTreeMap, BTreeSet};

use crate::source::{Source, members, sources};

/// The root package's rooms with those of them that they may import.
const ROOMS: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("scene", &["error"]),
    ("cli", &["error", "scene"]),
    ("commands", &["error", "scene", "cli"]),
    ("main", &["commands"]),
    ("lib", &["error", "scene", "cli", "commands"]),
];

/// Modules of one room that import each other, not mended yet: each group sorted, with `::`. The
/// list may only shrink.
const CIRCLES: &[&[&str]] = &[];

fn allowed(room: &str) -> &'static [&'static str] {
    let entry = ROOMS.iter().find(|(name, _)| *name == room);
    entry
        .unwrap_or_else(|| panic!("src/{room} is neither a member nor in a row of ROOMS"))
        .1
}

/// The rooms of the root package that a file imports; the binary sees the library as `fluxform`.
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
    rooms.retain(|room| room != source.room() && ROOMS.iter().any(|(name, _)| name == room));
    rooms
}

#[test]
fn every_room_is_a_member_or_in_the_table() {
    let rooms: BTreeSet<String> = sources().iter().map(|s| s.room().to_owned()).collect();
    let mut named: BTreeSet<String> = ROOMS.iter().map(|(name, _)| (*name).to_owned()).collect();
    named.extend(members());
    assert_eq!(
        rooms, named,
        "rooms under src, members and rooms in the table"
    );
}

#[test]
fn imports_run_one_way() {
    let members = members();
    let mut faults = Vec::new();
    for source in sources() {
        if members.contains(source.room()) {
            continue;
        }
        let may = allowed(source.room());
        for room in imported(&source) {
            if !may.contains(&room.as_str()) {
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

/// Whether a file of `commands` takes arguments or makes text; the others only compute.
fn talks(path: &str) -> bool {
    let endings = ["command.rs", "text.rs"];
    let whole = [
        "commands/mod.rs",
        "commands/man.rs",
        "commands/completions.rs",
    ];
    whole.contains(&path) || endings.iter().any(|ending| path.ends_with(ending))
}

#[test]
fn files_that_compute_know_no_command_line() {
    let mut faults = Vec::new();
    for source in sources() {
        let computes = source.path.starts_with("commands/") && !talks(&source.path);
        if computes && imported(&source).contains("cli") {
            faults.push(source.path.clone());
        }
    }
    assert!(faults.is_empty(), "{} import cli", faults.join(", "));
}

#[test]
fn an_import_against_the_table_is_seen() {
    let upward = Source::new(
        "scene/steel.rs",
        "fn f() -> f64 { crate::cli::printer::g() + crate::numerics::h() }",
    );
    assert_eq!(imported(&upward), BTreeSet::from(["cli".to_owned()]));
    assert!(!allowed("scene").contains(&"cli"));
    let glob = Source::new("commands/probe/mod.rs", "use super::super::cli::*;");
    assert_eq!(imported(&glob), BTreeSet::from(["cli".to_owned()]));
    let binary = Source::new("main.rs", "fn main() { fluxform::commands::main() }");
    assert_eq!(imported(&binary), BTreeSet::from(["commands".to_owned()]));
}

/// A file's module path, and those of the modules that it imports: the longest that is a file.
fn edges(files: &[Source]) -> BTreeMap<Vec<String>, BTreeSet<Vec<String>>> {
    let modules: BTreeSet<Vec<String>> = files.iter().map(Source::module).collect();
    let mut edges = BTreeMap::new();
    for source in files {
        let here = source.module();
        let mut to = BTreeSet::new();
        for path in source.crate_paths() {
            let target = (1..=path.len())
                .rev()
                .map(|n| path[..n].to_vec())
                .find(|path| modules.contains(path));
            // A module and the ones inside it are one idea in several files.
            if let Some(target) = target {
                let related = target.starts_with(&here) || here.starts_with(&target);
                if !related {
                    to.insert(target);
                }
            }
        }
        edges.insert(here, to);
    }
    edges
}

/// Whether `to` is reached from `from`.
fn reaches(
    edges: &BTreeMap<Vec<String>, BTreeSet<Vec<String>>>,
    from: &[String],
    to: &[String],
) -> bool {
    let mut seen = BTreeSet::new();
    let mut open = vec![from.to_vec()];
    while let Some(at) = open.pop() {
        for next in edges.get(&at).into_iter().flatten() {
            if next == to {
                return true;
            }
            if seen.insert(next.clone()) {
                open.push(next.clone());
            }
        }
    }
    false
}

#[test]
fn no_module_imports_in_a_circle() {
    let edges = edges(&sources());
    let mut circles: BTreeSet<Vec<String>> = BTreeSet::new();
    for module in edges.keys() {
        if reaches(&edges, module, module) {
            let group = edges
                .keys()
                .filter(|other| reaches(&edges, module, other) && reaches(&edges, other, module))
                .map(|path| path.join("::"))
                .collect();
            circles.insert(group);
        }
    }
    let known: BTreeSet<Vec<String>> = CIRCLES
        .iter()
        .map(|group| group.iter().map(|&name| name.to_owned()).collect())
        .collect();
    assert_eq!(circles, known, "modules that import each other");
}
