//! A smooth surface without symmetry, as a formula and as triangles.

use fluxform::RunError;
use fluxform::numerics::axis::Axis;
use fluxform::shape::document::Placement;
use fluxform::shape::file_mesh::FileMesh;
use fluxform::shape::height::{Grid, Sample};
use fluxform::shape::mesh::Mesh;
use fluxform::shape::placement::Transform;

/// Half the side of the plan that is sampled, m.
pub const HALF_M: f64 = 0.05;
/// Half the side of the triangles' plan: a little more, so that no point lies on its border.
const HALF_MESH_M: f64 = 0.0503;

/// Height of the wave, m.
#[must_use]
pub fn height_m(x_m: f64, y_m: f64) -> f64 {
    0.05 + 0.01 * (90.0 * x_m).sin() * (70.0 * y_m).cos() + 0.003 * (37.0 * (x_m + y_m)).sin()
}

/// Height of a dome, m.
#[must_use]
pub fn dome_m(x_m: f64, y_m: f64) -> f64 {
    0.03 + 0.03 * (-((x_m - 0.007) / 0.04).powi(2) - ((y_m + 0.003) / 0.05).powi(2)).exp()
}

/// Its triangles, `side` squares along either axis, two triangles each.
///
/// # Errors
/// None that this surface can give.
pub fn mesh(side: usize) -> Result<Mesh, RunError> {
    let line = Axis {
        from: -HALF_MESH_M,
        to: HALF_MESH_M,
        samples: side + 1,
    }
    .nodes();
    let at = |i: usize, j: usize| [line[i], line[j], height_m(line[i], line[j])];
    let mut triangles = Vec::with_capacity(2 * side * side);
    for (i, j) in (0..side * side).map(|k| (k % side, k / side)) {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
        triangles.extend([[a, b, d], [a, d, c]]);
    }
    let file = FileMesh {
        triangles,
        ..FileMesh::default()
    };
    Mesh::place(file, &Transform::new(1.0, &Placement::default())).map_err(shape)
}

/// The plan with so many points along either axis.
#[must_use]
pub fn grid(samples: usize) -> Grid {
    let axis = Axis {
        from: -HALF_M,
        to: HALF_M,
        samples,
    };
    Grid {
        x_m: axis,
        y_m: axis,
    }
}

/// The points' heights alone.
#[must_use]
pub fn known(samples: &[Option<Sample>]) -> Vec<Option<f64>> {
    samples.iter().map(|s| s.map(|s| s.height_m)).collect()
}

/// A shape's error as a job's.
pub fn shape(source: fluxform::shape::ShapeError) -> RunError {
    RunError::Shape {
        name: "wave".to_owned(),
        source,
    }
}
