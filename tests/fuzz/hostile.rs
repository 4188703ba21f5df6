//! Inputs made to exhaust a reader: bombs, deep nesting, enormous counts, quadratic work.

use fluxform::shape::document::SurfaceFormat;

use crate::mutation::zipped;
use fluxform_testing::surface_files;

type Parts<'a> = &'a [(&'a str, String)];

fn archive(parts: Parts<'_>) -> Vec<u8> {
    let parts: Vec<(String, Vec<u8>)> = parts
        .iter()
        .map(|(name, text)| ((*name).to_owned(), text.clone().into_bytes()))
        .collect();
    zipped(&parts)
}

/// The file and, where it is packed, the bytes of its content that a reader may believe.
type Hostile = (&'static str, Vec<u8>);

/// Inputs for one format.
pub fn inputs(format: SurfaceFormat) -> Vec<Hostile> {
    match format {
        SurfaceFormat::Stl => stl(),
        SurfaceFormat::Obj => obj(),
        SurfaceFormat::Ply => ply(),
        SurfaceFormat::Off => off(),
        SurfaceFormat::Glb => glb(),
        SurfaceFormat::HeightImage => height_image(),
        SurfaceFormat::ThreeMf => three_mf(),
        SurfaceFormat::Amf => amf(),
        SurfaceFormat::ThreeDxml => three_dxml(),
        // Read by another program, in a process of its own: `tests/programs/step.rs` gives it such files.
        SurfaceFormat::Step => Vec::new(),
        SurfaceFormat::Sldprt => sldprt(),
    }
}

fn stl() -> Vec<Hostile> {
    let mut binary = vec![0u8; 84 + 50 * 20_000];
    binary[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                 endloop\nendfacet\n";
    vec![
        ("an enormous count", binary),
        (
            "solids without end",
            "solid\nendsolid\n".repeat(100_000).into_bytes(),
        ),
        (
            "facets and a cut",
            format!("solid\n{}facet", facet.repeat(12_000)).into_bytes(),
        ),
        (
            "one long word",
            [b"solid x\n".to_vec(), vec![b'9'; 2 << 20]].concat(),
        ),
        (
            "line ends",
            [b"solid x".to_vec(), vec![b'\n'; 2 << 20]].concat(),
        ),
    ]
}

fn obj() -> Vec<Hostile> {
    let points: String = (0..4000)
        .map(|k| format!("v {k} {} 0\n", (k % 2) * k))
        .collect();
    let ring: String = (1..=4000).map(|k| format!(" {k}")).collect();
    let corners = |n: usize| format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}\n", " 1 2 3".repeat(n));
    let spiral: String = (0..20_000)
        .map(|k| {
            let (turn, wide) = (0.05 * f64::from(k), 1.0 + 0.001 * f64::from(k));
            format!("v {} {} 0\n", wide * turn.cos(), wide * turn.sin())
        })
        .collect();
    let around: String = (1..=20_000).map(|k| format!(" {k}")).collect();
    vec![
        ("one face of many corners", corners(150_000).into_bytes()),
        ("a comb", format!("{points}f{ring}\n").into_bytes()),
        ("a spiral", format!("{spiral}f{around}\n").into_bytes()),
        (
            "smallest faces",
            format!("v 0 0 0\n{}", "f 1 1 1\n".repeat(200_000)).into_bytes(),
        ),
        (
            "lines continued",
            format!("v 0 0 0\nf \\\n{}", "1 \\\n".repeat(200_000)).into_bytes(),
        ),
        ("only continuations", "\\\n".repeat(500_000).into_bytes()),
        (
            "far indices",
            "v 0 0 0\nf 9223372036854775807 -9223372036854775808 1\n".into(),
        ),
    ]
}

fn ply() -> Vec<Hostile> {
    let head = |format: &str, vertices: u64, faces: u64, list: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float \
             y\nproperty float z\nelement face {faces}\nproperty list {list} vertex_indices\n\
             end_header\n"
        )
        .into_bytes()
    };
    let little = "binary_little_endian";
    let three = vec![0u8; 36];
    let faces = [3u8, 0, 1, 2].repeat(250_000);
    let huge = [[0xffu8; 4].as_slice(), &[0; 64]].concat();
    let properties = format!(
        "ply\nformat ascii 1.0\nelement vertex 1\n{}end_header\n",
        "property float q\n".repeat(60_000)
    );
    let elements: String = (0..40_000)
        .map(|k| format!("element e{k} 0\nproperty float x\n"))
        .collect();
    vec![
        (
            "counts beyond the file",
            head(little, u64::MAX / 2, u64::MAX / 2, "uchar int"),
        ),
        (
            "smallest faces",
            [
                head(little, 3, 250_000, "uchar uchar"),
                three.clone(),
                faces,
            ]
            .concat(),
        ),
        (
            "empty faces",
            [
                head(little, 3, 1_000_000, "uchar uchar"),
                three.clone(),
                vec![0; 1_000_000],
            ]
            .concat(),
        ),
        (
            "an enormous list",
            [head(little, 3, 1, "uint int"), three.clone(), huge.clone()].concat(),
        ),
        (
            "a negative list",
            [head(little, 3, 1, "int int"), three, huge].concat(),
        ),
        ("many properties", properties.into_bytes()),
        (
            "many elements",
            format!("ply\nformat ascii 1.0\n{elements}end_header\n").into_bytes(),
        ),
        (
            "an endless header",
            format!("ply\nformat ascii 1.0\n{}", "comment a\n".repeat(200_000)).into_bytes(),
        ),
    ]
}

const LAUGHS: &str = "<!DOCTYPE model [<!ENTITY a \"lol\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">\
    <!ENTITY c \"&b;&b;&b;&b;&b;&b;&b;&b;\"><!ENTITY d \"&c;&c;&c;&c;&c;&c;&c;&c;\">\
    <!ENTITY e \"&d;&d;&d;&d;&d;&d;&d;&d;\"><!ENTITY f \"&e;&e;&e;&e;&e;&e;&e;&e;\">]>";

/// The same XML with entities, deep nesting, many attributes, one enormous text.
fn xml(good: &str, root: &str) -> Vec<(&'static str, String)> {
    let open = format!("<{root}");
    let at = good.find(&open).unwrap_or(0);
    let (before, after) = good.split_at(at);
    let rest = &after[open.len().min(after.len())..];
    let attributes: String = (0..60_000).map(|k| format!(" a{k}=\"\"")).collect();
    let required: String = (0..30_000).map(|k| format!("p{k} ")).collect();
    let spaces: String = (0..30_000)
        .map(|k| format!(" xmlns:p{k}=\"/core/\""))
        .collect();
    vec![
        (
            "entities",
            format!("{before}{LAUGHS}<{root}{rest}").replace("\"1\"", "\"&f;\""),
        ),
        (
            "entities as text",
            format!("{before}{LAUGHS}<{root}>{}", "&f;".repeat(1000)),
        ),
        (
            "deep nesting",
            format!("{before}<{root}>{}", "<a>".repeat(300_000)),
        ),
        (
            "many attributes",
            format!("{before}<{root}{attributes}{rest}"),
        ),
        (
            "extensions",
            format!("{before}<{root}{spaces} requiredextensions=\"{required}\"{rest}"),
        ),
        (
            "empty elements",
            format!("{before}<{root}>{}</{root}>", "<a/>".repeat(300_000)),
        ),
        (
            "an open comment",
            format!("{before}<{root}><!--{}", "-".repeat(1 << 20)),
        ),
        (
            "text in pieces",
            format!("{before}<{root}>{}</{root}>", "a<!---->".repeat(200_000)),
        ),
        (
            "a long name",
            format!("{before}<{root}><{}/>", "n".repeat(1 << 20)),
        ),
    ]
}

/// An archive that unpacks to a thousand times its size.
fn bomb(names: &[&str], content: &str) -> Vec<Hostile> {
    let blank = format!("{content}{}", " ".repeat(100 << 20));
    let tags = format!("{content}{}", "<a/>".repeat(20 << 20));
    let parts = |text: &str| -> Vec<(String, Vec<u8>)> {
        names
            .iter()
            .map(|name| ((*name).to_owned(), text.as_bytes().to_vec()))
            .collect()
    };
    let honest = zipped(&parts(&blank));
    // The same with another length claimed in both headers.
    let mut lying = honest.clone();
    let claimed = (blank.len() as u32).to_le_bytes();
    let mut at = 0;
    while at + 4 <= lying.len() {
        if lying[at..at + 4] == claimed {
            lying[at..at + 4].copy_from_slice(&1000u32.to_le_bytes());
        }
        at += 1;
    }
    vec![
        ("a bomb of blanks", honest),
        ("a bomb that lies about its length", lying),
        ("a bomb of elements", zipped(&parts(&tags))),
    ]
}

fn three_mf() -> Vec<Hostile> {
    let good = String::from_utf8(surface_files::three_mf_model("inch")).expect("made of text");
    let mut found: Vec<Hostile> = xml(&good, "model")
        .into_iter()
        .map(|(name, text)| (name, surface_files::three_mf_of(&text)))
        .collect();
    found.extend(bomb(&["3D/3dmodel.model"], "<model>"));
    found.extend(bomb(&["_rels/.rels"], "<Relationships>"));
    let components = |n: usize, path: &str| format!("<component objectid=\"1\"{path}/>").repeat(n);
    let with = |components: &str| {
        good.replace(
            "<component objectid=\"1\" transform=\"1 0 0 0 1 0 0 0 1 0 0 0\"/>",
            components,
        )
    };
    let root = with(&components(100_000, ""));
    let mut parts: Vec<(String, Vec<u8>)> = (0..8000)
        .map(|k| {
            (
                format!("Metadata/a_rather_long_name_of_a_part_{k}.xml"),
                Vec::new(),
            )
        })
        .collect();
    parts.push(("3D/3dmodel.model".into(), root.clone().into_bytes()));
    found.push(("many parts, many components", zipped(&parts)));
    found.push(("many components", surface_files::three_mf_of(&root)));
    let apart = with(&components(20, " p:path=\"/3D/../../etc/passwd\""));
    found.push((
        "a path out of the archive",
        surface_files::three_mf_of(&apart),
    ));
    let itself = with(&components(2000, " p:path=\"/3D/3dmodel.model\""));
    found.push((
        "itself by another name",
        surface_files::three_mf_of(&itself),
    ));
    let faces = "<triangle v1=\"0\" v2=\"1\" v3=\"2\"/>".repeat(60_000);
    let many = good.replace("</triangles>", &format!("{faces}</triangles>"));
    found.push(("many faces, well packed", surface_files::three_mf_of(&many)));
    let objects: String = (3..20_000)
        .map(|k| format!("<object id=\"{k}\"/>"))
        .collect();
    let many = good.replace("</resources>", &format!("{objects}</resources>"));
    found.push(("many objects", surface_files::three_mf_of(&many)));
    found
}

fn amf() -> Vec<Hostile> {
    let good = surface_files::amf("mm");
    let mut found: Vec<Hostile> = xml(&good, "amf")
        .into_iter()
        .map(|(name, text)| (name, text.into_bytes()))
        .collect();
    found.extend(bomb(&["a.amf"], "<amf>"));
    let instances = "<instance objectid=\"1\"/>".repeat(60_000);
    let many = good.replace(
        "</amf>",
        &format!("<constellation id=\"9\">{instances}</constellation></amf>"),
    );
    found.push(("many instances", many.into_bytes()));
    let deep: String = (2..60_000)
        .map(|k| {
            format!(
                "<constellation id=\"{k}\"><instance objectid=\"{}\"/></constellation>",
                k - 1
            )
        })
        .collect();
    found.push((
        "a deep tree",
        good.replace("</amf>", &format!("{deep}</amf>"))
            .into_bytes(),
    ));
    found
}

fn three_dxml() -> Vec<Hostile> {
    let [manifest, structure, representation] = surface_files::three_dxml_parts();
    let product = |structure: &str, representation: &str| {
        archive(&[
            (manifest.0, manifest.1.clone()),
            ("P.3dxml", structure.to_owned()),
            ("R.3DRep", representation.to_owned()),
        ])
    };
    let mut found = Vec::new();
    for (name, text) in xml(&structure.1, "Model_3dxml") {
        found.push((name, product(&text, &representation.1)));
    }
    for (name, text) in xml(&representation.1, "XMLRepresentation") {
        found.push((name, product(&structure.1, &text)));
    }
    found.extend(bomb(&["Manifest.xml"], "<Manifest>"));
    let strips = format!("strips=\"{}\"", "0 1 2 ".repeat(200_000));
    let strip = representation.1.replace("strips=\"0 2 1 3\"", &strips);
    found.push(("long strips", product(&structure.1, &strip)));
    let reps: String = (100..20_100)
        .map(|k| {
            format!(
                "<ReferenceRep id=\"{k}\" format=\"TESSELLATED\" \
                 associatedFile=\"urn:3DXML:R.3DRep\"/>"
            )
        })
        .collect();
    let many = structure
        .1
        .replace("<InstanceRep", &format!("{reps}<InstanceRep"));
    found.push(("one part many times", product(&many, &representation.1)));
    let instances = "<Instance3D><IsAggregatedBy>1</IsAggregatedBy><IsInstanceOf>2</IsInstanceOf>\
                     </Instance3D>"
        .repeat(30_000);
    let many = structure
        .1
        .replace("<InstanceRep", &format!("{instances}<InstanceRep"));
    found.push(("many instances", product(&many, &representation.1)));
    found
}

fn off() -> Vec<Hostile> {
    vec![
        (
            "an enormous count",
            b"OFF 4000000000 4000000000 0\n0 0 0\n".to_vec(),
        ),
        (
            "comments",
            b"OFF\n"
                .iter()
                .copied()
                .chain(b"#\n".repeat(500_000))
                .collect(),
        ),
        (
            "a long face",
            format!(
                "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n60000 {}",
                "0 ".repeat(60_000)
            )
            .into_bytes(),
        ),
    ]
}

fn glb() -> Vec<Hostile> {
    let good = surface_files::glb();
    let mut found = Vec::new();
    for number in [&b"\"count\":4"[..], b"\"count\":9", b"\"byteLength\":72"] {
        let mut bytes = good.clone();
        if let Some(at) = bytes.windows(number.len()).position(|w| w == number) {
            // As long as the number and the blanks that follow allow.
            let end = at + number.len();
            bytes[end - 1] = b'9';
            found.push(("a claim", bytes));
        }
    }
    let mut length = good;
    length[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
    found.push(("an enormous length", length));
    found
}

fn height_image() -> Vec<Hostile> {
    let flat = vec![0; 2000 * 2000];
    let image = surface_files::height_image(2000, &flat, png::BitDepth::Eight);
    let mut claims = image.clone();
    // Width and height; the checksum of the header is then another.
    claims[16..24].fill(0x7f);
    let crc = crc32fast::hash(&claims[12..29]);
    claims[29..33].copy_from_slice(&crc.to_be_bytes());
    vec![("an enormous image", claims), ("a plane of zeros", image)]
}

fn sldprt() -> Vec<Hostile> {
    let marker = [0x14, 0, 0x06, 0, 0x08, 0];
    let head = [0x6b, 0x22, 0x77, 0x37, 0, 0, 0, 4];
    let mut claims = surface_files::sldprt();
    // The length unpacked, then that of the name.
    claims[26..30].copy_from_slice(&(1u32 << 30).to_le_bytes());
    let mut named = surface_files::sldprt();
    named[30..34].copy_from_slice(&u32::MAX.to_le_bytes());
    let table = |strips: u32, rest: &[u32]| -> Vec<u8> {
        [4, 8, 2, strips]
            .iter()
            .chain(rest)
            .flat_map(|w| w.to_le_bytes())
            .collect()
    };
    let threes = vec![3u32; 100_000];
    vec![
        ("markers", [head.to_vec(), marker.repeat(200_000)].concat()),
        ("an enormous block", claims),
        ("an enormous name", named),
        ("a bomb", surface_files::sldprt_of(&vec![0; 100 << 20])),
        (
            "decoys",
            surface_files::sldprt_blocks(&vec![
                ("Contents/DisplayLists", &[7u8; 2000][..], false);
                3000
            ]),
        ),
        (
            "tables that never end",
            surface_files::sldprt_of(&table(u32::MAX, &threes)),
        ),
        (
            "tables in tables",
            surface_files::sldprt_of(&table(100_000, &[]).repeat(40_000)),
        ),
        (
            "a long strip",
            surface_files::sldprt_of(
                &[
                    table(1, &[100_000, 12, 100, 2, 100_000]),
                    vec![0; 1_200_000],
                ]
                .concat(),
            ),
        ),
    ]
}
