//! How far a mesh may lie from the smooth surface it was cut from: an estimate from its angles.
//!
//! Two facets of width w1 and w2 across their common edge that turn by an angle t follow a curve of
//! radius (w1 + w2) / 2 t, whose arc rises (w1 + w2) t / 16 above either chord. A facet bends both
//! ways, so its two largest are added. Edges that turn more than `SHARPEST_DEG` are taken as meant.

use rayon::prelude::*;

use crate::file_mesh::Triangle;
use crate::mesh::Mesh;
use fluxform_numerics::vec3::{cross, dot, minus};

/// Turns beyond this are edges of the body, not of the tessellation, degrees.
const SHARPEST_DEG: f64 = 20.0;
/// Inside one face of a body a larger turn is a fold of the display, degrees.
const SHARPEST_IN_FACE_DEG: f64 = 90.0;

/// A side of a triangle: its ends' name, the triangle, which of the three.
type Side = (u64, u32, u8);

/// One number for two ends; sides that share it are compared too.
fn name(ends: &[[u64; 3]; 2]) -> u64 {
    ends.as_flattened()
        .iter()
        .fold(0x9e37_79b9_7f4a_7c15, |h, bits| {
            let mixed = (h ^ bits).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            mixed ^ (mixed >> 29)
        })
}

/// The largest estimated deviation of a facet from the surface meant, m; 0 for a plane body.
#[must_use]
pub fn estimated_deviation_m(mesh: &Mesh) -> f64 {
    estimate(mesh.triangles(), SHARPEST_DEG)
}

/// The same of the triangles of one smooth face, where every edge inside is of the tessellation,
/// in their unit.
pub(super) fn face_deviation(triangles: &[Triangle]) -> f64 {
    estimate(triangles, SHARPEST_IN_FACE_DEG)
}

fn estimate(triangles: &[Triangle], sharpest_deg: f64) -> f64 {
    let side = |(_, index, side): &Side| {
        let corners = &triangles[*index as usize];
        let ends =
            [0, 1].map(|end| corners[(*side as usize + end) % 3].map(|c| (c + 0.0).to_bits()));
        let [a, b] = ends;
        if b < a { [b, a] } else { [a, b] }
    };
    let mut sides: Vec<Side> = (0..3 * triangles.len())
        .into_par_iter()
        .map(|k| {
            let unnamed = (0, (k / 3) as u32, (k % 3) as u8);
            (name(&side(&unnamed)), unnamed.1, unnamed.2)
        })
        .collect();
    sides.par_sort_unstable();
    let cosine = sharpest_deg.to_radians().cos();
    let mut rises = vec![[0.0_f64; 2]; triangles.len()];
    let mut from = 0;
    while from < sides.len() {
        let same = sides[from..]
            .iter()
            .take_while(|side| side.0 == sides[from].0)
            .count();
        // Where three or more meet, the edge is no part of a smooth surface.
        if let [one, two] = &sides[from..from + same]
            && side(one) == side(two)
        {
            let ((_, first, side), (_, second, other)) = (*one, *two);
            let (p, q) = (
                facet(triangles, first, side),
                facet(triangles, second, other),
            );
            // Each is given by its direction away from the common edge: opposite ones are level.
            let turn = -dot(p.0, q.0);
            if turn > cosine {
                let level = [0, 1, 2].map(|k| p.0[k] + q.0[k]);
                let angle = 2.0 * (0.5 * dot(level, level).sqrt()).asin();
                let rise = (p.1 + q.1) * angle / 16.0;
                for index in [first, second] {
                    let most = &mut rises[index as usize];
                    if rise > most[0] {
                        *most = [rise, most[0]];
                    } else {
                        most[1] = most[1].max(rise);
                    }
                }
            }
        }
        from += same;
    }
    rises
        .iter()
        .fold(0.0, |most, rise| most.max(rise[0] + rise[1]))
}

/// The facet's unit direction away from one of its sides, and its width in that direction.
fn facet(triangles: &[[[f64; 3]; 3]], index: u32, side: u8) -> ([f64; 3], f64) {
    let corner = |k: u8| triangles[index as usize][(side + k) as usize % 3];
    let along = minus(corner(1), corner(0));
    let across = minus(corner(2), corner(0));
    let inward = cross(cross(along, across), along);
    let length = dot(inward, inward).sqrt();
    if length == 0.0 {
        return ([0.0; 3], 0.0);
    }
    let unit = inward.map(|c| c / length);
    (unit, dot(unit, across))
}
