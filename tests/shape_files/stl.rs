//! STL: real and damaged files, and the messages.

use fluxform_shape::document::{AxisRequest, GridRequest, Placement, SurfaceFormat};
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::stl::read;
use fluxform_testing::needs::{self, Trial, corpus_folder};
use fluxform_testing::{surfaces, trials};

pub fn trials() -> Vec<Trial> {
    trials! { needs::corpus() => [good_files_have_the_indexs_facts, damaged_files_get_a_message_that_says_where, the_degenerate_triangle_is_left_out_and_said] }
}

fn good_files_have_the_indexs_facts() {
    let folder = corpus_folder();
    let index = std::fs::read_to_string(folder.join("index.tsv")).unwrap();
    let mut read_files = 0;
    for line in index.lines().skip(1) {
        let cells: Vec<&str> = line.split('\t').collect();
        let (name, format, expected) = (cells[0], cells[1], cells[9]);
        if format != "stl" {
            continue;
        }
        let bytes = std::fs::read(folder.join(name)).unwrap();
        if expected.starts_with("error") {
            let message = read(&bytes).unwrap_err().to_string();
            assert!(message.contains("holds no triangle"), "{name}: {message}");
            continue;
        }
        let file = read(&bytes).unwrap();
        assert_eq!(
            file.triangles.len(),
            cells[10].parse::<usize>().unwrap(),
            "{name}"
        );
        let volume: f64 = file
            .triangles
            .iter()
            .map(|[a, b, c]| {
                (a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                    + a[2] * (b[0] * c[1] - b[1] * c[0]))
                    / 6.0
            })
            .sum();
        let target: f64 = cells[15].parse().unwrap();
        // The index gives six digits; open bodies have no volume to compare.
        if cells[13] == "True" {
            assert!(
                (volume - target).abs() <= 1e-5 * target.abs(),
                "{name}: {volume} {target}"
            );
        }
        let mesh = Mesh::place(file, &Transform::new(1.0, &Placement::default())).unwrap();
        let facts = mesh.facts();
        assert_eq!(
            facts.degenerate,
            cells[14].parse::<usize>().unwrap(),
            "{name}"
        );
        let bounds: Vec<f64> = cells[11].split(' ').map(|c| c.parse().unwrap()).collect();
        let size = bounds.iter().fold(0.0, |m: f64, b| m.max(b.abs()));
        for k in 0..3 {
            assert!(
                (facts.bounds.min_m[k] - bounds[k]).abs() <= 1e-5 * size,
                "{name}"
            );
            assert!(
                (facts.bounds.max_m[k] - bounds[k + 3]).abs() <= 1e-5 * size,
                "{name}"
            );
        }
        read_files += 1;
    }
    assert_eq!(read_files, 9);
}

fn damaged_files_get_a_message_that_says_where() {
    let folder = corpus_folder();
    let cases: [(&str, Result<usize, &[&str]>); 19] = [
        ("00_ok_solid_header_binary", Ok(12)),
        (
            "02_truncated_half",
            Err(&["claims 12 triangles (684 bytes)", "384 bytes", "6 whole"]),
        ),
        (
            "04_count_too_small",
            Err(&["claims 8 triangles", "byte 484", "200 bytes", "4 more"]),
        ),
        (
            "06_count_4e9",
            Err(&["claims 4294967280", "684 bytes", "12 whole"]),
        ),
        (
            "08_nan_vertex",
            Err(&["vertex 1 of triangle 1 (byte 96)", "NaN"]),
        ),
        (
            "10_trailing_bytes",
            Err(&["claims 12 triangles", "byte 684", "37 bytes follow"]),
        ),
        ("12_83_bytes", Err(&["83 bytes", "84"])),
        ("14_all_bigendian", Err(&["big-endian", "12 triangles"])),
        ("20_ascii_ok", Ok(12)),
        ("22_ascii_uppercase", Ok(12)),
        ("24_ascii_no_endsolid", Ok(12)),
        ("26_ascii_nan", Err(&["line 4, triangle 1", "`nan`"])),
        (
            "28_ascii_1e999",
            Err(&["line 4, triangle 1", "`1e999` is too large"]),
        ),
        ("30_ascii_two_solids", Ok(24)),
        ("32_ascii_bom", Ok(12)),
        ("34_ascii_cr_only", Ok(12)),
        (
            "36_ascii_garbage_number",
            Err(&["line 4, triangle 1", "a number", "`abc`"]),
        ),
        (
            "38_gitlfs_pointer",
            Err(&["git-LFS pointer", "git lfs pull"]),
        ),
        ("40_degenerate_point_tri", Ok(12)),
    ];
    for (name, expected) in cases {
        let path = folder.join(format!("bad_stl/{name}.stl"));
        let bytes = std::fs::read(&path).unwrap();
        match (SurfaceFormat::Stl.read(&path, &bytes), expected) {
            (Ok(mesh), Ok(count)) => {
                assert_eq!(mesh.triangles.len(), count, "{name}");
                let said = mesh.warnings.join(" ");
                assert_eq!(
                    said.contains("without `endsolid`"),
                    name.contains("no_endsolid")
                );
                assert_eq!(said.contains("2 solids"), name.contains("two_solids"));
            }
            (Err(error), Err(parts)) => {
                let message = error.to_string();
                assert!(
                    parts.iter().all(|p| message.contains(p)),
                    "{name}: {message}"
                );
            }
            (got, _) => panic!("{name}: {got:?}"),
        }
    }
}

fn the_degenerate_triangle_is_left_out_and_said() {
    let folder = corpus_folder();
    let path = folder.join("bad_stl/40_degenerate_point_tri.stl");
    let grid = GridRequest {
        x: AxisRequest::Extent(7),
        y: AxisRequest::Extent(7),
    };
    let placement = surfaces::lifted(1.3);
    let document = surfaces::file(&path, 1.0, placement, grid);
    let result = fluxform_shape::discretize(&document, &fluxform_base::progress::Silent).unwrap();
    let facts = result.mesh.unwrap();
    assert_eq!((facts.triangles, facts.degenerate), (12, 1));
    assert!(
        result
            .warnings
            .iter()
            .any(|w| w.contains("1 of 12 triangles have no area"))
    );
    assert_eq!(result.points.len(), 49);
}
