//! The force vector that a shape requests, as its bundle holds it.

use crate::bundle::manifest::ForceSummary;
use crate::bundle::rendering::Requested;
use crate::force_direction::RequestedForce;
use crate::lambda::SIDEWAYS_WEIGHT;
use crate::shape::points::ConstraintPoints;

/// The request as a bundle states it; `None` where the upward component alone is requested.
pub(super) fn summary(force: RequestedForce, points: &ConstraintPoints) -> Option<ForceSummary> {
    if !force.direction.is_vector() {
        return None;
    }
    let normal_force = force.along_normal();
    let count = |is: fn(&crate::shape::point_flags::Marks) -> bool| {
        let marked = points.marks.iter().filter(|marks| is(marks));
        normal_force.map_or(0, |_| marked.count())
    };
    Some(ForceSummary {
        direction: force.direction,
        normal_force,
        sideways_weight: SIDEWAYS_WEIGHT,
        crease_points: count(|marks| marks.crease.is_some()),
        rim_points: count(|marks| marks.rim || marks.wall),
        static_currents:
            "the upward component lambda h alone (eq. 5 to 10): static currents cannot \
                          give the vector"
                .to_owned(),
    })
}

/// The request on the nodes of the points' grid, [y, x, 3]; `None` where the upward component alone
/// is requested.
pub(crate) fn on_grid(force: RequestedForce, points: &ConstraintPoints) -> Option<Requested> {
    if !force.direction.is_vector() {
        return None;
    }
    let nodes = points.grid.x_m.samples * points.grid.y_m.samples;
    let mut direction = [0.0, 0.0, 1.0].repeat(nodes);
    for (row, node) in points.grid_index.iter().enumerate() {
        let vector = force.vector(points.normal[row], points.marks[row].crease);
        direction[3 * node..3 * node + 3].copy_from_slice(&vector);
    }
    Some(Requested {
        direction,
        sideways_weight: SIDEWAYS_WEIGHT,
    })
}
