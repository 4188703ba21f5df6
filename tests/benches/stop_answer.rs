//! How long every command takes to answer SIGTERM, whenever it comes: a table of the longest answer
//! and the peak memory until then, and how often the guard had to end the process because no poll did.
//! `FLUXFORM_OTHER=path` measures another binary; an argument, the stages that contain it.
#![allow(clippy::print_stdout)] // the table
#![allow(clippy::disallowed_methods)] // own files, and wall time

use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use fluxform_testing::run::program_or_other;
use fluxform_testing::surface_files;

/// When the signals are sent, s.
const AFTER_S: [f64; 12] = [
    0.1, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0, 8.0, 13.0, 20.0, 30.0, 45.0,
];
/// An answer that takes longer is not waited for, s.
const MOST_S: f64 = 10.0;

const CASES: &[(&str, &[&str])] = &[
    ("steel, 9 cores of 1 m", &["evaluate", "long.toml"]),
    ("steel, 20 x 20 cores", &["evaluate", "many.toml"]),
    (
        "steel, saturated array",
        &["evaluate", "designs/seed_1010.toml"],
    ),
    (
        "steel and map, 1 m",
        &["map", "long.toml", "--out", "m", "--force"],
    ),
    (
        "probe, 20 x 20 cores",
        &["probe", "many.toml", "points.csv"],
    ),
    (
        "map, 120^3 nodes, all",
        &[
            "map",
            "fine.toml",
            "--components",
            "all",
            "--out",
            "n",
            "--force",
        ],
    ),
    (
        "points, 6e6",
        &[
            "discretize",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--grid",
            "2500x2500",
            "--out",
            "p.csv",
            "--force",
        ],
    ),
    (
        "points, graded",
        &[
            "discretize",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--max-deviation",
            "0.0005",
            "--out",
            "q.csv",
            "--force",
        ],
    ),
    (
        "forces and path, 6e6 points",
        &[
            "lambda",
            "designs/seed.toml",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--translate",
            "0,0,30",
            "--grid",
            "2500x2500",
        ],
    ),
    (
        "worst-point path, 64 coils",
        &["lambda", "air.toml", "shapes/flat.toml"],
    ),
    (
        "path and worst point, 225 coils",
        &["lambda", "air225.toml", "wide.toml"],
    ),
    (
        "steel, points and map, 225 cores",
        &[
            "calibrate",
            "cores225.toml",
            "wide.toml",
            "--out",
            "x",
            "--no-cache",
            "--force",
        ],
    ),
    ("steel, cores on a plate", &["evaluate", "plate.toml"]),
    (
        "map, cores on a plate",
        &["map", "plate.toml", "--out", "y", "--force"],
    ),
    (
        "calibrate to an error",
        &[
            "calibrate",
            "designs/seed.toml",
            "shapes/half_sphere.toml",
            "--error",
            "0.1%",
            "--out",
            "z",
            "--no-cache",
            "--force",
        ],
    ),
    (
        "optimize an array",
        &[
            "optimize",
            "designs/seed_search.toml",
            "--for",
            "shapes/flat.toml",
        ],
    ),
    (
        "calibrate, cored",
        &[
            "calibrate",
            "designs/seed.toml",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--translate",
            "0,0,30",
            "--grid",
            "1000x1000",
            "--out",
            "r",
            "--no-cache",
            "--force",
        ],
    ),
    (
        "compare",
        &[
            "compare",
            "many.toml",
            "shapes/flat.toml",
            "shapes/wedge.toml",
        ],
    ),
    ("optimize, cored", &["optimize", "designs/seed.toml"]),
    (
        "optimize, cored, wound",
        &["optimize", "designs/seed.toml", "--wound"],
    ),
    (
        "sweep run, optimised",
        &["sweep", "run", "plan.json", "--out", "s"],
    ),
    (
        "sweep merge",
        &[
            "sweep",
            "merge",
            "large.json",
            "t",
            "--partial",
            "--out",
            "t.csv",
            "--force",
        ],
    ),
    (
        "discretize, STEP",
        &[
            "discretize",
            "boxes.step",
            "--grid",
            "500x500",
            "--out",
            "u.csv",
            "--force",
        ],
    ),
    (
        "discretize, certificate",
        &[
            "discretize",
            "shapes/half_sphere.stl",
            "--unit",
            "mm",
            "--grid",
            "801x801",
            "--certify",
            "distance",
            "--out",
            "c.csv",
            "--force",
        ],
    ),
    (
        "bench",
        &[
            "bench",
            "designs/seed.toml",
            "shapes/wedge.toml",
            "--out",
            "b",
            "--force",
        ],
    ),
    ("verify", &["verify", "bundle/seed/wedge"]),
    (
        "replay, 1e6 positions",
        &[
            "replay",
            "bundle/seed/wedge",
            "walk.csv",
            "--out",
            "w.csv",
            "--force",
        ],
    ),
    (
        "waiting for another run",
        &["map", "designs/seed_air.toml", "--out", LOCKED, "--force"],
    ),
];

/// A folder whose lock is held all the time.
const LOCKED: &str = "locked";
/// A plane as wide as 15 coils in a row.
const WIDE: &str = "name = \"wide\"\nprimitive = \"flat\"\nside_mm = 700.0\nheight_mm = 50.0\n\
                    [points]\nx_mm = [-350.0, 350.0, 61]\ny_mm = [-350.0, 350.0, 61]\n";
/// A plate under the cores of the seed.
const PLATE: &str = "[plate]\nthickness_mm = 3.0\nx_mm = 160.0\ny_mm = 160.0\ngap_mm = 0.5\n";
/// Bodies of the STEP file.
const BODIES: usize = 600;

fn main() {
    let binary = program_or_other().display().to_string();
    let only = std::env::args().skip(1).find(|arg| !arg.starts_with("--"));
    let folder = tempfile::tempdir().unwrap();
    prepare(&binary, folder.path());
    fs::create_dir(folder.path().join(LOCKED)).unwrap();
    let lock = fs::File::open(folder.path().join(LOCKED)).unwrap();
    lock.lock().unwrap();
    println!("| stage | signals | longest answer, ms | by the guard | peak MB | exit codes |");
    println!("|---|---|---|---|---|---|");
    for (stage, args) in CASES {
        if only
            .as_ref()
            .is_some_and(|part| !stage.contains(part.as_str()))
        {
            continue;
        }
        let (mut sent, mut guarded, mut longest_s, mut peak_kb) = (0, 0, 0.0_f64, 0);
        let mut codes = BTreeSet::new();
        for after_s in AFTER_S {
            let mut child = run(&binary, folder.path(), args);
            sleep(Duration::from_secs_f64(after_s));
            if child.try_wait().unwrap().is_some() {
                break;
            }
            peak_kb = peak_kb.max(peak(&child));
            let (answer_s, code) = answer(&mut child);
            let mut said = String::new();
            let _ = child.stderr.take().unwrap().read_to_string(&mut said);
            sent += 1;
            guarded += usize::from(said.contains("did not stop by itself"));
            longest_s = longest_s.max(answer_s);
            codes.insert(code.map_or("killed".to_owned(), |code| code.to_string()));
        }
        let (ms, mb) = (1e3 * longest_s, peak_kb as f64 / 1024.0);
        let codes: Vec<String> = codes.into_iter().collect();
        let codes = codes.join(", ");
        println!("| {stage} | {sent} | {ms:.0} | {guarded} | {mb:.0} | {codes} |");
    }
    drop(lock);
}

fn run(binary: &str, folder: &Path, args: &[&str]) -> Child {
    let mut command = Command::new(binary);
    // As JSON, nothing is written to standard error before the end: the pipe cannot fill.
    command.args(args).args(["--format", "json"]);
    command
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Seconds until the process has ended after SIGTERM, and its exit code; `None`: it had to be killed.
fn answer(child: &mut Child) -> (f64, Option<i32>) {
    let sent = Instant::now();
    let pid = child.id().to_string();
    Command::new("kill").args(["-TERM", &pid]).status().unwrap();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return (sent.elapsed().as_secs_f64(), status.code());
        }
        if sent.elapsed().as_secs_f64() > MOST_S {
            child.kill().unwrap();
            child.wait().unwrap();
            return (sent.elapsed().as_secs_f64(), None);
        }
        sleep(Duration::from_millis(2));
    }
}

/// Peak resident memory, KiB; 0 where the system does not say.
fn peak(child: &Child) -> u64 {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok())
        .unwrap_or(0)
}

/// The sample of a box in STEP many times in a row, as the bodies of one part.
fn boxes() -> String {
    let text = String::from_utf8(surface_files::step()).unwrap();
    let (head, rest) = text.split_once("DATA;\n").unwrap();
    let (data, tail) = rest.split_once("ENDSEC;").unwrap();
    let lines: Vec<&str> = data.lines().collect();
    let (last, of_one) = lines.split_last().unwrap();
    let mut all = String::new();
    let mut solids = Vec::new();
    for body in 0..BODIES {
        for line in of_one {
            let mut parts = line.split('#');
            let mut moved = parts.next().unwrap().to_owned();
            for part in parts {
                let digits = part.chars().take_while(char::is_ascii_digit).count();
                let number: usize = part[..digits].parse().unwrap();
                moved += &format!("#{}{}", number + body * lines.len(), &part[digits..]);
            }
            if let Some((start, coordinates)) = moved.split_once("CARTESIAN_POINT('',(") {
                let (x, others) = coordinates.split_once(',').unwrap();
                let x = x.parse::<f64>().unwrap() + body as f64;
                moved = format!("{start}CARTESIAN_POINT('',({x:.3},{others}");
            }
            if moved.contains("MANIFOLD_SOLID_BREP") {
                solids.push(moved.split('=').next().unwrap().to_owned());
            }
            all += &format!("{moved}\n");
        }
    }
    let (start, others) = last.split_once("(#").unwrap();
    let (_, context) = others.split_once(')').unwrap();
    // After the numbers of all bodies; the context is that of the first one.
    let start = start.split_once('=').unwrap().1;
    let number = BODIES * lines.len() + 1;
    let solids = solids.join(",");
    format!("{head}DATA;\n{all}#{number}={start}({solids}){context}\nENDSEC;{tail}")
}

fn prepare(binary: &str, folder: &Path) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for name in ["designs", "shapes"] {
        std::os::unix::fs::symlink(root.join(name), folder.join(name)).unwrap();
    }
    let seed = fs::read_to_string(root.join("designs/seed.toml")).unwrap();
    let air = fs::read_to_string(root.join("designs/seed_air.toml")).unwrap();
    let array = |text: &str, count: usize| {
        text.replace("rows = 3", &format!("rows = {count}"))
            .replace("columns = 3", &format!("columns = {count}"))
            .replace("total_current_max_a = 18.0", "")
    };
    let fine = air.replace(", 61]", ", 120]").replace(", 29]", ", 120]");
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write(
        "long.toml",
        &seed.replace("\nlength_mm = 100.0", "\nlength_mm = 1000.0"),
    );
    write("many.toml", &array(&seed, 20));
    write("air.toml", &array(&air, 8));
    write("fine.toml", &fine);
    write("air225.toml", &array(&air, 15));
    write("cores225.toml", &array(&seed, 15));
    write("wide.toml", WIDE);
    write("plate.toml", &format!("{seed}\n{PLATE}"));
    write("points.csv", "x_m,y_m,z_m\n0.001,0.002,0.03\n");
    let mut walk = String::from("t_s,x_m,y_m,z_m\n");
    for k in 0..1_000_000 {
        let x = f64::from(k % 900) * 1e-4 - 0.045;
        walk += &format!("{},{x},0.001,0.05\n", f64::from(k) * 1e-3);
    }
    write("walk.csv", &walk);
    write("boxes.step", &boxes());
    for args in [
        &[
            "calibrate",
            "designs/seed.toml",
            "shapes/wedge.toml",
            "--out",
            "bundle",
            "--no-report",
        ][..],
        &[
            "sweep",
            "plan",
            "designs/seed.toml",
            "--optimize",
            "--set",
            "target.height_mm=20:40:0.5",
            "--out",
            "plan.json",
        ],
        &[
            "sweep",
            "plan",
            "designs/seed_air.toml",
            "--set",
            "wire.diameter_mm=0.5:0.999:0.001",
            "--set",
            "target.height_mm=20:39.99:0.01",
            "--out",
            "large.json",
        ],
        &[
            "sweep",
            "run",
            "large.json",
            "--shard",
            "1/500",
            "--out",
            "t",
        ],
    ] {
        assert!(
            run(binary, folder, args).wait().unwrap().success(),
            "{args:?}"
        );
    }
}
