//! The README shows what the program really says.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

fn readme() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    std::fs::read_to_string(path).unwrap()
}

fn says(arguments: &[&str]) -> String {
    let run = Command::new(env!("CARGO_BIN_EXE_fluxform"))
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let errors = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(run.stdout).unwrap()
}

/// Without the line that names the folder.
fn but_the_folder(text: &str) -> Vec<&str> {
    text.lines()
        .map(str::trim_end)
        .filter(|line| !line.trim_start().starts_with("written to"))
        .collect()
}

#[test]
fn the_first_command_prints_what_the_readme_shows() {
    let readme = readme();
    let mark = "cargo run --release --locked -- ";
    let (_, rest) = readme.split_once(mark).unwrap();
    let (command, rest) = rest.split_once('\n').unwrap();
    let (_, rest) = rest.split_once("```text\n").unwrap();
    let (shown, _) = rest.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut arguments: Vec<&str> = command.split(' ').collect();
    assert_eq!(arguments[0], "calibrate");
    arguments.extend(["--out", folder.path().to_str().unwrap()]);
    let printed = says(&arguments);
    assert_eq!(but_the_folder(shown), but_the_folder(&printed));
}

#[test]
fn the_table_of_numbers_is_what_the_commands_print() {
    let readme = readme();
    let coil = says(&["evaluate", "designs/seed.toml"]);
    let flat = says(&["lambda", "designs/seed.toml", "shapes/flat.toml"]);
    let air = says(&["evaluate", "designs/seed_air.toml"]);
    let flat_air = says(&["lambda", "designs/seed_air.toml", "shapes/flat.toml"]);
    for (printed, value) in [
        (&coil, "6.0753 ohm"),
        (&coil, "778.87 mN"),
        (&coil, "151.51 ms"),
        (&coil, "99.112 ms, give or take 5.41 %"),
        (&flat, "3.2544 N/m"),
        (&air, "99.709 mN"),
        (&air, "11.935 ms"),
        (&flat_air, "0.62098 N/m"),
    ] {
        assert!(printed.contains(value), "no {value} in:\n{printed}");
        assert!(readme.contains(value), "no {value} in README.md");
    }
}

#[test]
fn the_best_coil_is_what_the_readme_shows() {
    let readme = readme();
    let (_, rest) = readme.split_once("## Find the best coil").unwrap();
    let (_, rest) = rest.split_once("```sh\n").unwrap();
    let (command, rest) = rest.split_once("\n```").unwrap();
    let (_, rest) = rest.split_once("```text\n").unwrap();
    let (shown, _) = rest.split_once("```").unwrap();
    let arguments: Vec<&str> = command.split(' ').skip(1).collect();
    let printed = says(&arguments);
    assert_eq!(but_the_folder(shown), but_the_folder(&printed));
}

#[test]
fn the_sweep_prints_what_the_readme_shows() {
    let readme = readme();
    let (_, rest) = readme.split_once("## Sweep designs").unwrap();
    let (_, rest) = rest.split_once("```sh\n").unwrap();
    let (commands, rest) = rest.split_once("```").unwrap();
    let (_, rest) = rest.split_once("```text\n").unwrap();
    let (shown, _) = rest.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut printed = String::new();
    for command in commands.lines() {
        let arguments = command.strip_prefix("fluxform ").unwrap().split(' ');
        let inside = |argument: &str| folder.path().join(argument).display().to_string();
        let arguments: Vec<String> = arguments
            .map(|argument| match argument {
                "plan.json" | "points" | "sweep.csv" => inside(argument),
                other => other.to_owned(),
            })
            .collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        printed += &says(&arguments);
    }
    assert_eq!(but_the_folder(shown), but_the_folder(&printed));
}

#[test]
fn the_replay_prints_what_the_readme_shows() {
    let readme = readme();
    let (_, rest) = readme.split_once("## Follow a finger").unwrap();
    let (_, rest) = rest.split_once("```sh\n").unwrap();
    let (command, rest) = rest.split_once("\n```").unwrap();
    let (_, rest) = rest.split_once("```text\n").unwrap();
    let (shown, _) = rest.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name).display().to_string();
    let out = inside("results");
    says(&[
        "calibrate",
        "designs/seed.toml",
        "shapes/flat.toml",
        "--out",
        &out,
    ]);
    let command = format!("{command} --out {}", inside("replay.csv"));
    let arguments: Vec<String> = command
        .split(' ')
        .skip(1)
        .map(|argument| match argument {
            "results/seed/flat" | "replay.svg" => inside(argument),
            other => other.to_owned(),
        })
        .collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let printed = says(&arguments);
    // How long a step takes depends on the machine.
    let timeless = |text: &str| -> Vec<String> {
        let lines = but_the_folder(text).into_iter();
        lines
            .filter(|line| !line.starts_with("  step "))
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(timeless(shown), timeless(&printed));
}

#[test]
fn the_table_of_force_constants_is_what_its_script_prints() {
    let run = Command::new("python3")
        .args(["scripts/seed_table.py", env!("CARGO_BIN_EXE_fluxform")])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    let Ok(run) = run else {
        #[allow(clippy::print_stderr)] // a test may tell that it was skipped
        {
            eprintln!("skipped: no python3");
        }
        return;
    };
    let errors = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.success(), "{errors}");
    let printed = String::from_utf8(run.stdout).unwrap();
    let readme = readme();
    assert!(printed.lines().count() > 6, "{printed}");
    for part in printed.split("\n\n") {
        assert!(
            readme.contains(part.trim_end()),
            "not in README.md:\n{part}"
        );
    }
}

#[test]
fn every_command_has_a_row_and_every_row_is_a_command() {
    let readme = readme();
    let (_, commands) = readme.split_once("\n## Commands\n").unwrap();
    let rows: BTreeSet<&str> = commands
        .split("\n## ")
        .next()
        .unwrap()
        .lines()
        .filter_map(|line| line.strip_prefix("| `"))
        .filter_map(|row| row.split(['`', ' ']).next())
        .collect();
    let help = says(&["--help"]);
    let commands: BTreeSet<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(rows, commands, "README.md's table and `fluxform --help`");
}

#[test]
fn the_scan_is_compared_as_the_readme_shows() {
    let readme = readme();
    let (_, rest) = readme
        .split_once("## Compare with a Gauss-meter scan")
        .unwrap();
    let (_, rest) = rest.split_once("```sh\n").unwrap();
    let (command, rest) = rest.split_once("\n```").unwrap();
    let (_, rest) = rest.split_once("```text\n").unwrap();
    let (shown, _) = rest.split_once("```").unwrap();
    let arguments: Vec<&str> = command.split(' ').skip(1).collect();
    let printed = says(&arguments);
    assert_eq!(
        shown.lines().collect::<Vec<_>>(),
        printed.lines().collect::<Vec<_>>()
    );
}
