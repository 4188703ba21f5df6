//! The bodies of a file: their names, and which of them are read.

use serde::Serialize;

/// How the bodies of a file are cut into facets, and which.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct BodyOptions {
    /// The farthest that a facet may lie from its face, m; `None`: a 4000th of the diagonal of the
    /// box of the bodies.
    pub chord_m: Option<f64>,
    /// The body that is read, by its number from 1 or its name; `None`: all of them.
    pub body: Option<String>,
}

impl BodyOptions {
    /// Whether nothing was requested.
    #[must_use]
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// A body that a file names.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedBody {
    /// Its name, or that of its part; empty where the file has none.
    pub name: String,
    /// Names of the assemblies that hold it, the outermost first.
    pub within: Vec<String>,
    /// Red, green and blue, 0 to 1, where the file has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub color: Option<[f64; 3]>,
    /// Its triangles.
    pub triangles: usize,
}
