//! Points, the condition that each must meet, and which of a few a path misses first.

use super::scaled::Form;
use fluxform_numerics::dispatch::{self, Kernel, mul_add};

/// Forces, heights and offsets of some points.
#[derive(Clone, Copy)]
pub(super) struct Points<'a> {
    pub coils: usize,
    pub forces_n_per_a: &'a [f64],
    pub height_m: &'a [f64],
    pub offset_n: Option<&'a [f64]>,
}

/// The condition on the points: `lambda h - share offset - G I` at most `limit`.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    pub lambda_n_per_m: f64,
    /// 1, or 0 for the direction in which a path without end goes on.
    pub offset_share: f64,
    pub currents_a: Vec<f64>,
    pub limit_n: f64,
}

/// The state of a path, in SI units, and how it goes on per unit of lambda.
pub(super) struct Course {
    pub at: Probe,
    /// Errors that rounding explains are no misses.
    pub rounding_n: f64,
    pub rates_a: Vec<f64>,
    pub limit_rate_m: f64,
    /// 1 where lambda moves, 0 where it does not.
    pub lambda_rate: f64,
    /// Rates that rounding explains, m.
    pub rounding_m: f64,
    /// Nothing beyond this step matters.
    pub step: f64,
}

/// Which rows a program has of each point: the bit of each sign.
pub(super) type Held = u8;

/// The bit of a row with that sign.
pub(super) fn bit(up: bool) -> Held {
    if up { 1 } else { 2 }
}

/// The point that a path misses first on its course: where it is missed already the one missed
/// most, where several are at once the one that is left fastest. Rows that are `held` are not
/// considered: those that the path rests on seem to be missed by what rounding leaves of their rates.
pub(super) fn first_missed(
    points: Points,
    held: &[Held],
    course: &Course,
    form: Form,
) -> Option<(usize, bool)> {
    dispatch::run(First {
        points,
        held,
        course,
        form,
    })
}

struct First<'a> {
    points: Points<'a>,
    held: &'a [Held],
    course: &'a Course,
    form: Form,
}

impl Kernel for First<'_> {
    type Output = Option<(usize, bool)>;

    #[inline(always)]
    fn run<const FMA: bool>(self) -> Option<(usize, bool)> {
        let (points, course) = (self.points, self.course);
        let coils = points.coils;
        let signs: &[f64] = if self.form == Form::Worst {
            &[1.0, -1.0]
        } else {
            &[1.0]
        };
        let (mut missed, mut most) = (None, course.rounding_n);
        let (mut first, mut least, mut fastest) = (None, course.step, 0.0);
        for (j, &height) in points.height_m.iter().enumerate() {
            let row = &points.forces_n_per_a[j * coils..(j + 1) * coils];
            let offset = points.offset_n.map_or(0.0, |offset| offset[j]);
            let mut rest = course.at.lambda_n_per_m * height - offset;
            let mut rate = course.lambda_rate * height;
            for ((&force, &current), &speed) in
                row.iter().zip(&course.at.currents_a).zip(&course.rates_a)
            {
                rest = mul_add::<FMA>(-force, current, rest);
                rate = mul_add::<FMA>(-force, speed, rate);
            }
            for &sign in signs {
                let over = sign * rest - course.at.limit_n;
                let asked = || self.held[j] & bit(sign > 0.0) == 0;
                if over > most && asked() {
                    (missed, most) = (Some((j, sign > 0.0)), over);
                }
                let speed = sign * rate - course.limit_rate_m;
                if speed <= course.rounding_m {
                    continue;
                }
                // Within rounding of its limit a point is at it.
                let slack = if over >= -course.rounding_n {
                    0.0
                } else {
                    -over
                };
                let step = slack / speed;
                let sooner = step < least || (step == least && speed > fastest);
                if sooner && asked() {
                    (first, least, fastest) = (Some((j, sign > 0.0)), step, speed);
                }
            }
        }
        missed.or(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows held one by one come in the order in which they are missed.
    #[test]
    fn points_are_reported_in_the_order_in_which_the_path_misses_them() {
        let mut random = fluxform_numerics::random::Random::new(9);
        let mut next = || random.between(-1.0, 1.0);
        let count = 40;
        let forces: Vec<f64> = (0..2 * count).map(|_| next()).collect();
        let heights: Vec<f64> = (0..count).map(|_| 1.3 + 0.7 * next()).collect();
        let offsets: Vec<f64> = (0..count).map(|_| 0.2 * next()).collect();
        let points = Points {
            coils: 2,
            forces_n_per_a: &forces,
            height_m: &heights,
            offset_n: Some(&offsets),
        };
        // With the second limit some points are missed already.
        for (form, limit_n) in [
            (Form::Worst, 3.1),
            (Form::Worst, 1.1),
            (Form::Least, 3.1),
            (Form::Least, 1.1),
        ] {
            let course = Course {
                at: Probe {
                    lambda_n_per_m: 0.7,
                    offset_share: 1.0,
                    currents_a: vec![0.4, -0.3],
                    limit_n,
                },
                rounding_n: 1e-12,
                rates_a: vec![0.9, 0.5],
                limit_rate_m: 0.6,
                lambda_rate: 1.0,
                rounding_m: 1e-12,
                step: 9.0,
            };
            let times = |j: usize, i: &[f64]| forces[2 * j] * i[0] + forces[2 * j + 1] * i[1];
            // How far above, or the step till then.
            let rows = (0..count).flat_map(|j| [(j, true), (j, false)]);
            let mut requested: Vec<((usize, bool), [f64; 2])> = rows
                .filter(|(_, up)| *up || form == Form::Worst)
                .filter_map(|(j, up)| {
                    let sign = if up { 1.0 } else { -1.0 };
                    let error = 0.7 * heights[j] - offsets[j] - times(j, &course.at.currents_a);
                    let over = sign * error - limit_n;
                    let speed = sign * (heights[j] - times(j, &course.rates_a)) - 0.6;
                    if over > 0.0 {
                        Some(((j, up), [-over, 0.0]))
                    } else if speed > 0.0 && -over / speed < course.step {
                        Some(((j, up), [0.0, -over / speed]))
                    } else {
                        None
                    }
                })
                .collect();
            requested.sort_by(|a, b| a.1.partial_cmp(&b.1).unwrap());
            let missed = requested.iter().filter(|row| row.1[0] < 0.0).count();
            assert_eq!(missed > 0, limit_n < 2.0);
            assert!(requested.len() > 10, "{}", requested.len());
            let mut held = vec![0; count];
            for (row, _) in requested {
                // A row missed already is also left at once: it may only come once.
                assert_eq!(first_missed(points, &held, &course, form), Some(row));
                held[row.0] |= bit(row.1);
            }
            assert_eq!(first_missed(points, &held, &course, form), None);
        }
    }
}
