//! Who brings in the packages that nobody maintains, and how many packages there are.

use crate::source::read;

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
