//! Every error code: what it says, on both kinds of standard error, and the text of `--explain`.

use std::collections::BTreeSet;

use fluxform::bundle::artefact::sha256_hex;

use crate::SEED;
use fluxform_testing::bundle::resealed;
use fluxform_testing::place::Place;

/// Codes that nothing outside brings about at will: a mistake of the program, a machine that starts
/// no process, and Ctrl-C, which `interrupt.rs` sends. Unit tests hold the first two.
const NOT_HERE: [&str; 3] = ["E101", "E408", "E130"];

/// A code, the arguments that end with it, and the essence of what is said: file, line or key, what
/// was expected, what to do.
type Case = (
    &'static str,
    &'static [&'static str],
    &'static [&'static str],
);

const CASES: &[Case] = &[
    (
        "E201",
        &["lambda", SEED, "shapes/flat.toml", "--tolerance", "3"],
        &["--tolerance", "1e-15 to 1e-1"],
    ),
    ("E201", &["evaluat", SEED], &["evaluat", "evaluate"]),
    (
        "E201",
        &["evaluate", SEED, "--strickt"],
        &["--strickt", "--strict"],
    ),
    ("E201", &["lambda", "-", "-"], &["-", "read once"]),
    ("E201", &["--quiet"], &["requires a subcommand"]),
    (
        "E201",
        &["--explain", "E999"],
        &["E999", "list", "E301", "E502"],
    ),
    (
        "E202",
        &["discretize", "shapes/wedge.stl"],
        &["shapes/wedge.stl", "carries no unit", "--unit", "mm"],
    ),
    (
        "E202",
        &["calibrate", SEED, "shapes/wedge.stl"],
        &["shapes/wedge.stl", "--unit"],
    ),
    (
        "E301",
        &["evaluate", "bad.toml"],
        &["bad.toml", "array.pich_mm", "did you mean pitch_mm?"],
    ),
    (
        "E301",
        &["evaluate", "none.toml"],
        &["none.toml", "check the path"],
    ),
    (
        "E302",
        &["probe", SEED, "bad.csv"],
        &["bad.csv:3", "column z_m", "expected a finite number", "far"],
    ),
    (
        "E302",
        &["probe", SEED, "short.csv"],
        &["short.csv:1", "column z_m is missing", "expected a header"],
    ),
    (
        "E303",
        &["probe", SEED, "none.csv"],
        &["none.csv", "cannot be read"],
    ),
    (
        "E303",
        &["probe", SEED, "shapes"],
        &["shapes", "expected a CSV table", "found a directory"],
    ),
    (
        "E303",
        &["discretize", "bad.csv", "--unit", "mm"],
        &["bad.csv", "expected a shape file", ".stl"],
    ),
    (
        "E303",
        &["sweep", "run", "bad.csv", "--out", "points"],
        &["bad.csv"],
    ),
    (
        "E304",
        &["calibrate", SEED, "shapes/flat.toml", "shapes/flat.toml"],
        &["two shapes are called \"flat\""],
    ),
    (
        "E304",
        &["probe", SEED, "edge.csv"],
        &["point 1 (", "coil 4", "edge"],
    ),
    (
        "E305",
        &["lambda", SEED, "cut.stl", "--unit", "mm"],
        &["cut.stl"],
    ),
    (
        "E305",
        &[
            "discretize",
            "shapes/wedge.stl",
            "--unit",
            "mm",
            "--x",
            "500,600",
        ],
        &["wedge"],
    ),
    (
        "E306",
        &["verify", "shapes"],
        &["shapes", "not a bundle", "manifest.json"],
    ),
    (
        "E306",
        &["replay", "shapes", "walk.csv", "--out", "r.csv"],
        &["shapes", "not a bundle", "manifest.json"],
    ),
    (
        "E306",
        &["verify", "newer"],
        &["newer", "schema_version", "update fluxform"],
    ),
    (
        "E307",
        &["probe", SEED, "--compare", "few.csv"],
        &["few.csv", "1 measured value", "expected at least", "--fit"],
    ),
    (
        "E302",
        &["probe", SEED, "--compare", "bad.csv"],
        &["bad.csv:1", "bx_t, by_t, bz_t"],
    ),
    (
        "E401",
        &["evaluate", SEED, "--strict"],
        &["not met", "resistance", "winding fill"],
    ),
    (
        "E402",
        &["lambda", "attract.toml", "shapes/flat.toml"],
        &["lambda is null for flat", "warnings"],
    ),
    (
        "E402",
        &["replay", "null/seed_air/flat", "walk.csv", "--out", "r.csv"],
        &["null/seed_air/flat", "calibrate with other limits"],
    ),
    (
        "E403",
        &["evaluate", SEED, "--tolerance", "1e-15"],
        &[
            "or the default) was not reached",
            "the result itself is given",
        ],
    ),
    (
        "E404",
        &["optimize", "narrow.toml"],
        &["limits.resistance_max_ohm"],
    ),
    (
        "E405",
        &["discretize", "shapes/flat.toml", "--out", "bad.csv"],
        &["bad.csv exists", "--force", "another output"],
    ),
    (
        "E405",
        &["map", SEED, "--out", "theirs"],
        &["theirs", "--force"],
    ),
    (
        "E406",
        &["discretize", "shapes/flat.toml", "--out", "shapes"],
        &["shapes is a folder", "expected a file name"],
    ),
    (
        "E406",
        &["map", SEED, "--out", "bad.csv/maps"],
        &["bad.csv", "not a folder", "another output"],
    ),
    (
        "E406",
        &["discretize", "shapes/flat.toml", "--out", "/dev/full"],
        &["/dev/full", "the disk is full"],
    ),
    (
        "E407",
        &["sweep", "merge", "plan.json", "points"],
        &["2 of 2 points are missing", "sweep run", "--partial"],
    ),
    (
        "E409",
        &[
            "calibrate",
            SEED,
            "shapes/wedge.stl",
            "--unit",
            "m",
            "--grid",
            "3x3",
        ],
        &["wholly outside", "--unit mm"],
    ),
    (
        "E501",
        &["verify", "edited"],
        &["edited", "failed", "inputs"],
    ),
    (
        "E502",
        &["verify", "cut"],
        &[
            "currents.csv",
            "changed or damaged",
            "make the bundle again",
        ],
    ),
];

/// A folder in which every case can be brought about.
fn prepared() -> Place {
    let place = Place::new();
    let seed = place.text(SEED);
    place.write("bad.toml", &seed.replace("pitch_mm", "pich_mm"));
    place.write("attract.toml", &seed.replace("\"repel\"", "\"attract\""));
    place.write(
        "narrow.toml",
        "name = \"narrow\"\n[wire]\ndiameter_mm = 0.7\n[limits]\ninner_diameter_min_mm = 30.0\n\
         outer_diameter_max_mm = 38.0\nlength_max_mm = 100.0\nresistance_max_ohm = 0.0007\n",
    );
    place.write("bad.csv", "x_m,y_m,z_m\n0.1,0.2,0.3\n0.1,0.2,far\n");
    place.write("short.csv", "x_m,y_m\n0.1,0.2\n");
    place.write(
        "few.csv",
        "x_m,y_m,z_m,coil,current_a,bz_t\n0.01,0.02,0.03,4,1.3,0.0001\n",
    );
    // On the inner edge of the middle coil's top face.
    place.write("edge.csv", "x_m,y_m,z_m\n0.012,0,0\n");
    place.write(
        "walk.csv",
        "t_s,x_m,y_m,z_m\n0,0.01,0.02,0.05\n0.1,0.01,0.02,0.06\n",
    );
    place.write("cut.stl", "solid a\nfacet normal 0 0 1\nouter loop\n");
    for folder in ["theirs", "newer"] {
        place.folder(folder);
    }
    place.write("theirs/map.npz", "precious");

    let small = "name = \"flat\"\nprimitive = \"flat\"\n[points]\nx_mm = [-50.0, 50.0, 9]\n\
                 y_mm = [-50.0, 50.0, 9]\n";
    place.write("small.toml", small);
    place
        .run(&["calibrate", SEED, "small.toml", "--no-report"])
        .ends(0);
    let args = ["calibrate", "attract.toml", "small.toml", "--no-report"];
    place.run(&[&args[..], &["--out", "null"]].concat()).ends(4);
    let bundle = "results/seed_air/flat";
    for copy in ["edited", "cut"] {
        place.copy(bundle, copy);
    }
    let manifest = String::from_utf8(place.read(&format!("{bundle}/manifest.json"))).unwrap();
    let version = manifest.split("\"schema_version\": \"").nth(1).unwrap();
    let version = &version[..version.find('"').unwrap()];
    place.write("newer/manifest.json", &manifest.replace(version, "7.0.0"));
    place.write("cut/currents.csv", "coil,x_m,y_m,current_a\n");
    // Another design under a right checksum: lambda.json names the other one.
    let design = String::from_utf8(place.read("edited/design.toml")).unwrap();
    let wrong = design.replace("turns = 1429", "turns = 1428");
    assert_ne!(design, wrong);
    place.write("edited/design.toml", &wrong);
    let [old, new] = [&design, &wrong].map(|text| sha256_hex(text.as_bytes()));
    place.write(
        "edited/manifest.json",
        &resealed(&manifest.replace(&old, &new)),
    );
    let plan = ["sweep", "plan", SEED, "--set", "coil.turns=700,710"];
    place
        .run(&[&plan[..], &["--out", "plan.json"]].concat())
        .ends(0);
    place.folder("points");
    place
}

#[test]
fn every_code_is_printed_with_its_explanation() {
    let place = prepared();
    let mut met: BTreeSet<String> = NOT_HERE.map(str::to_owned).into();
    for (code, args, words) in CASES {
        met.insert((*code).to_owned());
        let exit: i32 = code[1..2].parse().unwrap();
        let human = place.run(args).ends(exit);
        let marked = format!("error[{code}]:");
        assert!(human.err.contains(&marked), "{args:?}: {}", human.err);
        let reported = place.run(&[args, &["--format", "json"][..]].concat());
        let reported = reported.ends(exit);
        assert_eq!(
            reported.err.trim_end().lines().count(),
            1,
            "{args:?}: {}",
            reported.err
        );
        let error = reported.error()["error"].clone();
        assert_eq!(error["code"], *code, "{args:?}");
        assert_eq!(error["exit_code"], exit);
        let text = error.to_string().replace("\\\"", "\"");
        for word in *words {
            assert!(
                human.err.contains(word),
                "{args:?}: {word:?}: {}",
                human.err
            );
            // A document's place stands in fields of its own.
            let inside = text.contains(word) || word.contains(".csv:");
            assert!(inside, "{args:?}: {word:?}: {text}");
        }
        if exit == 3 {
            let faults = error["faults"].as_array().unwrap();
            assert!(!faults.is_empty(), "{args:?}: {text}");
            assert!(faults.iter().all(|fault| fault["message"].is_string()));
        }
    }
    // Nothing was written where it was refused.
    assert_eq!(place.read("theirs/map.npz"), b"precious");
    let listed = place.run(&["--explain", "list"]).ends(0).out;
    let listed: BTreeSet<String> = listed
        .lines()
        .skip(1)
        .map(|line| line.split_whitespace().next().unwrap().to_owned())
        .collect();
    assert_eq!(met, listed);
}

#[test]
fn a_fault_is_reported_to_programs_with_its_place() {
    let place = prepared();
    let reported = place.run(&["probe", SEED, "bad.csv", "--format", "json"]);
    let fault = reported.ends(3).error()["error"]["faults"][0].clone();
    assert_eq!(fault["file"], "bad.csv");
    assert_eq!(fault["line"], 3);
    assert_eq!(fault["key"], "z_m");
    assert_eq!(fault["expected"], "a finite number");
    let reported = place.run(&["evaluate", "bad.toml", "--format", "json"]);
    let fault = reported.ends(3).error()["error"]["faults"][0].clone();
    assert_eq!(fault["file"], "bad.toml");
    assert_eq!(fault["key"], "array.pich_mm");
    assert_eq!(fault["advice"], "did you mean pitch_mm?");
    assert!(fault["column"].is_u64(), "{fault}");
}

#[test]
fn a_summary_that_belongs_to_standard_error_goes_into_the_error() {
    let place = Place::new();
    place.write("points.csv", "x_m,y_m,z_m\n0.007,0.013,0.03\n");
    let args = ["probe", SEED, "points.csv", "--tolerance", "1e-15"];
    // The table in the object on standard output, the error alone on standard error.
    let ran = place
        .run(&[&args[..], &["--format", "json"]].concat())
        .ends(4);
    assert_eq!(ran.json()["points"], 1);
    assert_eq!(ran.error()["error"]["code"], "E403");
    // An optimum's design on standard output, its summary and the error on standard error.
    let seed = place.text(SEED);
    place.write("tight.toml", &seed);
    let args = ["optimize", "tight.toml", "--out", "-", "--format", "json"];
    let ran = place.run(&args).ends(0);
    assert!(ran.out.starts_with("name") || ran.out.starts_with('#'));
    assert!(ran.error()["objective"]["force_n"].is_number());
    let args = [&args[..], &["--tolerance", "1e-15"]].concat();
    let ran = place.run(&args);
    if ran.code == Some(4) {
        let error = ran.error()["error"].clone();
        assert_eq!(error["code"], "E403");
        assert!(error["summary"]["objective"]["force_n"].is_number());
    }
}

#[test]
fn codes_are_explained() {
    let place = Place::new();
    let list = place.run(&["--explain", "list"]).ends(0);
    assert!(list.err.is_empty());
    for code in list.out.lines().skip(1) {
        let code = code.split_whitespace().next().unwrap();
        let reported = place.run(&["--explain", code]).ends(0).out;
        assert!(reported.starts_with(&format!("{code}: ")), "{reported}");
        for part in ["exit code", "Causes:", "What to do:", "Example:"] {
            assert!(reported.contains(part), "{code}: {part}");
        }
        assert!(reported.lines().all(|line| line.len() <= 110), "{reported}");
    }
    let three = place.run(&["--explain", "3"]).ends(0).out;
    assert!(three.contains("E301: ") && three.contains("E306: ") && !three.contains("E401: "));
    let json = place
        .run(&["--explain", "e405", "--format", "json"])
        .ends(0);
    let reported = json.json()["codes"][0].clone();
    assert_eq!(reported["code"], "E405");
    assert_eq!(reported["exit_code"], 4);
    assert!(
        reported["explanation"]
            .as_str()
            .unwrap()
            .contains("--force")
    );
    // The subcommand's own --explain is another matter.
    let plan = ["calibrate", SEED, "shapes/flat.toml", "--explain"];
    place.run(&plan).ends(0);
}
