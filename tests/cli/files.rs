//! Files: what is replaced, what is refused, and that bytes depend on nothing but the inputs.

use crate::SEED;
use fluxform_testing::place::Place;
use fluxform_testing::run::Ran;

#[test]
fn what_is_not_ours_is_replaced_only_with_force() {
    let place = Place::new();
    place.write("points.csv", "precious\n");
    let args = ["discretize", "shapes/flat.toml", "--out", "points.csv"];
    place.run(&args).ends(4).says(&["points.csv", "--force"]);
    assert_eq!(place.read("points.csv"), b"precious\n");
    place.run(&[&args[..], &["--force"]].concat()).ends(0);
    assert!(place.read("points.csv").starts_with(b"x_m,"));
    // The same inputs: ours.
    place.run(&args).ends(0);
    let other = ["discretize", "shapes/wedge.toml", "--out", "points.csv"];
    place.run(&other).ends(4);

    place.run(&["map", SEED, "--out", "maps"]).ends(0);
    place.run(&["map", SEED, "--out", "maps"]).ends(0);
    place.write("other.toml", &place.text(SEED).replace("1429", "1400"));
    place.run(&["map", "other.toml", "--out", "maps"]).ends(4);
    place
        .run(&["map", "other.toml", "--out", "maps", "--force"])
        .ends(0);

    place.run(&["calibrate", SEED, "shapes/flat.toml"]).ends(0);
    place.run(&["calibrate", SEED, "shapes/flat.toml"]).ends(0);
    let reported = place.run(&[
        "calibrate",
        "other.toml",
        "shapes/flat.toml",
        "--format",
        "json",
    ]);
    assert_eq!(reported.ends(4).error()["error"]["exit_code"], 4);
    place.write("points_in.csv", "x_m,y_m,z_m\n0.007,0.013,0.03\n");
    let probe = ["probe", SEED, "points_in.csv", "--out", "points.csv"];
    place.run(&probe).ends(4).says(&["points.csv"]);
}

#[test]
fn an_impossible_output_folder_is_reported() {
    let place = Place::new();
    place.write("file", "");
    place
        .run(&["map", SEED, "--out", "file/maps"])
        .ends(4)
        .says(&["file", "not a folder"]);
    place
        .run(&["calibrate", SEED, "shapes/flat.toml", "--out", "/proc/none"])
        .ends(4)
        .says(&["/proc/none"]);
    place
        .run(&["discretize", "shapes/flat.toml", "--out", "shapes"])
        .ends(4)
        .says(&["shapes"]);
}

#[test]
fn bytes_do_not_depend_on_threads() {
    let place = Place::new();
    for threads in ["1", "2"] {
        let out = format!("with{threads}");
        let args = [
            "calibrate",
            SEED,
            "shapes/half_sphere.toml",
            "--threads",
            threads,
        ];
        place.run(&[&args[..], &["--out", &out]].concat()).ends(0);
    }
    for file in [
        "manifest.json",
        "map.npz",
        "points.csv",
        "currents.csv",
        "lambda.json",
    ] {
        let [one, two] =
            ["1", "2"].map(|n| place.read(&format!("with{n}/seed_air/half-sphere/{file}")));
        assert!(one == two, "{file} differs");
    }
    let [one, two] = ["1", "2"].map(|threads| {
        let args = ["lambda", SEED, "shapes/wedge.toml", "--format", "json"];
        place
            .run(&[&args[..], &["--threads", threads]].concat())
            .ends(0)
            .out
    });
    assert_eq!(one, two);
}

#[test]
fn a_bundle_is_verified_and_a_changed_one_fails() {
    let place = Place::new();
    place.run(&["calibrate", SEED, "shapes/flat.toml"]).ends(0);
    let bundle = "results/seed_air/flat";
    let ran = place.run(&["verify", bundle]).ends(0);
    assert!(
        ran.out.contains("passed") && ran.out.contains("duality gap"),
        "{}",
        ran.out
    );
    let currents = format!("{bundle}/currents.csv");
    let text = String::from_utf8(place.read(&currents)).unwrap();
    place.write(
        &currents,
        &text.replace("2.0", "1.9").replace(",2\n", ",1.9\n"),
    );
    place
        .run(&["verify", bundle])
        .ends(5)
        .says(&["currents.csv"]);
    let reported = place.run(&["verify", bundle, "--format", "json"]).ends(5);
    assert_eq!(reported.error()["error"]["exit_code"], 5);
}

#[test]
fn summaries_answer_what_how_good_and_where() {
    let place = Place::new();
    let table = place.run(&["calibrate", SEED, "shapes/flat.toml", "shapes/wedge.toml"]);
    let table = table.ends(0).out;
    for part in [
        "2 shapes on seed_air",
        "wedge",
        "0.22115",
        "jnd at 7 %",
        "left out",
        "results/seed_air: 2 bundles",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let lambda = place.run(&["lambda", SEED, "shapes/half_sphere.toml"]);
    let lambda = lambda.ends(0).out;
    for part in [
        "lambda 0.1154 +- 0.0008 N/m",
        "rank 9 of 9",
        "900 grid points",
        "2.0000",
    ] {
        assert!(lambda.contains(part), "{part}: {lambda}");
    }
    for line in table.lines().chain(lambda.lines()) {
        assert_eq!(line, line.trim_end());
    }
}

/// Every file below, links by where they lead.
#[allow(clippy::disallowed_methods)] // a test's own look
fn tree(folder: &std::path::Path) -> std::collections::BTreeMap<std::path::PathBuf, Vec<u8>> {
    let mut found = std::collections::BTreeMap::new();
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        let kind = path.symlink_metadata().unwrap();
        if kind.is_symlink() {
            let to = std::fs::read_link(&path).unwrap();
            found.insert(path, to.into_os_string().into_encoded_bytes());
        } else if kind.is_dir() {
            found.extend(tree(&path));
            found.insert(path, Vec::new());
        } else {
            found.insert(path.clone(), std::fs::read(&path).unwrap());
        }
    }
    found
}

#[test]
#[allow(clippy::disallowed_methods)] // a test's own traps
fn a_link_named_like_a_folder_put_aside_empties_no_folder() {
    let place = Place::new();
    let calibrate = ["calibrate", SEED, "shapes/flat.toml", "--out", "results"];
    place.run(&calibrate).ends(0);
    std::fs::create_dir_all(place.path("victim/deep")).unwrap();
    place.write("victim/deep/thesis.tex", "years");
    let victim = place.path("victim");
    let kept = place.path("results/seed_air/.fluxform-cache");
    let _ = std::fs::remove_dir_all(&kept);
    let own = "results/seed_air";
    for name in [
        ".flat.fluxform-old",
        ".flat.0-0.fluxform-old",
        ".fluxform-1.tmp",
    ] {
        std::os::unix::fs::symlink(&victim, place.path(&format!("{own}/{name}"))).unwrap();
    }
    std::os::unix::fs::symlink(&victim, &kept).unwrap();
    place.write("other.toml", &place.text(SEED).replace("1429", "1400"));
    let before = tree(&place.path("."));
    let refused = ["calibrate", "other.toml", "shapes/flat.toml"];
    place.run(&[&refused[..], &["--no-cache"]].concat()).ends(4);
    assert!(
        tree(&place.path(".")) == before,
        "refused, and changed something"
    );
    place.run(&calibrate).ends(0);
    place
        .run(&[&calibrate[..], &["--no-cache", "--force"]].concat())
        .ends(0);
    assert!(kept.is_symlink());
    assert_eq!(place.read("victim/deep/thesis.tex"), b"years");
    assert_eq!(tree(&victim).len(), 2);
}

#[test]
fn no_input_becomes_an_output() {
    const DESIGN: &str = "d/seed_air.toml";
    let place = Place::new();
    // Not the repository's own.
    place.copy("designs", "d");
    place.copy("shapes", "s");
    let discretize = ["discretize", "s/flat.toml", "--out", "s/flat.csv"];
    place.run(&discretize).ends(0);
    let flat = place.read("s/flat.toml");
    let seed = place.read(DESIGN);
    place.write("points_in.csv", "x_m,y_m,z_m\n0.007,0.013,0.03\n");
    let points = place.read("points_in.csv");
    let attempts: [&[&str]; 6] = [
        &["discretize", "s/flat.toml", "--out", "s/flat.toml"],
        &[
            "discretize",
            "s/flat.toml",
            "--out",
            "-",
            "--plot",
            "s/flat.toml",
        ],
        &["probe", DESIGN, "points_in.csv", "--out", "points_in.csv"],
        &["probe", DESIGN, "points_in.csv", "--out", DESIGN],
        &["lambda", DESIGN, "s/flat.toml", "--plot", DESIGN],
        &[
            "sweep",
            "plan",
            DESIGN,
            "--set",
            "wire.diameter_mm=0.5,0.7",
            "--out",
            DESIGN,
        ],
    ];
    for attempt in attempts {
        for force in [&[][..], &["--force"]] {
            let ran = place.run(&[attempt, force].concat());
            match attempt.contains(&"--plot") {
                // No file that is read ends as a picture does.
                true => ran.ends(2).says(&[".svg, .png, .pdf"]),
                false => ran.ends(4).says(&["is read by this very run"]),
            };
        }
    }
    assert_eq!(place.read("s/flat.toml"), flat);
    assert_eq!(place.read(DESIGN), seed);
    assert_eq!(place.read("points_in.csv"), points);
}

#[test]
fn only_what_a_sidecar_lists_unchanged_is_replaced() {
    let place = Place::new();
    place.run(&["calibrate", SEED, "shapes/flat.toml"]).ends(0);
    let bundle = "results/seed_air/flat";
    let replay = ["replay", bundle, "--synthesize", "circle"];
    let to = |out: &str| place.run(&[&replay[..], &["--out", out]].concat());
    to("felt.csv").ends(0);
    to("felt.csv").ends(0);
    // The same sidecar, another table.
    place.write("felt.txt", "mine");
    to("felt.txt").ends(4).says(&["felt.txt"]);
    assert_eq!(place.read("felt.txt"), b"mine");
    place.write("felt.csv", "edited");
    to("felt.csv").ends(4).says(&["changed since"]);
    assert_eq!(place.read("felt.csv"), b"edited");
    // The bundle that is read, with --force too.
    let manifest = place.read(&format!("{bundle}/manifest.json"));
    for out in ["points.csv", "map.npz", "manifest.csv"] {
        let out = format!("{bundle}/{out}");
        let forced = [&replay[..], &["--force", "--out", &out]].concat();
        place
            .run(&forced)
            .ends(4)
            .says(&["is read by this very run"]);
    }
    assert_eq!(place.read(&format!("{bundle}/manifest.json")), manifest);
    place.run(&["verify", bundle]).ends(0);
    // Two outputs of one command.
    let twice = [&replay[..], &["--out", "a.svg", "--plot", "./a.svg"]].concat();
    place
        .run(&twice)
        .ends(4)
        .says(&["another file of this command"]);
    let twice = [
        "optimize", SEED, "--starts", "1", "--out", "z.html", "--report", "z.html",
    ];
    place
        .run(&twice)
        .ends(4)
        .says(&["another file of this command"]);
    place.write("mine.svg", "<svg/>");
    let drawn = [&replay[..], &["--out", "-", "--plot", "mine.svg"]].concat();
    place.run(&drawn).ends(4).says(&["mine.svg"]);
    assert_eq!(place.read("mine.svg"), b"<svg/>");

    place.run(&["map", SEED, "--out", "maps"]).ends(0);
    place.write("maps/map.csv", "mine");
    place
        .run(&["map", SEED, "--out", "maps", "--csv"])
        .ends(4)
        .says(&["map.csv"]);
    assert_eq!(place.read("maps/map.csv"), b"mine");
}

#[test]
fn a_user_s_page_in_a_bundle_is_named_and_never_lost() {
    let place = Place::new();
    let bare = ["calibrate", SEED, "shapes/flat.toml", "--no-report"];
    place.run(&bare).ends(0);
    let bundle = "results/seed_air/flat";
    for name in ["report.html", "timing_notes.txt", "notes.txt"] {
        place.write(&format!("{bundle}/{name}"), "mine");
    }
    place.run(&bare).ends(0);
    place
        .run(&bare[..3])
        .ends(4)
        .says(&["report.html", "--force"]);
    assert_eq!(place.read(&format!("{bundle}/report.html")), b"mine");
    place.run(&[&bare[..3], &["--force"]].concat()).ends(0);
    for name in ["report.html.kept-1", "timing_notes.txt", "notes.txt"] {
        assert_eq!(place.read(&format!("{bundle}/{name}")), b"mine", "{name}");
    }
    place.run(&["verify", bundle]).ends(0);
}

#[test]
#[allow(clippy::disallowed_methods)] // a test's own traps
fn a_sweep_follows_no_link_below_its_folder() {
    let place = Place::new();
    let plan = ["sweep", "plan", SEED, "--set", "wire.diameter_mm=0.5,0.7"];
    place
        .run(&[&plan[..], &["--out", "plan.json"]].concat())
        .ends(0);
    std::fs::create_dir_all(place.path("victim/000")).unwrap();
    place.write("victim/000/000000.json", "mine");
    std::fs::create_dir(place.path("out")).unwrap();
    std::os::unix::fs::symlink(place.path("victim"), place.path("out/points")).unwrap();
    for force in [&[][..], &["--force"]] {
        let run = ["sweep", "run", "plan.json", "--out", "out"];
        place.run(&[&run[..], force].concat()).ends(4);
    }
    assert_eq!(place.read("victim/000/000000.json"), b"mine");
    assert!(!place.path("victim/000/000001.json").exists());
}

/// Every command with a record: the same options again, others, others with force.
#[test]
fn what_other_options_made_is_replaced_with_force_alone() {
    let place = Place::new();
    let bundle = "results/seed_air/flat";
    let calibrate = ["calibrate", SEED, "shapes/flat.toml", "--no-report"];
    let discretize = ["discretize", "shapes/wedge.toml", "--out", "p.csv"];
    let stl = [
        "discretize",
        "shapes/wedge.stl",
        "--unit=mm",
        "--translate=0,0,30",
        "--grid=9x9",
        "--out=s.csv",
    ];
    let replay = ["replay", bundle, "--synthesize", "circle", "--out", "r.csv"];
    for (line, other, named, file) in [
        (
            &calibrate[..],
            &["--jnd", "0.01"][..],
            "jnd 0.07, now 0.01",
            "results/seed_air/flat/lambda.json",
        ),
        (
            &calibrate,
            &["--criterion", "linear"],
            "criterion \"jnd\", now \"linear\"",
            "results/seed_air/flat/lambda.json",
        ),
        (
            &calibrate,
            &["--reach", "7"],
            "reach_m 0.02, now 0.007",
            "results/seed_air/flat/map.npz",
        ),
        (
            &calibrate,
            &["--at", "3"],
            "at_n_per_m not given, now 3.0",
            "results/seed_air/flat/lambda.json",
        ),
        (
            &["map", SEED, "--out", "maps"],
            &["--components", "gradient"],
            "components \"gz\", now \"gradient\"",
            "maps/map.npz",
        ),
        (
            &["map", SEED, "--out", "maps2"],
            &["--tolerance", "1e-6"],
            "tolerance not given, now 1e-6",
            "maps2/map.json",
        ),
        (
            &discretize,
            &["--certify", "no"],
            "certify \"vertical\", now \"no\"",
            "p.json",
        ),
        (
            &discretize,
            &["--poisson", "3mm"],
            "spacing_m not given, now 0.003",
            "p.csv",
        ),
        (
            &stl,
            &["--scale", "0.7"],
            "surface.scale [1.0,1.0,1.0], now [0.7,0.7,0.7]",
            "s.csv",
        ),
        (
            &replay,
            &["--dynamics"],
            "dynamics false, now true",
            "r.csv",
        ),
        (
            &replay,
            &["--rate", "70"],
            "rate_hz 50.0, now 70.0",
            "r.csv",
        ),
    ] {
        place.run(&[line, &["--force"]].concat()).ends(0);
        let before = place.read(file);
        place.run(line).ends(0);
        let changed = [line, other].concat();
        place.run(&changed).ends(4).says(&["other options", named]);
        assert!(place.read(file) == before, "{changed:?}");
        place.run(&[&changed[..], &["--force"]].concat()).ends(0);
        assert!(place.read(file) != before, "{changed:?}");
        place.run(&changed).ends(0);
    }
}

/// Of two that begin at once and differ in an option one is refused, whichever is faster.
#[test]
fn of_two_runs_at_once_with_other_options_one_is_refused() {
    let place = Place::new();
    for round in 0..3 {
        let out = format!("results{round}");
        let start = |criterion: &str| {
            let args = [
                "calibrate",
                SEED,
                "shapes/wedge.toml",
                "--no-report",
                "--out",
                &out,
            ];
            place
                .command(&[&args[..], &["--criterion", criterion]].concat())
                .stderr(std::process::Stdio::piped())
                .stdout(std::process::Stdio::null())
                .spawn()
                .unwrap()
        };
        let mut codes = ["jnd", "linear"]
            .map(start)
            .map(|child| child.wait_with_output().unwrap().status.code());
        codes.sort();
        assert_eq!(codes, [Some(0), Some(4)]);
    }
}

/// Regression: a bundle named such an input so that `verify` did not find it, or was refused only as it was written.
#[test]
#[cfg(unix)]
#[allow(clippy::disallowed_methods)] // a test's own names
fn inputs_that_a_bundle_cannot_name_are_refused_before_anything_is_computed() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let place = Place::new();
    let shape = place.text("shapes/flat.toml");
    let names: [&[u8]; 2] = [b"a\xff.toml", b"a\nb.toml"];
    for name in names.map(OsStr::from_bytes) {
        std::fs::write(place.root().join(name), &shape).unwrap();
        let ran = place.command(&["calibrate", SEED]).arg(name).output();
        let ran = Ran::of(ran.unwrap()).ends(3);
        ran.says(&["a bundle names its inputs", "rename the file"]);
        assert!(!place.path("results/seed_air").exists());
    }
}

/// The first message said to use --force, and with it the second said that nothing replaces the file.
#[test]
fn regression_force_was_advised_where_a_link_leads_to_a_file_that_is_not_ours() {
    let place = Place::new();
    let link = |to: &str, name: &str| {
        std::os::unix::fs::symlink(place.path(to), place.path(name)).unwrap();
    };
    place.write("thesis.svg", "mine");
    link("thesis.svg", "link.svg");
    let ran = place.run(&["evaluate", SEED, "--plot", "link.svg"]);
    let ran = ran
        .ends(4)
        .says(&["E406", "behind a link", "another output"]);
    assert!(!ran.err.contains("--force"), "{}", ran.err);
    assert_eq!(place.read("thesis.svg"), b"mine");
    // A drawing of ours, of another design, is reached with force, and the advice is right.
    let other = ["evaluate", "designs/seed.toml", "--plot"];
    place.run(&["evaluate", SEED, "--plot", "ours.svg"]).ends(0);
    link("ours.svg", "other.svg");
    let other = [&other[..], &["other.svg"]].concat();
    place.run(&other).ends(4).says(&["E405", "--force"]);
    place.run(&[&other[..], &["--force"]].concat()).ends(0);
    assert!(place.path("other.svg").is_symlink());
}

#[test]
fn a_name_that_no_file_may_have_is_refused_with_what_to_do() {
    let place = Place::new();
    let name = format!("{}.csv", "n".repeat(300));
    let args = ["discretize", "shapes/flat.toml", "--out", &name];
    place
        .run(&args)
        .ends(4)
        .says(&["the name is too long; choose a shorter one"]);
    assert!(!place.path(&name).exists());
}

#[test]
fn a_name_that_the_summary_takes_is_wrong_usage() {
    let place = Place::new();
    place
        .run(&["discretize", "shapes/flat.toml", "--out", "points.json"])
        .ends(2)
        .says(&["E201", "the summary takes the ending .json"]);
}
