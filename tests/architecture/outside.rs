//! Tests read the repository and their own temporary folder, and nothing else: they pass on a bare
//! machine or nowhere.
//!
//! Here the texts of the tests are looked through; `.ci/run` gives them empty folders for temporary
//! files and for the user's own ones.

use crate::source::{files, read};

/// Uses of output functions, with the files that may hold them.
const WAYS_OUT: &[(&str, &[&str])] = &[
    // The folder that all temporary files share; benches keep in it what breaks a reader.
    (
        "temp_dir(",
        &[
            "tests/fuzz/documents.rs",
            "tests/fuzz/inputs.rs",
            "tests/fuzz/surfaces.rs",
        ],
    ),
    ("TMPDIR", &[]),
    ("home_dir(", &[]),
    ("\"HOME\"", &[]),
    ("XDG_", &[]),
    ("\"/tmp", &[]),
    ("\"/home", &[]),
    ("\"/root", &[]),
    ("\"/var", &[]),
    ("\"~/", &[]),
    // Beside the repository, or beside a test's own folder.
    ("join(\"..", &[]),
    ("path(\"..", &[]),
    ("read(\"..", &[]),
    // From a member to the repository that holds it.
    ("CARGO_MANIFEST_DIR\"), \"/..", &[]),
    // From a folder inside a test's own, one up leads to it; further leads into the folder of all.
    ("\"../../shapes", &[]),
    ("\"../../designs", &[]),
    ("current_dir().unwrap().parent", &[]),
];

/// Environment variables that a person sets to point a test at something, and those of every process.
const VARIABLES: [&str; 9] = [
    "CARGO_",
    "FLUXFORM_",
    "PATH",
    "NO_COLOR",
    "COLUMNS",
    "ONLY",
    "LANG",
    "LC_ALL",
    "RAYON_NUM_THREADS",
];

fn tests() -> impl Iterator<Item = (String, String)> {
    files()
        .into_iter()
        .filter(|path| path.starts_with("tests/") && path.ends_with(".rs"))
        .filter(|path| path != "tests/architecture/outside.rs")
        .map(|path| {
            let text = read(&path);
            (path, text)
        })
}

#[test]
fn tests_read_their_own_folder_and_the_repository_alone() {
    let mut faults = Vec::new();
    for (path, text) in tests() {
        for (number, line) in text.lines().enumerate() {
            let code = line.trim_start();
            if code.starts_with("//") || code.starts_with("#[path") || code.contains("include_") {
                continue;
            }
            for (way, holders) in WAYS_OUT {
                if code.contains(way) && !holders.contains(&path.as_str()) {
                    faults.push(format!("{path}:{}: {way}", number + 1));
                }
            }
            for read in ["env::var(\"", "env::var_os(\""] {
                let Some(name) = code.split(read).nth(1) else {
                    continue;
                };
                if !VARIABLES.iter().any(|known| name.starts_with(known)) {
                    faults.push(format!("{path}:{}: reads the variable {name}", number + 1));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_exception_is_still_needed() {
    for (way, holders) in WAYS_OUT {
        for holder in *holders {
            assert!(
                read(holder).contains(way),
                "{holder} no longer needs {way}: delete it"
            );
        }
    }
}

/// The gate runs the command that the README gives, and on a bare machine.
#[test]
fn the_gate_runs_the_readmes_tests_in_empty_folders() {
    let gate = read(".ci/run");
    let written = read("README.md");
    let command = written
        .lines()
        .find(|line| line.starts_with("cargo test"))
        .expect("the README says how the tests are run");
    let at = |expected: &str| gate.lines().position(|line| line == expected);
    let tests = at(command).unwrap_or_else(|| panic!(".ci/run does not run `{command}`"));
    for folder in [
        "TMPDIR",
        "HOME",
        "XDG_CONFIG_HOME",
        "XDG_CACHE_HOME",
        "XDG_RUNTIME_DIR",
    ] {
        let set = |line: &str| {
            line.starts_with("export ") && line.contains(&format!(" {folder}=\"$bare/"))
        };
        let emptied = gate.lines().position(set);
        assert!(
            emptied.is_some_and(|line| line < tests),
            "{folder} is the user's own"
        );
    }
}
