//! Damaged bytes must give a mesh or a message: never a panic, never a long wait.

use std::path::Path;

use fluxform_shape::MeshReport;
use fluxform_shape::document::{Placement, SurfaceFormat};
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::stl;

use fluxform_testing::Random;
use fluxform_testing::surface_files;
use fluxform_testing::surfaces::{binary, grid, sample};

fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    const PIECES: [&[u8]; 14] = [
        b"solid",
        b"facet",
        b"\r",
        b"vertex nan",
        b"1e309",
        b"endsolid",
        b"\xff\xff\xff\x7f",
        b"\0\0\0\0",
        b"99999999999",
        b" -1 ",
        b"<object id=\"1\">",
        b"</mesh>",
        b"nan",
        b"\xff\"&#0;",
    ];
    for _ in 0..=random.below(6) {
        if bytes.is_empty() {
            return;
        }
        let at = random.below(bytes.len());
        match random.below(6) {
            0 => bytes[at] = random.bits() as u8,
            1 => bytes[at] ^= 1 << random.below(8),
            2 => bytes.truncate(at),
            3 => {
                let piece = PIECES[random.below(PIECES.len())];
                bytes.splice(at..at, piece.iter().copied());
            }
            4 => {
                let end = (at + random.below(60)).min(bytes.len());
                bytes.drain(at..end);
            }
            _ => {
                let end = (at + random.below(60)).min(bytes.len());
                let copy = bytes[at..end].to_vec();
                bytes.extend(copy);
            }
        }
    }
}

#[test]
fn mutated_files_are_read_or_refused() {
    let floats = [[[0.7f32, -1.3, 2.9], [10.1, 0.3, 3.1], [-4.7, 8.3, 2.3]]; 3];
    let text = "solid a b\n facet normal 0 0 1\n  outer loop\n   vertex 0.7 -1.3 2.9e+000\n   \
                vertex 10.1 .3 3\n   vertex -4.7 8.3 1e-3\n  endloop\n endfacet\nendsolid a b\n";
    let seeds = [
        binary(&floats),
        text.as_bytes().to_vec(),
        text.repeat(2).into_bytes(),
    ];
    let mut random = Random::new(5);
    let (mut read, mut sampled) = (0, 0);
    for round in 0..60_000 {
        let mut bytes = seeds[round % 3].clone();
        mutate(&mut bytes, &mut random);
        let Ok(file) = stl::read(&bytes) else {
            continue;
        };
        read += 1;
        assert!(
            file.triangles.len() * 9 <= bytes.len(),
            "more numbers than bytes"
        );
        let Ok(mesh) = Mesh::place(file, &Transform::new(0.001, &Placement::default())) else {
            continue;
        };
        let plan = grid((-0.005, 0.011, 9), (-0.002, 0.009, 7));
        for found in sample(&mesh, &plan).into_iter().flatten() {
            assert!(found.height_m.is_finite() && found.normal[2] >= 0.0);
            let [x, y, z] = found.normal;
            assert!(
                (x * x + y * y + z * z - 1.0).abs() < 1e-12,
                "{:?}",
                found.normal
            );
            sampled += 1;
        }
    }
    assert!(read > 2_000 && sampled > 30_000, "{read} {sampled}");
}

/// The display lists of parts up to 2014.
const PACKED: &str = "Contents/DisplayLists__ZLB";

/// Of every format the bytes as they are, and what they pack, mutated.
#[test]
fn mutated_files_of_every_format_are_read_or_refused() {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    type Pack = fn(&[u8]) -> Vec<u8>;
    let as_it_is: Pack = <[u8]>::to_vec;
    let [manifest, structure, representation] = surface_files::three_dxml_parts();
    let product = |structure: &str, representation: &str| {
        surface_files::zipped(&[
            (manifest.0, &manifest.1),
            ("P.3dxml", structure),
            ("R.3DRep", representation),
        ])
    };
    let seeds: [(SurfaceFormat, Vec<u8>, Pack); 17] = [
        (SurfaceFormat::Obj, surface_files::obj(), as_it_is),
        (SurfaceFormat::Off, surface_files::off(), as_it_is),
        (SurfaceFormat::Glb, surface_files::glb(), as_it_is),
        (SurfaceFormat::Ply, surface_files::ply_strips(), as_it_is),
        (
            SurfaceFormat::HeightImage,
            surface_files::height_image(3, &[7, 1, 2, 3, 9, 4], png::BitDepth::Sixteen),
            as_it_is,
        ),
        (SurfaceFormat::Ply, surface_files::ply_ascii(), as_it_is),
        (
            SurfaceFormat::Ply,
            surface_files::ply_binary(false),
            as_it_is,
        ),
        (
            SurfaceFormat::ThreeMf,
            surface_files::three_mf("inch"),
            as_it_is,
        ),
        (
            SurfaceFormat::ThreeMf,
            surface_files::three_mf_model("inch"),
            |model| surface_files::three_mf_of(&String::from_utf8_lossy(model)),
        ),
        (
            SurfaceFormat::Amf,
            surface_files::amf("mm").into_bytes(),
            as_it_is,
        ),
        (
            SurfaceFormat::ThreeDxml,
            surface_files::three_dxml(),
            as_it_is,
        ),
        (SurfaceFormat::Sldprt, surface_files::sldprt(), as_it_is),
        (
            SurfaceFormat::Sldprt,
            surface_files::display_lists(),
            surface_files::sldprt_of,
        ),
        (
            SurfaceFormat::Sldprt,
            surface_files::sldprt_compound(&[(PACKED, &surface_files::display_lists())]),
            as_it_is,
        ),
        (
            SurfaceFormat::Sldprt,
            surface_files::display_lists(),
            |stream| surface_files::sldprt_compound(&[(PACKED, stream)]),
        ),
        (
            SurfaceFormat::Sldprt,
            surface_files::assembly().0.into_bytes(),
            |tree| surface_files::sldprt_assembly(tree, &surface_files::assembly().1),
        ),
        (
            SurfaceFormat::Sldprt,
            surface_files::assembly().1,
            |stream| surface_files::sldprt_assembly(surface_files::assembly().0.as_bytes(), stream),
        ),
    ];
    let mut random = Random::new(7);
    let look = |format: SurfaceFormat, bytes: &[u8]| {
        let Ok(file) = format.read(Path::new("f"), bytes) else {
            return 0;
        };
        assert!(!file.triangles.is_empty() && file.triangles.len() < 10_000);
        let finite = file.triangles.as_flattened().as_flattened();
        assert!(finite.iter().all(|c| c.is_finite()), "{format:?}");
        let report = MeshReport::new(format, file);
        assert!(report.open_edges <= 3 * report.triangles);
        1
    };
    for (format, seed, pack) in &seeds {
        let mut read = 0;
        for _ in 0..3_000 {
            let mut bytes = seed.clone();
            mutate(&mut bytes, &mut random);
            read += look(*format, &pack(&bytes));
        }
        // Checksums leave of an image hardly anything that is damaged and read.
        let least = if *format == SurfaceFormat::HeightImage {
            0
        } else {
            10
        };
        assert!(read > least || least == 0, "{format:?}: {read}");
    }
    let mut read = 0;
    for round in 0..3_000 {
        let mut parts = [
            structure.1.clone().into_bytes(),
            representation.1.clone().into_bytes(),
        ];
        mutate(&mut parts[round % 2], &mut random);
        read += look(
            SurfaceFormat::ThreeDxml,
            &product(&text(&parts[0]), &text(&parts[1])),
        );
    }
    assert!(read > 10, "{read}");
}
