//! The tables of keys are what the readers ask for.

use std::fmt::Write as _;

use fluxform::design::keys::{self, Key, Without};
use fluxform::shape::document;
use fluxform_testing::needs::Trial;
use fluxform_testing::{committed, root, trials};

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [
            the_keys_of_a_design_are_those_of_its_reader,
            the_keys_of_a_shape_are_those_of_its_reader,
        ],
        Some("--ignored, as it writes the tables".to_owned()) => [regenerate_key_tables],
    }
}

const BEGIN: &str = "<!-- keys: from the reader -->\n";
const END: &str = "<!-- end of keys -->\n";

fn table(keys: &[Key]) -> String {
    let mut text = String::new();
    let mut section = None;
    for key in keys {
        if section != Some(&key.section) {
            section = Some(&key.section);
            let of = match key.section.as_str() {
                "" => "top level".to_owned(),
                name => format!("`[{name}]`"),
            };
            write!(
                text,
                "\n| {of} | value | range | default | meaning |\n|---|---|---|---|---|\n"
            )
            .unwrap();
        }
        let default = match &key.default {
            Without::Refused => "required",
            Without::Value(value) if value.starts_with('"') => &format!("`{value}`"),
            Without::Value(value) => value,
            Without::Nothing => "",
        };
        let (name, value, range) = (key.name, key.accepts.words(), &key.accepts.range);
        writeln!(
            text,
            "| `{name}` | {value} | {range} | {default} | {} |",
            key.meaning
        )
        .unwrap();
    }
    text + "\n"
}

fn held(page: &str, keys: &[Key]) {
    let text = committed(page);
    let shown = text
        .split(BEGIN)
        .nth(1)
        .and_then(|rest| rest.split(END).next());
    assert_eq!(
        shown.unwrap_or_else(|| panic!("{page} has no table of keys")),
        table(keys),
        "{page}: run `cargo test --test documents -- --ignored regenerate_key_tables`"
    );
}

fn the_keys_of_a_design_are_those_of_its_reader() {
    held("designs/README.md", &keys::of_designs());
}

fn the_keys_of_a_shape_are_those_of_its_reader() {
    held("shapes/README.md", &document::keys());
}

fn regenerate_key_tables() {
    for (page, keys) in [
        ("designs/README.md", keys::of_designs()),
        ("shapes/README.md", document::keys()),
    ] {
        let text = committed(page);
        let (before, rest) = text.split_once(BEGIN).expect("a table of keys");
        let (_, after) = rest.split_once(END).expect("its end");
        let new = format!("{before}{BEGIN}{}{END}{after}", table(&keys));
        std::fs::write(root().join(page), new).unwrap();
    }
}
