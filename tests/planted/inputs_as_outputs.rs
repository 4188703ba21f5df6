//! An input named as an output too, however it is spelt: it must survive, even with `--force`.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

use crate::cases::Prepared;
use fluxform_testing::tree::copy;

use crate::commands::{run, words};
use crate::judge::Row;
use crate::snapshot::{change, snapshot};

/// How an input is spelt as an output.
const SPELLINGS: [&str; 7] = [
    "as it is",
    "./",
    "folder/../",
    "absolute",
    "link",
    "hard link",
    "through a linked folder",
];

/// Flags that name an output file.
const FLAGS: [&str; 8] = [
    "--out",
    "--plot",
    "--plot-field",
    "--plot-where",
    "--report",
    "--trajectory-out",
    "--vfield",
    "--mpem",
];

/// All cases of one command: every output flag with every input in every spelling, with and without
/// `--force`, and after the same command wrote beside it under another ending; every `every`-th.
pub fn rows(prepared: &Prepared, place: &Path, every: usize) -> Vec<Row> {
    let line = words(prepared.writes.line);
    let inputs: Vec<String> = snapshot(&prepared.inputs)
        .into_keys()
        .filter(|path| prepared.inputs.join(path).is_file())
        .filter(|path| {
            line.iter()
                .any(|word| path == word || path.starts_with(&format!("{word}/")))
        })
        .collect();
    let mut rows = Vec::new();
    let mut number = 0;
    for (at, flag) in line.iter().enumerate() {
        let is_file = line.get(at + 1).is_some_and(|value| value.contains('.'));
        if !FLAGS.contains(&flag.as_str()) || !is_file {
            continue;
        }
        for input in &inputs {
            for spelling in SPELLINGS {
                for force in [false, true] {
                    number += 1;
                    if number % every != 0 {
                        continue;
                    }
                    let mut line = line.clone();
                    let laid = lay(prepared, place, input, spelling);
                    // Leaves a sidecar of the same inputs, under the input's own stem.
                    line[at + 1] = format!(
                        "{}.other",
                        laid.trim_end_matches(|c| c != '.').trim_end_matches('.')
                    );
                    run(place, &line);
                    line[at + 1] = laid;
                    if force {
                        line.push("--force".to_owned());
                    }
                    rows.push(row(prepared, place, &line, (flag, spelling, force)));
                    fs::remove_dir_all(place).unwrap();
                }
            }
        }
    }
    rows
}

/// Makes the place and the spelling; returns what the flag is given.
fn lay(prepared: &Prepared, place: &Path, input: &str, spelling: &str) -> String {
    copy(&prepared.inputs, place);
    let there = place.join(input);
    let ending = Path::new(input).extension().unwrap().to_string_lossy();
    match spelling {
        "as it is" => input.to_owned(),
        "./" => format!("./{input}"),
        "folder/../" => format!("victims/folder/../../{input}"),
        "absolute" => there.display().to_string(),
        "link" => {
            symlink(&there, place.join(format!("link.{ending}"))).unwrap();
            format!("link.{ending}")
        }
        "hard link" => {
            fs::hard_link(&there, place.join(format!("hard.{ending}"))).unwrap();
            format!("hard.{ending}")
        }
        "through a linked folder" => {
            symlink(there.parent().unwrap(), place.join("linked")).unwrap();
            format!("linked/{}", there.file_name().unwrap().to_string_lossy())
        }
        other => panic!("{other}"),
    }
}

fn row(
    prepared: &Prepared,
    place: &Path,
    line: &[String],
    (flag, spelling, force): (&str, &'static str, bool),
) -> Row {
    let kept = snapshot(&prepared.inputs);
    let before = snapshot(place);
    let ran = run(place, line);
    let after = snapshot(place);
    let mut changed: Vec<String> = kept
        .keys()
        .filter_map(|path| change(path, &before, &after))
        .collect();
    if ran.code == Some(0) && changed.is_empty() {
        // A hard link may be parted from its input, which then keeps its bytes.
        let parted = spelling == "hard link" && force;
        if !parted {
            changed.push("an input is accepted as an output".to_owned());
        }
    }
    if ran.code.is_none_or(|code| code == 101) {
        changed.push("the program is killed or panics".to_owned());
    }
    Row {
        command: prepared.writes.name,
        at: format!(
            "{flag} {}",
            line[line.iter().position(|word| word == flag).unwrap() + 1]
        ),
        planted: spelling,
        after_a_run: true,
        force,
        refused: false,
        code: ran.code,
        changed,
        said: ran.said,
    }
}
