//! `compare`: differences that are known in closed form, symmetry, limits, the command itself.

use std::path::Path;

use fluxform::bundle::artefact::Input;
use fluxform::commands::compare::{CompareOptions, CompareReport, Pair, run};
use fluxform::design::{Design, Need};
use fluxform::progress::Silent;
use fluxform::scene::sources::ShapeSource;
use fluxform::scene::{Scene, passive, steel};
use fluxform::shape::document::ShapeDocument;
use fluxform_testing::needs::Trial;
use fluxform_testing::place::Place;
use fluxform_testing::{committed, needs, root, trials};
use serde_json::Value;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [an_object_does_not_differ_from_itself, the_order_does_not_matter, the_map_holds_the_largest_difference_with_its_sign, a_lifted_surface_is_apart_by_its_height_with_feedback, beside_an_object_there_is_no_force_with_feedback, stronger_currents_only_lift_weak_forces_over_the_threshold, the_unpowered_steel_pulls_on_both_alike, where_nothing_can_be_rendered_nothing_is_compared, the_bytes_do_not_depend_on_threads, the_command_reports_draws_and_refuses],
        needs::python() => [the_confusions_are_what_the_readme_shows],
    }
}

const JND: f64 = 0.07;
const OWN: CompareOptions = CompareOptions {
    lambda_n_per_m: None,
    jnd: JND,
    tolerance: None,
    maps: false,
};

fn design(changes: &[(&str, &str)]) -> Design {
    let path = root().join("designs/seed_air.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    Design::from_toml(&text, &path, Need::LAMBDA).unwrap().0
}

fn shape(name: &str, lines: &str) -> ShapeSource {
    let grid = "[points]\nx_mm = [-50.0, 50.0, 21]\ny_mm = [-50.0, 50.0, 17]\n";
    let text = format!("name = \"{name}\"\n{lines}\n{grid}");
    ShapeSource {
        document: ShapeDocument::from_toml(&text, Path::new("s.toml"))
            .unwrap()
            .0,
        input: None,
    }
}

fn flat(name: &str, height_mm: f64) -> ShapeSource {
    let lines = format!("primitive = \"flat\"\nside_mm = 100.0\nheight_mm = {height_mm:?}");
    shape(name, &lines)
}

fn wedge(name: &str) -> ShapeSource {
    shape(name, "primitive = \"wedge\"")
}

fn dome(name: &str) -> ShapeSource {
    shape(
        name,
        "primitive = \"half-sphere\"\nradius_mm = 37.0\nbase_mm = 30.0",
    )
}

fn compared(design: &Design, shapes: &[ShapeSource], options: &CompareOptions) -> CompareReport {
    let input = Input::of_bytes("design.toml", b"");
    run(design, shapes, &input, options, &Silent).unwrap()
}

fn numbers(pair: &Pair) -> [f64; 6] {
    [
        pair.static_jnd,
        pair.feedback_jnd,
        pair.static_rms_jnd,
        pair.feedback_rms_jnd,
        pair.static_felt_share,
        pair.feedback_felt_share,
    ]
    .map(Option::unwrap)
}

fn an_object_does_not_differ_from_itself() {
    let file = compared(&design(&[]), &[wedge("one"), wedge("other")], &OWN);
    assert_eq!(numbers(&file.pairs[0]), [0.0; 6]);
}

fn the_order_does_not_matter() {
    let design = design(&[]);
    let ab = compared(&design, &[wedge("a"), dome("b"), flat("c", 50.0)], &OWN);
    let ba = compared(&design, &[flat("c", 50.0), dome("b"), wedge("a")], &OWN);
    let names: Vec<_> = ab.pairs.iter().map(|p| (&*p.a, &*p.b)).collect();
    assert_eq!(names, [("a", "b"), ("a", "c"), ("b", "c")]);
    for pair in &ab.pairs {
        let same = |p: &&Pair| p.a == pair.b && p.b == pair.a;
        let turned = ba.pairs.iter().find(same).unwrap();
        // Sums over the two surfaces are taken in another order.
        for (one, other) in numbers(pair).into_iter().zip(numbers(turned)) {
            assert!((one - other).abs() <= 1e-14 * one, "{one} {other}");
        }
        let (here, there) = (pair.static_at.as_ref(), turned.static_at.as_ref());
        let largest = |(a, b): (f64, f64)| (a - b).abs();
        let of = |at: Option<&fluxform::commands::compare::Place>| {
            at.map(|at| largest((at.a_force_n, at.b_force_n))).unwrap()
        };
        assert!((of(here) / of(there) - 1.0).abs() < 1e-12);
    }
}

fn the_map_holds_the_largest_difference_with_its_sign() {
    let design = design(&[]);
    let options = CompareOptions { maps: true, ..OWN };
    // Nothing is compared with what cannot be rendered.
    let shapes = [wedge("a"), dome("b"), flat("nothing", 0.0)];
    let drawn = compared(&design, &shapes, &options);
    let swapped = compared(&design, &[dome("b"), wedge("a")], &options);
    assert_eq!((drawn.maps.len(), swapped.maps.len()), (4, 4));
    let values = |report: &CompareReport, map: usize| -> Vec<f64> {
        report.maps[map].values.iter().flatten().copied().collect()
    };
    let largest = |drive: usize| {
        let both = [drive, 2 + drive].map(|map| values(&drawn, map));
        both.concat()
            .into_iter()
            .fold(0.0, |most: f64, value| most.max(value.abs()))
    };
    let pair = &drawn.pairs[0];
    assert_eq!(
        [largest(0), largest(1)].map(Some),
        [pair.static_jnd, pair.feedback_jnd]
    );
    for map in 0..4 {
        let negative: Vec<f64> = values(&swapped, (map + 2) % 4).iter().map(|v| -v).collect();
        assert_eq!(values(&drawn, map), negative, "{map}");
    }
    // The dome leaves the corners of its grid free.
    assert!(values(&drawn, 2).len() < values(&drawn, 0).len());
    let svg = drawn.map().drawing().svg();
    assert!(svg.contains("a over b / JND on b, position feedback"));
    assert!(compared(&design, &shapes, &OWN).maps.is_empty());
}

fn a_lifted_surface_is_apart_by_its_height_with_feedback() {
    let shapes = [flat("low", 50.0), flat("high", 54.0)];
    // 4 mm of 54 mm: where the relative difference decides.
    let strong = CompareOptions {
        lambda_n_per_m: Some(0.3),
        ..OWN
    };
    let file = compared(&design(&[]), &shapes, &strong);
    let expected = (54.0 - 50.0) / 54.0 / JND;
    let pair = &file.pairs[0];
    for found in [pair.feedback_jnd, pair.feedback_rms_jnd] {
        assert!((found.unwrap() / expected - 1.0).abs() < 1e-12, "{pair:?}");
    }
    assert_eq!(pair.feedback_felt_share, Some(1.0));
    assert!(file.shapes.iter().all(|s| s.saturated_share == Some(0.0)));
    assert_eq!(file.criterion, "given");
    // 4 mm at 0.13 N/m, below the smallest force that is felt: in units of that.
    let weak = CompareOptions {
        lambda_n_per_m: Some(0.13),
        ..OWN
    };
    let file = compared(&design(&[]), &shapes, &weak);
    let found = file.pairs[0].feedback_jnd.unwrap();
    assert!((found / (0.13 * 4e-3 / 0.8e-3) - 1.0).abs() < 1e-12);
    // Static currents differ too, but by what they can do, not by what is requested.
    let fixed = file.pairs[0].static_jnd.unwrap();
    assert!(fixed > 0.0 && (fixed / found - 1.0).abs() > 1e-3);
}

fn beside_an_object_there_is_no_force_with_feedback() {
    let file = compared(&design(&[]), &[flat("flat", 50.0), dome("dome")], &OWN);
    let pair = &file.pairs[0];
    assert!((pair.feedback_jnd.unwrap() * JND - 1.0).abs() < 1e-12);
    let at = pair.feedback_at.as_ref().unwrap();
    assert!(at.on == "flat" && at.x_m.hypot(at.y_m) > 0.037);
    assert!(at.a_force_n > 0.0 && at.b_force_n == 0.0);
}

fn stronger_currents_only_lift_weak_forces_over_the_threshold() {
    let shapes = [flat("flat", 50.0), wedge("wedge"), dome("dome")];
    let with = |current_a: f64| {
        let current = format!("current_max_a = {current_a:?}");
        let total = format!("total_current_max_a = {:?}", 9.0 * current_a);
        let design = design(&[
            ("current_max_a = 2.0", &current),
            ("total_current_max_a = 18.0", &total),
            ("voltage_v = 36.0", "voltage_v = 1e9"),
        ]);
        compared(&design, &shapes, &OWN)
    };
    let [weakest, weak, usual, strong, stronger] = [1e-3, 2e-3, 2.0, 2e4, 4e4].map(with);
    for k in 0..weak.pairs.len() {
        let of = |file: &CompareReport| numbers(&file.pairs[k]);
        for what in 0..4 {
            let [weakest, weak, usual, strong, stronger] =
                [&weakest, &weak, &usual, &strong, &stronger].map(|file| of(file)[what]);
            // All below the threshold: proportional; all above it: no change.
            assert!((weak / weakest / 2.0 - 1.0).abs() < 1e-9, "{k} {what}");
            assert!((stronger / strong - 1.0).abs() < 1e-3, "{k} {what}");
            assert!(
                weak <= usual && usual <= strong * (1.0 + 1e-12),
                "{k} {what}"
            );
        }
    }
}

fn the_unpowered_steel_pulls_on_both_alike() {
    let text = std::fs::read_to_string(root().join("designs/seed.toml")).unwrap();
    let text = text.replace("pitch_mm = 50.0", "pitch_mm = 50.0\ncoupling = \"none\"");
    let design = |passive: bool| {
        let text = text.replace("[magnet]", &format!("[magnet]\npassive_force = {passive}"));
        let design = Design::from_toml(&text, Path::new("d.toml"), Need::LAMBDA);
        design.unwrap().0
    };
    let of = |passive: bool| {
        let design = design(passive);
        let options = CompareOptions {
            lambda_n_per_m: Some(0.7),
            ..OWN
        };
        compared(&design, &[flat("low", 50.0), flat("high", 56.0)], &options)
    };
    let (with, without) = (of(true), of(false));
    // The requested force includes the pull, so feedback does not differ; static currents leave some.
    let felt = |file: &CompareReport| file.pairs[0].feedback_jnd.unwrap();
    assert!((felt(&with) / felt(&without) - 1.0).abs() < 1e-9);
    let fixed = |file: &CompareReport| file.pairs[0].static_rms_jnd.unwrap();
    assert!((fixed(&with) / fixed(&without) - 1.0).abs() > 1e-4);
    // Beside what the currents give it is pulled sideways too, which was left out.
    let design = design(true);
    let scene = Scene::new(&design).unwrap();
    let place = with.pairs[0].static_at.as_ref().unwrap();
    let at_m = [[place.x_m, place.y_m, place.z_m]];
    let solved = steel::solve(&scene, scene.tolerances.forces, at_m[0][2]).unwrap();
    let per_ampere = scene
        .force_vectors_n_per_a(&solved, &at_m, &Silent)
        .unwrap();
    let pull_n = passive::pull(&scene, &at_m, false)
        .unwrap()
        .unwrap()
        .force_n(at_m[0]);
    assert!(pull_n[0].hypot(pull_n[1]) > 1e-4, "{pull_n:?}");
    let currents_a = with.shapes[0].currents_a.as_ref().unwrap();
    for axis in 0..3 {
        let given = per_ampere
            .iter()
            .zip(currents_a)
            .map(|(force, i)| force[axis] * i);
        let expected = given.sum::<f64>() + pull_n[axis];
        assert!(
            (place.a_vector_n[axis] - expected).abs() < 1e-6,
            "{axis} {expected} {place:?}"
        );
    }
}

fn where_nothing_can_be_rendered_nothing_is_compared() {
    let design = design(&[("\"repel\"", "\"attract\"")]);
    let file = compared(&design, &[wedge("a"), dome("b")], &OWN);
    assert_eq!(file.without_constant(), ["a", "b"]);
    assert_eq!(file.pairs[0].static_jnd, None);
    assert_eq!(file.pairs[0].feedback_at, None);
    assert!(!file.picture().drawing().svg().contains("NaN"));
}

fn the_bytes_do_not_depend_on_threads() {
    let in_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let work = || compared(&design(&[]), &[wedge("a"), dome("b")], &OWN);
        pool.build().unwrap().install(work)
    };
    assert_eq!(in_threads(1), in_threads(3));
}

fn the_command_reports_draws_and_refuses() {
    let place = Place::new();
    let air = "designs/seed_air.toml";
    let two = ["shapes/flat.toml", "shapes/wedge.toml"];
    let plot = ["--plot", "apart.svg", "--format", "json"];
    let compare = [&["compare", air], &two[..], &plot[..]].concat();
    let json = place.run(&compare).ends(0).json();
    let pair = &json["pairs"][0];
    assert_eq!((&pair["a"], &pair["b"]), (&"flat".into(), &"wedge".into()));
    let jnd = pair["static_jnd"].as_f64().unwrap();
    assert!(jnd > 1.0 && jnd <= 1.0 / JND);
    let drawn = place.text("apart.svg");
    assert!(drawn.contains("wedge") && drawn.contains(&format!("{jnd:.2}")));
    // The lambdas are those of `lambda`.
    let alone = place
        .run(&["lambda", air, two[1], "--format", "json"])
        .json();
    let lambda = |value: &Value| value.as_f64().unwrap();
    let here = lambda(&json["shapes"][1]["lambda_n_per_m"]);
    assert!((here / lambda(&alone["lambda_n_per_m"]) - 1.0).abs() < 1e-9);

    place.run(&["compare", air, two[0]]).ends(2);
    let same = place.run(&["compare", air, two[0], two[0]]);
    same.ends(3).says(&["two shapes are called"]);
    place.write("apart.svg", "mine");
    place.run(&compare).ends(4);
}

fn the_confusions_are_what_the_readme_shows() {
    let place = Place::with(&["scripts", "designs", "shapes"]);
    let printed = place.shell("python3 scripts/confusion.py $(command -v fluxform)");
    let page = committed("results/README.md");
    for part in printed.ends(0).out.split("\n\n") {
        assert!(
            page.contains(part.trim_end()),
            "not in results/README.md:\n{part}"
        );
    }
}
