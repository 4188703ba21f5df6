//! The STL readers: real files, damaged files, and the messages.

use fluxform_shape::document::SurfaceFormat;
use fluxform_shape::stl::{read, stream};

use fluxform_testing::surfaces::binary;

const ONE: [[f32; 3]; 3] = [[0.7, -1.3, 2.9], [10.1, 0.3, 3.1], [-4.7, 8.3, 2.3]];

fn ascii(vertices: &str) -> String {
    format!("solid s\nfacet normal 0 0 1\nouter loop\n{vertices}\nendloop\nendfacet\nendsolid s\n")
}

#[test]
fn length_decides_before_the_word_solid() {
    let mut bytes = binary(&[ONE, ONE]);
    for header in [
        &b"solid part\nfacet normal 0 0 1"[..],
        b"ISO-10303-21",
        b"<html",
        b"version https://git-lfs",
    ] {
        bytes[..header.len()].copy_from_slice(header);
        assert_eq!(read(&bytes).unwrap().triangles.len(), 2);
    }
    assert_eq!(
        read(&bytes).unwrap().triangles[1],
        ONE.map(|v| v.map(f64::from))
    );
}

#[test]
fn a_binary_file_with_every_length_is_read_or_refused() {
    let whole = binary(&[ONE; 5]);
    for length in 0..whole.len() {
        let error = read(&whole[..length]).unwrap_err();
        let message = error.to_string();
        match length {
            0 => assert!(message.contains("0 bytes"), "{message}"),
            1..=80 => assert!(message.contains("blank"), "{length}: {message}"),
            81..=83 => assert!(message.contains(&format!("{length} bytes")), "{message}"),
            _ => assert!(
                message.contains("claims 5") && message.contains(&format!("{length} bytes"))
            ),
        }
    }
}

#[test]
fn a_lying_count_reserves_nothing() {
    // 4e9 triangles would be 288 GB: were they reserved, this would abort or swap.
    for claimed in [1u32, 3, 1000, 0x7fff_ffff, u32::MAX] {
        let mut bytes = binary(&[ONE, ONE]);
        bytes[80..84].copy_from_slice(&claimed.to_le_bytes());
        let message = read(&bytes).unwrap_err().to_string();
        assert!(
            message.contains(&format!("claims {claimed} triangles")),
            "{message}"
        );
    }
    let message = read(&binary(&[])).unwrap_err().to_string();
    assert!(message.contains("holds no triangle"), "{message}");
}

#[test]
fn not_finite_vertices_are_named_and_denormal_ones_are_numbers() {
    for (value, found) in [
        (f32::NAN, "NaN"),
        (f32::INFINITY, "inf"),
        (f32::NEG_INFINITY, "-inf"),
    ] {
        let mut triangles = [ONE; 4];
        triangles[2][1][2] = value;
        let message = read(&binary(&triangles)).unwrap_err().to_string();
        let byte = 84 + 2 * 50 + 12 + 5 * 4;
        let place = format!("vertex 2 of triangle 3 (byte {byte})");
        assert!(
            message.contains(&place) && message.contains(found),
            "{message}"
        );
    }
    let mut small = ONE;
    small[1][2] = 1e-41;
    assert_eq!(
        read(&binary(&[small])).unwrap().triangles[0][1][2],
        f64::from(1e-41f32)
    );
    // Stored normals are not trusted, so they may be anything.
    let mut bytes = binary(&[ONE]);
    bytes[84..88].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(read(&bytes).is_ok());
}

#[test]
fn text_is_read_however_it_is_written() {
    let plain = ascii("vertex 0.7 -1.3 2.9\nvertex 10.1 .3 3.1\nvertex -4.7 +8.3 23.e-1");
    let expected = [[0.7, -1.3, 2.9], [10.1, 0.3, 3.1], [-4.7, 8.3, 2.3]];
    let variants = [
        plain.clone().into_bytes(),
        plain.replace('\n', "\r\n").into_bytes(),
        plain.replace('\n', "\r").into_bytes(),
        plain.to_uppercase().into_bytes(),
        format!("\u{feff}{plain}").into_bytes(),
        format!("\n\n   {plain}\n\n").into_bytes(),
        plain
            .replace('\n', "\n\t  ")
            .replace(' ', "   ")
            .into_bytes(),
        plain
            .replace("2.9", "2.9e+000")
            .replace("8.3", "830.0E-002")
            .into_bytes(),
        plain.replace("0 0 1", "nan -nan(ind) 1.#QNAN").into_bytes(),
        plain.replace(" normal 0 0 1", "").into_bytes(),
        [
            b"solid t\xeate facet vertex\n",
            plain.split_once('\n').unwrap().1.as_bytes(),
        ]
        .concat(),
        [
            b"solid \0\x01\x02\n",
            plain.split_once('\n').unwrap().1.as_bytes(),
        ]
        .concat(),
    ];
    for text in variants {
        let mesh = read(&text).unwrap();
        assert_eq!(
            mesh.triangles,
            [expected],
            "{}",
            String::from_utf8_lossy(&text)
        );
        assert!(mesh.warnings.is_empty());
    }
}

#[test]
fn faults_in_a_text_have_their_line() {
    let good = "vertex 0.7 1.3 2.9\nvertex 3 1 4\nvertex 5 9 2";
    let cases = [
        (
            ascii(good).replace("3 1 4", "3 1,5 4"),
            "line 5, triangle 1",
            "decimal point",
        ),
        (
            ascii(good).replace("3 1 4", "3 1"),
            "line 6, triangle 1",
            "`vertex`",
        ),
        (
            ascii(good).replace("3 1 4", "3 1 -1e400"),
            "line 5, triangle 1",
            "too large",
        ),
        (
            ascii(good).replace("3 1 4", "3 infinity 4"),
            "line 5, triangle 1",
            "not a finite",
        ),
        (
            ascii(&format!("{good}\nvertex 1 2 3")),
            "line 7, triangle 1",
            "triangles only",
        ),
        (
            ascii("vertex 0.7 1.3 2.9\nvertex 3 1 4"),
            "line 6, triangle 1",
            "expected `vertex`",
        ),
        (
            ascii(good).replace("outer", "inner"),
            "line 3, triangle 1",
            "`outer loop`",
        ),
        (
            ascii(good).replace("endsolid s", "vertex"),
            "line 9",
            "`facet` or `endsolid`",
        ),
        (
            ascii(good).replace("endsolid s", "endsolid s\nrubbish"),
            "line 10",
            "expected `solid`",
        ),
        (ascii(good)[..70].to_string(), "triangle 1", "cut short"),
        (
            "solid waste report\n\nof 1998".into(),
            "line 3",
            "found `of`",
        ),
        (
            "some other text".into(),
            "line 1",
            "expected `solid`, found `some`",
        ),
        ("solid".into(), "line 1", "cut short"),
    ];
    for (text, place, what) in cases {
        for text in [
            text.clone(),
            text.replace('\n', "\r\n"),
            text.replace('\n', "\r"),
        ] {
            let message = read(text.as_bytes()).unwrap_err().to_string();
            assert!(
                message.contains(place) && message.contains(what),
                "{text:?}: {message}"
            );
        }
    }
}

#[test]
fn what_is_no_stl_is_called_by_its_name() {
    let zip = fluxform_testing::surface_files::three_mf("inch");
    let step = fluxform_testing::surface_files::step();
    let part = fluxform_testing::surface_files::sldprt();
    let cases: [(&[u8], &str); 11] = [
        (b"<!DOCTYPE html>\n<html>", "web page"),
        (b"\r\n <HTML lang=en>", "web page"),
        (
            b"version https://git-lfs.github.com/spec/v1",
            "git lfs pull",
        ),
        (&zip, "a 3MF file"),
        (b"\x1f\x8b\x08\x00\x00", "gzip"),
        (&step, "a STEP file"),
        (&part, "SOLIDWORKS file"),
        (b"\xff\xfes\0o\0l\0i\0d\0", "cut short"),
        (
            b"ply\nformat ascii 1.0\n",
            "a PLY file: give it the ending .ply",
        ),
        (b"glTF\x02\0\0\0", "a GLB file"),
        (b"  \n\t ", "blank"),
    ];
    for (bytes, what) in cases {
        let read = SurfaceFormat::Stl.read(std::path::Path::new("f"), bytes);
        let message = read.unwrap_err().to_string();
        assert!(message.contains(what), "{message}");
    }
}

#[test]
fn the_rounding_is_that_of_the_number_format() {
    let float = read(&binary(&[ONE])).unwrap().coordinate_rounding;
    assert!((float / f64::from(10.1f32) - 2f64.powi(-24)).abs() < 1e-12);
    let text = |largest: &str| {
        let vertices = format!("vertex 0 0 0\nvertex {largest} 0 0\nvertex 0 3 0");
        read(ascii(&vertices).as_bytes())
            .unwrap()
            .coordinate_rounding
    };
    // Seven printed digits of 355.6: the last is a 1e-4.
    assert!((text("3.556000e+002") - 0.5e-4).abs() < 1e-18);
    assert!((text("10.12345") - 0.5e-5).abs() < 1e-18);
    // Short numbers are what they say; many digits still come from floats as a rule,
    assert!((text("100") - 100.0 * 2f64.powi(-24)).abs() < 1e-18);
    let float = f64::from(100.123_45f32);
    assert!((text(&float.to_string()) - float * 2f64.powi(-24)).abs() < 1e-18);
    // unless they show that they do not.
    assert!((text("100.12345678901") - 0.5e-11).abs() < 1e-20);
}

#[test]
fn a_file_read_in_pieces_is_the_same_mesh() {
    let in_pieces = |bytes: &[u8]| stream(bytes, bytes.len() as u64).unwrap();
    // No piece, a part of one, whole ones, and some more.
    for count in [0usize, 1, 8191, 8192, 8193, 20_000] {
        let triangles: Vec<_> = (0..count)
            .map(|k| ONE.map(|v| v.map(|c| c + k as f32)))
            .collect();
        let mut bytes = binary(&triangles);
        assert_eq!(in_pieces(&bytes), Some(read(&bytes)), "{count}");
        if count > 1 {
            let last = bytes.len() - 6;
            bytes[last..last + 4].copy_from_slice(&f32::NEG_INFINITY.to_le_bytes());
            assert_eq!(in_pieces(&bytes), Some(read(&bytes)));
            let message = read(&bytes).unwrap_err().to_string();
            assert!(message.contains(&format!("triangle {count} ")), "{message}");
            bytes.pop();
            assert_eq!(in_pieces(&bytes), None);
            // A file that shrinks while it is read.
            assert!(stream(bytes.as_slice(), bytes.len() as u64 + 1).is_err());
        }
    }
    let text = ascii("vertex 0.7 -1.3 2.9\nvertex 10.1 .3 3.1\nvertex -4.7 +8.3 2.3");
    for bytes in [text.as_bytes(), b"", b"solid"] {
        assert_eq!(in_pieces(bytes), None);
    }
}

/// Headers and attributes of Materialise, VisCAM, CATIA and others: 80 bytes and two a triangle.
#[test]
fn headers_and_colours_of_binary_files_are_passed_over() {
    let plain = binary(&[ONE, ONE]);
    let headers: [&[u8]; 6] = [
        b"COLOR=\xff\x80\x40\xff,MATERIAL=\0\0\0\0\xff\xff\xff\xff\0\0\0\0",
        b"CATIA V5 STL",
        b"solid MATRIX 3.0 exported",
        b"STLB ATF 12.9.0 COLOR=    ",
        b"Exported from Blender-4.2.0",
        b"numpy-stl\tSolidWorks\r\n",
    ];
    for header in headers {
        for attribute in [0u16, 0x8000, 0x7fff, 0xffff] {
            let mut bytes = plain.clone();
            bytes[..header.len()].copy_from_slice(header);
            for record in bytes[84..].chunks_exact_mut(50) {
                record[48..].copy_from_slice(&attribute.to_le_bytes());
            }
            assert_eq!(read(&bytes), read(&plain));
        }
    }
}
