//! The pull of the unpowered steel on a scene's magnet.

use super::JobError;
use super::scene::Scene;
use super::steel::coupled;
use crate::accuracy::StageAccuracy;
use crate::design::MagnetModel;
use crate::field::magnet::Cylinder;
use crate::field::steel::passive::{PassivePull, Pulled, Region};

/// Tolerance of the pull, relative to its own length: a small force beside the coils'.
pub const PASSIVE_TOLERANCE: f64 = 1e-3;

/// The pull wherever the magnet's centre is among `places_m`; `None` without steel. With `alone`
/// it is that of one core at the origin.
///
/// # Errors
/// A magnet that touches the steel.
pub fn pull(
    scene: &Scene,
    places_m: &[[f64; 3]],
    alone: bool,
) -> Result<Option<PassivePull>, JobError> {
    let Some(core) = &scene.core else {
        return Ok(None);
    };
    let range = |axis: usize| {
        places_m
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], p| {
                [lo.min(p[axis]), hi.max(p[axis])]
            })
    };
    let magnet = &scene.design.magnet;
    let pulled = Pulled {
        shape: core.shape,
        relative_permeability: core.relative_permeability(),
        positions_m: if alone {
            &[[0.0, 0.0]]
        } else {
            &scene.design.array.positions_m
        },
        coupled: !alone && coupled(scene.design),
        moment_a_m2: scene.moment_a_m2,
        size: (magnet.model == MagnetModel::Cylinder).then_some(Cylinder {
            diameter_m: magnet.diameter_m,
            length_m: magnet.length_m,
        }),
        region: Region {
            x_m: range(0),
            y_m: range(1),
            z_m: range(2),
        },
    };
    PassivePull::new(&pulled, PASSIVE_TOLERANCE)
        .map(Some)
        .map_err(|fault| {
            JobError::Input(format!(
                "[magnet] passive_force, with its centre from {} mm up: {fault}; raise the magnet",
                pulled.region.z_m[0] * 1e3
            ))
        })
}

/// The pull's estimated error.
#[must_use]
pub fn accuracy(pull: &PassivePull) -> StageAccuracy {
    StageAccuracy {
        estimate: pull.relative_error,
        relative_to: "the pull at the place".to_owned(),
        method: "largest difference from finer solutions at places spread over the region"
            .to_owned(),
    }
}
