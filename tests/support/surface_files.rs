//! One tetrahedron in every format: corners at the origin, 0.7 on x, 1.3 on y and 2.9 on z.

use std::io::{Cursor, Write};

use flate2::Compression;
use flate2::write::{DeflateEncoder, ZlibEncoder};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

pub const VERTICES: [[f32; 3]; 4] = [
    [0.0, 0.0, 0.0],
    [0.7, 0.0, 0.0],
    [0.0, 1.3, 0.0],
    [0.0, 0.0, 2.9],
];
pub const TRIANGLES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

pub fn obj() -> Vec<u8> {
    let mut text = String::from("# a body\no body\n");
    for [x, y, z] in VERTICES {
        text += &format!("v {x} {y} {z}\n");
    }
    for [a, b, c] in TRIANGLES {
        text += &format!("f {}/1 {}//2 -{}\n", a + 1, b + 1, 4 - c);
    }
    text.into_bytes()
}

fn ply_header(format: &str) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made here\nelement vertex 4\nproperty float x\n\
         property float y\nproperty uchar red\nproperty float z\nelement face 4\n\
         property list uchar int vertex_indices\nend_header\n"
    )
}

pub fn ply_ascii() -> Vec<u8> {
    let mut text = ply_header("ascii");
    for [x, y, z] in VERTICES {
        text += &format!("{x} {y} 7 {z} \n");
    }
    for [a, b, c] in TRIANGLES {
        text += &format!("3 {a} {b} {c}\n");
    }
    text.into_bytes()
}

pub fn ply_binary(big_endian: bool) -> Vec<u8> {
    let name = if big_endian { "big" } else { "little" };
    let mut bytes = ply_header(&format!("binary_{name}_endian")).into_bytes();
    let word = |bytes: &mut Vec<u8>, bits: u32| {
        bytes.extend(if big_endian {
            bits.to_be_bytes()
        } else {
            bits.to_le_bytes()
        });
    };
    for [x, y, z] in VERTICES {
        word(&mut bytes, x.to_bits());
        word(&mut bytes, y.to_bits());
        bytes.push(7);
        word(&mut bytes, z.to_bits());
    }
    for triangle in TRIANGLES {
        bytes.push(3);
        for index in triangle {
            word(&mut bytes, index);
        }
    }
    bytes
}

pub fn zipped(parts: &[(&str, &str)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    for (name, text) in parts {
        zip.start_file(*name, options).unwrap();
        zip.write_all(text.as_bytes()).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// An object of four triangles, placed by a second one.
pub fn three_mf_model(unit: &str) -> Vec<u8> {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<model unit=\"{unit}\" xml:lang=\"en\">\n\
         <resources><object id=\"1\"><mesh><vertices>\n"
    );
    for [x, y, z] in VERTICES {
        text += &format!("<vertex x=\"{x}\" y=\"{y}\" z=\"{z}\"/>\n");
    }
    text += "</vertices><triangles>\n";
    for [a, b, c] in TRIANGLES {
        text += &format!("<triangle v1=\"{a}\" v2=\"{b}\" v3=\"{c}\"/>\n");
    }
    text += "</triangles></mesh></object>\n<object id=\"2\"><components>\
             <component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 0 0 0\"/>\
             </components></object>\n</resources><build><item objectid=\"2\"/></build>\n</model>";
    text.into_bytes()
}

pub fn three_mf_of(model: &str) -> Vec<u8> {
    let relations = "<Relationships><Relationship Target=\"/3D/3DModel.model\" \
                     Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>\
                     </Relationships>";
    zipped(&[("_rels/.rels", relations), ("3D/3dmodel.model", model)])
}

pub fn three_mf(unit: &str) -> Vec<u8> {
    three_mf_of(&String::from_utf8(three_mf_model(unit)).unwrap())
}

/// Text before and after a constellation.
pub fn amf_parts(unit: &str) -> [String; 2] {
    let mut text = format!(
        "\u{feff}<?xml version=\"1.0\"?>\n<amf unit=\"{unit}\"><object id=\"1\"><mesh><vertices>\n"
    );
    for [x, y, z] in VERTICES {
        text += &format!(
            "<vertex><coordinates><x>{x}</x><y> {y} </y><z>{z}</z></coordinates></vertex>\n"
        );
    }
    text += "</vertices><volume>\n";
    for [a, b, c] in TRIANGLES {
        text += &format!("<triangle><v1>{a}</v1><v2>{b}</v2><v3>{c}</v3></triangle>\n");
    }
    [text + "</volume></mesh></object>\n", "</amf>\n".into()]
}

pub fn amf(unit: &str) -> String {
    amf_parts(unit).concat()
}

/// The body turned in its representation and turned back by the instance; strip, fan, triangles.
pub fn three_dxml_parts() -> [(&'static str, String); 3] {
    let positions = VERTICES.map(|[x, y, z]| format!("{y} {z} {x}")).join(",");
    let representation = format!(
        "<XMLRepresentation><Root xsi:type=\"BagRepType\"><Rep xsi:type=\"PolygonalRepType\">\
         <PolygonalLOD accuracy=\"5\"><Faces><Face triangles=\"0 1 2\"/></Faces></PolygonalLOD>\
         <Faces><Face strips=\"0 2 1 3\"/><Face fans=\"0 1 3\" triangles=\"0 3 2\"/></Faces>\
         <Edges><Polyline vertices=\"0 0 0\"/></Edges>\
         <VertexBuffer><Positions>{positions}</Positions></VertexBuffer></Rep></Root>\
         </XMLRepresentation>"
    );
    let structure = "<Model_3dxml><ProductStructure root=\"1\">\
         <Reference3D id=\"1\"/><Reference3D id=\"2\"/>\
         <Instance3D id=\"3\"><IsAggregatedBy>1</IsAggregatedBy>\
         <IsInstanceOf>urn:3DXML:Reference:loc:2</IsInstanceOf>\
         <RelativeMatrix>0 1 0 0 0 1 1 0 0 0 0 0</RelativeMatrix></Instance3D>\
         <ReferenceRep id=\"5\" format=\"TESSELLATED\" associatedFile=\"urn:3DXML:R.3DRep\"/>\
         <InstanceRep id=\"4\"><IsAggregatedBy>2</IsAggregatedBy><IsInstanceOf>5</IsInstanceOf>\
         </InstanceRep></ProductStructure></Model_3dxml>";
    [
        (
            "Manifest.xml",
            "<Manifest><Root>P.3dxml</Root></Manifest>".into(),
        ),
        ("P.3dxml", structure.into()),
        ("R.3DRep", representation),
    ]
}

pub fn three_dxml() -> Vec<u8> {
    let parts = three_dxml_parts();
    zipped(&parts.each_ref().map(|(name, text)| (*name, text.as_str())))
}

/// The display lists of the body: a strip of two triangles and two of one.
pub fn display_lists() -> Vec<u8> {
    let mut stream = vec![0xff; 7];
    for lengths in [&[4u32, 3][..], &[3]] {
        let corners: &[usize] = if lengths.len() == 2 {
            &[0, 2, 1, 3, 0, 1, 3]
        } else {
            &[0, 3, 2]
        };
        let head = [4, 8, 2, lengths.len() as u32];
        let tail = [12, 100, 2, corners.len() as u32];
        for word in head.iter().chain(lengths).chain(&tail) {
            stream.extend(word.to_le_bytes());
        }
        for c in corners.iter().flat_map(|k| VERTICES[*k]) {
            stream.extend(c.to_le_bytes());
        }
        stream.extend([1, 2, 3]);
    }
    stream
}

/// A SOLIDWORKS file since 2015 of these blocks: name, content, and whether it verifies. The
/// header of one that does not claims to reach to the end of the file.
pub fn sldprt_blocks(blocks: &[(&str, &[u8], bool)]) -> Vec<u8> {
    let mut bytes = vec![0x6b, 0x22, 0x77, 0x37, 0, 0, 0, 4];
    let mut decoys = Vec::new();
    for (name, stream, whole) in blocks {
        let mut packer = DeflateEncoder::new(Vec::new(), Compression::default());
        packer.write_all(stream).unwrap();
        let packed = packer.finish().unwrap();
        bytes.extend([0x14, 0, 0x06, 0, 0x08, 0]);
        if !whole {
            decoys.push((bytes.len() + 8, bytes.len() + 20 + name.len()));
        }
        let sizes = [packed.len(), stream.len(), name.len()].map(|n| n as u32);
        let checksum = crc32fast::hash(stream) ^ u32::from(!whole);
        for word in [1, checksum, sizes[0], sizes[1], sizes[2]] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(name.bytes().map(|b| b.rotate_left(4)));
        bytes.extend(packed);
    }
    let length = bytes.len();
    for (at, start) in decoys {
        bytes[at..at + 4].copy_from_slice(&((length - start) as u32).to_le_bytes());
    }
    bytes
}

pub fn sldprt_of(stream: &[u8]) -> Vec<u8> {
    sldprt_blocks(&[("Contents/DisplayLists", stream, true)])
}

pub fn sldprt() -> Vec<u8> {
    sldprt_of(&display_lists())
}

/// A SOLIDWORKS file up to 2014 of these streams; names that end in `__ZLB` are packed.
pub fn sldprt_compound(streams: &[(&str, &[u8])]) -> Vec<u8> {
    let mut file = cfb::CompoundFile::create(Cursor::new(Vec::new())).unwrap();
    for (name, stream) in streams {
        let folder = name.rsplit_once('/').unwrap().0;
        file.create_storage_all(format!("/{folder}")).unwrap();
        let mut content = stream.to_vec();
        if name.ends_with("__ZLB") {
            content = vec![0x23; 16];
            for chunk in stream.chunks(100) {
                let mut packer = ZlibEncoder::new(Vec::new(), Compression::default());
                packer.write_all(chunk).unwrap();
                let packed = packer.finish().unwrap();
                content.extend((chunk.len() as u32).to_le_bytes());
                content.extend((packed.len() as u32).to_le_bytes());
                content.extend(packed);
            }
            content.extend([0; 8]);
        }
        let mut target = file.create_stream(format!("/{name}")).unwrap();
        target.write_all(&content).unwrap();
    }
    file.flush().unwrap();
    file.into_inner().into_inner()
}

/// An assembly of two tetrahedra, the second 10 m along x and turned by 90 degrees about z, and
/// of a third that is hidden: its document, and its display lists.
pub fn assembly() -> (String, Vec<u8>) {
    let references = [
        (1, "NO", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"),
        (2, "NO", "0 1 0 0 -1 0 0 0 0 0 1 0 10 0 0 1"),
        (3, "YES", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 7 1"),
    ];
    let references = references.map(|(k, hidden, place)| {
        format!(
            "<swReference id=\"{}\" swName=\"body\" swReferenceNumber=\"{k}\" \
             swSuppressed=\"NO\" swHidden=\"{hidden}\" swModelRef=\"5\" \
             swTransform=\"{place}\"/>",
            10 + k
        )
    });
    let tree = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><swSolidWorks><swHeader>\
         <swFile id=\"3\" swPath=\"Z:\\both.SLDASM\"/><swFile id=\"6\" \
         swPath=\"Z:\\a b\\Body.SLDPRT\"/></swHeader><swModelList>\
         <swModel id=\"5\" swName=\"Body\" swFileRef=\"6\" swBoundingBox=\"0 0 0 0.7 1.3 2.9\"/>\
         <swModel id=\"2\" swName=\"both\" swFileRef=\"3\">{}</swModel></swModelList>\
         </swSolidWorks>",
        references.concat()
    );
    let path = "C:\\elsewhere\\Body.SLDPRT";
    let mut stream = vec![0, 7, 0xff, 0xfe, 0xff, path.len() as u8];
    stream.extend(path.encode_utf16().flat_map(u16::to_le_bytes));
    stream.extend(display_lists());
    (tree, stream)
}

/// The tetrahedron's faces as one strip and a triangle, -1 between them.
pub fn ply_strips() -> Vec<u8> {
    let mut bytes = b"ply\nformat binary_big_endian 1.0\nelement vertex 4\nproperty float x\n\
                      property float y\nproperty float z\nelement tristrips 1\n\
                      property list int int vertex_indices\nend_header\n"
        .to_vec();
    for c in VERTICES.as_flattened() {
        bytes.extend(c.to_be_bytes());
    }
    let strip = [0i32, 2, 1, 3, -1, 0, 1, 3, -1, 0, 3, 2];
    bytes.extend((strip.len() as i32).to_be_bytes());
    bytes.extend(strip.iter().flat_map(|index| index.to_be_bytes()));
    bytes
}

pub fn off() -> Vec<u8> {
    let mut text = String::from("OFF # a body\n4 4 6\n\n");
    for [x, y, z] in VERTICES {
        text += &format!("{x} {y} {z}\n");
    }
    for [a, b, c] in TRIANGLES {
        text += &format!("3 {a} {b} {c} 0.5 0.5 0.5\n");
    }
    text.into_bytes()
}

/// The tetrahedron, which glTF has with y upwards, in two primitives; its node doubles it.
pub fn glb() -> Vec<u8> {
    let mut blob = Vec::new();
    for [x, y, z] in VERTICES {
        for c in [x, z, -y] {
            blob.extend((c / 2.0).to_le_bytes());
        }
    }
    for index in TRIANGLES[..3].as_flattened().iter().chain(&TRIANGLES[3]) {
        blob.extend((*index as u16).to_le_bytes());
    }
    let json = r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"children":[1]},{"mesh":0,"scale":[2,2,2]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1},
        {"attributes":{"POSITION":0},"indices":2,"mode":5}]}],
        "buffers":[{"byteLength":72}],"bufferViews":[{"buffer":0,"byteLength":48},
        {"buffer":0,"byteOffset":48,"byteLength":24}],"accessors":[
        {"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,-1],"max":[1,2,0]},
        {"bufferView":1,"componentType":5123,"count":9,"type":"SCALAR"},
        {"bufferView":1,"byteOffset":18,"componentType":5123,"count":3,"type":"SCALAR"}]}"#;
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    let length = 12 + 8 + json.len() + 8 + blob.len();
    bytes.extend((length as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &blob)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// A PNG of grey, its rows from the top; with one bit depth of 8 or 16.
pub fn height_image(width: u32, levels: &[u16], depth: png::BitDepth) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, levels.len() as u32 / width);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    let data: Vec<u8> = match depth {
        png::BitDepth::Sixteen => levels.iter().flat_map(|l| l.to_be_bytes()).collect(),
        _ => levels.iter().map(|l| *l as u8).collect(),
    };
    writer.write_image_data(&data).unwrap();
    writer.finish().unwrap();
    bytes
}

/// The assembly of this document and these display lists.
pub fn sldprt_assembly(tree: &[u8], lists: &[u8]) -> Vec<u8> {
    sldprt_blocks(&[
        ("swXmlContents/COMPINSTANCETREE", tree, true),
        ("Contents/DisplayLists", lists, true),
    ])
}

/// A part in STEP: a box of 0.7 x 1.3 x 2.9 mm, its six faces planes.
pub fn step() -> Vec<u8> {
    let mut lines: Vec<String> = Vec::new();
    let mut add = |text: String| {
        lines.push(text);
        lines.len()
    };
    let corner = |k: usize| {
        [0, 1, 2].map(|axis| {
            if k >> axis & 1 == 1 {
                VERTICES[axis + 1][axis]
            } else {
                0.0
            }
        })
    };
    let (mut point, mut vertex) = ([0; 8], [0; 8]);
    for k in 0..8 {
        let [x, y, z] = corner(k);
        point[k] = add(format!("CARTESIAN_POINT('',({x:.3},{y:.3},{z:.3}))"));
        vertex[k] = add(format!("VERTEX_POINT('',#{})", point[k]));
    }
    let direction = |[x, y, z]: [i32; 3]| format!("DIRECTION('',({x}.,{y}.,{z}.))");
    let along = |axis: usize, sign: i32| {
        let mut unit = [0; 3];
        unit[axis] = sign;
        unit
    };
    // Edges run along their axis from the corner without that bit.
    let mut edge = std::collections::BTreeMap::new();
    for axis in 0..3 {
        for from in (0..8).filter(|k| k >> axis & 1 == 0) {
            let to = from | 1 << axis;
            let d = add(direction(along(axis, 1)));
            let v = add(format!("VECTOR('',#{d},1.)"));
            let line = add(format!("LINE('',#{},#{v})", point[from]));
            let curve = add(format!(
                "EDGE_CURVE('',#{},#{},#{line},.T.)",
                vertex[from], vertex[to]
            ));
            edge.insert((from, to), curve);
        }
    }
    let mut faces = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, 1] {
            let base = side << axis;
            // Counterclockwise as seen from outside.
            let mut turn = [base, base | 1 << u, base | 1 << u | 1 << v, base | 1 << v];
            if side == 0 {
                turn.reverse();
            }
            let mut oriented = Vec::new();
            for k in 0..4 {
                let (from, to) = (turn[k], turn[(k + 1) % 4]);
                let (low, high) = (from.min(to), from.max(to));
                let sense = if from < to { ".T." } else { ".F." };
                let curve = edge[&(low, high)];
                let e = add(format!("ORIENTED_EDGE('',*,*,#{curve},{sense})"));
                oriented.push(format!("#{e}"));
            }
            let edges = add(format!("EDGE_LOOP('',({}))", oriented.join(",")));
            let bound = add(format!("FACE_OUTER_BOUND('',#{edges},.T.)"));
            let normal = add(direction(along(axis, 2 * side as i32 - 1)));
            let across = add(direction(along(u, 1)));
            let at = point[base];
            let placed = add(format!("AXIS2_PLACEMENT_3D('',#{at},#{normal},#{across})"));
            let plane = add(format!("PLANE('',#{placed})"));
            let face = add(format!("ADVANCED_FACE('',(#{bound}),#{plane},.T.)"));
            faces.push(format!("#{face}"));
        }
    }
    let shell = add(format!("CLOSED_SHELL('',({}))", faces.join(",")));
    let solid = add(format!("MANIFOLD_SOLID_BREP('box',#{shell})"));
    let length = add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))".into());
    let angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))".into());
    let context = add(format!(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle}))\
         REPRESENTATION_CONTEXT('',''))"
    ));
    add(format!(
        "ADVANCED_BREP_SHAPE_REPRESENTATION('',(#{solid}),#{context})"
    ));
    let mut text = String::from(
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n\
         FILE_NAME('box','2024-01-01T00:00:00',(''),(''),'','','');\n\
         FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n",
    );
    for (k, line) in lines.iter().enumerate() {
        text += &format!("#{}={line};\n", k + 1);
    }
    (text + "ENDSEC;\nEND-ISO-10303-21;\n").into_bytes()
}
