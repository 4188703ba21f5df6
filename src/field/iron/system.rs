//! The equations of a surface, taken apart by its mirrors.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::bodies::Iron;
use super::surface::{Surface, mirrored};
use fluxform_numerics::gmres::gmres;
use fluxform_numerics::lu::Factored;
use fluxform_numerics::vec3::norm;

/// Most steps of the linear solver.
const MOST_STEPS: usize = 300;
/// Weight of the mean that is set to nothing.
const MEAN: f64 = 0.5;

/// The equations of one part of the surface, one matrix for every way to be even or odd under the mirrors.
pub(super) struct System {
    parities: Parities,
    /// [row][parity][column].
    entries: Vec<f64>,
}

/// The same with its matrices factorised, for many right-hand sides.
#[derive(Debug, Clone)]
pub(super) struct FactoredSystem {
    parities: Parities,
    factors: Vec<Factored>,
}

/// Data that the equations of every parity share.
#[derive(Debug, Clone)]
struct Parities {
    size: usize,
    images: usize,
    /// Of every parity and body whose constant it allows: nodes with their share of its area.
    constants: Vec<Vec<Vec<(usize, f64)>>>,
    /// Factors that turn the unknowns into layers.
    strengths: Vec<f64>,
}

pub(super) struct Solution {
    /// [image]: [node, drive].
    pub(super) layers: Vec<DMatrix<f64>>,
    pub(super) residual: f64,
    pub(super) iterations: usize,
}

fn sign(parity: usize, image: usize) -> f64 {
    if (parity & image).count_ones().is_multiple_of(2) {
        1.0
    } else {
        -1.0
    }
}

impl System {
    pub(super) fn new(iron: &Iron, surface: &Surface, images: &[[f64; 2]]) -> Self {
        let (size, count) = (surface.size(), images.len());
        let planes_m = iron.planes_m;
        let scales = iron.scales();
        let body = |node: usize| surface.face_of(node).body;
        let strengths: Vec<f64> = (0..size)
            .map(|node| {
                let face = surface.face_of(node);
                (face.chi[0] - face.chi[1]) / scales[face.body]
            })
            .collect();
        // Images that leave a body where it is.
        let keeps = |body: usize, image: usize| iron.keeps(body, images[image]);
        let mut entries = vec![0.0; size * size * count];
        entries
            .par_chunks_mut(size * count)
            .enumerate()
            .for_each(|(row, out)| {
                fluxform_base::progress::poll();
                let own = body(row);
                let mut whole = 0.0;
                for (image, part) in out.chunks_exact_mut(size).enumerate() {
                    let target = mirrored(&surface.nodes[row], images[image], planes_m);
                    surface.add_row(target.place_m, part);
                    for (value, strength) in part.iter_mut().zip(&strengths) {
                        *value *= strength;
                    }
                    if keeps(own, image) {
                        let same = part
                            .iter()
                            .enumerate()
                            .filter(|(node, _)| body(*node) == own);
                        whole += same.map(|(_, value)| value).sum::<f64>();
                    }
                }
                out[row] += 1.0 / scales[own] - whole;
                let images: Vec<f64> = out.to_vec();
                for (parity, part) in out.chunks_exact_mut(size).enumerate() {
                    for (node, value) in part.iter_mut().enumerate() {
                        *value = (0..count)
                            .map(|image| sign(parity, image) * images[image * size + node])
                            .sum();
                    }
                }
            });
        let bodies = scales.len();
        let constants = (0..count)
            .map(|parity| {
                (0..bodies)
                    .filter(|body| {
                        (0..count).all(|image| !keeps(*body, image) || sign(parity, image) > 0.0)
                    })
                    .map(|of| {
                        let areas: Vec<(usize, f64)> = (0..size)
                            .filter(|node| body(*node) == of)
                            .map(|node| (node, norm(surface.nodes[node].area_m2)))
                            .collect();
                        let sum: f64 = areas.iter().map(|(_, area)| area).sum();
                        areas
                            .into_iter()
                            .map(|(node, area)| (node, area / sum))
                            .collect()
                    })
                    .collect()
            })
            .collect();
        Self {
            parities: Parities {
                size,
                images: count,
                constants,
                strengths,
            },
            entries,
        }
    }

    /// The rows of one parity's matrix.
    fn rows(&self, parity: usize) -> impl IndexedParallelIterator<Item = &[f64]> {
        let Parities { size, images, .. } = self.parities;
        let rows = self.entries.par_chunks_exact(size * images);
        rows.map(move |row| &row[parity * size..(parity + 1) * size])
    }

    fn apply(&self, parity: usize, x: &DMatrix<f64>) -> DMatrix<f64> {
        let columns = x.ncols();
        let rows: Vec<f64> = self
            .rows(parity)
            .flat_map_iter(|row| {
                (0..columns).map(move |column| product(row, x.column(column).as_slice()))
            })
            .collect();
        let mut out = DMatrix::from_row_slice(self.parities.size, columns, &rows);
        for constant in &self.parities.constants[parity] {
            for column in 0..columns {
                let mean: f64 = constant
                    .iter()
                    .map(|(node, w)| w * x[(*node, column)])
                    .sum();
                for (node, _) in constant {
                    out[(*node, column)] += MEAN * mean;
                }
            }
        }
        out
    }

    /// The layers for `potentials`, [image]: [node, drive].
    pub(super) fn solve(&self, potentials: &[DMatrix<f64>], tolerance: f64) -> Solution {
        let (mut residual, mut iterations) = (0.0_f64, 0);
        let layers = self.parities.layers(potentials, |parity, right| {
            let outcome = gmres(&right, tolerance, MOST_STEPS, |x| self.apply(parity, x));
            residual = residual.max(outcome.relative_residual);
            iterations += outcome.iterations;
            outcome.solutions
        });
        Solution {
            layers,
            residual,
            iterations,
        }
    }

    /// The same equations with every parity's matrix factorised; `None` where one is singular.
    pub(super) fn factored(self) -> Option<FactoredSystem> {
        let size = self.parities.size;
        let factors = (0..self.parities.images)
            .map(|parity| {
                let mut matrix = DMatrix::zeros(size, size);
                let columns = matrix.as_mut_slice();
                let transposed = columns.par_chunks_mut(size.max(1)).enumerate();
                transposed.for_each(|(column, out)| {
                    let row_length = size * self.parities.images;
                    let entries = &self.entries[parity * size + column..];
                    for (value, entry) in out.iter_mut().zip(entries.iter().step_by(row_length)) {
                        *value = *entry;
                    }
                });
                for constant in &self.parities.constants[parity] {
                    for (row, _) in constant {
                        for (column, share) in constant {
                            matrix[(*row, *column)] += MEAN * share;
                        }
                    }
                }
                Factored::new(matrix)
            })
            .collect::<Option<Vec<_>>>()?;
        Some(FactoredSystem {
            parities: self.parities,
            factors,
        })
    }
}

impl FactoredSystem {
    /// The layers for `potentials`, [image]: [node, drive].
    pub(super) fn solve(&self, potentials: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        self.parities.layers(potentials, |parity, mut right| {
            self.factors[parity].solve(&mut right);
            right
        })
    }
}

impl Parities {
    /// The layers of `potentials`, [image]: [node, drive], by what solves the equations of one parity.
    fn layers(
        &self,
        potentials: &[DMatrix<f64>],
        mut solve: impl FnMut(usize, DMatrix<f64>) -> DMatrix<f64>,
    ) -> Vec<DMatrix<f64>> {
        let columns = potentials[0].ncols();
        let mut layers = vec![DMatrix::zeros(self.size, columns); self.images];
        // Rounding errors of a drive that has none of a parity are not resolved.
        let size = potentials.iter().map(DMatrix::amax).fold(0.0, f64::max);
        for parity in 0..self.images {
            let mut right = DMatrix::zeros(self.size, columns);
            for (image, potential) in potentials.iter().enumerate() {
                right += potential * (sign(parity, image) / self.images as f64);
            }
            for constant in &self.constants[parity] {
                for column in 0..columns {
                    let mean: f64 = constant
                        .iter()
                        .map(|(node, w)| w * right[(*node, column)])
                        .sum();
                    for (node, _) in constant {
                        right[(*node, column)] -= mean;
                    }
                }
            }
            for mut column in right.column_iter_mut() {
                if column.amax() < 1e-12 * size {
                    column.fill(0.0);
                }
            }
            let solutions = solve(parity, right);
            for (image, layer) in layers.iter_mut().enumerate() {
                *layer += &solutions * sign(parity, image);
            }
        }
        let strengths = DVector::from_column_slice(&self.strengths);
        for layer in &mut layers {
            for mut column in layer.column_iter_mut() {
                column.component_mul_assign(&strengths);
            }
        }
        layers
    }
}

/// The product of two vectors, in eight sums that the compiler keeps apart.
fn product(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (whole_a, whole_b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = (whole_a.remainder().iter().zip(whole_b.remainder()))
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in whole_a.zip(whole_b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}
