//! What a STEP file's text says of units and bodies, read apart from the geometry's reader.

use std::collections::HashMap;

/// Statements about units and bodies.
pub(super) struct Statements {
    /// Statements about units by their number, without blanks, in capitals.
    units: HashMap<u64, String>,
    /// Solid bodies.
    pub(super) solids: usize,
    /// Bodies of facets, and surfaces that are no bodies.
    pub(super) others: usize,
    /// True where bodies are placed in others.
    pub(super) placed: bool,
    /// True where the geometry holds angles.
    angles: bool,
}

impl Statements {
    pub(super) fn of(text: &str) -> Self {
        let mut found = Self {
            units: HashMap::new(),
            solids: 0,
            others: 0,
            placed: false,
            angles: false,
        };
        let text = without_comments(text);
        let mut quoted = false;
        for statement in text.split(|c: char| {
            quoted ^= c == '\'';
            c == ';' && !quoted
        }) {
            let Some((id, body)) = statement.split_once('=') else {
                continue;
            };
            let id = id.trim().strip_prefix('#').and_then(|id| id.parse().ok());
            let Some(id) = id else { continue };
            let body: String = body.split_whitespace().collect();
            let body = body.to_ascii_uppercase();
            let is = |name: &str| body.starts_with(name);
            found.solids += usize::from(
                is("MANIFOLD_SOLID_BREP(")
                    || is("BREP_WITH_VOIDS(")
                    || body.contains(")BREP_WITH_VOIDS("),
            );
            found.others += usize::from(
                is("FACETED_BREP(")
                    || body.contains(")FACETED_BREP(")
                    || is("SHELL_BASED_SURFACE_MODEL(")
                    || is("FACE_BASED_SURFACE_MODEL("),
            );
            found.placed |= is("NEXT_ASSEMBLY_USAGE_OCCURRENCE(") || is("MAPPED_ITEM(");
            found.angles |= is("CONICAL_SURFACE(") || is("TRIMMED_CURVE(");
            if body.contains("UNIT") {
                found.units.insert(id, body);
            }
        }
        found
    }

    /// Metres of the one unit of length in which all shapes are given.
    pub(super) fn unit_m(&self) -> Result<f64, String> {
        let mut units: Vec<f64> = Vec::new();
        for body in self.units.values() {
            let Some((_, list)) = body.split_once("GLOBAL_UNIT_ASSIGNED_CONTEXT((") else {
                continue;
            };
            let list = list.split(')').next().unwrap_or_default();
            for id in list.split(',').filter_map(reference) {
                let unit = self.units.get(&id).map_or("", String::as_str);
                if unit.contains("LENGTH_UNIT") {
                    units.push(self.length_m(id, 0)?);
                }
                let degrees =
                    unit.contains("PLANE_ANGLE_UNIT") && unit.contains("CONVERSION_BASED");
                if degrees && self.angles {
                    return Err("its angles are in degrees, which are not read".into());
                }
            }
        }
        match units.as_slice() {
            [] => Err("it states no unit of length".into()),
            [first, rest @ ..] if rest.iter().all(|unit| unit == first) => Ok(*first),
            _ => Err("its shapes are in several units of length".into()),
        }
    }

    fn length_m(&self, id: u64, depth: usize) -> Result<f64, String> {
        let unknown = || "its unit of length is unknown".to_owned();
        let body = self
            .units
            .get(&id)
            .filter(|_| depth < 4)
            .ok_or_else(unknown)?;
        if let Some((_, conversion)) = body.split_once("CONVERSION_BASED_UNIT(") {
            let measure = conversion.split(',').nth(1).and_then(reference);
            let measure = measure
                .and_then(|id| self.units.get(&id))
                .ok_or_else(unknown)?;
            // Some write the number alone, some `LENGTH_MEASURE(25.4)`.
            let (_, told) = measure
                .rsplit_once("MEASURE_WITH_UNIT(")
                .ok_or_else(unknown)?;
            let (value, unit) = told.split_once(',').ok_or_else(unknown)?;
            let value = value.rsplit('(').next().unwrap_or(value);
            let value: f64 = value.trim_end_matches(')').parse().map_err(|_| unknown())?;
            let unit = reference(unit).ok_or_else(unknown)?;
            let unit_m = value * self.length_m(unit, depth + 1)?;
            // Exporters write 25.4 with the digits of its double, and more.
            let usual = [0.0254, 0.3048, 0.001, 0.01, 1.0];
            let near = usual.into_iter().find(|m| (m - unit_m).abs() < 1e-9 * m);
            return Ok(near.unwrap_or(unit_m));
        }
        let (_, unit) = body.split_once("SI_UNIT(").ok_or_else(unknown)?;
        match unit.split(')').next() {
            Some("$,.METRE.") => Ok(1.0),
            Some(".MILLI.,.METRE.") => Ok(1e-3),
            Some(".CENTI.,.METRE.") => Ok(1e-2),
            Some(".MICRO.,.METRE.") => Ok(1e-6),
            _ => Err(unknown()),
        }
    }
}

/// The text but for comments, in which quotes mean nothing.
fn without_comments(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let (mut rest, mut quoted) = (text, false);
    while let Some(at) = rest.find(['\'', '/']) {
        let (before, after) = rest.split_at(at);
        kept.push_str(before);
        if !quoted && after.starts_with("/*") {
            rest = after[2..].split_once("*/").map_or("", |(_, after)| after);
            continue;
        }
        quoted ^= after.starts_with('\'');
        kept.push_str(&after[..1]);
        rest = &after[1..];
    }
    kept.push_str(rest);
    kept
}

/// The number after `#` in `#123`, whatever brackets follow.
fn reference(text: &str) -> Option<u64> {
    let digits = text.strip_prefix('#')?;
    let end = digits.find(|c: char| !c.is_ascii_digit());
    digits[..end.unwrap_or(digits.len())].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::Statements;

    fn unit_m(length: &str, angle: &str, more: &str) -> Result<f64, String> {
        Statements::of(&format!(
            "ISO-10303-21;\n#1 = ( GLOBAL_UNIT_ASSIGNED_CONTEXT ( ( #2, #3 ) ) X('a;b','') );\n\
             #2 = {length};\n#3 = {angle};\n#5 = LENGTH_MEASURE_WITH_UNIT ( LENGTH_MEASURE ( \
             0.025399999999999999 ), #6 );\n#6 = ( LENGTH_UNIT ( ) SI_UNIT ( $, .METRE. ) );\n{more}"
        ))
        .unit_m()
    }

    #[test]
    fn units_of_length_are_followed() {
        let radian = "( PLANE_ANGLE_UNIT ( ) SI_UNIT ( $, .RADIAN. ) )";
        let inch = "( CONVERSION_BASED_UNIT ( 'INCH', #5 ) LENGTH_UNIT ( ) )";
        let mm = "( LENGTH_UNIT ( ) NAMED_UNIT ( * ) SI_UNIT ( .MILLI., .METRE. ) )";
        assert_eq!(unit_m(inch, radian, ""), Ok(0.0254));
        assert_eq!(unit_m(mm, radian, ""), Ok(0.001));
        assert!(unit_m(radian, radian, "").unwrap_err().contains("no unit"));
        let degree = "( CONVERSION_BASED_UNIT ( 'DEGREE', #9 ) PLANE_ANGLE_UNIT ( ) )";
        assert_eq!(unit_m(mm, degree, ""), Ok(0.001));
        let cone = "#8 = CONICAL_SURFACE ( '', #1, 1., 45. );";
        assert!(unit_m(mm, degree, cone).unwrap_err().contains("degrees"));
        // As OpenCASCADE writes an inch.
        let bare = "( CONVERSION_BASED_UNIT ( 'INCH', #11 ) LENGTH_UNIT ( ) )";
        let value = "#11 = LENGTH_MEASURE_WITH_UNIT(25.4,#12);\n\
                     #12 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );";
        assert_eq!(unit_m(bare, radian, value), Ok(0.0254));
        let parts = "#11 = ( LENGTH_MEASURE_WITH_UNIT() MEASURE_WITH_UNIT( \
                     LENGTH_MEASURE(25.4),#12) );\n\
                     #12 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );";
        assert_eq!(unit_m(bare, radian, parts), Ok(0.0254));
        let second = "#10 = ( GLOBAL_UNIT_ASSIGNED_CONTEXT ( ( #6 ) ) );";
        assert!(unit_m(mm, radian, second).unwrap_err().contains("several"));
    }

    #[test]
    fn an_apostrophe_in_a_comment_opens_no_text() {
        let mm = "( LENGTH_UNIT ( ) NAMED_UNIT ( * ) SI_UNIT ( .MILLI., .METRE. ) )";
        let radian = "( PLANE_ANGLE_UNIT ( ) SI_UNIT ( $, .RADIAN. ) ) /* it's one; */";
        assert_eq!(
            unit_m(mm, radian, "/* Bob's */ #7 = X('/* no comment');"),
            Ok(0.001)
        );
        assert_eq!(super::without_comments("a'/*'b/*c'd*/e/f"), "a'/*'be/f");
    }
}
