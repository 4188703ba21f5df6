//! A map for mag_manip: the field on nodes, and as multipole sources, each with its error.

use std::path::PathBuf;

use rayon::prelude::*;
use serde::Serialize;

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::mag_manip::{MultipoleSource, Multipoles, VectorField};
use crate::commands::probe::FieldAt;
use crate::field::frame::CartesianField;
use crate::map::multipole::{PARTS, magnitudes};
use crate::map::multipole_fit::{Model, Samples};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::steel::Solved;

/// The options of mag_manip's files.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MagManipRequest {
    /// File of the field on nodes.
    pub vector_field: Option<PathBuf>,
    /// Nodes along each axis; `None` for the most that the workspace has along one, but no more
    /// than `vector_field::MOST_DEFAULT_NODES`.
    pub nodes: Option<usize>,
    /// File of the multipole sources.
    pub multipoles: Option<PathBuf>,
    /// Tolerance of the multipoles; `None` for `multipoles::MULTIPOLE_TOLERANCE`.
    pub tolerance: Option<f64>,
}

/// The field on nodes and its error, as `map` reports it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct VectorFieldSummary {
    /// File as given.
    pub file: String,
    /// Nodes along each axis.
    pub nodes: usize,
    /// Steps along x, y and z, m.
    pub step_m: [f64; 3],
    /// Places at which the interpolation was compared.
    pub checks: usize,
    /// Relative to the largest |B| at the height.
    pub field_error: f64,
    /// Relative to the largest |grad B| at the height.
    pub gradient_error: f64,
}

/// Multipole sources and their error, as `map` reports them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MultipolesSummary {
    /// File as given.
    pub file: String,
    /// Sources of one coil, the most of all.
    pub sources: usize,
    /// Coefficients of one coil, the most of all.
    pub coefficients: usize,
    /// The largest condition of a fit.
    pub condition: f64,
    /// Points of the fit.
    pub points: usize,
    /// Points of the comparison.
    pub checks: usize,
    /// Relative to the largest |B| at the height.
    pub field_error: f64,
    /// Relative to the largest |grad B| at the height.
    pub gradient_error: f64,
    /// The requested tolerance.
    pub tolerance: f64,
    /// Whether both errors are within it.
    pub tolerance_met: bool,
}

/// The field on nodes.
#[derive(Debug, Clone)]
pub(super) struct VectorFieldMade {
    pub(super) path: PathBuf,
    pub(super) summary: VectorFieldSummary,
    /// First and last node along x, y and z, m.
    pub(super) ends_m: [[f64; 2]; 3],
    /// T/A, [coil, z, y, x, 3].
    pub(super) field_t_per_a: Vec<f64>,
    /// Of field and gradient.
    pub(super) accuracy: [StageAccuracy; 2],
}

impl VectorFieldMade {
    /// As it is written.
    pub(super) fn content<'a>(&'a self, name: &'a str) -> VectorField<'a> {
        VectorField {
            name,
            ends_m: self.ends_m,
            nodes: self.summary.nodes,
            field_t_per_a: &self.field_t_per_a,
        }
    }
}

/// Multipole sources.
#[derive(Debug, Clone)]
pub(super) struct MultipolesMade {
    pub(super) path: PathBuf,
    pub(super) summary: MultipolesSummary,
    /// Coil by coil: the model and the coil's place in it.
    pub(super) coils: Vec<(usize, usize)>,
    /// The models: one for all coils among coupled cores, one per coil otherwise.
    pub(super) models: Vec<Model>,
    /// From, to along x, y and z, m.
    pub(super) workspace_m: [[f64; 2]; 3],
    /// Of field and gradient.
    pub(super) accuracy: [StageAccuracy; 2],
}

impl MultipolesMade {
    /// As it is written.
    pub(super) fn content<'a>(&'a self, name: &'a str) -> Multipoles<'a> {
        let coils = self.coils.iter().map(|(model, place)| {
            let model = &self.models[*model];
            let mut rest = model.coefficients[*place].as_slice();
            let sources = model.sources.iter().map(|source| {
                let (own, others) = rest.split_at(source.orders);
                rest = others;
                MultipoleSource {
                    position_m: source.position_m,
                    direction: source.direction,
                    coefficients: own,
                }
            });
            sources.collect()
        });
        Multipoles {
            name,
            workspace_m: self.workspace_m,
            coils: coils.collect(),
        }
    }
}

/// Largest errors found at samples are raised by this: other places may be worse.
pub(super) const SAFETY: f64 = 1.25;

/// The accuracy of field and gradient from their largest errors at samples.
pub(super) fn stages(errors: [f64; 2], own: f64, method: &str) -> [StageAccuracy; 2] {
    let kinds = ["|B|", "|grad B|"];
    std::array::from_fn(|k| StageAccuracy {
        estimate: SAFETY * errors[k] + own,
        relative_to: format!("the largest {} at that height", kinds[k]),
        method: method.to_owned(),
    })
}

/// Points handed to one thread at a time; fixed, so that bytes do not depend on threads.
const PORTION: usize = 128;

/// Field and gradient of every coil at points, computed directly: [coil][point]. Sizes are left
/// empty.
pub(super) fn direct(
    scene: &Scene,
    solved: &Solved,
    points_m: Vec<[f64; 3]>,
    progress: &dyn Progress,
) -> Result<Samples, RunError> {
    let places = FieldAt::new(scene, solved, &points_m, 0.0)?;
    progress.begin("samples", points_m.len() as u64);
    let portions = (points_m.par_chunks(PORTION).enumerate())
        .map(|(portion, points)| {
            progress.check()?;
            let fields = places.fields(points, portion * PORTION + 1)?;
            progress.advance(points.len() as u64);
            Ok(fields)
        })
        .collect::<Result<Vec<_>, RunError>>()?;
    progress.end();
    let coils = scene.coils.len();
    let mut parts = vec![Vec::with_capacity(points_m.len()); coils];
    for (pair, field) in portions.iter().flatten().enumerate() {
        parts[pair % coils].push(parts_of(field));
    }
    Ok(Samples {
        points_m,
        parts,
        sizes: Vec::new(),
    })
}

fn parts_of(field: &CartesianField) -> [f64; PARTS] {
    let ([bx, by, bz], [dx, dy, _]) = (field.field_t_per_a, field.gradient_t_per_m_per_a);
    [bx, by, bz, dx[0], dx[1], dx[2], dy[1], dy[2]]
}

/// Largest field and gradient of any coil at each of the samples' heights, ascending.
pub(super) fn largest(samples: &Samples) -> Vec<(f64, [f64; 2])> {
    let mut heights: Vec<f64> = samples.points_m.iter().map(|p| p[2]).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    let mut out: Vec<(f64, [f64; 2])> = heights.iter().map(|z| (*z, [0.0; 2])).collect();
    for parts in &samples.parts {
        for (at, parts) in samples.points_m.iter().zip(parts) {
            let sizes = magnitudes(parts);
            let place = heights.partition_point(|z| *z < at[2]);
            for (most, size) in out[place].1.iter_mut().zip(sizes) {
                *most = most.max(size);
            }
        }
    }
    out
}
