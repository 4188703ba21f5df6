//! Laplace's equation in a box, against a source outside of it.

use fluxform_numerics::laplace::Laplace;
use fluxform_numerics::spectral::Spectral;

#[test]
fn the_faces_of_a_harmonic_function_give_its_inside() {
    let point = [0.31, -0.22, -0.7];
    let f = |x: f64, y: f64, z: f64| {
        1.0 / ((x - point[0]).powi(2) + (y - point[1]).powi(2) + (z - point[2]).powi(2)).sqrt()
    };
    let mut errors = Vec::new();
    for tolerance in [1e-3, 1e-6, 1e-9] {
        let strip =
            |from, to| Spectral::strip(from, to, Spectral::strip_nodes(from, to, 0.7, tolerance));
        let (x, y) = (strip(-1.0, 1.3), strip(-0.9, 0.4));
        let z = Spectral::rising(0.0, 1.9, point[2], {
            Spectral::rising_nodes(0.0, 1.9, point[2], tolerance)
        });
        let mut exact = Vec::new();
        for z in &z.nodes {
            for y in &y.nodes {
                exact.extend(x.nodes.iter().map(|x| f(*x, *y, *z)));
            }
        }
        let (nx, ny, nz) = (x.len(), y.len(), z.len());
        let mut u = exact.clone();
        for (place, value) in u.iter_mut().enumerate() {
            let (i, j, k) = (place % nx, place / nx % ny, place / (nx * ny));
            let ends = |at: usize, n: usize| at == 0 || at + 1 == n;
            if !(ends(i, nx) || ends(j, ny) || ends(k, nz)) {
                *value = f64::NAN;
            }
        }
        Laplace::new(&x, &y, &z).fill(&mut u);
        let worst = (u.iter().zip(&exact))
            .map(|(u, e)| (u / e - 1.0).abs())
            .fold(
                0.0,
                |a, b| if b.is_nan() { f64::INFINITY } else { a.max(b) },
            );
        assert!(worst < tolerance, "{tolerance:e}: {worst:e}");
        errors.push(worst);
    }
    assert!(errors[2] < 1e-4 * errors[0], "spectral: {errors:?}");
}

#[test]
fn a_box_without_inside_is_left_alone() {
    let flat = Spectral::strip(0.7, 0.7, (0.0, 1));
    let wide = Spectral::strip(-1.0, 1.3, (0.7, 5));
    let mut u = vec![1.3; 25];
    Laplace::new(&wide, &wide, &flat).fill(&mut u);
    assert_eq!(u, vec![1.3; 25]);
}
