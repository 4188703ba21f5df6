//! The worst-point force constants without the path: programs at one force constant each, solved at vertices or by the
//! interior-point method.
//!
//! t* is convex in lambda, and the multipliers at any lambda give a line below all of it. So
//! from a lambda above every limit the lines lead down to where t* leaves the errors that are
//! allowed (Newton's method, which ends on the piece that decides). t_0 is a line without an offset;
//! with one it is convex too, and below the chord between any two of its values.

use super::doubles::Doubles;
use super::interior::Interior;
use super::scaled::{Form, Limits, Scaled};
use crate::problem::ForceProblem;
use crate::qr_reduction::{largest_entries, times_power};
use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

/// Above this share of lambda max h, or of what may hide it, t* has left t_0.
const VISIBLE: f64 = 1e-12;
/// The same in gaps of the two.
const VISIBLE_GAPS: f64 = 4.0;
/// The same where t_0 is zero.
const ALMOST_NONE: f64 = 1e-14;
/// A scaled lambda above which no limit begins to bind: 1 is a force near the largest of one coil.
const FAR: f64 = (1 << 20) as f64;
/// A multiple of where the lines from there lead.
const NEAR: f64 = 4.0;
/// Shares of the largest force by which t* is not known at a vertex, or within: then nothing is.
const MOST_DOUBT: [f64; 2] = [1e-6, 1e-2];
/// Multiplications by the number of coils cubed that currents without error are worth: a path can begin without them.
const SHORT: usize = 100;
/// More lines than lead to any constant.
const LINES: usize = 200;

/// Force constants, in scaled units.
pub(super) struct Constants {
    /// Where t* leaves t_0.
    pub linear: Option<f64>,
    /// The largest lambda with `t* - t_0 <= weight lambda max h`.
    pub jnd: Option<f64>,
    /// t_0 at lambda = 1; `None` with an offset.
    pub floor: Option<f64>,
    /// Share of lambda max h plus the offset by which t* may be off where they are read off.
    pub doubt: f64,
    /// How that is estimated.
    pub method: &'static str,
}

/// How the error of t* is estimated at vertices.
pub(super) const OF_VERTICES: &str =
    "rounding of the forces of the points that are not in the program";
/// The same of the interior-point method.
const OF_CENTRES: &str = "gap of the proof where the constants are read off";

impl Constants {
    /// The share of lambda max h plus the offset above which t* has left t_0.
    pub(super) fn visible(&self) -> f64 {
        VISIBLE.max(VISIBLE_GAPS * self.doubt)
    }
}

/// A value, how far below it the least may be, and a slope.
#[derive(Debug, Clone, Copy)]
struct Line {
    lambda: f64,
    value: f64,
    gap: f64,
    slope: f64,
}

/// Solves for the constants of `limited` against `free`, the same without the drivers' size, at vertices; `None` where
/// doubles do not lead to one, or t* is in too much doubt.
pub(super) fn by_vertices(limited: &Scaled, free: &Scaled, weight: f64) -> Option<Constants> {
    let vertices = |scaled| Optima::Vertices(Box::new(Doubles::new(scaled, Form::Worst)));
    constants([limited, free].map(vertices), limited, weight, OF_VERTICES)
}

/// The same by the interior-point method.
pub(super) fn by_centres(limited: &Scaled, free: &Scaled, weight: f64) -> Option<Constants> {
    let centres = |scaled| Optima::Centres(Box::new(Interior::new(scaled)));
    constants([limited, free].map(centres), limited, weight, OF_CENTRES)
}

fn constants(
    [limited, free]: [Optima; 2],
    scaled: &Scaled,
    weight: f64,
    method: &'static str,
) -> Option<Constants> {
    let offset_n = scaled.offset_n();
    let mut errors = Errors {
        limited,
        free,
        proportional: None,
        top: scaled.top().to_f64(),
        without: 0.0,
        doubt: 0.0,
    };
    if offset_n == 0.0 {
        // No currents do at lambda = 0.
        let line = errors.free_line(1.0)?;
        errors.doubt_at(line.gap, 1.0);
        errors.proportional = Some(line);
    } else {
        errors.without = errors.limited_line(0.0)?.value.max(0.0);
    }
    let linear = errors.largest_within(0.0)?;
    let jnd = match linear {
        Some(_) if weight > 0.0 => errors.largest_within(weight)?,
        other => other,
    };
    Some(Constants {
        linear,
        jnd,
        floor: errors.proportional.map(|line| line.value),
        doubt: errors.doubt,
        method,
    })
}

/// A force constant, N/m, `share` of the largest at which there are currents without any error at the points,
/// and such currents, A, as far as doubles have them; `None` where doubles do not lead to it. Without the
/// drivers' size there are to be currents without error at every lambda.
pub(crate) fn without_error(problem: &ForceProblem, share: f64) -> Option<(f64, Vec<f64>)> {
    let largest = largest_entries(problem);
    let scaled = Scaled::new(problem, &largest, Form::Worst, Limits::All);
    let mut limited = Doubles::new(&scaled, Form::Worst);
    limited.work = limited.work.min(SHORT * problem.coils().pow(3));
    let mut lambda = Num::of(FAR);
    for _ in 0..LINES {
        fluxform_base::progress::poll();
        let piece = limited.at(lambda).ok()?.piece;
        let last = piece.z.len() - 1;
        let (value, slope) = (piece.z[last], piece.rate[last]);
        // A tangent of a convex function leads from above to where it is zero, or stays above.
        let step = value / slope;
        if value <= Num::of(ALMOST_NONE) * scaled.top() * lambda
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
    limited: Optima<'s, 'a>,
    free: Optima<'s, 'a>,
    /// t_0 where it is a line.
    proportional: Option<Line>,
    top: f64,
    /// t* without currents' need: at lambda = 0.
    without: f64,
    doubt: f64,
}

impl Errors<'_, '_> {
    fn limited_line(&mut self, lambda: f64) -> Option<Line> {
        self.limited.line(lambda)
    }

    fn free_line(&mut self, lambda: f64) -> Option<Line> {
        if let Some(line) = self.proportional {
            return Some(Line {
                lambda,
                value: lambda * line.value,
                gap: lambda * line.gap,
                slope: line.slope,
            });
        }
        self.free.line(lambda)
    }

    fn size(&self, lambda: f64) -> f64 {
        self.top * lambda + self.without
    }

    /// Takes the gap at `lambda` into the doubt; without heights there is no force to be a share of.
    fn doubt_at(&mut self, gap: f64, lambda: f64) {
        let size = self.size(lambda);
        if size > 0.0 {
            self.doubt = self.doubt.max(gap / size);
        }
    }

    /// What may hide `t* - t_0`.
    fn visible(&self, [t, free]: [Line; 2]) -> f64 {
        (VISIBLE * self.size(t.lambda)).max(VISIBLE_GAPS * (t.gap + free.gap))
    }

    /// The largest lambda with `t* - t_0 <= weight lambda max h`; `Some(None)`: all are.
    fn largest_within(&mut self, weight: f64) -> Option<Option<f64>> {
        let share = weight * self.top;
        // With a weight t* crosses what is allowed at an angle.
        let grain = if weight > 0.0 { 1e-3 } else { 1.0 };
        let mut low = self.free_line(0.0)?;
        let mut high = [self.limited_line(FAR)?, self.free_line(FAR)?];
        let excess = |[t, free]: [Line; 2]| t.value - free.value - share * t.lambda;
        if excess(high) <= self.visible(high) {
            return Some(None);
        }
        for _ in 0..LINES {
            fluxform_base::progress::poll();
            let at = high[0].lambda;
            let above = excess(high);
            // Below the chord from `low` t_0 leaves t* no lower than this line.
            let chord = (high[1].value - low.value) / (at - low.lambda);
            let rate = high[0].slope - chord - share;
            let by_chord = at - above / rate;
            if above <= grain * self.visible(high) || rate <= 0.0 {
                break;
            }
            if by_chord <= low.lambda {
                return Some(Some(low.lambda.max(0.0)));
            }
            // The tangent of t_0 leads further where t_0 bends: there the chord is steeper.
            let by_tangent = at - above / (high[0].slope - high[1].slope - share).max(0.25 * rate);
            let next = if by_tangent < by_chord && by_tangent > low.lambda {
                let near = [self.limited_line(by_tangent)?, self.free_line(by_tangent)?];
                if excess(near) <= grain * self.visible(near) {
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
            // Lines from so far are rounded by more than those from near.
            let next = if at == FAR { NEAR * next } else { next };
            high = [self.limited_line(next)?, self.free_line(next)?];
        }
        self.doubt_at(high[0].gap + high[1].gap, high[0].lambda);
        Some(Some(high[0].lambda))
    }
}

/// What finds the least largest error at one lambda after another.
enum Optima<'s, 'a> {
    Vertices(Box<Doubles<'s, 'a>>),
    Centres(Box<Interior<'s, 'a>>),
}

impl Optima<'_, '_> {
    /// The line at `lambda`, unless it is in too much doubt.
    fn line(&mut self, lambda: f64) -> Option<Line> {
        let (line, most) = match self {
            Self::Vertices(doubles) => {
                let optimum = doubles.at(Num::of(lambda)).ok()?;
                let piece = &optimum.piece;
                let last = piece.z.len() - 1;
                let line = Line {
                    lambda,
                    value: piece.z[last].to_f64(),
                    gap: optimum.doubt,
                    slope: piece.rate[last].to_f64(),
                };
                (line, MOST_DOUBT[0] * doubles.size(lambda))
            }
            Self::Centres(interior) => {
                let centre = interior.at(lambda);
                let line = Line {
                    lambda,
                    value: centre.worst,
                    gap: centre.gap,
                    slope: centre.slope,
                };
                (line, MOST_DOUBT[1] * centre.size)
            }
        };
        (line.gap <= most).then_some(line)
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
        let [limited, free] = [Limits::All, Limits::Lower]
            .map(|limits| Scaled::new(&problem, &largest, Form::Worst, limits));
        let alone = [by_vertices, by_centres].map(|constants| {
            let constants = constants(&limited, &free, settings.jnd_weight).unwrap();
            super::super::without_path(&limited, &constants)
        });
        let pairs = alone.each_ref().map(|alone| {
            [
                (alone.lambda_linear_n_per_m, by_path.lambda_linear_n_per_m),
                (alone.lambda_jnd_n_per_m, by_path.lambda_jnd_n_per_m),
                (alone.floor, by_path.floor),
            ]
        });
        for (alone, by_path) in pairs.into_iter().flatten() {
            let (alone, by_path) = (alone.unwrap(), by_path.unwrap());
            assert!((alone / by_path - 1.0).abs() < 1e-10, "{alone} {by_path}");
        }
        let point = super::super::least_worst_error(&problem, alone[0].lambda_jnd_n_per_m.unwrap());
        assert!(point.gap_n < 1e-12 * point.worst_error_n, "{point:?}");
    }
}
