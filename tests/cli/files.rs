//! Files: what is replaced, what is refused, and that bytes depend on nothing but the inputs.

use crate::support::{Place, SEED};

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
    place.write("other.toml", &place.seed().replace("1429", "1400"));
    place.run(&["map", "other.toml", "--out", "maps"]).ends(4);
    place
        .run(&["map", "other.toml", "--out", "maps", "--force"])
        .ends(0);

    place.run(&["calibrate", SEED, "shapes/flat.toml"]).ends(0);
    place.run(&["calibrate", SEED, "shapes/flat.toml"]).ends(0);
    let told = place.run(&[
        "calibrate",
        "other.toml",
        "shapes/flat.toml",
        "--format",
        "json",
    ]);
    assert_eq!(told.ends(4).error()["error"]["exit_code"], 4);
    place.write("points_in.csv", "x_m,y_m,z_m\n0.007,0.013,0.03\n");
    let probe = ["probe", SEED, "points_in.csv", "--out", "points.csv"];
    place.run(&probe).ends(4).says(&["points.csv"]);
}

#[test]
fn an_output_folder_that_cannot_be_is_told() {
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
    let told = place.run(&["verify", bundle, "--format", "json"]).ends(5);
    assert_eq!(told.error()["error"]["exit_code"], 5);
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
        "lambda 0.11542 N/m",
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
