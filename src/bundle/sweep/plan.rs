//! `plan.json`: what a sweep computes, sealed by a digest of itself.

use fluxform_numerics::random;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::artefact::{FLUXFORM_VERSION, Input, SCHEMA_VERSION, check_version, sha256_hex};
use crate::json::fault;

/// Most designs of one sweep.
pub const POINTS_MAX: u64 = 100_000_000;
/// Larger files are no plan.
pub(crate) const PLAN_MAX_BYTES: u64 = 256 << 20;

/// Task for each design of a sweep.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// The coil as given.
    Evaluate,
    /// The best coil within the design's limits.
    Optimize,
    /// The best of those that have whole layers and turns.
    #[serde(rename = "optimize-wound")]
    OptimizeWound,
    /// The array that renders the plan's shapes best.
    #[serde(rename = "optimize-for")]
    OptimizeFor,
}

/// The objective of a search of whole arrays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ArrayTask {
    /// Shape files; they and their surfaces are the last inputs of the plan.
    pub shapes: Vec<String>,
    /// Most arrays that the search of a point computes.
    pub evaluations: usize,
}

/// A value that a design's key is set to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Value {
    /// `true` or `false`.
    Flag(bool),
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
    /// A list.
    List(Vec<Value>),
}

/// A key of the design and the values it takes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Dotted, such as `wire.diameter_mm`.
    pub key: String,
    /// At least one.
    pub values: Vec<Value>,
}

/// A grid of designs: every combination of the axes' values, the last axis fastest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Layout, `major.minor.patch`.
    pub schema_version: String,
    /// Program that wrote it.
    pub fluxform_version: String,
    /// Name of the design.
    pub design: String,
    /// The design, then the B-H tables that its variants name; paths as given.
    pub inputs: Vec<Input>,
    /// Task for each design.
    pub mode: Mode,
    /// Where randomness in a point begins, together with its index.
    pub seed: u64,
    /// Allowed error, as `--tolerance`; null for the commands' own default.
    pub tolerance: Option<f64>,
    /// Number of designs.
    pub points: u64,
    /// Keys that vary.
    pub axes: Vec<Axis>,
    /// The shapes of `optimize-for`; absent in other modes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<ArrayTask>,
    /// The design file's text.
    pub design_text: String,
    /// Digest of this plan with this value empty, as compact JSON: an edited plan is recognised.
    pub plan_sha256: String,
}

impl PlanFile {
    /// A sealed plan. `points` is the product of the axes' lengths.
    #[must_use]
    pub fn new(
        design: String,
        inputs: Vec<Input>,
        mode: Mode,
        seed: u64,
        tolerance: Option<f64>,
        axes: Vec<Axis>,
        design_text: String,
    ) -> Self {
        let mut plan = Self {
            schema_version: SCHEMA_VERSION.to_owned(),
            fluxform_version: FLUXFORM_VERSION.to_owned(),
            design,
            inputs,
            mode,
            seed,
            tolerance,
            points: combinations(&axes).unwrap_or(0),
            axes,
            array: None,
            design_text,
            plan_sha256: String::new(),
        };
        plan.plan_sha256 = plan.digest();
        plan
    }

    /// The plan with the shapes of [`Mode::OptimizeFor`], whose files join the inputs; sealed again.
    #[must_use]
    pub fn for_shapes(mut self, task: ArrayTask, inputs: Vec<Input>) -> Self {
        self.inputs.extend(inputs);
        self.array = Some(task);
        self.plan_sha256 = self.digest();
        self
    }

    /// Reads a plan.
    ///
    /// # Errors
    /// The fault and the advice; `name` names the file.
    pub fn parse(name: &str, bytes: &[u8]) -> Result<Self, String> {
        let plan: Self = serde_json::from_slice(bytes).map_err(|error| {
            let error = fault(&error);
            format!("{name}: not a plan of a sweep: {error}; make one with `fluxform sweep plan`")
        })?;
        check_version(&plan.schema_version)
            .map_err(|end| format!("{name}: schema_version {end}"))?;
        if plan.digest() != plan.plan_sha256 {
            return Err(format!(
                "{name}: the plan was changed after it was made (plan_sha256 does not fit); make \
                 a new one with `fluxform sweep plan` instead of editing it"
            ));
        }
        if combinations(&plan.axes) != Some(plan.points) || plan.points == 0 {
            return Err(format!(
                "{name}: points = {} is not the number of combinations of the axes' values; make \
                 a new one with `fluxform sweep plan`",
                plan.points
            ));
        }
        if (plan.mode == Mode::OptimizeFor) != plan.array.is_some() {
            return Err(format!(
                "{name}: mode and array do not go together: shapes belong to optimize-for; make a new one \
                 with `fluxform sweep plan`"
            ));
        }
        if plan.points > POINTS_MAX {
            return Err(format!(
                "{name}: {} designs are more than {POINTS_MAX}; make a plan of fewer with \
                 `fluxform sweep plan`",
                plan.points
            ));
        }
        Ok(plan)
    }

    /// The values of point `index`, one per axis.
    #[must_use]
    pub fn values_at(&self, index: u64) -> Vec<&Value> {
        let mut rest = index;
        let mut values: Vec<&Value> = self
            .axes
            .iter()
            .rev()
            .map(|axis| {
                let count = axis.values.len() as u64;
                let value = &axis.values[(rest % count) as usize];
                rest /= count;
                value
            })
            .collect();
        values.reverse();
        values
    }

    /// Where the random numbers of point `index` begin: the plan's seed and the index, mixed
    /// (splitmix64), so that no two points share a sequence, whichever process computes them.
    #[must_use]
    pub fn seed_at(&self, index: u64) -> u64 {
        random::seed_at(self.seed, index)
    }

    fn digest(&self) -> String {
        let open = Self {
            plan_sha256: String::new(),
            ..self.clone()
        };
        // Numbers that are none become null, which a plan that is read cannot hold.
        sha256_hex(&serde_json::to_vec(&open).unwrap_or_default())
    }
}

fn combinations(axes: &[Axis]) -> Option<u64> {
    axes.iter()
        .try_fold(1u64, |all, axis| all.checked_mul(axis.values.len() as u64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::json::to_json;

    fn plan() -> PlanFile {
        let axis = |key: &str, values: &[f64]| Axis {
            key: key.to_owned(),
            values: values.iter().map(|v| Value::Number(*v)).collect(),
        };
        let axes = vec![
            axis("wire.diameter_mm", &[0.7, 1.3]),
            axis("coil.length_mm", &[30.0, 70.0, 90.0]),
        ];
        let input = vec![Input::of_bytes("a.toml", b"name")];
        let text = "name = \"a\"\n".to_owned();
        PlanFile::new("a".to_owned(), input, Mode::Evaluate, 7, None, axes, text)
    }

    #[test]
    fn the_last_axis_is_the_fastest() {
        let plan = plan();
        assert_eq!(plan.points, 6);
        let number = |v: &Value| match v {
            Value::Number(v) => *v,
            _ => f64::NAN,
        };
        let rows: Vec<Vec<f64>> = (0..6)
            .map(|i| plan.values_at(i).into_iter().map(number).collect())
            .collect();
        assert_eq!(rows[0], [0.7, 30.0]);
        assert_eq!(rows[1], [0.7, 70.0]);
        assert_eq!(rows[2], [0.7, 90.0]);
        assert_eq!(rows[3], [1.3, 30.0]);
        assert_eq!(rows[5], [1.3, 90.0]);
    }

    #[test]
    fn every_point_has_a_seed_of_its_own() {
        let mut plan = plan();
        plan.seed = 0;
        // The first outputs of splitmix64 from state 0.
        assert_eq!(plan.seed_at(0), 0xe220_a839_7b1d_cdaf);
        assert_eq!(plan.seed_at(1), 0x6e78_9e6a_a1b9_65f4);
        plan.seed = 1;
        assert_ne!(plan.seed_at(0), 0xe220_a839_7b1d_cdaf);
    }

    #[test]
    fn an_edited_plan_is_recognised_another_layout_of_the_same_is_not_an_edit() {
        let plan = plan();
        let text = String::from_utf8(to_json(&plan).unwrap()).unwrap();
        assert_eq!(PlanFile::parse("p", text.as_bytes()), Ok(plan.clone()));
        let compact = serde_json::to_vec(&plan).unwrap();
        assert_eq!(PlanFile::parse("p", &compact), Ok(plan));
        for (from, to) in [("1.3", "1.2"), ("\"seed\": 7", "\"seed\": 8"), ("\\n", "")] {
            let edited = text.replace(from, to);
            assert_ne!(edited, text);
            let said = PlanFile::parse("plan.json", edited.as_bytes()).unwrap_err();
            assert!(said.contains("plan.json: the plan was changed"), "{said}");
        }
        let odd = text.replace("\"seed\"", "\"sead\"");
        assert!(
            PlanFile::parse("p", odd.as_bytes())
                .unwrap_err()
                .contains("sead")
        );
        let newer = text.replace(&format!("\"{SCHEMA_VERSION}\""), "\"99.0.0\"");
        assert!(
            PlanFile::parse("p", newer.as_bytes())
                .unwrap_err()
                .contains("newer")
        );
    }
}
