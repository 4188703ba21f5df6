//! Nodes throughout the magnet's volume: for sources so close that no ball around the magnet is
//! free of them.
//!
//! Gauss-Legendre along the axis and in the square of the radius, equal steps in azimuth. All
//! shares are positive. Orders follow from where the field is singular in each variable, continued
//! to complex values; a ring needs the fewer points the smaller it is and the farther its sources.

use std::f64::consts::TAU;

use super::{MOST_NODES, MagnetRule, Node, Placed, Sources, dot};
use fluxform_numerics::gauss::{self, Rule};

/// Constant of the bounds `scale * (distance / gap) * radius^(-2 n)`: close by, the integrand
/// grows above its size at the centre. `tests/magnet.rs` holds it against point charges.
pub(super) const SCALE: f64 = 6.0;
/// Nodes beyond the bound's for a logarithm or a pole: the gradient of a charge is singular like
/// distance^-3.
const MORE_NODES: usize = 1;

/// The product rule; `None` when it would need more than [`MOST_NODES`] nodes.
pub(super) fn rule(
    magnet: &Placed,
    sources: Sources,
    gap_m: f64,
    tolerance: f64,
) -> Option<MagnetRule> {
    let (a, half) = (0.5 * magnet.size.diameter_m, 0.5 * magnet.size.length_m);
    let [e1, e2] = across(magnet.axis);
    let over = Across::new(magnet, sources);
    let below = over.below;
    let scale = SCALE * sources.distance_m() / gap_m;
    let order = |radius: f64| order_for(radius, scale, tolerance);
    let end = gauss::bernstein_radius(-half, half, half + gap_m, 0.0);
    let side = gauss::bernstein_radius(-half, half, 0.0, gap_m);
    let along = order(if below { end } else { end.min(side) })?;
    // A source under the axis is met at radius^2 = -depth^2, one beside at (a + gap)^2.
    let under = gauss::bernstein_radius(0.0, a * a, -gap_m * gap_m, 0.0);
    let beside = gauss::bernstein_radius(0.0, a * a, (a + gap_m) * (a + gap_m), 0.0);
    let radial = order(if below { under } else { under.min(beside) })?;

    let mut nodes = Vec::new();
    for (x, weight_s) in along.nodes.iter().zip(&along.weights) {
        let s = half * x;
        for (t, weight_t) in radial.nodes.iter().zip(&radial.weights) {
            let rho = a * (0.5 * (1.0 + t)).sqrt();
            let steps = over.steps(rho, s, scale / tolerance);
            if nodes.len() as f64 + steps > MOST_NODES as f64 {
                return None;
            }
            let share = 0.25 * weight_s * weight_t / steps;
            for step in 0..steps as usize {
                let (sine, cosine) = (TAU * (step as f64 + 0.5) / steps).sin_cos();
                nodes.push(Node {
                    offset_m: std::array::from_fn(|i| {
                        s * magnet.axis[i] + rho * (cosine * e1[i] + sine * e2[i])
                    }),
                    moment_a_m2: magnet.moment_a_m2.map(|m| share * m),
                });
            }
        }
    }
    Some(MagnetRule {
        nodes,
        lower: None,
        moment_a_m2: magnet.moment_a_m2,
        bound: tolerance,
        amplification: 1.0,
    })
}

/// A Gauss rule of so many nodes as a singularity at this Bernstein radius needs; `None` where none is large enough.
pub(super) fn order_for(radius: f64, scale: f64, tolerance: f64) -> Option<&'static Rule> {
    let order = gauss::order_for(radius, scale, tolerance)? + MORE_NODES;
    (order <= gauss::MAX_ORDER).then(|| gauss::rule(order))
}

/// Rings about the magnet's axis among its sources.
pub(super) struct Across {
    sources: Sources,
    /// Sine of the angle from the axis to the vertical, and its cosine.
    tilt: [f64; 2],
    /// Below an upright magnet: sources lie beyond one end only. Otherwise they may lie beside it.
    pub(super) below: bool,
}

impl Across {
    pub(super) fn new(magnet: &Placed, sources: Sources) -> Self {
        Self {
            sources,
            tilt: [magnet.axis[0].hypot(magnet.axis[1]), magnet.axis[2]],
            below: matches!(sources, Sources::Below { .. }) && magnet.axis[2].abs() == 1.0,
        }
    }

    /// From a ring of radius `rho`, at `s` along the axis, to the nearest source, m.
    pub(super) fn apart_m(&self, rho: f64, s: f64) -> f64 {
        let [sine, cosine] = self.tilt;
        match self.sources {
            Sources::Below { height_m } => height_m + cosine * s - rho * sine,
            Sources::Beyond { distance_m } => distance_m - rho.hypot(s),
        }
    }

    /// Equal steps around the ring whose error is `1 / accuracy`, by half the width of the strip about real azimuths
    /// in which the field is analytic.
    pub(super) fn steps(&self, rho: f64, s: f64, accuracy: f64) -> f64 {
        let part = self.apart_m(rho, s) / rho;
        let width = if self.below {
            part.asinh()
        } else {
            part.ln_1p()
        };
        (accuracy.ln() / width).ceil().max(1.0)
    }
}

/// Two unit vectors that make a right-handed frame with a unit vector; x and y for the vertical.
pub(super) fn across(axis: [f64; 3]) -> [[f64; 3]; 2] {
    let x = [1.0, 0.0, 0.0];
    let y = [0.0, 1.0, 0.0];
    let start = if axis[0].abs() < 0.9 { x } else { y };
    let along = dot(start, axis);
    let e1: [f64; 3] = std::array::from_fn(|i| start[i] - along * axis[i]);
    let norm = dot(e1, e1).sqrt();
    let e1 = e1.map(|v| v / norm);
    [e1, super::cross(axis, e1)]
}
