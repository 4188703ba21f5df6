//! Common parts of the cases: how an error is measured, generic numbers, the seed's coil, oracles.

use std::fmt::Display;

use serde_json::Value;

use super::Got;
use fluxform::field::winding::Winding;

/// The outcome of a case.
pub type Outcome = Result<Got, String>;

/// The seed's winding.
pub const SEED: Winding = Winding {
    inner_radius_m: 0.012,
    outer_radius_m: 0.019,
    length_m: 0.1,
    turns: 1429.0,
};

/// A winding.
pub const fn winding(inner_m: f64, outer_m: f64, length_m: f64, turns: f64) -> Winding {
    Winding {
        inner_radius_m: inner_m,
        outer_radius_m: outer_m,
        length_m,
        turns,
    }
}

/// The message of an error.
pub fn reported(error: impl Display) -> String {
    error.to_string()
}

/// One number against another, relative to that; absolute where that is 0.
pub fn close(found: f64, expected: f64, unit: &str) -> Outcome {
    Ok(Got {
        value: format!("{found:.12e} {unit} (expected {expected:.12e})"),
        error: off(found, expected),
    })
}

/// Relative difference; absolute where 0 is expected.
pub fn off(found: f64, expected: f64) -> f64 {
    if expected == 0.0 {
        found.abs()
    } else if found == expected {
        0.0
    } else {
        (found / expected - 1.0).abs()
    }
}

/// An error measured by the case itself.
pub fn measured(error: f64, what: impl Into<String>) -> Outcome {
    Ok(Got {
        value: what.into(),
        error,
    })
}

/// The largest of several errors.
pub fn worst(errors: impl IntoIterator<Item = f64>, what: &str) -> Outcome {
    let mut count = 0;
    let mut most = 0.0_f64;
    for error in errors {
        count += 1;
        // A not-a-number is no agreement.
        most = if error.is_nan() {
            f64::NAN
        } else {
            most.max(error)
        };
        if most.is_nan() {
            break;
        }
    }
    if count == 0 {
        return Err(format!("{what}: nothing was compared"));
    }
    measured(most, format!("{what}: {most:.2e} at most in {count}"))
}

/// The largest difference of two lists.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// A statement that holds or does not.
pub fn holds(is_so: bool, what: impl Into<String>) -> Outcome {
    measured(if is_so { 0.0 } else { f64::INFINITY }, what)
}

/// A refusal whose message names all of `parts`.
pub fn refused<T>(result: Result<T, impl Display>, parts: &[&str]) -> Outcome {
    match result {
        Ok(_) => Err("accepted".to_owned()),
        Err(message) => {
            let message = message.to_string();
            let named = parts.iter().all(|part| message.contains(part));
            holds(named, format!("refused: {message}"))
        }
    }
}

/// The winding of that name among the committed values of air coils, which come with it.
pub fn known_winding(name: &str) -> Result<(Value, Winding), String> {
    let table = oracle(include_str!("../../oracles/air_coil.json"))?;
    let w = &table["windings"][name];
    let winding = Winding {
        inner_radius_m: number(&w["inner_radius_m"])?,
        outer_radius_m: number(&w["outer_radius_m"])?,
        length_m: number(&w["length_m"])?,
        turns: number(&w["turns"])?,
    };
    Ok((table, winding))
}

/// A committed table of reference values.
pub fn oracle(text: &str) -> Result<Value, String> {
    serde_json::from_str(text).map_err(reported)
}

/// A number of such a table, whether it stands there as text or not.
pub fn number(value: &Value) -> Result<f64, String> {
    let parsed = value.as_str().map(str::parse::<f64>);
    match parsed {
        Some(Ok(number)) => Ok(number),
        _ => value
            .as_f64()
            .ok_or_else(|| format!("no number in the oracle: {value}")),
    }
}

/// A list of numbers of such a table.
pub fn numbers(value: &Value) -> Result<Vec<f64>, String> {
    let list = value.as_array().ok_or("no list in the oracle")?;
    list.iter().map(number).collect()
}
