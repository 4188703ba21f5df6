//! Nothing of the user's is changed, whatever lies at the names that a command may touch.
//!
//! `cargo test --locked --test planted -- --nocapture` prints the table of these cases,
//! `cargo bench --locked --bench planted` that of all.
#![cfg(target_os = "linux")] // links, pipes, modes
#![allow(clippy::disallowed_methods, clippy::print_stdout)] // a test's own files and its table

mod cases;
mod commands;
mod inputs_as_outputs;
mod judge;
mod run;
mod snapshot;

/// Every so many cases one: prime, so that all plants, names and flags have their turn.
const EVERY: usize = 43;

#[test]
fn nothing_of_the_users_is_changed() {
    let rows = run::rows(commands::COMMANDS, EVERY);
    println!("{}", run::summary(&rows, "planted", |row| row.planted));
    println!("{}", run::summary(&rows, "command", |row| row.command));
    let changed: Vec<_> = rows
        .iter()
        .filter(|row| !row.changed.is_empty())
        .cloned()
        .collect();
    assert!(rows.len() > 200, "only {} cases", rows.len());
    assert!(changed.is_empty(), "{}", run::lines(&changed, true));
}

/// A command that is added must be here too.
#[test]
fn every_command_with_an_output_is_tried() {
    let help = |words: &[&str]| {
        let ran = std::process::Command::new(fluxform_testing::run::program_or_other())
            .args(words)
            .arg("--help")
            .output()
            .unwrap();
        String::from_utf8(ran.stdout).unwrap()
    };
    let listed = |text: &str| -> Vec<String> {
        let list = text.split("Commands:\n").nth(1).unwrap_or("");
        list.lines()
            .take_while(|line| !line.is_empty())
            .filter_map(|line| line.split_whitespace().next().map(str::to_owned))
            .filter(|name| name != "help")
            .collect()
    };
    let mut missing = Vec::new();
    for command in listed(&help(&[])) {
        let parts = listed(&help(&[&command]));
        let parts = if parts.is_empty() {
            vec![String::new()]
        } else {
            parts
        };
        for part in parts {
            let name = format!("{command} {part}");
            let words: Vec<&str> = name.split_whitespace().collect();
            let text = help(&words);
            let flags = ["--out", "--plot", "--report"];
            let writes = flags.iter().any(|flag| text.contains(&format!("{flag} <")));
            let tried = commands::COMMANDS
                .iter()
                .chain(commands::MEASURES)
                .any(|writes| writes.line.starts_with(name.trim()));
            if writes && !tried {
                missing.push(name);
            }
        }
    }
    assert!(missing.is_empty(), "{missing:?}");
}
