//! Which side of closed parts their triangles look to: outwards, into a cavity, or the wrong way.

use crate::file_mesh::Triangle;
use fluxform_numerics::vec3::{cross, dot, minus};

/// Pairs of parts that are looked at, and comparisons of a place with a triangle, about: a second of one core each. Of
/// what is left over no part lies in another.
const MOST_PAIRS: usize = 100_000_000;
const MOST_COMPARED: usize = 500_000_000;

/// The parts of a closed surface.
pub(super) struct Sides {
    /// Of every triangle.
    part_of: Vec<u32>,
    /// Of every part whether its triangles look to the wrong side.
    turned: Vec<bool>,
    /// The volume that all enclose.
    pub(super) volume: f64,
}

/// Triangles that share no vertex with others.
struct Part {
    triangles: Vec<u32>,
    /// Six times the volume, negative where they look inwards.
    six_volumes: f64,
    bounds: [[f64; 2]; 3],
    /// Middles of the triangles that lie farthest along each axis either way.
    places: [[f64; 3]; 6],
}

impl Sides {
    /// Of `parts`: which of them every triangle is of, and how many they are.
    ///
    /// A part that lies in no other bounds a body, as one in a cavity does. One within a body bounds a cavity where its
    /// triangles look the other way than the body's, else a body too.
    pub(super) fn new(triangles: &[Triangle], (part_of, count): (Vec<u32>, usize)) -> Self {
        let mut of_part = vec![Vec::new(); count];
        for (k, part) in part_of.iter().enumerate() {
            of_part[*part as usize].push(k as u32);
        }
        let parts = of_part.into_iter().map(|of| Part::new(triangles, of));
        let parts: Vec<Part> = parts.collect();
        let around = around(triangles, &parts);
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|part| around[*part].len());
        let (mut turned, mut is_cavity) = (vec![false; count], vec![false; count]);
        let mut six_volumes = 0.0;
        for part in order {
            let outer = around[part]
                .iter()
                .max_by_key(|outer| around[**outer].len());
            let inward = parts[part].six_volumes < 0.0;
            is_cavity[part] = outer.is_some_and(|outer| {
                !is_cavity[*outer] && inward != (parts[*outer].six_volumes < 0.0)
            });
            turned[part] = inward != is_cavity[part];
            let size = parts[part].six_volumes.abs();
            six_volumes += if is_cavity[part] { -size } else { size };
        }
        Self {
            part_of,
            turned,
            volume: six_volumes / 6.0,
        }
    }

    /// Whether a triangle looks to the wrong side.
    pub(super) fn is_turned(&self, triangle: usize) -> bool {
        self.turned[self.part_of[triangle] as usize]
    }

    /// How many parts there are, and how many of them look to the wrong side.
    pub(super) fn counts(&self) -> [usize; 2] {
        let turned = self.turned.iter().filter(|turned| **turned);
        [self.turned.len(), turned.count()]
    }
}

impl Part {
    fn new(all: &[Triangle], triangles: Vec<u32>) -> Self {
        let from = all[triangles[0] as usize][0];
        let mut six_volumes = 0.0;
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        let mut places = [[0.0; 3]; 6];
        let mut farthest = [f64::NEG_INFINITY; 6];
        for k in &triangles {
            let triangle = &all[*k as usize];
            let [a, b, c] = triangle.map(|corner| minus(corner, from));
            six_volumes += dot(a, cross(b, c));
            for corner in triangle {
                for (ends, at) in bounds.iter_mut().zip(corner) {
                    *ends = [ends[0].min(*at), ends[1].max(*at)];
                }
            }
            let middle =
                [0, 1, 2].map(|i| triangle.iter().map(|corner| corner[i]).sum::<f64>() / 3.0);
            for (way, (place, farthest)) in places.iter_mut().zip(&mut farthest).enumerate() {
                let along = if way < 3 {
                    middle[way]
                } else {
                    -middle[way - 3]
                };
                if along > *farthest {
                    (*place, *farthest) = (middle, along);
                }
            }
        }
        Self {
            triangles,
            six_volumes,
            bounds,
            places,
        }
    }
}

/// The parts around each: those whose box and whose inside hold it wholly.
fn around(triangles: &[Triangle], parts: &[Part]) -> Vec<Vec<usize>> {
    let mut around = vec![Vec::new(); parts.len()];
    let mut left = MOST_COMPARED;
    if parts.len() > MOST_PAIRS / parts.len().max(1) {
        return around;
    }
    for (inner, around) in parts.iter().zip(&mut around) {
        fluxform_base::progress::poll();
        for (outer, part) in parts.iter().enumerate() {
            let ends = inner.bounds.iter().zip(&part.bounds);
            let boxed =
                |(inner, outer): (&[f64; 2], &[f64; 2])| inner[0] > outer[0] && inner[1] < outer[1];
            if !ends.into_iter().all(boxed) {
                continue;
            }
            let mut inside = |place: &[f64; 3]| {
                let Some(rest) = left.checked_sub(part.triangles.len()) else {
                    return false;
                };
                left = rest;
                let over = part
                    .triangles
                    .iter()
                    .filter(|k| lies_over(&triangles[**k as usize], *place));
                !over.count().is_multiple_of(2)
            };
            if inner.places.iter().all(&mut inside) {
                around.push(outer);
            }
        }
    }
    around
}

/// Whether a triangle lies over a place; one of two that meet over it counts.
fn lies_over([a, b, c]: &Triangle, [x, y, z]: [f64; 3]) -> bool {
    let apart = |i: usize, at: f64| at < a[i].min(b[i]).min(c[i]) || at > a[i].max(b[i]).max(c[i]);
    if apart(0, x) || apart(1, y) {
        return false;
    }
    let mut crossed = false;
    for [p, q] in [[a, b], [b, c], [c, a]] {
        if (p[1] > y) != (q[1] > y) && x < p[0] + (y - p[1]) / (q[1] - p[1]) * (q[0] - p[0]) {
            crossed = !crossed;
        }
    }
    let normal = cross(minus(*b, *a), minus(*c, *a));
    crossed && normal[2] != 0.0 && {
        let rise = normal[0] * (x - a[0]) + normal[1] * (y - a[1]);
        a[2] - rise / normal[2] > z
    }
}
