//! `--error`: one budget, held, obeyed, recorded.

use fluxform::bundle::headline::BudgetName;
use fluxform::bundle::load::Bundle;
use fluxform_testing::place::Place;
use serde_json::Value;

use crate::SEED;

/// An object that leaves its points to the program.
fn shape(place: &Place, name: &str, text: &str) -> String {
    let file = format!("{name}.toml");
    place.write(&file, &format!("name = \"{name}\"\n{text}"));
    file
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// True, stated and requested error: the first within the second within the third.
#[test]
fn a_requested_error_is_held_against_a_finer_run() {
    let place = Place::new();
    let objects = [
        ("wedge", "primitive = \"wedge\"\nlow_mm = 34.0\n"),
        (
            "dome",
            "primitive = \"half-sphere\"\nradius_mm = 91.0\nbase_mm = 11.0\n",
        ),
        ("cap", "primitive = \"half-sphere\"\nradius_mm = 38.3\n"),
    ];
    for (name, text) in objects {
        let free = shape(&place, name, text);
        let grid = "[points]\nx_mm = [-50.0, 50.0, 321]\ny_mm = [-50.0, 50.0, 321]\n";
        let fine = shape(&place, "fine", &format!("{text}{grid}"));
        let solved = |shape: &str, flags: &[&str]| {
            let args = ["lambda", SEED, shape, "--format", "json"];
            place.run(&[&args[..], flags].concat()).ends(0).json()
        };
        let limit = number(&solved(&fine, &["--weights", "area"])["lambda_n_per_m"]);
        let mut points = Vec::new();
        for error in ["5%", "0.004"] {
            let run = solved(&free, &["--error", error]);
            let headline = &run["headline"];
            let off = (number(&run["lambda_n_per_m"]) / limit - 1.0).abs();
            let stated = number(&headline["force_error"]);
            let requested = number(&headline["requested"]["error"]);
            assert!(off <= stated, "{name} {error}: {off} of {stated}");
            assert!(stated <= requested, "{name} {error}: {stated}");
            assert_eq!(headline["requested"]["met"], true);
            assert_eq!(run["weights"], "area");
            points.push(run["points"].as_u64().unwrap());
        }
        assert!(points[0] < points[1] && points[1] < 321 * 321, "{points:?}");
    }
}

/// A rim needs many heights for a runtime, and few points for lambda.
#[test]
fn heights_of_a_runtime_are_finer_than_the_points_of_lambda() {
    let place = Place::new();
    let cap = "primitive = \"half-sphere\"\nradius_mm = 38.3\n";
    let cap = shape(&place, "cap", cap);
    let ran = place.run(&["calibrate", SEED, &cap, "--error", "3%", "--format", "json"]);
    let run = ran.ends(0).json();
    let manifest = &run["bundles"][0]["manifest"];
    let requested = &run["bundles"][0]["headline"]["requested"];
    assert_eq!(requested["met"], true);
    let [points, heights] = ["points", "heights"].map(|key| requested[key][0].as_u64().unwrap());
    assert!(
        heights > points && (heights - 1) % (points - 1) == 0,
        "{points} {heights}"
    );
    let counted = |key: &str| manifest["points"][key].as_u64().unwrap();
    assert!(counted("graded") > 0);
    let lambda = &run["bundles"][0];
    let all = lambda["points"].as_u64().unwrap();
    assert_eq!(counted("count") + counted("graded"), all);
    let folder = lambda["folder"].as_str().unwrap();
    let rows = std::fs::read_to_string(place.path(&format!("{folder}/points.csv"))).unwrap();
    assert_eq!(rows.lines().count() as u64, all + 1);
    place.run(&["verify", folder]).ends(0);
}

#[test]
fn grids_that_are_given_are_obeyed_and_what_they_cause_is_said() {
    let place = Place::new();
    let grid =
        "primitive = \"wedge\"\n[points]\nx_mm = [-50.0, 50.0, 7]\ny_mm = [-50.0, 50.0, 7]\n";
    let given = shape(&place, "wedge", grid);
    let ran = place
        .run(&["lambda", SEED, &given, "--error", "0.1%"])
        .ends(0);
    let first = ran.out.lines().nth(1).unwrap();
    assert!(first.contains("exceeds the requested 0.1 %"), "{first}");
    ran.says(&["exceeded", "number of points", "--refine"]);
    let chosen = [
        "lambda", SEED, &given, "--error", "0.1%", "--refine", "--format", "json",
    ];
    let chosen = place.run(&chosen).ends(0).json();
    assert_eq!(chosen["headline"]["requested"]["met"], true);
    assert!(chosen["points"].as_u64() > Some(49));
    for refused in [["--error", "0"], ["--error", "60%"], ["--error", "much"]] {
        place
            .run(&[&["lambda", SEED, &given], &refused[..]].concat())
            .ends(2);
    }
    place.run(&["lambda", SEED, &given, "--refine"]).ends(2);
}

/// The map's nodes follow the budget too; the bundle records the request and is made again from it.
#[test]
fn a_bundle_of_a_requested_error_is_recorded_and_verifies() {
    let place = Place::new();
    let free = shape(&place, "wedge", "primitive = \"wedge\"\nlow_mm = 34.0\n");
    let args = [
        "calibrate",
        SEED,
        &free,
        "--refine",
        "--format",
        "json",
        "--error",
    ];
    let run = |error: &str| place.run(&[&args[..], &[error]].concat());
    let coarse = run("5%").ends(0).json();
    let headline = &coarse["bundles"][0]["headline"];
    assert_eq!(headline["requested"]["met"], true);
    let nodes = |of: &Value| number(&of["requested"]["nodes"][0]);
    assert!(nodes(headline) < 61.0);
    place.run(&["verify", "results/seed_air/wedge"]).ends(0);
    run("1%").ends(4).says(&["error"]);
    let fine = place
        .run(&[&args[..], &["1%", "--force"]].concat())
        .ends(0)
        .json();
    let headline_of = &fine["bundles"][0]["headline"];
    assert!(nodes(headline_of) > nodes(headline));
    assert!(number(&headline_of["force_error"]) <= 0.01);
}

/// Heights between the points of a ball's cap, against its formula.
#[test]
fn discretize_takes_the_fewest_points_that_hold_an_error() {
    let place = Place::new();
    let (radius, base, low) = (0.091, 0.011, 0.05);
    let cap = "primitive = \"half-sphere\"\nradius_mm = 91.0\nbase_mm = 11.0\n";
    let free = shape(&place, "dome", cap);
    let mut taken = Vec::new();
    for error in ["3%", "0.05%"] {
        let args = [
            "discretize",
            &free,
            "--error",
            error,
            "--force",
            "--format",
            "json",
        ];
        let run = place.run(&args).ends(0).json();
        assert_eq!(run["requested"]["met"], true);
        taken.push(run["points"].as_u64().unwrap());
        let rows: Vec<[f64; 3]> = place
            .text("points.csv")
            .lines()
            .skip(1)
            .map(|line| {
                let cells: Vec<f64> = line
                    .split(',')
                    .take(3)
                    .map(|c| c.parse().unwrap())
                    .collect();
                [cells[0], cells[1], cells[2]]
            })
            .collect();
        // Neighbours along x: halfway between them the height is off by the most along that line.
        let mut worst = 0.0_f64;
        for pair in rows.windows(2).filter(|pair| pair[0][1] == pair[1][1]) {
            let (x, y) = (0.5 * (pair[0][0] + pair[1][0]), pair[0][1]);
            let height = base + f64::sqrt(radius * radius - x * x - y * y);
            let between = 0.5 * (pair[0][2] + pair[1][2]);
            worst = worst.max((height - between).abs() / height);
        }
        let requested = number(&run["requested"]["error"]);
        assert!(worst > 0.0 && worst <= requested, "{error}: {worst}");
        assert!(number(&run["min_height_m"]) > low);
    }
    assert!(taken[0] < taken[1], "{taken:?}");
    let given = shape(
        &place,
        "given",
        &format!("{cap}[points]\nx_mm = [-50.0, 50.0, 5]\ny_mm = [-50.0, 50.0, 5]\n"),
    );
    let args = ["discretize", &given, "--error", "0.1%", "--force"];
    place
        .run(&args)
        .ends(0)
        .says(&["0.1 % is exceeded", "--refine"]);
    place
        .run(&["discretize", &given, "--error", "1%", "--poisson", "2mm"])
        .ends(2);
}

/// Between and at its nodes; more for a smaller error, and the design's own where it gives them.
#[test]
fn map_takes_the_fewest_nodes_that_hold_an_error() {
    let place = Place::new();
    let nodes = |error: &str| {
        let args = [
            "map", SEED, "--error", error, "--refine", "--out", "m", "--force", "--csv",
            "--format", "json",
        ];
        let run = place.run(&args).ends(0).json();
        assert_eq!(run["requested"]["met"], true, "{error}");
        let requested = &run["requested"];
        assert!(number(&requested["of_map"]) <= number(&requested["error"]));
        run["map"]["x_m"]["samples"].as_u64().unwrap()
    };
    assert!(nodes("10%") < nodes("0.3%"));
    let ran = place.run(&["map", SEED, "--error", "0.01%", "--out", "given"]);
    ran.ends(0).says(&["0.01 % is exceeded", "--refine"]);
}

/// A shape that leaves its points to the program is held to 1 %; one that gives them is computed as it is.
#[test]
fn points_that_nobody_gives_hold_the_default_error() {
    let place = Place::new();
    let wedge = "primitive = \"wedge\"\nlow_mm = 34.0\n";
    let free = shape(&place, "wedge", wedge);
    let run = ["lambda", SEED, &free, "--format", "json"];
    let run = place.run(&run).ends(0).json();
    let requested = &run["headline"]["requested"];
    assert_eq!(
        (&requested["by_default"], &requested["met"]),
        (&Value::Bool(true), &Value::Bool(true))
    );
    assert!(number(&run["headline"]["force_error"]) <= number(&requested["error"]));
    assert_eq!(run["weights"], "area");
    let grid = "[points]\nx_mm = [-50.0, 50.0, 7]\ny_mm = [-50.0, 50.0, 7]\n";
    let given = shape(&place, "given", &format!("{wedge}{grid}"));
    let run = ["lambda", SEED, &given, "--format", "json"];
    let run = place.run(&run).ends(0).json();
    assert_eq!(run["points"], 49);
    assert!(run["headline"].get("requested").is_none_or(Value::is_null));
    let warnings = run["warnings"].to_string();
    assert!(
        warnings.contains("the default error of 1 % is exceeded") && warnings.contains("--refine"),
        "{warnings}"
    );
    place.run(&["calibrate", SEED, &free, "-q"]).ends(0);
    let manifest: Value =
        serde_json::from_slice(&place.read("results/seed_air/wedge/manifest.json")).unwrap();
    assert_eq!(manifest["made_with"]["default_error"], 0.01);
    place.run(&["verify", "results/seed_air/wedge"]).ends(0);
}

/// Two samples along an axis leave nothing to compare: that was stated as no error at all.
#[test]
fn points_that_leave_nothing_to_compare_hold_no_error() {
    let place = Place::new();
    let of = |grid: [usize; 2]| {
        let [x, y] = grid;
        let text = format!(
            "primitive = \"wedge\"\nlow_mm = 34.0\n[points]\nx_mm = [-30, 30, {x}]\ny_mm = [-30, 30, {y}]\n"
        );
        let file = shape(&place, "wedge", &text);
        let args = ["lambda", "designs/seed_air.toml", &file, "--format", "json"];
        place.run(&args).ends(0).json()
    };
    let lambda = |file: &Value| file["lambda_n_per_m"].as_f64().unwrap();
    let fine = lambda(&of([61, 61]));
    for grid in [[2, 2], [2, 61], [61, 2]] {
        let file = of(grid);
        let stated = file["headline"]["force_error"].as_f64().unwrap();
        assert!(
            stated > (lambda(&file) / fine - 1.0).abs(),
            "{grid:?}: {file}"
        );
    }
}

/// The points that decide the least over places were among those of every comparison: no error was stated.
#[test]
fn the_error_of_a_least_over_places_is_not_that_of_a_mean() {
    let place = Place::new();
    place.write("design.toml", ARRAY);
    let of = |[x, y]: [usize; 2]| {
        let text = format!(
            "primitive = \"half-sphere\"\nradius_mm = 24.97\nbase_mm = 35.1\n\
             [points]\nweights = \"area\"\nx_mm = [-45, 45, {x}]\ny_mm = [-45, 45, {y}]\n"
        );
        let file = shape(&place, "dome", &text);
        let options = ["--criterion", "maxmin", "--format", "json"];
        let args = ["lambda", "design.toml", &file];
        place.run(&[&args[..], &options].concat()).ends(0).json()
    };
    let fine = number(&of([121, 121])["lambda_n_per_m"]);
    for samples in [[16, 28], [25, 17]] {
        let file = of(samples);
        let off = (number(&file["lambda_n_per_m"]) / fine - 1.0).abs();
        let stated = number(&file["headline"]["force_error"]);
        assert!(off < stated && stated < 0.05, "{samples:?}: {off} {stated}");
    }
}

/// Sixteen coils out of their places, each with its own largest current.
const ARRAY: &str = "name = \"array\"
[coil]
inner_diameter_mm = 10
outer_diameter_mm = 24
length_mm = 30
[wire]
diameter_mm = 0.5
[array]
positions_mm = [
    [-49.4, -52.6], [-18.0, -50.5], [20.0, -52.2], [50.8, -50.2],
    [-49.9, -18.7], [-16.4, -16.7], [18.0, -19.3], [48.8, -14.1],
    [-49.1, 19.0], [-14.4, 19.8], [16.4, 18.5], [51.8, 17.4],
    [-49.9, 49.9], [-14.8, 50.4], [14.9, 48.1], [51.8, 49.4],
]
[supply]
current_max_a = [
    2.881, 0.827, 1.154, 2.957, 1.704, 2.789, 2.41, 0.621, 0.883, 1.345, 2.679, 1.202, 1.55, 1.598, 1.177, 2.424,
]
current_min_a = -0.5
";

/// Samples below every point of the grid are given the height of the lowest: of a wedge that begins below the workspace
/// lambda was off by 0.66 %, 0.43 % being stated.
#[test]
fn regression_heights_that_samples_below_the_grid_do_not_have_were_not_counted() {
    let place = Place::new();
    let text = "primitive = \"wedge\"\nlow_mm = 5\nhigh_mm = 90\nside_mm = 80\n";
    let free = shape(&place, "wedge", text);
    // The grid ends at the lowest edge.
    let grid = "[points]\nx_mm = [-40, 40, 161]\ny_mm = [-40, 40, 161]\n";
    let fine = shape(&place, "fine", &format!("{text}{grid}"));
    let solved = |shape: &str, flags: &[&str]| {
        let args = ["lambda", SEED, shape, "--format", "json"];
        let run = place.run(&[&args[..], flags].concat()).ends(0).json();
        let error = number(&run["accuracy"]["lambda_of_points"]["estimate"]);
        (number(&run["lambda_n_per_m"]), error)
    };
    let (limit, left) = solved(&fine, &["--weights", "area"]);
    for error in ["3%", "2%", "1%", "0.7%"] {
        let (lambda, stated) = solved(&free, &["--error", error]);
        let off = (lambda / limit - 1.0).abs();
        assert!(off <= stated + left, "{error}: {off} of {stated}");
    }
}

/// The stated error of a strip between skipped points, too narrow for any comparison, was NaN: JSON and bundle failed, and
/// the message blamed the disk.
#[test]
fn regression_the_error_of_a_strip_too_narrow_to_compare_was_nan() {
    let place = Place::new();
    let grid = "[points]\nx_mm = [-60, 0, 3]\ny_mm = [-30, 30, 5]\noutside = \"skip\"\n";
    let text = format!("primitive = \"flat\"\nside_mm = 60\nheight_mm = 50\n{grid}");
    let strip = shape(&place, "strip", &text);
    let ran = place.run(&["lambda", SEED, &strip, "--format", "json"]);
    let run = ran.ends(0).json();
    let stated = number(&run["headline"]["force_error"]);
    assert!(stated >= 1.0, "{stated}");
    assert_eq!(run["headline"]["budget"][0]["part"], "points");
}

/// Against the least force over a quarter of the points, without a border of the object: a hundred times too large and
/// more; then 0 where corners decide and the force is least beside them.
#[test]
fn regression_the_largest_force_at_every_point_was_stated_far_off() {
    let place = Place::new();
    let found = |shape: &str, side_mm: f64, samples: usize| {
        let axis = format!("[-{side_mm}, {side_mm}, {samples}]");
        let text = format!("name = \"s\"\n{shape}\n[points]\nx_mm = {axis}\ny_mm = {axis}\n");
        place.write("s.toml", &text);
        let args = [
            "lambda",
            "designs/seed_air.toml",
            "s.toml",
            "--criterion",
            "maxmin",
        ];
        let result = place.run(&[&args[..], &["--format", "json"]].concat());
        let result = result.ends(0).json();
        let number = |path: &str| result.pointer(path).and_then(|of| of.as_f64());
        let lambda = number("/lambda_n_per_m").expect("a force constant");
        (
            lambda,
            number("/accuracy/lambda_of_points/estimate").expect("an error"),
        )
    };
    for (shape, side_mm, rows) in [
        ("primitive = \"wedge\"", 50.0, [(31, 0.1), (61, 0.03)]),
        (
            "primitive = \"flat\"\nheight_mm = 50\nside_mm = 100",
            50.0,
            [(25, 0.02), (31, 0.01)],
        ),
        (
            "primitive = \"flat\"\nheight_mm = 30\nside_mm = 50",
            25.0,
            [(8, 0.5), (13, 0.2)],
        ),
    ] {
        let (exact, _) = found(shape, side_mm, 121);
        for (samples, most) in rows {
            let (lambda, stated) = found(shape, side_mm, samples);
            let off = (lambda / exact - 1.0).abs();
            assert!(
                off < stated && stated < most,
                "{shape} {samples}: {off:e} {stated:e}"
            );
        }
    }
}

/// A design of one coil whose core pulls the magnet close above it.
fn one_with_its_pull(place: &Place) {
    place.write(
        "one.toml",
        "name = \"one\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\nlength_mm = 60.0\n\
         [wire]\ndiameter_mm = 0.7\n[core]\nrelative_permeability = 1000.0\n\
         [magnet]\npassive_force = true\n[supply]\ncurrent_max_a = 4.0\n\
         [workspace]\nx_mm = [-15.0, 15.0, 21]\ny_mm = [-15.0, 15.0, 21]\nz_mm = [8.0, 40.0, 15]\n",
    );
}

/// The nodes were chosen for the currents' force alone: the map of the pull took more than was requested.
#[test]
fn regression_nodes_for_a_requested_error_did_not_count_the_pull() {
    let place = Place::new();
    one_with_its_pull(&place);
    let low = "primitive = \"flat\"\nheight_mm = 17.1\nside_mm = 20.0\n";
    let low = shape(&place, "low", low);
    let args = [
        "calibrate",
        "one.toml",
        &low,
        "--error",
        "0.5%",
        "--refine",
        "--format",
        "json",
    ];
    let run = place.run(&args).ends(0).json();
    let headline = &run["bundles"][0]["headline"];
    assert_eq!(headline["requested"]["met"], true, "{headline}");
    assert!(number(&headline["force_error"]) <= 0.005, "{headline}");
}

/// Between the points of one line there was no place to compare map and field at: nodes were chosen unseen, and the
/// budget had no interpolation.
#[test]
fn regression_a_line_of_points_left_the_map_unchecked() {
    let place = Place::new();
    let line = "primitive = \"half-sphere\"\nradius_mm = 38.3\nbase_mm = 12.0\n\
                [points]\nx_mm = [-35.0, 35.0, 41]\ny_mm = [0.0, 0.0, 1]\n";
    let line = shape(&place, "line", line);
    let nodes = ["5%", "0.5%"].map(|error| {
        let args = [
            "calibrate",
            SEED,
            &line,
            "--error",
            error,
            "--refine",
            "--force",
            "--format",
            "json",
        ];
        let run = place.run(&args).ends(0).json();
        let headline = &run["bundles"][0]["headline"];
        assert_eq!(headline["requested"]["met"], true, "{headline}");
        let budget = headline["budget"].as_array().unwrap();
        let interpolation = budget.iter().find(|part| part["part"] == "interpolation");
        let interpolation = number(&interpolation.expect("an estimate")["error"]);
        assert!(interpolation > 1e-6, "{headline}");
        headline["requested"]["nodes"][0].as_u64().unwrap()
    });
    assert!(nodes[1] > nodes[0], "{nodes:?}");
}

/// `map` said that its error held while that of the pull's map, in the same file, was many times larger.
#[test]
fn regression_a_map_of_a_requested_error_did_not_count_the_pull() {
    let place = Place::new();
    one_with_its_pull(&place);
    let args = [
        "map", "one.toml", "--error", "5%", "--refine", "--out", "map", "--format", "json",
    ];
    let run = place.run(&args).ends(0).json();
    let sidecar: Value = serde_json::from_str(&place.text("map/map.json")).unwrap();
    let between = number(&sidecar["map"]["passive_force"]["interpolation"]["largest_error"]);
    let at_nodes = number(&sidecar["accuracy"]["passive_force_map"]["estimate"]);
    let of_pull = number(&run["requested"]["of_pull"]);
    assert!((of_pull / (between + at_nodes) - 1.0).abs() < 1e-12);
    assert!(of_pull <= 0.05, "{of_pull}");
    assert_eq!(run["requested"]["met"], true);
}

/// The map's interpolation was compared in the middles of whole cells, all above a rim, where it is worst; and along z
/// alone, also where the force along a surface's normal is requested.
#[test]
fn regression_interpolation_at_a_rim_and_sideways_was_not_counted() {
    let place = Place::new();
    let air = std::fs::read_to_string(SEED).unwrap();
    for force in ["vertical", "normal"] {
        let dome = "primitive = \"half-sphere\"\nradius_mm = 50.0\nbase_mm = 15.0\n";
        let dome = shape(&place, force, &format!("{dome}force = \"{force}\"\n"));
        let bundle = |samples: usize| {
            let name = format!("nodes_{samples}");
            let (head, _) = air.split_once("[workspace]").unwrap();
            let along = format!("[-50.0, 50.0, {samples}]");
            let workspace =
                format!("[workspace]\nx_mm = {along}\ny_mm = {along}\nz_mm = [10.0, 80.0, 57]\n");
            let design = format!("{name}.toml");
            place.write(&design, &format!("{head}{workspace}"));
            place
                .run(&["calibrate", &design, &dome, "--out", &name])
                .ends(0);
            Bundle::open(&place.path(&format!("{name}/seed_air/{force}"))).unwrap()
        };
        let (coarse, fine) = (bundle(21), bundle(61));
        let lambda = fine.lambda.lambda_n_per_m.unwrap();
        let currents = fine.lambda.currents_a.as_deref().unwrap();
        let force_n = |bundle: &Bundle, at: [f64; 3]| {
            let mut vectors = vec![[0.0; 3]; currents.len()];
            if bundle.force_vector_per_ampere(at, &mut vectors).is_none() {
                let mut upward = vec![0.0; currents.len()];
                assert!(bundle.force_per_ampere(at, &mut upward));
                vectors = upward.into_iter().map(|z| [0.0, 0.0, z]).collect();
            }
            let each = vectors.iter().zip(currents);
            each.fold([0.0; 3], |sum: [f64; 3], (force, i)| {
                [0, 1, 2].map(|axis| sum[axis] + i * force[axis])
            })
        };
        let off = fine.points.iter().map(|point| {
            let at = [point.x_m, point.y_m, point.height_m];
            let (a, b) = (force_n(&coarse, at), force_n(&fine, at));
            let square = (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>();
            square.sqrt() / (lambda * at[2])
        });
        let largest = off.fold(0.0, f64::max);
        let headline = coarse.lambda.headline.as_ref().unwrap();
        let stated = headline.error_of(BudgetName::Interpolation);
        assert!(
            largest <= stated && stated <= 3.0 * largest,
            "{force}: {largest} {stated}"
        );
    }
}
