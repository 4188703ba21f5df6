//! The physics that the optimiser is given for a design.

use crate::RunError;
use crate::coil::optimum::CoilModel;
use crate::coil::optimum::task::{self, Surroundings};
use crate::design::Design;
use crate::field::magnet::Sources;
use crate::scene::tolerances::Tolerances;
use crate::scene::{MAGNET_SHARE, magnet_rule};

/// The coil of `design` as a function of its winding's window.
///
/// # Errors
/// Physics that is not modelled; a magnet that no coil moves.
pub(super) fn coil_model(
    design: &Design,
    tolerance: Option<f64>,
    surroundings: Surroundings,
) -> Result<Box<dyn CoilModel>, RunError> {
    let top_m = design
        .core
        .as_ref()
        .map_or(0.0, |core| core.above_m.max(0.0));
    let sources = Sources::Below {
        height_m: design.target_height_m - top_m,
    };
    let magnet = magnet_rule(
        design,
        sources,
        MAGNET_SHARE * Tolerances::of_optimum(tolerance),
    )?;
    task::coil_model_in(design, &magnet, surroundings)
        .map_err(|error| RunError::Input(error.to_string()))
}
