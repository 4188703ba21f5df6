//! Which parameter would explain what a scan and a design differ by.
//!
//! Each candidate is changed alone and fitted until it settles: the frame, scales and background by
//! [`super::fit`], a key of the design by Gauss-Newton steps within its range, the field of the changed
//! design computed again at every step, coarsely first and as finely as the scan's own field where the
//! coarse one would hide what is left. The share of the residuals' squares that it takes away is
//! reported, and a standard error that holds where the field bends: the larger side of the interval in
//! which the likelihood stays within the 95 % of one number, over 1.96. Candidates with as many free
//! numbers whose likelihoods differ by less than [`DISTINCT`] cannot be distinguished by this scan and are
//! named together.

use rayon::prelude::*;

use super::Weighted;
use super::fit::{self, Fitted, Parameter, parameters};
use super::keys::{Key, keys};
use super::model::{Model, Pose};
use crate::RunError;
use crate::bundle::scan::{Explanation, Scan};
use crate::design::Design;
use crate::numerics::least_squares::{self, norm};
use crate::progress::Progress;
use crate::scene::Scene;
use crate::scene::steel;

/// Most steps of one key of the design.
const ITERATIONS: usize = 10;
/// Most halvings of a step.
const HALVINGS: usize = 6;
/// A step that takes less than this part of what is left ends the iteration.
const SETTLED: f64 = 1e-7;
/// Half the width of the 95 % interval of a normal number, in standard deviations.
const WIDTH: f64 = 1.96;
/// Most fields computed to find one end of an interval.
const PROFILE: usize = 5;
/// The tolerance of steel at which a key is fitted first.
const COARSE: f64 = 1e-3;
/// Where what is left is smaller than so many errors of the coarse field, the finer one decides.
const RESOLVED: f64 = 10.0;
/// Below this share of the differences' step the field does not bend.
const STRAIGHT: f64 = 0.3;
/// An explanation must take this many times more, a parameter, than noise would.
const WORTH: f64 = 12.0;
/// And at least this share.
const WORTH_SHARE: f64 = 0.02;
/// Twice the logarithm of a ratio of likelihoods below which two are alike.
const DISTINCT: f64 = 6.0;

/// A candidate as it settled.
struct Settled {
    name: &'static str,
    /// Weighted sum of the squares that are left.
    left: f64,
    parameters: usize,
    change: Option<f64>,
    standard_error: Option<f64>,
}

/// Data to which every candidate is fitted.
pub(super) struct Task<'a> {
    pub design: &'a Design,
    pub model: &'a Model<'a>,
    pub scan: &'a Scan,
    pub residuals: &'a Weighted,
    /// Tolerance of the computed field; `None` for the default.
    pub tolerance: Option<f64>,
    /// Whether a noise is given.
    pub noise_given: bool,
    /// The claimed relative error of the computed field.
    pub relative_error: f64,
    /// The size of the field, T.
    pub field_t: f64,
    pub progress: &'a dyn Progress,
}

/// A key of the design at a value, and what is left there.
struct At {
    by: f64,
    values: Vec<f64>,
    left: f64,
    /// The claimed relative error of the field.
    relative_error: f64,
}

/// A key and the tolerance at which its designs are computed; `None` for the default.
#[derive(Clone, Copy)]
struct Search<'a> {
    key: &'a Key<'a>,
    tolerance: Option<f64>,
}

/// Everything that is tried, the most telling first, and the best for its number of parameters.
///
/// # Errors
/// Interruption; a scan on a winding's edge or the steel.
pub(super) fn explain(task: &Task) -> Result<(Vec<Explanation>, Option<String>), RunError> {
    let candidates = task.candidates()?;
    let total = squares(&task.residuals.values);
    let count = task.residuals.values.len() as f64;
    // Below the computed field's own error nothing is distinguished.
    let floor = (task.relative_error * task.computed()).powi(2) + 1e-24 * task.measured().powi(2);
    let share = |c: &Settled| {
        if total > 0.0 {
            (1.0 - c.left / total).clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    // Bayes' criterion: more numbers must explain more.
    let cost =
        |c: &Settled| count * (c.left + floor).max(1e-300).ln() + c.parameters as f64 * count.ln();
    let worth = |c: &&Settled| {
        let (free, left) = (c.parameters as f64, (1.0 - share(c)).max(1e-12));
        let ratio = share(c) / free / (left / (count - free).max(1.0));
        ratio > WORTH && share(c) > WORTH_SHARE
    };
    // Of equals the first.
    let best = candidates
        .iter()
        .filter(worth)
        .fold(None::<&Settled>, |best, c| match best {
            Some(b) if cost(b) <= cost(c) + 1e-3 * count => Some(b),
            _ => Some(c),
        });
    let best = best.map(|c| c.name.to_owned());
    let alike = |c: &Settled| -> Vec<String> {
        let others = candidates.iter().filter(worth).filter(|other| {
            other.name != c.name
                && other.parameters == c.parameters
                && (cost(other) - cost(c)).abs() < DISTINCT
        });
        if worth(&c) {
            others.map(|other| other.name.to_owned()).collect()
        } else {
            Vec::new()
        }
    };
    let mut list: Vec<Explanation> = candidates
        .iter()
        .map(|c| Explanation {
            parameter: c.name.to_owned(),
            share: share(c),
            parameters: c.parameters,
            change: c.change,
            standard_error: c.standard_error,
            alike: alike(c),
        })
        .collect();
    list.sort_by(|a, b| b.share.total_cmp(&a.share));
    Ok((list, best))
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl Task<'_> {
    /// Length of the computed numbers, weighted.
    fn computed(&self) -> f64 {
        norm(&self.residuals.weighted(self.residuals.predicted.clone()))
    }

    /// Length of the measured numbers, weighted.
    fn measured(&self) -> f64 {
        norm(&self.residuals.weighted(self.scan.values.clone()))
    }

    /// Size of a weighted number's error where `left` remains: stated noise is believed unless more
    /// is left.
    fn noise(&self, left: f64, parameters: usize) -> f64 {
        let freedom = self
            .residuals
            .values
            .len()
            .saturating_sub(parameters)
            .max(1);
        let mean = left / freedom as f64;
        if self.noise_given {
            mean.max(1.0).sqrt()
        } else {
            mean.sqrt()
        }
    }

    /// A standard error in steps of `slope`, the computed field's own error added.
    fn error(&self, noise: f64, slope: f64) -> f64 {
        (noise / slope).hypot(self.relative_error * self.computed() / slope)
    }

    fn candidates(&self) -> Result<Vec<Settled>, RunError> {
        let turns = Scene::new(self.design)?.circuit.turns;
        let coils = self.design.array.positions_m.len();
        let all = Fitted {
            scale: true,
            background: true,
            position: true,
            rotation: true,
        };
        let all = parameters(all, self.scan, coils);
        let of = |chosen: &dyn Fn(&Parameter) -> bool| -> Vec<Parameter> {
            all.iter().copied().filter(|p| chosen(p)).collect()
        };
        let mut list = Vec::new();
        list.extend(self.scaled("scale", 1.0));
        let scales = of(&|p| matches!(p, Parameter::Scale(_)));
        if scales.len() > 1 {
            list.extend(self.group("scale of each coil", &scales)?);
        }
        let background = of(&|p| matches!(p, Parameter::Background(_)));
        if !background.is_empty() {
            list.extend(self.group("background", &background)?);
        }
        list.extend(self.group("height", &[Parameter::Shift(2)])?);
        list.extend(self.group("position", &of(&|p| matches!(p, Parameter::Shift(_))))?);
        list.extend(self.group("rotation", &of(&|p| matches!(p, Parameter::Angle(_))))?);
        // The field is proportional to the turns, with linear steel too.
        list.extend(self.scaled("coil.turns", turns));
        let keys = keys(self.design, turns);
        let settled: Vec<Option<Settled>> = keys
            .par_iter()
            .map(|key| self.key(key))
            .collect::<Result<_, RunError>>()?;
        list.extend(settled.into_iter().flatten());
        Ok(list)
    }

    /// One scale of everything: linear.
    fn scaled(&self, name: &'static str, unit: f64) -> Option<Settled> {
        let column = self.residuals.weighted(self.residuals.predicted.clone());
        let solution = least_squares::solve(&[column], &self.residuals.values);
        let slope = solution.unit_errors[0]?.recip();
        let left = (squares(&self.residuals.values) - solution.removed).max(0.0);
        Some(Settled {
            name,
            left,
            parameters: 1,
            change: Some(unit * solution.values[0]),
            standard_error: Some(unit * self.error(self.noise(left, 1), slope)),
        })
    }

    /// Numbers of the frame, of scales or of the background, fitted together.
    fn group(
        &self,
        name: &'static str,
        parameters: &[Parameter],
    ) -> Result<Option<Settled>, RunError> {
        let weights = &self.residuals.weights;
        let found = fit::fit(
            self.model,
            self.scan,
            parameters,
            weights,
            self.field_t,
            None,
            self.progress,
        )?;
        // Of a scan moved away from the array nothing is left to compare: that explains nothing.
        if found.linear.rank == 0 || found.leaves_array {
            return Ok(None);
        }
        let alone = parameters.len() == 1;
        let noise = self.noise(found.left, found.linear.rank);
        let error = found.linear.unit_errors[0].filter(|_| alone);
        Ok(Some(Settled {
            name,
            left: found.left,
            parameters: found.linear.rank,
            change: error.map(|_| found.values[0]),
            standard_error: error.map(|unit| self.error(noise, unit.recip()) * found.steps[0]),
        }))
    }

    /// Measured less computed with the key changed `by`, weighted; `None` where that design cannot be
    /// computed.
    fn at(&self, Search { key, tolerance }: Search, by: f64) -> Result<Option<At>, RunError> {
        if !(key.range[0]..=key.range[1]).contains(&by) {
            return Ok(None);
        }
        match self.computed_for(&(key.changed)(by), tolerance) {
            Ok((computed, relative_error)) => {
                let pairs = self.scan.values.iter().zip(&computed);
                let values = self.residuals.weighted(pairs.map(|(m, c)| m - c).collect());
                let left = squares(&values);
                Ok(Some(At {
                    by,
                    values,
                    left,
                    relative_error,
                }))
            }
            Err(RunError::Interrupted(stop)) => Err(stop.into()),
            // A changed coil may not be possible: then it is no explanation.
            Err(_) => Ok(None),
        }
    }

    /// Values of another design at the scan's places, [row, quantity], and their claimed relative error.
    fn computed_for(
        &self,
        design: &Design,
        tolerance: Option<f64>,
    ) -> Result<(Vec<f64>, f64), RunError> {
        self.progress.check()?;
        let scene = Scene::with_tolerance(design, tolerance)?;
        let lowest_m = super::lowest_m(self.scan);
        let solved = steel::solve(&scene, scene.tolerances.field, lowest_m)?;
        let model = Model::new(&scene, &solved, self.scan);
        let places = model.places(Pose::default())?;
        let contributions = model.contributions(&places, Pose::default(), self.progress)?;
        Ok((model.sum(&contributions, |_| 1.0), solved.point_error()))
    }

    /// Change there per unit of the key, by central differences, one-sided at the range's end.
    fn slope(&self, search: Search, at: &At) -> Result<Option<Vec<f64>>, RunError> {
        let up = self.at(search, at.by + search.key.step)?;
        let down = self.at(search, at.by - search.key.step)?;
        let (high, low) = match (&up, &down) {
            (Some(up), Some(down)) => (up, down),
            (Some(up), None) => (up, at),
            (None, Some(down)) => (at, down),
            (None, None) => return Ok(None),
        };
        let pairs = low.values.iter().zip(&high.values);
        let slope: Vec<f64> = pairs.map(|(l, h)| (l - h) / (high.by - low.by)).collect();
        Ok(Some(slope).filter(|slope| norm(slope) > 0.0))
    }

    /// The key fitted until it settles.
    fn key(&self, key: &Key) -> Result<Option<Settled>, RunError> {
        let fine = Search {
            key,
            tolerance: self.tolerance,
        };
        let coarse = Search {
            key,
            tolerance: Some(fine.tolerance.map_or(COARSE, |given| given.max(COARSE))),
        };
        let Some(mut at) = self.at(coarse, 0.0)? else {
            return Ok(None);
        };
        let Some(mut slope) = self.slope(coarse, &at)? else {
            return Ok(None);
        };
        self.descend(coarse, &mut at, &mut slope)?;
        let mut search = coarse;
        if at.left < (RESOLVED * at.relative_error * self.computed()).powi(2)
            && let Some(finer) = self.at(fine, at.by)?
        {
            (search, at) = (fine, finer);
            self.descend(fine, &mut at, &mut slope)?;
        }
        if let Some(fresh) = self.slope(coarse, &at)? {
            slope = fresh;
        }
        let noise = self.noise(at.left, 1);
        let straight = noise / norm(&slope);
        let sides = [1.0, -1.0].map(|side| self.side(search, &at, side, noise, straight));
        let value = |by: f64| (key.value)(by);
        let mut error = Some(0.0_f64);
        for (sign, side) in [1.0, -1.0].into_iter().zip(sides) {
            let length = side?.map(|s| (value(at.by + sign * s) - value(at.by)).abs() / WIDTH);
            error = error.zip(length).map(|(most, length)| most.max(length));
        }
        let own = at.relative_error * self.computed() / norm(&slope);
        let own = (value(at.by + own) - value(at.by)).abs();
        Ok(Some(Settled {
            name: key.name,
            left: at.left,
            parameters: 1,
            change: Some(value(at.by) - value(0.0)),
            standard_error: error.map(|error| error.hypot(own)),
        }))
    }

    /// Steps from `at` until one takes nothing away. The slope between two places serves the next step.
    fn descend(&self, search: Search, at: &mut At, slope: &mut Vec<f64>) -> Result<(), RunError> {
        for _ in 0..ITERATIONS {
            let step = dot(slope, &at.values) / squares(slope);
            let Some(next) = self.stepped(search, at, step)? else {
                break;
            };
            let settled = at.left - next.left <= SETTLED * next.left;
            let pairs = at.values.iter().zip(&next.values);
            *slope = pairs.map(|(a, b)| (a - b) / (next.by - at.by)).collect();
            *at = next;
            if settled {
                break;
            }
        }
        Ok(())
    }

    /// The key after the step, or after part of it; `None` where none leaves less.
    fn stepped(&self, search: Search, at: &At, step: f64) -> Result<Option<At>, RunError> {
        let key = search.key;
        let mut step = step.clamp(-key.longest, key.longest);
        for _ in 0..HALVINGS {
            let by = (at.by + step).clamp(key.range[0], key.range[1]);
            if by == at.by {
                return Ok(None);
            }
            if let Some(next) = self.at(search, by)?.filter(|next| next.left < at.left) {
                return Ok(Some(next));
            }
            step *= 0.5;
        }
        Ok(None)
    }

    /// How far to one side the likelihood stays within 95 %; `None` where it does so to the range's end.
    fn side(
        &self,
        search: Search,
        at: &At,
        side: f64,
        noise: f64,
        straight: f64,
    ) -> Result<Option<f64>, RunError> {
        let mut length = WIDTH * straight;
        if length < STRAIGHT * search.key.step {
            return Ok(Some(length));
        }
        let rise = (WIDTH * noise).powi(2);
        for _ in 0..PROFILE {
            let Some(there) = self.at(search, at.by + side * length)? else {
                return Ok(None);
            };
            let share = ((there.left - at.left).max(0.0) / rise).sqrt();
            if share >= 1.0 {
                // Not shorter than a straight field has it.
                return Ok(Some((length / share).max(WIDTH * straight)));
            }
            length *= (1.05 / share.max(0.3)).max(1.1);
        }
        Ok(Some(length))
    }
}
