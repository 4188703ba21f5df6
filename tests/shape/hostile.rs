//! Files made to exhaust a reader; each was found by `tests/fuzz`, or stands for its kind.

use fluxform_shape::document::SurfaceFormat;

use crate::formats::refusal;
use fluxform_testing::surface_files::{amf, three_mf_of, zipped};

/// A 3MF file that builds its object `last`; from the second on each is made of the one before
/// twice.
fn doubled(last: usize) -> Vec<u8> {
    let mut objects = String::new();
    for id in 2..=last {
        let before = format!("<component objectid=\"{}\"/>", id - 1);
        objects +=
            &format!("<object id=\"{id}\"><components>{before}{before}</components></object>");
    }
    let model = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    let start = model.find("<object id=\"2\"").unwrap();
    let end = model.find("</resources>").unwrap();
    let model = format!("{}{objects}{}", &model[..start], &model[end..]);
    let item = format!("<item objectid=\"{last}\"");
    three_mf_of(&model.replace("<item objectid=\"2\"", &item))
}

#[test]
fn a_decompression_bomb_is_stopped() {
    let bomb = format!("<model>{}</model>", " ".repeat(80 << 20));
    for (format, name) in [
        (SurfaceFormat::ThreeMf, "3D/3dmodel.model"),
        (SurfaceFormat::Amf, "a.amf"),
    ] {
        let bytes = zipped(&[(name, &bomb)]);
        assert!(bytes.len() < 1 << 20);
        let message = refusal(format, &bytes);
        assert!(message.contains("decompression bomb"), "{message}");
    }
    // Forty objects, each made of the one before twice: 2^40 bodies.
    let message = refusal(SurfaceFormat::ThreeMf, &doubled(41));
    assert!(message.contains("add up to more than"), "{message}");
    let deep = format!("<amf>{}", "<a>".repeat(1_000_000));
    assert!(refusal(SurfaceFormat::Amf, deep.as_bytes()).contains("nested more than"));
}

#[test]
fn what_an_archive_claims_to_unpack_to_is_held_against_its_length() {
    let honest = zipped(&[(
        "3D/3dmodel.model",
        &format!("<model>{}", " ".repeat(20 << 20)),
    )]);
    let message = refusal(SurfaceFormat::ThreeMf, &honest);
    assert!(message.contains("decompression bomb"), "{message}");
    // The same, claiming a thousand bytes in both headers.
    let claimed = ((20u32 << 20) + 7).to_le_bytes();
    let mut lying = honest;
    let mut changed = 0;
    for at in 0..lying.len() - 4 {
        if lying[at..at + 4] == claimed {
            lying[at..at + 4].copy_from_slice(&1000u32.to_le_bytes());
            changed += 1;
        }
    }
    assert_eq!(changed, 2);
    let message = refusal(SurfaceFormat::ThreeMf, &lying);
    assert!(message.contains("larger than its declared"), "{message}");
    let part = fluxform_testing::surface_files::sldprt_of(&vec![0; 20 << 20]);
    let message = refusal(SurfaceFormat::Sldprt, &part);
    assert!(message.contains("none of the 1 blocks"), "{message}");
}

#[test]
fn names_of_parts_lead_nowhere_outside_the_archive() {
    let model = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    for name in ["../../3D/3dmodel.model", "C:\\3D\\3dmodel.model"] {
        let message = refusal(SurfaceFormat::ThreeMf, &zipped(&[(name, &model)]));
        assert!(
            message.contains("`3D/3dmodel.model` is missing"),
            "{message}"
        );
    }
    let elsewhere = model.replace(
        "objectid=\"1\"",
        "p:path=\"/../../etc/passwd\" objectid=\"1\"",
    );
    let message = refusal(SurfaceFormat::ThreeMf, &three_mf_of(&elsewhere));
    assert!(
        message.contains("`/../../etc/passwd`, which is missing"),
        "{message}"
    );
}

#[test]
fn entities_of_xml_are_not_replaced() {
    let laughs = "<!DOCTYPE amf [<!ENTITY a \"0\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">]><amf";
    let bomb = amf("mm").replacen("<amf", laughs, 1);
    let text = bomb.replace("<v1>0</v1>", "<v1>&b;</v1>");
    refusal(SurfaceFormat::Amf, text.as_bytes());
    let model = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    let model = model.replacen("<model", &laughs.replace("amf", "model"), 1);
    let text = model.replace("v1=\"0\"", "v1=\"&b;\"");
    refusal(SurfaceFormat::ThreeMf, &three_mf_of(&text));
}

#[test]
fn extensions_without_end_are_refused() {
    let model = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    for (count, said) in [
        (100, "more than 64 extensions"),
        (20_000, "more than 128 namespaces"),
    ] {
        let spaces: String = (0..count)
            .map(|k| format!(" xmlns:p{k}=\"/core/\""))
            .collect();
        let required: String = (0..count).map(|k| format!("p{k} ")).collect();
        let open = format!("<model{spaces} requiredextensions=\"{required}\" ");
        let text = model.replacen("<model ", &open, 1);
        let message = refusal(SurfaceFormat::ThreeMf, &three_mf_of(&text));
        assert!(message.contains(said), "{message}");
    }
}

#[test]
fn a_small_file_does_not_unfold_into_a_large_one() {
    // Twenty-two objects, each made of the one before twice: sixteen million triangles.
    let message = refusal(SurfaceFormat::ThreeMf, &doubled(23));
    assert!(message.contains("the file's 4 triangles"), "{message}");
}

/// Ten thousand objects, each in the next, built from the innermost on: the outer ones were never
/// found to be deep, and laying them out went as deep as they lay.
#[test]
fn a_chain_of_bodies_is_refused_from_whichever_end_it_is_met() {
    let model = String::from_utf8(fluxform_testing::surface_files::three_mf_model("inch")).unwrap();
    let (objects, items): (String, String) = (3..10_000)
        .map(|id| {
            let before = id - 1;
            let object = format!(
                "<object id=\"{id}\"><components><component objectid=\"{before}\"/></components>\
                 </object>"
            );
            let item = if id % 60 == 0 {
                format!("<item objectid=\"{id}\"/>")
            } else {
                String::new()
            };
            (object, item)
        })
        .unzip();
    let model = model
        .replace("</resources>", &format!("{objects}</resources>"))
        .replace("</build>", &format!("{items}</build>"));
    let message = refusal(SurfaceFormat::ThreeMf, &three_mf_of(&model));
    assert!(message.contains("nested more than 64 deep"), "{message}");
}

#[test]
fn a_face_of_very_many_corners_is_refused() {
    let obj = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\nf{}\n", " 1 2 3".repeat(20_000));
    let message = refusal(SurfaceFormat::Obj, obj.as_bytes());
    assert!(
        message.contains("line 4") && message.contains("50000 corners"),
        "{message}"
    );
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list uint int vertex_index\nend_header\n\
         0 0 0\n1 0 0\n0 1 0\n60000{}\n",
        " 0 1 2".repeat(20_000)
    );
    let message = refusal(SurfaceFormat::Ply, ply.as_bytes());
    assert!(
        message.contains("face 0") && message.contains("50000 corners"),
        "{message}"
    );
}

#[test]
fn a_message_does_not_quote_a_name_of_any_length() {
    let name = "n".repeat(1 << 20);
    let lost = amf("mm").replace(
        "</amf>",
        &format!("<constellation id=\"9\"><instance objectid=\"{name}\"/></constellation></amf>"),
    );
    let message = refusal(SurfaceFormat::Amf, lost.as_bytes());
    assert!(message.len() < 1000, "{}", message.len());
    assert!(
        message.contains("places `nnn") && message.ends_with("which is missing"),
        "{message}"
    );
}
