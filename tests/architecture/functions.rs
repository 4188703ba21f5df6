//! No function is too long to read at once, unless its comment says why.

use std::collections::BTreeMap;

use crate::source::{files, read};

/// Lines of a function, from its `fn` to its last brace.
const MOST_LINES: usize = 80;
/// Opens the sentence that gives the reason, in the comment of a function that has more.
const REASON: &str = "/// Long because ";

/// Functions that are longer and give no reason, with their lines. The list may only shrink.
const LONG: &[(&str, &str)] = &[];

/// Name and length of every function outside tests whose comment gives no reason; the text is as
/// rustfmt leaves it.
fn long(text: &str) -> BTreeMap<String, usize> {
    let lines: Vec<&str> = text
        .split("#[cfg(test)]\nmod tests {")
        .next()
        .unwrap()
        .lines()
        .collect();
    let mut found = BTreeMap::new();
    for (at, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let words: Vec<&str> = code.split(' ').collect();
        let keywords = ["pub", "pub(crate)", "pub(super)", "const", "async", "fn"];
        let header = words.iter().take_while(|word| keywords.contains(word));
        if code.starts_with("//") || !header.clone().any(|word| *word == "fn") {
            continue;
        }
        let name = words[header.count()].split(['(', '<']).next().unwrap();
        let indent = &line[..line.len() - code.len()];
        // A declaration ends before a body begins.
        let open = lines[at..]
            .iter()
            .position(|l| l.ends_with('{') || l.ends_with([';', '}']));
        let Some(open) = open.filter(|open| lines[at + open].ends_with('{')) else {
            continue;
        };
        let close = format!("{indent}}}");
        let Some(length) = lines[at + open..].iter().position(|l| **l == close) else {
            continue;
        };
        let length = open + length + 1;
        let head = lines[..at].iter().rev();
        let mut head = head.take_while(|l| l.trim_start().starts_with(['/', '#']));
        if length > MOST_LINES && !head.any(|l| l.trim_start().starts_with(REASON)) {
            found.insert(name.to_owned(), length);
        }
    }
    found
}

#[test]
fn no_function_is_long_without_a_reason() {
    let mut faults = Vec::new();
    let mut shorter: Vec<&(&str, &str)> = LONG.iter().collect();
    for path in files() {
        if !path.starts_with("src/") || !path.ends_with(".rs") || path.ends_with("tests.rs") {
            continue;
        }
        for (name, lines) in long(&read(&path)) {
            let known = |entry: &&(&str, &str)| **entry == (path.as_str(), name.as_str());
            if LONG.iter().any(|entry| known(&entry)) {
                shorter.retain(|entry| !known(entry));
            } else {
                faults.push(format!("{path}: {name} has {lines} lines"));
            }
        }
    }
    assert!(
        faults.is_empty(),
        "split, or say why after {REASON:?}:\n{}",
        faults.join("\n")
    );
    assert!(shorter.is_empty(), "no longer so long: {shorter:?}");
}

#[test]
fn a_long_function_is_seen() {
    let body = "        work();\n".repeat(80);
    let text = format!(
        "impl T {{\n    pub(crate) fn long<T>(\n        t: T,\n    ) {{\n{body}    }}\n}}\n"
    );
    assert_eq!(long(&text), BTreeMap::from([("long".to_owned(), 84)]));
    let said = text.replace(
        "    pub(crate)",
        "    /// Long because it is a table.\n    pub(crate)",
    );
    assert_eq!(long(&said), BTreeMap::new());
    assert_eq!(
        long(&text.replace("        work();\n", "")),
        BTreeMap::new()
    );
}
