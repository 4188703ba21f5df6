//! Surfaces on the command line: looked at, drawn, enlarged, refused.

use fluxform_testing::place::Place;

use crate::SEED;

#[test]
fn a_file_is_inspected_without_its_unit_and_the_guess_is_never_used() {
    let place = Place::new();
    let args = ["discretize", "shapes/half_sphere.stl", "--inspect"];
    place.run(&args).ends(0).says(&[]);
    let reported = place
        .run(&[&args[..], &["--format", "json"]].concat())
        .json();
    let surface = &reported["surface"];
    assert_eq!(surface["format"], "STL");
    assert_eq!(surface["watertight"], true);
    assert_eq!(surface["self_intersections"], 0);
    assert_eq!(surface["layers"], 2);
    assert_eq!(surface["unit_guesses"][0]["unit"], "mm");
    assert!(surface.get("unit_m").is_none());
    assert_eq!(reported["inputs"][0]["path"], "shapes/half_sphere.stl");
    assert!(!place.path("points.csv").exists());
    // Discretising still requires a unit that it guesses.
    place
        .run(&["discretize", "shapes/half_sphere.stl", "--out", "-"])
        .ends(2)
        .says(&["--unit"]);
}

#[test]
fn a_picture_is_drawn_and_replaced_only_where_it_shows_the_same() {
    let place = Place::new();
    let args = ["discretize", "shapes/wedge.toml", "--grid"];
    place.run(&[&args[..], &["9x9"]].concat()).ends(2);
    let args = ["discretize", "shapes/wedge.toml", "--plot", "a.svg"];
    place.run(&args).ends(0);
    let drawn = place.read("a.svg");
    let text = String::from_utf8(drawn.clone()).unwrap();
    assert!(text.contains("height / mm") && text.contains("interpolation / um"));
    place.run(&args).ends(0);
    assert!(place.read("a.svg") == drawn, "not the same bytes twice");
    let other = ["discretize", "shapes/flat.toml", "--plot", "a.svg"];
    let out = ["--out", "b.csv"];
    let refused = place.run(&[&other[..], &out].concat()).ends(4);
    assert!(
        refused.err.contains("was not made from these inputs"),
        "{refused:?}"
    );
    assert!(place.read("a.svg") == drawn);
    place
        .run(&[&other[..], &out, &["--force"]].concat())
        .ends(0);
    assert!(place.read("a.svg") != drawn);
    // Standard output holds one thing.
    let twice = [
        "discretize",
        "shapes/flat.toml",
        "--plot",
        "-",
        "--out",
        "-",
    ];
    place.run(&twice).ends(2).says(&["name a file"]);
    let piped = ["discretize", "shapes/flat.toml", "--inspect", "--plot", "-"];
    let ran = place.run(&piped).ends(0);
    assert!(
        ran.out.contains("<svg") && ran.err.contains("STL"),
        "{}",
        ran.err
    );
}

#[test]
fn what_cannot_be_inspected_says_why() {
    let place = Place::new();
    place.write(
        "ball.toml",
        "name = \"ball\"\nprimitive = \"half-sphere\"\n",
    );
    let ran = place.run(&["discretize", "ball.toml", "--inspect"]).ends(2);
    assert!(ran.err.contains("no file to inspect"), "{ran:?}");
    let raw = ["discretize", "shapes/flat.stl", "--inspect"];
    for (flag, value, reason) in [
        ("--translate", "0,0,3", "--unit"),
        ("--grid", "9x9", "makes no points"),
    ] {
        let ran = place.run(&[&raw[..], &[flag, value]].concat()).ends(2);
        assert!(ran.err.contains(reason), "{ran:?}");
    }
    place.run(&[&raw[..], &["--out", "a.csv"]].concat()).ends(2);
    let ran = place.run(&["discretize", "none.obj", "--inspect"]).ends(3);
    assert!(ran.err.contains("no such file"), "{ran:?}");
    place.write("model.dae", "<xml/>");
    let ran = place.run(&["discretize", "model.dae", "--inspect"]).ends(3);
    assert!(ran.err.contains(".3mf"), "{ran:?}");
}

/// Its hash was taken of whatever has its name: of a pipe the program waited for the other end.
#[test]
#[cfg(unix)]
fn a_pipe_is_refused_and_not_waited_for() {
    let place = Place::new();
    let made = std::process::Command::new("mkfifo")
        .arg(place.path("pipe.stl"))
        .status();
    assert!(made.unwrap().success());
    let args = ["discretize", "pipe.stl", "--unit", "mm", "--out", "-"];
    place.run(&args).ends(3).says(&["not a regular file"]);
}

#[test]
fn factors_that_differ_are_refused_unless_they_are_meant() {
    let place = Place::new();
    let raw = |flags: &[&str]| {
        let args = [
            "discretize",
            "shapes/wedge.stl",
            "--unit",
            "mm",
            "--out",
            "-",
        ];
        place.run(&[&args[..], flags].concat())
    };
    let ran = raw(&["--scale", "1,1,1.3"]).ends(2);
    assert!(ran.err.contains("--stretch"), "{ran:?}");
    for outlandish in [
        ["--scale", "0"],
        ["--scale", "1e-300"],
        ["--x", "-1e300,1e300"],
    ] {
        raw(&outlandish).ends(2);
    }
    raw(&["--scale", "1,2"]).ends(2);
    let highest = |flags: &[&str]| -> f64 {
        let ran = raw(flags).ends(0);
        let rows = ran.out.lines().skip(1).map(|row| {
            let height = row.split(',').nth(2).unwrap();
            height.parse::<f64>().unwrap()
        });
        rows.fold(0.0, f64::max)
    };
    let plain = highest(&[]);
    let same = |got: f64, factor: f64| (got / plain - factor).abs() < 1e-12;
    assert!(same(highest(&["--scale", "0.7"]), 0.7));
    assert!(same(highest(&["--scale", "1,1,1.3", "--stretch"]), 1.3));

    let shape = "name = \"w\"\nsurface = \"shapes/wedge.stl\"\nunit = \"mm\"\n";
    let with = |keys: &str| {
        place.write("w.toml", &format!("{shape}{keys}\n"));
        place.run(&[
            "discretize",
            "w.toml",
            "--out",
            "w.csv",
            "--force",
            "--format",
            "json",
        ])
    };
    let ran = with("scale = [1, 1, 1.3]").ends(3);
    assert!(ran.err.contains("stretch = true"), "{ran:?}");
    let json = with("scale = [1, 1, 1.3]\nstretch = true").ends(0).json();
    assert!(same(json["max_height_m"].as_f64().unwrap(), 1.3));
    let json = with("scale = 0.7").ends(0).json();
    assert!(same(json["max_height_m"].as_f64().unwrap(), 0.7));
    with("scale = [1, 2]").ends(3);
    with("scale = -1").ends(3);
}

/// The underside was taken for the top where that has a hole, and `--inspect` alone said so: lambda 29 % too small.
#[test]
fn regression_a_hole_in_a_body_s_top_was_passed_over_in_silence() {
    let place = Place::new();
    let warned = |name: &str, missing: &[[i32; 2]], sheet: bool| {
        let mut corners = Vec::new();
        for (i, j) in (0..16).map(|k| (k / 4, k % 4)) {
            if !missing.contains(&[i, j]) {
                let (x, y) = (20 * i - 40, 20 * j - 40);
                corners.push([
                    [x, y, 50],
                    [x + 20, y, 50],
                    [x + 20, y + 20, 50],
                    [x, y + 20, 50],
                ]);
            }
        }
        if !sheet {
            corners.push([[-40, -40, 20], [-40, 40, 20], [40, 40, 20], [40, -40, 20]]);
            let around = [[-40, -40], [40, -40], [40, 40], [-40, 40]];
            for k in 0..4 {
                let [[a, b], [c, d]] = [around[k], around[(k + 1) % 4]];
                corners.push([[a, b, 20], [c, d, 20], [c, d, 50], [a, b, 50]]);
            }
        }
        let points = corners.iter().flatten();
        let mut text: String = points.map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
        for k in 0..corners.len() {
            let [a, b, c, d] = [1, 2, 3, 4].map(|n| 4 * k + n);
            text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
        }
        place.write(name, &text);
        let args = [
            "--force", "--unit", "mm", "--format", "json", "--grid", "15x15", "--x", "-35,35",
            "--y", "-35,35",
        ];
        let ran = place
            .run(&[&["discretize", name], &args[..]].concat())
            .ends(0);
        let warnings = ran.json()["warnings"].to_string();
        warnings.contains("points lie on a single sheet")
    };
    assert!(warned("hole.obj", &[[2, 2]], false));
    assert!(warned(
        "holes.obj",
        &[[2, 2], [0, 1], [1, 1], [1, 3]],
        false
    ));
    // T-junctions alone, and open sheets.
    assert!(!warned("whole.obj", &[], false));
    assert!(!warned("sheet.obj", &[], true));
    assert!(!warned("torn.obj", &[[2, 2]], true));
    place
        .run(&["lambda", SEED, "hole.obj", "--unit", "mm", "--grid", "9x9"])
        .ends(0)
        .says(&["where the body has a hole"]);
}

#[test]
fn a_force_constant_of_weighted_points_is_held_against_the_grids() {
    let place = Place::new();
    let design = place
        .text(SEED)
        .replace("pitch_mm = 50.0", "pitch_mm = 50.0\ncoupling = \"none\"");
    place.write("design.toml", &design);
    let lambda = |flags: &[&str]| {
        let args = [
            "lambda",
            "design.toml",
            "shapes/half_sphere.toml",
            "--format",
            "json",
        ];
        place.run(&[&args[..], flags].concat()).ends(0).json()
    };
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let grid = lambda(&[]);
    assert!(grid.get("sampling").is_none());
    let [coarse, fine, noise] = [
        lambda(&["--max-deviation", "1mm"]),
        lambda(&["--max-deviation", "0.2mm"]),
        lambda(&["--poisson", "1.3mm", "--seed", "5"]),
    ];
    let constant = |reported: &serde_json::Value| number(&reported["lambda_n_per_m"]);
    for reported in [&coarse, &fine, &noise] {
        let sampling = &reported["sampling"];
        assert_eq!(sampling["grid_lambda_n_per_m"], grid["lambda_n_per_m"]);
        let change = constant(reported) / constant(&grid) - 1.0;
        assert!((number(&sampling["relative_change"]) - change).abs() < 1e-12);
    }
    assert_eq!(fine["sampling"]["sampling"], "adaptive");
    assert_eq!(noise["sampling"]["sampling"], "poisson");
    // Weighted by area, all ways of choosing points go to one limit; a grid's rim does not.
    let apart =
        |a: &serde_json::Value, b: &serde_json::Value| (constant(a) / constant(b) - 1.0).abs();
    assert!(
        apart(&fine, &noise) < 4e-3,
        "{} {}",
        constant(&fine),
        constant(&noise)
    );
    assert!(coarse["points"].as_u64() < fine["points"].as_u64());
    assert!(fine["accuracy"]["lambda_of_points"]["estimate"].is_number());
    assert!(number(&fine["accuracy"]["quadrature"]["estimate"]) < 5e-3);
    // More was stated, 1.2 %, of every fourth random point.
    let stated = number(&noise["accuracy"]["quadrature"]["estimate"]);
    assert!(
        apart(&fine, &noise) < stated && stated < 1.15e-2,
        "{stated}"
    );
    // A plane needs few points, its forces more: what wide patches miss is printed.
    let plane = |flags: &[&str]| {
        let args = [
            "lambda",
            "design.toml",
            "shapes/flat.toml",
            "--format",
            "json",
        ];
        let flags = [flags, &["--max-deviation", "1mm"]].concat();
        place.run(&[&args[..], &flags].concat()).ends(0).json()
    };
    let (resolved, wide) = (plane(&[]), plane(&["--max-width", "25mm"]));
    let off = apart(&wide, &resolved);
    let stated = number(&wide["accuracy"]["quadrature"]["estimate"]);
    assert!(
        off > 0.01 && off < stated && stated < 20.0 * off,
        "{off} {stated}"
    );
    assert!(number(&resolved["accuracy"]["quadrature"]["estimate"]) < 2e-3);
}

/// Patches as wide as the deviation were compared with themselves, one random point with nothing.
#[test]
fn regression_points_without_coarser_ones_stated_no_error() {
    let place = Place::new();
    for flags in [["--max-deviation", "40mm"], ["--poisson", "80mm"]] {
        let args = [
            "lambda",
            "designs/seed_air.toml",
            "shapes/half_sphere.toml",
            "--format",
            "json",
        ];
        let found = place.run(&[&args[..], &flags].concat()).ends(0).json();
        let number = |value: &serde_json::Value| value.as_f64().unwrap();
        let off = number(&found["sampling"]["relative_change"]).abs();
        let stated = number(&found["headline"]["force_error"]);
        assert!(off > 0.01 && stated > 0.3 * off, "{off} {stated}");
    }
}

/// The deviation of all points was stated as that between the jumps, beside which heights are off by the jump.
#[test]
fn graded_points_state_the_jumps_that_no_patch_follows() {
    let place = Place::new();
    // Two blocks side by side: a step of 10 mm at x = 4.7 mm.
    let mut stl = String::from("solid step\n");
    for ([from, to], top) in [([-20.0, 4.7], 30.0), ([4.7, 20.0], 40.0)] {
        for corners in [
            [[from, -20.0], [to, -20.0], [to, 20.0]],
            [[from, -20.0], [to, 20.0], [from, 20.0]],
        ] {
            stl += "facet normal 0 0 1 outer loop\n";
            for [x, y] in corners {
                stl += &format!("vertex {x} {y} {top}\n");
            }
            stl += "endloop endfacet\n";
        }
    }
    place.write("step.stl", &(stl + "endsolid\n"));
    let args = [
        "discretize",
        "step.stl",
        "--unit",
        "mm",
        "--max-deviation",
        "2mm",
    ];
    let said = place.run(&args).ends(0);
    let summary: serde_json::Value = serde_json::from_slice(&place.read("points.json")).unwrap();
    let patches = summary["border_patches"].as_u64().unwrap();
    let width_m = summary["border_width_m"].as_f64().unwrap();
    assert!(patches > 0 && width_m > 0.0 && width_m <= 2e-3, "{summary}");
    assert_eq!(summary["accuracy"]["borders"]["estimate"], width_m);
    let stated = format!("but for patches at rims and jumps: {patches}, no wider than");
    assert!(said.out.contains(&stated), "{said:?}");
    assert!(said.out.contains("points.csv, points.json"), "{said:?}");
    let smooth = [
        "discretize",
        "shapes/flat.toml",
        "--max-deviation",
        "2mm",
        "--out",
        "flat.csv",
    ];
    let said = place.run(&smooth).ends(0);
    assert!(!said.out.contains("jumps"), "{said:?}");
}

/// Points on no grid came without the warning, and an unknown share was reported as none.
#[test]
fn what_a_height_map_hides_is_a_warning_however_the_points_are_chosen() {
    let place = Place::new();
    // A double pyramid over a slab.
    let vertices = "-20 -20 0\n20 -20 0\n20 20 0\n-20 20 0\n-20 -20 10\n20 -20 10\n20 20 10\n-20 20 10\n\
                    12 0 30\n0 12 30\n-12 0 30\n0 -12 30\n0 0 40\n0 0 22\n";
    let faces = "2 1 0\n3 2 0\n4 5 6\n4 6 7\n0 1 5\n0 5 4\n1 2 6\n1 6 5\n2 3 7\n2 7 6\n3 0 4\n3 4 7\n\
                 8 9 12\n9 10 12\n10 11 12\n11 8 12\n9 8 13\n10 9 13\n11 10 13\n8 11 13\n";
    let off = |faces: &str| {
        let faces = faces.replace('\n', "\n3 ");
        let count = faces.lines().count() - 1;
        format!(
            "OFF\n14 {count} 0\n{vertices}3 {}\n",
            faces.trim_end_matches("3 ")
        )
    };
    place.write("whole.off", &off(faces));
    for flags in [
        ["--grid", "9x9"],
        ["--max-deviation", "4mm"],
        ["--poisson", "4mm"],
    ] {
        let args = ["discretize", "whole.off", "--unit", "mm", "--out", "-"];
        let said = place.run(&[&args[..], &flags].concat()).ends(0);
        said.says(&["of the area that faces up lies under other parts"]);
    }
    // One facet turned round, and one missing.
    let broken = faces
        .replacen("2 1 0\n", "2 0 1\n", 1)
        .replacen("1 2 6\n", "", 1);
    place.write("broken.off", &off(&broken));
    let args = ["discretize", "broken.off", "--unit", "mm", "--inspect"];
    let said = place.run(&args).ends(0);
    assert!(said.out.contains("an unknown share"), "{said:?}");
    let json = place
        .run(&[&args[..], &["--format", "json"]].concat())
        .json();
    assert!(json["hidden"]["of_upward"].is_null(), "{json}");
    let args = ["discretize", "broken.off", "--unit", "mm", "--out", "-"];
    place
        .run(&args)
        .ends(0)
        .says(&["is unknown, because the surface is open"]);
}

/// The request was passed over without a word.
#[test]
fn a_distance_that_is_not_certified_of_a_formula_is_a_warning() {
    let place = Place::new();
    let shape = "name = \"ball\"\nprimitive = \"half-sphere\"\n[points]\nx_mm = [-40, 40, 7]\ny_mm = [-40, 40, 7]\n";
    place.write("ball.toml", shape);
    let args = ["discretize", "ball.toml", "--out", "-", "--certify"];
    let said = place.run(&[&args[..], &["distance"]].concat()).ends(0);
    said.says(&["Hausdorff", "this surface is a formula", "mesh file"]);
    let said = place.run(&[&args[..], &["vertical"]].concat()).ends(0);
    assert!(!said.err.contains("Hausdorff"), "{said:?}");
}

/// An image of 15 kB took 4.5 GB under `--memory 1GB`.
#[test]
fn a_surface_that_takes_more_memory_than_granted_is_refused_before_it_is_made() {
    let place = Place::new();
    let image = |name: &str, side: u32| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side, side);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().unwrap();
        writer
            .write_image_data(&vec![70; (side * side) as usize])
            .unwrap();
        writer.finish().unwrap();
        place.write(name, &bytes);
    };
    image("large.png", 3000);
    // Of its 160 MB and 115 MB of points each was granted alone.
    image("middling.png", 400);
    let args = [
        "discretize",
        "middling.png",
        "--unit",
        "mm",
        "--scale",
        "0.1",
        "--out",
        "-",
        "--memory",
        "200MB",
    ];
    let ran = place
        .run(&[&args[..], &["--grid", "600x600"]].concat())
        .ends(3);
    assert!(
        ran.err.contains("the surface and 600 x 600 points"),
        "{ran:?}"
    );
    let ran = place
        .run(&[&args[..], &["--poisson", "0.05"]].concat())
        .ends(3);
    assert!(ran.err.contains("the surface and"), "{ran:?}");
    let args = [
        "discretize",
        "large.png",
        "--unit",
        "mm",
        "--out",
        "-",
        "--memory",
        "1GB",
    ];
    let ran = place.run(&args).ends(3);
    for part in ["triangles", "of memory", "--memory", "fewer pixels"] {
        assert!(ran.err.contains(part), "{part}: {ran:?}");
    }
    let small = [
        "discretize",
        "shapes/half_sphere.stl",
        "--unit",
        "mm",
        "--out",
        "-",
    ];
    place
        .run(&[&small[..], &["--memory", "1GB"]].concat())
        .ends(0);
}
