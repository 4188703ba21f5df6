//! STEP: real files against an independent reader's figures, and what is refused.

use std::path::Path;

use fluxform_shape::MeshReport;
use fluxform_shape::document::SurfaceFormat;

use crate::support::corpus;

/// Volume in mm^3 and box in mm by OpenCASCADE at a chord of 0.05 mm.
const TRUTH: [(&str, f64, [f64; 6]); 2] = [
    (
        "trimesh__base_interface_AP203.STEP",
        1.25799e6,
        [-299.706, -319.311, -2.38125, 299.706, 319.311, 2.38125],
    ),
    (
        "trimesh__featuretype.STEP",
        190_532.0,
        [-63.5, -31.75, 0.0, 63.5, 31.75, 34.925],
    ),
];

#[test]
#[allow(clippy::print_stderr)]
fn real_bodies_are_those_of_another_reader() {
    let Some(folder) = corpus() else { return };
    for (name, volume_mm3, bounds_mm) in TRUTH {
        let report = MeshReport::of_file(&folder.join(name)).unwrap();
        let mm = report.unit_m.unwrap() * 1000.0;
        assert_eq!(mm, 25.4, "{name}");
        eprintln!(
            "{name}: {} triangles, volume {:?} mm3, {:?} {:?}, watertight {}",
            report.triangles,
            report.volume.map(|v| v * mm.powi(3)),
            report.bounds_min.map(|c| c * mm),
            report.bounds_max.map(|c| c * mm),
            report.watertight
        );
        let got = report.volume.unwrap() * mm.powi(3);
        assert!(
            (got - volume_mm3).abs() < 2e-3 * volume_mm3,
            "{name}: {got}"
        );
        for (k, wanted) in bounds_mm.iter().enumerate() {
            let got = [report.bounds_min, report.bounds_max][k / 3][k % 3] * mm;
            let most = report.deviation * mm + 0.05;
            assert!((got - wanted).abs() < most, "{name}: {got} {wanted}");
        }
    }
}

#[test]
fn a_box_is_a_box() {
    let read = SurfaceFormat::Step.read(Path::new("f.step"), &crate::samples::step());
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
fn an_assembly_is_refused_with_advice() {
    let Some(folder) = corpus() else { return };
    let result = MeshReport::of_file(&folder.join("trimesh__box_sides.STEP"));
    let said = result.unwrap_err().to_string();
    assert!(
        said.contains("it is an assembly") && said.contains("step_to_stl.py"),
        "{said}"
    );
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
    let good = String::from_utf8(crate::samples::step()).unwrap();
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
    let good = String::from_utf8(crate::samples::step()).unwrap();
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
