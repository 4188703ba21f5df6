//! Lines of a text and their words, without assuming an encoding.

/// A line, without its end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line<'a> {
    /// Its number, from 1.
    pub(super) number: usize,
    bytes: &'a [u8],
    /// The text after it, for a line that is continued with a backslash.
    rest: &'a [u8],
}

impl<'a> Line<'a> {
    /// Its words up to a `#`; a backslash at the end of a line goes on with the next.
    pub(super) fn words(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let (mut bytes, mut rest) = (self.bytes, self.rest);
        std::iter::from_fn(move || {
            loop {
                let from = bytes.iter().position(|b| *b > b' ').unwrap_or(bytes.len());
                let text = &bytes[from..];
                let length = text.iter().position(|b| *b <= b' ').unwrap_or(text.len());
                let (word, after) = text.split_at(length);
                match word {
                    b"\\" if after.iter().all(|b| *b <= b' ') => (bytes, rest) = split(rest),
                    [] | [b'#', ..] => return None,
                    word => {
                        bytes = after;
                        return Some(word);
                    }
                }
            }
        })
    }

    /// True where the next line belongs to this one.
    fn goes_on(&self) -> bool {
        let end = self.bytes.trim_ascii_end();
        let marked = end == b"\\" || end.ends_with(b" \\") || end.ends_with(b"\t\\");
        // A comment ends with its line.
        marked && !end.split(|b| *b <= b' ').any(|word| word.starts_with(b"#"))
    }
}

/// The first line of `bytes`, and what comes after its end (LF, CR or CRLF).
fn split(bytes: &[u8]) -> (&[u8], &[u8]) {
    let end = bytes
        .iter()
        .position(|b| matches!(b, b'\n' | b'\r'))
        .unwrap_or(bytes.len());
    let (line, rest) = bytes.split_at(end);
    let length = usize::from(!rest.is_empty()) + usize::from(rest.starts_with(b"\r\n"));
    (line, &rest[length..])
}

/// The lines of a text one after the other.
pub(super) struct Lines<'a> {
    rest: &'a [u8],
    number: usize,
}

impl<'a> Lines<'a> {
    /// Lines of `bytes`, after a byte-order mark.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self {
            rest: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes),
            number: 0,
        }
    }

    /// The next line with what continues it.
    pub(super) fn next_line(&mut self) -> Option<Line<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let (bytes, rest) = split(self.rest);
        self.number += 1;
        let line = Line {
            number: self.number,
            bytes,
            rest,
        };
        self.rest = rest;
        let mut last = line;
        while last.goes_on() && !self.rest.is_empty() {
            let (bytes, rest) = split(self.rest);
            self.number += 1;
            self.rest = rest;
            last = Line { bytes, ..last };
        }
        Some(line)
    }
}
