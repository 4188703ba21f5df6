//! The solid angle under which triangles are seen: whether a place is inside a closed surface.

use std::f64::consts::PI;

use crate::box_tree::Triangle;
use crate::vec3::{cross, dot, minus, norm};

/// The solid angle of `triangles` from `at`, in whole spheres (van Oosterom and Strackee): of a closed surface that
/// looks outwards 1 inside and 0 outside.
pub fn turns_about(triangles: impl Iterator<Item = Triangle>, at: [f64; 3]) -> f64 {
    let angle = |triangle: Triangle| {
        let [a, b, c] = triangle.map(|corner| minus(corner, at));
        let (la, lb, lc) = (norm(a), norm(b), norm(c));
        let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
        2.0 * dot(a, cross(b, c)).atan2(below)
    };
    triangles.map(angle).sum::<f64>() / (4.0 * PI)
}
