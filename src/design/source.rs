//! Reading a document's text from a file or a stream, bounded in size.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::diagnostics::{Fault, InvalidDocument, place_of};
use super::named_file::{self, NamedFileError};

/// Largest document that is read, bytes (4 MiB): several times what ten thousand coils need.
pub(crate) const DOCUMENT_MAX_BYTES: u64 = 4 << 20;

/// Kinds of text, for the messages about one that cannot be read.
#[derive(Debug, Clone, Copy)]
struct Kind {
    too_large: &'static str,
    not_utf8: &'static str,
}

const DOCUMENT: Kind = Kind {
    too_large: "is this the TOML document, or the surface itself?",
    not_utf8: "save the file as UTF-8; a surface needs its own ending (.stl, .obj, ...)",
};

const TABLE: Kind = Kind {
    too_large: "is this the table?",
    not_utf8: "save the table as text: CSV in UTF-8",
};

/// The text of the document at `path`.
///
/// # Errors
/// A missing file, a directory, a file over 4 MiB or not in UTF-8, or what the system says.
pub fn text_of(path: &Path) -> Result<String, InvalidDocument> {
    let refuse = |fault| InvalidDocument::unreadable(path, fault);
    // A file named by a person may be a pipe.
    if fs::metadata(path).is_ok_and(|found| found.is_dir()) {
        let fault = Fault::error("", "expected a TOML file, found a directory");
        return Err(refuse(fault.help("name the file inside it")));
    }
    let file = File::open(path).map_err(|error| refuse(cannot_read(&error)))?;
    text_from(file, path)
}

/// The text of the CSV table at `path`, which a document names.
///
/// # Errors
/// Anything but a regular file of at most 4 MiB ([`named_file`]) in UTF-8.
pub fn table_text_of(path: &Path) -> Result<String, InvalidDocument> {
    let read = named_file::read(path, DOCUMENT_MAX_BYTES).map_err(|error| not_a_table(&error));
    read.and_then(|bytes| text_of_bytes(bytes, TABLE))
        .map_err(|fault| InvalidDocument::unreadable(path, fault))
}

fn not_a_table(error: &NamedFileError) -> Fault {
    let expected = || Fault::error("", format!("expected a CSV table, {error}"));
    match error {
        NamedFileError::Unreadable(error) => cannot_read(error),
        NamedFileError::Folder => expected().help("name the file inside it"),
        NamedFileError::NotRegular => expected().help("name a plain file"),
        NamedFileError::NoLength => {
            expected().help("begin with the line b_t,h_a_per_m, then one row a point")
        }
        NamedFileError::OtherLength => expected().help("name a file on a disk"),
        NamedFileError::TooLarge(_) => Fault::error("", error.to_string()).help(TABLE.too_large),
    }
}

/// The text of the document that `stream` yields; messages call it `path` (`-` for stdin).
///
/// # Errors
/// A document over 4 MiB or not in UTF-8, or what the system says.
pub fn text_from(stream: impl Read, path: &Path) -> Result<String, InvalidDocument> {
    let mut bytes = Vec::new();
    let read = stream.take(DOCUMENT_MAX_BYTES + 1).read_to_end(&mut bytes);
    read.map_err(|error| cannot_read(&error))
        .and_then(|_| text_of_bytes(bytes, DOCUMENT))
        .map_err(|fault| InvalidDocument::unreadable(path, fault))
}

fn text_of_bytes(bytes: Vec<u8>, kind: Kind) -> Result<String, Fault> {
    if bytes.len() as u64 > DOCUMENT_MAX_BYTES {
        let message = format!("the file is larger than {DOCUMENT_MAX_BYTES} bytes");
        return Err(Fault::error("", message).help(kind.too_large));
    }
    String::from_utf8(bytes).map_err(|error| not_utf8(&error, kind))
}

fn cannot_read(error: &io::Error) -> Fault {
    let fault = Fault::error("", format!("cannot read the file: {error}"));
    match error.kind() {
        io::ErrorKind::NotFound => fault.help("check the path"),
        io::ErrorKind::PermissionDenied => fault.help("allow reading it"),
        _ => fault,
    }
}

fn not_utf8(error: &std::string::FromUtf8Error, kind: Kind) -> Fault {
    let good = error.utf8_error().valid_up_to();
    let text = String::from_utf8_lossy(&error.as_bytes()[..good]);
    let place = place_of(&text, good);
    let byte = error.as_bytes()[good];
    let message = format!(
        "the text is not UTF-8: byte 0x{byte:02x} at line {}, column {}",
        place.line, place.column
    );
    Fault::error("", message).help(kind.not_utf8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(bytes: &[u8]) -> String {
        text_from(bytes, Path::new("-")).unwrap_err().to_string()
    }

    #[test]
    fn bytes_that_are_no_text_are_placed() {
        let said = refusal(b"name = \"a\"\nb = \"\xc3\xa9\xff\"\n");
        assert!(
            said.starts_with("-: error: the text is not UTF-8: byte 0xff at line 2, column 7"),
            "{said}"
        );
    }

    #[test]
    fn an_endless_stream_is_cut_off() {
        let said = text_from(io::repeat(b'#'), Path::new("-"))
            .unwrap_err()
            .to_string();
        assert!(said.contains("larger than 4194304 bytes"), "{said}");
    }

    #[test]
    fn a_directory_and_a_missing_file_are_named() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        assert!(
            text_of(folder)
                .unwrap_err()
                .to_string()
                .contains("found a directory")
        );
        let missing = folder.join("no_such_design.toml");
        let said = text_of(&missing).unwrap_err().to_string();
        assert!(
            said.contains("no_such_design.toml: error: cannot read the file"),
            "{said}"
        );
        assert!(said.ends_with("(check the path)"), "{said}");
    }
}
