//! Fields by another route than the bundle's.

use crate::field::components::Components;
use rayon::prelude::*;

use super::Bounds;
use crate::RunError;
use crate::bundle::load::Bundle;
use crate::field::magnet::MagnetRule;
use crate::field::winding::KERNEL_ERROR;
use crate::scene::Scene;
use crate::scene::steel::{self, Solved};

/// Map nodes sampled, and force-matrix entries sampled.
const SAMPLES: usize = 2000;
/// The fewest that are sampled.
const FEWEST: usize = 200;

/// Fields by another route than the bundle's: the winding's derivative integrated over its
/// section, the steel solved again and finer, the magnet by a finer rule.
pub(super) struct Route<'a> {
    pub(super) scene: &'a Scene<'a>,
    pub(super) solved: Solved,
    rule: MagnetRule,
}

/// How much finer than the bundle's tolerance steel and magnet are computed again.
pub(super) const FINER: f64 = 0.3;

impl<'a> Route<'a> {
    pub(super) fn new(
        scene: &'a Scene<'a>,
        bundle: &Bundle,
        bounds: &Bounds,
    ) -> Result<Self, RunError> {
        let lowest_m = bundle.map.z_m.first().copied().unwrap_or(0.0);
        let tolerance = FINER * bounds.map.min(bounds.forces).max(KERNEL_ERROR);
        Ok(Self {
            scene,
            solved: steel::solve(scene, tolerance, lowest_m)?,
            rule: scene.magnet_rule(lowest_m, tolerance)?,
        })
    }

    /// Places sampled: fewer where the magnet is made of many dipoles, each of which costs as much
    /// as a place.
    pub(super) fn samples(&self) -> usize {
        (SAMPLES / self.rule.nodes().len().max(1)).clamp(FEWEST, SAMPLES)
    }

    /// dB_x/dz, dB_y/dz, dB_z/dz of a coil at a point, the mean that the magnet feels, gains
    /// applied; for every (coil, point).
    pub(super) fn gradients(
        &self,
        requested: &[(usize, [f64; 3])],
    ) -> Result<Vec<[f64; 3]>, RunError> {
        let centres: Vec<[f64; 3]> = requested.iter().map(|(_, point)| *point).collect();
        let moment = self.scene.moment_a_m2;
        let square: f64 = moment.iter().map(|m| m * m).sum();
        let mut out = vec![[0.0; 3]; requested.len()];
        let sources = self.solved.sources(
            self.scene,
            &centres,
            self.rule.reach_m(),
            self.rule.amplification(),
        )?;
        for node in self.rule.nodes() {
            let share: f64 = node
                .moment_a_m2
                .iter()
                .zip(moment)
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / square;
            let places: Vec<[f64; 3]> = centres
                .iter()
                .map(|p| std::array::from_fn(|i| p[i] + node.offset_m[i]))
                .collect();
            let steel = match &sources {
                Some(sources) => {
                    let parts = Components::Gradient;
                    self.scene.steel_fields(sources, &places, parts)
                }
                None => Vec::new(),
            };
            out.par_iter_mut().enumerate().for_each(|(row, sums)| {
                let (coil, place) = (&self.scene.coils[requested[row].0], places[row]);
                let (dx, dy) = (place[0] - coil.axis_m[0], place[1] - coil.axis_m[1]);
                let (zz, rz_over_r) = of_winding(self.scene, dx.hypot(dy), place[2]);
                let part = |component: usize| {
                    let block = requested[row].0 * Components::Gradient.count() + component;
                    steel
                        .get(block * places.len() + row)
                        .copied()
                        .unwrap_or(0.0)
                };
                let factor = coil.gain * share;
                sums[0] += factor * (rz_over_r * dx + part(2));
                sums[1] += factor * (rz_over_r * dy + part(3));
                sums[2] += factor * (zz + part(4));
            });
        }
        Ok(out)
    }
}

/// dB_z/dz and (dB_r/dz)/r of a winding at a point, integrated over the section. Close to the end
/// face, where that integral is nearly singular, the exact kernel serves; on an edge nothing agrees.
fn of_winding(scene: &Scene, r_m: f64, z_m: f64) -> (f64, f64) {
    const CLOSE: f64 = 0.01;
    if z_m < CLOSE * scene.winding.outer_radius_m {
        return scene
            .winding
            .field(r_m, z_m)
            .map_or((f64::INFINITY, f64::INFINITY), |field| {
                (field.dbz_dz, field.dbr_dz_over_r)
            });
    }
    scene.winding.gradient_by_section(r_m, z_m)
}
