//! The tutorial: its files are written, its commands run in order, its outputs compared.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::pages::{blocks, page, root, section};

const TUTORIAL: &str = "designs/first_display.md";

/// A folder with the repository's scripts, designs and shapes.
fn place() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["scripts", "designs", "shapes"] {
        symlink(root().join(name), folder.path().join(name)).unwrap();
    }
    folder
}

fn shell(folder: &Path, script: &str) -> Output {
    let programs = Path::new(env!("CARGO_BIN_EXE_fluxform")).parent().unwrap();
    let path = std::env::var("PATH").unwrap();
    Command::new("sh")
        .args(["-e", "-c", script])
        .current_dir(folder)
        .env("PATH", format!("{}:{path}", programs.display()))
        .env("LC_ALL", "C")
        .output()
        .unwrap()
}

/// Whether a program answers.
fn there(program: &str, arguments: &[&str]) -> bool {
    Command::new(program)
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// What a script needs that this machine has not.
fn missing(script: &str) -> Option<&'static str> {
    let modern = "exit(compare_versions(version, '7.0.0', '<'))";
    if script.contains("octave-cli") && !there("octave-cli", &["--norc", "--eval", modern]) {
        return Some("octave-cli of version 7 or newer");
    }
    if script.contains("cc -std") && !there("cc", &["--version"]) {
        return Some("a C compiler");
    }
    if script.contains("python3") && !there("python3", &["-c", "import numpy"]) {
        return Some("python3 with numpy");
    }
    None
}

/// Without what depends on the machine or the folder.
fn lasting(text: &str) -> Vec<&str> {
    text.lines()
        .map(str::trim_end)
        .filter(|line| !line.starts_with("  step ") && !line.starts_with("  written to "))
        .collect()
}

#[test]
fn the_tutorial_runs_and_prints_what_it_shows() {
    let folder = place();
    let mut printed: Option<String> = None;
    let (mut files, mut commands, mut outputs) = (0, 0, 0);
    for block in blocks(&page(TUTORIAL)) {
        match block.language.as_str() {
            "sh" => {
                printed = None;
                if let Some(what) = missing(&block.text) {
                    eprintln!("skipped: no {what} for\n{}", block.text);
                    continue;
                }
                let ran = shell(folder.path(), &block.text);
                let errors = String::from_utf8_lossy(&ran.stderr).into_owned();
                assert!(ran.status.success(), "{}{errors}", block.text);
                printed = Some(String::from_utf8(ran.stdout).unwrap());
                commands += 1;
            }
            "text" => {
                if let Some(printed) = printed.take() {
                    assert_eq!(lasting(&block.text), lasting(&printed));
                    outputs += 1;
                }
            }
            _ => {
                let name = block.before.split('`').rfind(|part| part.contains('.'));
                let name = name.unwrap_or_else(|| panic!("no file is named: {}", block.before));
                assert!(name.len() < 20, "{name} is no file's name");
                fs::write(folder.path().join(name), &block.text).unwrap();
                files += 1;
            }
        }
    }
    assert_eq!(files, 6);
    assert!(commands >= 4 && outputs >= 4, "{commands} {outputs}");
    let table = folder.path().join("table.csv");
    if table.exists() {
        the_row_of_a_position(&fs::read_to_string(table).unwrap());
    }
}

/// Row 1 + (27 k + j) 27 + i belongs to the grid's position, and columns 7 to 15 are currents.
fn the_row_of_a_position(table: &str) {
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(rows.len(), 1 + 27 * 27 * 16);
    for coil in 0..9 {
        assert_eq!(rows[0][7 + coil], format!("current_{coil}_a"));
    }
    assert!(!rows[0][16].starts_with("current"));
    assert_eq!(*rows[1].last().unwrap(), "ok");
    for position in [
        [0.0113, -0.0042, 0.0271],
        [-0.026, 0.026, 0.04],
        [0.0, 0.0, 0.01],
    ] {
        let nearest = |at: f64, from: f64| ((at - from) / 0.002).round() as usize;
        let (i, j) = (nearest(position[0], -0.026), nearest(position[1], -0.026));
        let k = nearest(position[2], 0.01);
        let row = &rows[1 + (27 * k + j) * 27 + i];
        for (axis, at) in position.iter().enumerate() {
            let node: f64 = row[1 + axis].parse().unwrap();
            assert!(
                (node - at).abs() <= 0.001 + 1e-12,
                "{row:?} for {position:?}"
            );
        }
    }
}

/// Resistance, inductance and force of a design.
fn evaluated(folder: &Path, text: &str) -> [f64; 3] {
    fs::write(folder.join("tried.toml"), text).unwrap();
    let ran = shell(folder, "fluxform evaluate tried.toml --format json");
    assert!(ran.status.success());
    let told: serde_json::Value = serde_json::from_slice(&ran.stdout).unwrap();
    [
        "/coil/resistance_ohm",
        "/coil/inductance_h",
        "/target/force_n",
    ]
    .map(|key| told.pointer(key).unwrap().as_f64().unwrap())
}

#[test]
fn the_table_of_what_one_percent_changes_is_true() {
    let folder = place();
    let tutorial = page(TUTORIAL);
    let design = &blocks(&tutorial)[0].text;
    let as_given = evaluated(folder.path(), design);
    let rows = tutorial.lines().filter(|line| line.starts_with("| `"));
    let mut checked = 0;
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let key = cells[1]
            .split(['`', ' '])
            .rfind(|word| word.contains('_') || *word == "turns");
        let key = key.unwrap();
        let line = design
            .lines()
            .find(|line| line.starts_with(&format!("{key} = ")))
            .unwrap();
        let value = line.split(['=', '#']).nth(1).unwrap().trim();
        let number: f64 = value.parse().unwrap();
        let more = if key == "temperature_c" {
            number + 1.0
        } else {
            1.01 * number
        };
        let edited = design.replace(line, &line.replacen(value, &format!("{more:?}"), 1));
        let changed = evaluated(folder.path(), &edited);
        for (column, told) in cells[2..5].iter().enumerate() {
            let found = 100.0 * (changed[column] / as_given[column] - 1.0);
            let found = if found.abs() < 0.005 {
                "0".to_owned()
            } else {
                format!("{found:+.1} %")
            };
            assert_eq!(*told, found, "{row}");
        }
        checked += 1;
    }
    assert_eq!(checked, 8);
}

#[test]
fn the_warnings_of_the_table_are_what_is_said() {
    let folder = place();
    let tutorial = page(TUTORIAL);
    for block in blocks(&tutorial) {
        for name in ["desk.toml", "plate.toml"] {
            if block.before.contains(name) && block.language == "toml" {
                fs::write(folder.path().join(name), &block.text).unwrap();
            }
        }
    }
    let cases = [
        (
            "no current within the limits pushes the magnet up",
            "sed s/repel/attract/ desk.toml > a.toml; fluxform lambda a.toml plate.toml",
        ),
        (
            "lie outside the design's workspace",
            "sed 's/height_mm = 25/height_mm = 60/' plate.toml > high.toml
             fluxform calibrate desk.toml high.toml --no-report --out high",
        ),
        (
            "turns are more than the",
            "sed 's/= 900/= 1300/' desk.toml > w.toml; fluxform evaluate w.toml",
        ),
        (
            "above the steel's knee",
            "sed 's/_max_a = 2.0/_max_a = 20.0/; s/= 36.0/= 200.0/' designs/seed.toml > k.toml
             fluxform evaluate k.toml",
        ),
    ];
    let table = section("When the force is wrong");
    let rows = table.lines().filter(|line| line.starts_with("| `")).count();
    assert_eq!(rows, cases.len());
    for (message, script) in cases {
        assert!(table.contains(&format!("`{message}`")), "{message}");
        let ran = shell(folder.path(), script);
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        // Long messages are wrapped.
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(message), "{script}\n{said}");
    }
}
