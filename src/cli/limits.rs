//! Limits on screen.

use super::quantity::{mass, mm, number, si};
use crate::coil::limits::{Direction, by_key};

/// The name on screen of the limit that artefacts call `key`.
pub fn label(key: &str) -> &str {
    by_key(key).map_or(key, |limit| limit.label)
}

/// A value of that limit, SI, in its unit on screen.
pub fn limit_value(key: &str, value: f64) -> String {
    match by_key(key).map_or("", |limit| limit.unit) {
        "mm" => mm(value),
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
        label(key).to_owned(),
        limit_value(key, value),
        format!("{sign} {}", limit_value(key, limit)),
        state.to_owned(),
    ]
}
