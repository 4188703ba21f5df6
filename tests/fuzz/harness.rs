//! Gives an input to a reader and looks at what it did: panics, time, memory, words.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use cpu_time::ProcessTime;
use peak_alloc::PeakAlloc;

use fluxform_testing::Random;

/// Object at a name of an input.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    Bytes(Vec<u8>),
    /// A symbolic link to this.
    Link(String),
    /// A pipe that nobody writes into.
    Pipe,
    Folder,
}

/// A file, or a folder's files, by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Input(pub Vec<(String, Content)>);

impl Input {
    pub fn file(name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self(vec![(name.to_owned(), Content::Bytes(bytes.into()))])
    }

    pub fn get(&self, name: &str) -> Option<&[u8]> {
        let found = self.0.iter().find(|(other, _)| other == name)?;
        match &found.1 {
            Content::Bytes(bytes) => Some(bytes),
            _ => None,
        }
    }

    pub fn get_mut(&mut self, name: &str) -> Option<&mut Vec<u8>> {
        let found = self.0.iter_mut().find(|(other, _)| other == name)?;
        match &mut found.1 {
            Content::Bytes(bytes) => Some(bytes),
            _ => None,
        }
    }

    pub fn put(&mut self, name: &str, content: Content) {
        match self.0.iter_mut().find(|(other, _)| other == name) {
            Some(found) => found.1 = content,
            None => self.0.push((name.to_owned(), content)),
        }
    }

    /// Bytes of all files.
    pub fn size(&self) -> usize {
        let size = |content: &Content| match content {
            Content::Bytes(bytes) => bytes.len(),
            _ => 0,
        };
        self.0.iter().map(|(_, content)| size(content)).sum()
    }

    /// Writes the files into `folder`, which is emptied before.
    #[allow(clippy::disallowed_methods)] // a test's own files
    pub fn write(&self, folder: &Path) {
        let _ = std::fs::remove_dir_all(folder);
        std::fs::create_dir_all(folder).expect("a temporary folder");
        for (name, content) in &self.0 {
            let path = folder.join(name);
            if let Some(parent) = path.parent() {
                std::fs::create_dir_all(parent).expect("a temporary folder");
            }
            match content {
                Content::Bytes(bytes) => std::fs::write(&path, bytes).expect("a temporary file"),
                Content::Folder => std::fs::create_dir_all(&path).expect("a temporary folder"),
                #[cfg(unix)]
                Content::Link(to) => {
                    std::os::unix::fs::symlink(to, &path).expect("a temporary link");
                }
                #[cfg(unix)]
                Content::Pipe => {
                    let made = std::process::Command::new("mkfifo").arg(&path).status();
                    assert!(made.is_ok_and(|made| made.success()), "mkfifo");
                }
                #[cfg(not(unix))]
                _ => {}
            }
        }
    }
}

/// The most that a reader may take of an input: seconds (for a megabyte, and for any input), bytes
/// held (for a byte, and for any input).
#[derive(Clone, Copy)]
pub struct Limits {
    pub seconds_per_mb: f64,
    pub seconds: f64,
    pub bytes_per_byte: f64,
    pub bytes: f64,
}

/// How a kind of input is read: `Ok(true)` read, `Ok(false)` refused as it should, or what is wrong
/// with the answer. The folder holds the input's files.
type Give = fn(&Input, &Path) -> Result<bool, String>;

/// A kind of input.
pub struct Kind {
    pub name: &'static str,
    pub limits: Limits,
    /// Good inputs.
    pub seeds: fn() -> Vec<Input>,
    /// Inputs made to exhaust or to deceive the reader, and every one that ever broke it.
    pub hostile: fn() -> Vec<(String, Input)>,
    pub mutate: fn(&mut Input, &mut Random),
    pub give: Give,
}

/// Time read by the watch: milliseconds since the start when the input began, 0 between inputs.
pub static BEGAN: AtomicU64 = AtomicU64::new(0);

pub fn millis() -> u64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_millis() as u64
}

/// Counts of a kind's inputs.
#[derive(Default)]
pub struct Tally {
    pub inputs: u64,
    pub read: u64,
    pub slowest: f64,
    pub largest: f64,
    pub faults: BTreeMap<String, u64>,
}

pub struct Harness<'a> {
    pub heap: &'a PeakAlloc,
    pub folder: PathBuf,
    /// Where inputs that break a reader are kept.
    pub kept: Option<PathBuf>,
}

impl Harness<'_> {
    pub fn give(&self, kind: &Kind, what: &str, input: &Input, tally: &mut Tally) {
        let folder = self.folder.join(kind.name);
        input.write(&folder);
        self.heap.reset_peak_usage();
        let held = self.heap.current_usage();
        let began = ProcessTime::now();
        BEGAN.store(millis().max(1), Ordering::Relaxed);
        let result = catch_unwind(AssertUnwindSafe(|| (kind.give)(input, &folder)));
        BEGAN.store(0, Ordering::Relaxed);
        let seconds = began.elapsed().as_secs_f64();
        let memory = self.heap.peak_usage().saturating_sub(held) as f64;
        let size = input.size() as f64;
        let limits = &kind.limits;
        let most_seconds = limits.seconds.max(limits.seconds_per_mb * size / 1e6);
        let most_bytes = limits.bytes.max(limits.bytes_per_byte * size);
        tally.inputs += 1;
        tally.slowest = tally.slowest.max(seconds / most_seconds);
        tally.largest = tally.largest.max(memory / most_bytes);
        let mut faults = Vec::new();
        match result {
            Err(panic) => {
                let words = panic
                    .downcast_ref::<String>()
                    .cloned()
                    .or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()));
                faults.push(format!("panic: {}", words.unwrap_or_default()));
            }
            Ok(Err(fault)) => faults.push(fault),
            Ok(Ok(read)) => tally.read += u64::from(read),
        }
        if seconds > most_seconds {
            faults.push(format!("slow: {seconds:.2} s for {size} bytes"));
        }
        if memory > most_bytes {
            let mib = memory / 1_048_576.0;
            faults.push(format!("memory: {mib:.1} MiB for {size} bytes"));
        }
        for fault in faults {
            let short: String = fault.chars().take(160).collect();
            let count = tally.faults.entry(format!("{what}: {short}")).or_default();
            *count += 1;
            if let (Some(kept), true) = (&self.kept, *count <= 2) {
                let number = tally.inputs;
                let folder = kept.join(format!("{}-{number}", kind.name));
                input.write(&folder);
                report(&format!(
                    "{}: {what}: {fault}: {}",
                    kind.name,
                    folder.display()
                ));
            }
        }
    }

    /// All seeds and hostile inputs, then mutants until `goes_on` says no.
    pub fn run(
        &self,
        kind: &Kind,
        random: &mut Random,
        mut goes_on: impl FnMut(u64) -> bool,
    ) -> Tally {
        let mut tally = Tally::default();
        for (what, input) in (kind.hostile)() {
            self.give(kind, &what, &input, &mut tally);
        }
        let seeds = (kind.seeds)();
        for seed in &seeds {
            let read = tally.read;
            self.give(kind, "a seed", seed, &mut tally);
            if tally.read == read {
                tally.faults.insert("a seed is refused".to_owned(), 1);
            }
        }
        let mut round = 0;
        while goes_on(round) {
            let mut input = seeds[round as usize % seeds.len()].clone();
            (kind.mutate)(&mut input, random);
            self.give(kind, "a mutant", &input, &mut tally);
            round += 1;
        }
        tally
    }
}

#[allow(clippy::print_stdout)]
fn report(line: &str) {
    println!("{line}");
}
