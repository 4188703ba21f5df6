//! A design as a drawing of its array.

use crate::design::iron::{Plate, PlateOutline};
use crate::design::{Coil, Design};
use crate::field::iron::bodies::{self, Solid};
use crate::plot::array::{ArrayPlot, Body, Part, Role};
use crate::scene::iron::middle;

/// Ends of sections that are one, m.
const SAME_M: f64 = 1e-9;

/// The array of `design` with its coils, the magnet, the workspace and the bodies of its `[[iron]]`; `None` without
/// a coil.
#[must_use]
pub fn drawing<'a>(
    design: &Design,
    iron: impl IntoIterator<Item = &'a bodies::Body>,
) -> Option<ArrayPlot> {
    let coil = design.coil?;
    let axes = &design.array.positions_m;
    let distance = |axis: &[f64; 2]| axis[0].hypot(axis[1]);
    let middle = axes
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let space = &design.workspace;
    let ends = [space.x_m, space.y_m, space.z_m].map(|axis| [axis.from, axis.to]);
    let mut parts = vec![part(Role::Workspace, Body::Block(ends))];
    for (number, axis_m) in axes.iter().enumerate() {
        parts.extend(coil_parts(design, &coil, *axis_m, number));
    }
    parts.extend(
        design
            .plate
            .as_ref()
            .map(|plate| part(Role::Plate, plate_body(design, &coil, plate))),
    );
    for body in iron {
        parts.extend(iron_parts(body, middle[1]));
    }
    let (half, centre) = (0.5 * design.magnet.length_m, design.target_height_m);
    parts.push(part(
        Role::Magnet,
        Body::Tube {
            axis_m: *middle,
            inner_m: 0.0,
            outer_m: 0.5 * design.magnet.diameter_m,
            z_m: [centre - half, centre + half],
        },
    ));
    Some(ArrayPlot {
        title: format!("{}: the array, to scale", design.name),
        parts,
        section_y_m: middle[1],
    })
}

/// The plate, its middle below the middle of the coils' axes.
fn plate_body(design: &Design, coil: &Coil, plate: &Plate) -> Body {
    let middle = middle(&design.array.positions_m);
    let below_m = design.core.as_ref().map_or(0.0, |core| core.below_m);
    let top_m = -(coil.length_m + below_m) - plate.gap_m;
    let z_m = [top_m - plate.thickness_m, top_m];
    match plate.outline {
        PlateOutline::Round(diameter_m) => Body::Tube {
            axis_m: middle,
            inner_m: 0.0,
            outer_m: 0.5 * diameter_m,
            z_m,
        },
        PlateOutline::Rectangle(sides_m) => {
            let ends = |k: usize| {
                let half = 0.5 * sides_m[k];
                [middle[k] - half, middle[k] + half]
            };
            Body::Block([ends(0), ends(1), z_m])
        }
    }
}

/// A body of steel cut at `section_y_m`, and its bore.
fn iron_parts(body: &bodies::Body, section_y_m: f64) -> Vec<Part> {
    if let Solid::Mesh(_) = body.solid {
        return mesh_parts(body, section_y_m);
    }
    let outlines = |solid: Solid, hollow: bool| {
        let solid = bodies::Body {
            solid,
            ..body.clone()
        };
        let (places, cells) = solid.drawn();
        let level = body.turn[2][2].abs() == 1.0;
        // From above the bore of a body that lies is not seen.
        let from_above = places.iter().filter(|_| level || !hollow);
        let cuts = cells
            .iter()
            .flat_map(|cell| cut(&places, cell, section_y_m));
        Body::Outlines {
            ends_m: ends_m(&places),
            plan_m: convex_hull(from_above.map(|place| [place[0], place[1]]).collect()),
            section_m: convex_hull(cuts.collect()),
            hollow,
        }
    };
    let bore = match body.solid {
        Solid::Tube([inner, _, length]) if inner > 0.0 => Some(Solid::Tube([0.0, inner, length])),
        Solid::Tube(_) | Solid::Box(_) | Solid::Ball(_) | Solid::Mesh(_) => None,
    };
    let bore = bore.map(|bore| part(Role::Iron, outlines(bore, true)));
    let whole = part(Role::Iron, outlines(body.solid.clone(), false));
    std::iter::once(whole).chain(bore).collect()
}

/// A mesh: from above its convex outline, and every loop in which the section cuts it, those inside others as holes.
fn mesh_parts(body: &bodies::Body, section_y_m: f64) -> Vec<Part> {
    let (places, facets) = body.drawn();
    let cuts = facets.iter().map(|facet| cut(&places, facet, section_y_m));
    let loops = loops(
        cuts.filter_map(|cut| <[[f64; 2]; 2]>::try_from(cut).ok())
            .collect(),
    );
    let used = facets
        .iter()
        .flatten()
        .map(|k| places[*k])
        .collect::<Vec<_>>();
    let outlines = |plan_m, section_m: Vec<[f64; 2]>, hollow| {
        let ends_m = ends_m(&used);
        part(
            Role::Iron,
            Body::Outlines {
                ends_m,
                plan_m,
                section_m,
                hollow,
            },
        )
    };
    let plan = convex_hull(used.iter().map(|place| [place[0], place[1]]).collect());
    let mut parts = vec![outlines(plan, Vec::new(), false)];
    let around = |inner: &[[f64; 2]]| {
        let others = loops.iter().filter(|other| other.as_slice() != inner);
        others.filter(|other| is_inside(other, inner[0])).count()
    };
    let mut sorted: Vec<(usize, &Vec<[f64; 2]>)> =
        loops.iter().map(|own| (around(own), own)).collect();
    sorted.sort_by_key(|(around, _)| *around);
    let sections = sorted.into_iter();
    parts.extend(sections.map(|(around, own)| outlines(Vec::new(), own.clone(), around % 2 == 1)));
    parts
}

/// Whether a point is inside a polygon, by the sides to its right.
fn is_inside(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let next = polygon.iter().cycle().skip(1);
    let crossed = polygon.iter().zip(next).filter(|(a, b)| {
        (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
    });
    crossed.count() % 2 == 1
}

/// Polygons of segments that end where others begin.
fn loops(mut segments: Vec<[[f64; 2]; 2]>) -> Vec<Vec<[f64; 2]>> {
    let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
    let mut out = Vec::new();
    while let Some([first, mut last]) = segments.pop() {
        let mut polygon = vec![first, last];
        loop {
            let nearest = (0..segments.len())
                .flat_map(|k| [(k, 0), (k, 1)])
                .map(|(k, end)| (apart(segments[k][end], last), k, end))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            match nearest {
                Some((gap_m, k, end)) if gap_m < SAME_M => {
                    last = segments.swap_remove(k)[1 - end];
                    polygon.push(last);
                }
                _ => break,
            }
        }
        if polygon.len() > 3 {
            polygon.pop();
            out.push(polygon);
        }
    }
    out
}

/// Ends along x, y and z.
fn ends_m(places: &[[f64; 3]]) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|axis| {
        let values = places.iter().map(|place| place[axis]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        })
    })
}

/// Where a polygon's sides pass through the plane at `y_m`, by x and z.
fn cut(places: &[[f64; 3]], polygon: &[usize], y_m: f64) -> Vec<[f64; 2]> {
    let next = polygon.iter().cycle().skip(1);
    let sides = polygon
        .iter()
        .zip(next)
        .map(|(a, b)| [places[*a], places[*b]]);
    // A corner in the plane counts as above it.
    let through = sides.filter(|[a, b]| (a[1] < y_m) != (b[1] < y_m));
    let at = |[a, b]: [[f64; 3]; 2]| {
        let share = (y_m - a[1]) / (b[1] - a[1]);
        [a[0] + share * (b[0] - a[0]), a[2] + share * (b[2] - a[2])]
    };
    through.map(at).collect()
}

/// The corners of the smallest convex outline of points in a plane, anticlockwise (Andrew's chains).
fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    let turns_left = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0
    };
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = corners[..] {
                if turns_left(a, b, point) {
                    break;
                }
                corners.pop();
            }
            corners.push(point);
        }
        corners.pop();
        corners
    };
    let mut corners = chain(&mut points.iter().copied());
    corners.extend(chain(&mut points.iter().rev().copied()));
    corners
}

fn part(role: Role, body: Body) -> Part {
    Part {
        role,
        body,
        label: None,
    }
}

/// A winding with its core.
fn coil_parts(design: &Design, coil: &Coil, axis_m: [f64; 2], number: usize) -> Vec<Part> {
    let inner_m = 0.5 * coil.inner_diameter_m;
    let winding = Body::Tube {
        axis_m,
        inner_m,
        outer_m: 0.5 * coil.outer_diameter_m,
        z_m: [-coil.length_m, 0.0],
    };
    let core = design.core.as_ref().map(|core| Body::Tube {
        axis_m,
        inner_m: 0.0,
        outer_m: inner_m - core.clearance_m,
        z_m: [-(coil.length_m + core.below_m), core.above_m],
    });
    let winding = Part {
        label: Some(number.to_string()),
        ..part(Role::Winding, winding)
    };
    let core = core.map(|body| part(Role::Core, body));
    std::iter::once(winding).chain(core).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Need;
    use crate::scene::Scene;
    use std::path::Path;

    const TEXT: &str = "name = \"pair\"\n[coil]\ninner_diameter_mm = 14.0\nouter_diameter_mm = 22.0\n\
                        length_mm = 30.0\n[wire]\ndiameter_mm = 0.7\n[array]\nrows = 1\ncolumns = 2\n\
                        pitch_mm = 33.0\n";

    fn drawn(iron: &str) -> Vec<Part> {
        let text = format!("{TEXT}[[iron]]\n{iron}");
        let (design, _) = Design::from_toml(&text, Path::new("d.toml"), Need::EVALUATE).unwrap();
        let scene = Scene::new(&design).unwrap();
        let plot = scene.drawing().unwrap();
        plot.parts
            .into_iter()
            .filter(|part| part.role == Role::Iron)
            .collect()
    }

    fn area(corners: &[[f64; 2]]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        let pairs = corners.iter().zip(next);
        pairs.map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum()
    }

    /// Bodies of steel were in the field and not in the picture.
    #[test]
    fn bodies_of_steel_are_drawn_as_they_are_turned_and_cut() {
        let parts = drawn(
            "shape = \"box\"\nsize_mm = [8, 6, 4]\ncenter_mm = [1, 1, -50]\nrotate_deg = [0, 0, 30]\n",
        );
        let [
            Part {
                body: Body::Outlines {
                    plan_m, section_m, ..
                },
                ..
            },
        ] = &parts[..]
        else {
            panic!("{parts:?}");
        };
        assert!((area(plan_m) - 48e-6).abs() < 1e-12);
        let width = 6e-3 / (30_f64.to_radians().cos());
        let height = section_m
            .iter()
            .fold(0.0_f64, |most, p| most.max((p[1] + 0.05).abs()));
        assert!((height - 2e-3).abs() < 1e-12);
        assert!(area(section_m) > 4e-3 * width, "{section_m:?}");
        let ball = drawn("shape = \"ball\"\ndiameter_mm = 10\ncenter_mm = [0, 3, -50]\n");
        let [
            Part {
                body: Body::Outlines { section_m, .. },
                ..
            },
        ] = &ball[..]
        else {
            panic!("{ball:?}");
        };
        let disc = std::f64::consts::PI * 16e-6;
        assert!(
            (area(section_m) / disc - 1.0).abs() < 0.02,
            "{}",
            area(section_m) / disc
        );
    }
}
