//! The magnetisation curve of a steel, from a table of points.
//!
//! H(B) is the monotone piecewise cubic of Fritsch and Carlson (SIAM J. Numer. Anal. 17, 1980)
//! with the slopes of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5, 1984): weighted harmonic
//! means inside, one-sided three-point formulas at the ends, the choice that PCHIP commonly names.
//! It is odd in B, and beyond the last point its slope is that of vacuum, 1/mu_0.

use super::bh_check::{self, BhCurveError, BhWarning, Slopes};
use fluxform_base::units::MU_0_T_M_PER_A;

/// Share of its largest value at which the differential permeability marks the knee.
const KNEE_SHARE: f64 = 0.1;

/// Newton steps of the inverse before bisection must have finished: far more than either needs.
const INVERSE_STEPS: usize = 200;

/// A steel's magnetisation curve H(B), without hysteresis.
#[derive(Debug, Clone, PartialEq)]
pub struct BhCurve {
    b_t: Vec<f64>,
    h_a_per_m: Vec<f64>,
    /// One cubic an interval: H = H_k + t (c_0 + t (c_1 + t c_2)), t = B - B_k.
    cubics: Vec<[f64; 3]>,
    /// Integral of H dB from 0 to each point, J/m^3.
    energy_j_per_m3: Vec<f64>,
    /// dH/dB at the last point, seen from below, m/H.
    last_slope: f64,
}

impl BhCurve {
    /// The curve through the points (B in T, H in A/m), the first of which is the origin.
    ///
    /// # Errors
    /// Columns of different length, fewer than two points after the origin, a first point that
    /// is not (0, 0), a number that is not finite or out of range, a column that does not grow,
    /// and a step in which B grows by clearly less than in vacuum.
    pub fn new(b_t: &[f64], h_a_per_m: &[f64]) -> Result<Self, BhCurveError> {
        bh_check::points(b_t, h_a_per_m)?;
        let slopes = slopes(b_t, h_a_per_m);
        let mut cubics = Vec::with_capacity(b_t.len() - 1);
        let mut energy_j_per_m3 = vec![0.0];
        let mut energy = 0.0;
        for (k, step) in b_t.windows(2).enumerate() {
            let width = step[1] - step[0];
            let chord = (h_a_per_m[k + 1] - h_a_per_m[k]) / width;
            let cubic = [
                slopes[k],
                (3.0 * chord - 2.0 * slopes[k] - slopes[k + 1]) / width,
                (slopes[k] + slopes[k + 1] - 2.0 * chord) / width / width,
            ];
            energy += h_a_per_m[k] * width + area(&cubic, width);
            cubics.push(cubic);
            energy_j_per_m3.push(energy);
        }
        Ok(Self {
            b_t: b_t.to_vec(),
            h_a_per_m: h_a_per_m.to_vec(),
            cubics,
            energy_j_per_m3,
            last_slope: slopes[b_t.len() - 1],
        })
    }

    /// Warnings about the table, which is used all the same: units, steps, where it ends.
    #[must_use]
    pub fn warnings(&self) -> Vec<BhWarning> {
        let slopes = Slopes {
            first: self.dh_db(0.0),
            last: self.last_slope,
            steepest: (0..self.cubics.len())
                .map(|k| self.steepest_slope(k))
                .collect(),
        };
        bh_check::warnings(&slopes, &self.b_t, &self.h_a_per_m)
    }

    /// H at the flux density `b_t`, A/m; odd in B.
    ///
    /// Error bound: a few units of the last digit, near the origin too.
    #[must_use]
    pub fn h_a_per_m(&self, b_t: f64) -> f64 {
        let size = b_t.abs();
        let h = match self.interval(size) {
            Some(k) => {
                let t = size - self.b_t[k];
                let [c0, c1, c2] = self.cubics[k];
                self.h_a_per_m[k] + t * (c0 + t * (c1 + t * c2))
            }
            None => self.largest_h_a_per_m() + (size - self.largest_b_t()) / MU_0_T_M_PER_A,
        };
        h.copysign(b_t)
    }

    /// Differential reluctivity dH/dB, m/H; even in B. At the last point it jumps to 1/mu_0.
    #[must_use]
    pub fn dh_db(&self, b_t: f64) -> f64 {
        let size = b_t.abs();
        match self.interval(size) {
            Some(k) => self.slope_in(k, size - self.b_t[k]),
            None => 1.0 / MU_0_T_M_PER_A,
        }
    }

    /// The flux density at the field `h_a_per_m`, T: the inverse of [`BhCurve::h_a_per_m`].
    ///
    /// Newton's method inside a bracket that only shrinks; to rounding.
    #[must_use]
    pub fn b_t(&self, h_a_per_m: f64) -> f64 {
        let size = h_a_per_m.abs();
        let above = self.h_a_per_m.partition_point(|&h| h <= size);
        let b = if above == self.h_a_per_m.len() {
            self.largest_b_t() + (size - self.largest_h_a_per_m()) * MU_0_T_M_PER_A
        } else if above == 0 {
            f64::NAN // `size` is not a number
        } else {
            self.b_t[above - 1] + self.inverse_in(above - 1, size)
        };
        b.copysign(h_a_per_m)
    }

    /// The t in interval `k` at which H is `h`.
    fn inverse_in(&self, k: usize, h: f64) -> f64 {
        let rise = h - self.h_a_per_m[k];
        let [c0, c1, c2] = self.cubics[k];
        let (mut low, mut high) = (0.0, self.b_t[k + 1] - self.b_t[k]);
        let mut t = high * (rise / (self.h_a_per_m[k + 1] - self.h_a_per_m[k]));
        for _ in 0..INVERSE_STEPS {
            let excess = t * (c0 + t * (c1 + t * c2)) - rise;
            if excess == 0.0 {
                break;
            }
            if excess > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let newton = t - excess / self.slope_in(k, t);
            let next = if low < newton && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            let moved = (next - t).abs();
            t = next;
            if moved <= f64::EPSILON * t {
                break;
            }
        }
        t
    }

    /// Magnetic energy density, the integral of H dB from 0, J/m^3; even in B.
    ///
    /// The integral of the cubics is exact.
    #[must_use]
    pub fn energy_j_per_m3(&self, b_t: f64) -> f64 {
        let size = b_t.abs();
        match self.interval(size) {
            Some(k) => {
                let t = size - self.b_t[k];
                self.energy_j_per_m3[k] + self.h_a_per_m[k] * t + area(&self.cubics[k], t)
            }
            None => {
                let t = size - self.largest_b_t();
                let last = self.energy_j_per_m3[self.cubics.len()];
                last + t * (self.largest_h_a_per_m() + 0.5 * t / MU_0_T_M_PER_A)
            }
        }
    }

    /// B / (mu_0 H) as B goes to 0; infinite where the cubic starts level
    /// ([`BhWarning::LevelOrigin`]).
    #[must_use]
    pub fn initial_relative_permeability(&self) -> f64 {
        1.0 / (MU_0_T_M_PER_A * self.cubics[0][0])
    }

    /// The secant B / (mu_0 H); at 0 its limit.
    #[must_use]
    pub fn relative_permeability(&self, b_t: f64) -> f64 {
        let h = self.h_a_per_m(b_t);
        if h == 0.0 {
            return self.initial_relative_permeability();
        }
        b_t / (MU_0_T_M_PER_A * h)
    }

    /// B of the table's last point, T.
    #[must_use]
    pub fn largest_b_t(&self) -> f64 {
        self.b_t[self.b_t.len() - 1]
    }

    fn largest_h_a_per_m(&self) -> f64 {
        self.h_a_per_m[self.h_a_per_m.len() - 1]
    }

    /// The knee, T: the lowest B above the most permeable step of the table at which the
    /// differential permeability has fallen to a tenth of that step's; the last point where it
    /// never does.
    #[must_use]
    pub fn knee_t(&self) -> f64 {
        let chord = |k: usize| {
            (self.h_a_per_m[k + 1] - self.h_a_per_m[k]) / (self.b_t[k + 1] - self.b_t[k])
        };
        let steps = 0..self.cubics.len();
        let most_permeable = steps
            .clone()
            .fold(0, |best, k| if chord(k) < chord(best) { k } else { best });
        let requested = chord(most_permeable) / KNEE_SHARE;
        let reaches = steps.skip(most_permeable + 1).find_map(|k| {
            let width = self.b_t[k + 1] - self.b_t[k];
            self.first_of_slope(k, width, requested)
                .map(|t| self.b_t[k] + t)
        });
        reaches.unwrap_or_else(|| self.largest_b_t())
    }

    /// The first t in interval `k` with a slope of `requested` or more.
    fn first_of_slope(&self, k: usize, width: f64, requested: f64) -> Option<f64> {
        if self.slope_in(k, 0.0) >= requested {
            return Some(0.0);
        }
        // Up to its steepest place the slope, a parabola, only grows or falls below its start.
        let steepest = self.steepest_in(k, width);
        if self.slope_in(k, steepest) < requested {
            return None;
        }
        let (mut low, mut high) = (0.0, steepest);
        loop {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                return Some(high);
            }
            if self.slope_in(k, middle) < requested {
                low = middle;
            } else {
                high = middle;
            }
        }
    }

    fn slope_in(&self, k: usize, t: f64) -> f64 {
        let [c0, c1, c2] = self.cubics[k];
        c0 + t * (2.0 * c1 + t * (3.0 * c2))
    }

    /// Where in interval `k` the slope is largest.
    fn steepest_in(&self, k: usize, width: f64) -> f64 {
        let [_, c1, c2] = self.cubics[k];
        let summit = -c1 / (3.0 * c2);
        if c2 < 0.0 && summit > 0.0 && summit < width {
            return summit;
        }
        if self.slope_in(k, width) > self.slope_in(k, 0.0) {
            width
        } else {
            0.0
        }
    }

    /// The largest dH/dB in the step from point `k` to the next, m/H.
    fn steepest_slope(&self, k: usize) -> f64 {
        let width = self.b_t[k + 1] - self.b_t[k];
        self.slope_in(k, self.steepest_in(k, width))
    }

    /// The interval that holds |B|; none from the last point on.
    fn interval(&self, size: f64) -> Option<usize> {
        let above = self.b_t.partition_point(|&b| b <= size);
        // `above` is 0 only for NaN, which the first cubic passes on.
        (above < self.b_t.len()).then(|| above.saturating_sub(1))
    }
}

/// Integral of a cubic without its constant from 0 to `t`.
fn area(cubic: &[f64; 3], t: f64) -> f64 {
    let [c0, c1, c2] = cubic;
    t * t * (c0 / 2.0 + t * (c1 / 3.0 + t * (c2 / 4.0)))
}

/// dH/dB at every point, m/H.
fn slopes(b: &[f64], h: &[f64]) -> Vec<f64> {
    let widths: Vec<f64> = b.windows(2).map(|s| s[1] - s[0]).collect();
    let chords: Vec<f64> = h
        .windows(2)
        .zip(&widths)
        .map(|(s, width)| (s[1] - s[0]) / width)
        .collect();
    let last = chords.len() - 1;
    let inner = (1..=last).map(|k| {
        let first = 2.0 * widths[k] + widths[k - 1];
        let second = widths[k] + 2.0 * widths[k - 1];
        (first + second) / (first / chords[k - 1] + second / chords[k])
    });
    let start = end_slope([widths[0], widths[1]], [chords[0], chords[1]]);
    let end = end_slope(
        [widths[last], widths[last - 1]],
        [chords[last], chords[last - 1]],
    );
    std::iter::once(start)
        .chain(inner)
        .chain(std::iter::once(end))
        .collect()
}

/// The three-point slope at an end, nearest interval first; 0 where it would fall. As both
/// chords rise it stays under twice the nearer one.
fn end_slope(widths: [f64; 2], chords: [f64; 2]) -> f64 {
    let [near, far] = widths;
    let slope = ((2.0 * near + far) * chords[0] - near * chords[1]) / (near + far);
    slope.max(0.0)
}
