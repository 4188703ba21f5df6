//! Documents and names of whoever wants the screen or another file's content.

use std::path::Path;

use fluxform_design::bh_table::{BhTable, read_bh_table};
use fluxform_design::{Design, InvalidDocument, Need};
use fluxform_shape::document::ShapeDocument;

/// Characters that a screen obeys: control characters, and marks that reorder the text around them.
fn commands(c: char) -> bool {
    (c.is_control() && c != '\n')
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn is_tame(invalid: &InvalidDocument) {
    for shown in [
        invalid.faults.plain(),
        invalid.faults.render(false, 60),
        invalid.to_string(),
    ] {
        assert!(!shown.is_empty());
        assert!(!shown.contains(commands), "{shown:?}");
    }
}

#[test]
fn a_file_s_name_and_content_do_not_command_the_terminal() {
    let marks = [
        "\u{1b}]0;title\u{7}",
        "\u{9b}31m",
        "\r",
        "\u{202e}",
        "\u{2028}",
    ];
    for mark in marks {
        let path = format!("d{mark}.toml");
        let texts = [
            "name = 3\n".to_owned(),
            format!("name = 3 # {mark}\n"),
            format!("name = 3\n\"{mark}\" = 1\n"),
            format!("name = \"{mark}\"\n[coil]\nturns = '{mark}'\n"),
            "name = \"\\u001b[31m\"\n[\"\\u009b31m\"]\n\"\\u202e\" = 1\n".to_owned(),
        ];
        for text in texts {
            is_tame(&Design::from_toml(&text, Path::new(&path), Need::EVALUATE).unwrap_err());
            is_tame(&ShapeDocument::from_toml(&text, Path::new(&path)).unwrap_err());
        }
    }
    // A name of two lines is one line.
    let invalid =
        Design::from_toml("name = 3\n", Path::new("a\nerror: b"), Need::EVALUATE).unwrap_err();
    let lines = invalid.faults.plain();
    assert!(
        lines.lines().all(|line| line.starts_with("a\\nerror: b:")),
        "{lines}"
    );
}

#[test]
fn a_curve_shows_one_short_word_of_a_file_that_is_none() {
    let secret = "LS_COLORS=none\0API_TOKEN=0123456789abcdef0123456789abcdef";
    let shown = BhTable::from_csv(secret, Path::new("c.csv"))
        .unwrap_err()
        .faults
        .plain();
    assert!(shown.contains("\"LS_COLORS=none"), "{shown}");
    assert!(!shown.contains("6789"), "{shown}");
    let long = "0123456789".repeat(7);
    let table = format!("b_t,h_a_per_m\n{long}x,1\n");
    let shown = BhTable::from_csv(&table, Path::new("c.csv"))
        .unwrap_err()
        .faults
        .plain();
    assert!(
        shown.contains(&long[..20]) && !shown.contains(&long[..21]),
        "{shown}"
    );
}

#[test]
#[cfg(target_os = "linux")]
fn a_curve_is_no_file_that_the_system_makes_up() {
    for (name, why) in [
        (
            "/proc/self/environ",
            "an empty file, or one that the system makes up",
        ),
        (
            "/proc/self/status",
            "an empty file, or one that the system makes up",
        ),
        ("/dev/zero", "a device or a pipe"),
        ("/proc", "a directory"),
    ] {
        let shown = read_bh_table(Path::new(name)).unwrap_err().faults.plain();
        assert!(
            shown.contains(&format!("expected a CSV table, found {why}")),
            "{shown}"
        );
    }
}
