//! The disturbed runs, and the conditions on their files afterwards.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::time::Instant;

use fluxform_testing::inputs::{OUT, scenes};
use serde_json::Value;

use fluxform_testing::{
    place::Place,
    run::Ran,
    tree::{Tree, agree, file_name, same, tree},
};

/// A command and what lies there before it.
pub struct Scenario {
    pub name: &'static str,
    /// Commands that make what lies there.
    pub before: &'static [&'static [&'static str]],
    /// The command.
    pub args: &'static [&'static str],
}

const CALIBRATE: &[&str] = &[
    "calibrate",
    "two.toml",
    "bump.toml",
    "ramp.toml",
    "--out",
    "out",
];
/// Output of other options is replaced with `--force` alone.
const CALIBRATE_OVER: &[&str] = &[
    "calibrate",
    "two.toml",
    "bump.toml",
    "ramp.toml",
    "--out",
    "out",
    "--force",
];
const MAP: &[&str] = &["map", "air.toml", "--csv", "--vtk", "--out", "out"];
const MAP_OVER: &[&str] = &[
    "map", "air.toml", "--csv", "--vtk", "--out", "out", "--force",
];
const PLAN: &[&str] = &[
    "sweep",
    "plan",
    "air.toml",
    "--set",
    "wire.diameter_mm=0.5:0.8:0.05",
    "--set",
    "coil.outer_diameter_mm=26:38:2",
    "--out",
    "plan.json",
];
const SWEEP: &[&str] = &["sweep", "run", "plan.json", "--out", "out"];

/// Those that the brunt falls on.
pub const MAIN: &[Scenario] = &[
    Scenario {
        name: "calibrate",
        before: &[],
        args: CALIBRATE,
    },
    Scenario {
        name: "calibrate over older bundles",
        before: &[&[
            "calibrate",
            "two.toml",
            "bump.toml",
            "ramp.toml",
            "--out",
            "out",
            "--criterion",
            "linear",
        ]],
        args: CALIBRATE_OVER,
    },
    Scenario {
        name: "sweep run",
        before: &[PLAN],
        args: SWEEP,
    },
    Scenario {
        name: "map",
        before: &[],
        args: MAP,
    },
    Scenario {
        name: "map over an older one",
        before: &[&[
            "map",
            "air.toml",
            "--csv",
            "--out",
            "out",
            "--components",
            "all",
        ]],
        args: MAP_OVER,
    },
];

/// The others that write.
pub const MORE: &[Scenario] = &[
    Scenario {
        name: "optimize --out",
        before: &[],
        args: &["optimize", "air.toml", "--out", "out/best.toml"],
    },
    Scenario {
        name: "discretize --out",
        before: &[],
        args: &["discretize", "bump.toml", "--out", "out/points.csv"],
    },
    Scenario {
        name: "replay --out",
        before: &[&[
            "calibrate",
            "air.toml",
            "bump.toml",
            "--out",
            "bundles",
            "--no-report",
        ]],
        args: &[
            "replay",
            "bundles/air/bump",
            "finger.csv",
            "--out",
            "out/replay.csv",
        ],
    },
    Scenario {
        name: "sweep merge",
        before: &[PLAN, &["sweep", "run", "plan.json", "--out", "points"]],
        args: &[
            "sweep",
            "merge",
            "plan.json",
            "points",
            "--out",
            "out/sweep.csv",
        ],
    },
];

/// Contents of a place's output folder.
pub fn written(place: &Place) -> Tree {
    tree(&place.path(OUT))
}

/// A file that the user laid into the folder of an older bundle.
const NOTES: &str = "notes.txt";

/// A scenario with what it leaves when nobody disturbs it.
pub struct Prepared {
    pub scenario: &'static Scenario,
    place: Place,
    pub before: Tree,
    pub after: Tree,
    /// How long it takes.
    pub seconds: f64,
    /// The files of bundles that `verify` has accepted.
    accepted: Mutex<BTreeSet<Tree>>,
}

impl Prepared {
    pub fn new(scenario: &'static Scenario) -> Result<Self, String> {
        let place = scenes();
        for args in scenario.before {
            place.run(args).ended_with(&[0])?;
        }
        if place.path(OUT).join("two/bump").is_dir() {
            place.write("out/two/bump/notes.txt", "remember\n");
        }
        let before = written(&place);
        let whole = place.duplicate();
        let began = Instant::now();
        whole.run(scenario.args).ended_with(&[0])?;
        let seconds = began.elapsed().as_secs_f64();
        let after = written(&whole);
        let prepared = Self {
            scenario,
            place,
            before,
            after,
            seconds,
            accepted: Mutex::default(),
        };
        prepared.agrees(&whole)?;
        Ok(prepared)
    }

    /// A place of its own for one disturbed run.
    pub fn fresh(&self) -> Place {
        self.place.duplicate()
    }

    /// Every file is what it was before, what it is afterwards, or a temporary one.
    pub fn whole_or_absent(&self, place: &Place) -> Result<Found, String> {
        let now = written(place);
        let mut found = Found::default();
        for (path, bytes) in &now {
            if path.split('/').any(is_temporary) {
                found.temporary += 1;
                continue;
            }
            if path.ends_with('/') {
                found.empty_folders += 1;
                continue;
            }
            let put_aside = path.split('/').any(|part| part.ends_with(".fluxform-old"));
            let name = put_back(path);
            found.put_aside += usize::from(put_aside);
            let timing = file_name(&name).starts_with("timing");
            let is = |tree: &Tree| tree.get(&name).is_some_and(|it| agree(&name, it, bytes));
            let whole = if timing {
                serde_json::from_slice::<Value>(bytes).is_ok()
            } else {
                is(&self.before) || is(&self.after)
            };
            if !whole {
                return Err(format!("{path} is neither what it was nor what it becomes"));
            }
            found.whole += 1;
        }
        self.bundles_whole(&now)?;
        let notes = |tree: &Tree| tree.keys().any(|path| path.ends_with(NOTES));
        if notes(&self.before) && !notes(&now) {
            return Err("the user's own file is gone".to_owned());
        }
        found.bundles = bundles(&now).len();
        let gone = |manifest: &&String| !now.contains_key(*manifest);
        found.absent = bundles(&self.before).iter().filter(gone).count();
        Ok(found)
    }

    /// A folder with a manifest has every file of that manifest.
    fn bundles_whole(&self, now: &Tree) -> Result<(), String> {
        for manifest in bundles(now) {
            let of = [&self.after, &self.before]
                .into_iter()
                .find(|tree| tree.get(&manifest) == now.get(&manifest));
            let Some(of) = of else { continue };
            let folder = manifest.trim_end_matches("manifest.json");
            for (path, bytes) in of.range(folder.to_owned()..) {
                if !path.starts_with(folder) {
                    break;
                }
                let there = now.get(path);
                let timing = file_name(path).starts_with("timing");
                let same = if timing {
                    there.is_some()
                } else {
                    there == Some(bytes)
                };
                if !same && file_name(path) != NOTES {
                    return Err(format!("{manifest} is there, but {path} is not"));
                }
            }
        }
        Ok(())
    }

    /// `verify` accepts every bundle. One whose bytes it has accepted before is not computed again: the
    /// inputs beside it are always the same.
    pub fn verified(&self, place: &Place) -> Result<usize, String> {
        let now = written(place);
        let bundles = bundles(&now);
        for manifest in &bundles {
            let folder = manifest.trim_end_matches("manifest.json");
            let own = now
                .range(folder.to_owned()..)
                .take_while(|(path, _)| path.starts_with(folder));
            let files: Tree = own
                .filter(|(path, _)| !file_name(path).starts_with("timing"))
                .map(|(path, bytes)| (path.clone(), bytes.clone()))
                .collect();
            if self.accepted.lock().unwrap().contains(&files) {
                continue;
            }
            let folder = format!("out/{}", folder.trim_end_matches('/'));
            place.run(&["verify", &folder]).ended_with(&[0])?;
            self.accepted.lock().unwrap().insert(files);
        }
        Ok(bundles.len())
    }

    /// The same command again ends well and leaves what an undisturbed
    /// run leaves, to the byte and to the last file.
    pub fn runs_again(&self, place: &Place) -> Result<(), String> {
        let ran = place.run(self.scenario.args);
        ran.ended_with(&[0])
            .map_err(|reported| format!("again: {reported}"))?;
        self.agrees(place)
    }

    /// The files are those of an undisturbed run.
    pub fn agrees(&self, place: &Place) -> Result<(), String> {
        same(&written(place), &self.after)
    }

    /// All of it, after a run that was disturbed.
    pub fn survived(&self, place: &Place) -> Result<Found, String> {
        let found = self.whole_or_absent(place)?;
        self.verified(place)?;
        self.runs_again(place)?;
        Ok(found)
    }

    /// As [`Self::survived`], of a run that could tidy up after itself.
    pub fn survived_tidily(&self, place: &Place, ran: &Ran) -> Result<Found, String> {
        let found = self.survived_as_it_is(place)?;
        if found.temporary + found.put_aside > 0 {
            return Err(format!("left temporary files: {ran:?}"));
        }
        if found.empty_folders > 0 {
            return Err(format!("left an empty folder: {ran:?}"));
        }
        self.runs_again(place)?;
        Ok(found)
    }

    /// The files are in order, no bundle is gone; nothing is run again.
    pub fn survived_as_it_is(&self, place: &Place) -> Result<Found, String> {
        let found = self.whole_or_absent(place)?;
        found.no_bundle_is_absent()?;
        self.verified(place)?;
        Ok(found)
    }
}

/// Files after a run was disturbed.
#[derive(Debug, Default, Clone, Copy)]
pub struct Found {
    pub whole: usize,
    pub temporary: usize,
    pub put_aside: usize,
    pub empty_folders: usize,
    pub bundles: usize,
    /// Bundles that were there and are not now.
    pub absent: usize,
}

impl Found {
    /// Where two folders can change places, a bundle's name is never without one.
    pub fn no_bundle_is_absent(&self) -> Result<(), String> {
        if cfg!(target_os = "linux") && self.absent > 0 {
            return Err(format!("a bundle that was there is not: {self:?}"));
        }
        Ok(())
    }
}

impl std::ops::AddAssign for Found {
    fn add_assign(&mut self, other: Self) {
        self.whole += other.whole;
        self.temporary += other.temporary;
        self.put_aside += other.put_aside;
        self.empty_folders += other.empty_folders;
        self.bundles += other.bundles;
        self.absent += other.absent;
    }
}

fn bundles(tree: &Tree) -> Vec<String> {
    let ours = |path: &&String| {
        file_name(path) == "manifest.json"
            && !path
                .split('/')
                .any(|part| is_temporary(part) || part.ends_with(".fluxform-old"))
    };
    tree.keys().filter(ours).cloned().collect()
}

fn is_temporary(part: &str) -> bool {
    let note = part.starts_with('.') && part.ends_with(".json.fluxform-old");
    note || (part.starts_with(".fluxform-") && part.ends_with(".tmp"))
}

/// The path a file had before its folder was put aside.
fn put_back(path: &str) -> String {
    let back = |part: &str| {
        let inner = part
            .strip_prefix('.')
            .and_then(|rest| rest.strip_suffix(".fluxform-old"))
            // The identities of both folders.
            .and_then(|rest| rest.rsplit_once('.'));
        inner.map_or(part, |(name, _)| name).to_owned()
    };
    path.split('/').map(back).collect::<Vec<_>>().join("/")
}
