//! Triangles that pass through each other, or lie partly on each other.
//!
//! A pair counts when an edge of one pierces the other by more than the file's rounding, or when
//! both lie in one plane and overlap by more than that. Triangles that meet, at a corner, along an
//! edge or where one ends on the other, do not.

use rayon::prelude::*;

use crate::file_mesh::Triangle;
use fluxform_numerics::box_tree::{Box3, BoxTree};
use fluxform_numerics::vec3::{cross, minus};

/// Parts into which the search is cut, about.
const PARTS: usize = 256;
/// Pairs that are looked at in one part, at most, and more for every so many triangles: bodies may
/// lie over each other many times.
const MOST_PAIRS: usize = 8_000;
const TRIANGLES_A_PAIR: usize = 4;

/// The result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Crossings {
    /// Pairs of triangles.
    pub pairs: usize,
    /// Whether all pairs were looked at.
    pub complete: bool,
    /// The pair that comes first in the file.
    pub first: Option<[usize; 2]>,
}

/// `names` holds each triangle's corners, equal where vertices are one; `reach` is the length below
/// which nothing is distinguished.
#[must_use]
pub fn crossings(triangles: &[Triangle], names: &[[u32; 3]], reach: f64) -> Crossings {
    let tree = BoxTree::new(triangles);
    let search = Search {
        triangles,
        names,
        reach,
        tree: &tree,
    };
    let parts = search.parts().into_par_iter();
    let found: Vec<Crossings> = parts.map(|part| search.within(part)).collect();
    let none = Crossings {
        complete: true,
        ..Crossings::default()
    };
    found.into_iter().fold(none, |sum, part| Crossings {
        pairs: sum.pairs + part.pairs,
        complete: sum.complete && part.complete,
        first: match (sum.first, part.first) {
            (Some(a), Some(b)) => Some(a.min(b)),
            (a, b) => a.or(b),
        },
    })
}

struct Search<'a> {
    triangles: &'a [Triangle],
    names: &'a [[u32; 3]],
    reach: f64,
    tree: &'a BoxTree,
}

impl Search<'_> {
    /// Pairs of boxes that together hold every pair of triangles whose boxes meet.
    fn parts(&self) -> Vec<[usize; 2]> {
        let mut parts = Vec::new();
        if !self.tree.nodes.is_empty() {
            parts.push([0, 0]);
        }
        while parts.len() < PARTS {
            let mut finer = Vec::new();
            for part in &parts {
                if !self.halve(*part, &mut |pair| finer.push(pair)) {
                    finer.push(*part);
                }
            }
            if finer == parts {
                break;
            }
            parts = finer;
        }
        parts
    }

    /// Gives the pairs of children whose boxes meet; false for two leaves.
    fn halve(&self, [a, b]: [usize; 2], give: &mut dyn FnMut([usize; 2])) -> bool {
        let nodes = &self.tree.nodes;
        let children = |k: usize| match nodes[k].range {
            None => vec![k + 1, nodes[k].right],
            Some(_) => vec![k],
        };
        let (left, right) = (children(a), children(b));
        if left.len() == 1 && right.len() == 1 {
            return false;
        }
        for (i, &p) in left.iter().enumerate() {
            let from = if a == b { i } else { 0 };
            for &q in &right[from..] {
                if meet(&nodes[p].bounds, &nodes[q].bounds) {
                    give([p, q]);
                }
            }
        }
        true
    }

    fn within(&self, part: [usize; 2]) -> Crossings {
        let mut found = Crossings {
            complete: true,
            ..Crossings::default()
        };
        let mut looked = 0;
        let mut open = vec![part];
        while let Some([a, b]) = open.pop() {
            fluxform_base::progress::poll();
            if self.halve([a, b], &mut |pair| open.push(pair)) {
                continue;
            }
            let members = |k: usize| {
                let [from, to] = self.tree.nodes[k].range.unwrap_or([0, 0]);
                &self.tree.order[from..to]
            };
            for (at, &p) in members(a).iter().enumerate() {
                let from = if a == b { at + 1 } else { 0 };
                for &q in &members(b)[from..] {
                    looked += 1;
                    let pair = [p.min(q) as usize, p.max(q) as usize];
                    if self.cross(pair) {
                        found.pairs += 1;
                        found.first = Some(found.first.map_or(pair, |first| first.min(pair)));
                    }
                }
            }
            if looked > MOST_PAIRS + self.triangles.len() / TRIANGLES_A_PAIR {
                found.complete = false;
                break;
            }
        }
        found
    }

    fn cross(&self, pair: [usize; 2]) -> bool {
        let [p, q] = pair.map(|k| &self.triangles[k]);
        if !meet(&bounds(p), &bounds(q)) {
            return false;
        }
        let [mine, other] = pair.map(|k| self.names[k]);
        // The same three corners are reported as a duplicate.
        if mine.iter().all(|name| other.contains(name)) {
            return false;
        }
        let Some(planes) = Plane::of(p).zip(Plane::of(q)) else {
            return false;
        };
        let heights = [p.map(|v| planes.1.height(v)), q.map(|v| planes.0.height(v))];
        let level = |heights: &[f64; 3]| heights.iter().all(|h| h.abs() <= self.reach);
        if level(&heights[0]) || level(&heights[1]) {
            return self.overlap(p, q, &planes.1) && self.overlap(q, p, &planes.0);
        }
        self.pierces(p, &heights[0], q, &planes.1) || self.pierces(q, &heights[1], p, &planes.0)
    }

    /// Whether an edge of `p`, its corners so high over the plane of `q`, passes through `q`.
    fn pierces(&self, p: &Triangle, heights: &[f64; 3], q: &Triangle, plane: &Plane) -> bool {
        (0..3).any(|k| {
            let (from, to) = (k, (k + 1) % 3);
            let (h, g) = (heights[from], heights[to]);
            let through = h.min(g) < -self.reach && h.max(g) > self.reach;
            through && {
                let t = h / (h - g);
                let at = [0, 1, 2].map(|i| p[from][i] + t * (p[to][i] - p[from][i]));
                plane
                    .sides(q)
                    .iter()
                    .all(|side| side.height(at) > self.reach)
            }
        })
    }

    /// Whether no side of `q`, which has this plane, has all of `p` outside.
    fn overlap(&self, p: &Triangle, q: &Triangle, plane: &Plane) -> bool {
        let sides = plane.sides(q);
        let outside = |side: &Plane| p.iter().all(|v| side.height(*v) <= self.reach);
        !sides.iter().any(outside)
    }
}

#[derive(Clone, Copy)]
struct Plane {
    through: [f64; 3],
    normal: [f64; 3],
}

impl Plane {
    fn of(&[a, b, c]: &Triangle) -> Option<Self> {
        Self::new(a, cross(minus(b, a), minus(c, a)))
    }

    fn new(through: [f64; 3], normal: [f64; 3]) -> Option<Self> {
        let length = normal[0].hypot(normal[1]).hypot(normal[2]);
        (length > 0.0).then(|| Self {
            through,
            normal: normal.map(|c| c / length),
        })
    }

    fn height(&self, p: [f64; 3]) -> f64 {
        let d = minus(p, self.through);
        d[0] * self.normal[0] + d[1] * self.normal[1] + d[2] * self.normal[2]
    }

    /// The planes through the triangle's sides, upright on it, heights positive inside.
    fn sides(&self, triangle: &Triangle) -> [Self; 3] {
        [0, 1, 2].map(|k| {
            let along = minus(triangle[(k + 1) % 3], triangle[k]);
            // A triangle with a plane has sides of some length.
            Self::new(triangle[k], cross(self.normal, along)).unwrap_or(*self)
        })
    }
}

fn bounds(triangle: &Triangle) -> Box3 {
    let fold = |pick: fn(f64, f64) -> f64| {
        let [a, b, c] = triangle;
        [0, 1, 2].map(|k| pick(pick(a[k], b[k]), c[k]))
    };
    [fold(f64::min), fold(f64::max)]
}

fn meet(a: &Box3, b: &Box3) -> bool {
    (0..3).all(|k| a[0][k] <= b[1][k] && b[0][k] <= a[1][k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_finds_the_pairs_that_all_against_all_find() {
        let mut random = fluxform_numerics::random::Random::new(11);
        let mut next = |width: f64| width * random.unit();
        let triangles: Vec<Triangle> = (0..600)
            .map(|_| {
                let at = [next(1.0), next(1.0), next(1.0)];
                [0; 3].map(|_| at.map(|c| c + next(0.17)))
            })
            .collect();
        let names: Vec<[u32; 3]> = (0..600).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mut pairs = Vec::new();
        for i in 0..triangles.len() {
            for j in i + 1..triangles.len() {
                let two = crossings(&[triangles[i], triangles[j]], &[names[i], names[j]], 1e-9);
                if two.pairs == 1 {
                    pairs.push([i, j]);
                }
            }
        }
        let found = crossings(&triangles, &names, 1e-9);
        assert!(pairs.len() > 30, "{}", pairs.len());
        assert!(found.complete);
        assert_eq!(
            (found.pairs, found.first),
            (pairs.len(), pairs.first().copied())
        );
    }

    #[test]
    fn what_enters_by_no_more_than_the_reach_only_touches() {
        let base = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]];
        for reach in [0.0, 0.25] {
            for (into, pairs) in [(-0.5, 0), (0.0, 0), (reach, 0), (reach + 0.125, 1)] {
                // An upright triangle whose side stands so far within the border of the other.
                let upright = [[1.0, into, -1.0], [1.0, into, 1.0], [1.0, -3.0, 0.5]];
                let found = crossings(&[base, upright], &[[0, 1, 2], [3, 4, 5]], reach);
                assert_eq!(found.pairs, pairs, "{reach} {into}");
            }
        }
    }
}
