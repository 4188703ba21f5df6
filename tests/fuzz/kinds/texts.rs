//! Documents and tables: designs, shapes, magnetisation curves, points, trajectories.

use std::path::Path;

use fluxform::bundle::json::to_json;
use fluxform::bundle::read_table::read_positions;
use fluxform::bundle::trajectory::Trajectory;
use fluxform::commands::{discretize, evaluate};
use fluxform::design::bh_table::read_bh_table;
use fluxform::design::{Design, InvalidDocument, Need};
use fluxform::field::steel::bh_curve::BhCurve;
use fluxform::progress::Silent;
use fluxform::shape::document::{AxisRequest, ShapeDocument, SurfaceSource};

use super::{finite, limits, refusal};
use crate::harness::{Content, Input, Kind};
use crate::structure::damage_text;
use fluxform_testing::{Random, root};

pub fn kinds() -> Vec<Kind> {
    let kind = |name, bytes_per_byte, seeds, hostile, mutate, give| Kind {
        name,
        limits: limits(bytes_per_byte, 32.0),
        seeds,
        hostile,
        mutate,
        give,
    };
    vec![
        kind("design", 256.0, designs, hostile_designs, mutate, design),
        kind("shape", 256.0, shapes, hostile_shapes, mutate, shape),
        kind(
            "curve",
            64.0,
            curves,
            || hostile_tables("b_t,h_a_per_m"),
            mutate,
            curve,
        ),
        kind(
            "points",
            64.0,
            points,
            || hostile_tables("x_m,y_m,z_m"),
            mutate,
            positions,
        ),
        kind(
            "trajectory",
            64.0,
            trajectories,
            || hostile_tables("t_s,x_m,y_m,z_m"),
            mutate,
            trajectory,
        ),
    ]
}

/// The file of every input here.
const FILE: &str = "input";

fn text(text: &str) -> Input {
    Input::file(FILE, text.as_bytes())
}

fn read(name: &str) -> Input {
    Input::file(FILE, std::fs::read(root().join(name)).expect(name))
}

fn mutate(input: &mut Input, random: &mut Random) {
    if let Some(bytes) = input.get_mut(FILE) {
        for _ in 0..=random.below(3) {
            damage_text(bytes, random);
        }
    }
}

fn named(name: &str, content: impl Into<Vec<u8>>) -> (String, Input) {
    (name.to_owned(), Input::file(FILE, content))
}

/// Texts that are hard on readers.
fn hostile_texts(head: &str) -> Vec<(String, Input)> {
    let with = |tail: String| format!("{head}{tail}");
    let mut found = vec![
        named("nothing", ""),
        named("only a mark", "\u{feff}"),
        named("zeros", vec![0; 1 << 18]),
        named("no text", vec![0xff; 1 << 18]),
        named("blank lines", "\n".repeat(1 << 18)),
        named("carriage returns", "\r".repeat(1 << 18)),
        named("one long line", with("a".repeat(1 << 18))),
        named("quotes", with("\"".repeat(1 << 18))),
        named(
            "one open quote",
            with(format!("\"{}", "\n".repeat(1 << 18))),
        ),
        named("commas", with(",".repeat(1 << 18))),
        named("accents", with("\u{301}".repeat(1 << 16))),
    ];
    found.push((
        "a folder".to_owned(),
        Input(vec![(FILE.into(), Content::Folder)]),
    ));
    found
}

fn hostile_tables(head: &str) -> Vec<(String, Input)> {
    let columns = head.split(',').count();
    let row = |cell: &str| format!("{}\n", vec![cell; columns].join(","));
    let with = |rows: String| format!("{head}\n{rows}");
    let mut found = hostile_texts(&format!("{head}\n"));
    found.extend([
        named("many rows", with(row("1").repeat(50_000))),
        named("many faults", with(row("x").repeat(50_000))),
        named("many short rows", with("1\n".repeat(50_000))),
        named("a long cell", with(row(&"9".repeat(50_000)))),
        named("a wide row", with(format!("{}\n", "1,".repeat(50_000)))),
        named("many columns", format!("{}{head}\n", "a,".repeat(50_000))),
        named(
            "far blank lines",
            with(format!("{}{}", "\n".repeat(1 << 18), row("x"))),
        ),
        named(
            "the ends of numbers",
            with(format!("{}{}", row("-1e308"), row("1e308"))),
        ),
    ]);
    found
}

fn deep() -> Vec<(String, String)> {
    let mut found: Vec<(String, String)> = Vec::new();
    for (open, close) in [("[", "]"), ("{a=", "}"), ("[[", "]]")] {
        for times in [100, 100_000] {
            let text = format!("a = {}1{}\n", open.repeat(times), close.repeat(times));
            found.push((format!("{times} times {open}"), text));
        }
    }
    let keys = |n: usize| vec!["a"; n].join(".");
    found.push((
        "a key of many dots".into(),
        format!("{} = 1\n", keys(50_000)),
    ));
    found.push((
        "a section of many dots".into(),
        format!("[{}]\n", keys(50_000)),
    ));
    let all = |each: fn(usize) -> String| (0..30_000).map(each).collect::<String>();
    found.push(("many keys".into(), all(|k| format!("k{k} = 1\n"))));
    found.push(("many sections".into(), all(|k| format!("[s{k}]\n"))));
    found.push(("the same key".into(), "a = 1\n".repeat(30_000)));
    found.push(("the same section".into(), "[coil]\n".repeat(30_000)));
    found.push(("tables in lists".into(), "[[a]]\n".repeat(30_000)));
    found
}

fn designs() -> Vec<Input> {
    let two = "name = \"a\"\n[coil]\ninner_diameter_mm = 10\nouter_diameter_mm = 13\n\
               length_mm = 20\n[wire]\ndiameter_mm = 0.7\n[array]\npositions_mm = [[0, 0], [30, 7]]\n\
               [workspace]\nx_mm = [-10, 10, 3]\ny_mm = [-10, 10, 3]\nz_mm = [10, 20, 2]\n";
    vec![
        read("tests/fixtures/design/every_key.toml"),
        read("designs/seed_air.toml"),
        text(two),
    ]
}

fn hostile_designs() -> Vec<(String, Input)> {
    let seed = designs()[1]
        .get(FILE)
        .map(<[u8]>::to_vec)
        .unwrap_or_default();
    let seed = String::from_utf8(seed).expect("a text");
    let mut found = hostile_texts(&seed);
    for (what, more) in deep() {
        found.push(named(&what, more.clone()));
        found.push(named(
            &format!("{what}, in a design"),
            format!("{more}{seed}"),
        ));
    }
    let numbers = |n: usize| vec!["1.0"; n].join(",");
    for (what, from, to) in [
        ("too many rows", "rows = 3", "rows = 1000000000".to_owned()),
        ("ten thousand coils", "rows = 3", "rows = 3333".to_owned()),
        (
            "many gains",
            "rows = 3",
            format!("rows = 3\ngain = [{}]", numbers(200_000)),
        ),
        ("many samples", "61]", "1000000000000]".to_owned()),
        ("a tiny coil", "24.0", "1e-300".to_owned()),
        ("a huge coil", "38.0", "1e300".to_owned()),
        // Broke: what was computed of these was not a finite number, and so could not be reported.
        (
            "the thinnest wire",
            "diameter_mm = 0.7",
            "diameter_mm = 1e-200".to_owned(),
        ),
        ("the largest magnet", "1.1579e6", "1e300".to_owned()),
        (
            "the farthest target",
            "height_mm = 30.0",
            "height_mm = 1e300".to_owned(),
        ),
        ("many turns", "1429", "9223372036854775807".to_owned()),
        (
            "a curve that is a device",
            "[array]",
            "[core]\nbh_curve = \"/dev/zero\"\n[array]".to_owned(),
        ),
    ] {
        found.push(named(what, seed.replace(from, &to)));
    }
    found
}

fn shapes() -> Vec<Input> {
    let file = "name = \"half\"\nsurface = \"h.stl\"\nunit = \"mm\"\nscale = 1\ntranslate_mm = [0, 0, 30]\n\
                rotate_deg = [0, 0, 7]\n[points]\nx_mm = [-50, 50, 7]\ny_mm = [-50, 50, 9]\n\
                outside = \"skip\"\n";
    let mut seeds: Vec<Input> = ["flat", "half_sphere", "half_cylinder", "wedge"]
        .map(|name| {
            let mut input = read(&format!("shapes/primitives/{name}.toml"));
            let bytes = input.get_mut(FILE).expect("a file");
            *bytes = String::from_utf8_lossy(bytes)
                .replace("61]", "9]")
                .into_bytes();
            input
        })
        .into();
    seeds.push(text(&file.replace("scale = 1\n", "")));
    seeds
}

fn hostile_shapes() -> Vec<(String, Input)> {
    let seed = shapes()[0]
        .get(FILE)
        .map(<[u8]>::to_vec)
        .unwrap_or_default();
    let seed = String::from_utf8(seed).expect("a text");
    let mut found = hostile_texts(&seed);
    for (what, more) in deep() {
        found.push(named(
            &format!("{what}, in a shape"),
            format!("{more}{seed}"),
        ));
    }
    for surface in [
        "/dev/zero",
        "/dev/stdin",
        "..",
        "/",
        "\\u0000",
        "a.stl/../../b.stl",
    ] {
        let text = format!("name = \"a\"\nsurface = \"{surface}\"\nunit = \"mm\"\n");
        found.push(named(&format!("the surface {surface}"), text));
    }
    found.push(named("many samples", seed.replace("9]", "1000000000000]")));
    found
}

fn curves() -> Vec<Input> {
    vec![
        read("designs/steel_1010.csv"),
        text("\u{feff}h_a_per_m, b_t\r\n0,0\r\n\r\n 100 ,0.7\r\n\"300\",1.3\r\n"),
    ]
}

fn points() -> Vec<Input> {
    vec![
        text("x_m,y_m,z_m\n0.01,-0.02,0.03\n0,0,0.05\n1e-5,0.7,1.3\n"),
        text("\u{feff}label, z_m ,x_m,y_m\r\n\"a, b\", 0.03 ,0.01,-0.02\r\n\r\nc,1,2,3\r\n"),
    ]
}

fn trajectories() -> Vec<Input> {
    vec![
        text("t_s,x_m,y_m,z_m\n0,0.01,-0.02,0.05\n0.02,0,0,0.05\n0.04,0.01,0.01,0.06\n"),
        text("note,t_s,x_m,y_m,z_m\na,0.7,0.01,-0.02,0.05\n\nb,0.7,0,0,0.06\nc,1.3,0.1,0.2,0.3\n"),
    ]
}

fn refused(invalid: &InvalidDocument) -> Result<bool, String> {
    let faults = &invalid.faults;
    if !faults.has_errors() {
        return Err("refused without an error".to_owned());
    }
    // Text for a terminal.
    if faults.render(true, 60).is_empty() {
        return Err("a refusal without words".to_owned());
    }
    refusal(&invalid.to_string(), FILE)
}

fn design(_: &Input, folder: &Path) -> Result<bool, String> {
    let path = folder.join(FILE);
    let mut read = false;
    for need in [Need::CALIBRATE, Need::OPTIMIZE, Need::SWEEP, Need::EVALUATE] {
        let design = match Design::read(&path, need) {
            Err(invalid) => {
                refused(&invalid)?;
                continue;
            }
            Ok((design, _)) => design,
        };
        read = true;
        finite(&format!("{design:?}"))?;
        let coils = design.array.positions_m.len();
        if need == Need::EVALUATE && design.core.is_none() && coils <= 9 {
            match evaluate::evaluate(&design, Vec::new(), None) {
                Ok(found) => drop(to_json(&found).map_err(|error| error.to_string())?),
                Err(error) if error.to_string().is_empty() => return Err("no words".into()),
                Err(_) => {}
            }
        }
    }
    Ok(read)
}

fn shape(_: &Input, folder: &Path) -> Result<bool, String> {
    let document = match ShapeDocument::read(&folder.join(FILE)) {
        Err(invalid) => return refused(&invalid),
        Ok((document, _)) => document,
    };
    finite(&format!("{document:?}"))?;
    let samples = |axis: AxisRequest| match axis {
        AxisRequest::Given(axis) => axis.samples,
        AxisRequest::Extent(samples) => samples,
    };
    let few = samples(document.grid.x).saturating_mul(samples(document.grid.y)) <= 10_000;
    if matches!(document.source, SurfaceSource::Primitive(_)) && !few {
        return Ok(true);
    }
    if let Ok(report) = discretize::run(&document, Vec::new(), &Silent) {
        report
            .write_csv(&mut std::io::sink())
            .map_err(|error| format!("points that cannot be written: {error}"))?;
    }
    Ok(true)
}

fn curve(_: &Input, folder: &Path) -> Result<bool, String> {
    let table = match read_bh_table(&folder.join(FILE)) {
        Err(invalid) => return refused(&invalid),
        Ok(table) => table,
    };
    if let Ok(curve) = BhCurve::new(&table.b_t, &table.h_a_per_m) {
        finite(&format!("{curve:?}"))?;
        // A curve that starts level is reported with a warning; its permeability there is infinite.
        let numbers = [curve.knee_t(), curve.relative_permeability(0.7)];
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(format!("a curve with {numbers:?}"));
        }
    }
    Ok(true)
}

fn bytes(input: &Input) -> Option<&[u8]> {
    input.get(FILE)
}

fn positions(input: &Input, _: &Path) -> Result<bool, String> {
    match read_positions(FILE, bytes(input).unwrap_or_default()) {
        Err(error) => refusal(&error.to_string(), FILE),
        Ok(points) => finite(&format!("{points:?}")).map(|()| true),
    }
}

fn trajectory(input: &Input, _: &Path) -> Result<bool, String> {
    match Trajectory::read(FILE, bytes(input).unwrap_or_default()) {
        Err(error) => refusal(&error.to_string(), FILE),
        Ok(found) => {
            finite(&format!("{found:?}"))?;
            finite(&format!("{:?}", found.held_s()))?;
            found
                .write(&mut std::io::sink())
                .map_err(|error| error.to_string())?;
            Ok(true)
        }
    }
}
