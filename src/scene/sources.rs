//! The documents that a command reads, with their entries among the inputs.

use std::collections::BTreeSet;

use crate::RunError;
use crate::bundle::artefact::Input;
use crate::design::Design;
use crate::shape::document::ShapeDocument;

/// The design, its text and its entry among the inputs.
#[derive(Debug, Clone, Copy)]
pub struct DesignSource<'a> {
    /// Validated.
    pub design: &'a Design,
    /// The file's text, which every bundle keeps.
    pub text: &'a str,
    /// Path as given, digest.
    pub input: &'a Input,
}

/// One shape and the entry of its document among the inputs, if it is a file.
#[derive(Debug, Clone)]
pub struct ShapeSource {
    /// Validated.
    pub document: ShapeDocument,
    /// Path as given, digest; `None` for a surface given with flags.
    pub input: Option<Input>,
}

/// Refuses shapes whose results could not be kept apart.
///
/// # Errors
/// Two shapes of one name.
pub fn check_names(shapes: &[ShapeSource]) -> Result<(), RunError> {
    let mut names = BTreeSet::new();
    match shapes.iter().find(|s| !names.insert(&s.document.name)) {
        None => Ok(()),
        Some(shape) => Err(RunError::Input(format!(
            "two shapes are called {:?}, and results go by that; rename one",
            shape.document.name
        ))),
    }
}

/// How points are chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sampling {
    /// Until bilinear patches between them lie within a deviation.
    Adaptive {
        /// The vertical deviation, m.
        max_deviation_m: f64,
        /// No patch is wider than this, m; `None`: what the purpose needs.
        widest_m: Option<f64>,
    },
    /// At random, no two nearer than a spacing.
    Poisson {
        /// The spacing in plan, m.
        spacing_m: f64,
        /// Decides which points are chosen.
        seed: u64,
    },
}
