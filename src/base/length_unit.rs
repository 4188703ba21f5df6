//! The units of length.

/// Units of length and their metres; the first spelling is the one messages show.
const UNITS: [(&[&str], f64); 6] = [
    (&["mm", "millimetre", "millimeter"], 1e-3),
    (&["cm", "centimetre", "centimeter"], 1e-2),
    (&["m", "metre", "meter"], 1.0),
    (&["in", "inch"], 0.0254),
    (&["ft", "foot"], 0.3048),
    (&["um", "\u{b5}m", "\u{3bc}m", "micron"], 1e-6),
];

/// The units, for a message.
#[must_use]
pub fn unit_names() -> Vec<&'static str> {
    UNITS.iter().map(|(names, _)| names[0]).collect()
}

/// The name of the unit of `unit_m` metres, for a message; the metres where it has none.
#[must_use]
pub fn unit_name(unit_m: f64) -> String {
    let known = UNITS.iter().find(|(_, metres)| *metres == unit_m);
    known.map_or_else(|| format!("{unit_m:e} m"), |(names, _)| names[0].to_owned())
}

/// Metres in the unit `text` (`mm`, `cm`, `m`, `in` or `inch`, `ft`, `um`); `None` if unknown.
#[must_use]
pub fn parse_unit(text: &str) -> Option<f64> {
    let unit = UNITS.iter().find(|(names, _)| names.contains(&text))?;
    Some(unit.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_what_it_says() {
        let expected = [
            ("mm", 0.001),
            ("cm", 0.01),
            ("m", 1.0),
            ("in", 0.0254),
            ("inch", 0.0254),
        ];
        for (unit, metres) in expected.into_iter().chain([("ft", 0.3048), ("um", 1e-6)]) {
            assert_eq!(parse_unit(unit), Some(metres), "{unit}");
        }
        for unit in ["", "MM", "Mm", "thou", "1mm", "mm "] {
            assert_eq!(parse_unit(unit), None, "{unit:?}");
        }
    }
}
