//! Coupled arrays solved to a tolerance; of many cores in blocks of drives, which several runs or machines
//! may share.
//!
//! Resolutions are compared by all drives of a few cores, of many by some that are not equivalent and the
//! places about them. The others are then solved once, by the resolution that does, in blocks that depend
//! on the array alone: whoever solves a block, its numbers are the same to the bit.

use std::f64::consts::TAU;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::array::{CoupledArray, MOST_WHOLE, closest_m, grids_at_once, representatives};
use super::array_resolution::{ArrayResolution, MOST_MODES};
use super::clearance::Clearance;
use super::cored_coil::Excitation;
use super::equivalent_dipoles::{ArraySources, spread_over};
use super::generatrix::Resolution;
pub use super::reduced_coupling::SolvedBlock;
use super::reduced_coupling::{BLOCK, ReducedCoupling};
use super::symmetry::motions;
use super::{CLOSEST, CoreShape};
use crate::components::Components;
use crate::winding::{OnEdge, Winding};
use fluxform_base::units::MU_0_T_M_PER_A;

/// Refinements after which a tolerance that is not reached is given up, with its estimate.
const MOST_REFINEMENTS: usize = 4;
/// The first resolution's aim, in tolerances: resolutions do better than they aim at as a rule.
pub(super) const FIRST_AIM: f64 = 2.0;
/// What a refinement makes of the aim.
pub(super) const FINER: f64 = 0.3;
/// Heights above the cores, in radii, below which the outline is resolved for places close to it, and
/// below which places are so close that drives are chosen by which resolutions are compared.
const NEAR: f64 = 0.5;
const CLOSE: f64 = 0.1;
/// Modes that each refinement adds where places close to the cores are requested.
const MODES_NEAR: usize = 2;
/// Drives of many coils by which two resolutions are compared, at most, and the distance of the coils
/// about which, in the smallest of two.
const MOST_COMPARED: usize = 8;
const BESIDE: f64 = 1.6;
/// Drives up to which all make one block: to solve a few by themselves would take longer.
const MOST_AT_ONCE: usize = 12;
/// Places about every coil at which two resolutions are compared, in units of its outer radius.
const PLACES: [[f64; 2]; 5] = [[0.0, 0.0], [0.6, 0.2], [0.7, 0.2], [-0.4, 1.1], [1.5, -1.2]];
/// Angles beside a core at which they are compared, and the depths there, of that to which places go.
const ANGLES_BESIDE: usize = 8;
const DEPTHS_BESIDE: [f64; 2] = [0.1, 0.5];
/// By what distances may differ in rounding, relative.
const ROUNDING: f64 = 1e-9;

/// Places about an axis at which two resolutions are compared.
struct Places {
    clearance: Clearance,
    heights_m: Vec<f64>,
    offsets_m: Vec<[f64; 2]>,
}

/// An array that is to be solved to a tolerance.
///
/// Domain: as for [`CoupledArray::at_resolution`].
#[derive(Debug, Clone, Copy)]
pub struct ArrayRequest<'a> {
    /// The winding of every coil.
    pub winding: &'a Winding,
    /// Every core.
    pub shape: CoreShape,
    /// Of the cores.
    pub relative_permeability: f64,
    /// Axes, m.
    pub positions_m: &'a [[f64; 2]],
    /// The largest estimated error, as [`CoupledArray::relative_error`] has it.
    pub tolerance: f64,
    /// Places are no lower, m; negative infinity where the solution is to depend on no places, whose error
    /// [`ArrayRequest::error_at`] states.
    pub lowest_m: f64,
}

/// The resolution that was chosen for an array of many cores, and the drives that it was chosen by.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Choice {
    refinement: usize,
    relative_error: f64,
    compared: SolvedBlock,
}

/// Where the solved parts of one array are kept; all of them belong to the same [`ArrayRequest`].
pub trait DriveCache {
    /// The choice, if a run has made it.
    fn choice(&self) -> Option<Choice>;
    /// Keeps it.
    fn keep_choice(&self, choice: &Choice);
    /// A block, if a run has solved it.
    fn block(&self, number: usize) -> Option<SolvedBlock>;
    /// Keeps it.
    fn keep_block(&self, number: usize, block: &SolvedBlock);
}

/// Nothing is kept.
#[derive(Debug, Clone, Copy)]
pub struct NoCache;

impl DriveCache for NoCache {
    fn choice(&self) -> Option<Choice> {
        None
    }
    fn keep_choice(&self, _: &Choice) {}
    fn block(&self, _: usize) -> Option<SolvedBlock> {
        None
    }
    fn keep_block(&self, _: usize, _: &SolvedBlock) {}
}

/// An array at one resolution.
struct Attempt<'a> {
    refinement: usize,
    /// Coupled for the compared drives at least.
    array: CoupledArray,
    /// Of many cores what solves other drives, and the drives that were compared.
    coupling: Option<ReducedCoupling<'a>>,
    compared: Option<SolvedBlock>,
}

impl CoupledArray {
    /// Solves to an estimated error below `tolerance` at heights from `lowest_m` up, or as far as
    /// the caps on resolution allow: [`CoupledArray::relative_error`] says what was reached.
    ///
    /// Domain: as for [`CoupledArray::at_resolution`].
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub fn new(
        winding: &Winding,
        shape: CoreShape,
        relative_permeability: f64,
        positions_m: &[[f64; 2]],
        tolerance: f64,
        lowest_m: f64,
    ) -> Result<Self, OnEdge> {
        let request = ArrayRequest {
            winding,
            shape,
            relative_permeability,
            positions_m,
            tolerance,
            lowest_m,
        };
        request.solve(&NoCache)
    }

    /// The larger difference of gradients and inductances from those of `other` for `drives`, at
    /// `places` about the axes `about`, evaluated well within `tolerance`.
    fn difference(
        &self,
        other: &Self,
        (drives, about): (&[usize], &[[f64; 2]]),
        places: &[Places],
        tolerance: f64,
    ) -> Result<f64, OnEdge> {
        let mut worst = 0.0_f64;
        for places in places {
            worst =
                worst.max(self.gradient_difference(other, (drives, about), places, tolerance)?);
        }
        let added = &self.added_inductance_h;
        let size = added
            .amax()
            .max(0.1 * MU_0_T_M_PER_A * self.winding.turns.powi(2) * self.winding.inner_radius_m);
        Ok(worst.max((added - &other.added_inductance_h).amax() / size))
    }

    /// The largest difference of gradients at `places`, relative to the largest at their height.
    fn gradient_difference(
        &self,
        other: &Self,
        (drives, about): (&[usize], &[[f64; 2]]),
        places: &Places,
        tolerance: f64,
    ) -> Result<f64, OnEdge> {
        let shape = self.response.outline.shape;
        let near = (places.clearance, 0.05 * tolerance);
        let sources = |array: &Self| {
            if drives.len() == array.positions_m.len() {
                ArraySources::of_coils(array, near, false)
            } else {
                ArraySources::of_drives(array, drives, near, false)
            }
        };
        let (fine, coarse) = rayon::join(|| sources(self), || sources(other));
        let parts = Components::Gradient;
        let mut worst = 0.0_f64;
        for z_m in &places.heights_m {
            // Beside one core may be in another.
            let is_clear = |[x, y, z]: &[f64; 3]| {
                let mut cores = self.positions_m.iter();
                let least_m = (1.0 - ROUNDING) * places.clearance.distance_m;
                cores.all(|[cx, cy]| shape.distance_m((x - cx).hypot(y - cy), *z) >= least_m)
            };
            let points: Vec<[f64; 3]> = (about.iter())
                .flat_map(|[x, y]| {
                    let offsets_m = places.offsets_m.iter();
                    offsets_m.map(move |[dx, dy]| [x + dx, y + dy, *z_m])
                })
                .filter(is_clear)
                .collect();
            let mut values = vec![0.0; drives.len() * parts.count() * points.len()];
            let mut others = values.clone();
            fine.sample(&points, parts, &mut values);
            coarse.sample(&points, parts, &mut others);
            // The winding's own gradient adds to the largest, which lies above it.
            let air = self.winding.field(0.0, *z_m)?.gradient_norm();
            let size = values.iter().fold(0.0_f64, |m, v| m.max(v.abs())) + air;
            let difference = values
                .iter()
                .zip(&others)
                .fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            worst = worst.max(difference / size);
        }
        Ok(worst)
    }
}

impl<'a> ArrayRequest<'a> {
    /// The drives of every block: the first holds those that are compared. None of a few cores, which are
    /// solved whole.
    fn drives_of_blocks(&self) -> Vec<Vec<usize>> {
        let cores = self.positions_m.len();
        if cores <= MOST_WHOLE {
            return Vec::new();
        }
        let first = representatives(cores, &motions(self.positions_m));
        if first.len() <= MOST_AT_ONCE {
            return vec![first];
        }
        let chosen = spread_over(first.len(), MOST_COMPARED);
        let compared = chosen.iter().map(|k| first[*k]).collect();
        let others: Vec<usize> = (0..first.len())
            .filter(|k| !chosen.contains(k))
            .map(|k| first[k])
            .collect();
        let mut blocks = vec![compared];
        blocks.extend(others.chunks(BLOCK).map(<[usize]>::to_vec));
        blocks
    }

    /// Number of blocks of drives; 0 of a few cores, which are solved at once.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.drives_of_blocks().len()
    }

    /// Solves the array, and keeps the blocks that `cache` does not hold yet.
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub fn solve(&self, cache: &dyn DriveCache) -> Result<CoupledArray, OnEdge> {
        let blocks = self.drives_of_blocks();
        if blocks.is_empty() {
            return Ok(self.best()?.array);
        }
        let (choice, mut attempt) = self.choice(cache, &blocks[0])?;
        let mut solved = vec![choice.compared];
        for (number, drives) in blocks.iter().enumerate().skip(1) {
            let known = cache.block(number).filter(|block| block.drives == *drives);
            solved.push(match known {
                Some(block) => block,
                None => {
                    let block = self.solve_block(drives, choice.refinement, &mut attempt)?;
                    cache.keep_block(number, &block);
                    block
                }
            });
        }
        let mut array = match attempt {
            Some(attempt) => attempt.array,
            None => self.uncoupled(&self.resolutions(choice.refinement)[1])?.0,
        };
        array.join(&solved);
        array.relative_error = choice.relative_error;
        array.refinement = choice.refinement;
        Ok(array)
    }

    /// Solves those of the blocks `numbers` that `cache` does not hold, and keeps them; how many they were.
    /// The choice of the resolution is the first block, and solved with any other that it is missing for.
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub fn solve_blocks(
        &self,
        numbers: Range<usize>,
        cache: &dyn DriveCache,
    ) -> Result<usize, OnEdge> {
        let blocks = self.drives_of_blocks();
        if numbers.is_empty() {
            return Ok(0);
        }
        let (choice, mut attempt) = self.choice(cache, &blocks[0])?;
        let mut solved = usize::from(numbers.contains(&0) && attempt.is_some());
        for number in numbers.filter(|number| *number > 0) {
            let drives = &blocks[number];
            if cache
                .block(number)
                .is_none_or(|block| block.drives != *drives)
            {
                let block = self.solve_block(drives, choice.refinement, &mut attempt)?;
                cache.keep_block(number, &block);
                solved += 1;
            }
        }
        Ok(solved)
    }

    /// The choice of the resolution by the drives `compared`, and what it was made from if that was now.
    fn choice(
        &self,
        cache: &dyn DriveCache,
        compared: &[usize],
    ) -> Result<(Choice, Option<Attempt<'a>>), OnEdge> {
        let known = cache.choice();
        if let Some(choice) = known.filter(|choice| choice.compared.drives == compared) {
            return Ok((choice, None));
        }
        let mut best = self.best()?;
        let choice = Choice {
            refinement: best.refinement,
            relative_error: best.array.relative_error,
            compared: best
                .compared
                .take()
                .expect("of many cores some drives are compared"),
        };
        cache.keep_choice(&choice);
        Ok((choice, Some(best)))
    }

    /// Solves some drives of many cores after a refinement, by the exchange that `attempt` has or is given.
    fn solve_block(
        &self,
        drives: &[usize],
        refinement: usize,
        attempt: &mut Option<Attempt<'a>>,
    ) -> Result<SolvedBlock, OnEdge> {
        let [_, resolution] = self.resolutions(refinement);
        let coupling = match attempt.take() {
            Some(Attempt {
                coupling: Some(coupling),
                array,
                ..
            }) => (array, coupling),
            _ => self.many(&resolution)?,
        };
        let block = coupling.1.solve(drives, resolution.residual);
        *attempt = Some(Attempt {
            refinement,
            array: coupling.0,
            coupling: Some(coupling.1),
            compared: None,
        });
        Ok(block)
    }

    /// The coarse and the fine resolution after some refinements.
    fn resolutions(&self, refinement: usize) -> [ArrayResolution; 2] {
        let (shape, positions_m) = (self.shape, self.positions_m);
        let aim = (0..refinement).fold(FIRST_AIM * self.tolerance, |aim, _| FINER * aim);
        let mut fine = ArrayResolution::for_tolerance(aim, shape, closest_m(positions_m));
        let near = self.clearance().lowest_m < shape.top_m.max(0.0) + NEAR * shape.radius_m;
        if near && fine.modes > 1 {
            // Close to a core its own modes are seen, before they have come back from another.
            fine.modes = (fine.modes + MODES_NEAR * refinement).min(MOST_MODES);
        }
        let offsets = grids_at_once(positions_m);
        let mut fine = fine.within_memory(shape, self.winding.length_m, offsets);
        let mut coarse = fine.reference(shape, closest_m(positions_m));
        if near {
            fine.outline = Resolution::near_steel(0.3 * aim);
            coarse.outline = fine.outline.coarser_near_steel();
        }
        [coarse, fine]
    }

    /// The height below which places are close to the cores, m.
    fn close_m(&self) -> f64 {
        self.shape.top_m + CLOSE * self.shape.radius_m
    }

    /// Of the places by which a resolution is chosen: where they may be anywhere, above the array.
    fn clearance(&self) -> Clearance {
        let closest_m = CLOSEST * self.shape.radius_m;
        if self.lowest_m == f64::NEG_INFINITY {
            Clearance::above(self.close_m(), closest_m)
        } else {
            Clearance::above(self.lowest_m, closest_m)
        }
    }

    /// The error that `array`, which this request was solved as, has at groups of places with `clearances`: more than
    /// stated by itself where they are close to the cores.
    ///
    /// # Errors
    /// A node of the outline on the winding's edge.
    pub fn error_at(&self, array: &CoupledArray, clearances: &[Clearance]) -> Result<f64, OnEdge> {
        let close = clearances.iter().filter(|c| c.lowest_m < self.close_m());
        let close: Vec<Clearance> = close.copied().collect();
        let mut error = array.relative_error;
        if close.is_empty() {
            return Ok(error);
        }
        let [coarse, _] = self.resolutions(array.refinement);
        let coarse = self.attempt(array.refinement, &coarse, &self.first_block())?;
        for clearance in close {
            let (drives, about) = self.compared(clearance);
            let compared = (&drives[..], &about[..]);
            let places = self.places(clearance);
            let of_group = array.difference(&coarse.array, compared, &places, self.tolerance)?;
            error = error.max(of_group);
        }
        Ok(error)
    }

    /// Where two resolutions are compared for places with `clearance`: above the array, and beside the cores
    /// where places go as low.
    fn places(&self, clearance: Clearance) -> Vec<Places> {
        let shape = self.shape;
        let distance_m = clearance.distance_m.max(CLOSEST * shape.radius_m);
        let lowest_m = clearance.lowest_m.max(shape.top_m + distance_m);
        let reach_m = self.winding.outer_radius_m;
        let mut places = Vec::new();
        let above = Places {
            clearance: Clearance::above(lowest_m, lowest_m - shape.top_m),
            heights_m: [0.0, 1.0, 4.0]
                .map(|radii| lowest_m + radii * shape.radius_m)
                .to_vec(),
            offsets_m: PLACES.map(|offset| offset.map(|by| reach_m * by)).to_vec(),
        };
        if lowest_m <= clearance.highest_m {
            places.push(above);
        }
        let end_m = clearance.lowest_m.max(shape.bottom_m);
        let begin_m = clearance.highest_m.min(shape.top_m);
        if end_m < shape.top_m && end_m <= begin_m {
            let offsets_m: Vec<[f64; 2]> = (0..ANGLES_BESIDE)
                .map(|k| {
                    let (s, c) = (TAU * k as f64 / ANGLES_BESIDE as f64).sin_cos();
                    [c, s].map(|by| by * (shape.radius_m + distance_m))
                })
                .collect();
            // Places of one height have one depth.
            let depths = usize::from(end_m < begin_m) + 1;
            places.extend(DEPTHS_BESIDE[..depths].iter().map(|part| {
                let z_m = begin_m - part * (begin_m - end_m);
                Places {
                    clearance: Clearance {
                        lowest_m: z_m,
                        highest_m: z_m,
                        distance_m,
                    },
                    heights_m: vec![z_m],
                    offsets_m: offsets_m.clone(),
                }
            }));
        }
        places
    }

    /// The array at the first resolution that does, or that of the least estimated error; of many cores
    /// solved for the compared drives alone.
    fn best(&self) -> Result<Attempt<'a>, OnEdge> {
        let (drives, about) = self.compared(self.clearance());
        let places = self.places(self.clearance());
        let solved = self.first_block();
        let mut not_better = 0;
        let mut best: Option<Attempt<'a>> = None;
        for refinement in 0..=MOST_REFINEMENTS {
            let [coarse, fine] = self.resolutions(refinement);
            // Where the caps bind, two wrong solutions may agree by chance.
            let exchange = 2.0 * fine.exchange_error(self.shape, closest_m(self.positions_m));
            let of_coarse = || (self.attempt(refinement, &coarse, &solved)).map(|made| made.array);
            let of_fine = || self.attempt(refinement, &fine, &solved);
            // The matrices of many cores take too much memory for two at a time.
            let (coarse, fine) = if solved.is_empty() {
                rayon::join(of_coarse, of_fine)
            } else {
                (of_coarse(), of_fine())
            };
            let (coarse, mut fine) = (coarse?, fine?);
            let compared = (&drives[..], &about[..]);
            let difference = (fine.array).difference(&coarse, compared, &places, self.tolerance)?;
            let error = exchange.max(difference);
            fine.array.relative_error = error;
            fine.array.refinement = refinement;
            let better = best.as_ref().is_none_or(|b| error < b.array.relative_error);
            let reached = error <= self.tolerance;
            if better {
                if !reached {
                    // The next resolution's matrices take its memory.
                    fine.coupling = None;
                }
                best = Some(fine);
            }
            // At the caps a finer resolution is no better at what the closest cores exchange.
            let [_, finer] = self.resolutions(refinement + 1);
            let capped =
                finer.exchange_error(self.shape, closest_m(self.positions_m)) >= 0.5 * exchange;
            // Once, two wrong solutions may agree by chance.
            not_better = if better { 0 } else { not_better + 1 };
            if reached || not_better > 1 || (exchange > self.tolerance && capped) {
                break;
            }
        }
        Ok(best.expect("at least one resolution was solved"))
    }

    /// The array at one resolution, of many cores for `drives`.
    fn attempt(
        &self,
        refinement: usize,
        resolution: &ArrayResolution,
        drives: &[usize],
    ) -> Result<Attempt<'a>, OnEdge> {
        if self.positions_m.len() <= MOST_WHOLE {
            let array = CoupledArray::at_resolution(
                self.winding,
                self.shape,
                self.relative_permeability,
                self.positions_m,
                resolution,
            )?;
            return Ok(Attempt {
                refinement,
                array,
                coupling: None,
                compared: None,
            });
        }
        let (mut array, coupling) = self.many(resolution)?;
        let compared = coupling.solve(drives, resolution.residual);
        array.join(std::slice::from_ref(&compared));
        Ok(Attempt {
            refinement,
            array,
            coupling: Some(coupling),
            compared: Some(compared),
        })
    }

    /// Many cores that are not coupled yet, and what couples them.
    fn many(
        &self,
        resolution: &ArrayResolution,
    ) -> Result<(CoupledArray, ReducedCoupling<'a>), OnEdge> {
        let (array, excitation) = self.uncoupled(resolution)?;
        let coupling = array.reduced(&excitation, resolution, self.positions_m);
        Ok((array, coupling))
    }

    fn uncoupled(
        &self,
        resolution: &ArrayResolution,
    ) -> Result<(CoupledArray, Excitation), OnEdge> {
        CoupledArray::uncoupled(
            self.winding,
            self.shape,
            self.relative_permeability,
            self.positions_m,
            resolution,
        )
    }

    /// The drives of the first block; none of a few cores.
    fn first_block(&self) -> Vec<usize> {
        let blocks = self.drives_of_blocks();
        blocks.into_iter().next().unwrap_or_default()
    }

    /// Drives by which two resolutions are compared, and axes about which: of a few coils all, but where
    /// places are close to the cores, of many those of the first block, and their neighbours.
    fn compared(&self, clearance: Clearance) -> (Vec<usize>, Vec<[f64; 2]>) {
        let all = self.positions_m;
        let Some(block) = self.drives_of_blocks().into_iter().next() else {
            // Close places take many dipoles for every drive, and coils that are equivalent tell nothing new.
            let drives = if clearance.lowest_m < self.close_m() {
                representatives(all.len(), &motions(all))
            } else {
                (0..all.len()).collect()
            };
            return (drives, all.to_vec());
        };
        let chosen = spread_over(block.len(), MOST_COMPARED);
        let drives: Vec<usize> = chosen.into_iter().map(|k| block[k]).collect();
        let reach_m = BESIDE * closest_m(all);
        let beside = |[x, y]: &&[f64; 2]| {
            let apart = |drive: &usize| (all[*drive][0] - x).hypot(all[*drive][1] - y);
            drives.iter().any(|drive| apart(drive) <= reach_m)
        };
        let about = all.iter().filter(beside).copied().collect();
        (drives, about)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A resolution is chosen by some drives: what is claimed holds for the others too.
    #[test]
    fn the_stated_error_covers_drives_that_were_not_compared() {
        let winding = Winding {
            inner_radius_m: 0.0026,
            outer_radius_m: 0.0045,
            length_m: 0.037,
            turns: 700.0,
        };
        let shape = CoreShape {
            radius_m: 0.0025,
            bottom_m: -0.041,
            top_m: 0.0007,
        };
        // A lattice with two holes: no two coils are equivalent.
        let positions_m: Vec<[f64; 2]> = (0..25)
            .filter(|cell| ![3, 16].contains(cell))
            .map(|cell| [0.0097 * f64::from(cell % 5), 0.0097 * f64::from(cell / 5)])
            .collect();
        let request = |tolerance: f64| ArrayRequest {
            winding: &winding,
            shape,
            relative_permeability: 470.0,
            positions_m: &positions_m,
            tolerance,
            lowest_m: 0.013,
        };
        let coarse = request(1e-3);
        let blocks = coarse.drives_of_blocks();
        assert_eq!(blocks.iter().map(Vec::len).collect::<Vec<_>>(), [8, 10, 5]);
        let (array, truth) = (coarse.solve(&NoCache), request(1e-4).solve(&NoCache));
        let (array, truth) = (array.unwrap(), truth.unwrap());
        let others: Vec<usize> = blocks[1..].concat();
        let compared = (&others[..], &positions_m[..]);
        let error = array
            .difference(&truth, compared, &coarse.places(coarse.clearance()), 1e-5)
            .unwrap();
        assert!(
            error < array.relative_error && array.relative_error < 1e-3,
            "{error:e} {:e}",
            array.relative_error
        );
    }
}
