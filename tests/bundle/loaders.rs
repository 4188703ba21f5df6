//! The loaders in Rust, Python and C on the same bundle: forces, heights and currents.

use std::ffi::OsString;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use fluxform::bundle::load::Bundle;
use fluxform::bundle::npz::MapArrays;
use fluxform::bundle::replay::Answer;
use fluxform::commands::replay::renderer::{Renderer, Step};

use fluxform_testing::bundle::*;
use fluxform_testing::loaders::{c_loader, cpp_loader};
use fluxform_testing::needs::{self, SANITIZERS, Trial};
use fluxform_testing::run::Ran;
use fluxform_testing::{Random, root, trials};
use tempfile::TempDir;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            the_forces_of_the_library_are_those_of_the_field,
            extreme_limits_are_met_by_the_library,
        ],
        needs::numpy() => [
            python_gives_the_forces_of_the_library,
            python_says_what_it_cannot_answer,
            extreme_limits_give_the_same_currents_in_python,
        ],
        needs::c_compiler() => [
            c_gives_the_forces_of_the_library,
            regression_c_ended_in_silence_at_a_line_that_is_no_position,
            extreme_limits_give_the_same_currents_in_c,
        ],
        needs::cpp_compiler() => [
            cpp_gives_the_forces_of_the_library,
            regression_cpp_ended_in_silence_at_nan_and_what_is_no_position,
        ],
        needs::sanitizers() => [the_c_loader_survives_damaged_files],
    }
}

/// Positions in and slightly around the map; nodes, borders and corners among them.
fn positions(map: &MapArrays) -> Vec<[f64; 3]> {
    let mut random = Random::new(7);
    let axes = [&map.x_m, &map.y_m, &map.z_m];
    (0..500)
        .map(|i| {
            axes.map(|axis| {
                let (from, to) = (axis[0], axis[axis.len() - 1]);
                let t = random.unit();
                match (i % 10, axis.len()) {
                    (_, 1) => from,
                    (0, n) => axis[(t * n as f64) as usize],
                    (1, _) => {
                        if t < 0.5 {
                            from
                        } else {
                            to
                        }
                    }
                    (2, _) => from + (to - from) * (1.2 * t - 0.1),
                    // At an end but for the last bits.
                    (3, _) => {
                        (if t < 0.5 { from } else { to }) + 1e-12 * (to - from) * (40.0 * t).sin()
                    }
                    _ => from + (to - from) * t,
                }
            })
        })
        .collect()
}

fn numbers(line: &str) -> Vec<f64> {
    line.split_whitespace()
        .map(|word| word.parse().unwrap())
        .collect()
}

/// Runs a program on a text.
fn given(command: &mut Command, text: String) -> Ran {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap().unwrap();
    Ran::of(output)
}

/// Runs a program on the positions as lines of text and parses the forces it prints.
fn forces_from(mut command: Command, at: &[[f64; 3]]) -> Vec<Vec<f64>> {
    let lines = at.iter().map(|p| format!("{} {} {}\n", p[0], p[1], p[2]));
    let ran = given(&mut command, lines.collect());
    assert_eq!(ran.code, Some(0), "{command:?} failed: {}", ran.err);
    ran.out.lines().map(numbers).collect()
}

const PYTHON_READS_STDIN: &str = "\
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
from load_bundle import Bundle
points = np.loadtxt(sys.stdin, ndmin=2)
bundle = Bundle(sys.argv[2])
found = zip(points, bundle.force_per_ampere(points), bundle.passive_force(points), bundle.height(points), *bundle.currents(points))
for point, row, pull, height, currents, force, answer in found:
    code = 'ok saturated outside'.split().index(answer)
    height = 0 if np.isnan(height) or code == 2 else height
    vector = 'requested_direction' in bundle.map
    line = [*row, pull, height, code, force[2] if vector else force, *currents]
    if vector:
        expected = (code != 2) * bundle.requested_force([point])[0]
        line += [*expected, *force[:2], *bundle.force_vectors_per_ampere([point])[0].ravel()]
    if 'robust_setting' in bundle.map:
        chosen, given, _ = bundle.currents([point], robust=True)
        line += [*(given[0] if vector else [0, 0, given[0]]), *chosen[0]]
    print(*map(repr, map(float, line)))
";

/// Where in a line forces per ampere and pull, height, answer, force, and currents begin.
const PARTS: [usize; 6] = [0, COILS + 1, COILS + 2, COILS + 3, COILS + 4, 2 * COILS + 4];
/// The same of a force vector: requested, sideways given, and the vectors per ampere.
const VECTOR_PARTS: [usize; 4] = [2 * COILS + 4, 2 * COILS + 7, 2 * COILS + 9, 5 * COILS + 9];
/// At the end of a line: the force given and the currents chosen for uncertainties.
const ROBUST: usize = COILS + 3;
const COILS: usize = 4;
const FORCE: usize = 3;
const SIDEWAYS_FORCE: usize = 6;

fn compare(loader: &str, found: &[Vec<f64>], want: &[Vec<f64>]) {
    assert_eq!(found.len(), want.len(), "{loader}");
    let mut worst = [0.0f64; 10];
    for (found, want) in found.iter().zip(want) {
        assert_eq!(found.len(), want.len(), "{loader}");
        let uncertain = [2 * COILS + 4, 5 * COILS + 9].map(|plain| plain + ROBUST);
        if uncertain.contains(&want.len()) {
            let [a, b] = [found, want].map(|line| line.split_at(line.len() - ROBUST).1);
            let most = |of: &[f64]| of.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let sum: f64 = b[3..].iter().map(|current| current.abs()).sum();
            // A force is a sum of terms of both signs.
            let force = most(&want[..COILS]) * sum + want[COILS].abs();
            for (part, range, scale) in [(8, 0..3, force), (9, 3..ROBUST, most(&b[3..]))] {
                for (f, w) in a[range.clone()].iter().zip(&b[range]) {
                    let apart = (f - w).abs() / scale.max(f64::MIN_POSITIVE);
                    assert!(apart <= 1e-12, "{loader}, part {part}: {f} and {w}");
                    worst[part] = worst[part].max(apart);
                }
            }
        }
        let plain = want.len()
            - if uncertain.contains(&want.len()) {
                ROBUST
            } else {
                0
            };
        let (found, want) = (&found[..plain], &want[..plain]);
        let vector = VECTOR_PARTS.windows(2).filter(|ends| ends[1] <= want.len());
        for (part, ends) in PARTS.windows(2).chain(vector).enumerate() {
            // A force that cancels the pull is compared with the pull.
            let least = match part {
                FORCE => want[COILS].abs(),
                // Currents that cancel the sideways force leave rounding of their terms.
                SIDEWAYS_FORCE => sideways_terms(want),
                _ => 0.0,
            };
            let (found, want) = (&found[ends[0]..ends[1]], &want[ends[0]..ends[1]]);
            let scale = want.iter().fold(least, |m, v| m.max(v.abs()));
            for (f, w) in found.iter().zip(want) {
                let apart = (f - w).abs();
                assert!(apart <= 1e-12 * scale, "{loader}, part {part}: {f} and {w}");
                if scale > 0.0 {
                    worst[part] = worst[part].max(apart / scale);
                }
            }
        }
    }
    eprintln!(
        "{loader}: largest differences of forces per ampere, heights, answers, forces, currents, the same of \
         vectors, and force and currents chosen for uncertainties, relative to the largest at the point: {}",
        worst.map(|w| format!("{w:.1e}")).join(" ")
    );
}

/// The sizes of the terms that a line's sideways force is a sum of.
fn sideways_terms(line: &[f64]) -> f64 {
    let currents = &line[COILS + 4..2 * COILS + 4];
    let vectors = line[VECTOR_PARTS[2]..].chunks_exact(3);
    let terms = vectors.zip(currents);
    terms.map(|(g, i)| g[0].hypot(g[1]) * i.abs()).sum()
}

/// Another reader of bundles.
struct Loader {
    language: &'static str,
    /// The program and the arguments before the file that it reads.
    program: PathBuf,
    arguments: Vec<OsString>,
    /// What it reads of a bundle; without one, the folder.
    file: Option<&'static str>,
    _folder: TempDir,
}

impl Loader {
    fn python() -> Self {
        let scripts = root().join("src/python/fluxform").into_os_string();
        Self {
            language: "Python",
            program: "python3".into(),
            arguments: vec!["-Bc".into(), PYTHON_READS_STDIN.into(), scripts],
            file: None,
            _folder: tempfile::tempdir().unwrap(),
        }
    }

    fn compiled(language: &'static str, build: impl Fn(&Path) -> PathBuf) -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self {
            language,
            program: build(folder.path()),
            arguments: Vec::new(),
            file: Some("map.npz"),
            _folder: folder,
        }
    }

    fn c() -> Self {
        Self::compiled("C", |folder| c_loader(folder, &[]))
    }

    fn cpp() -> Self {
        Self::compiled("C++", cpp_loader)
    }

    fn agrees(&self, name: &str, bundle: &Path, at: &[[f64; 3]], want: &[Vec<f64>]) {
        let mut command = Command::new(&self.program);
        command.args(&self.arguments);
        command.arg(match self.file {
            Some(file) => bundle.join(file),
            None => bundle.to_owned(),
        });
        let found = forces_from(command, at);
        compare(&format!("{name}, {}", self.language), &found, want);
    }
}

/// The answers of the library, and of another loader where there is one.
fn forces_on_samples(other: Option<&Loader>) {
    for name in SAMPLES {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("bundle");
        Sample::named(name).write(&target, false).unwrap();
        let bundle = Bundle::open(&target).unwrap();
        let at = positions(&bundle.map);
        let mut renderer = Renderer::new(&bundle).unwrap();
        let mut robust = Renderer::robust(&bundle).ok();
        assert_eq!(robust.is_some(), name.contains("uncertain"));
        let mut answers = [0; 3];
        let answered = |position: &[f64; 3]| {
            let (mut line, answer) = answered(&bundle, &mut renderer, *position);
            answers[answer] += 1;
            if let Some(robust) = &mut robust {
                line.extend(chosen(&bundle, robust, *position));
            }
            line
        };
        let want: Vec<Vec<f64>> = at.iter().map(answered).collect();
        eprintln!("{name}: {answers:?} positions ok, saturated, outside");
        let short = name.contains("short axes");
        assert!(
            short || answers.iter().all(|n| *n > 10),
            "{name}: {answers:?}"
        );
        // The interpolation itself: against the analytic field.
        if !short {
            let pulled = name.contains("pull");
            for (p, line) in at.iter().zip(&want).filter(|(_, line)| line[0] != 0.0) {
                let g = gradient([-0.05, -0.05], *p);
                let m = bundle.map.runtime.moment_a_m2;
                let exact = m[0] * g[2] + m[1] * g[5] + m[2] * g[8];
                assert!((line[0] - exact).abs() < 2e-2, "{line:?} {exact}");
                assert_eq!(line[2], 0.0);
                let pull = if pulled { pull_n(*p) } else { 0.0 };
                let found = line[COILS];
                assert!((found - pull).abs() <= 1e-2 * pull.abs(), "{found} {pull}");
            }
        }
        if let Some(loader) = other {
            loader.agrees(name, &target, &at, &want);
        }
    }
}

fn the_forces_of_the_library_are_those_of_the_field() {
    forces_on_samples(None);
}

fn python_gives_the_forces_of_the_library() {
    forces_on_samples(Some(&Loader::python()));
}

/// It ended with a fault of Python's or numpy's own words.
fn python_says_what_it_cannot_answer() {
    const SCRIPT: &str = "\
import sys
sys.path.insert(0, sys.argv[1])
from load_bundle import Bundle, BundleError, _beside
try:
    _beside('elsewhere')
except BundleError as error:
    print(error)
bundle = Bundle(sys.argv[2])
for wrong in ([0, 0], [], [[0, 0, 0.03, 1]]):
    try:
        bundle.currents(wrong)
    except ValueError as error:
        print(error)
bundle.lambda_n_per_m = None
for ask in (bundle.currents, bundle.requested_force):
    try:
        ask([0, 0, 0.03])
    except BundleError as error:
        print(error)
";
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    sample(false, [3; 3]).write(&target, false).unwrap();
    let mut python = Command::new("python3");
    python.args(["-B", "-c", SCRIPT]);
    python.arg(root().join("src/python/fluxform")).arg(&target);
    let ran = Ran::of(python.output().unwrap()).ends(0);
    let said = |what: &str| ran.out.matches(what).count();
    assert_eq!(
        said("expected x, y, z in m or rows of them"),
        3,
        "{}",
        ran.out
    );
    assert_eq!(said("the bundle has no force constant"), 2, "{}", ran.out);
    // Of a file that was copied without those beside it.
    let beside = "this bundle needs elsewhere.py beside load_bundle.py";
    assert_eq!(said(beside), 1, "{}", ran.out);
}

fn c_gives_the_forces_of_the_library() {
    forces_on_samples(Some(&Loader::c()));
}

fn cpp_gives_the_forces_of_the_library() {
    forces_on_samples(Some(&Loader::cpp()));
}

/// Every line is answered, `nan` too, up to one that is no position, which is named.
fn lines_that_are_no_position(loader: &Loader, modes: &[&[&str]]) {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    sample(false, [4, 4, 4]).write(&target, false).unwrap();
    for bad in [
        "0 0",
        "0 0 0.05 0",
        "0,0,0.05",
        "0 0 high",
        "0.1.2 0.05",
        "0 0 0.05\0",
        "\0",
    ] {
        let text = format!("0 0 0.05\n \r\nnan -0.01\t5e-2\r\n inf 0 0.05\n{bad}\n0 0 0.05\n");
        for mode in modes {
            let mut command = Command::new(&loader.program);
            command.arg(target.join("map.npz")).args(*mode);
            let ran = given(&mut command, text.clone());
            assert_eq!(ran.code, Some(3), "{bad:?} {mode:?}");
            assert!(ran.err.starts_with("line 5: "), "{bad:?}: {}", ran.err);
            if mode.is_empty() {
                let lines: Vec<Vec<f64>> = ran.out.lines().map(numbers).collect();
                let answers: Vec<f64> = lines.iter().map(|line| line[COILS + 2]).collect();
                assert_eq!(answers, [0.0, 2.0, 2.0], "{bad:?}");
            }
        }
    }
    // The last line needs no line feed.
    let mut command = Command::new(&loader.program);
    let ran = given(command.arg(target.join("map.npz")), "\n0 0 0.05".to_owned());
    assert_eq!((ran.code, ran.out.lines().count()), (Some(0), 1));
}

fn regression_c_ended_in_silence_at_a_line_that_is_no_position() {
    lines_that_are_no_position(&Loader::c(), &[&[], &["1"]]);
}

fn regression_cpp_ended_in_silence_at_nan_and_what_is_no_position() {
    lines_that_are_no_position(&Loader::cpp(), &[&[]]);
}

/// Broke: with a lower limit of -1e30 A the C loader answered 8 A where the sum may be 5 A.
fn currents_at_extreme_limits(other: Option<&Loader>) {
    let folder = tempfile::tempdir().unwrap();
    for (number, (lower, upper, total)) in [
        ([-1e30; 4], [8.0; 4], Some(5.0)),
        ([-1e30, 0.0, 0.0, -1e30], [8.0, 2.0, 1.3, 1e30], Some(5.0)),
        ([-1e30; 4], [1e30; 4], Some(0.0)),
        ([-1e30; 4], [1e30; 4], None),
        ([0.0; 4], [1e30, 0.7, 1e30, 0.7], Some(1e30)),
        ([0.0; 4], [0.0; 4], Some(0.0)),
        ([-0.7, -0.7, 0.0, -0.7], [0.7; 4], Some(0.0)),
        ([-1e-9, -1e30, 0.0, 0.0], [1e-9, 2.0, 2.0, 1e9], Some(1e-9)),
    ]
    .into_iter()
    .enumerate()
    {
        let mut sample = sample(false, [13, 17, 11]).with_pull();
        let (runtime, limits) = (&mut sample.map.runtime, &mut sample.manifest.limits);
        (limits.current_min_a, limits.current_max_a) = (lower.to_vec(), upper.to_vec());
        limits.total_current_max_a = total;
        (runtime.current_min_a, runtime.current_max_a) = (lower.to_vec(), upper.to_vec());
        runtime.total_current_max_a = total;
        let target = folder.path().join(format!("bundle{number}"));
        sample.write(&target, false).unwrap();
        let bundle = Bundle::open(&target).unwrap();
        let mut at = positions(&bundle.map);
        at.truncate(200);
        let mut renderer = Renderer::new(&bundle).unwrap();
        let want: Vec<Vec<f64>> = at
            .iter()
            .map(|p| answered(&bundle, &mut renderer, *p).0)
            .collect();
        for row in &want {
            let currents = &row[COILS + 4..];
            let (sum, size) = currents
                .iter()
                .fold((0.0, 0.0), |(s, z), i| (s + i, z + i.abs()));
            let most = total.unwrap_or(f64::INFINITY);
            assert!(
                sum <= most + 1e-12 * (size + most),
                "{number}: {currents:?}"
            );
        }
        if let Some(loader) = other {
            loader.agrees(&format!("limits {number}"), &target, &at, &want);
        }
    }
}

fn extreme_limits_are_met_by_the_library() {
    currents_at_extreme_limits(None);
}

fn extreme_limits_give_the_same_currents_in_python() {
    currents_at_extreme_limits(Some(&Loader::python()));
}

fn extreme_limits_give_the_same_currents_in_c() {
    currents_at_extreme_limits(Some(&Loader::c()));
}

/// The requested vector, the sideways force given and the vectors per ampere, as the library has them.
fn vector_of(bundle: &Bundle, step: &Step, position: [f64; 3]) -> Vec<f64> {
    let Some(sideways) = step.sideways else {
        return Vec::new();
    };
    let mut vectors = vec![[f64::NAN; 3]; COILS];
    bundle.force_vector_per_ampere(position, &mut vectors);
    let [wanted_x, wanted_y] = sideways.wanted_n;
    let mut all = vec![wanted_x, wanted_y, step.wanted_n];
    all.extend(sideways.force_n);
    all.extend(vectors.as_flattened());
    all
}

/// The library's values at a position, in the order of the other loaders' lines, and the number of its answer.
fn answered(bundle: &Bundle, renderer: &mut Renderer, position: [f64; 3]) -> (Vec<f64>, usize) {
    let mut line = vec![f64::NAN; bundle.coil_count()];
    let inside = bundle.force_per_ampere(position, &mut line);
    let pull = bundle.passive_force_n(position);
    assert_eq!(pull.is_some(), inside);
    line.push(pull.unwrap_or(0.0));
    let mut currents = vec![f64::NAN; COILS];
    let step = renderer.step(position, &mut currents);
    let answer = match step.answer {
        Answer::Ok => 0,
        Answer::Saturated => 1,
        Answer::Outside => 2,
    };
    assert_eq!(answer == 2, !inside);
    let met = if renderer.is_vector() { 1e-11 } else { 1e-12 };
    assert!(renderer.certificate(&step, &currents) <= met);
    line.extend([step.height_m, answer as f64, step.force_n]);
    line.extend(currents);
    line.extend(vector_of(bundle, &step, position));
    (line, answer)
}

/// The force given and the currents that are chosen for uncertainties.
fn chosen(bundle: &Bundle, robust: &mut Renderer, position: [f64; 3]) -> Vec<f64> {
    let mut currents = vec![f64::NAN; COILS];
    let step = robust.step(position, &mut currents);
    let sum: f64 = currents.iter().sum();
    let most = bundle.map.runtime.total_current_max_a.unwrap();
    assert!(sum <= most * (1.0 + 1e-11), "{sum} A");
    let [x, y] = step.sideways.map_or([0.0; 2], |sideways| sideways.force_n);
    let mut line = vec![x, y, step.force_n];
    line.extend(currents);
    line
}

fn the_c_loader_survives_damaged_files() {
    let folder = tempfile::tempdir().unwrap();
    let program = c_loader(folder.path(), &["-g", SANITIZERS[0], SANITIZERS[1]]);
    let target = folder.path().join("bundle");
    sample(true, [3, 2, 2])
        .with_pull()
        .write(&target, false)
        .unwrap();
    let bytes = fs::read(target.join("map.npz")).unwrap();
    let mut random = Random::new(3);
    let damaged = folder.path().join("damaged.npz");
    let directory = bytes.len() - 1900; // names, offsets and sizes of the central directory
    for round in 0..150 {
        let mut edited = bytes.clone();
        match round % 3 {
            0 => edited.truncate((random.unit() * bytes.len() as f64) as usize),
            1 => edited[(random.unit() * bytes.len() as f64) as usize] ^= 1 << (round % 8),
            _ => {
                let at = directory + (random.unit() * 1890.0) as usize;
                edited[at..at + 4].fill((random.unit() * 256.0) as u8);
            }
        }
        fs::write(&damaged, &edited).unwrap();
        let output = Command::new(&program)
            .arg(&damaged)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            matches!(output.status.code(), Some(0 | 3)),
            "round {round}: {words}"
        );
        assert!(
            !words.contains("Sanitizer") && !words.contains("runtime error"),
            "{words}"
        );
    }
}
