//! The deviation of patches against dense sampling and known surfaces.

use super::*;
use crate::document::Placement;
use crate::file_mesh::{FileMesh, Triangle};
use crate::placement::Transform;
use fluxform_base::progress::Silent;
use fluxform_numerics::random::Random;

fn placed(triangles: Vec<Triangle>) -> Mesh {
    let file = FileMesh {
        triangles,
        ..FileMesh::default()
    };
    Mesh::place(file, &Transform::new(1.0, &Placement::default())).unwrap()
}

fn grid(samples: [usize; 2]) -> Grid {
    let [x_m, y_m] = samples.map(|samples| Axis {
        from: -0.013,
        to: 0.017,
        samples,
    });
    Grid { x_m, y_m }
}

/// A triangle over the whole grid, tilted.
fn sheet(k: usize) -> Triangle {
    let t = k as f64;
    [
        [-0.07, -0.07, 0.010 + 1e-3 * (0.7 * t).sin()],
        [0.13, -0.07, 0.011 + 1e-3 * (1.3 * t).sin()],
        [-0.03, 0.13, 0.012 + 1e-3 * (1.7 * t).sin()],
    ]
}

/// A closed cone: a fan of `count` facets over another that is its floor.
fn cone(count: usize) -> Mesh {
    let rim = |k: usize| {
        let t = std::f64::consts::TAU * (k % count) as f64 / count as f64;
        [0.03 * t.cos(), 0.03 * t.sin(), 1e-3]
    };
    let facets = (0..count).flat_map(|k| {
        let apex = |z| [1.7e-4, -2.3e-4, z];
        let [a, b] = [rim(k), rim(k + 1)];
        [[apex(0.031), a, b], [apex(1e-3), b, a]]
    });
    placed(facets.collect())
}

/// The largest differences over the cells, and the looks that they took.
fn looks_of(mesh: &Mesh, grid: &Grid) -> (Vertical, i64) {
    let known = heights(mesh, grid, &Silent).unwrap();
    let known: Vec<Option<f64>> = known.iter().map(|s| s.map(|s| s.height_m)).collect();
    let effort = Looks::endless();
    let faces = Faces::new(mesh, grid, Arc::clone(&effort));
    let lattice = Lattice::new(&faces, grid, &known);
    let worst = vertical(mesh, grid, &lattice, &Silent).unwrap();
    (worst, i64::MAX - effort.left.load(Ordering::Relaxed))
}

/// The cell under the apex was quartered until no two slivers were left together.
#[test]
fn the_work_of_a_fan_grows_no_faster_than_its_facets() {
    let [few, many] = [500, 8000].map(|count| looks_of(&cone(count), &grid([31, 41])));
    assert!(many.1 < 20 * few.1, "{} {}", few.1, many.1);
    // The floor is hidden, and the finer cone is the rounder.
    let [few, many] = [few.0, many.0].map(|worst| (worst.above.value_m, worst.below.value_m));
    assert!((few.0 - many.0).abs() < 1e-7, "{few:?} {many:?}");
    assert!(few.1 < 1e-3 && many.1 < 1e-3, "{few:?} {many:?}");
}

/// Sheets through each other took minutes; now the answer is that there is none.
#[test]
fn a_spent_effort_is_reported_with_any_number_of_threads() {
    let mesh = placed((0..3000).map(sheet).collect());
    let grid = grid([11, 9]);
    let known = heights(&mesh, &grid, &Silent).unwrap();
    let known: Vec<Option<f64>> = known.iter().map(|s| s.map(|s| s.height_m)).collect();
    let run = |looks: i64, threads: usize| {
        let effort = Looks::new(looks);
        let faces = Faces::new(&mesh, &grid, Arc::clone(&effort));
        let lattice = Lattice::new(&faces, &grid, &known);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let all = || vertical(&mesh, &grid, &lattice, &Silent).unwrap();
        pool.build().unwrap().install(all);
        (
            effort.is_spent(),
            looks - effort.left.load(Ordering::Relaxed),
        )
    };
    let (spent, whole) = run(1 << 40, 3);
    assert!(!spent);
    for threads in [1, 4] {
        assert_eq!(run(whole, threads), (false, whole));
        assert!(run(whole - 1, threads).0);
        let (spent, looks) = run(100_000, threads);
        assert!(spent && looks < whole / 2, "{looks} {whole}");
    }
}

/// The lists of a million such triangles on this grid would have taken 40 GB.
#[test]
fn sheets_over_the_whole_grid_share_their_lists() {
    let faces = placed((0..70_000).map(sheet).collect());
    let grid = grid([61, 51]);
    let faces = Faces::new(&faces, &grid, Looks::of_seconds(CERTIFY_SECONDS));
    let heights = vec![None; grid.len()];
    let lattice = Lattice::new(&faces, &grid, &heights);
    let side = lattice.block;
    let first = |cell: &usize| (cell % 60).is_multiple_of(side) && (cell / 60).is_multiple_of(side);
    let blocks = (0..lattice.len()).filter(first);
    let held: usize = blocks.map(|cell| lattice.around(cell).len()).sum();
    assert!(side > 1 && held <= MOST_EACH * faces.list.len(), "{held}");
    assert_eq!(lattice.members(1307).len(), faces.list.len());
}

#[test]
fn blocks_of_any_size_give_the_same_faces_and_the_same_bounds() {
    let bump = |k: usize| {
        let [x, y] = [0.7, 1.3].map(|c| -0.015 + 0.033 * (c * k as f64).fract());
        let z = 0.01 + 0.004 * (1.1 * k as f64).sin();
        [
            [x, y, z],
            [x + 0.004, y, z - 7e-4],
            [x, y + 0.003, z + 1.3e-3],
        ]
    };
    let mesh = placed((0..40).map(bump).chain((0..3).map(sheet)).collect());
    let grid = grid([11, 8]);
    let faces = Faces::new(&mesh, &grid, Looks::of_seconds(CERTIFY_SECONDS));
    let known = heights(&mesh, &grid, &Silent).unwrap();
    let known: Vec<Option<f64>> = known.iter().map(|s| s.map(|s| s.height_m)).collect();
    let fine = Lattice::new(&faces, &grid, &known);
    let reported = |lattice: &Lattice| {
        let worst = vertical(&mesh, &grid, lattice, &Silent).unwrap();
        (worst, vertical_by_cell(lattice, &Silent).unwrap())
    };
    let mut sides = Vec::new();
    for most in [300, 150, 100, 1] {
        let coarse = Lattice::within(most, &faces, &grid, &known);
        for cell in 0..fine.len() {
            assert_eq!(coarse.members(cell), fine.members(cell), "{most}: {cell}");
        }
        assert_eq!(reported(&coarse), reported(&fine));
        sides.push(coarse.block);
    }
    assert_eq!(fine.block, 1);
    assert!(
        sides.is_sorted() && sides[0] > 1 && sides[3] >= 10,
        "{sides:?}"
    );
}

#[test]
fn a_grid_without_cells_has_no_faces() {
    let mesh = placed((0..3).map(sheet).collect());
    for samples in [[1, 7], [7, 1], [1, 1]] {
        let grid = grid(samples);
        let faces = Faces::new(&mesh, &grid, Looks::of_seconds(CERTIFY_SECONDS));
        let known = vec![Some(0.01); grid.len()];
        let lattice = Lattice::new(&faces, &grid, &known);
        assert_eq!(lattice.len(), 0);
        assert_eq!(vertical_by_cell(&lattice, &Silent).unwrap(), []);
    }
}

/// Where its nodes are a grid's within rounding, a lower sheet was seen through the same sheet above it.
#[test]
fn a_thick_sheet_hides_its_underside() {
    const CELLS: usize = 60;
    let mut random = Random::new(1);
    let at = |k: usize| -40.0 + (80.0 * k as f64 / CELLS as f64 * 1e7).round() * 1e-7;
    let corner = |i: usize, j: usize, depth: f64| {
        let (x, y) = (at(i), at(j));
        [
            x,
            y,
            40.0 - depth + 6.0 * (x / 17.0).cos() * (y / 13.0).sin(),
        ]
        .map(|mm| mm * 1e-3)
    };
    let mut triangles = Vec::new();
    for (j, i) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (j, i))) {
        let rising = random.between(0.0, 1.0) < 0.5;
        for depth in [0.0, 20.0] {
            let at = |di, dj| corner(i + di, j + dj, depth);
            triangles.extend(if rising {
                [
                    [at(0, 0), at(1, 0), at(1, 1)],
                    [at(0, 0), at(1, 1), at(0, 1)],
                ]
            } else {
                [
                    [at(0, 0), at(1, 0), at(0, 1)],
                    [at(1, 0), at(1, 1), at(0, 1)],
                ]
            });
        }
    }
    let mesh = placed(triangles);
    for samples in [61, 121] {
        let axis = Axis {
            from: -0.04,
            to: 0.04,
            samples,
        };
        let grid = Grid {
            x_m: axis,
            y_m: axis,
        };
        let (worst, _) = looks_of(&mesh, &grid);
        let most_m = worst.above.value_m.max(worst.below.value_m);
        assert!(most_m < 1e-3, "{samples}: {worst:?}");
    }
}

/// A wall that the file's rounding makes lean left its underside open to view.
#[test]
fn nothing_is_seen_through_a_wall_that_leans_by_the_files_rounding() {
    let rounding = 4e-9;
    let square = |x: [f64; 2], z: f64| {
        let at = |x, y| [x, y, z];
        let [a, b, c, d] = [
            at(x[0], -0.05),
            at(x[1], -0.05),
            at(x[1], 0.05),
            at(x[0], 0.05),
        ];
        [[a, b, c], [a, c, d]]
    };
    let step = 0.0004;
    let [low, high] = [step - 3e-9, step + 2e-9];
    let wall = |y| [[low, y, 0.02], [high, y, 0.022]];
    let ([a, b], [c, d]) = (wall(-0.05), wall(0.05));
    let triangles = [
        square([-0.05, low], 0.02),
        square([high, 0.05], 0.022),
        square([-0.05, 0.05], 0.0),
        [[a, c, b], [b, c, d]],
    ];
    let file = FileMesh {
        triangles: triangles.concat(),
        coordinate_rounding: rounding,
        ..FileMesh::default()
    };
    let mesh = Mesh::place(file, &Transform::new(1.0, &Placement::default())).unwrap();
    let (worst, _) = looks_of(&mesh, &grid([31, 41]));
    let most_m = worst.above.value_m.max(worst.below.value_m);
    assert!((1e-3..2e-3).contains(&most_m), "{worst:?}");
}
