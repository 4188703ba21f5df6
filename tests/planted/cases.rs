//! The planted cases: one case is one run of one command with one object in its way.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use sha2::{Digest, Sha256};

use fluxform_testing::tree::copy;

use crate::commands::{Writes, lay_inputs, run, words};
use crate::snapshot::{Kind, Snapshot, snapshot};

/// Where links lead to, and what must never change.
pub const VICTIMS: &str = "victims";
/// Where commands write.
const OUT: &str = "out";

/// Object planted at a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plant {
    LinkToFile,
    LinkToFolder,
    LinkToNothing,
    LinkToInput,
    HardLink,
    File,
    PrivateFile,
    Folder,
    Pipe,
    /// Another program's list of files, with their true digests, some of them outside the folder.
    Manifest,
    /// Our own list, with such entries added.
    OwnManifestWithMore,
    /// A file that an earlier run wrote and the user edited.
    Edited,
    /// A file that an earlier run wrote and the user closed to others.
    Closed,
    /// A user's file in a folder that an earlier run wrote.
    Inside,
}

pub const PLANTS: [Plant; 14] = [
    Plant::LinkToFile,
    Plant::LinkToFolder,
    Plant::LinkToNothing,
    Plant::LinkToInput,
    Plant::HardLink,
    Plant::File,
    Plant::PrivateFile,
    Plant::Folder,
    Plant::Pipe,
    Plant::Manifest,
    Plant::OwnManifestWithMore,
    Plant::Edited,
    Plant::Closed,
    Plant::Inside,
];

impl Plant {
    pub fn name(self) -> &'static str {
        match self {
            Self::LinkToFile => "link to a file",
            Self::LinkToFolder => "link to a folder",
            Self::LinkToNothing => "dangling link",
            Self::LinkToInput => "link to an input",
            Self::HardLink => "hard link",
            Self::File => "foreign file",
            Self::PrivateFile => "foreign file, mode 600",
            Self::Folder => "foreign folder",
            Self::Pipe => "pipe",
            Self::Manifest => "foreign manifest",
            Self::OwnManifestWithMore => "own manifest with more entries",
            Self::Edited => "own file, edited",
            Self::Closed => "own file, mode 600",
            Self::Inside => "user's file beside own ones",
        }
    }

    /// Whether an earlier run of the command comes first.
    fn after_a_run(self) -> bool {
        match self {
            Self::OwnManifestWithMore | Self::Edited | Self::Closed | Self::Inside => true,
            Self::LinkToFile
            | Self::LinkToFolder
            | Self::LinkToNothing
            | Self::LinkToInput
            | Self::HardLink
            | Self::File
            | Self::PrivateFile
            | Self::Folder
            | Self::Pipe
            | Self::Manifest => false,
        }
    }
}

/// Kinds of names at which something is planted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// A file that the command writes.
    Output,
    /// A folder that the command makes.
    Folder,
    /// A name that only this program uses, for a moment (`.fluxform-*.tmp`).
    Temporary,
    /// A name of the program's for what lasts longer, or what no run writes.
    Other,
}

/// A name that the command may touch.
#[derive(Clone, Debug)]
pub struct Name {
    pub path: String,
    pub role: Role,
}

/// A command with all that is known before something is planted.
pub struct Prepared {
    pub writes: Writes,
    /// Inputs and what commands before made.
    pub inputs: PathBuf,
    /// The same after an undisturbed run.
    after: PathBuf,
    /// The same after a run with other options.
    earlier: PathBuf,
    pub names: Vec<Name>,
}

impl Prepared {
    pub fn new(writes: &Writes, room: &Path) -> Self {
        let place = |what: &str| room.join(format!("{}-{what}", writes.name.replace(' ', "_")));
        let [inputs, after, earlier] = ["inputs", "after", "earlier"].map(place);
        fs::create_dir(&inputs).unwrap();
        lay_inputs(&inputs);
        lay_victims(&inputs);
        for line in writes.before {
            well(&inputs, &words(line));
        }
        let before = snapshot(&inputs);
        copy(&inputs, &after);
        well(&after, &words(writes.line));
        copy(&inputs, &earlier);
        well(
            &earlier,
            &words(&format!("{} {}", writes.line, writes.earlier)),
        );
        let mut made = snapshot(&after);
        made.extend(snapshot(&earlier));
        made.retain(|path, _| !before.contains_key(path));
        assert!(made.keys().all(|path| path.starts_with(OUT)), "{made:?}");
        Self {
            writes: *writes,
            inputs,
            after,
            earlier,
            names: names(&made),
        }
    }

    pub fn cases(&self) -> Vec<Case> {
        let mut cases = Vec::new();
        for name in &self.names {
            for plant in PLANTS {
                if !fits(plant, name) {
                    continue;
                }
                // Beside what an earlier run left, too, at names that it did not write itself.
                let beside = matches!(name.role, Role::Other | Role::Temporary);
                let earlier = match (plant.after_a_run(), beside) {
                    (true, _) => &[true][..],
                    (false, true) => &[false, true],
                    (false, false) => &[false],
                };
                for (after_a_run, force, refused) in combinations(earlier) {
                    if refused && self.writes.spoils.is_empty() {
                        continue;
                    }
                    cases.push(Case {
                        name: name.clone(),
                        plant,
                        after_a_run,
                        force,
                        refused,
                    });
                }
            }
        }
        cases
    }
}

fn combinations(earlier: &[bool]) -> impl Iterator<Item = (bool, bool, bool)> {
    let flags = [(false, false), (false, true), (true, false), (true, true)];
    let with = move |&after_a_run: &bool| {
        flags
            .into_iter()
            .map(move |(force, refused)| (after_a_run, force, refused))
    };
    earlier.iter().flat_map(with)
}

fn well(place: &Path, words: &[String]) {
    let ran = run(place, words);
    assert_eq!(ran.code, Some(0), "{words:?}: {}", ran.said);
}

fn lay_victims(place: &Path) {
    let folder = place.join(VICTIMS).join("folder");
    fs::create_dir_all(folder.join("deeper")).unwrap();
    for (name, text) in [
        ("file.txt", "a victim\n"),
        ("folder/a.txt", "another victim\n"),
        ("folder/deeper/b.txt", "a third victim\n"),
        (
            "folder/timing.json",
            "{\"seconds\": \"of another program\"}\n",
        ),
        ("folder/timing_notes.txt", "the victim's own notes\n"),
        (
            "folder/manifest.json",
            "{\"files\": [{\"path\": \"a.txt\"}]}\n",
        ),
        ("folder/plan.json", "{\"plan\": \"of another program\"}\n"),
    ] {
        fs::write(place.join(VICTIMS).join(name), text).unwrap();
    }
}

/// The names that a command made, the program's own beside them, and some that a user may choose.
fn names(made: &Snapshot) -> Vec<Name> {
    let mut found: Vec<Name> = Vec::new();
    let mut folders = BTreeSet::from([OUT.to_owned()]);
    for (path, entry) in made {
        let role = match entry.kind {
            Kind::Folder => Role::Folder,
            _ => Role::Output,
        };
        if role == Role::Folder {
            folders.insert(path.clone());
        }
        found.push(Name {
            path: path.clone(),
            role,
        });
    }
    let mut add = |path: String, role| {
        if !found.iter().any(|name| name.path == path) {
            found.push(Name { path, role });
        }
    };
    for folder in &folders {
        add(format!("{folder}/.fluxform-a1B2c3.tmp"), Role::Temporary);
        let (parent, last) = folder.rsplit_once('/').unwrap_or((".", folder));
        add(format!("{parent}/.{last}.fluxform-old"), Role::Other);
        for name in [
            "notes.txt",
            "manifest.json",
            "report.html",
            "timing.json",
            "timing_notes.txt",
            "plots",
            "plots/mine.svg",
            "map.csv",
            ".fluxform-cache",
            ".fluxform-cache/mine",
        ] {
            add(format!("{folder}/{name}"), Role::Other);
        }
    }
    found
}

/// Whether a thing can be planted at a name and shows anything there.
fn fits(plant: Plant, name: &Name) -> bool {
    let json = name.path.ends_with(".json");
    match plant {
        Plant::Manifest => json,
        Plant::OwnManifestWithMore => json && name.role == Role::Output,
        Plant::Edited | Plant::Closed => name.role == Role::Output,
        Plant::LinkToFile
        | Plant::LinkToFolder
        | Plant::LinkToNothing
        | Plant::LinkToInput
        | Plant::HardLink
        | Plant::File
        | Plant::PrivateFile
        | Plant::Folder
        | Plant::Pipe
        | Plant::Inside => true,
    }
}

/// One run with one thing planted.
#[derive(Clone, Debug)]
pub struct Case {
    pub name: Name,
    pub plant: Plant,
    /// An earlier run of the command left its files.
    pub after_a_run: bool,
    pub force: bool,
    /// An input is spoilt, so that the command is refused.
    pub refused: bool,
}

/// A place with the thing planted; `None` where it cannot be.
pub struct Laid {
    pub place: PathBuf,
    /// Files that an earlier run wrote and nobody changed since.
    pub ours: BTreeSet<String>,
}

impl Case {
    pub fn lay(&self, prepared: &Prepared, place: &Path) -> Option<Laid> {
        let own = [Plant::Edited, Plant::Closed, Plant::OwnManifestWithMore];
        let base = match (self.after_a_run, own.contains(&self.plant)) {
            (false, _) => &prepared.inputs,
            (true, false) => &prepared.earlier,
            (true, true) => &prepared.after,
        };
        copy(base, place);
        let target = place.join(&self.name.path);
        let before = snapshot(&prepared.inputs);
        let ours = snapshot(place)
            .into_keys()
            .filter(|path| !before.contains_key(path) && *path != self.name.path)
            .collect();
        if fs::create_dir_all(target.parent().unwrap()).is_err() {
            return None;
        }
        let laid = self.plant(place, &target);
        if self.refused {
            spoil(&place.join(prepared.writes.spoils));
        }
        laid.then(|| Laid {
            place: place.to_owned(),
            ours,
        })
    }

    fn plant(&self, place: &Path, target: &Path) -> bool {
        let victims = place.join(VICTIMS);
        let there = target.symlink_metadata().is_ok();
        let private = |mode| fs::set_permissions(target, fs::Permissions::from_mode(mode)).unwrap();
        match self.plant {
            Plant::LinkToFile => symlink(victims.join("file.txt"), target).is_ok(),
            Plant::LinkToFolder => symlink(victims.join("folder"), target).is_ok(),
            Plant::LinkToNothing => symlink(victims.join("nothing"), target).is_ok(),
            Plant::LinkToInput => symlink(place.join("air.toml"), target).is_ok(),
            Plant::HardLink => fs::hard_link(victims.join("file.txt"), target).is_ok(),
            Plant::File | Plant::Inside if !there => {
                fs::write(target, format!("the user's own {}\n", self.name.path)).is_ok()
            }
            Plant::PrivateFile if !there => {
                fs::write(target, "the user's own\n").unwrap();
                private(0o600);
                true
            }
            Plant::Folder if !there => {
                fs::create_dir_all(target.join("deeper")).unwrap();
                fs::write(target.join("precious.txt"), "precious\n").unwrap();
                fs::write(target.join("deeper/timing.json"), "{}\n").unwrap();
                true
            }
            Plant::Pipe => Command::new("mkfifo")
                .arg(target)
                .status()
                .is_ok_and(|status| status.success()),
            Plant::Manifest if !there => {
                let folder = target.parent().unwrap();
                for name in LISTED {
                    fs::write(folder.join(name), format!("the user's own {name}\n")).unwrap();
                }
                let list = format!("{{\"files\": [{}]}}\n", entries(folder, &victims));
                fs::write(target, list).is_ok()
            }
            Plant::OwnManifestWithMore => {
                let folder = target.parent().unwrap();
                for name in LISTED {
                    fs::write(folder.join(name), format!("the user's own {name}\n")).unwrap();
                }
                let text = fs::read_to_string(target).unwrap();
                let more = entries(folder, &victims);
                let longer = text.replacen("\"files\": [", &format!("\"files\": [{more},"), 1);
                let longer =
                    longer.replacen("\"outputs\": [", &format!("\"outputs\": [{more},"), 1);
                longer != text && fs::write(target, longer).is_ok()
            }
            Plant::Edited if there => {
                let mut bytes = fs::read(target).unwrap();
                bytes.extend(b"\n# edited\n");
                fs::write(target, bytes).is_ok()
            }
            Plant::Closed if there => {
                private(0o600);
                true
            }
            Plant::File
            | Plant::Inside
            | Plant::PrivateFile
            | Plant::Folder
            | Plant::Manifest
            | Plant::Edited
            | Plant::Closed => false,
        }
    }
}

/// The user's files that a planted manifest lists.
const LISTED: [&str; 2] = ["precious.txt", "timing_precious.txt"];

/// Entries of the user's files and of victims outside, with their true sizes and digests.
fn entries(folder: &Path, victims: &Path) -> String {
    let depth = folder.strip_prefix(victims.parent().unwrap()).unwrap();
    let up = "../".repeat(depth.components().count());
    let outside = [format!("{up}victims/file.txt"), format!("{up}air.toml")];
    let absolute = victims.join("folder/a.txt").display().to_string();
    let names = LISTED.map(str::to_owned).into_iter().chain(outside);
    let entry = |name: String| {
        let bytes = fs::read(folder.join(&name)).unwrap();
        let digest: String = Sha256::digest(&bytes)
            .iter()
            .map(|byte| format!("{byte:02x}"))
            .collect();
        format!(
            "{{\"path\": \"{name}\", \"bytes\": {}, \"sha256\": \"{digest}\"}}",
            bytes.len()
        )
    };
    let all: Vec<String> = names.chain([absolute]).map(entry).collect();
    all.join(", ")
}

/// Makes an input one that is refused.
fn spoil(input: &Path) {
    fs::write(input, "no_such_key = \n").unwrap();
}
