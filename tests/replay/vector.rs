//! Bundles that request a force vector: their maps against the field, and eq. 8 with three rows along
//! trajectories.

// The largest changes per micrometre are printed with --nocapture.
#![allow(clippy::print_stdout)]

use fluxform::bundle::replay::Answer;
use fluxform::commands::probe::{ProbeRequest, probe};
use fluxform::commands::replay::renderer::{Renderer, Step};
use fluxform::commands::replay::run;
use fluxform::commands::replay::summary::TrajectorySource;
use fluxform::commands::replay::synthesize::{Kind, Synthesis};
use fluxform::design::{Design, Need};
use fluxform::progress::Silent;
use fluxform_testing::{Random, root};

use crate::support::along_the_normal;

fn anywhere(renderer: &Renderer, random: &mut Random) -> [f64; 3] {
    let ends = renderer.map().ends_m();
    ends.map(|[from, to]| from + (to - from) * random.unit())
}

#[test]
fn interpolated_vectors_are_those_of_the_field_within_the_stated_errors() {
    let opened = along_the_normal().open("half-sphere");
    let bundle = &opened.bundle;
    let text = std::fs::read_to_string(bundle.folder.join("design.toml")).unwrap();
    let path = root().join("designs/seed_air.toml");
    let (design, _) = Design::from_toml(&text, &path, Need::CALIBRATE).unwrap();
    let mut random = Random::new(17);
    let places: Vec<[f64; 3]> = (0..1000)
        .map(|_| anywhere(&opened.renderer, &mut random))
        .collect();
    let request = ProbeRequest {
        force: true,
        ..ProbeRequest::default()
    };
    let table = probe(&design, places.clone(), request, &Silent).unwrap();
    let exact: Vec<[f64; 3]> = (table.forces().iter())
        .map(|[x, y, z, ..]| [*x, *y, *z])
        .collect();
    let coils = table.coils();
    let map = &bundle.manifest.map;
    let [x, y] = map.sides.as_ref().unwrap().largest_error;
    let stated = [x, y, map.interpolation.largest_error];
    // Errors are relative to a component's largest value at the height, which is no less than here.
    for axis in 0..3 {
        let mut largest = vec![0.0_f64; 100];
        let layer = |z: f64| (z * 1e3) as usize;
        for (place, forces) in places.iter().zip(exact.chunks_exact(coils)) {
            for force in forces {
                let own = &mut largest[layer(place[2])];
                *own = own.max(force[axis].abs());
            }
        }
        let mut worst = 0.0_f64;
        for (place, forces) in places.iter().zip(exact.chunks_exact(coils)) {
            let mut found = vec![[f64::NAN; 3]; coils];
            assert_eq!(
                bundle.force_vector_per_ampere(*place, &mut found),
                Some(true)
            );
            for (a, b) in found.iter().zip(forces) {
                let error = (a[axis] - b[axis]).abs() / largest[layer(place[2])];
                worst = worst.max(error);
            }
        }
        // Few places of a layer hit its largest value.
        assert!(worst <= 2.0 * stated[axis], "{axis}: {worst} of {stated:?}");
    }
}

#[test]
fn the_vector_is_met_where_it_is_within_reach() {
    let opened = along_the_normal().open("half-sphere");
    let synthesis = Synthesis {
        kind: Kind::Explore,
        seed: 3,
        duration_s: 40.0,
        rate_hz: 50.0,
    };
    let trajectory = opened.synthesize(&synthesis);
    let source = TrajectorySource {
        source: "made up".to_owned(),
        input: None,
        synthesis: Some(synthesis),
    };
    let report = run(&opened, &trajectory, source, false, &Silent).unwrap();
    let rows = &report.rows;
    let mut tilted = 0;
    for row in 0..rows.len() {
        if rows.first.answer[row] != Answer::Ok {
            continue;
        }
        let ([wx, wy], [fx, fy]) = (
            rows.first.wanted_sideways_n[row],
            rows.first.sideways_n[row],
        );
        let size = wx.hypot(wy).hypot(rows.first.wanted_force_n[row]);
        assert!((wx - fx).hypot(wy - fy) <= 1e-9, "{row}");
        assert!(
            rows.first.error_n(row).abs() <= 1e-9 && rows.first.direction_error_deg(row) < 1e-4
        );
        // Along the normal the whole force is lambda times the height, less where normals are mixed.
        let whole = opened.renderer.lambda_n_per_m() * rows.first.height_m[row];
        assert!(size <= whole * (1.0 + 1e-9), "{row}: {size} of {whole}");
        tilted += usize::from(wx.hypot(wy) > 0.3 * whole && whole > 0.0);
    }
    assert!(tilted > 50, "{tilted}");
    let vector = report.summary.force.vector.unwrap();
    assert!(vector.direction_median_deg < 1e-4);
    let mut table = Vec::new();
    rows.write(&mut table).unwrap();
    let header = String::from_utf8(table).unwrap();
    assert!(header.contains("wanted_x_n,wanted_y_n,force_x_n,force_y_n,direction_error_deg,"));
}

/// The largest change of a force component (N) and, within reach, of a current (A) from step to step, and
/// where each is.
fn changes(renderer: &mut Renderer, from: [f64; 3], to: [f64; 3], steps: usize) -> [(f64, f64); 2] {
    let mut last: Option<(Vec<f64>, Step)> = None;
    let mut largest = [(0.0_f64, 0.0_f64); 2];
    for k in 0..=steps {
        let t = k as f64 / steps as f64;
        let at = std::array::from_fn(|axis| from[axis] + t * (to[axis] - from[axis]));
        let mut currents = vec![0.0; renderer.coils()];
        let step = renderer.step(at, &mut currents);
        if let Some((before, earlier)) = &last {
            let force = |step: &Step| {
                let [x, y] = step.sideways.unwrap().force_n;
                [x, y, step.force_n]
            };
            let (a, b) = (force(earlier), force(&step));
            let moved = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
            if moved > largest[0].0 {
                largest[0] = (moved, t);
            }
            let both = earlier.answer == Answer::Ok && step.answer == Answer::Ok;
            let moved = before.iter().zip(&currents).map(|(a, b)| (a - b).abs());
            let moved = moved.fold(0.0, f64::max);
            if both && moved > largest[1].0 {
                largest[1] = (moved, t);
            }
        }
        last = Some((currents, step));
    }
    largest
}

/// Along lines over the surface, which the object's own borders would cut.
#[test]
fn neither_force_nor_current_jumps_along_a_hundred_lines() {
    const STEPS: usize = 1500;
    const FINER: usize = 400;
    let opened = along_the_normal().open("half-sphere");
    let mut renderer = opened.renderer.clone();
    let mut random = Random::new(29);
    let on_surface = |random: &mut Random, renderer: &Renderer| -> [f64; 3] {
        let (r, turn) = (0.042 * random.unit().sqrt(), 6.3 * random.unit());
        let [x, y] = [r * turn.cos(), r * turn.sin()];
        let height = renderer.heights().height_m(x, y).unwrap();
        // Within the map, which ends at the sphere's top.
        let z = height + 0.02 * (random.unit() - 0.5);
        [x, y, z.clamp(0.02, 0.0799)]
    };
    let mut worst_per_um = [0.0_f64; 2];
    for line in 0..100 {
        let (from, to) = (
            on_surface(&mut random, &renderer),
            on_surface(&mut random, &renderer),
        );
        let length_um = 1e6
            * (0..3)
                .map(|k| (to[k] - from[k]).powi(2))
                .sum::<f64>()
                .sqrt();
        let coarse = changes(&mut renderer, from, to, STEPS);
        for kind in 0..2 {
            let (moved, at) = coarse[kind];
            let step = 1.0 / STEPS as f64;
            let place = |t: f64| std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
            let (a, b) = (place(at - step), place(at));
            let (finer, _) = changes(&mut renderer, a, b, FINER)[kind];
            // A jump would not fall with the step; currents grow like a root at an end of reach.
            assert!(
                finer <= 0.1 * moved + 1e-9,
                "{line} {kind}: {moved} {finer}"
            );
            let per_um = finer / (length_um * step / FINER as f64);
            worst_per_um[kind] = worst_per_um[kind].max(per_um);
        }
    }
    println!(
        "largest change per micrometre: {:.2e} N, {:.2e} A",
        worst_per_um[0], worst_per_um[1]
    );
}
