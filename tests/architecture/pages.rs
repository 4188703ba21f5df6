//! The pages that describe the house, held against it.

use std::collections::{BTreeMap, BTreeSet};

use crate::source::{Source, files, manifests, members, read, shared_by_tests, sources};

const MOST_LINES: usize = 800;
const MOST_LINES_OF_MAIN: usize = 30;
const ENTRY: &str = "- `";

const PAGE: &str = "src/DEPENDENCIES.md";

/// The entries of the page of dependencies: lines "- `name` - what it is".
fn entries() -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    for line in read(PAGE).lines() {
        let Some(entry) = line.strip_prefix(ENTRY) else {
            continue;
        };
        let (name, what) = entry
            .split_once("` - ")
            .unwrap_or_else(|| panic!("{PAGE}: not \"- `name` - what it is\": {line}"));
        assert!(what.len() > 10, "{PAGE}: {name} needs a line of its own");
        let before = found.insert(name.to_owned(), what.to_owned());
        assert!(before.is_none(), "{PAGE}: {name} is there twice");
    }
    assert!(!found.is_empty(), "{PAGE} has no entries");
    found
}

fn names(entries: &BTreeMap<String, String>) -> BTreeSet<String> {
    entries.keys().cloned().collect()
}

fn assert_same(what: &str, page: &BTreeSet<String>, tree: &BTreeSet<String>) {
    let missing: Vec<_> = tree.difference(page).collect();
    let gone: Vec<_> = page.difference(tree).collect();
    assert!(
        missing.is_empty() && gone.is_empty(),
        "{PAGE}, {what}: without a line: {missing:?}; line without a thing: {gone:?}"
    );
}

#[test]
fn every_dependency_has_one_line() {
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let table = manifest["workspace"]["dependencies"].as_table().unwrap();
    let tree = table
        .keys()
        .filter(|name| !name.starts_with("fluxform"))
        .cloned()
        .collect();
    let page = names(&entries());
    assert_same("dependencies", &page, &tree);
}

#[test]
fn no_file_holds_two_ideas() {
    for path in files() {
        let is_code = [".rs", ".py", ".c", ".h", ".sh"]
            .iter()
            .any(|ending| path.ends_with(ending));
        if is_code {
            let lines = read(&path).lines().count();
            assert!(lines <= MOST_LINES, "{path} has {lines} lines: split it");
        }
    }
    let main = read("src/main.rs").lines().count();
    assert!(main < MOST_LINES_OF_MAIN, "main.rs has {main} lines");
}

/// Places that exist on one machine only.
#[test]
fn no_file_names_a_place_of_one_machine() {
    let places =
        ["/wo#rk/", "/tm#p/", "/ro#ot/", "/ho#me/", "/Us#ers/"].map(|p| p.replace('#', ""));
    for path in files() {
        let bytes = std::fs::read(crate::source::root().join(&path)).unwrap();
        let Ok(text) = String::from_utf8(bytes) else {
            continue; // no text file
        };
        for place in &places {
            let line = text.lines().position(|line| line.contains(place.as_str()));
            assert!(line.is_none(), "{path}:{} names {place}", line.unwrap() + 1);
        }
    }
}

/// The command that the README gives is the one that the gate runs.
#[test]
fn the_readme_and_the_gate_run_the_same_tests() {
    let command = "cargo test --locked";
    assert!(read(".ci/run").lines().any(|line| line == command));
    assert!(read("README.md").lines().any(|line| line == command));
}

/// A dependency that nothing names only costs time.
#[test]
fn every_dependency_is_used() {
    let mut sources = sources();
    sources.extend(shared_by_tests());
    let mut members = members();
    members.insert("support".to_owned());
    for path in manifests() {
        let manifest: toml::Table = read(&path).parse().unwrap();
        let room = path
            .strip_suffix("/Cargo.toml")
            .and_then(|folder| folder.split('/').next_back());
        let inside = |source: &&Source| match room {
            Some(room) => source.room() == room,
            None => !members.contains(source.room()),
        };
        for name in manifest["dependencies"].as_table().unwrap().keys() {
            let in_code = name.replace('-', "_");
            let used = sources
                .iter()
                .filter(inside)
                .any(|s| s.tokens.contains(&in_code));
            assert!(used, "{path}: nothing names {name}: delete the dependency");
        }
    }
}

/// A test that no manifest names is never run.
#[test]
fn every_test_is_a_target() {
    let mut named = BTreeSet::new();
    for path in manifests() {
        let folder = path.strip_suffix("Cargo.toml").unwrap();
        let manifest: toml::Table = read(&path).parse().unwrap();
        let targets = manifest.get("test").and_then(toml::Value::as_array);
        for target in targets.into_iter().flatten() {
            let file = target["path"].as_str().unwrap();
            let file = if folder.is_empty() {
                file
            } else {
                file.strip_prefix("../../").unwrap()
            };
            named.insert(file.to_owned());
        }
    }
    let tests: BTreeSet<String> = files()
        .into_iter()
        .filter(|path| {
            let parts: Vec<&str> = path.split('/').collect();
            match parts[..] {
                ["tests", file] => file.ends_with(".rs"),
                // The measuring suite's own lie where Cargo finds them.
                ["tests", folder, file] => file == "main.rs" && folder != "suite",
                _ => false,
            }
        })
        .collect();
    assert_eq!(
        tests, named,
        "test files and the targets that manifests name"
    );
}

#[test]
fn the_source_is_found_at_all() {
    assert!(sources().iter().any(|s| s.path == "numerics/gauss.rs"));
    assert!(files().contains(&".ci/run".to_owned()));
}
