//! Closed bodies from surface files: what is put right, and where a surface is none of a body.

use std::path::Path;

use fluxform_shape::ShapeError;
use fluxform_shape::closed_body::{BodyRequest, ClosedBodies};
use fluxform_testing::boxes::block;

type Triangle = [[f64; 3]; 3];

fn obj(triangles: &[Triangle]) -> Vec<u8> {
    let mut text = String::new();
    for [x, y, z] in triangles.as_flattened() {
        text += &format!("v {x} {y} {z}\n");
    }
    for k in 0..triangles.len() {
        text += &format!("f {} {} {}\n", 3 * k + 1, 3 * k + 2, 3 * k + 3);
    }
    text.into_bytes()
}

fn request(path: &str) -> BodyRequest<'_> {
    BodyRequest {
        path: Path::new(path),
        unit_m: Some(1e-3),
        rotate_deg: [0.0; 3],
        translate_m: [0.0; 3],
        most_facets: 1000,
    }
}

fn read(triangles: &[Triangle]) -> Result<ClosedBodies, ShapeError> {
    ClosedBodies::read(&obj(triangles), &request("part.obj"))
}

fn refused(triangles: &[Triangle]) -> String {
    read(triangles).unwrap_err().to_string()
}

/// Signed, mm^3.
fn volume(bodies: &ClosedBodies, body: usize) -> f64 {
    let six = |facet: &[u32; 3]| {
        let [a, b, c] = facet.map(|k| bodies.vertices_m[k as usize].map(|x| 1e3 * x));
        a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    bodies.bodies[body].iter().map(six).sum::<f64>() / 6.0
}

const LOW: [f64; 3] = [1.0, 2.0, 3.0];
const HIGH: [f64; 3] = [4.0, 4.5, 10.0];
const VOLUME: f64 = 3.0 * 2.5 * 7.0;

fn turned(mut triangles: Vec<Triangle>) -> Vec<Triangle> {
    for triangle in &mut triangles {
        triangle.swap(1, 2);
    }
    triangles
}

#[test]
fn facets_look_outwards_however_they_were_written() {
    let good = block(LOW, HIGH);
    let mut mixed = good.clone();
    mixed[3].swap(0, 1);
    mixed[7].swap(1, 2);
    for (triangles, warning) in [
        (good.clone(), ""),
        (turned(good), "looked into the body"),
        (mixed, "2 facets looked the other way"),
    ] {
        let bodies = read(&triangles).unwrap();
        assert!((volume(&bodies, 0) - VOLUME).abs() < 1e-9);
        let said = bodies.warnings.join("; ");
        assert!(
            said.contains(warning) && said.is_empty() == warning.is_empty(),
            "{said}"
        );
    }
}

#[test]
fn it_is_turned_and_moved_as_other_bodies_are() {
    let place = BodyRequest {
        rotate_deg: [0.0, 0.0, 90.0],
        translate_m: [0.1, 0.0, 0.0],
        unit_m: Some(0.01),
        ..request("part.obj")
    };
    let bodies = ClosedBodies::read(&obj(&block(LOW, HIGH)), &place).unwrap();
    let least = |k: usize| {
        bodies
            .vertices_m
            .iter()
            .fold(f64::INFINITY, |m, v| m.min(v[k]))
    };
    // x, y goes to -y, x.
    assert!((least(0) - 0.055).abs() < 1e-15 && (least(1) - 0.01).abs() < 1e-15);
}

#[test]
fn cavities_belong_to_their_body_and_parts_are_bodies() {
    let mut triangles = block([0.0; 3], [9.0; 3]);
    triangles.extend(block([2.0; 3], [7.0; 3]));
    triangles.extend(turned(block([3.0; 3], [4.0; 3])));
    triangles.extend(block([11.0; 3], [12.0; 3]));
    let bodies = read(&triangles).unwrap();
    let volumes: Vec<f64> = (0..3).map(|k| volume(&bodies, k)).collect();
    assert_eq!(bodies.bodies.len(), 3);
    for (found, exact) in volumes.iter().zip([729.0 - 125.0, 1.0, 1.0]) {
        assert!((found - exact).abs() < 1e-9, "{volumes:?}");
    }
}

/// What programs write twice is one, and a wall between blocks that touch goes.
#[test]
fn doubled_facets_are_one_and_walls_go() {
    let mut twice = block(LOW, HIGH);
    twice.push(twice[5]);
    twice.push([LOW, LOW, HIGH]);
    let bodies = read(&twice).unwrap();
    assert!((volume(&bodies, 0) - VOLUME).abs() < 1e-9);
    let said = bodies.warnings.join("; ");
    assert!(said.contains("1 facets without area") && said.contains("1 facets that lie on others"));

    let mut touching = block([0.0; 3], [1.0, 2.0, 3.0]);
    let wall = |triangle: &Triangle, x: f64| triangle.iter().all(|corner| corner[0] == x);
    // The second block's wall has the same corners, seen from the other side.
    let mirrored = touching.iter().map(|t| t.map(|[x, y, z]| [2.0 - x, y, z]));
    let mirrored = turned(mirrored.collect());
    assert!(mirrored.iter().any(|t| wall(t, 1.0)));
    touching.extend(mirrored);
    let bodies = read(&touching).unwrap();
    assert_eq!((bodies.bodies.len(), bodies.bodies[0].len()), (1, 20));
    assert!((volume(&bodies, 0) - 12.0).abs() < 1e-9);
    let mut sheet = block(LOW, HIGH);
    sheet.extend(turned(sheet.clone()));
    assert!(refused(&sheet).contains("a sheet without thickness"));
}

#[test]
fn a_surface_that_bounds_no_body_is_refused_with_its_place() {
    let mut open = block(LOW, HIGH);
    let gone = open.remove(4);
    let said = refused(&open);
    assert!(
        said.starts_with("part.obj: the mesh is open: 3 edges"),
        "{said}"
    );
    let corner = gone.map(|[x, y, z]| format!("({x}, {y}, {z}) mm"));
    assert!(
        corner
            .iter()
            .filter(|corner| said.contains(*corner))
            .count()
            == 2,
        "{said}"
    );

    let mut through = block(LOW, HIGH);
    through.extend(block([2.0, 3.0, 9.0], [3.0, 4.0, 11.0]));
    let said = refused(&through);
    assert!(
        said.contains("pass through each other") && said.contains(") mm: unite"),
        "{said}"
    );

    let mut along = block([0.0; 3], [1.0; 3]);
    along.extend(block([1.0, 1.0, 0.0], [2.0, 2.0, 1.0]));
    let said = refused(&along);
    assert!(
        said.contains("1 edges have more than two facets") && said.contains("(1, 1, "),
        "{said}"
    );

    // One facet bounds nothing.
    let flat = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]; 1];
    assert!(refused(&flat).contains("the mesh is open"));
    assert!(refused(&[[[0.0; 3]; 3]]).contains("no facet with an area"));
    let said = refused(&[flat[0]; 1001]);
    assert!(
        said.contains("1001 facets, at most 1000") && said.contains("coarser"),
        "{said}"
    );
}

#[test]
fn the_file_itself_may_be_at_fault() {
    let said = |bytes: &[u8], request: &BodyRequest<'_>| {
        ClosedBodies::read(bytes, request).unwrap_err().to_string()
    };
    let good = obj(&block(LOW, HIGH));
    let no_unit = BodyRequest {
        unit_m: None,
        ..request("part.obj")
    };
    assert!(said(&good, &no_unit).contains("carry no unit; state it"));
    assert!(said(&[], &request("part.stl")).contains("empty"));
    assert!(said(&good, &request("part.stl")).contains("part.stl"));
    let far = obj(&block([0.0; 3], [1e9, 1.0, 1.0]));
    assert!(said(&far, &request("part.obj")).contains("its unit is wrong"));
}
