//! The drawing of a map: its numbers are the map's.

use std::path::Path;

use fluxform::bundle::npz::from_npz;
use fluxform::bundle::write::MapFormats;
use fluxform::commands::map::{self, MapRequest};
use fluxform::commands::probe::{ProbeRequest, probe};
use fluxform::design::{Design, Need};
use fluxform::map::Components;
use fluxform::plot::slices::{Slice, SliceLine, SlicesPlot};
use fluxform::progress::Silent;
use fluxform::scene::Scene;
use fluxform::scene::field_slice;
use fluxform_testing::inputs::{AIR, TWO};

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
                plot.slices[0].values[place].expect("a force"),
                force(&map.gz_t_per_m_per_a, place),
            ),
            (
                plot.slices[1].values[place].expect("a force"),
                force(sides_x, place),
            ),
            (
                plot.slices[3].values[place].expect("a force"),
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

/// Two coils in air, with cores that answer to all windings or to their own, and with a plate below.
#[test]
fn a_field_s_drawing_shows_what_a_probe_finds() {
    let core = TWO
        .lines()
        .find(|line| line.starts_with("core"))
        .expect("a core");
    let alone = TWO.replace("pitch_mm = 43.0", "pitch_mm = 43.0, coupling = \"none\"");
    let plate =
        "[plate]\nthickness_mm = 6.0\nx_mm = 70.0\ny_mm = 40.0\nrelative_permeability = 700.0\n";
    for text in [
        TWO.replace(core, ""),
        TWO.to_owned(),
        alone,
        format!("{TWO}{plate}"),
    ] {
        let (design, _) = Design::from_toml(&text, Path::new("two.toml"), Need::EVALUATE)
            .unwrap_or_else(|fault| panic!("{fault}\n{text}"));
        let plot = field_slice::picture(&design, &Silent)
            .expect("a field")
            .expect("a coil");
        let [section, above] = &plot.slices[..] else {
            panic!("{} slices", plot.slices.len());
        };
        let currents = Scene::new(&design).expect("a scene").upper_a;
        let place = |slice: &Slice, cell: usize| {
            let at = |axis: usize, k: usize, count: usize| {
                let [from, to] = slice.ends_m[axis];
                from + (to - from) * (k as f64 + 0.5) / count as f64
            };
            let rows = slice.values.len() / slice.columns;
            [
                at(0, cell % slice.columns, slice.columns),
                0.0,
                at(1, cell / slice.columns, rows),
            ]
        };
        let cells = |slice: &Slice| {
            let all: Vec<usize> = (0..slice.values.len()).step_by(97).collect();
            all.into_iter()
                .filter(|cell| slice.values[*cell].is_some())
                .collect::<Vec<_>>()
        };
        for (slice, upward) in [(section, false), (above, true)] {
            let cells = cells(slice);
            assert!(cells.len() > 20);
            let places = cells.iter().map(|cell| place(slice, *cell)).collect();
            let request = ProbeRequest::default();
            let table = probe(&design, places, request, &Silent).expect("a field");
            let most = slice
                .values
                .iter()
                .flatten()
                .fold(0.0_f64, |most, v| most.max(v.abs()));
            for (point, cell) in cells.iter().enumerate() {
                let mut field = [0.0; 3];
                for (coil, current) in currents.iter().enumerate() {
                    let own = table.field(point, coil).field_t_per_a;
                    field
                        .iter_mut()
                        .zip(own)
                        .for_each(|(sum, own)| *sum += current * own);
                }
                let size = field.iter().map(|part| part * part).sum::<f64>().sqrt();
                let expected = if upward { field[2] } else { size };
                let shown = slice.values[*cell].expect("chosen so");
                assert!(
                    (shown - expected).abs() < 0.01 * most,
                    "{shown:e} {expected:e}\n{text}"
                );
            }
        }
        let lines = section
            .lines
            .iter()
            .filter(|line| line.stroke == SliceLine::FIELD);
        assert!(lines.count() > 10);
        let svg = plot.drawing().svg();
        for text in [
            "|B| / mT at y = 0 mm, with field lines",
            "B_z / mT at y = 0 mm",
            "z / mm",
        ] {
            assert!(svg.contains(text), "{text}");
        }
    }
}
