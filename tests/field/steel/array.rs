//! Arrays of cored coils: every core answers every coil.

use fluxform_field::components::Components;
use std::f64::consts::{PI, TAU};
use std::time::Instant;

use fluxform_base::units::MU_0_T_M_PER_A;
use fluxform_coil::inductance::self_inductance_h;
use fluxform_coil::mutual::mutual_inductance_h;
use fluxform_field::frame::to_cartesian;
use fluxform_field::steel::CoreShape;
use fluxform_field::steel::array::{ArrayResolution, CoupledArray};
use fluxform_field::steel::clearance::Clearance;
use fluxform_field::steel::cored_coil::CoredCoil;
use fluxform_field::steel::coupling::Coupling;
use fluxform_field::steel::equivalent_dipoles::ArraySources;
use fluxform_field::steel::exchange::Grading;
use fluxform_field::steel::generatrix::{Face, Generatrix};
use fluxform_field::steel::magnetized::MagnetizedCore;
use fluxform_field::steel::response::{Response, Rings};
use fluxform_field::winding::Winding;
use fluxform_numerics::gauss;
use fluxform_numerics::lagrange_basis::Basis;
use nalgebra::DMatrix;

use super::support::{Design, SEED_COIL, SEED_CORE, number, oracle};

const MU_R: f64 = 1000.0;
const LOWEST_M: f64 = 0.01;
const SCATTER: [[f64; 2]; 5] = [
    [0.0, 0.0],
    [0.053, 0.007],
    [-0.031, 0.049],
    [0.022, -0.061],
    [-0.047, -0.013],
];

fn grid(side: usize, pitch_m: f64) -> Vec<[f64; 2]> {
    let middle = 0.5 * (side as f64 - 1.0);
    (0..side * side)
        .map(|i| {
            [
                pitch_m * ((i % side) as f64 - middle),
                pitch_m * ((i / side) as f64 - middle),
            ]
        })
        .collect()
}

fn at(positions: &[[f64; 2]], tolerance: f64, closest_m: f64) -> CoupledArray {
    let resolution = ArrayResolution::for_tolerance(tolerance, SEED_CORE, closest_m);
    CoupledArray::at_resolution(&SEED_COIL, SEED_CORE, MU_R, positions, &resolution)
        .expect("off the winding's edges")
}

fn solve(positions: &[[f64; 2]], tolerance: f64) -> CoupledArray {
    CoupledArray::new(&SEED_COIL, SEED_CORE, MU_R, positions, tolerance, LOWEST_M)
        .expect("off the winding's edges")
}

/// The steel's part per ampere of `drive` at a point: dB_z/dz and B_z.
fn steel(array: &CoupledArray, points: &[[f64; 3]], drive: usize) -> Vec<[f64; 2]> {
    let sources = ArraySources::of_array(array, Clearance::above(LOWEST_M, LOWEST_M), 1e-8);
    let mut out = vec![0.0; array.positions_m.len() * Components::All.count() * points.len()];
    sources.sample(points, Components::All, &mut out);
    let component = |part: usize, point: usize| {
        out[(drive * Components::All.count() + part) * points.len() + point]
    };
    (0..points.len())
        .map(|i| [component(4, i), component(7, i)])
        .collect()
}

/// Points above an array, generic.
fn above(positions: &[[f64; 2]]) -> Vec<[f64; 3]> {
    positions
        .iter()
        .flat_map(|[x, y]| {
            [
                [0.0, 0.0, 0.011],
                [0.007, -0.003, 0.013],
                [-0.021, 0.017, 0.031],
            ]
            .map(|[dx, dy, z]| [x + dx, y + dy, z])
        })
        .collect()
}

/// Largest difference of inductances (relative to the largest) and of dB_z/dz (to its largest).
fn differences(a: &CoupledArray, b: &CoupledArray) -> (f64, f64) {
    let inductance =
        (&a.added_inductance_h - &b.added_inductance_h).amax() / a.added_inductance_h.amax();
    let points = above(&a.positions_m);
    let mut gradient = 0.0_f64;
    for drive in 0..a.positions_m.len() {
        let (one, other) = (steel(a, &points, drive), steel(b, &points, drive));
        let size = one.iter().fold(0.0_f64, |m, g| m.max(g[0].abs()));
        for (g, h) in one.iter().zip(&other) {
            gradient = gradient.max((g[0] - h[0]).abs() / size);
        }
    }
    (inductance, gradient)
}

#[test]
fn finite_elements_agree_on_nine_coils() {
    let oracle = oracle("fem_array_centre");
    let array = solve(&grid(3, 0.05), 1e-4);
    let inductance = self_inductance_h(&SEED_COIL) + array.added_inductance_h[(4, 4)];
    // 3-D finite elements, 0.1 %; alone the coil has 0.1841 H.
    assert!(
        (inductance / 0.2130 - 1.0).abs() < 1e-3,
        "{inductance} H in the centre"
    );
    let rows = oracle["rows"].as_array().expect("rows");
    assert_eq!(rows.len(), 18);
    let value = |row: usize, key: &str| number(&rows[row][key]);
    let points: Vec<[f64; 3]> = (0..rows.len())
        .map(|i| ["x_mm", "y_mm", "z_mm"].map(|key| 1e-3 * value(i, key)))
        .collect();
    for (row, [gradient, b_z]) in steel(&array, &points, 4).into_iter().enumerate() {
        let [x, y, z] = points[row];
        let air = SEED_COIL.field(x.hypot(y), z).expect("above");
        for (name, ours, key) in [
            ("dBz/dz", gradient + air.dbz_dz, "dBzdz_array_T_per_m_per_A"),
            ("Bz", b_z + air.b_z, "Bz_array_T_per_A"),
        ] {
            let peak = (0..rows.len())
                .filter(|i| points[*i][2] == z)
                .fold(0.0_f64, |p, i| p.max(value(i, key).abs()));
            let off = (ours - value(row, key)).abs() / peak;
            assert!(off < 2e-3, "{name} at {x} {y} {z} is off by {off:e}");
        }
    }
}

/// Prints unknowns, milliseconds, errors and estimate:
/// `cargo test --test field steel resolutions -- --nocapture`.
#[test]
fn finer_resolutions_agree_and_the_estimate_covers_the_error() {
    let fine = at(&SCATTER, 1e-6, 0.05);
    println!("tolerance size iterations      ms  error of L  error of g  estimate");
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let started = Instant::now();
        let array = solve(&SCATTER, tolerance);
        let ms = 1e3 * started.elapsed().as_secs_f64();
        let (inductance, gradient) = differences(&fine, &array);
        println!(
            "{tolerance:8.0e} {:5} {:10} {ms:7.0}  {inductance:10.1e}  {gradient:10.1e}  {:8.1e}",
            array.response.size(),
            array.iterations,
            array.relative_error,
        );
        assert!(array.relative_error <= tolerance, "{tolerance:e}");
        assert!(
            inductance.max(gradient) < array.relative_error,
            "at {tolerance:e}: errors {inductance:e}, {gradient:e}, estimate {:e}",
            array.relative_error
        );
    }
}

/// Driven coil and listening coil may change places, which no step of the solution knows; and
/// the steel never takes energy away.
#[test]
fn mutual_inductances_are_reciprocal_and_positive_definite() {
    for tolerance in [1e-3, 1e-4, 1e-5] {
        let array = at(&SCATTER, tolerance, 0.05);
        let added = &array.added_inductance_h;
        let skew = (added - added.transpose()).amax() / added.amax();
        println!("tolerance {tolerance:e}: M_ij - M_ji {skew:.1e}");
        assert!(skew < tolerance, "at {tolerance:e}: {skew:e}");
        let even = 0.5 * (added + added.transpose());
        let least = even.symmetric_eigenvalues().min();
        assert!(least > 0.0, "{least}");
    }
}

#[test]
fn one_coil_is_the_single_coil() {
    let array = at(&[[0.31, -0.17]], 1e-6, f64::INFINITY);
    let outline = ArrayResolution::for_tolerance(1e-6, SEED_CORE, f64::INFINITY).outline;
    let single = CoredCoil::at_resolution(&SEED_COIL, SEED_CORE, MU_R, &outline)
        .expect("off the winding's edges");
    let ratio = array.added_inductance_h[(0, 0)] / single.added_inductance_h;
    assert!((ratio - 1.0).abs() < 1e-13, "{ratio}");
    let points = [[0.31, -0.17, 0.013], [0.324, -0.163, 0.021]];
    for (point, [gradient, b_z]) in points.iter().zip(steel(&array, &points, 0)) {
        let field = single
            .core
            .field((point[0] - 0.31).hypot(point[1] + 0.17), point[2]);
        assert!((gradient / field.dbz_dz - 1.0).abs() < 1e-7, "{point:?}");
        assert!((b_z / field.b_z - 1.0).abs() < 1e-7, "{point:?}");
    }
}

/// A metre apart the coils keep their own inductance, and share that of two dipoles, each with
/// its core.
#[test]
fn coils_far_apart_are_single_coils_and_dipoles() {
    let distance = 2.3;
    let array = solve(&[[0.0, 0.0], [distance, 0.0]], 1e-4);
    let single = Design {
        winding: SEED_COIL,
        core: SEED_CORE,
        mu_r: MU_R,
    }
    .solve(1e-6);
    let own = array.added_inductance_h[(0, 0)] / single.added_inductance_h;
    assert!((own - 1.0).abs() < 1e-4, "{own}");
    // B_z = mu_0 m / (2 pi z^3) far above.
    let z: f64 = 7.0;
    let b_z = single.field(0.0, z).expect("above").b_z;
    let moment_field = b_z * 2.0 * PI * (z + 0.052).powi(3) / MU_0_T_M_PER_A;
    let dipoles = -MU_0_T_M_PER_A * moment_field.powi(2) / (4.0 * PI * distance.powi(3));
    let mutual = mutual_inductance_h(&SEED_COIL, distance) + array.added_inductance_h[(0, 1)];
    assert!(
        (mutual / dipoles - 1.0).abs() < 0.01,
        "{mutual:e} {dipoles:e}"
    );
}

#[test]
fn an_array_turned_by_a_right_angle_is_the_same_array() {
    let turned = SCATTER.map(|[x, y]| [0.7 - y, -0.3 + x]);
    let (a, b) = (at(&SCATTER, 1e-4, 0.05), at(&turned, 1e-4, 0.05));
    let off = (&a.added_inductance_h - &b.added_inductance_h).amax();
    assert!(off < 1e-7 * a.added_inductance_h.amax(), "{off:e}");
    // By another angle the grids of angles differ: the same to the tolerance.
    let (s, c) = 0.37_f64.sin_cos();
    let turned = SCATTER.map(|[x, y]| [c * x - s * y, s * x + c * y]);
    let b = at(&turned, 1e-4, 0.05);
    let off = (&a.added_inductance_h - &b.added_inductance_h).amax();
    assert!(off < 1e-4 * a.added_inductance_h.amax(), "{off:e}");
}

/// The nine coils by symmetry from three drives, and without: a nanometre breaks it.
#[test]
fn symmetry_changes_nothing() {
    let square = grid(3, 0.05);
    let mut broken = square.clone();
    for (i, place) in broken.iter_mut().enumerate() {
        place[0] += 1e-9 * (1.7 * i as f64).sin();
        place[1] += 1e-9 * (2.3 * i as f64).cos();
    }
    let (a, b) = (at(&square, 1e-3, 0.05), at(&broken, 1e-3, 0.05));
    let (inductance, gradient) = differences(&a, &b);
    assert!(inductance < 2e-5, "{inductance:e}");
    assert!(gradient < 2e-5, "{gradient:e}");
}

/// The equation itself, at points that are no nodes, by plain sums over the surfaces:
/// v / mu_r + (1 - 1/mu_r) (W v - phi) is the same number all over a core.
#[test]
fn the_potentials_satisfy_the_integral_equation_between_the_nodes() {
    let array = at(&SCATTER, 1e-5, 0.05);
    let top = SEED_CORE.top_m;
    let bottom = SEED_CORE.bottom_m;
    for drive in [0, 3] {
        let layers: Vec<DMatrix<f64>> = (0..SCATTER.len())
            .map(|core| array.layers(drive, core))
            .collect();
        let strongest = layers[drive].amax();
        for (core, axis) in SCATTER.iter().enumerate() {
            // (radius, angle, face): the second against the first, along a straight line.
            let places = [
                (0.0031, 0.7, Face::Top),
                (0.0063, 3.4, Face::Top),
                (0.0031, 0.7, Face::Bottom),
                (0.0057, 5.1, Face::Bottom),
            ];
            let residual = |(r, theta, face): (f64, f64, Face)| {
                let z = if face == Face::Top { top } else { bottom };
                let x = [axis[0] + r * theta.cos(), axis[1] + r * theta.sin(), z];
                let (own, flux) = value_and_layers(&array, &layers, core, (r, theta, face), x);
                (x, own / MU_R, flux)
            };
            let share = 1.0 - 1.0 / MU_R;
            let (x0, v0, w0) = residual(places[0]);
            for place in &places[1..] {
                let (x1, v1, w1) = residual(*place);
                let coil = coil_potential(SCATTER[drive], x0, x1);
                let off = (v1 - v0) + share * ((w1 - w0) - coil);
                assert!(
                    off.abs() < 3e-5 * strongest,
                    "drive {drive}, core {core}, {place:?}: {:e} of the strongest layer",
                    off / strongest
                );
            }
        }
    }
}

/// v at a point of a core's end face, and W v of that core plus the other cores' -phi there.
fn value_and_layers(
    array: &CoupledArray,
    layers: &[DMatrix<f64>],
    core: usize,
    (r, theta, face): (f64, f64, Face),
    x: [f64; 3],
) -> (f64, f64) {
    const ANGLES: usize = 120;
    let outline = &array.response.outline;
    let order = outline.order;
    let basis = Basis::new(gauss::rule(order));
    let trig = |columns: usize, theta: f64| -> Vec<f64> {
        (0..columns)
            .map(|c| {
                let angle = c.div_ceil(2) as f64 * theta;
                if c % 2 == 1 || c == 0 {
                    angle.cos()
                } else {
                    angle.sin()
                }
            })
            .collect()
    };
    let (panel, index) = outline
        .panels
        .iter()
        .zip(0..)
        .find(|(p, _)| p.face == face && p.range_m().0 <= r && r <= p.range_m().1)
        .expect("on the face");
    let mut weights = vec![0.0; order];
    let place = 2.0 * (r - panel.from_m) / (panel.to_m - panel.from_m) - 1.0;
    basis.weights(place, &mut weights);
    let columns = layers[core].ncols();
    let at_x: f64 = trig(columns, theta)
        .iter()
        .enumerate()
        .map(|(c, t)| {
            let nodes = weights.iter().enumerate();
            t * nodes
                .map(|(k, w)| w * layers[core][(index * order + k, c)])
                .sum::<f64>()
        })
        .sum();
    let mut sum = 0.0;
    for (other, layer) in layers.iter().enumerate() {
        for k in 0..ANGLES {
            let angle = TAU * (k as f64 + 0.5) / ANGLES as f64;
            let (s, c) = angle.sin_cos();
            let modes = trig(columns, angle);
            for (i, node) in outline.nodes.iter().enumerate() {
                // A flat face does not act on itself.
                let same = if face == Face::Top { 1.0 } else { -1.0 };
                if other == core && node.normal[1] == same {
                    continue;
                }
                let v: f64 = modes
                    .iter()
                    .enumerate()
                    .map(|(m, t)| t * layer[(i, m)])
                    .sum();
                let d = [
                    x[0] - array.positions_m[other][0] - node.r_m * c,
                    x[1] - array.positions_m[other][1] - node.r_m * s,
                    x[2] - node.z_m,
                ];
                let square: f64 = d.iter().map(|v| v * v).sum();
                let along = node.normal[0] * (c * d[0] + s * d[1]) + node.normal[1] * d[2];
                let kernel = along / (4.0 * PI * square * square.sqrt());
                let area = node.r_m * node.weight_m * TAU / ANGLES as f64;
                // W of a constant is zero: what is subtracted makes the own integral regular.
                let shift = if other == core { at_x } else { 0.0 };
                sum += kernel * area * (v - shift);
            }
        }
    }
    (at_x, sum)
}

/// Potential of the winding at `axis` between two points, by its field along the line.
fn coil_potential(axis: [f64; 2], from: [f64; 3], to: [f64; 3]) -> f64 {
    let step: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
    let rule = gauss::rule(12);
    let pieces = 60;
    let mut rise = 0.0;
    for piece in 0..pieces {
        for (x, weight) in rule.nodes.iter().zip(&rule.weights) {
            let t = (f64::from(piece) + 0.5 + 0.5 * x) / f64::from(pieces);
            let p: [f64; 3] = std::array::from_fn(|i| from[i] + t * step[i]);
            let (dx, dy) = (p[0] - axis[0], p[1] - axis[1]);
            let r = dx.hypot(dy);
            let field = SEED_COIL.field(r, p[2]).expect("off the edges");
            let along = field.b_r * (dx * step[0] + dy * step[1]) / r + field.b_z * step[2];
            rise -= 0.5 * weight / f64::from(pieces) * along / MU_0_T_M_PER_A;
        }
    }
    rise
}

/// Windings 1 mm apart; and cores 1 mm apart, where the caps on resolution bind: the estimate
/// says so.
#[test]
fn close_neighbours_state_their_error() {
    let near = solve(&[[0.0, 0.0], [0.0276, 0.0276]], 1e-4);
    assert!(near.relative_error <= 1e-4, "{:e}", near.relative_error);
    let thin = Winding {
        outer_radius_m: 0.0124,
        ..SEED_COIL
    };
    let started = Instant::now();
    let pair = [[0.0, 0.0], [0.025, 0.0]];
    let closer = CoupledArray::new(&thin, SEED_CORE, MU_R, &pair, 1e-3, LOWEST_M)
        .expect("off the winding's edges");
    println!(
        "1 mm between the cores: {} unknowns a core, {} iterations, {:.1} s, estimate {:.0e}",
        closer.response.size(),
        closer.iterations,
        started.elapsed().as_secs_f64(),
        closer.relative_error
    );
    assert!(closer.response.size() <= 3500);
    assert!(closer.relative_error > 0.03, "{:e}", closer.relative_error);
}

#[test]
fn twenty_five_coils_are_solved() {
    let started = Instant::now();
    let array = at(&grid(5, 0.05), 1e-3, 0.05);
    println!(
        "25 coils: size {}, {} iterations, {:.1} s",
        array.response.size(),
        array.iterations,
        started.elapsed().as_secs_f64()
    );
    let added = &array.added_inductance_h;
    assert!((added - added.transpose()).amax() < 1e-3 * added.amax());
    assert!((added[(0, 0)] / added[(24, 24)] - 1.0).abs() < 1e-12);
    // The more neighbours return the flux, the more of it there is.
    assert!(added[(12, 12)] > added[(7, 7)] && added[(7, 7)] > added[(0, 0)]);
}

/// A core between two coils takes their flux: they see less of each other.
#[test]
fn neighbours_weaken_what_a_coil_sends_beyond_them() {
    let shape = CoreShape {
        top_m: 0.0037,
        ..SEED_CORE
    };
    let solve = |positions: &[[f64; 2]]| {
        let resolution = ArrayResolution::for_tolerance(1e-3, shape, 0.047);
        CoupledArray::at_resolution(&SEED_COIL, shape, MU_R, positions, &resolution)
            .expect("off the winding's edges")
    };
    let two = solve(&[[0.0, 0.0], [0.094, 0.0]]);
    let three = solve(&[[0.0, 0.0], [0.047, 0.0], [0.094, 0.0]]);
    let (without, with) = (
        two.added_inductance_h[(0, 1)],
        three.added_inductance_h[(0, 2)],
    );
    assert!(without < 0.0 && with > without, "{without:e} {with:e}");
}

/// The dipoles that stand for a core against its field by loops, down to a thirteenth of its radius.
#[test]
fn near_fields_by_dipoles_are_those_by_loops() {
    let resolution = ArrayResolution::for_tolerance(1e-8, SEED_CORE, f64::INFINITY);
    let one = CoupledArray::at_resolution(&SEED_COIL, SEED_CORE, MU_R, &[[0.0; 2]], &resolution)
        .expect("off the winding's edges");
    let layer = one.layers(0, 0).column(0).iter().copied().collect();
    let core = MagnetizedCore::new(one.response.outline.clone(), layer);
    for distance_m in [0.0009, 0.0031, 0.017] {
        let sources = ArraySources::of_array(&one, Clearance::above(distance_m, distance_m), 1e-7);
        let points: Vec<[f64; 3]> = [0.0, 0.0031, 0.0089, 0.0117, 0.0163, 0.041]
            .map(|r| [0.6 * r, -0.8 * r, distance_m])
            .to_vec();
        let mut out = vec![0.0; Components::All.count() * points.len()];
        sources.sample(&points, Components::All, &mut out);
        let fields: Vec<_> = points
            .iter()
            .map(|[x, y, z]| to_cartesian(&core.field(x.hypot(*y), *z), *x, *y))
            .collect();
        let steepest = fields
            .iter()
            .flat_map(|f| f.gradient_t_per_m_per_a.into_iter().flatten())
            .fold(0.0_f64, |m, g| m.max(g.abs()));
        let strongest = fields
            .iter()
            .flat_map(|f| f.field_t_per_a)
            .fold(0.0_f64, |m, b| m.max(b.abs()));
        for (i, field) in fields.iter().enumerate() {
            let g = field.gradient_t_per_m_per_a;
            let b = field.field_t_per_a;
            let expected = [
                g[0][0], g[0][1], g[0][2], g[1][2], g[2][2], b[0], b[1], b[2],
            ];
            for (part, expected) in expected.into_iter().enumerate() {
                let size = if part < 5 { steepest } else { strongest };
                let off = (out[part * points.len() + i] - expected).abs() / size;
                assert!(
                    off < 1e-6,
                    "{distance_m} m above, point {i}, part {part}: off by {off:e}"
                );
            }
        }
    }
}

#[test]
fn the_field_of_an_array_is_divergence_free_and_a_gradient() {
    let array = at(&SCATTER, 1e-4, 0.05);
    let sources = ArraySources::of_array(&array, Clearance::above(LOWEST_M, LOWEST_M), 1e-7);
    let h = 1e-4;
    let centre = [0.013, -0.022, 0.019];
    let mut points = vec![centre];
    for axis in 0..3 {
        for step in [-2.0, -1.0, 1.0, 2.0] {
            let mut point = centre;
            point[axis] += step * h;
            points.push(point);
        }
    }
    let count = points.len();
    let mut out = vec![0.0; SCATTER.len() * Components::All.count() * count];
    sources.sample(&points, Components::All, &mut out);
    for drive in 0..SCATTER.len() {
        let value = |part: usize, point: usize| out[(drive * 8 + part) * count + point];
        // d B_i / d x_j by differences of fourth order.
        let slope = |i: usize, j: usize| {
            let b = |k: usize| value(5 + i, 1 + 4 * j + k);
            (8.0 * (b(2) - b(1)) - (b(3) - b(0))) / (12.0 * h)
        };
        let size = value(4, 0).abs().max(value(0, 0).abs());
        for (name, off) in [
            ("div B", slope(0, 0) + slope(1, 1) + slope(2, 2)),
            ("curl B", slope(0, 2) - slope(2, 0)),
            ("dBx/dx", value(0, 0) - slope(0, 0)),
            ("dBx/dy", value(1, 0) - slope(0, 1)),
            ("dBx/dz", value(2, 0) - slope(0, 2)),
            ("dBy/dz", value(3, 0) - slope(1, 2)),
            ("dBz/dz", value(4, 0) - slope(2, 2)),
        ] {
            assert!(off.abs() < 1e-7 * size, "drive {drive}: {name} {off:e}");
        }
    }
}

/// Cores and coils of `length_m`, two of them, whose core 1 hears winding 0: the flux of core 1
/// through coil 0 by `rings`, Wb/A.
fn returned_flux_wb(
    length_m: f64,
    rings: impl Fn(&Generatrix, &ArrayResolution) -> Rings,
) -> (f64, usize) {
    let winding = Winding {
        length_m,
        ..SEED_COIL
    };
    let shape = CoreShape {
        radius_m: 0.0078,
        bottom_m: -length_m - 0.013,
        top_m: 0.0,
    };
    let resolution = ArrayResolution::for_tolerance(1e-4, shape, 0.05);
    let outline = Generatrix::of_coil(&winding, shape, &resolution.outline);
    let exchange = rings(&outline, &resolution);
    let (modes, quadrature) = (resolution.modes, resolution.outline.quadrature);
    let response = Response::new(
        outline,
        exchange,
        resolution.angles(),
        modes,
        MU_R,
        quadrature,
    );
    let places = [[0.0, 0.0], [0.041, 0.0286]];
    let coupling = Coupling::new(&winding, &places, &response, 1e-8);
    let own = DMatrix::zeros(response.size(), 2);
    let solved = coupling.solve(coupling.of_windings(&[1.0, 0.0]), &own, 1e-10);
    let moments =
        |core: usize| &solved.moments.as_slice()[core * response.size()..][..response.size()];
    (coupling.flux_of_others_wb(moments)[0], response.size())
}

/// The exchange rings of a long core were as many as gaps fit along it.
#[test]
fn graded_exchange_rings_do_what_even_ones_do() {
    for length_m in [0.31, 0.9] {
        let even = |outline: &Generatrix, resolution: &ArrayResolution| {
            Rings::new(outline, resolution.order, |_| resolution.panel_m)
        };
        let graded = |outline: &Generatrix, resolution: &ArrayResolution| {
            let shape = outline.shape;
            let grading = Grading::new(resolution.panel_m, shape, length_m);
            Rings::graded(outline, resolution.order, &grading)
        };
        let (all, most) = returned_flux_wb(length_m, even);
        let (few, size) = returned_flux_wb(length_m, graded);
        let off = (few / all - 1.0).abs();
        println!("{length_m} m: {most} and {size} unknowns a core, {off:.1e} apart");
        assert!(off < 2e-6, "{length_m} m: {off:e}");
        assert!(length_m < 0.5 || size * 3 < most * 2, "{size} of {most}");
    }
}

/// Reciprocity and convergence of an array of 1 m, which no even grid enters.
#[test]
fn an_array_of_long_cores_states_an_error_that_covers() {
    let winding = Winding {
        length_m: 1.0,
        ..SEED_COIL
    };
    let shape = CoreShape {
        radius_m: 0.0078,
        bottom_m: -1.0,
        top_m: 0.0,
    };
    let solve = |tolerance: f64| {
        CoupledArray::new(&winding, shape, MU_R, &SCATTER[..3], tolerance, LOWEST_M)
            .expect("off the winding's edges")
    };
    let (coarse, fine) = (solve(1e-3), solve(1e-5));
    let (inductance, gradient) = differences(&fine, &coarse);
    assert!(
        inductance.max(gradient) < coarse.relative_error && coarse.relative_error < 1e-3,
        "{inductance:e}, {gradient:e} of {:e}",
        coarse.relative_error
    );
}
