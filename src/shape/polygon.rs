//! Faces with more than three corners, cut into triangles.

use earcut::Earcut;

use crate::mesh::{Triangle, cross, dot, minus};

/// A face with more corners was not written by a program that draws faces, and to cut it could
/// take minutes.
pub(super) const MOST_CORNERS: usize = 50_000;
/// Turns smaller than this, against the polygon's area, are rounding and no notch.
const FLAT_TURN: f64 = 1e-9;

/// Cuts polygons; keeps its working memory from one to the next.
pub(super) struct Cutter {
    earcut: Earcut<f64>,
    plan: Vec<[f64; 2]>,
    corners: Vec<u32>,
}

impl Cutter {
    pub(super) fn new() -> Self {
        Self {
            earcut: Earcut::new(),
            plan: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Adds the triangles of a simple polygon: a fan where it is convex, ears where it is not (a
    /// fan would cover its notches). Fewer than three corners are no face.
    pub(super) fn cut(&mut self, polygon: &[[f64; 3]], triangles: &mut Vec<Triangle>) {
        if polygon.len() > 3 {
            let normal = area_vector(polygon);
            if !is_convex(polygon, normal) {
                self.ears(polygon, normal);
                if !self.corners.is_empty() {
                    triangles.extend(
                        self.corners
                            .chunks_exact(3)
                            .map(|c| [0, 1, 2].map(|k| polygon[c[k] as usize])),
                    );
                    return;
                }
            }
        }
        if let [first, rest @ ..] = polygon {
            triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]]));
        }
    }

    /// Cuts the polygon as seen along the axis that its normal is nearest to.
    fn ears(&mut self, polygon: &[[f64; 3]], normal: [f64; 3]) {
        let mut drop = 0;
        for k in 1..3 {
            if normal[k].abs() > normal[drop].abs() {
                drop = k;
            }
        }
        let (mut u, mut v) = ((drop + 1) % 3, (drop + 2) % 3);
        if normal[drop] < 0.0 {
            (u, v) = (v, u);
        }
        self.plan.clear();
        self.plan.extend(polygon.iter().map(|p| [p[u], p[v]]));
        self.earcut
            .earcut(self.plan.iter().copied(), &[], &mut self.corners);
        // The order in which the ears' corners come out is not promised: it is made the polygon's.
        for ear in self.corners.chunks_exact_mut(3) {
            let [a, b, c] = [0, 1, 2].map(|k| self.plan[ear[k] as usize]);
            if (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0]) {
                ear.swap(1, 2);
            }
        }
    }
}

/// Twice the polygon's vector area.
fn area_vector(polygon: &[[f64; 3]]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for pair in polygon[1..].windows(2) {
        let part = cross(minus(pair[0], polygon[0]), minus(pair[1], polygon[0]));
        for k in 0..3 {
            sum[k] += part[k];
        }
    }
    sum
}

/// True where no corner turns against the polygon's sense.
fn is_convex(polygon: &[[f64; 3]], normal: [f64; 3]) -> bool {
    let n = polygon.len();
    let least = -FLAT_TURN * dot(normal, normal);
    (0..n).all(|i| {
        let [a, b, c] = [i, i + 1, i + 2].map(|k| polygon[k % n]);
        dot(cross(minus(b, a), minus(c, b)), normal) >= least
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(polygon: &[[f64; 3]]) -> (f64, [f64; 3]) {
        let mut triangles = Vec::new();
        Cutter::new().cut(polygon, &mut triangles);
        assert_eq!(triangles.len(), polygon.len().saturating_sub(2));
        let (mut total, mut vector) = (0.0, [0.0; 3]);
        for t in &triangles {
            let twice = area_vector(t);
            total += 0.5 * twice.iter().map(|c| c * c).sum::<f64>().sqrt();
            for k in 0..3 {
                vector[k] += 0.5 * twice[k];
            }
        }
        (total, vector)
    }

    /// Wherever it lies and whichever way it runs, the pieces cover the polygon once: the sum of
    /// their areas is the length of the sum of their area vectors.
    #[test]
    fn notched_polygons_are_covered_once() {
        let notched = [[0.0, 0.0], [4.0, 0.3], [4.1, 3.0], [2.0, 0.7], [0.2, 3.3]];
        let lift = |[x, y]: [f64; 2]| [x + 0.7, 0.3 * x - y, 1.3 * y + 0.2 * x];
        let mut polygon: Vec<[f64; 3]> = notched.map(lift).to_vec();
        for _ in 0..2 {
            for turn in 0..polygon.len() {
                polygon.rotate_left(1);
                let (total, vector) = areas(&polygon);
                let whole = area_vector(&polygon).map(|c| 0.5 * c);
                let length = whole.iter().map(|c| c * c).sum::<f64>().sqrt();
                assert!((total - length).abs() < 1e-12 * length, "{turn}");
                for k in 0..3 {
                    assert!((vector[k] - whole[k]).abs() < 1e-12 * length, "{turn}");
                }
            }
            polygon.reverse();
        }
    }

    #[test]
    fn what_is_no_polygon_gives_no_surface() {
        let p = [0.7, 1.3, -0.2];
        for n in 0..3 {
            assert_eq!(areas(&vec![p; n]).0, 0.0);
        }
        assert_eq!(areas(&[p; 5]).0, 0.0);
    }

    #[test]
    fn a_notch_turns_against_the_rest() {
        let mut pentagon = [
            [0.0, 0.0, 0.3],
            [1.3, 0.0, 0.3],
            [1.3, 0.7, 0.3],
            [0.6, 1.1, 0.3],
            [0.0, 0.7, 0.3],
        ];
        assert!(is_convex(&pentagon, area_vector(&pentagon)));
        pentagon[3][1] = 0.2;
        assert!(!is_convex(&pentagon, area_vector(&pentagon)));
    }
}
