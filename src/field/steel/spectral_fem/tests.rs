//! Harmonic, Bessel and manufactured solutions, Taylor test of the tangent, convergence with the degree.

use super::*;
use crate::steel::permeability::Froehlich;

const R_M: f64 = 0.7;
const Z_M: (f64, f64) = (-0.9, 1.3);

fn mesh(degree: usize) -> Interior {
    Interior::new(&[0.0, 0.5, R_M], &[Z_M.0, -0.2, 0.6, Z_M.1], degree).expect("a good mesh")
}

fn on_boundary(mesh: &Interior, all: &DVector<f64>) -> DVector<f64> {
    DVector::from_iterator(
        mesh.boundary().len(),
        mesh.boundary().iter().map(|&k| all[k]),
    )
}

fn nodal(mesh: &Interior, f: impl Fn(f64, f64) -> f64) -> DVector<f64> {
    DVector::from_iterator(
        mesh.node_count(),
        mesh.nodes_m().into_iter().map(|(r, z)| f(r, z)),
    )
}

/// Modified Bessel functions I0 and I1 by their series.
fn bessel_i(x: f64) -> (f64, f64) {
    let q = 0.25 * x * x;
    let (mut term, mut i0, mut i1) = (1.0, 0.0, 0.0);
    for k in 1..60 {
        i0 += term;
        i1 += term / f64::from(k);
        term *= q / f64::from(k * k);
    }
    (i0, 0.5 * x * i1)
}

#[test]
fn harmonic_functions_have_their_flux() {
    // For a polynomial of the elements' degree all is exact: the flux of u against w = z.
    let mesh = mesh(4);
    let schur = mesh.laplace_schur_m();
    let z = on_boundary(&mesh, &nodal(&mesh, |_, z| z));
    let u = on_boundary(&mesh, &nodal(&mesh, |r, z| r * r - 2.0 * z * z + 0.3 * z));
    // int grad u . grad z dV = int (-4 z + 0.3) dV
    let area = std::f64::consts::PI * R_M * R_M;
    let exact = area * (-2.0 * (Z_M.1 * Z_M.1 - Z_M.0 * Z_M.0) + 0.3 * (Z_M.1 - Z_M.0));
    assert!((z.dot(&(schur * &u)) / exact - 1.0).abs() < 1e-12);
    let ones = DVector::repeat(z.len(), 1.0);
    assert!((schur * ones).amax() < 1e-12 * schur.amax());
    assert!((schur - schur.transpose()).amax() < 1e-13 * schur.amax());
    // A point's flux is its share of the surface times the normal derivative: tested by w = 1
    // on the top face, r^2 below. The top's flux of z is its area.
    let flux = schur * &z;
    let top: f64 = (0..mesh.boundary().len())
        .filter(|&k| z[k] == Z_M.1)
        .map(|k| flux[k])
        .sum();
    assert!((top / area - 1.0).abs() < 1e-12);
}

#[test]
fn bessel_functions_converge_with_the_degree() {
    let k = 2.3;
    let f = |r: f64, z: f64| bessel_i(k * r).0 * (k * z + 0.4).cos();
    // Green: int |grad u|^2 dV = int u d_n u dS, in closed form but for the faces' r integral.
    let mut exact = 0.0;
    let rule = gauss::rule(40);
    for (x, w) in rule.nodes.iter().zip(&rule.weights) {
        let z = 0.5 * (Z_M.1 + Z_M.0) + 0.5 * (Z_M.1 - Z_M.0) * x;
        let cos = (k * z + 0.4).cos();
        let (i0, i1) = bessel_i(k * R_M);
        exact += 0.5 * (Z_M.1 - Z_M.0) * w * TAU * R_M * k * i0 * i1 * cos * cos;
        let r = 0.5 * R_M * (1.0 + x);
        let faces = |z: f64| -0.5 * k * (2.0 * (k * z + 0.4)).sin();
        let i0 = bessel_i(k * r).0;
        exact += 0.5 * R_M * w * TAU * r * i0 * i0 * (faces(Z_M.1) - faces(Z_M.0));
    }
    let mut errors = Vec::new();
    for degree in [2, 4, 6, 8] {
        let mesh = mesh(degree);
        let all = nodal(&mesh, f);
        let u = on_boundary(&mesh, &all);
        let energy = u.dot(&(mesh.laplace_schur_m() * &u));
        let inside = (mesh.harmonic(&u) - all).amax();
        errors.push(((energy / exact - 1.0).abs(), inside));
    }
    // Two degrees more divide the energy's error (twice the field's order) by over 100.
    for pair in errors.windows(2) {
        assert!(pair[1].0 < (0.01 * pair[0].0).max(1e-13), "{errors:?}");
        assert!(pair[1].1 < 0.05 * pair[0].1, "{errors:?}");
    }
    assert!(errors[3].1 < 1e-8, "{errors:?}");
}

#[test]
fn taylor_test_of_the_tangent() {
    let mesh = mesh(5);
    let law = Froehlich { m: 40.0, h0: 0.8 };
    let u = nodal(&mesh, |r, z| z + 0.4 * r * r * z + (1.7 * z).sin());
    let change = nodal(&mesh, |r, z| 0.3 * z * z - r * r + 0.2 * (r * z).cos());
    let base = mesh.flux(&u, &law);
    let whole = whole_tangent(&mesh, &u, &law) * &change;
    let remainder = |t: f64| (mesh.flux(&(&u + &change * t), &law) - &base - &whole * t).norm();
    let (coarse, fine) = (remainder(1e-2), remainder(1e-3));
    assert!((coarse / fine).log10() > 1.95, "{coarse} {fine}");
}

/// The tangent stiffness of all nodes, element by element.
fn whole_tangent(mesh: &Interior, u: &DVector<f64>, law: &dyn Permeability) -> DMatrix<f64> {
    let mut whole = DMatrix::zeros(u.len(), u.len());
    for index in 0..mesh.cell_count() {
        let cell = mesh.cell(index);
        let nodes = mesh.element_nodes(cell);
        let element = mesh.element(cell, &nodes, u, law, Some(None));
        for (j, &column) in nodes.iter().enumerate() {
            for (i, &row) in nodes.iter().enumerate() {
                whole[(row, column)] += element.matrix[(i, j)];
            }
        }
    }
    whole
}

/// Newton's method for div(mu grad u) = div(mu grad g) with u = g on the boundary; the load is
/// the flux of g on a much finer mesh of the same elements, taken back to the coarse one.
fn manufactured_error(degree: usize) -> f64 {
    let law = Froehlich { m: 40.0, h0: 0.8 };
    let g = |r: f64, z: f64| (1.1 * z).sin() * (1.0 + 0.6 * r * r) + 0.7 * z;
    let gradient = |r: f64, z: f64| {
        (
            1.2 * r * (1.1 * z).sin(),
            1.1 * (1.1 * z).cos() * (1.0 + 0.6 * r * r) + 0.7,
        )
    };
    let mesh = mesh(degree);
    let mut load = DVector::zeros(mesh.node_count());
    let fine = gauss::rule(30);
    let basis = lobatto::values(&mesh.reference.nodes, &fine.nodes);
    let slopes = lobatto::slopes(&mesh.reference.nodes, &fine.nodes);
    for index in 0..mesh.cell_count() {
        let cell = mesh.cell(index);
        let (sr, sz) = cell.stretch();
        for (k, &node) in mesh.element_nodes(cell).iter().enumerate() {
            let (i, j) = (k % (degree + 1), k / (degree + 1));
            for a in 0..30 {
                for b in 0..30 {
                    let (r, z) = (
                        between(cell.r_m, fine.nodes[a]),
                        between(cell.z_m, fine.nodes[b]),
                    );
                    let (g_r, g_z) = gradient(r, z);
                    let weight = fine.weights[a] * fine.weights[b] / (sr * sz)
                        * TAU
                        * r
                        * law.response(g_r.hypot(g_z)).relative;
                    load[node] += weight
                        * (g_r * sr * slopes[(a, i)] * basis[(b, j)]
                            + g_z * sz * basis[(a, i)] * slopes[(b, j)]);
                }
            }
        }
    }
    let exact = nodal(&mesh, g);
    let mut u = mesh.harmonic(&on_boundary(&mesh, &exact));
    let inner: Vec<usize> = (0..u.len())
        .filter(|k| !mesh.boundary().contains(k))
        .collect();
    for _ in 0..20 {
        let rest = &load - mesh.flux(&u, &law);
        let tangent = whole_tangent(&mesh, &u, &law);
        let system = tangent.select_rows(&inner).select_columns(&inner);
        let right = DVector::from_iterator(inner.len(), inner.iter().map(|&k| rest[k]));
        let change = system.cholesky().expect("positive").solve(&right);
        for (&k, value) in inner.iter().zip(&change) {
            u[k] += value;
        }
        if change.amax() < 1e-12 {
            break;
        }
    }
    (u - exact).amax()
}

#[test]
fn manufactured_saturating_solution_converges_with_the_degree() {
    let errors = [2, 4, 6, 8].map(manufactured_error);
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.2 * pair[0], "{errors:?}");
    }
    assert!(errors[3] < 1e-6, "{errors:?}");
}

#[test]
fn condensed_correction_is_the_whole_systems() {
    let mesh = mesh(3);
    let law = Froehlich { m: 40.0, h0: 0.8 };
    let u = nodal(&mesh, |r, z| z + 0.4 * r * r * z + (1.7 * z).sin());
    let linear = mesh.linearize(&u, &law, None).expect("a growing law");
    let boundary = on_boundary(&mesh, &nodal(&mesh, |r, z| 0.2 * z + r * r * z));
    let change = mesh.correction(&linear, &boundary);
    assert!((on_boundary(&mesh, &change) - &boundary).amax() < 1e-14);
    let after = whole_tangent(&mesh, &u, &law) * &change + mesh.flux(&u, &law);
    let on_surface = on_boundary(&mesh, &after);
    assert!((&on_surface - &linear.load - &linear.matrix * &boundary).amax() < 1e-10);
    assert!((after.norm_squared() - on_surface.norm_squared()).abs() < 1e-9);
}

#[test]
fn integrals_samples_and_resolution() {
    let mesh = mesh(4);
    let u = nodal(&mesh, |r, z| r * r * z);
    assert!((mesh.integral(&u, |_| 1.0) / mesh.volume_m3() - 1.0).abs() < 1e-13);
    let (mut largest, mut smallest) = ((0.0_f64, f64::MIN), (f64::MAX, f64::MAX));
    mesh.sample_inside(&u, 0.05, |at| {
        assert!((at.gradient_r - 2.0 * at.r_m * at.z_m).abs() < 1e-12);
        assert!((at.gradient_z - at.r_m * at.r_m).abs() < 1e-12);
        largest = (largest.0.max(at.r_m), largest.1.max(at.z_m));
        smallest = (smallest.0.min(at.r_m), smallest.1.min(at.z_m));
    });
    assert!((largest.0 - (R_M - 0.05)).abs() < 1e-15 && (largest.1 - (Z_M.1 - 0.05)).abs() < 1e-15);
    assert!(smallest.0 > 0.0 && (smallest.1 - (Z_M.0 + 0.05)).abs() < 1e-15);
    let law = Constant { relative: 3.0 };
    assert!(mesh.resolution(&u, &law) < 1e-13);
    let rough = nodal(&mesh, |r, z| (4.0 * z).sin() + r * r);
    let resolution = mesh.resolution(&rough, &law);
    assert!(resolution > 1e-3 && resolution < 0.3, "{resolution}");
}

#[test]
fn meshes_that_cannot_be_are_refused() {
    for (r, z, degree) in [
        (vec![0.1, 0.7], vec![0.0, 1.0], 3),
        (vec![0.0, 0.7, 0.7], vec![0.0, 1.0], 3),
        (vec![0.0, 0.7], vec![1.0, 0.0], 3),
        (vec![0.0, 0.7], vec![0.0, f64::NAN], 3),
        (vec![0.0, 0.7], vec![0.0], 3),
        (vec![0.0, 0.7], vec![0.0, 1.0], 0),
        (vec![0.0, 0.7], vec![0.0, 1.0], lobatto::MAX_DEGREE + 1),
    ] {
        assert!(
            Interior::new(&r, &z, degree).is_err(),
            "{r:?} {z:?} {degree}"
        );
    }
}
