//! Output: bytes, schemas, formats, and refusals.

use std::fs;

use fluxform::bundle::artefact::sha256_hex;
use fluxform::bundle::atomic::{Overwrite, WriteError, write};
use fluxform::bundle::load::Bundle;
use fluxform::bundle::schema::SCHEMAS;
use fluxform::bundle::write::{MapFormats, write_map_files};
use serde_json::Value;

use fluxform_testing::bundle::*;
use fluxform_testing::needs::Trial;
use fluxform_testing::tree::assert_no_leftovers;
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! {
        None => [what_is_written_is_read_back_and_written_again_to_the_same_bytes, written_json_fits_the_committed_schemas, contradictions_and_bad_numbers_are_not_written, all_formats_of_a_map],
        Some("--ignored, as it prints times".to_owned()) => [figures],
    }
}

fn what_is_written_is_read_back_and_written_again_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (
        folder.path().join("x/first"),
        folder.path().join("y/second"),
    );
    let sample = sample(true, [5, 4, 6]);
    let manifest = sample.write(&first, false).unwrap();
    let bundle = Bundle::open(&first).unwrap();
    assert_eq!(
        bundle,
        Bundle {
            folder: first.clone(),
            ..Bundle::open(&first.join("manifest.json")).unwrap()
        }
    );
    assert_eq!(bundle.manifest, manifest);
    assert_eq!(bundle.map, sample.map);
    assert_eq!(bundle.points, sample.points);
    assert_eq!(bundle.currents, sample.currents);
    assert_eq!(bundle.lambda, sample.lambda);
    sample.write(&second, false).unwrap();
    for name in [
        "manifest.json",
        "map.npz",
        "points.csv",
        "currents.csv",
        "lambda.json",
    ] {
        assert_eq!(
            fs::read(first.join(name)).unwrap(),
            fs::read(second.join(name)).unwrap(),
            "{name}"
        );
    }
    assert!(first.join("timing.json").exists());
    assert!(
        !fs::read_to_string(first.join("manifest.json"))
            .unwrap()
            .contains("timing")
    );
}

fn written_json_fits_the_committed_schemas() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("bundle");
    let sample = sample(false, [4, 4, 4]);
    let manifest = sample.write(&target, false).unwrap();
    let sidecar = sidecar(&manifest);
    write_map_files(
        folder.path(),
        false,
        &sidecar,
        &sample.map,
        MapFormats::default(),
    )
    .unwrap();
    let files = [
        target.join("manifest.json"),
        folder.path().join("map.json"),
        target.join("lambda.json"),
    ];
    for ((name, schema), path) in SCHEMAS.iter().zip(files) {
        let schema: Value = serde_json::from_str(schema).unwrap();
        let validator = jsonschema::validator_for(&schema).unwrap();
        let mut written: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
        let faults: Vec<String> = validator
            .iter_errors(&written)
            .map(|e| e.to_string())
            .collect();
        assert!(faults.is_empty(), "{name}: {faults:?}");
        written.as_object_mut().unwrap().remove("accuracy");
        assert!(
            !validator.is_valid(&written),
            "{name} does not require accuracy"
        );
    }
}

fn contradictions_and_bad_numbers_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("flat");
    let refuse = |edit: fn(&mut Sample), words: &str| {
        let mut sample = sample(false, [4, 4, 4]);
        edit(&mut sample);
        let error = sample.write(&target, false).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert!(!target.exists());
        assert_no_leftovers(folder.path());
    };
    refuse(
        |s| s.map.gz_t_per_m_per_a.to_mut()[3] = f64::NAN,
        "gz_t_per_m_per_a holds a number that is not finite",
    );
    refuse(
        |s| s.lambda.worst_error_n = Some(f64::INFINITY),
        "worst_error_n is not a finite number",
    );
    refuse(
        |s| s.points[3].normal[1] = f64::NAN,
        "a number is not finite",
    );
    refuse(|s| s.points[3].x_m += 1e-6, "row 3 of points.csv");
    refuse(|s| s.points[3].height_m += 1e-6, "agree on the heights");
    refuse(
        |s| s.manifest.circuit.as_mut().unwrap().inductance_h[1][2] = 0.1,
        "agree on inductance_h",
    );
    refuse(
        |s| s.map.runtime.rendering.as_mut().unwrap().static_current_a[0] = 0.1,
        "map.npz and currents.csv agree",
    );
    refuse(
        |s| s.map.runtime.rendering = None,
        "lacks what position feedback needs",
    );
    refuse(
        |s| s.currents[1].current_a = 0.1,
        "currents.csv and lambda.json agree",
    );
    refuse(|s| s.manifest.magnet.moment_a_m2[2] = 0.9, "moment_a_m2");
    refuse(
        |s| {
            s.manifest.magnet.moment_a_m2[0] = 0.1;
            s.map.runtime.moment_a_m2[0] = 0.1;
        },
        "tilted magnet needs gradient",
    );
}

fn all_formats_of_a_map() {
    let folder = tempfile::tempdir().unwrap();
    let mut sample = sample(true, [4, 3, 2]);
    let nodes = sample.map.gz_t_per_m_per_a.len();
    sample.map.field_t_per_a = Some((0..3 * nodes).map(|i| (i as f64 * 0.7).sin()).collect());
    let formats = MapFormats {
        csv: true,
        vtk: true,
    };
    let sidecar = sidecar(&sample.manifest);
    let written = write_map_files(folder.path(), false, &sidecar, &sample.map, formats).unwrap();
    for file in &written.files {
        let bytes = fs::read(folder.path().join(&file.path)).unwrap();
        assert_eq!(
            (bytes.len() as u64, sha256_hex(&bytes)),
            (file.bytes, file.sha256.clone())
        );
    }
    assert_eq!(written.files.len(), 3);
    let csv = fs::read_to_string(folder.path().join("map.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + nodes);
    // The appended arrays start where the XML says and hold the map's bytes.
    let vti = fs::read(folder.path().join("map.vti")).unwrap();
    let marker = b"<AppendedData encoding=\"raw\">\n_";
    let start = vti.windows(marker.len()).position(|w| w == marker).unwrap() + marker.len();
    let head = String::from_utf8(vti[..start].to_vec()).unwrap();
    assert!(head.contains("WholeExtent=\"0 3 0 2 0 1\""), "{head}");
    let name =
        "Name=\"field_t_per_a_coil_3\" NumberOfComponents=\"3\" format=\"appended\" offset=\"";
    let offset: usize = head
        .split(name)
        .nth(1)
        .unwrap()
        .split('"')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let at = start + offset;
    let size = u64::from_le_bytes(vti[at..at + 8].try_into().unwrap()) as usize;
    assert_eq!(size, nodes / 3 * 3 * 8);
    let first = f64::from_le_bytes(vti[at + 8..at + 16].try_into().unwrap());
    assert_eq!(
        first,
        sample.map.field_t_per_a.as_ref().unwrap()[nodes / 3 * 2 * 3]
    );
    // Same inputs: replaced. Others: refused, and nothing touched.
    write_map_files(
        folder.path(),
        false,
        &sidecar,
        &sample.map,
        MapFormats::default(),
    )
    .unwrap();
    let mut other = sidecar.clone();
    other.inputs.pop();
    let error = write_map_files(
        folder.path(),
        false,
        &other,
        &sample.map,
        MapFormats::default(),
    );
    assert!(matches!(error, Err(WriteError::OutputExists { .. })));
    assert_no_leftovers(folder.path());
}

/// Times of the stages that a map of nine coils goes through; `cargo test --release --test bundle
/// -- --ignored --nocapture figures`.
fn figures() {
    use fluxform::bundle::map_table::write_map;
    use fluxform::bundle::npz::{from_npz, to_npz};
    use fluxform::numerics::lagrange::locate;
    use std::time::Instant;
    let mut sample = sample(false, [61, 61, 29]);
    let nodes = 61 * 61 * 29;
    sample.map.coil = (0..9).collect::<Vec<i64>>().into();
    let runtime = &mut sample.map.runtime;
    runtime.rendering = None;
    runtime.current_max_a = vec![2.0; 9];
    runtime.current_min_a = vec![0.0; 9];
    runtime.resistance_ohm = vec![6.07; 9];
    sample.map.gz_t_per_m_per_a = (0..9 * nodes)
        .map(|i| (i as f64 * 0.7).sin() * 0.013)
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let time = |what: &str, work: &mut dyn FnMut()| {
        let times: Vec<f64> = (0..7)
            .map(|_| {
                let start = Instant::now();
                work();
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        eprintln!(
            "{what}: {:.2} ms (best of 7)",
            times.iter().fold(f64::MAX, |a, &b| a.min(b))
        );
    };
    let bytes = to_npz(&sample.map).unwrap();
    time("npz to memory", &mut || {
        assert_eq!(to_npz(&sample.map).unwrap().len(), bytes.len())
    });
    time("npz from memory", &mut || {
        assert_eq!(from_npz(&bytes).unwrap().coil.len(), 9)
    });
    time("sha256", &mut || assert_eq!(sha256_hex(&bytes).len(), 64));
    let path = folder.path().join("map.npz");
    time("npz to disk, with digest and fsync", &mut || {
        write(&path, &Overwrite::force(), |out| {
            out.write_all(&to_npz(&sample.map).unwrap())
        })
        .unwrap();
    });
    eprintln!("map.npz has {} bytes", bytes.len());
    time("map as CSV, 971,181 rows, into nothing", &mut || {
        write_map(&mut std::io::sink(), &sample.map).unwrap();
    });
    let cells = 100_000u32;
    let [x, y, z] = [&*sample.map.x_m, &*sample.map.y_m, &*sample.map.z_m];
    time(
        "100,000 positions, nine coils each, interpolated",
        &mut || {
            let mut sum = 0.0;
            for i in 0..cells {
                let t = |p: u32| f64::from(i.wrapping_mul(p) % cells) / f64::from(cells);
                let at = [
                    0.1 * t(1) - 0.05,
                    0.09 * t(7_919) - 0.043,
                    0.07 * t(104_729) + 0.01,
                ];
                let cell = locate([x, y, z], at).expect("inside");
                for coil in sample.map.gz_t_per_m_per_a.chunks_exact(nodes) {
                    sum += cell.value(coil);
                }
            }
            assert!(sum.is_finite());
        },
    );
}
