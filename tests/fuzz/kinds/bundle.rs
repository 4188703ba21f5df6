//! Bundles: their manifest, map and tables damaged behind fitting digests; links, pipes, paths.

use std::io::{Cursor, Read, Write};
use std::path::Path;
use std::sync::OnceLock;

use fluxform::bundle::artefact::{FileEntry, Input as Named, sha256_hex};
use fluxform::bundle::json::to_json;
use fluxform::bundle::load::Bundle;
use fluxform::bundle::npz::to_npz;
use fluxform::bundle::table::{CurrentRow, PointRow, write_rows};
use fluxform::bundle::trajectory::Trajectory;
use fluxform::commands::calibrate::{self, CalibrateOptions};
use fluxform::commands::replay::{self, Opened, summary::TrajectorySource};
use fluxform::commands::verify;
use fluxform::design::{Design, Need};
use fluxform::progress::Silent;
use fluxform::scene::sources::{DesignSource, ShapeSource};
use fluxform::shape::document::ShapeDocument;
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::{finite, limits, refusal};
use crate::harness::{Content, Input, Kind};
use crate::structure::{damage_json, damage_text, extreme};
use fluxform_testing::Random;
use fluxform_testing::bundle::{Sample, sample};

pub fn kind() -> Kind {
    Kind {
        name: "bundle",
        limits: limits(64.0, 32.0),
        seeds,
        hostile,
        mutate,
        give,
    }
}

const MANIFEST: &str = "manifest.json";
const MAP: &str = "map.npz";

/// A design of the sample's coils and limits; the magnet's tilt is written behind it.
const DESIGN: &str = "name = \"a\"\n[coil]\ninner_diameter_mm = 24\nouter_diameter_mm = 38\n\
                      length_mm = 70\n[wire]\ndiameter_mm = 0.7\n[array]\npositions_mm = [[-50, -50], \
                      [50, -50], [-50, 50], [50, 50]]\n[supply]\ncurrent_min_a = [0, -0.7, 0, 0]\n\
                      current_max_a = [2, 2, 1.3, 2]\ntotal_current_max_a = 5.3\nvoltage_v = 36\n\
                      [workspace]\nx_mm = [-50, 50, 4]\ny_mm = [-43, 51, 4]\nz_mm = [10, 80, 4]\n\
                      [magnet]\nmagnetization_a_per_m = 1.1579e6\n";
/// An object that needs no surface's file.
const SHAPE: &str = "name = \"b\"\nprimitive = \"wedge\"\nlow_mm = 31\nhigh_mm = 43\n[points]\n\
                     x_mm = [-37, 37, 3]\ny_mm = [-23, 23, 3]\n";

/// The design's text, and the bundle that it gives: file by file, and loaded.
struct Honest {
    design: String,
    files: Input,
    bundle: Bundle,
}

/// Results of upright and tilted designs. The shape is not found again, so that `verify` goes on to
/// its independent route; the bundles' files are found in `with_inputs`.
fn honest(tilted: bool) -> &'static Honest {
    static MADE: [OnceLock<Honest>; 2] = [const { OnceLock::new() }; 2];
    MADE[usize::from(tilted)].get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let tilt = if tilted { "tilt_deg = [7, -3]\n" } else { "" };
        let text = format!("{DESIGN}{tilt}");
        let (design, _) =
            Design::from_toml(&text, Path::new("a.toml"), Need::CALIBRATE).expect("a design");
        let (document, _) = ShapeDocument::from_toml(SHAPE, Path::new("b.toml")).expect("a shape");
        let source = DesignSource {
            design: &design,
            text: &text,
            input: &Named::of_bytes("-", text.as_bytes()),
        };
        let shape = ShapeSource {
            document,
            input: Some(Named::of_bytes("-", SHAPE.as_bytes())),
        };
        let mut options = CalibrateOptions::new(folder.path());
        options.keep = false;
        let report = calibrate::run(source, &[shape], &options, &Silent).expect("a bundle");
        let folder = &report.bundles[0].folder;
        let bundle = Bundle::open(folder).expect("a bundle");
        let mut files = Input::default();
        let listed = bundle.manifest.files.iter().map(|file| file.path.as_str());
        for name in listed.chain([MANIFEST]) {
            let bytes = std::fs::read(folder.join(name)).expect("a bundle's file");
            files.put(name, Content::Bytes(bytes));
        }
        Honest {
            design: text,
            files,
            bundle,
        }
    })
}

/// The sample with the inputs, coils and magnet of a design that is kept with it.
fn of_design(mut sample: Sample) -> (Sample, &'static str) {
    let moment = sample.map.runtime.moment_a_m2;
    let honest = honest(moment[0] != 0.0);
    let manifest = &honest.bundle.manifest;
    sample.lambda.inputs = manifest.inputs.clone();
    sample.manifest.inputs = manifest.inputs.clone();
    sample.manifest.made_with = manifest.made_with.clone();
    sample.manifest.array = manifest.array.clone();
    sample.manifest.magnet = manifest.magnet.clone();
    sample.manifest.resistance_ohm = manifest.resistance_ohm.clone();
    let runtime = &mut sample.map.runtime;
    runtime.moment_a_m2 = manifest.magnet.moment_a_m2;
    runtime.resistance_ohm = manifest.resistance_ohm.clone();
    (sample, &honest.design)
}

/// The files of a bundle, with fitting digests. What the writer refuses is written all the same
/// where it can be known.
fn packed((sample, design): &(Sample, &str)) -> Option<Input> {
    let mut input = Input::default();
    let mut put = |name: &str, bytes: Vec<u8>| input.put(name, Content::Bytes(bytes));
    put(MAP, to_npz(&sample.map).ok()?);
    let mut table = Vec::new();
    write_rows(&mut table, PointRow::COLUMNS, sample.points.iter().copied()).ok()?;
    put("points.csv", table);
    let mut table = Vec::new();
    write_rows(
        &mut table,
        CurrentRow::COLUMNS,
        sample.currents.iter().copied(),
    )
    .ok()?;
    put("currents.csv", table);
    put("lambda.json", to_json(&sample.lambda).ok()?);
    put("design.toml", design.as_bytes().to_vec());
    let mut manifest = sample.manifest.clone();
    manifest.files = Vec::new();
    put(MANIFEST, serde_json::to_vec(&manifest).ok()?);
    list(&mut input);
    Some(input)
}

/// Lists all files in the manifest.
fn list(input: &mut Input) {
    let entries: Vec<FileEntry> = input
        .0
        .iter()
        .filter(|(name, _)| name != MANIFEST)
        .filter_map(|(name, content)| match content {
            Content::Bytes(bytes) => Some(FileEntry {
                path: name.clone(),
                bytes: bytes.len() as u64,
                sha256: sha256_hex(bytes),
            }),
            _ => None,
        })
        .collect();
    edit(input, |manifest| manifest["files"] = json!(entries));
}

fn edit(input: &mut Input, edit: impl FnOnce(&mut Value)) {
    if let Some(bytes) = input.get_mut(MANIFEST)
        && let Ok(mut manifest) = serde_json::from_slice::<Value>(bytes)
        && manifest.is_object()
    {
        edit(&mut manifest);
        *bytes = serde_json::to_vec_pretty(&manifest).unwrap_or_default();
    }
}

/// Brings sizes and digests of listed files up to date, so that the damage lies behind them.
fn seal(input: &mut Input) {
    let facts: Vec<(String, usize, String)> = input
        .0
        .iter()
        .filter_map(|(name, content)| match content {
            Content::Bytes(bytes) => Some((name.clone(), bytes.len(), sha256_hex(bytes))),
            _ => None,
        })
        .collect();
    edit(input, |manifest| {
        let Some(files) = manifest.get_mut("files").and_then(Value::as_array_mut) else {
            return;
        };
        for file in files.iter_mut().filter(|file| file.is_object()) {
            let known = facts.iter().find(|(name, ..)| file["path"] == **name);
            if let Some((_, size, digest)) = known {
                file["bytes"] = json!(size);
                file["sha256"] = json!(digest);
            }
        }
    });
}

pub fn seeds() -> Vec<Input> {
    let samples = [
        sample(false, [4, 4, 4]).with_pull(),
        sample(true, [4, 3, 4]),
        sample(false, [3, 2, 1]).without_rendering(),
    ];
    let samples = samples.map(|sample| packed(&of_design(sample)).expect("a sample"));
    let honest = [false, true].map(|tilted| honest(tilted).files.clone());
    samples.into_iter().chain(honest).collect()
}

/// The sample with numbers at the ends, the same wherever they are written.
fn extremes(random: &mut Random) -> Option<Input> {
    let (mut sample, design) = of_design(sample(random.below(2) == 0, [4, 3, 4]));
    if random.below(2) == 0 {
        sample = sample.with_pull();
    }
    for _ in 0..=random.below(3) {
        let (value, at) = (extreme(random), random.below(4));
        let runtime = &mut sample.map.runtime;
        let rendering = runtime.rendering.as_mut()?;
        match random.below(12) {
            0 => {
                runtime.resistance_ohm[at] = value;
                sample.manifest.resistance_ohm[at] = value;
            }
            1 => {
                runtime.current_max_a[at] = value;
                sample.manifest.limits.current_max_a[at] = value;
            }
            2 => {
                runtime.current_min_a[at] = value;
                sample.manifest.limits.current_min_a[at] = value;
            }
            3 => {
                runtime.moment_a_m2[at % 3] = value;
                sample.manifest.magnet.moment_a_m2[at % 3] = value;
            }
            4 => {
                runtime.lambda_n_per_m = Some(value);
                sample.manifest.lambda.lambda_n_per_m = Some(value);
                sample.lambda.lambda_n_per_m = Some(value);
            }
            5 => {
                runtime.total_current_max_a = Some(value);
                sample.manifest.limits.total_current_max_a = Some(value);
            }
            6 => {
                let circuit = sample.manifest.circuit.as_mut()?;
                let other = random.below(4);
                circuit.inductance_h[at][other] = value;
                if random.below(2) == 0 {
                    circuit.inductance_h[other][at] = value;
                }
                rendering.inductance_h = circuit.inductance_h.concat();
            }
            7 => {
                rendering.voltage_v = Some(value);
                sample.manifest.circuit.as_mut()?.voltage_v = Some(value);
            }
            8 => {
                let number = random.below(sample.points.len());
                sample.points[number].height_m = value;
                rendering.heights = fluxform::bundle::rendering::HeightGrid::of_points(
                    &sample.manifest.points,
                    &sample.points,
                )?;
            }
            9 => {
                let gz = sample.map.gz_t_per_m_per_a.to_mut();
                let number = random.below(gz.len());
                gz[number] = value;
            }
            10 => {
                let nodes = sample.map.x_m.to_mut();
                let last = nodes.len() - 1;
                nodes[last] = value;
                sample.manifest.map.x_m.to_m = value;
            }
            _ => {
                sample.currents[at].current_a = value;
                rendering.static_current_a[at] = value;
                if let Some(currents) = &mut sample.lambda.currents_a {
                    currents[at] = value;
                }
            }
        }
    }
    packed(&(sample, design))
}

/// The arrays of a map, damaged and packed again.
fn damage_map(bytes: &mut Vec<u8>, random: &mut Random) {
    let Ok(mut archive) = ZipArchive::new(Cursor::new(bytes.as_slice())) else {
        return damage_text(bytes, random);
    };
    let mut parts: Vec<(String, Vec<u8>)> = Vec::new();
    for k in 0..archive.len() {
        let mut content = Vec::new();
        if let Ok(mut part) = archive.by_index(k)
            && part.read_to_end(&mut content).is_ok()
        {
            let name = part.name().map_or_else(|_| "?".into(), |n| n.into_owned());
            parts.push((name, content));
        }
    }
    drop(archive);
    if parts.is_empty() {
        return;
    }
    let at = random.below(parts.len());
    let other = random.below(parts.len());
    match random.below(12) {
        0 => {
            parts.remove(at);
        }
        1 => {
            let content = parts[other].1.clone();
            parts[at].1 = content;
        }
        2 => {
            let names = [
                "../x_m.npy",
                "/etc/passwd",
                "x_m.npy",
                "X_M.npy",
                "a\u{0}.npy",
                "",
            ];
            parts[at].0 = names[random.below(names.len())].to_owned();
        }
        3 => damage_text(&mut parts[at].1, random),
        4 | 5 => {
            // Another shape is reported.
            let header = parts[at].1.len().min(128);
            let text = String::from_utf8_lossy(&parts[at].1[10.min(header)..header]).into_owned();
            let shapes = [
                "(4294967296, 4294967296)",
                "(0,)",
                "()",
                "(18446744073709551616,)",
                "(-1,)",
                "(9223372036854775807,)",
                "(1, 1, 1, 1, 1, 1, 1, 1)",
                "(0, 1152921504606846976)",
            ];
            if let (Some(from), Some(to)) = (text.find('('), text.rfind(')')) {
                let new = format!("{}{}", &text[..from], shapes[random.below(shapes.len())]);
                let mut new = format!("{new}{}", &text[to + 1..]).into_bytes();
                new.resize(header.saturating_sub(10), b' ');
                parts[at].1[10..header].copy_from_slice(&new);
            }
        }
        _ => {
            let content = &mut parts[at].1;
            let elements = content.len().saturating_sub(128) / 8;
            for _ in 0..random.below(3) + usize::from(elements > 0) {
                let place = 128 + 8 * random.below(elements.max(1));
                let value = match random.below(8) {
                    0 => f64::NAN,
                    1 => f64::INFINITY,
                    2 => f64::from_bits(random.bits()),
                    _ => extreme(random),
                };
                if let Some(slot) = content.get_mut(place..place + 8) {
                    slot.copy_from_slice(&value.to_le_bytes());
                }
            }
        }
    }
    let method = match random.below(12) {
        0 => CompressionMethod::Deflated,
        _ => CompressionMethod::Stored,
    };
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    for (name, content) in parts {
        if zip.start_file(name, options).is_ok() {
            let _ = zip.write_all(&content);
        }
    }
    if let Ok(packed) = zip.finish() {
        *bytes = packed.into_inner();
    }
}

pub fn mutate(input: &mut Input, random: &mut Random) {
    if random.below(4) == 0
        && let Some(other) = extremes(random)
    {
        *input = other;
        if random.below(3) > 0 {
            return;
        }
    }
    for _ in 0..=random.below(2) {
        let names = [
            MANIFEST,
            MANIFEST,
            MAP,
            MAP,
            "points.csv",
            "currents.csv",
            "lambda.json",
        ];
        let name = names[random.below(names.len())];
        match input.get_mut(name) {
            Some(bytes) if name == MAP && random.below(4) > 0 => damage_map(bytes, random),
            Some(bytes) if name.ends_with("json") => damage_json(bytes, random),
            Some(bytes) => damage_text(bytes, random),
            None => {}
        }
    }
    if random.below(8) > 0 {
        seal(input);
    }
}

/// A seed, edited and sealed.
fn with(what: &str, change: impl FnOnce(&mut Input)) -> (String, Input) {
    let mut input = seeds().remove(0);
    change(&mut input);
    seal(&mut input);
    (what.to_owned(), input)
}

pub fn hostile() -> Vec<(String, Input)> {
    let bytes = |input: &Input, name: &str| input.get(name).unwrap_or_default().to_vec();
    let listed = |input: &mut Input, path: &str, size: u64| {
        let entry = json!({ "path": path, "bytes": size, "sha256": sha256_hex(b"") });
        edit(input, |m| {
            if let Some(files) = m["files"].as_array_mut() {
                files.push(entry);
            }
        });
    };
    let mut found = vec![
        with(
            "no points and a grid of no rows but many columns",
            |input| {
                // Broke: the axis without nodes left the other one unbounded, which was allocated.
                input.put(
                    "points.csv",
                    Content::Bytes(b"x_m,y_m,height_m,normal_x,normal_y,normal_z\n".to_vec()),
                );
                edit(input, |m| {
                    m["points"]["count"] = json!(0);
                    m["points"]["present"] = json!([]);
                    m["points"]["y_m"]["samples"] = json!(0);
                    m["points"]["x_m"]["samples"] = json!(1_u64 << 60);
                });
            },
        ),
        with("inductances in rows of unlike lengths", |input| {
            edit(input, |m| {
                let rows = m["circuit"]["inductance_h"]
                    .as_array()
                    .cloned()
                    .unwrap_or_default();
                let all: Vec<Value> = rows
                    .iter()
                    .flat_map(|r| r.as_array().cloned().unwrap_or_default())
                    .collect();
                m["circuit"]["inductance_h"] = json!([all, [], [], []]);
            });
        }),
        with("a name that commands the terminal", |input| {
            edit(input, |m| m["design"] = json!("\u{1b}]0;owned\u{7}"));
        }),
        with("inputs that never end", |input| {
            // Broke: `verify` read them whole to see whether they had changed.
            let entry = json!({ "path": "/dev/zero", "sha256": sha256_hex(b"") });
            edit(input, |m| m["inputs"] = json!(vec![entry; 1000]));
        }),
        with("a design that is not listed", |input| {
            // Broke: `verify` read it all the same, unchecked, wherever it led.
            edit(input, |m| {
                if let Some(files) = m["files"].as_array_mut() {
                    files.retain(|file| file["path"] != "design.toml");
                }
            });
            input.put("design.toml", Content::Link("/dev/zero".into()));
        }),
        with("many files of no bytes", |input| {
            for k in 0..2000 {
                input.put(&format!("plots/{k}.svg"), Content::Bytes(Vec::new()));
            }
            list(input);
        }),
        with("one file listed twice", |input| {
            let size = bytes(input, MAP).len() as u64;
            listed(input, MAP, size);
        }),
        with("a name as long as a book", |input| {
            // Broke: the refusal was as long.
            listed(input, &"{a=".repeat(20_000), 0);
        }),
        with("errors beyond the numbers", |input| {
            // Broke: a replay's error, their product with the forces, was no number.
            edit(input, |m| {
                m["map"]["interpolation"]["largest_error"] = json!(1e308);
                m["accuracy"]["map"]["estimate"] = json!(1.7e308);
            });
        }),
        with("deep brackets", |input| {
            input.put("lambda.json", Content::Bytes(b"[".repeat(1 << 20)));
        }),
        with("a deep manifest", |input| {
            let text = b"{\"schema_version\":\"1.4.0\",\"x\":".repeat(20_000);
            input.put(MANIFEST, Content::Bytes(text));
        }),
        with("many coils in few bytes", |input| {
            edit(input, |m| {
                m["array"]["positions_m"] = json!(vec![[0, 0]; 200_000]);
                m["array"]["gain"] = json!(vec![1; 200_000]);
            });
        }),
        with("rows of no flags", |input| {
            edit(input, |m| m["points"]["present"] = json!(vec![""; 300_000]));
        }),
        with("the manifest is a pipe", |input| {
            input.put(MANIFEST, Content::Pipe)
        }),
        with("the manifest is a folder", |input| {
            input.put(MANIFEST, Content::Folder)
        }),
        with("the manifest never ends", |input| {
            input.put(MANIFEST, Content::Link("/dev/zero".into()));
        }),
        with("the map is a pipe", |input| input.put(MAP, Content::Pipe)),
        with("the map never ends", |input| {
            input.put(MAP, Content::Link("/dev/zero".into()))
        }),
        with("the map is a link within", |input| {
            let map = bytes(input, MAP);
            input.put("other.npz", Content::Bytes(map));
            input.put(MAP, Content::Link("other.npz".into()));
        }),
        with("the map is a link outside", |input| {
            input.put(MAP, Content::Link("../../../../etc/passwd".into()));
        }),
    ];
    for path in [
        "../secret",
        "/etc/hostname",
        "a/../../secret",
        "",
        ".",
        "..",
        "plots/",
        "./points.csv",
        "a//b",
        "C:\\a",
        "\\\\server\\a",
        "a\u{0}b",
        "a\nb",
        "manifest.json",
        "con:",
    ] {
        found.push(with(&format!("the path {path:?}"), |input| {
            listed(input, path, 0)
        }));
    }
    found
}

/// Whether the harness should run the slow independent check: on every hostile input, and on some.
fn verified(input: &Input) -> bool {
    input.size().is_multiple_of(16) || input.0.len() != 6
}

fn give(input: &Input, folder: &Path) -> Result<bool, String> {
    let name = folder.display().to_string();
    if verified(input) {
        match verify::run(folder, &Silent) {
            Ok(report) => drop(to_json(&report).map_err(|error| error.to_string())?),
            Err(error) => drop(refusal(&error.to_string(), "")?),
        }
    }
    let bundle = match Bundle::open(folder) {
        Err(error) => return refusal(&error.to_string(), &name),
        Ok(bundle) => bundle,
    };
    finite(&format!("{:?}", bundle.map))?;
    let opened = match Opened::new(folder) {
        Err(error) => return refusal(&error.to_string(), &name),
        Ok(opened) => opened,
    };
    let map = &bundle.map;
    let middle = |nodes: &[f64]| 0.3 * nodes[0] + 0.7 * nodes[nodes.len() - 1];
    let last = |nodes: &[f64]| nodes[nodes.len() - 1];
    let trajectory = Trajectory {
        t_s: vec![0.0, 0.02, 0.02, 1.0],
        position_m: vec![
            [middle(&map.x_m), middle(&map.y_m), middle(&map.z_m)],
            [map.x_m[0], map.y_m[0], map.z_m[0]],
            [last(&map.x_m), last(&map.y_m), last(&map.z_m)],
            [1.0, 1e300, -1.0],
        ],
        ..Trajectory::default()
    };
    for dynamics in [false, true] {
        let report_text = TrajectorySource {
            source: "made up".into(),
            input: None,
            synthesis: None,
        };
        let report = match replay::run(&opened, &trajectory, report_text, dynamics, &Silent) {
            Err(error) => {
                refusal(&error.to_string(), "")?;
                continue;
            }
            Ok(report) => report,
        };
        report
            .rows
            .write(&mut std::io::sink())
            .map_err(|error| format!("a replay that cannot be written: {error}"))?;
        to_json(&report.summary).map_err(|error| format!("a summary: {error}"))?;
    }
    Ok(true)
}
