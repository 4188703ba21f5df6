//! Damage that knows what it damages: JSON trees, tables, texts.

use serde_json::{Value, json};

use crate::mutation::damage;
use fluxform_testing::Random;

/// No mutated content grows beyond this, bytes.
const MOST: usize = 1 << 20;

/// Numbers at the ends of what numbers are.
const EXTREMES: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.7,
    1e-3,
    1e3,
    1e6,
    -1e6,
    1e9,
    1e15,
    1e16,
    1e30,
    -1e30,
    1e100,
    1e-30,
    1e-100,
    5e-324,
    1e-308,
    1e308,
    -1e308,
    1.797_693_134_862_315_7e308,
    9_007_199_254_740_993.0,
    18_446_744_073_709_551_615.0,
];

pub fn extreme(random: &mut Random) -> f64 {
    EXTREMES[random.below(EXTREMES.len())]
}

/// Spellings of numbers, good and bad.
const SPELLED: [&str; 30] = [
    "0",
    "-0",
    "1",
    "-1",
    "nan",
    "NaN",
    "-nan",
    "inf",
    "-Infinity",
    "1e308",
    "-1e308",
    "1e309",
    "1e-320",
    "5e-324",
    "1_000",
    "0x10",
    "0b1",
    "+1",
    ".5",
    "5.",
    "1e",
    "1e+2",
    "1,5",
    "1d3",
    "9223372036854775807",
    "9223372036854775808",
    "99999999999999999999999",
    "0.1.2",
    "\u{221e}",
    "\u{661}",
];

/// Damage to a text of lines, words and numbers.
pub fn damage_text(bytes: &mut Vec<u8>, random: &mut Random) {
    let at = |bytes: &[u8], random: &mut Random| random.below(bytes.len() + 1);
    match random.below(12) {
        0 => {
            bytes.splice(0..0, *b"\xef\xbb\xbf");
        }
        1 => {
            let text = bytes.split(|byte| *byte == b'\n').collect::<Vec<_>>();
            *bytes = text.join(if random.below(2) == 0 {
                &b"\r\n"[..]
            } else {
                b"\r"
            });
        }
        2 => {
            let at = at(bytes, random);
            let odd: [&[u8]; 6] = [
                b"\0",
                b"\xff\xfe",
                b"\xc3",
                b"\xed\xa0\x80",
                b"\x1b[2J",
                b"\xe2\x80\xae",
            ];
            bytes.splice(at..at, odd[random.below(6)].iter().copied());
        }
        3 => {
            let at = at(bytes, random);
            let open: [&[u8]; 8] = [
                b"[", b"{", b"{\"a\":", b"a={", b"(", b"\"", b"[a.", b"a.a.a.",
            ];
            let times = [3, 130, 1000, 20_000][random.below(4)];
            bytes.splice(at..at, open[random.below(8)].repeat(times));
        }
        4 => {
            let at = at(bytes, random);
            let long: [&[u8]; 6] = [b"9", b" ", b"a", b",", b"\n", b"#"];
            bytes.splice(
                at..at,
                long[random.below(6)].repeat(1 << (6 + random.below(12))),
            );
        }
        5..=7 => {
            // A number of the text becomes another.
            let digit = |byte: &u8| byte.is_ascii_digit();
            let from = at(bytes, random);
            if let Some(start) = bytes[from..].iter().position(digit).map(|k| k + from) {
                let part = |byte: &u8| byte.is_ascii_digit() || b".eE+-".contains(byte);
                let length = bytes[start..].iter().position(|byte| !part(byte));
                let end = length.map_or(bytes.len(), |k| start + k);
                let new = if random.below(2) == 0 {
                    format!("{:?}", extreme(random))
                } else {
                    SPELLED[random.below(SPELLED.len())].to_owned()
                };
                bytes.splice(start..end, new.into_bytes());
            }
        }
        _ => damage(bytes, random),
    }
    bytes.truncate(MOST);
}

/// Some damage to a JSON document; below its text, or of the text where it is none.
pub fn damage_json(bytes: &mut Vec<u8>, random: &mut Random) {
    let Ok(mut value) = serde_json::from_slice::<Value>(bytes) else {
        return damage_text(bytes, random);
    };
    if random.below(6) == 0 {
        return damage_text(bytes, random);
    }
    for _ in 0..=random.below(3) {
        damage_value(&mut value, random);
    }
    *bytes = serde_json::to_vec_pretty(&value).unwrap_or_default();
    bytes.truncate(MOST);
}

fn damage_value(value: &mut Value, random: &mut Random) {
    match value {
        Value::Object(map) if !map.is_empty() && random.below(12) > 0 => {
            let key = map.keys().nth(random.below(map.len())).cloned();
            let key = key.unwrap_or_default();
            match random.below(14) {
                0 => {
                    map.remove(&key);
                }
                1 => {
                    map.insert("a_key_of_the_future".to_owned(), json!({ "x": [1] }));
                }
                _ => damage_value(&mut map[&key], random),
            }
        }
        Value::Array(items) if !items.is_empty() && random.below(8) > 0 => {
            let at = random.below(items.len());
            match random.below(10) {
                0 => {
                    items.remove(at);
                }
                1 => {
                    let copy = items[at].clone();
                    let times = [1, 1, 2, 40, 1000][random.below(5)];
                    items.splice(at..at, std::iter::repeat_n(copy, times));
                }
                2 => items.truncate(at),
                3 => {
                    let other = random.below(items.len());
                    items.swap(at, other);
                }
                _ => damage_value(&mut items[at], random),
            }
        }
        other => *other = odd(random),
    }
}

fn odd(random: &mut Random) -> Value {
    match random.below(14) {
        0 => Value::Null,
        1 => json!(random.below(2) == 0),
        2 => json!([]),
        3 => json!({}),
        4 => json!(""),
        5 => json!("\u{1b}[31m\u{0}\n"),
        6 => json!("../../etc/passwd"),
        7 => json!("a".repeat(1 << random.below(14))),
        8 => json!(u64::MAX),
        9 => json!(i64::MIN),
        10 => json!([[], [[1e308]]]),
        _ => json!(extreme(random)),
    }
}
