//! Temporary folders in which the program runs, removed at the end.

use std::fs;
use std::io::Write;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tempfile::TempDir;

use crate::run::{Ran, program};
use crate::{root, tree};

/// A temporary folder.
#[derive(Debug)]
pub struct Place {
    folder: TempDir,
}

impl Default for Place {
    fn default() -> Self {
        Self::new()
    }
}

impl Place {
    /// An empty one that anybody may enter.
    #[must_use]
    pub fn empty() -> Self {
        let folder = TempDir::with_prefix("fluxform-test-").unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        Self { folder }
    }

    /// One with the repository's designs and shapes.
    #[must_use]
    pub fn new() -> Self {
        Self::with(&["designs", "shapes"])
    }

    /// One with links to these of the repository's folders.
    #[must_use]
    pub fn with(folders: &[&str]) -> Self {
        let place = Self::empty();
        for name in folders {
            symlink(root().join(name), place.path(name)).unwrap();
        }
        place
    }

    /// A copy, as another machine would have it: nothing is shared.
    #[must_use]
    pub fn duplicate(&self) -> Self {
        let copy = Self::empty();
        tree::copy(self.root(), copy.root());
        copy
    }

    #[must_use]
    pub fn root(&self) -> &Path {
        self.folder.path()
    }

    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.root().join(name)
    }

    /// Writes a file, and the folders it is in.
    pub fn write(&self, name: &str, content: &(impl AsRef<[u8]> + ?Sized)) {
        let path = self.path(name);
        let parent = path.parent().unwrap();
        fs::create_dir_all(parent).unwrap();
        let own = parent.canonicalize().unwrap();
        let root = self.root().canonicalize().unwrap();
        assert!(own.starts_with(root), "{name} is the repository's");
        fs::write(path, content).unwrap();
    }

    pub fn folder(&self, name: &str) {
        fs::create_dir_all(self.path(name)).unwrap();
    }

    /// Copies the files of a folder into a new one.
    pub fn copy(&self, from: &str, to: &str) {
        tree::copy(&self.path(from), &self.path(to));
    }

    #[track_caller]
    #[must_use]
    pub fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    #[track_caller]
    #[must_use]
    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).unwrap()
    }

    /// The program, with nothing in the environment that changes its output.
    #[must_use]
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(program());
        command.args(args);
        self.at_home(&mut command);
        command
    }

    /// Has the command run here, as [`Self::command`] does.
    pub fn at_home(&self, command: &mut Command) {
        command
            .current_dir(self.root())
            .env_remove("NO_COLOR")
            .env_remove("COLUMNS")
            .stdin(Stdio::null());
    }

    /// Starts the program without a reader of its standard output.
    #[must_use]
    pub fn spawn(&self, args: &[&str]) -> std::process::Child {
        let mut command = self.command(args);
        self.quietly(&mut command);
        command.spawn().unwrap()
    }

    /// As [`Self::at_home`], without standard output and with the messages in a pipe.
    pub fn quietly(&self, command: &mut Command) {
        self.at_home(command);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
    }

    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::of(self.command(args).output().unwrap())
    }

    pub fn run_with_input(&self, args: &[&str], input: &str) -> Ran {
        let mut child = self
            .command(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // A program that refuses its arguments does not read.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        Ran::of(child.wait_with_output().unwrap())
    }

    /// A shell that has the program in its path and ends at the first command that fails.
    pub fn shell(&self, script: &str) -> Ran {
        let program = program();
        let folder = program.parent().unwrap().display();
        let path = format!("{folder}:{}", std::env::var("PATH").unwrap());
        let mut command = Command::new("sh");
        command.args(["-e", "-c", script]);
        self.at_home(&mut command);
        let command = command.env("PATH", path).env("LC_ALL", "C");
        Ran::of(command.output().unwrap())
    }
}
