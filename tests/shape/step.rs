//! STEP: real files against an independent reader's figures, and what is refused.

use std::path::Path;

use fluxform_shape::MeshReport;
use fluxform_shape::document::SurfaceFormat;

#[test]
fn a_box_is_a_box() {
    let read = SurfaceFormat::Step.read(
        Path::new("f.step"),
        &fluxform_testing::surface_files::step(),
    );
    let report = MeshReport::new(SurfaceFormat::Step, read.unwrap());
    assert_eq!((report.unit_m, report.watertight), (Some(1e-3), true));
    assert_eq!(report.triangles, 12);
    let volume = report.volume.unwrap();
    assert!((volume - 0.7 * 1.3 * 2.9).abs() < 1e-12, "{volume}");
    for (got, wanted) in report.bounds_max.iter().zip([0.7, 1.3, 2.9]) {
        assert!((got - wanted).abs() < 1e-12, "{got}");
    }
}

#[test]
fn what_is_no_body_is_refused_with_advice() {
    let refusal = |text: &str| {
        let read = SurfaceFormat::Step.read(Path::new("f.step"), text.as_bytes());
        read.unwrap_err().to_string()
    };
    assert!(refusal("solid x").contains("not a STEP file"));
    let empty = "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n";
    let said = refusal(empty);
    assert!(
        said.contains("no solid body") && said.contains("step_to_stl.py"),
        "{said}"
    );
    let lost = empty.replace("DATA;", "DATA;\n#1 = MANIFOLD_SOLID_BREP('', #2);");
    assert!(refusal(&lost).contains("no unit of length"));
}

/// They would be left out without a word.
#[test]
fn surfaces_beside_the_bodies_are_refused() {
    let good = String::from_utf8(fluxform_testing::surface_files::step()).unwrap();
    for kind in ["SHELL_BASED_SURFACE_MODEL", "FACETED_BREP"] {
        let text = good.replace("DATA;\n", &format!("DATA;\n#900 = {kind} ('',#1);\n"));
        let read = SurfaceFormat::Step.read(Path::new("f.step"), text.as_bytes());
        let said = read.unwrap_err().to_string();
        assert!(said.contains("beside solid bodies"), "{said}");
    }
}

/// The reader behind recurses: these would end the process, not the reading.
#[test]
fn what_leads_the_reader_down_without_end_is_refused() {
    let good = String::from_utf8(fluxform_testing::surface_files::step()).unwrap();
    let refusal = |text: &str| {
        let read = SurfaceFormat::Step.read(Path::new("f.step"), text.as_bytes());
        read.unwrap_err().to_string()
    };
    let brackets = format!("DATA;\n#9000=X({});\n", "(".repeat(500_000));
    let said = refusal(&good.replace("DATA;\n", &brackets));
    assert!(said.contains("nested more than 32 deep"), "{said}");
    let itself = "DATA;\n#9000=TRIMMED_CURVE('',#9000,(),(),.T.,.CARTESIAN.);\n";
    let said = refusal(&good.replace("DATA;\n", itself));
    assert!(said.contains("statement #9000 refers to itself"), "{said}");
    let chain: String = (9000..90_000)
        .map(|k| format!("#{k}=TRIMMED_CURVE('',#{},(),(),.T.,.CARTESIAN.);\n", k + 1))
        .collect();
    let said = refusal(&good.replace("DATA;\n", &format!("DATA;\n{chain}")));
    assert!(said.contains("longer than 200"), "{said}");
}
