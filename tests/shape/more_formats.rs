//! OFF, GLB, height images, and what scanners and old programs write, on files made here.

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use fluxform_base::progress::Silent;
use fluxform_shape::bodies::BodyOptions;
use fluxform_shape::document::{Placement, SurfaceFormat};
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::{MeshReport, ShapeError, surface};

use crate::formats::{read, refusal};
use fluxform_testing::surface_files::{
    amf, glb, height_image, obj, off, ply_ascii, ply_binary, ply_strips, sldprt, step, three_dxml,
    three_mf, three_mf_model, three_mf_of,
};
use fluxform_testing::surfaces::{binary, grid, sample};

const VOLUME: f64 = 0.7 * 1.3 * 2.9 / 6.0;

fn wide(text: &[u8], order: fn(u16) -> [u8; 2]) -> Vec<u8> {
    let text = std::str::from_utf8(text).unwrap();
    let units = "\u{feff}".encode_utf16().chain(text.encode_utf16());
    units.flat_map(order).collect()
}

#[test]
fn the_items_that_a_3mf_file_builds_are_listed() {
    let model = String::from_utf8(three_mf_model("inch")).unwrap();
    let report = |model: &str| {
        let file = read(SurfaceFormat::ThreeMf, &three_mf_of(model)).unwrap();
        let bodies = file.bodies.clone();
        (
            bodies,
            MeshReport::new(SurfaceFormat::ThreeMf, file).triangles,
        )
    };
    // One item of one component, in two objects, is one body.
    let (bodies, triangles) = report(&model);
    assert_eq!((bodies.len(), triangles), (1, 4), "{bodies:?}");
    assert_eq!((&*bodies[0].name, bodies[0].triangles), ("object 2", 4));
    let two = model.replace(
        "<item objectid=\"2\"/>",
        "<item objectid=\"2\"/><item objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 9 0 0\"/>",
    );
    let two = two.replace("<object id=\"1\">", "<object id=\"1\" name=\" a lid \">");
    let (bodies, triangles) = report(&two);
    let names: Vec<&str> = bodies.iter().map(|body| &*body.name).collect();
    assert_eq!((names, triangles), (vec!["object 2", "a lid"], 8));
}

/// A vendor's vertices were taken for the model's, and shifted the numbers of all that followed.
#[test]
fn elements_of_other_namespaces_in_a_3mf_file_are_no_part_of_its_bodies() {
    let core = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
    let model = String::from_utf8(three_mf_model("inch")).unwrap();
    let model = model.replace("<model ", &format!("<model xmlns=\"{core}\" "));
    let triangles =
        |model: &str| read(SurfaceFormat::ThreeMf, &three_mf_of(model)).map(|file| file.triangles);
    let plain = triangles(&model).unwrap();
    let foreign = [
        "<v:vertex xmlns:v=\"http://vendor.example/x\" x=\"9\" y=\"9\" z=\"9\"/>",
        "<vertex xmlns=\"http://vendor.example/x\" x=\"9\" y=\"9\" z=\"9\"/>",
        "<v:old xmlns:v=\"http://vendor.example/x\"><v:object/><vertex x=\"9\" y=\"9\" z=\"9\"/></v:old>",
    ];
    for element in foreign {
        let with = model.replace("<vertices>", &format!("<vertices>{element}"));
        assert_eq!(triangles(&with).unwrap(), plain, "{element}");
    }
    // The core's own namespace under a prefix.
    let prefixed = model
        .replace('<', "<c:")
        .replace("<c:/", "</c:")
        .replace("<c:?", "<?");
    let prefixed = prefixed.replace("xmlns=", "xmlns:c=");
    assert_eq!(triangles(&prefixed).unwrap(), plain);
    // An object that an extension makes is refused as before.
    let lattice = "<b:beamlattice xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\"/>";
    let lattice = model.replace("</triangles>", &format!("</triangles>{lattice}"));
    assert!(triangles(&lattice).is_err());
}

#[test]
fn every_further_format_gives_the_same_body() {
    use SurfaceFormat::{Amf, Glb, Obj, Off, Ply};
    let blender = String::from_utf8(ply_ascii()).unwrap();
    let blender = blender.replace(
        "comment made here",
        "Created by Blender3D 247 - www.blender.org, source file: a.blend",
    );
    let broken = String::from_utf8(off()).unwrap().replace("\n3 0", "\n3\n0");
    let samples: [(SurfaceFormat, Vec<u8>, Option<f64>); 8] = [
        (Off, off(), None),
        (Off, broken.into_bytes(), None),
        (Glb, glb(), Some(1.0)),
        (Ply, ply_strips(), None),
        (Ply, blender.into_bytes(), None),
        (Obj, wide(&obj(), u16::to_le_bytes), None),
        (Obj, wide(&obj(), u16::to_be_bytes), None),
        (
            Amf,
            wide(amf("mm").as_bytes(), u16::to_le_bytes),
            Some(1e-3),
        ),
    ];
    for (format, bytes, unit_m) in samples {
        let report = MeshReport::new(format, read(format, &bytes).unwrap());
        assert_eq!((report.triangles, report.unit_m), (4, unit_m), "{format:?}");
        assert!(
            report.watertight && report.inconsistent_edges == 0,
            "{report:?}"
        );
        assert!((report.volume.unwrap() - VOLUME).abs() < 1e-6, "{report:?}");
        for (k, corner) in [0.7, 1.3, 2.9].iter().enumerate() {
            assert!((report.bounds_max[k] - corner).abs() < 1e-6, "{report:?}");
        }
    }
}

/// Marks of order, UTF-16 and lines that end by CR alone were refused, some by messages that contradict themselves.
#[test]
fn ply_and_off_are_read_in_every_encoding_and_with_every_end_of_line() {
    use SurfaceFormat::{Off, Ply};
    let marked = |text: Vec<u8>| [b"\xef\xbb\xbf".to_vec(), text].concat();
    let old_mac = |text: Vec<u8>| {
        String::from_utf8(text)
            .unwrap()
            .replace('\n', "\r")
            .into_bytes()
    };
    let mut binary = ply_binary(false);
    let end = binary.windows(10).position(|w| w == b"end_header").unwrap() + 11;
    for b in &mut binary[..end] {
        if *b == b'\n' {
            *b = b'\r';
        }
    }
    for (format, bytes) in [
        (Ply, marked(ply_ascii())),
        (Ply, wide(&ply_ascii(), u16::to_le_bytes)),
        (Ply, wide(&ply_ascii(), u16::to_be_bytes)),
        (Ply, old_mac(ply_ascii())),
        (Ply, binary),
        (Off, marked(off())),
        (Off, wide(&off(), u16::to_le_bytes)),
        (Off, old_mac(off())),
    ] {
        assert_eq!(SurfaceFormat::of_content(&bytes), Some(format));
        let report = MeshReport::new(format, read(format, &bytes).unwrap());
        assert_eq!(report.triangles, 4, "{format:?}");
        assert!((report.volume.unwrap() - VOLUME).abs() < 1e-6, "{report:?}");
    }
    let message = refusal(Off, b"OFF BINARY\n\0\0\0\x04");
    assert!(
        message.contains("binary") && message.contains("save it"),
        "{message}"
    );
}

/// Faces beyond the header's count were left out without a word, and the message for `nan` was that a line could not be read.
#[test]
fn what_a_ply_or_off_header_leaves_out_is_a_warning() {
    use SurfaceFormat::{Off, Ply};
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let fewer = |bytes: Vec<u8>, from: &str, to: &str| {
        let text = text(bytes);
        assert!(text.contains(from), "{text}");
        text.replace(from, to).into_bytes()
    };
    for (format, whole, short) in [
        (
            Ply,
            ply_ascii(),
            fewer(ply_ascii(), "element face 4", "element face 3"),
        ),
        (Off, off(), fewer(off(), "4 4 6", "4 3 6")),
    ] {
        assert!(read(format, &whole).unwrap().warnings.is_empty());
        let found = read(format, &short).unwrap();
        assert_eq!(found.triangles.len(), 3);
        assert!(
            found.warnings[0].contains("goes on"),
            "{:?}",
            found.warnings
        );
    }
    let mut longer = ply_binary(true);
    longer.extend([7; 13]);
    assert!(read(Ply, &longer).unwrap().warnings[0].contains("goes on"));
    let broken = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                   property float z\nelement face 1\nproperty list uchar int vertex_indices\n\
                   end_header\n0 0 nan\n1 0 0\n0 1 0\n3 0 1 2\n";
    let message = refusal(Ply, broken);
    assert!(
        message.contains("line 10") && message.contains("not a finite number"),
        "{message}"
    );
}

/// Their roundings were those of floats, however few digits were printed: points of rims were lost.
#[test]
fn ascii_ply_counts_the_digits_as_every_text_does() {
    let corners = [
        "27.5591 15.748 11.811",
        "1.96850 15.748 11.811",
        "15.748 29.5276 11.811",
    ];
    for (kind, requested) in [("float", 0.5e-4), ("double", 0.5e-4)] {
        let header = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty {kind} x\nproperty {kind} y\n\
             property {kind} z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        );
        let ply = format!("{header}{}\n3 0 1 2\n", corners.join("\n"));
        let off = format!("OFF\n3 1 3\n{}\n3 0 1 2\n", corners.join("\n"));
        let found = read(SurfaceFormat::Ply, ply.as_bytes()).unwrap();
        let other = read(SurfaceFormat::Off, off.as_bytes()).unwrap();
        assert_eq!(found.coordinate_rounding, other.coordinate_rounding);
        assert!((found.coordinate_rounding - requested).abs() < 1e-12);
    }
}

/// Its message showed the parser's own structures.
#[test]
fn a_damaged_ply_header_is_refused_in_plain_words() {
    let text = String::from_utf8(ply_ascii()).unwrap();
    let bad = text.replace("property uchar red", "property uchar");
    let message = refusal(SurfaceFormat::Ply, bad.as_bytes());
    assert!(
        message.contains("damaged") && !message.contains('{'),
        "{message}"
    );
}

#[test]
fn a_height_image_is_a_surface_over_its_pixels() {
    // Three columns, two rows: the upper row is the higher y.
    let levels = [0, 65535, 13107, 6553, 65535, 0];
    let bytes = height_image(3, &levels, png::BitDepth::Sixteen);
    let mesh = read(SurfaceFormat::HeightImage, &bytes).unwrap();
    assert_eq!(mesh.triangles.len(), 4);
    let height = |x: f64, y: f64| {
        let mut vertices = mesh.triangles.as_flattened().iter();
        vertices.find(|v| v[0] == x && v[1] == y).unwrap()[2]
    };
    for (k, level) in levels.iter().enumerate() {
        let (x, y) = ((k % 3) as f64, (1 - k / 3) as f64);
        assert_eq!(height(x, y), f64::from(*level) / 65535.0);
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle;
        let turn = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert_eq!(turn, 1.0, "seen from above, counter-clockwise");
    }
    let coarse = height_image(2, &[0, 255, 51, 3], png::BitDepth::Eight);
    let mesh = read(SurfaceFormat::HeightImage, &coarse).unwrap();
    assert!(mesh.warnings[0].contains("8 bit"), "{:?}", mesh.warnings);
    let thin = height_image(1, &[0, 255], png::BitDepth::Eight);
    assert!(refusal(SurfaceFormat::HeightImage, &thin).contains("2 x 2"));
    // The last chunk, of twelve bytes, only says that it is the last.
    for length in 0..bytes.len() - 12 {
        refusal(SurfaceFormat::HeightImage, &bytes[..length]);
    }
}

/// Levels of 1, 2 and 4 bit were counted after they were widened: half a step was stated as 0.002 of the range.
#[test]
fn regression_few_grey_levels_were_taken_for_256() {
    for (depth, highest) in [
        (png::BitDepth::One, 1.0),
        (png::BitDepth::Two, 3.0),
        (png::BitDepth::Four, 15.0),
        (png::BitDepth::Eight, 255.0),
    ] {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 2);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(depth);
        let mut writer = encoder.write_header().unwrap();
        let row = usize::from(depth as u8);
        writer.write_image_data(&vec![0x5a; 2 * row]).unwrap();
        writer.finish().unwrap();
        let mesh = read(SurfaceFormat::HeightImage, &bytes).unwrap();
        assert_eq!(mesh.level_rounding, 0.5 / highest);
        let stated = format!("{} bit: its heights are steps of 1/{highest} ", depth as u8);
        assert!(mesh.warnings[0].contains(&stated), "{:?}", mesh.warnings);
    }
}

/// Half a grey level of a high image was a reach in plan: holes closed, and rims grew by pixels.
#[test]
fn coarse_grey_levels_leave_the_plan_of_an_image_alone() {
    // Nine pixels a side, the middle one transparent: of 8 x 8 cells the four around it are missing.
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 9, 9);
    encoder.set_color(png::ColorType::GrayscaleAlpha);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().unwrap();
    let alpha = |k: usize| if k == 40 { 0 } else { 255 };
    let data: Vec<u8> = (0..81).flat_map(|k| [70, alpha(k)]).collect();
    writer.write_image_data(&data).unwrap();
    writer.finish().unwrap();
    let file = read(SurfaceFormat::HeightImage, &bytes).unwrap();
    let placed = Transform::new(1e-3, &Placement::default()).scaled([0.1, 0.1, 100.0]);
    let mesh = Mesh::place(file, &placed).unwrap();
    assert!((mesh.facts().height_rounding_m / (0.5 / 255.0 * 0.1) - 1.0).abs() < 1e-15);
    let samples = |from: f64, to: f64, count: usize| {
        let found = sample(&mesh, &grid((from, to, count), (from, to, count)));
        found.iter().filter(|sample| sample.is_some()).count()
    };
    assert_eq!(samples(0.0, 0.8e-3, 81), 81 * 81 - 19 * 19);
    assert_eq!(samples(-0.1e-3, 0.9e-3, 11), 81 - 1);
    assert_eq!(samples(0.301e-3, 0.499e-3, 7), 0);
}

/// The sample file with a part of its document replaced.
fn glb_with(from: &str, to: &str) -> Vec<u8> {
    glb_of(&[(from, to)], &[])
}

/// The sample file with parts of its document replaced and `more` behind its 72 bytes of data.
fn glb_of(edits: &[(&str, &str)], more: &[f32]) -> Vec<u8> {
    let bytes = glb();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let mut json = String::from_utf8(bytes[20..20 + length].to_vec()).unwrap();
    for (from, to) in edits {
        assert!(json.contains(from), "{from}");
        json = json.replacen(from, to, 1);
    }
    let mut json = json.into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut blob = bytes[20 + length + 8..].to_vec();
    blob.extend(more.iter().flat_map(|number| number.to_le_bytes()));
    let mut whole = b"glTF\x02\0\0\0".to_vec();
    whole.extend((28 + json.len() as u32 + blob.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &blob)] {
        whole.extend((chunk.len() as u32).to_le_bytes());
        whole.extend(kind);
        whole.extend(chunk);
    }
    whole
}

/// The sample with its mesh bound to two joints below a node 1 m up; the joints' own keys and their inverse bind
/// matrices, of a scale and a shift along y.
fn skinned(joints: [&str; 2], binds: [[f32; 2]; 2]) -> Vec<u8> {
    let [a, b] = joints;
    let nodes = format!(
        "\"skins\":[{{\"joints\":[2,3],\"inverseBindMatrices\":3}}],\
         \"nodes\":[{{\"children\":[1,2,3],\"translation\":[0,1,0]}},\
         {{\"mesh\":0,\"skin\":0,\"translation\":[5,7,9]}},{{{a}}},{{{b}}}],"
    );
    let matrix = |[scale, y]: [f32; 2]| {
        let mut columns = [0.0; 16];
        (columns[0], columns[5], columns[10]) = (scale, scale, scale);
        (columns[13], columns[15]) = (y, 1.0);
        columns
    };
    let edits = [
        (
            "\"nodes\":[{\"children\":[1]},{\"mesh\":0,\"scale\":[2,2,2]}],",
            nodes.as_str(),
        ),
        ("\"byteLength\":72}", "\"byteLength\":200}"),
        (
            "\"byteLength\":24}]",
            "\"byteLength\":24},{\"buffer\":0,\"byteOffset\":72,\"byteLength\":128}]",
        ),
        (
            "\"count\":3,\"type\":\"SCALAR\"}]",
            "\"count\":3,\"type\":\"SCALAR\"},\
             {\"bufferView\":2,\"componentType\":5126,\"count\":2,\"type\":\"MAT4\"}]",
        ),
    ];
    glb_of(&edits, binds.map(matrix).as_flattened())
}

/// Skinned meshes were placed by their own node, which glTF ignores, and not by their joints.
#[test]
fn skinned_meshes_are_placed_by_their_joints_or_refused_where_these_bend_them() {
    let plain = read(SurfaceFormat::Glb, &glb()).unwrap();
    // One is written otherwise: 2 (y + 0.3) - 0.6 = 2 y.
    let joints = ["\"scale\":[2,2,2]", "\"translation\":[0,-0.6,0]"];
    let file = read(
        SurfaceFormat::Glb,
        &skinned(joints, [[1.0, 0.0], [2.0, 0.6]]),
    );
    let file = file.unwrap();
    assert!(file.warnings[0].contains("skins"), "{:?}", file.warnings);
    assert_eq!(file.triangles.len(), plain.triangles.len());
    let corners = file.triangles.as_flattened().iter();
    for (placed, own) in corners.zip(plain.triangles.as_flattened()) {
        for (at, own) in placed.iter().zip([own[0], own[1], own[2] + 1.0]) {
            assert!((at - own).abs() < 1e-6, "{placed:?}");
        }
    }
    let bent = skinned(joints, [[1.0, 0.0], [2.0, 0.61]]);
    let message = refusal(SurfaceFormat::Glb, &bent);
    assert!(
        message.contains("skin") && message.contains("apply it and export it again"),
        "{message}"
    );
}

/// Sparse positions without a view were taken for compressed ones.
#[test]
fn sparse_data_of_glb_are_named_as_what_they_are() {
    let sparse = "{\"componentType\":5126,\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":1,\
                  \"componentType\":5123},\"values\":{\"bufferView\":0}},\"count\":4,";
    let plain = "{\"bufferView\":0,\"componentType\":5126,\"count\":4,";
    let message = refusal(SurfaceFormat::Glb, &glb_with(plain, sparse));
    assert!(message.contains("sparse"), "{message}");
}

/// A document that needs glTF 3 was read as if it were 2.0.
#[test]
fn a_glb_file_that_needs_another_version_is_refused() {
    let with = |asset: &str| glb_with("{\"version\":\"2.0\"}", asset);
    for (asset, named) in [
        (r#"{"version":"2.0","minVersion":"3.0"}"#, "`3.0`"),
        (r#"{"version":"2.1","minVersion":"2.1"}"#, "`2.1`"),
        (r#"{"version":"2.0","minVersion":"two"}"#, "`two`"),
        (r#"{"version":"3.0"}"#, "`3.0`"),
        (r#"{"version":"1.0"}"#, "`1.0`"),
        (r#"{"version":"1.0","minVersion":"1.0"}"#, "`1.0`"),
    ] {
        let message = refusal(SurfaceFormat::Glb, &with(asset));
        assert!(
            message.contains(named) && message.contains("export it again as glTF 2.0"),
            "{message}"
        );
    }
    for asset in [
        r#"{"version":"2.1"}"#,
        r#"{"version":"2.0","minVersion":"2.0"}"#,
        r#"{"version":"2.10","minVersion":"2.0"}"#,
        r#"{"version":"3.0","minVersion":"2.0"}"#,
    ] {
        assert!(read(SurfaceFormat::Glb, &with(asset)).is_ok(), "{asset}");
    }
}

/// Every required extension was called damage, the harmless ones too.
#[test]
fn required_extensions_of_glb_are_passed_or_named_with_advice() {
    let requiring = |name: &str| {
        let to = format!(
            "\"extensionsUsed\":[\"{name}\"],\"extensionsRequired\":[\"{name}\"],\"scene\":0,"
        );
        glb_with("\"scene\":0,", &to)
    };
    for name in [
        "KHR_texture_transform",
        "KHR_texture_basisu",
        "KHR_materials_unlit",
        "EXT_texture_webp",
        "KHR_lights_punctual",
    ] {
        let file = read(SurfaceFormat::Glb, &requiring(name)).unwrap();
        assert_eq!(
            (file.triangles.len(), file.warnings.len()),
            (4, 0),
            "{name}"
        );
    }
    for (name, advice) in [
        ("KHR_draco_mesh_compression", "without compression"),
        ("EXT_meshopt_compression", "without compression"),
        ("KHR_mesh_quantization", "without quantization"),
        ("EXT_mesh_gpu_instancing", "real objects"),
        ("VND_other", "plain mesh"),
    ] {
        let message = refusal(SurfaceFormat::Glb, &requiring(name));
        assert!(
            message.contains(name) && message.contains(advice),
            "{message}"
        );
    }
    // A texture of `KHR_texture_basisu` names no plain image.
    let textured = glb_with(
        "\"scene\":0,",
        "\"scene\":0,\"textures\":[{\"sampler\":7}],",
    );
    assert!(read(SurfaceFormat::Glb, &textured).is_ok());
}

/// Instances, morph targets and the indices of half a triangle were left out without a word.
#[test]
fn geometry_of_glb_that_is_not_read_is_refused_or_a_warning() {
    let refused = |from: &str, to: &str, reason: &str| {
        let message = refusal(SurfaceFormat::Glb, &glb_with(from, to));
        assert!(
            message.contains(reason) && message.contains("export it again"),
            "{message}"
        );
    };
    let node = "{\"mesh\":0,";
    refused(
        node,
        "{\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{\"TRANSLATION\":0}}},",
        "EXT_mesh_gpu_instancing",
    );
    refused("\"count\":9", "\"count\":8", "whole triangles");
    let morphed = |weight: &str| {
        let to = format!(
            "\"meshes\":[{{\"weights\":[{weight}],\"primitives\":[{{\"targets\":[{{\"POSITION\":0}}],"
        );
        glb_with("\"meshes\":[{\"primitives\":[{", &to)
    };
    let message = refusal(SurfaceFormat::Glb, &morphed("0.3"));
    assert!(message.contains("morph targets"), "{message}");
    // At rest nothing is bent.
    assert!(
        read(SurfaceFormat::Glb, &morphed("0.0"))
            .unwrap()
            .warnings
            .is_empty()
    );
    let hidden = "{\"mesh\":0,\"extensions\":{\"KHR_node_visibility\":{\"visible\":false}},";
    let file = read(SurfaceFormat::Glb, &glb_with(node, hidden)).unwrap();
    assert!(
        file.warnings[0].contains("KHR_node_visibility"),
        "{:?}",
        file.warnings
    );
}

#[test]
fn a_glb_file_that_claims_more_than_it_holds_is_refused() {
    let good = glb();
    for length in 0..good.len() {
        refusal(SurfaceFormat::Glb, &good[..length]);
    }
    for (from, to) in [
        ("\"count\":4", "\"count\":9"),
        ("\"byteLength\":48", "\"byteLength\":99"),
        ("\"count\":9", "\"count\":99"),
        ("\"buffer\":0", "\"buffer\":7"),
        ("\"children\":[1]", "\"children\":[0]"),
    ] {
        let at = good
            .windows(from.len())
            .position(|w| w == from.as_bytes())
            .unwrap();
        let mut bytes = good.clone();
        // One byte longer takes one of the blanks that follow the document.
        bytes.splice(at..at + from.len(), to.bytes());
        let json = u32::from_le_bytes(good[12..16].try_into().unwrap()) as usize;
        if to.len() > from.len() {
            let blank = 20 + json;
            if bytes[blank] != b' ' {
                continue;
            }
            bytes.remove(blank);
        }
        refusal(SurfaceFormat::Glb, &bytes);
    }
}

/// STL without an ending was refused, whatever it held.
#[test]
fn a_file_without_an_ending_is_known_by_its_content() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("part");
    let one = [[[0.7f32, -1.3, 2.9], [10.1, 0.3, 3.1], [-4.7, 8.3, 2.3]]];
    let ascii = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                  vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    let image = height_image(2, &[1, 2, 3, 4], png::BitDepth::Sixteen);
    for (name, bytes) in [
        ("STL", binary(&one)),
        ("STL", ascii.to_vec()),
        ("OBJ", obj()),
        ("PLY", ply_ascii()),
        ("OFF", off()),
        ("GLB", glb()),
        ("height image", image),
        ("3MF", three_mf("inch")),
        ("AMF", amf("mm").into_bytes()),
        ("3DXML", three_dxml()),
        ("STEP", step()),
        ("SOLIDWORKS", sldprt()),
    ] {
        let found = SurfaceFormat::of_content(&bytes).map(SurfaceFormat::name);
        assert_eq!(found, Some(name));
        // This is a test's own file.
        #[allow(clippy::disallowed_methods)]
        std::fs::write(&path, &bytes).unwrap();
        if name != "STEP" {
            let report = of_file(&path).unwrap();
            assert_eq!(report.format, name);
        }
    }
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&path, off()).unwrap();
    let unit = surface::read(&path, None, &BodyOptions::default(), &Silent).unwrap_err();
    assert!(matches!(unit, ShapeError::UnitMissing { .. }), "{unit}");
    #[allow(clippy::disallowed_methods)]
    std::fs::write(&path, b"some text").unwrap();
    let unknown = of_file(&path).unwrap_err();
    assert!(matches!(unknown, ShapeError::Format { .. }), "{unknown}");
}

#[test]
fn what_is_not_read_comes_with_advice() {
    for (name, advice) in [
        ("a.igs", "STEP"),
        ("a.IGES", "STEP"),
        ("a.x_t", "STL"),
        ("a.gltf", ".glb"),
    ] {
        let message = of_file(Path::new(name)).unwrap_err().to_string();
        assert!(
            message.contains(advice) && message.contains("; "),
            "{message}"
        );
    }
}

/// Two gigabytes of a hole were read, and more was held, before a word of it was looked at.
#[test]
fn a_file_with_a_hole_is_refused_where_the_hole_begins() {
    let folder = tempfile::tempdir().unwrap();
    let mut stl = binary(&[[[0.0f32; 3]; 3]; 3]);
    stl[80..84].copy_from_slice(&40_000_000u32.to_le_bytes());
    for (name, head, length) in [
        ("a.obj", obj(), 2_000_000_000),
        ("a.ply", ply_ascii(), 2_000_000_000),
        ("a.stl", b"solid a\n".to_vec(), 2_000_000_000),
        ("b.stl", stl, 84 + 50 * 40_000_000),
        ("a.step", step(), 2_000_000_000),
        ("a.3mf", three_mf("inch"), 2_000_000_000),
        ("a.sldprt", sldprt(), 2_000_000_000),
        ("a", off(), 2_000_000_000),
    ] {
        let path = folder.path().join(name);
        #[allow(clippy::disallowed_methods)]
        let mut file = std::fs::File::create(&path).unwrap();
        file.write_all(&head).unwrap();
        file.set_len(length).unwrap();
        file.seek(SeekFrom::End(-1)).unwrap();
        file.write_all(b"\n").unwrap();
        let message = of_file(&path).unwrap_err().to_string();
        assert!(message.contains("zeros alone"), "{name}: {message}");
    }
}

fn of_file(path: &Path) -> Result<MeshReport, ShapeError> {
    MeshReport::of_file(path, &BodyOptions::default(), &Silent)
}
