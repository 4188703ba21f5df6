//! The part of the pull that comes from the cores magnetising each other.
//!
//! The neighbours' field at a core is smooth: a few potentials x_mu, mode by mode, carry it. Write
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

use nalgebra::{DMatrix, DVector, Dyn};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

use super::reaction::Dipole;
use crate::steel::CoreShape;
use crate::steel::array::ArrayResolution;
use crate::steel::coupling::{GridPoint, grid_points, integrate_stretched, shifted};
use crate::steel::exchange::Grading;
use crate::steel::generatrix::Generatrix;
use crate::steel::offsets::Offsets;
use crate::steel::response::{Response, Rings};
use crate::steel::symmetry::Motion;
use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_numerics::bounded_eigen::symmetric_eigen;
use fluxform_numerics::dispatch::{self, Kernel, LANES, Lanes};
use fluxform_numerics::vec3::{dot, minus, plus};

/// Longest panel of the exchange grid, in distances from the magnet.
const PANEL: f64 = 1.5;
/// Shortest panel worth having, in radii: closer magnets are left to the estimate.
const SHORTEST: f64 = 0.2;
/// Places whose forces are computed together.
const TOGETHER: usize = 8;
/// Most angles of the exchange grid.
const MOST_ANGLES: f64 = 48.0;

type Points = Vec<GridPoint>;

/// The quadratic form of an array.
#[derive(Debug, Clone)]
pub struct Neighbours {
    positions_m: Vec<[f64; 2]>,
    /// Exchange grid of a core, index = angle * rings + ring, side by side.
    points: Vec<[Lanes; 6]>,
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
        let grading = Grading {
            shortest_m: resolution.panel_m,
            ends_m: [shape.top_m, shape.top_m, shape.bottom_m, shape.bottom_m],
        };
        let exchange = Rings::graded_within(&outline, resolution.order, &grading, |z_m| {
            let near_m = PANEL * (gap_m + shape.top_m - z_m);
            near_m.max(SHORTEST * shape.radius_m)
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
        let kept = basis.potentials.ncols();
        let turn = TAU / angles as f64;
        let exchanged = |offset_m: [f64; 2]| {
            let mut sent = DMatrix::zeros(points.len(), kept);
            let rings = response.exchange.rings.len();
            for angle in 0..angles {
                let columns = columns(&response, &points, (offset_m, angle), inverse_distance);
                let potentials = basis.potentials.rows(angle * rings, rings);
                sent.gemm(1.0, &columns, &potentials, 1.0);
            }
            basis.potentials.transpose() * sent * -turn
        };
        // A motion takes the potentials to combinations of them.
        let turned = |motion: &Motion| {
            let mut potentials = DMatrix::zeros(points.len(), kept);
            for (before, after) in motion.on_grid(angles, points.len()) {
                let image = basis.potentials.rows_range(after);
                potentials.rows_range_mut(before).copy_from(&image);
            }
            basis.potentials.tr_mul(&potentials)
        };
        let (system, links) = exchange_system(positions_m, &basis.reaction, exchanged, turned);
        let form = system.lu().solve(&links).unwrap_or(links) * turn;
        Self {
            positions_m: positions_m.to_vec(),
            points: points.chunks(LANES).map(abreast).collect(),
            reduce: basis.moments.transpose(),
            form: 0.5 * (&form + form.transpose()),
            magnet,
        }
    }

    /// Force added to the magnet's with its centre at `at_m`, N.
    #[must_use]
    pub fn force_n(&self, at_m: [f64; 3]) -> [f64; 3] {
        let [force_n] = self.along([at_m], [0, 1, 2]);
        force_n
    }

    /// Its vertical component at several places.
    #[must_use]
    pub fn forces_z_n(&self, places_m: &[[f64; 3]]) -> Vec<f64> {
        let mut forces_n = Vec::with_capacity(places_m.len());
        let (together, rest) = places_m.as_chunks::<TOGETHER>();
        for places_m in together {
            forces_n.extend(self.along(*places_m, [2]).as_flattened());
        }
        for place_m in rest {
            forces_n.extend(self.along([*place_m], [2]).as_flattened());
        }
        forces_n
    }

    /// Of `P` places the components of the force along `axes`.
    fn along<const P: usize, const N: usize>(
        &self,
        places_m: [[f64; 3]; P],
        axes: [usize; N],
    ) -> [[f64; N]; P] {
        // Of every place: of every core the field, then of every core its slope along the first axis,
        // and so on.
        let cores = self.positions_m.len();
        let columns = cores * (1 + N);
        let mut grid = DMatrix::zeros(self.reduce.ncols(), P * columns);
        let mut out = vec![(Lanes::splat(0.0), [Lanes::splat(0.0); N]); self.points.len()];
        for (place, at_m) in places_m.iter().enumerate() {
            fluxform_base::progress::poll();
            let mut grid = grid.columns_mut(place * columns, columns);
            for (core, [x, y]) in self.positions_m.iter().enumerate() {
                dispatch::run(MagnetField {
                    points: &self.points,
                    magnet: &self.magnet,
                    centre: [at_m[0] - x, at_m[1] - y, at_m[2]],
                    axes,
                    out: &mut out,
                });
                for part in 0..=N {
                    let mut column = grid.column_mut(core + cores * part);
                    let rows = column.as_mut_slice().chunks_mut(LANES);
                    for (rows, (normal, slopes)) in rows.zip(&out) {
                        part.checked_sub(1)
                            .map_or(normal, |axis| &slopes[axis])
                            .store(rows);
                    }
                }
            }
        }
        // One product: packing the factor again for every core and place takes longer than multiplying
        // by it.
        let seen = &self.reduce * &grid;
        let size = self.reduce.nrows() * cores;
        let seen = seen.reshape_generic(Dyn(size), Dyn(P * (1 + N)));
        let scale = MU_0_T_M_PER_A / (16.0 * PI * PI);
        std::array::from_fn(|place| {
            let first = place * (1 + N);
            let answer: DVector<f64> = &self.form * seen.column(first);
            std::array::from_fn(|axis| scale * answer.dot(&seen.column(first + 1 + axis)))
        })
    }
}

/// Normal derivatives of the potential of a magnet at points, times 4 pi, and their slopes by the magnet's place.
struct MagnetField<'a, const N: usize> {
    /// Places and normals, side by side.
    points: &'a [[Lanes; 6]],
    magnet: &'a [Dipole],
    centre: [f64; 3],
    axes: [usize; N],
    out: &'a mut [(Lanes, [Lanes; N])],
}

impl<const N: usize> Kernel for MagnetField<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<const FMA: bool>(self) {
        let scalar = |a: &[Lanes; 3], b: &[Lanes; 3]| {
            a[0].mul_add::<FMA>(b[0], a[1].mul_add::<FMA>(b[1], a[2] * b[2]))
        };
        for ([x, y, z, nx, ny, nz], out) in self.points.iter().zip(self.out) {
            let n = [*nx, *ny, *nz];
            let (mut normal, mut slopes) = (Lanes::splat(0.0), [Lanes::splat(0.0); N]);
            for dipole in self.magnet {
                let m = dipole.moment_a_m2.map(Lanes::splat);
                let at_m = plus(self.centre, dipole.at_m);
                let d = [(x, 0), (y, 1), (z, 2)].map(|(x, axis)| *x - at_m[axis]);
                let inverse_square = Lanes::splat(1.0) / scalar(&d, &d);
                let inverse_cube = inverse_square * inverse_square.sqrt();
                let (along, across, both) = (scalar(&m, &d), scalar(&n, &d), scalar(&n, &m));
                let product = along * across * inverse_square;
                normal = (both - product * 3.0).mul_add::<FMA>(inverse_cube, normal);
                // By the magnet's place: minus the derivative by the point's.
                let scale = inverse_cube * inverse_square * 3.0;
                let radial = both - product * 5.0;
                for (slope, axis) in slopes.iter_mut().zip(self.axes) {
                    let sideways = m[axis].mul_add::<FMA>(across, n[axis] * along);
                    *slope = radial
                        .mul_add::<FMA>(d[axis], sideways)
                        .mul_add::<FMA>(scale, *slope);
                }
            }
            *out = (normal, slopes);
        }
    }
}

/// Places and normals side by side.
fn abreast(points: &[GridPoint]) -> [Lanes; 6] {
    let part = |k: usize| {
        Lanes(std::array::from_fn(|lane| {
            let (at_m, normal) = points[lane.min(points.len() - 1)];
            [at_m, normal].as_flattened()[k]
        }))
    };
    std::array::from_fn(part)
}

/// The system 1 - L R of all cores and its links L, of blocks that `exchanged` gives for an offset and
/// what a motion does to their columns, `turned`.
fn exchange_system(
    positions_m: &[[f64; 2]],
    reaction: &DMatrix<f64>,
    exchanged: impl Fn([f64; 2]) -> DMatrix<f64> + Sync,
    turned: impl Fn(&Motion) -> DMatrix<f64>,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let (kept, cores) = (reaction.ncols(), positions_m.len());
    let offsets = Offsets::of_pairs(positions_m);
    let blocks: Vec<DMatrix<f64>> = (offsets.first_m.par_iter())
        .map(|offset_m| exchanged(*offset_m))
        .collect();
    let turned: Vec<DMatrix<f64>> = offsets.motions.iter().map(turned).collect();
    // Half of the pairs: the other half is their transpose.
    let mut pairs = Vec::with_capacity(cores * cores / 2);
    for (i, a) in positions_m.iter().enumerate() {
        for (j, b) in positions_m[..i].iter().enumerate() {
            let link = offsets.of([a[0] - b[0], a[1] - b[1]]);
            pairs.extend(link.map(|link| (link, (i, j))));
        }
    }
    pairs.sort_unstable();
    let size = kept * cores;
    let mut links = DMatrix::zeros(size, size);
    let mut system = DMatrix::identity(size, size);
    for pairs in pairs.chunk_by(|(a, _), (b, _)| a == b) {
        let (number, motion) = pairs[0].0;
        let block = turned[motion].tr_mul(&blocks[number]) * &turned[motion];
        for (block, back) in [(&block, false), (&block.transpose(), true)] {
            let answered = block * reaction;
            for (_, (i, j)) in pairs {
                let (to, from) = if back { (j, i) } else { (i, j) };
                let place = (to * kept, from * kept);
                let mut view = system.view_mut(place, (kept, kept));
                view -= &answered;
                links.view_mut(place, (kept, kept)).copy_from(block);
            }
        }
    }
    (system, links)
}

/// Divisor of a wave of azimuthal number `mode` on the grid's angles.
fn norm_of(mode: usize, angles: usize) -> f64 {
    (if mode == 0 { 1.0 } else { 2.0 } / angles as f64).sqrt()
}

/// Whether it is the sine, for every wave of that azimuthal number.
fn waves_of(mode: usize) -> &'static [bool] {
    if mode == 0 { &[false] } else { &[false, true] }
}

/// Of every azimuthal mode, the products with a potential's columns on the rings of the potentials
/// that a neighbour at the closest distance sends, and of their normal derivatives.
fn products_of_modes(
    response: &Response,
    points: &Points,
    closest_m: f64,
) -> Vec<(DMatrix<f64>, DMatrix<f64>)> {
    let (rings, angles) = (response.exchange.rings.len(), response.angles);
    let empty = (DMatrix::zeros(rings, rings), DMatrix::zeros(rings, rings));
    let mut products = vec![empty; response.layers.len()];
    for sender_angle in 0..angles {
        let at = ([closest_m, 0.0], sender_angle);
        let (sent, normal) = rayon::join(
            || columns(response, points, at, inverse_distance),
            || columns(response, points, at, normal_derivative),
        );
        let project = |matrix: &DMatrix<f64>, mode: usize, sine: bool| {
            let mut out = DMatrix::zeros(rings, rings);
            for k in 0..angles {
                let turn = TAU * ((mode * k) % angles) as f64 / angles as f64;
                let (s, c) = turn.sin_cos();
                let share = norm_of(mode, angles) * if sine { s } else { c };
                out += matrix.rows(k * rings, rings) * share;
            }
            out
        };
        products
            .par_iter_mut()
            .enumerate()
            .for_each(|(mode, (gram, cross))| {
                for sine in waves_of(mode) {
                    let mut potential = project(&sent, mode, *sine);
                    if mode == 0 {
                        // A constant is no field.
                        for mut column in potential.column_iter_mut() {
                            let mean = column.mean();
                            column.add_scalar_mut(-mean);
                        }
                    }
                    *gram += &potential * potential.transpose();
                    *cross += project(&normal, mode, *sine) * potential.transpose();
                }
            });
    }
    products
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
        let products = products_of_modes(response, points, closest_m);
        // (singular value squared, wave, potential, moments, normal derivative) on the rings.
        let mut found = Vec::new();
        for ((mode, layers), (gram, cross)) in response.layers.iter().enumerate().zip(products) {
            let (waves, norm) = (waves_of(mode), norm_of(mode, angles));
            let moments = response.exchange.moments(layers);
            let eigen =
                symmetric_eigen(gram).expect("the products of finite potentials have eigenvectors");
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

/// 1/(4 pi |x - y|).
fn inverse_distance((x, _): GridPoint, (y, _): GridPoint) -> f64 {
    let d = minus(x, y);
    1.0 / (4.0 * PI * dot(d, d).sqrt())
}

/// The normal derivative of [`inverse_distance`] by the receiver.
fn normal_derivative((x, n): GridPoint, (y, _): GridPoint) -> f64 {
    let d = minus(x, y);
    let square = dot(d, d);
    -dot(n, d) / (4.0 * PI * square * square.sqrt())
}

/// `kernel` from the rings at one angle of a core's grid to the grid of a core at `offset_m` from it.
fn columns(
    response: &Response,
    points: &Points,
    (offset_m, angle): ([f64; 2], usize),
    kernel: impl Fn(GridPoint, GridPoint) -> f64,
) -> DMatrix<f64> {
    fluxform_base::progress::poll();
    let rings = response.exchange.rings.len();
    let mut columns = DMatrix::from_fn(points.len(), rings, |row, ring| {
        kernel(shifted(points[row], offset_m), points[angle * rings + ring])
    });
    let mut view = columns.as_view_mut();
    integrate_stretched(&mut view, points, response, (offset_m, angle), kernel);
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::steel::array_cost::ArrayCost;
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
            assert!((added.forces_z_n(&[at])[0] - force[2]).abs() < 1e-12 * size);
        }
    }

    /// Hundreds of coupled cores once took gigabytes that nobody had stated.
    #[test]
    fn the_cost_that_is_stated_is_what_the_coupling_takes() {
        let magnet = vec![Dipole {
            at_m: [0.0; 3],
            moment_a_m2: [0.2, -0.1, 0.9],
        }];
        for (length_m, apart, tolerance) in
            [(0.11, 4.2, 2e-3), (0.03, 2.5, 2e-3), (0.11, 10.0, 1e-2)]
        {
            let shape = CoreShape {
                radius_m: 0.012,
                bottom_m: -length_m,
                top_m: 0.0,
            };
            let closest_m = apart * shape.radius_m;
            let positions: Vec<[f64; 2]> =
                (0..4).map(|k| [closest_m * f64::from(k), 0.0]).collect();
            let made = Neighbours::new(
                shape,
                500.0,
                &positions,
                closest_m,
                0.03,
                tolerance,
                magnet.clone(),
            );
            let took = 5.0 * 8.0 * made.form.len() as f64;
            let stated = ArrayCost::of_pull(shape, &positions, closest_m, tolerance).bytes;
            let ratio = stated / took;
            assert!((0.25..8.0).contains(&ratio), "{length_m} {apart}: {ratio}");
        }
    }

    /// Rings an even gap apart grew with a core's length: 100 panels for 4 m, and matrices as their
    /// square.
    #[test]
    fn long_cores_have_few_rings_and_the_same_pull() {
        let shape = |length_m: f64| CoreShape {
            radius_m: 0.012,
            bottom_m: -length_m,
            top_m: 0.0,
        };
        let positions = [[0.0, 0.0], [0.043, 0.0]];
        let magnet = vec![Dipole {
            at_m: [0.0; 3],
            moment_a_m2: [0.2, -0.1, 0.9],
        }];
        let of = |length_m: f64, tolerance: f64| {
            let magnet = magnet.clone();
            Neighbours::new(
                shape(length_m),
                500.0,
                &positions,
                0.043,
                0.02,
                tolerance,
                magnet,
            )
        };
        let counts = [0.3, 3.0, 30.0].map(|length_m| of(length_m, 0.1).reduce.ncols());
        assert!(counts[2] < 3 * counts[0], "{counts:?}");
        // The layer far down is smooth: a finer solution agrees as it does for a short core.
        let at = [0.011, 0.007, 0.021];
        for length_m in [0.1, 1.3] {
            let [coarse, fine] = [5e-3, 1e-3].map(|tolerance| of(length_m, tolerance).force_n(at));
            let miss = dot(minus(coarse, fine), minus(coarse, fine)).sqrt();
            let size = dot(fine, fine).sqrt();
            assert!(miss < 1e-2 * size, "{length_m}: {miss:e} of {size:e}");
        }
    }
}
