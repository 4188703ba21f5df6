//! Arrays as text: base64 of small numbers, and JSON that is safe inside a script element.

use serde_json::{Value, json};

const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

/// Bytes in base64 (RFC 4648), padded.
#[must_use]
pub fn base64(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |at: usize| u32::from(chunk.get(at).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let value = (bits >> (18 - 6 * digit)) & 63;
            let used = digit <= chunk.len();
            text.push(if used {
                char::from(DIGITS[value as usize])
            } else {
                '='
            });
        }
    }
    text
}

/// Numbers as 32-bit floats, little-endian; what is missing is not a number there.
#[must_use]
pub fn f32s(values: impl IntoIterator<Item = f64>) -> Value {
    let bytes: Vec<u8> = values
        .into_iter()
        .flat_map(|value| (value as f32).to_le_bytes())
        .collect();
    json!({ "f32": base64(&bytes) })
}

/// Numbers as 16-bit steps between their least and their largest: within 1/131070 of that range.
#[must_use]
pub fn u16s(values: &[f64]) -> Value {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low <= high { (low, high) } else { (0.0, 0.0) };
    let scale = if high > low {
        f64::from(u16::MAX) / (high - low)
    } else {
        0.0
    };
    let bytes: Vec<u8> = values
        .iter()
        .flat_map(|value| (((value - low) * scale).round() as u16).to_le_bytes())
        .collect();
    json!({ "u16": base64(&bytes), "lo": low, "hi": high })
}

/// JSON that ends no script element and begins no comment.
#[must_use]
pub(crate) fn in_script(value: &Value) -> String {
    let text = value.to_string();
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => out.push_str("\\u003c"),
            '>' => out.push_str("\\u003e"),
            '&' => out.push_str("\\u0026"),
            // Line ends to a script, and marks that turn the text's direction.
            '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => {
                out.push_str(&format!("\\u{:04x}", u32::from(c)));
            }
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn steps_keep_both_ends_and_a_constant() {
        assert_eq!(
            u16s(&[0.7, 1.3]),
            json!({ "u16": "AAD//w==", "lo": 0.7, "hi": 1.3 })
        );
        assert_eq!(u16s(&[1.3])["u16"], "AAA=");
        assert_eq!(u16s(&[])["hi"], 0.0);
    }

    #[test]
    fn json_cannot_leave_its_script() {
        let text = in_script(&json!({ "name": "</script><!--&\u{2028}" }));
        assert!(!text.contains(['<', '>', '&', '\u{2028}']), "{text}");
        let back: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(back["name"], "</script><!--&\u{2028}");
    }
}
