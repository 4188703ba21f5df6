//! The pull of a plate, other bodies and the cores with them: solved on all steel, and tabulated where many places
//! ask for it.

use std::sync::{Arc, Mutex, PoisonError};

use super::iron::SceneIron;
use super::passive_table::{
    ATTEMPTS, Layout, TABLE_SHARE, Table, axial_m, symmetries_of, tabulated,
};
use super::{Scene, cylinder_of};
use crate::RunError;

use crate::field::iron::passive::IronPull;
use crate::field::magnet::Cylinder;
use crate::field::steel::passive::magnet::PassiveMagnet;
use crate::field::steel::passive::{NoPull, Region, spread};

/// Share of the tolerance given to the magnet's dipoles.
const MAGNET_SHARE: f64 = 0.1;
/// Solutions held at a time: that of points, and that of a map about them.
const HELD: usize = 2;
/// Step of the energy's slope, relative to the height above the steel.
const STEP: f64 = 0.02;

/// The pull over a region.
#[derive(Debug, Clone)]
pub struct RegionPull {
    pull: IronPull,
    /// Of the vertical force; `None`: every place is solved for.
    table: Option<Table>,
    top_m: f64,
    /// Estimated error of a force, relative to its length: of the solution and of tabulating it.
    pub relative_error: f64,
}

/// What a pull is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wanted {
    pub(super) region: Region,
    /// Of a force, relative to its length.
    pub(super) tolerance: f64,
    /// Whether its vertical force is tabulated over the whole region.
    pub(super) tabulated: bool,
}

type Held = (Wanted, Option<Arc<RegionPull>>);

/// The pulls that were last asked for; copies of a scene share them. Each depends on what it is for alone.
#[derive(Debug, Clone, Default)]
pub(super) struct HeldPulls(Arc<Mutex<Vec<Held>>>);

impl HeldPulls {
    /// The pull of `iron`; `None` where it does not answer.
    ///
    /// # Errors
    /// A magnet that touches the steel; a core beside the plate.
    pub(super) fn of(
        &self,
        scene: &Scene,
        iron: &SceneIron,
        wanted: Wanted,
    ) -> Result<Option<Arc<RegionPull>>, RunError> {
        // One after the other: a second thread waits for the first one's.
        let mut held = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, pull)) = held.iter().find(|(of, _)| *of == wanted) {
            return Ok(pull.clone());
        }
        let pull = RegionPull::new(scene, iron, wanted)?.map(Arc::new);
        held.truncate(HELD - 1);
        held.insert(0, (wanted, pull.clone()));
        Ok(pull)
    }
}

impl RegionPull {
    fn new(scene: &Scene, iron: &SceneIron, wanted: Wanted) -> Result<Option<Self>, RunError> {
        let Wanted {
            region,
            tolerance,
            tabulated,
        } = wanted;
        let (top_m, _) = scene.steel_extent_m().unwrap_or_default();
        let (moment_a_m2, size) = magnet_of(scene);
        let lowest_m = region.z_m[0];
        let magnet =
            PassiveMagnet::new(moment_a_m2, size, top_m, lowest_m, MAGNET_SHARE * tolerance)
                .map_err(|fault| too_close(region, fault))?;
        let axes = &scene.design.array.positions_m;
        let places_m = spread(axes, region, top_m);
        let (_, bodies) = iron.bodies(scene)?;
        let Some(pull) = IronPull::new(&bodies, magnet, &places_m, tolerance) else {
            return Ok(None);
        };
        let solved = Self {
            relative_error: pull.relative_error,
            pull,
            table: None,
            top_m,
        };
        Ok(Some(match tabulated {
            true => solved.with_table(scene, &wanted, &places_m),
            false => solved,
        }))
    }

    /// What the pull of `iron` over the whole workspace takes at least: unknowns of a mirrored part, number of the parts,
    /// and places of the table; `None` where it does not answer.
    pub(super) fn least_work(
        scene: &Scene,
        iron: &SceneIron,
        tolerance: f64,
    ) -> Option<[usize; 3]> {
        let (top_m, _) = scene.steel_extent_m()?;
        let workspace = &scene.design.workspace;
        let ranges =
            [&workspace.x_m, &workspace.y_m, &workspace.z_m].map(|axis| [axis.from, axis.to]);
        let turns = symmetries_of(scene, ranges);
        let aim = TABLE_SHARE * tolerance;
        let layout = Layout::new(ranges, [top_m, axial_m(scene)], &turns, aim);
        let (_, bodies) = iron.bodies(scene).ok()?;
        let [unknowns, parts] = IronPull::least_size(&bodies, tolerance);
        Some([unknowns, parts, layout.evaluations()])
    }

    /// The same with a table, and its error at `places_m`.
    fn with_table(self, scene: &Scene, wanted: &Wanted, places_m: &[[f64; 3]]) -> Self {
        let Region { x_m, y_m, z_m } = wanted.region;
        let ranges = [x_m, y_m, z_m];
        let sure = self.pull.forces_n(places_m);
        let turns = symmetries_of(scene, ranges);
        let [mut aim, allowed] = tabulated(wanted.tolerance, self.relative_error);
        let mut best: Option<(f64, Table)> = None;
        for _ in 0..ATTEMPTS {
            let layout = Layout::new(ranges, [self.top_m, axial_m(scene)], &turns, aim);
            let table = layout.filled(|places_m| self.forces_z_n(places_m));
            let error = places_m.iter().zip(&sure).map(|(at, sure)| {
                let length = sure.iter().map(|f| f * f).sum::<f64>().sqrt();
                (table.at(*at) - sure[2]).abs() / length
            });
            let error = error.fold(0.0, f64::max);
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, table));
            }
            if error <= allowed {
                break;
            }
            aim *= 0.1;
        }
        let (error, table) = best.unzip();
        Self {
            relative_error: self.relative_error + error.unwrap_or(0.0),
            table,
            ..self
        }
    }

    /// Force at one place, N, solved for it.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        self.pull.forces_n(&[at_m])[0]
    }

    /// Vertical forces, N: by the table, if there is one.
    #[must_use]
    pub fn forces_z_n(&self, places_m: &[[f64; 3]]) -> Vec<f64> {
        match &self.table {
            Some(table) => places_m.iter().map(|at| table.at(*at)).collect(),
            None => {
                let forces = self.pull.forces_n(places_m);
                forces.into_iter().map(|force| force[2]).collect()
            }
        }
    }

    /// The same by another route: the slope of the magnet's energy, solved for every place.
    #[must_use]
    pub fn slopes_z_n(&self, places_m: &[[f64; 3]]) -> Vec<f64> {
        const STEPS: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
        let step_m = |at: &[f64; 3]| STEP * (at[2] - self.top_m);
        let moved = |at: &[f64; 3]| STEPS.map(|k| [at[0], at[1], at[2] + k * step_m(at)]);
        let places: Vec<[f64; 3]> = places_m.iter().flat_map(moved).collect();
        let energies = self.pull.energies_j(&places);
        let slope = |(w, at): (&[f64], &[f64; 3])| {
            -(w[0] - 8.0 * w[1] + 8.0 * w[2] - w[3]) / (12.0 * step_m(at))
        };
        energies
            .chunks_exact(STEPS.len())
            .zip(places_m)
            .map(slope)
            .collect()
    }
}

/// Moment and, where it is not a point, size of the magnet.
pub(super) fn magnet_of(scene: &Scene) -> ([f64; 3], Option<Cylinder>) {
    (scene.moment_a_m2, cylinder_of(scene.design))
}

pub(super) fn too_close(region: Region, fault: NoPull) -> RunError {
    RunError::Input(format!(
        "the pull of the unpowered steel on a magnet whose centre is {:.3} mm high or higher: {fault}; raise the object, \
         or lower the steel",
        region.z_m[0] * 1e3
    ))
}
