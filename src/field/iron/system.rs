//! The equations of a surface, taken apart by its mirrors.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::blocks::{BlockRow, Blocks, Clusters, FAR};
use super::bodies::Iron;
use super::face::Node;
use super::panel_columns::Targets;
use super::surface::{Surface, mirrored};
use fluxform_numerics::gmres::gmres;
use fluxform_numerics::lu::Factored;
use fluxform_numerics::vec3::{minus, norm, plus};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Most steps of the linear solver.
const MOST_STEPS: usize = 300;
/// Weight of the mean that is set to nothing.
const MEAN: f64 = 0.5;

/// What an entry may be off, relative to the tolerance over the number of unknowns.
const COMPRESSION: f64 = 1e-2;

/// The equations of one part of the surface, one matrix for every way to be even or odd under the mirrors.
pub(super) struct System {
    parities: Parities,
    clusters: Clusters,
    /// Of every parity, its diagonal left out.
    matrices: Vec<Blocks>,
    /// Of all of them.
    diagonal: Vec<f64>,
}

/// The equations take more entries than allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TooMany;

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
    /// The equations to `tolerance`, at 0 with every entry as it is, in `most_entries` at most.
    pub(super) fn new(
        iron: &Iron,
        surface: &Surface,
        images: &[[f64; 2]],
        tolerance: f64,
        most_entries: usize,
    ) -> Result<Self, TooMany> {
        let size = surface.size();
        let scales = iron.scales();
        let body = |node: usize| surface.face_of(node).body;
        let strengths: Vec<f64> = (0..size)
            .map(|node| {
                let face = surface.face_of(node);
                (face.chi[0] - face.chi[1]) / scales[face.body]
            })
            .collect();
        let centres: Vec<_> = surface
            .panels()
            .iter()
            .map(|panel| panel.centre_m)
            .collect();
        let clusters = Clusters::new(&centres, |panel| surface.nodes_of(panel));
        let assembly = Assembly {
            iron,
            surface,
            clusters: &clusters,
            images,
            strengths: &strengths,
            threshold: COMPRESSION * tolerance / size as f64,
            most_entries,
            taken: AtomicUsize::new(0),
        };
        let rows = (0..clusters.items.len()).into_par_iter();
        let rows = rows.map(|cluster| assembly.rows(cluster));
        let rows = rows.collect::<Result<Vec<_>, TooMany>>()?;
        let mut diagonal = vec![0.0; size];
        let mut matrices = vec![Blocks::default(); images.len()];
        for (cluster, (rows, whole)) in rows.into_iter().enumerate() {
            for (node, whole) in clusters.places(cluster).iter().zip(whole) {
                diagonal[*node] = 1.0 / scales[body(*node)] - whole;
            }
            for (matrix, row) in matrices.iter_mut().zip(rows) {
                matrix.push(row);
            }
        }
        Ok(Self {
            parities: Parities {
                size,
                images: images.len(),
                constants: constants(iron, surface, images),
                strengths,
            },
            clusters,
            matrices,
            diagonal,
        })
    }

    fn apply(&self, parity: usize, x: &DMatrix<f64>) -> DMatrix<f64> {
        let columns = x.ncols();
        let mut out = self.matrices[parity].apply(&self.clusters, x);
        for (mut own, x) in out.column_iter_mut().zip(x.column_iter()) {
            for ((own, x), diagonal) in own.iter_mut().zip(x.iter()).zip(&self.diagonal) {
                *own += diagonal * x;
            }
        }
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
        let matrices = self.matrices.into_iter();
        let factors = matrices
            .enumerate()
            .map(|(parity, blocks)| {
                let mut matrix = blocks.whole(&self.clusters);
                drop(blocks);
                for (node, diagonal) in self.diagonal.iter().enumerate() {
                    matrix[(node, node)] += diagonal;
                }
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

/// Turns what every image gives, `count` values each, into what every parity does: the sum over the images, each with
/// its [`sign`].
fn of_parities(values: &mut [f64], count: usize) {
    let mut half = count;
    while half < values.len() {
        for pair in values.chunks_exact_mut(2 * half) {
            let (one, other) = pair.split_at_mut(half);
            for (one, other) in one.iter_mut().zip(other) {
                (*one, *other) = (*one + *other, *one - *other);
            }
        }
        half *= 2;
    }
}

/// Of every parity and body whose constant it allows: nodes with their share of its area.
fn constants(iron: &Iron, surface: &Surface, images: &[[f64; 2]]) -> Vec<Vec<Vec<(usize, f64)>>> {
    let allows = |parity: usize, body: usize| {
        let mut images = images.iter().enumerate();
        images.all(|(image, signs)| !iron.keeps(body, *signs) || sign(parity, image) > 0.0)
    };
    let shares = |of: usize| {
        let own = (0..surface.size()).filter(|node| surface.face_of(*node).body == of);
        let areas: Vec<(usize, f64)> = own
            .map(|node| (node, norm(surface.nodes[node].area_m2)))
            .collect();
        let sum: f64 = areas.iter().map(|(_, area)| area).sum();
        let share = |(node, area): (usize, f64)| (node, area / sum);
        areas.into_iter().map(share).collect()
    };
    let bodies = iron.scales().len();
    let of_parity = |parity: usize| {
        let allowed = (0..bodies).filter(|body| allows(parity, *body));
        allowed.map(shares).collect()
    };
    (0..images.len()).map(of_parity).collect()
}

/// What blocks are made of.
struct Assembly<'a> {
    iron: &'a Iron,
    surface: &'a Surface,
    clusters: &'a Clusters,
    images: &'a [[f64; 2]],
    strengths: &'a [f64],
    /// What an entry of a product may be off.
    threshold: f64,
    most_entries: usize,
    /// Entries of all blocks so far.
    taken: AtomicUsize,
}

impl Assembly<'_> {
    /// The rows of every parity's blocks for a cluster, and at each of its nodes what a layer of 1 on all of its body
    /// gives.
    fn rows(&self, own: usize) -> Result<(Vec<BlockRow>, Vec<f64>), TooMany> {
        let clusters = self.clusters.items.len();
        let nodes = self.clusters.places(own);
        let mut targets = Targets::default();
        for (image, signs) in self.images.iter().enumerate() {
            for node in nodes {
                let place = &self.surface.nodes[*node];
                let place_m = mirrored(place, *signs, self.iron.planes_m).place_m;
                targets.push(place_m, (image == 0).then_some(*node));
            }
        }
        let body = |node: usize| self.surface.face_of(node).body;
        let bodies: Vec<usize> = nodes.iter().map(|node| body(*node)).collect();
        let parities = 0..self.images.len();
        let mut rows: Vec<BlockRow> = parities
            .map(|_| BlockRow::with_capacity(clusters))
            .collect();
        let mut whole = vec![0.0; nodes.len()];
        for other in 0..clusters {
            fluxform_base::progress::poll();
            let mut columns = self.columns(&targets, other);
            let places = self.clusters.places(other);
            for (column, node) in columns.chunks_exact(targets.count()).zip(places) {
                let of = body(*node);
                for (signs, part) in self.images.iter().zip(column.chunks_exact(nodes.len())) {
                    // Images that leave the body where it is.
                    if self.iron.keeps(of, *signs) {
                        for ((sum, body), value) in whole.iter_mut().zip(&bodies).zip(part) {
                            *sum += if *body == of { *value } else { 0.0 };
                        }
                    }
                }
            }
            let threshold = if self.are_apart(own, other) {
                self.threshold
            } else {
                0.0
            };
            for column in columns.chunks_exact_mut(targets.count()) {
                of_parities(column, nodes.len());
            }
            for (parity, row) in rows.iter_mut().enumerate() {
                let mut sum = Vec::with_capacity(nodes.len() * places.len());
                let parts = columns.chunks_exact(nodes.len());
                for part in parts.skip(parity).step_by(self.images.len()) {
                    sum.extend_from_slice(part);
                }
                let sum = DMatrix::from_vec(nodes.len(), places.len(), sum);
                let entries = row.push(sum, threshold);
                if self.taken.fetch_add(entries, Relaxed) + entries > self.most_entries {
                    return Err(TooMany);
                }
            }
        }
        Ok((rows, whole))
    }

    /// What the nodes of a cluster give at `targets`, [node][target].
    fn columns(&self, targets: &Targets, cluster: usize) -> Vec<f64> {
        let count = targets.count();
        let mut columns = vec![0.0; self.clusters.places(cluster).len() * count];
        let mut rest = columns.as_mut_slice();
        for panel in &self.clusters.items[cluster] {
            let nodes = self.surface.nodes_of(*panel);
            let own;
            (own, rest) = rest.split_at_mut(nodes.len() * count);
            self.surface.panel_columns(*panel, targets, own);
            for (column, strength) in own.chunks_exact_mut(count).zip(&self.strengths[nodes]) {
                column.iter_mut().for_each(|value| *value *= strength);
            }
        }
        columns
    }

    /// Whether every image of cluster `own` is far from `other`.
    fn are_apart(&self, own: usize, other: usize) -> bool {
        let ball = |cluster: usize| {
            let panels = self.surface.panels();
            let items = &self.clusters.items[cluster];
            let mut middle = [0.0; 3];
            for item in items {
                middle = plus(middle, panels[*item].centre_m);
            }
            let middle = middle.map(|c| c / items.len() as f64);
            let reach =
                |item: &usize| norm(minus(panels[*item].centre_m, middle)) + panels[*item].radius_m;
            (middle, items.iter().map(reach).fold(0.0, f64::max))
        };
        let ((own, a), (other, b)) = (ball(own), ball(other));
        let image = |signs: &[f64; 2]| {
            let node = Node {
                place_m: own,
                area_m2: [0.0; 3],
            };
            let own = mirrored(&node, *signs, self.iron.planes_m).place_m;
            norm(minus(own, other)) - a - b > FAR * a.max(b)
        };
        self.images.iter().all(image)
    }
}
