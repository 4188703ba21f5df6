//! One design of a sweep: its row.

use std::path::Path;

use crate::RunError;
use crate::bundle::sweep::{
    ArrayRow, IronRow, Mode, OptimumRow, PlanFile, PointFile, Row, Status, Value,
};
use crate::coil::optimum::Ending;
use crate::commands::evaluate::evaluate;
use crate::commands::optimize::array::physics::{Aim, ArrayPhysics};
use crate::commands::optimize::array::{
    ArrayEnding, ArrayRequest, optimize_array, settling_in_array,
};
use crate::commands::optimize::{Document, Optimization, OptimizeRequest, optimize};
use crate::design::template::Template;
use crate::design::{Design, InvalidDocument, Need, Severity};
use crate::numerics::mixed_search::Settings;
use crate::progress::{Interrupted, Silent, poll};
use crate::scene::cost::{Cost, OfDesigns, of_designs};
use crate::scene::rated::{CircuitSummary, Rated};
use crate::scene::sources::ShapeSource;
use crate::scene::{Scene, neighbours};

/// A plan made ready for computing its points.
pub(super) struct Sweep<'a> {
    plan: &'a PlanFile,
    path: &'a Path,
    template: Template,
    /// Those of a plan that searches arrays.
    shapes: Vec<ShapeSource>,
}

impl<'a> Sweep<'a> {
    /// # Errors
    /// Invalid TOML.
    pub(super) fn new(plan: &'a PlanFile, shapes: Vec<ShapeSource>) -> Result<Self, RunError> {
        let path = plan.inputs.first().map_or("", |input| input.path.as_str());
        let path = Path::new(path);
        let template = Template::new(&plan.design_text, path)
            .map_err(|error| RunError::Input(error.to_string()))?;
        Ok(Self {
            plan,
            path,
            template,
            shapes,
        })
    }

    /// The time that points like this one take, `points` of them; `None` where its design cannot be read.
    pub(super) fn cost(&self, index: u64, points: u64) -> Option<Cost> {
        let (design, _) = self.design(index).ok()?;
        let what = match self.plan.mode {
            Mode::Evaluate => OfDesigns::Evaluated,
            Mode::Optimize | Mode::OptimizeWound => OfDesigns::Searched,
            Mode::OptimizeFor => OfDesigns::ArraysFor(&self.shapes, self.evaluations()),
        };
        Some(of_designs(&design, what, points, self.plan.tolerance))
    }

    /// Arrays that the search of a point computes at most.
    fn evaluations(&self) -> usize {
        let task = self.plan.array.as_ref();
        task.map_or(Settings::default().evaluations, |task| task.evaluations)
    }

    /// The design of point `index` and its text.
    fn design(&self, index: u64) -> Result<(Design, String), String> {
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
            Mode::OptimizeFor => Need::CALIBRATE,
        };
        let (design, _) = Design::from_toml(&text, self.path, need).map_err(|e| refusal(&e))?;
        Ok((design, text))
    }

    /// Point `index`; a design that cannot be computed is a point that failed.
    pub(super) fn point(&self, index: u64) -> PointFile {
        let sha256 = &self.plan.plan_sha256;
        let point = match self.outcome(index) {
            Ok(Computed::Row(row, status)) => PointFile::new(sha256, index, Ok((*row, status))),
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
        let (design, text) = self.design(index)?;
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
                optimize(&document, Vec::new(), &request, &Silent)
                    .map(|result| optimum(&design, &result))
            }
            Mode::OptimizeFor => self.array(design, text, index),
        };
        if let Err(RunError::Interrupted(_)) = computed {
            // Leaves here: a point that was stopped is none.
            poll();
        }
        computed.map_err(|error| error.to_string())
    }
}

impl Sweep<'_> {
    /// The array that renders the shapes best.
    fn array(&self, design: Design, text: String, index: u64) -> Result<Computed, RunError> {
        let tolerance = self.plan.tolerance;
        let (design, text) = settling_in_array(design, text, self.path, tolerance)?;
        let physics = ArrayPhysics::new(&self.shapes, Aim::default(), tolerance, &Silent)?;
        let default = Settings::default();
        let settings = Settings {
            seed: self.plan.seed_at(index),
            evaluations: self.evaluations(),
            ..default
        };
        let request = ArrayRequest {
            shares: Some(vec![1.0; self.shapes.len()]),
            settings,
            tolerance,
            every_count: false,
        };
        let document = Document {
            design: &design,
            text: &text,
            path: self.path,
        };
        let found = optimize_array(
            &document,
            &self.shapes,
            Vec::new(),
            &request,
            &physics,
            &|_| (),
            &Silent,
        )?;
        match found.status {
            ArrayEnding::Done => {}
            ArrayEnding::Interrupted => return Err(RunError::Interrupted(Interrupted)),
            ArrayEnding::Infeasible => {
                let missed = found.limits.iter().filter(|(_, check)| !check.met);
                let missed: Vec<&str> = missed.map(|(key, _)| *key).collect();
                let why = format!("no array that was computed meets {}", missed.join(" and "));
                return Ok(Computed::NoCoil(Status::Infeasible, why));
            }
        }
        let (best, _) = Design::from_toml(&found.design_text, self.path, Need::EVALUATE)
            .map_err(|wrong| RunError::Input(refusal(&wrong)))?;
        let Computed::Row(mut row, status) = evaluated(&best, tolerance)? else {
            return Err(RunError::Input("the best array has no coil".to_owned()));
        };
        row.limits_met = found.limits_met;
        row.array = Some(ArrayRow {
            gain: found.gain,
            lambda_n_per_m: found
                .shapes
                .iter()
                .filter_map(|shape| shape.lambda_n_per_m)
                .collect(),
            coils: best.array.positions_m.len() as u64,
            evaluations: found.evaluations as u64,
            values: found.values,
        });
        Ok(Computed::Row(row, status))
    }
}

/// The result of one design.
enum Computed {
    Row(Box<Row>, Status),
    NoCoil(Status, String),
}

fn optimum(design: &Design, result: &Optimization) -> Computed {
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
        ..row(design, coil.turns, &coil.circuit, objective.current_a)
    };
    Computed::Row(Box::new(row), status(result.accuracy_reached))
}

fn evaluated(design: &Design, tolerance: Option<f64>) -> Result<Computed, RunError> {
    if design.has_iron() {
        return among_steel(design, tolerance);
    }
    let scene = Scene::with_tolerance(design, tolerance)?;
    let mut rated = Rated::new(&scene)?;
    if design.limits.array_settling_max_s.is_some() {
        neighbours::of_rated(&scene, &mut rated)?;
    }
    let row = Row {
        current_a: rated.target.current_a,
        gradient_t_per_m_per_a: rated.target.gradient_t_per_m_per_a,
        force_n: rated.target.force_n,
        core_peak_field_t: rated.core.as_ref().map(|core| core.peak_field_t),
        limits_met: rated.limits.values().all(|check| check.met),
        ..row(
            design,
            rated.coil.turns,
            &rated.coil.circuit,
            rated.target.current_a,
        )
    };
    Ok(Computed::Row(
        Box::new(row),
        status(rated.accuracy_missed.is_empty()),
    ))
}

/// A coil alone, and what `evaluate` has of the array with its plate and other steel.
fn among_steel(design: &Design, tolerance: Option<f64>) -> Result<Computed, RunError> {
    let evaluation = evaluate(design, Vec::new(), tolerance)?;
    let current_a = evaluation.target.current_a;
    let iron = evaluation.array.as_ref().and_then(|array| {
        let slowest = CircuitSummary {
            inductance_h: array.slowest_inductance_h,
            ..evaluation.coil.circuit
        };
        let own = array.coils.iter().map(|coil| coil.inductance_h);
        Some(IronRow {
            inductance_h: own.fold(0.0, f64::max),
            settling_s: slowest.settling_under_s(&design.supply, current_a),
            peak_field_t: array.iron.as_ref()?.peak_field_t,
        })
    });
    let row = Row {
        current_a,
        gradient_t_per_m_per_a: evaluation.target.gradient_t_per_m_per_a,
        force_n: evaluation.target.force_n,
        core_peak_field_t: evaluation.core.as_ref().map(|core| core.peak_field_t),
        limits_met: evaluation.limits_met(),
        iron,
        ..row(
            design,
            evaluation.coil.turns,
            &evaluation.coil.circuit,
            current_a,
        )
    };
    Ok(Computed::Row(
        Box::new(row),
        status(evaluation.accuracy_reached),
    ))
}

/// A row of the coil alone; its settling time is that of its limit, a current loop's where there is one.
fn row(design: &Design, turns: f64, circuit: &CircuitSummary, current_a: f64) -> Row {
    Row {
        turns,
        resistance_ohm: circuit.resistance_ohm,
        inductance_h: circuit.inductance_h,
        settling_s: circuit.settling_under_s(&design.supply, current_a),
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
