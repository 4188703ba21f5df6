//! The tutorial: its files are written, its commands run in order, its outputs compared.

use fluxform_testing::place::Place;

use crate::pages::{blocks, lasting, page, section};
use fluxform_testing::needs::{self, Trial};
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [the_table_of_what_one_percent_changes_is_true, the_warnings_of_the_table_are_what_is_said, the_tutorial_runs_and_prints_what_it_shows, the_better_display_is_found_as_shown],
        needs::numpy() => [the_tutorial_runs_with_python],
        needs::c_compiler() => [the_tutorial_runs_with_a_c_compiler],
        needs::octave() => [the_tutorial_runs_with_octave],
    }
}

/// The tutorial of arrays.
const BETTER: &str = "designs/better_display.md";
const TUTORIAL: &str = "designs/first_display.md";

/// A folder with the repository's scripts, designs and shapes.
fn place() -> Place {
    Place::with(&["scripts", "designs", "shapes", "src"])
}

/// A program that a block of the tutorial needs.
#[derive(Clone, Copy, PartialEq)]
enum Tool {
    Octave,
    C,
    Python,
}

/// Requirements of a script.
fn tool(script: &str) -> Option<Tool> {
    if script.contains("octave-cli") {
        Some(Tool::Octave)
    } else if script.contains("cc -std") {
        Some(Tool::C)
    } else if script.contains("python3") {
        Some(Tool::Python)
    } else {
        None
    }
}

/// Runs the tutorial's blocks that need nothing or `with`.
fn tutorial(with: Option<Tool>) {
    let (place, files, commands, with_tool, outputs) = run(TUTORIAL, with);
    assert_eq!(files, 6);
    assert!(commands >= 4 && outputs >= 4, "{commands} {outputs}");
    assert!(with.is_none() || with_tool > 0, "no block needs the tool");
    if place.path("table.csv").exists() {
        the_row_of_a_position(&place.text("table.csv"));
    }
}

fn the_better_display_is_found_as_shown() {
    let (place, files, commands, _, outputs) = run(BETTER, None);
    assert_eq!((files, commands, outputs), (1, 6, 3));
    assert!(place.text("trade.csv").starts_with("quantity,value,gain,"));
}

/// Runs the blocks of a page that need nothing or `with`, in order, and compares what they print; how many
/// files were written, commands run, of these with the tool, and outputs compared.
fn run(name: &str, with: Option<Tool>) -> (Place, usize, usize, usize, usize) {
    let place = place();
    let mut printed: Option<String> = None;
    let (mut files, mut commands, mut with_tool, mut outputs) = (0, 0, 0, 0);
    for block in blocks(&page(name)) {
        match block.language.as_str() {
            "sh" => {
                printed = None;
                let needs = tool(&block.text);
                if needs.is_some() && needs != with {
                    continue;
                }
                printed = Some(place.shell(&block.text).ends(0).out);
                with_tool += usize::from(needs.is_some());
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
                place.write(name, &block.text);
                files += 1;
            }
        }
    }
    (place, files, commands, with_tool, outputs)
}

fn the_tutorial_runs_and_prints_what_it_shows() {
    tutorial(None);
}

fn the_tutorial_runs_with_python() {
    tutorial(Some(Tool::Python));
}

fn the_tutorial_runs_with_a_c_compiler() {
    tutorial(Some(Tool::C));
}

fn the_tutorial_runs_with_octave() {
    tutorial(Some(Tool::Octave));
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
fn evaluated(place: &Place, text: &str) -> [f64; 3] {
    place.write("tried.toml", text);
    let report = place
        .run(&["evaluate", "tried.toml", "--format", "json"])
        .ends(0)
        .json();
    [
        "/coil/resistance_ohm",
        "/coil/inductance_h",
        "/target/force_n",
    ]
    .map(|key| report.pointer(key).unwrap().as_f64().unwrap())
}

fn the_table_of_what_one_percent_changes_is_true() {
    let place = place();
    let tutorial = page(TUTORIAL);
    let design = &blocks(&tutorial)[0].text;
    let as_given = evaluated(&place, design);
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
        let changed = evaluated(&place, &edited);
        for (column, reported) in cells[2..5].iter().enumerate() {
            let found = 100.0 * (changed[column] / as_given[column] - 1.0);
            let found = if found.abs() < 0.005 {
                "0".to_owned()
            } else {
                format!("{found:+.1} %")
            };
            assert_eq!(*reported, found, "{row}");
        }
        checked += 1;
    }
    assert_eq!(checked, 8);
}

fn the_warnings_of_the_table_are_what_is_said() {
    let place = place();
    let tutorial = page(TUTORIAL);
    for block in blocks(&tutorial) {
        for name in ["desk.toml", "plate.toml"] {
            if block.before.contains(name) && block.language == "toml" {
                place.write(name, &block.text);
            }
        }
    }
    let cases = [
        (
            "no currents within the limits, alike at all these points, push the magnet up",
            "sed s/repel/attract/ desk.toml > a.toml; fluxform lambda a.toml plate.toml",
        ),
        (
            "outside the design's workspace",
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
        // Long messages are wrapped.
        let said = place.shell(script).err;
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(message), "{script}\n{said}");
    }
}
