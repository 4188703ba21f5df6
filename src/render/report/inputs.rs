//! The files that went in, with their digests.

use super::frame::Section;
use super::html::{Cell, Html, Table};

/// Path and digest of every input.
#[must_use]
pub fn sources(inputs: &[(&str, &str)]) -> Section {
    let mut body = Html::default();
    let row =
        |(path, sha256): &(&str, &str)| -> Vec<Cell> { vec![(*path).into(), (*sha256).into()] };
    body.table(&Table {
        caption: "Files and their digests".to_owned(),
        head: vec![("file", false), ("sha256", false)],
        rows: inputs.iter().map(row).collect(),
        prose: true,
    });
    Section {
        id: "sources",
        title: "Inputs",
        body,
    }
}
