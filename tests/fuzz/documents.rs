//! The whole program on damaged documents: every key gone, doubled, misspelt, and every value another;
//! every kind of byte; names of files that command a terminal.
//!
//! ```text
//! cargo bench --locked --bench fuzz_documents -- [--every 1] [--only design]
//! FLUXFORM_OTHER=target/release/fluxform cargo bench --locked --bench fuzz_documents
//! ```
//!
//! No run may panic, be ended by a signal, take more than [`CPU_SECONDS`] or [`MEMORY_KIB`], end with
//! a code that the manual does not name, or print a control character. What breaks a run is printed
//! and kept in the folder for temporary files. Seconds and memory are read from `/proc` as the run
//! goes, every 2 ms.

// A measurement: it prints and ends with a code.
#![allow(clippy::print_stdout, clippy::disallowed_methods, clippy::exit)]

#[cfg(target_os = "linux")]
mod damage;
#[cfg(target_os = "linux")]
mod measured;

#[cfg(not(target_os = "linux"))]
fn main() {
    println!("skipped: processes are measured by /proc");
}

#[cfg(target_os = "linux")]
fn main() {
    linux::main();
}

#[cfg(target_os = "linux")]
mod linux {
    use std::collections::BTreeMap;
    use std::fs;
    use std::path::Path;
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use crate::damage::{Mutant, mutants};
    use crate::measured::{Measured, measured};

    /// More processor time than this, on one thread, is a hang.
    pub const CPU_SECONDS: u64 = 20;
    /// A run that wants more address space than this is refused it.
    pub const MEMORY_KIB: u64 = 4 << 20;

    /// A document and the commands that read it.
    struct Document {
        name: &'static str,
        file: &'static str,
        text: String,
        commands: &'static [&'static str],
    }

    fn documents() -> Vec<Document> {
        let document = |name, file, text: &str, commands| Document {
            name,
            file,
            text: text.to_owned(),
            commands,
        };
        const SHAPE: &[&str] = &["discretize FILE --out -"];
        vec![
            document(
                "design, air",
                "d.toml",
                AIR,
                &["evaluate FILE", "lambda FILE bump.toml"],
            ),
            document(
                "design, steel",
                "d.toml",
                STEEL,
                &[
                    "evaluate FILE",
                    "calibrate FILE bump.toml --explain --out out",
                ],
            ),
            document("shape, surface", "s.toml", SURFACE, SHAPE),
            document(
                "shape, primitive",
                "s.toml",
                BUMP,
                &["discretize FILE --out -", "lambda air.toml FILE"],
            ),
            document(
                "plan of a sweep",
                "plan.json",
                "",
                &["sweep run FILE --out out --index 0 --force"],
            ),
            document(
                "magnetisation curve",
                "curve.csv",
                CURVE,
                &["evaluate curved.toml"],
            ),
        ]
    }

    fn lay(place: &Path) {
        let write = |name: &str, text: &str| fs::write(place.join(name), text).unwrap();
        write("air.toml", AIR);
        write("bump.toml", BUMP);
        write("t.stl", &tent());
        write("curve.csv", CURVE);
        let curved = STEEL.replace("relative_permeability = 1000.0", "bh_curve = \"curve.csv\"");
        write("curved.toml", &curved);
    }

    /// Counts of the runs of one command.
    #[derive(Default)]
    struct Tally {
        runs: usize,
        codes: BTreeMap<i32, usize>,
        panics: usize,
        signals: usize,
        hangs: usize,
        raw: usize,
        seconds: f64,
        mib: f64,
    }

    pub fn main() {
        let words: Vec<String> = std::env::args().collect();
        let option = |name: &str| {
            let at = words.iter().position(|word| word == name)?;
            words.get(at + 1).cloned()
        };
        let every: usize = option("--every").and_then(|n| n.parse().ok()).unwrap_or(1);
        let only = option("--only").unwrap_or_default();
        let room = tempfile::tempdir().unwrap();
        println!(
            "| document | command | runs | exit 0 | 2 | 3 | 4 | panics | ended by a signal | over {CPU_SECONDS} CPU s | raw control characters | most CPU s | most MiB |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
        let mut sum = Tally::default();
        let mut faults = Vec::new();
        for mut document in documents() {
            if !document.name.contains(&only) {
                continue;
            }
            if document.text.is_empty() {
                document.text = plan(room.path());
            }
            let mutants: Vec<Mutant> = mutants(document.file, &document.text)
                .into_iter()
                .step_by(every.max(1))
                .collect();
            for command in document.commands {
                let tally = run_all(&document, command, &mutants, room.path(), &mut faults);
                row(document.name, command, &tally);
                sum.add(tally);
            }
        }
        row("all", "", &sum);
        for fault in &faults {
            println!("{fault}");
        }
        if !faults.is_empty() {
            std::process::exit(1);
        }
    }

    fn plan(room: &Path) -> String {
        let place = room.join("plan");
        fs::create_dir(&place).unwrap();
        lay(&place);
        let line = "sweep plan air.toml --set wire.diameter_mm=0.6,0.7 --out plan.json";
        let ran = measured(&place, &line.split(' ').collect::<Vec<_>>());
        assert_eq!(ran.code, Some(0), "{}", ran.said);
        let text = fs::read_to_string(place.join("plan.json")).unwrap();
        fs::remove_dir_all(&place).unwrap();
        text
    }

    fn run_all(
        document: &Document,
        command: &str,
        mutants: &[Mutant],
        room: &Path,
        faults: &mut Vec<String>,
    ) -> Tally {
        let next = AtomicUsize::new(0);
        let done = Mutex::new((Tally::default(), Vec::new()));
        let threads = std::thread::available_parallelism()
            .map_or(1, usize::from)
            .min(4);
        std::thread::scope(|scope| {
            for thread in 0..threads {
                let (next, done) = (&next, &done);
                scope.spawn(move || {
                    let place = room.join(format!("{thread}"));
                    loop {
                        let at = next.fetch_add(1, Ordering::Relaxed);
                        let Some(mutant) = mutants.get(at) else { break };
                        fs::create_dir(&place).unwrap();
                        lay(&place);
                        fs::write(place.join(&mutant.file), &mutant.bytes).unwrap();
                        let line = command.replace("FILE", "\u{0}");
                        let words: Vec<&str> = line
                            .split(' ')
                            .map(|word| {
                                if word == "\u{0}" {
                                    mutant.file.as_str()
                                } else {
                                    word
                                }
                            })
                            .collect();
                        let ran = measured(&place, &words);
                        fs::remove_dir_all(&place).unwrap();
                        let mut done = done.lock().unwrap();
                        if let Some(fault) = done.0.count(&ran) {
                            let what = format!("{command}: {}: {fault}", mutant.what);
                            done.1.push(format!("{what}{}", keep(document, mutant)));
                        }
                    }
                });
            }
        });
        let (tally, mut found) = done.into_inner().unwrap();
        found.sort();
        faults.append(&mut found);
        tally
    }

    /// Keeps what breaks a run, and says where.
    fn keep(document: &Document, mutant: &Mutant) -> String {
        let folder = std::env::temp_dir().join("fluxform-documents");
        let name = format!("{}-{}", mutant.number, document.file);
        let kept = fs::create_dir_all(&folder)
            .and_then(|()| fs::write(folder.join(&name), &mutant.bytes))
            .is_ok();
        if kept {
            format!(" ({})", folder.join(name).display())
        } else {
            String::new()
        }
    }

    impl Tally {
        /// Adds a run; what is wrong with it.
        fn count(&mut self, ran: &Measured) -> Option<String> {
            self.runs += 1;
            self.seconds = self.seconds.max(ran.seconds);
            self.mib = self.mib.max(ran.kib as f64 / 1024.0);
            if let Some(code) = ran.code {
                *self.codes.entry(code).or_default() += 1;
            }
            let raw = ran.said.contains(commands_a_terminal);
            self.raw += usize::from(raw);
            let line = ran
                .said
                .lines()
                .last()
                .unwrap_or("")
                .chars()
                .take(160)
                .collect::<String>();
            match ran.code {
                None if ran.seconds >= CPU_SECONDS as f64 - 1.0 => {
                    self.hangs += 1;
                    Some(format!("{:.0} CPU s", ran.seconds))
                }
                None => {
                    self.signals += 1;
                    Some(format!(
                        "ended by a signal at {} MiB: {line}",
                        ran.kib / 1024
                    ))
                }
                Some(0 | 2 | 3 | 4) if raw => Some("a raw control character".to_owned()),
                Some(0 | 2 | 3 | 4) => None,
                Some(code) => {
                    self.panics += 1;
                    Some(format!("code {code}: {line}"))
                }
            }
        }

        fn add(&mut self, other: Self) {
            self.runs += other.runs;
            for (code, count) in other.codes {
                *self.codes.entry(code).or_default() += count;
            }
            self.panics += other.panics;
            self.signals += other.signals;
            self.hangs += other.hangs;
            self.raw += other.raw;
            self.seconds = self.seconds.max(other.seconds);
            self.mib = self.mib.max(other.mib);
        }
    }

    /// Control characters, and marks that reorder the text around them.
    fn commands_a_terminal(c: char) -> bool {
        let reorders = matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
        reorders || (c.is_control() && c != '\n' && c != '\t')
    }

    fn row(document: &str, command: &str, tally: &Tally) {
        let of = |code| tally.codes.get(&code).copied().unwrap_or(0);
        println!(
            "| {document} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.1} | {:.0} |",
            command.split(' ').next().unwrap_or(""),
            tally.runs,
            of(0),
            of(2),
            of(3),
            of(4),
            tally.panics,
            tally.signals,
            tally.hangs,
            tally.raw,
            tally.seconds,
            tally.mib
        );
    }

    /// A tent of two faces.
    fn tent() -> String {
        let facet = |corners: [&str; 3]| {
            let [a, b, c] = corners.map(|corner| format!("vertex {corner}\n"));
            format!("facet normal 0 0 0\nouter loop\n{a}{b}{c}endloop\nendfacet\n")
        };
        let one = facet(["-13 -13 37", "13 -13 37", "0 13 47"]);
        format!("solid tent\n{one}endsolid tent\n")
    }

    const AIR: &str = r#"name = "air"
[coil]
inner_diameter_mm = 24.0
outer_diameter_mm = 38.0
length_mm = 70.0
turns = 1000
[wire]
diameter_mm = 0.7
conductor_diameter_mm = 0.65
resistivity_ohm_m = 1.68e-8
temperature_c = 20.0
choices_mm = [0.5, 0.7]
[array]
rows = 1
columns = 2
pitch_mm = 43.0
gain = [1.0, 0.9]
[magnet]
diameter_mm = 10.0
length_mm = 10.0
magnetization_a_per_m = 1.1579e6
polarity = "repel"
model = "cylinder"
tilt_deg = [0.7, 1.3]
[supply]
current_max_a = [1.3, 1.7]
current_min_a = -0.7
total_current_max_a = 2.3
voltage_v = 36.0
[limits]
resistance_max_ohm = 6.0
settling_max_ms = 100.0
outer_diameter_max_mm = 38.0
inner_diameter_min_mm = 2.0
length_max_mm = 100.0
power_max_w = 50.0
mass_max_kg = 1.0
wire_length_max_m = 200.0
[target]
height_mm = 30.0
[workspace]
x_mm = [-20.0, 20.0, 7]
y_mm = [-20.0, 20.0, 7]
z_mm = [30.0, 70.0, 7]
"#;

    const STEEL: &str = r#"name = "steel"
[coil]
inner_diameter_mm = 24.0
outer_diameter_mm = 38.0
length_mm = 70.0
[wire]
diameter_mm = 0.7
[core]
clearance_mm = 0.7
above_mm = 1.3
below_mm = 7.0
relative_permeability = 1000.0
knee_t = 1.5
conductivity_s_per_m = 5.8e6
[array]
positions_mm = [[0.0, 0.0], [43.0, 7.0]]
coupling = "none"
[magnet]
diameter_mm = 10.0
length_mm = 10.0
magnetization_a_per_m = 1.1579e6
[supply]
current_max_a = 1.3
voltage_v = 36.0
[limits]
core_field_max_t = 1.6
[target]
height_mm = 30.0
[workspace]
x_mm = [-20.0, 20.0, 7]
y_mm = [-20.0, 20.0, 7]
z_mm = [30.0, 70.0, 7]
"#;

    const SURFACE: &str = r#"name = "tent"
surface = "t.stl"
unit = "mm"
translate_mm = [0.7, 1.3, 2.0]
rotate_deg = [0.0, 0.0, 7.0]
[points]
x_mm = [-7.0, 7.0, 9]
y_mm = [-7.0, 7.0, 9]
outside = "skip"
"#;

    const BUMP: &str = r#"name = "bump"
primitive = "half-sphere"
radius_mm = 13.0
base_mm = 37.0
[points]
x_mm = [-13.0, 13.0, 9]
y_mm = [-13.0, 13.0, 9]
outside = "skip"
"#;

    const CURVE: &str = "b_t,h_a_per_m\n0,0\n0.7,170\n1.3,700\n1.7,13000\n";
}
