//! A bound that no pitch exceeds: on the gain of arrays in air of which the pitch alone is searched, bounded by
//! branch and bound.
//!
//! Coils in air move along straight lines, and no force moves off the straight line between two
//! pitches by more than the third derivative of the field allows (`Winding::third_derivative_bound`).
//! `lambda::enclosure` turns that into a bound of lambda_jnd between them; the stretch with the largest
//! bound is halved until the bound is near what is known.

use rayon::prelude::*;

use super::physics::{ArrayPhysics, Constant};
use super::together;
use crate::RunError;
use crate::coil::array_search::problem::{ArrayProblem, Level};
use crate::coil::array_search::space::Axis;
use crate::coil::limits::LimitName;
use crate::design::MagnetModel;
use crate::lambda::enclosure::{Between, JndCurrents, jnd_currents};
use crate::lambda::{Criterion, ForceProblem};
use crate::progress::{Progress, Silent};
use crate::scene::{Scene, steel};

/// The bound is near enough at this share above the best.
const GAP: f64 = 1e-3;
/// Stretches at first, and pitches that are computed at most.
const FIRST: usize = 8;
const MOST: usize = 400;
/// Stretches that are halved at once; fixed, so that the result does not depend on threads.
const BATCH: usize = 4;
/// Steps by which the ends of the pitches that can be made are determined.
const STEPS: usize = 50;

/// The bound of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PitchBound {
    /// No pitch of the range gives a larger gain.
    pub gain: f64,
    /// Pitches that were computed.
    pub pitches: usize,
}

/// A pitch that was computed.
struct Node {
    pitch_mm: f64,
    positions_m: Vec<[f64; 2]>,
    /// [point, coil] of all shapes, N/A.
    forces: Vec<f64>,
    /// Of every shape.
    currents: Vec<JndCurrents>,
}

/// A stretch between two nodes, and what no pitch on it exceeds.
struct Stretch {
    ends: [usize; 2],
    gain: f64,
}

/// Data that is the same at every pitch.
struct Bounding<'a> {
    problem: &'a ArrayProblem<'a>,
    physics: &'a ArrayPhysics<'a>,
    scene: &'a Scene<'a>,
    /// Points of all shapes, m.
    positions_m: &'a [[f64; 3]],
    height_m: &'a [f64],
    resistance_ohm: &'a [f64],
    jnd_weight: f64,
    /// Force constants that count as 1, and what the shapes weigh.
    given_n_per_m: &'a [f64],
    shares: Option<&'a [f64]>,
}

/// The bound for `problem`, relative to `given_n_per_m`; `None` where the method does not apply or proves
/// nothing. `known` is the gain of an array that was computed.
///
/// # Errors
/// Interruption.
pub fn pitch_bound(
    problem: &ArrayProblem<'_>,
    physics: &ArrayPhysics<'_>,
    (given_n_per_m, shares): (&[f64], Option<&[f64]>),
    known: f64,
    progress: &dyn Progress,
) -> Result<Option<PitchBound>, RunError> {
    let ([Axis::Pitch], [pitch]) = (problem.space.axes(), problem.space.variables()) else {
        return Ok(None);
    };
    let design = problem.space.design(&[pitch.low]);
    let applies = design.core.is_none()
        && !design.has_iron()
        && design.magnet.model == MagnetModel::Dipole
        && physics.aim().constant == Constant::Static(Criterion::Jnd);
    if !applies {
        return Ok(None);
    }
    let Some(range_mm) = range_that_fits(problem) else {
        return Ok(None);
    };
    let scene = Scene::with_tolerance(&design, physics.tolerance(Level::Full, &design))?;
    let raised_m = problem.space.raised_m(&[range_mm[0]]);
    let positions_m = physics.positions_m(raised_m, Level::Full);
    let height_m: Vec<f64> = positions_m.iter().map(|p| p[2]).collect();
    let bounding = Bounding {
        problem,
        physics,
        scene: &scene,
        positions_m: &positions_m,
        height_m: &height_m,
        resistance_ohm: &scene.resistances_ohm(),
        jnd_weight: physics.aim().jnd_weight,
        given_n_per_m,
        shares,
    };
    progress.begin("bound", 0);
    let bound = bounding.branch(range_mm, known, progress)?;
    progress.end();
    Ok(bound)
}

/// The pitches at which coils do not overlap and the footprint is met: the ends of the range are moved, since
/// both limits are monotone in the pitch.
fn range_that_fits(problem: &ArrayProblem<'_>) -> Option<[f64; 2]> {
    let broken = |pitch_mm: f64, name: LimitName| {
        let bounds = problem.bounds(&[pitch_mm], None);
        bounds
            .iter()
            .any(|bound| bound.name == Some(name) && !bound.is_met())
    };
    let variable = &problem.space.variables()[0];
    let mut range = [variable.low, variable.high];
    for (end, name) in [(0, LimitName::Pitch), (1, LimitName::Footprint)] {
        if !broken(range[end], name) {
            continue;
        }
        let (mut bad, mut good) = (range[end], range[1 - end]);
        if broken(good, name) {
            return None;
        }
        for _ in 0..STEPS {
            let middle = 0.5 * (bad + good);
            if broken(middle, name) {
                bad = middle
            } else {
                good = middle
            }
        }
        // The end that is just not allowed: nothing that is allowed is left out.
        range[end] = bad;
    }
    (range[0] < range[1]).then_some(range)
}

impl Bounding<'_> {
    fn branch(
        &self,
        [low, high]: [f64; 2],
        known: f64,
        progress: &dyn Progress,
    ) -> Result<Option<PitchBound>, RunError> {
        let first: Vec<f64> = (0..=FIRST)
            .map(|k| low + (high - low) * k as f64 / FIRST as f64)
            .collect();
        let Some(mut nodes) = self.nodes(&first)? else {
            return Ok(None);
        };
        let mut open: Vec<Stretch> = (0..FIRST)
            .map(|k| self.stretch(&nodes, [k, k + 1]))
            .collect();
        loop {
            progress.check()?;
            open.sort_by(|a, b| b.gain.total_cmp(&a.gain));
            let best = nodes
                .iter()
                .map(|node| self.gain(node.lambdas()))
                .fold(known, f64::max);
            let gain = open[0].gain.max(best);
            if gain <= best * (1.0 + GAP) || nodes.len() >= MOST {
                let pitches = nodes.len();
                return Ok(gain.is_finite().then_some(PitchBound { gain, pitches }));
            }
            let rest = open.split_off(open.len().min(BATCH));
            let middles: Vec<f64> = open
                .iter()
                .map(|stretch| {
                    stretch
                        .ends
                        .map(|end| 0.5 * nodes[end].pitch_mm)
                        .iter()
                        .sum()
                })
                .collect();
            let Some(new) = self.nodes(&middles)? else {
                return Ok(None);
            };
            progress.advance(new.len() as u64);
            let before = nodes.len();
            nodes.extend(new);
            let halved = open.iter().enumerate().flat_map(|(k, stretch)| {
                let middle = before + k;
                [[stretch.ends[0], middle], [middle, stretch.ends[1]]]
            });
            let halves: Vec<[usize; 2]> = halved.collect();
            open = halves
                .into_par_iter()
                .map(|ends| self.stretch(&nodes, ends))
                .collect();
            open.extend(rest);
        }
    }

    /// `None` where an array renders nothing.
    fn nodes(&self, pitches_mm: &[f64]) -> Result<Option<Vec<Node>>, RunError> {
        let nodes: Vec<Option<Node>> = pitches_mm
            .par_iter()
            .map(|pitch_mm| self.node(*pitch_mm))
            .collect::<Result<_, RunError>>()?;
        Ok(nodes.into_iter().collect())
    }

    fn node(&self, pitch_mm: f64) -> Result<Option<Node>, RunError> {
        let design = self.problem.space.design(&[pitch_mm]);
        let scene = Scene::with_tolerance(&design, self.physics.tolerance(Level::Full, &design))?;
        let solved = steel::solve(&scene, scene.tolerances.forces, self.lowest_m())?;
        let forces = scene.forces_n_per_a(&solved, self.positions_m, &Silent)?;
        let currents = self
            .problems(&forces)
            .iter()
            .map(|problem| Ok(jnd_currents(problem, self.jnd_weight)?))
            .collect::<Result<Option<Vec<_>>, RunError>>()?;
        Ok(currents.map(|currents| Node {
            pitch_mm,
            positions_m: design.array.positions_m.clone(),
            forces,
            currents,
        }))
    }

    fn lowest_m(&self) -> f64 {
        self.height_m.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The problem of every shape with forces at all their points.
    fn problems<'b>(&'b self, forces_n_per_a: &'b [f64]) -> Vec<ForceProblem<'b>> {
        let all = ForceProblem {
            forces_n_per_a,
            height_m: self.height_m,
            offset_n: None,
            weights: None,
            lower_a: &self.scene.lower_a,
            upper_a: &self.scene.upper_a,
            total_max_a: self.scene.design.supply.total_current_max_a,
            resistance_ohm: self.resistance_ohm,
        };
        self.physics.of_shapes(all, Level::Full)
    }

    fn gain(&self, lambdas: impl Iterator<Item = f64>) -> f64 {
        let ratios: Vec<f64> = lambdas
            .zip(self.given_n_per_m)
            .map(|(l, given)| l / given)
            .collect();
        together(&ratios, self.shares)
    }

    fn stretch(&self, nodes: &[Node], ends: [usize; 2]) -> Stretch {
        let [a, b] = ends.map(|end| &nodes[end]);
        let off = self.off_n_per_a([a, b]);
        let problems = [a, b].map(|node| self.problems(&node.forces));
        let offs = self.problems(&off);
        let bounds = (0..offs.len()).map(|shape| {
            Between {
                ends: [&problems[0][shape], &problems[1][shape]],
                currents: [&a.currents[shape], &b.currents[shape]],
            }
            .jnd_bound_n_per_m(offs[shape].forces_n_per_a, self.jnd_weight)
        });
        Stretch {
            ends,
            gain: self.gain(bounds),
        }
    }

    /// How far forces may be off the straight line between two nodes, [point, coil], N/A: from both that the
    /// field bends and that it is computed to a tolerance.
    fn off_n_per_a(&self, [a, b]: [&Node; 2]) -> Vec<f64> {
        let moment_a_m2 = self
            .scene
            .moment_a_m2
            .iter()
            .map(|m| m * m)
            .sum::<f64>()
            .sqrt();
        let winding = &self.scene.winding;
        let all = a.forces.iter().chain(&b.forces);
        let rounded = self.scene.tolerances.forces * all.fold(0.0_f64, |most, f| most.max(f.abs()));
        let moves: Vec<([f64; 2], f64, f64)> = (self.scene.coils.iter())
            .zip(a.positions_m.iter().zip(&b.positions_m))
            .map(|(coil, (p, q))| {
                let middle = [0, 1].map(|axis| 0.5 * (p[axis] + q[axis]));
                let half_m = 0.5 * (p[0] - q[0]).hypot(p[1] - q[1]);
                (middle, half_m, coil.gain.abs() * moment_a_m2)
            })
            .collect();
        let off = self.positions_m.iter().flat_map(|[x, y, z]| {
            moves.iter().map(move |([px, py], half_m, per_t)| {
                let r_m = (x - px).hypot(y - py);
                let radii = [(r_m - half_m).max(0.0), r_m + half_m];
                let bend = per_t * winding.third_derivative_bound(radii, *z);
                // Off the chord of a stretch of length s by at most s^2 / 8 of the second derivative.
                0.5 * half_m * half_m * bend + rounded
            })
        });
        off.collect()
    }
}

impl Node {
    fn lambdas(&self) -> impl Iterator<Item = f64> + '_ {
        self.currents.iter().map(|one| one.lambda_n_per_m)
    }
}
