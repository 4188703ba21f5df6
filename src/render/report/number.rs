//! Numbers for people: few digits, units with the prefix that suits.

const PREFIXES: [(i32, &str); 8] = [
    (-12, "p"),
    (-9, "n"),
    (-6, "u"),
    (-3, "m"),
    (0, ""),
    (3, "k"),
    (6, "M"),
    (9, "G"),
];

/// The prefix for a number of this power of ten, in ASCII, and its own.
#[must_use]
pub fn prefix_of(exponent: i32) -> (i32, &'static str) {
    PREFIXES
        .into_iter()
        .rev()
        .find(|(power, _)| *power <= exponent)
        .unwrap_or(PREFIXES[0])
}

/// `value` rounded to `digits` significant digits, without zeros at its end; what is not finite as a dash.
#[must_use]
pub fn figures(value: f64, digits: usize) -> String {
    if value.is_finite() {
        plain(value, digits)
    } else {
        "\u{2013}".to_owned()
    }
}

/// The same of any value, in ASCII.
#[must_use]
pub fn plain(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    // Through the decimal digits: they show the exponent after rounding.
    let rounded = format!("{:.*e}", digits.max(1) - 1, value);
    let (mantissa, exponent) = rounded.split_once('e').unwrap_or((&rounded, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    if !(-4..digits.max(6) as i32).contains(&exponent) {
        return format!("{}e{exponent}", trimmed(mantissa));
    }
    let decimals = usize::try_from(digits as i32 - 1 - exponent).unwrap_or(0);
    trimmed(&format!("{value:.decimals$}")).to_owned()
}

fn trimmed(text: &str) -> &str {
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        text
    }
}

/// `value` in `unit` with the prefix that suits it, four digits.
#[must_use]
pub fn si(value: f64, unit: &str) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{} {unit}", figures(value, 4));
    }
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    let exponent = rounded.abs().log10().floor() as i32;
    // Thousandths of a kilogram are grams.
    let (unit, shift) = if unit == "kg" { ("g", 3) } else { (unit, 0) };
    let (power, prefix) = prefix_of(exponent + shift);
    let prefix = if prefix == "u" { "\u{b5}" } else { prefix };
    let scaled = value * 10f64.powi(shift - power);
    format!("{} {prefix}{unit}", figures(scaled, 4))
}

/// A force, in mN below one newton.
#[must_use]
pub fn force(force_n: f64) -> String {
    if force_n.abs() < 1.0 {
        format!("{} mN", figures(force_n * 1e3, 4))
    } else {
        format!("{} N", figures(force_n, 4))
    }
}

/// A part of a whole.
#[must_use]
pub fn percent(part: f64) -> String {
    if part != 0.0 && part.abs() < 1e-5 {
        figures(part, 2)
    } else {
        format!("{} %", figures(part * 100.0, 3))
    }
}

/// A length, in mm; what no machine makes is none.
#[must_use]
pub fn mm(length_m: f64) -> String {
    if length_m.abs() < 1e-9 {
        return "0".to_owned();
    }
    figures(length_m * 1e3, 4)
}

/// `count` of a thing.
#[must_use]
pub fn count(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

/// A force constant, or that there is none.
#[must_use]
pub fn lambda(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |l| format!("{} N/m", figures(l, 5)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_digits_and_the_unit_that_suits() {
        assert_eq!(figures(1.447_149, 4), "1.447");
        assert_eq!(figures(9.99996, 4), "10");
        assert_eq!(figures(-8.283_5e-15, 2), "-8.3e-15");
        assert_eq!(figures(123_456.7, 4), "123457");
        assert_eq!(figures(f64::NAN, 4), "\u{2013}");
        assert_eq!(si(0.151_51, "s"), "151.5 ms");
        assert_eq!(si(0.0137, "kg"), "13.7 g");
        assert_eq!(si(1.37, "kg"), "1.37 kg");
        assert_eq!(si(-2.5e-9, "m"), "-2.5 nm");
        assert_eq!(force(0.0135874), "13.59 mN");
        assert_eq!(percent(0.164_94), "16.5 %");
        assert_eq!(percent(1.24e-7), "1.2e-7");
        // Beside shares of a per cent in one column it was 0.00026.
        assert_eq!(percent(2.6e-4), "0.026 %");
        assert_eq!(lambda(None), "none");
    }
}
