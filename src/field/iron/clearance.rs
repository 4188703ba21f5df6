//! Whether bodies, and places, are clear of surfaces.

use super::bodies::Body;
use super::face::{Face, Panel, Point};
use super::surface::Surface;
use fluxform_numerics::vec3::{dot, minus, norm};
use std::ops::Range;

/// Halvings of a face within which its distance from another body is looked for: two that lie along each other are
/// as far apart everywhere.
const MOST_HALVINGS: usize = 10;
/// The same from a place, which few pieces are near.
const MOST_ABOUT_A_PLACE: usize = 60;
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
            let distance_m = |at| b.distance_m(at);
            closer_m(
                face,
                &whole,
                &distance_m,
                least_m - ROUNDING_M,
                MOST_HALVINGS,
            )
        })
    };
    of(a, b).or_else(|| of(b, a))
}

/// Whether a place of `surface`, whose [`Surface::whole_faces`] are `faces`, is closer to `place_m` than `least_m`.
pub(super) fn is_within(
    surface: &Surface,
    faces: &[(Panel, Range<usize>)],
    place_m: Point,
    least_m: f64,
) -> bool {
    let distance_m = |at| norm(minus(at, place_m));
    let may_be = |piece: &Panel| {
        let away = minus(piece.centre_m, place_m);
        let beside = |normal| dot(normal, away).abs() >= least_m;
        !piece.plane.is_some_and(beside) && norm(away) - BULGE * piece.radius_m < least_m
    };
    let near = faces.iter().filter(|(whole, _)| may_be(whole));
    let mut panels = near.flat_map(|(_, panels)| &surface.panels()[panels.clone()]);
    panels.any(|panel| {
        let face = &surface.faces[panel.face];
        may_be(panel) && closer_m(face, panel, &distance_m, least_m, MOST_ABOUT_A_PLACE).is_some()
    })
}

/// A place on a piece of a face where `distance_m` is below `least_m`.
fn closer_m(
    face: &Face,
    piece: &Panel,
    distance_m: &dyn Fn(Point) -> f64,
    least_m: f64,
    halvings: usize,
) -> Option<Point> {
    let distance = distance_m(piece.centre_m);
    if distance < least_m {
        return Some(piece.centre_m);
    }
    if distance - BULGE * piece.radius_m >= least_m {
        return None;
    }
    if halvings > 0 {
        let halves = piece.halves(face);
        let mut halves = halves.iter();
        return halves.find_map(|half| closer_m(face, half, distance_m, least_m, halvings - 1));
    }
    let [u0, u1, v0, v1] = piece.range;
    let corners = [(u0, v0), (u0, v1), (u1, v0), (u1, v1)];
    let mut corners = corners.into_iter().map(|(u, v)| face.point(u, v).0);
    corners.find(|place| distance_m(*place) < least_m)
}
