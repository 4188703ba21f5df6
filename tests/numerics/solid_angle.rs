//! Turns of a closed surface about places inside, outside and on it.

use fluxform_numerics::solid_angle::turns_about;

#[test]
fn an_octahedron_is_one_sphere_inside_and_none_outside() {
    let axis = |k: usize, sign: f64| {
        let mut corner = [0.0; 3];
        corner[k] = sign * [0.7, 1.3, 0.9][k];
        corner
    };
    let mut triangles = Vec::new();
    for k in 0..8 {
        let sign = |bit: usize| if k >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let mut triangle = [0, 1, 2].map(|axis_of| axis(axis_of, sign(axis_of)));
        if sign(0) * sign(1) * sign(2) < 0.0 {
            triangle.swap(1, 2);
        }
        triangles.push(triangle);
    }
    let turns = |at| turns_about(triangles.iter().copied(), at);
    assert!((turns([0.1, -0.2, 0.3]) - 1.0).abs() < 1e-14);
    assert!(turns([0.5, 0.7, 0.3]).abs() < 1e-14);
    // From an eighth's middle of the surface itself half a sphere.
    let on = triangles[0];
    let middle = [0, 1, 2].map(|k| (on[0][k] + on[1][k] + on[2][k]) / 3.0);
    assert!((turns_about(triangles[1..].iter().copied(), middle) - 0.5).abs() < 1e-14);
}
