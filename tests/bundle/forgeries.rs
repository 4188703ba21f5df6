//! Bundles that were changed on purpose, their checksums sealed again: `verify` notices each.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use fluxform::bundle::artefact::{FileEntry, Input, arithmetic, sha256_hex};
use fluxform::bundle::json::to_json;
use fluxform::bundle::lambda_file::LambdaFile;
use fluxform::bundle::load::Bundle;
use fluxform::bundle::manifest::{LeftOut, MadeWith, Manifest};
use fluxform::bundle::npz::{MapArrays, to_npz};
use fluxform::bundle::rendering::HeightGrid;
use fluxform::bundle::seal::to_record;
use fluxform::bundle::table::{CurrentRow, PointRow, write_rows};
use fluxform::commands::calibrate::{self, CalibrateOptions};
use fluxform::commands::verify::{Verifier, VerifyOptions};
use fluxform::design::{Design, Need};
use fluxform::lambda::Criterion;
use fluxform::progress::Silent;
use fluxform::scene::sources::{DesignSource, ShapeSource};
use fluxform::shape::document::ShapeDocument;

const DESIGN: &str = "name = \"small\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\n\
                      length_mm = 70\n[wire]\ndiameter_mm = 0.7\n[array]\nrows = 1\ncolumns = 2\n\
                      pitch_mm = 50\n[supply]\ncurrent_max_a = 2\nvoltage_v = 36\n[workspace]\n\
                      x_mm = [-40, 40, 6]\ny_mm = [-30, 30, 5]\nz_mm = [20, 60, 9]\n";
const SHAPE: &str = "name = \"slope\"\nprimitive = \"wedge\"\nlow_mm = 31\nhigh_mm = 43\n[points]\n\
                     x_mm = [-37, 37, 5]\ny_mm = [-23, 23, 4]\n";

/// A real bundle of a small design, its inputs beside it.
pub fn calibrated(folder: &Path, design_text: &str, shape_text: &str, page: bool) -> PathBuf {
    let (design_path, shape_path) = (folder.join("small.toml"), folder.join("slope.toml"));
    fs::write(&design_path, design_text).unwrap();
    fs::write(&shape_path, shape_text).unwrap();
    let input =
        |path: &Path, text: &str| Input::of_bytes(path.display().to_string(), text.as_bytes());
    let (design, _) = Design::from_toml(design_text, &design_path, Need::CALIBRATE).unwrap();
    let (document, _) = ShapeDocument::from_toml(shape_text, &shape_path).unwrap();
    let source = DesignSource {
        design: &design,
        text: design_text,
        input: &input(&design_path, design_text),
    };
    let shape = ShapeSource {
        document,
        input: Some(input(&shape_path, shape_text)),
    };
    let mut options = CalibrateOptions::new(folder.join("out"));
    options.keep = false;
    options.page = page;
    let report = calibrate::run(source, &[shape], &options, &Silent).unwrap();
    report.bundles[0].folder.clone()
}

/// A bundle taken apart.
#[derive(Clone)]
struct Parts {
    manifest: Manifest,
    lambda: LambdaFile,
    map: MapArrays<'static>,
    points: Vec<PointRow>,
    currents: Vec<CurrentRow>,
    /// Every other listed file.
    others: BTreeMap<String, Vec<u8>>,
    /// Bytes behind the archive's end.
    behind: Vec<u8>,
}

impl Parts {
    fn of(folder: &Path) -> Self {
        let bundle = Bundle::open(folder).unwrap();
        let others = bundle.manifest.files.iter().skip(4);
        Self {
            others: others
                .map(|file| {
                    (
                        file.path.clone(),
                        fs::read(folder.join(&file.path)).unwrap(),
                    )
                })
                .collect(),
            manifest: bundle.manifest,
            lambda: bundle.lambda,
            map: bundle.map,
            points: bundle.points,
            currents: bundle.currents,
            behind: Vec::new(),
        }
    }

    fn options(&mut self) -> &mut MadeWith {
        self.manifest.made_with.as_mut().unwrap()
    }

    /// Writes all parts with fitting sizes and digests, as the program itself writes them.
    fn write(&self, folder: &Path) {
        let mut map = to_npz(&self.map).unwrap();
        map.extend(&self.behind);
        let mut files = BTreeMap::from([("map.npz".to_owned(), map)]);
        let mut table = Vec::new();
        write_rows(&mut table, PointRow::COLUMNS, self.points.iter().copied()).unwrap();
        files.insert("points.csv".to_owned(), table);
        let mut table = Vec::new();
        write_rows(
            &mut table,
            CurrentRow::COLUMNS,
            self.currents.iter().copied(),
        )
        .unwrap();
        files.insert("currents.csv".to_owned(), table);
        files.insert("lambda.json".to_owned(), to_json(&self.lambda).unwrap());
        files.extend(self.others.clone());
        let mut manifest = self.manifest.clone();
        if let Some(made_with) = &mut manifest.made_with {
            made_with.sha256 = made_with.digest();
        }
        manifest.files.retain(|file| files.contains_key(&file.path));
        for (name, bytes) in &files {
            let (bytes, sha256) = (bytes.len() as u64, sha256_hex(bytes));
            match manifest.files.iter_mut().find(|file| file.path == *name) {
                Some(file) => (file.bytes, file.sha256) = (bytes, sha256),
                None => manifest.files.push(FileEntry {
                    path: name.clone(),
                    bytes,
                    sha256,
                }),
            }
        }
        files.insert("manifest.json".to_owned(), to_record(&manifest).unwrap());
        fs::create_dir_all(folder.join("plots")).unwrap();
        for (name, bytes) in &files {
            fs::write(folder.join(name), bytes).unwrap();
        }
    }

    fn rendering(&mut self) -> &mut fluxform::bundle::rendering::Rendering {
        self.map.runtime.rendering.as_mut().unwrap()
    }

    /// Heights in the map as the points have them.
    fn same_heights(&mut self) {
        let heights = HeightGrid::of_points(&self.manifest.points, &self.points).unwrap();
        self.rendering().heights = heights;
    }

    fn same_lambda(&mut self) {
        self.manifest.lambda.lambda_n_per_m = self.lambda.lambda_n_per_m;
        self.map.runtime.lambda_n_per_m = self.lambda.lambda_n_per_m;
    }

    fn same_currents(&mut self) {
        let currents: Vec<f64> = self.currents.iter().map(|row| row.current_a).collect();
        self.lambda.currents_a = Some(currents.clone());
        self.rendering().static_current_a = currents;
    }

    fn estimates(&mut self, value: f64) {
        for stage in self.manifest.accuracy.values_mut() {
            stage.estimate = value;
        }
        for stage in self.lambda.accuracy.values_mut() {
            stage.estimate = value;
        }
        self.manifest.map.interpolation.largest_error = value;
    }
}

fn twice(value: &mut Option<f64>) {
    *value = Some(2.0 * value.unwrap());
}

fn add_byte(parts: &mut Parts, name: &str, at: usize) {
    parts.others.get_mut(name).unwrap()[at] ^= 1;
}

/// Where a forgery shows when the bundle claims another platform too, where pages and last bits
/// cannot be compared.
#[derive(Clone, Copy, PartialEq)]
enum Elsewhere {
    Noticed,
    /// Only as something that could not be checked.
    Unchecked,
}
use Elsewhere::{Noticed, Unchecked};
use fluxform_testing::needs::Trial;
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [every_forgery_with_fitting_checksums_is_noticed, regression_what_steers_a_vector_was_believed_of_another_platform, regression_a_tilted_magnets_forces_were_believed_of_another_program, a_bundle_of_an_older_schema_is_compared_as_far_as_it_goes, missing_and_changed_inputs_are_stated, every_single_byte_edit_of_a_bundle_is_noticed],
    }
}

type Change = fn(&mut Parts);
type Forgery = (&'static str, Elsewhere, Change);

const FORGERIES: &[Forgery] = &[
    (
        "all gradients negated, errors of 1e9 stated",
        Noticed,
        |p| {
            p.map
                .gz_t_per_m_per_a
                .to_mut()
                .iter_mut()
                .for_each(|g| *g = -*g);
            p.estimates(1e9);
        },
    ),
    ("one gradient of many off by a millionth", Noticed, |p| {
        let gz = p.map.gz_t_per_m_per_a.to_mut();
        let largest = gz.iter().fold(0.0_f64, |most, g| most.max(g.abs()));
        gz[7] += 1e-6 * largest;
    }),
    ("errors stated a thousand times too large", Noticed, |p| {
        for stage in p.manifest.accuracy.values_mut() {
            stage.estimate = 1e3 * stage.estimate + 1e-3;
        }
    }),
    ("errors stated as nothing", Noticed, |p| {
        p.manifest.map.interpolation.largest_error = 0.0;
    }),
    ("words of an accuracy", Noticed, |p| {
        p.manifest.accuracy.get_mut("map").unwrap().method = "measured".into();
    }),
    ("doubled inductance", Noticed, |p| {
        let circuit = p.manifest.circuit.as_mut().unwrap();
        circuit
            .inductance_h
            .iter_mut()
            .flatten()
            .for_each(|l| *l *= 2.0);
        let all = circuit.inductance_h.concat();
        p.rendering().inductance_h = all;
    }),
    ("doubled voltage", Noticed, |p| {
        twice(&mut p.manifest.circuit.as_mut().unwrap().voltage_v);
        twice(&mut p.rendering().voltage_v);
    }),
    ("no voltage", Noticed, |p| {
        p.manifest.circuit.as_mut().unwrap().voltage_v = None;
        p.rendering().voltage_v = None;
    }),
    ("doubled resistance", Noticed, |p| {
        p.manifest.resistance_ohm.iter_mut().for_each(|r| *r *= 2.0);
        p.map
            .runtime
            .resistance_ohm
            .clone_from(&p.manifest.resistance_ohm);
    }),
    ("doubled upper limit", Noticed, |p| {
        p.manifest.limits.current_max_a[1] *= 2.0;
        p.map.runtime.current_max_a[1] *= 2.0;
    }),
    ("a lower limit", Noticed, |p| {
        p.manifest.limits.current_min_a[0] = -2.0;
        p.map.runtime.current_min_a[0] = -2.0;
    }),
    ("a limit of the sum", Noticed, |p| {
        p.manifest.limits.total_current_max_a = Some(100.0);
        p.map.runtime.total_current_max_a = Some(100.0);
    }),
    ("a foreign report.html", Unchecked, |p| {
        p.others
            .insert("report.html".into(), b"<h1>All is well</h1>".to_vec());
    }),
    ("one byte of report.html", Unchecked, |p| {
        add_byte(p, "report.html", 700)
    }),
    ("plots swapped", Unchecked, |p| {
        let one = p.others["plots/lambda.svg"].clone();
        let other = p.others.insert("plots/field.svg".into(), one).unwrap();
        p.others.insert("plots/lambda.svg".into(), other);
    }),
    ("a plot's table", Unchecked, |p| {
        add_byte(p, "plots/errors.csv", 90)
    }),
    ("a wrong digest of an input", Noticed, |p| {
        p.manifest.inputs[0].sha256 = sha256_hex(b"another design");
        p.lambda.inputs.clone_from(&p.manifest.inputs);
    }),
    ("a wrong digest of the shape", Noticed, |p| {
        p.manifest.inputs[1].sha256 = sha256_hex(b"another shape");
        p.lambda.inputs.clone_from(&p.manifest.inputs);
    }),
    ("an input more", Unchecked, |p| {
        p.manifest.inputs.push(Input::of_bytes("-", b"more"));
        p.lambda.inputs.clone_from(&p.manifest.inputs);
    }),
    ("no inputs", Noticed, |p| {
        p.manifest.inputs.clear();
        p.lambda.inputs.clear();
    }),
    ("another name of the design", Noticed, |p| {
        p.manifest.design = "large".into();
        p.lambda.design = "large".into();
    }),
    ("another name of the shape", Noticed, |p| {
        p.manifest.shape = "plane".into();
        p.lambda.shape = "plane".into();
    }),
    ("the design's copy", Noticed, |p| {
        let text = DESIGN.replace("length_mm = 70", "length_mm = 71");
        p.others.insert("design.toml".into(), text.into_bytes());
    }),
    ("the sentence on units", Noticed, |p| {
        p.manifest.units = "Gauss throughout".into()
    }),
    ("a newer minor schema", Unchecked, |p| {
        p.manifest.schema_version = "1.99.0".into();
        p.lambda.schema_version = "1.99.0".into();
    }),
    ("a schema in one file", Noticed, |p| {
        p.manifest.schema_version = "1.0.0".into()
    }),
    ("another program", Unchecked, |p| {
        p.manifest.fluxform_version = "9.0.0".into();
        p.lambda.fluxform_version = "9.0.0".into();
    }),
    ("a program with an evil name", Noticed, |p| {
        p.manifest.fluxform_version = "9.0.0".into();
    }),
    ("the coils' order", Noticed, |p| {
        p.manifest.array.positions_m.swap(0, 1);
        for (row, at) in p.currents.iter_mut().zip(&p.manifest.array.positions_m) {
            [row.x_m, row.y_m] = *at;
        }
    }),
    ("a coil's position", Noticed, |p| {
        p.manifest.array.positions_m[0][1] = 1e-5;
        p.currents[0].y_m = 1e-5;
    }),
    ("a gain", Noticed, |p| p.manifest.array.gain[0] = 1.001),
    ("the coupling", Noticed, |p| {
        p.manifest.array.coupling = "none, really".into()
    }),
    ("the magnet's moment", Noticed, |p| {
        p.manifest.magnet.moment_a_m2[2] *= 1.01;
        p.map.runtime.moment_a_m2[2] *= 1.01;
    }),
    ("the magnet's model", Noticed, |p| {
        p.manifest.magnet.model = "cylinder".into()
    }),
    ("the magnet's polarity", Noticed, |p| {
        p.manifest.magnet.polarity = "attract".into()
    }),
    ("the magnet's size", Noticed, |p| {
        p.manifest.magnet.length_m *= 2.0
    }),
    ("the chosen lambda", Noticed, |p| {
        twice(&mut p.lambda.lambda_n_per_m);
        p.same_lambda();
    }),
    ("no chosen lambda", Noticed, |p| {
        p.lambda.lambda_n_per_m = None;
        p.same_lambda();
    }),
    ("lambda by linear", Noticed, |p| {
        twice(&mut p.lambda.constants.lambda_linear_n_per_m)
    }),
    ("lambda by jnd", Noticed, |p| {
        twice(&mut p.lambda.constants.lambda_jnd_n_per_m)
    }),
    ("lambda by saturation", Noticed, |p| {
        twice(&mut p.lambda.constants.lambda_saturation_n_per_m)
    }),
    ("lambda by maxmin", Noticed, |p| {
        p.lambda.constants.lambda_maxmin_n_per_m = Some(3.3)
    }),
    ("lambda's floor", Noticed, |p| {
        twice(&mut p.lambda.constants.lambda_floor_n_per_m)
    }),
    ("lambda by the worst point", Noticed, |p| {
        twice(&mut p.lambda.worst_point.as_mut().unwrap().lambda_linear_n_per_m);
    }),
    ("lambda whose errors are not felt", Noticed, |p| {
        p.lambda.tolerance.as_mut().unwrap().lambda_n_per_m = Some(7.7);
    }),
    ("the criterion's name", Noticed, |p| {
        p.lambda.criterion = Criterion::Linear;
        p.manifest.lambda.criterion = Criterion::Linear;
    }),
    ("the just-noticeable difference", Noticed, |p| {
        p.lambda.jnd = 0.08
    }),
    ("a current", Noticed, |p| {
        p.currents[0].current_a -= 0.01;
        p.same_currents();
    }),
    ("currents swapped", Noticed, |p| {
        let [a, b] = [p.currents[0].current_a, p.currents[1].current_a];
        p.currents[0].current_a = b;
        p.currents[1].current_a = a + 1e-3;
        p.same_currents();
    }),
    ("a breakpoint's words", Noticed, |p| {
        p.lambda.path[0].event = "all is well".into()
    }),
    ("the rms error", Noticed, |p| {
        twice(&mut p.lambda.rms_error_n)
    }),
    ("the worst error", Noticed, |p| {
        twice(&mut p.lambda.worst_error_n)
    }),
    ("the relative error", Noticed, |p| {
        twice(&mut p.lambda.relative_rms_error)
    }),
    ("the rank", Noticed, |p| p.lambda.rank = 1),
    ("the number of points", Noticed, |p| p.lambda.points = 21),
    ("a point's height", Noticed, |p| {
        p.points[3].height_m += 1e-4;
        p.same_heights();
    }),
    ("a point's normal", Noticed, |p| {
        p.points[3].normal = [0.0, 0.6, 0.8]
    }),
    ("heights of two points swapped", Noticed, |p| {
        let [a, b] = [p.points[0].height_m, p.points[1].height_m];
        (p.points[0].height_m, p.points[1].height_m) = (b, a);
        p.same_heights();
    }),
    ("a point left out", Noticed, |p| {
        p.points.remove(0);
        p.manifest.points.count -= 1;
        p.manifest.points.present[0].replace_range(0..1, "0");
        p.same_heights();
    }),
    ("the grid of the map", Noticed, |p| {
        p.manifest.map.x_m.from_m *= 1.01;
        p.map.x_m.to_mut()[0] *= 1.01;
    }),
    ("the interpolation's words", Noticed, |p| {
        p.manifest.map.interpolation.borders = "periodic".into();
    }),
    ("the interpolation's order", Noticed, |p| {
        p.manifest.map.interpolation.order = 5
    }),
    ("the map's components", Noticed, |p| {
        p.manifest.map.components = "all".into()
    }),
    ("what was left out", Noticed, |p| {
        p.manifest.left_out.clear()
    }),
    ("what was not left out", Noticed, |p| {
        p.manifest.left_out.push(LeftOut {
            what: "gravity".into(),
            why: "not needed".into(),
            error_cost: Some(0.0),
        });
    }),
    ("the cost of leaving out", Noticed, |p| {
        p.manifest.left_out[0].error_cost = Some(0.5)
    }),
    ("the tolerance of the run", Noticed, |p| {
        p.options().tolerance = Some(1e-3);
    }),
    ("the reach of the map", Noticed, |p| {
        p.options().reach_m = 1e-3;
    }),
    ("a report that was not requested", Noticed, |p| {
        p.options().report = false;
    }),
    ("files for ParaView that are not there", Noticed, |p| {
        p.options().vtk = true;
    }),
    ("a report removed", Noticed, |p| {
        p.others.remove("report.html");
    }),
    ("no options", Unchecked, |p| p.manifest.made_with = None),
    ("a file more", Noticed, |p| {
        p.others.insert("plots/more.svg".into(), b"<svg/>".to_vec());
    }),
    ("a file less", Noticed, |p| {
        p.others.remove("plots/errors.csv");
    }),
    ("no design", Noticed, |p| {
        p.others.remove("design.toml");
    }),
    ("the files' order", Noticed, |p| p.manifest.files.swap(5, 6)),
    ("bytes behind the map", Noticed, |p| p.behind = vec![0; 3]),
];

/// Whether `verify` finds nothing wrong with the bundle, and whether it checked everything.
pub fn passes(verifier: &mut Verifier, folder: &Path) -> (bool, bool) {
    let options = VerifyOptions {
        accept_unchecked: true,
    };
    match verifier.verify(folder, options, &Silent) {
        Ok(report) => (report.passed, report.unchecked.is_empty()),
        Err(error) => {
            assert!(matches!(error.exit_code(), 3 | 5), "{error}");
            (false, true)
        }
    }
}

fn every_forgery_with_fitting_checksums_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let honest = Parts::of(&calibrated(folder.path(), DESIGN, SHAPE, true));
    let mut verifier = Verifier::default();
    let whole = folder.path().join("whole");
    honest.write(&whole);
    assert_eq!(
        passes(&mut verifier, &whole),
        (true, true),
        "taken apart, put together"
    );
    let mut missed = Vec::new();
    for (number, (name, elsewhere, forge)) in FORGERIES.iter().enumerate() {
        for claims_another_platform in [false, true] {
            let mut parts = honest.clone();
            forge(&mut parts);
            if let Some(made_with) = &mut parts.manifest.made_with
                && claims_another_platform
            {
                made_with.arithmetic = "pdp-11 unix, baseline".to_owned();
                assert_ne!(made_with.arithmetic, arithmetic());
            }
            let target = folder
                .path()
                .join(format!("{number}-{claims_another_platform}"));
            parts.write(&target);
            let (passed, complete) = passes(&mut verifier, &target);
            // Accepting what cannot be checked is for the user to decide.
            let excused = *elsewhere == Unchecked && !complete;
            if passed && !excused {
                missed.push((*name, claims_another_platform));
            }
        }
    }
    eprintln!(
        "{} forgeries, each twice, {} missed",
        FORGERIES.len(),
        missed.len()
    );
    assert!(FORGERIES.len() >= 42);
    assert_eq!(missed, []);
}

/// A force that pulled instead of pushing passed where the bundle named another platform.
fn regression_what_steers_a_vector_was_believed_of_another_platform() {
    let folder = tempfile::tempdir().unwrap();
    let design = format!("{DESIGN}[uncertainty]\nsensor_mm = 0.3\n");
    let shape = SHAPE.replace("[points]", "force = \"vertical-only\"\n[points]");
    let mut honest = Parts::of(&calibrated(folder.path(), &design, &shape, false));
    honest.options().arithmetic = "pdp-11 unix, baseline".to_owned();
    let mut verifier = Verifier::default();
    let forgeries: [(&str, bool, Change); 4] = [
        ("nothing", true, |_| {}),
        ("a direction", false, |p| {
            let requested = p.rendering().requested.as_mut().unwrap();
            requested
                .direction
                .iter_mut()
                .for_each(|part| *part = -*part);
        }),
        ("the price of power", false, |p| {
            p.rendering().robust.as_mut().unwrap().price_n2_per_w *= 1.01;
        }),
        ("where there is a surface", false, |p| {
            let has = &mut p.rendering().heights.has_height;
            has[0] = 1.0 - has[0];
        }),
    ];
    for (name, expected, forge) in forgeries {
        let mut parts = honest.clone();
        forge(&mut parts);
        let target = folder.path().join(name.replace(' ', "-"));
        parts.write(&target);
        assert_eq!(passes(&mut verifier, &target).0, expected, "{name}");
    }
}

/// The tensor that gives a tilted magnet's force was neither sampled nor named as not checked.
fn regression_a_tilted_magnets_forces_were_believed_of_another_program() {
    let folder = tempfile::tempdir().unwrap();
    let design = format!("{DESIGN}[magnet]\ntilt_deg = [5, 3]\n");
    let mut honest = Parts::of(&calibrated(folder.path(), &design, SHAPE, false));
    honest.manifest.fluxform_version = "0.0.9".to_owned();
    honest.lambda.fluxform_version = "0.0.9".to_owned();
    let mut verifier = Verifier::default();
    let forgeries: [(&str, Change); 3] = [
        ("nothing", |_| {}),
        ("every gradient", |p| {
            let tensors = p.map.gradient_t_per_m_per_a.as_mut().unwrap();
            tensors.to_mut().iter_mut().for_each(|part| *part *= 2.0);
        }),
        ("a gradient at the top", |p| {
            let tensors = p.map.gradient_t_per_m_per_a.as_mut().unwrap();
            *tensors.to_mut().last_mut().unwrap() *= 1.001;
        }),
    ];
    for (name, forge) in forgeries {
        let mut parts = honest.clone();
        forge(&mut parts);
        let target = folder.path().join(name.replace(' ', "-"));
        parts.write(&target);
        let (passed, _) = passes(&mut verifier, &target);
        assert_eq!(passed, name == "nothing", "{name}");
    }
}

/// A bundle as programs before schema 1.4 wrote it: without the run's options, in other words, and with
/// another piece at the end of the path, as forces that differ within their errors give it.
fn as_an_older_program_wrote_it(parts: &mut Parts) {
    for version in [
        &mut parts.manifest.schema_version,
        &mut parts.lambda.schema_version,
    ] {
        *version = "1.2.0".to_owned();
    }
    parts.manifest.made_with = None;
    for stage in parts.manifest.accuracy.values_mut() {
        stage.method = "in other words".to_owned();
        stage.estimate *= 30.0;
    }
    parts.lambda.path.pop();
    parts.others.remove("plots/errors.csv");
}

/// `verify` once called every difference in wording a fault of the bundle, and the whole of it wrong.
fn a_bundle_of_an_older_schema_is_compared_as_far_as_it_goes() {
    let folder = tempfile::tempdir().unwrap();
    let mut honest = Parts::of(&calibrated(folder.path(), DESIGN, SHAPE, true));
    as_an_older_program_wrote_it(&mut honest);
    let run = |parts: &Parts, name: &str, accept_unchecked| {
        let target = folder.path().join(name);
        if !target.exists() {
            parts.write(&target);
        }
        let options = VerifyOptions { accept_unchecked };
        Verifier::default()
            .verify(&target, options, &Silent)
            .unwrap()
    };
    let report = run(&honest, "older", false);
    assert!(report.checks.iter().all(|c| c.passed), "{report:?}");
    assert!(report.checks.len() > 5 && !report.passed, "{report:?}");
    let parts = report.unchecked.join("\n");
    for part in ["schema 1.2.0 do not name", "lambda.json path", "method"] {
        assert!(parts.contains(part), "{part}: {parts}");
    }
    assert!(run(&honest, "older", true).passed);
    for (name, forge) in [
        (
            "forged magnet",
            (|p| p.manifest.magnet.moment_a_m2[2] *= 1.01) as fn(&mut Parts),
        ),
        ("forged error", |p| {
            p.lambda.rms_error_n = p.lambda.rms_error_n.map(|n| 2.0 * n);
        }),
    ] {
        let mut forged = honest.clone();
        forge(&mut forged);
        let target = folder.path().join(name);
        forged.write(&target);
        let (passed, _) = passes(&mut Verifier::default(), &target);
        assert!(!passed, "{name}");
    }
    // With which flags a surface was given it does not state either.
    let surface = folder.path().join("slope.stl");
    fs::write(&surface, SHAPE).unwrap();
    let path = surface.display().to_string();
    for inputs in [&mut honest.manifest.inputs, &mut honest.lambda.inputs] {
        inputs[1].path.clone_from(&path);
    }
    let unplaced = run(&honest, "unplaced", true);
    let parts = unplaced.unchecked.join("\n");
    assert!(unplaced.passed && parts.contains("placed"), "{unplaced:?}");
}

fn missing_and_changed_inputs_are_stated() {
    let folder = tempfile::tempdir().unwrap();
    let bundle = calibrated(folder.path(), DESIGN, SHAPE, false);
    let run = |accept_unchecked| {
        let options = VerifyOptions { accept_unchecked };
        Verifier::default()
            .verify(&bundle, options, &Silent)
            .unwrap()
    };
    let whole = run(false);
    assert!(whole.passed && whole.unchecked.is_empty(), "{whole:?}");
    // The bundle keeps a copy of its design.
    let design = folder.path().join("small.toml");
    fs::remove_file(&design).unwrap();
    let kept = run(false);
    assert!(kept.passed && kept.notes.len() == 1, "{kept:?}");
    fs::write(&design, "name = \"changed\"\n").unwrap();
    let changed = run(true);
    assert!(
        !changed.passed
            && changed
                .checks
                .iter()
                .any(|c| c.name == "inputs" && !c.passed)
    );
    fs::write(&design, DESIGN).unwrap();
    fs::remove_file(folder.path().join("slope.toml")).unwrap();
    let missing = run(false);
    assert!(
        !missing.passed && missing.unchecked.len() == 1,
        "{missing:?}"
    );
    assert!(
        missing.checks.iter().all(|check| check.passed),
        "{missing:?}"
    );
    assert!(run(true).passed);
}

/// Of files with a checksum one byte in so many is changed.
const SAMPLED: usize = 13;

/// Bytes of every file changed; of the manifest, which no checksum covers, every byte: replaced,
/// blanked, removed or doubled in turn. `FLUXFORM_EVERY_EDIT=1` tries all of these and all bits on
/// every byte of every file.
fn every_single_byte_edit_of_a_bundle_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let bundle = calibrated(folder.path(), DESIGN, SHAPE, false);
    let manifest = Bundle::open(&bundle).unwrap().manifest;
    let mut names: Vec<&str> = manifest.files.iter().map(|f| f.path.as_str()).collect();
    names.push("manifest.json");
    let all = std::env::var_os("FLUXFORM_EVERY_EDIT").is_some();
    let mut verifier = Verifier::default();
    assert_eq!(passes(&mut verifier, &bundle), (true, true));
    let (mut edits, mut missed) = (0, Vec::new());
    for name in names {
        let path = bundle.join(name);
        let bytes = fs::read(&path).unwrap();
        let own = name == "manifest.json";
        let mut attempt = |edited: Vec<u8>, what: String| {
            fs::write(&path, edited).unwrap();
            edits += 1;
            let (passed, complete) = passes(&mut verifier, &bundle);
            if passed && complete {
                missed.push(format!("{name}: {what}"));
            }
        };
        let step = if own || all { 1 } else { SAMPLED };
        for at in (0..bytes.len()).step_by(step) {
            let byte = bytes[at];
            let mut values = Vec::new();
            let turn = if own { at % 4 } else { 0 };
            if all || turn == 0 {
                let digit = byte.is_ascii_digit();
                values.push(if digit {
                    b'0' + (byte - b'0' + 1) % 10
                } else {
                    byte ^ 1
                });
            }
            if all || turn == 1 {
                values.push(if byte == b' ' { b'\t' } else { b' ' });
            }
            if all {
                values.extend((0..8).map(|bit| byte ^ (1 << bit)));
            }
            for value in values {
                let mut edited = bytes.clone();
                edited[at] = value;
                attempt(edited, format!("byte {at} to {value:#x}"));
            }
            if all || turn == 2 {
                let mut edited = bytes.clone();
                edited.remove(at);
                attempt(edited, format!("byte {at} removed"));
            }
            if all || turn == 3 {
                let mut edited = bytes.clone();
                edited.insert(at, byte);
                attempt(edited, format!("byte {at} doubled"));
            }
        }
        fs::write(&path, &bytes).unwrap();
    }
    eprintln!("{edits} single-byte edits, {} missed", missed.len());
    assert!(missed.is_empty(), "{missed:?}");
}
