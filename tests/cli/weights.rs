//! Points by the area they stand for: lambda of the object, not of its grid.

use fluxform_testing::place::Place;
use serde_json::Value;

use crate::SEED;

/// A wedge with so many points along each axis.
fn wedge(place: &Place, samples: usize, weights: &str) -> String {
    let name = format!("wedge_{samples}.toml");
    let text = format!(
        "name = \"wedge\"\nprimitive = \"wedge\"\n[points]\nx_mm = [-50.0, 50.0, {samples}]\n\
         y_mm = [-50.0, 50.0, {samples}]\n{weights}"
    );
    place.write(&name, &text);
    name
}

fn solved(place: &Place, shape: &str, flags: &[&str]) -> Value {
    let args = ["lambda", SEED, shape, "--format", "json"];
    place.run(&[&args[..], flags].concat()).ends(0).json()
}

fn lambda(solved: &Value) -> f64 {
    solved["lambda_n_per_m"].as_f64().expect("a number")
}

fn stated(solved: &Value) -> f64 {
    let stage = &solved["accuracy"]["lambda_of_points"]["estimate"];
    stage.as_f64().expect("a number")
}

/// A plane's lambda by 61 x 61 equal points was off by 0.7 % with 1e-10 stated: the border counts
/// twice. By area it converges with the second power of the spacing.
#[test]
fn the_wedge_at_61_points_is_off_by_what_is_stated() {
    let place = Place::new();
    let at = |samples: usize, flags: &[&str]| {
        let shape = wedge(&place, samples, "");
        solved(&place, &shape, flags)
    };
    let area = ["--weights", "area"];
    let limit = lambda(&at(241, &area));
    let off = |of: &Value| (lambda(of) / limit - 1.0).abs();
    let equal = at(61, &[]);
    assert!((6e-3..1.2e-2).contains(&off(&equal)), "{}", off(&equal));
    let [coarse, fine] = [31, 61].map(|samples| at(samples, &area));
    assert_eq!(fine["weights"], "area");
    assert_eq!(equal["weights"], Value::Null);
    let order = (off(&coarse) / off(&fine)).log2();
    assert!((1.7..2.4).contains(&order), "{order}");
    for one in [&equal, &coarse, &fine] {
        let (stated, off) = (stated(one), off(one));
        assert!(stated >= off && stated < 40.0 * off, "{stated} of {off}");
    }
}

#[test]
fn a_shape_file_and_a_flag_choose_the_weights_and_bundles_by_area_pass_verify() {
    let place = Place::new();
    let own = wedge(&place, 21, "weights = \"area\"\n");
    let by_file = solved(&place, &own, &[]);
    assert_eq!(by_file["weights"], "area");
    let equal = solved(&place, &own, &["--weights", "equal"]);
    assert!((lambda(&by_file) / lambda(&equal) - 1.0).abs() > 1e-3);
    let wrong = wedge(&place, 22, "weights = \"aera\"\n");
    let refused = place.run(&["lambda", SEED, &wrong]).ends(3);
    refused.says(&["did you mean \"area\"?"]);
    let graded = ["--weights", "area", "--max-deviation", "1mm"];
    place
        .run(&[&["lambda", SEED, &own], &graded[..]].concat())
        .ends(2);
    // By the file and by the flag; another rule is another bundle.
    place.run(&["calibrate", SEED, &own, "--out", "a"]).ends(0);
    let plain = wedge(&place, 23, "");
    let area = ["--weights", "area"];
    let by_flag = ["calibrate", SEED, &plain, "--out", "b"];
    place.run(&[&by_flag[..], &area].concat()).ends(0);
    place.run(&by_flag).ends(4).says(&["weights"]);
    for bundle in ["a/seed_air/wedge", "b/seed_air/wedge"] {
        place.run(&["verify", bundle]).ends(0);
    }
}

/// A rim low over the coils weighs much, and no point lies on it: half the points said nothing of that.
#[test]
fn what_a_rim_leaves_between_points_and_silhouette_is_stated() {
    let place = Place::new();
    let at = |samples: usize| {
        let text = format!(
            "name = \"dome\"\nprimitive = \"half-sphere\"\nradius_mm = 67.0\nbase_mm = 11.0\n\
             [points]\nx_mm = [-50.0, 50.0, {samples}]\ny_mm = [-50.0, 50.0, {samples}]\n"
        );
        let name = format!("dome_{samples}.toml");
        place.write(&name, &text);
        solved(&place, &name, &["--weights", "area"])
    };
    let limit = lambda(&at(321));
    for samples in [31, 61, 121] {
        let coarse = at(samples);
        let off = (lambda(&coarse) / limit - 1.0).abs();
        assert!(
            stated(&coarse) >= off,
            "{samples}: {} of {off}",
            stated(&coarse)
        );
    }
}

/// Columns of a table.
#[test]
fn the_table_of_points_states_the_area_of_each() {
    let place = Place::new();
    let shape = "name = \"dome\"\nprimitive = \"half-sphere\"\nradius_mm = 41.3\n[points]\n\
                 x_mm = [-50.0, 50.0, 41]\ny_mm = [-50.0, 50.0, 41]\n";
    place.write("dome.toml", shape);
    let table = |flags: &[&str]| {
        let args = ["discretize", "dome.toml", "--out", "-"];
        place.run(&[&args[..], flags].concat()).ends(0).out
    };
    assert!(!table(&[]).lines().next().unwrap().contains("weight"));
    let weighted = table(&["--weights", "area"]);
    let mut lines = weighted.lines();
    assert!(lines.next().unwrap().ends_with(",weight_m2"));
    let last = |line: &str| line.rsplit(',').next().unwrap().parse::<f64>().unwrap();
    let area: f64 = lines.map(last).sum();
    let disc = std::f64::consts::PI * 0.0413 * 0.0413;
    assert!((area / disc - 1.0).abs() < 3e-3, "{area} of {disc}");
}

/// Errors of patches as wide as the deviation allows and of those as wide as may be have opposite signs on a turned box:
/// their sum was stated, which was nearly nothing.
#[test]
fn errors_of_opposite_signs_are_both_stated() {
    let place = Place::new();
    place.write(
        "desk.toml",
        "name = \"desk\"\n[coil]\ninner_diameter_mm = 8\nouter_diameter_mm = 26\nlength_mm = 40\nturns = 918\n\
         [wire]\ndiameter_mm = 0.56\n[array]\nrows = 3\ncolumns = 3\npitch_mm = 28\n[magnet]\n\
         magnetization_a_per_m = 1e6\n[supply]\ncurrent_max_a = 2\nvoltage_v = 24\n[workspace]\n\
         x_mm = [-30, 30, 31]\ny_mm = [-30, 30, 31]\nz_mm = [8, 48, 21]\n",
    );
    let corners = "v -11 -5 -6\nv -11 -5 6\nv -11 5 -6\nv -11 5 6\nv 11 -5 -6\nv 11 -5 6\nv 11 5 -6\nv 11 5 6\n";
    let faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";
    place.write("box.obj", &format!("{corners}{faces}"));
    let solved = |flags: &[&str]| {
        let args = [
            "lambda",
            "desk.toml",
            "box.obj",
            "--unit",
            "mm",
            "--center",
            "--rest-on",
            "12mm",
        ];
        let turned = ["--rotate=68,30,32", "--format", "json"];
        place.run(&[&args[..], &turned, flags].concat()).json()
    };
    let area = solved(&["--grid", "301x301", "--weights", "area"]);
    assert!(stated(&area) < 1e-3);
    for width in [&[][..], &["--max-width", "3mm"]] {
        let patches = solved(&[&["--max-deviation", "0.3mm"], width].concat());
        let off = (lambda(&patches) / lambda(&area) - 1.0).abs();
        assert!(
            off < stated(&patches) + stated(&area),
            "{off} {}",
            stated(&patches)
        );
    }
}
