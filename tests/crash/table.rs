//! Tasks and their outcomes, as a table.

use crate::scenario::Found;

/// One way of disturbing one command.
pub struct Row {
    pub command: String,
    pub disturbance: String,
    /// Runs.
    pub runs: usize,
    /// Runs that did not come to their end.
    pub struck: usize,
    /// Runs after which the same command, undisturbed, ended well and left what it always leaves.
    pub again: usize,
    /// Files afterwards.
    pub found: Found,
}

impl Row {
    pub fn new(command: &str, disturbance: &str) -> Self {
        Self {
            command: command.to_owned(),
            disturbance: disturbance.to_owned(),
            runs: 0,
            struck: 0,
            again: 0,
            found: Found::default(),
        }
    }

    /// A run after which all was as it must be.
    pub fn add(&mut self, found: Found) {
        self.runs += 1;
        self.again += 1;
        self.found += found;
    }
}

/// The rows in Markdown, one for each way of disturbing: commands are added up.
pub fn markdown(rows: &[Row]) -> String {
    let mut text =
        "| disturbed by | runs | cut short | files, all whole | temporary, all cleared | \
                    bundles, all verify | reruns, all equal |\n|---|---|---|---|---|---|---|\n"
            .to_owned();
    let mut ways: Vec<Row> = Vec::new();
    for row in rows {
        let known = ways
            .iter()
            .position(|way| way.disturbance == row.disturbance);
        let at = known.unwrap_or_else(|| {
            ways.push(Row::new("", &row.disturbance));
            ways.len() - 1
        });
        ways[at].runs += row.runs;
        ways[at].struck += row.struck;
        ways[at].again += row.again;
        ways[at].found += row.found;
    }
    for way in &ways {
        text += &format!("| {} | {}\n", way.disturbance, figures(way));
    }
    text
}

/// One row, its command first.
pub fn line(row: &Row) -> String {
    format!("| {}: {} | {}", row.command, row.disturbance, figures(row))
}

fn figures(row: &Row) -> String {
    let Found {
        whole,
        temporary,
        put_aside,
        bundles,
        ..
    } = row.found;
    let left = temporary + put_aside;
    format!(
        "{} | {} | {whole} | {left} | {bundles} | {} |",
        row.runs, row.struck, row.again
    )
}
