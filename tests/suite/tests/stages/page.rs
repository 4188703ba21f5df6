//! The pages of runs: the committed tables as pages, in a browser where there is one.

use std::path::{Path, PathBuf};
use std::process::Command;

use fluxform_bench::file::BenchFile;
use fluxform_bench::page::{PAGE, html};

fn repository(name: &str) -> PathBuf {
    let suite = Path::new(env!("CARGO_MANIFEST_DIR"));
    suite.ancestors().nth(2).unwrap().join(name)
}

fn recorded(name: &str) -> Option<BenchFile> {
    // A packaged crate holds the first table alone.
    let text = std::fs::read_to_string(repository(name)).ok()?;
    Some(serde_json::from_str(&text).unwrap())
}

/// Opens a page as a reader would; says so where there is no browser or no Python.
fn in_a_browser(html: &str) {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join(PAGE);
    std::fs::write(&page, html).unwrap();
    let run = Command::new("python3")
        .arg(repository("tests/programs/report/browser.py"))
        .arg("check")
        .arg(&page)
        .output();
    match run {
        Ok(output) if output.status.code() != Some(77) => {
            assert!(output.status.success(), "{output:?}");
        }
        _ => println!("skipped: no chromium here"),
    }
}

#[test]
fn the_recorded_run_makes_a_page_that_a_browser_draws() {
    let mut file = recorded("results/bench/bench.json").expect("the table of a whole run");
    file.scaling =
        recorded("results/bench/scaling/bench.json").map_or_else(Vec::new, |f| f.scaling);
    let page = html(&file);
    assert!(page == html(&file), "not the same bytes twice");
    assert!(page.len() < 600_000, "{} bytes", page.len());
    for reported in [
        "All keep it",
        "closest to its promise",
        "NGSolve",
        "Ratio of times",
        "id=\"draw-stage-10\"",
        "Error against time",
    ] {
        assert!(page.contains(reported), "{reported}");
    }
    if let Some(law) = file.scaling.first() {
        assert!(page.contains("Against size") && page.contains(&law.stage));
    }
    for unwanted in ["NaN", "undefined", "inf "] {
        let shown = page.split("<script").next().unwrap();
        assert!(!shown.contains(unwanted), "{unwanted}");
    }
    in_a_browser(&page);
}

#[test]
fn a_default_that_exceeds_its_stated_error_is_reported_first() {
    let mut file = recorded("results/bench/bench.json").expect("the table of a whole run");
    let stage = file.stages.iter_mut().find(|s| s.stage == "coupled-array");
    let rows = &mut stage.unwrap().curves[0].rows;
    let row = rows.iter_mut().find(|row| row.default).unwrap();
    row.error = 1.3 * row.stated_error.unwrap() + 1e-6;
    let page = html(&file);
    assert!(page.contains("1 do not keep it; closest to its promise is coupled-array"));
    assert!(page.contains("not kept: "));
    // Nothing measured, nothing reported.
    file.stages.clear();
    assert!(html(&file).contains("No default that states its error"));
}
