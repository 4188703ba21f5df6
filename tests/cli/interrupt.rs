//! Ctrl-C half way.

use std::collections::BTreeSet;
use std::fs::{DirEntry, remove_dir_all, remove_file};
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::SEED;
use fluxform_testing::place::Place;
use fluxform_testing::tree::tree;

fn signal(child: &Child) {
    let sent = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
}

fn wait(mut child: Child) -> (Option<i32>, String) {
    let mut said = String::new();
    child
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut said)
        .unwrap();
    (child.wait().unwrap().code(), said)
}

#[test]
fn a_long_job_stops_and_leaves_nothing_half_written() {
    let place = Place::new();
    // Seconds of work: four million points.
    let child = place
        .command(&[
            "calibrate",
            SEED,
            "shapes/flat.toml",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--translate",
            "0,0,30",
            "--grid",
            "2000x2000",
            "--format",
            "json",
        ])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let finished = place.path("results/seed_air/flat/manifest.json");
    for _ in 0..500 {
        if finished.exists() {
            break;
        }
        sleep(Duration::from_millis(20));
    }
    sleep(Duration::from_millis(200));
    signal(&child);
    let (code, said) = wait(child);
    assert_eq!(code, Some(130), "{said}");
    assert!(said.contains("interrupted"), "{said}");
    assert!(said.contains("\"code\":\"E130\""), "{said}");
    assert!(said.contains("\"exit_code\":130"), "{said}");
    let files = |folder: &str| -> BTreeSet<String> {
        let entries = place.path(folder).read_dir().unwrap();
        let name = |entry: DirEntry| entry.file_name().into_string().unwrap();
        entries.map(|entry| name(entry.unwrap())).collect()
    };
    let left = files("results/seed_air");
    let finished = [".fluxform-cache", "flat"].map(str::to_owned);
    assert_eq!(
        left,
        finished.into(),
        "what was finished is kept, nothing else"
    );
    let kept = files("results/seed_air/.fluxform-cache");
    assert!(
        kept.iter().all(|name| name.ends_with(".points")),
        "{kept:?}"
    );
}

#[test]
fn waiting_for_input_ends_at_once() {
    let place = Place::new();
    let mut child = place
        .command(&["evaluate", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_millis(500));
    let input = child.stdin.take();
    signal(&child);
    let (code, _) = wait(child);
    drop(input);
    assert_eq!(code, Some(130));
}

/// Longest answer to a signal, s: generous, because a loaded machine may not run the process at all
/// for a while. What must not happen on any machine is that no poll ends a computation.
const LONGEST_ANSWER_S: u64 = 5;
/// What the program says where its guard ended it, a tenth of a second after the signal.
const BY_THE_GUARD: &str = "did not stop by itself";
/// User time after the signal that shows a computation at work that did not poll, s: of a process that the
/// machine did not run in that tenth of a second there is less.
const AT_WORK_S: f64 = 0.05;
/// Times that a moment is tried where the guard ended the process at work: one without a poll does so every time.
const TRIES: usize = 4;

/// Processor time of a process in its own code so far, s, also of one that has ended and was not waited for.
#[allow(clippy::disallowed_methods)] // the system's own files
fn user_s(child: &Child) -> f64 {
    let path = format!("/proc/{}/stat", child.id());
    let text = std::fs::read_to_string(path).unwrap_or_default();
    // The name of the program may hold anything but ends with the last parenthesis.
    let after = text.rsplit(") ").next().unwrap_or_default();
    let ticks = after
        .split(' ')
        .nth(11)
        .and_then(|ticks| ticks.parse::<f64>().ok());
    ticks.unwrap_or(0.0) / TICKS_PER_S
}

/// Ticks a second in what Linux reports.
const TICKS_PER_S: f64 = 100.0;

/// How a command ended after a signal.
struct Answer {
    code: Option<i32>,
    said: String,
    took: Duration,
    /// User time after the signal, s.
    worked_s: f64,
}

/// Runs `args` and sends SIGTERM after some time.
#[allow(clippy::disallowed_methods)] // a test's own clock
fn answer(place: &Place, args: &[&str], after_ms: u64) -> Answer {
    let mut child = place
        .command(args)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_millis(after_ms));
    let before_s = user_s(&child);
    if child.try_wait().unwrap().is_none() {
        terminate(&child);
    }
    let sent = Instant::now();
    let mut said = String::new();
    let mut stderr = child.stderr.take().unwrap();
    stderr.read_to_string(&mut said).unwrap();
    let worked_s = user_s(&child) - before_s;
    Answer {
        code: child.wait().unwrap().code(),
        said,
        took: sent.elapsed(),
        worked_s,
    }
}

fn terminate(child: &Child) {
    let sent = Command::new("kill")
        .args(["-TERM", &child.id().to_string()])
        .status();
    assert!(sent.unwrap().success());
}

/// Sends SIGTERM into `args` after each of `after_ms`: the command ends with 130 in time and by a poll, with
/// one message, and nothing of `--out` is there; at least one of the signals reaches it at work. Prints the
/// longest answer.
#[allow(clippy::disallowed_methods)] // a test's own files
#[allow(clippy::print_stderr)] // the longest answer
fn stops(place: &Place, args: &[&str], after_ms: &[u64]) {
    let out = args.iter().skip_while(|arg| **arg != "--out").nth(1);
    let out = out.map(|out| place.path(out));
    let mut longest = Duration::ZERO;
    let (mut reached, mut guarded) = (0, 0);
    for after in after_ms {
        let mut at_work = 0;
        let answer = loop {
            let answer = answer(place, args, *after);
            if !answer.said.contains(BY_THE_GUARD) {
                break answer;
            }
            guarded += 1;
            if answer.worked_s < AT_WORK_S {
                break answer;
            }
            at_work += 1;
            assert!(
                at_work < TRIES,
                "{args:?} after {after} ms: no poll ended it, {:.2} s at work after the signal, {at_work} times",
                answer.worked_s
            );
        };
        let Answer {
            code, said, took, ..
        } = answer;
        assert!(
            took < Duration::from_secs(LONGEST_ANSWER_S),
            "{args:?} after {after} ms: {took:?}"
        );
        if code == Some(0) {
            // It was quicker than the signal, and wrote what it was requested.
            if let Some(out) = &out {
                let remove = if out.is_dir() {
                    remove_dir_all
                } else {
                    remove_file
                };
                remove(out).unwrap();
            }
            continue;
        }
        assert_eq!(code, Some(130), "{args:?} after {after} ms: {said}");
        longest = longest.max(took);
        if let Some(out) = &out {
            let mut left = tree(out);
            // What took long to compute is kept for the next run.
            left.retain(|path, _| !path.contains(".fluxform-cache/"));
            assert!(
                !out.is_file() && left.is_empty(),
                "{args:?} after {after} ms: {:?}",
                left.keys()
            );
        }
        reached += 1;
    }
    assert!(reached > 0, "{args:?} ended before every signal");
    eprintln!("{args:?}: longest answer {longest:.0?}, {guarded} by the guard");
}

/// However long the machine takes to answer: a stop that comes while millions of rows are written ends the
/// command and leaves neither the table nor what was half written of it.
#[test]
fn a_stop_while_a_large_table_is_written_leaves_nothing() {
    let place = Place::new();
    let args = [
        "discretize",
        "shapes/half_sphere.stl",
        "--unit",
        "mm",
        "--grid",
        "1200x1200",
        "--out",
        "out/points.csv",
    ];
    let mut child = place
        .command(&args)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let entries = || place.path("out").read_dir().map_or(0, Iterator::count);
    while entries() == 0 {
        assert!(child.try_wait().unwrap().is_none(), "ended before it wrote");
        sleep(Duration::from_millis(1));
    }
    terminate(&child);
    let (code, said) = wait(child);
    assert_eq!(code, Some(130), "{said}");
    assert_eq!(entries(), 0, "nothing is half written");
}

/// A design of `count` x `count` coils, flat and close, with or without cores.
fn array(count: usize, core: &str, length_mm: f64) -> String {
    format!(
        "name = \"array\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\n\
         length_mm = {length_mm:?}\n[wire]\ndiameter_mm = 0.7\n{core}\n[array]\nrows = {count}\n\
         columns = {count}\npitch_mm = 50.0\n[supply]\ncurrent_max_a = 2.0\n"
    )
}

#[test]
fn a_signal_ends_the_solution_of_steel_in_every_command() {
    let place = Place::new();
    place.write("cores.toml", &array(6, "[core]", 100.0));
    place.write("points.csv", "x_m,y_m,z_m\n0.001,0.002,0.03\n");
    for args in [
        &["evaluate", "cores.toml"][..],
        &["probe", "cores.toml", "points.csv"],
        &["map", "cores.toml", "--out", "map"],
        &["lambda", "cores.toml", "shapes/flat.toml"],
        &[
            "calibrate",
            "cores.toml",
            "shapes/flat.toml",
            "--out",
            "results",
        ],
        &[
            "compare",
            "cores.toml",
            "shapes/flat.toml",
            "shapes/wedge.toml",
        ],
    ] {
        stops(&place, args, &[300, 900]);
    }
}

#[test]
fn a_signal_ends_points_paths_searches_and_stages() {
    let place = Place::new();
    place.write("air.toml", &array(8, "", 100.0));
    let surface = [
        "shapes/half_sphere.stl",
        "--unit",
        "mm",
        "--translate",
        "0,0,30",
        "--grid",
        "2500x2500",
    ];
    let with = |head: &[&'static str]| [head, &surface[..]].concat();
    stops(
        &place,
        &with(&["discretize", "--out", "p.csv"]),
        &[300, 900],
    );
    stops(&place, &with(&["lambda", SEED]), &[300, 1500]);
    // The worst-point path of 64 coils over 3721 points takes minutes.
    stops(
        &place,
        &["lambda", "air.toml", "shapes/flat.toml"],
        &[600, 2500],
    );
    stops(&place, &["optimize", "designs/seed.toml"], &[300, 900]);
}

/// What takes longest: hundreds of coils, steel of any shape, the search of an array, points to an error.
#[test]
fn a_signal_ends_large_arrays_plates_searches_and_requested_errors() {
    let place = Place::new();
    let wide = "name = \"wide\"\nprimitive = \"flat\"\nside_mm = 700.0\nheight_mm = 50.0\n[points]\n\
                x_mm = [-350.0, 350.0, 61]\ny_mm = [-350.0, 350.0, 61]\n";
    place.write("wide.toml", wide);
    place.write("air.toml", &array(15, "", 100.0));
    place.write("cores.toml", &array(15, "[core]", 100.0));
    let plate = "[plate]\nthickness_mm = 3.0\nx_mm = 160.0\ny_mm = 160.0\ngap_mm = 0.5\n";
    place.write("plate.toml", &array(3, &format!("[core]\n{plate}"), 100.0));
    for args in [
        &["lambda", "air.toml", "wide.toml"][..],
        &["calibrate", "cores.toml", "wide.toml", "--out", "cores"],
        &["evaluate", "plate.toml"],
        &["map", "plate.toml", "--out", "map"],
        &["calibrate", "plate.toml", "shapes/flat.toml", "--out", "on"],
        &[
            "optimize",
            "designs/seed_search.toml",
            "--for",
            "shapes/flat.toml",
        ],
        &[
            "calibrate",
            "designs/seed.toml",
            "shapes/half_sphere.toml",
            "--error",
            "0.1%",
            "--out",
            "error",
        ],
        &[
            "bench",
            "designs/seed.toml",
            "shapes/wedge.toml",
            "--out",
            "bench",
        ],
    ] {
        stops(&place, args, &[300, 1900]);
    }
}

/// A stop of a search of arrays: the best so far is in every file that was requested.
#[test]
fn a_stopped_search_writes_its_files() {
    let place = Place::new();
    let search = "[search]\narray.pitch_mm = [40.0, 60.0]\ncoil.length_mm = [60.0, 100.0]\n";
    place.write("air.toml", &(array(3, "", 100.0) + search));
    let files = ["best.toml", "journal.json", "front.csv", "page.html"];
    let mut args = vec!["optimize", "air.toml", "--for", "shapes/flat.toml"];
    args.extend(["--evaluations", "100000", "--starts", "30"]);
    for (flag, file) in ["--out", "--journal", "--front", "--report"]
        .iter()
        .zip(files)
    {
        args.extend([flag, file]);
    }
    // A loaded machine may need long for the first array.
    for after_ms in [2000, 8000, 30_000] {
        let said = said_of(&place, &args, after_ms);
        let missing = files.iter().filter(|file| !place.path(file).is_file());
        let missing: Vec<_> = missing.collect();
        if missing.is_empty() {
            place.run(&["evaluate", "best.toml"]).ends(0);
            return;
        }
        assert_eq!(missing.len(), files.len(), "{missing:?}: {said}");
    }
    panic!("no file was written after a stop");
}

/// What `args` says on stderr within some time.
fn said_of(place: &Place, args: &[&str], after_ms: u64) -> String {
    let Answer { code, said, .. } = answer(place, args, after_ms);
    assert_eq!(code, Some(130), "{said}");
    said
}

#[test]
fn a_command_of_minutes_says_so_before_it_begins() {
    let place = Place::new();
    let wide = "name = \"wide\"\nprimitive = \"flat\"\nside_mm = 700.0\nheight_mm = 50.0\n[points]\n\
                x_mm = [-350.0, 350.0, 601]\ny_mm = [-350.0, 350.0, 601]\n";
    place.write("wide.toml", wide);
    place.write("air.toml", &array(15, "", 100.0));
    let said = said_of(
        &place,
        &["lambda", "air.toml", "wide.toml", "--threads", "1"],
        1500,
    );
    let announced =
        "this will take about 4 min, most of it the forces of 225 coils at 361201 points";
    assert!(said.contains(announced), "{said}");
    // From above, coils at a third of the height nearly depend on each other.
    let small = [
        ("24.0", "3.0"),
        ("38.0", "9.6"),
        ("0.7", "0.3"),
        ("50.0", "10.0"),
    ];
    let close = small.iter().fold(array(30, "", 100.0), |text, (from, to)| {
        text.replace(from, to)
    });
    place.write("close.toml", &close);
    for (args, announced) in [
        (&["close.toml"][..], "lambda's path of 900 coils"),
        (
            &["air.toml", "--variants"],
            "the variants of wiring of 225 coils",
        ),
    ] {
        let args = [&["lambda"], args, &["shapes/flat.toml", "--threads", "1"]].concat();
        let said = said_of(&place, &args, 1500);
        let announced = format!("min, most of it {announced}");
        assert!(said.contains(&announced), "{said}");
    }
    let plan = [
        "sweep",
        "plan",
        "designs/seed.toml",
        "--optimize",
        "--out",
        "plan.json",
    ];
    let axis = ["--set", "wire.diameter_mm=0.5:0.9:0.001"];
    place.run(&[&plan[..], &axis].concat()).ends(0);
    let run = [
        "sweep",
        "run",
        "plan.json",
        "--out",
        "points",
        "--threads",
        "1",
    ];
    let said = said_of(&place, &run, 1500);
    let announced = "this will take about 6 min, most of it 401 designs of the sweep";
    assert!(
        said.contains(announced) && said.contains("--shard"),
        "{said}"
    );
    // A part of it takes less.
    let part = [
        "sweep",
        "run",
        "plan.json",
        "--out",
        "part",
        "--shard",
        "7/401",
    ];
    let said = place.run(&part).ends(0).err;
    assert!(!said.contains("this will take"), "{said}");
}

#[test]
fn a_signal_ends_what_reads_a_bundle() {
    let place = Place::new();
    let made = [
        "calibrate",
        "designs/seed.toml",
        "shapes/wedge.toml",
        "--no-report",
    ];
    place.run(&made).ends(0);
    let bundle = "results/seed/wedge";
    let mut walk = String::from("t_s,x_m,y_m,z_m\n");
    for k in 0..300_000 {
        let x = f64::from(k % 900) * 1e-4 - 0.045;
        walk += &format!("{},{x},0.001,0.05\n", f64::from(k) * 1e-3);
    }
    place.write("walk.csv", &walk);
    stops(&place, &["verify", bundle], &[100, 400]);
    stops(
        &place,
        &["replay", bundle, "walk.csv", "--out", "r.csv"],
        &[100, 500, 900],
    );
}

/// A folder that another process holds: the wait is reported, and a signal ends it.
#[test]
#[allow(clippy::disallowed_methods)] // a test's own folder
fn waiting_for_another_run_is_reported_and_ends_at_a_signal() {
    let place = Place::new();
    place.folder("results/seed_air");
    let held = std::fs::File::open(place.path("results/seed_air")).unwrap();
    held.lock().unwrap();
    let child = place
        .command(&["calibrate", SEED, "shapes/flat.toml", "--no-report"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    sleep(Duration::from_secs(4));
    terminate(&child);
    let (code, said) = wait(child);
    assert_eq!(code, Some(130), "{said}");
    assert!(
        said.contains("waiting for another run in results/seed_air"),
        "{said}"
    );
    let left = place.path("results/seed_air").read_dir().unwrap();
    let names: Vec<_> = left.map(|entry| entry.unwrap().file_name()).collect();
    assert!(
        names.iter().all(|name| name == ".fluxform-cache"),
        "{names:?}"
    );
}

/// Pauses until a command that should have ended is called one that never does: 60 s.
const LONG: u32 = 3000;

/// The first signal was waited out for ever where a search gave its result to a pipe that nobody reads.
#[test]
fn regression_a_search_did_not_end_at_a_signal_while_nobody_read_its_result() {
    let wound = ["optimize", SEED, "--wound"];
    let array = ["optimize", SEED, "--for", "shapes/flat.toml"];
    let quick = ["--vary", "array.pitch_mm=45:55", "--evaluations", "2"];
    let array = [&array[..], &quick, &["--starts", "1"]].concat();
    std::thread::scope(|scope| {
        for search in [&wound[..], &array] {
            // A pipe that nobody opens, and a page larger than what a pipe holds.
            for report in ["pipe", "-"] {
                scope.spawn(move || ends_unread(search, report));
            }
        }
    });
}

/// `search` ends at a signal while nobody reads its page, and its design is whole.
fn ends_unread(search: &[&str], report: &str) {
    let place = Place::new();
    let made = Command::new("mkfifo").arg(place.path("pipe")).status();
    assert!(made.unwrap().success());
    let outputs = ["--out", "best.toml", "--report", report];
    let mut child = place
        .command(&[search, &outputs].concat())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !place.path("best.toml").exists() {
        assert!(child.try_wait().unwrap().is_none(), "ended before it wrote");
        sleep(Duration::from_millis(5));
    }
    terminate(&child);
    let ended = (0..LONG).any(|_| {
        sleep(Duration::from_millis(20));
        child.try_wait().unwrap().is_some()
    });
    if !ended {
        child.kill().unwrap();
    }
    let (code, said) = wait(child);
    assert_eq!(code, Some(130), "{search:?} {report}: {said}");
    place.run(&["evaluate", "best.toml"]).ends(0);
}
