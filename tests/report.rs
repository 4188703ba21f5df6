//! Pages: what stands in them, that inputs stay texts, and that a browser draws them.

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

const DESIGN: &str = "designs/seed_air.toml";
/// What a page may weigh, bytes.
const MOST_BYTES: usize = 600_000;

/// A folder with the repository's designs and shapes in it.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        for name in ["designs", "shapes"] {
            symlink(repository(name), folder.path().join(name)).unwrap();
        }
        Self(folder)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    #[allow(clippy::disallowed_methods)] // a test's own file
    fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    fn run(&self, arguments: &[&str], code: i32) -> String {
        let output = Command::new(env!("CARGO_BIN_EXE_fluxform"))
            .args(arguments)
            .current_dir(self.0.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?} {output:?}");
        String::from_utf8(output.stdout).unwrap()
    }

    fn listed(&self, bundle: &str) -> Vec<String> {
        let manifest = self.read(&format!("{bundle}/manifest.json"));
        let manifest: Value = serde_json::from_str(&manifest).unwrap();
        let files = manifest["files"].as_array().unwrap();
        let name = |file: &Value| file["path"].as_str().unwrap().to_owned();
        files.iter().map(name).collect()
    }
}

fn repository(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
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

#[test]
fn a_bundle_holds_its_page_and_verify_checks_it() {
    let place = Place::new();
    place.run(&["calibrate", DESIGN, "shapes/wedge.toml"], 0);
    let bundle = "results/seed_air/wedge";
    let listed = place.listed(bundle);
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
    let html = place.read(&format!("{bundle}/report.html"));
    is_a_page(&html);
    for told in [
        "<h1>wedge on seed_air</h1>",
        "The answer",
        "How good it is",
        "What limits it",
        "duality gap",
        "map interpolation",
        "id=\"draw-turn\"",
        "id=\"draw-path\"",
        "id=\"draw-currents\"",
        "id=\"draw-errors\"",
        "id=\"draw-field\"",
        "shapes/wedge.stl",
    ] {
        assert!(html.contains(told), "{told}");
    }
    // The shipped curve tells that it is not this run's.
    assert!(html.contains("id=\"draw-cost\"") && html.contains("Not measured in this run"));
    place.run(&["verify", bundle], 0);
    place.write(
        &format!("{bundle}/report.html"),
        &html.replacen("The answer", "The onswer", 1),
    );
    place.run(&["verify", bundle], 5);
}

#[test]
fn the_page_tells_what_the_files_hold() {
    let place = Place::new();
    place.run(&["calibrate", DESIGN, "shapes/flat.toml"], 0);
    let bundle = "results/seed_air/flat";
    let html = place.read(&format!("{bundle}/report.html"));
    let lambda: Value =
        serde_json::from_str(&place.read(&format!("{bundle}/lambda.json"))).unwrap();
    let chosen = lambda["lambda_n_per_m"].as_f64().unwrap();
    // Its first digits, cut off rather than rounded.
    let digits = &chosen.to_string()[..5];
    assert!(html.contains(digits), "{digits}");
    let worst = lambda["worst_error_n"].as_f64().unwrap() * 1e3;
    assert!(html.contains(&worst.to_string()[..4]), "{worst}");
    // Every plot has its numbers beside it, in as many rows as are drawn.
    let errors = place.read(&format!("{bundle}/plots/errors.csv"));
    assert_eq!(errors.lines().count(), 3722);
    let mut largest = 0.0_f64;
    for line in errors.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        largest = largest.max((cells[3] - cells[2]).abs());
    }
    assert!((largest * 1e3 / worst - 1.0).abs() < 1e-12);
    let field = place.read(&format!("{bundle}/plots/field.csv"));
    assert!(field.starts_with("x_m,y_m,z_m,dbz_dz_t_per_m\n"));
    assert_eq!(field.lines().count(), 3 * 41 * 41 + 1);
}

#[test]
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
        place.run(&arguments, 0);
    }
    for name in [
        "report.html",
        "plots/lambda.svg",
        "plots/field.svg",
        "plots/errors.csv",
    ] {
        let read = |out: &str| place.read(&format!("{out}/seed_air/half-sphere/{name}"));
        let text = read("one");
        assert!(text == read("two"), "{name}");
        let machine = place.0.path().to_string_lossy().into_owned();
        assert!(
            !text.contains(&machine),
            "{name} names the machine's folders"
        );
    }
}

#[test]
fn a_hostile_path_stays_text() {
    let place = Place::new();
    // A folder and a file: a path may hold what ends a script.
    let hostile = "bad<!--<script><b/script><img src=x onerror=\"alert('1')\">&amp;.toml";
    let shape = place.read("shapes/flat.toml");
    place.write(
        hostile,
        &shape.replace("\"flat.stl\"", "\"../shapes/flat.stl\""),
    );
    let hostile_at = format!("./{hostile}");
    let shown = place.run(&["calibrate", DESIGN, &hostile_at, "--format", "json"], 0);
    let told: Value = serde_json::from_str(&shown).unwrap();
    let folder = told["bundles"][0]["folder"].as_str().unwrap();
    let html = place.read(&format!("{folder}/report.html"));
    is_a_page(&html);
    assert!(html.contains("&lt;img src=x onerror=&quot;alert(&#39;1&#39;)&quot;&gt;&amp;amp;"));
    assert!(!html.contains("<img") && !html.contains("bad<"));
}

#[test]
fn a_page_can_be_left_out_and_is_there_without_a_force_constant() {
    let place = Place::new();
    let arguments = ["calibrate", DESIGN, "shapes/flat.toml", "--no-report"];
    place.run(&arguments, 0);
    let bundle = "results/seed_air/flat";
    let listed = place.listed(bundle);
    assert!(
        !listed
            .iter()
            .any(|name| name.contains("plots") || name.contains("report"))
    );
    assert!(!place.path(&format!("{bundle}/report.html")).exists());
    // Magnets that are only attracted cannot be pushed up.
    let design = place.read(DESIGN).replace("repel", "attract");
    let design = if design.contains("attract") {
        design
    } else {
        format!("{design}\n[magnet]\npolarity = \"attract\"\n")
    };
    place.write(
        "attract.toml",
        &design.replace("\"seed_air\"", "\"attract\""),
    );
    place.run(&["calibrate", "attract.toml", "shapes/flat.toml"], 4);
    let html = place.read("results/attract/flat/report.html");
    is_a_page(&html);
    assert!(html.contains("There is no force constant"));
    in_a_browser(&place.path("results/attract/flat/report.html"));
}

#[test]
fn optimize_and_sweep_write_pages() {
    let place = Place::new();
    place.run(&["optimize", DESIGN, "--report", "best.html"], 0);
    let html = place.read("best.html");
    is_a_page(&html);
    for told in [
        "Certificate: global",
        "held back by",
        "1 % more",
        "as given",
    ] {
        assert!(html.contains(told), "{told}");
    }
    place.run(&["optimize", DESIGN, "--report", "best.html"], 0);
    place.write("other.html", "mine");
    place.run(&["optimize", DESIGN, "--report", "other.html"], 4);
    place.run(&["optimize", DESIGN, "--report", "-", "--out", "-"], 2);
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
    place.run(&plan, 0);
    place.run(&["sweep", "run", "plan.json", "--out", "points"], 0);
    let merge = [
        "sweep",
        "merge",
        "plan.json",
        "points",
        "--report",
        "sweep.html",
    ];
    place.run(&merge, 0);
    let html = place.read("sweep.html");
    is_a_page(&html);
    for told in ["12 of 12 designs", "wire.diameter_mm", "draw-front-2"] {
        assert!(html.contains(told), "{told}");
    }
    for page in ["best.html", "sweep.html"] {
        in_a_browser(&place.path(page));
    }
}

/// What the script that drives a browser says; `None` where there is no browser or no Python.
fn browser(page: &Path) -> Option<Output> {
    let script = repository("tests/report/browser.py");
    let run = Command::new("python3")
        .arg(script)
        .arg("check")
        .arg(page)
        .output();
    let output = run.ok()?;
    (output.status.code() != Some(77)).then_some(output)
}

#[allow(clippy::print_stdout)] // a skipped check says so
fn in_a_browser(page: &Path) {
    match browser(page) {
        None => println!("skipped: no chromium here"),
        Some(output) => assert!(output.status.success(), "{}: {output:?}", page.display()),
    }
}

#[test]
fn a_browser_draws_the_page_and_answers() {
    let place = Place::new();
    place.run(&["calibrate", DESIGN, "shapes/half_cylinder.toml"], 0);
    let page = "results/seed_air/half-cylinder/report.html";
    in_a_browser(&place.path(page));
    // The check must be able to fail: one letter changed and the policy refuses the script,
    let html = place.read(page);
    let fails = |name: &str, broken: String| {
        assert!(broken != html, "{name} breaks nothing");
        place.write(name, &broken);
        if let Some(output) = browser(&place.path(name)) {
            assert_eq!(output.status.code(), Some(1), "{name}: {output:?}");
        }
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
