//! The difference of two forces in units of what a finger just notices.
//!
//! ```text
//! d = |F_a - F_b| / max(w max(|F_a|, |F_b|), F_0)
//! ```
//!
//! with w the just-noticeable relative difference and F_0 the smallest force that is felt at all.
//! Symmetric in both; where one force vanishes and the other is strong, d = 1/w; opposite forces differ by up
//! to 2/w, the most there is.

use crate::numerics::vec3::{dot, plus};
use crate::units::DETECTION_THRESHOLD_N;

fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

/// A force, and the sum of its parts' sizes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Felt {
    /// Along x, y and z, N.
    pub force_n: [f64; 3],
    /// The coils' forces along each, added without signs, N.
    pub gross_n: [f64; 3],
}

impl Felt {
    /// The force of `currents_a` for forces per ampere `row`, and without any current.
    #[must_use]
    pub fn of(row: &[[f64; 3]], currents_a: &[f64], passive_n: [f64; 3]) -> Self {
        let mut felt = Self {
            force_n: passive_n,
            gross_n: [0.0; 3],
        };
        for (per_ampere, current) in row.iter().zip(currents_a) {
            let part = per_ampere.map(|force| force * current);
            felt.force_n = plus(felt.force_n, part);
            felt.gross_n = plus(felt.gross_n, part.map(f64::abs));
        }
        felt
    }

    /// Its upward part alone.
    #[must_use]
    pub fn upward(self) -> Self {
        Self {
            force_n: [0.0, 0.0, self.force_n[2]],
            gross_n: [0.0, 0.0, self.gross_n[2]],
        }
    }
}

/// Forces of two objects at the places of one surface; as many of either.
#[derive(Debug, Clone, Copy)]
pub struct Sides<'a> {
    /// Of the first.
    pub a: &'a [Felt],
    /// Of the second.
    pub b: &'a [Felt],
}

/// How much two objects differ over the places of two surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Difference {
    /// The largest, in just-noticeable differences.
    pub largest: f64,
    /// Root mean square, each surface counting half.
    pub rms: f64,
    /// Share of the places with more than one, each surface counting half.
    pub felt_share: f64,
    /// Surface (0 or 1) and place of the largest.
    pub at: (usize, usize),
    /// The first's force there.
    pub a: Felt,
    /// The second's.
    pub b: Felt,
}

impl Difference {
    /// First-order error of the largest, where each coil's force is wrong by `part` of itself and either object's by its
    /// part of the `constants`.
    #[must_use]
    pub fn error(&self, part: f64, constants: [f64; 2], jnd: f64) -> f64 {
        let off_n = |felt: Felt, constant: f64| {
            part * length(felt.gross_n) + constant * length(felt.force_n)
        };
        let [of_a, of_b] = constants;
        (off_n(self.a, of_a) + off_n(self.b, of_b)) / scale_n(self.a, self.b, jnd)
    }
}

/// The difference that is just noticed, N.
fn scale_n(a: Felt, b: Felt, jnd: f64) -> f64 {
    (jnd * length(a.force_n).max(length(b.force_n))).max(DETECTION_THRESHOLD_N)
}

/// How much stronger `a` pushes up than `b`, in just-noticeable differences of the upward force; negative
/// where it is weaker.
#[must_use]
pub fn stronger(a: Felt, b: Felt, jnd: f64) -> f64 {
    let (a, b) = (a.upward(), b.upward());
    (a.force_n[2] - b.force_n[2]) / scale_n(a, b, jnd)
}

/// Compares over the places of both surfaces, neither of them empty.
#[must_use]
pub fn difference(surfaces: [Sides; 2], jnd: f64) -> Difference {
    let mut found = Difference {
        largest: -1.0,
        rms: 0.0,
        felt_share: 0.0,
        at: (0, 0),
        a: Felt::default(),
        b: Felt::default(),
    };
    for (surface, sides) in surfaces.into_iter().enumerate() {
        let (mut squares, mut felt) = (0.0, 0_usize);
        for (row, (&a, &b)) in sides.a.iter().zip(sides.b).enumerate() {
            let apart: [f64; 3] = std::array::from_fn(|axis| a.force_n[axis] - b.force_n[axis]);
            let d = length(apart) / scale_n(a, b, jnd);
            squares += d * d;
            felt += usize::from(d > 1.0);
            if d > found.largest {
                (found.largest, found.at, found.a, found.b) = (d, (surface, row), a, b);
            }
        }
        let count = sides.a.len().max(1) as f64;
        found.rms += 0.5 * squares / count;
        found.felt_share += 0.5 * felt as f64 / count;
    }
    found.largest = found.largest.max(0.0);
    found.rms = found.rms.sqrt();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn felt(forces: &[f64]) -> Vec<Felt> {
        forces
            .iter()
            .map(|f| Felt::of(&[[0.0, 0.0, *f]], &[1.0], [0.0; 3]))
            .collect()
    }

    #[test]
    fn both_scales_and_both_surfaces_count() {
        // 1 mN of 100 mN: 1/7; 1.2 mN of 2 mN: 1.5 thresholds; 50 mN beside nothing: 1/0.07.
        let (a, b) = (felt(&[0.1, 2e-3]), felt(&[0.099, 0.8e-3]));
        let (c, d) = (felt(&[0.05]), felt(&[0.0]));
        let surfaces = [Sides { a: &a, b: &b }, Sides { a: &c, b: &d }];
        let found = difference(surfaces, 0.07);
        assert!((found.largest * 0.07 - 1.0).abs() < 1e-14);
        assert_eq!((found.at, found.a.force_n[2]), ((1, 0), 0.05));
        let squares = 0.25 * ((1.0_f64 / 7.0).powi(2) + 1.5 * 1.5) + 0.5 / 0.0049;
        assert!((found.rms / squares.sqrt() - 1.0).abs() < 1e-14);
        assert_eq!(found.felt_share, 0.75);
        assert_eq!(stronger(c[0], d[0], 0.07), found.largest);
        assert_eq!(stronger(d[0], c[0], 0.07), -found.largest);
        assert!((found.error(1e-4, [0.0; 2], 0.07) - 1e-4 / 0.07).abs() < 1e-15);
        // The second gives nothing there.
        let of_constants = found.error(0.0, [0.02, 0.5], 0.07);
        assert!((of_constants - 0.02 / 0.07).abs() < 1e-15);
    }

    #[test]
    fn opposite_parts_cancel_in_the_force_and_not_in_its_error() {
        let rows = [[0.2, 0.0, 0.7], [0.0, 0.0, -1.3]];
        let felt = Felt::of(&rows, &[1.3, 0.7], [0.0, 0.0, 0.1]);
        assert!((felt.force_n[2] - 0.1).abs() < 1e-15 && felt.force_n[0] == 0.26);
        assert!((felt.gross_n[2] - 1.82).abs() < 1e-15 && felt.gross_n[0] == 0.26);
        assert_eq!(felt.upward().force_n, [0.0, 0.0, felt.force_n[2]]);
    }
}
