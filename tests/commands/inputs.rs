//! Inputs that change while they are read.

#![allow(clippy::disallowed_methods)] // a user's file, not an artefact

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use fluxform::bundle::artefact::sha256_hex;
use fluxform::commands::discretize;
use fluxform::progress::Silent;
use fluxform::shape::document::ShapeDocument;

/// A flat square of 20 mm as a binary STL file.
fn square(height_mm: f32) -> Vec<u8> {
    let corner = |x: f32, y: f32| [x, y, height_mm];
    let [a, b, c, d] =
        [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)].map(|(x, y)| corner(x, y));
    let mut bytes = vec![0; 80];
    bytes.extend(2_u32.to_le_bytes());
    for triangle in [[a, b, c], [a, c, d]] {
        bytes.extend([0; 12]);
        bytes.extend(triangle.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// The file was read once for its digest and again for its triangles: a program that wrote it
/// between gave points of one surface under the digest of another.
#[test]
fn the_recorded_digest_is_that_of_the_bytes_that_were_parsed() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let surface = folder.path().join("square.stl");
    let files = [30.0, 50.0].map(square);
    let digests = files.each_ref().map(|bytes| sha256_hex(bytes));
    let put = |bytes: &[u8]| {
        let draft = folder.path().join("draft");
        std::fs::write(&draft, bytes).expect("writable");
        std::fs::rename(&draft, &surface).expect("renamed");
    };
    put(&files[0]);
    let text = "name = \"square\"\nsurface = \"square.stl\"\nunit = \"mm\"\n\
                points = { x_mm = [1.0, 19.0, 3], y_mm = [1.0, 19.0, 3] }\n";
    let shape = folder.path().join("square.toml");
    let (document, _) = ShapeDocument::from_toml(text, Path::new(&shape)).expect("valid");
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !stop.load(Ordering::Relaxed) {
                files.iter().for_each(|bytes| put(bytes));
            }
        });
        for _ in 0..400 {
            let report = discretize::run(&document, Vec::new(), &Silent);
            let summary = report.map(|report| report.summary);
            if summary.is_err() {
                stop.store(true, Ordering::Relaxed);
            }
            let summary = summary.expect("a surface");
            let parsed = usize::from(summary.min_height_m > 0.04);
            if summary.inputs[0].sha256 != digests[parsed] {
                stop.store(true, Ordering::Relaxed);
            }
            assert_eq!(summary.inputs[0].sha256, digests[parsed]);
        }
        stop.store(true, Ordering::Relaxed);
    });
}
