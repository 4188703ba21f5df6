//! The field of sources on the exchange grid of a core some way off, and the cores of an array
//! coupled by it.

use nalgebra::{DMatrix, DMatrixViewMut, DVector, Dyn};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

use super::exchange::LEAST_GAP;
use super::offsets::Offsets;
use super::response::{Response, Ring};
use super::symmetry::Motion;
use crate::dipole::potential;
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
    offsets: Offsets,
    /// The pairs at every offset and its images, receivers ascending.
    pairs: Vec<Vec<Pair>>,
    /// Potentials at the receiver for moments of the sender, for every offset.
    blocks: Vec<DMatrix<f64>>,
    /// Of the sender's winding at the receiver, for every offset.
    windings: Vec<Sent>,
    /// One core's moments for potentials on its grid.
    response: DMatrix<f64>,
    /// Angles of the grid.
    angles: usize,
}

/// Two cores, one of which hears the other.
#[derive(Debug)]
struct Pair {
    receiver: usize,
    sender: usize,
    /// The number of the motion that takes the pairs' offset to theirs.
    motion: usize,
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
        let offsets = Offsets::of_pairs(positions_m);
        let blocks = (offsets.first_m.par_iter())
            .map(|offset| between_cores(&points, response, *offset))
            .collect();
        let windings = (offsets.first_m.par_iter())
            .map(|offset| from_winding(winding, &points, *offset, tolerance))
            .collect();
        let cores = positions_m.len();
        let mut pairs: Vec<Vec<Pair>> = offsets.first_m.iter().map(|_| Vec::new()).collect();
        for receiver in 0..cores {
            for sender in (0..cores).filter(|sender| *sender != receiver) {
                let (a, b) = (positions_m[receiver], positions_m[sender]);
                let (number, motion) = offsets
                    .of([a[0] - b[0], a[1] - b[1]])
                    .expect("cores are apart, and their offset is one of all pairs'");
                pairs[number].push(Pair {
                    receiver,
                    sender,
                    motion,
                });
            }
        }
        Self {
            cores,
            offsets,
            pairs,
            blocks,
            windings,
            response: response.matrix(),
            angles: response.angles,
        }
    }

    /// Potentials at every core's grid of the windings of all others with `currents_a`, A.
    #[must_use]
    pub fn of_windings(&self, currents_a: &[f64]) -> DMatrix<f64> {
        let mut sum = DMatrix::zeros(self.response.nrows(), self.cores);
        for (pairs, sent) in self.pairs.iter().zip(&self.windings) {
            for pair in pairs {
                let mut column = sum.column_mut(pair.receiver);
                let image = self.image(pair, &sent.potential);
                column.axpy(currents_a[pair.sender], &image, 1.0);
            }
        }
        sum
    }

    /// Of values on the receiver's grid where the sender is at the pair's offset, those where it is.
    fn image(&self, pair: &Pair, values: &[f64]) -> DVector<f64> {
        DVector::from_vec(self.motion(pair).image_on_grid(self.angles, values))
    }

    fn motion(&self, pair: &Pair) -> &Motion {
        &self.offsets.motions[pair.motion]
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

    /// Flux through every coil of all cores but its own, Wb, `moments(core)` being theirs.
    #[must_use]
    pub fn flux_of_others_wb<'a>(&self, moments: impl Fn(usize) -> &'a [f64]) -> Vec<f64> {
        let mut flux_wb = vec![0.0; self.cores];
        let turn = TAU / self.angles as f64;
        for (pairs, sent) in self.pairs.iter().zip(&self.windings) {
            for pair in pairs {
                let normal = self.image(pair, &sent.normal_field_t);
                let both = moments(pair.receiver).iter().zip(normal.iter());
                flux_wb[pair.sender] -= turn * both.map(|(q, b)| q * b).sum::<f64>();
            }
        }
        flux_wb
    }

    /// Potentials at every core of the moments of all others; columns as in `moments`.
    fn send(&self, moments: &DMatrix<f64>) -> DMatrix<f64> {
        let cores = self.cores;
        let problems = moments.ncols() / cores.max(1);
        let size = moments.nrows();
        let starts: Vec<usize> = (0..size).step_by(ROWS).collect();
        let mut received = DMatrix::zeros(size, moments.ncols());
        // Pairs at images of an offset share a product: a matrix is read once for all of them. Offsets
        // are added in order, whatever the threads.
        for (block, pairs) in self.blocks.iter().zip(&self.pairs) {
            for pairs in pairs.chunks(PAIRS) {
                let columns = || {
                    let firsts = (0..problems).map(|problem| problem * cores);
                    firsts.flat_map(|first| pairs.iter().map(move |pair| (first, pair)))
                };
                let mut from = DMatrix::zeros(size, pairs.len() * problems);
                for (mut column, (first, pair)) in from.column_iter_mut().zip(columns()) {
                    let sent = moments.column(first + pair.sender);
                    for (before, after) in self.motion(pair).on_grid(self.angles, size) {
                        column
                            .rows_range_mut(before)
                            .copy_from(&sent.rows_range(after));
                    }
                }
                let products: Vec<DMatrix<f64>> = starts
                    .par_iter()
                    .map(|start| {
                        fluxform_base::progress::poll();
                        block.rows(*start, ROWS.min(size - start)) * &from
                    })
                    .collect();
                let mut product = DVector::zeros(size);
                for (k, (first, pair)) in columns().enumerate() {
                    for (start, part) in starts.iter().zip(&products) {
                        let mut rows = product.rows_mut(*start, part.nrows());
                        rows.copy_from(&part.column(k));
                    }
                    let mut column = received.column_mut(first + pair.receiver);
                    for (before, after) in self.motion(pair).on_grid(self.angles, size) {
                        let mut rows = column.rows_range_mut(after);
                        rows += product.rows_range(before);
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
                let axis = |axis: usize| Lanes::load(&self.receivers_m[axis][group * LANES..]);
                potential::<FMA>([axis(0), axis(1), axis(2)], *y, *n, self.scale).store(out);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steel::CoreShape;
    use crate::steel::array::ArrayResolution;
    use crate::steel::generatrix::Generatrix;
    use crate::steel::response::Rings;

    /// In every eighth of the plane, on its edges, and within rounding of each other.
    #[test]
    fn what_images_of_an_offset_pass_is_what_each_pair_does() {
        let winding = Winding {
            inner_radius_m: 0.013,
            outer_radius_m: 0.019,
            length_m: 0.03,
            turns: 700.0,
        };
        let shape = CoreShape {
            radius_m: 0.011,
            bottom_m: -0.035,
            top_m: 0.003,
        };
        let resolution = ArrayResolution::for_tolerance(1e-2, shape, 0.04);
        let outline = Generatrix::of_coil(&winding, shape, &resolution.outline);
        let exchange = Rings::new(&outline, 4, |_| 0.02);
        let response = Response::new(outline, exchange, 12, 4, 470.0, 1e-6);
        let points = grid_points(&response);
        let positions_m = [
            [0.0, 0.0],
            [0.04, 0.0],
            [0.1, 0.0],
            [0.04, 0.06],
            [0.1, 0.06 + 1e-17],
            [-0.03, 0.05],
        ];
        let coupling = Coupling::new(&winding, &positions_m, &response, 1e-8);
        assert!(coupling.blocks.len() < 15);
        let (size, cores) = (points.len(), positions_m.len());
        let moments = DMatrix::from_fn(size, 2 * cores, |i, k| (0.1 + (i * (k + 3)) as f64).sin());
        let currents_a = [0.7, -1.3, 0.2, 1.9, -0.4, 1.1];
        let (mut received, mut of_windings) =
            (DMatrix::zeros(size, 2 * cores), DMatrix::zeros(size, cores));
        let mut flux_wb = vec![0.0; cores];
        for (to, a) in positions_m.iter().enumerate() {
            for (from, b) in positions_m
                .iter()
                .enumerate()
                .filter(|(from, _)| *from != to)
            {
                let offset_m = [a[0] - b[0], a[1] - b[1]];
                let block = between_cores(&points, &response, offset_m);
                for problem in [0, cores] {
                    let mut column = received.column_mut(problem + to);
                    column += &block * moments.column(problem + from);
                }
                let sent = from_winding(&winding, &points, offset_m, 1e-8);
                let mut column = of_windings.column_mut(to);
                column += currents_a[from] * DVector::from_vec(sent.potential);
                let normal = DVector::from_vec(sent.normal_field_t);
                flux_wb[from] -= TAU / 12.0 * normal.dot(&moments.column(to));
            }
        }
        let close = |a: &DMatrix<f64>, b: &DMatrix<f64>| {
            assert!(
                (a - b).amax() < 1e-12 * b.amax(),
                "{:e}",
                (a - b).amax() / b.amax()
            );
        };
        close(&coupling.send(&moments), &received);
        close(&coupling.of_windings(&currents_a), &of_windings);
        let flux = coupling.flux_of_others_wb(|core| &moments.as_slice()[core * size..][..size]);
        close(
            &DMatrix::from_vec(cores, 1, flux),
            &DMatrix::from_vec(cores, 1, flux_wb),
        );
    }
}
