//! `bench.json` and `bench.csv`: error against processor time of one design's objects.

use std::collections::BTreeMap;
use std::io::{self, Write};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::artefact::{FileEntry, Input, Options};
use super::number::{push_cell, push_number, push_text};
use fluxform_base::accuracy::StageAccuracy;
use fluxform_base::force_constant::Criterion;

/// `bench.json`. Seconds in it differ from run to run; errors do not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BenchFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that measured.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// Designs, shapes and surfaces.
    pub inputs: Vec<Input>,
    /// The options of the run.
    #[serde(default, skip_serializing_if = "Options::is_empty")]
    pub made_with: Options,
    /// The sentence on units.
    pub units: String,
    /// Which force constant `lambda` stands for.
    pub criterion: Criterion,
    /// Whether ladders and reference were shortened by `--quick`.
    pub quick: bool,
    /// Meaning of the errors and their reference.
    pub error_of: String,
    /// Meaning of the seconds.
    pub timed: String,
    /// One entry per object.
    pub shapes: Vec<ShapeBench>,
    /// Knobs that this scene does not have or that change nothing here.
    pub left_out: Vec<LeftOutKnob>,
    /// The errors at the present settings, the largest of all objects.
    pub accuracy: BTreeMap<String, StageAccuracy>,
    /// Table, plots and page.
    pub files: Vec<FileEntry>,
}

/// One object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShapeBench {
    /// Its name.
    pub shape: String,
    /// Reference of the errors.
    pub reference: Reference,
    /// The knobs, each from its coarsest setting to its finest.
    pub knobs: Vec<Knob>,
    /// Every combination of the knobs' settings.
    pub runs: Vec<Run>,
    /// For each target the cheapest combination that meets it.
    pub cheapest: Vec<Cheapest>,
    /// All force constants at the present settings: they come from one path and cost nothing more.
    pub constants: Vec<ConstantError>,
}

/// The refined run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Reference {
    /// How it was refined, in words.
    pub how: String,
    /// Tolerance of the field.
    pub tolerance: f64,
    /// Constraint points.
    pub points: u64,
    /// Places at which the felt force was compared.
    pub places: u64,
    /// The force constant, N/m.
    pub lambda_n_per_m: f64,
    /// Its own error, about: what half as many points along each axis change, and what its field may still be
    /// off by, from the change between the present field and its own; null where the points are on no grid.
    /// It is added to a run's error before that is held against a target.
    pub lambda_error: Option<f64>,
    /// Processor time, s.
    pub cpu_s: f64,
}

/// Parameters that can be set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KnobName {
    /// Allowed error of the field of windings and steel.
    Tolerance,
    /// Constraint points on a grid.
    Points,
    /// Constraint points graded to a deviation.
    MaxDeviation,
    /// Nodes of the map.
    Nodes,
}

impl KnobName {
    /// Description with its unit.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Tolerance => "field tolerance",
            Self::Points => "points along x",
            Self::MaxDeviation => "largest deviation / m",
            Self::Nodes => "map nodes along x",
        }
    }
}

/// A knob and the settings that were measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Knob {
    /// Which.
    pub name: KnobName,
    /// From coarse to fine.
    pub settings: Vec<Setting>,
}

/// One setting of a knob.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setting {
    /// Tolerance, samples along x, or deviation in m.
    pub value: f64,
    /// Flag or keys to paste.
    pub paste: Vec<String>,
    /// Whether the design, the shape or the flags ask for it now.
    pub present: bool,
}

/// One combination of settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// Index into each knob's settings, in the order of the knobs.
    pub settings: Vec<u64>,
    /// Processor time of the whole run, s: the sum of the four below.
    pub cpu_s: f64,
    /// Solving the steel, s.
    pub steel_s: f64,
    /// Sampling the surface, s.
    pub points_s: f64,
    /// Forces at the points and the force constants, s.
    pub lambda_s: f64,
    /// The maps, s.
    pub map_s: f64,
    /// Constraint points.
    pub points: u64,
    /// The force constant, N/m; null where none can be rendered.
    pub lambda_n_per_m: Option<f64>,
    /// |lambda / that of the reference - 1|.
    pub lambda_error: Option<f64>,
    /// Estimate of the largest error of the felt force anywhere on the surface, relative to the force that is to
    /// be felt there: that of the places, with what the reference's field may be off by there, times a factor for
    /// what lies between them.
    pub felt_error: Option<f64>,
}

impl Run {
    /// The larger of both errors; infinite where there is no force constant.
    #[must_use]
    pub fn error(&self) -> f64 {
        let both = self.lambda_error.zip(self.felt_error);
        both.map_or(f64::INFINITY, |(lambda, felt)| lambda.max(felt))
    }
}

/// The cheapest settings for a target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cheapest {
    /// Largest error that either may have, as estimated.
    pub target: f64,
    /// Whether any combination meets it.
    pub met: bool,
    /// Index into the runs: the cheapest that meets it, else the one that comes closest.
    pub run: u64,
    /// Flags and keys to paste, in the order of the knobs.
    pub paste: Vec<String>,
}

/// A force constant at the present settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConstantError {
    /// Its criterion.
    pub criterion: Criterion,
    /// N/m; null where it does not exist.
    pub lambda_n_per_m: Option<f64>,
    /// Of the reference, N/m.
    pub reference_n_per_m: Option<f64>,
    /// Relative error; null where either is.
    pub error: Option<f64>,
}

/// A knob that is not swept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LeftOutKnob {
    /// Its name.
    pub knob: String,
    /// Why.
    pub why: String,
}

/// Runs in the order in which they are drawn as one curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve<'a> {
    /// The parameter that is swept, and the values of the others.
    pub name: String,
    /// The knob; `None` for the cheapest of all.
    pub knob: Option<KnobName>,
    /// Value of the knob, the error of the run as `error` gives it, and the run.
    pub runs: Vec<(f64, &'a Run)>,
}

impl ShapeBench {
    /// The run at the present settings.
    #[must_use]
    pub fn present(&self) -> Option<&Run> {
        self.runs.iter().find(|run| self.is_present(run))
    }

    /// Whether `run` has the present settings.
    #[must_use]
    pub fn is_present(&self, run: &Run) -> bool {
        let mut chosen = self.knobs.iter().zip(&run.settings);
        chosen.all(|(knob, at)| {
            let setting = knob.settings.get(*at as usize);
            setting.is_some_and(|setting| setting.present)
        })
    }

    /// The runs along one knob from coarse to fine, the others at their finest: what that knob
    /// alone costs in error.
    #[must_use]
    pub fn along(&self, knob: usize) -> Vec<&Run> {
        let finest = |other: usize| self.knobs[other].settings.len() - 1;
        let alone = |run: &&Run| {
            let mut at = run.settings.iter().enumerate();
            at.all(|(other, at)| other == knob || *at as usize == finest(other))
        };
        let mut runs: Vec<&Run> = self.runs.iter().filter(alone).collect();
        runs.sort_by_key(|run| run.settings[knob]);
        runs
    }

    /// The curves of one error: a curve a knob, and the runs that no cheaper one beats.
    #[must_use]
    pub fn curves(&self, error: fn(&Run) -> Option<f64>) -> Vec<Curve<'_>> {
        let mut curves: Vec<Curve> = (0..self.knobs.len())
            .map(|at| {
                let knob = &self.knobs[at];
                let value = |run: &Run| knob.settings[run.settings[at] as usize].value;
                let runs = self.along(at).into_iter();
                Curve {
                    name: format!("{} alone, the others at their finest", knob.name.label()),
                    knob: Some(knob.name),
                    runs: runs.map(|run| (value(run), run)).collect(),
                }
            })
            .collect();
        let mut all: Vec<&Run> = self.runs.iter().filter(|r| error(r).is_some()).collect();
        all.sort_by(|a, b| a.cpu_s.total_cmp(&b.cpu_s));
        let mut least = f64::INFINITY;
        all.retain(|run| {
            let here = error(run).unwrap_or(f64::INFINITY);
            let better = here < least;
            least = least.min(here);
            better
        });
        let runs = all.into_iter().enumerate();
        curves.push(Curve {
            name: "cheapest combinations".to_owned(),
            knob: None,
            runs: runs.map(|(at, run)| (at as f64, run)).collect(),
        });
        curves
    }
}

/// A column of `bench.csv`: its name and its value.
type Column = (&'static str, fn(&Run) -> Option<f64>);

/// The columns of `bench.csv` behind the shape and the knobs.
const COLUMNS: &[Column] = &[
    ("points", |run| Some(run.points as f64)),
    ("cpu_s", |run| Some(run.cpu_s)),
    ("steel_s", |run| Some(run.steel_s)),
    ("points_s", |run| Some(run.points_s)),
    ("lambda_s", |run| Some(run.lambda_s)),
    ("map_s", |run| Some(run.map_s)),
    ("lambda_n_per_m", |run| run.lambda_n_per_m),
    ("lambda_error", |run| run.lambda_error),
    ("felt_error", |run| run.felt_error),
];

/// The knobs as columns; a knob that a scene does not have is empty.
const KNOBS: [(&str, KnobName); 4] = [
    ("tolerance", KnobName::Tolerance),
    ("points_x", KnobName::Points),
    ("max_deviation_m", KnobName::MaxDeviation),
    ("nodes_x", KnobName::Nodes),
];

/// Writes `bench.csv`: a row for every run.
///
/// # Errors
/// The writer's.
pub fn write_runs(out: &mut dyn Write, shapes: &[ShapeBench]) -> io::Result<()> {
    let knobs = KNOBS.iter().map(|(name, _)| *name);
    let columns = COLUMNS.iter().map(|(name, _)| *name);
    let names: Vec<&str> = std::iter::once("shape")
        .chain(knobs)
        .chain(columns)
        .chain(["present"])
        .collect();
    writeln!(out, "{}", names.join(","))?;
    for shape in shapes {
        for run in &shape.runs {
            let mut line = Vec::new();
            push_text(&mut line, &shape.shape);
            for (_, name) in KNOBS {
                let at = shape.knobs.iter().position(|knob| knob.name == name);
                if let Some(at) = at {
                    let setting = run.settings[at] as usize;
                    push_number(&mut line, shape.knobs[at].settings[setting].value);
                }
                line.push(b',');
            }
            for (_, value) in COLUMNS {
                match value(run) {
                    Some(value) => push_cell(&mut line, value),
                    None => line.push(b','),
                }
            }
            let present: &[u8] = if shape.is_present(run) {
                b"true"
            } else {
                b"false"
            };
            line.extend_from_slice(present);
            line.push(b'\n');
            out.write_all(&line)?;
        }
    }
    Ok(())
}
