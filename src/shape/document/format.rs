//! The surface formats by their file's ending, and the units of length.

use std::path::Path;

/// What kind of file a surface is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SurfaceFormat {
    /// STL, binary or ASCII; carries no unit.
    Stl,
    /// Wavefront OBJ; carries no unit.
    Obj,
    /// PLY; carries no unit.
    Ply,
    /// 3MF; carries its unit.
    ThreeMf,
    /// AMF; carries its unit.
    Amf,
    /// Dassault's 3DXML; always in millimetres.
    ThreeDxml,
    /// STEP; carries its unit.
    Step,
    /// A SOLIDWORKS part or assembly; carries its unit.
    Sldprt,
}

/// File endings, lower case.
const ENDINGS: [(&str, SurfaceFormat); 10] = [
    ("stl", SurfaceFormat::Stl),
    ("obj", SurfaceFormat::Obj),
    ("ply", SurfaceFormat::Ply),
    ("3mf", SurfaceFormat::ThreeMf),
    ("amf", SurfaceFormat::Amf),
    ("3dxml", SurfaceFormat::ThreeDxml),
    ("step", SurfaceFormat::Step),
    ("stp", SurfaceFormat::Step),
    ("sldprt", SurfaceFormat::Sldprt),
    ("sldasm", SurfaceFormat::Sldprt),
];

impl SurfaceFormat {
    /// The format of `path` by its ending, in upper or lower case; `None` for any other.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        let known = ENDINGS.iter().find(|(name, _)| *name == ending)?;
        Some(known.1)
    }

    /// Its usual name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Stl => "STL",
            Self::Obj => "OBJ",
            Self::Ply => "PLY",
            Self::ThreeMf => "3MF",
            Self::Amf => "AMF",
            Self::ThreeDxml => "3DXML",
            Self::Step => "STEP",
            Self::Sldprt => "SLDPRT",
        }
    }

    /// True where the file itself says what its unit is.
    #[must_use]
    pub fn carries_unit(self) -> bool {
        !matches!(self, Self::Stl | Self::Obj | Self::Ply)
    }

    /// The endings that are read, for a message.
    #[must_use]
    pub fn endings() -> String {
        ENDINGS.map(|(name, _)| format!(".{name}")).join(", ")
    }
}

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
pub(super) fn unit_names() -> Vec<&'static str> {
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

    #[test]
    fn endings_tell_the_format_in_any_case() {
        let of = |name: &str| SurfaceFormat::of(Path::new(name));
        assert_eq!(of("a.b/part.STL"), Some(SurfaceFormat::Stl));
        assert_eq!(of("part.stp"), Some(SurfaceFormat::Step));
        assert_eq!(of("part.SldPrt"), Some(SurfaceFormat::Sldprt));
        assert_eq!(of("part.dae"), None);
        assert_eq!(of(".stl"), None);
    }
}
