//! Text files in any of the encodings that programs write.

use std::borrow::Cow;

/// The bytes in UTF-8 where their byte-order mark says that they are in UTF-16; others as they
/// are. What no pair of surrogates stands for becomes U+FFFD.
pub(super) fn narrow(bytes: &[u8]) -> Cow<'_, [u8]> {
    let unit = match bytes {
        [0xff, 0xfe, ..] => u16::from_le_bytes,
        [0xfe, 0xff, ..] => u16::from_be_bytes,
        _ => return Cow::Borrowed(bytes),
    };
    let (units, _) = bytes[2..].as_chunks::<2>();
    let text = char::decode_utf16(units.iter().map(|pair| unit(*pair)));
    let text: String = text.map(|c| c.unwrap_or('\u{fffd}')).collect();
    Cow::Owned(text.into_bytes())
}

/// Whether bytes begin with a sign, in any case, after a byte-order mark and blanks.
pub(super) fn starts(bytes: &[u8], sign: &[u8]) -> bool {
    let body = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let body = body.trim_ascii_start();
    body.get(..sign.len())
        .is_some_and(|first| first.eq_ignore_ascii_case(sign))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_order_of_bytes_gives_the_same_text() {
        let text = "v 0.7 -1.3 \u{e9}\u{1f600}\n";
        let wide = |order: fn(u16) -> [u8; 2]| -> Vec<u8> {
            "\u{feff}"
                .encode_utf16()
                .chain(text.encode_utf16())
                .flat_map(order)
                .collect()
        };
        assert_eq!(narrow(&wide(u16::to_le_bytes)), text.as_bytes());
        assert_eq!(narrow(&wide(u16::to_be_bytes)), text.as_bytes());
        assert_eq!(narrow(text.as_bytes()), text.as_bytes());
    }
}
