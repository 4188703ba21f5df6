//! Points close to the steel: a value is its own point's, and its error is what is claimed.

// One test prints a table.
#![allow(clippy::print_stdout)]

use std::path::Path;

use fluxform::commands::probe::{ProbeRequest, ProbeTable, probe};
use fluxform::design::{Design, Need};
use fluxform::field::components::Components;
use fluxform::progress::Silent;

/// A coil of 24 and 38 mm, 100 mm long, around a core of `core`, `columns` of them in a row.
fn design(core: &str, columns: usize, magnet: &str) -> Design {
    let text = format!(
        "name = \"near\"\n[coil]\ninner_diameter_mm = 24.0\nouter_diameter_mm = 38.0\n\
         length_mm = 100.0\n[wire]\ndiameter_mm = 0.7\n[core]\n{core}\n\
         [array]\nrows = 1\ncolumns = {columns}\npitch_mm = 50.0\n\
         [magnet]\ndiameter_mm = 10.0\nlength_mm = 10.0\nmagnetization_a_per_m = 1.1579e6\n\
         {magnet}\n[supply]\ncurrent_max_a = 2.0\n[target]\nheight_mm = 40.0\n\
         [workspace]\nx_mm = [-50.0, 50.0, 5]\ny_mm = [-50.0, 50.0, 5]\nz_mm = [30.0, 80.0, 5]\n"
    );
    let (design, _) =
        Design::from_toml(&text, Path::new("near.toml"), Need::CALIBRATE).expect("a valid design");
    design
}

fn table(design: &Design, points_m: &[[f64; 3]], tolerance: f64, force: bool) -> ProbeTable {
    let request = ProbeRequest {
        components: Components::All,
        force,
        tolerance: Some(tolerance),
    };
    probe(design, points_m.to_vec(), request, &Silent).expect("points off the steel")
}

const FLUSH: &str = "relative_permeability = 1000.0\nbelow_mm = 10.0";
const PROUD: &str = "relative_permeability = 300.0\nabove_mm = 7.0\nclearance_mm = 0.5";
/// A proud core of long panels, whose value beside its top depended on the rows below it.
const TALL: &str = "relative_permeability = 628.6\nabove_mm = 30.0";
const RECESSED: &str = "relative_permeability = 30000.0\nabove_mm = -4.0";

/// Written row by row, so that bits are compared.
fn rows(table: &ProbeTable, coils: usize) -> Vec<String> {
    let mut csv = Vec::new();
    table.write(&mut csv).expect("memory");
    let text = String::from_utf8(csv).expect("text");
    let lines: Vec<&str> = text.lines().skip(1).collect();
    lines.chunks(coils).map(|rows| rows.join("\n")).collect()
}

#[test]
fn a_point_s_value_does_not_depend_on_the_other_rows() {
    let points = [
        [0.0078, 0.0, 0.016],
        [0.0, 0.0, 0.0143],
        [0.021, -0.003, 0.009],
        [0.03, 0.04, 0.071],
        [0.0, 0.001, 0.21],
        [-0.013, 0.0, 0.0083],
    ];
    for (columns, coupling) in [(1, ""), (2, "coupling = \"none\"")] {
        for core in [FLUSH, PROUD] {
            let mut design = design(core, columns, "model = \"cylinder\"");
            if !coupling.is_empty() {
                design.array.coupling = fluxform::design::Coupling::None;
            }
            for tolerance in [1e-2, 1e-4] {
                for force in [false, true] {
                    let points: Vec<[f64; 3]> = points
                        .into_iter()
                        .filter(|p| !force || p[2] > 0.0139)
                        .collect();
                    let all = rows(&table(&design, &points, tolerance, force), columns);
                    for (point, row) in points.iter().zip(&all) {
                        let alone = rows(&table(&design, &[*point], tolerance, force), columns);
                        assert_eq!(&alone[0], row, "{core} {tolerance:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_coarse_probe_near_the_steel_is_within_its_claim() {
    let places = [
        [0.0078, 0.0, 0.006],
        [0.0, 0.0, 0.0013],
        [0.0119, 0.0, 0.0004],
    ];
    for core in [FLUSH, PROUD, RECESSED, TALL] {
        let top_m = match core {
            PROUD => 0.007,
            TALL => 0.03,
            _ => 0.0,
        };
        let points: Vec<[f64; 3]> = places.iter().map(|[x, y, z]| [*x, *y, z + top_m]).collect();
        let design = design(core, 1, "");
        let tight = table(&design, &points, 1e-8, false);
        for tolerance in [1e-2, 1e-4, 1e-6] {
            let coarse = table(&design, &points, tolerance, false);
            assert!(
                coarse.relative_error <= tolerance,
                "{}",
                coarse.relative_error
            );
            assert!(coarse.accuracy_missed.is_empty());
            for (point, place) in points.iter().enumerate() {
                let [a, b] =
                    [&coarse, &tight].map(|table| table.field(point, 0).gradient_t_per_m_per_a);
                let (mut off, mut size) = (0.0_f64, 0.0_f64);
                for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
                    off = off.max((a - b).abs());
                    size += b * b;
                }
                // Relative to |grad B| at the point itself: more than is claimed.
                let part = off / size.sqrt() / coarse.relative_error;
                println!(
                    "{core:?} {:?}, {tolerance:e}: claimed {:.1e}, off {:.1e}",
                    points[point],
                    coarse.relative_error,
                    off / size.sqrt()
                );
                let most = if place[0] == 0.0 { 20.0 } else { 1.0 };
                assert!(part < most, "{core} {point} {tolerance:e}: {part}");
            }
        }
    }
}

/// Force on the magnet per ampere and |grad B| of coil 0 at every point, from the table's rows.
fn forces(table: &ProbeTable, coils: usize) -> Vec<([f64; 3], f64)> {
    let rows = rows(table, coils);
    let of_row = |(point, row): (usize, &String)| {
        let first = row.lines().next().expect("a row for each coil");
        let values: Vec<f64> = first
            .split(',')
            .map(|v| v.parse().expect("a number"))
            .collect();
        let force = values[values.len() - 6..][..3].try_into().expect("three");
        let gradient = table.field(point, 0).gradient_t_per_m_per_a;
        let square: f64 = gradient.as_flattened().iter().map(|g| g * g).sum();
        (force, square.sqrt())
    };
    rows.iter().enumerate().map(of_row).collect()
}

/// A rule whose weights cancel makes nothing of an error that is a field itself: the claim on a
/// cylinder over coupled cores was that error times the weights' magnitudes.
#[test]
fn the_claimed_error_of_a_force_over_cores_covers_it_without_the_weights() {
    const MOMENT_A_M2: f64 = 0.909_41;
    let points = [
        [0.025, 0.0, 0.03],
        [0.021, 0.003, 0.017],
        [0.013, -0.004, 0.041],
    ];
    println!("core, coupling, tolerance: claimed, true, true / claimed");
    for (columns, coupling, loose, tight) in [(1, "", 1e-4, 1e-6), (2, "full", 1e-4, 1e-5)] {
        for core in [FLUSH, RECESSED] {
            let design = design(
                core,
                columns,
                "model = \"cylinder\"\ntilt_deg = [10.0, -5.0]",
            );
            let exact = forces(&table(&design, &points, tight, true), columns);
            for point in 0..points.len() {
                let coarse = table(&design, &points[point..=point], loose, true);
                let claimed = coarse.force.as_ref().expect("a force").estimate;
                let (force, size) = forces(&coarse, columns)[0];
                let off = (0..3).map(|i| (force[i] - exact[point].0[i]).abs());
                let off = off.fold(0.0, f64::max) / (MOMENT_A_M2 * size);
                println!(
                    "{core:?}, {coupling:?}, {loose:e}: {claimed:.1e}, {off:.1e}, {:.3}",
                    off / claimed
                );
                assert!(off <= claimed, "{core} {point}: {off:e} of {claimed:e}");
                // The share of the magnet's dipoles counted in full, whatever they were off.
                assert!(claimed <= loose, "{core} {point}: {claimed:e}");
            }
        }
    }
}

/// Four cores of a kilometre once took three quarters of a minute to miss every tolerance.
#[test]
fn coupled_cores_without_an_end_are_refused_before_they_are_solved() {
    let design = design("below_mm = 1e6", 2, "");
    let refused = probe(
        &design,
        vec![[0.0, 0.0, 0.03]],
        ProbeRequest::default(),
        &Silent,
    );
    let message = refused.expect_err("too long").to_string();
    assert!(message.contains("radii long"), "{message}");
}
