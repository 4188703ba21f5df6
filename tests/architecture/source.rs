//! The crate's source as tokens: comments, texts and test modules taken out.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A source file of the crate, as the checks see it.
pub struct Source {
    /// Relative to `src` (the measuring suite's to `tests`), with `/`.
    pub path: String,
    /// Identifiers, `::` and single characters; no comment, no text, no `#[cfg(test)] mod`.
    pub tokens: Vec<String>,
}

impl Source {
    /// Top-level folder or file stem: the room.
    pub fn room(&self) -> &str {
        let first = self.path.split('/').next().unwrap();
        first.strip_suffix(".rs").unwrap_or(first)
    }

    /// The file's module path; that of a member's file begins with the member.
    pub fn module(&self) -> Vec<String> {
        let stem = self.path.strip_suffix(".rs").unwrap();
        let mut parts: Vec<String> = stem.split('/').map(str::to_owned).collect();
        if ["mod", "lib", "main"].contains(&parts.last().unwrap().as_str()) {
            parts.pop();
        }
        parts
    }

    pub fn new(path: &str, text: &str) -> Self {
        Self {
            path: path.to_owned(),
            tokens: without_test_modules(tokens(text)),
        }
    }

    /// Whether the tokens of `pattern`, separated by blanks, occur in a row.
    pub fn has(&self, pattern: &str) -> bool {
        let expected: Vec<&str> = pattern.split(' ').collect();
        self.tokens.windows(expected.len()).any(|w| w == expected)
    }

    /// The root of the file's crate: the member, or nothing for the root package.
    fn crate_root(&self) -> Vec<String> {
        let room = self.room();
        if members().contains(room) {
            vec![room.to_owned()]
        } else {
            Vec::new()
        }
    }

    /// The paths that the file names through `crate::`, `super::` or `self::`, as far as the first
    /// brace; a group right after the anchor is spelled out. They begin with the room.
    pub fn crate_paths(&self) -> Vec<Vec<String>> {
        let mut paths = Vec::new();
        let mut inline = Vec::new(); // (name, depth of its braces)
        let mut depth = 0_usize;
        let mut i = 0;
        while i < self.tokens.len() {
            match self.tokens[i].as_str() {
                "mod" if self.token(i + 2) == "{" => {
                    depth += 1;
                    inline.push((self.token(i + 1).to_owned(), depth));
                    i += 2;
                }
                "{" => depth += 1,
                "}" => {
                    if inline.last().is_some_and(|(_, at)| *at == depth) {
                        inline.pop();
                    }
                    depth = depth.saturating_sub(1);
                }
                "crate" | "super" | "self" if self.token(i + 1) == "::" => {
                    let mut base = if self.tokens[i] == "crate" {
                        self.crate_root()
                    } else {
                        let mut here = self.module();
                        here.extend(inline.iter().map(|(name, _)| name.clone()));
                        here
                    };
                    while self.token(i + 1) == "::" && is_anchor(self.token(i)) {
                        if self.token(i) == "super" {
                            base.pop();
                        }
                        i += 2;
                    }
                    self.follow(i, &base, &mut paths);
                    continue; // what follows is read again, for the paths inside it
                }
                _ => {}
            }
            i += 1;
        }
        paths
    }

    fn token(&self, i: usize) -> &str {
        self.tokens.get(i).map_or("", String::as_str)
    }

    /// Adds the path or the group of paths that begins at token `i`.
    fn follow(&self, mut i: usize, base: &[String], paths: &mut Vec<Vec<String>>) {
        if self.token(i) != "{" {
            let mut path = base.to_vec();
            path.push(self.token(i).to_owned());
            while self.token(i + 1) == "::" && is_word(self.token(i + 2)) {
                path.push(self.token(i + 2).to_owned());
                i += 2;
            }
            paths.push(path);
            return;
        }
        let mut depth = 0;
        loop {
            let before = self.token(i);
            match before {
                "{" => depth += 1,
                "}" => depth -= 1,
                _ => {}
            }
            if depth == 0 || i >= self.tokens.len() {
                return;
            }
            i += 1;
            if depth == 1 && ["{", ","].contains(&before) && is_word(self.token(i)) {
                self.follow(i, base, paths);
            }
        }
    }
}

fn is_anchor(token: &str) -> bool {
    ["crate", "super", "self"].contains(&token)
}

fn is_word(token: &str) -> bool {
    token.starts_with(|c: char| c.is_alphanumeric() || c == '_')
}

/// The text after the `#` marks and the quote that open a raw string, and its closing mark.
fn raw_string(rest: &str) -> Option<(&str, String)> {
    let body = rest
        .strip_prefix("br")
        .or_else(|| rest.strip_prefix("cr"))
        .or_else(|| rest.strip_prefix('r'))?;
    let opened = body.trim_start_matches('#');
    let marks = "#".repeat(body.len() - opened.len());
    Some((opened.strip_prefix('"')?, format!("\"{marks}")))
}

fn after<'a>(text: &'a str, mark: &str) -> &'a str {
    text.find(mark).map_or("", |at| &text[at + mark.len()..])
}

/// The rest after a block comment; such comments nest.
fn after_comment(mut text: &str) -> &str {
    let mut depth = 0;
    loop {
        if let Some(inner) = text.strip_prefix("/*") {
            depth += 1;
            text = inner;
        } else if let Some(outer) = text.strip_prefix("*/") {
            depth -= 1;
            text = outer;
        } else {
            text = &text[text.chars().next().map_or(0, char::len_utf8)..];
        }
        if depth == 0 || text.is_empty() {
            return text;
        }
    }
}

/// The rest after a text or character whose opening quote was read.
fn after_quote(text: &str, quote: char) -> &str {
    let mut escaped = false;
    for (at, c) in text.char_indices() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            _ if c == quote => return &text[at + 1..],
            _ => {}
        }
    }
    ""
}

/// Identifiers, numbers, `::` and single characters of Rust source, without comments and texts.
fn tokens(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        if rest.starts_with("//") {
            rest = after(rest, "\n");
        } else if rest.starts_with("/*") {
            rest = after_comment(rest);
        } else if let Some((inside, close)) = raw_string(rest) {
            rest = after(inside, &close);
        } else if c == '"' {
            rest = after_quote(&rest[1..], '"');
        } else if c == '\'' {
            // A character ends within one symbol or begins with a backslash; else: a lifetime.
            let mut inside = rest[1..].chars();
            let is_character = inside.next() == Some('\\') || inside.next() == Some('\'');
            rest = &rest[1..];
            if is_character {
                // A quote as the character itself is escaped, so the next one closes.
                rest = after_quote(rest, '\'');
            }
        } else if c.is_alphanumeric() || c == '_' {
            let end = rest
                .find(|c: char| !(c.is_alphanumeric() || c == '_'))
                .unwrap_or(rest.len());
            found.push(rest[..end].to_owned());
            rest = &rest[end..];
        } else if let Some(next) = rest.strip_prefix("::") {
            found.push("::".to_owned());
            rest = next;
        } else {
            if !c.is_whitespace() {
                found.push(c.to_string());
            }
            rest = &rest[c.len_utf8()..];
        }
    }
    found
}

/// Takes out every `#[cfg(test)] mod name { ... }`, with attributes in between.
fn without_test_modules(tokens: Vec<String>) -> Vec<String> {
    const MARK: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut kept = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        if tokens[i..].starts_with(&MARK.map(str::to_owned)) {
            let mut at = i + MARK.len();
            while tokens.get(at).is_some_and(|t| t == "#") {
                at = past_group(&tokens, at + 1, "[", "]");
            }
            if tokens.get(at).is_some_and(|t| t == "mod")
                && tokens.get(at + 2).is_some_and(|t| t == "{")
            {
                i = past_group(&tokens, at + 2, "{", "}");
                continue;
            }
        }
        kept.push(tokens[i].clone());
        i += 1;
    }
    kept
}

/// The index after the group that opens at `i`.
fn past_group(tokens: &[String], mut i: usize, open: &str, close: &str) -> usize {
    let mut depth = 0;
    while i < tokens.len() {
        if tokens[i] == open {
            depth += 1;
        } else if tokens[i] == close {
            depth -= 1;
            if depth == 0 {
                return i + 1;
            }
        }
        i += 1;
    }
    i
}

/// The folders of the workspace's members.
fn folders() -> Vec<String> {
    let manifest: toml::Table = read("Cargo.toml").parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    let folders = members.iter().map(|path| path.as_str().unwrap().to_owned());
    folders.collect()
}

/// The members of the workspace that compute, by their folders' names: all but what tests share.
pub fn members() -> BTreeSet<String> {
    let name = |folder: &String| folder.rsplit('/').next().unwrap().to_owned();
    let computes = |folder: &&String| *folder != "tests/support";
    folders().iter().filter(computes).map(name).collect()
}

/// The manifests of all packages.
pub fn manifests() -> Vec<String> {
    let mut all = vec!["Cargo.toml".to_owned()];
    all.extend(
        folders()
            .iter()
            .map(|folder| format!("{folder}/Cargo.toml")),
    );
    all
}

/// The crate's folder.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every file of the repository's tree, relative to the root, with `/`; the folders of builds
/// and results and those that begin with a dot, but for `.ci`, are left out.
pub fn files() -> Vec<String> {
    fn walk(folder: &Path, prefix: &str, found: &mut Vec<String>) {
        let entries = fs::read_dir(folder).unwrap();
        for entry in entries.map(Result::unwrap) {
            let name = entry.file_name().into_string().unwrap();
            let path = format!("{prefix}{name}");
            let kind = entry.file_type().unwrap();
            if kind.is_dir() {
                let skipped = ["target", "results", "__pycache__"].contains(&name.as_str());
                if !skipped && (!name.starts_with('.') || path == ".ci") {
                    walk(&entry.path(), &format!("{path}/"), found);
                }
            } else if kind.is_file() && name != ".git" {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&root(), "", &mut found);
    found.sort();
    found
}

/// Every Rust file under `src`, and the measuring suite's but for its own tests.
pub fn sources() -> Vec<Source> {
    files()
        .iter()
        .filter(|path| path.ends_with(".rs") && !path.starts_with("tests/suite/tests/"))
        .filter_map(|path| {
            let suite = path
                .strip_prefix("tests/")
                .filter(|p| p.starts_with("suite/"));
            let within = path.strip_prefix("src/").or(suite)?;
            Some(Source::new(within, &read(path)))
        })
        .collect()
}

/// The Rust files that tests share.
pub fn shared_by_tests() -> Vec<Source> {
    let shared = |path: &String| path.starts_with("tests/support/") && path.ends_with(".rs");
    let within = |path: &String| path.strip_prefix("tests/").unwrap().to_owned();
    let paths = files().into_iter().filter(shared);
    paths
        .map(|path| Source::new(&within(&path), &read(&path)))
        .collect()
}

/// The text of a file of the repository.
pub fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[test]
fn comments_texts_and_test_modules_are_no_code() {
    let source = Source::new(
        "coil/limits.rs",
        r##"
        // use crate::alpha::A;
        /* use crate::beta; /* nested */ crate::gamma::x() */
        use crate::field::{frame, winding::{Winding, OnEdge}, ring as loops,};
        use crate::{bundle::npz as archive, numerics::{axis, gauss},};
        fn f<'a>(c: char) -> &'a str { if c == '"' || c == '\'' { super::circuit::g() } else { "crate::delta::D" } }
        const R: &str = r#"" crate::epsilon "#;
        mod inner { use super::super::mutual; fn h() { self::k(super::super::super::map::m()) } }
        #[cfg(test)]
        #[allow(missing_docs)]
        mod tests { use crate::shape::Surface; mod deeper { } }
        use crate::units;
        "##,
    );
    let found: Vec<String> = source
        .crate_paths()
        .iter()
        .map(|path| path.join("::"))
        .collect();
    assert_eq!(
        found,
        [
            "coil::field",
            "coil::bundle::npz",
            "coil::numerics",
            "coil::circuit::g",
            "coil::mutual",
            "coil::limits::inner::k",
            "map::m",
            "coil::units",
        ]
    );
    assert!(source.has("mod inner {") && !source.has("mod tests"));
}
