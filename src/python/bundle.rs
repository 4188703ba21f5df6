//! A bundle as a runtime uses it, over arrays of positions.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use numpy::PyReadonlyArray2;
use pyo3::prelude::*;

use fluxform::bundle::replay::Answer;
use fluxform::cli::failure::Failure;
use fluxform::commands::replay::Opened;

use super::failure::raised;
use super::{array, positions};

/// A bundle in memory, its checksums checked.
#[pyclass(frozen)]
pub(crate) struct Bundle {
    opened: Mutex<Opened>,
}

#[pymethods]
impl Bundle {
    #[new]
    fn new(py: Python, folder: PathBuf) -> PyResult<Self> {
        let opened = py.detach(|| Opened::new(&folder));
        let opened = opened.map_err(|error| raised(py, &Failure::Job(error), None))?;
        Ok(Self {
            opened: Mutex::new(opened),
        })
    }

    /// Currents at positions `[point, coil]`, A; the force that they give `[point]` or `[point, axis]`, N;
    /// and whether it is the requested one: 0 yes, 1 the nearest within the limits, 2 outside the map.
    fn currents<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>) {
        let points = positions(&points);
        let (currents, force, answer, coils, axes) = py.detach(|| {
            let renderer = &mut self
                .opened
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .renderer;
            let coils = renderer.coils();
            let axes = if renderer.is_vector() { 3 } else { 1 };
            let mut currents = vec![0.0; points.len() * coils];
            let mut force = Vec::with_capacity(points.len() * axes);
            let mut answer = Vec::with_capacity(points.len());
            for (point, row) in points.iter().zip(currents.chunks_exact_mut(coils)) {
                let step = renderer.step(*point, row);
                force.extend(step.sideways.iter().flat_map(|side| side.force_n));
                force.push(step.force_n);
                answer.push(match step.answer {
                    Answer::Ok => 0_u8,
                    Answer::Saturated => 1,
                    Answer::Outside => 2,
                });
            }
            (currents, force, answer, coils, axes)
        });
        let rows = points.len();
        let force = match axes {
            1 => array(py, force, rows),
            _ => array(py, force, (rows, axes)),
        };
        let currents = array(py, currents, (rows, coils));
        (currents, force, array(py, answer, rows))
    }

    /// Upward force per ampere of every coil, `[point, coil]`, N/A; zero outside the map.
    fn force_per_ampere<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> Bound<'py, PyAny> {
        let points = positions(&points);
        let (force, coils) = py.detach(|| {
            let bundle = &self
                .opened
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .bundle;
            let coils = bundle.coil_count();
            let mut force = vec![0.0; points.len() * coils];
            for (point, row) in points.iter().zip(force.chunks_exact_mut(coils)) {
                bundle.force_per_ampere(*point, row);
            }
            (force, coils)
        });
        array(py, force, (points.len(), coils))
    }

    /// Height of the surface at x and y, m; not a number where there is none.
    fn height<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
    ) -> Bound<'py, PyAny> {
        let opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        let points = points.as_array();
        let height = |row: numpy::ndarray::ArrayView1<f64>| {
            let found = opened.renderer.heights().height_m(row[0], row[1]);
            found.unwrap_or(f64::NAN)
        };
        let heights: Vec<f64> = points.rows().into_iter().map(height).collect();
        let rows = heights.len();
        array(py, heights, rows)
    }
}
