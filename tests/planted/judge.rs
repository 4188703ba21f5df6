//! Runs a case and says what of the user's was changed.

use std::fs::{self, OpenOptions};
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::cases::{Case, Laid, Plant, Prepared, Role};
use crate::commands::{Ran, run, words};
use crate::snapshot::{Kind, Snapshot, change, snapshot};

/// One row of the table.
#[derive(Clone, Debug)]
pub struct Row {
    pub command: &'static str,
    pub at: String,
    pub planted: &'static str,
    pub after_a_run: bool,
    pub force: bool,
    pub refused: bool,
    pub code: Option<i32>,
    /// Files of the user that changed and must not.
    pub changed: Vec<String>,
    pub said: String,
}

/// Runs a case in `place`, which is removed afterwards; `None` where nothing could be planted.
pub fn judge(prepared: &Prepared, case: &Case, place: &Path) -> Option<Row> {
    let laid = case.lay(prepared, place);
    let row = laid.map(|laid| {
        let mut words = words(prepared.writes.line);
        if case.force {
            words.push("--force".to_owned());
        }
        let before = snapshot(&laid.place);
        let pipe = (case.plant == Plant::Pipe).then(|| place.join(&case.name.path));
        let ran = with_reader(pipe.as_deref(), || run(place, &words));
        let after = snapshot(&laid.place);
        row(prepared, case, &laid, &ran, [&before, &after])
    });
    fs::remove_dir_all(place).unwrap();
    row
}

fn row(
    prepared: &Prepared,
    case: &Case,
    laid: &Laid,
    ran: &Ran,
    [before, after]: [&Snapshot; 2],
) -> Row {
    let mut changed: Vec<String> = before
        .keys()
        .filter(|path| !may_change(prepared, case, laid, ran, path))
        .filter(|path| !moved_aside(case, path, before, after))
        .filter_map(|path| change(path, before, after))
        .collect();
    if case.plant == Plant::Closed
        && let (Some(was), Some(is)) = (before.get(&case.name.path), after.get(&case.name.path))
        && was.mode != is.mode
    {
        changed.push(format!(
            "{} has mode {:o}, had {:o}",
            case.name.path, is.mode, was.mode
        ));
    }
    if ran.hangs {
        changed.push("hangs".to_owned());
    }
    if ran.code.is_none_or(|code| code == 101) && !ran.hangs {
        changed.push("the program is killed or panics".to_owned());
    }
    if case.refused && ran.code == Some(0) {
        changed.push("a spoilt input is not refused".to_owned());
    }
    Row {
        command: prepared.writes.name,
        at: case.name.path.clone(),
        planted: case.plant.name(),
        after_a_run: case.after_a_run,
        force: case.force,
        refused: case.refused,
        code: ran.code,
        changed,
        said: ran.said.clone(),
    }
}

/// Files that the program may replace or remove.
fn may_change(prepared: &Prepared, case: &Case, laid: &Laid, ran: &Ran, path: &str) -> bool {
    let writes = &prepared.writes;
    // Leftovers of killed runs have names that nobody else uses.
    if case.name.role == Role::Temporary
        && (path == case.name.path || path.starts_with(&format!("{}/", case.name.path)))
    {
        return match case.plant {
            Plant::File | Plant::PrivateFile | Plant::Folder | Plant::HardLink | Plant::Inside => {
                true
            }
            Plant::LinkToFile
            | Plant::LinkToFolder
            | Plant::LinkToNothing
            | Plant::LinkToInput
            | Plant::Pipe
            | Plant::Manifest
            | Plant::OwnManifestWithMore
            | Plant::Edited
            | Plant::Closed => false,
        };
    }
    // Output of an earlier run is replaced by a run that is not refused; the cache goes when it
    // is of no use any more.
    if laid.ours.contains(path) {
        return !case.refused || path.contains("/.fluxform-cache");
    }
    if case.refused {
        return false;
    }
    if path != case.name.path {
        return false;
    }
    let replaceable = case.name.role == Role::Output && case.force && ran.code != Some(2);
    match case.plant {
        // A plain file at a name that the user gave makes way when asked to; in a bundle it is kept.
        Plant::File
        | Plant::PrivateFile
        | Plant::HardLink
        | Plant::Manifest
        | Plant::OwnManifestWithMore
        | Plant::Inside => replaceable && !writes.bundle,
        Plant::Edited => (replaceable && !writes.bundle) || is_made_again(path),
        // Its mode is looked at apart.
        Plant::Closed => true,
        Plant::LinkToFile
        | Plant::LinkToFolder
        | Plant::LinkToNothing
        | Plant::LinkToInput
        | Plant::Folder
        | Plant::Pipe => false,
    }
}

/// Files of the program's that no list has with a digest: seconds, what is cached, and the points of
/// a sweep, which carry their own checksum and are computed again where it does not hold.
fn is_made_again(path: &str) -> bool {
    let name = path.rsplit('/').next().unwrap_or(path);
    (name.starts_with("timing") && name.ends_with(".json"))
        || path.contains("/.fluxform-cache/")
        || path.contains("/points/")
}

/// With `--force` what is in the way may be moved, whole, to a name where nothing was.
fn moved_aside(case: &Case, path: &str, before: &Snapshot, after: &Snapshot) -> bool {
    let same = |path: &str| {
        let was = &before[path];
        let is_new = |other: &&String| !before.contains_key(*other);
        after
            .iter()
            .filter(|(other, _)| is_new(other))
            .any(|(_, is)| is == was)
    };
    if !case.force || case.refused || path.starts_with(crate::cases::VICTIMS) {
        return false;
    }
    match &before[path].kind {
        Kind::Folder => {
            let inside = format!("{path}/");
            let mut contents = before
                .keys()
                .filter(|other| other.starts_with(&inside))
                .peekable();
            contents.peek().is_some()
                && !after.contains_key(path)
                && contents.all(|other| before[other].kind == Kind::Folder || same(other))
        }
        Kind::File(_) | Kind::Link(_) | Kind::Pipe => same(path),
        Kind::Other => false,
    }
}

/// Runs while somebody reads the pipe, so that writing into it does not wait.
fn with_reader<T>(pipe: Option<&Path>, run: impl FnOnce() -> T) -> T {
    const NONBLOCK: i32 = 0o4000;
    let Some(pipe) = pipe else { return run() };
    let mut reader = OpenOptions::new()
        .read(true)
        .custom_flags(NONBLOCK)
        .open(pipe)
        .unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut bytes = vec![0; 1 << 16];
            while !done.load(Ordering::Relaxed) {
                if !reader.read(&mut bytes).is_ok_and(|count| count > 0) {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
        });
        let result = run();
        done.store(true, Ordering::Relaxed);
        result
    })
}
