//! A disk that is full, a folder that is closed, a limit on a file's size.

use std::fs;
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::changes::{after_changes, changes};
use crate::scenario::Prepared;
use crate::table::Row;
use fluxform_testing::{
    Random,
    inputs::OUT,
    place::Place,
    run::{Ran, program},
    tree::{same, tree},
};

/// Runs the arguments on a small disk mounted at `out`, then again on a large one; what lies there
/// is copied aside after each.
const ON_A_SMALL_DISK: &str = r#"
set -e
size=$1; shift
cp -a out before
mount -t tmpfs -o size=$size,mode=755 none out
cp -a before/. out/ || { echo small > code; exit 0; }
set +e
"$@" > /dev/null 2> said; echo $? > code
set -e
cp -a out first
mount -o remount,size=64m out
set +e
"$@" > /dev/null 2> said_again; echo $? > code_again
set -e
cp -a out second
"#;

/// How a folder of its own can be mounted, or why not.
pub fn mounter() -> Result<Vec<&'static str>, String> {
    for way in [&["-m"][..], &["-r", "-m"]] {
        let tried = Command::new("unshare")
            .args(way)
            .args(["sh", "-c", "mount -t tmpfs -o size=64k none /mnt"])
            .output();
        if tried.is_ok_and(|output| output.status.success()) {
            return Ok(way.to_vec());
        }
    }
    Err("no disk can be mounted here: neither as root nor in a namespace of one's own".to_owned())
}

/// Disks of `steps` sizes, from nothing to a little more than is needed.
pub fn small_disk(prepared: &Prepared, steps: usize, random: &mut Random) -> Result<Row, String> {
    let way = mounter()?;
    let pages = |bytes: &Vec<u8>| bytes.len().div_ceil(4096) + 1;
    let before: usize = prepared.before.values().map(pages).sum();
    let after: usize = prepared.after.values().map(pages).sum();
    let mut row = Row::new(prepared.scenario.name, "a tmpfs that fills up");
    for step in 0..steps {
        let part = (step as f64 + random.unit()) / steps as f64;
        let size = 1 + before + (part * 1.1 * after as f64) as usize;
        let place = prepared.fresh();
        let mut command = Command::new("unshare");
        command
            .args(&way)
            .args(["sh", "-c", ON_A_SMALL_DISK, "sh"])
            .arg(format!("{}k", 4 * size))
            .arg(program())
            .args(prepared.scenario.args);
        place.at_home(&mut command);
        let script = command.output().unwrap();
        if !script.status.success() {
            return Err(format!("the script: {}", Ran::of(script).err));
        }
        let text = |name: &str| fs::read_to_string(place.path(name)).unwrap_or_default();
        let ran = Ran {
            code: text("code").trim().parse().ok(),
            out: String::new(),
            err: text("said"),
        };
        if text("code").trim() == "small" {
            continue;
        }
        ran.ended_with(&[0, 4])?;
        if ran.code == Some(4) && !ran.err.contains("disk is full") {
            return Err(format!("does not state that the disk is full: {}", ran.err));
        }
        row.struck += usize::from(ran.code == Some(4));
        fs::remove_dir_all(place.path(OUT)).unwrap();
        fs::rename(place.path("first"), place.path(OUT)).unwrap();
        let found = prepared.survived_as_it_is(&place)?;
        if found.temporary + found.put_aside + found.empty_folders > 0 {
            return Err(format!(
                "{found:?} left on a disk of {size} pages: {}",
                ran.err
            ));
        }
        let again = Ran {
            code: text("code_again").trim().parse().ok(),
            out: String::new(),
            err: text("said_again"),
        };
        again.ended_with(&[0])?;
        same(&tree(&place.path("second")), &prepared.after)?;
        row.add(found);
    }
    Ok(row)
}

/// Files may not grow beyond a limit, whose signal ended the program once.
pub fn file_limit(prepared: &Prepared, steps: usize, random: &mut Random) -> Result<Row, String> {
    // A failed write to the cache is silent: the next run computes the value again.
    let artefacts = prepared
        .after
        .iter()
        .filter(|(path, _)| !path.contains(".fluxform-cache"));
    let largest = artefacts.map(|(_, bytes)| bytes.len()).max().unwrap_or(0);
    let mut row = Row::new(prepared.scenario.name, "a limit on the size of a file");
    for step in 0..steps {
        let part = (step as f64 + random.unit()) / steps as f64;
        let blocks = (part * largest as f64 / 512.0) as usize;
        let place = prepared.fresh();
        let mut command = Command::new("sh");
        command
            .args(["-c", "ulimit -f $1; shift; exec \"$@\"", "sh"])
            .arg(blocks.to_string())
            .arg(program())
            .args(prepared.scenario.args);
        place.at_home(&mut command);
        let ran = Ran::of(command.output().unwrap());
        ran.ended_with(&[0, 4])?;
        row.struck += usize::from(ran.code == Some(4));
        row.add(prepared.survived_tidily(&place, &ran)?);
    }
    Ok(row)
}

/// Somebody whom permissions bind.
pub struct Somebody {
    /// Where the program is that they may run.
    _home: Place,
    program: PathBuf,
    /// Whether to step down from root for it.
    steps_down: bool,
}

const NOBODY: u32 = 65534;

impl Somebody {
    /// The one who runs the test, or nobody where that is root; the reason where neither can be.
    pub fn new() -> Result<Self, String> {
        let home = Place::empty();
        let linked = home.path("fluxform");
        // Linked where that can be: the program is large.
        fs::hard_link(program(), &linked)
            .or_else(|_| fs::copy(program(), &linked).map(drop))
            .unwrap();
        let root = fs::metadata(home.root()).unwrap().uid() == 0;
        let somebody = Self {
            _home: home,
            program: linked,
            steps_down: root,
        };
        let place = Place::empty();
        let tried = somebody.command(&place, &["--version"]).output();
        if tried.is_ok_and(|output| output.status.success()) {
            Ok(somebody)
        } else {
            Err("root is not bound by permissions, and setpriv cannot step down from it".to_owned())
        }
    }

    fn command(&self, place: &Place, args: &[&str]) -> Command {
        let mut command = if self.steps_down {
            let mut command = Command::new("setpriv");
            let id = NOBODY.to_string();
            command
                .args(["--reuid", &id, "--regid", &id, "--clear-groups"])
                .arg(&self.program);
            command
        } else {
            Command::new(&self.program)
        };
        command.args(args);
        place.quietly(&mut command);
        command
    }

    fn give(&self, folder: &Path) {
        if !self.steps_down {
            return;
        }
        chown(folder, Some(NOBODY), Some(NOBODY)).unwrap();
        for entry in fs::read_dir(folder).unwrap().flatten() {
            if entry.file_type().unwrap().is_dir() {
                self.give(&entry.path());
            } else {
                chown(entry.path(), Some(NOBODY), Some(NOBODY)).unwrap();
            }
        }
    }

    /// The folder is closed before the run, or after some of its changes.
    pub fn closed(
        &self,
        prepared: &Prepared,
        runs: usize,
        random: &mut Random,
    ) -> Result<Row, String> {
        let mut row = Row::new(prepared.scenario.name, "a folder closed before or half way");
        let mut count = 0;
        for run in 0..=runs + 1 {
            let place = prepared.fresh();
            self.give(&place.path(OUT));
            let mut command = self.command(&place, prepared.scenario.args);
            if run == 0 {
                let mut child = command.spawn().unwrap();
                count = changes(&place.path(OUT), &mut child).max(1);
                Ran::of(child.wait_with_output().unwrap()).ended_with(&[0])?;
                prepared.agrees(&place)?;
                continue;
            }
            let child = if run == 1 {
                close(&place.path(OUT));
                command.spawn().unwrap()
            } else {
                let mut child = command.spawn().unwrap();
                after_changes(&place.path(OUT), &mut child, 1 + random.below(count));
                close(&place.path(OUT));
                child
            };
            let ran = Ran::of(child.wait_with_output().unwrap());
            open(&place.path(OUT));
            ran.ended_with(if run == 1 { &[4] } else { &[0, 4] })?;
            if ran.code == Some(4) && !ran.err.contains("read-only or belongs to someone else") {
                return Err(format!(
                    "does not state that the folder is closed: {}",
                    ran.err
                ));
            }
            row.struck += usize::from(ran.code == Some(4));
            let found = prepared.survived_as_it_is(&place)?;
            self.give(&place.path(OUT));
            let again = self.command(&place, prepared.scenario.args).output();
            Ran::of(again.unwrap()).ended_with(&[0])?;
            prepared.agrees(&place)?;
            row.add(found);
        }
        Ok(row)
    }
}

fn close(folder: &Path) {
    set_modes(folder, 0o555);
}

fn open(folder: &Path) {
    set_modes(folder, 0o755);
}

/// Sets the mode of a folder and of those below; what goes meanwhile is left out.
fn set_modes(folder: &Path, mode: u32) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            set_modes(&entry.path(), mode);
        }
    }
    let _ = fs::set_permissions(folder, fs::Permissions::from_mode(mode));
}
