//! Maps of sources without symmetry against direct evaluation.

use fluxform_testing::Random;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use fluxform_base::progress::Silent;
use fluxform_map::coupled_map::{SampledField, TableReport};
use fluxform_map::map_source::Sampler;
use fluxform_map::tabulate::{Grid, MapError, PlacedCoil};
use fluxform_map::{Components, FieldMap};

const TOP_M: f64 = 0.0;

/// Charges on the sides and the tops of nine cores; each drive gives every charge a strength.
struct Charges {
    places_m: Vec<[f64; 3]>,
    /// [drive][charge]
    strengths: Vec<Vec<f64>>,
    asked: AtomicUsize,
}

impl Charges {
    fn new(a_core: usize) -> Self {
        let (mut random, mut places_m) = (Random::new(7), Vec::new());
        for core in 0..9 {
            let [cx, cy] = [core % 3, core / 3].map(|i| 0.05 * (f64::from(i) - 1.0));
            for charge in 0..a_core {
                let angle = std::f64::consts::TAU * random.unit();
                // A third on the top, most of the rest near the ends.
                let (r, z) = if charge % 3 == 0 {
                    (0.012 * random.unit().sqrt(), TOP_M)
                } else {
                    (0.012, TOP_M - 0.11 * random.unit().powi(2))
                };
                places_m.push([cx + r * angle.cos(), cy + r * angle.sin(), z]);
            }
        }
        let strengths = (0..9)
            .map(|drive| {
                (0..places_m.len())
                    .map(|charge| {
                        let z = places_m[charge][2];
                        let sign = if z > -0.05 { 1.0 } else { -1.0 };
                        let own = if charge / a_core == drive { 1.0 } else { -0.11 };
                        1e-7 * own * sign * (0.7 + 0.6 * random.unit())
                    })
                    .collect()
            })
            .collect();
        Self {
            places_m,
            strengths,
            asked: AtomicUsize::new(0),
        }
    }

    /// dBx/dx, dBx/dy, dBx/dz, dBy/dz, dBz/dz, Bx, By, Bz of all drives.
    fn at(&self, point: [f64; 3]) -> Vec<[f64; 8]> {
        let mut out = vec![[0.0; 8]; self.strengths.len()];
        for (charge, place) in self.places_m.iter().enumerate() {
            let [x, y, z] = [0, 1, 2].map(|i| point[i] - place[i]);
            let square = x * x + y * y + z * z;
            let cube = square * square.sqrt();
            let (three, unit) = (3.0 / (square * cube), 1.0 / cube);
            let kernel = [
                unit - three * x * x,
                -three * x * y,
                -three * x * z,
                -three * y * z,
                unit - three * z * z,
                x * unit,
                y * unit,
                z * unit,
            ];
            for (strengths, out) in self.strengths.iter().zip(&mut out) {
                for (value, k) in out.iter_mut().zip(kernel) {
                    *value += strengths[charge] * k;
                }
            }
        }
        out
    }
}

impl Sampler for Charges {
    fn drives(&self) -> usize {
        self.strengths.len()
    }

    fn top_m(&self) -> f64 {
        TOP_M
    }

    fn sample(
        &self,
        points_m: &[[f64; 3]],
        components: Components,
        out: &mut [f64],
    ) -> Result<(), MapError> {
        self.asked.fetch_add(points_m.len(), Ordering::Relaxed);
        let values: Vec<_> = points_m.par_iter().map(|p| self.at(*p)).collect();
        let count = components.count();
        for (place, row) in out.chunks_exact_mut(points_m.len()).enumerate() {
            let component = if count == 1 { 4 } else { place % count };
            for (out, at) in row.iter_mut().zip(&values) {
                *out = at[place / count][component];
            }
        }
        Ok(())
    }
}

fn coils() -> Vec<PlacedCoil> {
    (0..9)
        .map(|number| PlacedCoil {
            number,
            axis_m: [0.0, 0.0],
            gain: 1.0,
        })
        .collect()
}

fn axis(from: f64, to: f64, samples: usize) -> Vec<f64> {
    fluxform_numerics::axis::Axis { from, to, samples }.nodes()
}

fn cube(x: (f64, f64, usize), y: (f64, f64, usize), z: (f64, f64, usize)) -> Grid {
    Grid {
        x_m: axis(x.0, x.1, x.2),
        y_m: axis(y.0, y.1, y.2),
        z_m: axis(z.0, z.1, z.2),
    }
}

fn made(
    source: &Charges,
    grid: &Grid,
    components: Components,
    tolerance: f64,
) -> (FieldMap, TableReport) {
    let field =
        SampledField::new(source, grid, components, tolerance, 1, &Silent).expect("a field");
    let map = field.map(&coils(), grid, &Silent).expect("a map");
    (map, field.report)
}

/// Largest error of gz at a height over the largest |gz| there, over some of the nodes.
fn worst(map: &FieldMap, source: &Charges) -> f64 {
    let (nx, ny, nz) = (map.x_m.len(), map.y_m.len(), map.z_m.len());
    let step = (nx * ny).div_ceil(150) | 1;
    (0..nz)
        .into_par_iter()
        .map(|k| {
            let (mut error, mut size) = ([0.0_f64; 2], [0.0_f64; 2]);
            for place in (0..nx * ny).step_by(step) {
                let point = [map.x_m[place % nx], map.y_m[place / nx], map.z_m[k]];
                for (drive, b) in source.at(point).into_iter().enumerate() {
                    let node = (drive * nz + k) * nx * ny + place;
                    let mut compare = |kind: usize, got: f64, exact: f64| {
                        error[kind] = error[kind].max((got - exact).abs());
                        size[kind] = size[kind].max(exact.abs());
                    };
                    compare(0, map.gz_t_per_m_per_a[node], b[4]);
                    if let Some(gradient) = &map.gradient_t_per_m_per_a {
                        let yy = -b[0] - b[4];
                        let exact = [b[0], b[1], b[2], b[1], yy, b[3], b[2], b[3], b[4]];
                        for (i, exact) in exact.into_iter().enumerate() {
                            compare(0, gradient[9 * node + i], exact);
                        }
                    }
                    if let Some(field) = &map.field_t_per_a {
                        for i in 0..3 {
                            compare(1, field[3 * node + i], b[5 + i]);
                        }
                    }
                }
            }
            (error[0] / size[0]).max(if size[1] > 0.0 {
                error[1] / size[1]
            } else {
                0.0
            })
        })
        .reduce(|| 0.0, f64::max)
}

const SIDE: (f64, f64, usize) = (-0.05, 0.05, 61);

#[test]
fn the_seed_workspace_keeps_the_tolerance_with_few_samples() {
    let source = Charges::new(60);
    let grid = cube(SIDE, SIDE, (0.01, 0.08, 29));
    let nodes = grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
    for (tolerance, saves) in [(1e-4, 15), (1e-6, 8), (1e-9, 4)] {
        let before = source.asked.load(Ordering::Relaxed);
        let (map, report) = made(&source, &grid, Components::Gz, tolerance);
        assert!(
            report.certificate > 0.01 * tolerance,
            "no more digits than requested"
        );
        let asked = source.asked.load(Ordering::Relaxed) - before;
        let error = worst(&map, &source);
        assert!(map.tabulated);
        assert!(error < tolerance, "{tolerance:e}: {error:e}");
        assert!(asked * saves < nodes, "{tolerance:e}: {asked} samples");
    }
}

#[test]
fn every_component_of_every_box_keeps_the_tolerance() {
    let source = Charges::new(24);
    let boxes = [
        ("near the tops", cube(SIDE, SIDE, (0.0005, 0.03, 7)), true),
        ("one height", cube(SIDE, SIDE, (0.03, 0.03, 1)), true),
        (
            "one x",
            cube((0.013, 0.013, 1), SIDE, (0.02, 0.08, 301)),
            true,
        ),
        (
            "one y",
            cube(SIDE, (0.013, 0.013, 1), (0.02, 0.08, 301)),
            true,
        ),
        (
            "a line",
            cube((0.013, 0.013, 1), (0.007, 0.007, 1), (0.01, 0.08, 500)),
            true,
        ),
        (
            "off to the side",
            cube((0.13, 0.23, 41), (-0.17, 0.03, 41), (0.007, 0.05, 11)),
            true,
        ),
        (
            "tiny",
            cube((0.013, 0.0131, 21), (0.0, 1e-7, 21), (0.02, 0.020_001, 21)),
            true,
        ),
        (
            "a point",
            cube((0.013, 0.013, 1), (0.0, 0.0, 1), (0.02, 0.02, 1)),
            false,
        ),
        (
            "few nodes",
            cube((-0.05, 0.05, 4), (-0.05, 0.05, 4), (0.01, 0.08, 3)),
            false,
        ),
        (
            "at the tops' height",
            cube((0.0171, 0.0243, 5), (0.0171, 0.0243, 5), (0.0, 0.01, 2)),
            false,
        ),
        (
            "between the cores",
            cube((0.0171, 0.0243, 5), (0.0171, 0.0243, 5), (-0.05, -0.01, 3)),
            false,
        ),
        ("far above", cube(SIDE, SIDE, (1.3, 1.7, 9)), true),
    ];
    for (name, grid, tabulated) in boxes {
        for (tolerance, components) in [
            (1e-4, Components::All),
            (1e-6, Components::Gradient),
            (1e-9, Components::Gz),
        ] {
            let (map, report) = made(&source, &grid, components, tolerance);
            let error = worst(&map, &source);
            assert!(error < tolerance, "{name} {tolerance:e}: {error:e}");
            assert_eq!(report.from_m.is_some(), map.tabulated);
            if tolerance > 1e-5 {
                assert_eq!(map.tabulated, tabulated, "{name}");
            }
            if map.tabulated {
                assert!(report.certificate < tolerance);
            }
        }
    }
}

#[test]
fn a_grid_between_the_nodes_is_in_the_field_too() {
    let source = Charges::new(24);
    let grid = cube(SIDE, SIDE, (0.01, 0.08, 9));
    let field =
        SampledField::new(&source, &grid, Components::Gz, 1e-6, 1, &Silent).expect("a field");
    let (from, to) = (-0.049_171_3, 0.031_7);
    for z in [(0.010_3, 0.079, 5), (0.07, 0.09, 3)] {
        let other = cube((from, to, 23), (-0.0131, 0.0131, 19), z);
        let map = field.map(&coils(), &other, &Silent).expect("a map");
        let error = worst(&map, &source);
        assert!(error < 1e-6, "{error:e}");
    }
    let outside = cube((from, 0.07, 7), (from, to, 7), (0.02, 0.08, 3));
    let map = field.map(&coils(), &outside, &Silent).expect("a map");
    assert!(!map.tabulated, "the table is no extrapolation");
    assert!(worst(&map, &source) < 1e-14);
}

#[test]
fn gains_and_a_choice_of_coils_are_kept() {
    let source = Charges::new(24);
    let grid = cube((-0.05, 0.05, 31), (-0.05, 0.05, 31), (0.01, 0.08, 9));
    let field =
        SampledField::new(&source, &grid, Components::All, 1e-4, 1, &Silent).expect("a field");
    let whole = field.map(&coils(), &grid, &Silent).expect("a map");
    let some: Vec<PlacedCoil> = [(7, 1.3), (2, 0.7)]
        .map(|(number, gain)| PlacedCoil {
            number,
            gain,
            ..coils()[0]
        })
        .to_vec();
    let part = field.map(&some, &grid, &Silent).expect("a map");
    assert_eq!(part.coils, [7, 2]);
    let each = [
        (whole.gz_t_per_m_per_a, part.gz_t_per_m_per_a),
        (
            whole.gradient_t_per_m_per_a.expect("g"),
            part.gradient_t_per_m_per_a.expect("g"),
        ),
        (
            whole.field_t_per_a.expect("b"),
            part.field_t_per_a.expect("b"),
        ),
    ];
    for (whole, part) in each {
        let coil = whole.len() / 9;
        for (place, c) in some.iter().enumerate() {
            let all = &whole[c.number * coil..(c.number + 1) * coil];
            for (a, b) in all.iter().zip(&part[place * coil..(place + 1) * coil]) {
                assert!((a * c.gain - b).abs() < 1e-14, "{a:e} {b:e}");
            }
        }
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let bits = |threads: usize| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        let grid = cube((-0.05, 0.05, 37), (-0.05, 0.05, 37), (0.007, 0.08, 9));
        let map = pool.install(|| made(&Charges::new(18), &grid, Components::All, 1e-4).0);
        assert!(map.tabulated);
        [
            map.gz_t_per_m_per_a,
            map.gradient_t_per_m_per_a.expect("g"),
            map.field_t_per_a.expect("b"),
        ]
        .concat()
        .into_iter()
        .map(f64::to_bits)
        .collect()
    };
    let one = bits(1);
    assert_eq!(one, bits(2));
    assert_eq!(one, bits(5));
}

/// A field whose singularities lie higher than it says.
struct Understated(Charges);

impl Sampler for Understated {
    fn drives(&self) -> usize {
        self.0.drives()
    }

    fn top_m(&self) -> f64 {
        TOP_M - 0.02
    }

    fn sample(
        &self,
        points_m: &[[f64; 3]],
        components: Components,
        out: &mut [f64],
    ) -> Result<(), MapError> {
        self.0.sample(points_m, components, out)
    }
}

#[test]
fn the_certificate_sees_a_table_that_is_too_coarse() {
    let source = Understated(Charges::new(24));
    let grid = cube((-0.05, 0.05, 41), (-0.05, 0.05, 41), (0.003, 0.08, 9));
    let field =
        SampledField::new(&source, &grid, Components::Gz, 1e-4, 1, &Silent).expect("a field");
    let map = field.map(&coils(), &grid, &Silent).expect("a map");
    let error = worst(&map, &source.0);
    assert!(field.report.samples > 0, "a table was tried");
    assert!(error < 1e-4, "{error:e}");
}
