//! Limits, and a coil's other numbers, on screen.

use super::quantity::{force, mass, mm, number, si};
use crate::coil::limits::{Direction, by_key};
use crate::report::limits::{label, words};

/// A value of the limit, or of the number, that artefacts call `key`, SI, in its unit on screen.
pub fn limit_value(key: &str, value: f64) -> String {
    match by_key(key).map_or_else(|| words(key).1, |limit| limit.unit) {
        "N" => force(value),
        "mm" => mm(value),
        // Dimensions are drawn in millimetres; wire is bought by the metre.
        "m" if by_key(key).is_none() => mm(value),
        "g" => mass(value),
        "" => number(value),
        unit => si(value, unit),
    }
}

/// A row of a table: the limit, the coil's value, what is allowed, and how it ended.
pub fn limit_row(key: &str, value: f64, limit: f64, state: &str) -> Vec<String> {
    let sign = match by_key(key).map(|limit| limit.direction) {
        Some(Direction::AtLeast) => ">=",
        Some(Direction::AtMost | Direction::Equal) | None => "<=",
    };
    vec![
        label(key),
        limit_value(key, value),
        format!("{sign} {}", limit_value(key, limit)),
        state.to_owned(),
    ]
}
