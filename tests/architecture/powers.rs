//! Who may write files, print, end the process, read clocks or be unsafe.
//!
//! The lints in `Cargo.toml` and `.clippy.toml` forbid these things; here it is held that the
//! lints are in force, and that only the files named below are exempt. A name that needs no
//! exemption any more fails too, so the lists only shrink.

use crate::source::{Source, manifests, read, sources};

/// A power, the tokens that use it or lift its lint, and who has it: files, rooms and folders, which
/// end with `/`, or all files of an ending, which begins with `*`.
struct Power {
    name: &'static str,
    marks: &'static [&'static str],
    holders: &'static [&'static str],
}

const POWERS: &[Power] = &[
    Power {
        name: "writing files",
        marks: &[
            "fs :: write",
            "fs :: rename",
            "fs :: copy",
            "fs :: remove_file",
            "fs :: remove_dir",
            "fs :: remove_dir_all",
            "fs :: create_dir",
            "fs :: create_dir_all",
            "fs :: hard_link",
            "fs :: set_permissions",
            "fs :: { write",
            "fs :: { rename",
            "fs :: *",
            "os :: unix",
            "DirBuilder",
            "File :: create",
            "File :: create_new",
            "File :: options",
            "OpenOptions",
            "tempfile",
            "rustix",
        ],
        holders: &["bundle/atomic/", "bundle/read_bounded.rs"],
    },
    Power {
        name: "lifting the lint on writing and clocks",
        marks: &["disallowed_methods"],
        holders: &["commands/bench/clock.rs", "bundle/lib.rs", "cli/bar.rs"],
    },
    Power {
        name: "unsafe code",
        marks: &["unsafe", "unsafe_code", "MmapOptions", "Mmap"],
        holders: &["numerics/dispatch.rs"],
    },
    Power {
        name: "printing",
        marks: &[
            "println !",
            "print !",
            "eprintln !",
            "eprint !",
            "print_stdout",
            "print_stderr",
            "stdout (",
            "stderr (",
        ],
        // Of the process that reads STEP it is the pipe.
        holders: &["cli/bar.rs", "cli/printer.rs", "shape/step/kernel.rs"],
    },
    Power {
        name: "reading a clock",
        marks: &["Instant", "SystemTime", "ProcessTime"],
        // Of a record: whether the file system's clock has moved since a file changed.
        holders: &[
            "commands/bench/clock.rs",
            "cli/bar.rs",
            "bundle/atomic/record.rs",
        ],
    },
    Power {
        name: "ending the process",
        marks: &["process :: exit", "process :: abort", "signal_hook"],
        holders: &["cli/interrupt.rs"],
    },
    Power {
        name: "reading the environment",
        marks: &[
            "env :: var",
            "env :: vars",
            "env :: var_os",
            "env :: args",
            "env :: args_os",
            "env :: current_dir",
            "env :: current_exe",
            "env :: temp_dir",
            "env :: home_dir",
        ],
        holders: &[
            "cli/printer.rs",
            "cli/terminal.rs",
            "main.rs",
            "suite/main.rs",
            "suite/peers/mod.rs",
            "suite/scaling/mod.rs",
        ],
    },
    Power {
        name: "reading files",
        marks: &["fs ::", "File ::", "stdin ("],
        holders: &[
            "bundle/",
            "cli/budget.rs",
            "cli/documents.rs",
            // Answers at a terminal.
            "cli/printer.rs",
            // Of the process that shows a page it is the pipe.
            "commands/man.rs",
            "design/named_file.rs",
            "design/source.rs",
            "shape/step/kernel.rs",
            "suite/memory.rs",
        ],
    },
    Power {
        name: "the command line's crates",
        marks: &["clap", "clap_complete", "clap_mangen"],
        holders: &[
            "cli/",
            "*command.rs",
            "commands/completions.rs",
            "commands/man.rs",
            "commands/mod.rs",
            "suite/arguments.rs",
        ],
    },
    Power {
        name: "iterating for singular and eigenvalues without a bound",
        marks: &[
            "SymmetricEigen ::",
            "SVD ::",
            "Schur ::",
            ". symmetric_eigen (",
            ". symmetric_eigenvalues (",
            ". eigenvalues (",
            ". complex_eigenvalues (",
            ". schur (",
            ". svd (",
            ". svd_unordered (",
            ". singular_values (",
            ". singular_values_unordered (",
            ". pseudo_inverse (",
        ],
        holders: &["numerics/bounded_eigen.rs"],
    },
    Power {
        name: "the plotting crate",
        marks: &["kuva"],
        holders: &["render/plot/"],
    },
];

fn covers(holder: &str, path: &str) -> bool {
    if let Some(ending) = holder.strip_prefix('*') {
        path.ends_with(ending)
    } else if holder.ends_with('/') {
        path.starts_with(holder)
    } else {
        path == holder
    }
}

fn used<'a>(power: &'a Power, source: &Source) -> Option<&'a str> {
    power.marks.iter().copied().find(|mark| source.has(mark))
}

#[test]
fn only_the_named_files_have_powers() {
    let mut faults = Vec::new();
    for source in sources() {
        for power in POWERS {
            let holds = power.holders.iter().any(|h| covers(h, &source.path));
            if let (Some(mark), false) = (used(power, &source), holds) {
                faults.push(format!("src/{}: {} ({mark})", source.path, power.name));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn every_power_is_still_needed() {
    let sources = sources();
    for power in POWERS {
        for holder in power.holders {
            let needed = sources
                .iter()
                .any(|s| covers(holder, &s.path) && used(power, s).is_some());
            assert!(needed, "{holder} no longer needs {}: delete it", power.name);
        }
    }
}

#[test]
fn a_power_is_seen_in_code_and_not_in_words() {
    let writing = &POWERS[0];
    let code = Source::new(
        "map/radii.rs",
        "fn f() { std::fs::write(\"a\", b\"c\").ok(); }",
    );
    assert_eq!(used(writing, &code), Some("fs :: write"));
    let words = Source::new(
        "map/radii.rs",
        "// std::fs::write\nconst A: &str = \"fs::write\";",
    );
    assert_eq!(used(writing, &words), None);
}

/// The lints that clippy enforces on every target, and the methods it refuses.
#[test]
fn the_lints_are_in_force() {
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let lints = manifest["workspace"]["lints"].as_table().unwrap();
    let level = |group: &str, lint: &str| lints[group][lint].as_str().unwrap().to_owned();
    assert_eq!(level("rust", "unsafe_code"), "deny");
    assert_eq!(level("rust", "missing_docs"), "warn"); // an error with -D warnings
    for lint in [
        "print_stdout",
        "print_stderr",
        "exit",
        "dbg_macro",
        "todo",
        "unimplemented",
    ] {
        assert_eq!(level("clippy", lint), "deny", "{lint}");
    }
    for manifest in manifests() {
        let manifest: toml::Table = read(&manifest).parse().unwrap();
        assert!(manifest["lints"]["workspace"].as_bool().unwrap());
    }
    let clippy: toml::Table = read(".clippy.toml").parse().unwrap();
    let refused: Vec<&str> = clippy["disallowed-methods"]
        .as_array()
        .unwrap()
        .iter()
        .map(|method| method["path"].as_str().unwrap())
        .collect();
    for method in [
        "std::fs::write",
        "std::fs::rename",
        "std::fs::copy",
        "std::fs::remove_file",
        "std::fs::remove_dir_all",
        "std::fs::create_dir",
        "std::fs::create_dir_all",
        "std::fs::File::create",
        "std::fs::File::create_new",
        "std::fs::OpenOptions::open",
        "std::time::Instant::now",
        "std::time::SystemTime::now",
    ] {
        assert!(refused.contains(&method), ".clippy.toml lost {method}");
    }
    assert!(
        read(".ci/run").contains("cargo clippy --workspace --all-targets --locked -- -D warnings"),
        ".ci/run runs clippy with warnings as errors"
    );
}
