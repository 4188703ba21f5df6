//! Bundles on disk: three loaders give the same forces, a bundle is whole or absent, and damaged
//! or hostile bundles are refused with words that help.
#![allow(clippy::disallowed_methods, clippy::print_stderr)]

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use fluxform::accuracy::StageAccuracy;
use fluxform::bundle::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION, UNITS, sha256_hex};
use fluxform::bundle::atomic::{Overwrite, WriteError, write};
use fluxform::bundle::lambda_file::{AtLambda, LambdaFile, PathStep};
use fluxform::bundle::load::{Bundle, BundleError};
use fluxform::bundle::manifest::*;
use fluxform::bundle::npz::{MapArrays, Runtime};
use fluxform::bundle::schema::SCHEMAS;
use fluxform::bundle::table::{CurrentRow, PointRow};
use fluxform::bundle::write::{BundleContent, MapFormats, write_bundle, write_map_files};
use fluxform::numerics::axis::Axis;
use serde_json::{Value, json};

/// A small bundle of an analytic field: a magnetic charge below each coil.
struct Sample {
    manifest: Manifest,
    map: MapArrays<'static>,
    points: Vec<PointRow>,
    currents: Vec<CurrentRow>,
    lambda: LambdaFile,
}

const CHARGE_DEPTH_M: f64 = 0.037;

/// dB_i/dx_j of coil charges q = 1e-4 T m^2 at (x0, y0, -depth).
fn gradient(coil_m: [f64; 2], at: [f64; 3]) -> [f64; 9] {
    let d = [at[0] - coil_m[0], at[1] - coil_m[1], at[2] + CHARGE_DEPTH_M];
    let r2 = d.iter().map(|v| v * v).sum::<f64>();
    let mut g = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            let delta = if i == j { r2 } else { 0.0 };
            g[3 * i + j] = 1e-4 * (delta - 3.0 * d[i] * d[j]) / r2.powf(2.5);
        }
    }
    g
}

fn sample(tilted: bool, samples: [usize; 3]) -> Sample {
    let axis = |from, to, samples| Axis { from, to, samples };
    let x = axis(-0.05, 0.05, samples[0]);
    let y = axis(-0.043, 0.051, samples[1]);
    let z = axis(0.01, if samples[2] > 1 { 0.08 } else { 0.01 }, samples[2]);
    let positions_m = vec![[-0.05, -0.05], [0.05, -0.05], [-0.05, 0.05], [0.05, 0.05]];
    let coil = vec![0i64, 1, 3]; // coil 2 carries no current and is left out
    let moment_a_m2 = if tilted {
        [0.13, -0.07, -0.89]
    } else {
        [0.0, 0.0, -0.90941]
    };
    let (mut gz, mut all) = (Vec::new(), Vec::new());
    for &c in &coil {
        for z in z.nodes() {
            for y in y.nodes() {
                for x in x.nodes() {
                    let g = gradient(positions_m[c as usize], [x, y, z]);
                    gz.push(g[8]);
                    all.extend(g);
                }
            }
        }
    }
    let (current_min_a, current_max_a) = (vec![0.0, -0.7, 0.0, 0.0], vec![2.0, 2.0, 1.3, 2.0]);
    let resistance_ohm = vec![6.07, 6.08, 6.09, 6.11];
    let currents_a = vec![1.3, -0.7, 0.0, 0.9];
    let map = MapArrays {
        x_m: x.nodes().into(),
        y_m: y.nodes().into(),
        z_m: z.nodes().into(),
        coil: coil.clone().into(),
        gz_t_per_m_per_a: gz.into(),
        gradient_t_per_m_per_a: tilted.then(|| all.into()),
        field_t_per_a: None,
        runtime: Runtime {
            moment_a_m2,
            current_min_a: current_min_a.clone(),
            current_max_a: current_max_a.clone(),
            resistance_ohm: resistance_ohm.clone(),
            total_current_max_a: Some(5.3),
            lambda_n_per_m: Some(5.9878),
        },
    };
    let grid = axis(-0.04, 0.04, 5);
    let present: Vec<bool> = (0..25).map(|n| n != 0 && n != 24).collect();
    let points: Vec<PointRow> = (0..25)
        .filter(|&n| present[n])
        .map(|n| PointRow {
            x_m: grid.node(n % 5),
            y_m: grid.node(n / 5),
            height_m: 0.03 + 0.001 * n as f64,
            normal: [0.0, 0.6, 0.8],
        })
        .collect();
    let accuracy = BTreeMap::from([(
        "map".to_owned(),
        StageAccuracy {
            estimate: 1e-9,
            relative_to: "largest |grad B| at that height".to_owned(),
            method: "a-priori bound".to_owned(),
        },
    )]);
    let inputs = vec![
        Input::of_bytes("designs/a.toml", b"design"),
        Input::of_bytes("shapes/b.toml", b"shape"),
    ];
    let currents = (0..4)
        .map(|coil| CurrentRow {
            coil,
            x_m: positions_m[coil][0],
            y_m: positions_m[coil][1],
            current_a: currents_a[coil],
        })
        .collect();
    let lambda = LambdaFile {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: "a".to_owned(),
        shape: "b".to_owned(),
        inputs: inputs.clone(),
        lambda_linear_n_per_m: Some(4.9429),
        lambda_jnd_n_per_m: Some(6.007),
        lambda_saturation_n_per_m: Some(5.9878),
        lambda_floor_n_per_m: None,
        lambda_n_per_m: Some(5.9878),
        criterion: "saturation".to_owned(),
        jnd: 0.07,
        currents_a: Some(currents_a),
        rms_error_n: Some(0.0071),
        worst_error_n: Some(0.031),
        relative_rms_error: Some(0.0175),
        duality_gap_n2: Some(1.3e-19),
        rank: 3,
        points: points.len(),
        path: vec![PathStep {
            lambda_n_per_m: 4.9429,
            currents_a: vec![2.0, 0.7, 0.0, 1.3],
            event: "coil 0 meets its upper limit".to_owned(),
        }],
        at: Some(AtLambda {
            lambda_n_per_m: 2.1,
            currents_a: vec![0.7; 4],
            rms_error_n: 0.0013,
            worst_error_n: 0.0017,
        }),
        accuracy: accuracy.clone(),
    };
    let manifest = Manifest {
        schema_version: SCHEMA_VERSION.to_owned(),
        fluxform_version: FLUXFORM_VERSION.to_owned(),
        design: "a".to_owned(),
        shape: "b".to_owned(),
        inputs,
        units: UNITS.to_owned(),
        array: ArrayGeometry {
            positions_m,
            coupling: "none".to_owned(),
            gain: vec![1.0; 4],
        },
        limits: CurrentLimits {
            current_min_a,
            current_max_a,
            total_current_max_a: Some(5.3),
        },
        resistance_ohm,
        magnet: MagnetSummary {
            moment_a_m2,
            model: "dipole".to_owned(),
            polarity: "repel".to_owned(),
            diameter_m: 0.01,
            length_m: 0.01,
        },
        lambda: LambdaSummary {
            lambda_n_per_m: Some(5.9878),
            criterion: "saturation".to_owned(),
        },
        points: PointsGrid::new(grid, grid, &present),
        map: MapSummary {
            x_m: x.into(),
            y_m: y.into(),
            z_m: z.into(),
            coil,
            components: "gz".to_owned(),
            interpolation: Interpolation::tricubic(
                1.3e-6,
                "relative to the largest |g| at that height, sampled",
            ),
        },
        left_out: vec![LeftOut {
            what: "coil 2".to_owned(),
            why: "carries no current".to_owned(),
            error_cost: 0.0,
        }],
        accuracy,
        files: Vec::new(),
    };
    Sample {
        manifest,
        map,
        points,
        currents,
        lambda,
    }
}

impl Sample {
    fn write(&self, target: &Path, force: bool) -> Result<Manifest, WriteError> {
        let content = BundleContent {
            manifest: self.manifest.clone(),
            map: &self.map,
            points: &self.points,
            currents: &self.currents,
            lambda: &self.lambda,
        };
        write_bundle(target, force, &content, &json!({ "total_s": 0.013 }))
    }
}

fn temporary() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn random(seed: &mut u64) -> f64 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

/// Positions in and slightly around the map; nodes, borders and corners among them.
fn positions(map: &MapArrays) -> Vec<[f64; 3]> {
    let mut seed = 7;
    let axes = [&map.x_m, &map.y_m, &map.z_m];
    (0..1000)
        .map(|i| {
            axes.map(|axis| {
                let (from, to) = (axis[0], axis[axis.len() - 1]);
                let t = random(&mut seed);
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

/// Runs a program on the positions as lines of text and parses the forces it prints; `None` when
/// the program is not there.
fn forces_from(mut command: Command, at: &[[f64; 3]]) -> Option<Vec<Vec<f64>>> {
    let mut child = command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    let text: String = at
        .iter()
        .map(|p| format!("{} {} {}\n", p[0], p[1], p[2]))
        .collect();
    let mut stdin = child.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || stdin.write_all(text.as_bytes()));
    let output = child.wait_with_output().unwrap();
    feeder.join().unwrap().unwrap();
    assert!(output.status.success(), "{command:?} failed");
    let text = String::from_utf8(output.stdout).unwrap();
    Some(text.lines().map(numbers).collect())
}

const PYTHON_READS_STDIN: &str = "\
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
from load_bundle import Bundle
points = np.loadtxt(sys.stdin, ndmin=2)
for row in Bundle(sys.argv[2]).force_per_ampere(points):
    print(*map(repr, map(float, row)))
";

fn scripts() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts")
}

fn has_numpy() -> bool {
    let probe = Command::new("python3")
        .args(["-c", "import numpy"])
        .stderr(Stdio::null())
        .status();
    probe.is_ok_and(|status| status.success())
}

/// The C loader as a program; `None` without a C compiler.
fn c_loader(folder: &Path, flags: &[&str]) -> Option<PathBuf> {
    let program = folder.join("forces");
    let built = Command::new("cc")
        .args([
            "-std=c99",
            "-Wall",
            "-Wextra",
            "-Wpedantic",
            "-Werror",
            "-O2",
        ])
        .args(flags)
        .arg("-DFLUXFORM_BUNDLE_MAIN")
        .arg(scripts().join("fluxform_bundle.c"))
        .arg("-o")
        .arg(&program)
        .arg("-lm")
        .status()
        .ok()?;
    assert!(built.success(), "the C loader does not compile");
    Some(program)
}

fn compare(loader: &str, found: &[Vec<f64>], want: &[Vec<f64>]) {
    assert_eq!(found.len(), want.len(), "{loader}");
    let mut worst = 0.0f64;
    for (found, want) in found.iter().zip(want) {
        assert_eq!(found.len(), want.len(), "{loader}");
        let scale = want.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for (f, w) in found.iter().zip(want) {
            assert!((f - w).abs() <= 1e-12 * scale, "{loader}: {f} and {w}");
            if scale > 0.0 {
                worst = worst.max((f - w).abs() / scale);
            }
        }
    }
    eprintln!("{loader}: largest difference {worst:.1e} of the largest force at the point");
}

#[test]
fn rust_python_and_c_give_the_same_forces() {
    for (name, tilted, samples) in [
        ("upright", false, [13, 17, 11]),
        ("tilted", true, [13, 9, 11]),
        ("short axes", false, [2, 3, 1]),
    ] {
        let folder = temporary();
        let target = folder.path().join("bundle");
        let sample = sample(tilted, samples);
        sample.write(&target, false).unwrap();
        let bundle = Bundle::open(&target).unwrap();
        let at = positions(&bundle.map);
        let mut outside = 0;
        let want: Vec<Vec<f64>> = at
            .iter()
            .map(|&p| {
                let mut force = vec![f64::NAN; bundle.coil_count()];
                outside += usize::from(!bundle.force_per_ampere(p, &mut force));
                force
            })
            .collect();
        assert!((20..120).contains(&outside), "{outside} outside");
        // The interpolation itself: against the analytic field.
        if samples[2] > 4 {
            for (p, force) in at.iter().zip(&want).filter(|(_, force)| force[0] != 0.0) {
                let g = gradient([-0.05, -0.05], *p);
                let m = bundle.map.runtime.moment_a_m2;
                let exact = m[0] * g[2] + m[1] * g[5] + m[2] * g[8];
                assert!((force[0] - exact).abs() < 2e-2, "{force:?} {exact}");
                assert_eq!(force[2], 0.0);
            }
        }
        if has_numpy() {
            let mut python = Command::new("python3");
            python
                .args(["-c", PYTHON_READS_STDIN])
                .arg(scripts())
                .arg(&target);
            compare(
                &format!("{name}, Python"),
                &forces_from(python, &at).unwrap(),
                &want,
            );
        } else {
            eprintln!("skipped: no python3 with numpy");
        }
        match c_loader(folder.path(), &[]) {
            Some(program) => {
                let mut c = Command::new(program);
                c.arg(target.join("map.npz"));
                compare(&format!("{name}, C"), &forces_from(c, &at).unwrap(), &want);
            }
            None => eprintln!("skipped: no C compiler"),
        }
    }
}

#[test]
fn the_c_loader_survives_damaged_files() {
    let folder = temporary();
    let Some(program) = c_loader(
        folder.path(),
        &[
            "-g",
            "-fsanitize=address,undefined",
            "-fno-sanitize-recover=all",
        ],
    ) else {
        eprintln!("skipped: no C compiler");
        return;
    };
    let target = folder.path().join("bundle");
    sample(true, [3, 2, 2]).write(&target, false).unwrap();
    let bytes = fs::read(target.join("map.npz")).unwrap();
    let mut seed = 3;
    let damaged = folder.path().join("damaged.npz");
    let directory = bytes.len() - 1400; // names, offsets and sizes of the central directory
    for round in 0..150 {
        let mut edited = bytes.clone();
        match round % 3 {
            0 => edited.truncate((random(&mut seed) * bytes.len() as f64) as usize),
            1 => edited[(random(&mut seed) * bytes.len() as f64) as usize] ^= 1 << (round % 8),
            _ => {
                let at = directory + (random(&mut seed) * 1390.0) as usize;
                edited[at..at + 4].fill((random(&mut seed) * 256.0) as u8);
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

#[test]
fn what_is_written_is_read_back_and_written_again_to_the_same_bytes() {
    let folder = temporary();
    let (first, second) = (
        folder.path().join("x/first"),
        folder.path().join("y/second"),
    );
    let sample = sample(true, [5, 4, 6]);
    let manifest = sample.write(&first, false).unwrap();
    let bundle = Bundle::open(&first).unwrap();
    assert_eq!(
        bundle,
        Bundle {
            folder: first.clone(),
            ..Bundle::open(&first.join("manifest.json")).unwrap()
        }
    );
    assert_eq!(bundle.manifest, manifest);
    assert_eq!(bundle.map, sample.map);
    assert_eq!(bundle.points, sample.points);
    assert_eq!(bundle.currents, sample.currents);
    assert_eq!(bundle.lambda, sample.lambda);
    sample.write(&second, false).unwrap();
    for name in [
        "manifest.json",
        "map.npz",
        "points.csv",
        "currents.csv",
        "lambda.json",
    ] {
        assert_eq!(
            fs::read(first.join(name)).unwrap(),
            fs::read(second.join(name)).unwrap(),
            "{name}"
        );
    }
    assert!(first.join("timing.json").exists());
    assert!(
        !fs::read_to_string(first.join("manifest.json"))
            .unwrap()
            .contains("timing")
    );
}

#[test]
fn written_json_fits_the_committed_schemas() {
    let folder = temporary();
    let target = folder.path().join("bundle");
    let sample = sample(false, [4, 4, 4]);
    let manifest = sample.write(&target, false).unwrap();
    let sidecar = sidecar(&manifest);
    write_map_files(
        folder.path(),
        false,
        &sidecar,
        &sample.map,
        MapFormats::default(),
    )
    .unwrap();
    let files = [
        target.join("manifest.json"),
        folder.path().join("map.json"),
        target.join("lambda.json"),
    ];
    for ((name, schema), path) in SCHEMAS.iter().zip(files) {
        let schema: Value = serde_json::from_str(schema).unwrap();
        let validator = jsonschema::validator_for(&schema).unwrap();
        let mut written: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
        let faults: Vec<String> = validator
            .iter_errors(&written)
            .map(|e| e.to_string())
            .collect();
        assert!(faults.is_empty(), "{name}: {faults:?}");
        written.as_object_mut().unwrap().remove("accuracy");
        assert!(
            !validator.is_valid(&written),
            "{name} does not require accuracy"
        );
    }
}

fn sidecar(manifest: &Manifest) -> MapSidecar {
    MapSidecar {
        schema_version: manifest.schema_version.clone(),
        fluxform_version: manifest.fluxform_version.clone(),
        design: manifest.design.clone(),
        inputs: manifest.inputs.clone(),
        units: manifest.units.clone(),
        array: manifest.array.clone(),
        magnet: manifest.magnet.clone(),
        map: manifest.map.clone(),
        accuracy: manifest.accuracy.clone(),
        files: Vec::new(),
    }
}

#[test]
fn a_bundle_is_replaced_only_when_it_is_ours_and_the_users_files_stay() {
    let folder = temporary();
    let target = folder.path().join("seed/flat");
    let mut sample = sample(false, [4, 4, 4]);
    sample.write(&target, false).unwrap();
    fs::create_dir(target.join("notes")).unwrap();
    fs::write(target.join("notes/mine.txt"), "felt good").unwrap();
    fs::write(target.join("scan.csv"), "x_m\n").unwrap();
    sample.manifest.lambda.criterion = "linear".to_owned();
    sample.write(&target, false).unwrap();
    assert_eq!(
        Bundle::open(&target).unwrap().manifest.lambda.criterion,
        "linear"
    );
    assert_eq!(
        fs::read_to_string(target.join("notes/mine.txt")).unwrap(),
        "felt good"
    );
    assert!(target.join("scan.csv").exists());

    sample.manifest.inputs[0].sha256 = sha256_hex(b"another design");
    let error = sample.write(&target, false).unwrap_err();
    assert!(matches!(error, WriteError::OutputExists { .. }), "{error}");
    assert!(
        error.to_string().contains("was made from other inputs")
            && error.to_string().contains("--force")
    );
    assert_eq!(
        Bundle::open(&target).unwrap().manifest.inputs[0].sha256,
        sha256_hex(b"design")
    );
    sample.write(&target, true).unwrap();
    assert_eq!(
        Bundle::open(&target).unwrap().manifest.inputs[0].sha256,
        sha256_hex(b"another design")
    );
    assert!(target.join("scan.csv").exists());

    // A folder that is no bundle; an empty one; a file.
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    sample.write(&other, false).unwrap();
    fs::remove_file(other.join("manifest.json")).unwrap();
    let error = sample.write(&other, false).unwrap_err();
    assert!(matches!(error, WriteError::OutputExists { .. }), "{error}");
    let file = folder.path().join("file");
    fs::write(&file, "x").unwrap();
    for target in [file.clone(), file.join("below")] {
        let error = sample.write(&target, true).unwrap_err();
        assert!(matches!(error, WriteError::NotFolder { .. }), "{error}");
    }
    assert_no_leftovers(folder.path());
}

fn assert_no_leftovers(folder: &Path) {
    for entry in fs::read_dir(folder).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(!name.contains("fluxform"), "{name} is left");
    }
}

#[test]
fn an_interrupted_swap_is_finished_or_undone_by_the_next_run() {
    let folder = temporary();
    let target = folder.path().join("flat");
    let old = folder.path().join(".flat.fluxform-old");
    let sample = sample(false, [4, 4, 4]);
    // Killed between the two renames: the old bundle stands under its other name.
    sample.write(&target, false).unwrap();
    fs::write(target.join("mine.txt"), "x").unwrap();
    fs::rename(&target, &old).unwrap();
    fs::create_dir(folder.path().join(".fluxform-AbC123.tmp")).unwrap();
    fs::write(folder.path().join(".fluxform-AbC123.tmp/map.npz"), "half").unwrap();
    sample.write(&target, false).unwrap();
    Bundle::open(&target).unwrap();
    assert!(target.join("mine.txt").exists());
    assert_no_leftovers(folder.path());
    // Killed while the old folder was being removed.
    fs::create_dir(&old).unwrap();
    fs::copy(target.join("manifest.json"), old.join("manifest.json")).unwrap();
    fs::write(old.join("points.csv"), "old").unwrap();
    fs::write(old.join("yours.txt"), "y").unwrap();
    sample.write(&target, false).unwrap();
    Bundle::open(&target).unwrap();
    assert!(target.join("mine.txt").exists() && target.join("yours.txt").exists());
    assert_no_leftovers(folder.path());
}

#[test]
fn contradictions_and_bad_numbers_are_not_written() {
    let folder = temporary();
    let target = folder.path().join("flat");
    let refuse = |edit: fn(&mut Sample), words: &str| {
        let mut sample = sample(false, [4, 4, 4]);
        edit(&mut sample);
        let error = sample.write(&target, false).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert!(!target.exists());
        assert_no_leftovers(folder.path());
    };
    refuse(
        |s| s.map.gz_t_per_m_per_a.to_mut()[3] = f64::NAN,
        "gz_t_per_m_per_a holds a number that is not finite",
    );
    refuse(
        |s| s.lambda.worst_error_n = Some(f64::INFINITY),
        "worst_error_n is not a finite number",
    );
    refuse(
        |s| s.points[3].normal[1] = f64::NAN,
        "a number is not finite",
    );
    refuse(|s| s.points[3].x_m += 1e-6, "row 3 of points.csv");
    refuse(
        |s| s.currents[1].current_a = 0.1,
        "currents.csv and lambda.json agree",
    );
    refuse(|s| s.manifest.magnet.moment_a_m2[2] = 0.9, "moment_a_m2");
    refuse(
        |s| {
            s.manifest.magnet.moment_a_m2[0] = 0.1;
            s.map.runtime.moment_a_m2[0] = 0.1;
        },
        "tilted magnet needs gradient",
    );
}

/// A bundle's manifest, edited.
fn edit_manifest(target: &Path, edit: impl FnOnce(&mut Value)) {
    let path = target.join("manifest.json");
    let mut manifest: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    edit(&mut manifest);
    fs::write(&path, manifest.to_string()).unwrap();
}

#[test]
fn hostile_and_damaged_bundles_are_refused() {
    let refuse = |edit: &dyn Fn(&Path), words: &str| {
        let folder = temporary();
        let target = folder.path().join("flat");
        fs::write(folder.path().join("secret"), "0123").unwrap();
        sample(false, [4, 4, 4]).write(&target, false).unwrap();
        edit(&target);
        let error = Bundle::open(&target).unwrap_err().to_string();
        assert!(error.contains(words), "expected {words:?}, got {error:?}");
        if has_numpy() {
            let mut python = Command::new("python3");
            let output = python
                .arg(scripts().join("load_bundle.py"))
                .arg(&target)
                .output()
                .unwrap();
            let words = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(3), "Python: {words}");
            assert!(!words.contains("Traceback"), "{words}");
        }
    };
    let list = |name: &'static str| {
        move |target: &Path| {
            edit_manifest(target, |manifest| {
                let entry = json!({ "path": name, "bytes": 4, "sha256": sha256_hex(b"0123") });
                manifest["files"].as_array_mut().unwrap().push(entry);
            });
        }
    };
    refuse(
        &list("../secret"),
        "not the name of a file inside the bundle",
    );
    refuse(
        &list("/etc/hostname"),
        "not the name of a file inside the bundle",
    );
    refuse(
        &|target| {
            #[cfg(unix)]
            std::os::unix::fs::symlink("../secret", target.join("link")).unwrap();
            list("link")(target);
        },
        "leads out of the bundle",
    );
    refuse(
        &|target| {
            fs::create_dir(target.join("plots")).unwrap();
            list("plots")(target);
        },
        "is not a plain file",
    );
    refuse(&list("absent.svg"), "it is missing");
    refuse(
        &|target| {
            let mut bytes = fs::read(target.join("map.npz")).unwrap();
            let middle = bytes.len() / 2;
            bytes[middle] ^= 1;
            fs::write(target.join("map.npz"), bytes).unwrap();
        },
        "its SHA-256 is",
    );
    refuse(
        &|target| {
            let bytes = fs::read(target.join("points.csv")).unwrap();
            fs::write(target.join("points.csv"), &bytes[..bytes.len() - 9]).unwrap();
        },
        "bytes, the manifest says",
    );
    refuse(
        &|target| fs::remove_file(target.join("lambda.json")).unwrap(),
        "it is missing",
    );
    refuse(
        &|target| fs::remove_file(target.join("manifest.json")).unwrap(),
        "is not a bundle",
    );
    refuse(
        &|target| {
            edit_manifest(target, |m| {
                *m = json!({ "schema_version": "2.0.0", "maps": [] })
            })
        },
        "2.0.0 is newer than this program",
    );
    refuse(
        &|target| edit_manifest(target, |m| m["schema_version"] = json!(7)),
        "invalid type",
    );
    refuse(
        &|target| edit_manifest(target, |m| m["files"] = json!([])),
        "does not list map.npz",
    );
    refuse(
        &|target| {
            edit_manifest(target, |m| {
                m["map"]["interpolation"]["name"] = json!("nearest")
            })
        },
        "the interpolation is known",
    );
    refuse(
        &|target| fs::write(target.join("manifest.json"), "{").unwrap(),
        "manifest.json",
    );
}

#[test]
fn another_minor_version_is_read() {
    let folder = temporary();
    let target = folder.path().join("flat");
    sample(false, [4, 4, 4]).write(&target, false).unwrap();
    edit_manifest(&target, |manifest| {
        manifest["schema_version"] = json!("1.9.3");
        manifest["a_key_of_the_future"] = json!({ "x": 1 });
    });
    Bundle::open(&target).unwrap();
    let error = Bundle::open(&folder.path().join("nowhere")).unwrap_err();
    assert!(matches!(error, BundleError::NoBundle { .. }));
}

#[test]
fn single_files_are_whole_or_absent() {
    let folder = temporary();
    let path = folder.path().join("new/points.csv");
    let inputs = [Input::of_bytes("a.stl", b"solid")];
    let ours =
        |inputs: &[Input]| Overwrite::new(false, folder.path().join("new/points.json"), inputs);
    let put =
        |text: &'static str| move |out: &mut dyn std::io::Write| out.write_all(text.as_bytes());
    let written = write(&path, &ours(&inputs), put("x_m\n")).unwrap();
    assert_eq!((written.bytes, written.sha256), (4, sha256_hex(b"x_m\n")));
    // No sidecar: not ours. With one: ours. Of other inputs: not ours.
    let error = write(&path, &ours(&inputs), put("y"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("points.json tells what it was made from"),
        "{error}"
    );
    let sidecar =
        json!({ "inputs": [{ "path": "other/name.stl", "sha256": sha256_hex(b"solid") }] });
    fs::write(folder.path().join("new/points.json"), sidecar.to_string()).unwrap();
    write(&path, &ours(&inputs), put("y_m\n")).unwrap();
    let other = [Input::of_bytes("a.stl", b"other")];
    assert!(matches!(
        write(&path, &ours(&other), put("z")),
        Err(WriteError::OutputExists { .. })
    ));
    assert_eq!(fs::read_to_string(&path).unwrap(), "y_m\n");
    write(&path, &Overwrite::Force, put("z_m\n")).unwrap();
    assert_eq!(fs::read_to_string(&path).unwrap(), "z_m\n");
    // Content that fails half way.
    let error = write(&path, &Overwrite::Force, |out| {
        out.write_all(&[b'x'; 5 << 20])?;
        Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
    });
    assert!(matches!(error, Err(WriteError::DiskFull { .. })));
    assert_eq!(fs::read_to_string(&path).unwrap(), "z_m\n");
    assert!(matches!(
        write(folder.path(), &Overwrite::Force, put("x")),
        Err(WriteError::IsFolder { .. })
    ));
    let below_file = path.join("map.npz");
    assert!(matches!(
        write(&below_file, &Overwrite::Force, put("x")),
        Err(WriteError::NotFolder { .. })
    ));
    assert_no_leftovers(&folder.path().join("new"));
    assert_eq!(fs::read_dir(folder.path().join("new")).unwrap().count(), 2);
}

#[cfg(unix)]
#[test]
fn full_disks_and_read_only_folders_are_told() {
    use std::os::unix::fs::PermissionsExt;
    let put = |out: &mut dyn std::io::Write| out.write_all(&[b'x'; 3 << 20]);
    if Path::new("/dev/full").exists() {
        let error = write(Path::new("/dev/full"), &Overwrite::Force, put).unwrap_err();
        assert!(matches!(error, WriteError::DiskFull { .. }), "{error}");
        assert!(error.to_string().contains("the disk is full"));
        write(Path::new("/dev/null"), &Overwrite::Force, put).unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }
    let folder = temporary();
    let shut = folder.path().join("shut");
    fs::create_dir(&shut).unwrap();
    fs::set_permissions(&shut, fs::Permissions::from_mode(0o555)).unwrap();
    if fs::write(shut.join("probe"), "").is_ok() {
        eprintln!("skipped: this user may write into read-only folders");
        return;
    }
    let error = write(&shut.join("map.npz"), &Overwrite::Force, put).unwrap_err();
    assert!(matches!(error, WriteError::ReadOnly { .. }), "{error}");
    let error = sample(false, [4, 4, 4])
        .write(&shut.join("flat"), false)
        .unwrap_err();
    assert!(matches!(error, WriteError::ReadOnly { .. }), "{error}");
}

/// The child of the test below: writes the same bundle again and again until it is killed.
#[test]
#[ignore = "run by the kill test"]
fn child_that_writes_until_killed() {
    let Some(target) = std::env::var_os("FLUXFORM_KILL_TARGET") else {
        return;
    };
    let sample = sample(false, [9, 9, 9]);
    loop {
        sample.write(Path::new(&target), false).unwrap();
    }
}

#[test]
fn after_a_kill_at_any_moment_the_bundle_is_whole_or_absent() {
    let folder = temporary();
    let target = folder.path().join("flat");
    let mut seed = 11;
    let mut present = 0;
    for round in 0..30 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--ignored", "--exact", "child_that_writes_until_killed"])
            .env("FLUXFORM_KILL_TARGET", &target)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(
            4 + (random(&mut seed) * 26.0) as u64,
        ));
        child.kill().unwrap();
        child.wait().unwrap();
        if target.exists() {
            present += 1;
            Bundle::open(&target).unwrap_or_else(|error| panic!("round {round}: {error}"));
        }
    }
    eprintln!(
        "30 kills: the bundle was whole {present} times, absent {} times",
        30 - present
    );
    sample(false, [9, 9, 9]).write(&target, false).unwrap();
    Bundle::open(&target).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "leftovers");
}

#[test]
fn two_runs_on_one_folder_leave_one_whole_bundle() {
    let folder = temporary();
    let target = folder.path().join("flat");
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..10 {
                    sample(false, [5, 5, 5]).write(&target, false).unwrap();
                }
            });
        }
    });
    Bundle::open(&target).unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "leftovers");
}

#[test]
fn all_formats_of_a_map() {
    let folder = temporary();
    let mut sample = sample(true, [4, 3, 2]);
    let nodes = sample.map.gz_t_per_m_per_a.len();
    sample.map.field_t_per_a = Some((0..3 * nodes).map(|i| (i as f64 * 0.7).sin()).collect());
    let formats = MapFormats {
        csv: true,
        vtk: true,
    };
    let sidecar = sidecar(&sample.manifest);
    let written = write_map_files(folder.path(), false, &sidecar, &sample.map, formats).unwrap();
    for file in &written.files {
        let bytes = fs::read(folder.path().join(&file.path)).unwrap();
        assert_eq!(
            (bytes.len() as u64, sha256_hex(&bytes)),
            (file.bytes, file.sha256.clone())
        );
    }
    assert_eq!(written.files.len(), 3);
    let csv = fs::read_to_string(folder.path().join("map.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + nodes);
    // The appended arrays start where the XML says and hold the map's bytes.
    let vti = fs::read(folder.path().join("map.vti")).unwrap();
    let marker = b"<AppendedData encoding=\"raw\">\n_";
    let start = vti.windows(marker.len()).position(|w| w == marker).unwrap() + marker.len();
    let head = String::from_utf8(vti[..start].to_vec()).unwrap();
    assert!(head.contains("WholeExtent=\"0 3 0 2 0 1\""), "{head}");
    let name =
        "Name=\"field_t_per_a_coil_3\" NumberOfComponents=\"3\" format=\"appended\" offset=\"";
    let offset: usize = head
        .split(name)
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let at = start + offset;
    let size = u64::from_le_bytes(vti[at..at + 8].try_into().unwrap()) as usize;
    assert_eq!(size, nodes / 3 * 3 * 8);
    let first = f64::from_le_bytes(vti[at + 8..at + 16].try_into().unwrap());
    assert_eq!(
        first,
        sample.map.field_t_per_a.as_ref().unwrap()[nodes / 3 * 2 * 3]
    );
    // Same inputs: replaced. Others: refused, and nothing touched.
    write_map_files(
        folder.path(),
        false,
        &sidecar,
        &sample.map,
        MapFormats::default(),
    )
    .unwrap();
    let mut other = sidecar.clone();
    other.inputs.pop();
    let error = write_map_files(
        folder.path(),
        false,
        &other,
        &sample.map,
        MapFormats::default(),
    );
    assert!(matches!(error, Err(WriteError::OutputExists { .. })));
    assert_no_leftovers(folder.path());
}

/// Times of the stages that a map of nine coils goes through; `cargo test --release --test bundle
/// -- --ignored --nocapture figures`.
#[test]
#[ignore = "prints times"]
fn figures() {
    use fluxform::bundle::npz::{from_npz, to_npz};
    use fluxform::bundle::table::write_map;
    use std::time::Instant;
    let mut sample = sample(false, [61, 61, 29]);
    let nodes = 61 * 61 * 29;
    sample.map.coil = (0..9).collect::<Vec<i64>>().into();
    let runtime = &mut sample.map.runtime;
    runtime.current_max_a = vec![2.0; 9];
    runtime.current_min_a = vec![0.0; 9];
    runtime.resistance_ohm = vec![6.07; 9];
    sample.map.gz_t_per_m_per_a = (0..9 * nodes)
        .map(|i| (i as f64 * 0.7).sin() * 0.013)
        .collect();
    let folder = temporary();
    let time = |what: &str, work: &mut dyn FnMut()| {
        let times: Vec<f64> = (0..7)
            .map(|_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        eprintln!(
            "{what}: {:.2} ms (best of 7)",
            times.iter().fold(f64::MAX, |a, &b| a.min(b))
        );
    };
    let bytes = to_npz(&sample.map).unwrap();
    time("npz to memory", &mut || {
        assert_eq!(to_npz(&sample.map).unwrap().len(), bytes.len())
    });
    time("npz from memory", &mut || {
        assert_eq!(from_npz(&bytes).unwrap().coil.len(), 9)
    });
    time("sha256", &mut || assert_eq!(sha256_hex(&bytes).len(), 64));
    let path = folder.path().join("map.npz");
    time("npz to disk, with digest and fsync", &mut || {
        write(&path, &Overwrite::Force, |out| {
            out.write_all(&to_npz(&sample.map).unwrap())
        })
        .unwrap();
    });
    time("map as CSV to memory, 971,181 rows", &mut || {
        let mut text = Vec::new();
        write_map(&mut text, &sample.map).unwrap();
        assert!(text.len() > 30_000_000);
    });
}
