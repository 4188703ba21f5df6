//! `lambda --feedback --shell`: the same demand above and below the surface.

use crate::RunError;
use crate::accuracy::StageAccuracy;
use crate::bundle::lambda_file::FeedbackShell;
use crate::lambda::ForceProblem;
use crate::lambda::between::{Gap, Strongest, gaps};
use crate::lambda::feedback::{Reachable, Span, reachable};
use crate::progress::Progress;
use crate::scene::passive::{self, Pull};

use super::PosedProblem;
use super::feedback::{floor_m, largest_given};

/// Layers of a shell lie no further apart, m.
const SPACING_M: f64 = 2e-3;
/// Layers above the surface, at most: a shell is not a search of all space.
const MOST_LAYERS: f64 = 500.0;
/// Between layers lambda is found to this, relative to it.
const TOLERANCE: f64 = 1e-3;
/// Gaps are split at most so many times.
const SPLITS: usize = 20;
/// A lambda below this part of that of the layers is none: a force that changes its sign is zero in between.
const NOTHING: f64 = 1e-9;

impl PosedProblem<'_> {
    /// The force constant that can be given within `reach_m` above and below the surface, and its error.
    ///
    /// # Errors
    /// Places that cannot be computed; interruption.
    pub(super) fn shell(
        &self,
        reach_m: f64,
        progress: &dyn Progress,
    ) -> Result<(FeedbackShell, Option<StageAccuracy>), RunError> {
        let layers = Layers::new(reach_m, floor_m(self.scene, self.points.lowest_m()))?;
        let positions_m = &self.points.positions_m;
        let height_m = self.problem.height_m;
        let forces = ShellForces::new(self, &layers, progress)?;
        let (mut all, mut every_second) = (Span::default(), Span::default());
        let mut open = Vec::new();
        let mut below: Vec<Strongest> = Vec::new();
        for k in 0..layers.count() {
            let places = layers.places(k, positions_m);
            let (reach, strongest) = forces.at(&places, height_m)?;
            all.add(height_m, &reach);
            below.push(strongest);
            if k % 2 == 0 {
                every_second.add(height_m, &reach);
                if let [from, between, to] = &below[..] {
                    let heights_m = [k - 2, k - 1, k].map(|layer| layers.lift_m(layer));
                    open.extend(gaps([from, between, to], |_| heights_m));
                    below.drain(..2);
                }
                // Only what falls below the smallest so far can decide.
                let smallest = all.largest().map_or(0.0, |found| found.lambda_n_per_m);
                open.retain(|gap: &Gap| gap.least_n_per_m < smallest);
            }
        }
        let between = match all.largest() {
            Ok(_) => self.between(&layers, &forces, &mut all, open)?,
            Err(_) => Between::default(),
        };
        let largest = all.largest();
        let stage = largest.ok().map(|found| StageAccuracy {
            estimate: (1.0 - between.least_n_per_m / found.lambda_n_per_m).max(0.0),
            relative_to: "lambda of the shell".to_owned(),
            method: "an estimate: between neighbouring places the largest force is no less than the best \
                     currents of either give, and those forces bend like parabolas"
                .to_owned(),
        });
        let coarse = every_second.largest().ok();
        let shell = FeedbackShell {
            reach_m,
            layers: layers.count(),
            spacing_m: reach_m / layers.steps as f64,
            floor_m: layers.floor_m,
            clipped: layers.clipped(&self.points.height_m),
            places: layers.count() * height_m.len(),
            places_between: between.places_m.iter().map(Vec::len).sum(),
            largest: largest_given(largest, |at| match at.layer.checked_sub(layers.count()) {
                Some(split) => between.places_m[split][at.place],
                None => layers.places(at.layer, positions_m)[at.place],
            }),
            smallest_lambda_n_per_m: all.smallest_n_per_m(),
            every_second_lambda_n_per_m: coarse.map(|largest| largest.lambda_n_per_m),
        };
        Ok((shell, stage))
    }

    /// Splits the gaps in which lambda may be smaller, until none can change it any more.
    fn between(
        &self,
        layers: &Layers,
        forces: &ShellForces,
        all: &mut Span,
        mut open: Vec<Gap>,
    ) -> Result<Between, RunError> {
        let mut found = Between::default();
        let of_layers = all.largest().map_or(0.0, |found| found.lambda_n_per_m);
        for split in 0.. {
            let decided = all.largest().ok();
            let smallest = decided.map_or(0.0, |found| found.lambda_n_per_m);
            if let Some(decided) = decided
                && smallest < NOTHING * of_layers
            {
                let [least_n, most_n] = [vec![0.0], vec![0.0]];
                let felt_m = [self.problem.height_m[decided.point]];
                all.add_over(&felt_m, &Reachable { least_n, most_n }, |_| decided.point);
                break;
            }
            let known = |gap: &Gap| gap.least_n_per_m >= (1.0 - TOLERANCE) * smallest;
            let done = |gap: &Gap| split == SPLITS || smallest == 0.0 || known(gap);
            let (closed, split): (Vec<Gap>, Vec<Gap>) = open.into_iter().partition(done);
            let least = closed.iter().map(|gap| gap.least_n_per_m);
            found.least_n_per_m = least.fold(found.least_n_per_m, f64::min);
            if split.is_empty() {
                break;
            }
            let heights_m =
                |at: usize| [split[at].ends_m[0], split[at].lowest_m, split[at].ends_m[1]];
            let felt_m: Vec<f64> = split
                .iter()
                .map(|gap| self.problem.height_m[gap.point])
                .collect();
            let places = |which: usize| -> Vec<[f64; 3]> {
                let places = split.iter().enumerate();
                let place = |(at, gap): (usize, &Gap)| {
                    layers.place(self.points.positions_m[gap.point], heights_m(at)[which])
                };
                places.map(place).collect()
            };
            let (reach, lowest) = forces.at(&places(1), &felt_m)?;
            let [(_, from), (_, to)] = [
                forces.at(&places(0), &felt_m)?,
                forces.at(&places(2), &felt_m)?,
            ];
            all.add_over(&felt_m, &reach, |place| split[place].point);
            found.places_m.push(places(1));
            let of_surface = |gap: Gap| Gap {
                point: split[gap.point].point,
                ..gap
            };
            open = gaps([&from, &lowest, &to], heights_m)
                .into_iter()
                .map(of_surface)
                .collect();
        }
        Ok(found)
    }
}

/// What was found between the layers.
struct Between {
    /// Lambda is no less there, N/m.
    least_n_per_m: f64,
    /// Places looked at, split by split.
    places_m: Vec<Vec<[f64; 3]>>,
}

impl Default for Between {
    fn default() -> Self {
        Self {
            least_n_per_m: f64::INFINITY,
            places_m: Vec::new(),
        }
    }
}

/// Forces within reach in a shell.
struct ShellForces<'a> {
    posed: &'a PosedProblem<'a>,
    pull: Option<Pull>,
    progress: &'a dyn Progress,
}

impl<'a> ShellForces<'a> {
    /// # Errors
    /// A magnet that touches the steel.
    fn new(
        posed: &'a PosedProblem,
        layers: &Layers,
        progress: &'a dyn Progress,
    ) -> Result<Self, RunError> {
        // The steel's pull is solved once, for both ends of the shell.
        let ends =
            [0, layers.count() - 1].map(|layer| layers.places(layer, &posed.points.positions_m));
        let pull = match posed.problem.offset_n {
            Some(_) => passive::pull(posed.scene, &ends.concat(), false)?,
            None => None,
        };
        Ok(Self {
            posed,
            pull,
            progress,
        })
    }

    /// At places over points whose heights are given.
    ///
    /// # Errors
    /// Places that cannot be computed; interruption.
    fn at(
        &self,
        places: &[[f64; 3]],
        height_m: &[f64],
    ) -> Result<(Reachable, Strongest), RunError> {
        let posed = self.posed;
        let forces = (posed.scene).forces_n_per_a(posed.solved, places, self.progress)?;
        let offset_n = self.pull.as_ref().map(|pull| pull.forces_z_n(places));
        let unwired = ForceProblem {
            forces_n_per_a: &forces,
            height_m,
            offset_n: offset_n.as_deref(),
            weights: None,
            ..posed.unwired
        };
        let rewired = (posed.options.wiring).apply(&unwired, posed.scene.design.supply.voltage_v);
        let problem = rewired.problem(&unwired);
        Ok((reachable(&problem)?, Strongest::new(&problem)?))
    }
}

/// Copies of the surface, evenly spaced above and below it.
struct Layers {
    reach_m: f64,
    /// Layers above the surface, and below it.
    steps: usize,
    /// No place is lower, m.
    floor_m: f64,
}

impl Layers {
    /// # Errors
    /// A reach beyond what a finger leaves a surface by.
    fn new(reach_m: f64, floor_m: f64) -> Result<Self, RunError> {
        // Two steps at a time up and down, so that every second layer holds both ends too.
        let pairs = (reach_m / (2.0 * SPACING_M) * (1.0 - 1e-12)).ceil();
        if pairs > 0.5 * MOST_LAYERS {
            return Err(RunError::Input(format!(
                "--shell {} mm is more than {} mm: no finger leaves a surface so far",
                reach_m * 1e3,
                MOST_LAYERS * SPACING_M * 1e3
            )));
        }
        Ok(Self {
            reach_m,
            steps: 2 * pairs.max(1.0) as usize,
            floor_m,
        })
    }

    fn count(&self) -> usize {
        2 * self.steps + 1
    }

    /// Height of a layer above the surface, m.
    fn lift_m(&self, layer: usize) -> f64 {
        self.reach_m * (layer as f64 / self.steps as f64 - 1.0)
    }

    /// The place above or below a point of the surface.
    fn place(&self, [x, y, z]: [f64; 3], lift_m: f64) -> [f64; 3] {
        [x, y, (z + lift_m).max(self.floor_m)]
    }

    fn places(&self, layer: usize, surface_m: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let lift_m = self.lift_m(layer);
        surface_m
            .iter()
            .map(|point| self.place(*point, lift_m))
            .collect()
    }

    /// Places of all layers that would be below the floor.
    fn clipped(&self, height_m: &[f64]) -> usize {
        let below = |layer: usize| {
            let lift_m = self.lift_m(layer);
            let heights = height_m.iter();
            heights.filter(|h| **h + lift_m < self.floor_m).count()
        };
        (0..self.count()).map(below).sum()
    }
}
