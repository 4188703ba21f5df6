//! The screen: widths, colours, and what is listed.

use crate::SEED;
use fluxform_testing::place::Place;

const SMALL: &str = "name = \"flat\"\nprimitive = \"flat\"\n[points]\nx_mm = [-50.0, 50.0, 5]\n\
                     y_mm = [-50.0, 50.0, 5]\n";

#[test]
fn summaries_keep_to_the_terminal_s_width_and_break_between_words() {
    let place = Place::new();
    place.write("small.toml", SMALL);
    for command in [
        "evaluate designs/seed_air.toml",
        "calibrate designs/seed_air.toml small.toml --no-report",
        "lambda designs/seed_air.toml small.toml --variants",
        "optimize designs/seed_air.toml --starts 2",
        "map designs/seed_air.toml --out maps",
        "discretize small.toml",
        "keys",
        "--explain list",
    ] {
        let words = |text: &str| {
            let mut words: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
            words.sort();
            words.dedup();
            words
        };
        let narrow = place.shell(&format!("COLUMNS=80 fluxform {command}"));
        assert_eq!(narrow.code, Some(0), "{command}: {}", narrow.err);
        let longest = narrow.out.lines().map(|line| line.chars().count()).max();
        assert!(longest.unwrap() <= 80, "{command}:\n{}", narrow.out);
        let wide = place.shell(&format!("fluxform {command}"));
        assert_eq!(words(&narrow.out), words(&wide.out), "{command}");
    }
}

#[test]
fn limits_that_are_not_met_are_coloured() {
    let place = Place::new();
    let coloured = place.run(&["evaluate", SEED, "--color", "always"]).ends(0);
    assert!(
        coloured.out.contains("\u{1b}[1;31mNOT met\u{1b}[0m"),
        "{}",
        coloured.out
    );
    let plain = place.run(&["evaluate", SEED]).ends(0);
    assert!(
        !plain.out.contains('\u{1b}') && plain.out.contains("NOT met"),
        "{}",
        plain.out
    );
}

#[test]
fn every_file_that_was_written_is_named() {
    let place = Place::new();
    place.write("small.toml", SMALL);
    let args = [
        "optimize",
        SEED,
        "--starts",
        "2",
        "--out",
        "best.toml",
        "--report",
        "best.html",
    ];
    let ran = place.run(&args).ends(0);
    assert!(
        ran.err.contains("best.toml") && ran.err.contains("best.html"),
        "{ran:?}"
    );
    let ran = place
        .run(&["lambda", SEED, "small.toml", "--plot", "path.svg"])
        .ends(0);
    assert!(ran.err.contains("written: path.svg"), "{ran:?}");
    let ran = place
        .run(&["discretize", "small.toml", "--out", "points.csv"])
        .ends(0);
    assert!(
        ran.out.contains("points.csv") && ran.out.contains("points.json"),
        "{ran:?}"
    );
}

#[test]
fn a_sweep_leads_with_the_best_design_within_its_limits() {
    let place = Place::new();
    let plan = ["sweep", "plan", SEED, "--set", "coil.turns=700,1100,1400"];
    place
        .run(&[&plan[..], &["--set", "supply.current_max_a=1.3"]].concat())
        .ends(0);
    place
        .run(&["sweep", "run", "plan.json", "--out", "points"])
        .ends(0);
    let merge = [
        "sweep",
        "merge",
        "plan.json",
        "points",
        "--out",
        "sweep.csv",
    ];
    let ran = place.run(&merge).ends(0).out;
    let line = ran.lines().nth(1).unwrap();
    assert!(
        line.contains("best") && line.contains("design 2: coil.turns = 1400"),
        "{ran}"
    );
    assert!(ran.contains("the strongest within its limits"), "{ran}");
    let json = place
        .run(&[&merge[..], &["--format", "json"]].concat())
        .ends(0)
        .json();
    assert_eq!(json["best"]["index"], 2);
    assert_eq!(json["best"]["limits_met"], true);
    // Stronger designs that miss their limits do not lead.
    let plan = [
        "sweep",
        "plan",
        SEED,
        "--set",
        "coil.turns=1100,1429,1500",
        "--out",
        "over.json",
    ];
    place.run(&plan).ends(0);
    place
        .run(&["sweep", "run", "over.json", "--out", "over"])
        .ends(0);
    let merge = [
        "sweep",
        "merge",
        "over.json",
        "over",
        "--out",
        "over.csv",
        "--format",
        "json",
    ];
    let json = place.run(&merge).ends(0).json();
    assert_eq!(json["best"]["index"], 0, "{json}");
}

#[test]
fn a_broken_coil_is_no_improvement() {
    let place = Place::new();
    let args = ["lambda", SEED, "shapes/half_sphere.toml", "--variants"];
    let ran = place.run(&args).ends(0).out;
    let json = place
        .run(&[&args[..], &["--format", "json"]].concat())
        .ends(0)
        .json();
    for variant in json["variants"].as_array().unwrap() {
        let (name, change) = (
            variant["name"].as_str().unwrap(),
            &variant["relative_change"],
        );
        let row = ran
            .lines()
            .find(|line| line.trim_start().starts_with(&format!("{name} ")));
        let row = row.unwrap_or_else(|| panic!("{name}: {ran}"));
        let gains = change.as_f64().is_some_and(|change| change > 0.0);
        assert_eq!(
            row.contains("fault)"),
            gains && name.contains("broken"),
            "{row}"
        );
    }
}
