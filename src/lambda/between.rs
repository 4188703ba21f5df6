//! The largest force on the way between places where it is known.
//!
//! Along a line of places the forces per ampere are smooth, but the largest force has a kink wherever
//! a coil changes its sign: it may fall like a V between two places. There it is no less than what
//! the best currents of either end give,
//!
//! ```text
//! max_I G(z) . I  >=  max(G(z) . I_a, G(z) . I_b),   a <= z <= b,
//! ```
//!
//! and the force of fixed currents is a straight line but for its bend, which a third place shows.

use rayon::prelude::*;

use super::certificate::best_within_limits;
use super::problem::{ForceProblem, ProblemError, Settings};

/// Nearer to an end than this part of a gap none is split: three places that close show no bend.
const NEAREST: f64 = 0.1;

/// The largest forces at places in the direction requested at each, and their currents.
#[derive(Debug, Clone)]
pub struct Strongest {
    coils: usize,
    /// Force per ampere in the requested direction, N/A, [place, coil].
    forces_n_per_a: Vec<f64>,
    /// Force without currents in that direction, N.
    offset_n: Vec<f64>,
    /// |height|, m.
    height_m: Vec<f64>,
    /// Currents of the largest force, A, [place, coil].
    currents_a: Vec<f64>,
}

/// A gap between two neighbouring places over one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// The point.
    pub point: usize,
    /// Heights of its ends above the surface, m.
    pub ends_m: [f64; 2],
    /// Where the largest force may be least, m.
    pub lowest_m: f64,
    /// The largest lambda is no less in it, N/m, as far as forces of fixed currents bend like parabolas.
    pub least_n_per_m: f64,
}

impl Strongest {
    /// # Errors
    /// Where the problem is malformed.
    pub fn new(problem: &ForceProblem) -> Result<Self, ProblemError> {
        problem.validate(&Settings::default())?;
        let coils = problem.coils();
        let sign = |height: f64| if height < 0.0 { -1.0 } else { 1.0 };
        let heights = problem.height_m.iter().copied();
        let rows = problem.forces_n_per_a.chunks(coils).zip(heights.clone());
        let forces_n_per_a: Vec<f64> = rows
            .flat_map(|(row, height)| row.iter().map(move |force| sign(height) * force))
            .collect();
        let offset = |place: usize| problem.offset_n.map_or(0.0, |offset| offset[place]);
        let offsets = heights.clone().enumerate();
        let currents = forces_n_per_a.par_chunks(coils);
        Ok(Self {
            coils,
            offset_n: offsets
                .map(|(place, height)| sign(height) * offset(place))
                .collect(),
            height_m: heights.map(f64::abs).collect(),
            currents_a: currents
                .flat_map_iter(|row| best_within_limits(problem, row))
                .collect(),
            forces_n_per_a,
        })
    }

    fn currents_a(&self, place: usize) -> &[f64] {
        &self.currents_a[place * self.coils..][..self.coils]
    }

    /// What currents give at a place, N.
    fn given_n(&self, place: usize, currents_a: &[f64]) -> f64 {
        let row = &self.forces_n_per_a[place * self.coils..][..self.coils];
        let given: f64 = row.iter().zip(currents_a).map(|(force, i)| force * i).sum();
        given + self.offset_n[place]
    }
}

/// Both gaps between three places over each point whose height is not zero. `heights_m` gives the heights
/// of a point's places above the surface, ascending.
#[must_use]
pub fn gaps(places: [&Strongest; 3], heights_m: impl Fn(usize) -> [f64; 3]) -> Vec<Gap> {
    let felt = (0..places[0].height_m.len()).filter(|&point| places[0].height_m[point] > 0.0);
    felt.flat_map(|point| gaps_of(places, point, heights_m(point)))
        .collect()
}

fn gaps_of(places: [&Strongest; 3], point: usize, at_m: [f64; 3]) -> [Gap; 2] {
    // Rows: currents of each place; columns: what they give at each place.
    let given_n = places.map(|of| {
        let currents = of.currents_a(point);
        places.map(|place| place.given_n(point, currents))
    });
    let parts = [at_m[1] - at_m[0], at_m[2] - at_m[1]].map(|part| part / (at_m[2] - at_m[0]));
    let off_line = given_n.map(|[a, b, c]| (b - parts[1] * a - parts[0] * c).abs());
    [0, 1].map(|first| {
        let [own, across] = [parts[first], parts[1 - first]];
        let bend = off_line[first].max(off_line[first + 1]) * own / (4.0 * across);
        let [from, to] = [given_n[first], given_n[first + 1]].map(|of| [of[first], of[first + 1]]);
        // The best currents of one end give less at the other than that end's own.
        let [more_at_start, more_at_end] = [from[0] - to[0], to[1] - from[1]];
        let cross = more_at_start / (more_at_start + more_at_end);
        let falls = from[1] < from[0] && to[0] < to[1];
        let (at, straight) = match falls {
            true => (cross, from[0] + cross * (from[1] - from[0])),
            false => (0.5, from[0].min(to[1])),
        };
        let ends_m = [at_m[first], at_m[first + 1]];
        Gap {
            point,
            ends_m,
            lowest_m: ends_m[0] + at.clamp(NEAREST, 1.0 - NEAREST) * (ends_m[1] - ends_m[0]),
            least_n_per_m: (straight - bend) / places[0].height_m[point],
        }
    })
}
