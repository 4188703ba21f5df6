//! American wire gauge.

/// Diameter, mm, of a bare wire named like `AWG 22`, `awg22` or `AWG 2/0`; `None` for any other
/// text.
///
/// d = 0.127 mm x 92^((36 - n) / 39) for gauge n, with n = 0, -1, -2, -3 for 1/0 to 4/0
/// (ASTM B258). Domain: 4/0 to 56. The hyphen of `AWG-22` is no sign; that of `AWG -2` is.
#[must_use]
pub fn awg_mm(text: &str) -> Option<f64> {
    const GAUGES: std::ops::RangeInclusive<i32> = -3..=56;
    let text = text.trim();
    let (name, gauge) = text.split_at_checked(3)?;
    if !name.eq_ignore_ascii_case("awg") {
        return None;
    }
    let gauge = gauge.strip_prefix('-').unwrap_or(gauge).trim();
    let number = match gauge.split_once('/') {
        Some((size, "0")) => {
            let size: u32 = size.parse().ok()?;
            (1..=4).contains(&size).then(|| 1.0 - f64::from(size))?
        }
        Some(_) => return None,
        None if matches!(gauge, "00" | "000" | "0000") => 1.0 - gauge.len() as f64,
        None => {
            let number: i32 = gauge.parse().ok()?;
            GAUGES.contains(&number).then(|| f64::from(number))?
        }
    };
    Some(0.127 * 92.0_f64.powf((36.0 - number) / 39.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tabulated_diameters() {
        // ASTM B258, to a ten-thousandth of an inch or better.
        for (name, inches) in [
            ("AWG 36", 0.005),
            ("awg22", 0.0253),
            ("AWG-10", 0.1019),
            ("AWG 4/0", 0.46),
            (" AWG 0000 ", 0.46),
            ("AWG 0", 0.3249),
            // Was read as 3.
            ("AWG -3", 0.46),
            ("AWG- 10", 0.1019),
        ] {
            let mm = awg_mm(name).expect("a gauge");
            assert!((mm / 25.4 - inches).abs() < 6e-5, "{name}: {mm}");
        }
    }

    #[test]
    fn other_texts_are_none() {
        for text in [
            "", "AW", "AWG", "AWG 22.5", "AWG 5/0", "AWG 1/2", "22", "SWG 22", "AWG 57", "AWG -4",
            "AWG - 3", "drähte",
        ] {
            assert_eq!(awg_mm(text), None, "{text}");
        }
    }
}
