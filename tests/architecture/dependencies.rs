//! Who brings in the packages that nobody maintains, and how many packages there are.

use std::collections::BTreeSet;
use std::process::Command;

use crate::source::{files, manifests, read, root};

/// Packages without a maintainer, and the only ones that may need them.
const UNMAINTAINED: [(&str, &[&str]); 1] = [("paste", &["argmin", "simba"])];

/// Every locked package with what it needs.
fn packages() -> Vec<(String, Vec<String>)> {
    let lock = read("Cargo.lock");
    let package = |text: &str| {
        let quoted = |line: &str| line.split('"').nth(1).unwrap_or("").to_owned();
        let name = text.lines().find(|line| line.starts_with("name = "));
        let needs = text.lines().filter(|line| line.starts_with(" \""));
        // A name that several versions share is followed by its version.
        let needs = needs.map(|line| quoted(line).split(' ').next().unwrap_or("").to_owned());
        (quoted(name.unwrap_or("")), needs.collect())
    };
    lock.split("[[package]]").skip(1).map(package).collect()
}

#[test]
fn unmaintained_packages_come_with_the_named_ones_alone() {
    for (name, bringers) in UNMAINTAINED {
        let found: Vec<String> = packages()
            .into_iter()
            .filter(|(_, needs)| needs.iter().any(|need| need == name))
            .map(|(package, _)| package)
            .collect();
        assert_eq!(
            found, bringers,
            "{name}: mend this table, .deny.toml and src/DEPENDENCIES.md"
        );
        let listed: Vec<String> = bringers.iter().map(|it| format!("\"{it}\"")).collect();
        let line = format!(
            "{{ crate = \"{name}\", wrappers = [{}] }}",
            listed.join(", ")
        );
        assert!(
            read(".deny.toml").contains(&line),
            ".deny.toml lacks {line}"
        );
    }
}

#[test]
fn the_number_of_packages_is_stated() {
    let stated = format!("`Cargo.lock` names {} packages", packages().len());
    assert!(read("src/DEPENDENCIES.md").contains(&stated), "{stated}");
}

/// Every package of a selection with its features.
fn features(selection: &[&str]) -> BTreeSet<(String, String)> {
    let mut tree = Command::new(env!("CARGO"));
    tree.current_dir(root())
        .args(["tree", "--locked", "--prefix", "none"])
        .args(["--format", "{p}\t{f}", "--edges", "normal,build,dev"])
        .args(selection);
    let output = tree.output().unwrap();
    assert!(output.status.success(), "{tree:?}: {output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    let packages = text.lines().filter_map(|line| line.split_once('\t'));
    packages
        .map(|(package, features)| (package.to_owned(), features.replace(" (*)", "")))
        .collect()
}

/// Otherwise the test of the wheel compiles nearly everything a second time.
#[test]
fn the_wheel_of_the_tests_is_built_on_what_they_compile() {
    let of_tests = features(&[]);
    let compiled: BTreeSet<&String> = of_tests.iter().map(|(package, _)| package).collect();
    let of_wheel = features(&["--package", "fluxform-python", "--features", "tests"]);
    let again: Vec<_> = of_wheel
        .iter()
        .filter(|one| compiled.contains(&one.0) && !of_tests.contains(one))
        .collect();
    assert!(
        again.is_empty(),
        "mend `tests` in src/python/Cargo.toml or the last dependencies of tests/support/Cargo.toml: {again:#?}"
    );
}

/// The workspace's tests, built together, have every feature of the shared parts: a room's alone have those it asks for.
#[test]
fn a_room_asks_for_the_shared_parts_that_its_tests_use() {
    let library = read("tests/support/lib.rs");
    let gated = library.split("#[cfg(feature = \"").skip(1).map(|after| {
        let (feature, rest) = after.split_once("\")]\npub mod ").expect("a part");
        (feature, rest.split(';').next().unwrap_or(""))
    });
    let gated: Vec<(&str, &str)> = gated.collect();
    assert!(gated.contains(&("shape", "surfaces")), "{gated:?}");
    for manifest in manifests() {
        let room = manifest
            .trim_start_matches("src/")
            .trim_end_matches("/Cargo.toml");
        let of_room = format!("tests/{room}/");
        let asked = read(&manifest);
        // The tests of some rooms are those of the whole program.
        if !asked.contains(&format!("{of_room}main.rs")) {
            continue;
        }
        let asked = asked
            .lines()
            .find(|line| line.starts_with("fluxform-testing"));
        for test in files().iter().filter(|file| file.starts_with(&of_room)) {
            let text = read(test);
            let uses = text.split("fluxform_testing::").skip(1);
            let uses = uses.filter_map(|after| after.split(';').next());
            for (used, (feature, part)) in
                uses.flat_map(|used| gated.iter().map(move |gate| (used, gate)))
            {
                assert!(
                    !used.contains(&format!("{part}::"))
                        || asked.is_some_and(|line| line.contains(&format!("\"{feature}\""))),
                    "{test} uses what {manifest} does not ask for: {feature}"
                );
            }
        }
    }
}
