//! A design as a drawing of its array.

use crate::design::iron::{Plate, PlateOutline};
use crate::design::{Coil, Design};
use crate::plot::array::{ArrayPlot, Body, Part, Role};
use crate::scene::iron::middle;

/// The array of `design` with its coils, the magnet and the workspace; `None` without a coil.
#[must_use]
pub fn drawing(design: &Design) -> Option<ArrayPlot> {
    let coil = design.coil?;
    let axes = &design.array.positions_m;
    let distance = |axis: &[f64; 2]| axis[0].hypot(axis[1]);
    let middle = axes
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    let space = &design.workspace;
    let ends = [space.x_m, space.y_m, space.z_m].map(|axis| [axis.from, axis.to]);
    let mut parts = vec![part(Role::Workspace, Body::Block(ends))];
    for (number, axis_m) in axes.iter().enumerate() {
        parts.extend(coil_parts(design, &coil, *axis_m, number));
    }
    parts.extend(
        design
            .plate
            .as_ref()
            .map(|plate| part(Role::Plate, plate_body(design, &coil, plate))),
    );
    let (half, centre) = (0.5 * design.magnet.length_m, design.target_height_m);
    parts.push(part(
        Role::Magnet,
        Body::Tube {
            axis_m: *middle,
            inner_m: 0.0,
            outer_m: 0.5 * design.magnet.diameter_m,
            z_m: [centre - half, centre + half],
        },
    ));
    Some(ArrayPlot {
        title: format!("{}: the array, to scale", design.name),
        parts,
        section_y_m: middle[1],
    })
}

/// The plate, its middle below the middle of the coils' axes.
fn plate_body(design: &Design, coil: &Coil, plate: &Plate) -> Body {
    let middle = middle(&design.array.positions_m);
    let below_m = design.core.as_ref().map_or(0.0, |core| core.below_m);
    let top_m = -(coil.length_m + below_m) - plate.gap_m;
    let z_m = [top_m - plate.thickness_m, top_m];
    match plate.outline {
        PlateOutline::Round(diameter_m) => Body::Tube {
            axis_m: middle,
            inner_m: 0.0,
            outer_m: 0.5 * diameter_m,
            z_m,
        },
        PlateOutline::Rectangle(sides_m) => {
            let ends = |k: usize| {
                let half = 0.5 * sides_m[k];
                [middle[k] - half, middle[k] + half]
            };
            Body::Block([ends(0), ends(1), z_m])
        }
    }
}

fn part(role: Role, body: Body) -> Part {
    Part {
        role,
        body,
        label: None,
    }
}

/// A winding with its core.
fn coil_parts(design: &Design, coil: &Coil, axis_m: [f64; 2], number: usize) -> Vec<Part> {
    let inner_m = 0.5 * coil.inner_diameter_m;
    let winding = Body::Tube {
        axis_m,
        inner_m,
        outer_m: 0.5 * coil.outer_diameter_m,
        z_m: [-coil.length_m, 0.0],
    };
    let core = design.core.as_ref().map(|core| Body::Tube {
        axis_m,
        inner_m: 0.0,
        outer_m: inner_m - core.clearance_m,
        z_m: [-(coil.length_m + core.below_m), core.above_m],
    });
    let winding = Part {
        label: Some(number.to_string()),
        ..part(Role::Winding, winding)
    };
    let core = core.map(|body| part(Role::Core, body));
    std::iter::once(winding).chain(core).collect()
}
