//! `calibrate --shard`: the drives of many coupled cores, solved in parts by several runs.

use serde_json::Value;

use fluxform_testing::place::Place;

const CACHE: &str = ".fluxform-cache";
const BUNDLE: [&str; 5] = [
    "manifest.json",
    "map.npz",
    "lambda.json",
    "points.csv",
    "currents.csv",
];

/// 23 coupled cored coils on a lattice with two holes, no two of which are equivalent, and a small object.
fn holed() -> Place {
    let place = Place::empty();
    let cells = (0..25).filter(|cell| ![3, 16].contains(cell));
    let positions_mm: Vec<[i32; 2]> = cells
        .map(|cell| [10 * (cell % 5) - 20, 10 * (cell / 5) - 20])
        .collect();
    place.write(
        "holed.toml",
        &format!(
            "name = \"holed\"\n[coil]\ninner_diameter_mm = 5.0\nouter_diameter_mm = 9.0\nlength_mm = 40.0\n\
             [wire]\ndiameter_mm = 0.25\n[core]\nbelow_mm = 5.0\n[array]\npositions_mm = {positions_mm:?}\n\
             [supply]\ncurrent_max_a = 1.3\n[target]\nheight_mm = 20.0\n[workspace]\n\
             x_mm = [-20.0, 20.0, 9]\ny_mm = [-20.0, 20.0, 9]\nz_mm = [15.0, 45.0, 4]\n"
        ),
    );
    place.write(
        "bump.toml",
        "name = \"bump\"\nprimitive = \"half-sphere\"\nradius_mm = 11\nbase_mm = 18\n\
         [points]\nx_mm = [-11.0, 11.0, 7]\ny_mm = [-11.0, 11.0, 7]\n",
    );
    place
}

fn arguments<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let all = [
        "calibrate",
        "holed.toml",
        "bump.toml",
        "--tolerance",
        "1e-2",
    ];
    [&all[..], &["--no-report", "--out", out], more].concat()
}

/// Solves one part; how many blocks there are in all and in the part, and how many were solved now.
fn shard(place: &Place, out: &str, part: &str) -> [u64; 3] {
    let ran = place.run(&arguments(out, &["--format", "json", "--shard", part]));
    let json: Value = serde_json::from_str(&ran.ends(0).out).unwrap();
    ["blocks", "blocks_of_shard", "solved"].map(|key| json[key].as_u64().unwrap())
}

/// The bundle's bytes after a run without a part.
fn merged(place: &Place, out: &str, more: &[&str]) -> Vec<Vec<u8>> {
    place.run(&arguments(out, more)).ends(0);
    BUNDLE
        .map(|file| place.read(&format!("{out}/holed/bump/{file}")))
        .to_vec()
}

#[test]
fn three_shards_give_the_bytes_of_one_machine() {
    let place = holed();
    let whole = merged(&place, "whole", &[]);
    for part in ["1/3", "3/3", "2/3"] {
        assert_eq!(shard(&place, "three", part), [3, 1, 1], "{part}");
    }
    assert_eq!(shard(&place, "three", "2/3"), [3, 1, 0], "resumed");
    assert_eq!(merged(&place, "three", &[]), whole);
    let left = place.path(&format!("three/holed/{CACHE}"));
    assert!(left.join("steel").is_file() && !left.join("steel-block-1").exists());
    assert_eq!(shard(&place, "three", "1/1"), [3, 3, 0], "all is there");
    // A part that begins before the first has made its choice makes it itself.
    assert_eq!(shard(&place, "last", "3/3"), [3, 1, 1]);
    assert_eq!(shard(&place, "last", "1/3"), [3, 1, 0]);
    assert_eq!(merged(&place, "last", &["--threads", "1"]), whole);
    assert_eq!(merged(&place, "uncached", &["--no-cache"]), whole);
}

#[test]
#[allow(clippy::disallowed_methods)] // a test's own files
fn shards_that_are_missing_or_damaged_are_solved_again() {
    let place = holed();
    let whole = merged(&place, "whole", &[]);
    assert_eq!(shard(&place, "parts", "1/1"), [3, 3, 3]);
    let entry = |name: &str| format!("parts/holed/{CACHE}/{name}");
    for name in ["steel-choice", "steel-block-1", "steel-block-2"] {
        let mut bytes = place.read(&entry(name));
        let middle = bytes.len() / 2;
        bytes[middle] ^= 0x10;
        place.write(&entry(name), &bytes);
    }
    assert_eq!(shard(&place, "parts", "2/3"), [3, 1, 1]);
    std::fs::remove_file(place.path(&entry("steel-block-1"))).unwrap();
    // The entries of another machine's folder are not trusted.
    for name in ["steel-choice", "steel-block-2"] {
        let bytes = place.read(&entry(name));
        place.write(&format!("copied/holed/{CACHE}/{name}"), &bytes);
    }
    assert_eq!(shard(&place, "copied", "1/1"), [3, 3, 3]);
    assert_eq!(merged(&place, "parts", &[]), whole);
}

#[test]
fn a_part_that_cannot_be_used_is_refused() {
    let place = holed();
    let few = String::from_utf8(place.read("holed.toml")).unwrap();
    let (before, after) = few.split_once("positions_mm = ").unwrap();
    let after = after.split_once('\n').unwrap().1;
    place.write(
        "few.toml",
        &format!("{before}rows = 4\ncolumns = 4\npitch_mm = 10.0\n{after}"),
    );
    let ran = place.run(&["calibrate", "few.toml", "bump.toml", "--shard", "1/2"]);
    let err = ran.ends(3).err;
    assert!(err.contains("more than 16 cored coils"), "{err}");
    // What is in the cache's place belongs to somebody.
    place.write(&format!("taken/holed/{CACHE}"), "mine");
    let err = place
        .run(&arguments("taken", &["--shard", "1/2"]))
        .ends(3)
        .err;
    assert!(err.contains("cannot be kept"), "{err}");
    place.run(&arguments("usage", &["--shard", "3/2"])).ends(2);
}
