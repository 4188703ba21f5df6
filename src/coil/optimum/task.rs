//! A design file's coil as a task of the optimiser.

use super::air::{AirCoil, NoAirCoil};
use super::cored::{CoreRule, CoredModel, NoCoredCoil};
use super::model::{CoilModel, Strand, Window};
use super::neighbours::Neighbours;
use super::problem::{Fixed, Task};
use crate::array_heat::Drivers;
use crate::circuit::farthest_from_zero;
use fluxform_design::{Coil, Core, Design, Driver, Steel};
use fluxform_field::magnet::MagnetRule;

/// Problems that cannot be optimised.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoTask {
    /// The drivers give no current.
    #[error(
        "supply.current_max_a and current_min_a are zero: without current no coil exerts a force"
    )]
    NoCurrent,
    /// The supply gives no voltage.
    #[error("supply.voltage_v is zero: without current no coil exerts a force")]
    NoVoltage,
    /// The coil or magnet cannot be modelled.
    #[error(transparent)]
    NoAirCoil(#[from] NoAirCoil),
    /// Steel whose permeability depends on the field.
    #[error(
        "a core with a B-H curve is not optimised: give core.relative_permeability instead of \
         core.bh_curve, and evaluate the optimum with the curve"
    )]
    Curve,
    /// The coil with its core cannot be modelled.
    #[error(transparent)]
    NoCoredCoil(#[from] NoCoredCoil),
}

/// The task of `design`, its coil's dimensions free but for `fixed`. The rated current is that of
/// the array's strongest driver, as for `evaluate`; the number of turns is what fits.
///
/// # Errors
/// [`NoTask`].
pub fn of_design(design: &Design, fixed: Fixed) -> Result<Task, NoTask> {
    let supply = &design.supply;
    let limits_a = supply.current_max_a.iter().chain(&supply.current_min_a);
    let current_max_a = farthest_from_zero(limits_a.copied()).abs();
    if current_max_a == 0.0 {
        return Err(NoTask::NoCurrent);
    }
    if supply.voltage_v.is_some_and(|voltage_v| voltage_v <= 0.0) {
        return Err(NoTask::NoVoltage);
    }
    Ok(Task {
        limits: design.limits,
        fixed,
        pitch_m: nearest_m(&design.array.positions_m),
        bobbin: false,
        current_max_a,
        voltage_v: supply.voltage_v,
        bandwidth_hz: match supply.driver {
            Driver::Voltage => None,
            Driver::Current => Some(supply.bandwidth_hz),
        },
        drivers: Drivers::of(supply),
        strands: Strand::choices(&design.wire),
    })
}

/// The distance of the nearest two of these places, m; `None` of one.
fn nearest_m(places: &[[f64; 2]]) -> Option<f64> {
    let mut by_x = places.to_vec();
    by_x.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut nearest = f64::INFINITY;
    for (rank, a) in by_x.iter().enumerate() {
        for b in &by_x[rank + 1..] {
            if b[0] - a[0] >= nearest {
                break;
            }
            nearest = nearest.min((a[0] - b[0]).hypot(a[1] - b[1]));
        }
    }
    nearest.is_finite().then_some(nearest)
}

/// The neighbours of the coil that is optimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Surroundings {
    /// Nothing: equation 11's coil.
    #[default]
    Alone,
    /// The array's other coils, unpowered, their cores magnetised: the coil nearest to the
    /// array's centre is optimised, all coils being alike. Nothing changes without cores.
    Neighbours,
}

/// The coil of `design`, in air or with its core, alone, under the magnet that `magnet` stands for, at
/// the design's target.
///
/// # Errors
/// [`NoTask`].
pub fn coil_model(design: &Design, magnet: &MagnetRule) -> Result<Box<dyn CoilModel>, NoTask> {
    coil_model_in(design, magnet, Surroundings::Alone)
}

/// The same in given surroundings.
///
/// # Errors
/// [`NoTask`].
pub fn coil_model_in(
    design: &Design,
    magnet: &MagnetRule,
    surroundings: Surroundings,
) -> Result<Box<dyn CoilModel>, NoTask> {
    let Some(core) = &design.core else {
        return Ok(Box::new(air_coil(design, magnet)?));
    };
    let alone = cored_coil(design, core, magnet)?;
    Ok(Box::new(match surroundings {
        Surroundings::Alone => alone,
        Surroundings::Neighbours => alone.among(Neighbours::new(&design.array.positions_m)),
    }))
}

/// The air coil under the magnet that `magnet` stands for, at the design's target.
///
/// # Errors
/// [`NoTask`].
pub fn air_coil(design: &Design, magnet: &MagnetRule) -> Result<AirCoil, NoTask> {
    Ok(AirCoil::new(design.target_height_m, magnet)?)
}

/// The coil with `core`, alone, under the magnet that `magnet` stands for, at the design's
/// target.
///
/// # Errors
/// [`NoTask`].
pub fn cored_coil(design: &Design, core: &Core, magnet: &MagnetRule) -> Result<CoredModel, NoTask> {
    let Steel::Linear(relative_permeability) = core.steel else {
        return Err(NoTask::Curve);
    };
    let rule = CoreRule {
        clearance_m: core.clearance_m,
        above_m: core.above_m,
        below_m: core.below_m,
        relative_permeability,
    };
    let with_peak = design.limits.core_field_max_t.is_some();
    Ok(CoredModel::new(
        design.target_height_m,
        magnet,
        rule,
        with_peak,
    )?)
}

impl Window {
    /// The section of a design's coil.
    #[must_use]
    pub fn of_coil(coil: &Coil) -> Self {
        Self {
            inner_radius_m: 0.5 * coil.inner_diameter_m,
            depth_m: 0.5 * (coil.outer_diameter_m - coil.inner_diameter_m),
            length_m: coil.length_m,
        }
    }

    /// The coil of this section with `turns`.
    #[must_use]
    pub fn coil(&self, turns: f64) -> Coil {
        Coil {
            inner_diameter_m: 2.0 * self.inner_radius_m,
            outer_diameter_m: 2.0 * self.outer_radius_m(),
            length_m: self.length_m,
            turns: Some(turns),
        }
    }
}
