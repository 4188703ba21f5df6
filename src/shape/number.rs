//! Coordinates written as text: their values, and how finely the text states them.

/// A text whose numbers all have fewer digits than a printed float wrote them exactly.
const PRINTED_DIGITS: usize = 6;
/// A number with more digits may show that it never was a single-precision float.
const FLOAT_DIGITS: usize = 9;
/// Relative rounding of a coordinate stored as f32.
pub(super) const F32_ROUNDING: f64 = 1.0 / 16_777_216.0;

/// Reads coordinates and derives the file's number format from them.
#[derive(Debug, Clone, Default)]
pub(super) struct Numbers {
    /// Most significant digits of any coordinate.
    digits: usize,
    largest: f64,
    /// A coordinate lies between two floats by more than its digits leave open.
    finer_than_float: bool,
}

impl Numbers {
    /// The finite number that `word` writes, or what is wrong with it.
    pub(super) fn read(&mut self, word: &[u8]) -> Result<f64, String> {
        let value: Option<f64> = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        match value {
            Some(value) if value.is_finite() => {
                let digits = significant_digits(word);
                self.digits = self.digits.max(digits);
                if digits > FLOAT_DIGITS && !self.finer_than_float {
                    let off = (value - f64::from(value as f32)).abs();
                    self.finer_than_float = off > value.abs() * 5.0 * 10f64.powf(-(digits as f64));
                }
                self.largest = self.largest.max(value.abs());
                Ok(value)
            }
            Some(_) if word.iter().any(u8::is_ascii_digit) => {
                Err(format!("the coordinate `{}` is too large", shown(word)))
            }
            Some(_) => Err(format!(
                "a coordinate is `{}`, not a finite number; repair the body and export it again",
                shown(word)
            )),
            None if word.contains(&b',') => Err(format!(
                "expected a number, found `{}`; numbers are written with a decimal point",
                shown(word)
            )),
            None => Err(format!("expected a number, found `{}`", shown(word))),
        }
    }

    /// Relative rounding of the numbers before they were printed.
    pub(super) fn epsilon(&self) -> f64 {
        if self.finer_than_float {
            f64::EPSILON
        } else {
            F32_ROUNDING
        }
    }

    /// Half a unit of the last printed digit at the largest coordinate, and f32's rounding unless
    /// the digits show something finer: most programs print floats.
    pub(super) fn rounding(&self) -> f64 {
        let stored = self.largest * self.epsilon();
        if self.digits < PRINTED_DIGITS || self.largest == 0.0 {
            return stored;
        }
        let decade = self.largest.log10().floor() + 1.0 - self.digits as f64;
        stored.max(0.5 * 10f64.powf(decade))
    }
}

/// Digits from the first that is not 0 to the end of the mantissa.
fn significant_digits(word: &[u8]) -> usize {
    word.iter()
        .take_while(|b| !b.eq_ignore_ascii_case(&b'e'))
        .filter(|b| b.is_ascii_digit())
        .skip_while(|b| **b == b'0')
        .count()
}

/// A word for a message, at most 20 bytes of it: a document may name any file as a surface.
pub(super) fn shown(word: &[u8]) -> String {
    word[..word.len().min(20)].escape_ascii().to_string()
}
