//! Up to ten million triangles, surface files that are none, and what lies between the points.

use super::check::{Outcome, close, measured, refused, reported, worst};
use super::shapes::{against, binary, grid, mesh, plane, sheet};
use super::{Case, case};
use fluxform::progress::Silent;
use fluxform::shape::deviation::{Faces, Lattice, Looks, vertical};
use fluxform::shape::document::Placement;
use fluxform::shape::file_mesh::Triangle;
use fluxform::shape::height::{Grid, heights};
use fluxform::shape::mesh::Mesh;
use fluxform::shape::placement::{Transform, sin_cos_deg};
use fluxform::shape::stl;

pub fn cases() -> Vec<Case> {
    [many(), files(), deviations()].concat()
}

/// A square of `2 side^2` triangles on the plane, sampled between the nodes too.
fn tiled(side: usize, samples: usize) -> Outcome {
    let node = |k: usize| -0.05 + 0.1 * k as f64 / side as f64;
    let mut triangles = Vec::with_capacity(2 * side * side);
    for j in 0..side {
        for i in 0..side {
            triangles.extend(sheet([node(i), node(i + 1)], [node(j), node(j + 1)]));
        }
    }
    against(
        triangles,
        &grid((-0.05, 0.05, samples), (-0.05, 0.05, samples)),
        1.0,
        plane,
    )
}

fn many() -> Vec<Case> {
    let words = "the plane everywhere, no gap between triangles, m";
    vec![
        case("shapes: 200 thousand triangles", words, 1e-14, || {
            tiled(316, 997)
        }),
        case("shapes: 1e7 triangles", words, 1e-14, || tiled(2237, 997))
            .not_in_ci()
            .within(300.0),
        case(
            "shapes: facets of a half-sphere",
            "their rms error falls with the square of their number: order 2",
            0.15,
            || {
                let error = |n: usize| -> Result<f64, String> {
                    let at = |i: usize, j: usize| {
                        let (ss, cs) = sin_cos_deg(360.0 * j as f64 / (4 * n) as f64);
                        let (st, ct) = sin_cos_deg(90.0 * i as f64 / n as f64);
                        [st * cs, st * ss, ct]
                    };
                    let mut all = Vec::new();
                    for i in 0..n {
                        for j in 0..4 * n {
                            all.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                            all.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
                        }
                    }
                    let m = mesh(all)?;
                    let g = grid((-0.55, 0.55, 201), (-0.55, 0.55, 201));
                    let found = heights(&m, &g, &Silent).map_err(reported)?;
                    let mut sum = 0.0;
                    for (k, s) in found.iter().enumerate() {
                        let (x, y) = (g.x_m.node(k % 201), g.y_m.node(k / 201));
                        let height = s.ok_or("a gap")?.height_m;
                        sum += ((1.0 - x * x - y * y).sqrt() - height).powi(2);
                    }
                    Ok((sum / g.len() as f64).sqrt())
                };
                let errors = [error(16)?, error(32)?, error(64)?];
                let orders = [
                    (errors[0] / errors[1]).log2(),
                    (errors[1] / errors[2]).log2(),
                ];
                worst(
                    orders.map(|o| (o - 2.0).abs()),
                    &format!("orders {orders:.3?}"),
                )
            },
        ),
    ]
}

fn files() -> Vec<Case> {
    let one = "refused with the place";
    vec![
        case("shapes: an empty file", one, 0.0, || {
            refused(stl::read(&[]), &["empty"])
        }),
        case("shapes: a file of no triangle", one, 0.0, || {
            refused(stl::read(&binary(&[])), &["no triangle"])
        }),
        case("shapes: a file that claims 4e9 triangles", one, 0.0, || {
            let mut bytes = binary(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
            bytes[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
            refused(stl::read(&bytes), &["4294967295", "1 whole triangles"])
        }),
        case("shapes: a vertex that is not a number", one, 0.0, || {
            let bytes = binary(&[[[0.0; 3], [1.0, f32::NAN, 0.0], [0.0, 1.0, 0.0]]]);
            refused(stl::read(&bytes), &["vertex 2 of triangle 1", "NaN"])
        }),
        case("shapes: an infinite vertex", one, 0.0, || {
            let bytes = binary(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, f32::NEG_INFINITY, 0.0]]]);
            refused(stl::read(&bytes), &["vertex 3 of triangle 1", "inf"])
        }),
        case(
            "shapes: a vertex as far as 32 bits go",
            "refused: too far",
            0.0,
            || {
                let bytes = binary(&[[[0.0; 3], [f32::MAX, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
                let file = stl::read(&bytes).map_err(reported)?;
                refused(
                    Mesh::place(file, &Transform::new(1e-3, &Placement::default())),
                    &["triangle 1"],
                )
            },
        ),
    ]
}

/// The largest vertical difference between a mesh and bilinear interpolation of its heights.
fn deviation(triangles: Vec<Triangle>, grid: &Grid) -> Result<f64, String> {
    let m = mesh(triangles)?;
    let found = heights(&m, grid, &Silent).map_err(reported)?;
    let nodes: Vec<Option<f64>> = found.iter().map(|s| s.map(|s| s.height_m)).collect();
    let faces = Faces::new(&m, grid, Looks::endless());
    let lattice = Lattice::new(&faces, grid, &nodes);
    let told_m = vertical(&m, grid, &lattice, &Silent).map_err(reported)?;
    Ok(told_m.worst().value_m.max(0.0))
}

/// A roof whose ridge runs along y at x = `at`, with slopes of 0.7.
fn roof(at: f64) -> Vec<Triangle> {
    let corner = |x: f64, y: f64| [x, y, 0.09 - 0.7 * (x - at).abs()];
    let half = |x: [f64; 2]| {
        [
            [corner(x[0], -0.05), corner(x[1], -0.05), corner(x[1], 0.05)],
            [corner(x[0], -0.05), corner(x[1], 0.05), corner(x[0], 0.05)],
        ]
    };
    [half([-0.05, at]), half([at, 0.05])].concat()
}

fn deviations() -> Vec<Case> {
    vec![
        case(
            "shapes: a plane between its points",
            "no deviation, m, to 1e-11 of the size",
            1e-12,
            || {
                let g = grid((-0.05, 0.05, 11), (-0.05, 0.05, 11));
                measured(
                    deviation(sheet([-0.05, 0.05], [-0.05, 0.05]), &g)?,
                    "largest, m",
                )
            },
        ),
        case(
            "shapes: a ridge midway between points",
            "slope times half a step, 3.5 mm",
            1e-9,
            || {
                let g = grid((-0.05, 0.05, 11), (-0.05, 0.05, 11));
                close(deviation(roof(0.005), &g)?, 0.7 * 0.005, "m")
            },
        ),
        case(
            "shapes: a ridge 1 nm beside the points",
            "slope times 2 d (s - d) / s: 1.4 nm, to 1e-12 of the size",
            1e-3,
            || {
                let g = grid((-0.05, 0.05, 11), (-0.05, 0.05, 11));
                let d: f64 = 1e-9;
                close(
                    deviation(roof(d), &g)?,
                    0.7 * 2.0 * d * (0.01 - d) / 0.01,
                    "m",
                )
            },
        ),
    ]
}
