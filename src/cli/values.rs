//! Argument values, validated where they are read.

use std::path::{Path, PathBuf};

use clap::builder::{
    PathBufValueParser, PossibleValue, PossibleValuesParser, TypedValueParser, ValueParser,
    ValueParserFactory,
};

use crate::bundle::atomic;
use crate::choice::Choice;
use crate::lambda::Jnd;
use crate::plot::drawing::DrawingFormat;
use crate::scene::tolerances::ErrorTarget;
use crate::shape::document::{parse_unit, unit_names};
use crate::uncertainty::Uncertainty;
use crate::units::m_from_mm;

/// Any variant of `T` by its name; the help states what it means.
pub fn named<T>() -> impl TypedValueParser<Value = T>
where
    T: Choice<Err: std::error::Error + Send + Sync + 'static>,
{
    PossibleValuesParser::new(possible::<T>()).try_map(|name| name.parse::<T>())
}

/// The same for a value that is of one of two enums.
pub fn either<A, B, T>() -> impl TypedValueParser<Value = T>
where
    A: Choice,
    B: Choice<Err: std::error::Error + Send + Sync + 'static>,
    T: From<A> + From<B> + Clone + Send + Sync + 'static,
{
    let names = PossibleValuesParser::new(possible::<A>().chain(possible::<B>()));
    names.try_map(|name| match name.parse::<A>() {
        Ok(one) => Ok(T::from(one)),
        Err(_) => name.parse::<B>().map(T::from),
    })
}

/// The names of an enum with their meanings.
fn possible<T: Choice>() -> impl Iterator<Item = PossibleValue> {
    T::VARIANTS.iter().map(|one| {
        let name: &'static str = (*one).into();
        PossibleValue::new(name).help(one.get_documentation().unwrap_or_default())
    })
}

/// Most threads that may be asked for.
const THREADS_MAX: usize = 1024;
/// Tolerances that make sense, relative.
pub const TOLERANCE: std::ops::RangeInclusive<f64> = 1e-15..=1e-1;

/// A file, or `-` for standard input or output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FileArgument {
    /// `-`.
    Standard,
    /// Anything else.
    Path(PathBuf),
}

impl From<PathBuf> for FileArgument {
    fn from(path: PathBuf) -> Self {
        if path == Path::new("-") {
            Self::Standard
        } else {
            Self::Path(path)
        }
    }
}

/// Refuses an empty path, which an unset variable of a script leaves.
impl ValueParserFactory for FileArgument {
    type Parser = ValueParser;

    fn value_parser() -> Self::Parser {
        PathBufValueParser::new().map(Self::from).into()
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

/// A drawing's file: SVG, PNG or PDF by its ending, or `-` for SVG on standard output.
pub fn picture(text: &str) -> Result<FileArgument, String> {
    let file = FileArgument::from(PathBuf::from(text));
    let path = file.as_given();
    let ending = path.extension().and_then(|ending| ending.to_str());
    let known = ending.is_some_and(|ending| DrawingFormat::of(ending).is_some());
    if file.is_standard() || known || atomic::is_stream(path) {
        return Ok(file);
    }
    // An unset variable of a script leaves an empty path.
    let like = match path.file_name() {
        Some(_) => path.with_extension("svg"),
        None => PathBuf::from("plot.svg"),
    };
    let endings = DrawingFormat::ALL.map(|(ending, _)| format!(".{ending}"));
    Err(format!(
        "the ending decides how it is drawn: expected one of {}, like {}",
        endings.join(", "),
        like.display()
    ))
}

/// Samples along x and y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GridSize(pub [usize; 2]);

/// Lengths along x, y and z, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Translation(pub [f64; 3]);

/// Three factors, greater than 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale(pub [f64; 3]);

/// Three angles, degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation(pub [f64; 3]);

/// Two ends, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ends(pub [f64; 2]);

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

fn numbers<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    several(text, expected, number)
}

/// `N` values between commas, each as `one` reads it.
fn several<const N: usize>(
    text: &str,
    expected: &str,
    one: fn(&str) -> Result<f64, String>,
) -> Result<[f64; N], String> {
    let parts: Vec<&str> = text.split(',').collect();
    if parts.len() != N {
        return Err(format!("expected {expected}, found {} values", parts.len()));
    }
    let mut values = [0.0; N];
    for (value, part) in values.iter_mut().zip(parts) {
        *value = one(part).map_err(|fault| format!("expected {expected}: {fault}"))?;
    }
    Ok(values)
}

/// A length of either sign, m: a number with its unit, or of millimetres.
fn metres(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_alphabetic() || c == '\u{b5}');
    let name = &text[digits.len()..];
    let value = number(digits.trim_end()).map_err(|_| {
        format!("invalid length {text:?}: expected a number, in millimetres or with its unit (2cm)")
    })?;
    match name {
        "" | "mm" => Ok(m_from_mm(value)),
        name => parse_unit(name)
            .map(|unit_m| value * unit_m)
            .ok_or_else(|| {
                format!(
                    "invalid length {text:?}: the unit is one of {}",
                    unit_names().join(", ")
                )
            }),
    }
}

/// `N` lengths, m.
fn lengths<const N: usize>(text: &str, expected: &str) -> Result<[f64; N], String> {
    several(text, expected, metres)
}

/// `X,Y,Z`, in millimetres or with units.
pub fn translation(text: &str) -> Result<Translation, String> {
    lengths(
        text,
        "X,Y,Z in millimetres or with units, like 0,0,30 or 0,0,3cm",
    )
    .map(Translation)
}

/// The noise of a sensor, whose square and inverse square are numbers.
pub fn noise(text: &str) -> Result<f64, String> {
    let noise = number(text)?;
    if (1e-30..=1e30).contains(&noise) {
        return Ok(noise);
    }
    Err(format!(
        "invalid noise {text}: expected a number from 1e-30 to 1e30, like 1e-6"
    ))
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
    if factors.iter().all(|factor| (1e-12..=1e12).contains(factor)) {
        Ok(Scale(factors))
    } else {
        Err("factors must lie between 1e-12 and 1e12".to_owned())
    }
}

/// `X,Y,Z` in degrees.
pub fn rotation(text: &str) -> Result<Rotation, String> {
    numbers(text, "X,Y,Z in degrees, like 0,0,45").map(Rotation)
}

/// `FROM,TO`, in millimetres or with units.
pub fn ends(text: &str) -> Result<Ends, String> {
    const FARTHEST_M: f64 = 1e3;
    let [from, to] = lengths(text, "FROM,TO in millimetres or with units, like -50,50")?;
    if from.abs().max(to.abs()) > FARTHEST_M {
        Err(format!("is farther from the origin than {FARTHEST_M} m"))
    } else if from <= to {
        Ok(Ends([from, to]))
    } else {
        Err(format!(
            "runs backwards, from {} to {} mm: write the smaller end first",
            1e3 * from,
            1e3 * to
        ))
    }
}

/// Two distances of fingers, m, the smaller one first and above 0.
pub fn distances(text: &str) -> Result<Ends, String> {
    match ends(text)? {
        Ends([from, _]) if from <= 0.0 => {
            Err("two fingers cannot be in the same place: write distances above 0".to_owned())
        }
        ends => Ok(ends),
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

/// A part, or per cent with a `%`.
fn part(text: &str) -> Result<f64, String> {
    match text.trim().strip_suffix('%') {
        Some(percent) => Ok(number(percent)? / 100.0),
        None => number(text),
    }
}

/// A relative error: a part, or per cent with a `%`.
pub fn error(text: &str) -> Result<f64, String> {
    let value = part(text)?;
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

/// A just-noticeable difference: a part of the force, greater than zero.
pub fn jnd(text: &str) -> Result<f64, String> {
    let value = part(text)?;
    if value > 0.0 && value <= 1.0 {
        Ok(value)
    } else {
        Err(format!(
            "invalid just-noticeable difference {value}: expected a part of the force above 0, at most \
             1, like 7% or 0.07"
        ))
    }
}

/// The same, or `by-force`.
pub fn jnd_or_by_force(text: &str) -> Result<Jnd, String> {
    if text == Jnd::BY_FORCE {
        return Ok(Jnd::ByForce);
    }
    let or = |wrong: String| format!("{wrong}, or {}", Jnd::BY_FORCE);
    jnd(text).map(Jnd::Part).map_err(or)
}

/// The largest force constant, N/m: a kilonewton at a millimetre of height, which no finger bears. Squares of
/// forces beyond double precision are far above it.
const LARGEST_CONSTANT_N_PER_M: f64 = 1e6;

/// A force constant, N/m.
pub fn force_constant(text: &str) -> Result<f64, String> {
    let value = number(text)?;
    if value > 0.0 && value <= LARGEST_CONSTANT_N_PER_M {
        Ok(value)
    } else {
        Err(format!(
            "invalid force constant {value:?}: expected above 0, at most {LARGEST_CONSTANT_N_PER_M} N/m (1 kN at a height of \
             1 mm), like 2.0"
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

/// A distance, m, 0 or more: a number with its unit, or of millimetres.
pub fn length(text: &str) -> Result<f64, String> {
    match metres(text)? {
        length_m if length_m >= 0.0 => Ok(length_m),
        _ => Err(format!(
            "invalid distance {text}: expected 0 or more, in millimetres or with its unit (2cm)"
        )),
    }
}

/// A length above 0, m: a number with its unit, or of millimetres.
pub fn length_with_unit(text: &str) -> Result<f64, String> {
    match metres(text)? {
        length_m if length_m > 0.0 => Ok(length_m),
        _ => Err(format!(
            "invalid length {text:?}: expected a number above 0 and a unit, like 0.1mm"
        )),
    }
}

/// A bound of an uncertainty, 0 to `most`: a number, with one of `units` or without.
fn bound(text: &str, units: &[&str], most: f64, example: &str) -> Result<f64, String> {
    let trimmed = text.trim();
    let bare = units.iter().find_map(|unit| trimmed.strip_suffix(unit));
    match number(bare.unwrap_or(trimmed)) {
        Ok(value) if (0.0..=most).contains(&value) => Ok(value),
        _ => Err(format!(
            "invalid bound {text:?}: expected 0 to {most}{}, like {example}",
            units.first().unwrap_or(&"")
        )),
    }
}

/// How far a position may be off, m.
pub fn sensor_error(text: &str) -> Result<f64, String> {
    let length_m = length(text)?;
    let most_m = Uncertainty::MOST.sensor_m;
    if length_m <= most_m {
        return Ok(length_m);
    }
    Err(format!(
        "invalid bound {text:?}: expected 0 to {} mm, like 4mm",
        1e3 * most_m
    ))
}

/// How far a magnet may be tilted, degrees.
pub fn tilt(text: &str) -> Result<f64, String> {
    bound(
        text,
        &["deg", "\u{b0}"],
        Uncertainty::MOST.tilt_deg,
        "10deg",
    )
}

/// An angle that is just noticed, degrees.
pub fn direction_jnd(text: &str) -> Result<f64, String> {
    match tilt(text) {
        Ok(angle) if (1.0..=89.0).contains(&angle) => Ok(angle),
        _ => Err(format!(
            "invalid angle {text:?}: expected 1 to 89deg, like 25deg"
        )),
    }
}

/// How much warmer a magnet may become, C.
pub fn heat(text: &str) -> Result<f64, String> {
    bound(text, &["C", "K"], Uncertainty::MOST.heat_c, "20C")
}

/// How far a current may be off, a share.
pub fn driver_error(text: &str) -> Result<f64, String> {
    let most = Uncertainty::MOST.driver;
    match text.trim().strip_suffix('%') {
        Some(percent) => bound(percent, &[], 100.0 * most, "2%").map(|value| value / 100.0),
        None => bound(text, &[], most, "0.02 or 2%"),
    }
}

/// Power above 0, W.
pub fn power(text: &str) -> Result<f64, String> {
    let bare = text.trim().trim_end_matches('W');
    match number(bare) {
        Ok(value) if value > 0.0 => Ok(value),
        _ => Err(format!(
            "invalid power {text:?}: expected watts above 0, like 80 or 80W"
        )),
    }
}

/// A height of either sign, m: a number with its unit, or of millimetres.
pub fn height(text: &str) -> Result<f64, String> {
    metres(text)
}

/// `X0,X1,Y0,Y1,Z0,Z1`, in millimetres or with units, each smaller end first; m.
pub fn box_of(text: &str) -> Result<[[f64; 2]; 3], String> {
    let expected = "X0,X1,Y0,Y1,Z0,Z1 in millimetres or with units, like -50,50,-50,50,20,7cm";
    let [a, b, c, d, e, f] = lengths(text, expected)?;
    let ends = [[a, b], [c, d], [e, f]];
    if ends.iter().all(|[from, to]| from < to) {
        Ok(ends)
    } else {
        Err(format!("a side ends before it begins: expected {expected}"))
    }
}

/// `KEY=VALUE`: a dotted key and its value, a number, list or truth value as in TOML, or a text.
pub fn setting(text: &str) -> Result<(String, toml::Value), String> {
    let Some((key, value)) = text
        .split_once('=')
        .map(|(key, value)| (key.trim(), value.trim()))
        .filter(|(key, _)| !key.is_empty())
    else {
        return Err("expected KEY=VALUE, like array.pitch_mm=40".to_owned());
    };
    let document: Result<toml::Table, _> = format!("value = {value}").parse();
    let value = match (value.parse(), document) {
        (Ok(value), _) => value,
        // A comment, or another key on another line.
        (Err(_), Ok(_)) => {
            return Err(format!(
                "{key} has more behind its value in {value:?}: give one value, another --set for another key, \
                 and quotes around a text that contains #"
            ));
        }
        (Err(_), Err(_)) => toml::Value::String(value.to_owned()),
    };
    Ok((key.to_owned(), value))
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

    /// `--reach 2cm` was refused where `--shell 14` was taken as millimetres.
    #[test]
    fn every_length_takes_a_unit_and_a_bare_number_is_millimetres() {
        for parse in [length, length_with_unit, height] {
            assert_eq!(parse("14").unwrap(), 0.014);
            assert_eq!(parse("14mm").unwrap(), 0.014);
            assert_eq!(parse("2cm").unwrap(), 0.02);
            assert_eq!(parse(" 0.5 in").unwrap(), 0.0127);
            assert!(
                parse("2 furlongs")
                    .unwrap_err()
                    .contains("mm, cm, m, in, ft, um")
            );
            assert!(parse("far").unwrap_err().contains("invalid length"));
        }
        assert_eq!(height("-2cm").unwrap(), -0.02);
        assert!(length("-2cm").is_err() && length_with_unit("0mm").is_err());
        let moved = translation("0,-1cm,0.03m").unwrap();
        assert_eq!(moved, Translation([0.0, -0.01, 0.03]));
        assert_eq!(ends("-5cm,50").unwrap(), Ends([-0.05, 0.05]));
        assert_eq!(box_of("-1,1,-1,1,0,3cm").unwrap()[2], [0.0, 0.03]);
    }

    /// `array.rows=4#x` set 4, and so did a second line with another key.
    #[test]
    fn regression_what_followed_a_value_was_dropped() {
        let value = |text: &str| setting(&format!(" array.rows = {text}")).unwrap().1;
        assert_eq!(value("4").as_integer(), Some(4));
        assert_eq!(value("[1, # one\n 2]").as_array().unwrap().len(), 2);
        assert_eq!(value("{ a = 1.3 }")["a"].as_float(), Some(1.3));
        for text in ["repel", "4,7", "a#b", "\"a # b\"", ""] {
            assert_eq!(value(text).as_str(), Some(text.trim_matches('"')));
        }
        for more in ["4#x", "4 # x", "4\ncolumns=7", "\"a\"#b", "4\n[wire]\nx=1"] {
            let refused = setting(&format!("array.rows={more}")).unwrap_err();
            assert!(refused.contains("array.rows has more behind"), "{refused}");
        }
    }

    #[test]
    fn what_is_no_value_is_refused_with_what_was_expected() {
        assert!(translation("1,2").unwrap_err().contains("found 2 values"));
        assert!(
            translation("1,2,nan")
                .unwrap_err()
                .contains("invalid length")
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
        assert!(jnd("0").is_err() && length("-1").is_err());
        assert!(force_constant("-2").is_err() && force_constant("0").is_err());
        assert!(unit("inches").is_err());
    }
}
