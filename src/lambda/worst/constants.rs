//! The worst-point force constants without the path: programs at one force constant each.
//!
//! t* is convex in lambda, and the multipliers at any lambda give a line below all of it. So
//! from a lambda above every limit the lines lead down to where t* leaves the errors that are
//! allowed (Newton's method, which ends on the piece that decides). t_0 is a line without an offset;
//! with one it is convex too, and below the chord between any two of its values.

use super::doubles::{Doubles, Failure, Optimum};
use super::scaled::{Form, Limits, Scaled};
use crate::problem::ForceProblem;
use crate::qr_reduction::{largest_entries, times_power};
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// Above this share of lambda max h, or of what rounding may hide, t* has left t_0.
const VISIBLE: f64 = 1e-12;
/// The same where t_0 is zero.
const ALMOST_NONE: f64 = 1e-14;
/// A scaled lambda above which no limit begins to bind: 1 is a force near the largest of one coil.
const FAR: f64 = (1 << 20) as f64;
/// A doubt beyond which doubles do not lead to the constants, without a leeway and with one.
const MOST_DOUBT: [f64; 2] = [1e-6, 1e-2];
/// More lines than lead to any constant.
const LINES: usize = 200;

/// Force constants, in scaled units.
pub(super) struct Constants {
    /// Where t* leaves t_0.
    pub linear: Option<Num>,
    /// The largest lambda with `t* - t_0 <= weight lambda max h`.
    pub jnd: Option<Num>,
    /// t_0 at lambda = 1; `None` with an offset.
    pub floor: Option<Num>,
    /// Share of lambda max h plus the offset that rounding may hide.
    pub doubt: f64,
}

impl Constants {
    /// The share of lambda max h plus the offset above which t* has left t_0.
    pub(super) fn visible(&self) -> f64 {
        visible(self.doubt)
    }
}

fn visible(doubt: f64) -> f64 {
    VISIBLE.max(4.0 * doubt)
}

/// A value and a slope.
#[derive(Debug, Clone, Copy)]
struct Line {
    lambda: Num,
    value: Num,
    slope: Num,
}

impl Line {
    fn of(optimum: &Optimum) -> Self {
        let piece = &optimum.piece;
        let last = piece.z.len() - 1;
        Self {
            lambda: piece.start,
            value: piece.z[last],
            slope: piece.rate[last],
        }
    }

    fn at(&self, lambda: Num) -> Num {
        self.value + (lambda - self.lambda) * self.slope
    }
}

/// Solves for the constants of `limited` against `free`, the same without the drivers' size.
///
/// # Errors
/// Where one of the programs has no solution in doubles, or only one in too much doubt.
pub(super) fn constants(
    limited: &Scaled,
    free: &Scaled,
    weight: f64,
) -> Result<Constants, Failure> {
    let mut errors = Errors {
        limited: Doubles::new(limited, Form::Worst),
        free: Doubles::new(free, Form::Worst),
        proportional: None,
        top: limited.top(),
        without: Num::ZERO,
        doubt: 0.0,
        most_doubt: MOST_DOUBT[usize::from(limited.leeway > 0.0)],
    };
    if free.offset_n() == 0.0 {
        errors.proportional = Some(errors.free_line(Num::ONE)?);
    }
    errors.without = errors.limited_line(Num::ZERO)?.value.larger(Num::ZERO);
    let linear = errors.largest_within(Num::ZERO)?;
    let jnd = match linear {
        Some(_) if weight > 0.0 => errors.largest_within(Num::of(weight))?,
        other => other,
    };
    Ok(Constants {
        linear,
        jnd,
        floor: errors.proportional.map(|line| line.value),
        doubt: errors.doubt,
    })
}

/// A force constant, N/m, `share` of the largest at which there are currents without any error at the points,
/// and such currents, A, as far as doubles have them; `None` where doubles do not lead to it. Without the
/// drivers' size there are to be currents without error at every lambda.
pub(crate) fn without_error(problem: &ForceProblem, share: f64) -> Option<(f64, Vec<f64>)> {
    let largest = largest_entries(problem);
    let scaled = Scaled::new(problem, &largest, Form::Worst, Limits::All);
    let mut limited = Doubles::new(&scaled, Form::Worst);
    let mut lambda = Num::of(FAR);
    for _ in 0..LINES {
        fluxform_base::progress::poll();
        let line = Line::of(&limited.at(lambda).ok()?);
        // A tangent of a convex function leads from above to where it is zero, or stays above.
        let step = line.value / line.slope;
        if line.value <= Num::of(ALMOST_NONE) * scaled.top() * lambda
            || step <= Num::of(VISIBLE) * lambda
        {
            lambda = lambda * Num::of(share);
            let currents_a = scaled.currents_a(&limited.at(lambda).ok()?.piece.z);
            return Some((
                times_power(lambda.to_f64(), scaled.lambda_unit()),
                currents_a,
            ));
        }
        lambda -= step;
    }
    None
}

/// t* and t_0 at one lambda at a time.
struct Errors<'s, 'a> {
    limited: Doubles<'s, 'a>,
    free: Doubles<'s, 'a>,
    /// t_0 where it is a line.
    proportional: Option<Line>,
    top: Num,
    /// t* without currents' need: at lambda = 0.
    without: Num,
    doubt: f64,
    most_doubt: f64,
}

impl Errors<'_, '_> {
    fn limited_line(&mut self, lambda: Num) -> Result<Line, Failure> {
        let optimum = self.limited.at(lambda)?;
        self.line(&optimum)
    }

    fn free_line(&mut self, lambda: Num) -> Result<Line, Failure> {
        if let Some(line) = self.proportional {
            return Ok(Line {
                lambda,
                value: line.at(lambda),
                slope: line.slope,
            });
        }
        let optimum = self.free.at(lambda)?;
        self.line(&optimum)
    }

    /// The line at an optimum, unless it is in too much doubt.
    fn line(&mut self, optimum: &Optimum) -> Result<Line, Failure> {
        let line = Line::of(optimum);
        let size = (line.lambda * self.top + self.without).to_f64();
        if size > 0.0 {
            self.doubt = self.doubt.max(optimum.doubt / size);
        }
        if self.doubt > self.most_doubt {
            return Err(Failure::Stalled);
        }
        Ok(line)
    }

    /// The rounding error of `t* - t_0` at `lambda`.
    fn visible(&self, lambda: Num) -> Num {
        Num::of(visible(self.doubt)) * (self.top * lambda + self.without)
    }

    /// The largest lambda with `t* - t_0 <= weight lambda max h`; `None`: all are.
    fn largest_within(&mut self, weight: Num) -> Result<Option<Num>, Failure> {
        let share = weight * self.top;
        let mut low = self.free_line(Num::ZERO)?;
        let far = Num::of(FAR);
        let mut high = [self.limited_line(far)?, self.free_line(far)?];
        let excess = |[t, free]: [Line; 2]| t.value - free.value - share * t.lambda;
        if excess(high) <= self.visible(far) {
            return Ok(None);
        }
        for _ in 0..LINES {
            fluxform_base::progress::poll();
            let at = high[0].lambda;
            let above = excess(high);
            // Below the chord from `low` t_0 leaves t* no lower than this line.
            let chord = (high[1].value - low.value) / (at - low.lambda);
            let rate = high[0].slope - chord - share;
            let by_chord = at - above / rate;
            if above <= self.rounding(at, weight) || rate <= Num::ZERO {
                return Ok(Some(at));
            }
            if by_chord <= low.lambda {
                return Ok(Some(low.lambda.larger(Num::ZERO)));
            }
            // The tangent of t_0 leads further where t_0 bends: there the chord is steeper.
            let by_tangent =
                at - above / (high[0].slope - high[1].slope - share).larger(rate * Num::of(0.25));
            let next = if by_tangent < by_chord && by_tangent > low.lambda {
                let near = [self.limited_line(by_tangent)?, self.free_line(by_tangent)?];
                if excess(near) <= self.rounding(by_tangent, weight) {
                    low = near[1];
                    by_chord
                } else if near[0].slope - near[1].slope >= share {
                    high = near;
                    continue;
                } else {
                    by_chord
                }
            } else {
                by_chord
            };
            high = [self.limited_line(next)?, self.free_line(next)?];
        }
        Ok(Some(high[0].lambda))
    }

    /// An excess that ends the search: with a weight t* crosses what is allowed at an angle.
    fn rounding(&self, lambda: Num, weight: Num) -> Num {
        if weight > Num::ZERO {
            Num::of(1e-3) * self.visible(lambda)
        } else {
            self.visible(lambda)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::scaled::Limits;
    use super::super::worst_point;
    use super::*;
    use crate::problem::{ForceProblem, Settings};
    use crate::qr_reduction::largest_entries;

    /// Of so many points a sample is looked at first: what it misses, ripples a few points wide among
    /// them, decides as it does on the path.
    #[test]
    fn constants_from_a_sample_of_the_points_are_those_of_the_path() {
        const SIDE: usize = 130;
        let (mut forces_n_per_a, mut height_m) = (Vec::new(), Vec::new());
        for k in 0..SIDE * SIDE {
            let [x, y] = [k % SIDE, k / SIDE].map(|i| i as f64 / (SIDE - 1) as f64 - 0.5);
            for coil in 0..9 {
                let [u, v] = [coil % 3, coil / 3].map(|i| 0.3 * (f64::from(i) - 1.0));
                let square = (x - u).powi(2) + (y - v).powi(2) + 0.09;
                forces_n_per_a.push(0.02 * square.powf(-2.5) * (0.09 - 0.3 * (square - 0.09)));
            }
            let ripple = 0.002 * (211.0 * x).sin() * (173.0 * y).cos();
            height_m.push(0.04 + 0.02 * x - 0.013 * y + ripple);
        }
        let problem = ForceProblem {
            forces_n_per_a: &forces_n_per_a,
            height_m: &height_m,
            offset_n: None,
            weights: None,
            lower_a: &[0.0; 9],
            upper_a: &[2.0, 1.7, 1.9, 2.1, 1.3, 1.8, 2.2, 1.6, 1.5],
            total_max_a: Some(13.0),
            resistance_ohm: &[6.0; 9],
        };
        let settings = Settings::default();
        let by_path = worst_point(&problem, &settings).unwrap();
        assert!(by_path.path.is_some() && by_path.complete);
        let largest = largest_entries(&problem);
        let without_path = |leeway| {
            let [limited, free] = [Limits::All, Limits::Lower].map(|limits| {
                let mut scaled = Scaled::new(&problem, &largest, Form::Worst, limits);
                scaled.leeway = leeway;
                scaled
            });
            let constants = constants(&limited, &free, settings.jnd_weight).ok();
            super::super::without_path(&limited, &constants.unwrap())
        };
        let alone = without_path(0.0);
        let pairs = [
            (alone.lambda_linear_n_per_m, by_path.lambda_linear_n_per_m),
            (alone.lambda_jnd_n_per_m, by_path.lambda_jnd_n_per_m),
            (alone.floor, by_path.floor),
        ];
        for (alone, by_path) in pairs {
            let (alone, by_path) = (alone.unwrap(), by_path.unwrap());
            assert!((alone / by_path - 1.0).abs() < 1e-10, "{alone} {by_path}");
        }
        let point = super::super::least_worst_error(&problem, alone.lambda_jnd_n_per_m.unwrap());
        assert!(point.gap_n < 1e-12 * point.worst_error_n, "{point:?}");
        // A leeway moves t* by no more than it says.
        let near = without_path(1e-6);
        let stated = near.accuracy.estimate;
        assert!((1e-6..1e-5).contains(&stated), "{stated}");
        assert!((near.floor.unwrap() - by_path.floor.unwrap()).abs() < stated);
        let (near, by_path) = (near.lambda_jnd_n_per_m, by_path.lambda_jnd_n_per_m);
        let off = near.unwrap() / by_path.unwrap() - 1.0;
        assert!(off.abs() < 4.0 * stated / settings.jnd_weight, "{off}");
    }
}
