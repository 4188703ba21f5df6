//! `keys`: its arguments and its text.

use clap::Args;

use super::{KeyEntry, KeyList, keys};
use crate::cli::failure::Failure;
use crate::cli::help::{Codes, page};
use crate::cli::layout::table;
use crate::cli::printer::{Printer, Stream};

/// Print the keys of design and shape files
///
/// Prints every key that a design or a shape file may hold: its unit, the range of its values, what
/// holds without it, and what it means. The list is that of the program's own readers.
#[derive(Debug, Args)]
#[command(after_long_help = page(Codes::None, &[
    ("fluxform keys", "all of them"),
    ("fluxform keys magnet", "those of one section"),
    ("fluxform keys shape --format json", "those of shape files, for a program"),
    ("fluxform keys tilt", "those with this in their name"),
]))]
pub struct Keys {
    /// A section like `magnet`, a document (`design` or `shape`), or part of a key's name [default:
    /// everything]
    #[arg(value_name = "SECTION")]
    section: Option<String>,
}

impl Keys {
    /// Runs the command.
    ///
    /// # Errors
    /// A section that there is not; standard output that takes no more.
    pub fn run(&self, printer: &Printer) -> Result<(), Failure> {
        let list = keys(self.section.as_deref()).map_err(Failure::Usage)?;
        if printer.json() {
            return printer.summary(Stream::Output, &list, String::new);
        }
        printer.data(|out| out.write_all(text(&list).as_bytes()))
    }
}

fn text(list: &KeyList) -> String {
    let mut text = String::new();
    let same = |a: &KeyEntry, b: &KeyEntry| (a.document, &a.section) == (b.document, &b.section);
    for section in list.keys.chunk_by(same) {
        let first = &section[0];
        let name = match first.section.as_str() {
            "" => "top level".to_owned(),
            name => format!("[{name}]"),
        };
        if !text.is_empty() {
            text.push('\n');
        }
        text.push_str(&format!("{}, {name}\n", first.document.name()));
        let rows: Vec<Vec<String>> = section.iter().map(row).collect();
        text.push_str(&table("lll", &rows));
    }
    text
}

fn row(entry: &KeyEntry) -> Vec<String> {
    let default = match (&entry.default, entry.required) {
        (Some(value), _) => value.to_string().replace(',', ", "),
        (None, true) => "required".to_owned(),
        (None, false) => "-".to_owned(),
    };
    vec![entry.key.to_owned(), default, entry.remark.clone()]
}
