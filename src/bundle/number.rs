//! Numbers as text: the shortest decimals that give the same double back.

/// Appends a finite number. Plain decimals from 1e-5 up to (not including) 1e16, whole numbers
/// without a point, an exponent outside (`9.9e-6`, `5e-324`). The sign of zero is kept.
pub fn push_number(text: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let digits = buffer.format(value);
    let digits = digits.strip_suffix(".0").unwrap_or(digits);
    if value.abs() < 1e16 {
        text.extend_from_slice(digits.as_bytes());
    } else {
        // "7e+17": the plus says nothing.
        text.extend(digits.bytes().filter(|&byte| byte != b'+'));
    }
}

/// Appends a whole number.
pub fn push_index(text: &mut Vec<u8>, value: i64) {
    use std::io::Write;
    // Writing to memory cannot fail.
    let _ = write!(text, "{value}");
}

/// Appends a number and a comma.
pub fn push_cell(line: &mut Vec<u8>, value: f64) {
    push_number(line, value);
    line.push(b',');
}

/// Appends a text, quoted where it must be, and a comma.
pub fn push_text(line: &mut Vec<u8>, text: &str) {
    if text.contains([',', '"', '\n', '\r']) {
        let quoted = text.replace('"', "\"\"");
        line.extend_from_slice(format!("\"{quoted}\"").as_bytes());
    } else {
        line.extend_from_slice(text.as_bytes());
    }
    line.push(b',');
}

#[cfg(test)]
mod tests {
    use super::{push_index, push_number};

    fn text(value: f64) -> String {
        let mut text = Vec::new();
        push_number(&mut text, value);
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn the_contract_s_number_format() {
        for (value, want) in [
            (0.0, "0"),
            (-0.0, "-0"),
            (30.0, "30"),
            (-1429.0, "-1429"),
            (0.1 + 0.2, "0.30000000000000004"),
            (-0.428229, "-0.428229"),
            (1e-5, "0.00001"),
            (1.3e-5, "0.000013"),
            (9.9e-6, "9.9e-6"),
            (1e15, "1000000000000000"),
            (123_456_789_012_345.7, "123456789012345.7"),
            (7e17, "7e17"),
            (1.7e308, "1.7e308"),
            (5e-324, "5e-324"),
            (f64::MAX, "1.7976931348623157e308"),
            (f64::MIN_POSITIVE, "2.2250738585072014e-308"),
        ] {
            assert_eq!(text(value), want);
        }
    }

    #[test]
    fn text_reads_back_to_the_same_bits() {
        let mut random = fluxform_numerics::random::Random::new(7);
        for _ in 0..200_000 {
            let value = f64::from_bits(random.bits());
            if value.is_finite() {
                let text = text(value);
                assert_eq!(
                    text.parse::<f64>().unwrap().to_bits(),
                    value.to_bits(),
                    "{text}"
                );
                let size = value.abs();
                assert!(
                    !(1e-5..=1e15).contains(&size) || !text.contains('e'),
                    "{text}"
                );
            }
        }
    }

    #[test]
    fn whole_numbers() {
        let mut text = Vec::new();
        push_index(&mut text, -7);
        push_index(&mut text, 12);
        assert_eq!(text, b"-712");
    }
}
