//! The felt error along a trajectory under the uncertainties that a bundle was made with: promised by the
//! quadratic form, and realised by random displays.

use serde::Serialize;

use super::renderer::{Renderer, Step};
use crate::lambda::uncertainty::{Draw, Turned, draws};
use crate::uncertainty::Uncertainty;

/// Random displays, at least; every position has as many.
const DRAWS: usize = 1000;

/// Errors of the felt force: root mean squares over the positions inside the map and the uncertainties, relative
/// to that of the requested force; of the upward force alone where that alone is requested.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FeltErrors {
    /// By the quadratic form.
    pub promised: f64,
    /// Of random displays.
    pub realised: f64,
    /// Mean power over the positions, W.
    pub mean_power_w: f64,
}

/// The felt error with currents of least power and with those chosen for the uncertainties.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FeltSummary {
    /// The uncertainties without a tilt: a bundle holds no force on a tilted magnet.
    pub given: Uncertainty,
    /// Random displays.
    pub draws: usize,
    /// Currents of least power.
    pub feedback: FeltErrors,
    /// Currents chosen for the uncertainties.
    pub robust: FeltErrors,
}

/// Sums along a trajectory.
#[derive(Debug, Clone)]
pub(super) struct Felt {
    given: Uncertainty,
    draws: Vec<Draw>,
    each: usize,
    next: usize,
    resistance_ohm: Vec<f64>,
    positions: usize,
    requested_n2: f64,
    /// Promised and realised squares and power: of least power, then chosen for the uncertainties.
    sums: [[f64; 3]; 2],
    field: Vec<Turned>,
    vectors: Vec<[f64; 3]>,
    upward: Vec<f64>,
}

impl Felt {
    /// For a bundle made with what is `given`, and so many positions inside its map.
    pub(super) fn new(given: Uncertainty, resistance_ohm: &[f64], positions: usize) -> Self {
        let coils = resistance_ohm.len();
        let given = Uncertainty {
            tilt_deg: 0.0,
            ..given
        };
        Self {
            given,
            draws: draws(&given, 1, coils, DRAWS),
            each: DRAWS.div_ceil(positions.max(1)),
            next: 0,
            resistance_ohm: resistance_ohm.to_vec(),
            positions: 0,
            requested_n2: 0.0,
            sums: [[0.0; 3]; 2],
            field: vec![[0.0; 9]; coils],
            vectors: vec![[0.0; 3]; coils],
            upward: vec![0.0; coils],
        }
    }

    /// A position inside the map, whose step was the renderer's last.
    pub(super) fn add(
        &mut self,
        renderer: &Renderer,
        position_m: [f64; 3],
        step: &Step,
        robust_a: &[f64],
    ) {
        let requested = step.wanted_force_n();
        self.positions += 1;
        self.requested_n2 += requested.iter().map(|part| part * part).sum::<f64>();
        let both = [renderer.plain_a(), robust_a];
        for (sums, currents) in self.sums.iter_mut().zip(both) {
            sums[0] += renderer.expected_n2(currents).unwrap_or(0.0);
            let terms = self.resistance_ohm.iter().zip(currents);
            sums[2] += terms.map(|(ohm, i)| ohm * i * i).sum::<f64>();
        }
        let ends = renderer.map().ends_m();
        for _ in 0..self.each {
            let draw = &self.draws[self.next % DRAWS];
            self.next += 1;
            let place = std::array::from_fn(|axis| {
                let [from, to] = ends[axis];
                (position_m[axis] + draw.displacement_m[axis]).clamp(from, to)
            });
            let pull_n = if step.sideways.is_some() {
                renderer.map().vectors_at(place, &mut self.vectors)
            } else {
                let pull_n = renderer.map().at(place, &mut self.upward);
                for (vector, upward) in self.vectors.iter_mut().zip(&self.upward) {
                    vector[2] = *upward;
                }
                pull_n
            };
            for (turned, vector) in self.field.iter_mut().zip(&self.vectors) {
                turned[..3].copy_from_slice(vector);
            }
            for (sums, currents) in self.sums.iter_mut().zip(both) {
                let force = draw.force_n(&self.field, pull_n.unwrap_or(0.0), currents);
                let parts = force.iter().zip(&requested);
                sums[1] += parts.map(|(f, w)| (f - w) * (f - w)).sum::<f64>() / self.each as f64;
            }
        }
    }

    /// `None` where no force is requested.
    pub(super) fn summary(&self) -> Option<FeltSummary> {
        let share = |sum: f64| (sum / self.requested_n2).sqrt();
        let of = |[promised, realised, power]: [f64; 3]| FeltErrors {
            promised: share(promised),
            realised: share(realised),
            mean_power_w: power / self.positions as f64,
        };
        (self.requested_n2 > 0.0).then(|| FeltSummary {
            given: self.given,
            draws: self.next,
            feedback: of(self.sums[0]),
            robust: of(self.sums[1]),
        })
    }
}
