//! The words and the places of what is wrong with the text itself.

use fluxform_design::Need;

use crate::support::{SOUND, read, refused, sound_but};

/// Each design has one fault, and this is said of it.
fn says(cases: &[(String, &str)]) {
    for (text, expected) in cases {
        assert_eq!(refused(text, Need::EVALUATE), [*expected], "of\n{text}");
    }
}

#[test]
fn text_that_is_not_toml_is_placed() {
    let said = refused("name = \"a\"\n[coil\nturns = 3\n", Need::EVALUATE);
    assert!(
        said[0].starts_with("d.toml:2:6: error: not valid TOML: "),
        "{said:?}"
    );
    let said = refused("name = \"\u{e9}\u{e9}\" x\n", Need::EVALUATE);
    assert!(
        said[0].starts_with("d.toml:1:13: error: not valid TOML: "),
        "{said:?}"
    );
    let said = refused("name = \"a\"\nname = \"b\"\n", Need::EVALUATE);
    assert_eq!(said, ["d.toml:2:1: error: not valid TOML: duplicate key"]);
}

/// Every line of them was a fault of its own.
#[test]
fn a_file_of_another_kind_is_one_fault() {
    for (text, kind) in [
        ("{\n  \"name\": \"a\",\n  \"turns\": 3\n}\n", "this is JSON"),
        ("\n<?xml version=\"1.0\"?>\n<a b=\"c\"/>\n", "this is XML"),
        ("x_m,y_m\n1,2\n3,4\n", "no line of it gives a key a value"),
    ] {
        let said = refused(text, Need::EVALUATE);
        let [said] = &said[..] else {
            panic!("{said:?}")
        };
        assert!(said.contains(&format!("not a TOML file: {kind}")), "{said}");
    }
}

#[test]
fn an_unknown_key_names_the_nearest() {
    says(&[
        (
            sound_but(
                "outer_diameter_mm",
                "outer_diametre_mm = 38\nouter_diameter_mm",
            ),
            "d.toml:4:1: error: coil.outer_diametre_mm: unknown key \"outer_diametre_mm\" in [coil] (did you mean outer_diameter_mm?)",
        ),
        (
            format!("{SOUND}[suply]\n"),
            "d.toml:8:2: error: suply: unknown key \"suply\" in the top level (did you mean supply?)",
        ),
        // Right in another section.
        (
            format!("{SOUND}[target]\npitch_mm = 30.0\n"),
            "d.toml:9:1: error: target.pitch_mm: unknown key \"pitch_mm\" in [target] (it is a key of [array], [search.array]; known here: height_mm)",
        ),
        (
            format!("{SOUND}[target]\nheight_m = 0.03\n"),
            "d.toml:9:1: error: target.height_m: unknown key \"height_m\" in [target] (did you mean height_mm?)",
        ),
        (
            format!("{SOUND}[target]\n\"co\\u001blour\" = 1\n"),
            "d.toml:9:1: error: target.co\\u{1b}lour: unknown key \"co\\u{1b}lour\" in [target] (known here: height_mm)",
        ),
    ]);
}

#[test]
fn a_missing_key_is_named_with_its_section() {
    says(&[
        (
            sound_but("outer_diameter_mm = 38.0\n", ""),
            "d.toml:2:1: error: coil.outer_diameter_mm: this key is required and missing (add outer_diameter_mm = ... (mm) to [coil])",
        ),
        (
            sound_but("[wire]\ndiameter_mm = 0.7\n", ""),
            "d.toml:1:1: error: wire.diameter_mm: this key is required and missing (add diameter_mm = ... (mm) to [wire])",
        ),
        (
            sound_but("name = \"sound\"\n", ""),
            "d.toml:1:1: error: name: this key is required and missing (add name = \"...\"; it names the output folder)",
        ),
    ]);
}

#[test]
fn a_wrong_type_says_what_was_found() {
    says(&[
        (
            sound_but("length_mm = 100.0", "length_mm = \"100\""),
            "d.toml:5:13: error: coil.length_mm: expected a number, found the text \"100\" (write 100 without quotes and unit)",
        ),
        (
            sound_but("length_mm = 100.0", "length_mm = true"),
            "d.toml:5:13: error: coil.length_mm: expected a number, found true",
        ),
        (
            sound_but("length_mm = 100.0", "length_mm = [100.0]"),
            "d.toml:5:13: error: coil.length_mm: expected a number, found a list of 1",
        ),
        (
            sound_but("\"sound\"", "7"),
            "d.toml:1:8: error: name: expected a text in quotes, found the number 7",
        ),
        (
            sound_but("name", "target = 30\nname"),
            "d.toml:1:10: error: target: expected a section [target], found the number 30",
        ),
        (
            format!("{SOUND}[magnet]\npassive_force = \"no\"\n"),
            "d.toml:9:17: error: magnet.passive_force: expected true or false, found the text \"no\"",
        ),
        (
            format!("{SOUND}[supply]\ncurrent_max_a = 1979-05-27\n"),
            "d.toml:9:17: error: supply.current_max_a: expected a number, found a date or time",
        ),
        (
            format!("{SOUND}[array]\npositions_mm = [[0.0, 0.7], [50.0]]\n"),
            "d.toml:9:29: error: array.positions_mm[1]: expected a pair [x, y], found 1 values",
        ),
        (
            format!("{SOUND}[array]\npositions_mm = [[0.0, 0.7], 50.0]\n"),
            "d.toml:9:29: error: array.positions_mm[1]: expected a pair [x, y], found the number 50",
        ),
        (
            format!("{SOUND}[magnet]\ntilt_deg = [0.7]\n"),
            "d.toml:9:12: error: magnet.tilt_deg: expected a list of 2 numbers, found 1 (write them in square brackets, with commas)",
        ),
        (
            format!("{SOUND}[[core]]\n"),
            "d.toml:8:1: error: core: expected a section [core], found a list of 1",
        ),
        (
            format!("{SOUND}[array]\nrows = 2.5\n"),
            "d.toml:9:8: error: array.rows: expected a whole number up to 1e9, found 2.5",
        ),
    ]);
}

#[test]
fn a_name_is_fit_for_a_folder() {
    for name in ["", "..", ".", "a b", "a/b", "\u{e9}", "a\\\\b"] {
        let said = refused(&sound_but("sound", name), Need::EVALUATE);
        assert!(
            said[0].starts_with(
                "d.toml:1:8: error: name: expected 1 to 100 of A-Z a-z 0-9 . _ -, found \""
            ),
            "{said:?}"
        );
    }
    let long = "x".repeat(101);
    assert_eq!(refused(&sound_but("sound", &long), Need::EVALUATE).len(), 1);
    assert!(read(&sound_but("sound", "Seed_2.1-b"), Need::EVALUATE).is_ok());
}

#[test]
fn a_choice_lists_its_options() {
    says(&[
        (
            format!("{SOUND}[magnet]\npolarity = \"repell\"\n"),
            "d.toml:9:12: error: magnet.polarity: expected \"repel\" or \"attract\", found \"repell\" (did you mean \"repel\"?)",
        ),
        (
            format!("{SOUND}[array]\ncoupling = \"some\"\n"),
            "d.toml:9:12: error: array.coupling: expected \"full\" or \"none\", found \"some\" (choose one of them)",
        ),
        (
            format!("{SOUND}[magnet]\nmodel = \"sphere\"\n"),
            "d.toml:9:9: error: magnet.model: expected \"dipole\" or \"cylinder\", found \"sphere\" (choose one of them)",
        ),
    ]);
}

#[test]
fn numbers_are_finite() {
    says(&[
        (
            sound_but("length_mm = 100.0", "length_mm = nan"),
            "d.toml:5:13: error: coil.length_mm: expected a finite number of mm, found NaN",
        ),
        (
            format!("{SOUND}[array]\npositions_mm = [[0, 7]]\ngain = [inf]\n"),
            "d.toml:10:9: error: array.gain[0]: expected a finite number, found inf",
        ),
        (
            format!("{SOUND}[supply]\nvoltage_v = 1e400\n"),
            "d.toml:9:13: error: supply.voltage_v: expected a finite number of V, found inf",
        ),
    ]);
}

#[test]
fn integers_serve_as_numbers_in_every_notation() {
    let text = sound_but("inner_diameter_mm = 24.0", "inner_diameter_mm = 0x18");
    let text = text.replace("length_mm = 100.0", "length_mm = 1_00");
    let coil = read(&text, Need::EVALUATE).unwrap().0.coil.unwrap();
    assert_eq!((coil.inner_diameter_m, coil.length_m), (0.024, 0.1));
}

#[test]
fn every_fault_is_reported_in_the_order_of_the_text() {
    let text = r#"name = "a b"
[coil]
inner_diameter_mm = 38
outer_diameter_mm = 24
length_mm = -1.3
turn = 7
[wire]
diameter_mm = "0.7"
[array]
gain = [1, nan]
[limits]
power_max_w = -0.7
[workspace]
x_mm = [50, -50, 61]
z_mm = [-3, 40, 8]
"#;
    let said = refused(text, Need::MAP);
    let places: Vec<&str> = said
        .iter()
        .map(|line| line.split(": error").next().unwrap())
        .collect();
    assert_eq!(
        places,
        [
            "d.toml:1:8",
            "d.toml:4:21",
            "d.toml:5:13",
            "d.toml:6:1",
            "d.toml:8:15",
            "d.toml:10:8",
            "d.toml:10:12",
            "d.toml:12:15",
            "d.toml:14:8"
        ],
        "{said:#?}"
    );
}

#[test]
fn the_fancy_form_shows_line_and_caret() {
    let text = sound_but(
        "outer_diameter_mm = 38.0",
        "outer_diameter_mm = 23.0\nturn = 7",
    );
    let faults = read(&text, Need::EVALUATE).unwrap_err();
    let shown = faults.render(false, 100);
    for part in [
        "d.toml: 2 errors",
        "d.toml:4:21",
        "outer_diameter_mm = 23.0",
        "^",
        "here",
        "help: did you mean turns?",
    ] {
        assert!(shown.contains(part), "{part} in\n{shown}");
    }
    assert!(!shown.contains('\u{1b}'));
    assert!(faults.render(true, 100).contains('\u{1b}'));
}

#[test]
fn both_forms_count_columns_in_characters() {
    // The byte order mark is no character; two accents are two.
    let text = format!("\u{feff}magnet = {{ \"\u{e9}\u{e9}\" = 1, length_mm = -7 }}\n{SOUND}");
    let faults = read(&text, Need::EVALUATE).unwrap_err();
    for place in ["d.toml:1:12", "d.toml:1:34"] {
        assert!(
            faults.plain().contains(&format!("{place}: error")),
            "{faults}"
        );
        let fancy = faults.render(false, 200);
        assert!(fancy.contains(&format!("[{place}]")), "{place} in\n{fancy}");
    }
}

#[test]
fn text_unfit_for_a_screen_is_not_quoted() {
    for junk in ["\u{1b}[31m".to_owned(), "x".repeat(5000)] {
        let faults = read(&format!("a = {junk}\n"), Need::EVALUATE).unwrap_err();
        assert_eq!(faults.render(true, 80), faults.plain());
        assert!(faults.plain().len() < 1000);
        assert!(!faults.plain().contains('\u{1b}'));
    }
}

#[test]
fn a_flood_of_faults_is_counted() {
    let flood: String = (0..5000).map(|i| format!("k{i} = 1\n")).collect();
    let said = refused(&format!("{flood}{SOUND}"), Need::EVALUATE);
    assert_eq!(said.len(), 101);
    assert_eq!(said[100], "d.toml: and 4900 more faults");
}
