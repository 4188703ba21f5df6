//! What the tests of surfaces share.

use std::path::{Path, PathBuf};

use fluxform_base::progress::Silent;
use fluxform_numerics::axis::Axis;
use fluxform_shape::document::{AxisRequest, GridRequest, Placement, ShapeDocument, SurfaceSource};
use fluxform_shape::height::{Grid, Sample, heights};
use fluxform_shape::mesh::{FileMesh, Mesh, Triangle};
use fluxform_shape::placement::Transform;
use fluxform_shape::step::BodyOptions;

/// A repeatable stream of numbers (splitmix64).
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        let unit = (self.bits() >> 11) as f64 / (1u64 << 53) as f64;
        low + (high - low) * unit
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
}

pub fn root() -> PathBuf {
    // Tests of the member and of the whole program share this file.
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = own.ancestors();
    let top = folders.find(|folder| folder.join("Cargo.lock").is_file());
    top.expect("the repository").to_path_buf()
}

/// The folder of real surface files with their index that `FLUXFORM_CORPUS` names, or `None` with a
/// printed reason.
#[allow(clippy::print_stderr)]
pub fn corpus() -> Option<PathBuf> {
    let folder = std::env::var_os("FLUXFORM_CORPUS").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: FLUXFORM_CORPUS names no folder of real surface files");
    }
    folder
}

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

/// The twelve triangles of a closed box, in order outwards; bit k of a corner's number tells
/// whether it lies at the upper end of axis k.
pub fn box_of<T>(corner: impl Fn(usize) -> T) -> Vec<[T; 3]> {
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let halves = |[a, b, c, d]: [usize; 4]| [[a, b, c], [a, c, d]];
    let triangles = faces.into_iter().flat_map(halves);
    triangles.map(|triangle| triangle.map(&corner)).collect()
}

/// A closed box between two corners.
pub fn block(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
    box_of(|k| [0, 1, 2].map(|axis| [low, high][k >> axis & 1][axis]))
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
        name: "test".into(),
        source: SurfaceSource::File {
            path: path.into(),
            unit_m: Some(unit_m),
        },
        bodies: BodyOptions::default(),
        scale: [1.0; 3],
        placement,
        grid,
    }
}

pub fn lifted(z_m: f64) -> Placement {
    Placement {
        translate_m: [0.0, 0.0, z_m],
        rotate_deg: [0.0; 3],
        ..Placement::default()
    }
}
