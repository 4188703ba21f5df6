//! Starting points: a low-discrepancy sequence, shifted by the seed.

use super::domain::Domain;
use super::model::Window;
use super::problem::Problem;
use fluxform_numerics::random::Random;

/// Start `index` of the sequence in scaled coordinates, pulled back into what the limits on
/// sizes and wire allow. The same for any number of threads.
#[must_use]
pub fn start(domain: &Domain, scale_m: f64, seed: u64, index: usize) -> [f64; 3] {
    let ranges = domain.starting_box(scale_m);
    let mut random = Random::new(seed);
    let x: [f64; 3] = std::array::from_fn(|i| {
        let shift = random.unit();
        let share = (radical_inverse(index + 1, [2, 3, 5][i]) + shift).fract();
        ranges[i][0] + share * (ranges[i][1] - ranges[i][0])
    });
    let mut window = Problem::window(x);
    let mean = window.inner_radius_m + 0.5 * window.depth_m;
    let room = 2.0 * (domain.outer_m[1] - mean).min(mean - domain.inner_m[0]);
    let depth_m = window
        .depth_m
        .min(room.max(domain.depth_min_m))
        .min(2.0 * mean);
    window = Window {
        inner_radius_m: mean - 0.5 * depth_m,
        depth_m,
        ..window
    };
    // Too much wire: shorter and thinner alike.
    let excess = window.volume_over_pi_m3().value / domain.volume_m3[1];
    if excess > 1.0 {
        let shrink = excess.sqrt();
        window.length_m = (window.length_m / shrink).max(domain.length_m[0]);
        let depth_m = (window.depth_m / shrink).max(domain.depth_min_m);
        window.inner_radius_m += 0.5 * (window.depth_m - depth_m);
        window.depth_m = depth_m;
    }
    Problem::coordinates(&window)
}

/// The digits of `index` in `base`, mirrored at the point.
fn radical_inverse(mut index: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while index > 0 {
        digit /= base as f64;
        value += digit * (index % base) as f64;
        index /= base;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optimum::tests::{air, task};
    use fluxform_design::Limits;

    #[test]
    fn the_sequence_fills_the_unit_interval_evenly() {
        let mut values: Vec<f64> = (1..=80).map(|i| radical_inverse(i, 3)).collect();
        values.sort_by(f64::total_cmp);
        // The first 3^4 points of base 3 are the multiples of 1/81.
        for (k, value) in values.iter().enumerate() {
            assert!((value - (k + 1) as f64 / 81.0).abs() < 1e-15);
        }
    }

    /// Sizes alone are limited, so that neither mean radius nor length are pulled back.
    #[test]
    fn starts_are_the_sequence_s_points_within_the_limits() {
        let limits = Limits {
            inner_diameter_min_m: Some(0.013),
            outer_diameter_max_m: Some(0.07),
            length_max_m: Some(0.1),
            ..Limits::default()
        };
        let (model, task) = (air(0.03), task(limits, None));
        let domain = Domain::of(&Problem::of_wire(&model, &task, task.strands[0])[0]);
        let ranges = domain.starting_box(0.03);
        let starts: Vec<[f64; 3]> = (0..64).map(|i| start(&domain, 0.03, 7, i)).collect();
        // Points 1, 2, 3, ... of the bases 2 and 5, shifted.
        for (axis, points) in [
            (0, [0.5, 0.25, 0.75, 0.125, 0.625]),
            (2, [0.2, 0.4, 0.6, 0.8, 0.04]),
        ] {
            let [lo, hi] = ranges[axis];
            let share = |index: usize| (starts[index][axis] - lo) / (hi - lo);
            for index in 1..5 {
                let moved = share(index) - share(0);
                let requested = points[index] - points[0];
                let turns = moved - requested;
                assert!(
                    (turns - turns.round()).abs() < 1e-12,
                    "{axis} {index}: {moved}"
                );
            }
        }
        for axis in 0..3 {
            let values = starts.iter().map(|x| x[axis]);
            let spread = values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min);
            assert!(spread > 1.0, "{axis}: {spread}");
        }
        for x in starts {
            let window = Problem::window(x);
            // One layer is the least, and may lie half outside.
            let layer_m = domain.depth_min_m;
            let out_m = if window.depth_m <= layer_m * (1.0 + 1e-12) {
                0.5 * layer_m
            } else {
                1e-14
            };
            let met = window.inner_radius_m >= 0.0065 - out_m
                && window.outer_radius_m() <= 0.035 + out_m
                && window.depth_m >= layer_m * (1.0 - 1e-12)
                && window.length_m >= domain.length_m[0] * (1.0 - 1e-12)
                && window.length_m <= 0.1 * (1.0 + 1e-12);
            assert!(met, "{window:?}");
        }
    }

    #[test]
    fn too_much_wire_is_shortened_and_thinned() {
        let limits = Limits {
            resistance_max_ohm: Some(0.7),
            outer_diameter_max_m: Some(0.07),
            length_max_m: Some(0.1),
            ..Limits::default()
        };
        let (model, task) = (air(0.03), task(limits, None));
        let domain = Domain::of(&Problem::of_wire(&model, &task, task.strands[0])[0]);
        for index in 0..64 {
            let window = Problem::window(start(&domain, 0.03, 7, index));
            let excess = window.volume_over_pi_m3().value / domain.volume_m3[1];
            let least = window.depth_m <= domain.depth_min_m * (1.0 + 1e-12)
                || window.length_m <= domain.length_m[0] * (1.0 + 1e-12);
            assert!(excess <= 1.0 + 1e-12 || least, "{window:?} {excess}");
        }
    }
}
