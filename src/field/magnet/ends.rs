//! Charges on the magnet's ends: a uniform magnetisation M acts from outside as a charge M per area on one end and
//! -M on the other does, and feels the force of the field on them.
//!
//! An end needs far fewer points than the volume of `solid`, which has them along the axis too: Gauss-Legendre in
//! the square of the radius, equal steps in azimuth, both by the end's own distance from the sources.

use std::f64::consts::TAU;

use super::solid::{Across, SCALE, across, order_for};
use super::{Charge, MOST_NODES, Placed, Sources};
use fluxform_numerics::gauss;

/// The charges; `None` when they would be more than [`MOST_NODES`].
pub(super) fn charges(magnet: &Placed, sources: Sources, tolerance: f64) -> Option<Vec<Charge>> {
    let (a, length_m) = (0.5 * magnet.size.diameter_m, magnet.size.length_m);
    let moment_a_m2 = super::dot(magnet.moment_a_m2, magnet.axis);
    let [e1, e2] = across(magnet.axis);
    let over = Across::new(magnet, sources);
    let mut charges = Vec::new();
    for end in [-1.0, 1.0] {
        let s = 0.5 * length_m * end;
        let gap_m = over.apart_m(a, s);
        // The field of a charge falls off more slowly than its gradient, to which the tolerance is relative: both ends'
        // fields nearly cancel far away, and close by the near end's is much larger than the gradient at the centre says.
        let growth = sources.distance_m().powi(3) / (length_m * gap_m * gap_m);
        let scale = SCALE * growth.max(sources.distance_m() / gap_m);
        let under = gauss::bernstein_radius(0.0, a * a, -gap_m * gap_m, 0.0);
        let beside = gauss::bernstein_radius(0.0, a * a, (a + gap_m) * (a + gap_m), 0.0);
        let radius = if over.below { under } else { under.min(beside) };
        let radial = order_for(radius, scale, tolerance)?;
        for (t, weight) in radial.nodes.iter().zip(&radial.weights) {
            let rho = a * (0.5 * (1.0 + t)).sqrt();
            let steps = over.steps(rho, s, scale / tolerance);
            if charges.len() as f64 + steps > MOST_NODES as f64 {
                return None;
            }
            let charge_a_m = end * moment_a_m2 / length_m * 0.5 * weight / steps;
            for step in 0..steps as usize {
                let (sine, cosine) = (TAU * (step as f64 + 0.5) / steps).sin_cos();
                charges.push(Charge {
                    offset_m: std::array::from_fn(|i| {
                        s * magnet.axis[i] + rho * (cosine * e1[i] + sine * e2[i])
                    }),
                    charge_a_m,
                });
            }
        }
    }
    Some(charges)
}
