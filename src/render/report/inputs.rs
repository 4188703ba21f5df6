//! The files that went in, with their digests.

use super::frame::Section;
use super::html::{Cell, Html, Table};
use fluxform_bundle::artefact::Input;

/// Path and digest of every input.
#[must_use]
pub fn sources(inputs: &[Input]) -> Section {
    let mut body = Html::default();
    let row = |input: &Input| -> Vec<Cell> {
        vec![input.path.as_str().into(), input.sha256.as_str().into()]
    };
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
