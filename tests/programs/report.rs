//! Pages: their contents, that inputs stay texts, and that a browser draws them.

use std::path::Path;
use std::process::{Command, Output};

use fluxform_testing::needs::Trial;
use fluxform_testing::place::Place;
use fluxform_testing::{needs, root, trials};
use serde_json::Value;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [a_bundle_holds_its_page_and_verify_checks_it, the_page_agrees_with_the_files, pages_are_the_same_bytes_whatever_the_threads, a_hostile_path_stays_text, a_page_can_be_left_out_and_is_there_without_a_force_constant, optimize_and_sweep_write_pages, a_replay_is_watched_on_a_page],
        no_browser() => [a_browser_draws_the_page_and_answers, a_browser_draws_the_pages_of_a_null_constant_of_optimize_and_of_a_sweep, a_browser_moves_the_finger_of_a_replay],
    }
}

const DESIGN: &str = "designs/seed_air.toml";
/// Largest size of a page, bytes.
const MOST_BYTES: usize = 600_000;

fn run(place: &Place, arguments: &[&str], code: i32) -> String {
    place.run(arguments).ends(code).out
}

fn listed(place: &Place, bundle: &str) -> Vec<String> {
    let manifest = place.text(&format!("{bundle}/manifest.json"));
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    let files = manifest["files"].as_array().unwrap();
    let name = |file: &Value| file["path"].as_str().unwrap().to_owned();
    files.iter().map(name).collect()
}

/// A page that needs nothing but itself, is one document, and is not too large.
fn is_a_page(html: &str) {
    assert!(html.len() < MOST_BYTES, "{} bytes", html.len());
    assert!(html.ends_with("</html>\n"));
    assert_eq!(html.matches("<h1").count(), 1);
    assert_eq!(html.matches("<script").count(), 2, "data and program");
    assert!(html.contains("default-src 'none'") && !html.contains("unsafe-"));
    let own = html
        .replace("http://www.w3.org/2000/svg", "")
        .replace("url(#", "");
    for outside in ["http:", "https:", "//cdn", "@import", "url("] {
        assert!(!own.contains(outside), "{outside}");
    }
    for named in html.split(" src=\"").skip(1) {
        assert!(named.starts_with("data:image/svg+xml;base64,"));
    }
    for unwanted in ["NaN", "undefined", "inf "] {
        let shown = html.split("<script").next().unwrap();
        assert!(!shown.contains(unwanted), "{unwanted}");
    }
}

fn a_bundle_holds_its_page_and_verify_checks_it() {
    let place = Place::new();
    run(&place, &["calibrate", DESIGN, "shapes/wedge.toml"], 0);
    let bundle = "results/seed_air/wedge";
    let listed = listed(&place, bundle);
    let pages = [
        "report.html",
        "plots/lambda.svg",
        "plots/lambda.csv",
        "plots/errors.csv",
        "plots/field.svg",
        "plots/field.csv",
    ];
    for name in pages {
        assert!(listed.iter().any(|one| one == name), "{name}: {listed:?}");
    }
    let html = place.text(&format!("{bundle}/report.html"));
    is_a_page(&html);
    for reported in [
        "<h1>wedge on seed_air</h1>",
        "<h2 id=\"answer-h\">Result",
        "Accuracy</h2>",
        "Limits</h2>",
        "duality gap",
        "nodes of the map",
        "id=\"draw-turn\"",
        "id=\"draw-path\"",
        "id=\"draw-currents\"",
        "id=\"draw-errors\"",
        "id=\"draw-field\"",
        "shapes/wedge.stl",
    ] {
        assert!(html.contains(reported), "{reported}");
    }
    // The shipped curve says that it is not this run's.
    assert!(html.contains("id=\"draw-cost\"") && html.contains("Not measured in this run"));
    run(&place, &["verify", bundle], 0);
    place.write(
        &format!("{bundle}/report.html"),
        &html.replacen("<h2 id=\"answer-h\">Result", "The onswer", 1),
    );
    run(&place, &["verify", bundle], 5);
}

fn the_page_agrees_with_the_files() {
    let place = Place::new();
    run(&place, &["calibrate", DESIGN, "shapes/flat.toml"], 0);
    let bundle = "results/seed_air/flat";
    let html = place.text(&format!("{bundle}/report.html"));
    let lambda: Value =
        serde_json::from_str(&place.text(&format!("{bundle}/lambda.json"))).unwrap();
    let chosen = lambda["lambda_n_per_m"].as_f64().unwrap();
    // Its first digits, cut off rather than rounded.
    let digits = &chosen.to_string()[..5];
    assert!(html.contains(digits), "{digits}");
    let worst = lambda["worst_error_n"].as_f64().unwrap() * 1e3;
    assert!(html.contains(&worst.to_string()[..4]), "{worst}");
    // Every plot has its numbers beside it, in as many rows as are drawn.
    let errors = place.text(&format!("{bundle}/plots/errors.csv"));
    assert_eq!(errors.lines().count(), 3722);
    let mut largest = 0.0_f64;
    for line in errors.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        largest = largest.max((cells[3] - cells[2]).abs());
    }
    assert!((largest * 1e3 / worst - 1.0).abs() < 1e-12);
    let field = place.text(&format!("{bundle}/plots/field.csv"));
    assert!(field.starts_with("x_m,y_m,z_m,dbz_dz_t_per_m\n"));
    assert_eq!(field.lines().count(), 3 * 41 * 41 + 1);
}

fn pages_are_the_same_bytes_whatever_the_threads() {
    let place = Place::new();
    for (threads, out) in [("1", "one"), ("2", "two")] {
        let arguments = [
            "calibrate",
            DESIGN,
            "shapes/half_sphere.toml",
            "--threads",
            threads,
            "--out",
            out,
        ];
        run(&place, &arguments, 0);
    }
    for name in [
        "report.html",
        "plots/lambda.svg",
        "plots/field.svg",
        "plots/errors.csv",
    ] {
        let read = |out: &str| place.text(&format!("{out}/seed_air/half-sphere/{name}"));
        let text = read("one");
        assert!(text == read("two"), "{name}");
        let machine = place.root().to_string_lossy().into_owned();
        assert!(
            !text.contains(&machine),
            "{name} names the machine's folders"
        );
    }
}

fn a_hostile_path_stays_text() {
    let place = Place::new();
    // A folder and a file: a path may hold what ends a script.
    let hostile = "bad<!--<script><b/script><img src=x onerror=\"alert('1')\">&amp;.toml";
    let shape = place.text("shapes/flat.toml");
    place.write(
        hostile,
        &shape.replace("\"flat.stl\"", "\"../shapes/flat.stl\""),
    );
    let hostile_at = format!("./{hostile}");
    let shown = run(
        &place,
        &["calibrate", DESIGN, &hostile_at, "--format", "json"],
        0,
    );
    let reported: Value = serde_json::from_str(&shown).unwrap();
    let folder = reported["bundles"][0]["folder"].as_str().unwrap();
    let html = place.text(&format!("{folder}/report.html"));
    is_a_page(&html);
    assert!(html.contains("&lt;img src=x onerror=&quot;alert(&#39;1&#39;)&quot;&gt;&amp;amp;"));
    assert!(!html.contains("<img") && !html.contains("bad<"));
}

fn a_page_can_be_left_out_and_is_there_without_a_force_constant() {
    let place = Place::new();
    let arguments = ["calibrate", DESIGN, "shapes/flat.toml", "--no-report"];
    run(&place, &arguments, 0);
    let bundle = "results/seed_air/flat";
    let listed = listed(&place, bundle);
    assert!(
        !listed
            .iter()
            .any(|name| name.contains("plots") || name.contains("report"))
    );
    assert!(!place.path(&format!("{bundle}/report.html")).exists());
    let place = attracted();
    let html = place.text("results/attract/flat/report.html");
    is_a_page(&html);
    assert!(html.contains("There is no force constant"));
}

/// A bundle without a force constant.
fn attracted() -> Place {
    let place = Place::new();
    // Magnets that are only attracted cannot be pushed up.
    let design = place.text(DESIGN).replace("repel", "attract");
    let design = if design.contains("attract") {
        design
    } else {
        format!("{design}\n[magnet]\npolarity = \"attract\"\n")
    };
    place.write(
        "attract.toml",
        &design.replace("\"seed_air\"", "\"attract\""),
    );
    run(
        &place,
        &["calibrate", "attract.toml", "shapes/flat.toml"],
        4,
    );
    place
}

/// A sweep and its page.
fn swept() -> Place {
    let place = Place::new();
    let set = [
        "--set",
        "wire.diameter_mm=0.5:0.8:0.1",
        "--set",
        "coil.outer_diameter_mm=30,34,38",
    ];
    let plan = [
        "sweep",
        "plan",
        DESIGN,
        set[0],
        set[1],
        set[2],
        set[3],
        "--out",
        "plan.json",
    ];
    run(&place, &plan, 0);
    run(&place, &["sweep", "run", "plan.json", "--out", "points"], 0);
    let merge = [
        "sweep",
        "merge",
        "plan.json",
        "points",
        "--report",
        "sweep.html",
    ];
    run(&place, &merge, 0);
    place
}

fn optimize_and_sweep_write_pages() {
    let place = Place::new();
    run(&place, &["optimize", DESIGN, "--report", "best.html"], 0);
    let html = place.text("best.html");
    is_a_page(&html);
    for reported in [
        "Certificate: global",
        "held back by",
        "1 % more",
        "as given",
    ] {
        assert!(html.contains(reported), "{reported}");
    }
    run(&place, &["optimize", DESIGN, "--report", "best.html"], 0);
    place.write("other.html", "mine");
    run(&place, &["optimize", DESIGN, "--report", "other.html"], 4);
    run(
        &place,
        &["optimize", DESIGN, "--report", "-", "--out", "-"],
        2,
    );
    let place = swept();
    let html = place.text("sweep.html");
    is_a_page(&html);
    for reported in ["12 of 12 designs", "wire.diameter_mm", "draw-front-2"] {
        assert!(html.contains(reported), "{reported}");
    }
}

/// A replay of one finger, and of two, with their pages.
fn replayed() -> Place {
    let place = Place::new();
    run(&place, &["calibrate", DESIGN, "shapes/wedge.toml"], 0);
    let bundle = "results/seed_air/wedge";
    let one = [
        "replay",
        bundle,
        "--synthesize",
        "explore",
        "--duration",
        "40",
        "--report",
        "one.html",
    ];
    run(&place, &one, 0);
    let rows = (0..40).map(|k| {
        let t = 0.02 * f64::from(k);
        format!("{t},-0.03,{},0.05,0.03,{},0.06\n", 0.02 * t, -0.03 * t)
    });
    let head = "t_s,x_m,y_m,z_m,x2_m,y2_m,z2_m\n".to_owned();
    place.write("two.csv", &rows.fold(head, |table, row| table + &row));
    let two = [
        "replay",
        bundle,
        "two.csv",
        "--report",
        "two.html",
        "--out",
        "two_fingers.csv",
    ];
    run(&place, &two, 0);
    place
}

fn a_replay_is_watched_on_a_page() {
    let place = replayed();
    let pages = ["one.html", "two.html"].map(|name| place.text(name));
    for html in &pages {
        is_a_page(html);
        for reported in [
            "<h1>wedge on seed_air</h1>",
            "id=\"draw-replay\"",
            "with fixed currents",
        ] {
            assert!(html.contains(reported), "{reported}");
        }
    }
    // Of 2,001 positions at most 1,000 are moved to; the drawing of all of them is there without a script.
    assert!(pages[0].contains("one in 3 is shown") && !pages[1].contains("is shown"));
    assert!(pages.iter().all(|html| html.contains("seen from above")));
    let facts: Value = serde_json::from_str(&place.text("replay.json")).unwrap();
    let relative = facts["force"]["static"]["relative_rms_error"]
        .as_f64()
        .unwrap();
    let digits = format!("{:.1}", 100.0 * relative);
    assert!(pages[0].contains(&digits), "{digits}");
    let both = [
        "replay",
        "results/seed_air/wedge",
        "two.csv",
        "--report",
        "-",
        "--out",
        "-",
    ];
    run(&place, &both, 2);
}

fn a_browser_moves_the_finger_of_a_replay() {
    let place = replayed();
    in_a_browser(&place.path("one.html"));
    in_a_browser(&place.path("two.html"));
}

/// Output of the script that drives a browser.
fn browser(page: &Path) -> Output {
    let mut python = Command::new("python3");
    let script = python.arg(root().join("tests/programs/report/browser.py"));
    script.arg("check").arg(page).output().unwrap()
}

/// A browser that a script can drive, where there is none.
fn no_browser() -> Option<String> {
    let page = root().join("results/half_sphere.svg");
    needs::python().or_else(|| {
        let missing = browser(&page).status.code() == Some(77);
        missing.then(|| "chromium".to_owned())
    })
}

fn in_a_browser(page: &Path) {
    let output = browser(page);
    assert!(output.status.success(), "{}: {output:?}", page.display());
}

fn a_browser_draws_the_pages_of_a_null_constant_of_optimize_and_of_a_sweep() {
    in_a_browser(&attracted().path("results/attract/flat/report.html"));
    in_a_browser(&swept().path("sweep.html"));
    let place = Place::new();
    run(&place, &["optimize", DESIGN, "--report", "best.html"], 0);
    in_a_browser(&place.path("best.html"));
}

fn a_browser_draws_the_page_and_answers() {
    let place = Place::new();
    run(
        &place,
        &["calibrate", DESIGN, "shapes/half_cylinder.toml"],
        0,
    );
    let page = "results/seed_air/half-cylinder/report.html";
    in_a_browser(&place.path(page));
    // The check must be able to fail: one letter changed and the policy refuses the script,
    let html = place.text(page);
    let fails = |name: &str, broken: String| {
        assert!(broken != html, "{name} breaks nothing");
        place.write(name, &broken);
        let output = browser(&place.path(name));
        assert_eq!(output.status.code(), Some(1), "{name}: {output:?}");
    };
    fails(
        "refused.html",
        html.replacen("drawAll();", "drawAll() ;", 1),
    );
    // and without the policy a drawing that is not made is missed.
    let start = html.find("<meta http-equiv").unwrap();
    let end = start + html[start..].find('>').unwrap() + 1;
    let open = format!("{}{}", &html[..start], &html[end..]);
    fails("empty.html", open.replacen("own(\"turn\", turn);", "", 1));
    fails(
        "thrown.html",
        open.replacen("drawAll();\n", "drawAll(); missing();\n", 1),
    );
}
