//! The certificate of the points: against geometry known in closed form, and against brute force.

use fluxform_base::least_request::lowest_requested_m;
use fluxform_base::progress::{Progress, Silent};
use fluxform_shape::certificate::{Certify, certify};
use fluxform_shape::deviation::{
    CERTIFY_SECONDS, Faces, Interval, Lattice, Looks, Vertical, hausdorff, vertical,
};
use fluxform_shape::document::{Placement, Primitive};
use fluxform_shape::file_mesh::Triangle;
use fluxform_shape::height::Grid;
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::primitive::PlacedPrimitive;
use fluxform_shape::tessellation::estimated_deviation_m;
use fluxform_shape::{Surface, deviation, stl};

use fluxform_testing::surfaces::{exact, grid, sample};
use fluxform_testing::{Random, root};

fn certified(mesh: &Mesh, plan: &Grid) -> (Vertical, Option<Interval>) {
    let heights: Vec<Option<f64>> = heights(mesh, plan);
    let faces = Faces::new(mesh, plan, Looks::endless());
    let lattice = Lattice::new(&faces, plan, &heights);
    let found = vertical(mesh, plan, &lattice, &Silent).unwrap();
    let apart = hausdorff(mesh, &lattice, &found, &Silent).unwrap();
    (found, apart)
}

fn heights(mesh: &Mesh, plan: &Grid) -> Vec<Option<f64>> {
    let found = sample(mesh, plan);
    found.iter().map(|s| s.map(|s| s.height_m)).collect()
}

/// A strip along y whose height over x is the polyline through `knots`.
fn roof(knots: &[[f64; 2]], y: [f64; 2]) -> Vec<Triangle> {
    let side = |[x, z]: [f64; 2]| y.map(|y| [x, y, z]);
    let quads = knots.windows(2).map(|k| [side(k[0]), side(k[1])]);
    quads
        .flat_map(|[[a, b], [c, d]]| [[a, b, c], [b, d, c]])
        .collect()
}

#[test]
fn a_twisted_cell_differs_by_a_quarter_of_its_twist() {
    // Two triangles and the patch through their corners: equal but on the diagonal.
    let mesh = exact(vec![
        [[0.0, 0.0, 0.2], [1.3, 0.0, 0.2], [1.3, 0.7, 0.9]],
        [[0.0, 0.0, 0.2], [1.3, 0.7, 0.9], [0.0, 0.7, 0.2]],
    ]);
    let (found, apart) = certified(&mesh, &grid((0.0, 1.3, 2), (0.0, 0.7, 2)));
    assert!((found.above.value_m - 0.7 / 4.0).abs() < 1e-15, "{found:?}");
    assert!(
        (found.above.at_m[0] - 0.65).abs() < 1e-15 && (found.above.at_m[1] - 0.35).abs() < 1e-15
    );
    assert!(found.below.value_m.abs() < 1e-15);
    let apart = apart.unwrap();
    assert!(apart.lower_m > 0.05 && apart.upper_m < 0.7 / 4.0 && apart.lower_m <= apart.upper_m);
}

#[test]
fn a_roof_differs_at_its_ridge() {
    // The ridge is at x = 0.3 of a cell from 0 to 1, over level ground.
    let mesh = exact(roof(
        &[[-2.0, 0.5], [0.0, 0.5], [0.3, 0.74], [1.0, 0.5], [3.0, 0.5]],
        [-1.0, 2.0],
    ));
    let (found, apart) = certified(&mesh, &grid((-2.0, 3.0, 6), (-1.0, 2.0, 4)));
    assert!((found.above.value_m - 0.24).abs() < 1e-15, "{found:?}");
    assert_eq!(found.above.at_m[0], 0.3);
    assert!(found.below.value_m.abs() < 1e-15);
    // The ridge is farthest from the level points: straight down.
    let apart = apart.unwrap();
    assert!(
        apart.lower_m > 0.2399 && apart.lower_m < 0.24 + 1e-12 && apart.upper_m < 0.2425,
        "{apart:?}"
    );
    // A gutter: the points lie above it.
    let mesh = exact(roof(
        &[[-2.0, 0.5], [0.0, 0.5], [0.3, 0.26], [1.0, 0.5], [3.0, 0.5]],
        [-1.0, 2.0],
    ));
    let (found, _) = certified(&mesh, &grid((-2.0, 3.0, 6), (-1.0, 2.0, 4)));
    assert!((found.below.value_m - 0.24).abs() < 1e-15 && found.above.value_m.abs() < 1e-15);
}

#[test]
fn a_tessellated_cylinder_has_the_largest_difference_of_its_knots() {
    let radius = 0.7;
    let knots: Vec<[f64; 2]> = (0..=46)
        .map(|k| {
            let angle = f64::from(k) / 46.0 * std::f64::consts::PI;
            [-radius * angle.cos(), 1.3 + radius * angle.sin()]
        })
        .collect();
    // Its base belongs to it, as an exporter writes it.
    let mut triangles = roof(&knots, [-0.5, 0.5]);
    triangles.extend(roof(&[[-radius, 1.3], [radius, 1.3]], [-0.5, 0.5]));
    let mesh = exact(triangles);
    let line = |table: &[[f64; 2]], x: f64| {
        let k = table
            .partition_point(|p| p[0] < x)
            .clamp(1, table.len() - 1);
        let ([a, p], [b, q]) = (table[k - 1], table[k]);
        p + (x - a) / (b - a) * (q - p)
    };
    for samples in [8, 31, 61] {
        let plan = grid((-0.69, 0.68, samples), (-0.4, 0.45, 5));
        let nodes: Vec<[f64; 2]> = plan
            .x_m
            .nodes()
            .iter()
            .map(|x| [*x, line(&knots, *x)])
            .collect();
        // Both are polylines: the difference is largest at a knot of either.
        let inside = knots.iter().filter(|k| k[0] >= -0.69 && k[0] <= 0.68);
        let expected = inside.fold([0.0_f64; 2], |[above, below], [x, z]| {
            let off = z - line(&nodes, *x);
            [above.max(off), below.max(-off)]
        });
        let expected = nodes.iter().fold(expected, |[above, below], [x, z]| {
            let off = line(&knots, *x) - z;
            [above.max(off), below.max(-off)]
        });
        let (found, apart) = certified(&mesh, &plan);
        assert!(
            (found.above.value_m - expected[0]).abs() < 1e-13,
            "{samples}: {found:?} {expected:?}"
        );
        assert!(
            (found.below.value_m - expected[1]).abs() < 1e-13,
            "{samples}: {found:?} {expected:?}"
        );
        let apart = apart.unwrap();
        assert!(
            apart.lower_m <= apart.upper_m && apart.upper_m <= found.bound_m(),
            "{apart:?}"
        );
        assert!(apart.lower_m > 0.95 * apart.upper_m, "{samples}: {apart:?}");
    }
}

/// The highest of all triangles over a point: every one is tried.
fn cast(triangles: &[Triangle], p: [f64; 2]) -> Option<f64> {
    let over = triangles.iter().filter_map(|[a, b, c]| {
        let side = |a: &[f64; 3], b: &[f64; 3]| {
            robust::orient2d(
                robust::Coord { x: a[0], y: a[1] },
                robust::Coord { x: b[0], y: b[1] },
                robust::Coord { x: p[0], y: p[1] },
            )
        };
        let w = [side(b, c), side(c, a), side(a, b)];
        let sum = w[0] + w[1] + w[2];
        let covers = sum != 0.0 && w.iter().all(|w| w * sum >= 0.0);
        covers.then(|| (w[0] * a[2] + w[1] * b[2] + w[2] * c[2]) / sum)
    });
    over.reduce(f64::max)
}

fn bilinear(heights: &[Option<f64>], plan: &Grid, p: [f64; 2]) -> Option<f64> {
    let (x, y) = (plan.x_m.nodes(), plan.y_m.nodes());
    let place = |nodes: &[f64], v: f64| {
        let k = nodes.partition_point(|n| *n <= v).clamp(1, nodes.len() - 1) - 1;
        (k, (v - nodes[k]) / (nodes[k + 1] - nodes[k]))
    };
    let ((i, u), (j, v)) = (place(&x, p[0]), place(&y, p[1]));
    let at = |di: usize, dj: usize| heights[(j + dj) * x.len() + i + di];
    let (low, high) = (
        at(0, 0)? * (1.0 - u) + at(1, 0)? * u,
        at(0, 1)? * (1.0 - u) + at(1, 1)? * u,
    );
    Some(low * (1.0 - v) + high * v)
}

#[test]
fn random_soups_match_a_ray_caster() {
    let mut random = Random::new(11);
    let mut tried = 0;
    for case in 0..40 {
        let count = 3 + random.below(25);
        let mut triangles: Vec<Triangle> = (0..count)
            .map(|_| {
                let at = [random.between(0.0, 1.0), random.between(0.0, 1.0)];
                let size = random.between(0.2, 1.5);
                [0; 3].map(|_| {
                    let [u, v] = [0; 2].map(|_| random.between(-size, size));
                    [at[0] + u, at[1] + v, random.between(0.1, 1.0)]
                })
            })
            .collect();
        // Ground below, so that every cell has four points; a face twice; a sliver.
        triangles.push([[-3.0, -3.0, 0.05], [6.0, -3.0, 0.03], [-3.0, 6.0, 0.0]]);
        triangles.push(triangles[0]);
        triangles.push([[0.1, 0.2, 0.3], [0.9, 0.8, 0.5], [0.5, 0.5 + 1e-7, 1.2]]);
        let mesh = exact(triangles.clone());
        let n = 3 + random.below(4);
        let plan = grid((0.0, 1.0, n), (0.0, 1.0, n + 1));
        let heights = heights(&mesh, &plan);
        let (found, apart) = certified(&mesh, &plan);
        let off =
            |p: [f64; 2]| cast(&triangles, p).unwrap() - bilinear(&heights, &plan, p).unwrap();
        let mut most = [f64::NEG_INFINITY; 2];
        for _ in 0..20_000 {
            let d = off([random.between(0.0, 1.0), random.between(0.0, 1.0)]);
            most = [most[0].max(d), most[1].max(-d)];
        }
        for (k, extreme) in [found.above, found.below].into_iter().enumerate() {
            assert!(
                extreme.value_m >= most[k] - 1e-12,
                "{case} {k}: {extreme:?} {most:?}"
            );
            // It is approached beside its place: this is a supremum, not a bound.
            let sign = [1.0, -1.0][k];
            let mut beside = f64::NEG_INFINITY;
            for n in 0..4000 {
                // A sliver is so steep that only the nearest places decide.
                let hair = [3e-9, 3e-12, 3e-14][n % 3];
                let p = extreme
                    .at_m
                    .map(|c| (c + random.between(-hair, hair)).clamp(0.0, 1.0));
                beside = beside.max(sign * off(p));
            }
            let gap = extreme.value_m - beside;
            assert!(gap.abs() < 1e-5, "{case} {k}: {extreme:?} {beside}");
            tried += 1;
        }
        let apart = apart.unwrap();
        assert!(apart.lower_m <= apart.upper_m, "{apart:?}");
        assert!(apart.lower_m <= found.bound_m(), "{apart:?} {found:?}");
    }
    assert_eq!(tried, 80);
}

fn shape(name: &str) -> Mesh {
    let bytes = std::fs::read(root().join(format!("shapes/{name}.stl"))).unwrap();
    let lift = if name == "flat" { 0.05 } else { 0.03 };
    let placement = Placement {
        translate_m: [0.0, 0.0, lift],
        rotate_deg: [0.0; 3],
        ..Placement::default()
    };
    Mesh::place(
        stl::read(&bytes).unwrap(),
        &Transform::new(0.001, &placement),
    )
    .unwrap()
}

#[test]
fn plane_bodies_are_met_exactly() {
    for name in ["flat", "wedge"] {
        let mesh = shape(name);
        let (found, apart) = certified(&mesh, &grid((-0.05, 0.05, 61), (-0.05, 0.05, 61)));
        // The file's floats make the wedge's plane no better than this.
        assert!(found.bound_m() < 5e-9, "{name}: {found:?}");
        assert!(apart.unwrap().upper_m < 5e-9, "{name}: {apart:?}");
        assert_eq!(found.cells.inner, 3600);
    }
}

#[test]
fn a_formula_and_its_mesh_agree_up_to_the_tessellation() {
    let cases = [
        (
            "half_sphere",
            Primitive::HalfSphere {
                radius_m: 0.05,
                base_m: 0.03,
            },
        ),
        (
            "half_cylinder",
            Primitive::HalfCylinder {
                radius_m: 0.05,
                length_m: 0.1,
                base_m: 0.03,
            },
        ),
    ];
    for (name, formula) in cases {
        let mesh = shape(name);
        let placed = PlacedPrimitive::new(formula, &Placement::default()).unwrap();
        // Away from the rim, where an error of the facets counts many times.
        let plan = grid((-0.033, 0.034, 41), (-0.033, 0.034, 37));
        let (found, _) = certified(&mesh, &plan);
        let (x, y) = (plan.x_m.nodes(), plan.y_m.nodes());
        let heights: Vec<Option<f64>> = y
            .iter()
            .flat_map(|y| x.iter().map(|x| placed.sample(*x, *y).map(|s| s.height_m)))
            .collect();
        let exact = deviation::primitive(&placed, &plan, &heights);
        assert!(
            exact.slack_m <= 2e-6 * exact.above.value_m + 1e-15,
            "{exact:?}"
        );
        assert_eq!(exact.below.value_m, 0.0);
        let estimate = estimated_deviation_m(&mesh);
        assert!(estimate > 0.0 && estimate < 30e-6, "{name}: {estimate}");
        // Facets inside the body: heights at nodes and between are both off by at most 3 of them.
        let off = (found.worst().value_m - exact.worst().value_m).abs();
        assert!(
            off < 3.0 * estimate,
            "{name}: {found:?} {exact:?} {estimate}"
        );
    }
}

#[test]
fn the_tessellations_estimate_is_the_sagitta() {
    let radius = 0.7;
    for facets in [12, 40, 200] {
        let knots: Vec<[f64; 2]> = (0..=facets)
            .map(|k| {
                let angle = f64::from(k) / f64::from(facets) * std::f64::consts::PI;
                [-radius * angle.cos(), radius * angle.sin()]
            })
            .collect();
        let estimate = estimated_deviation_m(&exact(roof(&knots, [-0.5, 0.5])));
        let half = std::f64::consts::PI / f64::from(facets) / 2.0;
        let sagitta = radius * (1.0 - half.cos());
        assert!(
            (estimate / sagitta - 1.0).abs() < 0.02,
            "{facets}: {estimate} {sagitta}"
        );
    }
    assert_eq!(estimated_deviation_m(&shape("flat")), 0.0);
}

#[test]
fn fans_t_junctions_and_doubled_faces_change_nothing() {
    // A dome of few facets over a base, then the same cut up.
    let apex = [0.51, 0.47, 0.9];
    let rim: Vec<[f64; 3]> = (0..300)
        .map(|k| {
            let angle = f64::from(k) / 300.0 * std::f64::consts::TAU;
            [0.5 + 0.8 * angle.cos(), 0.5 + 0.8 * angle.sin(), 0.3]
        })
        .collect();
    let fan: Vec<Triangle> = (0..300)
        .map(|k| [apex, rim[k], rim[(k + 1) % 300]])
        .collect();
    let base: Vec<Triangle> = (1..299).map(|k| [rim[0], rim[k], rim[k + 1]]).collect();
    let plan = grid((0.0, 1.0, 7), (0.0, 1.0, 6));
    let (expected, _) = certified(&exact(fan.clone()), &plan);
    // The apex protrudes of its cell.
    assert!(expected.above.at_m == [0.51, 0.47], "{expected:?}");
    let mut closed = [fan.clone(), base].concat();
    closed.extend_from_slice(&fan[..50]);
    // The base hidden, faces twice, and some halved at a point of their rim side only.
    for triangle in &fan[50..80] {
        let [a, b, c] = *triangle;
        let m = [0, 1, 2].map(|k| 0.5 * (b[k] + c[k]));
        closed.retain(|t| t != triangle);
        closed.extend([[a, b, m], [a, m, c]]);
    }
    let (found, _) = certified(&exact(closed), &plan);
    assert_eq!(found.above.at_m, expected.above.at_m);
    assert!((found.above.value_m - expected.above.value_m).abs() < 1e-15);
    assert!(
        (found.below.value_m - expected.below.value_m).abs() < 1e-11,
        "{found:?} {expected:?}"
    );
}

#[test]
fn cells_say_where_the_surface_ends() {
    let mesh = exact(vec![
        [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [0.0, 1.0, 0.5]],
        // A spike between the points.
        [[1.7, 1.7, 0.1], [1.8, 1.7, 0.1], [1.7, 1.8, 0.3]],
    ]);
    let (found, apart) = certified(&mesh, &grid((0.0, 2.0, 5), (0.0, 2.0, 5)));
    assert_eq!(
        (
            found.cells.inner,
            found.cells.silhouette,
            found.cells.missed
        ),
        (1, 5, 1)
    );
    assert!(apart.unwrap().upper_m < 1e-10);
    // Without a cell there is nothing to compare.
    let (found, apart) = certified(&mesh, &grid((0.1, 0.1, 1), (0.0, 0.5, 3)));
    assert_eq!((found.cells.inner, apart), (0, None));
}

/// Quartering a rectangle does not part what lies over itself: it took hours.
#[test]
fn sheets_over_each_other_take_no_longer_than_the_highest() {
    const SHEETS: usize = 20;
    let sheet = |z: [f64; 3]| {
        let [a, b, c] = [0, 1, 2].map(|k| z[k]);
        let corners = [[-1.0, -1.0, a], [2.0, -1.0, b], [-1.0, 2.0, c]];
        let far = [2.0, 2.0, b + c - a];
        [corners, [corners[1], far, corners[2]]]
    };
    let ridge = roof(&[[-1.0, 0.9], [0.31, 1.7], [2.0, 0.9]], [-1.0, 2.0]);
    let plan = grid((0.0, 1.0, 9), (0.0, 1.0, 8));
    let (expected, _) = certified(&exact(ridge.clone()), &plan);
    assert!(expected.above.value_m > 1e-3, "{expected:?}");
    let below = |k: usize| 0.01 * k as f64 - 2.0;
    let stacks: [Vec<Triangle>; 4] = [
        // Level, steep, crossing each other, and one sheet many times.
        (0..SHEETS).flat_map(|k| sheet([below(k); 3])).collect(),
        (0..SHEETS)
            .flat_map(|k| sheet([-19.0, -10.0, -10.0].map(|z| z + below(k))))
            .collect(),
        (0..SHEETS)
            .flat_map(|k| sheet([below(k), below(SHEETS - k), below(k * 7 % SHEETS)]))
            .collect(),
        (0..SHEETS).flat_map(|_| sheet([0.5; 3])).collect(),
    ];
    for (case, stack) in stacks.into_iter().enumerate() {
        let (found, apart) = certified(&exact([stack.clone(), ridge.clone()].concat()), &plan);
        for (got, expected) in [(found.above, expected.above), (found.below, expected.below)] {
            assert!(
                (got.value_m - expected.value_m).abs() < 1e-11,
                "{case}: {found:?} {expected:?}"
            );
        }
        assert!(apart.unwrap().lower_m <= found.bound_m(), "{case}");
        // By themselves they are seen.
        let (found, _) = certified(&exact(stack), &plan);
        assert_eq!(found.cells.inner, 8 * 7, "{case}");
        let plane = case != 2;
        assert_eq!(found.bound_m() < 1e-9, plane, "{case}: {found:?}");
    }
}

/// The seed's shapes: `cargo test --test shape -- the_seed_shapes --nocapture`.
#[test]
#[allow(clippy::print_stdout, clippy::disallowed_methods)]
fn the_seed_shapes_differ_less_with_every_finer_grid() {
    println!("shape          points  vertical um  Hausdorff um        cells: rim  ms");
    for name in ["flat", "half_sphere", "half_cylinder", "wedge"] {
        let mesh = shape(name);
        let mut before = f64::INFINITY;
        for samples in [31, 61] {
            let plan = grid((-0.05, 0.05, samples), (-0.05, 0.05, samples));
            let start = std::time::Instant::now();
            let (found, apart) = certified(&mesh, &plan);
            let apart = apart.unwrap();
            println!(
                "{name:<14} {samples:>6} {:>12.4} {:>9.4} {:>9.4} {:>10} {:>8.1}",
                found.bound_m() * 1e6,
                apart.lower_m * 1e6,
                apart.upper_m * 1e6,
                found.cells.silhouette,
                start.elapsed().as_secs_f64() * 1e3
            );
            assert!(apart.lower_m <= apart.upper_m && apart.upper_m <= found.bound_m() + 1e-15);
            let ends = apart.upper_m < before || apart.upper_m < 5e-9;
            assert!(ends, "{name} {samples}: {apart:?}");
            before = apart.upper_m;
        }
    }
}

#[test]
fn a_turned_body_is_certified_alike_on_any_number_of_threads() {
    let bytes = std::fs::read(root().join("shapes/half_sphere.stl")).unwrap();
    let placement = Placement {
        translate_m: [0.003, -0.002, 0.09],
        rotate_deg: [17.0, -23.0, 40.0],
        ..Placement::default()
    };
    let file = stl::read(&bytes).unwrap();
    let mesh = Mesh::place(file, &Transform::new(0.001, &placement)).unwrap();
    let plan = grid((-0.03, 0.031, 18), (-0.029, 0.03, 15));
    let (found, apart) = certified(&mesh, &plan);
    let heights = heights(&mesh, &plan);
    let mut random = Random::new(3);
    let mut most = [0.0_f64; 2];
    for _ in 0..400 {
        let p = [random.between(-0.03, 0.031), random.between(-0.029, 0.03)];
        let Some(interpolated) = bilinear(&heights, &plan, p) else {
            continue;
        };
        let off = cast(mesh.triangles(), p).unwrap() - interpolated;
        most = [most[0].max(off), most[1].max(-off)];
    }
    assert!(found.above.value_m >= most[0] && found.below.value_m >= most[1] - 1e-15);
    assert!(found.above.value_m < 1.5 * most[0], "{found:?} {most:?}");
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        assert_eq!(pool.install(|| certified(&mesh, &plan)), (found, apart));
    }
}

#[test]
fn a_certificate_that_may_take_nothing_is_none_and_the_points_stand() {
    let mesh = exact(roof(&[[-2.0, 0.5], [0.3, 0.7], [3.0, 0.5]], [-1.0, 2.0]));
    let plan = grid((-1.0, 1.0, 3), (-0.5, 0.5, 3));
    let samples = sample(&mesh, &plan);
    assert!(samples.iter().all(Option::is_some));
    let surface = Surface::Mesh(mesh);
    let certified = |seconds| {
        certify(
            &surface,
            &plan,
            &samples,
            Certify::Vertical,
            seconds,
            &Silent,
        )
        .unwrap()
    };
    assert_eq!(certified(0), None);
    assert!(certified(1).is_some());
}

#[test]
fn a_certificate_holds_the_requested_distances() {
    let mesh = exact(roof(&[[-2.0, 0.5], [0.3, 0.7], [3.0, 0.5]], [-1.0, 2.0]));
    let plan = grid((-1.0, 1.0, 3), (-0.5, 0.5, 3));
    let samples = sample(&mesh, &plan);
    let surface = Surface::Mesh(mesh);
    let reported = |how| {
        let found = certify(&surface, &plan, &samples, how, CERTIFY_SECONDS, &Silent).unwrap();
        found.map(|certificate| certificate.hausdorff.is_some())
    };
    assert_eq!(reported(Certify::No), None);
    assert_eq!(reported(Certify::Vertical), Some(false));
    assert_eq!(reported(Certify::Distance), Some(true));
}

/// The largest over all cells is the whole grid's; a cell without its four points has none.
#[test]
fn cells_one_by_one_add_up_to_the_whole() {
    let radius_m = 0.05;
    let formula = Primitive::HalfSphere {
        radius_m,
        base_m: 0.03,
    };
    let placed = PlacedPrimitive::new(formula, &Placement::default()).unwrap();
    let mesh = shape("half_sphere");
    // The sphere's border passes through it.
    let plan = grid((-0.06, 0.033, 8), (-0.033, 0.034, 6));
    let (x, y) = (plan.x_m.nodes(), plan.y_m.nodes());
    let points = || y.iter().flat_map(|y| x.iter().map(|x| [*x, *y]));
    let of_formula: Vec<Option<f64>> = points()
        .map(|[x, y]| placed.sample(x, y).map(|s| s.height_m))
        .collect();
    let whole = |cells: &[Option<f64>]| cells.iter().flatten().fold(0.0_f64, |m, b| m.max(*b));
    let corners = |heights: &[Option<f64>], cell: usize| {
        let node = cell / 7 * 8 + cell % 7;
        [0, 1, 8, 9].iter().all(|k| heights[node + k].is_some())
    };

    // Relative errors once were of the largest difference over the lowest of all heights.
    let relative = |cells: &[Option<f64>], heights: &[Option<f64>]| {
        let lowest_m = lowest_requested_m(heights.iter().flatten().copied()).unwrap();
        let of_cell = |cell: usize| {
            let node = cell / 7 * 8 + cell % 7;
            let corners = [0, 1, 8, 9].iter().filter_map(|k| heights[node + k]);
            let least_m = corners.fold(f64::INFINITY, f64::min).max(lowest_m);
            cells[cell].map_or(0.0, |bound_m| bound_m / least_m)
        };
        (0..35).map(of_cell).fold(0.0, f64::max)
    };

    let found = deviation::primitive_by_cell(&placed, &plan, &of_formula);
    let together = deviation::primitive(&placed, &plan, &of_formula);
    let bound_m = together.bound_m();
    assert_eq!(found.len(), 35);
    assert!((whole(&found) / bound_m - 1.0).abs() < 1e-5, "{bound_m}");
    let ratio = together.relative.unwrap() / relative(&found, &of_formula);
    assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");

    let of_mesh = heights(&mesh, &plan);
    let faces = Faces::new(&mesh, &plan, Looks::endless());
    let lattice = Lattice::new(&faces, &plan, &of_mesh);
    let met = deviation::vertical_by_cell(&lattice, &Silent).unwrap();
    let together = vertical(&mesh, &plan, &lattice, &Silent).unwrap();
    let bound_m = together.bound_m();
    assert_eq!(met.len(), 35);
    let ratio = together.relative.unwrap() / relative(&met, &of_mesh);
    assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    // Where heights differ much it is far from the one over the lowest.
    let lowest_m = lowest_requested_m(of_mesh.iter().flatten().copied()).unwrap();
    assert!(together.relative.unwrap() < 0.99 * bound_m / lowest_m);
    assert!((whole(&met) / bound_m - 1.0).abs() < 1e-9, "{bound_m}");
    for cell in 0..35 {
        assert_eq!(found[cell].is_some(), corners(&of_formula, cell), "{cell}");
        assert_eq!(met[cell].is_some(), corners(&of_mesh, cell), "{cell}");
    }
}

#[test]
fn an_interruption_ends_the_cells_too() {
    struct Stop;
    impl Progress for Stop {
        fn interrupted(&self) -> bool {
            true
        }
    }
    let mesh = exact(roof(&[[-2.0, 0.5], [0.3, 0.7], [3.0, 0.5]], [-1.0, 2.0]));
    let plan = grid((-1.0, 1.0, 3), (-0.5, 0.5, 3));
    let heights = heights(&mesh, &plan);
    let faces = Faces::new(&mesh, &plan, Looks::endless());
    let lattice = Lattice::new(&faces, &plan, &heights);
    assert!(deviation::vertical_by_cell(&lattice, &Stop).is_err());
    assert!(vertical(&mesh, &plan, &lattice, &Stop).is_err());
}
