//! The force constants on a followed path (eq. 10), in scaled units.

use std::cmp::Ordering;

use fluxform_numerics::double_double::DoubleDouble as Num;
use fluxform_numerics::real::Real;

use super::homotopy::{Bounds, Piece, Trace};
use super::model::Model;

/// Above this share of `lambda^2 mean(h^2)` e* has left e_0 where both are exact and currents are not unique.
pub(super) const VISIBLE: f64 = 1e-24;

/// e* and the error e_0 without the drivers' size, both as functions of lambda.
pub(super) struct Comparison<'a> {
    /// The path under all limits.
    pub limited: &'a Trace,
    /// The path of e_0.
    pub unlimited: &'a Trace,
    /// Mean of h^2, scaled.
    pub mean_square: Num,
    /// Share of `lambda^2 mean(h^2)` above which e* has left e_0.
    pub visible: f64,
}

/// A stretch on which neither of two paths turns: its ends, and the piece of each path.
pub(super) struct Overlap {
    pub start: Num,
    /// `None`: there is no end.
    pub end: Option<Num>,
    pub pieces: [usize; 2],
}

/// The stretches between the starts of the pieces of either path; both begin at zero. Every stretch
/// passes the start of at least one piece, so there are at most as many as pieces.
pub(super) fn overlaps<P>(a: &[P], b: &[P], start_of: impl Fn(&P) -> Num) -> Vec<Overlap> {
    let (mut i, mut k) = (0, 0);
    let mut start = Num::ZERO;
    let mut all = Vec::new();
    for _ in 0..a.len() + b.len() {
        let (next_a, next_b) = (a.get(i + 1).map(&start_of), b.get(k + 1).map(&start_of));
        let end = match (next_a, next_b) {
            (Some(x), Some(y)) => Some(x.smaller(y)),
            (x, y) => x.or(y),
        };
        all.push(Overlap {
            start,
            end,
            pieces: [i, k],
        });
        let Some(end) = end else {
            break;
        };
        // A start that is not a number is passed as well.
        let passed = |next: Option<Num>| {
            next.is_some_and(|next| next.partial_cmp(&end) != Some(Ordering::Greater))
        };
        i += usize::from(passed(next_a));
        k += usize::from(passed(next_b));
        start = end;
    }
    all
}

/// On one stretch between breakpoints of either path.
struct Stretch<'a> {
    start: Num,
    end: Option<Num>,
    limited: &'a Piece,
    unlimited: &'a Piece,
}

fn square(v: &[Num]) -> Num {
    Num::dot(v, v)
}

impl Stretch<'_> {
    /// `e* - e_0` at `start + step` as coefficients of 1, step, step^2.
    fn excess(&self) -> [Num; 3] {
        let (r, s) = (
            self.limited.residual_at(self.start),
            self.unlimited.residual_at(self.start),
        );
        let (dr, ds) = (&self.limited.residual_rate, &self.unlimited.residual_rate);
        let two = Num::of(2.0);
        [
            square(&r) - square(&s),
            two * (Num::dot(&r, dr) - Num::dot(&s, ds)),
            square(dr) - square(ds),
        ]
    }
}

impl<'a> Comparison<'a> {
    fn stretches(&self) -> Vec<Stretch<'a>> {
        let (a, b) = (&self.limited.pieces, &self.unlimited.pieces);
        let stretch = |overlap: Overlap| Stretch {
            start: overlap.start,
            end: overlap.end,
            limited: &a[overlap.pieces[0]],
            unlimited: &b[overlap.pieces[1]],
        };
        let all = overlaps(a, b, |piece: &Piece| piece.start);
        all.into_iter().map(stretch).collect()
    }

    /// Where the first limit binds, if the unlimited currents are unique: the first lambda at
    /// which they leave the bounds (slack last in the model, its weights among `limited`'s) where
    /// `free` has none.
    pub fn linear(&self, model: &Model, bounds: &Bounds, free: &Bounds) -> Option<Num> {
        let slope = self.mean_square.sqrt();
        let pieces = &self.unlimited.pieces;
        let coils = pieces[0].x.len();
        let mut first: Option<Num> = None;
        for (k, piece) in pieces.iter().enumerate() {
            let floor = Num::of(piece.blur) * slope;
            let mut meet = |distance: Num, rate: Num, floor: Num| {
                let lambda = if distance < Num::ZERO {
                    piece.start
                } else if rate > floor {
                    piece.start + distance / rate
                } else {
                    return;
                };
                let within = pieces.get(k + 1).is_none_or(|next| lambda <= next.start);
                if within && first.is_none_or(|least| lambda < least) {
                    first = Some(lambda);
                }
            };
            // Of the sum: its value, its rate, and the rate that rounding may make up.
            let mut sums = [Num::ZERO; 3];
            for i in 0..coils {
                let (x, rate, weight) = (piece.x[i], piece.x_rate[i], model.weight_of(i));
                let blur = floor + Num::of(piece.blur) * rate.abs();
                for (sum, term) in sums.iter_mut().zip([x, rate, blur]) {
                    *sum += weight * term;
                }
                let near = |distance| beyond_rounding(distance, floor * piece.start);
                if let (Some(upper), None) = (bounds.upper[i], free.upper[i]) {
                    meet(near(upper - x), rate, floor);
                }
                if let (Some(lower), None) = (bounds.lower[i], free.lower[i]) {
                    meet(near(x - lower), -rate, floor);
                }
            }
            if model.weight.is_some() {
                meet(
                    beyond_rounding(bounds.total - sums[0], sums[2] * piece.start),
                    sums[1],
                    sums[2],
                );
            }
            if first.is_some() {
                return first;
            }
        }
        None
    }

    /// The same from the errors alone: the start of the first stretch on which e* leaves e_0.
    pub(crate) fn linear_by_error(&self) -> Option<Num> {
        let visible = Num::of(self.visible) * self.mean_square;
        self.stretches().iter().find_map(|stretch| {
            let length = match stretch.end {
                Some(end) => end - stretch.start,
                None => stretch.start + Num::ONE,
            };
            let lambda = stretch.start + length;
            let [c, b, a] = stretch.excess();
            let excess = c + length * (b + length * a);
            (excess > visible * lambda * lambda).then_some(stretch.start)
        })
    }

    /// The largest lambda with `e* - e_0 <= weight^2 lambda^2 mean(h^2)`; `None`: all of them.
    pub fn jnd(&self, weight: f64) -> Option<Num> {
        let share = Num::of(weight) * Num::of(weight) * self.mean_square;
        for stretch in self.stretches().iter().rev() {
            let start = stretch.start;
            let [c, b, a] = stretch.excess();
            let c = c - share * start * start;
            let b = b - Num::of(2.0) * share * start;
            let a = a - share;
            if stretch.end.is_none() && a <= Num::ZERO {
                return None;
            }
            let crossing = upward_crossing(a, b, c);
            if c <= Num::ZERO {
                // The signs at both ends decide; the root may miss an end by rounding.
                let lambda = crossing.map(|step| start + step);
                return lambda.map_or(stretch.end, |l| {
                    Some(stretch.end.map_or(l, |end| l.smaller(end)))
                });
            }
            if let Some(step) = crossing
                && stretch.end.is_none_or(|end| start + step < end)
            {
                return Some(start + step);
            }
        }
        Some(Num::ZERO)
    }
}

/// A distance that rounding may have made negative is zero.
fn beyond_rounding(distance: Num, rounding: Num) -> Num {
    if distance.abs() <= rounding {
        Num::ZERO
    } else {
        distance
    }
}

/// The step >= 0 at which `c + b step + a step^2` crosses zero upwards.
fn upward_crossing(a: Num, b: Num, c: Num) -> Option<Num> {
    let four = Num::of(4.0);
    let discriminant = b * b - four * a * c;
    if discriminant < Num::ZERO {
        return None;
    }
    let root = discriminant.sqrt();
    let two = Num::of(2.0);
    let step = if b > Num::ZERO {
        -(two * c) / (b + root)
    } else if a == Num::ZERO {
        return None;
    } else {
        (root - b) / (two * a)
    };
    (step >= Num::ZERO).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::{Comparison, Num, Real, VISIBLE};
    use crate::homotopy::{Bounds, Follower};
    use crate::model::Model;

    /// Two opposed coils whose currents cancel, all but what rounding leaves of them, under a limit
    /// of 0 A on the sum: what binds is the limit of the first coil.
    #[test]
    fn a_sum_that_rounding_alone_moves_binds_nowhere() {
        let numbers = |values: &[f64]| values.iter().map(|&v| Num::of(v)).collect::<Vec<_>>();
        let model = Model::new(
            2,
            numbers(&[1.0, 1e-3, 1.0, -1e-3, 0.0, 0.0]),
            Some(numbers(&[1.0; 3])),
            Num::EPSILON,
        );
        let mut bounds = Bounds {
            lower: numbers(&[-1e9, -1e9, 0.0]).into_iter().map(Some).collect(),
            upper: vec![None; 3],
            total: Num::ZERO,
        };
        let coils = Model::new(2, numbers(&[1.0, 1e-3, 1.0, -1e-3]), None, Num::EPSILON);
        let free = Bounds {
            lower: vec![None; 2],
            upper: vec![None; 2],
            total: Num::ZERO,
        };
        let follower = Follower {
            model: &coils,
            bounds: &free,
            start: None,
            most_error: None,
            most_changes: None,
        };
        let mut path = follower.path(None, &numbers(&[0.0, 1.0]));
        // Half a thousand amperes a unit, and as much the other way.
        let piece = &mut path.pieces[0];
        assert!((piece.x_rate[0].to_f64() - 500.0).abs() < 1e-12);
        assert!((piece.x_rate[1].to_f64() + 500.0).abs() < 1e-12);
        // A second piece, on which the sum is above its limit by less than rounding.
        let mut second = piece.clone();
        second.start = Num::of(0.7);
        second.x = second
            .x_rate
            .iter()
            .map(|&rate| second.start * rate)
            .collect();
        second.x[0] += Num::of(10.0 * second.blur);
        path.pieces.push(second);
        bounds.upper[0] = Some(Num::of(650.0));
        let comparison = Comparison {
            limited: &path,
            unlimited: &path,
            mean_square: Num::ONE,
            visible: VISIBLE,
        };
        let linear = comparison.linear(&model, &bounds, &free).unwrap().to_f64();
        assert!((linear - 1.3).abs() < 1e-12, "{linear}");
    }

    fn upward_crossing(a: f64, b: f64, c: f64) -> Option<f64> {
        super::upward_crossing(Num::of(a), Num::of(b), Num::of(c)).map(Real::to_f64)
    }

    #[test]
    fn upward_crossings_are_found_on_either_side_of_a_parabola() {
        // (s - 0.3)(s - 0.7): upwards at 0.7; its negative: upwards at 0.3.
        let close = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() < 1e-15);
        assert!(close(upward_crossing(1.0, -1.0, 0.21), 0.7));
        assert!(close(upward_crossing(-1.0, 1.0, -0.21), 0.3));
        assert!(close(upward_crossing(0.0, 1.3, -0.26), 0.2));
        assert_eq!(upward_crossing(1.3, 0.7, 0.4), None);
        assert_eq!(upward_crossing(0.0, -1.3, 0.26), None);
        // A tiny root of a nearly straight line is not lost to cancellation.
        assert!(close(
            upward_crossing(1e-17, 1.3, -1.3e-9).map(|s| s / 1e-9),
            1.0
        ));
    }
}
