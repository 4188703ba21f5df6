//! Every small damage to a document, in a fixed order.

use fluxform_testing::Random;

/// A damaged document.
pub struct Mutant {
    pub number: usize,
    /// The task.
    pub what: String,
    /// The name under which it lies.
    pub file: String,
    pub bytes: Vec<u8>,
}

/// Changed values.
const VALUES: [&str; 34] = [
    "0",
    "-0.0",
    "-1",
    "1e-300",
    "1e-307",
    "1e300",
    "-1e300",
    "5e-324",
    "1.7976931348623157e308",
    "nan",
    "inf",
    "-inf",
    "9223372036854775807",
    "-9223372036854775808",
    "99999999999999999999999",
    "1000000000",
    "0x7f",
    "",
    "\"\"",
    "\"a\"",
    "\"\\u001b]0;title\\u0007\"",
    "\"\u{1b}[31m\"",
    "\"\u{202e}\"",
    "\"../../etc/passwd\"",
    "\"/proc/self/environ\"",
    "\"/dev/zero\"",
    "true",
    "1979-05-27",
    "[]",
    "{}",
    "[1, [2, [3]]]",
    "[nan, inf, 61]",
    "[0.0, 1e-300, 1000000000]",
    "[1e-307, 1e307]",
];

/// Names of files that command a terminal or a script.
const NAMES: [&str; 5] = [
    "\u{1b}]0;title\u{7}",
    "a\nerror: nothing",
    "\u{202e}lmot.",
    "\u{9b}31m",
    "a b 'c' \"d\" $(e) `f`",
];

/// All of them; of bytes one each, at places that a small generator chooses.
pub fn mutants(file: &str, text: &str) -> Vec<Mutant> {
    let mut all: Vec<(String, String, Vec<u8>)> = Vec::new();
    let mut add = |what: String, bytes: Vec<u8>| all.push((what, file.to_owned(), bytes));
    let lines: Vec<&str> = text.lines().collect();
    let separator = if file.ends_with(".json") {
        "\": "
    } else {
        " = "
    };
    let mut with = |at: usize, what: String, new: &str| {
        let mut changed = lines.clone();
        changed[at] = new;
        add(what, format!("{}\n", changed.join("\n")).into_bytes());
    };
    for (at, line) in lines.iter().enumerate() {
        with(at, format!("without `{line}`"), "");
        with(at, format!("twice `{line}`"), &format!("{line}\n{line}"));
        let Some((key, value)) = line.split_once(separator) else {
            continue;
        };
        for (what, key) in misspelt(key) {
            with(
                at,
                format!("{what} `{line}`"),
                &format!("{key}{separator}{value}"),
            );
        }
        let comma = if value.ends_with(',') && file.ends_with(".json") {
            ","
        } else {
            ""
        };
        for value in VALUES {
            let what = format!("`{key}` is {}", value.escape_debug());
            with(at, what, &format!("{key}{separator}{value}{comma}"));
        }
        let long = "x".repeat(100_000);
        with(
            at,
            format!("long text `{key}`"),
            &format!("{key}{separator}\"{long}\"{comma}"),
        );
        let deep = "[".repeat(10_000);
        with(
            at,
            format!("deep list `{key}`"),
            &format!("{key}{separator}{deep}{comma}"),
        );
    }
    if file.ends_with(".csv") {
        for (at, line) in lines.iter().enumerate() {
            for value in VALUES {
                let what = format!("a cell of `{line}` is {}", value.escape_debug());
                with(
                    at,
                    what,
                    &line.replacen(|c: char| c.is_ascii_digit(), value, 1),
                );
            }
        }
    }
    bytes(text, &mut add);
    for name in NAMES {
        let what = format!("called {}", name.escape_debug());
        let broken = format!("{text}\nno_such = \n");
        all.push((what, format!("{name}{file}"), broken.into_bytes()));
    }
    let number = |(number, (what, file, bytes))| Mutant {
        number,
        what,
        file,
        bytes,
    };
    all.into_iter().enumerate().map(number).collect()
}

/// The key with a letter less, a letter more, two swapped, in capitals, and with a control character.
fn misspelt(key: &str) -> Vec<(&'static str, String)> {
    let quote = if key.trim_start().starts_with('"') {
        "\""
    } else {
        ""
    };
    let indent = &key[..key.len() - key.trim_start().len()];
    let bare = key.trim_start().trim_start_matches('"');
    let (first, rest) = bare.split_at(1);
    let control = match quote {
        "" => format!("\"{bare}\\u001b[31m\""),
        _ => format!("\"{bare}\\u001b[31m"),
    };
    vec![
        ("less", format!("{indent}{quote}{rest}")),
        ("more", format!("{indent}{quote}{bare}x")),
        (
            "swapped",
            format!("{indent}{quote}{}{first}{}", &rest[..1], &rest[1..]),
        ),
        (
            "capitals",
            format!("{indent}{quote}{}", bare.to_uppercase()),
        ),
        ("control", format!("{indent}{control}")),
    ]
}

/// Every byte put in somewhere, every bit turned somewhere, the text cut at many places.
fn bytes(text: &str, add: &mut impl FnMut(String, Vec<u8>)) {
    let mut random = Random::new(7);
    for byte in 0..=255_u8 {
        let mut bytes = text.as_bytes().to_vec();
        let at = random.below(bytes.len());
        bytes.insert(at, byte);
        add(format!("byte {byte:#04x} put in at {at}"), bytes);
        let mut bytes = text.as_bytes().to_vec();
        let at = random.below(bytes.len());
        bytes[at] = byte;
        add(format!("byte {byte:#04x} at {at}"), bytes);
    }
    for bit in 0..8 {
        let mut bytes = text.as_bytes().to_vec();
        let at = random.below(bytes.len());
        bytes[at] ^= 1 << bit;
        add(format!("bit {bit} turned at {at}"), bytes);
    }
    for cut in (0..text.len()).step_by(37) {
        add(format!("cut at {cut}"), text.as_bytes()[..cut].to_vec());
    }
    for mark in ["\u{feff}", "\0\0\0\0", "\u{fffd}"] {
        add(
            format!("after {}", mark.escape_debug()),
            format!("{mark}{text}").into_bytes(),
        );
    }
    add(
        "carriage returns".to_owned(),
        text.replace('\n', "\r\n").into_bytes(),
    );
    add(
        "old line ends".to_owned(),
        text.replace('\n', "\r").into_bytes(),
    );
    let wide = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
    add("UTF-16".to_owned(), wide);
}
