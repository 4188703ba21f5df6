//! One core along its B-H curve, alone with its winding at a given current.

use super::Scene;
use super::core_material::SceneCore;
use crate::RunError;
use crate::field::steel::bh_curve::BhCurve;
use crate::field::steel::linear_equivalent::{GradientDifferences, LinearEquivalent};
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
    coil(scene, core, curve)
        .solve(current_a, tolerance, height_m)
        .map_err(|error| refused(error, current_a))
}

fn refused(error: SaturatedCoilError, current_a: f64) -> RunError {
    match error {
        SaturatedCoilError::OnEdge(on_edge) => on_edge.into(),
        SaturatedCoilError::Mesh(fault) => {
            RunError::Input(format!("[core] with a B-H curve: {fault}"))
        }
        SaturatedCoilError::Stalled => no_state(current_a),
    }
}

/// The linear core that is taken for the one at `state` where cores are coupled: alone it has the same gradient on
/// the axis at the target's height.
///
/// # Errors
/// A place on the winding's edge.
pub(crate) fn linear(
    scene: &Scene,
    core: &SceneCore,
    curve: &BhCurve,
    state: &SaturatedCoil,
) -> Result<LinearEquivalent, RunError> {
    let first = mean_permeability(curve, state);
    let height_m = scene.design.target_height_m;
    Ok(coil(scene, core, curve).linear_equivalent(state, first, height_m)?)
}

/// How far the core's gradients per ampere at smaller currents are from those at `current_a`.
///
/// # Errors
/// As [`solve`].
pub(crate) fn smaller_currents(
    scene: &Scene,
    core: &SceneCore,
    curve: &BhCurve,
    current_a: f64,
) -> Result<GradientDifferences, RunError> {
    coil(scene, core, curve)
        .smaller_currents(current_a)
        .map_err(|error| refused(error, current_a))
}

/// The curve's permeability at the mean |B| of `state`.
pub(crate) fn mean_permeability(curve: &BhCurve, state: &SaturatedCoil) -> f64 {
    curve.relative_permeability(state.inside.mean_b_t).max(1.0)
}

fn coil<'a>(scene: &'a Scene, core: &SceneCore, curve: &'a BhCurve) -> CoilWithCurve<'a> {
    CoilWithCurve {
        winding: &scene.winding,
        air_inductance_h: scene.circuit.inductance_h,
        shape: core.shape,
        law: curve,
    }
}

/// The message when no state of the steel was found.
pub(crate) fn no_state(current_a: f64) -> RunError {
    RunError::Input(format!(
        "[core] with a B-H curve: no state of the steel was found at {current_a} A; check the \
         curve for jumps, or give core.relative_permeability"
    ))
}
