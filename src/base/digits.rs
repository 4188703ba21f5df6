//! A number with its error, in the digits that the error leaves.

/// Shares of the value below which an error is not shown: nobody reads more than seven digits.
const LEAST_SHARE: f64 = 1e-6;
/// Powers of ten outside which an exponent is written.
const PLAIN: std::ops::Range<i32> = -4..7;

/// `value` and `error` to the last digit that the error leaves: `0.916 +- 0.004`. The error has one
/// digit, two where the first is 1, and is rounded up, so that what is printed covers what was
/// stated. Without an error above zero (0, or not finite), seven digits and no error.
#[must_use]
pub fn with_error(value: f64, error: f64) -> String {
    let known = error > 0.0 && error.is_finite() && value.is_finite();
    let error = error.max(LEAST_SHARE * value.abs());
    if !known || error == 0.0 {
        return plain(value, 7);
    }
    let mut last = error.log10().floor() as i32;
    // A leading 1 has a second digit, and so has what rounds up to 10.
    if error / power(last) < 2.0 {
        last -= 1;
    }
    // Rounding up what is a multiple already, but for the last bits, would add one.
    let units = (error / power(last) * (1.0 - 1e-9)).ceil();
    let size = value.abs().max(units * power(last));
    let first = size.log10().floor() as i32;
    if !PLAIN.contains(&first) || last > 0 && first >= PLAIN.end - 1 {
        let scale = power(first);
        let decimals = usize::try_from(first - last).unwrap_or(0);
        let (value, error) = (value / scale, units * power(last - first));
        return format!("({value:.decimals$} +- {error:.decimals$})e{first}");
    }
    if last >= 0 {
        let step = power(last);
        let value = (value / step).round() * step;
        return format!("{value:.0} +- {:.0}", units * step);
    }
    let decimals = usize::try_from(-last).unwrap_or(0);
    format!("{value:.decimals$} +- {:.decimals$}", units * power(last))
}

fn power(exponent: i32) -> f64 {
    10f64.powi(exponent)
}

/// So many significant digits at most, without zeros at the end.
fn plain(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let first = value.abs().log10().floor() as i32;
    if !PLAIN.contains(&first) {
        return format!("{value:e}");
    }
    let decimals = usize::try_from(digits - 1 - first).unwrap_or(0);
    let text = format!("{value:.decimals$}");
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// A time for people: seconds below two minutes, minutes below two hours, then hours.
#[must_use]
pub fn duration(time_s: f64) -> String {
    let (value, unit) = match time_s {
        short if short < 120.0 => (short, "s"),
        medium if medium < 7200.0 => (medium / 60.0, "min"),
        long => (long / 3600.0, "h"),
    };
    let decimals = usize::from(value < 10.0);
    format!("{value:.decimals$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five digits were printed of numbers of which two were known: `93.242 ms`, off by 5.41 %.
    #[test]
    fn digits_follow_the_error() {
        for (value, error, text) in [
            (0.916_37, 0.0038, "0.916 +- 0.004"),
            (93.242, 0.0541 * 93.242, "93 +- 6"),
            (1.4569, 0.0113, "1.457 +- 0.012"),
            (1.4569, 0.0098, "1.457 +- 0.010"),
            (0.223_489_8, 8.2e-5, "0.22349 +- 0.00009"),
            (3.0, 0.004, "3.000 +- 0.004"),
            (-12_345.6, 370.0, "-12300 +- 400"),
            (0.3, 2.7, "0 +- 3"),
            (2.5, 0.0, "2.5"),
            (6.0, f64::INFINITY, "6"),
            (0.123_456_789, 1e-14, "0.12345679 +- 0.00000013"),
            (5.6e-18, 2e-18, "(6 +- 2)e-18"),
        ] {
            assert_eq!(with_error(value, error), text);
        }
    }

    #[test]
    fn what_is_printed_covers_what_was_stated() {
        for k in 0..2000 {
            let error = 1.7_f64.powf(0.013 * f64::from(k) - 13.0);
            let value = 3.7 + 0.01 * f64::from(k);
            let printed = with_error(value, error);
            let (shown, off) = printed.split_once(" +- ").unwrap();
            let (shown, off): (f64, f64) = (shown.parse().unwrap(), off.parse().unwrap());
            let rounding = (shown - value).abs();
            assert!(
                off >= error * (1.0 - 1e-6),
                "{printed} of {value} +- {error}"
            );
            assert!(rounding <= 0.51 * off, "{printed} of {value} +- {error}");
        }
    }

    #[test]
    fn times_have_the_unit_in_which_they_are_read() {
        let shown = [3.21, 60.0, 558.0, 2611.6, 7300.0].map(duration);
        assert_eq!(shown, ["3.2 s", "60 s", "9.3 min", "44 min", "2.0 h"]);
    }
}
