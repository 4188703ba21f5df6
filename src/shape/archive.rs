//! ZIP archives of untrusted origin: what is unpacked is bounded by the archive's own length.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{Cursor, Read};

use zip::ZipArchive;

use crate::read_error::{Place, ReadError};
use crate::text::narrow;

/// So many bytes may be unpacked from any archive,
const LEAST_BUDGET: u64 = 8 << 20;
/// or so many times its length: XML of meshes shrinks to a tenth, at the most to a fiftieth,
const MOST_RATIO: u64 = 100;
/// but never more.
const MOST_BUDGET: u64 = 4 << 30;
/// So many times the archive's length is reserved on the word of its directory.
const RESERVED_RATIO: u64 = 8;

/// An opened archive and how much may yet be unpacked from it.
pub(super) struct Archive<'a> {
    zip: ZipArchive<Cursor<&'a [u8]>>,
    /// The parts' own names by those under which they are looked for.
    names: HashMap<String, String>,
    length: u64,
    left: u64,
}

impl<'a> Archive<'a> {
    /// True for bytes that begin as archives do.
    pub(super) fn is(bytes: &[u8]) -> bool {
        bytes.starts_with(b"PK\x03\x04")
    }

    /// True for an archive with a part whose name, in lower case, ends so.
    pub(super) fn has(bytes: &[u8], ending: &str) -> bool {
        Self::is(bytes)
            && Archive::open(bytes).is_ok_and(|archive| {
                let mut names = archive.names();
                names.any(|name| name.to_ascii_lowercase().ends_with(ending))
            })
    }

    /// Opens a file's bytes.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, ReadError> {
        let length = bytes.len() as u64;
        let zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            let what = format!("the ZIP archive is damaged or was cut short: {error}");
            ReadError::file(what)
        })?;
        let mut names = HashMap::new();
        for name in zip.file_names().flatten().map(Cow::into_owned) {
            names.entry(sought(&name)).or_insert(name);
        }
        Ok(Self {
            zip,
            names,
            length,
            left: (length * MOST_RATIO).clamp(LEAST_BUDGET, MOST_BUDGET),
        })
    }

    /// The name under which a part is kept: `requested` in any case, without a leading slash.
    pub(super) fn find(&self, requested: &str) -> Option<String> {
        self.names.get(&sought(requested)).cloned()
    }

    /// The names of all parts that have one.
    pub(super) fn names(&self) -> impl Iterator<Item = String> {
        self.zip.file_names().flatten().map(Cow::into_owned)
    }

    /// Unpacks one part as text in UTF-8.
    pub(super) fn text(&mut self, name: &str) -> Result<String, ReadError> {
        let fault = |what: String| ReadError::new(Place::Part(name.to_owned(), 0), what);
        let mut part = self
            .zip
            .by_name(name)
            .map_err(|error| fault(format!("it cannot be unpacked: {error}")))?;
        let claimed = part.size();
        if claimed > self.left {
            return Err(fault(format!(
                "the archive unpacks to far more than its {} bytes can stand for: it is refused \
                 as a decompression bomb",
                self.length
            )));
        }
        let reserved = claimed.min(RESERVED_RATIO * self.length);
        let mut bytes = Vec::with_capacity(usize::try_from(reserved).unwrap_or(0));
        // The unpacker refuses data beyond the stated size.
        let read = part.read_to_end(&mut bytes);
        read.map_err(|error| fault(format!("it cannot be unpacked: {error}")))?;
        self.left -= claimed;
        text_of(bytes).map_err(fault)
    }
}

/// How a part's name is looked for.
fn sought(name: &str) -> String {
    name.trim_start_matches('/').to_ascii_lowercase()
}

/// XML's bytes as text, without a byte-order mark.
pub(super) fn text_of(bytes: Vec<u8>) -> Result<String, String> {
    let bytes = match narrow(&bytes) {
        Cow::Owned(narrowed) => narrowed,
        Cow::Borrowed(_) => bytes,
    };
    let mut text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        format!("the XML is not in UTF-8 (byte {at}); save it in UTF-8")
    })?;
    if text.starts_with('\u{feff}') {
        text.remove(0);
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use zip::ZipWriter;
    use zip::write::SimpleFileOptions;

    use super::*;

    #[test]
    fn parts_share_one_budget() {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for name in ["a", "b"] {
            zip.start_file(name, SimpleFileOptions::default()).unwrap();
            zip.write_all(&vec![b' '; 5 << 20]).unwrap();
        }
        let bytes = zip.finish().unwrap().into_inner();
        let mut archive = Archive::open(&bytes).unwrap();
        assert_eq!(archive.text("a").unwrap().len(), 5 << 20);
        let refused = archive.text("b").unwrap_err().to_string();
        assert!(refused.contains("decompression bomb"), "{refused}");
    }
}
