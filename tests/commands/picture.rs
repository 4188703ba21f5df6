//! The drawing of a map: its numbers are the map's.

use std::path::Path;

use fluxform::bundle::npz::from_npz;
use fluxform::bundle::write::MapFormats;
use fluxform::commands::map::{self, MapRequest};
use fluxform::design::{Design, Need};
use fluxform::map::Components;
use fluxform::plot::slices::SlicesPlot;
use fluxform::progress::Silent;
use fluxform_testing::inputs::AIR;

fn drawn(components: Components, out: &Path) -> SlicesPlot {
    let (design, _) = Design::from_toml(AIR, Path::new("air.toml"), Need::MAP).expect("valid");
    let request = MapRequest {
        components,
        tolerance: None,
        error: None,
        currents_a: None,
        out: out.to_path_buf(),
        formats: MapFormats::default(),
        mag_manip: Default::default(),
        force: false,
        picture: true,
    };
    let report = map::run(&design, Vec::new(), &request, &Silent).expect("a map");
    report.picture.expect("a drawing")
}

#[test]
fn a_maps_drawing_shows_the_force_of_its_own_numbers() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let plot = drawn(Components::Force, out.path());
    let titles: Vec<&str> = plot.slices.iter().map(|s| s.title[0].as_str()).collect();
    assert_eq!(titles, ["F_z", "F_x", "F_y", "F_z", "F_x"]);
    let bytes = std::fs::read(out.path().join("map.npz")).expect("written");
    let map = from_npz(&bytes).expect("a map");
    let nodes = 21 * 21 * 21;
    let force = |values: &[f64], node: usize| -> f64 {
        let currents = map.runtime.current_max_a.iter().enumerate();
        let sum: f64 = currents
            .map(|(coil, i)| i * values[coil * nodes + node])
            .sum();
        map.runtime.moment_a_m2[2] * sum
    };
    // The target's height is the lowest node; the section goes through the row at y = -21 mm.
    let [sides_x, _] = map.sides_t_per_m_per_a.as_ref().expect("sides");
    for place in [0, 137, 440] {
        let pairs = [
            (
                plot.slices[0].values_n[place],
                force(&map.gz_t_per_m_per_a, place),
            ),
            (plot.slices[1].values_n[place], force(sides_x, place)),
            (
                plot.slices[3].values_n[place],
                force(
                    &map.gz_t_per_m_per_a,
                    place / 21 * 441 + 3 * 21 + place % 21,
                ),
            ),
        ];
        for (shown, expected) in pairs {
            assert!(
                (shown / expected - 1.0).abs() < 1e-9,
                "{place}: {shown:e} {expected:e}"
            );
        }
    }
    // Four coils in air are alike, and push less the higher the magnet is.
    assert_eq!(plot.curves.len(), 1);
    assert_eq!(plot.curves[0].name, "coils 0, 1, 2, 3");
    let forces: Vec<f64> = plot.curves[0].points.iter().map(|point| point.1).collect();
    assert!(forces.len() == 21 && forces.is_sorted_by(|a, b| a > b) && forces[20] > 0.0);
}

#[test]
fn a_map_of_the_upward_gradient_alone_is_drawn_without_sideways_forces() {
    let out = tempfile::tempdir().expect("a temporary folder");
    let plot = drawn(Components::Gz, out.path());
    assert_eq!(plot.slices.len(), 2);
    let svg = plot.drawing().svg();
    for text in [
        "F_z / mN at z = 30 mm",
        "F_z / mN at y = -21 mm",
        "z / mm",
        "coils 0, 1, 2, 3",
    ] {
        assert!(svg.contains(text), "{text}");
    }
}
