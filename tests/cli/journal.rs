//! The journal of `optimize --for`: written now and then and last, shared by runs side by side, believed under its seal alone.

use std::collections::BTreeSet;
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use fluxform_testing::place::Place;
use fluxform_testing::run::Ran;
use serde_json::Value;

/// A quick search of the pitch of four coils.
const SEARCH: [&str; 7] = [
    "optimize",
    "search.toml",
    "--for",
    "dome.toml",
    "--starts",
    "1",
    "--journal",
];

fn place() -> Place {
    let place = Place::empty();
    place.write(
        "search.toml",
        "name = \"search\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\nlength_mm = 60\n[wire]\n\
         diameter_mm = 0.7\n[array]\nrows = 2\ncolumns = 2\npitch_mm = 50\n[supply]\ncurrent_max_a = 2\n\
         [search.array]\npitch_mm = [40, 60]\n[workspace]\nx_mm = [-40, 40, 9]\ny_mm = [-40, 40, 9]\n\
         z_mm = [15, 60, 10]\n",
    );
    place.write(
        "dome.toml",
        "name = \"dome\"\nprimitive = \"half-sphere\"\nradius_mm = 30\nbase_mm = 20\n[points]\n\
         x_mm = [-37, 37, 9]\ny_mm = [-33, 33, 8]\n",
    );
    place
}

fn search<'a>(journal: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&SEARCH[..], &[journal], more].concat()
}

/// The names of a journal's arrays.
fn arrays(journal: &str) -> BTreeSet<String> {
    let (_mark, record) = journal.split_once('\n').unwrap();
    let record: Value = serde_json::from_str(record).unwrap();
    let arrays = record["arrays"].as_object().unwrap();
    arrays.keys().cloned().collect()
}

/// The whole search was lost, on the screen and in files on other disks, where its journal could not be written.
#[test]
fn regression_a_full_disk_under_the_journal_took_the_result_away() {
    let place = place();
    // Files end at 2 KiB: room for a design, not for a journal.
    let ran = place.shell(
        "ulimit -f 4; exec fluxform optimize search.toml --for dome.toml --starts 1 --evaluations 12 \
         --journal kept.json --out best.toml --format json",
    );
    let ran = ran.ends(4).says(&["E406", "kept.json"]);
    assert_eq!(ran.json()["status"], "done");
    assert!(!place.path("kept.json").exists());
    place.run(&["evaluate", "best.toml"]).ends(0);
}

/// A run that was killed lost every array: the journal was written at its end alone.
#[test]
fn regression_a_killed_run_left_no_journal() {
    let place = place();
    let vary = [
        "--vary",
        "coil.outer_diameter_mm=30:40",
        "--vary",
        "coil.length_mm=30:70",
    ];
    let long = [
        &vary[..],
        &["--evaluations", "100000", "--front", "front.csv"],
    ]
    .concat();
    let mut child = place
        .command(&search("kept.json", &long))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !place.path("kept.json").exists() {
        sleep(Duration::from_millis(20));
    }
    assert!(child.try_wait().unwrap().is_none(), "ended by itself");
    child.kill().unwrap();
    child.wait().unwrap();
    let left = arrays(&place.text("kept.json"));
    let short = [&vary[..], &["--evaluations", "4", "--format", "json"]].concat();
    place.run(&search("kept.json", &short)).ends(0);
    assert!(left.len() > 3 && arrays(&place.text("kept.json")).is_superset(&left));
}

/// How a search goes on from the journal `early` where `late` takes the place of that before it writes its own.
#[allow(clippy::disallowed_methods)] // a test's own folder
fn replaced_meanwhile(place: &Place, early: &str, late: &str) -> Ran {
    place.write("shared/kept.json", early);
    let held = std::fs::File::open(place.path("shared")).unwrap();
    held.lock().unwrap();
    let options = ["--evaluations", "4", "--seed", "3", "--format", "json"];
    let mut child = place
        .command(&search("shared/kept.json", &options))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let files = || place.path("shared").read_dir().unwrap().count();
    while files() == 1 {
        assert!(child.try_wait().unwrap().is_none(), "ended before it wrote");
        sleep(Duration::from_millis(5));
    }
    place.write("shared/kept.json", late);
    held.unlock().unwrap();
    Ran::of(child.wait_with_output().unwrap())
}

/// The later of two runs was refused at its end and lost its result, with the advice to replace the other's arrays.
#[test]
fn regression_the_later_of_two_runs_with_one_journal_lost_its_result() {
    let place = place();
    let ours = search("other.json", &["--evaluations", "2"]);
    place.run(&ours).ends(0);
    let early = place.text("other.json");
    place.run(&[&ours[..], &["--seed", "2"]].concat()).ends(0);
    let late = place.text("other.json");
    assert_ne!(early, late);
    let result = replaced_meanwhile(&place, &early, &late).ends(0).json();
    assert_eq!(result["status"], "done");
    let (all, other) = (arrays(&place.text("shared/kept.json")), arrays(&late));
    assert!(all.len() > other.len() && all.is_superset(&other));
    // One of another design is left alone.
    let foreign = late.replacen("search.toml", "a.toml", 1);
    let ran = replaced_meanwhile(&place, &early, &foreign).ends(4);
    assert_eq!(ran.json(), result);
    assert_eq!(place.text("shared/kept.json"), foreign);
    let ran = ran.says(&["E406", "choose another --journal"]);
    assert!(!ran.err.contains("--force"), "{}", ran.err);
}

/// Force constants half as large again were believed, and the result called proven.
#[test]
fn regression_a_journal_was_believed_whatever_it_said() {
    let place = place();
    let args = search("kept.json", &["--evaluations", "4", "--format", "json"]);
    let first = place.run(&args).ends(0).json();
    assert_eq!(place.run(&args).ends(0).json(), first);
    let whole = place.text("kept.json");
    let (head, rest) = whole.split_once("\"merits\": [").unwrap();
    let (merit, rest) = rest.split_once(']').unwrap();
    let larger = 1.5 * merit.trim().parse::<f64>().unwrap();
    let changed = format!("{head}\"merits\": [{larger}]{rest}");
    for text in [&changed[..], &whole[..whole.len() - 9], ""] {
        place.write("kept.json", text);
        for force in [&[][..], &["--force"]] {
            place
                .run(&[&args[..], force].concat())
                .ends(if text.is_empty() && force.is_empty() {
                    4
                } else {
                    3
                })
                .says(&["kept.json"]);
        }
        assert_eq!(place.text("kept.json"), text);
    }
}
