//! Runs cases on a few threads and prints what came of them.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::cases::Prepared;
use crate::commands::Writes;
use crate::inputs_as_outputs;
use crate::judge::{Row, judge};

/// Rows of every `every`-th case of these commands, in the order of the cases.
pub fn rows(commands: &[Writes], every: usize) -> Vec<Row> {
    let room = tempfile::tempdir().unwrap();
    let room = room.path();
    let prepared: Vec<Prepared> = commands.iter().map(|it| Prepared::new(it, room)).collect();
    let mut tasks = Vec::new();
    for (of, it) in prepared.iter().enumerate() {
        tasks.extend(it.cases().into_iter().map(|case| (of, Some(case))));
    }
    let mut tasks: Vec<_> = tasks.into_iter().step_by(every).collect();
    tasks.extend((0..prepared.len()).map(|of| (of, None)));
    let next = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let threads = std::thread::available_parallelism()
        .map_or(1, usize::from)
        .min(4);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some((of, case)) = tasks.get(at) else {
                        break;
                    };
                    let rows = one(
                        &prepared[*of],
                        case.as_ref(),
                        every,
                        &room.join(format!("{at}")),
                    );
                    done.lock().unwrap().insert(at, rows);
                }
            });
        }
    });
    done.into_inner().unwrap().into_values().flatten().collect()
}

fn one(
    prepared: &Prepared,
    case: Option<&crate::cases::Case>,
    every: usize,
    place: &Path,
) -> Vec<Row> {
    match case {
        Some(case) => judge(prepared, case, place).into_iter().collect(),
        None => inputs_as_outputs::rows(prepared, place, every),
    }
}

/// A line of the table for each row; `said` adds what the program said of those that changed.
pub fn lines(rows: &[Row], said: bool) -> String {
    let mut text = "| command | planted | at | after a run | --force | input | exit code | changed |\n|---|---|---|---|---|---|---|---|\n".to_owned();
    for row in rows {
        let code = row.code.map_or("none".to_owned(), |code| code.to_string());
        let changed = match row.changed.as_slice() {
            [] => "nothing".to_owned(),
            changes => changes.join("; "),
        };
        let [after, force] = [row.after_a_run, row.force].map(|it| if it { "yes" } else { "no" });
        let input = if row.refused { "spoilt" } else { "good" };
        text += &format!(
            "| {} | {} | {} | {after} | {force} | {input} | {code} | {changed} |\n",
            row.command, row.planted, row.at
        );
        if said && !row.changed.is_empty() {
            text += &format!("{}\n", row.said.trim());
        }
    }
    text
}

/// Cases and changed ones by a key, as a table, with the sum below.
pub fn summary(rows: &[Row], what: &str, key: impl Fn(&Row) -> &str) -> String {
    let mut by: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    let mut all = [0; 4];
    for row in rows {
        let counts = [
            1,
            usize::from(row.code == Some(0)),
            usize::from(row.code != Some(0)),
            usize::from(!row.changed.is_empty()),
        ];
        for (sum, count) in by.entry(key(row)).or_default().iter_mut().zip(counts) {
            *sum += count;
        }
        for (sum, count) in all.iter_mut().zip(counts) {
            *sum += count;
        }
    }
    let mut text = format!(
        "| {what} | cases | ended with 0 | refused | user's files changed |\n|---|---|---|---|---|\n"
    );
    for (name, [cases, well, refused, changed]) in by.into_iter().chain([("all", all)]) {
        text += &format!("| {name} | {cases} | {well} | {refused} | {changed} |\n");
    }
    text
}
