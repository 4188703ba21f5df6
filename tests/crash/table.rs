//! What was done and what came of it, as a table.

use crate::scenario::Found;

/// One way of disturbing one command.
pub struct Row {
    pub command: String,
    pub disturbance: String,
    /// Runs.
    pub runs: usize,
    /// Runs that did not come to their end.
    pub struck: usize,
    /// What lay there afterwards.
    pub found: Found,
}

impl Row {
    pub fn new(command: &str, disturbance: &str) -> Self {
        Self {
            command: command.to_owned(),
            disturbance: disturbance.to_owned(),
            runs: 0,
            struck: 0,
            found: Found::default(),
        }
    }

    /// A run after which all was as it must be.
    pub fn add(&mut self, found: Found) {
        self.runs += 1;
        self.found += found;
    }
}

/// The rows in Markdown.
pub fn markdown(rows: &[Row]) -> String {
    let mut text = "| command | disturbed by | runs | cut short | files whole | temporary left, cleared | \
                    bundles verified | rerun equal |\n|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for row in rows {
        let Found {
            whole,
            temporary,
            put_aside,
            bundles,
            ..
        } = row.found;
        text += &format!(
            "| `{}` | {} | {} | {} | {whole} of {whole} | {} | {bundles} | {} |\n",
            row.command,
            row.disturbance,
            row.runs,
            row.struck,
            temporary + put_aside,
            row.runs
        );
    }
    text
}
