//! SOLIDWORKS parts and assemblies, on files made here.

use std::path::Path;

use fluxform_shape::document::SurfaceFormat;
use fluxform_shape::file_mesh::FileMesh;

use crate::formats::{read, refusal};
use fluxform_testing::surface_files::{
    assembly, display_lists, sldprt, sldprt_assembly, sldprt_blocks, sldprt_compound, sldprt_of,
    zipped,
};

fn mesh_of(bytes: &[u8]) -> FileMesh {
    read(SurfaceFormat::Sldprt, bytes).unwrap()
}

#[test]
fn a_damaged_native_part_is_refused() {
    let good = sldprt();
    for (at, byte, said) in [(4, 1, "its sign is missing"), (8, 1, "no block of data")] {
        let mut bytes = good.clone();
        bytes[at] ^= byte;
        let message = refusal(SurfaceFormat::Sldprt, &bytes);
        assert!(message.contains(said), "{message}");
    }
    // Checksum, then the length unpacked.
    for at in [18, 26] {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        let message = refusal(SurfaceFormat::Sldprt, &bytes);
        assert!(message.contains("that it claims"), "{at}: {message}");
        bytes[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        refusal(SurfaceFormat::Sldprt, &bytes);
    }
    let ole = refusal(SurfaceFormat::Sldprt, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1");
    assert!(
        ole.contains("damaged") && ole.contains("save the body as STEP"),
        "{ole}"
    );
}

/// A packed part was advised to be opened in SOLIDWORKS.
#[test]
fn regression_a_zip_archive_was_a_part_without_its_sign() {
    let bytes = zipped(&[("part.txt", "no part")]);
    for format in [SurfaceFormat::Sldprt, SurfaceFormat::Stl] {
        let message = refusal(format, &bytes);
        assert!(
            message.contains("ZIP archive: unpack it first"),
            "{message}"
        );
    }
    // What is an archive itself lacks its part.
    let message = refusal(SurfaceFormat::ThreeMf, &bytes);
    assert!(!message.contains("unpack it"), "{message}");
    let advice = SurfaceFormat::advice(Path::new("part.ZIP")).unwrap();
    assert!(advice.contains("unpack it first"), "{advice}");
}

const LISTS: &str = "Contents/DisplayLists";
const TREE: &str = "swXmlContents/COMPINSTANCETREE";

/// The first was taken, and what a header claimed was skipped with all that it held.
#[test]
fn the_display_of_a_native_part_is_the_block_that_verifies() {
    let lists = display_lists();
    let plain = mesh_of(&sldprt());
    let decoy = (LISTS, &lists[..40], false);
    let real = (LISTS, &lists[..], true);
    for blocks in [
        vec![decoy, real],
        vec![real, decoy],
        vec![decoy, decoy, real, decoy],
        vec![("Contents/Other", &lists[..40], false), real],
    ] {
        let mesh = mesh_of(&sldprt_blocks(&blocks));
        assert_eq!(mesh.triangles, plain.triangles, "{}", blocks.len());
    }
    let message = refusal(SurfaceFormat::Sldprt, &sldprt_blocks(&[decoy, decoy]));
    assert!(message.contains("none of the 2 blocks"), "{message}");
}

/// Parts up to 2014 were refused.
#[test]
fn native_parts_of_either_container_and_either_packing_are_read() {
    let lists = display_lists();
    let plain = mesh_of(&sldprt());
    for name in [LISTS, &format!("{LISTS}__ZLB")] {
        let bytes = sldprt_compound(&[("Contents/Config-0", b"else"), (name, &lists)]);
        assert_eq!(mesh_of(&bytes), plain, "{name}");
    }
    let none = sldprt_compound(&[("Contents/Config-0", b"else")]);
    let message = refusal(SurfaceFormat::Sldprt, &none);
    assert!(message.contains("holds no display data"), "{message}");
    let cut = sldprt_compound(&[(&format!("{LISTS}__ZLB"), &lists)]);
    for at in (600..cut.len()).step_by(37) {
        let mut bytes = cut.clone();
        bytes[at] ^= 0x55;
        let _ = SurfaceFormat::Sldprt.read(Path::new("f"), &bytes);
        let _ = SurfaceFormat::Sldprt.read(Path::new("f"), &cut[..at]);
    }
}

/// Assemblies were refused. The display holds every part once, where the part has it.
#[test]
fn parts_of_a_native_assembly_stand_where_it_places_them() {
    let (tree, lists) = assembly();
    let modern = sldprt_blocks(&[(TREE, tree.as_bytes(), true), (LISTS, &lists, true)]);
    let old = sldprt_compound(&[
        (&format!("{TREE}__ZLB"), tree.as_bytes()),
        (&format!("{LISTS}__ZLB"), &lists),
    ]);
    let part = mesh_of(&sldprt()).triangles;
    for bytes in [modern, old] {
        let mesh = mesh_of(&bytes);
        let (first, second) = mesh.triangles.split_at(4);
        assert_eq!(first, part);
        for (placed, own) in second.as_flattened().iter().zip(part.as_flattened()) {
            // The x axis lies along y, the y axis against x.
            assert_eq!(*placed, [10.0 - own[1], own[0], own[2]]);
        }
        assert_eq!(second.len(), 4);
        assert!(mesh.warnings[1].contains("1 hidden"), "{:?}", mesh.warnings);
    }
}

#[test]
fn an_assembly_without_the_display_of_a_part_names_it() {
    let (tree, lists) = assembly();
    for (tree, lists) in [
        (tree.clone(), display_lists()),
        // The part that is there is another one than the assembly states.
        (
            tree.replace("0 0 0 0.7 1.3 2.9", "0 0 0 0.7 1.3 3.9"),
            lists.clone(),
        ),
        (
            tree.replace("0 0 0 0.7 1.3 2.9", "0 0 0 0.7 1.3 1.9"),
            lists.clone(),
        ),
        (tree.replace("swBoundingBox", "swOther"), lists.clone()),
    ] {
        let bytes = sldprt_assembly(tree.as_bytes(), &lists);
        let message = refusal(SurfaceFormat::Sldprt, &bytes);
        assert!(message.contains("lack 1 of its 1 parts"), "{message}");
        assert!(
            message.contains("`Body`") && message.contains("STEP"),
            "{message}"
        );
    }
}

/// The deviation was that of the coarsest display of a box of this size, whatever the facets.
#[test]
fn the_deviation_of_a_display_mesh_is_that_of_its_strips_angles() {
    // A quarter of a cylinder of 10 mm radius, 40 mm long, in `facets` facets: one strip.
    for facets in [3usize, 12, 48] {
        let step = std::f64::consts::FRAC_PI_2 / facets as f64;
        let mut points = Vec::new();
        for k in 0..=facets {
            let (sin, cos) = (k as f64 * step).sin_cos();
            points.extend([
                [0.01 * cos, 0.0, 0.01 * sin],
                [0.01 * cos, 0.04, 0.01 * sin],
            ]);
        }
        let n = points.len() as u32;
        let mut stream: Vec<u8> = [4, 8, 2, 1, n, 12, 100, 2, n]
            .iter()
            .flat_map(|w: &u32| w.to_le_bytes())
            .collect();
        for c in points.as_flattened() {
            stream.extend((*c as f32).to_le_bytes());
        }
        let mesh = mesh_of(&sldprt_of(&stream));
        let sagitta = 0.01 * (1.0 - (0.5 * step).cos());
        let ratio = mesh.deviation / sagitta;
        assert!((0.9..3.0).contains(&ratio), "{facets}: {ratio}");
    }
}
