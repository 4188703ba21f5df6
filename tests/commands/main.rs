//! The main job from documents to a verified bundle.

mod cored;
mod inputs;
mod limit;
mod near;
mod picture;
mod sideways;

use std::path::{Path, PathBuf};

use fluxform::RunError;
use fluxform::bundle::artefact::Input;
use fluxform::bundle::load::Bundle;
use fluxform::bundle::npz::{from_npz, to_npz};
use fluxform::commands::calibrate::{self, CalibrateOptions, CalibrateReport};
use fluxform::commands::lambda::LambdaOptions;
use fluxform::commands::probe::ProbeRequest;
use fluxform::commands::{evaluate, lambda, probe, verify};
use fluxform::design::{Design, Need};
use fluxform::field::components::Components;
use fluxform::progress::Silent;
use fluxform::scene::sources::{DesignSource, ShapeSource};
use fluxform::shape::document::ShapeDocument;
use fluxform_testing::bundle::resealed;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn calibrate_text(text: &str, shapes: &[&str], out: &Path) -> Result<CalibrateReport, RunError> {
    let path = here("designs/seed_air.toml");
    let (design, _) = Design::from_toml(text, &path, Need::CALIBRATE).expect("a valid design");
    // Read from standard input: its only copy is the bundle's.
    let input = Input::of_bytes("-", text.as_bytes());
    let shapes: Vec<ShapeSource> = shapes
        .iter()
        .map(|name| {
            // Tests run in the repository: paths in artefacts are relative.
            let path = Path::new(name);
            let (document, _) = ShapeDocument::read(path).expect("a valid shape");
            let bytes = std::fs::read(path).expect("readable");
            ShapeSource {
                document,
                input: Some(Input::of_bytes(*name, &bytes)),
            }
        })
        .collect();
    let options = CalibrateOptions {
        keep: false,
        page: false,
        ..CalibrateOptions::new(out)
    };
    let source = DesignSource {
        design: &design,
        text,
        input: &input,
    };
    calibrate::run(source, &shapes, &options, &Silent)
}

fn seed_air() -> String {
    std::fs::read_to_string(here("designs/seed_air.toml")).expect("shipped design")
}

const SHAPES: [&str; 4] = [
    "shapes/flat.toml",
    "shapes/half_sphere.toml",
    "shapes/half_cylinder.toml",
    "shapes/wedge.toml",
];

#[test]
fn the_seed_shapes_are_calibrated_and_verified() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let report = calibrate_text(&seed_air(), &SHAPES, out.path()).expect("calibrates");
    assert!(report.meets_request());
    assert_eq!(report.bundles.len(), 4);
    for bundle in &report.bundles {
        let file = &bundle.lambda.file;
        let lambda = file.lambda_n_per_m.expect("a force constant");
        let linear = file.constants.lambda_linear_n_per_m.expect("linear");
        assert!(lambda > linear && linear > 0.0, "{lambda} {linear}");
        let verified = verify::run(&bundle.folder, &Silent).expect("opens");
        for check in &verified.checks {
            assert!(check.passed, "{}: {check:?}", file.shape);
        }
    }
    assert_eq!(report.bundles[0].lambda.file.points, 3721);
}

#[test]
fn the_jnd_is_what_the_limits_may_add_to_the_error() {
    let (design, _) = Design::read(&here("designs/seed_air.toml"), Need::LAMBDA).expect("valid");
    let (document, _) = ShapeDocument::read(&here("shapes/flat.toml")).expect("a valid shape");
    // Below lambda_linear the relative error is rho_0.
    let at = 0.3;
    let mut options = LambdaOptions::default();
    options.settings.at_n_per_m = Some(at);
    let solved = lambda::run(&design, &document, Vec::new(), &options, &Silent);
    let (_, report) = solved.expect("solves");
    let file = &report.file;
    assert!(at < file.constants.lambda_linear_n_per_m.expect("linear"));
    let floor = file.at.as_ref().expect("requested").rms_error_n / (at * 0.05);
    let chosen = file.relative_rms_error.expect("a force constant");
    let added = chosen * chosen - floor * floor;
    assert!((added - 0.07 * 0.07).abs() < 1e-12, "{added:e}");
}

#[test]
fn a_bundle_with_a_wrong_number_fails_its_checks() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let report = calibrate_text(&seed_air(), &SHAPES[..1], out.path()).expect("calibrates");
    let folder = &report.bundles[0].folder;
    // The same bundle, but its design says 1428 turns: every map value is off by 7e-4.
    let design = folder.join("design.toml");
    let text = std::fs::read_to_string(&design).expect("kept design");
    let wrong = text.replace("turns = 1429", "turns = 1428");
    assert_ne!(text, wrong);
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&design, &wrong).expect("writable");
    // The digest is checked first.
    let error = verify::run(folder, &Silent).expect_err("a changed file");
    assert_eq!(error.exit_code(), 5);
    assert!(error.to_string().contains("design.toml"), "{error}");
    // With the digest forged, lambda.json still names the other design, of another resistance.
    let manifest = folder.join("manifest.json");
    let listed = std::fs::read_to_string(&manifest).expect("manifest");
    let forged = listed.replace(
        &Input::of_bytes("", text.as_bytes()).sha256,
        &Input::of_bytes("", wrong.as_bytes()).sha256,
    );
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&manifest, resealed(&forged)).expect("writable");
    let report = verify::run(folder, &Silent).expect("opens");
    assert!(!report.passed);
    assert_eq!(failed(&report), ["inputs", "scene"]);
}

#[test]
fn what_an_object_does_not_need_is_left_out() {
    let text = seed_air().replace(
        "current_max_a = 2.0",
        "current_max_a = [2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 0.0]",
    );
    let out = tempfile::tempdir().expect("a temporary folder");
    let report = calibrate_text(&text, &SHAPES[..1], out.path()).expect("calibrates");
    let manifest = &report.bundles[0].manifest;
    assert_eq!(manifest.map.coil, (0..8).collect::<Vec<i64>>());
    let reported: Vec<&str> = manifest.left_out.iter().map(|l| l.what.as_str()).collect();
    assert!(
        reported.iter().any(|what| what.contains("1 coils")),
        "{reported:?}"
    );
    assert!(
        reported.iter().any(|what| what.contains("workspace nodes")),
        "{reported:?}"
    );
    assert!(
        verify::run(&report.bundles[0].folder, &Silent)
            .expect("opens")
            .passed
    );
}

#[test]
fn the_seed_air_coil() {
    let path = here("designs/seed_air.toml");
    let (design, _) = Design::read(&path, Need::EVALUATE).expect("a valid design");
    let result = evaluate::evaluate(&design, Vec::new(), None).expect("evaluates");
    assert!((result.coil.circuit.resistance_ohm - 6.0753).abs() < 5e-5);
    assert!((result.coil.circuit.inductance_h - 0.014_501_926_063_452_128).abs() < 1e-14);
    assert!(
        (result.target.gradient_t_per_m_per_a / -0.054_820_592_063_778_707 - 1.0).abs() < 1e-12
    );
    assert!((result.target.force_n - 0.099_71).abs() < 5e-6);
    assert!(!result.limits["resistance_ohm"].met && result.limits["settling_s"].met);
    let array = result.array.expect("nine coils");
    let matrix = &array.mutual_inductance_h;
    for (i, row) in matrix.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            assert_eq!(*value, matrix[j][i]);
        }
        // Nine ampere push flux out of every coil: the rows' sums stay positive.
        assert!(row.iter().sum::<f64>() > 0.0);
    }
}

#[test]
fn two_shapes_of_one_name_are_refused() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let shapes = ["shapes/flat.toml", "shapes/flat.toml"];
    let error = calibrate_text(&seed_air(), &shapes, out.path()).expect_err("equal names");
    assert!(error.to_string().contains("flat"), "{error}");
}

#[test]
fn an_object_outside_the_workspace_is_refused_with_the_translation_that_cures_it() {
    let text = seed_air().replace("z_mm = [10.0, 80.0, 29]", "z_mm = [10.0, 40.0, 13]");
    assert_ne!(text, seed_air());
    let out = tempfile::tempdir().expect("a temporary folder");
    let error = calibrate_text(&text, &SHAPES[..1], out.path()).expect_err("no bundle");
    let message = error.to_string();
    for part in [
        "wholly outside the design's workspace",
        "translate_mm = [0, 0, 40]",
    ] {
        assert!(message.contains(part), "{message}");
    }
    let cured = text.replace("z_mm = [10.0, 40.0, 13]", "z_mm = [10.0, 60.0, 21]");
    let report = calibrate_text(&cured, &SHAPES[..1], out.path()).expect("calibrates");
    assert!(
        verify::run(&report.bundles[0].folder, &Silent)
            .expect("opens")
            .passed
    );
}

#[test]
fn a_probe_on_an_edge_is_reported_with_its_number_and_coil() {
    let (design, _) = Design::read(&here("designs/seed_air.toml"), Need::PROBE).expect("valid");
    let points = vec![[0.0, 0.0, 0.03], [0.012, 0.0, 0.0]];
    let request = ProbeRequest {
        components: Components::All,
        force: false,
        tolerance: None,
    };
    let error = probe::probe(&design, points, request, &Silent).expect_err("an edge of coil 4");
    assert!(
        error.to_string().contains("point 2 ") && error.to_string().contains("coil 4"),
        "{error}"
    );
}

#[test]
fn a_workspace_from_the_top_face_up_is_verified() {
    let text = seed_air().replace("z_mm = [10.0, 80.0, 29]", "z_mm = [0.0, 70.0, 29]");
    assert_ne!(text, seed_air());
    let out = tempfile::tempdir().expect("a temporary folder");
    // The wedge from 0 to 50 mm: its map begins on the windings' faces.
    let shape = out.path().join("low.toml");
    #[allow(clippy::disallowed_methods)]
    std::fs::write(
        &shape,
        "name = \"low\"\nprimitive = \"wedge\"\nlow_mm = 3.0\nhigh_mm = 50.0\n",
    )
    .expect("writable");
    let shape = shape.to_str().expect("a plain path");
    let report = calibrate_text(&text, &[shape], out.path()).expect("calibrates");
    let verified = verify::run(&report.bundles[0].folder, &Silent).expect("opens");
    assert!(verified.passed, "{:?}", verified.checks);
}

/// A shipped design on a coarse workspace.
fn small(design: &str) -> String {
    let text = std::fs::read_to_string(here(design)).expect("shipped design");
    let small = text
        .replace("x_mm = [-50.0, 50.0, 61]", "x_mm = [-50.0, 50.0, 24]")
        .replace("y_mm = [-50.0, 50.0, 61]", "y_mm = [-50.0, 50.0, 21]")
        .replace("z_mm = [10.0, 80.0, 29]", "z_mm = [25.0, 65.0, 13]");
    assert_ne!(text, small);
    small
}

/// A wedge with few points, for a coarse workspace.
#[allow(clippy::disallowed_methods)]
fn small_shape(folder: &Path) -> String {
    let path = folder.join("low.toml");
    let text = "name = \"low\"\nprimitive = \"wedge\"\nlow_mm = 30.0\nhigh_mm = 50.0\n\
                [points]\nx_mm = [-50.0, 50.0, 9]\ny_mm = [-50.0, 50.0, 8]\n";
    std::fs::write(&path, text).expect("writable");
    path.to_str().expect("a plain path").to_owned()
}

/// Replaces a file of a bundle and the digest that its manifest states.
#[allow(clippy::disallowed_methods)]
fn forge(folder: &Path, name: &str, bytes: &[u8]) {
    let before = std::fs::read(folder.join(name)).expect("a file of the bundle");
    assert_eq!(
        before.len(),
        bytes.len(),
        "the manifest states the size too"
    );
    let manifest = folder.join("manifest.json");
    let reported = std::fs::read_to_string(&manifest).expect("manifest");
    let forged = reported.replace(
        &Input::of_bytes("", &before).sha256,
        &Input::of_bytes("", bytes).sha256,
    );
    assert_ne!(reported, forged);
    std::fs::write(&manifest, resealed(&forged)).expect("writable");
    std::fs::write(folder.join(name), bytes).expect("writable");
}

fn failed(report: &verify::VerifyReport) -> Vec<&'static str> {
    let failed = report.checks.iter().filter(|check| !check.passed);
    failed.map(|check| check.name).collect()
}

#[test]
fn the_steels_pull_is_kept_in_the_bundle_and_verified() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let text = small("designs/seed.toml").replace("[magnet] ", "[magnet]\npassive_force = true");
    let shape = small_shape(out.path());
    let report = calibrate_text(&text, &[&shape], out.path()).expect("calibrates");
    let folder = &report.bundles[0].folder;
    let reported = report.bundles[0].manifest.map.passive_force.as_ref();
    assert!(reported.expect("a pull").interpolation.largest_error < 0.05);
    let verified = verify::run(folder, &Silent).expect("opens");
    assert_eq!(failed(&verified), [""; 0], "{:?}", verified.checks);

    // Over the middle core the steel pulls down, -27.2 mN for one core alone at 30 mm.
    let bundle = Bundle::open(folder).expect("opens");
    let pull = bundle.passive_force_n([0.0, 0.0, 0.03]).expect("inside");
    assert!((-0.031..-0.024).contains(&pull), "{pull}");

    let bytes = std::fs::read(folder.join("map.npz")).expect("map");
    let mut map = from_npz(&bytes).expect("a map");
    let mut pulls = map.passive_force_n.expect("a pull").into_owned();
    let nodes = map.x_m.len() * map.y_m.len();
    let largest = pulls[..nodes].iter().fold(0.0_f64, |m, f| m.max(f.abs()));
    pulls[nodes / 3] += 0.003 * largest;
    map.passive_force_n = Some(pulls.into());
    forge(folder, "map.npz", &to_npz(&map).expect("bytes"));
    let verified = verify::run(folder, &Silent).expect("opens");
    assert_eq!(failed(&verified), ["recomputed"]);
}

#[test]
fn a_bundle_keeps_its_magnetisation_curve_wherever_it_goes() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let shape = small_shape(out.path());
    let report = calibrate_text(&small("designs/seed_1010.toml"), &[&shape], out.path())
        .expect("calibrates");
    let inputs = &report.bundles[0].manifest.inputs;
    assert!(
        inputs
            .iter()
            .any(|input| input.path.ends_with("steel_1010.csv"))
    );
    let elsewhere = tempfile::tempdir().expect("a temporary folder");
    let folder = elsewhere.path().join("moved");
    #[allow(clippy::disallowed_methods)]
    std::fs::rename(&report.bundles[0].folder, &folder).expect("moved");
    let verified = verify::run(&folder, &Silent).expect("opens");
    assert_eq!(failed(&verified), [""; 0], "{:?}", verified.checks);

    let table = folder.join("bh_curve.csv");
    let text = std::fs::read_to_string(&table).expect("the kept table");
    // Close to the mean |B| of a coil at its rated current.
    let row = text.lines().nth(6).expect("a point at 0.51 T");
    let (b, h) = row.split_once(',').expect("two columns");
    let h: f64 = h.parse().expect("a number");
    let mut changed = format!("{}", 1.15 * h);
    changed.truncate(row.len() - b.len() - 1);
    while changed.len() < row.len() - b.len() - 1 {
        changed.push(if changed.contains('.') { '0' } else { '.' });
    }
    let wrong = text.replacen(row, &format!("{b},{changed}"), 1);
    assert_ne!(text, wrong);
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&table, &wrong).expect("writable");
    let error = verify::run(&folder, &Silent).expect_err("a changed table");
    assert_eq!(error.exit_code(), 5);
    assert!(error.to_string().contains("bh_curve.csv"), "{error}");
    // With the digest forged, the input itself decides.
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&table, &text).expect("writable");
    forge(&folder, "bh_curve.csv", wrong.as_bytes());
    let verified = verify::run(&folder, &Silent).expect("opens");
    assert_eq!(failed(&verified), ["inputs"], "{:?}", verified.checks);
}
