//! Which side of closed parts their triangles look to: outwards, into a cavity, or inside out.

use crate::file_mesh::Triangle;
use fluxform_numerics::vec3::{cross, dot, minus};

/// Comparisons of a place with a triangle, about: a second of one core.
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

impl Sides {
    /// Of `parts`: which of them every triangle is of, and how many they are.
    ///
    /// A part that counts a negative volume among its fellows bounds a cavity if it lies in an odd number of others, else
    /// it is turned. Too many such parts are taken as cavities.
    pub(super) fn new(triangles: &[Triangle], (part_of, parts): (Vec<u32>, usize)) -> Self {
        let mut six_volumes = vec![0.0; parts];
        let mut largest: Vec<Option<(f64, usize)>> = vec![None; parts];
        let from = triangles.first().map_or([0.0; 3], |triangle| triangle[0]);
        for (k, (triangle, part)) in triangles.iter().zip(&part_of).enumerate() {
            let [a, b, c] = triangle.map(|corner| minus(corner, from));
            let normal = cross(minus(b, a), minus(c, a));
            six_volumes[*part as usize] += dot(a, normal);
            let in_plan = normal[2].abs();
            let largest = &mut largest[*part as usize];
            if largest.is_none_or(|(other, _)| in_plan > other) {
                *largest = Some((in_plan, k));
            }
        }
        let inward = six_volumes.iter().sum::<f64>() < 0.0;
        let against =
            |part: &usize| (six_volumes[*part] < 0.0) != inward && six_volumes[*part] != 0.0;
        let doubtful: Vec<usize> = (0..parts).filter(against).collect();
        let mut turned = vec![inward; parts];
        if doubtful.len() <= MOST_COMPARED / triangles.len().max(1) {
            for part in doubtful {
                fluxform_base::progress::poll();
                let place = largest[part].map(|(_, k)| middle(&triangles[k]));
                let others = triangles.iter().zip(&part_of);
                let others = others.filter(|(_, of)| **of as usize != part);
                let over = |(triangle, _): &(&Triangle, &u32)| {
                    place.is_some_and(|place| lies_over(triangle, place))
                };
                if others.filter(over).count().is_multiple_of(2) {
                    turned[part] = !inward;
                }
            }
        }
        let signed = six_volumes.iter().zip(&turned);
        let volume = signed
            .map(|(six, turned)| if *turned { -six } else { *six } / 6.0)
            .sum();
        Self {
            part_of,
            turned,
            volume,
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

fn middle([a, b, c]: &Triangle) -> [f64; 3] {
    [0, 1, 2].map(|i| (a[i] + b[i] + c[i]) / 3.0)
}

/// Whether a triangle lies over a place; one edge of two that meet over it counts.
fn lies_over([a, b, c]: &Triangle, [x, y, z]: [f64; 3]) -> bool {
    let apart = |least: f64, most: f64, at: f64| at < least || at > most;
    let range = |i: usize| (a[i].min(b[i]).min(c[i]), a[i].max(b[i]).max(c[i]));
    let ((x_from, x_to), (y_from, y_to)) = (range(0), range(1));
    if apart(x_from, x_to, x) || apart(y_from, y_to, y) {
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
