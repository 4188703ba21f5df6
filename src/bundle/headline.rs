//! What a result comes to: lambda with its error, the force that is given, and who uses the error
//! budget. Screen, JSON and page print this one struct.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, IntoStaticStr};

use fluxform_base::digits::with_error;
pub use fluxform_lambda::GivenForce;

/// A part of the computation that adds an error. Its name in artefacts is the variant's in snake
/// case, its meaning the first line of the variant's comment.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    JsonSchema,
    IntoStaticStr,
    EnumMessage,
)]
#[serde(rename_all = "snake_case")]
pub enum BudgetName {
    /// number of points
    #[strum(serialize = "number of points")]
    Points,
    /// heights in the file
    #[strum(serialize = "heights in the file")]
    Heights,
    /// heights between the points
    #[strum(serialize = "heights between the points")]
    BetweenPoints,
    /// forces at the points
    #[strum(serialize = "forces at the points")]
    Forces,
    /// nodes of the map
    #[strum(serialize = "nodes of the map")]
    MapNodes,
    /// interpolation of the map
    #[strum(serialize = "interpolation of the map")]
    Interpolation,
    /// pull of the unpowered steel
    #[strum(serialize = "pull of the unpowered steel")]
    Pull,
    /// map of that pull
    #[strum(serialize = "map of that pull")]
    PullMap,
    /// solution for lambda
    #[strum(serialize = "solution for lambda")]
    Solution,
}

impl BudgetName {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        self.into()
    }

    /// Whether it moves lambda itself, not the rendered force alone.
    #[must_use]
    pub fn is_of_lambda(self) -> bool {
        match self {
            Self::Points | Self::Heights | Self::Forces | Self::Solution => true,
            Self::BetweenPoints
            | Self::MapNodes
            | Self::Interpolation
            | Self::Pull
            | Self::PullMap => false,
        }
    }

    /// What to do about it.
    fn to_halve(self) -> &'static str {
        match self {
            Self::Points => "take about 1.5 times as many points along x and y",
            Self::Heights => "export the surface with half the chord tolerance",
            Self::BetweenPoints => "take 1.4 times as many points along x and y",
            Self::Forces | Self::MapNodes => "halve --tolerance",
            Self::Interpolation => "take 1.2 times as many nodes along each axis of [workspace]",
            Self::Pull | Self::PullMap => {
                "the pull's own tolerance is fixed; its share falls with a larger lambda"
            }
            Self::Solution => "nothing: rounding decides",
        }
    }
}

/// A part's error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BudgetPart {
    /// Which.
    pub part: BudgetName,
    /// Relative to the requested force, where at least a twentieth of the largest is requested, or to
    /// lambda.
    pub error: f64,
    /// How it follows from what the stages state.
    pub how: String,
}

/// What a result comes to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Headline {
    /// lambda in the digits that its error leaves, like `0.916 +- 0.004 N/m`.
    pub lambda: String,
    /// N/m.
    pub lambda_n_per_m: f64,
    /// Against the limit of ever more points and a field without error, N/m.
    pub lambda_error_n_per_m: f64,
    /// How much of the requested force the static currents give; null where none is requested.
    pub static_currents: Option<GivenForce>,
    /// The same with currents of their own at every point.
    pub feedback: Option<GivenForce>,
    /// The most that the computation may add to the force, relative to the requested one: the sum of
    /// `budget`.
    pub force_error: f64,
    /// Who uses it, the largest first.
    pub budget: Vec<BudgetPart>,
    /// What would halve the largest part.
    pub to_halve: Option<String>,
    /// The share of the grid's cells through which the surface jumps, left out of `budget`: there the
    /// rendered force goes from one side's to the other's within a cell, whatever the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jumps: Option<f64>,
    /// What `--error` came to; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requested: Option<RequestedError>,
}

/// An error that was requested, and what was chosen for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RequestedError {
    /// `--error`, relative.
    pub error: f64,
    /// Whether the budget holds it.
    pub met: bool,
    /// What the documents or flags fix and was obeyed.
    pub fixed: Vec<String>,
    /// Points along x and y.
    pub points: [usize; 2],
    /// Nodes of the map's workspace along x, y and z; null where there is no map.
    pub nodes: Option<[usize; 3]>,
    /// Tolerance of the forces.
    pub tolerance: f64,
    /// Estimates of the same run at other errors.
    pub elsewhere: Vec<RunAtError>,
}

/// An estimate of a run at another error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunAtError {
    /// Relative.
    pub error: f64,
    /// Points along x and y.
    pub points: [usize; 2],
    /// Nodes of the map's workspace; null where there is no map.
    pub nodes: Option<[usize; 3]>,
    /// Points and nodes against those of this run, times the coils the same: about what the processor
    /// time of points, forces and map grows by.
    pub work: f64,
}

impl Headline {
    /// Of lambda, N/m, with the forces given and the parts of the error so far.
    #[must_use]
    pub fn new(
        lambda_n_per_m: f64,
        static_currents: Option<GivenForce>,
        feedback: Option<GivenForce>,
        budget: Vec<BudgetPart>,
    ) -> Self {
        let mut headline = Self {
            lambda: String::new(),
            lambda_n_per_m,
            lambda_error_n_per_m: 0.0,
            static_currents,
            feedback,
            force_error: 0.0,
            budget: Vec::new(),
            to_halve: None,
            jumps: None,
            requested: None,
        };
        headline.add(budget);
        headline
    }

    /// Adds parts of the error.
    pub fn add(&mut self, parts: impl IntoIterator<Item = BudgetPart>) {
        self.budget.extend(parts);
        self.budget.sort_by(|a, b| b.error.total_cmp(&a.error));
        let sum = |of: &dyn Fn(&BudgetPart) -> bool| -> f64 {
            let parts = self.budget.iter().filter(|part| of(part));
            parts.map(|part| part.error).sum()
        };
        self.force_error = sum(&|_| true);
        self.lambda_error_n_per_m = self.lambda_n_per_m * sum(&|part| part.part.is_of_lambda());
        let lambda = with_error(self.lambda_n_per_m, self.lambda_error_n_per_m);
        self.lambda = format!("{lambda} N/m");
        let largest = self.budget.first().filter(|part| part.error > 0.0);
        self.to_halve = largest.map(|part| part.part.to_halve().to_owned());
    }

    /// The error of one part.
    #[must_use]
    pub fn error_of(&self, part: BudgetName) -> f64 {
        let found = self.budget.iter().find(|one| one.part == part);
        found.map_or(0.0, |one| one.error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_add_up_and_the_largest_is_named_first() {
        let part = |part, error| BudgetPart {
            part,
            error,
            how: String::new(),
        };
        let parts = vec![
            part(BudgetName::Forces, 3e-5),
            part(BudgetName::Points, 4e-3),
        ];
        let mut headline = Headline::new(0.916_37, None, None, parts);
        assert_eq!(headline.lambda, "0.916 +- 0.004 N/m");
        headline.add([part(BudgetName::Interpolation, 9e-3)]);
        assert_eq!(headline.budget[0].part, BudgetName::Interpolation);
        assert!((headline.force_error - 0.013_03).abs() < 1e-15);
        assert_eq!(headline.lambda, "0.916 +- 0.004 N/m");
        assert!(
            headline
                .to_halve
                .is_some_and(|what| what.contains("[workspace]"))
        );
    }
}
