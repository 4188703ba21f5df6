//! Two runs at once on one folder, and runs that are asked to stop.

use std::os::unix::process::ExitStatusExt;
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;

use crate::changes::{after_changes, changes};
use crate::scenario::{Prepared, written};
use crate::table::Row;
use fluxform_testing::{
    Random,
    inputs::{OUT, scenes},
    place::Place,
    run::Ran,
    tree::{Tree, same},
};

/// The same command twice at once: both end well.
pub fn same_inputs(prepared: &Prepared, runs: usize, random: &mut Random) -> Result<Row, String> {
    let mut row = Row::new(prepared.scenario.name, "the same run at the same time");
    for _ in 0..runs {
        let place = prepared.fresh();
        let one = place.spawn(prepared.scenario.args);
        sleep(Duration::from_secs_f64(
            0.3 * prepared.seconds * random.unit(),
        ));
        let two = place.run(prepared.scenario.args);
        let one = Ran::of(one.wait_with_output().unwrap());
        one.ended_with(&[0])?;
        two.ended_with(&[0])?;
        prepared.agrees(&place)?;
        row.add(prepared.survived(&place)?);
    }
    Ok(row)
}

/// Commands with other inputs that want the same folder.
pub struct Rivals {
    pub name: &'static str,
    /// Run once for each: where the inputs lie is taken from it.
    pub one: &'static [&'static str],
    pub two: &'static [&'static str],
    /// Folders of which each is of one rival as a whole.
    pub units: &'static [&'static str],
}

pub const RIVALS: &[Rivals] = &[
    Rivals {
        name: "calibrate",
        one: &[
            "calibrate",
            "two.toml",
            "bump.toml",
            "ramp.toml",
            "--out",
            "out",
            "--no-report",
        ],
        two: &[
            "calibrate",
            "other.toml",
            "bump.toml",
            "ramp.toml",
            "--out",
            "out",
            "--no-report",
        ],
        units: &["two/bump/", "two/ramp/"],
    },
    Rivals {
        name: "map",
        one: &["map", "air.toml", "--csv", "--vtk", "--out", "out"],
        two: &["map", "other_air.toml", "--csv", "--vtk", "--out", "out"],
        units: &[""],
    },
    Rivals {
        name: "sweep run",
        one: &["sweep", "run", "plan.json", "--out", "out"],
        two: &["sweep", "run", "other.json", "--out", "out"],
        units: &[""],
    },
    Rivals {
        name: "discretize --out",
        one: &["discretize", "bump.toml", "--out", "out/points.csv"],
        two: &["discretize", "ramp.toml", "--out", "out/points.csv"],
        units: &[""],
    },
];

fn rival_scenes() -> Result<Place, String> {
    let place = scenes();
    for (design, plan) in [("air.toml", "plan.json"), ("other_air.toml", "other.json")] {
        let set = [
            "--set",
            "wire.diameter_mm=0.5:0.8:0.05",
            "--set",
            "coil.outer_diameter_mm=26:38:2",
        ];
        let args = [&["sweep", "plan", design][..], &set, &["--out", plan]].concat();
        place.run(&args).ended_with(&[0])?;
    }
    Ok(place)
}

/// Two runs with other inputs at once: without `--force` one has the folder and the other is refused,
/// with it the last one has it; nothing is mixed.
pub fn other_inputs(rivals: &Rivals, runs: usize, random: &mut Random) -> Result<Row, String> {
    let mut row = Row::new(rivals.name, "a run with other inputs at the same time");
    let place = rival_scenes()?;
    let mut seconds: f64 = 0.0;
    let mut alone = Vec::new();
    for args in [rivals.one, rivals.two] {
        let place = place.duplicate();
        let began = std::time::Instant::now();
        place.run(args).ended_with(&[0])?;
        seconds = seconds.max(began.elapsed().as_secs_f64());
        alone.push(written(&place));
    }
    for run in 0..runs {
        let place = place.duplicate();
        let forced = run % 2 == 1;
        let flags: &[&str] = if forced { &["--force"] } else { &[] };
        let [first, second] = [rivals.one, rivals.two].map(|args| [args, flags].concat());
        let one = place.spawn(&first);
        sleep(Duration::from_secs_f64(0.1 * seconds * random.unit()));
        let two = place.run(&second);
        let one = Ran::of(one.wait_with_output().unwrap());
        for ran in [&one, &two] {
            ran.ended_with(if forced { &[0] } else { &[0, 4] })?;
        }
        if !forced && one.code == two.code {
            return Err(format!("both ended alike: {one:?} {two:?}"));
        }
        let now = written(&place);
        // Of points that two forced sweeps fight for each is whole; only the plan's owner counts them.
        if !(forced && rivals.name == "sweep run") {
            unmixed(&now, &alone, rivals.units)?;
        }
        row.struck += [&one, &two]
            .iter()
            .filter(|ran| ran.code == Some(4))
            .count();
        row.runs += 1;
        row.found.whole += now.len();
    }
    Ok(row)
}

/// Every unit is what one of the runs leaves alone.
fn unmixed(now: &Tree, alone: &[Tree], units: &[&str]) -> Result<(), String> {
    for unit in units {
        let part = |tree: &Tree| -> Tree {
            tree.iter()
                .filter(|(path, _)| path.starts_with(unit))
                .map(|(path, bytes)| (path.clone(), bytes.clone()))
                .collect()
        };
        let reported: Vec<String> = alone
            .iter()
            .filter_map(|tree| same(&part(now), &part(tree)).err())
            .collect();
        if reported.len() == alone.len() {
            return Err(format!("{unit:?} is of neither run alone: {reported:?}"));
        }
    }
    Ok(())
}

/// SIGINT and SIGTERM at random moments: what was finished is kept, nothing else is left.
pub fn asked_to_stop(prepared: &Prepared, runs: usize, random: &mut Random) -> Result<Row, String> {
    let mut row = Row::new(
        prepared.scenario.name,
        "SIGINT or SIGTERM at a random moment",
    );
    let changed = {
        let place = prepared.fresh();
        let mut child = place.spawn(prepared.scenario.args);
        let changed = changes(&place.path(OUT), &mut child);
        child.wait().unwrap();
        changed.max(1)
    };
    for run in 0..runs {
        let place = prepared.fresh();
        let mut child = place.spawn(prepared.scenario.args);
        if run % 4 < 2 {
            sleep(Duration::from_secs_f64(prepared.seconds * random.unit()));
        } else {
            after_changes(&place.path(OUT), &mut child, 1 + random.below(changed));
        }
        let signal = ["-INT", "-TERM"][run % 2];
        // A program that has ended takes no signal.
        let _ = Command::new("kill")
            .args([signal, &child.id().to_string()])
            .output();
        let output = child.wait_with_output().unwrap();
        let by_signal = output.status.signal();
        let ran = Ran::of(output);
        let untouched = same(&written(&place), &prepared.before).is_ok();
        // Before the program listens it ends as any other does.
        if !(by_signal.is_some() && untouched) {
            ran.ended_with(&[130, 0])?;
        }
        row.struck += usize::from(ran.code != Some(0));
        row.add(prepared.survived_tidily(&place, &ran)?);
    }
    Ok(row)
}
