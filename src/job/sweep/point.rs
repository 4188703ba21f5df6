//! One design of a sweep: its row.

use std::path::Path;

use crate::bundle::sweep::{Mode, PlanFile, PointFile, Row, Status, Value};
use crate::design::template::Template;
use crate::design::{Design, InvalidDocument, Need, Severity};
use crate::job::JobError;
use crate::job::rated::Rated;
use crate::job::scene::Scene;

/// A plan made ready for computing its points.
pub(super) struct Sweep<'a> {
    plan: &'a PlanFile,
    path: &'a Path,
    template: Template,
}

impl<'a> Sweep<'a> {
    /// # Errors
    /// A mode that this version does not know; a text that is no TOML.
    pub(super) fn new(plan: &'a PlanFile) -> Result<Self, JobError> {
        if plan.mode == Mode::Optimize {
            let message = "the plan's mode is \"optimize\", which this version cannot do";
            return Err(JobError::NotModelled(message.to_owned()));
        }
        let path = plan.inputs.first().map_or("", |input| input.path.as_str());
        let path = Path::new(path);
        let template = Template::new(&plan.design_text, path)
            .map_err(|error| JobError::Input(error.to_string()))?;
        Ok(Self {
            plan,
            path,
            template,
        })
    }

    /// Point `index`; a design that cannot be computed is a point that failed.
    pub(super) fn point(&self, index: u64) -> PointFile {
        let sha256 = &self.plan.plan_sha256;
        let point = PointFile::new(sha256, index, self.outcome(index));
        match point.to_bytes() {
            Ok(_) => point,
            // A number that is none.
            Err(error) => PointFile::new(sha256, index, Err(error.to_string())),
        }
    }

    fn outcome(&self, index: u64) -> Result<(Row, Status), String> {
        let values = self.plan.values_at(index);
        let settings = self
            .plan
            .axes
            .iter()
            .zip(values)
            .map(|(axis, value)| (axis.key.as_str(), toml_value(value)));
        let text = self.template.with(settings)?;
        let (design, _) =
            Design::from_toml(&text, self.path, Need::EVALUATE).map_err(|e| refusal(&e))?;
        row(self.plan.mode, &design, self.plan.tolerance).map_err(|error| error.to_string())
    }
}

/// The row of one design. A mode that draws random numbers begins at [`PlanFile::seed_at`].
fn row(mode: Mode, design: &Design, tolerance: Option<f64>) -> Result<(Row, Status), JobError> {
    match mode {
        Mode::Evaluate => evaluated(design, tolerance),
        Mode::Optimize => Err(JobError::NotModelled("mode \"optimize\"".to_owned())),
    }
}

fn evaluated(design: &Design, tolerance: Option<f64>) -> Result<(Row, Status), JobError> {
    let scene = Scene::new(design)?;
    let rated = Rated::new(&scene, tolerance)?;
    let circuit = &rated.circuit;
    let row = Row {
        turns: circuit.turns,
        resistance_ohm: circuit.resistance_ohm,
        inductance_h: circuit.inductance_h,
        settling_s: circuit.settling_s(),
        power_w: rated.power_w,
        mass_kg: rated.mass_kg,
        wire_length_m: circuit.wire_length_m,
        current_a: rated.current_a,
        gradient_t_per_m_per_a: rated.single.field.dbz_dz,
        force_n: rated.force.force_n[2],
        core_peak_field_t: rated.single.core.as_ref().map(|core| core.peak_field_t),
        limits_met: rated.limits.values().all(|check| check.met),
    };
    let status = if rated.accuracy_reached {
        Status::Done
    } else {
        Status::AccuracyNotReached
    };
    Ok((row, status))
}

/// Why a design was refused, in one line and without places: its text is not the user's.
fn refusal(refused: &InvalidDocument) -> String {
    let faults = refused.faults.list().iter();
    let told: Vec<String> = faults
        .filter(|fault| fault.severity == Severity::Error)
        .map(ToString::to_string)
        .collect();
    told.join("; ")
}

/// The value as TOML. Whole numbers are integers: keys that count take them, all others too.
pub(super) fn toml_value(value: &Value) -> toml::Value {
    match value {
        Value::Flag(flag) => toml::Value::Boolean(*flag),
        Value::Number(number) if number.fract() == 0.0 && number.abs() < 1e15 => {
            toml::Value::Integer(*number as i64)
        }
        Value::Number(number) => toml::Value::Float(*number),
        Value::Text(text) => toml::Value::String(text.clone()),
        Value::List(values) => toml::Value::Array(values.iter().map(toml_value).collect()),
    }
}
