//! The readers of OBJ, PLY, 3MF, AMF, 3DXML and native parts, on files made here.

use std::path::Path;

use fluxform_base::progress::Silent;
use fluxform_shape::document::{
    AxisRequest, GridRequest, ShapeDocument, SurfaceFormat, SurfaceSource,
};
use fluxform_shape::file_mesh::FileMesh;
use fluxform_shape::{MeshReport, discretize};

use fluxform_testing::surface_files::{
    amf, amf_parts, obj, ply_ascii, ply_binary, sldprt, three_dxml, three_mf, three_mf_of, zipped,
};
use fluxform_testing::surfaces::{file, lifted};

/// The tetrahedron that every sample holds: its volume and the upper corner of its box.
const VOLUME: f64 = 0.7 * 1.3 * 2.9 / 6.0;
const CORNER: [f64; 3] = [0.7, 1.3, 2.9];

pub fn read(format: SurfaceFormat, bytes: &[u8]) -> Result<FileMesh, String> {
    let read = format.read(Path::new("f"), bytes);
    read.map_err(|error| error.to_string())
}

pub fn refusal(format: SurfaceFormat, bytes: &[u8]) -> String {
    read(format, bytes).unwrap_err()
}

#[test]
fn every_format_gives_the_same_body() {
    use SurfaceFormat::{Amf, Obj, Ply, Sldprt, ThreeDxml, ThreeMf};
    let samples: [(SurfaceFormat, Vec<u8>, Option<f64>); 9] = [
        (Obj, obj(), None),
        (Ply, ply_ascii(), None),
        (Ply, ply_binary(false), None),
        (Ply, ply_binary(true), None),
        (ThreeMf, three_mf("inch"), Some(0.0254)),
        (Amf, amf("Inch").into_bytes(), Some(0.0254)),
        (Amf, zipped(&[("a.AMF", &amf("meter"))]), Some(1.0)),
        (ThreeDxml, three_dxml(), Some(1e-3)),
        (Sldprt, sldprt(), Some(1.0)),
    ];
    for (format, bytes, unit_m) in samples {
        let report = MeshReport::new(format, read(format, &bytes).unwrap());
        assert_eq!((report.triangles, report.unit_m), (4, unit_m), "{format:?}");
        assert!(
            report.watertight && report.inconsistent_edges == 0,
            "{report:?}"
        );
        assert!((report.volume.unwrap() - VOLUME).abs() < 1e-6, "{report:?}");
        for (k, corner) in CORNER.iter().enumerate() {
            assert!(report.bounds_min[k].abs() < 1e-7, "{report:?}");
            assert!((report.bounds_max[k] - corner).abs() < 1e-6, "{report:?}");
        }
        assert!(report.coordinate_rounding > 0.0 && report.coordinate_rounding < 1e-6);
    }
}

#[test]
fn the_files_unit_is_used_and_another_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("body.3mf");
    // This is a test's own file.
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&path, three_mf("inch")).unwrap();
    let grid = GridRequest {
        x: AxisRequest::Extent(3),
        y: AxisRequest::Extent(3),
    };
    let mut document = file(&path, 0.0254, lifted(0.001), grid);
    let given = discretize(&document, &Silent).unwrap();
    assert!((given.bounds.max_m[0] - 0.7 * 0.0254).abs() < 1e-12);
    let mut with_unit = |unit_m| {
        document.source = SurfaceSource::File {
            path: path.clone(),
            unit_m,
        };
        discretize(&document, &Silent)
    };
    assert_eq!(with_unit(None).unwrap(), given);
    let said = with_unit(Some(1e-3)).unwrap_err().to_string();
    assert!(
        said.contains("the file is in in, as it says or its format has it, but `unit` says mm"),
        "{said}"
    );
}

#[test]
fn obj_faults_have_their_line() {
    let body = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    let cases = [
        (
            "f 1 2 4\n",
            "line 4: a face has the index 4, but the file has 3 vertices",
        ),
        ("f 1 2 0\n", "line 4: a face has the index 0"),
        (
            "f 1 2 -4\n",
            "line 4: a face has the index -4, but only 3 vertices",
        ),
        (
            "f 1 2\n",
            "line 4: a face of 2 corners, expected three or more",
        ),
        ("f 1 2 x/3\n", "line 4: expected an index, found `x/3`"),
        ("f 1 2 99999999999999999999\n", "expected an index"),
        ("f 1 2 9223372036854775807\n", "9223372036854775807"),
        ("f 1 2 -9223372036854775808\n", "-9223372036854775808"),
        (
            "v 1 2\n",
            "line 4: a vertex has fewer than three coordinates",
        ),
        ("v 1 2 nan\n", "line 4: a coordinate is `nan`"),
        (
            "v 1 2 1e999\n",
            "line 4: the coordinate `1e999` is too large",
        ),
        ("v 1,5 2 3\n", "decimal point"),
        ("", "3 vertices and no face"),
        ("surf 0 1 0 1 1 2 3\n", "free-form"),
    ];
    for (end, said) in cases {
        let message = refusal(SurfaceFormat::Obj, format!("{body}{end}").as_bytes());
        assert!(message.contains(said), "{end}: {message}");
    }
    assert!(refusal(SurfaceFormat::Obj, b"\x00\x01 some").contains("not an OBJ file"));
    assert!(refusal(SurfaceFormat::Obj, b"").contains("0 bytes"));
}

#[test]
fn obj_is_read_however_it_is_written() {
    let expected = [[[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.0, 0.25]]];
    for text in [
        &b"v 0 0 0\nv 1.5 0 0\nv 0 1 .25\nf 1 2 3"[..],
        b"\xef\xbb\xbf# t\xeate\r\nv 0 0 0 1.0\r\nv 15e-1 0 0\r\nv 0 1 2.5e-001\r\nf 1/1 2//7 3/4/5\r\n",
        b"mtllib \xff.mtl\no t\xeate\nv 0 0 0\nv 1.5 0 0\nv 0 1 0.25\nf -3 -2 -1 # end\n",
        b"f 1 2 \\\n 3\nv 0 0 0\nv 1.5 \\\n0 0\rv 0 1 0.25",
        // A comment does not go on, whatever it ends with.
        b"# made in C: \\\nv 0 0 0\nv 1.5 0 0 # a \\\nv 0 1 0.25\nf 1 2 3\n",
    ] {
        let mesh = read(SurfaceFormat::Obj, text).unwrap();
        assert_eq!(mesh.triangles, expected, "{}", text.escape_ascii());
    }
    // A notched face is not filled.
    let notched = b"v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\n";
    let report = MeshReport::new(
        SurfaceFormat::Obj,
        read(SurfaceFormat::Obj, notched).unwrap(),
    );
    assert_eq!((report.triangles, report.area), (3, 10.0));
    assert!(!report.watertight && report.open_edges == 5);
}

#[test]
fn a_ply_header_is_held_against_the_file() {
    let header = |vertices: &str, format: &str| {
        format!(
            "ply\nformat {format} 1.0\ncomment t\u{ea}te\nelement vertex {vertices}\n\
             property float x\nproperty float y\nproperty float z\nelement face 1\n\
             property list uchar int vertex_indices\nend_header\n"
        )
    };
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for count in ["1000000000000", "18446744073709551615", "100"] {
            let message = refusal(SurfaceFormat::Ply, header(count, format).as_bytes());
            assert!(
                message.contains("was cut short or its header is wrong"),
                "{message}"
            );
        }
    }
    let text = |face: &str, z: &str| {
        format!("{}0 0 0\n1 0 0\n0 1 {z}\n{face}\n", header("3", "ascii")).into_bytes()
    };
    assert_eq!(
        read(SurfaceFormat::Ply, &text("3 0 1 2", "1"))
            .unwrap()
            .triangles
            .len(),
        1
    );
    for (face, z, said) in [
        (
            "3 0 1 3",
            "1",
            "face 0 (from 0) has the index 3, but the file has 3 vertices",
        ),
        ("3 0 1 -1", "1", "has the index -1"),
        ("2 0 1", "1", "no face of the PLY file has three corners"),
        ("3 0 1 2", "nan", "line 13"),
        ("3 0 1 2", "x", "line 13: expected a number, found `x`"),
        (
            "99 0 1 2",
            "1",
            "line 14: an element `face` has too few numbers",
        ),
        ("", "1", "ends before its last element `face`"),
    ] {
        let message = refusal(SurfaceFormat::Ply, &text(face, z));
        assert!(message.contains(said), "{face} {z}: {message}");
    }
    let mut binary = ply_binary(false);
    let third = binary.len() - 4 * 13 - 2 * 13;
    binary[third..third + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(refusal(SurfaceFormat::Ply, &binary).contains("vertex 2 (from 0)"));
    assert!(refusal(SurfaceFormat::Ply, b"plx").contains("begins with `plx`"));
    let empty = "ply\nformat binary_little_endian 1.0\nelement nothing 9999999999\n\
                 element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    assert!(refusal(SurfaceFormat::Ply, empty.as_bytes()).contains("has no property"));
}

#[test]
fn three_mf_faults_have_part_and_line() {
    let good = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    for (from, to, said) in [
        (
            "v1=\"0\"",
            "v1=\"4\"",
            "line 9: a triangle has the index 4, but its object has 4",
        ),
        (
            "v1=\"0\"",
            "v1=\"-1\"",
            "expected a whole number as `v1`, found `-1`",
        ),
        ("x=\"0.7\"", "x=\"0,7\"", "decimal point"),
        ("x=\"0.7\"", "x=\"NaN\"", "not a finite number"),
        ("x=\"0.7\"", "q=\"0.7\"", "a vertex has no `x`"),
        ("unit=\"inch\"", "unit=\"ell\"", "the unit `ell` is unknown"),
        (
            "<item objectid=\"2\"",
            "<item objectid=\"7\"",
            "places object 7",
        ),
        (
            "<item objectid=\"2\"",
            "<jtem objectid=\"2\"",
            "builds nothing",
        ),
        (
            "<component objectid=\"1\"",
            "<component objectid=\"2\"",
            "within itself",
        ),
        ("1 0 0 0 1 0 0 0 1 0 0 0", "1 0 0", "twelve finite numbers"),
        ("</model>", "", "cut short"),
        ("</vertices>", "</corners>", "damaged"),
        (
            "<model ",
            "<model xmlns:q=\"http://x/secure/\" requiredextensions=\"q\" ",
            "extension `q`",
        ),
    ] {
        assert!(good.contains(from), "{from}");
        let message = refusal(
            SurfaceFormat::ThreeMf,
            &three_mf_of(&good.replace(from, to)),
        );
        assert!(message.contains(said), "{from} {to}: {message}");
    }
    let bytes = three_mf("inch");
    for length in [1, 30, bytes.len() / 2, bytes.len() - 1] {
        refusal(SurfaceFormat::ThreeMf, &bytes[..length]);
    }
    let message = refusal(SurfaceFormat::ThreeMf, &zipped(&[("a.txt", "text")]));
    assert!(
        message.contains("`3D/3dmodel.model` is missing"),
        "{message}"
    );
}

#[test]
fn amf_constellations_place_their_objects() {
    let [start, end] = amf_parts("inch");
    let placed = format!(
        "{start}<constellation id=\"9\">\
         <instance objectid=\"1\"><deltax>5</deltax><rz>90</rz></instance>\
         <instance objectid=\"1\"><deltaz>-2.5</deltaz></instance></constellation>{end}"
    );
    let mesh = read(SurfaceFormat::Amf, placed.as_bytes()).unwrap();
    let report = MeshReport::new(SurfaceFormat::Amf, mesh);
    assert_eq!(report.triangles, 8);
    assert_eq!(report.bounds_min, [0.0, 0.0, -2.5]);
    assert_eq!(report.bounds_max, [5.0, 1.3, 2.9]);
    let lost = placed.replace("objectid=\"1\"", "objectid=\"3\"");
    assert!(refusal(SurfaceFormat::Amf, lost.as_bytes()).contains("places `3`"));
    let wrong = amf("inch").replace("<v1>0</v1>", "<v1>4</v1>");
    assert!(refusal(SurfaceFormat::Amf, wrong.as_bytes()).contains("index 4"));
    assert!(refusal(SurfaceFormat::Amf, b"<some></some>").contains("XML of `some`"));
    assert!(refusal(SurfaceFormat::Amf, b"\xff\xfe<\0a\0").contains("the XML"));
}

/// Constellations within each other were left out where another object stood beside them.
#[test]
fn an_amf_constellation_within_itself_is_refused() {
    let [start, end] = amf_parts("inch");
    let within = |id: u32, other: u32| {
        format!("<constellation id=\"{id}\"><instance objectid=\"{other}\"/></constellation>")
    };
    let round = format!("{start}{}{}{end}", within(8, 9), within(9, 8));
    let message = refusal(SurfaceFormat::Amf, round.as_bytes());
    assert!(message.contains("within itself"), "{message}");
}

/// They were passed over: `1&#46;5` was 15, and a unit without quotes millimetres.
#[test]
fn references_and_damaged_attributes_of_xml_are_not_passed_over() {
    let amf_with = |x: &str| amf("inch").replace("<x>0.7</x>", &format!("<x>{x}</x>"));
    for x in ["0&#46;7", "&#x30;.7", "0<!-- -->.7"] {
        let mesh = read(SurfaceFormat::Amf, amf_with(x).as_bytes()).unwrap();
        let report = MeshReport::new(SurfaceFormat::Amf, mesh);
        assert!((report.bounds_max[0] - 0.7).abs() < 1e-12, "{x}");
    }
    for x in ["0&dot;7", "0.7&nbsp;", "7&lt;"] {
        let message = refusal(SurfaceFormat::Amf, amf_with(x).as_bytes());
        assert!(message.contains("expected a number"), "{x}: {message}");
    }
    let model = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    for (from, to, said) in [
        ("unit=\"inch\"", "unit=inch", "the XML is damaged"),
        ("unit=\"inch\"", "unit=\"&in;\"", "unit `&in;` is unknown"),
        (
            "transform=\"1",
            "transform=\"&one;",
            "twelve finite numbers",
        ),
    ] {
        assert!(model.contains(from), "{from}");
        let bytes = three_mf_of(&model.replace(from, to));
        let message = refusal(SurfaceFormat::ThreeMf, &bytes);
        assert!(message.contains(said), "{to}: {message}");
    }
}

#[test]
fn two_objects_of_one_id_are_refused_in_3dxml() {
    let [manifest, structure, representation] = fluxform_testing::surface_files::three_dxml_parts();
    for (from, to) in [
        ("Rep id=\"5\"", "Rep id=\"2\""),
        ("3D id=\"2\"", "3D id=\"1\""),
    ] {
        assert!(structure.1.contains(from), "{from}");
        let structure = structure.1.replacen(from, to, 1);
        let bytes = zipped(&[
            (manifest.0, &manifest.1),
            ("P.3dxml", &structure),
            ("R.3DRep", &representation.1),
        ]);
        let message = refusal(SurfaceFormat::ThreeDxml, &bytes);
        assert!(
            message.contains("two objects have the id"),
            "{to}: {message}"
        );
    }
}

#[test]
fn a_body_in_another_document_is_refused_in_3dxml_not_taken_for_one_of_the_same_number() {
    let [manifest, structure, representation] = fluxform_testing::surface_files::three_dxml_parts();
    let product = |to: &str| {
        let from = "urn:3DXML:Reference:loc:2";
        assert!(structure.1.contains(from));
        zipped(&[
            (manifest.0, &manifest.1),
            ("P.3dxml", &structure.1.replacen(from, to, 1)),
            ("R.3DRep", &representation.1),
        ])
    };
    for to in ["urn:3DXML:other.3dxml#2", "urn:3DXML:Reference:ext:2"] {
        let message = refusal(SurfaceFormat::ThreeDxml, &product(to));
        assert!(
            message.contains(to) && message.contains("another document"),
            "{message}"
        );
    }
    let own = product("urn:3DXML:p.3dxml#2");
    let read = |bytes: &[u8]| {
        let file = SurfaceFormat::ThreeDxml.read(Path::new("p.3dxml"), bytes);
        file.unwrap().triangles
    };
    assert_eq!(read(&own), read(&three_dxml()));
}

#[test]
fn more_elements_than_are_made_at_once_are_all_read() {
    // A fan of ten thousand triangles, in both kinds of PLY and in OBJ.
    const N: usize = 10_000;
    let rim = |k: usize| {
        let turn = k as f32 * 6.0e-4;
        [turn.cos(), turn.sin(), 0.5]
    };
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
             property float z\nelement face {N}\nproperty list uchar int vertex_indices\n\
             end_header\n",
            N + 2
        )
    };
    let (mut text, mut bytes) = (header("ascii"), header("binary_little_endian").into_bytes());
    let mut obj = String::new();
    let vertices = std::iter::once([0.0, 0.0, 0.7]).chain((0..=N).map(rim));
    for [x, y, z] in vertices {
        text += &format!("{x} {y} {z}\n");
        obj += &format!("v {x} {y} {z}\n");
        bytes.extend([x, y, z].map(f32::to_le_bytes).as_flattened());
    }
    for k in 1..=N as i32 {
        text += &format!("3 0 {k} {}\n", k + 1);
        obj += &format!("f 1 {} {}\n", k + 1, k + 2);
        bytes.push(3);
        bytes.extend([0, k, k + 1].map(i32::to_le_bytes).as_flattened());
    }
    let meshes = [
        read(SurfaceFormat::Ply, text.as_bytes()).unwrap(),
        read(SurfaceFormat::Ply, &bytes).unwrap(),
        read(SurfaceFormat::Obj, obj.as_bytes()).unwrap(),
    ];
    for mesh in &meshes {
        assert_eq!(mesh.triangles.len(), N);
        let last = mesh.triangles[N - 1].map(|v| v.map(|c| c as f32));
        assert_eq!(last, [[0.0, 0.0, 0.7], rim(N - 1), rim(N)]);
    }
}

/// Files as Blender, MeshLab, CAD programs and scanners write them around the same tetrahedron.
#[test]
fn the_oddities_of_writers_change_nothing() {
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let (plain, ply) = (text(obj()), text(ply_ascii()));
    let vertex = |line: &str| line.starts_with("v ");
    let with = |change: &dyn Fn(&str) -> String| -> String {
        plain.lines().map(|line| change(line) + "\n").collect()
    };
    let objs = [
        plain.replace('\n', "\r\n"),
        plain.replace('\n', "\r"),
        format!("\u{feff}{plain}"),
        plain.replace(' ', "\t"),
        with(&|line| format!("  {line} \t ")),
        // MeshLab's colours, a weight, numbers as some printf writes them.
        with(&|line| {
            if vertex(line) {
                format!("{line} 0.5 0.25 1.0")
            } else {
                line.into()
            }
        }),
        with(&|line| {
            if vertex(line) {
                format!("{line} 1.0")
            } else {
                line.into()
            }
        }),
        plain
            .replace("1.3", "1.3E+000")
            .replace("2.9", "0.29e1")
            .replace("0.7", "+.7"),
        // Blender's and CAD programs' other lines.
        format!(
            "# Blender 4.2\nmtllib a b.mtl\no Cube.001\ng\ng a b\ns off\nusemtl None\n{plain}\
             l 1 2\np 1\nvn 0 0 1\nvt 0 0\nvp 0\ncstype bezier\n"
        ),
        plain.replace("f ", "fo "),
        plain.replace("-1", "\\\n-1"),
    ];
    let plys = [
        ply.replace('\n', "\r\n"),
        ply.replace(
            "comment made here",
            "comment VCGLIB generated\nobj_info num_cols 512",
        ),
        ply.replace("float ", "float32 ")
            .replace("uchar", "uint8")
            .replace("list uint8 int", "list uint8 int32"),
        ply.replace("vertex_indices", "vertex_index"),
        ply.replace("2.9", "2.9e+00").replace("1.3", "1.30000"),
    ];
    let samples = objs.iter().map(|text| (SurfaceFormat::Obj, text));
    for (format, text) in samples.chain(plys.iter().map(|text| (SurfaceFormat::Ply, text))) {
        let report = MeshReport::new(format, read(format, text.as_bytes()).expect(text));
        assert_eq!((report.triangles, report.watertight), (4, true), "{text}");
        assert!((report.volume.unwrap() - VOLUME).abs() < 1e-6, "{text}");
    }
    // 3MF: prefixes, another place of the model, apostrophes, numbers with exponents and blanks.
    let model = text(fluxform_testing::surface_files::three_mf_model("inch"));
    let prefixed = model
        .replace("</", "</m:")
        .replace('<', "<m:")
        .replace("<m:/m:", "</m:")
        .replace("<m:?", "<?");
    let models = [
        prefixed,
        model.replace('"', "'"),
        model.replace("2.9", " 2.9E+0 ").replace('\n', "\r\n"),
        format!("\u{feff}{model}"),
        model.replace(
            "<resources>",
            "<metadata name=\"Title\">&lt;a&gt; &#x41;</metadata><resources>",
        ),
    ];
    for model in models {
        let read = read(SurfaceFormat::ThreeMf, &three_mf_of(&model)).expect(&model);
        assert_eq!(read.triangles.len(), 4, "{model}");
    }
}

#[test]
fn a_3dxml_body_that_is_no_tessellation_is_refused() {
    let [manifest, structure, representation] = fluxform_testing::surface_files::three_dxml_parts();
    for (from, to, said) in [
        ("\"TESSELLATED\"", "\"CGR\"", "stored as `CGR`"),
        ("\"TESSELLATED\"", "\"\"", "stored as ``"),
        ("urn:3DXML:R.3DRep", "", "only tessellations"),
    ] {
        assert!(structure.1.contains(from), "{from}");
        let structure = structure.1.replacen(from, to, 1);
        let bytes = zipped(&[
            (manifest.0, &manifest.1),
            ("P.3dxml", &structure),
            ("R.3DRep", &representation.1),
        ]);
        let message = refusal(SurfaceFormat::ThreeDxml, &bytes);
        assert!(message.contains(said), "{to}: {message}");
    }
}

/// Wherever it stands among the faces, and with vertices of its own.
#[test]
fn a_coarser_version_in_3dxml_is_passed_over() {
    let [manifest, structure, representation] = fluxform_testing::surface_files::three_dxml_parts();
    let expected = read(SurfaceFormat::ThreeDxml, &three_dxml()).unwrap();
    let end = "</VertexBuffer></Rep>";
    assert!(representation.1.contains(end));
    let coarser = "<PolygonalLOD accuracy=\"9\"><Faces><Face triangles=\"0 1 2\"/></Faces>\
         <VertexBuffer><Positions>9 9 9,8 8 8,9 8 7</Positions></VertexBuffer></PolygonalLOD>";
    let text = representation
        .1
        .replace(end, &format!("</VertexBuffer>{coarser}</Rep>"));
    let bytes = zipped(&[
        (manifest.0, &manifest.1),
        (structure.0, &structure.1),
        (representation.0, &text),
    ]);
    let found = read(SurfaceFormat::ThreeDxml, &bytes).unwrap();
    assert_eq!(found.triangles, expected.triangles);
}

#[test]
fn a_document_names_the_unit_that_its_file_does_not_carry() {
    let read = |file: &str, unit: &str| {
        let text = format!("name = \"part\"\nsurface = \"{file}\"\n{unit}\n");
        ShapeDocument::from_toml(&text, Path::new("part.toml"))
            .map(|(document, _)| match document.source {
                SurfaceSource::File { unit_m, .. } => unit_m,
                other => unreachable!("a surface was named: {other:?}"),
            })
            .map_err(|faults| faults.to_string())
    };
    for (ending, carries) in [
        ("stl", false),
        ("obj", false),
        ("ply", false),
        ("3mf", true),
        ("amf", true),
        ("3dxml", true),
    ] {
        let file = format!("part.{ending}");
        assert_eq!(read(&file, "unit = \"cm\""), Ok(Some(0.01)), "{file}");
        if carries {
            assert_eq!(read(&file, ""), Ok(None), "{file}");
        } else {
            let said = read(&file, "").unwrap_err();
            assert!(said.contains("unit"), "{file}: {said}");
        }
    }
}
