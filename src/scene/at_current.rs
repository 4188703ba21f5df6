//! One core along its B-H curve, alone with its winding at a given current.

use super::Scene;
use super::core_material::SceneCore;
use crate::RunError;
use crate::field::steel::bh_curve::BhCurve;
use crate::field::steel::saturated_coil::{CoilWithCurve, SaturatedCoil, SaturatedCoilError};

/// The coil of `scene` at `current_a` along `curve`, to `tolerance` from `height_m` up, or as far
/// as the refinements carry.
///
/// Domain: a current that is not 0.
///
/// # Errors
/// A core that cannot be meshed; a curve along which no state is found.
pub(crate) fn solve(
    scene: &Scene,
    core: &SceneCore,
    curve: &BhCurve,
    current_a: f64,
    tolerance: f64,
    height_m: f64,
) -> Result<SaturatedCoil, RunError> {
    let coil = CoilWithCurve {
        winding: &scene.winding,
        air_inductance_h: scene.circuit.inductance_h,
        shape: core.shape,
        law: curve,
    };
    coil.solve(current_a, tolerance, height_m)
        .map_err(|error| match error {
            SaturatedCoilError::OnEdge(on_edge) => on_edge.into(),
            SaturatedCoilError::Mesh(fault) => {
                RunError::Input(format!("[core] with a B-H curve: {fault}"))
            }
            SaturatedCoilError::Stalled => no_state(current_a),
        })
}

/// The message when no state of the steel was found.
pub(crate) fn no_state(current_a: f64) -> RunError {
    RunError::Input(format!(
        "[core] with a B-H curve: no state of the steel was found at {current_a} A; check the \
         curve for jumps, or give core.relative_permeability"
    ))
}
