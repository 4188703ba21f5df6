//! Whether bodies are clear of each other.

use super::bodies::Body;
use super::face::{Face, Panel, Point};

/// Halvings of a face within which its distance from another body is looked for.
const MOST_HALVINGS: usize = 10;
/// Rounding of a distance, m.
const ROUNDING_M: f64 = 1e-12;
/// A piece of a curved face reaches no farther than so many of its rim's distances.
const BULGE: f64 = 1.1;

/// A place on the surface of one of two bodies that is closer to the other than `least_m`, or inside it, m.
#[must_use]
pub fn meeting_m(a: &Body, b: &Body, least_m: f64) -> Option<Point> {
    let of = |a: &Body, b: &Body| {
        let faces = a.faces();
        let mut pieces = faces.iter();
        pieces.find_map(|face| {
            let whole = Panel::new(face, 0, [0.0, 1.0, 0.0, 1.0], 1);
            closer_m(face, &whole, b, least_m - ROUNDING_M, 0)
        })
    };
    of(a, b).or_else(|| of(b, a))
}

fn closer_m(face: &Face, piece: &Panel, b: &Body, least_m: f64, halvings: usize) -> Option<Point> {
    let distance = b.distance_m(piece.centre_m);
    if distance < least_m {
        return Some(piece.centre_m);
    }
    if distance - BULGE * piece.radius_m >= least_m {
        return None;
    }
    if halvings < MOST_HALVINGS {
        let halves = piece.halves(face);
        let mut halves = halves.iter();
        return halves.find_map(|half| closer_m(face, half, b, least_m, halvings + 1));
    }
    let [u0, u1, v0, v1] = piece.range;
    let corners = [(u0, v0), (u0, v1), (u1, v0), (u1, v1)];
    let mut corners = corners.into_iter().map(|(u, v)| face.point(u, v).0);
    corners.find(|place| b.distance_m(*place) < least_m)
}
