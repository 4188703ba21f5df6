//! Heights against exact arithmetic, and against what must not matter.

use fluxform_shape::document::Placement;
use fluxform_shape::file_mesh::{FileMesh, Triangle};
use fluxform_shape::height::{Grid, Sample};
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::stl;

use fluxform_testing::boxes::box_of;
use fluxform_testing::surfaces::{binary, exact, grid, sample};
use fluxform_testing::{Random, root};

/// Height over an integer point by whole-number arithmetic: (numerator, denominator > 0).
fn brute_force(triangles: &[[[i64; 3]; 3]], x: i64, y: i64) -> Option<(i128, i128)> {
    let mut top: Option<(i128, i128)> = None;
    let mut raise = |height: (i128, i128)| {
        if top.is_none_or(|t| height.0 * t.1 > t.0 * height.1) {
            top = Some(height);
        }
    };
    let side = |a: [i64; 3], b: [i64; 3], p: [i64; 2]| -> i128 {
        i128::from(a[0] - p[0]) * i128::from(b[1] - p[1])
            - i128::from(a[1] - p[1]) * i128::from(b[0] - p[0])
    };
    for [a, b, c] in triangles {
        let whole = side(*a, *b, [c[0], c[1]]);
        let weights = [
            side(*b, *c, [x, y]),
            side(*c, *a, [x, y]),
            side(*a, *b, [x, y]),
        ];
        if whole != 0 {
            let weights = weights.map(|w| w * whole.signum());
            if weights.iter().all(|w| *w >= 0) {
                let z = [a[2], b[2], c[2]].map(i128::from);
                let height = weights[0] * z[0] + weights[1] * z[1] + weights[2] * z[2];
                raise((height, whole.abs()));
            }
            continue;
        }
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let between = |k: usize, v: i64| v >= p[k].min(q[k]) && v <= p[k].max(q[k]);
            if side(*p, *q, [x, y]) != 0 || !between(0, x) || !between(1, y) {
                continue;
            }
            let k = usize::from(p[0] == q[0]);
            let (span, at) = (i128::from(q[k] - p[k]), i128::from([x, y][k] - p[k]));
            if span == 0 {
                raise((i128::from(p[2].max(q[2])), 1));
            } else {
                let height = i128::from(p[2]) * span + at * i128::from(q[2] - p[2]);
                raise((height * span.signum(), span.abs()));
            }
        }
    }
    top
}

fn check(triangles: &[[[i64; 3]; 3]], from: i64, to: i64, step: i64, tolerance: f64) -> usize {
    let samples = ((to - from) / step + 1) as usize;
    let plan = grid(
        (from as f64, to as f64, samples),
        (from as f64, to as f64, samples),
    );
    // Triangles without any area are no surface: the mesh drops them, so must the check.
    let solid: Vec<_> = triangles
        .iter()
        .copied()
        .filter(|[a, b, c]| {
            let [u, v] = [b, c].map(|q| [q[0] - a[0], q[1] - a[1], q[2] - a[2]].map(i128::from));
            u[1] * v[2] != u[2] * v[1] || u[2] * v[0] != u[0] * v[2] || u[0] * v[1] != u[1] * v[0]
        })
        .collect();
    let mesh = exact(
        triangles
            .iter()
            .map(|t| t.map(|v| v.map(|c| c as f64)))
            .collect(),
    );
    let heights = sample(&mesh, &plan);
    let mut covered = 0;
    for (k, found) in heights.iter().enumerate() {
        let x = from + step * (k % samples) as i64;
        let y = from + step * (k / samples) as i64;
        let expected = brute_force(&solid, x, y).map(|(p, q)| p as f64 / q as f64);
        match (found, expected) {
            (Some(found), Some(expected)) => {
                let error = (found.height_m - expected).abs();
                assert!(
                    error <= tolerance,
                    "({x}, {y}): {} {expected}",
                    found.height_m
                );
                covered += 1;
            }
            (None, None) => {}
            _ => panic!("({x}, {y}): {found:?}, exactly {expected:?}"),
        }
    }
    covered
}

#[test]
fn random_soups_match_whole_number_arithmetic() {
    let mut random = Random::new(1);
    let mut covered = 0;
    for round in 0..60 {
        // Small numbers put points on edges, vertices and walls all the time.
        let size = [12, 40, 1000][round % 3];
        let mut coordinate = || random.below(2 * size + 1) as i64 - size as i64;
        let triangles: Vec<_> = (0..30)
            .map(|_| [(); 3].map(|()| [(); 3].map(|()| coordinate())))
            .collect();
        let step = (size as i64 / 12).max(1);
        covered += check(
            &triangles,
            -14 * step,
            14 * step,
            step,
            1e-15 * size as f64 * 4.0,
        );
    }
    assert!(covered > 20_000, "{covered}");
}

#[test]
fn vertical_walls_show_their_top() {
    let mut random = Random::new(2);
    let mut covered = 0;
    for _ in 0..40 {
        let triangles: Vec<_> = (0..12)
            .map(|_| {
                // Three points over one line in plan.
                let mut number = |n: usize| random.below(2 * n + 1) as i64 - n as i64;
                let (at, along) = ([number(9), number(9)], [number(2), number(2)]);
                [(); 3].map(|()| {
                    let t = number(6);
                    [at[0] + t * along[0], at[1] + t * along[1], number(20)]
                })
            })
            .collect();
        covered += check(&triangles, -21, 21, 1, 1e-14);
    }
    assert!(covered > 1000, "{covered}");
}

#[test]
fn needles_of_a_million_to_one_are_exact() {
    let mut random = Random::new(3);
    let mut covered = 0;
    for _ in 0..60 {
        let mut number = |n: usize| random.below(2 * n + 1) as i64 - n as i64;
        // So long that its products do not fit a double's 53 bits.
        let long = [
            700_000_001 + number(2000),
            699_999_999 + number(2000),
            100_000 + number(9),
        ];
        let start = [number(3), number(3), number(1000)];
        let end = [0, 1, 2].map(|k| start[k] + long[k]);
        let corner = [end[0] + number(900), end[1] + number(900), number(100_000)];
        // Half way along it.
        let [from, to] = [349_998_000, 350_002_000];
        covered += check(&[[start, end, corner]], from, to, 20, 1e-9);
    }
    assert!(covered > 1000, "{covered}");
}

#[test]
fn one_triangle_is_met_at_its_vertices_and_within_its_heights() {
    let triangle = [[-0.7, -0.3, 0.11], [1.3, 0.1, 0.97], [0.2, 1.9, -0.53]];
    let mesh = exact(vec![triangle]);
    for v in triangle {
        let found = sample(&mesh, &grid((v[0], v[0], 1), (v[1], v[1], 1)))[0].unwrap();
        assert_eq!(found.height_m, v[2]);
    }
    let heights = sample(&mesh, &grid((-1.0, 1.5, 301), (-0.5, 2.0, 301)));
    let covered: Vec<Sample> = heights.into_iter().flatten().collect();
    // Area of the triangle over that of a cell.
    let area = 0.5 * (2.0 * 2.2 - 0.4 * 0.9);
    let cells = covered.len() as f64 * (2.5 / 300.0) * (2.5 / 300.0);
    assert!((cells / area - 1.0).abs() < 0.01, "{cells} {area}");
    assert!(covered.iter().all(|s| (-0.53..=0.97).contains(&s.height_m)));
    assert!(
        covered
            .iter()
            .all(|s| s.normal == covered[0].normal && s.normal[2] > 0.0)
    );
}

fn half_sphere(translate_m: [f64; 3], rotate_deg: [f64; 3]) -> Mesh {
    let bytes = std::fs::read(root().join("shapes/half_sphere.stl")).unwrap();
    let placement = Placement {
        translate_m,
        rotate_deg,
        ..Placement::default()
    };
    Mesh::place(
        stl::read(&bytes).unwrap(),
        &Transform::new(0.001, &placement),
    )
    .unwrap()
}

fn bits(samples: &[Option<Sample>]) -> Vec<Option<[u64; 4]>> {
    samples
        .iter()
        .map(|s| s.map(|s| [s.height_m, s.normal[0], s.normal[1], s.normal[2]].map(f64::to_bits)))
        .collect()
}

fn seed_plan() -> Grid {
    grid((-0.05, 0.05, 61), (-0.05, 0.05, 61))
}

#[test]
fn order_orientation_and_threads_leave_every_bit() {
    let bytes = std::fs::read(root().join("shapes/half_sphere.stl")).unwrap();
    let file = stl::read(&bytes).unwrap();
    let mut random = Random::new(4);
    let place = |triangles: Vec<Triangle>| {
        let file = FileMesh {
            triangles,
            ..file.clone()
        };
        Mesh::place(file, &Transform::new(0.001, &Placement::default())).unwrap()
    };
    let plans = [seed_plan(), grid((-0.04, 0.05, 101), (-0.0501, 0.043, 77))];
    for plan in plans {
        let expected = bits(&sample(&place(file.triangles.clone()), &plan));
        let mut triangles = file.triangles.clone();
        for t in &mut triangles {
            let (a, b) = (random.below(3), random.below(3));
            t.swap(a, b);
        }
        for k in (1..triangles.len()).rev() {
            triangles.swap(k, random.below(k + 1));
        }
        // Some faces twice.
        let again = triangles[..500].to_vec();
        triangles.extend(again);
        let mesh = place(triangles);
        assert_eq!(bits(&sample(&mesh, &plan)), expected);
        for threads in [1, 2, 3, 7] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap();
            assert_eq!(
                pool.install(|| bits(&sample(&mesh, &plan))),
                expected,
                "{threads} threads"
            );
        }
    }
}

#[test]
fn quarter_turns_and_translations_commute_with_sampling() {
    let still = sample(&half_sphere([0.0; 3], [0.0; 3]), &seed_plan());
    let turned = sample(&half_sphere([0.0; 3], [0.0, 0.0, 90.0]), &seed_plan());
    let shift = [0.0137, -0.0291, 0.011];
    let moved = sample(
        &half_sphere(shift, [0.0; 3]),
        &grid(
            (shift[0] - 0.05, shift[0] + 0.05, 61),
            (shift[1] - 0.05, shift[1] + 0.05, 61),
        ),
    );
    for row in 0..61 {
        for column in 0..61 {
            let here = still[row * 61 + column];
            // (x, y) goes to (-y, x).
            let there = turned[column * 61 + 60 - row];
            let beside = moved[row * 61 + column];
            assert_eq!(here.is_some(), there.is_some(), "{row} {column}");
            assert_eq!(here.is_some(), beside.is_some(), "{row} {column}");
            let (Some(here), Some(there), Some(beside)) = (here, there, beside) else {
                continue;
            };
            assert!((here.height_m - there.height_m).abs() < 1e-15);
            // Near the rim the surface is steep: the shift's rounding is multiplied.
            assert!((here.height_m + shift[2] - beside.height_m).abs() < 1e-14);
        }
    }
}

#[test]
fn neighbours_leave_no_crack_in_any_position() {
    let bytes = std::fs::read(root().join("shapes/half_sphere.stl")).unwrap();
    let mut file = stl::read(&bytes).unwrap();
    // Without rounding nothing is snapped: only the edges' exact treatment closes the surface.
    file.coordinate_rounding = 0.0;
    let mut random = Random::new(6);
    for _ in 0..20 {
        let rotate_deg = [20.0, 20.0, 180.0].map(|most| random.between(-most, most));
        let placement = Placement {
            translate_m: [0.0; 3],
            rotate_deg,
            ..Placement::default()
        };
        let mesh = Mesh::place(file.clone(), &Transform::new(0.001, &placement)).unwrap();
        let [tilt_x, tilt_y, _] = rotate_deg.map(f64::to_radians);
        // There the vertical line leaves the body through the dome.
        let dome_m = 0.0499 * (tilt_x.abs() + tilt_y.abs()).cos();
        for (k, found) in sample(&mesh, &seed_plan()).iter().enumerate() {
            let [x, y] = [k % 61, k / 61].map(|i| seed_plan().x_m.node(i));
            if x.hypot(y) < dome_m {
                let height = found.expect("no crack").height_m;
                let off = x.hypot(y).hypot(height) - 0.05;
                assert!(
                    (-12.2e-6..=1e-9).contains(&off),
                    "{rotate_deg:?} {x} {y}: {off}"
                );
            }
        }
    }
}

/// A box in mm as float triangles; its bottom is wider by `lean` on every side.
fn leaning_box(lean: f32) -> Vec<[[f32; 3]; 3]> {
    box_of(|k| {
        let wide = if k & 4 == 0 { 20.0 + lean } else { 20.0 };
        [
            if k & 1 == 0 { -wide } else { wide },
            if k & 2 == 0 { -wide } else { wide },
            if k & 4 == 0 { 0.0 } else { 15.0 },
        ]
    })
}

#[test]
fn walls_that_rounding_tilts_are_still_walls() {
    // One unit in the last place of 20 mm, either way.
    for lean in [0.0, 1.9e-6, -1.9e-6] {
        let file = stl::read(&binary(&leaning_box(lean))).unwrap();
        let mesh = Mesh::place(file, &Transform::new(0.001, &Placement::default())).unwrap();
        let bounds = mesh.facts().bounds;
        for half in [0.02, bounds.max_m[0]] {
            let found = sample(&mesh, &grid((-half, half, 41), (-half, half, 41)));
            assert!(
                found.iter().all(|s| s.is_some_and(|s| s.height_m == 0.015)),
                "{lean} {half}"
            );
        }
        // A wall that leans visibly is a slope.
        let beyond = sample(&mesh, &grid((0.0201, 0.0201, 1), (0.0, 0.0, 1)));
        assert_eq!(beyond, [None]);
    }
    let file = stl::read(&binary(&leaning_box(4.0))).unwrap();
    let mesh = Mesh::place(file, &Transform::new(0.001, &Placement::default())).unwrap();
    let slope = sample(&mesh, &grid((0.022, 0.022, 1), (0.001, 0.001, 1)))[0].unwrap();
    assert!((slope.height_m - 0.0075).abs() < 1e-15);
    assert!((slope.normal[0] - 15.0 / 241f64.sqrt()).abs() < 1e-15);
}

#[test]
fn a_far_origin_loses_no_border() {
    // The half-cylinder written 1e6 mm away: in digits, and in floats 1/16 mm apart.
    let bytes = std::fs::read(root().join("shapes/half_cylinder.stl")).unwrap();
    let near = stl::read(&bytes).unwrap().triangles;
    let placement = Placement {
        translate_m: [-1000.0, 1000.0, 0.03],
        rotate_deg: [0.0; 3],
        ..Placement::default()
    };
    let transform = Transform::new(0.001, &placement);
    let shape = |x: f64| 0.03 + (0.0025 - x * x).max(0.0).sqrt();
    let mut text = String::from("solid far\n");
    let mut floats = Vec::new();
    for t in &near {
        text += "facet normal 0 0 1 outer loop";
        for [x, y, z] in t {
            text += &format!(" vertex {:.6} {:.6} {:.6}", x + 1e6, y - 1e6, z);
        }
        text += " endloop endfacet\n";
        floats.push(t.map(|v| [(v[0] + 1e6) as f32, (v[1] - 1e6) as f32, v[2] as f32]));
    }
    text += "endsolid far\n";
    // Facets of 1 um; then three roundings of the floats, where rims become walls.
    for (bytes, allowed_m) in [(text.into_bytes(), 1.2e-6), (binary(&floats), 190e-6)] {
        let mesh = Mesh::place(stl::read(&bytes).unwrap(), &transform).unwrap();
        for (k, found) in sample(&mesh, &seed_plan()).iter().enumerate() {
            let x = seed_plan().x_m.node(k % 61);
            let height = found.expect("no border point is lost").height_m;
            let off = (x.hypot(height - 0.03) - 0.05).abs();
            assert!(off < allowed_m, "{x}: {height} {}", shape(x));
        }
    }
}

/// Rounding decided there which body a point of the silhouette belonged to: of 48 points 16 fell onto the slab.
#[test]
fn a_silhouette_over_another_body_is_met_at_all_its_nodes() {
    let slab = box_of(|k| {
        let end = |bit: usize| if k & bit == 0 { -20.0 } else { 20.0 };
        [end(1), end(2), if k & 4 == 0 { 0.0 } else { 10.0 }]
    });
    // A double pyramid, whose silhouette is |x| + |y| = 12 mm at a height of 30 mm.
    let waist = [[12.0, 0.0], [0.0, 12.0], [-12.0, 0.0], [0.0, -12.0f32]];
    let corner = |k: usize| [waist[k % 4][0], waist[k % 4][1], 30.0];
    let faces =
        (0..4).flat_map(|k| [40.0, 22.0].map(|apex| [corner(k), corner(k + 1), [0.0, 0.0, apex]]));
    let file = stl::read(&binary(&[slab, faces.collect()].concat())).unwrap();
    let mesh = Mesh::place(file, &Transform::new(0.001, &Placement::default())).unwrap();
    let found = sample(&mesh, &grid((-0.02, 0.02, 41), (-0.02, 0.02, 41)));
    let steps = |k: usize| (k % 41).abs_diff(20) + (k / 41).abs_diff(20);
    let waist: Vec<usize> = (0..found.len()).filter(|k| steps(*k) == 12).collect();
    assert_eq!(waist.len(), 48);
    for k in waist {
        let height_m = found[k].unwrap().height_m;
        assert!((height_m - 0.03).abs() < 1e-8, "{k}: {height_m}");
    }
}

/// Of two faces that both fall from a ridge the flatter is seen, of two that rise from a gutter the
/// steeper, and of one that rises and one that does not the rising one.
#[test]
fn a_node_on_an_edge_shows_one_face_by_rule() {
    let side = |x: f64, z: f64| [[x, -1.0, z], [x, 1.0, z]];
    let quad = |[a, b]: [[f64; 3]; 2], [c, d]: [[f64; 3]; 2]| [[a, b, c], [b, d, c]];
    let plan = grid((-0.5, 0.5, 3), (-0.5, 0.5, 3));
    for (left, right, seen) in [
        (0.7, -1.3, 0.7),
        (1.3, -0.7, -0.7),
        (-0.7, 1.3, 1.3),
        (-1.3, 0.7, -1.3),
        (0.7, 1.3, 1.3),
        (1.3, 0.7, 0.7),
        (-1.3, -0.7, -1.3),
        (0.0, 0.7, 0.7),
        (0.0, -0.7, 0.0),
    ] {
        let middle = side(0.0, 5.0);
        let triangles = [
            quad(side(-1.0, 5.0 - left), middle),
            quad(middle, side(1.0, 5.0 + right)),
        ];
        let found = sample(&exact(triangles.concat()), &plan)[4].unwrap();
        let slope = -found.normal[0] / found.normal[2];
        assert_eq!(found.height_m, 5.0);
        assert!((slope - seen).abs() < 1e-15, "{left} {right}: {slope}");
    }
}
