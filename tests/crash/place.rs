//! Folders in which the program is disturbed, and what lies in them.

use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// The program under test.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_fluxform");
/// Where every scenario writes.
pub const OUT: &str = "out";

/// Every file below a folder with its bytes; a folder with nothing in it ends with `/`.
pub type Tree = BTreeMap<String, Vec<u8>>;

/// A folder with a scenario's inputs, removed at the end.
pub struct Place {
    folder: TempDir,
}

impl Place {
    /// An empty one that anybody may enter.
    pub fn empty() -> Self {
        let folder = tempfile::Builder::new()
            .prefix("fluxform-crash-")
            .tempdir()
            .unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        fs::create_dir(folder.path().join(OUT)).unwrap();
        Self { folder }
    }

    /// A copy, as another machine would have it: nothing is shared.
    pub fn copy(&self) -> Self {
        let copy = Self::empty();
        copy_below(self.path(), copy.path());
        copy
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    pub fn out(&self) -> PathBuf {
        self.path().join(OUT)
    }

    pub fn write(&self, name: &str, text: &str) {
        fs::write(self.path().join(name), text).unwrap();
    }

    /// What lies in the output folder.
    pub fn tree(&self) -> Tree {
        tree(&self.out())
    }

    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(PROGRAM);
        command.args(args);
        self.at_home(&mut command);
        command
    }

    /// Runs here, saying what it says to a pipe.
    pub fn at_home(&self, command: &mut Command) {
        command
            .current_dir(self.path())
            .env_remove("NO_COLOR")
            .env_remove("COLUMNS")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::of(self.command(args).output().unwrap())
    }
}

/// How a run ended.
#[derive(Debug)]
pub struct Ran {
    /// `None` where a signal ended it.
    pub code: Option<i32>,
    pub said: String,
}

impl Ran {
    pub fn of(output: Output) -> Self {
        Self {
            code: output.status.code(),
            said: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// One of these codes, or what happened instead.
    pub fn ends(&self, codes: &[i32]) -> Result<(), String> {
        if self.code.is_some_and(|code| codes.contains(&code)) {
            return Ok(());
        }
        Err(format!(
            "ended with {:?}, not {codes:?}: {}",
            self.code, self.said
        ))
    }
}

pub fn tree(folder: &Path) -> Tree {
    let mut found = Tree::new();
    walk(folder, folder, &mut found);
    found
}

/// A file that goes while it is looked at is not there.
fn walk(root: &Path, folder: &Path, found: &mut Tree) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    let mut any = false;
    for entry in entries.flatten() {
        any = true;
        let path = entry.path();
        let name = path.strip_prefix(root).unwrap().to_string_lossy();
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            walk(root, &path, found);
        } else if let Ok(bytes) = fs::read(&path) {
            found.insert(name.into_owned(), bytes);
        }
    }
    if !any && folder != root {
        let name = folder.strip_prefix(root).unwrap().to_string_lossy();
        found.insert(format!("{name}/"), Vec::new());
    }
}

fn copy_below(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            if !target.is_dir() {
                fs::create_dir(&target).unwrap();
            }
            copy_below(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Names, sizes and numbers of all that lies below: differs when anything changed.
pub fn glimpse(folder: &Path) -> Vec<(PathBuf, u64)> {
    let mut seen = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let length = entry.metadata().map_or(0, |metadata| metadata.len());
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                folders.push(entry.path());
            }
            seen.push((entry.path(), length));
        }
    }
    seen
}

/// How often the folder changes before the child ends, as far as looking all the time shows.
pub fn changes(folder: &Path, child: &mut Child) -> usize {
    after_changes(folder, child, usize::MAX)
}

/// Returns at the `wanted`-th change in the folder, or when the child has ended; tells how many.
pub fn after_changes(folder: &Path, child: &mut Child, wanted: usize) -> usize {
    let mut last = glimpse(folder);
    let mut count = 0;
    let began = Instant::now();
    while count < wanted && child.try_wait().unwrap().is_none() {
        let now = glimpse(folder);
        if now != last {
            count += 1;
            last = now;
        }
        assert!(began.elapsed() < Duration::from_secs(300), "hangs");
    }
    count
}

/// A small generator: the same numbers in every run.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    pub fn part(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In `0..below`.
    pub fn below(&mut self, below: usize) -> usize {
        (self.part() * below as f64) as usize
    }
}
