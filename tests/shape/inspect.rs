//! Report on a surface's file before it is placed.

use fluxform_shape::document::{Placement, SurfaceFormat};
use fluxform_shape::file_mesh::{FileMesh, Triangle};
use fluxform_shape::hidden::Hidden;
use fluxform_shape::mesh::Mesh;
use fluxform_shape::placement::Transform;
use fluxform_shape::{MeshReport, Surface};

use fluxform_testing::boxes::block;

fn report(triangles: Vec<Triangle>) -> MeshReport {
    let file = FileMesh {
        triangles,
        coordinate_rounding: 1e-6,
        ..FileMesh::default()
    };
    MeshReport::new(SurfaceFormat::Stl, file)
}

#[test]
fn a_plain_body_has_no_fault() {
    let found = report(block([-0.7, 1.3, 2.9], [4.1, 3.7, 5.3]));
    assert!(found.watertight && found.warnings.is_empty(), "{found:?}");
    assert_eq!((found.bodies, found.euler, found.layers), (1, 2, Some(2)));
    assert_eq!(found.self_intersections, 0);
    let volume = 4.8 * 2.4 * 2.4;
    assert!((found.volume.unwrap() - volume).abs() < 1e-12 * volume);
}

#[test]
fn bodies_in_one_another_are_counted_and_cross_where_they_do() {
    let outer = block([0.0; 3], [7.0; 3]);
    let apart = [outer.clone(), block([9.1; 3], [11.3; 3])].concat();
    let found = report(apart);
    assert_eq!((found.bodies, found.euler), (2, 4));
    assert_eq!((found.self_intersections, found.layers), (0, Some(2)));

    let inside = [outer.clone(), block([2.3; 3], [4.9; 3])].concat();
    let found = report(inside);
    assert_eq!((found.self_intersections, found.layers), (0, Some(4)));

    let through = [outer.clone(), block([2.3, 2.9, 3.1], [11.3, 4.9, 5.3])].concat();
    let found = report(through);
    assert!(found.self_intersections > 0 && found.self_intersections_complete);
    let [first, second] = found.self_intersection_first.unwrap();
    assert!(first < 12 && second >= 12, "{first} {second}");

    // Two blocks that touch along a face share its plane, not its inside.
    let beside = [outer.clone(), block([7.0, 0.0, 0.0], [9.1, 7.0, 7.0])].concat();
    let found = report(beside);
    assert!(
        found.duplicate > 0 || found.self_intersections > 0,
        "{found:?}"
    );
    // A smaller block standing on the top lies on it.
    let upon = [outer, block([2.3, 2.9, 7.0], [3.1, 4.9, 8.3])].concat();
    assert!(report(upon).self_intersections > 0);
}

#[test]
fn triangles_that_only_meet_do_not_cross() {
    // A corner on a face, an edge along a face's edge, a corner that ends on an edge.
    let base = [[0.0, 0.0, 0.0], [7.0, 0.0, 0.0], [0.0, 7.0, 0.0]];
    let meets = [
        [[1.3, 1.7, 0.0], [2.3, 1.9, 3.1], [1.1, 2.9, 4.7]],
        [[1.3, 0.0, 0.0], [5.3, 0.0, 0.0], [3.1, -2.9, 1.7]],
        [[0.0, 3.1, 0.0], [-2.3, 1.9, 0.0], [-1.1, 5.3, 0.0]],
        [[0.0, 7.0, 0.0], [-2.3, 8.9, 0.7], [-1.1, 9.3, 0.9]],
        [[7.0, 0.0, 0.0], [0.0, 7.0, 0.0], [7.0, 7.0, 0.0]],
    ];
    for other in meets {
        assert_eq!(report(vec![base, other]).self_intersections, 0, "{other:?}");
    }
    let crosses = [
        [[1.3, 1.7, -0.9], [2.3, 1.9, 3.1], [1.1, 2.9, 4.7]],
        // In the same plane, partly over each other.
        [[1.3, 1.7, 0.0], [9.3, 1.9, 0.0], [1.1, 9.9, 0.0]],
        // Folded back over its neighbour.
        [[7.0, 0.0, 0.0], [0.0, 7.0, 0.0], [0.9, 0.7, 0.0]],
    ];
    for other in crosses {
        assert_eq!(report(vec![base, other]).self_intersections, 1, "{other:?}");
    }
}

#[test]
fn a_unit_is_guessed_by_size_and_never_where_the_file_has_one() {
    let guesses = |size: f64| -> Vec<&'static str> {
        let found = report(block([0.0; 3], [size; 3]));
        found.unit_guesses.iter().map(|guess| guess.unit).collect()
    };
    assert_eq!(guesses(73.0), ["mm"]);
    assert_eq!(guesses(0.073), ["m"]);
    assert_eq!(guesses(2.9), ["in", "cm"]);
    assert!(guesses(7e4).is_empty());
}

/// A plain cube of 10 mm whose walls lean by less than its file's rounding had four undercut walls.
#[test]
fn walls_that_lean_within_the_files_rounding_hide_nothing() {
    let hidden = |inset: f64| {
        let mut triangles = block([-5.0, -5.0, 0.0], [5.0, 5.0, 10.0]);
        for corner in triangles.as_flattened_mut() {
            if corner[2] > 5.0 {
                let [x, y, _] = corner;
                (*x, *y) = (*x - x.signum() * inset, *y - y.signum() * inset);
            }
        }
        let file = FileMesh {
            triangles,
            coordinate_rounding: 5e-5,
            ..FileMesh::default()
        };
        let placed = Transform::new(1e-3, &Placement::default());
        let mesh = Mesh::place(file, &placed).unwrap();
        Hidden::of(&Surface::Mesh(mesh)).unwrap()
    };
    for inset in [0.0, 4e-5, -4e-5] {
        let found = hidden(inset);
        let off = found.of_area - 1.0 / 6.0;
        assert!(
            found.of_upward == Some(0.0) && off.abs() < 0.01,
            "{inset}: {found:?}"
        );
    }
}
