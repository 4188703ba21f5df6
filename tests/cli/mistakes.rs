//! Mistakes that people make: each ends with one message that says what to do.

use crate::SEED;
use fluxform_testing::place::Place;

const BALL: &str = "shapes/half_sphere.toml";

/// A mistake: arguments, exit code, and what the message says.
type Mistake = (&'static [&'static str], i32, &'static [&'static str]);

const MISTAKES: &[Mistake] = &[
    // A flag whose required flag another one excludes had no effect, without a word.
    (
        &["discretize", BALL, "--center", "--scale-to-fit"],
        2,
        &["--scale-to-fit", "cannot be used with", "--center"],
    ),
    (
        &["discretize", BALL, "--rest-on", "20mm", "--scale-to-fit"],
        2,
        &["--scale-to-fit", "cannot be used with", "--rest-on"],
    ),
    // Both set the height, and --rest-on won without a word.
    (
        &["discretize", BALL, "--fit", SEED, "--rest-on", "20mm"],
        2,
        &["--rest-on", "cannot be used with", "--fit"],
    ),
    // Of a vertical force it changed nothing.
    (
        &[
            "lambda",
            SEED,
            BALL,
            "--feedback",
            "--direction-jnd",
            "5deg",
        ],
        3,
        &["--direction-jnd", "--force-direction vertical-only"],
    ),
    // A body without a name was every body.
    (&["discretize", BALL, "--body", ""], 2, &["--body"]),
    (
        &["discretize", "nameless.toml"],
        3,
        &["body: names no body", "leave the key out"],
    ),
    (
        &["discretize", BALL, "--out", "a.csv", "--over", SEED],
        2,
        &["--over", "cannot be used with", "--out"],
    ),
    (
        &["lambda", SEED, BALL, "--max-deviation", "1mm", "--refine"],
        2,
        &["--max-deviation", "cannot be used with", "--refine"],
    ),
    (
        &[
            "lambda",
            SEED,
            BALL,
            "--poisson",
            "5mm",
            "--max-width",
            "1mm",
        ],
        2,
        &["--poisson", "cannot be used with", "--max-width"],
    ),
    (
        &["discretize", BALL, "--max-deviation", "1mm", "--seed", "4"],
        2,
        &["--max-deviation", "cannot be used with", "--seed"],
    ),
    (
        &["probe", SEED, "tabs.csv", "--noise-t", "2e-6"],
        2,
        &["cannot be used with", "--noise-t"],
    ),
    // What grids alone have, neither refused nor done for other points.
    (
        &[
            "discretize",
            BALL,
            "--max-deviation",
            "1mm",
            "--holes",
            "error",
        ],
        2,
        &["--max-deviation", "cannot be used with", "--holes"],
    ),
    (
        &[
            "discretize",
            BALL,
            "--poisson",
            "3mm",
            "--certify",
            "distance",
        ],
        2,
        &["--poisson", "cannot be used with", "--certify"],
    ),
    (
        &[
            "discretize",
            BALL,
            "--max-deviation",
            "1mm",
            "--certify-seconds",
            "3",
        ],
        2,
        &[
            "--max-deviation",
            "cannot be used with",
            "--certify-seconds",
        ],
    ),
    (
        &["lambda", SEED, BALL, "--poisson", "5mm", "--grid", "9x9"],
        2,
        &["--poisson", "cannot be used with", "--grid"],
    ),
    (
        &["discretize", BALL, "--inspect", "--weights", "area"],
        2,
        &["--inspect", "cannot be used with", "--weights"],
    ),
    // A shape where the design belongs was 15 errors on 173 lines.
    (
        &["lambda", "shapes/flat.toml", SEED],
        2,
        &["shapes/flat.toml is a shape", "the order is DESIGN SHAPE"],
    ),
    (
        &["calibrate", "shapes/flat.stl", SEED],
        2,
        &["shapes/flat.stl is a shape", "the order is DESIGN SHAPE"],
    ),
    (
        &["evaluate", "shapes/flat.toml"],
        2,
        &["is a shape", "expected a DESIGN"],
    ),
    (
        &["discretize", SEED],
        2,
        &["is a design", "expected a SHAPE"],
    ),
    // Tables of spreadsheets.
    (
        &["probe", SEED, "semicolons.csv"],
        3,
        &["semicolons.csv:1", "separated by semicolons"],
    ),
    (
        &["probe", SEED, "tabs.csv"],
        3,
        &["separated by tabs, expected commas"],
    ),
    (
        &["probe", SEED, "commas.csv"],
        3,
        &["commas.csv:2", "decimal points, 0.7 for 0,7"],
    ),
    (
        &["probe", SEED, "quoted.csv"],
        3,
        &["column x_m", "write a decimal point, 0.1"],
    ),
    (
        &["probe", SEED, "marked.csv"],
        3,
        &[
            "marked.csv:1: the text is not UTF-8 but UTF-16",
            "CSV in UTF-8",
        ],
    ),
    (
        &["probe", SEED, "unmarked.csv"],
        3,
        &["unmarked.csv:1: the text is not UTF-8 but UTF-16"],
    ),
    (
        &["probe", SEED, "empty.csv"],
        3,
        &["the table is empty", "x_m,y_m,z_m"],
    ),
    (
        &["probe", SEED, "millimetres.csv"],
        3,
        &[
            "columns x_m, y_m, z_m are missing",
            "divide those in mm by 1000",
        ],
    ),
    (
        &["probe", SEED, "nameless.csv"],
        3,
        &["columns x_m, y_m, z_m are missing", "separated by commas"],
    ),
    (&["probe", SEED, "header.csv"], 3, &["a header and no rows"]),
    (&["probe", SEED, "many.csv"], 3, &["and 25 faults more"]),
    // Numbers of other notations.
    (
        &["evaluate", "decimal.toml"],
        3,
        &["write a decimal point: pitch_mm = 50.5"],
    ),
    (
        &["evaluate", "semicolon.toml"],
        3,
        &["write pitch_mm = 50.5, with nothing behind"],
    ),
    (
        &["evaluate", "unit.toml"],
        3,
        &["write pitch_mm = 50.5: the unit is in the key's name"],
    ),
    (
        &["evaluate", "text.toml"],
        3,
        &["array.pitch_mm", "write 50.5 without quotes and unit"],
    ),
    (
        &["evaluate", "inches.toml"],
        3,
        &["without quotes", "holds its unit, mm"],
    ),
    (
        &["evaluate", "remanence.toml"],
        3,
        &["magnetization_a_per_m = 1.0345e6", "B_r / mu_0"],
    ),
    // Lengths on flags.
    (
        &[
            "calibrate",
            SEED,
            "shapes/flat.toml",
            "--reach",
            "2furlongs",
        ],
        2,
        &["mm, cm, m, in, ft, um"],
    ),
    // An unset variable of a script.
    (
        &["calibrate", SEED, "shapes/flat.toml", "--out", ""],
        2,
        &["a value is required for '--out <DIR>'"],
    ),
    (
        &["init", "--out", ""],
        2,
        &["a value is required for '--out <DIR>'"],
    ),
    (&["map", SEED, "--plot", ""], 2, &["like plot.svg"]),
    // Bundles and what follows them.
    (
        &["replay", "results/seed_air/flat"],
        2,
        &["t_s,x_m,y_m,z_m", "--synthesize scan|circle|explore"],
    ),
    (
        &["verify", "results"],
        3,
        &["is not a bundle", "bundles below it: results/seed_air/flat"],
    ),
    (
        &["verify", "results/no_such"],
        3,
        &["results/no_such: no such folder"],
    ),
    (
        &["replay", "results/seed_air", "walk.csv"],
        3,
        &["bundles below it: results/seed_air/flat"],
    ),
    (
        &["verify", "cut"],
        5,
        &["error[E502]", "changed or damaged"],
    ),
    (
        &["replay", "cut", "--synthesize", "circle", "--out", "r.csv"],
        5,
        &["error[E502]", "changed or damaged"],
    ),
];

fn prepared() -> Place {
    let place = Place::new();
    let table = |name: &str, text: &str| place.write(name, text);
    table("semicolons.csv", "x_m;y_m;z_m\n0,1;0,2;0,3\n0,1;0,2;0,3\n");
    table("millimetres.csv", "x_mm,y_mm,z_mm\n0,0,30\n");
    table("nameless.csv", "x;y;z\n0,1;0,2;0,3\n");
    table("tabs.csv", "x_m\ty_m\tz_m\n0.1\t0.2\t0.3\n");
    table("commas.csv", "x_m,y_m,z_m\n0,1,0,2,0,3\n");
    table("quoted.csv", "x_m,y_m,z_m\n\"0,1\",0.2,0.3\n");
    for (name, text, order) in [
        (
            "marked.csv",
            "\u{feff}x_m,y_m,z_m\r\n0.1,0.2,0.3\r\n",
            u16::to_le_bytes as fn(u16) -> [u8; 2],
        ),
        (
            "unmarked.csv",
            "x_m,y_m,z_m\r\n0.1,0.2,0.3\r\n",
            u16::to_be_bytes,
        ),
    ] {
        let bytes: Vec<u8> = text.encode_utf16().flat_map(order).collect();
        place.write(name, &bytes);
    }
    table(
        "nameless.toml",
        "name = \"parts\"\nsurface = \"parts.step\"\nbody = \"\"\n",
    );
    table("empty.csv", "");
    table("header.csv", "x_m,y_m,z_m\n");
    table(
        "many.csv",
        &format!("x_m,y_m,z_m\n{}", "far,0.2,0.3\n".repeat(30)),
    );
    table(
        "walk.csv",
        "t_s,x_m,y_m,z_m\n0,0.01,0.02,0.05\n0.1,0.01,0.02,0.06\n",
    );
    let seed = place.text(SEED);
    let pitch = |name: &str, value: &str| {
        let text = seed.replace("pitch_mm = 50.0", &format!("pitch_mm = {value}"));
        assert_ne!(text, seed);
        place.write(name, &text);
    };
    pitch("decimal.toml", "50,5");
    pitch("semicolon.toml", "50.5;");
    pitch("unit.toml", "50.5 mm");
    pitch("text.toml", "\"50.5 mm\"");
    pitch("inches.toml", "\"2 in\"");
    let remanence = seed.replace("magnetization_a_per_m = 1.1579e6", "remanence_t = 1.3");
    assert_ne!(remanence, seed);
    place.write("remanence.toml", &remanence);
    let small = "name = \"flat\"\nprimitive = \"flat\"\n[points]\nx_mm = [-50.0, 50.0, 5]\n\
                 y_mm = [-50.0, 50.0, 5]\n";
    place.write("small.toml", small);
    place
        .run(&["calibrate", SEED, "small.toml", "--no-report"])
        .ends(0);
    place.copy("results/seed_air/flat", "cut");
    place.write("cut/currents.csv", "coil,x_m,y_m,current_a\n");
    place
}

#[test]
fn every_mistake_has_one_message_that_says_what_to_do() {
    let place = prepared();
    for (args, exit, words) in MISTAKES {
        let ran = place.run(args).ends(*exit);
        let said = ran.err.clone();
        for word in *words {
            let flat = said.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(
                said.contains(word) || flat.contains(word),
                "{args:?}: {word:?}: {said}"
            );
        }
        let errors = said.matches("error[").count();
        assert_eq!(errors, 1, "{args:?}: {said}");
        assert!(said.lines().count() <= 24, "{args:?}: {said}");
        // No line is there twice.
        let mut lines: Vec<&str> = said.lines().filter(|line| line.len() > 20).collect();
        lines.sort_unstable();
        let all = lines.len();
        lines.dedup();
        assert_eq!(lines.len(), all, "{args:?}: {said}");
    }
}

#[test]
fn points_in_millimetres_are_warned_of() {
    let place = Place::new();
    place.write("points.csv", "x_m,y_m,z_m\n0.007,0.013,20\n");
    let ran = place.run(&["probe", SEED, "points.csv"]).ends(0);
    ran.says(&["warning: ", "not in metres", "divide millimetres by 1000"]);
}

#[test]
fn lengths_take_units_and_a_bare_number_is_millimetres() {
    let place = Place::new();
    let run = |reach: &str| {
        let args = [
            "discretize",
            "shapes/wedge.stl",
            "--unit",
            "mm",
            "--grid",
            "3x3",
        ];
        place
            .run(&[&args[..], &["--out", "-", "--translate", reach]].concat())
            .ends(0)
            .out
    };
    assert_eq!(run("0,0,20"), run("0,0,2cm"));
    assert_eq!(run("0,0,20"), run("0mm,0,0.02m"));
}

#[test]
fn help_is_a_command_and_fits_on_one_screen() {
    let place = Place::new();
    let page = place.run(&["help"]).ends(0).out;
    assert_eq!(page, place.run(&["--help"]).ends(0).out);
    let page = place.run(&["help", "sweep", "plan"]).ends(0).out;
    assert_eq!(page, place.run(&["sweep", "plan", "--help"]).ends(0).out);
    let mut lengths = Vec::new();
    for path in crate::help::commands() {
        let line = format!("COLUMNS=80 fluxform {} -h", path.join(" "));
        let brief = place.shell(&line);
        assert_eq!(brief.code, Some(0), "{line}: {}", brief.err);
        lengths.push((brief.out.lines().count(), path.join(" ")));
    }
    let long: Vec<_> = lengths
        .iter()
        .filter(|(lines, _)| *lines > SCREEN)
        .collect();
    assert!(long.is_empty(), "more than {SCREEN} lines: {long:?}");
    let plan = place.run(&["sweep", "plan", "-h"]).ends(0).out;
    assert!(
        plan.contains("FROM:TO:STEP") && plan.contains("A,B,C"),
        "{plan}"
    );
}

/// Lines of a terminal that was not made larger.
const SCREEN: usize = 24;
