//! The documents show what the program really prints.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use fluxform_testing::place::Place;
use fluxform_testing::root;
use fluxform_testing::run::program;

use crate::pages::{blocks, command_and_output, lasting, page, section};
use fluxform_testing::needs::{self, Trial};
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [the_first_command_prints_what_the_readme_shows, the_picture_is_what_its_command_draws, the_table_of_numbers_is_what_the_commands_print, one_command_of_a_section_prints_what_is_shown, the_errors_of_a_scene_are_those_shown, the_sweep_prints_what_is_shown, the_parts_of_an_array_print_what_is_shown, the_replay_prints_what_is_shown, the_tray_shields_as_shown, every_command_has_a_row_and_every_row_is_a_command],
        needs::python() => [the_table_of_force_constants_is_what_its_script_prints],
    }
}

fn printed(arguments: &[impl AsRef<std::ffi::OsStr> + std::fmt::Debug]) -> String {
    let run = Command::new(program())
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap();
    let errors = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(run.stdout).unwrap()
}

/// The arguments of a shown command, `files` of it inside `folder`.
fn arguments(command: &str, files: &[&str], folder: &Path) -> Vec<String> {
    command
        .strip_prefix("fluxform ")
        .unwrap()
        .split(' ')
        .map(|argument| {
            if files.contains(&argument) {
                folder.join(argument).display().to_string()
            } else {
                argument.to_owned()
            }
        })
        .collect()
}

fn the_first_command_prints_what_the_readme_shows() {
    let (command, shown) = command_and_output("Try it");
    let command = command
        .strip_prefix("cargo run --release --locked -- ")
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let mut arguments: Vec<&str> = command.split(' ').collect();
    assert_eq!(arguments[0], "calibrate");
    arguments.extend(["--out", folder.path().to_str().unwrap()]);
    assert_eq!(lasting(&shown), lasting(&printed(&arguments)));
}

/// The numbers of a picture, to three digits, between the rest of its text.
fn coarse(picture: &str) -> String {
    let numeric = |c: char| c.is_ascii_digit() || c == '.';
    let mut coarse = String::new();
    let mut rest = picture;
    while let Some(start) = rest.find(numeric) {
        let number = &rest[start..];
        let end = number.find(|c| !numeric(c)).unwrap_or(number.len());
        coarse += &rest[..start];
        match number[..end].parse::<f64>() {
            Ok(value) => coarse += &format!("{value:.2e}"),
            Err(_) => coarse += &number[..end],
        }
        rest = &number[end..];
    }
    coarse + rest
}

fn the_picture_is_what_its_command_draws() {
    let readme = page("README.md");
    let (_, rest) = readme.split_once("The picture is what `").unwrap();
    let command = rest.split('`').next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    printed(&arguments(command, &["half_sphere.svg"], folder.path()));
    let drawn = std::fs::read_to_string(folder.path().join("half_sphere.svg")).unwrap();
    let same = coarse(&drawn) == coarse(&page("results/half_sphere.svg"));
    assert!(same, "draw results/half_sphere.svg again: {command}");
}

fn the_table_of_numbers_is_what_the_commands_print() {
    let readme = page("README.md");
    let coil = printed(&["evaluate", "designs/seed.toml"]);
    let flat = printed(&["lambda", "designs/seed.toml", "shapes/flat.toml"]);
    let air = printed(&["evaluate", "designs/seed_air.toml"]);
    let flat_air = printed(&["lambda", "designs/seed_air.toml", "shapes/flat.toml"]);
    for (printed, value) in [
        (&coil, "6.0753 ohm"),
        (&coil, "778.87 mN"),
        (&coil, "151.51 ms"),
        (&coil, "99 +- 6 ms"),
        (&flat, "3.254 +- 0.004 N/m"),
        (&air, "99.709 mN"),
        (&air, "11.935 ms"),
        (&flat_air, "0.6210 +- 0.0019 N/m"),
    ] {
        assert!(printed.contains(value), "no {value} in:\n{printed}");
        assert!(readme.contains(value), "no {value} in README.md");
    }
}

fn one_command_of_a_section_prints_what_is_shown() {
    for title in ["Find the best coil", "Compare with a gaussmeter scan"] {
        let (command, shown) = command_and_output(title);
        let printed = printed(&arguments(&command, &[], Path::new("")));
        assert_eq!(lasting(&shown), lasting(&printed), "{title}");
    }
}

/// The lines up to the cheapest settings, which depend on the machine, without the seconds.
fn untimed(text: &str) -> Vec<String> {
    let errors = text.lines().take_while(|line| !line.starts_with("  10 %"));
    let without = |line: &str| {
        let mut words: Vec<&str> = line.split_whitespace().collect();
        if words
            .last()
            .is_some_and(|unit| ["s", "ms", "us"].contains(unit))
        {
            words.truncate(words.len() - 2);
        }
        words.join(" ")
    };
    errors.map(without).collect()
}

fn the_errors_of_a_scene_are_those_shown() {
    let (command, shown) = command_and_output("Error against time of a scene");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out").display().to_string();
    let mut asked = arguments(&command, &[], Path::new(""));
    asked.extend(["--out".to_owned(), out]);
    let printed = untimed(&printed(&asked));
    assert!(printed.len() > 12, "{printed:?}");
    assert_eq!(untimed(&shown), printed);
}

fn the_sweep_prints_what_is_shown() {
    let (commands, shown) = command_and_output("Sweep designs");
    let folder = tempfile::tempdir().unwrap();
    let files = ["plan.json", "points", "sweep.csv"];
    let all: String = commands
        .lines()
        .map(|command| printed(&arguments(command, &files, folder.path())))
        .collect();
    assert_eq!(lasting(&shown), lasting(&all));
}

fn the_parts_of_an_array_print_what_is_shown() {
    let (commands, shown) = command_and_output("Share one array among machines");
    let place = Place::new();
    let printed: String = commands
        .lines()
        .map(|command| place.shell(command).ends(0).out)
        .collect();
    assert_eq!(lasting(&shown), lasting(&printed));
}

/// |B| with and without the tray of the text, every coil at 1 A.
fn the_tray_shields_as_shown() {
    let text = section("A plate below the cores, and other steel");
    let tray = blocks(&text)
        .into_iter()
        .find(|block| block.text.contains("a tray"));
    let seed = std::fs::read_to_string(root().join("designs/seed.toml")).unwrap();
    let place = Place::empty();
    place.write("without.toml", &seed);
    place.write("shielded.toml", &format!("{seed}\n{}", tray.unwrap().text));
    let rows: Vec<Vec<f64>> = (text
        .split("in the tray, mT |\n|---|---|---|\n")
        .nth(1)
        .unwrap()
        .lines())
    .take_while(|line| line.starts_with('|'))
    .map(|line| {
        let cells = line
            .split(['|', ','])
            .map(str::trim)
            .filter(|cell| !cell.is_empty());
        cells.map(|cell| cell.parse().unwrap()).collect()
    })
    .collect();
    assert_eq!(rows.len(), 4);
    let points = rows
        .iter()
        .map(|row| format!("{},{},{}\n", row[0] / 1e3, row[1] / 1e3, row[2] / 1e3));
    place.write(
        "stray.csv",
        &format!("x_m,y_m,z_m\n{}", points.collect::<String>()),
    );
    for (design, column) in [("without.toml", 3), ("shielded.toml", 4)] {
        let ran = place
            .run(&["probe", design, "stray.csv", "--tolerance", "0.03"])
            .ends(0);
        let values: Vec<Vec<f64>> = (ran.out.lines().skip(1))
            .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
            .collect();
        for (shown, coils) in rows.iter().zip(values.chunks(9)) {
            let sum = |k: usize| coils.iter().map(|row| row[k]).sum::<f64>();
            let field_t = [4, 5, 6].map(sum).iter().map(|b| b * b).sum::<f64>().sqrt();
            assert_eq!(
                format!("{:.2}", 1e3 * field_t),
                format!("{:.2}", shown[column]),
                "{shown:?}"
            );
        }
    }
}

fn the_replay_prints_what_is_shown() {
    let (command, shown) = command_and_output("Follow a finger");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("results").display().to_string();
    let shape = "shapes/flat.toml";
    printed(&["calibrate", "designs/seed.toml", shape, "--out", &out]);
    let command = format!("{command} --out replay.csv");
    let files = ["results/seed/flat", "replay.svg", "replay.csv"];
    let printed = printed(&arguments(&command, &files, folder.path()));
    assert_eq!(lasting(&shown), lasting(&printed));
}

fn the_table_of_force_constants_is_what_its_script_prints() {
    let place = Place::with(&["scripts", "designs", "shapes"]);
    let printed = place.shell("python3 scripts/seed_table.py $(command -v fluxform)");
    let printed = printed.ends(0).out;
    let readme = page("README.md");
    assert!(printed.lines().count() > 6, "{printed}");
    for part in printed.split("\n\n") {
        let shown = readme.contains(part.trim_end());
        assert!(shown, "not in README.md:\n{part}");
    }
}

fn every_command_has_a_row_and_every_row_is_a_command() {
    let commands = section("Commands");
    let rows: BTreeSet<&str> = commands
        .lines()
        .filter_map(|line| line.strip_prefix("| `"))
        .filter_map(|row| row.split(['`', ' ']).next())
        .collect();
    let help = printed(&["--help"]);
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
