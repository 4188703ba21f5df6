//! The optimum as a design document, and what `evaluate` says of it.
//!
//! Dimensions are rounded to 15 digits of millimetres; where that breaks a limit by a rounding
//! the coil gives way by as much, so that the document meets its own limits.

use std::path::Path;

use crate::RunError;
use crate::coil::limits::LimitCheck;
use crate::coil::optimum::problem::Regime;
use crate::coil::optimum::{Fixed, Strand, Window};
use crate::design::template::Template;
use crate::design::{Design, Need, Severity};
use crate::scene::Scene;
use crate::scene::rated::Rated;

/// Excess over a limit beyond which it is no rounding, relative.
const ROUNDING: f64 = 1e-5;
/// Most attempts to take it off.
const ATTEMPTS: i32 = 12;
/// The smallest bore, over the outer diameter: a design has one, a best coil may have none.
const BORE_MIN: f64 = 1e-6;
/// The coil alone at its target.
const NEED: Need = Need {
    coil: true,
    array: false,
    target: true,
    workspace: false,
};

/// The document that the design was read from.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    /// Validated.
    pub design: &'a Design,
    /// Its text.
    pub text: &'a str,
    /// Where a relative B-H table is looked for.
    pub path: &'a Path,
}

/// A coil that was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chosen {
    pub strand: Strand,
    pub window: Window,
    /// Layers and turns a layer, where they are whole.
    pub whole: Option<[u64; 2]>,
    pub regime: Regime,
    pub fixed: Fixed,
}

/// The coil as a design.
pub(super) struct WrittenDesign {
    pub text: String,
    pub design: Design,
}

/// Millimetres of a length, to 15 digits.
fn mm(length_m: f64) -> f64 {
    let value = length_m * 1e3;
    format!("{value:.14e}").parse().unwrap_or(value)
}

/// Inner and outer diameter and length, mm.
#[derive(Debug, Clone, Copy)]
struct Sizes {
    inner: f64,
    outer: f64,
    length: f64,
}

impl Sizes {
    fn new(chosen: &Chosen, design: &Design) -> Self {
        let limits = &design.limits;
        let window = &chosen.window;
        let least = limits.inner_diameter_min_m.map_or(0.0, mm);
        let most = |limit: Option<f64>| limit.map_or(f64::INFINITY, mm);
        let (outer_max, length_max) =
            (most(limits.outer_diameter_max_m), most(limits.length_max_m));
        let within = |outer: f64| outer.min(outer_max);
        let outer = within(mm(2.0 * window.outer_radius_m()));
        let floor = least.max(BORE_MIN * outer);
        let mut inner = mm(2.0 * window.inner_radius_m).max(floor);
        let sizes = Self {
            inner,
            outer,
            length: mm(window.length_m).min(length_max),
        };
        let Some([layers, turns]) = chosen.whole else {
            return sizes;
        };
        let wire = mm(chosen.strand.diameter_m);
        let build = 2.0 * layers as f64 * wire;
        if inner + build > outer_max {
            inner = (outer_max - build).max(floor);
        }
        Self {
            inner,
            outer: rounded(inner + build),
            length: rounded(turns as f64 * wire).min(length_max),
        }
    }

    /// Less wire by the relative amount `by`.
    fn shrink(&mut self, by: f64, chosen: &Chosen) {
        let fixed = &chosen.fixed;
        if chosen.whole.is_some() {
            let step = by * self.outer;
            if fixed.inner_diameter_m.is_none() && self.inner > step {
                self.inner -= step;
                self.outer -= step;
            }
        } else if fixed.length_m.is_none() {
            self.length *= 1.0 - by;
        } else if fixed.outer_diameter_m.is_none() {
            self.outer -= by * (self.outer - self.inner);
        } else if fixed.inner_diameter_m.is_none() {
            self.inner += by * (self.outer - self.inner);
        }
    }
}

fn rounded(value_mm: f64) -> f64 {
    mm(value_mm * 1e-3)
}

/// The design with the coil `chosen`, and the coil evaluated.
///
/// # Errors
/// A coil that cannot be computed.
pub(super) fn write(
    document: &Document<'_>,
    chosen: &Chosen,
    tolerance: Option<f64>,
) -> Result<(WrittenDesign, RatedFacts), RunError> {
    let mut sizes = Sizes::new(chosen, document.design);
    let mut attempt = 0;
    loop {
        let written = text_of(document, chosen, &sizes)?;
        let rated = RatedFacts::of(&written.design, tolerance)?;
        let over = excess(&rated, chosen.regime);
        if over == 0.0 || over.abs() > ROUNDING || attempt == ATTEMPTS {
            return Ok((written, rated));
        }
        // The limits' own slopes are of order one.
        let by = (over.abs() * 2f64.powi(attempt)).max(2.3e-16);
        sizes.shrink(by.copysign(over), chosen);
        attempt += 1;
    }
}

/// By how much limits on the amount of wire are exceeded, relatively; negative where the coil has
/// too little of it.
fn excess(rated: &RatedFacts, regime: Regime) -> f64 {
    let geometry = ["outer_diameter_m", "inner_diameter_m", "length_m"];
    let mut most = 0.0;
    for (name, LimitCheck { value, limit, met }) in &rated.limits {
        if *met || geometry.contains(name) {
            continue;
        }
        let over = value / limit - 1.0;
        // At a given voltage heat falls with the resistance.
        let lacking = *name == "power_w" && regime == Regime::Supply;
        let over = if lacking { -over } else { over };
        if f64::abs(over) > f64::abs(most) {
            most = over;
        }
    }
    most
}

fn text_of(
    document: &Document<'_>,
    chosen: &Chosen,
    sizes: &Sizes,
) -> Result<WrittenDesign, RunError> {
    let design = document.design;
    let mut template = Template::new(document.text, document.path)
        .map_err(|error| RunError::Input(error.to_string()))?;
    template.remove("coil.turns");
    template.remove("wire.choices_mm");
    let number = toml::Value::Float;
    let mut settings = vec![
        (
            "name",
            toml::Value::String(format!("{}_optimum", design.name)),
        ),
        ("coil.inner_diameter_mm", number(sizes.inner)),
        ("coil.outer_diameter_mm", number(sizes.outer)),
        ("coil.length_mm", number(sizes.length)),
    ];
    if let Some([layers, turns]) = chosen.whole {
        let turns = toml::Value::Integer((layers * turns) as i64);
        settings.push(("coil.turns", turns));
    }
    if !design.wire.choices_m.is_empty() {
        let strand = &chosen.strand;
        settings.push(("wire.diameter_mm", number(mm(strand.diameter_m))));
        let conductor = number(mm(strand.conductor_diameter_m));
        settings.push(("wire.conductor_diameter_mm", conductor));
    }
    let text = template.with(settings).map_err(RunError::Input)?;
    let (design, _) = Design::from_toml(&text, document.path, NEED).map_err(|refused| {
        let faults = refused.faults.list().iter();
        let told: Vec<String> = faults
            .filter(|fault| fault.severity == Severity::Error)
            .map(ToString::to_string)
            .collect();
        RunError::Input(format!(
            "the best coil makes no design of its own: {}",
            told.join("; ")
        ))
    })?;
    Ok(WrittenDesign { text, design })
}

/// A coil at its rated current as `evaluate` computes it.
pub(super) struct RatedFacts {
    pub size: super::SizeFacts,
    pub turns: f64,
    pub circuit: super::CircuitFacts,
    pub current_a: f64,
    pub gradient_t_per_m_per_a: f64,
    /// Of the current alone, N.
    pub force_n: f64,
    pub passive_n: Option<f64>,
    pub core_peak_field_t: Option<f64>,
    pub limits: std::collections::BTreeMap<&'static str, LimitCheck>,
    pub accuracy: std::collections::BTreeMap<&'static str, crate::accuracy::StageAccuracy>,
    pub accuracy_reached: bool,
    pub notes: Vec<String>,
}

impl RatedFacts {
    pub(super) fn of(design: &Design, tolerance: Option<f64>) -> Result<Self, RunError> {
        let scene = Scene::new(design)?;
        let rated = Rated::new(&scene, tolerance)?;
        let circuit = &rated.circuit;
        Ok(Self {
            size: super::SizeFacts {
                inner_diameter_m: scene.coil.inner_diameter_m,
                outer_diameter_m: scene.coil.outer_diameter_m,
                length_m: scene.coil.length_m,
            },
            turns: circuit.turns,
            circuit: super::CircuitFacts {
                resistance_ohm: circuit.resistance_ohm,
                inductance_h: circuit.inductance_h,
                time_constant_s: circuit.time_constant_s(),
                settling_s: circuit.settling_s(),
                wire_length_m: circuit.wire_length_m,
                mass_kg: rated.mass_kg,
                power_w: rated.power_w,
            },
            current_a: rated.current_a,
            gradient_t_per_m_per_a: rated.single.field.dbz_dz,
            force_n: rated.force.force_n[2] - rated.force.passive_n.unwrap_or(0.0),
            passive_n: rated.force.passive_n,
            core_peak_field_t: rated.single.core.as_ref().map(|core| core.peak_field_t),
            limits: rated.limits,
            accuracy: rated.single.accuracy,
            accuracy_reached: rated.accuracy_missed.is_empty(),
            notes: rated.single.notes,
        })
    }
}
