//! The pull of the unpowered steel on a scene's magnet.

use std::sync::Arc;

use rayon::prelude::*;

use super::iron::SceneIron;
use super::passive_iron::{RegionPull, Wanted, magnet_of, too_close};
use super::passive_table::{TABLE_SHARE, region, scattered_z_n};
use super::prepared_field::rounded_down;
use super::{Scene, coupled};
use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::field::steel::passive::isolated::placed;
use crate::field::steel::passive::magnet::{PassiveMagnet, dipoles};
use crate::field::steel::passive::neighbours::Neighbours;
use crate::field::steel::passive::reaction::{Reaction, ReactionResolution};
use crate::field::steel::passive::{PassivePull, Pulled, Region};
use crate::numerics::axis::Axis;

/// Tolerance of the pull, relative to its own length: a small force beside the coils'.
pub const PASSIVE_TOLERANCE: f64 = 1e-3;

/// The same where the pull is left out: how large it is matters to some digits only.
const LEFT_OUT_TOLERANCE: f64 = 1e-2;
/// The same of a plate and other bodies, whose finer panels take a minute.
const IRON_LEFT_OUT: f64 = 0.05;
/// Most cores whose coupling is worth its memory and time where the pull is left out: both grow as
/// powers of their number.
const MOST_COUPLED: usize = 36;

/// The pull of a scene's unpowered steel.
#[derive(Debug, Clone)]
pub enum Pull {
    /// Of cores.
    Cores(Box<PassivePull>),
    /// Of a plate, other bodies and the cores with them.
    Iron(Arc<RegionPull>),
}

impl Pull {
    /// Force on the magnet with its centre at a place of the region, N.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Cores(pull) => pull.force_n(at_m),
            Self::Iron(pull) => pull.force_n(at_m),
        }
    }

    /// Vertical forces at many places, N.
    #[must_use]
    pub fn forces_z_n(&self, at_m: &[[f64; 3]]) -> Vec<f64> {
        match self {
            Self::Cores(pull) => pull.forces_z_n(at_m),
            Self::Iron(pull) => pull.forces_z_n(at_m),
        }
    }

    /// Estimated error of a force, relative to its length.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        match self {
            Self::Cores(pull) => pull.relative_error,
            Self::Iron(pull) => pull.relative_error,
        }
    }
}

/// Whether `left_out` counts that cores magnetise each other.
#[must_use]
pub fn couples_left_out(scene: &Scene) -> bool {
    coupled(scene.design) && scene.coils.len() <= MOST_COUPLED
}

/// The region about `places_m` over which the pull is solved where a design leaves it out: the whole
/// workspace from a step of height below the lowest place on, so that most of a design's objects share it.
#[must_use]
pub(super) fn left_out_region(scene: &Scene, places_m: &[[f64; 3]]) -> Region {
    let workspace = &scene.design.workspace;
    let [x_m, y_m, [lowest_m, highest_m]] = region(places_m);
    let around = |axis: &Axis, [from, to]: [f64; 2]| [axis.from.min(from), axis.to.max(to)];
    let top_m = scene.steel_extent_m().map_or(0.0, |(top_m, _)| top_m);
    let touches_m = scene.magnet_depth_m() + top_m;
    let lowest_m = touches_m + rounded_down(lowest_m - touches_m);
    Region {
        x_m: around(&workspace.x_m, x_m),
        y_m: around(&workspace.y_m, y_m),
        z_m: [lowest_m, workspace.z_m.to.max(highest_m)],
    }
}

/// The pull over `region` where a design leaves it out, to [`left_out_tolerance`]; `None` without steel.
///
/// # Errors
/// A magnet that touches the steel.
pub(super) fn left_out(scene: &Scene, region: Region) -> Result<Option<Pull>, RunError> {
    if let Some(iron) = &scene.iron {
        let wanted = Wanted {
            region,
            tolerance: left_out_tolerance(scene),
            tabulated: false,
        };
        return Ok(scene.pulls.of(scene, iron, wanted)?.map(Pull::Iron));
    }
    let Some(pulled) = pulled(scene, region, false) else {
        return Ok(None);
    };
    let pulled = Pulled {
        coupled: couples_left_out(scene),
        ..pulled
    };
    of_cores(&pulled, left_out_tolerance(scene)).map(Some)
}

/// Vertical pull at `places_m` from [`left_out`], N: from a table, and from the pull itself where it is strongest.
pub(super) fn left_out_z_n(scene: &Scene, pull: &Pull, places_m: &[[f64; 3]]) -> Vec<f64> {
    scattered_z_n(
        scene,
        |at_m| pull.forces_z_n(at_m),
        places_m,
        TABLE_SHARE * left_out_tolerance(scene),
    )
}

fn left_out_tolerance(scene: &Scene) -> f64 {
    match scene.iron {
        Some(_) => iron_tolerance(scene, IRON_LEFT_OUT),
        None => LEFT_OUT_TOLERANCE,
    }
}

/// The pull wherever the magnet's centre is among `places_m`; `None` without steel or places. With `alone`
/// it is that of one core at the origin.
///
/// # Errors
/// A magnet that touches the steel.
pub fn pull(scene: &Scene, places_m: &[[f64; 3]], alone: bool) -> Result<Option<Pull>, RunError> {
    pull_to(scene, places_m, alone, PASSIVE_TOLERANCE)
}

/// The [`pull`] of all steel; `None` too where the design leaves it out.
///
/// # Errors
/// A magnet that touches the steel.
pub fn counted(scene: &Scene, places_m: &[[f64; 3]]) -> Result<Option<Pull>, RunError> {
    if scene.design.magnet.passive_force {
        pull(scene, places_m, false)
    } else {
        Ok(None)
    }
}

/// [`pull`] to another tolerance; of a plate and other bodies to that of the forces at best.
///
/// # Errors
/// A magnet that touches the steel.
pub fn pull_to(
    scene: &Scene,
    places_m: &[[f64; 3]],
    alone: bool,
    tolerance: f64,
) -> Result<Option<Pull>, RunError> {
    if places_m.is_empty() {
        return Ok(None);
    }
    if let (Some(iron), false) = (&scene.iron, alone) {
        let pull = of_iron(scene, iron, places_m, tolerance)?;
        return Ok(pull.map(Pull::Iron));
    }
    let Some(pulled) = pulled(scene, about(places_m), alone) else {
        return Ok(None);
    };
    of_cores(&pulled, tolerance).map(Some)
}

fn of_cores(pulled: &Pulled, tolerance: f64) -> Result<Pull, RunError> {
    PassivePull::new(pulled, tolerance)
        .map(|pull| Pull::Cores(Box::new(pull)))
        .map_err(|fault| too_close(pulled.region, fault))
}

/// `tolerance` of the pull of a plate and other bodies: that of the forces at best.
pub(super) fn iron_tolerance(scene: &Scene, tolerance: f64) -> f64 {
    tolerance.max(scene.tolerances.forces)
}

/// `tolerance` of the pull of a scene's steel.
pub(super) fn tolerance_of(scene: &Scene, tolerance: f64) -> f64 {
    match scene.iron {
        Some(_) => iron_tolerance(scene, tolerance),
        None => tolerance,
    }
}

/// Over the whole workspace, so that most places of a command share it.
fn of_iron(
    scene: &Scene,
    iron: &SceneIron,
    places_m: &[[f64; 3]],
    tolerance: f64,
) -> Result<Option<Arc<RegionPull>>, RunError> {
    let wanted = Wanted {
        region: left_out_region(scene, places_m),
        tolerance: iron_tolerance(scene, tolerance),
        tabulated: true,
    };
    scene.pulls.of(scene, iron, wanted)
}

/// Vertical pull at `places_m` by another route than [`pull`]'s, N; `None` without steel. There a
/// core's share is the slope of a tabulated energy; here it is the gradient of the field that the
/// core sends back, computed again for every place. The cores' coupling is solved to `tolerance`. Of a plate and
/// other bodies the field is tabulated, so here it is the slope of the energy.
///
/// # Errors
/// A magnet that touches the steel.
pub fn direct_z_n(
    scene: &Scene,
    places_m: &[[f64; 3]],
    tolerance: f64,
) -> Result<Option<Vec<f64>>, RunError> {
    if let Some(iron) = &scene.iron {
        let pull = of_iron(scene, iron, places_m, tolerance)?;
        return Ok(pull.map(|pull| pull.slopes_z_n(places_m)));
    }
    let Some(pulled) = pulled(scene, about(places_m), false) else {
        return Ok(None);
    };
    let shape = pulled.shape;
    let mu_r = pulled.relative_permeability;
    let magnet = PassiveMagnet::new(
        pulled.moment_a_m2,
        pulled.size,
        shape.top_m,
        pulled.region.z_m[0],
        0.5 * tolerance,
    )
    .map_err(|fault| too_close(pulled.region, fault))?;
    let resolution = ReactionResolution::for_tolerance(tolerance, shape, magnet.gap_m());
    let core = Reaction::new(shape, mu_r, &resolution.finer());
    let axes = pulled.positions_m;
    let closest_m = axes
        .iter()
        .enumerate()
        .flat_map(|(i, a)| {
            axes[..i]
                .iter()
                .map(move |b| (a[0] - b[0]).hypot(a[1] - b[1]))
        })
        .fold(f64::INFINITY, f64::min);
    let neighbours = (pulled.coupled && axes.len() > 1).then(|| {
        let few = magnet.few_dipoles(tolerance);
        let gap_m = magnet.gap_of_m(few.iter().map(|dipole| dipole.at_m));
        Neighbours::new(shape, mu_r, axes, closest_m, gap_m, tolerance, few)
    });
    Ok(Some(
        places_m
            .par_iter()
            .map(|[x, y, z]| {
                let rule = magnet.magnet_rule(*z);
                let about_centre = dipoles(&rule);
                let alone: f64 = axes
                    .iter()
                    .map(|axis| {
                        let at = [x - axis[0], y - axis[1], *z];
                        let back = core.induced(&placed(&about_centre, at));
                        let gradients: Vec<_> = back.iter().map(|f| f.gradient_t_per_m).collect();
                        rule.force_n(&gradients)[2]
                    })
                    .sum();
                alone
                    + neighbours
                        .as_ref()
                        .map_or(0.0, |n| n.forces_z_n(&[[*x, *y, *z]])[0])
            })
            .collect(),
    ))
}

/// Arguments of the pull's solvers; `None` without steel.
fn pulled<'a>(scene: &'a Scene, region: Region, alone: bool) -> Option<Pulled<'a>> {
    let core = scene.core.as_ref()?;
    let (moment_a_m2, size) = magnet_of(scene);
    Some(Pulled {
        shape: core.shape,
        relative_permeability: core.relative_permeability(),
        positions_m: if alone {
            &[[0.0, 0.0]]
        } else {
            &scene.design.array.positions_m
        },
        coupled: !alone && coupled(scene.design),
        moment_a_m2,
        size,
        region,
    })
}

fn about(places_m: &[[f64; 3]]) -> Region {
    let [x_m, y_m, z_m] = region(places_m);
    Region { x_m, y_m, z_m }
}

/// The pull's estimated error.
#[must_use]
pub fn accuracy(pull: &Pull) -> StageAccuracy {
    StageAccuracy {
        estimate: pull.relative_error(),
        relative_to: "the pull at the place".to_owned(),
        method: "largest difference from finer solutions at places spread over the region"
            .to_owned(),
    }
}

/// A sentence on a pull of `force_n` whose stated error is above `tolerance`.
#[must_use]
pub fn warning(stage: &StageAccuracy, tolerance: f64, force_n: f64) -> Option<String> {
    (!stage.meets(tolerance)).then(|| {
        let error = stage.estimate;
        format!(
            "the pull of the unpowered steel has a stated error of {error:.1e} of itself ({:.1e} N), above \
             its tolerance {tolerance:.1e}",
            error * force_n.abs()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pull_beyond_its_tolerance_is_warned_of_with_its_error_in_newtons() {
        let stage = StageAccuracy {
            estimate: 0.127,
            relative_to: String::new(),
            method: String::new(),
        };
        assert_eq!(warning(&stage, 0.127, -0.0357), None);
        let warned = warning(&stage, 0.01, -0.0357).unwrap();
        assert!(warned.contains("1.3e-1 of itself (4.5e-3 N)"), "{warned}");
    }
}
