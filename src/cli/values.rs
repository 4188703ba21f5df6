//! Argument values, validated where they are read.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::force_direction::{ForceDirection, NormalForce};
use crate::lambda::Criterion;
use crate::map::Components;
use crate::point_weights::Weights;
use crate::scene::tolerances::ErrorTarget;
use crate::shape::document::{Up, parse_unit};
use crate::units::m_from_mm;

/// Any criterion by its name.
pub fn criterion() -> impl TypedValueParser<Value = Criterion> {
    let of = |criterion: &Criterion| PossibleValue::new(criterion.name()).help(criterion.meaning());
    let names = PossibleValuesParser::new(Criterion::ALL.iter().map(of));
    names.try_map(|name| name.parse::<Criterion>())
}

/// Any direction of the requested force by its name.
pub fn force_direction() -> impl TypedValueParser<Value = ForceDirection> {
    let of = |one: &ForceDirection| PossibleValue::new(one.name()).help(one.meaning());
    let names = PossibleValuesParser::new(ForceDirection::ALL.iter().map(of));
    names.try_map(|name| name.parse::<ForceDirection>())
}

/// Any size of a force along the normal by its name.
pub fn normal_force() -> impl TypedValueParser<Value = NormalForce> {
    let of = |one: &NormalForce| PossibleValue::new(one.name()).help(one.meaning());
    let names = PossibleValuesParser::new(NormalForce::ALL.iter().map(of));
    names.try_map(|name| name.parse::<NormalForce>())
}

/// How points count, by name.
pub fn weights() -> impl TypedValueParser<Value = Weights> {
    let of = |one: &Weights| PossibleValue::new(one.name()).help(one.meaning());
    let names = PossibleValuesParser::new(Weights::ALL.iter().map(of));
    names.try_map(|name| name.parse::<Weights>())
}

/// Any components of a map by their name.
pub fn components() -> impl TypedValueParser<Value = Components> {
    let of = |one: &Components| PossibleValue::new(one.name()).help(one.meaning());
    let names = PossibleValuesParser::new(Components::ALL.iter().map(of));
    names.try_map(|name| name.parse::<Components>())
}

/// Most threads that may be asked for.
const THREADS_MAX: usize = 1024;
/// Tolerances that make sense, relative.
const TOLERANCE: std::ops::RangeInclusive<f64> = 1e-15..=1e-1;

/// A file, or `-` for standard input or output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FileArgument {
    /// `-`.
    Standard,
    /// Anything else.
    Path(PathBuf),
}

impl From<OsString> for FileArgument {
    fn from(text: OsString) -> Self {
        if text == "-" {
            Self::Standard
        } else {
            Self::Path(text.into())
        }
    }
}

impl FileArgument {
    /// The path as given, `-` for a standard stream.
    #[must_use]
    pub fn as_given(&self) -> &Path {
        match self {
            Self::Standard => Path::new("-"),
            Self::Path(path) => path,
        }
    }

    /// True for `-`.
    #[must_use]
    pub fn is_standard(&self) -> bool {
        *self == Self::Standard
    }
}

/// Samples along x and y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GridSize(pub [usize; 2]);

/// Lengths, m, of three comma-separated millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translation(pub [f64; 3]);

/// Three factors, greater than 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale(pub [f64; 3]);

/// Three angles, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation(pub [f64; 3]);

/// Two ends, m, of two comma-separated millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ends(pub [f64; 2]);

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != N {
        return Err(format!("expected {expected}, found {} values", parts.len()));
    }
    let mut values = [0.0; N];
    for (value, part) in values.iter_mut().zip(parts) {
        *value = number(part).map_err(|fault| format!("expected {expected}: {fault}"))?;
    }
    Ok(values)
}

/// `X,Y,Z` in millimetres.
pub fn translation(text: &str) -> Result<Translation, String> {
    numbers(text, "X,Y,Z in millimetres, like 0,0,30").map(|v| Translation(v.map(m_from_mm)))
}

/// The noise of a sensor, greater than 0.
pub fn noise(text: &str) -> Result<f64, String> {
    match number(text)? {
        noise if noise > 0.0 => Ok(noise),
        _ => Err(format!(
            "invalid noise {text}: expected a number greater than 0, like 1e-6"
        )),
    }
}

/// `S` or `X,Y,Z`, positive factors.
pub fn scale(text: &str) -> Result<Scale, String> {
    let expected = "one factor like 2, or X,Y,Z like 1,1,2";
    let factors = if text.contains(',') {
        numbers(text, expected)?
    } else {
        let [factor] = numbers(text, expected)?;
        [factor; 3]
    };
    if factors.iter().all(|factor| *factor > 0.0) {
        Ok(Scale(factors))
    } else {
        Err("factors must be greater than 0".to_owned())
    }
}

/// `X,Y,Z` in degrees.
pub fn rotation(text: &str) -> Result<Rotation, String> {
    numbers(text, "X,Y,Z in degrees, like 0,0,45").map(Rotation)
}

/// `FROM,TO` in millimetres.
pub fn ends(text: &str) -> Result<Ends, String> {
    let [from, to] = numbers(text, "FROM,TO in millimetres, like -50,50")?;
    if from <= to {
        Ok(Ends([from, to].map(m_from_mm)))
    } else {
        Err(format!(
            "runs backwards, from {from} to {to} mm: write the smaller end first"
        ))
    }
}

/// `NxM`: samples along x and y.
pub fn grid_size(text: &str) -> Result<GridSize, String> {
    let sizes: Option<Vec<usize>> = text
        .split(['x', 'X'])
        .map(|part| part.parse().ok().filter(|n| *n > 0))
        .collect();
    match sizes.as_deref() {
        Some([x, y]) => Ok(GridSize([*x, *y])),
        _ => Err("expected NxM, two whole numbers from 1, like 61x61".to_owned()),
    }
}

/// A unit of length; its metres.
pub fn unit(text: &str) -> Result<f64, String> {
    parse_unit(text).ok_or_else(|| "expected mm, cm, m, in, ft or um".to_owned())
}

/// A relative tolerance.
pub fn tolerance(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if TOLERANCE.contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "invalid tolerance {value:e}: expected {:e} to {:e}, the allowed error relative to the \
             field gradient |grad B|, like 1e-9",
            TOLERANCE.start(),
            TOLERANCE.end()
        ))
    }
}

/// A relative error: a part, or per cent with a `%`.
pub fn error(text: &str) -> Result<f64, String> {
    let value = match text.strip_suffix('%') {
        Some(percent) => number(percent)? / 100.0,
        None => number(text)?,
    };
    if ErrorTarget::RANGE.contains(&value) {
        Ok(value)
    } else {
        Err(format!(
            "invalid error {text}: expected a part of the force from {:e} to {}, like 1% or 0.01",
            ErrorTarget::RANGE.start(),
            ErrorTarget::RANGE.end()
        ))
    }
}

/// A weight greater than zero.
pub fn jnd(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value > 0.0 {
        Ok(value)
    } else {
        Err(format!(
            "invalid just-noticeable difference {value}: expected a part of the force greater than \
             0, like 0.07"
        ))
    }
}

/// A force constant, N/m.
pub fn force_constant(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value >= 0.0 {
        Ok(value)
    } else {
        Err(format!(
            "invalid force constant {value}: expected N/m, 0 or more, like 2.0"
        ))
    }
}

/// Two coils, like `0+8`.
pub fn pair(text: &str) -> Result<[usize; 2], String> {
    let coil = |text: &str| text.trim().parse::<usize>().ok();
    let coils = text.split_once('+');
    let found = coils.and_then(|(a, b)| Some([coil(a)?, coil(b)?]));
    found.ok_or_else(|| format!("invalid pair of coils {text:?}: expected two numbers, like 0+8"))
}

/// A length in millimetres, 0 or more; m.
pub fn length(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value >= 0.0 {
        Ok(m_from_mm(value))
    } else {
        Err(format!(
            "invalid distance {value}: expected millimetres, 0 or more"
        ))
    }
}

/// A length, m, of a number with its unit, or of millimetres.
pub fn length_with_unit(text: &str) -> Result<f64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_alphabetic());
    // `1e` of `1em` would be no number; a unit begins after the last digit.
    let name = &text[digits.len()..];
    let metres = if name.is_empty() {
        Some(1e-3)
    } else {
        parse_unit(name)
    };
    match (number(digits), metres) {
        (Ok(value), Some(_)) if value > 0.0 && name.is_empty() => Ok(m_from_mm(value)),
        (Ok(value), Some(metres)) if value > 0.0 => Ok(value * metres),
        _ => Err(format!(
            "invalid length {text:?}: expected a number above 0 and a unit, like 0.1mm"
        )),
    }
}

/// A height, m, of a number with its unit, or of millimetres; of either sign.
pub fn height(text: &str) -> Result<f64, String> {
    let (sign, size) = match text.strip_prefix('-') {
        Some(size) => (-1.0, size),
        None => (1.0, text),
    };
    let digits = size.trim_end_matches(|c: char| c.is_alphabetic());
    match number(digits) {
        Ok(0.0) => Ok(0.0),
        _ => length_with_unit(size).map(|length_m| sign * length_m),
    }
}

/// A direction that points up.
pub fn up(text: &str) -> Result<Up, String> {
    Up::of(text)
        .ok_or_else(|| format!("invalid direction {text:?}: expected x, y, z, -x, -y or -z"))
}

/// `X0,X1,Y0,Y1,Z0,Z1` in millimetres, each smaller end first; m.
pub fn box_of(text: &str) -> Result<[[f64; 2]; 3], String> {
    let expected = "X0,X1,Y0,Y1,Z0,Z1 in millimetres, like -50,50,-50,50,20,70";
    let [a, b, c, d, e, f] = numbers(text, expected)?.map(m_from_mm);
    let ends = [[a, b], [c, d], [e, f]];
    if ends.iter().all(|[from, to]| from < to) {
        Ok(ends)
    } else {
        Err(format!("a side ends before it begins: expected {expected}"))
    }
}

/// A number of threads.
pub fn threads(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(n) if (1..=THREADS_MAX).contains(&n) => Ok(n),
        _ => Err(format!("expected a whole number from 1 to {THREADS_MAX}")),
    }
}

/// Bytes, from a number and a unit: `500MB`, `20GB`, `1.5 TB`.
pub fn memory(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match text[digits.len()..].to_ascii_uppercase().as_str() {
        "B" | "" => 1.0,
        "KB" => 1e3,
        "MB" => 1e6,
        "GB" => 1e9,
        "TB" => 1e12,
        _ => f64::NAN,
    };
    match digits.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && (number * factor).is_finite() => Ok((number * factor) as u64),
        _ => Err("expected a size like 500MB or 20GB".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_taken_in_metres_and_degrees() {
        assert_eq!(
            translation("-7,1.3,30").unwrap(),
            Translation([-0.007, 0.0013, 0.03])
        );
        assert_eq!(
            rotation("0, -12.5,90").unwrap(),
            Rotation([0.0, -12.5, 90.0])
        );
        assert_eq!(ends("-50,13").unwrap(), Ends([-0.05, 0.013]));
        assert_eq!(grid_size("61x7").unwrap(), GridSize([61, 7]));
        assert_eq!(unit("in").unwrap(), 0.0254);
    }

    #[test]
    fn what_is_no_value_is_refused_with_what_was_expected() {
        assert!(translation("1,2").unwrap_err().contains("found 2 values"));
        assert!(
            translation("1,2,nan")
                .unwrap_err()
                .contains("\"nan\" is not a finite number")
        );
        assert!(ends("3,-3").unwrap_err().contains("smaller end first"));
        for bad in ["61", "0x3", "3x-3", "1x2x3", "axb", ""] {
            assert!(grid_size(bad).is_err(), "{bad}");
        }
        for bad in ["0", "-1e-9", "0.5", "1e-16", "inf", "few"] {
            assert!(tolerance(bad).is_err(), "{bad}");
        }
        assert_eq!(tolerance("1e-15").unwrap(), 1e-15);
        assert!(threads("0").is_err() && threads("-1").is_err() && threads("2").is_ok());
        assert!(jnd("0").is_err() && force_constant("-2").is_err() && length("-1").is_err());
        assert!(unit("inches").is_err());
    }
}
