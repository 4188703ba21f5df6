//! The share of a surface that is hidden from above, which a height map cannot show.
//!
//! Points spread evenly over the area (by an additive recurrence, so always the same ones) are looked
//! at along vertical lines: one that lies below what such a line meets first is hidden.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::edges::{Edges, WELD_ROUNDINGS, parts, weld};
use crate::file_mesh::{Bounds, Triangle};
use crate::height::{Grid, reach_m};
use crate::index::Index;
use crate::mesh::Mesh;
use crate::point_flags::{Rules, contacts, is_closed, is_oriented};
use crate::sides::Sides;
use crate::surface::Surface;
use crate::vertical_hit::{Contact, is_wall, may_touch};
use fluxform_numerics::axis::Axis;
use fluxform_numerics::vec3::{cross, dot, minus};

/// Points that are looked at.
const POINTS: usize = 20_000;
/// Triangles that all lines together may be compared with, about: two seconds of one core.
pub(super) const MOST_MET: usize = 20_000_000;
/// Cells along x, and as many along y, in which triangles are looked up.
const CELLS: usize = 101;
/// Of a facet's area this share at least must show in plan for it to face up or down.
const LEVEL: f64 = 1e-6;
/// Shares of hidden area beyond this are worth a warning.
const MOST_HIDDEN: f64 = 0.01;
/// Depths below this share of the surface's height count as seen.
const DEPTH: f64 = 1e-6;
/// A wall is hidden where this share of the surface's width beside it, on either side, something lies above.
const ASIDE: f64 = 1e-5;

/// Shares of a surface's area, to about a hundredth.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Hidden {
    /// Not seen from above: below other parts of the surface, or facing down as a body's underside.
    pub of_area: f64,
    /// Of the area that faces up, what lies under other parts of the surface: undercuts, hollows; `None`
    /// (null) where facets of an open surface look to different sides, which leaves open what faces up.
    pub of_upward: Option<f64>,
}

impl Hidden {
    /// Of a surface; `None` for a formula, which hides nothing.
    #[must_use]
    pub fn of(surface: &Surface) -> Option<Self> {
        match surface {
            Surface::Mesh(mesh) => Some(of_mesh(mesh)),
            Surface::Primitive(_) => None,
        }
    }

    /// What a user of the height map should know, if it hides more than a hundredth.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let share = |share: f64| format!("{:.0} %", 100.0 * share);
        match self.of_upward {
            Some(of_upward) => (of_upward > MOST_HIDDEN).then(|| {
                format!(
                    "{} of the area that faces up lies under other parts of the surface (undercuts, hollows): \
                     a height map shows the uppermost alone",
                    share(of_upward)
                )
            }),
            None => (self.of_area > MOST_HIDDEN).then(|| {
                format!(
                    "{} of the area lies under other parts of the surface; whether that faces up (undercuts, \
                     hollows) is unknown, because the surface is open and its facets look to different sides: \
                     a height map shows the uppermost alone",
                    share(self.of_area)
                )
            }),
        }
    }
}

fn of_mesh(mesh: &Mesh) -> Hidden {
    let triangles = mesh.triangles();
    let normal = |k: usize| normal_of(&triangles[k]);
    let bounds = mesh.facts().bounds;
    let (ends, volume) = ends_along_area(triangles, bounds.min_m);
    let area = ends.last().copied().unwrap_or(0.0);
    // Where facets of a body look to different sides, the sheets above a point tell inside from outside.
    let meeting = Meeting::of(mesh);
    let by_sheets = meeting.closed && !meeting.oriented;
    let sides = meeting.closed && meeting.oriented;
    let sides = sides.then(|| Sides::new(triangles, parts(&meeting.names)));
    let is_turned = |facet: usize| match &sides {
        Some(sides) => sides.is_turned(facet),
        None => volume < 0.0,
    };
    // Heights alone are requested: of layers nothing.
    let rules = Rules {
        reach_m: reach_m(mesh, &cells(bounds)),
        plain_layers: 1,
    };
    let index = Index::new(mesh, rules.reach_m);
    let depth_m =
        DEPTH * (bounds.max_m[2] - bounds.min_m[2]) + 2.0 * mesh.facts().height_rounding_m;
    let width_m = bounds.plan().map(|[from, to]| to - from);
    let aside_m = (ASIDE * width_m[0].max(width_m[1])).max(4.0 * rules.reach_m);
    let place = |k: usize| {
        let at = area * (k as f64 + 0.5) / POINTS as f64;
        let first = ends.partition_point(|end| *end < at);
        let facet = first.min(triangles.len() - 1);
        (facet, point_on(triangles[facet], k))
    };
    // Counts of points: all, hidden, facing up, of these hidden.
    let look = |k: usize| -> [usize; 4] {
        fluxform_base::progress::poll();
        let (facet, point) = place(k);
        let normal = normal(facet);
        let level = LEVEL * dot(normal, normal).sqrt();
        let above = |point: [f64; 3]| {
            let touching = index.at([point[0], point[1]]);
            sheets_above(triangles, touching, (facet, point), depth_m, rules)
        };
        // A wall is seen edge-on, from its side that lies open; the file's rounding may make it lean.
        if normal[2].abs() <= level || is_wall(&triangles[facet], rules.reach_m) {
            let step_m = aside_m / normal[0].hypot(normal[1]);
            let hidden = [step_m, -step_m].into_iter().all(|step_m| {
                let [x, y] = [0, 1].map(|k| point[k] + step_m * normal[k]);
                above([x, y, point[2]]) > 0
            });
            return [1, usize::from(hidden), 0, 0];
        }
        let above = above(point);
        let up = usize::from(if by_sheets {
            above.is_multiple_of(2)
        } else {
            (normal[2] > 0.0) != is_turned(facet)
        });
        let covered = usize::from(above > 0);
        [1, covered, up, up * covered]
    };
    // Where triangles lie over each other many times, a line meets all of them: fewer lines.
    let met = |k: usize| {
        let (_, point) = place(k);
        index.at([point[0], point[1]]).len()
    };
    let met: usize = (0..POINTS).into_par_iter().map(met).sum();
    let sums = (0..POINTS)
        .into_par_iter()
        .step_by((met / MOST_MET).max(1))
        .map(look)
        .reduce(|| [0; 4], |a, b| [0, 1, 2, 3].map(|i| a[i] + b[i]));
    let share = |part: usize, whole: usize| part as f64 / whole.max(1) as f64;
    let looks_apart = || !meeting.oriented || patches_look_apart(triangles, &meeting.names);
    let unknown = sums[1] > 0 && !meeting.closed && looks_apart();
    Hidden {
        of_area: share(sums[1], sums[0]),
        of_upward: (!unknown).then(|| share(sums[3], sums[2])),
    }
}

/// Along the normal, twice as long as the triangle is large.
fn normal_of([a, b, c]: &Triangle) -> [f64; 3] {
    cross(minus(*b, *a), minus(*c, *a))
}

/// Ends of the triangles along the whole area, in their order, and six times the volume where they enclose one.
fn ends_along_area(triangles: &[Triangle], low_m: [f64; 3]) -> (Vec<f64>, f64) {
    let (mut area, mut volume) = (0.0, 0.0);
    let mut ends = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let normal = normal_of(triangle);
        area += 0.5 * dot(normal, normal).sqrt();
        volume += dot(minus(triangle[0], low_m), normal);
        ends.push(area);
    }
    (ends, volume)
}

/// The grid over a mesh's bounds.
fn cells(bounds: Bounds) -> Grid {
    let [x_m, y_m] = bounds.plan().map(|[from, to]| Axis {
        from,
        to,
        samples: if to > from { CELLS } else { 1 },
    });
    Grid { x_m, y_m }
}

/// Point `k` of a sequence that fills a triangle evenly.
fn point_on([a, b, c]: Triangle, k: usize) -> [f64; 3] {
    // The plastic number's recurrence fills a square; folded, a triangle.
    let [mut s, mut t] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2]
        .map(|step: f64| (0.5 + step * k as f64).fract());
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    [0, 1, 2].map(|i| a[i] + s * (b[i] - a[i]) + t * (c[i] - a[i]))
}

/// How the triangles of a mesh meet.
struct Meeting {
    names: Vec<[u32; 3]>,
    closed: bool,
    /// Whether neighbours look to the same side.
    oriented: bool,
}

impl Meeting {
    /// To the bit, or where that leaves the surface open, to the file's rounding.
    fn of(mesh: &Mesh) -> Self {
        let triangles = mesh.triangles();
        if is_closed(triangles) {
            return Self {
                names: weld(triangles, 0.0),
                closed: true,
                oriented: is_oriented(triangles),
            };
        }
        let names = weld(triangles, WELD_ROUNDINGS * mesh.facts().plan_rounding_m);
        let edges = Edges::new(&names);
        Self {
            closed: edges.closed(),
            oriented: edges.inconsistent == 0,
            names,
        }
    }
}

/// Whether patches of an open surface that do not meet look to different sides, up and down, with more than a hundredth
/// of the plan each.
fn patches_look_apart(triangles: &[Triangle], names: &[[u32; 3]]) -> bool {
    let (part_of, count) = parts(names);
    let mut plan = vec![0.0; count];
    for (triangle, part) in triangles.iter().zip(part_of) {
        plan[part as usize] += normal_of(triangle)[2];
    }
    let all: f64 = plan.iter().map(|plan: &f64| plan.abs()).sum();
    let looks = |way: f64| plan.iter().any(|plan| way * plan > MOST_HIDDEN * all);
    looks(1.0) && looks(-1.0)
}

/// How many sheets of the surface lie more than `depth_m` above a `point` on a `facet`.
fn sheets_above(
    triangles: &[Triangle],
    touching: &[u32],
    (facet, point): (usize, [f64; 3]),
    depth_m: f64,
    rules: Rules,
) -> usize {
    let (p, seen_m) = ([point[0], point[1]], point[2] + depth_m);
    let rises = |at: &u32| {
        let at = *at as usize;
        at != facet && may_cover(&triangles[at], p, seen_m, 2.0 * rules.reach_m)
    };
    let rising: Vec<u32> = touching.iter().copied().filter(rises).collect();
    // What is merely near is a steep facet's neighbour, which ends beside the point.
    let above = |(_, contact)| match contact {
        Contact::Covers(height) if height > seen_m => Some(height),
        _ => None,
    };
    let contacts = contacts(triangles, &rising, p, rules);
    let mut heights: Vec<f64> = contacts.filter_map(above).collect();
    heights.sort_unstable_by(f64::total_cmp);
    // Triangles that meet over the point are one sheet.
    heights.dedup_by(|a, b| *a - *b <= depth_m);
    heights.len()
}

/// Whether any of `triangle` lies above `height_m` and within `reach_m` of the line through `p`.
fn may_cover(triangle: &Triangle, p: [f64; 2], height_m: f64, reach_m: f64) -> bool {
    triangle.iter().any(|corner| corner[2] > height_m) && may_touch(triangle, p, reach_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::Placement;
    use crate::file_mesh::FileMesh;
    use crate::placement::Transform;

    /// A body of revolution: its outline's radii and heights, mm, counterclockwise about its inside.
    fn turned(outline: &[[f64; 2]]) -> Surface {
        placed(triangles_of(outline))
    }

    fn triangles_of(outline: &[[f64; 2]]) -> Vec<Triangle> {
        const SECTORS: usize = 48;
        let at = |[r, z]: [f64; 2], k: usize| {
            let (sin, cos) =
                (std::f64::consts::TAU * (k % SECTORS) as f64 / SECTORS as f64).sin_cos();
            [r * cos, r * sin, z]
        };
        let mut triangles: Vec<Triangle> = Vec::new();
        for (i, a) in outline.iter().enumerate() {
            let b = outline[(i + 1) % outline.len()];
            for k in 0..SECTORS {
                let [p, q, r, s] = [at(*a, k), at(*a, k + 1), at(b, k + 1), at(b, k)];
                triangles.extend([[p, q, r], [p, r, s]]);
            }
        }
        triangles
    }

    fn placed(triangles: Vec<Triangle>) -> Surface {
        let file = FileMesh {
            triangles,
            coordinate_rounding: 6.5e-7,
            ..FileMesh::default()
        };
        let placed = Transform::new(1e-3, &Placement::default());
        Surface::Mesh(Mesh::place(file, &placed).unwrap())
    }

    #[test]
    fn what_lies_under_other_parts_is_hidden() {
        // A washer countersunk from both ends: nothing that faces up is covered.
        let washer = turned(&[
            [6.5, 0.0],
            [6.5, 5.3],
            [4.1, 5.3],
            [3.35, 4.55],
            [3.35, 0.75],
            [4.1, 0.0],
        ]);
        let found = Hidden::of(&washer).unwrap();
        assert!(found.of_upward.unwrap() < 1e-3, "{found:?}");
        // A mushroom: of the foot's upper side, from 2 to 5, all lies under the cap of radius 6.
        let mushroom = turned(&[
            [5.0, 0.0],
            [5.0, 1.0],
            [2.0, 1.0],
            [2.0, 4.0],
            [6.0, 4.0],
            [6.0, 5.0],
            [0.1, 5.0],
            [0.1, 0.0],
        ]);
        let found = Hidden::of(&mushroom).unwrap();
        let share = (25.0 - 4.0) / (25.0 - 4.0 + 36.0 - 0.01);
        assert!(
            (found.of_upward.unwrap() - share).abs() < 0.01,
            "{found:?} {share}"
        );
        // The walls of foot and stem under the cap counted as seen: 2 r h of each, beside r^2 of what is level.
        let [level, walls] = [25.0 + 21.0 + 32.0, 2.0 * (5.0 + 2.0 * 3.0)];
        let seen = 36.0 + 2.0 * (6.0 + 0.1 * 5.0);
        let share = (level + walls) / (level + walls + seen);
        assert!((found.of_area - share).abs() < 0.01, "{found:?} {share}");
    }

    /// Within reach of its upper border a steep facet hid its neighbour.
    #[test]
    fn steep_facets_of_a_coarse_file_hide_nothing() {
        let at = |x: f64, y: f64| [x, y, 50.0 + 20.0 * x];
        let [a, b, c, d] = [at(0.0, 0.0), at(2.0, 0.0), at(2.0, 2.0), at(0.0, 2.0)];
        let file = FileMesh {
            triangles: vec![[a, b, c], [a, c, d]],
            coordinate_rounding: 6e-3,
            ..FileMesh::default()
        };
        let placed = Transform::new(1e-3, &Placement::default());
        let surface = Surface::Mesh(Mesh::place(file, &placed).unwrap());
        assert_eq!(Hidden::of(&surface).unwrap().of_area, 0.0);
    }

    /// Of two bodies side by side, one inside out, half of what faces up was an undercut, and the volume nothing; a cavity's
    /// triangles look into it.
    #[test]
    fn regression_one_body_inside_out_hid_the_other() {
        let cube = |side: f64, at: [f64; 3], inside_out: bool| {
            let outline = [
                [0.01 * side, 0.0],
                [side, 0.0],
                [side, side],
                [0.01 * side, side],
            ];
            let mut triangles = triangles_of(&outline);
            for triangle in &mut triangles {
                *triangle = triangle.map(|corner| [0, 1, 2].map(|i| corner[i] + at[i]));
                if inside_out {
                    triangle.swap(0, 1);
                }
            }
            triangles
        };
        let volume = |triangles: &[Triangle]| {
            let names = weld(triangles, 0.0);
            Sides::new(triangles, parts(&names)).volume
        };
        let one = volume(&cube(10.0, [0.0; 3], false));
        for (at, upward, share) in [
            // Beside it, and a smaller one over it.
            ([30.0, 0.0, 0.0], 0.0, 1.0),
            ([0.0, 0.0, 20.0], 0.09 / 1.09, 0.027),
        ] {
            for turned in [[false, true], [true, false], [true, true]] {
                let side = if upward > 0.0 { 3.0 } else { 10.0 };
                let other = cube(side, at, turned[1]);
                let both = [cube(10.0, [0.0; 3], turned[0]), other].concat();
                let right = one * (1.0 + share);
                assert!((volume(&both) / right - 1.0).abs() < 1e-12);
                let found = Hidden::of(&placed(both)).unwrap();
                let off = found.of_upward.unwrap() - upward;
                assert!(off.abs() < 0.01, "{found:?} {upward}");
            }
        }
        // Hollow bodies: right, inside out, beside others; with a body in the cavity; a body in another, or partly.
        let at = |x: f64, z: f64| [x, 0.0, z];
        let hollow = |x: f64, out: bool| {
            let cavity = cube(3.0, at(x, 3.0), !out);
            [cube(10.0, at(x, 0.0), out), cavity].concat()
        };
        let right = one * (1.0 - 0.027);
        let other = |out: bool| cube(10.0, at(30.0, 0.0), out);
        let within = |out: bool| cube(1.0, at(0.0, 4.0), out);
        let poking = |out: bool| cube(3.0, at(0.0, 9.0), out);
        for out in [false, true] {
            for (triangles, expected) in [
                (hollow(0.0, out), right),
                ([hollow(0.0, out), other(false)].concat(), right + one),
                ([hollow(0.0, out), other(true)].concat(), right + one),
                ([hollow(0.0, out), hollow(30.0, !out)].concat(), 2.0 * right),
                (
                    [hollow(0.0, out), within(true)].concat(),
                    right + 1e-3 * one,
                ),
                (
                    [hollow(0.0, out), within(false)].concat(),
                    right + 1e-3 * one,
                ),
                (
                    [cube(10.0, at(0.0, 0.0), out), poking(true)].concat(),
                    1.027 * one,
                ),
                (
                    [cube(10.0, at(0.0, 0.0), out), poking(false)].concat(),
                    1.027 * one,
                ),
            ] {
                let found = volume(&triangles);
                assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
            }
            let found = Hidden::of(&placed(hollow(0.0, out))).unwrap();
            let share = found.of_upward.unwrap();
            assert!((share - 0.09 / 1.09).abs() < 0.01, "{found:?}");
        }
    }

    /// Facets turned round made half of a box's upper side an undercut.
    #[test]
    fn facets_that_look_to_different_sides_hide_no_more() {
        let mixed = |outline: &[[f64; 2]], closed: bool| {
            let mut triangles = triangles_of(outline);
            if !closed {
                triangles.remove(7);
            }
            for triangle in triangles.iter_mut().step_by(2) {
                triangle.swap(0, 1);
            }
            Hidden::of(&placed(triangles)).unwrap()
        };
        let washer = [[6.5, 0.0], [6.5, 5.3], [3.35, 5.3], [3.35, 0.0]];
        let found = mixed(&washer, true);
        assert!(
            found.of_upward.unwrap() < 1e-3 && found.of_area > 0.15,
            "{found:?}"
        );
        assert_eq!(found.warning(), None);
        // Of two sheets that do not meet the upper one looking down covered nothing.
        let sheet = |half: f64, z: f64, up: bool| {
            let corner = |x: f64, y: f64| [half * x, half * y, z];
            let [a, b] = [corner(-1.0, -1.0), corner(1.0, -1.0)];
            let [c, d] = [corner(1.0, 1.0), corner(-1.0, 1.0)];
            let facets = [[a, b, c], [a, c, d]];
            if up {
                facets
            } else {
                facets.map(|[p, q, r]| [q, p, r])
            }
        };
        for (upper, lower, upward) in [
            (true, true, Some(0.2)),
            (false, true, None),
            (true, false, None),
            (false, false, Some(0.2)),
        ] {
            let sheets = [sheet(20.0, 10.0, upper), sheet(40.0, 0.0, lower)].concat();
            let found = Hidden::of(&placed(sheets)).unwrap();
            assert_eq!(found.of_upward.is_some(), upward.is_some(), "{found:?}");
            let off = found.of_upward.unwrap_or(0.2) - 0.2;
            assert!(
                off.abs() < 0.01 && (found.of_area - 0.2).abs() < 0.01,
                "{found:?}"
            );
        }
        // Closed but for the last bits of its vertices, its facets turned round, it was open.
        let ball = |shift: f64| {
            let mut triangles = triangles_of(&washer);
            for (k, triangle) in triangles.iter_mut().enumerate() {
                if k % 2 == 1 {
                    triangle.swap(0, 1);
                    triangle[0][0] += shift;
                }
            }
            Hidden::of(&placed(triangles)).unwrap().of_upward
        };
        assert!(ball(0.0).unwrap() < 1e-3 && ball(1e-14).unwrap() < 1e-3);
        // An unknown share was reported as none, without a warning.
        let open = mixed(&washer, false);
        assert_eq!(open.of_upward, None);
        assert!(open.warning().unwrap().contains("unknown"), "{open:?}");
        let mushroom = [
            [5.0, 0.0],
            [5.0, 1.0],
            [2.0, 1.0],
            [2.0, 4.0],
            [6.0, 4.0],
            [6.0, 5.0],
            [0.1, 5.0],
            [0.1, 0.0],
        ];
        let plain = Hidden::of(&turned(&mushroom)).unwrap();
        let found = mixed(&mushroom, true);
        assert!(
            (found.of_upward.unwrap() - plain.of_upward.unwrap()).abs() < 2e-3,
            "{found:?} {plain:?}"
        );
    }
}
