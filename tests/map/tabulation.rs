//! Maps against direct evaluation, and their interpolation error against other places.

use fluxform_base::progress::Silent;
use fluxform_field::batch::Gradients;
use fluxform_field::frame::to_cartesian;
use fluxform_field::source::AxialSource;
use fluxform_field::winding::{OnEdge, Winding};
use fluxform_map::tabulate::{Grid, PlacedCoil};
use fluxform_map::{Components, FieldMap, interpolation_error, tabulate};
use fluxform_numerics::axis::Axis;
use fluxform_numerics::lagrange;
use fluxform_testing::Random;

fn seed() -> Winding {
    Winding {
        inner_radius_m: 0.012,
        outer_radius_m: 0.019,
        length_m: 0.1,
        turns: 1429.0,
    }
}

/// Nine coils; `skew` moves them off the grid so that no two distances repeat.
fn coils(skew: f64) -> Vec<PlacedCoil> {
    (0..9)
        .map(|number| {
            let (column, row) = ((number % 3) as f64 - 1.0, (number / 3) as f64 - 1.0);
            let offset = skew * (1.3 + number as f64);
            PlacedCoil {
                number,
                axis_m: [0.05 * column + offset, 0.05 * row - 0.7 * offset],
                gain: 1.0 + 0.01 * number as f64,
            }
        })
        .collect()
}

fn grid(samples: usize, from: f64) -> Grid {
    Grid {
        x_m: Axis {
            from: -0.05,
            to: 0.05,
            samples,
        }
        .nodes(),
        y_m: Axis {
            from: -0.047,
            to: 0.05,
            samples,
        }
        .nodes(),
        z_m: Axis {
            from,
            to: 0.08,
            samples: 9,
        }
        .nodes(),
    }
}

/// Largest error of every component relative to the largest |grad B| (|B|) at the height.
fn worst_error(map: &FieldMap, winding: &Winding, coils: &[PlacedCoil]) -> f64 {
    let (nx, ny, nz) = (map.x_m.len(), map.y_m.len(), map.z_m.len());
    let gradient = map.gradient_t_per_m_per_a.as_ref().expect("gradient");
    let field = map.field_t_per_a.as_ref().expect("field");
    let mut worst = 0.0_f64;
    for k in 0..nz {
        let (mut error, mut size) = (0.0_f64, 0.0_f64);
        let (mut field_error, mut field_size) = (0.0_f64, 0.0_f64);
        for (c, coil) in coils.iter().enumerate() {
            for place in (0..nx * ny).step_by(7) {
                let (dx, dy) = (
                    map.x_m[place % nx] - coil.axis_m[0],
                    map.y_m[place / nx] - coil.axis_m[1],
                );
                let axial = winding
                    .field(dx.hypot(dy), map.z_m[k])
                    .expect("off the edges");
                let exact = to_cartesian(&axial, dx, dy);
                let node = (c * nz + k) * nx * ny + place;
                size = size.max(coil.gain * axial.gradient_norm());
                for (i, g) in exact
                    .gradient_t_per_m_per_a
                    .as_flattened()
                    .iter()
                    .enumerate()
                {
                    error = error.max((gradient[9 * node + i] - coil.gain * g).abs());
                }
                let gz = coil.gain * axial.dbz_dz;
                error = error.max((map.gz_t_per_m_per_a[node] - gz).abs());
                for (i, b) in exact.field_t_per_a.iter().enumerate() {
                    field_size = field_size.max(coil.gain * b.abs());
                    field_error = field_error.max((field[3 * node + i] - coil.gain * b).abs());
                }
            }
        }
        worst = worst.max(error / size).max(field_error / field_size);
    }
    worst
}

#[test]
fn every_node_keeps_the_tolerance() {
    for (skew, samples, from) in [(0.0, 31, 0.01), (1.37e-4, 41, 0.01), (1.37e-4, 31, 0.0004)] {
        for tolerance in [1e-5, 1e-9, 1e-12] {
            let (winding, coils, grid) = (seed(), coils(skew), grid(samples, from));
            let map = tabulate(&winding, &coils, &grid, Components::All, tolerance, &Silent)
                .expect("a map");
            let error = worst_error(&map, &winding, &coils);
            assert!(error < tolerance, "skew {skew} {tolerance:e}: {error:e}");
        }
    }
}

/// A winding with its top face at a height.
struct Raised {
    winding: Winding,
    by_m: f64,
}

impl Raised {
    fn below(&self, z_m: &[f64]) -> Vec<f64> {
        z_m.iter().map(|z| z - self.by_m).collect()
    }
}

impl AxialSource for Raised {
    fn gradients(
        &self,
        r_m: &[f64],
        z_m: &[f64],
        tolerance: f64,
        expected: Components,
    ) -> Result<Gradients, OnEdge> {
        let z_m = self.below(z_m);
        self.winding.gradients(r_m, &z_m, tolerance, expected)
    }

    fn axial_fields(&self, r_m: &[f64], z_m: &[f64], tolerance: f64) -> Result<Vec<f64>, OnEdge> {
        self.winding.axial_fields(r_m, &self.below(z_m), tolerance)
    }

    fn top_m(&self) -> f64 {
        self.by_m
    }
}

#[test]
fn a_source_that_rises_above_zero_keeps_the_tolerance() {
    let (winding, coils, low) = (seed(), coils(1.37e-4), grid(31, 0.0017));
    let source = Raised {
        winding,
        by_m: 0.013,
    };
    let mut high = low.clone();
    high.z_m.iter_mut().for_each(|z| *z += source.by_m);
    for tolerance in [1e-5, 1e-9] {
        let mut map =
            tabulate(&source, &coils, &high, Components::All, tolerance, &Silent).expect("a map");
        assert!(map.tabulated, "the table is what the height decides");
        map.z_m = low.z_m.clone();
        let error = worst_error(&map, &winding, &coils);
        assert!(error < tolerance, "{tolerance:e}: {error:e}");
    }
}

#[test]
fn distances_that_do_not_repeat_use_a_table() {
    let (winding, coils, grid) = (seed(), coils(1.37e-4), grid(41, 0.01));
    let map = tabulate(&winding, &coils, &grid, Components::Gz, 1e-9, &Silent).expect("a map");
    assert!(
        map.tabulated && map.distinct_radii > 10_000,
        "{}",
        map.distinct_radii
    );
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let bits = |threads: usize| -> Vec<u64> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("a pool");
        let map = pool.install(|| {
            tabulate(
                &seed(),
                &coils(1.37e-4),
                &grid(23, 0.007),
                Components::All,
                1e-9,
                &Silent,
            )
        });
        let map = map.expect("a map");
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

#[test]
fn a_map_on_the_top_face_is_exact_off_the_edges() {
    let winding = seed();
    let grid = Grid {
        x_m: Axis {
            from: -0.0503,
            to: 0.0497,
            samples: 14,
        }
        .nodes(),
        y_m: Axis {
            from: -0.0301,
            to: 0.0333,
            samples: 9,
        }
        .nodes(),
        z_m: vec![0.0, 1e-7, 1e-3],
    };
    let coils = coils(1.1e-5);
    let map = tabulate(&winding, &coils, &grid, Components::All, 1e-9, &Silent).expect("a map");
    let error = worst_error(&map, &winding, &coils);
    assert!(error < 1e-9, "{error:e}");
}

#[test]
fn a_node_on_an_edge_is_refused_with_its_place() {
    let grid = Grid {
        x_m: vec![0.012],
        y_m: vec![0.0],
        z_m: vec![0.0],
    };
    let coil = PlacedCoil {
        number: 0,
        axis_m: [0.0, 0.0],
        gain: 1.0,
    };
    let error = tabulate(&seed(), &[coil], &grid, Components::Gz, 1e-9, &Silent)
        .expect_err("the edge's gradient is unbounded");
    assert!(error.to_string().contains("0.012"), "{error}");
}

#[test]
fn the_interpolation_error_covers_other_places() {
    // Skewed, axes lie anywhere in their cells.
    for (from, skew) in [
        (0.005, 0.0),
        (0.02, 0.0),
        (0.005, 0.000_31),
        (0.02, 0.000_31),
    ] {
        let (winding, coils) = (seed(), coils(skew));
        let grid = grid(31, from);
        let map = tabulate(&winding, &coils, &grid, Components::Gz, 1e-9, &Silent).expect("a map");
        let reported = interpolation_error(&winding, &coils, &grid, &map.gz_t_per_m_per_a, 1e-9)
            .expect("an error");
        let nodes = grid.x_m.len() * grid.y_m.len() * grid.z_m.len();
        let mut worst = 0.0_f64;
        let mut random = Random::new(1_u64);
        for k in 0..grid.z_m.len() - 1 {
            let largest = (0..200)
                .map(|i| {
                    winding
                        .field(2e-4 * f64::from(i), grid.z_m[k + 1])
                        .expect("above")
                        .dbz_dz
                        .abs()
                })
                .fold(0.0, f64::max);
            for _ in 0..3000 {
                let mut unit = || random.unit();
                let coil = (unit() * 9.0) as usize;
                let z = grid.z_m[k] + unit() * (grid.z_m[k + 1] - grid.z_m[k]);
                let point = [0.1 * unit() - 0.05, 0.097 * unit() - 0.047, z];
                let cell =
                    lagrange::locate([&grid.x_m, &grid.y_m, &grid.z_m], point).expect("inside");
                let value = cell.value(&map.gz_t_per_m_per_a[coil * nodes..(coil + 1) * nodes]);
                let (dx, dy) = (
                    point[0] - coils[coil].axis_m[0],
                    point[1] - coils[coil].axis_m[1],
                );
                let exact =
                    coils[coil].gain * winding.field(dx.hypot(dy), z).expect("above").dbz_dz;
                // The plane above the cell has the smaller values: the stricter measure of two
                // would be the plane through the point, where they lie between.
                worst = worst.max((value - exact).abs() / largest);
            }
        }
        // Relative to the plane above instead of the plane through the point: up to twice as large.
        assert!(
            reported.largest * 2.0 > worst,
            "{:e} {worst:e}",
            reported.largest
        );
        assert!(
            reported.largest < 20.0 * worst,
            "not a guess: {:e} {worst:e}",
            reported.largest
        );
    }
}

/// Of one long cell the middle was looked at alone: 203 was stated where the error is 312 of the largest at its height.
#[test]
fn the_interpolation_error_covers_long_cells() {
    let (winding, coil) = (
        seed(),
        [PlacedCoil {
            number: 0,
            axis_m: [0.0, 0.0],
            gain: 1.0,
        }],
    );
    for (from_m, to_m, nodes) in [
        (0.01, 0.2, 2),
        (0.01, 0.2, 3),
        (0.02, 0.12, 2),
        (0.03, 0.15, 2),
    ] {
        let z_m: Vec<f64> = (0..nodes)
            .map(|k| from_m + (to_m - from_m) * f64::from(k) / f64::from(nodes - 1))
            .collect();
        let plan = vec![-1e-3, 0.0, 1e-3];
        let grid = Grid {
            x_m: plan.clone(),
            y_m: plan,
            z_m,
        };
        let map = tabulate(&winding, &coil, &grid, Components::Gz, 1e-9, &Silent).expect("a map");
        let gz = &map.gz_t_per_m_per_a;
        let reported = interpolation_error(&winding, &coil, &grid, gz, 1e-9).expect("an error");
        let off = |k: i32| {
            let z = from_m + (to_m - from_m) * f64::from(k) / 800.0;
            let cell = lagrange::locate([&grid.x_m, &grid.y_m, &grid.z_m], [0.0, 0.0, z]);
            let exact = winding.field(0.0, z).expect("above").dbz_dz;
            (cell.expect("inside").value(gz) / exact - 1.0).abs()
        };
        let worst = (0..800).map(off).fold(0.0, f64::max);
        let stated = reported.largest;
        assert!(
            worst <= stated && stated < 1.6 * worst,
            "{from_m} {to_m}: {worst} {stated}"
        );
    }
}

/// The error stated of the map of one coil on the axis holds at random places, relative to the largest value of the
/// planes of nodes around each.
fn assert_covered(grid: &Grid) {
    let winding = seed();
    let coil = [PlacedCoil {
        number: 0,
        axis_m: [0.0, 0.0],
        gain: 1.0,
    }];
    let map = tabulate(&winding, &coil, grid, Components::Gz, 1e-9, &Silent).expect("a map");
    let gz = &map.gz_t_per_m_per_a;
    let stated = interpolation_error(&winding, &coil, grid, gz, 1e-9).expect("an error");
    let plane = grid.x_m.len() * grid.y_m.len();
    let axes = [&grid.x_m[..], &grid.y_m, &grid.z_m];
    let mut random = Random::new(5);
    for _ in 0..2000 {
        let at = axes.map(|nodes| {
            let (from, to) = (nodes[0], nodes[nodes.len() - 1]);
            from + random.unit() * (to - from)
        });
        let around = lagrange::around(&grid.z_m, at[2]);
        let near = &gz[around.start * plane..around.end * plane];
        let size = near
            .iter()
            .fold(0.0_f64, |most, value| most.max(value.abs()));
        let value = lagrange::locate(axes, at).expect("inside").value(gz);
        let exact = winding
            .field(at[0].hypot(at[1]), at[2])
            .expect("off the winding");
        let off = (value - exact.dbz_dz).abs();
        assert!(
            off <= stated.largest * size,
            "{plane} {at:?}: {off:e}, {:e} stated of {size:e}",
            stated.largest
        );
    }
}

/// Nodes that miss the peak over a coil have values that a runtime would multiply a relative error by: 0.012 N was stated
/// where the force was off by 0.077 N.
#[test]
fn regression_an_error_was_relative_to_a_peak_that_no_node_shows() {
    for samples in [2, 3, 4] {
        let of = |from, to, samples| Axis { from, to, samples }.nodes();
        assert_covered(&Grid {
            x_m: of(-0.031, 0.03, samples),
            y_m: of(-0.03, 0.03, samples),
            z_m: of(0.02, 0.06, 9),
        });
    }
}

/// Beside a coil or a raised core the field changes fastest at its end, in layers that were not looked at: up to 37
/// times the stated error.
#[test]
fn regression_the_error_was_looked_for_in_the_lowest_layers_alone() {
    let of = |from, to, samples| Axis { from, to, samples }.nodes();
    assert_covered(&Grid {
        x_m: of(0.021, 0.06, 14),
        y_m: of(-0.02, 0.02, 11),
        z_m: of(-0.06, 0.03, 25),
    });
}
