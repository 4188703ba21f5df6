//! Who brings in the packages that nobody maintains, and how many packages there are.

use std::collections::BTreeSet;
use std::process::Command;

use crate::source::{read, root};

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
        .args(["tree", "--locked", "--offline", "--prefix", "none"])
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
