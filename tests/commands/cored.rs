//! Designs with steel through the jobs: the numbers measured with two independent methods, and
//! bundles of every kind of design verified.

use std::cell::RefCell;
use std::path::Path;

use fluxform::commands::evaluate::{Evaluation, evaluate};
use fluxform::commands::verify::{Verifier, VerifyOptions};
use fluxform::commands::{lambda, verify};
use fluxform::design::{Design, Need};
use fluxform::progress::Silent;
use fluxform::scene::cost::Cost;
use fluxform::shape::document::ShapeDocument;

use crate::{calibrate_text, here};

fn shipped(name: &str) -> String {
    std::fs::read_to_string(here(name)).expect("shipped design")
}

/// The shipped design with every (from, to) replaced.
fn seed(changes: &[(&str, &str)]) -> String {
    changes
        .iter()
        .fold(shipped("designs/seed.toml"), |text, (from, to)| {
            assert!(text.contains(from), "{from} is not in designs/seed.toml");
            text.replace(from, to)
        })
}

fn read(text: &str, need: Need) -> Design {
    let path = here("designs/seed.toml");
    Design::from_toml(text, &path, need)
        .expect("a valid design")
        .0
}

fn evaluated(text: &str) -> Evaluation {
    evaluate(&read(text, Need::EVALUATE), Vec::new(), None).expect("evaluates")
}

/// One coil: the array's section left out.
const ALONE: (&str, &str) = (
    "[array]\nrows = 3\ncolumns = 3\npitch_mm = 50.0\n",
    "[array]\nrows = 1\ncolumns = 1\npitch_mm = 50.0\n",
);
/// Both limits of the current away: 6 A are above 36 V through the coil.
const SIX_AMPERE: [(&str, &str); 2] = [
    ("current_max_a = 2.0", "current_max_a = 6.0"),
    ("voltage_v = 36.0", "voltage_v = 48.0"),
];

fn near(value: f64, expected: f64, relative: f64) {
    assert!(
        (value / expected - 1.0).abs() < relative,
        "{value}, expected {expected}"
    );
}

#[test]
fn the_seed_coil_is_that_of_finite_elements() {
    let result = evaluated(&seed(&[ALONE]));
    near(result.coil.circuit.resistance_ohm, 6.0753, 1e-5);
    near(result.coil.circuit.inductance_h, 0.184_092, 3e-6);
    near(result.coil.circuit.settling_s, 0.1515, 1e-3);
    near(result.target.gradient_t_per_m_per_a, -0.428_229, 2e-6);
    near(result.target.force_n, 0.778_87, 1e-5);
    let core = result.core.expect("a core");
    near(core.peak_field_t, 0.72, 0.02);
    assert!(core.mean_field_t < core.peak_field_t && result.array.is_none());
    assert!(!result.limits["settling_s"].met && !result.limits["resistance_ohm"].met);
    assert!(result.accuracy_reached && result.accuracy["field"].estimate <= 1e-6);
    assert!(result.warnings.is_empty(), "{:?}", result.warnings);
    // Eddy currents make the force wait for the current, the current rise faster than 3 tau.
    let step = result.transient.expect("a transient");
    assert!(step.force_95_s > step.current_95_s, "{step:?}");
    near(
        step.current_95_s,
        3.0 * result.coil.circuit.time_constant_s,
        0.1,
    );
    let fits = evaluated(&seed(&[ALONE, ("turns = 1429", "")]));
    near(fits.coil.turns, 1428.57, 3e-6);
}

#[test]
fn six_ampere_magnet_and_pull_are_those_of_finite_elements() {
    let mut changes = vec![ALONE];
    changes.extend(SIX_AMPERE);
    let linear = evaluated(&seed(&changes));
    near(linear.target.force_n, 2.337, 3e-4);
    // Linear steel far above its knee is not passed over in silence.
    assert!(
        linear.warnings[0].contains("knee at 1.5 T"),
        "{:?}",
        linear.warnings
    );
    changes.push((
        "relative_permeability = 1000.0",
        "bh_curve = \"steel_1010.csv\"",
    ));
    let curve = evaluated(&seed(&changes));
    let core = curve.core.expect("a core");
    near(core.peak_field_t, 1.92, 0.02);
    let deviation = core.deviation_from_linear.expect("a curve");
    assert!((deviation + 0.068).abs() < 0.003, "{deviation}");
    assert!(curve.warnings[0].contains("knee"), "{:?}", curve.warnings);
    let flux_wb = curve.coil.circuit.flux_linkage_wb.expect("a curve");
    near(flux_wb, 6.0 * curve.coil.circuit.inductance_h, 1e-12);
    assert!(curve.coil.circuit.inductance_h < linear.coil.circuit.inductance_h);

    let magnet = ("model = \"dipole\"", "model = \"cylinder\"");
    let whole = evaluated(&seed(&[ALONE, magnet]));
    near(whole.target.force_n, 0.784_11, 2e-5);
    let pulled = (
        "model = \"dipole\"",
        "model = \"cylinder\"\npassive_force = true",
    );
    let with = evaluated(&seed(&[ALONE, pulled]));
    let pull_n = with.target.passive_force_n.expect("requested");
    near(pull_n, -0.0272, 3e-3);
    near(with.target.force_n, whole.target.force_n + pull_n, 1e-12);
    let higher = seed(&[ALONE, pulled, ("height_mm = 30.0", "height_mm = 50.0")]);
    let higher = evaluated(&higher).target.passive_force_n;
    near(higher.expect("requested"), -0.0024, 0.02);
}

#[test]
fn neighbours_change_the_array() {
    let array = evaluated(&seed(&[])).array.expect("nine coils");
    near(array.coils[4].inductance_h, 0.2129, 3e-4);
    let matrix = &array.mutual_inductance_h;
    for (i, row) in matrix.iter().enumerate() {
        for (j, value) in row.iter().enumerate() {
            assert!((value - matrix[j][i]).abs() < 1e-4 * matrix[4][4]);
        }
    }
    // All nine coils at once: the middle core carries the others' return flux.
    let peak = |coil: usize| array.coils[coil].peak_field_t.expect("steel");
    assert!(peak(4) < peak(1) && peak(1) < peak(0));
    near(peak(0), peak(8), 1e-6);
    let none = ("pitch_mm = 50.0", "pitch_mm = 50.0\ncoupling = \"none\"");
    let alone = evaluated(&seed(&[none])).array.expect("nine coils");
    near(alone.coils[4].inductance_h, 0.184_092, 3e-6);
    assert!(alone.coils[4].peak_field_t.is_none());
}

/// lambda_linear, lambda_jnd, lambda_saturation of the flat surface, N/m.
fn flat(text: &str) -> [f64; 3] {
    let (document, _) = ShapeDocument::read(&here("shapes/flat.toml")).expect("a valid shape");
    let design = read(text, Need::LAMBDA);
    let options = lambda::LambdaOptions::default();
    let solved = lambda::run(&design, &document, Vec::new(), &options, &Silent);
    let (_, report) = solved.expect("solves");
    let file = report.file;
    [
        file.constants.lambda_linear_n_per_m,
        file.constants.lambda_jnd_n_per_m,
        file.constants.lambda_saturation_n_per_m,
    ]
    .map(|lambda| lambda.expect("a limit binds"))
}

#[test]
fn the_flat_surface_has_the_seed_s_lambda_without_coupling_and_half_of_it_with() {
    let none = flat(&seed(&[(
        "pitch_mm = 50.0",
        "pitch_mm = 50.0\ncoupling = \"none\"",
    )]));
    for (found, expected) in none.into_iter().zip([4.9429, 6.0070, 5.9878]) {
        assert!((found - expected).abs() < 5e-5, "{none:?}");
    }
    let full = flat(&seed(&[]));
    for (coupled, alone) in full.into_iter().zip(none) {
        let part = coupled / alone;
        assert!((0.5..0.65).contains(&part), "{full:?} {none:?}");
    }
}

#[test]
fn steel_as_permeable_as_air_is_air() {
    let steel = (
        "relative_permeability = 1000.0",
        "relative_permeability = 1.0",
    );
    for pose in [
        ("model = \"dipole\"", "model = \"dipole\""),
        (
            "model = \"dipole\"",
            "model = \"cylinder\"\ntilt_deg = [7.0, -13.0]",
        ),
    ] {
        let cored = seed(&[ALONE, steel, pose]);
        let (head, rest) = cored.split_once("[core]").expect("a core");
        let (_, tail) = rest.split_once("[array]").expect("an array");
        let (cored, air) = (
            evaluated(&cored),
            evaluated(&format!("{head}[array]{tail}")),
        );
        near(
            cored.coil.circuit.inductance_h,
            air.coil.circuit.inductance_h,
            1e-12,
        );
        let (with, without) = (&cored.target, &air.target);
        near(
            with.gradient_t_per_m_per_a,
            without.gradient_t_per_m_per_a,
            1e-12,
        );
        near(with.field_t_per_a, without.field_t_per_a, 1e-12);
        // The two differ in the tolerance that the magnet's dipoles have by default.
        let allowed = if pose.0 == pose.1 { 1e-12 } else { 1e-6 };
        near(with.force_n, without.force_n, allowed);
        let core = cored.core.expect("a core");
        assert!(core.peak_field_t < 0.05, "{core:?}");
    }
}

/// A coarse workspace, so that a bundle takes no second.
const COARSE: [(&str, &str); 3] = [
    ("x_mm = [-50.0, 50.0, 61]", "x_mm = [-52.0, 52.0, 27]"),
    ("y_mm = [-50.0, 50.0, 61]", "y_mm = [-52.0, 52.0, 25]"),
    ("z_mm = [10.0, 80.0, 29]", "z_mm = [36.0, 84.0, 17]"),
];

/// A wedge with few points, in `folder`.
fn wedge(folder: &Path) -> String {
    let path = folder.join("slope.toml");
    let text = "name = \"slope\"\nprimitive = \"wedge\"\nlow_mm = 47.0\nhigh_mm = 71.0\n\
                [points]\nx_mm = [-47.0, 47.0, 17]\ny_mm = [-43.0, 43.0, 13]\n";
    #[allow(clippy::disallowed_methods)] // a test's own file
    std::fs::write(&path, text).expect("writable");
    path.to_str().expect("a plain path").to_owned()
}

fn calibrated(changes: &[(&str, &str)], out: &Path) -> std::path::PathBuf {
    let text = seed(&[&COARSE[..], changes].concat());
    let shape = wedge(out);
    let report = calibrate_text(&text, &[&shape], out).expect("calibrates");
    assert!(report.meets_request());
    report.bundles[0].folder.clone()
}

fn calibrated_and_verified(kind: &str, changes: &[(&str, &str)]) {
    let out = tempfile::tempdir().expect("a temporary folder");
    let folder = calibrated(changes, out.path());
    let verified = verify::run(&folder, &Silent).expect("opens");
    for check in &verified.checks {
        assert!(check.passed, "{kind}: {check:?}");
    }
}

/// Two coils: the coupling is there, and costs little.
const PAIR: (&str, &str) = ("rows = 3\ncolumns = 3", "rows = 1\ncolumns = 2");

#[test]
fn bundles_with_and_without_coupling_are_verified() {
    let none = ("pitch_mm = 50.0", "pitch_mm = 50.0\ncoupling = \"none\"");
    calibrated_and_verified("full", &[]);
    calibrated_and_verified("none", &[none]);
}

/// Minutes of a large array passed without a word.
#[test]
fn verify_states_all_that_it_takes_before_it_solves() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let folder = calibrated(&[PAIR], out.path());
    let stated = RefCell::new(Vec::new());
    let limit = |costs: &[Cost]| {
        let before_it_is_read = stated.borrow().is_empty();
        stated.borrow_mut().extend_from_slice(costs);
        match before_it_is_read {
            true => Ok(()),
            false => Err("that is enough".to_owned()),
        }
    };
    let refused = Verifier::limited(&limit).verify(&folder, VerifyOptions::default(), &Silent);
    let message = refused.expect_err("refused").to_string();
    assert!(message.contains("that is enough"), "{message}");
    let stated = stated.into_inner();
    let of = |stage: &str| {
        stated
            .iter()
            .filter(|cost| cost.what.contains(stage))
            .count()
    };
    // As the bundle was made, and by the independent route.
    for stage in [
        "the steel",
        "the forces",
        "lambda's path",
        "the worst point",
    ] {
        assert_eq!(of(stage), 2, "{stage}: {stated:?}");
    }
    assert_eq!(of("the map"), 1);
    // What takes memory alone.
    assert_eq!((of("points of"), of("the bundle's map")), (1, 1));
    assert!(
        stated
            .iter()
            .all(|cost| cost.cpu_seconds > 0.0 || cost.bytes > 0.0),
        "{stated:?}"
    );
}

#[test]
fn bundles_of_every_magnet_are_verified() {
    for (kind, magnet) in [
        (
            "tilted dipole",
            "model = \"dipole\"\ntilt_deg = [11.0, -7.0]",
        ),
        ("cylinder", "model = \"cylinder\""),
    ] {
        calibrated_and_verified(kind, &[PAIR, ("model = \"dipole\"", magnet)]);
    }
}

#[test]
fn a_bundle_with_a_curve_is_verified() {
    let table = here("designs/steel_1010.csv");
    let table = format!("bh_curve = {:?}", table.to_str().expect("a plain path"));
    let curve = ("relative_permeability = 1000.0", table.as_str());
    calibrated_and_verified("curve", &[PAIR, curve]);
}

#[test]
fn the_bytes_of_a_cored_bundle_do_not_depend_on_the_threads() {
    let files = |threads: usize| {
        let out = tempfile::tempdir().expect("a temporary folder");
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("threads");
        let cylinder = ("model = \"dipole\"", "model = \"cylinder\"");
        let folder = pool.install(|| calibrated(&[cylinder], out.path()));
        ["map.npz", "currents.csv", "points.csv", "lambda.json"].map(|name| {
            let bytes = std::fs::read(folder.join(name)).expect("written");
            // The shape's path names the temporary folder.
            let text = String::from_utf8_lossy(&bytes).into_owned();
            let place = out.path().to_str().expect("a plain path").to_owned();
            if name.ends_with(".json") {
                text.replace(&place, "").into_bytes()
            } else {
                bytes
            }
        })
    };
    assert!(files(1) == files(2));
}
