//! Flags of a point: on a wall, a rim, a crease, under or over other sheets.

use serde::{Deserialize, Serialize};

use crate::file_mesh::Triangle;
use crate::height::{Sample, sample_of};
use crate::vertical_hit::{Contact, Seen, WALL_NORMAL_Z, may_touch, upward_normal};
use fluxform_numerics::vec3::{dot, minus};

/// Faces that turn by less are neighbours on a curved surface, degrees.
pub const CREASE_DEG: f64 = 20.0;
/// Angles nearer than this are equal, rad.
const SAME_ANGLE: f64 = 1e-9;
/// Heights nearer than this times the larger one are the same sheet.
const SAME_HEIGHT: f64 = 1e-9;

/// Flags of a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Marks {
    /// A vertical wall passes through it; the height is the wall's top.
    pub wall: bool,
    /// The surface ends there in some direction.
    pub rim: bool,
    /// Normal of the other face where two meet at more than [`CREASE_DEG`].
    pub crease: Option<[f64; 3]>,
    /// Heights at which the vertical line meets the surface; a closed body has two.
    pub layers: u32,
    /// More layers than a body without overhang has.
    pub overhang: bool,
    /// There is no surface: the height was filled in from around the hole.
    pub filled: bool,
}

impl Marks {
    /// A point on a single sheet, away from its borders.
    pub const PLAIN: Self = Self {
        wall: false,
        rim: false,
        crease: None,
        layers: 1,
        overhang: false,
        filled: false,
    };
}

/// What a user should know where a body is open: through a hole in its top the height is that of its underside.
#[must_use]
pub fn single_sheets(marks: &[Marks]) -> Option<String> {
    let inside = || {
        let inner = |marks: &&Marks| !(marks.wall || marks.rim || marks.filled);
        marks.iter().filter(inner)
    };
    let single = inside().filter(|marks| marks.layers == 1).count();
    // Two are an overhang where the whole is open; at the rim of what is closed they are one by rounding.
    let two = |marks: &&Marks| marks.layers == 2 && marks.overhang;
    let of_bodies = inside().filter(two).count();
    (single > 0 && of_bodies > single).then(|| {
        format!(
            "{single} points lie on a single sheet and {of_bodies} on a body's two: where the body has a hole, \
             the height is that of what is seen through it (--inspect counts open edges); mend the mesh, or \
             leave the underside out and take --holes fill"
        )
    })
}

/// Data common to all points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    /// How far from an edge a point touches it, m.
    pub(super) reach_m: f64,
    /// Layers of a point without overhang.
    pub(super) plain_layers: u32,
}

/// How often each edge occurs, folded: zero for a closed surface, whatever its orientation.
///
/// Vertices must be equal to the bit; a surface with T-junctions counts as open.
pub(super) fn is_closed(triangles: &[Triangle]) -> bool {
    folded_edges(triangles).0 == 0
}

/// Of a closed surface, whether all triangles look to the same side of it.
pub(super) fn is_oriented(triangles: &[Triangle]) -> bool {
    folded_edges(triangles).1 == 0
}

/// The edges folded, without and with the way that each runs.
fn folded_edges(triangles: &[Triangle]) -> (u64, u64) {
    let mix = |mut z: u64| {
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    let point = |p: [f64; 3]| {
        // Adding 0 turns -0 into 0.
        p.iter().fold(0x9e37_79b9_7f4a_7c15, |h: u64, c| {
            mix(h ^ (c + 0.0).to_bits())
        })
    };
    let (mut folded, mut along) = (0, 0u64);
    for triangle in triangles {
        let [a, b, c] = triangle.map(point);
        for [p, q] in [[a, b], [b, c], [c, a]] {
            let edge = mix(p.wrapping_add(q));
            folded ^= edge;
            along = if p < q {
                along.wrapping_add(edge)
            } else {
                along.wrapping_sub(edge)
            };
        }
    }
    (folded, along)
}

/// Height and marks over `p`, from every triangle that may touch its vertical line.
pub(super) fn at(
    triangles: &[Triangle],
    touching: &[u32],
    p: [f64; 2],
    rules: Rules,
) -> Option<(Sample, Marks)> {
    let contacts: Vec<_> = contacts(triangles, touching, p, rules).collect();
    let sample = sample_of(triangles, &contacts)?;
    Some((sample, of_contacts(triangles, &contacts, p, &sample, rules)))
}

/// As [`at`], without the flags.
pub(super) fn sample_at(
    triangles: &[Triangle],
    touching: &[u32],
    p: [f64; 2],
    rules: Rules,
) -> Option<Sample> {
    let contacts: Vec<_> = contacts(triangles, touching, p, rules).collect();
    sample_of(triangles, &contacts)
}

/// Whether [`sample_at`] has one: a single contact will do.
pub(super) fn is_met(triangles: &[Triangle], touching: &[u32], p: [f64; 2], rules: Rules) -> bool {
    contacts(triangles, touching, p, rules).next().is_some()
}

/// How the triangles among `touching` touch the vertical line through `p`, where they do.
pub(super) fn contacts(
    triangles: &[Triangle],
    touching: &[u32],
    p: [f64; 2],
    Rules { reach_m, .. }: Rules,
) -> impl Iterator<Item = (u32, Contact)> {
    let of = move |&index: &u32| {
        let triangle = &triangles[index as usize];
        let contact =
            may_touch(triangle, p, reach_m).then(|| Seen::new(triangle, reach_m).contact(p))?;
        (contact != Contact::None).then_some((index, contact))
    };
    touching.iter().filter_map(of)
}

fn of_contacts(
    triangles: &[Triangle],
    contacts: &[(u32, Contact)],
    p: [f64; 2],
    sample: &Sample,
    rules: Rules,
) -> Marks {
    let same_m = SAME_HEIGHT * sample.height_m.abs() + 4.0 * rules.reach_m;
    let same = |height: f64| (height - sample.height_m).abs() <= same_m;
    let wall = contacts
        .iter()
        .any(|(_, contact)| matches!(contact, Contact::Wall(_)));
    let mut heights: Vec<f64> = Vec::with_capacity(contacts.len());
    for (_, contact) in contacts {
        if let Contact::Covers(height) = contact {
            heights.push(*height);
        }
    }
    heights.sort_by(f64::total_cmp);
    let steps = heights
        .windows(2)
        .filter(|pair| pair[1] - pair[0] > same_m)
        .count() as u32;
    let covering = if heights.is_empty() { 0 } else { steps + 1 };
    // In a crack, which rounding leaves, the sheet that gives the height does not cover the point.
    let layers = covering + u32::from(!heights.iter().any(|height| same(*height)));
    let crease = contacts
        .iter()
        .filter_map(|(index, contact)| match contact {
            Contact::Covers(height) | Contact::Near(height) if same(*height) => {
                Some(upward_normal(&triangles[*index as usize]))
            }
            _ => None,
        })
        .filter(|normal| normal[2] > WALL_NORMAL_Z)
        // A body's underside meets its top at the rim: that is no crease.
        .filter(|normal| dot(*normal, sample.normal) < CREASE_DEG.to_radians().cos())
        .min_by(|a, b| {
            let key = |n: &[f64; 3]| (dot(*n, sample.normal), *n);
            key(a)
                .partial_cmp(&key(b))
                .unwrap_or(std::cmp::Ordering::Equal)
        });
    let rim = !surrounded(triangles, contacts, p);
    Marks {
        wall,
        rim,
        crease: crease.filter(|_| !rim),
        layers,
        overhang: layers > rules.plain_layers,
        filled: false,
    }
}

/// Whether there is surface in every direction from `p`.
fn surrounded(triangles: &[Triangle], contacts: &[(u32, Contact)], p: [f64; 2]) -> bool {
    let mut sectors: Vec<[f64; 2]> = Vec::new();
    for (index, contact) in contacts {
        if !matches!(contact, Contact::Covers(_)) {
            continue;
        }
        match sector(&triangles[*index as usize], p) {
            None => return true,
            Some(sector) => sectors.push(sector),
        }
    }
    sectors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let Some(first) = sectors.first() else {
        return false;
    };
    let (start, mut end) = (first[0], first[1]);
    for [from, to] in sectors {
        if from > end + SAME_ANGLE {
            return false;
        }
        end = end.max(to);
    }
    end >= start + std::f64::consts::TAU - SAME_ANGLE
}

/// The directions from a point of the triangle's border into it, rad; `None` from inside.
fn sector(triangle: &Triangle, p: [f64; 2]) -> Option<[f64; 2]> {
    let side = |a: [f64; 3], b: [f64; 3]| {
        let coord = |x: f64, y: f64| robust::Coord { x, y };
        robust::orient2d(coord(a[0], a[1]), coord(b[0], b[1]), coord(p[0], p[1]))
    };
    let [a, mut b, mut c] = *triangle;
    let (u, v) = (minus(b, a), minus(c, a));
    if u[0] * v[1] < u[1] * v[0] {
        (b, c) = (c, b);
    }
    let corners = [a, b, c];
    let angle = |to: [f64; 3], from: [f64; 2]| (to[1] - from[1]).atan2(to[0] - from[0]);
    let open = |from: f64, to: f64| {
        [
            from,
            if to < from {
                to + std::f64::consts::TAU
            } else {
                to
            },
        ]
    };
    for k in 0..3 {
        let [here, next, last] = [0, 1, 2].map(|n| corners[(k + n) % 3]);
        if p == [here[0], here[1]] {
            return Some(open(angle(next, p), angle(last, p)));
        }
    }
    for k in 0..3 {
        let [from, to] = [0, 1].map(|n| corners[(k + n) % 3]);
        if side(from, to) == 0.0 {
            let forward = angle(to, [from[0], from[1]]);
            return Some([forward, forward + std::f64::consts::PI]);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Against the places a little beside the point, in every direction.
    #[test]
    fn a_sector_holds_the_directions_that_stay_inside() {
        let mut random = fluxform_numerics::random::Random::new(5);
        let mut next = || random.below(19) as f64 - 9.0;
        let mut looked = 0;
        for _ in 0..200 {
            // Even numbers: the middle of a side is exact.
            let [a, b, c] = [0; 3].map(|_| [2.0 * next(), 2.0 * next(), next()]);
            let (u, v) = (minus(b, a), minus(c, a));
            let twice_area = u[0] * v[1] - u[1] * v[0];
            if twice_area == 0.0 {
                continue;
            }
            let inside = |p: [f64; 2]| {
                [(a, b), (b, c), (c, a)].iter().all(|(q, r)| {
                    let left = (r[0] - q[0]) * (p[1] - q[1]) - (r[1] - q[1]) * (p[0] - q[0]);
                    left * twice_area > 0.0
                })
            };
            let middle = |q: [f64; 3], r: [f64; 3]| [0, 1].map(|k| 0.5 * (q[k] + r[k]));
            let corners = [a, b, c].map(|q| [q[0], q[1]]);
            let borders = [middle(a, b), middle(b, c), middle(c, a)];
            for p in corners.into_iter().chain(borders) {
                let [from, to] = sector(&[a, b, c], p).unwrap();
                assert!(from < to && to - from < TAU);
                for k in 0..90 {
                    let angle = 0.07 + TAU * f64::from(k) / 90.0;
                    let within = (angle - from).rem_euclid(TAU) < to - from;
                    let beside = [p[0] + 1e-3 * angle.cos(), p[1] + 1e-3 * angle.sin()];
                    assert_eq!(inside(beside), within, "{a:?} {b:?} {c:?} {p:?} {angle}");
                    looked += 1;
                }
            }
            let centre = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
            assert!(sector(&[a, b, c], centre).is_none());
        }
        assert!(looked > 50_000, "{looked}");
    }
}
