//! Damaged and hostile surface files for every reader, for as long as requested.
//!
//! ```text
//! cargo bench --locked --bench fuzz_surfaces -- [--seconds 60] [--format 3mf] [--seed 1]
//! ```
//!
//! Samples made by the tests, and the real files in the folder that `FLUXFORM_CORPUS` names are
//! damaged inside their containers and packed again; before them come inputs made to exhaust a
//! reader. No input may panic, take more than a second (and than a second a megabyte) of CPU, or
//! make the reader hold more than 16 MiB (and than 16 times the content of the file, and than two
//! copies of the triangles that it returns). One that does is kept in the folder for temporary files
//! and named; the run goes on and fails in the end.

// A measurement: it reads the clock, prints and ends a run that hangs.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::exit)]

mod hostile;
mod mutation;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use fluxform::shape::document::SurfaceFormat;
use fluxform_testing::{Random, surface_files, surfaces};
use mutation::Seed;
use peak_alloc::PeakAlloc;

#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

const SECONDS_PER_MB: f64 = 1.0;
const LEAST_SECONDS: f64 = 1.0;
/// How much more memory than content a reader may hold, and what any may.
const MEMORY: (f64, f64) = (16.0, (16 << 20) as f64);
/// Bytes of a triangle read.
const TRIANGLE: f64 = 72.0;
/// A reader that takes so long is not waited for.
const HANGS: Duration = Duration::from_secs(60);
/// Larger real files leave time for few rounds.
const LARGEST_SEED: u64 = 300_000;

/// Endings, one for each format.
const FORMATS: [&str; 10] = [
    "stl", "obj", "ply", "off", "glb", "png", "3mf", "amf", "3dxml", "sldprt",
];

/// Time read by the watch: milliseconds since the start when the input began, 0 between inputs.
static BEGAN: AtomicU64 = AtomicU64::new(0);

fn seeds(format: SurfaceFormat) -> Vec<Seed> {
    let text = |bytes: Vec<u8>| Seed::of(bytes);
    let mut seeds = match format {
        SurfaceFormat::Stl => {
            let floats = [[[0.7f32, -1.3, 2.9], [10.1, 0.3, 3.1], [-4.7, 8.3, 2.3]]; 3];
            let ascii = "solid a b\n facet normal 0 0 1\n  outer loop\n   vertex 0.7 -1.3 \
                         2.9e+000\n   vertex 10.1 .3 3\n   vertex -4.7 8.3 1e-3\n  endloop\n \
                         endfacet\nendsolid a b\n";
            vec![
                Seed::Plain(surfaces::binary(&floats)),
                Seed::Plain(ascii.repeat(2).into_bytes()),
            ]
        }
        SurfaceFormat::Obj => vec![
            text(surface_files::obj()),
            Seed::Plain(wide(&surface_files::obj(), u16::to_le_bytes)),
            Seed::Plain(wide(&surface_files::obj(), u16::to_be_bytes)),
        ],
        SurfaceFormat::Ply => vec![
            text(surface_files::ply_ascii()),
            text(surface_files::ply_binary(false)),
            text(surface_files::ply_binary(true)),
            text(surface_files::ply_strips()),
        ],
        SurfaceFormat::Off => vec![text(surface_files::off())],
        SurfaceFormat::Glb => vec![text(surface_files::glb())],
        SurfaceFormat::HeightImage => [png::BitDepth::Eight, png::BitDepth::Sixteen]
            .map(|depth| text(surface_files::height_image(5, &[17; 40], depth)))
            .to_vec(),
        SurfaceFormat::ThreeMf => vec![text(surface_files::three_mf("inch"))],
        SurfaceFormat::Amf => vec![
            text(surface_files::amf("mm").into_bytes()),
            text(surface_files::zipped(&[(
                "a.amf",
                &surface_files::amf("mm"),
            )])),
        ],
        SurfaceFormat::ThreeDxml => vec![text(surface_files::three_dxml())],
        // Read by another program, in a process of its own.
        SurfaceFormat::Step => Vec::new(),
        SurfaceFormat::Sldprt => vec![
            Seed::Display(surface_files::display_lists()),
            Seed::Plain(surface_files::sldprt()),
            Seed::Plain(surface_files::sldprt_compound(&[(
                "Contents/DisplayLists__ZLB",
                &surface_files::display_lists(),
            )])),
            Seed::Plain(surface_files::sldprt_assembly(
                surface_files::assembly().0.as_bytes(),
                &surface_files::assembly().1,
            )),
        ],
    };
    let folder = std::env::var_os("FLUXFORM_CORPUS").map(PathBuf::from);
    let mut real: Vec<PathBuf> = folder
        .iter()
        .flat_map(|folder| [folder.clone(), folder.join("bad_stl")])
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flat_map(|entries| entries.flatten().map(|entry| entry.path()))
        .filter(|path| SurfaceFormat::of(path) == Some(format))
        .collect();
    real.sort();
    for path in real {
        if std::fs::metadata(&path).is_ok_and(|facts| facts.len() <= LARGEST_SEED)
            && let Ok(bytes) = std::fs::read(&path)
        {
            seeds.push(Seed::of(bytes));
        }
    }
    seeds
}

/// A text in UTF-16, with its byte-order mark.
fn wide(text: &[u8], order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let units = text.iter().map(|byte| u16::from(*byte));
    std::iter::once(0xfeff)
        .chain(units)
        .flat_map(order)
        .collect()
}

#[derive(Default)]
struct Tally {
    inputs: u64,
    read: u64,
    slowest: f64,
    largest: f64,
    faults: BTreeMap<String, u64>,
    kept: u64,
}

impl Tally {
    /// Gives the reader one input and looks at what it did. `content`: bytes of it, unpacked.
    fn give(
        &mut self,
        name: &str,
        format: SurfaceFormat,
        what: &str,
        bytes: &[u8],
        content: usize,
    ) {
        std::fs::write(last(name), bytes).unwrap_or_default();
        HEAP.reset_peak_usage();
        let held = HEAP.current_usage();
        let began = ProcessTime::now();
        BEGAN.store(millis().max(1), Ordering::Relaxed);
        let result = catch_unwind(AssertUnwindSafe(|| format.read(Path::new("f"), bytes)));
        BEGAN.store(0, Ordering::Relaxed);
        let seconds = began.elapsed().as_secs_f64();
        let memory = HEAP.peak_usage().saturating_sub(held) as f64;
        self.inputs += 1;
        let size = content.max(bytes.len()) as f64;
        self.slowest = self.slowest.max(seconds / (size / 1e6).max(1.0));
        let (ratio, least) = MEMORY;
        self.largest = self.largest.max(memory / size.max(1048576.0));
        let mut allowed = least.max(ratio * size);
        let mut faults: Vec<&str> = Vec::new();
        match &result {
            Err(_) => faults.push("panic"),
            Ok(Ok(mesh)) => {
                self.read += 1;
                let triangles = TRIANGLE * mesh.triangles.len() as f64;
                allowed = allowed.max(2.0 * triangles + 4.0 * size);
                let numbers = mesh.triangles.as_flattened().as_flattened();
                if numbers.is_empty() || !numbers.iter().all(|c| c.is_finite()) {
                    faults.push("empty or not finite");
                }
            }
            Ok(Err(error)) => {
                if error.to_string().len() > 2000 {
                    faults.push("a long message");
                }
            }
        }
        if seconds > LEAST_SECONDS.max(SECONDS_PER_MB * size / 1e6) {
            faults.push("slow");
        }
        if memory > allowed {
            faults.push("memory");
        }
        for fault in faults {
            let key = format!("{fault}: {what}");
            let count = self.faults.entry(key.clone()).or_default();
            *count += 1;
            if *count <= 3 {
                self.kept += 1;
                let path = kept(name, self.kept);
                std::fs::write(&path, bytes).unwrap_or_default();
                println!(
                    "{name}: {key}: {seconds:.2} s, {:.1} MiB, {} bytes of {content}: {}",
                    memory / 1048576.0,
                    bytes.len(),
                    path.display()
                );
            }
        }
    }
}

fn last(name: &str) -> PathBuf {
    std::env::temp_dir().join(format!("fluxform-fuzz-last.{name}"))
}

fn kept(name: &str, number: u64) -> PathBuf {
    std::env::temp_dir().join(format!("fluxform-fuzz-{number}.{name}"))
}

fn millis() -> u64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_millis() as u64
}

/// Ends the run when an input hangs; it is the one in the file that was written last.
fn watch() {
    std::thread::spawn(|| {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let began = BEGAN.load(Ordering::Relaxed);
            if began > 0 && u128::from(millis() - began) > HANGS.as_millis() {
                println!("hangs: see {}", last("*").display());
                std::process::exit(2);
            }
        }
    });
}

fn run(name: &str, format: SurfaceFormat, seconds: f64, seed: u64) -> bool {
    let start = Instant::now();
    let mut tally = Tally::default();
    for (what, bytes) in hostile::inputs(format) {
        // A bomb's content is not believed; other archives hold what is to be read.
        let content = if what.contains("bomb") {
            bytes.len()
        } else {
            Seed::of(bytes.clone()).content()
        };
        tally.give(name, format, what, &bytes, content);
    }
    let seeds = seeds(format);
    for seed in &seeds {
        tally.give(name, format, "a seed", &seed.pack(), seed.content());
    }
    let mut random = Random::new(seed);
    let mut round = 0;
    while start.elapsed().as_secs_f64() < seconds {
        let (bytes, content) = seeds[round % seeds.len()].mutated(&mut random);
        tally.give(name, format, "a mutant", &bytes, content);
        round += 1;
    }
    println!(
        "| {name} | {} | {:.0} | {} | {} | {:.3} | {:.2} | {} |",
        tally.inputs,
        start.elapsed().as_secs_f64(),
        tally.read,
        tally.inputs - tally.read,
        tally.slowest,
        tally.largest,
        tally.faults.values().sum::<u64>()
    );
    tally.faults.is_empty()
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    let option = |name: &str| {
        let at = words.iter().position(|word| word == name)?;
        words.get(at + 1).cloned()
    };
    let seconds = option("--seconds")
        .and_then(|s| s.parse().ok())
        .unwrap_or(10.0);
    let seed = option("--seed").and_then(|s| s.parse().ok()).unwrap_or(1);
    let expected = option("--format");
    std::panic::set_hook(Box::new(|_| {}));
    watch();
    println!(
        "| format | inputs | s | read | refused | worst s a MB (at least 1) | worst memory / size (at least 1 MiB) | faults |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let mut well = true;
    for name in FORMATS {
        let format = SurfaceFormat::of(&Path::new("f").with_extension(name));
        let format = format.expect("an ending that is read");
        if expected.as_deref().is_none_or(|expected| expected == name) {
            well &= run(name, format, seconds, seed);
        }
    }
    if !well {
        std::process::exit(1);
    }
}
