//! One design of a sweep: its row.

use std::path::Path;

use crate::RunError;
use crate::bundle::sweep::{Mode, OptimumRow, PlanFile, PointFile, Row, Status, Value};
use crate::coil::optimum::Ending;
use crate::commands::optimize::{Document, Optimization, OptimizeRequest, optimize};
use crate::design::template::Template;
use crate::design::{Design, InvalidDocument, Need, Severity};
use crate::progress::Silent;
use crate::scene::Scene;
use crate::scene::iron::without_iron;
use crate::scene::rated::{CircuitSummary, Rated};

/// A plan made ready for computing its points.
pub(super) struct Sweep<'a> {
    plan: &'a PlanFile,
    path: &'a Path,
    template: Template,
}

impl<'a> Sweep<'a> {
    /// # Errors
    /// Invalid TOML.
    pub(super) fn new(plan: &'a PlanFile) -> Result<Self, RunError> {
        let path = plan.inputs.first().map_or("", |input| input.path.as_str());
        let path = Path::new(path);
        let template = Template::new(&plan.design_text, path)
            .map_err(|error| RunError::Input(error.to_string()))?;
        Ok(Self {
            plan,
            path,
            template,
        })
    }

    /// Point `index`; a design that cannot be computed is a point that failed.
    pub(super) fn point(&self, index: u64) -> PointFile {
        let sha256 = &self.plan.plan_sha256;
        let point = match self.outcome(index) {
            Ok(Computed::Row(row, status)) => PointFile::new(sha256, index, Ok((row, status))),
            Ok(Computed::NoCoil(status, why)) => PointFile::without_row(sha256, index, status, why),
            Err(message) => PointFile::new(sha256, index, Err(message)),
        };
        match point.to_bytes() {
            Ok(_) => point,
            // A number that is not finite.
            Err(error) => PointFile::new(sha256, index, Err(error.to_string())),
        }
    }

    fn outcome(&self, index: u64) -> Result<Computed, String> {
        let values = self.plan.values_at(index);
        let settings = self
            .plan
            .axes
            .iter()
            .zip(values)
            .map(|(axis, value)| (axis.key.as_str(), toml_value(value)));
        let text = self.template.with(settings)?;
        let need = match self.plan.mode {
            Mode::Evaluate => Need::EVALUATE,
            Mode::Optimize | Mode::OptimizeWound => Need::OPTIMIZE,
        };
        let (design, _) = Design::from_toml(&text, self.path, need).map_err(|e| refusal(&e))?;
        let computed = match self.plan.mode {
            Mode::Evaluate => evaluated(&design, self.plan.tolerance),
            Mode::Optimize | Mode::OptimizeWound => {
                let document = Document {
                    design: &design,
                    text: &text,
                    path: self.path,
                };
                let request = OptimizeRequest {
                    wound: self.plan.mode == Mode::OptimizeWound,
                    seed: self.plan.seed_at(index),
                    around: false,
                    tolerance: self.plan.tolerance,
                    ..OptimizeRequest::default()
                };
                optimize(&document, Vec::new(), &request, &Silent).map(|result| optimum(&result))
            }
        };
        computed.map_err(|error| error.to_string())
    }
}

/// The result of one design.
enum Computed {
    Row(Row, Status),
    NoCoil(Status, String),
}

fn optimum(result: &Optimization) -> Computed {
    let (Some(coil), Some(objective)) = (&result.coil, &result.objective) else {
        let status = match result.status {
            Ending::Unbounded => Status::Unbounded,
            Ending::Infeasible | Ending::Optimal => Status::Infeasible,
        };
        let why = result.no_coil.as_ref().map(|none| none.message.clone());
        return Computed::NoCoil(status, why.unwrap_or_default());
    };
    let row = Row {
        current_a: objective.current_a,
        gradient_t_per_m_per_a: objective.gradient_t_per_m_per_a,
        force_n: objective.force_n + objective.passive_force_n.unwrap_or(0.0),
        core_peak_field_t: coil.core_peak_field_t,
        limits_met: result.limits.values().all(|limit| limit.met),
        optimum: Some(OptimumRow {
            inner_diameter_m: coil.size.inner_diameter_m,
            outer_diameter_m: coil.size.outer_diameter_m,
            length_m: coil.size.length_m,
            wire_diameter_m: coil.wire_diameter_m,
            layers: coil.whole.map(|whole| whole.layers),
            turns_per_layer: coil.whole.map(|whole| whole.turns_per_layer),
            certificate: result.certificate.kind,
            upper_bound_n: result.certificate.upper_bound_n,
        }),
        ..row(coil.turns, &coil.circuit)
    };
    Computed::Row(row, status(result.accuracy_reached))
}

fn evaluated(design: &Design, tolerance: Option<f64>) -> Result<Computed, RunError> {
    without_iron(design, "sweep")?;
    let rated = Rated::new(&Scene::with_tolerance(design, tolerance)?)?;
    let row = Row {
        current_a: rated.target.current_a,
        gradient_t_per_m_per_a: rated.target.gradient_t_per_m_per_a,
        force_n: rated.target.force_n,
        core_peak_field_t: rated.core.as_ref().map(|core| core.peak_field_t),
        limits_met: rated.limits.values().all(|check| check.met),
        ..row(rated.coil.turns, &rated.coil.circuit)
    };
    Ok(Computed::Row(row, status(rated.accuracy_missed.is_empty())))
}

/// A row of the coil alone.
fn row(turns: f64, circuit: &CircuitSummary) -> Row {
    Row {
        turns,
        resistance_ohm: circuit.resistance_ohm,
        inductance_h: circuit.inductance_h,
        settling_s: circuit.settling_s,
        power_w: circuit.power_w,
        mass_kg: circuit.mass_kg,
        wire_length_m: circuit.wire_length_m,
        ..Row::default()
    }
}

fn status(accuracy_reached: bool) -> Status {
    if accuracy_reached {
        Status::Done
    } else {
        Status::AccuracyNotReached
    }
}

/// Why a design was refused, in one line and without places: its text is not the user's.
fn refusal(refused: &InvalidDocument) -> String {
    let faults = refused.faults.list().iter();
    let faults: Vec<String> = faults
        .filter(|fault| fault.severity == Severity::Error)
        .map(ToString::to_string)
        .collect();
    faults.join("; ")
}

/// The value as TOML. Whole numbers are integers: keys that count take them, all others too.
pub(crate) fn toml_value(value: &Value) -> toml::Value {
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
