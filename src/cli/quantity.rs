//! Numbers for people: nice units, few digits.

use std::fmt::Display;

use crate::digits::with_error;
use crate::report::number::{plain, prefix_of};

/// Significant digits on screen.
const DIGITS: i32 = 5;

/// `value` rounded to `digits` significant digits, without trailing zeros.
#[must_use]
pub fn number_to(value: f64, digits: i32) -> String {
    plain(value, digits.max(1) as usize)
}

/// `x 0 to 20, y -5 to 5, z 0 to 3`: a box's ends. What rounding left of a zero, a billionth of the
/// box's largest coordinate or less, is one.
pub fn extents(min: [f64; 3], max: [f64; 3]) -> String {
    let largest = (min.iter().chain(&max)).fold(0.0, |m: f64, c| m.max(c.abs()));
    let end = |c: f64| number(if c.abs() <= 1e-9 * largest { 0.0 } else { c });
    let axis = |(k, name)| format!("{name} {} to {}", end(min[k]), end(max[k]));
    let axes: Vec<String> = ["x", "y", "z"].into_iter().enumerate().map(axis).collect();
    axes.join(", ")
}

/// `value` with five significant digits.
#[must_use]
pub fn number(value: f64) -> String {
    number_to(value, DIGITS)
}

/// `value` in `unit` with the prefix that suits it: 0.0145019 H is `14.502 mH`.
#[must_use]
pub fn si(value: f64, unit: &str) -> String {
    si_to(value, unit, DIGITS)
}

/// The same in the digits that a relative error leaves, with that error: `93 +- 6 ms`.
#[must_use]
pub fn si_with_error(value: f64, relative: f64, unit: &str) -> String {
    let known = relative > 0.0 && relative.is_finite();
    if !known || value == 0.0 || !value.is_finite() {
        return si(value, unit);
    }
    let exponent = value.abs().log10().floor() as i32;
    let (power, prefix) = prefix_of(exponent);
    let scaled = value / 10f64.powi(power);
    format!(
        "{} {prefix}{unit}",
        with_error(scaled, relative * scaled.abs())
    )
}

/// The same with so many significant digits.
#[must_use]
pub fn si_to(value: f64, unit: &str, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value} {unit}");
    }
    let rounded: f64 = format!("{:.*e}", (digits - 1) as usize, value)
        .parse()
        .unwrap_or(value);
    let exponent = rounded.abs().log10().floor() as i32;
    let (power, prefix) = prefix_of(exponent);
    format!(
        "{} {prefix}{unit}",
        number_to(value / 10f64.powi(power), digits)
    )
}

/// A force: millinewtons below one newton.
#[must_use]
pub fn force(force_n: f64) -> String {
    if force_n.abs() < 1.0 {
        format!("{} mN", number(force_n * 1000.0))
    } else {
        format!("{} N", number(force_n))
    }
}

/// Lengths' errors below this are rounding of doubles, m.
const ROUNDING_M: f64 = 1e-12;

/// A length's error: one or two digits.
#[must_use]
pub fn length_error(error_m: f64) -> String {
    if error_m < ROUNDING_M {
        return "below 1 pm".to_owned();
    }
    si_to(error_m, "m", 2)
}

/// A length in millimetres.
#[must_use]
pub fn mm(length_m: f64) -> String {
    format!("{} mm", number(length_m * 1000.0))
}

/// A mass, grams below one kilogram.
#[must_use]
pub fn mass(mass_kg: f64) -> String {
    si(mass_kg * 1000.0, "g")
}

/// A part of one in percent; what rounding leaves of nothing is none.
#[must_use]
pub fn percent(part: f64) -> String {
    let part = if part.abs() < 1e-14 { 0.0 } else { part };
    format!("{} %", number_to(part * 100.0, 3))
}

/// An angle between forces, without its unit; what rounding leaves of nothing is none.
#[must_use]
pub fn degrees(angle_deg: f64) -> String {
    number_to(if angle_deg < 1e-9 { 0.0 } else { angle_deg }, 3)
}

/// An estimated error: one or two digits and an exponent.
#[must_use]
pub fn error(estimate: f64) -> String {
    let text = format!("{estimate:.1e}");
    text.replace(".0e", "e")
}

/// An error's share of a whole, in two digits.
#[must_use]
pub fn share(part: f64) -> String {
    if part > 0.0 && part < 1e-5 {
        return error(part);
    }
    format!("{} %", number_to(part * 100.0, 2))
}

/// A share with its error, where that is more than half of the last digit.
#[must_use]
pub fn share_with_error(part: f64, error: f64) -> String {
    if part > 0.0 && error > 0.5 * last_digit(part) {
        return format!("{} %", with_error(100.0 * part, 100.0 * error));
    }
    share(part)
}

/// A share in the digits of which the last is off by five at most; one of them in any case.
#[must_use]
pub fn share_within(part: f64, error: f64) -> String {
    let known = 10f64.powf((error / 5.0).log10().ceil());
    if part > 0.0 && known > last_digit(part) {
        let known = known.min(10f64.powf(part.log10().floor()));
        return share((part / known).round() * known);
    }
    share(part)
}

/// The unit of the last digit that [`share`] prints.
fn last_digit(part: f64) -> f64 {
    10f64.powf(part.log10().floor() - 1.0).min(0.01)
}

/// A file size.
#[must_use]
pub fn bytes(bytes: u64) -> String {
    si_to(bytes as f64, "B", 3)
}

/// `n` things: `1 coil`, `9 coils`, `1.5 layers`.
#[must_use]
pub fn count(n: impl Display, thing: &str) -> String {
    match n.to_string().as_str() {
        "1" => format!("1 {thing}"),
        many => format!("{many} {thing}s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box that rests on zero printed as one from -1.7764e-15 mm on.
    #[test]
    fn shares_have_the_digits_that_are_known() {
        for (part, error, with, within) in [
            (1.113, 0.004, "111 %", "111 %"),
            (0.362, 0.009, "36.2 +- 0.9 %", "36 %"),
            (0.113, 0.015, "11.3 +- 1.5 %", "11 %"),
            (1.6, 0.9, "160 +- 90 %", "200 %"),
            (0.02, 0.3, "0 +- 30 %", "2 %"),
            // Printed as 10 %, beside 7 % everywhere else.
            (0.07, 0.07, "7 +- 7 %", "7 %"),
            (0.0, 0.0, "0 %", "0 %"),
        ] {
            assert_eq!(share_with_error(part, error), with);
            assert_eq!(share_within(part, error), within);
        }
    }

    #[test]
    fn what_rounding_left_of_zero_prints_as_zero() {
        let printed = extents([-1.7764e-15, -5.0, 1e-7], [20.0, 5.3, 31.0]);
        assert_eq!(printed, "x 0 to 20, y -5 to 5.3, z 1e-7 to 31");
        assert_eq!(extents([-0.0; 3], [0.0; 3]), "x 0 to 0, y 0 to 0, z 0 to 0");
    }

    #[test]
    fn the_prefix_suits_the_rounded_number() {
        assert_eq!(si(0.014_501_926, "H"), "14.502 mH");
        assert_eq!(si(6.0753, "ohm"), "6.0753 ohm");
        assert_eq!(si(-0.0997, "N"), "-99.7 mN");
        assert_eq!(si(0.999_999_7, "N"), "1 N");
        assert_eq!(si(999.9, "V"), "999.9 V");
        assert_eq!(si(2.0, "A"), "2 A");
        assert_eq!(si(0.0, "A"), "0 A");
        assert_eq!(si_with_error(0.093_242, 0.0541, "s"), "93 +- 6 ms");
        assert_eq!(si_with_error(0.093_242, 0.0, "s"), "93.242 ms");
        assert_eq!(si(3.1e-16, "T"), "0.00031 pT");
    }

    #[test]
    fn five_digits_without_idle_zeros() {
        assert_eq!(number(1429.0), "1429");
        assert_eq!(number(1_428.571_43), "1428.6");
        assert_eq!(number(123_456.7), "123457");
        assert_eq!(number(0.000_123_456), "0.00012346");
        assert_eq!(number(1.234_567e-7), "1.2346e-7");
        assert_eq!(number(1e12), "1e12");
        assert_eq!(mm(0.0383), "38.3 mm");
        assert_eq!(percent(0.123_456), "12.3 %");
        assert_eq!(error(1e-12), "1e-12");
        assert_eq!(error(3.26e-10), "3.3e-10");
        assert_eq!(mass(0.4763), "476.3 g");
        assert_eq!(bytes(2_345_678), "2.35 MB");
        assert_eq!(force(0.000_641_3), "0.6413 mN");
        assert_eq!(force(-1.3), "-1.3 N");
        assert_eq!(length_error(2.980_2e-9), "3 nm");
        // `5.6e-6 pm` was printed of a formula.
        assert_eq!(length_error(5.6e-18), "below 1 pm");
        assert_eq!(count(1, "coil"), "1 coil");
    }
}
