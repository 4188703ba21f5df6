//! The distance from a point to a set of triangles: by a tree of boxes, nearest first.

use crate::box_tree::{Box3, BoxTree, Triangle};
use crate::vec3::{dot, minus};

/// A tree of boxes over triangles, and the triangles in its order.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    boxes: BoxTree,
    triangles: Vec<Triangle>,
}

impl Tree {
    /// The tree of `triangles`.
    #[must_use]
    pub fn new(triangles: &[Triangle]) -> Self {
        let boxes = BoxTree::new(triangles);
        let order = boxes.order.iter();
        let triangles = order.map(|k| triangles[*k as usize]).collect();
        Self { boxes, triangles }
    }

    /// Distance to the nearest triangle, and which it is in the tree's order; infinite without any.
    #[must_use]
    pub fn nearest(&self, p: [f64; 3]) -> (f64, usize) {
        let mut best = (f64::INFINITY, 0);
        if !self.boxes.nodes.is_empty() {
            self.visit(0, p, &mut best);
        }
        (best.0.sqrt(), best.1)
    }

    /// The largest distance from any of the corners to one triangle.
    ///
    /// The distance to a convex set is a convex function: no point of the corners' hull is farther
    /// from that triangle, hence none from all of them.
    #[must_use]
    pub fn farthest(&self, triangle: usize, corners: impl Iterator<Item = [f64; 3]>) -> f64 {
        let Some(triangle) = self.triangles.get(triangle) else {
            return f64::INFINITY;
        };
        corners
            .map(|p| square_to_triangle(triangle, p))
            .fold(0.0, f64::max)
            .sqrt()
    }

    fn visit(&self, index: usize, p: [f64; 3], best: &mut (f64, usize)) {
        let nodes = &self.boxes.nodes;
        let node = &nodes[index];
        if square_to_box(&node.bounds, p) >= best.0 {
            return;
        }
        if let Some([from, to]) = node.range {
            for index in from..to {
                let square = square_to_triangle(&self.triangles[index], p);
                if square < best.0 {
                    *best = (square, index);
                }
            }
            return;
        }
        let mut children = [index + 1, node.right];
        if square_to_box(&nodes[children[1]].bounds, p)
            < square_to_box(&nodes[children[0]].bounds, p)
        {
            children.swap(0, 1);
        }
        for child in children {
            self.visit(child, p, best);
        }
    }
}

fn square_to_box(bounds: &Box3, p: [f64; 3]) -> f64 {
    (0..3)
        .map(|k| (bounds[0][k] - p[k]).max(p[k] - bounds[1][k]).max(0.0))
        .map(|d| d * d)
        .sum()
}

/// Squared distance: to the plane where the foot lies inside, else to the nearest side.
fn square_to_triangle(&[a, b, c]: &Triangle, p: [f64; 3]) -> f64 {
    let (u, v, w) = (minus(b, a), minus(c, a), minus(p, a));
    let (uu, uv, vv) = (dot(u, u), dot(u, v), dot(v, v));
    let (wu, wv) = (dot(w, u), dot(w, v));
    let determinant = uu * vv - uv * uv;
    let (s, t) = (vv * wu - uv * wv, uu * wv - uv * wu);
    if determinant > 0.0 && s >= 0.0 && t >= 0.0 && s + t <= determinant {
        let (s, t) = (s / determinant, t / determinant);
        let off = [0, 1, 2].map(|k| w[k] - s * u[k] - t * v[k]);
        return dot(off, off);
    }
    let sides = [(a, b), (b, c), (c, a)];
    sides
        .iter()
        .map(|(q, r)| square_to_segment(*q, *r, p))
        .fold(f64::INFINITY, f64::min)
}

fn square_to_segment(a: [f64; 3], b: [f64; 3], p: [f64; 3]) -> f64 {
    let (u, w) = (minus(b, a), minus(p, a));
    let square = dot(u, u);
    let t = if square > 0.0 {
        (dot(u, w) / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off = [0, 1, 2].map(|k| w[k] - t * u[k]);
    dot(off, off)
}
