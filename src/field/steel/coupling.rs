//! The field of sources on the exchange grid of a core some way off, and the cores of an array
//! coupled by it.

use nalgebra::{DMatrix, DMatrixViewMut, Dyn};
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use super::exchange::LEAST_GAP;
use super::response::{Response, Ring};
use crate::winding::Winding;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::gauss;
use fluxform_numerics::gmres::gmres;
use fluxform_numerics::lagrange_basis::Basis;
use fluxform_numerics::ring_functions::azimuthal_integrals;

/// Most applications of the coupling.
const MOST_STEPS: usize = 120;
/// Rows of a product that are one piece of work, and most pairs of cores in it; fixed, so that
/// bytes do not depend on threads.
const ROWS: usize = 256;
const PAIRS: usize = 64;

/// The field of a winding on a core's exchange grid, per ampere.
#[derive(Debug, Clone)]
pub struct Sent {
    /// Potential, A/A.
    pub potential: Vec<f64>,
    /// n.B, T/A.
    pub normal_field_t: Vec<f64>,
}

/// Exchange between an array's coils and each other's cores, ready to be solved for any currents.
#[derive(Debug)]
pub struct Coupling {
    cores: usize,
    links: Links,
    /// Potentials at the receiver for moments of the sender, for every offset.
    blocks: Vec<DMatrix<f64>>,
    /// Of the sender's winding at the receiver, for every offset.
    windings: Vec<Sent>,
    /// One core's moments for potentials on its grid.
    response: DMatrix<f64>,
    /// Angle between two of the grid's, rad.
    turn: f64,
}

/// A solved coupling; columns as in the problem's.
#[derive(Debug)]
pub struct Coupled {
    /// Potential sent to every core by all others, windings and cores, on the exchange grid.
    pub potentials: DMatrix<f64>,
    /// Moments of every core on the exchange grid.
    pub moments: DMatrix<f64>,
    /// Relative residual of the linear solver.
    pub relative_residual: f64,
    /// Applications of the coupling.
    pub iterations: usize,
}

impl Coupling {
    /// The coupling of coils at `positions_m` whose cores respond by `response`; `tolerance` is
    /// that of the windings' potentials.
    ///
    /// Domain: cores apart, windings apart or touching.
    #[must_use]
    pub fn new(
        winding: &Winding,
        positions_m: &[[f64; 2]],
        response: &Response,
        tolerance: f64,
    ) -> Self {
        let points = grid_points(response);
        let links = Links::new(positions_m);
        let blocks = links
            .offsets_m
            .par_iter()
            .map(|offset| between_cores(&points, response, *offset))
            .collect();
        let windings = links
            .offsets_m
            .par_iter()
            .map(|offset| from_winding(winding, &points, *offset, tolerance))
            .collect();
        Self {
            cores: positions_m.len(),
            links,
            blocks,
            windings,
            response: response.matrix(),
            turn: TAU / response.angles as f64,
        }
    }

    /// The field of the winding of coil `sender` at the core of another, `receiver`.
    #[must_use]
    pub fn winding(&self, receiver: usize, sender: usize) -> &Sent {
        &self.windings[self.links.index[receiver * self.cores + sender]]
    }

    /// Potentials at every core's grid, of `size` points, of the windings of all others with
    /// `currents_a`, A.
    #[must_use]
    pub(crate) fn of_windings(&self, currents_a: &[f64], size: usize) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(size, self.cores);
        for (receiver, mut column) in sum.column_iter_mut().enumerate() {
            for (sender, current_a) in currents_a.iter().enumerate() {
                if sender != receiver {
                    let sent = &self.winding(receiver, sender).potential;
                    for (value, potential) in column.iter_mut().zip(sent) {
                        *value += current_a * potential;
                    }
                }
            }
        }
        sum
    }

    /// Solves q - T K q = T p + q_own: `sent` are the potentials p of the other coils' windings,
    /// `own` the moments that cores have without what others send, both
    /// [exchange grid, problem * cores + core].
    #[must_use]
    pub fn solve(&self, sent: DMatrix<f64>, own: &DMatrix<f64>, residual: f64) -> Coupled {
        let (size, columns) = own.shape();
        let problems = columns / self.cores.max(1);
        let stack = |m: DMatrix<f64>| m.reshape_generic(Dyn(size * self.cores), Dyn(problems));
        let unstack = |m: &DMatrix<f64>| m.clone().reshape_generic(Dyn(size), Dyn(columns));
        let rhs = &self.response * &sent + own;
        let outcome = gmres(&stack(rhs), residual, MOST_STEPS, |moments| {
            let moments = unstack(moments);
            let back = &self.response * self.send(&moments);
            stack(moments - back)
        });
        let moments = unstack(&outcome.solutions);
        Coupled {
            potentials: sent + self.send(&moments),
            moments,
            relative_residual: outcome.relative_residual,
            iterations: outcome.iterations,
        }
    }

    /// Flux through a coil of all cores but its own, Wb, `moments(core)` being theirs.
    #[must_use]
    pub fn flux_of_others_wb<'a>(&self, coil: usize, moments: impl Fn(usize) -> &'a [f64]) -> f64 {
        let mut flux = 0.0;
        for core in (0..self.cores).filter(|c| *c != coil) {
            let normal = &self.winding(core, coil).normal_field_t;
            let sum: f64 = moments(core).iter().zip(normal).map(|(q, b)| q * b).sum();
            flux -= self.turn * sum;
        }
        flux
    }

    /// Potentials at every core of the moments of all others; columns as in `moments`.
    fn send(&self, moments: &DMatrix<f64>) -> DMatrix<f64> {
        let cores = self.cores;
        let problems = moments.ncols() / cores.max(1);
        let size = moments.nrows();
        let mut received = DMatrix::zeros(size, moments.ncols());
        // Pairs that share an offset share a product: a matrix is read once for all of them. Offsets
        // are added in order, whatever the threads.
        for (block, pairs) in self.blocks.iter().zip(&self.links.pairs) {
            for pairs in pairs.chunks(PAIRS) {
                let column = |k: usize, core: usize| k / pairs.len() * cores + core;
                let from = DMatrix::from_fn(size, pairs.len() * problems, |i, k| {
                    moments[(i, column(k, pairs[k % pairs.len()].sender))]
                });
                let starts: Vec<usize> = (0..size).step_by(ROWS).collect();
                let products: Vec<DMatrix<f64>> = starts
                    .par_iter()
                    .map(|start| {
                        fluxform_base::progress::poll();
                        block.rows(*start, ROWS.min(size - start)) * &from
                    })
                    .collect();
                for (start, product) in starts.iter().zip(&products) {
                    for (k, part) in product.column_iter().enumerate() {
                        let to = column(k, pairs[k % pairs.len()].receiver);
                        let mut rows = received.view_mut((*start, to), (part.len(), 1));
                        rows += part;
                    }
                }
            }
        }
        received
    }
}

/// Points and outer normals of an exchange grid, index = angle * rings + ring.
pub(super) fn grid_points(response: &Response) -> Vec<([f64; 3], [f64; 3])> {
    (0..response.angles)
        .flat_map(|k| {
            let (s, c) = (TAU * k as f64 / response.angles as f64).sin_cos();
            response.exchange.rings.iter().map(move |ring: &Ring| {
                let [n_r, n_z] = ring.normal;
                (
                    [ring.r_m * c, ring.r_m * s, ring.z_m],
                    [n_r * c, n_r * s, n_z],
                )
            })
        })
        .collect()
}

/// Potential at the grid of a core at `offset_m` from the sender, for unit moments on the
/// sender's grid: -(1/4 pi) n'.(x - y)/|x - y|^3 dtheta, [receiver, sender]. On long panels the
/// moments stand for the layer that they interpolate.
pub(super) fn between_cores(
    points: &[GridPoint],
    response: &Response,
    offset_m: [f64; 2],
) -> DMatrix<f64> {
    let scale = -TAU / response.angles as f64 / (4.0 * PI);
    let mut matrix = DMatrix::zeros(points.len(), points.len());
    dispatch::run(Dipoles {
        receivers_m: [0, 1, 2].map(|axis| {
            let offset_m = offset_m.get(axis).copied().unwrap_or(0.0);
            points.iter().map(|(x, _)| x[axis] + offset_m).collect()
        }),
        senders: points,
        scale,
        matrix: matrix.as_mut_slice(),
    });
    for sender_angle in 0..response.angles {
        let rings = response.exchange.rings.len();
        let mut columns = matrix.columns_mut(sender_angle * rings, rings);
        let kernel = |at: GridPoint, from| scale * dipole(at.0, from);
        integrate_stretched(
            &mut columns,
            points,
            response,
            (offset_m, sender_angle),
            kernel,
        );
    }
    matrix
}

/// A place on a core's surface and the outer normal there.
pub(super) type GridPoint = ([f64; 3], [f64; 3]);

/// The point of another core's grid, as seen from the sender.
pub(super) fn shifted((x, n): GridPoint, [dx, dy]: [f64; 2]) -> GridPoint {
    ([x[0] + dx, x[1] + dy, x[2]], n)
}

/// n.(x - y)/|x - y|^3 of the dipole n at y, 1/m^2.
fn dipole(x: [f64; 3], (y, n): GridPoint) -> f64 {
    let d = [x[0] - y[0], x[1] - y[1], x[2] - y[2]];
    let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    (n[0] * d[0] + n[1] * d[1] + n[2] * d[2]) / (square * square.sqrt())
}

/// `scale` times the potentials of unit dipoles at some places, [receiver, sender].
struct Dipoles<'a> {
    receivers_m: [Vec<f64>; 3],
    senders: &'a [GridPoint],
    scale: f64,
    matrix: &'a mut [f64],
}

impl Kernel for Dipoles<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let rows = self.receivers_m[0].len();
        for (column, (y, n)) in self.matrix.chunks_exact_mut(rows).zip(self.senders) {
            fluxform_base::progress::poll();
            for (group, out) in column.chunks_mut(LANES).enumerate() {
                let axis =
                    |axis: usize| Lanes::load(&self.receivers_m[axis][group * LANES..]) - y[axis];
                let d = [axis(0), axis(1), axis(2)];
                let square = d[0].mul_add::<FMA>(d[0], d[1].mul_add::<FMA>(d[1], d[2] * d[2]));
                let along = d[0] * n[0] + d[1] * n[1] + d[2] * n[2];
                (along * self.scale / (square * square.sqrt())).store(out);
            }
        }
    }
}

/// The columns of one angle of a sender's grid, one per ring, where its panels are long: `kernel`, of a
/// receiver's point and a sender's, is integrated over parts of a panel, short beside each receiver,
/// against the polynomial that is one at one ring. The receiver is at `offset_m` from the sender.
pub(super) fn integrate_stretched(
    columns: &mut DMatrixViewMut<'_, f64>,
    points: &[GridPoint],
    response: &Response,
    (offset_m, sender_angle): ([f64; 2], usize),
    kernel: impl Fn(GridPoint, GridPoint) -> f64,
) {
    let (rings, order) = (response.exchange.rings.len(), response.exchange.order);
    let radius_m = response.outline.shape.radius_m;
    let gap_m = (offset_m[0].hypot(offset_m[1]) - 2.0 * radius_m).max(LEAST_GAP * radius_m);
    let rule = gauss::rule(order);
    let basis = Basis::new(rule);
    let mut values = vec![0.0; order];
    for stretched in &response.exchange.stretched {
        let (from, to) = stretched.panel.range_m();
        let (place, normal) = points[sender_angle * rings + stretched.first];
        for (ring, receiver) in response.exchange.rings.iter().enumerate() {
            fluxform_base::progress::poll();
            // Heights, and the weight of every ring there.
            let mut nodes: Vec<(f64, Vec<f64>)> = Vec::new();
            for (lo, hi) in stretched.parts(receiver.z_m, gap_m) {
                for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
                    let z_m = lo + 0.5 * (hi - lo) * (1.0 + x);
                    basis.weights(2.0 * (z_m - from) / (to - from) - 1.0, &mut values);
                    let share = weight * (hi - lo) / (to - from);
                    let weights = values.iter().zip(&rule.weights);
                    nodes.push((z_m, weights.map(|(v, w)| share * v / w).collect()));
                }
            }
            for receiver_angle in 0..response.angles {
                let row = receiver_angle * rings + ring;
                let at = shifted(points[row], offset_m);
                values.fill(0.0);
                for (z_m, weights) in &nodes {
                    let kernel = kernel(at, ([place[0], place[1], *z_m], normal));
                    for (value, weight) in values.iter_mut().zip(weights) {
                        *value += kernel * weight;
                    }
                }
                for (k, value) in values.iter().enumerate() {
                    columns[(row, stretched.first + k)] = *value;
                }
            }
        }
    }
}

/// The winding's potential (A/A) and normal flux density n.B (T/A) per ampere at the grid of a
/// core at `offset_m` from the winding's axis.
///
/// Outside its bore the winding is two charged discs: it has the field of the magnetisation
/// M_z(r) = J (a2 - max(r, a1)) between its faces.
pub(super) fn from_winding(
    winding: &Winding,
    points: &[([f64; 3], [f64; 3])],
    offset_m: [f64; 2],
    tolerance: f64,
) -> Sent {
    let (a1, a2) = (winding.inner_radius_m, winding.outer_radius_m);
    let density = winding.current_density_per_m2();
    let nearest = points
        .iter()
        .map(|(x, _)| (x[0] + offset_m[0]).hypot(x[1] + offset_m[1]))
        .fold(f64::INFINITY, f64::min);
    let mut discs = Vec::new();
    for (lo, hi) in [(0.0, a1), (a1, a2)] {
        if hi <= lo {
            continue;
        }
        let radius = gauss::bernstein_radius(lo, hi, nearest.max(hi), 0.0);
        gauss::panel(lo, hi, radius, tolerance, &mut |r, weight| {
            discs.push((r, weight * density * (a2 - r.max(a1))));
        });
    }
    let (potential, normal_field_t) = points
        .iter()
        .map(|(x, n)| {
            let (dx, dy) = (x[0] + offset_m[0], x[1] + offset_m[1]);
            let r = dx.hypot(dy);
            let (mut potential, mut slope_r, mut slope_z) = (0.0, 0.0, 0.0);
            fluxform_base::progress::poll();
            for (height, sign) in [(0.0, 1.0), (-winding.length_m, -1.0)] {
                let u = x[2] - height;
                for (source_r, charge) in &discs {
                    let product = 2.0 * r * source_r;
                    let difference = r - source_r;
                    let excess = (difference * difference + u * u) / product;
                    let (mut inverse, mut cubed) = ([0.0], [0.0]);
                    azimuthal_integrals(excess, &mut inverse, &mut cubed);
                    let scale = sign * charge * source_r / (4.0 * PI * product.sqrt());
                    potential += scale * inverse[0];
                    // r - r' cos psi = r - r' chi + r' (chi - cos psi).
                    let radial = (r * r - source_r * source_r - u * u) / (2.0 * r);
                    let scale = scale / product;
                    slope_r -= scale * (radial * cubed[0] + source_r * inverse[0]);
                    slope_z -= scale * u * cubed[0];
                }
            }
            let (c, s) = (dx / r, dy / r);
            let normal = slope_r * (n[0] * c + n[1] * s) + slope_z * n[2];
            (potential, -MU_0_T_M_PER_A * normal)
        })
        .unzip();
    Sent {
        potential,
        normal_field_t,
    }
}

/// Number of different offsets between cores: each has a matrix.
pub(super) fn different_offsets(positions_m: &[[f64; 2]]) -> usize {
    Links::new(positions_m).offsets_m.len()
}

/// The pairs of cores by their offset: many share one.
#[derive(Debug)]
pub(super) struct Links {
    /// Of the receiver from the sender, m.
    pub(super) offsets_m: Vec<[f64; 2]>,
    /// [receiver, sender]; meaningless on the diagonal.
    pub(super) index: Vec<usize>,
    /// The pairs of every offset, receivers ascending.
    pairs: Vec<Vec<Pair>>,
}

/// Two cores, one of which hears the other.
#[derive(Debug, Clone, Copy)]
struct Pair {
    receiver: usize,
    sender: usize,
}

impl Links {
    pub(super) fn new(positions_m: &[[f64; 2]]) -> Self {
        let cores = positions_m.len();
        let mut offsets_m: Vec<[f64; 2]> = Vec::new();
        let mut index = vec![usize::MAX; cores * cores];
        let extent = positions_m
            .iter()
            .flatten()
            .fold(0.0_f64, |e, x| e.max(x.abs()));
        // Positions from a grid differ by rounding only: known offsets are found by their cell in a
        // lattice that is coarse against that, or by a cell beside it.
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-12 * extent;
        let cell = |x: f64| (x / (1e-9 * extent.max(f64::MIN_POSITIVE))).round() as i64;
        let mut cells: HashMap<[i64; 2], Vec<usize>> = HashMap::new();
        let mut pairs: Vec<Vec<Pair>> = Vec::new();
        for receiver in 0..cores {
            for sender in (0..cores).filter(|s| *s != receiver) {
                let (a, b) = (positions_m[receiver], positions_m[sender]);
                let offset = [a[0] - b[0], a[1] - b[1]];
                let at = offset.map(cell);
                let known = (0..9)
                    .filter_map(|k| cells.get(&[at[0] + k % 3 - 1, at[1] + k / 3 - 1]))
                    .flatten()
                    .filter(|k| (0..2).all(|axis| same(offsets_m[**k][axis], offset[axis])))
                    .min()
                    .copied();
                let number = known.unwrap_or_else(|| {
                    offsets_m.push(offset);
                    pairs.push(Vec::new());
                    cells.entry(at).or_default().push(offsets_m.len() - 1);
                    offsets_m.len() - 1
                });
                index[receiver * cores + sender] = number;
                pairs[number].push(Pair { receiver, sender });
            }
        }
        Self {
            offsets_m,
            index,
            pairs,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::different_offsets;

    #[test]
    fn cores_on_a_grid_share_their_offsets() {
        assert_eq!(different_offsets(&[[0.7, 1.3]]), 0);
        // One apart and two apart, to either side; the last within rounding.
        let row = [[0.1, 0.0], [0.2, 0.0], [0.1 + 0.2, 0.0]];
        assert_eq!(different_offsets(&row), 4);
        let square = [[0.0, 0.0], [1.3, 0.0], [0.0, 1.3], [1.3, 1.3]];
        assert_eq!(different_offsets(&square), 8);
    }
}
