//! Meshes, grids and documents for the tests of surfaces.

use std::path::Path;

use fluxform_base::progress::Silent;
use fluxform_numerics::axis::Axis;
use fluxform_shape::bodies::BodyOptions;
use fluxform_shape::document::{AxisRequest, GridRequest, Placement, ShapeDocument, SurfaceSource};
use fluxform_shape::file_mesh::{FileMesh, Triangle};
use fluxform_shape::height::{Grid, Sample, heights};
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;

pub fn binary(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for c in triangle.as_flattened() {
            bytes.extend(c.to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

/// A mesh in metres whose numbers are exact.
pub fn exact(triangles: Vec<Triangle>) -> Mesh {
    let file = FileMesh {
        triangles,
        ..FileMesh::default()
    };
    Mesh::place(file, &Transform::new(1.0, &Placement::default())).unwrap()
}

pub fn grid(x: (f64, f64, usize), y: (f64, f64, usize)) -> Grid {
    let axis = |(from, to, samples)| Axis { from, to, samples };
    Grid {
        x_m: axis(x),
        y_m: axis(y),
    }
}

pub fn sample(mesh: &Mesh, grid: &Grid) -> Vec<Option<Sample>> {
    heights(mesh, grid, &Silent).unwrap()
}

pub fn seed_grid() -> GridRequest {
    let axis = AxisRequest::Given(Axis {
        from: -0.05,
        to: 0.05,
        samples: 61,
    });
    GridRequest { x: axis, y: axis }
}

pub fn file(path: &Path, unit_m: f64, placement: Placement, grid: GridRequest) -> ShapeDocument {
    ShapeDocument {
        force: Default::default(),
        name: "test".into(),
        source: SurfaceSource::File {
            path: path.into(),
            unit_m: Some(unit_m),
        },
        bodies: BodyOptions::default(),
        scale: [1.0; 3],
        placement,
        grid,
        weights: None,
        direction_jnd_deg: fluxform_base::units::DIRECTION_JND_DEG,
        grid_is_given: true,
    }
}

pub fn lifted(z_m: f64) -> Placement {
    Placement {
        translate_m: [0.0, 0.0, z_m],
        rotate_deg: [0.0; 3],
        ..Placement::default()
    }
}

/// Height of the triangle's plane over a point strictly inside it, by Cramer's rule.
pub fn plane_height(t: &Triangle, p: [f64; 2]) -> Option<f64> {
    let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|c| t[k][c] - t[0][c]));
    let d = [p[0] - t[0][0], p[1] - t[0][1]];
    let whole = u[0] * v[1] - u[1] * v[0];
    let (s, r) = (
        (d[0] * v[1] - d[1] * v[0]) / whole,
        (u[0] * d[1] - u[1] * d[0]) / whole,
    );
    (s > 0.0 && r > 0.0 && s + r < 1.0).then(|| t[0][2] + s * u[2] + r * v[2])
}
