//! Flags of points, holes, and points on no grid.

use std::f64::consts::PI;

use fluxform_base::progress::Silent;
use fluxform_numerics::axis::Axis;
use fluxform_shape::bodies::BodyOptions;
use fluxform_shape::certificate::Certify;
use fluxform_shape::deviation::{Faces, Lattice, Looks, vertical};
use fluxform_shape::document::{
    AxisRequest, GridRequest, Placement, Primitive, ShapeDocument, SurfaceSource,
};
use fluxform_shape::file_mesh::{FileMesh, Triangle};
use fluxform_shape::height::Grid;
use fluxform_shape::holes::{Holes, fill, holes};
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::point_flags::Marks;
use fluxform_shape::points::Known;
use fluxform_shape::primitive::PlacedPrimitive;
use fluxform_shape::scattered::Probe;
use fluxform_shape::scattered::adaptive::{Adaptive, Grading, adaptive};
use fluxform_shape::scattered::poisson::poisson;
use fluxform_shape::{Settings, Surface, discretize_with, stl};

use fluxform_testing::boxes::block;
use fluxform_testing::surfaces::{exact, file, grid, lifted, sample, seed_grid};
use fluxform_testing::{Random, root};

/// Patches as wide as the deviation allows.
fn to(max_deviation_m: f64) -> Grading {
    Grading {
        max_deviation_m,
        widest_m: f64::INFINITY,
    }
}

fn probe_at(triangles: Vec<Triangle>, points: &[[f64; 2]]) -> Vec<Option<(f64, Marks)>> {
    let surface = Surface::Mesh(exact(triangles));
    let probe = Probe::new(&surface, &grid((-3.0, 3.0, 7), (-3.0, 3.0, 7)));
    let found = points.iter().map(|p| probe.at(*p));
    found
        .map(|f| f.map(|(sample, marks)| (sample.height_m, marks)))
        .collect()
}

#[test]
fn a_box_has_walls_and_rims() {
    let points = [[0.3, 0.2], [1.0, 0.2], [1.0, 1.0], [1.5, 0.0]];
    let found = probe_at(
        block([-1.0; 3].map(|c| c + 1.5), [2.5, 2.5, 2.0]),
        &points.map(|p| p.map(|c| c + 1.5)),
    );
    let [inside, side, corner, beyond] = found[..] else {
        panic!()
    };
    let (height, marks) = inside.unwrap();
    assert_eq!(
        (height, marks.wall, marks.rim, marks.layers, marks.overhang),
        (2.0, false, false, 2, false)
    );
    for marked in [side, corner] {
        let (height, marks) = marked.unwrap();
        assert!(
            height == 2.0 && marks.wall && marks.rim && marks.crease.is_none(),
            "{marks:?}"
        );
    }
    assert!(beyond.is_none());
}

#[test]
fn a_ridge_is_a_crease_with_both_normals() {
    // A roof of 45 degrees along y, a fold of 10 degrees beside it.
    let rise = 10f64.to_radians().tan();
    let knots = [[-2.0, 0.5], [0.0, 2.5], [2.0, 0.5], [3.0, -0.5]];
    let mut triangles = Vec::new();
    for pair in knots.windows(2) {
        let [[a, p], [b, q]] = [pair[0], pair[1]];
        triangles.push([[a, -1.0, p], [b, -1.0, q], [a, 1.0, p]]);
        triangles.push([[b, -1.0, q], [a, 1.0, p], [b, 1.0, q]]);
    }
    triangles.push([
        [-3.0, -1.0, 0.5 - 1.0 + rise],
        [-2.0, -1.0, 0.5],
        [-2.0, 1.0, 0.5],
    ]);
    let found = probe_at(
        triangles,
        &[[0.0, 0.3], [0.0, 1.0], [1.0, 0.3], [2.0, 0.0], [-2.0, 0.1]],
    );
    let marks: Vec<Marks> = found.iter().map(|f| f.unwrap().1).collect();
    let half = 0.5f64.sqrt();
    let other = marks[0].crease.unwrap();
    assert!((other[0].abs() - half).abs() < 1e-15 && (other[2] - half).abs() < 1e-15);
    assert!(!marks[0].rim && marks[1].rim, "{marks:?}");
    assert!(marks[2].crease.is_none() && marks[3].crease.is_none() && marks[4].crease.is_none());
    assert!(marks.iter().all(|m| m.layers == 1 && !m.overhang));
}

#[test]
fn a_table_has_an_overhang() {
    let mut triangles = block([-2.0, -2.0, 1.5], [2.0, 2.0, 1.75]);
    triangles.extend(block([-0.5, -0.5, 0.25], [0.5, 0.5, 1.0]));
    let found = probe_at(triangles, &[[0.1, 0.2], [1.0, 1.1]]);
    let marks: Vec<Marks> = found.iter().map(|f| f.unwrap().1).collect();
    assert!(
        marks[0].overhang && marks[0].layers == 4 && !marks[1].overhang && marks[1].layers == 2
    );
}

#[test]
fn holes_are_reported_and_filled_only_on_request() {
    // A tilted plate with a square hole from -0.3 to 0.3.
    let z = |x: f64, y: f64| 0.5 + 0.2 * x - 0.1 * y;
    let quad = |[x, p]: [f64; 2], [y, q]: [f64; 2]| {
        let at = |x, y| [x, y, z(x, y)];
        [
            [at(x, y), at(p, y), at(p, q)],
            [at(x, y), at(p, q), at(x, q)],
        ]
    };
    let plate: Vec<Triangle> = [
        quad([-1.0, 1.0], [-1.0, -0.3]),
        quad([-1.0, 1.0], [0.3, 1.0]),
        quad([-1.0, -0.3], [-0.3, 0.3]),
        quad([0.3, 1.0], [-0.3, 0.3]),
    ]
    .concat();
    let plan = grid((-1.2, 1.2, 25), (-1.2, 1.2, 25));
    let mut samples = sample(&exact(plate), &plan);
    let found = holes(&plan, &samples);
    // Nodes from -0.2 to 0.2: the hole's border belongs to the plate.
    assert_eq!(found.len(), 25);
    fill(&plan, &mut samples, &found);
    for &k in &found {
        let filled = samples[k].unwrap();
        let expected = z(plan.x_m.node(k % 25), plan.y_m.node(k / 25));
        // A plane is harmonic.
        assert!(
            (filled.height_m - expected).abs() < 1e-11,
            "{filled:?} {expected}"
        );
        let length = 1.05f64.sqrt();
        for (got, expected) in filled.normal.iter().zip([-0.2, 0.1, 1.0]) {
            assert!((got - expected / length).abs() < 1e-9, "{filled:?}");
        }
    }
    assert!(holes(&plan, &samples).is_empty());
}

/// Against a flood from outside over grids with a margin, sweep after sweep until nothing changes.
#[test]
fn random_holes_are_those_that_no_flood_reaches() {
    let mut random = Random::new(17);
    let some = sample(
        &exact(block([-1.0; 3], [1.0; 3])),
        &grid((0.0, 1.0, 2), (0.0, 1.0, 2)),
    )[0];
    let mut reported = 0;
    for _ in 0..1000 {
        let (columns, rows) = (1 + random.below(7), 1 + random.below(7));
        let plan = grid((0.0, 1.3, columns), (0.0, 0.7, rows));
        let samples: Vec<_> = (0..columns * rows)
            .map(|_| some.filter(|_| random.below(3) < 2))
            .collect();
        let mut wet = vec![vec![false; columns + 2]; rows + 2];
        let is_margin = |c: usize, r: usize| c == 0 || r == 0 || c > columns || r > rows;
        loop {
            let before = wet.clone();
            for r in 0..rows + 2 {
                for c in 0..columns + 2 {
                    let open = is_margin(c, r) || samples[(r - 1) * columns + c - 1].is_none();
                    let beside = is_margin(c, r)
                        || before[r - 1][c]
                        || before[r + 1][c]
                        || before[r][c - 1]
                        || before[r][c + 1];
                    wet[r][c] |= open && beside;
                }
            }
            if wet == before {
                break;
            }
        }
        let dry = |k: &usize| samples[*k].is_none() && !wet[k / columns + 1][k % columns + 1];
        let expected: Vec<usize> = (0..samples.len()).filter(dry).collect();
        assert_eq!(holes(&plan, &samples), expected, "{columns} x {rows}");
        reported += expected.len();
    }
    assert!(reported > 200, "{reported}");
}

#[test]
#[allow(clippy::disallowed_methods)]
fn holes_of_a_file_are_skipped_filled_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ring.stl");
    // A level ring of 40 facets between 10 and 40 mm.
    let mut text = String::from("solid ring\n");
    for k in 0..40 {
        let corner = |k: i32, r: f64| {
            let angle = f64::from(k) / 20.0 * PI;
            format!(" vertex {:.9} {:.9} 30", r * angle.cos(), r * angle.sin())
        };
        let [a, b, c, d] = [
            corner(k, 10.0),
            corner(k, 40.0),
            corner(k + 1, 40.0),
            corner(k + 1, 10.0),
        ];
        for [p, q, r] in [[&a, &b, &c], [&a, &c, &d]] {
            text += &format!("facet normal 0 0 1 outer loop{p}{q}{r} endloop endfacet\n");
        }
    }
    text += "endsolid ring\n";
    std::fs::write(&path, text).unwrap();
    let document = file(&path, 0.001, Placement::default(), seed_grid());
    let run = |holes, known| {
        let settings = Settings {
            holes,
            certify: Certify::Vertical,
            marks: true,
            cells: false,
            known,
            ..Settings::default()
        };
        discretize_with(&document, &settings, &Silent)
    };
    let skipped = run(Holes::Skip, Known::default()).unwrap();
    let filled = run(Holes::Fill, Known::default()).unwrap();
    assert_eq!(run(Holes::Skip, skipped.known()).unwrap(), skipped);
    let count = skipped.points.holes;
    assert!(count > 90 && filled.points.holes == count, "{count}");
    assert_eq!(filled.points.len(), skipped.points.len() + count);
    assert_eq!(
        filled.points.marks.iter().filter(|m| m.filled).count(),
        count
    );
    assert!(
        filled
            .points
            .height_m
            .iter()
            .all(|h| (h - 0.03).abs() < 1e-12)
    );
    assert!(skipped.warnings.iter().any(|w| w.contains("silhouette")));
    let refused = run(Holes::Error, Known::default()).unwrap_err().to_string();
    assert!(refused.contains("--holes"), "{refused}");
}

fn seed_region() -> Grid {
    grid((-0.05, 0.05, 61), (-0.05, 0.05, 61))
}

fn shape(name: &str) -> Surface {
    let bytes = std::fs::read(root().join(format!("shapes/{name}.stl"))).unwrap();
    let transform = Transform::new(0.001, &lifted(0.03));
    Surface::Mesh(Mesh::place(stl::read(&bytes).unwrap(), &transform).unwrap())
}

/// Beyond the surface, within it and on its borders.
#[test]
fn a_place_is_covered_where_it_has_a_height() {
    let mut random = Random::new(19);
    for name in ["flat", "wedge", "half_cylinder", "half_sphere"] {
        let surface = shape(name);
        let probe = Probe::new(&surface, &seed_region());
        let mut covered = 0;
        for k in 0..3000 {
            let [x, y] = [0; 2].map(|_| random.between(-0.056, 0.056));
            let at_m = match k % 3 {
                0 => [x, y],
                1 => [0.05_f64.copysign(x), y],
                _ => [0.05 * x.cos(), 0.05 * x.sin()],
            };
            assert_eq!(
                probe.covers(at_m),
                probe.sample(at_m).is_some(),
                "{name}: {at_m:?}"
            );
            covered += usize::from(probe.covers(at_m));
        }
        assert!((500..2900).contains(&covered), "{name}: {covered}");
    }
}

#[test]
#[allow(clippy::print_stdout)]
fn graded_points_hold_their_deviation_with_fewer_than_a_grid() {
    let deviation_m = 0.5e-3;
    for (name, area_m2) in [
        ("flat", 0.01),
        ("wedge", 0.01),
        ("half_cylinder", 0.01),
        ("half_sphere", PI * 0.0025),
    ] {
        let surface = shape(name);
        let probe = Probe::new(&surface, &seed_region());
        let found: Adaptive = adaptive(&probe, to(deviation_m), &Silent).unwrap();
        println!(
            "{name}: {} points, {} patches, {} at borders, within {} mm",
            found.points.len(),
            found.leaves,
            found.borders,
            found.vertical_m * 1e3
        );
        assert!(found.vertical_m <= deviation_m && found.border_m <= deviation_m);
        // The weights are the surface's area in plan.
        let sum: f64 = found.points.weight_m2.iter().sum();
        assert!((sum / area_m2 - 1.0).abs() < 2e-3, "{name}: {sum}");
        let points = &found.points;
        let pairs = (1..points.len()).map(|k| [k - 1, k]);
        assert!(
            pairs
                .into_iter()
                .all(|[a, b]| { (points.y_m[a], points.x_m[a]) < (points.y_m[b], points.x_m[b]) })
        );
        // A grid with as many points differs by more.
        if name == "half_cylinder" {
            let Surface::Mesh(mesh) = &surface else {
                unreachable!()
            };
            let side = (points.len() as f64).sqrt() as usize;
            let plan = grid((-0.05, 0.05, side), (-0.05, 0.05, side));
            let heights: Vec<Option<f64>> = sample(mesh, &plan)
                .iter()
                .map(|s| s.map(|s| s.height_m))
                .collect();
            let faces = Faces::new(mesh, &plan, Looks::endless());
            let off =
                vertical(mesh, &plan, &Lattice::new(&faces, &plan, &heights), &Silent).unwrap();
            assert!(off.bound_m() > 2.0 * deviation_m, "{off:?}");
        }
    }
}

/// A plate between the nodes of `lines` along x and y at 40 mm, without the cells in which `hole` says so;
/// turned about z. Its triangles, and its area.
fn pierced(lines: &[f64], hole: impl Fn(usize, usize) -> bool, turn: f64) -> (Vec<Triangle>, f64) {
    let (sin, cos) = turn.sin_cos();
    let at = |i: usize, j: usize| {
        let (x, y) = (lines[i], lines[j]);
        [cos * x - sin * y, sin * x + cos * y, 0.04]
    };
    let (mut triangles, mut area) = (Vec::new(), 0.0);
    for i in 0..lines.len() - 1 {
        for j in (0..lines.len() - 1).filter(|j| !hole(i, *j)) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
            area += (lines[i + 1] - lines[i]) * (lines[j + 1] - lines[j]);
        }
    }
    (triangles, area)
}

/// Four corners on the surface were taken for a patch of it, whatever hole or notch lay between them: the
/// area of this plate was 10000 mm^2 at every deviation.
#[test]
fn holes_and_notches_between_the_corners_are_no_surface() {
    let holed = [-0.05, 0.003, 0.022, 0.05];
    let slit = [-0.05, -0.0113, -0.0109, 0.05];
    let middle = |i: usize, j: usize| i == 1 && j == 1;
    let notch = |i: usize, j: usize| i == 1 && j > 0;
    let body = |(plate, area): (Vec<Triangle>, f64)| {
        let floor = |t: &Triangle| t.map(|[x, y, _]| [x, y, 0.03]);
        let below: Vec<Triangle> = plate.iter().map(floor).collect();
        ([plate, below].concat(), area)
    };
    for (case, (triangles, area_m2)) in [
        pierced(&holed, middle, 0.0),
        body(pierced(&holed, middle, 0.0)),
        pierced(&holed, notch, 0.0),
        pierced(&slit, notch, 0.0),
        pierced(&slit, middle, 0.3),
    ]
    .into_iter()
    .enumerate()
    {
        let surface = Surface::Mesh(exact(triangles));
        let reach = if case == 4 { 0.07 } else { 0.05 };
        let region = grid((-reach, reach, 3), (-reach, reach, 3));
        let probe = Probe::new(&surface, &region);
        for deviation_m in [5e-3, 1e-3, 0.2e-3] {
            let found = adaptive(&probe, to(deviation_m), &Silent).unwrap();
            let sum: f64 = found.points.weight_m2.iter().sum();
            // Where a turned plate's corner lies in a rectangle without a node on it, its tip is lost.
            let lost = if case == 4 {
                4.0 * deviation_m * deviation_m
            } else {
                0.0
            };
            let off = (sum - area_m2).abs();
            assert!(
                off <= lost + 1e-9 * area_m2,
                "{case}, {deviation_m}: {sum} {area_m2}"
            );
            assert!(found.borders > 0 && found.border_m <= deviation_m);
        }
    }
}

/// What a file's numbers leave open between two facets is no hole: no rectangles crowd along it.
#[test]
fn a_gap_within_the_files_rounding_is_covered() {
    let points = |gap_m: f64| {
        let (mut triangles, _) = pierced(&[-0.05, 0.0037, 0.05], |_, _| false, 0.0);
        for corner in triangles.as_flattened_mut() {
            if corner[0] == 0.0037 && corner[1] == 0.0037 {
                corner[0] -= gap_m;
            }
        }
        // The cells beyond keep their corner where it was.
        let (whole, _) = pierced(&[-0.05, 0.0037, 0.05], |_, _| false, 0.0);
        triangles.truncate(4);
        triangles.extend(&whole[4..]);
        let file = FileMesh {
            triangles,
            coordinate_rounding: 1e-9,
            ..FileMesh::default()
        };
        let placed = Transform::new(1.0, &Placement::default());
        let surface = Surface::Mesh(Mesh::place(file, &placed).unwrap());
        let probe = Probe::new(&surface, &seed_region());
        adaptive(&probe, to(0.5e-3), &Silent).unwrap().points.len()
    };
    assert_eq!(points(0.0), 25);
    assert_eq!(points(1e-9), 25);
    assert!(points(1e-6) > 100);
}

#[test]
fn a_formula_is_graded_too() {
    let formula = Primitive::HalfSphere {
        radius_m: 0.05,
        base_m: 0.03,
    };
    let surface = Surface::Primitive(PlacedPrimitive::new(formula, &Placement::default()).unwrap());
    let probe = Probe::new(&surface, &seed_region());
    let coarse = adaptive(&probe, to(2e-3), &Silent).unwrap();
    let fine = adaptive(&probe, to(1e-3), &Silent).unwrap();
    assert!(fine.points.len() > coarse.points.len() && fine.vertical_m <= 1e-3);
    for (k, h) in fine.points.height_m.iter().enumerate() {
        let distance = fine.points.x_m[k].hypot(fine.points.y_m[k]);
        let off = distance.hypot(h - 0.03) - 0.05;
        assert!(off.abs() < 1e-12, "{off}");
    }
    assert!(
        adaptive(&probe, to(0.0), &Silent).is_err()
            && adaptive(&probe, to(f64::NAN), &Silent).is_err()
    );
}

#[test]
fn blue_noise_keeps_its_spacing_and_covers() {
    let surface = shape("half_sphere");
    let probe = Probe::new(&surface, &seed_region());
    let spacing_m = 3e-3;
    let found = poisson(&probe, spacing_m, 7, &Silent).unwrap();
    let points = &found.points;
    assert!(points.len() > 400, "{}", points.len());
    for i in 0..points.len() {
        for j in 0..i {
            let apart = (points.x_m[i] - points.x_m[j]).hypot(points.y_m[i] - points.y_m[j]);
            assert!(apart >= spacing_m, "{apart}");
        }
    }
    assert!(found.cover_m < 1.5 * spacing_m, "{}", found.cover_m);
    let sum: f64 = points.weight_m2.iter().sum();
    assert!((sum / (PI * 0.0025) - 1.0).abs() < 0.01, "{sum}");
    // The seed decides, and nothing else.
    assert_eq!(poisson(&probe, spacing_m, 7, &Silent).unwrap(), found);
    assert_ne!(
        poisson(&probe, spacing_m, 8, &Silent).unwrap().points.x_m,
        points.x_m
    );
}

/// A body that fills the region: what is counted at the places adds up to all of it.
#[test]
fn blue_noises_areas_add_up_to_the_bodys() {
    let surface = shape("flat");
    for (width_m, spacing_m) in [(0.06, 7e-3), (0.1, 4.1e-3)] {
        let region = grid((-0.05, -0.05 + width_m, 3), (-0.04, 0.03, 3));
        let found = poisson(&Probe::new(&surface, &region), spacing_m, 3, &Silent).unwrap();
        let sum: f64 = found.points.weight_m2.iter().sum();
        assert!((sum / (0.07 * width_m) - 1.0).abs() < 1e-12, "{sum}");
    }
}

/// Cells that were counted whole left the areas 5 % off (rms), 16 % at most.
#[test]
fn blue_noises_weights_are_the_areas_nearest_to_each_point() {
    let surface = shape("flat");
    let region = grid((-0.05, 0.01, 3), (-0.04, 0.03, 3));
    let found = poisson(&Probe::new(&surface, &region), 5e-3, 3, &Silent).unwrap();
    let points = &found.points;
    let step_m = 1e-4;
    let mut area_m2 = vec![0.0; points.len()];
    for k in 0..600 * 700 {
        let [x, y] = [k % 600, k / 600].map(|n| (n as f64 + 0.5) * step_m);
        let apart = |p: &usize| (points.x_m[*p] - x + 0.05).hypot(points.y_m[*p] - y + 0.04);
        let nearest = (0..points.len()).min_by(|p, q| apart(p).total_cmp(&apart(q)));
        area_m2[nearest.unwrap()] += step_m * step_m;
    }
    let off = points
        .weight_m2
        .iter()
        .zip(&area_m2)
        .map(|(weight, area)| weight / area - 1.0);
    let squares: f64 = off.map(|off| off * off).sum();
    let rms = (squares / points.len() as f64).sqrt();
    assert!(rms < 0.012, "{rms}");
}

/// Darts seldom hit what is narrow; what lay far from all of them was not counted.
#[test]
fn blue_noise_leaves_no_part_of_a_narrow_strip_out() {
    // A strip of 4 um, far from the sides of the cells over which areas are counted.
    let spacing_m = 3e-3;
    let y = (70.0 + 0.5) * 0.1 / 136.0 - 0.05;
    let corner = |x: f64, k: f64| [x, y + k * 2e-6, 0.03];
    let [a, b, c, d] = [
        corner(-0.06, -1.0),
        corner(0.06, -1.0),
        corner(0.06, 1.0),
        corner(-0.06, 1.0),
    ];
    let surface = Surface::Mesh(exact(vec![[a, b, c], [a, c, d]]));
    let probe = Probe::new(&surface, &seed_region());
    let found = poisson(&probe, spacing_m, 7, &Silent).unwrap();
    let points = &found.points;
    // A cell's diagonal beyond the spacing.
    let most_m = (1.0 + 0.125_f64.sqrt()) * spacing_m;
    assert!(found.cover_m < most_m, "{}", found.cover_m);
    for k in 0..=1000 {
        let x = 1e-4 * f64::from(k) - 0.05;
        let near = points.x_m.iter().map(|p| (p - x).abs());
        let least = near.fold(f64::INFINITY, f64::min);
        assert!(least < spacing_m * 1.25, "{x}: {least}");
    }
    let mut sorted = points.x_m.clone();
    sorted.sort_by(f64::total_cmp);
    assert!(sorted.windows(2).all(|p| p[1] - p[0] > 0.999 * spacing_m));
    let sum: f64 = points.weight_m2.iter().sum();
    assert!((sum / (0.1 * 4e-6) - 1.0).abs() < 1e-9, "{sum}");
}

/// A formula was looked for at 25 places of a rectangle, between which small ones lay.
#[test]
fn a_small_formula_is_found_in_a_wide_region() {
    let at = |primitive, about_z| {
        let placement = Placement {
            translate_m: [0.0171, -0.0233, 0.0],
            rotate_deg: [0.0, 0.0, about_z],
            ..Placement::default()
        };
        let placed = PlacedPrimitive::new(primitive, &placement).unwrap();
        let surface = Surface::Primitive(placed);
        let probe = Probe::new(&surface, &seed_region());
        let found = adaptive(&probe, to(1e-4), &Silent).unwrap();
        found.points.weight_m2.iter().sum::<f64>()
    };
    let ball = Primitive::HalfSphere {
        radius_m: 0.0013,
        base_m: 0.03,
    };
    let plate = Primitive::Flat {
        side_m: 0.0019,
        height_m: 0.03,
    };
    for (area_m2, expected) in [
        (at(ball, 0.0), PI * 0.0013 * 0.0013),
        (at(plate, 0.0), 0.0019 * 0.0019),
        (at(plate, 31.0), 0.0019 * 0.0019),
    ] {
        assert!(
            (area_m2 / expected - 1.0).abs() < 0.1,
            "{area_m2} {expected}"
        );
    }
}

#[test]
fn a_grids_marks_agree_with_its_heights() {
    let axis = AxisRequest::Given(Axis {
        from: -0.05,
        to: 0.05,
        samples: 41,
    });
    let document = ShapeDocument {
        force: Default::default(),
        name: "turned".into(),
        source: SurfaceSource::File {
            path: root().join("shapes/half_cylinder.stl"),
            unit_m: Some(0.001),
        },
        bodies: BodyOptions::default(),
        scale: [1.0; 3],
        placement: Placement {
            translate_m: [0.0, 0.0, 0.06],
            rotate_deg: [7.0, 20.0, 33.0],
            ..Placement::default()
        },
        grid: GridRequest { x: axis, y: axis },
        weights: None,
        direction_jnd_deg: fluxform_base::units::DIRECTION_JND_DEG,
        grid_is_given: true,
    };
    let settings = Settings {
        marks: true,
        ..Settings::default()
    };
    let found = discretize_with(&document, &settings, &Silent).unwrap();
    let (surface, _) = Surface::open(&document, &Silent).unwrap();
    let probe = Probe::new(&surface, &found.points.grid);
    for k in 0..found.points.len() {
        let (sample, marks) = probe
            .at([found.points.x_m[k], found.points.y_m[k]])
            .unwrap();
        assert_eq!(
            sample.height_m.to_bits(),
            found.points.height_m[k].to_bits()
        );
        assert_eq!(
            (sample.normal, marks),
            (found.points.normal[k], found.points.marks[k])
        );
        assert!(!marks.overhang && marks.layers == 2, "{marks:?}");
    }
}
