//! What `optimize` says and writes where screen, page and file have to agree.

use crate::SEED;
use fluxform_testing::place::Place;

const CORED: &str = "name = \"pull\"\n[coil]\ninner_diameter_mm = 20.0\nouter_diameter_mm = 38.0\nlength_mm = 60.0\n\
                     [wire]\ndiameter_mm = 0.8\n[core]\n[array]\nrows = 1\ncolumns = 1\n\
                     [limits]\nouter_diameter_max_mm = 45.0\nlength_max_mm = 80.0\nsettling_max_ms = 50.0\n\
                     [target]\nheight_mm = 25.0\n";

/// A file that was not replaced was said to be written.
#[test]
fn regression_a_file_that_was_refused_was_said_to_be_written() {
    let place = Place::new();
    let written = place.run(&["optimize", SEED, "--out", "best.toml"]).ends(0);
    assert!(
        written.err.contains("written: best.toml"),
        "{}",
        written.err
    );
    let refused = place
        .run(&["optimize", SEED, "--wound", "--out", "best.toml"])
        .ends(4);
    assert!(refused.err.contains("E405"), "{}", refused.err);
    let all = refused.out + &refused.err;
    assert!(!all.contains("written"), "{all}");
}

/// The page of no coil named no limit that holds it back, called nothing the best of many, and left the nearest coil out.
#[test]
fn regression_the_page_of_no_coil_contradicted_itself() {
    let place = Place::new();
    let fixed = ["outer_diameter_mm", "inner_diameter_mm", "length_mm"];
    let flags = ["optimize", SEED, "--report", "page.html", "--fix"];
    let ran = place.run(&[&flags[..], &fixed].concat()).ends(4);
    assert!(ran.out.contains("breaks the limits least"), "{}", ran.out);
    let page = place.text("page.html");
    assert!(page.contains("breaks the limits least"), "{page}");
    for false_claim in ["No limit holds the force back", "Certificate:"] {
        assert!(!page.contains(false_claim), "{false_claim}");
    }
}

/// The pull of the unpowered core takes no part in the search of one coil, and nothing said so.
#[test]
fn regression_the_pull_of_the_core_was_left_out_without_a_word() {
    let place = Place::new();
    let design = format!(
        "{CORED}[supply]\ncurrent_max_a = 0.2\nvoltage_v = 24.0\n[magnet]\npassive_force = true\n"
    );
    place.write("pull.toml", &design);
    let ran = place
        .run(&["optimize", "pull.toml", "--report", "page.html"])
        .ends(0);
    let said = "not the pull of the unpowered core";
    assert!(ran.err.contains(said), "{}", ran.err);
    let page = place.text("page.html");
    assert!(
        page.contains(said) && page.contains("the unpowered steel pulls with"),
        "{page}"
    );
}
