//! Conditions on the mesh of a body before it is accepted: it closes the body, looks to one side,
//! and encloses the body's exact volume with its exact area, as far as the facets' distance from the
//! faces allows. That each facet lies on its face was measured where the faces are known.

use super::longest_side;
use crate::crossings::crossings;
use crate::edges::{Edges, WELD_ROUNDINGS, weld};
use crate::mesh::{Triangle, cross, dot, minus};

/// Vertices of neighbouring faces agree to this, against the body's size.
pub(super) const WELD: f64 = 1e-7;
/// Error of the exact volume and area: OpenCASCADE integrates numerically.
const INTEGRATED: f64 = 2e-3;
/// Bodies not much larger than the chord may lose so much of their volume and area.
const MOST_APART: f64 = 0.15;
/// Reaches, against the deviation, that are tried to close narrow gaps.
const GAPS: [f64; 4] = [1e-3, 1e-2, 0.1, 1.0];

/// One body's mesh and exact figures, mm.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Part {
    /// Counterclockwise from outside.
    pub(super) triangles: Vec<Triangle>,
    /// The most that a facet or a side lies from its face or edge.
    pub(super) deviation: f64,
    /// Exact area.
    pub(super) area: f64,
    /// Exact volume.
    pub(super) volume: f64,
}

/// Properties of a mesh that passed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Verdict {
    /// Pairs of facets that pass through each other.
    pub(super) crossings: usize,
}

/// Why a body's mesh is not believed; what else is known of it if it is.
pub(super) fn check(part: &Part) -> Result<Verdict, String> {
    let size = longest_side(&part.triangles);
    if !(size > 0.0 && size.is_finite()) {
        return Err("it has no extent".into());
    }
    let reach = WELD_ROUNDINGS * 0.5 * WELD * size;
    let names = weld(&part.triangles, reach);
    let edges = Edges::new(&names);
    // A gap that closes when vertices nearer than the deviation are one is narrower than that.
    let closes = |share: f64| {
        let reach = (share * part.deviation).max(reach);
        Edges::new(&weld(&part.triangles, reach)).closed()
    };
    if !edges.closed() && !GAPS.into_iter().any(closes) {
        return Err(format!(
            "its surface is not closed ({} open edges)",
            edges.open + edges.crowded
        ));
    }
    if edges.inconsistent > 0 {
        return Err("its facets do not look to one side".into());
    }
    let origin = part.triangles[0][0];
    let (mut area, mut volume) = (0.0, 0.0);
    for triangle in &part.triangles {
        let [a, b, c] = triangle.map(|v| minus(v, origin));
        let normal = cross(minus(b, a), minus(c, a));
        area += 0.5 * dot(normal, normal).sqrt();
        volume += dot(a, normal) / 6.0;
    }
    let bow = part.deviation * part.area;
    let apart = (volume - part.volume).abs();
    if apart > (bow + INTEGRATED * part.volume).min(MOST_APART * part.volume) {
        return Err(format!(
            "its mesh encloses {volume:.6} mm^3, the body {:.6} mm^3",
            part.volume
        ));
    }
    if (area - part.area).abs() > MOST_APART * part.area {
        return Err(format!(
            "its mesh covers {area:.6} mm^2, the body {:.6} mm^2",
            part.area
        ));
    }
    Ok(Verdict {
        crossings: crossings(&part.triangles, &names, part.deviation.max(reach)).pairs,
    })
}
