//! Standard streams: one JSON object, data alone, closed and full pipes, quiet.

use std::fs::File;
use std::io::Read;
use std::process::Stdio;

use crate::SEED;
use fluxform_testing::place::Place;

#[test]
fn json_is_one_object_with_the_fixed_keys() {
    let place = Place::new();
    let json = |args: &[&str]| {
        let ran = place.run(&[args, &["--format", "json"]].concat()).ends(0);
        assert!(ran.err.is_empty(), "{}", ran.err);
        ran.json()
    };
    let evaluation = json(&["evaluate", SEED]);
    let near = |value: &serde_json::Value, expected: f64, allowed: f64| {
        let value = value.as_f64().unwrap();
        assert!((value - expected).abs() < allowed, "{value}");
    };
    near(&evaluation["coil"]["resistance_ohm"], 6.0753, 5e-5);
    near(&evaluation["coil"]["inductance_h"], 0.014_501_9, 5e-8);
    near(&evaluation["target"]["force_n"], 0.0997, 5e-5);
    assert_eq!(evaluation["limits"]["resistance_ohm"]["met"], false);
    assert_eq!(evaluation["inputs"][0]["path"], SEED);

    let lambda = json(&["lambda", SEED, "shapes/half_sphere.toml", "--at", "2.0"]);
    assert_eq!(lambda["points"], 2821);
    assert_eq!(lambda["currents_a"].as_array().unwrap().len(), 9);
    assert_eq!(lambda["at"]["lambda_n_per_m"], 2.0);
    near(&lambda["at"]["worst_point"]["worst_error_n"], 0.0, 1.0);

    let map = json(&["map", SEED, "--out", "maps"]);
    assert_eq!(map["point_coils"], 971_181);
    let bundles = json(&["calibrate", SEED, "shapes/wedge.toml"]);
    let bundle = &bundles["bundles"][0];
    assert_eq!(bundle["folder"], "results/seed_air/wedge");
    near(&bundle["lambda_n_per_m"], 0.22115, 5e-5);
    let verified = json(&["verify", "results/seed_air/wedge"]);
    assert_eq!(verified["passed"], true);
    let points = json(&["discretize", "shapes/wedge.toml", "--out", "wedge.csv"]);
    assert_eq!(points["points"], 3721);

    place.write(
        "points.csv",
        "x_m,y_m,z_m\n0.007,0.013,0.03\n0.0,0.05,0.017\n",
    );
    let probe = json(&["probe", SEED, "points.csv", "--components", "gz"]);
    let columns = &probe["columns"];
    let table = place.run(&["probe", SEED, "points.csv", "--components", "gz", "-q"]);
    for (row, line) in table.ends(0).out.lines().skip(1).enumerate() {
        let value: f64 = line.rsplit(',').next().unwrap().parse().unwrap();
        assert_eq!(columns["dbz_dz_t_per_m_per_a"][row].as_f64(), Some(value));
    }
}

#[test]
fn data_is_alone_on_standard_output() {
    let place = Place::new();
    let piped = place.run(&["discretize", "shapes/wedge.toml", "--out", "-"]);
    let piped = piped.ends(0).says(&["wedge: 3721 constraint points"]);
    assert!(piped.out.starts_with("x_m,y_m,height_m,"));
    assert_eq!(piped.out.lines().count(), 3722);
    place.run(&["discretize", "shapes/wedge.toml"]).ends(0);
    assert_eq!(place.read("points.csv"), piped.out.as_bytes());

    let args = [
        "discretize",
        "shapes/wedge.toml",
        "--out",
        "-",
        "--format",
        "json",
    ];
    let json = place.run(&args).ends(0);
    assert_eq!(json.out, piped.out);
    assert_eq!(json.error()["points"], 3721);
}

#[test]
fn quiet_leaves_data_and_errors() {
    let place = Place::new();
    for args in [
        &["evaluate", SEED][..],
        &["map", SEED, "--out", "maps"],
        &["lambda", SEED, "shapes/flat.toml"],
        &["calibrate", SEED, "shapes/flat.toml"],
        &["verify", "results/seed_air/flat"],
        &["discretize", "shapes/flat.toml"],
        &["man", "--out", "man1"],
    ] {
        let ran = place.run(&[args, &["--quiet"]].concat()).ends(0);
        assert!(
            ran.out.is_empty() && ran.err.is_empty(),
            "{args:?}: {ran:?}"
        );
    }
    let data = place.run(&["discretize", "shapes/flat.toml", "--out", "-", "-q"]);
    assert!(data.out.lines().count() == 3722 && data.err.is_empty());
    let json = place.run(&["evaluate", SEED, "-q", "--format", "json"]);
    assert!(json.json().is_object() && json.err.is_empty());
    place
        .run(&["evaluate", "none.toml", "-q"])
        .ends(3)
        .says(&["none.toml"]);
    place
        .run(&["evaluate", SEED, "-q", "--strict"])
        .ends(4)
        .says(&["not met"]);
}

#[test]
fn a_design_and_points_may_come_from_standard_input() {
    let place = Place::new();
    let seed = place.text(SEED);
    let piped = place.run_with_input(&["evaluate", "-"], &seed).ends(0);
    let read = place.run(&["evaluate", SEED]).ends(0);
    assert_eq!(piped.out, read.out);
    let json = place.run_with_input(&["evaluate", "-", "--format", "json"], &seed);
    assert_eq!(json.json()["inputs"][0]["path"], "-");
    let probe = place.run_with_input(
        &["probe", SEED, "-", "--components", "gz"],
        "x_m,y_m,z_m\n0.007,0.013,0.03\n",
    );
    assert_eq!(probe.ends(0).out.lines().count(), 10);
    let shape = "name = \"plate\"\nprimitive = \"flat\"\n";
    let lambda = place.run_with_input(&["lambda", SEED, "-"], shape).ends(0);
    assert!(lambda.out.starts_with("plate on seed_air: lambda 0."));
    let bad = place.run_with_input(&["evaluate", "-"], &seed.replace("[wire]", "[wier]"));
    bad.ends(3).says(&["-:", "did you mean wire?"]);
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let place = Place::new();
    for args in [
        &["discretize", "shapes/wedge.toml", "--out", "-", "--quiet"][..],
        &["completions", "bash"],
        &["evaluate", SEED, "--format", "json"],
        &["calibrate", "--help"],
    ] {
        let mut child = place
            .command(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let mut said = String::new();
        child
            .stderr
            .take()
            .unwrap()
            .read_to_string(&mut said)
            .unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{args:?}: {said}");
        assert!(said.is_empty(), "{args:?}: {said}");
    }
}

#[test]
fn a_full_disk_is_an_error_not_a_panic() {
    let place = Place::new();
    #[allow(clippy::disallowed_methods)] // a device, not a file
    let run_into_full = |args: &[&str]| {
        // A device, opened and not made.
        #[allow(clippy::disallowed_methods)]
        let full = File::options().write(true).open("/dev/full").unwrap();
        let mut command = place.command(args);
        let child = command.stdout(full).stderr(Stdio::piped()).spawn().unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(4), "{args:?}: {said}");
        assert!(said.contains("cannot write to standard output"), "{said}");
    };
    run_into_full(&["discretize", "shapes/wedge.toml", "--out", "-"]);
    run_into_full(&["evaluate", SEED]);
    run_into_full(&["man"]);
    // What the reader of arguments prints itself: a script took an empty file for the version.
    run_into_full(&["help"]);
    run_into_full(&["--version"]);
    run_into_full(&["evaluate", "--help"]);
    place
        .run(&["discretize", "shapes/wedge.toml", "--out", "/dev/full"])
        .ends(4)
        .says(&["/dev/full", "full"]);
}
