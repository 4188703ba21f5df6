//! Real files of every format, against the index that came with them.

use std::collections::BTreeMap;

use fluxform_base::progress::Silent;
use fluxform_shape::MeshReport;
use fluxform_shape::bodies::BodyOptions;

use fluxform_testing::needs::{self, Trial, corpus_folder};
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! { needs::corpus() => [real_files_have_the_indexs_facts, components_in_other_parts_are_placed, an_amf_body_is_whole, a_native_part_is_its_stl_within_the_stated_deviation, open_edges_and_units_are_reported] }
}

/// One line of the index, by the names of its columns.
type Entry = BTreeMap<String, String>;

fn entries(index: &str) -> Vec<Entry> {
    let mut lines = index.lines();
    let names: Vec<&str> = lines.next().unwrap().split('\t').collect();
    let entry = |line: &str| {
        let cells = names.iter().zip(line.split('\t'));
        cells
            .map(|(name, cell)| ((*name).to_owned(), cell.to_owned()))
            .collect()
    };
    lines.map(entry).collect()
}

/// Facts in which the index is not what a reader must find.
fn exceptions(name: &str) -> &'static [&'static str] {
    match name {
        // The index's reader splits vertices at the seams of textures; by position both are closed.
        "trimesh__negative_indices.obj" | "trimesh__fuze_ascii.ply" => &["watertight"],
        // It takes both parts' object 1 for each other and builds all four: 16 triangles.
        "assimp__production_components.3mf" => &["triangles", "bounds", "volume"],
        // It could not read AMF, nor a part of 2014.
        "assimp__test1.amf" | "swurdf__BlockA.SLDPRT" => {
            &["triangles", "bounds", "volume", "watertight"]
        }
        _ => &[],
    }
}

/// Files that hold no surface, or none that is read, and what the message says.
const REFUSED: [(&str, &str); 2] = [
    ("trimesh__empty.stl", "holds no triangle"),
    (
        "trimesh__points_emptyface.ply",
        "1024 points and no face: there is no surface",
    ),
];

fn real_files_have_the_indexs_facts() {
    let folder = corpus_folder();
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    let mut read_files = 0;
    for entry in entries(&index) {
        let name = entry["file"].as_str();
        // STEP has no triangles of its own: `step` compares bodies.
        if entry["format"] == "step" {
            continue;
        }
        let result = MeshReport::of_file(&folder.join(name), &BodyOptions::default(), &Silent);
        if let Some((_, said)) = REFUSED.iter().find(|(file, _)| *file == name) {
            let message = result.unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
            continue;
        }
        let report = result.unwrap();
        let differs = |fact: &str| exceptions(name).contains(&fact);
        let parse = |key: &str| entry[key].parse::<f64>().unwrap();
        if !differs("triangles") {
            assert_eq!(report.triangles as f64, parse("triangles"), "{name}");
        }
        if !differs("watertight") {
            assert_eq!(report.watertight, entry["watertight"] == "True", "{name}");
        }
        // The index lists native parts in millimetres.
        let unit = if name.ends_with("SLDPRT") {
            1000.0
        } else {
            1.0
        };
        if !differs("volume") && report.watertight {
            let (got, expected) = (report.volume.unwrap() * unit * unit * unit, parse("volume"));
            assert!(
                (got - expected).abs() < 1e-5 * expected,
                "{name}: {got} {expected}"
            );
        }
        if !differs("bounds") {
            let expected = entry["bounds_min_max"].split(' ');
            let expected: Vec<f64> = expected.map(|c| c.parse().unwrap()).collect();
            let size = expected.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
            for (k, expected) in expected.iter().enumerate() {
                let got = [report.bounds_min, report.bounds_max][k / 3][k % 3] * unit;
                assert!(
                    (got - expected).abs() <= 1e-5 * size,
                    "{name}: {got} {expected}"
                );
            }
        }
        assert_eq!((report.degenerate, report.duplicate), (0, 0), "{name}");
        read_files += 1;
    }
    assert_eq!(read_files, 17);
}

fn report(name: &str) -> MeshReport {
    MeshReport::of_file(
        &corpus_folder().join(name),
        &BodyOptions::default(),
        &Silent,
    )
    .unwrap()
}

fn components_in_other_parts_are_placed() {
    let report = report("assimp__production_components.3mf");
    // A corner of a cube of 10 mm, and one of 5 mm moved by 20 mm.
    assert_eq!((report.triangles, report.unit_m), (8, Some(1e-3)));
    assert_eq!(report.bounds_max, [25.0, 10.0, 10.0]);
    assert!((report.volume.unwrap() - (1000.0 + 125.0) / 6.0).abs() < 1e-12);
}

fn an_amf_body_is_whole() {
    let report = report("assimp__test1.amf");
    // A tetrahedron on a triangle of base 1 and depth 1.5, 4 high.
    assert_eq!((report.triangles, report.watertight), (4, true));
    assert!((report.volume.unwrap().abs() - 1.0).abs() < 1e-12);
}

fn a_native_part_is_its_stl_within_the_stated_deviation() {
    let (part, stl) = (report("sxt__Part1.SLDPRT"), report("sxt__Part1.STL"));
    assert_eq!((part.triangles, part.unit_m), (750, Some(1.0)));
    let volume_mm3 = part.volume.unwrap() * 1e9;
    assert!((volume_mm3 - 15663.4).abs() < 0.05, "{volume_mm3}");
    let apart = (volume_mm3 - stl.volume.unwrap()).abs() / stl.area;
    assert!(apart < part.deviation * 1000.0, "{apart}");
    // A bound by the box's diagonal alone would be 0.54 mm.
    assert!(
        (0.03e-3..0.05e-3).contains(&part.deviation),
        "{}",
        part.deviation
    );
    assert!(
        part.warnings[0].contains("experimental"),
        "{:?}",
        part.warnings
    );
}

fn open_edges_and_units_are_reported() {
    let (holes, metres) = (
        report("assimp__sphereWithHole.stl"),
        report("swurdf__base_link.STL"),
    );
    assert!(holes.open_edges > 0 && holes.volume.is_none());
    assert!(
        holes.warnings[0].contains("the surface is open"),
        "{:?}",
        holes.warnings
    );
    // An exporter's metres: guessed, never used.
    let guess = metres.unit_guesses[0];
    assert_eq!((guess.unit, metres.unit_m), ("m", None));
    assert!((guess.size_m - 0.1).abs() < 1e-6);
}
