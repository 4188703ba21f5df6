//! A request for more memory than the machine has is refused before anything is computed.

use crate::SEED;
use fluxform_testing::place::Place;

/// 7 GB and more of a map, 1e8 points, 1e9 nodes: the run once computed until it was killed.
#[test]
fn too_large_a_job_is_refused_at_once() {
    let place = Place::new();
    let seed = place.text(SEED);
    let fine = seed
        .replace("-50.0, 50.0, 61]", "-50.0, 50.0, 460]")
        .replace("10.0, 80.0, 29]", "10.0, 80.0, 460]");
    assert_ne!(seed, fine);
    place.write("fine.toml", &fine);
    let grant = ["--memory", "6GB"];
    let run = |args: &[&str], code: i32, what: &str| {
        let ran = place.run(&[args, &grant[..]].concat()).ends(code);
        assert!(ran.err.contains(what), "{}", ran.err);
        assert!(ran.err.contains("--memory"), "{}", ran.err);
    };
    run(&["map", "fine.toml"], 3, "460 x 460 x 460 nodes");
    run(&["map", "fine.toml", "--components", "all"], 3, "nodes");
    run(
        &["calibrate", "fine.toml", "shapes/flat.toml"],
        3,
        "460 x 460 x 264 nodes",
    );
    // One component was counted where whole tensors are held, and no column of JSON.
    let mut points = "x_m,y_m,z_m\n".to_owned();
    (0..20_000).for_each(|k| points += &format!("0.001,0.002,{:.4}\n", 0.01 + 1e-6 * f64::from(k)));
    place.write("many.csv", &points);
    for more in [&["--out", "-"][..], &["--format", "json"]] {
        let args = [
            "probe",
            SEED,
            "many.csv",
            "--components",
            "gz",
            "--memory",
            "20MB",
        ];
        let ran = place.run(&[&args[..], more].concat()).ends(3);
        assert!(
            ran.err.contains("at 20000 points would take"),
            "{}",
            ran.err
        );
    }
    // An object that needs few of them is not refused.
    place.write(
        "small.toml",
        "name = \"small\"\nprimitive = \"flat\"\nside_mm = 10\nheight_mm = 20\n\
         [points]\nx_mm = [-5, 5, 5]\ny_mm = [-5, 5, 5]\n",
    );
    let args = ["calibrate", "fine.toml", "small.toml", "--no-report"];
    place
        .run(&[&args[..], &["--memory", "2GB"]].concat())
        .ends(0);
    let huge = ["--vfield", "v.yaml", "--vfield-nodes", "1000000000"];
    run(
        &[&["map", SEED][..], &huge[..]].concat(),
        2,
        "--vfield-nodes",
    );
    let grid = [
        "shapes/half_sphere.stl",
        "--unit",
        "mm",
        "--grid",
        "10000x10000",
    ];
    run(
        &[&["lambda", SEED][..], &grid[..]].concat(),
        2,
        "10000 x 10000 points",
    );
    run(
        &[&["discretize"][..], &grid[..], &["--out", "p.csv"]].concat(),
        2,
        "points",
    );
    let dense = seed
        .replace("rows = 3", "rows = 100")
        .replace("columns = 3", "columns = 100");
    let dense = dense.replace("total_current_max_a = 18.0", "");
    place.write("dense.toml", &format!("{dense}\n[core]\n"));
    run(&["evaluate", "dense.toml"], 3, "10000 coupled cores");
}

/// Dense matrices of all that hundreds of cores send each other: nothing stated what they take.
#[test]
fn the_pull_of_hundreds_of_coupled_cores_is_refused_before_it_is_computed() {
    let place = Place::new();
    let many = place
        .text(SEED)
        .replace("rows = 3", "rows = 20")
        .replace("columns = 3", "columns = 20")
        .replace("total_current_max_a = 18.0", "")
        .replace("[magnet]", "[magnet]\npassive_force = true")
        .replace(", 61]", ", 31]");
    place.write("many.toml", &format!("{many}\n[core]\n"));
    for command in ["calibrate", "lambda"] {
        let args = [command, "many.toml", "shapes/flat.toml", "--memory", "6GB"];
        let ran = place.run(&args).ends(3);
        assert!(
            ran.err.contains("the pull of 400 coupled cores"),
            "{}",
            ran.err
        );
    }
}

/// Each object was counted alone, and none of the forces at the others' points.
#[test]
fn objects_that_are_compared_are_counted_together() {
    let place = Place::new();
    for (name, height_mm) in [("low", 40), ("high", 50)] {
        let points = "[points]\nx_mm = [-50, 50, 300]\ny_mm = [-50, 50, 300]\n";
        let flat = format!(
            "name = \"{name}\"\nprimitive = \"flat\"\nside_mm = 100\nheight_mm = {height_mm}\n{points}"
        );
        place.write(&format!("{name}.toml"), &flat);
    }
    let args = ["compare", SEED, "low.toml", "high.toml", "--memory", "90MB"];
    let ran = place.run(&args).ends(3);
    assert!(
        ran.err
            .contains("the forces of 2 objects at the points of all"),
        "{}",
        ran.err
    );
}

/// The plan of 100 x 100 cores solved the whole array, and said nothing for minutes.
#[test]
fn a_plan_solves_no_array() {
    let place = Place::new();
    let dense = place
        .text(SEED)
        .replace("rows = 3", "rows = 100")
        .replace("columns = 3", "columns = 100")
        .replace("total_current_max_a = 18.0", "")
        .replace(", 61]", ", 31]");
    place.write("dense.toml", &format!("{dense}\n[core]\n"));
    // The plan is printed, then the run is refused.
    let args = [
        "calibrate",
        "dense.toml",
        "shapes/flat.toml",
        "--explain",
        "--memory",
        "2GB",
    ];
    let ran = place.run(&args).ends(3);
    assert!(
        ran.out.contains("coupling between the cores"),
        "{}",
        ran.out
    );
    assert!(
        ran.out.contains("the 9 coils in the middle of the 10000"),
        "{}",
        ran.out
    );
    assert!(ran.err.contains("10000 coupled cores"), "{}", ran.err);
}

/// Points that a surface or an error decides were chosen and computed whatever was granted.
#[test]
fn regression_points_that_are_chosen_took_no_notice_of_the_grant() {
    let place = Place::new();
    let shape = "shapes/half_sphere.toml";
    let chosen: [&[&str]; 4] = [
        &["discretize", shape, "--out", "p.csv", "--poisson", "0.1"],
        &[
            "discretize",
            shape,
            "--out",
            "p.csv",
            "--max-deviation",
            "0.0001",
        ],
        &[
            "discretize",
            shape,
            "--out",
            "p.csv",
            "--refine",
            "--error",
            "1e-5",
        ],
        &["lambda", SEED, shape, "--poisson", "0.5"],
    ];
    for args in chosen {
        let ran = place.run(&[args, &["--memory", "10MB"]].concat());
        ran.says(&["of memory, and this run may take 10 MB", "--memory"]);
    }
}

/// `verify` and `replay` took what they needed whatever was granted.
#[test]
fn regression_commands_that_read_a_bundle_took_no_notice_of_the_grant() {
    let place = Place::new();
    place
        .run(&["calibrate", SEED, "shapes/wedge.toml", "--no-report"])
        .ends(0);
    let bundle = "results/seed_air/wedge";
    let granted = ["--memory", "1kB"];
    for command in [
        &["verify", bundle][..],
        &["replay", bundle, "--synthesize", "scan"],
    ] {
        place
            .run(&[command, &granted].concat())
            .says(&["of memory, and --memory grants 1 kB"]);
        // Before the map is read, which takes more than it does on the disk.
        let map = place.read(&format!("{bundle}/map.npz")).len();
        let less = ["--memory", &format!("{}kB", 3 * map / 1000)];
        place
            .run(&[command, &less].concat())
            .says(&["the bundle's map and points would take about"]);
    }
}
