//! Laplace's equation in a box: from the values on its six faces to those inside.
//!
//! The weak form on tensor-product nodal bases is (K M M + M K M + M M K) u = 0 with diagonal
//! masses M. With the generalised eigenvectors of every axis, K V = M V diag(e), V' M V = 1, it
//! is diagonal (Lynch, Rice and Thomas, Numer. Math. 6, 185, 1964), and what the faces give
//! needs two-dimensional transforms only.

use nalgebra::DMatrix;

use super::bounded_eigen::symmetric_eigen;
use super::matrix::{product, transpose};
use super::spectral::Spectral;

/// The solver for one box; values are [z, y, x] at the axes' nodes.
#[derive(Debug, Clone)]
pub struct Laplace {
    /// x, y, z; none for a box without interior nodes.
    axes: Option<[Modes; 3]>,
}

/// The eigenvectors of one axis over its interior nodes, of which there is at least one.
#[derive(Debug, Clone)]
struct Modes {
    inner: usize,
    values: Vec<f64>,
    /// V, [node, mode], and its transpose.
    vectors: Vec<f64>,
    transposed: Vec<f64>,
    /// M V, [node, mode], and its transpose.
    weighted: Vec<f64>,
    weighted_transposed: Vec<f64>,
    /// V' K at the lower and the upper end.
    ends: [Vec<f64>; 2],
}

impl Modes {
    fn new(axis: &Spectral) -> Self {
        let n = axis.len();
        let inner = n - 2;
        let (stiffness, mass) = (axis.stiffness(), axis.mass());
        let root: Vec<f64> = (0..inner).map(|i| mass[i + 1].sqrt()).collect();
        let scaled = DMatrix::from_fn(inner, inner, |i, j| {
            stiffness[(i + 1) * n + j + 1] / (root[i] * root[j])
        });
        let eigen = symmetric_eigen(scaled).expect("an axis of finite nodes has modes");
        let at = |i: usize, a: usize| eigen.eigenvectors[(i, a)];
        let fill = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..inner * inner)
                .map(|place| entry(place / inner, place % inner))
                .collect()
        };
        let vectors = fill(&|i, a| at(i, a) / root[i]);
        let weighted = fill(&|i, a| at(i, a) * root[i]);
        let end = |column: usize| -> Vec<f64> {
            (0..inner)
                .map(|a| {
                    (0..inner)
                        .map(|i| vectors[i * inner + a] * stiffness[(i + 1) * n + column])
                        .sum()
                })
                .collect()
        };
        let ends = [end(0), end(n - 1)];
        Self {
            inner,
            values: eigen.eigenvalues.iter().copied().collect(),
            transposed: transpose(&vectors, inner),
            weighted_transposed: transpose(&weighted, inner),
            vectors,
            weighted,
            ends,
        }
    }
}

impl Laplace {
    /// The solver for the box of three axes.
    #[must_use]
    pub fn new(x: &Spectral, y: &Spectral, z: &Spectral) -> Self {
        let axes = [x, y, z];
        let inside = axes.iter().all(|axis| axis.len() > 2);
        Self {
            axes: inside.then(|| axes.map(Modes::new)),
        }
    }

    /// Fills the interior of `u`, [z, y, x], from its faces. Nothing to do where an axis has
    /// no interior node.
    ///
    /// # Panics
    /// When `u` has another length than the product of the axes' nodes.
    pub fn fill(&self, u: &mut [f64]) {
        let Some([x, y, z]) = &self.axes else {
            return;
        };
        let [mx, my, mz] = [x.inner, y.inner, z.inner];
        let (row, plane) = (mx + 2, (mx + 2) * (my + 2));
        assert_eq!(u.len(), plane * (mz + 2), "one value a node");
        let mut modes = vec![0.0; mx * my * mz];
        for (side, far) in [(0, 0), (1, 1)] {
            let face = |outer: usize, inner: usize, at: &dyn Fn(usize, usize) -> usize| {
                (0..outer * inner)
                    .map(|p| u[at(p / inner + 1, p % inner + 1)])
                    .collect::<Vec<f64>>()
            };
            let on_x = project(
                z,
                y,
                &face(mz, my, &|k, j| k * plane + j * row + far * (mx + 1)),
            );
            let on_y = project(
                z,
                x,
                &face(mz, mx, &|k, i| k * plane + far * (my + 1) * row + i),
            );
            let on_z = project(
                y,
                x,
                &face(my, mx, &|j, i| far * (mz + 1) * plane + j * row + i),
            );
            for (place, line) in modes.chunks_exact_mut(mx).enumerate() {
                let (c, b) = (place / my, place % my);
                for (a, mode) in line.iter_mut().enumerate() {
                    *mode -= x.ends[side][a] * on_x[place]
                        + y.ends[side][b] * on_y[c * mx + a]
                        + z.ends[side][c] * on_z[b * mx + a];
                }
            }
        }
        for (place, line) in modes.chunks_exact_mut(mx).enumerate() {
            let sum = z.values[place / my] + y.values[place % my];
            for (mode, value) in line.iter_mut().zip(&x.values) {
                *mode /= sum + value;
            }
        }
        let mut other = vec![0.0; modes.len()];
        product(&modes, &x.transposed, mx, &mut other);
        for (from, to) in other
            .chunks_exact(mx * my)
            .zip(modes.chunks_exact_mut(mx * my))
        {
            product(&y.vectors, from, my, to);
        }
        product(&z.vectors, &modes, mz, &mut other);
        for (place, line) in other.chunks_exact(mx).enumerate() {
            let start = (place / my + 1) * plane + (place % my + 1) * row + 1;
            u[start..start + mx].copy_from_slice(line);
        }
    }
}

/// (M V)' face (M V): the modes of values on the interior of a face.
fn project(outer: &Modes, inner: &Modes, face: &[f64]) -> Vec<f64> {
    let mut half = vec![0.0; face.len()];
    product(face, &inner.weighted, inner.inner, &mut half);
    let mut out = vec![0.0; face.len()];
    product(&outer.weighted_transposed, &half, outer.inner, &mut out);
    out
}
