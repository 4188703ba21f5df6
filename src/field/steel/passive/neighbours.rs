//! What the cores' magnetising each other adds to the pull.
//!
//! What neighbours send to a core is smooth: a few potentials x_mu, mode by mode, carry it. Write
//! <a, b> = int (T a) db/dn dS for one core's response T, symmetric by reciprocity. With
//! b = <x, phi> for the magnet's potential phi on every core, R = <x, x'>, and L the components
//! of 1/(4 pi |x - y|) between two cores,
//!
//! ```text
//! c = -L (b + R c),   W_added = -(mu_0/2) b . c:
//! ```
//!
//! c is what a core receives from the others; W_added becomes a small quadratic form in b. The
//! potentials are those of charges on a neighbour at the closest distance, by importance.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

use super::reaction::{Dipole, dot, minus};
use crate::steel::CoreShape;
use crate::steel::array::ArrayResolution;
use crate::steel::coupling::grid_points;
use crate::steel::generatrix::Generatrix;
use crate::steel::response::{Response, Rings};
use fluxform_base::units::MU_0_T_M_PER_A;

/// Longest panel of the exchange grid, in distances from the magnet.
const PANEL: f64 = 1.5;
/// Shortest panel worth having, in radii: closer magnets are left to the estimate.
const SHORTEST: f64 = 0.2;
/// Most angles of the exchange grid.
const MOST_ANGLES: f64 = 48.0;

type Points = Vec<([f64; 3], [f64; 3])>;

/// The quadratic form of an array.
#[derive(Debug, Clone)]
pub struct Neighbours {
    positions_m: Vec<[f64; 2]>,
    /// Exchange grid of a core, index = angle * rings + ring.
    points: Points,
    /// Normal derivatives on the grid to components of b, [kept, grid].
    reduce: DMatrix<f64>,
    /// W_added = -(mu_0/2) b' form b, index = core * kept + place.
    form: DMatrix<f64>,
    /// The magnet about its centre.
    magnet: Vec<Dipole>,
}

impl Neighbours {
    /// Solves an array of cores apart from each other, to about `tolerance` of what is added.
    /// `closest_m` is the smallest distance of two axes, `gap_m` how far the magnet's lowest
    /// dipole stays above the steel.
    #[must_use]
    pub fn new(
        shape: CoreShape,
        relative_permeability: f64,
        positions_m: &[[f64; 2]],
        closest_m: f64,
        gap_m: f64,
        tolerance: f64,
        magnet: Vec<Dipole>,
    ) -> Self {
        let resolution = ArrayResolution::for_tolerance(tolerance, shape, closest_m);
        let outline = Generatrix::new(shape, &[], &resolution.outline);
        // The magnet's field is sampled on the same rings: shorter panels close to it, and
        // angles enough for its modes not to pass for lower ones.
        let exchange = Rings::new(&outline, resolution.order, |z_m| {
            let near_m = PANEL * (gap_m + shape.top_m - z_m);
            resolution
                .panel_m
                .min(near_m.max(SHORTEST * shape.radius_m))
        });
        let near = gap_m / shape.radius_m;
        let eta = (1.0 + 0.5 * near * near).acosh();
        let aliased = resolution.modes as f64 - tolerance.ln() / eta;
        let angles = (2 * resolution.modes)
            .max(aliased.min(MOST_ANGLES) as usize)
            .next_multiple_of(4);
        let response = Response::new(
            outline,
            exchange,
            angles,
            resolution.modes,
            relative_permeability,
            resolution.outline.quadrature,
        );
        let points = grid_points(&response);
        let basis = Basis::new(&response, &points, closest_m, tolerance);
        let (kept, cores) = (basis.potentials.ncols(), positions_m.len());
        let turn = TAU / angles as f64;
        // Half of the pairs: the other half is their transpose.
        let pairs: Vec<(usize, usize)> = (0..cores)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .collect();
        let blocks: Vec<DMatrix<f64>> = pairs
            .par_iter()
            .map(|(i, j)| {
                let offset: [f64; 2] =
                    std::array::from_fn(|k| positions_m[*i][k] - positions_m[*j][k]);
                let sent = inverse_distances(&points, offset);
                basis.potentials.tr_mul(&(sent * &basis.potentials)) * -turn
            })
            .collect();
        let size = kept * cores;
        let mut links = DMatrix::zeros(size, size);
        let mut system = DMatrix::identity(size, size);
        for ((i, j), block) in pairs.iter().zip(&blocks) {
            for (i, j, block) in [(*i, *j, block.clone()), (*j, *i, block.transpose())] {
                let place = (i * kept, j * kept);
                let mut view = system.view_mut(place, (kept, kept));
                view -= &block * &basis.reaction;
                links.view_mut(place, (kept, kept)).copy_from(&block);
            }
        }
        let form = system.lu().solve(&links).unwrap_or(links) * turn;
        Self {
            positions_m: positions_m.to_vec(),
            points,
            reduce: basis.moments.transpose(),
            form: 0.5 * (&form + form.transpose()),
            magnet,
        }
    }

    /// Force added to the magnet's with its centre at `at_m`, N.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        self.along(at_m, [0, 1, 2])
    }

    /// Its vertical component.
    #[must_use]
    pub fn force_z_n(&self, at_m: [f64; 3]) -> f64 {
        let [force_n] = self.along(at_m, [2]);
        force_n
    }

    fn along<const N: usize>(&self, at_m: [f64; 3], axes: [usize; N]) -> [f64; N] {
        fluxform_base::progress::poll();
        let kept = self.reduce.nrows();
        let mut seen = DMatrix::zeros(kept * self.positions_m.len(), 1 + N);
        let mut grid = DMatrix::zeros(self.points.len(), 1 + N);
        for (core, [x, y]) in self.positions_m.iter().enumerate() {
            let centre = [at_m[0] - x, at_m[1] - y, at_m[2]];
            for (row, (point, n)) in self.points.iter().enumerate() {
                let from = minus(*point, centre);
                let (mut normal, mut slope) = (0.0, [0.0; N]);
                for dipole in &self.magnet {
                    let m = dipole.moment_a_m2;
                    let d = minus(from, dipole.at_m);
                    let inverse_square = 1.0 / dot(d, d);
                    let inverse_cube = inverse_square * inverse_square.sqrt();
                    let (along, out, both) = (dot(m, d), dot(*n, d), dot(*n, m));
                    normal += inverse_cube * (both - 3.0 * along * out * inverse_square);
                    // By the magnet's place: minus the derivative by the point's.
                    let scale = 3.0 * inverse_cube * inverse_square;
                    let radial = both - 5.0 * along * out * inverse_square;
                    for (slope, axis) in slope.iter_mut().zip(axes) {
                        *slope += scale * (radial * d[axis] + m[axis] * out + n[axis] * along);
                    }
                }
                grid[(row, 0)] = normal;
                for (place, s) in slope.iter().enumerate() {
                    grid[(row, 1 + place)] = *s;
                }
            }
            seen.rows_mut(core * kept, kept)
                .gemm(1.0, &self.reduce, &grid, 0.0);
        }
        let answer: DVector<f64> = &self.form * seen.column(0);
        let scale = MU_0_T_M_PER_A / (16.0 * PI * PI);
        std::array::from_fn(|place| scale * answer.dot(&seen.column(1 + place)))
    }
}

/// The potentials that neighbours send, and one core's response to them.
struct Basis {
    /// On the grid, orthonormal, [grid, kept].
    potentials: DMatrix<f64>,
    /// Moments they cause, [grid, kept].
    moments: DMatrix<f64>,
    /// <x, x'>, [kept, kept].
    reaction: DMatrix<f64>,
}

impl Basis {
    fn new(response: &Response, points: &Points, closest_m: f64, cut: f64) -> Self {
        let (rings, angles) = (response.exchange.rings.len(), response.angles);
        let offset = [closest_m, 0.0];
        let sent = inverse_distances(points, offset);
        let normal = normal_derivatives(points, offset);
        // (singular value squared, wave, potential, moments, normal derivative) on the rings.
        let mut found = Vec::new();
        for (mode, layers) in response.layers.iter().enumerate() {
            let waves: &[bool] = if mode == 0 { &[false] } else { &[false, true] };
            let norm = (if mode == 0 { 1.0 } else { 2.0 } / angles as f64).sqrt();
            let mut gram = DMatrix::zeros(rings, rings);
            let mut cross = DMatrix::zeros(rings, rings);
            for sine in waves {
                let wave = DVector::from_fn(angles, |k, _| {
                    let (s, c) = (TAU * ((mode * k) % angles) as f64 / angles as f64).sin_cos();
                    norm * if *sine { s } else { c }
                });
                let project = |matrix: &DMatrix<f64>| {
                    let mut out = DMatrix::zeros(rings, matrix.ncols());
                    for (k, share) in wave.iter().enumerate() {
                        out += matrix.rows(k * rings, rings) * *share;
                    }
                    out
                };
                let mut potential = project(&sent);
                if mode == 0 {
                    // A constant is no field.
                    for mut column in potential.column_iter_mut() {
                        let mean = column.mean();
                        column.add_scalar_mut(-mean);
                    }
                }
                gram += &potential * potential.transpose();
                cross += project(&normal) * potential.transpose();
            }
            let moments = response.exchange.moments(layers);
            let eigen = gram.symmetric_eigen();
            for (place, square) in eigen.eigenvalues.iter().enumerate() {
                let x: DVector<f64> = eigen.eigenvectors.column(place).into();
                let slope: DVector<f64> = &cross * &x / *square;
                let answer: DVector<f64> = &moments * &x;
                for sine in waves {
                    found.push((
                        *square,
                        (mode, *sine, norm),
                        x.clone(),
                        answer.clone(),
                        slope.clone(),
                    ));
                }
            }
        }
        let largest = found.iter().fold(0.0_f64, |m, f| m.max(f.0));
        found.retain(|f| f.0 > cut * cut * largest);
        let size = angles * rings;
        let spread = |(mode, sine, norm): (usize, bool, f64), on_rings: &DVector<f64>| {
            DVector::from_fn(size, |i, _| {
                let k = (mode * (i / rings)) % angles;
                let (s, c) = (TAU * k as f64 / angles as f64).sin_cos();
                norm * if sine { s } else { c } * on_rings[i % rings]
            })
        };
        let mut basis = Self {
            potentials: DMatrix::zeros(size, found.len()),
            moments: DMatrix::zeros(size, found.len()),
            reaction: DMatrix::zeros(found.len(), found.len()),
        };
        for (column, (_, wave, x, answer, slope)) in found.iter().enumerate() {
            basis.potentials.set_column(column, &spread(*wave, x));
            basis.moments.set_column(column, &spread(*wave, answer));
            for (row, (_, other, _, answer, _)) in found.iter().enumerate() {
                if wave == other {
                    basis.reaction[(row, column)] = answer.dot(slope);
                }
            }
        }
        basis
    }
}

/// 1/(4 pi |x - y|) from the grid of one core to that of a core at `offset_m` from it.
fn inverse_distances(points: &Points, offset_m: [f64; 2]) -> DMatrix<f64> {
    fluxform_base::progress::poll();
    DMatrix::from_fn(points.len(), points.len(), |row, column| {
        let (x, y) = (points[row].0, points[column].0);
        let d = minus([x[0] + offset_m[0], x[1] + offset_m[1], x[2]], y);
        1.0 / (4.0 * PI * dot(d, d).sqrt())
    })
}

/// The normal derivative of [`inverse_distances`] by the receiver.
fn normal_derivatives(points: &Points, offset_m: [f64; 2]) -> DMatrix<f64> {
    fluxform_base::progress::poll();
    DMatrix::from_fn(points.len(), points.len(), |row, column| {
        let ((x, n), y) = (points[row], points[column].0);
        let d = minus([x[0] + offset_m[0], x[1] + offset_m[1], x[2]], y);
        let square = dot(d, d);
        -dot(n, d) / (4.0 * PI * square * square.sqrt())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steel::coupling::between_cores;

    /// The coupling of two cores without reciprocity or chosen potentials: all moments of both
    /// solved at once, and the potential they send to the magnet.
    #[test]
    fn agrees_with_all_moments_of_both_cores() {
        let shape = CoreShape {
            radius_m: 0.012,
            bottom_m: -0.031,
            top_m: 0.001,
        };
        let (mu_r, closest_m) = (73.0, 0.043);
        let positions = [[0.0, 0.0], [closest_m, 0.0]];
        let resolution = ArrayResolution::for_tolerance(1e-2, shape, closest_m);
        let outline = Generatrix::new(shape, &[], &resolution.outline);
        let exchange = Rings::new(&outline, 6, |_| 0.012);
        let angles = 12;
        let response = Response::new(outline, exchange, angles, 6, mu_r, 1e-6);
        let (points, answer) = (grid_points(&response), response.matrix());
        let size = points.len();
        let mut system = DMatrix::identity(2 * size, 2 * size);
        for (row, column, dx) in [(0, size, -closest_m), (size, 0, closest_m)] {
            let back = &answer * between_cores(&points, &response, [dx, 0.0]);
            system
                .view_mut((row, column), (size, size))
                .copy_from(&-back);
        }
        let system = system.lu();
        let moment = [0.2, -0.3, 0.7];
        let added_energy = |at: [f64; 3]| {
            let mut alone = DVector::zeros(2 * size);
            for (core, [x, y]) in positions.iter().enumerate() {
                let potential = DVector::from_fn(size, |i, _| {
                    let d = minus(points[i].0, [at[0] - x, at[1] - y, at[2]]);
                    dot(moment, d) / (4.0 * PI * dot(d, d).powf(1.5))
                });
                alone
                    .rows_mut(core * size, size)
                    .copy_from(&(&answer * potential));
            }
            let moments = system.solve(&alone).unwrap() - alone;
            // m . B = mu_0 times the moments' pairing with the dipole's normal derivative.
            let mut sum = 0.0;
            for (i, q) in moments.iter().enumerate() {
                let ([x, y], (p, n)) = (positions[i / size], points[i % size]);
                let d = minus([p[0] + x, p[1] + y, p[2]], at);
                let square = dot(d, d);
                let pair = dot(n, moment) - 3.0 * dot(moment, d) * dot(n, d) / square;
                sum += q * pair / (4.0 * PI * square.powf(1.5));
            }
            -0.5 * MU_0_T_M_PER_A * sum * TAU / angles as f64
        };
        let magnet = vec![Dipole {
            at_m: [0.0; 3],
            moment_a_m2: moment,
        }];
        let added = Neighbours::new(shape, mu_r, &positions, closest_m, 0.02, 1e-3, magnet);
        for at in [[0.007, 0.004, 0.033], [0.021, -0.017, 0.041]] {
            let force = added.force_n(at);
            let size = dot(force, force).sqrt();
            for axis in 0..3 {
                let shifted = |h: f64| {
                    let mut at = at;
                    at[axis] += h;
                    added_energy(at)
                };
                let slope = (shifted(1e-4) - shifted(-1e-4)) / 2e-4;
                let miss = (force[axis] + slope).abs() / size;
                assert!(
                    miss < 5e-3,
                    "{at:?} {axis}: {} {slope} {miss:e}",
                    force[axis]
                );
            }
            assert!((added.force_z_n(at) - force[2]).abs() < 1e-12 * size);
        }
    }
}
