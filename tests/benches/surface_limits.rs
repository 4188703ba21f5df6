//! Time and peak memory of surfaces made to be slow or large: fans, faces of many corners, triangles
//! over each other, files of holes, millions of triangles.
//!
//! ```text
//! cargo bench --locked --bench surface_limits [-- PART OF A NAME]
//! ```
//!
//! `FLUXFORM_OTHER=path` measures another binary. Processor time is that of all threads. Without
//! Linux's `/proc` it and the peak are 0.

// A measurement: it writes its own files, reads the clock and prints.
#![allow(clippy::print_stdout, clippy::disallowed_methods)]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use fluxform_testing::run::program_or_other;

/// Pause between two looks at a process.
const LOOK: Duration = Duration::from_millis(3);
/// A run that takes longer is killed.
const PATIENCE: Duration = Duration::from_secs(600);
/// Ticks a second of `/proc`'s processor times.
const TICKS: f64 = 100.0;

type Triangle = [[f64; 3]; 3];

/// Squares a side of the body of 2.3 million triangles.
const SIDE: usize = 1072;

struct Case {
    name: &'static str,
    file: &'static str,
    make: fn(&Path),
    more: &'static [&'static str],
}

const CERTIFY: &[&str] = &["--unit", "mm", "--translate", "0,0,60"];
const INSPECT: &[&str] = &["--inspect"];

const CASES: [Case; 12] = [
    Case {
        name: "cone's fan of 5,000, certificate",
        file: "cone.stl",
        make: |path| stl(path, &cone(5_000)),
        more: CERTIFY,
    },
    Case {
        name: "cone's fan of 20,000, certificate",
        file: "cone.stl",
        make: |path| stl(path, &cone(20_000)),
        more: CERTIFY,
    },
    Case {
        name: "a face of 49,999 corners, certificate",
        file: "face.obj",
        make: |path| comb(path, 49_999),
        more: CERTIFY,
    },
    Case {
        name: "20,000 triangles over each other, inspected",
        file: "heap.stl",
        make: |path| stl(path, &heap(20_000)),
        more: INSPECT,
    },
    Case {
        name: "20,000 triangles over each other, certificate",
        file: "heap.stl",
        make: |path| stl(path, &heap(20_000)),
        more: CERTIFY,
    },
    Case {
        name: "the same, certificate of 1 s",
        file: "heap.stl",
        make: |path| stl(path, &heap(20_000)),
        more: &[
            "--unit",
            "mm",
            "--translate",
            "0,0,60",
            "--certify-seconds",
            "1",
        ],
    },
    Case {
        name: "2 GB of holes, STL",
        file: "hole.stl",
        make: |path| hole(path, b""),
        more: INSPECT,
    },
    Case {
        name: "2 GB of holes, OBJ",
        file: "hole.obj",
        make: |path| hole(path, b"v 0 0 0\n"),
        more: INSPECT,
    },
    Case {
        name: "2 GB of holes, PLY",
        file: "hole.ply",
        make: |path| hole(path, b"ply\nformat binary_little_endian 1.0\n"),
        more: INSPECT,
    },
    Case {
        name: "2 GB of holes, 3MF",
        file: "hole.3mf",
        make: |path| hole(path, b"PK\x03\x04"),
        more: INSPECT,
    },
    Case {
        name: "2.3 million triangles, no certificate",
        file: "waves.stl",
        make: |path| stl(path, &waves(SIDE)),
        more: &["--unit", "mm", "--translate", "0,0,60", "--certify", "no"],
    },
    Case {
        name: "2.3 million triangles, certificate",
        file: "waves.stl",
        make: |path| stl(path, &waves(SIDE)),
        more: CERTIFY,
    },
];

fn main() {
    let binary = program_or_other();
    let only = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    println!("| input | exit code | s | CPU s | peak MB |\n|---|---|---|---|---|");
    for case in CASES {
        if only.as_ref().is_some_and(|part| !case.name.contains(part)) {
            continue;
        }
        let folder = tempfile::tempdir().unwrap();
        (case.make)(&folder.path().join(case.file));
        let mut command = Command::new(&binary);
        command
            .args(["discretize", case.file, "--quiet"])
            .args(case.more);
        command.current_dir(folder.path());
        let began = Instant::now();
        let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let (code, cpu_s, peak_kb) = follow(child.unwrap(), began);
        println!(
            "| {} | {} | {:.2} | {cpu_s:.1} | {:.0} |",
            case.name,
            code.map_or("killed".into(), |code| code.to_string()),
            began.elapsed().as_secs_f64(),
            peak_kb / 1024.0
        );
    }
}

/// Exit code, processor time in s and peak memory in KiB of a process.
fn follow(mut child: Child, began: Instant) -> (Option<i32>, f64, f64) {
    let about = |file: &str| fs::read_to_string(format!("/proc/{}/{file}", child.id()));
    let (status_of, id) = (about, child.id());
    let (mut cpu_s, mut peak_kb) = (0.0_f64, 0.0_f64);
    let look = |cpu_s: &mut f64, peak_kb: &mut f64| {
        let status = status_of("status").unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
        *peak_kb = peak_kb.max(kb.unwrap_or(0.0));
        let stat = status_of("stat").unwrap_or_default();
        let after = stat.rsplit_once(')').map_or("", |(_, after)| after);
        let times = after.split_whitespace().skip(11).take(2);
        let ticks: f64 = times.filter_map(|text| text.parse::<f64>().ok()).sum();
        *cpu_s = cpu_s.max(ticks / TICKS);
    };
    loop {
        look(&mut cpu_s, &mut peak_kb);
        sleep(LOOK);
        // What has ended still answers until it is waited for.
        let state = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        let ended = state
            .rsplit_once(')')
            .is_none_or(|(_, rest)| rest.starts_with(" Z"));
        if ended {
            look(&mut cpu_s, &mut peak_kb);
            break;
        }
        if began.elapsed() > PATIENCE {
            break;
        }
    }
    if began.elapsed() > PATIENCE {
        child.kill().unwrap();
    }
    (child.wait().unwrap().code(), cpu_s, peak_kb)
}

fn stl(path: &Path, triangles: &[Triangle]) {
    let mut file = BufWriter::new(File::create(path).unwrap());
    file.write_all(&[b' '; 80]).unwrap();
    let count = u32::try_from(triangles.len()).unwrap();
    file.write_all(&count.to_le_bytes()).unwrap();
    for triangle in triangles {
        file.write_all(&[0; 12]).unwrap();
        for coordinate in triangle.as_flattened() {
            file.write_all(&(*coordinate as f32).to_le_bytes()).unwrap();
        }
        file.write_all(&[0; 2]).unwrap();
    }
    file.flush().unwrap();
}

fn cone(facets: usize) -> Vec<Triangle> {
    let rim = |k: usize| {
        let angle = TAU * (k % facets) as f64 / facets as f64;
        [41.0 * angle.cos(), 41.0 * angle.sin(), 0.7]
    };
    (0..facets)
        .map(|k| [rim(k), rim(k + 1), [0.3, -0.2, 31.0]])
        .collect()
}

/// Large triangles of nearly the same place.
fn heap(triangles: usize) -> Vec<Triangle> {
    // The plastic number's recurrence spreads them evenly.
    let shift = |k: usize, i: usize| {
        let step = [0.754_877_666, 0.569_840_291, 0.430_159_709][i % 3];
        2.0 * (step * (k + 7 * i) as f64).fract() - 1.0
    };
    let corners = [[-20.0, -20.0, 0.0], [20.0, -20.0, 0.0], [0.0, 20.0, 0.0]];
    let corner = |k: usize, c: usize| [0, 1, 2].map(|i| corners[c][i] + shift(k, 3 * c + i));
    (0..triangles)
        .map(|k| [0, 1, 2].map(|c| corner(k, c)))
        .collect()
}

fn waves(side: usize) -> Vec<Triangle> {
    let at = |i: usize, j: usize| {
        let [x, y] = [i, j].map(|k| 100.0 * k as f64 / side as f64 - 50.0);
        [x, y, 10.0 * (x / 9.0).sin() * (y / 7.0).cos()]
    };
    let squares = (0..side * side).map(|k| (k / side, k % side));
    squares
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// One face whose border runs up and down all along.
fn comb(path: &Path, corners: usize) {
    let mut text = String::new();
    let width = 80.0 / corners as f64;
    for k in 0..corners - 2 {
        let y = if k % 2 == 0 { 20.0 } else { -15.0 };
        writeln!(text, "v {} {y} 10", k as f64 * width - 40.0).unwrap();
    }
    text += "v 41 -21 10\nv -41 -21 10\nf";
    for k in 1..=corners {
        write!(text, " {k}").unwrap();
    }
    fs::write(path, text + "\n").unwrap();
}

/// A file of 2 GB that holds a beginning and nothing more, and takes no disk.
fn hole(path: &Path, begin: &[u8]) {
    let mut file = File::create(path).unwrap();
    file.write_all(begin).unwrap();
    file.set_len(2 << 30).unwrap();
}
