//! OpenCASCADE in a process of its own: Python with `cadquery-ocp` runs `opencascade.py`.
//!
//! The file goes in, triangles and what was measured of them come back. The process has limits of
//! time and memory, which it sets itself, and is ended when the computation is interrupted or this
//! program ends. The file is untrusted, hence whatever comes back is checked before it is used.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use serde::Deserialize;

use super::gates::Part;
use crate::bodies::BodyOptions;
use fluxform_base::progress::{Progress, poll, stop_requested};

/// The program that the process runs.
const PROGRAM: &str = include_str!("opencascade.py");
/// Pause between two looks whether to stop.
const LOOK: Duration = Duration::from_millis(10);
/// A Python that says nothing for this many times the processor time that it may take does not start.
const SILENT_TIMES: u64 = 10;
/// No longer than this is waited for its first line, s.
const LONGEST_SILENCE_S: u64 = 120;
/// Longest line of its report, bytes.
const LONGEST_LINE: u64 = 64 << 20;
/// Most facets that are taken of one file.
const MOST_FACETS: usize = 50_000_000;

pub(super) const ADVICE: &str = "save the body as 3MF or STL in the CAD program instead";
const INSTALL: &str = "STEP is read by OpenCASCADE, which Python brings: `python3 -m pip install \
                       cadquery-ocp`, or name a Python that has it in FLUXFORM_PYTHON";

/// Which Python is asked, and what it may take.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Kernel {
    /// The interpreter; `None`: `python3`, or `python` where there is none.
    pub python: Option<PathBuf>,
    /// Processor time, s.
    pub cpu_seconds: u64,
    /// Memory, bytes.
    pub memory_bytes: u64,
}

impl Default for Kernel {
    fn default() -> Self {
        Self {
            python: None,
            cpu_seconds: STEP_SECONDS,
            memory_bytes: 8 << 30,
        }
    }
}

/// Processor time that a reading may take unasked, s.
pub const STEP_SECONDS: u64 = 300;

static KERNEL: OnceLock<Kernel> = OnceLock::new();

/// Sets what all later readings use; the first call counts.
pub fn configure(kernel: Kernel) {
    let _ = KERNEL.set(kernel);
}

/// The bodies of a file as OpenCASCADE meshed them; lengths in mm.
#[derive(Debug)]
pub(super) struct Reply {
    pub(super) version: String,
    /// Millimetres of the file's unit.
    pub(super) unit_mm: f64,
    /// The chord that was requested.
    pub(super) chord_mm: f64,
    /// Shells and faces that bound no body.
    pub(super) loose: usize,
    /// Placements of the file's own, outside assemblies, that are not its frame itself.
    pub(super) moved_roots: usize,
    /// Bodies that do not pass OpenCASCADE's own check, though no face is taken for what it leaves out.
    pub(super) invalid: usize,
    pub(super) bodies: Vec<PlacedBody>,
    /// The different bodies; each is placed once or more often.
    pub(super) parts: Vec<Part>,
}

/// A body in its place.
#[derive(Debug, Deserialize)]
pub(super) struct PlacedBody {
    pub(super) part: usize,
    /// Rows of the rotation, each with its component of the translation.
    pub(super) place: [[f64; 4]; 3],
    pub(super) name: String,
    pub(super) within: Vec<String>,
    pub(super) color: Option<[f64; 3]>,
}

/// A line of the report.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Line {
    Version(String),
    Stage { name: String, done: u64, total: u64 },
    Missing(String),
    Refused(String),
    Result(Figures),
}

#[derive(Deserialize)]
struct Figures {
    unit_mm: f64,
    chord_mm: f64,
    loose: usize,
    moved_roots: usize,
    invalid: usize,
    bodies: Vec<PlacedBody>,
    parts: Vec<PartFigures>,
}

#[derive(Deserialize)]
struct PartFigures {
    /// Numbers of the vertices, three each.
    points: usize,
    /// Indices of the triangles, three each.
    triangles: usize,
    deviation: f64,
    area: f64,
    volume: f64,
    mended: bool,
}

/// Messages of the thread that listens.
enum Heard {
    Line(Line),
    Parts(Vec<Part>),
    /// The report does not follow its own form.
    Garbled,
}

/// The process, ended when this goes.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail only where it has ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Meshes the bodies of a STEP file.
///
/// # Errors
/// Why not, and what to do.
pub(super) fn mesh(
    bytes: &[u8],
    options: &BodyOptions,
    progress: &dyn Progress,
) -> Result<Reply, String> {
    let kernel = KERNEL.get_or_init(Kernel::default);
    let mut process = start(kernel, options)?;
    let (Some(stdin), Some(stdout)) = (process.0.stdin.take(), process.0.stdout.take()) else {
        return Err("its reader has no streams".into());
    };
    let (sender, heard) = channel();
    thread::scope(|scope| {
        scope.spawn(move || feed(stdin, bytes));
        scope.spawn(move || listen(stdout, &sender));
        let reply = converse(&heard, kernel, progress);
        let reply = match reply {
            Ok(reply) => Ok(reply),
            Err(Some(why)) => Err(why),
            Err(None) => Err(ended(&mut process.0, kernel)),
        };
        // Both threads end with the process.
        drop(process);
        // Leaves by unwinding where a stop is requested.
        poll();
        reply
    })
}

fn start(kernel: &Kernel, options: &BodyOptions) -> Result<Process, String> {
    let usual = ["python3", "python"].map(PathBuf::from);
    let candidates = kernel
        .python
        .as_ref()
        .map_or(&usual[..], std::slice::from_ref);
    let mut why = String::new();
    for python in candidates {
        let mut command = Command::new(python);
        command
            .args(["-I", "-c", PROGRAM])
            .arg(format!("{:e}", options.chord_m.unwrap_or(0.0) * 1e3))
            .arg(kernel.cpu_seconds.to_string())
            .arg(kernel.memory_bytes.to_string())
            .arg(options.body.as_deref().unwrap_or(""))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        match command.spawn() {
            Ok(child) => return Ok(Process(child)),
            Err(error) => why = format!("{} cannot be run ({error})", python.display()),
        }
    }
    Err(format!("{why}; {INSTALL}; or {ADVICE}"))
}

/// Hands the file over; the process may end before it has read all.
fn feed(mut stdin: ChildStdin, bytes: &[u8]) {
    let _ = stdin.write_all(bytes);
}

/// The stage that is reported as progress.
struct Stages<'a> {
    progress: &'a dyn Progress,
    /// Its name and how much of it is done.
    open: Option<(String, u64)>,
}

impl Stages<'_> {
    fn reach(&mut self, name: String, done: u64, total: u64) {
        let before = match &self.open {
            Some((open, before)) if *open == name => *before,
            _ => {
                self.close();
                self.progress.begin(&name, total);
                0
            }
        };
        self.progress.advance(done.saturating_sub(before));
        self.open = Some((name, done));
    }

    fn close(&mut self) {
        if self.open.take().is_some() {
            self.progress.end();
        }
    }
}

impl Drop for Stages<'_> {
    fn drop(&mut self) {
        self.close();
    }
}

/// Follows the report until the result or the end.
fn converse(
    heard: &Receiver<Heard>,
    kernel: &Kernel,
    progress: &dyn Progress,
) -> Result<Reply, Option<String>> {
    let mut version = String::new();
    // Its limit of processor time ends what computes; what waits before it begins uses none.
    let patience_s = LONGEST_SILENCE_S.min(SILENT_TIMES.saturating_mul(kernel.cpu_seconds));
    let mut looks = u128::from(patience_s) * 1000 / LOOK.as_millis();
    let mut stages = Stages {
        progress,
        open: None,
    };
    let mut figures = None;
    loop {
        let line = match heard.recv_timeout(LOOK) {
            Err(RecvTimeoutError::Timeout) if stop_requested() || progress.interrupted() => {
                return Err(Some("it was interrupted".into()));
            }
            Err(RecvTimeoutError::Timeout) if version.is_empty() && looks == 0 => {
                return Err(Some(format!(
                    "Python does not start: it said nothing for {patience_s} s; {INSTALL}; or {ADVICE}"
                )));
            }
            Err(RecvTimeoutError::Timeout) => {
                looks = looks.saturating_sub(1);
                continue;
            }
            Err(RecvTimeoutError::Disconnected) if version.is_empty() => {
                return Err(Some(format!(
                    "Python ended before it read anything; {INSTALL}; or {ADVICE}"
                )));
            }
            Err(RecvTimeoutError::Disconnected) => return Err(None),
            Ok(Heard::Garbled) => return Err(Some(garbled())),
            Ok(Heard::Parts(parts)) => {
                let reply = figures
                    .take()
                    .and_then(|known| reply(version, known, parts));
                return reply.ok_or_else(|| Some(garbled()));
            }
            Ok(Heard::Line(line)) => line,
        };
        match line {
            Line::Version(text) => version = text,
            Line::Stage { name, done, total } => stages.reach(name, done, total),
            Line::Missing(what) => {
                return Err(Some(format!("{INSTALL} (it reports: {what}); or {ADVICE}")));
            }
            Line::Refused(why) => return Err(Some(format!("{why}; {ADVICE}"))),
            Line::Result(known) => figures = Some(known),
        }
    }
}

fn garbled() -> String {
    format!("OpenCASCADE's reader returned no proper result; {ADVICE}")
}

/// Why the process ended without a result.
fn ended(process: &mut Child, kernel: &Kernel) -> String {
    let how = match process.wait() {
        Ok(status) => status.to_string(),
        Err(error) => error.to_string(),
    };
    format!(
        "OpenCASCADE ended on it ({how}; it may take {} s of processor time and {} MiB of memory); \
         ask for a longer --chord or one --body, or {ADVICE}",
        kernel.cpu_seconds,
        kernel.memory_bytes >> 20
    )
}

/// Reads the report and passes it on, until its end or its first fault.
fn listen(stdout: ChildStdout, sender: &Sender<Heard>) {
    let mut stdout = BufReader::new(stdout);
    loop {
        let mut line = Vec::new();
        match (&mut stdout)
            .take(LONGEST_LINE)
            .read_until(b'\n', &mut line)
        {
            Ok(0) => return,
            Ok(_) => {}
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return,
        }
        let Ok(line) = serde_json::from_slice::<Line>(&line) else {
            let _ = sender.send(Heard::Garbled);
            return;
        };
        let parts = match &line {
            Line::Result(figures) => Some(parts(&mut stdout, figures)),
            Line::Version(_) | Line::Stage { .. } | Line::Missing(_) | Line::Refused(_) => None,
        };
        if sender.send(Heard::Line(line)).is_err() {
            return;
        }
        if let Some(parts) = parts {
            let _ = sender.send(parts.map_or(Heard::Garbled, Heard::Parts));
            return;
        }
    }
}

/// The triangles that follow the figures; `None` where they do not follow.
fn parts(from: &mut impl Read, figures: &Figures) -> Option<Vec<Part>> {
    let facets = figures.parts.iter().map(|part| part.triangles / 3);
    if facets.fold(0, usize::saturating_add) > MOST_FACETS {
        return None;
    }
    let mut read = |count: usize, width: usize| -> Option<Vec<u8>> {
        let length = count.checked_mul(width)?;
        let mut bytes = Vec::new();
        from.take(length as u64).read_to_end(&mut bytes).ok()?;
        (bytes.len() == length).then_some(bytes)
    };
    let one = |part: &PartFigures| {
        let points = read(part.points, 8)?;
        let indices = read(part.triangles, 4)?;
        let number = |c: &[u8; 8]| f64::from_ne_bytes(*c);
        let points: Vec<f64> = points.as_chunks().0.iter().map(number).collect();
        let points = points.as_chunks::<3>().0;
        if !points.as_flattened().iter().all(|c| c.is_finite()) {
            return None;
        }
        let index = |c: &[u8; 4]| u32::from_ne_bytes(*c) as usize;
        let indices: Vec<usize> = indices.as_chunks().0.iter().map(index).collect();
        let corner = |k: usize| points.get(k).copied();
        let triangle = |[a, b, c]: &[usize; 3]| Some([corner(*a)?, corner(*b)?, corner(*c)?]);
        Some(Part {
            triangles: indices
                .as_chunks()
                .0
                .iter()
                .map(triangle)
                .collect::<Option<_>>()?,
            deviation: part.deviation,
            area: part.area,
            volume: part.volume,
            mended: part.mended,
        })
    };
    figures.parts.iter().map(one).collect()
}

/// Figures and triangles together; `None` where they do not fit.
fn reply(version: String, figures: Figures, parts: Vec<Part>) -> Option<Reply> {
    let positive = |v: f64| v > 0.0 && v.is_finite();
    let sound = |part: &Part| part.deviation >= 0.0 && positive(part.area) && positive(part.volume);
    let placed = |body: &PlacedBody| body.part < parts.len();
    (positive(figures.unit_mm) && parts.iter().all(sound) && figures.bodies.iter().all(placed))
        .then_some(())?;
    Some(Reply {
        version,
        unit_mm: figures.unit_mm,
        chord_mm: figures.chord_mm,
        loose: figures.loose,
        moved_roots: figures.moved_roots,
        invalid: figures.invalid,
        bodies: figures.bodies,
        parts,
    })
}
