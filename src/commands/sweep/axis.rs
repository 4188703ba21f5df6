//! The argument of `--set`: `KEY=FROM:TO:STEP` or `KEY=A,B,C`.

use crate::bundle::sweep::{Axis, Value};
use crate::design::message_text::twelve_digits;

/// Most values of one axis.
pub const VALUES_MAX: usize = 1_000_000;

/// TO is included when it lies within this part of a step.
const SLACK: f64 = 1e-9;

/// Reads `KEY=FROM:TO:STEP` or `KEY=A,B,C`.
///
/// Numbers are numbers, `true` and `false` flags, `[A,B]` lists, anything else is text; quotes
/// make a text of what looks like a number.
///
/// # Errors
/// The expected and the actual text.
pub fn parse(text: &str) -> Result<Axis, String> {
    let (key, values) = text
        .split_once('=')
        .ok_or("expected KEY=FROM:TO:STEP or KEY=A,B,C, like wire.diameter_mm=0.5:1.0:0.05")?;
    let key = key.trim();
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if key
        .split('.')
        .any(|part| part.is_empty() || !part.chars().all(bare))
    {
        return Err(format!(
            "invalid key {key:?}: expected a dotted path, like wire.diameter_mm"
        ));
    }
    let values = match range(values) {
        Some(range) => steps(range?)?,
        None => list(values)?,
    };
    if values.len() > VALUES_MAX {
        return Err(format!("more than {VALUES_MAX} values"));
    }
    Ok(Axis {
        key: key.to_owned(),
        values,
    })
}

/// FROM, TO, STEP; `None` where the text is not a range: a colon after a number begins one.
fn range(text: &str) -> Option<Result<[f64; 3], String>> {
    let parts: Vec<&str> = text.split(':').map(str::trim).collect();
    if parts.len() < 2 || parts[0].parse::<f64>().is_err() {
        return None;
    }
    let numbers: Vec<f64> = parts
        .iter()
        .filter_map(|part| part.parse().ok())
        .filter(|number: &f64| number.is_finite())
        .collect();
    Some(match (numbers.as_slice(), parts.len()) {
        ([from, to, step], 3) => Ok([*from, *to, *step]),
        _ => Err(format!(
            "invalid range {text:?}: expected FROM:TO:STEP, three finite numbers, like 0.5:1.0:0.05"
        )),
    })
}

/// FROM + k STEP up to TO.
fn steps([from, to, step]: [f64; 3]) -> Result<Vec<Value>, String> {
    if step == 0.0 {
        return Err("STEP is 0: the range would not move".to_owned());
    }
    let steps = (to - from) / step;
    if steps < -SLACK {
        let (way, sign) = if step > 0.0 {
            ("up", "negative")
        } else {
            ("down", "positive")
        };
        return Err(format!(
            "STEP = {step} leads {way}, away from TO = {to}: swap FROM and TO, or make STEP {sign}"
        ));
    }
    if steps.is_nan() || steps >= VALUES_MAX as f64 {
        return Err(format!(
            "{:.3e} values are more than {VALUES_MAX}: make STEP larger",
            steps + 1.0
        ));
    }
    let count = (steps + SLACK).max(0.0).floor() as usize + 1;
    let value = |k: usize| {
        let value = twelve_digits(from + k as f64 * step);
        // Residue of cancellation at a zero.
        if value.abs() < SLACK * step.abs() {
            0.0
        } else {
            value
        }
    };
    let values: Vec<f64> = (0..count).map(value).collect();
    if values.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(format!(
            "STEP = {step} is lost beside FROM = {from}: values are rounded to 12 digits"
        ));
    }
    Ok(values.into_iter().map(Value::Number).collect())
}

fn list(text: &str) -> Result<Vec<Value>, String> {
    let mut values = Vec::new();
    for item in items(text)? {
        let value = value(item)?;
        if values.contains(&value) {
            return Err(format!("{item} is there twice"));
        }
        values.push(value);
    }
    Ok(values)
}

/// The parts between the commas that are in no bracket and no quotes.
fn items(text: &str) -> Result<Vec<&str>, String> {
    let (mut depth, mut quoted, mut start) = (0i32, false, 0);
    let mut items = Vec::new();
    for (at, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            _ if quoted => {}
            '[' => depth += 1,
            ']' => depth -= 1,
            ',' if depth == 0 => {
                items.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    if depth != 0 || quoted {
        return Err(format!(
            "{text:?} has a bracket or quote without its other half"
        ));
    }
    items.push(text[start..].trim());
    if items.iter().any(|item| item.is_empty()) {
        return Err(format!(
            "{text:?} has an empty value: expected A,B,C, like 4,6,8 or full,none"
        ));
    }
    Ok(items)
}

fn value(text: &str) -> Result<Value, String> {
    if let Some(inner) = text
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'))
    {
        let values: Result<Vec<Value>, String> = items(inner)?.into_iter().map(value).collect();
        return values.map(Value::List);
    }
    if let Some(inner) = text
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'))
    {
        return Ok(Value::Text(inner.to_owned()));
    }
    match (text, text.parse::<f64>()) {
        ("true", _) => Ok(Value::Flag(true)),
        ("false", _) => Ok(Value::Flag(false)),
        (_, Ok(number)) if number.is_finite() => Ok(Value::Number(number)),
        (_, Ok(_)) => Err(format!("{text:?} is not a finite number")),
        _ => Ok(Value::Text(text.to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Vec<f64> {
        let number = |value: Value| match value {
            Value::Number(number) => number,
            other => panic!("{other:?}"),
        };
        parse(text)
            .unwrap()
            .values
            .into_iter()
            .map(number)
            .collect()
    }

    #[test]
    fn a_range_includes_both_ends_with_the_digits_a_person_would_write() {
        assert_eq!(
            numbers("wire.diameter_mm=0.5:1.0:0.05"),
            [0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0]
        );
        assert_eq!(numbers("a=0:1:0.3"), [0.0, 0.3, 0.6, 0.9]);
        assert_eq!(numbers("a=7:1.3:-1.9"), [7.0, 5.1, 3.2, 1.3]);
        assert_eq!(
            numbers("a=-0.3:0.3:0.1"),
            [-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3]
        );
        assert_eq!(numbers("a=2:2:0.7"), [2.0]);
        // Within 1e-9 of a step, and not.
        assert_eq!(numbers("a=0:0.9999999995:0.5").len(), 3);
        assert_eq!(numbers("a=0:0.999999998:0.5").len(), 2);
        assert_eq!(numbers("a=0:1e6:10").len(), 100_001);
    }

    #[test]
    fn lists_hold_numbers_texts_flags_and_lists() {
        assert_eq!(numbers("limits.resistance_max_ohm=4, 6,8"), [4.0, 6.0, 8.0]);
        let text = |t: &str| Value::Text(t.to_owned());
        let values = |t: &str| parse(t).unwrap().values;
        assert_eq!(
            values("array.coupling=full,none"),
            [text("full"), text("none")]
        );
        assert_eq!(values("core.bh_curve=a.csv,C:/b.csv")[1], text("C:/b.csv"));
        assert_eq!(
            values("magnet.passive_force=true,false")[0],
            Value::Flag(true)
        );
        assert_eq!(values("name=\"0.7\",\"a,b\""), [text("0.7"), text("a,b")]);
        let pair = |a, b| Value::List(vec![Value::Number(a), Value::Number(b)]);
        assert_eq!(
            values("magnet.tilt_deg=[0,0],[7,1.3]"),
            [pair(0.0, 0.0), pair(7.0, 1.3)]
        );
        assert_eq!(values("a.b=0.7"), [Value::Number(0.7)]);
    }

    #[test]
    fn what_is_no_axis_is_refused_with_what_was_expected() {
        for (text, said) in [
            ("wire.diameter_mm", "expected KEY=FROM:TO:STEP"),
            ("=1,2", "invalid key"),
            ("wire..d=1", "invalid key"),
            ("wire d=1", "invalid key"),
            ("a=1:2:0", "STEP is 0"),
            ("a=1:2:-0.1", "leads down"),
            ("a=2:1:0.1", "leads up"),
            ("a=0:1e12:1", "1.000e12 values"),
            ("a=0:1e300:1e-300", "more than 1000000"),
            ("a=1:2", "three finite numbers"),
            ("a=1:x:2", "three finite numbers"),
            ("a=1:2:nan", "three finite numbers"),
            ("a=1:inf:1", "three finite numbers"),
            ("a=1:2:3:4", "three finite numbers"),
            ("a=1e9:1.000000001e9:1e-5", "is lost"),
            ("a=", "empty value"),
            ("a=1,,2", "empty value"),
            ("a=1,nan", "not a finite number"),
            ("a=1,-inf", "not a finite number"),
            ("a=1,2,1.0", "twice"),
            ("a=[1,2", "other half"),
            ("a=\"x", "other half"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
