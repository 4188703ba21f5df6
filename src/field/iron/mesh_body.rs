//! A body bounded by flat facets, such as a yoke from a CAD program.

use super::face::{Curve, Face, Point};
use fluxform_numerics::nearest_triangle::Tree;
use fluxform_numerics::solid_angle::turns_about;
use fluxform_numerics::vec3::{cross, dot, minus, norm, plus};

/// Facets that turn by less at their common edge are pieces of something smooth (30 degrees), cosine.
const SMOOTH: f64 = 0.866;
/// Two facets are one plane piece where their far corners are no farther from each other's plane, relative to the
/// body's size: STL files state seven digits.
const LEVEL: f64 = 1e-6;
/// Largest cosine at a corner of two facets that are taken as one quadrangle.
const NARROW: f64 = 0.95;

/// A closed surface of flat facets, and the body inside.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshBody {
    vertices_m: Vec<Point>,
    /// Corners anticlockwise as seen from outside.
    facets: Vec<[u32; 3]>,
    tree: Tree,
    ends_m: [Point; 2],
    thickness_m: f64,
}

/// An edge of a facet: the other facet there, and its corner off the edge; whether the body bends there.
#[derive(Debug, Clone, Copy)]
struct Neighbour {
    facet: usize,
    far: u32,
    sharp: bool,
}

impl MeshBody {
    /// The body inside `facets`, which are closed and look outwards; corners in m.
    #[must_use]
    pub fn new(vertices_m: &[Point], facets: Vec<[u32; 3]>) -> Self {
        let triangle = |facet: &[u32; 3]| facet.map(|k| vertices_m[k as usize]);
        let triangles: Vec<[Point; 3]> = facets.iter().map(triangle).collect();
        let mut ends_m = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for corner in triangles.as_flattened() {
            for k in 0..3 {
                ends_m[0][k] = ends_m[0][k].min(corner[k]);
                ends_m[1][k] = ends_m[1][k].max(corner[k]);
            }
        }
        let inwards = |t: &[Point; 3]| inwards_m(t, &triangles);
        let thickness_m = triangles.iter().map(inwards).fold(f64::INFINITY, f64::min);
        Self {
            tree: Tree::new(&triangles),
            thickness_m,
            ends_m,
            vertices_m: vertices_m.to_vec(),
            facets,
        }
    }

    /// Its corners, m.
    #[must_use]
    pub fn vertices_m(&self) -> &[Point] {
        &self.vertices_m
    }

    /// Corners of every facet, anticlockwise as seen from outside.
    #[must_use]
    pub fn facets(&self) -> &[[u32; 3]] {
        &self.facets
    }

    /// The least way through it from the middle of a facet, along the facet's normal, m.
    #[must_use]
    pub fn thickness_m(&self) -> f64 {
        self.thickness_m
    }

    fn corners_m(&self, facet: usize) -> [Point; 3] {
        self.facets[facet].map(|k| self.vertices_m[k as usize])
    }

    /// Distance of a place from its surface, m; below nothing inside.
    #[must_use]
    pub fn distance_m(&self, place_m: Point) -> f64 {
        let (distance, _) = self.tree.nearest(place_m);
        let [low, high] = self.ends_m;
        let within = (0..3).all(|k| (low[k]..=high[k]).contains(&place_m[k]));
        let triangles = (0..self.facets.len()).map(|facet| self.corners_m(facet));
        if within && turns_about(triangles, place_m) > 0.5 {
            -distance
        } else {
            distance
        }
    }

    /// Its surface: pairs of facets in one plane as quadrangles, the others as three each.
    #[must_use]
    pub fn faces(&self) -> Vec<Face> {
        let neighbours = self.neighbours();
        let mut alone = vec![true; self.facets.len()];
        let mut faces = Vec::new();
        for (first, side) in self.pairs(&neighbours) {
            let other = neighbours[first][side];
            if !alone[first] || !alone[other.facet] {
                continue;
            }
            (alone[first], alone[other.facet]) = (false, false);
            faces.push(self.quadrangle(&neighbours, first, side));
        }
        let alone: Vec<usize> = (0..self.facets.len())
            .filter(|facet| alone[*facet] && self.area_m2(*facet) > 0.0)
            .collect();
        let triangles: Vec<[Point; 3]> = alone.iter().map(|k| self.corners_m(*k)).collect();
        let sharp = |number: usize, side: usize| neighbours[alone[number]][side].sharp;
        faces.extend(mesh(&triangles, 1.0, sharp));
        faces.into_iter().map(Face::facet).collect()
    }

    fn normal(&self, facet: usize) -> Point {
        let [a, b, c] = self.corners_m(facet);
        let normal = cross(minus(b, a), minus(c, a));
        let long = norm(normal);
        normal.map(|n| if long > 0.0 { n / long } else { 0.0 })
    }

    fn area_m2(&self, facet: usize) -> f64 {
        let [a, b, c] = self.corners_m(facet);
        0.5 * norm(cross(minus(b, a), minus(c, a)))
    }

    /// Of every facet those at its three edges.
    fn neighbours(&self) -> Vec<[Neighbour; 3]> {
        let mut sides: Vec<([u32; 2], usize, usize)> = Vec::new();
        for (number, facet) in self.facets.iter().enumerate() {
            for side in 0..3 {
                let (a, b) = (facet[side], facet[(side + 1) % 3]);
                sides.push(([a.min(b), a.max(b)], number, side));
            }
        }
        sides.sort_unstable();
        let none = Neighbour {
            facet: 0,
            far: 0,
            sharp: true,
        };
        let mut out = vec![[none; 3]; self.facets.len()];
        for pair in sides.chunks_exact(2) {
            let [(_, f, i), (_, g, j)] = [pair[0], pair[1]];
            let sharp = dot(self.normal(f), self.normal(g)) < SMOOTH;
            for (at, side, other, across) in [(f, i, g, j), (g, j, f, i)] {
                out[at][side] = Neighbour {
                    facet: other,
                    far: self.facets[other][(across + 2) % 3],
                    sharp,
                };
            }
        }
        out
    }

    /// Corners of the quadrangle of a facet and its neighbour at a side: from the facet's far corner on.
    fn round_m(&self, neighbours: &[[Neighbour; 3]], facet: usize, side: usize) -> [Point; 4] {
        let own = self.facets[facet];
        let corners = [
            own[(side + 2) % 3],
            own[side],
            neighbours[facet][side].far,
            own[(side + 1) % 3],
        ];
        corners.map(|k| self.vertices_m[k as usize])
    }

    /// Facets with the side at which they and the next make a convex plane quadrangle, best first.
    fn pairs(&self, neighbours: &[[Neighbour; 3]]) -> Vec<(usize, usize)> {
        let size = norm(minus(self.ends_m[1], self.ends_m[0]));
        let mut out: Vec<(f64, usize, usize)> = Vec::new();
        for facet in 0..self.facets.len() {
            let normal = self.normal(facet);
            for side in 0..3 {
                let other = neighbours[facet][side].facet;
                let corners = self.round_m(neighbours, facet, side);
                let off = |of: usize, corner: Point| {
                    dot(self.normal(of), minus(corner, corners[1])).abs() > LEVEL * size
                };
                if facet > other
                    || neighbours[facet][side].sharp
                    || off(facet, corners[2])
                    || off(other, corners[0])
                {
                    continue;
                }
                let mut worst = 0.0_f64;
                for k in 0..4 {
                    let to = |at: usize| minus(corners[at % 4], corners[k]);
                    let (next, before) = (to(k + 1), to(k + 3));
                    let size = norm(next) * norm(before);
                    let turn = dot(normal, cross(next, before)) / size;
                    let cosine = (dot(next, before) / size).abs();
                    worst = worst.max(if turn > 0.0 { cosine } else { 1.0 });
                }
                if worst < NARROW {
                    out.push((worst, facet, side));
                }
            }
        }
        out.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        out.into_iter()
            .map(|(_, facet, side)| (facet, side))
            .collect()
    }

    fn quadrangle(&self, neighbours: &[[Neighbour; 3]], facet: usize, side: usize) -> Face {
        let [a, b, c, d] = self.round_m(neighbours, facet, side);
        let other = neighbours[facet][side].facet;
        // Where the other facet's side from b to c begins.
        let from = self.facets[facet][side];
        let start = self.facets[other].iter().position(|k| *k == from);
        let start = start.expect("both facets have the ends of their side");
        let sharp = |facet: usize, side: usize| neighbours[facet][side % 3].sharp;
        let outside = plus(a, self.normal(facet));
        Face::ruled(
            Curve::segment(a, b),
            Curve::segment(d, c),
            [
                sharp(facet, side + 1),
                sharp(other, start),
                sharp(facet, side + 2),
                sharp(other, start + 1),
            ],
            outside,
        )
    }
}

/// The way from the middle of one of `triangles` along its normal into the body, to the next, m.
fn inwards_m(from: &[Point; 3], triangles: &[[Point; 3]]) -> f64 {
    let [a, b, c] = *from;
    let normal = cross(minus(b, a), minus(c, a));
    let long = norm(normal);
    let at: Point = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
    let way = normal.map(|n| -n / long);
    let hit = |[a, b, c]: &[Point; 3]| {
        let (u, v) = (minus(*b, *a), minus(*c, *a));
        let across = cross(way, v);
        let determinant = dot(u, across);
        let to = minus(at, *a);
        let share = dot(to, across) / determinant;
        let other = cross(to, u);
        let rest = dot(way, other) / determinant;
        let inside = share >= 0.0 && rest >= 0.0 && share + rest <= 1.0;
        Some(dot(v, other) / determinant).filter(|far| inside && *far > 0.0)
    };
    // Its own triangle is at nothing but for rounding.
    let least = LEVEL * long.sqrt();
    let hits = triangles.iter().filter_map(hit);
    hits.filter(|far| *far > least)
        .fold(f64::INFINITY, f64::min)
}

/// A closed mesh's triangles, corners in m, each as three quadrangles; edges at which it bends are graded to.
#[must_use]
pub fn mesh(
    triangles: &[[Point; 3]],
    outward: f64,
    is_sharp: impl Fn(usize, usize) -> bool,
) -> Vec<Face> {
    let mut faces = Vec::new();
    for (number, corners) in triangles.iter().enumerate() {
        let half = |a: Point, b: Point| std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
        let [a, b, c] = *corners;
        let centre = std::array::from_fn(|i| (a[i] + b[i] + c[i]) / 3.0);
        let normal = cross(minus(b, a), minus(c, a)).map(|n| outward * n);
        for k in 0..3 {
            let (at, next, before) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
            let mut face = Face::ruled(
                Curve::segment(at, half(at, next)),
                Curve::segment(half(at, before), centre),
                [
                    is_sharp(number, (k + 2) % 3),
                    false,
                    is_sharp(number, k),
                    false,
                ],
                centre,
            );
            if dot(face.point(0.5, 0.5).1, normal) < 0.0 {
                face = face.turned();
            }
            faces.push(face);
        }
    }
    faces
}
