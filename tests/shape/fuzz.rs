//! Damaged bytes must give a mesh or a message: never a panic, never a long wait.

use fluxform::shape::document::Placement;
use fluxform::shape::mesh::Mesh;
use fluxform::shape::placement::Transform;
use fluxform::shape::stl;

use crate::support::{Random, binary, grid, sample};

fn mutate(bytes: &mut Vec<u8>, random: &mut Random) {
    const PIECES: [&[u8]; 8] = [
        b"solid",
        b"facet",
        b"\r",
        b"vertex nan",
        b"1e309",
        b"endsolid",
        b"\xff\xff\xff\x7f",
        b"\0\0\0\0",
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
    let mut random = Random(5);
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
