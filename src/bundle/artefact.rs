//! Record that every artefact carries: versions, inputs, files.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read};
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::atomic::Written;
use super::json::to_json;

/// Version of the artefacts' layout, `major.minor.patch`. A reader refuses another major; a new
/// minor only adds keys, arrays or files.
pub const SCHEMA_VERSION: &str = "1.4.0";

/// Version of the program that wrote an artefact.
pub const FLUXFORM_VERSION: &str = env!("CARGO_PKG_VERSION");

/// The sentence on units that every artefact carries.
pub const UNITS: &str = "SI throughout; the unit of every number stands in its key, column or array name (m, A, T, N, ohm)";

/// Files are hashed in blocks of this size.
const BLOCK_BYTES: usize = 64 << 10;

/// A file that went into an artefact.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Input {
    /// As given on the command line.
    pub path: String,
    /// SHA-256 of its bytes, 64 lower-case hexadecimal digits.
    pub sha256: String,
}

impl Input {
    /// An input of these bytes.
    #[must_use]
    pub fn of_bytes(path: impl Into<String>, bytes: &[u8]) -> Self {
        Self {
            path: path.into(),
            sha256: sha256_hex(bytes),
        }
    }
}

/// Longer names are none.
pub(crate) const NAME_BYTES: usize = 4096;

/// Whether a record may hold this name of a design, a shape or an input: names are printed for people and on
/// terminals.
pub(crate) fn is_name(name: &str) -> bool {
    name.len() <= NAME_BYTES && !name.chars().any(char::is_control)
}

/// Whether an input at `path` can be named in a record and found again by that name.
#[must_use]
pub fn is_nameable(path: &Path) -> bool {
    path.to_str().is_some_and(is_name)
}

/// The digest of an input whose bytes arrive in pieces.
#[derive(Debug, Clone, Default)]
pub struct InputDigest(sha2::Sha256);

impl InputDigest {
    /// Adds bytes.
    pub fn update(&mut self, bytes: &[u8]) {
        sha2::Digest::update(&mut self.0, bytes);
    }

    /// The input of all bytes since it was made.
    #[must_use]
    pub fn input(self, path: impl Into<String>) -> Input {
        Input {
            path: path.into(),
            sha256: super::atomic::hex(&sha2::Digest::finalize(self.0)),
        }
    }
}

/// A file that belongs to an artefact.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FileEntry {
    /// Relative to the folder of the file that lists it, `/` between folders.
    pub path: String,
    /// Size.
    pub bytes: u64,
    /// SHA-256 of its bytes, 64 lower-case hexadecimal digits.
    pub sha256: String,
}

impl FileEntry {
    /// The file that was written at `path`.
    #[must_use]
    pub fn new(path: impl Into<String>, written: Written) -> Self {
        Self {
            path: path.into(),
            bytes: written.bytes,
            sha256: written.sha256,
        }
    }
}

/// The options of a run by name, the unit in the name, as its record states them in `made_with`: with
/// the inputs they decide what is written.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Options(BTreeMap<String, Value>);

impl Options {
    /// In `made_with`, but no reason to refuse: the platform, the digest of the others, and whether pages
    /// are written too.
    const NOT_COMPARED: [&str; 3] = ["arithmetic", "sha256", "report"];

    /// The fields of `options` by name; none where it is no struct, or holds a number that is not finite.
    #[must_use]
    pub fn of<T: Serialize + ?Sized>(options: &T) -> Self {
        let text = to_json(options).unwrap_or_default();
        serde_json::from_slice(&text).unwrap_or_default()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The options that `now` has otherwise, in words; `None` where there are none.
    #[must_use]
    pub fn difference(&self, now: &Self) -> Option<String> {
        let names: BTreeSet<&String> = self.0.keys().chain(now.0.keys()).collect();
        let compared = |name: &&String| !Self::NOT_COMPARED.contains(&name.as_str());
        let mut all = Vec::new();
        for name in names.into_iter().filter(compared) {
            let [was, is] = [self, now].map(|options| options.0.get(name).unwrap_or(&Value::Null));
            add_differences(name, was, is, &mut all);
        }
        (!all.is_empty()).then(|| all.join("; "))
    }
}

/// What differs of an option, member by member.
fn add_differences(name: &str, was: &Value, is: &Value, all: &mut Vec<String>) {
    match (was, is) {
        (Value::Object(was), Value::Object(is)) => {
            let names: BTreeSet<&String> = was.keys().chain(is.keys()).collect();
            for member in names {
                let [was, is] =
                    [was, is].map(|members| members.get(member).unwrap_or(&Value::Null));
                add_differences(&format!("{name}.{member}"), was, is, all);
            }
        }
        _ if was != is => all.push(format!("{name} {}, now {}", shown(was), shown(is))),
        _ => {}
    }
}

/// The value of an option in a message.
fn shown(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = match value {
        Value::Null => "not given".to_owned(),
        value => value.to_string(),
    };
    if text.chars().count() <= LONGEST {
        return text;
    }
    let start: String = text.chars().take(LONGEST).collect();
    format!("{start}...")
}

/// Platform and instructions of this program: with others the last bits of results differ.
#[must_use]
pub fn arithmetic() -> String {
    format!(
        "{} {}, {}",
        std::env::consts::ARCH,
        std::env::consts::OS,
        fluxform_numerics::dispatch::instructions()
    )
}

/// SHA-256 of `bytes`, 64 lower-case hexadecimal digits.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    use sha2::{Digest, Sha256};
    super::atomic::hex(&Sha256::digest(bytes))
}

/// SHA-256 and size of a stream, read block by block: the memory does not grow with it.
///
/// # Errors
/// The reader's.
pub(crate) fn sha256_of(mut stream: impl Read) -> io::Result<(u64, String)> {
    use sha2::{Digest, Sha256};
    let mut digest = Sha256::new();
    let mut block = vec![0; BLOCK_BYTES];
    let mut bytes = 0;
    loop {
        match stream.read(&mut block) {
            Ok(0) => return Ok((bytes, super::atomic::hex(&digest.finalize()))),
            Ok(read) => {
                digest.update(&block[..read]);
                bytes += read as u64;
            }
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

/// The three numbers of a schema version; `None` when it is not `major.minor.patch`.
#[must_use]
pub(crate) fn parse_version(version: &str) -> Option<[u32; 3]> {
    let mut parts = version.split('.').map(|part| part.parse().ok());
    let numbers = [parts.next()??, parts.next()??, parts.next()??];
    parts.next().is_none().then_some(numbers)
}

/// Whether this program reads artefacts of that schema version.
///
/// # Errors
/// The end of a sentence that begins with what holds the version.
pub(crate) fn check_version(version: &str) -> Result<(), String> {
    let ours = parse_version(SCHEMA_VERSION).unwrap_or_default()[0];
    match parse_version(version) {
        None => Err(format!("{version:?} is not of the form major.minor.patch")),
        Some([major, ..]) if major == ours => Ok(()),
        Some([major, ..]) if major > ours => Err(format!(
            "{version} is newer than this program, which reads {ours}.x; update fluxform"
        )),
        Some(_) => Err(format!(
            "{version} is older than this program, which reads {ours}.x; make the artefact again"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::{Options, check_version, parse_version};
    use serde_json::json;

    #[test]
    fn options_that_differ_are_named_and_the_platform_is_none() {
        let of = |jnd: f64, arithmetic: &str| {
            Options::of(&json!({ "jnd": jnd, "tolerance": null, "arithmetic": arithmetic }))
        };
        assert_eq!(of(0.07, "x86").difference(&of(0.07, "arm")), None);
        let reported = of(0.07, "x86").difference(&of(7.0, "x86"));
        assert_eq!(reported.as_deref(), Some("jnd 0.07, now 7.0"));
        let none = Options::default();
        let reported = none.difference(&of(0.7, "x86"));
        assert_eq!(reported.as_deref(), Some("jnd not given, now 0.7"));
        assert!(Options::of(&f64::NAN).is_empty());
    }

    #[test]
    fn another_major_is_refused_another_minor_is_read() {
        assert_eq!(parse_version("1.20.3"), Some([1, 20, 3]));
        for bad in ["", "1", "1.2", "1.2.3.4", "1.x.0", "-1.0.0"] {
            assert_eq!(parse_version(bad), None, "{bad}");
        }
        assert_eq!(check_version("1.7.3"), Ok(()));
        assert!(check_version("2.0.0").unwrap_err().contains("newer"));
        assert!(check_version("0.9.0").unwrap_err().contains("older"));
    }

    #[test]
    fn regression_options_with_members_differed_only_in_that_they_did() {
        let of = |translate_mm: f64| {
            let text = format!(
                r#"{{"surface": {{"path": "a long name of a folder and a file.obj", "translate_mm": [0, 0, {translate_mm}], "unit": "mm"}}}}"#
            );
            serde_json::from_str::<Options>(&text).unwrap()
        };
        let reported = of(5.0).difference(&of(6.5));
        assert_eq!(
            reported.unwrap(),
            "surface.translate_mm [0,0,5], now [0,0,6.5]"
        );
    }
}
