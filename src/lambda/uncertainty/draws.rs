//! Random displays within the bounds: what is promised is compared with what they give.

use std::f64::consts::TAU;

use fluxform_base::uncertainty::{Uncertainty, relative_pull};
use fluxform_numerics::random::Random;

use super::Turned;

/// The draws are the same in every run.
const SEED: u64 = 0x5eed;

/// One display within the bounds, at one of the points.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// The point.
    pub point: usize,
    /// The magnet's displacement from it, m.
    pub displacement_m: [f64; 3],
    /// Shares of the moment along its own axis and both across, times its strength.
    moment: [f64; 3],
    /// Each driver's current over the commanded one.
    gain: Vec<f64>,
}

/// `count` of them, taking the points in turn.
#[must_use]
pub fn draws(given: &Uncertainty, points: usize, coils: usize, count: usize) -> Vec<Draw> {
    let mut random = Random::new(SEED);
    let mut one = |k: usize| {
        let displacement_m = std::array::from_fn(|_| given.sensor_m * random.between(-1.0, 1.0));
        let tilt = given.tilt_deg.to_radians() * random.unit().sqrt();
        let way = TAU * random.unit();
        let strength = given.strength(random.unit());
        let across = strength * tilt.sin();
        Draw {
            point: k % points.max(1),
            displacement_m,
            moment: [
                strength * tilt.cos(),
                across * way.cos(),
                across * way.sin(),
            ],
            gain: (0..coils)
                .map(|_| 1.0 + given.driver * random.between(-1.0, 1.0))
                .collect(),
        }
    };
    (0..count).map(&mut one).collect()
}

impl Draw {
    /// The force of commanded currents, N, where `field` is the force per ampere at the displaced place and
    /// `pull_n` that without currents on the magnet as stated.
    #[must_use]
    pub fn force_n(&self, field: &[Turned], pull_n: f64, currents_a: &[f64]) -> [f64; 3] {
        let mut force = [0.0, 0.0, pull_n * relative_pull(self.moment)];
        for ((turned, current), gain) in field.iter().zip(currents_a).zip(&self.gain) {
            for (axis, sum) in force.iter_mut().enumerate() {
                let of_moment = self.moment.iter().enumerate();
                let per_ampere: f64 = of_moment.map(|(k, m)| m * turned[3 * k + axis]).sum();
                *sum += gain * current * per_ampere;
            }
        }
        force
    }
}
