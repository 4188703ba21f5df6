//! Scales, background and the sensor's frame, fitted to a scan all at once.
//!
//! Gauss-Newton steps: the scales and the background are linear, the frame is linearised at every step. A step that
//! leaves more is halved, and so is one that moves the scan away from the array: far away every field fits as well as
//! none, and no step changes anything.

use super::model::{Model, Pose};
use crate::RunError;
use crate::bundle::scan::{Measured, Scan};
use crate::numerics::least_squares::{self, Solution};
use crate::progress::Progress;

/// Most linearisations.
const ITERATIONS: usize = 30;
/// A step that takes less than this part of what is left ends the iteration.
const SETTLED: f64 = 1e-9;
/// Most halvings of a step.
const HALVINGS: usize = 8;

/// Parameters that may be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fitted {
    /// A scale for each coil.
    pub scale: bool,
    /// A constant field.
    pub background: bool,
    /// Pose of the sensor's frame.
    pub position: bool,
    /// How it is turned.
    pub rotation: bool,
}

impl Fitted {
    /// The scales alone.
    pub(super) const SCALE: Self = Self {
        scale: true,
        background: false,
        position: false,
        rotation: false,
    };
}

/// A number that is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parameter {
    Scale(usize),
    Background(usize),
    Shift(usize),
    Angle(usize),
}

impl Parameter {
    pub(super) fn name(self) -> String {
        let axis = |axis: usize| ["x", "y", "z"][axis];
        match self {
            Self::Scale(coil) => format!("scale of coil {coil}"),
            Self::Background(i) => format!("background B{}", axis(i)),
            Self::Shift(i) => format!("position {}", axis(i)),
            Self::Angle(i) => format!("rotation about {}", axis(i)),
        }
    }

    /// A change that is worth about as much as that of another parameter.
    fn step(self, field_t: f64) -> f64 {
        match self {
            Self::Scale(_) | Self::Angle(_) => 0.01,
            Self::Background(_) => 0.01 * field_t,
            Self::Shift(_) => 1e-3,
        }
    }
}

/// Parameters fitted to this scan.
pub(super) fn parameters(fitted: Fitted, scan: &Scan, coils: usize) -> Vec<Parameter> {
    let mut list = Vec::new();
    if fitted.scale {
        let driven = |coil: &usize| scan.currents_a.iter().flatten().any(|(c, _)| c == coil);
        list.extend((0..coils).filter(driven).map(Parameter::Scale));
    }
    if fitted.background {
        let seen = |i: &usize| scan.quantities.contains(&Measured::Field(*i));
        list.extend((0..3).filter(seen).map(Parameter::Background));
    }
    if fitted.position {
        list.extend((0..3).map(Parameter::Shift));
    }
    if fitted.rotation {
        list.extend((0..3).map(Parameter::Angle));
    }
    list
}

/// The fit.
pub(super) struct Fit {
    /// One a parameter.
    pub(super) values: Vec<f64>,
    /// The weighted columns of the last linearisation, in steps of [`Parameter::step`].
    pub(super) columns: Vec<Vec<f64>>,
    /// Its solution.
    pub(super) linear: Solution,
    /// The steps.
    pub(super) steps: Vec<f64>,
    /// Values of the fit, [row, quantity].
    pub(super) fitted: Vec<f64>,
    /// Weighted sum of the squares that are left.
    pub(super) left: f64,
    pub(super) iterations: usize,
    pub(super) converged: bool,
    /// The last step would move the scan away from the array: nothing near it fits best.
    pub(super) leaves_array: bool,
}

/// A state of the fit, and what it gives.
struct State {
    values: Vec<f64>,
    contributions: Vec<f64>,
    given: Vec<f64>,
    left: f64,
}

/// Fits `parameters`, from those of `before` where there is such a fit; `weights` are those of the measured
/// numbers, `field_t` the size of the field.
///
/// # Errors
/// A scan on a winding's edge or the steel; interruption.
pub(super) fn fit(
    model: &Model,
    scan: &Scan,
    parameters: &[Parameter],
    weights: &[f64],
    field_t: f64,
    before: Option<&Fit>,
    progress: &dyn Progress,
) -> Result<Fit, RunError> {
    let task = Task {
        model,
        scan,
        parameters,
        weights,
        progress,
    };
    let steps: Vec<f64> = parameters.iter().map(|p| p.step(field_t)).collect();
    let start = before.map_or_else(|| start(parameters), |fit| fit.values.clone());
    let mut state = task.state(start)?;
    let measured: f64 = weighted_squares(&scan.values, weights);
    let (mut iterations, mut converged) = (0, false);
    let (columns, linear) = loop {
        iterations += 1;
        let columns = task.columns(&state, &steps)?;
        let linear = least_squares::solve(&columns, &task.weighted_residuals(&state.given));
        let settled = linear.removed <= SETTLED * state.left + 1e-24 * measured;
        if settled || iterations == ITERATIONS {
            converged = settled;
            break (columns, linear);
        }
        match task.stepped(&state, &linear, &steps)? {
            Some(next) => state = next,
            None => break (columns, linear),
        }
    };
    let leaves_array = !converged && task.leaves_array(&stepped(&state, &linear, &steps, 1.0));
    Ok(Fit {
        leaves_array,
        values: state.values,
        columns,
        linear,
        steps,
        fitted: state.given,
        left: state.left,
        iterations: iterations + before.map_or(0, |fit| fit.iterations),
        converged,
    })
}

/// The values after `share` of a step.
fn stepped(state: &State, linear: &Solution, steps: &[f64], share: f64) -> Vec<f64> {
    let changes = linear.values.iter().zip(steps).map(|(v, s)| share * v * s);
    let values = state.values.iter().zip(changes);
    values.map(|(value, change)| value + change).collect()
}

/// The design as it is.
fn start(parameters: &[Parameter]) -> Vec<f64> {
    let value = |parameter: &Parameter| match parameter {
        Parameter::Scale(_) => 1.0,
        _ => 0.0,
    };
    parameters.iter().map(value).collect()
}

fn weighted_squares(values: &[f64], weights: &[f64]) -> f64 {
    let terms = values.iter().zip(weights);
    terms.map(|(value, weight)| (value * weight).powi(2)).sum()
}

struct Task<'a> {
    model: &'a Model<'a>,
    scan: &'a Scan,
    parameters: &'a [Parameter],
    weights: &'a [f64],
    progress: &'a dyn Progress,
}

impl Task<'_> {
    fn state(&self, values: Vec<f64>) -> Result<State, RunError> {
        let pose = self.pose(&values);
        let places = self.model.places(pose)?;
        let contributions = self.model.contributions(&places, pose, self.progress)?;
        let given = self.given(&values, &contributions);
        let residuals: Vec<f64> = self
            .scan
            .values
            .iter()
            .zip(&given)
            .map(|(m, g)| m - g)
            .collect();
        Ok(State {
            left: weighted_squares(&residuals, self.weights),
            values,
            contributions,
            given,
        })
    }

    fn pose(&self, values: &[f64]) -> Pose {
        let mut pose = Pose::default();
        for (parameter, value) in self.parameters.iter().zip(values) {
            match parameter {
                Parameter::Shift(i) => pose.shift_m[*i] = *value,
                Parameter::Angle(i) => pose.angles_rad[*i] = *value,
                _ => {}
            }
        }
        pose
    }

    fn leaves_array(&self, values: &[f64]) -> bool {
        let [x, y, z] = self.pose(values).shift_m;
        x.hypot(y).hypot(z) > self.model.farthest_shift_m()
    }

    fn scaled(&self, values: &[f64], contributions: &[f64]) -> Vec<f64> {
        let scale = |coil: usize| {
            let place = self
                .parameters
                .iter()
                .position(|p| *p == Parameter::Scale(coil));
            place.map_or(1.0, |place| values[place])
        };
        self.model.sum(contributions, scale)
    }

    fn given(&self, values: &[f64], contributions: &[f64]) -> Vec<f64> {
        let mut given = self.scaled(values, contributions);
        for (parameter, value) in self.parameters.iter().zip(values) {
            if let Parameter::Background(i) = parameter {
                for at in self.of_component(*i) {
                    given[at] += value;
                }
            }
        }
        given
    }

    /// Where the measured numbers of a field component stand.
    fn of_component(&self, component: usize) -> impl Iterator<Item = usize> {
        let count = self.scan.quantities.len();
        let sought = Measured::Field(component);
        let place = self.scan.quantities.iter().position(|q| *q == sought);
        let rows = self.scan.rows();
        place
            .into_iter()
            .flat_map(move |k| (0..rows).map(move |row| row * count + k))
    }

    fn weighted_residuals(&self, given: &[f64]) -> Vec<f64> {
        let pairs = self.scan.values.iter().zip(given).zip(self.weights);
        pairs.map(|((m, g), w)| (m - g) * w).collect()
    }

    /// Change by a step of every parameter, weighted.
    fn columns(&self, state: &State, steps: &[f64]) -> Result<Vec<Vec<f64>>, RunError> {
        let of_frame = |p: &Parameter| matches!(p, Parameter::Shift(_) | Parameter::Angle(_));
        let slopes = if self.parameters.iter().any(of_frame) {
            let pose = self.pose(&state.values);
            let places = self.model.places(pose)?;
            self.model.slopes(&places, pose, self.progress)?
        } else {
            <[Vec<f64>; 6]>::default()
        };
        let columns = self.parameters.iter().zip(steps).map(|(parameter, step)| {
            let mut column = match *parameter {
                Parameter::Scale(coil) => self
                    .model
                    .sum(&state.contributions, |c| if c == coil { 1.0 } else { 0.0 }),
                Parameter::Background(i) => {
                    let mut column = vec![0.0; self.scan.values.len()];
                    self.of_component(i).for_each(|at| column[at] = 1.0);
                    column
                }
                Parameter::Shift(i) => self.scaled(&state.values, &slopes[i]),
                Parameter::Angle(i) => self.scaled(&state.values, &slopes[3 + i]),
            };
            for (value, weight) in column.iter_mut().zip(self.weights) {
                *value *= weight * step;
            }
            column
        });
        Ok(columns.collect())
    }

    /// The state after the step, or after part of it; `None` where none leaves less.
    fn stepped(
        &self,
        state: &State,
        linear: &Solution,
        steps: &[f64],
    ) -> Result<Option<State>, RunError> {
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let values = stepped(state, linear, steps, share);
            if self.leaves_array(&values) {
                share *= 0.5;
                continue;
            }
            match self.state(values) {
                Ok(next) if next.left < state.left => return Ok(Some(next)),
                // Into a winding's edge or the steel is too far.
                Ok(_) | Err(RunError::Input(_) | RunError::OnEdge(_)) => share *= 0.5,
                Err(error) => return Err(error),
            }
        }
        Ok(None)
    }
}
