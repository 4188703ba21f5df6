//! The optimum as a design document, and what `evaluate` says of it.
//!
//! Dimensions are rounded to 15 digits of millimetres; where that breaks a limit by a rounding
//! the coil gives way by as much where there is room, so that the document meets its own limits.

use std::path::Path;

use crate::RunError;
use crate::coil::limits::{LimitCheck, LimitName, by_key};
use crate::coil::optimum::problem::{Regime, Task};
use crate::coil::optimum::{BestCoil, Fixed};
use crate::design::template::Template;
use crate::design::values::derived_name;
use crate::design::{Design, Need, Severity};
use crate::scene::Scene;
use crate::scene::neighbours::of_rated;
use crate::scene::rated::Rated;
use crate::units::m_from_mm;

/// Excess over a limit beyond which it is no rounding, relative.
const ROUNDING: f64 = 1e-5;
/// Relative steps by which slopes of the limits are found.
const SLOPE_STEP: f64 = 1e-4;
/// Most attempts to take it off.
const ATTEMPTS: i32 = 12;
/// The smallest bore, over the outer diameter: a design has one, a best coil may have none.
const BORE_MIN: f64 = 1e-6;

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

/// Millimetres whose length, as a document's are read, is at most `limit_m`: with 15 digits, or as many as it takes.
fn at_most_mm(limit_m: f64) -> f64 {
    let within = |value: &f64| m_from_mm(*value) <= limit_m;
    let mut value = Some(mm(limit_m)).filter(within).unwrap_or(limit_m * 1e3);
    while !within(&value) {
        value = value.next_down();
    }
    value
}

/// The same of at least `limit_m`.
fn at_least_mm(limit_m: f64) -> f64 {
    let within = |value: &f64| m_from_mm(*value) >= limit_m;
    let mut value = Some(mm(limit_m)).filter(within).unwrap_or(limit_m * 1e3);
    while !within(&value) {
        value = value.next_up();
    }
    value
}

/// Inner and outer diameter and length, mm, and the limits that they keep.
#[derive(Debug, Clone, Copy)]
struct Sizes {
    inner: f64,
    outer: f64,
    length: f64,
    inner_min: f64,
    outer_max: f64,
    length_max: f64,
}

impl Sizes {
    fn new(best: &BestCoil, task: &Task) -> Self {
        let window = &best.window;
        let least = task.bore_min_m(&best.strand).map_or(0.0, at_least_mm);
        let most = |limit: Option<f64>| limit.map_or(f64::INFINITY, at_most_mm);
        let outer_max = most(task.outer_max().map(|(_, most_m)| most_m));
        let length_max = most(task.limits.length_max_m);
        let within = |outer: f64| outer.min(outer_max);
        let outer = within(mm(2.0 * window.outer_radius_m()));
        let inner_min = least.max(BORE_MIN * outer);
        let sizes = Self {
            inner: mm(2.0 * window.inner_radius_m).max(inner_min),
            outer,
            length: mm(window.length_m).min(length_max),
            inner_min,
            outer_max,
            length_max,
        };
        let Some(whole) = best.whole else {
            return sizes;
        };
        let wire = mm(best.strand.diameter_m);
        let build = 2.0 * whole.layers as f64 * wire;
        let mut inner = sizes.inner;
        if task.fixed.outer_diameter_m.is_some() || inner + build > outer_max {
            inner = rounded(outer - build).max(inner_min);
        }
        Self {
            inner,
            outer: within(rounded(inner + build)),
            length: rounded(whole.turns_per_layer as f64 * wire).min(length_max),
            ..sizes
        }
    }

    /// Less wire by the relative amount `by`.
    fn shrink(&mut self, by: f64, best: &BestCoil, fixed: &Fixed) {
        if best.whole.is_some() {
            self.move_bore(-by * self.outer, fixed);
        } else if fixed.length_m.is_none() {
            self.length *= 1.0 - by;
        } else if fixed.outer_diameter_m.is_none() {
            self.outer -= by * (self.outer - self.inner);
        } else if fixed.inner_diameter_m.is_none() {
            self.inner += by * (self.outer - self.inner);
        }
    }

    /// More wire by the relative amount `by`, or as much as fits in the first dimension with room.
    fn grow(&mut self, by: f64, best: &BestCoil, fixed: &Fixed) {
        let step = by * (self.outer - self.inner);
        if best.whole.is_some() {
            self.move_bore(by * self.outer, fixed);
        } else if fixed.length_m.is_none() && self.length < self.length_max {
            self.length = (self.length * (1.0 + by)).min(self.length_max);
        } else if fixed.outer_diameter_m.is_none() && self.outer < self.outer_max {
            self.outer = (self.outer + step).min(self.outer_max);
        } else if fixed.inner_diameter_m.is_none() && self.inner > self.inner_min {
            self.inner = (self.inner - step).max(self.inner_min);
        }
    }

    /// A bore wider by `step` around whole layers, as far as the limits allow.
    fn move_bore(&mut self, step: f64, fixed: &Fixed) {
        if fixed.inner_diameter_m.is_some() || fixed.outer_diameter_m.is_some() {
            return;
        }
        let narrower = (self.inner_min - self.inner).min(0.0);
        let step = step.clamp(narrower, (self.outer_max - self.outer).max(0.0));
        self.inner += step;
        self.outer = (self.outer + step).min(self.outer_max);
    }
}

fn rounded(value_mm: f64) -> f64 {
    mm(value_mm * 1e-3)
}

/// The design with the coil `best`, and the coil evaluated.
///
/// # Errors
/// A coil that cannot be computed.
pub(super) fn write(
    document: &Document<'_>,
    best: &BestCoil,
    task: &Task,
    tolerance: Option<f64>,
) -> Result<(WrittenDesign, Rated), RunError> {
    let made = |sizes: Sizes| -> Result<Attempt, RunError> {
        let written = text_of(document, best, &sizes)?;
        let rated = rated(&written.design, tolerance)?;
        Ok(Attempt {
            over: excess(&rated, best.regime, task),
            sizes,
            written,
            rated,
        })
    };
    let mut nearest = made(Sizes::new(best, task))?;
    let (mut over, mut sizes) = (nearest.over, nearest.sizes);
    let mut attempt = 0;
    while over != 0.0 && over.abs() <= ROUNDING && attempt < ATTEMPTS {
        // The limits' own slopes are of order one.
        let by = (over.abs() * 2f64.powi(attempt)).max(2.3e-16);
        if over > 0.0 {
            sizes.shrink(by, best, &task.fixed);
        } else {
            sizes.grow(by, best, &task.fixed);
        }
        let mut next = made(sizes)?;
        if over * next.over < 0.0 {
            // One limit asks for less wire, another for more.
            let Some(both) = balanced(&nearest, &made, &task.fixed)? else {
                break;
            };
            sizes = both;
            next = made(both)?;
        }
        over = next.over;
        if over.abs() < nearest.over.abs() {
            nearest = next;
        }
        attempt += 1;
    }
    let Attempt {
        written, mut rated, ..
    } = nearest;
    if document.design.limits.array_settling_max_s.is_some() {
        of_rated(
            &Scene::with_tolerance(&written.design, tolerance)?,
            &mut rated,
        )?;
    }
    Ok((written, rated))
}

/// A coil as it was tried.
struct Attempt {
    /// [`excess`].
    over: f64,
    sizes: Sizes,
    written: WrittenDesign,
    rated: Rated,
}

/// Sizes near those of `at` that meet two limits, one of which asks for less wire and one for more: a Newton step
/// along length and outer diameter; `None` where these are fixed or at their own limits, or more limits bind.
///
/// # Errors
/// A coil that cannot be computed.
fn balanced(
    at: &Attempt,
    made: &impl Fn(Sizes) -> Result<Attempt, RunError>,
    fixed: &Fixed,
) -> Result<Option<Sizes>, RunError> {
    let sizes = at.sizes;
    let binding = |(key, check): (&&'static str, &LimitCheck)| {
        let over = check.value / check.limit - 1.0;
        (is_of_wire(key) && over.abs() <= ROUNDING).then_some((*key, over))
    };
    let binding: Vec<(&str, f64)> = at.rated.limits.iter().filter_map(binding).collect();
    let [(first, over_first), (second, over_second)] = binding[..] else {
        return Ok(None);
    };
    if fixed.length_m.is_some() || fixed.outer_diameter_m.is_some() {
        return Ok(None);
    }
    let along = |length: f64, outer: f64| Sizes {
        length: sizes.length * (1.0 + length),
        outer: sizes.outer * (1.0 + outer),
        ..sizes
    };
    let over = [over_first, over_second];
    let slopes = |moved: Sizes| -> Result<[f64; 2], RunError> {
        let limits = made(moved)?.rated.limits;
        let there = [first, second].map(|key| limits[key].value / limits[key].limit - 1.0);
        Ok([0, 1].map(|row| (there[row] - over[row]) / SLOPE_STEP))
    };
    let [a, c] = slopes(along(SLOPE_STEP, 0.0))?;
    let [b, d] = slopes(along(0.0, SLOPE_STEP))?;
    // A little more than the step's own error.
    let margin = SLOPE_STEP * over_first.abs().max(over_second.abs()) + 1e-14;
    let [p, q] = over.map(|over| -(over + margin));
    let determinant = a * d - b * c;
    let moved = along((p * d - b * q) / determinant, (a * q - p * c) / determinant);
    // Also where one slope is the other's multiple, and nothing moves both.
    let within = moved.length <= moved.length_max && moved.outer <= moved.outer_max;
    Ok(within.then_some(moved))
}

/// Whether a limit is one on the amount of wire; a window without given turns is full of it.
fn is_of_wire(key: &str) -> bool {
    by_key(key).is_some_and(|row| !row.name.is_dimension() && row.name != LimitName::WindingFill)
}

/// By how much limits on the amount of wire are exceeded, relatively; negative where the coil has
/// too little of it.
fn excess(rated: &Rated, regime: Regime, task: &Task) -> f64 {
    let mut most = 0.0;
    for (key, LimitCheck { value, limit, met }) in &rated.limits {
        let of_wire = by_key(key).filter(|row| !row.name.is_dimension());
        let Some(row) = of_wire.filter(|_| !met) else {
            continue;
        };
        let over = value / limit - 1.0;
        // At a given voltage heat falls with the resistance.
        let lacking = match row.name {
            LimitName::Power => regime == Regime::Supply,
            LimitName::ArrayPower => task.array_heat_w(rated.coil.circuit.resistance_ohm)[1] < 0.0,
            _ => false,
        };
        let over = if lacking { -over } else { over };
        if f64::abs(over) > f64::abs(most) {
            most = over;
        }
    }
    most
}

fn text_of(
    document: &Document<'_>,
    best: &BestCoil,
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
            toml::Value::String(derived_name(&design.name, "_optimum")),
        ),
        ("coil.inner_diameter_mm", number(sizes.inner)),
        ("coil.outer_diameter_mm", number(sizes.outer)),
        ("coil.length_mm", number(sizes.length)),
    ];
    if let Some(whole) = best.whole {
        let turns = toml::Value::Integer((whole.layers * whole.turns_per_layer) as i64);
        settings.push(("coil.turns", turns));
    }
    if !design.wire.choices_m.is_empty() {
        let strand = &best.strand;
        settings.push(("wire.diameter_mm", number(mm(strand.diameter_m))));
        let conductor = number(mm(strand.conductor_diameter_m));
        settings.push(("wire.conductor_diameter_mm", conductor));
    }
    let text = template.with(settings).map_err(RunError::Input)?;
    let (design, _) =
        Design::from_toml(&text, document.path, Need::EVALUATE).map_err(|refused| {
            let faults = refused.faults.list().iter();
            let faults: Vec<String> = faults
                .filter(|fault| fault.severity == Severity::Error)
                .map(ToString::to_string)
                .collect();
            RunError::Input(format!(
                "the best coil makes no design of its own: {}",
                faults.join("; ")
            ))
        })?;
    let design = design.without_iron();
    Ok(WrittenDesign { text, design })
}

/// The coil of `design` as `evaluate` computes it.
///
/// # Errors
/// A coil that cannot be computed.
pub(super) fn rated(design: &Design, tolerance: Option<f64>) -> Result<Rated, RunError> {
    Rated::new(&Scene::with_tolerance(design, tolerance)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A largest diameter of 27.939999999999998 mm was once written as 27.94 mm.
    #[test]
    fn a_limit_of_seventeen_digits_is_kept() {
        for limit_mm in [27.939999999999998, 69.99999999999999, 38.0, 0.7, 1.3] {
            let limit_m = m_from_mm(limit_mm);
            let (most, least) = (at_most_mm(limit_m), at_least_mm(limit_m));
            assert!(m_from_mm(most) <= limit_m && limit_m <= m_from_mm(least));
            assert!((least / most - 1.0).abs() < 1e-14, "{least} {most}");
        }
        assert_eq!(
            [38.0, 0.7].map(|size| at_most_mm(m_from_mm(size))),
            [38.0, 0.7]
        );
    }
}
