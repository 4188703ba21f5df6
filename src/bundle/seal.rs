//! The seal of a record: a digest of its own text, so that a record changed by hand gives no
//! permission to replace or remove a file. A checksum against accidents, no signature: whoever
//! computes it can forge it.
//!
//! It is the last line of a JSON object, `"record_sha256": "<64 digits>"`, over the text as it is
//! without that line and the comma before it.

use serde::Serialize;

use super::artefact::sha256_hex;
use super::json::{JsonError, to_json};

/// The key of the seal.
pub(crate) const SEAL: &str = "record_sha256";

/// How the text of an object ends.
const END: &[u8] = b"\n}\n";

/// The value, an object, as [`to_json`] gives it, and its seal.
///
/// # Errors
/// Those of [`to_json`].
pub fn to_record<T: Serialize + ?Sized>(value: &T) -> Result<Vec<u8>, JsonError> {
    to_json(value).map(sealed)
}

/// The text of a JSON object, as [`to_json`] gives it, with its seal. Any other text stays as it is.
#[must_use]
pub fn sealed(text: Vec<u8>) -> Vec<u8> {
    match text.strip_suffix(END) {
        Some(open) => [open, line(&text).as_bytes(), END].concat(),
        None => text,
    }
}

/// Whether `text` ends with the seal of what is before it.
#[must_use]
pub fn is_sealed(text: &[u8]) -> bool {
    let length = line(b"").len() + END.len();
    let Some(start) = text.len().checked_sub(length) else {
        return false;
    };
    let (open, end) = text.split_at(start);
    let bare = [open, END].concat();
    end.strip_suffix(END) == Some(line(&bare).as_bytes())
}

/// The line of the seal of `text`, the comma before it included.
fn line(text: &[u8]) -> String {
    format!(",\n  \"{SEAL}\": \"{}\"", sha256_hex(text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_change_breaks_the_seal() {
        let bare = b"{\n  \"a\": 0.7,\n  \"b\": []\n}\n".to_vec();
        let text = sealed(bare.clone());
        assert!(is_sealed(&text) && !is_sealed(&bare) && !is_sealed(b""));
        let read: serde_json::Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(read[SEAL].as_str().unwrap(), sha256_hex(&bare));
        for place in 0..text.len() {
            let mut edited = text.clone();
            edited[place] ^= 1;
            assert!(!is_sealed(&edited), "byte {place}");
        }
        assert!(!is_sealed(&[&text[..], b"\n"].concat()));
        assert_eq!(sealed(b"[]\n".to_vec()), b"[]\n");
    }
}
