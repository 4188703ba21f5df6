//! The native half of the Python package `fluxform`: runs commands and hands over arrays.
//!
//! A command runs here exactly as in the program, by its own arguments; its one result crosses as
//! JSON. Arrays that a loop asks for (fields, maps, currents) cross as numpy arrays that take over
//! the memory of what was computed. The Python half, `src/python/fluxform`, gives both their names.

use std::ffi::OsString;
use std::path::PathBuf;

// For its features alone (`Cargo.toml`).
#[cfg(feature = "tests")]
use jsonschema as _;
use numpy::ndarray::{Array, IntoDimension};
use numpy::{IntoPyArray, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use fluxform::cli::failure::Failure;
use fluxform::commands::map::tabulated;
use fluxform::commands::probe::{ProbeRequest, ProbeTable, probe};
use fluxform::design::{Design, InvalidDocument, Need, source};
use fluxform::field::components::Components;

mod bundle;
mod failure;
mod job;

use failure::raised;
use job::Job;

/// Rows of x, y and z, m.
type Points<'py> = PyReadonlyArray2<'py, f64>;
/// A document in memory with its name.
type Document = (PathBuf, String);

fn positions(points: &Points) -> Vec<[f64; 3]> {
    let points = points.as_array();
    let row = |row: numpy::ndarray::ArrayView1<f64>| [row[0], row[1], row[2]];
    points.rows().into_iter().map(row).collect()
}

/// A numpy array of `shape` that takes over `values`.
fn array<'py, T: numpy::Element, D: IntoDimension>(
    py: Python<'py>,
    values: Vec<T>,
    shape: D,
) -> Bound<'py, PyAny> {
    let values = Array::from_vec(values).into_shape_with_order(shape);
    values
        .expect("as many values as the shape holds")
        .into_pyarray(py)
        .into_any()
}

/// Runs the program with `arguments` as its process does and returns the exit code.
#[pyfunction]
fn program(py: Python, arguments: Vec<OsString>) -> u8 {
    py.detach(|| fluxform::commands::main(arguments.into_iter()).code())
}

/// Runs a command: its result as JSON, its summary, and the data that it prints.
#[pyfunction]
#[pyo3(signature = (arguments, given, progress))]
fn run<'py>(
    py: Python<'py>,
    arguments: Vec<OsString>,
    given: Vec<Document>,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Bound<'py, PyBytes>, String, Bound<'py, PyBytes>)> {
    let (captured, ran) = Job::new(progress).wait(py, move |watch, _| {
        fluxform::commands::captured(&arguments, given, watch)
    })?;
    match ran {
        Ok(()) => Ok((
            PyBytes::new(py, &captured.json),
            captured.text,
            PyBytes::new(py, &captured.data),
        )),
        Err(failure) => Err(raised(py, &failure, Some(&captured))),
    }
}

/// The design of a document, its faults raised.
fn design(py: Python, (name, text): Document, need: Need) -> PyResult<Design> {
    let read = Design::from_toml(&text, &name, need);
    read.map(|(design, _)| design)
        .map_err(|document| invalid(py, document))
}

fn invalid(py: Python, document: InvalidDocument) -> PyErr {
    raised(py, &Failure::Documents(vec![document]), None)
}

/// The text of a design or shape in the file `path`; why it cannot be read is raised.
#[pyfunction]
fn text_of(py: Python, path: PathBuf) -> PyResult<String> {
    py.detach(|| source::text_of(&path))
        .map_err(|document| invalid(py, document))
}

/// Reads a design and returns its name; every fault is raised.
#[pyfunction]
fn check_design(py: Python, document: Document) -> PyResult<String> {
    let need = Need {
        coil: false,
        ..Need::PROBE
    };
    design(py, document, need).map(|design| design.name)
}

/// Field and gradient per ampere of every coil at points, `[point, coil, ...]`; the forces on the
/// magnet too, where requested.
#[pyfunction]
#[pyo3(signature = (document, points, force, tolerance, progress))]
fn fields<'py>(
    py: Python<'py>,
    document: Document,
    points: Points<'py>,
    force: bool,
    tolerance: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let design = design(py, document, Need::PROBE)?;
    let request = ProbeRequest {
        force,
        tolerance,
        ..ProbeRequest::default()
    };
    let points_m = positions(&points);
    let rows = points_m.len();
    let table = Job::new(progress).result(py, move |progress| {
        probe(&design, points_m, request, progress)
    })?;
    probed(py, rows, &table)
}

fn probed<'py>(py: Python<'py>, rows: usize, table: &ProbeTable) -> PyResult<Bound<'py, PyDict>> {
    let coils = table.coils();
    let (mut field, mut gradient): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for (point, coil) in (0..rows).flat_map(|point| (0..coils).map(move |coil| (point, coil))) {
        let at = table.field(point, coil);
        field.extend(at.field_t_per_a);
        gradient.extend(at.gradient_t_per_m_per_a.as_flattened());
    }
    let arrays = PyDict::new(py);
    arrays.set_item("field_t_per_a", array(py, field, (rows, coils, 3)))?;
    let tensors = array(py, gradient, (rows, coils, 3, 3));
    arrays.set_item("gradient_t_per_m_per_a", tensors)?;
    if !table.forces().is_empty() {
        let part = |from: usize| {
            let parts = table.forces().iter().flat_map(|all| &all[from..from + 3]);
            array(py, parts.copied().collect(), (rows, coils, 3))
        };
        arrays.set_item("force_n_per_a", part(0))?;
        arrays.set_item("torque_n_m_per_a", part(3))?;
    }
    arrays.set_item("relative_error", table.relative_error)?;
    Ok(arrays)
}

/// The maps of a design over its workspace, `[coil, z, y, x, ...]`.
#[pyfunction]
#[pyo3(signature = (document, components, tolerance, progress))]
fn tabulate<'py>(
    py: Python<'py>,
    document: Document,
    components: &str,
    tolerance: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let design = design(py, document, Need::MAP)?;
    let components: Components = components.parse().map_err(|_| {
        let names = Components::ALL.iter().map(|one| one.name());
        let names: Vec<&str> = names.collect();
        let message = format!(
            "invalid components {components:?}: one of {}",
            names.join(", ")
        );
        raised(py, &Failure::Usage(message), None)
    })?;
    let made = Job::new(progress).result(py, move |progress| {
        tabulated(&design, components, tolerance, progress)
    })?;
    let map = made.map;
    let shape = (map.coils.len(), map.z_m.len(), map.y_m.len(), map.x_m.len());
    let (coils, nz, ny, nx) = shape;
    let arrays = PyDict::new(py);
    for (key, nodes) in [("x_m", map.x_m), ("y_m", map.y_m), ("z_m", map.z_m)] {
        arrays.set_item(key, nodes.into_pyarray(py))?;
    }
    let numbers: Vec<i64> = map.coils.iter().map(|coil| *coil as i64).collect();
    arrays.set_item("coil", numbers.into_pyarray(py))?;
    arrays.set_item("gz_t_per_m_per_a", array(py, map.gz_t_per_m_per_a, shape))?;
    if let Some([x, y]) = made.sides {
        arrays.set_item("gx_t_per_m_per_a", array(py, x, shape))?;
        arrays.set_item("gy_t_per_m_per_a", array(py, y, shape))?;
    }
    if let Some(gradient) = map.gradient_t_per_m_per_a {
        let gradient = array(py, gradient, (coils, nz, ny, nx, 3, 3));
        arrays.set_item("gradient_t_per_m_per_a", gradient)?;
    }
    if let Some(field) = map.field_t_per_a {
        arrays.set_item("field_t_per_a", array(py, field, (coils, nz, ny, nx, 3)))?;
    }
    arrays.set_item("relative_error", map.relative_error)?;
    Ok(arrays)
}

/// The native half of `fluxform`.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::bundle::Bundle;
    #[pymodule_export]
    use super::{check_design, fields, program, run, tabulate, text_of};
}
