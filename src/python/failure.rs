//! Failures as Python's exceptions.

use pyo3::prelude::*;
use pyo3::types::PyBytes;

use fluxform::cli::code::Code;
use fluxform::cli::failure::{ErrorObject, Failure};
use fluxform::cli::shell::Captured;

/// The exception for `failure`, with the result that was computed before it.
pub(crate) fn raised(py: Python, failure: &Failure, captured: Option<&Captured>) -> PyErr {
    // Nobody closes a pipe here.
    let code = failure.code().unwrap_or(Code::Output);
    exception(
        py,
        &ErrorObject::of(failure, code, Vec::new(), None),
        captured,
    )
}

/// The exception for an internal error.
pub(crate) fn internal(py: Python, message: &str) -> PyErr {
    exception(py, &ErrorObject::internal(message), None)
}

fn exception(py: Python, object: &ErrorObject, captured: Option<&Captured>) -> PyErr {
    let json = captured.map_or(&[][..], |captured| &captured.json);
    let text = captured.map_or("", |captured| &captured.text);
    let made = py.import("fluxform._errors").and_then(|errors| {
        let arguments = (object.line(), PyBytes::new(py, json), text);
        errors.getattr("of_json")?.call1(arguments)
    });
    made.map_or_else(|error| error, PyErr::from_value)
}
