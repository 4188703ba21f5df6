//! STEP files: what OpenCASCADE reads of them, and what happens without it.
//!
//! Those that read bodies need a Python with `cadquery-ocp`: `python3`, or what `FLUXFORM_PYTHON`
//! names. Without one they are reported as ignored. The parts are made by `parts.py` beside this.

use std::path::Path;
use std::process::{Command, Output};

use fluxform_testing::needs::Trial;
use fluxform_testing::{needs, root, surface_files, trials};
use serde_json::Value;

use super::python;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            without_opencascade_the_message_names_how_step_is_read,
            anything_but_a_step_file_is_refused_before_python_starts,
            a_reader_that_answers_nonsense_is_refused,
            a_python_that_never_starts_is_not_waited_for,
            a_chord_and_a_body_are_for_step_alone,
        ],
        missing() => [
            a_box_is_a_box_in_its_own_unit,
            the_bore_of_a_nut_is_open,
            a_drilled_ball_is_not_its_plug,
            a_hole_that_opencascade_adds_to_the_body_is_refused,
            an_egg_has_its_volume,
            the_default_chord_is_of_the_box_of_the_body,
            the_tip_of_a_cone_is_met_and_nothing_crosses_there,
            the_accuracy_includes_the_facets,
            facets_of_splines_and_tori_lie_within_the_stated_chord,
            an_assembly_has_its_placements_names_and_colours,
            angles_in_degrees_are_read,
            a_root_placement_is_warned_of,
            a_body_is_chosen_by_name_or_number,
            a_reading_that_takes_too_long_is_ended,
            hostile_files_end_in_a_message,
            a_bundle_of_a_step_file_is_verified,
        ],
    }
}

fn missing() -> Option<String> {
    let there = needs::answers(python(), &["-I", "-c", "import OCP.STEPCAFControl"]);
    (!there).then(|| "Python with cadquery-ocp".to_owned())
}

fn fluxform(arguments: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fluxform"));
    if !arguments.contains(&"--python") {
        command.arg("--python").arg(python());
    }
    command
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap()
}

fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with the parts in it.
fn parts() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let made = Command::new(python())
        .arg(root().join("tests/programs/step/parts.py"))
        .arg(folder.path())
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", text(&made));
    folder
}

fn boxed(change: &dyn Fn(String) -> String) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let sample = String::from_utf8(surface_files::step()).unwrap();
    std::fs::write(folder.path().join("part.step"), change(sample)).unwrap();
    folder
}

fn json(output: &Output) -> Value {
    assert!(output.status.success(), "{}", text(output));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn inspected(name: &str, more: &[&str], folder: &Path) -> Value {
    let arguments = [&["discretize", name, "--inspect", "--format", "json"], more].concat();
    json(&fluxform(&arguments, folder))
}

/// x, y and height of each point, mm, and the deviation of the facets that is stated.
fn heights(name: &str, more: &[&str], folder: &Path) -> (Vec<[f64; 3]>, f64) {
    let fixed = ["discretize", name, "--format", "json", "--force"];
    let summary = json(&fluxform(&[&fixed, more].concat(), folder));
    let table = std::fs::read_to_string(folder.join("points.csv")).unwrap();
    let row = |line: &str| {
        let mut cells = line
            .split(',')
            .map(|cell| 1e3 * cell.parse::<f64>().unwrap());
        [0; 3].map(|_| cells.next().unwrap())
    };
    let rows = table.lines().skip(1).map(row).collect();
    let stated = summary["accuracy"]["tessellation"]["estimate"].as_f64();
    (rows, 1e3 * stated.unwrap())
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

fn near(found: &[f64], expected: &[f64], most: f64) {
    assert_eq!(found.len(), expected.len());
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) <= most, "{found:?} {expected:?}");
}

fn without_opencascade_the_message_names_how_step_is_read() {
    let folder = boxed(&|text| text);
    let said = fluxform(
        &["--python", "no-such-python", "discretize", "part.step"],
        folder.path(),
    );
    assert_eq!(said.status.code(), Some(3));
    let said = text(&said);
    for part in [
        "no-such-python",
        "pip install cadquery-ocp",
        "FLUXFORM_PYTHON",
        "3MF or STL",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

fn anything_but_a_step_file_is_refused_before_python_starts() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.stp"), "solid x").unwrap();
    let arguments = ["--python", "no-such-python", "discretize", "part.stp"];
    let said = text(&fluxform(&arguments, folder.path()));
    assert!(said.contains("not a STEP file"), "{said}");
}

#[cfg(unix)]
fn write_program(path: &Path, text: &str) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// Whatever stands in for Python, no number of it is believed unchecked.
#[cfg(unix)]
fn a_reader_that_answers_nonsense_is_refused() {
    let part = r#"{"points":9,"triangles":3,"deviation":0.1,"area":1,"volume":1,"mended":false}"#;
    let body =
        r#"{"part":0,"place":[[1,0,0,0],[0,1,0,0],[0,0,1,0]],"name":"","within":[],"color":null}"#;
    let result = |part: &str, body: &str| {
        format!(
            r#"{{"result":{{"unit_mm":1,"chord_mm":0.1,"loose":0,"moved_roots":0,"invalid":0,"bodies":[{body}],"parts":[{part}]}}}}"#
        )
    };
    let cases = [
        ("no json".to_owned(), "no proper result"),
        (String::new(), "ended before it read anything"),
        (result(part, body), "no proper result"),
        (
            result(part, &body.replace("\"part\":0", "\"part\":7")),
            "no proper result",
        ),
        (
            result(&part.replace(":9,", ":99999999999999,"), body),
            "no proper result",
        ),
        (result(&part.replace("0.1", "-1"), body), "no proper result"),
        (r#"{"refused":"a reason"}"#.to_owned(), "a reason"),
        (
            r#"{"missing":"a module"}"#.to_owned(),
            "pip install cadquery-ocp",
        ),
    ];
    for (answer, expected) in cases {
        let folder = boxed(&|text| text);
        let fake = folder.path().join("fake");
        std::fs::write(folder.path().join("answer"), format!("{answer}\n")).unwrap();
        let script = "#!/bin/sh\ncat > /dev/null\ncat \"$(dirname \"$0\")/answer\"\n";
        let silent = "#!/bin/sh\nexit 7\n";
        write_program(&fake, if answer.is_empty() { silent } else { script });
        let fake = fake.display().to_string();
        let said = fluxform(
            &["--python", &fake, "discretize", "part.step"],
            folder.path(),
        );
        assert_eq!(said.status.code(), Some(3), "{answer}");
        assert!(text(&said).contains(expected), "{answer}: {}", text(&said));
    }
}

#[cfg(not(unix))]
fn a_reader_that_answers_nonsense_is_refused() {}

/// It uses no processor time, so its own limit never ends it.
#[cfg(unix)]
fn a_python_that_never_starts_is_not_waited_for() {
    let folder = boxed(&|text| text);
    let fake = folder.path().join("fake");
    write_program(&fake, "#!/bin/sh\nexec sleep 100000\n");
    let fake = fake.display().to_string();
    let arguments = [
        "--python",
        &fake,
        "--step-seconds",
        "1",
        "discretize",
        "part.step",
    ];
    let said = fluxform(&arguments, folder.path());
    assert_eq!(said.status.code(), Some(3));
    let said = text(&said);
    for part in ["does not start", "pip install cadquery-ocp", "3MF or STL"] {
        assert!(said.contains(part), "{part}: {said}");
    }
}

#[cfg(not(unix))]
fn a_python_that_never_starts_is_not_waited_for() {}

fn a_chord_and_a_body_are_for_step_alone() {
    let flat = root().join("shapes/flat.stl").display().to_string();
    let folder = tempfile::tempdir().unwrap();
    for more in [["--chord", "0.1mm"], ["--body", "1"]] {
        let arguments = [&["discretize", &flat, "--unit", "mm"][..], &more].concat();
        let said = text(&fluxform(&arguments, folder.path()));
        assert!(said.contains("of STEP files alone"), "{said}");
    }
}

fn a_box_is_a_box_in_its_own_unit() {
    let folder = parts();
    for (name, unit_mm) in [("box.step", 1.0), ("inch.step", 25.4)] {
        let report = inspected(name, &[], folder.path());
        let surface = &report["surface"];
        assert_eq!(surface["unit_m"].as_f64(), Some(unit_mm / 1e3), "{name}");
        assert_eq!(surface["watertight"], true);
        assert_eq!(surface["triangles"], 12);
        let sides = [0.7, 1.3, 2.9].map(|side| side / unit_mm);
        near(&numbers(&surface["bounds_max"]), &sides, 1e-9);
        let volume = surface["volume"].as_f64().unwrap();
        near(&[volume], &[sides.iter().product()], 1e-9);
        assert!(
            surface["read_by"]
                .as_str()
                .unwrap()
                .starts_with("OpenCASCADE")
        );
    }
}

/// A false skin closed it, with heights 2.35 mm too high.
fn the_bore_of_a_nut_is_open() {
    let folder = parts();
    let grid = ["--grid", "41x41", "--translate", "0,0,10"];
    let (rows, stated) = heights("nut.step", &grid, folder.path());
    assert!(stated > 0.0 && stated < 0.01, "{stated}");
    for [x, y, height] in rows {
        let r = x.hypot(y);
        assert!(
            r > 3.35 - 2.0 * stated,
            "a point in the bore: {x} {y} {height}"
        );
        // Flat outside the countersink, whose slope is 1.
        let exact = 15.3 - (4.1 - r).clamp(0.0, 0.75);
        assert!(
            (height - exact).abs() < 3.0 * stated + 1e-6,
            "{x} {y} {height} {exact}"
        );
    }
}

/// 5388 mm^3 of 262,684 were read, without a word: the seam of the ball was lost.
fn a_drilled_ball_is_not_its_plug() {
    let folder = parts();
    let surface = &inspected("drilled.step", &["--chord", "0.2mm"], folder.path())["surface"];
    near(&numbers(&surface["bounds_max"]), &[40.0; 3], 0.2);
    near(&numbers(&surface["bounds_min"]), &[-40.0; 3], 0.2);
    let volume = surface["volume"].as_f64().unwrap();
    assert!((volume - 262_683.66).abs() < 1e-2 * volume, "{volume}");
    assert_eq!(surface["self_intersections"], 0);
}

/// Neither way to read it gives the body; the volumes of ball and plug were added.
fn a_hole_that_opencascade_adds_to_the_body_is_refused() {
    let folder = parts();
    let said = fluxform(
        &[
            "discretize",
            "slanted.step",
            "--inspect",
            "--chord",
            "0.2mm",
        ],
        folder.path(),
    );
    assert_eq!(said.status.code(), Some(3));
    let said = text(&said);
    assert!(
        said.contains("holes of its faces") && said.contains("3MF or STL"),
        "{said}"
    );
}

/// Its volume was integrated to 191,498 mm^3, 0.8 % too little, and so its mesh was refused.
fn an_egg_has_its_volume() {
    let folder = parts();
    let surface = &inspected("egg.step", &["--chord", "0.03mm"], folder.path())["surface"];
    let volume = surface["volume"].as_f64().unwrap();
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 60.0 * 32.0 * 24.0;
    assert!((volume - exact).abs() < 2e-3 * exact, "{volume} {exact}");
}

/// It was half as long again: of the box of the egg's poles.
fn the_default_chord_is_of_the_box_of_the_body() {
    let folder = parts();
    let grid = ["--grid", "5x5", "--rest-on", "0mm"];
    let (_, stated) = heights("egg.step", &grid, folder.path());
    let chord = 2.0 * (60.0f64 * 60.0 + 32.0 * 32.0 + 24.0 * 24.0).sqrt() / 4000.0;
    assert!(
        stated <= 1.001 * chord && stated > 0.5 * chord,
        "{stated} {chord}"
    );
}

/// Facets at the tip were said to lie 0.3 mm off, and to pass through each other: the angle that the tip
/// has of its own is any.
fn the_tip_of_a_cone_is_met_and_nothing_crosses_there() {
    let folder = parts();
    let surface = &inspected("cone.step", &[], folder.path())["surface"];
    let warnings = surface["warnings"].to_string();
    assert!(!warnings.contains("pass through each other"), "{warnings}");
    assert!(!warnings.contains("lie up to"), "{warnings}");
    let (rows, stated) = heights("cone.step", &["--grid", "31x31"], folder.path());
    assert!(stated < 0.0261, "{stated}");
    for [x, y, height] in rows {
        let exact = 60.0 - 2.0 * x.hypot(y);
        assert!(
            (height - exact).abs() < 3.0 * stated,
            "{x} {y} {height} {exact}"
        );
    }
}

/// Heights to 4 nm were stated of facets that lie 0.03 mm off.
fn the_accuracy_includes_the_facets() {
    let folder = parts();
    let arguments = [
        "discretize",
        "nut.step",
        "--grid",
        "9x9",
        "--rest-on",
        "0mm",
    ];
    let made = fluxform(&arguments, folder.path());
    assert!(made.status.success(), "{}", text(&made));
    let said = String::from_utf8_lossy(&made.stdout);
    assert!(
        said.contains("of the facets, which lie within") && said.contains("(measured)"),
        "{said}"
    );
    let summary = std::fs::read_to_string(folder.path().join("points.json")).unwrap();
    assert!(summary.contains("\"tessellation\"") && !summary.contains("is not in the file"));
}

fn facets_of_splines_and_tori_lie_within_the_stated_chord() {
    let folder = parts();
    for chord in [0.05, 0.01] {
        let length = format!("{chord}mm");
        let more = ["--grid", "61x61", "--rest-on", "0mm", "--chord", &length];
        let (rows, stated) = heights("dome.step", &more, folder.path());
        assert!(stated <= chord && stated > 0.1 * chord, "{stated} {chord}");
        let mut worst = 0.0f64;
        for [x, y, height] in rows {
            let r = x.hypot(y);
            let sphere = (r < 7.0).then(|| 2.0 + (49.0 - r * r).sqrt());
            let off = (r - 9.7).abs();
            let ring = (off < 1.3).then(|| (1.69 - off * off).sqrt());
            let exact = sphere.into_iter().chain(ring).fold(0.0, f64::max) + 8.0;
            // Distances of facets are along the normal; walls and the sphere's equator apart.
            let steep = (6.0..7.2).contains(&r) || (1.0..1.5).contains(&off);
            if !steep {
                worst = worst.max((height - exact).abs());
            }
        }
        assert!(worst <= 2.0 * stated, "{worst} {stated}");
    }
}

fn an_assembly_has_its_placements_names_and_colours() {
    let folder = parts();
    let report = inspected("assembly.step", &[], folder.path());
    let bodies = report["surface"]["named_bodies"].as_array().unwrap();
    let names: Vec<_> = bodies
        .iter()
        .map(|body| body["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["plate", "pin", "pin"]);
    assert_eq!(bodies[0]["color"], serde_json::json!([1.0, 0.0, 0.0]));
    assert!(
        bodies
            .iter()
            .all(|body| body["within"] == serde_json::json!(["fixture"]))
    );
    near(
        &numbers(&report["surface"]["bounds_max"]),
        &[40.0, 30.0, 14.0],
        1e-9,
    );
    // The second pin is turned: 2 mm along x, to the left of where it is, 8 mm along y.
    let grid = ["--grid", "81x61", "--rest-on", "0mm"];
    let (rows, _) = heights("assembly.step", &grid, folder.path());
    let inside = |x: f64, [from, to]: [f64; 2]| x > from + 1e-6 && x < to - 1e-6;
    for [x, y, height] in rows {
        let pin = (inside(x, [5.0, 13.0]) && inside(y, [6.0, 8.0]))
            || (inside(x, [28.0, 30.0]) && inside(y, [10.0, 18.0]));
        if pin {
            assert!((height - 14.0).abs() < 1e-9, "{x} {y} {height}");
        }
        if y > 18.1 {
            assert!((height - 3.0).abs() < 1e-9, "{x} {y} {height}");
        }
    }
}

fn angles_in_degrees_are_read() {
    let folder = parts();
    let path = folder.path().join("nut.step");
    let radians = std::fs::read_to_string(&path).unwrap();
    let unit = "SI_UNIT($,.RADIAN.)";
    assert!(radians.contains(unit));
    let place = radians.find(unit).unwrap();
    let start = radians[..place].rfind('#').unwrap();
    let end = start + radians[start..].find(';').unwrap();
    let id = radians[start..].split('=').next().unwrap().trim();
    let degree = format!(
        "{id}=(CONVERSION_BASED_UNIT('DEGREE',#99001)NAMED_UNIT(#99003)PLANE_ANGLE_UNIT());\n\
         #99001=PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(1.7453292519943295E-2),#99002);\n\
         #99002=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));\n\
         #99003=DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.)"
    );
    let mut text = format!("{}{degree}{}", &radians[..start], &radians[end..]);
    // Half angles of cones are the last number of their statements.
    let cones: Vec<String> = text
        .split(";\n")
        .filter(|line| line.contains("CONICAL_SURFACE("))
        .map(str::to_owned)
        .collect();
    assert!(!cones.is_empty());
    for cone in cones {
        let (head, angle) = cone.rsplit_once(',').unwrap();
        let angle: f64 = angle.trim_end_matches(')').trim().parse().unwrap();
        text = text.replace(&cone, &format!("{head},{:.12})", angle.to_degrees()));
    }
    std::fs::write(folder.path().join("degrees.step"), text).unwrap();
    let grid = ["--grid", "33x33", "--rest-on", "0mm"];
    let (expected, _) = heights("nut.step", &grid, folder.path());
    let (found, stated) = heights("degrees.step", &grid, folder.path());
    assert!(stated < 0.01 && found.len().abs_diff(expected.len()) < 8);
    let slope = found.iter().filter(|[x, y, _]| x.hypot(*y) < 3.9);
    for [x, y, height] in slope {
        let exact = 5.3 - (4.1 - x.hypot(*y));
        assert!(
            (height - exact).abs() < 3.0 * stated + 1e-6,
            "{x} {y} {height}"
        );
    }
}

/// A placement at the root was read past without a word.
fn a_root_placement_is_warned_of() {
    let folder = parts();
    let path = folder.path().join("box.step");
    let text = std::fs::read_to_string(&path).unwrap();
    // The first placement is that of the representation's own frame.
    let of = |id: &str| {
        let start = text.find(&format!("\n{id} = ")).unwrap() + 1;
        start..start + text[start..].find(';').unwrap()
    };
    let items = text.find("ADVANCED_BREP_SHAPE_REPRESENTATION(").unwrap();
    let first = text[items..].split_once("(#").unwrap().1;
    let frame = format!("#{}", first.split(',').next().unwrap());
    let frame = of(&frame);
    let head = text[frame.clone()].split(" = ").next().unwrap();
    let moved = format!(
        "{}{head} = AXIS2_PLACEMENT3D('',#99912,#99913,#99914);\n\
         #99912 = CARTESIAN_POINT('',(1.5,2.5,3.5));\n\
         #99913 = DIRECTION('',(0.,0.,1.));\n#99914 = DIRECTION('',(0.,1.,0.)){}",
        &text[..frame.start],
        &text[frame.end..]
    );
    std::fs::write(&path, moved).unwrap();
    let report = inspected("box.step", &[], folder.path());
    // As OpenCASCADE has it, and the standard: such a placement is there to be referred to.
    near(
        &numbers(&report["surface"]["bounds_max"]),
        &[0.7, 1.3, 2.9],
        1e-9,
    );
    let warnings = report["surface"]["warnings"].to_string();
    assert!(warnings.contains("1 placements at its root"), "{warnings}");
}

fn a_body_is_chosen_by_name_or_number() {
    let folder = parts();
    for (which, upper) in [
        ("plate", 3.0),
        ("1", 3.0),
        ("pin", 14.0),
        ("2", 14.0),
        ("fixture", 14.0),
    ] {
        let report = inspected("assembly.step", &["--body", which], folder.path());
        let bounds = numbers(&report["surface"]["bounds_max"]);
        assert!((bounds[2] - upper).abs() < 1e-9, "{which}: {bounds:?}");
    }
    let arguments = ["discretize", "assembly.step", "--inspect", "--body", "nail"];
    let said = text(&fluxform(&arguments, folder.path()));
    assert!(
        said.contains("no body `nail`") && said.contains("1 plate, 2 pin, 3 pin"),
        "{said}"
    );
}

/// The time that loading OpenCASCADE takes once counted, so that a slow machine's Python "ended before it read anything".
#[cfg(unix)]
fn a_reading_that_takes_too_long_is_ended() {
    let folder = parts();
    // A Python that takes more than the limit to start.
    let slow = folder.path().join("slow");
    let busy = "import time\nwhile time.process_time() < 1.5: pass\n";
    let script = format!(
        "#!/bin/sh\ntext=\"{busy}$3\"\nflags=\"$1 $2\"\nshift 3\nexec {} $flags \"$text\" \"$@\"\n",
        python().display()
    );
    write_program(&slow, &script);
    let arguments = [
        "--python",
        slow.to_str().unwrap(),
        "--step-seconds",
        "1",
        "discretize",
        "dome.step",
        "--chord",
        "0.00001mm",
    ];
    let said = fluxform(&arguments, folder.path());
    assert_eq!(said.status.code(), Some(3));
    let said = text(&said);
    assert!(
        said.contains("1 s of processor time") && said.contains("longer --chord"),
        "{said}"
    );
}

#[cfg(not(unix))]
fn a_reading_that_takes_too_long_is_ended() {}

fn hostile_files_end_in_a_message() {
    let with = |statements: String| {
        boxed(&move |text| text.replace("DATA;\n", &format!("DATA;\n{statements}")))
    };
    let cases = [
        with(format!("#9000=X({});\n", "(".repeat(500_000))),
        with("#9000=TRIMMED_CURVE('',#9000,(),(),.T.,.CARTESIAN.);\n".to_owned()),
        boxed(&|text| text[..text.len() / 2].to_owned()),
        boxed(&|text| text.replace("0.700", "1.E400")),
        boxed(&|text| text.replace("0.700", "0.000")),
        boxed(&|text| text.replace("MANIFOLD_SOLID_BREP", "SHELL_BASED_SURFACE_MODEL")),
    ];
    for folder in cases {
        let output = fluxform(
            &["--step-seconds", "20", "discretize", "part.step"],
            folder.path(),
        );
        let code = output.status.code();
        assert!(
            code == Some(3) || code == Some(0),
            "{code:?} {}",
            text(&output)
        );
        let said = text(&output);
        assert!(
            !said.contains("panicked") && (code == Some(0) || said.contains("error[E3")),
            "{said}"
        );
    }
}

fn a_bundle_of_a_step_file_is_verified() {
    let folder = parts();
    let design = root().join("designs/seed_air.toml").display().to_string();
    let arguments = [
        "calibrate",
        &design,
        "nut.step",
        "--fit",
        &design,
        "--grid",
        "9x9",
        "--out",
        "b",
    ];
    let made = fluxform(
        &[&arguments[..], &["--chord", "0.02mm"]].concat(),
        folder.path(),
    );
    assert!(made.status.success(), "{}", text(&made));
    let mut bundles = std::fs::read_dir(folder.path().join("b")).unwrap();
    let mut found = Vec::new();
    while let Some(Ok(entry)) = bundles.next() {
        found.extend(
            std::fs::read_dir(entry.path())
                .into_iter()
                .flatten()
                .flatten(),
        );
    }
    let bundle = found
        .iter()
        .map(|entry| entry.path())
        .find(|path| path.join("manifest.json").exists());
    let bundle = bundle
        .unwrap_or_else(|| folder.path().join("b"))
        .display()
        .to_string();
    let manifest = std::fs::read_to_string(Path::new(&bundle).join("manifest.json")).unwrap();
    assert!(
        manifest.contains("OpenCASCADE") && manifest.contains("\"chord_m\""),
        "{manifest}"
    );
    let verified = fluxform(&["verify", &bundle], folder.path());
    assert!(verified.status.success(), "{}", text(&verified));
}
