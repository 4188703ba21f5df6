//! By how much two artefacts differ, and by how much they may.

use std::collections::BTreeMap;
use std::fmt;

use fluxform::bundle::npz::{MapArrays, from_npz};
use serde_json::Value;

use fluxform_testing::tree::Tree;

/// Least error that an artefact states: the tolerance of fields in air.
const LEAST: f64 = 1e-12;
/// How much a force constant or a current may move with its forces' stated error.
const FORCES_MOVE: f64 = 10.0;

/// Keys whose values are made of rounding: how far a solution is from exact, which of several equal
/// points is named, digests and sizes of files that are compared themselves.
const OF_ROUNDING: [&str; 12] = [
    "accuracy",
    "files",
    "duality_gap_n2",
    "gap_n",
    "part",
    "point",
    "active_points",
    "event",
    "gap",
    "evaluations",
    "upper_bound_n",
    "largest_error",
];

/// Between two artefacts.
pub struct Difference {
    path: String,
    /// The largest, relative to the largest value of its kind.
    largest: f64,
    /// Where it is.
    key: String,
    /// Sum of the two statements.
    stated: f64,
}

impl Difference {
    pub fn within(&self) -> bool {
        self.largest <= self.stated
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "  {}: {:.1e} in {}, where {:.1e} is stated",
            self.path, self.largest, self.key, self.stated
        )
    }
}

/// Of the artefacts called `path` among those of two builds.
pub fn between(path: &str, here: &Tree, there: &Tree) -> Difference {
    let (one, two) = (&here[path], &there[path]);
    let (largest, key) = if path.ends_with(".npz") {
        maps(one, two)
    } else if path.ends_with(".json") {
        documents(one, two)
    } else if path.ends_with(".svg") {
        (0.0, "a drawing of what is compared itself".to_owned())
    } else {
        tables(one, two)
    };
    let maps = path.ends_with("map.npz") || path.ends_with("map.csv");
    let stated = [here, there].map(|tree| {
        if maps {
            stated(tree, path, "map").max(LEAST)
        } else {
            FORCES_MOVE * stated(tree, path, "forces").max(LEAST)
        }
    });
    Difference {
        path: path.to_owned(),
        largest,
        key,
        stated: stated[0] + stated[1],
    }
}

/// The largest error that a stage states of itself, of the artefact or of what lies beside it.
fn stated(tree: &Tree, path: &str, stage: &str) -> f64 {
    let folder = path.rfind('/').map_or("", |at| &path[..=at]);
    let beside = ["manifest.json", "map.json"].map(|name| format!("{folder}{name}"));
    let accuracies = [path.to_owned()]
        .into_iter()
        .chain(beside)
        .filter_map(|path| serde_json::from_slice::<Value>(tree.get(&path)?).ok());
    let stages = [stage, "field", "core_field", "mutual_inductance"];
    accuracies
        .flat_map(|value| {
            stages.map(|stage| value["accuracy"][stage]["estimate"].as_f64().unwrap_or(0.0))
        })
        .fold(0.0, f64::max)
}

/// Largest difference of two maps at any height, relative to the largest value at that height.
fn maps(one: &[u8], two: &[u8]) -> (f64, String) {
    let [one, two] = [one, two].map(|bytes| from_npz(bytes).expect("a map"));
    let gz = |map: &MapArrays| map.gz_t_per_m_per_a.to_vec();
    let (a, b) = (gz(&one), gz(&two));
    assert_eq!(a.len(), b.len());
    let plane = one.x_m.len() * one.y_m.len();
    let heights = one.z_m.len();
    let mut most = vec![(0.0_f64, 0.0_f64); heights];
    for (at, (a, b)) in a.iter().zip(&b).enumerate() {
        let (size, off) = &mut most[at / plane % heights];
        *size = size.max(a.abs());
        *off = off.max((a - b).abs());
    }
    let largest = most.iter().map(|(size, off)| off / size);
    (largest.fold(0.0, f64::max), "gz_t_per_m_per_a".to_owned())
}

/// Numbers and words of a document by their key, indices left out.
type Leaves = BTreeMap<String, Vec<Value>>;

fn leaves(value: &Value, key: &str, found: &mut Leaves) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                if !OF_ROUNDING.contains(&name.as_str()) {
                    leaves(value, &format!("{key}.{name}"), found);
                }
            }
        }
        Value::Array(values) => values.iter().for_each(|value| leaves(value, key, found)),
        leaf => found.entry(key.to_owned()).or_default().push(leaf.clone()),
    }
}

fn documents(one: &[u8], two: &[u8]) -> (f64, String) {
    let [one, two] = [one, two].map(|bytes| {
        let mut found = Leaves::new();
        leaves(
            &serde_json::from_slice(bytes).expect("JSON"),
            "",
            &mut found,
        );
        found
    });
    let keys = |leaves: &Leaves| leaves.keys().cloned().collect::<Vec<_>>();
    assert_eq!(keys(&one), keys(&two));
    let mut largest = (0.0, "nothing but measures of rounding".to_owned());
    // The platform that the other build states of itself, and the digests of what it states.
    let of_the_build = [
        ".made_with.arithmetic",
        ".made_with.sha256",
        ".record_sha256",
    ];
    for (key, values) in &one {
        if of_the_build.contains(&key.as_str()) {
            continue;
        }
        let others = &two[key];
        assert_eq!(values.len(), others.len(), "{key}");
        for (value, other) in values.iter().zip(others) {
            if !value.is_number() {
                assert_eq!(value, other, "{key}");
            }
        }
        let numbers =
            |values: &[Value]| values.iter().filter_map(Value::as_f64).collect::<Vec<_>>();
        let off = relative(&numbers(values), &numbers(others));
        if off > largest.0 {
            largest = (off, key.trim_start_matches('.').to_owned());
        }
    }
    largest
}

/// Largest difference, relative to the largest value.
fn relative(one: &[f64], two: &[f64]) -> f64 {
    let size = one
        .iter()
        .fold(0.0_f64, |most, value| most.max(value.abs()));
    let off = one
        .iter()
        .zip(two)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    if off == 0.0 { 0.0 } else { off / size }
}

fn tables(one: &[u8], two: &[u8]) -> (f64, String) {
    let [one, two] = [one, two].map(|bytes| {
        let mut reader = csv::Reader::from_reader(bytes);
        let head: Vec<String> = reader
            .headers()
            .unwrap()
            .iter()
            .map(str::to_owned)
            .collect();
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        (head, rows)
    });
    assert_eq!((&one.0, one.1.len()), (&two.0, two.1.len()));
    let mut largest = (0.0, "nothing".to_owned());
    for (at, name) in one.0.iter().enumerate() {
        let column = |rows: &[csv::StringRecord]| -> Vec<f64> {
            rows.iter().filter_map(|row| row[at].parse().ok()).collect()
        };
        let off = relative(&column(&one.1), &column(&two.1));
        if off > largest.0 {
            largest = (off, name.clone());
        }
    }
    largest
}
