//! STEP: real files against an independent reader's figures.

use fluxform_shape::MeshReport;
use fluxform_testing::needs::{self, Trial, corpus_folder};
use fluxform_testing::trials;

pub fn trials() -> Vec<Trial> {
    trials! {
        needs::corpus() => [
            real_bodies_are_those_of_another_reader,
            an_assembly_is_refused_with_advice,
        ],
    }
}

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

#[allow(clippy::print_stderr)]
fn real_bodies_are_those_of_another_reader() {
    let folder = corpus_folder();
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

fn an_assembly_is_refused_with_advice() {
    let folder = corpus_folder();
    let result = MeshReport::of_file(&folder.join("trimesh__box_sides.STEP"));
    let said = result.unwrap_err().to_string();
    assert!(
        said.contains("it is an assembly") && said.contains("step_to_stl.py"),
        "{said}"
    );
}
