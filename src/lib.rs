//! Design the coils, map the field gradients and solve the force constant of
//! a magnetic haptic display.
//!
//! The program `fluxform` is a thin shell around this crate: what a command does is a function in
//! [`commands`], and the rooms below it can be used on their own. This page goes once through all of
//! them; each room's page has a smaller example.
//!
//! # From a design to a felt force
//!
//! ```
//! use std::path::Path;
//!
//! use fluxform::bundle::load::Bundle;
//! use fluxform::design::{Design, Need};
//! use fluxform::field::winding::KERNEL_ERROR;
//! use fluxform::scene::sources::{DesignSource, ShapeSource};
//! use fluxform::commands::calibrate::{self, CalibrateOptions};
//! use fluxform::commands::probe::{ProbeRequest, probe};
//! use fluxform::commands::replay::renderer::Renderer;
//! use fluxform::scene::{Scene, steel};
//! use fluxform::lambda::{ForceProblem, Settings, solve};
//! use fluxform::map::{Components, Grid, tabulate};
//! use fluxform::progress::Silent;
//! use fluxform::shape::{discretize, document::ShapeDocument};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // 1. A design: four coils without cores. Lengths are millimetres in files, metres inside.
//! let small = r#"
//!     name = "small"
//!     coil = { inner_diameter_mm = 12.0, outer_diameter_mm = 30.0, length_mm = 40.0 }
//!     wire = { diameter_mm = 0.7 }
//!     array = { rows = 2, columns = 2, pitch_mm = 34.0 }
//!     magnet = { diameter_mm = 10.0, length_mm = 10.0, magnetization_a_per_m = 1.1579e6, polarity = "repel" }
//!     supply = { current_max_a = 2.0 }
//!     [workspace]
//!     x_mm = [-30.0, 30.0, 21]
//!     y_mm = [-30.0, 30.0, 21]
//!     z_mm = [10.0, 40.0, 13]
//! "#;
//! let (design, warnings) = Design::from_toml(small, Path::new("small.toml"), Need::CALIBRATE)?;
//! assert!(warnings.is_empty());
//!
//! // 2. The field of every coil at one place, per ampere. Its divergence vanishes.
//! let place = [0.011, -0.004, 0.023];
//! let table = probe(&design, vec![place], ProbeRequest::default(), &Silent)?;
//! let gradient = table.field(0, 3).gradient_t_per_m_per_a;
//! let divergence = gradient[0][0] + gradient[1][1] + gradient[2][2];
//! assert!(divergence.abs() < 1e-12 * gradient[2][2].abs());
//!
//! // 3. A map of dB_z/dz over a grid; here one whose middle node is that place.
//! let scene = Scene::new(&design)?;
//! let near = |x: f64| vec![x - 0.001, x, x + 0.001];
//! let grid = Grid { x_m: near(place[0]), y_m: near(place[1]), z_m: near(place[2]) };
//! let map = tabulate(&scene.winding, &scene.coils, &grid, Components::Gz, 1e-9, &Silent)?;
//! let middle = map.gz_t_per_m_per_a[3 * 27 + 13]; // coil 3 of [coil, z, y, x]
//! assert!((middle - gradient[2][2]).abs() < 1e-8 * middle.abs());
//!
//! // 4. An object, and the points at which its force is requested.
//! let text = r#"
//!     name = "dome"
//!     primitive = "half-sphere"
//!     radius_mm = 20.0
//!     base_mm = 15.0
//!     points = { x_mm = [-20.0, 20.0, 17], y_mm = [-20.0, 20.0, 17] }
//! "#;
//! let (dome, _) = ShapeDocument::from_toml(text, Path::new("dome.toml"))?;
//! let points = discretize(&dome, &Silent)?.points;
//! let top = points.height_m.iter().fold(0.0_f64, |top, h| top.max(*h));
//! assert!((top - 0.035).abs() < 1e-12);
//!
//! // 5. The force of every coil at every point, and the force constant lambda of the object.
//! let places: Vec<[f64; 3]> = (0..points.len())
//!     .map(|j| [points.x_m[j], points.y_m[j], points.height_m[j]])
//!     .collect();
//! let solved = steel::solve(&scene, scene.tolerances.forces, 0.015)?; // no steel here; from 15 mm up
//! let forces = scene.forces_n_per_a(&solved, &places, &Silent)?;
//! let problem = ForceProblem {
//!     forces_n_per_a: &forces,
//!     height_m: &points.height_m,
//!     offset_n: None,
//!     weights: None,
//!     lower_a: &scene.lower_a,
//!     upper_a: &scene.upper_a,
//!     total_max_a: None,
//!     resistance_ohm: &scene.resistances_ohm(),
//! };
//! let solution = solve(&problem, &Settings::default())?;
//! let chosen = solution.chosen.ok_or("no force can be rendered")?;
//! assert!(chosen.lambda_n_per_m > 0.0);
//! assert!(chosen.currents_a.iter().all(|current| (0.0..=2.0).contains(current)));
//!
//! // 6. The same in one call, written as a bundle; then read back, as a controller would.
//! let folder = tempfile::tempdir()?;
//! let input = fluxform::bundle::artefact::Input::of_bytes("small.toml", small.as_bytes());
//! let source = DesignSource { design: &design, text: small, input: &input };
//! let options = CalibrateOptions::new(folder.path());
//! let shapes = [ShapeSource { document: dome, input: None }];
//! calibrate::run(source, &shapes, &options, &Silent)?;
//! let bundle = Bundle::open(&folder.path().join("small/dome"))?;
//! let lambda = bundle.lambda.lambda_n_per_m.ok_or("no force can be rendered")?;
//! assert!((lambda / chosen.lambda_n_per_m - 1.0).abs() < 1e-6);
//!
//! // A finger at the dome: the currents of least power that give it lambda times the height.
//! let mut renderer = Renderer::new(&bundle)?;
//! let mut currents_a = vec![0.0; bundle.coil_count()];
//! let step = renderer.step([0.012, 0.012, 0.026], &mut currents_a);
//! let mut per_ampere = vec![0.0; bundle.coil_count()];
//! assert!(bundle.force_per_ampere([0.012, 0.012, 0.026], &mut per_ampere));
//! let given: f64 = per_ampere.iter().zip(&currents_a).map(|(f, i)| f * i).sum();
//! assert!((given - lambda * step.height_m).abs() < 1e-9);
//! # Ok(())
//! # }
//! ```
//!
//! # What to rely on
//!
//! - Numbers are SI, and the unit stands in every public name.
//! - What misses a wish is a result with a status, not an error; errors say what to do.
//! - The same inputs give the same bits on any number of threads. Whoever wants to see progress or
//!   to stop a run implements [`progress::Progress`]; [`progress::Silent`] does neither.
//! - Until version 1.0 a minor version may change this interface, and the changelog says so. Enums
//!   that may grow and results are `#[non_exhaustive]`; options are written
//!   `Options { requested, ..Options::default() }`, so that a new one breaks nobody. The layout of
//!   artefacts has a version of its own, [`bundle::artefact::SCHEMA_VERSION`].
//!
//! # Rooms
//!
//! In the direction of their imports:
//! [`numerics`] < [`design`] < [`field`] < [`coil`] < [`map`]; [`shape`] beside them;
//! [`lambda`] on numbers alone; [`bundle`] writes and reads artefacts, [`plot`] draws,
//! [`report`] makes pages; [`scene`] makes sources, forces and maps of a design; [`cli`] prints, and
//! holds what commands share of the command line; [`commands`] has a folder per command with what it
//! computes, its arguments and its text.

pub use fluxform_base::accuracy;
pub use fluxform_base::choice;
pub use fluxform_base::choices;
pub use fluxform_base::digits;
pub use fluxform_base::force_direction;
pub use fluxform_base::heating;
pub use fluxform_base::point_weights;
pub use fluxform_base::progress;
pub use fluxform_base::uncertainty;
pub use fluxform_base::units;

pub use fluxform_numerics as numerics;

pub use fluxform_design as design;

pub use fluxform_field as field;

pub use fluxform_coil as coil;
pub use fluxform_map as map;

pub use fluxform_shape as shape;

pub use fluxform_lambda as lambda;

pub use fluxform_bundle as bundle;
pub use fluxform_render::plot;
pub use fluxform_render::report;

mod error;
pub use error::RunError;

pub mod scene;

pub mod cli;

pub mod commands;

/// The Rust of the page on results compiles.
#[cfg(doctest)]
#[doc = include_str!("../results/README.md")]
struct Results;
