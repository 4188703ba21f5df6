//! Sweeps: plans, shards, kills, and that nothing of it shows in the merged bytes.

use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::Value;

use crate::SEED;
use fluxform_testing::place::Place;

const FILES: [&str; 3] = ["sweep.csv", "sweep.svg", "sweep_pareto.csv"];

/// A plan of 7 x 13 x 3 designs.
fn planned(place: &Place) {
    place
        .run(&[
            "sweep",
            "plan",
            SEED,
            "--set",
            "wire.diameter_mm=0.5:0.8:0.05",
            "--set",
            "coil.outer_diameter_mm=26:38:1",
            "--set",
            "limits.resistance_max_ohm=4,6,8",
            "--out",
            "plan.json",
        ])
        .ends(0);
}

fn merged(place: &Place, folder: &str, out: &str) -> Vec<Vec<u8>> {
    let table = format!("{out}/sweep.csv");
    place
        .run(&["sweep", "merge", "plan.json", folder, "--out", &table])
        .ends(0);
    FILES
        .map(|file| place.read(&format!("{out}/{file}")))
        .to_vec()
}

fn point(folder: &str, index: usize) -> String {
    format!("{folder}/points/{:03}/{index:06}.json", index / 1000)
}

#[test]
fn shards_and_threads_leave_no_trace() {
    let place = Place::new();
    planned(&place);
    for (threads, out) in [("1", "one"), ("2", "two")] {
        let args = ["sweep", "run", "plan.json", "--threads", threads, "--out"];
        place.run(&[&args[..], &[out]].concat()).ends(0);
    }
    let shards = ["3/7", "1/7", "7/7", "2/7", "5/7", "6/7", "4/7"];
    for (number, shard) in shards.iter().enumerate() {
        // Two folders, as of two machines.
        let out = if number < 3 { "here" } else { "there" };
        place
            .run(&["sweep", "run", "plan.json", "--shard", shard, "--out", out])
            .ends(0);
    }
    let whole = merged(&place, "one", "a");
    assert!(whole == merged(&place, "two", "b"));
    place
        .run(&[
            "sweep",
            "merge",
            "plan.json",
            "here",
            "there",
            "--out",
            "c/sweep.csv",
        ])
        .ends(0);
    for (file, bytes) in FILES.iter().zip(&whole) {
        assert!(*bytes == place.read(&format!("c/{file}")), "{file}");
    }
    let table = String::from_utf8(whole[0].clone()).unwrap();
    let mut rows = table.lines();
    let head = rows.next().unwrap();
    assert!(head.starts_with(
        "index,wire.diameter_mm,coil.outer_diameter_mm,limits.resistance_max_ohm,turns,"
    ));
    let rows: Vec<Vec<&str>> = rows.map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 7 * 13 * 3);
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(row[0], index.to_string());
    }
    assert_eq!(rows[0][1..4], ["0.5", "26", "4"]);
    assert_eq!(rows[1][1..4], ["0.5", "26", "6"]);
    assert_eq!(rows[3][1..4], ["0.5", "27", "4"]);
    assert_eq!(rows[272][1..4], ["0.8", "38", "8"]);
    // The limit decides what is met and nothing else.
    let met = head
        .split(',')
        .position(|name| name == "limits_met")
        .unwrap();
    assert_eq!(rows[0][4..met], rows[2][4..met]);
    let stdout = place.run(&["sweep", "merge", "plan.json", "one", "--out", "-"]);
    assert_eq!(stdout.ends(0).out, table);
}

#[test]
fn a_row_is_what_evaluate_says() {
    let place = Place::new();
    let values = [
        "--set",
        "wire.diameter_mm=0.55",
        "--set",
        "coil.length_mm=70",
    ];
    let plan = ["sweep", "plan", SEED, "--out", "plan.json"];
    place.run(&[&plan[..], &values].concat()).ends(0);
    place
        .run(&["sweep", "run", "plan.json", "--out", "p"])
        .ends(0);
    let text: Value = serde_json::from_slice(&place.read(&point("p", 0))).unwrap();
    let design = place
        .text(SEED)
        .replace("diameter_mm = 0.7", "diameter_mm = 0.55");
    let design = design.replace("length_mm = 100.0", "length_mm = 70.0");
    place.write("design.toml", &design);
    let reported = place.run(&["evaluate", "design.toml", "--format", "json"]);
    let reported = reported.ends(0).json();
    let row = &text["row"];
    for key in [
        "turns",
        "resistance_ohm",
        "inductance_h",
        "settling_s",
        "power_w",
        "mass_kg",
        "wire_length_m",
    ] {
        assert_eq!(row[key], reported["coil"][key], "{key}");
    }
    for key in ["current_a", "gradient_t_per_m_per_a", "force_n"] {
        assert_eq!(row[key], reported["target"][key], "{key}");
    }
    let limits = reported["limits"].as_object().unwrap();
    let met = limits.values().all(|limit| limit["met"] == true);
    assert_eq!(row["limits_met"], met);
}

/// A sweep looked at the coil alone: a limit on the array's settling was no limit, and a current loop's coil took five
/// time constants.
#[test]
fn a_row_has_the_limits_and_the_settling_time_of_evaluate() {
    let place = Place::new();
    let limited = |most_ms: f64, driver: &str| {
        let limits = format!("[limits]\narray_settling_max_ms = {most_ms}\n");
        let supply = format!("[supply]\ndriver = \"{driver}\"\n");
        let text = place.text(SEED).replace("[limits]", &limits);
        let text = text.replace("[supply]", &supply);
        text.replace("turns = 1429", "turns = 1400")
    };
    for (driver, limits) in [("voltage", [9.0, 40.0]), ("current", [1.0, 40.0])] {
        let mut met = Vec::new();
        for most_ms in limits {
            place.write("design.toml", &limited(most_ms, driver));
            let set = ["--set", "limits.resistance_max_ohm=9"];
            let plan = ["sweep", "plan", "design.toml", "--force"];
            place.run(&[&plan[..], &set].concat()).ends(0);
            let run = ["sweep", "run", "plan.json", "--out", "p", "--force"];
            place.run(&run).ends(0);
            place.write(
                "one.toml",
                &place
                    .text("design.toml")
                    .replace("resistance_max_ohm = 6.0", "resistance_max_ohm = 9"),
            );
            let reported = place.run(&["evaluate", "one.toml", "--format", "json"]);
            let reported = reported.ends(0).json();
            let limits = &reported["limits"];
            let mut all = limits.as_object().unwrap().values();
            let all_met = all.all(|limit| limit["met"] == true);
            let row: Value = serde_json::from_slice(&place.read(&point("p", 0))).unwrap();
            assert_eq!(row["row"]["limits_met"], all_met, "{most_ms} {limits}");
            assert_eq!(row["row"]["settling_s"], limits["settling_s"]["value"]);
            met.push(limits["array_settling_s"]["met"].as_bool().unwrap());
        }
        assert_eq!(met, [false, true], "{driver}");
    }
}

fn spawn(place: &Place, args: &[&str]) -> Child {
    let mut command = place.command(args);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

fn wait_for(path: &Path) {
    for _ in 0..60_000 {
        if path.exists() {
            return;
        }
        sleep(Duration::from_millis(1));
    }
    panic!("{} never came", path.display());
}

fn long_plan(place: &Place) {
    let set = [
        "--set",
        "target.height_mm=10:69.9:0.1",
        "--set",
        "coil.turns=700,1300,1429",
    ];
    let plan = ["sweep", "plan", SEED, "--out", "plan.json"];
    place.run(&[&plan[..], &set].concat()).ends(0);
}

#[test]
fn a_run_that_is_killed_three_times_ends_as_if_it_had_not_been() {
    let place = Place::new();
    long_plan(&place);
    let run = ["sweep", "run", "plan.json", "--threads", "1", "--out"];
    for index in [200, 700, 1200] {
        let mut child = spawn(&place, &[&run[..], &["killed"]].concat());
        wait_for(&place.path(&point("killed", index)));
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().code(), None, "killed, not ended");
        assert!(!place.path(&point("killed", 1799)).exists());
    }
    let json = [&run[..], &["killed", "--format", "json"]].concat();
    let last = place.run(&json).ends(0).json();
    assert!(last["kept"].as_u64().unwrap() > 1200, "{last}");
    assert_eq!(last["points"], 1800);
    let left = ["000", "001"].map(|folder| {
        let entries = place.path("killed/points").join(folder).read_dir().unwrap();
        entries.count()
    });
    assert_eq!(left, [1000, 800], "no temporary files are left");
    place
        .run(&["sweep", "run", "plan.json", "--out", "whole"])
        .ends(0);
    assert!(merged(&place, "killed", "a") == merged(&place, "whole", "b"));
}

#[test]
fn two_runs_may_share_a_folder() {
    let place = Place::new();
    planned(&place);
    let run = [
        "sweep",
        "run",
        "plan.json",
        "--force",
        "--threads",
        "1",
        "--out",
        "shared",
    ];
    let both = [spawn(&place, &run), spawn(&place, &run)];
    for mut child in both {
        assert_eq!(child.wait().unwrap().code(), Some(0));
    }
    place
        .run(&["sweep", "run", "plan.json", "--out", "alone"])
        .ends(0);
    assert!(merged(&place, "shared", "a") == merged(&place, "alone", "b"));
    let count = place.path("shared/points/000").read_dir().unwrap().count();
    assert_eq!(count, 273);
}

#[test]
fn an_interrupted_run_keeps_its_points() {
    let place = Place::new();
    long_plan(&place);
    let run = ["sweep", "run", "plan.json", "--threads", "1", "--out", "p"];
    let mut child = spawn(&place, &run);
    wait_for(&place.path(&point("p", 200)));
    let sent = std::process::Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(place.path(&point("p", 200)).exists());
    place
        .run(&["sweep", "merge", "plan.json", "p"])
        .ends(4)
        .says(&["of 1800 points are missing", "-1799", "--partial"]);
    assert!(!place.path("sweep.csv").exists());
    let reported = place.run(&[
        "sweep",
        "merge",
        "plan.json",
        "p",
        "--partial",
        "--format",
        "json",
    ]);
    let reported = reported.ends(0).json();
    assert!(
        reported["warnings"][0]
            .as_str()
            .unwrap()
            .contains("are missing")
    );
    let sum = reported["rows"].as_u64().unwrap() + reported["missing"].as_u64().unwrap();
    assert_eq!(sum, 1800);
    // The same plan's fuller table replaces it.
    place
        .run(&[&run[..], &["--threads", "2"][..0]].concat())
        .ends(0);
    place.run(&["sweep", "merge", "plan.json", "p"]).ends(0);
}

#[test]
fn a_partial_merge_leaves_a_fuller_table_alone() {
    let place = Place::new();
    planned(&place);
    for (shard, out) in [("1/7", "some"), ("1/3", "more")] {
        let run = ["sweep", "run", "plan.json", "--shard", shard, "--out", out];
        place.run(&run).ends(0);
    }
    let merge = |folder| ["sweep", "merge", "plan.json", folder, "--partial"];
    place.run(&merge("some")).ends(0);
    place.run(&merge("more")).ends(0);
    let fuller = place.read("sweep.csv");
    place
        .run(&merge("some"))
        .ends(4)
        .says(&["fuller", "misses 182", "234 are missing", "--force"]);
    assert!(place.read("sweep.csv") == fuller);
    // A folder that was mistyped was passed over.
    let run = merge("mroe");
    place.run(&run).ends(4).says(&["mroe: no such folder"]);
    place
        .run(&[&merge("some")[..], &["--force"]].concat())
        .ends(0);
    assert!(place.read("sweep.csv") != fuller);
}

#[test]
fn torn_points_are_computed_again_and_foreign_ones_are_left_alone() {
    let place = Place::new();
    planned(&place);
    let run = ["sweep", "run", "plan.json", "--out", "p"];
    place.run(&run).ends(0);
    let whole = merged(&place, "p", "a");
    let text = String::from_utf8(place.read(&point("p", 7))).unwrap();
    place.write(&point("p", 7), "");
    place.write(&point("p", 8), &text[..100]);
    place.write(&point("p", 9), &text[..1]);
    place
        .run(&["sweep", "merge", "plan.json", "p", "--out", "b.csv"])
        .ends(4)
        .says(&["3 of 273 points are missing: 7-9"]);
    let reported = place.run(&[&run[..], &["--format", "json"]].concat());
    assert_eq!(reported.ends(0).json()["computed"], 3);
    assert!(whole == merged(&place, "p", "b"));

    // An edited point is the user's.
    let edited = text.replace("\"turns\": 1", "\"turns\": 2");
    assert_ne!(edited, text);
    place.write(&point("p", 7), &edited);
    place.run(&run).ends(4).says(&["000007.json", "--force"]);
    assert_eq!(place.read(&point("p", 7)), edited.as_bytes());
    place.write(&point("p", 7), "precious\n");
    place.run(&run).ends(4).says(&["000007.json", "--force"]);
    assert_eq!(place.read(&point("p", 7)), b"precious\n");
    place
        .run(&["sweep", "merge", "plan.json", "p", "--out", "c.csv"])
        .ends(4)
        .says(&["000007.json"]);
    place
        .run(&[&run[..], &["--index", "7", "--force"]].concat())
        .ends(0);
    assert!(whole == merged(&place, "p", "d"));
}

#[test]
fn points_of_another_plan_are_refused() {
    let place = Place::new();
    planned(&place);
    let other = [
        "sweep",
        "plan",
        SEED,
        "--set",
        "coil.turns=700:760:1",
        "--out",
        "other.json",
    ];
    place.run(&other).ends(0);
    place
        .run(&["sweep", "run", "plan.json", "--shard", "1/7", "--out", "p"])
        .ends(0);
    let run = ["sweep", "run", "other.json", "--shard", "2/2", "--out", "p"];
    place
        .run(&run)
        .ends(4)
        .says(&["another plan", "p/plan.json"]);
    place.run(&[&run[..], &["--force"]].concat()).ends(0);
    // The folder is the other plan's by now, and has points of both.
    for (plan, why) in [
        ("plan.json", "the folder holds another sweep"),
        ("other.json", "belongs to another plan"),
    ] {
        place
            .run(&["sweep", "merge", plan, "p", "--partial"])
            .ends(4)
            .says(&[why]);
    }
}

/// A folder after one that had all points was not looked at.
#[test]
fn regression_a_folder_of_another_plan_was_ignored_after_a_whole_one() {
    let place = Place::new();
    let set = |turns: &str| format!("coil.turns={turns}");
    for (name, turns) in [("one", "700,760"), ("two", "800,860")] {
        let plan = format!("{name}.json");
        let args = ["sweep", "plan", SEED, "--set", &set(turns), "--out", &plan];
        place.run(&args).ends(0);
        place.run(&["sweep", "run", &plan, "--out", name]).ends(0);
    }
    for folders in [["one", "two"], ["two", "one"]] {
        place
            .run(&[&["sweep", "merge", "one.json"][..], &folders].concat())
            .ends(4)
            // It was to be replaced with --force, which did nothing.
            .says(&[
                "another plan",
                "merge the folder with the plan that it was run with",
            ]);
    }
    place.run(&["sweep", "merge", "one.json", "one"]).ends(0);
}

#[test]
fn an_edited_plan_is_refused() {
    let place = Place::new();
    planned(&place);
    let text = String::from_utf8(place.read("plan.json")).unwrap();
    place.write("edited.json", &text.replace("0.55", "0.56"));
    for step in [&["run"][..], &["merge"]] {
        let (folder, out): (&[&str], &[&str]) = match step[0] {
            "run" => (&[], &["--out", "p"]),
            _ => (&["p"], &["--out", "s.csv"]),
        };
        place
            .run(&[&["sweep"], step, &["edited.json"], folder, out].concat())
            .ends(3)
            .says(&["edited.json", "changed after it was made", "sweep plan"]);
    }
    place
        .run(&["sweep", "run", SEED, "--out", "p"])
        .ends(3)
        .says(&["not a plan"]);
    place
        .run(&["sweep", "run", "none.json", "--out", "p"])
        .ends(3);
    assert!(!place.path("p").exists());
    // The same plan again is no matter, another one is.
    planned(&place);
    place
        .run(&[
            "sweep",
            "plan",
            SEED,
            "--set",
            "coil.turns=700",
            "--out",
            "plan.json",
        ])
        .ends(4)
        .says(&["plan.json", "--force"]);
}

#[test]
fn absurd_settings_are_wrong_usage_and_bad_values_bad_input() {
    let place = Place::new();
    let plan = ["sweep", "plan", SEED, "--out", "-", "--set"];
    for (set, said) in [
        ("coil.turns=1:2:0", "STEP is 0"),
        ("coil.turns=1:2:-1", "leads down"),
        ("coil.turns=1:1e12:1", "values are more than"),
        ("coil.turns=", "empty value"),
        ("coil.turns=nan", "finite"),
        ("coil.turns", "KEY=FROM:TO:STEP"),
    ] {
        place
            .run(&[&plan[..], &[set]].concat())
            .ends(2)
            .says(&[said]);
    }
    let twice = ["coil.turns=1,2", "--set", "coil.turns=3"];
    place
        .run(&[&plan[..], &twice].concat())
        .ends(2)
        .says(&["coil.turns"]);
    place.run(&plan[..5]).ends(2).says(&["--set"]);
    let ran = place.run(&[&plan[..], &["wire.diameter_mm=0.7,-0.7"]].concat());
    let ran = ran.ends(3).says(&["wire.diameter_mm = -0.7"]);
    assert!(ran.out.is_empty());
    let ran = place.run(&[&plan[..], &["wire.diametre_mm=0.7"]].concat());
    ran.ends(3).says(&["did you mean diameter_mm?"]);
    planned(&place);
    let run = ["sweep", "run", "plan.json", "--out", "p"];
    place.run(&[&run[..], &["--shard", "4/3"]].concat()).ends(2);
    place
        .run(&[&run[..], &["--index", "273"]].concat())
        .ends(2)
        .says(&["272"]);
}

#[test]
fn a_design_that_cannot_be_computed_is_a_row() {
    let place = Place::new();
    let sets = [
        "--set",
        "coil.inner_diameter_mm=24,36,39",
        "--set",
        "array.coupling=full,none",
    ];
    let plan = ["sweep", "plan", SEED, "--out", "plan.json"];
    place.run(&[&plan[..], &sets].concat()).ends(0);
    let run = ["sweep", "run", "plan.json", "--out", "p"];
    let said = [
        "2 of 6 designs cannot be computed",
        "point 4",
        "coil.outer_diameter_mm",
    ];
    place.run(&run).ends(4).says(&said);
    // Nothing is left to do, and that still does not meet the request.
    place.run(&run).ends(4).says(&said);
    place.run(&[&run[..], &["--allow-failed"]].concat()).ends(0);
    place.run(&["sweep", "merge", "plan.json", "p"]).ends(0);
    let table = String::from_utf8(place.read("sweep.csv")).unwrap();
    let rows: Vec<&str> = table.lines().collect();
    assert!(rows[1].starts_with("0,24,full,1429,") && rows[1].ends_with(",done,"));
    assert!(
        rows[5].starts_with("4,39,full,,,") && rows[5].contains(",failed,"),
        "{table}"
    );
}

#[test]
fn each_step_explains_itself_and_its_examples_work() {
    let place = Place::new();
    for step in ["plan", "run", "merge"] {
        let page = place.run(&["sweep", step, "--help"]).ends(0).out;
        let about = page.split("\n\n").nth(1).unwrap();
        assert!(about.len() > 100, "{step}: {about}");
        let examples = page.split("Examples:").nth(1).unwrap().replace("\\\n", "");
        let lines: Vec<&str> = examples.lines().map(str::trim).collect();
        let lines = lines.iter().filter(|line| line.starts_with("fluxform "));
        for line in lines.clone() {
            let ran = place.shell(line);
            assert_eq!(ran.code, Some(0), "{line}: {ran:#?}");
        }
        assert!(lines.count() >= 2, "{examples}");
    }
}

#[test]
fn one_key_is_drawn_as_a_curve_and_two_as_a_map() {
    let place = Place::new();
    let outer = ["--set", "coil.outer_diameter_mm=34:38:2"];
    let inner = ["--set", "coil.inner_diameter_mm=20,23,26"];
    let wire = ["--set", "wire.diameter_mm=0.6,0.7"];
    let run = |name: &str, keys: &[[&str; 2]]| {
        let plan = format!("{name}.json");
        let plan_args = ["sweep", "plan", "designs/seed_air.toml", "--out", &plan];
        place
            .run(&[&plan_args[..], &keys.concat()].concat())
            .ends(0);
        place.run(&["sweep", "run", &plan, "--out", name]).ends(0);
    };
    let merge = |name: &str, plot: &str| {
        let (plan, table) = (format!("{name}.json"), format!("{name}.csv"));
        place.run(&[
            "sweep", "merge", &plan, name, "--out", &table, "--plot", plot,
        ])
    };
    run("two", &[inner, outer]);
    merge("two", "map.svg").ends(0).says(&["written: map.svg"]);
    let svg = String::from_utf8(place.read("map.svg")).unwrap();
    for text in [
        "coil.inner_diameter_mm",
        "coil.outer_diameter_mm",
        "force on the magnet / mN",
        "hatched: breaks a limit",
        "strongest within its limits",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    run("one", &[outer]);
    merge("one", "curve.png").ends(0);
    assert!(place.read("curve.png").starts_with(b"\x89PNG"));
    run("three", &[inner, outer, wire]);
    merge("three", "drawn.svg")
        .ends(4)
        .says(&["this plan has 3"]);
    assert!(!place.path("drawn.svg").exists() && !place.path("three.csv").exists());
    merge("two", "-").ends(0);
    let both = [
        "sweep", "merge", "two.json", "two", "--out", "-", "--plot", "-",
    ];
    place
        .run(&both)
        .ends(2)
        .says(&["only one can go to standard output"]);
}
