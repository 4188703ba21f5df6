//! Surfaces: one triangle, needles, far offsets, heights of 1 nm to 1 m, ten million triangles.

use super::check::{Outcome, close, holds, off, refused, reported, worst};
use super::{Case, case};
use fluxform::numerics::axis::Axis;
use fluxform::progress::Silent;
use fluxform::shape::document::{Placement, Primitive};
use fluxform::shape::file_mesh::{FileMesh, Triangle};
use fluxform::shape::height::{Grid, Sample, heights};
use fluxform::shape::mesh::Mesh;
use fluxform::shape::placement::{Transform, sin_cos_deg};
use fluxform::shape::primitive::PlacedPrimitive;
use fluxform::shape::stl;

pub fn cases() -> Vec<Case> {
    [few(), offsets(), high_and_low()].concat()
}

pub fn mesh(triangles: Vec<Triangle>) -> Result<Mesh, String> {
    let file = FileMesh {
        triangles,
        ..FileMesh::default()
    };
    Mesh::place(file, &Transform::new(1.0, &Placement::default())).map_err(reported)
}

pub fn grid(x: (f64, f64, usize), y: (f64, f64, usize)) -> Grid {
    let axis = |(from, to, samples)| Axis { from, to, samples };
    Grid {
        x_m: axis(x),
        y_m: axis(y),
    }
}

fn sampled(triangles: Vec<Triangle>, grid: &Grid) -> Result<Vec<Option<Sample>>, String> {
    heights(&mesh(triangles)?, grid, &Silent).map_err(reported)
}

/// Heights of a mesh over a grid that it covers, against `expected`, over `size`.
pub fn against(
    triangles: Vec<Triangle>,
    grid: &Grid,
    size: f64,
    expected: impl Fn(f64, f64) -> f64,
) -> Outcome {
    let found = sampled(triangles, grid)?;
    let columns = grid.x_m.samples;
    let mut errors = Vec::with_capacity(found.len());
    for (k, sample) in found.iter().enumerate() {
        let (x, y) = (grid.x_m.node(k % columns), grid.y_m.node(k / columns));
        let height = sample
            .ok_or_else(|| format!("no surface over ({x}, {y})"))?
            .height_m;
        errors.push((height - expected(x, y)).abs() / size);
    }
    worst(errors, "heights")
}

/// A generic plane.
pub fn plane(x: f64, y: f64) -> f64 {
    0.05 + 0.3 * x - 0.7 * y
}

fn on_plane([x, y]: [f64; 2]) -> [f64; 3] {
    [x, y, plane(x, y)]
}

/// Two triangles over a rectangle, on the plane.
pub fn sheet(x: [f64; 2], y: [f64; 2]) -> Vec<Triangle> {
    let corner = |i: usize, j: usize| on_plane([x[i], y[j]]);
    vec![
        [corner(0, 0), corner(1, 0), corner(1, 1)],
        [corner(0, 0), corner(1, 1), corner(0, 1)],
    ]
}

/// A closed box between two corners.
fn block(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
    let corner = |k: usize| [0, 1, 2].map(|axis| [low, high][k >> axis & 1][axis]);
    [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ]
    .into_iter()
    .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
    .map(|t| t.map(corner))
    .collect()
}

fn count(found: &[Option<Sample>]) -> usize {
    found.iter().flatten().count()
}

fn few() -> Vec<Case> {
    vec![
        case(
            "shapes: one triangle",
            "its plane over its inside, edges and corners: 28 of 49 points of the grid, m",
            1e-15,
            || {
                let triangle = [[0.0, 0.0], [0.06, 0.0], [0.0, 0.06]].map(on_plane);
                let found = sampled(vec![triangle], &grid((0.0, 0.06, 7), (0.0, 0.06, 7)))?;
                if count(&found) < 22 || count(&found) > 28 {
                    return Err(format!("{} points", count(&found)));
                }
                let errors = found.iter().enumerate().filter_map(|(k, s)| {
                    let (x, y) = (0.01 * (k % 7) as f64, 0.01 * (k / 7) as f64);
                    s.map(|s| (s.height_m - plane(x, y)).abs())
                });
                worst(errors, &format!("{} points", count(&found)))
            },
        ),
        case(
            "shapes: one triangle, its three corners",
            "each corner belongs to it",
            0.0,
            || {
                let corners = [[0.013, -0.007], [0.061, 0.0021], [0.027, 0.043]];
                let triangle = corners.map(on_plane);
                let mut hit = true;
                for [x, y] in corners {
                    let found = sampled(vec![triangle], &grid((x, x, 1), (y, y, 1)))?;
                    hit &= found[0].is_some_and(|s| (s.height_m - plane(x, y)).abs() < 1e-15);
                }
                holds(hit, "three corners")
            },
        ),
        case(
            "shapes: a rounding outside one triangle",
            "no surface there",
            0.0,
            || {
                let triangle = [[0.0, 0.0], [0.06, 0.0], [0.0, 0.06]].map(on_plane);
                let x = (-f64::MIN_POSITIVE, -f64::MIN_POSITIVE, 1);
                let found = sampled(vec![triangle], &grid(x, (0.01, 0.01, 1)))?;
                holds(found[0].is_none(), "none")
            },
        ),
        case(
            "shapes: a needle of 1e6 : 1",
            "its plane all along its middle, m",
            1e-15,
            || {
                let needle = [[0.0, -5e-7], [0.0, 5e-7], [1.0, 0.0]].map(on_plane);
                against(
                    vec![needle],
                    &grid((0.0, 1.0, 1001), (0.0, 0.0, 1)),
                    1.0,
                    plane,
                )
            },
        ),
        case(
            "shapes: a needle of 1e6 : 1 at an angle",
            "its plane all along its middle, m, to 1e6 roundings",
            1e-9,
            || {
                let (sin, cos) = sin_cos_deg(37.0);
                let turned = |u: f64, v: f64| on_plane([cos * u - sin * v, sin * u + cos * v]);
                let needle = [turned(0.0, -5e-7), turned(0.0, 5e-7), turned(1.0, 0.0)];
                let m = mesh(vec![needle])?;
                let mut errors = Vec::new();
                for k in 1..100 {
                    let (x, y) = (cos * 0.01 * f64::from(k), sin * 0.01 * f64::from(k));
                    let found =
                        heights(&m, &grid((x, x, 1), (y, y, 1)), &Silent).map_err(reported)?;
                    let height = found[0].ok_or("a gap in the needle")?.height_m;
                    errors.push((height - plane(x, y)).abs());
                }
                worst(errors, "heights")
            },
        ),
        case(
            "shapes: a fan of 1e4 needles about one point",
            "the plane everywhere, the common corner included, m",
            1e-12,
            || {
                let rim = |k: usize| {
                    let (sin, cos) = sin_cos_deg(0.036 * k as f64);
                    on_plane([cos, sin])
                };
                let fan =
                    (0..10_000).map(|k| [on_plane([0.0, 0.0]), rim(k), rim((k + 1) % 10_000)]);
                against(
                    fan.collect(),
                    &grid((-0.7, 0.7, 41), (-0.7, 0.7, 41)),
                    1.0,
                    plane,
                )
            },
        ),
        case(
            "shapes: turned over, doubled, shuffled",
            "nothing changes",
            0.0,
            || {
                let plain = sheet([-0.05, 0.05], [-0.05, 0.05]);
                let mut odd: Vec<Triangle> =
                    plain.iter().rev().map(|&[a, b, c]| [c, b, a]).collect();
                odd.extend(plain.iter().map(|&[a, b, c]| [b, c, a]));
                let g = grid((-0.05, 0.05, 31), (-0.05, 0.05, 31));
                let (a, b) = (sampled(plain, &g)?, sampled(odd, &g)?);
                let most = a.iter().zip(&b).map(|(a, b)| match (a, b) {
                    (Some(a), Some(b)) => ((a.height_m - b.height_m).abs() - 1e-16).max(0.0),
                    _ => f64::INFINITY,
                });
                worst(most, "differences beyond 1e-16 m")
            },
        ),
        case(
            "shapes: a wall seen from above",
            "the top, walls included: 121 of 121 points",
            0.0,
            || {
                let found = sampled(
                    block([0.0, 0.0, 0.0], [0.1, 0.1, 0.05]),
                    &grid((0.0, 0.1, 11), (0.0, 0.1, 11)),
                )?;
                let top = found
                    .iter()
                    .flatten()
                    .filter(|s| s.height_m == 0.05)
                    .count();
                holds(top == 121, format!("{top} points at the top"))
            },
        ),
        case(
            "shapes: a line and a point among triangles",
            "left out; the others stay",
            0.0,
            || {
                let mut all = sheet([-0.05, 0.05], [-0.05, 0.05]);
                all.push([[0.0, 0.0, 9.0], [0.01, 0.0, 9.0], [0.02, 0.0, 9.0]]);
                all.push([[0.0, 0.0, 9.0]; 3]);
                let m = mesh(all)?;
                holds(
                    m.facts().degenerate == 2,
                    format!("{} left out", m.facts().degenerate),
                )
            },
        ),
        case("shapes: a line alone", "refused: no area", 0.0, || {
            refused(
                mesh(vec![[[0.0; 3], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]]]),
                &["area"],
            )
        }),
    ]
}

fn offsets() -> Vec<Case> {
    vec![
        case(
            "shapes: 1e6 mm away",
            "the plane, m, to the doubles' rounding of 1 km",
            1e-12,
            || {
                let at = 1000.0;
                against(
                    sheet([at, at + 0.1], [-at, 0.1 - at]),
                    &grid((at, at + 0.1, 31), (-at, 0.1 - at, 31)),
                    1.0,
                    plane,
                )
            },
        ),
        case(
            "shapes: 1e6 mm away, brought back",
            "every point of the grid is met, heights to the file's 32-bit rounding, m",
            // Half a unit in the last place of 1e6 mm in 32 bits is 0.031 mm; the slope is 0.7.
            1e-4,
            || {
                let far: Vec<[[f32; 3]; 3]> = sheet([-50.0, 50.0], [-50.0, 50.0])
                    .into_iter()
                    .map(|t| t.map(|[x, y, z]| [(x + 1e6) as f32, (y + 1e6) as f32, z as f32]))
                    .collect();
                let file = stl::read(&binary(&far)).map_err(reported)?;
                let back = Placement {
                    translate_m: [-1000.0, -1000.0, 0.0],
                    rotate_deg: [0.0; 3],
                    ..Placement::default()
                };
                let m = Mesh::place(file, &Transform::new(1e-3, &back)).map_err(reported)?;
                let g = grid((-0.05, 0.05, 61), (-0.05, 0.05, 61));
                let found = heights(&m, &g, &Silent).map_err(reported)?;
                if count(&found) != g.len() {
                    return Err(format!("{} of {} points", count(&found), g.len()));
                }
                worst(
                    found.iter().flatten().enumerate().map(|(k, s)| {
                        let (x, y) = (g.x_m.node(k % 61), g.y_m.node(k / 61));
                        (s.height_m - (5e-5 + 0.3 * x - 0.7 * y)).abs()
                    }),
                    "heights",
                )
            },
        ),
        case(
            "shapes: 1e6 mm away, what 32 bits round away",
            "half a unit in the last place of 1e6 mm, 0.03125 mm, is reported; no more than twice that",
            0.0,
            || {
                let far = [[[1e6_f32, 0.0, 0.0], [1e6, 9.0, 0.0], [999_990.0, 0.0, 1.0]]];
                let rounding = stl::read(&binary(&far))
                    .map_err(reported)?
                    .coordinate_rounding;
                holds(
                    (0.031..=0.0626).contains(&rounding),
                    format!("{rounding} mm"),
                )
            },
        ),
        case("shapes: beyond 1e9 m", "refused: too far", 0.0, || {
            let far = sheet([1e10, 2e10], [0.0, 1e10]);
            refused(mesh(far), &["triangle 1", "1e10 m", "unit"])
        }),
        case(
            "shapes: turned by 1e9 full turns and 30 degrees",
            "1/2 and its cosine, exactly",
            1e-15,
            || {
                let (sin, cos) = sin_cos_deg(360.0e9 + 30.0);
                worst(
                    [off(sin, 0.5), off(cos, 0.75_f64.sqrt())],
                    "sine and cosine",
                )
            },
        ),
    ]
}

fn primitive(p: Primitive) -> Result<PlacedPrimitive, String> {
    PlacedPrimitive::new(p, &Placement::default()).map_err(reported)
}

fn height_of(p: Primitive, x: f64, y: f64) -> Result<f64, String> {
    let sample = primitive(p)?.sample(x, y).ok_or("no surface")?;
    Ok(sample.height_m)
}

fn sphere(radius_m: f64) -> Outcome {
    let mut errors = Vec::new();
    for part in [0.0_f64, 0.3, 0.77, 0.999, 1.0] {
        let found = height_of(
            Primitive::HalfSphere {
                radius_m,
                base_m: 0.0,
            },
            part * radius_m,
            0.0,
        )?;
        // At the rim the height is the root of the rounding.
        let expected = radius_m * ((1.0 - part) * (1.0 + part)).sqrt();
        errors.push((found - expected).abs() / radius_m);
    }
    worst(errors, "heights over the radius")
}

fn high_and_low() -> Vec<Case> {
    vec![
        case("shapes: a plane 1 nm high", "1 nm, exactly", 0.0, || {
            close(
                height_of(
                    Primitive::Flat {
                        side_m: 0.1,
                        height_m: 1e-9,
                    },
                    0.03,
                    -0.05,
                )?,
                1e-9,
                "m",
            )
        }),
        case(
            "shapes: a mesh 1 nm high",
            "1 nm everywhere, m",
            0.0,
            || {
                let flat: Vec<Triangle> = sheet([-0.05, 0.05], [-0.05, 0.05])
                    .into_iter()
                    .map(|t| t.map(|[x, y, _]| [x, y, 1e-9]))
                    .collect();
                against(
                    flat,
                    &grid((-0.05, 0.05, 21), (-0.05, 0.05, 21)),
                    1e-9,
                    |_, _| 1e-9,
                )
            },
        ),
        case(
            "shapes: a wedge from 1 nm to 1 m",
            "linear between, m",
            1e-15,
            || {
                let wedge = Primitive::Wedge {
                    side_m: 0.1,
                    low_m: 1e-9,
                    high_m: 1.0,
                };
                let low = height_of(wedge, -0.05, 0.0)?;
                let middle = height_of(wedge, 0.0, 0.02)?;
                let high = height_of(wedge, 0.05, 0.05)?;
                worst(
                    [
                        (low - 1e-9).abs(),
                        off(middle, 0.5 * (1.0 + 1e-9)),
                        off(high, 1.0),
                    ],
                    &format!("{low:e}, {middle}, {high} m"),
                )
            },
        ),
        case(
            "shapes: a half-sphere of 1 nm",
            "its formula, of the radius, rim included",
            1e-7,
            || sphere(1e-9),
        ),
        case(
            "shapes: a half-sphere of 1 km",
            "its formula, of the radius, rim included",
            1e-7,
            || sphere(1000.0),
        ),
        case(
            "shapes: a half-sphere without a radius",
            "refused: it must be positive",
            0.0,
            || {
                refused(
                    primitive(Primitive::HalfSphere {
                        radius_m: 0.0,
                        base_m: 0.03,
                    }),
                    &["radius_mm", "positive"],
                )
            },
        ),
        case(
            "shapes: a wall of 1 m on a floor of 1 nm",
            "the higher of the two, m",
            0.0,
            || {
                let mut all = block([0.0, 0.0, 0.0], [0.05, 0.1, 1.0]);
                all.extend(block([0.0, 0.0, 0.0], [0.1, 0.1, 1e-9]));
                let found = sampled(all, &grid((0.0, 0.1, 11), (0.05, 0.05, 1)))?;
                let good = found
                    .iter()
                    .enumerate()
                    .all(|(k, s)| s.is_some_and(|s| s.height_m == if k <= 5 { 1.0 } else { 1e-9 }));
                holds(good, "11 points")
            },
        ),
    ]
}

/// A binary STL file.
pub fn binary(triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        for c in triangle.as_flattened() {
            bytes.extend(c.to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}
