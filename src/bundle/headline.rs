//! The headline of a result: lambda with its error, the force that is given, and the parts of the error
//! budget. Screen, JSON and page print this one struct.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use strum::{EnumMessage, IntoStaticStr};

use fluxform_base::digits::with_error;
use fluxform_base::uncertainty::Cause;
pub use fluxform_lambda::GivenForce;
use fluxform_lambda::all_points::AllPoints;
use fluxform_lambda::sampling::share_and_error;
use fluxform_lambda::uncertainty::{Shares, Study};

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
    /// saturation of the steel
    #[strum(serialize = "saturation of the steel")]
    Saturation,
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

/// Beyond this an interpolation's error does not fall yet as the fourth power of its step.
const RESOLVED: f64 = 0.1;

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
            Self::Points | Self::Heights | Self::Forces | Self::Saturation | Self::Solution => true,
            Self::BetweenPoints
            | Self::MapNodes
            | Self::Interpolation
            | Self::Pull
            | Self::PullMap => false,
        }
    }

    /// The remedy for an `error`, as the headline prints it.
    fn to_halve(self, error: f64) -> &'static str {
        match self {
            Self::Points => "take about twice as many points, 1.5 times along x and y of a grid",
            Self::Heights => "export the surface with half the chord tolerance",
            Self::BetweenPoints => {
                "take 1.4 times as many points along x and y, or let --refine add heights"
            }
            Self::Forces | Self::MapNodes => "halve --tolerance",
            Self::Interpolation | Self::PullMap if error > RESOLVED => {
                "take twice as many nodes along each axis of [workspace], of which so few do not resolve the field"
            }
            Self::Interpolation | Self::PullMap => {
                "take 1.2 times as many nodes along each axis of [workspace]"
            }
            Self::Saturation => {
                "set supply.current_max_a near the currents used, or lower them below the steel's knee"
            }
            Self::Pull => "the pull's own tolerance is fixed; its share falls with a larger lambda",
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

/// A cause of the felt error. Its name in artefacts is the variant's in snake case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema, IntoStaticStr)]
#[serde(rename_all = "snake_case")]
pub enum FeltCause {
    /// The computation, from the file on: the budget.
    #[strum(serialize = "computation")]
    Computation,
    /// The error of the currents: out of reach within their limits, or in components that were not requested.
    #[strum(serialize = "the currents themselves")]
    Currents,
    /// Steel along a B-H curve, whose force per ampere is another one at smaller currents than the largest.
    #[strum(serialize = "smaller currents of saturated steel")]
    SmallerCurrents,
    /// The position.
    #[strum(serialize = "position sensor")]
    Sensor,
    /// The finger's angle.
    #[strum(serialize = "tilt of the finger")]
    Tilt,
    /// The magnet's temperature.
    #[strum(serialize = "heat of the magnet")]
    Heat,
    /// The currents' own errors.
    #[strum(serialize = "drivers")]
    Driver,
}

impl FeltCause {
    /// In words.
    #[must_use]
    pub fn words(self) -> &'static str {
        self.into()
    }
}

impl From<Cause> for FeltCause {
    fn from(cause: Cause) -> Self {
        match cause {
            Cause::Sensor => Self::Sensor,
            Cause::Tilt => Self::Tilt,
            Cause::Heat => Self::Heat,
            Cause::Driver => Self::Driver,
        }
    }
}

/// Errors of the force vector relative to the requested one, with each kind of currents.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeltShares {
    /// With the static currents.
    #[serde(rename = "static")]
    pub fixed: f64,
    /// With position feedback, currents of least power.
    pub feedback: f64,
    /// With position feedback, currents chosen for the uncertainties; absent without any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robust: Option<f64>,
}

impl From<Shares> for FeltShares {
    fn from(of: Shares) -> Self {
        Self {
            fixed: of.fixed,
            feedback: of.feedback,
            robust: Some(of.robust),
        }
    }
}

impl FeltShares {
    fn plus(self, more: f64) -> Self {
        Self {
            fixed: self.fixed + more,
            ..self.plus_with_feedback(more)
        }
    }

    fn plus_with_feedback(self, more: f64) -> Self {
        Self {
            fixed: self.fixed,
            feedback: self.feedback + more,
            robust: self.robust.map(|of| of + more),
        }
    }

    /// None, of the same kinds of currents.
    fn none(self) -> Self {
        Self {
            robust: self.robust.map(|_| 0.0),
            ..Self::default()
        }
    }
}

/// A part of the felt error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeltPart {
    /// Its cause.
    pub cause: FeltCause,
    /// The error with this cause alone; of uncertainties what they add to that of the currents.
    pub error: FeltShares,
}

/// The error of the force vector from the file to the finger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FeltForce {
    /// All of it: `expected` plus the most that the computation and, with feedback, smaller currents may add.
    pub total: FeltShares,
    /// Root mean square over the points and the uncertainties, relative to that of the requested force.
    pub expected: FeltShares,
    /// By how much `expected` may be off, being that of some points of the object; absent in files of programs without
    /// it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sampling: Option<FeltShares>,
    /// The same split: computation and smaller currents add up with the others, whose squares do.
    pub parts: Vec<FeltPart>,
    /// Effects that none of the parts covers.
    pub not_modelled: Vec<String>,
}

/// What is left out where the unpowered steel's upward pull counts.
pub const SIDEWAYS_PULL: &str = "sideways pull of the unpowered steel";
/// What is left out where that pull counts and the magnet may tilt.
const TILTED_PULL: &str = "the pull's change with the finger's tilt beside an edge of the steel, or of a magnet that is not \
                           upright: it is that of an upright one above a half space";
/// Effects that no part of the felt error covers.
const NOT_MODELLED: [&str; 6] = [
    "delays of sensor and drivers (`replay --dynamics` follows the coils' currents)",
    "the coils' heat: it decides power and limits, not the force of a given current",
    "manufacture: places and turns of the coils, gaps, permeability (`probe --compare` measures them)",
    "the steel's hysteresis and eddy currents",
    "the finger: its compliance, and where on it the magnet sits",
    "the magnet's body under tilt: its moment turns, its ends do not move",
];

impl FeltForce {
    /// Of all points without any uncertainty, or with those of `study`. `pull_share` is that of the unpowered steel's
    /// sideways pull, where its upward one counts; `smaller_currents` how far the force per ampere is another one at
    /// currents below the static ones, which feedback has.
    #[must_use]
    pub fn new(
        all: &AllPoints,
        study: Option<&Study>,
        pull_share: Option<f64>,
        smaller_currents: f64,
    ) -> Self {
        let [(fixed, fixed_off), (feedback, feedback_off)] =
            [&all.fixed, &all.feedback].map(|of| share_and_error(&of.squares));
        let of = |fixed, feedback| FeltShares {
            fixed,
            feedback,
            robust: None,
        };
        let (exact, sampling) = (of(fixed, feedback), of(fixed_off, feedback_off));
        let promised = |study: &Study| FeltShares {
            fixed: study.fixed.promised.expected,
            feedback: study.feedback.promised.expected,
            robust: Some(study.robust.error.promised.expected),
        };
        let causes = study.map_or(&[][..], |study| &study.causes);
        let own = FeltPart {
            cause: FeltCause::Currents,
            error: study.map_or(exact, |study| study.exact.into()),
        };
        let parts = causes.iter().map(|of| FeltPart {
            cause: of.cause.into(),
            error: of.alone.into(),
        });
        let missing = Cause::ALL
            .iter()
            .filter(|cause| causes.iter().all(|of| of.cause != **cause));
        let missing: Vec<&str> = missing.map(|cause| cause.words()).collect();
        let not_given = (!missing.is_empty())
            .then(|| format!("{}: no bound is given ([uncertainty])", missing.join(", ")));
        let pull = pull_share.map(|share| {
            let percent = share * 100.0;
            format!(
                "{SIDEWAYS_PULL}: about {percent:.1} % of the requested force, root mean square"
            )
        });
        let of_tilt = (pull.is_some() && causes.iter().any(|of| of.cause == Cause::Tilt))
            .then(|| TILTED_PULL.to_owned());
        let expected = study.map_or(exact, promised);
        let of_steel = (smaller_currents > 0.0).then(|| FeltPart {
            cause: FeltCause::SmallerCurrents,
            error: expected.none().plus_with_feedback(smaller_currents),
        });
        Self {
            total: expected.plus_with_feedback(smaller_currents),
            expected,
            sampling: match study {
                Some(study) => study.sampling.map(FeltShares::from),
                None => Some(sampling),
            },
            parts: (of_steel.into_iter()).chain([own]).chain(parts).collect(),
            not_modelled: (pull.into_iter().chain(of_tilt).chain(not_given))
                .chain(NOT_MODELLED.map(str::to_owned))
                .collect(),
        }
    }

    /// Counts the most that the computation may add.
    fn count(&mut self, computation: f64) {
        self.parts
            .retain(|part| part.cause != FeltCause::Computation);
        let of_steel = (self.parts.iter()).find(|part| part.cause == FeltCause::SmallerCurrents);
        let of_steel = of_steel.map_or(0.0, |part| part.error.feedback);
        self.total = self.expected.plus(computation).plus_with_feedback(of_steel);
        let part = FeltPart {
            cause: FeltCause::Computation,
            error: self.expected.none().plus(computation),
        };
        self.parts.insert(0, part);
    }
}

/// The headline of a result.
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
    /// The change that halves the largest part.
    pub to_halve: Option<String>,
    /// The share of the grid's cells through which the surface jumps, left out of `budget`: there the
    /// rendered force goes from one side's to the other's within a cell, whatever the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub jumps: Option<f64>,
    /// The error of the force vector at the finger; absent in files of programs without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub felt: Option<FeltForce>,
    /// The outcome of `--error`; absent without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requested: Option<RequestedError>,
}

/// An error that was requested, and what was chosen for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RequestedError {
    /// Whether nobody requested it and the default holds.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub by_default: bool,
    /// `--error`, relative.
    pub error: f64,
    /// Whether the budget holds it.
    pub met: bool,
    /// Settings that the documents or flags fix, which were obeyed.
    pub fixed: Vec<String>,
    /// Points along x and y.
    pub points: [usize; 2],
    /// Heights along x and y between which a runtime interpolates; absent where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heights: Option<[usize; 2]>,
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
            felt: None,
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
        if let Some(felt) = &mut self.felt {
            felt.count(self.force_error);
        }
        self.lambda_error_n_per_m = self.lambda_n_per_m * sum(&|part| part.part.is_of_lambda());
        let lambda = with_error(self.lambda_n_per_m, self.lambda_error_n_per_m);
        self.lambda = format!("{lambda} N/m");
        let largest = self.budget.first().filter(|part| part.error > 0.0);
        self.to_halve = largest.map(|part| part.part.to_halve(part.error).to_owned());
    }

    /// Adds what the finger feels of it.
    pub fn add_felt(&mut self, mut felt: FeltForce) {
        felt.count(self.force_error);
        self.felt = Some(felt);
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
                .as_ref()
                .is_some_and(|what| what.contains("[workspace]"))
        );
        // The map of the pull of unpowered cores was said to be fixed.
        headline.add([part(BudgetName::PullMap, 3.0)]);
        let halved = headline.to_halve.expect("a part");
        assert!(halved.contains("twice as many nodes"), "{halved}");
    }
}
