//! One step of a runtime: forces from a bundle's map, currents of least power.

use std::path::Path;

use super::{Measured, curve, stage};
use crate::effort::{Found, Pace};
use crate::file::{Curve, StageCurves};
use crate::inputs::{FLAT, SEED_AIR};
use fluxform::RunError;
use fluxform::bundle::artefact::Input;
use fluxform::bundle::atomic::Scratch;
use fluxform::bundle::replay::Answer;
use fluxform::commands::calibrate::{self, CalibrateOptions};
use fluxform::commands::replay::Opened;
use fluxform::commands::replay::synthesize::{Kind, Synthesis};
use fluxform::design::{Design, Need};
use fluxform::field::winding::KERNEL_ERROR;
use fluxform::progress::{Progress, Silent};
use fluxform::scene::Scene;
use fluxform::scene::sources::{DesignSource, ShapeSource};
use fluxform::scene::steel;
use fluxform::shape::document::ShapeDocument;

/// Nodes of the map along x and y; along z half as many.
const NODES: [usize; 5] = [11, 16, 31, 61, 121];
const DEFAULT: usize = 61;
/// Positions of the finger, and a second.
const POSITIONS: usize = 2000;
const RATE_HZ: f64 = 50.0;
/// Every so manieth position's force is computed directly.
const COMPARED: usize = 5;

/// Measures the stage.
///
/// # Errors
/// Interruption.
pub fn run(pace: &Pace, progress: &dyn Progress) -> Result<Measured, RunError> {
    let [map, currents] = curves(pace, progress)?;
    let stated = map.rows.iter().find(|row| row.default);
    let stated = stated.and_then(|row| row.stated_error).unwrap_or(1e-3);
    Ok(Measured {
        curves: StageCurves {
            stage: "replay".to_owned(),
            timed: "2000 steps: map, surface, currents".to_owned(),
            error_of: "the largest force per ampere at the height (currents: the optimum)"
                .to_owned(),
            default: "the design's own grid, 61 x 61 x 29, within 20 mm of the object".to_owned(),
            curves: vec![map, currents],
        },
        accuracy: stage(
            stated,
            "the largest |dB_z/dz| at each height",
            "the map's interpolation, measured between its nodes",
        ),
    })
}

/// A bundle of the seed's array in air under its flat surface, with so many nodes.
fn bundle(scratch: &Scratch, text: &str, name: &str) -> Result<Opened, RunError> {
    let out = scratch.path().join(name);
    let fault = |error: &dyn std::fmt::Display| RunError::Input(error.to_string());
    let (design, _) = Design::from_toml(text, Path::new(SEED_AIR.path), Need::CALIBRATE)
        .map_err(|error| fault(&error))?;
    let (document, _) =
        ShapeDocument::from_toml(FLAT.text, Path::new(FLAT.path)).map_err(|error| fault(&error))?;
    let options = CalibrateOptions {
        keep: false,
        page: false,
        ..CalibrateOptions::new(out)
    };
    let source = DesignSource {
        design: &design,
        text,
        input: &Input::of_bytes(SEED_AIR.path, text.as_bytes()),
    };
    let shape = ShapeSource {
        document,
        input: None,
    };
    let report = calibrate::run(source, &[shape], &options, &Silent)?;
    Opened::new(&report.bundles[0].folder)
}

/// The seed's air design with other numbers of nodes.
fn with_nodes(nodes: usize) -> String {
    let along_z = nodes.div_ceil(2);
    SEED_AIR
        .text
        .replace(", 61]", &format!(", {nodes}]"))
        .replace(", 29]", &format!(", {along_z}]"))
}

fn curves(pace: &Pace, progress: &dyn Progress) -> Result<[Curve; 2], RunError> {
    let design = SEED_AIR.design(Need::CALIBRATE)?;
    let scene = Scene::new(&design)?;
    let solved = steel::solve(&scene, scene.tolerances.field, 0.03)?;
    let scratch = Scratch::new()?;
    let (mut rows, mut optimal) = (Vec::new(), Vec::new());
    let mut finger: Option<Vec<[f64; 3]>> = None;
    for &nodes in pace.settings(&NODES, 4) {
        progress.check()?;
        let opened = bundle(&scratch, &with_nodes(nodes), &format!("nodes_{nodes}"))?;
        let positions = finger.get_or_insert_with(|| {
            let path = opened.synthesize(&Synthesis {
                kind: Kind::Explore,
                seed: 1,
                duration_s: POSITIONS as f64 / RATE_HZ,
                rate_hz: RATE_HZ,
            });
            path.position_m
        });
        let mut renderer = opened.renderer.clone();
        let mut currents = vec![0.0; renderer.coils()];
        let (_, timing) = pace.time(progress, || {
            for position in positions.iter() {
                std::hint::black_box(renderer.step(*position, &mut currents));
            }
            Ok(())
        })?;
        let (mut error, mut certificate) = (0.0_f64, 0.0_f64);
        for position in positions.iter().step_by(COMPARED) {
            let step = renderer.step(*position, &mut currents);
            if step.answer == Answer::Outside {
                continue;
            }
            certificate = certificate.max(renderer.certificate(&step, &currents));
            let direct = scene.forces_n_per_a(&solved, &[*position], &Silent)?;
            // Over a coil's axis the force per ampere is about the largest at that height.
            let above = scene.forces_n_per_a(&solved, &[[0.0, 0.0, position[2]]], &Silent)?;
            let size = above.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
            for (found, direct) in renderer.force_n_per_a().iter().zip(&direct) {
                error = error.max((found - direct).abs() / size);
            }
        }
        let reported = &opened.bundle.manifest.map.interpolation;
        let found = Found {
            knob: nodes as f64,
            default: nodes == DEFAULT,
            items: positions.len(),
            error,
            stated: Some(reported.largest_error),
        };
        rows.push(found.timed(&timing));
        let proven = Found {
            error: certificate,
            stated: None,
            ..found
        };
        optimal.push(proven.timed(&timing));
    }
    Ok([
        curve(
            "forces read off the map at the finger",
            "nodes of the map along x and y (z: half as many)",
            "forces at the positions directly, 1e-12",
            KERNEL_ERROR,
            rows,
        ),
        curve(
            "currents of least power",
            "nodes of the map along x and y (z: half as many)",
            "the optimality conditions of the commanded currents",
            0.0,
            optimal,
        ),
    ])
}
