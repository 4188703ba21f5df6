//! The files for mag_manip: read back by hand, and by mag_manip itself.
//!
//! The latter needs a Python with the package mag-manip (`scripts/peers/requirements_magmanip.txt`): what
//! `FLUXFORM_MAGMANIP_PYTHON` names, or `python3.11` or `python3`. Without one that test is reported as ignored.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fluxform::map::multipole::{PARTS, Source, magnitudes};
use fluxform_testing::needs::Trial;
use fluxform_testing::run::program;
use fluxform_testing::{needs, root, trials};
use serde_json::Value;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            nodes_hold_what_probe_says_x_slowest,
            sources_of_air_coils_stand_on_their_own_axes,
            sources_of_coupled_cores_stand_on_all_axes,
            an_unmet_tolerance_ends_with_four_and_the_files,
            the_same_bytes_on_any_number_of_threads_and_over_our_own_files,
            wrong_usage_and_unsuitable_workspaces_are_reported,
        ],
        missing() => [mag_manip_reads_what_is_stated],
    }
}

fn fluxform(arguments: &[&str]) -> Output {
    Command::new(program())
        .arg("--quiet")
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap()
}

/// A design with a small workspace that is no cube and off the centre.
fn coarse(design: &str, folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(root().join("designs").join(design)).unwrap();
    let text: Vec<String> = text
        .lines()
        .map(
            |line| match line.split_once('=').map(|(key, _)| key.trim()) {
                Some("x_mm") => "x_mm = [-40.0, 50.0, 9]".to_owned(),
                Some("y_mm") => "y_mm = [-50.0, 30.0, 11]".to_owned(),
                Some("z_mm") => "z_mm = [20.0, 60.0, 7]".to_owned(),
                Some("pitch_mm") => {
                    "pitch_mm = 50.0\ngain = [1.0, 0.9, 1.0, 1.0, 1.1, 1.0, 1.0, 1.0, 1.03]"
                        .to_owned()
                }
                _ => line.to_owned(),
            },
        )
        .collect();
    let path = folder.join(design);
    std::fs::write(&path, text.join("\n")).unwrap();
    path
}

struct Made {
    folder: tempfile::TempDir,
    design: String,
    code: Option<i32>,
    report_text: Value,
}

impl Made {
    fn new(design: &str, more: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let design = coarse(design, folder.path()).display().to_string();
        let path = |name: &str| folder.path().join(name).display().to_string();
        let (out, nodes, mpem) = (path("map"), path("map/nodes.yaml"), path("mpem.yaml"));
        let mut words = vec![
            "--format", "json", "map", &design, "--out", &out, "--vfield", &nodes, "--mpem", &mpem,
        ];
        words.extend(more);
        let run = fluxform(&words);
        let errors = String::from_utf8(run.stderr).unwrap();
        let report_text =
            serde_json::from_slice(&run.stdout).unwrap_or_else(|_| panic!("{errors}"));
        Self {
            folder,
            design,
            code: run.status.code(),
            report_text,
        }
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.folder.path().join(name)).unwrap()
    }

    /// Field and gradient by `probe`, [point][coil].
    fn probe(&self, points_m: &[[f64; 3]]) -> Vec<Vec<[f64; PARTS]>> {
        let path = self.folder.path().join("points.csv");
        let rows = points_m.iter().map(|[x, y, z]| format!("{x},{y},{z}\n"));
        let text: String = std::iter::once("x_m,y_m,z_m\n".to_owned())
            .chain(rows)
            .collect();
        std::fs::write(&path, text).unwrap();
        let run = fluxform(&["probe", &self.design, path.to_str().unwrap()]);
        let table = String::from_utf8(run.stdout).unwrap();
        let rows: Vec<[f64; PARTS]> = table
            .lines()
            .skip(1)
            .map(|line| {
                let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
                [4, 5, 6, 7, 8, 9, 11, 12].map(|column| row[column])
            })
            .collect();
        let coils = rows.len() / points_m.len();
        rows.chunks(coils).map(<[_]>::to_vec).collect()
    }

    fn stated(&self, stage: &str) -> f64 {
        self.report_text["accuracy"][stage]["estimate"]
            .as_f64()
            .unwrap()
    }
}

/// Numbers of a YAML list on one line.
fn list(text: &str) -> Vec<f64> {
    text.trim()
        .trim_start_matches("- ")
        .trim_matches(['[', ']'])
        .split(", ")
        .map(|number| number.parse().unwrap())
        .collect()
}

struct Nodes {
    keys: Vec<String>,
    /// Count, from, to along x, y, z.
    axes: [(usize, f64, f64); 3],
    /// Coil by coil, in the file's order.
    data: Vec<Vec<[f64; 3]>>,
}

fn read_nodes(text: &str) -> Nodes {
    let (mut keys, mut data, mut heads) =
        (Vec::new(), Vec::<Vec<[f64; 3]>>::new(), BTreeMap::new());
    for line in text.lines() {
        if let Some(vector) = line.strip_prefix("    - ") {
            data.last_mut()
                .unwrap()
                .push(list(vector).try_into().unwrap());
        } else if let Some(rest) = line.strip_prefix("    ") {
            let (key, value) = rest.split_once(':').unwrap();
            heads.insert(key.to_owned(), value.trim().to_owned());
        } else if let Some(key) = line.strip_prefix("  ") {
            keys.push(key.trim_end_matches(':').to_owned());
            data.push(Vec::new());
        }
    }
    let number = |key: String| -> f64 { heads[&key].parse().unwrap() };
    let axes = ["x", "y", "z"].map(|axis| {
        let count = number(format!("dim_{axis}")) as usize;
        (
            count,
            number(format!("min_{axis}")),
            number(format!("max_{axis}")),
        )
    });
    Nodes { keys, axes, data }
}

fn nodes_hold_what_probe_says_x_slowest() {
    let made = Made::new("seed_air.toml", &[]);
    assert_eq!(made.code, Some(0));
    let nodes = read_nodes(&made.text("map/nodes.yaml"));
    let mut sorted = nodes.keys.clone();
    sorted.sort();
    assert_eq!(nodes.keys, sorted);
    assert_eq!(nodes.keys.len(), 9);
    // mag_manip strides as if all counts were equal; the workspace and one step more are spanned.
    let count = nodes.axes[0].0;
    assert_eq!(count, 11);
    let box_m = [[-0.04, 0.05], [-0.05, 0.03], [0.02, 0.06]];
    let mut steps_m = [0.0; 3];
    for (axis, ((n, from, to), within)) in nodes.axes.iter().zip(box_m).enumerate() {
        assert_eq!(*n, count);
        steps_m[axis] = (to - from) / (count - 1) as f64;
        assert!((from + steps_m[axis] - within[0]).abs() < 1e-15);
        assert!((to - steps_m[axis] - within[1]).abs() < 1e-15);
    }
    let at = |axis: usize, k: usize| nodes.axes[axis].1 + steps_m[axis] * k as f64;
    let chosen = [
        [0, 0, 0],
        [10, 0, 3],
        [2, 9, 10],
        [5, 4, 7],
        [10, 10, 10],
        [1, 6, 2],
    ];
    let points_m = chosen.map(|[i, j, k]| [at(0, i), at(1, j), at(2, k)]);
    for ([i, j, k], coils) in chosen.iter().zip(made.probe(&points_m)) {
        for (coil, exact) in coils.iter().enumerate() {
            let value = nodes.data[coil][(i * count + j) * count + k];
            let size = magnitudes(exact)[0];
            for part in 0..3 {
                assert!(
                    (value[part] - exact[part]).abs() < 1e-8 * size,
                    "{coil} {i} {j} {k}"
                );
            }
        }
    }
    // Central differences of the list have no divergence and no curl but for their own error.
    let value = |i: usize, j: usize, k: usize| nodes.data[4][(i * count + j) * count + k];
    let slope = |i: usize, j: usize, k: usize| -> [[f64; 3]; 3] {
        let pairs = [
            (value(i + 1, j, k), value(i - 1, j, k)),
            (value(i, j + 1, k), value(i, j - 1, k)),
            (value(i, j, k + 1), value(i, j, k - 1)),
        ];
        std::array::from_fn(|axis| {
            std::array::from_fn(|part| {
                (pairs[axis].0[part] - pairs[axis].1[part]) / (2.0 * steps_m[axis])
            })
        })
    };
    for [i, j, k] in [[4, 6, 5], [3, 5, 7], [7, 3, 8]] {
        let [dx, dy, dz] = slope(i, j, k);
        let size = [dx, dy, dz]
            .as_flattened()
            .iter()
            .map(|g| g * g)
            .sum::<f64>()
            .sqrt();
        for zero in [
            dx[0] + dy[1] + dz[2],
            dx[1] - dy[0],
            dx[2] - dz[0],
            dy[2] - dz[1],
        ] {
            assert!(zero.abs() < 0.15 * size, "{zero:e} of {size:e}");
        }
    }
}

/// The sources of every coil.
fn read_sources(text: &str) -> Vec<Vec<(Source, Vec<f64>)>> {
    let mut coils: Vec<Vec<(Source, Vec<f64>)>> = Vec::new();
    let mut coefficients = Vec::new();
    let mut direction = [0.0; 3];
    for line in text.lines() {
        let (key, value) = line.split_once(':').unwrap_or((line, ""));
        match key.trim() {
            "Source_List" => coils.push(Vec::new()),
            "A_Coeff" => assert_eq!(value.trim(), "~"),
            "B_Coeff" => coefficients = list(value),
            "Source_Direction" => direction = list(value).try_into().unwrap(),
            "Source_Position" => {
                let source = Source {
                    position_m: list(value).try_into().unwrap(),
                    direction,
                    orders: coefficients.len(),
                };
                coils
                    .last_mut()
                    .unwrap()
                    .push((source, coefficients.clone()));
            }
            _ => {}
        }
    }
    coils
}

fn multipoles(made: &Made, tolerance: f64) {
    let coils = read_sources(&made.text("mpem.yaml"));
    assert_eq!(coils.len(), 9);
    assert_eq!(made.report_text["mpem"]["sources"], coils[0].len());
    let heights = [0.0200001, 0.023, 0.035, 0.0599];
    let mut points_m = Vec::new();
    for z in heights {
        for k in 0..150 {
            let part = |step: f64| (0.3 + step * f64::from(k)).fract();
            points_m.push([
                -0.04 + 0.09 * part(0.754_877),
                -0.05 + 0.08 * part(0.569_840),
                z,
            ]);
        }
    }
    let exact = made.probe(&points_m);
    let stated = [made.stated("mpem"), made.stated("mpem_gradient")];
    println!("stated {stated:?}, sources {}", coils[0].len());
    assert!(stated[0] <= tolerance && stated[1] <= tolerance);
    for plane in 0..heights.len() {
        let rows = plane * 150..(plane + 1) * 150;
        let (mut worst, mut sizes) = ([0.0_f64; 2], [0.0_f64; 2]);
        for (point, exact) in points_m[rows.clone()].iter().zip(&exact[rows]) {
            for (sources, exact) in coils.iter().zip(exact) {
                let mut off = exact.map(|part| -part);
                for (source, coefficients) in sources {
                    source.terms(*point, |term, parts| {
                        for (sum, part) in off.iter_mut().zip(parts) {
                            *sum += coefficients[term] * part;
                        }
                    });
                }
                let (errors, own) = (magnitudes(&off), magnitudes(exact));
                for k in 0..2 {
                    worst[k] = worst[k].max(errors[k]);
                    sizes[k] = sizes[k].max(own[k]);
                }
            }
        }
        for k in 0..2 {
            assert!(
                worst[k] <= stated[k] * sizes[k],
                "{plane}: {} of {}",
                worst[k] / sizes[k],
                stated[k]
            );
        }
    }
}

fn sources_of_air_coils_stand_on_their_own_axes() {
    let made = Made::new("seed_air.toml", &[]);
    multipoles(&made, 1e-3);
    for (coil, sources) in read_sources(&made.text("mpem.yaml")).iter().enumerate() {
        let axis = [
            (coil % 3) as f64 * 0.05 - 0.05,
            (coil / 3) as f64 * 0.05 - 0.05,
        ];
        for (source, _) in sources {
            assert_eq!(source.position_m[..2], axis);
            assert!(source.position_m[2] < 0.0);
            assert_eq!(source.direction, [0.0, 0.0, 1.0]);
        }
    }
}

fn sources_of_coupled_cores_stand_on_all_axes() {
    let made = Made::new("seed.toml", &[]);
    assert_eq!(made.code, Some(0));
    multipoles(&made, 1e-3);
    // Fewer do for less.
    let looser = Made::new("seed.toml", &["--mpem-tolerance", "3e-2"]);
    multipoles(&looser, 3e-2);
    let terms = |made: &Made| made.report_text["mpem"]["coefficients"].as_u64().unwrap();
    assert!(terms(&looser) < terms(&made));
}

fn an_unmet_tolerance_ends_with_four_and_the_files() {
    let made = Made::new("seed_air.toml", &["--mpem-tolerance", "1e-13"]);
    assert_eq!(made.code, Some(4));
    assert_eq!(made.report_text["mpem"]["tolerance_met"], false);
    assert!(made.text("mpem.yaml").len() > 1000);
}

fn the_same_bytes_on_any_number_of_threads_and_over_our_own_files() {
    let made = Made::new("seed_air.toml", &["--threads", "1"]);
    let sidecar: Value = serde_json::from_str(&made.text("map/map.json")).unwrap();
    let listed: Vec<&str> = sidecar["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|file| file["path"].as_str().unwrap())
        .collect();
    // A path elsewhere is not the folder's.
    assert_eq!(listed, ["map.npz", "nodes.yaml"]);
    let path = |name: &str| made.folder.path().join(name).display().to_string();
    let (out, nodes, mpem) = (path("map"), path("map/nodes.yaml"), path("mpem.yaml"));
    let words = [
        "map",
        &made.design,
        "--out",
        &out,
        "--vfield",
        &nodes,
        "--mpem",
        &mpem,
    ];
    let before = (made.text("map/nodes.yaml"), made.text("mpem.yaml"));
    let again = fluxform(&[&words[..], &["--threads", "2"]].concat());
    assert_eq!(again.status.code(), Some(0));
    assert!(before == (made.text("map/nodes.yaml"), made.text("mpem.yaml")));
    // Another's file stays.
    std::fs::write(&mpem, "not: ours\n").unwrap();
    assert_eq!(fluxform(&words).status.code(), Some(4));
    assert_eq!(made.text("mpem.yaml"), "not: ours\n");
    assert_eq!(
        fluxform(&[&words[..], &["--force"]].concat()).status.code(),
        Some(0)
    );
    assert_eq!(made.text("mpem.yaml"), before.1);
}

fn wrong_usage_and_unsuitable_workspaces_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let design = coarse("seed_air.toml", folder.path());
    let out = folder.path().join("map").display().to_string();
    let npz = format!("{out}/map.npz");
    let design_text = design.display().to_string();
    for words in [
        &["--vfield", "-"][..],
        &["--vfield", &npz],
        &["--vfield", "a.yaml", "--mpem", "a.yaml"],
        &["--vfield-nodes", "9"],
        &["--vfield", "a.yaml", "--vfield-nodes", "5"],
        &["--mpem", "a.yaml", "--mpem-tolerance", "2"],
    ] {
        let run = fluxform(&[&["map", &design_text, "--out", &out], words].concat());
        assert_eq!(run.status.code(), Some(2), "{words:?}");
    }
    let text = std::fs::read_to_string(&design).unwrap();
    for (axis, flag) in [
        ("z_mm = [20.0, 20.0, 1]", "--vfield"),
        ("z_mm = [0.0, 60.0, 7]", "--mpem"),
    ] {
        std::fs::write(&design, text.replace("z_mm = [20.0, 60.0, 7]", axis)).unwrap();
        let run = fluxform(&[
            "map",
            &design_text,
            "--out",
            &out,
            flag,
            &format!("{out}/a.yaml"),
        ]);
        let errors = String::from_utf8(run.stderr).unwrap();
        assert_eq!(run.status.code(), Some(3), "{errors}");
        assert!(errors.contains(flag) && errors.contains("z_mm"), "{errors}");
        assert!(!Path::new(&out).join("a.yaml").exists());
    }
}

/// A Python with mag_manip.
fn python() -> Option<PathBuf> {
    let named: Vec<PathBuf> = match std::env::var_os("FLUXFORM_MAGMANIP_PYTHON") {
        Some(named) => vec![named.into()],
        None => vec!["python3.11".into(), "python3".into()],
    };
    let has = ["-c", "import numpy; from mag_manip import mag_manip"];
    (named.into_iter()).find(|python| needs::answers(python, &has))
}

fn missing() -> Option<String> {
    (python().is_none()).then(|| "Python with mag_manip".to_owned())
}

fn mag_manip_reads_what_is_stated() {
    let python = python().unwrap_or_default();
    let folder = tempfile::tempdir().unwrap();
    for design in ["seed_air.toml", "seed.toml"] {
        let run = Command::new(&python)
            .arg("scripts/peers/compare_magmanip.py")
            .arg(coarse(design, folder.path()))
            .args(["--points", "200", "--fluxform", program().to_str().unwrap()])
            .current_dir(root())
            .output()
            .unwrap();
        let out = String::from_utf8(run.stdout).unwrap();
        let errors = String::from_utf8(run.stderr).unwrap();
        println!("{out}");
        assert!(run.status.success(), "{design}\n{out}\n{errors}");
        assert_eq!(out.matches("largest error").count(), 4);
    }
}
